"""Searches for the velocity at which the peak force of a case reaches a value."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import compress

import numpy as np

from fecm._typing import Floats
from fecm.deck.model import Deck, Impact
from fecm.problem.parts import build_projectile
from fecm.sweeps import plan
from fecm.sweeps.plan import RUN, Outcome, merge
from fecm.sweeps.vary import apply_case

Decks = Mapping[int, Deck]  # by the numbers of their cases, ascending
Runs = Callable[[Decks, bool], Outcome]  # runs decks; doubtful ones in full if they are judged
RANGE, ERROR = 100.0, 1e-6  # of velocities relative to the deck's, and the last relative error
ROUGH = 1e-4  # relative difference of the peak force from the value searched, beyond which it jumps
LONGER = (1, 2, 4, 8)  # times the duration, until the peak at the velocity found is known
BELOW = "the peak force is below"


def found(decks: Decks, force: float, longer: Callable[[int], Runs]) -> Outcome:
    """Run cases at the velocities at which their peaks reach a force.

    Cases whose peak there is open are searched again in longer runs: `longer` returns what runs
    decks so many times as long.
    """
    left, parts = dict(decks), []
    for factor in LONGER:
        runs, numbers = longer(factor), list(left)
        together = -(-len(numbers) // factor)  # as many forces in memory as at first
        for start in range(0, len(numbers), together):
            some = {number: left[number] for number in numbers[start : start + together]}
            outcome, still_open = _searched(some, force, runs)
            parts.append(outcome)
            left = {n: deck for n, deck in left.items() if n not in some or n in still_open}
        if not left:
            return merge(parts)
    text = f"no peak force of {force:.6g}: it is open even in a run {LONGER[-1]} times as long"
    return merge([*parts, Outcome.failed(dict.fromkeys(left, text))])


def _searched(decks: Decks, force: float, runs: Runs) -> tuple[Outcome, set[int]]:
    """Search the velocities of cases: outcome of those that are decided, and the open ones."""

    def at(case: int, velocity: float) -> Deck:
        return apply_case(decks[case], {"velocity": velocity})

    def tried(pairs: list[tuple[int, float]]) -> Outcome:
        return runs({n: at(*pair) for n, pair in enumerate(pairs)}, False)

    starts = {case: deck.require(Impact).velocity for case, deck in decks.items()}
    searched = search(starts, force, lambda pairs: tried(pairs).columns[plan.REACHED])
    reasons = {case: v for case, v in searched.items() if isinstance(v, str)}
    still_open: set[int] = set()
    # What is not reached in a run that is too short may be reached in a longer one.
    if low := [case for case, text in reasons.items() if text.startswith(BELOW)]:
        highest = tried([(case, starts[case] * RANGE) for case in low])
        lacking = np.isnan(highest.columns["peak_force"])
        still_open = set(compress(low, lacking))
    parts = [Outcome.failed({n: text for n, text in reasons.items() if n not in still_open})]
    velocities = {case: v for case, v in searched.items() if isinstance(v, float)}
    if velocities:
        outcome = runs({case: at(case, v) for case, v in velocities.items()}, True)
        velocity = np.array(list(velocities.values()))
        mass = np.array([build_projectile(decks[case]).total_mass for case in velocities])
        outcome.columns |= {"found_velocity": velocity, "found_energy": 0.5 * mass * velocity**2}
        reached, peak = outcome.columns[plan.REACHED], outcome.columns["peak_force"]
        fine = np.isin(outcome.columns["status"], RUN)
        is_open = fine & np.isnan(peak)
        still_open |= {outcome.numbers[row] for row in np.flatnonzero(is_open)}
        right = fine & ~is_open & (np.abs(reached - force) <= ROUGH * force)
        parts.append(outcome.select(np.flatnonzero(right)))
        for row in np.flatnonzero(~right & ~is_open):
            text = f"at velocity {velocity[row]:.6g}: {outcome.status[row]}"
            if fine[row]:
                text = f"from velocity {velocity[row]:.6g} on it is {reached[row]:.6g}"
                text = f"no peak force of {force:.6g}: {text}, and below it jumps"
            parts.append(Outcome.failed({outcome.numbers[row]: text}))
    return merge(parts), still_open


def search(
    starts: Mapping[int, float], force: float, peaks: Callable[[list[tuple[int, float]]], Floats]
) -> dict[int, float | str]:
    """Find the lowest velocity of each case at which the contact force reaches a value.

    The range from 1/100 to 100 times the start is searched, by rounds of velocities.  Later rounds
    gather around the interpolated velocity of the bracket, whose upper end is the result.  `peaks`
    returns the largest forces of pairs of case and velocity; NaN where unknown.  A text is the
    reason why a case has no velocity.
    """
    found: dict[int, float | str] = dict.fromkeys(starts, "")
    trials = {n: np.geomspace(v / RANGE, v * RANGE, plan.COUNT) for n, v in starts.items()}
    first = True
    while trials:
        given = peaks([(n, float(v)) for n, values in trials.items() for v in values])
        ends = np.cumsum([len(values) for values in trials.values()])[:-1]
        left: dict[int, Floats] = {}
        for (n, values), own in zip(trials.items(), np.split(given, ends), strict=True):
            if not first:  # the ends of a bracket, whatever rounding makes of them
                own[0], own[-1] = min(own[0], np.nextafter(force, 0.0)), np.fmax(own[-1], force)
            (above,) = np.nonzero(own >= force)
            after = above[0] if len(above) else 0
            low, high = values[after - 1], values[after]
            if not len(above):
                found[n] = f"{BELOW} {force:.6g} up to velocity {values[-1]:.6g}"
            elif not after:
                found[n] = f"the peak force is above {force:.6g} from velocity {values[0]:.6g} on"
            elif high - low <= ERROR * high:
                found[n] = float(high)
            else:
                with np.errstate(all="ignore"):  # a power law; else the middle alone
                    share = np.log(force / own[after - 1]) / np.log(own[after] / own[after - 1])
                    guess = low * (high / low) ** share
                offsets = (high - low) * 10.0 ** -np.arange(1.0, 9.0)
                around = np.concatenate([guess - offsets, guess + offsets])
                inside = around[(around > low) & (around < high)]
                left[n] = np.unique(np.concatenate([[low, (low + high) / 2.0, high], inside]))
        trials, first = left, False
    return found
