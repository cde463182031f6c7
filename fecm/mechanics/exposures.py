"""Largest exposures outside the load, near which plate theory does not hold."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from fecm._frozen import frozen
from fecm._typing import Array, Bools, Floats, Indices
from fecm.mechanics.failure import CRITERIA
from fecm.mechanics.ply_stresses import FailureEnvelope


class Largest(NamedTuple):
    """Largest exposure of a criterion so far."""

    exposure: float
    mode: int  # index into :data:`~fecm.mechanics.failure.MODES`
    ply: int  # from 1 at z = -h/2; of an interface the one above it
    # Place; of an interface the mean of its element's points.
    x: float
    y: float


NONE = Largest(math.nan, 0, 0, math.nan, math.nan)


@frozen
class OutsideLoad:
    """Points of the plies whose exposures count; all arrays are (elements, points)."""

    near: Bools  # points under the load, which do not count
    # Coordinates of the points.
    x: Floats
    y: Floats

    def largest(self, envelope: FailureEnvelope) -> dict[str, Array]:
        """Fields of :class:`Largest`, (criteria,) each: the interlaminar before those of users."""
        plies = self._of_plies(envelope)
        known = len(CRITERIA)
        found = [*plies[:known], self._of_interfaces(envelope), *plies[known:]]
        return {name: np.array([getattr(one, name) for one in found]) for name in Largest._fields}

    def worst_states(self, envelope: FailureEnvelope) -> Indices | None:
        """States of the largest exposures of the plies, (criteria,); None if none counts."""
        near, exposure = self.near.ravel(), envelope.plies.exposure
        if near.all():
            return None
        at_points = exposure.reshape(len(exposure), near.size, -1)
        # Points under the load are hidden for the search, which is much faster than one in a copy.
        hidden = at_points[:, near]
        at_points[:, near] = -1.0
        states = np.asarray(exposure.argmax(axis=1))
        at_points[:, near] = hidden
        return states

    def _of_plies(self, envelope: FailureEnvelope) -> list[Largest]:
        """Of each criterion of the plies."""
        plies = envelope.plies
        if (states := self.worst_states(envelope)) is None:
            return [NONE] * len(plies.exposure)
        found = []
        for number, state in enumerate(states.tolist()):
            if plies.exposure[number, state] < 0.0:  # no ply has strengths
                found.append(NONE)
                continue
            point, ply_and_face = divmod(state, plies.exposure.shape[1] // self.near.size)
            exposure, mode = float(plies.exposure[number, state]), int(plies.mode[number, state])
            place = float(self.x.flat[point]), float(self.y.flat[point])
            found.append(Largest(exposure, mode, ply_and_face // 2 + 1, *place))
        return found

    def _of_interfaces(self, envelope: FailureEnvelope) -> Largest:
        """Of the interlaminar criterion."""
        exposure = envelope.interfaces.exposure
        counts = np.isfinite(exposure)
        counts[self.near.any(axis=1)] = False
        if not counts.any():
            return NONE
        place = np.unravel_index(np.where(counts, exposure, -1.0).argmax(), counts.shape)
        element, interface = (int(index) for index in place)
        mode = int(envelope.interfaces.mode[place])
        x, y = float(self.x[element].mean()), float(self.y[element].mean())
        return Largest(float(exposure[place]), mode, interface + 1, x, y)
