"""Decks of impacts and pulses on plates that stretch as they bend.

Units are mm, N, s.  Edges are named as in the reference data: ``clamped`` or ``ss``, and in the
plane ``immovable``, ``normal`` (only the displacement across the edge is held) or ``movable``.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from fecm.deck import model
from fecm.deck.grid import Grid, boundary_cards, lines, uniform
from fecm.deck.model import Deck, Impact, LoadTable, NodeValues, Patch, Ply, Projectile
from fecm.mechanics.time_step import critical_time_step, rounded_time_step
from fecm.problem.generate import generate
from fecm.problem.parts import build_plate
from fecm.verification import decks

ISOTROPIC = decks.isotropic(70e3, 0.3, 2.7e-9, 5.0 / 6.0)
CROSS = Ply(1.53e-9, 0.3, 141e3, 9700.0, 5500.0, 5500.0 * 5.0 / 6.0, 3700.0 * 5.0 / 6.0)
MASS = 1e-3  # 1 kg
# Codes of u, v, w, theta_x and theta_y: inside, and on the left, bottom, right and top edge.
SUPPORTS = {
    "clamped_immovable": "00000 11111 11111 11111 11111",
    "clamped_movable": "00000 00111 00111 00111 00111",
    "ss_immovable": "00000 11101 11110 11101 11110",
    "ss_normal": "00000 10101 01110 10101 01110",
    "ss_movable": "00000 00101 00110 00101 00110",
}


def with_time_step(made: Deck, end: float, program: str) -> Deck:
    """Add a program of as many steps as reach a time; {dt} and {steps} stand in its text."""
    dt = rounded_time_step(critical_time_step(build_plate(made, generate(made))))
    text = program.format(dt=repr(dt), steps=round(end / dt))
    return replace(made, macros=decks.program(text))


IMPACT = "LMAS DT={dt} LOOP={steps} TIME RODP={steps} NEXT"


def without_nonlinearity(made: Deck) -> Deck:
    """The same deck of a linear plate."""
    kept = tuple(s for s in made.segments if not isinstance(s, model.Nonlinear))
    return replace(made, segments=kept)


def struck_rectangle(case: str, n: int, velocity: float, end: float) -> Deck:
    """An impact on a rectangular plate of n x n elements: ``iso_`` or ``cross_`` and its edges."""
    kind, edges = case.split("_", 1)
    if kind == "iso":
        a, b, k = 100.0, 100.0, 1e5
        plate = decks.material(ISOTROPIC, [0.0], 2.0)
    else:
        a, b, k = 125.0, 75.0, 5e4
        plate = decks.material(CROSS, [0.0, 90.0, 0.0, 90.0, 90.0, 0.0, 90.0, 0.0], 0.25)
    grid = Grid(uniform(a, n), uniform(b, n))
    middle = grid.nearest(a / 2.0, b / 2.0)[0]
    segments = (
        decks.supports(grid, SUPPORTS[edges]),
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
    w is stored at every fifth step.  The edges hold the displacement across them.
    """
    side = 100.0
    grid = Grid(uniform(side / 2.0, n), uniform(side / 2.0, n))
    places = np.array(lines(grid.columns))
    along = decks.weights(lines(grid.columns)) * np.cos(np.pi * places / side)
    loads = np.zeros((grid.up, grid.across, 5))
    loads[..., 2] = pressure * np.outer(along, along)
    loads[-1] = loads[:, -1] = 0.0  # a value there would be a displacement
    segments = (
        decks.supports(grid, "00000 10010 01001 10101 01110"),
        decks.forces(loads),
        decks.MITC,
        model.Nonlinear(),
        decks.material(ISOTROPIC, [0.0], 1.0),
    )
    made = decks.deck(grid, segments, ())
    critical = 0.9 * critical_time_step(build_plate(made, generate(made)))
    # The first step accelerates for half a step: the pulse ends in the middle of one.
    dt = duration / (math.ceil(duration / critical - 0.5) + 0.5)
    program = f"LMAS DT={dt!r} PROP=1 LOOP={round(end / dt)} TIME EXCD DISP=5 NEXT"
    table = LoadTable(1, 1, 0.0, duration, (1.0, 0.0, 0.0, 0.0, 0.0))
    return replace(made, macros=decks.program(program), tables=(table,))


def struck_disc(edges: str, n: int, velocity: float, end: float) -> Deck:
    """An impact in the middle of a disc, radius 50 and thickness 2: n x n elements, mapped."""
    radius = 50.0
    grid = Grid(uniform(2.0, n), uniform(2.0, n))
    x, y = (at.ravel() - 1.0 for at in np.meshgrid(lines(grid.columns), lines(grid.rows)))
    places = radius * np.stack([x * np.sqrt(1.0 - y**2 / 2.0), y * np.sqrt(1.0 - x**2 / 2.0)], 1)
    cards = (NodeValues(i, 0, tuple(place)) for i, place in enumerate(places.tolist(), start=1))
    rim = {"clamped_immovable": "11111", "ss_movable": "00100"}[edges]
    segments = (
        decks.supports(grid, "00000" + 4 * f" {rim}"),
        Projectile(0, 0, MASS),
        Impact(int(np.hypot(x, y).argmin()) + 1, 3, velocity),
        Patch("DISC", 5.0, 0.0, 0.0),
        decks.elastic(1e5),
        decks.MITC,
        model.Nonlinear(),
        decks.material(ISOTROPIC, [0.0], 2.0),
    )
    made = decks.deck(grid, segments, (), model.Coordinates(tuple(cards)))
    return with_time_step(made, end, IMPACT)
