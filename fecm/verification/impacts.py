"""Impacts on plates and on a fixed target, and quick models of impacts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

import fecm.verification.decks as decks
from fecm._typing import Floats
from fecm.deck import model
from fecm.deck.grid import ElementGrid, refined_sections, uniform_section
from fecm.deck.model import Deck, Impact, Indentation, Patch, Projectile
from fecm.judge.end import Deflection, LastContact, decided, ends, peak_known
from fecm.mechanics.laminate import effective_rigidity, laminate
from fecm.mechanics.quick_models import inelasticity, infinite_plate, static_peak
from fecm.mechanics.solutions import static_stiffness
from fecm.mechanics.time_step import critical_time_step, rounded_time_step
from fecm.problem.generate import generate
from fecm.problem.loading import load_deck, sole_problem
from fecm.problem.parts import build_plate
from fecm.results.result import Result
from fecm.results.run_metrics import start_w_of
from fecm.sweeps.execute import carry_out_plan
from fecm.sweeps.plan import plan
from fecm.verification.case import Value, case
from fecm.verification.parts import ALPHA_CR

V = 100.0  # velocity of the projectiles


def largest_force(result: Result) -> list[float]:
    """Return the largest force and its time."""
    return [result.force.max(), result.time[result.force.argmax()]]


@case
def _rigid_target() -> Sequence[Value]:

    def values(law: Indentation) -> list[float]:
        result = decks.run_of_deck(decks.fixed_target(2.0e-4, V, law, 2e-8, 9000))
        touching = result.time[result.force > 0.0]
        return [
            result.indentation.max(),
            result.force.max(),
            touching[-1],
            result.velocity[-1],
            result.metrics["contact_loop"],
        ]

    elastic = values(decks.elastic(1.0e6))[:-1]  # whose loop has no area
    return elastic + values(Indentation(1.0e6, ALPHA_CR, 0.0, 2.5, "ACR"))


@case
def _end_of_contact() -> Sequence[Value]:
    """Judge runs that end at different phases of a half-sine contact."""
    phase, ones = np.linspace(0.0, np.pi, 20001)[1:-1], np.ones(19999)
    force = np.sin(phase)
    peak = np.maximum.accumulate(force)
    last = LastContact(force, peak, peak, -np.cos(phase), 0.0 * ones, 10.0 * ones)

    def share_with_known_peak(speed: float) -> float:
        """Return the share of the runs that know the peak force, for a velocity of the plate."""
        plate = Deflection(ones, 0.0 * ones, speed * ones, ones, ones)
        return float(peak_known(ends(last, plate)).mean())

    run_ends = ends(last, Deflection(ones, 0.0 * ones, 0.5 * ones, ones, ones))
    # A deflection that still grows, and a deflection that falls with the force.
    growing = np.isfinite(decided(phase, phase, run_ends)).mean()
    falling = np.isfinite(decided(peak, force, run_ends)).mean()
    return [share_with_known_peak(0.5), share_with_known_peak(2.0), growing, falling]


@case
def _free_plate() -> Sequence[Value]:
    """Compute the impact on a free plate that moves as a damped rigid body."""
    grid = ElementGrid(uniform_section(1.0, 2), uniform_section(1.0, 2))
    plate, law = decks.material(decks.isotropic(1e9, 0.3, 2.5e-4), [0.0], 0.2), decks.elastic(1e5)
    deck = decks.struck_plate(grid, plate, Projectile(0, 0, 2.0e-4), V, law, 3e-8, 10000)
    result = decks.run_of_deck(replace(deck, segments=(*deck.segments, model.Damping(2000.0))))
    final = (result.velocity[-1], result.plate_w[-1], result.energy.damping_work[-1])
    return [result.force.max(), *final]


@case
def _infinite_plate() -> Sequence[Value]:
    """Compute the impact on a thin plate of 12 x 12 in that is stiff in shear.

    No reflection returns within 200 us.
    """
    grid = ElementGrid(uniform_section(12.0, 48), uniform_section(12.0, 48))
    plate = decks.material(decks.isotropic(1.0e7, 0.3, 2.5e-4, 13.0), [0.0], 0.1)
    mass, law = Projectile(0, 0, 2.0e-5), decks.elastic(5.0e4)
    result = decks.run_of_deck(decks.struck_plate(grid, plate, mass, V, law, 5e-8, 4000))
    return [*largest_force(result), result.velocity[-1]]


@case
def _supported_plate() -> Sequence[Value]:
    """Compute the impact on a quarter plate with a quarter of the mass and of k.

    Force and impulse are those of the whole plate.
    """
    plate = decks.material(decks.isotropic(1.0e7, 0.3, 2.5e-4), [0.0], 0.03)
    hit = (Projectile(0, 0, 5.0e-6 / 4.0), Impact(1, 3, V), decks.elastic(1.0e5 / 4.0))
    macros = decks.history_program(8e-8, 2500)
    result = decks.run_of_deck(decks.quarter_plate(8, plate, macros, further=hit))
    _, time = largest_force(result)
    # The plate may still reach the projectile, so that the metrics leave the impulse open.
    impulse = result.symmetry_factor * 8e-8 * float(result.force.sum())
    return [result.metrics["peak_force"], impulse, time, result.plate_w.max(), result.velocity[-1]]


@case
def _static_load() -> Sequence[Value]:
    """Compare impacts on a quarter plate under a pressure, and without it."""
    plate = decks.material(decks.isotropic(1.0e7, 0.3, 2.5e-4), [0.0], 0.03)
    hit = (Projectile(0, 0, 5.0e-6 / 4.0), Impact(1, 3, V), decks.elastic(1.0e5 / 4.0))
    steps = decks.history_program(1.2e-7, 800)
    loaded, unloaded = (
        decks.run_of_deck(decks.quarter_plate(4, plate, macros, load, further=hit))
        for load, macros in ((20.0, (*decks.program("TANG FORM SOLV"), *steps)), (0.0, steps))
    )
    start = start_w_of(loaded)
    pairs = [(loaded[name], unloaded[name]) for name in ("force", "indentation", "velocity")]
    pairs.append((loaded.plate_w - start, unloaded.plate_w))
    return [float(np.abs(a - b).max() / np.abs(b).max()) for a, b in pairs]


@case
def _report_impact() -> Sequence[Value]:
    result = decks.run_of_deck(decks.report_impact())
    energy = result.energy
    balance = float(np.abs(energy.balance_error).max()) / float(energy.attributes["initial"])
    first = int(result.force[result.time < 500e-6].argmax())
    return [
        balance,
        _value_at(result, "force", 42e-6),
        _value_at(result, "force", 642e-6),
        _value_at(result, "transducer", 642e-6),
        result.force[first],
        result.time[first],
        *largest_force(result),
    ]


def _value_at(result: Result, name: str, time: float) -> float:
    """Return the value of a history at the step nearest to a time."""
    values: Floats = result[f"history/{name}"]
    return float(values[int(np.abs(result.time - time).argmin())])


@case
def _listing_impact() -> Sequence[Value]:
    result = decks.run_of_deck(decks.report_impact(500), "listing")
    end = result.time[result.force > 0.0][-1]
    return [_value_at(result, "force", 46e-6), _value_at(result, "transducer", 46e-6), end]


@case
def _convolution() -> Sequence[Value]:
    deck = decks.report_impact(1000)
    problem = sole_problem(deck, warns=False)
    swept = carry_out_plan(problem, plan(problem, [{"velocity": 60.0}], history=True)).force
    if swept is None:
        raise ValueError("the sweep has kept no forces")
    slower = tuple(replace(s, velocity=60.0) if isinstance(s, Impact) else s for s in deck.segments)
    full = decks.run_of_deck(replace(deck, segments=slower)).force
    return [np.abs(swept[0] - full).max() / full.max()]


@case
def _patch_impact() -> Sequence[Value]:
    patch = Patch("DISC", 0.125, decks.SIDES[0] / 2.0, decks.SIDES[1] / 2.0)
    middle = 97 * 32 + 49  # middle of 97 by 65 nodes
    hit = (Projectile(0, 0, 0.000181), Impact(middle, 3, 115.0), decks.elastic(1.912e6))
    return largest_force(
        decks.run_of_deck(
            decks.pressed_rectangle(48, patch, decks.history_program(1.0e-7, 1250), *hit)
        )
    )


# A square of 0.256 kg (SI).
SQUARE = decks.isotropic(240e9, 0.3, 1600.0)
SQUARE_THICKNESS = 0.004
SQUARE_K = 8.2641942e9  # contact coefficient


def struck_square(mass: float, end: float) -> Deck:
    """Build the impact at 1 m/s on the middle of the simply supported square, until a time."""
    side, radius = 0.2, 0.002
    sections = refined_sections(side, 12, side / 2.0, 4.0, radius)
    grid = ElementGrid(sections, sections)
    middle = grid.nearest(side / 2.0, side / 2.0)[0]
    segments = (
        decks.restraints(grid, decks.SUPPORTED),
        Projectile(0, 0, mass),
        Impact(middle, 3, 1.0),
        Patch("DISC", radius),
        decks.elastic(SQUARE_K),
        decks.MITC,
        decks.material(SQUARE, [0.0], SQUARE_THICKNESS),
    )
    deck = decks.deck(grid, segments, ())
    dt = rounded_time_step(critical_time_step(build_plate(deck, generate(deck))))
    return replace(deck, macros=decks.history_program(dt, round(end / dt)))


@case
def _small_mass() -> Sequence[Value]:
    dashpot, mass = infinite_plate(1.0, 1.0, 1.0, 1.0), 0.0128
    plate = laminate(SQUARE, [0.0], [SQUARE_THICKNESS])
    parameter = inelasticity(mass, 1.0, SQUARE_K, plate.mass, effective_rigidity(plate))
    return [
        dashpot.peak,
        dashpot.time,
        parameter,
        infinite_plate(mass, 1.0, SQUARE_K, parameter).peak,
        decks.run_of_deck(struck_square(mass, 3e-5)).force.max(),
    ]


@case
def _large_mass() -> Sequence[Value]:
    (problem,) = load_deck(struck_square(1.0, 1e-6).to_text()).problems
    assert problem.contact is not None
    stiffness = static_stiffness(problem.moving_plate, problem.contact)
    return [stiffness, static_peak(5.5, 2.0, 1e9, 2.5e6)]
