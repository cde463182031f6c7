"""Changes of a deck in Python: values, named as in sweeps, and parts as objects."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import replace
from typing import Any, NamedTuple, TypedDict

from fecm._errors import warn
from fecm.authoring.case import Case, CasesError, check_deck
from fecm.authoring.contact import AnyContact, Sphere, doubts_of_core, indentation_law
from fecm.authoring.deck_options import AnyProjectile
from fecm.authoring.laminate import (
    Bound,
    DeckPlies,
    Laminate,
    cure_segment,
    deck_plies,
    strengths_of,
    toughness_of,
)
from fecm.authoring.mesh import MembraneSupport, place_impact, support_plate
from fecm.authoring.parameters import (
    ObjectError,
    check_kind,
    parameter_in_units,
    projectile_in_units,
)
from fecm.authoring.plate import Plate, Support
from fecm.authoring.plate_values import swapped
from fecm.authoring.strike_values import strike_of, struck_layers
from fecm.authoring.time_values import clock_of, with_clock
from fecm.authoring.values import NAMES, apply_case, check_known, dimension_of, value_of
from fecm.deck import model
from fecm.deck.catalogue import STANDARD, named_ply, system_of
from fecm.deck.material_cards import MATERIAL
from fecm.deck.model import Deck, Nonlinear
from fecm.deck.quantities import EXAMPLES, text_of
from fecm.problem.parts import is_coupled, is_curved

Number = float | str  # a number, or its text
NONLINEAR = "nonlinear"


class Parts(NamedTuple):
    """New parts of a deck. None keeps a part of the deck."""

    plate: Plate | None = None
    laminate: Laminate | None = None
    projectile: AnyProjectile | None = None
    contact: AnyContact | None = None

    def check(self) -> None:
        """Raise ObjectError if a part is not an object of fecm."""
        check_kind("plate", self.plate, Plate | None)
        check_kind("laminate", self.laminate, Laminate | None)
        check_kind("projectile", text_of(self.projectile), AnyProjectile | None)
        check_kind("contact", self.contact, AnyContact | None)

    def with_plate(self, deck: model.Deck, at: tuple[float, float] | None) -> model.Deck:
        """Return the deck with the new laminate and plate; the projectile hits a point."""
        if self.laminate is not None:
            deck = with_laminate(deck, self.laminate)
        return deck if self.plate is None else with_plate(deck, self.plate, at)

    def with_strike(self, deck: model.Deck) -> model.Deck:
        """Return the deck with the new projectile and contact."""
        if self.projectile is not None:
            deck = with_projectile(deck, self.projectile)
        return deck if self.contact is None else with_contact(deck, self.contact)


class Values(TypedDict, total=False):
    """Arguments of :meth:`fecm.Deck.with_`: parts as objects, and values named as in sweeps."""

    plate: Plate
    laminate: Laminate
    projectile: AnyProjectile
    contact: AnyContact
    nonlinear: bool
    velocity: Number
    energy: Number
    k: Number
    radius: Number
    alpha_p: Number
    s_p: Number
    q: Number
    mass: Number
    rod_mass: Number
    rod_length: Number
    rod_modulus: Number
    rod_density: Number
    at: str | Iterable[float | str]
    impact_node: int | str
    patch: Number
    x0: Number
    y0: Number
    laminate_thickness: Number
    ply_thickness: Number
    thickness: Number
    density: Number
    nu12: Number
    e1: Number
    e2: Number
    g12: Number
    g13: Number
    g23: Number
    layup: str | Iterable[float]
    layer_materials: str | Iterable[int]
    angle: Number
    preload_x: Number
    preload_y: Number
    preload_xy: Number
    radius_x: Number
    radius_y: Number
    giic: Number
    xt: Number
    xc: Number
    yt: Number
    yc: Number
    s12: Number
    s13: Number
    s23: Number
    cure_dT: Number
    size: str | Iterable[float | str]
    support: Support
    edge_kr: Number
    edge_kw: Number
    clamp_k: Number
    window_k: Number
    gap: Number
    dt: Number
    duration: Number


def with_values(deck: Deck, values: Mapping[str, Any]) -> Deck:
    """Return a deck with other values and parts; see :meth:`fecm.Deck.with_`.

    Raises CasesError if a name is unknown or a value is invalid, and ObjectError if an object is.
    """
    for name in values:
        check_known(name, "with_", (*Parts._fields, NONLINEAR, *NAMES))
    if NONLINEAR in values:
        deck = _with_kinematics(deck, nonlinear=values[NONLINEAR])
    parts = {name: value for name, value in values.items() if name in Parts._fields}
    not_values = (*Parts._fields, NONLINEAR)
    numbers = _in_deck_units(deck, {n: value for n, value in values.items() if n not in not_values})
    system = system_of(deck)
    case = {name: value_of(name, value, "with_", system) for name, value in numbers.items()}
    new_parts = Parts(**parts)
    new_parts.check()
    try:
        changed = apply_case(deck, case, new_parts)
    except LookupError as error:  # the deck lacks the segment of a value
        raise CasesError(f"with_: {error}") from None
    is_new = "plate" in parts or "laminate" in parts
    return _update_time_step(deck, changed, case) if is_new and "dt" not in case else changed


def _in_deck_units(deck: Deck, values: Mapping[str, Any]) -> dict[str, Any]:
    """Convert texts with a unit, as in ``10J``, to the units of the deck."""
    system = system_of(deck)
    return {
        name: parameter_in_units(name, value, dimension_of(name), system)
        if system and dimension_of(name) in EXAMPLES and _is_single(value)
        else value
        for name, value in values.items()
    }


def _is_single(value: object) -> bool:
    """Return whether a value is a number or a text with one; "auto" and several values are not."""
    text = text_of(value)
    return text != "auto" if isinstance(text, str) else not isinstance(text, Iterable)


def _with_kinematics(deck: Deck, *, nonlinear: object) -> Deck:
    """Return the deck without NONL if `nonlinear` is False; it must have NONL if True."""
    if not isinstance(nonlinear, bool):
        raise CasesError(f"with_: nonlinear is {nonlinear!r}, not True or False")
    if nonlinear and not deck.has(Nonlinear):
        raise CasesError(
            "with_: the deck has no NONL, and its supports may not suit it; make the nonlinear "
            'deck with fecm.impact(kinematics="von-karman"), and take NONL out with nonlinear=False'
        )
    if nonlinear:
        return deck
    kept = tuple(segment for segment in deck.segments if not isinstance(segment, Nonlinear))
    return replace(deck, segments=kept, text="")


def _update_time_step(deck: Deck, changed: Deck, case: Case) -> Deck:
    """Give the changed deck the time step of its plate, if the old time step follows a rule."""
    with suppress(CasesError):  # a run of either deck reports its errors
        if (clock := clock_of(check_deck(deck))) is not None:
            return with_clock(changed, clock, case).deck
    return changed


# Parts --------------------------------------------------------------------------------------------

# Segments of a mesh and its supports.
OF_MESH: tuple[type[model.Segment], ...] = (
    model.Coordinates,
    model.Elements,
    model.Boundary,
    model.Springs,
    model.OneSidedSupports,
    model.PointMasses,
)


def with_projectile(deck: model.Deck, projectile: AnyProjectile) -> model.Deck:
    """Return the deck with another projectile; a rod keeps the node of the transducer."""
    if isinstance(projectile, model.Projectile):
        return swapped(deck, deck.last(model.Projectile), projectile)
    rigid_or_rod = projectile_in_units(projectile, system_of(deck))
    return strike_of(deck).with_projectile(rigid_or_rod).deck()


def with_contact(deck: model.Deck, contact: AnyContact) -> model.Deck:
    """Return the deck with another contact law, or with an estimate for its laminate."""
    plies = plies_of_deck(deck)
    elastic = isinstance(contact, Sphere) and contact.modulus is not None
    if plies.system is None and not elastic and not isinstance(contact, model.Indentation):
        raise ObjectError("`contact` needs the units of the deck: give it a UNIT segment")
    struck = struck_layers(deck)
    law, comment = indentation_law(contact, plies, struck)
    for doubt in doubts_of_core(plies, struck) if comment else []:
        warn(doubt)
    return swapped(deck, deck.last(model.Indentation), law)


def with_laminate(deck: model.Deck, laminate: Laminate) -> model.Deck:
    """Return the deck with another laminate; strengths of the new plies replace existing ones."""
    _refuse_segments(deck, "laminate", model.Laminates, model.Zones)
    system = system_of(deck)
    plies, _ = deck_plies(laminate, (), system, [])
    if system is None and plies.named:
        raise ObjectError("`laminate` has a named ply: the deck needs a UNIT segment to convert it")
    material, *further = plies.segments()
    assert isinstance(material, model.Material)
    replaced = deck.require(model.Material)
    integration = replace(replaced.integration, thickness=plies.thickness, source=None)
    changed = swapped(deck, replaced, replace(material, integration=integration))
    kept = [segment for segment in changed.segments if not isinstance(segment, model.Materials)]
    control = replace(deck.control, layers=len(material.layers), source=None)
    changed = replace(changed, control=control, segments=(*kept, *further))
    constants = dict(enumerate((bound.ply for bound in plies.materials), start=MATERIAL))
    return changed if constants == deck.plies else _with_properties(changed, plies)


def _with_properties(deck: model.Deck, plies: DeckPlies) -> model.Deck:
    """Replace the strengths, toughness and expansions of a deck by the values of new plies."""
    segments: list[model.Segment] = []
    try:
        for segment in deck.segments:
            match segment:
                case model.Allowables():
                    segments.append(strengths_of(plies))
                case model.Delamination():
                    segments.append(replace(segment, toughness=toughness_of(plies), source=None))
                case model.Cure(delta_t=change) if segment.delta_c == 0.0:
                    segments.append(cure_segment(plies, change) or segment)
                case model.Cure():
                    raise ObjectError("a named ply has no expansion by moisture")
                case _:
                    segments.append(segment)
    except ObjectError as error:
        raise ObjectError(
            "`laminate` has other plies; the deck needs their strengths, toughness or "
            f"expansions in place of its own: {error}"
        ) from None
    return replace(deck, segments=tuple(segments))


def with_plate(deck: model.Deck, plate: Plate, at: tuple[float, float] | None) -> model.Deck:
    """Return the deck with another mesh and its supports.

    The projectile hits the point `at`, by default the middle of the plate.
    """
    _refuse_segments(deck, "plate", model.Forces, model.Zones)
    test = plate.fixture.test if plate.fixture else None
    if test is not None and system_of(deck) != STANDARD:
        raise ObjectError(f"`plate`: the fixture's standard is in {STANDARD}, and the deck is not")
    old_patch, doubts = deck.last(model.Patch), list[str]()
    patch = None if old_patch is None else replace(old_patch, x=None, y=None, source=None)
    mesh, node, patch, point = place_impact(plate, plies_of_deck(deck), at, patch, doubts)
    stretches = deck.has(model.Nonlinear) or is_coupled(deck)
    membrane = MembraneSupport.of(curved=is_curved(deck), stretches=stretches)
    supports, _ = support_plate(plate, mesh, None, [], membrane, system_of(deck))
    for doubt in doubts:
        warn(doubt)
    control = replace(
        deck.control,
        numnp=mesh.nodes,
        numel=mesh.elements,
        nen=mesh.most_nodes,
        source=None,
    )
    kept = tuple(segment for segment in deck.segments if not isinstance(segment, OF_MESH))
    changed = replace(
        deck,
        control=control,
        segments=(mesh.coordinates(), mesh.element_cards(), *supports, *kept),
    )
    strike = deck.last(model.Impact)
    if old_patch is not None and patch is not None:
        if strike is None:
            patch = patch.centred(point)
        changed = swapped(changed, old_patch, patch)
    if strike is not None:
        changed = swapped(changed, strike, replace(strike, node=node, source=None))
    return changed


def _refuse_segments(deck: model.Deck, name: str, *kinds: type[model.Segment]) -> None:
    """Raise ObjectError if the deck has segments that refer to the part to be replaced."""
    if keywords := [kind.keyword for kind in kinds if deck.has(kind)]:
        raise ObjectError(
            f"`{name}` can't be replaced in a deck with {' and '.join(keywords)}, which would then "
            "not fit"
        )


def plies_of_deck(deck: model.Deck) -> DeckPlies:
    """Return the laminates and materials of a deck, with the names of named plies."""
    system, plies = system_of(deck), deck.plies
    first = plies[MATERIAL]
    numbers = range(MATERIAL, max(plies) + 1)
    materials = [plies.get(number, first) for number in numbers]
    bound = tuple(Bound(ply, named_ply(ply, system)) for ply in materials)
    return DeckPlies(tuple(deck.layers.values()), bound, system)
