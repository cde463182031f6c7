"""Congruent elements: elements that differ by a translation share one stiffness matrix."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fecm.plate import Family

# Two elements are congruent if their nodes' relative places agree to this part of the largest
# element's size.
TOLERANCE = 1.0e-9


@dataclass(frozen=True)
class Congruence:
    """Which elements of a family are translations of which.

    Attributes
    ----------
    representatives : ndarray (ng,)
        Position in the family of one element of every group.
    group : ndarray (ne,)
        Group of every element.
    """

    representatives: NDArray[np.intp]
    group: NDArray[np.intp]


def congruence(family: Family) -> Congruence:
    """Sort a family's elements into groups of congruent ones.

    Places are compared on a grid of :data:`TOLERANCE` times the largest element's size; two equal
    elements that rounding puts on either side of a grid line make two groups, which costs time but
    no accuracy.
    """
    places = family.coordinates[:, 1:] - family.coordinates[:, :1]
    flat = places.reshape(len(places), -1)
    pitch = TOLERANCE * float(np.abs(flat).max())
    # An offset that no mesh has keeps round numbers away from the grid lines.
    cells = np.floor(flat / pitch + 1.0 / np.pi).astype(np.int64)
    _, representatives, group = np.unique(cells, axis=0, return_index=True, return_inverse=True)
    return Congruence(representatives.astype(np.intp), group.ravel().astype(np.intp))
