"""Run cases of a sweep: together if they share a plate, otherwise one by one.

Cases share a plate if they differ only in projectile, impact velocity or contact law.  The plate is
then stepped once under a unit force; every case follows by convolution with its response.  Those of
a nonlinear plate are run in full, or by the reduced model.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache, partial
from itertools import compress
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fecm._machine import require_memory
from fecm._typing import Floats
from fecm.authoring.case import NO_THRESHOLD, PEAK_FORCE, THRESHOLD, Case, CasesError, Value
from fecm.authoring.strike import Strike
from fecm.authoring.timing import Clock, lengthened, with_clock
from fecm.authoring.values import plate_values
from fecm.authoring.vary import apply_case, columns_of, split, strike_of_case, tabled
from fecm.deck.macros import flat
from fecm.deck.model import Deck, Nonlinear
from fecm.mechanics import kernels
from fecm.mechanics.contact_law import HystereticLaw, Law
from fecm.mechanics.own_law import CaseByCase
from fecm.mechanics.time_step import taken_time_step
from fecm.problem.build import build_model
from fecm.problem.problem import Problem
from fecm.results.metrics import GAGE, Projectiles, impact_metrics
from fecm.simulation.judge import ENERGY_WARNING
from fecm.sweeps import search
from fecm.sweeps.checks import ADVANCED_BYTES
from fecm.sweeps.in_full import (
    CasePeaks,
    in_one_motion,
    judge_cases,
    problem_of_case,
    run_case_in_full,
    run_in_full,
    thresholds_of,
    with_hit,
)
from fecm.sweeps.outcome import About, Outcome, Status, merge, outcome_of
from fecm.sweeps.plan import Measure, Plan, Settings, Task, shares_plate
from fecm.sweeps.reduced import ReducedImpacts, by_halvings, reduced
from fecm.sweeps.responses import Hits, Impacts, impacts, largest_sums, plate_response
from fecm.sweeps.search import LONGER, Runs, Sought, Strikes, search_by_response

# Contact forces that are computed before they are evaluated, where none are stored: 16 MB, which
# the C library keeps for the next ones and does not give back to the system.
FORCES = 2_000_000
# Returns what runs strikes for a multiple of the duration of the deck.
Longer = Callable[[int], Runs]


def run_task(task: Task) -> Outcome:
    """Run the cases of a task; a case that cannot be run becomes a row with the reason."""
    settings = task.settings
    if settings.shares_motion and len(task.cases) > 1:
        return merge(in_one_motion(settings, task.numbers, task.cases), history=settings.history)
    if settings.in_full:
        cases = zip(task.numbers, task.cases, strict=True)
        parts = [run_in_full(settings, number, case) for number, case in cases]
        return merge(parts, history=settings.history)
    of_plate = plate_values(task.cases[0])
    try:
        checked, longer = _prepared(
            settings.deck,
            tuple(of_plate.items()),
            settings.clock,
            settings.measures,
            modes=settings.modes,
            history=settings.history,
        )
    except CasesError as error:
        return Outcome.failed(dict.fromkeys(task.numbers, str(error)))
    strikes, reasons = _strikes(task, checked)
    parts = [Outcome.failed(reasons)]
    if strikes:
        parts.append(with_hit(_outcome(settings, checked, longer, strikes), checked, of_plate))
    return merge(parts, history=settings.history)


def _strikes(task: Task, checked: Problem) -> tuple[Strikes, dict[int, str]]:
    """The strikes of the cases, and why others have none, by the numbers of the cases."""
    law = task.settings.law
    table = tabled(checked, task.numbers, task.cases, law)
    others: dict[int, Strike] = {}
    reasons: dict[int, str] = {}
    for number, case in zip(task.numbers, task.cases, strict=True):
        if number in table:
            continue
        try:
            made = strike_of_case(checked.deck, case)._replace(own_law=law)
            made.check(checked)
            others[number] = made
        except CasesError as error:
            reasons[number] = str(error)
    strikes = dict(sorted({**table, **others}.items())) if others else table
    return strikes, reasons


def _outcome(settings: Settings, checked: Problem, longer: Longer, strikes: Strikes) -> Outcome:
    """Run the strikes of a plate, or search their velocities."""
    if settings.search is None:
        outcome = longer(1)(strikes, True)
        # Another response is cheap; full runs and the reduced model are not repeated.
        can_lengthen = settings.modes is None and shares_plate(checked)
        return _decided(outcome, longer, strikes, settings) if can_lengthen else outcome
    level, numbers = settings.search.level, list(strikes)
    levels = dict.fromkeys(numbers, 0.0 if level == THRESHOLD else float(level))
    if level == THRESHOLD:
        thresholds = thresholds_of(checked, columns_of(strikes).toughness)
        if thresholds is None:
            raise CasesError(NO_THRESHOLD)
        levels = dict(zip(numbers, thresholds.tolist(), strict=True))
    if checked.deck.has(Nonlinear):
        return merge(
            [_found_in_full(checked, n, one, levels[n], longer) for n, one in strikes.items()]
        )
    return search_by_response(strikes, levels, longer)


def _decided(outcome: Outcome, longer: Longer, strikes: Strikes, settings: Settings) -> Outcome:
    """Repeat cases that end between contacts, or may touch again, with a longer response."""
    no_contact = outcome.columns[About.STATUS] == Status.OK
    candidates = np.array(outcome.numbers)[no_contact]
    for factor in LONGER[1:]:
        is_open = np.isin(outcome.numbers, candidates) & np.isnan(outcome.columns[PEAK_FORCE])
        if not is_open.any():
            break
        again = {
            outcome.numbers[row]: strikes[outcome.numbers[row]] for row in np.flatnonzero(is_open)
        }
        parts = [outcome.select(np.flatnonzero(~is_open)), longer(factor)(again, True)]
        outcome = merge(parts, history=settings.history)
    return outcome


def _found_in_full(
    checked: Problem, number: int, strike: Strike, force: float, longer: Longer
) -> Outcome:
    """Search the velocity of a strike of a nonlinear plate, from that of the quick models on."""
    from fecm.studies.estimate import velocity_at  # 0.1 s, which most sweeps don't need

    def run(trial: Strike, factor: int) -> Outcome:
        return longer(factor)({number: trial}, True)

    start = velocity_at(replace(checked, deck=strike.deck()), force)
    first = strike.with_velocity(start)
    try:
        return search.search_in_full(number, first, Sought.PEAK_FORCE, force, run)
    except CasesError as error:
        return Outcome.failed({number: str(error)})


@lru_cache(maxsize=2)  # for runs in full beside those of the reduced model
def _prepared(
    deck: Deck,
    of_plate: tuple[tuple[str, Value], ...],
    clock: Clock | None,
    measures: tuple[Measure, ...],
    *,
    modes: int | None,
    history: bool,
) -> tuple[Problem, Longer]:
    """The problem of a plate, given by values of names, and what runs its strikes."""
    case: Case = dict(of_plate)
    checked = with_clock(apply_case(deck, case), clock, case)

    @lru_cache(maxsize=len(LONGER))
    def longer(factor: int) -> Runs:
        if modes is not None and factor == 1:
            return _reduced_runs(checked, modes, measures, history=history)
        problem = checked if factor == 1 else lengthened(checked, factor)
        return runs_of(problem, measures, history=history)

    return checked, longer


def _reduced_runs(
    checked: Problem, modes: int, measures: Sequence[Measure], *, history: bool
) -> Runs:
    """Return the function that runs strikes of the plate of a problem in bending modes."""
    plate = reduced(checked, modes)

    def runs(strikes: Strikes, judged: bool) -> Outcome:
        return merge(
            [
                _together(checked, plate.halved(times), measures, history, some, judged)
                for times, some in by_halvings(plate, strikes).items()
            ]
        )

    return runs


def runs_of(checked: Problem, measures: Sequence[Measure] = (), *, history: bool = True) -> Runs:
    """Return the function that runs strikes of the plate of a problem."""
    if shares_plate(checked):
        plate = _plate(checked, gages=Measure.GAGES in measures)
        return partial(_together, checked, plate, measures, history)
    return lambda strikes, judged: merge(_one_by_one(checked, measures, strikes))


def _one_by_one(checked: Problem, measures: Sequence[Measure], strikes: Strikes) -> list[Outcome]:
    return [
        run_case_in_full(number, replace(checked, deck=made.deck()), measures, law=made.own_law)
        for number, made in strikes.items()
    ]


def case_deck(planned: Plan, case: int) -> Deck:
    """Return the deck of a case with its time step; CasesError if the case cannot be run."""
    return problem_of_case(planned.settings, planned.cases[case]).deck


class PlateResponse(NamedTuple):
    """Response of a plate to a unit force in its first step of size `dt`, and the mass it moves."""

    response: Floats
    dt: float
    node_mass: float
    strains: dict[str, Floats]  # response of every gage that is measured, by the name of its column

    @property
    def steps(self) -> int:
        """Number of steps."""
        return len(self.response)

    def impacts(self, hits: Hits) -> Impacts:
        """Compute many impacts."""
        return impacts(self.response, self.dt, self.node_mass, hits)


def _plate(checked: Problem, *, gages: bool) -> PlateResponse:
    setup = build_model(checked)
    assert setup.impact is not None  # the program has impact steps
    load, steps = setup.impact.contact.load, checked.work.steps
    dt = next(macro.value for macro in flat(checked.program) if macro.word == "DT")
    dt = dt or taken_time_step(checked.critical_time_step)
    measured = setup.gages if gages else None
    names, sums = [], None
    if measured is not None:
        names = [f"{GAGE}{number}" for number in measured.numbers]
        sums = setup.motion.dof_sums(measured.dof_indices, measured.weights)
    with np.errstate(all="ignore"):
        response, strains = plate_response(setup.motion, load, dt, steps, sums)
    return PlateResponse(
        response, dt, 1.0 / load.inverse_mass, dict(zip(names, strains, strict=True))
    )


class _Ordered(NamedTuple):
    """Strikes with the cases of the same projectile next to one another."""

    numbers: list[int]
    hits: Hits
    projectiles: Projectiles
    toughness: Floats
    back: NDArray[np.intp]  # rows in the order of the cases


def _ordered(strikes: Strikes) -> _Ordered:
    columns, numbers = columns_of(strikes), list(strikes)
    order = np.argsort(columns.kind, kind="stable")
    made = columns.of_cases(order)
    own_law = strikes[numbers[0]].own_law
    law: Law[Floats] = HystereticLaw(made.constants)
    if own_law is not None:
        law = CaseByCase(own_law, len(numbers))
    return _Ordered(
        numbers=[numbers[row] for row in order.tolist()],
        hits=Hits(made.kinds, made.kind, made.scale, law, made.velocity),
        projectiles=Projectiles(made.mass, made.velocity),
        toughness=made.toughness,
        back=np.argsort(order),
    )


def _by_kernels(plate: PlateResponse | ReducedImpacts, strikes: Strikes) -> bool:
    """Whether the kernels run strikes: NumPy is faster with many cases at a time."""
    if kernels.LIBRARY is None or not isinstance(plate, PlateResponse):
        return False
    return next(iter(strikes.values())).own_law is None


def _together(
    checked: Problem,
    plate: PlateResponse | ReducedImpacts,
    measures: Sequence[Measure],
    history: bool,
    strikes: Strikes,
    judged: bool,
) -> Outcome:
    """Run cases of a plate; if judged, those with doubtful energies in full."""
    steps, dt = plate.steps, plate.dt
    most = max(1, FORCES // steps)
    if len(strikes) > most and not history and _by_kernels(plate, strikes):
        run_some = partial(_together, checked, plate, measures, history, judged=judged)
        return merge([run_some(some) for some in split(strikes, most)], history=False)
    require_memory(ADVANCED_BYTES * steps * len(strikes), f"{len(strikes)} cases of {steps} steps")
    with np.errstate(all="ignore"):
        ordered = _ordered(strikes)
        struck = plate.impacts(ordered.hits)
        metrics = impact_metrics(
            struck.force,
            np.add.accumulate(np.full(steps, dt)),
            struck.indentation,
            ordered.projectiles,
            struck.plate,
            thresholds_of(checked, ordered.toughness),
            checked.judge.mobility,
        )
        strains = plate.strains if judged else {}
        peaks = {name: CasePeaks(*largest_sums(r, struck.force)) for name, r in strains.items()}
    outcome = outcome_of(
        ordered.numbers,
        metrics,
        last=struck.force[-1],
        steps=steps,
        dt=dt,
        unsettled=struck.unconverged_steps,
        force=struck.force.T if history else None,
    )
    largest = struck.indentation.largest
    judge_cases(outcome, checked, measures, metrics, peaks=peaks, indentation=largest)
    outcome = outcome.select(ordered.back)

    settled = (struck.error < ENERGY_WARNING) & (struck.unconverged_steps == 0)
    doubtful = ~settled[ordered.back]
    if not (judged and doubtful.any()):
        return outcome
    # Cases near the limits of a run are run in full, which accepts or rejects them.
    chosen = {number: strikes[number] for number in compress(strikes, doubtful)}
    full = _one_by_one(checked, measures, chosen)
    return merge([outcome.select(np.flatnonzero(~doubtful)), *full])
