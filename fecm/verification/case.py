"""Verification cases: each computes a few values, its checks state the expected ones.

Their rows are written as text, as values for JSON, and as Markdown.
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
# A number; a field, of which the value farthest from the expected one counts; or a field and its
# expected shape, of which the amplitude at the point farthest from the expected field counts.
Value = float | Floats | tuple[Floats, Floats]
Compute = Callable[[], Sequence[Value]]
HEAD = ("case", "source", "quantity", "expected", "got", "error", "allowed", "label", "verdict")
# Widths of columns whose texts are not known before the rows: numbers of nine digits, errors.
LEAST_WIDTHS = {"expected": 15, "got": 15, "error": 8}
COLUMNS = "| quantity | source | expected | got | error | allowed | because | label |"


class Label(StrEnum):
    """What a check proves."""

    INDEPENDENT = "independent"  # the expected value comes from outside the program
    CONSISTENCY = "consistency"  # two ways through the program agree
    AGAINST_CHANGE = "against change"  # the value is the one of an earlier version


class RowVerdict(StrEnum):
    """Whether a row is within its tolerance."""

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
        Its source.
    tolerance : float
        Largest admissible error.
    why : str
        Reason for the tolerance.
    label : Label
        What the check proves: ``"independent"``, ``"consistency"`` or ``"against change"``.
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
    """Quantities computed together: `compute` returns one value per check, in order."""

    name: str
    title: str
    checks: tuple[Check, ...]
    compute: Compute


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
        Why it failed; empty if it did not.
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
        """The verdict."""
        return RowVerdict.FINE if self.within else RowVerdict.FAILED

    def to_dict(self) -> dict[str, object]:
        """Return plain values, for JSON; None for values that could not be computed."""
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
    """Decorate a function that computes the case of its name in `checks.toml`."""
    name = compute.__name__[1:].replace("_", "-")
    common = dict(TABLES[name])
    title, groups = common.pop("title"), common.pop("checks")
    checks: list[Check] = []
    for group in groups:
        shared = common | group
        shared["label"] = Label(shared.get("label", Label.INDEPENDENT))
        expected = shared.pop("expected")
        checks += [Check(quantity, value, **shared) for quantity, value in expected.items()]
    CASE_OF[name] = Case(name, title, tuple(checks), compute)
    return compute


def compute_rows(case: Case) -> list[Row]:
    """Compute the rows of a case; an exception becomes the failure of all rows."""
    try:
        values, failure = case.compute(), ""
        if len(values) != len(case.checks):
            raise ValueError(f"{len(values)} numbers for {len(case.checks)} checks")
        numbers = [_number(v, c.expected) for v, c in zip(values, case.checks, strict=True)]
    except Exception as error:  # any exception fails the rows
        failure = f"{type(error).__name__}: {error}".splitlines()[0]
        numbers = [math.nan] * len(case.checks)
    pairs = zip(case.checks, numbers, strict=True)
    return [Row(case.name, check, number, failure) for check, number in pairs]


def _number(value: Value, expected: float) -> float:
    """Return the number that a value is compared by; NaN if any part of it is NaN."""
    if isinstance(value, tuple):
        off = (value[0] - expected * value[1]).ravel()
        return expected + float(off[np.abs(off).argmax()])
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
    """Yield the lines of a table as rows are computed; the cases give the widths of the columns."""
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
