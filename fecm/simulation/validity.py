"""Warnings about a run that leaves the assumptions of its theory, from the rows that it stored."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fecm._typing import Floats
from fecm.deck.model import Gages
from fecm.mechanics.mesh import Mesh
from fecm.results.result import Result
from fecm.results.schema import row_blocks
from fecm.results.summary import largest_exposures
from fecm.simulation.simulation import Simulation

# Largest strain for which plies are taken as linear.
STRAIN = 0.01

# Value, time, x and y.
Peak = tuple[float, float, float, float]


def warnings_of(simulation: Simulation, result: Result) -> list[str]:
    """Warn of deflection, strain, indentation and exposures beyond their limits, once each."""
    h = simulation.model.plate.laminate.thickness
    length, clock = result.unit("length"), result.unit("time")
    free = rigid_deflections(simulation.problem.mesh)

    def size(value: float) -> str:
        return f"{value:.4g} {length}".rstrip() + f" = {value / h:.3g} h"

    less = ", less its rigid motion," if free.size else ""
    checks = (
        (f"deflection{less}", _deflections(simulation, result, free), h / 2.0, size,
         "h/2 a linear plate, without membrane stiffening, is too soft"),
        ("strain", _strains(simulation, result), STRAIN, "{:.2%}".format,
         "1 % linear plies are doubtful"),
        ("indentation", _indentations(simulation, result), h / 4.0, size,
         "h/4 the contact law of a half-space is doubtful"),
    )  # fmt: skip
    found = []
    with np.errstate(all="ignore"):
        for what, peaks, limit, shown, why in checks:
            value, time, x, y = max(peaks, default=(0.0, 0.0, 0.0, 0.0))
            if value > limit:
                when = f"time {time:.6g} {clock}".rstrip()
                at = f"at ({x:.6g}, {y:.6g}), {when}"
                found.append(f"the {what} reaches {shown(value)} {at}: beyond {why}")
    beyond = [e.criterion.replace("_", " ") for e in largest_exposures(result) if e.exposure > 1.0]
    if beyond:
        found.append(
            f"exposure above 1 ({', '.join(beyond)}): the run goes on elastically, without the "
            "softening that follows the first failure"
        )
    return found


def rigid_deflections(mesh: Mesh) -> Floats:
    """Orthonormal basis of w, (numnp, n), of the rigid motions that the supports allow."""
    used = mesh.used
    place = mesh.coordinates[used, :2] - mesh.coordinates[used, :2].mean(axis=0)
    w = np.column_stack([np.ones(len(place)), place / np.abs(place).max()])
    slopes = np.broadcast_to(np.eye(3)[1:], (len(place), 2, 3))
    motions = np.concatenate([w[:, None], slopes], axis=1)  # of w, theta_x, theta_y
    held = motions[mesh.equations[used, 2:] == 0]
    resistance, combined = np.linalg.eigh(held.T @ held)
    basis = np.zeros((len(used), 3))
    basis[used] = w
    return np.linalg.qr(basis @ combined[:, resistance < 1e-9 * len(place)])[0]


def _peak(values: Floats, times: Floats, x: Floats, y: Floats) -> Peak:
    """The largest of values, (rows, ...), at places (...)."""
    row, *place = np.unravel_index(int(values.argmax()), values.shape)
    at = tuple(place)
    return float(values[row, *at]), float(times[row]), float(x[at]), float(y[at])


def _rows(result: Result, group: str, *names: str) -> Iterator[tuple[Floats, list[Floats]]]:
    """Times and datasets of a group, block by block; nothing if they are not stored."""
    paths = [f"{group}/{name}" for name in names]
    if paths[-1] in result:
        times = result[f"{group}/time"]
        shape = (len(times), *result.rows(paths[-1], 0, 1).shape[1:])
        for start, stop in row_blocks(shape):
            yield times[start:stop], [result.rows(path, start, stop) for path in paths]


def _deflections(simulation: Simulation, result: Result, free: Floats) -> Iterator[Peak]:
    """Peaks of the deflection less the rigid motions."""
    x, y = simulation.problem.mesh.coordinates[:, :2].T
    for times, (w,) in _rows(result, "tape3", "w"):
        yield _peak(np.abs(w - (w @ free) @ free.T), times, x, y)
    place = simulation.problem.load_place
    if place is not None and not free.size:
        for times, (w,) in _rows(result, "history", "plate_w"):
            yield _peak(np.abs(w), times, *map(np.asarray, place))


def _strains(simulation: Simulation, result: Result) -> Iterator[Peak]:
    """Peaks of the largest principal strain of both faces, away from the load, and of gages."""
    model, problem = simulation.model, simulation.problem
    half = model.plate.laminate.thickness / 2.0
    bending = ("kappa_x", "kappa_y", "kappa_xy")
    for group, points, membrane in (
        ("tape8", model.strains, ()),
        ("stresses", model.stress_points, ("eps_xx", "eps_yy", "gamma_xy")),
    ):
        for times, values in _rows(result, group, *membrane, *bending):
            curvature = [half * kappa for kappa in values[-3:]]
            middle = values[:-3] or [np.zeros(())] * 3
            if sum(np.abs(part).max() for part in (*middle, *curvature)) < STRAIN:
                continue  # a bound, as few runs come near the limit
            x, y = points.places(problem.mesh.coordinates)
            near = problem.under_load(x, y)
            for side in (1.0, -1.0):
                xx, yy, xy = (m + side * k for m, k in zip(middle, curvature, strict=True))
                largest = 0.5 * (np.abs(xx + yy) + np.hypot(xx - yy, xy))
                yield _peak(np.where(near | ~np.isfinite(largest), 0.0, largest), times, x, y)
    cards = problem.deck.last(Gages)
    if cards is not None:
        x, y = np.array([(gage.x, gage.y) for gage in cards.records]).T
        for times, (strain,) in _rows(result, "gages", "strain"):
            yield _peak(np.abs(strain), times, x, y)


def _indentations(simulation: Simulation, result: Result) -> Iterator[Peak]:
    """Peaks of the indentation in contact."""
    place = simulation.problem.load_place
    if place is not None:
        for times, (force, alpha) in _rows(result, "history", "force", "indentation"):
            yield _peak(np.where(force > 0.0, alpha, 0.0), times, *map(np.asarray, place))
