"""Membrane data of a nonlinear plate for the compiled kernels; see membrane.h."""

from __future__ import annotations

import numpy as np

from fecm._typing import Bools, Floats, Indices
from fecm.mechanics import membrane, strains
from fecm.mechanics.elements import Quadrature, gauss
from fecm.mechanics.interpolation import inverse_jacobian, jacobian, local_shape_functions
from fecm.mechanics.mesh import TOLERANCE, ElementBlock
from fecm.mechanics.plate import PlateModel
from fecm.mechanics.strains import FLAT, Curvature, strain_of_deflection

# Upper triangle of a symmetric matrix (3, 3).
_UPPER = np.triu_indices(3)


def has_kernel_membrane(plate: PlateModel) -> bool:
    """Return whether the kernels have the membrane: for 9-node elements with 3 x 3 points."""
    rules = plate.rules
    return (
        rules.assumes_shear
        and len(rules.bending.xi) == 9
        and all(map(membrane.has_tied_membrane, plate.families))
    )


def node_grid(family: ElementBlock) -> Indices:
    """Return the nodes of a 9-node element in rows of eta, xi ascending, (9,)."""
    return np.lexsort((family.shape.xi, family.shape.eta))


def are_parallelograms(family: ElementBlock) -> Bools:
    """Return whether elements are parallelograms with their inner nodes in the middle, (ne,).

    Positions are compared as for :attr:`~fecm.mechanics.mesh.ElementBlock.congruence`.
    """
    shape = family.shape
    middle = np.flatnonzero((shape.xi == 0.0) & (shape.eta == 0.0))
    places = family.coordinates - family.coordinates[:, middle]
    local = np.stack([shape.xi, shape.eta], axis=1)
    deviation = abs(places - local @ _centre(family)).max(axis=(1, 2))
    return np.asarray(deviation <= TOLERANCE * abs(places).max(axis=(1, 2)))


def numbers(
    plate: PlateModel,
    family: ElementBlock,
    weights: Floats,
    curvature: Curvature = FLAT,
    *,
    parallelograms: bool,
) -> Floats:
    """Return the data of elements: (ne, 16) for parallelograms, (ne, 73) or (ne, 76) otherwise.

    The data of every element start with halves of the base vectors x,xi and x,eta of the centre,
    (2, 2), and with the upper triangles of A and -B for covariant strains, (6,) each.  For
    parallelograms A and B are multiplied by the Jacobian determinant and by `weights`, the number
    of elements that each element represents.

    Other elements also have derivatives along half a base vector, per derivative in xi and in eta:
    along the first vector at the tying points of e_11, (6, 2), along the second vector at the tying
    points of e_22, (6, 2), and along both vectors at the tying points of e_12, (4, 2, 2), and the
    :func:`shape_numbers`, (17,).  With a curvature the covariant strains per w follow, (3,).
    """
    centre, laminate = _centre(family), plate.laminate_of(family)
    to_global = membrane.covariant_to_global(centre)
    stiffness = np.stack([laminate.A, -laminate.B])[:, None]
    covariant = to_global.swapaxes(1, 2) @ stiffness @ to_global  # (2, ne, 3, 3)
    if parallelograms:
        covariant *= (weights * np.linalg.det(centre))[:, None, None]
    parts = [0.5 * centre, *covariant[:, :, *_UPPER]]
    if not parallelograms:
        along, across, _ = strains.TYING[9]
        for xi, eta, rows in (
            (along, across, slice(0, 1)),
            (across, along, slice(1, 2)),
            (along, along, slice(0, 2)),
        ):
            _, local = local_shape_functions(family, _product(xi, eta))
            inverse, _ = inverse_jacobian(family, local)
            parts.append((0.5 * centre[:, None] @ inverse)[:, :, rows])
        parts.append(shape_numbers(family, weights))
    if curvature != FLAT:
        parts.append(np.linalg.inv(to_global) @ strain_of_deflection(curvature))
    return np.concatenate([part.reshape(len(centre), -1) for part in parts], axis=1)


# Value, twice the slope, and second derivative at 0 of a quadratic function, from its values at
# -1, 0 and 1.
QUADRATIC = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 1.0], [1.0, -2.0, 1.0]])


def shape_numbers(family: ElementBlock, weights: Floats) -> Floats:
    """Return a quarter of the weights, and coefficients of x and y without constants, (ne, 17)."""
    order = node_grid(family)
    places = np.ascontiguousarray(family.coordinates.swapaxes(1, 2))
    places -= places[:, :, order[4], None]  # the centre
    table = np.kron(QUADRATIC, QUADRATIC)[1:, np.argsort(order)]
    coefficients = (places.reshape(-1, 9) @ table.T).reshape(-1, 16)
    return np.concatenate([0.25 * weights[:, None], coefficients], axis=1)


def in_rows(rule: Quadrature) -> Quadrature:
    """Sort the points of a rule into rows of eta, xi ascending."""
    rows = np.lexsort((rule.xi, rule.eta))
    return Quadrature(rule.xi[rows], rule.eta[rows], rule.weights[rows])


def _centre(family: ElementBlock) -> Floats:
    """Return the base vectors x,xi and x,eta of the elements' centres, (ne, 2, 2)."""
    _, local = local_shape_functions(family, gauss(1))
    return jacobian(family, local)[:, 0]


def _product(xi: tuple[float, ...], eta: tuple[float, ...]) -> Quadrature:
    """Return the points of a tensor product in rows of eta, without weights."""
    y, x = (grid.ravel() for grid in np.meshgrid(eta, xi, indexing="ij"))
    return Quadrature(x, y, np.zeros_like(x))
