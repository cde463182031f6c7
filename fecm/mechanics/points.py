"""Points of the plate: containing elements, contact patches and strain gages."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from fecm._errors import FecmError
from fecm._typing import Floats, Indices
from fecm.mechanics.elements import Quadrature
from fecm.mechanics.interpolation import NDOF, interpolate
from fecm.mechanics.mesh import ElementBlock, MeshArrays, larger
from fecm.mechanics.strains import FLAT, Curvature, strain_of_deflection

# Tolerance, in local coordinates, for points on the edge of an element.
MARGIN = 1.0e-6
# The Jacobian of a triangle is singular at node 3.
INSIDE = 1.0 - 1.0e-9
PASSES = 50


def containing_elements(family: ElementBlock, points: Floats) -> tuple[Indices, Indices, Floats]:
    """Find every element of a block that contains one of the points, (n, 2), edges included.

    Returns positions of elements in the block (k,), the point of each (k,), and the local
    coordinates of the point in the element (k, 2).
    """
    low, high, size = family.boxes
    close = np.flatnonzero(
        (low <= points.max(axis=0)).all(axis=1) & (points.min(axis=0) <= high).all(axis=1)
    )
    x, y = points.T
    (x_low, y_low), (x_high, y_high) = low[close].T[..., None], high[close].T[..., None]
    is_in_box = (x_low <= x) & (x <= x_high) & (y_low <= y) & (y <= y_high)
    members, point_numbers = np.nonzero(is_in_box)
    members = close[members]
    xi, distance = _local_coordinates(family, family.coordinates[members], points[point_numbers])
    inside = (larger(np.abs(xi)) <= 1.0 + MARGIN) & (distance <= MARGIN * size[members])
    return members[inside], point_numbers[inside], xi[inside]


def _local_coordinates(
    family: ElementBlock, nodes: Floats, points: Floats
) -> tuple[Floats, Floats]:
    """Find the local coordinates (n, 2) of one point per element by Newton's method.

    `nodes`, (n, nn, 2), are the coordinates of the elements' nodes.  The second result, (n,), is
    the remaining distance in x or y, the larger of the two, from the point to the place at the
    local coordinates.
    """
    xi = np.zeros_like(points)
    highest = np.array([2.0, INSIDE if family.shape.corners == 3 else 2.0])
    active = np.arange(len(points))
    for _ in range(PASSES):
        if not len(active):
            break
        functions, corners = _functions(family, xi[active]), nodes[active]
        miss = points[active] - _places(functions, corners)
        step = np.linalg.solve(_jacobians(functions, corners), miss[:, :, None])[:, :, 0]
        xi[active] = np.clip(xi[active] + step, -2.0, highest)
        active = active[larger(np.abs(step)) >= 1e-13]
    return xi, larger(np.abs(points - _places(_functions(family, xi), nodes)))


def _functions(family: ElementBlock, xi: Floats) -> Floats:
    """Evaluate the present nodes' functions, d/dxi and d/deta at n points, (3, nn, n)."""
    return family.shape.functions(xi[:, 0], xi[:, 1], family.present)[:, family.present]


def _places(functions: Floats, nodes: Floats) -> Floats:
    """Return the place of one point per element, (n, 2), in elements with nodes (n, nn, 2)."""
    return np.asarray((functions[0].T.copy()[:, None] @ nodes)[:, 0])


def _jacobians(functions: Floats, nodes: Floats) -> Floats:
    """Return the Jacobian dx_i/dxi_a at one point per element, (n, i, a)."""
    slopes, places = functions[1:].swapaxes(0, 1), nodes.transpose(1, 2, 0).copy()[:, :, None]
    # Sum node by node, in the order of einsum, at a fraction of its cost.
    total = slopes[0] * places[0]
    for slope, place in zip(slopes[1:], places[1:], strict=True):
        total += slope * place
    return np.asarray(total.transpose(2, 0, 1))


# Contact force over a finite area: a pressure on a circle of the midplane -------------------------

# A unit pressure of radius c about (x, y) is uniform, p = 1/(pi c^2), or Hertz's,
# p = 3/(2 pi c^2) sqrt(1 - r^2/c^2).  The nodal weights g_i are the integral of N_i p.  They
# distribute the contact force, F g, and average the displacement in the contact law, W = g w.

