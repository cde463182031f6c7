"""Checks of all segments but the mesh's, and whether the mesh resolves the impact."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from fecm._frozen import frozen
from fecm.deck import model
from fecm.deck.findings import Findings
from fecm.deck.units import KNOWN, in_si, unit_names
from fecm.mechanics.contact_law import ACR_POWER
from fecm.mechanics.elements import HIGHEST_ORDER
from fecm.mechanics.mesh import Mesh, element_blocks, longest_sides
from fecm.mechanics.points import DISC, HERTZ, RADIUS_PER_THICKNESS, PatchError, locate
from fecm.mechanics.projectile import Rod, report_rod
from fecm.problem import check_mesh
from fecm.problem.build import ContactPatch, Problem, W, build_projectile
from fecm.problem.check_units import check_unit_names
from fecm.problem.generate import rod_diameters

# One inch, pound and second in m, N and s.
REPORT_UNITS = [KNOWN["length"]["in"], KNOWN["force"]["lbf"], KNOWN["time"]["s"]]
# A rod's step is a full matrix of three times as many rows and columns as it has dofs.
MOST_ROD_ELEMENTS = 500
# Elements per bending wave of the contact's duration: the minimum, and enough for a peak.
LEAST_PER_WAVE, ENOUGH_PER_WAVE = 4, 8
# Mesh error of the peak that is warned of, and the largest that is estimated.
WORTH_SAYING, MOST_ERROR = 0.03, 0.5
THICKNESS_TOLERANCE = 1.0e-6  # difference of thicknesses that is rounding
FULL = 3  # shear order at which 9-node elements have no zero-energy modes


def check_impact(impact: model.Impact, deck: model.Deck, mesh: Mesh, findings: Findings) -> None:
    """Check a ROD segment."""
    known = 1 <= impact.node <= deck.control.numnp
    if not known:
        what = f"The impact node {impact.node} does not exist"
        message = f"{what}; the deck has nodes 1 to {deck.control.numnp}."
        findings.add("E408", message, impact.place("impact node"))
    dof = impact.place("impact dof")
    if not 1 <= impact.dof <= deck.control.ndf:
        message = f"The impact dof is {impact.dof}; it must be 1 to {deck.control.ndf}."
        findings.add("E409", message, dof, "3 is w")
    elif known and mesh.equations[impact.node - 1, impact.dof - 1] == 0:
        message = f"Dof {impact.dof} of the impact node {impact.node} is restrained."
        findings.add("E410", message, impact.place("impact node"), "a BOUN card restrains it")
    elif impact.dof > W + 1:
        message = f"The impact dof {impact.dof} is a rotation: a projectile pushes a displacement."
        findings.add("E413", message, dof, "3 is w")
    elif impact.dof != W + 1:
        message = f"The impact dof is {impact.dof}, not 3: the projectile does not push w."
        findings.add("W413", message, dof)
    if impact.velocity < 0.0:
        message = f"The impact velocity is {impact.velocity:g}; it must be positive."
        hint = "an approach is positive on this card"
        findings.add("E411", message, impact.place("impact velocity"), hint)
    elif impact.velocity == 0.0:
        why = "the projectile rests on the plate, which only FORC's loads can move"
        findings.add("W411", f"The impact velocity is 0: {why}.", impact.place("impact velocity"))


def check_projectile(projectile: model.Projectile, findings: Findings) -> None:
    """Check a PROJ segment."""
    count = projectile.elements
    if not 0 <= count <= MOST_ROD_ELEMENTS:
        must = f"0 (a rigid mass) to {MOST_ROD_ELEMENTS}"
        message = f"The projectile has {count} rod elements; it must have {must}."
        findings.add("E418", message, projectile.place("number of rod elements"))
        return
    rules = [(f"projectile's {'length' if count else 'mass'}", projectile.size, "length or mass")]
    if count:
        rules.append(("rod's modulus", projectile.modulus, "rod's Young's modulus"))
        rules.append(("rod's density", projectile.density, "rod's density"))
    for what, value, name in rules:
        if not value > 0.0:
            message = f"The {what} is {value:g}; it must be positive."
            findings.add("E419", message, projectile.place(name))
    if not count:
        return
    if not 0 <= projectile.transducer <= count + 1:
        what = f"The transducer node {projectile.transducer} does not exist"
        message = f"{what}; the rod has nodes 1 to {count + 1}."
        findings.add("E423", message, projectile.place("transducer node"), "blank is the middle")
    before = findings.error_count
    diameters = rod_diameters(projectile, findings)
    if findings.error_count > before:
        return
    missing = np.flatnonzero(np.isnan(diameters))
    if len(missing):
        message = f"Rod elements {check_mesh.ranges(missing + 1)} have no diameter."
        hint = "give the first and the last element, with an increment of 1 on the first card"
        findings.add("E422", message, projectile.place("number of rod elements"), hint)
    for record in projectile.diameters:
        if not record.diameter > 0.0:
            what = f"The diameter of rod element {record.element} is {record.diameter:g}"
            findings.add("E422", f"{what}; it must be positive.", record.place("diameter"))
    if findings.error_count > before:
        return
    rod = Rod(projectile.size, tuple(diameters.tolist()), projectile.modulus, projectile.density)
    try:
        with np.errstate(all="ignore"):
            values = np.concatenate([rod.lumped_mass(), rod.stiffness().diagonal()])
    except OverflowError:
        values = np.array([np.inf])
    if not ((values > 0.0) & np.isfinite(values)).all():
        message = "The rod's mass or stiffness is beyond the range of numbers."
        hint = "check the units of length, diameters, modulus and density"
        findings.add("E429", message, projectile.place("length or mass"), hint)


def check_shear_correction(segment: model.Shear, findings: Findings) -> None:
    """Check a SHEA segment."""
    if not segment.factor > 0.0:
        message = f"The shear correction factor is {segment.factor:g}; it must be positive."
        hint = "1 as in the report, or pi^2/12 = 0.822467"
        findings.add("E427", message, segment.place("shear correction factor"), hint)
    elif segment.factor > 1.0:
        message = f"The shear correction factor is {segment.factor:g}, more than 1."
        findings.add("W428", message, segment.place("shear correction factor"))
    if segment.equilibrium and segment.factor != 1.0:
        message = (
            f"SHEA has EQUI and the factor {segment.factor:g}: the stiffness from equilibrium is "
            "reduced once more."
        )
        hint = "leave out the factor's card; a factor is for the sum of the plies' stiffnesses"
        findings.add("W481", message, segment.place("shear correction factor"), hint)


def warn_of_the_reports_rod(deck: model.Deck, findings: Findings) -> None:
    """Say that the report's rod is assumed; warn of it in a deck of other units."""
    place, names = deck.require(model.Impact).place("impact node"), unit_names(deck)
    if not names or [in_si(name, names) for name in names] == REPORT_UNITS:
        findings.add("N414", "no PROJ: the report's steel rod (in, lbf, s) is taken", place)
        return
    rod = report_rod()
    message = (
        f"No projectile is defined: the report's steel rod is assumed, in lb, in and s whatever "
        f"the deck's units (length {rod.length:g}, diameter {rod.diameters[-1]:g}, "
        f"E {rod.modulus:g}, density {rod.density:g}, mass {rod.total_mass:.5g})."
    )
    findings.add("W414", message, place, "define the projectile in a PROJ segment")


