"""Fields that every mesh must reproduce: constant strains and resultants; the mode of one dof."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fecm.deck.grid import Grid, Section, lines, uniform
from fecm.deck.model import Boundary, Coordinates, Deck, Impact, Projectile, Shear
from fecm.deck.records import NodeCodes, NodeValues
from fecm.mechanics.time_step import critical_time_step
from fecm.problem.build import build_plate
from fecm.problem.generate import generate
from fecm.verification.case import Value, case
from fecm.verification.decks import (
    constant_strains,
    deck,
    elastic,
    fields,
    forces,
    impact_program,
    isotropic,
    material,
    program,
    result_of,
    supports,
    weights,
)
from fecm.verification.parts import FIBRES, THICK

STRESSES = program("TANG FORM SOLV STRE")
IN_PLANE = "eps_xx eps_yy gamma_xy kappa_x kappa_y kappa_xy"

# Corners of the four elements of the patch: no side is parallel to another or to an axis.
CORNERS = np.array([
    [(0.0, 0.0), (1.1, -0.1), (2.0, 0.1)],
    [(-0.1, 0.9), (1.2, 1.1), (2.1, 0.8)],
    [(0.1, 2.0), (0.9, 2.2), (2.0, 1.9)],
])  # fmt: skip


@case("patch")
def patch() -> Sequence[Value]:
    """Strains and a couple of distorted elements in a field of constant strains."""
    fine = np.empty((5, 5, 2))
    fine[::2, ::2] = CORNERS
    fine[::2, 1::2] = (CORNERS[:, 1:] + CORNERS[:, :-1]) / 2.0
    fine[1::2] = (fine[2::2] + fine[:-2:2]) / 2.0
    x, y = fine.reshape(-1, 2).T
    field = constant_strains(x, y, (0.4, -0.5, 0.6), strain=(1e-3, 2e-3, 3e-3))
    field = field.reshape(5, 5, 5)
    field[1:-1, 1:-1] = 0.0  # the inner nodes are free
    grid = Grid(uniform(2.0, 2), uniform(2.0, 2))
    places = enumerate(fine.reshape(-1, 2).tolist(), start=1)
    plate = material(FIBRES, (0.0, 90.0), THICK / 2.0)
    segments = (supports(grid, "00000" + 4 * " 11111"), forces(field), plate)
    coordinates = Coordinates(tuple(NodeValues(n, 0, tuple(place)) for n, place in places))
    found = result_of(deck(grid, segments, STRESSES, coordinates))
    shears = np.array(fields(found, "stresses", "gamma_xz gamma_yz"))
    return [*fields(found, "stresses", IN_PLANE), shears, found["stresses/M_x"]]


def loaded_rectangle(x: Sequence[float], y: Sequence[float], *, shears: bool = False) -> Deck:
    """Build a rectangle of [0/45] under edge tractions, on supports without reactions.

    `x` and `y` are the forces per length of the five dofs on an edge with normal x or y.  With
    `shears` only w moves, and a shear correction factor acts.
    """
    grid = Grid(
        [Section(0.0, 1.2, 1), Section(1.2, 2.0, 1)], [Section(0.0, 0.5, 1), Section(0.5, 1.5, 1)]
    )
    codes = np.tile([1, 1, 0, 1, 1] if shears else [0] * 5, (grid.up, grid.across, 1))
    codes[0, 0, :3] = 1
    if not shears:
        codes[0, -1, 1:3] = codes[-1, 0, 2] = 1
    loads = np.zeros(codes.shape)
    for place, sign in ((-1, 1.0), (0, -1.0)):
        loads[:, place] += sign * np.outer(weights(lines(grid.rows)), x)
        loads[place] += sign * np.outer(weights(lines(grid.columns)), y)
    rows = enumerate(codes.reshape(-1, 5).tolist(), start=1)
    segments = (
        Boundary(tuple(NodeCodes(n, 0, tuple(code)) for n, code in rows if any(code))),
        forces(np.where(codes == 0, loads, 0.0)),
        material(FIBRES, (0.0, 45.0), THICK / 2.0),
        Shear(0.8) if shears else None,
    )
    return deck(grid, segments, STRESSES)


@case("resultants")
def resultants() -> Sequence[Value]:
    """Uniform strains and resultants."""
    n_x, n_y, n_xy, m_x, m_y, m_xy = 100.0, -40.0, 30.0, 0.5, 0.3, -0.2
    # A couple M does work on -theta.
    found = result_of(
        loaded_rectangle((n_x, n_xy, 0.0, -m_x, -m_xy), (n_xy, n_y, 0.0, -m_xy, -m_y))
    )
    sheared = result_of(
        loaded_rectangle((0.0, 0.0, 20.0, 0.0, 0.0), (0.0, 0.0, -8.0, 0.0, 0.0), shears=True)
    )
    return [
        *fields(found, "stresses", f"{IN_PLANE} N_x N_y N_xy M_x M_y M_xy"),
        *fields(sheared, "stresses", "gamma_xz gamma_yz Q_x Q_y"),
    ]


@case("tape8")
def tape8() -> Sequence[Value]:
    """Strains of a plate whose nodes are held in a field of constant strains, except one w.

    A very slow rigid mass hits this dof, in the middle of the first element, for one step: the
    other elements keep the field.
    """
    grid = Grid(uniform(2.0, 2), uniform(2.0, 2))
    struck = 2 + grid.across
    x, y = (v.ravel() for v in np.meshgrid(lines(grid.columns), lines(grid.rows)))
    field = constant_strains(x, y, (0.4, -0.5, 0.6), shear=(0.02, -0.03))
    field[struck - 1, 2] = 0.0
    codes = [NodeCodes(n, 0, (1, 1, int(n != struck), 1, 1)) for n in range(1, grid.nodes + 1)]
    segments = (
        Boundary(tuple(codes)), forces(field), Projectile(0, 0, 1e-6), Impact(struck, 3, 1e-12),
        elastic(1.0), material(FIBRES, (0.0, 90.0), 0.01),
    )  # fmt: skip
    found = result_of(deck(grid, segments, impact_program(1e-7, 1)))
    names = "kappa_x kappa_y kappa_xy gamma_yz gamma_xz"
    return [field[:, 1:] for field in fields(found, "tape8", names)]


@case("time-step")
def time_step() -> Sequence[Value]:
    """Time step 2/ω of the only mode."""
    grid = Grid(uniform(0.3, 1), uniform(0.3, 1))
    made = deck(grid, [material(isotropic(1.0e7, 0.3, 2.5e-4), [0.0], 0.1)], ())
    return [_critical(made, dof) for dof in (2, 3)]


def _critical(made: Deck, dof: int) -> float:
    """Critical time step where one dof of node 5, the centre, is free."""
    mesh = generate(made)
    codes, equations = np.ones_like(mesh.codes), np.zeros_like(mesh.equations)
    codes[4, dof], equations[4, dof] = 0, 1
    return critical_time_step(build_plate(made, replace(mesh, codes=codes, equations=equations)))
