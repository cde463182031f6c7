"""Stresses, failure and shear stiffness of angle plies, derived anew for ``fecm verify``.

Equal plies, from z = -h/2 on; strains and curvatures are in the order xx, yy, xy.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.polynomial import Polynomial
from scipy.optimize import brentq, minimize_scalar

from fecm import Ply
from fecm._typing import Floats
from tests.builders import turned_stiffness

# Transverse shear --------------------------------------------------------------------------------


def plies(angles: Sequence[float], h: float) -> list[tuple[float, float, float]]:
    """Lower face, upper face and angle of equal plies, h thick in all."""
    faces = np.linspace(-h / 2.0, h / 2.0, len(angles) + 1).tolist()
    return list(zip(faces[:-1], faces[1:], angles, strict=True))


def turn(angle: float) -> Floats:
    """Rotation (2, 2) of the laminate's axes into those of a ply."""
    c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    return np.array([[c, s], [-s, c]])


def shear_stresses(
    ply: Ply, angles: Sequence[float], h: float, by_x: Floats, by_y: Floats
) -> list[tuple[Polynomial, Polynomial]]:
    """tau_xz and tau_yz over z in each ply, from 0 at -h/2 on; a parabola each.

    They balance the stresses of strains and curvatures with the derivatives `by_x` and `by_y`, (6,)
    each.
    """
    actual: list[tuple[Polynomial, Polynomial]] = []
    reached = [0.0, 0.0]
    for low, high, angle in plies(angles, h):
        q = turned_stiffness(ply, angle)

        def change(i: int, gradient: Floats, q: Floats = q) -> Polynomial:
            return Polynomial([q[i] @ gradient[:3], q[i] @ gradient[3:]])

        slopes = -change(0, by_x) - change(2, by_y), -change(2, by_x) - change(1, by_y)
        xz, yz = (s.integ(1, [k], lbnd=low) for s, k in zip(slopes, reached, strict=True))
        reached = [float(xz(high)), float(yz(high))]
        actual.append((xz, yz))
    return actual


def equilibrium_shear(ply: Ply, angles: Sequence[float], h: float) -> Floats:
    """Transverse shear stiffness (2, 2) of equal shear energy, order xz, yz; equal plies.

    Q_x and Q_y are the derivatives of M_x by x and of M_y by y, without membrane forces.
    """
    A, B, D = (
        sum((top**n - low**n) / n * turned_stiffness(ply, a) for low, top, a in plies(angles, h))
        for n in (1, 2, 3)
    )
    slopes = np.linalg.solve(np.block([[A, B], [B, D]]), np.eye(6)[:, [3, 4]])
    still = np.zeros(6)
    under_x = shear_stresses(ply, angles, h, slopes[:, 0], still)
    under_y = shear_stresses(ply, angles, h, still, slopes[:, 1])
    compliance = np.zeros((2, 2))
    for (low, high, angle), *both in zip(plies(angles, h), under_x, under_y, strict=True):
        soft = turn(angle).T @ np.diag([1.0 / ply.g13, 1.0 / ply.g23]) @ turn(angle)
        for i, j in np.ndindex(2, 2):
            terms = [soft[a, b] * both[i][a] * both[j][b] for a, b in np.ndindex(2, 2)]
            work = sum(terms, Polynomial([0.0])).integ()
            compliance[i, j] += work(high) - work(low)
    return np.asarray(np.linalg.inv(compliance), dtype=float)


# Exposures ---------------------------------------------------------------------------------------

CARBON = Ply(1.6e-9, 0.3, 150e3, 10e3, 5e3, 5e3, 3.5e3)
ANGLES, H = (30.0, -45.0, 90.0), 0.75
XT, XC, YT, YC, S12, S13, S23 = 2000.0, 1200.0, 60.0, 200.0, 90.0, 80.0, 50.0
F12, P_PLUS, P_MINUS = -0.4, 0.3, 0.25
# Strains and curvatures in the middle of the element, and their derivatives.
STATE = np.array([-3.0, 2.0, 10.0, -12.0, -7.0, -6.0]) * 1e-3
BY_X = np.array([-1.5, -1.5, 2.75, 0.5, -1.75, -0.25]) * 1e-3
BY_Y = np.array([2.0, -0.25, -0.25, -0.5, 1.75, 0.0]) * 1e-3


