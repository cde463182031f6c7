"""Run cases of a sweep: together if they share a plate, otherwise one by one.

Cases share a plate if they differ only in projectile, impact velocity or contact law.  The plate is
then stepped once under a unit force; every case follows by convolution with its response.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache, partial
from itertools import compress
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fecm._memory import require
from fecm._typing import Floats
from fecm.api import LoadedDeck, load_deck
from fecm.deck.findings import Findings
from fecm.deck.macros import compile_program, flat
from fecm.deck.model import Deck, Impact, Projectile
from fecm.deck.model import Indentation as LawCards
from fecm.deck.units import unit_names
from fecm.mechanics.contact_law import HystereticLaw, stacked
from fecm.mechanics.plate_motion import DivergenceError
from fecm.mechanics.projectile import RigidMass
from fecm.mechanics.time_step import taken_time_step
from fecm.problem.build import build_model
from fecm.problem.check import check_impact, check_program, check_segment
from fecm.problem.parts import build_law, build_projectile
from fecm.problem.problem import Problem
from fecm.results.end import Texts, decided
from fecm.results.exposures import count_evaluations, largest_exposures
from fecm.results.metrics import (
    EVALUATIONS,
    EXPOSURES,
    GAGE,
    HIT,
    RATIO,
    VALIDITY,
    Indentation,
    Projectiles,
    summarise,
)
from fecm.results.result import Result
from fecm.results.sinks import MemorySink
from fecm.results.validity import Extent
from fecm.simulation.judge import ENERGY_WARNING
from fecm.simulation.run import simulate
from fecm.sweeps import find_exposure, plan
from fecm.sweeps.cases import EXPOSURE, THRESHOLD, Case, CasesError, Value, name_fault, plate_values
from fecm.sweeps.find import Decks, Runs, found
from fecm.sweeps.plan import RUN, Outcome, merge, outcome_of
from fecm.sweeps.responses import Hits, impacts, largest_sums, plate_response
from fecm.sweeps.vary import (
    Clock,
    apply_case,
    check_deck,
    lengthened,
    raise_first,
    with_time_step,
)

UNIT = RigidMass(1.0)


def run(task: plan.Task) -> Outcome:
    """Run the cases of a task; a case that cannot be run becomes a row with the reason."""
    if task.alone:
        cases = zip(task.numbers, task.cases, strict=True)
        return merge([_in_full(task, number, case) for number, case in cases], task.history)
    first = plate_values(task.cases[0])
    plate = tuple(first.items())
    try:
        checked, runs = _prepared(task.deck, plate, task.clock, task.extra, task.history)
    except CasesError as error:
        return Outcome.failed(dict.fromkeys(task.numbers, str(error)))
    decks: dict[int, Deck] = {}
    lost: dict[int, str] = {}
    for number, case in zip(task.numbers, task.cases, strict=True):
        try:
            deck = apply_case(checked.deck, {n: v for n, v in case.items() if n not in first})
            findings = Findings()
            check_impact(Problem(deck, checked.mesh, checked.program), findings)
            check_segment(deck.require(LawCards), findings)
            if (projectile := deck.last(Projectile)) is not None:
                check_segment(projectile, findings)
            raise_first(findings)
            decks[number] = deck
        except CasesError as error:
            lost[number] = str(error)
    parts = [Outcome.failed(lost)]
    if decks:
        force = _threshold(checked) if task.until == THRESHOLD else task.until
        if force is None:
            outcome = runs(decks, True)
        else:
            outcome = found(decks, float(force), partial(_longer, task, checked, runs))
        parts.append(_with_hit(outcome, checked, first))
    return merge(parts, task.history)


@lru_cache(maxsize=1)
def _prepared(
    deck: Deck, plate: tuple[tuple[str, Value], ...], clock: Clock | None,
    extra: tuple[str, ...], history: bool,
) -> tuple[Problem, Runs]:  # fmt: skip
    """The problem of a plate, given by values of names, and what runs its cases."""
    checked = _timed(deck, clock, dict(plate))
    return checked, runs_of(checked, extra, history=history)


def _in_full(task: plan.Task, number: int, case: Case) -> Outcome:
    """Run a case whose deck the caller builds, or whose result the caller measures."""
    try:
        if task.build is None:
            checked = _timed(task.deck, task.clock, case)
        else:
            (checked,) = built(task.build, case).problems
            if unit_names(checked.deck) != unit_names(task.deck):
                raise CasesError("build: the units of the deck are not those of the other cases")
        if task.sought == EXPOSURE and task.until is not None:
            runs = partial(_with_deck, number, checked, task.extra)
            outcome = find_exposure.found(number, checked.deck, float(task.until), runs)
        else:
            outcome = _alone(number, checked, task.extra, task.measure, case)
        return _with_hit(outcome, checked, {} if task.build else case)
    except CasesError as error:
        return Outcome.failed({number: str(error)})


def _with_deck(number: int, checked: Problem, extra: Sequence[str], deck: Deck) -> Outcome:
    """Run another deck of the same plate in full."""
    return _alone(number, replace(checked, deck=deck), extra)


def _with_hit(outcome: Outcome, checked: Problem, case: Case) -> Outcome:
    """Add the place that is hit, of cases that give one."""
    if "at" in case and checked.load_place is not None:
        fine = np.isin(outcome.columns["status"], RUN)
        for name, value in zip(HIT, checked.load_place, strict=True):
            outcome.columns[name] = np.where(fine, value, np.nan)
    return outcome


def built(build: plan.Build, case: Case) -> LoadedDeck:
    """Build and check the deck of a case; CasesError if it cannot be built, or has an error."""
    try:
        deck = build(dict(case))
        if not isinstance(deck, Deck):
            raise TypeError(f"returned {type(deck).__name__}, not a Deck")
        prepared = load_deck(deck)
    except Exception as error:
        raise CasesError(f"build: {told(error)}") from error
    if errors := prepared.errors():
        raise CasesError(errors[0].message)
    if not any(macro.word == "RODP" for macro in deck.macros):
        raise CasesError("build: the deck has no impact step (RODP)")
    return prepared


def _measured(measure: plan.Measure, result: Result, case: Case) -> dict[str, NDArray[Any]]:
    """Columns that the caller computes from the result of a case."""
    try:
        found = measure(result)
        if not isinstance(found, Mapping):
            raise TypeError(f"returned {type(found).__name__}, not numbers by name")
        values = {name: np.asarray(value) for name, value in found.items()}
    except Exception as error:
        raise CasesError(f"measure: {told(error)}") from error
    for name, value in values.items():
        fault = name_fault(name)
        if name in case or name == "dt":
            fault = f"`{name}` is a name of the case; choose another"
        elif value.ndim or value.dtype.kind not in "biuf":
            fault = f"{name} is not a number"
        if fault:
            raise CasesError(f"measure: {fault}")
    return {name: value.astype(float)[None] for name, value in values.items()}


def told(error: Exception) -> str:
    """Type and text of an exception in one line."""
    return f"{type(error).__name__}: {' '.join(str(error).split())}"


def runs_of(checked: Problem, extra: Sequence[str] = (), *, history: bool = True) -> Runs:
    """Return the function that runs decks which share the plate of a problem."""
    if plan.shares_plate(checked):
        return partial(_together, checked, _plate(checked, extra), extra, history)
    return lambda decks, judged: merge(
        [_alone(number, replace(checked, deck=deck), extra) for number, deck in decks.items()]
    )


def _longer(task: plan.Task, checked: Problem, runs: Runs, factor: int) -> Runs:
    """What runs the cases of a plate `factor` times as long."""
    if factor == 1:
        return runs
    return runs_of(lengthened(checked, factor), task.extra, history=task.history)


def deck_of(planned: plan.Plan, case: int) -> Deck:
    """Return the deck of a case with its time step; CasesError if the case cannot be run."""
    return _timed(planned.deck, planned.clock, planned.cases[case]).deck


def _timed(base: Deck, clock: Clock | None, case: Case) -> Problem:
    """Apply a case to a deck, with the time step of its plate, and check it."""
    deck = apply_case(base, case)
    if clock is None:
        return check_deck(deck)
    own, rule = clock
    checked = check_deck(with_time_step(deck, 0.0))  # below the critical time step of any plate
    duration = float(case["duration"]) if "duration" in case else None
    timed = with_time_step(deck, rule(checked.critical_time_step), own, duration)
    findings = Findings()
    problem = Problem(timed, checked.mesh, compile_program(timed.macros, findings))
    check_program(problem, findings)
    raise_first(findings)
    return problem


def _threshold(checked: Problem) -> float | None:
    """Delamination threshold of a plate, force; None without a DELA segment."""
    return None if checked.threshold is None else checked.threshold.force


class Plate(NamedTuple):
    """Response of a plate to a unit force in its first step of size `dt`, and the mass it moves."""

    response: Floats
    dt: float
    node_mass: float
    strains: dict[str, Floats]  # response of every gage that is measured, by the name of its column


def _plate(checked: Problem, extra: Sequence[str]) -> Plate:
    setup = build_model(checked)
    assert setup.impact is not None  # the program has impact steps
    load, steps = setup.impact.contact.load, checked.work.steps
    dt = next(macro.value for macro in flat(checked.program) if macro.word == "DT")
    dt = dt or taken_time_step(checked.critical_time_step)
    gages = setup.gages if plan.GAGES in extra else None
    names = [] if gages is None else [f"{GAGE}{number}" for number in gages.numbers]
    sums = None if gages is None else setup.motion.dof_sums(gages.dof_indices, gages.weights)
    with np.errstate(all="ignore"):
        response, strains = plate_response(setup.motion, load, dt, steps, sums)
    return Plate(response, dt, 1.0 / load.inverse_mass, dict(zip(names, strains, strict=True)))


def _together(
    checked: Problem, plate: Plate, extra: Sequence[str], history: bool, decks: Decks, judged: bool
) -> Outcome:
    """Run cases by the response of their plate; if judged, those with doubtful energies in full."""
    steps, dt, numbers = len(plate.response), plate.dt, list(decks)
    rods = [build_projectile(deck) for deck in decks.values()]
    # All rigid masses are one kind: a unit mass under the force over the mass.
    units = [UNIT if isinstance(rod, RigidMass) else rod for rod in rods]
    kinds = {unit: number for number, unit in enumerate(dict.fromkeys(units))}
    kind = np.array([kinds[unit] for unit in units], dtype=np.intp)
    order = np.argsort(kind, kind="stable")  # cases with the same projectile are adjacent
    mass = np.array([rod.total_mass for rod in rods])[order]
    scale = np.where([units[case] is UNIT for case in order], mass, 1.0)
    require(plan.ADVANCED * steps * len(decks), f"{len(decks)} cases of {steps} steps")
    ordered = [decks[numbers[case]] for case in order]
    with np.errstate(all="ignore"):
        law = HystereticLaw(stacked([build_law(deck).constants for deck in ordered]))
        speed = np.array([deck.require(Impact).velocity for deck in ordered])
        hits = Hits(list(kinds), kind[order], scale, law, speed)
        struck = impacts(plate.response, dt, plate.node_mass, hits)
        times = np.add.accumulate(np.full(steps, dt))
        hit, mobility = Projectiles(mass, speed), checked.judge.mobility
        threshold = _threshold(checked)
        metrics = summarise(struck.force, times, struck.indentation, hit, threshold, mobility)
        peaks = {n: largest_sums(r, struck.force) for n, r in plate.strains.items() if judged}
    peaks[plan.DEFLECTION] = struck.deflection
    numbers = [numbers[case] for case in order]
    last, unsettled = struck.force[-1], struck.unconverged_steps
    outcome = outcome_of(numbers, metrics, last, steps, dt, unsettled)
    _judge(outcome, checked, extra, metrics.end, peaks, struck.indentation.largest)
    if history:
        outcome.force = struck.force.T
    back = np.argsort(order)
    outcome = outcome.select(back)
    doubtful = (~(struck.error < ENERGY_WARNING) | (unsettled > 0))[back]
    if not (judged and doubtful.any()):
        return outcome
    # Cases near the limits of a run are run in full, which accepts or rejects them.
    some = compress(decks.items(), doubtful)
    full = [_alone(number, replace(checked, deck=deck), extra) for number, deck in some]
    return merge([outcome.select(np.flatnonzero(~doubtful)), *full])


def _judge(
    outcome: Outcome, checked: Problem, extra: Sequence[str], end: Texts,
    peaks: Mapping[str, tuple[Floats, Floats]], indentation: Floats,
) -> None:  # fmt: skip
    """Add the validity of cases, and the columns of what was measured, with its open values.

    `peaks` are the largest and last values, (cases,) each, of the deflection and of other columns.
    """
    judge, known = checked.judge, {name: decided(*peak, end) for name, peak in peaks.items()}
    deflection = peaks[plan.DEFLECTION][0] if not judge.mobility else np.full(len(end), np.nan)
    exposures = [largest for name, (largest, _) in peaks.items() if name in EXPOSURES]
    extent = Extent(
        end=end,
        peak=outcome.columns[plan.REACHED],
        indentation=indentation,
        deflection=deflection,
        exposure=np.nanmax(exposures, axis=0) if exposures else np.nan,
        threshold=np.nan if (force := _threshold(checked)) is None else force,
    )
    ratio = known.pop(plan.DEFLECTION) / judge.thickness
    if plan.DEFLECTION in extra:
        known[plan.DEFLECTION] = ratio * judge.thickness
    known[RATIO] = np.where(np.isnan(deflection), np.nan, ratio)
    outcome.columns |= {**known, VALIDITY: judge.validity(extent)}


def _measured_peaks(extra: Sequence[str], result: Result) -> dict[str, tuple[Floats, Floats]]:
    """Largest and last values of the deflection, and of columns that are measured on request."""
    w = result["history/plate_w"]
    values = {plan.DEFLECTION: w}
    if plan.GAGES in extra and "gages/number" in result:
        strains = np.abs(result["gages/strain"]).T
        values |= {f"{GAGE}{n}": s for n, s in zip(result["gages/number"], strains, strict=True)}
    peaks = {name: (v.max(keepdims=True), v[-1:]) for name, v in values.items()}
    for one in largest_exposures(result) if plan.FAILURE in extra else ():
        at_end = one.time >= result["history/time"][-1]
        last = one.exposure if at_end else 0.0
        peaks[f"exposure_{one.criterion}"] = np.array([one.exposure]), np.array([last])
    return peaks


def _alone(
    number: int, checked: Problem, extra: Sequence[str],
    measure: plan.Measure | None = None, case: Case | None = None,
) -> Outcome:  # fmt: skip
    """Run one case in full, without storing fields unless it is measured."""
    sink = MemorySink()
    try:
        simulation = simulate(checked if measure else plan.without_output(checked, extra), sink)
    except (DivergenceError, ArithmeticError) as error:
        return Outcome.failed({number: str(error)})
    force, depth, times = (sink.arrays[f"history/{n}"] for n in ("force", "indentation", "time"))
    about, dt = sink.groups["history"], simulation.state.dt
    permanent = np.array([about.get("permanent_indentation", 0.0)])
    indentation = Indentation(np.maximum(depth.max(keepdims=True), 0.0), depth[-1:], permanent)
    mass = build_projectile(checked.deck).total_mass
    speed = checked.deck.require(Impact).velocity
    hit, threshold = Projectiles(mass, speed), _threshold(checked)
    mobility = checked.judge.mobility
    metrics = summarise(force[:, None], times, indentation, hit, threshold, mobility)
    unsettled = np.array([about.get("unsettled_steps", 0)])
    outcome = outcome_of([number], metrics, force[-1:], len(force), dt, unsettled, force[None])
    result = Result(sink.arrays, sink.texts, sink.groups)
    peaks = _measured_peaks(extra, result)
    _judge(outcome, checked, extra, metrics.end, peaks, indentation.largest)
    if plan.FAILURE in extra:
        count = np.array([float(count_evaluations(result))])
        outcome.columns |= dict.fromkeys(EVALUATIONS, count)
    if measure is not None:
        outcome.columns |= _measured(measure, result, case or {})
    return outcome
