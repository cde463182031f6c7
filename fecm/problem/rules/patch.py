"""Rules about the PATC segment."""

from __future__ import annotations

import math

import numpy as np

from fecm._typing import Bools, Indices
from fecm.deck import model
from fecm.deck.macros import flat
from fecm.deck.rules import Report, Reports, Subject, reports, rule
from fecm.deck.units import in_si, unit_names
from fecm.judge.exposure_bands import RESOLVED
from fecm.mechanics.interpolation import W
from fecm.mechanics.mesh import MeshArrays, longest_sides
from fecm.mechanics.points import DISC, HERTZ, RADIUS_PER_THICKNESS, PatchError
from fecm.problem.contact_estimates import expected_peak
from fecm.problem.problem import ContactPatch, Problem
from fecm.problem.rules.contact import sphere_radius
from fecm.problem.rules.units import looks_like

LARGE = 2.0  # radius of a patch over the thickness, and over the radius of the contact
INDENTER = 0.5  # radius of a patch over that of a sphere with the deck's k
SMALL = 0.01  # radius of a patch over the thickness; contacts of spheres have 0.05 and more


@rule("E442", Subject.POINTS)
def unknown_shape(problem: Problem) -> Reports:
    """The shape on PATC's card is unknown.

    Remedy: DISC is a uniform pressure, HERT Hertz's.
    """
    card = problem.deck.require(model.Patch)
    if card.shape not in RADIUS_PER_THICKNESS:
        message = f"`{card.shape}` is not a shape of a patch."
        hint = f"{DISC} is a uniform pressure, {HERTZ} is Hertz's"
        yield Report(message, card.place("shape"), hint)


@rule("E443", Subject.POINTS)
def invalid_radius(problem: Problem) -> Reports:
    """The radius of the patch is not positive.

    Remedy: A blank takes 0.327 h (HERT: 0.377 h).
    """
    card = problem.deck.require(model.Patch)
    if card.radius is not None and not card.radius > 0.0:
        message = f"The radius of the patch is {card.radius:g}; it must be positive."
        hint = "a blank takes 0.327 times the thickness (HERT: 0.377)"
        yield Report(message, card.place("radius c"), hint)


@rule("E444", Subject.POINTS)
def incomplete_centre(problem: Problem) -> Reports:
    """The patch has only one of x0 and y0, or none without ROD.

    Remedy: Both, or neither with ROD.
    """
    card = problem.deck.require(model.Patch)
    if (card.x is None) != (card.y is None):
        present, missing = ("y0", "x0") if card.x is None else ("x0", "y0")
        message = f"The centre of the patch has {present}, but no {missing}."
        hint = "give both coordinates, or leave both blank for the node of ROD"
        yield Report(message, card.place(f"centre {missing}"), hint)
    elif card.x is None and not problem.deck.has(model.Impact):
        message = "The patch has no centre, and the deck no ROD segment."
        yield Report(message, card.place(), "give x0 and y0 on the card of PATC")


@reports("E409")
def patch_without_w(problem: Problem) -> Reports:
    """Find an impact dof that a pressure does not push."""
    impact = problem.deck.last(model.Impact)
    if impact is not None and impact.dof != W + 1:
        message = f"With a patch the impact unknown is 3 (w), not {impact.dof}."
        yield Report(message, impact.place("impact unknown"), "a pressure pushes w")


@rule("E445", Subject.POINTS)
def patch_off_the_plate(problem: Problem) -> Reports:
    """A part of the patch is off the plate, or w is restrained under it.

    Remedy: A smaller radius, another centre.
    """
    card = problem.deck.require(model.Patch)
    try:
        patch = problem.patch
    except PatchError as error:
        reason = str(error)
        hint = (
            "the whole circle must be on the plate: a smaller radius, another centre, or a point "
            "force without PATC (fecm new --patch none)"
        )
        yield Report(f"{reason[0].upper()}{reason[1:]}.", card.place(), hint)
        return
    if patch is not None and (held := _held(problem, patch)):
        message = f"w of {held} under the patch is restrained."
        yield Report(message, card.place(), "a BOUN card restrains it")


