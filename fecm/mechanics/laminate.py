"""Laminate stiffness: classical lamination with transverse shear, report section 2.1.

Conventions: layer 1 is the struck face at z = -h/2, the last layer lies at z = +h/2.  Fibre angles
are counter-clockwise from the x-axis.  In-plane components are in the order xx, yy, xy (engineering
shear), transverse shear components in the order xz, yz.  No shear correction factor is applied.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple, Protocol

import numpy as np

from fecm._typing import Floats

LEAST_ENTRY = 1.0e-6  # `without_small_entries` sets smaller entries of A, B and D to 0
SOFT_CORE = 1.0 / 50.0  # largest G13 of a sandwich's core over G13 of its faces
ROUNDING = 1.0e-12  # rounding errors of A, B and D, relative to A h^n
FABRIC_MODULI = 0.5  # least E2/E1 of a fabric; usual fabrics have 0.8 to 1.2
FABRIC_SHEAR = 0.25  # largest G12/E2 of a fabric


# Frozen, so that read-only attributes match; without generated methods, which take 0.4 ms.
@dataclass(frozen=True, init=False, eq=False, repr=False, match_args=False)
class PlyConstants(Protocol):
    """Density (mass/volume), Poisson's ratio and moduli (force/area) of a ply."""

    density: float
    nu12: float
    e1: float
    e2: float
    g12: float
    g13: float
    g23: float


def is_fabric(ply: PlyConstants) -> bool:
    """Return whether a ply has fibres in both directions: E2 near E1, G12 far below."""
    return ply.e2 > FABRIC_MODULI * ply.e1 and ply.g12 < FABRIC_SHEAR * ply.e2


def are_cores(plies: Sequence[PlyConstants]) -> list[bool]:
    """Return which plies are soft in shear, so that the other plies are faces of a sandwich."""
    stiffest = max(ply.g13 for ply in plies)
    return [ply.g13 < SOFT_CORE * stiffest for ply in plies]


@dataclass(frozen=True, eq=False)
class PlyStack:
    """Plies of a laminate, starting at z = -h/2."""

    angles: Floats  # (n,): fibre angles in degrees
    faces: Floats  # (n + 1,): z of the faces, length
    stiffness: Floats  # (n, 3, 3): plane-stress stiffness in the laminate's axes, force/area
    # (n, 2, 2): transverse shear stiffness in the laminate's axes, order xz, yz, force/area.
    shear: Floats
    constants: tuple[PlyConstants, ...]  # (n,)

    @property
    def z(self) -> Floats:
        """Lower, middle and upper z of each ply, (n, 3)."""
        lower, upper = self.faces[:-1], self.faces[1:]
        return np.stack([lower, (lower + upper) / 2.0, upper], axis=1)


class EngineeringConstants(NamedTuple):
    """Elastic constants of the homogeneous plate of the same thickness and compliance."""

    ex: float  # Young's moduli, force/area
    ey: float
    gxy: float  # shear modulus, force/area
    nu_xy: float  # Poisson's ratio: contraction along y over extension along x


@dataclass(frozen=True, eq=False)
class LaminateSection:
    """Stiffness and inertia of a laminate, per area."""

    # (3, 3): extensional, coupling and bending stiffness (equation 2-18): force/length, force,
    # force*length.
    A: Floats
    B: Floats
    D: Floats
    # (2, 2): transverse shear stiffness (equation 2-19), force/length, order xz, yz: A*55, A*45;
    # A*45, A*44.
    shear: Floats
    mass: float  # P of equation 2-24: integral of the density through the thickness
    rotary_inertia: float  # I of equation 2-24: integral of density times z squared
    # Integral of density times z, mass/length.  It couples u and theta_x; the plate ignores it.
    coupling_inertia: float
    thickness: float  # total thickness
    plies: PlyStack

    @property
    def unlike_interfaces(self) -> int:
        """Number of interfaces that can delaminate: fibre angle or material changes there."""
        turns = np.diff(self.plies.angles) % 180.0
        changes = [lower != upper for lower, upper in pairwise(self.plies.constants)]
        return int(np.count_nonzero((turns != 0.0) | np.array(changes, dtype=bool)))

    @property
    def has_core(self) -> bool:
        """Whether a ply is soft in shear, so that the other plies are faces of a sandwich."""
        return any(are_cores(self.plies.constants))

    @property
    def struck_thickness(self) -> float:
        """Thickness of a sandwich's struck face, from the first ply to the core; else of all."""
        if not self.has_core:
            return self.thickness
        core = are_cores(self.plies.constants).index(True)
        return float(self.plies.faces[core] - self.plies.faces[0])

    @property
    def is_coupled(self) -> bool:
        """Whether stretching and bending are coupled (B is not zero beyond rounding)."""
        scale = np.abs(self.A).max() * self.thickness
        return bool(np.abs(self.B).max() > ROUNDING * scale)

    @property
    def in_plane_constants(self) -> EngineeringConstants:
        """Constants under membrane forces, if the laminate is free to bend: Ex = 1/(h a11)."""
        stiffness = self.A - self.B @ np.linalg.solve(self.D, self.B)
        return _constants(stiffness / self.thickness)

    @property
    def flexural_constants(self) -> EngineeringConstants:
        """Constants under moments, if the laminate is free to stretch: Ex = 12/(h^3 d11)."""
        stiffness = self.D - self.B @ np.linalg.solve(self.A, self.B)
        return _constants(stiffness * 12.0 / self.thickness**3)

    def without_small_entries(self) -> LaminateSection:
        """Set entries of A, B, D below 1e-6, but not rounding errors, to 0."""
        scale = ROUNDING * np.abs(self.A).max()

        def cut(matrix: Floats, power: int) -> Floats:
            size = np.abs(matrix)
            small = (size < LEAST_ENTRY) & (size > scale * self.thickness**power)
            return np.where(small, 0.0, matrix)

        return replace(self, A=cut(self.A, 0), B=cut(self.B, 1), D=cut(self.D, 2))


