"""Explicit motion of the plate: M a = P - K u.

The stored velocity belongs to the middle of the last step.  Vectors are over equations.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fecm.assembly import PlateModel
from fecm.solvers import AUTO

Floats = NDArray[np.float64]

# Longest sum that BLAS adds up in one thread.
_CHUNK = 8192


class DivergenceError(ArithmeticError):
    """The motion has lost all sense.

    Attributes
    ----------
    step : int
        The step at which it did.
    reason : str
        How that shows.
    """

    def __init__(self, step: int, reason: str) -> None:
        self.step = step
        self.reason = reason
        super().__init__(f"step {step}: {reason}")

    def __reduce__(self) -> tuple[type[DivergenceError], tuple[int, str]]:
        """Make the error again in another process."""
        return DivergenceError, (self.step, self.reason)


@dataclass(slots=True)
class PlateState:
    """The plate's part of what one step hands to the next.

    Attributes
    ----------
    step : int
        Steps taken.
    time : float
        Sum of their time steps.
    dt : float
        The last time step.
    displacement, velocity : ndarray (neq,)
        The unknowns, and their velocities half a step earlier.
    internal, restoring : ndarray (neq,)
        K u, and M^-1 K u.
    external_work : float
        Work done by nodal forces.
    """

    step: int
    time: float
    dt: float
    displacement: Floats
    velocity: Floats
    internal: Floats
    restoring: Floats
    external_work: float = 0.0


class PointForce(NamedTuple):
    """A force on one equation, on top of the nodal forces."""

    row: int
    force: float


class PlateMotion:
    """Moves a plate through time.

    Parameters
    ----------
    plate : PlateModel
    solver : str
        How K u is had: see :meth:`PlateModel.product`.
    """

    def __init__(self, plate: PlateModel, solver: str = AUTO) -> None:
        self.plate = plate
        self.product = plate.product(solver)
        self._inverse_mass = 1.0 / plate.mass
        self._work = np.empty(plate.neq)
        loads = plate.nodal_loads
        self._loads = loads if loads.any() else None

    def start(self) -> PlateState:
        """State of the plate at rest."""
        u, v, internal, restoring = (np.zeros(self.plate.neq) for _ in range(4))
        return PlateState(0, 0.0, 0.0, u, v, internal, restoring)

    def refresh(self, state: PlateState) -> None:
        """Make K u and its acceleration agree with the displacement."""
        state.internal = self.product(state.displacement)
        np.multiply(state.internal, self._inverse_mass, out=state.restoring)

    def unbalanced(
        self, state: PlateState, factor: float, point: PointForce | None = None
    ) -> Floats:
        """Load less internal force of every equation, at the state's instant.

        Parameters
        ----------
        state : PlateState
        factor : float
            Load factor of the nodal forces.
        point : PointForce, optional
        """
        force = -state.internal
        if point is not None:
            force[point.row] += point.force
        if self._loads is not None:
            force += factor * self._loads
        return force

    def advance(
        self,
        state: PlateState,
        dt: float,
        factor: float,
        point: PointForce | None = None,
        *,
        kick: float | None = None,
    ) -> None:
        """Take one step: v += kick M^-1 (P - K u), u += dt v.

        Parameters
        ----------
        state : PlateState
            Changed in place.
        dt : float
            Time step.
        factor : float
            Load factor of the nodal forces.
        point : PointForce, optional
        kick : float, optional
            Time between the middles of the last step and of this one; `dt` without it.
        """
        over, v = dt if kick is None else kick, state.velocity
        v -= np.multiply(state.restoring, over, out=self._work)
        if point is not None:
            v[point.row] += over * point.force * self._inverse_mass[point.row]
        if self._loads is not None:
            v += (over * factor) * (self._loads * self._inverse_mass)
        moved = np.multiply(v, dt, out=self._work)
        state.displacement += moved
        if self._loads is not None:
            state.external_work += factor * inner(self._loads, moved)
        self.refresh(state)
        state.step += 1
        state.time += dt
        state.dt = dt

    def kinetic_energy(
        self, state: PlateState, factor: float, point: PointForce | None = None
    ) -> float:
        """Kinetic energy at the displacement's instant (force*length).

        The stored velocity is half a step old, so that the energy is that of v + dt/2 a; without
        nodal forces its square is taken apart, which needs no more vectors than the step has.
        """
        v, half = state.velocity, 0.5 * state.dt
        if self._loads is not None:
            whole = v + half * self._inverse_mass * self.unbalanced(state, factor, point)
            return 0.5 * inner(self.plate.mass * whole, whole)
        dot = inner if len(v) > _CHUNK else np.dot
        square = float(dot(np.multiply(self.plate.mass, v, out=self._work), v))
        power = -float(dot(v, state.internal))
        force = float(dot(state.internal, state.restoring))
        if point is not None:
            row, F = point.row, point.force
            power += F * float(v[row])
            force += F * (F * float(self._inverse_mass[row]) - 2.0 * float(state.restoring[row]))
        return 0.5 * square + half * (power + 0.5 * half * force)

    def central_difference(self, state: PlateState, dt: float, factor: float) -> None:
        """Take one step of the central differences, from rest or from the last step.

        The first step from rest has half a kick, so that the velocity belongs to its middle; a
        change of the time step is met in the same way.
        """
        self.advance(state, dt, factor, kick=0.5 * (state.dt + dt))


def inner(a: Floats, b: Floats) -> float:
    """Inner product, the same to the last bit whatever the number of threads."""
    if len(a) <= _CHUNK:
        return float(np.dot(a, b))
    return sum(
        float(np.dot(a[i : i + _CHUNK], b[i : i + _CHUNK])) for i in range(0, len(a), _CHUNK)
    )
