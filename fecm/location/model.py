"""Strains of gages as functions of the place and the history of a force, and observations of them.

The strain of a gage is b u, with the row b of its strain-displacement relation. The plate is linear
and its mass diagonal, so that u after n steps is P_n(M^-1 K) M^-1 g for an impulse on the nodal
shares g, with a polynomial P_n: a symmetric matrix. The strain after an impulse on g is therefore
the sum of g times the displacement after an impulse on b. One run per gage gives the strains of an
impulse anywhere.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray
from scipy.sparse import csr_array

from fecm._typing import Bools, Floats, Indices
from fecm.mechanics.elements import Quadrature
from fecm.mechanics.impact import ImpactConditions, ImpactSystem
from fecm.mechanics.impact_steps import ImpactSteps, can_step
from fecm.mechanics.interpolation import NDOF, W, local_shape_functions
from fecm.mechanics.mesh import MeshArrays, element_blocks
from fecm.mechanics.plate import PlateModel
from fecm.mechanics.plate_motion import AppliedForce, PlateMotion
from fecm.mechanics.points import GageArray, OutsideError, containing_elements, patch_weights
from fecm.mechanics.projectile import RigidMass
from fecm.mechanics.symmetry import restrain_resting_dofs
from fecm.sweeps.responses import NO_FORCE

BLOCK = 128  # rows that are reduced together: small enough for BLAS to use one thread
ON_SAMPLE = 1e-3  # distance of a time from a sample, over their interval, that is rounding
MANY = 1.5  # observations per sample from which on they are reduced
# Samples around a time in cubic interpolation.
STENCIL = np.array([-1, 0, 1, 2])


@dataclass(frozen=True)
class Observation:
    """Measured strains, and the values of the functions that they observe.

    Many points are replaced by as many rows as there are samples, by an orthogonal transformation.
    The sum of the squares of a residual is the sum over the rows plus `left`.
    """

    values: Floats  # (gages, rows)
    left: Floats  # (gages,): squares that no function can describe
    points: int  # measured times
    step: float  # usual time between two of them
    interval: float  # between two samples
    # Samples of the rows, (rows,), or a matrix of the values of the rows per sample, (rows,
    # samples), sparse if it interpolates.
    rows: Any

    @property
    def count(self) -> int:
        """Number of measured strains."""
        return len(self.values) * self.points

    def of(self, samples: Floats) -> Floats:
        """Return the rows of functions with samples, (..., samples): (..., rows)."""
        if self.rows.ndim == 1:
            return samples[..., self.rows]
        *outer, count = samples.shape
        rows = self.rows @ samples.reshape(-1, count).T
        return np.ascontiguousarray(rows.T).reshape(*outer, -1)


def observe(time: Floats, strains: Floats, interval: float, count: int) -> Observation:
    """Observe functions with `count` samples from time 0 on by strains, (gages, points)."""
    places, step = time / interval, float(np.median(np.diff(time)))
    near = np.round(places)
    if (np.abs(places - near) < ON_SAMPLE).all() and near[0] >= 0.0:
        rows: Indices | Floats = near.astype(np.intp)
        return Observation(strains, np.zeros(len(strains)), len(time), step, interval, rows)
    matrix = interpolation(places, count)
    remainder = np.zeros(len(strains))
    if len(time) > MANY * count:
        factor = triangular(np.column_stack([matrix, strains.T]))
        matrix, values = factor[:count, :count], factor[:count, count:].T
        remainder = (factor[count:, count:] ** 2).sum(axis=0)
        return Observation(values, remainder, len(time), step, interval, matrix)
    return Observation(strains, remainder, len(time), step, interval, csr_array(matrix))


def interpolation(places: Floats, count: int) -> Floats:
    """Return the cubic interpolation between samples at places, (places, samples).

    Places are counted in samples. The functions are 0 before their first sample.
    """
    before = np.floor(places)
    part = places - before
    weights = np.stack(
        [
            -part * (part - 1.0) * (part - 2.0) / 6.0,
            (part + 1.0) * (part - 1.0) * (part - 2.0) / 2.0,
            -(part + 1.0) * part * (part - 2.0) / 2.0,
            (part + 1.0) * part * (part - 1.0) / 6.0,
        ]
    )
    matrix = np.zeros((len(places), count))
    for offset, weight in zip(STENCIL, weights, strict=True):
        samples = before.astype(np.intp) + offset
        inside = np.flatnonzero((samples >= 0) & (samples < count))
        matrix[inside, samples[inside]] += weight[inside]
    return matrix


def triangular(matrix: Floats) -> Floats:
    """Return the triangular factor of a matrix with the same inner products of columns."""
    factor = np.zeros((0, matrix.shape[1]))
    step = max(BLOCK, matrix.shape[1])
    for start in range(0, len(matrix), step):
        part = np.vstack([factor, matrix[start : start + step]])
        factor = np.asarray(np.linalg.qr(part, mode="r"))
    return factor


@dataclass(frozen=True)
class Footprint:
    """Circle on which a contact force acts, or a point."""

    mesh: MeshArrays
    shape: str  # ``"DISC"`` or ``"HERT"``; empty for a point
    radius: float  # length; 0 for a point
    held: Bools  # (nodes,): whether w is restrained

    def weights(self, x: float, y: float) -> Floats:
        """Return the shares of the nodes in a unit force at a place, (nodes,).

        Raises PatchError or OutsideError if the circle, or the point, is not on the plate.
        """
        if self.shape:
            shares = patch_weights(self.mesh, self.shape, self.radius, x, y)
        else:
            shares = point_weights(self.mesh, x, y)
        return np.asarray(np.where(self.held, 0.0, shares))


def point_weights(mesh: MeshArrays, x: float, y: float) -> Floats:
    """Return the shape functions at a point, (nodes,): shares of the nodes in a unit force.

    Raises OutsideError if the point is not on the plate.
    """
    point, weights = np.array([[x, y]]), np.zeros(len(mesh.coordinates))
    for family in element_blocks(mesh.elements, mesh.coordinates):
        members, _, xi = containing_elements(family, point)
        if len(members):
            rule = Quadrature(xi[:1, 0], xi[:1, 1], np.ones(1))
            values, _ = local_shape_functions(family.take(members[:1]), rule)
            np.add.at(weights, family.nodes[members[0]], values[0])
            return weights
    raise OutsideError(f"({x:g}, {y:g}) is not on the plate")


@dataclass(frozen=True)
class StrainModel:
    """Strains of gages under a force at a place.

    The force is a sum of hats. Their peaks are `width` samples apart, and the first peak comes this
    time after the start of the force.
    """

    footprint: Footprint
    observation: Observation
    nodes: Indices  # (kept,): nodes with responses
    # (gages, kept, samples): strains of a hat whose peak is `unit` samples after its start.
    responses: NDArray[np.floating]
    unit: int
    width: int  # a multiple of `unit`
    length: int  # samples at which the force may act

    @property
    def hats(self) -> int:
        """Number of hats."""
        return math.ceil(self.length / self.width)

    @property
    def basis(self) -> float:
        """Time between the peaks of two hats."""
        return self.width * self.observation.interval

    def knots(self, shift: float) -> Floats:
        """Return the times of the peaks of the hats, (hats,), of a force that starts at `shift`."""
        return shift + self.basis * np.arange(1.0, self.hats + 1.0)

    @cached_property
    def _kept(self) -> Indices:
        """Row of every node among the kept nodes; -1 for other nodes."""
        rows = np.full(len(self.footprint.mesh.coordinates), -1, np.intp)
        rows[self.nodes] = np.arange(len(self.nodes))
        return rows

    def first_hat(self, x: float, y: float) -> Floats:
        """Return the strains of the first hat of a force at a place, (gages, samples).

        Raises PatchError or OutsideError as :meth:`Footprint.weights`, and outside the region.
        """
        weights = self.footprint.weights(x, y)
        (loaded,) = np.nonzero(weights)
        rows = self._kept[loaded]
        if (rows < 0).any():
            raise OutsideError(f"({x:g}, {y:g}) is outside the region")
        near = self.responses[:, rows].astype(np.float64)
        narrow: Floats = np.einsum("n,gns->gs", weights[loaded], near)
        return self._of_width(narrow)

    def _of_width(self, narrow: Floats) -> Floats:
        """Return the strains of a hat of the force as a sum of hats of the responses."""
        parts, count = self.width // self.unit, narrow.shape[1]
        wide = np.zeros_like(narrow)
        for part in range(1, 2 * parts):
            late = (part - 1) * self.unit
            if late < count:
                share = 1.0 - abs(part - parts) / parts
                wide[:, late:] += share * narrow[:, : count - late]
        return wide

    def every_hat(self, x: float, y: float, shift: float) -> Floats:
        """Return samples of the strains of every hat of a force that starts at `shift`."""
        first = self.first_hat(x, y)
        gages, count = first.shape
        if shift:
            places = np.arange(float(count)) - shift / self.observation.interval
            first = first @ interpolation(places, count).T
        every = np.zeros((gages, self.hats, count))
        for hat in range(self.hats):
            late = hat * self.width
            if late < count:
                every[:, hat, late:] = first[:, : count - late]
        return every

    def design(self, x: float, y: float, shift: float = 0.0) -> Floats:
        """Return the observed strains per coefficient of the force, (gages, rows, hats)."""
        return self.observation.of(self.every_hat(x, y, shift)).swapaxes(1, 2)

    def strains(self, x: float, y: float, shift: float, force: Floats) -> Floats:
        """Return samples of the strains of a force, (gages, samples)."""
        return np.asarray(np.einsum("h,ghs->gs", force, self.every_hat(x, y, shift)))


ROWS = 16  # sampled fields of all dofs that are in memory at the same time


@dataclass(frozen=True)
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
    """Return the plate under transverse forces only, without the deck's nodal loads."""
    mesh = replace(plate.mesh, forces=np.zeros_like(plate.mesh.forces))
    return restrain_resting_dofs(replace(plate, mesh=mesh), None)


