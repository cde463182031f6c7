"""Reads the tapes' text, the original program's own too.

Numbers stand in columns of twelve characters, as Fortran's E12.4 writes them.  Lines are of two
kinds: strains, (2I6,5E12.4) with element and point in front, and plain lines of up to six numbers,
(6E12.4).  In the report's order tape8 holds strains with gamma_yz before gamma_xz and tape9
contact; the listing writes contact on tape8 and strains on tape9, gamma_xz first.  Which one a file
is, its lines tell.

The text does not say how many nodes there are.  Where their number is no multiple of six the short
lines show it; otherwise tape3 is given by its lines, and :meth:`TapeText.fitted` divides them.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fecm._typing import Floats
from fecm.results.schema import ResultFileError
from fecm.results.tapes import CONTACT, CURVATURES

Array = NDArray[Any]

NAMES = ("tape3", "tape8", "tape9")
WIDTH = 12  # characters a number
PER_LINE = 6  # numbers of a plain line
SHEARS = {"tape8": ("gamma_yz", "gamma_xz"), "tape9": ("gamma_xz", "gamma_yz")}
W = "tape3/w"

_LABELS = re.compile(rb" *\d+")
# The letters of Infinity, NaN and the exponents' E and D; all else is no tape.
_FOREIGN = re.compile(rb"[^0-9+\-. EDINFTYA]", re.IGNORECASE)
_NUMBER = re.compile(rb"([+-]?(?:\d+\.?\d*|\.\d+))(?:[ED]([+-]?\d+)|([+-]\d+))?", re.IGNORECASE)
_SPECIAL = re.compile(rb"[+-]?(?:inf(?:inity)?|nan)", re.IGNORECASE)


@dataclass(frozen=True)
class TapeText:
    """What a folder of tapes holds.

    Attributes
    ----------
    arrays : mapping of str to ndarray
        By the names that a result has for them: ``tape3/w`` (rows, nodes), ``tape8/kappa_x`` and so
        on (rows, elements, points), ``tape9/force`` and so on (rows,).
    lines : bool
        Whether ``tape3/w`` is given by its lines, (lines, 6), because nothing tells the number of
        nodes.
    """

    arrays: Mapping[str, Array]
    lines: bool = False

    def fitted(self, nodes: int) -> TapeText:
        """The same, the lines of ``tape3/w`` divided into rows of `nodes` where they can be."""
        if not self.lines or nodes < 1 or nodes % PER_LINE or self.arrays[W].size % nodes:
            return self
        return TapeText({**self.arrays, W: self.arrays[W].reshape(-1, nodes)})


def read_tapes(folder: Path) -> TapeText:
    """Read tape3, tape8 and tape9 of a folder, each as far as it is there.

    Parameters
    ----------
    folder : Path
        Holds files named tape3, tape8, tape9 or tape3.txt, tape8.txt, tape9.txt.

    Raises
    ------
    ResultFileError
        If there is no tape, or one can't be read as such.
    OSError
        If a file can't be opened.
    """
    arrays: dict[str, Array] = {}
    lines = False
    for name in NAMES:
        found = [path for path in (folder / name, folder / f"{name}.txt") if path.exists()]
        if len(found) > 1:
            raise ResultFileError(f"{folder}: there is both a {name} and a {name}.txt")
        if not found:
            continue
        if not found[0].is_file():
            raise ResultFileError(f"{found[0]}: a tape is an ordinary file")
        text = _Lines(found[0])
        if not text.lines:
            continue  # the program opened this tape and wrote nothing
        if name == "tape3":
            arrays[W], lines = _displacements(text)
            continue
        read = _strains(text, SHEARS[name]) if text.labelled else _contact(text)
        if twice := arrays.keys() & read.keys():
            kind = "strains" if "tape8/kappa_x" in twice else "contact"
            raise ResultFileError(f"{folder}: tape8 and tape9 both hold {kind}")
        arrays.update(read)
    if not arrays:
        raise ResultFileError(
            f"{folder}: this folder holds no tape; tape3, tape8 and tape9 are looked for, "
            "with or without .txt"
        )
    return TapeText(arrays, lines)


class _Lines:
    """The lines of one tape."""

    def __init__(self, path: Path) -> None:
        self.path = path
        if not path.is_file():
            raise ResultFileError(f"{path}: this is no file")
        self.lines = [line.rstrip(b" \r") for line in path.read_bytes().split(b"\n")]
        while self.lines and not self.lines[-1]:
            del self.lines[-1]
        first = self.lines[0] if self.lines else b""
        self.labelled = all(_LABELS.fullmatch(label) for label in (first[:6], first[6:12]))

    def refuse(self, index: int, message: str) -> ResultFileError:
        """An error about a line."""
        return ResultFileError(f"{self.path}:{index + 1}: {message}")

    def counts(self, lead: int) -> NDArray[np.int64]:
        """Numbers of every line, (lines,), after `lead` characters of labels."""
        lengths = np.fromiter(map(len, self.lines), dtype=np.int64, count=len(self.lines)) - lead
        counts, rest = np.divmod(lengths, WIDTH)
        wrong = (rest != 0) | (counts < 1) | (counts > PER_LINE)
        if wrong.any():
            index = int(wrong.argmax())
            raise self.refuse(
                index,
                f"a line of {len(self.lines[index])} characters is no line of numbers in columns "
                f"of {WIDTH}",
            )
        return counts

    def numbers(self, lead: int) -> Floats:
        """All numbers of all lines, one after the other."""
        text = b"".join(line[lead:] for line in self.lines)
        fields = np.frombuffer(text, dtype=f"S{WIDTH}")
        if not _FOREIGN.search(text):
            try:
                values = fields.astype(np.float64)
            except ValueError:
                pass  # an exponent without its letter, or no number at all
            else:
                if not np.isinf(values).any():
                    return values
        return self._slowly(lead)

    def _slowly(self, lead: int) -> Floats:
        """The same, number by number; says which one can't be read."""
        values: list[float] = []
        for index, line in enumerate(self.lines):
            for start in range(lead, len(line), WIDTH):
                field = line[start : start + WIDTH]
                value = fortran_number(field)
                if value is None:
                    told = ascii(field.decode("latin-1"))[1:-1]
                    raise self.refuse(index, f"`{told}` is not a number")
                values.append(value)
        return np.array(values)


