"""Blocks of pages that put computed beside measured values."""

from __future__ import annotations

from collections.abc import Iterator

from fecm._table import Cell, Row, ShownNumber
from fecm.judge.validity import VALID
from fecm.plot.kinds import PictureKind
from fecm.report import figures
from fecm.report.content import PageBlock, note_list, number_with_unit, page_table
from fecm.sweeps.measured import BAND, CaseComparison, comparisons
from fecm.sweeps.result import SweepResult

MOST_TESTS = 30  # cases that are listed one by one


def test_pictures(name: str, sweep: SweepResult) -> Iterator[PageBlock]:
    """Yield pictures of the results of a sweep over measured columns."""
    for compared in comparisons(sweep):
        words = compared.name.replace("_", " ").capitalize()
        caption = f"{words} of the tests, computed over measured."
        yield from figures.drawn(
            PictureKind.MEASURED, {name: sweep}, caption, quantity=compared.name
        )


def test_tables(sweep: SweepResult) -> Iterator[PageBlock]:
    """Yield tables of the results of a sweep beside measured columns."""
    compared = comparisons(sweep)
    header = (
        *("quantity", "cases", "computed over measured", "from", "to"),
        *(f"within ±{100.0 * BAND:g} %", "bias", "rms of the difference"),
    )
    title = "Computed against measured values"
    yield from page_table(map(_comparison_row, compared), header, title)
    if compared:
        yield from _cases(sweep, compared)


def _comparison_row(compared: CaseComparison) -> Row:
    """Return the numbers of a comparison."""
    count, (mean, low, high) = int(compared.pairs.sum()), compared.ratio_statistics
    return (
        compared.name.replace("_", " "),
        ShownNumber(count, str(count)),
        *(number_with_unit(ratio, digits=3) for ratio in (mean, low, high)),
        ShownNumber(compared.within, str(compared.within)),
        number_with_unit(compared.bias, compared.unit),
        number_with_unit(compared.rms, compared.unit),
    )


def _cases(sweep: SweepResult, compared: list[CaseComparison]) -> Iterator[PageBlock]:
    """Yield a table with a row for each case that has a measured value."""
    texts = [name for name, column in sweep.measured.items() if column.dtype.kind == "U"]
    header = ["case", *(name.removeprefix("measured_") for name in texts), *sweep.cases]
    for one in compared:
        label = one.name.replace("_", " ")
        header += [f"{label}, measured", "computed", "ratio"]
    tested = [case for case in range(len(sweep)) if any(one.pairs[case] for one in compared)]
    rows: list[Row] = []
    for case in tested[:MOST_TESTS]:
        cells: list[Cell] = [str(case), *(str(sweep[name][case]) for name in texts)]
        for name, column in sweep.cases.items():
            value = column[case].item()
            is_number = isinstance(value, float)
            cells.append(number_with_unit(value, sweep.unit(name)) if is_number else str(value))
        for one in compared:
            cells += [
                number_with_unit(float(one.measured[case]), one.unit),
                number_with_unit(float(one.computed[case]), one.unit),
                number_with_unit(float(one.ratio[case]), digits=3),
            ]
        validity = str(sweep.validity[case])
        rows.append((*cells, "" if validity == VALID else validity))
    yield from page_table(rows, (*header, "validity"), "Tests")
    if len(tested) > MOST_TESTS:
        yield from note_list([f"{len(tested) - MOST_TESTS} more cases are in the file."])
