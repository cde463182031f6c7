"""Critical time step: 2 over the largest angular frequency of the plate with its lumped mass."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress

import numpy as np

from fecm._typing import Floats, Indices
from fecm.mechanics import element_matrices
from fecm.mechanics.element_bounds import eigenvalue_bounds
from fecm.mechanics.kernels.plate import CompiledProduct
from fecm.mechanics.mesh import ElementBlock
from fecm.mechanics.plate import PlateModel, UnsoundPlateError, pieces
from fecm.mechanics.stiffness_product import SAFE, stiffness_operator

# Largest residual of the highest mode, relative to its eigenvalue; it bounds the error.
TOLERANCE = 1.0e-4
# The same after PATIENCE steps.  In a large plate of equal elements the highest frequencies are so
# close together that the number of steps to TOLERANCE grows with the plate's size.
RELAXED = 1.0e-3
PATIENCE = 100
PART = 32  # elements whose highest frequencies are computed at once
FEW = 20  # fewer equations are solved as a dense problem
MOST_STEPS = 1000  # of the iteration
ROUNDING = 1.0e-9  # of eigenvalues, at most
BEYOND = "the stiffness is beyond the range of numbers"


def safe_time_step(model: PlateModel) -> float:
    """A lower bound of the critical time step, from the elements alone.

    The largest frequency of the plate is at most that of its unsupported elements (theorem of Irons
    and Treharne).  The bound is a few per cent below the critical step for equal elements, and up
    to 20 per cent for distorted ones.  Raises UnsoundPlateError if the stiffness of one of these
    elements is not finite.
    """
    fastest = 0.0
    for family in model.families:
        unlike = family.take(family.congruence.representatives)
        # For few elements, bounds would not pay.
        many = len(unlike.rows) > PART
        bounds = eigenvalue_bounds(model, unlike) if many else np.full(len(unlike.rows), np.inf)
        highest_first = np.argsort(-bounds, kind="stable")
        for start in range(0, len(bounds), PART):
            members = highest_first[start : start + PART]
            members = members[bounds[members] >= (1.0 - ROUNDING) * fastest]
            if not len(members):
                break
            fastest = _fastest_of(model, unlike.take(members), fastest)
    return 2.0 / float(np.sqrt(fastest))


def _fastest_of(model: PlateModel, block: ElementBlock, known: float) -> float:
    """Largest eigenvalue of M^-1 K of the elements of a block, or `known` if that is larger."""
    mass = element_matrices.lumped_mass(block, model.laminate_of(block), model.rules.bending)
    scale = 1.0 / np.sqrt(mass.reshape(len(block.rows), -1))
    with np.errstate(all="ignore"):
        scaled = model.stiffness_of(block) * scale[:, :, None] * scale[:, None, :]
    if not np.isfinite(scaled).all():
        raise UnsoundPlateError(BEYOND)
    if known > 0.0:
        # A Cholesky factor, at a tenth of the cost, exists if all eigenvalues are smaller.
        with suppress(np.linalg.LinAlgError):
            np.linalg.cholesky((1.0 - ROUNDING) * known * np.eye(scaled.shape[-1]) - scaled)
            return known
    return max(known, float(np.linalg.eigvalsh(scaled)[:, -1].max()))


def taken_time_step(critical: float) -> float:
    """Time step of DT 0: 0.9 of the critical one, rounded to three digits."""
    return float(f"{SAFE * critical:.3g}")


def rounded_time_step(critical: float) -> float:
    """Time step of ``fecm new``: 0.9 of the critical one, rounded down to two digits."""
    limit = SAFE * critical
    unit = 10.0 ** (math.floor(math.log10(limit)) - 1)
    return float(f"{math.floor(limit / unit) * unit:.1e}")


def critical_time_step(model: PlateModel, spring: tuple[Floats, float] | None = None) -> float:
    """Critical time step of the central differences.

    Lanczos iteration, without assembling the stiffness.  The relative error is at most 5e-5, or
    5e-4 where 100 steps do not suffice for that; the step is then too large rather than too small.
    A spring to ground has weights, (neq,), and a stiffness (force/length).  Raises
    UnsoundPlateError if the stiffness is not finite or the iteration fails.
    """
    with np.errstate(all="ignore"):
        plate_alone, mass, places = _accelerations(model)
        product = plate_alone if spring is None else _with_spring(plate_alone, spring, mass, places)
        scale = 1.0 / np.sqrt(model.mass)

        # Fractions of multiples of the golden ratio: no mode of a plate is orthogonal to them.
        start = np.zeros(len(mass))
        start[places] = (np.arange(1.0, model.neq + 1.0) * 0.6180339887498949 % 1.0 - 0.5) * scale
        if not np.isfinite(product(start)).all():
            raise UnsoundPlateError(BEYOND)
        if model.neq < FEW:
            return 2.0 / math.sqrt(_largest_of_few(product, scale, places, len(mass)))
        return 2.0 / math.sqrt(_largest_eigenvalue(product, mass, start))


def _accelerations(model: PlateModel) -> tuple[Callable[[Floats], Floats], Floats, Indices]:
    """The product M^-1 K u in the solver's order, the masses, and the places of the equations.

    Entries without an equation have no mass and stay 0.  The next call overwrites the result.
    """
    operator = stiffness_operator(model)
    if not isinstance(operator, CompiledProduct):
        return lambda u: operator(u) / model.mass, model.mass, np.arange(model.neq)
    compiled = operator.plate
    mass = np.zeros(len(compiled.u))
    mass[compiled.position] = model.mass
    return compiled.accelerations, mass, compiled.position


def _with_spring(
    product: Callable[[Floats], Floats],
    spring: tuple[Floats, float],
    mass: Floats,
    places: Indices,
) -> Callable[[Floats], Floats]:
    """The product with the accelerations by a spring to ground."""
    held = np.flatnonzero(spring[0])
    at, weights = places[held], spring[0][held]
    share = spring[1] * weights / mass[at]

    def with_spring(u: Floats) -> Floats:
        acceleration = product(u)
        acceleration[at] += float((weights * u[at]).sum()) * share
        return acceleration

    return with_spring


def _largest_of_few(
    product: Callable[[Floats], Floats], scale: Floats, places: Indices, size: int
) -> float:
    """Largest eigenvalue of a product with few equations; `scale` is 1 over the root of M."""
    columns: list[Floats] = []
    for place, factor in zip(places.tolist(), scale.tolist(), strict=True):
        unit = np.zeros(size)
        unit[place] = factor
        columns.append(product(unit)[places] / scale)
    return float(np.linalg.eigvalsh(np.column_stack(columns))[-1])


def _largest_eigenvalue(product: Callable[[Floats], Floats], mass: Floats, start: Floats) -> float:
    """Largest eigenvalue of M^-1 K by Lanczos iteration in the inner product of the masses."""
    # Without reorthogonalisation, whose lack only repeats converged eigenvalues.
    last, before, beta = start / math.sqrt(float((mass * start * start).sum())), 0.0 * start, 0.0
    diagonal: list[float] = []
    beside: list[float] = []
    for step in range(1, MOST_STEPS + 1):
        alpha, beta = _orthogonalise(product(last), last, before, beta, mass)
        diagonal.append(alpha)
        if not math.isfinite(beta):
            raise UnsoundPlateError(BEYOND)
        if step % 10 == 0 or beta <= TOLERANCE**2 * alpha:
            matrix = np.diag(diagonal) + np.diag(beside, 1) + np.diag(beside, -1)
            values, vectors = np.linalg.eigh(matrix)
            allowed = TOLERANCE if step < PATIENCE else RELAXED
            if beta * abs(vectors[-1, -1]) <= allowed * values[-1]:
                return float(values[-1])
        beside.append(beta)
        before /= beta
        last, before = before, last
    raise UnsoundPlateError(f"no largest frequency was found in {MOST_STEPS} steps")


def _orthogonalise(
    found: Floats, last: Floats, before: Floats, beta: float, mass: Floats
) -> tuple[float, float]:
    """Overwrite `before` by `found` - beta `before` - alpha `last`; alpha, and the norm of that.

    The sums go over pieces that fit the cache, and are the same for any number of threads.
    """
    alpha, square = 0.0, 0.0
    cuts = pieces(len(mass))
    for piece in cuts:
        rest = before[piece]
        rest *= -beta
        rest += found[piece]
        alpha += float((mass[piece] * last[piece]) @ rest)
    for piece in cuts:
        rest = before[piece]
        rest -= alpha * last[piece]
        square += float((mass[piece] * rest) @ rest)
    return alpha, math.sqrt(square)
