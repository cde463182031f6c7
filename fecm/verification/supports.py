"""Plates on springs and on supports that only push, against programs with p-elements."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

import fecm.verification.decks as decks
from fecm.deck import model
from fecm.deck.grid import ElementGrid, uniform_section
from fecm.deck.model import NodeValues, OneSidedSupport, OneSidedSupports, Ply, Springs
from fecm.deck.support_cards import LINE
from fecm.identification.edges import KR, KW, fit_edges
from fecm.mechanics.interpolation import W
from fecm.mechanics.points import DISC, patch_weights
from fecm.mechanics.solutions import modes, static_response
from fecm.mechanics.symmetry import with_codes
from fecm.problem.generate import generate
from fecm.problem.parts import build_plate
from fecm.verification.case import Value, case

PLY = Ply(1.57e-9, 0.32, 171420.0, 9080.0, 5290.0, 5290.0, 3242.9)  # mm, N, s
WINDOW_PLY = Ply(1.57e-9, 0.32, 161000.0, 11380.0, 5170.0, 5170.0, 3980.0)
CROSS = (0.0, 90.0, 0.0, 90.0, 0.0)
QUASI = 3 * (45.0, 0.0, -45.0, 90.0)
TURN, LIFT = 1e4, 10.0  # stiffness of the edges per length, of the rotation across them and of w
# Hz, of p-elements on these edges.
FREQUENCIES = 349.18913, 562.15961, 781.00559, 906.67897, 919.23708, 1171.04849


@case
def _elastic_edges() -> Sequence[Value]:
    """Compute the lowest frequencies of a plate on elastic edges."""
    grid = ElementGrid(uniform_section(300.0, 24), uniform_section(200.0, 16))
    first, right, last = 1, grid.across, grid.nodes
    left = last - right + 1
    across_x = (0.0, 0.0, LIFT, TURN, 0.0)  # along an edge x = constant
    across_y = (0.0, 0.0, LIFT, 0.0, TURN)
    lines = [(first, left, across_x), (right, last, across_x)]
    lines += [(first, right, across_y), (left, last, across_y)]
    edges = Springs(tuple(NodeValues(*ends) for ends in lines), word=LINE)
    deck = _plate_of_edges(grid, edges)
    plate = build_plate(deck, generate(deck))
    return list(modes(plate, 2, consistent=False).angular_frequency / (2.0 * math.pi))


@case
def _edge_stiffness() -> Sequence[Value]:
    """Fit the stiffness of elastic edges to the frequencies of another program."""
    grid = ElementGrid(uniform_section(300.0, 12), uniform_section(200.0, 8))
    fit = fit_edges(_plate_of_edges(grid), FREQUENCIES, (KR, KW))
    return [k.value for k in fit.stiffness]


def _plate_of_edges(grid: ElementGrid, *edges: Springs) -> model.Deck:
    """Build the plate of elastic edges (mm, N, s), held in its plane."""
    supports = grid.supported((1, 1, 0, 0, 0), {})
    plies = decks.material(PLY, [*CROSS, *CROSS[::-1]], 0.2)
    units = model.Units("mm", "N", "s")
    return decks.deck(grid, [units, supports, *edges, decks.MITC, plies], ())


@case
def _pushing_window() -> Sequence[Value]:
    """Compute the flexibility of a plate on a window that only pushes over that of a held one."""
    grid = ElementGrid(uniform_section(150.0, 24), uniform_section(100.0, 16))
    lines = grid.window_lines((125.0, 75.0))
    window = OneSidedSupports(tuple(OneSidedSupport(*ends) for ends in lines), word=LINE)
    supports = grid.supported((1, 1, 0, 0, 0), {})
    plies = decks.material(WINDOW_PLY, [*QUASI, *QUASI[::-1]], 4.4 / 24.0)
    shear = model.Shear(5.0 / 6.0, assumed=True)
    deck = decks.deck(grid, [supports, window, shear, plies], ())
    plate = build_plate(deck, generate(deck))
    contact = np.zeros(plate.mesh.codes.shape)
    contact[:, W] = patch_weights(plate.mesh, DISC, 0.327 * 4.4, 75.0, 50.0)
    pushed = static_response(plate, contact)
    assert plate.supports is not None
    codes = plate.mesh.codes.copy()
    codes[plate.supports.node, W] = 1
    held = static_response(replace(with_codes(plate, codes), supports=None), contact)
    return [pushed.compliance / held.compliance]
