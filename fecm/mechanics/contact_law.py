"""Contact laws: the contact force as a function of indentation and loading history.

Every curve of the report's laws (equations 3-1, 3-3 and 3-11) has the form F = f ((a - b)/w)^p, and
is zero for a <= b.  The loading history is the current curve and the peak at which first loading
ended; it is immutable.  Force and indentation are positive in compression.  All values are floats,
or arrays with one entry per case.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import field, fields, replace
from typing import Any, NamedTuple, Protocol, cast

import numpy as np

from fecm._frozen import frozen
from fecm._typing import Floats, Indices

# float or Floats, and bool or Bools: one case, or an array of cases.
Number = Any
Truth = Any

LOADING_POWER = 1.5
# Equation 3-7 holds for this unloading power only.
ACR_POWER = 2.5

# Branches.
VIRGIN = 0
UNLOADING = 1
RELOADING = 2


def _select(condition: Truth, a: Number, b: Number) -> Number:
    """`a` where the condition holds, otherwise `b`."""
    if isinstance(condition, np.ndarray):
        return np.where(condition, a, b)
    return a if condition else b


def _any(condition: Truth) -> bool:
    """Whether the condition holds for any case."""
    return bool(condition.any()) if isinstance(condition, np.ndarray) else bool(condition)


def hertz_coefficient(radius: float, e_s: float, nu_s: float, e_t: float) -> float:
    """Contact coefficient of a sphere (s) on a half-space (t), equation 3-2 (force/length^1.5).

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
    """Parameters of the contact law."""

    __slots__ = ()
    k: Number  # contact coefficient, force/length^1.5 (equation 3-1)
    q: Number  # power of the unloading curve (equation 3-3)

    @abstractmethod
    def permanent(self, peak: Number) -> Number:
        """Permanent indentation after a peak (length)."""

    def of_cases(self, cases: Indices) -> ContactParameters:
        """Select some cases."""
        return stacked([self], lambda values: values[0][cases])

    def loading(self, indentation: Number) -> Number:
        """Force on the first loading curve, equation 3-1."""
        return power_curve(self.k, 0.0, 1.0, LOADING_POWER, indentation)

    def rigidity(self, peak: Number) -> Number:
        """Unloading rigidity s after a positive peak, equation 3-5, force/length^q.

        The permanent indentation of 3-8 gives 3-9 and 3-10, that of 3-7 gives 3-6.
        """
        return self.loading(peak) / (peak - self.permanent(peak)) ** self.q


@frozen
class LinearPermanent(ContactParameters):
    """Parameters with a linear permanent indentation (the card of EXPE)."""

    k: Number  # contact coefficient, force/length^1.5 (equation 3-1)
    # Critical indentation (length) and slope of equation 3-8.
    alpha_p: Number
    s_p: Number
    q: Number  # power of the unloading curve (equation 3-3)

    def permanent(self, peak: Number) -> Number:
        """Permanent indentation after a peak, equation 3-8, never negative (length)."""
        value = self.s_p * (peak - self.alpha_p)
        return _select(value > 0.0, value, 0.0)


@frozen
class YangSunPermanent(ContactParameters):
    """Parameters with one unloading rigidity k/alpha_cr for every peak (the card of EXPE ACR)."""

    k: Number  # contact coefficient, force/length^1.5 (equation 3-1)
    alpha_cr: Number  # critical indentation of equation 3-6 (length)
    q: Number = field(default=ACR_POWER, init=False)  # 5/2

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


def stacked(
    records: Sequence[Any], function: Callable[[list[Any]], Any] = np.array
) -> ContactParameters:
    """Parameters of many cases, all of one class, as arrays: a function of the values of each."""
    names = [part.name for part in fields(records[0]) if part.init]
    made = {name: function([getattr(record, name) for record in records]) for name in names}
    return cast(ContactParameters, replace(records[0], **made))


class LoadingHistory(NamedTuple):
    """Loading history of a contact."""

    branch: Number  # VIRGIN, UNLOADING or RELOADING
    # The branch's curve F = f ((a - b)/w)^p.
    f: Number
    b: Number
    w: Number
    p: Number
    # Last point of first loading.
    peak: Number
    peak_force: Number
    permanent: Number  # permanent indentation after that peak

    def force(self, indentation: Number) -> Number:
        """Force on the branch's curve."""
        return power_curve(self.f, self.b, self.w, self.p, indentation)


class ContactPoint(NamedTuple):
    """An accepted indentation and its force."""

    indentation: Number
    force: Number


