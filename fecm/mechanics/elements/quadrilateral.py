"""Quadrilateral with 4 to 9 nodes: corners, then mid-sides, then the centre (equations 4-7 ff.).

Corners run counter-clockwise from (-1, -1), mid-side node 5 lies between corners 1 and 2, and so
on, node 9 in the centre.  Any of nodes 5 to 9 may be absent; the element stays compatible with its
neighbours and reproduces every linear field.  Shape functions of an absent node are zero.
"""

from __future__ import annotations

import numpy as np

from fecm._typing import Bools, Floats
from fecm.mechanics.elements.shape import ElementShape, corner_functions

NODES = 9
# Local coordinates of the nodes.
XI = np.array([-1.0, 1.0, 1.0, -1.0, 0.0, 1.0, 0.0, -1.0, 0.0])
ETA = np.array([-1.0, -1.0, 1.0, 1.0, -1.0, 0.0, 1.0, 0.0, 0.0])
# Mid-side nodes next to each corner, and the corners at the ends of each side.
_SIDES_OF_CORNER = ((7, 4), (4, 5), (5, 6), (6, 7))


def shape_functions(xi: Floats, eta: Floats, present: Bools) -> tuple[Floats, Floats]:
    """Shape functions and their derivatives.

    Parameters
    ----------
    xi, eta : ndarray (n,)
        Points.
    present : ndarray (9,) of bool
        Which nodes are present; the corners always are.

    Returns
    -------
    N : ndarray (n, 9)
        Values.
    dN : ndarray (n, 2, 9)
        Derivatives with respect to xi and eta.
    """
    xi, eta = np.asarray(xi, dtype=float), np.asarray(eta, dtype=float)
    # Rows: value, d/dxi, d/deta.  First each function without the other nodes of its side.
    S = corner_functions(NODES, xi, eta)
    for i in (4, 6):  # mid-sides at eta = -1 and +1
        a, b = 1.0 - xi**2, 1.0 + ETA[i] * eta
        S[:, i] = a * b / 2.0, -xi * b, ETA[i] * a / 2.0
    for i in (5, 7):  # mid-sides at xi = +1 and -1
        a, b = 1.0 + XI[i] * xi, 1.0 - eta**2
        S[:, i] = a * b / 2.0, XI[i] * b / 2.0, -a * eta
    S[:, 8] = (1.0 - xi**2) * (1.0 - eta**2), -2.0 * xi * (1.0 - eta**2), -2.0 * eta * (1.0 - xi**2)
    S[:, ~np.asarray(present)] = 0.0
    # Then subtract from each function its values at the mid-sides and the centre.
    centre = S[:, 8].copy()
    for i in range(4, 8):
        if present[i]:
            S[:, i] -= centre / 2.0
    for i in range(4):
        before, after = _SIDES_OF_CORNER[i]
        S[:, i] -= centre / 4.0 + (S[:, before] + S[:, after]) / 2.0
    return S[0].T.copy(), S[1:].transpose(2, 0, 1).copy()


SHAPE = ElementShape(
    name="quadrilateral",
    xi=XI,
    eta=ETA,
    corners=4,
    numbering="corners run counter-clockwise, mid-side 5 lies between corners 1 and 2",
    shape_functions=shape_functions,
)
