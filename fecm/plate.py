"""Plate elements: geometry, stiffness, lumped mass and strains of many elements at once.

Conventions: the unknowns of a node are u, v, w, theta_x, theta_y; an element's unknowns run node by
node.  Rotations have the listing's sign, opposite to the report's phi: transverse shear is
gamma_xz = w,x - theta_x and gamma_yz = w,y - theta_y, curvature kappa_x = -theta_x,x and
kappa_y = -theta_y,y.  Arrays over elements have the element first, then the quadrature point.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fecm.elements.catalogue import MOST_NODES, shape_of
from fecm.elements.quadrature import Rule
from fecm.elements.shape import ElementShape
from fecm.laminate import Laminate

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Bools = NDArray[np.bool_]

UNKNOWNS = 5
STRAINS = ("kappa_x", "kappa_y", "kappa_xy", "gamma_yz", "gamma_xz")


@dataclass(frozen=True)
class Family:
    """Elements that have the same nodes present.

    Attributes
    ----------
    rows : ndarray (ne,)
        The elements' rows in the mesh.
    nodes : ndarray (ne, nn)
        Rows of their nodes, from 0.
    coordinates : ndarray (ne, nn, 2)
        Length.
    present : ndarray (shape.nodes,) of bool
        Which of their shape's nodes they have.
    shape : ElementShape
        Triangle, quadrilateral or cubic quadrilateral.
    """

    rows: NDArray[np.intp]
    nodes: NDArray[np.intp]
    coordinates: Floats
    present: Bools
    shape: ElementShape

    def blocks(self, size: int) -> Iterator[Family]:
        """Cut the family into blocks of at most `size` elements."""
        for start in range(0, len(self.rows), size):
            yield self.take(np.arange(start, min(start + size, len(self.rows))))

    def take(self, members: NDArray[np.intp]) -> Family:
        """Pick some of the family's elements, by their position in it."""
        return replace(
            self,
            rows=self.rows[members],
            nodes=self.nodes[members],
            coordinates=self.coordinates[members],
        )


def families(elements: Ints, coordinates: Floats) -> list[Family]:
    """Sort elements by the nodes they have; a family's shape follows from the last of them.

    Parameters
    ----------
    elements : ndarray (numel, nen)
        Node numbers from 1, 0 where absent; nen is at most 12.
    coordinates : ndarray (numnp, 2)
        Length.

    Raises
    ------
    ValueError
        If an element lacks one of its corners: three up to a third node, four beyond.
    """
    nodes = np.zeros((len(elements), max(MOST_NODES, elements.shape[1])), dtype=np.intp)
    nodes[:, : elements.shape[1]] = elements
    found: list[Family] = []
    given = nodes > 0
    # Patterns in the order of their bits, first node first.
    codes = given @ (1 << np.arange(given.shape[1])[::-1])
    for code in np.unique(codes):
        rows = np.flatnonzero(codes == code)
        present = given[rows[0]]
        shape = shape_of(present)
        if not present[: shape.corners].all():
            raise ValueError(
                f"element {rows[0] + 1} lacks one of the {shape.corners} corners of a {shape.name}"
            )
        members = nodes[rows][:, present] - 1
        found.append(Family(rows, members, coordinates[members], present[: shape.nodes], shape))
    return found


@dataclass(frozen=True)
class Interpolation:
    """Shape functions of a family at the points of a rule.

    Attributes
    ----------
    N : ndarray (npt, nn)
        Values.
    dN : ndarray (ne, npt, 2, nn)
        Derivatives with respect to x and y, 1/length.
    area : ndarray (ne, npt)
        Area that belongs to each point: Jacobian determinant times weight.
    """

    N: Floats
    dN: Floats
    area: Floats


def local_shape_functions(family: Family, rule: Rule) -> tuple[Floats, Floats]:
    """Shape functions of a family's nodes: values (npt, nn), d/dxi and d/deta (npt, 2, nn)."""
    values, local = family.shape.shape_functions(rule.xi, rule.eta, family.present)
    return values[:, family.present], local[:, :, family.present]


def inverse_jacobian(
    family: Family, local: Floats, *, transposed: bool = False
) -> tuple[Floats, Floats]:
    """Inverse of the Jacobian, and its determinant.

    Parameters
    ----------
    family : Family
        The elements.
    local : ndarray (npt, 2, nn)
        Derivatives of the shape functions with respect to xi and eta.
    transposed : bool
        Give the inverse transposed (the slip ``jacobian``).

    Returns
    -------
    inverse : ndarray (ne, npt, 2, 2)
        dxi_a/dx_i in row i and column a, 1/length.
    determinant : ndarray (ne, npt)
        Length squared.
    """
    jacobian = np.einsum("pan,eni->epai", local, family.coordinates)  # dx_i/dxi_a
    inverse = np.linalg.inv(jacobian)
    if transposed:
        inverse = inverse.swapaxes(-1, -2)
    return inverse, np.linalg.det(jacobian)


