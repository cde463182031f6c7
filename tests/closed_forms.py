"""Expected values of ``fecm verify``, derived anew from closed forms and series.

Nothing here uses the elements or the laminate theory of the program.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.integrate import solve_ivp
from scipy.special import beta, j1

from fecm import Ply
from fecm._typing import Floats
from tests.builders import turned_stiffness
from tests.closed_forms_plies import (
    equilibrium_shear,
    exposures,
    inclined_failure,
    interlaminar,
    residual_stresses,
)
from tests.closed_forms_preload import preloaded
from tests.closed_forms_statistics import ishigami, lognormal, wilson
from tests.closed_forms_stretching import strips

# Layers ------------------------------------------------------------------------------------------

# An isotropic ply.
E, NU, RHO, H = 1.0e7, 0.3, 2.5e-4, 0.1
G = E / (2.0 * (1.0 + NU))
PLATE = E / (1.0 - NU**2)

# A ply of the report's kind, with a different G23, and the plane-stress stiffness of two layers.
E1, E2, NU12, G12, G13, G23 = 17.5e6, 1.15e6, 0.3, 0.8e6, 0.8e6, 0.5e6
FULL = 1.0 - NU12**2 * E2 / E1
Q11, Q22, Q12, Q66 = E1 / FULL, E2 / FULL, NU12 * E2 / FULL, G12
THICK = 0.02  # of two layers
# At 45 degrees: Q11 + Q22 + 2 Q12 +- 4 Q66 and the couplings between stretching and shear.
BAR11 = (Q11 + Q22 + 2.0 * Q12 + 4.0 * Q66) / 4.0
BAR12 = (Q11 + Q22 + 2.0 * Q12 - 4.0 * Q66) / 4.0
BAR66 = (Q11 + Q22 - 2.0 * Q12) / 4.0
BAR16 = (Q11 - Q22) / 4.0


# Navier's solutions for [0/90] and [45/-45], with transverse shear ------------------------------

# A simply supported square plate of side 1 has its middle at x = y = 0.  The deflection of a term
# is w = W cos(alpha x) cos(beta y), with alpha and beta odd multiples of pi; K and M of its five
# amplitudes U, V, W, X (of theta_x) and Y (of theta_y) follow from the energy of these fields, per
# quarter of the plate's area (J. N. Reddy, Mechanics of Laminated Composite Plates, chapter 7).

# Plane stress of a layer at 0, 90, 45 and -45 degrees, closed forms.
AT_0 = np.array([[Q11, Q12, 0.0], [Q12, Q22, 0.0], [0.0, 0.0, Q66]])
AT_90 = np.array([[Q22, Q12, 0.0], [Q12, Q11, 0.0], [0.0, 0.0, Q66]])
AT_45 = np.array([[BAR11, BAR12, BAR16], [BAR12, BAR11, BAR16], [BAR16, BAR16, BAR66]])
AT_MINUS_45 = AT_45 * np.array([[1.0, 1.0, -1.0], [1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]])
# Transverse shear, xz and yz.
SHEAR_0, SHEAR_90 = np.diag([G13, G23]), np.diag([G23, G13])
MEAN, HALF = (G13 + G23) / 2.0, (G13 - G23) / 2.0
SHEAR_45 = np.array([[MEAN, HALF], [HALF, MEAN]])


@dataclass(frozen=True)
class TwoLayers:
    """Two layers of equal thickness, the first on the struck face.

    Attributes
    ----------
    first, second : ndarray (3, 3)
        Plane stress of the layers.
    shear : ndarray (2, 2)
        Mean transverse shear modulus, order xz, yz.
    h : float
        Thickness of both.
    twists : bool
        Whether stretching is coupled with twisting, as in [45/-45], rather than with bending.
    """

    first: Floats
    second: Floats
    shear: Floats
    h: float
    twists: bool = False

    @property
    def stiffness(self) -> Floats:
        """A, B and D in one matrix, (6, 6)."""
        total, difference = self.first + self.second, self.second - self.first
        A, B, D = total * self.h / 2.0, difference * self.h**2 / 8.0, total * self.h**3 / 24.0
        return np.block([[A, B], [B, D]])

    @property
    def inertia(self) -> Floats:
        """Mass and rotary inertia of the five amplitudes."""
        return RHO * self.h * np.array([1.0, 1.0, 1.0, self.h**2 / 12.0, self.h**2 / 12.0])

    def strains(self, a: Floats, b: Floats) -> Floats:
        """Strains xx, yy, xy and curvatures xx, yy, xy of the amplitudes, (..., 6, 5).

        Those of [0/90] vary as cos cos, xy as sin sin; those of [45/-45] the other way round in the
        plane.
        """
        E = np.zeros((*np.shape(a), 6, 5))
        sign = -1.0 if self.twists else 1.0
        E[..., 0, 0], E[..., 1, 1] = sign * a, sign * b
        E[..., 2, 0], E[..., 2, 1] = -sign * b, -sign * a
        E[..., 3, 3], E[..., 4, 4] = -a, -b
        E[..., 5, 3], E[..., 5, 4] = b, a
        return E

    def modal_stiffness(self, a: Floats, b: Floats) -> Floats:
        """K of the five amplitudes, (..., 5, 5)."""
        E = self.strains(a, b)
        G = np.zeros((*np.shape(a), 2, 5))
        G[..., 0, 2], G[..., 0, 3] = -a, -1.0
        G[..., 1, 2], G[..., 1, 4] = -b, -1.0
        shear = self.shear * self.h
        return np.asarray(E.swapaxes(-1, -2) @ self.stiffness @ E + G.swapaxes(-1, -2) @ shear @ G)

    def modes(self, a: Floats, b: Floats) -> tuple[Floats, Floats]:
        """Angular frequencies (..., 5), ascending, and amplitudes of unit modal mass in columns."""
        root = 1.0 / np.sqrt(self.inertia)
        squares, vectors = np.linalg.eigh(root[:, None] * self.modal_stiffness(a, b) * root)
        return np.sqrt(squares), root[:, None] * vectors


def terms(most: int) -> tuple[Floats, Floats, Floats]:
    """Wave numbers alpha and beta of the terms up to `most`, and amplitudes of a uniform load."""
    odd = np.arange(1.0, most + 1.0, 2.0)
    m, n = (grid.ravel() for grid in np.meshgrid(odd, odd, indexing="ij"))
    signs = np.where((m + n) % 4 == 2.0, 1.0, -1.0)
    return m * np.pi, n * np.pi, 16.0 * signs / (np.pi**2 * m * n)


def cross_ply(h: float) -> TwoLayers:
    """Build [0/90]."""
    return TwoLayers(AT_0, AT_90, (SHEAR_0 + SHEAR_90) / 2.0, h)


def angle_ply(h: float) -> TwoLayers:
    """Build [45/-45], in which the coupling of the transverse shears cancels."""
    return TwoLayers(AT_45, AT_MINUS_45, np.diag([MEAN, MEAN]), h, twists=True)


def off_axis(h: float) -> TwoLayers:
    """Build [0/45], in which no stiffness vanishes; not for the series."""
    return TwoLayers(AT_0, AT_45, (SHEAR_0 + SHEAR_45) / 2.0, h)


# Navier's solution for a rectangle, without coupling --------------------------------------------

# B, D16, D26 and A*45 are zero.  The fields of a term, with their origin in the middle of the plate
# and odd multiples of pi over the sides in alpha and beta, are w = W cos(alpha x) cos(beta y),
# theta_x = -X sin(alpha x) cos(beta y) and theta_y = -Y cos(alpha x) sin(beta y).


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
    a, b = (np.pi * np.arange(1.0, 401, 2.0) / side for side in sides)
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


def mean_rigidity(ply: Ply, angles: Sequence[float], h: float) -> float:
    """Bending stiffness of the isotropic infinite plate of equal point mobility, equal plies.

    The velocity of a point under a force is the mean over all directions of that of isotropic
    plates with their bending stiffness, which goes with its power -1/2.
    """
    directions = np.arange(4096) * np.pi / 4096
    faces = np.linspace(-h / 2.0, h / 2.0, len(angles) + 1)
    nu21 = ply.nu12 * ply.e2 / ply.e1
    e1, e2 = ply.e1 / (1.0 - ply.nu12 * nu21), ply.e2 / (1.0 - ply.nu12 * nu21)
    stiffness_ = np.zeros_like(directions)
    for low, high, angle in zip(faces, faces[1:], angles, strict=False):
        c, s = np.cos(directions - np.deg2rad(angle)), np.sin(directions - np.deg2rad(angle))
        mixed = ply.nu12 * e2 + 2.0 * ply.g12
        along = e1 * c**4 + 2.0 * mixed * c**2 * s**2 + e2 * s**4
        stiffness_ += along * (high**3 - low**3) / 3.0
    return float(np.mean(stiffness_**-0.5) ** -2.0)


# Expected values ---------------------------------------------------------------------------------


def two_layers(plate: TwoLayers) -> tuple[float, ...]:
    """Frequencies 11 and 13, w in the middle and u at the edge under a uniform load."""
    a, b, loads = terms(79)
    unit = np.eye(5)[:, 2:3]
    amplitudes = np.linalg.solve(plate.modal_stiffness(a, b), loads[:, None, None] * unit)[..., 0]
    lowest, higher = (
        float(plate.modes(np.array(np.pi), np.array(n * np.pi))[0][0]) for n in (1.0, 3.0)
    )
    middle = float(amplitudes[:, 2].sum())
    moved = float((amplitudes[:, 0] * np.sin((b if plate.twists else a) / 2.0)).sum())
    return lowest, higher, lowest, middle, moved, middle


def forced(time: float) -> tuple[float, float]:
    """Deflection in the middle and strain of the gage of [0/90] under sin²(5e4 t)."""
    a, b, loads = terms(79)
    plate = cross_ply(H)
    omega, shapes = plate.modes(a, b)
    twice = 2.0 * 5.0e4  # sin² is half of 1 - cos
    answer = (1.0 - np.cos(omega * time)) / omega**2
    answer -= (np.cos(twice * time) - np.cos(omega * time)) / (omega**2 - twice**2)
    amplitudes = shapes @ (loads[:, None] * shapes[:, 2] * answer / 2.0)[..., None]
    # The gage is at a Gauss point of an element of side 1/12 whose corner is (1/12, 1/4).
    root = (1.0 - 1.0 / math.sqrt(3.0)) / 24.0
    x, y = (float(f"{corner + root:.9g}") for corner in (1 / 12, 0.25))
    along, across = np.cos(a * x) * np.cos(b * y), np.sin(a * x) * np.sin(b * y)
    strains = (plate.strains(a, b) @ amplitudes)[..., 0]
    strains *= np.stack([along, along, across] * 2, axis=-1)
    at = strains[:, :3].sum(axis=0) + H / 2.0 * strains[:, 3:].sum(axis=0)
    c, s = math.cos(math.pi / 6.0), 0.5  # 30 degrees
    return float(amplitudes[:, 2].sum()), float(at @ [c * c, s * s, c * s])


def ply_stresses() -> tuple[float, ...]:
    """Amplitudes of the stresses of Pagano's [0/90/0] under a sinusoidal load, a/h = 10."""
    pi = np.array(np.pi)
    D, S = bending_and_shear(PAGANO, (0.0, 90.0, 0.0), H)
    _, x, y = np.linalg.solve(stiffness(D, S, pi, pi), [1.0, 0.0, 0.0])
    # Amplitudes of the curvatures over cos cos, cos cos and sin sin; stresses over z.
    curvatures = np.pi * np.array([x, y, -(x + y)])
    at_0, at_90 = (q @ curvatures for q in plane_stress(PAGANO))
    # tau_xz and tau_yz at z = 0 are the integral of z over the plies below.
    outer, inner = (np.pi * (q[:2] - q[2]) for q in (at_0, at_90))
    shears = outer * -(H**2) / 9.0 + inner * -(H**2) / 72.0
    return (*(at_0 * H / 2.0).tolist(), float(at_90[1] * H / 6.0), *shears.tolist())


