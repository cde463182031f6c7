"""CSV export of a sweep: one row per case, or one row per step of each case.

Cases count from 0, steps from 1.  Numbers are written as Python's repr, which preserves every bit.
An apostrophe precedes texts that a spreadsheet would read as formulas.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from fecm.results.schema import ExportError
from fecm.sweeps.result import SweepResult

# First characters of a formula.
FORMULA = ("=", "+", "-", "@")

CASES, HISTORY = "cases", "history"


def lines(sweep: SweepResult, name: str = CASES) -> Iterator[str]:
    """Return the lines of a table, with line ends.

    ``"cases"`` has the values and results of every case, ``"history"`` the contact force after
    every step of every case that was run.  Raises ExportError if the table is unknown, or the sweep
    has no stored forces.
    """
    if name not in (CASES, HISTORY):
        raise ExportError(f"unknown table {name}; a sweep has {CASES} and {HISTORY}")
    if name == HISTORY and sweep.force is None:
        raise ExportError("the sweep has no stored forces; run it again with --history")
    return _written(_cases(sweep) if name == CASES else _history(sweep))


def _cases(sweep: SweepResult) -> Iterator[Iterable[Any]]:
    columns = {**sweep.cases, **sweep.summary}
    columns |= {"dt": sweep.dt, "steps": sweep.steps, "status": columns.pop("status")}
    yield ("case", *columns)
    values = [column.tolist() for column in columns.values()]
    yield from zip(range(len(sweep)), *values, strict=True)


def _history(sweep: SweepResult) -> Iterator[Iterable[Any]]:
    yield ("case", "step", "time", "force")
    if sweep.force is None:
        return
    for case in np.flatnonzero(sweep.fine).tolist():
        count = int(sweep.steps[case])
        times = np.add.accumulate(np.full(count, sweep.dt[case])).tolist()
        forces = sweep.force[case, :count].tolist()
        for step, (time, force) in enumerate(zip(times, forces, strict=True), start=1):
            yield case, step, time, force


def _cell(value: Any) -> Any:
    if isinstance(value, float):
        return repr(value)
    if isinstance(value, str) and (value[:1] in FORMULA or value[:1] < " "):
        return f"'{value}" if value else value
    return value


def _written(rows: Iterable[Iterable[Any]]) -> Iterator[str]:
    line = io.StringIO()
    writer = csv.writer(line, lineterminator="\n")
    for row in rows:
        writer.writerow(_cell(cell) for cell in row)
        yield line.getvalue()
        line.seek(0)
        line.truncate()
