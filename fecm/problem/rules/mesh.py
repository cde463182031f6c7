"""Rules about nodes, elements and supports."""

from __future__ import annotations

import numpy as np

from fecm._typing import Bools
from fecm.deck import model
from fecm.deck.rules import Report, Reports, Subject, declare, rule
from fecm.mechanics.elements import CUBIC, TRIANGLE
from fecm.mechanics.interpolation import W
from fecm.mechanics.joints import hanging_nodes, merged
from fecm.mechanics.mesh import distinct, holds_the_plane
from fecm.problem.generate import place_of_element
from fecm.problem.parts import THETA_X
from fecm.problem.problem import Problem
from fecm.problem.rules.cards import describe_elements, describe_nodes, report_elements

CORNERS = TRIANGLE.corners
FEW_SUPPORTS = 2  # nodes that hold w; a support needs more
# Distance of a mid-side node from its place along the side, over the side's length.
OFF_PLACE = 0.05
SHOWN = 3  # hanging nodes that have a finding of their own

# Found while the mesh is generated, in generate.py.
declare(
    "E301",
    Subject.MESH,
    "A node of a card, or a generated node, is outside 1 to NUMNP.",
    remedy="Correct node, increment or NUMNP.",
)
declare(
    "E302",
    Subject.MESH,
    "A node follows itself, so nothing can be generated.",
    remedy="No increment on the card before.",
)
declare(
    "E303",
    Subject.MESH,
    "An element is outside 1 to NUMEL.",
    remedy="Correct element or NUMEL.",
)
declare(
    "E304",
    Subject.MESH,
    "Element numbers do not ascend.",
    remedy="Sort the cards.",
)
declare(
    "E305",
    Subject.MESH,
    "The first element is not element 1.",
    remedy="Add the elements before it.",
)


def _report(problem: Problem, wrong: Bools, what: str, hint: str = "") -> Reports:
    """Report the elements that are wrong, (numel,)."""
    return report_elements(problem.deck, np.flatnonzero(wrong), what, hint)


def _corner_missing(problem: Problem, count: int) -> Bools:
    """Return a mask of the elements that lack one of the first `count` nodes, (numel,)."""
    return np.asarray((problem.mesh.elements[:, :count] == 0).any(axis=1))


def _is_pointed(problem: Problem) -> Bools:
    """Return a mask of the elements whose list ends with the third node, (numel,).

    The later nodes make a quadrilateral.
    """
    return np.asarray(~(problem.mesh.elements[:, CORNERS:] != 0).any(axis=1))


def _is_empty(problem: Problem) -> Bools:
    """Return a mask of the elements without nodes, (numel,)."""
    return np.asarray(~(problem.mesh.elements != 0).any(axis=1))


@rule("E308", Subject.MESH)
def empty_element(problem: Problem) -> Reports:
    """An element has no nodes.

    Remedy: Add its nodes.
    """
    yield from _report(problem, _is_empty(problem), "has no nodes")


@rule("E309", Subject.MESH)
def unknown_node(problem: Problem) -> Reports:
    """An element has a node outside 1 to NUMNP.

    Remedy: Correct its own card, or the increment of the card before.
    """
    elements, numnp = problem.mesh.elements, len(problem.mesh.coordinates)
    unknown = (elements < 0) | (elements > numnp)
    hint = "its own card or the increment of the card before it is wrong"
    wrong = np.asarray(unknown.any(axis=1))
    yield from _report(problem, wrong, f"has a node outside 1 to {numnp}", hint)


@rule("E310", Subject.MESH)
def missing_corner(problem: Problem) -> Reports:
    """An element lacks a corner.

    Remedy: Give a triangle three corners, the others four.
    """
    pointed = _is_pointed(problem)
    wrong = _corner_missing(problem, CORNERS) & pointed & ~_is_empty(problem)
    hint = "an element that ends with its third node is a triangle, any other has four corners"
    yield from _report(problem, wrong, "lacks one of its three corners", hint)
    wrong = _corner_missing(problem, CORNERS + 1) & ~pointed
    yield from _report(problem, wrong, "lacks one of its four corners")


@rule("E312", Subject.MESH)
def repeated_node(problem: Problem) -> Reports:
    """An element has a node twice.

    Remedy: Correct the card.
    """
    ordered = np.sort(problem.mesh.elements, axis=1)
    repeated = ((ordered[:, 1:] == ordered[:, :-1]) & (ordered[:, 1:] != 0)).any(axis=1)
    hint = _hint_of_feap(problem) if repeated.any() else ""
    yield from _report(problem, repeated, "has a node twice", hint)


def _hint_of_feap(problem: Problem) -> str:
    """Return a hint for ELEM cards that have a material number before their nodes, or ""."""
    records = problem.deck.require(model.Elements).records
    if len({record.nodes[0] for record in records}) > 1 or records[0].nodes[0] != 1:
        return ""
    return "ELEM has no material number; FEAP's has one before the nodes: leave it out"


