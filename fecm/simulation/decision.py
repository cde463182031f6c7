"""When the end of an impact is decided: the test of OVER, by the rows that are stored so far."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from fecm._typing import Array, Floats
from fecm.deck.units import unit_names
from fecm.judge.end import RINGING, End
from fecm.judge.limits import LATE_VALUE
from fecm.mechanics.failure import MODES
from fecm.problem.problem import Problem
from fecm.results.metrics import FACTOR, INITIAL_PLATE, MOBILITY, PLATE_MASS, REST_W, START_W
from fecm.results.result import Result
from fecm.results.run_metrics import end_of, steps_to_decide
from fecm.simulation.simulation import Simulation

# Least number of steps between two looks at the impact, over the steps so far: of a projectile that
# leaves, and of a projectile that still approaches in contact.
AGAIN, APPROACHING = 0.02, 0.25


def history_attributes(simulation: Simulation) -> dict[str, Any]:
    """Return the attributes of the history after the last step; empty without impact steps."""
    impact, system = simulation.state.impact, simulation.model.impact
    if impact is None or system is None or not impact.plate.step:
        return {}
    attributes = {
        "permanent_indentation": system.law.permanent(impact.memory, impact.contact),
        "unsettled_steps": impact.unconverged_steps,
        PLATE_MASS: simulation.problem.judge.plate_mass,
    }
    if impact.start_w:
        attributes[START_W] = impact.start_w
        if simulation.state.rest_factor is not None:
            attributes[REST_W] = impact.start_w
    if mobility := simulation.problem.judge.mobility:
        attributes[MOBILITY] = mobility
    return attributes


def symmetry_attributes(problem: Problem) -> dict[str, int]:
    """Return the attribute of a symmetric part; empty for a whole plate."""
    factor = problem.symmetry.factor
    return {FACTOR: factor} if factor > 1 else {}


def undoubted(simulation: Simulation, datasets: Mapping[str, Array]) -> Result:
    """Return the result so far, before it is judged, with what its metrics need."""
    problem, first = simulation.problem, simulation.recorder.steps
    groups: dict[str, dict[str, Any]] = {
        "": {
            **{f"unit_{name}": unit for name, unit in unit_names(problem.deck).items()},
            **symmetry_attributes(problem),
        },
        "failure": {"modes": list(MODES)},
        "history": history_attributes(simulation),
        "energy": {"initial": first.initial, INITIAL_PLATE: first.initial_plate},
    }
    if problem.threshold is not None:
        groups["threshold"] = {"force": problem.threshold.force}
    return Result(datasets, {}, groups, problem.deck)


def steps_to_come(simulation: Simulation) -> int:
    """Return after how many steps the end of the impact may be decided; 0 if it is.

    It is decided if the contact is over, and if the deflection of a plate that is held has not
    risen in the last fifth of the time. The answer depends on the history so far alone.
    """
    state = simulation.state
    steps, impact = state.plate.step, state.impact
    if impact is None or not steps:
        return 0
    least = math.ceil(AGAIN * steps)
    if impact.contact.force > 0.0:
        approaches = impact.rod.velocity[0] < 0.0
        return math.ceil(APPROACHING * steps) if approaches else least
    result = undoubted(simulation, simulation.recorder.steps_so_far(steps))
    if end_of(result) is not End.OVER:
        return max(least, steps_to_decide(result) or 0)
    if simulation.problem.judge.mobility:
        return 0
    time, dt = result["history/time"], state.dt
    waiting = risen_at(result["history/plate_w"], time) / LATE_VALUE.value - time[-1]
    return max(least, math.ceil(waiting / dt)) if waiting > 0.0 else 0


def risen_at(w: Floats, time: Floats) -> float:
    """Return the time at which a displacement first came within RINGING of its largest value."""
    return float(time[np.argmax(RINGING * w >= w.max())])
