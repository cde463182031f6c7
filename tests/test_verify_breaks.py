"""Physics broken on purpose, and the rows of ``fecm verify`` that have to see it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from fecm.verification import CASES, chosen, compute_rows
from fecm.verification.case import Label
from tests.broken import (
    curved,
    elements,
    impacts,
    laminates,
    plies,
    stretching,
    studies,
    supports,
    waves_and_rods,
)

BREAKS = {
    **laminates.BREAKS,
    **elements.BREAKS,
    **waves_and_rods.BREAKS,
    **impacts.BREAKS,
    **plies.BREAKS,
    **stretching.BREAKS,
    **curved.BREAKS,
    **studies.BREAKS,
    **supports.BREAKS,
}


# The program's own errors of a motion that cannot be.
REFUSALS = ("DivergenceError", "PlyError", "StudyError")
ROWS = {
    (one.name, check.quantity)
    for one in CASES
    for check in one.checks
    if check.label is not Label.AGAINST_CHANGE
}


Row = tuple[str, str]
Seen = tuple[str, str, tuple[str, ...]]

# Each break with each case that has to see it, but for cases that need a library that is absent.
SEEN: list[Seen] = [
    (name, case, quantities)
    for name, (_, seen_by) in BREAKS.items()
    for case, quantities in seen_by.items()
    if case in {one.name for one in CASES}
]


def rows_of(case: str, beginnings: tuple[str, ...]) -> set[Row]:
    """Rows of a case whose quantities begin with one of these."""
    return {row for row in ROWS if row[0] == case and row[1].startswith(beginnings)}


def shown(pairs: list[Seen]) -> set[Any]:
    """Breaks that these see, and rows that they have to see them in."""
    names = {name for name, _, _ in pairs}
    return names.union(*(rows_of(case, quantities) for _, case, quantities in pairs))


# Cases that take from a quarter of a second to two seconds.
SLOW = (
    "curved-impact", "curved-panel", "cylindrical-bending", "infinite-plate", "large-mass",
    "location", "preload", "rigid-target", "small-mass", "stretching-disc", "stretching-impact",
    "webassembly",
)  # fmt: skip
# By default each break is seen by its first quick case; a break that slow ones alone see is long.
DEFAULT = list({pair[0]: pair for pair in reversed(SEEN) if pair[1] not in SLOW}.values())


@pytest.mark.parametrize(
    ("name", "case", "quantities"),
    [
        pytest.param(
            *pair,
            marks=() if pair in DEFAULT else pytest.mark.long,
            id=f"{pair[0]} is seen by {pair[1]}",
        )
        for pair in SEEN
    ],
)
def test_broken_physics_is_seen(
    name: str, case: str, quantities: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    BREAKS[name][0](monkeypatch)
    (one,) = chosen([case])
    with np.errstate(all="ignore"):
        actual = compute_rows(one)
    for beginning in quantities:
        rows = [row for row in actual if row.check.quantity.startswith(beginning)]
        assert rows, f"no quantity of {case} begins with {beginning}"
        assert not [row.check.quantity for row in rows if row.within]
        # A break that raises an error of Python's is broken itself.
        assert {row.failure.partition(":")[0] for row in rows} <= {"", *REFUSALS}


def test_every_row_that_can_be_wrong_has_a_break_that_it_sees() -> None:
    assert shown(SEEN) == {*BREAKS, *ROWS}
