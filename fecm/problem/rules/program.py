"""Rules about the macro program: its length, what it stores, and whether anything moves."""

from __future__ import annotations

import numpy as np

from fecm.deck import model
from fecm.deck.macros import MOST_MACROS, Body, Loop, every, flat
from fecm.deck.model import Macro
from fecm.deck.rules import Report, Reports, Subject, rule
from fecm.mechanics.ply_stresses import is_complete
from fecm.problem.problem import Problem

LARGE_OUTPUT = 10**9
# Macros that move the plate or find its modes, and those that store its displacements.
MOVE = {"RODP", "EXCD", "SOLV", "EIGE"}
STORE = {"DISP", "STRE", "REAC"}
OF_AN_IMPACT: tuple[type[model.Segment], ...] = (model.Impact, model.Indentation, model.Projectile)


@rule("E509", Subject.PROGRAM)
def endless_program(problem: Problem) -> Reports:
    """The program executes too many macros.

    Remedy: Nested LOOPs multiply.
    """
    if problem.work.macros > MOST_MACROS:
        # 0.8 ms at start-up; the number may be beyond all floats.
        from decimal import Context, Decimal

        count = Decimal(problem.work.macros).normalize(Context(prec=3))
        message = f"The program executes {count:g} macros, more than {MOST_MACROS:g}."
        place = problem.deck.macros[0].place("macro")
        yield Report(message, place, "nested LOOPs multiply")


@rule("W510", Subject.PROGRAM)
def nothing_stored(problem: Problem) -> Reports:
    """A macro stores every N steps or passes, but there are fewer.

    Remedy: A smaller N.
    """
    sizes = problem.work
    for macro in flat(problem.program):
        if macro.word == "RODP" and every(macro) > max(1, sizes.steps):
            what = f"RODP stores every {every(macro)} steps"
            message = f"{what}, but the program takes only {sizes.steps}: no strains are stored."
            yield Report(message, macro.place("value"))
        if macro.word in ("DISP", "STRE", "PLYS", "FAIL") and not sizes.passes[macro.word]:
            what = f"{macro.word} stores every {every(macro)} passes"
            message = f"{what}, but no loop has so many: nothing is stored."
            yield Report(message, macro.place("value"))


@rule("W511", Subject.PROGRAM)
def idle_program(problem: Problem) -> Reports:
    """The program takes no step and stores nothing.

    Remedy: Add macros.
    """
    if not problem.work.steps and not any(problem.work.passes.values()):
        macros = problem.deck.macros
        place = macros[0].place("macro") if macros else None
        yield Report("The program takes no step and stores nothing.", place)


def macros_of(problem: Problem, *words: str) -> list[Macro]:
    """Return the macros of a program that have one of some words."""
    return [macro for macro in flat(problem.program) if macro.word in words]


@rule("W449", Subject.POINTS)
def ply_stresses_under_point_force(problem: Problem, cards: list[Macro]) -> Reports:
    """Ply stresses under a point force grow without limit.

    They depend on the mesh: the finer it is, the larger they are.

    Remedy: PATC.
    """
    if problem.has_impact and problem.patch is None:
        message = "Ply stresses under a point force grow without bound as the mesh is refined."
        hint = "a PATC segment gives the contact force an area"
        yield Report(message, cards[0].place("macro"), hint)


@rule("W450", Subject.POINTS)
def no_interlaminar_stresses(problem: Problem, cards: list[Macro]) -> Reports:
    """Elements without nine nodes have no interlaminar stresses.

    They are NaN.

    Remedy: 9-node quadrilaterals.
    """
    incomplete = np.flatnonzero(~is_complete(problem.mesh.elements))
    if len(incomplete):
        what = f"Interlaminar stresses of {len(incomplete)} elements without nine nodes"
        message = f"{what} are not computed (element {incomplete[0] + 1} first): they are NaN."
        yield Report(message, cards[0].place("macro"))


@rule("E448", Subject.POINTS)
def wrong_number_of_elements(problem: Problem, cards: list[Macro]) -> Reports:
    """The number of elements of PLYS can't be taken.

    There are fewer elements, several cards have different numbers, or the nearest ones are asked
    for without a load.

    Remedy: 0 or a blank takes all.
    """
    numel = problem.deck.control.numel
    for card in cards:
        if card.second > numel:
            message = f"PLYS takes {card.second:g} elements; the deck has {numel}."
            yield Report(message, card.place("second value"), "0 or a blank takes all elements")
        elif card.second != cards[0].second:
            message = "The PLYS cards take different numbers of elements."
            yield Report(message, card.place("second value"), "give each the same number")
    if cards[0].second and not problem.has_impact and problem.patch is None:
        message = "PLYS takes the elements nearest to the load, but nothing hits the plate."
        hint = "leave the number blank for all elements"
        yield Report(message, cards[0].place("second value"), hint)


