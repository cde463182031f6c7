"""Reduction of a plate to the dofs that move independently.

In-plane dofs stay at rest if no load acts in the plane and neither the laminate nor a curvature
couples them to bending.  If a half turn about the centre maps mesh, supports and loads onto
themselves, the response to an impact at the centre has the same symmetry: w equals w of the image,
the other dofs have the opposite sign, and half of the elements suffice.  Every laminate and every
curvature is invariant under the half turn, but an element and its image must have the same
laminate.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fecm._typing import Bools, Floats, Indices
from fecm.mechanics.mesh import ElementBlock, Ints, equation_numbers, extent
from fecm.mechanics.plate import PlateModel

if TYPE_CHECKING:
    from scipy import sparse

# Signs of u, v, w, theta_x, theta_y under the half turn.
TURNED = np.array([-1.0, -1.0, 1.0, -1.0, -1.0])
# Tolerance of the positions of a node and its image, relative to the plate's size.
TOLERANCE = 1.0e-9


class Mirror(NamedTuple):
    """Line of symmetry at which the elements of a part of a plate end."""

    axis: int  # 0 for a line x = place, 1 for y = place
    place: float
    odd: tuple[int, int]  # dofs of which the mirror changes the sign, so that they are 0 on it


@dataclass(frozen=True)
class SymmetryReduction:
    """Independent dofs, and the dependence of all dofs on them."""

    count: int  # number of independent dofs
    index: Indices  # (numnp, 5): independent dof that each dof follows; `count` for a dof at rest
    sign: Floats  # (numnp, 5): 1 or -1; 0 for a dof at rest
    # (numel,): number of elements that each element represents: 1 for itself, 2 with its image, or
    # 0.
    weights: NDArray[np.int_]
    # (numel,): element that each element has the displacements of, turned by half a turn if it is
    # not the element itself.
    represented_by: Indices

    @property
    def is_half(self) -> bool:
        """Whether elements stand for their images."""
        return bool((self.weights != 1).any())

    @property
    def signed(self) -> bool:
        """Whether a dof has the opposite sign of the dof that it follows."""
        return bool((self.sign < 0.0).any())

    @property
    def dof_indices(self) -> Indices:
        """Index of every dof in the padded vector: (q, -q, 0) if signed, otherwise (q, 0)."""
        zero = 2 * self.count if self.signed else self.count
        turned = np.where(self.sign < 0.0, self.count, 0)
        return np.where(self.sign == 0.0, zero, self.index + turned)

    @property
    def dofs_per_node(self) -> int:
        """Largest number of moving dofs at a node."""
        return int((self.sign != 0.0).sum(axis=1).max())

    def gather(self, values: Floats) -> Floats:
        """Sum values of all dofs, (numnp, 5), over the independent dofs, (count,)."""
        signed = (self.sign * values).ravel()
        total = np.bincount(self.index.ravel(), signed, self.count + 1)[: self.count]
        return np.asarray(total, dtype=np.float64)

    def field(self, values: Floats) -> Floats:
        """Return the values of all dofs, (numnp, 5), that follow the independent ones, (count,)."""
        return np.asarray(self.sign * np.append(values, 0.0)[self.index])

    def reduced(self, matrix: sparse.csr_array, free: Bools) -> sparse.csr_array:
        """Return S^T K S of a matrix K of the free dofs, a mask (numnp, 5).

        S is the dependence of the free dofs on the independent ones.
        """
        from scipy import sparse  # 0.16 s, which most runs don't need

        sign, index = self.sign[free], self.index[free]
        rows = np.flatnonzero(sign)
        S = sparse.csr_array((sign[rows], (rows, index[rows])), shape=(len(sign), self.count))
        return (S.T @ matrix @ S).tocsr()


def unreduced(plate: PlateModel) -> SymmetryReduction:
    """Return the reduction in which every free dof is independent."""
    equations = plate.mesh.equations
    index = equations.astype(np.intp) - 1
    index[index < 0] = plate.neq
    elements = np.arange(len(plate.mesh.elements))
    sign = (equations > 0).astype(float)
    return SymmetryReduction(plate.neq, index, sign, np.ones_like(elements), elements)


def symmetry_reduction(plate: PlateModel, contact: Floats | None) -> SymmetryReduction:
    """Find the independent dofs of a plate under its loads and a contact force, (numnp, 5)."""
    resting = restrain_resting_dofs(plate, contact)
    image_rows = _images(resting, contact)
    return unreduced(resting) if image_rows is None else _reduction(resting, *image_rows)


def _reduction(plate: PlateModel, nodes: Indices, elements: Indices) -> SymmetryReduction:
    """Assign numbers to the independent dofs, in the order of nodes and dofs.

    `nodes` and `elements` are the images under the half turn.
    """
    sign = (plate.mesh.equations > 0).astype(float)
    dof_indices = np.arange(sign.size).reshape(sign.shape)
    element_rows, node_rows = np.arange(len(elements)), np.arange(len(nodes))
    weights = np.where(element_rows < elements, 2, np.where(element_rows == elements, 1, 0))
    follows = nodes < node_rows
    leaders = np.where(follows[:, None], dof_indices[nodes], dof_indices)
    sign[follows] *= TURNED
    # A node at the centre is its own image.  Its dofs that change sign are at rest.
    sign[nodes == node_rows] *= TURNED > 0.0
    leads = (leaders == dof_indices) & (sign != 0.0)
    count = int(np.count_nonzero(leads))
    numbers = np.full(sign.size, count, dtype=np.intp)
    numbers[leads.ravel()] = np.arange(count)
    index = np.where(sign != 0.0, numbers[leaders], count)
    return SymmetryReduction(count, index, sign, weights, np.minimum(elements, element_rows))


def half_turn_images(coordinates: Floats) -> Indices | None:
    """Return each node's image under the half turn about the centre; None if one is missing."""
    return images(coordinates, (-1.0, -1.0))


