"""Rules about the PROJ segment, and about a projectile that no segment defines."""

from __future__ import annotations

import math

import numpy as np

from fecm._typing import Floats
from fecm.deck import model
from fecm.deck.rules import Report, Reports, Subject, declare, rule
from fecm.deck.units import KNOWN, MASS, in_si, unit_names
from fecm.mechanics.projectile import Rod, report_rod
from fecm.problem.parts import build_projectile, rod_of_deck
from fecm.problem.problem import Problem
from fecm.problem.rules.cards import ranges
from fecm.problem.rules.units import looks_like

# A rod's step is a full matrix of three times as many rows and columns as it has dofs.
MOST_ROD_ELEMENTS = 500
# One inch, pound and second in m, N and s.
REPORT_UNITS = [KNOWN["length"]["in"], KNOWN["force"]["lbf"], KNOWN["time"]["s"]]
# Mass of the projectile over the mass of the plate.
LIGHTEST = 1.0e-4
HEAVIEST = 2.0e3
HEAVY = 500.0  # drop weights have 50 to 300
USUAL_MASS_RATIO = 10.0
MOST_ENERGY = 2e5  # per thickness, N; 200 J per mm
# Wave speed in the rod over that along the fibres: lead and polythene are above 1/30.
SLOWEST = 1.0 / 30.0
FASTEST = 30.0

# Found while the diameters are generated, in generate.py.
declare(
    "E420",
    Subject.IMPACT,
    "A diameter is given for an element that the rod does not have.",
    remedy="Correct PROJ.",
)
declare(
    "E421",
    Subject.IMPACT,
    "Rod elements do not ascend.",
    remedy="Sort the cards.",
)


@rule("E418", Subject.IMPACT)
def invalid_number_of_elements(card: model.Projectile) -> Reports:
    """The number of rod elements is out of range.

    Remedy: 0 is a rigid mass.
    """
    if not 0 <= card.elements <= MOST_ROD_ELEMENTS:
        must = f"0 (a rigid mass) to {MOST_ROD_ELEMENTS}"
        message = f"The projectile has {card.elements} rod elements; it must have {must}."
        yield Report(message, card.place("number of rod elements"))


@rule("E419", Subject.IMPACT)
def invalid_projectile(card: model.Projectile) -> Reports:
    """Length, mass, modulus or density of the projectile is not positive.

    Remedy: Positive numbers.
    """
    for what, value, name in card.positive_values():
        if not value > 0.0:
            yield Report(f"The {what} is {value:g}; it must be positive.", card.place(name))


@rule("E423", Subject.IMPACT)
def unknown_transducer(card: model.Projectile) -> Reports:
    """The transducer node does not exist.

    Remedy: Blank is the middle.
    """
    if card.elements and not 0 <= card.transducer <= card.elements + 1:
        what = f"The transducer node {card.transducer} does not exist"
        message = f"{what}; the rod has nodes 1 to {card.elements + 1}."
        yield Report(message, card.place("transducer node"), "blank is the middle")


@rule("E422", Subject.IMPACT)
def invalid_diameter(card: model.Projectile, diameters: Floats) -> Reports:
    """Rod elements have no diameter, or one that is not positive.

    Remedy: The first and the last element, with an increment of 1 on the first card.
    """
    missing = np.flatnonzero(np.isnan(diameters))
    if len(missing):
        message = f"Rod elements {ranges(missing + 1)} have no diameter."
        hint = "give the first and the last element, with an increment of 1 on the first card"
        yield Report(message, card.place("number of rod elements"), hint)
    for record in card.diameters:
        if not record.diameter > 0.0:
            what = f"The diameter of rod element {record.element} is {record.diameter:g}"
            yield Report(f"{what}; it must be positive.", record.place("diameter"))


@rule("E429", Subject.IMPACT)
def rod_out_of_range(card: model.Projectile, diameters: Floats) -> Reports:
    """Mass or stiffness of the rod is beyond the range of numbers.

    Remedy: Check the units of length, diameters, modulus and density.
    """
    rod = Rod(card.size, tuple(diameters.tolist()), card.modulus, card.density)
    try:
        with np.errstate(all="ignore"):
            values = np.concatenate([rod.lumped_mass(), rod.stiffness().diagonal()])
    except OverflowError:
        values = np.array([np.inf])
    if not ((values > 0.0) & np.isfinite(values)).all():
        message = "The rod's mass or stiffness is beyond the range of numbers."
        hint = "check the units of length, diameters, modulus and density"
        yield Report(message, card.place("length or mass"), hint)


@rule("W438", Subject.IMPACT)
def doubtful_mass(problem: Problem) -> Reports:
    """The projectile is far too light, or too heavy, for the plate.

    Its mass over the mass of the plate is outside 10⁻⁴ to 2000.

    Remedy: Mass in force·time²/length: t in mm, N and s; pounds over 386.09 in in, lbf and s.
    """
    ratio = build_projectile(problem.deck).total_mass / problem.plate.total_mass()
    if not LIGHTEST <= ratio <= HEAVIEST:
        yield _report_of_mass(problem, ratio)


@rule("N587", Subject.IMPACT)
def heavy_projectile(problem: Problem) -> Reports:
    """The mass of the projectile is 500 to 2000 times the plate's.

    Drop weights have 50 to 300 times the mass of the plate. A mass in kg in mm, N and s is a
    thousand times too large, a weight in pounds in in, lbf and s 386 times.

    Remedy: Mass in force·time²/length: t in mm, N and s; pounds over 386.09 in in, lbf and s.
    """
    ratio = build_projectile(problem.deck).total_mass / problem.plate.total_mass()
    if HEAVY < ratio <= HEAVIEST:
        yield _report_of_mass(problem, ratio)


