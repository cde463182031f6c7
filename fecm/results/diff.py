"""Compares the datasets of two results.

Two numbers are the same where |a - b| <= atol + rtol*max, max being the largest finite absolute
value of the whole dataset in both results together: a history's zero crossing is judged by the
history's size, not by its own.  A dataset whose own size says nothing has another measure
(`SCALE_NAMES`): a residue of rounding is judged by what it is the residue of.  Whole numbers
(steps, node and equation numbers) are names rather than quantities; they have to be equal.  NaN is
the same as NaN, an infinity as the same infinity; either of them against anything else is a
difference at any tolerance.  Texts have to be equal.

Datasets are read in blocks of rows, so memory does not grow with the results.
"""

from __future__ import annotations

import contextlib
import difflib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from fecm._errors import FecmError
from fecm.deck.records import DOF_NAMES
from fecm.results.hdf5_reader import OpenArrays, read
from fecm.results.schema import DATASETS, FORMAT, SCALES, SWEEP
from fecm.results.tape_reader import SHEARS, TapeText, W, read_tapes
from fecm.results.tapes import CONTACT, CURVATURES

Array = NDArray[Any]

ON_TAPE = frozenset(
    (
        W,
        *(f"tape8/{name}" for name in (*CURVATURES, *SHEARS["tape8"])),
        *(f"tape9/{name}" for name in CONTACT),
    )
)

# Axes of a sweep's datasets; its cases count from 0, as on the command line.
CASES = (("case", 0), ("step", 1))

TAPES = "tapes"

WHAT = {FORMAT: "the result of a run", SWEEP: "the result of a sweep", TAPES: "a folder of tapes"}


class IncomparableError(FecmError, ValueError):
    """The sides have nothing in common, or not what was asked for."""


class FileSide:
    """A result file, of a run or of a sweep, that stays open."""

    def __init__(self, path: Path) -> None:
        self.contents = contents = read(path, FORMAT, SWEEP)
        axes = CASES if contents.form == SWEEP else ()
        arrays = contents.arrays
        self.layouts = {
            name: Layout(shape, arrays.dtypes[name], axes) for name, shape in arrays.shapes.items()
        }
        self.layouts |= {
            name: Layout((len(values),), np.dtype(object), axes)
            for name, values in contents.lists.items()
        }
        self.opened = OpenArrays(path)

    def rows(self, path: str, start: int, stop: int) -> Array:
        """Rows of a dataset."""
        if path in self.contents.lists:
            return np.array(self.contents.lists[path][start:stop], dtype=object)
        return self.opened.rows(path, start, stop)


class TapeSide:
    """A folder of tapes."""

    def __init__(self, text: TapeText) -> None:
        self.text = text
        self.layouts: dict[str, Layout] = {}
        self.fit(0)

    def fit(self, nodes: int) -> None:
        """Divide tape3 into rows of this many nodes where it can't tell them itself."""
        self.text = self.text.fitted(nodes)
        by_lines = {W: (("line", 1), ("column", 1))} if self.text.lines else {}
        self.layouts = {
            name: Layout(values.shape, values.dtype, by_lines.get(name, ()))
            for name, values in self.text.arrays.items()
        }

    def rows(self, path: str, start: int, stop: int) -> Array:
        """Rows of a dataset."""
        return self.text.arrays[path][start:stop]


@dataclass(frozen=True)
class Listed:
    """Something beside the numbers that differs; it is told and not judged.

    Attributes
    ----------
    name : str
        ``title``, ``mode``, ``tape8:location``, ``deck``.
    values : tuple
        What A and B have; None where one has nothing.
    line : int or None
        First line of a text that differs; `values` are then that line.
    """

    name: str
    values: tuple[Any, Any]
    line: int | None = None


@dataclass
class Difference:
    """All that came out of a comparison.

    Attributes
    ----------
    compared : list of Comparison
        Datasets of both sides, by name.
    only : tuple of list of str
        Datasets that stand in A only, and in B only.
    listed : list of Listed
        What differs and is not judged.
    """

    compared: list[Comparison]
    only: tuple[list[str], list[str]]
    listed: list[Listed] = field(default_factory=list)

    @property
    def same(self) -> bool:
        """The verdict."""
        return not any(self.only) and all(found.same for found in self.compared)


