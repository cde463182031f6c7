"""Indentation laws: the contact force for an indentation and for what came before it.

Every curve of the report's laws (equations 3-1, 3-3 and 3-11) has one form,
F = f ((a - b)/w)^p, zero for a <= b.  A law's memory is the curve that it is on and the peak where
the first loading curve was left; memories are never changed but replaced.  Force and indentation
are positive in compression.  All values are floats, or arrays with one entry a case.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

# A float or an array of floats; a bool or an array of bools.
Number = Any
Truth = Any

LOADING_POWER = 1.5
# The only unloading power that equation 3-7 holds for.
ACR_POWER = 2.5

# Branches.
VIRGIN, UNLOADING, RELOADING = 0, 1, 2


def _select(condition: Truth, a: Number, b: Number) -> Number:
    """`a` where the condition holds, otherwise `b`."""
    if isinstance(condition, np.ndarray):
        return np.where(condition, a, b)
    return a if condition else b


def _any(condition: Truth) -> bool:
    """Whether the condition holds for any case."""
    return bool(condition.any()) if isinstance(condition, np.ndarray) else bool(condition)


def hertz_coefficient(radius: float, e_s: float, nu_s: float, e_t: float) -> float:
    """Contact coefficient of a sphere on a half-space, equation 3-2 (force/length^1.5).

    Parameters
    ----------
    radius : float
        Radius of the sphere, R_s (length).
    e_s, nu_s : float
        Young's modulus (force/length^2) and Poisson's ratio of the sphere.
    e_t : float
        Young's modulus of the laminate through its thickness, force/length^2.

    Raises
    ------
    ValueError
        If radius or a modulus is not positive, or Poisson's ratio not between -1 and 0.5.
    """
    for name, value in (("radius", radius), ("E_s", e_s), ("E_t", e_t)):
        if not 0.0 < value < math.inf:
            raise ValueError(f"{name} must be positive, not {value:g}")
    if not -1.0 < nu_s <= 0.5:
        raise ValueError(f"nu_s must lie between -1 and 0.5, not {nu_s:g}")
    return 4.0 / 3.0 * math.sqrt(radius) / ((1.0 - nu_s**2) / e_s + 1.0 / e_t)


class ContactParameters(ABC):
    """What was measured: the first loading curve, the unloading power, and what remains.

    Attributes
    ----------
    k : float
        Contact coefficient, force/length^1.5 (equation 3-1).
    q : float
        Power of the unloading curve (equation 3-3).
    """

    __slots__ = ()
    k: Number
    q: Number

    @abstractmethod
    def permanent(self, peak: Number) -> Number:
        """Permanent indentation after a peak (length)."""

    def loading(self, indentation: Number) -> Number:
        """Force on the first loading curve, equation 3-1."""
        return power_curve(self.k, 0.0, 1.0, LOADING_POWER, indentation)

    def rigidity(self, peak: Number) -> Number:
        """Unloading rigidity s after a positive peak, equation 3-5, force/length^q.

        With the permanent indentation of 3-8 it is 3-9 and 3-10, with that of 3-7 it is 3-6.
        """
        return self.loading(peak) / (peak - self.permanent(peak)) ** self.q


@dataclass(frozen=True, slots=True)
class LinearPermanent(ContactParameters):
    """What was measured: EXPE's card.

    Attributes
    ----------
    k : float
        Contact coefficient, force/length^1.5 (equation 3-1).
    alpha_p, s_p : float
        Critical indentation (length) and slope of equation 3-8.
    q : float
        Power of the unloading curve (equation 3-3).
    """

    k: Number
    alpha_p: Number
    s_p: Number
    q: Number

    def permanent(self, peak: Number) -> Number:
        """Permanent indentation after a peak, equation 3-8, never negative (length)."""
        value = self.s_p * (peak - self.alpha_p)
        return _select(value > 0.0, value, 0.0)


@dataclass(frozen=True, slots=True)
class YangSunPermanent(ContactParameters):
    """What was measured, with one unloading rigidity k/alpha_cr for every peak: EXPE ACR's card.

    Attributes
    ----------
    k : float
        Contact coefficient, force/length^1.5 (equation 3-1).
    alpha_cr : float
        Critical indentation of equation 3-6 (length).
    q : float
        5/2.
    """

    k: Number
    alpha_cr: Number
    q: Number = field(default=ACR_POWER, init=False)

    def permanent(self, peak: Number) -> Number:
        """Permanent indentation after a peak, equation 3-7, never negative (length)."""
        top = _select(peak > 0.0, peak, 0.0)
        value = top - self.alpha_cr**0.4 * top**0.6
        return _select(value > 0.0, value, 0.0)


def power_curve(f: Number, b: Number, w: Number, p: Number, a: Number) -> Number:
    """F = f ((a - b)/w)^p, zero for a <= b."""
    if isinstance(a, np.ndarray):
        return np.where(a > b, f * (np.maximum(a - b, 0.0) / w) ** p, 0.0)
    return f * ((a - b) / w) ** p if a > b else 0.0


@dataclass(frozen=True, slots=True)
class LoadingHistory:
    """Where a law stands.

    Attributes
    ----------
    branch : int
        VIRGIN, UNLOADING or RELOADING.
    f, b, w, p : float
        The branch's curve F = f ((a - b)/w)^p.
    peak, peak_force : float
        Where the first loading curve was left last.
    permanent : float
        Permanent indentation after that peak.
    """

    branch: Number
    f: Number
    b: Number
    w: Number
    p: Number
    peak: Number
    peak_force: Number
    permanent: Number

    def with_rows(self, rows: NDArray[np.intp], new: LoadingHistory) -> LoadingHistory:
        """The same with other values in some cases."""
        values = []
        for name in LoadingHistory.__slots__:
            array = getattr(self, name).copy()
            array[rows] = getattr(new, name)
            values.append(array)
        return LoadingHistory(*values)

    def force(self, indentation: Number) -> Number:
        """Force on the branch's curve."""
        return power_curve(self.f, self.b, self.w, self.p, indentation)


