"""Plan of a sweep: its cases, its tasks, and the memory that they need."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

from fecm import _memory
from fecm._version import __version__
from fecm.deck.macros import Body, Loop, flat
from fecm.deck.model import Boundary, Deck, Delamination, Gages, Impact
from fecm.deck.records import Macro
from fecm.mechanics.kernels import LIBRARY
from fecm.problem.memory import needed_bytes
from fecm.problem.problem import Problem
from fecm.results.metrics import COLUMNS, FOUND, GAGE, SUMMARY
from fecm.results.metrics import THRESHOLD as LIMITED
from fecm.results.result import Result
from fecm.sweeps.cases import (
    CONTACT,
    LAMINATE,
    LOAD,
    PLATE,
    REFINE,
    THRESHOLD,
    Case,
    CasesError,
    Limit,
    check_names,
)
from fecm.sweeps.random_result import check_limits
from fecm.sweeps.sampling import Design
from fecm.sweeps.vary import Clock, apply_case, check_deck, clock_of

Build = Callable[[dict[str, Any]], Deck]
Measure = Callable[[Result], Mapping[str, float]]
TOGETHER = 2048  # cases advanced together
# Bytes per step and case advanced together: above the measured value.
ADVANCED = 34 if LIBRARY is None else 12
COUNT = 25  # velocities of the first round of a search
# Names of columns that are measured on request.
DEFLECTION, GAGES, FAILURE = MEASURES = ("max_deflection", "gages", "failure")


@dataclass(frozen=True)
class Plan:
    """Definition of a sweep."""

    deck: Deck  # deck that is varied
    cases: tuple[Case, ...]  # values of every case
    history: bool = False  # whether contact forces are stored
    # Rule for the time step of each plate; None if the deck's time step applies to all.
    clock: Clock | None = None
    # Peak force whose velocity is searched in every case: a number, or ``"threshold"``.
    until: float | str | None = None
    build: Build | None = None  # makes the deck of a case; `deck` is that of one of the cases
    measure: Measure | None = None  # computes more columns from the result of a case
    extra: tuple[str, ...] = ()  # more columns, of :data:`MEASURES`
    design: Design | None = None  # of random cases
    limits: tuple[Limit, ...] = ()  # whose probability of exceedance is asked for

    @property
    def alone(self) -> bool:
        """Whether every case is run in full."""
        return self.build is not None or self.measure is not None or FAILURE in self.extra

    def fingerprint(self) -> str:
        """Hash that identifies this sweep."""
        parts = [__version__, self.deck.to_text(), self.cases, self.history, TOGETHER, self.until]
        parts += [self.extra] if self.extra else []
        return hashlib.sha256(json.dumps(parts).encode()).hexdigest()


@dataclass(frozen=True)
class Task(Plan):
    """The part of a plan whose cases are run together."""

    number: int = 0  # number of the task
    numbers: tuple[int, ...] = ()  # numbers of the cases


def plan(
    checked: Problem,
    cases: Sequence[Case],
    *,
    history: bool = False,
    until: float | str | None = None,
    build: Build | None = None,
    measure: Measure | None = None,
    extra: Sequence[str] = (),
    design: Design | None = None,
    limits: Sequence[Limit] = (),
) -> Plan:
    """Create the plan of a sweep.

    Raises CasesError if the deck has no impact, there are no cases, names exclude each other, or
    the deck lacks what is searched or measured.
    """
    if not any(macro.word == "RODP" for macro in checked.deck.macros):
        raise CasesError("the deck has no impact step (RODP); there is nothing to sweep")
    if not cases:
        raise CasesError("a sweep needs at least one case")
    if build is None:
        check_names(cases[0])
    if unknown := sorted({*extra} - {*MEASURES}):
        raise CasesError(f"measure has {unknown[0]!r}; the names are {', '.join(MEASURES)}")
    if GAGES in extra and not checked.deck.has(Gages):
        raise CasesError("measure gages: the deck has no strain gages; add a GAGE segment")
    if FAILURE in extra and all(macro.word != "FAIL" for macro in checked.deck.macros):
        raise CasesError("measure failure: the program of the deck has no FAIL; add it to the loop")
    if until is not None:
        if build is not None or measure is not None or FAILURE in extra:
            raise CasesError("until can't be given together with build, measure or failure")
        if not {"velocity", "energy"}.isdisjoint(cases[0]):
            raise CasesError("velocity is what is searched; it can't be varied as well")
        if not checked.deck.require(Impact).velocity:
            raise CasesError("the search begins at the velocity of ROD, which must not be 0")
        if until == THRESHOLD and checked.deck.last(Delamination) is None:
            raise CasesError("the threshold needs a DELA segment, which the deck does not have")
        if until != THRESHOLD and not (isinstance(until, float | int) and 0.0 < until < math.inf):
            raise CasesError(f"the peak force to reach is a positive number, not {until}")
    if measure is None:
        known = [*SUMMARY, *(FOUND if until is not None else ())]
        if extra:
            known += [name for name, _ in limits if name in COLUMNS or name.startswith(GAGE)]
        limited = checked.deck.last(Delamination) is not None
        known += LIMITED if limited else ()
        check_limits(limits, known, threshold=limited)
    same = {*LOAD, *CONTACT, "duration"}  # names of cases that keep the critical time step
    own = build is None and "dt" not in cases[0] and not same.issuperset(cases[0])
    clock = clock_of(checked) if own else None
    chosen = tuple(name for name in MEASURES if name in extra)
    return Plan(
        checked.deck, tuple(cases), history, clock, until, build, measure, chosen, design,
        tuple(limits),
    )  # fmt: skip


def shares_plate(checked: Problem) -> bool:
    """Whether a program has only impact steps of one size, and the plate no other loads."""
    words = [macro.word for macro in flat(checked.program)]
    sizes = {macro.value for macro in flat(checked.program) if macro.word == "DT"}
    return (
        "RODP" in words
        and len(sizes) == 1
        and words.index("DT") < words.index("RODP")
        and not {"EXCD", "TANG", "FORM", "SOLV"}.intersection(words)
        and not checked.mesh.forces.any()
    )


def _together(checked: Problem, made: Plan) -> int:
    """Most runs advanced together."""
    runs = len(made.cases) * (1 if made.until is None else COUNT)
    return min(TOGETHER, runs) if shares_plate(checked) and not made.alone else 1


def tasks(checked: Problem, made: Plan) -> list[Task]:
    """Split a plan into tasks: cases that share a plate together, full runs one by one."""
    together = max(1, _together(checked, made) // (1 if made.until is None else COUNT))
    groups: dict[tuple[object, ...], list[int]] = {}
    for number, case in enumerate(made.cases):
        key = tuple(case[name] for name in (*PLATE, REFINE) if name in case)
        groups.setdefault(key, []).append(number)
    found: list[Task] = []
    for numbers in groups.values():
        for start in range(0, len(numbers), together):
            some = tuple(numbers[start : start + together])
            cases = tuple(made.cases[n] for n in some)
            plain = Task(**vars(made), number=len(found), numbers=some)
            found.append(replace(plain, cases=cases))
    return found


def freed(some: Sequence[Task]) -> int:
    """Count cases with B != 0 in which u and v, restrained at every node, are released."""
    count = 0
    for task in some:
        if "support" in task.cases[0]:  # which has its own u and v
            continue
        plate = {name: value for name, value in task.cases[0].items() if name in LAMINATE}
        with suppress(CasesError):
            if apply_case(task.deck, plate).all(Boundary) != task.deck.all(Boundary):
                count += len(task.numbers)
    return count


FIELDS = ("DISP", "STRE", "PLYS", "FAIL", "REAC", "EIGE")


def without_output(checked: Problem, extra: Sequence[str] = ()) -> Problem:
    """Return a problem whose program stores no fields, but those of more columns."""
    dropped = {*FIELDS} - ({"FAIL"} if FAILURE in extra else set())

    def kept(body: Body) -> Iterator[Macro | Loop]:
        for item in body:
            if isinstance(item, Loop):
                yield replace(item, body=tuple(kept(item.body)))
            elif item.word not in dropped:
                yield replace(item, value=1e9) if item.word == "RODP" else item

    return replace(checked, program=tuple(kept(checked.program)))


KEPT = 24  # bytes per step and case whose history is stored: above the measured value


def check_memory(checked: Problem, made: Plan, workers: int, *, streamed: bool = False) -> None:
    """Reject a sweep that needs more memory than is free, by a NotEnoughMemoryError.

    `workers` are those on this machine; 0 if a cluster runs the cases.  If histories are
    `streamed` to files, only those of one task are held.
    """
    if REFINE in made.cases[-1]:
        checked = check_deck(apply_case(made.deck, made.cases[-1]))
    steps, cases = checked.work.steps, len(made.cases)
    at_once = min(workers, len(tasks(checked, made)))
    plate = checked if made.measure else without_output(checked, made.extra)
    held = min(cases, TOGETHER) if streamed else cases
    kept = KEPT * steps * held if made.history else 0

    def needed(exact: bool) -> int:
        if not at_once:
            return kept
        one = needed_bytes(plate, in_memory=made.measure is not None, exact=exact)
        one += ADVANCED * steps * _together(checked, made)
        return kept + at_once * one

    def remedy(free: int) -> str:
        if needed(True) - kept <= free:
            return "take fewer cases, or none of their histories"
        return "take fewer workers" if at_once > 1 else "take fewer steps or a coarser mesh"

    _memory.check("the sweep", needed, remedy)
