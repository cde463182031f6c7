"""Words of the macro program, one function each.

A word with a number on its card receives it. An action returns True to leave the innermost loop.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from fecm._typing import Floats
from fecm.deck.macros import WORDS, Body, every, load_factor, macro_number
from fecm.deck.model import Macro
from fecm.mechanics.impact_steps import FIELDS
from fecm.mechanics.membrane import strains_of_deflection
from fecm.mechanics.solutions import ConvergenceError, modes, reactions
from fecm.mechanics.stiffness_product import SAFE
from fecm.mechanics.strains import strains_and_resultants
from fecm.mechanics.time_step import critical_time_step, taken_time_step
from fecm.problem.supports import closed_in_words
from fecm.simulation.decision import steps_to_come
from fecm.simulation.interpreter import Action, EndedError, Passes
from fecm.simulation.recorder import Steps, Times
from fecm.simulation.simulation import Simulation


def set_time_step(run: Simulation, dt: float) -> None:
    """Execute DT; 0 takes a fraction of the critical time step."""
    run.state.dt = dt
    if not dt:
        plate, problem = run.model.motion.plate, run.problem
        is_moving_plate = plate is problem.moving_plate  # unless the options change the plate
        critical = problem.critical_time_step if is_moving_plate else critical_time_step(plate)
        run.state.dt = dt = taken_time_step(critical)
        run.state.notes.append(f"DT 0: took {dt:g}, {SAFE:g} of the critical {critical:.4g}")


def advance_clock(run: Simulation) -> None:
    """Execute TIME."""
    run.state.clock += run.model.variant.program.clock_rate * run.state.dt


def proportional_load(run: Simulation, n: float) -> None:
    """Execute PROP: read a table, or take its value at t = 0."""
    state, tables = run.state, run.problem.deck.tables
    if n > 0:
        if state.tables_read < len(tables):
            state.table = state.tables_read
            state.tables_read += 1
        state.constant_factor = 0.0
    elif state.table is not None:
        state.constant_factor = load_factor(tables[state.table], 0.0)
    state.prop_force = run.model.variant.program.prop_force(run.load_factor(state.clock))


def impact_step(run: Simulation, n: int) -> None:
    """Execute RODP: one impact step. Contact and strains are stored at every N-th step."""
    state, impact, system = run.state, run.state.impact, run.model.impact
    if system is None or impact is None:
        return
    plate, recorder, program = state.plate, run.recorder, run.model.variant.program
    if not plate.step:
        recorder.steps.begin(plate, impact)
        state.prop_force = None  # the first impact step begins with PROP = 0
    steps = state.steps_since_output + 1
    state.steps_since_output = steps if steps < n else 0
    stores = program.is_output(plate.step + 1, steps, n)
    if stores and program.strains_precede_step:
        recorder.strains([plate.step + 1], [plate.time], run.displacement_field()[None])
    factor = run.force_factor()
    if impact.start_w is None and run.model.motion.rests_under_load(plate, state.dt, factor):
        state.rest_factor = factor
    system.advance(impact, state.dt, factor, state.prop_force)
    state.prop_force = None
    factor = run.force_factor()
    if factor != state.rest_factor:
        state.rest_factor = None
    recorder.steps.step(
        plate,
        impact,
        factor,
        on_tape9=program.has_contact(stores),
        is_loaded_at_rest=state.rest_factor is not None,
    )
    if stores and not program.strains_precede_step:
        recorder.strains([plate.step], [plate.time], run.displacement_field()[None])
    run.observe()


def leave_if_over(run: Simulation, n: int, first: float) -> bool:
    """Execute OVER at every N-th pass, from the M-th on: leave the loop if the impact is over."""
    state = run.state
    since = run.interpreter.current_pass - int(first)
    if since < 0 or since % n or state.plate.step < state.undecided_until:
        return False
    if to_come := steps_to_come(run):
        state.undecided_until = state.plate.step + to_come
    return not to_come


def _passes_to_test(run: Simulation, over: Macro) -> int:
    """Return the number of passes up to the next one in which OVER looks at the impact."""
    n, first, number = every(over), int(over.second), run.interpreter.current_pass
    earliest = max(number, first, number + run.state.undecided_until - run.state.plate.step - 1)
    return earliest + (first - earliest) % n - number + 1


def impact_steps(run: Simulation, macros: Sequence[Macro]) -> bool:
    """Run passes of a loop with RODP in one call of the kernels.

    They end before OVER where it looks at the impact. The macros after OVER follow singly.
    """
    state, plate, steps = run.state, run.state.plate, run.model.steps
    impact, recorder = state.impact, run.recorder
    if impact is None or steps is None or not plate.step:
        return False
    if plate.dt != state.dt or plate.dt2 != state.dt * state.dt:
        return False
    if impact.start_w != 0.0:  # the kernels have a projectile that starts at 0
        return False
    count = min(run.interpreter.passes_to_come, run.interval - plate.step % run.interval)
    words = [macro.word for macro in macros]
    over = words.index("OVER") if "OVER" in words else len(words)
    until_test = _passes_to_test(run, macros[over]) if over < len(words) else math.inf
    count = int(min(count, until_test))
    later = np.arange(count)
    passes, numbers = run.interpreter.current_pass + later, plate.step + 1 + later
    due = {
        macro.word: (numbers if macro.word == "RODP" else passes) % int(macro_number(macro)) == 0
        for macro in macros
        if macro.word not in ("TIME", "OVER")
    }
    if count == until_test:
        for word in words[over + 1 :]:
            due[word][-1] = False
    (stored,) = np.nonzero(np.logical_or.reduce(list(due.values())))
    most = max(1, FIELDS // run.problem.mesh.equations.size)
    if len(stored) > most:
        count, stored = int(stored[most]), stored[:most]
    if count < 2:
        return False
    states = steps.take(impact, state.dt, count, stored)
    if any(item.word == "TIME" for item in macros):
        state.clock = float(np.add.accumulate([state.clock, *[state.dt] * count])[-1])
    recorder.steps.add(plate, states.columns, states.strains, due["RODP"][:count])
    for word, steps_due in due.items():
        chosen = steps_due[stored]
        if chosen.any():
            fields = states.fields if chosen.all() else states.fields[chosen]
            at_steps = states.columns["step"][stored[chosen]].astype(int).tolist()
            STORING[word](run, at_steps, states.columns["time"][stored[chosen]].tolist(), fields)
    if count == until_test:
        run.interpreter.skip(count - 1, item=over)
    else:
        run.interpreter.skip(count)
    run.observe()
    return True


def central_difference(run: Simulation) -> None:
    """Execute EXCD: one step of the plate under the nodal forces."""
    state, plate = run.state, run.state.plate
    if not plate.step:
        run.recorder.steps.begin(plate, state.impact)
    # The loads belong to the state's own time, which TIME has advanced past.
    run.model.motion.central_difference(plate, state.dt, run.force_factor(state.load_clock))
    state.load_clock = state.clock
    if state.impact is not None and run.model.impact is not None:
        state.impact.plate_w = run.model.impact.deflection(plate)
    run.recorder.steps.step(plate, state.impact, run.force_factor())
    run.observe()


PINNED = (
    "the supports leave the plate free in its plane: TANG pins the rigid motion, which changes no "
    "strain"
)


def form_tangent(run: Simulation) -> None:
    """Execute TANG: form the stiffness, about the present displacement unless it is constant."""
    if not run.model.plate.is_linear:
        run.linearise(run.displacement_field())
        if run.tangent.pins and PINNED not in run.state.notes:
            run.state.notes.append(PINNED)
    run.state.factorised = run.tangent is not None


def form_residual(run: Simulation) -> None:
    """Execute FORM."""
    run.state.residual = run.model.motion.unbalanced(run.state.plate, run.force_factor())


def solve_statics(run: Simulation) -> None:
    """Execute SOLV."""
    state = run.state
    if not state.factorised or state.residual is None:
        return
    change = run.tangent.solve(state.residual, state.plate.displacement)
    run.model.motion.displace(state.plate, change)
    size = float(np.linalg.norm(state.plate.displacement))
    state.converged = float(np.linalg.norm(change)) <= state.tolerance * size
    if not run.model.plate.is_linear and not math.isfinite(size):
        raise ConvergenceError(_not_in_equilibrium(run, "the displacement is no longer finite"))


def leave_if_converged(run: Simulation) -> bool:
    """Execute CONV: leave the loop if the last SOLV met the tolerance."""
    state = run.state
    if state.converged:
        state.equilibrium_factor = run.force_factor()
    elif not run.model.plate.is_linear and not run.interpreter.passes_to_come:
        passes = run.interpreter.current_pass
        raise ConvergenceError(_not_in_equilibrium(run, f"no equilibrium after {passes} passes"))
    return state.converged


def _not_in_equilibrium(run: Simulation, symptom: str) -> str:
    """Return the message about a load for which Newton's method fails."""
    factor, reached = run.force_factor(), run.state.equilibrium_factor
    return (
        f"{symptom} at the load factor {factor:g}; the last equilibrium was at {reached:g}. "
        "Apply the load in smaller steps (TIME and PROP in an outer LOOP)."
    )