@contextlib.contextmanager
def opened(path: Path) -> Iterator[FileSide | TapeSide]:
    """Open a result file or a folder of tapes.

    Raises
    ------
    ResultFileError
        If it is neither, or is damaged.
    OSError
        If it can't be opened.
    """
    if path.is_dir():
        yield TapeSide(read_tapes(path))
        return
    side = FileSide(path)
    with side.opened:
        yield side


def difference(
    a: FileSide | TapeSide,
    b: FileSide | TapeSide,
    tolerance: Tolerance,
    only: Sequence[str] = (),
) -> Difference:
    """Compare two sides.

    Parameters
    ----------
    a, b : FileSide or TapeSide
    tolerance : Tolerance
    only : sequence of str
        Datasets and groups to compare; all where it is empty.

    Raises
    ------
    IncomparableError
        If one is of a sweep and the other is not, or `only` names what can't be compared.
    ResultFileError
        If a file can't be read.
    """
    kinds = [_kind(side) for side in (a, b)]
    if SWEEP in kinds and kinds[0] != kinds[1]:
        told = " and B ".join(WHAT[kind] for kind in kinds)
        raise IncomparableError(f"A is {told}: they can't be compared")
    for side, other in ((a, b), (b, a)):
        shape = other.layouts[W].shape if W in other.layouts else ()
        if isinstance(side, TapeSide) and len(shape) == 2 and isinstance(other, FileSide):
            side.fit(shape[1])
    left, right = (_names(side, a, b) for side in (a, b))
    chosen = _chosen(left | right, only)
    return Difference(
        [compare(a, b, path, tolerance) for path in sorted(left & right & chosen)],
        (sorted((left - right) & chosen), sorted((right - left) & chosen)),
        _listed(a, b),
    )


def _kind(side: FileSide | TapeSide) -> str:
    """What a side is, a name of `WHAT`."""
    return TAPES if isinstance(side, TapeSide) else side.contents.form


def _names(side: Side, *both: Side) -> set[str]:
    """Names of a side that can be compared."""
    names = set(side.layouts)
    return names & ON_TAPE if any(isinstance(s, TapeSide) for s in both) else names


def _chosen(names: set[str], only: Sequence[str]) -> set[str]:
    """Names that `only` asks for."""
    if not only:
        return names
    chosen: set[str] = set()
    for asked in only:
        plain = asked.strip("/")
        found = {name for name in names if name == plain or name.startswith(f"{plain}/")}
        if not found:
            raise IncomparableError(f"there is no `{asked}` to compare{_hint(plain, names)}")
        chosen |= found
    return chosen


def _hint(asked: str, names: set[str]) -> str:
    """Names that may have been meant."""
    known = sorted(names | {name.rpartition("/")[0] for name in names} - {""})
    own = [name.rpartition("/")[2] for name in known]
    close = difflib.get_close_matches(asked, own, n=3) if "/" not in asked else []
    alike = [name for name, last in zip(known, own, strict=True) if last in (asked, *close)]
    alike = alike or difflib.get_close_matches(asked, known, n=3)
    if alike:
        return f"; did you mean {' or '.join(alike)}?"
    groups = sorted({name.partition("/")[0] for name in names})
    return f"; there are {', '.join(groups)}" if groups else ""


def _listed(a: FileSide | TapeSide, b: FileSide | TapeSide) -> list[Listed]:
    """Attributes and texts that differ between two files; tapes have none."""
    if not (isinstance(a, FileSide) and isinstance(b, FileSide)):
        return []
    mine, theirs = _attributes(a), _attributes(b)
    listed = [
        Listed(name, (mine.get(name), theirs.get(name)))
        for name in dict.fromkeys((*mine, *theirs))
        if repr(mine.get(name)) != repr(theirs.get(name))
    ]
    left, right = a.contents.texts, b.contents.texts
    for name in dict.fromkeys((*left, *right)):
        if left.get(name) != right.get(name):
            listed.append(_listed_text(name, left.get(name), right.get(name)))
    return listed


def _attributes(side: FileSide) -> Mapping[str, Any]:
    """All attributes by name: ``title``, ``energy:initial``, ``tape3/w:unit``."""
    values: dict[str, Any] = {}
    values.update(side.contents.attributes)
    for group, attributes in side.contents.groups.items():
        values.update({f"{group}:{name}": value for name, value in attributes.items()})
    for path in side.layouts:
        attributes = side.opened.attributes(path)
        values.update({f"{path}:{name}": value for name, value in attributes.items()})
    return values


