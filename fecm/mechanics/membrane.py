"""Stretching of a plate that bends: tied membrane strains of von Karman.

A plate whose midplane slopes are not small stretches by eps_q = (w,x^2/2, w,y^2/2, w,x w,y).  The
membrane force is N = N0 + A (eps_l + eps_q) + B kappa, where eps_l is the linear strain of u and v,
and of w/R in a curved plate (:mod:`~fecm.mechanics.strains`).  The internal force f is the gradient
of the strain energy

    U = 1/2 int (eps A eps + 2 eps B kappa + kappa D kappa + gamma S gamma) dA
        + 1/2 int (N0_x w,x^2 + N0_y w,y^2 + 2 N0_xy w,x w,y) dA,   eps = eps_l + eps_q.

Signs, axes and the order of strains follow :mod:`~fecm.mechanics.element_matrices`.  Rotations are
moderate: the error of the strains is about the square of the slope.

Membrane locking.  In an element w,x^2 is quadratic in x but eps_l only linear.  A plate that bends
without stretching would therefore be too stiff.  To avoid this, the quadratic strains are evaluated
at the tying points of the assumed shear strains (:mod:`~fecm.mechanics.strains`) and interpolated
between them.  Their components are covariant, along the base vectors x,xi and x,eta of the
element's centre: e_11 = w,1^2/2, e_22 = w,2^2/2, e_12 = w,1 w,2, where w,a is the slope along base
vector a.  The tying points of e_11 are xi = +-1/sqrt(3), eta = 0, +-sqrt(3/5); e_22 swaps xi and
eta; e_12 has +-1/sqrt(3) in both directions.  With the base vectors of the centre a patch of
constant membrane force is exact on distorted meshes; with the base vectors of the tying points it
is not (Bucalem and Bathe 1993; Wisniewski and Panasz 2013).

In this module the element is the last axis of an array: (..., points, ne).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fecm._typing import Floats, Indices
from fecm.mechanics import strains as assumed_shear
from fecm.mechanics.element_matrices import membrane_and_bending
from fecm.mechanics.elements import Quadrature, gauss
from fecm.mechanics.interpolation import (
    NDOF,
    interpolate,
    inverse_jacobian,
    jacobian,
    local_shape_functions,
)
from fecm.mechanics.laminate import LaminateSection
from fecm.mechanics.mesh import ElementBlock
from fecm.mechanics.plate import PlateModel
from fecm.mechanics.strains import StrainField, strain_of_deflection

# Elements per block: their arrays fit the cache.
BLOCK = 256
# Number of tying points of e_11 or e_22.  The tying points of e_12 follow in arrays of slopes.
TYING = 6


def has_tied_membrane(family: ElementBlock) -> bool:
    """Return whether a block's elements have tied membrane strains, as 9-node elements do."""
    return family.shape.nodes == 9 and family.nodes.shape[1] == 9


def covariant_to_global(base: Floats) -> Floats:
    """Return strains xx, yy, xy per covariant e_11, e_22, e_12, (ne, 3, 3).

    `base` (ne, 2, 2) are the base vectors x,xi and x,eta.
    """
    (xi_x, eta_x), (xi_y, eta_y) = np.linalg.inv(base).transpose(1, 2, 0)
    rows = [
        [xi_x**2, eta_x**2, xi_x * eta_x],
        [xi_y**2, eta_y**2, xi_y * eta_y],
        [2.0 * xi_x * xi_y, 2.0 * eta_x * eta_y, xi_x * eta_y + xi_y * eta_x],
    ]
    return np.array(rows).transpose(2, 0, 1)


