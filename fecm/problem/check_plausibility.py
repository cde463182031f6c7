"""Findings about valid values that no real impact has: wrong units, typing errors, wrong macros.

All are warnings, except that a program which cannot move the plate is an error.
"""

from __future__ import annotations

import math

import numpy as np

from fecm.deck.findings import Findings, Place
from fecm.deck.model import Deck, Impact, Indentation, Material, Projectile, Segment
from fecm.deck.records import Layer, Ply, Record
from fecm.deck.units import in_si, unit_names
from fecm.mechanics.element_groups import distinct
from fecm.mechanics.mesh import Mesh
from fecm.mechanics.plate import PlateModel
from fecm.mechanics.projectile import Rod
from fecm.mechanics.stiffness_product import SAFE
from fecm.problem.build import Problem, build_projectile
from fecm.problem.contact_step import contact_step

# Thickness over the longer side of the plate.
THINNEST, THICKEST = 1.0e-4, 0.25
# Mass of the projectile over that of the plate.
LIGHTEST, HEAVIEST = 1.0e-4, 1.0e4
# Wave speed in the rod over that along the fibres: lead and polythene are above 1/30.
SLOWEST, FASTEST = 1.0 / 30.0, 30.0
# Impact velocity over the wave speed along the fibres.
CREEPING, HYPERSONIC = 1.0e-6, 0.1
# Powers of measured unloading curves lie between 1.5 and 2.5.
LEAST_POWER, GREATEST_POWER = 1.0, 5.0
# Time step over the stable one.
WASTEFUL = 0.01

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


# Kind in REAL, card, name and value of a field.
Value = tuple[str, Record, str, float]


def check_plausibility(problem: Problem, findings: Findings) -> None:
    """Warn of values that no real plate or impact has."""
    deck, mesh, hits = problem.deck, problem.mesh, problem.has_impact
    material = deck.require(Material)
    _check_ply(material.ply, findings)
    _check_angles(material.layers, findings)
    _check_thickness(material, mesh, findings)
    _check_units(deck, findings, hits=hits)
    if hits:
        _check_law(deck, findings)
        _check_neighbours(deck.require(Impact), mesh, findings)
        _check_projectile(deck, problem.plate, findings)


def _check_ply(ply: Ply, findings: Findings) -> None:
    ratio = ply.e1 / ply.e2
    if ratio < 0.5:
        findings.add(
            "W433",
            f"E1 = {ply.e1:g} is less than half of E2 = {ply.e2:g}: E1 is the modulus along the "
            "fibres.",
            ply.place("Young's modulus E1"),
        )
    nu, place = ply.nu12, ply.place("Poisson's ratio NU12")
    if abs(nu) > 1.0:
        findings.add(
            "W434",
            f"Poisson's ratio NU12 = {nu:g} is beyond 1: no ply has such a value.",
            place,
            "NU12 of fibre composites is 0.2 to 0.4",
        )
    elif 0.0 < nu < 0.1 and ratio > 3.0 and 0.2 <= nu * ratio <= 0.45:
        findings.add(
            "W434",
            f"Poisson's ratio NU12 = {nu:g} looks like NU21: NU12 would be NU21 E1/E2 = "
            f"{nu * ratio:.3g}.",
            place,
            "NU12 is the contraction across the fibres under a stress along them",
        )


def _check_angles(layers: tuple[Layer, ...], findings: Findings) -> None:
    for layer in layers:
        if abs(layer.angle) > 180.0:
            findings.add(
                "W431",
                f"The fibre angle {layer.angle:g} is beyond 180 degrees.",
                layer.place("fibre angle"),
                "angles are in degrees, counter-clockwise from the x-axis",
            )
    turned = [layer for layer in layers if layer.angle]
    if turned and all(_is_radian(layer.angle) for layer in turned):
        shown = ", ".join(
            f"{angle:g} is {math.degrees(angle):.0f} degrees"
            for angle in dict.fromkeys(layer.angle for layer in turned[:8])
        )
        findings.add(
            "W432",
            f"The fibre angles look like radians: {shown}.",
            turned[0].place("fibre angle"),
            "angles are in degrees",
        )


