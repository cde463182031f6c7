"""Filters with a given rise time, which model a transducer.

The rise time is the time in which the response to a unit step rises from 0.1 to 0.9.  The filters
take the history as linear between samples at any spacing, and as constant before the first sample;
their response at the samples is exact.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fecm._typing import Floats
from fecm.studies import StudyError

FIRST_ORDER, MOVING_AVERAGE = "first-order", "moving-average"
KINDS = (FIRST_ORDER, MOVING_AVERAGE)
USAGE = "first-order:RISE or moving-average:RISE"


@dataclass(frozen=True)
class Filter:
    """A filter of unit static gain.

    ``"first-order"`` is T y' + y = x, whose rise time is T ln 9; ``"moving-average"`` is the mean
    of x over the last W, whose rise time is 0.8 W.
    """

    kind: str
    rise: float  # time from 10 to 90 % of the step response (10 us in Table 4.1)

    def __call__(self, time: Floats, values: Floats) -> Floats:
        """Filter values, (rows,) or (rows, columns), at increasing times."""
        columns = values.reshape(len(time), -1)
        apply = self._first_order if self.kind == FIRST_ORDER else self._moving_average
        filtered = np.column_stack([apply(time, column) for column in columns.T])
        return np.asarray(filtered.reshape(values.shape))

    def _first_order(self, time: Floats, x: Floats) -> Floats:
        time_constant = self.rise / math.log(9.0)
        r = np.maximum(np.diff(time) / time_constant, 1e-300)
        decay = np.exp(-r)
        mean = -np.expm1(-r) / r  # of exp(-t/T) over the interval
        driven = (mean - decay) * x[:-1] + (1.0 - mean) * x[1:]
        y = [float(x[0])]
        for part, push in zip(decay.tolist(), driven.tolist(), strict=True):
            y.append(part * y[-1] + push)
        return np.array(y)

    def _moving_average(self, time: Floats, x: Floats) -> Floats:
        window, dt = self.rise / 0.8, np.diff(time)
        slope = np.concatenate(([0.0], np.diff(x) / dt))  # towards each sample
        integral = np.concatenate(([0.0], np.cumsum((x[:-1] + x[1:]) / 2.0 * dt)))
        # The first sample inside the window, and its distance from the start of the window.
        first = np.searchsorted(time, time - window, side="right").clip(max=np.arange(len(x)))
        inside = time[first] - time + window
        part = inside * (x[first] - slope[first] * inside / 2.0)
        return np.asarray((integral - integral[first] + part) / window)


def filter_of(text: str) -> Filter:
    """Parse ``first-order:10e-6`` or ``moving-average:10e-6``; anything else is a StudyError."""
    kind, _, rise = text.partition(":")
    if kind not in KINDS:
        raise StudyError(f"unknown filter {text}; use {USAGE}")
    try:
        value = float(rise)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value > 0.0):
        raise StudyError(f"{text}: the rise time must be positive; use {USAGE}")
    return Filter(kind, value)
