"""Largest deflection, strain and indentation of a finished run, and where and when they occur."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from fecm._typing import Array, Floats
from fecm.deck.model import Gages
from fecm.mechanics.mesh import rigid_deflections
from fecm.results.blocks import row_blocks
from fecm.results.result import Result
from fecm.results.validity import STRAIN
from fecm.simulation.simulation import Simulation

BENDING = ("kappa_x", "kappa_y", "kappa_xy")
MEMBRANE = ("eps_xx", "eps_yy", "gamma_xy")


class Peak(NamedTuple):
    """Largest value of a quantity, and when and where it occurs."""

    value: float
    time: float
    # Place; NaN where it is not known.
    x: float = math.nan
    y: float = math.nan


NO_PEAK = Peak(0.0, 0.0, 0.0, 0.0)


def deflection(simulation: Simulation, result: Result) -> Peak:
    """Largest deflection, less the rigid motions of a plate that is not held."""
    return max(_deflections(simulation, result), default=NO_PEAK)


def strain(simulation: Simulation, result: Result) -> Peak:
    """Largest principal strain of both faces, away from the load, and of gages.

    Zero if no strain of the elements comes near :data:`~fecm.results.validity.STRAIN`.
    """
    stored = [
        *_face_strains(simulation, result, "tape8"),
        *_face_strains(simulation, result, "stresses"),
        *_gage_strains(simulation, result),
        *_of_membrane(result, "largest_strain"),
    ]
    return max(stored, default=NO_PEAK)


def slope(result: Result) -> Peak:
    """Largest slope of a nonlinear plate at its stored rows."""
    return max(_of_membrane(result, "largest_slope"), default=NO_PEAK)


def membrane_force(result: Result) -> Peak:
    """Largest principal membrane force of a nonlinear plate at its stored rows."""
    return max(_of_membrane(result, "largest_force"), default=NO_PEAK)


def indentation(simulation: Simulation, result: Result) -> Peak:
    """Largest indentation in contact."""
    return max(_indentations(simulation, result), default=NO_PEAK)


def _deflections(simulation: Simulation, result: Result) -> Iterator[Peak]:
    """Peaks of the deflections that are stored: of all nodes by DISP, under the load at steps."""
    problem = simulation.problem
    free = rigid_deflections(problem.mesh)
    x, y = problem.mesh.coordinates[:, :2].T
    place = problem.load_place
    by_step = place is not None and not free.size and "history/plate_w" in result
    # Under the load the deflection is that of the summary, the mean over the patch.
    under = problem.under_load(x, y) & by_step
    for times, (w,) in _blocks(result, "tape3", ["w"]):
        bent = np.abs(w - (w @ free) @ free.T)
        yield _peak(np.where(under, 0.0, bent), times, x, y)
    if place is not None and by_step:
        for times, (w,) in _blocks(result, "history", ["plate_w"]):
            yield _peak_at(np.abs(w), times, place)


def _indentations(simulation: Simulation, result: Result) -> Iterator[Peak]:
    if (place := simulation.problem.load_place) is not None:
        for times, (force, alpha) in _blocks(result, "history", ["force", "indentation"]):
            yield _peak_at(np.where(force > 0.0, alpha, 0.0), times, place)


def _face_strains(simulation: Simulation, result: Result, group: str) -> Iterator[Peak]:
    """Peaks of the strains of a group, `tape8` without membrane strains or `stresses`.

    With the uniform strain of the preload.
    """
    model, problem = simulation.model, simulation.problem
    half = model.plate.thicknesses / 2.0
    preload = model.plate.preload_strain if model.plate.is_preloaded else np.zeros(3)
    has_membrane = group == "stresses"
    points = model.stress_points if has_membrane else model.strains
    names = [*MEMBRANE, *BENDING] if has_membrane else [*BENDING]
    for times, values in _blocks(result, group, names):
        sizes = [max(part.max(), -part.min()) for part in values]
        if np.abs(preload).sum() + sum(sizes[:-3]) + half.max() * sum(sizes[-3:]) < STRAIN:
            continue  # a bound, as few runs come near the limit
        membrane = values[:-3] or [np.zeros(())] * 3
        curvature = [half * kappa for kappa in values[-3:]]
        middle = [m + initial for m, initial in zip(membrane, preload, strict=True)]
        x, y = points.places(problem.mesh.coordinates)
        near = problem.under_load(x, y)
        for side in (1.0, -1.0):
            xx, yy, xy = (m + side * k for m, k in zip(middle, curvature, strict=True))
            largest = 0.5 * (np.abs(xx + yy) + np.hypot(xx - yy, xy))
            yield _peak(np.where(near | ~np.isfinite(largest), 0.0, largest), times, x, y)


def _gage_strains(simulation: Simulation, result: Result) -> Iterator[Peak]:
    if (cards := simulation.problem.deck.last(Gages)) is not None:
        x, y = np.array([(gage.x, gage.y) for gage in cards.records]).T
        for times, (values,) in _blocks(result, "gages", ["strain"]):
            yield _peak(np.abs(values), times, x, y)


def _of_membrane(result: Result, name: str) -> Iterator[Peak]:
    """Peaks of the rows of ``membrane``, whose places are not stored."""
    for times, (values,) in _blocks(result, "membrane", [name]):
        row = int(values.argmax())
        yield Peak(float(values[row]), float(times[row]))


def _blocks(
    result: Result, group: str, names: Iterable[str]
) -> Iterator[tuple[Floats, list[Floats]]]:
    """Times and datasets of a group, block by block; nothing if they are not stored."""
    paths = [f"{group}/{name}" for name in names]
    if paths[-1] in result:
        times = result[f"{group}/time"]
        shape = (len(times), *result.rows(paths[-1], 0, 1).shape[1:])
        for start, stop in row_blocks(shape):
            yield times[start:stop], [result.rows(path, start, stop) for path in paths]


def _peak(values: Floats, times: Floats, x: Array, y: Array) -> Peak:
    """The largest of values, (rows, ...), at places (...)."""
    row, *at = np.unravel_index(int(values.argmax()), values.shape)
    return Peak(float(values[row, *at]), float(times[row]), float(x[*at]), float(y[*at]))


def _peak_at(values: Floats, times: Floats, place: tuple[float, float]) -> Peak:
    """The largest of values, (rows,), at one place."""
    return _peak(values, times, *map(np.asarray, place))
