"""Plan of a sweep: its cases, and the tasks that compute them.

A study (grid, cases, random, refine) gives cases. A plan has the cases and their common
:class:`Settings`. :func:`tasks` splits it. :func:`fecm.sweeps.backends.run_task` computes a task,
and :func:`fecm.sweeps.result.sweep_result` makes the result of the plan from all outcomes.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from types import MappingProxyType
from typing import Any

from fecm._version import __version__
from fecm.authoring.case import (
    NO_THRESHOLD,
    THRESHOLD,
    Case,
    CasesError,
    Limit,
    Value,
    check_limits,
)
from fecm.authoring.cases import MeasuredColumn
from fecm.authoring.timing import Clock, clock_of
from fecm.authoring.values import (
    FAILURE_NAMES,
    LAW_VALUES,
    OF_PLATE,
    REFINE,
    Changes,
    apply_case,
    check_names,
    names_of,
)
from fecm.deck.macros import flat
from fecm.deck.model import Deck, Gages, Nonlinear
from fecm.mechanics.contact_law import Law
from fecm.mechanics.own_law import law_name
from fecm.problem.problem import Problem
from fecm.results.metrics import COLUMNS, FOUND, GAGE, SUMMARY
from fecm.results.metrics import THRESHOLD as OF_THRESHOLD
from fecm.results.result import Result
from fecm.sweeps.random import Design
from fecm.sweeps.search import FIRST_VELOCITIES, Search, Sought, Until, search_of

BuildFunction = Callable[[dict[str, Any]], Deck]  # of a case, whose values are any
MeasureFunction = Callable[[Result], Mapping[str, float]]
NO_COLUMNS: Mapping[str, MeasuredColumn] = MappingProxyType({})
MOST_TOGETHER = 2048  # cases advanced together
# Contact forces that are computed before they are evaluated, where none are stored: 16 MB, which
# the C library keeps for the next ones and does not give back to the system.
FORCES = 2_000_000
MOST_REDUCED = 256  # of the reduced model, whose steps cost more
REDUCED = "reduced"  # name of that model
MODES = 21  # bending modes of the reduced model
MOST_MODES = 40
WORTH_WORKERS = 10.0  # seconds that tasks take, from which on workers are worth their start
MOST_IN_MOTION = 16  # full runs in one motion
# Names that keep the critical time step of the deck.
_KEEPING = {*names_of(Changes.FAILURE, Changes.STRIKE, Changes.PLACE), "duration"}


class Measure(StrEnum):
    """Columns that are measured on request."""

    DEFLECTION = "max_deflection"
    GAGES = "gages"
    FAILURE = "failure"


MEASURES = tuple(measure.value for measure in Measure)


@dataclass(frozen=True)
class Settings:
    """What the cases of a sweep have in common."""

    deck: Deck  # that is varied; with `build` the deck of a case
    history: bool = False  # whether contact forces are stored
    clock: Clock | None = None  # None if the time step of the deck applies to every plate
    search: Search | None = None  # for the velocity of every case
    build: BuildFunction | None = None  # makes the deck of a case
    measure: MeasureFunction | None = None  # computes more columns from the result of a case
    measures: tuple[Measure, ...] = ()  # more columns
    modes: int | None = None  # bending modes of the reduced model; None of full plates
    law: Law | None = None  # a user's contact law instead of the deck's

    @property
    def shares_motion(self) -> bool:
        """Whether full runs that differ only in values of failure are one motion."""
        obstacles = self.build, self.measure, self.search, self.modes
        in_full = Measure.FAILURE in self.measures or self.deck.has(Nonlinear)
        return in_full and all(other is None for other in obstacles)

    @property
    def in_full(self) -> bool:
        """Whether every case is run in full on any plate."""
        return (
            self.build is not None or self.measure is not None or Measure.FAILURE in self.measures
        )


@dataclass(frozen=True)
class Plan:
    """Definition of a sweep."""

    settings: Settings
    cases: tuple[Case, ...]
    design: Design | None = None  # of random cases
    limits: tuple[Limit, ...] = ()  # whose probability of exceedance is asked for
    measured: Mapping[str, MeasuredColumn] = field(default_factory=dict)  # of the table of cases

    def fingerprint(self) -> str:
        """Return the hash that identifies the outcomes of this sweep."""
        settings = self.settings
        parts = [
            __version__,
            settings.deck.to_text(),
            self.cases,
            settings.history,
            settings.search,
        ]
        law = () if settings.law is None else (law_name(settings.law),)
        text = json.dumps([*parts, settings.measures, settings.modes, MOST_TOGETHER, *law])
        return hashlib.sha256(text.encode()).hexdigest()


@dataclass(frozen=True)
class Task:
    """Cases that are computed together."""

    settings: Settings
    number: int
    numbers: tuple[int, ...]  # of the cases
    cases: tuple[Case, ...]

    @property
    def plate_values(self) -> Case:
        """Values of the plate, which the cases share unless each is run in full."""
        return {name: value for name, value in self.cases[0].items() if name in OF_PLATE}


def plan(
    checked: Problem,
    cases: Sequence[Case],
    *,
    history: bool = False,
    until: Until | None = None,
    build: BuildFunction | None = None,
    measure: MeasureFunction | None = None,
    extra: Sequence[str] = (),
    design: Design | None = None,
    limits: Sequence[Limit] = (),
    modes: int | None = None,
    law: Law | None = None,
    measured: Mapping[str, MeasuredColumn] = NO_COLUMNS,
) -> Plan:
    """Create the plan of a sweep.

    `extra` has names of :class:`Measure`, `until` the searched quantity. With `modes` the cases are
    computed by the reduced model. `law` is a user's contact law that replaces the deck's law.
    `measured` has the measured columns of the table of cases.
    Raises CasesError if the deck has no impact, names exclude each other, the deck lacks what is
    searched or measured, or the reduced model does not give it.
    """
    deck, search = checked.deck, search_of(until)
    if search is not None and search.quantity is Sought.EXPOSURE:
        extra = (*extra, Measure.FAILURE)
    if not any(macro.word == "RODP" for macro in deck.macros):
        raise CasesError("the deck has no impact step (RODP); there is nothing to sweep")
    if build is None:
        check_names(cases[0])
        # Values of segments that the deck lacks are invalid in every case.
        apply_case(deck, {name: cases[0][name] for name in FAILURE_NAMES if name in cases[0]})
    measures = _measures(extra, deck)
    if search is not None:
        by_force = search.quantity is Sought.PEAK_FORCE
        if build or measure or (by_force and Measure.FAILURE in measures):
            raise CasesError("until can't be given together with build, measure or failure")
        search.check(deck, cases[0])
        if search.level == THRESHOLD and checked.threshold is None:
            raise CasesError(NO_THRESHOLD)
    if measure is None:
        has_threshold = checked.threshold is not None
        _check_limits(limits, search, measures, has_threshold=has_threshold)
    own_clock = build is None and "dt" not in cases[0] and not _KEEPING.issuperset(cases[0])
    settings = Settings(
        deck=deck,
        history=history,
        clock=clock_of(checked) if own_clock else None,
        search=search,
        build=build,
        measure=measure,
        measures=measures,
        modes=modes,
        law=law,
    )
    if law is not None and build is None:
        check_law(law, cases[0], modes)
    if modes is not None:
        _check_reduced(checked, cases[0], settings)
    return Plan(settings, tuple(cases), design, tuple(limits), measured)


def check_law(law: Law, names: Collection[str], modes: int | None = None) -> None:
    """Raise CasesError if a user's law excludes values that vary, or the reduced model."""
    replacement = f"the contact law {law_name(law)} takes the place of EXPE"
    if constants := [name for name in names if name in LAW_VALUES]:
        raise CasesError(f"{replacement}, so that {', '.join(constants)} would change nothing")
    if modes is not None:
        raise CasesError(
            f"{replacement}, which the reduced model needs: leave out the reduced model"
        )


