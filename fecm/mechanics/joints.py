"""Where elements meet: nodes in the same place, and nodes that one of two neighbours lacks.

Elements fit together if their common side has the same nodes in both.
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

SAME = 1e-4  # distance of nodes in the same place, over the shortest side
ON_SIDE = 1e-3  # distance of a node from a side that it lies on, over the length of the side
SLANT = np.array([1.0, 2.0**-0.5])  # a direction in which no usual mesh has rows of nodes
STRETCH = float(np.hypot(*SLANT))  # distance along it over the distance, at most
PAIRS = 1_000_000  # compared at a time


class ElementSides(NamedTuple):
    """Sides of elements, each once for every element that has it.

    Attributes
    ----------
    ends : ndarray of int, shape (n, 2)
        Rows of the corners at the ends.
    between : ndarray of int, shape (n, k)
        Rows of the nodes between them; -1 where there is none.
    elements : ndarray of int, shape (n,)
        Row of the element.
    """

    ends: AnyInts
    between: AnyInts
    elements: Indices

    def take(self, members: Bools) -> ElementSides:
        """Select some sides."""
        return ElementSides(self.ends[members], self.between[members], self.elements[members])

    @property
    def nodes(self) -> AnyInts:
        """Rows of all nodes, -1 where there is none, (n, 2 + k)."""
        return np.hstack([self.ends, self.between])


def sides_of_cells(cells: Indices, corners: int) -> ElementSides:
    """Sides of cells, (m, k), of rows of corners and perhaps of the middles of their sides."""
    ends = np.stack([cells[:, :corners], np.roll(cells[:, :corners], -1, axis=1)], axis=2)
    between = cells[:, corners : 2 * corners]
    if not between.shape[1]:
        between = np.full((len(cells), corners), -1)
    elements = np.repeat(np.arange(len(cells)), corners)
    return ElementSides(ends.reshape(-1, 2), between.reshape(-1, 1), elements)


def sides_of(blocks: Sequence[ElementBlock], elements: Ints) -> ElementSides:
    """Sides of the elements of a deck, (numel, nen), whose node numbers count from 1."""
    ends, between, rows = [], [], []
    for block in blocks:
        corners, nodes = block.shape.corners, elements[block.rows]
        for side in range(corners):
            places = [4 + side]
            if block.shape is CUBIC:  # the later ones precede their corner
                places.append(8 + (side + 1) % corners)
            inner = [nodes[:, n] if n < nodes.shape[1] else 0 * nodes[:, 0] for n in places]
            ends.append(nodes[:, [side, (side + 1) % corners]])
            between.append(np.column_stack([*inner, *[0 * nodes[:, 0]] * (2 - len(inner))]))
            rows.append(block.rows)
    return ElementSides(np.concatenate(ends) - 1, np.concatenate(between) - 1, np.concatenate(rows))


def representatives(count: int, pairs: Indices) -> Indices:
    """Row that stands for each of the nodes in the same place, (count,)."""
    kept = np.arange(count)
    low, high = np.sort(pairs, axis=1).T
    np.minimum.at(kept, high, low)
    return kept


def merged(sides: ElementSides, pairs: Indices) -> ElementSides:
    """Sides with one node for those in the same place."""
    if not len(pairs):
        return sides
    kept = representatives(int(sides.nodes.max()) + 1, pairs)
    kept = np.append(kept, -1)  # of nodes that are absent
    return ElementSides(kept[sides.ends], kept[sides.between], sides.elements)


def _shortest(sides: ElementSides, places: Floats) -> float:
    """Length of the shortest side that has one."""
    x, y = (places[sides.ends[:, 1]] - places[sides.ends[:, 0]]).T
    lengths = np.hypot(x, y)
    return float(lengths[lengths > 0.0].min(initial=np.inf))


def coincident(places: Floats, sides: ElementSides) -> Indices:
    """Pairs of rows of nodes that are no distance apart beside the shortest side, (m, 2)."""
    distance = SAME * _shortest(sides, places)
    along = places @ SLANT
    order = np.argsort(along)
    sorted_along = along[order]
    reach = STRETCH * distance
    if not (np.diff(sorted_along) <= reach).any():
        return np.zeros((0, 2), np.intp)
    last = np.searchsorted(sorted_along, sorted_along + reach, side="right")
    found = [np.zeros((0, 2), np.intp)]
    for first, second in _pairs(np.arange(1, len(places) + 1), last):
        pairs = np.column_stack([order[first], order[second]])
        x, y = (places[pairs[:, 1]] - places[pairs[:, 0]]).T
        found.append(pairs[np.hypot(x, y) <= distance])
    return np.concatenate(found)


def hanging_nodes(sides: ElementSides, places: Floats) -> tuple[Indices, Indices]:
    """Nodes inside a side of an element that lacks them.

    Returns rows of nodes and of these elements, one of each for every side.
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
    found_nodes, found_elements = [nodes[:0]], [rim.elements[:0]]
    for side, place in _pairs(first, last):
        inside = _is_inside(rim, side, nodes[place], places)
        found_nodes.append(nodes[place][inside])
        found_elements.append(rim.elements[side][inside])
    return np.concatenate(found_nodes), np.concatenate(found_elements)