def fortran_number(field: bytes) -> float | None:
    """Value of a field of Fortran's format E12.4; None where it is no number or too large.

    Parameters
    ----------
    field : bytes
        As in ``  0.1234E+01``, ``  0.1234+100`` (three digits in the exponent leave no room for its
        letter), ``         NaN``, ``   -Infinity``.
    """
    text = field.strip(b" ")
    if _SPECIAL.fullmatch(text):
        return float(text)
    match = _NUMBER.fullmatch(text)
    if match is None:
        return None
    value = float(match[1] + b"E" + (match[2] or match[3] or b"0"))
    return value if np.isfinite(value) else None


def _displacements(text: _Lines) -> tuple[Array, bool]:
    """Displacements w, (rows, nodes); or (lines, 6) and True where nodes can't be counted."""
    counts = text.counts(0)
    values = text.numbers(0)
    ends = np.flatnonzero(counts < PER_LINE)
    if not len(ends):
        return values.reshape(-1, PER_LINE), True
    lengths = np.diff(ends, prepend=-1)
    wrong = (lengths != lengths[0]) | (counts[ends] != counts[ends[0]])
    if wrong.any():
        index = int(ends[wrong.argmax()])
        raise text.refuse(index, "the row that ends here has not as many numbers as the first")
    if ends[-1] != len(counts) - 1:
        raise text.refuse(len(counts) - 1, "the last row is not complete")
    return values.reshape(len(ends), -1), False


def _contact(text: _Lines) -> dict[str, Array]:
    """Columns of the contact tape, (rows,) each."""
    counts = text.counts(0)
    if (counts != len(CONTACT)).any():
        index = int((counts != len(CONTACT)).argmax())
        raise text.refuse(index, f"{counts[index]} numbers stand where a line of contact has six")
    table = text.numbers(0).reshape(-1, len(CONTACT))
    return {f"tape9/{name}": table[:, i].copy() for i, name in enumerate(CONTACT)}


def _strains(text: _Lines, shears: tuple[str, str]) -> dict[str, Array]:
    """Columns of the strain tape, (rows, elements, points) each."""
    names = (*CURVATURES, *shears)
    counts = text.counts(2 * PER_LINE)
    if (counts != len(names)).any():
        index = int((counts != len(names)).argmax())
        raise text.refuse(index, f"{counts[index]} numbers stand where a line of strains has five")
    labels = _labels(text)
    numel, npt = (max(1, int(size)) for size in labels.max(axis=0))
    order = np.arange(len(labels)) % (numel * npt)
    expected = np.stack(np.divmod(order, npt), axis=1) + 1
    wrong = (labels != expected).any(axis=1)
    if wrong.any():
        index = int(wrong.argmax())
        element, point = expected[index]
        raise text.refuse(index, f"element {element}, point {point} would be next")
    if len(labels) % (numel * npt):
        raise text.refuse(len(labels) - 1, "the last row is not complete")
    table = text.numbers(2 * PER_LINE).reshape(-1, numel, npt, len(names))
    return {f"tape8/{name}": table[..., i].copy() for i, name in enumerate(names)}


def _labels(text: _Lines) -> NDArray[np.int64]:
    """Element and point of every line, (lines, 2)."""
    labels = np.empty((len(text.lines), 2), dtype=np.int64)
    for index, line in enumerate(text.lines):
        pair = line[:6], line[6:12]
        if not all(_LABELS.fullmatch(label) for label in pair):
            raise text.refuse(index, "a line of strains begins with its element and point")
        labels[index] = int(pair[0]), int(pair[1])
    return labels
