"""Rules about the shape of elements and their integration orders."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from fecm.deck import model
from fecm.deck.rules import Report, Reports, Subject, rule
from fecm.mechanics import interpolation
from fecm.mechanics import strains as assumed_shear
from fecm.mechanics.elements import CUBIC, TRIANGLE
from fecm.mechanics.interpolation import W
from fecm.mechanics.mesh import ElementBlock, distinct
from fecm.problem.problem import Problem
from fecm.problem.rules.cards import describe_elements, report_elements

FEW_LOADED = 4  # loaded nodes up to this number are single forces, more are a pressure
BLOCK = 1024  # elements whose Jacobians are computed together
NO_MASS = 1e-12  # sum of a node's squared shape functions at the points of L1 that is zero
HOURGLASS = "E321"


@rule("E317", Subject.MESH)
def strains_at_nodes_of_triangles(problem: Problem) -> Reports:
    """Strains at nodes of triangles do not exist.

    Their Jacobian is zero at the third node.

    Remedy: Take Gauss points: a positive K.
    """
    card = problem.deck.require(model.Material).integration
    for family in problem.mesh.families:
        if _has_singular_points(problem, family):
            what = f"Strains at nodal points (K = {card.points}) do not exist in triangles"
            where = f"at the third node: {describe_elements(family.rows)}"
            message = f"{what}, whose Jacobian is zero {where}."
            hint = f"take Gauss points: K = {-card.points}"
            yield Report(message, card.place("stress-point order K"), hint)


def _has_singular_points(problem: Problem, family: ElementBlock) -> bool:
    """Return whether strains are stored where a triangle's Jacobian is zero."""
    points = problem.deck.require(model.Material).integration.points
    return family.shape is TRIANGLE and points < -1


@rule("E313", Subject.MESH)
def folded_elements(problem: Problem) -> Reports:
    """The Jacobian of an element is not positive.

    Its nodes are clockwise, or it is distorted.

    Remedy: Number the nodes counter-clockwise.
    """
    bending, shear, strains = problem.rules
    folded: dict[str, list[int]] = {}  # rows by the hint about the numbering
    for family in problem.mesh.families:
        used = {bending, shear}
        if not _has_singular_points(problem, family):
            used.add(strains)
        wrong = folded.setdefault(family.shape.numbering, [])
        with np.errstate(all="ignore"):
            for block in family.blocks(BLOCK):
                for points in used:
                    sound = interpolation.has_positive_jacobians(block, points)
                    wrong += block.rows[~sound].tolist()
    what = "has a Jacobian that is zero or negative"
    for numbering, wrong in folded.items():
        rows = distinct(wrong).astype(np.intp)
        yield from report_elements(problem.deck, rows, what, numbering)


@rule("E315", Subject.MESH)
def nodes_without_mass(problem: Problem) -> Reports:
    """Nodes have no mass under the bending order L1.

    Remedy: Take L1 = 2 or more for elements with mid-side nodes.
    """
    massless: list[np.ndarray[tuple[int], np.dtype[np.intp]]] = []
    for family in problem.mesh.families:
        values, _ = interpolation.local_shape_functions(family, problem.rules[0])
        if (np.square(values).sum(axis=0) < NO_MASS).any():
            massless.append(family.rows)
    if not massless:
        return
    card = problem.deck.require(model.Material).integration
    nodes = describe_elements(np.sort(np.concatenate(massless)))
    message = f"Under the bending order L1 = {card.bending} nodes of {nodes} have no mass."
    hint = "elements with mid-side nodes take L1 = 2 or more"
    yield Report(message, card.place("bending order L1"), hint)


class ShearOrders(NamedTuple):
    """Least orders L2 under which elements have no motions without energy."""

    name: str  # of the elements
    free: int  # where nothing holds w
    held: int  # where supports hold w


FOUR_NODES = ShearOrders("4-node elements", free=2, held=1)
NINE_NODES = ShearOrders("9-node elements", free=3, held=2)
MID_SIDES = ShearOrders("elements with mid-sides", free=2, held=2)
CUBIC_SIDES = ShearOrders("cubic elements", free=3, held=3)
TRIANGLES = ShearOrders("triangles", free=1, held=1)


def _orders(family: ElementBlock) -> ShearOrders:
    """Return the least shear orders of elements."""
    if family.shape is TRIANGLE:
        return TRIANGLES
    if family.shape is CUBIC:
        return CUBIC_SIDES
    if family.present[8]:
        return NINE_NODES
    if family.present[4:].any():
        return MID_SIDES
    return FOUR_NODES


def _shear_order(problem: Problem) -> int:
    """Return the order L2 that is used."""
    return math.isqrt(len(problem.rules[1].xi))


def _is_supported(problem: Problem) -> bool:
    """Return whether w is held somewhere."""
    return bool((problem.mesh.equations[:, W] == 0).any())


