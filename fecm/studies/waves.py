"""Plane waves and wave fronts in an infinite laminate of any layup, report chapter 2.

Conventions: angles are in degrees, counter-clockwise from the x-axis, and give the direction of
propagation, the normal n of a wave front; t is n rotated by +90 degrees.  In-plane displacements
are u0 + z phi, so that kappa = grad(phi) and gamma = grad(w) + phi (equations 2-6 to 2-9).  The
components of the 5 x 5 problem are u_n, u_t, phi_n, phi_t, w; along n and t the inertia does not
depend on the direction.

Names: a mode is named by the component with the largest share of its kinetic energy.  A front has
one name for all normals, from its mean shares; a harmonic wave is in-plane or flexural by its
shares at its wavelength, and the faster of the two in-plane waves is the extension.  Each name is
used once: the assignment maximises the sum of the shares, and of equal sums it gives the faster
mode the earlier name.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from itertools import combinations, permutations

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg.lapack import dgejsv
from scipy.optimize import brentq

from fecm._frozen import frozen
from fecm._typing import Floats, Indices
from fecm.mechanics.laminate import Laminate
from fecm.studies import StudyError

BEYOND = "the laminate's constants are too large or too far apart to compute with"


@frozen
class Medium:
    """An infinite laminate; raises StudyError if stiffness or inertia is not positive definite."""

    laminate: Laminate  # stiffness, mass P and rotary inertia I
    # R of equation 2-24, the first moment of the density about the midplane (mass/length); zero if
    # all plies have the same density.
    coupling_inertia: float = 0.0

    def __post_init__(self) -> None:
        try:
            for matrix in (self.section, self.laminate.shear):
                np.linalg.cholesky(_correlation(matrix))
        except np.linalg.LinAlgError:
            raise StudyError("the laminate's stiffness is not positive definite") from None
        p, r, i = self.laminate.mass, self.coupling_inertia, self.laminate.rotary_inertia
        if not (p > 0.0 and i > 0.0 and abs(r) < (p * i) ** 0.5):
            raise StudyError("the laminate's inertia is not positive definite")

    @cached_property
    def section(self) -> Floats:
        """Stiffness [[A, B], [B, D]] of equation 2-20, (6, 6), without rounding errors of B."""
        laminate = self.laminate
        b = laminate.B if laminate.is_coupled else np.zeros((3, 3))
        return np.block([[laminate.A, b], [b.T, laminate.D]])

    @property
    def inertia(self) -> Floats:
        """Inertia of u_n, u_t, phi_n, phi_t, w, (5, 5): the right sides of 2-22 and 2-23."""
        p, r, i = self.laminate.mass, self.coupling_inertia, self.laminate.rotary_inertia
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


def best(scores: Floats) -> Indices:
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


# Harmonic plane waves: phase velocities and frequencies, section 2.2 ------------------------------

# Names of the modes; flexural modes in ascending order of velocity.
MODES = ("flexural_1", "flexural_2", "flexural_3", "extension", "in_plane_shear")


@frozen
class Dispersion:
    """Harmonic waves in one direction, modes in the order of :data:`MODES`."""

    angle: float  # direction of propagation, degrees
    wavelength: Floats  # over thickness, (n,)
    phase_velocity: Floats  # length/time, (n, 5)
    angular_frequency: Floats  # radian/time, (n, 5)


def dispersion(medium: Medium, angle: float, wavelengths: ArrayLike) -> Dispersion:
    """Phase velocities and frequencies of all five modes, equations 2-27 to 2-34.

    The angle is in degrees; the wavelengths, (n,), are over the thickness.  With B and R the
    determinants 2-29 and 2-30 become one of order 5.  All frequencies are accurate to about 12
    digits, even for long waves, where they differ by many orders of magnitude.  Raises StudyError
    if a wavelength is outside 1e-9 to 1e9, or the laminate's constants are out of range.
    """
    ratio = np.atleast_1d(np.asarray(wavelengths, dtype=np.float64))
    if not np.all((ratio >= 1e-9) & (ratio <= 1e9)):
        raise StudyError("wavelengths over thickness must lie between 1e-9 and 1e9")
    k = 2.0 * np.pi / (ratio * medium.laminate.thickness)
    with np.errstate(all="ignore"):  # overflow raises an error below
        stiffness, inertia, back = _problem(medium, angle, k)
        frequency, modes = graded_modes(stiffness, inertia)
        share = shares(medium.inertia, back @ modes)
    frequency = np.take_along_axis(frequency, _in_order(share), axis=1)
    return Dispersion(float(angle), ratio, frequency / k[:, None], frequency)


def _problem(medium: Medium, angle: float, k: Floats) -> tuple[Floats, Floats, Floats]:
    """Stiffness, inertia, and transformation to the components u_n ... w, each (n, 5, 5)."""
    # With w a quarter of a period ahead of the others all matrices are real: 2-32 without i.  In
    # long flexural waves phi_n nearly cancels k w; the variable phi_n + tau k w replaces phi_n to
    # avoid the cancellation.  In short waves tau vanishes.
    laminate = medium.laminate
    beyond = k**2 * laminate.rotary_inertia / laminate.mass  # rotary over translatory inertia
    tau = 1.0 / (1.0 + beyond)
    back = np.tile(np.eye(5), (len(k), 1, 1))
    back[:, 2, 4] = -tau * k
    strain = gradients([angle])[0][0]
    generalized = np.zeros((len(k), 8, 5))  # strains, curvatures and shear
    generalized[:, :3, :2] = k[:, None, None] * strain
    generalized[:, 3:6, 2:4] = k[:, None, None] * strain
    generalized[:, 3:6, 4] = (-tau * k**2)[:, None] * strain[:, 0]
    generalized[:, [6, 7], [2, 3]] = 1.0
    generalized[:, 6, 4] = beyond * tau * k  # (1 - tau) k
    constitutive = np.zeros((8, 8))
    constitutive[:6, :6] = medium.section
    constitutive[6:, 6:] = in_normal_axes(laminate.shear, [angle])[0]
    stiffness = generalized.transpose(0, 2, 1) @ constitutive @ generalized
    return stiffness, back.transpose(0, 2, 1) @ medium.inertia @ back, back


def graded_modes(stiffness: Floats, inertia: Floats) -> tuple[Floats, Floats]:
    """Frequencies and modes of K a = omega^2 M a with diagonals of very different magnitude.

    The matrices, (n, m, m), must be symmetric, positive definite, and well conditioned after
    scaling to a unit diagonal: then every frequency, not only the highest, is accurate to nearly
    all digits.  omega, (n, m), is descending; the modes are columns, (n, m, m), with unit
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
        raise StudyError(BEYOND) from None
    inverse = np.linalg.inv(mass).transpose(0, 2, 1)
    rise = of_k / of_m
    # The singular values of this product are the frequencies.  Apart from the column factor `rise`
    # it is well conditioned, because its ratios are at most 1.
    ratios = np.triu(rise[:, :, None] / rise[:, None])
    values, right = _singular_values(root.transpose(0, 2, 1) @ (inverse * ratios) * rise[:, None])
    return values, back @ ((inverse / of_m[:, :, None]) @ right)


