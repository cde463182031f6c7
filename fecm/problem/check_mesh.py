"""Checks of the generated mesh: nodes, elements, their shape, their mass."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fecm.deck import model
from fecm.deck.findings import Findings, Place
from fecm.mechanics import assumed_shear, interpolation
from fecm.mechanics.elements import CUBIC, HIGHEST_ORDER, TRIANGLE
from fecm.mechanics.mesh import ElementBlock, Mesh, distinct, element_blocks, holds_the_plane
from fecm.problem.build import Problem, has_assumed_shear, rules
from fecm.problem.generate import place_of_element

SHOWN = 4  # findings of one kind about elements are grouped beyond this number of cards
RUNS = 8  # largest number of runs of numbers in a message
LISTING_LAYERS = 25  # layers that the listing's arrays hold (CNPD: QBR(3,3,25), TH(25))
ANOTHER_MODE = "run the deck in report mode"
CORNERS = TRIANGLE.corners
Blocks = list[ElementBlock]
W, THETA_X = 2, 3
FEW_LOADED = 4  # loaded nodes up to this number are single forces, more are a pressure
# Distance of a mid-side node from its place along the side, over the side's length.
OFF_PLACE = 0.05
FOUR_NODES, NINE_NODES = "4-node elements", "9-node elements"
HOURGLASS = "E321"


def ranges(numbers: Sequence[int] | NDArray[np.int_]) -> str:
    """Write ascending numbers as runs: ``3, 7-9, 12``."""
    array = np.asarray(numbers)
    runs = np.split(array, np.flatnonzero(np.diff(array) != 1) + 1)
    parts = [str(run[0]) if len(run) == 1 else f"{run[0]}-{run[-1]}" for run in runs[:RUNS]]
    return ", ".join([*parts, "..."] if len(runs) > RUNS else parts)


def describe_nodes(rows: NDArray[np.intp]) -> str:
    """Beginning of a sentence about the nodes in some rows: ``Nodes 3, 7-9 are``."""
    return f"Node {rows[0] + 1} is" if len(rows) == 1 else f"Nodes {ranges(rows + 1)} are"


def describe_elements(rows: NDArray[np.intp]) -> str:
    """Number and list of the elements in some rows: ``3 elements (1, 4-5)``."""
    count = len(rows)
    return f"{count} element{'' if count == 1 else 's'} ({ranges(rows + 1)})"


def report_elements(
    findings: Findings, code: str, rows: NDArray[Any], deck: model.Deck, what: str, hint: str = ""
) -> None:
    """Report an error of elements, one finding per card; one for all beyond SHOWN cards."""
    by_card: dict[Place | None, list[int]] = {}
    for row in rows[: 100 * SHOWN].tolist():
        by_card.setdefault(place_of_element(deck, row + 1), []).append(row + 1)
    if len(by_card) > SHOWN or len(rows) > 100 * SHOWN:
        place = place_of_element(deck, int(rows[0]) + 1)
        findings.add(code, f"{len(rows)} elements ({ranges(rows + 1)}): each {what}.", place, hint)
        return
    for place, numbers in by_card.items():
        one = len(numbers) == 1
        which = f"Element {numbers[0]}" if one else f"Elements {ranges(numbers)}: each"
        findings.add(code, f"{which} {what}.", place, hint)


def check_mesh(deck: model.Deck, mesh: Mesh, findings: Findings, *, listing: bool = False) -> None:
    """Check nodes, and the shapes of elements with valid nodes; listing mode takes L1 for L2."""
    missing = np.flatnonzero(~mesh.given)
    if len(missing):
        place = deck.require(model.Coordinates).place()
        findings.add("E306", f"{describe_nodes(missing)} without coordinates.", place)
    unused = np.flatnonzero(mesh.given & ~mesh.used)
    if len(unused):
        place = deck.require(model.Elements).place()
        findings.add("E307", f"{describe_nodes(unused)} in no element.", place)
    if not mesh.number_of_equations:
        findings.add("E311", "Every dof of the plate is restrained.", deck.place())
    if not len(missing):
        _check_coincidence(deck, mesh, findings)
        _check_shapes(deck, mesh, findings, listing=listing)


def check_elements(deck: model.Deck, mesh: Mesh, findings: Findings) -> bool:
    """Whether the node numbers of all elements are valid, whatever the coordinates are."""
    elements, numnp = mesh.elements, len(mesh.coordinates)
    before = findings.error_count

    def report(code: str, wrong: Any, what: str, hint: str = "") -> None:
        report_elements(findings, code, np.flatnonzero(wrong), deck, what, hint)

    empty = ~(elements != 0).any(axis=1)
    unknown = (elements < 0) | (elements > numnp)
    # Nodes after the third make a quadrilateral, which has a fourth corner.
    pointed = ~(elements[:, CORNERS:] != 0).any(axis=1)
    three_missing = (elements[:, :CORNERS] == 0).any(axis=1)
    four_missing = (elements[:, : CORNERS + 1] == 0).any(axis=1)
    ordered = np.sort(elements, axis=1)
    repeated = ((ordered[:, 1:] == ordered[:, :-1]) & (ordered[:, 1:] != 0)).any(axis=1)
    report("E308", empty, "has no nodes")
    report(
        "E309", unknown.any(axis=1), f"has a node outside 1 to {numnp}",
        "its own card or the increment of the card before it is wrong",
    )  # fmt: skip
    report(
        "E310", three_missing & pointed & ~empty, "lacks one of its three corners",
        "an element that ends with its third node is a triangle, any other has four corners",
    )  # fmt: skip
    report("E310", four_missing & ~pointed, "lacks one of its four corners")
    report("E312", repeated, "has a node twice")
    return findings.error_count == before


def check_assumed_shear(deck: model.Deck, mesh: Mesh, findings: Findings) -> None:
    """Refuse elements of a sound mesh that have no assumed shear strains."""
    if not deck.require(model.Shear).assumed:
        return
    wrong = np.zeros(len(mesh.elements), dtype=bool)
    for family in element_blocks(mesh.elements, mesh.coordinates):
        wrong[family.rows] = not assumed_shear.supports(family)
    report_elements(
        findings, "E451", np.flatnonzero(wrong), deck, "has no assumed shear strains (SHEA MITC)",
        "quadrilaterals with 4 or with 9 nodes have; without MITC any element will do",
    )  # fmt: skip


def _check_coincidence(deck: model.Deck, mesh: Mesh, findings: Findings) -> None:
    order = np.lexsort(mesh.coordinates.T)
    sorted_places = mesh.coordinates[order]
    same = (sorted_places[1:] == sorted_places[:-1]).all(axis=1)
    if same.any():
        rows = distinct(np.concatenate([order[1:][same], order[:-1][same]]))
        message = f"{describe_nodes(rows)} in the place of another node: the plate is cut there."
        findings.add("W314", message, deck.require(model.Coordinates).place())


def check_in_plane_supports(problem: Problem, findings: Findings) -> None:
    """Warn of in-plane restraints at every node of a laminate whose B is not zero."""
    if holds_the_plane(problem.mesh.codes) and problem.laminate.is_coupled:
        boundary = problem.deck.last(model.Boundary)
        why = "the plate is stiffer than its laminate"
        message = f"B is not zero, and u and v are restrained at every node: {why}."
        hint = "restrain u and v only where a support holds them"
        findings.add("W318", message, boundary.place() if boundary else None, hint)


def check_side_nodes(deck: model.Deck, mesh: Mesh, findings: Findings) -> None:
    """Warn of nodes on sides that are off the middle or the third points, seen along the side."""
    wrong: list[int] = []
    for family in element_blocks(mesh.elements, mesh.coordinates):
        if family.shape is TRIANGLE:
            continue
        thirds = family.shape is CUBIC
        for place in range(4, 12 if thirds else 8):
            if not family.present[place]:
                continue
            start = place % 4 if place < 8 else (place - 1) % 4  # 9 to 12 precede a corner
            end = (start + 1) % 4
            share = 0.5 if not thirds else 1.0 / 3.0 if place < 8 else 2.0 / 3.0
            corners = mesh.coordinates[mesh.elements[family.rows][:, [start, end]] - 1]
            node = mesh.coordinates[mesh.elements[family.rows, place] - 1]
            side = corners[:, 1] - corners[:, 0]
            with np.errstate(all="ignore"):
                along = ((node - corners[:, 0]) * side).sum(axis=1) / np.square(side).sum(axis=1)
            wrong += family.rows[np.abs(along - share) > OFF_PLACE].tolist()
    if wrong:
        rows = distinct(wrong).astype(np.intp)
        off = f"away from their places by more than {OFF_PLACE:.0%} of the side"
        message = f"Side nodes of {describe_elements(rows)} are {off}."
        hint = "put them at the middle of the side, in cubic elements at its third points"
        findings.add("W323", message, place_of_element(deck, int(rows[0]) + 1), hint)


def check_support(deck: model.Deck, mesh: Mesh, findings: Findings) -> None:
    """Warn of a plate that one or two nodes support, unless symmetry holds its rotations."""
    held = mesh.equations == 0
    count = int(held[:, W].sum())
    if 0 < count <= 2 and held[:, THETA_X:].any(axis=1).sum() <= 2:
        segment = deck.last(model.Boundary)
        message = f"w is restrained at {count} node{'s' if count > 1 else ''} only."
        hint = "restrain w at every node of a supported edge; a free plate needs no support"
        findings.add("W319", message, None if segment is None else segment.place(), hint)


def _check_shapes(deck: model.Deck, mesh: Mesh, findings: Findings, *, listing: bool) -> None:
    """Check Jacobians at every quadrature point, lumped masses and zero-energy modes."""
    material = deck.last(model.Material)
    if material is None or not 1 <= abs(material.integration.points) <= HIGHEST_ORDER:
        return
    families = element_blocks(mesh.elements, mesh.coordinates)
    card, used = material.integration, rules(material)
    folded: dict[str, list[int]] = {}
    massless: list[NDArray[np.intp]] = []
    for family in families:
        # Strains are stored where a triangle's Jacobian is zero: on the side eta = 1.
        at_third_node = family.shape is TRIANGLE and card.points < -1
        if at_third_node:
            what = f"Strains at nodal points (K = {card.points}) do not exist in triangles"
            where = f"at the third node: {describe_elements(family.rows)}"
            message = f"{what}, whose Jacobian is zero {where}."
            hint = f"take Gauss points: K = {-card.points}"
            findings.add("E317", message, card.place("stress-point order K"), hint)
        with np.errstate(all="ignore"):
            for block in family.blocks(4096):
                for rule in used[:2] if at_third_node else used:
                    found = interpolation.jacobian_determinants(block, rule)
                    rows = block.rows[~(found > 0.0).all(axis=1)]
                    folded.setdefault(family.shape.numbering, []).extend(rows.tolist())
            values, _ = interpolation.local_shape_functions(family, used[0])
            if (np.square(values).sum(axis=0) < 1e-12).any():
                massless.append(family.rows)
    for numbering, wrong in folded.items():
        what = "has a Jacobian that is zero or negative"
        report_elements(findings, "E313", distinct(wrong).astype(np.intp), deck, what, numbering)
    if massless:
        nodes = describe_elements(np.sort(np.concatenate(massless)))
        message = f"Under the bending order L1 = {card.bending} nodes of {nodes} have no mass."
        hint = "elements with mid-side nodes take L1 = 2 or more"
        findings.add("E315", message, card.place("bending order L1"), hint)
    if not listing:
        _check_shear(deck, mesh, families, findings)


def _check_shear(deck: model.Deck, mesh: Mesh, families: Blocks, findings: Findings) -> None:
    """Find zero-energy modes of the transverse shear's quadrature, and elements that lock."""
    material = deck.require(model.Material)
    card, order = material.integration, math.isqrt(len(rules(material)[1].xi))
    assumed, supported = has_assumed_shear(deck), bool((mesh.equations[:, W] == 0).any())
    # An impact's force on single nodes excites their checkerboard, FORC's only a free plate's.
    words = {macro.word for macro in deck.macros}
    few = 0 < np.count_nonzero(mesh.forces[:, W]) <= FEW_LOADED
    nodal = "RODP" in words or (not supported and "EXCD" in words and few)
    weak: dict[int, list[str]] = {}
    for family in families:
        name, free, held = _orders_without_motions(family)
        if name == FOUR_NODES and order >= free and not assumed:
            why = "they are much too stiff in a thin plate"
            message = f"4-node elements lock under the shear order L2 = {card.shear}: {why}."
            hint = "use L2 = 1 and support the plate, or elements with mid-side nodes"
            findings.add("W320", message, card.place("shear order L2"), hint)
        if name == NINE_NODES and held <= order < free and nodal:
            what = f"Under the shear order L2 = {card.shear} a force on single nodes excites"
            what = f"{what} a checkerboard motion of the 9-node elements, which"
            place, hint = card.place("shear order L2"), "take L2 = 3"
            if supported:
                findings.add("W322", f"{what} only the supports resist.", place, hint)
            else:
                message = f"{what} nothing resists in a plate without supports."
                hint += "; --force runs the deck nevertheless"
                findings.add(HOURGLASS, message, place, hint)
        elif order < (held if supported else free):
            weak.setdefault(free, []).append(name)
    if weak:
        rest = "." if supported else ", and nothing supports the plate's w."
        named = " and ".join(dict.fromkeys(name for kind in weak.values() for name in kind))
        message = f"The shear order L2 = {card.shear} leaves {named} motions without energy{rest}"
        findings.add("W316", message, card.place("shear order L2"), f"take L2 = {max(weak)}")


