"""Compares one dataset of two results; :mod:`fecm.results.diff` says what is equal.

A dataset is read in blocks of rows: memory does not grow with the results.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from enum import StrEnum
from typing import Any, NamedTuple

import numpy as np

from fecm._typing import Array
from fecm.deck.mesh_cards import DOF_NAMES
from fecm.results.blocks import row_blocks
from fecm.results.difference import TEXT, DatasetDifference, Position
from fecm.results.hdf5_reader import Contents
from fecm.results.schema import SCALES, Form, dataset_of
from fecm.results.tapes import TapeText, W, last_digit

# Those of a resultant or strain that is zero in bending, and those of its bending counterpart.
RESULTANTS = ("N_x", "N_y", "N_xy")
COUPLES = ("M_x", "M_y", "M_xy")
STRAINS = ("eps_xx", "eps_yy", "gamma_xy")
CURVATURES = ("kappa_x", "kappa_y", "kappa_xy")


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

Source = Contents | TapeText


class Pair(NamedTuple):
    """A dataset that both sources have."""

    path: str
    sources: tuple[Source, Source]  # A and B

    @property
    def shapes(self) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Shapes in A and B."""
        a, b = self.sources
        return a.shapes[self.path], b.shapes[self.path]

    @property
    def types(self) -> tuple[str, str]:
        """Names of the types in A and B."""
        a, b = (str(source.dtypes[self.path]) for source in self.sources)
        return a.replace("object", TEXT), b.replace("object", TEXT)

    def blocks(self) -> Iterator[tuple[int, Array, Array]]:
        """Yield number of the first row, rows of A and rows of B."""
        a, b = self.sources
        for start, stop in row_blocks(self.shapes[0]):
            yield start, a.rows(self.path, start, stop), b.rows(self.path, start, stop)


def compare(pair: Pair, tolerances: tuple[float, float] | None) -> DatasetDifference:
    """Compare a dataset of both sources, by rtol and atol, or to the last digit of tapes."""
    found = DatasetDifference(pair.path, pair.shapes, pair.types)
    if not found.comparable:
        return found
    if found.holds_texts:
        _compare_texts(found, pair)
        return found
    infinite = _measure(found, pair)
    found.scale = found.maximum
    if own := _own_scale(pair):
        found.scale, found.scale_name = own, SCALE_NAMES[_scaled_name(pair.path)]
    if tolerances is None:
        found.tolerance = float(last_digit(np.array(found.maximum)))
    elif any(source.dtypes[pair.path].kind == "f" for source in pair.sources):
        rtol, atol = tolerances
        found.tolerance = atol + rtol * found.scale
    if infinite or found.largest_difference > (0.0 if tolerances is None else found.tolerance):
        _count(found, pair, to_last_digit=tolerances is None)
    return found


def _compare_texts(found: DatasetDifference, pair: Pair) -> None:
    """Compare a dataset of texts."""
    left, right = (source.rows(pair.path, 0, found.shapes[0][0]) for source in pair.sources)
    rows = np.flatnonzero(left != right)
    found.differing = len(rows)
    if len(rows):
        found.largest_difference, found.at = math.inf, _place(pair, (int(rows[0]),))
        found.values = str(left[rows[0]]), str(right[rows[0]])


def _scaled_name(path: str) -> str:
    """Name of a dataset in `SCALE_NAMES`: that of a numbered laminate without its number."""
    group, name = path.partition("/")[0], path.rpartition("/")[2]
    return f"{group}/{name}" if group == "laminate" else path


def _own_scale(pair: Pair) -> float:
    """Scale of the differences of a dataset that is not its maximum; 0 if there is none."""
    match SCALE_NAMES.get(_scaled_name(pair.path)):
        case None:
            return 0.0
        case Scale.ENERGY:
            return _initial_energy(pair) + _largest(pair, "energy/external_work")
        case Scale.COUPLING:  # with the thickness h, A h and D / h have the order of B
            return float((_largest_laminate(pair, "A") * _largest_laminate(pair, "D")) ** 0.5)
        case Scale.INTERLAMINAR:
            return max(_largest(pair, "plies/tau_xz"), _largest(pair, "plies/tau_yz"))
        case Scale.RESULTANT:
            couples = _largest_of(pair, COUPLES) * _inverse_thickness(pair)
            return max(_largest_of(pair, RESULTANTS), couples)
        case Scale.STRAIN:
            ratio = _inverse_thickness(pair)
            bending = _largest_of(pair, CURVATURES) / ratio if ratio else 0.0
            return max(_largest_of(pair, STRAINS), bending)
        case Scale.CONTACT:
            group = pair.path.partition("/")[0]
            # A tape has few digits of every number, also in free flight.
            known = all(f"{group}/step" in source.shapes for source in pair.sources)
            return _largest(pair, pair.path, above=0.0) if known else 0.0


def _largest(pair: Pair, path: str, above: float = -np.inf) -> float:
    """Largest finite absolute value of a dataset in both sources, of the numbers above a limit."""
    size = 0.0
    for source in pair.sources:
        if path in source.shapes and source.dtypes[path].kind != "O":
            for rows in row_blocks(source.shapes[path]):
                block = source.rows(path, *rows)
                counted = np.abs(block[np.isfinite(block) & (block > above)])
                size = max(size, float(counted.max(initial=0.0)))
    return size


