"""The coupled step of plate, projectile and contact law, report section 4.3.

Equations 4-14 (plate) and 4-25 (projectile) are coupled by the contact force F of 3-1, 3-3 and
3-11.  The plate moves by v += dt M^-1 (P - K u), u += dt v under the contact force of the last
step.  Then the projectile's implicit step and the contact law are iterated on the tip's
acceleration, at most five times.

Signs: w is positive along the push; the projectile's motion is positive away from the plate.  The
projectile starts on the plate, whose displacement is then w_0: 0, or that of a static load.  The
indentation is therefore -u_tip - (w - w_0).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Generic

import numpy as np

from fecm.mechanics.contact_law import ContactPoint, Law, Number, any_case, select
from fecm.mechanics.plate_motion import AppliedForce, DivergenceError, Load, PlateMotion, PlateState
from fecm.mechanics.projectile import Projectile, RodIntegrator, TipStep, WilsonStep, rigid_approach

# The listing's contact iteration.  The number of passes affects the results.
PASSES = 5
TOLERANCE = 1.0e-6


@dataclass
class ContactState(Generic[Number]):
    """State of projectile and contact after a step: floats, or arrays with an entry per case."""

    rod: Any  # the projectile: RodState, or a sweep's motion of the tips
    memory: Any  # memory of the contact law, whose type only the law knows
    contact: ContactPoint[Number]  # accepted indentation and contact force
    plate_w: Number  # the plate's displacement in the contact law
    contact_work: Number  # work stored or dissipated by the indentation
    # Steps whose contact iteration did not converge: an int, or an array of integers.
    unconverged_steps: Any


@dataclass
class ImpactState(ContactState[float]):
    """State of plate, projectile and contact after a step."""

    plate: PlateState = field(kw_only=True)  # the plate, with the number of steps and the time
    start_w: float | None = None  # w_0 in the contact law; None before the first impact step


@dataclass(frozen=True)
class ImpactConditions:
    """Conditions of the impact."""

    load: Load  # the impact dof, or the nodal weights of a patch
    velocity: float  # approach velocity, length/time
    # Whether the contact law takes the plate's motion into account.
    plate_moves: bool = True
    # Whether the rod's du/dx start at the approach velocity.
    strains_start_moving: bool = False
    # Whether the rod keeps the constants of the first time step.
    keeps_first_step: bool = False
    # Fraction of the contact force that acts on the plate.
    share: float = 1.0


class ImpactSystem:
    """Time integration of a plate and a projectile."""

    def __init__(
        self,
        motion: PlateMotion,
        rod: Projectile,
        law: Law,
        contact: ImpactConditions,
        integrator: type[RodIntegrator] = WilsonStep,
    ) -> None:
        self.motion, self.rod, self.law, self.contact = motion, rod, law, contact
        self.rod_stiffness, self.rod_mass = rod.stiffness(), rod.mass()
        self._integrator = integrator
        self._step: RodIntegrator | None = None
        self.first_dt: float | None = None  # time step of the rod's constants

    def start(self, plate: PlateState | None = None) -> ImpactState:
        """Return the state before the first step, in which projectile and plate just touch.

        The plate is at rest by default.
        """
        contact, state = self.contact, self.motion.start() if plate is None else plate
        rod = rigid_approach(
            self.rod, contact.velocity, derivatives_too=contact.strains_start_moving
        )
        return ImpactState(
            rod=rod,
            memory=self.law.start(),
            contact=ContactPoint(0.0, 0.0),
            plate_w=0.0,
            contact_work=0.0,
            unconverged_steps=0,
            plate=state,
        )

    def applied(self, state: ImpactState, force: float | None = None) -> AppliedForce:
        """Return the force on the plate: the contact force, or `force` if it is not None."""
        value = state.contact.force if force is None else force
        return AppliedForce(self.contact.load, self.contact.share * value)

    def advance(
        self, state: ImpactState, dt: float, factor: float = 1.0, force: float | None = None
    ) -> None:
        """Take one step and change the state; `factor` is the load factor of FORC's values.

        A `force` replaces the contact force on the plate.  In the first step the projectile starts
        on the plate.  Raises DivergenceError if the indentation or the force is no longer finite.
        """
        if state.start_w is None:
            state.start_w = self.deflection(state.plate)
        self.motion.advance(state.plate, dt, factor, self.applied(state, force))
        step = state.plate.step
        try:
            self.move_projectile(state, dt)
        except OverflowError:
            raise DivergenceError(step, "the contact force overflows") from None
        if not math.isfinite(state.contact.indentation + state.contact.force):
            raise DivergenceError(step, "the motion is no longer finite")

    def rod_step(self, dt: float) -> RodIntegrator:
        """Return the linear map of the rod for a time step, computed when the step changes."""
        if self._step is None or self._step.dt != dt:
            if not self.contact.keeps_first_step or self.first_dt is None:
                self.first_dt = dt
            self._step = self._integrator(
                self.rod_stiffness, self.rod_mass, dt, self.first_dt, self.rod.rigid
            )
        return self._step

    def deflection(self, plate: PlateState) -> float:
        """Return the plate's displacement in the contact law."""
        return self.contact.load.dot(plate.padded) if self.contact.plate_moves else 0.0

    def move_projectile(self, state: ImpactState, dt: float) -> None:
        """Advance projectile and contact to the plate's time."""
        w = self.deflection(state.plate)
        couple_step(self.rod_step(dt), self.law, state, w - (state.start_w or 0.0))
        state.plate_w = w


def _update_memory(iterating: Any, tried: Any, memory: Any) -> Any:
    """Return the memory after a trial; with one object per case, only iterating cases change."""
    if isinstance(iterating, np.ndarray) and isinstance(tried, np.ndarray):
        return np.where(iterating, tried, memory)
    return tried


def couple_step(
    step: TipStep[Any, Number], law: Law[Number], state: ContactState[Number], w: Number
) -> None:
    """Iterate contact force and tip acceleration for the plate's w, and change the state.

    w is measured from the plate's displacement before the impact.
    """
    last = state.contact
    motion, base, drift, acceleration = step.begin(state.rod)
    carried = (1.0 - step.theta) * last.force
    memory, tip = state.memory, drift + step.weight * acceleration
    force = last.force
    # A case keeps its force once its iteration has converged.
    iterating = np.ones(len(w), dtype=bool) if isinstance(w, np.ndarray) else True
    for _ in range(PASSES):
        trial, tried = law.trial(memory, last, -tip - w)
        force = select(iterating, trial, force)
        memory = _update_memory(iterating, tried, memory)
        before, tip = tip, drift + step.weight * (base + step.gain * (carried + step.theta * force))
        iterating = iterating & ((abs(tip - before) < TOLERANCE * abs(tip)) ^ True)
        if not any_case(iterating):
            break
    state.unconverged_steps += iterating
    state.rod = step.end(state.rod, motion, carried + step.theta * force)
    indentation = -state.rod.tip - w
    state.memory = law.accept(memory, last, indentation)
    state.contact = ContactPoint(indentation, force)
    state.plate_w = w
    state.contact_work += (last.force + force) / 2.0 * (indentation - last.indentation)
