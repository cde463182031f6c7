"""Curved panels for the tests.

``curved_panels.csv`` and ``curved_impact_*.csv`` are Navier solutions of Donnell's theory of
shallow shells with transverse shear, five displacements a mode, computed by another program.  The
panel is 300 x 200 x 2 mm, [0/90/0/90/0]s of IM7/8552, its edges held along themselves and free
across (SS3).  Units are N, mm, t and s; the load acts on a disc of 4 mm in the middle.
"""

from __future__ import annotations

from collections.abc import Iterable

from fecm.deck import model
from fecm.deck.grid import ElementGrid, GridSection, uniform_section
from fecm.verification import decks

PLY = model.Ply(1.57e-9, 0.32, 171420.0, 9080.0, 5290.0, 5290.0, 3242.9)
ANGLES = (0.0, 90.0, 0.0, 90.0, 0.0, 0.0, 90.0, 0.0, 90.0, 0.0)
SIDES = (300.0, 200.0)
THICKNESS = 2.0
# Codes of every node, and of the left, bottom, right and top edge.
SS3 = "00000 01101 10110 01101 10110"
W = "W mm/N (static, disc c=4 in the middle)"
PEAK = "peak force N (mass 2e-5 t, 3000 mm/s, k 5e4 N/mm^1.5, first .8 ms)"
DURATION = 8e-4
IMPACT = (model.Projectile(0, 0, 2e-5), decks.elastic(5e4))
# Radii of the panels of the files; 0 is infinite.
PANELS = ((0.0, 0.0), (0.0, 1000.0), (0.0, 500.0), (500.0, 0.0))


def mesh(along: int) -> ElementGrid:
    """Equal elements of 3:2 sides."""
    return ElementGrid(uniform_section(SIDES[0], along), uniform_section(SIDES[1], along * 2 // 3))


def fine_middle(number: int) -> ElementGrid:
    """So many elements across the 40 mm in the middle, and larger ones around."""
    return ElementGrid(
        [
            GridSection(0.0, 130.0, 8),
            GridSection(130.0, 170.0, number),
            GridSection(170.0, 300.0, 8),
        ],
        [GridSection(0.0, 80.0, 5), GridSection(80.0, 120.0, number), GridSection(120.0, 200.0, 5)],
    )


def panel(
    radii: tuple[float, ...],
    macros: str,
    grid: ElementGrid | None = None,
    *,
    others: Iterable[model.Segment] = (),
    load: float = 0.0,
    angles: tuple[float, ...] = ANGLES,
    codes: str = SS3,
    points: int = -3,
) -> model.Deck:
    """The panel with a load on the disc; its card CURV only with a radius."""
    grid = grid or mesh(12)
    x, y = grid.columns[-1].end / 2.0, grid.rows[-1].end / 2.0
    curved = [model.Curvature(*radii)] if any(radii) else []
    plate = decks.material(PLY, angles, THICKNESS / len(angles), points=points)
    patch = model.Patch("DISC", 4.0, x, y, load)
    held = decks.restraints(grid, codes)
    segments = (held, plate, decks.MITC, patch, *curved, *others)
    return decks.deck(grid, segments, decks.program(macros))


def struck(
    radii: tuple[float, ...],
    grid: ElementGrid,
    dt: float,
    steps: int,
    *,
    others: Iterable[model.Segment] = (),
    more: str = "",
    every: int | None = None,
    velocity: float = 3000.0,
) -> model.Deck:
    """The panel hit in the middle."""
    x, y = grid.columns[-1].end / 2.0, grid.rows[-1].end / 2.0
    hit = model.Impact(grid.nearest(x, y)[0], 3, velocity)
    macros = f"LMAS DT={dt!r} LOOP={steps} TIME RODP={every or steps} {more} NEXT"
    return panel(radii, macros, grid, others=(*IMPACT, hit, *others))


def shortly(radii: tuple[float, ...], velocity: float = 3000.0) -> model.Deck:
    """A few steps of an impact on a coarse mesh."""
    return struck(radii, mesh(12), 5e-7, 300, velocity=velocity)
