"""What the compiled kernels need for the membrane of a nonlinear plate; see membrane.h.

The numbers of an element are those of its frame at the centre, `FRAME` of them: halves of the base
vectors x,xi and x,eta; the membrane stiffness A and the negative coupling -B for covariant strains.
On parallelograms the stiffnesses are multiplied by the Jacobian determinant and the number of
elements that this one represents.  Other elements have more: at the 9 points, in rows of eta, the
derivatives along both base vectors per derivative in xi and in eta, and the determinant times
weight; then half of such derivatives at the tying points of e_11, of e_22 and of e_12.
"""

from __future__ import annotations

import numpy as np

from fecm._typing import Bools, Floats, Indices
from fecm.mechanics import assumed_shear
from fecm.mechanics.elements import Quadrature, gauss
from fecm.mechanics.interpolation import inverse_jacobian, jacobian, local_shape_functions
from fecm.mechanics.mesh import TOLERANCE, ElementBlock
from fecm.mechanics.plate import PlateModel

# Upper half of a symmetric (3, 3).
_UPPER = np.triu_indices(3)


def supports(plate: PlateModel) -> bool:
    """Whether the kernels have the membrane of a plate: of 9-node elements with 3 x 3 points."""
    rules = plate.rules
    nine = all(family.shape.nodes == 9 == family.nodes.shape[1] for family in plate.families)
    return nine and rules.assumes_shear and len(rules.bending.xi) == 9


def grid(family: ElementBlock) -> Indices:
    """Places of the nodes of a 9-node element in rows of eta, xi ascending, (9,)."""
    return np.lexsort((family.shape.xi, family.shape.eta))


def are_parallelograms(family: ElementBlock) -> Bools:
    """Whether elements are parallelograms, with their inner nodes in the middle, (ne,).

    Positions are compared as for :func:`~fecm.mechanics.mesh.congruence`.
    """
    shape = family.shape
    middle = np.flatnonzero((shape.xi == 0.0) & (shape.eta == 0.0))
    places = family.coordinates - family.coordinates[:, middle]
    local = np.stack([shape.xi, shape.eta], axis=1)
    apart = abs(places - local @ _centre(family)).max(axis=(1, 2))
    return np.asarray(apart <= TOLERANCE * abs(places).max(axis=(1, 2)))


def numbers(
    plate: PlateModel, family: ElementBlock, weights: Floats, *, parallelograms: bool
) -> Floats:
    """Numbers of elements that represent `weights` of them, (ne, 16) or (ne, 101)."""
    centre = _centre(family)
    laminate = plate.laminate
    to_global = _to_global(np.linalg.inv(centre))
    stiffness = np.stack([laminate.A, -laminate.B])[:, None]
    covariant = to_global.swapaxes(1, 2) @ stiffness @ to_global  # (2, ne, 3, 3)
    if parallelograms:
        covariant *= (weights * np.linalg.det(centre))[:, None, None]
    parts = [0.5 * centre, *covariant[:, :, *_UPPER]]
    if not parallelograms:
        along, across, _ = assumed_shear.TYING[9]
        for xi, eta, rows in (
            (along, across, slice(0, 1)),
            (across, along, slice(1, 2)),
            (along, along, slice(0, 2)),
        ):
            _, local = local_shape_functions(family, _product(xi, eta))
            inverse, _ = inverse_jacobian(family, local)
            parts.append((0.5 * centre[:, None] @ inverse)[:, :, rows])
    return np.concatenate([part.reshape(len(centre), -1) for part in parts], axis=1)


def in_rows(rule: Quadrature) -> Quadrature:
    """The points of a rule in rows of eta, xi ascending."""
    rows = np.lexsort((rule.xi, rule.eta))
    return Quadrature(rule.xi[rows], rule.eta[rows], rule.weights[rows])


def _centre(family: ElementBlock) -> Floats:
    """Base vectors x,xi and x,eta of the elements' centres, (ne, 2, 2)."""
    _, local = local_shape_functions(family, gauss(1))
    return jacobian(family, local)[:, 0]


def _to_global(inverse: Floats) -> Floats:
    """Strains xx, yy, xy per covariant e_11, e_22, e_12, (ne, 3, 3); dxi_a/dx_i in row i."""
    (xi_x, eta_x), (xi_y, eta_y) = inverse.transpose(1, 2, 0)
    rows = [
        [xi_x**2, eta_x**2, xi_x * eta_x],
        [xi_y**2, eta_y**2, xi_y * eta_y],
        [2.0 * xi_x * xi_y, 2.0 * eta_x * eta_y, xi_x * eta_y + xi_y * eta_x],
    ]
    return np.array(rows).transpose(2, 0, 1)


def _product(xi: tuple[float, ...], eta: tuple[float, ...]) -> Quadrature:
    """Points of a tensor product in rows of eta, without weights."""
    y, x = (grid.ravel() for grid in np.meshgrid(eta, xi, indexing="ij"))
    return Quadrature(x, y, np.zeros_like(x))
