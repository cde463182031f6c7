"""Values that change the time step and the duration of a deck."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

from fecm.authoring.case import Case, CasesError, check_deck, raise_first
from fecm.deck.findings import Findings
from fecm.deck.macros import STEPS, compile_program, every, flat
from fecm.deck.model import Deck, Macro
from fecm.mechanics.time_step import rounded_time_step, taken_time_step
from fecm.problem.check import check_program
from fecm.problem.problem import Problem

LONGEST_LOOP = 1e15  # passes; the checks reject much shorter programs already
EVERY_NTH = ("RODP", "DISP", "STRE", "PLYS", "OVER")  # macros that act at every N-th step or pass


class Clock(NamedTuple):
    """Rule for the time step of a plate."""

    deck_step: float  # time step of the deck
    rule: Callable[[float], float]  # returns the time step for a critical time step


def clock_of(checked: Problem) -> Clock | None:
    """Return the rule of a deck with DT 0, or with the DT that ``fecm new`` chooses.

    Returns None for any other DT. All cases then take the time step of the deck.
    """
    sizes = {macro.value for macro in flat(checked.program) if macro.word == "DT"}
    if len(sizes) != 1:
        return None
    (dt,) = sizes
    rule = rounded_time_step if dt else taken_time_step
    time_step = rule(checked.critical_time_step)
    return Clock(time_step, rule) if dt in (0.0, time_step) else None


def with_clock(deck: Deck, clock: Clock | None, case: Case) -> Problem:
    """Check the deck of a case; with a clock, its time step first changes to suit its plate."""
    if clock is None:
        return check_deck(deck)
    # DT 0 is below the critical time step of any plate.
    checked = check_deck(with_time_step(deck, 0.0))
    dt = clock.rule(checked.critical_time_step)
    duration = float(case["duration"]) if "duration" in case else None
    timed = with_time_step(deck, dt, clock.deck_step, duration)
    findings = Findings()
    problem = Problem(timed, checked.mesh, compile_program(timed.macros, findings))
    check_program(problem, findings)
    raise_first(findings)
    return problem


@lru_cache(maxsize=8)
def stable_time_step(deck: Deck) -> float:
    """Return the time step that DT 0 takes in a deck."""
    # DT 0 is below the critical time step of any plate.
    return taken_time_step(check_deck(with_time_step(deck, 0.0)).critical_time_step)


def duration_of(checked: Problem) -> float:
    """Return the simulated time of a problem."""
    default_step = taken_time_step(checked.critical_time_step)
    return _length(checked.deck.macros, default_step).duration


def step_of(checked: Problem) -> float:
    """Return the time step of a problem whose steps have one size."""
    size = next(macro.value for macro in flat(checked.program) if macro.word == "DT")
    return size or taken_time_step(checked.critical_time_step)


def lengthened(checked: Problem, factor: float) -> Problem:
    """Return a problem that runs `factor` times as long, with the same time step."""
    deck, default_step = checked.deck, taken_time_step(checked.critical_time_step)
    macros = with_time_step(deck, None, default_step, factor * duration_of(checked)).macros
    return replace(checked, program=compile_program(macros, Findings()))


def with_time_step(
    deck: Deck, dt: float | None, default_step: float = 0.0, duration: float | None = None
) -> Deck:
    """Change the time step of a deck, and the passes of its loops to suit the duration.

    The new time step is `dt`: None keeps every DT, and a value that is not positive changes only
    the DT cards. `duration` is the new duration; None keeps it. `default_step` is the time step
    that DT 0 takes in the deck; it may be 0 if no DT is 0. Macros that store rows keep
    approximately their number of rows. Raises CasesError if loops with whole passes miss the
    duration by more than a step and by more than 1 %.
    """
    before = _length(deck.macros, default_step).duration
    share = 1.0 if duration is None or not before else duration / before
    visits = list(_visits(deck.macros, default_step))
    ratios: dict[int, float] = {}  # new passes over old passes, by the place of the LOOP
    for visit in visits:
        if visit.loop is None or visit.macro.word not in STEPS:
            continue
        if visit.dt > 0.0 and (dt is None or dt > 0.0):
            ratios[visit.loop] = share * (1.0 if dt is None else visit.dt / dt)

    macros = tuple(_adjust_macro(visit, dt, ratios) for visit in visits)
    target, length = share * before, _length(macros, default_step)
    if ratios and abs(length.duration - target) > max(0.01 * target, length.largest_step):
        text = (
            f"the loops of the deck give the duration {length.duration:.6g} instead of {target:.6g}"
        )
        raise CasesError(f"{text}; take all steps in one loop")
    return replace(deck, macros=macros)


class _Visit(NamedTuple):
    """Macro of a program with its loop and time step."""

    macro: Macro
    place: int  # index in the program
    loop: int | None  # place of the innermost LOOP around it
    passes: float  # total number of passes of that loop
    dt: float  # time step


def _visits(cards: Sequence[Macro], default_step: float) -> Iterator[_Visit]:
    loops: list[tuple[int, float]] = []  # place and passes of the open loops
    dt = 0.0
    for place, macro in enumerate(cards):
        if macro.word == "NEXT" and loops:
            loops.pop()
        elif macro.word == "DT":
            dt = macro.value or default_step
        loop, passes = loops[-1] if loops else (None, 1.0)
        yield _Visit(macro, place, loop, passes, dt)
        if macro.word == "LOOP":
            loops.append((place, passes * max(1.0, macro.value)))


def _adjust_macro(visit: _Visit, dt: float | None, ratios: dict[int, float]) -> Macro:
    """Return the macro for another time step and other passes of the loops."""
    macro = visit.macro
    if macro.word == "DT" and dt is not None:
        return replace(macro, value=dt, source=None)
    if macro.word == "LOOP" and visit.place in ratios:
        count = min(max(1.0, macro.value) * ratios[visit.place], LONGEST_LOOP)
        return replace(macro, value=float(max(1, math.ceil(count - 1e-9))), source=None)
    if macro.word in EVERY_NTH and visit.loop in ratios:
        ratio = ratios[visit.loop]
        count = min(every(macro) * ratio, LONGEST_LOOP)
        changed = replace(macro, value=float(max(1, round(count))), source=None)
        first = float(math.ceil(min(macro.second * ratio, LONGEST_LOOP)))
        return replace(changed, second=first) if macro.word == "OVER" else changed
    return macro


class _Length(NamedTuple):
    """Simulated time of a program, and its largest time step."""

    duration: float
    largest_step: float


def _length(macros: Sequence[Macro], default_step: float) -> _Length:
    steps = [visit for visit in _visits(macros, default_step) if visit.macro.word in STEPS]
    duration = sum(visit.passes * visit.dt for visit in steps)
    return _Length(duration, max((visit.dt for visit in steps), default=0.0))