def hertz_impact(mass: float, velocity: float, k: float) -> tuple[float, ...]:
    """Largest indentation, largest force and duration of an impact on a rigid target; velocity.

    m v²/2 = 2 k a^2.5/5; the contact lasts 2.9432 a/v (H. Hertz; the integral of
    2 dx/sqrt(1 - x^2.5) from 0 to 1 in closed form by gamma functions).
    """
    deepest = (5.0 * mass * velocity**2 / (4.0 * k)) ** 0.4
    integral = 2.0 * math.sqrt(math.pi) * math.gamma(1.4) / math.gamma(0.9)
    return deepest, k * deepest**1.5, integral * deepest / velocity, velocity


def acr_impact(mass: float, velocity: float, k: float, alpha_cr: float) -> tuple[float, ...]:
    """The same by equation 3-7, F (x/d)^2.5 in unloading; and the energy that is lost.

    The energy of the rebound is 2/7 F d, which takes d/v times the integral of
    dx/sqrt(1 - x^3.5) from 0 to 1.
    """
    deepest, force, whole, _ = hertz_impact(mass, velocity, k)
    d = alpha_cr**0.4 * deepest**0.6
    rebound = math.sqrt(4.0 / 7.0 * force * d / mass)
    duration = whole / 2.0 + 2.0 / 7.0 * beta(2.0 / 7.0, 0.5) * d / rebound
    return deepest, force, duration, rebound, 0.5 * mass * (velocity**2 - rebound**2)


