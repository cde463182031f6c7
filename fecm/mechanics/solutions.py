"""Static solutions, support reactions, natural modes and buckling with sparse matrices."""

from __future__ import annotations

import math
import warnings
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fecm._errors import FecmError
from fecm._machine import require_memory
from fecm._typing import Bools, Floats, Indices
from fecm.mechanics.element_matrices import geometric_stiffness
from fecm.mechanics.interpolation import W
from fecm.mechanics.membrane import MembraneForces, tangent
from fecm.mechanics.plate import UNLOADED, PlateModel
from fecm.mechanics.supports import NodeSupports
from fecm.mechanics.symmetry import (
    SymmetryReduction,
    restrain_plane,
    symmetry_reduction,
    unreduced,
    with_codes,
)

if TYPE_CHECKING:
    from scipy import sparse
    from scipy.sparse.linalg import SuperLU


# The stiffness is considered singular if the residual relative to the load is larger.
SINGULAR = 1.0e-6
# Rounding error of balanced forces, relative to the sum of their parts.
ROUNDING = 1.0e-12
# Eigenvalue problems with fewer equations are solved with dense matrices.
DENSE = 60
# Shift of the spectrum relative to the largest eigenvalue, about half the digits of a double.  It
# makes the matrix of a plate without supports regular.
SHIFT = 1.0e-9
# Bytes of the factors of n equations without coupling, over n log2 n: an upper bound of measured
# sizes.
FACTORS = 300
MOST_ACTIVE_SETS = 50  # of one-sided supports; up to 19 were seen
# Squares of frequencies up to it are rounding errors, relative to the largest ratio of diagonal
# entries of K and M; those of rigid motions are below 1e-17.
RIGID = 1.0e-15
# Loads that are solved together.
LOADS = 4
# A rigid motion is free if its eigenvalue, relative to the largest, is smaller.
NOT_HELD = 1.0e-9


class SingularStiffnessError(FecmError, ArithmeticError):
    """The supports allow motion without strain."""

    remedy = "the plate is not restrained and has no static displacement; restrain it with BOUN"


class LiftedPlateError(SingularStiffnessError):
    """The one-sided supports that are closed allow motion without strain."""

    remedy = (
        "the one-sided supports (UNIL) that the present displacement closes do not hold the plate; "
        "press the plate on supports without gaps, or hold it with SPRI or BOUN"
    )


class ConvergenceError(FecmError, ArithmeticError):
    """Newton's method did not reach equilibrium."""

    exit_code = 1


def tangent_stiffness(
    plate: PlateModel,
    field: Floats | None,
    reduction: SymmetryReduction | None = None,
    *,
    held: bool = False,
) -> sparse.csr_array:
    """Return the stiffness about a displacement field, (numnp, 5).

    It is sparse, (neq, neq), or that of the independent dofs of a reduction. The stiffness of a
    linear plate, and at rest (`field` is None), is K. One-sided supports that are closed at the
    displacement count as springs; with `held` all are closed.
    """
    stiffness = plate.stiffness
    if plate.nonlinear and (current := field) is not None:
        weights = (reduction or unreduced(plate)).weights
        added = plate.assembled(lambda block: tangent(plate, block, current), weights)
        stiffness = (stiffness + added[:, : plate.neq]).tocsr()
    if plate.supports is not None and plate.lifts:
        at = np.zeros(plate.mesh.equations.shape) if field is None else field
        closed = held | plate.supports.closed(plate.supports.of(at))
        stiffness = stiffness + plate.spring_matrix(closed & plate.supports.is_one_sided)
    if reduction is None:
        return stiffness
    return reduction.reduced(stiffness, plate.mesh.equations > 0)


def _in_plane_motions(plate: PlateModel) -> Floats:
    """Return translations and rotation in the plane: u and v of the nodes, (numnp, 2, 3)."""
    coordinates = plate.mesh.coordinates
    x, y = ((coordinates - coordinates.mean(axis=0)) / np.ptp(coordinates, axis=0).max()).T
    motions = np.zeros((len(coordinates), 2, 3))
    motions[:, 0, 0] = motions[:, 1, 1] = 1.0
    motions[:, 0, 2], motions[:, 1, 2] = -y, x
    return motions