def _constants(stiffness: Floats) -> EngineeringConstants:
    """Return the engineering constants of a plane-stress stiffness, (3, 3)."""
    compliance = np.linalg.inv(stiffness)
    ex, ey, gxy = (1.0 / np.diag(compliance)).tolist()
    return EngineeringConstants(ex, ey, gxy, float(-compliance[0, 1] / compliance[0, 0]))


def reduced_stiffness(ply: PlyConstants) -> Floats:
    """Return the plane-stress stiffness Q of a ply in its own axes, equation 2-3, (3, 3)."""
    e1, e2, nu12 = ply.e1, ply.e2, ply.nu12
    full = 1.0 - nu12**2 * e2 / e1
    q12 = nu12 * e2 / full
    return np.array([[e1 / full, q12, 0.0], [q12, e2 / full, 0.0], [0.0, 0.0, ply.g12]])


def transformed_stiffness(q: Floats, angle: float) -> Floats:
    """Transform a ply's plane-stress stiffness (3, 3) to the laminate's axes, equation 2-5."""
    m, n = np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))
    q11, q22, q12, q66 = q[0, 0], q[1, 1], q[0, 1], q[2, 2]
    a, b = q11 - q12 - 2.0 * q66, q12 - q22 + 2.0 * q66
    bar11 = q11 * m**4 + 2.0 * (q12 + 2.0 * q66) * m**2 * n**2 + q22 * n**4
    bar22 = q11 * n**4 + 2.0 * (q12 + 2.0 * q66) * m**2 * n**2 + q22 * m**4
    bar12 = (q11 + q22 - 4.0 * q66) * m**2 * n**2 + q12 * (m**4 + n**4)
    bar16 = a * m**3 * n + b * m * n**3
    bar26 = a * m * n**3 + b * m**3 * n
    bar66 = (q11 + q22 - 2.0 * q12 - 2.0 * q66) * m**2 * n**2 + q66 * (m**4 + n**4)
    return np.array([[bar11, bar12, bar16], [bar12, bar22, bar26], [bar16, bar26, bar66]])


def transformed_shear(g13: float, g23: float, angle: float) -> Floats:
    """Transform a ply's transverse shear stiffness to the laminate's axes, (2, 2), order xz, yz.

    The sign of Q45 follows from the rotation; equation 2-5 of the report has the opposite sign.
    """
    m, n = np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))
    coupling = (g13 - g23) * m * n
    return np.array([[g13 * m**2 + g23 * n**2, coupling], [coupling, g13 * n**2 + g23 * m**2]])