def two_bodies(time: float) -> tuple[float, ...]:
    """Largest force, velocity of the mass, displacement of the plate, and work of DAMP.

    Of a rigid mass on a rigid plate that is slowed down in proportion to its velocity.
    """
    mass, plate, k, a = 2.0e-4, 2.5e-4 * 0.2, 1.0e5, 2000.0

    def force(state: Floats) -> float:
        return float(k * max(state[0] - state[2], 0.0) ** 1.5)

    def rate(_: float, y: Floats) -> list[float]:
        F, resistance = force(y), a * plate * y[3]
        return [y[1], -F / mass, y[3], (F - resistance) / plate, resistance * y[3]]

    solution = solve_ivp(
        rate,
        (0.0, time),
        [0.0, 100.0, 0.0, 0.0, 0.0],
        "DOP853",
        rtol=1e-13,
        atol=1e-15,
        events=lambda _, y: y[1] - y[3],
    )
    return force(solution.y_events[0][0]), -solution.y[1, -1], solution.y[2, -1], solution.y[4, -1]


def indentation() -> tuple[float | None, ...]:
    """Forces along the paths of the report's law, and the work of a cycle."""
    k, alpha_p, s_p, q, alpha_cr, peak = 1.912e6, 6.564e-4, 0.094, 2.0, 1.2e-3, 2e-3
    force = k * peak**1.5
    remains, remains_acr = s_p * (peak - alpha_p), peak - alpha_cr**0.4 * peak**0.6
    lost = 2.0 / 5.0 * k * peak**2.5 - force * (peak - remains) / (q + 1.0)
    halfway = k / alpha_cr * ((peak - remains_acr) / 2.0) ** 2.5
    return (
        None,
        force,
        force / 2.0**q,
        0.0,
        0.0,
        0.0,
        force,
        force / 2.0**1.5,
        lost,
        force,
        halfway,
        0.0,
    )


