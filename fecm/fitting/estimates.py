"""Values with their standard errors, and how much they explain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Estimate:
    """A value and its standard error; an error of 0 where the value was given."""

    value: float
    error: float


def r_squared(fitted: Floats, measured: Floats) -> float | None:
    """1 less the residuals' share of the variance; None where nothing varies."""
    if len(measured) < 2 or not np.ptp(measured):
        return None
    total = float(((measured - measured.mean()) ** 2).sum())
    return 1.0 - float(((measured - fitted) ** 2).sum()) / total