def _singular_values(matrices: Floats) -> tuple[Floats, Floats]:
    """Singular values, descending, and right singular vectors as columns of matrices (n, m, m)."""
    if not np.isfinite(matrices).all():
        raise StudyError(BEYOND)
    values, vectors = np.empty(matrices.shape[:2]), np.empty(matrices.shape)
    for n, matrix in enumerate(matrices):
        # The Jacobi method keeps small singular values of column-scaled matrices accurate.
        scaled, _, vectors[n], scale, _, info = dgejsv(matrix, joba=0)
        if info:
            raise StudyError(BEYOND)
        values[n] = scaled * (scale[0] / scale[1])
    if not np.all(np.isfinite(values) & (values > 0.0)):
        raise StudyError(BEYOND)
    return values, vectors


_PAIRS = np.array(list(combinations(range(5), 2)))  # candidates for the two in-plane modes


def _in_order(share: Floats) -> Indices:
    """Indices of the modes, sorted by velocity, in the order of :data:`MODES`; (n, 5)."""
    in_plane = share[:, :, :2].sum(axis=2)
    pair = _PAIRS[best(in_plane[:, _PAIRS].sum(axis=2))]
    rest = [[mode for mode in (4, 3, 2, 1, 0) if mode not in taken] for taken in pair.tolist()]
    return np.concatenate([np.array(rest, dtype=np.intp), pair], axis=1)


