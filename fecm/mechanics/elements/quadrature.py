"""Quadrature points and weights on the square -1 <= xi, eta <= 1.

Points are in the report's order: corners counter-clockwise from (-1, -1), mid-sides starting at
eta = -1, centre.  Order 4 has the corners of the large square, of the tall and the wide rectangle,
and of the small square.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from fecm._typing import Floats

HIGHEST_ORDER = 4

# Signs of xi and eta at corners, mid-sides and centre.
_XI = np.array([-1, 1, 1, -1, 0, 1, 0, -1, 0])
_ETA = np.array([-1, -1, 1, 1, -1, 0, 1, 0, 0])


# Points and weights of the Gauss-Legendre rules of the orders 1 to 4.
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
    """Gauss rule with `order` points in each direction; a ValueError outside 1 to 4."""
    points, weights = np.array(_LEGENDRE[_known(order) - 1])
    return _rule(order, points, weights)


@cache
def nodal(order: int) -> Quadrature:
    """Grid of `order` equally spaced points in each direction, including the edges.

    Order 3 gives the nodes of the 9-node element.  Weights are those of the Gauss rule and must not
    be used for integration.  A ValueError outside 1 to 4.
    """
    points = np.linspace(-1.0, 1.0, order) if _known(order) > 1 else np.zeros(1)
    return _rule(order, points, np.array(_LEGENDRE[order - 1][1]))


def _known(order: int) -> int:
    if not 1 <= order <= HIGHEST_ORDER:
        raise ValueError(f"quadrature order {order} is outside 1 to {HIGHEST_ORDER}")
    return order


def _rule(order: int, points: Floats, weights: Floats) -> Quadrature:
    """Tensor product of ascending 1D points, in the report's order."""
    if order <= 3:
        # Indices of the points at -1, 0 and +1; two points have no middle one.
        index = {-1: 0, 0: order // 2, 1: order - 1}
        first = 8 if order == 1 else 0
        pairs = [
            (index[a], index[b])
            for a, b in zip(
                _XI[first : first + order**2], _ETA[first : first + order**2], strict=True
            )
        ]
    else:
        pairs = []
        for a, b in ((0, 0), (1, 0), (0, 1), (1, 1)):  # distance from the edge in xi and in eta
            ends = {-1: (a, b), 1: (order - 1 - a, order - 1 - b)}
            pairs += [(ends[s][0], ends[t][1]) for s, t in zip(_XI[:4], _ETA[:4], strict=True)]
    i, j = np.array(pairs).T
    return Quadrature(points[i], points[j], weights[i] * weights[j])
