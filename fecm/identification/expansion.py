"""Forces of full runs near one, linear in the values of the impact."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from fecm._typing import Floats


class Expansion(NamedTuple):
    """Force of a full run, and its derivatives with respect to the values of the impact."""

    times: Floats  # from 0 on
    force: Floats  # (times,)
    place: Mapping[str, float]  # values of the run
    slopes: Mapping[str, Floats]  # derivatives by name, (times,) each

    def at(self, trials: Sequence[Mapping[str, float]]) -> Floats:
        """Return the forces at the values of trials, (times, trials)."""
        columns = []
        for trial in trials:
            force = self.force
            for name, slope in self.slopes.items():
                force = force + (trial[name] - self.place[name]) * slope
            columns.append(force)
        return np.stack(columns, axis=1)
