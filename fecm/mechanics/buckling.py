"""Buckling of a plate under its preload."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from fecm._memory import require
from fecm.mechanics.element_matrices import geometric_stiffness
from fecm.mechanics.plate import UNLOADED, PlateModel
from fecm.mechanics.solutions import (
    DENSE,
    FACTORS,
    SingularStiffnessError,
    factorised,
    in_plane_pins,
)
from fecm.mechanics.symmetry import restrain_plane, with_codes

if TYPE_CHECKING:
    from scipy import sparse
    from scipy.sparse.linalg import SuperLU

# Factors on the preload that are computed: from the least on, in strides, up to one that is far
# away.
FAR = 64.0
STRIDE = 4.0
LEAST = 1.0e-9
TOLERANCE = 1.0e-9  # relative error of a factor
ROUNDING = 1.0e-9  # of a principal force, relative to the other one


def buckling_factor(plate: PlateModel) -> float:
    """Factor on the preload at which the plate buckles; infinite beyond FAR, NaN if unknown.

    The smallest positive lambda of (K + lambda K_sigma) phi = 0 with the plate's supports: at 1 the
    preload is the buckling load.  0 where the supports allow motion without strain.  A flat plate,
    whose laminate has B = 0, buckles without u and v.

    Lanczos iteration for the largest mu of -K_sigma phi = mu (K + shift K_sigma) phi, which is
    1/(lambda - shift).  Under tension in another direction other mu are large, negative, and keep
    the iteration from the wanted one, unless the shift is near it.  K + lambda K_sigma is positive
    definite below the smallest lambda, so that its factors bracket it: shift < lambda <= STRIDE
    shift.  Raises NotEnoughMemoryError.
    """
    bending = _pinned(plate) if plate.is_curved else restrain_plane(plate)
    n = bending.neq
    if not plate.is_compressed or not n:
        return math.inf
    # The factors, and a copy of which the pivots are taken.
    require(int(2 * FACTORS * n * math.log2(n + 1)), "to find the buckling load")
    K = replace(bending, preload=UNLOADED).stiffness
    K_sigma = bending.assembled(
        lambda block: geometric_stiffness(block, bending.preload, bending.rules)
    )[:, :n].tocsr()
    if not (np.isfinite(K.data).all() and np.isfinite(K_sigma.data).all()):
        return math.nan
    if not K_sigma.nnz:  # w is held
        return math.inf
    if n < DENSE:
        found = _dense_factor(K, K_sigma)
    else:
        found = _sparse_factor(K, K_sigma, FAR if _pulls(plate) else 0.0)
    return math.inf if found > FAR else found


def _pinned(plate: PlateModel) -> PlateModel:
    """The plate without rigid motions in its plane."""
    pins = np.array(in_plane_pins(plate), dtype=int) + 1
    held = np.isin(plate.mesh.equations, pins)
    return with_codes(plate, np.where(held, 1, plate.mesh.codes).astype(np.int32))


def _pulls(plate: PlateModel) -> bool:
    """Whether a principal value of the preload is positive, beyond rounding."""
    n_x, n_y, n_xy = plate.preload
    least, largest = np.linalg.eigvalsh([[n_x, n_xy], [n_xy, n_y]])
    return bool(largest > ROUNDING * abs(least))


def _dense_factor(K: sparse.csr_array, K_sigma: sparse.csr_array) -> float:
    """Buckling factor by all eigenvalues of -K_sigma phi = phi K/lambda."""
    from scipy import linalg

    try:
        largest = float(linalg.eigvalsh(-K_sigma.toarray(), K.toarray())[-1])
    except np.linalg.LinAlgError:  # K is not positive definite
        return 0.0
    return 1.0 / largest if largest > 0.0 else math.inf


def _sparse_factor(K: sparse.csr_array, K_sigma: sparse.csr_array, first: float) -> float:
    """Buckling factor above a shift at which K + shift K_sigma is positive definite."""
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
    """Factors of a symmetric matrix; None unless all pivots, on the diagonal, are positive."""
    try:
        factors = factorised(matrix)
    except SingularStiffnessError:
        return None
    on_diagonal = np.array_equal(factors.perm_r, factors.perm_c)
    return factors if on_diagonal and factors.U.diagonal().min() > 0.0 else None
