"""Zones: parts of a plate with their own laminates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fecm._typing import Bools, Indices
from fecm.authoring.laminate import Laminate, Layup
from fecm.authoring.mesh import AnyMesh
from fecm.authoring.parameters import ObjectError, lengths_in_units
from fecm.deck import model
from fecm.deck.material_cards import MATERIAL
from fecm.mechanics.mesh import MeshArrays
from fecm.problem.generate import generate
from fecm.problem.plate_mesh import PlateMesh

SLACK = 1e-6  # share of its size by which an element may cross the edge of a zone
CORNERS = 4

# A rectangle x0, y0, x1, y1 or the name of a group of elements, and a layup or a laminate.
Place = str | Sequence[float | str]
Zone = tuple[Place, Layup | Laminate]


class ElementLaminates(NamedTuple):
    """Laminates of the elements of a plate."""

    struck: int  # number of the laminate under the load
    card: model.Zones | None  # None if all elements have the laminate of the plate


def laminates_of(laminate: Laminate, zones: Sequence[Zone]) -> list[Laminate]:
    """Return the laminates of the zones; a layup takes the materials of the plate's laminate."""
    try:
        layups = [layup for _, layup in zones]
    except (TypeError, ValueError):
        raise ObjectError(f"`zones` is {zones!r}, not pairs of a place and a layup") from None
    return [
        item if isinstance(item, Laminate) else replace(laminate, layup=item) for item in layups
    ]


def placed_zones(
    zones: Sequence[Zone],
    laminates: Sequence[int],
    mesh: AnyMesh,
    node: int,
    doubts: list[str],
    system: str | None,
) -> ElementLaminates:
    """Return the laminates of the elements. Later zones cover earlier zones.

    `laminates` has the laminate number of each zone. A rectangle includes the elements with their
    centres in it. `doubts` gets a text about each rectangle with an edge that cuts elements.
    """
    if not zones:
        return ElementLaminates(MATERIAL, None)
    control = model.Control(mesh.nodes, mesh.elements, 1, 2, 5, mesh.most_nodes)
    mesh_of_plate = generate(
        model.Deck("", control, (mesh.coordinates(), mesh.element_cards()), ())
    )
    numbers = np.full(mesh.elements, MATERIAL)
    for (place, _), laminate in zip(zones, laminates, strict=True):
        inside = (
            _elements_of_group(mesh, place)
            if isinstance(place, str)
            else _elements_of_rectangle(mesh_of_plate, place, doubts, system)
        )
        numbers[inside] = laminate
    struck = int(numbers[(mesh_of_plate.elements == node).any(axis=1)][0])
    records = _zone_cards(numbers)
    return ElementLaminates(struck, model.Zones(records) if records else None)


def _elements_of_group(mesh: AnyMesh, name: str) -> Indices:
    """Return the elements of a group of surfaces."""
    surfaces = mesh.surfaces if isinstance(mesh, PlateMesh) else {}
    if name not in surfaces:
        existing = f"its groups of elements are {', '.join(sorted(surfaces))}"
        raise ObjectError(
            f"`zones` {name!r} is neither a rectangle x0,y0,x1,y1 nor a group of the mesh; "
            f"{existing if surfaces else 'it has no groups of elements'}"
        )
    return surfaces[name]


def _elements_of_rectangle(
    mesh: MeshArrays, place: Sequence[float | str], doubts: list[str], system: str | None
) -> Bools:
    """Return the elements that have their centres in a rectangle."""
    x0, y0, x1, y1 = lengths_in_units("zones", place, CORNERS, system)
    zone = f"`zones` {x0:g},{y0:g},{x1:g},{y1:g}"
    if not (x0 < x1 and y0 < y1):
        raise ObjectError(f"{zone} is empty: x0 and y0 are its lower corner, x1 and y1 its upper")
    corners = mesh.coordinates[mesh.elements[:, :CORNERS] - 1]
    centres = corners.mean(axis=1)
    low, high = np.array([x0, y0]), np.array([x1, y1])
    inside = np.asarray(((centres >= low) & (centres <= high)).all(axis=1))
    if not inside.any():
        raise ObjectError(f"{zone} has no element whose centre lies in it")
    least, most = corners.min(axis=1), corners.max(axis=1)
    slack = SLACK * (most - least)
    within = ((least >= low - slack) & (most <= high + slack)).all(axis=1)
    beside = ((most <= low + slack) | (least >= high - slack)).any(axis=1)
    if cut := int((~within & ~beside).sum()):
        reach = ", ".join(f"{n:.6g}" for n in (*least[inside].min(0), *most[inside].max(0)))
        doubts.append(
            f"the edge of {zone} cuts {cut} elements; those whose centres lie in it have its "
            f"laminate, and it reaches over {reach}"
        )
    return inside


def _zone_cards(numbers: Indices) -> tuple[model.Zone, ...]:
    """Return a card for each run of elements with the same laminate, except the plate's."""
    starts = np.flatnonzero(np.diff(numbers, prepend=MATERIAL - 1))
    ends = [*starts[1:].tolist(), len(numbers)]
    runs = zip(starts.tolist(), ends, strict=True)
    return tuple(
        model.Zone(start + 1, end, 0, int(numbers[start]))
        for start, end in runs
        if numbers[start] != MATERIAL
    )
