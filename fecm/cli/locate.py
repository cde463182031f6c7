"""``fecm locate``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
from click import option

from fecm.cli.common import DASH, FAILED, echo_json, echo_summary, every_minute, inform, note
from fecm.cli.decks import load_single
from fecm.cli.interrupts import signals
from fecm.cli.options import (
    DECK_PATH,
    FORMAT_OPTION,
    NAMED_PATH,
    POSITIVE,
    Finite,
    Format,
    job_options,
    list_of,
    typical,
)
from fecm.cli.outputs import OutputPaths
from fecm.location.locate import LocationJob
from fecm.location.location import summary_of_location


@click.command(
    "locate",
    epilog=typical(
        "fecm locate panel-with-gages.inp panel-strains.csv",
        "fecm locate panel-with-gages.inp panel-strains.csv --mass 2e-5 --plot located.png",
    ),
)
@click.argument("deck", type=DECK_PATH)
@click.argument("strains", type=DECK_PATH, metavar="STRAINS.csv")
@job_options(
    LocationJob,
    region={"type": list_of("X0,Y0,X1,Y1", Finite(), [4])},
    grid={"type": POSITIVE},
    basis={"type": POSITIVE},
    noise={"type": POSITIVE},
    mass={"type": POSITIVE},
)
@option(
    "-o",
    "--output",
    type=NAMED_PATH,
    metavar="FILE.h5",
    help="Also write place, force and strains, for fecm info and fecm plot.",
)
@option(
    "--plot",
    "picture",
    type=NAMED_PATH,
    metavar="FILE",
    help="Also draw misfit, force and strains: .png, .svg or .pdf.",
)
@option("--overwrite", is_flag=True, help="Replace existing files.")
@FORMAT_OPTION
def locate_command(
    deck: Path,
    strains: Path,
    options: dict[str, Any],
    output: Path | None,
    picture: Path | None,
    overwrite: bool,
    form: Format,
) -> None:
    """Find place and force history of an impact on the plate of DECK from strain gages.

    STRAINS.csv has a column time and a column for each gage (GAGE), named by its number or in the
    order of the deck.  Times are in the deck's unit.  The plate is at rest before time 0.  The exit
    status is 1 if the strains do not determine the place, another place explains them almost as
    well, or the model does not describe them.
    """
    targets = OutputPaths(output or DASH, picture, overwrite, deck, strains)
    job = LocationJob(load_single(deck).deck, strains, **options)
    with every_minute(lambda minutes: f"fecm: locating for {minutes} min"):
        location = job.execute()
    targets.draw("location:location_picture", location)
    if output is not None:
        with signals.deferred():
            location.save(output, overwrite=overwrite)
        inform(f"wrote {output}")
    if form is Format.JSON:
        echo_json(location.to_dict())
    else:
        echo_summary(summary_of_location(location))
    note(*location.notes)
    if not location.accepted:
        raise SystemExit(FAILED)
