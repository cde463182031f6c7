"""Full runs of cases, as ``fecm run`` does, and the validity of cases."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fecm._typing import Floats
from fecm.authoring.case import Case, CasesError
from fecm.authoring.strike_values import strike_of
from fecm.authoring.time_values import with_clock
from fecm.authoring.values import apply_case, name_fault
from fecm.deck.macros import Body, Loop
from fecm.deck.model import Deck, Macro
from fecm.deck.units import unit_names
from fecm.judge.end import decided
from fecm.judge.exposures import band_of_largest
from fecm.judge.limits import EXPOSURE, INDENTATION, THRESHOLD, ModelLimit
from fecm.judge.validity import Extent, reasons_of
from fecm.mechanics.contact_law import Law
from fecm.mechanics.laminate import threshold_force
from fecm.mechanics.own_law import LawError
from fecm.mechanics.plate import PlateModel
from fecm.mechanics.plate_motion import DivergenceError
from fecm.problem.build import RunOptions
from fecm.problem.loading import LoadedDeck, load_deck
from fecm.problem.parts import residuals_of_deck, strengths_of_deck
from fecm.problem.problem import Problem
from fecm.results.exposures import count_evaluations, largest_exposures
from fecm.results.metrics import (
    BAND,
    EVALUATIONS,
    EXPOSURES,
    FACTOR,
    GAGE,
    HIT,
    RATIO,
    THRESHOLD_FORCE,
    IndentationMetrics,
    Metrics,
    Projectiles,
    impact_metrics,
)
from fecm.results.result import Result
from fecm.results.run_metrics import deflection_of
from fecm.results.sinks import MemorySink, Sink
from fecm.simulation.recorder import exposures_of
from fecm.simulation.run import run_program
from fecm.simulation.simulation import Criteria, Observer, Simulation
from fecm.sweeps.outcome import About, Outcome, outcome_of
from fecm.sweeps.task import BuildFunction, Measure, MeasureFunction, Plan, Settings

if TYPE_CHECKING:
    from fecm.mechanics.failure_monitor import FailureMonitor


class CasePeaks(NamedTuple):
    """Largest and last value of a history of cases, (cases,) each."""

    largest: Floats
    last: Floats


def thresholds_of(checked: Problem, toughness: Floats) -> Floats | None:
    """Return the delamination thresholds (force) of cases; None without a DELA segment.

    `toughness` (force/length) is (cases,).
    """
    if (threshold := checked.threshold) is None:
        return None
    values = {
        g: threshold_force(threshold.rigidity, g, threshold.number) for g in set(toughness.tolist())
    }
    return np.array([values[g] for g in toughness.tolist()])


def judge_cases(
    outcome: Outcome,
    checked: Problem,
    measures: Sequence[Measure],
    metrics: Metrics,
    *,
    peaks: Mapping[str, CasePeaks],
    indentation: Floats,
    of_rows: Collection[str] = (),
    largest: Mapping[ModelLimit, Floats] = MappingProxyType({}),
) -> None:
    """Add the validity of cases, and the measured columns with their open values.

    `peaks` has the strains of gages and the exposures, `indentation` (cases,) the largest values.
    `of_rows` has the reasons from the stored rows of a full run, `largest` the largest values in
    the rows of cases that are computed together.
    """
    rules, end, plate = checked.judge, metrics.end, metrics.plate
    decided_values = {name: decided(peak.largest, peak.last, end) for name, peak in peaks.items()}
    deflection = plate.largest
    if rules.mobility:  # the plate moves as a whole
        deflection = np.full(len(end), np.nan)
    exposures = [peak.largest for name, peak in peaks.items() if name in EXPOSURES]
    extent = Extent(
        end=end,
        largest={
            rules.deflection: deflection,
            INDENTATION: indentation,
            EXPOSURE: np.nanmax(exposures, axis=0) if exposures else np.nan,
            THRESHOLD: outcome.columns[About.REACHED],
            **largest,
        },
        threshold=metrics.columns.get(THRESHOLD_FORCE, np.nan),
        of_rows=of_rows,
    )
    ratio = metrics.deflection / rules.thickness
    if Measure.DEFLECTION in measures:
        decided_values[Measure.DEFLECTION] = metrics.deflection
    decided_values[RATIO] = np.where(np.isnan(deflection), np.nan, ratio)
    if checked.symmetry.lines:
        decided_values[FACTOR] = np.full(len(end), float(checked.symmetry.factor))
    outcome.columns |= {**decided_values, About.VALIDITY: rules.validity(extent)}


def whole_force(force: Floats, factor: int) -> Floats:
    """Return contact forces on the whole plate, from those on one of its symmetric parts."""
    return force if factor == 1 else factor * force


def peaks_of(measures: Sequence[Measure], result: Result) -> dict[str, CasePeaks]:
    """Return the peaks of the columns of a run that are measured on request."""
    peaks: dict[str, CasePeaks] = {}
    if Measure.GAGES in measures and "gages/number" in result:
        strains = np.abs(result["gages/strain"]).T
        numbers = result["gages/number"]
        for number, values in zip(numbers, strains, strict=True):
            peaks[f"{GAGE}{number}"] = CasePeaks(values.max(keepdims=True), values[-1:])
    for exposure in largest_exposures(result) if Measure.FAILURE in measures else ():
        last = exposure.exposure if exposure.time >= result["history/time"][-1] else 0.0
        peaks[f"exposure_{exposure.criterion}"] = CasePeaks(
            np.array([exposure.exposure]), np.array([last])
        )
    return peaks


FIELDS = ("DISP", "STRE", "PLYS", "REAC", "EIGE")  # macros that store or print fields
NEVER = 1e9  # steps between two rows of RODP


def problem_of_case(settings: Settings, case: Case) -> Problem:
    """Return the checked problem of a case with its time step.

    Raises CasesError if the case can't be run.
    """
    if settings.build is None:
        return with_clock(apply_case(settings.deck, case), settings.clock, case)
    (checked,) = built(settings.build, case).problems
    if unit_names(checked.deck) != unit_names(settings.deck):
        raise CasesError("build: the units of the deck differ from the other cases")
    return checked


def case_deck(planned: Plan, case: int) -> Deck:
    """Return the deck of a case with its time step; CasesError if the case can't be computed."""
    return problem_of_case(planned.settings, planned.cases[case]).deck