def _listed_text(name: str, a: str | None, b: str | None) -> Listed:
    """A text that differs, by its first line that does."""
    if a is None or b is None:
        return Listed(name, (a and "a text", b and "a text"))
    mine, theirs = a.split("\n"), b.split("\n")
    length = max(len(mine), len(theirs))
    padded = [[*lines, *[None] * (length - len(lines))] for lines in (mine, theirs)]
    line = int(np.argmax([x != y for x, y in zip(*padded, strict=True)]))
    return Listed(name, (padded[0][line], padded[1][line]), line + 1)


# Bytes of a block of rows.
BLOCK = 4_000_000

# What an index is called along each size of a dataset; rows are told by the clock.
AXES = {size: name for size, (name, _) in SCALES.items()} | {"nen": "position", "ndm": "axis"}

# Whose sum energy/balance_error is.
ENERGIES = [
    dataset.path
    for dataset in DATASETS.values()
    if dataset.group == "energy" and dataset.dimension == "force*length"
    if dataset.name != "balance_error"
]

# What datasets are judged by that are not judged by their own largest value.
SCALE_NAMES = {
    "energy/balance_error": "the largest energy",
    "laminate/B": "sqrt(max A * max D)",
    "history/indentation": "the largest indentation in contact",
    "tape9/indentation": "the largest indentation in contact",
}


@dataclass(frozen=True)
class Tolerance:
    """How far apart two numbers may be.

    Attributes
    ----------
    relative : float
        Share of the dataset's scale.
    absolute : float
        In the dataset's own unit.
    """

    relative: float = 0.0
    absolute: float = 0.0

    def of(self, scale: float) -> float:
        """Largest difference that is none, for a dataset of this scale."""
        return self.absolute + self.relative * scale


@dataclass(frozen=True)
class Layout:
    """Shape and type of a dataset, and what its indices are where the schema does not say.

    Attributes
    ----------
    shape : tuple of int
    dtype : numpy.dtype
        Of objects where it holds texts.
    axes : tuple of (str, int)
        What an index is called along each axis, and the number of the first.
    """

    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    axes: tuple[tuple[str, int], ...] = ()

    @property
    def holds_texts(self) -> bool:
        """Whether it holds texts instead of numbers."""
        return self.dtype.kind == "O"

    @property
    def kind(self) -> str:
        """Name of its type."""
        return "text" if self.holds_texts else str(self.dtype)

    @property
    def rows(self) -> int:
        """Number of its rows; a single number is one."""
        return self.shape[0] if self.shape else 1


class Side(Protocol):
    """One of the two results."""

    @property
    def layouts(self) -> Mapping[str, Layout]:
        """Every dataset of numbers, by path."""
        ...

    def rows(self, path: str, start: int, stop: int) -> Array:
        """Rows of a dataset."""
        ...


@dataclass(frozen=True)
class Place:
    """A place in a dataset.

    Attributes
    ----------
    index : tuple of int
        Index in the array, from 0.
    step, time
        Those of its row; None where its group has no clock.
    names : dict
        What the other indices are: node, element, point, unknown and so on, from 1.
    """

    index: tuple[int, ...]
    step: int | None = None
    time: float | None = None
    names: dict[str, int | str] = field(default_factory=dict)


@dataclass
class Comparison:
    """What came out for one dataset.

    Attributes
    ----------
    path : str
    layouts : tuple of Layout
        In A and in B.
    comparable : bool
        Whether the shapes are equal, and both are numbers or both texts.
    maximum, scale, tolerance : float
        Largest finite absolute value in both, what differences are judged by (`maximum` but for
        `SCALE_NAMES`), and the largest difference that is none.
    largest : float
        Largest difference; infinite where it is between a number and what is none.
    at : Place or None
        Where that is, and `values` what stands there in A and in B; None where nothing differs.
    differing : int
        How many numbers differ by more than the tolerance.
    first : Place or None
        First row where one does; only where the group has a clock.
    """

    path: str
    layouts: tuple[Layout, Layout]
    comparable: bool = True
    maximum: float = 0.0
    scale: float = 0.0
    tolerance: float = 0.0
    largest: float = 0.0
    at: Place | None = None
    values: tuple[float, float] | tuple[str, str] | None = None
    differing: int = 0
    first: Place | None = None

    @property
    def same_type(self) -> bool:
        """Whether both have one type of number."""
        return self.layouts[0].dtype == self.layouts[1].dtype

    @property
    def same(self) -> bool:
        """Whether shape, type and all numbers are the same."""
        return self.comparable and self.same_type and not self.differing

    @property
    def relative(self) -> float:
        """Largest difference over the scale."""
        return self.largest / self.scale if self.scale else self.largest and np.inf


