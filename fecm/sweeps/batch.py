"""Computation of the tasks of a sweep: cases of one plate, or single cases."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from fecm._typing import Floats
from fecm.authoring.case import NO_THRESHOLD, PEAK_FORCE, THRESHOLD, Case, CasesError, Value
from fecm.authoring.impacts import Impacts, impacts_from_cards, impacts_of
from fecm.authoring.strike import strike_of
from fecm.authoring.timing import Clock, with_clock
from fecm.authoring.values import plate_values
from fecm.authoring.vary import apply_case
from fecm.deck.model import Deck, Nonlinear
from fecm.problem.problem import Problem
from fecm.sweeps.backends import FullRuns, backend_of
from fecm.sweeps.in_full import (
    in_one_motion,
    problem_of_case,
    run_case_in_full,
    thresholds_of,
    with_hit,
)
from fecm.sweeps.outcome import About, Backend, Outcome, Status, merge
from fecm.sweeps.plan import Measure, Plan, Settings, Task
from fecm.sweeps.search import LONGER, Sought, search


def run_task(task: Task) -> Outcome:
    """Compute the cases of a task; the status of a failed case is the reason."""
    settings = task.settings
    cases = list(zip(task.numbers, task.cases, strict=True))
    if settings.shares_motion and len(cases) > 1:
        parts = in_one_motion(settings, task.numbers, task.cases)
    elif settings.in_full:
        parts = [_in_full(settings, number, case) for number, case in cases]
    else:
        parts = _of_one_plate(task)
    return merge(parts, history=settings.history)


def case_deck(planned: Plan, case: int) -> Deck:
    """Return the deck of a case with its time step; CasesError if the case can't be computed."""
    return problem_of_case(planned.settings, planned.cases[case]).deck


def _of_one_plate(task: Task) -> list[Outcome]:
    """Compute cases that share a plate."""
    settings, of_plate = task.settings, plate_values(task.cases[0])
    try:
        problem, backend = _plate(
            settings.deck,
            tuple(of_plate.items()),
            settings.clock,
            settings.measures,
            modes=settings.modes,
            history=settings.history,
        )
    except CasesError as error:
        return [Outcome.failed(dict.fromkeys(task.numbers, str(error)))]
    impacts, reasons = impacts_of(problem, task.numbers, task.cases, settings.law)
    parts = [Outcome.failed(reasons)]
    if impacts is not None:
        outcome = _outcome(settings, problem, backend, impacts)
        parts.append(with_hit(outcome, problem, of_plate))
    return parts


@lru_cache(maxsize=2)  # full runs and the reduced model alternate
def _plate(
    deck: Deck,
    of_plate: tuple[tuple[str, Value], ...],
    clock: Clock | None,
    measures: tuple[Measure, ...],
    *,
    modes: int | None,
    history: bool,
) -> tuple[Problem, Backend]:
    """Return the problem of a plate, given by values of names, and its back end."""
    case: Case = dict(of_plate)
    problem = with_clock(apply_case(deck, case), clock, case)
    return problem, backend_of(problem, measures, modes=modes, history=history)


def _outcome(settings: Settings, problem: Problem, backend: Backend, impacts: Impacts) -> Outcome:
    """Compute impacts on a plate, or find their velocities."""
    if settings.search is None:
        outcome = backend.outcomes(impacts)
        return _lengthened(outcome, backend, impacts, settings) if backend.lengthens else outcome
    levels = _levels(settings, problem, impacts)
    if problem.deck.has(Nonlinear):
        impacts = _from_quick_models(problem, impacts, levels)
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
    """Repeat impacts that end between contacts, or may touch again, with a longer response."""
    no_contact = outcome.columns[About.STATUS] == Status.OK
    candidates = np.array(outcome.numbers)[no_contact]
    for factor in LONGER[1:]:
        is_open = np.isin(outcome.numbers, candidates) & np.isnan(outcome.columns[PEAK_FORCE])
        if not is_open.any():
            break
        again = np.flatnonzero(np.isin(impacts.numbers, np.array(outcome.numbers)[is_open]))
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


def _in_full(settings: Settings, number: int, case: Case) -> Outcome:
    """Compute a case on its own plate by full runs."""
    sought = settings.search
    try:
        problem = problem_of_case(settings, case)
        if sought is None or sought.quantity is not Sought.EXPOSURE:
            outcome = run_case_in_full(
                number, problem, settings.measures, settings.measure, case, law=settings.law
            )
        else:
            level, at_rest = float(sought.level), problem.worst_at_rest
            if at_rest is not None and at_rest.exposure >= level:
                raise CasesError(f"the plate at rest has the exposure {at_rest.exposure:.4g}")
            impacts = impacts_from_cards({number: strike_of(problem.deck)}, settings.law)
            backend = FullRuns(problem, settings.measures)
            outcome = search(backend, impacts, sought.quantity, np.array([level]))
    except CasesError as error:
        return Outcome.failed({number: str(error)})
    return outcome if settings.build else with_hit(outcome, problem, case)