def laminate(
    ply: PlyConstants | Sequence[PlyConstants],
    angles: Sequence[float],
    thicknesses: Sequence[float],
    total: float | None = None,
) -> LaminateSection:
    """Stack plies, equations 2-18, 2-19 and 2-24.

    Parameters
    ----------
    ply : PlyConstants or sequence of PlyConstants
        Constants of all layers, or of each.
    angles : sequence of float
        Fibre angles in degrees, starting at the struck face, z = -h/2.
    thicknesses : sequence of float
        Layer thicknesses.
    total : float, optional
        Thickness for the inertia; the sum of the layers by default.
    """
    faces = np.concatenate(([0.0], np.cumsum(thicknesses)))
    faces -= faces[-1] / 2.0
    lower, upper = faces[:-1, None, None], faces[1:, None, None]
    plies = tuple(ply) if isinstance(ply, Sequence) else (ply,) * len(angles)
    layers = list(zip(plies, angles, strict=True))
    bars = np.array([transformed_stiffness(reduced_stiffness(p), angle) for p, angle in layers])
    shears = np.array([transformed_shear(p.g13, p.g23, angle) for p, angle in layers])
    h = np.float64(faces[-1] - faces[0] if total is None else total)
    mean, second, first = _mean_densities(plies, faces)
    return LaminateSection(
        A=(bars * (upper - lower)).sum(axis=0),
        B=(bars * (upper**2 - lower**2)).sum(axis=0) / 2.0,
        D=(bars * (upper**3 - lower**3)).sum(axis=0) / 3.0,
        shear=(shears * (upper - lower)).sum(axis=0),
        mass=float(mean * h),
        # Powers of a float raise an OverflowError; powers of NumPy's are infinite.
        rotary_inertia=float(second * h**3 / 12.0),
        coupling_inertia=float(first * h**2),
        thickness=float(h),
        plies=PlyStack(np.array(angles, dtype=float), faces, bars, shears, plies),
    )


def _mean_densities(plies: Sequence[PlyConstants], faces: Floats) -> tuple[float, float, float]:
    """Return the densities of homogeneous plates of the same mass and of the same rotary inertia.

    The third result is the integral of density times z over the thickness squared.
    """
    density = np.array([ply.density for ply in plies])
    if (density == density[0]).all():
        return plies[0].density, plies[0].density, 0.0
    h = faces[-1] - faces[0]
    mean = density @ np.diff(faces) / h
    second = density @ np.diff(faces**3) / (h**3 / 4.0)
    first = density @ np.diff(faces**2) / 2.0 / h**2
    return float(mean), float(second), float(first)


# Delamination threshold of small-mass impact over the static threshold (Olsson, Donadon, Falzon
# 2006).
SMALL_MASS = 1.213


def effective_rigidity(laminate: LaminateSection) -> float:
    """Return the bending stiffness D* of the isotropic plate with the same point response.

    D* = [mean over theta of D(theta)^(-1/2)]^(-2), force*length, where D(theta) is D11 in axes
    turned by theta.  For a coupled laminate D - B A^-1 B replaces D.  An infinite isotropic plate
    of stiffness D* moves at the same velocity under the same point force.  D* does not depend on
    the axes.

    With t = tan(theta) the mean is the integral of 1/(pi sqrt(q)) over all t, where q(t) is a
    quartic with two pairs of conjugate roots.  This elliptic integral is the arithmetic-geometric
    mean of two lengths computed from the roots.  For orthotropic axes the geometric mean of the two
    lengths gives Olsson's sqrt(D11 D22 (eta + 1)/2), 1992, with eta = (D12 + 2 D66)/sqrt(D11 D22).

    NaN if the stiffness is not finite.
    """
    A, B, D = laminate.A, laminate.B, laminate.D
    if laminate.is_coupled:
        D = D - B @ np.linalg.solve(A, B)
    mean, scale = np.sqrt(D[0, 0] * D[1, 1]), (D[0, 0] / D[1, 1]) ** 0.25
    # q(scale t)/D11; the product of its roots is 1.
    twist = 2.0 * (D[0, 1] + 2.0 * D[2, 2]) / mean
    quartic = [1.0, 4.0 * D[1, 2] * scale / mean, twist, 4.0 * D[0, 2] / scale / mean, 1.0]
    if not np.isfinite(quartic).all():
        return math.nan
    first, second = sorted(np.roots(quartic), key=lambda root: root.imag)[2:]
    distance = abs(first - second.conjugate()) / 2.0
    return float(mean) * _agm(distance, math.sqrt(first.imag * second.imag)) ** 2


def _agm(a: float, b: float) -> float:
    """Return the arithmetic-geometric mean of two positive numbers."""
    while abs(a - b) > 1e-15 * a:
        a, b = (a + b) / 2.0, math.sqrt(a * b)
    return a


def threshold_force(rigidity: float, toughness: float, delaminations: int = 1) -> float:
    """Return the force at which n circular delaminations grow, pi sqrt(32 D* G_IIc/(n + 2)).

    The rigidity D* is force*length, the toughness G_IIc force/length.  One delamination: Davies and
    Robinson 1992.  Several delaminations: Suemasu and Majima 1996, Olsson 2001.
    """
    return math.pi * math.sqrt(32.0 * rigidity * toughness / (delaminations + 2.0))
