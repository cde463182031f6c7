"""Elements that contain points, and the points' local coordinates."""

from __future__ import annotations

import numpy as np

from fecm._typing import Bools, Floats, Indices
from fecm.mechanics.elements import Quadrature
from fecm.mechanics.interpolation import local_shape_functions
from fecm.mechanics.mesh import ElementBlock

# Tolerance, in local coordinates, for points on the edge of an element.
MARGIN = 1.0e-6
# The Jacobian of a triangle is singular at node 3.
INSIDE = 1.0 - 1.0e-9
PASSES = 50


def locate(family: ElementBlock, points: Floats) -> tuple[Indices, Indices, Floats]:
    """Find every element of a block that contains one of the points, (n, 2), edges included.

    Positions of the elements in the block (k,), their points (k,), and the points' local
    coordinates in the elements (k, 2).
    """
    low, high = family.coordinates.min(axis=1), family.coordinates.max(axis=1)
    margin = 0.1 * (high - low).max(axis=1, keepdims=True)  # sides may bulge
    low, high = low - margin, high + margin
    close = np.flatnonzero(
        (low <= points.max(axis=0)).all(axis=1) & (points.min(axis=0) <= high).all(axis=1)
    )
    near = (low[close, None] <= points).all(axis=2) & (points <= high[close, None]).all(axis=2)
    members, which = np.nonzero(near)
    members = close[members]
    xi, inside = _local(family.take(members), points[which])
    return members[inside], which[inside], xi[inside]


def _local(elements: ElementBlock, points: Floats) -> tuple[Floats, Bools]:
    """Local coordinates of one point per element, by Newton's method, and whether it is inside."""
    xi = np.zeros_like(points)
    highest = np.array([2.0, INSIDE if elements.shape.corners == 3 else 2.0])
    active = np.arange(len(points))
    for _ in range(PASSES):
        if not len(active):
            break
        coordinates = elements.coordinates[active]
        values, local = local_shape_functions(elements, _rule(xi[active]))
        miss = points[active] - (values.copy()[:, None] @ coordinates)[:, 0]
        jacobian = np.einsum("pan,pni->pia", local, coordinates)
        step = np.linalg.solve(jacobian, miss[:, :, None])[:, :, 0]
        xi[active] = np.clip(xi[active] + step, -2.0, highest)
        active = active[np.abs(step).max(axis=1) >= 1e-13]
    values, _ = local_shape_functions(elements, _rule(xi))
    miss = np.abs(points - (values.copy()[:, None] @ elements.coordinates)[:, 0]).max(axis=1)
    size = np.ptp(elements.coordinates, axis=1).max(axis=1)
    return xi, (np.abs(xi).max(axis=1) <= 1.0 + MARGIN) & (miss <= MARGIN * size)


def _rule(xi: Floats) -> Quadrature:
    return Quadrature(xi[:, 0], xi[:, 1], np.ones(len(xi)))
