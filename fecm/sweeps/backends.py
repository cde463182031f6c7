"""Tasks of a sweep, and the back ends that compute the impacts of a task on one plate.

A linear plate is stepped once under a unit force, and every impact follows by convolution with its
response. A nonlinear plate is run in full for each impact, or reduced to some bending modes.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fecm._machine import require_memory
from fecm._typing import Floats
from fecm.authoring.case import NO_THRESHOLD, PEAK_FORCE, THRESHOLD, Case, CasesError, Value
from fecm.authoring.impacts import Impacts, impacts_from_cards, impacts_of
from fecm.authoring.strike import strike_of
from fecm.authoring.timing import Clock, lengthened, with_clock
from fecm.authoring.values import apply_case
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
from fecm.sweeps.checks import ADVANCED_BYTES
from fecm.sweeps.in_full import (
    CasePeaks,
    in_one_motion,
    judge_cases,
    problem_of_case,
    run_case_in_full,
    thresholds_of,
    whole_force,
    with_hit,
)
from fecm.sweeps.outcome import About, Backend, Outcome, Status, merge, outcome_of
from fecm.sweeps.plan import (
    FORCES,
    Measure,
    MeasureFunction,
    Plan,
    Settings,
    Task,
    shares_plate,
)
from fecm.sweeps.reduced import ReducedImpacts, by_halvings, reduced
from fecm.sweeps.responses import (
    ComputedImpacts,
    Hits,
    about_rigid_motion,
    impacts,
    largest_sums,
    plate_response,
)
from fecm.sweeps.search import LONGER, UNTIL_OVER, Sought, search

# Tasks --------------------------------------------------------------------------------------------


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
    settings, of_plate = task.settings, task.plate_values
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
        outcome = backend.lengthened(backend.durations[0]).outcomes(impacts)
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
    for factor in backend.durations[1:]:
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
            strikes = {number: strike_of(problem.deck)}
            impacts = impacts_from_cards(strikes, settings.law, problem.symmetry.factor)
            backend = FullRuns(problem, settings.measures)
            outcome = search(backend, impacts, sought.quantity, np.array([level]))
    except CasesError as error:
        return Outcome.failed({number: str(error)})
    return outcome if settings.build else with_hit(outcome, problem, case)


# Back ends ----------------------------------------------------------------------------------------


def backend_of(
    problem: Problem,
    measures: Sequence[Measure] = (),
    *,
    modes: int | None = None,
    history: bool = True,
) -> Backend:
    """Return the back end for the plate of a problem, in bending modes if `modes` is given.

    Forces are kept with `history`.
    """
    if modes is not None:
        return BendingModes(problem, measures, modes, history)
    if shares_plate(problem):
        return ImpulseResponse(problem, measures, history)
    return FullRuns(problem, measures)


@dataclass
class ImpulseResponse:
    """Back end for a linear plate, stepped once under a unit force; impacts by convolution."""

    problem: Problem
    measures: Sequence[Measure] = ()
    history: bool = True
    computes_together = True
    lengthens = True
    _longer: dict[float, ImpulseResponse] = field(default_factory=dict)

    @property
    def durations(self) -> Sequence[float]:
        """Factors on the duration of the program; see :class:`Backend`."""
        return UNTIL_OVER if self.problem.work.at_most else LONGER

    @cached_property
    def response(self) -> PlateResponse:
        """Response of the plate to a unit force."""
        return _plate_response(self.problem, gages=Measure.GAGES in self.measures)

    def outcomes(self, impacts: Impacts, *, judged: bool = True) -> Outcome:
        """Compute impacts; see :class:`Backend`."""
        most = max(1, FORCES // self.response.steps)
        by_kernels = kernels.LIBRARY is not None and impacts.own_law is None
        if len(impacts) <= most or self.history or not by_kernels:  # NumPy likes many at a time
            return self._outcome(impacts, judged=judged)
        parts = np.split(np.arange(len(impacts)), range(most, len(impacts), most))
        outcomes = [self._outcome(impacts.select(rows), judged=judged) for rows in parts]
        return merge(outcomes, history=False)

    def _outcome(self, impacts: Impacts, *, judged: bool) -> Outcome:
        return _outcome_together(
            self.problem, self.response, self.measures, impacts, judged, history=self.history
        )

    def lengthened(self, factor: float) -> ImpulseResponse:
        """Return the back end of a run `factor` times as long."""
        if factor == 1:
            return self
        if factor not in self._longer:
            problem = lengthened(self.problem, factor)
            self._longer[factor] = ImpulseResponse(problem, self.measures, self.history)
        return self._longer[factor]


@dataclass
class BendingModes:
    """Back end for a nonlinear plate in some bending modes; impacts are advanced together."""

    problem: Problem
    measures: Sequence[Measure]
    modes: int
    history: bool = True
    computes_together = True

    @property
    def lengthens(self) -> bool:
        """Whether cases go on for longer: the program says so, as the reduction takes time."""
        return self.problem.work.at_most

    @property
    def durations(self) -> Sequence[float]:
        """Factors on the duration of the program; see :class:`Backend`."""
        return UNTIL_OVER if self.problem.work.at_most else LONGER

    @cached_property
    def plate(self) -> ReducedImpacts:
        """The reduced plate; CasesError if it can't be reduced."""
        return reduced(self.problem, self.modes)

    def outcomes(self, impacts: Impacts, *, judged: bool = True) -> Outcome:
        """Compute impacts, together if their time steps are halved as often."""
        parts = []
        for times, rows in by_halvings(self.plate, impacts).items():
            plate, chosen = self.plate.halved(times), impacts.select(rows)
            parts.append(
                _outcome_together(
                    self.problem, plate, self.measures, chosen, judged, history=self.history
                )
            )
        return merge(parts)

    def lengthened(self, factor: float) -> BendingModes:
        """Return the back end of a run `factor` times as long."""
        return replace(self, problem=lengthened(self.problem, factor)) if factor != 1 else self


