"""Findings about valid values that no real impact has: wrong units, typing errors, wrong macros.

All are warnings, except that a program which cannot move the plate is an error.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress

import numpy as np

from fecm._frozen import frozen
from fecm.deck import model
from fecm.deck.findings import Findings
from fecm.deck.units import MASS, in_si, unit_names
from fecm.mechanics.laminate import Laminate, effective_rigidity
from fecm.mechanics.mesh import Mesh, distinct
from fecm.mechanics.plate import PlateModel, UnsoundPlateError
from fecm.mechanics.projectile import RigidMass, Rod
from fecm.mechanics.stiffness_product import SAFE
from fecm.mechanics.time_step import critical_time_step
from fecm.problem.build import Problem, W, build_constants, build_projectile
from fecm.problem.check_units import check_units, looks_like

THINNEST = 1.0e-4  # thickness over the longer side of the plate
THICK, THICKEST = 0.1, 0.25  # thickness over the distance between supports
# Difference from elasticity: docs/plies.md, from Pagano's exact solution.
ERRORS = (
    "at 0.1 the deflection of a [0/90/0] plate with E1/E2 = 25 is 16 % too small and its largest "
    "stress 12 %, at 0.25 they are 22 % and 44 %; isotropic plates are closer"
)
FREE, SUPPORTED = 3000, 300  # most nodes whose distances are compared
LIGHTEST, HEAVIEST = 1.0e-4, 2.0e3  # mass of the projectile over that of the plate
USUAL_MASS_RATIO = 10.0
# Wave speed in the rod over that along the fibres: lead and polythene are above 1/30.
SLOWEST, FASTEST = 1.0 / 30.0, 30.0
CREEPING, HYPERSONIC = 1.0e-6, 0.1  # impact velocity over the wave speed along the fibres
WITHOUT_EFFECT = 0.01  # damping times the duration
# Powers of measured unloading curves lie between 1.5 and 2.5.
LEAST_POWER, GREATEST_POWER = 1.0, 5.0
WASTEFUL = 0.01  # time step over the stable one


def check_plausibility(problem: Problem, findings: Findings) -> None:
    """Warn of values that no real plate or impact has."""
    _check_material(problem.deck.require(model.Material), findings)
    _check_thickness(problem, findings)
    check_units(problem.deck, findings, hits=problem.has_impact)
    if problem.has_impact:
        _check_impact(problem, findings)
    if (damping := problem.deck.last(model.Damping)) is not None:
        _check_damping(problem, damping, findings)


def _check_material(material: model.Material, findings: Findings) -> None:
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
    if turned and are_like_radians([layer.angle for layer in turned]):
        known = dict.fromkeys(layer.angle for layer in turned[:8])
        shown = ", ".join(f"{angle:g} is {math.degrees(angle):.0f} degrees" for angle in known)
        message = f"The fibre angles look like radians: {shown}."
        findings.add("W432", message, turned[0].place("fibre angle"), "angles are in degrees")


def are_like_radians(angles: Sequence[float]) -> bool:
    """Whether all angles are small multiples of 5 degrees in radians."""
    sizes = np.abs(angles)
    multiples = np.degrees(sizes) / 5.0
    off = np.abs(multiples - np.rint(multiples))
    return bool(((sizes > 0.08) & (sizes <= 1.6) & (off < 0.08)).all())


def _check_thickness(problem: Problem, findings: Findings) -> None:
    """Compare the thickness with the plate's side, and with the distance between supports."""
    card = problem.deck.require(model.Material).integration
    thickness, place = card.thickness, card.place("total thickness")
    hint = "thickness and coordinates must be in the same unit of length"
    side = float(np.ptp(problem.mesh.coordinates, axis=0).max())
    if thickness < THINNEST * side:
        of_side = f"{thickness / side:.2g} of the plate's longer side {side:g}"
        message = f"The thickness {thickness:g} is {of_side}, less than {THINNEST:g}."
        findings.add("W430", message, place, hint)
        return
    span, name = unsupported(problem.mesh, problem.load_place)
    share = thickness / span
    if share <= THICK * (1.0 + 1e-9):
        return
    what = f"thickness {thickness:g} is {share:.2g} of the {name} {span:.4g}"
    if share > THICKEST:
        message = f"The {what}, more than {THICKEST:g}: plate theory does not hold; {ERRORS}."
        findings.add("W430", message, place, hint)
    else:
        hint = "SHEA EQUI brings the deflection of this example to 1 % at 0.1"
        findings.add("N430", f"the {what}: {ERRORS}", place, hint)


