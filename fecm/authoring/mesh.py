"""Mesh of a plate, the impact node, and the supports."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from enum import Enum, auto
from typing import Literal, NamedTuple, Self

from fecm.authoring.elastic_edges import elastic_edge, is_elastic
from fecm.authoring.laminate import DeckPlies
from fecm.authoring.parameters import (
    ObjectError,
    check_positive,
    is_finite,
    lengths_in_units,
    parameter_in_units,
)
from fecm.authoring.plate import MOST, PUSH, WINDOW_GRADING, WINDOW_MESH, Fixture, Plate
from fecm.deck import grid as grids
from fecm.deck.grid import ElementGrid, GridSection, held_in_plane
from fecm.deck.model import (
    Curvature,
    NodeValues,
    OneSidedSupport,
    OneSidedSupports,
    Patch,
    Segment,
    Springs,
)
from fecm.deck.support_cards import LINE
from fecm.problem.plate_mesh import PlateMesh

MOST_ELEMENTS = 500_000
LEAST_RADIUS = 1e-3  # smallest radius to refine a mesh to, over the side of the plate

InPlane = Literal["free", "held", "normal", "tangential"]  # u and v on supports
FREE: InPlane = "free"
HELD: InPlane = "held"
TANGENTIAL: InPlane = "tangential"
# In-plane displacements that the edges of a curved panel hold, for a note.
HELD_WORDS = {
    "free": "neither u nor v",
    "held": "u and v",
    "normal": "the displacement across the edge",
    "tangential": "the displacement along the edge (SS3)",
}

AnyMesh = ElementGrid | PlateMesh


class Placed(NamedTuple):
    """Mesh, impact node, and patch."""

    mesh: AnyMesh
    node: int
    patch: Patch | None
    point: tuple[float, float]  # place of the node


def place_impact(
    plate: Plate,
    plies: DeckPlies,
    at: tuple[float | str, float | str] | None,
    patch: Patch | None,
    doubts: list[str],
    load: str = "impact point",
) -> Placed:
    """Return the mesh, the impact node and the patch for an impact at a point.

    If the point is moved to a node, `doubts` gets a text about it, which calls the point `load`.
    """
    point = None if at is None else lengths_in_units("at", at, 2, plies.system)
    radius = None if patch is None else patch.radius
    mesh = plate.imported or plate_grid(plate, plies.system, point, radius)
    low, high = mesh.extent
    side = min(high[0] - low[0], high[1] - low[1])
    if plies.thickest >= side:
        raise ObjectError(f"{plies.description}, and the plate's shorter side is {side:g}")
    x, y = point or ((low[0] + high[0]) / 2.0, (low[1] + high[1]) / 2.0)
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
            origin = "the plate's centre" if at is None else "`at`"
            doubts.append(
                f"the {load} is moved by {distance:.4g}: from {origin} at {x:g}, {y:g} to "
                f"the nearest node, {node} at {node_x:g}, {node_y:g}"
            )
    return Placed(mesh, node, patch, (node_x, node_y))


def plate_grid(
    plate: Plate, system: str | None, point: Sequence[float] | None, radius: float | None
) -> ElementGrid:
    """Return the grid of a rectangular plate in a system of units, graded towards a point.

    The point is the centre if it is None.

    On a fixture, `plate.size` and `plate.mesh` describe the window. Its default mesh is refined to
    the radius of a patch.
    """
    is_default = plate.fixture and (plate.mesh, plate.grading) == (WINDOW_MESH, WINDOW_GRADING)
    columns, rows = list(plate.columns), list(plate.rows)
    sides = plate.sides(system)
    if sides and plate.mesh:
        whole = plate.fixture.size if plate.fixture else sides
        centre = point or (whole[0] / 2.0, whole[1] / 2.0)
        columns, rows = (
            _sections(
                side,
                count,
                x - (length - side) / 2.0,
                plate.grading,
                radius if is_default else None,
            )
            for side, count, x, length in zip(sides, plate.mesh, centre, whole, strict=True)
        )
        if plate.fixture:
            columns, rows = grids.framed(columns, whole[0]), grids.framed(rows, whole[1])
    grid = ElementGrid(columns, rows)
    if max(grid.across, grid.up) // 2 > MOST or grid.elements > MOST_ELEMENTS:
        raise ObjectError(
            f"the mesh would have {grid.elements} elements; at most {MOST_ELEMENTS}, and {MOST} "
            "in one direction, are allowed"
        )
    return grid


def _sections(
    length: float, count: int, centre: float, grading: float, radius: float | None
) -> list[GridSection]:
    """Return the sections in one direction, with the smallest elements at `centre`.

    These are refined until their sides fit a radius, if one is given.
    """
    if grading > 1.0:
        sections = grids.graded(length, count, centre, grading)
    else:
        sections = grids.uniform_section(length, count)
    if radius is None or not LEAST_RADIUS * length <= radius < grids.longest_at(sections, centre):
        return sections
    return grids.refined_sections(length, count, centre, grading, radius)


class Supported(NamedTuple):
    """Segments of the supports of a plate, and comment lines about a window."""

    segments: tuple[Segment, ...]
    comment: str


class MembraneSupport(Enum):
    """Reason why u and v of a plate move."""

    AT_REST = auto()  # u and v are zero
    STRETCHES = auto()  # a coupled laminate, or large deflections
    CURVED = auto()

    @classmethod
    def of(cls, *, curved: bool, stretches: bool) -> Self:
        """Return the reason for a plate."""
        if curved:
            return cls.CURVED
        return cls.STRETCHES if stretches else cls.AT_REST


def curvature_of(radius_x: float | None, radius_y: float | None) -> Curvature | None:
    """Return the CURV segment of a shallow panel; None for a flat plate."""
    radii = {"radius_x": radius_x, "radius_y": radius_y}
    for name, radius in radii.items():
        if radius is not None and not (is_finite(radius) and radius):
            raise ObjectError(
                f"`{name}` is {radius!r}; it must be a finite number other than 0: leave it out "
                "for a plate that is flat in this direction"
            )
    if radius_x is None and radius_y is None:
        return None
    return Curvature(radius_x=float(radius_x or 0.0), radius_y=float(radius_y or 0.0))


def support_plate(
    plate: Plate,
    mesh: AnyMesh,
    in_plane: InPlane | None,
    notes: list[str],
    membrane: MembraneSupport,
    system: str | None,
) -> Supported:
    """Return the supports of a plate, in a system of units.

    If u and v are zero anyway, they are held at every node. `in_plane` then has no effect, and
    `notes` gets a text about it.
    """
    if membrane is MembraneSupport.AT_REST:
        if in_plane is not None:
            notes.append(
                "`in_plane` has no effect: the laminate is not coupled and the plate flat and "
                "linear, and its u and v are held everywhere"
            )
        everywhere, in_plane = (1, 1, 0, 0, 0), HELD
    else:
        everywhere = (0, 0, 0, 0, 0)
        default = TANGENTIAL if membrane is MembraneSupport.CURVED else HELD
        in_plane = in_plane or (FREE if plate.fixture else default)
    if membrane is MembraneSupport.CURVED:
        notes.append(_note_of_curved(plate, in_plane))
    if isinstance(mesh, PlateMesh) or (fixture := plate.fixture) is None:
        return Supported(tuple(_on_edges(plate, mesh, everywhere, in_plane, system)), "")
    comment = "! The plate slides on the window: u and v are free.\n" if in_plane == FREE else ""
    segments = _on_fixture(fixture, mesh, everywhere, in_plane, system)
    return Supported(tuple(segments), comment)


def _on_edges(
    plate: Plate, mesh: AnyMesh, everywhere: Sequence[int], in_plane: InPlane, system: str | None
) -> Iterator[Segment]:
    """Yield the segments of the restraints and the springs of the edges."""
    elastic = {
        name: elastic_edge(name, text, system)
        for name, text in plate.supports.items()
        if is_elastic(text)
    }
    supports = {**plate.supports, **{name: edge.restraint for name, edge in elastic.items()}}
    boundary = mesh.supported(everywhere, supports, in_plane=in_plane)
    springs = mesh.springs({name: edge.stiffness for name, edge in elastic.items()}, supports)
    yield from (segment for segment in (boundary, springs) if segment is not None)


def _on_fixture(
    fixture: Fixture,
    mesh: ElementGrid,
    everywhere: Sequence[int],
    in_plane: InPlane,
    system: str | None,
) -> Iterator[Segment]:
    """Yield the segments of a window and its clamps."""
    pushes = fixture.support == PUSH
    tips = [] if fixture.clamps is None else tips_on(mesh, fixture)
    held = tips if fixture.clamps == HELD else []
    boundary = mesh.supported(
        everywhere, {}, fixture.window, in_plane=in_plane, holds_w=not pushes, points=held
    )
    if boundary is not None:
        yield boundary
    if pushes:
        lines = [OneSidedSupport(*ends) for ends in mesh.window_lines(fixture.window)]
        yield OneSidedSupports(tuple(lines), word=LINE)
    if tips and not held:
        stiffness = parameter_in_units("clamps", fixture.clamps, "force/length", system)
        check_positive(clamps=stiffness)
        values = (0.0, 0.0, float(stiffness or 0.0), 0.0, 0.0)
        yield Springs(tuple(NodeValues(node, 0, values) for node in tips))


def tips_on(mesh: AnyMesh, fixture: Fixture) -> list[int]:
    """Return the nodes, from 1, nearest to the tips of the clamps of a fixture."""
    return sorted({mesh.nearest(*place)[0] for place in fixture.tips})


def _note_of_curved(plate: Plate, in_plane: InPlane) -> str:
    """Return a note about the in-plane supports of a curved panel, which decide its stiffness."""
    kinds: dict[str, str] = {"window": in_plane} if plate.fixture else {}
    for support in sorted(set(plate.supports.values()) - {"free"}):
        kinds[support] = held_in_plane(support, in_plane)
    held = ", ".join(f"{name} edges hold {HELD_WORDS[word]}" for name, word in kinds.items())
    note = f"the panel is curved (CURV): in its plane {held or 'no edge holds u or v'}"
    simple = kinds.get("simple") == TANGENTIAL
    return f"{note}; `support` pinned holds both" if simple else note
