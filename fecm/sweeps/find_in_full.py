"""Searches by full runs for the velocity at which a quantity of a case reaches a value."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

from fecm.results.exposures import FEWEST
from fecm.results.metrics import BAND, EVALUATIONS, EXPOSURES, FOUND_BAND
from fecm.sweeps.case import CasesError
from fecm.sweeps.find import LONGER, RANGE, Sought, with_found
from fecm.sweeps.outcome import Outcome
from fecm.sweeps.strike import Strike

ERROR = 1e-5  # largest relative excess of the value found
USUAL = 5  # runs of a case, if the value depends smoothly on the velocity
MOST = 40
APART = 1e-3  # least relative distance of the trials that give a slope
NAMES = {Sought.PEAK_FORCE: "peak force", Sought.EXPOSURE: "exposure"}


def found(
    number: int,
    start: Strike,
    quantity: Sought,
    level: float,
    run: Callable[[Strike, int], Outcome],
) -> Outcome:
    """Run a case at the velocity at which its peak force or largest exposure reaches a level.

    Every trial is a full run: exposures need the whole plate, and a nonlinear plate has no impulse
    response.  `run` takes a strike and how many times as long the run is; one that leaves the
    value open is repeated, longer.  Raises CasesError with the reason if no velocity is found.
    """
    outcomes: dict[float, Outcome] = {}
    factors = list(LONGER)  # those that are left
    largest = largest_exposure if quantity is Sought.EXPOSURE else peak_force

    def reached(velocity: float) -> float:
        at = f"at velocity {velocity:.6g}"
        while factors:
            outcome = outcomes[velocity] = run(start.with_velocity(velocity), factors[0])
            if not outcome.fine[0]:
                raise CasesError(f"{at}: {outcome.status[0]}")
            try:
                value = largest(outcome)
            except CasesError as error:
                raise CasesError(f"{at}: {error}") from None
            if not math.isnan(value):
                return value
            del factors[0]
        text = f"open even in a run {LONGER[-1]} times as long"
        raise CasesError(f"{at} the largest {NAMES[quantity]} is {text}")

    velocity = search(start.velocity, level, reached, NAMES[quantity])
    outcome = with_found(outcomes[velocity], {number: start.with_velocity(velocity)})
    if quantity is Sought.EXPOSURE:
        exposures = {v: largest_exposure(one) for v, one in outcomes.items()}
        _add_band(outcome, velocity, level, exposures)
    return outcome


def _add_band(
    outcome: Outcome, velocity: float, level: float, exposures: Mapping[float, float]
) -> None:
    """Add the energies at which finer meshes may reach the level, from the band of the exposure.

    Near the velocity that was found the exposure is a power of the velocity, by the nearest other
    trial; without one it is proportional to it.
    """
    columns = outcome.columns
    if not columns.keys() >= {*BAND}:
        return
    exponent = 1.0
    apart = {v: abs(math.log(v / velocity)) for v in exposures}
    others = [v for v, distance in apart.items() if distance > APART]
    if others:
        other = min(others, key=apart.__getitem__)
        slope = math.log(exposures[other] / exposures[velocity]) / math.log(other / velocity)
        exponent = slope if slope > 0.0 else exponent
    for name, end in zip(FOUND_BAND, reversed(BAND), strict=True):
        with np.errstate(divide="ignore"):
            columns[name] = columns["found_energy"] * (level / columns[end]) ** (2.0 / exponent)


def peak_force(outcome: Outcome) -> float:
    """Peak force of a run, NaN if it is open."""
    return float(outcome.columns[Sought.PEAK_FORCE][0])


def largest_exposure(outcome: Outcome) -> float:
    """Largest exposure of a run, NaN if it is open; CasesError if the run has none to rely on."""
    values = [float(outcome.columns[name][0]) for name in EXPOSURES if name in outcome.columns]
    if values and np.isnan(values).any():
        return math.nan
    (counted,) = EVALUATIONS
    if (count := int(outcome.columns[counted][0])) < FEWEST or not values:
        raise CasesError(f"FAIL was evaluated {count} times during contact, less than {FEWEST}")
    return max(values)


def search(
    start: float, level: float, reached: Callable[[float], float], name: str = "exposure"
) -> float:
    """Find a velocity at which a value is at the level, or above it by at most :data:`ERROR`.

    Secants in the logarithms, as the value is almost a power of the velocity; a bracket guards
    them once it is known.  Raises CasesError if there is none within 1/100 to 100 times the start.
    """
    least, most = math.log(start / RANGE), math.log(start * RANGE)
    low, high = -math.inf, math.inf  # bracket
    x, slope, last = math.log(start), 1.0, None
    for _ in range(MOST):
        velocity = math.exp(x)
        found = reached(velocity)
        if not found > 0.0:
            raise CasesError(f"there is no {name} at velocity {velocity:.6g}")
        y = math.log(found / level)
        if 0.0 <= y <= ERROR:
            return velocity
        if x <= least and y > 0.0:
            raise CasesError(f"the {name} is above {level:.6g} from velocity {velocity:.6g} on")
        if x >= most and y < 0.0:
            raise CasesError(f"the {name} is below {level:.6g} up to velocity {velocity:.6g}")
        low, high = (x, high) if y < 0.0 else (low, x)
        if last is not None and (y - last[1]) / (x - last[0]) > 0.0:
            slope = (y - last[1]) / (x - last[0])
        last = x, y
        x = min(max(x - (y - ERROR / 2.0) / slope, least), most)
        if not low < x < high:
            x = (low + high) / 2.0
        if x in (low, high):
            break
    raise CasesError(f"no {name} of {level:.6g}: it jumps at velocity {math.exp(x):.6g}")