class QuadraticStrains:
    """Tied quadratic strains of 9-node elements at the points of a rule."""

    def __init__(self, family: ElementBlock, rule: Quadrature) -> None:
        _, at_centre = local_shape_functions(family, gauss(1))
        centre = jacobian(family, at_centre)[:, 0]  # (ne, a, i): base vectors of the centre
        points = [_with_corners(assumed_shear.tying_points(9, axis)) for axis in (0, 1)]
        # Slopes along base vector a per slope in xi and in eta, (2, points, ne), and their tables.
        self.metric: list[Floats] = []
        self.tables: list[Floats] = []
        for axis, tying_points in enumerate(points):
            _, local = local_shape_functions(family, tying_points)
            inverse, _ = inverse_jacobian(family, local)
            along = np.einsum("ei,etib->bte", centre[:, axis], inverse)
            self.metric.append(np.ascontiguousarray(along))
            self.tables.append(np.concatenate([local[:, 0], local[:, 1]]))
        # Interpolation of e_11, e_22 and e_12 to the points of the rule, (points, tying).
        self.weights = [
            assumed_shear.tying_weights(9, 0, rule),
            assumed_shear.tying_weights(9, 1, rule),
            _corner_weights(rule),
        ]
        self.to_global = covariant_to_global(centre).transpose(1, 2, 0)

    def slopes(self, w: Floats) -> tuple[Floats, Floats]:
        """Return w,1 and w,2 of nodal values (9, ne) at their tying points, (10, ne) each."""
        along_one, along_two = (
            (metric * (table @ w).reshape(metric.shape)).sum(axis=0)
            for metric, table in zip(self.metric, self.tables, strict=True)
        )
        return along_one, along_two

    def of(self, w: Floats) -> Floats:
        """Return strains at the points of the rule, (3, points, ne), of nodal w, (9, ne)."""
        return self.at_points(tied_components(*self.slopes(w)))

    def slope_matrices(self) -> tuple[Floats, Floats]:
        """Return the matrices of the slopes w,1 and w,2, (10, 9, ne) each."""
        along_one, along_two = (
            np.einsum("bte,btn->tne", metric, table.reshape(2, -1, 9))
            for metric, table in zip(self.metric, self.tables, strict=True)
        )
        return along_one, along_two

    def at_points(self, tied: tuple[Floats, Floats, Floats]) -> Floats:
        """Return strains xx, yy, xy at the points of the rule, (3, points, ne).

        The tied components are e_11, e_22 (6, ..., ne) and e_12 (4, ..., ne).  Other axes may stand
        between the points and the elements.
        """
        parts = [np.tensordot(H, e, 1) for H, e in zip(self.weights, tied, strict=True)]
        shape = (3, 3, *[1] * (parts[0].ndim - 1), self.to_global.shape[2])
        return np.asarray((self.to_global.reshape(shape) * np.stack(parts)).sum(axis=1))

    def tied_forces(self, N: Floats) -> tuple[Floats, Floats, Floats]:
        """Return forces n_11, n_22, n_12 on the tied components.

        The membrane forces N, (3, points, ne), contain the weights of the points.
        """
        covariant = (self.to_global[:, :, None] * N[:, None]).sum(axis=0)
        n_11, n_22, n_12 = (H.T @ n for H, n in zip(self.weights, covariant, strict=True))
        return n_11, n_22, n_12

    def nodal_forces(self, along_one: Floats, along_two: Floats) -> Floats:
        """Return the forces on w of the nodes, (9, ne), from forces on the slopes, (10, ne)."""
        of_one, of_two = (
            table.T @ (metric * force).reshape(-1, force.shape[1])
            for force, metric, table in zip(
                (along_one, along_two), self.metric, self.tables, strict=True
            )
        )
        return of_one + of_two


def tied_components(along_one: Floats, along_two: Floats) -> tuple[Floats, Floats, Floats]:
    """Return e_11, e_22 and e_12 from the slopes w,1 and w,2 at their tying points."""
    return (
        0.5 * along_one[:TYING] * along_one[:TYING],
        0.5 * along_two[:TYING] * along_two[:TYING],
        along_one[TYING:] * along_two[TYING:],
    )


def quadratic_strains(family: ElementBlock, rule: Quadrature, field: Floats) -> Floats:
    """Return tied eps_q of a displacement field (numnp, 5) at a rule's points, (3, points, ne)."""
    return QuadraticStrains(family, rule).of(field[family.nodes, 2].T)


def strains_of_deflection(plate: PlateModel, points: StrainField, field: Floats) -> Floats | None:
    """Return the midplane strains of w in a displacement field (numnp, 5), (3, numel, npt).

    They are w/R of a curved plate plus the tied eps_q of a nonlinear plate.  Returns None for a
    plate that is neither.
    """
    strains = quadratic_strains_at(points, field) if plate.nonlinear else None
    if plate.is_curved:
        (w,) = points.interpolated(field[:, 2:3])
        curved = strain_of_deflection(plate.curvature)[:, None, None] * w
        strains = curved if strains is None else strains + curved
    return strains