def rows_of(gages: GageArray, nodes: int) -> Floats:
    """Return the strain of every gage per displacement of every dof, (gages, nodes, 5)."""
    rows = np.zeros((len(gages.numbers), nodes * NDOF))
    for row, dofs, weights in zip(rows, gages.dof_indices, gages.weights, strict=False):
        np.add.at(row, dofs, weights)
    return rows.reshape(-1, nodes, NDOF)


def deflections(motion: PlateMotion, row: Floats, sampling: Sampling) -> Iterator[Floats]:
    """Yield the deflection of every node, (rows, nodes), at the samples after time 0, in parts.

    The nodal forces are the row of a gage, (nodes, 5), times the force of the sampling.
    """
    load = motion.load(row)
    system = ImpactSystem(motion, RigidMass(1.0), NO_FORCE, ImpactConditions(load, 0.0))
    state, dt = system.start(), sampling.dt
    force, last = sampling.hat(), (sampling.count - 1) * sampling.every
    by_kernels = can_step(system)
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
    """Return the strains of gages per force at some nodes, (gages, nodes, samples).

    `rows` come from :func:`rows_of`. The force is the force of the sampling.
    """
    strains = np.zeros((len(rows), len(nodes), sampling.count), dtype)
    for row, into in zip(rows, strains, strict=True):
        first = 1
        for fields in deflections(motion, row, sampling):
            into[:, first : first + len(fields)] = fields[:, nodes].T
            first += len(fields)
    return strains
