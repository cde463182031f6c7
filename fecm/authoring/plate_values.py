"""Values that change the plate of a deck, its mesh or the impact point: their setters.

A setter takes a deck and a value and returns the deck with the value. It raises CasesError if the
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
from fecm.mechanics.mesh import holds_the_plane
from fecm.mechanics.points import containing_elements
from fecm.problem.generate import generate, restraint_codes
from fecm.problem.parts import is_curved, moves_in_plane
from fecm.problem.plate_mesh import BOUNDARY, MeshError, PlateMesh
from fecm.problem.refine import RefineError, refined_deck

PlateSetter = Callable[[model.Deck, Value], model.Deck]


def swapped(deck: model.Deck, old: model.Segment | None, new: model.Segment) -> model.Deck:
    """Return the deck with the segment `new` instead of `old`; add `new` if `old` is None."""
    if old is None:
        return replace(deck, segments=(*deck.segments, new))
    segments = tuple(new if segment is old else segment for segment in deck.segments)
    return replace(deck, segments=segments)


# The laminate -------------------------------------------------------------------------------------


def set_layup(deck: model.Deck, value: Value) -> model.Deck:
    """Change the angles of the plies, and the number of plies.

    If the layers have several materials, the number must stay, and each layer keeps its material
    and its thickness. Otherwise all plies must have the same thickness, and the new plies have it
    too.
    """
    try:
        angles = parse_layup(str(value))
    except LayupError as error:
        raise CasesError(f"layup: {error}") from None
    material = deck.require(model.Material)
    if any(layer.material != material.layers[0].material for layer in material.layers):
        count = len(material.layers)
        if len(angles) != count:
            raise CasesError(
                f"layup: the {count} layers of the deck have several materials, and this "
                f"layup {len(angles)} plies"
            )
        layers = _with_fields(material.layers, "angle", angles)
        return swapped(deck, material, replace(material, layers=layers))
    thickness = _common_thickness("layup", deck)
    number = material.layers[0].material
    plies = [Layer(n, angle, thickness, number) for n, angle in enumerate(angles, start=1)]
    changed = _with_layers(deck, plies, len(angles) * thickness)
    return replace(changed, control=replace(deck.control, layers=len(plies), source=None))


def set_layer_materials(deck: model.Deck, value: Value) -> model.Deck:
    """Change the materials of the layers; the value has their numbers in the form of a layup."""
    material = deck.require(model.Material)
    try:
        numbers = parse_layup(str(value), math.inf)
    except LayupError as error:
        raise CasesError(f"layer_materials: {error}") from None
    existing = sorted(deck.plies)
    if unknown := [number for number in numbers if number not in existing]:
        listed = ", ".join(map(str, existing))
        raise CasesError(
            f"layer_materials: the deck has no material {unknown[0]:g}; its materials are {listed}"
        )
    count = len(material.layers)
    if len(numbers) != count:
        raise CasesError(f"layer_materials: {len(numbers)} materials for the deck's {count} layers")
    layers = _with_fields(material.layers, "material", [int(number) for number in numbers])
    return swapped(deck, material, replace(material, layers=layers))


def _with_fields(layers: Sequence[Layer], name: str, values: Sequence[float]) -> tuple[Layer, ...]:
    """Return the layers with new values of one field, a value for each layer."""
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
    """Change the thickness of the laminate; all plies are scaled."""
    layers = deck.require(model.Material).layers
    factor = float(value) / sum(layer.thickness for layer in layers)
    scaled = [replace(layer, thickness=layer.thickness * factor, source=None) for layer in layers]
    return _with_layers(deck, scaled, float(value))


def add_angle(deck: model.Deck, value: Value) -> model.Deck:
    """Rotate all plies by an angle."""
    material = deck.require(model.Material)
    angles = [layer.angle + float(value) for layer in material.layers]
    layers = _with_fields(material.layers, "angle", angles)
    return swapped(deck, material, replace(material, layers=layers))


def ply_property(name: str) -> PlateSetter:
    """Return the setter of a property of the ply."""

    def set_property(deck: model.Deck, value: Value) -> model.Deck:
        material = deck.require(model.Material)
        fields: dict[str, Any] = {name: float(value)}  # mypy compares each with every field
        ply = replace(material.ply, **fields, source=None)
        return swapped(deck, material, replace(material, ply=ply))

    return set_property


def preload_force(name: str) -> PlateSetter:
    """Return the setter of a force of the preload; a deck without a preload gets one."""

    def set_force(deck: model.Deck, value: Value) -> model.Deck:
        preload = deck.last(model.Preload)
        fields: dict[str, Any] = {name: float(value)}  # mypy compares each with every field
        changed = replace(preload or model.Preload(0.0), **fields, source=None)
        return swapped(deck, preload, changed)

    return set_force


def curvature_radius(name: str) -> PlateSetter:
    """Return the setter of a radius of a curved panel. The radius 0 is flat.

    A deck without CURV gets this segment.
    """

    def set_radius(deck: model.Deck, value: Value) -> model.Deck:
        curvature = deck.last(model.Curvature)
        fields: dict[str, Any] = {name: float(value)}  # mypy compares each with every field
        changed = replace(curvature or model.Curvature(), **fields, source=None)
        return swapped(deck, curvature, changed)

    return set_radius


def set_cure(deck: model.Deck, value: Value) -> model.Deck:
    """Change the temperature of CURE; the deck must have this segment."""
    if (cure := deck.last(model.Cure)) is None:
        raise CasesError("cure_dT: the deck has no CURE, which has the coefficients of expansion")
    return swapped(deck, cure, replace(cure, delta_t=float(value), source=None))


def strength(name: str) -> PlateSetter:
    """Return the setter of a strength of the ply of MATE."""

    def set_strength(deck: model.Deck, value: Value) -> model.Deck:
        allowables = deck.last(model.Allowables)
        if allowables is None or (strengths := allowables.of(MATERIAL)) is None:
            raise CasesError(
                f"{name}: the deck has no strengths of the ply of MATE; add an ALLO segment"
            )
        fields: dict[str, Any] = {name: float(value)}  # mypy compares each with every field
        changed = replace(strengths, **fields, source=None)
        if strengths is allowables:
            return swapped(deck, allowables, changed)
        others = tuple(changed if item is strengths else item for item in allowables.others)
        return swapped(deck, allowables, replace(allowables, others=others, source=None))

    return set_strength


def _common_thickness(name: str, deck: model.Deck) -> float:
    """Return the common thickness of the plies; raise CasesError if they differ in thickness."""
    first, *rest = (layer.thickness for layer in deck.require(model.Material).layers)
    if any(thickness != first for thickness in rest):
        raise CasesError(f"{name}: the plies of the deck differ in thickness")
    return first


def _with_layers(deck: model.Deck, layers: Sequence[Layer], thickness: float) -> model.Deck:
    """Replace the layers of MATE, and the thickness of the laminate on its first card."""
    material = deck.require(model.Material)
    integration = replace(material.integration, thickness=thickness, source=None)
    changed = replace(material, layers=tuple(layers), integration=integration)
    return swapped(deck, material, changed)


# Impact point -------------------------------------------------------------------------------------


def set_impact_node(deck: model.Deck, value: Value) -> model.Deck:
    """Change the node of ROD."""
    impact = deck.require(model.Impact)
    return swapped(deck, impact, replace(impact, node=int(value), source=None))


def patch_field(field: str) -> PlateSetter:
    """Return the setter of a field of the patch; a deck without a patch gets a disc."""

    def set_field(deck: model.Deck, value: Value) -> model.Deck:
        patch = deck.last(model.Patch)
        fields: dict[str, Any] = {field: float(value)}  # mypy compares each with every field
        return swapped(deck, patch, replace(patch or model.Patch(), **fields, source=None))

    return set_field


def set_place(deck: model.Deck, value: Value) -> model.Deck:
    """Move the centre of the patch to a point; a deck without a patch gets the nearest node."""
    x, y = pair_of_text("at", str(value))
    patch = deck.last(model.Patch)
    if patch is not None:
        return swapped(deck, patch, replace(patch, x=x, y=y, source=None))
    mesh = generate(deck)
    point = np.array([[x, y]])
    if not any(len(containing_elements(block, point)[0]) for block in mesh.families):
        raise CasesError(f"at {value} is outside the plate")
    distances = np.hypot(*(mesh.coordinates - (x, y)).T)
    return set_impact_node(deck, int(np.where(mesh.used, distances, np.inf).argmin()) + 1)


# Mesh and supports --------------------------------------------------------------------------------


def set_size(deck: model.Deck, value: Value) -> model.Deck:
    """Scale the coordinates of the nodes, of the centre of the patch, and of the gages."""
    a, b = pair_of_text("size", str(value))
    if not min(a, b) > 0.0:
        raise CasesError(f"the sides of the plate must be positive, not {value}")
    mesh = generate(deck)
    width, height = np.ptp(mesh.coordinates[mesh.used], axis=0).tolist()

    def scale_node(node: NodeValues) -> NodeValues:
        x, y = node.values[:2]
        return replace(node, values=(x * a / width, y * b / height), source=None)

    def scale(segment: model.Segment) -> model.Segment:
        match segment:
            case model.Coordinates():
                nodes = tuple(map(scale_node, segment.records))
                return replace(segment, records=nodes, source=None)
            case model.Gages():
                gages = tuple(
                    replace(gage, x=gage.x * a / width, y=gage.y * b / height, source=None)
                    for gage in segment.records
                )
                return replace(segment, records=gages, source=None)
            case model.Patch(x=x, y=y) if x is not None and y is not None:
                return replace(segment, x=x * a / width, y=y * b / height, source=None)
        return segment

    return replace(deck, segments=tuple(map(scale, deck.segments)))


def set_support(deck: model.Deck, value: Value) -> model.Deck:
    """Replace all restraints by a support of the outline, written as ``fecm new`` does."""
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
    segments = tuple(s for s in deck.segments if not isinstance(s, model.Boundary))
    if boundary is not None and support in ("simple", "pinned") and mesh.elements.shape[1] == 4:
        codes = restraint_codes([boundary], deck.control.numnp, deck.control.ndf) != 0
        if (codes[:, 2] & ~codes[:, 3:].any(axis=1)).any():
            raise CasesError(f"support {support}: elements of four nodes need sides along x or y")
    return replace(deck, segments=segments if boundary is None else (*segments, boundary))


def refine(deck: model.Deck, value: Value) -> model.Deck:
    """Divide the sides of all elements by the value, a power of two."""
    try:
        for _ in range(int(value).bit_length() - 1):
            deck = refined_deck(deck, generate(deck))
    except RefineError as error:
        raise CasesError(f"refine: {error}") from None
    return deck


def check_free_in_plane(deck: model.Deck) -> None:
    """Raise CasesError if the deck of a curved panel holds u and v at every node."""
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

    # Each dof generates its codes by itself. Copies of the codes of w therefore restrain the same
    # nodes.
    def copy_codes(record: NodeCodes) -> NodeCodes:
        w = record.codes[2]
        return replace(record, codes=(w, w, *record.codes[2:]), source=None)

    for boundary in deck.all(model.Boundary):
        changed = replace(boundary, records=tuple(map(copy_codes, boundary.records)), source=None)
        deck = swapped(deck, boundary, changed)
    return deck