def rigid_in_plane(plate: PlateModel, reduction: SymmetryReduction) -> Floats:
    """Return the rigid motions in the plane that supports and symmetry leave free.

    Returns the displacements of the independent dofs, (motions, neq).
    """
    motions = _in_plane_motions(plate)
    restrained = motions[plate.mesh.equations[:, :2] == 0]
    values, vectors = np.linalg.eigh(restrained.T @ restrained)
    fields = np.zeros((*plate.mesh.equations.shape, 3))
    fields[:, :2] = motions @ vectors
    free = values <= NOT_HELD * values[-1]
    followers = reduction.gather(reduction.sign)
    symmetric = [reduction.gather(fields[:, :, n]) / followers for n in np.flatnonzero(free)]
    if not symmetric:
        return np.empty((0, reduction.count))
    # The half turn leaves the rotation alone, and the motions may be sums of it and translations.
    _, sizes, motions = np.linalg.svd(np.array(symmetric), full_matrices=False)
    return np.asarray(motions[sizes > NOT_HELD * np.sqrt(reduction.count)])


def in_plane_pins(plate: PlateModel, reduction: SymmetryReduction | None = None) -> list[int]:
    """Return the fewest independent dofs u and v, from 0, that hold the plate in its plane.

    Without a reduction they are equations.  The list is empty if the supports hold the plate.  A
    load without resultants in the plane causes no reaction at the pins: they select the rigid
    motion and change no strain.
    """
    reduction = reduction or unreduced(plate)
    in_plane = _in_plane_motions(plate)
    motions = np.zeros((*plate.mesh.equations.shape, 3))
    motions[:, :2] = in_plane
    followers = reduction.gather(reduction.sign)
    allowed = [reduction.field(reduction.gather(m) / followers) for m in np.moveaxis(motions, 2, 0)]
    prevented = motions - np.stack(allowed, axis=2)
    prevented = prevented[prevented.any(axis=2)]
    gram = prevented.T @ prevented
    pins: list[int] = []
    while True:
        values, vectors = np.linalg.eigh(gram)
        if values[0] > NOT_HELD * values[-1]:
            return pins
        moves = np.where(reduction.sign[:, :2] != 0.0, np.abs(in_plane @ vectors[:, 0]), -1.0)
        node, dof = np.unravel_index(moves.argmax(), moves.shape)
        pins.append(int(reduction.index[node, dof]))
        gram = gram + np.outer(in_plane[node, dof], in_plane[node, dof])


def factorised(matrix: sparse.csr_array) -> SuperLU:
    """Compute the LU factors of a symmetric matrix.

    Raises SingularStiffnessError if the matrix is singular.
    """
    from scipy.sparse.linalg import MatrixRankWarning, splu

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", MatrixRankWarning)
            # K is positive definite.  Pivoting would only cost fill: a factor of 40 on a plate of
            # 30 x 30 elements.
            return splu(
                matrix.tocsc(),
                permc_spec="MMD_AT_PLUS_A",
                diag_pivot_thresh=0.0,
                options={"SymmetricMode": True},
            )
    except (RuntimeError, MatrixRankWarning) as error:
        raise SingularStiffnessError(f"the stiffness is singular ({error})") from None


class Tangent:
    """Factorised stiffness about a field.

    Loads and displacements, (neq,), or (neq, loads) of many, are those of the independent dofs of a
    reduction by symmetry, and of all equations without one.  With `held` all one-sided supports are
    closed.  Rigid motions in the plane are pinned, so that they need no supports.  Raises
    SingularStiffnessError if the stiffness is singular.
    """

    def __init__(
        self,
        plate: PlateModel,
        field: Floats | None = None,
        reduction: SymmetryReduction | None = None,
        *,
        held: bool = False,
    ) -> None:
        from scipy.sparse import diags_array  # 0.2 s, which most runs don't need

        self._stiffness = pinned = tangent_stiffness(plate, field, reduction, held=held)
        # Independent dofs, from 0, that hold the plate in its plane.
        self.pins = in_plane_pins(plate, reduction)
        if self.pins:
            springs = np.zeros(pinned.shape[0])
            springs[self.pins] = pinned.diagonal()[self.pins]
            pinned = pinned + diags_array(springs, format="csr")
        self._error = LiftedPlateError if plate.lifts else SingularStiffnessError
        try:
            self._factors = factorised(pinned)
        except SingularStiffnessError as error:
            raise self._error(str(error)) from None

    def approximate(self, residual: Floats) -> Floats:
        """Return the displacement under a load, (neq,) or (neq, loads), that need not be balanced.

        Few loads are solved together: for more, BLAS wakes threads in each of the many small
        products of the solution, which takes some twenty times as long.
        """
        if residual.ndim == 1:
            return np.asarray(self._factors.solve(residual))
        pieces = range(0, residual.shape[1], LOADS)
        return np.hstack([self._factors.solve(residual[:, i : i + LOADS]) for i in pieces])

    def solve(self, residual: Floats, displacement: Floats | None = None) -> Floats:
        """Return the displacement under a load, (neq,).

        Raises SingularStiffnessError if the internal forces do not balance the load.  Close to
        equilibrium the load may be the rounding error of the forces of `displacement`, which need
        not be balanced.
        """
        change = self.approximate(residual)
        imbalance = np.abs(self._stiffness @ change - residual).max()
        limit = SINGULAR * np.abs(residual).max()
        if displacement is not None:
            rounding = ROUNDING * (abs(self._stiffness) @ np.abs(displacement)).max()
            limit = max(limit, rounding)
        if not imbalance <= limit:
            raise self._error("the stiffness is singular")
        return change


