"""Checks of the contact patch."""

from __future__ import annotations

import numpy as np

from fecm.deck.findings import Findings
from fecm.deck.model import Impact, Patch
from fecm.mechanics.element_groups import element_blocks, longest_sides
from fecm.mechanics.locate import locate
from fecm.mechanics.mesh import Mesh
from fecm.mechanics.patch import DISC, HERTZ, RADIUS_PER_THICKNESS, PatchError
from fecm.problem.build import ContactPatch, Problem, W


def check_patch(problem: Problem, findings: Findings) -> None:
    """Check a PATC segment on a sound mesh."""
    deck, mesh = problem.deck, problem.mesh
    card = deck.require(Patch)
    if card.shape not in RADIUS_PER_THICKNESS:
        findings.add(
            "E442", f"`{card.shape}` is not a shape of a patch.", card.place("shape"),
            f"{DISC} is a uniform pressure, {HERTZ} is Hertz's",
        )  # fmt: skip
        return
    if card.radius is not None and not card.radius > 0.0:
        findings.add(
            "E443", f"The radius of the patch is {card.radius:g}; it must be positive.",
            card.place("radius c"), "a blank takes 0.327 times the thickness (HERT: 0.377)",
        )  # fmt: skip
        return
    if (card.x is None) != (card.y is None):
        given, missing = ("y0", "x0") if card.x is None else ("x0", "y0")
        findings.add(
            "E444", f"The centre of the patch has {given}, but no {missing}.",
            card.place(f"centre {missing}"),
            "give both coordinates, or leave both blank for the node of ROD",
        )  # fmt: skip
        return
    impact = deck.last(Impact)
    if impact is None and card.x is None:
        findings.add(
            "E444", "The patch has no centre, and the deck no ROD segment.", card.place(),
            "give x0 and y0 on the card of PATC",
        )  # fmt: skip
        return
    if impact is not None and impact.dof != W + 1:
        findings.add(
            "E409", f"With a patch the impact unknown is 3 (w), not {impact.dof}.",
            impact.place("impact unknown"), "a pressure pushes w",
        )  # fmt: skip
        return
    try:
        patch = problem.patch
    except PatchError as error:
        findings.add(
            "E445", f"{str(error)[0].upper()}{str(error)[1:]}.", card.place(),
            "the whole circle must be on the plate: a smaller radius, another centre, or a point "
            "force without PATC (fecm new --patch none)",
        )  # fmt: skip
        return
    if patch is None:
        return
    if held := _held(mesh, patch):
        findings.add(
            "E445", f"w of {held} under the patch is restrained.", card.place(),
            "a BOUN card restrains it",
        )  # fmt: skip
        return
    # The default radius belongs to plate theory; few meshes resolve it, and only stresses need it.
    needed = card.radius is not None or any(macro.word == "PLYS" for macro in deck.macros)
    side = _side(mesh, patch)
    if needed and patch.radius < side * (1.0 - 1e-9):
        findings.add(
            "W447",
            f"The radius of the patch, {patch.radius:.4g}, is smaller than the side of its "
            f"element, {side:.4g}: strains and stresses near the patch depend on the mesh, and "
            "the peak force is too high (measured: up to 0.7 % at half the side, 1.5 to 6 % at a "
            "quarter).",
            card.place("radius c"),
            "refine the mesh at the patch; fecm check --mesh-error shows the effect on the peak",
        )


def _held(mesh: Mesh, patch: ContactPatch) -> str:
    """Name a node or a side under a patch whose w is restrained; empty if there is none."""
    held = mesh.codes[:, W] != 0
    centre = np.array([patch.x, patch.y])
    near = np.hypot(*(mesh.coordinates - centre).T) <= patch.radius
    if (held & near).any():
        return f"node {np.argmax(held & near) + 1}"
    for family in element_blocks(mesh.elements, mesh.coordinates):
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


def _side(mesh: Mesh, patch: ContactPatch) -> float:
    """Longest side of the elements that contain the centre of a patch."""
    longest = longest_sides(mesh.elements, mesh.coordinates)
    at = np.array([[patch.x, patch.y]])
    blocks = element_blocks(mesh.elements, mesh.coordinates)
    return max(
        float(longest[block.rows[locate(block, at)[0]]].max(initial=0.0)) for block in blocks
    )
