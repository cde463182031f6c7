"""Critical time step of the plate, and upper bounds of the frequencies of single elements.

The five fields u, v, w, theta_x and theta_y of an element are scaled by the roots of their masses.
The energy of each field f at a point gets the same bound, p1 f,x^2 + p2 f,y^2 + q f^2.  A matrix
with one row per node therefore replaces a matrix with five rows per node.

Membrane and bending: their energy is g' D g with the gradients g of u, v, theta_x and theta_y.  p1
and p2 are chosen so that g' D g <= p1 |g,x|^2 + p2 |g,y|^2.

Transverse shear: (w,x - theta_x)^2 <= (1 + s) w,x^2 + (1 + 1/s) theta_x^2 for any s > 0.  s is as
large as p1 and p2 allow; besides shear, only the preload adds to the energy of w.  If shear has its
own points, its matrices of w and of the rotations are bounded separately, by w and r.  With a the
bound of everything else, the best s of an element gives the larger eigenvalue of
[[a + r, (r w)^(1/2)], [., w]].

Curvature: the strains w/R of a shallow panel are separated from the strains of u and v in the same
way.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from itertools import product
from typing import NamedTuple

import numpy as np

from fecm._typing import Floats, Indices
from fecm.mechanics import element_matrices, strains
from fecm.mechanics.element_matrices import IntegrationRules, lumped_shares
from fecm.mechanics.elements import Quadrature
from fecm.mechanics.interpolation import local_shape_functions, mapping_slopes
from fecm.mechanics.kernels.plate import CompiledProduct
from fecm.mechanics.laminate import LaminateSection
from fecm.mechanics.mesh import ElementBlock
from fecm.mechanics.plate import PlateModel, UnsoundPlateError, pieces
from fecm.mechanics.stiffness_product import SAFE, stiffness_operator
from fecm.mechanics.strains import strain_of_deflection

# Relative excess of p1 over its least value.  A smaller p1 needs a larger p2; the best value
# depends on the elements' shapes.
EXCESSES = 0.02, 0.05, 0.1, 0.2, 0.4, 0.8
# Least values of 1 + s.  A larger s needs larger p1 and p2; the best value depends on the
# thickness.
SHARES = 2.0, 4.0, 12.0
SAMPLE = 64  # number of elements that decide on the best values
ELEMENTS_AT_ONCE = 512  # number of elements whose matrices are computed at once; they fit the cache
DOUBLINGS = 3  # doublings of a matrix's exponent before the trace of its square

# Strains and curvatures per u,x v,x theta_x,x theta_y,x and per u,y v,y theta_x,y theta_y,y.
ALONG_X = np.zeros((6, 4))
ALONG_X[[0, 2, 3, 5], [0, 1, 2, 3]] = 1.0, 1.0, -1.0, -1.0
ALONG_Y = np.zeros((6, 4))
ALONG_Y[[2, 1, 5, 4], [0, 1, 2, 3]] = 1.0, 1.0, -1.0, -1.0


class Majorant(NamedTuple):
    """Coefficients that bound the energies of all fields over their masses."""

    along_x: float  # p1, length squared over time squared
    along_y: float  # p2, length squared over time squared
    value: float  # q, 1/time squared


def eigenvalue_bounds(model: PlateModel, family: ElementBlock) -> Floats:
    """Return upper bounds of the largest eigenvalue of M^-1 K of elements, (ne,), 1/time squared.

    M is the lumped mass.  A bound is infinite if numbers are out of range or the element is folded.
    """
    with np.errstate(all="ignore"):
        count = len(family.rows)
        sample = family.take(slice(0, count, -(-count // SAMPLE)))
        majorants = _majorants(model, model.laminate_of(family))
        best = min(majorants, key=lambda m: _bounds(model, sample, m).max(), default=None)
        if best is None:
            return np.full(count, np.inf)
        return np.concatenate(
            [_bounds(model, part, best) for part in family.blocks(ELEMENTS_AT_ONCE)]
        )


def _majorants(model: PlateModel, laminate: LaminateSection) -> list[Majorant]:
    """Return candidate majorants for elements of a laminate, with different p1 and p2."""
    inertia = np.array([laminate.mass, laminate.rotary_inertia])
    shear = np.zeros(2) if _has_own_points(model.rules) else _stiffest(laminate) / inertia
    tension = _largest_tension(model.preload) / inertia[0]
    strain = strain_of_deflection(model.curvature)
    rise = float(strain @ laminate.A @ strain) / inertia[0]
    candidates: list[Majorant] = []
    for (excess, (along_x, along_y)), share in product(_of_gradients(laminate), SHARES):
        of_w = max(min(along_x, along_y), tension + share * shear[0])
        spare = of_w - tension  # (1 + s) times the part of shear
        rotations = shear[1] * spare / (spare - shear[0]) if shear[0] > 0.0 else 0.0
        value = max(rotations, rise * (1.0 + 1.0 / excess))
        stretched = value / (value - rise) if rise > 0.0 else 1.0
        slopes = max(along_x * stretched, of_w), max(along_y * stretched, of_w)
        candidates.append(Majorant(*slopes, value))
    return candidates


def _of_gradients(laminate: LaminateSection) -> list[tuple[float, tuple[float, float]]]:
    """Return pairs p1, p2 of membrane and bending, each with the excess of p1."""
    stiffness = np.block([[laminate.A, laminate.B], [laminate.B, laminate.D]])
    inertia = np.repeat([laminate.mass, laminate.rotary_inertia], 2)
    scale = 1.0 / np.sqrt(inertia[:, None] * inertia)
    xx = scale * (ALONG_X.T @ stiffness @ ALONG_X)
    xy = scale * (ALONG_X.T @ stiffness @ ALONG_Y)
    yy = scale * (ALONG_Y.T @ stiffness @ ALONG_Y)
    if not np.isfinite([xx, xy, yy]).all():
        return []
    least = float(np.linalg.eigvalsh(xx)[-1])
    pairs: list[tuple[float, tuple[float, float]]] = []
    for excess in EXCESSES:
        along_x = (1.0 + excess) * least
        complement = yy + xy.T @ np.linalg.solve(along_x * np.eye(len(xx)) - xx, xy)
        pairs.append((excess, (along_x, float(np.linalg.eigvalsh(complement)[-1]))))
    return pairs


def _has_own_points(rules: IntegrationRules) -> bool:
    """Return whether transverse shear has other points than bending."""
    return rules.assumes_shear or rules.shear is not rules.bending


def _bounds(model: PlateModel, block: ElementBlock, majorant: Majorant) -> Floats:
    """Return the bounds of a block's elements, (ne,)."""
    rules = model.rules
    values, local = local_shape_functions(block, rules.bending)
    mapping = _mapping(block, local, transposed=rules.transposed_jacobian)
    metric, areas = _metric(mapping, rules.bending, majorant.along_x, majorant.along_y)
    energies = np.concatenate([metric, majorant.value * areas[:, None]], axis=1)
    table = np.concatenate([_products(local[:, 0], local[:, 1]), _outer(values)])
    shares = lumped_shares(values, areas)
    roots = 1.0 / np.sqrt(shares)
    matrices = _contract(energies, table)
    matrices *= roots[:, :, None]
    matrices *= roots[:, None, :]
    bound = _largest_eigenvalues(matrices)
    if _has_own_points(rules):
        slope_bound = bound if model.is_preloaded or model.is_curved else 0.0
        by_slopes, by_rotations = _shear_bounds(block, rules, shares, model.laminate_of(block))
        bound = _largest_of_two(
            bound + by_rotations, slope_bound + by_slopes, by_slopes * by_rotations
        )
    return np.where(np.isfinite(bound) & (areas > 0.0).all(axis=1), bound, np.inf)


