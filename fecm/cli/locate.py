"""``fecm locate``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import click
from click import option

from fecm.cli.common import DASH, FAILED, echo, echo_json, every_minute, note
from fecm.cli.decks import load_single
from fecm.cli.interrupts import signals
from fecm.cli.options import (
    DECK_PATH,
    FORMAT_OPTION,
    NAMED_PATH,
    POSITIVE,
    Finite,
    Format,
    collected,
    list_of,
    typical,
)
from fecm.cli.outputs import OutputPaths
from fecm.location.locate import located
from fecm.location.prepare import LocationSettings


@dataclass(frozen=True)
class LocateOptions:
    """Arguments and options of ``fecm locate``."""

    deck: Path
    strains: Path
    region: tuple[float, float, float, float] | None
    grid: float | None
    basis: float | None
    noise: float | None
    shift: bool
    gains: bool
    mass: float | None
    mesh_error: bool
    output: Path | None
    picture: Path | None
    overwrite: bool
    form: Format


@click.command(
    "locate",
    epilog=typical(
        "fecm locate panel-with-gages.inp panel-strains.csv",
        "fecm locate panel-with-gages.inp panel-strains.csv --mass 2e-5 --plot located.png",
    ),
)
@click.argument("deck", type=DECK_PATH)
@click.argument("strains", type=DECK_PATH, metavar="STRAINS.csv")
@option(
    "--region",
    type=list_of("X0,Y0,X1,Y1", Finite(), [4]),
    help="Rectangle that contains the place.  [default: the plate]",
)
@option(
    "--grid",
    type=POSITIVE,
    metavar="LENGTH",
    help="Distance of the places that are tried first.  [default: gives about 126 places]",
)
@option(
    "--basis",
    type=POSITIVE,
    metavar="TIME",
    help="Time between two values of the force.  [default: 1/40 of the record in the search, "
    "then a half or a quarter of it]",
)
@option(
    "--noise",
    type=POSITIVE,
    metavar="STRAIN",
    help="Standard deviation of the strains' errors.  [default: from the residual]",
)
@option(
    "--shift",
    is_flag=True,
    help="Fit the time at which the force may begin: the record begins after the impact.",
)
@option("--gains", is_flag=True, help="Fit the gains of the gages over their geometric mean.")
@option("--mass", type=POSITIVE, help="Mass of the projectile, for a bound of its energy.")
@option(
    "--mesh-error/--no-mesh-error",
    default=True,
    help="Add the error of the mesh to the standard deviations, by a run of elements half as long; "
    "it takes longer than all the rest.  [default: mesh-error]",
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
@collected(LocateOptions)
def locate_command(options: LocateOptions) -> None:
    """Find place and force history of an impact on the plate of DECK from strain gages.

    STRAINS.csv has the columns time and those of the gages (GAGE) of the deck, by their numbers or
    in the deck's order, in the deck's units.  The plate is at rest before time 0.  The exit status
    is 1 if the strains do not determine the place, another place explains them almost as well, or
    the model does not describe them.
    """
    targets = OutputPaths(
        options.output or DASH, options.picture, options.overwrite, options.deck, options.strains
    )
    problem = load_single(options.deck, "locate")
    settings = LocationSettings(
        options.region,
        options.grid,
        options.basis,
        options.noise,
        options.shift,
        options.gains,
        options.mass,
        options.mesh_error,
    )
    with every_minute(lambda minutes: f"fecm: locating for {minutes} min"):
        location = located(problem, options.strains, settings)
    targets.draw("location:location_picture", location)
    if options.output is not None:
        with signals.deferred():
            location.save(options.output, overwrite=options.overwrite)
        note(f"wrote {options.output}")
    note(*location.notes)
    if options.form is Format.JSON:
        echo_json(location.to_dict())
    else:
        echo(location)
    if not location.accepted:
        raise SystemExit(FAILED)
