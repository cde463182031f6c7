"""Element shapes and quadrature on the square -1 <= xi, eta <= 1.

Shape functions are in the order of the node numbers; the shape functions of an absent node are
zero.  Corners run counter-clockwise from (-1, -1) and are always present.  A quadrilateral is
compatible with neighbours that have the same nodes on the common side, and reproduces every linear
field.

Quadrature points are in the report's order: corners counter-clockwise from (-1, -1), mid-sides
starting at eta = -1, centre.  The points of order 4 are the corners of the large square, of the
tall rectangle, of the wide rectangle and of the small square.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cache

import numpy as np

from fecm._typing import Bools, Floats

# Corners, mid-sides (node 5 lies between corners 1 and 2), centre.
_XI_9 = np.array([-1.0, 1.0, 1.0, -1.0, 0.0, 1.0, 0.0, -1.0, 0.0])
_ETA_9 = np.array([-1.0, -1.0, 1.0, 1.0, -1.0, 0.0, 1.0, 0.0, 0.0])

# Quadrature ---------------------------------------------------------------------------------------

HIGHEST_ORDER = 4

# Points and weights of the Gauss-Legendre rules of order 1 to 4.
_LEGENDRE = (
    ((0.0,), (2.0,)),
    ((-0.5773502691896257, 0.5773502691896257), (1.0, 1.0)),
    (
        (-0.7745966692414834, 0.0, 0.7745966692414834),
        (0.5555555555555557, 0.8888888888888888, 0.5555555555555557),
    ),
    (
        (-0.8611363115940526, -0.33998104358485626, 0.33998104358485626, 0.8611363115940526),
        (0.34785484513745357, 0.6521451548625464, 0.6521451548625464, 0.34785484513745357),
    ),
)


@dataclass(frozen=True, eq=False)
class Quadrature:
    """Points and weights of a quadrature rule."""

    # (n,): local coordinates.
    xi: Floats
    eta: Floats
    weights: Floats  # (n,): their sum is 4, the area of the square


@cache
def gauss(order: int) -> Quadrature:
    """Return the Gauss rule with `order` points in each direction.

    Raises ValueError if the order is outside 1 to 4.
    """
    return _rule(order, equal=False)


@cache
def nodal(order: int) -> Quadrature:
    """Return a grid of `order` equally spaced points in each direction, including the edges.

    Order 3 gives the nodes of the 9-node element.  The weights are copied from the Gauss rule and
    must not be used for integration.  Raises ValueError if the order is outside 1 to 4.
    """
    return _rule(order, equal=True)


def _rule(order: int, *, equal: bool) -> Quadrature:
    """Return the tensor product of Gauss points or equally spaced points, in the report's order."""
    if not 1 <= order <= HIGHEST_ORDER:
        raise ValueError(f"quadrature order {order} is outside 1 to {HIGHEST_ORDER}")
    points, weights = np.array(_LEGENDRE[order - 1])
    if equal and order > 1:
        points = np.linspace(-1.0, 1.0, order)
    signs = np.array([_XI_9, _ETA_9], dtype=int)[:, : min(order, 3) ** 2]
    if order <= 3:
        i, j = (signs + 1) * (order - 1) // 2
    else:  # four corners at each distance from the edge in xi and in eta
        away = np.repeat([[0, 1, 0, 1], [0, 0, 1, 1]], 4, axis=1)
        i, j = np.where(np.tile(signs[:, :4], 4) < 0, away, order - 1 - away)
    return Quadrature(points[i], points[j], weights[i] * weights[j])


# Shapes -------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class ElementShape:
    """Shape of an element."""

    name: str  # name in messages
    # (nodes,): local coordinates of the nodes.
    xi: Floats
    eta: Floats
    corners: int  # number of corners; they are the first nodes and never absent
    numbering: str  # order of the nodes, for messages
    # ``functions(xi, eta, present)`` returns values, d/dxi and d/deta at n points, (3, nodes, n).
    functions: Callable[[Floats, Floats, Bools], Floats]

    @property
    def nodes(self) -> int:
        """Largest number of nodes."""
        return len(self.xi)

    def shape_functions(self, xi: Floats, eta: Floats, present: Bools) -> tuple[Floats, Floats]:
        """Return shape functions (n, nodes) and derivatives by xi and eta (n, 2, nodes)."""
        S = self.functions(np.asarray(xi, float), np.asarray(eta, float), np.asarray(present))
        return S[0].T.copy(), S[1:].transpose(2, 0, 1).copy()


def _triangle(xi: Floats, eta: Floats, present: Bools) -> Floats:
    """Evaluate the three-node triangle (the listing's SHAPE, NEL = 3).

    It is the 4-node quadrilateral with coincident corners 3 and 4.
    """
    # The side eta = 1 of the square is collapsed to node 3, where the Jacobian is singular.
    # The shape functions are the area coordinates, so that strains are constant.
    zero, half = np.zeros_like(xi), np.full_like(xi, 0.5)
    values = [(1.0 - xi) * (1.0 - eta) / 4.0, (1.0 + xi) * (1.0 - eta) / 4.0, (1.0 + eta) / 2.0]
    along_xi = [-(1.0 - eta) / 4.0, (1.0 - eta) / 4.0, zero]
    along_eta = [-(1.0 - xi) / 4.0, -(1.0 + xi) / 4.0, half]
    return np.array([values, along_xi, along_eta])


