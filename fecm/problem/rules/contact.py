"""Rules about the EXPE segment."""

from __future__ import annotations

import math

import numpy as np

from fecm._typing import Bools, Floats
from fecm.deck import model
from fecm.deck.rules import Report, Reports, Subject, rule
from fecm.deck.units import COEFFICIENT, in_si, unit_names
from fecm.mechanics.contact_law import ACR_POWER
from fecm.mechanics.laminate import is_fabric
from fecm.problem.problem import Problem
from fecm.problem.rules.units import REAL, USED, has_real_moduli, needed_unit

# Powers of measured unloading curves lie between 1.5 and 2.5.
LEAST_POWER = 1.5
GREATEST_POWER = 5.0
# Slopes s_p of permanent indentations: measured ones are near 0.1.
SMALLEST_SLOPE = 0.02
USUAL_SLOPES = (0.03, 0.5)
# Limits of the radius of the rigid sphere that has the law's k: in m if the deck has UNIT,
# otherwise over the thickness and over the longer side of the plate.  The report's laws and
# isotropic plates give radii from a third to 25 times the radius of the indenter, which is 1 mm or
# more.
LEAST_RADIUS = 1.5e-4
GREATEST_RADIUS = 0.8
LEAST_OF_THICKNESS = 6e-3
MOST_OF_SIDE = 100.0
USUAL_RADIUS = 8e-3  # m
E_T_OF_G23 = 2.8  # 2 (1 + nu) of a matrix with nu = 0.4
REACH = 8.0  # greatest ratio to the usual radius at which a unit is named


@rule("E412", Subject.IMPACT)
def invalid_parameter(law: model.Indentation) -> Reports:
    """A parameter of EXPE is out of range.

    Remedy: k and q positive, alpha_p 0 or more, s_p at least 0 and below 1.
    """
    limits = limits_of(law.word, *law.values())
    for name, value, (valid, must) in zip(law.names(), law.values(), limits, strict=True):
        if not valid:
            yield Report(f"The {name} is {value:g}; it must be {must}.", law.place(name))


def limits_of(
    word: str, k: float | Floats, alpha_p: float | Floats, s_p: float | Floats, q: float | Floats
) -> list[tuple[bool | Bools, str]]:
    """Return whether each value of an EXPE card is valid, and what it must be.

    The values are numbers or arrays.
    """
    if word == model.Indentation.ACR:
        return [
            (k > 0.0, "positive"),
            (alpha_p > 0.0, "positive"),
            (s_p == 0.0, "blank or 0 with ACR, whose equation 3-7 has no such constant"),
            (
                (q == 0.0) | (q == ACR_POWER),
                "blank or 2.5 with ACR, as equation 3-7 holds for no other",
            ),
        ]
    return [
        (k > 0.0, "positive"),
        (alpha_p >= 0.0, "0 or more"),
        ((s_p >= 0.0) & (s_p < 1.0), "at least 0 and below 1"),
        (q > 0.0, "positive"),
    ]


@rule("W436", Subject.IMPACT)
def large_indentation(problem: Problem) -> Reports:
    """alpha_p is above the thickness.

    No permanent indentation would occur.

    Remedy: A length in the deck's unit.
    """
    law = problem.deck.require(model.Indentation)
    thickness = problem.deck.require(model.Material).integration.thickness
    if law.alpha_p > thickness:
        name = law.names()[1]
        what = f"The {name} = {law.alpha_p:g} is more than the plate's thickness {thickness:g}"
        message = f"{what}: no permanent indentation would occur."
        yield Report(message, law.place(name), "it is a length in the deck's unit")


@rule("W437", Subject.IMPACT)
def doubtful_power(problem: Problem) -> Reports:
    """The power q is outside 1.5 to 5.

    q is the power of unloading. The power of loading is 1.5 whatever q is.

    Remedy: Measured powers are 1.5 to 2.5; an elastic law has 1.5.
    """
    law = problem.deck.require(model.Indentation)
    if law.word != model.Indentation.ACR and not LEAST_POWER <= law.q <= GREATEST_POWER:
        limits = f"{LEAST_POWER:g} to {GREATEST_POWER:g}"
        message = f"The unloading power q = {law.q:g} is outside {limits}."
        hint = "measured powers are 1.5 to 2.5; the power of loading is 1.5, for which k holds"
        yield Report(message, law.place(law.names()[3]), hint)