def check_law(law: model.Indentation, findings: Findings) -> None:
    """Check an EXPE segment."""
    rules = [(law.k > 0.0, "positive")]
    if law.word == model.Indentation.ACR:
        power = law.q in (0.0, ACR_POWER)
        rules += [
            (law.alpha_p > 0.0, "positive"),
            (law.s_p == 0.0, "blank or 0 with ACR, whose equation 3-7 has no such constant"),
            (power, "blank or 2.5 with ACR, as equation 3-7 holds for no other"),
        ]
    else:
        rules += [
            (law.alpha_p >= 0.0, "0 or more"),
            (0.0 <= law.s_p < 1.0, "at least 0 and below 1"),
            (law.q > 0.0, "positive"),
        ]
    for name, value, (valid, rule) in zip(law.names(), law.values(), rules, strict=True):
        if not valid:
            findings.add("E412", f"The {name} is {value:g}; it must be {rule}.", law.place(name))


@frozen
class Resolution:
    """Resolution of an impact by the mesh."""

    # Duration of a Hertz contact on a rigid target, 2.94 (5 m v^2/4 k)^(2/5)/v: S. P.
    # Timoshenko and J. N. Goodier, Theory of Elasticity, on the impact of spheres.
    contact: float
    wave: float  # length of the bending wave of that half period, 2 pi (D/(m (pi/contact)^2))^(1/4)
    side: float  # longest side of the elements at the impact node, length
    # Estimated mesh error of the peak force, relative to it; None for elements without
    # mid-side nodes.
    error: float | None

    @property
    def elements(self) -> float:
        """Elements per bending wave."""
        return self.wave / self.side