def _shear_bounds(
    block: ElementBlock, rules: IntegrationRules, shares: Floats, laminate: LaminateSection
) -> Floats:
    """Bound the eigenvalues of the transverse shear of w and of the rotations, (2, ne).

    Both matrices are B' Q B with the covariant strains B at tying points; the tying points are the
    points of the rule unless strains are assumed.  Q B M^-1 B', which has two rows for a point, has
    the same eigenvalues.
    """
    nn = block.nodes.shape[1]
    if rules.assumes_shear:
        rule, transposed = strains.quadrature(block), False
        points = [strains.tying_points(nn, axis) for axis in (0, 1)]
        weights = [strains.tying_weights(nn, axis, rule) for axis in (0, 1)]
    else:
        rule, transposed = rules.shear, rules.transposed_jacobian
        points = [rule, rule]
        weights = [np.eye(len(rule.xi))] * 2
    (at_xi, of_xi), (at_eta, of_eta) = (local_shape_functions(block, tying) for tying in points)
    values = np.concatenate([at_xi, at_eta])
    local = np.concatenate([of_xi, of_eta])
    slopes = np.concatenate([of_xi[:, 0], of_eta[:, 1]])
    mapping = _mapping(block, local, transposed=transposed)
    half = len(at_xi)
    bases = np.concatenate([mapping[:, :, 0, :half], mapping[:, :, 1, half:]], axis=2)
    of_w = _contract(1.0 / shares, _outer(slopes.T)[0] / laminate.mass)
    of_rotations = _contract(1.0 / shares, _outer(values.T)[0] / laminate.rotary_inertia)
    of_rotations *= bases.swapaxes(1, 2) @ bases

    _, local = local_shape_functions(block, rule)
    metric, _ = _metric(_mapping(block, local, transposed=transposed), rule, 1.0, 1.0)
    zeros = np.zeros_like(weights[0])
    tied = np.hstack([weights[0], zeros]), np.hstack([zeros, weights[1]])
    stiffness = _contract(metric, _products(*tied))
    return _stiffest(laminate) * _largest_eigenvalues(stiffness @ np.stack([of_w, of_rotations]))


