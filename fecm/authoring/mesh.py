"""Mesh of a plate, the node that is hit, and the supports."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal, NamedTuple

from fecm.authoring.laminate import Plies
from fecm.authoring.parameters import ObjectError, pair
from fecm.authoring.plate import MOST, Plate
from fecm.deck import grid as grids
from fecm.deck.grid import Grid, Section
from fecm.deck.model import Boundary, Patch
from fecm.problem.plate_mesh import PlateMesh

MOST_ELEMENTS = 500_000
LEAST_RADIUS = 1e-3  # least radius of a patch to which a mesh is refined, over the plate's side

InPlane = Literal["free", "held", "normal"]  # u and v on supports
FREE: InPlane = "free"
HELD: InPlane = "held"

AnyMesh = Grid | PlateMesh


class Placed(NamedTuple):
    """Mesh, node that is hit, and patch."""

    mesh: AnyMesh
    node: int
    patch: Patch | None


def placed(
    plate: Plate,
    plies: Plies,
    at: tuple[float, float] | None,
    patch: Patch | None,
    doubts: list[str],
) -> Placed:
    """Mesh, node that is hit, and patch; adds what was changed in them to `doubts`."""
    place = None if at is None else pair("at", at)
    mesh = plate.imported or grid_of(plate, place, None if patch is None else patch.radius)
    low, high = mesh.extent
    side = min(high[0] - low[0], high[1] - low[1])
    if plies.thickest >= side:
        raise ObjectError(f"{plies.said}, and the plate's shorter side is {side:g}")
    x, y = place or ((low[0] + high[0]) / 2.0, (low[1] + high[1]) / 2.0)
    if not (low[0] <= x <= high[0] and low[1] <= y <= high[1]):
        reach = f"x {low[0]:g} to {high[0]:g} and y {low[1]:g} to {high[1]:g}"
        raise ObjectError(f"`at` is outside the plate: {x:g}, {y:g}, where it has {reach}")
    if isinstance(mesh, PlateMesh) and mesh.groups and not plate.supports:
        doubts.append(
            f"the plate is free: no group of the mesh has a support, of {', '.join(mesh.groups)}"
        )

    node, node_x, node_y = mesh.nearest(x, y)
    distance = math.hypot(node_x - x, node_y - y)
    if distance > 1e-9 * max(map(abs, (x, y, node_x, node_y))):
        if patch is not None and isinstance(mesh, PlateMesh):
            patch = replace(patch, x=float(f"{x:.6g}"), y=float(f"{y:.6g}"))
        else:
            asked = "the plate's centre" if at is None else "`at`"
            doubts.append(
                f"the impact point is moved by {distance:.4g}: from {asked} at {x:g}, {y:g} to the "
                f"nearest node, {node} at {node_x:g}, {node_y:g}"
            )
    doubts += _doubts_of_refinement(plate, mesh, patch)
    return Placed(mesh, node, patch)


def _doubts_of_refinement(plate: Plate, mesh: AnyMesh, patch: Patch | None) -> list[str]:
    """Whether a rectangle has other numbers of elements than were given."""
    if not isinstance(mesh, Grid) or plate.mesh is None or plate.fixture is not None:
        return []
    if patch is None or patch.radius is None:
        return []
    counts = mesh.across // 2, mesh.up // 2
    if counts == plate.mesh:
        return []
    new, old = (f"{nx}x{ny}" for nx, ny in (counts, plate.mesh))
    return [
        f"the mesh has {new} elements instead of {old}: their sides at the patch are at most its "
        f"radius {patch.radius:g}"
    ]


def grid_of(plate: Plate, at: tuple[float, float] | None, radius: float | None) -> Grid:
    """Grid of a rectangular plate, refined to the radius of a patch.

    With a fixture, size and mesh are those of its window.
    """
    columns, rows = list(plate.columns), list(plate.rows)
    if plate.size and plate.mesh:
        whole = plate.fixture.size if plate.fixture else plate.size
        place = at or (whole[0] / 2.0, whole[1] / 2.0)
        columns, rows = (
            _sections(side, count, x - (length - side) / 2.0, plate.grading, radius)
            for side, count, x, length in zip(plate.size, plate.mesh, place, whole, strict=True)
        )
        if plate.fixture:
            columns, rows = grids.framed(columns, whole[0]), grids.framed(rows, whole[1])
    grid = Grid(columns, rows)
    if max(grid.across, grid.up) // 2 > MOST or grid.elements > MOST_ELEMENTS:
        raise ObjectError(
            f"the mesh would have {grid.elements} elements; at most {MOST_ELEMENTS}, and {MOST} "
            "in one direction, are allowed"
        )
    return grid


def _sections(
    length: float, count: int, centre: float, grading: float, radius: float | None
) -> list[Section]:
    """Elements in one direction."""
    if grading > 1.0:
        made = grids.graded(length, count, centre, grading)
    else:
        made = grids.uniform(length, count)
    if radius is None or grids.longest_at(made, centre) <= radius:
        return made
    if radius < LEAST_RADIUS * length:
        raise ObjectError(
            f"the mesh is not refined to a radius of {radius:g}, less than {LEAST_RADIUS:g} times "
            f"the plate's side of {length:g}; give `columns` and `rows`"
        )
    return grids.refined(length, count, centre, grading, radius)


class Supported(NamedTuple):
    """Supports of a plate, and comment lines about a window."""

    boundary: Boundary | None
    comment: str


def supported(
    plate: Plate, mesh: AnyMesh, in_plane: InPlane | None, notes: list[str], *, stretches: bool
) -> Supported:
    """Supports of a plate; u and v are held everywhere in one that does not stretch."""
    if not stretches:
        if in_plane is not None:
            notes.append(
                "`in_plane` has no effect: the laminate is not coupled and the plate linear, and "
                "its u and v are held everywhere"
            )
        everywhere, in_plane = (1, 1, 0, 0, 0), HELD
    else:
        everywhere = (0, 0, 0, 0, 0)
        in_plane = in_plane or (FREE if plate.fixture else HELD)
    if isinstance(mesh, PlateMesh):
        return Supported(mesh.supported(everywhere, plate.supports, in_plane=in_plane), "")
    window = plate.fixture.window if plate.fixture else None
    boundary = mesh.supported(everywhere, plate.supports, window, in_plane=in_plane)
    slides = window is not None and in_plane == FREE
    comment = "! The plate slides on the window: u and v are free.\n" if slides else ""
    return Supported(boundary, comment)
