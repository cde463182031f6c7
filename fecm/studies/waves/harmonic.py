"""Infinite laminate, and velocities and frequencies of harmonic plane waves, section 2.2."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg.lapack import dgejsv

from fecm._errors import StudyError
from fecm._typing import Floats, Indices
from fecm.mechanics.laminate import LaminateSection

OUT_OF_RANGE = "the laminate's constants are too large or too far apart to compute with"


@dataclass(frozen=True)
class Medium:
    """Infinite laminate.

    Raises StudyError if stiffness or inertia is not positive definite.
    """

    # Stiffness, mass P, rotary inertia I, and R, the first moment of density about the midplane.
    laminate: LaminateSection

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
    """Return cosine and sine, (n,) each, exact at multiples of 90 degrees."""
    angle = np.atleast_1d(np.asarray(degrees, dtype=np.float64))
    quarter = np.round(angle / 90.0)
    rest = np.deg2rad(angle - 90.0 * quarter)
    cos, sin = np.cos(rest), np.sin(rest)
    turn = np.mod(quarter, 4.0).astype(int)
    along, across = [cos, -sin, -cos, sin], [sin, cos, -sin, -cos]
    return np.choose(turn, along) + 0.0, np.choose(turn, across) + 0.0


def gradients(degrees: ArrayLike) -> tuple[Floats, Floats, Floats]:
    """Return the strains xx, yy, xy of unit gradients along n of u_n and u_t, (n, 3, 2).

    Their first and second derivatives by the angle (radian) follow.
    """
    cos, sin = trigonometry(degrees)
    cos_2, sin_2 = cos**2 - sin**2, 2.0 * sin * cos  # cosine and sine of twice the angle
    normal = np.stack([cos**2, sin**2, sin_2], axis=-1)
    tangential = np.stack([-sin_2 / 2.0, sin_2 / 2.0, cos_2], axis=-1)
    slope = np.stack([-cos_2, cos_2, -2.0 * sin_2], axis=-1)
    return (
        np.stack([normal, tangential], axis=-1),
        np.stack([2.0 * tangential, slope], axis=-1),
        np.stack([2.0 * slope, -4.0 * tangential], axis=-1),
    )


def in_normal_axes(tensor: Floats, degrees: ArrayLike) -> Floats:
    """Return nn, nt; tn, tt, (n, 2, 2), of a symmetric tensor with xx, xy; yx, yy."""
    cos, sin = trigonometry(degrees)
    axes = np.stack([np.stack([cos, -sin], axis=-1), np.stack([sin, cos], axis=-1)], axis=1)
    return np.asarray(axes.transpose(0, 2, 1) @ tensor @ axes)


def shares(inertia: Floats, vectors: Floats) -> Floats:
    """Return the share of each component in the energy of modes, (..., modes, 5).

    The modes are the columns of `vectors`.
    """
    energy = vectors * (inertia @ vectors)
    return np.asarray(np.swapaxes(energy / energy.sum(axis=-2, keepdims=True), -1, -2))


def first_largest(scores: Floats) -> Indices:
    """Return the index of the largest score in every row; the first if scores are equal."""
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


# Names of the modes; flexural modes in ascending order of velocity.
MODES = ("flexural_1", "flexural_2", "flexural_3", "extension", "in_plane_shear")

_PAIRS = np.array(list(combinations(range(5), 2)))  # candidates for the two in-plane modes


@dataclass(frozen=True, eq=False)
class Dispersion:
    """Harmonic waves in one direction.

    Attributes
    ----------
    modes : tuple of str
        Names of the modes, in the order of the columns.
    angle : float
        Direction of propagation, degrees.
    wavelength : ndarray (n,)
        Wavelengths over the thickness.
    phase_velocity : ndarray (n, modes)
        Phase velocities, length/time.
    angular_frequency : ndarray (n, modes)
        Angular frequencies, radian/time.
    """

    modes: ClassVar[tuple[str, ...]] = MODES
    angle: float
    wavelength: Floats
    phase_velocity: Floats
    angular_frequency: Floats


def dispersion(medium: Medium, angle: float, wavelengths: ArrayLike) -> Dispersion:
    """Return phase velocities and frequencies of all five modes, equations 2-27 to 2-34.

    The angle is in degrees; the wavelengths, (n,), are over the thickness. With B and R the
    determinants 2-29 and 2-30 become one of order 5. All frequencies are accurate to about 12
    digits, even for long waves, where they differ by many orders of magnitude. Raises StudyError if
    a wavelength is outside 1e-9 to 1e9, or the laminate's constants are out of range.
    """
    ratio = np.atleast_1d(np.asarray(wavelengths, dtype=np.float64))
    if not np.all((ratio >= 1e-9) & (ratio <= 1e9)):
        raise StudyError("wavelengths over thickness must lie between 1e-9 and 1e9")
    k = 2.0 * np.pi / (ratio * medium.laminate.thickness)
    with np.errstate(all="ignore"):  # overflow raises an error below
        stiffness, inertia, back = _wave_problem(medium, angle, k)
        frequency, modes = graded_modes(stiffness, inertia)
        share = shares(medium.inertia, back @ modes)
    frequency = np.take_along_axis(frequency, _order_of_modes(share), axis=1)
    return Dispersion(float(angle), ratio, frequency / k[:, None], frequency)


def _wave_problem(medium: Medium, angle: float, k: Floats) -> tuple[Floats, Floats, Floats]:
    """Return stiffness, inertia, and transformation to u_n ... w, each (n, 5, 5)."""
    # With w a quarter of a period ahead of the other components, all matrices are real (2-32
    # without i). In long flexural waves phi_n nearly cancels k w, so that phi_n + tau k w replaces
    # phi_n. In short waves tau vanishes.
    laminate = medium.laminate
    inertia_ratio = (
        k**2 * laminate.rotary_inertia / laminate.mass
    )  # rotary over translatory inertia
    tau = 1.0 / (1.0 + inertia_ratio)
    back = np.tile(np.eye(5), (len(k), 1, 1))
    back[:, 2, 4] = -tau * k
    strain = gradients([angle])[0][0]
    generalized = np.zeros((len(k), 8, 5))  # strains, curvatures and shear
    generalized[:, :3, :2] = k[:, None, None] * strain
    generalized[:, 3:6, 2:4] = k[:, None, None] * strain
    generalized[:, 3:6, 4] = (-tau * k**2)[:, None] * strain[:, 0]
    generalized[:, [6, 7], [2, 3]] = 1.0
    generalized[:, 6, 4] = inertia_ratio * tau * k  # (1 - tau) k
    constitutive = np.zeros((8, 8))
    constitutive[:6, :6] = medium.section
    constitutive[6:, 6:] = in_normal_axes(laminate.shear, [angle])[0]
    stiffness = generalized.transpose(0, 2, 1) @ constitutive @ generalized
    return stiffness, back.transpose(0, 2, 1) @ medium.inertia @ back, back


def graded_modes(stiffness: Floats, inertia: Floats) -> tuple[Floats, Floats]:
    """Solve K a = omega^2 M a with diagonals of very different magnitude.

    The matrices, (n, m, m), must be symmetric, positive definite, and well conditioned after
    scaling to a unit diagonal. Then every frequency, not only the highest, is accurate to nearly
    all digits. omega, (n, m), is descending; the modes are columns, (n, m, m), with unit
    generalized mass.
    """
    of_k, of_m = (np.sqrt(np.diagonal(matrix, axis1=1, axis2=2)) for matrix in (stiffness, inertia))
    order = np.argsort(of_k / of_m, axis=1)
    of_k, of_m = (np.take_along_axis(scale, order, axis=1) for scale in (of_k, of_m))
    turn = np.eye(order.shape[1])[order]  # permutation, by rows
    back = turn.transpose(0, 2, 1)
    try:
        root, mass = (
            np.linalg.cholesky(turn @ matrix @ back / (scale[:, :, None] * scale[:, None]))
            for matrix, scale in ((stiffness, of_k), (inertia, of_m))
        )
    except np.linalg.LinAlgError:
        raise StudyError(OUT_OF_RANGE) from None
    inverse = np.linalg.inv(mass).transpose(0, 2, 1)
    rise = of_k / of_m
    # The singular values of this product are the frequencies.  Apart from the column factor `rise`
    # it is well conditioned, because its ratios are at most 1.
    ratios = np.triu(rise[:, :, None] / rise[:, None])
    values, right = _singular_values(root.transpose(0, 2, 1) @ (inverse * ratios) * rise[:, None])
    return values, back @ ((inverse / of_m[:, :, None]) @ right)


def _singular_values(matrices: Floats) -> tuple[Floats, Floats]:
    """Return descending singular values, and right singular vectors as columns, (n, m, m)."""
    if not np.isfinite(matrices).all():
        raise StudyError(OUT_OF_RANGE)
    values, vectors = np.empty(matrices.shape[:2]), np.empty(matrices.shape)
    for n, matrix in enumerate(matrices):
        # The Jacobi method keeps small singular values of column-scaled matrices accurate.
        scaled, _, vectors[n], scale, _, info = dgejsv(matrix, joba=0)
        if info:
            raise StudyError(OUT_OF_RANGE)
        values[n] = scaled * (scale[0] / scale[1])
    if not np.all(np.isfinite(values) & (values > 0.0)):
        raise StudyError(OUT_OF_RANGE)
    return values, vectors


def _order_of_modes(share: Floats) -> Indices:
    """Return the indices of the modes in the order of :data:`MODES`, (n, 5).

    Flexural modes are sorted by velocity, and so are in-plane modes.
    """
    in_plane = share[:, :, :2].sum(axis=2)
    pair = _PAIRS[first_largest(in_plane[:, _PAIRS].sum(axis=2))]
    rest = [[mode for mode in (4, 3, 2, 1, 0) if mode not in in_pair] for in_pair in pair.tolist()]
    return np.concatenate([np.array(rest, dtype=np.intp), pair], axis=1)
