"""Search for the velocity at which the peak force of a run reaches a value."""

from __future__ import annotations

import numpy as np

from fecm.deck.model import Impact
from fecm.problem.problem import Problem
from fecm.sweeps.api import carry_out
from fecm.sweeps.cases import Case
from fecm.sweeps.plan import plan

# Velocities per round, the range of the first round relative to the deck's, and the last error.
COUNT, RANGE, ERROR = 25, 100.0, 1e-6


def velocity_of_peak(problem: Problem, force: float) -> float:
    """Lowest velocity found at which the contact force reaches a value; NaN if none does.

    The range from 1/100 to 100 times the deck's velocity is searched in rounds of
    :data:`COUNT` runs that share the plate, to a relative error of 1e-6.
    """
    velocity = problem.deck.require(Impact).velocity
    values = np.geomspace(velocity / RANGE, velocity * RANGE, COUNT)
    while True:
        cases: list[Case] = [{"velocity": float(value)} for value in values]
        peaks = carry_out(problem, plan(problem, cases, history=False))["peak_force"]
        (above,) = np.nonzero(peaks >= force)
        if not len(above) or above[0] == 0:
            return float("nan") if not len(above) else float(values[0])
        low, high = values[above[0] - 1], values[above[0]]
        if high - low <= ERROR * high:
            return float(high)
        values = np.linspace(low, high, COUNT)
