"""The projectile: a rigid mass, an elastic rod with implicit steps, or a user's matrices.

Conventions: the dofs are ordered node by node; each node has u and du/dx.  x runs from the impacted
end (node 1) into the rod.  Displacement, velocity and acceleration are positive away from the
plate.  An approach is therefore negative, and the contact force acts on u of node 1 in the positive
direction.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from numbers import Real
from typing import Any, ClassVar, Literal, NamedTuple, Protocol, Self, TypeVar, runtime_checkable

import numpy as np

from fecm._errors import FecmError, OptionsError
from fecm._typing import Floats
from fecm.mechanics.contact_law import Number

SYMMETRY = 1e-9  # difference of a matrix from its transpose, over its largest entry
# Largest force of a rigid motion, and smallest eigenvalue of other motions, over the largest
# stiffness.
RIGID = 1e-12


class ProjectileError(FecmError, ValueError):
    """The matrices of a user's projectile do not describe one free elastic body."""


@runtime_checkable
class LinearProjectile(Protocol):
    """A free, linear projectile, defined by its matrices.

    The dofs are displacements along the line of the impact.  The first dof is the end that touches
    the plate: the contact force acts there, and the contact law takes its motion.  All dofs
    approach the plate with the velocity of ROD.  Nothing holds the projectile, so that a rigid
    motion causes no force.

    Examples
    --------
    A head on a spring, in front of a heavy carriage:

    >>> class SpringMounted:
    ...     def mass(self):
    ...         return [0.2, 4.8]
    ...     def stiffness(self):
    ...         return [[5e6, -5e6], [-5e6, 5e6]]
    """

    def mass(self) -> Any:
        """Return the masses of the dofs, (n,), or a positive definite mass matrix, (n, n)."""

    def stiffness(self) -> Any:
        """Return the symmetric stiffness matrix (force/length), (n, n).

        Only a rigid motion causes no force.
        """


class LumpedBody:
    """What a projectile without elements along its axis says of itself.

    A transducer on such a body measures the contact force.
    """

    elements: ClassVar[int] = 0  # elements of the axis, whose nodes may have a transducer
    element_time: ClassVar[float] = math.inf  # time in which a wave passes an element

    @property
    def name(self) -> str:
        """Name of the class, for messages and results."""
        return type(self).__name__

    def with_mass(self, mass: str) -> Self:
        """Return the same projectile: it has one mass matrix, lumped or consistent."""
        return self

    def transducer_force(self, station: Transducer, force: Floats, gradient: Floats) -> Floats:
        """Return the force at the transducer, (rows,): the contact force."""
        return -station.sign * force


