"""Bisection of the elements of a mesh.

A bisected side takes the opposite side of its elements with it, so that the mesh stays conforming:
bisecting near a point cuts strips of elements through the whole plate.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import replace
from functools import cache, partial
from typing import NamedTuple

import numpy as np

from fecm._errors import FecmError
from fecm._typing import Bools, Floats
from fecm.deck.model import (
    Boundary,
    Coordinates,
    Deck,
    Elements,
    Forces,
    Segment,
)
from fecm.mechanics.mesh import ElementBlock, Ints, MeshArrays

# Corners at the ends of each side, and the local coordinate that runs along it.
_SIDES = ((0, 1), (1, 2), (2, 3), (3, 0))
_ALONG = (0, 1, 0, 1)


class RefineError(FecmError, ValueError):
    """A mesh can't be bisected."""


def refined_deck(deck: Deck, mesh: MeshArrays, marked: Bools | None = None) -> Deck:
    """Bisect all elements of a deck, or the marked elements, (numel,), in both directions.

    Old nodes keep their numbers. A new node is restrained if all nodes of its side, or of its
    element, are restrained. Nodal forces stay on their nodes. Raises RefineError if an element is
    not a quadrilateral with four or nine nodes.
    """
    nodes = _Nodes(mesh)
    elements: list[tuple[int, list[int]]] = []
    split = _split_sides(mesh, np.ones(len(mesh.elements), bool) if marked is None else marked)
    for block in mesh.families:
        count = block.nodes.shape[1]
        if count not in (4, 9) or block.shape.nodes != 9:
            why = "it does not have four or nine nodes"
            raise RefineError(f"element {block.rows[0] + 1} cannot be bisected: {why}")
        spots = cache(partial(_spots, block))
        for row in block.rows.tolist():
            cuts = tuple(2 if split[row, axis] else 1 for axis in (0, 1))
            corners = mesh.elements[row, :count]
            for part in np.ndindex(*cuts):
                numbers = [nodes.number(row, corners, spot) for spot in spots(cuts, part)]
                elements.append((row, numbers))
    return _rebuilt(deck, mesh, nodes, sorted(elements))


def _split_sides(mesh: MeshArrays, marked: Bools) -> Bools:
    """Return whether each element is bisected along xi and along eta, (numel, 2)."""
    ends = np.sort(mesh.elements[:, _SIDES], axis=2)
    _, side = np.unique(ends.reshape(-1, 2), axis=0, return_inverse=True)
    side = side.reshape(-1, 4)
    cut = np.zeros(side.max() + 1, dtype=bool)
    cut[side[marked]] = True
    while True:
        pairs = np.stack([cut[side[:, [0, 2]]].any(axis=1), cut[side[:, [1, 3]]].any(axis=1)], 1)
        before = np.count_nonzero(cut)
        for axis in (0, 1):
            cut[side[pairs[:, axis]][:, [axis, axis + 2]]] = True
        if np.count_nonzero(cut) == before:
            return pairs


class _Spot(NamedTuple):
    """Place of a node of a part in an old element."""

    place: tuple[float, ...]  # local coordinates in the old element
    shares: Floats  # of the old element's nodes, (nodes,)
    old: int | None  # the old node at this place
    side: int | None  # the old side that it is on
    along: float  # position from the first end of the side to the second


def _spots(block: ElementBlock, cuts: tuple[int, ...], part: tuple[int, ...]) -> list[_Spot]:
    """Return the places of the nodes of a part, counted along xi and eta, of an element."""
    count = block.nodes.shape[1]
    local = np.stack([block.shape.xi, block.shape.eta], axis=1)[:count]
    low = np.array([-1.0 + 2.0 * number / total for number, total in zip(part, cuts, strict=True)])
    point = low + (local + 1.0) / cuts
    values = block.shape.shape_functions(point[:, 0], point[:, 1], block.present)[0]
    spots = []
    for place, shares in zip(point.tolist(), values[:, block.present], strict=True):
        old = np.flatnonzero(np.abs(shares - 1.0) < 1e-9).tolist()
        across = zip((1, 0, 1, 0), (-1.0, 1.0, 1.0, -1.0), strict=True)
        on = [n for n, (axis, position) in enumerate(across) if abs(place[axis] - position) < 1e-9]
        along = place[_ALONG[on[0]]] * (1 if on[0] < 2 else -1) if on else 0.0
        node, side = (numbers[0] if numbers else None for numbers in (old, on))
        spots.append(_Spot(tuple(place), shares, node, side, along))
    return spots


class _Nodes:
    """Old and new nodes: coordinates, restraint codes and prescribed values."""

    def __init__(self, mesh: MeshArrays) -> None:
        self._mesh = mesh
        self._known: dict[Hashable, int] = {}
        self.coordinates = list(mesh.coordinates)
        self.codes = list(mesh.codes)
        self.forces = list(mesh.forces)

    def number(self, row: int, nodes: Ints, spot: _Spot) -> int:
        """Return the number of the node at a place of an old element; a new node gets a number."""
        if spot.old is not None:
            return int(nodes[spot.old])
        key: Hashable = (row, spot.place)
        if spot.side is not None:
            first, second = (int(nodes[corner]) for corner in _SIDES[spot.side])
            key = (first, second, spot.along) if first < second else (second, first, -spot.along)
        if key not in self._known:
            self._known[key] = len(self.coordinates) + 1
            mesh, rows, shares = self._mesh, nodes - 1, spot.shares
            around = rows if spot.side is None else rows[np.abs(shares) > 1e-12]
            codes = (mesh.codes[around] != 0).all(axis=0).astype(np.int32)
            self.coordinates.append(shares @ mesh.coordinates[rows])
            self.codes.append(codes)
            self.forces.append(np.where(codes != 0, shares @ mesh.forces[rows], 0.0))
        return self._known[key]


def _node_cards(values: Floats | Bools) -> Floats:
    """Return the cards of the nodes from 1 on, without increments."""
    count = len(values)
    return np.column_stack((np.arange(1, count + 1), np.zeros(count), values))


def _rebuilt(
    deck: Deck, mesh: MeshArrays, nodes: _Nodes, elements: list[tuple[int, list[int]]]
) -> Deck:
    """Return the deck with other nodes and elements, each on its own card."""
    control = replace(deck.control, numnp=len(nodes.coordinates), numel=len(elements))
    children = np.zeros((len(elements), mesh.elements.shape[1]))
    for row, (_, child) in zip(children, elements, strict=True):
        row[: len(child)] = child
    numbers = np.arange(1, len(elements) + 1)
    codes, forces = np.array(nodes.codes) != 0, np.array(nodes.forces)
    written: list[Segment] = [
        Coordinates.of(control, _node_cards(np.array(nodes.coordinates))),
        Elements.of(control, np.column_stack((numbers, children, np.zeros(len(elements))))),
        Boundary.of(control, _node_cards(codes)[codes.any(axis=1)]),
    ]
    if forces.any():
        written.append(Forces.of(control, _node_cards(forces)[forces.any(axis=1)]))
    replaced = (Coordinates, Elements, Boundary, Forces)
    rest = [segment for segment in deck.segments if not isinstance(segment, replaced)]
    return replace(deck, control=control, segments=(*written, *rest), text="")