@rule("W550", Subject.IMPACT)
def exchanged_constants(problem: Problem) -> Reports:
    """alpha_p and s_p look exchanged.

    s_p is below 0.02, and alpha_p has a size that is usual for s_p (0.03 to 0.5).

    Remedy: k, alpha_p (a length), s_p (the permanent over the largest indentation), q.
    """
    law = problem.deck.require(model.Indentation)
    least, greatest = USUAL_SLOPES
    if 0.0 < law.s_p < SMALLEST_SLOPE and least <= law.alpha_p <= greatest:
        message = f"alpha_p = {law.alpha_p:g} and s_p = {law.s_p:g} look exchanged."
        hint = f"alpha_p is a length; measured slopes s_p are {least:g} to {greatest:g}"
        yield Report(message, law.place(law.names()[1]), hint)


def sphere_radius(problem: Problem) -> float:
    """Return the radius of a rigid sphere with the k of a problem, length.

    The radius follows from equation 3-2 with E2 for E_t. Across a fabric E_t is that of its matrix.
    """
    k, ply = problem.contact_coefficient, problem.deck.require(model.Material).ply
    modulus = E_T_OF_G23 * ply.g23 if is_fabric(ply) else ply.e2
    with np.errstate(all="ignore"):
        return float((0.75 * np.float64(k) / modulus) ** 2)


@rule("W476", Subject.IMPACT)
def doubtful_coefficient(problem: Problem) -> Reports:
    """K belongs to a sphere of an impossible radius.

    By equation 3-2 with E2 the radius is smaller than 0.15 mm or larger than 0.8 m (without UNIT:
    smaller than 0.006 of the thickness, or larger than 100 plates). A soft tip has a small radius
    too.

    Remedy: k in force/length^1.5; `fecm indent estimate`.
    """
    deck, names = problem.deck, unit_names(problem.deck)
    if not has_real_moduli(deck.require(model.Material).ply, names):  # W435 reports it
        return
    if deck.has(model.Materials):  # a face on a soft core is softer than its plies
        return
    law, radius = deck.require(model.Indentation), sphere_radius(problem)
    size, real = in_si(COEFFICIENT, names), REAL["contact coefficient"]
    if size is not None and not real.least <= law.k * size <= real.greatest:  # W435 too
        return
    unit = in_si("length", names)
    if unit is not None:
        possible = LEAST_RADIUS <= radius * unit <= GREATEST_RADIUS
        shown = f"{radius * unit:.2g} m"
    else:
        thickness = problem.laminate.thickness
        greatest = MOST_OF_SIDE * problem.longer_side
        possible = LEAST_OF_THICKNESS * thickness <= radius <= greatest
        shown = f"{radius:.2g}, {radius / thickness:.2g} times the thickness"
    if possible:
        return
    message = (
        f"k = {law.k:g} belongs to a rigid sphere with a radius of about {shown} on the plies' E2"
    )
    if unit is not None:
        is_small = radius * unit < LEAST_RADIUS
        looks = _misread(deck, radius, unit, names)
        message += f"; {looks}, or" if looks else ";"
        message += " a digit is missing or the tip is soft" if is_small else " a digit is too many"
    hint = "k is in force/length^1.5 of the deck; fecm indent estimate has one for a sphere"
    yield Report(f"{message}.", law.place(law.names()[0]), hint)


def _misread(deck: model.Deck, radius: float, unit: float, names: dict[str, str]) -> str:
    """Say which unit of k, or of the radius that it was computed from, gives a usual indenter."""
    k, size = deck.require(model.Indentation).k, in_si(COEFFICIENT, names)
    units: dict[str, float] = {}
    if size is not None:
        for named_unit, factor in USED[COEFFICIENT].items():
            text = f"k = {k:g} looks like {named_unit}; {needed_unit(COEFFICIENT, names)}"
            units[text] = radius * unit * (factor / size) ** 2
    for named_unit, factor in USED["length"].items():
        text = f"the radius that it was estimated from looks like {named_unit}"
        if named_unit == "m":  # E of the sphere in GPa gives as small a k
            text += " or the sphere's modulus like GPa"
        units[f"{text}; {needed_unit('length', names)}"] = radius * factor
    if not all(0.0 < value < math.inf for value in units.values()):
        return ""
    far = {text: abs(math.log(value / USUAL_RADIUS)) for text, value in units.items()}
    nearest = min(far, key=far.__getitem__)
    return nearest if far[nearest] <= math.log(REACH) else ""


OF_LAW = (invalid_parameter,)
VALUES = (large_indentation, doubtful_power, exchanged_constants)
OF_COEFFICIENT = (doubtful_coefficient,)