class OwnProjectile(LumpedBody):
    """A user's projectile with checked matrices and the interface of :class:`Rod`.

    Raises ProjectileError if the matrices do not describe one free body.
    """

    def __init__(self, projectile: LinearProjectile) -> None:
        self._name = type(projectile).__name__
        if isinstance(projectile, type):
            raise ProjectileError(
                f"projectile {projectile.__name__} is a class; pass an object of it: "
                f"projectile={projectile.__name__}()"
            )
        self._mass = self._read_matrix(projectile, "mass")
        self._stiffness = self._read_matrix(projectile, "stiffness")
        if self._mass.ndim not in (1, 2) or not self._mass.size:
            raise self._error(f"mass has the shape {self._mass.shape}, not (n,) or (n, n)")
        M, K = np.diag(self._mass) if self._mass.ndim == 1 else self._mass, self._stiffness
        square = (len(self._mass), len(self._mass))
        for what, matrix in (("mass", M), ("stiffness", K)):
            if matrix.shape != square:
                raise self._error(f"{what} has the shape {matrix.shape}, not {square}")
            if not np.allclose(matrix, matrix.T, rtol=0.0, atol=SYMMETRY * np.abs(matrix).max()):
                raise self._error(f"{what} is not symmetric")
        if not (np.linalg.eigvalsh(M) > 0.0).all():
            raise self._error("mass is not positive definite")
        self.rigid: Floats = np.ones(len(M))
        self._check_free(K)
        self._inertia = M
        self.total_mass: float = float(self.rigid @ M @ self.rigid)

    @property
    def name(self) -> str:
        """Name of the user's class."""
        return self._name

    def _check_free(self, K: Floats) -> None:
        """Raise ProjectileError unless the rigid motion is the only motion without a force."""
        largest = float(np.abs(K).max())
        force = np.abs(K @ self.rigid)
        if (force > RIGID * largest).any():
            dof = int(force.argmax()) + 1
            raise self._error(
                f"a rigid motion has the force {force.max():.4g} per displacement at dof {dof}: "
                "something holds it, and a projectile flies freely"
            )
        values = np.linalg.eigvalsh(K)
        if (values < -RIGID * largest).any():
            raise self._error("stiffness has a negative eigenvalue")
        if len(K) > 1 and not values[1] > RIGID * largest:
            raise self._error("stiffness leaves two of its parts unconnected")

    def _read_matrix(self, projectile: LinearProjectile, method: str) -> Floats:
        """Call a method of the user's object and return its result as an array of numbers."""
        function = getattr(projectile, method, None)
        if not callable(function):
            raise self._error(f"it has no method {method}; it needs mass and stiffness")
        try:
            matrix = np.array(function(), dtype=float)
        except Exception as error:
            text = f"{type(error).__name__}: {error}"
            raise self._error(f"{method} failed with {text}") from error
        if not np.isfinite(matrix).all():
            raise self._error(f"{method} has an entry that is not finite")
        return matrix

    def _error(self, fault: str) -> ProjectileError:
        return ProjectileError(f"projectile {self.name}: {fault}")

    def stiffness(self) -> Floats:
        """Return the stiffness matrix, (n, n)."""
        return self._stiffness

    def mass(self) -> Floats:
        """Return the masses, (n,), or the mass matrix, (n, n)."""
        return self._mass

    def kinetic_energy(self, velocity: Floats) -> Floats:
        """Return the kinetic energy of velocities (rows, n) (force*length)."""
        return _quadratic_energy(self._inertia, velocity)

    def strain_energy(self, deformation: Floats) -> Floats:
        """Return the strain energy of displacements (rows, n) from the tip (force*length)."""
        return _quadratic_energy(self._stiffness, deformation)


def _quadratic_energy(matrix: Floats, x: Floats) -> Floats:
    """Return x' A x / 2 for each row of x (rows, n)."""
    return np.asarray(0.5 * np.einsum("ri,ij,rj->r", x, matrix, x))


# The report's steel rod in lb, in and s: a spherical cap of five steps, then the cylinder.
REPORT_CAP = (0.22, 0.36, 0.43, 0.48, 0.50)
REPORT_DIAMETER = 0.625
REPORT_ELEMENTS = 20
REPORT_LENGTH = 1.0
REPORT_MODULUS = 30.0e6
REPORT_DENSITY = 0.0006875

# The report's program uses the lumped mass, its text the consistent one (equation 4-24).
MassMatrix = Literal["lumped", "consistent"]
LUMPED: MassMatrix = "lumped"
CONSISTENT: MassMatrix = "consistent"
MASSES = (LUMPED, CONSISTENT)
Integrator = Literal["wilson", "average-acceleration"]
WILSON: Integrator = "wilson"
AVERAGE: Integrator = "average-acceleration"
INTEGRATORS = (WILSON, AVERAGE)


@dataclass(frozen=True)
class RodMethod:
    """Mass matrix and integrator of a rod, by default the report program's.

    Raises OptionsError if a name is unknown.
    """

    mass: str = LUMPED  # one of `MASSES`
    integrator: str = WILSON  # one of `INTEGRATORS`

    def __post_init__(self) -> None:
        for name, choices in (("mass", MASSES), ("integrator", INTEGRATORS)):
            if (value := getattr(self, name)) not in choices:
                raise OptionsError(f"unknown rod {name} {value!r}; known are {', '.join(choices)}")

    @property
    def attributes(self) -> dict[str, str]:
        """Attributes of a result: the values that differ from the defaults."""
        values = {"rod_mass": self.mass, "rod_integrator": self.integrator}
        return {name: value for name, value in values.items() if value not in (LUMPED, WILSON)}