DISC = "DISC"
HERTZ = "HERT"
# Equivalent patch radius over the thickness.  With this radius the midplane deflects like a plate
# whose face is pressed over a contact that is small against the thickness (Westergaard;
# three-dimensional elasticity, nu = 0.3).
RADIUS_PER_THICKNESS = {DISC: 0.327, HERTZ: 0.377}

# Number of Gauss points along the radius, and of equal angles, for a radius c of up to SIDES times
# the shortest side a of an element under the patch.  For c = n SIDES a both numbers are multiplied
# by sqrt(n), rounded up.  The relative error of the deflection under the patch is then 1e-6 up to
# c = 25 a, and 3e-5 beyond.
RADII = 24
ANGLES = 48
SIDES = 4.0


class PatchError(FecmError, ValueError):
    """A part of the patch is not on the plate."""


def patch_weights(mesh: MeshArrays, shape: str, radius: float, x: float, y: float) -> Floats:
    """Return nodal weights of w, (numnp,), of a unit pressure on a circle; their sum is 1.

    Raises PatchError if a part of the circle is not on the plate.
    """
    families = mesh.families
    weights, side = _sum_weights(families, len(mesh.coordinates), shape, radius, (x, y), 1)
    if radius > SIDES * side * (1.0 + MARGIN):
        times = math.ceil(math.sqrt(radius / (SIDES * side)))
        weights, _ = _sum_weights(families, len(mesh.coordinates), shape, radius, (x, y), times)
    return np.asarray(weights / weights.sum())


def _sum_weights(
    families: Sequence[ElementBlock],
    nodes: int,
    shape: str,
    radius: float,
    centre: tuple[float, float],
    times: int,
) -> tuple[Floats, float]:
    """Return unscaled nodal weights of w, and the shortest side of an element under the patch.

    The sum has `times` RADII points along the radius and `times` ANGLES angles.
    """
    t, dt = _legendre(times * RADII)
    # Substitute t = r^2/c^2, or t^2 = 1 - r^2/c^2 for Hertz's pressure.  Both are exact for
    # polynomials.
    inner, shares = (1.0 - t * t, 3.0 * t * t * dt) if shape == HERTZ else (t, dt)
    count = times * ANGLES
    angles = (np.arange(count) + 0.5) * (2.0 * np.pi / count)
    # The rim has no weight, but must be on the plate.
    r = radius * np.sqrt(np.append(inner, 1.0))[:, None]
    shares = np.repeat(np.append(shares, 0.0) / count, ANGLES)
    x, y = centre
    weights = np.zeros(nodes)
    side = math.inf
    for sector in np.split(angles, times):
        points = np.stack([x + r * np.cos(sector), y + r * np.sin(sector)], axis=-1).reshape(-1, 2)
        is_on_plate = np.zeros(len(points), dtype=bool)
        for family in families:
            members, numbers, xi = containing_elements(family, points)
            # A point on a common edge counts once.
            numbers, first = np.unique(numbers, return_index=True)
            is_new = ~is_on_plate[numbers]
            members, numbers, xi = members[first][is_new], numbers[is_new], xi[first][is_new]
            is_on_plate[numbers] = True
            values = _functions(family, xi)[0].T
            np.add.at(weights, family.nodes[members], shares[numbers, None] * values)
            side = min(side, shortest_side(family.take(np.unique(members))))
        if not is_on_plate.all():
            place = ", ".join(f"{value:.6g}" for value in points[~is_on_plate][0])
            raise PatchError(f"the patch is not on the plate at ({place})")
    return weights, side


@cache
def _legendre(points: int) -> tuple[Floats, Floats]:
    """Return points and weights of the Gauss-Legendre rule on 0 <= t <= 1."""
    t, dt = np.polynomial.legendre.leggauss(points)
    return (t + 1.0) / 2.0, dt / 2.0


def shortest_side(elements: ElementBlock) -> float:
    """Return the shortest distance of two consecutive corners; infinite without elements."""
    corners = elements.coordinates[:, : elements.shape.corners]
    sides = np.roll(corners, -1, axis=1) - corners
    return float(np.hypot(sides[..., 0], sides[..., 1]).min(initial=math.inf))


# Strain gages: the normal strain at a point of the plate, in a direction and at a depth -----------

