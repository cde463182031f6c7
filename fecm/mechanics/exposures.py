"""Largest exposures outside the load, near which plate theory does not hold."""

from __future__ import annotations

import math
from functools import cached_property
from typing import NamedTuple

import numpy as np

from fecm._frozen import frozen
from fecm._typing import Array, Bools, Floats, Indices
from fecm.mechanics.failure import CRITERIA
from fecm.mechanics.failure_monitor import FailureEnvelope


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

    @cached_property
    def _far(self) -> Indices:
        """Elements without a point under the load."""
        return np.flatnonzero(~self.near.any(axis=1))

    @cached_property
    def _means(self) -> tuple[Floats, Floats]:
        """Means of the points of each element, (elements,): x and y."""
        return self.x.mean(axis=1), self.y.mean(axis=1)

    def largest(self, envelope: FailureEnvelope) -> dict[str, Array]:
        """Fields of :class:`Largest`, (criteria,) each: the interlaminar before those of users."""
        plies = self._of_plies(envelope)
        known = len(CRITERIA)
        found = [*plies[:known], self._of_interfaces(envelope), *plies[known:]]
        return {
            name: np.array(values)
            for name, values in zip(Largest._fields, zip(*found, strict=True), strict=True)
        }

    def worst_states(self, envelope: FailureEnvelope) -> Indices | None:
        """States of the largest exposures of the plies, (criteria,); None if none counts."""
        near, exposure = self.near.ravel(), envelope.plies.exposure
        if near.all():
            return None
        points = np.where(near, -np.inf, envelope.peaks(near.size)).argmax(axis=1)
        of_point = exposure.reshape(len(exposure), near.size, -1)
        states = of_point[np.arange(len(exposure)), points].argmax(axis=1)
        return np.asarray(points * of_point.shape[2] + states)

    def _of_plies(self, envelope: FailureEnvelope) -> list[Largest]:
        """Of each criterion of the plies."""
        plies = envelope.plies
        if (states := self.worst_states(envelope)) is None:
            return [NONE] * len(plies.exposure)
        criteria = np.arange(len(states))
        points, of_point = np.divmod(states, plies.exposure.shape[1] // self.near.size)
        columns = (
            plies.exposure[criteria, states],
            plies.mode[criteria, states],
            of_point // 2 + 1,
            self.x.ravel()[points],
            self.y.ravel()[points],
        )
        found = (Largest(*one) for one in zip(*(c.tolist() for c in columns), strict=True))
        # Below 0 where no ply has strengths.
        return [NONE if one.exposure < 0.0 else one for one in found]

    def _of_interfaces(self, envelope: FailureEnvelope) -> Largest:
        """Of the interlaminar criterion."""
        exposure = envelope.interfaces.exposure[self._far]
        if not exposure.size:
            return NONE
        place = int(exposure.argmax())  # that of the first NaN if there is one
        if not math.isfinite(exposure.flat[place]):
            counts = np.isfinite(exposure)
            if not counts.any():
                return NONE
            place = int(np.where(counts, exposure, -1.0).argmax())
        row, interface = divmod(place, exposure.shape[1])
        element = self._far[row]
        mode = int(envelope.interfaces.mode[element, interface])
        x, y = (float(means[element]) for means in self._means)
        return Largest(float(exposure[row, interface]), mode, interface + 1, x, y)