def _largest_of(pair: Pair, names: Sequence[str]) -> float:
    """Largest value of some of the resultants and strains that STRE stores."""
    return max(_largest(pair, f"stresses/{name}") for name in names)


def _inverse_thickness(pair: Pair) -> float:
    """sqrt(A/D), which is of the order of 1/h; 0 if it is not known."""
    bending = _largest_laminate(pair, "D") or np.inf
    return float((_largest_laminate(pair, "A") / bending) ** 0.5)


def _largest_laminate(pair: Pair, name: str) -> float:
    """Largest value of a stiffness matrix of the laminates."""
    paths = {path for source in pair.sources for path in source.shapes}
    own = [p for p in paths if p.startswith("laminate/") and p.endswith(f"/{name}")]
    return max((_largest(pair, path) for path in own), default=0.0)


def _initial_energy(pair: Pair) -> float:
    """Largest initial energy of both files; 0 if it is not known."""
    files = (source for source in pair.sources if isinstance(source, Contents))
    initial = (file.groups.get("energy", {}).get("initial") for file in files)
    known = (abs(e) for e in initial if isinstance(e, int | float) and np.isfinite(e))
    return max(known, default=0.0)


def _measure(found: DatasetDifference, pair: Pair) -> bool:
    """Find maximum, largest difference and its place; return whether it is infinite."""
    place: tuple[int, ...] = ()
    infinite = False
    for start, left, right in pair.blocks():
        for values in (left, right):
            size = np.abs(values, where=np.isfinite(values), out=np.zeros(values.shape))
            found.maximum = max(found.maximum, float(size.max(initial=0.0)))
        apart, strange = _differences(left, right)
        if infinite or not apart.size:
            continue  # no other difference is larger
        here = int((strange if strange.any() else apart).argmax())
        index = np.unravel_index(here, apart.shape)
        if strange.any() or apart[index] > found.largest_difference:
            infinite = bool(strange.any())
            found.largest_difference = np.inf if infinite else float(apart[index])
            found.values = float(left[index]), float(right[index])
            place = (start + int(index[0]), *map(int, index[1:]))
    if place:
        found.at = _place(pair, place)
    return infinite


def _count(found: DatasetDifference, pair: Pair, *, to_last_digit: bool) -> None:
    """Count the differences beyond the tolerance, and find the first row that has one."""
    instants = found.shapes[0] and (_clock(pair) or pair.path.startswith("tape"))
    for start, left, right in pair.blocks():
        apart, strange = _differences(left, right)
        tolerance: Any = found.tolerance
        if to_last_digit:
            pairs = zip(pair.sources, (left, right), strict=True)
            printed = [last_digit(values) for one, values in pairs if isinstance(one, TapeText)]
            tolerance = (1.0 + 1e-9) * np.max(printed, axis=0)
        wrong = strange | (apart > tolerance)
        found.differing += int(np.count_nonzero(wrong))
        if found.first is None and wrong.any() and instants:
            row = int(wrong.reshape(len(wrong), -1).any(axis=1).argmax())
            found.first = _place(pair, (start + row,))


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


def _clock(pair: Pair) -> tuple[Source, str] | None:
    """Source and group whose step and time belong to the rows of a dataset."""
    group = pair.path.rpartition("/")[0]
    for source in pair.sources:
        rows = source.shapes[pair.path][:1]
        clock = [n for n in (f"{group}/step", f"{group}/time") if source.shapes.get(n) == rows]
        if rows and [source.dtypes[name].kind for name in clock] == ["i", "f"]:
            return source, group
    return None


def _place(pair: Pair, index: tuple[int, ...]) -> Position:
    """Position of a number, or of a row if only its index is given."""
    path, source = pair.path, pair.sources[0]
    if isinstance(source, TapeText) and source.lines and path == W:
        names = ("line", "column")
        return Position(index, axes={name: i + 1 for name, i in zip(names, index, strict=False)})
    if source.form == Form.SWEEP and path.startswith(("cases/", "summary/", "history/")):
        case, *steps = index  # cases count from 0, as in commands
        return Position(index, steps[0] + 1 if steps else None, axes={"case": case})
    step: int | None = None
    time: float | None = None
    clock = _clock(pair)
    if clock is not None:
        timed, group = clock
        row = index[0], index[0] + 1
        step = int(timed.rows(f"{group}/step", *row)[0])
        time = float(timed.rows(f"{group}/time", *row)[0])
    return Position(index, step, time, _axes(pair, index, has_clock=clock is not None))


def _axes(pair: Pair, index: tuple[int, ...], *, has_clock: bool) -> dict[str, int | str]:
    """Indices of a place, from 1, by the names of the axes other than time."""
    path, sizes = pair.path, pair.shapes[0]
    axes: dict[str, int | str] = {}
    if not has_clock and path.startswith("tape"):
        axes["row"] = index[0] + 1
    dataset = dataset_of(path, len(sizes))
    shape = () if dataset is None else dataset.shape
    if len(shape) != len(sizes):
        return axes
    for axis, (size, i) in enumerate(zip(shape, index, strict=False)):
        if size == "ndf" and i < len(DOF_NAMES):
            axes["unknown"] = DOF_NAMES[i]
        elif isinstance(size, int):
            axes["column" if axis else "row"] = i + 1
        elif size in SCALES:
            axes[SCALES[size][0]] = i + 1
    return axes