# Sheets of the wave fronts: eigenvalues, derivatives, branch tracking -----------------------------

# The squares of the five normal velocities are the eigenvalues of M^-1 L(n).  As functions of the
# normal they form sheets; sheets that cross are identified by their modes.

EQUAL = 1e-10  # relative tolerance of equal squared velocities
# Squared scalar product above which one mode continues another; smallest step of the normal
# (degrees).
SURE, FINEST = 0.8, 1e-9

_ORDERS = np.array(list(permutations(range(5))))

# Names of the fronts, by their dominant component: u_n, u_t, phi_n, phi_t, w.
FRONTS = ("extension", "in_plane_shear", "bending", "twisting", "transverse_shear")


@frozen
class Fronts:
    """The five fronts for a series of normals, in the order of :data:`FRONTS`."""

    normal: Floats  # angles, (n,), degrees
    velocity: Floats  # normal velocity c_n, (n, 5), length/time
    slope: Floats  # its derivative with respect to the normal's angle (radian), (n, 5)
    curvature: Floats  # its second derivative, (n, 5)
    share: Floats  # of u_n, u_t, phi_n, phi_t, w (last axis) in the kinetic energy, (n, 5, 5)

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
        """Positions, (n, 5, 2), of fronts that start as a circle, equations 2-85 to 2-87.

        The report's radius of the circle (length) is the laminate's thickness.
        """
        start = radius * np.stack(trigonometry(self.normal), axis=-1)
        return np.asarray(start[:, None] + time * self.ray)

    def growth(self, time: float, radius: float) -> Floats:
        """Length of the front per radian of the normal, (n, 5); zero at a cusp, then negative."""
        return radius + time * (self.velocity + self.curvature)


@frozen
class Sheets(Fronts):
    """The five solutions for a series of normals, in descending order of velocity."""

    # Modes as columns, (n, 5, 5), orthonormal after scaling by the inertia's Cholesky factor.
    mode: Floats


def sheets(medium: Medium, normal: Floats) -> Sheets:
    """Solve L(n) a = c_n^2 M a, with derivatives by perturbation, for normals in degrees, (n,)."""
    with np.errstate(all="ignore"):
        root = np.linalg.inv(np.linalg.cholesky(medium.inertia))
        operators = [root @ matrix @ root.T for matrix in _stiffness(medium, normal)]
        if not np.isfinite(operators).all():
            raise StudyError(BEYOND)
        square, basis = _solved(*operators)
        first, second = (basis.transpose(0, 2, 1) @ matrix @ basis for matrix in operators[1:])
        gap = square[:, :, None] - square[:, None, :]
        apart = np.abs(gap) > EQUAL * square[:, :1, None]
        bend = 2.0 * np.where(apart, first**2 / np.where(apart, gap, 1.0), 0.0).sum(axis=2)
        bend += np.diagonal(second, axis1=1, axis2=2)
        velocity = np.sqrt(square)
        slope = np.diagonal(first, axis1=1, axis2=2) / (2.0 * velocity)
        curvature = (bend / 2.0 - slope**2) / velocity
        if not np.isfinite(curvature).all():
            raise StudyError(BEYOND)
    share = shares(medium.inertia, root.T @ basis)
    return Sheets(normal, velocity, slope, curvature, share, basis)


def match_modes(before: Floats, after: Floats) -> tuple[Indices, Floats]:
    """Match modes of neighbouring normals; the modes are columns, (n, 5, 5).

    Indices in `after` of the modes that continue those of `before`, (n, 5), and the smallest
    squared scalar product of such a pair, (n,), at most 1.
    """
    likeness = (before.transpose(0, 2, 1) @ after) ** 2
    pairs = likeness[:, np.arange(5), _ORDERS]
    place = best(pairs.sum(axis=2))
    return _ORDERS[place], pairs[np.arange(len(pairs)), place].min(axis=1)


