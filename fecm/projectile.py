"""The projectile: a rigid mass, or an elastic rod of two-unknown elements, report section 4.3.2.

Conventions: unknowns of a node are u and du/dx, node by node; x runs from the impacted end (node 1)
into the rod.  Displacement, velocity and acceleration are positive away from the plate, so that an
approach is negative, and the contact force pushes u at node 1 in the positive direction.  The rod
knows nothing of the plate or the law.  Every state array has the unknowns first; more axes, one
column a case, may follow.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

WILSON_THETA = 1.4

# The report's steel rod, in lb, in and s: a spherical cap of five steps, then the cylinder.
REPORT_CAP = (0.22, 0.36, 0.43, 0.48, 0.50)
REPORT_DIAMETER = 0.625
REPORT_ELEMENTS = 20
REPORT_LENGTH = 1.0
REPORT_MODULUS = 30.0e6
REPORT_DENSITY = 0.0006875
LISTING_DENSITY = 0.0003225


@dataclass(frozen=True)
class Rod:
    """A straight elastic rod of equal elements.

    Attributes
    ----------
    length : float
        Whole length.
    diameters : tuple of float
        Diameter of each element, from the impacted end on.
    modulus : float
        Young's modulus, force/area.
    density : float
        Mass per volume.
    """

    length: float
    diameters: tuple[float, ...]
    modulus: float
    density: float

    @property
    def elements(self) -> int:
        """Number of elements."""
        return len(self.diameters)

    @property
    def areas(self) -> Floats:
        """Cross-section of each element, length squared."""
        return np.pi * np.array(self.diameters) ** 2 / 4.0

    @property
    def total_mass(self) -> float:
        """Mass of the whole rod."""
        return float(self.density * self.areas.sum() * self.length / self.elements)

    def stiffness(self) -> Floats:
        """Stiffness matrix of the whole rod, equation 4-23: (n, n)."""
        L = self.length / self.elements
        shape = np.array(
            [
                [36.0, 3.0 * L, -36.0, 3.0 * L],
                [3.0 * L, 4.0 * L**2, -3.0 * L, -(L**2)],
                [-36.0, -3.0 * L, 36.0, -3.0 * L],
                [3.0 * L, -(L**2), -3.0 * L, 4.0 * L**2],
            ]
        )
        K = np.zeros((2 * self.elements + 2, 2 * self.elements + 2))
        for element, area in enumerate(self.areas):
            unknowns = slice(2 * element, 2 * element + 4)
            K[unknowns, unknowns] += self.modulus * area / (30.0 * L) * shape
        return K

    def mass(self) -> Floats:
        """Lumped mass of each unknown, (n,): rho A L/2 for u and rho A L^3/420 for du/dx."""
        L = self.length / self.elements
        m = np.zeros(2 * self.elements + 2)
        for element, area in enumerate(self.areas):
            share = self.density * area * L * np.array([0.5, L**2 / 420.0])
            m[2 * element : 2 * element + 4] += np.tile(share, 2)
        return m

    def kinetic_energy(self, velocity: Floats) -> Floats:
        """Kinetic energy of velocities (rows, n) (force*length)."""
        return np.asarray(0.5 * np.einsum("ri,ri,i->r", velocity, velocity, self.mass()))

    def strain_energy(self, deformation: Floats) -> Floats:
        """Strain energy of displacements (rows, n) relative to the tip (force*length)."""
        K, u = self.stiffness(), deformation
        # Diagonal by diagonal, of which there are few, and in an order of its own.
        energy = 0.5 * np.einsum("ri,ri,i->r", u, u, np.diagonal(K))
        for off in range(1, 4):
            energy += np.einsum("ri,ri,i->r", u[:, :-off], u[:, off:], np.diagonal(K, off))
        return np.asarray(energy)


@dataclass(frozen=True)
class RigidMass:
    """A projectile that does not deform: a rod of one unknown.

    Attributes
    ----------
    total_mass : float
        Mass.
    """

    total_mass: float

    def stiffness(self) -> Floats:
        """Stiffness matrix, (1, 1): none."""
        return np.zeros((1, 1))

    def mass(self) -> Floats:
        """Mass of the unknown, (1,)."""
        return np.array([self.total_mass])

    def kinetic_energy(self, velocity: Floats) -> Floats:
        """Kinetic energy of velocities (rows, 1) (force*length)."""
        return np.asarray(0.5 * self.total_mass * velocity[:, 0] ** 2)

    def strain_energy(self, deformation: Floats) -> Floats:
        """Strain energy of displacements (rows, 1) relative to the tip: none."""
        return np.zeros(len(deformation))


Projectile = Rod | RigidMass


@dataclass(frozen=True)
class Station:
    """Where and how the transducer measures.

    Attributes
    ----------
    node : int
        Node of the rod, from 1; 0 for the contact force itself.
    sign : float
        -1 for a force that is positive in compression, +1 in tension.
    """

    node: int
    sign: float = -1.0


def report_rod(density: float = REPORT_DENSITY) -> Rod:
    """Build the rod that stands in the report's program (lb, in, s)."""
    rest = REPORT_ELEMENTS - len(REPORT_CAP)
    diameters = REPORT_CAP + (REPORT_DIAMETER,) * rest
    return Rod(REPORT_LENGTH, diameters, REPORT_MODULUS, density)