# z runs from the midplane towards the face away from the projectile.  Normals stay straight,
# u(z) = u - z theta, so that the strain at z is the midplane strain plus z times the curvature.
# Strains are discontinuous between elements: a gage on a common edge or node reads the mean of the
# adjacent elements.  A curved plate adds w/R in the gage's direction.  A plate that stretches as it
# bends adds (dw/ds)^2/2 of the mean slope.


class OutsideError(FecmError, ValueError):
    """A point is not on the plate."""


# Frozen, so that read-only attributes match; without generated methods, which take 0.4 ms.
@dataclass(frozen=True, init=False, eq=False, repr=False, match_args=False)
class GagePlace(Protocol):
    """Number, position (length) and direction (degrees from the x-axis) of a gage."""

    number: int
    x: float
    y: float
    z: float
    direction: float


class GageArray(NamedTuple):
    """Gages, as weighted sums of dofs that give their strains.

    The first rows are the linear strains of the gages.  For a nonlinear plate the slopes dw/ds
    follow.
    """

    numbers: NDArray[np.int32]  # (gages,)
    dof_indices: Indices  # (rows, m): indices into a flattened field
    weights: Floats  # (rows, m): strain or slope per unit of the dof

    def strains(self, sums: Floats) -> Floats:
        """Return the strains (..., gages) from the weighted sums, (..., rows)."""
        linear, slopes = np.split(sums, [len(self.numbers)], axis=-1)
        return linear + 0.5 * slopes**2 if slopes.size else linear


def gages(
    mesh: MeshArrays,
    records: Sequence[GagePlace],
    *,
    transposed_jacobian: bool = False,
    curvature: Curvature = FLAT,
    nonlinear: bool = False,
) -> GageArray:
    """Express the strains of gages by dofs; raises OutsideError for a gage outside the plate."""
    families = mesh.families
    sums = [_functional(families, record, transposed_jacobian, curvature) for record in records]
    rows = [linear for linear, _ in sums]
    if nonlinear:
        rows += [slope for _, slope in sums]
    most_dofs = max(len(indices) for indices, _ in rows)
    dof_indices = np.zeros((len(rows), most_dofs), dtype=np.intp)
    weights = np.zeros((len(rows), most_dofs))
    for number, (indices, values) in enumerate(rows):
        dof_indices[number, : len(indices)], weights[number, : len(values)] = indices, values
    numbers = np.array([record.number for record in records], np.int32)
    return GageArray(numbers, dof_indices, weights)


# Dof indices and weights of a sum.
_Functional = tuple[Indices, Floats]


def _functional(
    families: Sequence[ElementBlock],
    gage: GagePlace,
    transposed_jacobian: bool,
    curvature: Curvature,
) -> tuple[_Functional, _Functional]:
    """Return a gage's linear strain, and the slope dw/ds in its direction."""
    point = np.array([[gage.x, gage.y]])
    elements = [
        (family.take(np.array([member])), Quadrature(xi[:1], xi[1:], np.ones(1)))
        for family in families
        for member, _, xi in zip(*containing_elements(family, point), strict=True)
    ]
    if not elements:
        raise OutsideError(f"gage {gage.number} at ({gage.x:g}, {gage.y:g}) is not on the plate")
    c, s = np.cos(np.deg2rad(gage.direction)), np.sin(np.deg2rad(gage.direction))
    strain: list[_Functional] = []
    slope: list[_Functional] = []
    stretch = float(np.array([c * c, s * s, c * s]) @ strain_of_deflection(curvature))
    for element, rule in elements:
        shapes = interpolate(element, rule, transposed_jacobian=transposed_jacobian)
        # Derivative in the gage's direction.
        along = c * shapes.dN[0, 0, 0] + s * shapes.dN[0, 0, 1]
        for dof, factor in ((0, c), (1, s), (3, -gage.z * c), (4, -gage.z * s)):
            strain.append((element.nodes[0] * NDOF + dof, factor * along / len(elements)))
        if stretch:
            strain.append((element.nodes[0] * NDOF + 2, stretch * shapes.N[0] / len(elements)))
        slope.append((element.nodes[0] * NDOF + 2, along / len(elements)))
    return _joined(strain), _joined(slope)


def _joined(parts: Sequence[_Functional]) -> _Functional:
    """Join sums into one sum."""
    dof_indices, weights = (np.concatenate(part) for part in zip(*parts, strict=True))
    return dof_indices, weights
