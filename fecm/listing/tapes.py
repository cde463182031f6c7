"""The three tapes as text, in the formats of the printed program.

Numbers are in columns of twelve characters, as Fortran's E12.4 writes them.

- tape3 holds w of every node, (6E12.4).
- tape8 holds strains in the report, (2I6,5E12.4).  A line starts with element and point; gamma_yz
  precedes gamma_xz.
- tape9 holds the contact in the report, (6E12.4).

The slip ``tapes`` exchanges tape8 with tape9, and the columns of the shear strains.  The lines show
which of the two a file is.

The text does not state the number of nodes.  Short lines reveal it unless it is a multiple of six.
In that case tape3 is read as lines, and :meth:`TapeText.fitted` divides them into rows.
"""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from fecm._errors import ResultFileError
from fecm._files import beside
from fecm._typing import Array, Floats

TAPES = "tapes"  # `form` of a folder of tapes, see `Contents.form`; also the name of the slip
NAMES = ("tape3", "tape8", "tape9")
WIDTH = 12  # characters per number
DIGITS = 4  # digits of the mantissa
PER_LINE = 6  # numbers per line without labels
LABEL = 6  # characters of an element's or a point's number
SHEARS = {"tape8": ("gamma_yz", "gamma_xz"), "tape9": ("gamma_xz", "gamma_yz")}
W = "tape3/w"
CURVATURES = ("kappa_x", "kappa_y", "kappa_xy")
CONTACT = ("force", "indentation", "transducer", "displacement", "velocity", "acceleration")
_LABELS = re.compile(rb" *\d+")
# The allowed letters occur in Infinity, in NaN and in exponents (E and D).
_FOREIGN = re.compile(rb"[^0-9+\-. EDINFTYA]", re.IGNORECASE)
_NUMBER = re.compile(rb"([+-]?(?:\d+(?:\.\d*)?|\.\d+))(?:[ED]([+-]?\d+)|([+-]\d+))?", re.IGNORECASE)
_SPECIAL = re.compile(rb"[+-]?(?:inf(?:inity)?|nan)", re.IGNORECASE)


class OnTape(Protocol):
    """Source of tapes: datasets by path, and the slips of their run."""

    @property
    def slips(self) -> tuple[str, ...]:
        """Names of the active slips."""

    def __contains__(self, path: str) -> bool: ...
    def __getitem__(self, path: str) -> Array: ...


def fortran_e(value: float) -> str:
    """Format a number as E12.4: ``  0.2322E+01``."""
    if not np.isfinite(value):
        text = "NaN" if np.isnan(value) else ("-Infinity" if value < 0 else "Infinity")
        return text.rjust(WIDTH)
    mantissa, _, power = f"{value:.3e}".partition("e")
    sign = "-" if mantissa.startswith("-") else ""
    digits = mantissa.lstrip("-").replace(".", "")
    exponent = int(power) + (digits != "0000")
    # A three-digit exponent has no letter.
    mark = f"E{exponent:+03d}" if abs(exponent) < 100 else f"{exponent:+04d}"
    return f"{sign}0.{digits}{mark}".rjust(WIDTH)


def last_digit(values: Floats) -> Floats:
    """Return one unit of the last printed digit of numbers; 0 for zeros and non-finite numbers."""
    size = np.abs(values)
    has_digits = np.isfinite(values) & (size > 0.0)
    power = np.floor(np.log10(np.where(has_digits, size, 1.0)) + 1e-9) + 1.0
    return np.where(has_digits, 10.0 ** (power - DIGITS), 0.0)


def _lines(table: Floats) -> Iterator[str]:
    """Yield lines of six numbers; the last line of a row may be shorter."""
    for row in table:
        for start in range(0, len(row), PER_LINE):
            yield "".join(map(fortran_e, row[start : start + PER_LINE].tolist()))


def _strain_lines(columns: Sequence[Array]) -> Iterator[str]:
    """Yield lines of element, point and strains."""
    for row in zip(*columns, strict=True):
        values = np.stack(row, axis=-1)
        for element, point in np.ndindex(values.shape[:2]):
            text = "".join(map(fortran_e, values[element, point].tolist()))
            yield f"{element + 1:6d}{point + 1:6d}{text}"


