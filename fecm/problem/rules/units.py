"""Rules about names of units, and about values that nothing real has in the units of UNIT."""

from __future__ import annotations

import math
from typing import NamedTuple

from fecm.deck import model
from fecm.deck.findings import CardPlace
from fecm.deck.material_cards import MATERIAL
from fecm.deck.model import Ply, Record
from fecm.deck.rules import Report, Reports, Subject, rule
from fecm.deck.units import (
    COEFFICIENT,
    DENSITY,
    KNOWN,
    MASS,
    MASSES,
    MODULUS,
    TOUGHNESS,
    VELOCITY,
    force_of,
    in_si,
    unit_names,
    unit_of,
)
from fecm.mechanics.laminate import is_fabric
from fecm.problem.problem import Problem
from fecm.problem.rules.laminate import is_fibrous

# Units in which values are often given, in m, N and s, by their dimension.
USED = {
    "length": {"m": 1.0, "mm": 1e-3, "in": 0.0254},
    VELOCITY: {"m/s": 1.0, "mm/s": 1e-3, "in/s": 0.0254, "ft/s": 0.3048},
    MASS: {"kg": 1.0, "g": 1e-3, "t": 1e3, "lbf*s^2/in": 175.1268},
    MODULUS: {
        "Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9, "psi": 6894.757, "ksi": 6.894757e6,
    },
    TOUGHNESS: {"J/m^2": 1.0, "kJ/m^2": 1e3, "J/mm^2": 1e6, "lbf/in": 175.1268},
    DENSITY: {
        "kg/m^3": 1.0, "g/cm^3": 1e3, "t/mm^3": 1e12, "lb/in^3": 27679.9,
        "lbf*s^2/in^4": 1.068689e7,
    },
    COEFFICIENT: {"N/m^1.5": 1.0, "N/mm^1.5": 1e3**1.5, "lbf/in^1.5": 4.448222 / 0.0254**1.5},
}  # fmt: skip
REACH = 30.0  # greatest ratio of a value to the usual one at which a unit is named
SAME = 1e-3  # relative difference of units that are the same


class Range(NamedTuple):
    """Range of a quantity in real materials and impacts, in m, N and s."""

    dimension: str
    # About a decade beyond what is known.
    least: float
    greatest: float
    usual: float
    unit: str


REAL = {
    "fibre modulus": Range(MODULUS, 1e9, 2e12, 1e11, "Pa"),
    "matrix modulus": Range(MODULUS, 1e8, 2e12, 8e9, "Pa"),
    "matrix modulus of heavy plies": Range(MODULUS, 3e9, 2e12, 8e9, "Pa"),
    "density": Range(DENSITY, 100.0, 25e3, 2e3, "kg/m^3"),
    "density of stiff plies": Range(DENSITY, 700.0, 5e3, 2e3, "kg/m^3"),
    "ply thickness": Range("length", 5e-6, 0.1, 2e-4, "m"),
    "rod modulus": Range(MODULUS, 1e6, 2e12, 1e11, "Pa"),
    "velocity": Range(VELOCITY, 0.01, 1000.0, 5.0, "m/s"),
    "contact coefficient": Range(COEFFICIENT, 1e6, 1e12, 1e9, "N/m^1.5"),
}
# E1, in Pa, from which plies have technical fibres; wood and foam are lighter than these.
STIFF = 20e9
# Density in kg/m^3 and E1 in Pa of plies in which an E2 of about 1 GPa is in another unit. Plies
# of polyethylene and of flax are lighter. Soft matrices with carbon fibres have a larger E1.
HEAVY = 1350.0
STIFFEST_IN_KSI = 70e9
SOFTEST_IN_KSI = 0.6e9  # E2, Pa; rubber has a smaller E2
# Names that are not units of length, force or time.
OTHERS = {
    "mass": (*MASSES, "ton", "lbm", "slug"),
    "stress": ("Pa", "kPa", "MPa", "GPa", "psi", "ksi"),
    "energy": ("J", "mJ", "kJ"),
}


def likely_unit(value: float, dimension: str, usual: float) -> str:
    """Return the unit of :data:`USED` in which a value comes nearest to the usual value.

    `usual` is in m, N and s.  The result is empty if no unit brings the value within a factor of
    :data:`REACH`.
    """
    if not (0.0 < abs(value) < math.inf and 0.0 < usual < math.inf):
        return ""
    ratio = math.log(abs(value)) - math.log(usual)
    far = {unit: abs(ratio + math.log(factor)) for unit, factor in USED[dimension].items()}
    nearest = min(far, key=far.__getitem__)
    return nearest if far[nearest] <= math.log(REACH) else ""


def needed_unit(dimension: str, names: dict[str, str]) -> str:
    """Say which unit a deck needs: ``mm, N and s need MPa``; empty without names."""
    if not names:
        return ""
    factor, unit = in_si(dimension, names), unit_of(dimension, names)
    same = (name for name, size in USED[dimension].items() if _same(size, factor))
    *others, last = names.values()
    return f"{', '.join(others)} and {last} need {next(same, unit)}"


def _same(factor: float, other: float | None) -> bool:
    return other is not None and abs(factor / other - 1.0) < SAME


def looks_like(value: float, dimension: str, usual: float, names: dict[str, str]) -> str:
    """Say in which unit a value seems to be, and which one the deck needs; may be empty."""
    unit, needed = likely_unit(value, dimension, usual), needed_unit(dimension, names)
    if not unit or _same(USED[dimension][unit], in_si(dimension, names)):
        return ""
    return f"looks like {unit}" + (f"; {needed}" if needed else "")


