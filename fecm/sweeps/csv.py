"""Results of sweeps as CSV tables."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np

from fecm.deck.units import column_name
from fecm.results.errors import ExportError
from fecm.results.metrics import VERDICTS
from fecm.sweeps.stored import StoredSweep

FORMULA = re.compile(r"[=+@\x00-\x1f-]")  # how a formula begins
CASES = "cases"
HISTORY = "history"


def csv_lines(sweep: StoredSweep, name: str = CASES) -> Iterator[str]:
    """Return the lines of a CSV table, with line ends.

    ``"cases"`` has the values and results of every case, ``"history"`` the contact force after
    every step of every case that was run.  Cases count from 0, steps from 1.  Units follow the
    names in the header.  Numbers are written as Python's repr, which preserves every bit.  An
    apostrophe precedes texts that a spreadsheet would read as formulas.  Raises ExportError if
    there is no such table.
    """
    if name not in (CASES, HISTORY):
        raise ExportError(f"unknown table {name}; a sweep has {CASES} and {HISTORY}")
    if name == HISTORY and sweep.force is None:
        raise ExportError("the sweep has no stored forces; run it again with --history")
    echo: Any = SimpleNamespace(write=str)  # writerow returns what write returns
    writer = csv.writer(echo, lineterminator="\n")
    return (
        writer.writerow([f"'{v}" if isinstance(v, str) and FORMULA.match(v) else v for v in row])
        for row in (_case_rows(sweep) if name == CASES else _step_rows(sweep))
    )


def _case_rows(sweep: StoredSweep) -> Iterator[Iterable[Any]]:
    columns = {**sweep.cases, **sweep.summary}
    texts = {name: columns.pop(name) for name in VERDICTS if name in columns}
    columns |= {"dt": sweep.dt, "steps": sweep.steps, **texts}
    yield ("case", *_headings(sweep, columns))
    yield from zip(range(len(sweep)), *(v.tolist() for v in columns.values()), strict=True)


def _headings(sweep: StoredSweep, names: Iterable[str]) -> list[str]:
    """Names of columns, with units."""
    return [column_name(name, sweep.unit(name)) for name in names]


def _step_rows(sweep: StoredSweep) -> Iterator[Iterable[Any]]:
    assert sweep.force is not None
    yield ("case", "step", column_name("time", sweep.unit("dt")), *_headings(sweep, ["force"]))
    for case in np.flatnonzero(sweep.completed).tolist():
        count = int(sweep.steps[case])
        times = np.add.accumulate(np.full(count, sweep.dt[case])).tolist()
        forces = sweep.force[case, :count].tolist()
        yield from zip([case] * count, range(1, count + 1), times, forces, strict=True)
