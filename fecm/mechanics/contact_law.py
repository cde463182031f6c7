"""Contact laws: the contact force as a function of indentation and loading history.

Every curve of the report's laws (equations 3-1, 3-3 and 3-11) has the form F = f ((a - b)/w)^p, and
is zero for a <= b.  The loading history contains the current curve and the peak at which first
loading ended; it is immutable.  Force and indentation are positive in compression.

A law holds for one case or for many cases.  The values of one case are floats, the values of many
cases are arrays with an entry per case.  The type parameter :data:`Number` stands for either; it
defaults to float.  Powers of floats are Python's, powers of arrays are NumPy's.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import (
    TYPE_CHECKING,
    Any,
    Generic,
    NamedTuple,
    Protocol,
    TypeVar,
    cast,
    overload,
    runtime_checkable,
)

import numpy as np

from fecm._typing import Bools, Floats, Indices

if TYPE_CHECKING:
    import typing_extensions

    Number = typing_extensions.TypeVar("Number", float, Floats, default=float)
else:  # defaults of type parameters need Python 3.13
    Number = TypeVar("Number", float, Floats)

LOADING_POWER = 1.5
# Equation 3-7 holds for this unloading power only.
ACR_POWER = 2.5

# Branches.
VIRGIN = 0
UNLOADING = 1
RELOADING = 2


@overload
def select(condition: bool, a: float, b: float) -> float: ...
@overload
def select(condition: Bools, a: float | Floats, b: float | Floats) -> Floats: ...
@overload
def select(condition: bool | Bools, a: float | Floats, b: float | Floats) -> float | Floats: ...
def select(condition: bool | Bools, a: float | Floats, b: float | Floats) -> float | Floats:
    """Return `a` where the condition holds, otherwise `b`."""
    if isinstance(condition, np.ndarray):
        return np.where(condition, a, b)
    return a if condition else b


def any_case(condition: bool | Bools) -> bool:
    """Return whether the condition holds for any case."""
    return bool(condition.any()) if isinstance(condition, np.ndarray) else bool(condition)


def hertz_coefficient(radius: float, e_s: float, nu_s: float, e_t: float) -> float:
    """Return the contact coefficient of a sphere (s) on a half-space (t), equation 3-2.

    The coefficient is in force/length^1.5.

    Raises
    ------
    ValueError
        If the radius or a modulus is not positive, or Poisson's ratio is not between -1 and 0.5.
    """
    for name, value in (("radius", radius), ("E_s", e_s), ("E_t", e_t)):
        if not 0.0 < value < math.inf:
            raise ValueError(f"{name} must be positive, not {value:g}")
    if not -1.0 < nu_s <= 0.5:
        raise ValueError(f"nu_s must lie between -1 and 0.5, not {nu_s:g}")
    return 4.0 / 3.0 * math.sqrt(radius) / ((1.0 - nu_s**2) / e_s + 1.0 / e_t)


class ContactParameters(ABC, Generic[Number]):
    """Parameters of the contact law."""

    __slots__ = ()
    k: Number  # contact coefficient, force/length^1.5 (equation 3-1)
    q: float | Number  # power of the unloading curve (equation 3-3)

    @overload
    def permanent(self, peak: Number) -> Number: ...
    @overload
    def permanent(self, peak: Floats) -> Floats: ...
    @abstractmethod
    def permanent(self, peak: float | Floats) -> float | Floats:
        """Return the permanent indentation after a peak (length)."""

    def of_cases(self: ContactParameters[Floats], cases: Indices) -> ContactParameters[Floats]:
        """Select cases by their indices."""
        return stack_parameters([self], lambda values: values[0][cases])

    @overload
    def loading(self, indentation: Number) -> Number: ...
    @overload
    def loading(self, indentation: Floats) -> Floats: ...
    def loading(self, indentation: float | Floats) -> float | Floats:
        """Return the force on the first loading curve, equation 3-1."""
        return power_curve(self.k, 0.0, 1.0, LOADING_POWER, indentation)

    def rigidity(self, peak: Floats) -> Floats:
        """Return the unloading rigidity s after positive peaks, equation 3-5 (force/length^q).

        The permanent indentation of 3-8 gives 3-9 and 3-10; the permanent indentation of 3-7 gives
        3-6.
        """
        return self.loading(peak) / (peak - self.permanent(peak)) ** self.q


@dataclass(frozen=True)
class LinearPermanent(ContactParameters[Number]):
    """Parameters with a linear permanent indentation (the card of EXPE)."""

    k: Number  # contact coefficient, force/length^1.5 (equation 3-1)
    # Critical indentation (length) and slope of equation 3-8.
    alpha_p: Number
    s_p: Number
    q: Number  # power of the unloading curve (equation 3-3)

    @overload
    def permanent(self, peak: Number) -> Number: ...
    @overload
    def permanent(self, peak: Floats) -> Floats: ...
    def permanent(self, peak: float | Floats) -> float | Floats:
        """Return the permanent indentation after a peak, equation 3-8 (length), at least 0."""
        value = self.s_p * (peak - self.alpha_p)
        return select(value > 0.0, value, 0.0)


@dataclass(frozen=True)
class YangSunPermanent(ContactParameters[Number]):
    """Parameters with one unloading rigidity k/alpha_cr for every peak (the card of EXPE ACR)."""

    k: Number  # contact coefficient, force/length^1.5 (equation 3-1)
    alpha_cr: Number  # critical indentation of equation 3-6 (length)
    q: float = field(default=ACR_POWER, init=False)  # 5/2

    @overload
    def permanent(self, peak: Number) -> Number: ...
    @overload
    def permanent(self, peak: Floats) -> Floats: ...
    def permanent(self, peak: float | Floats) -> float | Floats:
        """Return the permanent indentation after a peak, equation 3-7 (length), at least 0."""
        top = select(peak > 0.0, peak, 0.0)
        value: float | Floats = top - self.alpha_cr**0.4 * top**0.6
        return select(value > 0.0, value, 0.0)


@overload
def power_curve(f: float, b: float, w: float, p: float, a: float) -> float: ...
@overload
def power_curve(
    f: float | Floats, b: float | Floats, w: float | Floats, p: float | Floats, a: Floats
) -> Floats: ...
@overload
def power_curve(
    f: float | Floats,
    b: float | Floats,
    w: float | Floats,
    p: float | Floats,
    a: float | Floats,
) -> float | Floats: ...
def power_curve(
    f: float | Floats,
    b: float | Floats,
    w: float | Floats,
    p: float | Floats,
    a: float | Floats,
) -> float | Floats:
    """Return F = f ((a - b)/w)^p, zero for a <= b."""
    if isinstance(a, np.ndarray):
        return np.where(a > b, f * (np.maximum(a - b, 0.0) / w) ** p, 0.0)
    return f * ((a - b) / w) ** p if a > b else 0.0


def stack_parameters(
    records: Sequence[Any], function: Callable[[list[Any]], Any] = np.array
) -> ContactParameters[Floats]:
    """Stack the parameters of many cases, all of one class; `function` makes the arrays."""
    names = [part.name for part in fields(records[0]) if part.init]
    arrays = {name: function([getattr(record, name) for record in records]) for name in names}
    return cast(ContactParameters[Floats], replace(records[0], **arrays))


class LoadingHistory(NamedTuple, Generic[Number]):
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


class ContactPoint(NamedTuple, Generic[Number]):
    """An accepted indentation and its force."""

    indentation: Number
    force: Number


def branch_force(history: LoadingHistory[Number], indentation: Number) -> Number:
    """Return the force on the curve of the history's branch."""
    return power_curve(history.f, history.b, history.w, history.p, indentation)


