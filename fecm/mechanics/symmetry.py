"""What of a plate moves in time, where that is provably less than all of its unknowns.

In-plane unknowns rest for ever where the laminate does not couple them to bending and nothing pulls
in the plane.  A plate that half a turn about its middle carries into itself, struck there, moves in
the same way: w as its image does, the other unknowns against theirs, so that half of the elements
are enough.  Any laminate is the same after half a turn; mesh, supports and loads must be.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fecm._typing import Floats
from fecm.mechanics.element_groups import ElementBlock
from fecm.mechanics.mesh import equation_numbers
from fecm.mechanics.plate import PlateModel

Indices = NDArray[np.intp]

# Sign of an image's u, v, w, theta_x, theta_y after half a turn.
TURNED = np.array([-1.0, -1.0, 1.0, -1.0, -1.0])
# Two nodes are one another's images if their places agree to this part of the plate's size.
TOLERANCE = 1.0e-9


@dataclass(frozen=True)
class SymmetryReduction:
    """Which unknowns move on their own, and how the others follow.

    Attributes
    ----------
    count : int
        Unknowns that move on their own.
    index : ndarray (numnp, 5)
        The one among them that each unknown follows; `count` where it rests.
    sign : ndarray (numnp, 5)
        1 or -1; 0 where it rests.
    weights : ndarray (numel,)
        How many elements each stands for: itself, itself and its image, or none.
    """

    count: int
    index: Indices
    sign: Floats
    weights: NDArray[np.int_]

    @property
    def signed(self) -> bool:
        """Whether some unknown moves against the one that it follows."""
        return bool((self.sign < 0.0).any())

    @property
    def slots(self) -> Indices:
        """Place of every unknown in the vector (q, -q, 0), or (q, 0) where nothing is signed."""
        zero = 2 * self.count if self.signed else self.count
        turned = np.where(self.sign < 0.0, self.count, 0)
        return np.where(self.sign == 0.0, zero, self.index + turned)

    @property
    def unknowns_a_node(self) -> int:
        """The most unknowns of a node that move."""
        return int((self.sign != 0.0).sum(axis=1).max())

    def gather(self, values: Floats) -> Floats:
        """Sum values of all unknowns, (numnp, 5), into those of the ones that they follow."""
        signed = (self.sign * values).ravel()
        total = np.bincount(self.index.ravel(), signed, self.count + 1)[: self.count]
        return np.asarray(total, dtype=np.float64)


def whole(plate: PlateModel) -> SymmetryReduction:
    """Every unknown on its own."""
    free = plate.mesh.equations > 0
    ones = np.ones(len(plate.mesh.elements), dtype=int)
    return _numbered(free, np.arange(free.size).reshape(free.shape), free.astype(float), ones)


def symmetry_reduction(plate: PlateModel, hit: tuple[int, int] | None) -> SymmetryReduction:
    """Find what moves under the plate's loads and a force on one unknown.

    Parameters
    ----------
    plate : PlateModel
        Starts at rest.
    hit : tuple of int, optional
        Row of the node that is hit, and which of its unknowns, from 0.
    """
    free = moving(plate, hit).mesh.equations > 0
    places = np.arange(free.size).reshape(free.shape)
    sign, weights = free.astype(float), np.ones(len(plate.mesh.elements), dtype=int)
    images = _images(plate, free, hit)
    if images is not None:
        nodes, elements = images
        own = np.arange(len(elements))
        weights = np.where(own < elements, 2, np.where(own == elements, 1, 0))
        follows = nodes < np.arange(len(nodes))
        places[follows] = places[nodes[follows]]
        sign[follows] *= TURNED
        # In the middle itself an unknown that turns against its own motion has none.
        sign[nodes == np.arange(len(nodes))] *= TURNED > 0.0
    return _numbered(sign != 0.0, places, sign, weights)


def moving(plate: PlateModel, hit: tuple[int, int] | None) -> PlateModel:
    """Restrain the in-plane unknowns of a plate where they rest for ever.

    Their modes are never excited, and their frequencies do not limit the time step.

    Parameters
    ----------
    plate : PlateModel
        Starts at rest.
    hit : tuple of int, optional
        Row of the node that is hit, and which of its unknowns, from 0.
    """
    mesh = plate.mesh
    in_plane, others = mesh.equations[:, :2].any(), mesh.equations[:, 2:].any()
    if not (in_plane and others) or not _in_plane_rests(plate, hit):
        return plate
    codes = mesh.codes.copy()
    codes[:, :2] = 1
    return replace(plate, mesh=replace(mesh, codes=codes, equations=equation_numbers(codes)))


def _numbered(
    moves: NDArray[np.bool_], places: Indices, sign: Floats, weights: NDArray[np.int_]
) -> SymmetryReduction:
    """Number what moves on its own in the order of nodes and unknowns."""
    leaders = (places == np.arange(moves.size).reshape(moves.shape)) & moves
    count = int(np.count_nonzero(leaders))
    numbers = np.full(moves.size, count, dtype=np.intp)
    numbers[leaders.ravel()] = np.arange(count)
    index = np.where(moves, numbers[places], count)
    return SymmetryReduction(count, index, sign, weights)


def _in_plane_rests(plate: PlateModel, hit: tuple[int, int] | None) -> bool:
    pulled = plate.mesh.forces[:, :2].any() or (hit is not None and hit[1] < 2)
    return not (plate.laminate.is_coupled or pulled)


def _images(
    plate: PlateModel, free: NDArray[np.bool_], hit: tuple[int, int] | None
) -> tuple[Indices, Indices] | None:
    """Images of nodes and of elements after half a turn, if it carries all into itself."""
    mesh = plate.mesh
    if hit is not None and hit[1] != 2:
        return None
    nodes = _partners(mesh.coordinates)
    if nodes is None or (hit is not None and nodes[hit[0]] != hit[0]):
        return None
    same_supports = (free == free[nodes]).all()
    same_loads = (mesh.forces == TURNED * mesh.forces[nodes]).all()
    if not (same_supports and same_loads):
        return None
    elements = np.full(len(mesh.elements), -1, dtype=np.intp)
    for family in plate.families:
        opposite = _opposite(family)
        if opposite is None:
            return None
        turned = nodes[family.nodes][:, opposite]
        order = np.lexsort(family.nodes.T[::-1])
        images = np.lexsort(turned.T[::-1])
        if not np.array_equal(family.nodes[order], turned[images]):
            return None
        elements[family.rows[images]] = family.rows[order]
    return nodes, elements


def _partners(coordinates: Floats) -> Indices | None:
    """Row of the node where half a turn about the middle carries each node."""
    if np.isnan(coordinates).any():
        return None
    low, high = coordinates.min(axis=0), coordinates.max(axis=0)
    pitch = TOLERANCE * float((high - low).max())
    centred = (coordinates - (low + high) / 2.0) / pitch
    # An offset that no mesh has keeps the places away from the limits of rounding.
    here, there = (np.floor(c + 1.0 / np.pi).astype(np.int64) for c in (centred, -centred))
    order, images = np.lexsort(here.T), np.lexsort(there.T)
    if not np.array_equal(here[order], there[images]):
        return None
    partners = np.empty(len(coordinates), dtype=np.intp)
    partners[images] = order
    # Of nodes at the same place any may be found; then there is no telling.
    return partners if np.array_equal(partners[partners], np.arange(len(partners))) else None


def _opposite(family: ElementBlock) -> Indices | None:
    """Position, among a family's nodes, of the one across the element's middle."""
    xi, eta = family.shape.xi[family.present], family.shape.eta[family.present]
    found = (np.abs(xi + xi[:, None]) < 1e-12) & (np.abs(eta + eta[:, None]) < 1e-12)
    return np.argmax(found, axis=1) if (found.sum(axis=1) == 1).all() else None
