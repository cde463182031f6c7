"""Parameters of the contact law from an indentation test."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from fecm._dataclasses import frozen
from fecm._typing import Floats
from fecm.mechanics.contact_law import (
    ACR_POWER,
    LOADING_POWER,
    ContactParameters,
    LinearPermanent,
    YangSunPermanent,
)
from fecm.studies import StudyError
from fecm.studies.indentation_test.curves import (
    Curves,
    Estimate,
    Solution,
    influence,
    r_squared,
    scaled,
    solve,
)
from fecm.studies.indentation_test.permanent import Critical, Line, critical, line
from fecm.studies.indentation_test.turns import Kind, divide

LARGEST = 1e60  # largest number whose powers are finite
# Smallest error of a coordinate relative to the largest indentation, for tests without noise.
ROUNDING = 1e-9


@frozen
class FreePower:
    """First loading with a free power, F = k a^n (equation 3-1)."""

    n: Estimate
    k: Estimate  # force/length^n
    r_squared: float | None


def free_power(curves: Curves) -> FreePower:
    """Fit the first loading with a free power.

    The coefficient at the largest indentation is almost independent of the power; the coefficient
    at unit indentation, far from every point, inherits the error of the power.
    """
    from scipy.optimize import least_squares  # takes 0.3 s, and most commands do not fit

    rows = curves.division.rows(Kind.LOADING)
    everywhere = np.maximum(curves.a[rows], 0.0), curves.f[rows]
    a, f = (values[everywhere[0] > 0.0] for values in everywhere)
    start = [1.0, LOADING_POWER]
    c, n = least_squares(lambda p: f - p[0] * a ** p[1], start, xtol=1e-12, ftol=1e-12).x
    fitted = c * a**n
    _, of_points = influence(np.stack([a**n, fitted * np.log(a)], axis=1), f - fitted)
    covariance = of_points @ of_points.T
    k = c * curves.force / curves.length**n
    by = np.array([k / c, -k * np.log(curves.length)])
    return FreePower(
        Estimate(float(n), float(covariance[1, 1] ** 0.5)),
        Estimate(float(k), float((by @ covariance @ by) ** 0.5)),
        r_squared(c * everywhere[0] ** n, everywhere[1]),
    )


@frozen
class Cycle:
    """Unloading and reloading from a point of the first loading curve."""

    alpha_m: Estimate  # largest indentation (length); its error is 0 if it is the recorded value
    alpha_m_recorded: float  # smoothed if noisy
    alpha_0: Estimate  # permanent indentation (length)
    k_1: Estimate  # reloading rigidity, equation 3-12, force/length^1.5
    # Like `k_1`, from the origin of the first reloading curve; None without reloading, and if the
    # reloading began without contact, where both are equal.
    k_1_measured: Estimate | None


@frozen
class Fit:
    """Result of a fit."""

    k: Estimate  # contact coefficient with n = 3/2, force/length^1.5
    free: FreePower
    q: Estimate | None  # unloading power; None if the test has no unloading
    cycles: tuple[Cycle, ...]
    line: Line | None  # None if fewer than two cycles leave an indentation
    critical: Critical | None  # if the law of equation 3-7 was requested
    r_squared: dict[str, float | None]  # of loading, unloading, reloading and permanent
    scatter: float  # root mean square of the residuals, relative to the largest force
    solution: Solution

    def relation(self) -> ContactParameters | None:
        """Return the contact law with admissible values; None if alpha_0(alpha_m) is unknown."""
        k = self.k.value
        if self.critical is not None:
            return YangSunPermanent(k, self.critical.alpha_cr.value)
        if self.line is None or self.q is None:
            return None
        s_p = self.line.s_p.value
        if not 0.0 < s_p < 1.0:
            return LinearPermanent(k, 0.0, 0.0, self.q.value)
        return LinearPermanent(k, max(self.line.alpha_p.value, 0.0), s_p, self.q.value)


def fit(
    indentation: ArrayLike,
    force: ArrayLike,
    *,
    retreat: float | None = None,
    q: float | None = None,
    acr: bool = False,
) -> Fit:
    """Fit the contact law to a test.

    Indentation and force, (n,), are in the order of measurement from first contact at zero, and
    positive in compression.  A decrease of the indentation by `retreat` (automatic if None) counts
    as a turn.  The unloading power `q` is fitted if None.  With `acr` alpha_cr of equation 3-7 is
    fitted with q = 5/2 instead of s_p and alpha_p of equation 3-8.  Raises StudyError if the points
    are not an indentation test.
    """
    a, f = np.asarray(indentation, dtype=float), np.asarray(force, dtype=float)
    if a.shape != f.shape or a.ndim != 1:
        raise StudyError("indentation and force differ in length")
    if len(a) < 10:
        raise StudyError(f"{len(a)} points are too few for a test")
    for name, values in (("indentations", a), ("forces", f)):
        if not 1.0 / LARGEST < float(np.abs(values).max()) < LARGEST:
            raise StudyError(f"the {name} are not between {1.0 / LARGEST:g} and {LARGEST:g}")
    curves = scaled(divide(a, retreat), a, f)
    solution = solve(curves, ACR_POWER if acr else q)
    at, division, p = solution.curves.layout, curves.division, solution.values
    peaks = [at.corners[n] for n in division.peaks]
    places = peaks + at.permanents
    covariance = solution.covariance[np.ix_(places, places)]
    if places:
        covariance = covariance + np.eye(len(places)) * (ROUNDING * p[peaks].max()) ** 2
    found = p[peaks], p[at.permanents], covariance
    cycles = tuple(_cycle(solution, n) for n in range(len(peaks)))
    straight = line(*found) if not acr and len(cycles) > 1 else None
    of_curves = {kind.value: r_squared(*solution.curves.of(solution.scaled, kind)) for kind in Kind}
    fitted, measured = solution.curves.of(solution.scaled, *Kind)
    return Fit(
        k=_parameter(solution, at.K),
        free=free_power(curves),
        q=_parameter(solution, at.Q) if cycles else None,
        cycles=cycles,
        line=straight,
        critical=critical(*found) if acr and cycles else None,
        r_squared={**of_curves, "permanent": _explained(straight, *found[:2])},
        scatter=float(np.sqrt(np.mean((fitted - measured) ** 2))),
        solution=solution,
    )


def _explained(straight: Line | None, peaks: Floats, permanents: Floats) -> float | None:
    """Return R² of equation 3-8; None for fewer than three cycles."""
    if straight is None or len(peaks) < 3:
        return None
    fitted = np.maximum(straight.s_p.value * (peaks - straight.alpha_p.value), 0.0)
    return r_squared(fitted, permanents)


def _parameter(solution: Solution, place: int) -> Estimate:
    error = max(float(solution.covariance[place, place]), 0.0) ** 0.5
    return Estimate(float(solution.values[place]), error)


def _cycle(solution: Solution, number: int) -> Cycle:
    """Return the values of a cycle and the rigidities derived from them."""
    at, division = solution.curves.layout, solution.curves.division
    corner = division.peaks[number]
    peak, permanent = at.corners[corner], at.permanents[number]

    def rigidity(origin: int) -> Estimate:
        def k_1(p: Floats) -> float:
            return float(p[at.K] * (p[peak] / (p[peak] - p[origin])) ** LOADING_POWER)

        return solution.estimate(k_1)

    own = [place for n, place in at.origins.items() if division.stretches[n].cycle == number]
    measured = rigidity(own[0]) if own else None
    recorded = division.corners[corner].indentation
    alpha_m, alpha_0 = _parameter(solution, peak), _parameter(solution, permanent)
    return Cycle(alpha_m, recorded, alpha_0, rigidity(permanent), measured)