def compare(a: Side, b: Side, path: str, tolerance: Tolerance) -> Comparison:
    """Compare a dataset that both sides have.

    Parameters
    ----------
    a, b : Side
    path : str
        The dataset's name.
    tolerance : Tolerance

    Raises
    ------
    ResultFileError
        If a file can't be read there.
    """
    layouts = left, right = a.layouts[path], b.layouts[path]
    alike = left.shape == right.shape and left.holds_texts == right.holds_texts
    found = Comparison(path, layouts, alike)
    if not found.comparable:
        return found
    if left.holds_texts:
        _compare_texts(found, a, b)
        return found
    index, lost = _measure(found, a, b)
    whole = all(layout.dtype.kind in "biu" for layout in layouts)
    found.scale = _scale(found, a, b)
    found.tolerance = 0.0 if whole else tolerance.of(found.scale)
    if index is not None:
        found.at = _place(a, b, path, index)
    if lost or found.largest > found.tolerance:
        _count(found, a, b)
    return found


def _scale(found: Comparison, a: Side, b: Side) -> float:
    """What the differences of a dataset are judged by; its maximum where nothing else is known."""

    def largest(path: str, low: float = -np.inf) -> float:
        values = [
            block[np.isfinite(block) & (block > low)]
            for side in (a, b)
            if path in side.layouts and not side.layouts[path].holds_texts
            for block in _rows(side, path)
        ]
        return max((float(np.abs(block).max(initial=0.0)) for block in values), default=0.0)

    if found.path not in SCALE_NAMES:
        return found.maximum
    group = found.path.partition("/")[0]
    if found.path == "energy/balance_error":
        scale = max(map(largest, ENERGIES))
    elif found.path == "laminate/B":
        # Both are of the order of A h, h being the thickness.
        scale = (largest("laminate/A") * largest("laminate/D")) ** 0.5
    elif all(f"{group}/step" in side.layouts for side in (a, b)):
        scale = largest(found.path, 0.0)
    else:
        scale = 0.0  # a tape has a few digits of every number, also of those in free flight
    return scale or found.maximum


def _compare_texts(found: Comparison, a: Side, b: Side) -> None:
    """Count the texts that differ, and find the first."""
    left, right = (side.rows(found.path, 0, found.layouts[0].rows) for side in (a, b))
    rows = np.flatnonzero(left != right)
    found.differing = len(rows)
    if len(rows):
        row = int(rows[0])
        found.largest = float("inf")
        found.at = _place(a, b, found.path, (row,))
        found.values = str(left[row]), str(right[row])


def _measure(found: Comparison, a: Side, b: Side) -> tuple[tuple[int, ...] | None, bool]:
    """Find maximum, largest difference and its index; also whether a number stands against none."""
    place: tuple[int, ...] | None = None
    lost = False
    for start, left, right in _blocks(a, b, found):
        for values in (left, right):
            size = np.abs(values, where=np.isfinite(values), out=np.zeros(values.shape))
            found.maximum = max(found.maximum, float(size.max(initial=0.0)))
        apart, strange = _differences(left, right)
        if lost or not apart.size:
            continue  # the first strange number has been found; nothing is further apart
        here = int((strange if strange.any() else apart).argmax())
        index = np.unravel_index(here, apart.shape)
        if strange.any() or apart[index] > found.largest:
            lost = bool(strange.any())
            found.largest = float("inf") if lost else float(apart[index])
            found.values = float(left[index]), float(right[index])
            place = (start + int(index[0]), *map(int, index[1:]))
    return place, lost


