"""Failure of plies and interfaces in a field that is held (mm, N, s)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fecm.deck.grid import Grid, lines, uniform
from fecm.deck.model import Allowables, Ply
from fecm.verification import decks
from fecm.verification.case import Value, case

CARBON = Ply(1.6e-9, 0.3, 150e3, 10e3, 5e3, 5e3, 3.5e3)
ANGLES = (30.0, -45.0, 90.0)
PLY_THICKNESS = 0.25
STRENGTHS = Allowables(2000.0, 1200.0, 60.0, 200.0, 90.0, 80.0, 50.0, -0.4, 0.3, 0.25)
# By x, y, xx, xy and yy of u, v and the negatives of the rotations, in the middle of the element.
FIELD = np.array([
    [-3.0, 5.0, -1.5, 2.0, 1.25],
    [5.0, 2.0, 0.75, -1.5, -0.25],
    [-12.0, -3.0, 0.5, -0.5, 1.75],
    [-3.0, -7.0, 0.25, -1.75, 1.75],
]) * 1e-3  # fmt: skip
CRITERIA = ("max_stress", "tsai_wu", "hashin", "puck")


@case
def _failure_states() -> Sequence[Value]:
    """Exposures in the middle of an element, one of whose w is free."""
    grid = Grid(uniform(1.0, 1), uniform(1.0, 1))
    x, y = (v.ravel() - 0.5 for v in np.meshgrid(lines(grid.columns), lines(grid.rows)))
    u, v, p, q = FIELD @ [x, y, x * x / 2.0, x * y, y * y / 2.0]
    plate = decks.material(CARBON, ANGLES, PLY_THICKNESS, points=1)
    held = decks.forces(np.stack([u, v, 0.0 * u, -p, -q], axis=1))
    macros = decks.program("TANG FORM SOLV FAIL")
    found = decks.result_of(decks.deck(grid, (decks.held_but(2), held, STRENGTHS, plate), macros))
    plies = [found[f"failure/{name}/exposure"].max(axis=(0, 1, 3)) for name in CRITERIA]
    return [*np.ravel(plies), *found["failure/interlaminar/exposure"][0]]


# σ2 and τ12 of a ply at 0 degrees that is pressed across its fibres; the action plane is inclined.
PRESSED = ((-180.0, 0.0), (-180.0, 60.0), (-150.0, -80.0))


@case
def _inclined_failure() -> Sequence[Value]:
    """Puck's exposure in constant stresses of one element, by which mode C decides."""
    grid = Grid(uniform(1.0, 1), uniform(1.0, 1))
    x, y = (v.ravel() - 0.5 for v in np.meshgrid(lines(grid.columns), lines(grid.rows)))
    plate, macros = decks.material(CARBON, [0.0], 1.0), decks.program("TANG FORM SOLV FAIL")
    found = []
    for across, shear in PRESSED:
        strain = (-CARBON.nu12 * across / CARBON.e1, across / CARBON.e2, shear / CARBON.g12)
        held = decks.forces(decks.constant_strains(x, y, (0.0, 0.0, 0.0), strain=strain))
        segments = (decks.held_but(2), held, STRENGTHS, plate)
        result = decks.result_of(decks.deck(grid, segments, macros))
        found.append(result["failure/puck/exposure"].max())
    return found
