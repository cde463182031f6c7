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
from fecm._frozen import frozen
from fecm._typing import Floats, Indices
from fecm.mechanics import interpolation
from fecm.mechanics.elements import Quadrature
from fecm.mechanics.interpolation import NDOF
from fecm.mechanics.locate import locate
from fecm.mechanics.mesh import ElementBlock, Mesh, element_blocks


class OutsideError(FecmError, ValueError):
    """A point is not on the plate."""


@dataclass(frozen=True, match_args=False)  # attributes that need not be assignable
class GagePlace(Protocol):
    """Number, position (length) and direction (degrees from the x-axis) of a gage."""

    number: int
    x: float
    y: float
    z: float
    direction: float


@frozen
class GageArray:
    """Strains of gages as weighted sums of dofs."""

    numbers: NDArray[np.int32]  # (gages,)
    dof_indices: Indices  # (gages, m): indices into a flattened field
    weights: Floats  # (gages, m): strain per unit of the dof


def gages(
    mesh: Mesh, records: Sequence[GagePlace], *, transposed_jacobian: bool = False
) -> GageArray:
    """Express the gages' strains by the dofs of their elements.

    Raises OutsideError if a gage is not on the plate.
    """
    families = element_blocks(mesh.elements, mesh.coordinates)
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


def _functional(
    families: Sequence[ElementBlock], gage: GagePlace, transposed_jacobian: bool
) -> tuple[Indices, Floats]:
    """Dofs and weights of a gage's strain."""
    point = np.array([[gage.x, gage.y]])
    found = [
        (family.take(np.array([member])), at)
        for family in families
        for member, _, at in zip(*locate(family, point), strict=True)
    ]
    if not found:
        raise OutsideError(f"gage {gage.number} at ({gage.x:g}, {gage.y:g}) is not on the plate")
    c, s = np.cos(np.deg2rad(gage.direction)), np.sin(np.deg2rad(gage.direction))
    dof_indices: list[Indices] = []
    weights: list[Floats] = []
    for element, xi in found:
        at = interpolation.interpolate(
            element,
            Quadrature(xi[:1], xi[1:], np.ones(1)),
            transposed_jacobian=transposed_jacobian,
        )
        along = c * at.dN[0, 0, 0] + s * at.dN[0, 0, 1]  # derivative in the gage's direction
        nodes = element.nodes[0] * NDOF
        for dof, factor in ((0, c), (1, s), (3, -gage.z * c), (4, -gage.z * s)):
            dof_indices.append(nodes + dof)
            weights.append(factor * along / len(found))
    return np.concatenate(dof_indices), np.concatenate(weights)