@rule("W512", Subject.PROGRAM)
def large_result(problem: Problem) -> Reports:
    """The result will be large.

    The macro that stores most of it is marked.

    Remedy: A larger N of that macro; fewer elements of PLYS.
    """
    if problem.output_bytes <= LARGE_OUTPUT:
        return
    word = max(problem.stored_bytes, key=problem.stored_bytes.__getitem__)
    share = problem.stored_bytes[word]
    message = (
        f"The result will take {problem.output_bytes / 1e9:.3g} GB, {share / 1e9:.3g} GB of "
        f"them for {word}."
    )
    storing = next(iter(macros_of(problem, word)), None)
    hint = f"{word} stores every N steps: take a larger N"
    if word == "PLYS":
        hint += ", or only the M elements nearest to the load: PLYS,,N,M"
    yield Report(message, storing.place("value") if storing else None, hint)


def _movers(problem: Problem) -> set[str]:
    """Return the words of the program that move the plate."""
    return MOVE & {macro.word for macro in problem.deck.macros}


def _unused_segment(problem: Problem) -> model.Segment | None:
    """Return the first segment of an impact in a deck whose program has no RODP."""
    segments = (problem.deck.last(kind) for kind in OF_AN_IMPACT)
    return next((segment for segment in segments if segment is not None), None)


def _storing_at_rest(problem: Problem) -> Macro | None:
    """Return the first macro that stores or steps in a program that moves nothing."""
    movers = _movers(problem)
    if not movers <= {"EXCD"} or problem.mesh.forces.any():
        return None
    return next((macro for macro in problem.deck.macros if macro.word in STORE | movers), None)


def _without_impact(segment: model.Segment) -> str:
    return f"The deck has a {segment.keyword} segment, but its program has no RODP"


NO_RODP_HINT = "RODP takes an impact step; use it instead of EXCD"


@rule("E519", Subject.PROGRAM)
def plate_at_rest(problem: Problem) -> Reports:
    """ROD, EXPE or PROJ lack RODP, and nothing moves the plate.

    Remedy: RODP instead of EXCD.
    """
    segment, stored = _unused_segment(problem), _storing_at_rest(problem)
    if segment is not None and stored is not None:
        what = _without_impact(segment)
        message = f"{what}: the plate never moves, and all results would be 0."
        yield Report(message, stored.place("macro"), NO_RODP_HINT)


@rule("W520", Subject.PROGRAM)
def nothing_hits(problem: Problem) -> Reports:
    """ROD, EXPE or PROJ lack RODP, and EXCD moves the plate: nothing hits it.

    Statics and natural modes of a plate do not need its impact, and are not doubted.

    Remedy: RODP, or remove the segments.
    """
    segment = _unused_segment(problem)
    if segment is not None and _storing_at_rest(problem) is None and "EXCD" in _movers(problem):
        message = f"{_without_impact(segment)}: nothing hits the plate."
        yield Report(message, segment.place(), NO_RODP_HINT)


@rule("W518", Subject.PROGRAM)
def projectile_stands_still(problem: Problem) -> Reports:
    """EXCD is used beside RODP.

    The projectile stands still during EXCD.

    Remedy: RODP only.
    """
    if steps := macros_of(problem, "EXCD"):
        message = "EXCD moves the plate but not the projectile, which is at rest during the step."
        yield Report(message, steps[-1].place("macro"), "RODP applies the loads of FORC too")


# State after a word, by the state before it: 0 before impact steps, 1 after an impact step, 2 after
# a static solution that follows a step, 3 if a step follows that solution.
States = tuple[int, ...]
STATES: dict[str, States] = {"RODP": (1, 1, 3, 3), "SOLV": (0, 2, 2, 3)}
SAME: States = (0, 1, 2, 3)


def _states_after(body: Body) -> States:
    """Return the states after a body of the program, by the states before it."""
    states = SAME
    for item in body:
        change, passes = SAME, 1
        if isinstance(item, Loop):  # the states no longer change after three passes
            change, passes = _states_after(item.body), min(item.count, 3)
        elif item.word in STATES:
            change = STATES[item.word]
        for _ in range(passes):
            states = tuple(change[state] for state in states)
    return states


@rule("W563", Subject.PROGRAM)
def static_solution_in_impact(problem: Problem) -> Reports:
    """A static solution (SOLV) stands between impact steps.

    It moves the plate at once to its equilibrium without the contact force, away from the
    projectile or into it.

    Remedy: SOLV before the first RODP or after the last.
    """
    if _states_after(problem.program)[0] == 3:
        last = [macro for macro in problem.deck.macros if macro.word == "SOLV"][-1]
        message = "SOLV between impact steps moves the plate at once, but not the projectile."
        yield Report(message, last.place("macro"), "solve before the first RODP, or after the last")


OF_LENGTH = (endless_program,)
OF_OUTPUT = (nothing_stored, idle_program, large_result)
OF_STRESSES = (ply_stresses_under_point_force, no_interlaminar_stresses)
OF_PLY_STRESSES = (wrong_number_of_elements,)
WITH_IMPACT = (projectile_stands_still, static_solution_in_impact)
WITHOUT_IMPACT = (plate_at_rest, nothing_hits)
