"""Two results side by side: each is a result file or a folder of tapes.

A tape holds less than a result: its names are those of :mod:`fecm.results.tape_reader`, and
whatever a tape has no place for is not compared with it.
"""

from __future__ import annotations

import contextlib
import difflib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fecm.results.compare import Comparison, Layout, Side, Tolerance, compare
from fecm.results.file_reader import OpenArrays, read
from fecm.results.schema import FORMAT, SWEEP
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


class IncomparableError(ValueError):
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