def resolution(problem: Problem) -> Resolution | None:
    """Compare the elements at the impact node with the bending waves of the impact.

    None without an approach, or where a number overflows.
    """
    deck, mesh = problem.deck, problem.mesh
    impact, law = deck.require(model.Impact), deck.require(model.Indentation)
    if impact.velocity <= 0.0:
        return None
    laminate, mass = problem.laminate, build_projectile(deck).total_mass
    v = np.float64(impact.velocity)  # a division by zero is then infinite, not an error
    rigidity = float(min(laminate.D[0, 0], laminate.D[1, 1]))
    with np.errstate(all="ignore"):
        contact = 2.94 * (5.0 * mass * v**2 / (4.0 * law.k)) ** 0.4 / v
        wave = 2.0 * np.pi * (rigidity / (laminate.mass * (np.pi / contact) ** 2)) ** 0.25
    touching = (mesh.elements == impact.node).any(axis=1)
    side = float(longest_sides(mesh.elements[touching], mesh.coordinates).max())
    if not np.isfinite(wave):
        return None
    quadratic = bool((mesh.elements[touching, 4:8] > 0).all()) and mesh.elements.shape[1] <= 9
    shear = deck.require(model.Material).integration.shear
    # Fitted to point forces and shear strains by quadrature.
    fitted = quadratic and problem.patch is None and not problem.plate.rules.assumes_shear
    error = mesh_error(wave / side, side / laminate.thickness, shear) if fitted else None
    return Resolution(float(contact), float(wave), side, error)


def mesh_error(elements: float, slenderness: float, shear: int) -> float:
    """Estimate the relative mesh error of the peak force, within a factor of about two.

    Fitted to the peaks of 14 meshes of 8- or 9-node elements with L2 = 3, and compared with 18
    with L2 = 2, each against a mesh of 15 to 30 elements per wave: AS/3501 plates of
    100 x 100 x 1, 2 and 4 mm, and the report's plate.

    `elements` are those per bending wave of the contact's duration, `slenderness` is the side of an
    element over the thickness (under L2 = 3 a slender element locks), `shear` the order L2.
    """
    if shear < FULL:
        return 0.045 * ENOUGH_PER_WAVE / elements
    return (0.031 + 0.0011 * slenderness**2) * (ENOUGH_PER_WAVE / elements) ** 2


def said_error(error: float) -> str:
    """Text of an estimated mesh error of the peak force."""
    if error > MOST_ERROR:
        return f"mesh error of the peak above {MOST_ERROR:.0%}"
    return f"mesh error of the peak about {error:.1%}"


def check_resolution(problem: Problem, findings: Findings) -> None:
    """Warn of elements at the impact node that are too large for its bending waves."""
    found = resolution(problem)
    if found is None or found.elements >= ENOUGH_PER_WAVE:
        return
    coarse = found.elements < LEAST_PER_WAVE
    if not coarse and (found.error is None or found.error < WORTH_SAYING):
        return
    about = "" if found.error is None else f": {said_error(found.error)}"
    what = f"The mesh is {'too coarse' if coarse else 'coarse'} at the impact node"
    sides = f"{found.elements:.1f} elements of side {found.side:.3g}"
    wave = f"bending wave of the contact's duration, which is {found.wave:.3g} long"
    hint = (
        f"use {ENOUGH_PER_WAVE} elements per wave: sides up to {found.wave / ENOUGH_PER_WAVE:.2g}"
    )
    place = problem.deck.require(model.Impact).place("impact node")
    findings.add("W415", f"{what}: {sides} per {wave}{about}.", place, hint)


