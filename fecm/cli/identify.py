"""``fecm identify``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import click
from click import option

from fecm.cli.common import DASH, FAILED, echo, echo_json, every_minute, note
from fecm.cli.decks import load_single
from fecm.cli.options import (
    COLUMNS_OPTION,
    DECK_PATH,
    FORMAT_OPTION,
    LAW_OPTION,
    NAMED_PATH,
    UNITS_OPTION,
    Format,
    OneOf,
    Parsed,
    collected,
    list_of,
    typical,
)
from fecm.cli.outputs import OutputPaths, write_lines
from fecm.cli.rod import FILTER_HELP
from fecm.deck.model import Deck
from fecm.deck.units import unit_names
from fecm.identification.identify import FREE, fit_deck
from fecm.identification.result import Identification
from fecm.mechanics.own_law import own_law
from fecm.report.content import check_page
from fecm.results.comparison import Measurement, measurement_of
from fecm.studies.rod_test.filters import Filter, filter_of


@dataclass(frozen=True)
class IdentifyOptions:
    """Arguments and options of ``fecm identify``."""

    deck: Path
    measured: Path
    free: tuple[str, ...]
    columns: tuple[str, ...] | None
    units: tuple[str, ...] | None
    sensor: Filter | None
    output: Path | None
    picture: Path | None
    page: Path | None
    overwrite: bool
    form: Format
    law: str | None  # name of a contact law of an installed package


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
@option(
    "--filter",
    "sensor",
    type=Parsed(filter_of, "FILTER"),
    help=f"Filter of the measurement, also applied to the computed force: {FILTER_HELP}",
)
@LAW_OPTION
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
    help="Also write an HTML page about the fit.",
)
@option("--overwrite", is_flag=True, help="Replace existing files.")
@FORMAT_OPTION
@collected(IdentifyOptions)
def identify_command(options: IdentifyOptions) -> None:
    """Fit parameters of the impact of DECK to a measured contact force.

    MEASURED.csv has the columns time and force (or load), which are converted to the deck's units
    if the file names its own.  Time 0 is the first contact, unless delay is fitted.  The deck's
    values are the start of the fit.  The exit status is 1 if the measurement does not determine the
    parameters, the fit does not converge, the model does not describe the data, or a delay or an
    offset should be fitted too.
    """
    output, overwrite = options.output, options.overwrite
    targets = OutputPaths(
        output or DASH, options.picture, overwrite, options.deck, options.measured
    )
    if options.page is not None:
        check_page(options.page, overwrite, [options.deck, options.measured])
    problem = load_single(options.deck, "identify")
    units = unit_names(problem.deck)
    measured = measurement_of(options.measured, units, options.columns or (), options.units or ())
    fit = _fit(problem.deck, measured, options)
    targets.draw("histories:force_fit_picture", fit, units)
    if output is not None:
        write_lines([fit.deck.to_text()], output, overwrite=overwrite)
        note(f"wrote {output}")
    if options.page is not None:
        # 0.5 s with matplotlib, which other fits do not need.
        from fecm.report.report import write_report

        write_report({measured.name: fit}, options.page, overwrite=overwrite)
        note(f"wrote {options.page}")
    note(*fit.notes)
    if options.form is Format.JSON:
        echo_json(fit.to_dict())
    else:
        echo(fit)
    if not fit.accepted:
        raise SystemExit(FAILED)


def _fit(deck: Deck, measured: Measurement, options: IdentifyOptions) -> Identification:
    """Fit, and say once a minute how many forces have been computed."""
    forces = 0

    def computed(more: int) -> None:
        nonlocal forces
        forces += more

    with every_minute(lambda minutes: f"fecm: {forces} trial forces after {minutes} min"):
        law = own_law(options.law)
        return fit_deck(deck, measured, options.free, options.sensor, law, computed)
