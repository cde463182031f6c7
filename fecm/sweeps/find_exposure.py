"""Search for the velocity at which the largest exposure of a case reaches a value."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from fecm.results.exposures import FEWEST
from fecm.results.metrics import EVALUATIONS, EXPOSURES
from fecm.sweeps.case import CasesError
from fecm.sweeps.find import LONGER, RANGE, with_found
from fecm.sweeps.outcome import Outcome
from fecm.sweeps.strike import Strike

ERROR = 1e-5  # largest relative excess of the exposure found
MOST = 40  # runs of a case; a smooth dependence takes about six


def found(
    number: int, start: Strike, level: float, run: Callable[[Strike, int], Outcome]
) -> Outcome:
    """Run a case at the velocity at which its largest exposure outside the load reaches a level.

    Every trial is a full run, as exposures need the whole plate.  `run` takes a strike and how many
    times as long the run is; one that leaves the exposure open is repeated, longer.  Raises
    CasesError with the reason if no velocity is found.
    """
    outcomes: dict[float, Outcome] = {}
    factors = list(LONGER)  # those that are left

    def exposure(velocity: float) -> float:
        while factors:
            outcome = outcomes[velocity] = run(start.with_velocity(velocity), factors[0])
            largest = _largest_exposure(outcome, velocity)
            if not math.isnan(largest):
                return largest
            del factors[0]
        text = f"open even in a run {LONGER[-1]} times as long"
        raise CasesError(f"at velocity {velocity:.6g} the largest exposure is {text}")

    velocity = search(start.velocity, level, exposure)
    return with_found(outcomes[velocity], {number: start.with_velocity(velocity)})


def _largest_exposure(outcome: Outcome, velocity: float) -> float:
    """Largest exposure of a run, NaN if it is open; CasesError if the run has none to rely on."""
    at = f"at velocity {velocity:.6g}"
    if not outcome.fine[0]:
        raise CasesError(f"{at}: {outcome.status[0]}")
    values = [float(outcome.columns[name][0]) for name in EXPOSURES if name in outcome.columns]
    if values and np.isnan(values).any():
        return math.nan
    (counted,) = EVALUATIONS
    if (count := int(outcome.columns[counted][0])) < FEWEST or not values:
        why = f"FAIL was evaluated {count} times during contact, less than {FEWEST}"
        raise CasesError(f"{at}: {why}")
    return max(values)


def search(start: float, level: float, exposure: Callable[[float], float]) -> float:
    """Find a velocity at which an exposure is at the level, or above it by at most :data:`ERROR`.

    Secants in the logarithms, as the exposure is almost a power of the velocity; a bracket guards
    them once it is known.  Raises CasesError if there is none within 1/100 to 100 times the start.
    """
    least, most = math.log(start / RANGE), math.log(start * RANGE)
    low, high = -math.inf, math.inf  # bracket
    x, slope, last = math.log(start), 1.0, None
    for _ in range(MOST):
        velocity = math.exp(x)
        found = exposure(velocity)
        if not found > 0.0:
            raise CasesError(f"there is no exposure at velocity {velocity:.6g}")
        y = math.log(found / level)
        if 0.0 <= y <= ERROR:
            return velocity
        if x <= least and y > 0.0:
            raise CasesError(f"the exposure is above {level:.6g} from velocity {velocity:.6g} on")
        if x >= most and y < 0.0:
            raise CasesError(f"the exposure is below {level:.6g} up to velocity {velocity:.6g}")
        low, high = (x, high) if y < 0.0 else (low, x)
        if last is not None and (y - last[1]) / (x - last[0]) > 0.0:
            slope = (y - last[1]) / (x - last[0])
        last = x, y
        x = min(max(x - (y - ERROR / 2.0) / slope, least), most)
        if not low < x < high:
            x = (low + high) / 2.0
        if x in (low, high):
            break
    raise CasesError(f"no exposure of {level:.6g}: it jumps at velocity {math.exp(x):.6g}")
