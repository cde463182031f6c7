"""Verification cases. A case computes a few values; its checks have the expected values.

The result of a check is a row. Rows are written as text, JSON and Markdown.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Iterable, Iterator, Sequence
from enum import StrEnum
from importlib import resources
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np

from fecm._typing import Floats

TABLES: dict[str, dict[str, Any]] = tomllib.loads(
    (resources.files("fecm.verification") / "checks.toml").read_text("utf-8")
)
INTRODUCTION: Any = TABLES.pop("introduction")
# A check compares one number. A field gives its value farthest from the expected value. A field and
# its expected shape give the amplitude at the point with the largest difference.
Value = float | Floats | tuple[Floats, Floats]
Compute = Callable[[], Sequence[Value]]
HEAD = ("case", "source", "quantity", "expected", "got", "error", "allowed", "label", "verdict")
# Smallest widths of columns with numbers. The numbers are not known when the first line is written.
LEAST_WIDTHS = {"expected": 15, "got": 15, "error": 8}
COLUMNS = "| quantity | source | expected | got | error | allowed | because | label |"


class Label(StrEnum):
    """Kind of evidence that a check gives."""

    INDEPENDENT = "independent"  # the expected value comes from outside the program
    CONSISTENCY = "consistency"  # two computations by the program agree
    AGAINST_CHANGE = "against change"  # the expected value comes from an earlier version


class RowVerdict(StrEnum):
    """Verdict on a row: within its tolerance or not."""

    FINE = "ok"
    FAILED = "FAILED"


class Check(NamedTuple):
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
    label : Label
        Kind of evidence: ``"independent"``, ``"consistency"`` or ``"against change"``.
    scale : float or None
        Reference of the relative error; None for the expected value.
    """

    quantity: str
    expected: float
    source: str
    tolerance: float
    why: str
    label: Label = Label.INDEPENDENT
    scale: float | None = None


class Case(NamedTuple):
    """Quantities that one function computes: `compute` returns a value for each check, in order."""

    name: str
    title: str
    checks: tuple[Check, ...]
    compute: Compute
    needs: str = ""  # optional library without which the case is left out


class Row(NamedTuple):
    """Result of a check.

    Attributes
    ----------
    case : str
        Name of the case.
    check : Check
        Quantity, expected value and tolerance.
    got : float
        Computed value; NaN if the computation failed.
    failure : str
        Reason why the computation failed; empty if it did not.
    """

    case: str
    check: Check
    got: float
    failure: str = ""

    @property
    def error(self) -> float:
        """Signed relative error."""
        scale = self.check.expected if self.check.scale is None else self.check.scale
        return (self.got - self.check.expected) / abs(scale)

    @property
    def within(self) -> bool:
        """Whether the error is within the tolerance; False for NaN."""
        return abs(self.error) <= self.check.tolerance

    @property
    def verdict(self) -> RowVerdict:
        """Verdict on the row."""
        return RowVerdict.FINE if self.within else RowVerdict.FAILED

    def to_dict(self) -> dict[str, object]:
        """Return the row as plain values for JSON; None stands for NaN."""
        check = self.check
        got, error = (value if math.isfinite(value) else None for value in (self.got, self.error))
        return {
            "case": self.case,
            "source": check.source,
            "quantity": check.quantity,
            "expected": check.expected,
            "got": got,
            "error": error,
            "tolerance": check.tolerance,
            "why": check.why,
            "label": check.label,
            "verdict": self.verdict,
            "failure": self.failure,
        }


CASE_OF: dict[str, Case] = {}


def case(compute: Compute) -> Compute:
    """Register a function as the computation of a case.

    The function ``_rod_pulse`` computes the case ``rod-pulse`` of `checks.toml`.
    """
    name = compute.__name__[1:].replace("_", "-")
    common = dict(TABLES[name])
    title, groups = common.pop("title"), common.pop("checks")
    needs = common.pop("needs", "")
    checks: list[Check] = []
    for group in groups:
        shared = common | group
        shared["label"] = Label(shared.get("label", Label.INDEPENDENT))
        expected = shared.pop("expected")
        checks += [Check(quantity, value, **shared) for quantity, value in expected.items()]
    CASE_OF[name] = Case(name, title, tuple(checks), compute, needs)
    return compute


def compute_rows(case: Case) -> list[Row]:
    """Compute the rows of a case; if an exception occurs, all rows fail."""
    try:
        values, failure = case.compute(), ""
        if len(values) != len(case.checks):
            raise ValueError(f"{len(values)} numbers for {len(case.checks)} checks")
        pairs = zip(values, case.checks, strict=True)
        numbers = [_number_to_check(value, check.expected) for value, check in pairs]
    except Exception as error:  # whatever the exception is, it belongs in the rows
        failure = f"{type(error).__name__}: {error}".splitlines()[0]
        numbers = [math.nan] * len(case.checks)
    results = zip(case.checks, numbers, strict=True)
    return [Row(case.name, check, number, failure) for check, number in results]


def _number_to_check(value: Value, expected: float) -> float:
    """Reduce a value to the number that is compared; NaN if any part of the value is NaN."""
    if isinstance(value, tuple):
        difference = (value[0] - expected * value[1]).ravel()
        return expected + float(difference[np.abs(difference).argmax()])
    field = np.ravel(value)
    return float(field[np.abs(field - expected).argmax()])


def cells(row: Row) -> tuple[str, ...]:
    """Return the cells of a row in the order of :data:`HEAD`."""
    check = row.check
    return (
        row.case,
        check.source,
        check.quantity,
        f"{check.expected:.9g}",
        f"{row.got:.9g}",
        f"{row.error:.1e}",
        f"{check.tolerance:g}",
        check.label,
        row.verdict,
    )


def table_lines(cases: Sequence[Case], rows: Iterable[Row]) -> Iterator[str]:
    """Yield the lines of a table while the rows are computed.

    The widths of the columns follow from the cases.
    """
    expected_cells = [
        cells(Row(item.name, check, math.nan)) for item in cases for check in item.checks
    ]
    columns = zip(HEAD, *expected_cells, strict=True)
    widths = [max(LEAST_WIDTHS.get(column[0], 0), *map(len, column)) for column in columns]

    def line(texts: Sequence[str]) -> str:
        return "  ".join(map(str.ljust, texts, widths)).rstrip()

    yield line(HEAD)
    for row in rows:
        yield line(cells(row))
        if row.failure:
            yield f"  {row.failure}"


def verification_page(rows: Iterable[Row]) -> str:
    """Return the documentation page in Markdown."""
    text = [INTRODUCTION]
    for name, group in groupby(rows, key=lambda row: row.case):
        text += ["", f"## `{name}`: {CASE_OF[name].title}", "", COLUMNS, "|---" * 8 + "|"]
        for row in group:
            _, source, quantity, expected, got, error, allowed, label, _ = cells(row)
            shown = got if row.within else f"**{got}**"
            texts = (quantity, source, expected, shown, error, allowed, row.check.why, label)
            text.append(f"| {' | '.join(texts)} |")
    return "\n".join([*text, ""])
