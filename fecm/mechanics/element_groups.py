"""Element blocks by node pattern, and groups of congruent elements."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fecm._frozen import frozen
from fecm._typing import Bools, Floats
from fecm.mechanics.elements.shape import CUBIC, QUADRILATERAL, TRIANGLE, ElementShape

# Tolerance of the relative node positions of congruent elements, relative to the largest element.
TOLERANCE = 1.0e-9


@frozen
class Congruence:
    """Groups of elements of a block that are translations of one another."""

    representatives: NDArray[np.intp]  # (ng,): position in the block of one element per group
    group: NDArray[np.intp]  # (ne,): group of every element


def distinct(values: ArrayLike) -> NDArray[Any]:
    """Sorted distinct values; without an index np.unique would import numpy.ma."""
    return np.unique(values, return_index=True)[0]


def congruence(family: ElementBlock) -> Congruence:
    """Group the congruent elements of a block.

    Positions are compared on a grid of :data:`TOLERANCE` times the largest element's size.
    Congruent elements that rounding separates form two groups, which costs time but no accuracy.
    """
    places = family.coordinates[:, 1:] - family.coordinates[:, :1]
    flat = places.reshape(len(places), -1)
    pitch = TOLERANCE * float(np.abs(flat).max())
    # An uncommon offset keeps round numbers away from the grid lines.
    cells = np.floor(flat / pitch + 1.0 / np.pi).astype(np.int64)
    _, representatives, group = np.unique(cells, axis=0, return_index=True, return_inverse=True)
    return Congruence(representatives.astype(np.intp), group.ravel().astype(np.intp))


# In ascending order of their number of nodes.
SHAPES = (TRIANGLE, QUADRILATERAL, CUBIC)

# Number of nodes of the largest element.
MOST_NODES = SHAPES[-1].nodes


def shape_of(present: Bools) -> ElementShape:
    """Shape of an element by its last node present (NEL of the listing): up to 3, 9 or 12.

    Raises ValueError if a node follows the twelfth.
    """
    found = np.flatnonzero(present)
    last = int(found[-1]) + 1 if len(found) else 0
    for shape in SHAPES:
        if last <= shape.nodes:
            return shape
    raise ValueError(f"an element has at most {MOST_NODES} nodes; this one has a node {last}")


Ints = NDArray[np.int32]


@frozen
class ElementBlock:
    """Elements that have the same nodes present."""

    rows: NDArray[np.intp]  # (ne,): rows of the elements in the mesh
    nodes: NDArray[np.intp]  # (ne, nn): rows of their nodes, from 0
    coordinates: Floats  # (ne, nn, 2): length
    present: Bools  # (shape.nodes,) of bool: which nodes of the shape are present
    shape: ElementShape  # triangle, quadrilateral or cubic quadrilateral

    def blocks(self, size: int) -> Iterator[ElementBlock]:
        """Split into blocks of at most `size` elements."""
        for start in range(0, len(self.rows), size):
            yield self.take(np.arange(start, min(start + size, len(self.rows))))

    def take(self, members: NDArray[np.intp]) -> ElementBlock:
        """Select elements by their position in the block."""
        return replace(
            self,
            rows=self.rows[members],
            nodes=self.nodes[members],
            coordinates=self.coordinates[members],
        )


def element_blocks(elements: Ints, coordinates: Floats) -> list[ElementBlock]:
    """Sort elements, (numel, nen), node numbers from 1 or 0, into blocks with the same nodes.

    Raises ValueError if a corner is missing: three for a triangle, four for the others.
    """
    nodes = np.zeros((len(elements), max(MOST_NODES, elements.shape[1])), dtype=np.intp)
    nodes[:, : elements.shape[1]] = elements
    found: list[ElementBlock] = []
    given = nodes > 0
    # Patterns in the order of their bits, first node first.
    codes = given @ (1 << np.arange(given.shape[1])[::-1])
    for code in distinct(codes):
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


def element_centres(elements: Ints, coordinates: Floats) -> Floats:
    """Mean of the corners of every element, (numel, 2)."""
    centres = np.empty((len(elements), 2))
    for block in element_blocks(elements, coordinates):
        centres[block.rows] = block.coordinates[:, : block.shape.corners].mean(axis=1)
    return centres


def longest_sides(elements: Ints, coordinates: Floats) -> Floats:
    """Longest side of every element, corner to corner, (numel,)."""
    longest = np.empty(len(elements))
    for block in element_blocks(elements, coordinates):
        corners = block.coordinates[:, : block.shape.corners]
        sides = np.hypot(*np.moveaxis(corners - np.roll(corners, 1, axis=1), 2, 0))
        longest[block.rows] = sides.max(axis=1)
    return longest
