"""Search for the place: candidates on a grid, and the minima that start from the best of them."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple, Self

import numpy as np

from fecm._errors import FecmError, StudyError
from fecm._frozen import frozen
from fecm._typing import Floats, Indices
from fecm.location.errors import LocateError
from fecm.location.fit import Fit, Trial
from fecm.location.location import Candidate
from fecm.mechanics.mesh import Mesh, longest_sides

CANDIDATES = 126  # by default, about
MOST_CANDIDATES = 10_000
STARTS = 4  # least minima of the grid that are refined
APART = 0.5  # distance of two minima, over that of the candidates, below which they are one
EDGE = 1e-6  # rounding of places on the edge of the region, over its side
ONSET = 0.1  # share of the peak that a force passes at its beginning
BEGINNINGS = 33  # times that are tried around it
NOISY = 10.0  # variances of a residual by which two fits differ by chance
BEFORE = 0.25  # how much earlier a force may begin if the shift is fitted, over the record


@frozen
class Region:
    """Rectangle in which the place is sought: x0, y0, x1, y1."""

    corners: tuple[float, float, float, float]

    @classmethod
    def of(cls, mesh: Mesh, radius: float, asked: tuple[float, float, float, float] | None) -> Self:
        """The rectangle that was asked for, or that in which the circle is on the plate's one."""
        places = mesh.coordinates[mesh.used]
        low, high = places.min(axis=0) + radius, places.max(axis=0) - radius
        if asked is not None:
            x0, y0, x1, y1 = asked
            if not (x0 < x1 and y0 < y1):
                raise StudyError(
                    f"region {x0:g},{y0:g},{x1:g},{y1:g} has no area: x0 < x1, y0 < y1"
                )
            low, high = np.maximum(low, (x0, y0)), np.minimum(high, (x1, y1))
        if not (low < high).all():
            raise StudyError("the region is not on the plate")
        return cls((*low.tolist(), *high.tolist()))

    @property
    def low(self) -> Floats:
        """Lowest x and y."""
        return np.array(self.corners[:2])

    @property
    def high(self) -> Floats:
        """Highest x and y."""
        return np.array(self.corners[2:])

    @property
    def size(self) -> Floats:
        """Sides."""
        return self.high - self.low

    def grid(self, asked: float | None) -> tuple[Floats, Floats]:
        """Coordinates of the columns and of the rows of candidates in the region."""
        pitch = asked or math.sqrt(float(self.size.prod()) / CANDIDATES)
        counts = np.maximum(np.round(self.size / pitch), 1.0).astype(int)
        if counts.prod() > MOST_CANDIDATES:
            raise StudyError(
                f"a grid of {pitch:g} has {counts.prod()} candidates; take a larger one"
            )
        x, y = (
            low + side * (np.arange(count) + 0.5) / count
            for low, side, count in zip(self.low, self.size, counts, strict=True)
        )
        return x, y

    def nodes(self, mesh: Mesh) -> Indices:
        """Nodes of the elements that a force in the region may act on, sorted."""
        margin = 1.5 * float(longest_sides(mesh.elements, mesh.coordinates).max())
        margin += max(0.0, float((self.low - mesh.coordinates[mesh.used].min(axis=0)).min()))
        low, high = self.low - margin, self.high + margin
        near = ((mesh.coordinates >= low) & (mesh.coordinates <= high)).all(axis=1)
        return np.flatnonzero(near & mesh.used)

    def at_edge(self, x: float, y: float) -> bool:
        """Whether a place is on the edge."""
        place, margin = np.array([x, y]), EDGE * self.size
        return bool(((place <= self.low + margin) | (place >= self.high - margin)).any())


class Found(NamedTuple):
    """The best fit, another minimum, and the candidates, (k, 2), with their misfits, (k,)."""

    best: Trial
    second: Candidate | None
    candidates: Floats
    misfit: Floats


def best_fits(fit: Fit, region: Region, pitch: float | None) -> Found:
    """Find the minima of the misfit.

    Raises LocateError if the strains of no candidate are those of a force.
    """
    x, y = region.grid(pitch)
    box = np.array([region.low, region.high])
    begin = _beginning(fit, x, y, box) if fit.shift else 0.0
    trials = _scan(fit, x, y, begin)
    starts = _minima(trials)[:STARTS]
    # Minima that are far above the best one are no rivals, but the second may be asked for.
    refined = sorted((fit.refined(start, box) for start in starts), key=lambda one: one.square)
    best = refined[0]
    tried = [one for one in trials.flat if one is not None]
    apart = APART * float(np.hypot(region.size[0] / len(x), region.size[1] / len(y)))
    others = [r for r in refined if math.hypot(r.x - best.x, r.y - best.y) > apart]
    tiny = np.finfo(float).tiny

    def ratio(one: Trial) -> float:
        return math.sqrt(one.square / max(best.square, tiny))

    return Found(
        best,
        Candidate(others[0].x, others[0].y, ratio(others[0])) if others else None,
        np.array([(one.x, one.y) for one in tried]),
        np.array([ratio(one) for one in tried]),
    )


def _scan(
    fit: Fit, x: Floats, y: Floats, shift: float
) -> np.ndarray[tuple[int, ...], np.dtype[np.object_]]:
    """Best forces at the candidates, (columns, rows); None off the plate."""
    trials = np.full((len(x), len(y)), None, dtype=object)
    for i, j in np.ndindex(trials.shape):
        try:
            trials[i, j] = fit.at(float(x[i]), float(y[j]), shift)
        except FecmError:  # a hole or a notch
            continue
    if not any(one is not None and one.active.any() for one in trials.flat):
        raise LocateError(
            "no force on the region explains the strains: check signs, times and region"
        )
    return trials


def _minima(trials: np.ndarray[tuple[int, ...], np.dtype[np.object_]]) -> list[Trial]:
    """Candidates that no neighbour is better than, the best first."""
    squares = np.full((trials.shape[0] + 2, trials.shape[1] + 2), math.inf)
    for (i, j), one in np.ndenumerate(trials):
        squares[i + 1, j + 1] = math.inf if one is None else one.square
    found = [
        one
        for (i, j), one in np.ndenumerate(trials)
        if one is not None and one.square <= squares[i : i + 3, j : j + 3].min()
    ]
    return sorted(found, key=lambda one: one.square)


def _beginning(fit: Fit, x: Floats, y: Floats, box: Floats) -> float:
    """Time at which the force begins, which may be before time 0.

    A force that may act much earlier fits as well as one that begins with its first hat.  The last
    of the beginnings that describe the strains is that of the force.
    """
    seen = fit.model.observation
    record = seen.interval * (fit.model.responses.shape[2] - 1)
    trials = _scan(fit, x, y, -BEFORE / (1.0 + BEFORE) * record)
    early = replace(fit, shift=False).refined(_minima(trials)[0], box)
    first = int(np.argmax(early.force > ONSET * early.force.max()))
    rough = float(fit.model.knots(early.shift)[first]) - fit.model.basis
    begins = rough + fit.model.basis * np.linspace(-2.0, 2.0, BEGINNINGS)
    squares = np.array([fit.at(early.x, early.y, begin).square for begin in begins.tolist()])
    as_good = squares <= squares.min() * (1.0 + NOISY / early.residual.size)
    return float(begins[np.flatnonzero(as_good)[-1]])
