"""Energy of the projectile of a new deck."""

from __future__ import annotations

import math
from dataclasses import replace

from fecm.authoring.laminate import DeckPlies
from fecm.authoring.parameters import ObjectError
from fecm.authoring.plate import Fixture
from fecm.deck import model
from fecm.deck.units import in_si, unit_of, units_of
from fecm.problem.parts import build_projectile

# Smallest plausible energy per thickness, J/mm, of an energy without a unit.
LEAST_ENERGY = 0.02
ENERGY_UNITS = {1.0: "J", 1e-3: "mJ"}


def energy_of(deck: model.Deck) -> float:
    """Return the kinetic energy of the projectile."""
    velocity, mass = deck.require(model.Impact).velocity, build_projectile(deck).total_mass
    return 0.5 * mass * velocity**2


def format_energy(deck: model.Deck, plies: DeckPlies) -> str:
    """Format the kinetic energy of the projectile, in joule if the units are known."""
    energy = energy_of(deck)
    joule = in_si("force*length", units_of(plies.system) if plies.system else {})
    return f"{energy * joule:.4g} J" if joule else f"{energy:.4g}"


def energy_note(deck: model.Deck, plies: DeckPlies, *, per_thickness: bool) -> str:
    """Return a note with the energy and the velocity of the projectile."""
    energy, velocity = energy_of(deck), deck.require(model.Impact).velocity
    names = units_of(plies.system) if plies.system else {}
    text = format_energy(deck, plies)
    if per_thickness:
        share = energy / plies.thickness
        text += f" ({share / 1e3:.3g} J per mm of thickness)"
    speed = f"{velocity:.4g} {unit_of('length/time', names)}".rstrip()
    return f"energy {text}, {speed}"


def doubts_of_energy(
    deck: model.Deck, fixture: Fixture | None, plies: DeckPlies, *, is_bare: bool
) -> list[str]:
    """Return a doubt about an energy that is far too small.

    The limit is the least energy of a standard. Without a standard, only an energy that was given
    without a unit, `is_bare`, is doubted.
    """
    standard = fixture.test if fixture else None
    names = units_of(plies.system) if plies.system else {}
    joule, length = in_si("force*length", names), in_si("length", names)
    if joule is None or length is None or not (standard or is_bare):
        return []
    energy = energy_of(deck) * joule
    share = energy / (plies.thickness * length * 1e3)  # J/mm
    least = 1e-3 * standard.least_energy if standard else LEAST_ENERGY
    if share >= least:
        return []
    usual = (
        f"where {fixture.name} has {standard.energy / 1e3:g}"
        if fixture and standard
        else "where drop-weight tests have 1 to 10"
    )
    unit = ENERGY_UNITS.get(joule, unit_of("force*length", names))
    return [
        f"the energy is {energy:.3g} J, {share:.2g} J per mm of thickness, {usual}: `energy` is in "
        f'{unit} unless it has a unit, as in "10J"'
    ]


def with_energy(deck: model.Deck, energy: float) -> model.Deck:
    """Return the deck with the velocity of an energy, rounded to the digits of a card."""
    mass = build_projectile(deck).total_mass
    velocity = math.sqrt(2.0 * energy / mass) if mass > 0.0 else math.inf
    if not 0.0 < velocity < math.inf:
        raise ObjectError(f"no velocity gives the energy {energy:g} to the mass {mass:g}")
    impact = deck.require(model.Impact)
    changed = replace(impact, velocity=float(f"{velocity:.6g}"))
    return replace(deck, segments=tuple(changed if s is impact else s for s in deck.segments))