def _measures(names: Sequence[str], deck: Deck) -> tuple[Measure, ...]:
    """Return what is measured.

    Raises CasesError if a name is unknown, or the deck lacks what it needs.
    """
    if unknown := sorted({*names} - {*MEASURES}):
        raise CasesError(f"measure has {unknown[0]!r}; the names are {', '.join(MEASURES)}")
    if Measure.GAGES in names and not deck.has(Gages):
        raise CasesError("measure gages: the deck has no strain gages; add a GAGE segment")
    if Measure.FAILURE in names and not any(macro.word == "FAIL" for macro in deck.macros):
        raise CasesError("measure failure: the program of the deck has no FAIL; add it to the loop")
    return tuple(measure for measure in Measure if measure in names)


def _check_limits(
    limits: Sequence[Limit],
    search: Search | None,
    measures: Sequence[Measure],
    *,
    has_threshold: bool,
) -> None:
    """Raise CasesError if the summary of the sweep will not have the quantity of a limit."""
    quantities = [*SUMMARY]
    if search is not None:
        quantities += FOUND
    if measures:
        names = (limit.quantity for limit in limits)
        quantities += [name for name in names if name in COLUMNS or name.startswith(GAGE)]
    if has_threshold:
        quantities += OF_THRESHOLD
    check_limits(limits, quantities, threshold=has_threshold)