def _stiffest(laminate: LaminateSection) -> float:
    """Return an upper bound of the largest transverse shear stiffness, force/length."""
    return float(np.abs(laminate.shear).sum(axis=1).max())


def _mapping(block: ElementBlock, local: Floats, *, transposed: bool) -> Floats:
    """Return the slopes dx_i/dxi_a at points, (ne, i, a, npt); `transposed` swaps i and a."""
    slopes = mapping_slopes(block, local)
    return slopes.swapaxes(1, 2) if transposed else slopes


def _metric(
    mapping: Floats, rule: Quadrature, along_x: float, along_y: float
) -> tuple[Floats, Floats]:
    """Return coefficients of f,xi^2, 2 f,xi f,eta, f,eta^2, (ne, 3, npt), and areas, (ne, npt).

    The sum of all terms is the integral of p1 f,x^2 + p2 f,y^2.
    """
    (x_xi, x_eta), (y_xi, y_eta) = mapping.transpose(1, 2, 0, 3)
    determinant = x_xi * y_eta - x_eta * y_xi
    weights = rule.weights / determinant
    first, second = along_x * weights, along_y * weights
    metric = np.stack(
        [
            first * y_eta**2 + second * x_eta**2,
            -first * y_eta * y_xi - second * x_eta * x_xi,
            first * y_xi**2 + second * x_xi**2,
        ],
        axis=1,
    )
    return metric, determinant * rule.weights


def _outer(rows: Floats) -> Floats:
    """Return the outer product of each row with itself, (1, rows, n, n)."""
    return np.asarray(rows[None, :, :, None] * rows[None, :, None, :])


def _products(along_xi: Floats, along_eta: Floats) -> Floats:
    """Return the matrices of f,xi^2, 2 f,xi f,eta and f,eta^2 at points, (3, npt, n, n)."""
    mixed = along_xi[None, :, :, None] * along_eta[None, :, None, :]
    symmetric = mixed + mixed.swapaxes(2, 3)
    return np.concatenate([_outer(along_xi), symmetric, _outer(along_eta)])


def _contract(coefficients: Floats, table: Floats) -> Floats:
    """Sum the matrices of a table, (..., n, n), with coefficients, (ne, ...): (ne, n, n)."""
    ne, n = len(coefficients), table.shape[-1]
    sums = coefficients.reshape(ne, -1) @ table.reshape(-1, n * n)
    return np.asarray(sums.reshape(ne, n, n))