def _bilinear(nodes: int, xi: Floats, eta: Floats) -> Floats:
    """Evaluate the bilinear functions of the corners (equation 4-11); other nodes get zeros."""
    S = np.zeros((3, nodes, len(xi)))
    for i, (x, y) in enumerate(zip(_XI_9[:4], _ETA_9[:4], strict=True)):
        a, b = 1.0 + x * xi, 1.0 + y * eta
        S[:, i] = a * b / 4.0, x * b / 4.0, y * a / 4.0
    return S


def _present(nodes: Iterable[int], present: Bools) -> list[int]:
    """Select the nodes that are present; the functions of absent nodes stay zero."""
    return [i for i in nodes if present[i]]


def _quadratic(xi: Floats, eta: Floats, present: Bools) -> Floats:
    """Evaluate the functions of four to nine nodes (equations 4-7 ff.)."""
    # First compute each function without the other nodes of its side.
    S = _bilinear(9, xi, eta)
    for i in _present((4, 6), present):  # mid-sides at eta = -1 and +1
        a, b = 1.0 - xi**2, 1.0 + _ETA_9[i] * eta
        S[:, i] = a * b / 2.0, -xi * b, _ETA_9[i] * a / 2.0
    for i in _present((5, 7), present):  # mid-sides at xi = +1 and -1
        a, b = 1.0 + _XI_9[i] * xi, 1.0 - eta**2
        S[:, i] = a * b / 2.0, _XI_9[i] * b / 2.0, -a * eta
    if present[8]:
        a, b = 1.0 - xi**2, 1.0 - eta**2
        S[:, 8] = a * b, -2.0 * xi * b, -2.0 * eta * a
    # Then subtract from each function its values at the mid-sides and the centre.
    if not present[4:].any():
        return S
    centre = S[:, 8].copy()
    for i in _present(range(4, 8), present):
        S[:, i] -= centre / 2.0
    for i, (before, after) in enumerate(((7, 4), (4, 5), (5, 6), (6, 7))):  # mid-sides beside it
        S[:, i] -= centre / 4.0 + (S[:, before] + S[:, after]) / 2.0
    return S


_THIRD = 1.0 / 3.0
# Corners, then the nodes at the third points of the sides: counter-clockwise, nodes 5 to 8 follow
# corners 1 to 4 and nodes 9 to 12 precede them (the listing's SHAP3).
_XI_12 = np.array([-1.0, 1.0, 1.0, -1.0, -_THIRD, 1.0, _THIRD, -1.0, -1.0, _THIRD, 1.0, -_THIRD])
_ETA_12 = np.array([-1.0, -1.0, 1.0, 1.0, -1.0, -_THIRD, 1.0, _THIRD, -_THIRD, -1.0, _THIRD, 1.0])
# Near and far third points on the two sides of each corner.
_NEAR = ((4, 8), (5, 9), (6, 10), (7, 11))
_FAR = ((7, 9), (4, 10), (5, 11), (6, 8))


def _cubic(xi: Floats, eta: Floats, present: Bools) -> Floats:
    """Evaluate the functions of four to twelve nodes (the listing's SHAP3 and CSHAPE)."""
    # First compute each function without the other nodes of its side.
    S = _bilinear(12, xi, eta)
    for i in _present((4, 6, 9, 11), present):  # third points at eta = -1 and +1
        f, slope = _side(xi, _XI_12[i])
        a = (1.0 + _ETA_12[i] * eta) / 2.0
        S[:, i] = f * a, slope * a, f * _ETA_12[i] / 2.0
    for i in _present((5, 7, 8, 10), present):  # third points at xi = +1 and -1
        f, slope = _side(eta, _ETA_12[i])
        a = (1.0 + _XI_12[i] * xi) / 2.0
        S[:, i] = f * a, f * _XI_12[i] / 2.0, slope * a
    # Then subtract from each corner function its values at the third points.
    for i in range(4):
        near, far = S[:, _NEAR[i]].sum(axis=1), S[:, _FAR[i]].sum(axis=1)
        S[:, i] -= (2.0 * near + far) / 3.0
    return S


def _side(t: Floats, node: float) -> tuple[Floats, Floats]:
    """Evaluate a cubic along a side, and its slope.

    The cubic is 1 at the third point `node`, and 0 at the other third point and at both ends.
    """
    f = 9.0 / 16.0 * (1.0 - t**2) * (1.0 + 9.0 * node * t)
    return f, 9.0 / 16.0 * (9.0 * node - 2.0 * t - 27.0 * node * t**2)


COUNTER_CLOCKWISE = "corners run counter-clockwise"
TRIANGLE = ElementShape(
    "triangle", np.array([-1.0, 1.0, 0.0]), _ETA_9[[0, 1, 2]], 3, COUNTER_CLOCKWISE, _triangle
)
MIDDLE = f"{COUNTER_CLOCKWISE}, mid-side 5 lies between corners 1 and 2"
QUADRILATERAL = ElementShape("quadrilateral", _XI_9, _ETA_9, 4, MIDDLE, _quadratic)
THIRDS = f"{COUNTER_CLOCKWISE}, nodes 5 and 10 divide the side from corner 1 to 2 in thirds"
CUBIC = ElementShape("cubic quadrilateral", _XI_12, _ETA_12, 4, THIRDS, _cubic)
