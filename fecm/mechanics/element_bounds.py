"""Upper bounds of the highest frequencies of single elements, far cheaper than the frequencies.

The largest eigenvalue of a sum of matrices is at most the sum of theirs: of membrane and bending,
of transverse shear, of the curvature and of the preload.

The first one dominates.  Its energy at a point is g' D g with the gradients g of u, v, theta_x and
theta_y, scaled by the roots of the masses.  With numbers p1 and p2 such that
g' D g <= p1 |g,x|^2 + p2 |g,y|^2, the four fields are independent of one another and alike, so
that a matrix with a row for each node takes the place of one with five.
"""

from __future__ import annotations

import numpy as np

from fecm._typing import Floats
from fecm.mechanics import element_matrices
from fecm.mechanics.curvature import strain_of_deflection
from fecm.mechanics.interpolation import interpolate
from fecm.mechanics.laminate import Laminate
from fecm.mechanics.mesh import ElementBlock
from fecm.mechanics.plate import PlateModel

# Excess of p1 over the least possible one.  A smaller p1 needs a larger p2: what is better depends
# on the elements' shapes.
EXCESSES = 0.02, 0.05, 0.1, 0.2, 0.4, 0.8
PART = 128  # elements whose matrices are computed at once, which fit the cache

# Strains and curvatures of u,x v,x theta_x,x theta_y,x and of u,y v,y theta_x,y theta_y,y.
ALONG_X = np.zeros((6, 4))
ALONG_X[[0, 2, 3, 5], [0, 1, 2, 3]] = 1.0, 1.0, -1.0, -1.0
ALONG_Y = np.zeros((6, 4))
ALONG_Y[[2, 1, 5, 4], [0, 1, 2, 3]] = 1.0, 1.0, -1.0, -1.0


def eigenvalue_bounds(model: PlateModel, family: ElementBlock) -> Floats:
    """Upper bounds of the largest eigenvalue of M^-1 K of elements, (ne,), 1/time squared.

    M is the lumped mass.  A bound is infinite where numbers are out of range, and where an element
    is folded.
    """
    with np.errstate(all="ignore"):
        pairs = _majorants(model.laminate_of(family))
        sample = family.take(np.arange(min(PART, len(family.rows))))
        best = min(pairs, key=lambda pair: _bounds(model, sample, pair).max(), default=None)
        if best is None:
            return np.full(len(family.rows), np.inf)
        return np.concatenate([_bounds(model, part, best) for part in family.blocks(PART)])


def _bounds(model: PlateModel, block: ElementBlock, majorant: tuple[float, float]) -> Floats:
    """Bounds of the elements of a block, (ne,), with the numbers p1 and p2."""
    laminate, rules = model.laminate_of(block), model.rules
    at = interpolate(block, rules.bending, transposed_jacobian=rules.transposed_jacobian)
    shares = element_matrices.lumped_shares(at.N, at.jxw)
    roots = np.sqrt(at.jxw[:, :, None] / shares[:, None])
    slopes = at.dN * (np.sqrt(majorant)[:, None] * roots[:, :, None, :])
    bound = _largest_eigenvalue(slopes)
    if model.is_preloaded:
        bound *= 1.0 + _largest_tension(model.preload) / laminate.mass / min(majorant)
    if model.is_curved:
        strain = strain_of_deflection(model.curvature)
        rise = float(strain @ laminate.A @ strain) / laminate.mass
        bound += rise * ((at.N * roots) ** 2).sum(axis=(1, 2))
    B, areas = element_matrices.transverse_shear(block, rules, at)
    bound += _shear_bound(B, areas, shares, laminate)
    return np.where(np.isfinite(bound), bound, np.inf)


def _majorants(laminate: Laminate) -> list[tuple[float, float]]:
    """Pairs p1, p2 of a laminate, length squared over time squared."""
    stiffness = np.block([[laminate.A, laminate.B], [laminate.B, laminate.D]])
    inertia = np.repeat([laminate.mass, laminate.rotary_inertia], 2)
    scale = 1.0 / np.sqrt(inertia[:, None] * inertia)
    xx = scale * (ALONG_X.T @ stiffness @ ALONG_X)
    xy = scale * (ALONG_X.T @ stiffness @ ALONG_Y)
    yy = scale * (ALONG_Y.T @ stiffness @ ALONG_Y)
    if not np.isfinite([xx, xy, yy]).all():
        return []
    least = float(np.linalg.eigvalsh(xx)[-1])
    pairs: list[tuple[float, float]] = []
    for excess in EXCESSES:
        along_x = (1.0 + excess) * least
        complement = yy + xy.T @ np.linalg.solve(along_x * np.eye(len(xx)) - xx, xy)
        pairs.append((along_x, float(np.linalg.eigvalsh(complement)[-1])))
    return pairs


def _largest_eigenvalue(rows: Floats) -> Floats:
    """Largest eigenvalue of R' R, (ne,), for R (ne, npt, 2, nn); NaN if R' R is not finite."""
    flat = rows.reshape(len(rows), -1, rows.shape[-1])
    products = flat.swapaxes(1, 2) @ flat
    sound = np.asarray(np.isfinite(products).all(axis=(1, 2)))
    found = np.linalg.eigvalsh(np.where(sound[:, None, None], products, 0.0))[:, -1]
    return np.where(sound, found, np.nan)


def _shear_bound(B: Floats, areas: Floats, shares: Floats, laminate: Laminate) -> Floats:
    """Bound of the largest eigenvalue of the transverse shear part, (ne,).

    It is the fourth root of the sum of their fourth powers.
    """
    ne, points, _, n = B.shape
    inertia = np.repeat([laminate.mass, laminate.rotary_inertia], (3, 2))
    mass = (shares[:, :, None] * inertia).reshape(ne, n)
    rows = B.reshape(ne, 2 * points, n) / np.sqrt(mass)[:, None, :]
    rows *= np.sqrt(np.repeat(areas, 2, axis=1))[:, :, None]
    squares = rows @ rows.swapaxes(1, 2)  # their eigenvalues are those of the part
    fourths = squares @ squares
    stiffest = float(np.abs(laminate.shear).sum(axis=1).max())
    return np.asarray(stiffest * np.einsum("eij,eij->e", fourths, fourths) ** 0.25)


def _largest_tension(preload: tuple[float, float, float]) -> float:
    """Largest principal value of the preload, force/length; 0 if both are compression."""
    n_x, n_y, n_xy = preload
    return max(0.0, (n_x + n_y) / 2.0 + float(np.hypot((n_x - n_y) / 2.0, n_xy)))