class ContactPoint(NamedTuple):
    """An accepted indentation and its force."""

    indentation: Number
    force: Number


class Law(Protocol):
    """An indentation law."""

    @property
    def constants(self) -> ContactParameters:
        """What was measured."""
        ...

    def start(self) -> LoadingHistory:
        """Memory before the first contact."""
        ...

    def trial(
        self, memory: LoadingHistory, last: ContactPoint, indentation: Number
    ) -> tuple[Number, LoadingHistory]:
        """Contact force at a trial indentation, and the memory to go on with.

        Parameters
        ----------
        memory : LoadingHistory
            Where the law stands.
        last : ContactPoint
            The last accepted point.
        indentation : float
            The trial value.
        """
        ...

    def accept(
        self, memory: LoadingHistory, last: ContactPoint, indentation: Number
    ) -> LoadingHistory:
        """Memory after a step that ended at an indentation."""
        ...


def _start(constants: ContactParameters) -> LoadingHistory:
    zero = 0.0 * constants.k
    one = zero + 1.0
    branch = VIRGIN + (zero == one)  # VIRGIN, once a case
    return LoadingHistory(branch, constants.k, zero, one, LOADING_POWER * one, zero, zero, zero)


@dataclass(frozen=True, slots=True)
class HystereticLaw:
    """The report's law with any number of unloadings and reloadings in any order.

    A fall from the first loading curve (3-1) sets the peak.  Below it every fall follows (3-3) down
    to the permanent indentation, every rise follows (3-11) back to the peak, and each begins where
    the other ended, so that the force is continuous.  At the peak the first curve goes on.
    """

    constants: ContactParameters

    def start(self) -> LoadingHistory:
        """Memory before the first contact."""
        return _start(self.constants)

    def trial(
        self, memory: LoadingHistory, last: ContactPoint, indentation: Number
    ) -> tuple[Number, LoadingHistory]:
        """Contact force at a trial indentation; a trial does not change the memory."""
        return self._follow(memory, last, indentation).force(indentation), memory

    def accept(
        self, memory: LoadingHistory, last: ContactPoint, indentation: Number
    ) -> LoadingHistory:
        """Memory after a step that ended at an indentation."""
        return self._follow(memory, last, indentation)

    def permanent(self, memory: LoadingHistory, last: ContactPoint) -> Number:
        """Permanent indentation that the law would leave behind now (length)."""
        peak = _select(memory.branch == VIRGIN, last.indentation, memory.peak)
        return self.constants.permanent(_select(peak > memory.peak, peak, memory.peak))

    def _follow(self, m: LoadingHistory, last: ContactPoint, a: Number) -> LoadingHistory:
        """Memory on whose curve `a` lies, coming from the last accepted point."""
        falls = a < last.indentation
        virgin, unloading = m.branch == VIRGIN, m.branch == UNLOADING
        if isinstance(a, np.ndarray):
            rises = a > last.indentation
            turns = np.where(virgin, falls, (a >= m.peak) | np.where(unloading, rises, falls))
            rows = np.flatnonzero(turns)
            if not len(rows):
                return m
            law, at = (
                HystereticLaw(_taken(self.constants, rows)),
                ContactPoint(*(x[rows] for x in last)),
            )
            return m.with_rows(rows, law._turned(_taken(m, rows), at, a[rows]))
        # Most often the way goes on along the same curve.
        if not falls if virgin else a < m.peak and falls == unloading:
            return m
        return self._turned(m, last, a)

    def _turned(self, m: LoadingHistory, last: ContactPoint, a: Number) -> LoadingHistory:
        """The same where the curve may end."""
        falls = a < last.indentation
        leaves = (m.branch == VIRGIN) & falls
        returns = (m.branch != VIRGIN) & (a >= m.peak)
        turns_up = (m.branch == UNLOADING) & (a > last.indentation) & (a < m.peak)
        turns_down = (m.branch == RELOADING) & falls
        c = self.constants
        peak = _select(leaves, last.indentation, m.peak)
        peak_force = _select(leaves, c.loading(last.indentation), m.peak_force)
        permanent = _select(leaves, c.permanent(last.indentation), m.permanent)
        # Unloading, from the first curve's own point or from a reloading curve's last point.
        begin = _select(leaves, peak_force, last.force)
        width = last.indentation - permanent
        down = LoadingHistory(
            UNLOADING, _select(width > 0.0, begin, 0.0), permanent,
            _select(width > 0.0, width, 1.0), c.q, peak, peak_force, permanent,
        )  # fmt: skip
        up = self._reloading(m, last)
        first = LoadingHistory(
            VIRGIN, c.k, 0.0, 1.0, LOADING_POWER, m.peak, m.peak_force, m.permanent
        )
        return _choose(leaves | turns_down, down, _choose(turns_up, up, _choose(returns, first, m)))

    def _reloading(self, m: LoadingHistory, last: ContactPoint) -> LoadingHistory:
        """Curve from the last point back to the peak."""
        loaded = (last.force > 0.0) & (last.force < m.peak_force)
        ratio = (_select(loaded, last.force, 0.0) / _select(loaded, m.peak_force, 1.0)) ** (
            1.0 / LOADING_POWER
        )
        origin = _select(loaded, (last.indentation - ratio * m.peak) / (1.0 - ratio), m.permanent)
        # A force that has not fallen below the peak's (the accepted force is one pass older than
        # the indentation) leaves no room for a curve: it stays constant up to the peak.
        level = (last.force > 0.0) & (last.force >= m.peak_force)
        width = m.peak - origin
        power = _select(level, 0.0, LOADING_POWER)
        return LoadingHistory(
            RELOADING, _select(width > 0.0, m.peak_force, 0.0), origin,
            _select(width > 0.0, width, 1.0), power, m.peak, m.peak_force, m.permanent,
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class ListingLaw:
    """The printed program's law (the slip ``reload``), which never goes back a branch.

    The first trial whose force is below the last accepted one ends loading for good; the first
    trial on the unloading curve whose force is not, begins reloading for good.  Trials count, also
    those that the contact iteration discards.
    """

    constants: ContactParameters

    def start(self) -> LoadingHistory:
        """Memory before the first contact."""
        return _start(self.constants)

    def trial(
        self, memory: LoadingHistory, last: ContactPoint, indentation: Number
    ) -> tuple[Number, LoadingHistory]:
        """Contact force at a trial indentation, and the memory that the trial leaves behind."""
        m, c = memory, self.constants
        force = m.force(indentation)
        leaves = (m.branch == VIRGIN) & (force < last.force)
        if _any(leaves):
            permanent = c.permanent(last.indentation)
            width = last.indentation - permanent
            down = LoadingHistory(
                UNLOADING, _select(width > 0.0, last.force, 0.0), permanent,
                _select(width > 0.0, width, 1.0), c.q, last.indentation, last.force, permanent,
            )  # fmt: skip
            m = _choose(leaves, down, m)
            force = m.force(indentation)
        turns = (m.branch == UNLOADING) & (indentation > m.permanent) & (force >= last.force)
        if _any(turns):
            up = LoadingHistory(
                RELOADING, m.peak_force * (m.w > 0.0), m.permanent, m.w, LOADING_POWER,
                m.peak, m.peak_force, m.permanent,
            )  # fmt: skip
            m = _choose(turns, up, m)
            force = m.force(indentation)
        return force, m

    def accept(
        self, memory: LoadingHistory, last: ContactPoint, indentation: Number
    ) -> LoadingHistory:
        """Memory after a step: trials have done everything."""
        return memory


def follow(
    law: Law, corners: Sequence[float], points: int = 1
) -> Iterator[tuple[ContactPoint, int]]:
    """Force of one case along a path, from the first contact at zero on.

    Parameters
    ----------
    law : Law
    corners : sequence of float
        Indentations between which the path goes straight; it starts at 0.
    points : int
        Points from one corner to the next.

    Yields
    ------
    Point, int
        Indentation and force, and the branch that they lie on; the start first.
    """
    memory, last, begin = law.start(), ContactPoint(0.0, 0.0), 0.0
    yield last, VIRGIN
    for corner in corners:
        for n in range(1, points + 1):
            part = n / points
            indentation = corner if n == points else begin + part * (corner - begin)
            force, memory = law.trial(memory, last, indentation)
            memory = law.accept(memory, last, indentation)
            last = ContactPoint(indentation, float(force))
            yield last, int(memory.branch)
        begin = corner


def _choose(condition: Truth, yes: LoadingHistory, no: LoadingHistory) -> LoadingHistory:
    """One memory or the other, case by case."""
    if not isinstance(condition, np.ndarray):
        return yes if condition else no
    return LoadingHistory(
        *(np.where(condition, getattr(yes, n), getattr(no, n)) for n in LoadingHistory.__slots__)
    )


def _taken(record: Any, rows: NDArray[np.intp]) -> Any:
    """A record with the values of some cases."""
    taken = object.__new__(type(record))
    for part in fields(record):
        value = getattr(record, part.name)
        some = value[rows] if isinstance(value, np.ndarray) else value
        object.__setattr__(taken, part.name, some)
    return taken


def stacked(records: Sequence[ContactParameters]) -> ContactParameters:
    """Constants of many cases in one, of one kind."""
    kind: Any = type(records[0])
    names = [part.name for part in fields(kind) if part.init]
    made: ContactParameters = kind(
        *(np.array([getattr(r, name) for r in records]) for name in names)
    )
    return made
