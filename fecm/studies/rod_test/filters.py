"""Time histories of results and of measured tables, and their filters.

First-order and moving-average filters model a transducer by its rise time: the time in which the
response to a unit step rises from 0.1 to 0.9. They take the history as linear between samples at
any spacing, and as constant before the first sample. Their response at the samples is exact.

Channel frequency classes (CFC) follow SAE J211-1: two poles forward and two backward, so that
nothing is delayed. Butterworth filters occur in amplifiers and test software. They are causal, or
run forward and backward (zero-phase), which delays nothing and attenuates twice. Both kinds need
equal time steps, and take the history as constant before the first and after the last sample.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from pathlib import Path

import numpy as np

from fecm._errors import StudyError, warn
from fecm._inputs import open_input
from fecm._measured_tables import UNITS, is_column_number, plain_unit, read_table
from fecm._typing import Floats
from fecm.deck.reader import HDF5
from fecm.results.result import Result, load
from fecm.results.schema import DATASETS

CLASSES = ("60", "180", "600", "1000")
ZERO_PHASE = "zero-phase"
USAGE = (
    "first-order:RISE, moving-average:RISE, butterworth:ORDER,FREQUENCY[,zero-phase] or cfc:CLASS "
    f"with the class {', '.join(CLASSES)}"
)
HIGHEST_ORDER = 10  # poles
# Numbers of SAE J211-1.
CUT_OFF = 2.0775  # cut-off frequency of the two poles over the class
SAMPLES = 10  # fewest samples in the time 1/class
FEWEST = 4.0  # samples in a period of the cut-off frequency of a Butterworth filter
IN_HERTZ = "frequencies and classes are in Hz, and times without a unit in s"
SETTLED = 4.0  # periods of the cut-off frequency, per pole, in which a step decays
UNEQUAL = 0.05  # relative difference up to which time steps are equal: times may be rounded


class FilterKind(StrEnum):
    """Kinds of filters."""

    FIRST_ORDER = "first-order"  # T y' + y = x, whose rise time is T ln 9
    MOVING_AVERAGE = "moving-average"  # the mean of x over the last W, whose rise time is 0.8 W
    BUTTERWORTH = "butterworth"  # attenuates sines of the cut-off frequency by 3 dB a pass
    CFC = "cfc"  # channel frequency class; attenuates sines of 5/3 of the class (Hz) by 3 dB


HERTZ = "Hz"
FILTERS = (  # forms of the text of a filter
    "first-order:RISE or moving-average:RISE, with the time RISE from 10 to 90 % of the "
    "step response, in the unit of the history's times or with a unit, as in 10us; "
    "butterworth:ORDER,FREQUENCY in Hz, with ,zero-phase if it filters forward and "
    "backward; or cfc:60, 180, 600 or 1000 of SAE J211."
)


@dataclass(frozen=True)
class Filter:
    """Filter with a static gain of 1."""

    kind: str  # a :class:`FilterKind` or its text
    # Rise time from 10 to 90 % of the step response (10 us in Table 4.1), class, or cut-off
    # frequency (1/time).
    size: float
    order: int = 0  # poles of a Butterworth filter
    is_zero_phase: bool = False
    unit: str = ""  # of the size; empty for a rise time in the unit of the history

    def in_unit(self, time: str) -> Filter:
        """Return the same filter for times in a unit; a class or a frequency is in Hz.

        Raises StudyError if the size of the filter has a unit, and the unit of time is unknown.
        """
        if not self.unit or (self.unit == HERTZ and not time):
            return self
        if plain_unit(time) not in UNITS["time"]:
            is_in = f"the unit of time is {time}" if time else "the times have no unit"
            raise StudyError(f"the filter is in {self.unit}, but {is_in}; s, ms, us are known")
        size = UNITS["time"][plain_unit(time)]
        if self.unit == HERTZ:
            return replace(self, size=self.size * size)
        return replace(self, size=self.size * UNITS["time"][self.unit] / size, unit="")

    def warn_without_effect(self, time: Floats, unit: str) -> None:
        """Warn if the rise time is below the time step of a history, (rows,), in the same unit."""
        step = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
        if self.unit != HERTZ and self.size < step:
            rise, dt = (f"{value:.3g} {unit}".rstrip() for value in (self.size, step))
            warn(
                f"the rise time {rise} of the filter is below the time step {dt}: the filter "
                "changes almost nothing; a rise time is in the unit of the times, or has a unit of "
                f"its own, as in {self.kind}:10us"
            )

    def __call__(self, time: Floats, values: Floats) -> Floats:
        """Filter values, (rows,) or (rows, columns), at increasing times."""
        columns = values.reshape(len(time), -1).T
        filtered = np.column_stack([self._filtered(time, column) for column in columns])
        return np.asarray(filtered.reshape(values.shape))

    def _filtered(self, time: Floats, x: Floats) -> Floats:
        match self.kind:
            case FilterKind.FIRST_ORDER:
                return self._first_order(time, x)
            case FilterKind.MOVING_AVERAGE:
                return self._moving_average(time, x)
            case FilterKind.BUTTERWORTH:
                return self._butterworth(time, x)
            case _:
                return self._cfc(time, x)

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
        window = self.size / 0.8
        dt = np.diff(time)
        slope = np.concatenate(([0.0], np.diff(x) / dt))  # towards each sample
        integral = np.concatenate(([0.0], np.cumsum((x[:-1] + x[1:]) / 2.0 * dt)))
        # The first sample inside the window, and its distance from the start of the window.
        first = np.searchsorted(time, time - window, side="right").clip(max=np.arange(len(x)))
        inside = time[first] - time + window
        part = inside * (x[first] - slope[first] * inside / 2.0)
        return np.asarray((integral - integral[first] + part) / window)

    def _butterworth(self, time: Floats, x: Floats) -> Floats:
        from scipy.signal import butter, sosfilt, sosfilt_zi  # takes 0.7 s

        dt = _equal_step(time, "butterworth")
        if FEWEST * self.size * dt > 1.0:
            raise StudyError(
                f"a butterworth filter needs {FEWEST:g} samples or more in a period of its "
                f"frequency, {1 / self.size:g}, and the time step is {dt:g}; {IN_HERTZ}"
            )
        sections = butter(self.order, 2.0 * self.size * dt, output="sos")
        rest = sosfilt_zi(sections)
        pad = math.ceil(SETTLED * self.order / (self.size * dt)) if self.is_zero_phase else 0
        y = np.pad(x, pad, "edge")
        for _ in range(1 + self.is_zero_phase):
            y = sosfilt(sections, y, zi=rest * y[0])[0]
            y = y[::-1] if self.is_zero_phase else y
        return np.asarray(y[pad : len(y) - pad])

    def _cfc(self, time: Floats, x: Floats) -> Floats:
        from scipy.signal import filtfilt  # takes 0.7 s, and few filters have a class

        dt = _equal_step(time, "cfc")
        if SAMPLES * self.size * dt > 1.0:
            raise StudyError(
                f"a cfc filter needs {SAMPLES} samples or more in the time 1/class, "
                f"{1 / self.size:g}, and the time step is {dt:g}: take a lower class; {IN_HERTZ}"
            )
        a = math.tan(math.pi * CUT_OFF * self.size * dt)
        d = 1.0 + math.sqrt(2.0) * a + a**2
        poles = [1.0, 2.0 * (a**2 - 1.0) / d, (1.0 - math.sqrt(2.0) * a + a**2) / d]
        pad = math.ceil(2.0 / (self.size * dt))  # until a step has decayed to 1e-8
        zeros = np.array([1.0, 2.0, 1.0]) * a**2 / d
        return np.asarray(filtfilt(zeros, poles, np.pad(x, pad, "edge"), padlen=0)[pad:-pad])


def _equal_step(time: Floats, kind: str) -> float:
    """Return the time step of a history.

    Raises StudyError if the steps differ.
    """
    dt = float(time[-1] - time[0]) / (len(time) - 1)
    if np.abs(np.diff(time) - dt).max() > UNEQUAL * dt:
        raise StudyError(f"a {kind} filter needs equal time steps; resample the history")
    return dt


_LETTERS = "".join({*"".join(UNITS["time"]), "µ", "μ"})  # of the units of time


def filter_of(text: str) -> Filter:
    """Parse ``first-order:10us``, ``butterworth:4,10e3`` or ``cfc:600``.

    A rise time has a unit, or is in the unit of the times. Classes and frequencies are in Hz.
    ``butterworth:4,10e3,zero-phase`` filters forward and backward. Raises StudyError if the text is
    anything else.
    """
    kind, _, rise = text.partition(":")
    if kind == FilterKind.CFC and rise in CLASSES:
        return Filter(kind, float(rise), unit=HERTZ)
    if kind == FilterKind.BUTTERWORTH:
        return _butterworth_of(text, rise)
    if kind not in (FilterKind.FIRST_ORDER, FilterKind.MOVING_AVERAGE):
        raise StudyError(f"unknown filter {text}; use {USAGE}")
    number = rise.rstrip(_LETTERS).rstrip()
    unit = plain_unit(rise[len(number) :].strip())
    try:
        value = float(number)
    except ValueError:
        value = math.nan
    if not 0.0 < value < math.inf or (unit and unit not in UNITS["time"]):
        raise StudyError(
            f"{text}: the rise time must be positive, in the unit of the times or in s, ms, us; "
            f"use {USAGE}"
        )
    return Filter(kind, value, unit=unit)


def _butterworth_of(text: str, numbers: str) -> Filter:
    order, frequency, phase, *_ = [*numbers.split(","), "", ""]
    is_zero_phase = phase.strip() == ZERO_PHASE
    try:
        poles, value = int(order), float(frequency)
    except ValueError:
        poles, value = 0, math.nan
    is_valid = 1 <= poles <= HIGHEST_ORDER and 0.0 < value < math.inf
    if not is_valid or numbers.count(",") != 1 + is_zero_phase:
        raise StudyError(
            f"{text}: a butterworth filter has 1 to {HIGHEST_ORDER} poles and a positive frequency "
            "in Hz, as in butterworth:4,10e3 or butterworth:4,10e3,zero-phase"
        )
    return Filter(FilterKind.BUTTERWORTH, value, poles, is_zero_phase, HERTZ)


TRANSDUCER = "transducer"


@dataclass(frozen=True, eq=False)
class TimeHistory:
    """History of a quantity."""

    name: str
    time: Floats  # (rows,)
    values: Floats  # (rows,)
    dimension: str  # empty if unknown
    first: int = 0  # first recorded row; the rows before it are the state of rest
    beside: Mapping[str, Floats] = field(default_factory=dict)  # other histories for the same plot
    units: Mapping[str, str] = field(default_factory=dict)  # names; empty if unknown


def recorded(path: Path, column: str | None = None) -> TimeHistory:
    """Read a history from a result file or a CSV file.

    The default column is the transducer, or the second column of a CSV file. Raises StudyError if
    the history does not exist or the CSV file is invalid, ResultFileError if the result file is
    damaged, and OSError if the file can't be read.
    """
    with open_input(path) as file:
        is_result = file.read(len(HDF5)) == HDF5
    return _of_result(path, load(path), column) if is_result else _of_table(path, column)


def _of_result(path: Path, result: Result, column: str | None) -> TimeHistory:
    columns = [name.partition("/")[2] for name in result if name.startswith("history/")]
    if not columns:
        raise StudyError(f"{path} has no history: the run has no impact step")
    names_available = [name for name in columns if name not in ("step", "time")]
    name = column or TRANSDUCER
    if name not in names_available:
        raise StudyError(f"{path} has no history of {name}; it has {', '.join(names_available)}")
    # Histories begin after the first step. Before it the rod is at rest.
    dataset = DATASETS.get(f"history/{name}")
    dimension = dataset.dimension if dataset else ""
    rest = [0.0] if dimension in ("force", "length") else []

    def from_rest(column: str) -> Floats:
        return np.concatenate([rest, result[f"history/{column}"]])

    beside = {"contact force": from_rest("force")} if name == TRANSDUCER else {}
    units = result.units
    return TimeHistory(
        name, from_rest("time"), from_rest(name), dimension, len(rest), beside, units
    )


def _of_table(path: Path, column: str | None) -> TimeHistory:
    table = read_table(path)
    heads = table.head[1]
    if heads and column and not (is_column_number(column) or table.has(column)):
        raise StudyError(f"{path} has no column {column}; it has {', '.join(table.names)}")
    if not (heads or column):
        columns = table.find(("time", "value"))
    else:
        clock = table.find(["time"])[0].place if heads and table.has("time") else 0
        value = column or (TRANSDUCER if table.has(TRANSDUCER) else "")
        place = table.find(["value"], [value])[0].place if value else int(clock == 0)
        if not value and len(heads) > 2:
            warn(f"{path}: the column {heads[place]} is filtered; --column takes another")
        columns = [table.column("time", clock), table.column("value", place)]
    time, values = table.values(columns, increasing="time")
    unit = columns[0].unit
    name = table.names[columns[1].place] if heads else "value"
    return TimeHistory(name, time, values, dimension="", units={"time": unit} if unit else {})
