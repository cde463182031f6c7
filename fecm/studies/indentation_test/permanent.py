"""Relation of permanent to largest indentation, equations 3-8 and 3-7.

Both coordinates of a cycle have errors, which are correlated with each other and with those of
other cycles; the fit is by generalised least squares with the complete covariance.
"""

from __future__ import annotations

import numpy as np

from fecm._dataclasses import frozen
from fecm._typing import Floats, Indices
from fecm.mechanics.contact_law import ACR_POWER, LOADING_POWER
from fecm.studies.indentation_test.curves import Estimate

ROUNDS = 20  # iterations of the weights, which depend on the slope
UNLIKELY = 0.01  # probability below which the scatter exceeds the noise of the points


@frozen
class Line:
    """Permanent indentation by equation 3-8, alpha_0 = s_p (alpha_m - alpha_p)."""

    s_p: Estimate
    alpha_p: Estimate
    elastic: tuple[int, ...]  # cycles below alpha_p, without permanent indentation
    scatter: float  # of :func:`_scatter`; it multiplies the errors


def line(peaks: Floats, permanents: Floats, covariance: Floats) -> Line | None:
    """Fit alpha_0 = max(0, s_p (alpha_m - alpha_p)); None if fewer than two cycles exceed alpha_p.

    The covariance, regular, is that of all peaks alpha_m, then all permanent indentations alpha_0.
    """
    order = np.argsort(peaks)
    fits: list[tuple[float, Line]] = []
    for count in range(len(peaks) - 1):
        found = _split(peaks, permanents, covariance, order[:count])
        if found is None:
            continue
        start = found[1].alpha_p.value
        if not count or peaks[order[count - 1]] <= start < peaks[order[count]]:
            fits.append(found)
    return min(fits, key=lambda one: one[0])[1] if fits else None


def _split(
    peaks: Floats, permanents: Floats, covariance: Floats, elastic: Indices
) -> tuple[float, Line] | None:
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
    left = permanents - design @ [slope, level]
    chi = float(left @ weight @ left)
    scatter = _scatter(chi, n - 2)
    by = np.array([level / slope**2, -1.0 / slope])
    s_p = Estimate(float(slope), scatter * float(errors[0, 0] ** 0.5))
    alpha_p = Estimate(float(-level / slope), scatter * float((by @ errors @ by) ** 0.5))
    return chi, Line(s_p, alpha_p, tuple(elastic.tolist()), scatter)


def _scatter(chi: float, freedom: int) -> float:
    """Return the root of chi² per degree of freedom if it exceeds the noise, else 1."""
    from scipy.special import chdtrc  # takes 0.15 s, and most commands do not fit

    if freedom > 0 and chdtrc(freedom, chi) < UNLIKELY:
        return float((chi / freedom) ** 0.5)
    return 1.0


@frozen
class Critical:
    """Permanent indentation by equation 3-7, with the critical indentation alpha_cr."""

    alpha_cr: Estimate
    scatter: float  # as that of a line


def critical(peaks: Floats, permanents: Floats, covariance: Floats) -> Critical:
    """Fit alpha_cr = (alpha_m - alpha_0)^(5/2)/alpha_m^(3/2), equal for all cycles.

    Parameters are those of :func:`line`.  A cycle below alpha_cr has no permanent indentation and
    only bounds alpha_cr: such cycles are excluded if there are others.
    """
    own = (peaks - permanents) ** ACR_POWER / peaks**LOADING_POWER
    by_peak = own * (ACR_POWER / (peaks - permanents) - LOADING_POWER / peaks)
    by_permanent = -own * ACR_POWER / (peaks - permanents)
    across = np.concatenate([np.diag(by_peak), np.diag(by_permanent)], axis=1)
    variance = across @ covariance @ across.T
    deep = peaks > own + np.sqrt(np.diag(variance))
    if not deep.any():
        deep[:] = True
    weight = np.linalg.pinv(variance[np.ix_(deep, deep)], hermitian=True)
    total = float(weight.sum())
    mean = float((weight @ own[deep]).sum()) / total if total > 0.0 else float(own[deep].mean())
    left = own[deep] - mean
    scatter = _scatter(float(left @ weight @ left), int(deep.sum()) - 1)
    error = scatter * total**-0.5 if total > 0.0 else 0.0
    return Critical(Estimate(mean, error), scatter)