def _largest_eigenvalues(matrices: Floats) -> Floats:
    """Bound the largest eigenvalue, (..., ne), of matrices without negative eigenvalues.

    The bound is a root of the trace of a power of the matrix: the trace is the sum of the powers of
    all eigenvalues.  It is a few per cent above the largest eigenvalue.
    """
    scale = np.einsum("...ii->...", matrices)
    power = matrices / scale[..., None, None]
    for _ in range(DOUBLINGS):
        power = power @ power
    trace = np.einsum("...ij,...ji->...", power, power)
    return np.asarray(scale * trace ** (0.5 ** (DOUBLINGS + 1)))


def _largest_of_two(first: Floats, second: Floats, square: Floats) -> Floats:
    """Return the larger eigenvalue of symmetric 2 x 2 matrices.

    `first` and `second` are the diagonal entries, `square` is the off-diagonal entry squared.
    """
    return np.asarray((first + second + np.sqrt((first - second) ** 2 + 4.0 * square)) / 2.0)


def _largest_tension(preload: tuple[float, float, float]) -> float:
    """Return the largest principal value of the preload, force/length; 0 if both are negative."""
    n_x, n_y, n_xy = preload
    return max(0.0, (n_x + n_y) / 2.0 + float(np.hypot((n_x - n_y) / 2.0, n_xy)))


# Largest residual of the highest mode relative to its eigenvalue; it bounds the error.
TOLERANCE = 1.0e-4
# Tolerance after PATIENCE steps.  The highest frequencies of a large plate of equal elements are
# close together, so that the number of steps to TOLERANCE grows with the plate's size.
RELAXED = 1.0e-3
PATIENCE = 100
PART = 32  # number of elements whose highest frequencies are computed at once
FEW = 20  # fewer equations are solved as a dense problem
MOST_STEPS = 1000  # largest number of steps of the iteration
ROUNDING = 1.0e-9  # largest relative rounding error of eigenvalues
BEYOND = "the stiffness is beyond the range of numbers"


def safe_time_step(model: PlateModel) -> float:
    """Return a lower bound of the critical time step, computed from single elements.

    The largest frequency of the plate is at most the largest frequency of its unsupported elements
    (theorem of Irons and Treharne).  The bound is a few per cent below the critical step for equal
    elements, and up to 20 per cent below it for distorted elements.  Raises UnsoundPlateError if
    the stiffness of one of these elements is not finite.
    """
    fastest = 0.0
    for family in model.families:
        unlike = family.take(family.congruence.representatives)
        # Bounds do not pay for few elements.
        is_worth_bounding = len(unlike.rows) > PART
        bounds = (
            eigenvalue_bounds(model, unlike)
            if is_worth_bounding
            else np.full(len(unlike.rows), np.inf)
        )
        highest_first = np.argsort(-bounds, kind="stable")
        for start in range(0, len(bounds), PART):
            members = highest_first[start : start + PART]
            members = members[bounds[members] >= (1.0 - ROUNDING) * fastest]
            if not len(members):
                break
            fastest = _largest_element_eigenvalue(model, unlike.take(members), fastest)
    return 2.0 / float(np.sqrt(fastest + _largest_ratio_of_supports(model)))


def _largest_ratio_of_supports(model: PlateModel) -> float:
    """Return the largest stiffness over mass of the springs at a dof; all supports are closed.

    lambda_max(M^-1 (K + K_s)) is at most lambda_max(M^-1 K) plus this ratio.
    """
    if model.supports is None:
        return 0.0
    every = np.ones(len(model.supports.node), dtype=bool)
    springs = model.supports.diagonal(every, len(model.mesh.coordinates))
    return float((springs[model.mesh.equations > 0] / model.mass).max(initial=0.0))


def _largest_element_eigenvalue(model: PlateModel, block: ElementBlock, floor: float) -> float:
    """Return the largest eigenvalue of M^-1 K in a block, or `floor` if that is larger."""
    mass = element_matrices.lumped_mass(block, model.laminate_of(block), model.rules.bending)
    scale = 1.0 / np.sqrt(mass.reshape(len(block.rows), -1))
    with np.errstate(all="ignore"):
        scaled = model.stiffness_of(block) * scale[:, :, None] * scale[:, None, :]
    if not np.isfinite(scaled).all():
        raise UnsoundPlateError(BEYOND)
    if floor > 0.0:
        # A Cholesky factor exists if all eigenvalues are smaller; it takes a tenth of the time.
        with suppress(np.linalg.LinAlgError):
            np.linalg.cholesky((1.0 - ROUNDING) * floor * np.eye(scaled.shape[-1]) - scaled)
            return floor
    return max(floor, float(np.linalg.eigvalsh(scaled)[:, -1].max()))


