"""Execution of a run: header, macro program, footer."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from fecm._errors import FecmError
from fecm.deck.model import Cure, Deck, Material
from fecm.deck.units import unit_names
from fecm.listing.slips import mode_of
from fecm.mechanics.elements import nodal
from fecm.mechanics.failure import largest_in_plies
from fecm.mechanics.own_law import law_name
from fecm.mechanics.plate_motion import DivergenceError
from fecm.problem.build import RunOptions
from fecm.problem.parts import strengths_of_deck
from fecm.problem.problem import Problem, Threshold
from fecm.results.exposures import AT_REST, count_evaluations
from fecm.results.metrics import VALIDITY
from fecm.results.result import Result
from fecm.results.schema import COMMENTS, KINEMATICS, Form, Kinematics, heading
from fecm.results.sinks import ReadOnce, Sink
from fecm.simulation.decision import history_attributes, symmetry_attributes
from fecm.simulation.macros import STORING, bind, bind_loop
from fecm.simulation.notes import judge_run
from fecm.simulation.simulation import Observer, Simulation
from fecm.simulation.state import cause_of_divergence

ENOUGH = 0.2  # seconds of steps that show what a step costs


def simulate(
    problem: Problem,
    sink: Sink,
    options: RunOptions | None = None,
    observers: Sequence[Observer] = (),
) -> Simulation:
    """Run a problem into a sink and return the finished simulation; see :func:`run_program`."""
    simulation = Simulation(problem, sink, options or RunOptions(), observers=observers)
    run_program(simulation)
    return simulation


def run_program(simulation: Simulation) -> Result:
    """Run a program from its start or from the restored state, and return its result.

    The result reads from the sink while the sink is open. Raises DivergenceError, with the likely
    cause, if the motion grows without bound or the energy balance exceeds its limit. Raises
    SingularStiffnessError if a static solution is requested and the plate is not held.
    """
    problem, state = simulation.problem, simulation.state
    if not state.position:
        _write_header(simulation)
        _evaluate_at_rest(simulation)
        simulation.printer.problem(problem.deck, problem.mesh, simulation.model.plate)
        simulation.printer.replaced(_own_parts(simulation.options))
    try:
        with np.errstate(all="ignore"):  # an overflow is reported as a divergence
            simulation.interpreter.run(
                partial(bind, simulation),
                state.position,
                partial(simulation.on_macro, simulation),
                partial(bind_loop, simulation),
            )
            if state.failure is not None:
                simulation.recorder.failure(state.failure)
            simulation.recorder.finish()
    except DivergenceError as diverged:
        cause = cause_of_divergence(problem, simulation.model, state.dt, simulation.options.law)
        raise DivergenceError(diverged.step, f"{diverged.reason}; {cause}") from None
    return _write_footer(simulation)


def _write_header(simulation: Simulation) -> None:
    """Store the attributes of the file, the deck, and every dataset without its rows."""
    sink, options, deck = simulation.sink, simulation.options, simulation.problem.deck
    plate = simulation.model.plate
    attributes = {
        **heading(Form.RUN, deck.title),
        "mode": mode_of(options.slips),
        "slips": sorted(options.slips),
        "solver": simulation.model.motion.solver,
        **({KINEMATICS: Kinematics.VON_KARMAN.value} if plate.nonlinear else {}),
        **options.rod_method.attributes,
        **_comments(deck),
        **_own_parts(options),
        **_units(deck),
        **symmetry_attributes(simulation.problem),
    }
    sink.attributes("", attributes)
    sink.deck(deck.text or deck.to_text())
    points = deck.require(Material).integration.points
    at_nodes = points < 0 and plate.rules.strains is nodal(-points)
    simulation.recorder.create("nodes" if at_nodes else "gauss")
    _write_cure(simulation)


MOST_COMMENTS = 10_000  # characters; an attribute of HDF5 has 64 KB


def _comments(deck: Deck) -> dict[str, str]:
    """Return the comments above the title of a deck that is as it was written."""
    comments = deck.comments[:MOST_COMMENTS] if deck.text else ""
    return {COMMENTS: comments} if comments else {}


def _own_parts(options: RunOptions) -> dict[str, str]:
    """Return the names of the user's parts that replace parts of the deck."""
    parts = {}
    if options.law is not None:
        parts["law"] = law_name(options.law)
    if options.projectile is not None:
        parts["projectile"] = options.projectile.name
    return parts


