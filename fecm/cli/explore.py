"""``fecm explore``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
from click import option

from fecm.authoring.values import PLATE_NAMES
from fecm.cli.common import RefusedError, echo_path, inform
from fecm.cli.decks import refusing_errors
from fecm.cli.options import (
    DECK_PATH,
    NAMED_PATH,
    GroupedCommand,
    Parsed,
    groups_of,
    job_options,
    list_of,
    typical,
)
from fecm.exploration.explore import Exploration, check_page

PAIR = list_of("TIME,FORCE", click.STRING, [2])
NAMED = [f"{name}=" for name in PLATE_NAMES]


@click.command(
    "explore",
    cls=GroupedCommand,
    groups=groups_of(Exploration, {"Page": ["output", "opens", "overwrite"]}),
    epilog=typical(
        "fecm explore drop-weight-held.inp",
        "fecm explore drop-weight-held.inp --vary ply_thickness=.125,.184 -o plies.html --open",
        "fecm explore drop-weight-held.inp --modes 60 -o places.html",
    ),
)
@click.argument("deck", type=DECK_PATH)
@job_options(
    Exploration,
    vary={"type": Parsed(str, "NAME=VALUES", NAMED, ("FROM:TO:N", "A,B,C")), "multiple": True},
    overlay={"type": DECK_PATH},
    columns={"type": PAIR},
    units={"type": PAIR},
    modes={"type": click.IntRange(min=0)},
)
@option(
    "-o",
    "--output",
    type=NAMED_PATH,
    metavar="FILE.html",
    help="Page to write.  [default: the deck's name with -explore.html, in this folder]",
)
@option("--open", "opens", is_flag=True, help="Open the page in the browser.")
@option("--overwrite", is_flag=True, help="Replace an existing page.")
def explore_command(
    deck: Path, options: dict[str, Any], output: Path | None, opens: bool, overwrite: bool
) -> None:
    """Write a page on which the impact of DECK follows sliders.

    Energy, mass, contact and toughness move, and with them force, deflection, the energy from which
    the plate delaminates, and the chance that it does.  The page is one file with the kernel of the
    sweeps inside: it opens in a browser, from a folder or a mail, without a network.  It says how
    far the model holds, and the command that computes each state again.  A plate with NONL is
    reduced to bending modes, and compared with full runs before the page is written.  With --modes,
    a click moves the impact on a linear plate.
    """
    path = output or Path(f"{deck.stem}-explore.html")
    check_page(path, overwrite, [deck, *filter(None, [options["overlay"]])])
    with refusing_errors("; no page was written"):
        page = Exploration(deck, **options)
    inform(*filter(None, [page.price]))
    page.save(path, overwrite=overwrite)
    echo_path(path)
    if opens and click.launch(str(path)):
        raise RefusedError(f"{path} is written, but no browser could be started")