def _check_numbers(kind: str, **values: object) -> None:
    """Raise ProjectileError if a value of a projectile is not a number."""
    for name, value in values.items():
        if not isinstance(value, Real) or isinstance(value, bool):
            raise ProjectileError(
                f"`{name}` of {kind} is {value!r}; it must be a number in the units of the deck"
            )


@dataclass(frozen=True)
class Rod:
    """A straight elastic rod of equal elements."""

    kind: ClassVar[str] = "elastic rod"
    # Fields that a sweep varies and a fit frees, by the names of their values.
    values: ClassVar[Mapping[str, str]] = {
        "rod_length": "length",
        "rod_modulus": "modulus",
        "rod_density": "density",
    }
    # Whether mass and stiffness are proportional to the total mass, so that a body of unit mass
    # stands for all of the kind.
    scales: ClassVar[bool] = False

    length: float
    diameters: tuple[float, ...]  # diameter of each element, starting at the impacted end
    modulus: float  # Young's modulus, force/area
    density: float  # mass per volume
    # Whether the mass matrix is the consistent one, equation 4-24, instead of the lumped one.
    consistent: bool = False

    def __post_init__(self) -> None:
        _check_numbers("Rod", length=self.length, modulus=self.modulus, density=self.density)

    @classmethod
    def cylinder(
        cls, length: float, diameter: float, modulus: float, density: float, elements: int = 20
    ) -> Rod:
        """Create a rod of one diameter."""
        _check_numbers("Rod", diameter=diameter)
        return cls(length, (float(diameter),) * elements, modulus, density)

    def __repr__(self) -> str:
        shape = f"Rod({self.length!r}, {self.diameters!r}, {self.modulus!r}, {self.density!r}"
        if len(set(self.diameters)) == 1:
            diameter = self.diameters[0]
            shape = f"Rod.cylinder({self.length!r}, {diameter!r}, {self.modulus!r}, "
            shape += f"{self.density!r}, elements={self.elements}"
        return f"{shape}, consistent=True)" if self.consistent else f"{shape})"

    @property
    def name(self) -> str:
        """Name of the class, for messages and results."""
        return type(self).__name__

    @property
    def elements(self) -> int:
        """Number of elements."""
        return len(self.diameters)

    @property
    def element_length(self) -> float:
        """Length of an element."""
        return self.length / self.elements

    @property
    def areas(self) -> Floats:
        """Cross-sectional area of each element, length squared."""
        return np.pi * np.array(self.diameters) ** 2 / 4.0

    @property
    def total_mass(self) -> float:
        """Mass of the rod."""
        return float(self.density * self.areas.sum() * self.length / self.elements)

    @property
    def rigid(self) -> Floats:
        """Dofs of a unit rigid displacement, (n,): 1 for u and 0 for du/dx."""
        return rigid_dofs(2 * self.elements + 2)

    def stiffness(self) -> Floats:
        """Return the stiffness matrix, equation 4-23, (n, n)."""
        ratios = [[36, 3, -36, 3], [3, 4, -3, -1], [-36, -3, 36, -3], [3, -1, -3, 4]]
        return self._assemble(self.modulus * self.areas / (30.0 * self.element_length), ratios)

    def with_mass(self, mass: str) -> Rod:
        """Return the rod with another mass matrix, ``"lumped"`` or ``"consistent"``."""
        return replace(self, consistent=mass == CONSISTENT)

    def with_total_mass(self, mass: float) -> Rod:
        """Return the rod with another total mass, by its density."""
        return replace(self, density=self.density * mass / self.total_mass)

    @property
    def element_time(self) -> float:
        """Time in which a wave passes an element."""
        return self.element_length * math.sqrt(self.density / self.modulus)

    def transducer_force(self, station: Transducer, force: Floats, gradient: Floats) -> Floats:
        """Return the force at the node of the transducer, E A du/dx, (rows,)."""
        area = float(self.areas[min(station.node, self.elements) - 1])
        return station.sign * self.modulus * area * gradient

    def mass(self) -> Floats:
        """Return the lumped mass, (n,), or the consistent mass, (n, n)."""
        return self.consistent_mass() if self.consistent else self.lumped_mass()

    def consistent_mass(self) -> Floats:
        """Return the consistent mass matrix, equation 4-24, (n, n)."""
        ratios = [[156, 22, 54, -13], [22, 4, 13, -3], [54, 13, 156, -22], [-13, -3, -22, 4]]
        return self._assemble(self.density * self.areas * self.element_length / 420.0, ratios)

    def _assemble(self, factors: Floats, ratios: list[list[int]]) -> Floats:
        """Sum the element matrices; each dof du/dx adds a factor of the element's length."""
        L = self.element_length
        shape = ratios * np.tile([[1.0, L], [L, L**2]], (2, 2))
        matrix = np.zeros((2 * self.elements + 2, 2 * self.elements + 2))
        for element, factor in enumerate(factors):
            dofs = slice(2 * element, 2 * element + 4)
            matrix[dofs, dofs] += factor * shape
        return matrix

    def lumped_mass(self) -> Floats:
        """Return the listing's lumped mass, (n,): rho A L/2 for u and rho A L^3/420 for du/dx."""
        L = self.element_length
        shares = (self.density * self.areas * L)[:, None] * [0.5, L**2 / 420.0]
        m = np.zeros((self.elements + 1, 2))
        m[:-1] += shares
        m[1:] += shares
        return m.ravel()

    def kinetic_energy(self, velocity: Floats) -> Floats:
        """Return the kinetic energy of velocities (rows, n) (force*length)."""
        return _energy(self.mass(), velocity)

    def strain_energy(self, deformation: Floats) -> Floats:
        """Return the strain energy of displacements (rows, n) from the tip (force*length)."""
        return _energy(self.stiffness(), deformation)


