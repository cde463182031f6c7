"""Parts of a run that follow from its deck, with the parameters of its variant."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from fecm._typing import Indices
from fecm.deck import model
from fecm.deck.material_cards import MATERIAL
from fecm.deck.model import Deck, PointMasses, RodDiameter
from fecm.listing.law import ListingLaw
from fecm.listing.variant import REPORT_IMPACT, REPORT_PLATE, ImpactVariant, PlateVariant
from fecm.mechanics import contact_law
from fecm.mechanics.contact_law import Number
from fecm.mechanics.element_matrices import IntegrationRules
from fecm.mechanics.elements import HIGHEST_ORDER, Quadrature, gauss, nodal
from fecm.mechanics.failure import Strengths
from fecm.mechanics.laminate import LaminateSection, laminate
from fecm.mechanics.mesh import Ints, MeshArrays
from fecm.mechanics.plate import UNLOADED, PlateModel
from fecm.mechanics.ply_stresses import equilibrium_shear_stiffness, residual_stresses
from fecm.mechanics.projectile import (
    DeckProjectile,
    Projectile,
    RigidMass,
    Rod,
    Transducer,
    report_rod,
)
from fecm.mechanics.strains import FLAT
from fecm.problem.generate import rod_diameters
from fecm.problem.supports import node_supports, point_masses

if TYPE_CHECKING:
    from fecm.mechanics.ply_stresses import Residual

# Dofs, from 0.
THETA_X = 3


def rules(material: model.Material) -> tuple[Quadrature, Quadrature, Quadrature]:
    """Return the quadrature of a MATE card.

    These are the rules of bending (L1), transverse shear (L2) and stored strains (K). L1 and L2
    outside 1 to 4 count as the nearest of these, as in the listing. Raises ValueError if K is 0 or
    beyond 4.
    """
    card = material.integration
    bending, shear = (min(HIGHEST_ORDER, max(1, n)) for n in (card.bending, card.shear))
    points = gauss(card.points) if card.points > 0 else nodal(-card.points)
    return gauss(bending), gauss(shear), points


def build_plate(deck: Deck, mesh: MeshArrays, variant: PlateVariant = REPORT_PLATE) -> PlateModel:
    """Build the plate of a deck."""
    bending, shear, points = rules(deck.require(model.Material))
    first, *other_laminates = laminates_of_deck(deck, variant)
    used = IntegrationRules(
        bending=bending, shear=shear, strains=points, assumes_shear=has_assumed_shear(deck)
    )
    preload, curved = deck.last(model.Preload), deck.last(model.Curvature)
    plate = PlateModel(
        mesh,
        variant.laminate(first),
        variant.rules(used),
        preload=UNLOADED if preload is None else preload.forces,
        nonlinear=deck.has(model.Nonlinear),
        others=tuple(other_laminates),
        laminate_numbers=laminate_numbers(deck) if other_laminates else None,
        curvature=FLAT if curved is None else curved.curvatures,
        added_mass=point_masses(deck, len(mesh.coordinates)) if deck.has(PointMasses) else None,
    )
    supports = node_supports(deck, plate)
    return plate if supports is None else replace(plate, supports=supports)


def build_projectile(deck: Deck, variant: ImpactVariant = REPORT_IMPACT) -> DeckProjectile:
    """Build the projectile of a deck; without a PROJ segment, the report's rod."""
    if (card := deck.last(model.Projectile)) is None:
        return report_rod(variant.rod_density)
    if not card.elements:
        return RigidMass(card.size)
    return Rod(card.size, tuple(rod_diameters(card).tolist()), card.modulus, card.density)


def projectile_segment(projectile: DeckProjectile, transducer: int = 0) -> model.Projectile:
    """Return the PROJ segment of a projectile."""
    match projectile:
        case RigidMass(mass):
            return model.Projectile(0, 0, mass)
        case Rod(length, diameters, modulus, density):
            cards = [RodDiameter(n, 0, diameter) for n, diameter in enumerate(diameters, start=1)]
            if len(set(diameters)) == 1 < len(cards):  # those between two cards are generated
                cards = [replace(cards[0], increment=1), cards[-1]]
            elements = len(diameters)
            return model.Projectile(elements, transducer, length, modulus, density, tuple(cards))


def rod_of_deck(deck: Deck) -> Rod | None:
    """Return the rod of a deck; None if its projectile is of another kind."""
    projectile = build_projectile(deck)
    return projectile if isinstance(projectile, Rod) else None


def build_constants(measured: model.Indentation) -> contact_law.ContactParameters:
    """Build the contact parameters of an EXPE segment."""
    return constants_of(measured.word, *measured.values())


def constants_of(
    word: str, k: Number, alpha_p: Number, s_p: Number, q: Number
) -> contact_law.ContactParameters[Number]:
    """Build contact parameters from the second word and the values of an EXPE card."""
    if word == model.Indentation.ACR:
        return contact_law.YangSunPermanent(k, alpha_p)
    return contact_law.LinearPermanent(k, alpha_p, s_p, q)


def build_station(
    deck: Deck,
    projectile: Projectile,
    variant: ImpactVariant = REPORT_IMPACT,
    *,
    is_own: bool = False,
) -> Transducer:
    """Build the transducer: PROJ's node, or the rod's middle.

    A user's projectile does not have PROJ's node.
    """
    if not projectile.elements:
        return Transducer(0, variant.station_sign)
    card = None if is_own else deck.last(model.Projectile)
    middle = projectile.elements // 2 + 1 + variant.station_after_middle
    node = middle if card is None or not card.transducer else card.transducer
    return Transducer(node, variant.station_sign)