def built(build: BuildFunction, case: Case) -> LoadedDeck:
    """Build and check the deck of a case.

    Raises CasesError if it can't be built, or has an error.
    """
    try:
        deck = build(dict(case))
        if not isinstance(deck, Deck):
            raise TypeError(f"returned {type(deck).__name__}, not a Deck")
        prepared = load_deck(deck)
    except Exception as error:
        raise CasesError(f"build: {format_exception(error)}") from error
    if errors := prepared.errors():
        raise CasesError(errors[0].message)
    if not any(macro.word == "RODP" for macro in deck.macros):
        raise CasesError("build: the deck has no impact step (RODP)")
    return prepared


def with_hit(outcome: Outcome, checked: Problem, case: Case) -> Outcome:
    """Add the impact position to the cases that define one."""
    if "at" in case and checked.load_place is not None:
        for name, value in zip(HIT, checked.load_place, strict=True):
            outcome.columns[name] = np.where(outcome.fine, value, np.nan)
    return outcome


def run_in_full(
    problems: Mapping[int, Problem],
    measures: Sequence[Measure],
    measure: MeasureFunction | None = None,
    names: Collection[str] = (),
    *,
    law: Law | None = None,
) -> list[Outcome]:
    """Run problems of cases that differ only in residual stresses, strengths or toughness.

    One run has the motion of all cases, and its FAIL evaluates the exposures of each. It stores no
    fields unless a function measures them. `problems` has the number of each case, `names` the
    names of its values, which the columns of `measure` may not have.
    """
    sink = MemorySink()
    try:
        simulation = motion([*problems.values()], sink, measures, measure, law)
        run_program(simulation)
    except (DivergenceError, LawError, ArithmeticError) as error:
        return [Outcome.failed(dict.fromkeys(problems, str(error)))]
    arrays_of_case: list[dict[str, Floats]] = [{} for _ in problems]
    places = simulation.model.stress_places
    for number, other in enumerate(simulation.others, start=1):
        assert places is not None  # the program has FAIL
        arrays_of_case[number] = exposures_of(other.monitor, other.envelope, places)
    outcomes = []
    for (number, problem), arrays in zip(problems.items(), arrays_of_case, strict=True):
        shaped = {path: values.reshape(sink.arrays[path].shape) for path, values in arrays.items()}
        result = Result({**sink.arrays, **shaped}, sink.texts, sink.groups)
        outcome = _outcome(number, problem, measures, result, simulation.state.dt)
        if measure is not None:
            outcome.columns |= _measured(measure, result, names)
        outcomes.append(outcome)
    return outcomes


def motion(
    problems: Sequence[Problem],
    sink: Sink,
    measures: Sequence[Measure],
    measure: MeasureFunction | None = None,
    law: Law | None = None,
    observers: Sequence[Observer] = (),
) -> Simulation:
    """Return the simulation of problems that differ only in values of failure."""
    program = as_run(problems[0], measures, measure)
    simulation = Simulation(program, sink, RunOptions(law=law), observers=observers)
    if Measure.FAILURE in measures:
        simulation.others = [_criteria(simulation, problem) for problem in problems[1:]]
    return simulation


def as_run(
    checked: Problem, measures: Sequence[Measure], measure: MeasureFunction | None = None
) -> Problem:
    """Return the problem of a full run, which stores fields only for a function that measures."""
    return checked if measure is not None else without_output(checked, measures)