def _energy(matrix: Floats, x: Floats) -> Floats:
    """Return x' A x / 2 for each row of x (rows, n); A is diagonal, (n,), or a band matrix."""
    band = matrix.ndim == 2
    energy = 0.5 * np.einsum("ri,ri,i->r", x, x, np.diagonal(matrix) if band else matrix)
    for off in range(1, 4 if band else 1):  # the order of summation is fixed
        energy += np.einsum("ri,ri,i->r", x[:, :-off], x[:, off:], np.diagonal(matrix, off))
    return np.asarray(energy)


@dataclass(frozen=True)
class RigidMass(LumpedBody):
    """A projectile that does not deform, with one dof."""

    kind: ClassVar[str] = "rigid mass"
    values: ClassVar[Mapping[str, str]] = {}
    scales: ClassVar[bool] = True

    total_mass: float

    def __post_init__(self) -> None:
        _check_numbers("RigidMass", total_mass=self.total_mass)

    def with_total_mass(self, mass: float) -> RigidMass:
        """Return a rigid body of another mass."""
        return RigidMass(mass)

    @property
    def rigid(self) -> Floats:
        """Dofs of a unit rigid displacement, (1,)."""
        return np.ones(1)

    def stiffness(self) -> Floats:
        """Return the stiffness matrix, (1, 1): zero."""
        return np.zeros((1, 1))

    def mass(self) -> Floats:
        """Return the mass of the dof, (1,)."""
        return np.array([self.total_mass])

    def kinetic_energy(self, velocity: Floats) -> Floats:
        """Return the kinetic energy of velocities (rows, 1) (force*length)."""
        return np.asarray(0.5 * self.total_mass * velocity[:, 0] ** 2)

    def strain_energy(self, deformation: Floats) -> Floats:
        """Return the strain energy of displacements (rows, 1) relative to the tip: zero."""
        return np.zeros(len(deformation))


# Projectiles that PROJ can describe. Each says what it is; see the attributes of Rod.
DeckProjectile = Rod | RigidMass
Projectile = DeckProjectile | OwnProjectile


def own_projectile(projectile: Projectile | LinearProjectile | None) -> Projectile | None:
    """Return a user's projectile with checked matrices; raises ProjectileError if one is wrong."""
    if projectile is None or isinstance(projectile, Projectile):
        return projectile
    return OwnProjectile(projectile)


