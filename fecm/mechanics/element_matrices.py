"""Plate elements: geometry, stiffness, lumped mass and strains of many elements at once.

Conventions: the dofs of a node are u, v, w, theta_x, theta_y; an element's dofs are ordered node by
node.  Rotations have the listing's sign, opposite to the report's phi: transverse shear is
gamma_xz = w,x - theta_x and gamma_yz = w,y - theta_y, curvature kappa_x = -theta_x,x and
kappa_y = -theta_y,y.  Arrays over elements have the element first, then the quadrature point.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fecm._typing import Floats
from fecm.mechanics import strains
from fecm.mechanics.elements import Quadrature
from fecm.mechanics.interpolation import (
    NDOF,
    Interpolation,
    interpolate,
    jacobian_determinants,
    local_shape_functions,
)
from fecm.mechanics.laminate import LaminateSection
from fecm.mechanics.mesh import ElementBlock
from fecm.mechanics.strains import FLAT, Curvature, strain_of_deflection


@dataclass(frozen=True)
class IntegrationRules:
    """Quadrature rules of a plate."""

    bending: Quadrature  # membrane, bending and mass
    shear: Quadrature  # transverse shear
    strains: Quadrature  # points of the stored strains
    transposed_jacobian: bool = False  # whether the inverse Jacobian is transposed
    # Whether transverse shear strains are the assumed ones of :mod:`~fecm.mechanics.strains`.
    assumes_shear: bool = False


def membrane_and_bending(shapes: Interpolation, curvature: Curvature = FLAT) -> Floats:
    """Return B of midplane strains and curvatures, equations 2-6 to 2-9: (ne, npt, 6, 5 nn).

    The midplane strains of a curved panel contain the strains of w.
    """
    ne, npt, _, nn = shapes.dN.shape
    B = np.zeros((ne, npt, 6, nn, NDOF))
    x, y = shapes.dN[:, :, 0], shapes.dN[:, :, 1]
    B[:, :, 0, :, 0] = x
    B[:, :, 1, :, 1] = y
    B[:, :, 2, :, 0], B[:, :, 2, :, 1] = y, x
    B[:, :, 3, :, 3] = -x
    B[:, :, 4, :, 4] = -y
    B[:, :, 5, :, 3], B[:, :, 5, :, 4] = -y, -x
    if curvature != FLAT:
        B[:, :, :3, :, 2] = strain_of_deflection(curvature)[:, None] * shapes.N[:, None]
    return B.reshape(ne, npt, 6, nn * NDOF)


def _transverse_shear(shapes: Interpolation) -> Floats:
    """Return B of transverse shear strains xz, yz, equations 2-6 to 2-9: (ne, npt, 2, 5 nn)."""
    ne, npt, _, nn = shapes.dN.shape
    B = np.zeros((ne, npt, 2, nn, NDOF))
    for direction in (0, 1):
        B[:, :, direction, :, 2] = shapes.dN[:, :, direction]
        B[:, :, direction, :, 3 + direction] = -shapes.N
    return B.reshape(ne, npt, 2, nn * NDOF)


def transverse_shear(
    family: ElementBlock, rules: IntegrationRules, shapes: Interpolation
) -> tuple[Floats, Floats]:
    """Return B of transverse shear, (ne, npt, 2, 5 nn), and the areas of its points, (ne, npt).

    `shapes` is the interpolation at the points of bending, which often are the points of shear too.
    Assumed shear strains have their own points.
    """
    if rules.assumes_shear:
        rule = strains.quadrature(family)
        jxw = jacobian_determinants(family, rule) * rule.weights
        return strains.strain_matrix(family, rule), jxw
    if rules.shear is not rules.bending:
        shapes = interpolate(family, rules.shear, transposed_jacobian=rules.transposed_jacobian)
    return _transverse_shear(shapes), shapes.jxw


def _integrate(B: Floats, C: Floats, jxw: Floats) -> Floats:
    """Integrate B' C B by quadrature, (ne, n, n); the result is exactly symmetric."""
    ne, npt, rows, n = B.shape
    flat = B.reshape(ne, npt * rows, n)
    weighted = (jxw[:, :, None, None] * (C @ B)).reshape(ne, npt * rows, n)
    product = flat.swapaxes(1, 2) @ weighted
    return np.asarray((product + product.swapaxes(1, 2)) / 2.0)


