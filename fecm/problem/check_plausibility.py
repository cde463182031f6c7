"""Findings about valid values that no real impact has: wrong units, typing errors, wrong macros.

All are warnings, except that a program which cannot move the plate is an error.
"""

from __future__ import annotations

import math
from contextlib import suppress

import numpy as np

from fecm._frozen import frozen
from fecm.deck import model
from fecm.deck.findings import Findings, Place
from fecm.deck.records import Record
from fecm.deck.units import in_si, unit_names
from fecm.mechanics.laminate import Laminate
from fecm.mechanics.mesh import Mesh, distinct
from fecm.mechanics.plate import PlateModel, UnsoundPlateError
from fecm.mechanics.projectile import RigidMass, Rod
from fecm.mechanics.stiffness_product import SAFE
from fecm.mechanics.time_step import critical_time_step
from fecm.problem.build import Problem, build_constants, build_projectile

THINNEST, THICKEST = 1.0e-4, 0.25  # thickness over the longer side of the plate
LIGHTEST, HEAVIEST = 1.0e-4, 1.0e4  # mass of the projectile over that of the plate
# Wave speed in the rod over that along the fibres: lead and polythene are above 1/30.
SLOWEST, FASTEST = 1.0 / 30.0, 30.0
CREEPING, HYPERSONIC = 1.0e-6, 0.1  # impact velocity over the wave speed along the fibres
# Powers of measured unloading curves lie between 1.5 and 2.5.
LEAST_POWER, GREATEST_POWER = 1.0, 5.0
WASTEFUL = 0.01  # time step over the stable one

# Range of real materials and impacts in m, N and s, about a decade wider on each side: dimension,
# smallest and largest value, unit.
REAL = {
    "fibre modulus": ("force/length^2", 1e9, 2e12, "Pa"),
    "matrix modulus": ("force/length^2", 1e8, 2e12, "Pa"),
    "density": ("force*time^2/length^4", 100.0, 25e3, "kg/m^3"),
    "ply thickness": ("length", 5e-6, 0.1, "m"),
    "rod modulus": ("force/length^2", 1e6, 2e12, "Pa"),
    "velocity": ("length/time", 0.01, 1000.0, "m/s"),
    "contact coefficient": ("force/length^1.5", 1e6, 1e12, "N/m^1.5"),
}


def check_plausibility(problem: Problem, findings: Findings) -> None:
    """Warn of values that no real plate or impact has."""
    _check_material(problem.deck.require(model.Material), problem.mesh, findings)
    _check_units(problem.deck, findings, hits=problem.has_impact)
    if problem.has_impact:
        _check_impact(problem, findings)


def _check_material(material: model.Material, mesh: Mesh, findings: Findings) -> None:
    ply = material.ply
    ratio = ply.e1 / ply.e2
    if ratio < 0.5:
        why = "E1 is the modulus along the fibres"
        message = f"E1 = {ply.e1:g} is less than half of E2 = {ply.e2:g}: {why}."
        findings.add("W433", message, ply.place("Young's modulus E1"))
    nu, place = ply.nu12, ply.place("Poisson's ratio NU12")
    if abs(nu) > 1.0:
        message = f"Poisson's ratio NU12 = {nu:g} is beyond 1: no ply has such a value."
        findings.add("W434", message, place, "NU12 of fibre composites is 0.2 to 0.4")
    elif 0.0 < nu < 0.1 and ratio > 3.0 and 0.2 <= nu * ratio <= 0.45:
        why = f"NU12 would be NU21 E1/E2 = {nu * ratio:.3g}"
        message = f"Poisson's ratio NU12 = {nu:g} looks like NU21: {why}."
        hint = "NU12 is the contraction across the fibres under a stress along them"
        findings.add("W434", message, place, hint)
    for layer in material.layers:
        if abs(layer.angle) > 180.0:
            message = f"The fibre angle {layer.angle:g} is beyond 180 degrees."
            hint = "angles are in degrees, counter-clockwise from the x-axis"
            findings.add("W431", message, layer.place("fibre angle"), hint)
    turned = [layer for layer in material.layers if layer.angle]
    angles = np.abs([layer.angle for layer in turned])
    multiples = np.degrees(angles) / 5.0  # whole where the angle is one of 5 degrees, in radians
    off = np.abs(multiples - np.rint(multiples))
    like_radians = (angles > 0.08) & (angles <= 1.6) & (off < 0.08)
    if turned and like_radians.all():
        known = dict.fromkeys(layer.angle for layer in turned[:8])
        shown = ", ".join(f"{angle:g} is {math.degrees(angle):.0f} degrees" for angle in known)
        message = f"The fibre angles look like radians: {shown}."
        findings.add("W432", message, turned[0].place("fibre angle"), "angles are in degrees")
    thickness = material.integration.thickness
    side = float(np.ptp(mesh.coordinates, axis=0).max())
    if not THINNEST * side <= thickness <= THICKEST * side:
        share = f"{thickness / side:.2g} of the plate's longer side {side:g}"
        message = f"The thickness {thickness:g} is {share}, outside {THINNEST:g} to {THICKEST:g}."
        hint = "thickness and coordinates must be in the same unit of length"
        findings.add("W430", message, material.integration.place("total thickness"), hint)