def time_steps() -> tuple[float, float]:
    """Steps 2/ω of w and of θ_x at the centre of a square element whose other dofs are held.

    The shape function is (1 - ξ²)(1 - η²), and the lumped mass 4/9 of the element's.
    """
    side, h = 0.3, 0.1
    mass, square = 4.0 / 9.0 * RHO * h * side**2, (16.0 / 15.0) ** 2 / 4.0 * side**2
    bend = (PLATE + G) * h**3 / 12.0 * 256.0 / 45.0 / 2.0
    tilt = math.sqrt(mass * h**2 / 12.0 / (bend + G * h * square))
    return math.sqrt(5.0) / 4.0 * side * math.sqrt(RHO / G), 2.0 * tilt


def curved_strains() -> tuple[float, ...]:
    """Strains of w = 1 on a ply at 30 degrees, and the pressure of its membrane forces."""
    ply = Ply(1.57e-9, 0.32, 171420.0, 9080.0, 5290.0, 5290.0, 3242.9)
    strain = np.array([1.0 / 500.0, -1.0 / 1000.0, 2.0 / 800.0])
    return *strain.tolist(), float(strain @ turned_stiffness(ply, 30.0) @ strain * 0.2)


STRAIN, CURVATURE = (1e-3, 2e-3, 3e-3), (0.4, -0.5, 0.6)
MOMENT = (
    (Q22 - Q11) * THICK**2 / 8.0 * STRAIN[0]
    + (Q11 + Q22) * THICK**3 / 24.0 * CURVATURE[0]
    + Q12 * THICK**3 / 12.0 * CURVATURE[1]
)
LOADS, SHEARS = (100.0, -40.0, 30.0, 0.5, 0.3, -0.2), (20.0, -8.0)
PAIR = off_axis(THICK)
REPORT = Ply(0.000148, 0.3, 17.5e6, 1.15e6, 0.8e6, 0.8e6, 0.8e6)
PAGANO = Ply(1.0, 0.25, 25.0, 1.0, 0.5, 0.5, 0.2)
UNIT = Ply(1.0, 0.3, 1.0, 1.0, 1.0 / 2.6, 1.0 / 2.6, 1.0 / 2.6)
CROSS = bending_and_shear(REPORT, 5 * (0.0, 90.0) + 5 * (90.0, 0.0), 0.106)
REPORT_HALF = 2 * (0.0, 45.0, 0.0, -45.0, 0.0)
REPORT_RIGIDITY = mean_rigidity(REPORT, REPORT_HALF + REPORT_HALF[::-1], 0.106)
BAR_SPEED = math.sqrt(30.0e6 / 7.33e-4)
# Impulse of the pulse: the area of the Gaussian without its tail before t = 0.
IMPULSE = 1000.0 * 40e-6 * math.sqrt(math.pi) * (1.0 + math.erf(2.5))
PARABOLA = 1.5 / H / (2.0 * math.pi)

