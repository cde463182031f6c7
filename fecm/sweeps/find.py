"""Search for the velocities at which the peak forces of cases reach a value."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from fecm._typing import Floats

# Velocities of the first round, their range relative to the deck's, and the last relative error.
COUNT, RANGE, ERROR = 25, 100.0, 1e-6


def search(
    starts: Sequence[float], force: float, peaks: Callable[[list[tuple[int, float]]], Floats]
) -> list[float | str]:
    """Find the lowest velocity of each case at which the contact force reaches a value.

    The range from 1/100 to 100 times the start is searched, by rounds of velocities.  Later rounds
    gather around the interpolated velocity of the bracket, whose upper end is the result.  `peaks`
    returns peak forces of pairs of case and velocity; NaN where unknown.  A text is the reason why
    a case has no velocity.
    """
    found: list[float | str] = [""] * len(starts)
    trials = {n: np.geomspace(v / RANGE, v * RANGE, COUNT) for n, v in enumerate(starts)}
    first = True
    while trials:
        given = peaks([(n, float(v)) for n, values in trials.items() for v in values])
        ends = np.cumsum([len(values) for values in trials.values()])[:-1]
        left: dict[int, Floats] = {}
        for (n, values), own in zip(trials.items(), np.split(given, ends), strict=True):
            if not first:  # the ends of a bracket, whatever rounding makes of them
                own[0], own[-1] = min(own[0], np.nextafter(force, 0.0)), np.fmax(own[-1], force)
            (above,) = np.nonzero(own >= force)
            if not len(above):
                found[n] = f"the peak force is below {force:.6g} up to velocity {values[-1]:.6g}"
                continue
            after = above[0]
            if not after:
                found[n] = f"the peak force is above {force:.6g} from velocity {values[0]:.6g} on"
                continue
            low, high = values[after - 1 : after + 1]
            if high - low <= ERROR * high:
                found[n] = float(high)
                continue
            with np.errstate(all="ignore"):  # a power law; without a finite one the middle alone
                share = np.log(force / own[after - 1]) / np.log(own[after] / own[after - 1])
                guess = low * (high / low) ** share
            offsets = (high - low) * 10.0 ** -np.arange(1.0, 9.0)
            around = np.concatenate([guess - offsets, guess + offsets])
            inside = around[(around > low) & (around < high)]
            left[n] = np.unique(np.concatenate([[low, (low + high) / 2.0, high], inside]))
        trials, first = left, False
    return found
