"""Strains of gages under a force at a place, and their observation.

The strain of a gage is b u, with the row b of its strain-displacement relation. The plate is linear
and its mass diagonal. An impulse on the nodal shares g therefore gives u = P_n(M^-1 K) M^-1 g after
n steps, where P_n is a polynomial. The matrix P_n(M^-1 K) M^-1 is symmetric, so that b and g may be
exchanged: the strain after an impulse on g is the sum of g times the displacement after an impulse
on b. One run per gage gives the strains of an impulse anywhere.
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
from fecm.mechanics.mesh import MeshArrays
from fecm.mechanics.plate import PlateModel
from fecm.mechanics.plate_motion import AppliedForce, PlateMotion
from fecm.mechanics.points import GageArray, OutsideError, containing_elements, patch_weights
from fecm.mechanics.projectile import RigidMass
from fecm.mechanics.symmetry import restrain_resting_dofs
from fecm.sweeps.responses import NO_FORCE

BLOCK = 128  # rows reduced at a time: few enough that BLAS uses one thread
ON_SAMPLE = 1e-3  # distance from a time to a sample, over the interval, that is rounding
MANY = 1.5  # points per sample above which the points are reduced
# Samples around a time in cubic interpolation.
STENCIL = np.array([-1, 0, 1, 2])


@dataclass(frozen=True)
class Observation:
    """Measured strains, and the map from samples of strains to the measured values.

    If there are more points than samples, an orthogonal transformation reduces them to one row per
    sample. The sum of the squares of a residual is then the sum over the rows plus `remainder`.
    """

    values: Floats  # (gages, rows)
    remainder: Floats  # (gages,): sums of squares that no samples can describe
    points: int  # number of measured times
    step: float  # usual time between two measured times
    interval: float  # between two samples
    # Sample of each row, (rows,), or the matrix that maps samples to rows, (rows, samples). It is
    # sparse if it interpolates.
    rows: Any

    @property
    def count(self) -> int:
        """Number of measured strains."""
        return len(self.values) * self.points

    def of(self, samples: Floats) -> Floats:
        """Return the rows, (..., rows), for samples, (..., samples)."""
        if self.rows.ndim == 1:
            return samples[..., self.rows]
        *outer, count = samples.shape
        rows = self.rows @ samples.reshape(-1, count).T
        return np.ascontiguousarray(rows.T).reshape(*outer, -1)


def observe(time: Floats, strains: Floats, interval: float, count: int) -> Observation:
    """Return strains, (gages, points), as observations of `count` samples from time 0 on."""
    places, step = time / interval, float(np.median(np.diff(time)))
    nearest = np.round(places)
    if (np.abs(places - nearest) < ON_SAMPLE).all() and nearest[0] >= 0.0:
        rows: Indices | Floats = nearest.astype(np.intp)
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
    """Return the matrix of cubic interpolation between samples, (places, samples).

    A place is a time in units of the sampling interval. The samples before the first one are 0.
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
    """Return a triangular matrix whose columns have the same inner products as those given."""
    factor = np.zeros((0, matrix.shape[1]))
    step = max(BLOCK, matrix.shape[1])
    for start in range(0, len(matrix), step):
        part = np.vstack([factor, matrix[start : start + step]])
        factor = np.asarray(np.linalg.qr(part, mode="r"))
    return factor


@dataclass(frozen=True)
class Footprint:
    """Circle or point on which a contact force acts."""

    mesh: MeshArrays
    shape: str  # ``"DISC"`` or ``"HERT"``; empty for a point
    radius: float  # length; 0 for a point
    held: Bools  # (nodes,): whether w is restrained

    def weights(self, x: float, y: float) -> Floats:
        """Return the share of each node in a unit force at a place, (nodes,).

        Raises PatchError or OutsideError if the circle, or the point, is not on the plate.
        """
        if self.shape:
            shares = patch_weights(self.mesh, self.shape, self.radius, x, y)
        else:
            shares = point_weights(self.mesh, x, y)
        return np.asarray(np.where(self.held, 0.0, shares))


