"""K u, the product that a time step is made of.

Two ways to have it: scipy's CSR matrix, and element by element, where congruent elements share one
small matrix that stays in the cache and the products run at the speed of BLAS.

A vector q is extended by one entry that is always zero and stands for every unknown at rest, and by
-q before it where some unknowns move against the one that they follow.  The result comes in pieces,
each handed on while it is in the cache; pieces and their order depend on the plate alone, so that
sums over them are the same whatever the number of threads.
"""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from fecm._typing import Floats
from fecm.mechanics.element_groups import congruence
from fecm.mechanics.plate import PlateModel
from fecm.mechanics.symmetry import SymmetryReduction, whole

# By what suits the mesh, or by the sparse matrix in any case.
AUTO, CSR = "auto", "csr"

SOLVERS = (AUTO, CSR)

# Part of the critical time step that is taken where a deck gives none.
SAFE = 0.9

T = TypeVar("T")

R = TypeVar("R")


def available() -> int:
    """Cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class Workers:
    """A few threads, the caller's own among them.

    Parameters
    ----------
    count : int
        Number of threads; 1 starts none.

    Attributes
    ----------
    count : int
    """

    def __init__(self, count: int = 1) -> None:
        self.count = count
        self._pool = ThreadPoolExecutor(self.count - 1) if self.count > 1 else None

    def map(self, function: Callable[[T], R], items: Sequence[T]) -> list[R]:
        """Results of a function that lets other threads run, in the order of the items.

        Each thread takes ceil(items / count) items that follow one another.
        """
        if self._pool is None or len(items) < 2:
            return [function(item) for item in items]
        share = -(-len(items) // self.count)
        others = [
            self._pool.submit(_each, function, items[start : start + share])
            for start in range(share, len(items), share)
        ]
        results = _each(function, items[:share])
        for other in others:
            results += other.result()
        return results


def _each(function: Callable[[T], R], items: Sequence[T]) -> list[R]:
    return [function(item) for item in items]


Indices = NDArray[np.intp]

# Equations of one piece: BLAS adds up so long a vector in one thread.
PIECE = 8192

# Elements of one matrix product: small enough for the cache, and for BLAS to use one thread only.
BLOCK = 256

# Fewer congruent elements than this, and a matrix for each of them is as fast as one for all.
WORTH_GROUPING = 4

# Nodal values of the elements that a thread takes at a time; so many share the cache.
BATCH = 65536

# Large meshes are cut into a multiple of so many domains, that as many threads have equal shares.
SHARES = 4


def pieces(neq: int) -> list[slice]:
    """The equations, piece by piece."""
    return [slice(i, min(i + PIECE, neq)) for i in range(0, neq, PIECE)]


class StiffnessOperator(ABC):
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
            Given a piece's number and its forces.

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


class CsrProduct(StiffnessOperator):
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


# Stiffness that a group's elements share, (n, n), or (ne, n, n) where each has its own; places of
# their unknowns in the extended vector, (ne, n).
Group = tuple[Floats, Indices]


class _Domain:
    """Some elements: gather, small matrix products, scatter.

    Parameters
    ----------
    groups : sequence of Group
    count : int
        Number of unknowns.
    size : int
        Entries of an extended vector.
    scratch : ndarray (2, entries)
        Room for nodal values and forces, which other domains may use at other times.
    """

    def __init__(self, groups: Sequence[Group], count: int, size: int, scratch: Floats) -> None:
        lists: list[Indices] = []
        matrices: list[Floats] = []
        for K, places in groups:
            kept = (places < size - 1).any(axis=0)
            lists.append(places[:, kept])
            matrices.append(np.ascontiguousarray(K[..., kept, :][..., kept]))
        self.places = np.concatenate([part.ravel() for part in lists])
        self._gathered, self.forces = scratch[:, : len(self.places)]
        # How it is multiplied, nodal values, matrix or matrices, forces.
        self._parts: list[tuple[Callable[..., Any], Floats, Floats, Floats]] = []
        end = 0
        for K, part in zip(matrices, lists, strict=True):
            for first in range(0, len(part), BLOCK):
                rows = slice(first, first + BLOCK)
                shape = part[rows].shape
                cut = slice(end, end + shape[0] * shape[1])
                q, f = self._gathered[cut].reshape(shape), self.forces[cut].reshape(shape)
                if K.ndim == 2:
                    self._parts.append((np.dot, q, K, f))
                else:
                    self._parts.append((np.matmul, q[:, None], K[rows], f[:, None]))
                end = cut.stop
        self._count, self._last = count, size - 1

    def multiply(self, extended: Floats) -> None:
        """Find the forces of each element."""
        extended.take(self.places, out=self._gathered, mode="clip")
        for product, q, K, forces in self._parts:
            product(q, K, out=forces)

    def prepare_sums(self) -> None:
        """Make the matrix that sums the elements' forces, for the range of rows that it needs."""
        turned = (self.places >= self._count) & (self.places < self._last)
        rows = np.where(turned, self.places - self._count, self.places)
        entries = np.flatnonzero(self.places < self._last)
        signs, rows = np.where(turned, -1.0, 1.0)[entries], rows[entries]
        self.rows = slice(int(rows.min()), int(rows.max()) + 1)
        self._sums = sparse.csr_array(
            (signs, ((rows - self.rows.start).astype(np.int32), entries.astype(np.int32))),
            shape=(self.rows.stop - self.rows.start, len(self.places)),
        )

    def sums(self, extended: Floats) -> Floats:
        """Forces of the domain's unknowns, those of :attr:`rows`."""
        self.multiply(extended)
        return np.asarray(self._sums @ self.forces)


