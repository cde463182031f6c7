"""Compares the datasets of two results.

Two numbers are equal if |a - b| <= atol + rtol*scale.  The scale is the largest finite absolute
value of the complete dataset in both results, so that a zero crossing of a history is judged by the
size of the history.  Datasets that may hold nothing but rounding errors have another scale
(`SCALE_NAMES`).  Integers (steps, node and equation numbers) and texts must be equal.  NaN equals
NaN, and an infinity the same infinity; either differs from anything else at any tolerance.

Numbers of tapes are by default equal if they differ by at most one unit of the last printed digit.

Datasets are read in blocks of rows: memory does not grow with the results.
"""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import numpy as np

from fecm._errors import FecmError
from fecm._typing import Array
from fecm.deck.mesh_cards import DOF_NAMES
from fecm.results.blocks import row_blocks
from fecm.results.hdf5_reader import Contents, read
from fecm.results.missing import suggestion
from fecm.results.schema import CONTACT, DATASETS, SCALES, Form, dataset_of
from fecm.results.tapes import SHEARS, TAPES, TapeText, W, last_digit, read_tapes

# Names and first numbers of the axes of a sweep's datasets: cases count from 0, as in commands.
CASES = (("case", 0), ("step", 1))
LINES = (("line", 1), ("column", 1))  # those of tape3 without a known number of nodes
SOURCE_NAMES: dict[str, str] = {
    Form.RUN: "the result of a run",
    Form.SWEEP: "the result of a sweep",
    TAPES: "a folder of tapes",
}
# Those of a resultant or strain that is zero in bending, and those of its bending counterpart.
RESULTANTS = ("N_x", "N_y", "N_xy")
COUPLES = ("M_x", "M_y", "M_xy")
STRAINS = ("eps_xx", "eps_yy", "gamma_xy")
CURVATURES = ("kappa_x", "kappa_y", "kappa_xy")
# Datasets that tapes hold.
ON_TAPE = {
    W,
    *(f"tape8/{name}" for name in (*CURVATURES, *SHEARS["tape8"])),
    *(f"tape9/{name}" for name in CONTACT),
}


class Scale(StrEnum):
    """A scale of differences other than the largest value of the dataset, in words."""

    ENERGY = "the energy put in"
    COUPLING = "sqrt(max A * max D)"
    INTERLAMINAR = "the largest interlaminar stress"
    RESULTANT = "the largest N or M * sqrt(A/D)"
    STRAIN = "the largest strain or curvature * sqrt(D/A)"
    CONTACT = "the largest indentation in contact"


SCALE_NAMES = {
    "energy/balance_error": Scale.ENERGY,
    "laminate/B": Scale.COUPLING,
    "plies/residual": Scale.INTERLAMINAR,
    **{f"stresses/{name}": Scale.RESULTANT for name in RESULTANTS},
    **{f"stresses/{name}": Scale.STRAIN for name in STRAINS},
    "history/indentation": Scale.CONTACT,
    "tape9/indentation": Scale.CONTACT,
}


class IncomparableError(FecmError, ValueError):
    """The sources can't be compared, or lack the requested datasets."""


Source = Contents | TapeText