@runtime_checkable
class Law(Protocol[Number]):
    """A contact law: a force for each trial indentation, and a memory of the loading history.

    A step calls `trial` up to five times, once per contact iteration.  The step then calls `accept`
    once, with the indentation at the end of the step.  The memory has any immutable type.  The law
    itself does not change, because the cases of a sweep share it.  A law without a memory returns
    the same force in loading and unloading.

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
        """Return the memory before the first contact."""

    def trial(
        self, memory: Any, last: ContactPoint[Number], indentation: Number
    ) -> tuple[Number, Any]:
        """Return the contact force at a trial indentation, and the memory after the trial.

        `last` is the point at the end of the last step.  An indentation is a length; it is negative
        where the bodies are apart.
        """

    def accept(self, memory: Any, last: ContactPoint[Number], indentation: Number) -> Any:
        """Return the memory after a step that ends at an indentation."""

    def permanent(self, memory: Any, last: ContactPoint[Number]) -> Number:
        """Return the permanent indentation after unloading from the last point (length)."""


@dataclass(frozen=True)
class MeasuredLaw(Generic[Number]):
    """A law of the report with measured parameters.  Subclasses add `trial` and `accept`."""

    constants: ContactParameters[Number]

    def start(self) -> LoadingHistory[Number]:
        """Return the loading history before the first contact."""
        k = self.constants.k
        zero = filled_like(k, 0.0)
        return LoadingHistory(
            branch=filled_like(k, VIRGIN),
            f=k,
            b=zero,
            w=filled_like(k, 1.0),
            p=filled_like(k, LOADING_POWER),
            peak=zero,
            peak_force=zero,
            permanent=zero,
        )

    def permanent(self, memory: LoadingHistory[Number], last: ContactPoint[Number]) -> Number:
        """Return the permanent indentation after unloading from the last point (length)."""
        peak = select(memory.branch == VIRGIN, last.indentation, memory.peak)
        return self.constants.permanent(select(peak > memory.peak, peak, memory.peak))


@dataclass(frozen=True)
class HystereticLaw(MeasuredLaw[Number]):
    """The report's law with any sequence of unloadings and reloadings.

    The peak is the point at which the indentation falls from the first loading curve (3-1).  Below
    the peak, unloading follows (3-3) down to the permanent indentation, and reloading follows
    (3-11) back to the peak.  Each starts where the other ended, so that the force is continuous.
    Beyond the peak, first loading continues.
    """

    def trial(
        self, memory: LoadingHistory[Number], last: ContactPoint[Number], indentation: Number
    ) -> tuple[Number, LoadingHistory[Number]]:
        """Return the contact force at a trial indentation, and the unchanged history."""
        if not isinstance(indentation, np.ndarray):
            return branch_force(self.accept(memory, last, indentation), indentation), memory
        cases, new = self._find_turning_cases(memory, last, indentation)
        force = branch_force(memory, indentation)
        if new is not None:
            force[cases] = branch_force(new, indentation[cases])
        return force, memory

    def accept(
        self, memory: LoadingHistory[Number], last: ContactPoint[Number], indentation: Number
    ) -> LoadingHistory[Number]:
        """Return the loading history after a step that ends at an indentation."""
        m, a = memory, indentation
        if isinstance(a, np.ndarray):
            cases, new = self._find_turning_cases(m, last, a)
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
        return self._leave_branch(m, last, a)

    def _find_turning_cases(
        self: HystereticLaw[Floats],
        m: LoadingHistory[Floats],
        last: ContactPoint[Floats],
        a: Floats,
    ) -> tuple[Indices, LoadingHistory[Floats] | None]:
        """Return the cases that may leave their branch, and their new histories or None."""
        falls, rises = a < last.indentation, a > last.indentation
        virgin, unloading = m.branch == VIRGIN, m.branch == UNLOADING
        turns = np.where(virgin, falls, (a >= m.peak) | np.where(unloading, rises, falls))
        cases = np.flatnonzero(turns)
        if not len(cases):
            return cases, None
        law = HystereticLaw(self.constants.of_cases(cases))
        points = ContactPoint(*(x[cases] for x in last))
        return cases, law._leave_branch(LoadingHistory(*(x[cases] for x in m)), points, a[cases])

    def _leave_branch(
        self, m: LoadingHistory[Number], last: ContactPoint[Number], a: Number
    ) -> LoadingHistory[Number]:
        """Return the loading history where the indentation may leave the branch."""
        falls = a < last.indentation
        leaves = (m.branch == VIRGIN) & falls
        returns = (m.branch != VIRGIN) & (a >= m.peak)
        turns_up = (m.branch == UNLOADING) & (a > last.indentation) & (a < m.peak)
        turns_down = (m.branch == RELOADING) & falls
        c = self.constants
        peak = select(leaves, last.indentation, m.peak)
        peak_force = select(leaves, c.loading(last.indentation), m.peak_force)
        permanent = select(leaves, c.permanent(last.indentation), m.permanent)
        # Unloading starts on the first loading curve, or at the last point of a reloading curve.
        start_force = select(leaves, peak_force, last.force)
        down = unloading_branch(
            c.q, last, start_force, peak=peak, peak_force=peak_force, permanent=permanent
        )
        up = self._reloading(m, last)
        first = m._replace(
            branch=filled_like(a, VIRGIN),
            f=c.k,
            b=filled_like(a, 0.0),
            w=filled_like(a, 1.0),
            p=filled_like(a, LOADING_POWER),
        )
        return choose_history(
            leaves | turns_down,
            down,
            choose_history(turns_up, up, choose_history(returns, first, m)),
        )

    def _reloading(
        self, m: LoadingHistory[Number], last: ContactPoint[Number]
    ) -> LoadingHistory[Number]:
        """Return the reloading branch from the last point to the peak, equation 3-11."""
        loaded = (last.force > 0.0) & (last.force < m.peak_force)
        share = select(loaded, last.force, 0.0) / select(loaded, m.peak_force, 1.0)
        ratio = share ** (1.0 / LOADING_POWER)
        origin = select(loaded, (last.indentation - ratio * m.peak) / (1.0 - ratio), m.permanent)
        # The accepted force is one iteration older than the indentation.  If the force has not
        # fallen below the peak force, it stays constant up to the peak.
        is_constant = (last.force > 0.0) & (last.force >= m.peak_force)
        return _curve(
            branch=RELOADING,
            f=m.peak_force,
            b=origin,
            w=m.peak - origin,
            p=select(is_constant, filled_like(origin, 0.0), filled_like(origin, LOADING_POWER)),
            peak=m.peak,
            peak_force=m.peak_force,
            permanent=m.permanent,
        )


def unloading_branch(
    q: float | Number,
    last: ContactPoint[Number],
    start_force: Number,
    *,
    peak: Number,
    peak_force: Number,
    permanent: Number,
) -> LoadingHistory[Number]:
    """Return the unloading branch of power q from the last point, equation 3-3.

    `start_force` is the force at the last point.
    """
    return _curve(
        branch=UNLOADING,
        f=start_force,
        b=permanent,
        w=last.indentation - permanent,
        p=q,
        peak=peak,
        peak_force=peak_force,
        permanent=permanent,
    )


def _curve(
    *,
    branch: int,
    f: Number,
    b: Number,
    w: Number,
    p: float | Number,
    peak: Number,
    peak_force: Number,
    permanent: Number,
) -> LoadingHistory[Number]:
    """Return a branch; its force is zero if its width is not positive."""
    return LoadingHistory(
        branch=filled_like(f, branch),
        f=select(w > 0.0, f, 0.0),
        b=b,
        w=select(w > 0.0, w, 1.0),
        p=filled_like(f, p),
        peak=peak,
        peak_force=peak_force,
        permanent=permanent,
    )


def follow(
    law: Law, corners: Sequence[float], points: int = 1
) -> Iterator[tuple[ContactPoint, int]]:
    """Yield points and branches of one case: the start, then `points` per section to a corner."""
    memory, last, section_start = law.start(), ContactPoint(0.0, 0.0), 0.0
    yield last, VIRGIN
    for corner in corners:
        for n in range(1, points + 1):
            share = n / points
            indentation = (
                corner if n == points else section_start + share * (corner - section_start)
            )
            force, memory = law.trial(memory, last, indentation)
            memory = law.accept(memory, last, indentation)
            last = ContactPoint(indentation, float(force))
            yield last, int(memory.branch)
        section_start = corner


def choose_history(
    condition: bool | Bools, yes: LoadingHistory[Number], no: LoadingHistory[Number]
) -> LoadingHistory[Number]:
    """Return `yes` where the condition holds, otherwise `no`."""
    if not isinstance(condition, np.ndarray):
        return yes if condition else no
    # If the condition is an array, the numbers are too.
    chosen = (cast(Number, np.where(condition, a, b)) for a, b in zip(yes, no, strict=True))
    return LoadingHistory(*chosen)


def filled_like(number: Number, value: float | Number) -> Number:
    """Return a value, repeated for each case if `number` is an array."""
    return np.full_like(number, value) if isinstance(number, np.ndarray) else value
