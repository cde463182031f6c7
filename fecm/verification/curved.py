"""Shallow curved panels against series: deflections, forces, frequencies and an impact."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

import fecm.verification.decks as decks
from fecm.deck import model
from fecm.deck.catalogue import MATERIALS
from fecm.deck.grid import EDGES, ElementGrid, refined_sections, uniform_section
from fecm.deck.model import Curvature, Impact, Macro, Patch, Projectile
from fecm.results.result import Result
from fecm.verification.case import Value, case
from fecm.verification.impacts import largest_force

SIDES = (300.0, 200.0)  # mm
ELEMENT = 25.0  # side of an element that is not refined
ANGLES = (0.0, 90.0, 0.0, 90.0, 0.0, 0.0, 90.0, 0.0, 90.0, 0.0)
PATCH = Patch("DISC", 4.0, SIDES[0] / 2.0, SIDES[1] / 2.0, 1000.0)
STATIC = decks.program("TANG FORM SOLV DISP STRE")


def panel(
    curvature: Curvature, grid: ElementGrid, macros: Iterable[Macro], *further: model.Segment
) -> Result:
    """Run a simply supported panel (SS3) of IM7/8552 (mm, N, s)."""
    ply = MATERIALS["IM7/8552"].converted("mm-N-s")
    supports = grid.supported((0,) * 5, dict.fromkeys(EDGES, "simple"), in_plane="tangential")
    segments = (supports, curvature, *further, decks.MITC, decks.material(ply, ANGLES, 0.2))
    return decks.run_of_deck(decks.deck(grid, segments, macros))


def refined_grid(side: float) -> ElementGrid:
    """Build a grid whose elements have at most a given side in the middle, where the force acts."""
    return ElementGrid(
        *(refined_sections(a, round(a / ELEMENT), a / 2.0, 2.0, side) for a in SIDES)
    )


def middle_node(grid: ElementGrid) -> int:
    """Return the number of the node in the middle."""
    return grid.nearest(SIDES[0] / 2.0, SIDES[1] / 2.0)[0]


def pressed(curvature: Curvature, grid: ElementGrid) -> tuple[Result, float]:
    """Press the panel in its middle; return the result, and the compliance under the patch."""
    result = panel(curvature, grid, STATIC, PATCH)
    w = result.tape3.w[0, result["patch/node"] - 1] @ result["patch/weight"]
    return result, float(w) / PATCH.load


@case
def _curved_panel() -> Sequence[Value]:
    """Compute compliances, forces and moments per force in the middle, and frequencies."""
    coarse, fine = refined_grid(4.0), refined_grid(2.0)
    flatter = pressed(Curvature(radius_y=1000.0), coarse)[1]
    result, deflection = pressed(Curvature(radius_x=500.0), fine)
    under_load = result["mesh/elements"] == middle_node(fine)
    resultants = [
        field[0][under_load].mean() / PATCH.load
        for field in decks.field_values(result, "stresses", "N_x N_y M_x M_y")
    ]
    even = ElementGrid(*(uniform_section(side, round(1.5 * side / ELEMENT)) for side in SIDES))
    modes = panel(Curvature(radius_y=1000.0), even, decks.program("LMAS EIGE=4"))
    omega = modes.modes.angular_frequency
    return [flatter, deflection, *resultants, *omega[:3]]


@case
def _curved_impact() -> Sequence[Value]:
    """Compute the impact of a mass of 20 g at 3 m/s until 200 us."""
    grid, patch = refined_grid(4.0), model.Patch("DISC", 4.0)
    hit = (Projectile(0, 0, 2.0e-5), Impact(middle_node(grid), 3, 3000.0), decks.elastic(5.0e4))
    macros = decks.history_program(1.6e-7, 1250)
    result = panel(Curvature(radius_x=500.0), grid, macros, patch, *hit)
    return [*largest_force(result), result.plate_w[-1]]


@case
def _curved_strains() -> Sequence[Value]:
    """Compute the strains and the pressure of a twisted nonlinear element with constant w."""
    side, w = 10.0, 0.01
    grid = ElementGrid(uniform_section(side, 1), uniform_section(side, 1))
    held = np.zeros((grid.nodes, 5))
    held[:, 2] = w
    ply = MATERIALS["IM7/8552"].converted("mm-N-s")
    segments = (
        decks.held_but(0, node=5),  # u of the middle node; a constant N does no work on it
        decks.forces(held),
        Curvature(500.0, -1000.0, 800.0),
        model.Nonlinear(),
        decks.MITC,
        decks.material(ply, (30.0,), 0.2),
    )
    macros = decks.program("TANG FORM SOLV STRE REAC")
    result = decks.run_of_deck(decks.deck(grid, segments, macros))
    strains = decks.field_values(result, "stresses", "eps_xx eps_yy gamma_xy")
    pressure = result["reactions/force"][..., 2].sum() / side**2
    return [*(strain / w for strain in strains), pressure / w]
