"""Values that change the strike of a deck: ROD, EXPE, PROJ and DELA.

DELA has the threshold that the force may reach. Such values need no new deck. The cases
of one plate differ in their strikes only.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from typing import Any, NamedTuple, TypeVar

from fecm.authoring.case import NO_THRESHOLD, CasesError, Value, raise_first
from fecm.authoring.plate_values import swapped
from fecm.deck import model
from fecm.deck.catalogue import STANDARD, STEEL_MODULUS, STEEL_POISSON, nu23_of, system_of
from fecm.deck.findings import Findings
from fecm.deck.macros import compile_program
from fecm.deck.units import MODULUS, in_si, unit_names, units_of
from fecm.mechanics.contact_law import ContactParameters, hertz_coefficient
from fecm.mechanics.half_space import effective_stiffness, indentation_modulus
from fecm.mechanics.projectile import DeckProjectile
from fecm.problem.check import check_impact, check_segment
from fecm.problem.generate import generate
from fecm.problem.parts import build_constants, build_projectile, projectile_segment
from fecm.problem.problem import Problem
from fecm.problem.symmetry import symmetry_factor

_S = TypeVar("_S", bound=model.Segment)


class Strike(NamedTuple):
    """Velocity, contact law, projectile and toughness of a case."""

    plate: model.Deck  # deck of the plate; its strike may be another one
    impact: model.Impact | None
    indentation: model.Indentation | None
    card: model.Projectile | None  # None for the rod of the report
    projectile: DeckProjectile
    delamination: model.Delamination | None = None

    @property
    def velocity(self) -> float:
        """Approach velocity, length/time."""
        return _required(self.impact, model.Impact).velocity

    @property
    def law(self) -> ContactParameters:
        """Constants of the contact law."""
        return build_constants(_required(self.indentation, model.Indentation))

    @property
    def energy(self) -> float:
        """Kinetic energy of the deck's projectile before the impact, force*length."""
        return 0.5 * self.projectile.total_mass * self.velocity**2

    def with_velocity(self, velocity: float) -> Strike:
        """Return the strike with another velocity."""
        impact = _required(self.impact, model.Impact)
        return self._replace(impact=replace(impact, velocity=velocity, source=None))

    def with_constant(self, name: str, value: float) -> Strike:
        """Return the strike with another constant of EXPE."""
        indentation = _required(self.indentation, model.Indentation)
        fields: dict[str, Any] = {name: value}  # mypy compares each with every field
        return self._replace(indentation=replace(indentation, **fields, source=None))

    def with_projectile(self, projectile: DeckProjectile) -> Strike:
        """Return the strike with another projectile; a rod keeps the transducer of the deck."""
        transducer = self.card.transducer if self.card is not None and projectile.elements else 0
        card = projectile_segment(projectile, transducer)
        return self._replace(card=card, projectile=projectile)

    def deck(self) -> model.Deck:
        """Return the deck of the plate with this strike."""
        deck = self.plate
        for kind, segment in (
            (model.Impact, self.impact),
            (model.Indentation, self.indentation),
            (model.Projectile, self.card),
            (model.Delamination, self.delamination),
        ):
            current = deck.last(kind)
            if segment is not None and segment is not current:
                deck = swapped(deck, current, segment)
        return replace(deck, text="")  # the text has the cards before the changes

    def check(self, plate: Problem) -> None:
        """Raise CasesError with the first error of this strike on a plate."""
        findings = Findings()
        if self.impact is not None:
            deck = swapped(plate.deck, plate.deck.last(model.Impact), self.impact)
            check_impact(Problem(deck, plate.mesh, plate.program), findings)
        for segment in (self.indentation, self.card, self.delamination):
            if segment is not None:
                check_segment(segment, findings)
        raise_first(findings)


StrikeSetter = Callable[[Strike, Value], Strike]


def strike_of(deck: model.Deck) -> Strike:
    """Return the strike of a deck."""
    return Strike(
        plate=deck,
        impact=deck.last(model.Impact),
        indentation=deck.last(model.Indentation),
        card=deck.last(model.Projectile),
        projectile=build_projectile(deck),
        delamination=deck.last(model.Delamination),
    )