def form_mass(run: Simulation, *, consistent: bool) -> None:
    """Execute LMAS or CMAS."""
    run.state.consistent_mass = consistent


def set_tolerance(run: Simulation, tolerance: float) -> None:
    """Execute TOL."""
    run.state.tolerance = tolerance


def find_modes(run: Simulation, n: int) -> None:
    """Execute EIGE: find the lowest modes, of small motions about the present displacement."""
    state, plate = run.state, run.model.plate
    about = None if plate.is_linear else run.displacement_field()
    if plate.supports is not None and plate.lifts:
        words = closed_in_words(plate.supports, run.displacement_field())
        state.notes.append(f"EIGE: {words}")
    natural_modes = modes(plate, n, consistent=state.consistent_mass, field=about)
    pairs = zip(natural_modes.angular_frequency, natural_modes.shapes, strict=True)
    for mode, (omega, shape) in enumerate(pairs, start=1):
        columns = {"number": mode, "angular_frequency": omega, "shape": plate.field(shape, 0.0)}
        run.recorder.row("modes", state.plate.step, state.plate.time, columns)
    run.printer.modes(natural_modes.angular_frequency)


def _at_passes(word: str, run: Simulation, n: int, _: float = 0.0) -> None:
    """Execute DISP, PLYS or FAIL at every N-th pass."""
    if not run.interpreter.current_pass % n:
        plate = run.state.plate
        STORING[word](run, [plate.step], [plate.time], run.displacement_field()[None])