def tape_texts(result: OnTape) -> dict[str, Iterator[str]]:
    """Return the lines of every tape that the run stored, by name."""
    strains, contact = "tape8", "tape9"
    if TAPES in result.slips:
        strains, contact = contact, strains

    def columns(group: str, names: Iterable[str]) -> list[Array]:
        paths = [f"{group}/{name}" for name in names]
        for path in paths:
            if path not in result:
                raise ResultFileError(f"the result lacks {path}, which a tape needs")
        return [result[path] for path in paths]

    texts: dict[str, Iterator[str]] = {}
    if W in result:
        texts["tape3"] = _lines(result[W])
    if "tape8/kappa_x" in result:
        texts[strains] = _strain_lines(columns("tape8", (*CURVATURES, *SHEARS[strains])))
    if "tape9/force" in result:
        texts[contact] = _lines(np.stack(columns("tape9", CONTACT), axis=-1))
    return dict(sorted(texts.items()))


def write_tapes(result: OnTape, folder: Path, *, overwrite: bool = True) -> list[Path]:
    """Write all tapes into a folder, or none of them.  A missing folder is created.

    Returns the paths of the files.  Raises OSError if a file can't be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    texts = {folder / name: lines for name, lines in tape_texts(result).items()}
    with contextlib.ExitStack() as stack:
        for path, lines in texts.items():
            partial = stack.enter_context(beside(path, overwrite=overwrite))
            with partial.open("w", encoding="ascii", newline="\n") as file:
                file.writelines(f"{line}\n" for line in lines)
    return list(texts)


@dataclass(frozen=True)
class TapeText:
    """Contents of a folder of tapes."""

    # By path: ``tape3/w`` (rows, nodes), ``tape8/kappa_x`` etc. (rows, elements, points),
    # ``tape9/force`` etc. (rows,).
    arrays: Mapping[str, Array]
    # Whether ``tape3/w`` has lines, (lines, 6), because the number of nodes is not known.
    lines: bool = False
    form = TAPES

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shape of every dataset."""
        return {name: values.shape for name, values in self.arrays.items()}

    @property
    def dtypes(self) -> dict[str, np.dtype[Any]]:
        """Type of every dataset."""
        return {name: values.dtype for name, values in self.arrays.items()}

    def rows(self, path: str, start: int, stop: int) -> Array:
        """Return the rows `start` to `stop` of a dataset."""
        return self.arrays[path][start:stop]

    def fitted(self, nodes: int) -> TapeText:
        """Return a copy with the lines of ``tape3/w`` divided into rows of `nodes`, if possible."""
        if not self.lines or nodes < 1 or nodes % PER_LINE or self.arrays[W].size % nodes:
            return self
        return TapeText({**self.arrays, W: self.arrays[W].reshape(-1, nodes)})


def read_tapes(folder: Path) -> TapeText:
    """Read tape3, tape8 and tape9 of a folder, with or without ``.txt``.  Some may be missing.

    Raises ResultFileError if the folder has no tape, or a tape is invalid.
    """
    arrays: dict[str, Array] = {}
    lines = False
    for name in NAMES:
        paths = [path for path in (folder / name, folder / f"{name}.txt") if path.exists()]
        if len(paths) > 1:
            raise ResultFileError(f"{folder}: there is both a {name} and a {name}.txt")
        if not paths:
            continue
        text = _Lines(paths[0])
        if not text.lines:
            continue  # the program opened the tape but never wrote to it
        if name == "tape3":
            arrays[W], lines = _displacements(text)
            continue
        if text.labelled:
            kind = "strains"
            group = "tape8"
            names = [*CURVATURES, *SHEARS[name]]
            table = _strains(text)
        else:
            kind = "contact"
            group = "tape9"
            names = [*CONTACT]
            table = text.table(lead=0, width=len(names), what=kind)
        if any(path.startswith(group) for path in arrays):
            raise ResultFileError(f"{folder}: tape8 and tape9 both hold {kind}")
        arrays |= {f"{group}/{quantity}": table[..., i].copy() for i, quantity in enumerate(names)}
    if not arrays:
        message = f"{folder}: no tape3, tape8 or tape9 in this folder, with or without .txt"
        raise ResultFileError(message)
    return TapeText(arrays, lines)


