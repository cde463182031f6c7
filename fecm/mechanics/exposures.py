"""Where exposures count: outside the load, near which plate theory does not hold."""

from __future__ import annotations

import numpy as np

from fecm._frozen import frozen
from fecm._typing import Array, Bools, Floats
from fecm.mechanics.failure import CRITERIA
from fecm.mechanics.ply_stresses import FailureEnvelope


@frozen
class OutsideLoad:
    """Points of the plies whose exposures count; all arrays are (elements, points)."""

    near: Bools  # points under the load, which do not count
    # Coordinates of the points.
    x: Floats
    y: Floats

    def largest(self, envelope: FailureEnvelope) -> dict[str, Array]:
        """Largest exposure so far of every criterion, and its mode, ply and place, (criteria,) each.

        Plies count from 1; that of an interface is the one above it, and its place the mean of the
        element's points.  Without any exposure it is NaN, and the ply 0.
        """
        found = [*self._of_plies(envelope), self._of_interfaces(envelope)]
        names = ("exposure", "mode", "ply", "x", "y")
        return {name: np.array(values) for name, values in zip(names, zip(*found), strict=True)}

    def _of_plies(self, envelope: FailureEnvelope) -> list[tuple[float, int, int, float, float]]:
        """Exposure, mode, ply, x and y of each criterion."""
        near, states = self.near.ravel(), envelope.plies
        exposures = states.exposure.reshape(len(CRITERIA), near.size, -1)
        # Hidden for the search: it takes a fraction of the time of one in a copy.
        hidden = exposures[:, near]
        exposures[:, near] = -1.0
        places = states.exposure.argmax(axis=1)
        found = []
        for number, place in enumerate(places.tolist()):
            point, state = divmod(place, exposures.shape[2])
            values = float(states.exposure[number, place]), int(states.mode[number, place])
            found.append(self._found(*values, state // 2 + 1, self.x.flat[point], self.y.flat[point]))
        exposures[:, near] = hidden
        return found

    def _of_interfaces(self, envelope: FailureEnvelope) -> tuple[float, int, int, float, float]:
        """The same of the interlaminar criterion."""
        exposure = envelope.interfaces.exposure
        counts = ~self.near.any(axis=1)[:, None] & np.isfinite(exposure)
        if not counts.any():
            return self._found(-1.0, 0, 0, 0.0, 0.0)
        element, interface = np.unravel_index(np.where(counts, exposure, -1.0).argmax(), counts.shape)
        mode = int(envelope.interfaces.mode[element, interface])
        x, y = self.x[element].mean(), self.y[element].mean()
        return self._found(float(exposure[element, interface]), mode, int(interface) + 1, x, y)

    @staticmethod
    def _found(
        exposure: float, mode: int, ply: int, x: float, y: float
    ) -> tuple[float, int, int, float, float]:
        """The values, or those of no exposure if it is negative."""
        if exposure < 0.0:
            return float("nan"), 0, 0, float("nan"), float("nan")
        return exposure, mode, ply, float(x), float(y)
