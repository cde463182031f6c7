"""Differences of full runs from the forces of a reduced plate."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from fecm._typing import Floats


class Corrections(NamedTuple):
    """Difference of a full run from the force of a plate, and its derivatives.

    At other values than those of the run the difference changes linearly.
    """

    clock: Floats = np.zeros(1)
    difference: Floats = np.zeros(1)  # (times,)
    place: Mapping[str, float] = {}  # values of the run
    slopes: Mapping[str, Floats] = {}  # derivatives of the difference by name, (times,) each

    def at(self, clock: Floats, trials: Sequence[Mapping[str, float]]) -> Floats:
        """Return the differences at the values of trials, (times, trials)."""
        columns = []
        for trial in trials:
            difference = self.difference
            for name, slope in self.slopes.items():
                difference = difference + (trial[name] - self.place[name]) * slope
            columns.append(np.interp(clock, self.clock, difference))
        return np.stack(columns, axis=1)

    def meeting(self, earlier: Corrections, sizes: Mapping[str, float]) -> Corrections:
        """Return the corrections with slopes that give the difference of an earlier run, too.

        The slopes change as little as possible, per `sizes` of the parameters.
        """
        away = {
            name: (earlier.place[name] - self.place[name]) / sizes[name] for name in self.slopes
        }
        square = sum(part**2 for part in away.values())
        if not square:
            return self
        difference = np.interp(self.clock, earlier.clock, earlier.difference)
        missing = difference - self.at(self.clock, [earlier.place])[:, 0]
        slopes = {
            name: slope + missing * (away[name] / (square * sizes[name]))
            for name, slope in self.slopes.items()
        }
        return self._replace(slopes=slopes)


NO_CORRECTIONS = Corrections()
