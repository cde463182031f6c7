"""Implicit integration of the projectile: Wilson's theta method and average acceleration."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Literal, Protocol

import numpy as np

from fecm._frozen import frozen
from fecm._typing import Floats

# The report's program uses the lumped mass, its text the consistent one (equation 4-24).
MassMatrix = Literal["lumped", "consistent"]
LUMPED: MassMatrix = "lumped"
CONSISTENT: MassMatrix = "consistent"
MASSES = (LUMPED, CONSISTENT)

Integrator = Literal["wilson", "average-acceleration"]
WILSON: Integrator = "wilson"
AVERAGE: Integrator = "average-acceleration"
INTEGRATORS = (WILSON, AVERAGE)


@frozen
class RodMethod:
    """Mass matrix and integration method of a rod; the defaults are the report program's.

    Raises ValueError if mass or integrator is unknown.
    """

    mass: str = LUMPED  # one of `MASSES`
    integrator: str = WILSON  # one of `INTEGRATORS`

    def __post_init__(self) -> None:
        for name, value, known in (
            ("mass", self.mass, MASSES),
            ("integrator", self.integrator, INTEGRATORS),
        ):
            if value not in known:
                raise ValueError(f"unknown rod {name} {value!r}; known are {', '.join(known)}")

    @property
    def attributes(self) -> dict[str, str]:
        """Attributes of a result: the values that differ from the defaults."""
        values = {"rod_mass": self.mass, "rod_integrator": self.integrator}
        return {name: value for name, value in values.items() if value not in (LUMPED, WILSON)}


WILSON_THETA = 1.4


@dataclass(slots=True)
class RodState:
    """State of a rod.

    Displacements are relative to the tip, so that a long flight does not cancel the strains.
    """

    # (3, n, ...): displacement relative to the tip, velocity and acceleration of every dof; the
    # first displacement is the tip's increment of the last step.
    motion: Floats
    tip: Any = 0.0  # displacement of the tip

    @classmethod
    def of(cls, displacement: Floats, velocity: Floats, acceleration: Floats) -> RodState:
        """State with the displacement, velocity and acceleration of every dof."""
        motion = np.array([displacement, velocity, acceleration])
        motion[0, ::2] -= displacement[0]
        return cls(motion, displacement[0])

    @property
    def deformation(self) -> Floats:
        """Displacement of every dof relative to the tip, (n, ...)."""
        deformation = self.motion[0].copy()
        deformation[0] = 0.0
        return np.asarray(deformation)

    @property
    def displacement(self) -> Floats:
        """Displacement of every dof, (n, ...)."""
        displacement = self.deformation
        displacement[::2] += self.tip
        return displacement

    @property
    def velocity(self) -> Floats:
        """Velocity of every dof, (n, ...)."""
        return np.asarray(self.motion[1])

    @property
    def acceleration(self) -> Floats:
        """Acceleration of every dof, (n, ...)."""
        return np.asarray(self.motion[2])


class TipStep(Protocol):
    """Interface of a projectile's step to the contact iteration; see :class:`RodIntegrator`."""

    gain: Any  # tip acceleration per force
    weight: Any  # tip displacement per new acceleration

    @property
    def theta(self) -> float:
        """Time of equilibrium, as a fraction of the step."""
        ...

    def begin(self, state: Any) -> tuple[Any, Any, Any, Any]:
        """Free motion, and the tip's acceleration in it, drift and last acceleration."""
        ...

    def end(self, state: Any, motion: Any, force: Any) -> Any:
        """State after the step."""
        ...


class RodIntegrator:
    r"""One step of an implicit method as a linear map, for a rod and a time step.

    Equilibrium (equation 4-25) is satisfied at :math:`t + \theta \Delta t`, with the acceleration
    linear from :math:`a` to :math:`a'` over the step [1]_.  Displacements are those of Newmark's
    method,
    :math:`u' = u + \Delta t v + \Delta t^2 ((1/2 - \beta) a + \beta a')`, velocities
    :math:`v' = v + \Delta t (a + a') / 2`.  With :math:`y` the motion of :class:`RodState` and
    :math:`f` the force on the tip at :math:`t + \theta \Delta t`, the new motion is
    :math:`y' = T y + h f`.

    `K` is the stiffness, `m` the lumped mass (n,) or a mass matrix (n, n); `constants_dt` is the
    time step of the method's constants if that is not `dt` (the slip ``rod-dt``).

    References
    ----------
    .. [1] K.-J. Bathe and E. L. Wilson, Numerical Methods in Finite Element Analysis, 1976.
    """

    theta: ClassVar[float]  # time of equilibrium, as a fraction of the step
    inverse_beta: ClassVar[float]  # 1/beta, above 2

    def __init__(self, K: Floats, m: Floats, dt: float, constants_dt: float | None = None) -> None:
        theta, tau, r = self.theta, dt if constants_dt is None else constants_dt, self.inverse_beta
        self.dt = dt
        self.n = n = len(m)
        # Divisors of dt^2: 1/begin = 1/2 - beta, 1/end = beta.
        begin, end = 2.0 * r / (r - 2.0), r
        # Tip displacement per acceleration at the start and at the end of the step.
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

        # In terms of the increment from u, to avoid cancellation with the rigid motion.
        acceleration = np.hstack(
            [
                -a4 * effective @ K,
                on_mass(a4 * a2) - a2 / theta * one,
                on_mass((r / 2.0 - 1.0) * a4) + (1.0 - r / 2.0 / theta) * one,
            ]
        )
        # Rigid displacements cause no force; displacements are relative to the tip.
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
        self.gain = float(gain[0])  # tip acceleration per force

    def begin(self, state: RodState) -> tuple[Floats, Any, Any, Any]:
        """New motion without a force on the tip, (3 n, ...), and three values of the tip.

        These are its acceleration in that motion, its new displacement without `weight` times the
        new acceleration, and its last acceleration.
        """
        motion = np.dot(self.T, state.motion.reshape(3 * self.n, *state.motion.shape[2:]))
        _, v, a = state.motion[:, 0].tolist() if motion.ndim == 1 else state.motion[:, 0]
        base = motion.item(2 * self.n) if motion.ndim == 1 else motion[2 * self.n]
        return motion, base, state.tip + self.dt * v + self.weights[0] * a, a

    def end(self, state: RodState, motion: Floats, force: Any) -> RodState:
        """Complete a step of free motion `motion` under a force on the tip at t + theta dt."""
        h = self.h if motion.ndim == 1 else self.h[:, None]
        motion += h * force
        moved = motion.item(0) if motion.ndim == 1 else motion[0]
        return RodState(motion.reshape(3, self.n, *motion.shape[1:]), state.tip + moved)

    def advance(self, state: RodState, force: Any = 0.0) -> RodState:
        """State after a step under a force on the tip at t + theta dt."""
        return self.end(state, self.begin(state)[0], force)


class WilsonStep(RodIntegrator):
    """Wilson's theta method, used by the report's program."""

    theta = WILSON_THETA
    inverse_beta = 6.0


class AverageAccelerationStep(RodIntegrator):
    """Newmark's average acceleration, which conserves the energy of free motion."""

    theta = 1.0
    inverse_beta = 4.0


STEPS: dict[str, type[RodIntegrator]] = {WILSON: WilsonStep, AVERAGE: AverageAccelerationStep}
