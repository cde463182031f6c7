"""Search for the velocity at which the peak force of a run reaches a value."""

from __future__ import annotations

import numpy as np

from fecm.deck.model import Impact
from fecm.problem.problem import Problem
from fecm.sweeps.api import carry_out
from fecm.sweeps.cases import Case
from fecm.sweeps.plan import plan

# Velocities of the first round, their range relative to the deck's, and the last relative error.
COUNT, RANGE, ERROR = 25, 100.0, 1e-6


def velocity_of_peak(problem: Problem, force: float) -> float:
    """Lowest velocity found at which the contact force reaches a value; NaN if none does.

    The range from 1/100 to 100 times the deck's velocity is searched.  The runs of a round share
    the plate; later rounds gather around the interpolated velocity.
    """
    velocity = problem.deck.require(Impact).velocity
    values = np.geomspace(velocity / RANGE, velocity * RANGE, COUNT)
    while True:
        cases: list[Case] = [{"velocity": float(value)} for value in values]
        peaks = carry_out(problem, plan(problem, cases, history=False))["peak_force"]
        (above,) = np.nonzero(peaks >= force)
        if not len(above) or above[0] == 0:
            return float("nan") if not len(above) else float(values[0])
        after = above[0]
        low, high = values[after - 1 : after + 1]
        if high - low <= ERROR * high:
            return float(high)
        share = (force - peaks[after - 1]) / (peaks[after] - peaks[after - 1])
        offsets = (high - low) * 10.0 ** -np.arange(1.0, 9.0)
        guess = low + share * (high - low)
        around = np.concatenate([guess - offsets, guess + offsets])
        inside = around[(around > low) & (around < high)]
        values = np.unique(np.concatenate([[low, (low + high) / 2.0, high], inside]))
