"""The product K u of stiffness and displacement, which dominates the cost of a time step.

It is computed with SciPy's CSR matrix, or element by element: congruent elements share one small
matrix that stays in the cache, and the products run at the speed of BLAS.

A vector q is padded to (q, 0), or to (q, -q, 0) if symmetry reverses the sign of some dofs.  The
zero is the value of every dof at rest.  The result is processed in pieces while they are in the
cache.  The pieces and their order depend only on the plate, so that sums do not depend on the
number of threads.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from fecm._typing import Floats, Indices
from fecm.mechanics import kernels
from fecm.mechanics.kernels import membrane
from fecm.mechanics.kernels.plate import CompiledProduct
from fecm.mechanics.membrane import MembraneForces
from fecm.mechanics.mesh import distinct
from fecm.mechanics.plate import PlateModel, R, StiffnessOperator, pieces
from fecm.mechanics.supports import NodeSupports
from fecm.mechanics.symmetry import SymmetryReduction, unreduced

if TYPE_CHECKING:
    from scipy import sparse

# "auto" means the kernels if they are compiled, NumPy otherwise; "csr" is the sparse matrix.
SOLVERS = AUTO, KERNELS, NUMPY, CSR = "auto", "kernels", "numpy", "csr"

# Fraction of the critical time step that is used if the deck has no time step.
SAFE = 0.9

T = TypeVar("T")


class Workers:
    """Pool of `count` threads, including the caller's thread."""

    def __init__(self, count: int = 1) -> None:
        self.count = count
        self._pool = None
        if count > 1:
            from concurrent.futures import ThreadPoolExecutor  # 6 ms, for several threads only

            self._pool = ThreadPoolExecutor(count - 1)

    def map(self, function: Callable[[T], R], items: Sequence[T]) -> list[R]:
        """Apply a function that releases the GIL; each thread takes consecutive items."""
        if self._pool is None or len(items) < 2:
            return [function(item) for item in items]
        share = -(-len(items) // self.count)
        shares = [items[start : start + share] for start in range(0, len(items), share)]
        futures = [self._pool.submit(list, map(function, part)) for part in shares[1:]]
        results = [function(item) for item in shares[0]]
        for future in futures:
            results += future.result()
        return results


# Elements per matrix product: the product fits the cache, and BLAS uses one thread.
BLOCK = 256
# With fewer congruent elements, one matrix per element is as fast as a shared one.
WORTH_GROUPING = 4
# Nodal values per domain: they fit the cache.
BATCH = 65536
# The number of domains of a large mesh is a multiple of this, so that threads get equal shares.
SHARES = 4


class CsrProduct(StiffnessOperator):
    """K u with a sparse matrix."""

    def __init__(self, stiffness: sparse.csr_array) -> None:
        self._stiffness = stiffness
        self._pieces = pieces(stiffness.shape[0])
        self.size = stiffness.shape[0] + 1

    def each(self, padded: Floats, use: Callable[[int, Floats], R]) -> list[R]:
        """Compute K u and apply a function to each piece."""
        forces = np.asarray(self._stiffness @ padded[:-1])
        return [use(number, forces[piece]) for number, piece in enumerate(self._pieces)]


# Stiffness of a group's elements, shared (n, n) or individual (ne, n, n), and the indices of their
# dofs in the padded vector, (ne, n).
Group = tuple[Floats, Indices]


class _Domain:
    """Elements whose forces are computed by gather, small matrix products and scatter.

    Nodal values and forces are stored in `scratch`, (2, entries), which the domains of a thread
    share.
    """

    def __init__(self, groups: Sequence[Group], count: int, size: int, scratch: Floats) -> None:
        moving: list[Group] = []
        for K, dof_indices in groups:
            moves = (dof_indices < size - 1).any(axis=0)
            matrices = np.ascontiguousarray(K[..., moves, :][..., moves])
            moving.append((matrices, dof_indices[:, moves]))
        self.dof_indices = np.concatenate([part.ravel() for _, part in moving])
        self._gathered, self.forces = scratch[:, : len(self.dof_indices)]
        # Product function, nodal values, matrix or matrices, forces.
        self._parts: list[tuple[np.ufunc | Callable[..., Floats], Floats, Floats, Floats]] = []
        end = 0
        for K, part in moving:
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

    def multiply(self, padded: Floats) -> None:
        """Compute the forces of each element."""
        padded.take(self.dof_indices, out=self._gathered, mode="clip")
        for product, q, K, forces in self._parts:
            product(q, K, out=forces)

    def prepare_sums(self) -> None:
        """Build the matrix that sums the elements' forces, for the equations of the domain."""
        from scipy import sparse  # 0.16 s, which small plates don't need

        turned = (self.dof_indices >= self._count) & (self.dof_indices < self._last)
        equations = np.where(turned, self.dof_indices - self._count, self.dof_indices)
        entries = np.flatnonzero(self.dof_indices < self._last)
        signs, equations = np.where(turned, -1.0, 1.0)[entries], equations[entries]
        first, end = int(equations.min()), int(equations.max()) + 1
        self.equations = slice(first, end)
        self._sums = sparse.csr_array(
            (signs, ((equations - first).astype(np.int32), entries.astype(np.int32))),
            shape=(end - first, len(self.dof_indices)),
        )

    def sums(self, padded: Floats) -> Floats:
        """Return the forces on the domain's :attr:`equations`."""
        self.multiply(padded)
        return np.asarray(self._sums @ self.forces)


class ElementProduct(StiffnessOperator):
    """K u element by element.  The elements are split into domains, which threads share.

    `count` is the number of independent dofs.  With `signed` the padded vector contains -q.
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
        most_values = max(sum(indices.size for _, indices in groups) for groups in domains)
        scratches = [np.empty((2, most_values)) for _ in range(0, len(domains), share)]
        self._domains = [
            _Domain(groups, count, self.size, scratches[number // share])
            for number, groups in enumerate(domains)
        ]
        self._total = np.empty(count)
        self._pieces = pieces(count)
        # np.bincount is faster for few forces, a sparse matrix for many.
        if len(self._domains) > 1:
            for domain in self._domains:
                domain.prepare_sums()

    def each(self, padded: Floats, use: Callable[[int, Floats], R]) -> list[R]:
        """Compute K u and apply a function to each piece."""
        count = self._count
        if self._signed:
            np.negative(padded[:count], out=padded[count:-1])
        small = len(self._domains) == 1
        total = self._sum(padded) if small else self._sum_of_domains(padded)
        if len(self._pieces) == 1:
            return [use(0, total)]
        return [use(number, total[piece]) for number, piece in enumerate(self._pieces)]

    def _sum(self, padded: Floats) -> Floats:
        (domain,) = self._domains
        domain.multiply(padded)
        forces: Floats = np.bincount(domain.dof_indices, domain.forces, self.size)  # type: ignore[assignment]
        total = forces[: self._count]
        if self._signed:
            total -= forces[self._count : -1]
        return total

    def _sum_of_domains(self, padded: Floats) -> Floats:
        sums = self._workers.map(lambda domain: domain.sums(padded), self._domains)
        self._total.fill(0.0)
        for domain, forces in zip(self._domains, sums, strict=True):
            self._total[domain.equations] += forces
        return self._total


class NonlinearProduct(StiffnessOperator):
    """Internal forces of a nonlinear plate: K u plus the forces of the quadratic strains.

    `prescribed` (numnp, 5) are the displacements of the restrained dofs.  Their part of K u belongs
    to the loads, as for a linear plate.
    """

    def __init__(
        self, plate: PlateModel, reduction: SymmetryReduction, linear: StiffnessOperator
    ) -> None:
        self._linear = linear
        self._kept = reduction
        self._membrane = MembraneForces(plate, reduction.weights.astype(float))
        self._pieces = pieces(reduction.count)
        self.size = linear.size
        self.prescribed: Floats | None = None

    def each(self, padded: Floats, use: Callable[[int, Floats], R]) -> list[R]:
        """Compute the internal forces and apply a function to each piece."""
        reduction = self._kept
        field = reduction.field(padded[: reduction.count])
        if self.prescribed is not None:
            field += self.prescribed
        forces, self.quadratic_work = self._membrane.forces(field)
        if self.prescribed is not None:
            # Subtract the work of the supports: u f contains only the independent dofs.
            self.quadratic_work -= float((forces * self.prescribed).sum())
        quadratic = reduction.gather(forces)
        answers = self._linear.each(
            padded, lambda number, linear: use(number, linear + quadratic[self._pieces[number]])
        )
        self.quadratic_work += self._linear.quadratic_work
        return answers


class SupportedProduct(StiffnessOperator):
    """Internal forces with those of supports at nodes."""

    def __init__(
        self, product: StiffnessOperator, supports: NodeSupports, reduction: SymmetryReduction
    ) -> None:
        self._product, self._reduction = product, reduction
        moves = reduction.sign[supports.node, supports.dof] != 0.0
        self._supports = supports.select(moves)
        self._pieces = pieces(reduction.count)
        self.size = product.size

    def each(self, padded: Floats, use: Callable[[int, Floats], R]) -> list[R]:
        """Compute the internal forces and apply a function to each piece."""
        reduction, supports = self._reduction, self._supports
        field = reduction.field(padded[: reduction.count])
        added = reduction.gather(supports.forces(field))
        answers = self._product.each(
            padded, lambda number, forces: use(number, forces + added[self._pieces[number]])
        )
        self.quadratic_work = self._product.quadratic_work
        self.quadratic_work += supports.excess_work(supports.of(field))
        return answers


def resolved(solver: str) -> str:
    """Return the solver, with ``"auto"`` resolved."""
    if solver != AUTO:
        return solver
    return NUMPY if kernels.LIBRARY is None else KERNELS


def stiffness_operator(
    plate: PlateModel,
    solver: str = AUTO,
    reduced: SymmetryReduction | None = None,
    workers: Workers | None = None,
) -> StiffnessOperator:
    """Build the operator K u of a plate, for all dofs or for the independent dofs of `reduced`.

    K is the stiffness at rest, even for a nonlinear plate; see :func:`internal_force_operator`.
    The forces of one-sided supports are added to K u.

    The solver is one of `SOLVERS`.  ``"csr"`` uses the sparse matrix of all dofs.  The others work
    element by element, with one matrix for a large enough group of congruent elements.
    """
    solver = resolved(solver)
    reduction = reduced or unreduced(plate)
    if solver == CSR:
        of_all = CsrProduct(plate.stiffness)  # with the springs
        if plate.supports is None or not plate.lifts:
            return of_all
        lifting = plate.supports.select(plate.supports.is_one_sided)
        return SupportedProduct(of_all, lifting, reduction)
    if solver == KERNELS:
        return CompiledProduct(plate, reduction, 1 if workers is None else workers.count)
    domains: list[list[Group]] = []
    for family in plate.families:
        weights = reduction.weights[family.rows]
        members = np.flatnonzero(weights)
        entries = len(members) * family.nodes.shape[1] * reduction.dofs_per_node
        shares = 1 if entries <= BATCH else SHARES * -(-entries // (SHARES * BATCH))
        congruence = family.congruence
        # An element that is its own image counts once, every other element twice.
        has_common_weight = weights == weights.max()
        sizes = np.bincount(
            congruence.group[has_common_weight], minlength=len(congruence.representatives)
        )
        is_shared = sizes >= WORTH_GROUPING
        numbers = np.flatnonzero(is_shared)
        stiffness = plate.stiffness_of(family.take(congruence.representatives[numbers]))
        matrices = dict(zip(numbers.tolist(), weights.max() * stiffness, strict=True))
        dof_indices = reduction.dof_indices[family.nodes].reshape(len(family.rows), -1)
        for share in np.array_split(members, shares):
            groups: list[Group] = []
            is_grouped = has_common_weight[share] & is_shared[congruence.group[share]]
            for number in distinct(congruence.group[share[is_grouped]]):
                in_group = share[is_grouped & (congruence.group[share] == number)]
                groups.append((matrices[int(number)], dof_indices[in_group]))
            single = share[~is_grouped]
            for start in range(0, len(single), BLOCK):
                rows = single[start : start + BLOCK]
                K = plate.stiffness_of(family.take(rows))
                groups.append((weights[rows, None, None] * K, dof_indices[rows]))
            domains.append(groups)
    product = ElementProduct(domains, reduction.count, signed=reduction.signed, workers=workers)
    if plate.supports is None:
        return product
    return SupportedProduct(product, plate.supports, reduction)


def internal_force_operator(
    plate: PlateModel, solver: str, reduced: SymmetryReduction, workers: Workers | None = None
) -> StiffnessOperator:
    """Build the operator of the internal forces; they are K u unless the plate is nonlinear.

    The kernels compute the membrane of a nonlinear plate without prescribed displacements.
    """
    if plate.nonlinear and resolved(solver) == KERNELS and membrane.has_kernel_membrane(plate):
        prescribed = plate.mesh.forces[reduced.sign == 0.0]
        if not prescribed.any():
            threads = 1 if workers is None else workers.count
            return CompiledProduct(plate, reduced, threads, nonlinear=True)
    linear = stiffness_operator(plate, solver, reduced, workers)
    return NonlinearProduct(plate, reduced, linear) if plate.nonlinear else linear