def _required(segment: _S | None, kind: type[_S]) -> _S:
    if segment is None:
        raise LookupError(f"the deck has no {kind.keyword} segment")
    return segment


# Setters ------------------------------------------------------------------------------------------


def set_velocity(strike: Strike, value: Value) -> Strike:
    """Change the velocity of ROD."""
    return strike.with_velocity(float(value))


def set_energy(strike: Strike, value: Value) -> Strike:
    """Change the velocity of ROD so that the projectile has an energy.

    The deck of a symmetric part has its part of the energy.
    """
    mass, energy = strike.projectile.total_mass, float(value)
    if not (mass > 0.0 and energy >= 0.0):
        raise CasesError(f"no velocity gives the energy {energy:g} to the mass {mass:g}")
    factor = symmetry_factor(strike.plate)
    return strike.with_velocity(math.sqrt(2.0 * energy / factor / mass))


def constant(name: str) -> StrikeSetter:
    """Return the setter of a constant of EXPE."""
    return lambda strike, value: strike.with_constant(name, float(value))


def set_radius(strike: Strike, value: Value) -> Strike:
    """Change k to the estimate for a steel sphere on the laminate of the deck.

    The deck of a symmetric part has its part of k.
    """
    unit = in_si(MODULUS, unit_names(strike.plate))
    if unit is None:
        hint = "add a UNIT segment, or vary k instead"
        raise CasesError(f"radius: the modulus of steel needs the units of the deck; {hint}")
    steel = STEEL_MODULUS * (in_si(MODULUS, units_of(STANDARD)) or 1.0) / unit
    layers = struck_layers(strike.plate)
    plies = tuple(strike.plate.plies[layer.material] for layer in layers)
    try:
        modulus = _indentation_modulus(layers, plies, system_of(strike.plate))
        k = hertz_coefficient(float(value), steel, STEEL_POISSON, modulus)
    except ValueError as error:
        raise CasesError(f"k cannot be estimated: {error}") from None
    return strike.with_constant("k", k / symmetry_factor(strike.plate))


def struck_layers(deck: model.Deck) -> tuple[model.Layer, ...]:
    """Return the layers under the load."""
    layups, number = list(deck.layers.values()), 0
    if len(layups) > 1:
        program = compile_program(deck.macros, Findings())
        number = Problem(deck, generate(deck), program).laminate_number
    return layups[number]


@lru_cache(maxsize=256)
def _indentation_modulus(
    layers: tuple[model.Layer, ...], plies: tuple[model.Ply, ...], system: str | None
) -> float:
    angles = [layer.angle for layer in layers]
    thicknesses = [layer.thickness for layer in layers]
    ratios = [nu23_of(ply, system) for ply in plies]
    return indentation_modulus(effective_stiffness(plies, angles, thicknesses, ratios))


def set_toughness(strike: Strike, value: Value) -> Strike:
    """Change the toughness of DELA."""
    if (delamination := strike.delamination) is None:
        raise CasesError(f"giic: {NO_THRESHOLD}")
    changed = replace(delamination, toughness=float(value), source=None)
    return strike._replace(delamination=changed)


def set_mass(strike: Strike, value: Value) -> Strike:
    """Change the mass of the projectile; for a rod, scale its density."""
    return strike.with_projectile(strike.projectile.with_total_mass(float(value)))


def projectile_value(name: str) -> StrikeSetter:
    """Return the setter of a value of the projectile, by its name in sweeps."""

    def set_field(strike: Strike, value: Value) -> Strike:
        projectile = strike.projectile
        if name not in projectile.values:
            raise CasesError(f"{name}: {lacks_value(projectile)}")
        fields: dict[str, Any] = {projectile.values[name]: float(value)}
        return strike.with_projectile(replace(projectile, **fields))

    return set_field


def lacks_value(projectile: DeckProjectile) -> str:
    """Explain that a projectile does not have a value that is varied or fitted."""
    return f"the projectile of the deck is a {projectile.kind}"