def _check_impact(problem: Problem, findings: Findings) -> None:
    deck, mesh, plate = problem.deck, problem.mesh, problem.plate
    law, impact = deck.require(model.Indentation), deck.require(model.Impact)
    card = deck.last(model.Projectile)
    material, projectile = deck.require(model.Material), build_projectile(deck)
    thickness, name = material.integration.thickness, law.names()[1]
    if law.alpha_p > thickness:
        what = f"The {name} = {law.alpha_p:g} is more than the plate's thickness {thickness:g}"
        message = f"{what}: no permanent indentation would occur."
        findings.add("W436", message, law.place(name), "it is a length in the deck's unit")
    if law.word != model.Indentation.ACR and not LEAST_POWER <= law.q <= GREATEST_POWER:
        limits = f"{LEAST_POWER:g} to {GREATEST_POWER:g}"
        message = f"The unloading power q = {law.q:g} is outside {limits}."
        findings.add("W437", message, law.place(law.names()[3]), "measured powers are 1.5 to 2.5")
    # The neighbours of the impact node, if they are inside the plate too.
    touching = mesh.elements[(mesh.elements == impact.node).any(axis=1)]
    around = distinct(touching[(touching > 0) & (touching != impact.node)]) - 1
    places = mesh.coordinates
    inner = ((places > places.min(axis=0)) & (places < places.max(axis=0))).all(axis=1)
    if inner[around].any() and (mesh.equations[around, impact.dof - 1] == 0).all():
        where = f"the impact node {impact.node} is restrained in dof {impact.dof}"
        message = f"Every other node of the elements at {where}."
        findings.add("W441", message, impact.place("impact node"), "restrain the supports only")
    ratio = projectile.total_mass / (plate.area() * plate.laminate.mass)
    place = impact.place("impact node") if card is None else card.place("length or mass")
    if not LIGHTEST <= ratio <= HEAVIEST:
        mass = projectile.total_mass
        message = f"The projectile's mass {mass:.4g} is {ratio:.3g} times the plate's."
        hint = "mass is force time^2/length in the deck's units: t in mm, N and s"
        findings.add("W438", message, place, hint)
    along_fibres = math.sqrt(material.ply.e1 / material.ply.density)
    if isinstance(projectile, Rod) and card is not None:
        speed = math.sqrt(projectile.modulus / projectile.density)
        if not SLOWEST <= speed / along_fibres <= FASTEST:
            what = f"The wave speed in the rod, (E/density)^(1/2) = {speed:.3g}"
            message = f"{what}, is {speed / along_fibres:.2g} times that along the plate's fibres."
            hint = "modulus and density must be in the units of the ply's"
            findings.add("W439", message, card.place("rod's Young's modulus"), hint)
    share = abs(impact.velocity) / along_fibres
    if share and not CREEPING <= share <= HYPERSONIC:
        wave = f"the wave speed along the fibres, (E1/density)^(1/2) = {along_fibres:.3g}"
        message = f"The impact velocity {impact.velocity:g} is {share:.2g} of {wave}."
        hint = "velocity is in the deck's units of length and time"
        findings.add("W440", message, impact.place("impact velocity"), hint)


