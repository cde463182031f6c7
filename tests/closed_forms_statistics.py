"""Sensitivity indices, moments and intervals in closed form, for ``fecm verify``."""

from __future__ import annotations

import math

import numpy as np
from scipy.special import ndtri


def ishigami() -> list[float]:
    """First-order and total indices of sin x + 7 sin² y + 0.1 z⁴ sin x, uniform on ±pi.

    Ishigami and Homma 1990; the parts of the variance are integrals of powers and sines.
    """
    a, b = 7.0, 0.1
    x = (1.0 + b * math.pi**4 / 5.0) ** 2 / 2.0
    y, xz = a**2 / 8.0, b**2 * math.pi**8 * (1.0 / 18.0 - 1.0 / 50.0)
    return [part / (x + y + xz) for part in (x, y, 0.0, x + xz, y, xz)]


def lognormal(median: float, sigma: float) -> tuple[float, float, float]:
    """Mean, standard deviation and 95 % quantile."""
    mean = median * math.exp(sigma**2 / 2.0)
    quantile = median * math.exp(sigma * float(ndtri(0.95)))
    return mean, mean * math.sqrt(math.expm1(sigma**2)), quantile


def wilson(hits: int, count: int) -> list[float]:
    """Probabilities whose distance from the share is 1.96 of their own standard deviations."""
    share, z = hits / count, float(ndtri(0.975))
    roots = np.roots([1.0 + z**2 / count, -2.0 * share - z**2 / count, share**2])
    return sorted(roots.tolist())