def stiffness(
    family: ElementBlock,
    laminate: LaminateSection,
    rules: IntegrationRules,
    curvature: Curvature = FLAT,
) -> Floats:
    """Return the element stiffness matrices, K_p of equation 4-14, (ne, 5 nn, 5 nn)."""
    ABD = np.block([[laminate.A, laminate.B], [laminate.B, laminate.D]])
    shapes = interpolate(family, rules.bending, transposed_jacobian=rules.transposed_jacobian)
    K = _integrate(membrane_and_bending(shapes, curvature), ABD, shapes.jxw)
    B, jxw = transverse_shear(family, rules, shapes)
    return K + _integrate(B, laminate.shear, jxw)


def geometric_stiffness(
    family: ElementBlock, preload: tuple[float, float, float], rules: IntegrationRules
) -> Floats:
    """Return the matrices K_sigma of a uniform membrane force, (ne, 5 nn, 5 nn).

    K_sigma is the integral of (w,x; w,y)' [N_x, N_xy; N_xy, N_y] (w,x; w,y) with the rule of
    bending.  `preload` is N_x, N_y, N_xy (force/length), tension positive.  The matrices are
    exactly symmetric, and indefinite under compression or shear.  Zienkiewicz and Taylor, The
    Finite Element Method.
    """
    n_x, n_y, n_xy = preload
    N = np.array([[n_x, n_xy], [n_xy, n_y]])
    shapes = interpolate(family, rules.bending, transposed_jacobian=rules.transposed_jacobian)
    ne, nn = family.nodes.shape
    K = np.zeros((ne, nn, NDOF, nn, NDOF))
    K[:, :, 2, :, 2] = _integrate(shapes.dN, N, shapes.jxw)
    return K.reshape(ne, nn * NDOF, nn * NDOF)


def lumped_shares(values: Floats, areas: Floats) -> Floats:
    """Return the nodes' shares of the elements' areas, (ne, nn); see :func:`lumped_mass`.

    `values` (npt, nn) are the shape functions, `areas` (ne, npt) the areas of the points.
    """
    diagonal = np.einsum("ep,pn->en", areas, values**2)
    return np.asarray(diagonal * (areas.sum(axis=1) / diagonal.sum(axis=1))[:, None])


def lumped_mass(
    family: ElementBlock,
    laminate: LaminateSection,
    rule: Quadrature,
    determinants: Floats | None = None,
) -> Floats:
    """Return the lumped element masses, (ne, nn, 5).

    They are the diagonal of the consistent matrix, scaled to the element's mass: the listing's
    MASS01, the method of Hinton, Rock and Zienkiewicz (1976).  The entries of u, v and w are
    masses, the entries of the rotations mass times length squared.  Every entry is positive unless
    a node's shape function is zero at all points, which happens to mid-sides with order 1.
    `determinants` are the Jacobian determinants at the points of the rule, (ne, npt), if they are
    known.
    """
    values, _ = local_shape_functions(family, rule)
    if determinants is None:
        determinants = jacobian_determinants(family, rule)
    share = lumped_shares(values, determinants * rule.weights)
    inertia = np.repeat([laminate.mass, laminate.rotary_inertia], (3, 2))
    return np.asarray(share[:, :, None] * inertia)


def consistent_mass(family: ElementBlock, laminate: LaminateSection, rule: Quadrature) -> Floats:
    """Return the consistent mass matrices, M_p of equation 4-14, (ne, 5 nn, 5 nn).

    The integral of N_i N_j is multiplied by the mass per area rho h for u, v and w, and by the
    rotary inertia rho h^3 / 12 for the rotations (the listing's MASS01).  Different dofs are not
    coupled.  The matrices are exactly symmetric.  On parallelograms the rule is exact with order 2
    for the 4-node element, order 3 with mid-sides, and order 4 for the cubic element.
    """
    values, _ = local_shape_functions(family, rule)
    area = jacobian_determinants(family, rule) * rule.weights
    product = np.einsum("ep,pi,pj->eij", area, values, values, optimize=True)
    shared = (product + product.swapaxes(1, 2)) / 2.0
    inertia = np.repeat([laminate.mass, laminate.rotary_inertia], (3, 2))
    ne, nn = family.nodes.shape
    M = np.zeros((ne, nn, NDOF, nn, NDOF))
    for dof in range(NDOF):
        M[:, :, dof, :, dof] = inertia[dof] * shared
    return M.reshape(ne, nn * NDOF, nn * NDOF)
