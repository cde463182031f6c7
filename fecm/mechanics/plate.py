"""The plate as a whole: stiffness, mass, and what restraints and loads make of them.

Vectors over equations hold the unknowns that are not restrained, in the order of their equation
numbers; a field holds every unknown of every node, (numnp, 5).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from fecm._errors import FecmError
from fecm._memory import require
from fecm._typing import Floats
from fecm.mechanics import element_groups, element_matrices
from fecm.mechanics.element_groups import congruence
from fecm.mechanics.elements.quadrature import Quadrature
from fecm.mechanics.laminate import Laminate
from fecm.mechanics.mesh import Mesh
from fecm.mechanics.strains import StrainField

Indices = NDArray[np.intp]

# Bytes that assembly takes an entry of the element matrices: more than were measured.
ASSEMBLED = 24
# Elements whose matrices are in memory at the same time.
BLOCK = 1024


class UnsoundPlateError(FecmError, ArithmeticError):
    """A plate's numbers are such that nothing can be computed with them."""


@dataclass(frozen=True)
class IntegrationRules:
    """Quadrature of a plate, and how its derivatives are taken.

    Attributes
    ----------
    bending, shear : Quadrature
        Membrane, bending and mass; transverse shear.
    strains : Quadrature
        Where strains are stored.
    transposed : bool
        Use the inverse Jacobian transposed (the slip ``jacobian``).
    """

    bending: Quadrature
    shear: Quadrature
    strains: Quadrature
    transposed_jacobian: bool = False


