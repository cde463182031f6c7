"""Searches for the impact velocity at which a quantity of a case reaches a level."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from fecm._typing import Bools, Floats
from fecm.authoring.case import NO_THRESHOLD, CasesError
from fecm.deck.macros import EXTENDED
from fecm.deck.model import Deck, Delamination, Impact
from fecm.judge.limits import FAIL_EVALUATIONS
from fecm.results.metrics import BAND, EVALUATIONS, EXPOSURES, FOUND_BAND
from fecm.sweeps.impact_columns import Impacts
from fecm.sweeps.limits import PEAK_FORCE, THRESHOLD, level_of, parse_exceed
from fecm.sweeps.outcome import About, Backend, Outcome, merge

Until = float | str | Mapping[str, float | str]  # what a search reaches; see :func:`search_of`
RANGE = 100.0  # of velocities relative to the deck's
FIRST_VELOCITIES = 25  # of the first round of a search
VELOCITY_ERROR = 1e-6  # relative error of the velocity found
ROUGH = 1e-4  # relative difference of the peak force from its level that counts as a jump
# Factors on the duration, until the peak at the velocity found is known.  A deck with OVER has
# steps for the longest impacts: its cases begin with a part of them.
LONGER = (1, 2, 4, 8)
UNTIL_OVER = (1 / EXTENDED, 2 / EXTENDED, 1, 2)
BELOW = "the peak force is below"


class Sought(StrEnum):
    """Quantity of a search."""

    PEAK_FORCE = PEAK_FORCE
    EXPOSURE = "exposure"


class Search(NamedTuple):
    """Search for the impact velocity at which a quantity reaches a level."""

    quantity: Sought
    level: float | str  # a number, or of the peak force :data:`~fecm.sweeps.limits.THRESHOLD`

    def check(self, deck: Deck, names: Collection[str]) -> None:
        """Raise CasesError if the search is not possible in cases of a deck with these names."""
        if not {"velocity", "energy"}.isdisjoint(names):
            raise CasesError("velocity is searched; it can't be varied as well")
        if not deck.require(Impact).velocity:
            raise CasesError("the search starts at the velocity of ROD, which must not be 0")
        if self.level == THRESHOLD:
            if deck.last(Delamination) is None:
                raise CasesError(NO_THRESHOLD)
        elif not (isinstance(self.level, float | int) and 0.0 < self.level < math.inf):
            name = self.quantity.replace("_", " ")
            raise CasesError(f"the {name} to reach is a positive number, not {self.level}")


def parse_until(text: str) -> Until:
    """Parse ``peak_force=VALUE`` or ``exposure=NUMBER``; :func:`with_level` converts the value.

    Raises CasesError if the text is neither.
    """
    name, _, value = (part.strip() for part in text.partition("="))
    if name not in tuple(Sought) or not value:
        forms = f"peak_force=NUMBER or peak_force={THRESHOLD}, or exposure=NUMBER"
        raise CasesError(f"`{text}`: write {forms}")
    if value == THRESHOLD:
        parse_exceed(text)  # only the peak force has one
    return {name: value}


def with_level(until: Until | None, system: str | None) -> Until | None:
    """Return a search whose level, if it is a text such as ``6kN``, is a number of the system.

    Raises CasesError if the text is not a number or its unit does not fit.
    """
    if isinstance(until, str) and until != THRESHOLD:
        return level_of(PEAK_FORCE, until, system)
    if isinstance(until, Mapping):
        return {
            name: level_of(name, level, system)
            if isinstance(level, str) and level != THRESHOLD
            else level
            for name, level in until.items()
        }
    return until


def search_of(until: Until | None) -> Search | None:
    """Return the search for a level.

    The searched quantity is the peak force, or one named quantity.
    """
    if until is None:
        return None
    if not isinstance(until, Mapping):
        return Search(Sought.PEAK_FORCE, until)
    if len(until) != 1 or not {*until} <= {*Sought}:
        example = '{"exposure": 1.0}'
        raise CasesError(f"until is {until!r}; write a number, {THRESHOLD!r} or {example}")
    ((name, level),) = until.items()
    return Search(Sought(name), level)


def search(backend: Backend, impacts: Impacts, quantity: Sought, levels: Floats) -> Outcome:
    """Find the impact velocities at which a quantity of each impact reaches its level, (rows,).

    A back end that computes many impacts together gets rounds of velocities from 1/100 to 100 times
    the velocities of the impacts; the lowest velocity counts. Another back end gets one velocity
    after the other, starting at the velocities of the impacts. If the value is open, longer runs
    decide it.
    """
    if backend.computes_together:
        return _search_together(backend, impacts, levels)
    rows = range(len(impacts))
    return merge([_search_row(backend, impacts, row, quantity, float(levels[row])) for row in rows])


def _search_together(backend: Backend, impacts: Impacts, forces: Floats) -> Outcome:
    """Find the velocities for peak forces; longer runs decide open values."""
    remaining, parts = np.arange(len(impacts)), []
    for factor in backend.durations:
        longer, still_open = backend.lengthened(factor), []
        together = math.ceil(
            len(remaining) / max(1, factor)
        )  # as many forces in memory as at first
        for start in range(0, len(remaining), together):
            rows = remaining[start : start + together]
            outcome, is_open = _searched(longer, impacts.select(rows), forces[rows])
            parts.append(outcome)
            still_open.append(rows[is_open])
        remaining = np.concatenate(still_open)
        if not len(remaining):
            return merge(parts)
    text = f"it is open even in a run {backend.durations[-1]} times as long"
    reasons = {
        impacts.numbers[row]: f"no peak force of {forces[row]:.6g}: {text}"
        for row in remaining.tolist()
    }
    return merge([*parts, Outcome.failed(reasons)])


def _with_velocities(outcome: Outcome, impacts: Impacts) -> Outcome:
    """Add the velocities of the impacts, and their energies."""
    outcome.columns |= {"found_velocity": impacts.velocity, "found_energy": impacts.energy}
    return outcome


def _searched(backend: Backend, impacts: Impacts, forces: Floats) -> tuple[Outcome, Bools]:
    """Find velocities. Returns the outcome of the decided impacts, and a mask of the open ones."""

    def tried(pairs: list[tuple[int, float]]) -> Outcome:
        rows, velocities = np.array([row for row, _ in pairs]), np.array([v for _, v in pairs])
        return backend.outcomes(impacts.at_velocities(rows, velocities), judged=False)

    starts = dict(enumerate(impacts.velocity.tolist()))
    levels = dict(enumerate(forces.tolist()))
    searched = lowest_velocities(starts, levels, lambda pairs: tried(pairs).columns[About.REACHED])
    reasons = {row: v for row, v in searched.items() if isinstance(v, str)}
    is_open = np.zeros(len(impacts), dtype=bool)
    # What is not reached in a run that is too short may be reached in a longer one.
    if low := [row for row, text in reasons.items() if text.startswith(BELOW)]:
        highest = tried([(row, starts[row] * RANGE) for row in low])
        is_open[low] = np.isnan(highest.columns[PEAK_FORCE])
    failed = {impacts.numbers[row]: v for row, v in reasons.items() if not is_open[row]}
    parts = [Outcome.failed(failed)]

    velocities = {row: v for row, v in searched.items() if isinstance(v, float)}
    if velocities:
        rows = np.array(list(velocities))
        numbers = [impacts.numbers[row] for row in velocities]
        trials = impacts.at_velocities(rows, np.array(list(velocities.values())))
        hit = replace(trials, numbers=numbers)
        outcome = _with_velocities(backend.outcomes(hit), hit)
        open_rows = outcome.fine & np.isnan(outcome.columns[PEAK_FORCE])
        is_open[rows[open_rows]] = True
        parts += _decided(outcome, forces[rows], ~open_rows)
    return merge(parts), is_open


def _decided(outcome: Outcome, force: Floats, peak_is_known: Bools) -> list[Outcome]:
    """Return the outcome of the cases whose peak is known.

    Cases fail if their peak is not the required force.
    """
    reached, velocity = outcome.columns[About.REACHED], outcome.columns["found_velocity"]
    right = outcome.fine & peak_is_known & (np.abs(reached - force) <= ROUGH * force)
    reasons = {}
    for row in np.flatnonzero(~right & peak_is_known):
        text = f"at velocity {velocity[row]:.6g}: {outcome.status[row]}"
        if outcome.fine[row]:
            jump = f"from velocity {velocity[row]:.6g} on it is {reached[row]:.6g}"
            text = f"no peak force of {force[row]:.6g}: {jump}, and below it jumps"
        reasons[outcome.numbers[row]] = text
    return [outcome.select(np.flatnonzero(right)), Outcome.failed(reasons)]


def lowest_velocities(
    starts: Mapping[int, float],
    forces: Mapping[int, float],
    peaks: Callable[[list[tuple[int, float]]], Floats],
) -> dict[int, float | str]:
    """Find the lowest velocity of each case at which the contact force reaches its value.

    The range from 1/100 to 100 times the start is searched, by rounds of velocities. Later rounds
    gather around the interpolated velocity of the bracket, whose upper end is the result. `peaks`
    returns the largest forces of pairs of case and velocity; NaN where unknown. A text is the
    reason why a case has no velocity.
    """
    lowest: dict[int, float | str] = dict.fromkeys(starts, "")
    trials = {n: np.geomspace(v / RANGE, v * RANGE, FIRST_VELOCITIES) for n, v in starts.items()}
    first = True
    while trials:
        peak_values = peaks([(n, float(v)) for n, values in trials.items() for v in values])
        ends = np.cumsum([len(values) for values in trials.values()])[:-1]
        brackets: dict[int, Floats] = {}
        for (n, values), pieces in zip(trials.items(), np.split(peak_values, ends), strict=True):
            force = forces[n]
            if not first:  # the ends of a bracket, whatever rounding makes of them
                pieces[0], pieces[-1] = (
                    min(pieces[0], np.nextafter(force, 0.0)),
                    np.fmax(pieces[-1], force),
                )
            (above,) = np.nonzero(pieces >= force)
            after = above[0] if len(above) else 0
            low, high = values[after - 1], values[after]
            if not len(above):
                lowest[n] = f"{BELOW} {force:.6g} up to velocity {values[-1]:.6g}"
            elif not after:
                lowest[n] = f"the peak force is above {force:.6g} from velocity {values[0]:.6g} on"
            elif high - low <= VELOCITY_ERROR * high:
                lowest[n] = float(high)
            else:
                with np.errstate(all="ignore"):  # a power law; else the middle alone
                    share = np.log(force / pieces[after - 1]) / np.log(
                        pieces[after] / pieces[after - 1]
                    )
                    guess = low * (high / low) ** share
                offsets = (high - low) * 10.0 ** -np.arange(1.0, 9.0)
                around = np.concatenate([guess - offsets, guess + offsets])
                inside = around[(around > low) & (around < high)]
                brackets[n] = np.unique(np.concatenate([[low, (low + high) / 2.0, high], inside]))
        trials, first = brackets, False
    return lowest


LEVEL_EXCESS = 1e-5  # largest relative excess of the value found
USUAL = 5  # runs of a case, if the value depends smoothly on the velocity
MOST = 40
APART = 1e-3  # least relative distance of the trials that give a slope
NAMES = {Sought.PEAK_FORCE: "peak force", Sought.EXPOSURE: "exposure"}


def _search_row(
    backend: Backend, impacts: Impacts, row: int, quantity: Sought, level: float
) -> Outcome:
    """Find the velocity of one impact; without one, its status is the reason."""
    number = impacts.numbers[row]
    try:
        return _search_in_turn(backend, impacts, row, quantity, level)
    except CasesError as error:
        return Outcome.failed({number: str(error)})


def _search_in_turn(
    backend: Backend, impacts: Impacts, row: int, quantity: Sought, level: float
) -> Outcome:
    """Find the velocity of one impact.

    Raises CasesError with the reason if there is no such velocity.
    """
    outcomes: dict[float, Outcome] = {}
    factors = list(backend.durations)  # factors that are left
    largest = largest_exposure if quantity is Sought.EXPOSURE else peak_force

    def trial(velocity: float) -> Impacts:
        alone = impacts.at_velocities(np.array([row]), np.array([velocity]))
        return replace(alone, numbers=[impacts.numbers[row]])

    def reached(velocity: float) -> float:
        where = f"at velocity {velocity:.6g}"
        while factors:
            outcome = backend.lengthened(factors[0]).outcomes(trial(velocity))
            outcomes[velocity] = outcome
            if not outcome.fine[0]:
                raise CasesError(f"{where}: {outcome.status[0]}")
            try:
                value = largest(outcome)
            except CasesError as error:
                raise CasesError(f"{where}: {error}") from None
            if not math.isnan(value):
                return value
            del factors[0]
        text = f"open even in a run {backend.durations[-1]} times as long"
        raise CasesError(f"{where} the largest {NAMES[quantity]} is {text}")

    start = float(impacts.velocity[row])
    velocity = velocity_at_level(start, level, reached, NAMES[quantity])
    outcome = _with_velocities(outcomes[velocity], trial(velocity))
    if quantity is Sought.EXPOSURE:
        exposures = {v: largest_exposure(tried) for v, tried in outcomes.items()}
        _add_band(outcome, velocity, level, exposures)
    return outcome


def _add_band(
    outcome: Outcome, velocity: float, level: float, exposures: Mapping[float, float]
) -> None:
    """Add the energies at which finer meshes may reach the level, from the band of the exposure.

    Near the velocity the exposure is a power of the velocity, which the nearest other trial gives.
    Without another trial the exposure is taken as proportional to the velocity.
    """
    columns = outcome.columns
    if not columns.keys() >= {*BAND}:
        return
    exponent = 1.0
    apart = {v: abs(math.log(v / velocity)) for v in exposures}
    far = [v for v, distance in apart.items() if distance > APART]
    if far:
        other = min(far, key=apart.__getitem__)
        slope = math.log(exposures[other] / exposures[velocity]) / math.log(other / velocity)
        exponent = slope if slope > 0.0 else exponent
    for name, end in zip(FOUND_BAND, reversed(BAND), strict=True):
        with np.errstate(divide="ignore"):
            columns[name] = columns["found_energy"] * (level / columns[end]) ** (2.0 / exponent)


def peak_force(outcome: Outcome) -> float:
    """Return the peak force of a run, NaN if it is open."""
    return float(outcome.columns[Sought.PEAK_FORCE][0])


def largest_exposure(outcome: Outcome) -> float:
    """Return the largest exposure of a run, NaN if it is open.

    Raises CasesError if the run has no reliable exposure.
    """
    values = [float(outcome.columns[name][0]) for name in EXPOSURES if name in outcome.columns]
    if values and np.isnan(values).any():
        return math.nan
    (counted,) = EVALUATIONS
    if (count := int(outcome.columns[counted][0])) < FAIL_EVALUATIONS.value or not values:
        least = FAIL_EVALUATIONS.shown
        raise CasesError(f"FAIL was evaluated {count} times during contact, less than {least}")
    return max(values)


def velocity_at_level(
    start: float, level: float, reached: Callable[[float], float], name: str = "exposure"
) -> float:
    """Find a velocity at which a value is at the level, or slightly above it.

    The value exceeds the level by at most :data:`LEVEL_EXCESS`, relative to the level. Secants are
    taken in the logarithms, as the value is almost a power of the velocity. A bracket guards them
    once it is known. Raises CasesError if there is no such velocity within 1/100 to 100 times the
    start.
    """
    least, most = math.log(start / RANGE), math.log(start * RANGE)
    low, high = -math.inf, math.inf  # bracket
    x, slope, last = math.log(start), 1.0, None
    for _ in range(MOST):
        velocity = math.exp(x)
        value = reached(velocity)
        if not value > 0.0:
            raise CasesError(f"there is no {name} at velocity {velocity:.6g}")
        y = math.log(value / level)
        if 0.0 <= y <= LEVEL_EXCESS:
            return velocity
        if x <= least and y > 0.0:
            raise CasesError(f"the {name} is above {level:.6g} from velocity {velocity:.6g} on")
        if x >= most and y < 0.0:
            raise CasesError(f"the {name} is below {level:.6g} up to velocity {velocity:.6g}")
        low, high = (x, high) if y < 0.0 else (low, x)
        if last is not None and (y - last[1]) / (x - last[0]) > 0.0:
            slope = (y - last[1]) / (x - last[0])
        last = x, y
        x = min(max(x - (y - LEVEL_EXCESS / 2.0) / slope, least), most)
        if not low < x < high:
            x = (low + high) / 2.0
        if x in (low, high):
            break
    raise CasesError(f"no {name} of {level:.6g}: it jumps at velocity {math.exp(x):.6g}")
