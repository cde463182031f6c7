"""Apply the values of a case to a deck."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from typing import Any

from fecm.deck.findings import Findings
from fecm.deck.layup import LayupError, parse_layup
from fecm.deck.model import (
    Boundary,
    Deck,
    Impact,
    Indentation,
    Material,
    Patch,
    Projectile,
    Segment,
)
from fecm.deck.reader import ParsedProblem
from fecm.deck.records import Layer, NodeCodes, Ply
from fecm.mechanics.mesh import holds_the_plane
from fecm.mechanics.projectile import RigidMass
from fecm.mechanics.time_step import taken_time_step
from fecm.problem.build import build_projectile, is_coupled, projectile_segment
from fecm.problem.generate import restraint_codes
from fecm.problem.problem import check
from fecm.sweeps.cases import NAMES, Case, CasesError, Value
from fecm.sweeps.clock import with_time_step

# Fields of a ply card.
PLY = ("density", "nu12", "e1", "e2", "g12", "g13", "g23")


def apply_case(deck: Deck, case: Case) -> Deck:
    """Return a deck with the values of a case.

    A layup uses the ply thickness of the deck, so that more plies give a thicker plate; a thickness
    scales every layer.  A mass scales the density of a rod.  A time step changes the number of
    steps, so that the duration is kept.

    A deck with B = 0 may restrain u and v at every node, because they are zero anyway.  If the case
    has B != 0, they are restrained only at the nodes that restrain w, as in a deck of ``fecm new``.

    A deck without a patch gets a disc.  Raises CasesError if a value is invalid for this deck.
    """
    if "rod_mass" in case and "rod_density" in case:
        raise CasesError("rod_mass and rod_density exclude each other")
    made = deck
    # Apply the layup before the laminate thickness, and the mass after the other rod properties.
    for name in sorted(case, key=lambda name: (name != "layup", NAMES.index(name))):
        if name != "dt":
            made = _SETTERS[name](made, name, case[name])
    if "dt" in case:
        made = with_time_step(made, float(case["dt"]), _taken_time_step(deck))
    material = deck.last(Material)
    if material is not None and not is_coupled(material) and is_coupled(made.require(Material)):
        made = _free_in_plane(made)
    return replace(made, text="")


@lru_cache(maxsize=8)
def _holds_the_plane(boundaries: tuple[Boundary, ...], nodes: int, dofs: int) -> bool:
    return holds_the_plane(restraint_codes(boundaries, nodes, dofs))


def _free_in_plane(deck: Deck) -> Deck:
    """Restrain u and v only where w is, if the deck restrains them at every node."""
    boundaries = tuple(deck.all(Boundary))
    if not _holds_the_plane(boundaries, deck.control.numnp, deck.control.ndf):
        return deck

    # Codes are generated for each dof independently, so that copies of the codes of w act like w's.
    def freed(record: NodeCodes) -> NodeCodes:
        w = record.codes[2]
        return replace(record, codes=(w, w, *record.codes[2:]), source=None)

    segments = tuple(
        replace(s, records=tuple(map(freed, s.records)), source=None)
        if isinstance(s, Boundary)
        else s
        for s in deck.segments
    )
    return replace(deck, segments=segments)


def _swap(deck: Deck, old: Segment | None, new: Segment) -> Deck:
    """Replace a segment, or add one."""
    if old is None:
        return replace(deck, segments=(*deck.segments, new))
    segments = tuple(new if segment is old else segment for segment in deck.segments)
    return replace(deck, segments=segments)


# Segment and field of the values that are fields of a segment.
_FIELDS: dict[str, tuple[type[Impact | Indentation], str]] = {
    "velocity": (Impact, "velocity"),
    "impact_node": (Impact, "node"),
    **{name: (Indentation, name) for name in ("k", "alpha_p", "s_p", "q")},
}


# Fields of the contact patch.
_PATCH = {"patch": "radius", "x0": "x", "y0": "y"}


def _field(deck: Deck, name: str, value: Value) -> Deck:
    kind, field = _FIELDS[name]
    old = deck.require(kind)
    changed: dict[str, Any] = {field: value, "source": None}
    return _swap(deck, old, replace(old, **changed))


def _rod(deck: Deck, name: str, value: Value) -> Deck:
    """Change the projectile; add the segment if the deck has none."""
    rod, old = build_projectile(deck), deck.last(Projectile)
    number = float(value)
    if isinstance(rod, RigidMass):
        if name != "rod_mass":
            raise CasesError(f"{name}: the projectile of the deck is a rigid mass")
        new = projectile_segment(RigidMass(number))
    else:
        new = projectile_segment(rod, 0 if old is None else old.transducer)
        if name == "rod_length":
            new = replace(new, size=number)
        elif name == "rod_modulus":
            new = replace(new, modulus=number)
        elif name == "rod_density":
            new = replace(new, density=number)
        else:
            new = replace(new, density=rod.density * number / rod.total_mass)
    return _swap(deck, old, new)


def _patch(deck: Deck, name: str, value: Value) -> Deck:
    """Change the contact patch; add the segment if the deck has none."""
    old = deck.last(Patch)
    field: dict[str, Any] = {_PATCH[name]: float(value), "source": None}
    return _swap(deck, old, replace(old or Patch(), **field))


def _ply(deck: Deck, name: str, value: Value) -> Deck:
    old = deck.require(Material)
    ply: Ply = replace(old.ply, **{name: float(value)}, source=None)
    return _swap(deck, old, replace(old, ply=ply))


def _thickness(deck: Deck, name: str, value: Value) -> Deck:
    old = deck.require(Material)
    total = float(value)
    factor = total / sum(layer.thickness for layer in old.layers)
    layers = tuple(
        replace(layer, thickness=layer.thickness * factor, source=None) for layer in old.layers
    )
    integration = replace(old.integration, thickness=total, source=None)
    return _swap(deck, old, replace(old, integration=integration, layers=layers))


def _layup(deck: Deck, name: str, value: Value) -> Deck:
    old = deck.require(Material)
    thicknesses = {layer.thickness for layer in old.layers}
    if len(thicknesses) > 1:
        raise CasesError("layup: the plies of the deck differ in thickness")
    (ply,) = thicknesses
    try:
        angles = parse_layup(str(value))
    except LayupError as error:
        raise CasesError(f"layup: {error}") from None
    layers = tuple(Layer(n, angle, ply) for n, angle in enumerate(angles, start=1))
    integration = replace(old.integration, thickness=len(angles) * ply, source=None)
    control = replace(deck.control, layers=len(layers), source=None)
    made = _swap(deck, old, replace(old, integration=integration, layers=layers))
    return replace(made, control=control)


@lru_cache(maxsize=8)
def _taken_time_step(deck: Deck) -> float:
    """Time step that DT 0 means in a deck; 0 if no DT is 0."""
    if all(macro.value for macro in deck.macros if macro.word == "DT"):
        return 0.0
    checked = check(ParsedProblem(deck), Findings())
    return 0.0 if checked is None else taken_time_step(checked.critical_time_step)


_SETTERS: dict[str, Callable[[Deck, str, Value], Deck]] = {
    **dict.fromkeys(_FIELDS, _field),
    **dict.fromkeys(("rod_length", "rod_modulus", "rod_density", "rod_mass"), _rod),
    **dict.fromkeys(_PATCH, _patch),
    **dict.fromkeys(PLY, _ply),
    "thickness": _thickness,
    "layup": _layup,
}
