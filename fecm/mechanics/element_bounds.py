"""Upper bounds of the highest frequencies of single elements, far cheaper than the frequencies.

The five fields u, v, w, theta_x and theta_y of an element, scaled by the roots of their masses, get
the same bound of their energies, p1 f,x^2 + p2 f,y^2 + q f^2 at a point, so that a matrix with a
row for each node takes the place of one with five.

Membrane and bending: their energy is g' D g with the gradients g of u, v, theta_x and theta_y.  p1
and p2 are such that g' D g <= p1 |g,x|^2 + p2 |g,y|^2.

Transverse shear: (w,x - theta_x)^2 <= (1 + s) w,x^2 + (1 + 1/s) theta_x^2 for any s > 0.  s is as
large as p1 and p2 allow, of which w has no other need but the preload's.  Where shear has points of
its own, its matrices of w and of the rotations are bounded one by one; at the best s of an element
the whole has the larger eigenvalue of [[a + r, (r w)^(1/2)], [., w]] with the bounds r and w, and a
of all else.

Curvature: the strains w/R of a shallow panel are taken apart from those of u and v in the same way.
"""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

import numpy as np

from fecm._typing import Floats
from fecm.mechanics import assumed_shear
from fecm.mechanics.curvature import strain_of_deflection
from fecm.mechanics.element_matrices import IntegrationRules, lumped_shares
from fecm.mechanics.elements import Quadrature
from fecm.mechanics.interpolation import local_shape_functions, mapping_slopes
from fecm.mechanics.laminate import Laminate
from fecm.mechanics.mesh import ElementBlock
from fecm.mechanics.plate import PlateModel

# Excess of p1 over the least possible one.  A smaller p1 needs a larger p2: what is better depends
# on the elements' shapes.
EXCESSES = 0.02, 0.05, 0.1, 0.2, 0.4, 0.8
# 1 + s, at least.  A larger one needs larger p1 and p2: what is better depends on the thickness.
SHARES = 2.0, 4.0, 12.0
SAMPLE = 64  # elements that decide on these
PART = 512  # elements whose matrices are computed at once, which fit the cache
DOUBLINGS = 3  # of the exponent of a matrix, before the trace of its square

# Strains and curvatures of u,x v,x theta_x,x theta_y,x and of u,y v,y theta_x,y theta_y,y.
ALONG_X = np.zeros((6, 4))
ALONG_X[[0, 2, 3, 5], [0, 1, 2, 3]] = 1.0, 1.0, -1.0, -1.0
ALONG_Y = np.zeros((6, 4))
ALONG_Y[[2, 1, 5, 4], [0, 1, 2, 3]] = 1.0, 1.0, -1.0, -1.0


class Majorant(NamedTuple):
    """Numbers that bound the energies of all fields over their masses."""

    along_x: float  # p1, length squared over time squared
    along_y: float  # p2, the same
    value: float  # q, 1/time squared