def check_material(material: model.Material, findings: Findings) -> None:
    """Check a MATE segment."""
    card, ply = material.integration, material.ply
    for name, order in (("bending order L1", card.bending), ("shear order L2", card.shear)):
        if not 1 <= order <= HIGHEST_ORDER:
            used = min(HIGHEST_ORDER, max(1, order))
            message = f"The {name} is {order} ; {used} is used instead."
            findings.add("W401", message, card.place(name))
    if not 1 <= abs(card.points) <= HIGHEST_ORDER:
        must = "1 to 4 (Gauss points) or -1 to -4 (nodal points)"
        message = f"The stress-point order K is {card.points}; it must be {must}."
        findings.add("E402", message, card.place("stress-point order K"))
    ratio = "Poisson's ratio NU12"
    named = zip((field.name for field in ply.fields), map(float, ply.row()), strict=True)
    wrong = [(name, value) for name, value in named if value <= 0.0 and name != ratio]
    for name, value in wrong:
        findings.add("E403", f"The {name} is {value:g}; it must be positive.", ply.place(name))
    # The square of nu12 against E1/E2, written so that no number overflows.
    if not wrong and abs(ply.nu12) >= (ply.e1 / ply.e2) ** 0.5:
        why = f"its square must stay below E1/E2 = {ply.e1 / ply.e2:g}"
        message = f"Poisson's ratio NU12 = {ply.nu12:g} is too large: {why}."
        findings.add("E404", message, ply.place(ratio))
    for position, layer in enumerate(material.layers, start=1):
        if layer.thickness <= 0.0:
            what = f"Layer {position} has the thickness {layer.thickness:g}"
            findings.add("E405", f"{what}; it must be positive.", layer.place("layer thickness"))
        if layer.number != position:
            why = "layers are stacked in the order of their cards, whatever their numbers"
            message = f"Layer {position} has the number {layer.number}: {why}."
            findings.add("W408", message, layer.place("layer"))
    thicknesses, given = [layer.thickness for layer in material.layers], card.thickness
    total, place = sum(thicknesses), card.place("total thickness")
    if given <= 0.0:
        findings.add("E406", f"The total thickness is {given:g}; it must be positive.", place)
    elif all(h > 0.0 for h in thicknesses) and abs(total - given) > THICKNESS_TOLERANCE * given:
        message = f"The layers are {total:g} thick together, the MATE card says {given:g}."
        hint = "stiffness follows the layers, inertia the card: they must agree"
        findings.add("E407", message, place, hint)


def check_allowables(card: model.Allowables, findings: Findings) -> None:
    """Check an ALLO segment."""
    for name, value in zip(("XT", "XC", "YT", "YC", "S12", "S13", "S23"), card.row(), strict=False):
        if isinstance(value, str) or not value > 0.0:
            hint = "compressive strengths are positive on this card" if name in ("XC", "YC") else ""
            message = f"The strength {name} is {value:g}; it must be positive."
            findings.add("E455", message, card.place(name), hint)
    for name, value in (("p+", card.p_plus), ("p-", card.p_minus)):
        if not 0.0 < value < 1.0:
            message = f"Puck's slope {name} is {value:g}; it must be between 0 and 1."
            findings.add("E456", message, card.place(), "a blank takes 0.35 for p+ and 0.3 for p-")
    if not abs(card.f12) < 1.0:
        message = f"F12* is {card.f12:g}; it must be between -1 and 1."
        findings.add("E456", message, card.place(), "a blank takes -0.5")


def check_delamination(card: model.Delamination, findings: Findings) -> None:
    """Check a DELA segment."""
    if not card.toughness > 0.0:
        message = f"G_IIc is {card.toughness:g}; it must be positive."
        findings.add("E457", message, card.place("G_IIc"))
    if not (card.number >= 1.0 and card.number.is_integer()):
        must = "a whole number from 1"
        message = f"The number of delaminations is {card.number:g}; it must be {must}."
        findings.add("E457", message, card.place("number of delaminations"))


def check_damping(card: model.Damping, findings: Findings) -> None:
    """Check a DAMP segment."""
    if not card.coefficient >= 0.0:
        message = f"The damping a is {card.coefficient:g}; it must not be negative."
        hint = "the amplitude of a free plate decays as exp(-a t/2)"
        findings.add("E459", message, card.place("a"), hint)


