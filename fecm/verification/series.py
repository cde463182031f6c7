"""Navier's solutions for laminates of two layers, [0/90] and [45/-45], with transverse shear.

A simply supported square plate of side 1 has its middle at x = y = 0.  The deflection of a term is
w = W cos(alpha x) cos(beta y), with alpha and beta odd multiples of pi; K and M of its five
amplitudes U, V, W, X (of theta_x) and Y (of theta_y) follow from the energy of these fields, per
quarter of the plate's area (J. N. Reddy, Mechanics of Laminated Composite Plates, chapter 7).
This module uses neither the elements nor their laminate theory.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fecm._typing import Floats
from fecm.verification.laminates import (
    BAR11,
    BAR12,
    BAR16,
    BAR66,
    FIBRES,
    G13,
    G23,
    Q11,
    Q12,
    Q22,
    Q66,
    RHO,
)

# Plane stress of a layer at 0, 90, 45 and -45 degrees, closed forms.
AT_0 = np.array([[Q11, Q12, 0.0], [Q12, Q22, 0.0], [0.0, 0.0, Q66]])
AT_90 = np.array([[Q22, Q12, 0.0], [Q12, Q11, 0.0], [0.0, 0.0, Q66]])
AT_45 = np.array([[BAR11, BAR12, BAR16], [BAR12, BAR11, BAR16], [BAR16, BAR16, BAR66]])
AT_MINUS_45 = AT_45 * np.array([[1.0, 1.0, -1.0], [1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]])
# Transverse shear, xz and yz.
SHEAR_0, SHEAR_90 = np.diag([G13, G23]), np.diag([G23, G13])
MEAN, HALF = (G13 + G23) / 2.0, (G13 - G23) / 2.0
SHEAR_45 = np.array([[MEAN, HALF], [HALF, MEAN]])
PLY = FIBRES


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
