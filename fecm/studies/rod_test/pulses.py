"""Force pulses on the end of a rod: the two of the report, and tables.

A pulse is positive in compression and acts from t = 0.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from fecm._typing import Floats
from fecm.studies import StudyError
from fecm.studies.tables import read_columns

FORMS = {"gauss": ("F0", "TAU", "B"), "sine": ("F0", "B")}
USAGE = "gauss:F0,TAU,B, sine:F0,B or a CSV file of time and force"


class Pulse(Protocol):
    """A force as a function of time."""

    @property
    def duration(self) -> float:
        """Default duration of a test."""

    def force(self, time: Floats) -> Floats:
        """Force at times of any shape."""


@dataclass(frozen=True)
class GaussPulse:
    """Exponential pulse F0 exp(-(t - tau)^2 / 4 b^2), equation 4-5.

    It starts at t = 0 with a jump of F0 exp(-tau^2 / 4 b^2).

    Attributes
    ----------
    peak : float
        F0, force.
    tau : float
        Time of the peak.
    b : float
        Width, time.
    """

    peak: float
    tau: float
    b: float

    @property
    def duration(self) -> float:
        """Time until the force has fallen to 1/500 of its peak."""
        return max(0.0, self.tau) + 10.0 * self.b

    def force(self, time: Floats) -> Floats:
        """Force at times of any shape."""
        return np.asarray(self.peak * np.exp(-(((time - self.tau) / (2.0 * self.b)) ** 2)))


@dataclass(frozen=True)
class SinePulse:
    """Half wave F0 sin(pi t / b), equation 4-6; zero after t = b.

    Attributes
    ----------
    peak : float
        F0, force.
    b : float
        Duration, time.
    """

    peak: float
    b: float

    @property
    def duration(self) -> float:
        """Duration of the pulse, and half of it again for the ringing of the rod."""
        return 1.5 * self.b

    def force(self, time: Floats) -> Floats:
        """Force at times of any shape."""
        inside = (time >= 0.0) & (time < self.b)
        return np.where(inside, self.peak * np.sin(np.pi * time / self.b), 0.0)


@dataclass(frozen=True)
class TablePulse:
    """Table of forces, linear between rows, and zero before the first and after the last.

    Attributes
    ----------
    times, forces : ndarray (rows,)
        Times increase.
    """

    times: Floats
    forces: Floats

    @property
    def duration(self) -> float:
        """Last time of the table."""
        return float(self.times[-1])

    def force(self, time: Floats) -> Floats:
        """Force at times of any shape."""
        return np.asarray(np.interp(time, self.times, self.forces, left=0.0, right=0.0))


def pulse_of(text: str) -> Pulse:
    """Parse a pulse.

    Parameters
    ----------
    text : str
        ``gauss:F0,TAU,B``, ``sine:F0,B``, or the path of a CSV file of time and force.

    Raises
    ------
    StudyError
        If the text has none of these forms, a width is not positive, or the table is invalid.
    OSError
        If the file cannot be read.
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
    return GaussPulse(*values) if kind == "gauss" else SinePulse(*values)


def _numbers(text: str) -> Sequence[float]:
    """Parse finite numbers separated by commas; empty if one is invalid."""
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        return []
    return values if all(map(math.isfinite, values)) else []


def _table(text: str) -> TablePulse:
    path = Path(text)
    if not path.is_file():
        raise StudyError(f"{text} is neither a file nor a pulse; use {USAGE}")
    columns = read_columns(path, ("time", "force"), increasing="time")
    if columns["time"][-1] <= 0.0:
        raise StudyError(f"{path}: the pulse ends before time 0")
    return TablePulse(columns["time"], columns["force"])