def _criteria(simulation: Simulation, checked: Problem) -> Criteria:
    """Return failure criteria of plies with the residual stresses and strengths of another case."""
    assert simulation.model.failure is not None
    with_residual = criteria_of_deck(simulation.model.failure, checked.deck, checked.plate)
    envelope = with_residual.start()
    if simulation.model.is_stressed_at_rest:
        with_residual.update(envelope, np.zeros((1, *checked.mesh.equations.shape)), [0.0])
    return Criteria(with_residual, envelope)


def criteria_of_deck(monitor: FailureMonitor, deck: Deck, plate: PlateModel) -> FailureMonitor:
    """Return a monitor with residual stresses and strengths of another deck of its plate."""
    residuals = residuals_of_deck(deck, plate.laminates)
    stresses = None if residuals is None else [residual.stresses for residual in residuals]
    return monitor.with_residual(stresses, strengths_of_deck(deck))


def _outcome(
    number: int, checked: Problem, measures: Sequence[Measure], result: Result, dt: float
) -> Outcome:
    """Return the outcome of a case from its result."""
    force, depth, times = (result[f"history/{n}"] for n in ("force", "indentation", "time"))
    about = result.attributes_of("history")
    permanent = np.array([about.get("permanent_indentation", 0.0)])
    indentation = IndentationMetrics(
        largest=np.maximum(depth.max(keepdims=True), 0.0),
        last=depth[-1:],
        permanent=permanent,
        work=result["energy/contact_work"][-1:],
    )
    strike, factor = strike_of(checked.deck), checked.symmetry.factor
    metrics = impact_metrics(
        force[:, None],
        times,
        indentation,
        Projectiles(strike.projectile.total_mass, strike.velocity),
        deflection_of(result),
        None if checked.threshold is None else checked.threshold.force,
        checked.judge.mobility,
        factor,
        checked.judge.plate_mass,
    )
    outcome = outcome_of(
        [number],
        metrics,
        last=force[-1:],
        steps=len(force),
        dt=dt,
        unsettled=np.array([about.get("unsettled_steps", 0)]),
        force=whole_force(force, factor)[None],
    )
    peaks = peaks_of(measures, result)
    judge_cases(
        outcome,
        checked,
        measures,
        metrics,
        peaks=peaks,
        indentation=indentation.largest,
        of_rows=reasons_of(result.validity),
    )
    if Measure.FAILURE in measures:
        count = np.array([float(count_evaluations(result))])
        outcome.columns |= dict.fromkeys(EVALUATIONS, count)
        band = band_of_largest(largest_exposures(result))
        if not any(np.isnan(outcome.columns[name][0]) for name in EXPOSURES if name in peaks):
            outcome.columns |= {name: np.array([end]) for name, end in zip(BAND, band, strict=True)}
    return outcome


def _measured(
    measure: MeasureFunction, result: Result, names: Collection[str]
) -> dict[str, Floats]:
    """Return the columns that the caller computes from the result of a case."""
    try:
        columns = measure(result)
        if not isinstance(columns, Mapping):
            raise TypeError(f"returned {type(columns).__name__}, not numbers by name")
        values = {name: np.asarray(value) for name, value in columns.items()}
    except Exception as error:
        raise CasesError(f"measure: {format_exception(error)}") from error
    for name, value in values.items():
        fault = name_fault(name)
        if name in names or name == "dt":
            fault = f"`{name}` is a name of the case; choose another"
        elif value.ndim or value.dtype.kind not in "biuf":
            fault = f"{name} is not a number"
        if fault:
            raise CasesError(f"measure: {fault}")
    return {name: value.astype(float)[None] for name, value in values.items()}


def stores_rows(checked: Problem, measures: Sequence[Measure] = ()) -> bool:
    """Return whether full runs keep the rows of RODP.

    They do if the cases share no response of a linear plate.
    """
    return checked.plate.nonlinear or Measure.FAILURE in measures


def without_output(checked: Problem, measures: Sequence[Measure] = ()) -> Problem:
    """Return a problem whose program stores no fields, except those that are measured.

    The rows of RODP stay where the run judges slope and strain by them.
    """
    dropped = {*FIELDS} if Measure.FAILURE in measures else {*FIELDS, "FAIL"}
    keeps_rows = stores_rows(checked, measures)

    def kept(body: Body) -> Iterator[Macro | Loop]:
        for item in body:
            if isinstance(item, Loop):
                yield replace(item, body=tuple(kept(item.body)))
            elif item.word not in dropped:
                is_silent = item.word == "RODP" and not keeps_rows
                yield replace(item, value=NEVER) if is_silent else item

    return replace(checked, program=tuple(kept(checked.program)))


def format_exception(error: Exception) -> str:
    """Format type and text of an exception in one line."""
    return f"{type(error).__name__}: {' '.join(str(error).split())}"