@dataclass
class Comparison:
    """One dataset of two sources."""

    path: str
    sources: tuple[Source, Source] = field(repr=False)  # A and B
    maximum: float = 0.0  # largest finite absolute value in both
    scale: float = 0.0  # of the differences: `maximum` except for `SCALE_NAMES`
    tolerance: float = 0.0  # largest difference of equal numbers
    to_last_digit: bool = False  # whether that of smaller numbers is smaller: their last digit
    largest: float = 0.0  # largest difference; infinite if only one of two numbers is finite
    # Its place: index, step, time and names of other indices; None if all is equal.
    at: dict[str, Any] | None = None
    values: tuple[float, float] | tuple[str, str] | None = None  # those of A and B there
    differing: int = 0  # number of differences beyond the tolerance
    first: dict[str, Any] | None = None  # first row with one, if the rows are instants

    @property
    def shapes(self) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Shapes in A and B."""
        a, b = self.sources
        return a.shapes[self.path], b.shapes[self.path]

    @property
    def types(self) -> tuple[str, str]:
        """Names of the types in A and B."""
        a, b = (str(source.dtypes[self.path]) for source in self.sources)
        return a.replace("object", "text"), b.replace("object", "text")

    @property
    def holds_texts(self) -> bool:
        """Whether A or B holds texts."""
        return "text" in self.types

    @property
    def comparable(self) -> bool:
        """Whether the shapes are equal, and both hold numbers or both texts."""
        return len(set(self.shapes)) == 1 and self.types.count("text") != 1

    @property
    def same(self) -> bool:
        """Whether shape, type and all values are equal."""
        return self.comparable and len(set(self.types)) == 1 and not self.differing

    @property
    def relative(self) -> float:
        """Largest difference over the scale."""
        return self.largest / self.scale if self.scale else self.largest and np.inf

    def blocks(self) -> Iterator[tuple[int, Array, Array]]:
        """Yield number of the first row, rows of A and rows of B."""
        a, b = self.sources
        for start, stop in row_blocks(self.shapes[0]):
            yield start, a.rows(self.path, start, stop), b.rows(self.path, start, stop)


@dataclass
class Difference:
    """Outcome of a comparison."""

    compared: list[Comparison]  # datasets of both sources, by name
    only: tuple[list[str], list[str]]  # datasets that only A has, and only B
    # Attributes and texts that differ, which are not judged: name, a, b, line.
    listed: list[dict[str, Any]]
    excluded: list[str]  # datasets that were not compared
    to_last_digit: bool = False  # whether numbers of tapes are compared to their last digit

    @property
    def same(self) -> bool:
        """Whether all datasets are equal."""
        return not any(self.only) and all(found.same for found in self.compared)


def difference(
    a: Path,
    b: Path,
    rtol: float | None = None,
    atol: float | None = None,
    only: Sequence[str] = (),
    exclude: Sequence[str] = (),
    own: Sequence[tuple[str, Sequence[float]]] = (),
) -> Difference:
    """Compare two results: files, or folders of tapes.

    Two numbers are equal if they differ by at most `rtol` times the dataset's scale plus `atol` (in
    its unit); without both, exactly, or those of tapes to their last digit.  `only` and `exclude`
    are datasets, groups, or patterns of their names.  `own` are such names, each with ``(rtol,)``
    or ``(rtol, atol)`` instead of the general ones; of several that match, the last one holds.

    Raises IncomparableError if only one is the result of a sweep, if `only` matches no dataset of
    the results, if another pattern matches neither that nor one that a result can have, or if
    nothing is left.  Raises ResultFileError if a file can't be read, OSError if it can't be opened.
    """
    left, right = (read_tapes(p) if p.is_dir() else read(p, Form.RUN, Form.SWEEP) for p in (a, b))
    forms = left.form, right.form
    if left.form != right.form and Form.SWEEP in forms:
        names = " and B ".join(SOURCE_NAMES[form] for form in forms)
        raise IncomparableError(f"A is {names}: they can't be compared")
    left, right = _fitted(left, right), _fitted(right, left)
    shared = ON_TAPE if TAPES in forms else left.shapes.keys() | right.shapes
    in_a, in_b = left.shapes.keys() & shared, right.shapes.keys() & shared
    both = in_a | in_b
    asked = _chosen(both, only) if only else both
    excluded = asked & _chosen(both, exclude, DATASETS)
    chosen = asked - excluded
    if excluded and not chosen:
        raise IncomparableError("every dataset is excluded")
    to_last_digit = TAPES in forms and rtol is None and atol is None
    general = None if to_last_digit else (rtol or 0.0, atol or 0.0)
    tolerances = dict.fromkeys(chosen, general)
    for pattern, (relative, *absolute) in own:
        for path in _chosen(both, [pattern], DATASETS) & chosen:
            tolerances[path] = (relative, absolute[0] if absolute else atol or 0.0)
    with contextlib.ExitStack() as stack:
        for source in (left, right):
            if isinstance(source, Contents):
                stack.enter_context(source.held())
        pair = left, right
        return Difference(
            [_compare(pair, path, tolerances[path]) for path in sorted(in_a & in_b & chosen)],
            (sorted((in_a - in_b) & chosen), sorted((in_b - in_a) & chosen)),
            _listed(*pair),
            sorted(excluded),
            to_last_digit,
        )


def _fitted(source: Source, other: Source) -> Source:
    """Divide tape3 into rows of as many nodes as the other source has, if that is a file."""
    shape = other.shapes.get(W, ())
    if isinstance(source, TapeText) and other.form != TAPES and len(shape) == 2:
        return source.fitted(shape[1])
    return source


def _chosen(names: set[str], patterns: Sequence[str], known: Collection[str] = ()) -> set[str]:
    """Names that match patterns or lie in groups that do; each must match one, or a known name."""
    chosen: set[str] = set()
    for asked in patterns:
        plain = asked.strip("/")
        every = names.union(known)
        found = {n for n in every if fnmatchcase(n, plain) or n.startswith(f"{plain}/")}
        if not found:
            raise IncomparableError(f"there is no `{asked}` to compare{suggestion(plain, names)}")
        chosen |= found & names
    return chosen


def _listed(a: Source, b: Source) -> list[dict[str, Any]]:
    """Attributes, and first lines of texts, that differ between two files; tapes have none."""
    if isinstance(a, TapeText) or isinstance(b, TapeText):
        return []
    left, right = _attributes(a), _attributes(b)
    listed = [
        {"name": name, "a": left.get(name), "b": right.get(name), "line": None}
        for name in dict.fromkeys((*left, *right))
        if repr(left.get(name)) != repr(right.get(name))
    ]
    for name in dict.fromkeys((*a.texts, *b.texts)):
        one, other = a.texts.get(name), b.texts.get(name)
        if one is None or other is None:
            there = {"a": one and "a text", "b": other and "a text", "line": None}
            listed.append({"name": name, **there})
        elif one != other:
            pairs = itertools.zip_longest(one.split("\n"), other.split("\n"))
            line, (x, y) = next((n, (x, y)) for n, (x, y) in enumerate(pairs, 1) if x != y)
            listed.append({"name": name, "a": x, "b": y, "line": line})
    return listed


def _attributes(source: Contents) -> dict[str, Any]:
    """All attributes by name: ``title``, ``energy:initial``, ``tape3/w:unit``."""
    named = source.groups | {path: source.attributes_of(path) for path in source}
    return source.attributes | {
        f"{path}:{name}": value
        for path, attributes in named.items()
        for name, value in attributes.items()
    }


def _compare(
    sources: tuple[Source, Source], path: str, tolerances: tuple[float, float] | None
) -> Comparison:
    """Compare a dataset of both sources, by rtol and atol, or to the last digit of tapes."""
    found = Comparison(path, sources)
    if found.comparable and found.holds_texts:
        left, right = (source.rows(path, 0, source.shapes[path][0]) for source in sources)
        rows = np.flatnonzero(left != right)
        found.differing = len(rows)
        if len(rows):
            found.largest, found.at = np.inf, _place(found, (int(rows[0]),))
            found.values = str(left[rows[0]]), str(right[rows[0]])
    elif found.comparable:
        infinite = _measure(found)
        integers = all(source.dtypes[path].kind in "biu" for source in sources)
        found.scale = _own_scale(found) or found.maximum
        if tolerances is None:
            found.tolerance = float(last_digit(np.array(found.maximum)))
            found.to_last_digit = True
        elif not integers:
            rtol, atol = tolerances
            found.tolerance = atol + rtol * found.scale
        if infinite or found.largest > (0.0 if found.to_last_digit else found.tolerance):
            _count(found)
    return found


def _own_scale(found: Comparison) -> float:
    """Scale of the differences of a dataset that is not its maximum; 0 if there is none."""
    group, name = found.path.partition("/")[0], found.path.rpartition("/")[2]
    match SCALE_NAMES.get(f"{group}/{name}" if group == "laminate" else found.path):
        case None:
            return 0.0
        case Scale.ENERGY:
            return _initial_energy(found) + _largest(found, "energy/external_work")
        case Scale.COUPLING:  # with the thickness h, A h and D / h have the order of B
            return float((_largest_laminate(found, "A") * _largest_laminate(found, "D")) ** 0.5)
        case Scale.INTERLAMINAR:
            return max(_largest(found, "plies/tau_xz"), _largest(found, "plies/tau_yz"))
        case Scale.RESULTANT:
            couples = _largest_of(found, COUPLES) * _inverse_thickness(found)
            return max(_largest_of(found, RESULTANTS), couples)
        case Scale.STRAIN:
            ratio = _inverse_thickness(found)
            bending = _largest_of(found, CURVATURES) / ratio if ratio else 0.0
            return max(_largest_of(found, STRAINS), bending)
        case Scale.CONTACT:
            group = found.path.partition("/")[0]
            # A tape has few digits of every number, also in free flight.
            known = all(f"{group}/step" in source.shapes for source in found.sources)
            return _largest(found, found.path, above=0.0) if known else 0.0


def _largest(found: Comparison, path: str, above: float = -np.inf) -> float:
    """Largest finite absolute value of a dataset in both sources, of the numbers above a limit."""
    size = 0.0
    for source in found.sources:
        if path in source.shapes and source.dtypes[path].kind != "O":
            for rows in row_blocks(source.shapes[path]):
                block = source.rows(path, *rows)
                counted = np.abs(block[np.isfinite(block) & (block > above)])
                size = max(size, float(counted.max(initial=0.0)))
    return size


def _largest_of(found: Comparison, names: Sequence[str]) -> float:
    """Largest value of some of the resultants and strains that STRE stores."""
    return max(_largest(found, f"stresses/{name}") for name in names)


def _inverse_thickness(found: Comparison) -> float:
    """sqrt(A/D), which is of the order of 1/h; 0 if it is not known."""
    bending = _largest_laminate(found, "D") or np.inf
    return float((_largest_laminate(found, "A") / bending) ** 0.5)


def _largest_laminate(found: Comparison, name: str) -> float:
    """Largest value of a stiffness matrix of the laminates."""
    paths = {path for source in found.sources for path in source.shapes}
    own = [p for p in paths if p.startswith("laminate/") and p.endswith(f"/{name}")]
    return max((_largest(found, path) for path in own), default=0.0)


def _initial_energy(found: Comparison) -> float:
    """Largest initial energy of both files; 0 if it is not known."""
    files = (source for source in found.sources if isinstance(source, Contents))
    initial = (file.groups.get("energy", {}).get("initial") for file in files)
    known = (abs(e) for e in initial if isinstance(e, int | float) and np.isfinite(e))
    return max(known, default=0.0)


def _measure(found: Comparison) -> bool:
    """Find maximum, largest difference and its place; return whether it is infinite."""
    place: tuple[int, ...] = ()
    infinite = False
    for start, left, right in found.blocks():
        for values in (left, right):
            size = np.abs(values, where=np.isfinite(values), out=np.zeros(values.shape))
            found.maximum = max(found.maximum, float(size.max(initial=0.0)))
        apart, strange = _differences(left, right)
        if infinite or not apart.size:
            continue  # no other difference is larger
        here = int((strange if strange.any() else apart).argmax())
        index = np.unravel_index(here, apart.shape)
        if strange.any() or apart[index] > found.largest:
            infinite = bool(strange.any())
            found.largest = np.inf if infinite else float(apart[index])
            found.values = float(left[index]), float(right[index])
            place = (start + int(index[0]), *map(int, index[1:]))
    if place:
        found.at = _place(found, place)
    return infinite


def _count(found: Comparison) -> None:
    """Count the differences beyond the tolerance, and find the first row that has one."""
    instants = found.shapes[0] and (_clock(found) or found.path.startswith("tape"))
    for start, left, right in found.blocks():
        apart, strange = _differences(left, right)
        tolerance: Any = found.tolerance
        if found.to_last_digit:
            pairs = zip(found.sources, (left, right), strict=True)
            printed = [last_digit(values) for one, values in pairs if isinstance(one, TapeText)]
            tolerance = (1.0 + 1e-9) * np.max(printed, axis=0)
        wrong = strange | (apart > tolerance)
        found.differing += int(np.count_nonzero(wrong))
        if found.first is None and wrong.any() and instants:
            row = int(wrong.reshape(len(wrong), -1).any(axis=1).argmax())
            found.first = _place(found, (start + row,))


def _differences(left: Array, right: Array) -> tuple[Array, Array]:
    """|a - b| where both are finite, else 0; and a mask of other unequal numbers."""
    if left.dtype.kind in "biu" and right.dtype.kind in "biu":
        apart = np.abs(left.astype(float) - right.astype(float))
        unequal = left != right
        # Different large integers may be equal as floats.
        return np.where(unequal, np.maximum(apart, 1.0), 0.0), np.zeros(left.shape, bool)
    left, right = left.astype(float), right.astype(float)
    finite = np.isfinite(left) & np.isfinite(right)
    with np.errstate(over="ignore", invalid="ignore"):
        apart = np.where(finite, np.abs(left - right), 0.0)
    equal = (left == right) | (np.isnan(left) & np.isnan(right))
    return apart, ~finite & ~equal


def _clock(found: Comparison) -> tuple[Source, str] | None:
    """Source and group whose step and time belong to the rows of a dataset."""
    group = found.path.rpartition("/")[0]
    for source in found.sources:
        rows = source.shapes[found.path][:1]
        clock = [n for n in (f"{group}/step", f"{group}/time") if source.shapes.get(n) == rows]
        if rows and [source.dtypes[name].kind for name in clock] == ["i", "f"]:
            return source, group
    return None


def _place(found: Comparison, index: tuple[int, ...]) -> dict[str, Any]:
    """Index, step and time of a place, and its other indices, from 1, by the names of the axes."""
    place: dict[str, Any] = {"index": list(index), "step": None, "time": None}
    clock = _clock(found)
    if clock is not None:
        source, group = clock
        for name, kind in (("step", int), ("time", float)):
            place[name] = kind(source.rows(f"{group}/{name}", index[0], index[0] + 1)[0])
    path, source = found.path, found.sources[0]
    lines = isinstance(source, TapeText) and source.lines and path == W
    of_cases = source.form == Form.SWEEP and path.startswith(("cases/", "summary/", "history/"))
    if axes := CASES if of_cases else LINES if lines else ():
        return place | {name: first + i for (name, first), i in zip(axes, index, strict=False)}
    if clock is None and path.startswith("tape"):
        place["row"] = index[0] + 1
    dataset = dataset_of(path, len(source.shapes[path]))
    shape = () if dataset is None else dataset.shape
    if len(shape) == len(source.shapes[path]):
        for axis, (size, i) in enumerate(zip(shape, index, strict=False)):
            if size == "ndf" and i < len(DOF_NAMES):
                place["unknown"] = DOF_NAMES[i]
            elif isinstance(size, int):
                place["column" if axis else "row"] = i + 1
            elif size in SCALES:
                place[SCALES[size][0]] = i + 1
    return place