def tsai_wu(s1: float, s2: float, t: float) -> float:
    """Tsai and Wu's index, 1 at failure (Journal of Composite Materials 5, 1971, 58)."""
    f11, f22 = 1.0 / (XT * XC), 1.0 / (YT * YC)
    linear = (1.0 / XT - 1.0 / XC) * s1 + (1.0 / YT - 1.0 / YC) * s2
    mixed = 2.0 * F12 * math.sqrt(f11 * f22) * s1 * s2
    return linear + f11 * s1**2 + f22 * s2**2 + (t / S12) ** 2 + mixed


def hashin(s1: float, s2: float, t: float) -> float:
    """Larger index of Hashin's fibre and matrix (Journal of Applied Mechanics 47, 1980, 329)."""
    transverse = YC / 2.0
    fibre = (s1 / XT) ** 2 + (t / S12) ** 2 if s1 > 0.0 else (s1 / XC) ** 2
    if s2 > 0.0:
        return max(fibre, (s2 / YT) ** 2 + (t / S12) ** 2)
    pressed = ((YC / (2.0 * transverse)) ** 2 - 1.0) * s2 / YC + (s2 / (2.0 * transverse)) ** 2
    return max(fibre, pressed + (t / S12) ** 2)


def puck(s1: float, s2: float, t: float) -> float:
    """Larger effort of fibre and inter-fibre failure (Puck and Schürmann 1998, modes A, B, C)."""
    fibre = max(s1 / XT, -s1 / XC)
    if s2 >= 0.0:
        steep = (1.0 - P_PLUS * YT / S12) * s2 / YT
        return max(fibre, math.hypot(t / S12, steep) + P_PLUS * s2 / S12)
    resistance = S12 / (2.0 * P_MINUS) * (math.sqrt(1.0 + 2.0 * P_MINUS * YC / S12) - 1.0)
    slope = P_MINUS * resistance / S12
    if abs(s2 / t) <= resistance / (S12 * math.sqrt(1.0 + 2.0 * slope)):
        return max(fibre, (math.hypot(t, P_MINUS * s2) + P_MINUS * s2) / S12)
    turned = (t / (2.0 * (1.0 + slope) * S12)) ** 2 + (s2 / YC) ** 2
    return max(fibre, turned * YC / -s2)


def max_stress(s1: float, s2: float, t: float) -> float:
    """Largest ratio of a stress to its strength."""
    return max(s1 / XT, -s1 / XC, s2 / YT, -s2 / YC, abs(t) / S12)


def exposure(index: Callable[..., float], stress: Floats) -> float:
    """Reciprocal of the factor on the stresses at which the index is 1."""
    factor = brentq(lambda factor: index(*(factor * stress)) - 1.0, 0.0, 1e3, xtol=1e-13)
    return 1.0 / float(factor)


def exposures() -> list[float]:
    """Largest exposure of each ply by four criteria, in the state of the middle."""
    states = []
    for low, high, angle in plies(ANGLES, H):
        stresses = [
            turned_stiffness(CARBON, angle) @ (STATE[:3] + z * STATE[3:]) for z in (low, high)
        ]
        R = turn(angle)
        values = [R @ np.array([[s[0], s[2]], [s[2], s[1]]]) @ R.T for s in stresses]
        states.append([np.array([s[0, 0], s[1, 1], s[0, 1]]) for s in values])
    return [
        max(exposure(index, stress) for stress in faces)
        for index in (max_stress, tsai_wu, hashin, puck)
        for faces in states
    ]


