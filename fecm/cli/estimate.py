"""``fecm estimate``."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import click

from fecm._tables import aligned
from fecm.cli.common import echo, echo_json, note
from fecm.cli.decks import load_single
from fecm.cli.help import typical
from fecm.cli.options import DECK_PATH, FORMAT_OPTION, Format
from fecm.deck.units import quantity, unit_names, unit_of
from fecm.problem.problem import Problem
from fecm.results.linear_plate import TOO_SOFT, UNSAFE
from fecm.results.metrics import RATIO
from fecm.results.validity import Judge
from fecm.studies.estimate import Estimate
from fecm.studies.estimate import estimate as estimate_problem
from fecm.sweeps.api import carry_out
from fecm.sweeps.plan import plan


class Row(NamedTuple):
    """A row of the table: a model without a mesh, or the run itself."""

    name: str
    peak: float
    duration: float
    threshold: float
    velocity: float  # at which the peak reaches the threshold
    energy: float  # of this velocity
    applies: bool  # whether the impact is in the range of the model


# Columns of the table, and their dimensions.
COLUMNS = {
    "peak_force": "force",
    "duration": "time",
    "threshold": "force",
    "velocity": "length/time",
    "energy": "force*length",
}


@click.command(
    epilog=typical(
        "fecm estimate drop-weight.inp",
        "fecm estimate impact-115.inp --format json",
    )
)
@click.argument("deck", type=DECK_PATH)
@FORMAT_OPTION
def estimate(deck: Path, form: Format) -> None:
    """Estimate the impact of DECK by quick models, and compare them with the run.

    The infinite plate is for small masses, the static plate for large ones, that of a deck with
    NONL linear and nonlinear; a model out of its range is marked.  With a DELA segment, velocity
    and energy are those at which the peak force reaches the delamination threshold.  The models
    without a mesh neglect DAMP, and the infinite plate neglects PREL.
    """
    problem = load_single(deck, "estimate")
    found = estimate_problem(problem)
    rows = [
        Row(
            model.name,
            model.impact.peak,
            model.impact.duration,
            model.threshold,
            model.velocity,
            0.5 * found.mass * model.velocity**2,
            model.applies,
        )
        for model in found.models
    ]
    own, bent, doubts = _run_itself(problem, found.mass)
    rows.append(own)
    judge = problem.judge
    if not problem.plate.nonlinear:
        static = found.models[-1]
        bent = [
            *_bent("the static plate", static.impact.peak / found.stiffness, judge),
            *_bent("the static plate at the threshold", static.threshold / found.stiffness, judge),
            *bent,
        ]
    if bent:
        note(f"beyond {judge.limit} h {TOO_SOFT}; {UNSAFE}", *bent)
    note(*doubts)
    if form is Format.JSON:
        echo_json(_document(found, rows))
    else:
        echo("\n".join(_page(problem, found, rows)))


def _document(found: Estimate, rows: Sequence[Row]) -> dict[str, object]:
    """JSON of an estimate."""
    models = []
    for row in rows:
        values = dict(zip(COLUMNS, row[1:-1], strict=True))
        models.append({"model": row.name, **values, "applies": row.applies})
    about = {"nonlinear": found.remark} if found.remark else {}
    return {
        "class": found.response,
        "mass_ratio": found.mass_ratio,
        "lambda": found.parameter,
        "stiffness": found.stiffness,
        **about,
        "models": models,
    }


def _page(problem: Problem, found: Estimate, rows: Sequence[Row]) -> list[str]:
    """Lines about an estimate."""
    names = unit_names(problem.deck)

    def text(value: float, dimension: str, missing: str = "-") -> str:
        return missing if math.isnan(value) else quantity(value, unit_of(dimension, names), 5)

    free = " (the plate is free: no static model)" if math.isnan(found.stiffness) else ""
    lines = [
        f"class       M/M_plate = {found.mass_ratio:.4g}, {found.response}",
        f"lambda      {found.parameter:.4g}",
        f"stiffness   {text(found.stiffness, 'force/length')}{free}",
    ]
    if problem.damping:
        lines.append("damping     in the run only: the models without a mesh neglect DAMP")
    if problem.plate.is_preloaded:
        lines.append(
            "preload     in the static plate and the run: the infinite plate neglects PREL"
        )
    if found.remark:
        lines.append(f"stretching  {found.remark}")
    table = [["model", *(name.replace("_", " ") for name in COLUMNS)]]
    for row in rows:
        marked = row.name if row.applies else f"{row.name} (out of range)"
        numbers = row[1:-1]
        # Of the models the duration is known, of the run only if its contact ends.
        missing = ["open", "open", *["-"] * (len(numbers) - 2)]
        table.append([marked, *map(text, numbers, COLUMNS.values(), missing)])
    return [
        problem.deck.title or "(no title)",
        *(f"  {line}" for line in (*lines, *aligned(table))),
    ]


def _run_itself(problem: Problem, mass: float) -> tuple[Row, list[str], list[str]]:
    """Row of the run itself, by the kernel of sweeps, its deflections, and what is open in it."""
    own = carry_out(problem, plan(problem, [{}]))
    swept, doubts = {"the run": own}, []
    threshold = velocity = math.nan
    if problem.threshold is not None:
        threshold = problem.threshold.force
        swept["the run at the threshold"] = carry_out(problem, plan(problem, [{}], until=threshold))
        velocity = float(swept["the run at the threshold"]["found_velocity"][0])
    peak, duration = (float(own[name][0]) for name in ("peak_force", "contact_time"))
    if math.isnan(duration):
        doubts.append("the run ends before its contact does: what is open needs a longer duration")
    doubts += [f"{name}: {one['status'][0]}" for name, one in swept.items() if not one.fine.all()]
    h, judge = problem.judge.thickness, problem.judge
    bent = [text for name, one in swept.items() for text in _bent(name, one[RATIO][0] * h, judge)]
    energy = 0.5 * mass * velocity**2
    row = Row("run", peak, duration, threshold, velocity, energy, applies=True)
    return row, bent, doubts


def _bent(where: str, deflection: float, judge: Judge) -> list[str]:
    """Note about a deflection beyond the linear plate; a free plate has none (NaN)."""
    ratio = deflection / judge.thickness
    if not ratio > judge.limit:
        return []
    return [f"{where} deflects by {ratio:.3g} h: {judge.softness(ratio)}"]
