"""Shape functions of many elements at once: values, derivatives in x and y, Jacobians.

Arrays over elements have the element first, then the quadrature point.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from fecm._typing import Array, Bools, Floats
from fecm.mechanics.elements import ElementShape, Quadrature
from fecm.mechanics.mesh import ElementBlock

# Degrees of freedom of a node: u, v, w, theta_x, theta_y.
NDOF = 5
W = 2  # dof of the deflection; the rotations follow
# Rounding may flip the sign of smaller Jacobian determinants, relative to the coordinates squared.
DOUBTFUL = 1.0e-10


class Interpolation(NamedTuple):
    """Shape functions of an element block at the points of a rule."""

    N: Floats  # (npt, nn): values
    dN: Floats  # (ne, npt, 2, nn): derivatives with respect to x and y, 1/length
    jxw: Floats  # (ne, npt): Jacobian determinant times weight, length squared


def local_shape_functions(family: ElementBlock, rule: Quadrature) -> tuple[Floats, Floats]:
    """Return values (npt, nn), d/dxi and d/deta (npt, 2, nn) of the present nodes' functions."""
    return _shape_functions_at(family.shape, rule, tuple(family.present.tolist()))


@lru_cache(maxsize=64)
def _shape_functions_at(
    shape: ElementShape, rule: Quadrature, present: tuple[bool, ...]
) -> tuple[Floats, Floats]:
    is_present = np.array(present)
    values, local = shape.shape_functions(rule.xi, rule.eta, is_present)
    values, local = values[:, is_present], local[:, :, is_present]
    values.flags.writeable = local.flags.writeable = False  # shared by all callers
    return values, local


def jacobian(family: ElementBlock, local: Floats) -> Floats:
    """Return the Jacobian dx_i/dxi_a, (ne, npt, a, i), from derivatives by xi, eta (npt, 2, nn)."""
    slopes = local.transpose(2, 0, 1)[..., None, None]
    places = np.ascontiguousarray(family.coordinates.transpose(1, 2, 0))
    # Sum node by node, in the order of einsum, at a quarter of its cost.
    total = slopes[0] * places[0]
    for slope, place in zip(slopes[1:], places[1:], strict=True):
        total += slope * place
    return np.ascontiguousarray(total.transpose(3, 0, 1, 2))


def mapping_slopes(family: ElementBlock, local: Floats) -> Floats:
    """Return the Jacobian dx_i/dxi_a in the layout (ne, i, a, npt).

    Same as :func:`jacobian` up to rounding, computed by one matrix product at a fifth of the cost.
    """
    ne, nn = family.nodes.shape
    places = family.coordinates.swapaxes(1, 2).reshape(2 * ne, nn)
    slopes = places @ local.swapaxes(0, 1).reshape(-1, nn).T
    return np.asarray(slopes.reshape(ne, 2, 2, -1))


def inverse_jacobian(
    family: ElementBlock, local: Floats, *, transposed_jacobian: bool = False
) -> tuple[Floats, Floats]:
    """Return inverse (ne, npt, 2, 2) and determinant (ne, npt) of the Jacobian.

    `local` contains the derivatives of the shape functions by xi and eta, (npt, 2, nn).  The
    inverse has dxi_a/dx_i in row i and column a; `transposed_jacobian` transposes it.
    """
    J: Array = jacobian(family, local)
    inverse = np.linalg.inv(J)
    if transposed_jacobian:
        inverse = inverse.swapaxes(-1, -2)
    return inverse, np.linalg.det(J)


def jacobian_determinants(family: ElementBlock, rule: Quadrature) -> Floats:
    """Return the Jacobian determinant at the points of a rule, (ne, npt), length squared."""
    _, local = local_shape_functions(family, rule)
    return np.asarray(np.linalg.det(jacobian(family, local)))


def has_positive_jacobians(family: ElementBlock, rule: Quadrature) -> Bools:
    """Return whether the Jacobian determinant is positive at all points of a rule, (ne,)."""
    _, local = local_shape_functions(family, rule)
    (x_xi, x_eta), (y_xi, y_eta) = mapping_slopes(family, local).transpose(1, 2, 0, 3)
    determinants = x_xi * y_eta - x_eta * y_xi
    margin = DOUBTFUL * np.square(family.coordinates).max()
    positive = (determinants > margin).all(axis=1)
    if not positive.all():
        doubtful = np.flatnonzero(~positive)
        exact = jacobian_determinants(family.take(doubtful), rule)
        positive[doubtful] = (exact > 0.0).all(axis=1)
    return np.asarray(positive)


def interpolate(
    family: ElementBlock, rule: Quadrature, *, transposed_jacobian: bool = False
) -> Interpolation:
    """Evaluate shape functions and their derivatives in x and y at the points of a rule."""
    values, local = local_shape_functions(family, rule)
    inverse, determinant = inverse_jacobian(family, local, transposed_jacobian=transposed_jacobian)
    derivatives = np.einsum("epia,pan->epin", inverse, local)
    return Interpolation(values, derivatives, determinant * rule.weights)