def eigenvalue_bounds(model: PlateModel, family: ElementBlock) -> Floats:
    """Upper bounds of the largest eigenvalue of M^-1 K of elements, (ne,), 1/time squared.

    M is the lumped mass.  A bound is infinite where numbers are out of range, and where an element
    is folded.
    """
    with np.errstate(all="ignore"):
        count = len(family.rows)
        sample = family.take(slice(0, count, -(-count // SAMPLE)))
        majorants = _majorants(model, model.laminate_of(family))
        best = min(majorants, key=lambda one: _bounds(model, sample, one).max(), default=None)
        if best is None:
            return np.full(count, np.inf)
        return np.concatenate([_bounds(model, part, best) for part in family.blocks(PART)])


def _majorants(model: PlateModel, laminate: Laminate) -> list[Majorant]:
    """Majorants of elements of a laminate, which differ in what p1 is and p2."""
    inertia = np.array([laminate.mass, laminate.rotary_inertia])
    shear = np.zeros(2) if _has_own_points(model.rules) else _stiffest(laminate) / inertia
    tension = _largest_tension(model.preload) / inertia[0]
    strain = strain_of_deflection(model.curvature)
    rise = float(strain @ laminate.A @ strain) / inertia[0]
    found: list[Majorant] = []
    for (excess, (along_x, along_y)), share in product(_of_gradients(laminate), SHARES):
        of_w = max(min(along_x, along_y), tension + share * shear[0])
        spare = of_w - tension  # (1 + s) times the shear's part
        rotations = shear[1] * spare / (spare - shear[0]) if shear[0] > 0.0 else 0.0
        value = max(rotations, rise * (1.0 + 1.0 / excess))
        stretched = value / (value - rise) if rise > 0.0 else 1.0
        slopes = max(along_x * stretched, of_w), max(along_y * stretched, of_w)
        found.append(Majorant(*slopes, value))
    return found


def _of_gradients(laminate: Laminate) -> list[tuple[float, tuple[float, float]]]:
    """Pairs p1, p2 of membrane and bending, with the excess of p1."""
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
    """Whether transverse shear has other points than bending."""
    return rules.assumes_shear or rules.shear is not rules.bending


def _bounds(model: PlateModel, block: ElementBlock, majorant: Majorant) -> Floats:
    """Bounds of the elements of a block, (ne,)."""
    rules = model.rules
    values, local = local_shape_functions(block, rules.bending)
    mapping = _mapping(block, local, transposed=rules.transposed_jacobian)
    metric, areas = _metric(mapping, rules.bending, majorant.along_x, majorant.along_y)
    energies = np.concatenate([metric, majorant.value * areas[:, None]], axis=1)
    table = np.concatenate([_products(local[:, 0], local[:, 1]), _outer(values)])
    shares = lumped_shares(values, areas)
    roots = 1.0 / np.sqrt(shares)
    matrices = _contracted(energies, table)
    matrices *= roots[:, :, None]
    matrices *= roots[:, None, :]
    bound = _largest_eigenvalue(matrices)
    if _has_own_points(rules):
        of_w = bound if model.is_preloaded or model.is_curved else 0.0
        by_slopes, by_rotations = _shear_bounds(block, rules, shares, model.laminate_of(block))
        bound = _largest_of_two(bound + by_rotations, of_w + by_slopes, by_slopes * by_rotations)
    return np.where(np.isfinite(bound) & (areas > 0.0).all(axis=1), bound, np.inf)


def _shear_bounds(
    block: ElementBlock, rules: IntegrationRules, shares: Floats, laminate: Laminate
) -> Floats:
    """Bounds of the eigenvalues of the transverse shear of w and of the rotations, (2, ne).

    Both are B' Q B with the covariant strains B at tying points, which are those of the rule unless
    strains are assumed.  Q B M^-1 B', with two rows for a point, has their eigenvalues.
    """
    nn = block.nodes.shape[1]
    if rules.assumes_shear:
        rule, transposed = assumed_shear.quadrature(block), False
        points = [assumed_shear.tying_points(nn, axis) for axis in (0, 1)]
        weights = [assumed_shear.tying_weights(nn, axis, rule) for axis in (0, 1)]
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
    of_w = _contracted(1.0 / shares, _outer(slopes.T)[0] / laminate.mass)
    of_rotations = _contracted(1.0 / shares, _outer(values.T)[0] / laminate.rotary_inertia)
    of_rotations *= bases.swapaxes(1, 2) @ bases

    _, local = local_shape_functions(block, rule)
    metric, _ = _metric(_mapping(block, local, transposed=transposed), rule, 1.0, 1.0)
    none = np.zeros_like(weights[0])
    tied = np.hstack([weights[0], none]), np.hstack([none, weights[1]])
    stiffness = _contracted(metric, _products(*tied))
    return _stiffest(laminate) * _largest_eigenvalue(stiffness @ np.stack([of_w, of_rotations]))


def _stiffest(laminate: Laminate) -> float:
    """Upper bound of the largest transverse shear stiffness, force/length."""
    return float(np.abs(laminate.shear).sum(axis=1).max())


def _mapping(block: ElementBlock, local: Floats, *, transposed: bool) -> Floats:
    """Slopes dx_i/dxi_a at points, (ne, i, a, npt); `transposed` swaps i and a, a slip."""
    slopes = mapping_slopes(block, local)
    return slopes.swapaxes(1, 2) if transposed else slopes


def _metric(
    mapping: Floats, rule: Quadrature, along_x: float, along_y: float
) -> tuple[Floats, Floats]:
    """Coefficients of f,xi^2, 2 f,xi f,eta and f,eta^2, (ne, 3, npt), and areas, (ne, npt).

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
    """Products of the entries of each row with one another, (1, rows, n, n)."""
    return np.asarray(rows[None, :, :, None] * rows[None, :, None, :])


def _products(along_xi: Floats, along_eta: Floats) -> Floats:
    """Matrices of f,xi^2, 2 f,xi f,eta and f,eta^2 at points, (3, npt, n, n)."""
    mixed = along_xi[None, :, :, None] * along_eta[None, :, None, :]
    both = mixed + mixed.swapaxes(2, 3)
    return np.concatenate([_outer(along_xi), both, _outer(along_eta)])


def _contracted(coefficients: Floats, table: Floats) -> Floats:
    """Sums of the matrices of a table, (..., n, n), with coefficients, (ne, ...): (ne, n, n)."""
    ne, n = len(coefficients), table.shape[-1]
    sums = coefficients.reshape(ne, -1) @ table.reshape(-1, n * n)
    return np.asarray(sums.reshape(ne, n, n))


def _largest_eigenvalue(matrices: Floats) -> Floats:
    """Upper bound of the largest eigenvalue, (..., ne), of matrices that have no negative one.

    Root of the trace of a power, per cent above it: the sum of the eigenvalues' powers.
    """
    scale = np.einsum("...ii->...", matrices)
    power = matrices / scale[..., None, None]
    for _ in range(DOUBLINGS):
        power = power @ power
    trace = np.einsum("...ij,...ji->...", power, power)
    return np.asarray(scale * trace ** (0.5 ** (DOUBLINGS + 1)))


def _largest_of_two(first: Floats, second: Floats, square: Floats) -> Floats:
    """Larger eigenvalue of symmetric matrices of two rows; `square` is that of the other entry."""
    return np.asarray((first + second + np.sqrt((first - second) ** 2 + 4.0 * square)) / 2.0)


def _largest_tension(preload: tuple[float, float, float]) -> float:
    """Largest principal value of the preload, force/length; 0 if both are compression."""
    n_x, n_y, n_xy = preload
    return max(0.0, (n_x + n_y) / 2.0 + float(np.hypot((n_x - n_y) / 2.0, n_xy)))
