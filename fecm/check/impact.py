"""Checks of ROD and EXPE, and whether the mesh resolves the impact."""

from __future__ import annotations

import numpy as np

from fecm.deck.findings import Findings
from fecm.deck.model import Deck, Impact, Indentation, Material
from fecm.laminate import laminate_of
from fecm.mesh import Mesh
from fecm.parts import build_rod

W = 3
# Elements that a bending wave of the contact's duration needs.
ELEMENTS_A_WAVE = 4


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
    if not 1 <= impact.dof <= deck.control.ndf:
        findings.add(
            "E409",
            f"The impact unknown is {impact.dof}; it must be 1 to {deck.control.ndf}.",
            impact.place("impact unknown"),
            "3 is w",
        )
    elif known and mesh.equations[impact.node - 1, impact.dof - 1] == 0:
        findings.add(
            "E410",
            f"Unknown {impact.dof} of the impact node {impact.node} is restrained.",
            impact.place("impact node"),
            "a BOUN card restrains it",
        )
    elif impact.dof != W:
        findings.add(
            "W413",
            f"The impact unknown is {impact.dof}, not 3: the projectile does not push w.",
            impact.place("impact unknown"),
        )
    if impact.velocity < 0.0:
        findings.add(
            "W411",
            "The impact velocity is negative: the projectile flies away from the plate.",
            impact.place("impact velocity"),
            "an approach is positive on this card",
        )
    elif impact.velocity == 0.0:
        findings.add(
            "W411", "The impact velocity is 0: nothing hits.", impact.place("impact velocity")
        )


def check_projectile(impact: Impact, findings: Findings) -> None:
    """Warn that the report's rod is assumed, in the report's units."""
    rod = build_rod()
    findings.add(
        "W414",
        f"No projectile is given: the report's steel rod is assumed, in lb, in and s whatever the "
        f"deck's units (length {rod.length:g}, diameter {rod.diameters[-1]:g}, E {rod.modulus:g}, "
        f"density {rod.density:g}, mass {rod.total_mass:.5g}).",
        impact.place("impact node"),
    )


def check_law(law: Indentation, findings: Findings) -> None:
    """Check an EXPE segment."""
    for name, value, sound, rule in (
        ("contact coefficient k", law.k, law.k > 0.0, "positive"),
        ("critical indentation alpha_p", law.alpha_p, law.alpha_p >= 0.0, "0 or more"),
        ("constant s_p", law.s_p, 0.0 <= law.s_p < 1.0, "at least 0 and below 1"),
        ("unloading power q", law.q, law.q > 0.0, "positive"),
    ):
        if not sound:
            findings.add("E412", f"The {name} is {value:g}; it must be {rule}.", law.place(name))


def check_resolution(deck: Deck, mesh: Mesh, findings: Findings) -> None:
    """Warn of elements at the impact point that are too large for the waves it sends out.

    The measure is the bending wave whose half period is the Hertz contact on a rigid target,
    2.94 (5 m v^2/4 k)^(2/5)/v.
    """
    impact, law = deck.need(Impact), deck.need(Indentation)
    if impact.velocity <= 0.0:
        return
    plate, mass = laminate_of(deck.need(Material)), build_rod().total_mass
    v = np.float64(impact.velocity)  # a division by zero is then infinite, not an error
    contact = 2.94 * (5.0 * mass * v**2 / (4.0 * law.k)) ** 0.4 / v
    rigidity = float(min(plate.D[0, 0], plate.D[1, 1]))
    wave = 2.0 * np.pi * (rigidity / (plate.mass * (np.pi / contact) ** 2)) ** 0.25
    touching = (mesh.elements == impact.node).any(axis=1)
    nodes = mesh.elements[touching, :4]
    nodes = np.where(nodes == 0, nodes[:, :1], nodes)  # a triangle returns to its first corner
    corners = mesh.coordinates[nodes - 1]
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    if np.isfinite(wave) and sides.max() > wave / ELEMENTS_A_WAVE:
        findings.add(
            "W415",
            f"The mesh is coarse at the impact point: sides of {sides.max():.3g} where the bending "
            f"wave of the contact's duration ({contact:.3g}) is {wave:.3g} long.",
            impact.place("impact node"),
            f"give a wave {ELEMENTS_A_WAVE} elements or more: sides up to "
            f"{wave / ELEMENTS_A_WAVE:.2g}",
        )
