"""The projectile: a rigid mass, or an elastic rod of two-unknown elements, report section 4.3.2.

Conventions: unknowns of a node are u and du/dx, node by node; x runs from the impacted end (node 1)
into the rod.  Displacement, velocity and acceleration are positive away from the plate, so that an
approach is negative, and the contact force pushes u at node 1 in the positive direction.  The rod
knows nothing of the plate or the law.  Every state array has the unknowns first; more axes, one
column a case, may follow.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from fecm.rod_method import AVERAGE, CONSISTENT, WILSON

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
    consistent : bool
        Whether the mass matrix is the consistent one, equation 4-24, instead of the lumped one.
    """

    length: float
    diameters: tuple[float, ...]
    modulus: float
    density: float
    consistent: bool = False

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

    def with_mass(self, mass: str) -> Rod:
        """The same rod with another mass matrix, one of :data:`fecm.rod_method.MASSES`."""
        return replace(self, consistent=mass == CONSISTENT)

    def mass(self) -> Floats:
        """The mass in use: lumped, (n,), or consistent, (n, n)."""
        return self.consistent_mass() if self.consistent else self.lumped_mass()

    def consistent_mass(self) -> Floats:
        """Consistent mass matrix of the whole rod, equation 4-24: (n, n)."""
        L = self.length / self.elements
        shape = np.array(
            [
                [156.0, 22.0 * L, 54.0, -13.0 * L],
                [22.0 * L, 4.0 * L**2, 13.0 * L, -3.0 * L**2],
                [54.0, 13.0 * L, 156.0, -22.0 * L],
                [-13.0 * L, -3.0 * L**2, -22.0 * L, 4.0 * L**2],
            ]
        )
        M = np.zeros((2 * self.elements + 2, 2 * self.elements + 2))
        for element, area in enumerate(self.areas):
            unknowns = slice(2 * element, 2 * element + 4)
            M[unknowns, unknowns] += self.density * area * L / 420.0 * shape
        return M

    def lumped_mass(self) -> Floats:
        """Lumped mass of each unknown, (n,): rho A L/2 for u and rho A L^3/420 for du/dx."""
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
    """Half of x' A x for each row of x (rows, n), where A is diagonal, (n,), or the rod's band."""
    if matrix.ndim == 1:
        return np.asarray(0.5 * np.einsum("ri,ri,i->r", x, x, matrix))
    # Diagonal by diagonal, of which there are few, and in an order of its own.
    energy = 0.5 * np.einsum("ri,ri,i->r", x, x, np.diagonal(matrix))
    for off in range(1, 4):
        energy += np.einsum("ri,ri,i->r", x[:, :-off], x[:, off:], np.diagonal(matrix, off))
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

    def with_mass(self, mass: str) -> RigidMass:
        """The same mass, whatever the matrix."""
        return self

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


class TipStep(Protocol):
    """What the contact iteration needs of a projectile's step; see :class:`CollocationStep`."""

    @property
    def theta(self) -> float:
        """Where in the step equilibrium is met."""
        ...

    @property
    def gain(self) -> Any:
        """The tip's acceleration per force."""
        ...

    @property
    def weight(self) -> Any:
        """The tip's displacement per new acceleration."""
        ...

    def begin(self, state: Any) -> tuple[Any, Any, Any, Any]:
        """Free motion, and of the tip: acceleration in it, drift, acceleration so far."""
        ...

    def end(self, state: Any, motion: Any, force: Any) -> Any:
        """State after the step, with the displacement `tip`."""
        ...


