"""Setters of the values that change the plate of a deck, its mesh or its impact position.

Each setter takes a deck and a value and returns the deck with the value. CasesError says why a
value is invalid for the deck.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from fecm.authoring.case import CasesError, Value, pair_of_text
from fecm.deck import model
from fecm.deck.layup import LayupError, parse_layup
from fecm.deck.material_cards import MATERIAL
from fecm.deck.model import Layer, NodeCodes, NodeValues
from fecm.mechanics.mesh import element_blocks, holds_the_plane
from fecm.mechanics.points import containing_elements
from fecm.problem.generate import generate, restraint_codes
from fecm.problem.parts import is_curved, moves_in_plane
from fecm.problem.plate_mesh import BOUNDARY, MeshError, PlateMesh
from fecm.problem.refine import RefineError, refined_deck

PlateSetter = Callable[[model.Deck, Value], model.Deck]


def swapped(deck: model.Deck, old: model.Segment | None, new: model.Segment) -> model.Deck:
    """Replace a segment, or add one."""
    if old is None:
        return replace(deck, segments=(*deck.segments, new))
    segments = tuple(new if segment is old else segment for segment in deck.segments)
    return replace(deck, segments=segments)


# The laminate -------------------------------------------------------------------------------------


def set_layup(deck: model.Deck, value: Value) -> model.Deck:
    """Change the angles and their number; all plies keep the thickness of the deck.

    If there are as many angles as layers, each layer keeps its own material and thickness.
    """
    try:
        angles = parse_layup(str(value))
    except LayupError as error:
        raise CasesError(f"layup: {error}") from None
    old = deck.require(model.Material)
    if any(layer.material != old.layers[0].material for layer in old.layers):
        if len(angles) != len(old.layers):
            raise CasesError(
                f"layup: the {len(old.layers)} layers of the deck have several materials, and this "
                f"layup {len(angles)} plies"
            )
        return swapped(deck, old, replace(old, layers=_each(old.layers, "angle", angles)))
    thickness = _common_thickness("layup", deck)
    number = old.layers[0].material
    layers = [Layer(n, angle, thickness, number) for n, angle in enumerate(angles, start=1)]
    changed = _with_layers(deck, layers, len(angles) * thickness)
    return replace(changed, control=replace(deck.control, layers=len(layers), source=None))


def set_layer_materials(deck: model.Deck, value: Value) -> model.Deck:
    """Change the materials of the layers; numbers are written as the angles of a layup."""
    old = deck.require(model.Material)
    try:
        numbers = parse_layup(str(value), math.inf)
    except LayupError as error:
        raise CasesError(f"layer_materials: {error}") from None
    known_numbers = sorted(deck.plies)
    if unknown := [number for number in numbers if number not in known_numbers]:
        listed = ", ".join(map(str, known_numbers))
        raise CasesError(
            f"layer_materials: the deck has no material {unknown[0]:g}; its materials are {listed}"
        )
    if len(numbers) != len(old.layers):
        raise CasesError(
            f"layer_materials: {len(numbers)} materials for the deck's {len(old.layers)} layers"
        )
    layers = _each(old.layers, "material", [int(number) for number in numbers])
    return swapped(deck, old, replace(old, layers=layers))


def _each(layers: Sequence[Layer], name: str, values: Sequence[float]) -> tuple[Layer, ...]:
    """Return the layers with another value of a field for each."""
    pairs = zip(layers, values, strict=True)
    changed: list[tuple[Layer, dict[str, Any]]] = [(layer, {name: v}) for layer, v in pairs]
    return tuple(replace(layer, **fields, source=None) for layer, fields in changed)


def set_ply_thickness(deck: model.Deck, value: Value) -> model.Deck:
    """Change the thickness of every ply."""
    _common_thickness("ply_thickness", deck)
    thickness = float(value)
    layers = [
        replace(layer, thickness=thickness, source=None)
        for layer in deck.require(model.Material).layers
    ]
    return _with_layers(deck, layers, len(layers) * thickness)


def set_thickness(deck: model.Deck, value: Value) -> model.Deck:
    """Change the thickness of the laminate; every ply is scaled."""
    old = deck.require(model.Material).layers
    factor = float(value) / sum(layer.thickness for layer in old)
    layers = [replace(layer, thickness=layer.thickness * factor, source=None) for layer in old]
    return _with_layers(deck, layers, float(value))


def add_angle(deck: model.Deck, value: Value) -> model.Deck:
    """Rotate all plies."""
    old = deck.require(model.Material)
    layers = [replace(layer, angle=layer.angle + float(value), source=None) for layer in old.layers]
    return swapped(deck, old, replace(old, layers=tuple(layers)))


def ply_property(name: str) -> PlateSetter:
    """Return the setter of a property of the ply."""

    def changed(deck: model.Deck, value: Value) -> model.Deck:
        old = deck.require(model.Material)
        fields: dict[str, Any] = {name: float(value)}  # mypy compares each with every field
        return swapped(deck, old, replace(old, ply=replace(old.ply, **fields, source=None)))

    return changed


def preload_force(name: str) -> PlateSetter:
    """Return the setter of a force of the preload, which is added to a deck without one."""

    def changed(deck: model.Deck, value: Value) -> model.Deck:
        old = deck.last(model.Preload)
        fields: dict[str, Any] = {name: float(value)}  # mypy compares each with every field
        new = replace(old or model.Preload(0.0), **fields, source=None)
        return swapped(deck, old, new)

    return changed


def curvature_radius(name: str) -> PlateSetter:
    """Return the setter of a radius of a curved panel; 0 is flat.

    A deck without radii gets them.
    """

    def changed(deck: model.Deck, value: Value) -> model.Deck:
        old = deck.last(model.Curvature)
        fields: dict[str, Any] = {name: float(value)}  # mypy compares each with every field
        return swapped(deck, old, replace(old or model.Curvature(), **fields, source=None))

    return changed


def set_cure(deck: model.Deck, value: Value) -> model.Deck:
    """Change the temperature of CURE, which has the coefficients of expansion."""
    if (old := deck.last(model.Cure)) is None:
        raise CasesError("cure_dT: the deck has no CURE, which has the coefficients of expansion")
    return swapped(deck, old, replace(old, delta_t=float(value), source=None))


def strength(name: str) -> PlateSetter:
    """Return the setter of a strength of the ply of MATE."""

    def changed(deck: model.Deck, value: Value) -> model.Deck:
        old = deck.last(model.Allowables)
        if old is None or (ply := old.of(MATERIAL)) is None:
            raise CasesError(
                f"{name}: the deck has no strengths of the ply of MATE; add an ALLO segment"
            )
        fields: dict[str, Any] = {name: float(value)}  # mypy compares each with every field
        new = replace(ply, **fields, source=None)
        if ply is old:
            return swapped(deck, old, new)
        other_cards = tuple(new if card is ply else card for card in old.others)
        return swapped(deck, old, replace(old, others=other_cards, source=None))

    return changed


def _common_thickness(name: str, deck: model.Deck) -> float:
    """Return the thickness of every ply.

    Raises CasesError if the thicknesses differ.
    """
    first, *other_thicknesses = (layer.thickness for layer in deck.require(model.Material).layers)
    if any(thickness != first for thickness in other_thicknesses):
        raise CasesError(f"{name}: the plies of the deck differ in thickness")
    return first


def _with_layers(deck: model.Deck, layers: Sequence[Layer], thickness: float) -> model.Deck:
    """Replace the layers, and the thickness of the laminate, which MATE gives too."""
    old = deck.require(model.Material)
    integration = replace(old.integration, thickness=thickness, source=None)
    return swapped(deck, old, replace(old, layers=tuple(layers), integration=integration))


# Where the plate is struck ------------------------------------------------------------------------


def set_impact_node(deck: model.Deck, value: Value) -> model.Deck:
    """Change the node of ROD."""
    old = deck.require(model.Impact)
    return swapped(deck, old, replace(old, node=int(value), source=None))


def patch_field(field: str) -> PlateSetter:
    """Return the setter of a field of the patch; a deck without a patch gets a disc."""

    def changed(deck: model.Deck, value: Value) -> model.Deck:
        old = deck.last(model.Patch)
        fields: dict[str, Any] = {field: float(value)}  # mypy compares each with every field
        return swapped(deck, old, replace(old or model.Patch(), **fields, source=None))

    return changed


def set_place(deck: model.Deck, value: Value) -> model.Deck:
    """Move the centre of the patch; without one, hit the nearest node."""
    x, y = pair_of_text("at", str(value))
    patch = deck.last(model.Patch)
    if patch is not None:
        return swapped(deck, patch, replace(patch, x=x, y=y, source=None))
    mesh = generate(deck)
    blocks = element_blocks(mesh.elements, mesh.coordinates)
    if not any(len(containing_elements(block, np.array([[x, y]]))[0]) for block in blocks):
        raise CasesError(f"at {value} is outside the plate")
    distances = np.hypot(*(mesh.coordinates - (x, y)).T)
    return set_impact_node(deck, int(np.where(mesh.used, distances, np.inf).argmin()) + 1)


# Mesh and supports --------------------------------------------------------------------------------


def set_size(deck: model.Deck, value: Value) -> model.Deck:
    """Scale coordinates, the centre of the patch and the gages."""
    a, b = pair_of_text("size", str(value))
    if not min(a, b) > 0.0:
        raise CasesError(f"the sides of the plate must be positive, not {value}")
    mesh = generate(deck)
    width, height = np.ptp(mesh.coordinates[mesh.used], axis=0).tolist()

    def moved_node(node: NodeValues) -> NodeValues:
        x, y = node.values[:2]
        return replace(node, values=(x * a / width, y * b / height), source=None)

    def moved(segment: model.Segment) -> model.Segment:
        match segment:
            case model.Coordinates():
                return replace(
                    segment, records=tuple(map(moved_node, segment.records)), source=None
                )
            case model.Gages():
                gages = tuple(
                    replace(gage, x=gage.x * a / width, y=gage.y * b / height, source=None)
                    for gage in segment.records
                )
                return replace(segment, records=gages, source=None)
            case model.Patch(x=x, y=y) if x is not None and y is not None:
                return replace(segment, x=x * a / width, y=y * b / height, source=None)
        return segment

    return replace(deck, segments=tuple(map(moved, deck.segments)))


def set_support(deck: model.Deck, value: Value) -> model.Deck:
    """Replace all restraints by a support of the outline, as ``fecm new`` writes it."""
    mesh, support = generate(deck), str(value)
    if deck.has(model.Forces) or mesh.elements.shape[1] not in (4, 9) or not mesh.elements.all():
        raise CasesError("support: the deck must have no FORC, and all elements four or nine nodes")
    plate = PlateMesh(mesh.coordinates, mesh.elements.astype(int) - 1, {}, np.array([], int))
    everywhere = (0, 0, 0, 0, 0) if moves_in_plane(deck) else (1, 1, 0, 0, 0)
    in_plane = "tangential" if is_curved(deck) else "held"
    try:
        boundary = plate.supported(everywhere, {BOUNDARY: support}, in_plane=in_plane)
    except MeshError as error:
        raise CasesError(f"support {support}: {error}") from None
    other_segments = tuple(s for s in deck.segments if not isinstance(s, model.Boundary))
    if boundary is not None and support in ("simple", "pinned") and mesh.elements.shape[1] == 4:
        codes = restraint_codes([boundary], deck.control.numnp, deck.control.ndf) != 0
        if (codes[:, 2] & ~codes[:, 3:].any(axis=1)).any():
            raise CasesError(f"support {support}: elements of four nodes need sides along x or y")
    return replace(
        deck, segments=other_segments if boundary is None else (*other_segments, boundary)
    )


def refine(deck: model.Deck, value: Value) -> model.Deck:
    """Divide the sides of all elements by a power of two."""
    try:
        for _ in range(int(value).bit_length() - 1):
            deck = refined_deck(deck, generate(deck))
    except RefineError as error:
        raise CasesError(f"refine: {error}") from None
    return deck


def check_free_in_plane(deck: model.Deck) -> None:
    """Raise CasesError if a curved panel can't stretch, as its supports decide its stiffness."""
    if _holds_the_plane(deck):
        raise CasesError(
            "the deck holds u and v at every node, which clamps the membrane of a curved panel: "
            "vary its `support` too, or write it with `fecm new --radius-x`"
        )


def _holds_the_plane(deck: model.Deck) -> bool:
    """Return whether a deck restrains u and v at every node."""
    boundaries = tuple(deck.all(model.Boundary))
    return holds_the_plane(restraint_codes(boundaries, deck.control.numnp, deck.control.ndf))


def free_in_plane(deck: model.Deck) -> model.Deck:
    """Restrain u and v only where w is restrained, if the deck restrains them at every node."""
    if not _holds_the_plane(deck):
        return deck

    # Codes are generated for each dof independently, so that copies of the codes of w act like w's.
    def freed(record: NodeCodes) -> NodeCodes:
        w = record.codes[2]
        return replace(record, codes=(w, w, *record.codes[2:]), source=None)

    for old in deck.all(model.Boundary):
        new = replace(old, records=tuple(map(freed, old.records)), source=None)
        deck = swapped(deck, old, new)
    return deck