def interlaminar() -> list[float]:
    """Largest exposure of each interface by the shear stresses, in the axes of both plies beside.

    What is left at z = h/2 is removed linearly in z.
    """
    stresses = shear_stresses(CARBON, ANGLES, H, BY_X, BY_Y)
    left = np.array([tau(H / 2.0) for tau in stresses[-1]])
    values = []
    for number, (_, z, _) in enumerate(plies(ANGLES, H)[:-1]):
        tau = np.array([one(z) for one in stresses[number]]) - left * (z / H + 0.5)
        beside = [turn(angle) @ tau for angle in ANGLES[number : number + 2]]
        values.append(max(math.hypot(t13 / S13, t23 / S23) for t13, t23 in beside))
    return values


# Residual stresses -------------------------------------------------------------------------------

# T300/5208 (Tsai and Hahn 1980), Pa and per kelvin.
COOLED = Ply(1600.0, 0.28, 181e9, 10.3e9, 7.17e9, 7.17e9, 3.68e9)
ALPHA = np.array([0.02e-6, 22.5e-6, 0.0])


def residual_stresses() -> tuple[float, ...]:
    """Midplane strain, curvature and stresses of the first ply of Kaw's [0/90], and of [0/90]s.

    The free laminate takes the strains of the least energy.  In balanced symmetric laminates they
    are the same in x and in y.
    """
    h, dt = 0.01, -75.0
    weighted, wanted = [], []
    for low, high, angle in plies([0.0, 90.0], h):
        root = np.linalg.cholesky(turned_stiffness(COOLED, angle)).T
        free = ALPHA[[1, 0, 2]] if angle else ALPHA
        for point in (-1.0, 1.0):
            z = (low + high) / 2.0 + point / math.sqrt(3.0) * (high - low) / 2.0
            weighted.append(root @ np.hstack([np.eye(3), z / h * np.eye(3)]))
            wanted.append(root @ free * dt)
    actual = np.linalg.lstsq(np.vstack(weighted), np.concatenate(wanted), rcond=None)[0]
    strain, curvature = actual[:3], actual[3:] / h
    q = turned_stiffness(COOLED, 0.0)
    lower, upper = (q @ (strain + z * curvature - ALPHA * dt) for z in (-h / 2.0, 0.0))
    common = -100.0 * q[:, :2].sum(axis=0)[:2] @ ALPHA[:2] / q[:2, :2].sum()
    across = float((q @ (np.array([common, common, 0.0]) + 100.0 * ALPHA))[1])
    swollen = 0.5 * np.array([2e-4, 6e-3, 0.0])
    both = (q[0] + q[1]) @ swollen / q[:2, :2].sum()
    wet = float((q @ (np.array([both, both, 0.0]) - swollen))[1])
    return strain[0], curvature[0], lower[0], upper[0], lower[1], upper[1], across, across, wet


def inclined_failure() -> list[float]:
    """Puck's exposure, largest over the planes along the fibres, of pressed plies.

    On a plane whose normal is at an angle to the ply, sigma_n = s2 cos^2, tau_nt = -s2 sin cos and
    tau_nl = tau cos.  Its exposure is sqrt((tau_nt/R_A)^2 + (tau_nl/S)^2 + (r sigma_n)^2) +
    r sigma_n with r = p/S; R_A follows from an exposure of 1 at s2 = -YC.
    """
    yc, s, p = 200.0, 90.0, 0.25
    r = p / s

    def largest(s2: float, tau: float, resistance: float) -> float:
        def exposure(angle: float) -> float:
            cos, sin = math.cos(angle), math.sin(angle)
            n = r * s2 * cos**2
            return math.hypot(s2 * sin * cos / resistance, tau * cos / s, n) + n

        steps = np.linspace(0.0, math.pi / 2.0, 181)
        best = float(steps[np.argmax([exposure(angle) for angle in steps])])
        around = (best - 0.02, best + 0.02)
        actual = minimize_scalar(
            lambda a: -exposure(a), bounds=around, method="bounded", options={"xatol": 1e-9}
        )
        return exposure(float(actual.x))

    resistance = brentq(lambda one: largest(-yc, 0.0, one) - 1.0, 20.0, 200.0, xtol=1e-12)
    pressed = ((-180.0, 0.0), (-180.0, 60.0), (-150.0, -80.0))
    return [largest(s2, tau, resistance) for s2, tau in pressed]
