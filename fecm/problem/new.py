"""Write a deck from plate, layup, supports and impact."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from fecm.deck.grid import Grid
from fecm.deck.model import (
    Allowables,
    Deck,
    Impact,
    Indentation,
    Material,
    Patch,
    Projectile,
    Segment,
    Shear,
    Units,
)
from fecm.deck.records import Control, Integration, Layer, Macro, Ply
from fecm.mechanics.laminate import laminate
from fecm.mechanics.time_step import critical_time_step, rounded_time_step
from fecm.problem.build import build_plate
from fecm.problem.generate import generate

EDGES = ("left", "right", "bottom", "top")
# Restraints of an edge: nothing; w and the rotation along the edge; everything out of the plane.
SUPPORTS = ("free", "simple", "clamped")

ORDER = 3
NODAL_POINTS = -3
# Default number of stored rows of strains and displacements.
ROWS = 200


def new_deck(
    *,
    title: str,
    grid: Grid,
    angles: Sequence[float],
    ply_thickness: float,
    ply: Ply,
    supports: dict[str, str],
    at: tuple[float, float],
    velocity: float,
    law: Indentation,
    duration: float,
    projectile: Projectile | None = None,
    dt: float | None = None,
    every: int | None = None,
    units: Units | None = None,
    patch: Patch | None = None,
    shear: Shear | None = None,
    window: tuple[float, float] | None = None,
    damage: Sequence[Segment] = (),
) -> Deck:
    """Build the deck of an impact.

    A laminate without coupling has its in-plane dofs restrained, as the report's does; any other
    has them free, and restrained only where an edge is supported.

    Parameters
    ----------
    title : str
    grid : Grid
    angles : sequence of float
        Fibre angles in degrees, from the struck face on.
    ply_thickness : float
        Length.
    ply : Ply
    supports : dict
        Support of each of :data:`EDGES`.
    at : tuple of float
        Impact point; the nearest node is hit.
    velocity : float
        Approach velocity, length/time.
    law : Indentation
    projectile : Projectile or None
        None for the report's rod.
    duration : float
        Time.
    dt : float or None
        Time step; None for 0.9 of the critical one.
    every : int or None
        Steps between stored rows; None for about 200 rows.
    units : Units or None
        Names of the units.
    patch : Patch or None
        Contact patch; None for a point force.
    shear : Shear or None
        Treatment of transverse shear; None for quadrature.
    window : tuple of float or None
        Sides of a window in the middle, along whose edges w is held; the grid has lines there.
    damage : sequence of Segment
        Strengths, whose criteria FAIL evaluates as often as rows are stored, and toughness.
    """
    total = float(f"{len(angles) * ply_thickness:.9g}")
    layers = tuple(
        Layer(number, angle, ply_thickness) for number, angle in enumerate(angles, start=1)
    )
    material = Material(Integration(ORDER, ORDER, NODAL_POINTS, total), ply, layers)
    coupled = laminate(ply, angles, [ply_thickness] * len(layers)).is_coupled
    in_plane = (0, 0) if coupled else (1, 1)
    # The rotation along an edge x = const is theta_y, along y = const theta_x.
    across, along = (1, 1, 1, 0, 1), (1, 1, 1, 1, 0)
    edges = {
        edge: {
            "free": (0, 0, 0, 0, 0),
            "simple": across if edge in ("left", "right") else along,
            "clamped": (1, 1, 1, 1, 1),
        }[supports[edge]]
        for edge in EDGES
    }
    boundary = grid.boundary((*in_plane, 0, 0, 0), edges, window, (1, 1, 1, 0, 0))
    node = grid.nearest(*at)[0]
    segments = (
        units, grid.coordinates(), grid.element_cards(), boundary, projectile,
        Impact(node, 3, velocity), patch, *damage, law, shear, material,
    )  # fmt: skip
    control = Control(grid.nodes, grid.elements, len(layers), 2, 5, 9)
    deck = Deck(title, control, tuple(s for s in segments if s is not None), ())
    if dt is None:
        dt = rounded_time_step(critical_time_step(build_plate(deck, generate(deck))))
    steps = max(1, math.ceil(duration / dt - 1e-9))
    rows = float(every if every is not None else max(1, steps // ROWS))
    criteria = any(isinstance(segment, Allowables) for segment in damage)
    program = (
        Macro("LMAS"),
        Macro("DT", value=dt),
        Macro("LOOP", value=float(steps)),
        Macro("TIME"),
        Macro("RODP", value=rows),
        Macro("DISP", value=rows),
        *([Macro("FAIL", value=rows)] if criteria else []),
        Macro("NEXT"),
    )
    return replace(deck, macros=program)