def _store_displacements(run: Simulation, steps: Steps, times: Times, fields: Floats) -> None:
    run.recorder.rows("tape3", steps, times, {"w": fields[:, :, 2], "displacement": fields})
    run.recorder.supports(steps, times, fields)
    if run.state.impact is None:
        run.recorder.stretching(steps, times, fields)
        for time, field in zip(times, fields, strict=True):
            run.printer.displacements(field, time)


def _store_ply_stresses(run: Simulation, steps: Steps, times: Times, fields: Floats) -> None:
    if run.model.plies is not None:
        for step, time, field in zip(steps, times, fields, strict=True):
            run.recorder.row("plies", step, time, run.model.plies.evaluate(field))


def _evaluate_failure(run: Simulation, steps: Steps, times: Times, fields: Floats) -> None:
    envelope, monitor, places = run.state.failure, run.model.failure, run.model.stress_places
    if envelope is not None and monitor is not None and places is not None:
        exposures = monitor.update(envelope, fields, times)
        run.recorder.rows("exposures", steps, times, monitor.located(exposures, places))
        for other in run.others:
            other.monitor.update(other.envelope, fields, times)


# What is done with displacement fields, (rows, numnp, 5), at every N-th step of RODP or pass.
STORING: dict[str, Callable[[Simulation, Steps, Times, Floats], None]] = {
    "RODP": lambda run, *rows: run.recorder.strains(*rows),
    "DISP": _store_displacements,
    "PLYS": _store_ply_stresses,
    "FAIL": _evaluate_failure,
}
AT_PASSES = ("DISP", "PLYS", "FAIL")  # those that are macros of their own