def _is_radian(angle: float) -> bool:
    """Whether an angle is a multiple of 5 degrees up to 90 in radians."""
    multiple = math.degrees(abs(angle)) / 5.0
    return 0.08 < abs(angle) <= 1.6 and abs(multiple - round(multiple)) < 0.08


def _check_thickness(material: Material, mesh: Mesh, findings: Findings) -> None:
    thickness = material.integration.thickness
    side = float(np.ptp(mesh.coordinates, axis=0).max())
    if not THINNEST * side <= thickness <= THICKEST * side:
        findings.add(
            "W430",
            f"The thickness {thickness:g} is {thickness / side:.2g} of the plate's longer side "
            f"{side:g}, outside {THINNEST:g} to {THICKEST:g}.",
            material.integration.place("total thickness"),
            "thickness and coordinates must be in the same unit of length",
        )


def _check_law(deck: Deck, findings: Findings) -> None:
    law, thickness = deck.require(Indentation), deck.require(Material).integration.thickness
    name = law.names()[1]
    if law.alpha_p > thickness:
        findings.add(
            "W436",
            f"The {name} = {law.alpha_p:g} is more than the plate's thickness {thickness:g}: "
            "no permanent indentation would occur.",
            law.place(name),
            "it is a length in the deck's unit",
        )
    if law.word != Indentation.ACR and not LEAST_POWER <= law.q <= GREATEST_POWER:
        findings.add(
            "W437",
            f"The unloading power q = {law.q:g} is outside {LEAST_POWER:g} to {GREATEST_POWER:g}.",
            law.place(law.names()[3]),
            "measured powers are 1.5 to 2.5",
        )


def _check_neighbours(impact: Impact, mesh: Mesh, findings: Findings) -> None:
    """Warn if all neighbours of the impact node, inside the plate too, are restrained."""
    touching = mesh.elements[(mesh.elements == impact.node).any(axis=1)]
    around = distinct(touching[(touching > 0) & (touching != impact.node)]) - 1
    places = mesh.coordinates
    inner = ((places > places.min(axis=0)) & (places < places.max(axis=0))).all(axis=1)
    if inner[around].any() and (mesh.equations[around, impact.dof - 1] == 0).all():
        findings.add(
            "W441",
            f"Every other node of the elements at the impact node {impact.node} is restrained in "
            f"dof {impact.dof}.",
            impact.place("impact node"),
            "restrain the supports only",
        )


def _check_projectile(deck: Deck, plate: PlateModel, findings: Findings) -> None:
    impact, card, ply = deck.require(Impact), deck.last(Projectile), deck.require(Material).ply
    projectile = build_projectile(deck)
    ratio = projectile.total_mass / (plate.area() * plate.laminate.mass)
    place = impact.place("impact node") if card is None else card.place("length or mass")
    if not LIGHTEST <= ratio <= HEAVIEST:
        findings.add(
            "W438",
            f"The projectile's mass {projectile.total_mass:.4g} is {ratio:.3g} times the plate's.",
            place,
            "mass is force time^2/length in the deck's units: t in mm, N and s",
        )
    along_fibres = math.sqrt(ply.e1 / ply.density)
    if isinstance(projectile, Rod) and card is not None:
        speed = math.sqrt(projectile.modulus / projectile.density)
        if not SLOWEST <= speed / along_fibres <= FASTEST:
            findings.add(
                "W439",
                f"The wave speed in the rod, (E/density)^(1/2) = {speed:.3g}, is "
                f"{speed / along_fibres:.2g} times that along the plate's fibres.",
                card.place("rod's Young's modulus"),
                "modulus and density must be in the units of the ply's",
            )
    share = abs(impact.velocity) / along_fibres
    if share and not CREEPING <= share <= HYPERSONIC:
        findings.add(
            "W440",
            f"The impact velocity {impact.velocity:g} is {share:.2g} of the wave speed along the "
            f"fibres, (E1/density)^(1/2) = {along_fibres:.3g}.",
            impact.place("impact velocity"),
            "velocity is in the deck's units of length and time",
        )


