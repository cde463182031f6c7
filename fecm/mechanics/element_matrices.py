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

    # Membrane, bending and mass; transverse shear.
    bending: Quadrature
    shear: Quadrature
    strains: Quadrature  # points of the stored strains
    transposed_jacobian: bool = False  # transpose the inverse Jacobian
    # Take the transverse shear strains of :mod:`~fecm.mechanics.strains`.
    assumes_shear: bool = False


def membrane_and_bending(at: Interpolation, curvature: Curvature = FLAT) -> Floats:
    """B matrix of midplane strains and curvatures, equations 2-6 to 2-9: (ne, npt, 6, 5 nn).

    The midplane strains of a curved panel contain those of w.
    """
    ne, npt, _, nn = at.dN.shape
    B = np.zeros((ne, npt, 6, nn, NDOF))
    x, y = at.dN[:, :, 0], at.dN[:, :, 1]
    B[:, :, 0, :, 0] = x
    B[:, :, 1, :, 1] = y
    B[:, :, 2, :, 0], B[:, :, 2, :, 1] = y, x
    B[:, :, 3, :, 3] = -x
    B[:, :, 4, :, 4] = -y
    B[:, :, 5, :, 3], B[:, :, 5, :, 4] = -y, -x
    if curvature != FLAT:
        B[:, :, :3, :, 2] = strain_of_deflection(curvature)[:, None] * at.N[:, None]
    return B.reshape(ne, npt, 6, nn * NDOF)


def _transverse_shear(at: Interpolation) -> Floats:
    """B matrix of transverse shear strains xz, yz, equations 2-6 to 2-9: (ne, npt, 2, 5 nn)."""
    ne, npt, _, nn = at.dN.shape
    B = np.zeros((ne, npt, 2, nn, NDOF))
    for direction in (0, 1):
        B[:, :, direction, :, 2] = at.dN[:, :, direction]
        B[:, :, direction, :, 3 + direction] = -at.N
    return B.reshape(ne, npt, 2, nn * NDOF)


def transverse_shear(
    family: ElementBlock, rules: IntegrationRules, at: Interpolation
) -> tuple[Floats, Floats]:
    """B matrix of transverse shear strains, (ne, npt, 2, 5 nn), and its points' areas, (ne, npt).

    `at` is the interpolation at the points of bending, which are often those of shear too.
    :mod:`~fecm.mechanics.strains` has its own points.
    """
    if rules.assumes_shear:
        rule = strains.quadrature(family)
        jxw = jacobian_determinants(family, rule) * rule.weights
        return strains.strain_matrix(family, rule), jxw
    if rules.shear is not rules.bending:
        at = interpolate(family, rules.shear, transposed_jacobian=rules.transposed_jacobian)
    return _transverse_shear(at), at.jxw


def _integrate(B: Floats, C: Floats, jxw: Floats) -> Floats:
    """Integral of B' C B by quadrature, (ne, n, n); exactly symmetric."""
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
    """Element stiffness matrices, K_p of equation 4-14, (ne, 5 nn, 5 nn)."""
    ABD = np.block([[laminate.A, laminate.B], [laminate.B, laminate.D]])
    at = interpolate(family, rules.bending, transposed_jacobian=rules.transposed_jacobian)
    K = _integrate(membrane_and_bending(at, curvature), ABD, at.jxw)
    B, jxw = transverse_shear(family, rules, at)
    return K + _integrate(B, laminate.shear, jxw)


def geometric_stiffness(
    family: ElementBlock, preload: tuple[float, float, float], rules: IntegrationRules
) -> Floats:
    """Element matrices K_sigma of a uniform membrane force on the slopes of w, (ne, 5 nn, 5 nn).

    Integral of (w,x; w,y)' [N_x, N_xy; N_xy, N_y] (w,x; w,y) with the rule of bending, where
    `preload` is N_x, N_y, N_xy (force/length), tension positive.  Exactly symmetric; indefinite
    under compression or shear.  Zienkiewicz and Taylor, The Finite Element Method.
    """
    n_x, n_y, n_xy = preload
    N = np.array([[n_x, n_xy], [n_xy, n_y]])
    at = interpolate(family, rules.bending, transposed_jacobian=rules.transposed_jacobian)
    ne, nn = family.nodes.shape
    K = np.zeros((ne, nn, NDOF, nn, NDOF))
    K[:, :, 2, :, 2] = _integrate(at.dN, N, at.jxw)
    return K.reshape(ne, nn * NDOF, nn * NDOF)


def lumped_shares(values: Floats, areas: Floats) -> Floats:
    """Shares of the nodes in the elements' areas, (ne, nn); see :func:`lumped_mass`.

    `values` (npt, nn) are those of the shape functions, `areas` (ne, npt) those of the points.
    """
    diagonal = np.einsum("ep,pn->en", areas, values**2)
    return np.asarray(diagonal * (areas.sum(axis=1) / diagonal.sum(axis=1))[:, None])


def lumped_mass(
    family: ElementBlock,
    laminate: LaminateSection,
    rule: Quadrature,
    determinants: Floats | None = None,
) -> Floats:
    """Lumped element masses: diagonal of the consistent matrix, scaled to the element's mass.

    The listing's MASS01, the method of Hinton, Rock and Zienkiewicz (1976).  Every entry is
    positive unless a node's shape function is zero at all points, as with order 1 for mid-sides.
    (ne, nn, 5): mass for u, v, w; mass times length squared for the rotations.  `determinants` are
    those of the Jacobian at the points of the rule, (ne, npt), if they are known.
    """
    values, _ = local_shape_functions(family, rule)
    if determinants is None:
        determinants = jacobian_determinants(family, rule)
    share = lumped_shares(values, determinants * rule.weights)
    inertia = np.repeat([laminate.mass, laminate.rotary_inertia], (3, 2))
    return np.asarray(share[:, :, None] * inertia)


def consistent_mass(family: ElementBlock, laminate: LaminateSection, rule: Quadrature) -> Floats:
    """Consistent element mass matrices, M_p of equation 4-14 (the listing's MASS01).

    The integral of N_i N_j times the mass per area rho h for u, v and w, and times the rotary
    inertia rho h^3 / 12 for the rotations; different dofs are not coupled.  (ne, 5 nn, 5 nn),
    exactly symmetric.  The rule is exact on parallelograms with order 2 for the 4-node element, 3
    with mid-sides, and 4 for the cubic element.
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