def point_weights(mesh: MeshArrays, x: float, y: float) -> Floats:
    """Return the share of each node in a unit force at a point, (nodes,): the shape functions.

    Raises OutsideError if the point is not on the plate.
    """
    point, weights = np.array([[x, y]]), np.zeros(len(mesh.coordinates))
    for family in mesh.families:
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

    The force is a sum of hats. Their peaks are `width` samples apart, and the first peak comes
    `width` samples after the force starts.
    """

    footprint: Footprint
    observation: Observation
    nodes: Indices  # (kept,): nodes with responses
    # (gages, kept, samples): strains of a hat whose peak is `unit` samples after its start.
    responses: NDArray[np.floating]
    unit: int
    width: int  # a multiple of `unit`
    length: int  # number of samples at which the force may act

    @property
    def hats(self) -> int:
        """Number of hats."""
        return math.ceil(self.length / self.width)

    @property
    def basis(self) -> float:
        """Time between the peaks of two hats."""
        return self.width * self.observation.interval

    def knots(self, shift: float) -> Floats:
        """Return the times of the hats' peaks, (hats,), for a force that starts at `shift`."""
        return shift + self.basis * np.arange(1.0, self.hats + 1.0)

    @cached_property
    def _kept(self) -> Indices:
        """Row of every node among the kept nodes; -1 for other nodes."""
        rows = np.full(len(self.footprint.mesh.coordinates), -1, np.intp)
        rows[self.nodes] = np.arange(len(self.nodes))
        return rows

    def first_hat(self, x: float, y: float) -> Floats:
        """Return the strains of the first hat of a force at a place, (gages, samples).

        Raises PatchError or OutsideError like :meth:`Footprint.weights`, and OutsideError if the
        place is outside the region.
        """
        weights = self.footprint.weights(x, y)
        (loaded,) = np.nonzero(weights)
        rows = self._kept[loaded]
        if (rows < 0).any():
            raise OutsideError(f"({x:g}, {y:g}) is outside the region")
        near = self.responses[:, rows].astype(np.float64)
        narrow: Floats = np.einsum("n,gns->gs", weights[loaded], near)
        return self._widen(narrow)

    def _widen(self, narrow: Floats) -> Floats:
        """Return the strains of a hat of the force, a sum of the narrow hats of the responses."""
        parts, count = self.width // self.unit, narrow.shape[1]
        wide = np.zeros_like(narrow)
        for part in range(1, 2 * parts):
            delay = (part - 1) * self.unit
            if delay < count:
                share = 1.0 - abs(part - parts) / parts
                wide[:, delay:] += share * narrow[:, : count - delay]
        return wide

    def every_hat(self, x: float, y: float, shift: float) -> Floats:
        """Return the strains of every hat of a force that starts at `shift`.

        The result is (gages, hats, samples).
        """
        first = self.first_hat(x, y)
        gages, count = first.shape
        if shift:
            places = np.arange(float(count)) - shift / self.observation.interval
            first = first @ interpolation(places, count).T
        every = np.zeros((gages, self.hats, count))
        for hat in range(self.hats):
            delay = hat * self.width
            if delay < count:
                every[:, hat, delay:] = first[:, : count - delay]
        return every

    def design(self, x: float, y: float, shift: float = 0.0) -> Floats:
        """Return the observed strains per unit force of each hat, (gages, rows, hats)."""
        return self.observation.of(self.every_hat(x, y, shift)).swapaxes(1, 2)

    def strains(self, x: float, y: float, shift: float, force: Floats) -> Floats:
        """Return the strains of a force at the samples, (gages, samples)."""
        return np.asarray(np.einsum("h,ghs->gs", force, self.every_hat(x, y, shift)))


ROWS = 16  # sampled fields of all dofs that are in memory at a time


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
        """Return the force at the start of every step; it rises to 1 and falls to 0."""
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
    """Yield parts of the deflections, (rows, nodes), at the samples after time 0.

    The nodal forces are the row of a gage, (nodes, 5), times the hat of the sampling.
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
    """Return the strains of gages under a force at each node, (gages, nodes, samples).

    `rows` come from :func:`rows_of`. The force is the hat of the sampling.
    """
    strains = np.zeros((len(rows), len(nodes), sampling.count), dtype)
    for row, of_gage in zip(rows, strains, strict=True):
        first = 1
        for fields in deflections(motion, row, sampling):
            of_gage[:, first : first + len(fields)] = fields[:, nodes].T
            first += len(fields)
    return strains