def build_law(
    deck: Deck, variant: ImpactVariant = REPORT_IMPACT
) -> contact_law.HystereticLaw | ListingLaw:
    """Build the contact law of a deck."""
    return variant.law(build_constants(deck.require(model.Indentation)))


def laminate_numbers(deck: Deck) -> Indices:
    """Return the number from 0 of the laminate of every element, (numel,), in the order of LAMS."""
    order = {number: n for n, number in enumerate(deck.layers)}
    numbers = np.zeros(deck.control.numel, dtype=np.intp)
    for zone in deck.require(model.Zones).records:
        numbers[np.array(zone.elements) - 1] = order[zone.laminate]
    return numbers


def _laminate_of(
    layers: Sequence[model.Layer],
    plies: Mapping[int, model.Ply],
    thickness: float | None,
) -> LaminateSection:
    chosen = [plies[layer.material] for layer in layers]
    angles = [layer.angle for layer in layers]
    thicknesses = [layer.thickness for layer in layers]
    return laminate(chosen, angles, thicknesses, thickness)


def laminates_of_deck(deck: Deck, variant: PlateVariant = REPORT_PLATE) -> list[LaminateSection]:
    """Return the laminates of a deck with its shear correction factor, MATE's first.

    Raises LookupError without a MATE segment.
    """
    shear = deck.last(model.Shear) or model.Shear()
    material = deck.require(model.Material)
    plies = {number: variant.ply(ply) for number, ply in deck.plies.items()}
    sections: list[LaminateSection] = []
    for number, layers in deck.layers.items():
        total = material.integration.thickness if number == MATERIAL else None
        plain = _laminate_of(layers, plies, total)
        stiffness = equilibrium_shear_stiffness(plain) if shear.equilibrium else plain.shear
        sections.append(replace(plain, shear=shear.factor * stiffness))
    return sections


def residuals_of_deck(
    deck: Deck, laminates: Sequence[LaminateSection]
) -> tuple[Residual, ...] | None:
    """Return the residual stresses of the plies of each laminate; None without CURE."""
    if (cure := deck.last(model.Cure)) is None:
        return None
    residuals: list[Residual] = []
    for layers, section in zip(deck.layers.values(), laminates, strict=True):
        free = np.array([cure.strains(layer.material) for layer in layers])
        residuals.append(residual_stresses(section, *free.T))
    return tuple(residuals)


def strengths_of_deck(deck: Deck) -> list[list[Strengths | None]]:
    """Return the strengths of the plies of each laminate; None where ALLO lacks them."""
    first = deck.require(model.Allowables)
    strengths = {
        number: ply_strengths(card, ply)
        for number, ply in deck.plies.items()
        if (card := first.of(number)) is not None
    }
    return [[strengths.get(layer.material) for layer in layers] for layers in deck.layers.values()]


def ply_strengths(card: model.Allowables, ply: model.Ply) -> Strengths:
    """Return the strengths of a material on its card of ALLO, with the moduli of its ply."""
    return Strengths(
        xt=card.xt,
        xc=card.xc,
        yt=card.yt,
        yc=card.yc,
        s12=card.s12,
        s13=card.s13,
        s23=card.s23,
        f12=card.f12,
        p_plus=card.p_plus,
        p_minus=card.p_minus,
        e1=ply.e1,
        e2=ply.e2,
        nu12=ply.nu12,
        g12=ply.g12,
    )


def materials_of_deck(deck: Deck) -> Ints | None:
    """Return the material numbers of the plies of each laminate, (laminates, plies).

    Missing plies have 0. Returns None if the deck has one material.
    """
    layups = list(deck.layers.values())
    if not deck.has(model.Materials):
        return None
    numbers = np.zeros((len(layups), max(map(len, layups))), dtype=np.int32)
    for row, layers in zip(numbers, layups, strict=True):
        row[: len(layers)] = [layer.material for layer in layers]
    return numbers


def has_assumed_shear(deck: Deck) -> bool:
    """Return whether the transverse shear strains of a deck are assumed (``SHEA MITC``)."""
    return (deck.last(model.Shear) or model.Shear()).assumed


def is_coupled(deck: Deck) -> bool:
    """Return whether B of one of a deck's laminates is not 0; False for invalid segments."""
    material = deck.last(model.Material)
    if material is None:
        return False
    return _are_coupled(material, deck.last(model.Materials), deck.last(model.Laminates))


def is_curved(deck: Deck) -> bool:
    """Return whether a deck has a curved panel (``CURV``)."""
    card = deck.last(model.Curvature)
    return card is not None and any(card.curvatures)


def moves_in_plane(deck: Deck) -> bool:
    """Return whether u and v of a deck's plate are not zero: coupled, curved or nonlinear."""
    return deck.has(model.Nonlinear) or is_curved(deck) or is_coupled(deck)


@lru_cache(maxsize=256)
def _are_coupled(
    material: model.Material, materials: model.Materials | None, laminates: model.Laminates | None
) -> bool:
    """Return whether B of one of the laminates is not 0."""
    plies = {MATERIAL: material.ply} | {
        item.number: item.ply for item in (materials.plies if materials else ())
    }
    layers = [
        material.layers,
        *(item.layers for item in (laminates.laminates if laminates else ())),
    ]
    try:
        with np.errstate(all="ignore"):
            return any(
                _laminate_of(laminate_layers, plies, None).is_coupled for laminate_layers in layers
            )
    except (ArithmeticError, LookupError, ValueError):
        return False
