"""Carries out a run: header, macro program, footer."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from fecm._version import __version__
from fecm.deck.model import Deck, Material
from fecm.deck.units import unit_names
from fecm.mechanics.failure import MODES
from fecm.mechanics.plate import UnsoundPlateError
from fecm.mechanics.plate_motion import DivergenceError
from fecm.mechanics.time_step import critical_time_step
from fecm.problem.build import ImpactModel
from fecm.problem.check_plausibility import contact_step
from fecm.problem.options import RunOptions
from fecm.problem.problem import Problem
from fecm.problem.slips import mode_of
from fecm.results.result import Result
from fecm.results.schema import FORMAT, FORMAT_VERSION
from fecm.results.sinks import Sink
from fecm.results.summary import OPEN_END
from fecm.simulation.macros import bind, bind_loop
from fecm.simulation.simulation import Observer, Simulation
from fecm.simulation.validity import warnings_of

# Error of the energy balance, relative to the supplied energy, that triggers a warning.
ENERGY_WARNING = 0.01


def simulate(
    problem: Problem,
    sink: Sink,
    options: RunOptions | None = None,
    observers: Sequence[Observer] = (),
) -> Simulation:
    """Run a problem into a sink and return the finished simulation; see :func:`run`."""
    simulation = Simulation(problem, sink, options or RunOptions(), observers=observers)
    run(simulation)
    return simulation


def run(simulation: Simulation) -> None:
    """Carry out a program, from its beginning or from the restored state.

    Raises DivergenceError, with the likely cause, if the motion grows without bound or the energy
    balance exceeds its limit.  Raises SingularStiffnessError if a static solution is
    requested and the plate is not held.
    """
    problem, state = simulation.problem, simulation.state
    if not state.position:
        _write_header(simulation)
        simulation.printer.problem(problem.deck, problem.mesh, simulation.model.plate)
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
        cause = _likely_cause(problem, simulation.model, state.dt)
        raise DivergenceError(diverged.step, f"{diverged.reason}; {cause}") from None
    _write_footer(simulation)
    _judge(simulation)


def _likely_cause(problem: Problem, model: ImpactModel, dt: float) -> str:
    """Explain a divergence, as far as the time step does."""
    try:
        plate = model.motion.plate
        critical = critical_time_step(plate)
        contact = contact_step(problem, plate, dt, critical)
    except UnsoundPlateError as error:
        return str(error)
    above = dt > critical
    cause = (
        f"DT = {dt:.4g} is {'above' if above else 'below'} the plate's critical time step "
        f"{critical:.4g}"
    )
    if above:
        return cause
    if contact is not None and dt >= contact.limit:
        return (
            f"{cause}, but not below {contact.limit:.4g}, the stable step with the contact's "
            f"stiffness k_t of about {contact.stiffness:.3g} (the contact needs DT < "
            f"2 (m/k_t)^(1/2), m = {contact.mass:.3g})"
        )
    if len({macro.value for macro in problem.deck.macros if macro.word == "DT"}) > 1:
        return f"{cause}, but DT changes: steps that alternate diverge below the critical one"
    return cause


def _write_header(simulation: Simulation) -> None:
    """Store the attributes of the file, the deck, and every dataset without its rows."""
    sink, options, deck = simulation.sink, simulation.options, simulation.problem.deck
    attributes = {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "fecm_version": __version__,
        "title": deck.title,
        "mode": mode_of(options.slips),
        "slips": sorted(options.slips),
        "solver": simulation.model.motion.solver,
        **options.rod_method.attributes,
        **({} if options.law is None else {"law": type(options.law).__name__}),
        **_units(deck),
    }
    sink.attributes("", attributes)
    sink.text("deck", deck.text or deck.to_text(), "the cards of the problem")
    at_nodes = deck.require(Material).integration.points < 0 and "tapes" not in options.slips
    simulation.recorder.create("nodes" if at_nodes else "gauss")


def _units(deck: Deck) -> dict[str, str]:
    """Attributes that name the units; empty without UNIT."""
    return {f"unit_{name}": unit for name, unit in unit_names(deck).items()}


def _write_footer(simulation: Simulation) -> None:
    """Store the permanent indentation, and the number of steps that did not converge."""
    state, threshold = simulation.state, simulation.problem.threshold
    if threshold is not None:
        values = {
            "force": threshold.force, "d_star": threshold.rigidity, "time": state.crossing,
            "margin": 1.0 - state.peak_force / threshold.force,
        }  # fmt: skip
        simulation.sink.attributes("threshold", values)
    impact, system = simulation.state.impact, simulation.model.impact
    if impact is None or system is None or not impact.plate.step:
        return
    values = {
        "permanent_indentation": system.law.permanent(impact.memory, impact.contact),
        "unsettled_steps": impact.unconverged_steps,
    }
    simulation.sink.attributes("history", values)


def _judge(simulation: Simulation) -> None:
    """Store reasons to doubt the result, if there are any."""
    notes: list[str] = []
    state, enforced = simulation.state, not simulation.options.slips
    error, step = state.balance.worst_error, state.balance.worst_step
    if error > ENERGY_WARNING:
        why = "" if enforced else " (not a failure, as slips are active)"
        notes.append(
            f"the energy balance is off by {error:.2%} of the supplied energy, at step {step}{why}"
        )
    if state.impact is not None and state.impact.unconverged_steps and enforced:
        notes.append(
            f"the contact iteration did not converge in {state.impact.unconverged_steps} "
            "steps; a smaller DT helps"
        )
    groups: dict[str, dict[str, Any]] = {
        "": _units(simulation.problem.deck), "failure": {"modes": list(MODES)}
    }  # fmt: skip
    result = Result(simulation.sink.arrays, {}, groups)
    notes += warnings_of(simulation, result)
    if result.still_in_contact:
        notes.append(OPEN_END)
    if notes:
        simulation.sink.attributes("", {"notes": notes})
