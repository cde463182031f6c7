"""Tables of many short lines: their memory, and the most rows of a table of cases."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import pytest

import fecm._machine
from fecm._machine import NotEnoughMemoryError
from fecm._measured_tables import COPIES, FIELD_BYTES, LINE_BYTES, read_table
from fecm.authoring.case import CasesError
from fecm.sweeps.case_tables import read_cases

NAMES = ("velocity", "k", "alpha_p", "s_p", "q")


def table(path: Path, rows: int, columns: int, field: str) -> Path:
    """Write a table of cases."""
    lines = [",".join(NAMES[:columns]), *[",".join([field] * columns)] * rows]
    path.write_text("\n".join(lines))
    return path


@pytest.mark.parametrize("columns", [1, 2, 5])
@pytest.mark.parametrize("field", ["2", "1.23456789012"])
@pytest.mark.few(1)  # of 6, 0.5 s each
def test_the_memory_of_a_table_is_within_its_estimate(
    tmp_path: Path, columns: int, field: str
) -> None:
    rows = 3000
    path = table(tmp_path / "cases.csv", rows, columns, field)
    fields = (rows + 1) * columns
    estimate = LINE_BYTES * (rows + 1) + FIELD_BYTES * fields + COPIES * path.stat().st_size
    tracemalloc.start()
    cases = read_cases(path)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len(cases) == rows
    assert 0.5 * estimate < peak < estimate


def test_a_table_of_short_lines_that_memory_does_not_hold_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = table(tmp_path / "cases.csv", 220_000, 1, "2")  # 0.44 MB of text
    monkeypatch.setattr(fecm._machine, "available_memory", lambda: 50_000_000)
    with pytest.raises(NotEnoughMemoryError, match="a table of 220001 lines takes about 107 MB"):
        read_table(path)


def test_a_table_of_too_many_cases_is_refused_before_its_fields_are_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fecm.sweeps.case_tables.MOST_CASES", 10)
    path = table(tmp_path / "cases.csv", 11, 1, "2")
    with pytest.raises(CasesError, match="has 12 lines; at most 11 are allowed"):
        read_cases(path)
    assert len(read_cases(table(tmp_path / "cases.csv", 10, 1, "2"))) == 10