def track_branch(medium: Medium, first: float, last: float) -> Indices:
    """Match the sheets of two close normals in degrees, (5,), bisecting the step as necessary.

    Sheets that approach each other without crossing exchange their modes within a small angle;
    sheets that cross keep them.
    """
    mode = sheets(medium, np.array([first, last])).mode
    (found,), (likeness,) = match_modes(mode[:1], mode[1:])
    if likeness <= SURE and last - first >= FINEST:
        middle = (first + last) / 2.0
        found = track_branch(medium, middle, last)[track_branch(medium, first, middle)]
    return np.asarray(found)


def _stiffness(medium: Medium, normal: Floats) -> Floats:
    """L(n) and its first and second derivative with respect to the angle, (3, n, 5, 5)."""
    both = np.zeros((3, len(normal), 6, 4))
    for matrix, part in zip(both, gradients(normal), strict=True):
        matrix[:, :3, :2] = matrix[:, 3:, 2:] = part
    strain, first, second = both

    def product(a: Floats, b: Floats) -> Floats:
        half = a.transpose(0, 2, 1) @ medium.section @ b
        return (half + half.transpose(0, 2, 1)) / 2.0

    shear = in_normal_axes(medium.laminate.shear, normal)
    nn, nt, tt = shear[:, 0, 0], shear[:, 0, 1], shear[:, 1, 1]
    found = np.zeros((3, len(normal), 5, 5))
    found[0, :, :4, :4] = product(strain, strain)
    found[1, :, :4, :4] = 2.0 * product(strain, first)
    found[2, :, :4, :4] = 2.0 * product(strain, second) + 2.0 * product(first, first)
    found[:, :, 4, 4] = nn, 2.0 * nt, 2.0 * (tt - nn)
    return found


def _solved(operator: Floats, first: Floats, second: Floats) -> tuple[Floats, Floats]:
    """Eigenvalues, descending, and eigenvectors; those of equal eigenvalues follow the sheets."""
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
            basis[row] = _kept_apart(square[row], basis[row], part[1:, row], limit[row])
        values[:, block], vectors[:, block, block] = square, basis
    order = np.argsort(-values, axis=1, kind="stable")
    values = np.take_along_axis(values, order, axis=1)
    return values, np.take_along_axis(vectors, order[:, None], axis=2)


def _kept_apart(values: Floats, vectors: Floats, derivatives: Floats, limit: float) -> Floats:
    """Eigenvectors that are continuous in the normal where sheets meet."""
    # Among equal eigenvalues they diagonalise the first, then the second derivative of the
    # operator; for identical sheets they separate the components.
    parts: list[Floats] = []
    first, second = derivatives
    for group in _runs(values, limit):
        basis = vectors[:, group]
        others = np.delete(vectors, group, axis=1)
        slopes = first @ others
        gaps = values[group[0]] - np.delete(values, group)
        bends = second + 2.0 * (slopes / gaps) @ slopes.T
        components = np.diag(np.linspace(1.0, 0.0, len(values))) * values[-1]
        parts += _split(basis, [first, bends, components], 1e3 * limit)
    return np.concatenate(parts, axis=1)


def _runs(values: Floats, limit: float) -> list[Indices]:
    """Indices of runs of sorted values that are equal up to `limit`."""
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


# Wave fronts: normal velocities, rays, positions and cusps, section 2.3 ---------------------------

# Across a front only the highest derivatives are discontinuous, so that k drops out of the 5 x 5
# problem: L(n) a = c_n^2 M a couples A, B, D with P, R, I, and transverse shear is independent
# (equations 2-60 to 2-65).  Rays follow from c_n and its derivatives with respect to the normal's
# angle, computed by perturbation of the eigenvalue problem: with the slowness p = n/c_n, equation
# 2-84 is the ray velocity V = c_n n + c_n' t, and V' = (c_n + c_n'') t.

STEPS = 10  # steps per degree for tracking sheets and searching cusps


@frozen
class Cusp:
    """A cusp of a front."""

    mode: str  # one of :data:`FRONTS`
    normal: float  # angle of the front's normal at the cusp, degrees
    x: float
    y: float


