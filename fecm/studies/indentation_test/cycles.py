"""Where an indentation test turns, and which of the law's curves each stretch lies on.

A stretch is a run of points between two turns.  A turn counts once the path has gone back from it
by more than a threshold that the path's own noise cannot cross.  Points so near to a turn that
noise hides on which side of it they lie belong to no stretch.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from fecm._errors import FecmError
from fecm._typing import Floats

Ints = NDArray[np.int64]

# A turn is a retreat by this part of the whole path's range, or by so many standard deviations.
LEAST_RETREAT = 0.02
SURE = 8.0
# Standard deviations of a smoothed point, within which a turn is not told from its neighbours.
GUARD = 2.0
# Noise below this part of a step does not reverse any.
NEGLIGIBLE = 0.1


class NoTestError(FecmError, ValueError):
    """The points are no indentation test."""


@dataclass(frozen=True)
class Path:
    """Indentations as they were measured, and what is known of their noise.

    Attributes
    ----------
    raw, smooth : ndarray (n,)
        As measured, and a moving mean (length).
    noise : float
        Standard deviation of a smoothed point (length); 0 where noise reverses no step.
    reach : int
        Points on either side that the moving mean takes in.
    """

    raw: Floats
    smooth: Floats
    noise: float
    reach: int

    @property
    def range(self) -> float:
        """Largest less smallest indentation (length)."""
        return float(np.ptp(self.smooth))


def smoothed(indentation: Floats) -> Path:
    """Estimate the noise of a path and smooth it as little as its turns need.

    Parameters
    ----------
    indentation : ndarray (n,)

    Notes
    -----
    Third differences of a path without noise are next to nothing; their median gives the noise.
    A moving mean over w points divides it by sqrt(w) and cuts off about w/4 steps of a turn; w is
    where both are alike.
    """
    n = len(indentation)
    if n < 5:
        return Path(indentation, indentation, 0.0, 0)
    noise = float(np.median(np.abs(np.diff(indentation, 3)))) / (0.6745 * math.sqrt(20.0))
    rough = _moving_mean(indentation, max(1, n // 200))
    step = float(np.abs(np.diff(rough)).sum()) / (n - 1)
    if noise <= NEGLIGIBLE * step:
        return Path(indentation, indentation, 0.0, 0)
    reach = max(1, round((4.0 * noise / step) ** (2.0 / 3.0) / 2.0))
    reach = min(reach, n // 50 + 1)
    return Path(
        indentation, _moving_mean(indentation, reach), noise / math.sqrt(2 * reach + 1), reach
    )


def _moving_mean(values: Floats, reach: int) -> Floats:
    """Mean of each point and of `reach` neighbours on either side, as far as there are some."""
    sums = np.concatenate([[0.0], np.cumsum(values)])
    here = np.arange(len(values))
    first, last = np.maximum(here - reach, 0), np.minimum(here + reach + 1, len(values))
    means: Floats = (sums[last] - sums[first]) / (last - first)
    return means


def turns(path: Path, retreat: float) -> list[int]:
    """Points at which the direction changes, the first and the last point included.

    Parameters
    ----------
    path : Path
    retreat : float
        How far the path goes back before a turn counts (length).
    """
    s = path.smooth
    found, high, low, direction = [0], 0, 0, 0
    for i in range(1, len(s)):
        if s[i] > s[high]:
            high = i
        if s[i] < s[low]:
            low = i
        if direction >= 0 and s[high] - s[i] > retreat:
            if direction:
                found.append(high)
            direction, low = -1, i
        elif direction <= 0 and s[i] - s[low] > retreat:
            if direction:
                found.append(low)
            direction, high = 1, i
    if found[-1] != len(s) - 1:
        found.append(len(s) - 1)
    return found


LOADING, FALLING, RISING = "loading", "unloading", "reloading"


@dataclass(frozen=True)
class Stretch:
    """Points on one curve.

    Attributes
    ----------
    kind : str
        LOADING, FALLING or RISING.
    cycle : int
        From 0: the peak that was left last; of LOADING the peak to come.
    rows : ndarray of int
        The points.
    begin : int
        Of FALLING, the number of the corner at which it begins: its cycle's peak, or a turn on the
        way back to the peak.
    turn : float
        Of RISING, the recorded indentation at which it begins (length).
    """

    kind: str
    cycle: int
    rows: Ints
    begin: int = -1
    turn: float = 0.0


@dataclass(frozen=True)
class Corner:
    """An upper turn.

    Attributes
    ----------
    indentation : float
        As recorded (length): the largest value near the turn, of the smoothed path.
    cycle : int
        Its cycle.
    is_peak : bool
        Whether it lies on the first loading curve.
    rise : int
        Of others the number of the RISING stretch that ends there.
    """

    indentation: float
    cycle: int
    is_peak: bool
    rise: int = -1


@dataclass(frozen=True)
class Division:
    """A test cut into stretches.

    Attributes
    ----------
    path : Path
    retreat : float
        What counted as a turn (length).
    stretches : tuple of Stretch
    corners : tuple of Corner
    """

    path: Path
    retreat: float
    stretches: tuple[Stretch, ...]
    corners: tuple[Corner, ...]

    @property
    def peaks(self) -> list[int]:
        """Corners that are peaks, one a cycle."""
        return [n for n, corner in enumerate(self.corners) if corner.is_peak]

    def rows(self, kind: str) -> Ints:
        """Points of all stretches of a kind."""
        parts = [s.rows for s in self.stretches if s.kind == kind]
        return np.concatenate([np.empty(0, dtype=np.int64), *parts])


def divide(indentation: Floats, retreat: float | None = None) -> Division:
    """Cut a test into stretches on the law's curves.

    Parameters
    ----------
    indentation : ndarray (n,)
        In the order of measurement, from the first contact on.
    retreat : float, optional
        How far the path goes back before a turn counts (length); by default 2 % of its range, or
        eight standard deviations of its noise where these are more.

    Raises
    ------
    NoTestError
        If the test does not begin by loading.
    """
    path = smoothed(indentation)
    if path.range <= 0.0:
        raise NoTestError("the indentation never changes")
    if retreat is None:
        retreat = max(LEAST_RETREAT * path.range, SURE * path.noise)
    if retreat >= path.range:
        raise NoTestError(f"the whole path is not longer than a turn ({retreat:g})")
    found = turns(path, retreat)
    s = path.smooth
    if s[found[1]] <= s[0]:
        raise NoTestError("the test begins by unloading; its first points are the first loading")
    return _Divider(path, retreat).divide(found)


class _Divider:
    """Follows a test from turn to turn."""

    def __init__(self, path: Path, retreat: float) -> None:
        self.path = path
        self.retreat = retreat
        # Two peaks as near as this are one.
        self.near = max(retreat / 2.0, 4.0 * path.noise)
        self.stretches: list[Stretch] = []
        self.corners: list[Corner] = []
        self.cycle = self.begin = -1
        self.peak = -math.inf

    def divide(self, found: list[int]) -> Division:
        """Stretches between the turns."""
        last = len(found) - 2
        for n, (first, end) in enumerate(pairwise(found)):
            rows = self._between(first, end, n < last)
            if self.path.smooth[end] > self.path.smooth[first]:
                self._rise(rows, first, end, ends_in_turn=n < last)
            else:
                self.stretches.append(Stretch(FALLING, self.cycle, rows, self.begin))
        return Division(self.path, self.retreat, tuple(self.stretches), tuple(self.corners))

    def _between(self, first: int, end: int, turns: bool) -> Ints:
        """Points between two turns, without the turns themselves and what is too near to them.

        The point at a turn may have been read before or after it.
        """
        begin = first + 1 if first else 0
        rows: Ints = np.arange(begin, end if turns else end + 1, dtype=np.int64)
        if not self.path.noise:
            return rows
        s, guard = self.path.smooth, GUARD * self.path.noise
        keep = np.abs(s[rows] - s[first]) > guard if first else np.full(len(rows), True)
        if turns:
            keep &= (np.abs(s[rows] - s[end]) > guard) & (rows < end - self.path.reach)
        if first:
            keep &= rows > first + self.path.reach
        return np.asarray(rows[keep])

    def _rise(self, rows: Ints, first: int, end: int, *, ends_in_turn: bool) -> None:
        """A rise, which goes on along the first loading curve where it passes the peak."""
        s = self.path.smooth
        top = float(s[end])
        if self.cycle >= 0:
            below = rows[s[rows] <= self.peak]
            self.stretches.append(Stretch(RISING, self.cycle, below, turn=float(s[first])))
        rise = len(self.stretches) - 1
        beyond = rows[s[rows] > self.peak]
        if top > self.peak + self.near:
            self.stretches.append(Stretch(LOADING, self.cycle + 1, beyond))
            if ends_in_turn:
                self.cycle += 1
                self.peak = top
                self._corner(Corner(top, self.cycle, True))
        elif ends_in_turn and top < self.peak - self.near:
            self._corner(Corner(top, self.cycle, False, rise))
        elif ends_in_turn:
            peaks = [n for n, corner in enumerate(self.corners) if corner.is_peak]
            self.begin = peaks[-1]

    def _corner(self, corner: Corner) -> None:
        self.begin = len(self.corners)
        self.corners.append(corner)
