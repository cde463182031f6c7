"""Methods that compute the cases of a sweep, and the choice of one.

A linear plate is stepped once under a unit force, and every impact follows by convolution with its
response. A nonlinear plate is run in full for each impact, or reduced to some bending modes. All
that a sweep asks about the computation of its cases is answered by its :class:`Method`: how they
are split into tasks, what they cost, and why a plan is refused.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from typing import ClassVar

import numpy as np

from fecm._typing import Floats
from fecm._watch import Watch
from fecm.authoring.case import NO_THRESHOLD, Case, CasesError, Value
from fecm.authoring.strike_values import strike_of
from fecm.authoring.time_values import with_clock
from fecm.authoring.values import FAILURE_NAMES, REFINE, apply_case
from fecm.deck.model import Nonlinear
from fecm.mechanics.kernels import LIBRARY
from fecm.mechanics.own_law import law_name
from fecm.problem.memory import needed_bytes
from fecm.problem.problem import Problem
from fecm.sweeps.backends import (
    FORCES,
    BendingModes,
    FullRuns,
    ImpulseResponse,
    only_impacts,
    shares_plate,
)
from fecm.sweeps.impact_columns import Impacts, impacts_from_cards, impacts_of
from fecm.sweeps.in_full import (
    as_run,
    problem_of_case,
    run_in_full,
    stores_rows,
    thresholds_of,
    with_hit,
    without_output,
)
from fecm.sweeps.limits import PEAK_FORCE, THRESHOLD
from fecm.sweeps.outcome import About, Backend, Outcome, Status, merge
from fecm.sweeps.price import expected, time_of_runs, work_of_plates, work_of_runs
from fecm.sweeps.random import cost_of_plates, cost_of_runs
from fecm.sweeps.reduced import (
    LIMIT,
    MOST_MODES,
    TRIALS,
    MisfitError,
    reduction_bytes,
    tasks_beside_full_runs,
    tasks_in_full,
    tasks_of_search,
)
from fecm.sweeps.search import FIRST_VELOCITIES, Sought, search
from fecm.sweeps.task import (
    FULL,
    MOST_TOGETHER,
    REDUCED,
    Method,
    Plan,
    Prepared,
    RunTasks,
    Settings,
    Task,
    sharing,
)

MOST_REDUCED = 256  # impacts on a reduced plate at once, whose steps cost more
MOST_IN_MOTION = 16  # full runs in one motion
MOST_REDUCTION = 500_000_000  # bytes of a reduction that nobody asked for


class SharedPlate(Method):
    """Cases of one plate are impacts on it that a back end advances together."""

    @abstractmethod
    def backend(self, problem: Problem, settings: Settings) -> Backend:
        """Return the back end of a plate."""

    def outcomes(self, task: Task) -> list[Outcome]:
        """Compute cases that share a plate."""
        of_plate = task.plate_values
        # What computes the plate's response does not depend on the search and the contact law.
        settings = replace(task.settings, search=None, law=None)
        try:
            problem, backend = _plate(self, settings, tuple(of_plate.items()))
        except CasesError as error:
            return [Outcome.failed(dict.fromkeys(task.numbers, str(error)))]
        impacts, reasons = impacts_of(problem, task.numbers, task.cases, task.settings.law)
        parts = [Outcome.failed(reasons)]
        if impacts is not None:
            outcome = _outcome(task.settings, problem, backend, impacts)
            parts.append(with_hit(outcome, problem, of_plate))
        return parts

    def work(self, checked: Problem, definition: Plan) -> tuple[int, float]:
        """Return the steps of the plates, and the seconds from the first cases."""
        return work_of_plates(checked, definition)

    def expectation(self, checked: Problem, definition: Plan, workers: int | None) -> list[str]:
        """Say how many plates random values need."""
        design = definition.design
        return [] if design is None else [cost_of_plates(definition.cases, design)]

    def process_bytes(self, checked: Problem, settings: Settings, *, exact: bool) -> int:
        """Return the memory of the plate's run."""
        return needed_bytes(
            without_output(checked, settings.measures), in_memory=False, exact=exact
        )


