"""Checks of ROD, EXPE, PROJ, SHEA and GAGE, and whether the mesh resolves the impact."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fecm._frozen import frozen
from fecm.deck.findings import Findings
from fecm.deck.model import Deck, Gages, Impact, Indentation, Material, Patch, Projectile, Shear
from fecm.deck.units import KNOWN, in_si, unit_names
from fecm.mechanics import element_groups
from fecm.mechanics.contact_law import ACR_POWER
from fecm.mechanics.locate import locate
from fecm.mechanics.mesh import Mesh
from fecm.mechanics.projectile import Rod, report_rod
from fecm.problem import check_mesh
from fecm.problem.build import Problem, build_projectile
from fecm.problem.generate import rod_diameters

W = 3
# One inch, pound and second in m, N and s.
REPORT_UNITS = [KNOWN["length"]["in"], KNOWN["force"]["lbf"], KNOWN["time"]["s"]]
# A rod's step is a full matrix of three times as many rows and columns as it has dofs.
MOST_ROD_ELEMENTS = 500
# Each gage is compared with every element.
MOST_GAGES, MOST_GAGE_PAIRS = 10_000, 10**8
# Elements per bending wave of the contact's duration: the minimum, and enough for a peak.
LEAST_PER_WAVE, ENOUGH_PER_WAVE = 4, 8
# Mesh error of the peak that is warned of, and the largest that is estimated.
WORTH_SAYING, MOST_ERROR = 0.03, 0.5
# Shear order at which 9-node elements have no zero-energy modes.
FULL = 3


def check_impact(impact: Impact, deck: Deck, mesh: Mesh, findings: Findings) -> None:
    """Check a ROD segment."""
    known = 1 <= impact.node <= deck.control.numnp
    if not known:
        findings.add(
            "E408",
            f"The impact node {impact.node} does not exist; the deck has nodes 1 to "
            f"{deck.control.numnp}.",
            impact.place("impact node"),
        )
    dof = impact.place("impact dof")
    if not 1 <= impact.dof <= deck.control.ndf:
        message = f"The impact dof is {impact.dof}; it must be 1 to {deck.control.ndf}."
        findings.add("E409", message, dof, "3 is w")
    elif known and mesh.equations[impact.node - 1, impact.dof - 1] == 0:
        findings.add(
            "E410",
            f"Dof {impact.dof} of the impact node {impact.node} is restrained.",
            impact.place("impact node"),
            "a BOUN card restrains it",
        )
    elif impact.dof > W:
        findings.add(
            "E413",
            f"The impact dof {impact.dof} is a rotation: a projectile pushes a displacement.",
            dof,
            "3 is w",
        )
    elif impact.dof != W:
        message = f"The impact dof is {impact.dof}, not 3: the projectile does not push w."
        findings.add("W413", message, dof)
    if impact.velocity < 0.0:
        message = f"The impact velocity is {impact.velocity:g}; it must be positive."
        hint = "an approach is positive on this card"
        findings.add("E411", message, impact.place("impact velocity"), hint)
    elif impact.velocity == 0.0:
        findings.add(
            "W411",
            "The impact velocity is 0: the projectile rests on the plate, which only FORC's loads "
            "can move.",
            impact.place("impact velocity"),
        )


def check_projectile(projectile: Projectile, findings: Findings) -> None:
    """Check a PROJ segment."""
    count = projectile.elements
    if not 0 <= count <= MOST_ROD_ELEMENTS:
        findings.add(
            "E418",
            f"The projectile has {count} rod elements; it must have 0 (a rigid mass) to "
            f"{MOST_ROD_ELEMENTS}.",
            projectile.place("number of rod elements"),
        )
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
        findings.add(
            "E423",
            f"The transducer node {projectile.transducer} does not exist; the rod has nodes 1 to "
            f"{count + 1}.",
            projectile.place("transducer node"),
            "blank is the middle",
        )
    before = findings.error_count
    diameters = rod_diameters(projectile, findings)
    if findings.error_count > before:
        return
    missing = np.flatnonzero(np.isnan(diameters))
    if len(missing):
        findings.add(
            "E422", f"Rod elements {check_mesh.ranges(missing + 1)} have no diameter.",
            projectile.place("number of rod elements"),
            "give the first and the last element, with an increment of 1 on the first card",
        )  # fmt: skip
    for record in projectile.diameters:
        if not record.diameter > 0.0:
            findings.add(
                "E422", f"The diameter of rod element {record.element} is {record.diameter:g}; it "
                "must be positive.", record.place("diameter"),
            )  # fmt: skip
    if findings.error_count == before and not _is_computable(projectile, diameters):
        findings.add(
            "E429",
            "The rod's mass or stiffness is beyond the range of numbers.",
            projectile.place("length or mass"),
            "check the units of length, diameters, modulus and density",
        )


def _is_computable(projectile: Projectile, diameters: NDArray[np.float64]) -> bool:
    """Whether mass and stiffness of every dof of a rod are positive and finite."""
    rod = Rod(projectile.size, tuple(diameters.tolist()), projectile.modulus, projectile.density)
    try:
        with np.errstate(all="ignore"):
            values = np.concatenate([rod.lumped_mass(), rod.stiffness().diagonal()])
    except OverflowError:
        return False
    return bool(((values > 0.0) & np.isfinite(values)).all())


def check_gages(segment: Gages, mesh: Mesh, deck: Deck, findings: Findings) -> None:
    """Check a GAGE segment on a mesh without errors."""
    count = len(segment.records)
    if count > MOST_GAGES or count * len(mesh.elements) > MOST_GAGE_PAIRS:
        findings.add(
            "E012",
            f"{count} gages on {len(mesh.elements)} elements are too many: at most {MOST_GAGES} "
            f"gages and {MOST_GAGE_PAIRS:.0e} pairs of gage and element are allowed.",
            segment.place(),
        )
        return
    families = element_groups.element_blocks(mesh.elements, mesh.coordinates)
    seen: set[int] = set()
    for record in segment.records:
        if record.number in seen:
            findings.add(
                "E425", f"Gage {record.number} is defined twice.", record.place("gage"),
                "give each gage its own number",
            )  # fmt: skip
        seen.add(record.number)
        point = np.array([[record.x, record.y]])
        if not any(len(locate(family, point)[0]) for family in families):
            findings.add(
                "E424",
                f"Gage {record.number} at ({record.x:g}, {record.y:g}) is not on the plate.",
                record.place("gage's x"),
            )
        material = deck.last(Material)
        half = 0.0 if material is None else material.integration.thickness / 2.0
        if material is not None and abs(record.z) > half * (1.0 + 1e-9):
            findings.add(
                "W426",
                f"Gage {record.number} at z = {record.z:g} is outside the laminate, whose faces "
                f"are at {half:g} from the mid-plane.", record.place("gage's z"),
            )  # fmt: skip


def check_gages_under_force(problem: Problem, findings: Findings) -> None:
    """Warn of gages nearer than the thickness to the impact node of a point force."""
    segment = problem.deck.last(Gages)
    if segment is None or problem.deck.has(Patch):
        return
    x, y = problem.mesh.coordinates[problem.deck.require(Impact).node - 1]
    for record in segment.records:
        distance = float(np.hypot(record.x - x, record.y - y))
        if distance < problem.laminate.thickness * (1.0 - 1e-9):
            findings.add(
                "W452",
                f"Gage {record.number} is {distance:.3g} from the impact node: strains at the "
                "impact node of a point force depend on the mesh.", record.place("gage's x"),
                f"put it at least the thickness {problem.laminate.thickness:.3g} away, or give the "
                "contact force an area by a PATC segment",
            )  # fmt: skip


def check_shear_correction(segment: Shear, findings: Findings) -> None:
    """Check a SHEA segment."""
    if not segment.factor > 0.0:
        findings.add(
            "E427", f"The shear correction factor is {segment.factor:g}; it must be positive.",
            segment.place("shear correction factor"), "1 as in the report, or pi^2/12 = 0.822467",
        )  # fmt: skip
    elif segment.factor > 1.0:
        findings.add(
            "W428", f"The shear correction factor is {segment.factor:g}, more than 1.",
            segment.place("shear correction factor"),
        )  # fmt: skip


def warn_of_the_reports_rod(deck: Deck, findings: Findings) -> None:
    """Say that the report's rod is assumed; warn of it in a deck of other units."""
    place, names = deck.require(Impact).place("impact node"), unit_names(deck)
    if not names or [in_si(name, names) for name in names] == REPORT_UNITS:
        findings.add("N414", "no PROJ: the report's steel rod (in, lbf, s) is taken", place)
        return
    rod = report_rod()
    findings.add(
        "W414",
        f"No projectile is defined: the report's steel rod is assumed, in lb, in and s whatever "
        f"the deck's units (length {rod.length:g}, diameter {rod.diameters[-1]:g}, "
        f"E {rod.modulus:g}, density {rod.density:g}, mass {rod.total_mass:.5g}).",
        place,
        "define the projectile in a PROJ segment",
    )