@dataclass(slots=True)
class RodState:
    """State of a rod.

    Displacements are kept relative to the tip: a projectile flies far, and what is strain in them
    would drown in the rounding of the flight.

    Attributes
    ----------
    motion : ndarray (3, n, ...)
        Displacement relative to the tip, velocity and acceleration of every unknown; in the place
        of the tip's own displacement stands what the last step added to it.
    tip : float or ndarray (...)
        Displacement of the tip.
    """

    motion: Floats
    tip: Any = 0.0

    @classmethod
    def of(cls, displacement: Floats, velocity: Floats, acceleration: Floats) -> RodState:
        """Make a state of the displacement, velocity and acceleration of every unknown."""
        motion = np.array([displacement, velocity, acceleration])
        motion[0, ::2] -= displacement[0]
        return cls(motion, displacement[0])

    @property
    def deformation(self) -> Floats:
        """Displacement of every unknown relative to the tip, (n, ...)."""
        deformation = self.motion[0].copy()
        deformation[0] = 0.0
        return np.asarray(deformation)

    @property
    def displacement(self) -> Floats:
        """Displacement of every unknown, (n, ...)."""
        displacement = self.deformation
        displacement[::2] += self.tip
        return displacement

    @property
    def velocity(self) -> Floats:
        """Velocity of every unknown, (n, ...)."""
        return np.asarray(self.motion[1])

    @property
    def acceleration(self) -> Floats:
        """Acceleration of every unknown, (n, ...)."""
        return np.asarray(self.motion[2])


def rigid_approach(rod: Projectile, velocity: float, *, derivatives_too: bool = False) -> RodState:
    """State of a projectile that approaches the plate as a rigid body.

    Parameters
    ----------
    rod : Rod or RigidMass
    velocity : float
        Approach velocity, positive towards the plate, length/time.
    derivatives_too : bool
        Start du/dx at the same velocity (the slip ``rod-start``).
    """
    motion = np.zeros((3, len(rod.mass())))
    motion[1, :: 1 if derivatives_too else 2] = -velocity
    return RodState(motion)


class WilsonStep:
    r"""One step of Wilson's theta method as a linear map, for a rod and a time step.

    With :math:`y` the motion of :class:`RodState` and :math:`f` the force on the tip at
    :math:`t + \theta \Delta t`, the new motion is :math:`y' = T y + h f`.

    Parameters
    ----------
    K : ndarray (n, n)
        Stiffness.
    m : ndarray (n,)
        Lumped mass.
    dt : float
        Time step.
    constants_dt : float, optional
        Time step that the method's constants are made for, if not `dt` (the slip ``rod-dt``).

    Attributes
    ----------
    T : ndarray (3 n, 3 n)
    h : ndarray (3 n,)
    gain : float
        The tip's acceleration per force, of `h`.
    n : int
        Number of the rod's unknowns.
    """

    def __init__(self, K: Floats, m: Floats, dt: float, constants_dt: float | None = None) -> None:
        theta, tau = WILSON_THETA, dt if constants_dt is None else constants_dt
        self.dt = dt
        self.n = n = len(m)
        a0 = 6.0 / (theta * tau) ** 2
        a2 = 6.0 / (theta * tau)
        a4 = a0 / theta
        one, none = np.eye(n), np.zeros((n, n))
        effective = np.linalg.inv(K + a0 * np.diag(m))
        # Written for the increment from u, so that the rigid motion does not cancel against it.
        acceleration = np.hstack(
            [
                -a4 * effective @ K,
                a4 * a2 * effective * m - a2 / theta * one,
                2.0 * a4 * effective * m + (1.0 - 3.0 / theta) * one,
            ]
        )
        # Rigid displacements cause no force, and displacements are relative to the tip.
        acceleration[:, 0] = 0.0
        kept, relative = one.copy(), one.copy()
        kept[0, 0] = 0.0
        relative[2::2, 0] = -1.0
        # The acceleration is linear over the step.
        velocity = np.hstack([none, one, tau / 2.0 * one]) + tau / 2.0 * acceleration
        moved = np.hstack([none, dt * one, tau**2 / 3.0 * one]) + tau**2 / 6.0 * acceleration
        displacement = np.hstack([kept, none, none]) + relative @ moved
        self.T = np.vstack([displacement, velocity, acceleration])
        gain = a4 * effective[:, 0]
        self.h = np.concatenate([tau**2 / 6.0 * relative @ gain, tau / 2.0 * gain, gain])
        self.gain = float(gain[0])

    def free_motion(self, state: RodState) -> Floats:
        """New motion if no force acted on the tip, (3 n, ...)."""
        y = state.motion.reshape(3 * self.n, *state.motion.shape[2:])
        return np.asarray(np.dot(self.T, y))

    def end(self, state: RodState, motion: Floats) -> RodState:
        """State after a step from `state` whose new motion is `motion`, (3 n, ...)."""
        return RodState(motion.reshape(3, self.n, *motion.shape[1:]), state.tip + motion[0])
