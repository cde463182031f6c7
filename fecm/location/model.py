"""Strains of gages as functions of the place and the history of a force."""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from fecm._dataclasses import frozen
from fecm._typing import Bools, Floats, Indices
from fecm.location.observation import Observation, interpolation
from fecm.mechanics.elements import Quadrature
from fecm.mechanics.interpolation import local_shape_functions
from fecm.mechanics.mesh import Mesh, element_blocks
from fecm.mechanics.points import OutsideError, locate, patch_weights


@frozen
class Footprint:
    """Where a contact force acts: on a circle, or on a point without one."""

    mesh: Mesh
    shape: str  # ``"DISC"`` or ``"HERT"``; empty for a point
    radius: float  # length; 0 for a point
    held: Bools  # (nodes,): whether w is restrained

    def weights(self, x: float, y: float) -> Floats:
        """Shares of the nodes in a unit force at a place, (nodes,).

        Raises PatchError or OutsideError if the circle, or the point, is not on the plate.
        """
        if self.shape:
            made = patch_weights(self.mesh, self.shape, self.radius, x, y)
        else:
            made = point_weights(self.mesh, x, y)
        return np.asarray(np.where(self.held, 0.0, made))


def point_weights(mesh: Mesh, x: float, y: float) -> Floats:
    """Shape functions at a point, (nodes,): shares of the nodes in a unit force on it.

    Raises OutsideError if the point is not on the plate.
    """
    point, weights = np.array([[x, y]]), np.zeros(len(mesh.coordinates))
    for family in element_blocks(mesh.elements, mesh.coordinates):
        members, _, xi = locate(family, point)
        if len(members):
            rule = Quadrature(xi[:1, 0], xi[:1, 1], np.ones(1))
            values, _ = local_shape_functions(family.take(members[:1]), rule)
            np.add.at(weights, family.nodes[members[0]], values[0])
            return weights
    raise OutsideError(f"({x:g}, {y:g}) is not on the plate")


@frozen
class StrainModel:
    """Strains of gages under a force at a place.

    The force is a sum of hats, with their peaks `width` samples apart and the first peak that time
    after the force's start.
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
        """Times of the peaks of the hats, (hats,), of a force that starts at `shift`."""
        return shift + self.basis * np.arange(1.0, self.hats + 1.0)

    @cached_property
    def _kept(self) -> Indices:
        """Row of every node among the kept ones; -1 without."""
        rows = np.full(len(self.footprint.mesh.coordinates), -1, np.intp)
        rows[self.nodes] = np.arange(len(self.nodes))
        return rows

    def first_hat(self, x: float, y: float) -> Floats:
        """Strains of the first hat of a force at a place, (gages, samples).

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
        """Strains of a hat of the force from those of a hat of the responses: a sum of such."""
        parts, count = self.width // self.unit, narrow.shape[1]
        wide = np.zeros_like(narrow)
        for part in range(1, 2 * parts):
            late = (part - 1) * self.unit
            if late < count:
                share = 1.0 - abs(part - parts) / parts
                wide[:, late:] += share * narrow[:, : count - late]
        return wide

    def every_hat(self, x: float, y: float, shift: float) -> Floats:
        """Samples of the strains of every hat of a force that starts at `shift`."""
        first = self.first_hat(x, y)
        gages, count = first.shape
        every = np.zeros((gages, self.hats, count))
        for hat in range(self.hats):
            late = hat * self.width
            if late < count:
                every[:, hat, late:] = first[:, : count - late]
        if not shift:
            return every
        places = np.arange(float(count)) - shift / self.observation.interval
        return every @ interpolation(places, count).T

    def design(self, x: float, y: float, shift: float = 0.0) -> Floats:
        """Observed strains per coefficient of the force, (gages, rows, hats)."""
        return self.observation.of(self.every_hat(x, y, shift)).swapaxes(1, 2)

    def strains(self, x: float, y: float, shift: float, force: Floats) -> Floats:
        """Samples of the strains of a force, (gages, samples)."""
        return np.asarray(np.einsum("h,ghs->gs", force, self.every_hat(x, y, shift)))
