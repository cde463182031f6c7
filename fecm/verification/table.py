"""Output of verification rows as text, JSON values and Markdown."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby
from typing import Any

from fecm.verification.case import CASE_OF, Case, Row

HEAD = ("case", "source", "quantity", "expected", "got", "error", "allowed", "label", "verdict")
FINE, NOT_FINE = "ok", "FAILED"


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


INTRODUCTION = """\
# Verification

`fecm verify` computes the cases below in a few seconds and compares the results with known values.
It needs no files, so that it tests the installed program. The exit status is 0 if every row is
within its tolerance, and 1 otherwise.

```sh
fecm verify                        # all cases
fecm verify patch rod-pulse        # some cases
fecm verify --list                 # names of the cases
fecm verify --format json          # JSON
fecm verify --markdown             # this page
```

- **independent**: the expected value is a closed form or an external reference.
- **consistency**: two computations by this program must agree, or its results must satisfy a law
  such as the energy balance. Such a row cannot detect an error that both sides share.
- **against change**: the expected value was computed by the original program, recompiled, or by
  this program. Such a row does not show that either is correct, only that nothing has changed.

The error is relative to the expected value; if that is zero, to a scale stated in the row or a
natural scale of the quantity. The tolerance follows from the theory of the discretisation, for the
reason stated. Each row of the first two kinds fails if the physics that it tests is broken on
purpose: `tests/test_verify_breaks.py` does so, and requires that every such row is covered.

Units are lb, in and s, except for the square plates of `static-bending`, `frequencies`,
`assumed-shear`, `equilibrium-shear`, `ply-stresses` and `ply-shear`, whose sides and least moduli
are of the order of 1. Plates have L2 = 2 unless stated otherwise; `patch`, `resultants`,
`time-step` and the impacts have L2 = 3, as the deck of the report. MITC is the word of `SHEA`."""

COLUMNS = ("quantity", "source", "expected", "got", "error", "allowed", "because", "label")


def page(rows: Iterable[Row]) -> str:
    """Return the documentation page in Markdown."""
    text = [INTRODUCTION]
    for name, group in groupby(rows, key=lambda row: row.case):
        text += ["", f"## `{name}`: {CASE_OF[name].title}", "", _row(COLUMNS), "|---" * 8 + "|"]
        text += [_row(_cells(row)) for row in group]
    return "\n".join([*text, ""])


def _cells(row: Row) -> tuple[str, ...]:
    _, source, quantity, expected, got, error, allowed, label, verdict = cells(row)
    shown = got if verdict == FINE else f"**{got}**"
    return quantity, source, expected, shown, error, allowed, row.check.why, label


def _row(texts: Iterable[str]) -> str:
    return "| " + " | ".join(texts) + " |"
