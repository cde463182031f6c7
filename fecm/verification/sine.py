"""Navier's solution of first-order theory for a simply supported rectangle, without coupling.

B, D16, D26 and A*45 are zero.  The fields of a term, with their origin in the middle of the plate
and odd multiples of pi over the sides in alpha and beta, are w = W cos(alpha x) cos(beta y),
theta_x = -X sin(alpha x) cos(beta y) and theta_y = -Y cos(alpha x) sin(beta y).
This module uses neither the elements nor their laminate theory.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy.special import j1

from fecm._typing import Floats
from fecm.deck.records import Ply

MOST = 401


def plane_stress(ply: Ply) -> tuple[Floats, Floats]:
    """Plane stress (3, 3) of a ply at 0 and at 90 degrees."""
    full = 1.0 - ply.nu12**2 * ply.e2 / ply.e1
    along, across, mixed = ply.e1 / full, ply.e2 / full, ply.nu12 * ply.e2 / full
    q = np.array([[along, mixed, 0.0], [mixed, across, 0.0], [0.0, 0.0, ply.g12]])
    return q, q[[1, 0, 2]][:, [1, 0, 2]]


def bending_and_shear(ply: Ply, angles: Sequence[float], h: float) -> tuple[Floats, Floats]:
    """D (3, 3) and A*55, A*44 (2,) of equal plies at 0 or 90 degrees, h thick in all."""
    faces = np.linspace(-h / 2.0, h / 2.0, len(angles) + 1)
    by_angle = dict(zip((0.0, 90.0), plane_stress(ply), strict=True))
    shear = {0.0: (ply.g13, ply.g23), 90.0: (ply.g23, ply.g13)}
    cubes = np.diff(faces**3) / 3.0
    D = sum(part * by_angle[angle] for part, angle in zip(cubes, angles, strict=True))
    return np.asarray(D), np.array([shear[a] for a in angles]).sum(axis=0) * h / len(angles)


def stiffness(D: Floats, S: Floats, a: Floats, b: Floats) -> Floats:
    """K of the amplitudes W, X and Y, (..., 3, 3), per quarter of the plate's area."""
    K = np.empty((*np.shape(a), 3, 3))
    K[..., 0, 0] = S[0] * a**2 + S[1] * b**2
    K[..., 0, 1] = K[..., 1, 0] = -S[0] * a
    K[..., 0, 2] = K[..., 2, 0] = -S[1] * b
    K[..., 1, 1] = D[0, 0] * a**2 + D[2, 2] * b**2 + S[0]
    K[..., 2, 2] = D[1, 1] * b**2 + D[2, 2] * a**2 + S[1]
    K[..., 1, 2] = K[..., 2, 1] = (D[0, 1] + D[2, 2]) * a * b
    return K


def _terms(sides: Sequence[float]) -> tuple[Floats, Floats]:
    a, b = (np.pi * np.arange(1.0, MOST, 2.0) / side for side in sides)
    grid = np.meshgrid(a, b, indexing="ij")
    return grid[0], grid[1]


def disc(x: Floats) -> Floats:
    """Transform of a uniform unit pressure on a circle of radius c, at x = k c."""
    return np.asarray(2.0 * j1(x) / x)


def hertz(x: Floats) -> Floats:
    """The same of Hertz's pressure."""
    return np.asarray(3.0 * (np.sin(x) - x * np.cos(x)) / x**3)


def compliance(
    D: Floats, S: Floats, sides: Sequence[float], pressure: Callable[[Floats], Floats], c: float
) -> float:
    """Pressure-weighted mean of w under a unit force on a circle in the middle."""
    a, b = _terms(sides)
    shares = pressure(c * np.hypot(a, b))
    w = np.linalg.inv(stiffness(D, S, a, b))[..., 0, 0]
    return float((4.0 / np.prod(sides) * shares**2 * w).sum())


def middle_under_uniform_load(D: Floats, S: Floats) -> float:
    """Deflection in the middle of the square of side 1 under a unit load."""
    a, b = _terms((1.0, 1.0))
    load = 16.0 * np.sin(a / 2.0) * np.sin(b / 2.0) / (a * b)
    w = np.linalg.inv(stiffness(D, S, a, b))[..., 0, 0]
    return float((load * w).sum())


def equilibrium_shear(ply: Ply, angles: Sequence[float], h: float) -> tuple[float, float]:
    """Transverse shear stiffness xz and yz of equal shear energy, equal plies at 0 or 90 degrees.

    The shear stress of a unit Q_x is -d/dx of sigma_x, integrated over z: a parabola in each ply.
    """
    faces = np.linspace(-h / 2.0, h / 2.0, len(angles) + 1)
    compliance_ = np.linalg.inv(bending_and_shear(ply, angles, h)[0])
    stiff = dict(zip((0.0, 90.0), plane_stress(ply), strict=True))
    found = []
    for axis, moduli in enumerate(((ply.g13, ply.g23), (ply.g23, ply.g13))):
        energy, reached = 0.0, 0.0
        for low, high, angle in zip(faces, faces[1:], angles, strict=False):
            slope = float(stiff[angle][axis] @ compliance_[:, axis])
            tau = np.polynomial.Polynomial([reached + slope * low**2 / 2.0, 0.0, -slope / 2.0])
            work = (tau * tau).integ()
            energy += float(work(high) - work(low)) / moduli[angle != 0.0]
            reached = float(tau(high))
        found.append(1.0 / energy)
    return found[0], found[1]