def store_reactions(run: Simulation) -> None:
    """Execute REAC."""
    plate = run.state.plate
    force = reactions(run.model.plate, run.displacement_field(), run.force_factor())
    run.recorder.row("reactions", plate.step, plate.time, {"force": force})
    run.printer.reactions(force, run.problem.mesh, plate.time)


def store_stresses(run: Simulation, n: int) -> None:
    """Execute STRE."""
    if run.interpreter.current_pass % n:
        return
    plate, model, points = run.state.plate, run.model.plate, run.model.stress_points
    field = run.displacement_field()
    stretch = strains_of_deflection(model, points, field)
    values = strains_and_resultants(points, model.rows_by_laminate, field, model.preload, stretch)
    run.recorder.row("stresses", plate.step, plate.time, values)
    run.printer.stresses(values, points.places(run.problem.mesh.coordinates), run.state.clock)


def store_sizes(run: Simulation) -> None:
    """Execute CHEC: store and print sizes."""
    plate = run.model.plate
    profile = plate.profile()
    run.sink.attributes("mesh", {"equations": plate.neq, "profile": profile})
    run.printer.check(plate, profile)


ACTIONS: dict[str, Callable[..., bool | None]] = {
    "DT": set_time_step,
    "TIME": advance_clock,
    "PROP": proportional_load,
    "LMAS": partial(form_mass, consistent=False),
    "CMAS": partial(form_mass, consistent=True),
    "TANG": form_tangent,
    "FORM": form_residual,
    "SOLV": solve_statics,
    "TOL": set_tolerance,
    "CONV": leave_if_converged,
    "OVER": leave_if_over,
    "REAC": store_reactions,
    "EIGE": find_modes,
    "EXCD": central_difference,
    "RODP": impact_step,
    **{word: partial(_at_passes, word) for word in AT_PASSES},
    "STRE": store_stresses,
    "CHEC": store_sizes,
}


def bind_loop(run: Simulation, body: Body) -> Passes | None:
    """Return a function that runs passes of a loop together.

    Returns None if the macros of the loop need single steps.
    """
    macros = [item for item in body if isinstance(item, Macro)]
    words = [macro.word for macro in macros]
    if run.model.steps is None or len(macros) < len(body):
        return None
    if words.count("RODP") != 1 or len(set(words)) < len(words):
        return None
    first = words.index("RODP")
    over = words.index("OVER") if "OVER" in words else len(words)
    before, after, after_over = words[:first], words[first + 1 : over], words[over + 1 :]
    if {*before} <= {"TIME"} and {*after} <= {"TIME", *AT_PASSES} and {*after_over} <= {*AT_PASSES}:
        return partial(impact_steps, run, macros)
    return None


def _end_after(action: Action) -> None:
    action()
    raise EndedError


def bind(run: Simulation, macro: Macro) -> Action:
    """Return the action of a macro."""
    word = WORDS[macro.word]
    values = [macro_number(macro)] if word.value else []
    values += [macro.second] if word.second else []
    action: Action = partial(ACTIONS[macro.word], run, *values)
    is_last = macro.word in run.model.variant.program.last_words
    return partial(_end_after, action) if is_last else action
