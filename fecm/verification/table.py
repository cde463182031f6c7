"""Output of verification rows as text, JSON values and Markdown."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby
from typing import Any

from fecm.verification.case import CASE_OF, INTRODUCTION, Case, Row

HEAD = ("case", "source", "quantity", "expected", "got", "error", "allowed", "label", "verdict")
FINE, NOT_FINE = "ok", "FAILED"
COLUMNS = "| quantity | source | expected | got | error | allowed | because | label |"


def cells(row: Row) -> tuple[str, ...]:
    """Return the cells of a row in the order of :data:`HEAD`."""
    check = row.check
    return (
        row.case, check.source, check.quantity, f"{check.expected:.9g}", f"{row.got:.9g}",
        f"{row.error:.1e}", f"{check.tolerance:g}", check.label, FINE if row.within else NOT_FINE,
    )  # fmt: skip


def lines(cases: Sequence[Case], rows: Iterable[Row]) -> Iterator[str]:
    """Yield the lines of a table as rows are computed; the cases give the widths of the columns."""
    # Numbers of nine digits are at most 15 wide, errors 8.
    known = [cells(Row(one.name, check, math.nan)) for one in cases for check in one.checks]
    least = (0, 0, 0, 15, 15, 8, 0, 0, 0)
    widths = [
        max(minimum, *map(len, column))
        for minimum, column in zip(least, zip(HEAD, *known, strict=True), strict=True)
    ]

    def line(texts: Sequence[str]) -> str:
        return "  ".join(map(str.ljust, texts, widths)).rstrip()

    yield line(HEAD)
    for row in rows:
        yield line(cells(row))
        if row.failure:
            yield f"  {row.failure}"


def values(row: Row) -> dict[str, Any]:
    """Return a row as plain values; None for values that could not be computed."""
    check = row.check
    got, error = (value if math.isfinite(value) else None for value in (row.got, row.error))
    return {
        "case": row.case, "source": check.source, "quantity": check.quantity,
        "expected": check.expected, "got": got, "error": error, "tolerance": check.tolerance,
        "why": check.why, "label": check.label, "verdict": FINE if row.within else NOT_FINE,
        "failure": row.failure,
    }  # fmt: skip


def page(rows: Iterable[Row]) -> str:
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
