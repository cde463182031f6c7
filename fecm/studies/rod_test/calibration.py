"""Sensitivity of the transducer from the acceleration of a target, report section 4.2.

The output of the transducer is V_F = c_F F, that of the accelerometer on a free target of mass m is
V_a = c_a a, and F = m a (equations 4-1 to 4-3).  The slope of V_F over V_a gives
c_F = (c_a / m) V_F / V_a (equation 4-4).
"""

from __future__ import annotations

import numpy as np

from fecm._dataclasses import frozen
from fecm._typing import Floats
from fecm.studies import StudyError


@frozen
class Calibration:
    """Straight line through V_F against V_a, and the sensitivity, with standard errors."""

    points: int
    slope: float  # V_F over V_a
    slope_error: float
    offset: float  # V_F at V_a = 0; 0 for a line through the origin
    offset_error: float
    r_squared: float  # of the variation of V_F, about zero for a line through the origin
    sensitivity: float  # c_F of the transducer, V_F per force
    sensitivity_error: float


def calibrate(
    v_f: Floats, v_a: Floats, mass: float, c_a: float, *, through_origin: bool = False
) -> Calibration:
    """Fit the sensitivity of a transducer by least squares, equations 4-1 to 4-4.

    The scatter is attributed to V_F.  Scatter of V_a flattens the line: the true slope is between
    the fitted slope and the fitted slope divided by R².

    The outputs, (points,), are of the same instants, `mass` is that of the target
    (force*time^2/length), `c_a` the sensitivity of the accelerometer (output per length/time^2).
    Raises StudyError if there are fewer than three points, V_a or V_F is constant, or a sum
    overflows.
    """
    if len(v_f) < 3:
        raise StudyError(f"at least 3 points are required; there are {len(v_f)}")
    for name, values in (("V_a", v_a), ("V_F", v_f)):
        if float(np.ptp(values)) == 0.0:
            raise StudyError(f"{name} is constant ({values[0]:g}): the slope is undefined")
    middle_a, middle_f = (0.0, 0.0) if through_origin else (v_a.mean(), v_f.mean())
    x, y = v_a - middle_a, v_f - middle_f
    with np.errstate(all="ignore"):
        xx, yy = float(x @ x), float(y @ y)
        slope = float(x @ y) / xx
        rest = y - slope * x
        variance = float(rest @ rest) / (len(x) - (1 if through_origin else 2))
        slope_error = float(np.sqrt(variance / xx))
        share = 0.0 if through_origin else 1.0 / len(x) + middle_a**2 / xx
        factor = c_a / mass
    found = Calibration(
        points=len(x),
        slope=slope,
        slope_error=slope_error,
        offset=float(middle_f - slope * middle_a),
        offset_error=float(np.sqrt(variance * share)),
        r_squared=1.0 - float(rest @ rest) / yy,
        sensitivity=factor * slope,
        sensitivity_error=abs(factor) * slope_error,
    )
    if not np.isfinite(list(vars(found).values())).all():
        raise StudyError("the sums overflow: check the numbers and their units")
    return found
