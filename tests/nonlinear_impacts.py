"""Decks of impacts and pulses on plates that stretch as they bend.

Units are mm, N, s.  Edges are named as in the reference data: ``clamped`` or ``ss``, and in the
plane ``immovable`` or ``movable``.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from fecm import Deck, Ply
from fecm.deck import model
from fecm.deck.grid import ElementGrid, boundary_cards, grid_lines, uniform_section
from fecm.deck.model import ElementNodes, Impact, LoadTable, Macro, NodeValues, Patch, Projectile
from fecm.mechanics.time_step import critical_time_step, rounded_time_step
from fecm.problem.generate import generate
from fecm.problem.parts import build_plate
from fecm.verification import decks
from tests.builders import Floats, Ints

ISOTROPIC = decks.isotropic(70e3, 0.3, 2.7e-9, 5.0 / 6.0)
CROSS = Ply(1.53e-9, 0.3, 141e3, 9700.0, 5500.0, 5500.0 * 5.0 / 6.0, 3700.0 * 5.0 / 6.0)
MASS = 1e-3  # 1 kg
# Places of an element's nodes on the grid of its mid-sides, along a row and up.
HALVES = ((0, 2, 2, 0, 1, 2, 1, 0, 1), (0, 0, 2, 2, 0, 1, 2, 1, 1))
RIMS = {"clamped_immovable": (1, 1, 1, 1, 1), "ss_movable": (0, 0, 1, 0, 0)}
# Codes of u, v, w, theta_x and theta_y: inside, and on the left, bottom, right and top edge.
SUPPORTS = {
    "clamped_immovable": "00000 11111 11111 11111 11111",
    "ss_immovable": "00000 11101 11110 11101 11110",
    "ss_movable": "00000 00101 00110 00101 00110",
}


def with_time_step(deck: Deck, end: float, program: str) -> Deck:
    """Add a program of as many steps as reach a time; {dt} and {steps} stand in its text."""
    dt = rounded_time_step(critical_time_step(build_plate(deck, generate(deck))))
    text = program.format(dt=repr(dt), steps=round(end / dt))
    return replace(deck, macros=decks.program(text))


IMPACT = "LMAS DT={dt} LOOP={steps} TIME RODP={steps} NEXT"


def with_rows(deck: Deck, every: int) -> Deck:
    """The same impact with strains and displacements stored every so many steps."""
    *before, row, end = deck.macros
    rows = (replace(row, value=float(every)), Macro("DISP", value=float(every)))
    return replace(deck, macros=(*before, *rows, end))


def without_nonlinearity(deck: Deck) -> Deck:
    """The same deck of a linear plate."""
    kept = tuple(s for s in deck.segments if not isinstance(s, model.Nonlinear))
    return replace(deck, segments=kept)


def struck_rectangle(case: str, n: int, velocity: float, end: float) -> Deck:
    """An impact on a rectangular plate of n x n elements: ``iso_`` or ``cross_`` and its edges."""
    kind, edges = case.split("_", 1)
    if kind == "iso":
        a, b, k = 100.0, 100.0, 1e5
        plate = decks.material(ISOTROPIC, [0.0], 2.0)
    else:
        a, b, k = 125.0, 75.0, 5e4
        plate = decks.material(CROSS, [0.0, 90.0, 0.0, 90.0, 90.0, 0.0, 90.0, 0.0], 0.25)
    grid = ElementGrid(uniform_section(a, n), uniform_section(b, n))
    middle = grid.nearest(a / 2.0, b / 2.0)[0]
    segments = (
        decks.restraints(grid, SUPPORTS[edges]),
        Projectile(0, 0, MASS),
        Impact(middle, 3, velocity),
        Patch("HERT", 8.0, a / 2.0, b / 2.0),
        decks.elastic(k),
        decks.MITC,
        model.Nonlinear(),
        plate,
    )
    return with_time_step(decks.deck(grid, segments, ()), end, IMPACT)


def pulsed_square(n: int, pressure: float, end: float, duration: float = 20e-6) -> Deck:
    """A pulse on a quarter of a square plate, 100 x 100 x 1, simply supported, of n x n elements.

    The pressure of shape cos(pi x/a) cos(pi y/a) about the plate's middle, node 1, acts for a time;
    w is stored at every fiftieth step.  The edges hold the displacement across them.
    """
    side = 100.0
    grid = ElementGrid(uniform_section(side / 2.0, n), uniform_section(side / 2.0, n))
    places = np.array(grid_lines(grid.columns))
    along = decks.weights(grid_lines(grid.columns)) * np.cos(np.pi * places / side)
    loads = np.zeros((grid.up, grid.across, 5))
    loads[..., 2] = pressure * np.outer(along, along)
    loads[-1] = loads[:, -1] = 0.0  # a value there would be a displacement
    segments = (
        decks.restraints(grid, "00000 10010 01001 10101 01110"),
        decks.forces(loads),
        decks.MITC,
        model.Nonlinear(),
        decks.material(ISOTROPIC, [0.0], 1.0),
    )
    text = decks.deck(grid, segments, ())
    critical = 0.9 * critical_time_step(build_plate(text, generate(text)))
    # The first step accelerates for half a step: the pulse ends in the middle of one.
    dt = duration / (math.ceil(duration / critical - 0.5) + 0.5)
    program = f"LMAS DT={dt!r} PROP=1 LOOP={round(end / dt)} TIME EXCD DISP=50 NEXT"
    table = LoadTable(1, 1, 0.0, duration, (1.0, 0.0, 0.0, 0.0, 0.0))
    return replace(text, macros=decks.program(program), tables=(table,))


def disc_mesh(radius: float, core: int, rings: int) -> tuple[Floats, Ints]:
    """Mesh a disc about the origin with core^2 + 4 core rings curved 9-node elements.

    A square with bulging sides is in the middle, four blocks are between it and the rim.
    """
    side = np.linspace(-1.0, 1.0, 2 * core + 1)

    def bulging(s: Floats, t: Floats) -> Floats:
        """Points of the square, on its side s = 1 as functions of t."""
        by_t, by_s = 1.0 + 0.12 * (1.0 - t**2), 1.0 + 0.12 * (1.0 - s**2)
        return 0.45 * np.stack([s * by_t, t * by_s], axis=-1)

    # In a block the rows run along the side, counter-clockwise, the columns outwards.
    outwards = np.linspace(0.0, 1.0, 2 * rings + 1)[:, None]
    rim = np.stack([np.cos(np.pi / 4.0 * side), np.sin(np.pi / 4.0 * side)], axis=-1)
    inner = bulging(np.ones_like(side), side)
    block = (1.0 - outwards) * inner[:, None] + outwards * rim[:, None]
    grids = [bulging(*np.meshgrid(side, side))]
    for _ in range(4):
        grids.append(block)
        block = np.stack([-block[..., 1], block[..., 0]], axis=-1)
    points = np.concatenate([grid.reshape(-1, 2) for grid in grids])
    rounded = np.round(points, 9) + 0.0
    _, first, numbers = np.unique(rounded, axis=0, return_index=True, return_inverse=True)
    parts = np.split(numbers.ravel(), np.cumsum([grid[..., 0].size for grid in grids])[:-1])
    elements = []
    for grid, part in zip(grids, parts, strict=True):
        of_grid = part.reshape(grid.shape[:2])
        above, beside = grid.shape[0] - 1, grid.shape[1] - 1
        rows, columns = np.mgrid[0:above:2, 0:beside:2]
        right, up = np.array(HALVES)
        elements.append(of_grid[rows.ravel()[:, None] + up, columns.ravel()[:, None] + right])
    return radius * points[first], np.concatenate(elements).astype(np.int32) + 1


def struck_disc(edges: str, core: int, rings: int, velocity: float, end: float) -> Deck:
    """An impact in the middle of a disc, radius 50 and thickness 2."""
    radius = 50.0
    places, elements = disc_mesh(radius, core, rings)
    from_middle = np.hypot(*places.T)
    codes = np.zeros((len(places), 5), dtype=int)
    codes[np.isclose(from_middle, radius)] = RIMS[edges]
    held = boundary_cards(codes)
    assert held is not None
    points = (NodeValues(n, 0, tuple(at)) for n, at in enumerate(places.tolist(), start=1))
    nodes = (ElementNodes(n, tuple(of), 0) for n, of in enumerate(elements.tolist(), start=1))
    segments = (
        model.Elements(tuple(nodes)),
        model.Coordinates(tuple(points)),
        held,
        Projectile(0, 0, MASS),
        Impact(int(from_middle.argmin()) + 1, 3, velocity),
        Patch("DISC", 5.0, 0.0, 0.0),
        decks.elastic(1e5),
        decks.MITC,
        model.Nonlinear(),
        decks.material(ISOTROPIC, [0.0], 2.0),
    )
    built = Deck("disc", model.Control(len(places), len(elements), 1, 2, 5, 9), segments, ())
    return with_time_step(built, end, IMPACT)