def quadratic_strains_at(points: StrainField, field: Floats) -> Floats:
    """Return tied eps_q of a displacement field (numnp, 5) in all elements, (3, numel, npt)."""
    strains = np.empty((3, *points.shape))
    for family in points.families:
        strains[:, family.rows] = quadratic_strains(family, points.rule, field).swapaxes(1, 2)
    return strains


class _Elements(NamedTuple):
    """Elements of a block with the arrays that their forces need."""

    nodes: Indices  # (9, ne)
    weight: Floats  # (points, ne): Jacobian determinant times weight
    table: Floats  # (2 points, 9): slopes in xi and in eta
    values: Floats  # (points, 9)
    inverse: Floats  # (2, 2, points, ne): Jacobian's inverse, dxi_a/dx_i in row i and column a
    tied: QuadraticStrains
    laminate: LaminateSection


class MembraneForces:
    """Internal forces of the quadratic strains: f(u) - K u.

    `weights` (numel,) is the number of elements that each element represents, 1 by default.
    Elements of weight 0 are left out.
    """

    def __init__(self, plate: PlateModel, weights: Floats | None = None) -> None:
        self._elements: list[_Elements] = []
        # Strains (3,) per unit of w of a curved plate.
        self._curved = strain_of_deflection(plate.curvature) if plate.is_curved else None
        rule = plate.rules.bending
        for family in plate.families:
            of_family = np.ones(len(family.rows)) if weights is None else weights[family.rows]
            represented = np.flatnonzero(of_family)
            for start in range(0, len(represented), BLOCK):
                members = represented[start : start + BLOCK]
                block = family.take(members)
                values, local = local_shape_functions(block, rule)
                inverse, determinant = inverse_jacobian(block, local)
                area = determinant * rule.weights * of_family[members, None]
                self._elements.append(
                    _Elements(
                        nodes=block.nodes.T.copy(),
                        weight=area.T.copy(),
                        table=np.concatenate([local[:, 0], local[:, 1]]),
                        values=values,
                        inverse=inverse.transpose(2, 3, 1, 0).copy(),
                        tied=QuadraticStrains(block, rule),
                        laminate=plate.laminate_of(block),
                    )
                )

    def forces(self, field: Floats) -> tuple[Floats, float]:
        """Return the forces f(u) - K u of a displacement field, (numnp, 5), and the quadratic work.

        The quadratic work is the integral of (N - N0) eps_q.  The strain energy is
        U = (u f - quadratic work)/2, because eps_q doubles under the variation u.
        """
        numnp = len(field)
        total = np.zeros((NDOF, numnp))
        work = 0.0
        for part in self._elements:
            forces, work_of_part = self._forces(part, field[part.nodes].transpose(2, 0, 1))
            work += work_of_part
            for dof, force in forces.items():
                total[dof] += np.bincount(part.nodes.ravel(), force.ravel(), numnp)
        return total.T, work

    def _forces(self, part: _Elements, q: Floats) -> tuple[dict[int, Floats], float]:
        """Return the forces (9, ne) by dof of some elements, and the quadratic work."""
        A, B, tied = part.laminate.A, part.laminate.B, part.tied
        coupled = part.laminate.is_coupled
        w_1, w_2 = tied.slopes(q[2])
        components = tied_components(w_1, w_2)
        quadratic = tied.at_points(components)
        stretched = part.weight * np.tensordot(A, quadratic, 1)
        strains = _strains(part, q[:2])
        if self._curved is not None:
            strains += self._curved[:, None, None] * (part.values @ q[2])
        N = part.weight * np.tensordot(A, strains, 1) + stretched
        if coupled:
            N -= part.weight * np.tensordot(B, _strains(part, q[3:]), 1)
        n11, n22, n12 = tied.tied_forces(N)
        along_one = np.concatenate([w_1[:TYING] * n11, w_2[TYING:] * n12])
        along_two = np.concatenate([w_2[:TYING] * n22, w_1[TYING:] * n12])
        forces = {2: tied.nodal_forces(along_one, along_two)}
        forces[0], forces[1] = _stress_forces(part, stretched)
        if self._curved is not None:
            forces[2] += part.values.T @ np.tensordot(self._curved, stretched, 1)
        if coupled:
            moments = -part.weight * np.tensordot(B, quadratic, 1)
            forces[3], forces[4] = _stress_forces(part, moments)
        work = sum(float((n * e).sum()) for n, e in zip((n11, n22, n12), components, strict=True))
        return forces, work


