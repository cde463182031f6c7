"""Force pulses on the end of a rod: the report's two, and tables.

A pulse is positive in compression and acts from t = 0 on.  Force and time are in any units.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from fecm._typing import Floats
from fecm.studies.tables import read_columns

FORMS = {"gauss": ("F0", "TAU", "B"), "sine": ("F0", "B")}
USAGE = "gauss:F0,TAU,B, sine:F0,B or a CSV file of time and force"


class Pulse(Protocol):
    """A force in time."""

    @property
    def duration(self) -> float:
        """Time that shows what it does, if none is asked for."""

    def force(self, time: Floats) -> Floats:
        """Force at times of any shape."""


@dataclass(frozen=True)
class GaussPulse:
    """The exponential pulse F0 exp(-(t - tau)^2 / 4 b^2), equation 4-5.

    At t = 0 it starts with a jump of F0 exp(-tau^2 / 4 b^2).

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
        """Time until it has fallen to a 500th."""
        return max(0.0, self.tau) + 10.0 * self.b

    def force(self, time: Floats) -> Floats:
        """Force at times of any shape."""
        return np.asarray(self.peak * np.exp(-(((time - self.tau) / (2.0 * self.b)) ** 2)))


@dataclass(frozen=True)
class SinePulse:
    """Half a wave of F0 sin(pi t / b), equation 4-6; zero after t = b.

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
        """Its own and half as long again, in which the rod rings on."""
        return 1.5 * self.b

    def force(self, time: Floats) -> Floats:
        """Force at times of any shape."""
        inside = (time >= 0.0) & (time < self.b)
        return np.where(inside, self.peak * np.sin(np.pi * time / self.b), 0.0)


@dataclass(frozen=True)
class TablePulse:
    """A table of forces, linear between its rows and zero before the first and after the last.

    Attributes
    ----------
    times, forces : ndarray (rows,)
        Times increase.
    """

    times: Floats
    forces: Floats

    @property
    def duration(self) -> float:
        """Its last time."""
        return float(self.times[-1])

    def force(self, time: Floats) -> Floats:
        """Force at times of any shape."""
        return np.asarray(np.interp(time, self.times, self.forces, left=0.0, right=0.0))


def pulse_of(text: str) -> Pulse:
    """Make the pulse that a user names.

    Parameters
    ----------
    text : str
        ``gauss:F0,TAU,B``, ``sine:F0,B``, or the path of a CSV file of time and force.

    Raises
    ------
    ValueError
        If it is none of these, a width is not positive, or the table can't be used.
    OSError
        If the file can't be read.
    """
    kind, colon, rest = text.partition(":")
    if not colon or kind not in FORMS:
        return _table(text)
    names = FORMS[kind]
    values = _numbers(rest)
    if len(values) != len(names):
        raise ValueError(f"{text}: {kind} takes {len(names)} numbers, {kind}:{','.join(names)}")
    if not values[-1] > 0.0:
        raise ValueError(f"{text}: the width B is not positive")
    return GaussPulse(*values) if kind == "gauss" else SinePulse(*values)


def _numbers(text: str) -> Sequence[float]:
    """Finite numbers with commas between them; none where one of them is no number."""
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        return []
    return values if all(map(math.isfinite, values)) else []


def _table(text: str) -> TablePulse:
    path = Path(text)
    if not path.is_file():
        raise ValueError(f"{text} is neither a file nor a pulse; a pulse is {USAGE}")
    columns = read_columns(path, ("time", "force"), increasing="time")
    if columns["time"][-1] <= 0.0:
        raise ValueError(f"{path}: the pulse is over before time 0, when it would begin to act")
    return TablePulse(columns["time"], columns["force"])
