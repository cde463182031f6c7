"""Numerics of a new deck: contact patch, shear, kinematics, time step and program."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fecm.authoring.contact import parse_patch
from fecm.authoring.deck_options import (
    AUTO,
    EQUI,
    LIMIT,
    LINEAR,
    MITC,
    VON_KARMAN,
    DeckOptions,
    ImpactOptions,
    Kinematics,
)
from fecm.authoring.parameters import ObjectError, check_positive
from fecm.deck import model
from fecm.deck.macros import EXTENDED, TESTS, steps_of_plies, with_outputs
from fecm.deck.model import Allowables, Deck, Macro, Patch, Shear
from fecm.deck.units import quantity, unit_names, unit_of
from fecm.judge.validity import IN_PLANE_WORDS
from fecm.mechanics.plate import UnsoundPlateError
from fecm.mechanics.points import HERTZ
from fecm.mechanics.time_step import critical_time_step, rounded_time_step
from fecm.problem.estimates import (
    compliances_on_window,
    contact_duration,
    static_deflection,
)
from fecm.problem.generate import generate
from fecm.problem.loading import load_deck
from fecm.problem.parts import build_plate, has_assumed_shear
from fecm.problem.problem import Problem

ROWS = 200  # default number of evaluations of the failure criteria
# By default there is a row of displacements at every second evaluation, and a row of strains, which
# take most of the file, at every fourth.
EVERY = {"DISP": 2, "RODP": 4}

# Elements around the load, which store ply stresses with `damage`. Their largest distance is a
# multiple of the distance within which plate theory fails. There is also a least number of them.
AROUND_LOAD = 3.0
FEWEST_ELEMENTS = 24


def contact_patch(options: DeckOptions, system: str | None) -> Patch | None:
    """Return the contact patch; the default is Hertz's if a standard prescribes the test."""
    if options.patch == AUTO:
        return Patch(HERTZ) if options.test else Patch()
    if isinstance(options.patch, str):
        return parse_patch(options.patch, system)
    return options.patch


def shear_segment(options: DeckOptions) -> Shear | None:
    """Return the SHEA segment; None for the report's shear stiffness and quadrature."""
    factor, assumed = options.shear_factor, options.shear == MITC
    if factor is None:
        factor = EQUI if assumed else 1.0
    if factor == EQUI:
        return Shear(assumed=assumed, equilibrium=True)
    if isinstance(factor, str):
        raise ObjectError(f"`shear_factor` is {factor!r}, not a number or {EQUI}")
    check_positive(shear_factor=factor)
    return Shear(factor, assumed=assumed) if assumed or factor != 1.0 else None


def chosen_time_step(options: ImpactOptions, deck: Deck) -> float:
    """Return 0.9 of the critical time step."""
    mesh = generate(deck)
    if not mesh.number_of_equations:
        return 1.0  # the deck is refused later
    try:
        return rounded_time_step(critical_time_step(build_plate(deck, mesh)))
    except UnsoundPlateError:
        if load_deck(replace(deck, macros=impact_program(options, deck, 1.0, 1.0))).errors():
            return 1.0  # the deck is refused later
        raise


