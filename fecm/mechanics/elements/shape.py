"""Element shapes: node positions and shape functions on the square -1 <= xi, eta <= 1.

Shape functions are in the order of the node numbers; those of an absent node are zero.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fecm._typing import Bools, Floats

# Values (n, nodes) and derivatives (n, 2, nodes) at points xi, eta (n,) of the present nodes.
ShapeFunctions = Callable[[Floats, Floats, Bools], tuple[Floats, Floats]]


@dataclass(frozen=True, eq=False)
class ElementShape:
    """Shape of an element.

    Attributes
    ----------
    name : str
        Name in messages.
    xi, eta : ndarray (nodes,)
        Local coordinates of the nodes.
    corners : int
        Number of corners, the first nodes, which are never absent.
    numbering : str
        Order of the nodes, for messages.
    shape_functions : callable
        ``shape_functions(xi, eta, present)`` gives the values (n, nodes) and the derivatives with
        respect to xi and eta (n, 2, nodes).
    """

    name: str
    xi: Floats
    eta: Floats
    corners: int
    numbering: str
    shape_functions: ShapeFunctions

    @property
    def nodes(self) -> int:
        """Largest number of nodes."""
        return len(self.xi)


def corner_functions(nodes: int, xi: Floats, eta: Floats) -> Floats:
    """Values, d/dxi and d/deta (3, nodes, n) of the bilinear corner functions (equation 4-11).

    Corners run counter-clockwise from (-1, -1); the functions of other nodes are zero.
    """
    S = np.zeros((3, nodes, len(xi)))
    for i, (x, y) in enumerate(((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0))):
        a, b = 1.0 + x * xi, 1.0 + y * eta
        S[:, i] = a * b / 4.0, x * b / 4.0, y * a / 4.0
    return S
