"""Strains of plate elements: shallow curvature, assumed transverse shear, and fields over elements.

Shallow curved panels (Marguerre 1938, Donnell 1933).  The midplane
z = -x^2/(2 R_x) - y^2/(2 R_y) - x y/R_xy of a shallow panel stretches as it deflects:

    eps_x = u,x + w/R_x,  eps_y = v,y + w/R_y,  gamma_xy = u,y + v,x + 2 w/R_xy.

Bending, transverse shear and inertia are the same as in a flat plate, and the strains remain
linear.  With a positive radius the centre of curvature is on the side of -w: a deflection w > 0
stretches the panel, and the struck face is concave.

Assumed transverse shear strains, for elements that neither lock nor hourglass.  The covariant
strains e_xi = w,xi - theta_x x,xi - theta_y y,xi and e_eta are evaluated only at tying points and
interpolated between them.  In 9-node elements e_xi is linear in xi between +-1/sqrt(3) and
quadratic in eta through 0 and +-sqrt(3/5); e_eta swaps xi and eta (Bucalem and Bathe 1993).  In
4-node elements e_xi is constant in xi and linear in eta between +-1 (MITC4, Dvorkin and Bathe
1984).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property

import numpy as np

from fecm._typing import Floats, Indices
from fecm.mechanics.elements import Quadrature, gauss
from fecm.mechanics.interpolation import NDOF, inverse_jacobian, local_shape_functions
from fecm.mechanics.laminate import LaminateSection
from fecm.mechanics.mesh import ElementBlock, Ints, element_blocks

# Curvatures 1/R_x, 1/R_y and 1/R_xy, 1/length.
Curvature = tuple[float, float, float]
FLAT: Curvature = (0.0, 0.0, 0.0)


def strain_of_deflection(curvature: Curvature) -> Floats:
    """Return the midplane strains eps_xx, eps_yy, gamma_xy per unit of w, (3,), 1/length.

    Examples
    --------
    >>> strain_of_deflection((0.5, 0.0, 0.25))
    array([0.5, 0. , 0.5])
    """
    x, y, xy = curvature
    return np.array([x, y, 2.0 * xy])


def midplane_height(coordinates: Floats, curvature: Curvature) -> Floats:
    """Return the height z of the midplane, (n,), at points (n, 2).

    z is 0 at the centre of the points' extent.

    Examples
    --------
    >>> midplane_height(np.array([[0.0, 0.0], [2.0, 0.0], [4.0, 0.0]]), (0.01, 0.0, 0.0))
    array([-0.02, -0.  , -0.02])
    """
    low, high = np.nanmin(coordinates, axis=0), np.nanmax(coordinates, axis=0)
    x, y = (coordinates - (low + high) / 2.0).T
    of_x, of_y, twist = curvature
    z: Floats = -(of_x * x**2 + of_y * y**2) / 2.0 - twist * x * y
    return z


# By number of nodes: tying points of e_xi along xi, along eta, and the order of the quadrature.
_G = 3.0**-0.5
_H = 0.6**0.5
TYING = {4: ((0.0,), (-1.0, 1.0), 2), 9: ((-_G, _G), (-_H, 0.0, _H), 3)}


def uses_assumed_shear(family: ElementBlock) -> bool:
    """Return whether the elements of a block have assumed shear strains."""
    return family.shape.nodes == 9 and family.nodes.shape[1] in TYING


def quadrature(family: ElementBlock) -> Quadrature:
    """Return the quadrature rule of the transverse shear energy."""
    return gauss(TYING[family.nodes.shape[1]][2])


def tying_points(nodes: int, axis: int) -> Quadrature:
    """Return the tying points of e_xi (axis 0) or e_eta (axis 1) in an element of `nodes` nodes."""
    a, b = (grid.ravel() for grid in np.meshgrid(*TYING[nodes][:2]))
    return Quadrature(b, a, 0.0 * a) if axis else Quadrature(a, b, 0.0 * a)


def tying_weights(nodes: int, axis: int, rule: Quadrature) -> Floats:
    """Return the interpolation from tying points to the points of a rule, (npt, tying)."""
    along, across, _ = TYING[nodes]
    t_along, t_across = (rule.eta, rule.xi) if axis else (rule.xi, rule.eta)
    product = _lagrange(across, t_across)[:, :, None] * _lagrange(along, t_along)[:, None, :]
    return product.reshape(len(rule.xi), -1)


def strain_matrix(family: ElementBlock, rule: Quadrature) -> Floats:
    """Return the B matrix of the assumed strains gamma_xz, gamma_yz, (ne, npt, 2, 5 nn)."""
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
        """Return e_xi, e_eta (fields, npt, ne) of w, theta_x, theta_y (fields, nn, 3 ne)."""
        result: list[Floats] = []
        for table, slope, weights in self._axes:
            at_tying = (table @ q).reshape(len(q), 2, len(table) // 2, 3, -1)
            strain = (
                at_tying[:, 0, :, 0]
                - at_tying[:, 1, :, 1] * slope[0]
                - at_tying[:, 1, :, 2] * slope[1]
            )
            result.append(weights @ strain)
        return result[0], result[1]


def _lagrange(nodes: tuple[float, ...], points: Floats) -> Floats:
    """Evaluate the Lagrange polynomials of nodes at points, (npt, nodes)."""
    x = np.array(nodes)
    factors = (points[:, None, None] - x) / np.where(
        np.eye(len(x), dtype=bool), 1.0, x[:, None] - x
    )
    factors[:, np.eye(len(x), dtype=bool)] = 1.0
    return np.asarray(factors.prod(axis=2))


GENERALISED_STRAINS = (
    "eps_xx",
    "eps_yy",
    "gamma_xy",
    "kappa_x",
    "kappa_y",
    "kappa_xy",
    "gamma_xz",
    "gamma_yz",
)
RESULTANTS = ("N_x", "N_y", "N_xy", "M_x", "M_y", "M_xy", "Q_x", "Q_y")
STRAINS = ("kappa_x", "kappa_y", "kappa_xy", "gamma_yz", "gamma_xz")

Rows = Indices | slice  # rows of elements

# Elements per product, small enough for BLAS to use one thread.
STRAIN_BLOCK = 256


def strains_and_resultants(
    strains: StrainField,
    laminates: Sequence[tuple[LaminateSection, Rows]],
    field: Floats,
    preload: tuple[float, float, float],
    of_deflection: Floats | None = None,
) -> dict[str, Floats]:
    """Return midplane strains, curvatures, transverse shear strains and resultants (equation 2-20).

    The field is (numnp, 5), each result (numel, npt).  The keys are :data:`GENERALISED_STRAINS` and
    :data:`RESULTANTS`.  `laminates` are laminates with the rows of their elements.

    The membrane forces include `preload`, N_x, N_y, N_xy of the undeformed plate; the strains do
    not.  `of_deflection`, (3, numel, npt), are midplane strains of w in a curved or nonlinear
    plate; they are added to the strains of u and v.
    """
    bending = strains.evaluate(field)
    # The curvatures of the rotations (-u, -v) are the midplane strains of u and v.
    in_plane = np.zeros_like(field)
    in_plane[:, 3:] = -field[:, :2]
    membrane = strains.evaluate(in_plane)[:3]
    if of_deflection is not None:
        membrane = membrane + of_deflection
    curvature, shear = bending[:3], bending[[4, 3]]
    N, M, Q = np.empty_like(membrane), np.empty_like(curvature), np.empty_like(shear)
    for laminate, rows in laminates:
        A, B, D = laminate.A, laminate.B, laminate.D
        eps, kappa = membrane[:, rows], curvature[:, rows]
        N[:, rows] = np.tensordot(A, eps, 1) + np.tensordot(B, kappa, 1)
        M[:, rows] = np.tensordot(B, eps, 1) + np.tensordot(D, kappa, 1)
        Q[:, rows] = np.tensordot(laminate.shear, shear[:, rows], 1)
    if any(preload):
        N += np.reshape(preload, (3, 1, 1))
    values = np.concatenate([membrane, curvature, shear, N, M, Q])
    return dict(zip((*GENERALISED_STRAINS, *RESULTANTS), values, strict=True))


class StrainField:
    """Curvatures and transverse shear strains at the same points of every element."""

    def __init__(
        self,
        elements: Ints,
        coordinates: Floats,
        rule: Quadrature,
        *,
        transposed_jacobian: bool = False,
        assumes_shear: bool = False,
    ) -> None:
        self.shape: tuple[int, int] = (len(elements), len(rule.xi))
        self.rule: Quadrature = rule
        self.assumes_shear: bool = assumes_shear
        self.transposed_jacobian = transposed_jacobian
        self._mesh = elements, coordinates

    @cached_property
    def families(self) -> list[ElementBlock]:
        """Elements in blocks with the same nodes present."""
        return element_blocks(*self._mesh)

    @cached_property
    def _blocks(self) -> list[tuple[Indices, Indices, Floats, Floats, TiedStrains | None]]:
        blocks = []
        for family in self.families:
            values, local = local_shape_functions(family, self.rule)
            # Rows: d/dxi, d/deta and value at every point, for one matrix product.
            table = np.concatenate([local[:, 0], local[:, 1], values])
            transposed = self.transposed_jacobian
            inverse, _ = inverse_jacobian(family, local, transposed_jacobian=transposed)
            for start in range(0, len(family.rows), STRAIN_BLOCK):
                cut = slice(start, start + STRAIN_BLOCK)
                places = family.nodes[cut].T[:, None] * NDOF + np.array([2, 3, 4])[:, None]
                metric = inverse[cut].transpose(2, 3, 1, 0)[:, :, :, None].copy()
                members = np.arange(len(family.rows))[cut]
                tied = TiedStrains(family.take(members), self.rule) if self.assumes_shear else None
                blocks.append((family.rows[cut], places, table, metric, tied))
        return blocks

    def places(self, coordinates: Floats) -> tuple[Floats, Floats]:
        """Return the coordinates x and y of the points, (numel, npt) each."""
        x, y = self.interpolated(coordinates)
        return x, y

    def interpolated(self, nodal: Floats) -> Floats:
        """Interpolate nodal values (numnp, n) to the points, (n, numel, npt)."""
        result = np.empty((nodal.shape[1], *self.shape))
        for family in self.families:
            values, _ = local_shape_functions(family, self.rule)
            result[:, family.rows] = np.einsum("eni,pn->iep", nodal[family.nodes], values)
        return result

    def evaluate(self, displacement: Floats) -> Floats:
        """Return the strains of a displacement field (numnp, 5), or of fields (rows, numnp, 5).

        The strains are kappa_x, kappa_y, kappa_xy (1/length), gamma_yz and gamma_xz: (5, numel,
        npt) for one field, (5, rows, numel, npt) for several.
        """
        leading = displacement.shape[:-2]
        fields = displacement.reshape(math.prod(leading), -1)
        strains = np.empty((len(STRAINS), len(fields), *self.shape))
        npt = self.shape[1]
        for rows, places, table, inverse, tied in self._blocks:
            q = fields.take(places, axis=1).reshape(len(fields), len(places), -1)
            local = (table @ q).reshape(len(fields), 3, npt, 3, len(rows))
            xi, eta, values = local.swapaxes(0, 1)  # each: field, point, dof, element
            dx = inverse[0, 0] * xi + inverse[0, 1] * eta
            dy = inverse[1, 0] * xi + inverse[1, 1] * eta
            gamma_xz, gamma_yz = dx[:, :, 0] - values[:, :, 1], dy[:, :, 0] - values[:, :, 2]
            if tied is not None:
                e_xi, e_eta = tied.covariant(q)
                gamma_xz, gamma_yz = (
                    inverse[:, 0, None, :, 0] * e_xi + inverse[:, 1, None, :, 0] * e_eta
                )
            # 0.0 - a avoids negative zeros of a plate at rest.
            kappa_xy = 0.0 - dy[:, :, 1] - dx[:, :, 2]
            parts = (0.0 - dx[:, :, 1], 0.0 - dy[:, :, 2], kappa_xy, gamma_yz, gamma_xz)
            for component, part in enumerate(parts):
                strains[component][:, rows] = part.swapaxes(1, 2)
        return strains.reshape(len(STRAINS), *leading, *self.shape)