class Law(Protocol):
    """A contact law: a force for each trial indentation, and a memory of the loading history.

    A step calls `trial` up to five times, as the contact iteration does, and `accept` once, with
    the indentation at the end of the step.  The memory is of any immutable type; a law without one
    gives the same force in loading and unloading.

    Examples
    --------
    A bilinear law without memory:

    >>> class Bilinear:
    ...     def start(self):
    ...         return None
    ...     def trial(self, memory, last, indentation):
    ...         a = max(indentation, 0.0)
    ...         return min(1e5 * a, 50.0 + 1e4 * a), memory
    ...     def accept(self, memory, last, indentation):
    ...         return memory
    ...     def permanent(self, memory, last):
    ...         return 0.0
    """

    def start(self) -> Any:
        """Memory before the first contact."""

    def trial(self, memory: Any, last: ContactPoint, indentation: Number) -> tuple[Number, Any]:
        """Contact force at a trial indentation, and the memory after the trial.

        The last point is that at the end of the last step.  An indentation is a length, negative
        where the bodies are apart.
        """

    def accept(self, memory: Any, last: ContactPoint, indentation: Number) -> Any:
        """Memory after a step that ends at an indentation."""

    def permanent(self, memory: Any, last: ContactPoint) -> Number:
        """Permanent indentation after unloading from the last point (length)."""


@frozen
class MeasuredLaw:
    """A law of the report, with measured parameters; subclasses add `trial` and `accept`."""

    constants: ContactParameters

    def start(self) -> LoadingHistory:
        """Loading history before the first contact."""
        k = self.constants.k
        zero, one = 0.0 * k, 0.0 * k + 1.0
        branch = VIRGIN + (zero == one)  # VIRGIN for every case
        return LoadingHistory(branch, k, zero, one, LOADING_POWER * one, zero, zero, zero)

    def permanent(self, memory: LoadingHistory, last: ContactPoint) -> Number:
        """Permanent indentation after unloading from the last accepted point (length)."""
        peak = _select(memory.branch == VIRGIN, last.indentation, memory.peak)
        return self.constants.permanent(_select(peak > memory.peak, peak, memory.peak))


@frozen
class HystereticLaw(MeasuredLaw):
    """The report's law with any sequence of unloadings and reloadings.

    The peak is the point at which the indentation falls from the first loading curve (3-1).  Below
    it every unloading follows (3-3) down to the permanent indentation and every reloading follows
    (3-11) back to the peak; each starts where the other ended, so that the force is continuous.
    Beyond the peak first loading continues.
    """

    def trial(
        self, memory: LoadingHistory, last: ContactPoint, indentation: Number
    ) -> tuple[Number, LoadingHistory]:
        """Contact force at a trial indentation; a trial does not change the history."""
        if not isinstance(indentation, np.ndarray):
            return self.accept(memory, last, indentation).force(indentation), memory
        cases, new = self._turning(memory, last, indentation)
        force = memory.force(indentation)
        if new is not None:
            force[cases] = new.force(indentation[cases])
        return force, memory

    def accept(
        self, memory: LoadingHistory, last: ContactPoint, indentation: Number
    ) -> LoadingHistory:
        """Loading history after a step that ends at an indentation."""
        m, a = memory, indentation
        if isinstance(a, np.ndarray):
            cases, new = self._turning(m, last, a)
            if new is None:
                return m
            updated = LoadingHistory(*(x.copy() for x in m))
            for values, changed in zip(updated, new, strict=True):
                values[cases] = changed
            return updated
        falls = a < last.indentation
        virgin, unloading = m.branch == VIRGIN, m.branch == UNLOADING
        # Most steps stay on the same curve.
        if not falls if virgin else a < m.peak and falls == unloading:
            return m
        return self._turned(m, last, a)

    def _turning(
        self, m: LoadingHistory, last: ContactPoint, a: Floats
    ) -> tuple[Indices, LoadingHistory | None]:
        """Cases that may leave their branch, and their loading histories; None without any."""
        falls, rises = a < last.indentation, a > last.indentation
        virgin, unloading = m.branch == VIRGIN, m.branch == UNLOADING
        turns = np.where(virgin, falls, (a >= m.peak) | np.where(unloading, rises, falls))
        cases = np.flatnonzero(turns)
        if not len(cases):
            return cases, None
        law = HystereticLaw(self.constants.of_cases(cases))
        at = ContactPoint(*(x[cases] for x in last))
        return cases, law._turned(LoadingHistory(*(x[cases] for x in m)), at, a[cases])

    def _turned(self, m: LoadingHistory, last: ContactPoint, a: Number) -> LoadingHistory:
        """Loading history where the indentation may leave the branch."""
        falls = a < last.indentation
        leaves = (m.branch == VIRGIN) & falls
        returns = (m.branch != VIRGIN) & (a >= m.peak)
        turns_up = (m.branch == UNLOADING) & (a > last.indentation) & (a < m.peak)
        turns_down = (m.branch == RELOADING) & falls
        c = self.constants
        peak = _select(leaves, last.indentation, m.peak)
        peak_force = _select(leaves, c.loading(last.indentation), m.peak_force)
        permanent = _select(leaves, c.permanent(last.indentation), m.permanent)
        # Unloading starts on the first loading curve, or at the last point of a reloading curve.
        begin = _select(leaves, peak_force, last.force)
        down = _unloading(c.q, last.indentation, begin, peak, peak_force, permanent)
        up = self._reloading(m, last)
        first = m._replace(branch=VIRGIN, f=c.k, b=0.0, w=1.0, p=LOADING_POWER)
        return _choose(leaves | turns_down, down, _choose(turns_up, up, _choose(returns, first, m)))

    def _reloading(self, m: LoadingHistory, last: ContactPoint) -> LoadingHistory:
        """Reloading from the last point to the peak, equation 3-11."""
        loaded = (last.force > 0.0) & (last.force < m.peak_force)
        share = _select(loaded, last.force, 0.0) / _select(loaded, m.peak_force, 1.0)
        ratio = share ** (1.0 / LOADING_POWER)
        origin = _select(loaded, (last.indentation - ratio * m.peak) / (1.0 - ratio), m.permanent)
        # The accepted force is one iteration older than the indentation.  If it has not fallen
        # below the peak's, it stays constant up to the peak.
        level = (last.force > 0.0) & (last.force >= m.peak_force)
        return _curve(
            RELOADING, m.peak_force, origin, m.peak - origin, _select(level, 0.0, LOADING_POWER),
            m.peak, m.peak_force, m.permanent,
        )  # fmt: skip


