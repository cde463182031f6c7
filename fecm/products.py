"""K u, the product that a time step is made of.

Two ways to have it: scipy's CSR matrix, and element by element, where congruent elements share one
small matrix that stays in the cache and the products run at the speed of BLAS.

A vector q is extended by one entry that is always zero and stands for every unknown at rest, and by
-q before it where some unknowns move against the one that they follow.  The result comes in pieces,
each handed on while it is in the cache; pieces and their order depend on the plate alone, so that
sums over them are the same whatever the number of threads.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from fecm.assembly import PlateModel
from fecm.congruence import congruence
from fecm.reduction import Reduction, whole
from fecm.solvers import AUTO, CSR
from fecm.workers import Workers

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]
R = TypeVar("R")

# Equations of one piece: BLAS adds up so long a vector in one thread.
PIECE = 8192
# Elements of one matrix product: small enough for the cache, and for BLAS to use one thread only.
BLOCK = 256
# Fewer congruent elements than this, and a matrix for each of them is as fast as one for all.
WORTH_GROUPING = 4
# Gathered unknowns that a thread takes at a time.
BATCH = 65536


def pieces(neq: int) -> list[slice]:
    """The equations, piece by piece."""
    return [slice(i, min(i + PIECE, neq)) for i in range(0, neq, PIECE)]


class Product(ABC):
    """The internal forces of a displacement."""

    # Entries of an extended vector.
    size: int

    @abstractmethod
    def each(self, extended: Floats, use: Callable[[int, Floats], R]) -> list[R]:
        """Hand K u on, piece by piece.

        Parameters
        ----------
        extended : ndarray (size,)
            The displacement at its beginning, and a zero at its end.
        use : callable
            Given a piece's number and its forces; may run in any thread.

        Returns
        -------
        list
            What `use` gave, in the order of the pieces.
        """

    def __call__(self, displacement: Floats) -> Floats:
        """K u, (neq,)."""
        extended = np.zeros(self.size)
        extended[: len(displacement)] = displacement
        return np.concatenate(self.each(extended, lambda _, forces: forces.copy()))


class CsrProduct(Product):
    """K u by one sparse matrix.

    Parameters
    ----------
    stiffness : csr_array (neq, neq)
    """

    def __init__(self, stiffness: sparse.csr_array) -> None:
        self._stiffness = stiffness
        self._pieces = pieces(stiffness.shape[0])
        self.size = stiffness.shape[0] + 1

    def each(self, extended: Floats, use: Callable[[int, Floats], R]) -> list[R]:
        """Hand K u on, piece by piece."""
        forces = np.asarray(self._stiffness @ extended[:-1])
        return [use(number, forces[piece]) for number, piece in enumerate(self._pieces)]


# Nodal values of a part's elements, their matrix or matrices, their forces, and how it is done.
_Part = tuple[Callable[..., Any], Floats, Floats, Floats]
_Batch = tuple[Indices, Floats, list[_Part]]


class ElementProduct(Product):
    """K u element by element: gather, small matrix products, scatter.

    Parameters
    ----------
    groups : sequence of (K, places)
        Stiffness (n, n) that a group's elements share, or (ne, n, n) where each has its own, and
        the places of its elements' unknowns in the extended vector, (ne, n).
    count : int
        Number of unknowns.
    signed : bool
        Whether -q is part of the extended vector.
    workers : Workers, optional
        Threads to share the work.
    """

    def __init__(
        self,
        groups: Sequence[tuple[Floats, Indices]],
        count: int,
        *,
        signed: bool = False,
        workers: Workers | None = None,
    ) -> None:
        self._count, self._signed = count, signed
        self._workers = workers or Workers()
        self.size = (2 if signed else 1) * count + 1
        lists: list[Indices] = []
        matrices: list[Floats] = []
        for K, places in groups:
            kept = (places < self.size - 1).any(axis=0)
            lists.append(places[:, kept])
            matrices.append(np.ascontiguousarray(K[..., kept, :][..., kept]))
        self._places = np.concatenate([part.ravel() for part in lists])
        self._gathered = np.empty(len(self._places))
        self._forces = np.empty(len(self._places))
        self._batches = self._cut(lists, matrices)
        # A count is the faster scatter of a short vector, a sparse matrix that of a long one.
        self._scatter: list[tuple[int, sparse.csr_array]] = []
        if count > PIECE:
            whole = self._scatter_matrix()
            self._scatter = [(n, whole[piece]) for n, piece in enumerate(pieces(count))]

    def _scatter_matrix(self) -> sparse.csr_array:
        """Sums of the elements' forces, (count, entries)."""
        turned = (self._places >= self._count) & (self._places < self.size - 1)
        rows = np.where(turned, self._places - self._count, self._places).astype(np.int32)
        entries = np.flatnonzero(self._places < self.size - 1).astype(np.int32)
        signs = np.where(turned, -1.0, 1.0)[entries]
        shape = (self._count, len(self._places))
        return sparse.csr_array((signs, (rows[entries], entries)), shape=shape)

    def _cut(self, lists: list[Indices], matrices: list[Floats]) -> list[_Batch]:
        """Blocks of elements, and batches of blocks."""
        batches: list[_Batch] = []
        parts: list[_Part] = []
        begin = end = 0
        for K, places in zip(matrices, lists, strict=True):
            for first in range(0, len(places), BLOCK):
                rows = slice(first, first + BLOCK)
                shape = places[rows].shape
                cut = slice(end, end + shape[0] * shape[1])
                q, f = self._gathered[cut].reshape(shape), self._forces[cut].reshape(shape)
                if K.ndim == 2:
                    parts.append((np.dot, q, K, f))
                else:
                    parts.append((np.matmul, q[:, None], K[rows], f[:, None]))
                end = cut.stop
                if end - begin >= BATCH:
                    batches.append((self._places[begin:end], self._gathered[begin:end], parts))
                    parts, begin = [], end
        if parts:
            batches.append((self._places[begin:end], self._gathered[begin:end], parts))
        return batches

    def each(self, extended: Floats, use: Callable[[int, Floats], R]) -> list[R]:
        """Hand K u on, piece by piece."""
        count = self._count
        if self._signed:
            np.negative(extended[:count], out=extended[count:-1])
        self._workers.map(partial(self._multiply, extended), self._batches)
        if self._scatter:
            return self._workers.map(partial(self._gather, use), self._scatter)
        forces: Floats = np.bincount(self._places, self._forces, self.size)  # type: ignore[assignment]
        total = forces[:count]
        if self._signed:
            total -= forces[count:-1]
        return [use(0, total)]

    @staticmethod
    def _multiply(extended: Floats, batch: _Batch) -> None:
        places, gathered, parts = batch
        extended.take(places, out=gathered, mode="clip")
        for product, q, K, forces in parts:
            product(q, K, out=forces)

    def _gather(self, use: Callable[[int, Floats], R], piece: tuple[int, sparse.csr_array]) -> R:
        number, sums = piece
        return use(number, sums @ self._forces)