def _is_unmatched(sides: ElementSides, count: int) -> Bools:
    """Which sides no other element has with the same nodes."""
    ends, between = np.sort(sides.ends, axis=1), np.sort(sides.between, axis=1) + 1
    keys = ends[:, 0].astype(np.int64) * count + ends[:, 1]
    inner = between @ np.array([count + 1, 1][-between.shape[1] :], dtype=np.int64)
    order = np.argsort(keys, kind="stable")
    same = keys[order][1:] == keys[order][:-1]
    same &= inner[order][1:] == inner[order][:-1]
    unmatched = np.ones(len(keys), dtype=bool)
    unmatched[order[1:][same]] = unmatched[order[:-1][same]] = False
    return unmatched


def _is_inside(rim: ElementSides, side: Indices, node: Indices, places: Floats) -> Bools:
    """Whether nodes lie inside sides that do not have them; a mid-side node may curve a side."""
    start, end = places[rim.ends[side, 0]], places[rim.ends[side, 1]]
    place, chord = places[node], end - start
    with np.errstate(all="ignore"):
        length = np.hypot(*chord.T)
        share = ((place - start) * chord).sum(axis=1) / length**2
        middle = rim.between[side, 0]
        one = (middle >= 0) & (rim.between[side, 1:] < 0).all(axis=1)
        bulge = places[middle] - (start + end) / 2.0
        way = 4.0 * share * (1.0 - share) * one
        on_side = start + share[:, None] * chord + way[:, None] * bulge
        inside = (share > ON_SIDE) & (share < 1.0 - ON_SIDE)
        inside &= np.hypot(*(place - on_side).T) < ON_SIDE * length
        for other in rim.nodes.T:  # its nodes, and those in their places
            apart = np.hypot(*(place - places[other[side]]).T) > ON_SIDE * length
            inside &= apart | (other[side] < 0)
    return np.asarray(inside)


def _pairs(first: Indices, last: Indices) -> Iterator[tuple[Indices, Indices]]:
    """Pairs of every row with the numbers from its first to its last, some at a time."""
    counts = np.maximum(last - first, 0)
    ends = np.cumsum(counts)
    start = 0
    while start < len(counts):
        done = ends[start - 1] if start else 0
        stop = max(start + 1, int(np.searchsorted(ends, done + PAIRS, side="right")))
        own = counts[start:stop]
        rows = np.repeat(np.arange(start, stop), own)
        offsets = np.arange(len(rows)) - np.repeat(np.cumsum(own) - own, own)
        yield rows, first[rows] + offsets
        start = stop