class OneSidedDofs(NamedTuple):
    """One-sided supports by dof and side: several rows of one node and side are one."""

    dofs: Indices  # independent dofs, (n,)
    side: Floats  # (n,)
    compliances: Floats  # 1/k, (n,)
    which: Indices  # of each row of supports that is one-sided

    def closed(self, u: Floats) -> Bools:
        """Return whether displacements of the independent dofs close each support, (n,)."""
        return np.asarray(self.side * u[self.dofs] >= 0.0)

    def springs(self, closed: Bools, count: int) -> Floats:
        """Return the stiffness of all independent dofs, (count,), of the supports of a mask."""
        return np.asarray(
            np.bincount(self.dofs[closed], 1.0 / self.compliances[closed], count), dtype=float
        )

    def resistance(self, G: Floats, is_open: Bools) -> Floats:
        """Return 1/k - G of open supports."""
        return np.asarray(np.diag(self.compliances[is_open]) - G[np.ix_(is_open, is_open)])

    def opened(self, G: Floats, c: Floats) -> tuple[Bools, Floats]:
        """Return the supports that the load opens, (n,), and the forces that open them.

        G and c are those of :class:`HeldTangent`.  Raises SingularStiffnessError and
        ConvergenceError.
        """
        is_open: Bools = np.zeros(len(c), dtype=bool)
        for _ in range(MOST_ACTIVE_SETS):
            resistance = self.resistance(G, is_open)
            if not _resists(resistance, self.compliances[is_open]):
                raise SingularStiffnessError("the plate tips off its one-sided supports")
            opened = np.linalg.solve(resistance, c[is_open])
            opens = self.side * (c + G[:, is_open] @ opened) < 0.0
            if np.array_equal(opens, is_open):
                return is_open, np.asarray(opened)
            is_open = opens
        raise ConvergenceError(
            "the one-sided supports (UNIL) open and close in turns after "
            f"{MOST_ACTIVE_SETS} solutions"
        )


def _one_sided_dofs(supports: NodeSupports, reduction: SymmetryReduction) -> OneSidedDofs:
    """Return the distinct pairs of a dof and a side of the one-sided supports."""
    rows = supports.select(supports.is_one_sided)
    keys = np.column_stack([reduction.index[rows.node, W], rows.side])
    pairs, which = np.unique(keys, axis=0, return_inverse=True)
    compliances = 1.0 / np.bincount(which.ravel(), rows.stiffness)
    return OneSidedDofs(pairs[:, 0].astype(np.intp), pairs[:, 1], compliances, which.ravel())


def _unit_forces(dofs: Indices, count: int) -> Floats:
    """Return unit forces on dofs, (count, dofs)."""
    unit = np.zeros((count, len(dofs)))
    unit[dofs, np.arange(len(dofs))] = 1.0
    return unit


def _resists(resistance: Floats, compliances: Floats) -> bool:
    """Return whether a plate without the opened supports is held: 1/k - G is positive definite.

    A pivot far below the compliance 1/k of its support is rounding: the plate is then free to tip.
    """
    try:
        factor = np.linalg.cholesky(resistance)
    except np.linalg.LinAlgError:
        return False
    return bool((np.diagonal(factor) ** 2 > NOT_HELD * compliances).all())