def _count(found: Comparison, a: Side, b: Side) -> None:
    """Count what differs by more than the tolerance, and find the first row of it."""
    for start, left, right in _blocks(a, b, found):
        apart, strange = _differences(left, right)
        wrong = strange | (apart > found.tolerance)
        found.differing += int(np.count_nonzero(wrong))
        if found.first is None and wrong.any() and _clocked(a, b, found):
            row = int(wrong.reshape(len(wrong), -1).any(axis=1).argmax())
            found.first = _place(a, b, found.path, (start + row,))


def _blocks(a: Side, b: Side, found: Comparison) -> Iterator[tuple[int, Array, Array]]:
    """Yield the first row, and the rows of A and B as at least one-dimensional arrays."""
    pairs = zip(_rows(a, found.path), _rows(b, found.path), strict=True)
    start = 0
    for left, right in pairs:
        yield start, left, right
        start += len(left)


def _rows(side: Side, path: str) -> Iterator[Array]:
    """Blocks of rows of a dataset."""
    layout = side.layouts[path]
    row_bytes = 8 * max(1, int(np.prod(layout.shape[1:], dtype=float)))
    step = max(1, BLOCK // row_bytes)
    for start in range(0, layout.rows, step):
        yield side.rows(path, start, min(start + step, layout.rows))


def _differences(left: Array, right: Array) -> tuple[Array, Array]:
    """|a - b| where both are finite, else 0; and where one is not and the other differs from it."""
    if left.dtype.kind in "biu" and right.dtype.kind in "biu":
        apart = np.abs(left.astype(float) - right.astype(float))
        unequal = left != right
        # Two large whole numbers may be one and the same as floats.
        return np.where(unequal, np.maximum(apart, 1.0), 0.0), np.zeros(left.shape, bool)
    left, right = left.astype(float), right.astype(float)
    finite = np.isfinite(left) & np.isfinite(right)
    with np.errstate(over="ignore", invalid="ignore"):
        apart = np.where(finite, np.abs(left - right), 0.0)
    equal = (left == right) | (np.isnan(left) & np.isnan(right))
    return apart, ~finite & ~equal


def _clock(a: Side, b: Side, path: str) -> tuple[Side, str] | None:
    """Side and group whose step and time tell the rows of a dataset."""
    group = path.rpartition("/")[0]
    for side in (a, b):
        layouts = side.layouts
        names = (path, f"{group}/step", f"{group}/time")
        if all(name in layouts for name in names):
            rows, *clock = (layouts[name].shape for name in names)
            kinds = [layouts[name].dtype.kind for name in names[1:]]
            if rows and kinds == ["i", "f"] and all(shape == rows[:1] for shape in clock):
                return side, group
    return None


def _clocked(a: Side, b: Side, found: Comparison) -> bool:
    """Whether the rows of a dataset are instants, or at least rows of a tape."""
    return bool(found.layouts[0].shape) and (
        _clock(a, b, found.path) is not None or found.path.startswith("tape")
    )


def _place(a: Side, b: Side, path: str, index: tuple[int, ...]) -> Place:
    """Name a place by step, time, node and whatever the schema calls its indices."""
    step: int | None = None
    time: float | None = None
    clock = _clock(a, b, path)
    if clock:
        side, group = clock
        row = index[0]
        step = int(side.rows(f"{group}/step", row, row + 1)[0])
        time = float(side.rows(f"{group}/time", row, row + 1)[0])
    return Place(index, step, time, _named(a.layouts[path], path, index, bool(clock)))


def _named(
    layout: Layout, path: str, index: tuple[int, ...], clocked: bool
) -> dict[str, int | str]:
    """Names of a place's indices, from 1; a row that the clock tells needs none."""
    if layout.axes:
        return {name: first + i for (name, first), i in zip(layout.axes, index, strict=False)}
    dataset = DATASETS.get(path)
    names: dict[str, int | str] = {}
    if not clocked and path.startswith("tape"):
        names["row"] = index[0] + 1
    if dataset is None or len(dataset.shape) != len(layout.shape):
        return names
    for axis, (size, i) in enumerate(zip(dataset.shape, index, strict=False)):
        if size == "ndf" and i < len(DOF_NAMES):
            names["unknown"] = DOF_NAMES[i]
        elif isinstance(size, int):
            names["column" if axis else "row"] = i + 1
        elif size in AXES:
            names[AXES[size]] = i + 1
    return names