def product_of(
    plate: PlateModel,
    solver: str = AUTO,
    reduced: Reduction | None = None,
    workers: Workers | None = None,
) -> Product:
    """K u of a plate, by the way that suits the mesh.

    Parameters
    ----------
    plate : PlateModel
    solver : str
        ``"csr"`` for the sparse matrix of all unknowns; otherwise element by element, where
        elements that are congruent to enough others share a matrix.
    reduced : Reduction, optional
        What moves; every unknown without it.
    workers : Workers, optional
        Threads to share the work.
    """
    if solver == CSR:
        return CsrProduct(plate.stiffness)
    kept = reduced or whole(plate)
    groups: list[tuple[Floats, Indices]] = []
    for family in plate.families:
        weights = kept.weights[family.rows]
        same = congruence(family)
        places = kept.slots[family.nodes].reshape(len(family.rows), -1)
        # An element that is its own image counts once, where the others count twice.
        most = weights.max()
        sizes = np.bincount(same.group[weights == most], minlength=len(same.representatives))
        shared = sizes >= WORTH_GROUPING
        matrices = plate.stiffness_of(family.take(same.representatives[shared]))
        for K, number in zip(matrices, np.flatnonzero(shared), strict=True):
            members = (same.group == number) & (weights == most)
            groups.append((most * K, places[members]))
        alone = np.flatnonzero((weights > 0) & ~(shared[same.group] & (weights == most)))
        for start in range(0, len(alone), BLOCK):
            rows = alone[start : start + BLOCK]
            K = plate.stiffness_of(family.take(rows))
            groups.append((weights[rows, None, None] * K, places[rows]))
    return ElementProduct(groups, kept.count, signed=kept.signed, workers=workers)