class HeldTangent(Tangent):
    """Factorised stiffness about a field, with all one-sided supports closed.

    Opening supports of the stiffness k adds the displacement

        Z (1/k - G)^-1 c,

    where Z are the displacements by unit forces on these supports, and G and c the displacements of
    the supports by the unit forces and by the load (Sherman, Morrison and Woodbury).  Supports have
    no gaps here.
    """

    supports: OneSidedDofs
    G: Floats

    def __init__(
        self, plate: PlateModel, field: Floats | None, reduction: SymmetryReduction
    ) -> None:
        super().__init__(plate, field, reduction, held=True)
        if plate.supports is not None and plate.lifts:
            self.supports = _one_sided_dofs(plate.supports, reduction)
            self._Z = self.approximate(_unit_forces(self.supports.dofs, reduction.count))
            self.G = self._Z[self.supports.dofs]

    def plate_forces(self, u: Floats) -> Floats:
        """Return the forces of the tangent, (neq,), without those of one-sided supports."""
        springs = self.supports.springs(np.ones(len(self.supports.dofs), dtype=bool), len(u))
        return np.asarray(self._stiffness @ u - springs * u)

    def opened_by(self, u: Floats) -> Bools:
        """Return the supports that a load opens, from the displacement of the held plate."""
        return self.supports.opened(self.G, u[self.supports.dofs])[0]

    def released(self, u: Floats, is_open: Bools) -> Floats:
        """Return a displacement of the held plate, (neq,), after the opening of supports."""
        resistance = self.supports.resistance(self.G, is_open)
        opened = np.linalg.solve(resistance, u[self.supports.dofs[is_open]])
        return np.asarray(u + self._Z[:, is_open] @ opened)


class StaticResponse(NamedTuple):
    """Static response of a plate to a unit force, at rest: stretching is left out.

    Attributes
    ----------
    field : ndarray (numnp, 5)
        Displacement per force.
    compliance : float
        Displacement in the direction of the force, per force.
    supports : NodeSupports or None
        The springs, and the one-sided supports that the force closes, without gaps.
    """

    field: Floats
    compliance: float
    supports: NodeSupports | None

    @property
    def gain(self) -> float:
        """Relative gain of flexibility by the stiffness of the one-sided supports.

        To first order it is the sum of r^2/(k C), with the reactions r to the unit force and the
        compliance C.
        """
        if self.supports is None:
            return 0.0
        rows = self.supports.select(self.supports.is_one_sided)
        reactions = rows.reactions(rows.of(self.field))
        return float((reactions**2 / rows.stiffness).sum()) / self.compliance


def static_response(plate: PlateModel, contact: Floats) -> StaticResponse:
    """Compute the response to a unit force, whose nodal forces are `contact`, (numnp, 5).

    One-sided supports have no gaps here, so that displacements are proportional to the force.  The
    supports that the force closes are an active set, which is found from the response of the plate
    with all supports closed (:class:`HeldTangent`).

    Raises
    ------
    SingularStiffnessError
        If the supports that are closed do not hold the plate.
    ConvergenceError
        If the active set does not settle.
    """
    # At rest u and v of a flat plate of an uncoupled laminate do not move with w.
    reduction = symmetry_reduction(replace(plate, nonlinear=False), contact)
    load = reduction.gather(contact)
    tangent = HeldTangent(plate, None, reduction)
    u = tangent.solve(load)
    supports = None if plate.supports is None else plate.supports.without_gaps()
    if supports is None or not plate.lifts:
        return StaticResponse(reduction.field(u), float(load @ u), supports)
    is_open = tangent.opened_by(u)
    displacement = tangent.released(u, is_open)
    closed = ~supports.is_one_sided
    closed[supports.is_one_sided] = ~is_open[tangent.supports.which]
    field = reduction.field(displacement)
    return StaticResponse(field, float(load @ displacement), supports.select(closed))


class WindowCompliances(NamedTuple):
    """Static displacement per force of a plate on a window, with three kinds of supports."""

    held: float  # the window holds w
    pushed: float  # the window only pushes
    clamped: float  # the window only pushes, and clamps hold w at their tips