class Transducer(NamedTuple):
    """Node and sign of the force measured by the transducer."""

    node: int  # node of the rod, from 1; 0 for the contact force itself
    sign: float = -1.0  # -1 for a force positive in compression, +1 for one positive in tension

    @property
    def dof(self) -> int:
        """Dof du/dx of the node, from 0; 0, the dof of a rigid mass, without a node."""
        return max(0, 2 * self.node - 1)


State = TypeVar("State")


@dataclass(slots=True)
class RodState:
    """State of a rod.

    Displacements are relative to the tip, so that strains stay accurate in a long flight.
    """

    # (3, n): displacement relative to the tip, velocity and acceleration of every dof.  The first
    # displacement is the tip's increment in the last step.
    motion: Floats
    tip: float = 0.0  # displacement of the tip

    @classmethod
    def of(cls, displacement: Floats, velocity: Floats, acceleration: Floats) -> RodState:
        """Create a state from the displacement, velocity and acceleration of every dof."""
        motion = np.array([displacement, velocity, acceleration])
        motion[0, ::2] -= displacement[0]
        return cls(motion, displacement[0])

    @property
    def deformation(self) -> Floats:
        """Displacement of every dof relative to the tip, (n,)."""
        deformation = self.motion[0].copy()
        deformation[0] = 0.0
        return np.asarray(deformation)

    @property
    def velocity(self) -> Floats:
        """Velocity of every dof, (n,)."""
        return np.asarray(self.motion[1])

    @property
    def acceleration(self) -> Floats:
        """Acceleration of every dof, (n,)."""
        return np.asarray(self.motion[2])


class TipStep(Protocol[State, Number]):
    """Step of a projectile as the contact iteration uses it; see :class:`RodIntegrator`.

    The numbers are floats for one case, and arrays for many cases.
    """

    gain: Number  # tip acceleration per force
    weight: float  # tip displacement per new acceleration

    @property
    def theta(self) -> float:
        """Time of equilibrium, as a fraction of the step."""

    def begin(self, state: State) -> tuple[Floats, Number, Number, Number]:
        """Return the free motion, and the tip's acceleration in it, drift and last acceleration."""

    def end(self, state: State, motion: Floats, force: Number) -> State:
        """Return the state after the step."""