def _report_of_mass(problem: Problem, ratio: float) -> Report:
    """Return a report about the mass of the projectile, and the unit that it seems to be in."""
    deck, names = problem.deck, unit_names(problem.deck)
    mass = build_projectile(deck).total_mass
    message = f"The projectile's mass {mass:.4g} is {ratio:.3g} times the plate's"
    size = in_si(MASS, names)
    usual = USUAL_MASS_RATIO * mass / ratio * (size or 1.0)
    in_inches = names.get("length") == "in"
    if not in_inches and size is not None and (looks := looks_like(mass, MASS, usual, names)):
        message += f"; it {looks}"
    card, impact = deck.last(model.Projectile), deck.require(model.Impact)
    place = impact.place("impact node") if card is None else card.place("length or mass")
    hint = "mass is force time^2/length in the deck's units"
    if in_inches:
        hint += ": a weight in pounds is divided by 386.09 in/s^2"
    elif not names:
        hint += ": t in mm, N and s; pounds over 386.09 in in, lbf and s"
    return Report(f"{message}.", place, hint)


@rule("W439", Subject.IMPACT)
def doubtful_rod(problem: Problem, card: model.Projectile) -> Reports:
    """The wave speed in the rod does not suit the wave speed along the fibres.

    Their ratio is outside 1/30 to 30.

    Remedy: Modulus and density in the ply's units.
    """
    if (rod := rod_of_deck(problem.deck)) is None:
        return
    ply = problem.deck.require(model.Material).ply
    speed = math.sqrt(rod.modulus / rod.density)
    share = speed / math.sqrt(ply.e1 / ply.density)
    if not SLOWEST <= share <= FASTEST:
        what = f"The wave speed in the rod, (E/density)^(1/2) = {speed:.3g}"
        message = f"{what}, is {share:.2g} times that along the plate's fibres."
        hint = "modulus and density must be in the units of the ply's"
        yield Report(message, card.place("rod's Young's modulus"), hint)


@rule("W554", Subject.IMPACT)
def rod_thicker_than_long(problem: Problem, card: model.Projectile) -> Reports:
    """The rod is thicker than long.

    Its largest diameter is above its length. Waves run along a slender rod only.

    Remedy: The length on PROJ's card, the diameters on the cards below; or a rigid mass.
    """
    if (rod := rod_of_deck(problem.deck)) is None:
        return
    thickest = max(rod.diameters)
    if thickest > rod.length:
        message = (
            f"The rod is thicker than long: its diameter is {thickest:g}, its length "
            f"{rod.length:g}. They look exchanged."
        )
        hint = "a body that is not slender is a rigid mass (0 elements)"
        yield Report(message, card.place("length or mass"), hint)


@rule("W555", Subject.IMPACT)
def large_energy(problem: Problem) -> Reports:
    """The impact energy is above 200 J per mm of thickness.

    Drop-weight tests have 1 to 10 J per mm. Judged where UNIT names the units.

    Remedy: Velocity and mass in the deck's units: 10 J are 10 000 mJ in mm, N and s.
    """
    names = unit_names(problem.deck)
    force = in_si("force", names)
    if force is None:
        return
    impact = problem.deck.require(model.Impact)
    energy = 0.5 * problem.projectile_mass * impact.velocity**2
    share = energy / problem.laminate.thickness * force  # J/m, which is N
    if share > MOST_ENERGY:
        joule = energy * (in_si("force*length", names) or 1.0)
        message = (
            f"The impact energy is {joule:.3g} J, {share / 1e3:.3g} J per mm of thickness, far "
            "beyond what an elastic plate withstands."
        )
        hint = "a drop-weight test has 1 to 10 J per mm; check velocity and mass for their units"
        yield Report(message, impact.place("impact velocity"), hint)


def _has_the_reports_units(names: dict[str, str]) -> bool:
    """Return whether units fit the report's rod; True where they are unknown."""
    return not names or [in_si(name, names) for name in names] == REPORT_UNITS


@rule("N414", Subject.IMPACT)
def reports_rod(problem: Problem) -> Reports:
    """There is no PROJ: the report's steel rod is taken.

    The deck is without UNIT, or in in, lbf and s.

    Remedy: Give PROJ for another projectile.
    """
    if _has_the_reports_units(unit_names(problem.deck)):
        place = problem.deck.require(model.Impact).place("impact node")
        yield Report("no PROJ: the report's steel rod (in, lbf, s) is taken", place)


@rule("W414", Subject.IMPACT)
def reports_rod_in_other_units(problem: Problem) -> Reports:
    """There is no PROJ in a deck of other units than in, lbf and s.

    The report's rod is taken as if the deck were in these.

    Remedy: Give PROJ.
    """
    if _has_the_reports_units(unit_names(problem.deck)):
        return
    rod = report_rod()
    message = (
        f"No projectile is defined: the report's steel rod is assumed, in lb, in and s whatever "
        f"the deck's units (length {rod.length:g}, diameter {rod.diameters[-1]:g}, "
        f"E {rod.modulus:g}, density {rod.density:g}, mass {rod.total_mass:.5g})."
    )
    place = problem.deck.require(model.Impact).place("impact node")
    yield Report(message, place, "define the projectile in a PROJ segment")


OF_NUMBER = (invalid_number_of_elements,)
OF_PROJECTILE = (invalid_projectile, unknown_transducer)
# Of diameters without other errors; one of these is enough.
OF_DIAMETERS = (invalid_diameter, rod_out_of_range)
OF_ROD = (doubtful_rod, rod_thicker_than_long)
VALUES = (doubtful_mass, heavy_projectile, large_energy)
WITHOUT_PROJECTILE = (reports_rod, reports_rod_in_other_units)
