"""Critical time step: 2 over the largest angular frequency of the plate with its lumped mass."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from fecm._typing import Floats
from fecm.mechanics import element_matrices
from fecm.mechanics.mesh import congruence
from fecm.mechanics.plate import BLOCK, PlateModel, UnsoundPlateError
from fecm.mechanics.stiffness_product import SAFE, stiffness_operator

# Largest residual of the highest mode, relative to its eigenvalue; it bounds the error.
TOLERANCE = 1.0e-4
FEW = 20  # fewer equations are solved as a dense problem
MOST_STEPS = 1000  # of the iteration
BEYOND = "the stiffness is beyond the range of numbers"


def safe_time_step(model: PlateModel) -> float:
    """A lower bound of the critical time step, from the elements alone.

    The largest frequency of the plate is at most that of its unsupported elements (theorem of Irons
    and Treharne).  The bound is a few per cent below the critical step and far cheaper to compute.
    Raises UnsoundPlateError if an element's stiffness is not finite.
    """
    fastest = 0.0
    for family in model.families:
        for block in family.take(congruence(family).representatives).blocks(BLOCK):
            laminate = model.laminate_of(block)
            mass = element_matrices.lumped_mass(block, laminate, model.rules.bending)
            scale = 1.0 / np.sqrt(mass.reshape(len(block.rows), -1))
            with np.errstate(all="ignore"):
                scaled = model.stiffness_of(block) * scale[:, :, None] * scale[:, None, :]
            if not np.isfinite(scaled).all():
                raise UnsoundPlateError(BEYOND)
            fastest = max(fastest, float(np.linalg.eigvalsh(scaled)[:, -1].max()))
    return 2.0 / float(np.sqrt(fastest))


def taken_time_step(critical: float) -> float:
    """Time step of DT 0: 0.9 of the critical one, rounded to three digits."""
    return float(f"{SAFE * critical:.3g}")


def rounded_time_step(critical: float) -> float:
    """Time step of ``fecm new``: 0.9 of the critical one, rounded down to two digits."""
    limit = SAFE * critical
    unit = 10.0 ** (math.floor(math.log10(limit)) - 1)
    return float(f"{math.floor(limit / unit) * unit:.1e}")


def critical_time_step(model: PlateModel, spring: tuple[Floats, float] | None = None) -> float:
    """Critical time step of the central differences, with a relative error of at most 5e-5.

    Lanczos iteration, without assembling the stiffness.  A spring to ground has weights, (neq,),
    and a stiffness (force/length).  Raises UnsoundPlateError if the stiffness is not finite or the
    iteration fails.
    """
    product = stiffness_operator(model)
    with np.errstate(all="ignore"):
        scale = 1.0 / np.sqrt(model.mass)

    def scaled(x: Floats) -> Floats:
        with np.errstate(all="ignore"):
            y = np.asarray(scale * product(scale * x.ravel()))
            if spring is not None:
                weights = scale * spring[0]
                y += spring[1] * float((weights * x.ravel()).sum()) * weights
            return y

    # Fractions of multiples of the golden ratio: no mode of a plate is orthogonal to them.
    start = np.arange(1.0, model.neq + 1.0) * 0.6180339887498949 % 1.0 - 0.5
    if not np.isfinite(scaled(start)).all():
        raise UnsoundPlateError(BEYOND)
    if model.neq < FEW:
        matrix = np.column_stack([scaled(column) for column in np.eye(model.neq)])
        return 2.0 / float(np.sqrt(np.linalg.eigvalsh(matrix)[-1]))
    with np.errstate(all="ignore"):
        return 2.0 / math.sqrt(_largest_eigenvalue(scaled, start))


def _largest_eigenvalue(product: Callable[[Floats], Floats], start: Floats) -> float:
    """Largest eigenvalue of a symmetric operator by Lanczos iteration."""
    # Without reorthogonalisation, whose lack only repeats converged eigenvalues.
    q, before, beta = start / _norm(start), np.zeros_like(start), 0.0
    diagonal: list[float] = []
    beside: list[float] = []
    for step in range(1, MOST_STEPS + 1):
        z = product(q) - beta * before
        diagonal.append(float((q * z).sum()))
        z -= diagonal[-1] * q
        beta = _norm(z)
        if not math.isfinite(beta):
            raise UnsoundPlateError(BEYOND)
        if step % 10 == 0 or beta <= TOLERANCE**2 * diagonal[-1]:
            matrix = np.diag(diagonal) + np.diag(beside, 1) + np.diag(beside, -1)
            values, vectors = np.linalg.eigh(matrix)
            if beta * abs(vectors[-1, -1]) <= TOLERANCE * values[-1]:
                return float(values[-1])
        beside.append(beta)
        q, before = z / beta, q
    raise UnsoundPlateError(f"no largest frequency was found in {MOST_STEPS} steps")


def _norm(x: Floats) -> float:
    """Euclidean norm, the same for any number of threads."""
    return math.sqrt(float((x * x).sum()))