def _held(problem: Problem, patch: ContactPatch) -> str:
    """Name a node or a side under a patch whose w is restrained; empty without one."""
    mesh = problem.mesh
    held = mesh.codes[:, W] != 0
    centre = np.array([patch.x, patch.y])
    near = np.hypot(*(mesh.coordinates - centre).T) <= patch.radius
    if (held & near).any():
        return f"node {np.argmax(held & near) + 1}"
    for family in problem.mesh.families:
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


@rule("W447", Subject.POINTS)
def unresolved_patch(problem: Problem) -> Reports:
    """The mesh at the patch is too coarse for its radius or for stored stresses.

    With a radius on the card: the element is larger than the radius c. With stored ply stresses: it
    is larger than 2.6 times R = c + h/2. Strains near the patch depend on the mesh, and the peak
    force is too high.

    Remedy: A finer mesh at the patch (`fecm new --grading`); `fecm check --mesh-error`: see
    [checking a deck](checking.md).
    """
    card, patch = problem.deck.require(model.Patch), problem.patch
    if patch is None:
        return
    side = problem.patch_side * (1.0 - 1e-9)
    reach = problem.reach_of_load
    if card.radius is not None and patch.radius < side:
        limit = f"the radius of the patch, {patch.radius:.4g}"
    elif any(m.word == "PLYS" for m in problem.deck.macros) and RESOLVED * reach < side:
        limit = f"{RESOLVED:g} R = {RESOLVED * reach:.4g}, with R = c + h/2 of the patch"
    else:
        return
    message = (
        f"The side of the element at the patch, {side:.4g}, is larger than {limit}: strains and "
        "stresses near the patch depend on the mesh, and the peak force is too high."
    )
    hint = (
        "refine the mesh at the patch, with more elements or fecm new --grading; fecm check "
        "--mesh-error shows the effect on the peak"
    )
    yield Report(message, card.place("radius c"), hint)


def _longest_side(mesh: MeshArrays, rows: Indices | Bools) -> float:
    """Return the longest side of the elements in some rows."""
    return float(longest_sides(mesh.elements[rows], mesh.coordinates).max(initial=0.0))


@rule("W474", Subject.POINTS)
def blank_radius(problem: Problem, card: model.Patch) -> Reports:
    """PATC with commas has a blank radius.

    The values after it are centre and static load.

    Remedy: `DISC,1.,50.,50.`: columns 5–10 need no field of their own.
    """
    if card.radius is not None or card.x is None or card.y is None:
        return
    if not card.load or card.source is None or "," not in card.source.card.data:
        return
    x, y = problem.mesh.coordinates[problem.deck.require(model.Impact).node - 1]
    if math.hypot(card.y - x, card.load - y) >= math.hypot(card.x - x, card.y - y):
        return
    shape, _, *texts = (text for _, text in card.source.card.cut(card.source.fields))
    message = (
        f"The radius on PATC is blank; the values after it are the centre ({card.x:g}, {card.y:g}) "
        f"and a static load of {card.load:g}."
    )
    corrected = ",".join([shape, *texts])
    hint = (
        f"if {card.x:g} is the radius, the card is `{corrected}`: a comma ends a field, no columns"
    )
    yield Report(message, card.place("radius c"), hint)


@rule("N473", Subject.POINTS)
def patch_away_from_node(problem: Problem, card: model.Patch) -> Reports:
    """The patch is away from ROD's node.

    The distance is above its radius and the sides of the elements there. The force acts on the
    patch.

    Remedy: x0 and y0 blank for the node of ROD.
    """
    patch, mesh, impact = problem.patch, problem.mesh, problem.deck.require(model.Impact)
    if patch is None:
        return
    x, y = mesh.coordinates[impact.node - 1]
    side = _longest_side(mesh, (mesh.elements == impact.node).any(axis=1))
    distance = math.hypot(patch.x - x, patch.y - y)
    if distance > max(patch.radius, side):
        message = (
            f"the contact force acts on the patch at ({patch.x:g}, {patch.y:g}), {distance:.3g} "
            f"from node {impact.node} of ROD at ({x:g}, {y:g}), whose place is not used"
        )
        yield Report(message, card.place("centre x0"), "leave x0 and y0 blank for the node of ROD")


