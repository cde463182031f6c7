"""Rows of a verification as text, as values for programs, and as the page of the documentation."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from fecm.verification import CASES
from fecm.verification.case import Case, Row

HEAD = ("case", "source", "quantity", "expected", "got", "error", "allowed", "label", "verdict")
FINE, NOT_FINE = "ok", "FAILED"


def cells(row: Row) -> tuple[str, ...]:
    """A row's cells, in the order of :data:`HEAD`."""
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
        FINE if row.within else NOT_FINE,
    )


def lines(cases: Sequence[Case], rows: Iterable[Row]) -> Iterator[str]:
    """A table in columns, line by line as rows come in.

    Parameters
    ----------
    cases : sequence of Case
        Where the rows come from, for the columns' widths.
    rows : iterable of Row
    """
    # Numbers of nine digits are at most 15 wide, errors 8.
    known = [(one.name, c.source, c.quantity, "", "", "", f"{c.tolerance:g}", c.label)
             for one in cases for c in one.checks]  # fmt: skip
    least = (0, 0, 0, 15, 15, 8, 0, 0)
    widths = [
        max(minimum, *map(len, column))
        for minimum, column in zip(least, zip(HEAD[:-1], *known, strict=True), strict=True)
    ]

    def line(texts: Sequence[str]) -> str:
        padded = [text.ljust(width) for text, width in zip(texts[:-1], widths, strict=True)]
        return "  ".join([*padded, texts[-1]])

    yield line(HEAD)
    for row in rows:
        yield line(cells(row))
        if row.failure:
            yield f"  {row.failure}"


def values(row: Row) -> dict[str, Any]:
    """A row for programs; what could not be computed is None."""
    check = row.check
    return {
        "case": row.case,
        "source": check.source,
        "quantity": check.quantity,
        "expected": check.expected,
        "got": row.got if math.isfinite(row.got) else None,
        "error": row.error if math.isfinite(row.error) else None,
        "tolerance": check.tolerance,
        "why": check.why,
        "label": check.label,
        "verdict": FINE if row.within else NOT_FINE,
        "failure": row.failure,
    }


INTRODUCTION = """\
# Verification

`fecm verify` computes the cases below, in a few seconds, and compares what it gets with figures
that are known. It needs no file, so that it tests the program as it is installed. Exit status 0:
every row is within its tolerance; 1: some are not.

```sh
fecm verify                        # all of them
fecm verify patch rod-pulse        # some
fecm verify --list                 # what there is
fecm verify --format json          # for programs
fecm verify --markdown             # this page
```

- **independent**: the figure is a closed form, or comes from outside this program.
- **consistency**: two ways through this program have to agree, or its own numbers have to obey a
  law such as the balance of energy. Such a row can't see an error that both sides share.
- **against change**: the figure is one of the original program, recompiled, or of this program
  itself. Such a row can't show that either is right, only that nothing has moved.

The error is what was got less what was expected, relative to what was expected; where that is zero,
relative to the scale that the quantity names or that suits it. What is allowed is what the theory
of the discretisation justifies, for the reason beside it. Each row of the first two kinds fails
when the physics that it speaks of is broken on purpose: `tests/test_verify_breaks.py` does it,
break by break, and requires that no such row is left out.

Units are lb, in and s, except for the square plates of `static-bending` and `frequencies`, whose
sides, moduli and densities are 1. Plates have L2 = 2 where a row does not say otherwise, but for
`patch`, `resultants`, `time-step` and the impacts: these have L2 = 3, as the report's deck has."""

COLUMNS = ("quantity", "source", "expected", "got", "error", "allowed", "because", "label")


def page(rows: Iterable[Row]) -> str:
    """Write the page of the documentation, in Markdown, of the rows of all cases."""
    of_case: dict[str, list[Row]] = {}
    for row in rows:
        of_case.setdefault(row.case, []).append(row)
    text = [INTRODUCTION]
    for one in CASES:
        if one.name in of_case:
            text += ["", f"## `{one.name}`: {one.title}", "", _row(COLUMNS), "|---" * 8 + "|"]
            text += [_row(_cells(row)) for row in of_case[one.name]]
    return "\n".join([*text, ""])


def _cells(row: Row) -> tuple[str, ...]:
    _, source, quantity, expected, got, error, allowed, label, verdict = cells(row)
    shown = got if verdict == FINE else f"**{got}**"
    return quantity, source, expected, shown, error, allowed, row.check.why, label


def _row(texts: Iterable[str]) -> str:
    return "| " + " | ".join(texts) + " |"