class RodIntegrator:
    r"""One step of an implicit method as a linear map, for a rod and a time step.

    Equilibrium (equation 4-25) is satisfied at :math:`t + \theta \Delta t`, with the acceleration
    linear from :math:`a` to :math:`a'` over the step [1]_.  Displacements and velocities follow
    Newmark's method,
    :math:`u' = u + \Delta t v + \Delta t^2 ((1/2 - \beta) a + \beta a')` and
    :math:`v' = v + \Delta t (a + a') / 2`.  With :math:`y` the motion of :class:`RodState` and
    :math:`f` the force on the tip at :math:`t + \theta \Delta t`, the new motion is
    :math:`y' = T y + h f`.

    `K` is the stiffness, `m` the lumped mass (n,) or a mass matrix (n, n).  `constants_dt` is the
    time step of the method's constants, `dt` by default.  `rigid` contains the dofs of a unit rigid
    displacement, (n,); a rod's by default.

    References
    ----------
    .. [1] K.-J. Bathe and E. L. Wilson, Numerical Methods in Finite Element Analysis, 1976.
    """

    theta: ClassVar[float]  # time of equilibrium, as a fraction of the step
    inverse_beta: ClassVar[float]  # 1/beta, above 2

    def __init__(
        self,
        K: Floats,
        m: Floats,
        dt: float,
        constants_dt: float | None = None,
        rigid: Floats | None = None,
    ) -> None:
        theta, tau, r = self.theta, dt if constants_dt is None else constants_dt, self.inverse_beta
        self.dt = dt
        self.n = n = len(m)
        divisor = 2.0 * r / (r - 2.0)  # 1/divisor = 1/2 - beta
        # Tip displacement per acceleration at the start and at the end of the step.
        self.weights = (dt**2 / divisor, dt**2 / r)
        self.weight = self.weights[1]
        a0, a2 = r / (theta * tau) ** 2, r / (theta * tau)
        a4 = a0 / theta
        identity, zeros = np.eye(n), np.zeros((n, n))
        lumped = m.ndim == 1
        try:
            effective = np.linalg.inv(K + a0 * (np.diag(m) if lumped else m))
        except np.linalg.LinAlgError:
            raise ProjectileError(
                f"the mass of the projectile is lost beside its stiffness in a time step of {dt:g}"
            ) from None

        def on_mass(factor: float) -> Floats:
            weighed = factor * effective
            return np.asarray(weighed * m if lumped else weighed @ m)

        # Work with the increment from u, to avoid cancellation with the rigid motion.
        of_velocity = on_mass(a4 * a2) - a2 / theta * identity
        of_acceleration = on_mass((r / 2.0 - 1.0) * a4) + (1.0 - r / 2.0 / theta) * identity
        acceleration = np.hstack([-a4 * effective @ K, of_velocity, of_acceleration])
        # Rigid displacements cause no force; displacements are relative to the tip.
        acceleration[:, 0] = 0.0
        without_tip, relative = identity.copy(), identity.copy()
        without_tip[0, 0] = 0.0
        relative[1:, 0] -= (rigid_dofs(n) if rigid is None else rigid)[1:]
        velocity = np.hstack([zeros, identity, tau / 2.0 * identity]) + tau / 2.0 * acceleration
        moved = (
            np.hstack([zeros, dt * identity, tau**2 / divisor * identity])
            + tau**2 / r * acceleration
        )
        displacement = np.hstack([without_tip, zeros, zeros]) + relative @ moved
        self.T = np.vstack([displacement, velocity, acceleration])
        gain = a4 * effective[:, 0]
        self.h = np.concatenate([tau**2 / r * relative @ gain, tau / 2.0 * gain, gain])
        self.gain = float(gain[0])  # tip acceleration per force

    def begin(self, state: RodState) -> tuple[Floats, float, float, float]:
        """Return the new motion without a force on the tip, (3 n,), and three values of the tip.

        The values are the tip's acceleration in the new motion, the tip's new displacement without
        `weight` times the new acceleration, and the tip's last acceleration.
        """
        motion = np.dot(self.T, state.motion.reshape(3 * self.n))
        _, v, a = state.motion[:, 0].tolist()
        return motion, motion.item(2 * self.n), state.tip + self.dt * v + self.weights[0] * a, a

    def end(self, state: RodState, motion: Floats, force: float) -> RodState:
        """Complete a step of free motion `motion` under a force on the tip at t + theta dt."""
        motion += self.h * force
        return RodState(motion.reshape(3, self.n), state.tip + motion.item(0))

    def advance(self, state: RodState, force: float = 0.0) -> RodState:
        """Return the state after a step under a force on the tip at t + theta dt."""
        return self.end(state, self.begin(state)[0], force)


class WilsonStep(RodIntegrator):
    """Wilson's theta method, which the report's program uses."""

    theta, inverse_beta = 1.4, 6.0


class AverageAccelerationStep(RodIntegrator):
    """Newmark's average acceleration, which conserves the energy of free motion."""

    theta, inverse_beta = 1.0, 4.0


STEPS: dict[str, type[RodIntegrator]] = {WILSON: WilsonStep, AVERAGE: AverageAccelerationStep}


def report_rod(density: float = REPORT_DENSITY) -> Rod:
    """Build the rod of the report's program (lb, in, s)."""
    diameters = REPORT_CAP + (REPORT_DIAMETER,) * (REPORT_ELEMENTS - len(REPORT_CAP))
    return Rod(REPORT_LENGTH, diameters, REPORT_MODULUS, density)


def rigid_dofs(n: int) -> Floats:
    """Return the dofs of a unit rigid displacement, (n,): 1 for u and 0 for du/dx."""
    return np.arange(1.0, n + 1.0) % 2.0


def rigid_approach(rod: Projectile, velocity: float, *, derivatives_too: bool = False) -> RodState:
    """Return the initial state of a rigid approach.

    With `derivatives_too`, du/dx also start at the approach velocity (``rod-start``).
    """
    motion = np.zeros((3, len(rod.mass())))
    motion[1, slice(None) if derivatives_too else rod.rigid > 0.0] = -velocity
    return RodState(motion)