def _large_patch(problem: Problem, card: model.Patch, limit: float) -> str:
    """Describe a patch with a radius above a limit and far above that of the contact.

    The text is empty for other patches.
    """
    thickness = problem.laminate.thickness
    if card.radius is None or card.radius <= limit:
        return ""
    law = problem.deck.require(model.Indentation)
    with np.errstate(all="ignore"):
        indentation = (expected_peak(problem.deck, problem.plate) / law.k) ** (2.0 / 3.0)
        contact = math.sqrt(sphere_radius(problem) * indentation)
    if not card.radius > LARGE * contact > 0.0:
        return ""
    return (
        f"radius of the patch, {card.radius:g}, is {card.radius / thickness:.2g} times the "
        f"thickness; a sphere with this k touches on a radius of about {contact:.2g}"
    )


def _judges_stresses(problem: Problem) -> bool:
    """Return whether stresses under the load are stored or judged."""
    return any(macro.word in ("FAIL", "PLYS") for macro in flat(problem.program))


def _radius_hint(card: model.Patch) -> str:
    return f"a blank takes {RADIUS_PER_THICKNESS[card.shape]:g} times the thickness"


@rule("W475", Subject.POINTS)
def large_patch(problem: Problem, card: model.Patch) -> Reports:
    """The radius of the patch looks like the radius of the indenter.

    It is more than twice the radius of the contact, and more than twice the thickness or half the
    radius of a sphere with this k.

    Remedy: The radius of the contact, or blank for 0.327 h.
    """
    limit = min(LARGE * problem.laminate.thickness, INDENTER * sphere_radius(problem))
    if _judges_stresses(problem) and (what := _large_patch(problem, card, limit)):
        message = (
            f"The {what}. It looks like the radius of the indenter: stresses and exposures under "
            "the load would be too small."
        )
        yield Report(message, card.place("radius c"), _radius_hint(card))


@rule("N475", Subject.POINTS)
def large_patch_without_stresses(problem: Problem, card: model.Patch) -> Reports:
    """The radius of the patch is large, but only the force depends on it.

    The program has neither FAIL nor PLYS. The radius is more than twice the radius of the contact
    and the thickness.

    Remedy: The radius of the contact, or blank for 0.327 h.
    """
    limit = LARGE * problem.laminate.thickness
    if not _judges_stresses(problem) and (what := _large_patch(problem, card, limit)):
        yield Report(f"the {what}", card.place("radius c"), _radius_hint(card))


@rule("W568", Subject.POINTS)
def small_patch(problem: Problem, card: model.Patch) -> Reports:
    """The radius of the patch is below a hundredth of the thickness.

    It is likely in another unit. The load is that of a point, and stresses under it are too large.

    Remedy: The radius of the contact in the deck's unit of length, or blank for 0.327 h.
    """
    thickness = problem.laminate.thickness
    if card.radius is None or card.radius >= SMALL * thickness:
        return
    names = unit_names(problem.deck)
    usual = RADIUS_PER_THICKNESS[card.shape] * thickness
    factor = in_si("length", names)
    looks = "" if factor is None else looks_like(card.radius, "length", usual * factor, names)
    message = (
        f"The radius of the patch, {card.radius:g}, is {card.radius / thickness:.2g} times the "
        f"thickness"
    )
    yield Report(
        f"{message}: it {looks or 'looks like another unit'}.",
        card.place("radius c"),
        _radius_hint(card),
    )


# One of these is enough.
OF_PATCH = (
    unknown_shape,
    invalid_radius,
    incomplete_centre,
    patch_without_w,
    patch_off_the_plate,
    unresolved_patch,
)
VALUES = (
    blank_radius,
    patch_away_from_node,
    small_patch,
    large_patch,
    large_patch_without_stresses,
)
