"""Rules about lines of symmetry of a half or a quarter of a plate."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fecm.deck import model
from fecm.deck.rules import Report, Reports, Subject, rule
from fecm.mechanics.interpolation import W
from fecm.mechanics.mesh import extent
from fecm.problem.parts import THETA_X, moves_in_plane
from fecm.problem.problem import Problem
from fecm.problem.symmetry import AXES, InPlaneHold, broken_entries, nodes_on


@rule("W565", Subject.IMPACT)
def mirrored_impact(problem: Problem) -> Reports:
    """The impact is not on a line of symmetry of the deck.

    Along a straight edge w is free and the slope across it is held: the edge is a line of symmetry.
    It mirrors the impact, so that the plate is hit at several places at once.

    Remedy: The impact node on the line, or the whole plate.
    """
    symmetry, place = problem.symmetry, problem.load_place
    if not symmetry.mirrors or place is None:
        return
    lines = " and ".join(map(str, symmetry.mirrors))
    verb = "is a line" if len(symmetry.mirrors) == 1 else "are lines"
    message = (
        f"The edge {lines} {verb} of symmetry, and the impact at ({place[0]:g}, {place[1]:g}) is "
        "not on it: its mirror images hit the plate at the same time."
    )
    hint = "put the impact node on the line, or model the whole plate"
    yield Report(message, problem.deck.require(model.Impact).place("impact node"), hint)


@rule("W566", Subject.LAMINATE)
def plate_without_symmetry(problem: Problem) -> Reports:
    """The plate does not have the symmetry of its lines of symmetry.

    A16, A26, D16 or D26 of the laminate, or a shear preload or twist, change sign in a mirror: half
    of such a plate does not move as the whole. With B ≠ 0 the line must not move across itself
    if B16 and B26 are 0 (cross-ply), or along itself if these are the only ones (antisymmetric
    angle-ply, linear and flat).

    Remedy: The whole plate.
    """
    for line in problem.symmetry.lines:
        if reasons := list(_broken(problem, line.hold, str(line))):
            message = (
                f"The edge {line} is a line of symmetry by its restraints, but the plate is not "
                f"symmetric about it: {', '.join(reasons)}. Half of it does not move as the whole."
            )
            boundary = problem.deck.last(model.Boundary)
            place = None if boundary is None else boundary.place()
            yield Report(message, place, "model the whole plate")


def _broken(problem: Problem, hold: InPlaneHold, line: str) -> Iterator[str]:
    """Yield what breaks the symmetry about a line."""
    plate, in_plane = problem.plate, moves_in_plane(problem.deck)
    numbers = list(problem.deck.layers)
    for number in problem.used_laminates:
        entries = broken_entries(plate.laminates[number], hold, in_plane=in_plane)
        if entries:
            name = f"laminate {numbers[number]}" if plate.others else "the laminate"
            yield f"{name} has {' and '.join(entries)}"
    if plate.preload[2]:
        yield "the preload has N0xy"
    if plate.curvature[2]:
        yield "the panel has Rxy"
    if hold is InPlaneHold.ALONG and (plate.nonlinear or plate.is_curved):
        yield f"{line} is held along itself, which no nonlinear or curved plate needs"


@rule("W567", Subject.IMPACT)
def part_of_a_line(problem: Problem) -> Reports:
    """The impact node has the restraints of a line of symmetry, but its edge has not.

    The slope across the edge is held at the impact node, and free at other nodes of the edge, or
    the edge moves in the plane. The plate is taken as whole: no force or energy is multiplied.

    Remedy: The same restraints along the whole edge, or none at the impact node.
    """
    mesh, impact = problem.mesh, problem.deck.require(model.Impact)
    if impact.dof != W + 1 or problem.deck.has(model.Patch):
        return
    low, high = extent(mesh.coordinates[mesh.used])
    struck = {line.axis for line in problem.symmetry.struck}
    for axis, rotation in enumerate(("theta_x", "theta_y")):
        if axis in struck or mesh.codes[impact.node - 1, THETA_X + axis] == 0:
            continue
        for place in (float(low[axis]), float(high[axis])):
            edge = nodes_on(mesh, axis, place)
            if not edge[impact.node - 1]:
                continue
            moving = edge & (mesh.codes[:, W] == 0)
            turned = np.count_nonzero(mesh.codes[moving, THETA_X + axis])
            message = (
                f"The impact node is on the edge {AXES[axis]} = {place:.6g}, and {rotation} is "
                f"restrained there, as on a line of symmetry, but the edge is none: {rotation} is "
                f"restrained at {turned} of {np.count_nonzero(moving)} nodes with free w. The "
                "plate is taken as whole."
            )
            hint = "on a line of symmetry the slope and the displacement across it are held"
            yield Report(message, impact.place("impact node"), hint)


OF_IMPACT = (mirrored_impact, plate_without_symmetry, part_of_a_line)
