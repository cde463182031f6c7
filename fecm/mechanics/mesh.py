"""Mesh, equation numbers, blocks of elements, and groups of congruent elements.

The elements of a block have the same nodes present, and one laminate where laminates matter.

Nodes, elements and equations are numbered from 1 as on the cards.  Row n - 1 of an array belongs to
node or element n.  An absent node of an element and the equation of a restrained dof are 0.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fecm._typing import Bools, Floats, Indices
from fecm.mechanics.elements import CUBIC, QUADRILATERAL, TRIANGLE, ElementShape

Ints = NDArray[np.int32]

# In ascending order of their number of nodes.
SHAPES = (TRIANGLE, QUADRILATERAL, CUBIC)
# Number of nodes of the largest element.
MOST_NODES = SHAPES[-1].nodes
# Tolerance of the node positions of congruent elements, relative to the largest element.
TOLERANCE = 1.0e-9
PARALLEL = 1.0e-2  # two sides form no corner if their directions differ by less


@dataclass(frozen=True, eq=False)
class MeshArrays:
    """Nodes, elements, restraints and nodal forces of a problem.

    Dofs are u, v, w, theta_x, theta_y.

    Attributes
    ----------
    coordinates : ndarray (numnp, 2)
        x and y of the nodes, length; NaN for undefined nodes.
    elements : ndarray (numel, nen) of int
        Node numbers, from 1; 0 where a node is absent.
    codes : ndarray (numnp, 5) of int
        Restraint codes; a dof with a nonzero code is restrained.
    forces : ndarray (numnp, 5)
        Nodal force or moment, or displacement of a restrained dof.
    equations : ndarray (numnp, 5) of int
        Equation numbers, from 1, in the order of nodes and dofs; 0 where restrained.
    """

    coordinates: Floats
    elements: Ints
    codes: Ints
    forces: Floats
    equations: Ints

    def __getstate__(self) -> dict[str, object]:
        """Return the arrays: a copy in another process finds blocks again."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    @cached_property
    def families(self) -> list[ElementBlock]:
        """Elements in blocks with the same nodes present.

        Raises ValueError if an element lacks a corner.
        """
        return element_blocks(self.elements, self.coordinates)

    @property
    def number_of_equations(self) -> int:
        """Number of free dofs."""
        return int(np.count_nonzero(self.equations))

    @property
    def given(self) -> Bools:
        """Whether each node has coordinates."""
        return ~np.isnan(self.coordinates[:, 0])

    @cached_property
    def used(self) -> Bools:
        """Whether each node belongs to an element."""
        used = np.zeros(len(self.coordinates) + 1, dtype=bool)
        inside = (self.elements >= 0) & (self.elements <= len(self.coordinates))
        used[np.where(inside, self.elements, 0)] = True
        return used[1:]


def equation_numbers(codes: Ints) -> Ints:
    """Assign numbers from 1 to dofs without a restraint code, node by node; others get 0."""
    free = codes.ravel() == 0
    return np.where(free, np.cumsum(free), 0).astype(np.int32).reshape(codes.shape)


def rigid_deflections(mesh: MeshArrays) -> Floats:
    """Return an orthonormal basis of w, (numnp, n), of the rigid motions that supports allow."""
    used = mesh.used
    place = mesh.coordinates[used, :2] - mesh.coordinates[used, :2].mean(axis=0)
    w = np.column_stack([np.ones(len(place)), place / np.abs(place).max()])
    slopes = np.broadcast_to(np.eye(3)[1:], (len(place), 2, 3))
    motions = np.concatenate([w[:, None], slopes], axis=1)  # of w, theta_x, theta_y
    restrained = motions[mesh.equations[used, 2:] == 0]
    resistance, combined = np.linalg.eigh(restrained.T @ restrained)
    basis = np.zeros((len(used), 3))
    basis[used] = w
    return np.linalg.qr(basis @ combined[:, resistance < 1e-9 * len(place)])[0]