def images(coordinates: Floats, flip: tuple[float, float]) -> Indices | None:
    """Return the image of each node when x and y from the centre are multiplied by 1 or -1.

    Returns None if the image of a node is missing or ambiguous.
    """
    if np.isnan(coordinates).any():
        return None
    low, high = extent(coordinates)
    pitch = TOLERANCE * float((high - low).max())
    centred = (coordinates - (low + high) / 2.0) / pitch
    # An uncommon offset keeps the positions away from the edges of the grid.  The grid has fewer
    # than 2**31 cells in each direction.
    cells = (np.floor(c + 1.0 / np.pi).astype(np.int64) for c in (centred, centred * flip))
    here, there = (x + 2**32 * y for x, y in (cell.T for cell in cells))
    order, turned = np.argsort(here, kind="stable"), np.argsort(there, kind="stable")
    if not np.array_equal(here[order], there[turned]):
        return None
    partners = np.empty(len(coordinates), dtype=np.intp)
    partners[turned] = order
    # The images of coincident nodes are ambiguous.
    return partners if np.array_equal(partners[partners], np.arange(len(partners))) else None


def restrain_resting_dofs(plate: PlateModel, contact: Floats | None) -> PlateModel:
    """Restrain the in-plane dofs of a plate if they stay at rest under a contact force, (numnp, 5).

    The in-plane modes are then not excited, and their frequencies must not limit the time step.
    """
    mesh = plate.mesh
    in_plane, bending = mesh.equations[:, :2].any(), mesh.equations[:, 2:].any()
    pulled = mesh.forces[:, :2].any() or (contact is not None and contact[:, :2].any())
    if not (in_plane and bending) or pulled or plate.moves_in_plane:
        return plate
    return restrain_plane(plate)


def restrain_plane(plate: PlateModel) -> PlateModel:
    """Restrain the in-plane dofs of a plate."""
    codes = plate.mesh.codes.copy()
    codes[:, :2] = 1
    return with_codes(plate, codes)


def with_codes(plate: PlateModel, codes: Ints) -> PlateModel:
    """Return the plate with other restraint codes, (numnp, 5)."""
    mesh = replace(plate.mesh, codes=codes, equations=equation_numbers(codes))
    return replace(plate, mesh=mesh)


def _images(plate: PlateModel, contact: Floats | None) -> tuple[Indices, Indices] | None:
    """Find the images of nodes and elements under the half turn.

    Returns None unless the half turn maps the plate onto itself.
    """
    mesh, free = plate.mesh, plate.mesh.equations > 0
    nodes = half_turn_images(mesh.coordinates)
    if nodes is None:
        return None
    if contact is not None and not np.allclose(contact, TURNED * contact[nodes], 0.0, TOLERANCE):
        return None
    if (free != free[nodes]).any() or (mesh.forces != TURNED * mesh.forces[nodes]).any():
        return None
    if plate.supports is not None and not plate.supports.is_invariant(nodes):
        return None
    if plate.added_mass is not None and (plate.added_mass != plate.added_mass[nodes]).any():
        return None
    elements = np.full(len(mesh.elements), -1, dtype=np.intp)
    for family in plate.families:
        opposite = opposite_nodes(family)
        if opposite is None:
            return None
        turned = nodes[family.nodes][:, opposite]
        order, images = np.lexsort(family.nodes.T[::-1]), np.lexsort(turned.T[::-1])
        if not np.array_equal(family.nodes[order], turned[images]):
            return None
        elements[family.rows[images]] = family.rows[order]
    return nodes, elements


def opposite_nodes(family: ElementBlock) -> Indices | None:
    """Return the position of each node's image, under the half turn, among the element's nodes."""
    xi, eta = family.shape.xi[family.present], family.shape.eta[family.present]
    is_image = (np.abs(xi + xi[:, None]) < 1e-12) & (np.abs(eta + eta[:, None]) < 1e-12)
    return np.argmax(is_image, axis=1) if (is_image.sum(axis=1) == 1).all() else None