def unsupported(mesh: Mesh, load: tuple[float, float] | None) -> tuple[float, str]:
    """Distance between supports that counts for bending, and its name.

    Diameter of the largest circle around a node that has no node with restrained w in it and
    reaches the load, if there is one: the shorter distance between two supported sides, the
    diameter of a round window, twice the length of a cantilever.  Without supports the shorter
    side of the plate.
    """
    places, held = mesh.coordinates[mesh.used], mesh.codes[mesh.used, W] != 0
    free, supports = places[~held], places[held]
    if not len(supports) or not len(free):
        return float(np.ptp(places, axis=0).min()), "plate's shorter side"
    free = free[:: -(-len(free) // FREE)]
    supports = supports[:: -(-len(supports) // SUPPORTED)]
    radii = np.hypot(*(free[:, None, :] - supports).transpose(2, 0, 1)).min(axis=1)
    if load is not None:
        reaching = np.hypot(*(free - load).T) <= radii
        radii = radii[reaching] if reaching.any() else radii
    return 2.0 * float(radii.max()), "distance between supports"


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
        message = f"The projectile's mass {mass:.4g} is {ratio:.3g} times the plate's"
        names = unit_names(deck)
        own = in_si(MASS, names)
        usual = USUAL_MASS_RATIO * mass / ratio * (own or 1.0)
        if own is not None and (looks := looks_like(mass, MASS, usual, names)):
            message += f"; it {looks}"
        hint = "mass is force time^2/length in the deck's units: t in mm, N and s"
        findings.add("W438", f"{message}.", place, hint)
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


def _check_damping(problem: Problem, card: model.Damping, findings: Findings) -> None:
    """Warn of a damping without effect, and of one that lets nothing oscillate."""
    a, place = card.coefficient, card.place("a")
    dt = max((m.value for m in problem.deck.macros if m.word == "DT"), default=0.0)
    duration = problem.work.steps * (dt or problem.safe_time_step)
    lowest = clamped_frequency(problem)
    one = f"a = 2 zeta omega, about {0.02 * lowest:.2g} for zeta = 1 %"
    hint = f"a is in 1/time: {one} of the lowest mode"
    if 0.0 < a * duration < WITHOUT_EFFECT:
        message = (
            f"The damping a = {a:g} takes only {-100.0 * math.expm1(-a * duration / 2.0):.2g} "
            f"% off the amplitudes within the program's {duration:.3g}"
        )
        likeness = ": it looks like a damping ratio" if a < 1.0 else ""
        findings.add("W479", f"{message}{likeness}.", place, hint)
    elif a / 2.0 > lowest:
        message = (
            f"The damping a = {a:g} lets no low mode oscillate: a/2 is above {lowest:.3g}, the "
            "lowest natural frequency with clamped edges (radians over time)"
        )
        findings.add("W480", f"{message}.", place, hint)


def clamped_frequency(problem: Problem) -> float:
    """Lowest natural frequency of a clamped rectangle of the plate's size, radians over time.

    Rayleigh's quotient of products of the modes of clamped beams, whose integrals are 22.373^2
    and 12.303^2; thin plate theory, without the coupling D16, D26.
    """
    D = problem.laminate.D
    a, b = np.ptp(problem.mesh.coordinates[problem.mesh.used], axis=0).tolist()
    along, across = 22.373**2 * D[0, 0] / a**4, 22.373**2 * D[1, 1] / b**4
    twist = 2.0 * 12.303**2 * (D[0, 1] + 2.0 * D[2, 2]) / (a * b) ** 2
    return math.sqrt((along + across + twist) / problem.laminate.mass)


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
    """Force over velocity of a point of an infinite plate, 8 (m D*)^(1/2) (force*time/length)."""
    return 8.0 * math.sqrt(laminate.mass * effective_rigidity(laminate))


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
