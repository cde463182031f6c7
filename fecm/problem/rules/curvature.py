"""Rules about the CURV segment: a shallow curved panel."""

from __future__ import annotations

import numpy as np

from fecm.deck import model
from fecm.deck.rules import Report, Reports, Subject, rule
from fecm.mechanics.interpolation import W
from fecm.mechanics.strains import strain_of_deflection
from fecm.problem.problem import Problem
from fecm.problem.rules.cards import report_elements
from fecm.problem.rules.nonlinear import ORDER, not_nine_nodes

# Slope of the midplane at an edge: an arc has four times its rise over its side.
SHALLOW = 0.5
STEEP = 1.0
THIN = 20.0  # least radius over thickness of a thin shell
BALANCED = 1e-9  # force across the midplane by PREL, relative to its parts


def _card(problem: Problem) -> model.Curvature:
    return problem.deck.require(model.Curvature)


@rule("W521", Subject.LAMINATE)
def no_curvature(card: model.Curvature) -> Reports:
    """All radii of CURV are infinite.

    Remedy: Give Rx, Ry or Rxy, or remove the segment.
    """
    if not any(card.curvatures):
        hint = "its fields are the radii Rx, Ry and Rxy; blank is infinite"
        yield Report("CURV is without effect: all its radii are infinite.", card.place(), hint)


@rule("E522", Subject.LAMINATE)
def elements_without_curvature(problem: Problem) -> Reports:
    """CURV has an element that is not a quadrilateral with 9 nodes.

    Elements with fewer nodes lock: their strains of u and v do not follow w/R.

    Remedy: Take 9-node elements; `fecm new` writes them.
    """
    what = "is not a quadrilateral with 9 nodes, as CURV needs"
    hint = "elements with 3, 4, 8 or 12 nodes are for flat plates only"
    yield from report_elements(problem.deck, np.flatnonzero(not_nine_nodes(problem)), what, hint)


def _slope(problem: Problem) -> float:
    """Return the largest slope of the midplane along x or y, from the centre of the panel."""
    x, y, xy = _card(problem).curvatures
    places = problem.mesh.coordinates[problem.mesh.used]
    middle = (places.min(axis=0) + places.max(axis=0)) / 2.0
    slopes = (places - middle) @ np.array([[x, xy], [xy, y]])
    return float(np.nan_to_num(np.abs(slopes), nan=np.inf).max())


def _steepness(problem: Problem) -> str:
    slope = _slope(problem)
    return (
        f"The midplane of CURV has a slope of {slope:.3g} at its edge, as an arc that rises by "
        f"{slope / 4.0:.3g} of its side"
    )


RADII = "radii are in the deck's unit of length"


@rule("E523", Subject.LAMINATE)
def deep_panel(problem: Problem) -> Reports:
    """The panel of CURV is deep: an arc that rises by more than 1/4 of its side.

    The theory of shallow shells takes the slope of the midplane as small.

    Remedy: Larger radii, in the deck's unit of length, or a smaller panel.
    """
    if not _slope(problem) <= STEEP:
        message = f"{_steepness(problem)}; the theory of shallow shells ends at 1/4."
        yield Report(message, _card(problem).place(), RADII)


@rule("W524", Subject.LAMINATE)
def hardly_shallow(problem: Problem) -> Reports:
    """The panel of CURV is hardly shallow: its arc rises by more than 1/8 of a side.

    The theory of shallow shells takes the slope of the midplane as small.

    Remedy: Larger radii, or a smaller panel; stiffness and frequencies are approximate.
    """
    if SHALLOW < _slope(problem) <= STEEP:
        message = f"{_steepness(problem)}; the theory of shallow shells is for less than 1/8."
        yield Report(message, _card(problem).place(), RADII)


@rule("W525", Subject.LAMINATE)
def thick_panel(problem: Problem) -> Reports:
    """A radius of CURV is less than 20 times the thickness.

    Strains of a thick shell vary over its thickness, which the theory of thin shells neglects.

    Remedy: The unit of the radius, the deck's of length.
    """
    card, thickness = _card(problem), float(problem.plate.thicknesses.max())
    radii = {"Rx": card.radius_x, "Ry": card.radius_y, "Rxy": card.radius_xy}
    for name, radius in radii.items():
        if 0.0 < abs(radius) < THIN * thickness:
            ratio = f"{abs(radius) / thickness:.3g}"
            message = f"{name} of CURV is {ratio} times the thickness: no thin shell."
            yield Report(message, card.place(name), f"thin shells have at least {THIN:g} times")


@rule("W526", Subject.LAMINATE)
def clamped_membrane(problem: Problem) -> Reports:
    """The deck has CURV, and u or v is restrained at every node.

    This clamps the membrane: the panel is much too stiff.

    Remedy: Restrain u and v only where a support holds them. `fecm new --radius-x` does so.
    """
    held = (problem.mesh.codes[:, :W] != 0).all(axis=0)
    names = [name for name, all_held in zip("uv", held.tolist(), strict=True) if all_held]
    if names:
        verb = "are" if len(names) > 1 else "is"
        message = (
            f"The deck has CURV, and {' and '.join(names)} {verb} restrained at every node: this "
            "clamps the membrane, and the panel is too stiff."
        )
        boundary = problem.deck.last(model.Boundary)
        hint = "put 0 for u and v, the first two codes, where no support holds them"
        yield Report(message, boundary.place() if boundary else None, hint)


@rule("E527", Subject.LAMINATE)
def low_order(problem: Problem) -> Reports:
    """CURV is used with a bending order L1 below 3.

    The order L1 also integrates the membrane: 2 leaves motions of u and v without energy.

    Remedy: L1 = 3.
    """
    card = problem.deck.require(model.Material).integration
    if card.bending < ORDER:
        message = f"CURV needs the bending order L1 = {ORDER} for the membrane, not {card.bending}."
        yield Report(message, card.place("bending order L1"), f"take L1 = {ORDER}")


@rule("E528", Subject.LAMINATE)
def preload_bends_panel(problem: Problem) -> Reports:
    """CURV and PREL are not in equilibrium.

    The force N0x/Rx + N0y/Ry + 2 N0xy/Rxy across the midplane deflects the panel.

    Remedy: Forces along a direction that is straight.
    """
    if (card := problem.deck.last(model.Preload)) is None:
        return
    parts = strain_of_deflection(_card(problem).curvatures) * card.forces
    if abs(parts.sum()) > BALANCED * np.abs(parts).sum():
        message = (
            f"PREL presses with N0x/Rx + N0y/Ry + 2 N0xy/Rxy = {parts.sum():.4g}, a force per "
            "area, across the panel of CURV, which deflects."
        )
        yield Report(message, card.place(), "a preload along straight lines leaves the panel as is")


ALONE = (no_curvature,)
OF_PANEL = (elements_without_curvature, low_order, deep_panel, preload_bends_panel)
VALUES = (hardly_shallow, thick_panel)
OF_SUPPORTS = (clamped_membrane,)
