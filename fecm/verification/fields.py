"""Plates with strains, resultants and failure that any mesh must reproduce exactly."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

import fecm.verification.decks as decks
from fecm.deck import model
from fecm.deck.grid import ElementGrid, GridSection, grid_lines, uniform_section
from fecm.deck.model import Allowables, Deck, Impact, NodeCodes, NodeValues, Ply, Projectile
from fecm.verification.case import Value, case
from fecm.verification.parts import FIBRES, THICK

IN_PLANE = "eps_xx eps_yy gamma_xy kappa_x kappa_y kappa_xy"
# Corners of the four elements of the patch: no side is parallel to another or to an axis.
CORNERS = np.array([
    [(0.0, 0.0), (1.1, -0.1), (2.0, 0.1)],
    [(-0.1, 0.9), (1.2, 1.1), (2.1, 0.8)],
    [(0.1, 2.0), (0.9, 2.2), (2.0, 1.9)],
])  # fmt: skip


@case
def _patch() -> Sequence[Value]:
    fine = np.empty((5, 5, 2))
    fine[::2, ::2] = CORNERS
    fine[::2, 1::2] = (CORNERS[:, 1:] + CORNERS[:, :-1]) / 2.0
    fine[1::2] = (fine[2::2] + fine[:-2:2]) / 2.0
    x, y = fine.reshape(-1, 2).T
    field = decks.constant_strains(x, y, (0.4, -0.5, 0.6), strain=(1e-3, 2e-3, 3e-3))
    field = field.reshape(5, 5, 5)
    field[1:-1, 1:-1] = 0.0  # the inner nodes are free
    grid = ElementGrid(uniform_section(2.0, 2), uniform_section(2.0, 2))
    places = enumerate(fine.reshape(-1, 2).tolist(), start=1)
    plate = decks.material(FIBRES, (0.0, 90.0), THICK / 2.0)
    segments = (decks.restraints(grid, "00000" + 4 * " 11111"), decks.forces(field), plate)
    coordinates = model.Coordinates(tuple(NodeValues(n, 0, tuple(place)) for n, place in places))
    result = decks.run_of_deck(decks.deck(grid, segments, decks.STRESSES, coordinates))
    shears = np.array(decks.field_values(result, "stresses", "gamma_xz gamma_yz"))
    return [*decks.field_values(result, "stresses", IN_PLANE), shears, result["stresses/M_x"]]


def loaded_rectangle(x: Sequence[float], y: Sequence[float], *, shears: bool = False) -> Deck:
    """Build a rectangle of [0/45] under edge tractions, on supports without reactions.

    `x` and `y` are the forces per length of the five dofs on an edge with normal x or y. With
    `shears` only w moves, and the shear correction factor is 0.8.
    """
    columns = [GridSection(0.0, 1.2, 1), GridSection(1.2, 2.0, 1)]
    grid = ElementGrid(columns, [GridSection(0.0, 0.5, 1), GridSection(0.5, 1.5, 1)])
    codes = np.tile([1, 1, 0, 1, 1] if shears else [0] * 5, (grid.up, grid.across, 1))
    codes[0, 0, :3] = 1
    if not shears:
        codes[0, -1, 1:3] = codes[-1, 0, 2] = 1
    loads = np.zeros(codes.shape)
    for place, sign in ((-1, 1.0), (0, -1.0)):
        loads[:, place] += sign * np.outer(decks.weights(grid_lines(grid.rows)), x)
        loads[place] += sign * np.outer(decks.weights(grid_lines(grid.columns)), y)
    rows = enumerate(codes.reshape(-1, 5).tolist(), start=1)
    segments = (
        model.Boundary(tuple(NodeCodes(n, 0, tuple(code)) for n, code in rows if any(code))),
        decks.forces(np.where(codes == 0, loads, 0.0)),
        decks.material(FIBRES, (0.0, 45.0), THICK / 2.0),
        model.Shear(0.8) if shears else None,
    )
    return decks.deck(grid, segments, decks.STRESSES)


@case
def _resultants() -> Sequence[Value]:
    n_x, n_y, n_xy, m_x, m_y, m_xy = 100.0, -40.0, 30.0, 0.5, 0.3, -0.2
    # A moment M does work on -theta.
    pulled = loaded_rectangle((n_x, n_xy, 0.0, -m_x, -m_xy), (n_xy, n_y, 0.0, -m_xy, -m_y))
    shears = (0.0, 0.0, 20.0, 0.0, 0.0), (0.0, 0.0, -8.0, 0.0, 0.0)
    result = decks.run_of_deck(pulled)
    sheared = decks.run_of_deck(loaded_rectangle(*shears, shears=True))
    return [
        *decks.field_values(result, "stresses", f"{IN_PLANE} N_x N_y N_xy M_x M_y M_xy"),
        *decks.field_values(sheared, "stresses", "gamma_xz gamma_yz Q_x Q_y"),
    ]


@case
def _tape8() -> Sequence[Value]:
    """Compute the strains of a plate that is held in constant strains.

    One dof is free: w in the middle of the first element. A very slow rigid mass hits it for one
    step. The strains of the other elements stay as they are.
    """
    grid = ElementGrid(uniform_section(2.0, 2), uniform_section(2.0, 2))
    struck = 2 + grid.across
    x, y = (v.ravel() for v in np.meshgrid(grid_lines(grid.columns), grid_lines(grid.rows)))
    field = decks.constant_strains(x, y, (0.4, -0.5, 0.6), shear=(0.02, -0.03))
    field[struck - 1, 2] = 0.0
    codes = [NodeCodes(n, 0, (1, 1, int(n != struck), 1, 1)) for n in range(1, grid.nodes + 1)]
    hit = (Projectile(0, 0, 1e-6), Impact(struck, 3, 1e-12), decks.elastic(1.0))
    plate = decks.material(FIBRES, (0.0, 90.0), 0.01)
    segments = (model.Boundary(tuple(codes)), decks.forces(field), *hit, plate)
    result = decks.run_of_deck(decks.deck(grid, segments, decks.history_program(1e-7, 1)))
    names = "kappa_x kappa_y kappa_xy gamma_yz gamma_xz"
    return [field[:, 1:] for field in decks.field_values(result, "tape8", names)]


def held_trapezoid() -> Deck:
    """Build one element with MITC, x = ξ and y = η (1 + ξ/2)/2, that is held in θ_y = ξ².

    The other dofs are 0, so γ_yz is -θ_y. Its covariant component is cubic in ξ and has to be
    interpolated.
    """
    grid = ElementGrid(uniform_section(2.0, 1), uniform_section(1.0, 1))
    xi, eta = (v.ravel() for v in np.meshgrid((-1.0, 0.0, 1.0), (-1.0, 0.0, 1.0)))
    corners = enumerate(np.stack([xi, eta * (1.0 + xi / 2.0) / 2.0], axis=1).tolist(), start=1)
    places = model.Coordinates(tuple(NodeValues(n, 0, tuple(place)) for n, place in corners))
    field = np.zeros((9, 5))
    field[:, 4] = xi**2
    held, plate = decks.held_but(0), decks.material(decks.ONE, [0.0], 0.1)
    return decks.deck(grid, (held, decks.forces(field), decks.MITC, plate), decks.STRESSES, places)


@case
def _assumed_shear() -> Sequence[Value]:
    cards = (decks.material(decks.ONE, [0.0], h) for h in (0.1, 0.001))
    variants = [
        decks.quarter_plate(4, card, decks.DEFLECTION, 1.0, further=[decks.MITC]) for card in cards
    ]
    x, shear = decks.field_values(decks.run_of_deck(held_trapezoid()), "stresses", "x gamma_yz")
    sides = [shear[:, np.isclose(x, end)] for end in (-1.0, 1.0)]
    return [*(decks.run_of_deck(deck).tape3.w[0, 0] for deck in variants), *sides]


CARBON = Ply(1.6e-9, 0.3, 150e3, 10e3, 5e3, 5e3, 3.5e3)
ANGLES = (30.0, -45.0, 90.0)
PLY_THICKNESS = 0.25
STRENGTHS = Allowables(2000.0, 1200.0, 60.0, 200.0, 90.0, 80.0, 50.0, -0.4, 0.3, 0.25)
# Derivatives by x, y, xx, xy and yy of u, v, -theta_x and -theta_y in the middle of the element.
FIELD = np.array([
    [-3.0, 5.0, -1.5, 2.0, 1.25],
    [5.0, 2.0, 0.75, -1.5, -0.25],
    [-12.0, -3.0, 0.5, -0.5, 1.75],
    [-3.0, -7.0, 0.25, -1.75, 1.75],
]) * 1e-3  # fmt: skip
CRITERIA = ("max_stress", "tsai_wu", "hashin", "puck")


@case
def _failure_states() -> Sequence[Value]:
    """Compute exposures in the middle of an element; all dofs but one w are held."""
    grid = ElementGrid(uniform_section(1.0, 1), uniform_section(1.0, 1))
    x, y = (v.ravel() - 0.5 for v in np.meshgrid(grid_lines(grid.columns), grid_lines(grid.rows)))
    u, v, p, q = FIELD @ [x, y, x * x / 2.0, x * y, y * y / 2.0]
    plate = decks.material(CARBON, ANGLES, PLY_THICKNESS, points=1)
    held = decks.forces(np.stack([u, v, 0.0 * u, -p, -q], axis=1))
    macros = decks.program("TANG FORM SOLV FAIL")
    result = decks.run_of_deck(
        decks.deck(grid, (decks.held_but(2), held, STRENGTHS, plate), macros)
    )
    plies = [result[f"failure/{name}/exposure"].max(axis=(0, 1, 3)) for name in CRITERIA]
    return [*np.ravel(plies), *result["failure/interlaminar/exposure"][0]]


# σ2 and τ12 of a ply at 0 degrees, compressed across its fibres; the action plane is inclined.
PRESSED = ((-180.0, 0.0), (-180.0, 60.0), (-150.0, -80.0))


@case
def _inclined_failure() -> Sequence[Value]:
    """Compute Puck's exposure of an element under constant stresses; mode C decides."""
    grid = ElementGrid(uniform_section(1.0, 1), uniform_section(1.0, 1))
    x, y = (v.ravel() - 0.5 for v in np.meshgrid(grid_lines(grid.columns), grid_lines(grid.rows)))
    plate, macros = decks.material(CARBON, [0.0], 1.0), decks.program("TANG FORM SOLV FAIL")
    exposures = []
    for across, shear in PRESSED:
        strain = (-CARBON.nu12 * across / CARBON.e1, across / CARBON.e2, shear / CARBON.g12)
        held = decks.forces(decks.constant_strains(x, y, (0.0, 0.0, 0.0), strain=strain))
        segments = (decks.held_but(2), held, STRENGTHS, plate)
        result = decks.run_of_deck(decks.deck(grid, segments, macros))
        exposures.append(result["failure/puck/exposure"].max())
    return exposures
