"""Physics broken on purpose, and the rows of ``fecm verify`` that have to see it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from fecm.verification import CASES, carry_out, chosen
from fecm.verification.case import Label
from tests.broken import (
    curved,
    elements,
    impacts,
    laminates,
    plies,
    stretching,
    studies,
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
}


# The program's own errors of a motion that cannot be.
REFUSALS = ("DivergenceError", "PlyError", "StudyError")
ROWS = {
    (one.name, check.quantity)
    for one in CASES
    for check in one.checks
    if check.label is not Label.AGAINST_CHANGE
}


def seen() -> Iterator[tuple[str, str, tuple[str, ...]]]:
    """Each break with each case that has to see it."""
    for name, (_, seen_by) in BREAKS.items():
        for case, quantities in seen_by.items():
            yield name, case, quantities


def rows_of(case: str, beginnings: tuple[str, ...]) -> set[tuple[str, str]]:
    """Rows of a case whose quantities begin with one of these."""
    return {row for row in ROWS if row[0] == case and row[1].startswith(beginnings)}


def parameters() -> Iterator[Any]:
    """Those of the default run: a case of every break, and a break of every row."""
    names, rows = set[str](), set[tuple[str, str]]()
    for name, case, quantities in seen():
        new = rows_of(case, quantities) - rows
        marks = () if new or name not in names else pytest.mark.long
        yield pytest.param(name, case, quantities, marks=marks, id=f"{name} is seen by {case}")
        names, rows = names | {name}, rows | new


@pytest.mark.parametrize(("name", "case", "quantities"), list(parameters()))
def test_broken_physics_is_seen(
    name: str, case: str, quantities: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fecm.mechanics.kernels.LIBRARY", None)  # NumPy is what is broken
    BREAKS[name][0](monkeypatch)
    (one,) = chosen([case])
    with np.errstate(all="ignore"):
        found = carry_out(one)
    for beginning in quantities:
        rows = [row for row in found if row.check.quantity.startswith(beginning)]
        assert rows, f"no quantity of {case} begins with {beginning}"
        assert not [row.check.quantity for row in rows if row.within]
        # A break that raises an error of Python's is broken itself.
        assert {row.failure.partition(":")[0] for row in rows} <= {"", *REFUSALS}


def test_every_row_that_can_be_wrong_has_a_break_that_it_sees() -> None:
    assert set().union(*(rows_of(case, quantities) for _, case, quantities in seen())) == ROWS
