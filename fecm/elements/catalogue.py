"""Which family an element belongs to: its last node decides (the listing's NEL)."""

from __future__ import annotations

import numpy as np

from fecm.elements import cubic, quadrilateral, triangle
from fecm.elements.shape import Bools, ElementShape

# Each takes the elements whose last node the one before does not know.
SHAPES = (triangle.SHAPE, quadrilateral.SHAPE, cubic.SHAPE)
# Number of nodes of the largest element.
MOST_NODES = SHAPES[-1].nodes


def shape_of(present: Bools) -> ElementShape:
    """Family of an element: 3 nodes a triangle, up to 9 a quadrilateral, up to 12 a cubic one.

    Parameters
    ----------
    present : ndarray (n,) of bool
        Which nodes the element has.

    Raises
    ------
    ValueError
        If a node stands beyond the twelfth place.
    """
    found = np.flatnonzero(present)
    last = int(found[-1]) + 1 if len(found) else 0
    for shape in SHAPES:
        if last <= shape.nodes:
            return shape
    raise ValueError(f"an element has at most {MOST_NODES} nodes; this one has a node {last}")
