"""The discrete plate: assembled stiffness, mass and loads (equation 4-14).

Vectors over equations contain the free dofs in the order of their equation numbers; a field
contains all dofs of all nodes, (numnp, 5).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import NDArray

from fecm._errors import FecmError
from fecm._machine import require_memory
from fecm._typing import Bools, Floats, Indices
from fecm.mechanics import element_matrices
from fecm.mechanics.element_matrices import IntegrationRules
from fecm.mechanics.elements import Quadrature
from fecm.mechanics.interpolation import NDOF, W, jacobian_determinants
from fecm.mechanics.laminate import LaminateSection
from fecm.mechanics.mesh import (
    ElementBlock,
    MeshArrays,
    element_blocks,
    equation_numbers,
    rigid_deflections,
)
from fecm.mechanics.strains import FLAT, Curvature, Rows, StrainField
from fecm.mechanics.supports import NodeSupports

if TYPE_CHECKING:
    from scipy import sparse

# Upper bound of the bytes that assembly needs per entry of the element matrices.
ASSEMBLED = 24
# Rows of the assembled matrix that are added to together.
SLAB = 16_384
# Number of element matrices in memory at the same time.
BLOCK = 1024

# No initial membrane force.
UNLOADED = (0.0, 0.0, 0.0)

MatricesOf = Callable[[ElementBlock], Floats]


class UnsoundPlateError(FecmError, ArithmeticError):
    """The plate's stiffness is not finite, or no largest frequency is found."""


