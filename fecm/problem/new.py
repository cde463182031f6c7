"""A ready deck from plate, layup, supports and impact."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from fecm.deck.grid import Grid
from fecm.deck.model import Deck, Impact, Indentation, Material, Projectile, Segment, Units
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
# Rows of strains and displacements that are stored where nothing else is asked for.
ROWS = 200


@dataclass(frozen=True)
class Specification:
    """What an engineer knows of an impact.

    Attributes
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
    """

    title: str
    grid: Grid
    angles: Sequence[float]
    ply_thickness: float
    ply: Ply
    supports: dict[str, str]
    at: tuple[float, float]
    velocity: float
    law: Indentation
    duration: float
    projectile: Projectile | None = None
    dt: float | None = None
    every: int | None = None
    units: Units | None = None


def new_deck(spec: Specification) -> Deck:
    """Make the deck of a specification.

    A laminate without coupling keeps its in-plane unknowns restrained, as the report's does; any
    other has them free, and held where an edge is supported.
    """
    grid = spec.grid
    total = float(f"{len(spec.angles) * spec.ply_thickness:.9g}")
    layers = tuple(
        Layer(number, angle, spec.ply_thickness)
        for number, angle in enumerate(spec.angles, start=1)
    )
    material = Material(Integration(ORDER, ORDER, NODAL_POINTS, total), spec.ply, layers)
    coupled = laminate(spec.ply, spec.angles, [spec.ply_thickness] * len(layers)).is_coupled
    in_plane = (0, 0) if coupled else (1, 1)
    held = {
        "free": (0, 0, 0, 0, 0),
        "clamped": (1, 1, 1, 1, 1),
        # The rotation along an edge x = const is theta_y, along y = const theta_x.
        "simple-x": (1, 1, 1, 0, 1),
        "simple-y": (1, 1, 1, 1, 0),
    }
    edges = {
        edge: held[
            spec.supports[edge]
            if spec.supports[edge] != "simple"
            else ("simple-x" if edge in ("left", "right") else "simple-y")
        ]
        for edge in EDGES
    }
    boundary = grid.boundary((*in_plane, 0, 0, 0), edges)
    node = grid.nearest(*spec.at)[0]
    segments: list[Segment] = [] if spec.units is None else [spec.units]
    segments += [grid.coordinates(), grid.element_cards()]
    segments += [] if boundary is None else [boundary]
    segments += [] if spec.projectile is None else [spec.projectile]
    segments += [Impact(node, 3, spec.velocity), spec.law, material]
    control = Control(grid.nodes, grid.elements, len(layers), 2, 5, 9)
    deck = Deck(spec.title, control, tuple(segments), ())
    dt = spec.dt if spec.dt is not None else _safe_step(deck)
    return replace(deck, macros=_program(spec, dt))


def _safe_step(deck: Deck) -> float:
    """0.9 of the critical time step, rounded down to two digits."""
    return rounded_time_step(critical_time_step(build_plate(deck, generate(deck))))


def _program(spec: Specification, dt: float) -> tuple[Macro, ...]:
    """Macro program of an impact of the given duration."""
    steps = max(1, math.ceil(spec.duration / dt - 1e-9))
    every = spec.every if spec.every is not None else max(1, steps // ROWS)
    return (
        Macro("LMAS"),
        Macro("DT", value=dt),
        Macro("LOOP", value=float(steps)),
        Macro("TIME"),
        Macro("RODP", value=float(every)),
        Macro("DISP", value=float(every)),
        Macro("NEXT"),
    )
