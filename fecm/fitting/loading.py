"""The first loading curve with a power of its own, which the report compares with 3/2."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fecm.fitting.curves import Curves
from fecm.fitting.cycles import LOADING
from fecm.fitting.estimates import Estimate, r_squared
from fecm.indentation import LOADING_POWER


@dataclass(frozen=True)
class FreePower:
    """The first loading with its own power, F = k a^n (equation 3-1).

    Attributes
    ----------
    n : Estimate
    k : Estimate
        Force/length^n.
    r_squared : float or None
    """

    n: Estimate
    k: Estimate
    r_squared: float | None


def free_power(curves: Curves) -> FreePower:
    """Fit the first loading with a power of its own.

    The coefficient at the largest indentation and the power hardly depend on each other; the
    coefficient at unit indentation, far from every point, inherits the power's error.
    """
    from scipy.optimize import least_squares

    rows = curves.division.rows(LOADING)
    everywhere = np.maximum(curves.a[rows], 0.0), curves.f[rows]
    a, f = (values[everywhere[0] > 0.0] for values in everywhere)
    log = np.log(a)
    found = least_squares(
        lambda p: f - p[0] * a ** p[1], [1.0, LOADING_POWER], xtol=1e-12, ftol=1e-12
    )
    c, n = found.x
    fitted = c * a**n
    jacobian = np.stack([a**n, fitted * log], axis=1)
    inverse = np.linalg.pinv(jacobian)
    leverage = np.clip(np.einsum("ij,ji->i", jacobian, inverse), 0.0, 0.999)
    influence = inverse * ((f - fitted) / np.sqrt(1.0 - leverage))
    covariance = influence @ influence.T
    k = c * curves.force / curves.length**n
    by = np.array([k / c, -k * np.log(curves.length)])
    return FreePower(
        Estimate(float(n), float(covariance[1, 1] ** 0.5)),
        Estimate(float(k), float((by @ covariance @ by) ** 0.5)),
        r_squared(c * everywhere[0] ** n, everywhere[1]),
    )
