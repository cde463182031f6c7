"""Measured indentation tests, and their turning points.

A stretch is a run of points between two turns.  A turn is a point from which the path retreats by
more than a threshold above its noise.  Points within the noise of a turn belong to no stretch.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from enum import StrEnum
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fecm._errors import StudyError
from fecm._measured_tables import IN_MEMORY, Record, read_table
from fecm._typing import Floats

Rows = NDArray[np.int64]  # numbers of points

# Smallest retreat that is a turn: share of the range of the path, standard deviations of the noise.
LEAST_RETREAT = 0.02
QUIET = 8.0
GUARD = 2.0  # standard deviations of a smoothed point within which its neighbours may be the turn
NEGLIGIBLE = 0.1  # noise, over a step of the path, below which it reverses no step


class SmoothedIndentation(NamedTuple):
    """Moving mean of measured indentations, and their noise."""

    smooth: Floats  # (n,), length
    noise: float  # standard deviation of a smoothed point; 0 if noise reverses no step
    reach: int  # points of the moving mean on either side

    @property
    def range(self) -> float:
        """Largest minus smallest indentation (length)."""
        return float(np.ptp(self.smooth))


def smoothed(indentation: Floats) -> SmoothedIndentation:
    """Estimate the noise of a path, and smooth it only as much as needed to find its turns."""
    # Third differences of a path without noise are almost zero; their median gives the noise.  A
    # moving mean over w points divides the noise by sqrt(w) and cuts off about w/4 steps at a turn;
    # w balances both.
    n = len(indentation)
    if n < 5:
        return SmoothedIndentation(indentation, 0.0, 0)
    noise = float(np.median(np.abs(np.diff(indentation, 3)))) / (0.6745 * math.sqrt(20.0))
    rough = _moving_mean(indentation, max(1, n // 200))
    step = float(np.abs(np.diff(rough)).sum()) / (n - 1)
    if noise <= NEGLIGIBLE * step:
        return SmoothedIndentation(indentation, 0.0, 0)
    reach = min(max(1, round((4.0 * noise / step) ** (2.0 / 3.0) / 2.0)), n // 50 + 1)
    return SmoothedIndentation(
        _moving_mean(indentation, reach), noise / math.sqrt(2 * reach + 1), reach
    )


def _moving_mean(values: Floats, reach: int) -> Floats:
    """Return the mean of each point and up to `reach` neighbours on either side."""
    sums = np.concatenate([[0.0], np.cumsum(values)])
    n = np.arange(len(values))
    first, last = np.maximum(n - reach, 0), np.minimum(n + reach + 1, len(values))
    return np.asarray((sums[last] - sums[first]) / (last - first))


def turns(path: SmoothedIndentation, retreat: float) -> list[int]:
    """Return the first and last point, and those from which the path retreats by `retreat`."""
    s = path.smooth
    numbers = [0]
    high = low = 0  # points of the largest and smallest indentation since the last turn
    direction = 0  # 1 while the indentation rises, -1 while it falls, 0 until either is sure
    for i in range(1, len(s)):
        if s[i] > s[high]:
            high = i
        if s[i] < s[low]:
            low = i
        if direction >= 0 and s[high] - s[i] > retreat:
            if direction:
                numbers.append(high)
            direction = -1
            low = i
        elif direction <= 0 and s[i] - s[low] > retreat:
            if direction:
                numbers.append(low)
            direction = 1
            high = i
    if numbers[-1] != len(s) - 1:
        numbers.append(len(s) - 1)
    return numbers


class StretchKind(StrEnum):
    """Kinds of stretches."""

    LOADING = "loading"  # first loading
    FALLING = "unloading"
    RISING = "reloading"


class CurveStretch(NamedTuple):
    """Points on one curve."""

    kind: StretchKind
    cycle: int  # number of the last peak from 0; for LOADING, of the next peak
    rows: Rows
    # For FALLING, the corner at which it starts: the peak of its cycle, or a turn during reloading.
    begin: int = -1
    turn: float = 0.0  # for RISING, the recorded indentation at which it starts


class Corner(NamedTuple):
    """An upper turn."""

    indentation: float  # largest value of the smoothed path near the turn
    cycle: int
    is_peak: bool  # whether it is on the first loading curve
    rise: int = -1  # otherwise, the number of the RISING stretch that ends there


class Division(NamedTuple):
    """A test divided into stretches."""

    path: SmoothedIndentation
    stretches: tuple[CurveStretch, ...]
    corners: tuple[Corner, ...]

    @property
    def peaks(self) -> list[int]:
        """Corners that are peaks, one per cycle."""
        return [n for n, corner in enumerate(self.corners) if corner.is_peak]

    def rows(self, kind: StretchKind, cycle: int | None = None) -> Rows:
        """Return the points of all stretches of a kind, or of those in a cycle."""
        stretches = [s for s in self.stretches if s.kind == kind]
        parts = [s.rows for s in stretches if cycle is None or s.cycle == cycle]
        return np.concatenate([np.empty(0, dtype=np.int64), *parts])


def divide(indentation: Floats, retreat: float | None = None) -> Division:
    """Divide a test into stretches on the curves of the law.

    A decrease of the indentation by more than `retreat` is a turn. By default it must exceed 2 % of
    the range of the path and eight standard deviations of the noise.
    """
    path = smoothed(indentation)
    if path.range <= 0.0:
        raise StudyError("the indentation never changes")
    if retreat is None:
        retreat = max(LEAST_RETREAT * path.range, QUIET * path.noise)
    if retreat >= path.range:
        raise StudyError(f"the range of the path is below the threshold of a turn ({retreat:g})")
    turning_points = turns(path, retreat)
    s = path.smooth
    if s[turning_points[1]] <= s[0]:
        raise StudyError("the test starts with unloading; it must start with the first loading")
    return _stretches(path, turning_points, near=max(retreat / 2.0, 4.0 * path.noise))


def _stretches(path: SmoothedIndentation, turning_points: list[int], *, near: float) -> Division:
    """Divide a path at its turns; peaks closer than `near` are the same."""
    s = path.smooth
    stretches: list[CurveStretch] = []
    corners: list[Corner] = []
    cycle = -1
    begin = -1  # corner at which the next unloading begins
    peak = -math.inf
    for first, end in pairwise(turning_points):
        ends_in_turn = end != turning_points[-1]
        rows, top = _between(path, first, end, ends_in_turn), float(s[end])
        if top <= s[first]:
            stretches.append(CurveStretch(StretchKind.FALLING, cycle, rows, begin))
            continue

        if cycle >= 0:
            below = rows[s[rows] <= peak]
            stretches.append(CurveStretch(StretchKind.RISING, cycle, below, turn=float(s[first])))
        rise = len(stretches) - 1
        if top > peak + near:  # a rise continues on the first loading curve beyond the peak
            stretches.append(CurveStretch(StretchKind.LOADING, cycle + 1, rows[s[rows] > peak]))
            if ends_in_turn:
                cycle += 1
                peak = top
                begin = len(corners)
                corners.append(Corner(top, cycle, is_peak=True))
        elif ends_in_turn and top < peak - near:
            begin = len(corners)
            corners.append(Corner(top, cycle, is_peak=False, rise=rise))
        elif ends_in_turn:
            begin = max(n for n, corner in enumerate(corners) if corner.is_peak)
    return Division(path, tuple(stretches), tuple(corners))


def _between(path: SmoothedIndentation, first: int, end: int, ends_in_turn: bool) -> Rows:
    """Return the points between two turns, without the turns and points too close to them.

    The point at a turn may have been recorded before or after it.
    """
    begin = first + 1 if first else 0
    rows: Rows = np.arange(begin, end if ends_in_turn else end + 1, dtype=np.int64)
    if not path.noise:
        return rows
    s, guard = path.smooth, GUARD * path.noise
    keep = np.full(len(rows), True)
    if first:
        keep &= (np.abs(s[rows] - s[first]) > guard) & (rows > first + path.reach)
    if ends_in_turn:
        keep &= (np.abs(s[rows] - s[end]) > guard) & (rows < end - path.reach)
    return np.asarray(rows[keep])


NAMES = ("indentation", "force")  # columns
IMPERIAL = {"in", "inch", "inches", "mil", "mils", "lbf", "lb", "lbs", "kip", "kips"}


class Test(NamedTuple):
    """An indentation test."""

    indentation: Floats  # (rows,), in `units`
    force: Floats  # (rows,)
    units: Mapping[str, str]  # names of the units of length and force; empty if unknown
    stated: tuple[str, str]  # units of both in the file; empty texts if none
    record: Record = IN_MEMORY


def read_test(
    path: Path, columns: Sequence[str] = (), units: tuple[str, str] | None = None
) -> Test:
    """Read an indentation test in consistent units.

    The columns have a usual name, or `columns` has their names or numbers (from 1). Values are
    converted to `units` of length and force. By default a file in inches and pounds is converted to
    in and lbf, other files to m and N or mm and N. A file without units is assumed to be in
    `units`. Raises StudyError if a column is missing, a unit is unknown, or a number is invalid.
    Raises OSError if the file can't be read.
    """
    table = read_table(path)
    length, load = table.find(NAMES, columns)
    stated = (length.unit, load.unit)
    if units is None and any(stated) and not all(stated):
        text = f"{path}: one column is in {stated[0] or stated[1]}, the other has no unit"
        raise StudyError(f"{text}; state both, or give both in `units`")
    names = units or (_consistent_units(*stated) if any(stated) else None)
    target = dict(zip(("length", "force"), names, strict=True)) if names else {}
    indentation, force = table.values((length, load), target)
    if names and any(stated):
        stated = (stated[0] or names[0], stated[1] or names[1])
    return Test(indentation, force, target, stated, table.record)


def _consistent_units(length: str, force: str) -> tuple[str, str]:
    """Return consistent units of length and force, close to the units of a file."""
    if {length.casefold(), force.casefold()} <= IMPERIAL:
        return "in", "lbf"
    return ("m" if length == "m" else "mm"), "N"