def _write_cure(simulation: Simulation) -> None:
    """Store the changes of CURE and the exposures of its residual stresses."""
    model, deck = simulation.model, simulation.problem.deck
    if model.cure is None or model.failure is None:
        return
    card, sink = deck.require(Cure), simulation.sink
    changes = {"cure": card.delta_t, "moisture": card.delta_c}
    sink.attributes("failure", changes if card.delta_c else {"cure": card.delta_t})
    largest: dict[str, float] = {}
    strengths = strengths_of_deck(deck)
    for number in simulation.problem.used_laminates:
        stresses = model.cure[number].stresses
        plies = simulation.problem.plate.laminates[number].plies.constants
        for top in largest_in_plies(strengths[number], plies, stresses, model.failure.criteria):
            largest[top.criterion] = max(largest.get(top.criterion, 0.0), top.exposure)
    for criterion, exposure in largest.items():
        sink.attributes(f"failure/{criterion}", {AT_REST: exposure})


def _evaluate_at_rest(simulation: Simulation) -> None:
    """Evaluate the exposures of the plate with FAIL before anything moves."""
    if simulation.model.is_stressed_at_rest:
        rest = np.zeros((1, *simulation.problem.mesh.equations.shape))
        STORING["FAIL"](simulation, [0], [0.0], rest)


def _units(deck: Deck) -> dict[str, str]:
    """Return the attributes that name the units; empty without UNIT."""
    return {f"unit_{name}": unit for name, unit in unit_names(deck).items()}


def _write_footer(simulation: Simulation) -> Result:
    """Store what is decided at the end of the run, and reasons to doubt the result."""
    sink = simulation.sink
    history = history_attributes(simulation)
    if history:
        sink.attributes("history", history)
    threshold = simulation.problem.threshold
    if threshold is not None:  # which the metrics need
        sink.attributes("threshold", {"force": threshold.force})
    result = Result(ReadOnce(sink), sink.texts, sink.groups, simulation.problem.deck)
    if threshold is not None:
        crossing = simulation.state.monitor.crossing
        sink.attributes("threshold", _threshold_attributes(threshold, crossing, result))
    if simulation.state.failure is not None:
        sink.attributes("failure", {"evaluations_in_contact": count_evaluations(result)})
    verdict = judge_run(simulation, result)
    said: dict[str, Any] = {VALIDITY: verdict.validity, "notes": verdict.notes}
    for name, value in said.items():
        if value:
            sink.attributes("", {name: value})
            result.attributes[name] = value
    return result


def _threshold_attributes(threshold: Threshold, crossing: float, result: Result) -> dict[str, Any]:
    """Return the attributes of the delamination threshold, first reached at time `crossing`."""
    return {
        "force": threshold.force,
        "d_star": threshold.rigidity,
        "time": crossing,
        "margin": result.metrics.get("threshold_margin", 1.0),
        "number": threshold.number,
        "interfaces": threshold.interfaces,
        "band": np.array(threshold.band),
    }


class _EnoughError(Exception):
    """The steps so far show how long a step takes."""


def seconds_of_steps(start: Callable[[Observer], Simulation]) -> tuple[float, float]:
    """Return the seconds of a run before its steps, and of a step, on this machine.

    `start` returns the simulation with an observer. Its first steps are timed; they store rows as
    often as the whole run does. Both values are NaN if these steps fail.
    """
    done, took = 0, 0.0
    begin = time.perf_counter()

    def look(simulation: Simulation) -> None:
        nonlocal done, took
        done, took = simulation.state.plate.step, time.perf_counter() - first
        if took >= ENOUGH:
            raise _EnoughError

    try:
        simulation = start(look)
        first = time.perf_counter()
        with contextlib.suppress(_EnoughError):
            run_program(simulation)
            done, took = simulation.state.plate.step, time.perf_counter() - first
    except (FecmError, ArithmeticError):
        return math.nan, math.nan
    return first - begin, took / max(1, done)
