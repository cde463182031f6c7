"""Strains and stress resultants at the points of every element (the listing's STRE)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property

import numpy as np

from fecm._typing import Floats, Indices
from fecm.mechanics.assumed_shear import TiedStrains
from fecm.mechanics.elements import Quadrature
from fecm.mechanics.interpolation import NDOF, inverse_jacobian, local_shape_functions
from fecm.mechanics.laminate import Laminate
from fecm.mechanics.mesh import ElementBlock, Ints, element_blocks

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

Rows = Indices | slice  # of elements

# Elements per product: so few that BLAS uses one thread.
STRAIN_BLOCK = 256


def strains_and_resultants(
    strains: StrainField,
    laminates: Sequence[tuple[Laminate, Rows]],
    field: Floats,
    preload: tuple[float, float, float],
    of_deflection: Floats | None = None,
) -> dict[str, Floats]:
    """Midplane strains, curvatures, transverse shear strains and resultants (equation 2-20).

    Each is (numel, npt), by the names of :data:`GENERALISED_STRAINS` and :data:`RESULTANTS`, of a
    displacement field (numnp, 5).  Each laminate has rows of elements.

    The membrane forces include `preload`, N_x, N_y, N_xy of the undeformed plate; the strains do
    not.  The midplane strains `of_deflection`, (3, numel, npt), of a curved or nonlinear plate are
    added to those of u and v.
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
        self.shape = (len(elements), len(rule.xi))
        self.rule, self.assumes_shear = rule, assumes_shear
        self.transposed_jacobian = transposed_jacobian
        self._mesh = elements, coordinates

    @cached_property
    def families(self) -> list[ElementBlock]:
        """The elements, in blocks with the same nodes present."""
        return element_blocks(*self._mesh)

    @cached_property
    def _blocks(self) -> list[tuple[Indices, Indices, Floats, Floats, TiedStrains | None]]:
        blocks = []
        for family in self.families:
            values, local = local_shape_functions(family, self.rule)
            # Rows: d/dxi, d/deta and value at every point, for one matrix product.
            table = np.concatenate([local[:, 0], local[:, 1], values])
            slip = self.transposed_jacobian
            inverse, _ = inverse_jacobian(family, local, transposed_jacobian=slip)
            for start in range(0, len(family.rows), STRAIN_BLOCK):
                cut = slice(start, start + STRAIN_BLOCK)
                places = family.nodes[cut].T[:, None] * NDOF + np.array([2, 3, 4])[:, None]
                metric = inverse[cut].transpose(2, 3, 1, 0)[:, :, :, None].copy()
                members = np.arange(len(family.rows))[cut]
                tied = TiedStrains(family.take(members), self.rule) if self.assumes_shear else None
                blocks.append((family.rows[cut], places, table, metric, tied))
        return blocks

    def places(self, coordinates: Floats) -> tuple[Floats, Floats]:
        """Coordinates x and y of the points, (numel, npt)."""
        x, y = self.interpolated(coordinates)
        return x, y

    def interpolated(self, nodal: Floats) -> Floats:
        """Values at the points, (n, numel, npt), of nodal values (numnp, n)."""
        found = np.empty((nodal.shape[1], *self.shape))
        for family in self.families:
            values, _ = local_shape_functions(family, self.rule)
            found[:, family.rows] = np.einsum("eni,pn->iep", nodal[family.nodes], values)
        return found

    def evaluate(self, displacement: Floats) -> Floats:
        """Strains of a displacement field (numnp, 5), or of several (rows, numnp, 5).

        kappa_x, kappa_y, kappa_xy (1/length), gamma_yz and gamma_xz: (5, numel, npt), or
        (5, rows, numel, npt).
        """
        leading = displacement.shape[:-2]
        fields = displacement.reshape(math.prod(leading), -1)
        strains = np.empty((len(STRAINS), len(fields), *self.shape))
        npt = self.shape[1]
        for rows, places, table, inverse, tied in self._blocks:
            q = fields.take(places, axis=1).reshape(len(fields), len(places), -1)
            at = (table @ q).reshape(len(fields), 3, npt, 3, len(rows))
            xi, eta, values = at.swapaxes(0, 1)  # each: field, point, dof, element
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
