"""``fecm modes``."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from itertools import chain
from pathlib import Path

import click
from click import option

from fecm._files import check_outputs
from fecm._text import csv_lines
from fecm.cli.common import echo, echo_json, echo_lines, note
from fecm.cli.decks import refusing_errors
from fecm.cli.options import (
    DECK_PATH,
    NAMED_PATH,
    Finite,
    Format,
    OneOf,
    format_option,
    list_of,
    typical,
)
from fecm.deck.grid import EDGES
from fecm.deck.units import column_name
from fecm.identification.edges import KR, fit_edges
from fecm.mechanics.projectile import LUMPED, MASSES, MassMatrix
from fecm.plot.kinds import PictureKind
from fecm.plot.pictures import check_suffix, draw_entitled, require_matplotlib, save_picture
from fecm.studies.modes import MOST_MODES, ModeJson, PlateModes, modes


@click.command(
    "modes",
    short_help="Find natural frequencies and modes of a plate.",
    epilog=typical(
        "fecm modes drop-weight.inp",
        "fecm modes drop-weight.inp --number 12 --plot modes.png -o modes.h5",
    ),
)
@click.argument("deck", type=DECK_PATH)
@option(
    "--number",
    type=click.IntRange(1, MOST_MODES),
    default=6,
    show_default=True,
    metavar="N",
    help="Number of modes, from the lowest.",
)
@option(
    "--mass",
    type=OneOf([*MASSES]),
    default=LUMPED,
    show_default=True,
    help="Mass matrix; a run has the lumped one.",
)
@option(
    "--held",
    is_flag=True,
    help="Close all one-sided supports (UNIL).  [default: those without a gap]",
)
@option(
    "--plot",
    "picture",
    type=NAMED_PATH,
    metavar="FILE",
    help="Also draw all modes: .png, .svg or .pdf.",
)
@option("-o", "--output", type=NAMED_PATH, metavar="F.h5", help="Also write a result with /modes.")
@option("--overwrite", is_flag=True, help="Replace existing files.")
@format_option(
    Format.TEXT, Format.JSON, Format.CSV, about="Text for people, JSON or CSV for programs."
)
@option(
    "--measured",
    type=list_of("F1,F2,...", Finite()),
    help="Measured frequencies, ascending: fit the stiffness of the edges of a rectangle to them.",
)
@option(
    "--of",
    "numbers",
    type=list_of("N1,N2,...", click.INT),
    help="Numbers of the measured modes.  [default: 1, 2, ...]",
)
@option(
    "--free",
    type=list_of("kr[,kw]", click.STRING),
    default=KR,
    show_default=True,
    help="Stiffness to fit: kr, moment per rotation across an edge and length; kw, force per "
    "deflection and length.",
)
@option(
    "--edges",
    type=list_of("EDGE,...", click.STRING),
    default=",".join(EDGES),
    show_default=True,
    help="Edges that share the stiffness.",
)
def modes_command(
    deck: Path,
    number: int,
    mass: MassMatrix,
    held: bool,
    picture: Path | None,
    output: Path | None,
    overwrite: bool,
    form: Format,
    measured: tuple[float, ...] | None,
    numbers: tuple[int, ...] | None,
    free: tuple[str, ...],
    edges: tuple[str, ...],
) -> None:
    """Find the natural frequencies and modes of the plate of DECK.

    DECK needs no projectile and no program.  Frequencies are in Hz if UNIT names the unit of time.
    The share is the part of a mode in the static flexibility at the impact point; a mode of a small
    share is hardly excited.  Rigid motions of a plate that is not held have the frequency 0.

    --measured fits springs along the edges to frequencies of a tap test, with standard errors, and
    prints the cards of SPRI.
    """
    if measured is not None:
        for value, name in ((picture, "--plot"), (output, "--output"), (held, "--held")):
            if value:
                raise click.UsageError(f"{name} is not for --measured")
        if form is Format.CSV:
            raise click.UsageError("--format csv is not for --measured")
        with refusing_errors("; nothing was fitted"):
            fit = fit_edges(deck, measured, free, edges=edges, of=numbers or (), mass=mass)
        if form is Format.JSON:
            echo_json(fit.to_dict())
        else:
            echo(fit)
        return
    if numbers is not None:
        raise click.UsageError("--of is for --measured")
    if picture is not None:
        require_matplotlib()
        check_suffix(PictureKind.MODES, picture)
    check_outputs([path for path in (picture, output) if path is not None], overwrite, [deck])
    with refusing_errors("; no modes were computed"):
        natural = modes(deck, number, mass=mass, held=held, output=output, overwrite=overwrite)
    if picture is not None:
        drawn = draw_entitled(PictureKind.MODES, {deck.stem: natural.result})
        save_picture(drawn, picture, overwrite=overwrite)
    note(*natural.notes)
    _print(natural, form)


def _csv(natural: PlateModes) -> Iterator[str]:
    """Return the lines of a table of the modes."""
    names = (
        "number",
        column_name("frequency", natural.frequency_unit),
        column_name("period", natural.units.get("time", "")),
        "share",
        "lines_across_x",
        "lines_across_y",
    )
    rows = (
        (mode["number"], mode["frequency"], mode["period"], mode["share"], *_lines(mode))
        for mode in natural.to_dict()["modes"]
    )
    return csv_lines(chain([names], rows))


def _lines(mode: ModeJson) -> Sequence[object]:
    """Return the numbers of nodal lines of a mode, empty where it has none."""
    return mode["nodal_lines"] or ("", "")


def _print(natural: PlateModes, form: Format) -> None:
    """Print the modes in a format."""
    if form is Format.JSON:
        echo_json(natural.to_dict())
    elif form is Format.CSV:
        sys.stdout.writelines(_csv(natural))
    else:
        echo_lines(natural.lines)