def check_law(law: Indentation, findings: Findings) -> None:
    """Check an EXPE segment."""
    if law.word == Indentation.ACR:
        rules = (
            (law.k > 0.0, "positive"),
            (law.alpha_p > 0.0, "positive"),
            (law.s_p == 0.0, "blank or 0 with ACR, whose equation 3-7 has no such constant"),
            (
                law.q in (0.0, ACR_POWER),
                "blank or 2.5 with ACR, as equation 3-7 holds for no other",
            ),
        )
    else:
        rules = (
            (law.k > 0.0, "positive"),
            (law.alpha_p >= 0.0, "0 or more"),
            (0.0 <= law.s_p < 1.0, "at least 0 and below 1"),
            (law.q > 0.0, "positive"),
        )
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
    impact, law = deck.require(Impact), deck.require(Indentation)
    if impact.velocity <= 0.0:
        return None
    laminate, mass = problem.laminate, build_projectile(deck).total_mass
    v = np.float64(impact.velocity)  # a division by zero is then infinite, not an error
    contact = 2.94 * (5.0 * mass * v**2 / (4.0 * law.k)) ** 0.4 / v
    rigidity = float(min(laminate.D[0, 0], laminate.D[1, 1]))
    wave = 2.0 * np.pi * (rigidity / (laminate.mass * (np.pi / contact) ** 2)) ** 0.25
    touching = (mesh.elements == impact.node).any(axis=1)
    side = float(element_groups.longest_sides(mesh.elements[touching], mesh.coordinates).max())
    if not np.isfinite(wave):
        return None
    quadratic = bool((mesh.elements[touching, 4:8] > 0).all()) and mesh.elements.shape[1] <= 9
    shear = deck.require(Material).integration.shear
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
    findings.add(
        "W415",
        f"The mesh is {'too coarse' if coarse else 'coarse'} at the impact node: "
        f"{found.elements:.1f} elements of side {found.side:.3g} per bending wave of the contact's "
        f"duration, which is {found.wave:.3g} long{about}.",
        problem.deck.require(Impact).place("impact node"),
        f"use {ENOUGH_PER_WAVE} elements per wave: sides up to {found.wave / ENOUGH_PER_WAVE:.2g}",
    )
