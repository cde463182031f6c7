"""Strains of gages per force at every node, by reciprocity.

The strain of a gage is b u, with the row b of its strain-displacement relation.  The plate is
linear and its mass diagonal, so that u after n steps is P_n(M^-1 K) M^-1 g for an impulse on the
nodal shares g, with a polynomial P_n: a symmetric matrix.  The strain after an impulse on g is
therefore the sum of g times the displacement after an impulse on b.  One run a gage gives the
strains of an impulse anywhere.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import DTypeLike, NDArray

from fecm._dataclasses import frozen
from fecm._typing import Floats, Indices
from fecm.mechanics.impact import ImpactConditions, ImpactSystem
from fecm.mechanics.impact_steps import ImpactSteps, supports
from fecm.mechanics.interpolation import NDOF
from fecm.mechanics.plate import PlateModel
from fecm.mechanics.plate_motion import AppliedForce, PlateMotion
from fecm.mechanics.points import GageArray
from fecm.mechanics.projectile import RigidMass
from fecm.mechanics.symmetry import restrain_resting_dofs
from fecm.sweeps.responses import NO_FORCE

W = 2  # dof of the deflection
ROWS = 16  # sampled fields of all dofs that are in memory at the same time


@frozen
class Sampling:
    """Time steps, samples and force of a run."""

    dt: float  # time step
    every: int  # steps between two samples
    count: int  # samples, from time 0 on
    width: int  # samples from the start of the force to its peak, and from there to its end

    @property
    def interval(self) -> float:
        """Time between two samples."""
        return self.every * self.dt

    def hat(self) -> Floats:
        """Force at the start of every step until it is 0 again: it rises to 1 and falls."""
        rise = np.arange(self.width * self.every) / (self.width * self.every)
        return np.concatenate([rise, 1.0 - rise])


def moving_plate(plate: PlateModel) -> PlateModel:
    """The plate under forces across it alone, without the deck's nodal loads."""
    mesh = replace(plate.mesh, forces=np.zeros_like(plate.mesh.forces))
    return restrain_resting_dofs(replace(plate, mesh=mesh), None)


def rows_of(gages: GageArray, nodes: int) -> Floats:
    """Strain of every gage per displacement of every dof, (gages, nodes, 5)."""
    rows = np.zeros((len(gages.numbers), nodes * NDOF))
    for row, at, weights in zip(rows, gages.dof_indices, gages.weights, strict=False):
        np.add.at(row, at, weights)
    return rows.reshape(-1, nodes, NDOF)


def deflections(motion: PlateMotion, row: Floats, sampling: Sampling) -> Iterator[Floats]:
    """Deflection of every node, (rows, nodes), at the samples after time 0, some at a time.

    The nodal forces are the row of a gage, (nodes, 5), times the force of the sampling.
    """
    load = motion.load(row)
    system = ImpactSystem(motion, RigidMass(1.0), NO_FORCE, ImpactConditions(load, 0.0))
    state, dt = system.start(), sampling.dt
    force, last = sampling.hat(), (sampling.count - 1) * sampling.every
    by_kernels = supports(system)
    stepped = min(len(force), last) if by_kernels else last
    for step in range(stepped):
        applied = AppliedForce(load, float(force[step])) if step < len(force) else None
        motion.advance(state.plate, dt, 0.0, applied)
        if not (step + 1) % sampling.every:
            yield motion.field(state.plate, 0.0)[None, :, W]
    burst = ImpactSteps(system, None, 0, 1) if by_kernels else None
    while burst is not None and state.plate.step < last:
        steps = min(ROWS * sampling.every, last - state.plate.step)
        stored = np.arange(sampling.every - 1, steps, sampling.every)
        yield burst.take(state, dt, steps, stored).fields[:, :, W]


def responses(
    motion: PlateMotion,
    rows: Floats,
    nodes: Indices,
    sampling: Sampling,
    dtype: DTypeLike = np.float32,
) -> NDArray[np.floating]:
    """Strains of gages per force at some nodes, (gages, nodes, samples).

    `rows` are those of :func:`rows_of`.  The force is that of the sampling.
    """
    found = np.zeros((len(rows), len(nodes), sampling.count), dtype)
    for row, into in zip(rows, found, strict=True):
        first = 1
        for fields in deflections(motion, row, sampling):
            into[:, first : first + len(fields)] = fields[:, nodes].T
            first += len(fields)
    return found
