"""Checks of the generated mesh: nodes, elements, their shape, their mass."""

from __future__ import annotations

from typing import Any

import numpy as np

from fecm import plate
from fecm.check import gather
from fecm.deck.findings import Findings
from fecm.deck.model import Coordinates, Deck, Elements, Material
from fecm.elements.quadrature import HIGHEST_ORDER
from fecm.mesh import Mesh
from fecm.parts import rules

CORNERS = 4
W = 2


def check_mesh(deck: Deck, mesh: Mesh, findings: Findings) -> None:
    """Check nodes and elements, each only if what it stands on is sound."""
    before = len(findings.errors)
    _check_elements(deck, mesh, findings)
    if len(findings.errors) > before:
        return  # what an element lacks would be said again of its nodes
    missing = np.flatnonzero(~mesh.given)
    if len(missing):
        place = deck.need(Coordinates).place()
        findings.add("E306", f"{gather.nodes(missing)} without coordinates.", place)
    unused = np.flatnonzero(mesh.given & ~mesh.used)
    if len(unused):
        place = deck.need(Elements).place()
        findings.add("E307", f"{gather.nodes(unused)} in no element.", place)
    if not mesh.number_of_equations:
        findings.add("E311", "Every unknown of the plate is restrained.", deck.place())
    if not len(missing):
        _check_coincidence(deck, mesh, findings)
        _check_shapes(deck, mesh, findings)


def _check_elements(deck: Deck, mesh: Mesh, findings: Findings) -> None:
    elements, numnp = mesh.elements, len(mesh.coordinates)

    def report(code: str, wrong: Any, what: str, hint: str = "") -> None:
        gather.elements(findings, code, np.flatnonzero(wrong), deck, what, hint)

    empty = ~(elements != 0).any(axis=1)
    unknown = (elements < 0) | (elements > numnp)
    absent = (elements[:, :CORNERS] == 0).any(axis=1) & ~empty
    ordered = np.sort(elements, axis=1)
    repeated = ((ordered[:, 1:] == ordered[:, :-1]) & (ordered[:, 1:] != 0)).any(axis=1)
    report("E308", empty, "has no nodes")
    report(
        "E309", unknown.any(axis=1), f"has a node outside 1 to {numnp}",
        "its own card or the increment of the card before it is wrong",
    )  # fmt: skip
    report("E310", absent, "lacks one of its four corners")
    report("E312", repeated, "has a node twice")


def _check_coincidence(deck: Deck, mesh: Mesh, findings: Findings) -> None:
    """Warn of nodes in the same place: the plate is cut there."""
    order = np.lexsort(mesh.coordinates.T)
    sorted_places = mesh.coordinates[order]
    same = (sorted_places[1:] == sorted_places[:-1]).all(axis=1)
    if same.any():
        rows = np.unique(np.concatenate([order[1:][same], order[:-1][same]]))
        findings.add(
            "W314",
            f"{gather.nodes(rows)} in the place of another node: the plate is cut there.",
            deck.need(Coordinates).place(),
        )


def _check_shapes(deck: Deck, mesh: Mesh, findings: Findings) -> None:
    """Jacobians at every point that is used, and the lumped masses."""
    material = deck.last(Material)
    if material is None or not 1 <= abs(material.integration.points) <= HIGHEST_ORDER:
        return
    bending, shear, points = rules(material)
    folded = np.zeros(len(mesh.elements), dtype=bool)
    massless = np.zeros(len(mesh.elements), dtype=bool)
    quadratic = False
    with np.errstate(all="ignore"):
        for family in plate.families(mesh.elements, mesh.coordinates):
            quadratic |= bool(family.present[-1])
            for block in family.blocks(4096):
                for rule in (bending, shear, points):
                    found = plate.jacobian_determinants(block, rule)
                    folded[block.rows] |= ~(found > 0.0).all(axis=1)
                values = plate.local_shape_functions(block, bending)[0]
                massless[block.rows] |= bool((np.square(values).sum(axis=0) < 1e-12).any())
    gather.elements(
        findings, "E313", np.flatnonzero(folded), deck, "has a Jacobian that is zero or negative",
        "corners run counter-clockwise, mid-side 5 lies between corners 1 and 2",
    )  # fmt: skip
    card = material.integration
    if massless.any():
        rows = np.flatnonzero(massless)
        findings.add(
            "E315",
            f"Under the bending order L1 = {card.bending} nodes of {len(rows)} elements "
            f"({gather.ranges(rows + 1)}) have no mass.",
            card.place("bending order L1"),
            "elements with mid-side nodes take L1 = 2 or more",
        )
    supported = bool((mesh.equations[:, W] == 0).any())
    if quadratic and len(shear.xi) < len(points.xi) and len(shear.xi) < 9 and not supported:
        findings.add(
            "W316",
            f"The shear order L2 = {card.shear} leaves 9-node elements a motion without energy, "
            "and nothing supports the plate's w.",
            card.place("shear order L2"),
            "take L2 = 3",
        )
