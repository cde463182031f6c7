"""Force pulses on the end of a rod: the two of the report, and tables.

A pulse is positive in compression and acts from t = 0.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from fecm._frozen import frozen
from fecm._typing import Floats
from fecm.studies import StudyError
from fecm.studies.tables import read_table

FORMS = {"gauss": ("F0", "TAU", "B"), "sine": ("F0", "B")}
USAGE = "gauss:F0,TAU,B, sine:F0,B or a CSV file of time and force"


@frozen
class Pulse:
    """A force as a function of times of any shape, and the default duration of a test."""

    force: Callable[[Floats], Floats]
    duration: float


def gauss_pulse(peak: float, tau: float, b: float) -> Pulse:
    """Exponential pulse F0 exp(-(t - tau)^2 / 4 b^2), equation 4-5.

    It starts at t = 0 with a jump of F0 exp(-tau^2 / 4 b^2), and has fallen to 1/500 of its peak at
    the end of the test.
    """

    def force(time: Floats) -> Floats:
        return np.asarray(peak * np.exp(-(((time - tau) / (2.0 * b)) ** 2)))

    return Pulse(force, max(0.0, tau) + 10.0 * b)


def sine_pulse(peak: float, b: float) -> Pulse:
    """Half wave F0 sin(pi t / b), equation 4-6; the rod rings for b/2 after it."""

    def force(time: Floats) -> Floats:
        return np.where((time >= 0.0) & (time < b), peak * np.sin(np.pi * time / b), 0.0)

    return Pulse(force, 1.5 * b)


def table_pulse(times: Floats, forces: Floats) -> Pulse:
    """Table of forces, linear between rows, and zero before the first and after the last."""

    def force(time: Floats) -> Floats:
        return np.asarray(np.interp(time, times, forces, left=0.0, right=0.0))

    return Pulse(force, float(times[-1]))


def pulse_of(text: str) -> Pulse:
    """Parse ``gauss:F0,TAU,B``, ``sine:F0,B``, or the path of a CSV file of time and force.

    Anything else, a width that is not positive, and an invalid table are a StudyError.
    """
    kind, colon, rest = text.partition(":")
    if not colon or kind not in FORMS:
        return _table(text)
    names = FORMS[kind]
    values = _numbers(rest)
    if len(values) != len(names):
        raise StudyError(f"{text}: {kind} takes {len(names)} numbers, {kind}:{','.join(names)}")
    if not values[-1] > 0.0:
        raise StudyError(f"{text}: the width B must be positive")
    return gauss_pulse(*values) if kind == "gauss" else sine_pulse(*values)


def _numbers(text: str) -> Sequence[float]:
    """Parse finite numbers separated by commas; empty if one is invalid."""
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        return []
    return values if all(map(math.isfinite, values)) else []


def _table(text: str) -> Pulse:
    path = Path(text)
    if not path.is_file():
        raise StudyError(f"{text} is neither a file nor a pulse; use {USAGE}")
    columns = read_table(path).columns(("time", "force"), increasing="time")
    if columns["time"][-1] <= 0.0:
        raise StudyError(f"{path}: the pulse ends before time 0")
    return table_pulse(columns["time"], columns["force"])
