"""A nonlinear plate in a few coordinates, and its motion under the contact forces of many impacts.

All impacts are at one place.  The deflection is a sum of Ritz vectors q_i phi_i of bending, which
diagonalise stiffness and mass of the plate at rest.  Their space has the Lanczos vectors of the
load, which start with the static displacement (B. Nour-Omid and R. W. Clough, Earthquake
Engineering & Structural Dynamics 12, 1984, 565), and some static deflections of the stretching
plate.  The first vectors are modes.  The others take the energy that the modes left out would carry
away from the load, and let the plate under the load stretch as it does statically.  The fastest
vectors, which have hardly any compliance, follow the contact force F statically.  They add F/k_r to
the displacement under the load:

    W = sum g_i q_i + F/k_r,    1/k_r = 1/k_b - sum g_i^2/omega_i^2,

with the displacement g_i of a vector under the load and the static stiffness k_b of the linear
plate there.  Each vector adds g_i^2/omega_i^2 to the static compliance.  Vectors of frequencies at
which plate theory ends are scaled: this gives them mass and keeps their compliance.

The membrane sees the projection of the deflection on few shapes of unit stiffness, z = P q: the
vectors of the largest shares in the static compliance, and the static deflections.  The projection
is orthogonal in the stiffness, so that a static deflection in the space of the shapes is exact.
The displacements u and v follow from s_ij = z_i z_j (A. A. Muravyov and S. A. Rizzi,
Computers & Structures 81, 2003, 1513).  Here they are computed with the element matrices instead of
a fit:

    u, v = U z + sum over i <= j of u_ij s_ij,    K_mm U = -K_mb phi,    K_mm u_ij = -r_ij,
    r_ij = int B_m' A eps_q(i, j),

where eps_q(i, j) is the part of the quadratic strains (:mod:`~fecm.mechanics.membrane`) that
belongs to s_ij.  The strain energy is

    1/2 sum omega_i^2 q_i^2 + z' C s + 1/2 s' Q s,    Q = int eps_ij A eps_kl,
    C_i,kl = int N_i eps_q(k, l),    eps_ij = eps_q(i, j) + B_m u_ij,

with the membrane force N_i = A (B_m U_i + w_i/R) + B kappa_i of a shape; U and C are zero unless
the laminate or a curvature couples bending and stretching.

A static membrane has no inertia.  This matters where the edges are free in the plane: the lowest
membrane modes are then hardly faster than those of bending.  Ritz vectors psi_k of the membrane,
under the pull of a static deflection, are therefore coordinates as well.  A coordinate q_k of such
a vector adds the row psi_k' r to C, and the term (psi_k' r)' (psi_k' r)/Omega_k^2 to Q, which
cancels the static displacement of the vector.

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

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

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
from fecm.mechanics.quick_models import equilibria
from fecm.mechanics.solutions import (
    ConvergenceError,
    SingularStiffnessError,
    Tangent,
    rigid_in_plane,
)
from fecm.mechanics.symmetry import (
    SymmetryReduction,
    symmetry_reduction,
    unreduced,
    with_codes,
)

if TYPE_CHECKING:
    from scipy import sparse

# Lanczos vectors per vector that the membrane sees.
VECTORS = 4
# The Krylov space is complete if a new vector is smaller relative to the last vector.
EXHAUSTED = 1e-12
# A load, or a shape, does not move a vector whose share in the static compliance is smaller.
UNMOVED = 1e-10
# Vectors are independent, and a shape is new, if the energy beside the others is larger, over the
# own one.
INDEPENDENT, NEW = 1e-9, 1e-7
# Share of the static compliance that is left to the spring; faster coordinates cost time steps.
SPRING = 1e-4
# Largest frequency of a coordinate, over that of shear through the thickness.  Faster coordinates
# would cost time steps, and follow statically: they get more mass.
CUT_OFF = 0.3
# Lanczos vectors of the membrane, and the least share in the static compliance of a coordinate.
MEMBRANE_VECTORS, MEMBRANE_SHARE = 12, 1e-3
# Static deflections, over the thickness, whose shapes the plate has: the first, and the next ones
# over the one before, up to the largest.
FIRST_BENT, NEXT_BENT, BENT = 1.0, 1.2, 2.0
MOST_STATIC = 3  # shapes of static deflections beside the modes, unless equilibria are hard to find
# Error of B' B in the displacement that the stretching takes from a static one under the load,
# relative to the largest.  It is the largest error of deflections whose shapes scatter about the
# static ones, by a share of each, and that reach from a part of the largest.
STRETCHING = 1e-4
SCATTER, SMALLEST, DEFLECTIONS = 0.5, 0.2, 200
# Least size of displacements in the plane that a field has, over the largest.
IN_PLANE = 1e-3


class ReductionError(FecmError, ArithmeticError):
    """The plate has no reduced model."""


class RitzVectors(NamedTuple):
    """Vectors that diagonalise mass and stiffness, as modes do, with unit modal mass."""

    stiffness: Floats  # (n,): squares of the angular frequencies
    shapes: Floats  # (neq, n)
    deflection: Floats  # (n,): displacement under a unit load; positive

    @property
    def shares(self) -> Floats:
        """Static displacement of each vector under the unit load, (n,)."""
        return np.asarray(self.deflection**2 / self.stiffness)

    def slowed(self, most: float) -> RitzVectors:
        """Return vectors whose angular frequency is at most `most`: faster ones get more mass.

        Their static displacements remain.
        """
        factor = np.minimum(1.0, most / np.sqrt(self.stiffness))
        return RitzVectors(
            factor**2 * self.stiffness, factor * self.shapes, factor * self.deflection
        )

    def select(self, rows: Indices) -> RitzVectors:
        """Return some of the vectors."""
        return RitzVectors(self.stiffness[rows], self.shapes[:, rows], self.deflection[rows])


@dataclass(frozen=True)
class ReducedPlate:
    """A plate in n coordinates: first those of bending, then those of the membrane.

    The membrane sees the amplitudes z = P q of some shapes, m of them.  Arrays over pairs have an
    entry for each of the m (m + 1)/2 pairs i <= j of shapes.
    """

    stiffness: Floats  # (n,): squares of the angular frequencies
    deflection: Floats  # (n,): displacement under the load; 0 for membrane modes
    flexibility: float  # 1/k_r: displacement that no coordinate has, per force
    part: Floats  # P, (m, coordinates of bending)
    cubic: Floats  # C, (m + membrane modes, pairs)
    factor: Floats  # B, (rank, pairs): Q = B' B
    damping: float = 0.0  # a of the damping matrix a M
    fields: ReducedFields | None = None  # where displacement fields are asked for

    @property
    def bending(self) -> int:
        """Number of coordinates of bending."""
        return int(self.part.shape[1])

    @property
    def shapes(self) -> int:
        """Number of shapes that the membrane sees."""
        return len(self.part)

    @property
    def fastest(self) -> float:
        """Largest angular frequency of bending."""
        return float(np.sqrt(self.stiffness[: self.bending].max()))

    @cached_property
    def _pairs(self) -> tuple[Indices, Indices]:
        """Shapes i and j of the pairs."""
        first, second = np.triu_indices(self.shapes)
        return first, second

    @cached_property
    def coupled(self) -> int:
        """First row of C that is not 0, or the number of rows."""
        rows = np.flatnonzero(self.cubic.any(axis=1))
        return int(rows[0]) if len(rows) else len(self.cubic)

    @cached_property
    def stacked(self) -> Floats:
        """B over the rows of C from :attr:`coupled` on."""
        return np.vstack([self.factor, self.cubic[self.coupled :]])

    @cached_property
    def _tables(self) -> tuple[Floats, Floats, Floats, Floats]:
        """B over C and its transpose, and the sums over the pairs of each shape i and j."""
        shapes = np.arange(self.shapes)[:, None]
        of_first, of_second = ((index == shapes).astype(float) for index in self._pairs)
        return self.stacked, self.stacked.T.copy(), of_first, of_second

    def _seen(self, q: Floats) -> Floats:
        """Return the amplitudes of the shapes, and of the membrane modes."""
        return np.concatenate([self.part @ q[: self.bending], q[self.bending :]])

    def strain_energy(self, q: Floats) -> Floats:
        """Return the strain energy, (cases,), of coordinates (n, cases)."""
        first, second = self._pairs
        z = self._seen(q)
        s = z[first] * z[second]
        linear = 0.5 * (self.stiffness[:, None] * q * q).sum(axis=0)
        coupled = (z * (self.cubic @ s)).sum(axis=0)
        return np.asarray(linear + coupled + 0.5 * ((self.factor @ s) ** 2).sum(axis=0))

    def internal_forces(self, q: Floats) -> Floats:
        """Return the derivatives of the strain energy with respect to coordinates (n, cases)."""
        stacked, transposed, of_first, of_second = self._tables
        rank, coupled, m = len(self.factor), self.coupled, self.shapes
        z = self._seen(q)
        first, second = (z[index] for index in self._pairs)
        of_rows = stacked @ (first * second)
        seen = np.zeros_like(z)
        seen[coupled:] = of_rows[rank:]
        of_rows[rank:] = z[coupled:]
        n = transposed @ of_rows
        second *= n
        first *= n
        seen[:m] += of_first @ second + of_second @ first
        forces = self.stiffness[:, None] * q
        forces += np.concatenate([self.part.T @ seen[:m], seen[m:]])
        return forces


@dataclass(frozen=True)
class ReducedFields:
    """Displacement fields of a reduced plate, from its coordinates and the contact force."""

    part: Floats  # P, see :class:`ReducedPlate`
    moving: Floats  # (n + 1, numnp, 5): of the coordinates, and of the spring under a unit force
    in_plane: Floats  # (rank, numnp, 2)
    factor: Floats  # (rank, pairs)

    @property
    def count(self) -> int:
        """Number of amplitudes."""
        return len(self.moving) + len(self.in_plane)

    def amplitudes(self, q: Floats, force: Floats) -> Floats:
        """Return the amplitudes, (rows, count), of coordinates (rows, n) and forces (rows,).

        They are those of :attr:`moving` and :attr:`in_plane`.
        """
        z = small_products(q[:, : self.part.shape[1]], self.part.T)
        first, second = np.triu_indices(len(self.part))
        pairs = np.asarray(z[:, first] * z[:, second])
        return np.column_stack([q, force, small_products(pairs, self.factor.T)])

    @cached_property
    def _tables(self) -> tuple[Floats, Floats]:
        """Moving shapes of w and the rotations, and shapes of u and v, in rows."""
        bent = self.moving[:, :, 2:].reshape(len(self.moving), -1)
        in_plane = np.concatenate([self.moving[:, :, :2], self.in_plane])
        return bent, in_plane.reshape(len(in_plane), -1)

    def fields(self, amplitudes: Floats) -> Floats:
        """Return displacement fields, (rows, numnp, 5)."""
        bent, in_plane = self._tables
        rows, numnp = len(amplitudes), self.moving.shape[1]
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
    """Reduce a plate under a load (numnp, 5), whose membrane sees `count` Ritz vectors at most.

    It also sees some static deflections.

    `error` is the error of B, see :data:`STRETCHING`.  With `has_fields` the plate also has its
    displacement fields.  Raises ReductionError if the plate is not held.
    """
    free = plate.mesh.equations > 0
    load = contact[free]
    krylov = bending_vectors(plate, contact, VECTORS * count)
    linear = krylov[0]
    compliance = float(load @ linear)
    plane = _free_in_plane(plate)
    # Shapes that a half turn maps onto themselves have quadratic strains that it maps likewise.
    is_half = _at_rest(plate, contact).is_half
    in_plane = symmetry_reduction(plane, None) if is_half else unreduced(plane)
    tangent = Tangent(plane, reduction=in_plane) if plane.neq else None
    bent = [linear, *_bent_plates(plate, contact, tangent, in_plane)]
    vectors = ritz_vectors(plate.stiffness, _bending_mass(plate), load, [*krylov[1:], *bent])
    modes = vectors.select(np.argsort(-vectors.shares, kind="stable")[:count])
    modes = modes.select(np.flatnonzero(modes.shares > UNMOVED * compliance))
    seen = modes.shapes / np.sqrt(modes.stiffness)
    seen = np.hstack([seen, _beside(plate, seen, bent)])
    part = (plate.stiffness @ seen).T @ vectors.shapes
    # Rounding adds vectors that neither the load nor the membrane moves.
    squares = np.vstack([vectors.shares / compliance, part**2 / vectors.stiffness])
    vectors = vectors.select(np.flatnonzero(squares.max(axis=0) > UNMOVED))
    coordinates = _slowest(vectors, compliance)
    stiffest, fastest = coordinates.stiffness.max(), CUT_OFF * _cut_off(plate)
    coordinates = coordinates.slowed(fastest)
    part = (plate.stiffness @ seen).T @ coordinates.shapes
    # Largest amplitude of each shape in the static deflections.
    force = BENT * plate.thicknesses.max() / compliance
    static = np.array([force * linear, *bent[1:]]) @ (plate.stiffness @ seen)
    size = np.abs(static).max(axis=0)

    pairs = _integrated(plate, in_plane, seen)
    cubic, quartic = pairs.cubic, pairs.quartic
    membrane, followed = np.empty(0), np.zeros_like(pairs.loads)
    across = np.empty((0, *contact.shape))
    if tangent is not None:
        followed = -tangent.solve(pairs.loads)
        quartic += pairs.loads.T @ followed
        first, second = np.triu_indices(seen.shape[1])
        pull = pairs.loads @ (static[-1][first] * static[-1][second])
        moved = _membrane_vectors(plane, in_plane, tangent, pull)
        moved = moved.select(np.flatnonzero(moved.stiffness <= stiffest)).slowed(fastest)
        rows = moved.shapes.T @ pairs.loads
        quartic += (rows.T / moved.stiffness) @ rows
        cubic = np.concatenate([cubic, rows])
        followed += (moved.shapes / moved.stiffness) @ rows
        membrane = moved.stiffness
        across = np.array([in_plane.field(shape) for shape in moved.shapes.T]).reshape(
            -1, *contact.shape
        )
    fields = None
    if has_fields:
        factor, few = _few(followed, size)
        spring = linear - coordinates.shapes @ (coordinates.deflection / coordinates.stiffness)
        moving = [plate.field(shape, 0.0) for shape in [*coordinates.shapes.T, spring]]
        displacements = np.array([in_plane.field(vector) for vector in few.T])
        fields = ReducedFields(
            part=part,
            moving=np.concatenate([moving[:-1], across, moving[-1:]]),
            in_plane=displacements.reshape(-1, *contact.shape)[..., :2].copy(),
            factor=factor,
        )
    return ReducedPlate(
        stiffness=np.append(coordinates.stiffness, membrane),
        deflection=np.append(coordinates.deflection, np.zeros(len(membrane))),
        flexibility=max(compliance - float(coordinates.shares.sum()), 0.0),
        part=part,
        cubic=cubic,
        factor=factor_of((quartic + quartic.T) / 2.0, size, error),
        damping=damping,
        fields=fields,
    )


def _cut_off(plate: PlateModel) -> float:
    """Return the lowest angular frequency of shear through the thickness, where plate theory ends.

    In it rotations vibrate against the transverse shear stiffness (R. D. Mindlin, Journal of
    Applied Mechanics 18, 1951, 31).
    """
    return min(
        float(np.sqrt(np.linalg.eigvalsh(laminate.shear)[-1] / laminate.rotary_inertia))
        for laminate in plate.laminates
    )


def _bent_plates(
    plate: PlateModel, contact: Floats, tangent: Tangent | None, in_plane: SymmetryReduction
) -> list[Floats]:
    """Return static deflections of the stretching plate, (neq,), up to :data:`BENT`.

    u and v are those of the linear plate.  There are fewer if an equilibrium is not found.
    """
    h, free = plate.thicknesses.max(), plate.mesh.equations > 0
    shapes: list[Floats] = []
    with suppress(ConvergenceError, SingularStiffnessError):
        for point, field in equilibria(plate, contact, FIRST_BENT * h, NEXT_BENT):
            if point.deflection == 0.0:
                continue
            field[:, :2] = 0.0
            if tangent is not None:
                forces = np.zeros_like(field)
                forces[free] = plate.stiffness @ field[free]
                field = field - in_plane.field(tangent.approximate(in_plane.gather(forces)))
            shapes.append(field[free])
            if point.deflection >= BENT * h:
                break
    return shapes


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


# Ritz vectors -------------------------------------------------------------------------------------


def ritz_vectors(
    stiffness: sparse.csr_array, mass: Floats, load: Floats, basis: Sequence[Floats] | Floats
) -> RitzVectors:
    """Return the Ritz vectors of a stiffness and masses (neq,) in the span of vectors (n, neq)."""
    vectors = np.transpose(basis)
    vectors = vectors / np.sqrt(np.einsum("ij,ij->j", vectors, stiffness @ vectors))
    vectors = vectors @ _unit(vectors.T @ (stiffness @ vectors), INDEPENDENT)
    values, turned = np.linalg.eigh((mass[:, None] * vectors).T @ vectors)
    shapes = vectors @ (turned / np.sqrt(values))
    deflection = np.einsum("ij,i", shapes, load)
    shapes = shapes * np.where(deflection < 0.0, -1.0, 1.0)
    return RitzVectors(1.0 / values, shapes, np.abs(deflection))


def _slowest(vectors: RitzVectors, compliance: float) -> RitzVectors:
    """Return the slowest vectors that have the compliance but for a share :data:`SPRING`."""
    order = np.argsort(vectors.stiffness)
    of_spring = compliance - np.cumsum(vectors.shares[order])
    return vectors.select(order[: np.count_nonzero(of_spring > SPRING * compliance) + 1])


def _unit(gram: Floats, least: float) -> Floats:
    """Return the combinations of vectors with a Gram matrix that make unit vectors.

    Combinations whose square is at most `least` are left out.
    """
    values, vectors = np.linalg.eigh((gram + gram.T) / 2.0)
    kept = values > least
    return np.asarray(vectors[:, kept] / np.sqrt(values[kept]))


def _beside(plate: PlateModel, basis: Floats, shapes: list[Floats]) -> Floats:
    """Return vectors of unit stiffness for what shapes (neq,) add to such a basis (neq, n)."""
    added = np.stack(shapes, axis=1)
    added = added / np.sqrt(np.einsum("ij,ij->j", added, plate.stiffness @ added))
    for _ in range(2):  # Gram-Schmidt, twice for orthogonality to rounding
        added = added - basis @ (basis.T @ (plate.stiffness @ added))
    return np.asarray(added @ _unit(added.T @ (plate.stiffness @ added), NEW))


def bending_vectors(plate: PlateModel, contact: Floats, count: int) -> list[Floats]:
    """Return up to `count` Lanczos vectors of bending, (neq,), and first the static displacement.

    The load is (numnp, 5).  The masses are lumped.  The masses of u and v are left out, so that u
    and v follow statically.  Raises ReductionError if the plate is not held.
    """
    reduction, free = _at_rest(plate, contact), plate.mesh.equations > 0
    try:
        tangent = Tangent(plate, reduction=reduction)
        static = tangent.solve(reduction.gather(contact))
    except SingularStiffnessError as error:
        raise ReductionError(f"a reduced model needs a plate that is held: {error}") from None
    mass = _independent_mass(plate, reduction, _bending_mass(plate))
    vectors = [static, *lanczos(tangent, mass, static, count)]
    return [reduction.field(vector)[free] for vector in vectors]


def _at_rest(plate: PlateModel, contact: Floats) -> SymmetryReduction:
    """Return the dofs that move independently in small motions about the plate at rest."""
    return symmetry_reduction(replace(plate, nonlinear=False), contact)


def _bending_mass(plate: PlateModel) -> Floats:
    """Return the masses without those of u and v, (neq,)."""
    mass = plate.field(plate.mass, 0.0)
    mass[:, :2] = 0.0
    return np.asarray(mass[plate.mesh.equations > 0])


def _independent_mass(plate: PlateModel, reduction: SymmetryReduction, mass: Floats) -> Floats:
    """Sum the masses (neq,) over the dofs that follow each independent one."""
    return reduction.gather(reduction.sign * plate.field(mass, 0.0))


def _membrane_vectors(
    plane: PlateModel, reduction: SymmetryReduction, tangent: Tangent, pull: Floats
) -> RitzVectors:
    """Return Ritz vectors of the membrane under a load, in its independent dofs."""
    mass = _independent_mass(plane, reduction, plane.mass)
    rigid, roots = rigid_in_plane(plane, reduction), np.sqrt(mass)
    rigid = np.linalg.qr((rigid * roots).T)[0].T / roots
    vectors = lanczos(tangent, mass, tangent.solve(pull), MEMBRANE_VECTORS, rigid)
    stiffness = reduction.reduced(plane.stiffness, plane.mesh.equations > 0)
    moved = ritz_vectors(stiffness, mass, pull, vectors)
    return moved.select(np.flatnonzero(moved.shares > MEMBRANE_SHARE * moved.shares.sum()))


def lanczos(
    tangent: Tangent, mass: Floats, static: Floats, count: int, fixed: Floats | None = None
) -> Floats:
    """Return up to `count` Lanczos vectors, (size, neq), from a static displacement (neq,).

    Vectors are those of the tangent's independent dofs.  They are orthogonal to `fixed`, (n, neq),
    which are orthonormal: modes, or motions without strain on which the load does no work.  The
    iteration is that with K^-1 M (B. Nour-Omid and R. W. Clough, Earthquake Engineering &
    Structural Dynamics 12, 1984, 565).  Products of a matrix and a vector are sums by einsum: BLAS
    would wake threads for each.
    """
    fixed = np.empty((0, len(mass))) if fixed is None else fixed
    start = len(fixed)
    end = min(start + count, int(np.count_nonzero(mass)))
    basis = np.concatenate([fixed, np.empty((end - start, len(mass)))])
    vector, last, before = _orthogonalised(static, fixed, mass), start, 0.0
    while last < end and (norm := _norm(vector, mass)) > EXHAUSTED * before:
        basis[last] = vector / norm
        vector = tangent.approximate(mass * basis[last])
        before = _norm(vector, mass)
        last += 1
        vector = _orthogonalised(vector, basis[:last], mass)
    return basis[start:last]


def _orthogonalised(vector: Floats, basis: Floats, mass: Floats) -> Floats:
    """Remove the parts of a vector along an orthonormal basis (size, neq)."""
    for _ in range(2):  # Gram-Schmidt, twice for orthogonality to rounding
        parts = np.einsum("ij,j", basis, mass * vector)
        vector = vector - np.einsum("i,ij", parts, basis)
    return vector


def _norm(vector: Floats, mass: Floats) -> float:
    return float(np.sqrt(np.einsum("i,i,i", vector, vector, mass)))


# Pairs of modes -----------------------------------------------------------------------------------


class Pairs(NamedTuple):
    """Integrals of the quadratic strains of the pairs of shapes."""

    cubic: Floats  # (m, pairs): int N_i eps_q
    quartic: Floats  # (pairs, pairs): int eps_q A eps_q, u and v held
    loads: Floats  # (independent dofs of the membrane, pairs): r


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
        membrane=len(plate.stiffness) - plate.bending,
        shapes=plate.shapes,
        rank=len(plate.factor),
        coupled=plate.coupled,
        flexibility=plate.flexibility,
        damping=plate.damping * dt,
        stiffness=plate.stiffness,
        deflection=plate.deflection,
        part=tiles(plate.part),
        spread=tiles(plate.part.T),
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
