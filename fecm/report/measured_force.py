"""Blocks of the page of a run that put its force beside a measured force."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from fecm._errors import FecmWarning
from fecm._table import Row
from fecm.deck.units import prefixed, unit_of
from fecm.report.content import (
    Answer,
    PageBlock,
    PageSection,
    ReportError,
    ReportPage,
    note_list,
    number_with_unit,
    page_table,
    share,
)
from fecm.results.comparison import Comparison, Measurement, compare_force, measurement_of
from fecm.results.result import Result
from fecm.results.written import PageOptions


class ForceComparisons(NamedTuple):
    """Measured force, and how the forces of runs compare with it."""

    measured: Measurement
    by_run: dict[str, Comparison]
    notes: tuple[str, ...]  # doubts about record and trigger


def compare_forces(results: Mapping[str, Result], options: PageOptions) -> ForceComparisons | None:
    """Compare runs with the measured force of the options; None if there is none.

    Raises ReportError if its description is given without it, and StudyError if it is invalid.
    """
    described = options.columns or options.units or options.delay or options.offset
    if options.measured is None:
        if described:
            raise ReportError(
                "columns, units, delay and offset describe a measured force; give measured too"
            )
        return None
    first = next(iter(results.values()))
    columns, units = options.columns or (), options.units or ()
    measured = measurement_of(options.measured, first.units, columns, units)
    measured = measured.corrected(options.delay, options.offset)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", FecmWarning)
        by_run = {name: compare_force(result, measured) for name, result in results.items()}
    notes = dict.fromkeys(str(warning.message) for warning in caught)
    return ForceComparisons(measured, by_run, tuple(notes))


def overlay_of(options: PageOptions) -> dict[str, Any]:
    """Return the options of the picture of the force that draw a measured force over it."""
    if options.measured is None:
        return {}
    return {
        "overlay": options.measured,
        "columns": options.columns or (),
        "units": options.units or (),
        "delay": options.delay,
        "offset": options.offset,
    }


def with_measured_force(
    page: ReportPage, compared: ForceComparisons, options: PageOptions
) -> ReportPage:
    """Return the page of runs with what a measured force says of them."""
    section = PageSection("Measured force", tuple(_tables(compared, options)))
    return page._replace(
        verdict=(*page.verdict, *_answers(compared)), sections=(section, *page.sections)
    )


def _answers(comparisons: ForceComparisons) -> Iterator[Answer]:
    """Say how the forces of runs compare with the measured force."""
    several = len(comparisons.by_run) > 1
    doubt = f"; {comparisons.notes[0]}" if comparisons.notes else ""
    for name, compared in comparisons.by_run.items():
        peak, impulse, duration = (f"{ratio:.3g}" for ratio in _ratios(compared))
        others = f"impulse {impulse}, duration {duration}, correlation {compared.correlation:.3f}"
        whose = f"{name}, computed" if several else "Computed"
        yield Answer(f"{whose} over measured", f"peak {peak}", f", {others}{doubt}.")


def _ratios(compared: Comparison) -> list[float]:
    """Return the ratios of peak, impulse and duration, computed over measured."""
    pairs = (
        (compared.peak, compared.measured_peak),
        (compared.impulse, compared.measured_impulse),
        (compared.duration, compared.measured_duration),
    )
    return [computed / measured if measured else math.nan for computed, measured in pairs]


def _tables(comparisons: ForceComparisons, options: PageOptions) -> Iterator[PageBlock]:
    """Yield a table of the forces of runs beside a measured force, and one about the record."""
    measured, by_run = comparisons.measured, comparisons.by_run
    several = len(by_run) > 1
    rows: list[Row] = []
    for name, compared in by_run.items():
        of_run = f", {name}" if several else ""
        units = dict(compared.units)
        sizes = (
            (f"peak of the {measured.quantity}", compared.peak, compared.measured_peak, "force"),
            ("impulse", compared.impulse, compared.measured_impulse, "force*time"),
            ("time above 5 % of the peak", compared.duration, compared.measured_duration, "time"),
        )
        for (text, computed, value, dimension), ratio in zip(sizes, _ratios(compared), strict=True):
            unit = unit_of(dimension, units)
            cells = (number_with_unit(computed, unit), number_with_unit(value, unit))
            rows.append((f"{text}{of_run}", *cells, number_with_unit(ratio, digits=3)))
        force = unit_of("force", units)
        rms = number_with_unit(compared.rms, force)
        rows += [
            (f"rms of the difference{of_run}", rms, "", share(compared.rms / compared.measured_peak)
             if compared.measured_peak else ""),
            (f"correlation{of_run}", number_with_unit(compared.correlation), "", ""),
        ]  # fmt: skip
    header = ("quantity", "computed", "measured", "computed over measured")
    yield from page_table(rows, header, "The measured force beside the run")
    units = dict(next(iter(by_run.values())).units)
    compared = next(iter(by_run.values()))
    record: list[Row] = []
    if measured.record.file:
        record += [("file", measured.record.file), ("SHA-256", measured.record.sha256)]
    begin, end = (prefixed(t, unit_of("time", units)) for t in (compared.begin, compared.end))
    record.append(("points", f"{compared.points}, from {begin} to {end} of the run"))
    for text, value, dimension in (
        ("delay, subtracted", options.delay, "time"),
        ("offset, subtracted", options.offset, "force"),
    ):
        if value:
            record.append((text, number_with_unit(value, unit_of(dimension, units))))
    yield from page_table(record, title="The record")
    yield from note_list(comparisons.notes, "Notes of the comparison")
