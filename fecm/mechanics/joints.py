"""Joints of elements: nodes in the same place, and nodes that one of two neighbours lacks.

Two elements fit together if both have the same nodes on their common side.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fecm._typing import Bools, Floats, Indices
from fecm.mechanics.elements import CUBIC
from fecm.mechanics.mesh import ElementBlock, Ints, distinct

AnyInts = NDArray[np.integer[Any]]

SAME = 1e-4  # largest distance of nodes in the same place, over the shortest side
ON_SIDE = 1e-3  # largest distance of a node from a side that it lies on, over the side's length
SLANT = np.array([1.0, 2.0**-0.5])  # a direction in which no usual mesh has rows of nodes
STRETCH = float(np.hypot(*SLANT))  # largest distance along SLANT over the distance in the plane
PAIRS = 1_000_000  # pairs compared at a time


class ElementSides(NamedTuple):
    """Sides of elements.  A common side occurs once for each of its elements.

    Attributes
    ----------
    ends : ndarray of int, shape (n, 2)
        Rows of the two corners.
    between : ndarray of int, shape (n, k)
        Rows of the nodes between the corners; -1 for an absent node.
    elements : ndarray of int, shape (n,)
        Row of the element.
    """

    ends: AnyInts
    between: AnyInts
    elements: Indices

    def take(self, members: Bools) -> ElementSides:
        """Select sides by a mask."""
        return ElementSides(self.ends[members], self.between[members], self.elements[members])

    @property
    def nodes(self) -> AnyInts:
        """Rows of all nodes, (n, 2 + k); -1 for an absent node."""
        return np.hstack([self.ends, self.between])


def sides_of_cells(cells: Indices, corners: int) -> ElementSides:
    """Return the sides of cells, (m, k): rows of corners, optionally followed by mid-sides."""
    ends = np.stack([cells[:, :corners], np.roll(cells[:, :corners], -1, axis=1)], axis=2)
    between = cells[:, corners : 2 * corners]
    if not between.shape[1]:
        between = np.full((len(cells), corners), -1)
    elements = np.repeat(np.arange(len(cells)), corners)
    return ElementSides(ends.reshape(-1, 2), between.reshape(-1, 1), elements)


def sides_of(blocks: Sequence[ElementBlock], elements: Ints) -> ElementSides:
    """Return the sides of a deck's elements, (numel, nen), whose node numbers start at 1."""
    ends, between, rows = [], [], []
    for block in blocks:
        corners, nodes = block.shape.corners, elements[block.rows]
        for side in range(corners):
            positions = [4 + side]
            if block.shape is CUBIC:  # nodes 9 to 12 precede their corners
                positions.append(8 + (side + 1) % corners)
            inner = [nodes[:, n] if n < nodes.shape[1] else 0 * nodes[:, 0] for n in positions]
            ends.append(nodes[:, [side, (side + 1) % corners]])
            between.append(np.column_stack([*inner, *[0 * nodes[:, 0]] * (2 - len(inner))]))
            rows.append(block.rows)
    return ElementSides(np.concatenate(ends) - 1, np.concatenate(between) - 1, np.concatenate(rows))


def representatives(count: int, pairs: Indices) -> Indices:
    """Return the lowest row among the nodes in the place of each node, (count,)."""
    lowest = np.arange(count)
    low, high = np.sort(pairs, axis=1).T
    np.minimum.at(lowest, high, low)
    return lowest


def merged(sides: ElementSides, pairs: Indices) -> ElementSides:
    """Merge nodes in the same place into one node."""
    if not len(pairs):
        return sides
    last = max(int(sides.nodes.max()), int(pairs.max()))  # a node of no side may be the last
    rows = representatives(last + 1, pairs)
    rows = np.append(rows, -1)  # for absent nodes
    return ElementSides(rows[sides.ends], rows[sides.between], sides.elements)


def _shortest(sides: ElementSides, places: Floats) -> float:
    """Return the length of the shortest side, ignoring sides of length 0."""
    x, y = (places[sides.ends[:, 1]] - places[sides.ends[:, 0]]).T
    lengths = np.hypot(x, y)
    return float(lengths[lengths > 0.0].min(initial=np.inf))


def coincident(places: Floats, sides: ElementSides) -> Indices:
    """Find pairs of nodes in the same place, (m, 2) rows.

    The distance of such a pair is at most SAME times the shortest side. Of nodes with equal
    coordinates, only the pairs with the lowest row are given: their number is not the square of
    the number of nodes.
    """
    shortest = _shortest(sides, places)
    distance = SAME * shortest if np.isfinite(shortest) else 0.0
    along = places @ SLANT
    reach = STRETCH * distance
    if not (np.diff(np.sort(along)) <= reach).any():
        return np.zeros((0, 2), np.intp)
    lowest = _lowest_of_equal(places)
    repeated = np.flatnonzero(lowest != np.arange(len(places)))
    rows = np.delete(np.arange(len(places)), repeated)
    order = rows[np.argsort(along[rows])]
    sorted_along = along[order]
    last = np.searchsorted(sorted_along, sorted_along + reach, side="right")
    matches = [np.zeros((0, 2), np.intp)]
    for first, second in _pairs(np.arange(1, len(rows) + 1), last):
        pairs = np.column_stack([order[first], order[second]])
        x, y = (places[pairs[:, 1]] - places[pairs[:, 0]]).T
        matches.append(pairs[np.hypot(x, y) <= distance])
    near = np.concatenate(matches)
    joined = representatives(len(places), near)[lowest[repeated]]
    return np.concatenate([near, np.column_stack([joined, repeated])])


