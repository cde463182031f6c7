"""Search for the place: candidates on a grid, then refinement of the best candidates."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple, Self

import numpy as np

from fecm._errors import FecmError, StudyError
from fecm._typing import Floats, Indices
from fecm.location.fit import LocationFit, PlaceTrial, is_determined
from fecm.location.location import Candidate, LocateError
from fecm.mechanics.mesh import MeshArrays, longest_sides

CANDIDATES = 126  # approximate number by default
MOST_CANDIDATES = 10_000
STARTS = 4  # best minima of the grid, which are refined
APART = 0.5  # smallest distance of two minima, over the distance of the candidates
EDGE = 1e-6  # distance from the edge that is rounding, over the side of the region
ONSET = 0.1  # share of the peak that a force passes when it starts
BEGINNINGS = 33  # starts that are tried around this time
ENOUGH = 5  # fewest strains per value of the force that determine it
CHANCE = 3.0  # standard deviations of a fall of the misfit that chance explains
NOISY = 10.0  # variances of a residual by which two fits differ by chance
BEFORE = 0.25  # time, over the record, by which a force may start early if the shift is fitted


class Region(NamedTuple):
    """Rectangle in which the place is searched: x0, y0, x1, y1."""

    corners: tuple[float, float, float, float]

    @classmethod
    def of(cls, mesh: MeshArrays, radius: float, corners: Sequence[float] | None) -> Self:
        """Return the region between corners, or the largest; the circle stays on the plate."""
        places = mesh.coordinates[mesh.used]
        low, high = places.min(axis=0) + radius, places.max(axis=0) - radius
        if corners is not None:
            x0, y0, x1, y1 = corners
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

    def grid(self, pitch: float | None) -> tuple[Floats, Floats]:
        """Return x of the columns and y of the rows of candidates."""
        pitch = pitch or math.sqrt(float(self.size.prod()) / CANDIDATES)
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

    def nodes(self, mesh: MeshArrays) -> Indices:
        """Return the nodes on which a force in the region may act, sorted."""
        margin = 1.5 * float(longest_sides(mesh.elements, mesh.coordinates).max())
        margin += max(0.0, float((self.low - mesh.coordinates[mesh.used].min(axis=0)).min()))
        low, high = self.low - margin, self.high + margin
        near = ((mesh.coordinates >= low) & (mesh.coordinates <= high)).all(axis=1)
        return np.flatnonzero(near & mesh.used)

    def at_edge(self, x: float, y: float) -> bool:
        """Return whether a place is on the edge."""
        place, margin = np.array([x, y]), EDGE * self.size
        return bool(((place <= self.low + margin) | (place >= self.high - margin)).any())


class SearchResult(NamedTuple):
    """Best fit, second minimum, and the candidates, (k, 2), with their misfits, (k,)."""

    best: PlaceTrial
    second: Candidate | None
    candidates: Floats
    misfit: Floats


class Scan(NamedTuple):
    """Misfits of the best forces at candidates."""

    x: Floats  # (columns,)
    y: Floats  # (rows,)
    shift: float
    squares: Floats  # (columns, rows): sums of the squares; infinite off the plate

    def minima(self) -> list[tuple[float, float]]:
        """Return the candidates that are at least as good as their neighbours, the best first."""
        around = np.pad(self.squares, 1, constant_values=math.inf)
        windows = np.lib.stride_tricks.sliding_window_view(around, (3, 3))
        least = (self.squares <= windows.min(axis=(2, 3))) & np.isfinite(self.squares)
        places = np.argwhere(least)[np.argsort(self.squares[least], kind="stable")]
        return [(float(self.x[i]), float(self.y[j])) for i, j in places]


def best_fits(fit: LocationFit, region: Region, pitch: float | None) -> SearchResult:
    """Find the minima of the misfit.

    Raises LocateError if no candidate has a force that fits the strains.
    """
    x, y = region.grid(pitch)
    box = np.array([region.low, region.high])
    start_time = _find_start_of_force(fit, x, y, box) if fit.shift else 0.0
    scan = _scan(fit, x, y, start_time)
    starts = [fit.at(*place, start_time) for place in scan.minima()[:STARTS]]
    refined = sorted((fit.refined(start, box) for start in starts), key=lambda trial: trial.square)
    best = refined[0]
    apart = APART * float(np.hypot(region.size[0] / len(x), region.size[1] / len(y)))
    distant = [t for t in refined if math.hypot(t.x - best.x, t.y - best.y) > apart]
    least = max(best.square, np.finfo(float).tiny)
    on_plate = np.isfinite(scan.squares)
    return SearchResult(
        best,
        Candidate(distant[0].x, distant[0].y, math.sqrt(distant[0].square / least))
        if distant
        else None,
        np.column_stack([x[np.nonzero(on_plate)[0]], y[np.nonzero(on_plate)[1]]]),
        np.sqrt(scan.squares[on_plate] / least),
    )


def narrowed(
    fit: LocationFit, minima: SearchResult, region: Region, noise: float | None
) -> tuple[LocationFit, SearchResult]:
    """Fit place and force with narrower hats, from the minimum of wider ones.

    A polygon differs from the curved true force, which moves the place. The hats are halved once if
    there are enough strains, and again as long as the misfit falls by more than chance.
    """
    box, best = np.array([region.low, region.high]), minima.best
    first = True
    while (half := fit.halved()) is not None:
        trial = half.refined(half.at(best.x, best.y, best.shift, best.gains), box)
        enough = ENOUGH * half.model.hats <= half.model.observation.count
        if not (first and enough) and not is_clear_fall(half, best, trial, noise):
            break
        fit, best, first = half, trial, False
    return fit, minima._replace(best=best)


def is_wide(fit: LocationFit, best: PlaceTrial, noise: float | None) -> bool:
    """Return whether hats of half the width lower the misfit by more than chance."""
    if (half := fit.halved()) is None:
        return False
    return is_clear_fall(half, best, half.at(best.x, best.y, best.shift, best.gains), noise)


def is_clear_fall(
    half: LocationFit, wide: PlaceTrial, narrow: PlaceTrial, noise: float | None
) -> bool:
    """Return whether narrow hats lower the misfit of wide ones by more than chance."""
    added = max(1, int(narrow.active.sum()) - int(wide.active.sum()))
    variance = (noise or half.deviation(narrow)) ** 2
    return wide.square - narrow.square > variance * (added + CHANCE * math.sqrt(2.0 * added))


def _scan(fit: LocationFit, x: Floats, y: Floats, shift: float) -> Scan:
    """Compute the misfits of the candidates in columns x and rows y."""
    squares, has_force = np.full((len(x), len(y)), math.inf), False
    for i, j in np.ndindex(squares.shape):
        try:
            trial = fit.at(float(x[i]), float(y[j]), shift)
        except FecmError:  # a hole or a notch
            continue
        squares[i, j] = trial.square
        has_force = has_force or bool(trial.active.any())
    if not has_force:
        raise LocateError(
            "no force in the region explains the strains; check the signs of the gages, the times "
            "and the region"
        )
    return Scan(x, y, shift, squares)


def _find_start_of_force(fit: LocationFit, x: Floats, y: Floats, box: Floats) -> float:
    """Return the time at which the force starts, which may be before time 0.

    A force that may start much too early fits as well as one that starts at the right time. The
    last start that describes the strains is therefore the right one.
    """
    record = fit.model.observation.interval * (fit.model.responses.shape[2] - 1)
    earliest = -BEFORE / (1.0 + BEFORE) * record
    (place, *_) = _scan(fit, x, y, earliest).minima()
    fixed_start = replace(fit, shift=False)
    early = fixed_start.refined(fit.at(*place, earliest), box)
    determined = np.where(is_determined(fixed_start.errors(early, 1.0).force), early.force, 0.0)
    first = int(np.argmax(determined > ONSET * determined.max()))
    rough = float(fit.model.knots(early.shift)[first]) - fit.model.basis
    starts = rough + fit.model.basis * np.linspace(-2.0, 2.0, BEGINNINGS)
    squares = np.array([fit.at(early.x, early.y, start).square for start in starts.tolist()])
    as_good = squares <= squares.min() * (1.0 + NOISY / early.residual.size)
    return float(starts[np.flatnonzero(as_good)[-1]])
