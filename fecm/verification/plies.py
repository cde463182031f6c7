"""Ply stresses of PLYS against Navier's solution and equilibrium."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fecm._typing import Floats
from fecm.deck.grid import Grid, lines, uniform
from fecm.deck.model import Forces, Segment
from fecm.deck.records import Macro, NodeValues, Ply
from fecm.results.result import Result
from fecm.verification import sine
from fecm.verification.case import Check, case
from fecm.verification.decks import isotropic, material, quarter_plate, result_of, uniform_load
from fecm.verification.patches import CROSS, MITC, STIFF
from fecm.verification.plates import NU, STATICS, E

ELEMENTS = 8  # of 16 a side
H = 0.1
PI = np.pi
D, S = sine.bending_and_shear(STIFF, CROSS, H)
W, X, Y = np.linalg.solve(sine.stiffness(D, S, np.array(PI), np.array(PI)), [1.0, 0.0, 0.0])
AT_0, AT_90 = sine.plane_stress(STIFF)
# Amplitudes of the curvatures over cos cos, cos cos and sin sin.
CURVATURES = PI * np.array([X, Y, -(X + Y)])
SIGMA_1, SIGMA_2 = (AT_0 @ CURVATURES)[:2] * H / 2.0
TAU_12 = (AT_0 @ CURVATURES)[2] * H / 2.0
ACROSS = (AT_90 @ CURVATURES)[1] * H / 6.0


def _shear(axis: int) -> float:
    """Amplitude of tau_xz or tau_yz at z = 0: the integral of z over the plies below."""
    outer, inner = (
        PI * ((q @ CURVATURES)[axis] - (q @ CURVATURES)[2]) for q in (AT_0, AT_90)
    )  # fmt: skip
    return float(outer * -(H**2) / 9.0 + inner * -(H**2) / 72.0)


XZ, YZ = _shear(0), _shear(1)
NAVIER = "Navier's solution, first-order theory"
BENT = "16 × 16 elements, 2 × 2 points in each; falls with the 2nd power of their size"
DERIVED = "16 × 16 elements; derivatives of curvature fall with the 2nd power of their size"
EVEN = "16 × 16 elements: shear forces fall with the 2nd power of their size"
PARABOLA = "3/2 (1 - 4 z²/h²) Q_x/h, Q_x = q a/2π"
SHEAR = 1.5 / H / (2.0 * PI)


def bent(
    ply: Ply, angles: Sequence[float], thickness: float = H, word: str = "PLYS", *others: Segment
) -> Result:
    """Run a simply supported square under q = cos(pi x) cos(pi y), its origin in the middle."""
    grid = Grid(uniform(0.5, ELEMENTS), uniform(0.5, ELEMENTS))
    x, y = (v.ravel() for v in np.meshgrid(lines(grid.columns), lines(grid.rows)))
    shape = np.cos(PI * x) * np.cos(PI * y)
    loads = Forces(
        tuple(
            NodeValues(one.node, 0, tuple((shape[one.node - 1] * np.array(one.values)).tolist()))
            for one in uniform_load(grid, 1.0).records
        )
    )
    plate = material(ply, angles, thickness / len(angles))
    plate = replace(plate, integration=replace(plate.integration, points=2, thickness=thickness))
    program = (*STATICS, Macro("STRE"), Macro(word))
    return result_of(quarter_plate(ELEMENTS, plate, program, others=[loads, MITC, *others]))


def amplitude(found: Floats, expected: float, shape: Floats) -> float:
    """Amplitude at the point whose stress is farthest from the expected one."""
    off = (found - expected * shape).ravel()
    return expected + float(off[np.abs(off).argmax()])


@case(
    "ply-stresses",
    "simply supported square of [0/90/0], E1/E2 = 25, a/h = 10, under a sinusoidal load, MITC",
    Check("σ1 at z = h/2", SIGMA_1, NAVIER, 1e-3, BENT),
    Check("σ2 at z = h/2", SIGMA_2, NAVIER, 1e-3, BENT),
    Check("τ12 at z = h/2", TAU_12, NAVIER, 1e-3, BENT),
    Check("σ1 at z = h/6 in the 90 ply", ACROSS, NAVIER, 1e-3, BENT),
    Check("τ_xz at z = 0", XZ, "equilibrium of Navier's stresses", 3e-3, DERIVED),
    Check("τ_yz at z = 0", YZ, "equilibrium of Navier's stresses", 1e-2, DERIVED),
)
def sinusoidal() -> Sequence[float]:
    """Amplitudes of the stresses."""
    found = bent(STIFF, CROSS)
    x, y = found["stresses/x"], found["stresses/y"]
    even, odd = np.cos(PI * x) * np.cos(PI * y), np.sin(PI * x) * np.sin(PI * y)
    x, y = x.mean(axis=1), y.mean(axis=1)
    one, two, shear = (found[f"plies/{name}"][0] for name in ("sigma_1", "sigma_2", "tau_12"))
    return [
        amplitude(one[:, :, 2, 1], SIGMA_1, even),
        amplitude(two[:, :, 2, 1], SIGMA_2, even),
        amplitude(shear[:, :, 2, 1], TAU_12, odd),
        amplitude(one[:, :, 1, 1], ACROSS, even),
        amplitude(found["plies/tau_xz"][0, :, 1, 1], XZ, np.sin(PI * x) * np.cos(PI * y)),
        amplitude(found["plies/tau_yz"][0, :, 1, 1], YZ, np.cos(PI * x) * np.sin(PI * y)),
    ]


@case(
    "ply-shear",
    "four equal isotropic plies under the same load",
    Check("τ_xz at z = 0", -SHEAR, PARABOLA, 1e-2, EVEN),
    Check("τ_xz at z = h/4", -0.75 * SHEAR, PARABOLA, 1e-2, EVEN),
    Check("τ_xz at z = h/8", -0.9375 * SHEAR, PARABOLA, 1e-2, EVEN),
    Check("τ_xz at z = ±h/2", 0.0, PARABOLA, 1e-12, "rounding", scale=SHEAR),
)
def homogeneous() -> Sequence[float]:
    """Amplitudes at heights of the third ply, and at the faces."""
    found = bent(isotropic(E, NU, 1.0), (0.0,) * 4)
    x, y = found["stresses/x"].mean(axis=1), found["stresses/y"].mean(axis=1)
    shape = np.sin(PI * x) * np.cos(PI * y)
    tau = found["plies/tau_xz"][0]
    return [
        amplitude(tau[:, 2, 0], -SHEAR, shape),
        amplitude(tau[:, 2, 2], -0.75 * SHEAR, shape),
        amplitude(tau[:, 2, 1], -0.9375 * SHEAR, shape),
        amplitude(tau[:, [0, 3], [0, 2]], 0.0, shape[:, None]),
    ]


CASES = (sinusoidal, homogeneous)