def _checkerboards(problem: Problem) -> Iterator[str]:
    """Yield starts of sentences about 9-node elements that a force on single nodes excites.

    The force of an impact excites them; FORC does so only in a free plate.
    """
    words = {macro.word for macro in problem.deck.macros}
    few = 0 < np.count_nonzero(problem.mesh.forces[:, W]) <= FEW_LOADED
    if "RODP" not in words and (_is_supported(problem) or "EXCD" not in words or not few):
        return
    card = problem.deck.require(model.Material).integration
    for family in problem.mesh.families:
        if _orders(family) is NINE_NODES and _only_supports_resist(problem):
            what = f"Under the shear order L2 = {card.shear} a force on single nodes excites"
            yield f"{what} a checkerboard motion of the 9-node elements, which"


def _only_supports_resist(problem: Problem) -> bool:
    """Return whether only supports resist the checkerboard of 9-node elements."""
    return NINE_NODES.held <= _shear_order(problem) < NINE_NODES.free


@rule("W320", Subject.MESH)
def locking(problem: Problem) -> Reports:
    """4-node elements with L2 = 2 lock.

    A thin plate is much too stiff.

    Remedy: L2 = 1 and supports, `SHEA MITC`, or elements with mid-side nodes.
    """
    if _shear_order(problem) < FOUR_NODES.free:
        return
    card = problem.deck.require(model.Material).integration
    if any(_orders(family) is FOUR_NODES for family in problem.mesh.families):
        why = "they are much too stiff in a thin plate"
        message = f"4-node elements lock under the shear order L2 = {card.shear}: {why}."
        hint = "use L2 = 1 and support the plate, or elements with mid-side nodes"
        yield Report(message, card.place("shear order L2"), hint)


@rule(HOURGLASS, Subject.MESH)
def checkerboard_of_free_plate(problem: Problem) -> Reports:
    """A force excites a checkerboard motion of 9-node elements.

    With L2 = 2 nothing resists it in a free plate under a force on single nodes.

    Remedy: L2 = 3. `fecm run --force` runs the deck.
    """
    if _is_supported(problem):
        return
    place = problem.deck.require(model.Material).integration.place("shear order L2")
    for what in _checkerboards(problem):
        hint = "take L2 = 3; --force runs the deck nevertheless"
        yield Report(f"{what} nothing resists in a plate without supports.", place, hint)


@rule("W322", Subject.MESH)
def checkerboard_of_supported_plate(problem: Problem) -> Reports:
    """An impact excites a checkerboard motion of 9-node elements.

    With L2 = 2 only the supports resist it: it is a few per cent of w.

    Remedy: L2 = 3.
    """
    if not _is_supported(problem):
        return
    place = problem.deck.require(model.Material).integration.place("shear order L2")
    for what in _checkerboards(problem):
        yield Report(f"{what} only the supports resist.", place, "take L2 = 3")


@rule("W316", Subject.MESH)
def motions_without_energy(problem: Problem) -> Reports:
    """The shear order L2 leaves motions without energy.

    Remedy: Take the L2 of the hint.
    """
    order, supported = _shear_order(problem), _is_supported(problem)
    excited = any(_checkerboards(problem))
    weak: dict[int, list[str]] = {}
    for family in problem.mesh.families:
        needed = _orders(family)
        if needed is NINE_NODES and excited:
            continue
        if order < (needed.held if supported else needed.free):
            weak.setdefault(needed.free, []).append(needed.name)
    if not weak:
        return
    card = problem.deck.require(model.Material).integration
    rest = "." if supported else ", and nothing supports the plate's w."
    named = " and ".join(dict.fromkeys(name for kind in weak.values() for name in kind))
    message = f"The shear order L2 = {card.shear} leaves {named} motions without energy{rest}"
    yield Report(message, card.place("shear order L2"), f"take L2 = {max(weak)}")


@rule("E451", Subject.POINTS)
def elements_without_assumed_shear(problem: Problem) -> Reports:
    """SHEA MITC has an element with neither 4 nor 9 nodes.

    Remedy: Take other elements, or SHEA without MITC.
    """
    wrong = np.zeros(len(problem.mesh.elements), dtype=bool)
    for family in problem.mesh.families:
        wrong[family.rows] = not assumed_shear.uses_assumed_shear(family)
    what = "has no assumed shear strains (SHEA MITC)"
    hint = "quadrilaterals with 4 or 9 nodes have them; without MITC any element will do"
    yield from report_elements(problem.deck, np.flatnonzero(wrong), what, hint)


OF_SHAPES = (strains_at_nodes_of_triangles, folded_elements, nodes_without_mass)
OF_ASSUMED_SHEAR = (elements_without_assumed_shear,)
OF_SHEAR_ORDER = (
    locking,
    checkerboard_of_free_plate,
    checkerboard_of_supported_plate,
    motions_without_energy,
)
