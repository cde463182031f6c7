"""Quadrilateral with up to 12 nodes: corners, then nodes at the third points of the sides.

Corners run counter-clockwise from (-1, -1).  In that direction nodes 5 to 8 follow corners 1 to 4
and nodes 9 to 12 precede them.  Any of nodes 5 to 12 may be absent; the element stays compatible
with neighbours that have the same nodes on the common side, and reproduces every linear field.
Shape functions of an absent node are zero.
"""

from __future__ import annotations

import numpy as np

from fecm._typing import Bools, Floats
from fecm.mechanics.elements.shape import ElementShape, corner_functions

NODES = 12
_THIRD = 1.0 / 3.0
# Local coordinates of the nodes (the listing's SHAP3).
XI = np.array([-1.0, 1.0, 1.0, -1.0, -_THIRD, 1.0, _THIRD, -1.0, -1.0, _THIRD, 1.0, -_THIRD])
ETA = np.array([-1.0, -1.0, 1.0, 1.0, -1.0, -_THIRD, 1.0, _THIRD, -_THIRD, -1.0, _THIRD, 1.0])
# Near and far third points on the two sides of each corner.
_NEAR = ((4, 8), (5, 9), (6, 10), (7, 11))
_FAR = ((7, 9), (4, 10), (5, 11), (6, 8))


def shape_functions(xi: Floats, eta: Floats, present: Bools) -> tuple[Floats, Floats]:
    """Shape functions and their derivatives (the listing's SHAP3 and CSHAPE).

    Parameters
    ----------
    xi, eta : ndarray (n,)
        Points.
    present : ndarray (12,) of bool
        Which nodes are present; the corners always are.

    Returns
    -------
    N : ndarray (n, 12)
        Values.
    dN : ndarray (n, 2, 12)
        Derivatives with respect to xi and eta.
    """
    xi, eta = np.asarray(xi, dtype=float), np.asarray(eta, dtype=float)
    # Rows: value, d/dxi, d/deta.  First each function without the other nodes of its side.
    S = corner_functions(NODES, xi, eta)
    for i in (4, 6, 9, 11):  # third points at eta = -1 and +1
        f, slope = _side(xi, XI[i])
        a = (1.0 + ETA[i] * eta) / 2.0
        S[:, i] = f * a, slope * a, f * ETA[i] / 2.0
    for i in (5, 7, 8, 10):  # third points at xi = +1 and -1
        f, slope = _side(eta, ETA[i])
        a = (1.0 + XI[i] * xi) / 2.0
        S[:, i] = f * a, f * XI[i] / 2.0, slope * a
    S[:, ~np.asarray(present)] = 0.0
    # Then subtract from each corner function its values at the third points.
    for i in range(4):
        near, far = S[:, _NEAR[i]].sum(axis=1), S[:, _FAR[i]].sum(axis=1)
        S[:, i] -= (2.0 * near + far) / 3.0
    return S[0].T.copy(), S[1:].transpose(2, 0, 1).copy()


def _side(t: Floats, node: float) -> tuple[Floats, Floats]:
    """Cubic along a side, 1 at one third point and 0 at the other and the ends, and its slope."""
    f = 9.0 / 16.0 * (1.0 - t**2) * (1.0 + 9.0 * node * t)
    slope = 9.0 / 16.0 * (9.0 * node - 2.0 * t - 27.0 * node * t**2)
    return f, slope


SHAPE = ElementShape(
    name="cubic quadrilateral",
    xi=XI,
    eta=ETA,
    corners=4,
    numbering=(
        "corners run counter-clockwise, nodes 5 and 10 divide the side from corner 1 to 2 in thirds"
    ),
    shape_functions=shape_functions,
)
