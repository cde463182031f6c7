"""The infinite laminate, and its properties in the axes of a wave's normal."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from fecm._dataclasses import frozen
from fecm._typing import Floats, Indices
from fecm.mechanics.laminate import Laminate
from fecm.studies import StudyError

OUT_OF_RANGE = "the laminate's constants are too large or too far apart to compute with"


@frozen
class Medium:
    """An infinite laminate; raises StudyError if stiffness or inertia is not positive definite."""

    # Stiffness, mass P, rotary inertia I, and R, the first moment of density about the midplane.
    laminate: Laminate

    def __post_init__(self) -> None:
        try:
            for matrix in (self.section, self.laminate.shear):
                np.linalg.cholesky(_correlation(matrix))
        except np.linalg.LinAlgError:
            raise StudyError("the laminate's stiffness is not positive definite") from None
        p, r, i = self._inertias
        if not (p > 0.0 and i > 0.0 and abs(r) < (p * i) ** 0.5):
            raise StudyError("the laminate's inertia is not positive definite")

    @property
    def _inertias(self) -> tuple[float, float, float]:
        """P, R and I of equation 2-24."""
        laminate = self.laminate
        return laminate.mass, laminate.coupling_inertia, laminate.rotary_inertia

    @cached_property
    def section(self) -> Floats:
        """Stiffness [[A, B], [B, D]] of equation 2-20, (6, 6), without rounding errors of B."""
        laminate = self.laminate
        b = laminate.B if laminate.is_coupled else np.zeros((3, 3))
        return np.block([[laminate.A, b], [b.T, laminate.D]])

    @property
    def inertia(self) -> Floats:
        """Inertia of u_n, u_t, phi_n, phi_t, w, (5, 5): the right sides of 2-22 and 2-23."""
        p, r, i = self._inertias
        matrix = np.diag([p, p, i, i, p])
        matrix[[0, 1, 2, 3], [2, 3, 0, 1]] = r
        return matrix

    @property
    def shear_velocity(self) -> float:
        """Velocity of transverse shear, root mean square over all directions (length/time).

        It is sqrt(G13/rho) if G13 = G23, the scale of figures 2.4 and 2.5.
        """
        return float((np.trace(self.laminate.shear) / (2.0 * self.laminate.mass)) ** 0.5)


def trigonometry(degrees: ArrayLike) -> tuple[Floats, Floats]:
    """Cosine and sine, (n,) each, exact at multiples of 90 degrees."""
    angle = np.atleast_1d(np.asarray(degrees, dtype=np.float64))
    quarter = np.round(angle / 90.0)
    rest = np.deg2rad(angle - 90.0 * quarter)
    cos, sin = np.cos(rest), np.sin(rest)
    turn = np.mod(quarter, 4.0).astype(int)
    along, across = [cos, -sin, -cos, sin], [sin, cos, -sin, -cos]
    return np.choose(turn, along) + 0.0, np.choose(turn, across) + 0.0


def gradients(degrees: ArrayLike) -> tuple[Floats, Floats, Floats]:
    """Strains xx, yy, xy of a unit gradient along n of u_n and u_t, (n, 3, 2).

    The first and second derivative with respect to the angle (radian) follow.
    """
    cos, sin = trigonometry(degrees)
    one, two = cos**2 - sin**2, 2.0 * sin * cos  # cosine and sine of twice the angle
    normal = np.stack([cos**2, sin**2, two], axis=-1)
    tangential = np.stack([-two / 2.0, two / 2.0, one], axis=-1)
    slope = np.stack([-one, one, -2.0 * two], axis=-1)
    return (
        np.stack([normal, tangential], axis=-1),
        np.stack([2.0 * tangential, slope], axis=-1),
        np.stack([2.0 * slope, -4.0 * tangential], axis=-1),
    )


def in_normal_axes(tensor: Floats, degrees: ArrayLike) -> Floats:
    """Components nn, nt; tn, tt, (n, 2, 2), of a symmetric tensor with xx, xy; yx, yy."""
    cos, sin = trigonometry(degrees)
    axes = np.stack([np.stack([cos, -sin], axis=-1), np.stack([sin, cos], axis=-1)], axis=1)
    return np.asarray(axes.transpose(0, 2, 1) @ tensor @ axes)


def shares(inertia: Floats, vectors: Floats) -> Floats:
    """Share of every component in the energy of modes, (..., modes, 5), columns of `vectors`."""
    energy = vectors * (inertia @ vectors)
    return np.asarray(np.swapaxes(energy / energy.sum(axis=-2, keepdims=True), -1, -2))


def first_largest(scores: Floats) -> Indices:
    """Index of the largest score of every row; the first of those equal up to rounding."""
    equal = scores > scores.max(axis=-1, keepdims=True) - 1e-9  # sums of shares, of order 1
    return np.asarray(equal.argmax(axis=-1))


def _correlation(matrix: Floats) -> Floats:
    """Scale a matrix to a unit diagonal."""
    with np.errstate(all="ignore"):
        scale = 1.0 / np.sqrt(np.diag(matrix))
        scaled: Floats = matrix * np.outer(scale, scale)
    if not np.isfinite(scaled).all():
        raise np.linalg.LinAlgError
    return scaled
