"""Report pages of a run, several runs, a sweep, a fit, or a location."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path

from fecm.report.content import ReportError, ReportPage, check_page, with_head, write
from fecm.report.run import run_page
from fecm.results.result import Result
from fecm.results.written import PageOptions, Reported

# Module and function of the page of a single result, by the name of its class.  They are imported
# when they are called: with the rooms below them they take 0.3 s, which pages of runs do not need.
PAGES = {
    "SweepResult": ("fecm.report.sweep", "sweep_page"),
    "Identification": ("fecm.report.identification", "identification_page"),
    "Location": ("fecm.report.location", "location_page"),
}


def digest(path: Path) -> str:
    """Return the SHA-256 of a file."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def page_of(
    results: Mapping[str, Reported],
    digests: Mapping[str, str] | None = None,
    options: PageOptions | None = None,
) -> ReportPage:
    """Return the page about results by name: one or more runs, or one sweep, fit or location.

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
    if options.measured is not None:
        raise ReportError("a measured force is compared with results of runs only")
    if len(results) > 1:
        raise ReportError(
            "a sweep, a fit or a location has a page of its own; give one, or results of runs"
        )
    ((name, only),) = results.items()
    module, function = PAGES[type(only).__name__]
    page: Callable[..., ReportPage] = getattr(import_module(module), function)
    return page(name, only, digests or {}, options)


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