def _lowest_of_equal(places: Floats) -> Indices:
    """Return the lowest row among the nodes with the coordinates of each node, (count,)."""
    order = np.lexsort(places.T)  # stable: the lowest row of equal ones is the first
    is_first = np.append(True, (np.diff(places[order], axis=0) != 0.0).any(axis=1))
    lowest = np.empty(len(places), np.intp)
    lowest[order] = order[np.flatnonzero(is_first)][np.cumsum(is_first) - 1]
    return lowest


def hanging_nodes(sides: ElementSides, places: Floats) -> tuple[Indices, Indices]:
    """Find nodes that lie inside a side of an element without belonging to the element.

    Returns rows of nodes and rows of elements, one of each per node and side.
    """
    rim = sides.take(_is_unmatched(sides, len(places)))
    nodes = distinct(rim.nodes[rim.nodes >= 0])
    nodes = nodes[np.argsort(places[nodes] @ SLANT)]
    along = places[nodes] @ SLANT
    reach = np.sort(places[rim.ends] @ SLANT, axis=1)
    slack = ON_SIDE * STRETCH * np.hypot(*(places[rim.ends[:, 1]] - places[rim.ends[:, 0]]).T)
    bulge = np.where(rim.between[:, 0] >= 0, 0.5, 0.0) * (reach[:, 1] - reach[:, 0])
    first = np.searchsorted(along, reach[:, 0] - slack - bulge, side="left")
    last = np.searchsorted(along, reach[:, 1] + slack + bulge, side="right")
    hanging, elements = [nodes[:0]], [rim.elements[:0]]
    for side, row in _pairs(first, last):
        inside = _is_inside(rim, side, nodes[row], places)
        hanging.append(nodes[row][inside])
        elements.append(rim.elements[side][inside])
    return np.concatenate(hanging), np.concatenate(elements)


def _is_unmatched(sides: ElementSides, count: int) -> Bools:
    """Return a mask of the sides that no other element has with the same nodes."""
    ends, between = np.sort(sides.ends, axis=1), np.sort(sides.between, axis=1) + 1
    keys = ends[:, 0].astype(np.int64) * count + ends[:, 1]
    inner = between @ np.array([count + 1, 1][-between.shape[1] :], dtype=np.int64)
    order = np.argsort(keys, kind="stable")
    is_repeated = keys[order][1:] == keys[order][:-1]
    is_repeated &= inner[order][1:] == inner[order][:-1]
    unmatched = np.ones(len(keys), dtype=bool)
    unmatched[order[1:][is_repeated]] = unmatched[order[:-1][is_repeated]] = False
    return unmatched


def _is_inside(rim: ElementSides, side: Indices, node: Indices, places: Floats) -> Bools:
    """Return whether nodes lie inside sides without belonging to them.

    A mid-side node may curve a side.
    """
    start, end = places[rim.ends[side, 0]], places[rim.ends[side, 1]]
    place, chord = places[node], end - start
    with np.errstate(all="ignore"):
        length = np.hypot(*chord.T)
        share = ((place - start) * chord).sum(axis=1) / length**2
        middle = rim.between[side, 0]
        has_middle = (middle >= 0) & (rim.between[side, 1:] < 0).all(axis=1)
        bulge = places[middle] - (start + end) / 2.0
        parabola = 4.0 * share * (1.0 - share) * has_middle
        on_side = start + share[:, None] * chord + parabola[:, None] * bulge
        inside = (share > ON_SIDE) & (share < 1.0 - ON_SIDE)
        inside &= np.hypot(*(place - on_side).T) < ON_SIDE * length
        for own_node in rim.nodes.T:  # leave out the side's own nodes, and nodes in their places
            apart = np.hypot(*(place - places[own_node[side]]).T) > ON_SIDE * length
            inside &= apart | (own_node[side] < 0)
    return np.asarray(inside)


def _pairs(first: Indices, last: Indices) -> Iterator[tuple[Indices, Indices]]:
    """Yield pairs (row, n) with first[row] <= n < last[row], in batches."""
    counts = np.maximum(last - first, 0)
    ends = np.cumsum(counts)
    start = 0
    while start < len(counts):
        done = ends[start - 1] if start else 0
        stop = max(start + 1, int(np.searchsorted(ends, done + PAIRS, side="right")))
        batch = counts[start:stop]
        rows = np.repeat(np.arange(start, stop), batch)
        offsets = np.arange(len(rows)) - np.repeat(np.cumsum(batch) - batch, batch)
        yield rows, first[rows] + offsets
        start = stop
