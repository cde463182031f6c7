"""Turning points of an indentation test, and least squares fits of the curves between them.

A stretch is a run of points between two turns.  A turn is a point from which the path retreats by
more than a threshold above its noise.  Points within the noise of a turn belong to no stretch.

k follows from the first loading (equation 3-1 with n = 3/2).  With this k, one fit of all unloading
and reloading curves (equations 3-3 and 3-11) gives the power q, the peak alpha_m and the permanent
indentation alpha_0 of every cycle, and the origin of every reloading.  A peak is the intersection
of the unloading and first loading curves; the largest recorded value, which noise increases and
coarse steps reduce, is only the initial guess.

Covariances follow from the residuals of the points (divided by 1 minus their leverage) instead of
a common variance: they hold also for a scatter that grows with the force, and include the error of
k.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from fecm._frozen import frozen
from fecm._typing import Bools, Floats
from fecm.mechanics.contact_law import LOADING_POWER, power_curve
from fecm.studies import StudyError

Ints = NDArray[np.int64]

# Threshold of a turn: fraction of the range of the path, or standard deviations of its noise.
LEAST_RETREAT = 0.02
QUIET = 8.0
GUARD = 2.0  # standard deviations of a smoothed point within which its neighbours may be the turn
NEGLIGIBLE = 0.1  # noise below this fraction of a step reverses no step


@frozen
class Path:
    """Moving mean of measured indentations, and their noise."""

    smooth: Floats  # (n,), length
    noise: float  # standard deviation of a smoothed point; 0 if noise reverses no step
    reach: int  # points of the moving mean on either side

    @property
    def range(self) -> float:
        """Largest minus smallest indentation (length)."""
        return float(np.ptp(self.smooth))


def smoothed(indentation: Floats) -> Path:
    """Estimate the noise of a path, and smooth it only as much as needed to find its turns."""
    # Third differences of a path without noise are almost zero; their median gives the noise.  A
    # moving mean over w points divides the noise by sqrt(w) and cuts off about w/4 steps at a turn;
    # w balances both.
    n = len(indentation)
    if n < 5:
        return Path(indentation, 0.0, 0)
    noise = float(np.median(np.abs(np.diff(indentation, 3)))) / (0.6745 * math.sqrt(20.0))
    rough = _moving_mean(indentation, max(1, n // 200))
    step = float(np.abs(np.diff(rough)).sum()) / (n - 1)
    if noise <= NEGLIGIBLE * step:
        return Path(indentation, 0.0, 0)
    reach = min(max(1, round((4.0 * noise / step) ** (2.0 / 3.0) / 2.0)), n // 50 + 1)
    return Path(_moving_mean(indentation, reach), noise / math.sqrt(2 * reach + 1), reach)


def _moving_mean(values: Floats, reach: int) -> Floats:
    """Mean of each point and up to `reach` neighbours on either side."""
    sums = np.concatenate([[0.0], np.cumsum(values)])
    n = np.arange(len(values))
    first, last = np.maximum(n - reach, 0), np.minimum(n + reach + 1, len(values))
    return np.asarray((sums[last] - sums[first]) / (last - first))


def turns(path: Path, retreat: float) -> list[int]:
    """Find points from which the path retreats by more than `retreat`, and the first and last."""
    s = path.smooth
    found, high, low, direction = [0], 0, 0, 0
    for i in range(1, len(s)):
        if s[i] > s[high]:
            high = i
        if s[i] < s[low]:
            low = i
        if direction >= 0 and s[high] - s[i] > retreat:
            if direction:
                found.append(high)
            direction, low = -1, i
        elif direction <= 0 and s[i] - s[low] > retreat:
            if direction:
                found.append(low)
            direction, high = 1, i
    if found[-1] != len(s) - 1:
        found.append(len(s) - 1)
    return found


LOADING, FALLING, RISING = "loading", "unloading", "reloading"


@frozen
class Stretch:
    """Points on one curve."""

    kind: str  # LOADING, FALLING or RISING
    cycle: int  # number of the last peak, from 0; of LOADING, of the next peak
    rows: Ints  # numbers of the points
    # Of FALLING, the corner at which it begins: the peak of its cycle, or a turn during reloading.
    begin: int = -1
    turn: float = 0.0  # of RISING, the recorded indentation at its beginning


@frozen
class Corner:
    """An upper turn."""

    indentation: float  # largest value of the smoothed path near the turn
    cycle: int
    is_peak: bool  # whether it is on the first loading curve
    rise: int = -1  # otherwise, the number of the RISING stretch that ends there


@frozen
class Division:
    """A test divided into stretches."""

    path: Path
    stretches: tuple[Stretch, ...]
    corners: tuple[Corner, ...]

    @property
    def peaks(self) -> list[int]:
        """Corners that are peaks, one per cycle."""
        return [n for n, corner in enumerate(self.corners) if corner.is_peak]

    def rows(self, kind: str, cycle: int | None = None) -> Ints:
        """Return the points of all stretches of a kind, or of those of a cycle."""
        own = [s for s in self.stretches if s.kind == kind]
        parts = [s.rows for s in own if cycle is None or s.cycle == cycle]
        return np.concatenate([np.empty(0, dtype=np.int64), *parts])


def divide(indentation: Floats, retreat: float | None = None) -> Division:
    """Divide a test into stretches on the curves of the law.

    A retreat of the path counts as a turn; by default if it exceeds 2 % of the range of the path
    and eight standard deviations of its noise.
    """
    path = smoothed(indentation)
    if path.range <= 0.0:
        raise StudyError("the indentation never changes")
    if retreat is None:
        retreat = max(LEAST_RETREAT * path.range, QUIET * path.noise)
    if retreat >= path.range:
        raise StudyError(f"the range of the path is below the threshold of a turn ({retreat:g})")
    found = turns(path, retreat)
    s = path.smooth
    if s[found[1]] <= s[0]:
        raise StudyError("the test begins with unloading; it must begin with the first loading")
    near = max(retreat / 2.0, 4.0 * path.noise)  # peaks within this distance are one
    stretches: list[Stretch] = []
    corners: list[Corner] = []
    cycle = begin = -1
    peak = -math.inf
    for first, end in pairwise(found):
        ends_in_turn = end != found[-1]
        rows, top = _between(path, first, end, ends_in_turn), float(s[end])
        if top <= s[first]:
            stretches.append(Stretch(FALLING, cycle, rows, begin))
            continue
        if cycle >= 0:
            below = rows[s[rows] <= peak]
            stretches.append(Stretch(RISING, cycle, below, turn=float(s[first])))
        rise = len(stretches) - 1
        if top > peak + near:  # a rise continues on the first loading curve beyond the peak
            stretches.append(Stretch(LOADING, cycle + 1, rows[s[rows] > peak]))
            if ends_in_turn:
                cycle, peak, begin = cycle + 1, top, len(corners)
                corners.append(Corner(top, cycle, True))
        elif ends_in_turn and top < peak - near:
            begin = len(corners)
            corners.append(Corner(top, cycle, False, rise))
        elif ends_in_turn:
            begin = max(n for n, corner in enumerate(corners) if corner.is_peak)
    return Division(path, tuple(stretches), tuple(corners))


def _between(path: Path, first: int, end: int, ends_in_turn: bool) -> Ints:
    """Return the points between two turns, without the turns and points too close to them.

    The point at a turn may have been recorded before or after it.
    """
    begin = first + 1 if first else 0
    rows: Ints = np.arange(begin, end if ends_in_turn else end + 1, dtype=np.int64)
    if not path.noise:
        return rows
    s, guard = path.smooth, GUARD * path.noise
    keep = np.full(len(rows), True)
    if first:
        keep &= (np.abs(s[rows] - s[first]) > guard) & (rows > first + path.reach)
    if ends_in_turn:
        keep &= (np.abs(s[rows] - s[end]) > guard) & (rows < end - path.reach)
    return np.asarray(rows[keep])


# Curves ------------------------------------------------------------------------------------------


@frozen
class Estimate:
    """A value and its standard error, which is 0 for a prescribed value."""

    value: float
    error: float


def r_squared(fitted: Floats, measured: Floats) -> float | None:
    """Return 1 minus the residual fraction of the variance; None for constant data."""
    if len(measured) < 2 or not np.ptp(measured):
        return None
    total = float(((measured - measured.mean()) ** 2).sum())
    return 1.0 - float(((measured - fitted) ** 2).sum()) / total


def influence(jacobian: Floats, residual: Floats) -> tuple[Floats, Floats]:
    """Return the pseudo-inverse, and the influence of every point on the fitted parameters."""
    inverse = np.asarray(np.linalg.pinv(jacobian), dtype=np.float64)
    leverage = np.clip(np.einsum("ij,ji->i", jacobian, inverse), 0.0, 0.999)
    return inverse, inverse * (residual / np.sqrt(1.0 - leverage))


LIMITS_Q = (0.3, 12.0)  # bounds of the unloading power
FEWEST = 5  # fewest points of a curve
FIRST_Q = 2.2  # initial guess of the unloading power
AT_LIMIT = 1e-4  # distance from a bound at which a value counts as at it, relative to the range
# Bounds of peaks relative to the recorded value, and of origins relative to the peak.
PEAK_MOVES = 0.15
LIMITS_PERMANENT, LIMITS_ORIGIN = (-0.5, 0.8), (-3.0, 0.8)
VAGUE = 0.05  # relative error above which the curves do not determine a peak
SURE = 3.0  # standard errors by which an origin must exceed a turn
STEP = 1e-6  # step of the scaled parameters in derivatives


@frozen
class ParameterLayout:
    """Index of each parameter in the vector of parameters.

    Stretches that begin without contact have no origin of their own, but the permanent indentation
    of their cycle; those with too few points are not fitted.
    """

    corners: list[int]
    permanents: list[int]  # by cycle
    origins: dict[int, int]  # by RISING stretch
    size: int

    K, Q = 0, 1


def layout_of(division: Division, tied: frozenset[int] = frozenset()) -> ParameterLayout:
    """Number the parameters: k, q, corners, permanent indentations, and origins not in `tied`."""
    corners = list(range(2, 2 + len(division.corners)))
    permanents = [2 + len(corners) + n for n in range(len(division.peaks))]
    origins: dict[int, int] = {}
    size = 2 + len(corners) + len(permanents)
    for n, s in enumerate(division.stretches):
        if s.kind == RISING and len(s.rows) >= FEWEST and n not in tied:
            origins[n], size = size, size + 1
    return ParameterLayout(corners, permanents, origins, size)


@frozen
class Curves:
    """Curves of a test, scaled by its largest indentation and force."""

    division: Division
    a: Floats  # scaled indentation, (n,)
    f: Floats  # scaled force, (n,)
    length: float  # largest indentation
    force: float  # largest force
    layout: ParameterLayout

    @property
    def units(self) -> Floats:
        """Unit of every parameter."""
        of_k = self.force / self.length**LOADING_POWER
        return np.array([of_k, 1.0, *[self.length] * (self.layout.size - 2)])

    def peak_force(self, p: Floats, cycle: int) -> float:
        """Return the force at the peak of a cycle, equation 3-1."""
        peak = p[self.layout.corners[self.division.peaks[cycle]]]
        return float(p[ParameterLayout.K] * peak**LOADING_POWER)

    def stretch(self, p: Floats, number: int, a: Floats) -> Floats:
        """Return the scaled force on the curve of a stretch for scaled `p` and `a`."""
        s, at = self.division.stretches[number], self.layout
        if s.kind == LOADING:
            return np.asarray(power_curve(p[at.K], 0.0, 1.0, LOADING_POWER, a))
        if s.kind == RISING:
            return self._rising(p, number, s.cycle, a)
        corner, top = self.division.corners[s.begin], p[at.corners[s.begin]]
        if corner.is_peak:
            begin = self.peak_force(p, s.cycle)
        else:
            begin = float(self._rising(p, corner.rise, s.cycle, np.array([top]))[0])
        origin = p[at.permanents[s.cycle]]
        return np.asarray(power_curve(begin, origin, top - origin, p[at.Q], a))

    def _rising(self, p: Floats, number: int, cycle: int, a: Floats) -> Floats:
        at = self.layout
        peak = p[at.corners[self.division.peaks[cycle]]]
        origin = p[at.origins.get(number, at.permanents[cycle])]
        top = self.peak_force(p, cycle)
        return np.asarray(power_curve(top, origin, peak - origin, LOADING_POWER, a))

    def numbers(self, *kinds: str) -> list[int]:
        """Return the numbers of the stretches of some kinds with enough points."""
        own = [(n, s) for n, s in enumerate(self.division.stretches) if s.kind in kinds]
        return [n for n, s in own if s.kind != RISING or len(s.rows) >= FEWEST]

    def of(self, p: Floats, *kinds: str) -> tuple[Floats, Floats]:
        """Return fitted and measured forces of the stretches of some kinds."""
        parts = [(n, self.division.stretches[n].rows) for n in self.numbers(*kinds)]
        fitted = [self.stretch(p, n, self.a[rows]) for n, rows in parts]
        measured = [self.f[rows] for _, rows in parts]
        return np.concatenate([[], *fitted]), np.concatenate([[], *measured])


def scaled(division: Division, indentation: Floats, force: Floats) -> Curves:
    """Prepare a divided test for fitting."""
    length, top = float(division.path.smooth.max()), float(force.max())
    if length <= 0.0 or top <= 0.0:
        raise StudyError("indentation and force are never positive")
    curves = Curves(division, indentation / length, force / top, length, top, layout_of(division))
    loading = division.rows(LOADING)
    if np.count_nonzero(curves.a[loading] > 0.0) < FEWEST:
        raise StudyError(f"the first loading has fewer than {FEWEST} points")
    for cycle in range(len(division.peaks)):
        if len(division.rows(FALLING, cycle)) < FEWEST:
            raise StudyError(f"cycle {cycle + 1} has fewer than {FEWEST} points of unloading")
    return curves


@frozen
class Solution:
    """Fitted parameters in the units of the test, numbered by :class:`ParameterLayout`.

    A value at a bound means that the curves do not fit, and that the errors are meaningless.
    """

    curves: Curves
    values: Floats  # (m,)
    covariance: Floats  # (m, m)
    held: frozenset[int]  # corners held at their recorded values
    at_limit: bool  # whether a value is at a bound

    @property
    def scaled(self) -> Floats:
        """Scaled values."""
        return np.asarray(self.values / self.curves.units)

    def estimate(self, function: Callable[[Floats], float]) -> Estimate:
        """Return a function of the parameters and its standard error."""
        units = self.curves.units
        gradient = _derivatives(lambda x: np.array([function(x * units)]), self.scaled)[0] / units
        variance = float(gradient @ self.covariance @ gradient)
        return Estimate(function(self.values), max(variance, 0.0) ** 0.5)


def solve(curves: Curves, q: float | None = None) -> Solution:
    """Fit all curves; corners that the curves do not determine keep their recorded values.

    The unloading power is fitted unless `q` prescribes it.  In a first fit, every reloading has a
    separate origin.  If it is significantly above the turn at which the reloading began, contact
    was lost, and the origin is the permanent indentation; a reloading that began in contact has its
    origin below the turn.
    """
    solution = _held_or_not(curves, q)
    lowest = solution.values - SURE * np.sqrt(np.diag(solution.covariance))
    turns = {n: curves.division.stretches[n].turn for n in curves.layout.origins}
    tied = frozenset(n for n, at in curves.layout.origins.items() if lowest[at] > turns[n])
    if not tied:
        return solution
    return _held_or_not(replace(curves, layout=layout_of(curves.division, tied)), q)


def _held_or_not(curves: Curves, q: float | None) -> Solution:
    """Fit; hold corners that the curves do not determine."""
    held: frozenset[int] = frozenset()
    while True:
        solution = _solve(curves, q, held)
        known = np.sqrt(np.diag(solution.covariance)) < VAGUE * solution.values
        vague = {n for n, place in enumerate(curves.layout.corners) if not known[place]}
        if not vague:
            return solution
        held |= vague


def _solve(curves: Curves, q: float | None, held: frozenset[int]) -> Solution:
    from scipy.optimize import least_squares

    start, low, high = _start(curves, q)
    free = np.full(curves.layout.size, True)
    free[ParameterLayout.K] = False
    free[ParameterLayout.Q] = q is None and bool(curves.layout.corners)
    free[[curves.layout.corners[n] for n in held]] = False

    def residuals(x: Floats) -> Floats:
        p = start.copy()
        p[free] = x
        fitted, measured = curves.of(p, FALLING, RISING)
        return np.asarray(measured - fitted)

    p = start.copy()
    if free.any():
        found = least_squares(
            residuals, start[free], bounds=(low[free], high[free]),
            xtol=1e-12, ftol=1e-12, gtol=1e-12,
        )  # fmt: skip
        p[free] = found.x
    units = curves.units
    covariance = _covariance(curves, p, free) * np.outer(units, units)
    near = np.minimum(p - low, high - p)[free] < AT_LIMIT * (high - low)[free]
    return Solution(curves, p * units, covariance, held, bool(near.any()))


def _start(curves: Curves, q: float | None) -> tuple[Floats, Floats, Floats]:
    """Return initial values and bounds of all parameters; k is final."""
    at, division = curves.layout, curves.division
    rows = division.rows(LOADING)
    x = np.maximum(curves.a[rows], 0.0) ** LOADING_POWER
    p, low, high = (np.zeros(at.size) for _ in range(3))
    p[at.K] = float(x @ curves.f[rows]) / float(x @ x)
    p[at.Q] = FIRST_Q if q is None else q
    low[at.Q], high[at.Q] = LIMITS_Q
    for number, corner in zip(at.corners, division.corners, strict=True):
        p[number] = corner.indentation / curves.length
        low[number], high[number] = (1.0 - PEAK_MOVES) * p[number], (1.0 + PEAK_MOVES) * p[number]

    def origin(
        place: int, rows: Ints, cycle: int, power: float, limits: tuple[float, float]
    ) -> None:
        low[place], high[place] = np.array(limits) * p[at.corners[division.peaks[cycle]]]
        guess = _origin(curves.a[rows], curves.f[rows], power)
        p[place] = min(max(guess, 0.9 * low[place]), 0.9 * high[place])

    for cycle, place in enumerate(at.permanents):
        origin(place, division.rows(FALLING, cycle), cycle, p[at.Q], LIMITS_PERMANENT)
    for number, place in at.origins.items():
        s = division.stretches[number]
        origin(place, s.rows, s.cycle, LOADING_POWER, LIMITS_ORIGIN)
    return p, low, high


def _origin(a: Floats, f: Floats, power: float) -> float:
    """Return the zero of a straight line through f^(1/power)."""
    high = f > 0.1 * f.max()
    if np.count_nonzero(high) < 3 or not np.ptp(a[high]):
        return 0.0
    slope, level = np.polyfit(a[high], f[high] ** (1.0 / power), 1)
    return float(-level / slope) if slope > 0.0 else 0.0


def _covariance(curves: Curves, p: Floats, free: Bools) -> Floats:
    """Return the covariance of the scaled parameters; zero for parameters that are not free."""
    # The sum over the points of the squares of their influence.  Points of the first loading affect
    # k and, through k, all other parameters.
    rows = curves.division.rows(LOADING)
    x = np.maximum(curves.a[rows], 0.0) ** LOADING_POWER
    share = x / float(x @ x)
    on_k = share * ((curves.f[rows] - p[ParameterLayout.K] * x) / np.sqrt(1.0 - x * share))
    covariance, by_k = np.zeros((len(p), len(p))), np.zeros(len(p))
    by_k[ParameterLayout.K] = 1.0
    if free.any():
        jacobian = _derivatives(lambda x: curves.of(x, FALLING, RISING)[0], p)
        fitted, measured = curves.of(p, FALLING, RISING)
        inverse, of_points = influence(jacobian[:, free], measured - fitted)
        by_k[free] = -inverse @ jacobian[:, ParameterLayout.K]
        block = of_points @ of_points.T
        if np.linalg.matrix_rank(jacobian[:, free], tol=1e-9 * len(fitted)) < len(block):
            block += np.diag(np.full(len(block), np.inf))
        covariance[np.ix_(free, free)] = block
    return covariance + np.outer(by_k, by_k) * float(on_k @ on_k)


def _derivatives(function: Callable[[Floats], Floats], p: Floats) -> Floats:
    """Return the Jacobian of a function of scaled parameters by central differences."""
    steps = STEP * np.eye(len(p))
    return np.stack([(function(p + h) - function(p - h)) / (2.0 * STEP) for h in steps], axis=1)
