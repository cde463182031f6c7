"""Plates against closed forms: patches, statics, frequencies, the critical time step."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fecm._typing import Floats
from fecm.deck.grid import Grid, uniform
from fecm.deck.model import Coordinates, Deck
from fecm.deck.records import Macro, NodeValues
from fecm.mechanics.mesh import Mesh
from fecm.mechanics.time_step import critical_time_step
from fecm.problem.build import build_plate
from fecm.problem.generate import generate
from fecm.verification.case import Check, case, checks, farthest
from fecm.verification.decks import (
    constant_strains,
    deck,
    farthest_of,
    forces,
    isotropic,
    material,
    quarter_plate,
    result_of,
)
from fecm.verification.laminates import FIBRES, Q11, Q12, Q22, THICK

STATICS = (Macro("TANG"), Macro("FORM"), Macro("SOLV"))

# Patch: uniform midplane strains and curvatures.
STRAIN = (1e-3, 2e-3, 3e-3)
CURVATURE = (0.4, -0.5, 0.6)
# Corners of its four elements: no side is parallel to another or to an axis.
CORNERS = np.array(
    [
        [(0.0, 0.0), (1.1, -0.1), (2.0, 0.1)],
        [(-0.1, 0.9), (1.2, 1.1), (2.1, 0.8)],
        [(0.1, 2.0), (0.9, 2.2), (2.0, 1.9)],
    ]
)
MOMENT = (
    (Q22 - Q11) * THICK**2 / 8.0 * STRAIN[0]
    + (Q11 + Q22) * THICK**3 / 24.0 * CURVATURE[0]
    + Q12 * THICK**3 / 12.0 * CURVATURE[1]
)
IN_PLANE = ("eps_xx", "eps_yy", "gamma_xy", "kappa_x", "kappa_y", "kappa_xy")
EXACT = 1e-8
IN_FIELD = "the field is one of the elements'; rounding of the solution"


def patch() -> Deck:
    """Build four distorted elements of [0/90] whose outer nodes have a constant-strain field."""
    fine = np.empty((5, 5, 2))
    fine[::2, ::2] = CORNERS
    fine[::2, 1::2] = (CORNERS[:, 1:] + CORNERS[:, :-1]) / 2.0
    fine[1::2] = (fine[2::2] + fine[:-2:2]) / 2.0
    x, y = fine.reshape(-1, 2).T
    field = constant_strains(x, y, CURVATURE, strain=STRAIN)
    grid = Grid(uniform(2.0, 2), uniform(2.0, 2))
    held = (1,) * 5
    boundary = grid.boundary((0,) * 5, dict.fromkeys(("left", "right", "bottom", "top"), held))
    outer = [n for n in range(25) if n // 5 in (0, 4) or n % 5 in (0, 4)]
    coordinates = [
        NodeValues(n, 0, place)
        for n, place in enumerate(zip(x.tolist(), y.tolist(), strict=True), 1)
    ]
    segments = (
        Coordinates(tuple(coordinates)), boundary, forces(field, outer),
        material(FIBRES, (0.0, 90.0), THICK / 2.0),
    )  # fmt: skip
    return deck("patch", grid, segments, (*STATICS, Macro("STRE")))


@case(
    "patch",
    "constant strain and curvature on distorted elements of [0/90]",
    *checks("ε_x, ε_y, γ_xy, κ_x (1/in), κ_y (1/in), κ_xy (1/in)", (*STRAIN, *CURVATURE),
            "the field put on the boundary", EXACT, IN_FIELD),
    Check("γ_xz, γ_yz: the largest", 0.0, "θ is the slope of w", EXACT, IN_FIELD, scale=1e-3),
    Check("M_x (lb)", MOMENT, "B11 ε_x + D11 κ_x + D12 κ_y", EXACT, IN_FIELD),
)  # fmt: skip
def patch_test() -> Sequence[float]:
    """Of each strain the value farthest from the expected one."""
    found = result_of(patch())
    shears = farthest_of(found, "stresses", ("gamma_xz", "gamma_yz"), (0.0, 0.0))
    return [
        *farthest_of(found, "stresses", IN_PLANE, (*STRAIN, *CURVATURE)),
        farthest(shears, 0.0),
        *farthest_of(found, "stresses", ("M_x",), (MOMENT,)),
    ]


# Square plate of side 1, E = 1, nu = 0.3, density 1.
E, NU = 1.0, 0.3
ELEMENTS = 8  # of 16 a side
NAVIER = "Navier's series, h/a = 1/{}"
COARSE = "16 × 16 elements; falls with the 4th power of their size"


@case(
    "static-bending",
    "simply supported square plate under a uniform load, E = q = a = 1",
    Check("w in the middle", 46.276346238, NAVIER.format(10), 2e-5, COARSE),
    Check("w at a quarter", 24.460861870, NAVIER.format(10), 2e-5, COARSE),
    Check("w in the middle, thin", 44380.045606, NAVIER.format(100), 2e-5, COARSE),
    Check(
        "w in the middle, κ = 5/6", 46.659437275,
        "the same, shear moduli × 5/6", 2e-5, COARSE,
    ),
    Check("w in the middle, L2 = 3", 46.276346238, NAVIER.format(10), 5e-5, COARSE),
    Check(
        "w in the middle, thin, L2 = 3", 44380.045606, NAVIER.format(100), 2e-3,
        "order 3 locks: 0.08 % on 16 × 16 elements; falls with the 3rd power of their size",
    ),
)  # fmt: skip
def static_bending() -> Sequence[float]:
    """Deflections, with transverse shear integrated by order 2, which does not lock, and 3."""
    macros = (*STATICS, Macro("DISP"))

    def w(thickness: float, factor: float = 1.0, shear_order: int = 2) -> Floats:
        plate = material(isotropic(E, NU, 1.0, factor), [0.0], thickness, shear_order)
        row: Floats = result_of(quarter_plate(ELEMENTS, plate, macros, 1.0)).tape3.w[0]
        return row

    across = 2 * ELEMENTS + 1
    quarter = ELEMENTS + ELEMENTS * across  # the row of the node at (a/4, a/4)
    thick = w(0.1)
    return [
        thick[0], thick[quarter], w(0.01)[0], w(0.1, 5.0 / 6.0)[0],
        w(0.1, shear_order=3)[0], w(0.01, shear_order=3)[0],
    ]  # fmt: skip


MINDLIN = "Mindlin, m = {}, n = {}, h/a = 1/10"
SPECTRUM = "16 × 16 elements; falls with the 4th power of their size, grows with n⁴"
UNIFORM = "uniform over the plate, so in every mesh's fields"
RIGIDITY = E * 0.1**3 / (12.0 * (1.0 - NU**2))
CUTOFF = math.sqrt(12.0 / (2.0 * (1.0 + NU))) / 0.1


@case(
    "frequencies",
    "simply supported square plate, ω a² √(ρh/D)",
    Check("ω11, lumped mass", 19.1478631568, MINDLIN.format(1, 1), 1e-5, SPECTRUM),
    Check("ω13, lumped mass", 86.4824443014, MINDLIN.format(1, 3), 2e-4, SPECTRUM),
    Check("ω11, consistent mass", 19.1478631568, MINDLIN.format(1, 1), 1e-5, SPECTRUM),
    Check("ω33, consistent mass", 143.6190699617, MINDLIN.format(3, 3), 5e-4, SPECTRUM),
    Check("cut-off ω, free plate, E = ρ = 1", CUTOFF, "√(12 G/ρ)/h", 1e-9, UNIFORM),
)
def frequencies() -> Sequence[float]:
    """Frequencies of the symmetric modes, on a quarter of the plate, and of uniform shear."""
    plate = material(isotropic(E, NU, 1.0), [0.0], 0.1, 2)
    macros = (
        Macro("LMAS"), Macro("EIGE", value=4.0), Macro("CMAS"), Macro("EIGE", value=4.0),
    )  # fmt: skip
    found = result_of(quarter_plate(ELEMENTS, plate, macros)).modes.angular_frequency
    scaled = found * math.sqrt(0.1 / RIGIDITY)
    # Modes 11, 13 and 31, 33 with the lumped mass, then with the consistent mass.
    return [scaled[0], scaled[1], scaled[4], scaled[7], _shear_frequency()]


def _shear_frequency() -> float:
    """Rayleigh quotient of a free plate in uniform transverse shear."""
    grid = Grid(uniform(0.7, 2), uniform(1.3, 2))
    plate = material(isotropic(E, NU, 1.0), [0.0], 0.1)
    held = grid.boundary((1, 1, 1, 0, 1), {})
    made = deck("shear", grid, (grid.coordinates(), held, plate), ())
    model = build_plate(made, generate(made))
    ones = np.ones(model.neq)
    return math.sqrt(float(ones @ (model.stiffness @ ones)) / float(model.mass @ ones))


# A single square element of which one dof of the centre node is free: its shape function is
# (1 - xi^2)(1 - eta^2), and its lumped mass 4/9 of the element's.
SIDE, THIN = 0.3, 0.1
PLY = isotropic(1.0e7, 0.3, 2.5e-4)
GRADIENT, SQUARE = 256.0 / 45.0, (16.0 / 15.0) ** 2 / 4.0 * SIDE**2
MASS = 4.0 / 9.0 * PLY.density * THIN * SIDE**2
BEND = (PLY.e1 / (1.0 - 0.3**2) + PLY.g12) * THIN**3 / 12.0 * GRADIENT / 2.0
TILT = math.sqrt(MASS * THIN**2 / 12.0 / (BEND + PLY.g13 * THIN * SQUARE))
INTEGRATED = "the rule integrates these polynomials exactly"


@case(
    "time-step",
    "critical time step of a 9-node square with one free dof at its centre",
    Check(
        "w free (s)", math.sqrt(5.0) / 4.0 * SIDE * math.sqrt(PLY.density / PLY.g13),
        "2/ω = (√5/4) a √(ρ/G)", 1e-10, INTEGRATED,
    ),
    Check(
        "θ_x free (s)", 2.0 * TILT, "K = 128/45 (D11 + D66) + 64/225 G h a²", 1e-10,
        INTEGRATED,
    ),
)  # fmt: skip
def time_step() -> Sequence[float]:
    """Time step 2/ω of the only mode."""
    grid = Grid(uniform(SIDE, 1), uniform(SIDE, 1))
    made = deck("element", grid, (grid.coordinates(), material(PLY, [0.0], THIN)), ())
    return [_critical(made, dof) for dof in (2, 3)]


def _critical(made: Deck, dof: int) -> float:
    """Critical time step where one dof of node 5, the centre, is free."""
    mesh = generate(made)
    codes, equations = np.ones_like(mesh.codes), np.zeros_like(mesh.equations)
    codes[4, dof], equations[4, dof] = 0, 1
    held: Mesh = replace(mesh, codes=codes, equations=equations)
    return critical_time_step(build_plate(made, held))


CASES = (patch_test, static_bending, frequencies, time_step)
