"""Verification cases.

A case computes a few values; its checks state the expected ones.  A check is independent if the
expected value is a closed form or an external reference, a consistency check if two computations by
this program must agree, and otherwise guards against change.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Sequence
from importlib import resources
from typing import Any

import numpy as np

from fecm._frozen import frozen
from fecm._typing import Floats

TABLES: dict[str, dict[str, Any]] = tomllib.loads(
    (resources.files("fecm.verification") / "checks.toml").read_text("utf-8")
)
INTRODUCTION: Any = TABLES.pop("introduction")
# A number; a field, of which the value farthest from the expected one counts; or a field and its
# expected shape, of which the amplitude at the point farthest from the expected field counts.
Value = float | Floats | tuple[Floats, Floats]
Compute = Callable[[], Sequence[Value]]


@frozen
class Check:
    """Expected value of one quantity."""

    quantity: str  # name and unit
    expected: float
    source: str  # of the expected value
    tolerance: float  # largest admissible error
    why: str  # reason for the tolerance
    label: str = "independent"  # or "consistency" or "against change"
    scale: float | None = None  # reference of the relative error; None for the expected value


@frozen
class Case:
    """Quantities computed together: `compute` returns one value per check, in order."""

    name: str
    title: str
    checks: tuple[Check, ...]
    compute: Compute


@frozen
class Row:
    """Result of a check."""

    case: str  # its name
    check: Check
    got: float  # NaN if the computation failed
    failure: str = ""  # its reason

    @property
    def error(self) -> float:
        """Signed relative error."""
        scale = self.check.expected if self.check.scale is None else self.check.scale
        return (self.got - self.check.expected) / abs(scale)

    @property
    def within(self) -> bool:
        """Whether the error is within the tolerance; False for NaN."""
        return abs(self.error) <= self.check.tolerance


CASE_OF: dict[str, Case] = {}


def case(compute: Compute) -> Compute:
    """Decorate a function that computes the case of its name in `checks.toml`."""
    name = compute.__name__[1:].replace("_", "-")
    common = dict(TABLES[name])
    title, groups = common.pop("title"), common.pop("checks")
    checks = tuple(
        Check(quantity, **(common | group | {"expected": expected}))
        for group in groups
        for quantity, expected in group["expected"].items()
    )
    CASE_OF[name] = Case(name, title, checks, compute)
    return compute


def carry_out(one: Case) -> list[Row]:
    """Compute the rows of a case; an exception becomes the failure of all rows."""
    try:
        values, failure = one.compute(), ""
        if len(values) != len(one.checks):
            raise ValueError(f"{len(values)} numbers for {len(one.checks)} checks")
        numbers = [_number(v, c.expected) for v, c in zip(values, one.checks, strict=True)]
    except Exception as error:  # any exception fails the rows
        failure = f"{type(error).__name__}: {error}".splitlines()[0]
        numbers = [math.nan] * len(one.checks)
    pairs = zip(one.checks, numbers, strict=True)
    return [Row(one.name, check, number, failure) for check, number in pairs]


def _number(value: Value, expected: float) -> float:
    """Return what counts of a value; NaN if any part of it is NaN."""
    if isinstance(value, tuple):
        off = (value[0] - expected * value[1]).ravel()
        return expected + float(off[np.abs(off).argmax()])
    field = np.ravel(value)
    return float(field[np.abs(field - expected).argmax()])