def _strains(part: _Elements, q: Floats) -> Floats:
    """Return xx, yy, xy at the points of quadrature, (3, points, ne), of u and v, (2, 9, ne)."""
    (u_x, u_y), (v_x, v_y) = (
        (part.inverse * (part.table @ values).reshape(part.inverse.shape[1:])).sum(axis=1)
        for values in q
    )
    return np.stack([u_x, v_y, u_y + v_x])


def _stress_forces(part: _Elements, N: Floats) -> tuple[Floats, Floats]:
    """Return the forces on u and v, (9, ne) each, of weighted stresses (3, points, ne)."""
    x, y = (
        part.table.T
        @ (part.inverse[0] * N[along] + part.inverse[1] * N[across]).reshape(-1, N.shape[2])
        for along, across in ((0, 2), (2, 1))
    )
    return x, y


def tangent(plate: PlateModel, family: ElementBlock, field: Floats) -> Floats:
    """Return tangent stiffness minus K of a block's elements at a field, (ne, 45, 45).

    The tangent stiffness is the second derivative of the strain energy; it is exactly symmetric.
    """
    rule, laminate = plate.rules.bending, plate.laminate_of(family)
    ne, nn = family.nodes.shape
    shapes = interpolate(family, rule)
    linear = membrane_and_bending(shapes, plate.curvature)
    tied = QuadraticStrains(family, rule)
    q = field[family.nodes].transpose(2, 1, 0)
    w_1, w_2 = tied.slopes(q[2])
    G1, G2 = tied.slope_matrices()
    # Variation of eps_q, (3, points, 9, ne), per w of the nodes.
    varied = tied.at_points(
        (
            w_1[:TYING, None] * G1[:TYING],
            w_2[:TYING, None] * G2[:TYING],
            w_1[TYING:, None] * G2[TYING:] + w_2[TYING:, None] * G1[TYING:],
        )
    )
    quadratic = np.zeros_like(linear)
    quadratic.reshape(ne, -1, 6, nn, NDOF)[:, :, :3, :, 2] = varied.transpose(3, 1, 0, 2)
    ABD = np.block([[laminate.A, laminate.B], [laminate.B, laminate.D]])
    C = shapes.jxw[:, :, None, None] * ABD
    mixed = np.einsum("epik,epij,epjl->ekl", linear, C, quadratic, optimize=True)
    square = np.einsum("epik,epij,epjl->ekl", quadratic, C, quadratic, optimize=True)
    strains = np.einsum("epik,ek->epi", linear, q.transpose(2, 1, 0).reshape(ne, -1))
    stretch = tied.at_points(tied_components(w_1, w_2)).transpose(2, 1, 0)
    N = strains @ ABD[:3].T + stretch @ laminate.A.T
    n11, n22, n12 = tied.tied_forces((shapes.jxw[:, :, None] * N).transpose(2, 1, 0))
    mixed_stress = np.einsum("te,tie,tje->eij", n12, G1[TYING:], G2[TYING:], optimize=True)
    stress = mixed_stress + mixed_stress.swapaxes(1, 2)
    for n, G in ((n11, G1), (n22, G2)):
        stress += np.einsum("te,tie,tje->eij", n, G[:TYING], G[:TYING], optimize=True)
    K = 2.0 * mixed + square
    K.reshape(ne, nn, NDOF, nn, NDOF)[:, :, 2, :, 2] += stress
    return np.asarray((K + K.swapaxes(1, 2)) / 2.0)


# Tying points of e_12: +-1/sqrt(3) in both directions.
_CORNERS = gauss(2)


def _with_corners(points: Quadrature) -> Quadrature:
    """Append the tying points of e_12 to the tying points of e_11 or e_22."""
    xi, eta, weights = (
        np.concatenate([getattr(points, name), getattr(_CORNERS, name)])
        for name in ("xi", "eta", "weights")
    )
    return Quadrature(xi, eta, weights)


def _corner_weights(rule: Quadrature) -> Floats:
    """Return bilinear weights of the tying points of e_12 at a rule's points, (points, 4)."""
    return np.asarray(
        (1.0 + 3.0 * np.outer(rule.xi, _CORNERS.xi))
        * (1.0 + 3.0 * np.outer(rule.eta, _CORNERS.eta))
        / 4.0
    )
