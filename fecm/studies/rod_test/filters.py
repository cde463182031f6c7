"""Time histories of results and measured tables, their filters, and the transducer's calibration.

Filters with a given rise time model a transducer; others are channel frequency classes.

The rise time is the time in which the response to a unit step rises from 0.1 to 0.9.  The filters
take the history as linear between samples at any spacing, and as constant before the first sample;
their response at the samples is exact.

Channel frequency classes (CFC) are those of SAE J211-1: two poles forward and two backward, so
that nothing is delayed.  They need equal time steps, and take the history as constant before the
first and after the last sample.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import field, replace
from pathlib import Path

import numpy as np

from fecm._frozen import frozen
from fecm._inputs import open_input
from fecm._measured_tables import read_table, same_name
from fecm._typing import Floats
from fecm.deck.source_text import HDF5
from fecm.deck.units import KNOWN
from fecm.results.result import Result, load
from fecm.results.schema import DATASETS, declared_units
from fecm.studies import StudyError

FIRST_ORDER, MOVING_AVERAGE, CFC = "first-order", "moving-average", "cfc"
KINDS = (FIRST_ORDER, MOVING_AVERAGE)
CLASSES = ("60", "180", "600", "1000")
USAGE = f"first-order:RISE, moving-average:RISE or cfc:CLASS with the class {', '.join(CLASSES)}"
# Cut-off frequency of the two poles over the class, and fewest samples in 1/class (SAE J211-1).
CUT_OFF, SAMPLES = 2.0775, 10
UNEQUAL = 0.05  # relative difference of time steps that count as equal: of rounded times


@frozen
class Filter:
    """A filter of unit static gain.

    ``"first-order"`` is T y' + y = x, whose rise time is T ln 9; ``"moving-average"`` is the mean
    of x over the last W, whose rise time is 0.8 W.  ``"cfc"`` weakens sines by 3 dB at 5/3 of the
    class.
    """

    kind: str
    # Time from 10 to 90 % of the step response (10 us in Table 4.1); or the class, 1/time.
    size: float

    def in_unit(self, time: str) -> Filter:
        """The same filter for times in a unit; a class is in Hz.

        Raises StudyError if the filter has a class, and the unit is unknown.
        """
        if self.kind != CFC or not time:
            return self
        if time not in KNOWN["time"]:
            message = f"a class is in Hz, but the unit of time is {time}; s, ms, us are known"
            raise StudyError(message)
        return replace(self, size=self.size * KNOWN["time"][time])

    def __call__(self, time: Floats, values: Floats) -> Floats:
        """Filter values, (rows,) or (rows, columns), at increasing times."""
        kinds = {FIRST_ORDER: self._first_order, MOVING_AVERAGE: self._moving_average}
        apply, columns = kinds.get(self.kind, self._cfc), values.reshape(len(time), -1)
        filtered = np.column_stack([apply(time, column) for column in columns.T])
        return np.asarray(filtered.reshape(values.shape))

    def _first_order(self, time: Floats, x: Floats) -> Floats:
        time_constant = self.size / math.log(9.0)
        r = np.maximum(np.diff(time) / time_constant, 1e-300)
        decay = np.exp(-r)
        mean = -np.expm1(-r) / r  # of exp(-t/T) over the interval
        driven = (mean - decay) * x[:-1] + (1.0 - mean) * x[1:]
        y = [float(x[0])]
        for part, push in zip(decay.tolist(), driven.tolist(), strict=True):
            y.append(part * y[-1] + push)
        return np.array(y)

    def _moving_average(self, time: Floats, x: Floats) -> Floats:
        window, dt = self.size / 0.8, np.diff(time)
        slope = np.concatenate(([0.0], np.diff(x) / dt))  # towards each sample
        integral = np.concatenate(([0.0], np.cumsum((x[:-1] + x[1:]) / 2.0 * dt)))
        # The first sample inside the window, and its distance from the start of the window.
        first = np.searchsorted(time, time - window, side="right").clip(max=np.arange(len(x)))
        inside = time[first] - time + window
        part = inside * (x[first] - slope[first] * inside / 2.0)
        return np.asarray((integral - integral[first] + part) / window)

    def _cfc(self, time: Floats, x: Floats) -> Floats:
        from scipy.signal import filtfilt

        dt = float(time[-1] - time[0]) / (len(time) - 1)
        if np.abs(np.diff(time) - dt).max() > UNEQUAL * dt:
            raise StudyError("a cfc filter needs equal time steps; resample the history")
        if SAMPLES * self.size * dt > 1.0:
            raise StudyError(
                f"a cfc filter needs {SAMPLES} samples or more in the time 1/class, "
                f"{1 / self.size:g}, and the time step is {dt:g}: take a lower class"
            )
        a = math.tan(math.pi * CUT_OFF * self.size * dt)
        d = 1.0 + math.sqrt(2.0) * a + a**2
        poles = [1.0, 2.0 * (a**2 - 1.0) / d, (1.0 - math.sqrt(2.0) * a + a**2) / d]
        pad = math.ceil(2.0 / (self.size * dt))  # until a step has decayed to 1e-8
        zeros = np.array([1.0, 2.0, 1.0]) * a**2 / d
        return np.asarray(filtfilt(zeros, poles, np.pad(x, pad, "edge"), padlen=0)[pad:-pad])


def filter_of(text: str) -> Filter:
    """Parse ``first-order:10e-6``, ``moving-average:10e-6`` or ``cfc:600``, a class in Hz.

    Anything else is a StudyError.
    """
    kind, _, rise = text.partition(":")
    if kind == CFC and rise in CLASSES:
        return Filter(kind, float(rise))
    if kind not in KINDS:
        raise StudyError(f"unknown filter {text}; use {USAGE}")
    try:
        value = float(rise)
    except ValueError:
        value = math.nan
    if not 0.0 < value < math.inf:
        raise StudyError(f"{text}: the rise time must be positive; use {USAGE}")
    return Filter(kind, value)


# Histories ---------------------------------------------------------------------------------------

TRANSDUCER = "transducer"


@frozen
class TimeHistory:
    """A quantity in time."""

    name: str
    time: Floats  # (rows,)
    values: Floats  # (rows,)
    dimension: str  # empty if unknown
    first: int = 0  # first recorded row; the rows before it are the state of rest
    beside: Mapping[str, Floats] = field(default_factory=dict)  # others for the same plot
    units: Mapping[str, str] = field(default_factory=dict)  # names; empty if unknown


def recorded(path: Path, column: str | None = None) -> TimeHistory:
    """Read a history from a result file or a CSV file.

    The column is by default the transducer, or the second of a CSV file.  Raises StudyError if the
    history does not exist, or the CSV file is invalid, ResultFileError if the result file is
    damaged, OSError if the file cannot be read.
    """
    with open_input(path) as file:
        is_result = file.read(len(HDF5)) == HDF5
    return _of_result(path, load(path), column) if is_result else _of_table(path, column)


def _of_result(path: Path, result: Result, column: str | None) -> TimeHistory:
    known = [name.partition("/")[2] for name in result if name.startswith("history/")]
    if not known:
        raise StudyError(f"{path} has no history: the run has no impact step")
    choice = [name for name in known if name not in ("step", "time")]
    name = column or TRANSDUCER
    if name not in choice:
        raise StudyError(f"{path} has no history of {name}; it has {', '.join(choice)}")
    # Histories begin after the first step; before it, the rod is at rest.
    dataset = DATASETS.get(f"history/{name}")
    dimension = dataset.dimension if dataset else ""
    rest = [0.0] if dimension in ("force", "length") else []

    def begun(column: str) -> Floats:
        return np.concatenate([rest, result[f"history/{column}"]])

    beside = {"contact force": begun("force")} if name == TRANSDUCER else {}
    units = declared_units(result.attributes)
    return TimeHistory(name, begun("time"), begun(name), dimension, len(rest), beside, units)


def _of_table(path: Path, column: str | None) -> TimeHistory:
    table = read_table(path)
    names = table.names

    def found(name: str) -> str | None:
        return next((known for known in names if same_name(name, known)), None)

    if column is not None and found(column) is None:
        known = f"it has {', '.join(names)}" if names else "the first line has no names"
        raise StudyError(f"{path} has no column {column}; {known}")
    clock = found("time") or (names[0] if names else "time")
    others = [name for name in names if name != clock]
    name = found(column or TRANSDUCER) or (others[0] if others else "value")
    columns = table.columns((clock, name), increasing=clock)
    unit = next((u for n, u in zip(names, table.units, strict=True) if n == clock), "")
    units = {"time": unit} if unit else {}
    return TimeHistory(name, columns[clock], columns[name], dimension="", units=units)


# Sensitivity of the transducer from the acceleration of a target, report section 4.2 --------------

# The output of the transducer is V_F = c_F F, that of the accelerometer on a free target of mass m
# is V_a = c_a a, and F = m a (equations 4-1 to 4-3).  The slope of V_F over V_a gives
# c_F = (c_a / m) V_F / V_a (equation 4-4).


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
        len(x), slope, slope_error,
        offset=float(middle_f - slope * middle_a), offset_error=float(np.sqrt(variance * share)),
        r_squared=1.0 - float(rest @ rest) / yy,
        sensitivity=factor * slope, sensitivity_error=abs(factor) * slope_error,
    )  # fmt: skip
    if not np.isfinite(list(vars(found).values())).all():
        raise StudyError("the sums overflow: check the numbers and their units")
    return found