def has_real_moduli(ply: Ply, names: dict[str, str]) -> bool:
    """Return whether E1 and E2 are in the range of real materials; True for unknown units."""
    factor = in_si(MODULUS, names)
    least, greatest = REAL["matrix modulus"].least, REAL["fibre modulus"].greatest
    return factor is None or all(least <= e * factor <= greatest for e in (ply.e1, ply.e2))


@rule("W482", Subject.LAMINATE)
def unit_of_another_kind(card: model.Units) -> Reports:
    """A name on UNIT is a unit of something else.

    For instance, kg is given as the force.

    Remedy: Length, force and time in this order: `mm N s`.
    """
    kinds = {**{kind: tuple(units) for kind, units in KNOWN.items()}, **OTHERS}
    for dimension, name in zip(card.NAMES, (card.length, card.force, card.time), strict=True):
        kind = next((kind for kind, units in kinds.items() if name in units), dimension)
        if name in KNOWN[dimension] or kind == dimension:
            continue
        message = f"`{name}` on UNIT is a unit of {kind}, not of {dimension}"
        if dimension == "force" and (unit := force_of(name, card.length, card.time)):
            message += f"; with {card.length}, {name} and {card.time} the force is in {unit}"
        hint = "UNIT names the units of length, force and time in this order, as in mm N s"
        yield Report(f"{message}.", card.place(), hint)


@rule("W435", Subject.LAMINATE)
def unreal_values(problem: Problem) -> Reports:
    """A value is outside the range of real materials in the units of UNIT.

    Modulus, density, thickness, velocity and k are judged. Plies of fibres have narrower ranges:
    700 to 5000 kg/m³ if E1 is above 20 GPa; E2 of 3 GPa and more if E1 is below 70 GPa and the
    density above 1350 kg/m³. The finding names the unit that the value seems to be in.

    Remedy: Correct the values or UNIT. Nothing is converted.
    """
    names = unit_names(problem.deck)
    wrong: list[tuple[CardPlace | None, str]] = []
    for kind, record, name, value in _judged(problem):
        real = REAL[kind]
        factor = in_si(real.dimension, names)
        if factor is None or real.least <= value * factor <= real.greatest:
            continue
        what = f"{name} {value:g} is {value * factor:.3g} {real.unit}"
        what += f", outside {real.least:g} to {real.greatest:g}"
        if looks := looks_like(value, real.dimension, real.usual, names):
            what += f" ({looks})"
        wrong.append((record.place(name), what))
    if wrong:
        listed = "; the ".join(what for _, what in wrong)
        message = f"In the units of UNIT ({' '.join(names.values())}) the {listed}."
        hint = "either the values or the names on UNIT are wrong; nothing is converted"
        yield Report(message, wrong[0][0], hint)


def _judged(problem: Problem) -> list[tuple[str, Record, str, float]]:
    """Return kind in :data:`REAL`, card, name and value of the fields that are judged."""
    deck = problem.deck
    ply = deck.require(model.Material).ply
    layers = [layer for laminate in deck.layers.values() for layer in laminate]
    # Other materials may be cores, which are thicker than plies and softer than any matrix.
    plies = [layer for layer in layers if layer.material == MATERIAL] or layers
    thickest = max(plies, key=lambda layer: layer.thickness)
    names = unit_names(deck)
    values: list[tuple[str, Record, str, float]] = [
        (_kind_of_density(ply, names), ply, "mass density", ply.density),
        ("fibre modulus", ply, "Young's modulus E1", ply.e1),
        (_kind_of_e2(ply, names), ply, "Young's modulus E2", ply.e2),
        ("matrix modulus", ply, "shear modulus G12", ply.g12),
        ("matrix modulus", ply, "shear modulus G13", ply.g13),
        ("matrix modulus", ply, "shear modulus G23", ply.g23),
        ("ply thickness", thickest, "layer thickness", thickest.thickness),
    ]
    if not problem.has_impact:
        return values
    impact, law = deck.require(model.Impact), deck.require(model.Indentation)
    if impact.velocity > 0.0:
        values.append(("velocity", impact, "impact velocity", impact.velocity))
    values.append(("contact coefficient", law, law.names()[0], law.k))
    if (card := deck.last(model.Projectile)) is not None and card.elements:
        values.append(("rod modulus", card, "rod's Young's modulus", card.modulus))
        values.append(("density", card, "rod's density", card.density))
    return values


def _kind_of_density(ply: Ply, names: dict[str, str]) -> str:
    """Return the key of :data:`REAL` for the density of a ply."""
    of_modulus = in_si(MODULUS, names)
    has_fibres = is_fibrous(ply) or is_fabric(ply)
    if of_modulus is not None and has_fibres and ply.e1 * of_modulus > STIFF:
        return "density of stiff plies"
    return "density"


def _kind_of_e2(ply: Ply, names: dict[str, str]) -> str:
    """Return the key of :data:`REAL` for E2 of a ply."""
    of_modulus, of_density = in_si(MODULUS, names), in_si(DENSITY, names)
    if of_modulus is None or of_density is None or not is_fibrous(ply):
        return "matrix modulus"
    is_heavy = ply.density * of_density > HEAVY
    is_suspect = ply.e1 * of_modulus < STIFFEST_IN_KSI and ply.e2 * of_modulus > SOFTEST_IN_KSI
    return "matrix modulus of heavy plies" if is_heavy and is_suspect else "matrix modulus"


OF_NAMES = (unit_of_another_kind,)
VALUES = (unreal_values,)
