"""Halves and quarters of whole plates, cut from their decks as a user makes them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

import fecm
from fecm.deck import model
from fecm.problem.generate import generate
from tests.test_nonlinear_cards import with_codes

THICKNESS = 2.0
LAW = fecm.Contact(40_000.0, 0.003, 0.05, 2.0)


def whole_deck(support: Any = "simple", **options: Any) -> fecm.Deck:
    """Deck of an impact in the middle of a [0/90]2s plate of 6 x 6 elements, with DELA and FAIL."""
    chosen: dict[str, Any] = {
        "plate": fecm.Plate.rectangle((100.0, 80.0), (6, 6), support=support),
        "laminate": fecm.Laminate("[0/90]2s", "IM7/8552", THICKNESS / 8),
        "projectile": fecm.RigidMass(2e-5),
        "contact": LAW,
        "velocity": 8000.0,
        "units": "mm-N-s",
        "patch": None,
        "damage": True,
        "plies": False,
        "duration": 8e-4,
        "kinematics": "linear",
    }
    return fecm.impact(**chosen | options)


def part_of(deck: fecm.Deck, axes: Sequence[int]) -> fecm.Deck:
    """The part of a deck at high x (axis 0), high y (axis 1) or both, with its share of all values.

    The middle lines become lines of symmetry.
    """
    mesh = generate(deck)
    xy = mesh.coordinates
    middle = (xy.min(axis=0) + xy.max(axis=0)) / 2.0
    kept = (xy[:, axes] >= middle[list(axes)] - 1e-6).all(axis=1)
    numbers = np.concatenate([[0], np.where(kept, np.cumsum(kept), 0)])
    rows = kept[np.maximum(mesh.elements, 1) - 1].all(axis=1)
    new_number = np.cumsum(rows)
    elements = numbers[mesh.elements[rows]]
    codes = (mesh.codes[kept] != 0).astype(int)
    for axis in axes:
        line = np.abs(xy[kept][:, axis] - middle[axis]) < 1e-6
        codes[np.ix_(line, [axis, 3 + axis])] = 1
    factor = 2 ** len(axes)

    def numbered(rows: np.ndarray[Any, Any]) -> Iterator[tuple[int, tuple[Any, ...]]]:
        return ((number, tuple(row)) for number, row in enumerate(rows.tolist(), 1))

    impact, law = deck.require(model.Impact), deck.require(model.Indentation)
    card = deck.require(model.Projectile)
    thinner = (replace(d, diameter=d.diameter / factor**0.5) for d in card.diameters)
    mass = card.size if card.elements else card.size / factor
    changed: dict[type[model.Segment], model.Segment] = {
        model.Coordinates: model.Coordinates(
            tuple(model.NodeValues(n, 0, row) for n, row in numbered(xy[kept]))
        ),
        model.Elements: model.Elements(
            tuple(model.ElementNodes(n, row, 0) for n, row in numbered(elements))
        ),
        model.Boundary: model.Boundary(
            tuple(model.NodeCodes(n, 0, row) for n, row in numbered(codes))
        ),
        model.Impact: replace(impact, node=int(numbers[impact.node])),
        model.Indentation: replace(law, k=law.k / factor),
        model.Projectile: replace(card, size=mass, diameters=tuple(thinner)),
    }
    if (zones := deck.last(model.Zones)) is not None:
        changed[model.Zones] = model.Zones(
            tuple(
                model.Zone(int(new_number[number - 1]), 0, 0, zone.laminate)
                for zone in zones.records
                for number in zone.elements
                if rows[number - 1]
            )
        )
    control = replace(deck.control, numnp=int(kept.sum()), numel=int(rows.sum()))
    segments = tuple(changed.get(type(segment), segment) for segment in deck.segments)
    return replace(deck, control=control, segments=segments, text="")


def with_segments(deck: fecm.Deck, *segments: model.Segment) -> fecm.Deck:
    """The deck with other segments."""
    return replace(deck, segments=(*deck.segments, *segments), text="")


def window_deck() -> fecm.Deck:
    """The plate, with w held along the sides of a window that are an element inside its edges."""
    deck = whole_deck("free")
    mesh = generate(deck)
    codes = (mesh.codes != 0).astype(int)
    beyond = np.abs(mesh.coordinates - (50.0, 40.0)) / (100.0 / 3.0, 80.0 / 3.0)
    codes[np.isclose(beyond.max(axis=1), 1.0), 2] = 1
    return with_codes(deck, codes)


def mesh_of(corners: int) -> fecm.Plate:
    """The plate as a mesh generator writes it: 3, 4 or 8 nodes for an element."""
    side = 2 if corners == 8 else 1
    count = 6 * side + 1
    x, y = np.meshgrid(np.linspace(0.0, 100.0, count), np.linspace(0.0, 80.0, count))
    first = (count * side * np.arange(6)[:, None] + side * np.arange(6)).ravel()
    corner = np.array([0, side, (count + 1) * side, count * side])
    cells = first[:, None] + corner
    if corners == 8:
        cells = np.hstack([cells, first[:, None] + [1, 2 + count, 1 + 2 * count, count]])
    if corners == 3:  # diagonals towards the middle, as mirrors have them
        row, column = np.divmod(np.arange(36), 6)
        rising = (row < 3) == (column < 3)
        cells = np.where(rising[:, None], cells, np.roll(cells, -1, axis=1))
        cells = np.concatenate([cells[:, [0, 1, 2]], cells[:, [0, 2, 3]]])
    used, places = np.unique(cells, return_inverse=True)
    points = np.column_stack([x.ravel(), y.ravel()])[used]
    return fecm.Plate.from_mesh((points, places.reshape(cells.shape)), "simple")
