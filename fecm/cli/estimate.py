"""``fecm estimate``."""

from __future__ import annotations

from pathlib import Path

import click

from fecm.cli.common import echo_json, echo_lines, note
from fecm.cli.decks import load_single
from fecm.cli.options import DECK_PATH, FORMAT_OPTION, Format, typical
from fecm.sweeps.estimate import estimate_problem


@click.command(
    "estimate",
    epilog=typical(
        "fecm estimate drop-weight.inp",
        "fecm estimate impact-patch.inp --format json",
    ),
)
@click.argument("deck", type=DECK_PATH)
@FORMAT_OPTION
def estimate_command(deck: Path, form: Format) -> None:
    """Estimate the impact of DECK by quick models, and compare them with the run.

    The infinite plate is for small masses, the static plate for large masses. With NONL the static
    plate is computed linear and nonlinear. A model out of its range is marked. With a DELA segment,
    velocity and energy are the values at which the peak force reaches the delamination threshold.
    The models without a mesh neglect DAMP, and the infinite plate neglects PREL.
    """
    estimate = estimate_problem(load_single(deck))
    note(*estimate.notes)
    if form is Format.JSON:
        echo_json(estimate.to_dict())
    else:
        echo_lines(estimate.lines)
