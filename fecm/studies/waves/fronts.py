"""Wave fronts: normal velocities, rays, positions and cusps, section 2.3.

Across a front only the highest derivatives are discontinuous, so that k drops out of the 5 x 5
problem: L(n) a = c_n^2 M a couples A, B, D with P, R, I, and transverse shear is independent
(equations 2-60 to 2-65). The squares of the five normal velocities are the eigenvalues of
M^-1 L(n). As functions of the normal they form sheets; sheets that cross are identified by their
modes.

Rays follow from c_n and its derivatives with respect to the normal's angle, computed by
perturbation of the eigenvalue problem. With the slowness p = n/c_n, equation 2-84 is the ray
velocity V = c_n n + c_n' t, and V' = (c_n + c_n'') t.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from fecm._errors import StudyError
from fecm._typing import Floats, Indices
from fecm.studies.waves.harmonic import (
    OUT_OF_RANGE,
    Medium,
    first_largest,
    gradients,
    in_normal_axes,
    shares,
    trigonometry,
)

EQUAL = 1e-10  # relative tolerance of equal squared velocities
SURE = 0.8  # squared scalar product above which one mode continues another
FINEST = 1e-9  # smallest step of the normal (degrees)

ORDERS = np.array(list(permutations(range(5))))  # orders in which five modes may continue five

# Names of the fronts, by their dominant component: u_n, u_t, phi_n, phi_t, w.
FRONTS = ("extension", "in_plane_shear", "bending", "twisting", "transverse_shear")


@dataclass(frozen=True, eq=False)
class Fronts:
    """The five fronts for a series of normals.

    Attributes
    ----------
    modes : tuple of str
        Names of the fronts, in the order of the columns.
    normal : ndarray (n,)
        Angles of the normals, degrees.
    velocity : ndarray (n, 5)
        Normal velocity c_n, length/time.
    slope, curvature : ndarray (n, 5)
        First and second derivative of `velocity` with respect to the normal's angle (radian).
    share : ndarray (n, 5, 5)
        Share of u_n, u_t, phi_n, phi_t, w (last axis) in the kinetic energy.
    """

    modes: ClassVar[tuple[str, ...]] = FRONTS
    normal: Floats
    velocity: Floats
    slope: Floats
    curvature: Floats
    share: Floats

    @property
    def ray(self) -> Floats:
        """Ray velocity of equation 2-84, (n, 5, 2): x and y, length/time."""
        cos, sin = (part[:, None] for part in trigonometry(self.normal))
        c, s = self.velocity, self.slope
        return np.stack([c * cos - s * sin, c * sin + s * cos], axis=-1)

    @property
    def ray_angle(self) -> Floats:
        """Direction of the rays, (n, 5), degrees in (-180, 180]."""
        ray = self.ray
        angle = np.rad2deg(np.arctan2(ray[..., 1], ray[..., 0]))
        return np.asarray(np.where(angle <= -180.0 + 1e-9, angle + 360.0, angle))

    def positions(self, time: float, radius: float) -> Floats:
        """Return the positions, (n, 5, 2), of fronts that start as a circle.

        Equations 2-85 to 2-87. The report's radius of the circle (length) is the laminate's
        thickness.
        """
        start = radius * np.stack(trigonometry(self.normal), axis=-1)
        return np.asarray(start[:, None] + time * self.ray)

    def growth(self, time: float, radius: float) -> Floats:
        """Return the length of the front per radian of the normal, (n, 5).

        It is zero at a cusp, then negative.
        """
        return radius + time * (self.velocity + self.curvature)

    def strength(self, first: float, time: float, radius: float) -> Floats:
        """Return the strength of the front over its strength at the time `first`, (n, 5).

        Along a ray, the strength decays with the spreading of the rays (section 2.3.4): it is the
        root of the ratio of the lengths per radian. It is NaN at a cusp, where this length is 0.
        """
        before, now = (np.abs(self.growth(t, radius)) for t in (first, time))
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.sqrt(before / now)
        return np.where(now > 0.0, ratio, np.nan)


@dataclass(frozen=True)
class Sheets(Fronts):
    """Five solutions for a series of normals, in descending order of velocity."""

    # Modes as columns, (n, 5, 5), orthonormal after scaling by the inertia's Cholesky factor.
    mode: Floats


def sheets(medium: Medium, normal: Floats) -> Sheets:
    """Solve L(n) a = c_n^2 M a, with derivatives by perturbation, for normals in degrees, (n,)."""
    with np.errstate(all="ignore"):
        root = np.linalg.inv(np.linalg.cholesky(medium.inertia))
        operators = [root @ matrix @ root.T for matrix in _stiffness(medium, normal)]
        if not np.isfinite(operators).all():
            raise StudyError(OUT_OF_RANGE)
        square, basis = _solve_sheets(*operators)
        first, second = (basis.transpose(0, 2, 1) @ matrix @ basis for matrix in operators[1:])
        gap = square[:, :, None] - square[:, None, :]
        apart = np.abs(gap) > EQUAL * square[:, :1, None]
        bend = 2.0 * np.where(apart, first**2 / np.where(apart, gap, 1.0), 0.0).sum(axis=2)
        bend += np.diagonal(second, axis1=1, axis2=2)
        velocity = np.sqrt(square)
        slope = np.diagonal(first, axis1=1, axis2=2) / (2.0 * velocity)
        curvature = (bend / 2.0 - slope**2) / velocity
        if not np.isfinite(curvature).all():
            raise StudyError(OUT_OF_RANGE)
    share = shares(medium.inertia, root.T @ basis)
    return Sheets(normal, velocity, slope, curvature, share, basis)


def match_modes(before: Floats, after: Floats) -> tuple[Indices, Floats]:
    """Match modes of neighbouring normals; the modes are columns, (n, 5, 5).

    Returns the indices in `after` of the modes that continue the modes of `before`, (n, 5), and the
    smallest squared scalar product of a pair, (n,), at most 1.
    """
    likeness = (before.transpose(0, 2, 1) @ after) ** 2
    pairs = likeness[:, np.arange(5), ORDERS]
    place = first_largest(pairs.sum(axis=2))
    return ORDERS[place], pairs[np.arange(len(pairs)), place].min(axis=1)


def track_branch(medium: Medium, first: float, last: float) -> Indices:
    """Match the sheets of two close normals in degrees, (5,), bisecting the step as necessary.

    Sheets that approach each other without crossing exchange their modes within a small angle;
    sheets that cross keep them.
    """
    mode = sheets(medium, np.array([first, last])).mode
    (order,), (likeness,) = match_modes(mode[:1], mode[1:])
    if likeness <= SURE and last - first >= FINEST:
        middle = (first + last) / 2.0
        order = track_branch(medium, middle, last)[track_branch(medium, first, middle)]
    return np.asarray(order)


def _stiffness(medium: Medium, normal: Floats) -> Floats:
    """Return L(n) and its first and second derivatives by the angle, (3, n, 5, 5)."""
    gradients_of_both = np.zeros((3, len(normal), 6, 4))
    for matrix, part in zip(gradients_of_both, gradients(normal), strict=True):
        matrix[:, :3, :2] = matrix[:, 3:, 2:] = part
    strain, first, second = gradients_of_both

    def product(a: Floats, b: Floats) -> Floats:
        half = a.transpose(0, 2, 1) @ medium.section @ b
        return (half + half.transpose(0, 2, 1)) / 2.0

    shear = in_normal_axes(medium.laminate.shear, normal)
    nn, nt, tt = shear[:, 0, 0], shear[:, 0, 1], shear[:, 1, 1]
    stiffness = np.zeros((3, len(normal), 5, 5))
    stiffness[0, :, :4, :4] = product(strain, strain)
    stiffness[1, :, :4, :4] = 2.0 * product(strain, first)
    stiffness[2, :, :4, :4] = 2.0 * product(strain, second) + 2.0 * product(first, first)
    stiffness[:, :, 4, 4] = nn, 2.0 * nt, 2.0 * (tt - nn)
    return stiffness


def _solve_sheets(operator: Floats, first: Floats, second: Floats) -> tuple[Floats, Floats]:
    """Return descending eigenvalues and eigenvectors; equal eigenvalues follow the sheets."""
    # Uncoupled in-plane and flexural components are solved separately.
    coupled = operator[:, :2, 2:4].any()
    values = np.empty(operator.shape[:2])
    vectors = np.zeros(operator.shape)
    for block in (slice(0, 4), slice(4, 5)) if coupled else (slice(0, 2), slice(2, 4), slice(4, 5)):
        part = np.stack([operator, first, second])[..., block, block]
        square, basis = np.linalg.eigh(part[0])
        limit = EQUAL * np.abs(square).max(axis=1)
        meeting = (np.diff(square, axis=1) < limit[:, None]).any(axis=1)
        for row in np.flatnonzero(meeting).tolist():
            basis[row] = _separate_sheets(square[row], basis[row], part[1:, row], limit[row])
        values[:, block], vectors[:, block, block] = square, basis
    order = np.argsort(-values, axis=1, kind="stable")
    values = np.take_along_axis(values, order, axis=1)
    return values, np.take_along_axis(vectors, order[:, None], axis=2)


def _separate_sheets(values: Floats, vectors: Floats, derivatives: Floats, limit: float) -> Floats:
    """Return eigenvectors that are continuous in the normal where sheets meet."""
    # Among equal eigenvalues they diagonalise the first, then the second derivative of the
    # operator. For identical sheets they separate the components.
    parts: list[Floats] = []
    first, second = derivatives
    for group in _runs(values, limit):
        basis = vectors[:, group]
        other_vectors = np.delete(vectors, group, axis=1)
        slopes = first @ other_vectors
        gaps = values[group[0]] - np.delete(values, group)
        bends = second + 2.0 * (slopes / gaps) @ slopes.T
        components = np.diag(np.linspace(1.0, 0.0, len(values))) * values[-1]
        parts += _split(basis, [first, bends, components], 1e3 * limit)
    return np.concatenate(parts, axis=1)


def _runs(values: Floats, limit: float) -> list[Indices]:
    """Return the indices of runs of sorted values that are equal up to `limit`."""
    steps = np.flatnonzero(np.abs(np.diff(values)) >= limit) + 1
    return np.split(np.arange(len(values)), steps)


def _split(basis: Floats, operators: Sequence[Floats], limit: float) -> list[Floats]:
    """Split a subspace into eigenspaces of the operators, one after another."""
    if basis.shape[1] == 1 or not operators:
        return [basis]
    values, vectors = np.linalg.eigh(basis.T @ operators[0] @ basis)
    parts: list[Floats] = []
    for run in _runs(values, limit):
        parts += _split(basis @ vectors[:, run], operators[1:], limit)
    return parts


STEPS = 10  # per degree, for tracking sheets and searching cusps
AROUND = 360 * STEPS  # steps over all normals


@dataclass(frozen=True)
class Cusp:
    """Cusp of a front.

    Attributes
    ----------
    mode : str
        Name of the front.
    normal : float
        Angle of the front's normal at the cusp, degrees.
    x, y : float
        Place of the cusp, length.
    """

    mode: str
    normal: float
    x: float
    y: float


class WaveSurfaces:
    """The five fronts of a laminate, tracked over all normals.

    Fronts that cross keep their names, as do fronts that approach each other without crossing.
    Raises StudyError if the velocities are out of the floating-point range.
    """

    def __init__(self, medium: Medium) -> None:
        self.medium = medium
        around = sheets(medium, np.arange(AROUND + 1) / STEPS)
        self._mode = around.mode
        step, likeness = match_modes(self._mode[:-1], self._mode[1:])
        # Steps whose end points do not identify the sheets.
        self._close = likeness <= SURE
        for row in np.flatnonzero(self._close).tolist():
            step[row] = track_branch(medium, row / STEPS, (row + 1) / STEPS)
        self._close &= (step == np.arange(5)).all(axis=1)
        # Indices of the sheets that continue each sheet from the normal 0.
        place = np.empty((AROUND + 1, 5), dtype=np.intp)
        place[0] = np.arange(5)
        for row, following in enumerate(step):
            place[row + 1] = following[place[row]]
        mean = np.take_along_axis(around.velocity, place, axis=1).mean(axis=0)
        place = place[:, np.argsort(-mean, kind="stable")]
        share = np.take_along_axis(around.share, place[:, :, None], axis=1).mean(axis=0)
        # The assignment of names maximises the sum of the shares.
        scores = share[ORDERS, np.arange(5)].sum(axis=1)
        self._place = place[:, ORDERS[first_largest(scores[None])[0]]]

    def fronts(self, normals: ArrayLike) -> Fronts:
        """Return the five fronts at normals, (n,), in degrees."""
        solved = sheets(self.medium, np.atleast_1d(np.asarray(normals, dtype=np.float64)))
        turn = np.mod(solved.normal, 360.0) * STEPS
        near = np.round(turn).astype(np.intp)
        alike, _ = match_modes(self._mode[near], solved.mode)
        place = np.take_along_axis(alike, self._place[near], axis=1)
        # In close steps the velocities identify the sheets, not the modes.
        step = np.minimum(turn.astype(np.intp), AROUND - 1)
        place = np.where(self._close[step, None], self._place[step], place)
        rows = np.arange(len(place))[:, None]
        return Fronts(
            normal=solved.normal,
            velocity=solved.velocity[rows, place],
            slope=solved.slope[rows, place],
            curvature=solved.curvature[rows, place],
            share=solved.share[rows, place],
        )

    def cusps(self, time: float, radius: float) -> list[Cusp]:
        """Return the cusps of the fronts that start as a circle.

        They are sorted by mode, then by the normal's angle. A front turns back where its length per
        radian of the normal, radius + time (c_n + c_n''), changes sign. The search step is a tenth
        of a degree, a thousandth where fronts are close.
        """
        inside = (np.flatnonzero(self._close)[:, None] + np.arange(100) / 100.0).ravel()
        normals = np.union1d(np.arange(AROUND + 1) - 0.5, inside) / STEPS
        growth = self.fronts(normals).growth(time, radius)
        passes = (growth[:-1] > 0.0) != (growth[1:] > 0.0)
        turning_points = []
        for mode, row in np.argwhere(passes.T).tolist():

            def growth_at(normal: float, mode: int = mode) -> float:
                return float(self.fronts(normal).growth(time, radius)[0, mode])

            normal = float(brentq(growth_at, normals[row], normals[row + 1], xtol=1e-11))
            fronts = self.fronts(normal)
            # Where fronts touch, the sign may change by a jump instead of a zero.
            if abs(growth_at(normal)) < 1e-5 * (radius + time * fronts.velocity[0, mode]):
                x, y = fronts.positions(time, radius)[0, mode].tolist()
                turning_points.append(Cusp(FRONTS[mode], normal % 360.0, x, y))
        return sorted(turning_points, key=lambda cusp: (FRONTS.index(cusp.mode), cusp.normal))

    def misnamed(self) -> dict[str, list[tuple[float, float]]]:
        """Return the intervals of the normal (degrees) where another component dominates.

        They are listed by front.
        """
        normals = np.arange(AROUND + 1) / STEPS
        share = self.fronts(normals).share
        runs: dict[str, list[tuple[float, float]]] = {}
        for place, name in enumerate(FRONTS):
            is_misnamed = share[:, place].max(axis=1) > share[:, place, place] + 1e-6
            edges = np.flatnonzero(np.diff([False, *is_misnamed.tolist(), False], n=1)).reshape(
                -1, 2
            )
            if len(edges):
                runs[name] = [(float(normals[a]), float(normals[b - 1])) for a, b in edges]
        return runs
