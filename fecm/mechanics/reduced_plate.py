"""A nonlinear plate in a few modes, and its motion under the contact forces of many impacts.

All impacts are at one place.  The deflection is a sum of bending modes q_i phi_i of the plate at
rest.  The displacements u and v in the plane follow from s_ij = q_i q_j (A. A. Muravyov and S. A.
Rizzi, Computers & Structures 81, 2003, 1513).  Here they are computed with the element matrices
instead of a fit:

    u, v = U q + sum over i <= j of u_ij s_ij,    K_mm U = -K_mb phi,    K_mm u_ij = -r_ij,
    r_ij = int B_m' A eps_q(i, j),

where eps_q(i, j) is the part of the quadratic strains (:mod:`~fecm.mechanics.membrane`) that
belongs to s_ij.  The strain energy is

    1/2 sum omega_i^2 q_i^2 + q' C s + 1/2 s' Q s,    Q = int eps_ij A eps_kl,
    C_i,kl = int N_i eps_q(k, l),    eps_ij = eps_q(i, j) + B_m u_ij,

with the membrane force N_i = A (B_m U_i + w_i/R) + B kappa_i of a bending mode; U and C are zero
unless the laminate or a curvature couples bending and stretching.

A static membrane has no inertia.  This matters where the edges are free in the plane: the lowest
membrane modes psi_k are then hardly faster than the bending modes.  The membrane modes that the
quadratic strains of the static deflection excite most are therefore coordinates as well.  A
coordinate q_k of such a mode adds the row psi_k' r to C, and the term
(psi_k' r)' (psi_k' r)/Omega_k^2 to Q, which cancels the static displacement of the mode.

The modes left out follow the contact force F statically.  They add F/k_r to the displacement under
the load:

    W = sum g_i q_i + F/k_r,    1/k_r = 1/k_b - sum g_i^2/omega_i^2,

with the displacement g_i of a mode under the load and the static stiffness k_b of the linear plate
there.  Each mode adds g_i^2/omega_i^2 to the static compliance.  The modes that add most are kept.

Q is positive, and few of its eigenvectors matter for the stiffness of the plate under the load.
With the rows of B, as few as keep this stiffness, Q = B' B and the last energy is 1/2 |B s|^2.

The motion under the contact forces of many impacts is computed for all cases together.  Each
coordinate q of frequency omega moves by

    q_(n+1) - 2 q_n + q_(n-1) = dt^2 psi (g F - dU/dq - a v),   psi = (sin(x)/x)^2,  x = omega dt/2,

with the central difference v of the velocity.  Without psi these are the central differences of a
full run.  With psi, free vibrations and constant forces are exact (W. Gautschi, Numerische
Mathematik 3, 1961, 381), so that only the contact force and the membrane limit the step.  The
central difference of a vibration is sin(omega dt)/(omega dt) times the velocity.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from fecm._errors import FecmError
from fecm._machine import require_memory
from fecm._typing import Floats, Indices
from fecm.mechanics.contact_law import ContactPoint, Law
from fecm.mechanics.element_matrices import membrane_and_bending
from fecm.mechanics.impact_sweep import ReducedStruct, tiles
from fecm.mechanics.interpolation import NDOF, interpolate
from fecm.mechanics.membrane import BLOCK, TYING, QuadraticStrains
from fecm.mechanics.mesh import ElementBlock
from fecm.mechanics.plate import PlateModel
from fecm.mechanics.solutions import SingularStiffnessError, Tangent, rigid_in_plane
from fecm.mechanics.symmetry import (
    SymmetryReduction,
    symmetry_reduction,
    unreduced,
    with_codes,
)

# Residual of a converged mode relative to its eigenvalue; the error of the frequency is its square.
CONVERGED = 1e-6
# Largest size of the Krylov space: vectors per requested mode, plus a constant.
VECTORS_PER_MODE, MORE_VECTORS = 12, 60
# Steps between two solutions of the eigenvalue problem in the Krylov space.
LOOK = 20
# Squares of frequencies are equal if their relative difference is smaller.
EQUAL = 1e-8
# The Krylov space is complete if a new vector is smaller relative to the last vector.
EXHAUSTED = 1e-12
# The load does not move a mode whose share in the static compliance is smaller.
UNMOVED = 1e-10
# Largest number of membrane modes, their least share in the static compliance, and their largest
# frequency relative to the bending modes; a higher frequency would cost time steps.
MEMBRANE_MODES, MEMBRANE_SHARE, MEMBRANE_FASTEST = 6, 0.01, 1.5
# Error of B' B in the displacement that the stretching takes from a static one under the load,
# relative to the largest.  It is the largest error of deflections whose modes scatter about the
# static ones, by a share of each, and that reach from a part of the largest.
STRETCHING = 1e-6
SCATTER, SMALLEST, DEFLECTIONS = 0.5, 0.2, 200
# Least size of displacements in the plane that a field has, over the largest.
IN_PLANE = 1e-3
# Static deflection, over the thickness, at which the omitted modes follow the membrane's forces
# exactly; least energy of the states of membrane stress there, over the largest, and least size of
# their forces.
BENT, STATES, OMITTED = 2.0, 1e-5, 1e-2
# States for which memory is reserved; plates have some 30.
MOST_STATES = 40


class ReductionError(FecmError, ArithmeticError):
    """The plate has no reduced model."""


class ReducedModes(NamedTuple):
    """Modes that a load moves, by descending share in the static compliance."""

    stiffness: Floats  # (m,): squares of the angular frequencies
    shapes: Floats  # (neq, m): unit modal mass
    deflection: Floats  # (m,): displacement under the load; positive
    compliance: float  # static displacement under a unit load
    static: Floats  # (neq,): static displacements under a unit load
    load: Floats  # the unit load

    @property
    def shares(self) -> Floats:
        """Static displacement of each mode under a unit load, (m,)."""
        return np.asarray(self.deflection**2 / self.stiffness)


@dataclass(frozen=True)
class ReducedPlate:
    """A plate in n coordinates: m bending modes, followed by membrane modes.

    Arrays over pairs have an entry for each of the m (m + 1)/2 pairs i <= j of bending modes.
    """

    bending: int  # m
    stiffness: Floats  # (n,): squares of the angular frequencies
    deflection: Floats  # (n,): displacement under the load; 0 for membrane modes
    flexibility: float  # 1/k_r: displacement of the modes left out per force
    cubic: Floats  # C, (n, pairs)
    factor: Floats  # B, (rank, pairs): Q = B' B
    damping: float = 0.0  # a of the damping matrix a M
    fields: ReducedFields | None = None  # where displacement fields are asked for

    @property
    def fastest(self) -> float:
        """Largest angular frequency of the bending modes."""
        return float(np.sqrt(self.stiffness[: self.bending].max()))

    @cached_property
    def _pairs(self) -> tuple[Indices, Indices]:
        """Bending modes i and j of the pairs."""
        first, second = np.triu_indices(self.bending)
        return first, second

    @cached_property
    def coupled(self) -> int:
        """First coordinate with a row of C that is not 0, or the number of coordinates."""
        rows = np.flatnonzero(self.cubic.any(axis=1))
        return int(rows[0]) if len(rows) else len(self.cubic)

    @cached_property
    def stacked(self) -> Floats:
        """B over the rows of C from :attr:`coupled` on."""
        return np.vstack([self.factor, self.cubic[self.coupled :]])

    @cached_property
    def _tables(self) -> tuple[Floats, Floats, Floats, Floats]:
        """B over C and its transpose, and the sums over the pairs of each mode i and j."""
        modes = np.arange(self.bending)[:, None]
        of_first, of_second = ((index == modes).astype(float) for index in self._pairs)
        return self.stacked, self.stacked.T.copy(), of_first, of_second

    def strain_energy(self, q: Floats) -> Floats:
        """Return the strain energy, (cases,), of coordinates (n, cases)."""
        first, second = self._pairs
        s = q[first] * q[second]
        of_coordinates = q * (0.5 * self.stiffness[:, None] * q + self.cubic @ s)
        of_pairs = 0.5 * (self.factor @ s) ** 2
        return np.asarray(of_coordinates.sum(axis=0) + of_pairs.sum(axis=0))

    def internal_forces(self, q: Floats) -> Floats:
        """Return the derivatives of the strain energy with respect to coordinates (n, cases)."""
        stacked, transposed, of_first, of_second = self._tables
        rank, coupled = len(self.factor), self.coupled
        first, second = (q[index] for index in self._pairs)
        of_rows = stacked @ (first * second)
        forces = self.stiffness[:, None] * q
        forces[coupled:] += of_rows[rank:]
        of_rows[rank:] = q[coupled:]
        n = transposed @ of_rows
        second *= n
        first *= n
        forces[: self.bending] += of_first @ second + of_second @ first
        return forces


@dataclass(frozen=True)
class ReducedFields:
    """Displacement fields of a reduced plate, from its coordinates and the contact force.

    The omitted modes follow the contact force and the forces of the membrane on the bending modes,
    both statically and with the stiffness that the membrane gives them.  Their displacement is a
    sum of few fields with unit stiffness.  The displacements in the plane follow from the pairs of
    the bending modes and of the static displacement of the omitted ones.
    """

    bending: int  # m
    shapes: Floats  # (n, numnp, 5): of the coordinates
    omitted: Floats  # (few, numnp, 5): of the omitted modes
    in_plane: Floats  # (rank, numnp, 2)
    factor: Floats  # (rank, pairs): of the bending modes and the static displacement
    membrane: Floats  # (states, pairs): states of membrane stress
    push: Floats  # (few,): forces on the omitted modes per contact force
    project: Floats  # (few,): static displacement of the omitted modes in their displacement
    cubic: Floats  # (few, states * m): of a state and a bending mode
    square: Floats  # (few, pairs): of a coupled laminate or a curved plate; zero otherwise
    stiffness: Floats  # (states, few, few)

    @property
    def count(self) -> int:
        """Number of amplitudes."""
        return len(self.shapes) + len(self.omitted) + len(self.in_plane)

    def amplitudes(self, q: Floats, force: Floats) -> Floats:
        """Return the amplitudes, (rows, count), of coordinates (rows, n) and forces (rows,).

        They are those of :attr:`shapes`, :attr:`omitted` and :attr:`in_plane`.
        """
        bent, few = q[:, : self.bending], len(self.omitted)
        pairs = self._pairs(bent, force)
        states = small_products(pairs, self.membrane.T)
        triples = (states[:, :, None] * bent[:, None]).reshape(len(q), -1)
        pull = force[:, None] * self.push + small_products(pairs, self.square.T)
        pull += small_products(triples, self.cubic.T)
        stiffness = small_products(states, self.stiffness.reshape(len(self.membrane), -1))
        stiffness = np.eye(few) + stiffness.reshape(-1, few, few)
        omitted = np.linalg.solve(stiffness, pull[:, :, None])[:, :, 0]
        static = np.einsum("rf,f", omitted, self.project)
        followed = small_products(self._pairs(bent, static), self.factor.T)
        return np.column_stack([q, omitted, followed])

    def _pairs(self, bent: Floats, static: Floats) -> Floats:
        """Return the products of bending modes (rows, m) and of the static displacement (rows,)."""
        moved = np.column_stack([bent, static])
        first, second = np.triu_indices(self.bending + 1)
        return np.asarray(moved[:, first] * moved[:, second])

    @cached_property
    def _tables(self) -> tuple[Floats, Floats]:
        """Shapes of w and the rotations, and of u and v, in rows."""
        shapes = np.concatenate([self.shapes, self.omitted])
        bent = shapes[:, :, 2:].reshape(len(shapes), -1)
        in_plane = np.concatenate([shapes[:, :, :2], self.in_plane])
        return bent, in_plane.reshape(len(in_plane), -1)

    def fields(self, amplitudes: Floats) -> Floats:
        """Return displacement fields, (rows, numnp, 5)."""
        bent, in_plane = self._tables
        rows, numnp = len(amplitudes), self.shapes.shape[1]
        fields = np.empty((rows, numnp, NDOF))
        w = small_products(amplitudes[:, : len(bent)], bent)
        fields[:, :, 2:] = w.reshape(rows, numnp, 3)
        fields[:, :, :2] = small_products(amplitudes, in_plane).reshape(rows, numnp, 2)
        return fields


# Multiplications of a matrix product that BLAS leaves to one thread.
SMALL = 64**3


def small_products(a: Floats, b: Floats) -> Floats:
    """Multiply matrices by products so small that the number of threads changes no bit."""
    rows, inner = a.shape
    product = np.empty((rows, b.shape[1]))
    height = min(rows, 32) or 1
    width = max(1, SMALL // (height * max(inner, 1)))
    for start in range(0, rows, height):
        part = a[start : start + height]
        for column in range(0, b.shape[1], width):
            cut = slice(column, column + width)
            product[start : start + height, cut] = part @ b[:, cut]
    return product


def reduced_plate(
    plate: PlateModel,
    contact: Floats,
    count: int,
    damping: float = 0.0,
    error: float = STRETCHING,
    *,
    has_fields: bool = False,
) -> ReducedPlate:
    """Reduce a plate to the `count` bending modes, at most, that a load (numnp, 5) moves most.

    `error` is the error of B, see :data:`STRETCHING`.  With `has_fields` the plate also has its
    displacement fields.  Raises ReductionError if the plate is not held, or if its modes do not
    converge.
    """
    turn = _at_rest(plate, contact)
    bending, held = _bending_modes(plate, turn, contact, count)
    plane = _free_in_plane(plate)
    # Modes that a half turn maps onto themselves have quadratic strains that it maps likewise.
    in_plane = symmetry_reduction(plane, None) if turn.is_half else unreduced(plane)
    bent, modes = bending.shapes, len(bending.stiffness)
    if has_fields:
        omitted = bending.static - bent @ (bending.deflection / bending.stiffness)
        bent = np.column_stack([bent, omitted])
    whole = _integrated(plate, in_plane, bent)
    pairs = whole.of_first(modes)
    cubic, quartic = pairs.cubic, pairs.quartic
    stiffness, deflection = [bending.stiffness], [bending.deflection]
    static = bending.deflection / bending.stiffness
    shape_fields = np.array([plate.field(shape, 0.0) for shape in bent.T])
    dynamic_fields: list[Floats] = []
    solved = np.zeros_like(whole.loads)
    followed = solved
    if plane.neq:
        tangent = Tangent(plane, reduction=in_plane)
        solved = tangent.solve(whole.loads)
        quartic -= pairs.loads.T @ of_first(modes, solved)
        followed = -solved
        first, second = np.triu_indices(modes)
        membrane = _moved_modes(
            tangent,
            _independent_mass(plane, in_plane, plane.mass),
            pairs.loads @ (static[first] * static[second]),
            MEMBRANE_MODES,
            least=MEMBRANE_SHARE,
            stiffest=MEMBRANE_FASTEST**2 * bending.stiffness.max(),
            rigid=rigid_in_plane(plane, in_plane),
        )
        rows = membrane.shapes.T @ pairs.loads
        quartic += (rows.T / membrane.stiffness) @ rows
        cubic = np.concatenate([cubic, rows])
        stiffness.append(membrane.stiffness)
        deflection.append(np.zeros(len(rows)))
        dynamic = membrane.shapes.T @ whole.loads
        followed = followed + (membrane.shapes / membrane.stiffness) @ dynamic
        dynamic_fields = [in_plane.field(shape)[None] for shape in membrane.shapes.T]
    fields = None
    if has_fields:
        factor, vectors = _few(followed, np.append(static, 1.0))
        across = np.array([in_plane.field(vector) for vector in vectors.T])
        followers = _omitted(plate, (turn, held), bending, shape_fields, whole, (in_plane, solved))
        fields = ReducedFields(
            bending=modes,
            shapes=np.concatenate([shape_fields[:modes], *dynamic_fields]),
            factor=factor,
            in_plane=across.reshape(-1, *shape_fields.shape[1:])[..., :2].copy(),
            **followers,
        )
    return ReducedPlate(
        bending=modes,
        stiffness=np.concatenate(stiffness),
        deflection=np.concatenate(deflection),
        flexibility=max(bending.compliance - float(bending.shares.sum()), 0.0),
        cubic=cubic,
        factor=factor_of((quartic + quartic.T) / 2.0, static, error),
        damping=damping,
        fields=fields,
    )


def _omitted(
    plate: PlateModel,
    held: tuple[SymmetryReduction, Tangent],
    bending: ReducedModes,
    shapes: Floats,
    pairs: Pairs,
    followed: tuple[SymmetryReduction, Floats],
) -> dict[str, Floats]:
    """Return how the omitted modes follow the contact and the membrane; see :class:`ReducedFields`.

    `shapes` (numnp, 5) are those of the modes and of the omitted modes under a unit force; `held`
    are the independent dofs and their stiffness, `followed` those of the membrane with K_mm^-1 r
    of the pairs.
    """
    turn, tangent = held
    m, numnp = len(bending.stiffness), len(plate.mesh.coordinates)
    require_memory(bytes_of_fields(plate, m), "the reduced model of the plate")
    # Force that bends the linear plate by some thicknesses, and the amplitudes under it.
    force = BENT * plate.thicknesses.max() / bending.compliance
    static = force * np.append(bending.deflection / bending.stiffness, 1.0)
    first, second = np.triu_indices(m + 1)
    size = np.abs(static[first] * static[second])
    quartic = pairs.quartic - pairs.loads.T @ followed[1]
    values, vectors = np.linalg.eigh((quartic + quartic.T) / 2.0 * np.outer(size, size))
    kept = np.flatnonzero(values > STATES * values[-1])[::-1]
    membrane, states = vectors[:, kept].T / size, size[:, None] * vectors[:, kept]
    forces = MembraneStates(plate, shapes, followed, states)
    # Loads of the size that they have in this deflection, of which few are independent.
    amount = np.abs(membrane @ (static[first] * static[second]))
    amount = np.maximum(amount, STATES**0.5 * amount.max(initial=0.0))
    scales = np.append(np.outer(amount, np.abs(static[:m])), size[: forces.of_pairs.shape[1]])
    triples = len(membrane) * m
    on_w = forces.on(shapes[:m]) * scales[:triples]
    of_pairs = forces.of_pairs * scales[triples:]
    mixed = on_w.T @ of_pairs[2::NDOF]
    gram = np.block([[on_w.T @ on_w, mixed], [mixed.T, of_pairs.T @ of_pairs]])
    squares, vectors = np.linalg.eigh(gram)
    basis = vectors[:, squares > OMITTED**2 * squares[-1:]][:, ::-1]
    few = of_pairs @ basis[triples:]
    few[2::NDOF] += on_w @ basis[:triples]
    across = shapes[:m].reshape(m, -1)
    independent = np.stack([turn.gather(load.reshape(numnp, NDOF)) for load in few.T], axis=1)
    solved = [turn.field(part).ravel() for part in tangent.solve(independent).T]
    moved = (few.T @ across.T / bending.stiffness) @ across - np.reshape(
        solved, (-1, across.shape[1])
    )
    # The first field is that of the contact force.  `work` is the product with the stiffness.
    fields = np.concatenate([force * shapes[m].reshape(1, -1), moved])
    contact = force * bending.load.reshape(1, -1)
    work = np.concatenate([contact, -few.T]) @ fields.T
    energy, vectors = np.linalg.eigh((work + work.T) / 2.0)
    kept = np.flatnonzero(energy > OMITTED**2 * energy[-1])[::-1]
    root = np.sqrt(energy[kept])
    fields = (vectors[:, kept] / root).T @ fields
    amplitudes = root[:, None] * vectors[:, kept].T
    of_loads = amplitudes[:, 1:] @ basis.T / scales
    square = np.zeros((len(kept), len(size)))
    square[:, : of_pairs.shape[1]] = of_loads[:, triples:]
    fields = fields.reshape(-1, numnp, NDOF)
    on_fields = forces.on(fields).reshape(numnp, len(membrane), len(fields))
    stiffness = np.tensordot(fields[:, :, 2], on_fields, 1)
    return {
        "membrane": membrane,
        "omitted": fields,
        "push": amplitudes[:, 0] / force,
        "project": amplitudes[:, 0] * force / work[0, 0] if work[0, 0] > 0.0 else 0.0 * root,
        "cubic": np.ascontiguousarray(of_loads[:, :triples]),
        "square": square,
        "stiffness": np.ascontiguousarray(stiffness.transpose(1, 0, 2)),
    }


class MembraneStates:
    """States of membrane stress, and their forces on the deflection of a plate.

    `shapes` (modes, numnp, 5), `followed` and the pairs are those of :func:`_omitted`; `states`
    (pairs, states) are the pairs of each state.
    """

    def __init__(
        self,
        plate: PlateModel,
        shapes: Floats,
        followed: tuple[SymmetryReduction, Floats],
        states: Floats,
    ) -> None:
        in_plane, solved = followed
        self._count, self._numnp = states.shape[1], shapes.shape[1]
        displacement = -np.stack([in_plane.field(part)[:, :2] for part in solved.T], axis=2)
        fields = shapes.transpose(1, 2, 0)
        first, second = np.triu_indices(len(shapes))
        # Forces of the pairs in a coupled laminate or a curved plate, (5 numnp, pairs or 0).
        couples = plate.is_curved or plate.is_coupled
        self.of_pairs = np.zeros((NDOF * self._numnp, len(first) * couples))
        self._blocks: list[tuple[ElementBlock, QuadraticStrains, Floats]] = []
        for family in plate.families:
            laminate = plate.laminate_of(family)
            for block in family.blocks(BLOCK):
                tied = QuadraticStrains(block, plate.rules.bending)
                basis = interpolate(block, plate.rules.bending)
                linear = membrane_and_bending(basis, plate.curvature)  # (ne, points, 6, 5 nodes)
                ne, nodes = block.nodes.shape
                weight = basis.jxw[:, :, None, None]
                strains = _pair_strains(plate, block, fields[block.nodes, 2])
                of_plane = linear.reshape(ne, -1, 6, nodes, NDOF)[:, :, :3, :, :2]
                nodal = displacement[block.nodes].reshape(ne, 1, 2 * nodes, -1)
                strains += of_plane.reshape(ne, -1, 3, 2 * nodes) @ nodal
                stresses = weight * (laminate.A @ (strains @ states))
                self._blocks.append((block, tied, stresses.transpose(3, 2, 1, 0).copy()))
                if not (laminate.is_coupled or plate.is_curved):
                    continue
                AB = np.hstack([laminate.A, laminate.B])
                forces = linear.transpose(0, 3, 1, 2).reshape(ne, nodes * NDOF, -1)
                resultants = (weight * (AB.T @ strains)).reshape(ne, -1, len(first))
                places = (NDOF * block.nodes[:, :, None] + np.arange(NDOF)).reshape(ne, -1)
                np.add.at(self.of_pairs, places, forces @ resultants)
                values = fields[block.nodes].reshape(ne, 1, nodes * NDOF, -1)
                stresses = (weight * (AB @ (linear @ values))).transpose(3, 2, 1, 0)
                slopes = _slopes(tied, block, shapes)
                tied_forces = [tied.tied_forces(N) for N in stresses]
                for pair, (i, j) in enumerate(zip(first.tolist(), second.tolist(), strict=True)):
                    on_w = _on_w(tied, tied_forces[i], slopes[j])
                    if i != j:
                        on_w = on_w + _on_w(tied, tied_forces[j], slopes[i])
                    np.add.at(self.of_pairs[:, pair], NDOF * block.nodes.T + 2, on_w)
        # In the plane the membrane is in equilibrium.
        self.of_pairs.reshape(self._numnp, NDOF, -1)[:, :2] = 0.0

    def on(self, shapes: Floats) -> Floats:
        """Return the forces on w of each state on each shape (shapes, numnp, 5), (numnp, ...)."""
        forces = np.zeros((self._numnp, self._count, len(shapes)))
        for block, tied, stresses in self._blocks:
            slopes = _slopes(tied, block, shapes)
            nodes = block.nodes.T
            for state, N in enumerate(stresses):
                n = tied.tied_forces(N)
                for number, of_shape in enumerate(slopes):
                    np.add.at(forces[:, state, number], nodes, _on_w(tied, n, of_shape))
        return forces.reshape(self._numnp, -1)


def _slopes(
    tied: QuadraticStrains, block: ElementBlock, shapes: Floats
) -> list[tuple[Floats, Floats]]:
    """Return the slopes of w of each shape (shapes, numnp, 5) at the tying points."""
    return [tied.slopes(w) for w in shapes[:, block.nodes, 2].swapaxes(1, 2)]


def _on_w(
    tied: QuadraticStrains, n: tuple[Floats, Floats, Floats], slopes: tuple[Floats, Floats]
) -> Floats:
    """Return the forces on w, (nodes, ne), of the tied forces of a membrane force on slopes."""
    n11, n22, n12 = n
    w_1, w_2 = slopes
    along_one = np.concatenate([w_1[:TYING] * n11, w_2[TYING:] * n12])
    along_two = np.concatenate([w_2[:TYING] * n22, w_1[TYING:] * n12])
    return tied.nodal_forces(along_one, along_two)


def _few(displacements: Floats, static: Floats) -> tuple[Floats, Floats]:
    """Return a product (rank, pairs) and few vectors that give the displacements (neq, pairs).

    `static` (m,) are the amplitudes of the bending modes in the static deflection.
    """
    first, second = np.triu_indices(len(static))
    size = np.abs(static[first] * static[second])
    vectors, values, rows = np.linalg.svd(displacements * size, full_matrices=False)
    rank = np.count_nonzero(values > IN_PLANE * values[:1])
    return (values[:rank, None] * rows[:rank]) / size, vectors[:, :rank]


def factor_of(quartic: Floats, static: Floats, error: float) -> Floats:
    """Return B, (rank, pairs), with Q = B' B up to an error; see :data:`STRETCHING`.

    `static` (m,) are the bending modes in the static deflection.  The rank is the least one.
    """
    first, second = np.triu_indices(len(static))
    # Eigenvectors of Q for pairs of the size that they have in the static deflection.
    size = np.abs(static[first] * static[second])
    values, vectors = np.linalg.eigh(quartic * np.outer(size, size))
    rows = (np.sqrt(np.maximum(values, 0.0)) * vectors).T[::-1] / size
    random = np.random.default_rng(0)
    shape = len(static), DEFLECTIONS
    scattered = static[:, None] * (1.0 + SCATTER * random.standard_normal(shape))
    q = scattered * random.uniform(SMALLEST, 1.0, DEFLECTIONS)
    # What the forces of each row on the modes, N_ij q_j + N_ji q_j, do statically.
    static = static[:, None]
    parts = (rows @ (q[first] * q[second])) * (
        rows @ (static[first] * q[second] + static[second] * q[first])
    )
    left_out = np.abs(np.cumsum(parts[::-1], axis=0)[::-1]).max(axis=1)
    matter = np.flatnonzero(left_out > error * np.abs(parts.sum(axis=0)).max())
    return np.ascontiguousarray(rows[: matter[-1] + 1 if len(matter) else 0])


# Modes --------------------------------------------------------------------------------------------


def bending_modes(plate: PlateModel, contact: Floats, count: int) -> ReducedModes:
    """Compute the modes with the largest shares in the displacement under a load, (numnp, 5).

    The masses are lumped.  The masses of u and v are left out, so that u and v follow statically.
    Raises ReductionError if the plate is not held.
    """
    return _bending_modes(plate, _at_rest(plate, contact), contact, count)[0]


def _at_rest(plate: PlateModel, contact: Floats) -> SymmetryReduction:
    """Return the dofs that move independently in small motions about the plate at rest."""
    return symmetry_reduction(replace(plate, nonlinear=False), contact)


def _bending_modes(
    plate: PlateModel, reduction: SymmetryReduction, contact: Floats, count: int
) -> tuple[ReducedModes, Tangent]:
    """Compute the modes of :func:`bending_modes` in the independent dofs.

    Returns them with the stiffness of these dofs.
    """
    mass = plate.field(plate.mass, 0.0)
    mass[:, :2] = 0.0
    free = plate.mesh.equations > 0
    try:
        tangent = Tangent(plate, reduction=reduction)
        found = _moved_modes(
            tangent,
            _independent_mass(plate, reduction, mass[free]),
            reduction.gather(contact),
            count,
        )
    except SingularStiffnessError as error:
        raise ReductionError(f"a reduced model needs a plate that is held: {error}") from None
    shapes = [reduction.field(shape)[free] for shape in found.shapes.T]
    static = reduction.field(found.static)[free]
    return found._replace(shapes=np.stack(shapes, axis=1), static=static, load=contact), tangent


def _independent_mass(plate: PlateModel, reduction: SymmetryReduction, mass: Floats) -> Floats:
    """Sum the masses (neq,) over the dofs that follow each independent one."""
    return reduction.gather(reduction.sign * plate.field(mass, 0.0))


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
    """Find up to `count` modes with the largest shares in the displacement under a load, (neq,).

    Vectors are those of the tangent's independent dofs.  Modes whose share is below `least`, or
    whose squared angular frequency exceeds `stiffest`, are left out.  `rigid` (motions, neq) are
    motions without strain, on which the load does no work.

    Lanczos iteration with K^-1 M, starting from the static displacement, finds the modes in the
    order of their shares.  Among modes of equal frequency it finds the mode that the load moves.
    Products of a matrix and a vector are sums by einsum: BLAS would wake threads for each.
    """
    static = tangent.solve(load)
    compliance = float(load @ static)
    roots = np.sqrt(mass)
    fixed = np.empty((0, len(mass)))
    if rigid is not None:
        fixed = np.linalg.qr((rigid * roots).T)[0].T / roots
    rigid_count = len(fixed)
    largest_size = min(
        VECTORS_PER_MODE * count + MORE_VECTORS, int(np.count_nonzero(mass)) - rigid_count
    )
    basis = np.concatenate([fixed, np.empty((largest_size, len(mass)))])
    diagonal, beside = np.zeros((2, largest_size))  # K^-1 M in the basis is tridiagonal
    vector, _ = _orthogonalised(static, fixed, mass)
    before = np.empty(0)
    for size in range(1, largest_size + 1):
        last, krylov = rigid_count + size - 1, basis[rigid_count : rigid_count + size]
        basis[last] = vector / _norm(vector, mass)
        vector = tangent.approximate(mass * basis[last])
        norm_before = _norm(vector, mass)
        vector, parts = _orthogonalised(vector, basis[: last + 1], mass)
        diagonal[size - 1] = parts[-1]
        norm_left = _norm(vector, mass)
        beside[size - 1] = norm_left
        is_exhausted = norm_left <= EXHAUSTED * norm_before
        if not is_exhausted and size < largest_size and (size < count or size % LOOK):
            continue
        loads = np.einsum("ij,j", krylov, load)
        values, vectors = _moved_eigenvectors(diagonal[:size], beside[: size - 1], loads)
        deflections = np.einsum("ij,i", vectors, loads)
        shares = deflections**2 * values
        error = norm_left * np.abs(vectors[-1])
        is_unconverged = (error > CONVERGED * values) & (shares > UNMOVED * compliance)
        converged = int(is_unconverged.argmax()) if is_unconverged.any() else len(values)
        shares[converged:] = 0.0
        shares[values * stiffest < 1.0] = 0.0
        order = np.argsort(-shares, kind="stable")[:count]
        order = order[shares[order] > least * compliance]
        # Modes beyond the converged ones can be ignored if all their shares together are smaller
        # than the selected shares, if each is smaller (assuming that none moves more than a
        # converged mode), or if they are too stiff.
        is_full = len(order) == count
        rest_is_small = compliance - shares.sum() <= (
            shares[order[-1]] if is_full else least * compliance
        )
        others_are_smaller = (
            is_full
            and (deflections[:converged] ** 2).max() * values[converged - 1] <= shares[order[-1]]
        )
        others_are_stiffer = (
            converged < len(values) and (values[converged] + error[converged]) * stiffest < 1.0
        )
        is_unchanged = len(before) == len(order) and np.allclose(
            before, values[order], CONVERGED, 0.0
        )
        if (
            is_exhausted
            or rest_is_small
            or (is_unchanged and (others_are_smaller or others_are_stiffer))
        ):
            signs = np.where(deflections[order] < 0.0, -1.0, 1.0)
            shapes = (signs * vectors[:, order]).T @ krylov
            return ReducedModes(
                1.0 / values[order],
                shapes.T,
                np.abs(deflections[order]),
                compliance,
                static,
                load,
            )
        before = values[order]
    raise ReductionError(f"{count} modes did not converge; take fewer")


def _moved_eigenvectors(diagonal: Floats, beside: Floats, load: Floats) -> tuple[Floats, Floats]:
    """Return eigenvalues and eigenvectors of K^-1 M in the basis, by ascending frequency.

    The matrix is tridiagonal, `beside` are the numbers beside its diagonal.  `load` are the parts
    of the load along the basis.  Among modes of equal frequency only the mode that the load moves
    is kept; rounding adds the other modes to the Krylov space.
    """
    from scipy.linalg import eigh_tridiagonal  # 0.1 s, which most runs don't need

    values, vectors = eigh_tridiagonal(diagonal, beside)
    values, vectors = values[::-1], vectors[:, ::-1]
    deflections = np.einsum("ij,i", vectors, load)
    starts = np.flatnonzero(np.append(True, values[1:] < (1.0 - EQUAL) * values[:-1]))
    combined = np.add.reduceat(deflections * vectors, starts, axis=1)
    size = np.sqrt(np.add.reduceat(deflections**2, starts))
    return values[starts], combined / np.where(size > 0.0, size, 1.0)


def _orthogonalised(vector: Floats, basis: Floats, mass: Floats) -> tuple[Floats, Floats]:
    """Remove the parts of a vector along an orthonormal basis (size, neq).

    Returns the remaining vector and the removed parts, (size,).
    """
    total = np.zeros(len(basis))
    for _ in range(2):  # Gram-Schmidt, twice for orthogonality to rounding
        parts = np.einsum("ij,j", basis, mass * vector)
        vector = vector - np.einsum("i,ij", parts, basis)
        total += parts
    return vector, total


def _norm(vector: Floats, mass: Floats) -> float:
    return float(np.sqrt(np.einsum("i,i,i", vector, vector, mass)))


# Pairs of modes -----------------------------------------------------------------------------------


class Pairs(NamedTuple):
    """Integrals of the quadratic strains of the pairs of bending modes."""

    cubic: Floats  # (m, pairs): int N_i eps_q
    quartic: Floats  # (pairs, pairs): int eps_q A eps_q, u and v held
    loads: Floats  # (independent dofs of the membrane, pairs): r

    def of_first(self, modes: int) -> Pairs:
        """Return the integrals of the first modes."""
        cubic, loads = (of_first(modes, part) for part in (self.cubic[:modes], self.loads))
        return Pairs(cubic, of_first(modes, of_first(modes, self.quartic).T).T, loads)


def of_first(modes: int, values: Floats) -> Floats:
    """Return the columns (..., pairs) of the pairs of the first modes."""
    # With one more mode, its pair is the last of each first mode.
    count = (math.isqrt(8 * values.shape[1] + 1) - 1) // 2
    first, second = np.triu_indices(count)
    return np.ascontiguousarray(values[:, (first < modes) & (second < modes)])


def _free_in_plane(plate: PlateModel) -> PlateModel:
    """Return the plate with only u and v free."""
    codes = plate.mesh.codes.copy()
    codes[:, 2:] = 1
    return with_codes(plate, codes)


def bytes_of_pairs(plate: PlateModel, neq: int, modes: int) -> int:
    """Estimate the memory of the pairs: loads, solutions, and the strains of a block."""
    count = modes * (modes + 1) // 2
    elements = min(BLOCK, max(len(family.rows) for family in plate.families))
    return 8 * count * (3 * neq + 4 * elements * 3 * len(plate.rules.bending.xi))


def bytes_of_fields(plate: PlateModel, modes: int) -> int:
    """Estimate the memory of the fields: forces of the states of membrane stress, and of pairs."""
    couples = plate.is_curved or plate.is_coupled
    pairs = (modes + 1) * (modes + 2) // 2
    numbers = 2 * MOST_STATES * modes + 2 * pairs + 2 * NDOF * pairs * couples
    return 8 * len(plate.mesh.coordinates) * numbers


def _integrated(plate: PlateModel, in_plane: SymmetryReduction, shapes: Floats) -> Pairs:
    """Integrate the quadratic strains over all pairs of the modes, (neq, m).

    `in_plane` are the independent dofs of the membrane, and the elements that stand for others.
    """
    from scipy import sparse  # 0.16 s, which most runs don't need

    modes = shapes.shape[1]
    count = modes * (modes + 1) // 2
    require_memory(bytes_of_pairs(plate, in_plane.count, modes), "the reduced model of the plate")
    fields = np.stack([plate.field(shape, 0.0) for shape in shapes.T], axis=2)  # (numnp, 5, m)
    cubic, quartic = np.zeros((modes, count)), np.zeros((count, count))
    loads = np.zeros((in_plane.count, count))
    for family in plate.families:
        laminate = plate.laminate_of(family)
        represented = family.take(np.flatnonzero(in_plane.weights[family.rows]))
        for block in represented.blocks(BLOCK):
            strains = _pair_strains(plate, block, fields[block.nodes, 2])
            basis = interpolate(block, plate.rules.bending)
            linear = membrane_and_bending(basis, plate.curvature)  # (ne, points, 6, 5 nodes)
            ne, nodes = block.nodes.shape
            weight = (in_plane.weights[block.rows, None] * basis.jxw)[:, :, None, None]
            stresses = _rows(weight * (laminate.A @ strains))
            quartic += _rows(strains).T @ stresses
            if laminate.is_coupled or plate.is_curved:
                AB = np.hstack([laminate.A, laminate.B])
                mode_values = fields[block.nodes].reshape(ne, 1, nodes * NDOF, modes)
                cubic += _rows(weight * (AB @ (linear @ mode_values))).T @ _rows(strains)
            B = linear.reshape(ne, -1, 6, nodes, NDOF)[:, :, :3, :, :2].reshape(ne, -1, 2 * nodes)
            forces = B.transpose(0, 2, 1) @ stresses.reshape(ne, -1, count)
            numbers = in_plane.index[block.nodes, :2].ravel()
            signs = in_plane.sign[block.nodes, :2].ravel()
            moving = np.flatnonzero(signs)
            places = (numbers[moving], moving)
            sums = sparse.csr_array((signs[moving], places), (in_plane.count, len(numbers)))
            loads += sums @ _rows(forces)
    return Pairs(cubic, quartic, loads)


def _rows(values: Floats) -> Floats:
    """Merge all axes but the last."""
    return values.reshape(-1, values.shape[-1])


def _pair_strains(plate: PlateModel, block: ElementBlock, w: Floats) -> Floats:
    """Return eps_q(i, j), (ne, points, 3, pairs), of deflections w (ne, nodes, m).

    The sum of q_i q_j eps_q(i, j) over all pairs is eps_q of the sum of q_i w_i.
    """
    tied = QuadraticStrains(block, plate.rules.bending)
    slopes = [tied.slopes(mode_w) for mode_w in w.transpose(2, 1, 0)]
    w_1, w_2 = (np.stack(along, axis=1) for along in zip(*slopes, strict=True))  # (10, m, ne)
    i, j = np.triu_indices(w.shape[2])
    factor = np.where(i == j, 0.5, 1.0)[:, None]
    mixed = w_1[TYING:, i] * w_2[TYING:, j] + w_2[TYING:, i] * w_1[TYING:, j]
    tied_components = (
        factor * w_1[:TYING, i] * w_1[:TYING, j],
        factor * w_2[:TYING, i] * w_2[:TYING, j],
        factor * mixed,
    )
    return np.ascontiguousarray(tied.at_points(tied_components).transpose(3, 1, 0, 2))


# Relative difference of times that are the same but for rounding.
SAME_TIME = 1e-12
# Cases per matrix product.  No case depends on other cases, and the products fit the cache.
TILE = 32
# Largest number of evaluations of the law in a trial, and the relative error of the indentation.
EVALUATIONS = 40
TOLERANCE = 1e-9


class _Step(NamedTuple):
    """Numbers of a time step, (n,) each."""

    keep: Floats  # increment of a coordinate per increment before
    share: Floats  # increment per force
    rate: Floats  # velocity per sum of the increments before and after


def _step(plate: ReducedPlate, dt: float) -> _Step:
    phase = np.sqrt(plate.stiffness) * dt
    inertia = dt * dt * np.sinc(phase / (2.0 * np.pi)) ** 2  # dt^2 psi
    b = 0.5 * plate.damping * inertia / dt
    return _Step((1.0 - b) / (1.0 + b), inertia / (1.0 + b), 0.5 / (dt * np.sinc(phase / np.pi)))


class StoredTimes(NamedTuple):
    """Times at which coordinates are stored, in steps of one size, (rows,) each, ascending."""

    step: Indices  # first step that ends at or after the time, from 0
    back: Floats  # time from there to the end of the step, over the step

    @classmethod
    def of(cls, times: Floats, dt: float, steps: int) -> StoredTimes:
        """Place times in steps; times after the last step are left out."""
        in_steps = times / dt
        end = np.maximum(np.ceil(in_steps * (1.0 - SAME_TIME)).astype(np.int64), 1)
        kept = end <= steps
        return cls(end[kept] - 1, np.maximum(end[kept] - in_steps[kept], 0.0))


def motion_struct(
    plate: ReducedPlate, dt: float, stored: StoredTimes | None = None
) -> ReducedStruct:
    """Return what the compiled kernels need to move a plate by steps of one size."""
    step, back = StoredTimes.of(np.empty(0), dt, 0) if stored is None else stored
    return ReducedStruct(
        bending=plate.bending,
        coordinates=len(plate.stiffness),
        rank=len(plate.factor),
        coupled=plate.coupled,
        flexibility=plate.flexibility,
        damping=plate.damping * dt,
        stiffness=plate.stiffness,
        deflection=plate.deflection,
        factor=tiles(plate.stacked),
        transposed=tiles(plate.stacked.T),
        rows=len(step),
        step=step,
        back=back,
        **_step(plate, dt)._asdict(),
    )


class ReducedMotion:
    """Motion of a reduced plate from rest, in many cases with one time step."""

    def __init__(self, plate: ReducedPlate, dt: float, cases: int) -> None:
        self.plate, self.dt, self._cases = plate, dt, cases
        shape = (-(-cases // TILE), len(plate.stiffness), TILE)
        self._q, self._increment, self._internal = np.zeros((3, *shape))
        self._force = np.zeros((shape[0], 1, TILE))
        self._step = _Step(*(numbers[:, None] for numbers in _step(plate, dt)))
        self._damped = np.zeros((shape[0], TILE))  # energy lost by damping up to half a step ago

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

    def coordinates(self, back: float) -> Floats:
        """Return the coordinates, (cases, n), at a share `back` of the last step before its end."""
        q = (self._q - back * self._increment).swapaxes(1, 2)
        return np.asarray(q.reshape(-1, q.shape[2])[: self._cases])

    def energy(self, force: Floats) -> Floats:
        """Return the energy after the last step, (cases,), under the contact forces then.

        It is kinetic plus strain energy, plus the energy lost by damping.
        """
        square = self._square_of_velocity(self._next_increment(force))
        strain = np.array([self.plate.strain_energy(q) for q in self._q])
        damped = self._damped + 0.5 * self.plate.damping * self.dt * square
        return np.asarray((0.5 * square + strain + damped).ravel()[: self._cases])

    def _square_of_velocity(self, increment: Floats) -> Floats:
        """Return the sum of squared velocities between the last increments and other increments."""
        velocity = self._step.rate * (self._increment + increment)
        return np.asarray((velocity * velocity).sum(axis=1))

    def _next_increment(self, force: Floats) -> Floats:
        """Return the increments of the coordinates in the next step."""
        self._force.reshape(-1)[: self._cases] = force
        pull = self.plate.deflection[:, None] * self._force - self._internal
        return np.asarray(self._step.keep * self._increment + self._step.share * pull)


class SeriesLaw(NamedTuple):
    """A contact law in series with a linear spring, for many cases: the approach is a + F(a)/k_r.

    The spring is the flexibility of the modes that a reduced plate leaves out.  The contact
    iteration takes the approach for the indentation.  If the spring were a part of the plate's
    displacement instead, the iteration would not converge where the contact is stiffer than k_r.
    """

    law: Law[Floats]  # a law whose trials do not change its memory
    flexibility: float  # 1/k_r, length/force

    def start(self) -> Any:
        """Return the memory before the first contact."""
        return self.law.start()

    def of_law(self, point: ContactPoint[Floats]) -> ContactPoint[Floats]:
        """Return the point of the law, given a point with the approach as indentation."""
        return ContactPoint(point.indentation - self.flexibility * point.force, point.force)

    def trial(
        self, memory: Any, last: ContactPoint[Floats], indentation: Floats
    ) -> tuple[Floats, Any]:
        """Return the contact force at a trial approach, and the unchanged memory."""
        return self._solve(memory, last, indentation).force, memory

    def accept(self, memory: Any, last: ContactPoint[Floats], indentation: Floats) -> Any:
        """Return the memory after a step that ends at an approach."""
        law_indentation = self._solve(memory, last, indentation).indentation
        return self.law.accept(memory, self.of_law(last), law_indentation)

    def permanent(self, memory: Any, last: ContactPoint[Floats]) -> Floats:
        """Return the permanent indentation after unloading from the last point (length)."""
        return self.law.permanent(memory, self.of_law(last))

    def _solve(
        self, memory: Any, last: ContactPoint[Floats], approach: Floats
    ) -> ContactPoint[Floats]:
        """Find the law's indentation and force at an approach.

        The excess e = a + F(a)/k_r - approach grows with a.  Its zero lies between the last
        indentation and the last indentation moved as far as the approach; it also lies beyond
        a - e of each a.  The method takes secants between ends on both sides of the zero, and
        reduces the weight of an end that stays (N. Anderson and A. Bjorck, BIT 13, 1973, 253).
        """
        last_point = self.of_law(last)

        def evaluate(a: Floats) -> tuple[Floats, Floats]:
            force, _ = self.law.trial(memory, last_point, a)
            return a + self.flexibility * force - approach, force

        far_end = approach - self.flexibility * last.force
        far_excess, _ = evaluate(far_end)
        ends = last_point.indentation, far_end
        low, high = np.minimum(*ends), np.maximum(*ends)
        a = np.clip(far_end - far_excess, low, high)
        excess, force = evaluate(a)
        for _ in range(EVALUATIONS):
            solved = np.abs(excess) <= TOLERANCE * np.abs(approach)
            if solved.all():
                break
            width = np.where(solved, 1.0, excess - far_excess)
            secant = np.where(solved, a, a - excess * (a - far_end) / width)
            excess_before, a_before = excess, a
            a = secant
            excess, force = evaluate(a)
            changes_sign = excess * excess_before <= 0.0
            weight = 1.0 - excess / np.where(solved, 1.0, excess_before)
            far_excess = np.where(
                changes_sign, excess_before, far_excess * np.where(weight > 0.0, weight, 0.5)
            )
            far_end = np.where(changes_sign, a_before, far_end)
        return ContactPoint(a, force)