def taken_time_step(critical: float) -> float:
    """Return the time step of DT 0: 0.9 of the critical step, rounded to three digits."""
    return float(f"{SAFE * critical:.3g}")


def rounded_time_step(critical: float) -> float:
    """Return the step of ``fecm new``: 0.9 of the critical step, rounded down to two digits."""
    limit = SAFE * critical
    unit = 10.0 ** (math.floor(math.log10(limit)) - 1)
    return float(f"{math.floor(limit / unit) * unit:.1e}")


def critical_time_step(model: PlateModel, spring: tuple[Floats, float] | None = None) -> float:
    """Return the critical time step of the central differences.

    The largest frequency is found by Lanczos iteration without assembling the stiffness.  The
    relative error is at most 5e-5, or 5e-4 if 100 steps do not suffice; the result is then too
    large rather than too small.  A spring to ground is a pair of weights, (neq,), and a stiffness
    (force/length).  Raises UnsoundPlateError if the stiffness is not finite or the iteration fails.
    """
    with np.errstate(all="ignore"):
        plate_alone, mass, places = _accelerations(model)
        product = plate_alone if spring is None else _with_spring(plate_alone, spring, mass, places)
        scale = 1.0 / np.sqrt(model.mass)

        # Start with fractions of multiples of the golden ratio: no mode of a plate is orthogonal
        # to them.
        start = np.zeros(len(mass))
        start[places] = (np.arange(1.0, model.neq + 1.0) * 0.6180339887498949 % 1.0 - 0.5) * scale
        if not np.isfinite(product(start)).all():
            raise UnsoundPlateError(BEYOND)
        if model.neq < FEW:
            return 2.0 / math.sqrt(_largest_of_few(product, scale, places, len(mass)))
        return 2.0 / math.sqrt(_largest_eigenvalue(product, mass, start))


def _accelerations(model: PlateModel) -> tuple[Callable[[Floats], Floats], Floats, Indices]:
    """Return the product M^-1 K u in the solver's order, the masses, and the equations' places.

    Entries without an equation have no mass and stay 0.  The next call of the product overwrites
    its result.
    """
    operator = stiffness_operator(model.held)
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
    """Add the accelerations of a spring to ground to a product."""
    equations = np.flatnonzero(spring[0])
    entries, weights = places[equations], spring[0][equations]
    share = spring[1] * weights / mass[entries]

    def with_spring(u: Floats) -> Floats:
        acceleration = product(u)
        acceleration[entries] += float((weights * u[entries]).sum()) * share
        return acceleration

    return with_spring


def _largest_of_few(
    product: Callable[[Floats], Floats], scale: Floats, places: Indices, size: int
) -> float:
    """Return the largest eigenvalue of a product with few equations; `scale` is M^(-1/2)."""
    columns: list[Floats] = []
    for place, factor in zip(places.tolist(), scale.tolist(), strict=True):
        unit = np.zeros(size)
        unit[place] = factor
        columns.append(product(unit)[places] / scale)
    return float(np.linalg.eigvalsh(np.column_stack(columns))[-1])


def _largest_eigenvalue(product: Callable[[Floats], Floats], mass: Floats, start: Floats) -> float:
    """Find the largest eigenvalue of M^-1 K by Lanczos iteration in the inner product of M."""
    # Without reorthogonalisation, converged eigenvalues are only repeated.
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
    product: Floats, last: Floats, before: Floats, beta: float, mass: Floats
) -> tuple[float, float]:
    """Overwrite `before` by `product` - beta `before` - alpha `last`; return alpha and its norm.

    The sums run over pieces that fit the cache, and are the same for any number of threads.
    """
    alpha, square = 0.0, 0.0
    cuts = pieces(len(mass))
    for piece in cuts:
        rest = before[piece]
        rest *= -beta
        rest += product[piece]
        alpha += float((mass[piece] * last[piece]) @ rest)
    for piece in cuts:
        rest = before[piece]
        rest -= alpha * last[piece]
        square += float((mass[piece] * rest) @ rest)
    return alpha, math.sqrt(square)
