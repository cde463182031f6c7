"""Findings about contact law, patch and projectile that look like a mistake."""

from __future__ import annotations

import math

import numpy as np

from fecm.deck import model
from fecm.deck.findings import Findings
from fecm.deck.macros import flat
from fecm.deck.units import COEFFICIENT, in_si, unit_names
from fecm.mechanics.mesh import longest_sides
from fecm.mechanics.points import RADIUS_PER_THICKNESS
from fecm.problem.build import Problem
from fecm.problem.check_plausibility import expected_peak
from fecm.problem.check_units import REAL, USED, has_real_moduli, needed_unit

# Radii of a rigid sphere whose k the law has: in m where UNIT tells, otherwise over the thickness
# and over the longer side of the plate.  The report's laws, and those of isotropic plates, give
# radii from a third to 25 times that of the indenter.
LEAST_RADIUS, GREATEST_RADIUS, USUAL_RADIUS = 3e-5, 5.0, 8e-3
THINNEST, WIDEST = 6e-3, 100.0
REACH = 8.0  # greatest ratio to the usual radius at which a unit is named
LARGE_PATCH = 2.0  # radius of a patch over the thickness, and over that of the contact


def check_contact(problem: Problem, findings: Findings) -> None:
    """Check law and patch of a sound problem with an impact."""
    check_coefficient(problem, findings)
    if (card := problem.deck.last(model.Patch)) is not None:
        check_blank_radius(problem, card, findings)
        check_patch_place(problem, findings)
        check_patch_radius(problem, card, findings)


def sphere_radius(deck: model.Deck) -> float:
    """Radius of a rigid sphere with the k of a deck, equation 3-2 with E2 for E_t, length."""
    k, e2 = deck.require(model.Indentation).k, deck.require(model.Material).ply.e2
    with np.errstate(all="ignore"):
        return float((0.75 * np.float64(k) / e2) ** 2)


def check_coefficient(problem: Problem, findings: Findings) -> None:
    """Warn of a k that only a sphere of an impossible radius has."""
    deck, names = problem.deck, unit_names(problem.deck)
    if not has_real_moduli(deck.require(model.Material).ply, names):  # W435 says so
        return
    law, radius = deck.require(model.Indentation), sphere_radius(deck)
    own, real = in_si(COEFFICIENT, names), REAL["contact coefficient"]
    if own is not None and not real.least <= law.k * own <= real.greatest:  # the same
        return
    unit = in_si("length", names)
    if unit is not None:
        possible = LEAST_RADIUS <= radius * unit <= GREATEST_RADIUS
        shown = f"{radius * unit:.2g} m"
    else:
        side = float(np.ptp(problem.mesh.coordinates, axis=0).max())
        possible = THINNEST * problem.laminate.thickness <= radius <= WIDEST * side
        shown = f"{radius:.2g}, {radius / problem.laminate.thickness:.2g} times the thickness"
    if possible:
        return
    name = law.names()[0]
    message = (
        f"k = {law.k:g} is that of a rigid sphere with a radius of about {shown} on the plies' E2"
    )
    if unit is not None and (looks := _misread(deck, radius, unit, names)):
        message += f"; {looks}"
    hint = "k is in force/length^1.5 of the deck; fecm indent estimate has one for a sphere"
    findings.add("W476", f"{message}.", law.place(name), hint)


def _misread(deck: model.Deck, radius: float, unit: float, names: dict[str, str]) -> str:
    """Say which unit of k, or of the radius that it was computed from, gives a usual indenter."""
    k, own = deck.require(model.Indentation).k, in_si(COEFFICIENT, names)
    found: dict[str, float] = {}
    if own is not None:
        for known, factor in USED[COEFFICIENT].items():
            text = f"k = {k:g} looks like {known}; {needed_unit(COEFFICIENT, names)}"
            found[text] = radius * unit * (factor / own) ** 2
    for known, factor in USED["length"].items():
        text = f"the radius that it was estimated from looks like {known}"
        found[f"{text}; {needed_unit('length', names)}"] = radius * factor
    if not all(0.0 < value < math.inf for value in found.values()):
        return ""
    far = {text: abs(math.log(value / USUAL_RADIUS)) for text, value in found.items()}
    nearest = min(far, key=far.__getitem__)
    return nearest if far[nearest] <= math.log(REACH) else ""