def holds_the_plane(codes: Ints) -> bool:
    """Return whether restraint codes, (numnp, 5), restrain u and v of every node."""
    return bool((codes[:, :2] != 0).all())


class Congruence(NamedTuple):
    """Groups of elements of a block that are translations of one another."""

    representatives: Indices  # (ng,): position in the block of one element per group
    group: Indices  # (ne,): group of every element


class Boxes(NamedTuple):
    """Boxes with a margin around elements."""

    low: Floats  # (ne, 2): corner with the smallest x and y
    high: Floats  # (ne, 2): corner with the largest x and y
    size: Floats  # (ne,): longer side of the box of the nodes


def larger(pairs: Floats) -> Floats:
    """Return the larger number of every pair, (n,)."""
    # `max` takes ten times as long along such a short axis.
    return np.asarray(np.maximum(pairs[:, 0], pairs[:, 1]))


@dataclass(frozen=True)
class ElementBlock:
    """Elements that have the same nodes present."""

    rows: Indices  # (ne,): rows of the elements in the mesh
    nodes: Indices  # (ne, nn): rows of their nodes, from 0
    coordinates: Floats  # (ne, nn, 2): length
    present: Bools  # (shape.nodes,) of bool: which nodes of the shape are present
    shape: ElementShape  # triangle, quadrilateral or cubic quadrilateral
    laminate: int = 0  # number of the laminate, from 0

    def blocks(self, size: int) -> Iterator[ElementBlock]:
        """Split into blocks of at most `size` elements."""
        for start in range(0, len(self.rows), size):
            yield self.take(slice(start, start + size))

    def take(self, members: Indices | slice) -> ElementBlock:
        """Select elements by their position in the block."""
        names = ("rows", "nodes", "coordinates")
        return replace(self, **{name: getattr(self, name)[members] for name in names})

    @cached_property
    def boxes(self) -> Boxes:
        """Boxes that contain the elements."""
        low, high = self.coordinates.min(axis=1), self.coordinates.max(axis=1)
        size = larger(high - low)
        margin = 0.1 * size[:, None]  # sides may bulge
        return Boxes(low - margin, high + margin, size)

    @cached_property
    def congruence(self) -> Congruence:
        """Groups of congruent elements.

        Positions are compared on a grid of :data:`TOLERANCE` times the largest element's size.
        Rounding may split congruent elements into two groups, which costs time but no accuracy.
        """
        places = self.coordinates[:, 1:] - self.coordinates[:, :1]
        flat = places.reshape(len(places), -1)
        pitch = TOLERANCE * float(np.abs(flat).max())
        # An uncommon offset keeps round numbers away from the grid lines.
        cells = np.floor(flat / pitch + 1.0 / np.pi).astype(np.int64)
        low = cells.min(axis=0)
        spans = cells.max(axis=0) - low
        group = np.zeros(len(cells), dtype=np.intp)
        representatives = group[:1]
        for i in np.flatnonzero(spans):  # refine the groups until all elements differ
            keys = group * (spans[i] + 1) + cells[:, i] - low[i]
            _, representatives, group = np.unique(keys, return_index=True, return_inverse=True)
            if len(representatives) == len(cells):
                break
        return Congruence(representatives, group)


def element_blocks(
    elements: Ints, coordinates: Floats, laminates: Indices | None = None
) -> list[ElementBlock]:
    """Sort elements, (numel, nen), into blocks with the same nodes present.

    Node numbers start at 1; 0 marks an absent node.  With `laminates`, (numel,) numbers from 0, a
    block has one laminate.

    Raises ValueError if one of the three corners of a triangle, or of the four corners of another
    element, is missing.
    """
    nodes = np.zeros((len(elements), max(MOST_NODES, elements.shape[1])), dtype=np.intp)
    nodes[:, : elements.shape[1]] = elements
    blocks: list[ElementBlock] = []
    is_present = nodes > 0
    # Patterns in the order of their bits, first node first.
    codes = np.zeros(len(is_present), dtype=np.intp)
    for column in is_present.T:
        codes = 2 * codes + column
    for code in distinct(codes):
        rows = np.flatnonzero(codes == code)
        present = is_present[rows[0]]
        shape = shape_of(present)
        if not present[: shape.corners].all():
            raise ValueError(
                f"element {rows[0] + 1} lacks one of the {shape.corners} corners of a {shape.name}"
            )
        for number in (0,) if laminates is None else distinct(laminates[rows]).tolist():
            rows_of_laminate = rows if laminates is None else rows[laminates[rows] == number]
            members, places = nodes[rows_of_laminate][:, present] - 1, present[: shape.nodes]
            blocks.append(
                ElementBlock(rows_of_laminate, members, coordinates[members], places, shape, number)
            )
    return blocks