@lru_cache(maxsize=2)
def _plate(
    method: SharedPlate, settings: Settings, of_plate: tuple[tuple[str, Value], ...]
) -> tuple[Problem, Backend]:
    """Return the problem of a plate, given by values of names, and its back end."""
    case: Case = dict(of_plate)
    problem = with_clock(apply_case(settings.deck, case), settings.clock, case)
    return problem, method.backend(problem, settings)


@dataclass(frozen=True)
class SharedResponse(SharedPlate):
    """Impacts on a linear plate by convolution with its response."""

    def applies(self, checked: Problem, settings: Settings, cases: Sequence[Case]) -> bool:
        """Return whether cases are impacts on linear plates that do nothing else."""
        is_run = settings.build is not None or settings.has_exposures
        return not is_run and shares_plate(checked, cases[0])

    def backend(self, problem: Problem, settings: Settings) -> Backend:
        """Return the back end of a plate."""
        return ImpulseResponse(problem, settings.measures, settings.history)

    def most_cases(self, definition: Plan) -> int:
        """Return the number of cases whose runs are advanced together."""
        return max(1, _runs_together(definition) // _runs_of_case(definition))

    def most_forces(self, definition: Plan, steps: int) -> int:
        """Return the number of runs; the kernels are given fewer runs of many steps at a time."""
        settings, together = definition.settings, _runs_together(definition)
        if settings.history or LIBRARY is None or settings.law is not None:
            return together
        return min(together, max(1, FORCES // steps))


def _runs_together(definition: Plan) -> int:
    """Return the largest number of runs that are advanced together."""
    return min(MOST_TOGETHER, len(definition.cases) * _runs_of_case(definition))


def _runs_of_case(definition: Plan) -> int:
    """Return the number of runs of a case in the first round of a search."""
    return 1 if definition.settings.search is None else FIRST_VELOCITIES


@dataclass(frozen=True)
class ReducedRuns(SharedPlate):
    """Impacts on a nonlinear plate in some bending modes, beside full runs of some cases."""

    limit: ClassVar[float] = LIMIT  # largest difference from full runs

    def applies(self, checked: Problem, settings: Settings, cases: Sequence[Case]) -> bool:
        """Return whether the caller asks for the reduced model."""
        return settings.model == REDUCED

    def refusal(self, checked: Problem, definition: Plan) -> str:
        """Explain why the reduced model does not suit a plan; empty if it does."""
        return _unsuited(checked, definition.settings, definition.cases[0])

    def backend(self, problem: Problem, settings: Settings) -> Backend:
        """Return the back end of a plate."""
        return BendingModes(problem, settings.measures, settings.modes, settings.history)

    def most_cases(self, definition: Plan) -> int:
        """Return the number of cases that are advanced together."""
        return min(MOST_REDUCED, len(definition.cases))

    def prepared(self, checked: Problem, definition: Plan, run: RunTasks, watch: Watch) -> Prepared:
        """Compare the model with full runs; cases for which it does not hold are run in full."""
        try:
            return self.tried(definition, run, watch)
        except MisfitError as error:
            more = "take more modes, or full runs"
            if definition.settings.modes >= MOST_MODES:
                more = "these are all its modes; take full runs"
            raise CasesError(f"{error}: {more} (`model` full)") from None

    def tried(self, definition: Plan, run: RunTasks, watch: Watch) -> Prepared:
        """Return the tasks by the model or in full; see :func:`prepared`."""
        if definition.settings.search is not None:
            return tasks_of_search(definition, SEPARATE_RUNS, self.limit, run)
        return tasks_beside_full_runs(definition, SEPARATE_RUNS, self.limit, run, watch)

    def process_bytes(self, checked: Problem, settings: Settings, *, exact: bool) -> int:
        """Return the memory of a full run, or of the reduction if it takes more."""
        run = super().process_bytes(checked, settings, exact=exact)
        return max(run, reduction_bytes(checked.plate, settings.modes))

    def work(self, checked: Problem, definition: Plan) -> tuple[int, float]:
        """Return the steps and the seconds of the cases, and of the full runs beside them."""
        settings = replace(definition.settings, search=None)
        tried = definition.cases[: TRIALS if definition.settings.search is None else 1]
        runs = replace(definition, settings=settings, cases=tried, method=SEPARATE_RUNS)
        (steps, seconds), of_runs = super().work(checked, definition), work_of_runs(checked, runs)
        return steps + of_runs[0], seconds + of_runs[1]

    def most_forces(self, definition: Plan, steps: int) -> int:
        """Return the number of cases that are advanced together."""
        return self.most_cases(definition)


@dataclass(frozen=True)
class ReducedOrFullRuns(ReducedRuns):
    """Impacts by the reduced model where full runs confirm it, and in full otherwise."""

    limit = 0.01

    def applies(self, checked: Problem, settings: Settings, cases: Sequence[Case]) -> bool:
        """Return whether the model suits a plan, and saves half of the full runs."""
        if settings.model is not None or settings.build or settings.measure:
            return False
        if _unsuited(checked, settings, cases[0]):
            return False
        if reduction_bytes(checked.plate, settings.modes) > MOST_REDUCTION:
            return False
        if settings.search is not None:
            return True
        plates, runs = (
            len(sharing(method, cases, range(len(cases))))
            for method in (self, _in_full(checked, settings, cases))
        )
        return runs >= 2 * (TRIALS + plates)

    def refusal(self, checked: Problem, definition: Plan) -> str:
        """Return an empty text: the method applies to what it can compute."""
        return ""

    def prepared(self, checked: Problem, definition: Plan, run: RunTasks, watch: Watch) -> Prepared:
        """Compare the model with full runs; without one that agrees, all cases are run in full."""
        try:
            prepared = self.tried(definition, run, watch)
            if definition.settings.search is not None:
                _check_found(prepared)
            return prepared
        except CasesError as error:
            in_full = _in_full(checked, definition.settings, definition.cases)
            watch.note(str(error), expected(checked, replace(definition, method=in_full), 0))
            return Prepared(tasks_in_full(definition, in_full))

    def expectation(self, checked: Problem, definition: Plan, workers: int | None) -> list[str]:
        """Say that the model computes the cases, and what full runs would take."""
        in_full = _in_full(checked, definition.settings, definition.cases)
        count, modes = len(definition.cases), definition.settings.modes
        runs = "three full runs" if definition.settings.search is None else "one full run"
        seconds = time_of_runs(checked, replace(definition, method=in_full), workers)
        text = (
            f"{count} case{'s' * (count > 1)} by the reduced model with {modes} modes, checked by "
            f"{runs}; in full (`model` full){seconds}"
        )
        return [*super().expectation(checked, definition, workers), text]


def _check_found(prepared: Prepared) -> None:
    """Raise CasesError if the search of a case has found no velocity."""
    for _, outcome in prepared.outcomes:
        if not outcome.fine.all():
            row = int(np.flatnonzero(~outcome.fine)[0])
            case, reason = outcome.numbers[row], outcome.status[row]
            raise CasesError(f"the reduced model fails in case {case}: {reason}")


def _in_full(checked: Problem, settings: Settings, cases: Sequence[Case]) -> Method:
    """Return the method by which cases of a nonlinear plate are run in full."""
    return method_of(checked, replace(settings, model=FULL), cases)


def _unsuited(checked: Problem, settings: Settings, names: Collection[str]) -> str:
    """Explain why the reduced model does not suit cases; empty if it does."""
    if settings.law is not None:
        return (
            f"the contact law {law_name(settings.law)} takes the place of EXPE, which the "
            "reduced model needs: leave out the reduced model"
        )
    if not (isinstance(settings.modes, int) and 1 <= settings.modes <= MOST_MODES):
        return f"the reduced model takes 1 to {MOST_MODES} bending modes, not {settings.modes!r}"
    if REFINE in names or "dt" in names:
        return "the reduced model has a time step of its own: dt and refine can't vary"
    if checked.plate.lifts:
        return (
            "the reduced model has no one-sided supports (UNIL): take full runs (leave out the "
            "reduced model), or a window that holds (fecm new --window held)"
        )
    if not checked.deck.has(Nonlinear):
        return "the reduced model is for decks with NONL; cases of others share a run"
    if not only_impacts(checked):
        return (
            "the reduced model starts at rest, with impact steps of one size: the deck has "
            "other steps, nodal forces or prescribed displacements"
        )
    return ""


class InFull(Method):
    """Cases are run in full on any plate."""

    shared: Collection[str] = ()  # names of values in which cases of one run may differ

    def work(self, checked: Problem, definition: Plan) -> tuple[int, float]:
        """Return the steps of all runs, and the seconds from the first steps."""
        return work_of_runs(checked, definition)

    def expectation(self, checked: Problem, definition: Plan, workers: int | None) -> list[str]:
        """Say that random values are run in full, and the runs of a nonlinear plate."""
        cases, design, texts = definition.cases, definition.design, []
        if design is not None:
            texts.append(cost_of_runs(cases, design, self.shared))
        if definition.settings.build is None and not checked.plate.is_linear:
            texts.append(expected(checked, definition, workers))
        return texts

    def process_bytes(self, checked: Problem, settings: Settings, *, exact: bool) -> int:
        """Return the memory of a run with the rows that it keeps."""
        program = as_run(checked, settings.measures, settings.measure)
        keeps_rows = settings.measure is not None or stores_rows(checked, settings.measures)
        return needed_bytes(program, in_memory=keeps_rows, exact=exact)

    def most_forces(self, definition: Plan, steps: int) -> int:
        """Return 1: a run has the forces of all its cases."""
        return 1


@dataclass(frozen=True)
class SharedMotion(InFull):
    """Full runs; cases that differ only in values of failure have one motion."""

    shared = FAILURE_NAMES

    def applies(self, checked: Problem, settings: Settings, cases: Sequence[Case]) -> bool:
        """Return whether cases of a deck are run in full, each once and without a function."""
        obstacles = settings.build, settings.measure, settings.search
        in_full = settings.has_exposures or not checked.deck.is_linear
        return in_full and all(other is None for other in obstacles)

    def most_cases(self, definition: Plan) -> int:
        """Return the number of cases whose failure one run evaluates."""
        return MOST_IN_MOTION

    def separates(self, name: str) -> bool:
        """Return whether the motion depends on a value."""
        return name not in self.shared

    def outcomes(self, task: Task) -> list[Outcome]:
        """Run the motion of all cases once."""
        settings = task.settings
        problems: dict[int, Problem] = {}
        reasons: dict[int, str] = {}
        for number, case in zip(task.numbers, task.cases, strict=True):
            try:
                problems[number] = problem_of_case(settings, case)
            except CasesError as error:
                reasons[number] = str(error)
        invalid = [Outcome.failed(reasons)] if reasons else []
        if not problems:
            return invalid
        try:
            outcomes = run_in_full(problems, settings.measures, law=settings.law)
        except CasesError as error:
            return [*invalid, Outcome.failed(dict.fromkeys(problems, str(error)))]
        # The cases have the same impact point, as they have the same motion.
        hit = next(iter(problems.values())), task.cases[0]
        return [*invalid, *(with_hit(outcome, *hit) for outcome in outcomes)]


@dataclass(frozen=True)
class SeparateRuns(InFull):
    """Full runs of each case, on a plate of its own, also by functions and for searches."""

    def applies(self, checked: Problem, settings: Settings, cases: Sequence[Case]) -> bool:
        """Return True: any case can be run alone."""
        return True

    def most_cases(self, definition: Plan) -> int:
        """Return 1."""
        return 1

    def outcomes(self, task: Task) -> list[Outcome]:
        """Run each case, or search its velocity."""
        cases = zip(task.numbers, task.cases, strict=True)
        return [_alone(task.settings, number, case) for number, case in cases]

    def work(self, checked: Problem, definition: Plan) -> tuple[int, float]:
        """Return the work of runs; the seconds of decks that a function builds are not known."""
        if definition.settings.build is not None:
            return checked.work.steps * len(definition.cases), math.nan
        return super().work(checked, definition)


def _alone(settings: Settings, number: int, case: Case) -> Outcome:
    """Compute a case on its own plate by full runs."""
    try:
        problem = problem_of_case(settings, case)
        if settings.search is not None:
            outcome = _searched_alone(settings, number, problem)
        else:
            (outcome,) = run_in_full(
                {number: problem}, settings.measures, settings.measure, case, law=settings.law
            )
    except CasesError as error:
        return Outcome.failed({number: str(error)})
    return outcome if settings.build else with_hit(outcome, problem, case)


def _searched_alone(settings: Settings, number: int, problem: Problem) -> Outcome:
    """Find the velocity of a case by full runs."""
    assert settings.search is not None
    strikes = {number: strike_of(problem.deck)}
    impacts = impacts_from_cards(strikes, settings.law, problem.symmetry.factor)
    levels = _levels(settings, problem, impacts)
    if settings.search.quantity is Sought.EXPOSURE:
        at_rest = problem.worst_at_rest
        if at_rest is not None and at_rest.exposure >= levels[0]:
            raise CasesError(f"the plate at rest has the exposure {at_rest.exposure:.4g}")
    elif problem.deck.has(Nonlinear):
        impacts = _from_quick_models(problem, impacts, levels)
    return search(FullRuns(problem, settings.measures), impacts, settings.search.quantity, levels)


def _outcome(settings: Settings, problem: Problem, backend: Backend, impacts: Impacts) -> Outcome:
    """Compute impacts on a plate, or find their velocities."""
    if settings.search is None:
        outcome = backend.lengthened(backend.durations[0]).outcomes(impacts)
        return _lengthened(outcome, backend, impacts, settings) if backend.lengthens else outcome
    levels = _levels(settings, problem, impacts)
    return search(backend, impacts, settings.search.quantity, levels)


def _levels(settings: Settings, problem: Problem, impacts: Impacts) -> Floats:
    """Return the peak forces that a search must reach, (rows,)."""
    assert settings.search is not None
    level = settings.search.level
    if level != THRESHOLD:
        return np.full(len(impacts), float(level))
    if (thresholds := thresholds_of(problem, impacts.toughness)) is None:
        raise CasesError(NO_THRESHOLD)
    return thresholds


def _lengthened(
    outcome: Outcome, backend: Backend, impacts: Impacts, settings: Settings
) -> Outcome:
    """Repeat open impacts with a longer response.

    Up to the duration of the program these are all that are not over; beyond it those that were
    between contacts at its end, or may touch again.
    """
    candidates = np.array(outcome.numbers)
    for before, factor in pairwise(backend.durations):
        status, numbers = outcome.columns[About.STATUS], np.array(outcome.numbers)
        is_open = np.isnan(outcome.columns[PEAK_FORCE])
        if factor <= 1:
            is_open = (is_open & (status == Status.OK)) | (status == Status.STILL)
        else:
            candidates = numbers[status == Status.OK] if before == 1 else candidates
            is_open &= np.isin(numbers, candidates)
        if not is_open.any():
            break
        again = np.flatnonzero(np.isin(impacts.numbers, numbers[is_open]))
        longer = backend.lengthened(factor).outcomes(impacts.select(again))
        parts = [outcome.select(np.flatnonzero(~is_open)), longer]
        outcome = merge(parts, history=settings.history)
    return outcome


def _from_quick_models(problem: Problem, impacts: Impacts, levels: Floats) -> Impacts:
    """Return impacts on a nonlinear plate at the velocities that the quick models estimate."""
    from fecm.studies.estimate import velocity_at  # 0.1 s, which most sweeps don't need

    rows = np.arange(len(impacts))
    starts = [
        velocity_at(replace(problem, deck=impacts.deck(row)), float(levels[row]))
        for row in rows.tolist()
    ]
    return replace(impacts.at_velocities(rows, np.array(starts)), numbers=impacts.numbers)


SEPARATE_RUNS = SeparateRuns()
# The first one that applies computes a plan.
METHODS: tuple[Method, ...] = (
    ReducedRuns(),
    ReducedOrFullRuns(),
    SharedMotion(),
    SharedResponse(),
    SEPARATE_RUNS,
)


def method_of(checked: Problem, settings: Settings, cases: Sequence[Case]) -> Method:
    """Return the method for cases of a problem."""
    return next(method for method in METHODS if method.applies(checked, settings, cases))