@dataclass(frozen=True)
class PlateModel:
    """The discrete plate: M a + K u = P.

    Attributes
    ----------
    mesh : Mesh
    laminate : Laminate
    rules : IntegrationRules
    """

    mesh: Mesh
    laminate: Laminate
    rules: IntegrationRules

    @property
    def neq(self) -> int:
        """Number of equations."""
        return self.mesh.number_of_equations

    @cached_property
    def _free(self) -> NDArray[np.bool_]:
        return np.asarray(self.mesh.equations > 0)

    @cached_property
    def _free_places(self) -> Indices:
        """Places of the equations' unknowns in a field laid out flat."""
        return np.flatnonzero(self._free)

    @cached_property
    def _numbers(self) -> Indices:
        """Number of every unknown from 0: equations first, restrained unknowns behind them."""
        numbers = self.mesh.equations.astype(np.intp) - 1
        restrained = numbers < 0
        numbers[restrained] = self.neq + np.arange(np.count_nonzero(restrained))
        return numbers

    @cached_property
    def families(self) -> list[element_groups.ElementBlock]:
        """The elements, sorted by the nodes they have."""
        return element_groups.element_blocks(self.mesh.elements, self.mesh.coordinates)

    def stiffness_of(self, family: element_groups.ElementBlock) -> Floats:
        """Stiffness of each of some elements, (ne, 5 nn, 5 nn)."""
        rules = self.rules
        return element_matrices.stiffness(
            family,
            self.laminate,
            rules.bending,
            rules.shear,
            transposed_jacobian=rules.transposed_jacobian,
        )

    def _unknowns(self, family: element_groups.ElementBlock) -> Indices:
        return self._numbers[family.nodes].reshape(len(family.rows), -1)

    def _mass_of(self, family: element_groups.ElementBlock) -> Floats:
        return element_matrices.consistent_mass(family, self.laminate, self.rules.bending)

    def _element_matrices(
        self, matrices_of: Callable[[element_groups.ElementBlock], Floats]
    ) -> Iterator[tuple[Indices, Floats]]:
        """Unknowns (ne, n) and matrices (ne, n, n) of all elements, block by block."""
        for family in self.families:
            same = congruence(family)
            for start in range(0, len(family.rows), BLOCK):
                block = np.arange(start, min(start + BLOCK, len(family.rows)))
                wanted, which = np.unique(same.group[block], return_inverse=True)
                matrices = matrices_of(family.take(same.representatives[wanted]))
                yield self._unknowns(family.take(block)), matrices[which.ravel()]

    @property
    def entries(self) -> int:
        """Entries of all element matrices."""
        return sum(
            f.nodes.shape[0] * (element_matrices.NDOF * f.nodes.shape[1]) ** 2
            for f in self.families
        )

    def _assembled(
        self, matrices_of: Callable[[element_groups.ElementBlock], Floats]
    ) -> sparse.csr_array:
        """Sum of matrices, the restrained unknowns' columns behind those of the equations."""
        neq, whole = self.neq, self._numbers.size
        require(ASSEMBLED * self.entries, "to assemble the plate's matrices")
        total = sparse.csr_array((neq, whole))
        for unknowns, matrices in self._element_matrices(matrices_of):
            rows = np.broadcast_to(unknowns[:, :, None], matrices.shape)
            columns = np.broadcast_to(unknowns[:, None, :], matrices.shape)
            wanted = (rows < neq) & (matrices != 0.0)
            total = total + sparse.coo_array(
                (matrices[wanted], (rows[wanted], columns[wanted])), shape=(neq, whole)
            )
        total = total.tocsr()
        total.sort_indices()
        return total

    @cached_property
    def _with_supports(self) -> sparse.csr_array:
        """K with the columns of the restrained unknowns behind those of the equations."""
        return self._assembled(self.stiffness_of)

    @cached_property
    def stiffness(self) -> sparse.csr_array:
        """K, sparse (neq, neq); assembled when it is first asked for."""
        return self._with_supports[:, : self.neq].tocsr()

    @cached_property
    def support(self) -> sparse.csr_array:
        """What a displacement of each restrained unknown does to the equations."""
        return self._with_supports[:, self.neq :].tocsr()

    @cached_property
    def mass(self) -> Floats:
        """Lumped M, (neq,)."""
        mass = np.zeros(self._numbers.size)
        for family in self.families:
            for block in family.blocks(BLOCK):
                lumped = element_matrices.lumped_mass(block, self.laminate, self.rules.bending)
                np.add.at(mass, self._numbers[block.nodes].ravel(), lumped.ravel())
        return mass[: self.neq]

    @cached_property
    def consistent_mass(self) -> sparse.csr_array:
        """Consistent M, sparse (neq, neq), under the bending rule; made when first asked for."""
        return self._assembled(self._mass_of)[:, : self.neq].tocsr()

    def area(self) -> float:
        """Area of the plate, length squared."""
        rule = self.rules.bending
        return sum(
            float((element_matrices.jacobian_determinants(family, rule) @ rule.weights).sum())
            for family in self.families
        )

    def profile(self) -> int:
        """Entries of K in the listing's profile storage: columns from their first to the diagonal.

        The listing's JDIAG(NEQ).
        """
        first = np.arange(self.neq)
        for family in self.families:
            unknowns = self._unknowns(family)
            lowest = np.where(unknowns < self.neq, unknowns, self.neq).min(axis=1)
            for column in unknowns.T:
                held = column < self.neq
                np.minimum.at(first, column[held], lowest[held])
        return int((np.arange(self.neq) - first + 1).sum())

    def internal_forces(self, field: Floats) -> Floats:
        """Internal force of every unknown of every node under a field, (numnp, 5)."""
        order = np.empty(self._numbers.size)
        order[self._numbers.ravel()] = field.ravel()
        forces = np.zeros(self._numbers.size)
        for unknowns, K in self._element_matrices(self.stiffness_of):
            local = np.einsum("eij,ej->ei", K, order[unknowns])
            forces += np.bincount(unknowns.ravel(), local.ravel(), len(forces))
        return np.asarray(forces[self._numbers])

    @property
    def nodal_loads(self) -> Floats:
        """FORC's forces on the equations, less what its prescribed displacements cause: (neq,)."""
        forces, free = self.mesh.forces, self._free
        loads = forces[free]
        if forces[~free].any():
            loads = loads - self.support @ forces[~free]
        return np.asarray(loads)

    def field(self, displacement: Floats, scale: float = 1.0) -> Floats:
        """Every unknown of every node.

        Parameters
        ----------
        displacement : ndarray (neq,)
            The unknowns.
        scale : float
            Load factor of the prescribed displacements.

        Returns
        -------
        ndarray (numnp, 5)
        """
        full = scale * self.mesh.forces
        full.reshape(-1)[self._free_places] = displacement
        return full

    def strain_field(self, points: Quadrature) -> StrainField:
        """Strains at the given points of every element."""
        mesh, transposed_jacobian = self.mesh, self.rules.transposed_jacobian
        return StrainField(
            mesh.elements, mesh.coordinates, points, transposed_jacobian=transposed_jacobian
        )


def assemble(mesh: Mesh, laminate: Laminate, rules: IntegrationRules) -> PlateModel:
    """Make the plate of a mesh, a laminate and quadrature rules; matrices follow when needed.

    Raises
    ------
    ValueError
        If the mesh has no elements.
    """
    if not len(mesh.elements):
        raise ValueError("the mesh has no elements")
    return PlateModel(mesh, laminate, rules)
