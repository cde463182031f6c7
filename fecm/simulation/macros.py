"""The words of the macro program, one function each.

A word with a number on its card receives it.  An action returns True to leave the innermost loop.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from fecm.deck.macros import WORDS, number
from fecm.deck.records import Macro, load_factor
from fecm.mechanics.natural_modes import modes
from fecm.mechanics.statics import reactions
from fecm.mechanics.stiffness_product import SAFE
from fecm.mechanics.strains import strains_and_resultants
from fecm.mechanics.time_step import critical_time_step, taken_time_step
from fecm.simulation.interpreter import Action, EndedError
from fecm.simulation.simulation import Simulation

# Time and loads ----------------------------------------------------------------------------------


def set_time_step(run: Simulation, dt: float) -> None:
    """DT; 0 takes a fraction of the critical time step."""
    run.state.dt = dt
    if not dt:
        plate, problem = run.model.motion.plate, run.problem
        known = plate is problem.moving_plate  # unless a slip changes the plate
        critical = problem.critical_time_step if known else critical_time_step(plate)
        run.state.dt = dt = taken_time_step(critical)
        run.state.notes.append(f"DT 0: took {dt:g}, {SAFE:g} of the critical {critical:.4g}")


def advance_clock(run: Simulation) -> None:
    """TIME; does nothing under its slip."""
    if "time" not in run.options.slips:
        run.state.clock += run.state.dt


def proportional_load(run: Simulation, n: float) -> None:
    """PROP: read a table, or (under the slip ``prop``) take its value at t = 0."""
    state, tables = run.state, run.problem.deck.tables
    if n > 0:
        if state.tables_read < len(tables):
            state.table = state.tables_read
            state.tables_read += 1
        state.constant_factor = 0.0
    elif state.table is not None:
        state.constant_factor = load_factor(tables[state.table], 0.0)
    if "prop-contact" in run.options.slips:
        state.prop_force = run.load_factor(state.clock)


# Time steps --------------------------------------------------------------------------------------


def impact_step(run: Simulation, n: int) -> None:
    """RODP: one impact step; contact and strains at every N-th."""
    state, impact, system = run.state, run.state.impact, run.model.impact
    if system is None or impact is None:
        return
    plate, recorder, slips = state.plate, run.recorder, run.options.slips
    if not plate.step:
        recorder.steps.begin(plate, impact)
        state.prop_force = None  # the listing's first impact step begins with PROP = 0
    stores = _counted(run, n) if "counter" in slips else not (plate.step + 1) % n
    if stores and "tapes" in slips:  # strains one step late
        recorder.strains(plate.step + 1, plate.time, run.displacement_field())
    system.advance(impact, state.dt, run.force_factor(), state.prop_force)
    state.prop_force = None
    recorder.steps.step(plate, impact, run.force_factor(), contact_row=stores)
    if stores and "tapes" not in slips:
        recorder.strains(plate.step, plate.time, run.displacement_field())
    run.observe()


def _counted(run: Simulation, n: int) -> bool:
    """Whether the step stores output, under the slip ``counter``."""
    state = run.state
    state.steps_since_output += 1
    stores = state.steps_since_output == n
    if state.steps_since_output >= n:
        state.steps_since_output = 0
    return stores


def central_difference(run: Simulation) -> None:
    """EXCD: one step of the plate alone, under the nodal forces."""
    state, plate = run.state, run.state.plate
    if not plate.step:
        run.recorder.steps.begin(plate, state.impact)
    # The loads belong to the state's own time, which TIME has advanced past.
    run.model.motion.central_difference(plate, state.dt, run.force_factor(state.load_clock))
    state.load_clock = state.clock
    run.recorder.steps.step(plate, state.impact, run.force_factor())
    run.observe()


# Statics and modes -------------------------------------------------------------------------------


def form_tangent(run: Simulation) -> None:
    """TANG."""
    run.state.factorised = run.tangent is not None


def form_residual(run: Simulation) -> None:
    """FORM."""
    run.state.residual = run.model.motion.unbalanced(run.state.plate, run.force_factor())


def solve(run: Simulation) -> None:
    """SOLV."""
    state = run.state
    if not state.factorised or state.residual is None:
        return
    change = run.tangent.solve(state.residual)
    run.model.motion.displace(state.plate, change)
    size = float(np.linalg.norm(state.plate.displacement))
    state.converged = float(np.linalg.norm(change)) <= state.tolerance * size


def set_tolerance(run: Simulation, tolerance: float) -> None:
    """TOL."""
    run.state.tolerance = tolerance


def leave_if_converged(run: Simulation) -> bool:
    """CONV: leave the loop if the last SOLV met the tolerance."""
    return run.state.converged


def form_mass(run: Simulation, *, consistent: bool) -> None:
    """LMAS and CMAS."""
    run.state.consistent_mass = consistent


def find_modes(run: Simulation, n: int) -> None:
    """EIGE."""
    state, plate = run.state, run.model.plate
    found = modes(plate, n, consistent=state.consistent_mass)
    pairs = zip(found.angular_frequency, found.shapes, strict=True)
    for mode, (omega, shape) in enumerate(pairs, start=1):
        columns = {"number": mode, "angular_frequency": omega, "shape": plate.field(shape, 0.0)}
        run.recorder.row("modes", state.plate.step, state.plate.time, columns)
    run.printer.modes(found.angular_frequency)


# Output ------------------------------------------------------------------------------------------


def store_displacements(run: Simulation, n: int) -> None:
    """DISP."""
    if run.interpreter.current_pass % n:
        return
    plate, field = run.state.plate, run.displacement_field()
    run.recorder.displacements(plate.step, plate.time, field)
    if run.state.impact is None:
        run.printer.displacements(field, plate.time)


def store_reactions(run: Simulation) -> None:
    """REAC."""
    plate = run.state.plate
    force = reactions(run.model.plate, run.displacement_field(), run.force_factor())
    run.recorder.row("reactions", plate.step, plate.time, {"force": force})
    run.printer.reactions(force, run.problem.mesh, plate.time)


def store_stresses(run: Simulation, n: int) -> None:
    """STRE."""
    if run.interpreter.current_pass % n:
        return
    plate, points = run.state.plate, run.model.stress_points
    values = strains_and_resultants(points, run.model.plate.laminate, run.displacement_field())
    run.recorder.row("stresses", plate.step, plate.time, values)
    places = points.places(run.problem.mesh.coordinates)
    run.printer.stresses(values, places, run.state.clock)


def store_ply_stresses(run: Simulation, n: int) -> None:
    """PLYS."""
    if run.model.plies is None or run.interpreter.current_pass % n:
        return
    plate, values = run.state.plate, run.model.plies.evaluate(run.displacement_field())
    run.recorder.row("plies", plate.step, plate.time, values)


def evaluate_failure(run: Simulation, n: int) -> None:
    """FAIL."""
    envelope, monitor = run.state.failure, run.model.failure
    if envelope is None or monitor is None or run.interpreter.current_pass % n:
        return
    monitor.update(envelope, run.displacement_field(), run.state.plate.time)


def check(run: Simulation) -> None:
    """CHEC: store and print sizes; ends the program under its slip."""
    plate = run.model.plate
    profile = plate.profile()
    run.sink.attributes("mesh", {"equations": plate.neq, "profile": profile})
    run.printer.check(plate, profile)
    if "check-end" in run.options.slips:
        raise EndedError


ACTIONS: dict[str, Callable[..., bool | None]] = {
    "DT": set_time_step,
    "TIME": advance_clock,
    "PROP": proportional_load,
    "LMAS": partial(form_mass, consistent=False),
    "CMAS": partial(form_mass, consistent=True),
    "TANG": form_tangent,
    "FORM": form_residual,
    "SOLV": solve,
    "TOL": set_tolerance,
    "CONV": leave_if_converged,
    "REAC": store_reactions,
    "EIGE": find_modes,
    "EXCD": central_difference,
    "RODP": impact_step,
    "DISP": store_displacements,
    "STRE": store_stresses,
    "PLYS": store_ply_stresses,
    "FAIL": evaluate_failure,
    "CHEC": check,
}


def bind(run: Simulation, macro: Macro) -> Action:
    """Return the action of a macro."""
    action = ACTIONS[macro.word]
    if WORDS[macro.word].value:
        return partial(action, run, number(macro))
    return partial(action, run)