class ElementProduct(StiffnessOperator):
    """K u element by element, domain by domain.

    Parameters
    ----------
    domains : sequence of sequence of Group
        The elements; domains may be taken by different threads.
    count : int
        Number of unknowns.
    signed : bool
        Whether -q is part of the extended vector.
    workers : Workers, optional
        Threads to share the work.
    """

    def __init__(
        self,
        domains: Sequence[Sequence[Group]],
        count: int,
        *,
        signed: bool = False,
        workers: Workers | None = None,
    ) -> None:
        self._count, self._signed = count, signed
        self._workers = workers or Workers()
        self.size = (2 if signed else 1) * count + 1
        share = -(-len(domains) // self._workers.count)
        most = max(sum(places.size for _, places in groups) for groups in domains)
        scratches = [np.empty((2, most)) for _ in range(0, len(domains), share)]
        self._domains = [
            _Domain(groups, count, self.size, scratches[number // share])
            for number, groups in enumerate(domains)
        ]
        self._total = np.empty(count)
        self._pieces = pieces(count)
        # A count is the faster sum of few forces, a sparse matrix that of many.
        self._small = len(self._domains) == 1
        if not self._small:
            for domain in self._domains:
                domain.prepare_sums()

    def each(self, extended: Floats, use: Callable[[int, Floats], R]) -> list[R]:
        """Hand K u on, piece by piece."""
        count = self._count
        if self._signed:
            np.negative(extended[:count], out=extended[count:-1])
        total = self._sum(extended) if self._small else self._sum_of_domains(extended)
        if len(self._pieces) == 1:
            return [use(0, total)]
        return [use(number, total[piece]) for number, piece in enumerate(self._pieces)]

    def _sum(self, extended: Floats) -> Floats:
        (domain,) = self._domains
        domain.multiply(extended)
        forces: Floats = np.bincount(domain.places, domain.forces, self.size)  # type: ignore[assignment]
        total = forces[: self._count]
        if self._signed:
            total -= forces[self._count : -1]
        return total

    def _sum_of_domains(self, extended: Floats) -> Floats:
        sums = self._workers.map(lambda domain: domain.sums(extended), self._domains)
        self._total.fill(0.0)
        for domain, forces in zip(self._domains, sums, strict=True):
            self._total[domain.rows] += forces
        return self._total


def stiffness_operator(
    plate: PlateModel,
    solver: str = AUTO,
    reduced: SymmetryReduction | None = None,
    workers: Workers | None = None,
) -> StiffnessOperator:
    """K u of a plate, by the way that suits the mesh.

    Parameters
    ----------
    plate : PlateModel
    solver : str
        ``"csr"`` for the sparse matrix of all unknowns; otherwise element by element, where
        elements that are congruent to enough others share a matrix.
    reduced : SymmetryReduction, optional
        What moves; every unknown without it.
    workers : Workers, optional
        Threads to share the work.
    """
    if solver == CSR:
        return CsrProduct(plate.stiffness)
    kept = reduced or whole(plate)
    domains: list[list[Group]] = []
    for family in plate.families:
        weights = kept.weights[family.rows]
        members = np.flatnonzero(weights)
        entries = len(members) * family.nodes.shape[1] * kept.unknowns_a_node
        shares = 1 if entries <= BATCH else SHARES * -(-entries // (SHARES * BATCH))
        same = congruence(family)
        # An element that is its own image counts once, where the others count twice.
        common = weights == weights.max()
        sizes = np.bincount(same.group[common], minlength=len(same.representatives))
        shared = sizes >= WORTH_GROUPING
        numbers = np.flatnonzero(shared)
        stiffness = plate.stiffness_of(family.take(same.representatives[numbers]))
        matrices = dict(zip(numbers.tolist(), weights.max() * stiffness, strict=True))
        places = kept.slots[family.nodes].reshape(len(family.rows), -1)
        for share in np.array_split(members, shares):
            groups: list[Group] = []
            grouped = common[share] & shared[same.group[share]]
            for number in np.unique(same.group[share[grouped]]):
                inside = share[grouped & (same.group[share] == number)]
                groups.append((matrices[int(number)], places[inside]))
            alone = share[~grouped]
            for start in range(0, len(alone), BLOCK):
                rows = alone[start : start + BLOCK]
                K = plate.stiffness_of(family.take(rows))
                groups.append((weights[rows, None, None] * K, places[rows]))
            domains.append(groups)
    return ElementProduct(domains, kept.count, signed=kept.signed, workers=workers)
