"""Report pages of a run, several runs, a sweep, or a fit."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path

from fecm.identification.result import Identification
from fecm.report.content import ReportError, ReportPage, check_page, with_head, write
from fecm.report.identification import identification_page
from fecm.report.run import run_page
from fecm.report.sweep import sweep_page
from fecm.results.result import Result
from fecm.results.written import PageOptions
from fecm.sweeps.result import SweepResult

Reported = Result | SweepResult | Identification


def digest(path: Path) -> str:
    """Return the SHA-256 of a file."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def page_of(
    results: Mapping[str, Reported],
    digests: Mapping[str, str] | None = None,
    options: PageOptions | None = None,
) -> ReportPage:
    """Return the page about results by name: one or more runs, one sweep, or one fit.

    Raises ReportError if a sweep or a fit is not the only result.
    """
    options = options or PageOptions()
    return with_head(_page_of(results, digests, options), options)


def _page_of(
    results: Mapping[str, Reported], digests: Mapping[str, str] | None, options: PageOptions
) -> ReportPage:
    """Return the page about results, with the deck's title and without particulars."""
    runs = {name: result for name, result in results.items() if isinstance(result, Result)}
    if len(runs) == len(results):
        return run_page(runs, digests or {}, options)
    if len(results) > 1:
        raise ReportError("a sweep has a page of its own; give one sweep, or results of runs")
    ((name, only),) = results.items()
    if isinstance(only, SweepResult):
        return sweep_page(name, only, digests or {})
    assert isinstance(only, Identification)
    return identification_page(name, only)


def write_report(
    results: Mapping[str, Reported],
    path: Path,
    digests: Mapping[str, str] | None = None,
    options: PageOptions | None = None,
    *,
    overwrite: bool,
) -> None:
    """Write the page about results; see :func:`page_of` and :func:`fecm.report.content.write`."""
    check_page(path, overwrite)
    write(page_of(results, digests, options), path, overwrite=overwrite)
