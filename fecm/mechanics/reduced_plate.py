"""A nonlinear plate in a few modes, and its motion under the contact forces of many impacts.

A nonlinear plate in a few modes, for many impacts at one place.

The deflection is a sum of bending modes q_i phi_i of the plate at rest.  The displacements u and v
in the plane follow from s_ij = q_i q_j (A. A. Muravyov and S. A. Rizzi, Computers & Structures 81,
2003, 1513), here by the element matrices and not by a fit:

    u, v = U q + sum over i <= j of u_ij s_ij,    K_mm U = -K_mb phi,    K_mm u_ij = -r_ij,
    r_ij = int B_m' A eps_q(i, j),

where eps_q(i, j) is the part of the quadratic strains (:mod:`~fecm.mechanics.membrane`) that
belongs to s_ij.  The strain energy is

    1/2 sum omega_i^2 q_i^2 + q' C s + 1/2 s' Q s,    Q = int eps_ij A eps_kl,
    C_i,kl = int N_i eps_q(k, l),    eps_ij = eps_q(i, j) + B_m u_ij,

with the membrane force N_i = A (B_m U_i + w_i/R) + B kappa_i of a bending mode; U and C are zero
unless the laminate or a curvature couples bending and stretching.

A static membrane has no inertia.  That matters where the edges are free in the plane: the lowest
membrane modes psi_k are then hardly faster than the bending modes.  The few that the quadratic
strains of the static deflection excite most are therefore coordinates as well.  With q_k of such a
mode, C has the row psi_k' r, and Q the term sum over k of (psi_k' r)' (psi_k' r)/Omega_k^2 more,
which is what their static displacement had taken away.

The modes left out follow the contact force F statically, by what they add to the displacement under
the load:

    W = sum g_i q_i + F/k_r,    1/k_r = 1/k_b - sum g_i^2/omega_i^2,

with the displacement g_i of a mode under the load and the static stiffness k_b of the linear plate
there.  Each mode adds g_i^2/omega_i^2 to the static compliance: those that add most are kept.

Motion of a reduced plate under the contact forces of many impacts, all cases together.

Each coordinate q of frequency omega moves by

    q_(n+1) - 2 q_n + q_(n-1) = dt^2 psi (g F - dU/dq - a v),   psi = (sin(x)/x)^2,  x = omega dt/2,

with the central difference v of the velocity.  Without psi these are the central differences of a
full run.  With it free vibrations and constant forces are exact (W. Gautschi, Numerische Mathematik
3, 1961, 381): only contact force and membrane limit the step.  Of a vibration the central
difference is sin(omega dt)/(omega dt) times the velocity.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from fecm._errors import FecmError
from fecm._machine import require_memory
from fecm._typing import Floats, Indices
from fecm.mechanics.contact_law import ContactPoint, Law
from fecm.mechanics.element_matrices import membrane_and_bending
from fecm.mechanics.interpolation import NDOF, interpolate
from fecm.mechanics.membrane import BLOCK, TYING, QuadraticStrains
from fecm.mechanics.mesh import ElementBlock
from fecm.mechanics.plate import PlateModel
from fecm.mechanics.solutions import SingularStiffnessError, Tangent, rigid_in_plane
from fecm.mechanics.symmetry import with_codes

# Residual of a mode relative to its eigenvalue; the error of the frequency is its square.
CONVERGED = 1e-6
# Vectors of the Krylov space per mode that is wanted, and in addition.
VECTORS_PER_MODE, MORE_VECTORS = 12, 60
# Steps between two solutions of the eigenvalue problem in the Krylov space.
LOOK = 20
# Relative difference of the squares of frequencies that are equal.
EQUAL = 1e-8
# Size of a new vector relative to the last below which the Krylov space is complete.
EXHAUSTED = 1e-12
# Share of a mode in the static compliance below which the load does not move it.
UNMOVED = 1e-10
# Most membrane modes, their least share in the static compliance, and the largest of their
# frequencies relative to that of the bending modes: a higher one would cost time steps.
MEMBRANE_MODES, MEMBRANE_SHARE, MEMBRANE_FASTEST = 6, 0.01, 1.5


class ReductionError(FecmError, ArithmeticError):
    """The plate has no reduced model."""


class ReducedModes(NamedTuple):
    """Modes that a load moves, those of the largest share in the static compliance first."""

    stiffness: Floats  # (m,): squares of the angular frequencies
    shapes: Floats  # (neq, m): unit modal mass
    deflection: Floats  # (m,): displacement under the load; positive
    compliance: float  # static displacement under a unit load

    @property
    def shares(self) -> Floats:
        """Static displacement of each mode under a unit load, (m,)."""
        return np.asarray(self.deflection**2 / self.stiffness)


@dataclass(frozen=True)
class ReducedPlate:
    """A plate in n coordinates, of which the first m are bending modes, the others membrane modes.

    Arrays over pairs are over the m (m + 1)/2 pairs i <= j of bending modes.
    """

    bending: int  # m
    stiffness: Floats  # (n,): squares of the angular frequencies
    deflection: Floats  # (n,): displacement under the load; 0 of membrane modes
    flexibility: float  # 1/k_r: displacement of the modes left out per force
    cubic: Floats  # C, (n, pairs)
    quartic: Floats  # Q, (pairs, pairs)
    damping: float = 0.0  # a of the damping matrix a M

    @property
    def fastest(self) -> float:
        """Largest angular frequency of the bending modes."""
        return float(np.sqrt(self.stiffness[: self.bending].max()))

    @cached_property
    def _pairs(self) -> tuple[Indices, Indices]:
        """Modes i and j of the pairs."""
        first, second = np.triu_indices(self.bending)
        return first, second

    @cached_property
    def _tables(self) -> tuple[Floats, Floats, Floats, Floats]:
        """Q and C in one matrix, the transpose of C, and sums over the pairs of a mode i and j."""
        modes = np.arange(self.bending)[:, None]
        of_first, of_second = ((index == modes).astype(float) for index in self._pairs)
        return np.vstack([self.quartic, self.cubic]), self.cubic.T.copy(), of_first, of_second

    def strain_energy(self, q: Floats) -> Floats:
        """Strain energy of coordinates (n, cases): (cases,)."""
        first, second = self._pairs
        s = q[first] * q[second]
        of_coordinates = q * (0.5 * self.stiffness[:, None] * q + self.cubic @ s)
        of_pairs = 0.5 * s * (self.quartic @ s)
        return np.asarray(of_coordinates.sum(axis=0) + of_pairs.sum(axis=0))

    def internal_forces(self, q: Floats) -> Floats:
        """Derivatives of the strain energy with respect to coordinates (n, cases)."""
        of_pairs, of_coordinates, of_first, of_second = self._tables
        first, second = (q[index] for index in self._pairs)
        both = of_pairs @ (first * second)
        n, forces = both[: len(first)], both[len(first) :]
        n += of_coordinates @ q
        forces += self.stiffness[:, None] * q
        second *= n
        first *= n
        forces[: self.bending] += of_first @ second + of_second @ first
        return forces


def reduced_plate(
    plate: PlateModel, contact: Floats, count: int, damping: float = 0.0
) -> ReducedPlate:
    """Reduce a plate to the bending modes that a load, (numnp, 5), moves most; at most `count`.

    Raises ReductionError if the plate is not held, or if its modes do not converge.
    """
    bending = bending_modes(plate, contact, count)
    plane = _in_plane(plate)
    pairs = _integrated(plate, plane, bending.shapes)
    cubic, quartic = pairs.cubic, pairs.quartic
    stiffness, deflection = [bending.stiffness], [bending.deflection]
    if plane.neq:
        tangent = Tangent(plane)
        quartic -= pairs.loads.T @ tangent.solve(pairs.loads)
        first, second = np.triu_indices(len(bending.stiffness))
        static = bending.deflection / bending.stiffness
        membrane = _moved_modes(
            tangent,
            plane.mass,
            pairs.loads @ (static[first] * static[second]),
            MEMBRANE_MODES,
            least=MEMBRANE_SHARE,
            stiffest=MEMBRANE_FASTEST**2 * bending.stiffness.max(),
            rigid=rigid_in_plane(plane),
        )
        rows = membrane.shapes.T @ pairs.loads
        quartic += (rows.T / membrane.stiffness) @ rows
        cubic = np.concatenate([cubic, rows])
        stiffness.append(membrane.stiffness)
        deflection.append(np.zeros(len(rows)))
    return ReducedPlate(
        bending=len(bending.stiffness),
        stiffness=np.concatenate(stiffness),
        deflection=np.concatenate(deflection),
        flexibility=max(bending.compliance - float(bending.shares.sum()), 0.0),
        cubic=cubic,
        quartic=(quartic + quartic.T) / 2.0,
        damping=damping,
    )


# Modes --------------------------------------------------------------------------------------------


def bending_modes(plate: PlateModel, contact: Floats, count: int) -> ReducedModes:
    """Compute the modes with the largest shares in the displacement under a load, (numnp, 5).

    The masses are lumped; those of u and v are left out, so that these follow statically.  Raises
    ReductionError if the plate is not held.
    """
    free = plate.mesh.equations > 0
    mass = plate.field(plate.mass, 0.0)
    mass[:, :2] = 0.0
    try:
        return _moved_modes(Tangent(plate), mass[free], contact[free], count)
    except SingularStiffnessError as error:
        raise ReductionError(f"a reduced model needs a plate that is held: {error}") from None


def _moved_modes(
    tangent: Tangent,
    mass: Floats,
    load: Floats,
    count: int,
    *,
    least: float = UNMOVED,
    stiffest: float = np.inf,
    rigid: Floats | None = None,
) -> ReducedModes:
    """Modes with the largest shares in the displacement under a load, (neq,); at most `count`.

    Those with less than the share `least`, and those with a square of the angular frequency beyond
    `stiffest`, are left out.  `rigid` (motions, neq) are motions without strain, on which the load
    does no work.

    Lanczos iteration with K^-1 M, starting from the static displacement, finds the modes in the
    order of their shares, and of modes of equal frequency the one that moves.
    """
    static = tangent.solve(load)
    compliance = float(load @ static)
    roots = np.sqrt(mass)
    fixed = np.empty((0, len(mass)))
    if rigid is not None:
        fixed = np.linalg.qr((rigid * roots).T)[0].T / roots
    few = len(fixed)
    most = min(VECTORS_PER_MODE * count + MORE_VECTORS, int(np.count_nonzero(mass)) - few)
    basis = np.concatenate([fixed, np.empty((most, len(mass)))])
    inverse = np.zeros((most, most))  # K^-1 M in the basis
    vector, _ = _made_orthogonal(static, fixed, mass)
    before = np.empty(0)
    for size in range(1, most + 1):
        last, own = few + size - 1, basis[few : few + size]
        basis[last] = vector / _norm(vector, mass)
        vector = tangent.solve(mass * basis[last])
        whole = _norm(vector, mass)
        vector, parts = _made_orthogonal(vector, basis[: last + 1], mass)
        inverse[:size, size - 1] = parts[few:]
        left = _norm(vector, mass)
        exhausted = left <= EXHAUSTED * whole
        if not exhausted and size < most and (size < count or size % LOOK):
            continue
        values, vectors = _moved(inverse[:size, :size], own @ load)
        moved = vectors.T @ (own @ load)
        shares = moved**2 * values
        error = left * np.abs(vectors[-1])
        unknown = (error > CONVERGED * values) & (shares > UNMOVED * compliance)
        known = int(unknown.argmax()) if unknown.any() else len(values)
        shares[known:] = 0.0
        shares[values * stiffest < 1.0] = 0.0
        order = np.argsort(-shares, kind="stable")[:count]
        order = order[shares[order] > least * compliance]
        # Modes beyond the known frequencies: their shares are less than those of the chosen ones,
        # together or if none moves more than a known one; or they are too stiff.
        full = len(order) == count
        together = compliance - shares.sum() <= (shares[order[-1]] if full else least * compliance)
        alone = full and (moved[:known] ** 2).max() * values[known - 1] <= shares[order[-1]]
        stiff = known < len(values) and (values[known] + error[known]) * stiffest < 1.0
        same = len(before) == len(order) and np.allclose(before, values[order], CONVERGED, 0.0)
        if exhausted or together or (same and (alone or stiff)):
            signs = np.where(moved[order] < 0.0, -1.0, 1.0)
            shapes = (signs * vectors[:, order]).T @ own
            return ReducedModes(1.0 / values[order], shapes.T, np.abs(moved[order]), compliance)
        before = values[order]
    raise ReductionError(f"{count} modes did not converge; take fewer")


def _moved(inverse: Floats, load: Floats) -> tuple[Floats, Floats]:
    """Eigenvalues and vectors of K^-1 M in the basis, by ascending frequency.

    Of modes of equal frequency only that which moves under the load, whose parts along the basis
    are given, is left: rounding adds the others to the Krylov space.
    """
    values, vectors = np.linalg.eigh(inverse, UPLO="U")
    values, vectors = values[::-1], vectors[:, ::-1]
    moved = vectors.T @ load
    starts = np.flatnonzero(np.append(True, values[1:] < (1.0 - EQUAL) * values[:-1]))
    combined = np.add.reduceat(moved * vectors, starts, axis=1)
    size = np.sqrt(np.add.reduceat(moved**2, starts))
    return values[starts], combined / np.where(size > 0.0, size, 1.0)


def _made_orthogonal(vector: Floats, basis: Floats, mass: Floats) -> tuple[Floats, Floats]:
    """Vector without its parts along an orthonormal basis (size, neq), and these parts, (size,)."""
    total = np.zeros(len(basis))
    for _ in range(2):  # Gram and Schmidt, twice for orthogonality to rounding
        parts = basis @ (mass * vector)
        vector = vector - parts @ basis
        total += parts
    return vector, total


def _norm(vector: Floats, mass: Floats) -> float:
    return float(np.sqrt(vector @ (mass * vector)))


# Pairs of modes -----------------------------------------------------------------------------------


class Pairs(NamedTuple):
    """Quadratic strains of the pairs of bending modes, integrated."""

    cubic: Floats  # (m, pairs): int N_i eps_q
    quartic: Floats  # (pairs, pairs): int eps_q A eps_q, u and v held
    loads: Floats  # (neq of the membrane, pairs): r


def _in_plane(plate: PlateModel) -> PlateModel:
    """The plate with only u and v free."""
    codes = plate.mesh.codes.copy()
    codes[:, 2:] = 1
    return with_codes(plate, codes)


def bytes_of_pairs(plate: PlateModel, neq: int, modes: int) -> int:
    """Memory of the pairs: their loads and solutions, and the strains of some elements."""
    count = modes * (modes + 1) // 2
    elements = min(BLOCK, max(len(family.rows) for family in plate.families))
    return 8 * count * (3 * neq + 4 * elements * 3 * len(plate.rules.bending.xi))


def _integrated(plate: PlateModel, plane: PlateModel, shapes: Floats) -> Pairs:
    """Integrals over the pairs of modes, (neq, m)."""
    from scipy import sparse  # 0.16 s, which most runs don't need

    modes = shapes.shape[1]
    count = modes * (modes + 1) // 2
    require_memory(bytes_of_pairs(plate, plane.neq, modes), "the reduced model of the plate")
    fields = np.stack([plate.field(shape, 0.0) for shape in shapes.T], axis=2)  # (numnp, 5, m)
    cubic, quartic = np.zeros((modes, count)), np.zeros((count, count))
    loads = np.zeros((plane.neq, count))
    for family in plate.families:
        laminate = plate.laminate_of(family)
        for block in family.blocks(BLOCK):
            strains = _pair_strains(plate, block, fields[block.nodes, 2])
            at = interpolate(block, plate.rules.bending)
            linear = membrane_and_bending(at, plate.curvature)  # (ne, points, 6, 5 nodes)
            ne, nodes = block.nodes.shape
            weight = at.jxw[:, :, None, None]
            stresses = _rows(weight * (laminate.A @ strains))
            quartic += _rows(strains).T @ stresses
            if laminate.is_coupled or plate.is_curved:
                AB = np.hstack([laminate.A, laminate.B])
                own = fields[block.nodes].reshape(ne, 1, nodes * NDOF, modes)
                cubic += _rows(weight * (AB @ (linear @ own))).T @ _rows(strains)
            B = linear.reshape(ne, -1, 6, nodes, NDOF)[:, :, :3, :, :2].reshape(ne, -1, 2 * nodes)
            forces = B.transpose(0, 2, 1) @ stresses.reshape(ne, -1, count)
            numbers = plane.mesh.equations[block.nodes][:, :, :2].ravel()
            held = np.flatnonzero(numbers > 0)
            places = (numbers[held] - 1, held)
            sums = sparse.csr_array((np.ones(len(held)), places), (plane.neq, len(numbers)))
            loads += sums @ _rows(forces)
    return Pairs(cubic, quartic, loads)


def _rows(values: Floats) -> Floats:
    """All axes but the last in one."""
    return values.reshape(-1, values.shape[-1])


def _pair_strains(plate: PlateModel, block: ElementBlock, w: Floats) -> Floats:
    """eps_q(i, j) of the pairs of deflections w (ne, nodes, m): (ne, points, 3, pairs).

    Their sum over all pairs, each times q_i q_j, is eps_q of the sum of q_i w_i.
    """
    tied = QuadraticStrains(block, plate.rules.bending)
    slopes = [tied.slopes(own) for own in w.transpose(2, 1, 0)]
    one, two = (np.stack(along, axis=1) for along in zip(*slopes, strict=True))  # (10, m, ne)
    i, j = np.triu_indices(w.shape[2])
    times = np.where(i == j, 0.5, 1.0)[:, None]
    both = one[TYING:, i] * two[TYING:, j] + two[TYING:, i] * one[TYING:, j]
    tied_components = (
        times * one[:TYING, i] * one[:TYING, j],
        times * two[:TYING, i] * two[:TYING, j],
        times * both,
    )
    return np.ascontiguousarray(tied.at_points(tied_components).transpose(3, 1, 0, 2))


# Cases of every matrix product: no case depends on the others, and the products fit the cache.
TILE = 32
# Evaluations of the law in a trial, at most, and the error of its indentation.
EVALUATIONS = 40
TOLERANCE = 1e-9


class ReducedMotion:
    """Motion of a reduced plate from rest in a number of cases, with one time step."""

    def __init__(self, plate: ReducedPlate, dt: float, cases: int) -> None:
        self.plate, self.dt, self._cases = plate, dt, cases
        shape = (-(-cases // TILE), len(plate.stiffness), TILE)
        self._q, self._increment, self._internal = np.zeros((3, *shape))
        self._force = np.zeros((shape[0], 1, TILE))
        phase = np.sqrt(plate.stiffness)[:, None] * dt
        self._inertia = dt * dt * np.sinc(phase / (2.0 * np.pi)) ** 2  # dt^2 psi
        self._of_velocity = 1.0 / np.sinc(phase / np.pi)
        self._damping = 0.5 * plate.damping * self._inertia / dt
        self._damped = np.zeros((shape[0], TILE))  # what it has taken, up to half a step

    def advance(self, force: Floats) -> Floats:
        """Take a step under the contact forces at its start, (cases,).

        Returns the displacement of the coordinates under the load, (cases,).
        """
        before, self._increment = self._increment, self._next_increment(force)
        if self.plate.damping:
            self._damped += self.plate.damping * self.dt * self._square_of_velocity(before)
        self._q += self._increment
        for q, internal in zip(self._q, self._internal, strict=True):
            internal[:] = self.plate.internal_forces(q)
        moved = (self.plate.deflection[:, None] * self._q).sum(axis=1)
        return np.asarray(moved.ravel()[: self._cases])

    def energy(self, force: Floats) -> Floats:
        """Energy after the last step, under the forces there, with what the damping has taken.

        Kinetic and strain energy, (cases,).
        """
        square = self._square_of_velocity(self._next_increment(force))
        strain = np.array([self.plate.strain_energy(q) for q in self._q])
        damped = self._damped + 0.5 * self.plate.damping * self.dt * square
        return np.asarray((0.5 * square + strain + damped).ravel()[: self._cases])

    def _square_of_velocity(self, other: Floats) -> Floats:
        """Sum of the squares of the velocities between the last increments and others."""
        velocity = self._of_velocity * (self._increment + other) / (2.0 * self.dt)
        return np.asarray((velocity * velocity).sum(axis=1))

    def _next_increment(self, force: Floats) -> Floats:
        """Increments of the coordinates in the next step."""
        self._force.reshape(-1)[: self._cases] = force
        pull = self.plate.deflection[:, None] * self._force - self._internal
        b = self._damping
        return ((1.0 - b) * self._increment + self._inertia * pull) / (1.0 + b)


class SeriesLaw(NamedTuple):
    """A contact law in series with a linear spring, for many cases: the approach is a + F(a)/k_r.

    The spring is what the modes left out of a reduced plate yield under the present force, so that
    the contact iteration takes the approach for the indentation.  As a part of the plate's
    displacement in that iteration it would not converge where the contact is stiffer than k_r.
    """

    law: Law[Floats]  # whose trials leave its memory as it is
    flexibility: float  # 1/k_r, length/force

    def start(self) -> Any:
        """Memory before the first contact."""
        return self.law.start()

    def of_law(self, point: ContactPoint[Floats]) -> ContactPoint[Floats]:
        """The law's own indentation at a point whose indentation is the approach."""
        return ContactPoint(point.indentation - self.flexibility * point.force, point.force)

    def trial(
        self, memory: Any, last: ContactPoint[Floats], indentation: Floats
    ) -> tuple[Floats, Any]:
        """Contact force at a trial approach."""
        return self._solved(memory, last, indentation).force, memory

    def accept(self, memory: Any, last: ContactPoint[Floats], indentation: Floats) -> Any:
        """Memory after a step that ends at an approach."""
        own = self._solved(memory, last, indentation).indentation
        return self.law.accept(memory, self.of_law(last), own)

    def permanent(self, memory: Any, last: ContactPoint[Floats]) -> Floats:
        """Permanent indentation after unloading from the last point (length)."""
        return self.law.permanent(memory, self.of_law(last))

    def _solved(
        self, memory: Any, last: ContactPoint[Floats], approach: Floats
    ) -> ContactPoint[Floats]:
        """The law's own indentation at an approach, and its force.

        The excess e = a + F(a)/k_r - approach grows with a.  Its zero lies between the last
        indentation and that moved as far as the approach, and there beyond a - e of each a:
        secants between ends on both sides of it, of which the one that stays is weighed less (N.
        Anderson and A. Bjorck, BIT 13, 1973, 253).
        """
        own = self.of_law(last)

        def tried(a: Floats) -> tuple[Floats, Floats]:
            force, _ = self.law.trial(memory, own, a)
            return a + self.flexibility * force - approach, force

        other = approach - self.flexibility * last.force
        beyond, _ = tried(other)
        low, high = np.minimum(own.indentation, other), np.maximum(own.indentation, other)
        a = np.clip(other - beyond, low, high)
        excess, force = tried(a)
        for _ in range(EVALUATIONS):
            solved = np.abs(excess) <= TOLERANCE * np.abs(approach)
            if solved.all():
                break
            width = np.where(solved, 1.0, excess - beyond)
            secant = np.where(solved, a, a - excess * (a - other) / width)
            before, at = excess, a
            a = secant
            excess, force = tried(a)
            between = excess * before <= 0.0
            rest = 1.0 - excess / np.where(solved, 1.0, before)
            beyond = np.where(between, before, beyond * np.where(rest > 0.0, rest, 0.5))
            other = np.where(between, at, other)
        return ContactPoint(a, force)
