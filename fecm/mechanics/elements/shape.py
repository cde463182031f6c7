"""What every family of elements has: node positions and shape functions on the square.

Shape functions are given at points xi, eta of the square -1 <= xi, eta <= 1, for all nodes that the
family knows, in the order of their numbers.  Those of an absent node are zero.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from fecm._typing import Bools, Floats

# Values (n, nodes) and derivatives (n, 2, nodes) at points xi, eta (n,) of the present nodes.
ShapeFunctions = Callable[[Floats, Floats, Bools], tuple[Floats, Floats]]


@dataclass(frozen=True, eq=False)
class ElementShape:
    """A family of elements.

    Attributes
    ----------
    name : str
        What a message calls it.
    xi, eta : ndarray (nodes,)
        Local coordinates of the nodes.
    corners : int
        How many nodes, the first ones, are corners; these are never absent.
    numbering : str
        How the nodes of a sound element follow each other.
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
        """Number of the last node the family knows."""
        return len(self.xi)
