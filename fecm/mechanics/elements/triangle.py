"""Triangle with 3 nodes: the 4-node quadrilateral with coincident corners 3 and 4.

Corners run counter-clockwise; the side eta = 1 of the square is collapsed to node 3, where the
Jacobian is singular.  Strains are constant: the shape functions are the area coordinates.
"""

from __future__ import annotations

import numpy as np

from fecm._typing import Bools, Floats
from fecm.mechanics.elements.shape import ElementShape

# Local coordinates of the nodes; node 3 is in the middle of the collapsed side eta = 1.
XI = np.array([-1.0, 1.0, 0.0])
ETA = np.array([-1.0, -1.0, 1.0])


def shape_functions(xi: Floats, eta: Floats, present: Bools) -> tuple[Floats, Floats]:
    """Shape functions and their derivatives (the listing's SHAPE with NEL = 3).

    Parameters
    ----------
    xi, eta : ndarray (n,)
        Points.
    present : ndarray (3,) of bool
        All true.

    Returns
    -------
    N : ndarray (n, 3)
        Values.
    dN : ndarray (n, 2, 3)
        Derivatives with respect to xi and eta.
    """
    xi, eta = np.asarray(xi, dtype=float), np.asarray(eta, dtype=float)
    zero, half = np.zeros_like(xi), np.full_like(xi, 0.5)
    values = [(1.0 - xi) * (1.0 - eta) / 4.0, (1.0 + xi) * (1.0 - eta) / 4.0, (1.0 + eta) / 2.0]
    along_xi = [-(1.0 - eta) / 4.0, (1.0 - eta) / 4.0, zero]
    along_eta = [-(1.0 - xi) / 4.0, -(1.0 + xi) / 4.0, half]
    N, dN = np.array(values), np.array([along_xi, along_eta])
    return N.T.copy(), dN.transpose(2, 0, 1).copy()


SHAPE = ElementShape(
    name="triangle",
    xi=XI,
    eta=ETA,
    corners=3,
    numbering="corners run counter-clockwise",
    shape_functions=shape_functions,
)
