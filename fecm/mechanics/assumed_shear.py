"""Assumed transverse shear strains: elements that neither lock nor hourglass.

The covariant strains e_xi = w,xi - theta_x x,xi - theta_y y,xi and e_eta are taken from the
displacements at tying points only and interpolated between them.  9-node elements: e_xi is linear
in xi from +-1/sqrt(3) and quadratic in eta from 0 and +-sqrt(3/5), e_eta the other way round
(Bucalem and Bathe 1993).  4-node elements: e_xi is constant in xi and linear
in eta from +-1 (MITC4, Dvorkin and Bathe 1984).
"""

from __future__ import annotations

import numpy as np

from fecm._typing import Floats
from fecm.mechanics.elements import Quadrature, gauss
from fecm.mechanics.interpolation import NDOF, inverse_jacobian, local_shape_functions
from fecm.mechanics.mesh import ElementBlock

# By number of nodes: tying points of e_xi along xi and along eta, and the order of the quadrature.
_G = 3.0**-0.5
_H = 0.6**0.5
TYING = {4: ((0.0,), (-1.0, 1.0), 2), 9: ((-_G, _G), (-_H, 0.0, _H), 3)}


def supports(family: ElementBlock) -> bool:
    """Whether the elements of a block have assumed shear strains."""
    return family.shape.nodes == 9 and family.nodes.shape[1] in TYING


def quadrature(family: ElementBlock) -> Quadrature:
    """Rule of the transverse shear energy."""
    return gauss(TYING[family.nodes.shape[1]][2])


def tying_points(nodes: int, axis: int) -> Quadrature:
    """Tying points of e_xi (axis 0) or e_eta (1) of an element with so many nodes."""
    a, b = (grid.ravel() for grid in np.meshgrid(*TYING[nodes][:2]))
    return Quadrature(b, a, 0.0 * a) if axis else Quadrature(a, b, 0.0 * a)


def tying_weights(nodes: int, axis: int, rule: Quadrature) -> Floats:
    """Functions that interpolate between tying points, at the points of a rule, (npt, tying)."""
    along, across, _ = TYING[nodes]
    one, other = (rule.eta, rule.xi) if axis else (rule.xi, rule.eta)
    product = _lagrange(across, other)[:, :, None] * _lagrange(along, one)[:, None, :]
    return product.reshape(len(rule.xi), -1)


def strain_matrix(family: ElementBlock, rule: Quadrature) -> Floats:
    """B matrix of the assumed strains gamma_xz, gamma_yz, (ne, npt, 2, 5 nn)."""
    ne, nn = family.nodes.shape
    _, local = local_shape_functions(family, rule)
    inverse, _ = inverse_jacobian(family, local)
    covariant = np.empty((ne, len(rule.xi), 2, nn * NDOF))
    for axis in (0, 1):
        values, local = local_shape_functions(family, tying_points(nn, axis))
        slope = np.einsum("tn,eni->eti", local[:, axis], family.coordinates)  # dx_i/dxi_a
        B = np.zeros((ne, len(values), nn, NDOF))
        B[..., 2] = local[:, axis]
        B[..., 3:] = -values[:, :, None] * slope[:, :, None, :]
        weights = tying_weights(nn, axis, rule)
        covariant[:, :, axis] = weights @ B.reshape(ne, len(values), nn * NDOF)
    return np.asarray(inverse @ covariant)


class TiedStrains:
    """Assumed transverse shear strains of a displacement field at the points of a rule."""

    def __init__(self, family: ElementBlock, rule: Quadrature) -> None:
        nn = family.nodes.shape[1]
        self._axes = []
        for axis in (0, 1):
            values, local = local_shape_functions(family, tying_points(nn, axis))
            slope = np.einsum("tn,eni->ite", local[:, axis], family.coordinates)
            table = np.concatenate([local[:, axis], values])
            self._axes.append((table, slope, tying_weights(nn, axis, rule)))

    def covariant(self, q: Floats) -> tuple[Floats, Floats]:
        """Strains e_xi, e_eta (fields, npt, ne) of w, theta_x, theta_y (fields, nn, 3 ne)."""
        found: list[Floats] = []
        for table, slope, weights in self._axes:
            at = (table @ q).reshape(len(q), 2, len(table) // 2, 3, -1)
            strain = at[:, 0, :, 0] - at[:, 1, :, 1] * slope[0] - at[:, 1, :, 2] * slope[1]
            found.append(weights @ strain)
        return found[0], found[1]


def _lagrange(nodes: tuple[float, ...], at: Floats) -> Floats:
    """Lagrange polynomials of the nodes at points, (npt, nodes)."""
    x = np.array(nodes)
    factors = (at[:, None, None] - x) / np.where(np.eye(len(x), dtype=bool), 1.0, x[:, None] - x)
    factors[:, np.eye(len(x), dtype=bool)] = 1.0
    return np.asarray(factors.prod(axis=2))