def _check_reduced(checked: Problem, names: Collection[str], settings: Settings) -> None:
    """Raise CasesError if the reduced model does not suit a deck, or lacks a quantity."""
    modes = settings.modes
    if not (isinstance(modes, int) and 1 <= modes <= MOST_MODES):
        raise CasesError(f"the reduced model takes 1 to {MOST_MODES} bending modes, not {modes!r}")
    if settings.build or settings.measure or {*settings.measures} - {Measure.DEFLECTION}:
        raise CasesError(
            "the reduced model has forces and deflections only, of a deck: no build, and none of "
            "measure but max_deflection"
        )
    if settings.search is not None:
        raise CasesError("searches take full runs: leave out the reduced model")
    if REFINE in names or "dt" in names:
        raise CasesError("the reduced model has a time step of its own: dt and refine can't vary")
    if not checked.deck.has(Nonlinear):
        raise CasesError("the reduced model is for decks with NONL; cases of others share a run")
    if not _only_impacts(checked):
        raise CasesError(
            "the reduced model starts at rest, with impact steps of one size: the deck has other "
            "steps, nodal forces or prescribed displacements"
        )


def shares_plate(checked: Problem) -> bool:
    """Return whether cases of a linear plate share a response: see :func:`_only_impacts`."""
    return not checked.deck.has(Nonlinear) and _only_impacts(checked)


def _only_impacts(checked: Problem) -> bool:
    """Return whether a program has only impact steps of one size, and the plate no other loads."""
    words = [macro.word for macro in flat(checked.program)]
    sizes = {macro.value for macro in flat(checked.program) if macro.word == "DT"}
    if "RODP" not in words or len(sizes) != 1 or words.index("DT") > words.index("RODP"):
        return False
    return {"EXCD", "TANG", "FORM", "SOLV"}.isdisjoint(words) and not checked.mesh.forces.any()


def runs_together(checked: Problem, definition: Plan) -> int:
    """Return the largest number of runs that are advanced together."""
    if definition.settings.modes is not None:
        return min(MOST_REDUCED, len(definition.cases))
    if definition.settings.in_full or not shares_plate(checked):
        return 1
    return min(MOST_TOGETHER, len(definition.cases) * _runs_of_case(definition))


def _runs_of_case(definition: Plan) -> int:
    """Return the number of runs of a case in the first round of a search."""
    return 1 if definition.settings.search is None else FIRST_VELOCITIES


def tasks(checked: Problem, definition: Plan, cases: Sequence[int] | None = None) -> list[Task]:
    """Split a plan, or some of its cases, into tasks.

    A task has cases that share a plate, full runs that share a motion, or a single case.
    """
    together = max(1, runs_together(checked, definition) // _runs_of_case(definition))
    names = [name for name in definition.cases[0] if name in OF_PLATE]
    if definition.settings.shares_motion:
        together = MOST_IN_MOTION
        names = [name for name in definition.cases[0] if name not in FAILURE_NAMES]
    sharing: dict[tuple[Value, ...], list[int]] = {}
    for number in range(len(definition.cases)) if cases is None else cases:
        key = tuple(definition.cases[number][name] for name in names)
        sharing.setdefault(key, []).append(number)
    parts = [
        tuple(numbers[start : start + together])
        for numbers in sharing.values()
        for start in range(0, len(numbers), together)
    ]
    return [
        Task(definition.settings, number, numbers, tuple(definition.cases[n] for n in numbers))
        for number, numbers in enumerate(parts)
    ]
