"""Mesh and equation numbers.

Nodes, elements and equations are numbered from 1 as on the cards; row n - 1 of an array belongs to
node or element n.  An absent node of an element and the equation of a restrained dof are 0.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fecm._frozen import frozen
from fecm._typing import Bools, Floats

Ints = NDArray[np.int32]


@frozen
class Mesh:
    """Nodes, elements, restraints and nodal forces of a problem."""

    coordinates: Floats  # (numnp, 2): length; NaN for undefined nodes
    elements: Ints  # (numel, nen): node numbers, 0 where absent
    codes: Ints  # (numnp, 5): restraint codes; a dof with a nonzero code is restrained
    forces: Floats  # (numnp, 5): nodal force, or displacement of a restrained dof
    # (numnp, 5): equation numbers in the order of nodes and dofs, 0 where restrained.
    equations: Ints

    @property
    def number_of_equations(self) -> int:
        """Number of free dofs."""
        return int(np.count_nonzero(self.equations))

    @property
    def given(self) -> Bools:
        """Whether each node has coordinates."""
        return ~np.isnan(self.coordinates[:, 0])

    @property
    def used(self) -> Bools:
        """Whether each node belongs to an element."""
        used = np.zeros(len(self.coordinates) + 1, dtype=bool)
        inside = (self.elements >= 0) & (self.elements <= len(self.coordinates))
        used[np.where(inside, self.elements, 0)] = True
        return used[1:]


def equation_numbers(codes: Ints) -> Ints:
    """Number the dofs without a restraint code from 1, node by node; the others get 0."""
    free = codes.ravel() == 0
    return np.where(free, np.cumsum(free), 0).astype(np.int32).reshape(codes.shape)


def holds_the_plane(codes: Ints) -> bool:
    """Whether restraint codes, (numnp, 5), restrain u and v of every node."""
    return bool((codes[:, :2] != 0).all())