def check_blank_radius(problem: Problem, card: model.Patch, findings: Findings) -> None:
    """Warn of a card with commas whose blank field was meant for the columns 5-10 it skips.

    The values are then centre and load instead of radius and centre, and the centre that was meant
    is nearer to the impact node.
    """
    if card.radius is not None or card.x is None or card.y is None or not card.load:
        return
    if card.source is None or "," not in card.source.card.data:
        return
    x, y = problem.mesh.coordinates[problem.deck.require(model.Impact).node - 1]
    if math.hypot(card.y - x, card.load - y) >= math.hypot(card.x - x, card.y - y):
        return
    shape, _, *others = (text for _, text in card.source.card.cut(card.source.fields))
    message = (
        f"The radius on PATC is blank; the values after it are the centre ({card.x:g}, {card.y:g}) "
        f"and a static load of {card.load:g}."
    )
    meant = ",".join([shape, *others])
    hint = f"if {card.x:g} is the radius, the card is `{meant}`: a comma ends a field, no columns"
    findings.add("W474", message, card.place("radius c"), hint)


def check_patch_place(problem: Problem, findings: Findings) -> None:
    """Note a patch that is away from the impact node."""
    patch, impact = problem.patch, problem.deck.require(model.Impact)
    if patch is None:
        return
    mesh = problem.mesh
    x, y = mesh.coordinates[impact.node - 1]
    touching = (mesh.elements == impact.node).any(axis=1)
    side = float(longest_sides(mesh.elements[touching], mesh.coordinates).max())
    distance = math.hypot(patch.x - x, patch.y - y)
    if distance <= max(patch.radius, side):
        return
    message = (
        f"the contact force acts on the patch at ({patch.x:g}, {patch.y:g}), {distance:.3g} from "
        f"node {impact.node} of ROD at ({x:g}, {y:g}), whose place is not used"
    )
    card = problem.deck.require(model.Patch)
    hint = "leave x0 and y0 blank for the node of ROD"
    findings.add("N473", message, card.place("centre x0"), hint)


def check_patch_radius(problem: Problem, card: model.Patch, findings: Findings) -> None:
    """Tell of a patch far larger than the plate's thickness and than the contact.

    A warning where stresses under the load are judged, otherwise a note: a patch may be large so
    that a coarse mesh resolves it.
    """
    thickness = problem.laminate.thickness
    if card.radius is None or card.radius <= LARGE_PATCH * thickness:
        return
    law = problem.deck.require(model.Indentation)
    with np.errstate(all="ignore"):
        indentation = (expected_peak(problem.deck, problem.plate) / law.k) ** (2.0 / 3.0)
        contact = math.sqrt(sphere_radius(problem.deck) * indentation)
    if not card.radius > LARGE_PATCH * contact > 0.0:
        return
    what = (
        f"radius of the patch, {card.radius:g}, is {card.radius / thickness:.2g} times the "
        f"thickness; a sphere with this k touches on a radius of about {contact:.2g}"
    )
    place = card.place("radius c")
    hint = f"a blank takes {RADIUS_PER_THICKNESS[card.shape]:g} times the thickness"
    if {"FAIL", "PLYS"}.isdisjoint(macro.word for macro in flat(problem.program)):
        findings.add("N475", f"the {what}", place, hint)
        return
    message = (
        f"The {what}. It looks like the radius of the indenter: stresses and exposures under the "
        "load would be too small."
    )
    findings.add("W475", message, place, hint)