def impact_program(
    options: ImpactOptions,
    deck: Deck,
    dt: float,
    duration: float,
    elements: int | None = None,
    *,
    until_over: bool = False,
) -> tuple[Macro, ...]:
    """Return the macro program of an impact.

    By default it stores ply stresses in `elements` elements; None stores no ply stresses.
    `until_over` ends it once the impact is over, after at most EXTENDED times the duration.
    """
    steps = max(1, math.ceil(duration / dt - 1e-9))
    rows, every = max(1, steps // ROWS), EVERY
    if deck.has(model.OneSidedSupports):  # the summary has the largest forces of their rows
        every = {**EVERY, "DISP": 1}
    if options.every is not None:
        rows, every = options.every, dict.fromkeys(EVERY, 1)
    words = {"LMAS": 0.0, "DT": dt, "LOOP": float(steps), "TIME": 0.0}
    words |= {word: float(every[word] * rows) for word in ("RODP", "DISP")} | {"NEXT": 0.0}
    macros = [Macro(word, value=value) for word, value in words.items()]
    failure = deck.has(Allowables) if options.failure is None else options.failure
    if failure is True:
        failure = rows
    plies = options.plies
    if plies is None and elements is not None:
        plies = (steps_of_plies(steps, rows), elements)
    macros = list(with_outputs(macros, failure=failure, plies=plies))
    if until_over:
        macros[2] = Macro("LOOP", value=float(EXTENDED * steps))
        macros.insert(-1, Macro("OVER", value=float(max(1, steps // TESTS))))
    return tuple(macros)


def with_impact_program(
    options: ImpactOptions, structure: SupportedDeck, dt: float, duration: float | None
) -> Deck:
    """Return the deck with its program. By default it ends once the impact is over.

    With `damage` and strengths the program also stores ply stresses around the load.
    """
    deck = structure.deck
    if options.precision == "single":
        deck = replace(deck, segments=(*deck.segments, model.Compact()))
    with_plies = options.damage and deck.has(Allowables)
    elements, until_over = None, duration is None
    if duration is None or with_plies:
        problem = structure.problem or problem_of(deck)
        if problem is None:  # the deck is refused later
            return replace(deck, macros=impact_program(options, deck, dt, duration or dt))
        duration = contact_duration(problem) if duration is None else duration
        elements = elements_around_load(problem) if with_plies else None
    macros = impact_program(options, deck, dt, duration, elements, until_over=until_over)
    return replace(deck, macros=macros)


def elements_around_load(problem: Problem) -> int:
    """Return the number of elements around the load that include the most stressed plies."""
    near = int((problem.distances < AROUND_LOAD * problem.reach_of_load).sum())
    return min(max(near, FEWEST_ELEMENTS), problem.deck.control.numel)


MOST_ELEMENTS = 20_000  # beyond this mesh size the static deflection would take seconds
# Program of one short step, for checks before the choice of the time step.
BRIEF = (
    Macro("LMAS"),
    Macro("DT", value=1e-9),
    Macro("LOOP", value=1.0),
    Macro("TIME"),
    Macro("RODP", value=1.0),
    Macro("NEXT"),
)


class SupportedDeck(NamedTuple):
    """Deck with its supports, without a program."""

    deck: model.Deck
    comment: str  # comment lines about a window
    notes: list[str]
    problem: Problem | None = None  # of one short step, if the choice of the kinematics needed it


def with_kinematics(
    kinematics: Kinematics, build: Callable[[bool], SupportedDeck]
) -> SupportedDeck:
    """Return the deck with the requested kinematics; with ``"auto"`` the deflection decides.

    `build` returns the deck of a nonlinear plate (True) or of a linear plate (False).
    """
    if kinematics == VON_KARMAN:
        nonlinear = build(True)
        if not has_assumed_shear(nonlinear.deck):
            raise ObjectError(
                f"`kinematics` {VON_KARMAN} needs assumed shear strains: `shear` mitc"
            )
        return nonlinear
    linear = build(False)
    if kinematics == LINEAR:
        return linear
    if linear.deck.control.numel > MOST_ELEMENTS:
        return _with_note(
            linear,
            f"the plate is linear: its static deflection is computed up to {MOST_ELEMENTS} "
            "elements only; `kinematics` von-karman adds the stretching (NONL)",
        )
    problem = problem_of(linear.deck)
    if problem is None:  # the deck is refused later
        return linear
    linear = linear._replace(problem=problem)
    ratio = static_deflection(problem) / problem.judge.thickness
    if not ratio > LIMIT:
        return linear
    estimate = f"the static estimate of the deflection is {ratio:.2g} h, beyond {LIMIT:g} h"
    nonlinear = build(True)
    loaded = load_deck(replace(nonlinear.deck, macros=BRIEF))
    if errors := loaded.errors():
        reason = errors[0].message.rstrip(".")
        return _with_note(
            linear, f"{estimate}, but the plate stays linear, too soft there: {reason}"
        )
    (problem,) = loaded.problems
    edges = IN_PLANE_WORDS.get(problem.judge.in_plane, "u and v held at every node")
    return _with_note(
        nonlinear._replace(problem=problem),
        f"{estimate}: the plate stretches as it bends (NONL), {edges}; `kinematics` linear leaves "
        "it out",
    )


def _with_note(structure: SupportedDeck, note: str) -> SupportedDeck:
    return structure._replace(notes=[*structure.notes, note])


def problem_of(deck: model.Deck) -> Problem | None:
    """Return the problem of one short step of a deck; None for a deck with errors."""
    loaded = load_deck(replace(deck, macros=BRIEF))
    return None if loaded.errors() else loaded.problems[0]


def band_comment(structure: SupportedDeck, tips: Sequence[int]) -> str:
    """Return comment lines with the static flexibility of a plate on a window, held and pushed.

    `tips` are the nodes, from 1, of the tips of clamps. A deck with errors and a very fine mesh
    have no such lines.
    """
    if structure.deck.control.numel > MOST_ELEMENTS:
        return ""
    problem = structure.problem or problem_of(structure.deck)
    if problem is None:
        return ""
    compliances = compliances_on_window(problem, np.array(tips, dtype=int) - 1)
    if compliances is None:
        return ""
    unit, factor = unit_of("length/force", unit_names(structure.deck)), problem.symmetry.factor
    held, pushed, clamped = (quantity(value / factor, unit) for value in compliances)
    softer, stiffer = (f"{value / compliances.held - 1.0:+.1%}" for value in compliances[1:])
    with_clamps = f", with clamps that hold the corners {clamped} ({stiffer})" if tips else ""
    return (
        f"! Static flexibility: {held} with w = 0 along the window; on a window that only pushes\n"
        f"! {pushed} ({softer}){with_clamps}.\n"
    )
