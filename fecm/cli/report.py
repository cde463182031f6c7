"""``fecm report``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
from click import option

from fecm.cli.common import RefusedError, echo_path
from fecm.cli.isolation import reads
from fecm.cli.options import (
    DECK_PATH,
    NAMED_PATH,
    Finite,
    GroupedCommand,
    groups_of,
    job_options,
    list_of,
    typical,
)
from fecm.cli.plot import loaded_result, named
from fecm.report.content import check_page
from fecm.results.hdf5_reader import read
from fecm.results.schema import Form
from fecm.results.written import HEAD, MEASURED, OTHER, PageOptions

PAIR = list_of("TIME,FORCE", click.STRING, [2])


@click.command(
    "report",
    cls=GroupedCommand,
    groups=groups_of(PageOptions, {HEAD: [], MEASURED: [], OTHER: []}),
    epilog=typical(
        "fecm report impact-patch.h5",
        'fecm report impact-patch.h5 --client "Example Ltd" --specimen 117 --date 2026-11-28',
        "fecm report impact-patch.h5 --measured measured-force.csv",
        "fecm report thin.h5 thick.h5 -o comparison.html",
    ),
)
@click.argument("results", type=NAMED_PATH, nargs=-1, required=True, metavar="RESULT...")
@job_options(
    PageOptions,
    logo={"type": NAMED_PATH},
    measured={"type": DECK_PATH},
    columns={"type": PAIR},
    units={"type": PAIR},
    delay={"type": Finite()},
    offset={"type": Finite()},
)
@option(
    "-o",
    "--output",
    type=NAMED_PATH,
    metavar="FILE.html",
    help="Report page to write.  [default: RESULT.html in this folder]",
)
@option("--open", "opens", is_flag=True, help="Open the page in the browser.")
@option("--overwrite", is_flag=True, help="Replace an existing report page.")
@reads("results")
def report_command(
    results: tuple[Path, ...],
    options: dict[str, Any],
    output: Path | None,
    opens: bool,
    overwrite: bool,
) -> None:
    """Write a report page about RESULT: a run, a sweep, a location, or several runs side by side.

    The page is self-contained: answers, headline figures, range of the model, numbers, pictures,
    model, checksums and the deck.  It needs no network and no scripts, and prints on A4.
    """
    path = output or Path(f"{results[0].stem}.html")
    page_options = PageOptions(**options)
    inputs = [*results, *filter(None, [options["logo"], options["measured"]])]
    check_page(path, overwrite, inputs)
    from fecm.report.report import digest, write_report

    paths = named(results)
    loaded = {name: loaded_result(read(place, *Form)) for name, place in paths.items()}
    digests = {name: digest(place) for name, place in paths.items()}
    write_report(loaded, path, digests, page_options, overwrite=overwrite)
    echo_path(path)
    if opens and click.launch(str(path)):
        raise RefusedError(f"{path} is written, but no browser could be started")