def check_patch(problem: Problem, findings: Findings) -> None:
    """Check a PATC segment on a sound mesh."""
    deck, mesh = problem.deck, problem.mesh
    card = deck.require(model.Patch)
    if card.shape not in RADIUS_PER_THICKNESS:
        message = f"`{card.shape}` is not a shape of a patch."
        hint = f"{DISC} is a uniform pressure, {HERTZ} is Hertz's"
        findings.add("E442", message, card.place("shape"), hint)
        return
    if card.radius is not None and not card.radius > 0.0:
        message = f"The radius of the patch is {card.radius:g}; it must be positive."
        hint = "a blank takes 0.327 times the thickness (HERT: 0.377)"
        findings.add("E443", message, card.place("radius c"), hint)
        return
    if (card.x is None) != (card.y is None):
        given, missing = ("y0", "x0") if card.x is None else ("x0", "y0")
        message = f"The centre of the patch has {given}, but no {missing}."
        hint = "give both coordinates, or leave both blank for the node of ROD"
        findings.add("E444", message, card.place(f"centre {missing}"), hint)
        return
    impact = deck.last(model.Impact)
    if impact is None and card.x is None:
        message = "The patch has no centre, and the deck no ROD segment."
        findings.add("E444", message, card.place(), "give x0 and y0 on the card of PATC")
        return
    if impact is not None and impact.dof != W + 1:
        message = f"With a patch the impact unknown is 3 (w), not {impact.dof}."
        findings.add("E409", message, impact.place("impact unknown"), "a pressure pushes w")
        return
    try:
        patch = problem.patch
    except PatchError as error:
        findings.add(
            "E445", f"{str(error)[0].upper()}{str(error)[1:]}.", card.place(),
            "the whole circle must be on the plate: a smaller radius, another centre, or a point "
            "force without PATC (fecm new --patch none)",
        )  # fmt: skip
        return
    if patch is None:
        return
    if held := _held(mesh, patch):
        message = f"w of {held} under the patch is restrained."
        findings.add("E445", message, card.place(), "a BOUN card restrains it")
        return
    # The default radius belongs to plate theory; few meshes resolve it, and only stresses need it.
    needed = card.radius is not None or any(macro.word == "PLYS" for macro in deck.macros)
    at = np.array([[patch.x, patch.y]])
    blocks = element_blocks(mesh.elements, mesh.coordinates)
    here = np.concatenate([block.rows[locate(block, at)[0]] for block in blocks])
    side = float(longest_sides(mesh.elements[here], mesh.coordinates).max(initial=0.0))
    if needed and patch.radius < side * (1.0 - 1e-9):
        message = (
            f"The radius of the patch, {patch.radius:.4g}, is smaller than the side of its "
            f"element, {side:.4g}: strains and stresses near the patch depend on the mesh, and "
            "the peak force is too high (measured: up to 0.7 % at half the side, 1.5 to 6 % at a "
            "quarter)."
        )
        hint = "refine the mesh at the patch; fecm check --mesh-error shows the effect on the peak"
        findings.add("W447", message, card.place("radius c"), hint)


def _held(mesh: Mesh, patch: ContactPatch) -> str:
    """Name a node or a side under a patch whose w is restrained; empty if there is none."""
    held = mesh.codes[:, W] != 0
    centre = np.array([patch.x, patch.y])
    near = np.hypot(*(mesh.coordinates - centre).T) <= patch.radius
    if (held & near).any():
        return f"node {np.argmax(held & near) + 1}"
    for family in element_blocks(mesh.elements, mesh.coordinates):
        local = np.stack([family.shape.xi, family.shape.eta], axis=1)[family.present]
        for a in range(family.shape.corners):
            b = (a + 1) % family.shape.corners
            (x, y), (from_x, from_y) = local[b] - local[a], (local - local[a]).T
            on_side = np.abs(x * from_y - y * from_x) < 1e-9
            nodes = family.nodes[held[family.nodes[:, on_side]].all(axis=1)]
            start, end = mesh.coordinates[nodes[:, a]], mesh.coordinates[nodes[:, b]]
            side = end - start
            t = ((centre - start) * side).sum(axis=1) / (side**2).sum(axis=1)
            nearest = start + np.clip(t, 0.0, 1.0)[:, None] * side
            under = np.hypot(*(nearest - centre).T) <= patch.radius
            if under.any():
                first, last = nodes[under][0, [a, b]] + 1
                return f"the side from node {first} to node {last}"
    return ""


# Checks of a segment by itself.
CHECKS: tuple[tuple[type[model.Segment], Callable[[Any, Findings], None]], ...] = (
    (model.Indentation, check_law), (model.Allowables, check_allowables),
    (model.Delamination, check_delamination), (model.Damping, check_damping),
    (model.Projectile, check_projectile), (model.Shear, check_shear_correction),
    (model.Units, check_unit_names),
)  # fmt: skip
