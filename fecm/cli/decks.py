"""Commands about decks: ``fecm check``, ``fmt``, ``new`` and ``materials``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

from fecm._files import check_outputs
from fecm.api import load_deck
from fecm.cli.common import (
    DECK_PATH,
    FORMAT_OPTION,
    MODE_OPTION,
    CheckFailedError,
    RefusedError,
    count_errors,
    echo,
    echo_file,
    write_text,
)
from fecm.cli.new import OptionError, deck_of_options
from fecm.cli.types import Finite
from fecm.deck.catalogue import MATERIALS
from fecm.deck.findings import DeckError
from fecm.deck.format import format_deck
from fecm.deck.reader import load_text
from fecm.problem.summary import summarise


@click.command(short_help="Check DECK without running it, and summarise it.")
@click.argument("deck", type=DECK_PATH)
@MODE_OPTION
@FORMAT_OPTION
def check(deck: Path, mode: str, form: str) -> None:
    """Read and check DECK without running it: findings, then a summary.

    With --format json, one JSON object per finding and per problem, each on a line.  Exit status 1
    if the deck has errors.
    """
    prepared = load_deck(deck, mode)
    errors = prepared.errors()
    views = [] if errors else [summarise(problem) for problem in prepared.problems]
    if form == "json":
        for finding in prepared.findings:
            click.echo(json.dumps(finding.to_dict(str(deck))))
        for view in views:
            click.echo(json.dumps({"kind": "summary", **view.to_dict()}))
    else:
        for finding in prepared.findings:
            echo(finding.render(str(deck)))
        for view in views:
            echo("\n".join(view.lines()))
    if errors:
        raise CheckFailedError(count_errors(errors))


@click.command(short_help="Align the columns of DECK.")
@click.argument("deck", type=DECK_PATH)
@click.option("-o", "--output", type=click.Path(path_type=Path, allow_dash=True), metavar="FILE",
              help="Where to write; - is standard output.  [default: DECK itself]")  # fmt: skip
@click.option("--check", "only_check", is_flag=True,
              help="Write nothing; exit with 1 if the deck would change.")  # fmt: skip
@click.option("--overwrite", is_flag=True, help="Replace another FILE that exists.")
def fmt(deck: Path, output: Path | None, only_check: bool, overwrite: bool) -> None:
    """Align the columns of DECK and put a ruler above each kind of card.

    The model, comments and blank cards stay as they are.
    """
    target = deck if output is None or _same(output, deck) else output
    in_place = target is deck
    if not only_check and str(target) != "-":
        check_outputs([target], overwrite or in_place, [] if in_place else [deck])
    before, _ = load_text(deck)
    try:
        after = format_deck(before, str(deck))
    except DeckError as error:
        echo(error, err=True)
        raise RefusedError("the deck can't be read; nothing was written") from None
    if only_check:
        if after != before:
            raise CheckFailedError(f"{deck} would change")
    elif str(target) == "-":
        echo_file(after)
    else:
        write_text(target, after, overwrite=overwrite or in_place)


def _same(one: Path, other: Path) -> bool:
    """Whether two paths lead to one file."""
    return one.exists() and one.samefile(other)


@click.command(short_help="Write a deck from plate, layup, supports and impact.")
@click.argument("output", type=click.Path(path_type=Path, allow_dash=True), metavar="DECK")
@click.option("--title", default="", help="Title of the deck.")
@click.option("--size", metavar="LXxLY", help="Size of the plate, as in 6x4.")
@click.option("--mesh", metavar="NXxNY", help="Elements along x and y, as in 14x10.")
@click.option("--grading", type=Finite(min=1.0), default=1.0, metavar="RATIO",
              help="Largest over smallest element; the smallest at the impact point.")  # fmt: skip
@click.option("--columns", metavar="LIST",
              help="Elements along x one by one, as in 3*0.5,8*0.375,3*0.5, instead of --size and "
                   "--mesh.")  # fmt: skip
@click.option("--rows", metavar="LIST", help="The same along y.")
@click.option("--layup", required=True, metavar="LAYUP",
              help='Layup from the struck face, as in "[0/45/0/-45/0]2s".')  # fmt: skip
@click.option("--ply-thickness", type=float, required=True, help="Thickness of a ply.")
@click.option("--ply", metavar="RHO,NU12,E1,E2,G12,G13,G23", help="Constants of a ply.")
@click.option("--material", metavar="NAME",
              help="A named ply instead; `fecm materials` lists them.")  # fmt: skip
@click.option("--units", metavar="SYSTEM",
              help="in-lbf-s, m-N-s or mm-N-s: names the deck's units, and gives a named ply in "
                   "them.  [default for a named ply: its source's]")  # fmt: skip
@click.option("--support", type=click.Choice(["free", "simple", "clamped"]), default="free",
              show_default=True, help="Support of all edges.")  # fmt: skip
@click.option("--edge", "edges", multiple=True, metavar="EDGE=SUPPORT",
              help="Support of one edge: left, right, bottom or top; may be repeated.")  # fmt: skip
@click.option("--at", metavar="X,Y", help="Impact point.  [default: the plate's middle]")
@click.option("--velocity", type=float, required=True, help="Approach velocity.")
@click.option("--law", metavar="K,ALPHA_P,S_P,Q", help="The indentation law.")
@click.option("--contact", metavar="NAME",
              help="A named law instead; `fecm indent contacts` lists them.")  # fmt: skip
@click.option("--projectile", metavar="WHAT",
              help="mass:M, or rod:LENGTH,DIAMETER,E,DENSITY.  [default in lb, in and s: the "
                   "report's rod]")  # fmt: skip
@click.option("--duration", type=float, required=True, help="Time to run.")
@click.option("--dt", type=float, help="Time step.  [default: 0.9 of the critical one]")
@click.option("--every", type=click.IntRange(min=1),
              help="Steps between stored rows.  [default: for about 200 rows]")  # fmt: skip
@click.option("--overwrite", is_flag=True, help="Replace a deck that exists.")
def new(output: Path, overwrite: bool, **options: Any) -> None:
    """Write a ready deck from plate, layup, supports and impact; - is standard output."""
    if str(output) != "-":
        check_outputs([output], overwrite)
    try:
        deck, notes = deck_of_options(**options)
    except OptionError as error:
        raise click.UsageError(str(error)) from None

    text = format_deck(deck.to_text())
    prepared = load_deck(text)
    if errors := prepared.errors():
        for finding in errors:
            echo(finding.render("the new deck"), err=True)
        raise RefusedError("these options do not give a valid deck; nothing was written")
    for note in notes:
        echo(f"fecm: note: {note}", err=True)
    source = "the new deck" if str(output) == "-" else str(output)
    for finding in prepared.findings:
        echo(finding.render(source), err=True)
    if str(output) == "-":
        echo_file(text)
    else:
        write_text(output, text, overwrite=overwrite)
        echo(output)


@click.command()
def materials() -> None:
    """List the named plies of `fecm new`, with their sources."""
    for material in MATERIALS.values():
        ply = material.ply
        click.echo(f"{material.name} ({material.system})")
        click.echo(
            f"  E1 {ply.e1:g}, E2 {ply.e2:g}, NU12 {ply.nu12:g}, G12 {ply.g12:g}, G13 {ply.g13:g}, "
            f"G23 {ply.g23:g}, density {ply.density:g}"
        )
        click.echo(f"  {material.source}{'; ' + material.assumed if material.assumed else ''}")
