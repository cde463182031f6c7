"""K u, the product that a time step is made of.

Two ways to have it: scipy's CSR matrix, and element by element, where congruent elements share one
small matrix that stays in the cache and the products run at the speed of BLAS.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

# Elements of one matrix product: small enough for the cache, and for BLAS to use one thread only,
# so that the sums are the same whatever the number of threads.
BLOCK = 256


class Product(Protocol):
    """The internal forces of a displacement."""

    def __call__(self, displacement: Floats) -> Floats:
        """K u, (neq,), in an array that the next call may use again."""
        ...


class CsrProduct:
    """K u by one sparse matrix."""

    def __init__(self, stiffness: sparse.csr_array) -> None:
        self._stiffness = stiffness

    def __call__(self, displacement: Floats) -> Floats:
        """K u, (neq,)."""
        return np.asarray(self._stiffness @ displacement)


class GroupedProduct:
    """K u by groups of elements that share one stiffness matrix.

    Parameters
    ----------
    groups : sequence of (K, unknowns)
        Stiffness (n, n), and the unknowns of the group's elements (ne, n), counted from 0; an
        unknown of `neq` or more is restrained.
    neq : int
        Number of equations.
    """

    def __init__(self, groups: Sequence[tuple[Floats, Indices]], neq: int) -> None:
        self._neq = neq
        self._parts: list[tuple[Floats, Floats, Floats]] = []
        lists: list[Indices] = []
        reduced: list[Floats] = []
        for K, unknowns in groups:
            kept = (unknowns < neq).any(axis=0)
            lists.append(np.minimum(unknowns[:, kept], neq))
            reduced.append(np.ascontiguousarray(K[np.ix_(kept, kept)]))
        self._unknowns = np.concatenate([part.ravel() for part in lists])
        # Where some elements have a restrained unknown that others have not, a last entry that is
        # always zero stands for it.
        held = bool((self._unknowns == neq).any())
        self._padded = np.zeros(neq + 1) if held else None
        gathered = np.empty(len(self._unknowns))
        forces = np.empty(len(self._unknowns))
        self._gathered, self._forces = gathered, forces
        start = 0
        for K, part in zip(reduced, lists, strict=True):
            for rows in range(0, len(part), BLOCK):
                shape = (min(BLOCK, len(part) - rows), part.shape[1])
                cut = slice(start, start + shape[0] * shape[1])
                self._parts.append((gathered[cut].reshape(shape), K, forces[cut].reshape(shape)))
                start = cut.stop

    def __call__(self, displacement: Floats) -> Floats:
        """K u, (neq,)."""
        source = displacement
        if self._padded is not None:
            self._padded[:-1] = displacement
            source = self._padded
        source.take(self._unknowns, out=self._gathered, mode="clip")
        for q, K, forces in self._parts:
            np.dot(q, K, out=forces)
        total = np.bincount(self._unknowns, self._forces, len(source))
        return np.asarray(total, dtype=np.float64)[: self._neq]
