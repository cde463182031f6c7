"""What a verification case is, and how it is carried out.

A case computes a few numbers; each of its checks says what one of them should be, where that figure
comes from, how far off it may be, and why so far.  A check is independent if its figure is a closed
form or comes from outside this program; it is one of consistency if two ways through this program
have to agree; otherwise it guards against change.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

INDEPENDENT, CONSISTENCY, AGAINST_CHANGE = "independent", "consistency", "against change"


@dataclass(frozen=True)
class Check:
    """One number that a case has to give.

    Attributes
    ----------
    quantity : str
        What it is, with its unit.
    expected : float
        The figure.
    source : str
        Where the figure comes from.
    tolerance : float
        Largest error that is allowed.
    why : str
        Why an error of that size is.
    label : str
        `INDEPENDENT`, `CONSISTENCY` or `AGAINST_CHANGE`.
    scale : float or None
        What the error is relative to; None for the figure itself.
    """

    quantity: str
    expected: float
    source: str
    tolerance: float
    why: str
    label: str = INDEPENDENT
    scale: float | None = None

    def error(self, got: float) -> float:
        """What was computed less the figure, relative to the scale."""
        return (got - self.expected) / abs(self.expected if self.scale is None else self.scale)


@dataclass(frozen=True)
class Case:
    """Numbers that are computed together.

    Attributes
    ----------
    name, title : str
        What it is called by, and what it is.
    checks : tuple of Check
    compute : callable
        Gives one number a check, in their order.
    """

    name: str
    title: str
    checks: tuple[Check, ...]
    compute: Callable[[], Sequence[float]]


@dataclass(frozen=True)
class Row:
    """A check that was carried out.

    Attributes
    ----------
    case : str
        Name of the case.
    check : Check
    got : float
        What was computed; NaN where nothing was.
    failure : str
        Why nothing was.
    """

    case: str
    check: Check
    got: float
    failure: str = ""

    @property
    def error(self) -> float:
        """Relative error, with its sign."""
        return self.check.error(self.got)

    @property
    def within(self) -> bool:
        """Whether the error is allowed; NaN is not."""
        return abs(self.error) <= self.check.tolerance


def case(name: str, title: str, *checks: Check) -> Callable[[Callable[[], Sequence[float]]], Case]:
    """Make a case of the function that computes its numbers."""

    def made(compute: Callable[[], Sequence[float]]) -> Case:
        return Case(name, title, checks, compute)

    return made


def carry_out(one: Case) -> list[Row]:
    """Compute a case's numbers; what keeps them from being computed is told in its rows."""
    try:
        numbers, failure = [float(number) for number in one.compute()], ""
        if len(numbers) != len(one.checks):
            raise ValueError(f"{len(numbers)} numbers for {len(one.checks)} checks")
    except Exception as error:  # whatever it is, the answer is no
        failure = f"{type(error).__name__}: {error}".splitlines()[0]
        numbers = [math.nan] * len(one.checks)
    return [
        Row(one.name, check, number, failure)
        for check, number in zip(one.checks, numbers, strict=True)
    ]


def farthest(values: Iterable[float], expected: float) -> float:
    """The value that is farthest from what all should be; NaN if any is."""
    every = list(values)
    if any(math.isnan(value) for value in every):
        return math.nan
    return max(every, key=lambda value: abs(value - expected))
