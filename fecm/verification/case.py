"""Verification cases.

A case computes a few values; each of its checks states the expected value, its source, the
tolerance and the reason for the tolerance.  A check is independent if the expected value is a
closed form or an external reference, a consistency check if two computations by this program must
agree, and otherwise guards against change.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

INDEPENDENT, CONSISTENCY, AGAINST_CHANGE = "independent", "consistency", "against change"


@dataclass(frozen=True)
class Check:
    """Expected value of one quantity.

    Attributes
    ----------
    quantity : str
        Name and unit.
    expected : float
        Expected value.
    source : str
        Source of the expected value.
    tolerance : float
        Largest admissible error.
    why : str
        Reason for the tolerance.
    label : str
        `INDEPENDENT`, `CONSISTENCY` or `AGAINST_CHANGE`.
    scale : float or None
        Reference of the relative error; None for the expected value.
    """

    quantity: str
    expected: float
    source: str
    tolerance: float
    why: str
    label: str = INDEPENDENT
    scale: float | None = None

    def error(self, got: float) -> float:
        """Return the relative error of a computed value."""
        return (got - self.expected) / abs(self.expected if self.scale is None else self.scale)


def checks(
    quantities: str, values: Iterable[float], source: str, tolerance: float, why: str
) -> tuple[Check, ...]:
    """Return checks of several quantities, separated by commas, that differ only in the value."""
    names = quantities.split(", ")
    return tuple(
        Check(name, value, source, tolerance, why)
        for name, value in zip(names, values, strict=True)
    )


@dataclass(frozen=True)
class Case:
    """Quantities computed together.

    Attributes
    ----------
    name, title : str
        Name and description.
    checks : tuple of Check
    compute : callable
        Returns one value per check, in order.
    """

    name: str
    title: str
    checks: tuple[Check, ...]
    compute: Callable[[], Sequence[float]]


@dataclass(frozen=True)
class Row:
    """Result of a check.

    Attributes
    ----------
    case : str
        Name of the case.
    check : Check
    got : float
        Computed value; NaN if the computation failed.
    failure : str
        Reason for the failure.
    """

    case: str
    check: Check
    got: float
    failure: str = ""

    @property
    def error(self) -> float:
        """Signed relative error."""
        return self.check.error(self.got)

    @property
    def within(self) -> bool:
        """Whether the error is within the tolerance; False for NaN."""
        return abs(self.error) <= self.check.tolerance


def case(name: str, title: str, *checks: Check) -> Callable[[Callable[[], Sequence[float]]], Case]:
    """Return a decorator that makes a case of the function that computes its values."""

    def made(compute: Callable[[], Sequence[float]]) -> Case:
        return Case(name, title, checks, compute)

    return made


def carry_out(one: Case) -> list[Row]:
    """Compute the rows of a case; an exception becomes the failure of all rows."""
    try:
        numbers, failure = [float(number) for number in one.compute()], ""
        if len(numbers) != len(one.checks):
            raise ValueError(f"{len(numbers)} numbers for {len(one.checks)} checks")
    except Exception as error:  # any exception fails the rows
        failure = f"{type(error).__name__}: {error}".splitlines()[0]
        numbers = [math.nan] * len(one.checks)
    return [
        Row(one.name, check, number, failure)
        for check, number in zip(one.checks, numbers, strict=True)
    ]


def farthest(values: Iterable[float], expected: float) -> float:
    """Return the value farthest from the expected value; NaN if any value is NaN."""
    every = list(values)
    if any(math.isnan(value) for value in every):
        return math.nan
    return max(every, key=lambda value: abs(value - expected))