@dataclass
class FullRuns:
    """Back end for any plate: one full run for each impact."""

    problem: Problem
    measures: Sequence[Measure] = ()
    measure: MeasureFunction | None = None  # computes more columns from the result of a run
    names: Collection[str] = ()  # of the values of the case, which these columns may not have
    computes_together = False
    lengthens = False
    durations = LONGER  # a run with OVER ends when it is decided

    def outcomes(self, impacts: Impacts, *, judged: bool = True) -> Outcome:
        """Run each impact."""
        return merge([self._outcome(impacts, row) for row in range(len(impacts))])

    def _outcome(self, impacts: Impacts, row: int) -> Outcome:
        problem = replace(self.problem, deck=impacts.deck(row))
        return run_case_in_full(
            impacts.numbers[row],
            problem,
            self.measures,
            self.measure,
            self.names,
            law=impacts.own_law,
        )

    def lengthened(self, factor: float) -> FullRuns:
        """Return the back end of a run `factor` times as long."""
        return replace(self, problem=lengthened(self.problem, factor)) if factor != 1 else self


class PlateResponse(NamedTuple):
    """Response of a plate to a unit force in its first step of size `dt`, and the mass it moves."""

    response: Floats
    dt: float
    node_mass: float
    mobility: float  # of the rigid motion, see :class:`~fecm.results.validity.Judge`
    strains: dict[str, Floats]  # response of every gage that is measured, by the name of its column

    @property
    def steps(self) -> int:
        """Number of steps."""
        return len(self.response)

    def impacts(self, hits: Hits) -> ComputedImpacts:
        """Compute many impacts."""
        struck = impacts(self.response, self.dt, self.node_mass, hits)
        if not self.mobility:
            return struck
        plate = about_rigid_motion(
            struck.plate, self.response, self.dt, self.mobility, hits, struck.force
        )
        return struck._replace(plate=plate)


def _plate_response(checked: Problem, *, gages: bool) -> PlateResponse:
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
        response,
        dt,
        1.0 / load.inverse_mass,
        checked.judge.mobility,
        dict(zip(names, strains, strict=True)),
    )


class _ByKind(NamedTuple):
    """Impacts sorted by the kind of their projectile."""

    numbers: list[int]
    hits: Hits
    projectiles: Projectiles
    toughness: Floats
    back: NDArray[np.intp]  # rows in the order of the impacts


def _by_kind(impacts: Impacts) -> _ByKind:
    order = np.argsort(impacts.kind, kind="stable")
    rows = impacts.select(order)
    law: Law[Floats] = HystereticLaw(rows.constants)
    if rows.own_law is not None:
        law = CaseByCase(rows.own_law, len(rows))
    return _ByKind(
        numbers=rows.numbers,
        hits=Hits(rows.kinds, rows.kind, rows.scale, law, rows.velocity),
        projectiles=Projectiles(rows.mass, rows.velocity),
        toughness=rows.toughness,
        back=np.argsort(order),
    )


def _outcome_together(
    checked: Problem,
    plate: PlateResponse | ReducedImpacts,
    measures: Sequence[Measure],
    impacts: Impacts,
    judged: bool,
    *,
    history: bool,
) -> Outcome:
    """Compute impacts on a plate; if judged, impacts with doubtful energies in full."""
    steps, dt = plate.steps, plate.dt
    require_memory(ADVANCED_BYTES * steps * len(impacts), f"{len(impacts)} cases of {steps} steps")
    with np.errstate(all="ignore"):
        ordered = _by_kind(impacts)
        struck = plate.impacts(ordered.hits)
        metrics = impact_metrics(
            struck.force,
            np.add.accumulate(np.full(steps, dt)),
            struck.indentation,
            ordered.projectiles,
            struck.plate,
            thresholds_of(checked, ordered.toughness),
            checked.judge.mobility,
            checked.symmetry.factor,
            checked.judge.plate_mass,
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
        force=whole_force(struck.force.T, checked.symmetry.factor) if history else None,
    )
    largest = struck.indentation.largest
    judge_cases(outcome, checked, measures, metrics, peaks=peaks, indentation=largest)
    outcome = outcome.select(ordered.back)

    settled = (struck.error < ENERGY_WARNING) & (struck.unconverged_steps == 0)
    doubtful = ~settled[ordered.back]
    if not (judged and doubtful.any()):
        return outcome
    # Cases near the limits of a run are run in full, which accepts or rejects them.
    full = FullRuns(checked, measures).outcomes(impacts.select(np.flatnonzero(doubtful)))
    return merge([outcome.select(np.flatnonzero(~doubtful)), full])