def _check_units(deck: model.Deck, findings: Findings, *, hits: bool) -> None:
    """Warn in one finding of values that no real material has in the units of UNIT."""
    material = deck.require(model.Material)
    ply, layer = material.ply, max(material.layers, key=lambda layer: layer.thickness)
    # Kind in REAL, card, name and value of a field.
    values: list[tuple[str, Record, str, float]] = [
        ("density", ply, "mass density", ply.density),
        ("fibre modulus", ply, "Young's modulus E1", ply.e1),
        ("matrix modulus", ply, "Young's modulus E2", ply.e2),
        ("matrix modulus", ply, "shear modulus G12", ply.g12),
        ("matrix modulus", ply, "shear modulus G13", ply.g13),
        ("matrix modulus", ply, "shear modulus G23", ply.g23),
        ("ply thickness", layer, "layer thickness", layer.thickness),
    ]
    if hits:
        impact, law = deck.require(model.Impact), deck.require(model.Indentation)
        if impact.velocity > 0.0:
            values.append(("velocity", impact, "impact velocity", impact.velocity))
        values.append(("contact coefficient", law, law.names()[0], law.k))
        if (card := deck.last(model.Projectile)) is not None and card.elements:
            values.append(("rod modulus", card, "rod's Young's modulus", card.modulus))
            values.append(("density", card, "rod's density", card.density))
    names = unit_names(deck)
    wrong: list[tuple[Place | None, str]] = []
    for kind, record, name, value in values:
        dimension, least, greatest, unit = REAL[kind]
        factor = in_si(dimension, names)
        if factor is not None and not least <= value * factor <= greatest:
            what = f"{name} {value:g} is {value * factor:.3g} {unit}"
            wrong.append((record.place(name), f"{what}, outside {least:g} to {greatest:g}"))
    if wrong:
        listed = "; the ".join(what for _, what in wrong)
        message = f"In the units of UNIT ({' '.join(names.values())}) the {listed}."
        hint = "either the values or the names on UNIT are wrong; nothing is converted"
        findings.add("W435", message, wrong[0][0], hint)


def check_time_step_of_contact(problem: Problem, findings: Findings) -> None:
    """Warn of a DT that the contact makes unstable, and of one far below the stable step.

    The plate moves explicitly under the contact force of the last step, so the contact acts on it
    as a spring with the tangent stiffness of the indentation law.
    """
    steps = [macro for macro in problem.deck.macros if macro.word == "DT"]
    if not steps:
        return
    bound = problem.safe_time_step
    largest = max(macro.value or SAFE * bound for macro in steps)
    contact = contact_step(problem, problem.moving_plate, largest, bound)
    stable = bound if contact is None else min(bound, contact.limit)
    for macro in steps:
        dt = macro.value
        if contact is not None and (dt or SAFE * bound) >= contact.limit:
            message = (
                f"DT = {dt or SAFE * bound:.3g} is not below {contact.limit:.3g}, the stable "
                f"step with the contact's stiffness of about {contact.stiffness:.3g} on a mass "
                f"of {contact.mass:.3g}: the contact may diverge."
            )
            hint = f"check k and the masses, or take a DT of {0.9 * contact.limit:.2g}"
            findings.add("W517", message, macro.place("value"), hint)
        if 0.0 < dt < WASTEFUL * stable:
            message = f"DT = {dt:.3g} is only {dt / stable:.2g} of the stable step {stable:.3g}."
            findings.add("W516", message, macro.place("value"), "DT is in the deck's unit of time")


# Macros that move the plate or find its modes, and those that store its displacements.
MOVE = {"RODP", "EXCD", "SOLV", "EIGE"}
STORE = {"DISP", "STRE", "REAC"}
OF_AN_IMPACT: tuple[type[model.Segment], ...] = (model.Impact, model.Indentation, model.Projectile)


def check_purpose(deck: model.Deck, mesh: Mesh, findings: Findings) -> None:
    """Compare the segments of an impact with the program."""
    words = {macro.word: macro for macro in deck.macros}
    movers = MOVE & words.keys()
    segment = next((s for kind in OF_AN_IMPACT if (s := deck.last(kind)) is not None), None)
    if segment is not None and "RODP" not in movers:
        what = f"The deck has a {segment.keyword} segment, but its program has no RODP"
        hint = "RODP takes an impact step; use it instead of EXCD"
        stored = next((macro for macro in deck.macros if macro.word in STORE | movers), None)
        if stored is not None and movers <= {"EXCD"} and not mesh.forces.any():
            message = f"{what}: the plate never moves, and all results would be 0."
            findings.add("E519", message, stored.place("macro"), hint)
        elif movers:
            findings.add("W520", f"{what}: nothing hits the plate.", segment.place(), hint)
    if {"RODP", "EXCD"} <= movers:
        message = "EXCD moves the plate but not the projectile, which is at rest during the step."
        hint = "RODP applies the loads of FORC too"
        findings.add("W518", message, words["EXCD"].place("macro"), hint)