def jacobian_determinants(family: Family, rule: Rule) -> Floats:
    """Determinant of the Jacobian at the points of a rule, (ne, npt), length squared."""
    _, local = local_shape_functions(family, rule)
    return np.asarray(np.linalg.det(np.einsum("pan,eni->epai", local, family.coordinates)))


def interpolate(family: Family, rule: Rule, *, transposed: bool = False) -> Interpolation:
    """Evaluate shape functions and their derivatives in x and y.

    Parameters
    ----------
    family : Family
        The elements.
    rule : Rule
        The points.
    transposed : bool
        Use the inverse Jacobian transposed (the slip ``jacobian``).
    """
    values, local = local_shape_functions(family, rule)
    inverse, determinant = inverse_jacobian(family, local, transposed=transposed)
    derivatives = np.einsum("epia,pan->epin", inverse, local)
    return Interpolation(values, derivatives, determinant * rule.weights)


def _membrane_and_bending(at: Interpolation) -> Floats:
    """Matrix of midplane strains xx, yy, xy and curvatures xx, yy, xy: (ne, npt, 6, 5 nn)."""
    ne, npt, _, nn = at.dN.shape
    B = np.zeros((ne, npt, 6, nn, UNKNOWNS))
    x, y = at.dN[:, :, 0], at.dN[:, :, 1]
    B[:, :, 0, :, 0] = x
    B[:, :, 1, :, 1] = y
    B[:, :, 2, :, 0], B[:, :, 2, :, 1] = y, x
    B[:, :, 3, :, 3] = -x
    B[:, :, 4, :, 4] = -y
    B[:, :, 5, :, 3], B[:, :, 5, :, 4] = -y, -x
    return B.reshape(ne, npt, 6, nn * UNKNOWNS)


def _transverse_shear(at: Interpolation) -> Floats:
    """Matrix of transverse shear strains xz, yz: (ne, npt, 2, 5 nn)."""
    ne, npt, _, nn = at.dN.shape
    B = np.zeros((ne, npt, 2, nn, UNKNOWNS))
    for row in (0, 1):
        B[:, :, row, :, 2] = at.dN[:, :, row]
        B[:, :, row, :, 3 + row] = -at.N
    return B.reshape(ne, npt, 2, nn * UNKNOWNS)


def _integrate(B: Floats, C: Floats, area: Floats) -> Floats:
    """Sum of B' C B over the points, (ne, n, n); exactly symmetric."""
    ne, npt, rows, n = B.shape
    flat = B.reshape(ne, npt * rows, n)
    weighted = (area[:, :, None, None] * (C @ B)).reshape(ne, npt * rows, n)
    product = flat.swapaxes(1, 2) @ weighted
    return np.asarray((product + product.swapaxes(1, 2)) / 2.0)


def stiffness(
    family: Family,
    laminate: Laminate,
    bending: Rule,
    shear: Rule,
    *,
    transposed: bool = False,
) -> Floats:
    """Stiffness matrices of a family's elements.

    Parameters
    ----------
    family : Family
        The elements.
    laminate : Laminate
        Stiffness per area.
    bending, shear : Rule
        Quadrature of the membrane and bending energy, and of the transverse shear energy.
    transposed : bool
        See :func:`interpolate`.

    Returns
    -------
    ndarray (ne, 5 nn, 5 nn)
    """
    ABD = np.block([[laminate.A, laminate.B], [laminate.B, laminate.D]])
    at = interpolate(family, bending, transposed=transposed)
    K = _integrate(_membrane_and_bending(at), ABD, at.area)
    at = interpolate(family, shear, transposed=transposed)
    return K + _integrate(_transverse_shear(at), laminate.shear, at.area)


def lumped_mass(family: Family, laminate: Laminate, rule: Rule) -> Floats:
    """Lumped masses of a family's elements: the consistent matrix' diagonal, scaled to the whole.

    The listing's MASS01.  The scaling keeps the element's mass; every entry is positive unless the
    rule has all its points on a node's zero line, as order 1 has for mid-sides and corners.

    Returns
    -------
    ndarray (ne, nn, 5)
        Mass for u, v, w; mass times length squared for the rotations.
    """
    values, _ = local_shape_functions(family, rule)
    area = jacobian_determinants(family, rule) * rule.weights
    diagonal = np.einsum("ep,pn->en", area, values**2)
    share = diagonal * (area.sum(axis=1) / diagonal.sum(axis=1))[:, None]
    inertia = np.repeat([laminate.mass, laminate.rotary_inertia], (3, 2))
    return np.asarray(share[:, :, None] * inertia)