class _Lines:
    """The lines of one tape."""

    def __init__(self, path: Path) -> None:
        self.path = path
        if not path.is_file():
            raise ResultFileError(f"{path}: not a regular file")
        self.lines = [line.rstrip(b" \r") for line in path.read_bytes().split(b"\n")]
        while self.lines and not self.lines[-1]:
            del self.lines[-1]
        first = self.lines[0] if self.lines else b""
        self.labelled = all(_LABELS.fullmatch(label) for label in _pair(first))

    def refuse(self, wrong: Array, message: str, *values: Array) -> None:
        """Raise an error about the first wrong line, if any; its values go into the message."""
        if wrong.any():
            n = int(wrong.argmax())
            text = message.format(*(value[n] for value in values))
            raise ResultFileError(f"{self.path}:{n + 1}: {text}")

    def counts(self, lead: int) -> Array:
        """Count the numbers of every line, (lines,), after `lead` characters of labels."""
        lengths = np.fromiter(map(len, self.lines), dtype=np.int64)
        counts, rest = np.divmod(lengths - lead, WIDTH)
        message = f"a line of {{}} characters does not consist of columns of {WIDTH}"
        self.refuse((rest != 0) | (counts < 1) | (counts > PER_LINE), message, lengths)
        return counts

    def table(self, lead: int, width: int, what: str) -> Floats:
        """Return the numbers of lines of equal length, (lines, width)."""
        counts = self.counts(lead)
        self.refuse(counts != width, f"a line of {what} has {width} numbers, not {{}}", counts)
        return self.numbers(lead).reshape(-1, width)

    def numbers(self, lead: int) -> Floats:
        """Return all numbers of all lines, in order."""
        text = b"".join(line[lead:] for line in self.lines)
        if not _FOREIGN.search(text):
            # This fails for exponents without a letter, and for text that is not a number.
            with contextlib.suppress(ValueError):
                values = np.frombuffer(text, dtype=f"S{WIDTH}").astype(np.float64)
                if not np.isinf(values).any():
                    return values
        parsed: list[float] = []
        for index, line in enumerate(self.lines):
            for start in range(lead, len(line), WIDTH):
                field = line[start : start + WIDTH]
                if (value := fortran_number(field)) is None:
                    wrong = ascii(field.decode("latin-1"))[1:-1]
                    raise ResultFileError(f"{self.path}:{index + 1}: `{wrong}` is not a number")
                parsed.append(value)
        return np.array(parsed)

    def require_complete(self, complete: bool) -> None:
        """Raise ResultFileError unless the last line ends a row."""
        if not complete:
            raise ResultFileError(f"{self.path}:{len(self.lines)}: the last row is not complete")


def _pair(line: bytes) -> tuple[bytes, bytes]:
    """Return the labels of element and point at the start of a line of strains."""
    return line[:LABEL], line[LABEL : 2 * LABEL]


def fortran_number(field: bytes) -> float | None:
    """Return the value of a Fortran E12.4 field; None if it is invalid or too large.

    Valid fields are ``  0.1234E+01``, ``  0.1234+100`` (a three-digit exponent has no letter),
    ``         NaN`` and ``   -Infinity``.
    """
    text = field.strip(b" ")
    if _SPECIAL.fullmatch(text):
        return float(text)
    if (match := _NUMBER.fullmatch(text)) is None:
        return None
    value = float(match[1] + b"E" + (match[2] or match[3] or b"0"))
    return value if np.isfinite(value) else None


def _displacements(text: _Lines) -> tuple[Array, bool]:
    """Return w, (rows, nodes) and False; (lines, 6) and True if the nodes can't be counted."""
    counts = text.counts(0)
    values = text.numbers(0)
    ends = np.flatnonzero(counts < PER_LINE)
    if not len(ends):
        return values.reshape(-1, PER_LINE), True
    lengths = np.diff(ends, prepend=-1)
    wrong = np.zeros(len(counts), dtype=bool)
    wrong[ends] = (lengths != lengths[0]) | (counts[ends] != counts[ends[0]])
    text.refuse(wrong, "the row that ends here differs in length from the first")
    text.require_complete(bool(ends[-1] == len(counts) - 1))
    return values.reshape(len(ends), -1), False


def _strains(text: _Lines) -> Floats:
    """Return the table of the strain tape, (rows, elements, points, 5)."""
    table = text.table(lead=2 * LABEL, width=5, what="strains")
    pairs = [_pair(line) for line in text.lines]
    unlabelled = [not all(map(_LABELS.fullmatch, pair)) for pair in pairs]
    text.refuse(np.array(unlabelled), "a line of strains begins with its element and point")
    labels = np.array(pairs).astype(int)
    numel, npt = (max(1, int(size)) for size in labels.max(axis=0))
    order = np.arange(len(labels)) % (numel * npt)
    element, point = (part + 1 for part in np.divmod(order, npt))
    wrong = (labels[:, 0] != element) | (labels[:, 1] != point)
    text.refuse(wrong, "expected element {}, point {}", element, point)
    text.require_complete(not len(labels) % (numel * npt))
    return table.reshape(-1, numel, npt, 5)
