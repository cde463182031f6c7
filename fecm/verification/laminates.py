"""Stiffness and inertia of laminates against their closed forms.

Layer 1 lies at z = -h/2.  Units are lb, in and s, as in the report.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fecm.deck.records import Ply
from fecm.mechanics.laminate import laminate
from fecm.verification.case import Check, case

ROUNDING = "rounding"
EXACT = 1e-12

# An isotropic ply; rotation does not change its stiffness.
E, NU, RHO, H = 1.0e7, 0.3, 2.5e-4, 0.1
G = E / (2.0 * (1.0 + NU))
PLATE = E / (1.0 - NU**2)
TURNED = 30.0

# A ply of the report's kind, with a different G23, and the plane-stress stiffness of two layers.
E1, E2, NU12, G12, G13, G23 = 17.5e6, 1.15e6, 0.3, 0.8e6, 0.8e6, 0.5e6
FULL = 1.0 - NU12**2 * E2 / E1
Q11, Q22, Q12, Q66 = E1 / FULL, E2 / FULL, NU12 * E2 / FULL, G12
THICK = 0.02  # of two layers
FIBRES = Ply(RHO, NU12, E1, E2, G12, G13, G23)
# At 45 degrees: Q11 + Q22 + 2 Q12 +- 4 Q66 and the couplings between stretching and shear.
BAR11 = (Q11 + Q22 + 2.0 * Q12 + 4.0 * Q66) / 4.0
BAR12 = (Q11 + Q22 + 2.0 * Q12 - 4.0 * Q66) / 4.0
BAR66 = (Q11 + Q22 - 2.0 * Q12) / 4.0
BAR16 = (Q11 - Q22) / 4.0


def exact(quantity: str, expected: float, source: str, scale: float | None = None) -> Check:
    """Build a check against a closed form, which is evaluated in a different order."""
    return Check(quantity, expected, source, EXACT, ROUNDING, scale=scale)


@case(
    "isotropic-ply",
    "one isotropic ply, turned by 30 degrees",
    exact("A11 (lb/in)", PLATE * H, "E h/(1 - ν²)"),
    exact("A12 (lb/in)", NU * PLATE * H, "ν E h/(1 - ν²)"),
    exact("A66 (lb/in)", G * H, "G h"),
    exact("A16, A26, B: the largest over A11", 0.0, "isotropy", 1.0),
    exact("D11 (lb in)", PLATE * H**3 / 12.0, "E h³/12(1 - ν²)"),
    exact("D12 (lb in)", NU * PLATE * H**3 / 12.0, "ν E h³/12(1 - ν²)"),
    exact("D66 (lb in)", G * H**3 / 12.0, "G h³/12"),
    exact("A*55 (lb/in)", G * H, "G h, no shear correction"),
    exact("mass P (lb s²/in³)", RHO * H, "ρ h"),
    exact("rotary inertia I (lb s²/in)", RHO * H**3 / 12.0, "ρ h³/12"),
)
def isotropic_ply() -> Sequence[float]:
    """A, B, D, shear, mass and inertia."""
    made = laminate(Ply(RHO, NU, E, E, G, G, G), [TURNED], [H])
    vanishing = [*made.A[:2, 2] / H, *made.B.ravel() / H**2, *made.D[:2, 2] / H**3]
    return [
        made.A[0, 0], made.A[0, 1], made.A[2, 2], np.abs(vanishing).max() / PLATE,
        made.D[0, 0], made.D[0, 1], made.D[2, 2], made.shear[0, 0], made.mass, made.rotary_inertia,
    ]  # fmt: skip


@case(
    "cross-ply",
    "[0/90], whose stretching and bending are coupled",
    exact("A11 (lb/in)", (Q11 + Q22) * THICK / 2.0, "(Q11 + Q22) h/2"),
    exact("A12 (lb/in)", Q12 * THICK, "Q12 h"),
    exact("A66 (lb/in)", Q66 * THICK, "Q66 h"),
    exact("B11 (lb)", (Q22 - Q11) * THICK**2 / 8.0, "(Q22 - Q11) h²/8"),
    exact("B22 (lb)", (Q11 - Q22) * THICK**2 / 8.0, "-B11"),
    exact("D11 (lb in)", (Q11 + Q22) * THICK**3 / 24.0, "(Q11 + Q22) h³/24"),
    exact("D66 (lb in)", Q66 * THICK**3 / 12.0, "Q66 h³/12"),
    exact("A*55 (lb/in)", (G13 + G23) * THICK / 2.0, "(G13 + G23) h/2"),
)
def cross_ply() -> Sequence[float]:
    """A, B, D and shear."""
    made = laminate(FIBRES, [0.0, 90.0], [THICK / 2.0] * 2)
    return [
        made.A[0, 0], made.A[0, 1], made.A[2, 2], made.B[0, 0], made.B[1, 1], made.D[0, 0],
        made.D[2, 2], made.shear[0, 0],
    ]  # fmt: skip


@case(
    "angle-ply",
    "[45/-45], whose stretching and twisting are coupled",
    exact("A11 (lb/in)", BAR11 * THICK, "(Q11 + Q22 + 2 Q12 + 4 Q66) h/4"),
    exact("A12 (lb/in)", BAR12 * THICK, "(Q11 + Q22 + 2 Q12 - 4 Q66) h/4"),
    exact("A66 (lb/in)", BAR66 * THICK, "(Q11 + Q22 - 2 Q12) h/4"),
    exact("A16 over A11", 0.0, "+45 against -45", 1.0),
    exact("B16 (lb)", -BAR16 * THICK**2 / 4.0, "-(Q11 - Q22) h²/16"),
    exact("B11 over A11 h", 0.0, "antisymmetry", 1.0),
    exact("D11 (lb in)", BAR11 * THICK**3 / 12.0, "A11 h²/12"),
    exact("D66 (lb in)", BAR66 * THICK**3 / 12.0, "A66 h²/12"),
    exact("A*45 of +45 alone (lb/in)", (G13 - G23) * THICK / 2.0, "(G13 - G23) h/2"),
)
def angle_ply() -> Sequence[float]:
    """A, B, D, and the coupling of transverse shear of a ply at 45 degrees."""
    made = laminate(FIBRES, [45.0, -45.0], [THICK / 2.0] * 2)
    a11 = made.A[0, 0]
    return [
        a11, made.A[0, 1], made.A[2, 2], made.A[0, 2] / a11, made.B[0, 2],
        made.B[0, 0] / (a11 * THICK), made.D[0, 0], made.D[2, 2],
        laminate(FIBRES, [45.0], [THICK]).shear[0, 1],
    ]  # fmt: skip


CASES = (isotropic_ply, cross_ply, angle_ply)
