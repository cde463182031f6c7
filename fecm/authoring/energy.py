"""The energy of a new deck's projectile."""

from __future__ import annotations

import math
from dataclasses import replace

from fecm.authoring.fixtures import Fixture
from fecm.authoring.laminate import Plies
from fecm.authoring.parameters import ObjectError
from fecm.deck import model
from fecm.deck.unit_systems import units_of
from fecm.deck.units import in_si, unit_of
from fecm.problem.parts import build_projectile


def _energy_of(deck: model.Deck) -> float:
    """Kinetic energy of the projectile."""
    velocity, mass = deck.require(model.Impact).velocity, build_projectile(deck).total_mass
    return 0.5 * mass * velocity**2


def said_energy(deck: model.Deck, plies: Plies) -> str:
    """Kinetic energy of the projectile, in joule where the units are known."""
    energy = _energy_of(deck)
    joule = in_si("force*length", units_of(plies.system) if plies.system else {})
    return f"{energy * joule:.4g} J" if joule else f"{energy:.4g}"


def energy_note(deck: model.Deck, plies: Plies, *, per_thickness: bool) -> str:
    """Say energy and velocity of the projectile."""
    energy, velocity = _energy_of(deck), deck.require(model.Impact).velocity
    names = units_of(plies.system) if plies.system else {}
    said = said_energy(deck, plies)
    if per_thickness:
        share = energy / plies.thickness
        said += f" ({share / 1e3:.3g} J per mm of thickness)"
    speed = f"{velocity:.4g} {unit_of('length/time', names)}".rstrip()
    return f"energy {said}, {speed}"


def doubts_of_energy(deck: model.Deck, fixture: Fixture | None, plies: Plies) -> list[str]:
    """Doubt an energy that is far below a standard's."""
    if fixture is None or fixture.test is None:
        return []
    energy = _energy_of(deck)
    share = energy / plies.thickness
    if share >= fixture.test.least_energy:
        return []
    return [
        f"the energy is {energy / 1e3:.3g} J, {share / 1e3:.2g} J per mm of thickness, "
        f"where {fixture.name} has {fixture.test.energy / 1e3:g}: `energy` is in mJ unless it has "
        'a unit, as in "10J"'
    ]


def with_energy(deck: model.Deck, energy: float) -> model.Deck:
    """The deck with a velocity for an energy, in as many digits as its card has."""
    mass = build_projectile(deck).total_mass
    velocity = math.sqrt(2.0 * energy / mass) if mass > 0.0 else math.inf
    if not 0.0 < velocity < math.inf:
        raise ObjectError(f"no velocity gives the energy {energy:g} to the mass {mass:g}")
    old = deck.require(model.Impact)
    new = replace(old, velocity=float(f"{velocity:.6g}"))
    return replace(deck, segments=tuple(new if s is old else s for s in deck.segments))