@dataclass(frozen=True, eq=False)
class PlateModel:
    """The discrete plate: M a + f(u) = P, with f(u) = K u unless it is nonlinear (equation 4-14).

    :func:`fecm.plate_model` builds it from a deck.  Quantities have the deck's units.  Vectors,
    (neq,), contain the free dofs u, v, w, theta_x, theta_y of node 1, then of node 2, and so on.
    A matrix is assembled when it is first used.

    Attributes
    ----------
    mesh : MeshArrays
        Nodes, elements, restraints, nodal forces, and the equation number of every dof.
    preload : tuple of float (3,)
        Initial membrane force N0_x, N0_y, N0_xy, force/length; `stiffness` contains its effect.
    curvature : tuple of float (3,)
        1/R_x, 1/R_y, 1/R_xy of a shallow panel, 1/length; `stiffness` contains its effect.
    nonlinear : bool
        Whether the plate stretches as it bends (NONL); `stiffness` is then that of the plate at
        rest.
    supports : NodeSupports or None
        Springs and one-sided supports (SPRI, UNIL); `stiffness` contains the springs.
    added_mass : ndarray (numnp, 5) or None
        Masses at the nodes beside the laminate's (MASS), mass; mass*length^2 for rotations.
    """

    mesh: MeshArrays
    laminate: LaminateSection
    rules: IntegrationRules
    # Uniform initial membrane force N0_x, N0_y, N0_xy, force/length; tension is positive.
    preload: tuple[float, float, float] = UNLOADED
    nonlinear: bool = False  # whether stretching follows from bending, see membrane.py
    others: tuple[LaminateSection, ...] = ()  # laminates beside the first
    # (numel,): laminate number of every element, from 0; None if all have the first laminate.
    laminate_numbers: Indices | None = None
    curvature: Curvature = FLAT  # 1/R_x, 1/R_y, 1/R_xy of a shallow panel, 1/length
    supports: NodeSupports | None = None
    added_mass: Floats | None = None

    def __repr__(self) -> str:
        nodes, elements = len(self.mesh.coordinates), len(self.mesh.elements)
        return f"<fecm plate model: {nodes} nodes, {elements} elements, {self.neq} equations>"

    @property
    def neq(self) -> int:
        """Number of equations, one for each free dof."""
        return self.mesh.number_of_equations

    @property
    def laminates(self) -> tuple[LaminateSection, ...]:
        """Laminates in the order of their numbers."""
        return (self.laminate, *self.others)

    @property
    def rows_by_laminate(self) -> list[tuple[LaminateSection, Rows]]:
        """Laminates with the rows of their elements; a single laminate has all rows."""
        numbers = self.laminate_numbers
        if numbers is None:
            return [(self.laminate, slice(None))]
        return [(section, np.flatnonzero(numbers == n)) for n, section in enumerate(self.laminates)]

    @property
    def thicknesses(self) -> Floats:
        """Thickness of every element, (numel, 1); (1, 1) for a single laminate."""
        thickness = np.array([[laminate.thickness] for laminate in self.laminates])
        return thickness if self.laminate_numbers is None else thickness[self.laminate_numbers]

    def laminate_of(self, family: ElementBlock) -> LaminateSection:
        """Return the laminate of a block's elements."""
        return self.laminates[family.laminate]

    @property
    def is_coupled(self) -> bool:
        """Whether B of an element's laminate is not 0."""
        if not self.others:
            return self.laminate.is_coupled
        return any(self.laminate_of(family).is_coupled for family in self.families)

    @property
    def is_curved(self) -> bool:
        """Whether the midplane stretches with the deflection of a curved panel."""
        return self.curvature != FLAT

    @property
    def moves_in_plane(self) -> bool:
        """Whether u and v move with w: B, the curvature or finite deflections couple them."""
        return self.is_coupled or self.is_curved or self.nonlinear

    @cached_property
    def supported(self) -> MeshArrays:
        """The mesh in which springs and one-sided supports count as restraints."""
        mesh = self.mesh
        if self.supports is None:
            return mesh
        codes = mesh.codes.copy()
        codes[self.supports.node, self.supports.dof] = 1
        return replace(mesh, codes=codes, equations=equation_numbers(codes))

    @property
    def is_linear(self) -> bool:
        """Whether the internal force is K u: no finite deflections and no one-sided supports."""
        return not (self.nonlinear or self.lifts)

    @property
    def lifts(self) -> bool:
        """Whether the plate has one-sided supports, from which it may lift off."""
        return self.supports is not None and bool(self.supports.is_one_sided.any())

    @property
    def held(self) -> PlateModel:
        """The plate with all one-sided supports closed; itself without them."""
        if self.supports is None or not self.lifts:
            return self
        return replace(self, supports=self.supports.held())

    @property
    def is_preloaded(self) -> bool:
        """Whether an initial membrane force acts."""
        return self.preload != UNLOADED

    @property
    def is_compressed(self) -> bool:
        """Whether a principal value of the preload is negative, so that the plate can buckle."""
        n_x, n_y, n_xy = self.preload
        return n_x < 0.0 or n_y < 0.0 or n_xy**2 > n_x * n_y

    @property
    def preload_strain(self) -> Floats:
        """Midplane strain A^-1 N0 of the preload, (3,), if B is zero; NaN if A is singular.

        The laminates of all elements have the same A.
        """
        laminate = self.laminate_of(self.families[0]) if self.others else self.laminate
        try:
            return np.linalg.solve(laminate.A, np.array(self.preload))
        except np.linalg.LinAlgError:
            return np.full(3, np.nan)

    @cached_property
    def _free(self) -> Bools:
        return np.asarray(self.mesh.equations > 0)

    @cached_property
    def _numbers(self) -> Indices:
        """Number of every dof, from 0: equations first, then restrained dofs."""
        numbers = self.mesh.equations.astype(np.intp) - 1
        restrained = numbers < 0
        numbers[restrained] = self.neq + np.arange(np.count_nonzero(restrained))
        return numbers

    @cached_property
    def families(self) -> list[ElementBlock]:
        """Elements in blocks with the same nodes present and the same laminate."""
        mesh = self.mesh
        if self.laminate_numbers is None:  # plates on one mesh share boxes and congruence
            return mesh.families
        return element_blocks(mesh.elements, mesh.coordinates, self.laminate_numbers)

    def stiffness_of(self, family: ElementBlock) -> Floats:
        """Return the element stiffness matrices, (ne, 5 nn, 5 nn), with K_sigma of the preload.

        ``replace(plate, preload=UNLOADED)`` is the plate without the preload.
        """
        K = element_matrices.stiffness(family, self.laminate_of(family), self.rules, self.curvature)
        if self.is_preloaded:
            K += element_matrices.geometric_stiffness(family, self.preload, self.rules)
        return K

    def _dofs(self, family: ElementBlock) -> Indices:
        return self._numbers[family.nodes].reshape(len(family.rows), -1)

    def _element_matrices(
        self, matrices_of: MatricesOf, weights: NDArray[np.int_] | None = None
    ) -> Iterator[tuple[Indices, Floats]]:
        """Yield dofs (ne, n) and matrices (ne, n, n) of elements, block by block."""
        for family in self.families:
            if weights is not None:
                represented = family.take(np.flatnonzero(weights[family.rows]))
                for part in represented.blocks(BLOCK):
                    yield self._dofs(part), weights[part.rows, None, None] * matrices_of(part)
                continue
            congruence = family.congruence
            for start in range(0, len(family.rows), BLOCK):
                block = np.arange(start, min(start + BLOCK, len(family.rows)))
                groups, group_of_element = np.unique(congruence.group[block], return_inverse=True)
                matrices = matrices_of(family.take(congruence.representatives[groups]))
                yield self._dofs(family.take(block)), matrices[group_of_element.ravel()]

    @property
    def entries(self) -> int:
        """Number of entries of all element matrices."""
        return sum(len(f.nodes) * (NDOF * f.nodes.shape[1]) ** 2 for f in self.families)

    def assembled(
        self, matrices_of: MatricesOf, weights: NDArray[np.int_] | None = None
    ) -> sparse.csr_array:
        """Assemble a matrix (neq, neq + restrained); columns of restrained dofs come last.

        Congruent elements share a matrix.  With `weights` (numel,), the number of elements that
        each element represents, every element has its own: it may depend on the displacement.
        """
        from scipy import sparse  # 0.16 s, which most runs don't need

        neq, ndof = self.neq, self._numbers.size
        require_memory(ASSEMBLED * self.entries, "to assemble the plate's matrices")
        # A sum costs as much as both of its matrices: a block is added to the slabs of its rows.
        starts = range(0, neq, SLAB)
        slabs = [sparse.csr_array((min(SLAB, neq - start), ndof)) for start in starts]
        for dofs, matrices in self._element_matrices(matrices_of, weights):
            rows = np.broadcast_to(dofs[:, :, None], matrices.shape)
            columns = np.broadcast_to(dofs[:, None, :], matrices.shape)
            stored = (rows < neq) & (matrices != 0.0)
            values = matrices[stored]
            row, column = (part[stored].astype(np.int32) for part in (rows, columns))
            slab = row // SLAB
            if len(slab) and slab.min() != slab.max():
                order = np.argsort(slab, kind="stable")
                row, column, values, slab = row[order], column[order], values[order], slab[order]
            numbers = np.unique(slab)
            cuts = [*np.searchsorted(slab, numbers).tolist(), len(slab)]
            for number, cut in zip(numbers.tolist(), map(slice, cuts, cuts[1:]), strict=False):
                entries = values[cut], (row[cut] - number * SLAB, column[cut])
                slabs[number] = slabs[number] + sparse.coo_array(entries, slabs[number].shape)
        total = sparse.vstack(slabs, format="csr") if slabs else sparse.csr_array((neq, ndof))
        total.sort_indices()
        return total

    @cached_property
    def _with_supports(self) -> sparse.csr_array:
        """K with the columns of the restrained dofs last."""
        return self.assembled(self.stiffness_of)

    @cached_property
    def stiffness(self) -> sparse.csr_array:
        """K, sparse (neq, neq): force/length; force*length for rotations.

        It is the tangent at rest, with the effects of curvature and preload.

        Raises
        ------
        NotEnoughMemoryError
            If the assembly needs more memory than is free; a MemoryError.
        """
        elements = self._with_supports[:, : self.neq].tocsr()
        if self.supports is None:
            return elements
        return elements + self.spring_matrix(~self.supports.is_one_sided)

    def spring_matrix(self, rows: Bools) -> sparse.dia_array:
        """Return the diagonal stiffness, (neq, neq), of the supports of a mask."""
        from scipy import sparse  # 0.16 s, which most runs don't need

        assert self.supports is not None
        diagonal = self.supports.diagonal(rows, len(self.mesh.coordinates))[self._free]
        return sparse.diags_array(diagonal)

    @cached_property
    def support(self) -> sparse.csr_array:
        """Internal forces per displacement of each restrained dof, (neq, restrained)."""
        return self._with_supports[:, self.neq :].tocsr()

    @cached_property
    def _determinants(self) -> list[Floats]:
        """Determinant of the Jacobian at the points of bending, (ne, npt), of every block."""
        rule = self.rules.bending
        return [
            np.concatenate([jacobian_determinants(part, rule) for part in family.blocks(BLOCK)])
            for family in self.families
        ]

    @cached_property
    def mass(self) -> Floats:
        """Diagonal of the lumped M, (neq,): mass; mass*length^2 for rotations."""
        mass = np.zeros(self._numbers.size)
        for family, determinants in zip(self.families, self._determinants, strict=True):
            laminate, rule = self.laminate_of(family), self.rules.bending
            for number, part in enumerate(family.blocks(BLOCK)):
                determinants_of_part = determinants[number * BLOCK : (number + 1) * BLOCK]
                lumped = element_matrices.lumped_mass(part, laminate, rule, determinants_of_part)
                np.add.at(mass, self._dofs(part).ravel(), lumped.ravel())
        return mass[: self.neq] + self._added_mass

    @property
    def _added_mass(self) -> Floats | float:
        """Masses of MASS, (neq,); 0 without."""
        return 0.0 if self.added_mass is None else self.added_mass[self._free]

    @cached_property
    def consistent_mass(self) -> sparse.csr_array:
        """Consistent M, sparse (neq, neq): mass; mass*length^2 for rotations.

        Its integrals have the quadrature of bending.

        Raises
        ------
        NotEnoughMemoryError
            If the assembly needs more memory than is free; a MemoryError.
        """
        from scipy import sparse  # 0.16 s, which most runs don't need

        rule = self.rules.bending
        with_supports = self.assembled(
            lambda f: element_matrices.consistent_mass(f, self.laminate_of(f), rule)
        )
        mass = with_supports[:, : self.neq].tocsr()
        if self.added_mass is None:
            return mass
        return mass + sparse.diags_array(self.added_mass[self._free])

    @cached_property
    def _areas(self) -> list[float]:
        """Area of every block, length squared."""
        weights = self.rules.bending.weights
        return [float((determinants @ weights).sum()) for determinants in self._determinants]

    def area(self) -> float:
        """Return the area of the plate, length squared."""
        return sum(self._areas)

    def total_mass(self) -> float:
        """Return the mass of the plate, force*time^2/length."""
        added = 0.0 if self.added_mass is None else float(self.added_mass[:, W].sum())
        if not self.others:
            return self.area() * self.laminate.mass + added
        masses = (self.laminate_of(family).mass for family in self.families)
        return sum(a * m for a, m in zip(self._areas, masses, strict=True)) + added

    def profile(self) -> int:
        """Count the entries of K from the first one of each column: the listing's JDIAG(NEQ)."""
        first = np.arange(self.neq)
        for family in self.families:
            dofs = self._dofs(family)
            lowest = np.where(dofs < self.neq, dofs, self.neq).min(axis=1)
            for column in dofs.T:
                free = column < self.neq
                np.minimum.at(first, column[free], lowest[free])
        return int((np.arange(self.neq) - first + 1).sum())

    def internal_forces(self, field: Floats) -> Floats:
        """Return the internal forces of all dofs under a displacement field, (numnp, 5)."""
        order = np.empty(self._numbers.size)
        order[self._numbers.ravel()] = field.ravel()
        forces = np.zeros(self._numbers.size)
        for dofs, K in self._element_matrices(self.stiffness_of):
            local = np.einsum("eij,ej->ei", K, order[dofs])
            forces += np.bincount(dofs.ravel(), local.ravel(), len(forces))
        total = np.asarray(forces[self._numbers])
        return total if self.supports is None else total + self.supports.forces(field)

    @property
    def nodal_loads(self) -> Floats:
        """P, (neq,): nodal forces minus internal forces of the prescribed displacements.

        The forces are those of FORC and the static force of PATC, at a proportional load of 1.
        """
        forces, free = self.mesh.forces, self._free
        loads = forces[free]
        if forces[~free].any():
            loads = loads - self.support @ forces[~free]
        return np.asarray(loads)

    def field(self, displacement: Floats, scale: float = 1.0) -> Floats:
        """Return all dofs of all nodes.

        Parameters
        ----------
        displacement : ndarray (neq,)
            Displacements of the free dofs: length, or radians.
        scale : float
            Factor of the prescribed displacements; 0 for velocities and mode shapes.

        Returns
        -------
        ndarray (numnp, 5)
            Values of u, v, w, theta_x, theta_y at every node.
        """
        full = scale * self.mesh.forces
        full[self._free] = displacement
        return full

    def rigid_mobility(self, share: Floats) -> float:
        """Return the rigid-body velocity under a load per impulse, 1/mass; 0 if the plate is held.

        `share` (numnp,) is the distribution of the unit force over w of the nodes.
        """
        motions = rigid_deflections(self.supported)
        if not motions.size:
            return 0.0
        mass = self.field(self.mass, 0.0)[:, 2]
        along = share @ motions
        return float(along @ np.linalg.solve((motions.T * mass) @ motions, along))

    def strain_field(
        self, points: Quadrature, kind: type[StrainField] = StrainField
    ) -> StrainField:
        """Return the strains at points of every element."""
        mesh, rules = self.mesh, self.rules
        return kind(
            mesh.elements,
            mesh.coordinates,
            points,
            transposed_jacobian=rules.transposed_jacobian,
            assumes_shear=rules.assumes_shear,
        )


# Product K u, processed in pieces that fit the cache ----------------------------------------------

R = TypeVar("R")

# Equations per piece: BLAS sums vectors of this length in one thread.
PIECE = 8192


def pieces(neq: int) -> list[slice]:
    """Return slices of the equations."""
    return [slice(i, min(i + PIECE, neq)) for i in range(0, neq, PIECE)]


class StiffnessOperator(ABC):
    """Operator that computes the internal forces of a displacement."""

    size: int  # entries of a padded vector
    # Integral of (N - N0) eps_q at the last displacement, see membrane.py; 0 for a linear plate.
    quadratic_work: float = 0.0

    @abstractmethod
    def each(self, padded: Floats, use: Callable[[int, Floats], R]) -> list[R]:
        """Compute K u and apply a function to the number and forces of each piece, in order.

        The padded vector, (size,), starts with the displacement and ends with a zero.
        """

    def __call__(self, displacement: Floats) -> Floats:
        """Return K u, (neq,)."""
        padded = np.zeros(self.size)
        padded[: len(displacement)] = displacement
        return np.concatenate(self.each(padded, lambda _, forces: forces.copy()))