class CollocationStep:
    r"""One step of an implicit method as a linear map, for a rod and a time step.

    Equilibrium is met at :math:`t + \theta \Delta t`, the acceleration running linearly from
    :math:`a` to :math:`a'` over the step; displacements are those of Newmark's method,
    :math:`u' = u + \Delta t v + \Delta t^2 ((1/2 - \beta) a + \beta a')`, velocities
    :math:`v' = v + \Delta t (a + a') / 2`.  With :math:`y` the motion of :class:`RodState` and
    :math:`f` the force on the tip at :math:`t + \theta \Delta t`, the new motion is
    :math:`y' = T y + h f`.

    Parameters
    ----------
    K : ndarray (n, n)
        Stiffness.
    m : ndarray (n,) or (n, n)
        Lumped mass, or mass matrix.
    dt : float
        Time step.
    constants_dt : float, optional
        Time step that the method's constants are made for, if not `dt` (the slip ``rod-dt``).

    Attributes
    ----------
    theta : float
        Where in the step equilibrium is met.
    inverse_beta : float
        1/beta, above 2.
    T : ndarray (3 n, 3 n)
    h : ndarray (3 n,)
    gain : float
        The tip's acceleration per force, of `h`.
    weights : (float, float)
        The tip's displacement per acceleration at the step's begin and at its end.
    weight : float
        The latter.
    n : int
        Number of the rod's unknowns.
    """

    theta: ClassVar[float]
    inverse_beta: ClassVar[float]

    def __init__(self, K: Floats, m: Floats, dt: float, constants_dt: float | None = None) -> None:
        theta, tau, r = self.theta, dt if constants_dt is None else constants_dt, self.inverse_beta
        self.dt = dt
        self.n = n = len(m)
        # Divisors of dt^2: 1/begin = 1/2 - beta, 1/end = beta.
        begin, end = 2.0 * r / (r - 2.0), r
        self.weights = (dt**2 / begin, dt**2 / end)
        self.weight = self.weights[1]
        a0 = r / (theta * tau) ** 2
        a2 = r / (theta * tau)
        a4 = a0 / theta
        one, none = np.eye(n), np.zeros((n, n))
        lumped = m.ndim == 1
        effective = np.linalg.inv(K + a0 * (np.diag(m) if lumped else m))

        def on_mass(factor: float) -> Floats:
            weighed = factor * effective
            return np.asarray(weighed * m if lumped else weighed @ m)

        # Written for the increment from u, so that the rigid motion does not cancel against it.
        acceleration = np.hstack(
            [
                -a4 * effective @ K,
                on_mass(a4 * a2) - a2 / theta * one,
                on_mass((r / 2.0 - 1.0) * a4) + (1.0 - r / 2.0 / theta) * one,
            ]
        )
        # Rigid displacements cause no force, and displacements are relative to the tip.
        acceleration[:, 0] = 0.0
        kept, relative = one.copy(), one.copy()
        kept[0, 0] = 0.0
        relative[2::2, 0] = -1.0
        velocity = np.hstack([none, one, tau / 2.0 * one]) + tau / 2.0 * acceleration
        moved = np.hstack([none, dt * one, tau**2 / begin * one]) + tau**2 / end * acceleration
        displacement = np.hstack([kept, none, none]) + relative @ moved
        self.T = np.vstack([displacement, velocity, acceleration])
        gain = a4 * effective[:, 0]
        self.h = np.concatenate([tau**2 / end * relative @ gain, tau / 2.0 * gain, gain])
        self.gain = float(gain[0])

    def begin(self, state: RodState) -> tuple[Floats, Any, Any, Any]:
        """Begin a step.

        Returns
        -------
        motion : ndarray (3 n, ...)
            New motion if no force acted on the tip.
        base, drift, acceleration : float or ndarray (...)
            The tip's acceleration in it; its displacement but for what the new acceleration adds,
            `weight` times it; its acceleration so far.
        """
        motion = np.dot(self.T, state.motion.reshape(3 * self.n, *state.motion.shape[2:]))
        _, v, a = state.motion[:, 0].tolist() if motion.ndim == 1 else state.motion[:, 0]
        base = motion.item(2 * self.n) if motion.ndim == 1 else motion[2 * self.n]
        return motion, base, state.tip + self.dt * v + self.weights[0] * a, a

    def end(self, state: RodState, motion: Floats, force: Any) -> RodState:
        """End a step that began with `motion`, under a force on the tip at t + theta dt."""
        h = self.h if motion.ndim == 1 else self.h[:, None]
        motion += h * force
        moved = motion.item(0) if motion.ndim == 1 else motion[0]
        return RodState(motion.reshape(3, self.n, *motion.shape[1:]), state.tip + moved)

    def advance(self, state: RodState, force: Any = 0.0) -> RodState:
        """State after a whole step under a force on the tip at t + theta dt."""
        return self.end(state, self.begin(state)[0], force)


class WilsonStep(CollocationStep):
    """Wilson's theta method: the report's program."""

    theta = WILSON_THETA
    inverse_beta = 6.0


class AverageAccelerationStep(CollocationStep):
    """Newmark's average acceleration, which keeps the energy of free motion."""

    theta = 1.0
    inverse_beta = 4.0


STEPS: dict[str, type[CollocationStep]] = {WILSON: WilsonStep, AVERAGE: AverageAccelerationStep}