@frozen
class ListingLaw(MeasuredLaw):
    """The printed program's law (the slip ``reload``), which never returns to an earlier branch.

    The first trial whose force is below the last accepted one ends loading; the first trial on the
    unloading curve whose force is not below it starts reloading.  Trials that the contact iteration
    discards count.
    """

    def trial(
        self, memory: LoadingHistory, last: ContactPoint, indentation: Number
    ) -> tuple[Number, LoadingHistory]:
        """Contact force at a trial indentation, and the loading history after the trial."""
        m, c = memory, self.constants
        force = m.force(indentation)
        leaves = (m.branch == VIRGIN) & (force < last.force)
        if _any(leaves):
            a, f = last
            m = _choose(leaves, _unloading(c.q, a, f, a, f, c.permanent(a)), m)
            force = m.force(indentation)
        turns = (m.branch == UNLOADING) & (indentation > m.permanent) & (force >= last.force)
        if _any(turns):
            f = m.peak_force * (m.w > 0.0)
            m = _choose(turns, m._replace(branch=RELOADING, f=f, b=m.permanent, p=LOADING_POWER), m)
            force = m.force(indentation)
        return force, m

    def accept(
        self, memory: LoadingHistory, last: ContactPoint, indentation: Number
    ) -> LoadingHistory:
        """Loading history after a step, which its trials have already changed."""
        return memory


def _unloading(
    q: Number, a: Number, f: Number, peak: Number, peak_force: Number, permanent: Number
) -> LoadingHistory:
    """Unloading from the point (a, f), equation 3-3."""
    return _curve(UNLOADING, f, permanent, a - permanent, q, peak, peak_force, permanent)


def _curve(
    branch: int, f: Number, b: Number, w: Number, p: Number, *peak: Number
) -> LoadingHistory:
    """A branch; its force is zero if its width is not positive."""
    f, w = _select(w > 0.0, f, 0.0), _select(w > 0.0, w, 1.0)
    return LoadingHistory(branch, f, b, w, p, *peak)


def follow(
    law: Law, corners: Sequence[float], points: int = 1
) -> Iterator[tuple[ContactPoint, int]]:
    """Points and branches of one case: of the start, then `points` per section to each corner."""
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
    """`yes` where the condition holds, otherwise `no`."""
    if not isinstance(condition, np.ndarray):
        return yes if condition else no
    return LoadingHistory(*(np.where(condition, a, b) for a, b in zip(yes, no, strict=True)))