ANGLES = equilibrium_shear(PAGANO, (30.0, -45.0, 90.0), 1.0)

# Of each case the values in the order of its checks; None for a figure that is stated.
EXPECTED: dict[str, Sequence[float | None]] = {
    "isotropic-ply": (
        PLATE * H, NU * PLATE * H, G * H, 0.0, PLATE * H**3 / 12.0, NU * PLATE * H**3 / 12.0,
        G * H**3 / 12.0, G * H, RHO * H, RHO * H**3 / 12.0,
    ),
    "cross-ply": (
        (Q11 + Q22) * THICK / 2.0, Q12 * THICK, Q66 * THICK, (Q22 - Q11) * THICK**2 / 8.0,
        (Q11 - Q22) * THICK**2 / 8.0, (Q11 + Q22) * THICK**3 / 24.0, Q66 * THICK**3 / 12.0,
        (G13 + G23) * THICK / 2.0,
    ),
    "angle-ply": (
        BAR11 * THICK, BAR12 * THICK, BAR66 * THICK, 0.0, -BAR16 * THICK**2 / 4.0, 0.0,
        BAR11 * THICK**3 / 12.0, BAR66 * THICK**3 / 12.0, (G13 - G23) * THICK / 2.0,
    ),
    "patch": (*STRAIN, *CURVATURE, 0.0, MOMENT),
    "frequencies": (None, None, None, None, math.sqrt(12.0 / 2.6) / 0.1),
    "time-step": time_steps(),
    "resultants": (
        *np.linalg.solve(PAIR.stiffness, LOADS).tolist(), *LOADS,
        *np.linalg.solve(0.8 * THICK * PAIR.shear, SHEARS).tolist(), *SHEARS,
    ),
    "tape8": (*CURVATURE, 0.02, -0.03),
    "cross-ply-plate": two_layers(cross_ply(H)),
    "angle-ply-plate": two_layers(angle_ply(H)),
    "forced-plate": forced(600 * 1.08e-7),
    "cylindrical-bending": (*strips(), 1.0, strips()[0]),
    "reduced-plate": (1.0 + 0.75 * (1.0 - 0.3**2) * (1.0 / (1.0 - 0.3) + 0.5),),
    "dispersion": (None, None, math.sqrt(12.0 * 0.8e6 / 0.000148) / 0.106),
    "rod-pulse": (None, None, None, IMPULSE / (7.33e-4 * math.pi * 0.625**2 / 4.0), None),
    "rod-waves": (BAR_SPEED, 1000.0, math.pi * BAR_SPEED, math.pi * BAR_SPEED),
    "indentation": indentation(),
    "permanent-indentation": (0.0, 0.094),
    "rigid-target": (
        *hertz_impact(2.0e-4, 100.0, 1.0e6), *acr_impact(2.0e-4, 100.0, 1.0e6, 1.2e-3)
    ),
    "webassembly": (
        *hertz_impact(2.0e-4, 100.0, 1.0e6), *acr_impact(2.0e-4, 100.0, 1.0e6, 1.2e-3)
    ),
    "free-plate": two_bodies(3e-4),
    "patch-compliance": (
        *(compliance(*CROSS, (6.0, 4.0), shape, 0.5) for shape in (disc, hertz)), None, None,
    ),
    # e_eta = -xi² (1 + xi/2)/2, whose cubic part is 3/5 xi where xi is 0 and ±√(3/5); over y,eta.
    "assumed-shear": [
        *(middle_under_uniform_load(*bending_and_shear(UNIT, (0.0,), h)) for h in (0.1, 0.001)),
        -(1.0 - 0.3) / (1.0 - 0.5), -(1.0 + 0.3) / (1.0 + 0.5),
    ],
    "equilibrium-shear": (
        5.0 / 6.0, *equilibrium_shear(PAGANO, (0.0, 90.0, 0.0), 1.0).diagonal(),
        *equilibrium_shear(PAGANO, (0.0, 90.0), 1.0).diagonal(), *ANGLES[[0, 1, 0], [0, 1, 1]],
    ),
    "ply-stresses": ply_stresses(),
    "preload": preloaded(
        partial(stiffness, *bending_and_shear(PAGANO, (0.0, 90.0, 0.0), H)), PAGANO
    ),
    "failure-states": (*exposures(), *interlaminar()),
    "residual-stresses": residual_stresses(),
    "inclined-failure": inclined_failure(),
    # Faces from 0.4 to 0.5 on either side, a core of 0.2 of their density.
    "unlike-densities": (0.2 + 0.2 * 0.8, 2.0 / 3.0 * (0.5**3 - 0.4**3 + 0.2 * 0.4**3)),
    "curved-strains": curved_strains(),
    "random-values": (*ishigami(), *lognormal(115.0, 0.08), *wilson(3, 40)),
    "refinement": (1.7, 1.0),
    "identification": (1.0e6, 100.0),
    "contact-coefficient": (1.0 / (1.0 - 0.3**2), None, None),
    "ply-shear": (-PARABOLA, -0.75 * PARABOLA, -0.9375 * PARABOLA, 0.0),
    "threshold": (
        math.sqrt(8.0 * math.pi**2 * 60e3 * 2.0**3 * 0.8 / (9.0 * 0.91)),
        *[math.pi * math.sqrt(32.0 * REPORT_RIGIDITY * 2.9 / 3.0)] * 2,
    ),
    # Timoshenko and Woinowsky-Krieger, equation 147: w D/(F a²) of a simply supported square.
    "large-mass": (240e9 * 0.004**3 / (12.0 * 0.91) / (0.0116008395 * 0.2**2), None),
    # The force of a half sine is below 0.9 after this; the mass leaves with cos of the phase.  It
    # must be faster than 0.35 and 0.4 of the share of the force, times the plate's velocity.
    "end-of-contact": (
        math.asin(0.9) / math.pi,
        1.0 - (math.atan(0.8) + math.acos(-0.7 / math.sqrt(1.64))) / math.pi,
        0.0,
        math.asin(0.9) / math.pi,
    ),
}  # fmt: skip
# References of relative errors that are derived too.
SCALES = {"indentation": EXPECTED["indentation"][1], "ply-shear": PARABOLA}