def window_compliances(plate: PlateModel, contact: Floats, tips: Indices) -> WindowCompliances:
    """Compute the compliances of a plate whose one-sided supports are a window, (numnp, 5) forces.

    `tips` are the nodes, from 0, of the tips of clamps.  One factorisation serves the three: the
    forces that hold the tips make the clamped plate's G and c of :class:`HeldTangent`.  Raises the
    errors of :func:`static_response`.
    """
    assert plate.supports is not None
    reduction = symmetry_reduction(replace(plate, nonlinear=False), contact)
    load = reduction.gather(contact)
    tangent = Tangent(plate, reduction=reduction, held=True)
    u = tangent.solve(load)
    rows = _one_sided_dofs(plate.supports, reduction)
    dofs = np.concatenate([rows.dofs, np.unique(reduction.index[tips, W])])
    G, c, held = tangent.approximate(_unit_forces(dofs, len(load)))[dofs], u[dofs], float(load @ u)
    window, tip = np.split(np.arange(len(dofs)), [len(rows.dofs)])

    def pushed(compliance: float, G: Floats, c: Floats) -> float:
        is_open, opened = rows.opened(G, c)
        return compliance + float(c[is_open] @ opened)

    holding = np.linalg.solve(G[np.ix_(tip, tip)], G[tip]).T
    clamped = pushed(
        held - float(c[tip] @ np.linalg.solve(G[np.ix_(tip, tip)], c[tip])),
        (G - holding @ G[tip])[np.ix_(window, window)],
        (c - holding @ c[tip])[window],
    )
    return WindowCompliances(held, pushed(held, G[np.ix_(window, window)], c[window]), clamped)


def compliance(plate: PlateModel, contact: Floats) -> float:
    """Return the displacement under a unit force in the direction of the force.

    See :func:`static_response`.
    """
    return static_response(plate, contact).compliance


def static_stiffness(plate: PlateModel, contact: Floats) -> float:
    """Return force per displacement under nodal loads (numnp, 5); NaN for a plate not held."""
    try:
        return 1.0 / compliance(plate, contact)
    except SingularStiffnessError:
        return math.nan


def pull_of_supports(plate: PlateModel, response: StaticResponse, contact: Floats) -> Floats:
    """Return the force with which each node's supports pull under a static load, (numnp,).

    It is the force along the load, per force: supports push against the load.  `contact`,
    (numnp, 5), are the nodal forces of the unit load.
    """
    field, along = response.field, float(np.sign(contact[:, W].sum()))
    restrained = plate.mesh.equations[:, W] == 0
    forces = np.where(restrained, plate.internal_forces(field)[:, W], 0.0)
    if response.supports is not None:
        on_w = response.supports.select(response.supports.dof == W)
        forces -= on_w.forces(field)[:, W] * ~restrained
    return np.maximum(along * forces, 0.0)


def reactions(plate: PlateModel, field: Floats, factor: float) -> Floats:
    """Return internal minus applied forces, (numnp, 5).

    They are the forces of the supports at restrained dofs, and the residual elsewhere.
    """
    internal = plate.internal_forces(field)
    if plate.nonlinear:
        internal += MembraneForces(plate).forces(field)[0]
    free = plate.mesh.equations > 0
    internal[free] -= factor * plate.mesh.forces[free]
    return internal


class Modes(NamedTuple):
    """The lowest modes of a plate, K x = omega^2 M x."""

    angular_frequency: Floats  # (n,): ascending, 1/time; 0 for rigid motions
    shapes: Floats  # (n, neq): unit modal mass; the largest entry is positive


def modes(plate: PlateModel, count: int, *, consistent: bool, field: Floats | None = None) -> Modes:
    """Compute the lowest modes with the lumped or the consistent mass matrix.

    There are at most as many modes as equations.  The modes of a nonlinear plate are small motions
    about a displacement field, (numnp, 5).
    """
    # 0.2 s, which most runs don't need.
    from scipy import linalg, sparse
    from scipy.sparse.linalg import eigsh

    K = tangent_stiffness(plate, field)
    M = plate.consistent_mass if consistent else sparse.diags_array(plate.mass, format="csr")
    count = min(count, plate.neq)
    largest_ratio = float((K.diagonal() / M.diagonal()).max())
    if plate.neq < DENSE or count >= plate.neq // 2:
        values, vectors = linalg.eigh(K.toarray(), M.toarray(), subset_by_index=[0, count - 1])
    else:
        shift = -SHIFT * largest_ratio
        start = np.random.default_rng(0).standard_normal(plate.neq)
        values, vectors = eigsh(K, count, M, sigma=shift, which="LM", v0=start)
        order = np.argsort(values)
        values, vectors = values[order], vectors[:, order]
    largest = vectors[np.abs(vectors).argmax(axis=0), np.arange(count)]
    elastic = np.where(values > RIGID * largest_ratio, values, 0.0)
    return Modes(np.sqrt(elastic), (vectors * np.sign(largest)).T)