def shape_of(present: Bools) -> ElementShape:
    """Return the shape of an element by its last present node (NEL of the listing).

    Raises ValueError if the last node is beyond 12.
    """
    last = int(np.flatnonzero(present).max(initial=-1)) + 1
    for shape in SHAPES:
        if last <= shape.nodes:
            return shape
    raise ValueError(f"an element has at most {MOST_NODES} nodes; this one has a node {last}")


def element_centres(elements: Ints, coordinates: Floats) -> Floats:
    """Return the mean of the corners of every element, (numel, 2)."""
    centres = np.empty((len(elements), 2))
    for block in element_blocks(elements, coordinates):
        centres[block.rows] = block.coordinates[:, : block.shape.corners].mean(axis=1)
    return centres


def longest_sides(elements: Ints, coordinates: Floats) -> Floats:
    """Return the longest side of every element, corner to corner, (numel,)."""
    longest = np.empty(len(elements))
    for block in element_blocks(elements, coordinates):
        corners = block.coordinates[:, : block.shape.corners]
        sides = np.hypot(*np.moveaxis(corners - np.roll(corners, 1, axis=1), 2, 0))
        longest[block.rows] = sides.max(axis=1)
    return longest


def inner_corners(blocks: Sequence[ElementBlock], coordinates: Floats, held: Bools) -> Floats:
    """Find the corners, inside the plate, of lines of held nodes, (n, 2).

    Parameters
    ----------
    blocks : sequence of ElementBlock
        All elements.
    coordinates : ndarray (numnp, 2)
        Coordinates of the nodes, length.
    held : ndarray of bool (numnp,)
        Nodes whose deflection is restrained.
    """
    ends = np.concatenate(
        [
            block.nodes[:, [side, (side + 1) % block.shape.corners]]
            for block in blocks
            for side in range(block.shape.corners)
        ]
    )
    ends = np.sort(ends[held[ends].any(axis=1)], axis=1)
    keys, counts = np.unique(ends @ [len(coordinates), 1], return_counts=True)
    sides = np.column_stack(np.divmod(keys, len(coordinates)))
    rim = distinct(sides[counts == 1])
    sides = sides[held[sides].all(axis=1)]
    direction = coordinates[sides[:, 1]] - coordinates[sides[:, 0]]
    # The doubled angle is the same for both senses of a direction.
    double = 2.0 * np.arctan2(direction[:, 1], direction[:, 0])
    total, count = np.zeros((len(coordinates), 2)), np.zeros(len(coordinates))
    for end in sides.T:
        np.add.at(total, end, np.column_stack([np.cos(double), np.sin(double)]))
        np.add.at(count, end, 1.0)
    is_corner = np.hypot(*total.T) < (1.0 - PARALLEL) * count
    is_corner[rim] = False
    return np.asarray(coordinates[is_corner])


def extent(places: Floats) -> tuple[Floats, Floats]:
    """Return the lowest and highest coordinates of places, (n, 2)."""
    x, y = places.T  # reducing one axis at a time is ten times as fast
    return np.array([x.min(), y.min()]), np.array([x.max(), y.max()])


def distinct(values: ArrayLike) -> NDArray[Any]:
    """Return the sorted distinct values; without an index np.unique would import numpy.ma."""
    return np.unique(values, return_index=True)[0]
