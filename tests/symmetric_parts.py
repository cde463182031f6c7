"""Halves and quarters of whole plates, cut from their decks as a user makes them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

import fecm
from fecm.deck import model
from fecm.problem.generate import generate

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
    control = replace(deck.control, numnp=int(kept.sum()), numel=int(rows.sum()))
    segments = tuple(changed.get(type(segment), segment) for segment in deck.segments)
    return replace(deck, control=control, segments=segments, text="")
