"""Wave fronts: normal velocities, rays, positions and cusps, section 2.3.

Across a front only the highest derivatives are discontinuous, so that k drops out of the 5 x 5
problem: L(n) a = c_n^2 M a couples A, B, D with P, R, I, and transverse shear is independent
(equations 2-60 to 2-65).  Rays follow from c_n and its derivatives with respect to the normal's
angle, computed by perturbation of the eigenvalue problem: with the slowness p = n/c_n, equation
2-84 is the ray velocity V = c_n n + c_n' t, and V' = (c_n + c_n'') t.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from fecm._dataclasses import frozen
from fecm.studies.waves.medium import Medium, first_largest
from fecm.studies.waves.sheets import (
    FRONTS,
    ORDERS,
    SURE,
    Fronts,
    match_modes,
    sheets,
    track_branch,
)

STEPS = 10  # per degree, for tracking sheets and searching cusps
AROUND = 360 * STEPS  # steps over all normals


@frozen
class Cusp:
    """A cusp of a front.

    Attributes
    ----------
    mode : str
        Name of the front.
    normal : float
        Angle of the front's normal at the cusp, degrees.
    x, y : float
        Place of the cusp, length.
    """

    mode: str
    normal: float
    x: float
    y: float


class WaveSurfaces:
    """The five fronts of a laminate, tracked over all normals.

    Fronts that cross keep their names, as do fronts that approach each other without crossing.
    Raises StudyError if the velocities are out of the floating-point range.
    """

    def __init__(self, medium: Medium) -> None:
        self.medium = medium
        around = sheets(medium, np.arange(AROUND + 1) / STEPS)
        self._mode = around.mode
        step, likeness = match_modes(self._mode[:-1], self._mode[1:])
        # Steps whose end points do not identify the sheets.
        self._close = likeness <= SURE
        for row in np.flatnonzero(self._close).tolist():
            step[row] = track_branch(medium, row / STEPS, (row + 1) / STEPS)
        self._close &= (step == np.arange(5)).all(axis=1)
        # Indices of the sheets that continue each sheet of the normal 0.
        place = np.empty((AROUND + 1, 5), dtype=np.intp)
        place[0] = np.arange(5)
        for row, following in enumerate(step):
            place[row + 1] = following[place[row]]
        mean = np.take_along_axis(around.velocity, place, axis=1).mean(axis=0)
        place = place[:, np.argsort(-mean, kind="stable")]
        share = np.take_along_axis(around.share, place[:, :, None], axis=1).mean(axis=0)
        # To each name the mode that makes the sum of the shares largest.
        scores = share[ORDERS, np.arange(5)].sum(axis=1)
        self._place = place[:, ORDERS[first_largest(scores[None])[0]]]

    def fronts(self, normals: ArrayLike) -> Fronts:
        """The five fronts at normals, (n,), in degrees."""
        found = sheets(self.medium, np.atleast_1d(np.asarray(normals, dtype=np.float64)))
        turn = np.mod(found.normal, 360.0) * STEPS
        near = np.round(turn).astype(np.intp)
        alike, _ = match_modes(self._mode[near], found.mode)
        place = np.take_along_axis(alike, self._place[near], axis=1)
        # In close steps the velocities identify the sheets, not the modes.
        step = np.minimum(turn.astype(np.intp), AROUND - 1)
        place = np.where(self._close[step, None], self._place[step], place)
        rows = np.arange(len(place))[:, None]
        return Fronts(
            normal=found.normal,
            velocity=found.velocity[rows, place],
            slope=found.slope[rows, place],
            curvature=found.curvature[rows, place],
            share=found.share[rows, place],
        )

    def cusps(self, time: float, radius: float) -> list[Cusp]:
        """Cusps of the fronts that start as a circle, by mode, then by the normal's angle.

        A front turns back where its length per radian of the normal, radius + time (c_n + c_n''),
        changes sign.  The search step is a tenth of a degree, a thousandth where fronts are close.
        """
        inside = (np.flatnonzero(self._close)[:, None] + np.arange(100) / 100.0).ravel()
        normals = np.union1d(np.arange(AROUND + 1) - 0.5, inside) / STEPS
        growth = self.fronts(normals).growth(time, radius)
        passes = (growth[:-1] > 0.0) != (growth[1:] > 0.0)
        found = []
        for mode, row in np.argwhere(passes.T).tolist():

            def at(normal: float, mode: int = mode) -> float:
                return float(self.fronts(normal).growth(time, radius)[0, mode])

            normal = float(brentq(at, normals[row], normals[row + 1], xtol=1e-11))
            fronts = self.fronts(normal)
            # Where fronts touch, the sign may change by a jump instead of a zero.
            if abs(at(normal)) < 1e-5 * (radius + time * fronts.velocity[0, mode]):
                x, y = fronts.positions(time, radius)[0, mode].tolist()
                found.append(Cusp(FRONTS[mode], normal % 360.0, x, y))
        return sorted(found, key=lambda cusp: (FRONTS.index(cusp.mode), cusp.normal))

    def misnamed(self) -> dict[str, list[tuple[float, float]]]:
        """Intervals of the normal (degrees), by front, where another component dominates."""
        normals = np.arange(AROUND + 1) / STEPS
        share = self.fronts(normals).share
        runs: dict[str, list[tuple[float, float]]] = {}
        for place, name in enumerate(FRONTS):
            other = share[:, place].max(axis=1) > share[:, place, place] + 1e-6
            edges = np.flatnonzero(np.diff([False, *other.tolist(), False], n=1)).reshape(-1, 2)
            if len(edges):
                runs[name] = [(float(normals[a]), float(normals[b - 1])) for a, b in edges]
        return runs
