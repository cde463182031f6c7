"""Rules about the CURE segment: residual stresses of cure and moisture."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fecm._typing import Floats
from fecm.deck import model
from fecm.deck.macros import flat
from fecm.deck.material_cards import MATERIAL
from fecm.deck.rules import Report, Reports, Subject, reports, rule
from fecm.deck.units import quantity, unit_names, unit_of
from fecm.judge.criteria import exposed
from fecm.problem.problem import Problem
from fecm.problem.rules.damage import FIBROUS
from fecm.problem.rules.zones import material_numbers

LARGEST_BETA = 0.1  # strain per per cent of weight
LARGEST_CHANGE = 500.0  # K
# Cooling, in K, from which the stress-free temperature may be in K and that of use in degrees
# Celsius; laminates of epoxy cool by 60 to 260 K.
IN_KELVIN = 320.0
ICE = 273.15  # K
# alpha2 of resin plies per degree Fahrenheit; per kelvin it is 19e-6 and more.
PER_FAHRENHEIT = (8e-6, 18e-6)
LARGEST_WARP = 0.1  # rise of the free plate over its thickness without a warning
FIELDS = "its fields are the material (columns 1-5, blank: 1), alpha1 (11-20) and alpha2 (21-30)"


@rule("E453", Subject.LAMINATE)
def missing_expansion(card: model.Cure) -> Reports:
    """CURE has no coefficients of expansion of the plies.

    Its second card is missing, of another material or given twice; or alpha1 and alpha2 are 0.

    Remedy: After the changes a card with the material (blank: 1), alpha1 and alpha2.
    """
    hint = FIELDS
    materials = [expansion.material for expansion in card.expansions]
    for position, expansion in enumerate(card.expansions):
        if expansion.material in materials[:position]:
            message = f"Material {expansion.material} has a second card of expansions."
            yield Report(message, expansion.place("material"), "remove one of them")
    if (free := card.expansion(MATERIAL)) is None:
        yield Report(f"CURE has no card for material {MATERIAL}, MATE's.", card.place(), hint)
        return
    for change, value, names in (
        ("temperature", card.delta_t, model.Expansion.THERMAL),
        ("moisture", card.delta_c, model.Expansion.MOISTURE),
    ):
        if value and not any(getattr(free, name) for name in names):
            both = " and ".join(names)
            message = f"CURE changes the {change} by {value:g}, but {both} are 0."
            yield Report(message, free.place(names[0]), hint)


@rule("E454", Subject.LAMINATE)
def implausible_expansion(card: model.Cure) -> Reports:
    """A coefficient of thermal expansion on CURE is above 10⁻³ per kelvin.

    Fibres and resins have 10⁻⁶ to 10⁻⁴.

    Remedy: Coefficients per kelvin: 22.5E-6, not 22.5.
    """
    for expansion in card.expansions:
        for name in expansion.THERMAL:
            value = getattr(expansion, name)
            if abs(value) > expansion.LARGEST:
                message = f"{name} = {value:g} is above {expansion.LARGEST:g}; it is per kelvin."
                hint = f"{value:g} millionths are {value * 1e-6:.4g}"
                yield Report(message, expansion.place(name), hint)


@rule("W496", Subject.LAMINATE)
def implausible_moisture(problem: Problem, card: model.Cure) -> Reports:
    """A coefficient of moisture expansion on CURE is above 0.1.

    It is the strain per per cent of weight. Books have the strain at 100 %.

    Remedy: A hundredth of the book's value: 0.006 for 0.6.
    """
    for expansion in card.expansions:
        for name in expansion.MOISTURE:
            value = getattr(expansion, name)
            if abs(value) > LARGEST_BETA:
                message = f"{name} = {value:g} is large for a strain per per cent of weight."
                hint = f"{value:g} at 100 % is {value / 100.0:.4g} per per cent"
                yield Report(message, expansion.place(name), hint)


@rule("W462", Subject.LAMINATE)
def large_change(problem: Problem, card: model.Cure) -> Reports:
    """The change of temperature on CURE is above 500 K.

    Remedy: Temperature of use minus stress-free temperature, in kelvin.
    """
    if abs(card.delta_t) > LARGEST_CHANGE:
        message = f"The change of temperature is {card.delta_t:g} K, above {LARGEST_CHANGE:g}."
        hint = "it is the temperature of use minus the stress-free temperature: -155 from 177 to 22"
        yield Report(message, card.place("change of temperature"), hint)


@rule("W588", Subject.LAMINATE)
def temperature_in_kelvin(problem: Problem, card: model.Cure) -> Reports:
    """CURE cools the plies by 320 to 500 K.

    The stress-free temperature may be in kelvin and the temperature of use in degrees Celsius.
    Laminates of epoxy cool by 60 to 260 K; thermoplastics and polyimides by up to 360 K.

    Remedy: Both temperatures in degrees Celsius: -155 from 177 to 22.
    """
    if -LARGEST_CHANGE <= card.delta_t <= -IN_KELVIN:
        message = (
            f"CURE cools the plies by {-card.delta_t:g} K, more than epoxy does: the stress-free "
            "temperature may be in kelvin."
        )
        hint = (
            f"with both temperatures in degrees Celsius the change would be "
            f"{card.delta_t + ICE:.0f} K"
        )
        yield Report(message, card.place("change of temperature"), hint)


@rule("W540", Subject.LAMINATE)
def heated_since_the_cure(problem: Problem, card: model.Cure) -> Reports:
    """The change of temperature on CURE is positive.

    The plies have been heated since they were free of stress. After a cure the change is negative,
    and residual stresses of the wrong sign hide the first failure.

    Remedy: The temperature of use minus the temperature of the cure: -155 from 177 to 22.
    """
    if card.delta_t > 0.0:
        message = (
            f"CURE {card.delta_t:+g} K: the plies have been heated since they were free of stress; "
            "after a cure the change is negative."
        )
        hint = f"write {-card.delta_t:g} if the plate has cooled by {card.delta_t:g} K"
        yield Report(message, card.place("change of temperature"), hint)


@rule("W463", Subject.DAMAGE)
def cracks_at_rest(problem: Problem, card: model.Cure) -> Reports:
    """The laminate cracks before any load.

    The residual stresses of CURE alone reach the strength of a ply.

    Remedy: The values of CURE and ALLO, or another layup.
    """
    worst = problem.worst_under(preload=False)
    if worst is not None and worst[0].exposure >= 1.0:
        exposure, laminate = worst
        where = exposed(problem.deck, laminate, exposure)
        message = (
            f"The laminate cracks before any load: the residual stresses of CURE reach exposure "
            f"{exposure.exposure:.3g}: {where}."
        )
        hint = (
            f"the change of temperature is {card.delta_t:g} K, both temperatures in one unit; "
            "strengths and moduli must be in the same unit"
        )
        yield Report(message, card.place(), hint)


@rule("W564", Subject.DAMAGE)
def cracks_at_rest_under_preload(problem: Problem, card: model.Cure) -> Reports:
    """The preload and the residual stresses together fail a ply.

    Neither fails it alone. A criterion of FAIL is at 1 or above before anything moves.

    Remedy: A smaller preload, the values of CURE and ALLO, or another layup.
    """
    worst = problem.worst_under()
    if worst is None or worst[0].exposure < 1.0:
        return
    alone = problem.worst_under(preload=False), problem.worst_under(cure=False)
    if not any(part is not None and part[0].exposure >= 1.0 for part in alone):
        exposure, laminate = worst
        where = exposed(problem.deck, laminate, exposure)
        message = (
            f"The preload and the residual stresses of CURE together reach exposure "
            f"{exposure.exposure:.3g} before any load: {where}."
        )
        yield Report(message, card.place(), "PREL is a force per length, tension positive")


@rule("W551", Subject.LAMINATE)
def exchanged_expansions(problem: Problem, card: model.Cure) -> Reports:
    """A ply of parallel fibres expands more along the fibres than across them.

    alpha1 is above alpha2, or beta1 above beta2, in a ply with E1 > 2 E2.

    Remedy: alpha1, along the fibres, before alpha2.
    """
    for expansion in _expansions_of_fibrous_plies(card, problem.deck.plies):
        for along, across in (expansion.THERMAL, expansion.MOISTURE):
            first, second = getattr(expansion, along), getattr(expansion, across)
            if first > second:
                message = (
                    f"{along} = {first:g} is above {across} = {second:g}, unlike in any ply of "
                    "parallel fibres: they look exchanged."
                )
                hint = f"{along} is along the fibres, {across} across them"
                yield Report(message, expansion.place(along), hint)


@rule("W552", Subject.LAMINATE)
def expansion_per_fahrenheit(problem: Problem, card: model.Cure) -> Reports:
    """alpha2 on CURE looks like a coefficient per degree Fahrenheit.

    It is 8·10⁻⁶ to 18·10⁻⁶ in a ply with E1 > 2 E2; resins have 19·10⁻⁶ and more.

    Remedy: Coefficients per kelvin: 1.8 times those per degree Fahrenheit.
    """
    least, greatest = PER_FAHRENHEIT
    for expansion in _expansions_of_fibrous_plies(card, problem.deck.plies):
        if expansion.alpha1 <= expansion.alpha2 and least < expansion.alpha2 < greatest:
            message = (
                f"alpha2 = {expansion.alpha2:g} is small for a resin and looks like a coefficient "
                "per degree Fahrenheit; CURE takes coefficients per kelvin."
            )
            converted = f"{1.8 * expansion.alpha1:.4g} and {1.8 * expansion.alpha2:.4g}"
            hint = f"per kelvin alpha1 and alpha2 would be {converted}"
            yield Report(message, expansion.place("alpha2"), hint)


def _expansions_of_fibrous_plies(
    card: model.Cure, plies: Mapping[int, model.Ply]
) -> list[model.Expansion]:
    """Return the coefficients of expansion of the plies with parallel fibres."""
    return [
        expansion
        for expansion in card.expansions
        if (ply := plies.get(expansion.material)) is not None and ply.e1 > FIBROUS * ply.e2
    ]


def _largest_curvature(curvature: Floats) -> float:
    """Return the largest principal curvature in size of kappa_x, kappa_y and kappa_xy."""
    x, y, xy = curvature
    return float(abs(x + y) / 2.0 + np.hypot((x - y) / 2.0, xy / 2.0))


@rule("W464", Subject.LAMINATE)
def warped_plate(problem: Problem, card: model.Cure) -> Reports:
    """The laminate is not symmetric and warps as it cools.

    The free plate rises by more than a tenth of its thickness. It is taken as flat when it is
    mounted, without the forces that flatten it.

    Remedy: A symmetric laminate, or accept it.
    """
    if (residual := problem.residual) is None:
        return
    rise = _largest_curvature(residual.curvature) * problem.longer_side**2 / 8.0
    thickness = problem.laminate.thickness
    if rise > LARGEST_WARP * thickness:
        rise_text = quantity(rise, unit_of("length", unit_names(problem.deck)), 3)
        message = (
            f"The free plate warps by {rise_text} over its longer side, {rise / thickness:.2g} "
            "times its thickness: the laminate is not symmetric."
        )
        hint = "the plate is taken as flat when mounted; what flattens it is not in the model"
        yield Report(message, card.place(), hint)


@rule("W465", Subject.LAMINATE)
def cure_without_stresses(problem: Problem, card: model.Cure) -> Reports:
    """CURE is given without PLYS and FAIL.

    Residual stresses change neither the motion nor the force.

    Remedy: FAIL, with ALLO, in the loop of RODP.
    """
    if {"PLYS", "FAIL"}.isdisjoint(m.word for m in flat(problem.program)):
        message = "CURE has no effect without PLYS or FAIL: motion and force don't depend on it."
        yield Report(message, card.place(), "put FAIL, with ALLO, into the loop of RODP")


@reports("E453")
def missing_expansions(deck: model.Deck, card: model.Cure) -> Reports:
    """Find materials of layers without coefficients of expansion, and unknown ones with them."""
    if not deck.has(model.Material):
        return
    numbers = material_numbers(deck)
    for expansion in card.expansions:
        if expansion.material not in numbers:
            only = ", ".join(map(str, sorted(numbers)))
            message = f"The deck has no material {expansion.material}, only {only}."
            yield Report(message, expansion.place("material"), FIELDS)
    used = {layer.material for layers in deck.layers.values() for layer in layers}
    for number in sorted(used - {MATERIAL, *(expansion.material for expansion in card.expansions)}):
        yield Report(f"CURE has no card for material {number}.", card.place(), FIELDS)


OF_MATERIALS = (missing_expansions,)
OF_CURE = (missing_expansion, implausible_expansion)
VALUES = (
    implausible_moisture,
    large_change,
    temperature_in_kelvin,
    heated_since_the_cure,
    exchanged_expansions,
    expansion_per_fahrenheit,
    cracks_at_rest,
    cracks_at_rest_under_preload,
    warped_plate,
    cure_without_stresses,
)
