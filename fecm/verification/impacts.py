"""Impacts: on a rigid target, on plates with a series, and the report's experiment."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fecm._typing import Floats
from fecm.api import load_deck
from fecm.deck.grid import Grid, refined, uniform
from fecm.deck.model import Deck, Impact, Patch, Projectile
from fecm.deck.records import Ply
from fecm.mechanics.time_step import critical_time_step, rounded_time_step
from fecm.problem.build import build_plate
from fecm.problem.generate import generate
from fecm.results.result import Result
from fecm.studies.estimate import infinite_plate, static_plate, static_stiffness
from fecm.sweeps.api import carry_out, problem_of
from fecm.sweeps.plan import plan
from fecm.verification import decks
from fecm.verification.case import Value, case
from fecm.verification.plates import SIDES, rectangle

V = 100.0


def peak(found: Result) -> list[float]:
    """Largest force, and its time."""
    return [found.force.max(), found.time[found.force.argmax()]]


@case
def _rigid_target() -> Sequence[Value]:
    """A plate of extreme stiffness and density."""
    grid = Grid(uniform(2.0, 2), uniform(2.0, 2))
    ply = Ply(1.48e6, 0.3, 1.75e16, 1.75e16, 5e15, 5e15, 5e15)
    plate, mass = decks.material(ply, (0.0, 90.0), 0.053), Projectile(0, 0, 2.0e-4)
    law = decks.elastic(1.0e6)
    found = decks.result_of(decks.struck_plate(grid, plate, mass, V, law, 2e-8, 9000))
    touching = found.time[found.force > 0.0]
    return [found.indentation.max(), found.force.max(), touching[-1], found.velocity[-1]]


@case
def _infinite_plate() -> Sequence[Value]:
    """A thin plate of 12 x 12 in, stiff in shear; no reflection returns within 200 us."""
    grid = Grid(uniform(12.0, 48), uniform(12.0, 48))
    plate = decks.material(decks.isotropic(1.0e7, 0.3, 2.5e-4, 13.0), [0.0], 0.1)
    mass, law = Projectile(0, 0, 2.0e-5), decks.elastic(5.0e4)
    found = decks.result_of(decks.struck_plate(grid, plate, mass, V, law, 5e-8, 4000))
    return [*peak(found), found.velocity[-1]]


@case
def _supported_plate() -> Sequence[Value]:
    """A quarter of the plate, with a quarter of mass and contact coefficient."""
    plate = decks.material(decks.isotropic(1.0e7, 0.3, 2.5e-4), [0.0], 0.03)
    hit = (Projectile(0, 0, 5.0e-6 / 4.0), Impact(1, 3, V), decks.elastic(1.0e5 / 4.0))
    macros = decks.impact_program(8e-8, 2500)
    found = decks.result_of(decks.quarter_plate(8, plate, macros, others=hit))
    force, time = peak(found)
    return [4.0 * force, time, found.plate_w.max(), found.velocity[-1]]


@case
def _report_impact() -> Sequence[Value]:
    found = decks.result_of(decks.report_impact())
    energy = found.energy
    balance = float(np.abs(energy.balance_error).max()) / float(energy.attributes["initial"])
    first = int(found.force[found.time < 500e-6].argmax())
    return [
        balance, _at(found, "force", 42e-6), _at(found, "force", 642e-6),
        _at(found, "transducer", 642e-6), found.force[first], found.time[first], *peak(found),
    ]  # fmt: skip


def _at(result: Result, name: str, time: float) -> float:
    """Value of a history at the step nearest to a time."""
    values: Floats = result[f"history/{name}"]
    return float(values[int(np.abs(result.time - time).argmin())])


@case
def _listing_impact() -> Sequence[Value]:
    found = decks.result_of(decks.report_impact(500), "listing")
    end = found.time[found.force > 0.0][-1]
    return [_at(found, "force", 46e-6), _at(found, "transducer", 46e-6), end]


@case
def _convolution() -> Sequence[Value]:
    made = decks.report_impact(1000)
    problem = problem_of(made)
    swept = carry_out(problem, plan(problem, [{"velocity": 60.0}], history=True)).force
    if swept is None:
        raise ValueError("the sweep has kept no forces")
    slower = tuple(replace(s, velocity=60.0) if isinstance(s, Impact) else s for s in made.segments)
    full = decks.result_of(replace(made, segments=slower)).force
    return [np.abs(swept[0] - full).max() / full.max()]


@case
def _patch_impact() -> Sequence[Value]:
    patch = Patch("DISC", 0.125, SIDES[0] / 2.0, SIDES[1] / 2.0)
    middle = 97 * 32 + 49  # of 97 by 65 nodes
    hit = (Projectile(0, 0, 0.000181), Impact(middle, 3, 115.0), decks.elastic(1.912e6))
    return peak(decks.result_of(rectangle(48, patch, decks.impact_program(1.0e-7, 1250), *hit)))


def struck_square(mass: float, end: float) -> Deck:
    """Build a simply supported square of 0.256 kg, hit in the middle at 1 m/s, until a time."""
    side, radius = 0.2, 0.002
    sections = refined(side, 12, side / 2.0, 4.0, radius)
    grid = Grid(sections, sections)
    middle = grid.nearest(side / 2.0, side / 2.0)[0]
    segments = (
        decks.supports(grid, decks.SUPPORTED), Projectile(0, 0, mass), Impact(middle, 3, 1.0),
        Patch("DISC", radius), decks.elastic(8.2641942e9), decks.MITC,
        decks.material(decks.isotropic(240e9, 0.3, 1600.0), [0.0], 0.004),
    )  # fmt: skip
    made = decks.deck(grid, segments, ())
    dt = rounded_time_step(critical_time_step(build_plate(made, generate(made))))
    return replace(made, macros=decks.impact_program(dt, round(end / dt)))


@case
def _small_mass() -> Sequence[Value]:
    model = infinite_plate(1.0, 1.0, 1.0, 1.0)
    return [model.peak, model.time, decks.result_of(struck_square(0.0128, 3e-5)).force.max()]


@case
def _large_mass() -> Sequence[Value]:
    (problem,) = load_deck(struck_square(1.0, 1e-6).to_text()).problems
    assert problem.contact is not None
    stiffness = static_stiffness(problem.moving_plate, problem.contact)
    return [stiffness, static_plate(5.5, 2.0, 1e9, 2.5e6).peak]