def _orders_without_motions(family: ElementBlock) -> tuple[str, int, int]:
    """Name; least shear orders without zero-energy modes where w is free, and where it is held."""
    if family.shape is TRIANGLE:
        return "triangles", 1, 1
    if family.shape is CUBIC:
        return "cubic elements", 3, 3
    if family.present[8]:
        return NINE_NODES, 3, 2
    if family.present[4:].any():
        return "elements with mid-sides", 2, 2
    return FOUR_NODES, 2, 1


def check_listing(deck: model.Deck, mesh: Mesh, findings: Findings) -> None:
    """Refuse what the printed program cannot compute: mixed meshes, many layers, later words.

    The listing's LMAS takes element 1's node list for all elements (MASS01 hands IX, not IX(1,N),
    to SHAPE), so an element that lacks other nodes gets wrong masses or none.
    """
    present = mesh.elements != 0
    other = np.flatnonzero((present != present[:1]).any(axis=1))
    if len(other):
        number = int(other[0]) + 1
        counts = f"{present[number - 1].sum()} against {present[0].sum()}"
        why = "the printed program takes element 1's node list for the mass of every element"
        message = f"Element {number} has other nodes than element 1 ({counts}): {why}."
        findings.add("E601", message, place_of_element(deck, number), ANOTHER_MODE)
    material = deck.require(model.Material)
    if len(material.layers) > LISTING_LAYERS:
        room = f"the {LISTING_LAYERS} that the printed program has room for"
        message = f"{len(material.layers)} layers are more than {room}."
        findings.add("E602", message, material.layers[LISTING_LAYERS].place("layer"), ANOTHER_MODE)
    later = {macro.word: macro for macro in deck.macros if macro.word in ("PLYS", "FAIL")}
    words = [(word, macro.place("macro")) for word, macro in later.items()]
    for kind in (model.Allowables, model.Delamination, model.Damping, model.Patch):
        if (segment := deck.last(kind)) is not None:
            words.append((kind.keyword, segment.place()))
    if (shear := deck.last(model.Shear)) is not None:
        words += [(f"SHEA {word}", shear.place()) for word in shear.words()]
    for word, place in words:
        findings.add("E603", f"The printed program has no {word}.", place, ANOTHER_MODE)
