"""``fecm estimate``."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import click

from fecm._tables import aligned
from fecm.cli.common import DECK_PATH, FORMAT_OPTION, echo, echo_json, note
from fecm.cli.decks import load_single
from fecm.deck.units import unit_names, unit_of
from fecm.problem.problem import Problem
from fecm.studies.estimate import estimate as estimate_problem
from fecm.sweeps.api import carry_out
from fecm.sweeps.plan import plan

# Columns of the table, and their dimensions.
COLUMNS = {
    "peak force": "force", "duration": "time", "threshold": "force", "velocity": "length/time",
    "energy": "force*length",
}  # fmt: skip


@click.command()
@click.argument("deck", type=DECK_PATH)
@FORMAT_OPTION
def estimate(deck: Path, form: str) -> None:
    """Estimate the impact of DECK by models without a mesh, beside the run itself.

    The infinite plate is for small masses, the static plate for large ones.  With a DELA segment,
    velocity and energy are those at which the peak force reaches the delamination threshold.
    The models without a mesh neglect DAMP.
    """
    problem = load_single(deck, "estimate")
    found = estimate_problem(problem)
    rows = [
        {
            "model": model.name, "peak_force": model.impact.peak,
            "duration": model.impact.duration, "threshold": model.threshold,
            "velocity": model.velocity, "energy": 0.5 * found.mass * model.velocity**2,
        }
        for model in found.models
    ]  # fmt: skip
    rows.append(_run(problem, found.mass))
    w, h = found.models[-1].impact.peak / found.stiffness, problem.laminate.thickness
    if w > 0.5 * h:  # not of a free plate, whose stiffness is NaN
        note(f"the static plate deflects by {w / h:.3g} h: beyond h/2 a linear plate is too soft")
    values = {
        "class": found.response, "mass_ratio": found.mass_ratio, "lambda": found.parameter,
        "stiffness": found.stiffness, "models": rows,
    }  # fmt: skip
    if form == "json":
        echo_json(values)
        return
    _print(problem, values)


def _run(problem: Problem, mass: float) -> dict[str, Any]:
    """The row of the run itself, by the kernel of sweeps."""
    threshold = math.nan if problem.threshold is None else problem.threshold.force
    own = carry_out(problem, plan(problem, [{}], history=False))
    velocity = math.nan
    if threshold == threshold:
        found = carry_out(problem, plan(problem, [{}], until=threshold))
        velocity = float(found["found_velocity"][0])
    return {
        "model": "run", "peak_force": float(own["peak_force"][0]),
        "duration": float(own["contact_time"][0]), "threshold": threshold, "velocity": velocity,
        "energy": 0.5 * mass * velocity**2,
    }  # fmt: skip


def _print(problem: Problem, values: dict[str, Any]) -> None:
    names = unit_names(problem.deck)

    def text(value: float, dimension: str) -> str:
        return "-" if math.isnan(value) else f"{value:.5g} {unit_of(dimension, names)}".rstrip()

    echo(problem.deck.title or "(no title)")
    echo(f"  class       M/M_plate = {values['mass_ratio']:.4g}, {values['class']}")
    echo(f"  lambda      {values['lambda']:.4g}")
    free = " (the plate is free: no static model)" if math.isnan(values["stiffness"]) else ""
    echo(f"  stiffness   {text(values['stiffness'], 'force/length')}{free}")
    if problem.damping:
        echo("  damping     in the run only: the models without a mesh neglect DAMP")
    table = [["model", *COLUMNS]]
    for row in values["models"]:
        model, *numbers = row.values()
        table.append([model, *map(text, numbers, COLUMNS.values())])
    for line in aligned(table):
        echo(f"  {line}")
