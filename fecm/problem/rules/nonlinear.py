"""Rules about the NONL segment: a plate that stretches as it bends."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fecm._typing import Bools
from fecm.deck import model
from fecm.deck.rules import Report, Reports, Subject, rule
from fecm.mechanics.elements import QUADRILATERAL
from fecm.mechanics.interpolation import W
from fecm.mechanics.mesh import holds_the_plane
from fecm.problem.parts import THETA_X, has_assumed_shear
from fecm.problem.problem import Problem
from fecm.problem.rules.cards import report_elements

ORDER = 3  # bending order L1, which also integrates the membrane
SAME_LINE = 1e-9  # difference of coordinates on one line, over the size of the mesh


@rule("E490", Subject.LAMINATE)
def held_plane(problem: Problem) -> Reports:
    """The deck has NONL, and u and v are restrained at every node.

    The plate is too stiff: under 20 J on 4.4 mm in the fixture D7136 the force is 12 % too high.

    Remedy: Restrain u and v only where a support holds them. `fecm new --nonlinear` does so.
    """
    if not holds_the_plane(problem.mesh.codes):
        return
    records = [card for segment in problem.deck.all(model.Boundary) for card in segment.records]
    inside = [card for card in records if any(card.codes[:W]) and not card.codes[W]]
    place = (inside or records)[0].place() if records else None
    cards = "the cards of BOUN"
    if inside:
        count = len(inside)
        cards = "this card of BOUN" if count == 1 else f"the {count} cards of BOUN like this one"
    message = "The deck has NONL, and u and v are restrained at every node: the plate is too stiff."
    hint = (
        f"put 0 for u and v, the first two codes, on {cards}, so that only supports hold them; "
        "fecm new --nonlinear --in-plane writes such supports"
    )
    yield Report(message, place, hint)


@rule("E491", Subject.LAMINATE)
def without_assumed_shear(problem: Problem) -> Reports:
    """NONL is used without SHEA MITC.

    Full quadrature of the transverse shear locks before the plate stretches.

    Remedy: Add `SHEA MITC`.
    """
    deck = problem.deck
    if not has_assumed_shear(deck):
        why = "with full quadrature the transverse shear locks before the plate stretches"
        shear = deck.last(model.Shear)
        hint = "add MITC to this card" if shear else "add the card SHEA MITC"
        place = (shear or deck.require(model.Nonlinear)).place()
        yield Report(f"NONL needs assumed shear strains: {why}.", place, hint)


@rule("E492", Subject.LAMINATE)
def elements_without_membrane(problem: Problem) -> Reports:
    """NONL has an element that is not a quadrilateral with 9 nodes.

    Remedy: Take 9-node elements; `fecm new` writes them.
    """
    what = "is not a quadrilateral with 9 nodes, as NONL needs"
    hint = "elements with 3, 4, 8 or 12 nodes are for linear plates only"
    yield from report_elements(problem.deck, np.flatnonzero(not_nine_nodes(problem)), what, hint)


def not_nine_nodes(problem: Problem) -> Bools:
    """Return a mask of the elements that are not quadrilaterals with 9 nodes, (numel,)."""
    wrong = np.zeros(len(problem.mesh.elements), dtype=bool)
    for family in problem.mesh.families:
        nine = family.shape is QUADRILATERAL and family.nodes.shape[1] == QUADRILATERAL.nodes
        wrong[family.rows] = not nine
    return wrong


@rule("E493", Subject.LAMINATE)
def consistent_mass_of_nonlinear_plate(problem: Problem) -> Reports:
    """NONL is used with CMAS.

    Nonlinear plates take the lumped mass.

    Remedy: `LMAS`.
    """
    card = next((macro for macro in problem.deck.macros if macro.word == "CMAS"), None)
    if card is not None:
        yield Report("NONL takes the lumped mass only.", card.place("macro"), "take LMAS")


@rule("E494", Subject.LAMINATE)
def other_order(problem: Problem) -> Reports:
    """NONL is used with a bending order L1 other than 3.

    The order L1 also integrates the membrane: 2 leaves motions of u and v without energy.

    Remedy: L1 = 3.
    """
    card = problem.deck.require(model.Material).integration
    if card.bending != ORDER:
        message = f"NONL needs the bending order L1 = {ORDER} for the membrane, not {card.bending}."
        yield Report(message, card.place("bending order L1"), f"take L1 = {ORDER}")


@rule("W495", Subject.LAMINATE)
def open_symmetry(problem: Problem) -> Reports:
    """With NONL or CURV, a line of symmetry is free to move across itself.

    On a straight edge the slope across it is held, as by symmetry, but w and the in-plane
    displacement across it are free.

    Remedy: Restrain u on an edge along y with θx, v on one along x with θy.
    """
    boundary = problem.deck.last(model.Boundary)
    if boundary is None:
        return
    for axis, dof, rotation in ((0, "u", "theta_x"), (1, "v", "theta_y")):
        for where, nodes in _open_lines(problem, axis):
            line = f"{'xy'[axis]} = {where:.6g}"
            message = (
                f"On the edge {line} {rotation} is restrained at {nodes} nodes and w is free, as "
                f"by symmetry, but {dof} is free too: the line may move across itself."
            )
            hint = f"restrain {dof} there too if the plate is half of a symmetric one"
            yield Report(message, boundary.place(), hint)


def _open_lines(problem: Problem, axis: int) -> Iterator[tuple[float, int]]:
    """Yield place and number of nodes of edges across an axis with only symmetry of bending."""
    mesh = problem.mesh
    free = mesh.codes == 0
    turned = ~free[:, THETA_X + axis] & free[:, W] & free[:, axis]
    rows = np.flatnonzero(turned & _on_edges_across(problem, axis))
    places = mesh.coordinates[rows, axis]
    order = np.argsort(places)
    breaks = np.flatnonzero(np.diff(places[order]) > SAME_LINE * problem.longer_side) + 1
    for line in np.split(rows[order], breaks) if len(rows) else ():
        yield float(mesh.coordinates[line, axis].mean()), len(line)


def _on_edges_across(problem: Problem, axis: int) -> Bools:
    """Return which nodes are on an unshared side of an element that is normal to an axis."""
    mesh = problem.mesh
    # Corners and middle of each side of 9-node elements.
    sides = np.stack([mesh.elements[:, [n, (n + 1) % 4, 4 + n]] for n in range(4)], axis=1)
    sides = sides.reshape(-1, 3) - 1
    _, first, counts = np.unique(sides[:, 2], return_index=True, return_counts=True)
    unshared = sides[first[counts == 1]]
    along = np.ptp(mesh.coordinates[unshared, axis], axis=1) <= SAME_LINE * problem.longer_side
    on_edge = np.zeros(len(mesh.coordinates), dtype=bool)
    on_edge[unshared[along]] = True
    return on_edge


OF_NONLINEAR = (
    elements_without_membrane,
    without_assumed_shear,
    other_order,
    held_plane,
    consistent_mass_of_nonlinear_plate,
)
OF_SYMMETRY = (open_symmetry,)