class WaveSurfaces:
    """The five fronts of a laminate, tracked over all normals.

    Fronts that cross keep their names, as do fronts that approach each other without crossing.
    Raises StudyError if the velocities are out of the floating-point range.
    """

    def __init__(self, medium: Medium) -> None:
        self.medium = medium
        around = sheets(medium, np.arange(360 * STEPS + 1) / STEPS)
        self._mode = around.mode
        step, likeness = match_modes(self._mode[:-1], self._mode[1:])
        # Steps whose end points do not identify the sheets.
        self._close = likeness <= SURE
        for row in np.flatnonzero(self._close).tolist():
            step[row] = track_branch(medium, row / STEPS, (row + 1) / STEPS)
        self._close &= (step == np.arange(5)).all(axis=1)
        # Indices of the sheets that continue each sheet of the normal 0.
        place = np.empty((360 * STEPS + 1, 5), dtype=np.intp)
        place[0] = np.arange(5)
        for row, following in enumerate(step):
            place[row + 1] = following[place[row]]
        mean = np.take_along_axis(around.velocity, place, axis=1).mean(axis=0)
        place = place[:, np.argsort(-mean, kind="stable")]
        share = np.take_along_axis(around.share, place[:, :, None], axis=1).mean(axis=0)
        # To each name the mode that makes the sum of the shares largest.
        scores = share[_ORDERS, np.arange(5)].sum(axis=1)
        self._place = place[:, _ORDERS[best(scores[None])[0]]]

    def fronts(self, normals: ArrayLike) -> Fronts:
        """The five fronts at normals, (n,), in degrees."""
        found = sheets(self.medium, np.atleast_1d(np.asarray(normals, dtype=np.float64)))
        turn = np.mod(found.normal, 360.0) * STEPS
        near = np.round(turn).astype(np.intp)
        alike, _ = match_modes(self._mode[near], found.mode)
        place = np.take_along_axis(alike, self._place[near], axis=1)
        # In close steps the velocities identify the sheets, not the modes.
        step = np.minimum(turn.astype(np.intp), 360 * STEPS - 1)
        place = np.where(self._close[step, None], self._place[step], place)
        rows = np.arange(len(place))[:, None]
        return Fronts(
            found.normal, found.velocity[rows, place], found.slope[rows, place],
            found.curvature[rows, place], found.share[rows, place],
        )  # fmt: skip

    def cusps(self, time: float, radius: float) -> list[Cusp]:
        """Cusps of the fronts that start as a circle, by mode, then by the normal's angle.

        A front turns back where its length per radian of the normal, radius + time (c_n + c_n''),
        changes sign.  The search step is a tenth of a degree, a thousandth where fronts are close.
        """
        inside = (np.flatnonzero(self._close)[:, None] + np.arange(100) / 100.0).ravel()
        normals = np.union1d(np.arange(360 * STEPS + 1) - 0.5, inside) / STEPS
        growth = self.fronts(normals).growth(time, radius)
        passes = (growth[:-1] > 0.0) != (growth[1:] > 0.0)
        found = []
        for mode, row in np.argwhere(passes.T).tolist():

            def at(normal: float, mode: int = mode) -> float:
                return float(self.fronts(normal).growth(time, radius)[0, mode])

            normal = float(brentq(at, normals[row], normals[row + 1], xtol=1e-11))
            fronts = self.fronts(normal)
            # Where fronts touch, the sign may change by a jump instead of a zero.
            if abs(at(normal)) < 1e-5 * (radius + time * fronts.velocity[0, mode]):
                x, y = fronts.positions(time, radius)[0, mode].tolist()
                found.append(Cusp(FRONTS[mode], normal % 360.0, x, y))
        return sorted(found, key=lambda cusp: (FRONTS.index(cusp.mode), cusp.normal))

    def misnamed(self) -> dict[str, list[tuple[float, float]]]:
        """Intervals of the normal (degrees), by front, where another component dominates."""
        normals = np.arange(360 * STEPS + 1) / STEPS
        share = self.fronts(normals).share
        runs: dict[str, list[tuple[float, float]]] = {}
        for place, name in enumerate(FRONTS):
            other = share[:, place].max(axis=1) > share[:, place, place] + 1e-6
            edges = np.flatnonzero(np.diff([False, *other.tolist(), False], n=1)).reshape(-1, 2)
            if len(edges):
                runs[name] = [(float(normals[a]), float(normals[b - 1])) for a, b in edges]
        return runs
