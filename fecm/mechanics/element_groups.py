"""Which family an element belongs to: its last node decides (the listing's NEL)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fecm._typing import Bools, Floats
from fecm.mechanics.elements import cubic, quadrilateral, triangle
from fecm.mechanics.elements.shape import ElementShape

# Two elements are congruent if their nodes' relative places agree to this part of the largest
# element's size.
TOLERANCE = 1.0e-9


@dataclass(frozen=True)
class Congruence:
    """Which elements of a family are translations of which.

    Attributes
    ----------
    representatives : ndarray (ng,)
        Position in the family of one element of every group.
    group : ndarray (ne,)
        Group of every element.
    """

    representatives: NDArray[np.intp]
    group: NDArray[np.intp]


def congruence(family: ElementBlock) -> Congruence:
    """Sort a family's elements into groups of congruent ones.

    Places are compared on a grid of :data:`TOLERANCE` times the largest element's size; two equal
    elements that rounding puts on either side of a grid line make two groups, which costs time but
    no accuracy.
    """
    places = family.coordinates[:, 1:] - family.coordinates[:, :1]
    flat = places.reshape(len(places), -1)
    pitch = TOLERANCE * float(np.abs(flat).max())
    # An offset that no mesh has keeps round numbers away from the grid lines.
    cells = np.floor(flat / pitch + 1.0 / np.pi).astype(np.int64)
    _, representatives, group = np.unique(cells, axis=0, return_index=True, return_inverse=True)
    return Congruence(representatives.astype(np.intp), group.ravel().astype(np.intp))


# Each takes the elements whose last node the one before does not know.
SHAPES = (triangle.SHAPE, quadrilateral.SHAPE, cubic.SHAPE)

# Number of nodes of the largest element.
MOST_NODES = SHAPES[-1].nodes


def shape_of(present: Bools) -> ElementShape:
    """Family of an element: 3 nodes a triangle, up to 9 a quadrilateral, up to 12 a cubic one.

    Parameters
    ----------
    present : ndarray (n,) of bool
        Which nodes the element has.

    Raises
    ------
    ValueError
        If a node stands beyond the twelfth place.
    """
    found = np.flatnonzero(present)
    last = int(found[-1]) + 1 if len(found) else 0
    for shape in SHAPES:
        if last <= shape.nodes:
            return shape
    raise ValueError(f"an element has at most {MOST_NODES} nodes; this one has a node {last}")


Ints = NDArray[np.int32]


@dataclass(frozen=True)
class ElementBlock:
    """Elements that have the same nodes present.

    Attributes
    ----------
    rows : ndarray (ne,)
        The elements' rows in the mesh.
    nodes : ndarray (ne, nn)
        Rows of their nodes, from 0.
    coordinates : ndarray (ne, nn, 2)
        Length.
    present : ndarray (shape.nodes,) of bool
        Which of their shape's nodes they have.
    shape : ElementShape
        Triangle, quadrilateral or cubic quadrilateral.
    """

    rows: NDArray[np.intp]
    nodes: NDArray[np.intp]
    coordinates: Floats
    present: Bools
    shape: ElementShape

    def blocks(self, size: int) -> Iterator[ElementBlock]:
        """Cut the family into blocks of at most `size` elements."""
        for start in range(0, len(self.rows), size):
            yield self.take(np.arange(start, min(start + size, len(self.rows))))

    def take(self, members: NDArray[np.intp]) -> ElementBlock:
        """Pick some of the family's elements, by their position in it."""
        return replace(
            self,
            rows=self.rows[members],
            nodes=self.nodes[members],
            coordinates=self.coordinates[members],
        )


def element_blocks(elements: Ints, coordinates: Floats) -> list[ElementBlock]:
    """Sort elements by the nodes they have; a family's shape follows from the last of them.

    Parameters
    ----------
    elements : ndarray (numel, nen)
        Node numbers from 1, 0 where absent; nen is at most 12.
    coordinates : ndarray (numnp, 2)
        Length.

    Raises
    ------
    ValueError
        If an element lacks one of its corners: three up to a third node, four beyond.
    """
    nodes = np.zeros((len(elements), max(MOST_NODES, elements.shape[1])), dtype=np.intp)
    nodes[:, : elements.shape[1]] = elements
    found: list[ElementBlock] = []
    given = nodes > 0
    # Patterns in the order of their bits, first node first.
    codes = given @ (1 << np.arange(given.shape[1])[::-1])
    for code in np.unique(codes):
        rows = np.flatnonzero(codes == code)
        present = given[rows[0]]
        shape = shape_of(present)
        if not present[: shape.corners].all():
            raise ValueError(
                f"element {rows[0] + 1} lacks one of the {shape.corners} corners of a {shape.name}"
            )
        members = nodes[rows][:, present] - 1
        found.append(
            ElementBlock(rows, members, coordinates[members], present[: shape.nodes], shape)
        )
    return found