def _values(deck: Deck, *, hits: bool) -> list[Value]:
    """Values that :data:`REAL` has a range for."""
    material = deck.require(Material)
    ply, layer = material.ply, max(material.layers, key=lambda layer: layer.thickness)
    values: list[Value] = [
        ("density", ply, "mass density", ply.density),
        ("fibre modulus", ply, "Young's modulus E1", ply.e1),
        ("matrix modulus", ply, "Young's modulus E2", ply.e2),
        ("matrix modulus", ply, "shear modulus G12", ply.g12),
        ("matrix modulus", ply, "shear modulus G13", ply.g13),
        ("matrix modulus", ply, "shear modulus G23", ply.g23),
        ("ply thickness", layer, "layer thickness", layer.thickness),
    ]
    if not hits:
        return values
    impact, law, card = deck.require(Impact), deck.require(Indentation), deck.last(Projectile)
    if impact.velocity > 0.0:
        values.append(("velocity", impact, "impact velocity", impact.velocity))
    values.append(("contact coefficient", law, law.names()[0], law.k))
    if card is not None and card.elements:
        values.append(("rod modulus", card, "rod's Young's modulus", card.modulus))
        values.append(("density", card, "rod's density", card.density))
    return values


def _check_units(deck: Deck, findings: Findings, *, hits: bool) -> None:
    """Warn in one finding of values that no real material has in the units of UNIT."""
    names = unit_names(deck)
    wrong: list[tuple[Place | None, str]] = []
    for kind, record, name, value in _values(deck, hits=hits):
        dimension, least, greatest, unit = REAL[kind]
        factor = in_si(dimension, names)
        if factor is not None and not least <= value * factor <= greatest:
            what = f"{name} {value:g} is {value * factor:.3g} {unit}"
            wrong.append((record.place(name), f"{what}, outside {least:g} to {greatest:g}"))
    if wrong:
        findings.add(
            "W435",
            f"In the units of UNIT ({' '.join(names.values())}) the "
            f"{'; the '.join(what for _, what in wrong)}.",
            wrong[0][0],
            "either the values or the names on UNIT are wrong; nothing is converted",
        )


def check_time_step_of_contact(problem: Problem, findings: Findings) -> None:
    """Warn of a DT that the contact makes unstable, and of one far below the stable step."""
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
            findings.add(
                "W517",
                f"DT = {dt or SAFE * bound:.3g} is not below {contact.limit:.3g}, the stable "
                f"step with the contact's stiffness of about {contact.stiffness:.3g} on a mass "
                f"of {contact.mass:.3g}: the contact may diverge.",
                macro.place("value"),
                f"check k and the masses, or take a DT of {0.9 * contact.limit:.2g}",
            )
        if 0.0 < dt < WASTEFUL * stable:
            findings.add(
                "W516",
                f"DT = {dt:.3g} is only {dt / stable:.2g} of the stable step {stable:.3g}.",
                macro.place("value"),
                "DT is in the deck's unit of time",
            )


# Macros that move the plate or find its modes, and those that store its displacements.
MOVE = {"RODP", "EXCD", "SOLV", "EIGE"}
STORE = {"DISP", "STRE", "REAC"}
OF_AN_IMPACT: tuple[type[Segment], ...] = (Impact, Indentation, Projectile)


def check_purpose(deck: Deck, mesh: Mesh, findings: Findings) -> None:
    """Compare the segments of an impact with the program."""
    words = {macro.word: macro for macro in deck.macros}
    movers = MOVE & words.keys()
    segment = next((s for kind in OF_AN_IMPACT if (s := deck.last(kind)) is not None), None)
    if segment is not None and "RODP" not in movers:
        what = f"The deck has a {segment.keyword} segment, but its program has no RODP"
        hint = "RODP takes an impact step; use it instead of EXCD"
        stored = next((macro for macro in deck.macros if macro.word in STORE | movers), None)
        if stored is not None and movers <= {"EXCD"} and not mesh.forces.any():
            findings.add(
                "E519", f"{what}: the plate never moves, and all results would be 0.",
                stored.place("macro"), hint,
            )  # fmt: skip
        elif movers:
            findings.add("W520", f"{what}: nothing hits the plate.", segment.place(), hint)
    if {"RODP", "EXCD"} <= movers:
        findings.add(
            "W518",
            "EXCD moves the plate but not the projectile, which is at rest during the step.",
            words["EXCD"].place("macro"),
            "RODP applies the loads of FORC too",
        )
