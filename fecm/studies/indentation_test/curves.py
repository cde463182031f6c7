"""Least-squares fits of the curves of an indentation test, and of its permanent indentation.

Curves: k follows from the first loading (equation 3-1 with n = 3/2). With this k, one fit of all
unloading and reloading curves (equations 3-3 and 3-11) gives the power q, the peak alpha_m and the
permanent indentation alpha_0 of every cycle, and the origin of every reloading. A peak is the
intersection of the unloading and first loading curves. The largest recorded value, which noise
increases and coarse steps reduce, is only the initial guess.

Covariances follow from the residuals of the points (divided by 1 minus their leverage) instead of
a common variance. They hold also for a scatter that grows with the force, and include the error of
k.

Permanent indentation: equations 3-8 and 3-7 relate it to the largest indentation. Both coordinates
of a cycle have errors, which are correlated with each other and with the errors of other cycles.
The fit is by generalised least squares with the complete covariance.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from fecm._errors import StudyError
from fecm._typing import Bools, Floats, Indices
from fecm.mechanics.contact_law import ACR_POWER, LOADING_POWER, power_curve
from fecm.studies.indentation_test.turns import Division, Rows, StretchKind


@dataclass(frozen=True)
class FittedValue:
    """A value and its standard error, which is 0 for a prescribed value."""

    value: float
    error: float


def r_squared(fitted: Floats, measured: Floats) -> float | None:
    """Return 1 minus the residual share of the variance; None for constant data."""
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
AT_LIMIT = 1e-4  # distance from a bound, over the range, within which a value is at the bound
# Bounds of peaks relative to the recorded value, and of origins relative to the peak.
PEAK_MOVES = 0.15
LIMITS_PERMANENT = (-0.5, 0.8)
LIMITS_ORIGIN = (-3.0, 0.8)
VAGUE = 0.05  # relative error above which the curves do not determine a peak
SURE = 3.0  # standard errors by which an origin must exceed a turn
STEP = 1e-6  # step of the scaled parameters in derivatives


@dataclass(frozen=True)
class ParameterLayout:
    """Index of each parameter in the vector of parameters.

    The origin of a reloading that starts without contact is the permanent indentation of its cycle.
    Reloadings with too few points are not fitted.
    """

    corners: list[int]
    permanents: list[int]  # by cycle
    origins: dict[int, int]  # by RISING stretch
    size: int

    K = 0
    Q = 1


def parameter_layout(division: Division, tied: frozenset[int] = frozenset()) -> ParameterLayout:
    """Assign numbers to k, q, corners, permanent indentations, and origins not in `tied`."""
    corners = list(range(2, 2 + len(division.corners)))
    permanents = [2 + len(corners) + n for n in range(len(division.peaks))]
    origins: dict[int, int] = {}
    size = 2 + len(corners) + len(permanents)
    for n, s in enumerate(division.stretches):
        if s.kind == StretchKind.RISING and len(s.rows) >= FEWEST and n not in tied:
            origins[n], size = size, size + 1
    return ParameterLayout(corners, permanents, origins, size)


@dataclass(frozen=True, eq=False)
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
        unit_of_k = self.force / self.length**LOADING_POWER
        return np.array([unit_of_k, 1.0, *[self.length] * (self.layout.size - 2)])

    def peak_force(self, p: Floats, cycle: int) -> float:
        """Return the force at the peak of a cycle, equation 3-1."""
        peak = p[self.layout.corners[self.division.peaks[cycle]]]
        return float(p[ParameterLayout.K] * peak**LOADING_POWER)

    def stretch(self, p: Floats, number: int, a: Floats) -> Floats:
        """Return the scaled force on the curve of a stretch for scaled `p` and `a`."""
        s, layout = self.division.stretches[number], self.layout
        if s.kind == StretchKind.LOADING:
            return np.asarray(power_curve(p[layout.K], 0.0, 1.0, LOADING_POWER, a))
        if s.kind == StretchKind.RISING:
            return self._rising(p, number, s.cycle, a)
        corner, top = self.division.corners[s.begin], p[layout.corners[s.begin]]
        if corner.is_peak:
            begin = self.peak_force(p, s.cycle)
        else:
            begin = float(self._rising(p, corner.rise, s.cycle, np.array([top]))[0])
        origin = p[layout.permanents[s.cycle]]
        return np.asarray(power_curve(begin, origin, top - origin, p[layout.Q], a))

    def _rising(self, p: Floats, number: int, cycle: int, a: Floats) -> Floats:
        layout = self.layout
        peak = p[layout.corners[self.division.peaks[cycle]]]
        origin = p[layout.origins.get(number, layout.permanents[cycle])]
        top = self.peak_force(p, cycle)
        return np.asarray(power_curve(top, origin, peak - origin, LOADING_POWER, a))

    def numbers(self, *kinds: StretchKind) -> list[int]:
        """Return the numbers of the stretches of some kinds with enough points."""
        numbered = [(n, s) for n, s in enumerate(self.division.stretches) if s.kind in kinds]
        return [n for n, s in numbered if s.kind != StretchKind.RISING or len(s.rows) >= FEWEST]

    def of(self, p: Floats, *kinds: StretchKind) -> tuple[Floats, Floats]:
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
    curves = Curves(
        division, indentation / length, force / top, length, top, parameter_layout(division)
    )
    loading = division.rows(StretchKind.LOADING)
    if np.count_nonzero(curves.a[loading] > 0.0) < FEWEST:
        raise StudyError(f"the first loading has fewer than {FEWEST} points")
    for cycle in range(len(division.peaks)):
        if len(division.rows(StretchKind.FALLING, cycle)) < FEWEST:
            raise StudyError(f"cycle {cycle + 1} has fewer than {FEWEST} points of unloading")
    return curves


class CurveSolution(NamedTuple):
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

    def estimate(self, function: Callable[[Floats], float]) -> FittedValue:
        """Return a function of the parameters and its standard error."""
        units = self.curves.units
        gradient = _derivatives(lambda x: np.array([function(x * units)]), self.scaled)[0] / units
        variance = float(gradient @ self.covariance @ gradient)
        return FittedValue(function(self.values), max(variance, 0.0) ** 0.5)


def fit_curves(curves: Curves, q: float | None = None) -> CurveSolution:
    """Fit all curves; corners that the curves do not determine keep their recorded values.

    The unloading power is fitted unless `q` prescribes it. In the first fit, every reloading has a
    separate origin. A reloading that began in contact has its origin below the turn at which it
    began. If the origin is significantly above the turn, contact was lost, and the second fit takes
    the permanent indentation as the origin.
    """
    solution = _fit_determined(curves, q)
    lowest = solution.values - SURE * np.sqrt(np.diag(solution.covariance))
    turns = {n: curves.division.stretches[n].turn for n in curves.layout.origins}
    tied = frozenset(n for n, place in curves.layout.origins.items() if lowest[place] > turns[n])
    if not tied:
        return solution
    return _fit_determined(replace(curves, layout=parameter_layout(curves.division, tied)), q)


def _fit_determined(curves: Curves, q: float | None) -> CurveSolution:
    """Fit the curves, and hold corners that they do not determine."""
    held: frozenset[int] = frozenset()
    while True:
        solution = _solve(curves, q, held)
        is_determined = np.sqrt(np.diag(solution.covariance)) < VAGUE * solution.values
        vague = {n for n, place in enumerate(curves.layout.corners) if not is_determined[place]}
        if not vague:
            return solution
        held |= vague


def _solve(curves: Curves, q: float | None, held: frozenset[int]) -> CurveSolution:
    from scipy.optimize import least_squares  # takes 0.3 s, and most commands do not fit

    start, low, high = _start(curves, q)
    free = np.full(curves.layout.size, True)
    free[ParameterLayout.K] = False
    free[ParameterLayout.Q] = q is None and bool(curves.layout.corners)
    free[[curves.layout.corners[n] for n in held]] = False

    def residuals(x: Floats) -> Floats:
        p = start.copy()
        p[free] = x
        fitted, measured = curves.of(p, StretchKind.FALLING, StretchKind.RISING)
        return np.asarray(measured - fitted)

    p = start.copy()
    if free.any():
        solution = least_squares(
            residuals,
            start[free],
            bounds=(low[free], high[free]),
            xtol=1e-12,
            ftol=1e-12,
            gtol=1e-12,
        )
        p[free] = solution.x
    units = curves.units
    covariance = _covariance(curves, p, free) * np.outer(units, units)
    near = np.minimum(p - low, high - p)[free] < AT_LIMIT * (high - low)[free]
    return CurveSolution(curves, p * units, covariance, held, bool(near.any()))


def _start(curves: Curves, q: float | None) -> tuple[Floats, Floats, Floats]:
    """Return initial values and bounds of all parameters; k is final."""
    layout, division = curves.layout, curves.division
    rows = division.rows(StretchKind.LOADING)
    x = np.maximum(curves.a[rows], 0.0) ** LOADING_POWER
    p, low, high = (np.zeros(layout.size) for _ in range(3))
    p[layout.K] = float(x @ curves.f[rows]) / float(x @ x)
    p[layout.Q] = FIRST_Q if q is None else q
    low[layout.Q], high[layout.Q] = LIMITS_Q
    for number, corner in zip(layout.corners, division.corners, strict=True):
        p[number] = corner.indentation / curves.length
        low[number] = (1.0 - PEAK_MOVES) * p[number]
        high[number] = (1.0 + PEAK_MOVES) * p[number]

    def start_origin(
        place: int, rows: Rows, *, cycle: int, power: float, limits: tuple[float, float]
    ) -> None:
        low[place], high[place] = np.array(limits) * p[layout.corners[division.peaks[cycle]]]
        guess = _origin(curves.a[rows], curves.f[rows], power)
        p[place] = min(max(guess, 0.9 * low[place]), 0.9 * high[place])

    for cycle, place in enumerate(layout.permanents):
        rows = division.rows(StretchKind.FALLING, cycle)
        start_origin(place, rows, cycle=cycle, power=p[layout.Q], limits=LIMITS_PERMANENT)
    for number, place in layout.origins.items():
        s = division.stretches[number]
        start_origin(place, s.rows, cycle=s.cycle, power=LOADING_POWER, limits=LIMITS_ORIGIN)
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
    # The covariance is the sum over the points of their squared influence. Points of the first
    # loading affect k and, through k, all other parameters.
    rows = curves.division.rows(StretchKind.LOADING)
    x = np.maximum(curves.a[rows], 0.0) ** LOADING_POWER
    share = x / float(x @ x)
    influence_on_k = share * (
        (curves.f[rows] - p[ParameterLayout.K] * x) / np.sqrt(1.0 - x * share)
    )
    covariance, sensitivity_to_k = np.zeros((len(p), len(p))), np.zeros(len(p))
    sensitivity_to_k[ParameterLayout.K] = 1.0
    if free.any():
        jacobian = _derivatives(
            lambda x: curves.of(x, StretchKind.FALLING, StretchKind.RISING)[0], p
        )
        fitted, measured = curves.of(p, StretchKind.FALLING, StretchKind.RISING)
        inverse, influences = influence(jacobian[:, free], measured - fitted)
        sensitivity_to_k[free] = -inverse @ jacobian[:, ParameterLayout.K]
        block = influences @ influences.T
        if np.linalg.matrix_rank(jacobian[:, free], tol=1e-9 * len(fitted)) < len(block):
            block += np.diag(np.full(len(block), np.inf))
        covariance[np.ix_(free, free)] = block
    return covariance + np.outer(sensitivity_to_k, sensitivity_to_k) * float(
        influence_on_k @ influence_on_k
    )


def _derivatives(function: Callable[[Floats], Floats], p: Floats) -> Floats:
    """Return the Jacobian of a function of scaled parameters by central differences."""
    steps = STEP * np.eye(len(p))
    return np.stack([(function(p + h) - function(p - h)) / (2.0 * STEP) for h in steps], axis=1)


ROUNDS = 20  # iterations of the weights, which depend on the slope
UNLIKELY = 0.01  # probability of chi² below which the scatter exceeds the noise of the points


@dataclass(frozen=True)
class PermanentLine:
    """Permanent indentation by equation 3-8, alpha_0 = s_p (alpha_m - alpha_p)."""

    s_p: FittedValue
    alpha_p: FittedValue
    elastic: tuple[int, ...]  # cycles below alpha_p, without permanent indentation
    scatter: float  # factor on the errors, from :func:`_scatter`


def fit_permanent_line(
    peaks: Floats, permanents: Floats, covariance: Floats
) -> PermanentLine | None:
    """Fit alpha_0 = max(0, s_p (alpha_m - alpha_p)); None if fewer than two cycles exceed alpha_p.

    The covariance must be regular. It has all peaks alpha_m, then all permanent indentations
    alpha_0.
    """
    order = np.argsort(peaks)
    fits: list[tuple[float, PermanentLine]] = []
    for count in range(len(peaks) - 1):
        chi_and_line = _fit_line(peaks, permanents, covariance, order[:count])
        if chi_and_line is None:
            continue
        start = chi_and_line[1].alpha_p.value
        if not count or peaks[order[count - 1]] <= start < peaks[order[count]]:
            fits.append(chi_and_line)
    return min(fits, key=lambda pair: pair[0])[1] if fits else None


def _fit_line(
    peaks: Floats, permanents: Floats, covariance: Floats, elastic: Indices
) -> tuple[float, PermanentLine] | None:
    """Return chi² and the line for a set of elastic cycles."""
    n = len(peaks)
    beyond = np.full(n, 1.0)
    beyond[elastic] = 0.0
    design = np.stack([beyond * peaks, beyond], axis=1)
    slope, level = np.polyfit(peaks[beyond > 0.0], permanents[beyond > 0.0], 1)
    normal, weight = np.eye(2), np.eye(n)
    for _ in range(ROUNDS):
        across = np.concatenate([np.diag(-slope * beyond), np.eye(n)], axis=1)
        variance = across @ covariance @ across.T
        weight = np.linalg.pinv(variance, rcond=1e-14, hermitian=True)
        normal = design.T @ weight @ design
        if not np.all(np.isfinite(normal)) or np.linalg.matrix_rank(normal) < 2:
            return None
        slope, level = np.linalg.solve(normal, design.T @ weight @ permanents)
    if slope == 0.0:
        return None
    errors = np.linalg.inv(normal)
    residual = permanents - design @ [slope, level]
    chi = float(residual @ weight @ residual)
    scatter = _scatter(chi, n - 2)
    derivatives = np.array([level / slope**2, -1.0 / slope])
    s_p = FittedValue(float(slope), scatter * float(errors[0, 0] ** 0.5))
    alpha_p = FittedValue(
        float(-level / slope), scatter * float((derivatives @ errors @ derivatives) ** 0.5)
    )
    return chi, PermanentLine(s_p, alpha_p, tuple(elastic.tolist()), scatter)


def _scatter(chi: float, freedom: int) -> float:
    """Return the root of chi² per degree of freedom if the scatter exceeds the noise, else 1."""
    from scipy.special import chdtrc  # takes 0.15 s, and most commands do not fit

    if freedom > 0 and chdtrc(freedom, chi) < UNLIKELY:
        return float((chi / freedom) ** 0.5)
    return 1.0


class Critical(NamedTuple):
    """Permanent indentation by equation 3-7, with the critical indentation alpha_cr."""

    alpha_cr: FittedValue
    scatter: float  # as in `PermanentLine`


def critical(peaks: Floats, permanents: Floats, covariance: Floats) -> Critical:
    """Fit alpha_cr = (alpha_m - alpha_0)^(5/2)/alpha_m^(3/2), equal for all cycles.

    It takes the parameters of :func:`fit_permanent_line`. A cycle below alpha_cr has no permanent
    indentation and only bounds alpha_cr; such cycles are excluded if there are others.
    """
    values = (peaks - permanents) ** ACR_POWER / peaks**LOADING_POWER
    by_peak = values * (ACR_POWER / (peaks - permanents) - LOADING_POWER / peaks)
    by_permanent = -values * ACR_POWER / (peaks - permanents)
    across = np.concatenate([np.diag(by_peak), np.diag(by_permanent)], axis=1)
    variance = across @ covariance @ across.T
    deep = peaks > values + np.sqrt(np.diag(variance))
    if not deep.any():
        deep[:] = True
    weight = np.linalg.pinv(variance[np.ix_(deep, deep)], hermitian=True)
    total = float(weight.sum())
    mean = (
        float((weight @ values[deep]).sum()) / total if total > 0.0 else float(values[deep].mean())
    )
    residual = values[deep] - mean
    scatter = _scatter(float(residual @ weight @ residual), int(deep.sum()) - 1)
    error = scatter * total**-0.5 if total > 0.0 else 0.0
    return Critical(FittedValue(mean, error), scatter)
