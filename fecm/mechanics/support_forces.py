"""Forces of springs, one-sided supports and restrained w on a plate.

A force is a push if it acts against the projectile, along -w, and a pull if it acts along w: a
window or a ring can only push.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fecm._typing import Floats
from fecm.mechanics.interpolation import W
from fecm.mechanics.membrane import MembraneForces
from fecm.mechanics.plate import PlateModel


class SupportState(NamedTuple):
    """State of the supports in a displacement field."""

    push: float  # sum of the pushing forces, force
    pull: float  # sum of the pulling forces, force
    closed: int  # number of one-sided supports that touch the plate
    lift: float  # largest distance of the plate from a one-sided support, length; 0 if all touch
    energy: float  # of springs and one-sided supports, force*length


class SupportForces:
    """Evaluates the forces of the supports of a plate with springs or one-sided supports."""

    def __init__(self, plate: PlateModel) -> None:
        assert plate.supports is not None
        self.supports = plate.supports
        self._plate = plate
        self._restrained = plate.mesh.equations == 0
        self._holds_w = bool(self._restrained[:, W].any())
        self._membrane = MembraneForces(plate) if plate.nonlinear and self._holds_w else None
        self._of_w = self.supports.dof == W

    def evaluate(self, field: Floats) -> SupportState:
        """Return the state of the supports in a displacement field, (numnp, 5)."""
        supports = self.supports
        displacement = supports.of(field)
        forces = np.concatenate(
            [-supports.reactions(displacement)[self._of_w], self._of_restrained_w(field)]
        )
        one_sided = supports.is_one_sided
        distance = supports.gap - supports.side * displacement
        return SupportState(
            push=float(np.maximum(-forces, 0.0).sum()),
            pull=float(np.maximum(forces, 0.0).sum()),
            closed=int((one_sided & (distance < 0.0)).sum()),
            lift=float(distance[one_sided].max(initial=0.0)),
            energy=supports.energy(displacement),
        )

    def _of_restrained_w(self, field: Floats) -> Floats:
        """Return the forces of the supports on restrained w, (n,)."""
        plate, restrained = self._plate, self._restrained
        if not self._holds_w:
            return np.zeros(0)
        forces = np.zeros(restrained.shape)
        forces[restrained] = plate.support.T @ field[~restrained]
        if self._membrane is not None:
            forces += self._membrane.forces(field)[0]
        return np.asarray(forces[restrained[:, W], W])
