"""Strain gages: the normal strain at a point of the plate, in a direction and at a depth.

z runs from the midplane towards the face away from the projectile.  Normals stay straight,
u(z) = u - z theta, so that the strain at z is the midplane strain plus z times the curvature.
Strains are discontinuous between elements: a gage on a common edge or node reads the mean of the
adjacent elements.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from fecm._errors import FecmError
from fecm._typing import Floats
from fecm.mechanics import element_groups, interpolation
from fecm.mechanics.element_groups import ElementBlock
from fecm.mechanics.elements.quadrature import Quadrature
from fecm.mechanics.interpolation import NDOF
from fecm.mechanics.mesh import Mesh

Indices = NDArray[np.intp]

# Tolerance, in local coordinates, for points on the edge of an element.
MARGIN = 1.0e-6
# The Jacobian of a triangle is singular at node 3.
INSIDE = 1.0 - 1.0e-9
PASSES = 50


class OutsideError(FecmError, ValueError):
    """A point is not on the plate."""


class GagePlace(Protocol):
    """Number, position (length) and direction (degrees from the x-axis) of a gage."""

    @property
    def number(self) -> int: ...  # noqa: D102
    @property
    def x(self) -> float: ...  # noqa: D102
    @property
    def y(self) -> float: ...  # noqa: D102
    @property
    def z(self) -> float: ...  # noqa: D102
    @property
    def direction(self) -> float: ...  # noqa: D102


@dataclass(frozen=True)
class GageArray:
    """Strains of gages as weighted sums of dofs.

    Attributes
    ----------
    numbers : ndarray (gages,)
    dof_indices : ndarray (gages, m)
        Indices into a flattened field.
    weights : ndarray (gages, m)
        Strain per unit of the dof.
    """

    numbers: NDArray[np.int32]
    dof_indices: Indices
    weights: Floats


def gages(
    mesh: Mesh, records: Sequence[GagePlace], *, transposed_jacobian: bool = False
) -> GageArray:
    """Express the gages' strains by the dofs of their elements.

    Parameters
    ----------
    mesh : Mesh
    records : sequence of GagePlace
    transposed_jacobian : bool
        See :func:`fecm.mechanics.interpolation.interpolate`.

    Raises
    ------
    OutsideError
        If a gage is not on the plate.
    """
    families = element_groups.element_blocks(mesh.elements, mesh.coordinates)
    rows = [_functional(families, record, transposed_jacobian) for record in records]
    most = max(len(indices) for indices, _ in rows)
    dof_indices = np.zeros((len(rows), most), dtype=np.intp)
    weights = np.zeros((len(rows), most))
    for number, (indices, values) in enumerate(rows):
        dof_indices[number, : len(indices)] = indices
        weights[number, : len(values)] = values
    return GageArray(
        np.array([record.number for record in records], np.int32), dof_indices, weights
    )


def locate(
    families: Sequence[ElementBlock], x: float, y: float
) -> list[tuple[ElementBlock, float, float]]:
    """Elements that contain a point, each as a block of one, with the local coordinates."""
    found: list[tuple[ElementBlock, float, float]] = []
    point = np.array([x, y])
    for family in families:
        low, high = family.coordinates.min(axis=1), family.coordinates.max(axis=1)
        margin = 0.1 * (high - low).max(axis=1, keepdims=True)  # sides may bulge
        near = ((low - margin <= point) & (point <= high + margin)).all(axis=1)
        for member in np.flatnonzero(near):
            one = family.take(np.array([member]))
            local = _local(one, point)
            if local is not None:
                found.append((one, *local))
    return found


def _local(element: ElementBlock, point: Floats) -> tuple[float, float] | None:
    """Local coordinates of a point, by Newton's method; None if it is outside."""
    xi = np.zeros(2)
    for _ in range(PASSES):
        rule = _at(xi)
        values, local = interpolation.local_shape_functions(element, rule)
        miss = point - values[0] @ element.coordinates[0]
        jacobian = np.einsum("an,ni->ia", local[0], element.coordinates[0])
        step = np.linalg.solve(jacobian, miss)
        xi = np.clip(xi + step, -2.0, [2.0, INSIDE if element.shape.corners == 3 else 2.0])
        if np.abs(step).max() < 1e-13:
            break
    if np.abs(xi).max() > 1.0 + MARGIN:
        return None
    size = np.ptp(element.coordinates[0], axis=0).max()
    values, _ = interpolation.local_shape_functions(element, _at(xi))
    miss = np.abs(point - values[0] @ element.coordinates[0]).max()
    return (float(xi[0]), float(xi[1])) if miss <= MARGIN * size else None


def _at(xi: Floats) -> Quadrature:
    return Quadrature(xi[:1], xi[1:], np.ones(1))


def _functional(
    families: Sequence[ElementBlock], gage: GagePlace, transposed_jacobian: bool
) -> tuple[Indices, Floats]:
    """Dofs and weights of a gage's strain."""
    found = locate(families, gage.x, gage.y)
    if not found:
        raise OutsideError(f"gage {gage.number} at ({gage.x:g}, {gage.y:g}) is not on the plate")
    c, s = np.cos(np.deg2rad(gage.direction)), np.sin(np.deg2rad(gage.direction))
    dof_indices: list[Indices] = []
    weights: list[Floats] = []
    for element, xi, eta in found:
        at = interpolation.interpolate(
            element, _at(np.array([xi, eta])), transposed_jacobian=transposed_jacobian
        )
        along = c * at.dN[0, 0, 0] + s * at.dN[0, 0, 1]  # derivative in the gage's direction
        nodes = element.nodes[0] * NDOF
        for dof, factor in ((0, c), (1, s), (3, -gage.z * c), (4, -gage.z * s)):
            dof_indices.append(nodes + dof)
            weights.append(factor * along / len(found))
    return np.concatenate(dof_indices), np.concatenate(weights)