@rule("E306", Subject.MESH)
def nodes_without_coordinates(problem: Problem) -> Reports:
    """Nodes have no coordinates.

    Remedy: Add COOR cards for them.
    """
    missing = np.flatnonzero(~problem.mesh.given)
    if len(missing):
        place = problem.deck.require(model.Coordinates).place()
        yield Report(f"{describe_nodes(missing)} without coordinates.", place)


@rule("E307", Subject.MESH)
def nodes_in_no_element(problem: Problem) -> Reports:
    """Nodes are in no element.

    Remedy: Remove them, or correct the elements.
    """
    unused = np.flatnonzero(problem.mesh.given & ~problem.mesh.used)
    if len(unused):
        place = problem.deck.require(model.Elements).place()
        yield Report(f"{describe_nodes(unused)} in no element.", place)


@rule("E311", Subject.MESH)
def nothing_free(problem: Problem) -> Reports:
    """Every dof is restrained.

    Remedy: BOUN restrains supports only.
    """
    if not problem.mesh.number_of_equations:
        yield Report("Every dof of the plate is restrained.", problem.deck.place())


@rule("W314", Subject.MESH)
def coincident_nodes(problem: Problem) -> Reports:
    """Nodes are in the place of another node.

    The plate is cut there.

    Remedy: Give the elements the same node.
    """
    pairs = problem.coincident_nodes
    if len(pairs):
        message = (
            f"{describe_nodes(distinct(pairs))} in the place of another node: the plate is cut "
            "there."
        )
        yield Report(message, problem.deck.require(model.Coordinates).place())


@rule("E324", Subject.MESH)
def hanging_node(problem: Problem) -> Reports:
    """A node lies inside a side of an element that does not have it.

    The plate is cut there: elements of another size, or of other mid-side nodes, meet.

    Remedy: Give both elements the same nodes along their common side.
    """
    sides = merged(problem.sides, problem.coincident_nodes)
    nodes, elements = hanging_nodes(sides, problem.mesh.coordinates)
    hint = "give both elements the same nodes along their common side"
    for node, element in zip(nodes[:SHOWN].tolist(), elements.tolist(), strict=False):
        message = (
            f"Node {node + 1} lies inside a side of element {element + 1}, which does not have it: "
            "the plate is cut there."
        )
        yield Report(message, place_of_element(problem.deck, element + 1), hint)
    if len(nodes) > SHOWN:
        where = f"inside sides of {describe_elements(distinct(elements))}"
        message = f"{describe_nodes(distinct(nodes))} {where} that do not have them."
        yield Report(message, problem.deck.require(model.Elements).place(), hint)


@rule("W323", Subject.MESH)
def side_node_off_place(problem: Problem) -> Reports:
    """A side node is away from its place by more than 5 % of the side.

    Its place is the middle of the side, in cubic elements the third point.

    Remedy: Correct the coordinates.
    """
    mesh = problem.mesh
    wrong: list[int] = []
    for family in problem.mesh.families:
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
    if not wrong:
        return
    rows = distinct(wrong).astype(np.intp)
    off = f"away from their places by more than {OFF_PLACE:.0%} of the side"
    message = f"Side nodes of {describe_elements(rows)} are {off}."
    hint = "put them at the middle of the side, in cubic elements at its third points"
    yield Report(message, place_of_element(problem.deck, int(rows[0]) + 1), hint)


@rule("W319", Subject.MESH)
def too_few_supports(problem: Problem) -> Reports:
    """The deflection w is restrained at one or two nodes only.

    Remedy: Restrain every node of a supported edge. A free plate needs no support.
    """
    held = problem.plate.supported.equations == 0
    count = int((problem.mesh.codes[:, W] != 0).sum())
    few = int(held[:, W].sum()) <= FEW_SUPPORTS  # springs and one-sided supports count
    if count and few and held[:, THETA_X:].any(axis=1).sum() <= FEW_SUPPORTS:
        segment = problem.deck.last(model.Boundary)
        message = f"w is restrained at {count} node{'s' if count > 1 else ''} only."
        hint = "restrain w at every node of a supported edge; a free plate needs no support"
        yield Report(message, None if segment is None else segment.place(), hint)


@rule("W318", Subject.MESH)
def held_plane_of_coupled_laminate(problem: Problem) -> Reports:
    """B is not zero, and u and v are restrained at every node.

    The plate is too stiff.

    Remedy: Restrain u and v only where a support holds them. `fecm new` does so.
    """
    if holds_the_plane(problem.mesh.codes) and problem.plate.is_coupled:
        boundary = problem.deck.last(model.Boundary)
        why = "the plate is stiffer than its laminate"
        message = f"B is not zero, and u and v are restrained at every node: {why}."
        hint = "restrain u and v only where a support holds them"
        yield Report(message, boundary.place() if boundary else None, hint)


OF_ELEMENTS = (empty_element, unknown_node, missing_corner, repeated_node)
OF_NODES = (nodes_without_coordinates, nodes_in_no_element, nothing_free)
OF_PLACES = (coincident_nodes, hanging_node)
OF_SUPPORTS = (side_node_off_place, too_few_supports, held_plane_of_coupled_laminate)
