"""Notes about the membrane force of a nonlinear plate: its time step, and the threshold of DELA."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from fecm.deck.units import quantity, unit_of
from fecm.mechanics.points import shortest_side
from fecm.results.result import Result
from fecm.simulation import peaks
from fecm.simulation.simulation import Simulation

# Share of the largest frequency that the time step allows, from which on there is a note.
NEAR = 0.95
# Share of the bending stress at the load from which on membrane stress counts there.
STRETCHED = 0.2


def doubts(simulation: Simulation, result: Result) -> Iterator[str]:
    """Notes about the stored rows of a nonlinear plate; none of a linear one."""
    if "membrane/largest_force" in result:
        yield from _time_step(simulation, result)
        yield from _delamination(simulation, result)


def _time_step(simulation: Simulation, result: Result) -> Iterator[str]:
    """Note of a membrane force that brings the largest frequency near to 2/DT.

    w^2 <= w_linear^2 + N k^2/(rho h), where k is that of the shortest wave of the mesh, whose
    length is the shortest side: nodes are half a side apart.
    """
    from fecm.mechanics.stretching import principal_values  # 0.5 ms, for NONL only

    problem, dt, plate = simulation.problem, simulation.state.dt, simulation.model.motion.plate
    largest = peaks.membrane_force(result)
    # The frequencies of the linear plate contain the preload.
    mean, radius = principal_values(np.array(plate.preload))
    tension = largest.value - float(mean - radius)
    if not simulation.state.plate.step or tension <= 0.0 or plate is not problem.moving_plate:
        return
    side = min(map(shortest_side, plate.families))
    growth = tension * (2.0 * math.pi / side) ** 2 / min(one.mass for one in plate.laminates)
    allowed = (2.0 / dt) ** 2
    if (2.0 / problem.safe_time_step) ** 2 + growth <= NEAR**2 * allowed:
        return
    linear = (2.0 / problem.critical_time_step) ** 2
    # A time step that is as near to that of the linear plate was chosen so.
    limit = allowed * (NEAR**2 if linear < NEAR**2 * allowed else 1.0)
    if linear + growth > limit:
        force = quantity(largest.value, unit_of("force/length", result.units))
        at = quantity(largest.time, unit_of("time", result.units))
        share = math.sqrt((linear + growth) / allowed)
        yield (
            f"the membrane force reaches {force} at time {at}: it may raise the plate's largest "
            f"frequency from {math.sqrt(linear / allowed):.1%} of 2/DT to {share:.1%}; a smaller "
            "DT is safer"
        )


def _delamination(simulation: Simulation, result: Result) -> Iterator[str]:
    """Note of a load under which the plate stretches when DELA's threshold is reached."""
    crossing = simulation.state.monitor.crossing
    if simulation.problem.threshold is None or "membrane/force_at_load" not in result:
        return
    if math.isnan(crossing):
        crossing = float(result["history/time"][result["history/force"].argmax()])
    row = int(np.abs(result["membrane/time"] - crossing).argmin())
    at, force, moment = (
        float(result[f"membrane/{name}"][row])
        for name in ("time", "force_at_load", "moment_at_load")
    )
    bending = 6.0 * moment / simulation.problem.laminate.thickness
    if bending > 0.0 and force > STRETCHED * bending:
        time = quantity(at, unit_of("time", result.units))
        pull = quantity(force, unit_of("force/length", result.units))
        yield (
            f"at time {time} the membrane force under the load is {pull}, {force / bending:.0%} of "
            "6 M/h: the threshold of DELA is that of a plate in bending"
        )
