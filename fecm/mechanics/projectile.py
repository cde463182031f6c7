"""The projectile: a rigid mass, or an elastic rod, report section 4.3.2.

Conventions: the dofs of a node are u and du/dx, node by node; x runs from the impacted end (node 1)
into the rod.  Displacement, velocity and acceleration are positive away from the plate: an approach
is negative, and the contact force acts on u of node 1 in the positive direction.  The first axis of
state arrays is over dofs; another axis, one column per case, may follow.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fecm._frozen import frozen
from fecm._typing import Floats
from fecm.mechanics.rod_integrators import CONSISTENT, RodState

# The report's steel rod, in lb, in and s: a spherical cap of five steps, then the cylinder.
REPORT_CAP = (0.22, 0.36, 0.43, 0.48, 0.50)
REPORT_DIAMETER = 0.625
REPORT_ELEMENTS = 20
REPORT_LENGTH = 1.0
REPORT_MODULUS = 30.0e6
REPORT_DENSITY = 0.0006875
LISTING_DENSITY = 0.0003225


@frozen
class Rod:
    """A straight elastic rod of equal elements."""

    length: float
    diameters: tuple[float, ...]  # diameter of each element, starting at the impacted end
    modulus: float  # Young's modulus, force/area
    density: float  # mass per volume
    # Use the consistent mass matrix, equation 4-24, instead of the lumped one.
    consistent: bool = False

    @classmethod
    def cylinder(
        cls, length: float, diameter: float, modulus: float, density: float, elements: int = 20
    ) -> Rod:
        """Rod of one diameter."""
        return cls(length, (float(diameter),) * elements, modulus, density)

    @property
    def elements(self) -> int:
        """Number of elements."""
        return len(self.diameters)

    @property
    def areas(self) -> Floats:
        """Cross-sectional area of each element, length squared."""
        return np.pi * np.array(self.diameters) ** 2 / 4.0

    @property
    def total_mass(self) -> float:
        """Mass of the rod."""
        return float(self.density * self.areas.sum() * self.length / self.elements)

    def stiffness(self) -> Floats:
        """Stiffness matrix, equation 4-23: (n, n)."""
        L = self.length / self.elements
        shape = np.array(
            [
                [36.0, 3.0 * L, -36.0, 3.0 * L],
                [3.0 * L, 4.0 * L**2, -3.0 * L, -(L**2)],
                [-36.0, -3.0 * L, 36.0, -3.0 * L],
                [3.0 * L, -(L**2), -3.0 * L, 4.0 * L**2],
            ]
        )
        return self._assemble(self.modulus * self.areas / (30.0 * L), shape)

    def with_mass(self, mass: str) -> Rod:
        """The same rod with another mass matrix, ``"lumped"`` or ``"consistent"``."""
        return replace(self, consistent=mass == CONSISTENT)

    def mass(self) -> Floats:
        """Lumped mass, (n,), or consistent mass, (n, n)."""
        return self.consistent_mass() if self.consistent else self.lumped_mass()

    def consistent_mass(self) -> Floats:
        """Consistent mass matrix, equation 4-24: (n, n)."""
        L = self.length / self.elements
        shape = np.array(
            [
                [156.0, 22.0 * L, 54.0, -13.0 * L],
                [22.0 * L, 4.0 * L**2, 13.0 * L, -3.0 * L**2],
                [54.0, 13.0 * L, 156.0, -22.0 * L],
                [-13.0 * L, -3.0 * L**2, -22.0 * L, 4.0 * L**2],
            ]
        )
        return self._assemble(self.density * self.areas * L / 420.0, shape)

    def _assemble(self, factors: Floats, shape: Floats) -> Floats:
        """Sum of the element matrices `factors` times `shape`."""
        matrix = np.zeros((2 * self.elements + 2, 2 * self.elements + 2))
        for element, factor in enumerate(factors):
            dofs = slice(2 * element, 2 * element + 4)
            matrix[dofs, dofs] += factor * shape
        return matrix

    def lumped_mass(self) -> Floats:
        """Lumped mass of each dof, (n,): rho A L/2 for u and rho A L^3/420 for du/dx (listing)."""
        L = self.length / self.elements
        m = np.zeros(2 * self.elements + 2)
        for element, area in enumerate(self.areas):
            share = self.density * area * L * np.array([0.5, L**2 / 420.0])
            m[2 * element : 2 * element + 4] += np.tile(share, 2)
        return m

    def kinetic_energy(self, velocity: Floats) -> Floats:
        """Kinetic energy of velocities (rows, n) (force*length)."""
        return _energy(self.mass(), velocity)

    def strain_energy(self, deformation: Floats) -> Floats:
        """Strain energy of displacements (rows, n) relative to the tip (force*length)."""
        return _energy(self.stiffness(), deformation)


def _energy(matrix: Floats, x: Floats) -> Floats:
    """X' A x / 2 for each row of x (rows, n); A is diagonal, (n,), or the rod's band matrix."""
    if matrix.ndim == 1:
        return np.asarray(0.5 * np.einsum("ri,ri,i->r", x, x, matrix))
    # Diagonal by diagonal, in a fixed order of summation.
    energy = 0.5 * np.einsum("ri,ri,i->r", x, x, np.diagonal(matrix))
    for off in range(1, 4):
        energy += np.einsum("ri,ri,i->r", x[:, :-off], x[:, off:], np.diagonal(matrix, off))
    return np.asarray(energy)


@frozen
class RigidMass:
    """A projectile that does not deform, with one dof."""

    total_mass: float

    def with_mass(self, mass: str) -> RigidMass:
        """The same projectile: lumped and consistent mass are equal."""
        return self

    def stiffness(self) -> Floats:
        """Stiffness matrix, (1, 1): zero."""
        return np.zeros((1, 1))

    def mass(self) -> Floats:
        """Mass of the dof, (1,)."""
        return np.array([self.total_mass])

    def kinetic_energy(self, velocity: Floats) -> Floats:
        """Kinetic energy of velocities (rows, 1) (force*length)."""
        return np.asarray(0.5 * self.total_mass * velocity[:, 0] ** 2)

    def strain_energy(self, deformation: Floats) -> Floats:
        """Strain energy of displacements (rows, 1) relative to the tip: zero."""
        return np.zeros(len(deformation))


Projectile = Rod | RigidMass


@frozen
class Transducer:
    """Node and sign of the force that the transducer measures."""

    node: int  # node of the rod, from 1; 0 for the contact force itself
    sign: float = -1.0  # -1 for a force positive in compression, +1 for one positive in tension

    @property
    def dof(self) -> int:
        """Dof du/dx of the node, from 0; that of a rigid mass without a node."""
        return max(0, 2 * self.node - 1)


def report_rod(density: float = REPORT_DENSITY) -> Rod:
    """Build the rod of the report's program (lb, in, s)."""
    rest = REPORT_ELEMENTS - len(REPORT_CAP)
    diameters = REPORT_CAP + (REPORT_DIAMETER,) * rest
    return Rod(REPORT_LENGTH, diameters, REPORT_MODULUS, density)


def rigid_approach(rod: Projectile, velocity: float, *, derivatives_too: bool = False) -> RodState:
    """Initial state of a projectile that approaches the plate as a rigid body.

    With `derivatives_too` du/dx start at the same velocity (the slip ``rod-start``).
    """
    motion = np.zeros((3, len(rod.mass())))
    motion[1, :: 1 if derivatives_too else 2] = -velocity
    return RodState(motion)