# Factors on the preload are searched from LEAST to FAR; each try changes the shift by STRIDE.
FAR = 64.0
STRIDE = 4.0
LEAST = 1.0e-9
TOLERANCE = 1.0e-9  # relative error of a factor
PRINCIPAL_FORCE_ROUNDING = 1.0e-9  # rounding of a principal force relative to the other one


def buckling_factor(plate: PlateModel) -> float:
    """Return the factor on the preload at which the plate buckles.

    The factor is the smallest positive lambda of (K + lambda K_sigma) phi = 0 with the plate's
    supports; at 1 the preload is the buckling load.  It is infinite beyond FAR, 0 where the
    supports allow motion without strain, and NaN if the matrices are not finite.  A flat plate,
    whose laminate has B = 0, buckles without u and v.

    Lanczos iteration finds the largest mu of -K_sigma phi = mu (K + shift K_sigma) phi, which is
    1/(lambda - shift).  Under tension in another direction, large negative values of mu keep the
    iteration from the largest mu unless the shift is near lambda.  K + lambda K_sigma is positive
    definite below the smallest lambda, so that trial factorisations bracket it:
    shift < lambda <= STRIDE shift.  Raises NotEnoughMemoryError.
    """
    bending = _pinned(plate) if plate.is_curved else restrain_plane(plate)
    n = bending.neq
    if not plate.is_compressed or not n:
        return math.inf
    # Memory of the factors, and of a copy from which the pivots are read.
    require_memory(int(2 * FACTORS * n * math.log2(n + 1)), "to find the buckling load")
    K = replace(bending, preload=UNLOADED).stiffness
    K_sigma = bending.assembled(
        lambda block: geometric_stiffness(block, bending.preload, bending.rules)
    )[:, :n].tocsr()
    if not (np.isfinite(K.data).all() and np.isfinite(K_sigma.data).all()):
        return math.nan
    if not K_sigma.nnz:  # w is held
        return math.inf
    if n < DENSE:
        factor = _dense_factor(K, K_sigma)
    else:
        factor = _sparse_factor(K, K_sigma, FAR if _pulls(plate) else 0.0)
    return math.inf if factor > FAR else factor


def _pinned(plate: PlateModel) -> PlateModel:
    """Return the plate without rigid motions in its plane."""
    pins = np.array(in_plane_pins(plate), dtype=int) + 1
    is_pinned = np.isin(plate.mesh.equations, pins)
    return with_codes(plate, np.where(is_pinned, 1, plate.mesh.codes).astype(np.int32))


def _pulls(plate: PlateModel) -> bool:
    """Return whether a principal value of the preload is positive beyond rounding."""
    n_x, n_y, n_xy = plate.preload
    least, largest = np.linalg.eigvalsh([[n_x, n_xy], [n_xy, n_y]])
    return bool(largest > PRINCIPAL_FORCE_ROUNDING * abs(least))


def _dense_factor(K: sparse.csr_array, K_sigma: sparse.csr_array) -> float:
    """Compute the buckling factor from all eigenvalues of -K_sigma phi = phi K/lambda."""
    from scipy import linalg

    try:
        largest = float(linalg.eigvalsh(-K_sigma.toarray(), K.toarray())[-1])
    except np.linalg.LinAlgError:  # K is not positive definite
        return 0.0
    return 1.0 / largest if largest > 0.0 else math.inf


def _sparse_factor(K: sparse.csr_array, K_sigma: sparse.csr_array, first: float) -> float:
    """Compute the buckling factor above a shift at which K + shift K_sigma is positive definite."""
    from scipy.sparse.linalg import LinearOperator, eigsh

    shift = first
    while (factors := _factors_of_positive(K + shift * K_sigma)) is None:
        shift /= STRIDE
        if shift < LEAST:
            return 0.0
    if shift == FAR:
        return math.inf
    (largest,) = eigsh(
        -K_sigma,
        1,
        K + shift * K_sigma,
        Minv=LinearOperator(K.shape, matvec=factors.solve, dtype=np.float64),
        which="LA",
        v0=np.random.default_rng(0).standard_normal(K.shape[0]),
        tol=TOLERANCE,
        return_eigenvectors=False,
    )
    return shift + 1.0 / float(largest)


def _factors_of_positive(matrix: sparse.csr_array) -> SuperLU | None:
    """Factorise a symmetric matrix; return None unless all diagonal pivots are positive."""
    try:
        factors = factorised(matrix)
    except SingularStiffnessError:
        return None
    on_diagonal = np.array_equal(factors.perm_r, factors.perm_c)
    return factors if on_diagonal and factors.U.diagonal().min() > 0.0 else None
