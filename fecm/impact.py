"""The coupled step: plate, projectile and the indentation between them, report section 4.3.

The plate moves by v += dt M^-1 (P - K u), u += dt v under the last step's contact force.  Then the
projectile's implicit step and the indentation law are iterated on the tip's acceleration, at most
five times.  Signs: w is positive along the push, the projectile's motion away from the plate, so
that the indentation is -u_tip - w.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fecm.assembly import PlateModel
from fecm.indentation import Law, Memory, Point
from fecm.projectile import WILSON_THETA, Rod, RodState, WilsonStep, rigid_approach

Floats = NDArray[np.float64]

# The contact iteration of the listing (3906-3923); its length is part of the numbers.
PASSES = 5
TOLERANCE = 1.0e-6


class DivergenceError(ArithmeticError):
    """The motion has lost all sense.

    Attributes
    ----------
    step : int
        The step at which it did.
    """

    def __init__(self, step: int, reason: str) -> None:
        self.step = step
        self.reason = reason
        super().__init__(f"step {step}: {reason}")


@dataclass(slots=True)
class ImpactState:
    """Everything that one step hands to the next.

    Attributes
    ----------
    step : int
        Steps taken.
    time : float
        Sum of their time steps.
    dt : float
        The last time step.
    displacement, velocity : ndarray (neq,)
        The plate's unknowns and their velocities, half a step earlier.
    internal : ndarray (neq,)
        K u.
    rod : RodState
        The projectile.
    memory : Memory
        The indentation law.
    contact : Point
        Accepted indentation and contact force.
    plate_w : float
        The plate's displacement that the law sees.
    contact_work, external_work : float
        Work stored in or lost to the indentation, and done by nodal forces.
    unsettled : int
        Steps whose contact iteration did not settle.
    """

    step: int
    time: float
    dt: float
    displacement: Floats
    velocity: Floats
    internal: Floats
    rod: RodState
    memory: Memory
    contact: Point
    plate_w: float = 0.0
    contact_work: float = 0.0
    external_work: float = 0.0
    unsettled: int = 0

    def to_arrays(self) -> dict[str, Floats]:
        """Store the state as plain arrays, from which :meth:`from_arrays` makes it again."""
        scalars = [
            self.step, self.time, self.dt, self.contact.indentation, self.contact.force,
            self.plate_w, self.contact_work, self.external_work, self.unsettled,
        ]  # fmt: skip
        memory = [getattr(self.memory, f.name) for f in dataclasses.fields(Memory)]
        return {
            "scalars": np.array(scalars, dtype=float),
            "memory": np.array(memory, dtype=float),
            "displacement": self.displacement.copy(),
            "velocity": self.velocity.copy(),
            "internal": self.internal.copy(),
            "rod": self.rod.motion.copy(),
        }

    @classmethod
    def from_arrays(cls, arrays: dict[str, Floats]) -> ImpactState:
        """Make the state again that :meth:`to_arrays` stored."""
        step, time, dt, a, force, w, contact, external, unsettled = arrays["scalars"].tolist()
        branch, *curve = arrays["memory"].tolist()
        return cls(
            int(step), time, dt,
            arrays["displacement"].copy(), arrays["velocity"].copy(), arrays["internal"].copy(),
            RodState(arrays["rod"].copy()), Memory(int(branch), *curve), Point(a, force),
            w, contact, external, int(unsettled),
        )  # fmt: skip


@dataclass(frozen=True)
class Contact:
    """How plate and projectile meet; the slips that concern it are parameters here.

    Attributes
    ----------
    equation : int
        Row of the impact unknown among the equations.
    velocity : float
        Approach velocity, length/time.
    plate_moves : bool
        Whether the law sees the plate move (not under the slip ``target``).
    strains_start_moving : bool
        Whether the rod's du/dx start at the approach velocity (the slip ``rod-start``).
    scales_forces : bool
        Whether the contact force scales all nodal forces (the slip ``force-scale``).
    keeps_first_step : bool
        Whether the rod keeps the constants of the first time step (the slip ``rod-dt``).
    """

    equation: int
    velocity: float
    plate_moves: bool = True
    strains_start_moving: bool = False
    scales_forces: bool = False
    keeps_first_step: bool = False


class Impact:
    """Steps a plate and a projectile through time.

    Parameters
    ----------
    plate : PlateModel
    rod : Rod
    law : Law
    contact : Contact
    solver : str
        How K u is had: see :meth:`PlateModel.product`.
    """

    def __init__(
        self, plate: PlateModel, rod: Rod, law: Law, contact: Contact, solver: str = ""
    ) -> None:
        self.plate = plate
        self.rod = rod
        self.law = law
        self.contact = contact
        self.rod_stiffness = rod.stiffness()
        self.rod_mass = rod.mass()
        loads = plate.nodal_loads
        self._loads = loads if loads.any() else None
        self._product = plate.product(solver)
        self._wilson: WilsonStep | None = None
        self._first_dt: float | None = None
        self._flexibility = np.empty(0)
        self._flexibility_dt = math.nan

    def start(self) -> ImpactState:
        """State before the first step: the plate at rest, the projectile about to touch it."""
        neq = self.plate.neq
        rod = rigid_approach(
            self.rod,
            self.contact.velocity,
            derivatives_too=self.contact.strains_start_moving,
        )
        return ImpactState(
            step=0,
            time=0.0,
            dt=0.0,
            displacement=np.zeros(neq),
            velocity=np.zeros(neq),
            internal=np.zeros(neq),
            rod=rod,
            memory=self.law.start(),
            contact=Point(0.0, 0.0),
        )

    def load_factor(self, state: ImpactState, proportional: float) -> float:
        """Factor of FORC's values: the proportional load, or the contact force under its slip."""
        return state.contact.force if self.contact.scales_forces else proportional

    def advance(self, state: ImpactState, dt: float, proportional: float = 1.0) -> None:
        """Take one step.

        Parameters
        ----------
        state : ImpactState
            Changed in place.
        dt : float
            Time step.
        proportional : float
            Load factor of FORC's values.

        Raises
        ------
        DivergenceError
            If a number is no longer finite.
        """
        self._move_plate(state, dt, proportional)
        try:
            self.move_projectile(state, dt)
        except OverflowError:
            raise DivergenceError(
                state.step + 1, "the contact force is beyond all bounds"
            ) from None
        state.step += 1
        state.time += dt
        state.dt = dt
        if not math.isfinite(state.contact.indentation + state.contact.force):
            raise DivergenceError(state.step, "the motion is no longer finite")

    def unbalanced(self, state: ImpactState, proportional: float) -> Floats:
        """Load less internal force of every equation, at the state's instant."""
        force = -state.internal
        force[self.contact.equation] += state.contact.force
        if self._loads is not None:
            force += self.load_factor(state, proportional) * self._loads
        return force

    def _move_plate(self, state: ImpactState, dt: float, proportional: float) -> None:
        """Move the plate under the last step's contact force."""
        if dt != self._flexibility_dt:
            self._flexibility, self._flexibility_dt = dt / self.plate.mass, dt
        force = self.unbalanced(state, proportional)
        force *= self._flexibility
        state.velocity += force
        moved = np.multiply(state.velocity, dt, out=force)
        state.displacement += moved
        if self._loads is not None:
            factor = self.load_factor(state, proportional)
            state.external_work += factor * inner(self._loads, moved)
        state.internal = self._product(state.displacement)

    def _rod_step(self, dt: float) -> WilsonStep:
        """Give the rod's linear map for a time step."""
        if self._wilson is None or self._wilson.dt != dt:
            if not self.contact.keeps_first_step or self._first_dt is None:
                self._first_dt = dt
            self._wilson = WilsonStep(self.rod_stiffness, self.rod_mass, dt, self._first_dt)
        return self._wilson

    def move_projectile(self, state: ImpactState, dt: float) -> None:
        """Iterate force and tip acceleration, then move the whole rod with what came out."""
        law, last, memory = self.law, state.contact, state.memory
        step = self._rod_step(dt)
        w = float(state.displacement[self.contact.equation]) if self.contact.plate_moves else 0.0
        motion = step.free_motion(state.rod)
        base, gain = float(motion[2 * step.n]), float(step.h[2 * step.n])
        u, v, acceleration = state.rod.motion[:, 0].tolist()
        drift, weight = u + dt * v + dt**2 / 3.0 * acceleration, dt**2 / 6.0
        carried = (1.0 - WILSON_THETA) * last.force
        tip, force = drift + weight * acceleration, last.force
        for _ in range(PASSES):
            before = tip
            force, memory = law.trial(memory, last, -before - w)
            acceleration = base + gain * (carried + WILSON_THETA * force)
            tip = drift + weight * acceleration
            if abs(tip - before) < TOLERANCE * abs(tip):
                break
        else:
            state.unsettled += 1
        motion += step.h * (carried + WILSON_THETA * force)
        state.rod = RodState(motion.reshape(3, step.n))
        indentation = -float(motion[0]) - w
        state.memory = law.accept(memory, last, indentation)
        state.contact = Point(indentation, force)
        state.plate_w = w
        state.contact_work += (last.force + force) / 2.0 * (indentation - last.indentation)


# Longest sum that BLAS adds up in one thread.
_CHUNK = 8192


def inner(a: Floats, b: Floats) -> float:
    """Inner product, the same to the last bit whatever the number of threads."""
    if len(a) <= _CHUNK:
        return float(np.dot(a, b))
    return sum(
        float(np.dot(a[i : i + _CHUNK], b[i : i + _CHUNK])) for i in range(0, len(a), _CHUNK)
    )