# A clamped square plate under a central force has the stiffness D/(0.0056 a^2): Timoshenko and
# Woinowsky-Krieger, Theory of Plates and Shells, Table 35.  In terms of the force 8 v (m D)^(1/2)
# of a wave, that is this factor on the ratio of the masses.
CLAMPED = 1.0 / (64.0 * 0.0056)


def wave_impedance(laminate: Laminate) -> float:
    """Force over velocity of a point of an infinite plate, 8 (m D*)^(1/2) (force*time/length).

    D* is the effective bending stiffness of an orthotropic plate: R. Olsson, Impact response of
    orthotropic composite plates predicted from a one-parameter differential equation, AIAA Journal
    30 (1992) 1587-1596.
    """
    D = laminate.D
    mean = math.sqrt(D[0, 0] * D[1, 1])
    return 8.0 * math.sqrt(laminate.mass * (mean + D[0, 1] + 2.0 * D[2, 2]) / 2.0)


def expected_peak(deck: model.Deck, plate: PlateModel) -> float:
    """Estimate the peak force, high rather than low.

    The minimum of the Hertz contact on a rigid target, k^(2/5) (5 m v^2/4)^(3/5), and of the
    response of the plate: the bending wave for a light projectile, the stiffness of a clamped plate
    for a heavy one.
    """
    impact, law = deck.require(model.Impact), deck.require(model.Indentation)
    mass, v = build_projectile(deck).total_mass, np.abs(np.float64(impact.velocity))
    ratio = mass / (plate.area() * plate.laminate.mass)
    rigid = law.k**0.4 * (1.25 * mass) ** 0.6 * v**1.2
    return float(min(rigid, wave_impedance(plate.laminate) * v * np.sqrt(1.0 + CLAMPED * ratio)))


def contact_stiffness(deck: model.Deck, plate: PlateModel) -> float:
    """Larger tangent stiffness of loading (3-1) and unloading (3-3) at the expected peak."""
    law = build_constants(deck.require(model.Indentation))
    with np.errstate(all="ignore"):  # infinite where the unloading curve is a vertical line
        force = np.float64(expected_peak(deck, plate))
        peak = (force / law.k) ** (2.0 / 3.0)
        if not peak > 0.0:
            return 0.0
        return float(force * max(1.5 / peak, law.q / (peak - law.permanent(peak))))


@frozen
class ContactStep:
    """Limit of the time step from the contact."""

    stiffness: float  # tangent stiffness of the contact, force/length
    mass: float  # the smaller of the plate's mass at the impact dof and the projectile's at its tip
    limit: float  # largest stable time step; infinite where the time step is certainly stable


def contact_step(
    problem: Problem, plate: PlateModel, dt: float, bound: float
) -> ContactStep | None:
    """Largest time step at which plate and contact are stable together; None without impact.

    `bound` is a lower bound of the plate's critical time step, `dt` the deck's, 0 for 0.9 of the
    critical one.  The limit is computed only where the bound does not show that this is stable.
    """
    if problem.contact is None:
        return None
    weights = problem.contact[plate.mesh.equations > 0]
    stiffness = contact_stiffness(problem.deck, plate)
    projectile = build_projectile(problem.deck)
    rigid = isinstance(projectile, RigidMass)
    tip = projectile.total_mass if rigid else float(projectile.mass()[0])
    at_node = 1.0 / float((weights**2 / plate.mass).sum())
    mass = min(tip, at_node)
    if not stiffness > 0.0:
        return ContactStep(stiffness, mass, math.inf)
    # The projectile's implicit step is iterated: a fixed point only below this (beta is 1/6).
    iterated = math.sqrt(6.0 * tip / stiffness)
    step = dt or SAFE * bound
    if step < iterated and (step / bound) ** 2 + step**2 * stiffness / (4.0 * at_node) < 1.0:
        return ContactStep(stiffness, mass, math.inf)
    limit = iterated
    with suppress(UnsoundPlateError):  # the contact's stiffness is out of range
        limit = min(iterated, critical_time_step(plate, (weights, stiffness)))
    return ContactStep(stiffness, mass, limit)
