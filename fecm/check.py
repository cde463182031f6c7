"""Checks of a deck that was read: a plate that can be hit, a program that can run.

Findings about what a segment lacks are held back where a card of that segment could not be read,
so that one slip makes one finding.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fecm import plate
from fecm.deck.findings import Findings, Place
from fecm.deck.model import (
    Coordinates,
    Deck,
    Elements,
    Impact,
    Indentation,
    Material,
    Segment,
)
from fecm.deck.reader import MACROS, Problem
from fecm.elements.quadrature import HIGHEST_ORDER, Rule, gauss, nodal
from fecm.mesh import Mesh, generate, place_of_element
from fecm.program import Body, compile_program

CORNERS = 4
# Findings of one kind about nodes or elements are gathered beyond this number.
SHOWN = 4
THICKNESS_TOLERANCE = 1.0e-6


@dataclass(frozen=True)
class Checked:
    """A problem that was checked.

    Attributes
    ----------
    deck : Deck
    mesh : Mesh
    program : tuple
        The macro program with its loops nested.
    """

    deck: Deck
    mesh: Mesh
    program: Body


def check(problem: Problem, findings: Findings) -> Checked | None:
    """Check a problem.

    Parameters
    ----------
    problem : Problem
        As the reader left it.
    findings : Findings
        Receives what is wrong.

    Returns
    -------
    Checked or None
        None where the problem has no control card to check anything by.
    """
    deck = problem.deck
    if deck is None:
        return None
    before = len(findings.errors)
    program = compile_program(deck.macros, findings)
    if len(findings.errors) > before:
        problem.unsound.add(MACROS)
    needed: list[type[Segment]] = [Coordinates, Elements, Material, Impact, Indentation]
    for kind in needed:
        if not deck.has(kind) and kind.keyword not in problem.unsound:
            findings.add(
                "E203", f"The deck has no {kind.keyword} segment.", deck.place(),
                "it belongs before END",
            )  # fmt: skip
    before = len(findings.errors)
    mesh = generate(deck, findings)
    generated = len(findings.errors) == before
    if (material := deck.last(Material)) is not None:
        _check_material(material, findings)
    sound = generated and not problem.unsound & {"COOR", "ELEM"}
    if sound and deck.has(Coordinates) and deck.has(Elements):
        _check_mesh(deck, mesh, findings)
    if (impact := deck.last(Impact)) is not None:
        _check_impact(impact, deck, mesh, findings)
    if (law := deck.last(Indentation)) is not None:
        _check_law(law, findings)
    return Checked(deck, mesh, program)


def ranges(numbers: Sequence[int] | NDArray[np.int_]) -> str:
    """Write ascending numbers shortly: ``3, 7-9, 12``."""
    parts: list[str] = []
    array = np.asarray(numbers)
    for run in np.split(array, np.flatnonzero(np.diff(array) != 1) + 1):
        parts.append(str(run[0]) if len(run) == 1 else f"{run[0]}-{run[-1]}")
    if len(parts) > 8:
        parts = [*parts[:8], "..."]
    return ", ".join(parts)


def rules(material: Material) -> tuple[Rule, Rule, Rule]:
    """Quadrature of a MATE card: bending (L1), transverse shear (L2), stored strains (K).

    L1 and L2 outside 1 to 4 count as the nearest of these, as in the listing.

    Raises
    ------
    ValueError
        If K is 0 or beyond 4.
    """
    card = material.integration
    bending, shear = (min(HIGHEST_ORDER, max(1, n)) for n in (card.bending, card.shear))
    points = gauss(card.points) if card.points > 0 else nodal(-card.points)
    return gauss(bending), gauss(shear), points


def _check_material(material: Material, findings: Findings) -> None:
    card, ply = material.integration, material.ply
    for name, order in (("bending order L1", card.bending), ("shear order L2", card.shear)):
        if not 1 <= order <= HIGHEST_ORDER:
            used = min(HIGHEST_ORDER, max(1, order))
            findings.add("W401", f"The {name} is {order} and is taken as {used}.", card.place(name))
    if not 1 <= abs(card.points) <= HIGHEST_ORDER:
        findings.add(
            "E402",
            f"The stress-point order K is {card.points}; it must be 1 to 4 (Gauss points) or "
            "-1 to -4 (nodal points).",
            card.place("stress-point order K"),
        )
    sound = True
    for name, value in (
        ("mass density", ply.density),
        ("Young's modulus E1", ply.e1),
        ("Young's modulus E2", ply.e2),
        ("shear modulus G12", ply.g12),
        ("shear modulus G13", ply.g13),
        ("shear modulus G23", ply.g23),
    ):
        if value <= 0.0:
            sound = False
            findings.add("E403", f"The {name} is {value:g}; it must be positive.", ply.place(name))
    if sound and ply.nu12**2 >= ply.e1 / ply.e2:
        findings.add(
            "E404",
            f"Poisson's ratio NU12 = {ply.nu12:g} is too large: its square must stay below "
            f"E1/E2 = {ply.e1 / ply.e2:g}.",
            ply.place("Poisson's ratio NU12"),
        )
    thick = True
    for layer in material.layers:
        if layer.thickness <= 0.0:
            thick = False
            findings.add(
                "E405",
                f"Layer {layer.number} has the thickness {layer.thickness:g}; it must be positive.",
                layer.place("layer thickness"),
            )
    total = sum(layer.thickness for layer in material.layers)
    if card.thickness <= 0.0:
        findings.add(
            "E406",
            f"The total thickness is {card.thickness:g}; it must be positive.",
            card.place("total thickness"),
        )
    elif thick and abs(total - card.thickness) > THICKNESS_TOLERANCE * card.thickness:
        findings.add(
            "E407",
            f"The layers are {total:g} thick together, the MATE card says {card.thickness:g}.",
            card.place("total thickness"),
        )


def _check_mesh(deck: Deck, mesh: Mesh, findings: Findings) -> None:
    before = len(findings.errors)
    _check_elements(deck, mesh, findings)
    if len(findings.errors) > before:
        return  # what an element lacks would be said again of its nodes
    missing = np.flatnonzero(~mesh.given)
    if len(missing):
        findings.add(
            "E306", f"{_nodes(missing)} without coordinates.", deck.need(Coordinates).place()
        )
    unused = np.flatnonzero(mesh.given & ~mesh.used)
    if len(unused):
        findings.add("E307", f"{_nodes(unused)} in no element.", deck.need(Elements).place())
    if not len(missing):
        _check_jacobians(deck, mesh, findings)
    if not mesh.number_of_equations:
        findings.add("E311", "Every unknown of the plate is restrained.", deck.place())


def _nodes(rows: NDArray[np.intp]) -> str:
    numbers = rows + 1
    return f"Node {numbers[0]} is" if len(rows) == 1 else f"Nodes {ranges(numbers)} are"


def _few(
    findings: Findings, code: str, rows: NDArray[np.intp], deck: Deck, what: str, hint: str = ""
) -> None:
    """Report an error of several elements: one by one while they are few."""
    if len(rows) <= SHOWN:
        for row in rows:
            number = int(row) + 1
            findings.add(code, f"Element {number} {what}.", place_of_element(deck, number), hint)
    else:
        number = int(rows[0]) + 1
        place: Place | None = place_of_element(deck, number)
        findings.add(code, f"{len(rows)} elements, {ranges(rows + 1)}: each {what}.", place, hint)


def _check_elements(deck: Deck, mesh: Mesh, findings: Findings) -> None:
    elements, numnp = mesh.elements, len(mesh.coordinates)
    unknown = (elements < 0) | (elements > numnp)
    empty = ~(elements != 0).any(axis=1)
    _few(findings, "E308", np.flatnonzero(empty), deck, "has no nodes")
    _few(
        findings, "E309", np.flatnonzero(unknown.any(axis=1)), deck,
        f"has a node outside 1 to {numnp}",
        "its own card or the increment of the card before it is wrong",
    )  # fmt: skip
    absent = (elements[:, :CORNERS] == 0).any(axis=1) & ~empty
    _few(findings, "E310", np.flatnonzero(absent), deck, "lacks one of its four corners")
    ordered = np.sort(elements, axis=1)
    repeated = ((ordered[:, 1:] == ordered[:, :-1]) & (ordered[:, 1:] != 0)).any(axis=1)
    _few(findings, "E312", np.flatnonzero(repeated), deck, "has a node twice")


def _check_jacobians(deck: Deck, mesh: Mesh, findings: Findings) -> None:
    material = deck.last(Material)
    if material is None or not 1 <= abs(material.integration.points) <= HIGHEST_ORDER:
        return
    bad = np.zeros(len(mesh.elements), dtype=bool)
    for family in plate.families(mesh.elements, mesh.coordinates):
        for block in family.blocks(4096):
            for rule in rules(material):
                determinants = plate.jacobian_determinants(block, rule)
                bad[block.rows] |= ~(determinants > 0.0).all(axis=1)
    _few(
        findings, "E313", np.flatnonzero(bad), deck,
        "has a Jacobian that is zero or negative",
        "corners run counter-clockwise, mid-side 5 lies between corners 1 and 2",
    )  # fmt: skip


def _check_impact(impact: Impact, deck: Deck, mesh: Mesh, findings: Findings) -> None:
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
            f"The impact unknown is {impact.dof}; it must be 1 to {deck.control.ndf} (3 is w).",
            impact.place("impact unknown"),
        )
    elif known and mesh.equations[impact.node - 1, impact.dof - 1] == 0:
        findings.add(
            "E410",
            f"Unknown {impact.dof} of the impact node {impact.node} is restrained.",
            impact.place("impact node"),
            "a BOUN card restrains it",
        )
    if impact.velocity < 0.0:
        findings.add(
            "W411",
            "The impact velocity is negative: the projectile flies away from the plate.",
            impact.place("impact velocity"),
            "an approach is positive on this card",
        )


def _check_law(law: Indentation, findings: Findings) -> None:
    for name, value, sound, rule in (
        ("contact coefficient k", law.k, law.k > 0.0, "positive"),
        ("critical indentation alpha_p", law.alpha_p, law.alpha_p >= 0.0, "0 or more"),
        ("constant s_p", law.s_p, 0.0 <= law.s_p < 1.0, "at least 0 and below 1"),
        ("unloading power q", law.q, law.q > 0.0, "positive"),
    ):
        if not sound:
            findings.add("E412", f"The {name} is {value:g}; it must be {rule}.", law.place(name))
