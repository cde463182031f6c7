"""``fecm identify``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
from click import option

from fecm.cli.common import (
    DASH,
    FAILED,
    TerminalWatch,
    echo,
    echo_json,
    echo_summary,
    every_minute,
    inform,
    note,
)
from fecm.cli.decks import load_single
from fecm.cli.options import (
    COLUMNS_OPTION,
    DECK_PATH,
    FORMAT_OPTION,
    NAMED_PATH,
    UNITS_OPTION,
    Format,
    OneOf,
    Parsed,
    job_options,
    list_of,
    typical,
)
from fecm.cli.outputs import OutputPaths, write_lines
from fecm.deck.units import unit_names
from fecm.identification.identify import FREE, IdentificationJob
from fecm.identification.result import summary_of_fit
from fecm.report.content import check_page
from fecm.studies.rod_test.filters import filter_of


@click.command(
    "identify",
    epilog=typical(
        "fecm identify impact-patch.inp measured-force.csv --free k",
        "fecm identify impact-patch.inp measured-force.csv --free k,velocity --plot fit.png",
    ),
)
@click.argument("deck", type=DECK_PATH)
@click.argument("measured", type=DECK_PATH, metavar="MEASURED.csv")
@option(
    "--free",
    type=list_of("NAME,...", OneOf(FREE)),
    required=True,
    help=f"Parameters to fit: {', '.join(FREE)}.",
)
@COLUMNS_OPTION
@UNITS_OPTION
@job_options(IdentificationJob, filter={"type": Parsed(filter_of, "FILTER")})
@option(
    "-o",
    "--output",
    type=NAMED_PATH,
    metavar="FITTED.inp",
    help="Also write the deck with the fitted values.",
)
@option(
    "--plot",
    "picture",
    type=NAMED_PATH,
    metavar="FILE",
    help="Also draw measured and fitted force and the residual: .png, .svg or .pdf.",
)
@option(
    "--report",
    "page",
    type=NAMED_PATH,
    metavar="FILE.html",
    help="Also write a report page (HTML) about the fit.",
)
@option("--overwrite", is_flag=True, help="Replace existing files.")
@FORMAT_OPTION
def identify_command(
    deck: Path,
    measured: Path,
    free: tuple[str, ...],
    columns: tuple[str, ...] | None,
    units: tuple[str, ...] | None,
    options: dict[str, Any],
    output: Path | None,
    picture: Path | None,
    page: Path | None,
    overwrite: bool,
    form: Format,
) -> None:
    """Fit parameters of the impact of DECK to a measured contact force.

    MEASURED.csv has the columns time and force (or load), which are converted to the deck's units
    if the file names its own.  Time 0 is the first contact, unless delay is fitted.  The deck's
    values are the start of the fit.  The exit status is 1 if the measurement does not determine the
    parameters, the fit does not converge, the model does not describe the data, a delay or an
    offset should be fitted too, or the full run of the fitted deck does not confirm it (NONL).
    """
    targets = OutputPaths(output or DASH, picture, overwrite, deck, measured)
    if page is not None:
        check_page(page, overwrite, [deck, measured])
    problem = load_single(deck)
    job = IdentificationJob(
        problem.deck, measured, free, **options, columns=columns or (), units=units or ()
    )
    watch = TerminalWatch(lambda forces: None)
    with every_minute(lambda minutes: f"fecm: {watch.done} trial forces after {minutes} min"):
        fit = job.execute(watch)
    targets.draw("histories:force_fit_picture", fit, unit_names(problem.deck))
    if output is not None:
        write_lines([fit.deck.to_text()], output, overwrite=overwrite)
        inform(f"wrote {output}")
    if page is not None:
        # 0.5 s with matplotlib, which other fits do not need.
        from fecm.report.report import write_report

        write_report({job.measurement.name: fit}, page, overwrite=overwrite)
        inform(f"wrote {page}")
    if form is Format.JSON:
        echo_json(fit.to_dict())
    else:
        echo_summary(summary_of_fit(fit))
        echo(f"\n{fit.cards()}", whole=True)
    note(*fit.notes)
    if not fit.accepted:
        raise SystemExit(FAILED)