def consistent_mass(family: Family, laminate: Laminate, rule: Rule) -> Floats:
    """Consistent mass matrices of a family's elements (the listing's MASS01).

    Two nodes share the integral of N_i N_j, with the mass per area rho h for u, v and w, and with
    the rotary inertia rho h^3 / 12 for the rotations; different unknowns share nothing.

    Parameters
    ----------
    family : Family
        The elements.
    laminate : Laminate
        Mass and rotary inertia per area.
    rule : Rule
        Quadrature; the 4-node element takes order 2, those with mid-sides order 3, the cubic one
        order 4 to be exact on parallelograms.

    Returns
    -------
    ndarray (ne, 5 nn, 5 nn)
        Mass for u, v, w; mass times length squared for the rotations.  Exactly symmetric.
    """
    values, _ = local_shape_functions(family, rule)
    area = jacobian_determinants(family, rule) * rule.weights
    product = np.einsum("ep,pi,pj->eij", area, values, values, optimize=True)
    shared = (product + product.swapaxes(1, 2)) / 2.0
    inertia = np.repeat([laminate.mass, laminate.rotary_inertia], (3, 2))
    ne, nn = family.nodes.shape
    M = np.zeros((ne, nn, UNKNOWNS, nn, UNKNOWNS))
    for unknown in range(UNKNOWNS):
        M[:, :, unknown, :, unknown] = inertia[unknown] * shared
    return M.reshape(ne, nn * UNKNOWNS, nn * UNKNOWNS)


# Elements whose strains are found at once: so few that BLAS uses one thread.
STRAIN_BLOCK = 256


class StrainField:
    """Curvatures and transverse shear strains at the same points of every element.

    Parameters
    ----------
    elements : ndarray (numel, nen)
        Node numbers from 1, 0 where absent.
    coordinates : ndarray (numnp, 2)
        Length.
    rule : Rule
        The points.
    transposed : bool
        See :func:`interpolate`.
    """

    def __init__(
        self, elements: Ints, coordinates: Floats, rule: Rule, *, transposed: bool = False
    ) -> None:
        self.shape = (len(elements), len(rule.xi))
        self._families: list[tuple[Family, Floats]] = []
        self._blocks: list[tuple[NDArray[np.intp], NDArray[np.intp], Floats, Floats]] = []
        for family in families(elements, coordinates):
            values, local = local_shape_functions(family, rule)
            self._families.append((family, values))
            # Rows: d/dxi, d/deta and value at every point, so that one product gives them all.
            table = np.concatenate([local[:, 0], local[:, 1], values])
            inverse = inverse_jacobian(family, local, transposed=transposed)[0]
            for start in range(0, len(family.rows), STRAIN_BLOCK):
                cut = slice(start, start + STRAIN_BLOCK)
                places = family.nodes[cut].T[:, None] * UNKNOWNS + np.array([2, 3, 4])[:, None]
                self._blocks.append(
                    (
                        family.rows[cut],
                        places,
                        table,
                        inverse[cut].transpose(2, 3, 1, 0)[:, :, :, None].copy(),
                    )
                )

    def places(self, coordinates: Floats) -> tuple[Floats, Floats]:
        """Where the points are: x and y, (numel, npt)."""
        x, y = np.empty((2, *self.shape))
        for family, values in self._families:
            place = np.einsum("eni,pn->iep", coordinates[family.nodes], values)
            x[family.rows], y[family.rows] = place
        return x, y

    def evaluate(self, displacement: Floats) -> Floats:
        """Strains of a displacement field, or of several.

        Parameters
        ----------
        displacement : ndarray (numnp, 5) or (rows, numnp, 5)
            All unknowns of all nodes.

        Returns
        -------
        ndarray (5, numel, npt) or (5, rows, numel, npt)
            kappa_x, kappa_y, kappa_xy (1/length), gamma_yz, gamma_xz.
        """
        leading = displacement.shape[:-2]
        fields = displacement.reshape(math.prod(leading), -1)
        strains = np.empty((len(STRAINS), len(fields), *self.shape))
        npt = self.shape[1]
        for rows, places, table, inverse in self._blocks:
            q = fields.take(places, axis=1).reshape(len(fields), len(places), -1)
            at = (table @ q).reshape(len(fields), 3, npt, 3, len(rows))
            xi, eta, values = at.swapaxes(0, 1)  # each: field, point, unknown, element
            dx = inverse[0, 0] * xi + inverse[0, 1] * eta
            dy = inverse[1, 0] * xi + inverse[1, 1] * eta
            # 0.0 - a, so that a plate at rest has no negative zeros.
            parts = (
                0.0 - dx[:, :, 1],
                0.0 - dy[:, :, 2],
                0.0 - dy[:, :, 1] - dx[:, :, 2],
                dy[:, :, 0] - values[:, :, 2],
                dx[:, :, 0] - values[:, :, 1],
            )
            for component, part in enumerate(parts):
                strains[component][:, rows] = part.swapaxes(1, 2)
        return strains.reshape(len(STRAINS), *leading, *self.shape)
