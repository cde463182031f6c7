"""The coupled step: plate, projectile and the indentation between them, report section 4.3.

The plate moves by v += dt M^-1 (P - K u), u += dt v under the last step's contact force.  Then the
projectile's implicit step and the indentation law are iterated on the tip's acceleration, at most
five times.  Signs: w is positive along the push, the projectile's motion away from the plate, so
that the indentation is -u_tip - w.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fecm._typing import Floats
from fecm.mechanics.contact_law import ContactPoint, Law, LoadingHistory, Number
from fecm.mechanics.plate import PlateModel
from fecm.mechanics.plate_motion import DivergenceError, PlateMotion, PlateState, PointForce
from fecm.mechanics.projectile import Projectile, rigid_approach
from fecm.mechanics.rod_integrators import RodIntegrator, RodState, TipStep, WilsonStep

# The contact iteration of the listing; its length is part of the numbers.
PASSES = 5
TOLERANCE = 1.0e-6


@dataclass(slots=True)
class ContactState:
    """The projectile's and the law's part of what one step hands to the next.

    Values are floats, or arrays with one entry a case.

    Attributes
    ----------
    rod : RodState or TipState
        The projectile.
    memory : LoadingHistory
        The indentation law.
    contact : ContactPoint
        Accepted indentation and contact force.
    plate_w : float
        The plate's displacement that the law sees.
    contact_work : float
        Work stored in or lost to the indentation.
    unsettled : int
        Steps whose contact iteration did not settle.
    """

    rod: Any
    memory: LoadingHistory
    contact: ContactPoint
    plate_w: Number = 0.0
    contact_work: Number = 0.0
    unconverged_steps: Number = 0


@dataclass(slots=True)
class ImpactState(ContactState):
    """Everything that one step hands to the next.

    Attributes
    ----------
    plate : PlateState
        The plate, with the number of steps and their time.
    """

    plate: PlateState = field(kw_only=True)

    def to_arrays(self) -> dict[str, Floats]:
        """Store the state as plain arrays, from which :meth:`from_arrays` makes it again."""
        scalars = [
            self.rod.tip, self.contact.indentation, self.contact.force, self.plate_w,
            self.contact_work, self.unconverged_steps,
        ]  # fmt: skip
        memory = [getattr(self.memory, f.name) for f in dataclasses.fields(LoadingHistory)]
        return {
            "contact": np.array(scalars, dtype=float),
            "memory": np.array(memory, dtype=float),
            "rod": self.rod.motion.copy(),
            **self.plate.to_arrays(),
        }

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, Floats]) -> ImpactState:
        """Make the state again that :meth:`to_arrays` stored."""
        tip, indentation, force, w, work, unconverged_steps = arrays["contact"].tolist()
        branch, *curve = arrays["memory"].tolist()
        return cls(
            RodState(arrays["rod"].copy(), tip),
            LoadingHistory(int(branch), *curve),
            ContactPoint(indentation, force),
            w,
            work,
            int(unconverged_steps),
            plate=PlateState.from_arrays(arrays),
        )


@dataclass(frozen=True)
class ImpactConditions:
    """How plate and projectile meet; the slips that concern it are parameters here.

    Attributes
    ----------
    row : int
        Place of the impact unknown among those that move.
    velocity : float
        Approach velocity, length/time.
    plate_moves : bool
        Whether the law sees the plate move (not under the slip ``target``).
    strains_start_moving : bool
        Whether the rod's du/dx start at the approach velocity (the slip ``rod-start``).
    keeps_first_step : bool
        Whether the rod keeps the constants of the first time step (the slip ``rod-dt``).
    share : float
        Part of the contact force that the plate feels; 1 but for the slip ``rod-force``.
    """

    row: int
    velocity: float
    plate_moves: bool = True
    strains_start_moving: bool = False
    keeps_first_step: bool = False
    share: float = 1.0


class ImpactSystem:
    """Steps a plate and a projectile through time.

    Parameters
    ----------
    motion : PlateMotion
    rod : Rod or RigidMass
    law : Law
    contact : ImpactConditions
    integrator : type of RodIntegrator
        The rod's.

    Attributes
    ----------
    first_dt : float or None
        Time step that the rod's constants are made for.
    """

    def __init__(
        self,
        motion: PlateMotion,
        rod: Projectile,
        law: Law,
        contact: ImpactConditions,
        integrator: type[RodIntegrator] = WilsonStep,
    ) -> None:
        self.motion = motion
        self.rod = rod
        self.law = law
        self.contact = contact
        self.rod_stiffness = rod.stiffness()
        self.rod_mass = rod.mass()
        self._integrator = integrator
        self._step: RodIntegrator | None = None
        self.first_dt: float | None = None

    @property
    def plate(self) -> PlateModel:
        """The plate."""
        return self.motion.plate

    def start(self, plate: PlateState | None = None) -> ImpactState:
        """State before the first step: the projectile about to touch the plate.

        Parameters
        ----------
        plate : PlateState, optional
            The plate's state, shared with the caller; at rest without it.
        """
        rod = rigid_approach(
            self.rod, self.contact.velocity, derivatives_too=self.contact.strains_start_moving
        )
        state = self.motion.start() if plate is None else plate
        return ImpactState(rod, self.law.start(), ContactPoint(0.0, 0.0), plate=state)

    def point_force(self, state: ImpactState, force: float | None = None) -> PointForce:
        """The force on the plate: the contact force, or another in its place."""
        given = state.contact.force if force is None else force
        return PointForce(self.contact.row, self.contact.share * given)

    def advance(
        self, state: ImpactState, dt: float, factor: float = 1.0, force: float | None = None
    ) -> None:
        """Take one step.

        Parameters
        ----------
        state : ImpactState
            Changed in place.
        dt : float
            Time step.
        factor : float
            Load factor of FORC's values.
        force : float, optional
            Force that the plate feels in place of the contact force (the slip ``prop-contact``).

        Raises
        ------
        DivergenceError
            If a number is no longer finite.
        """
        self.motion.advance(state.plate, dt, factor, self.point_force(state, force))
        step = state.plate.step
        try:
            self.move_projectile(state, dt)
        except OverflowError:
            raise DivergenceError(step, "the contact force is beyond all bounds") from None
        if not math.isfinite(state.contact.indentation + state.contact.force):
            raise DivergenceError(step, "the motion is no longer finite")

    def _rod_step(self, dt: float) -> RodIntegrator:
        """Give the rod's linear map for a time step."""
        if self._step is None or self._step.dt != dt:
            if not self.contact.keeps_first_step or self.first_dt is None:
                self.first_dt = dt
            self._step = self._integrator(self.rod_stiffness, self.rod_mass, dt, self.first_dt)
        return self._step

    def move_projectile(self, state: ImpactState, dt: float) -> None:
        """Bring projectile and law to the plate's instant."""
        w = state.plate.extended.item(self.contact.row) if self.contact.plate_moves else 0.0
        couple_step(self._rod_step(dt), self.law, state, w)


def couple_step(step: TipStep, law: Law, state: ContactState, w: Number) -> None:
    """Iterate force and tip acceleration, then move the whole projectile with what came out.

    Parameters
    ----------
    step : TipStep
        The projectile's step.
    law : Law
    state : ContactState
        Changed in place.
    w : float
        The plate's displacement under the projectile; an array where there are many cases.
    """
    last = state.contact
    motion, base, drift, acceleration = step.begin(state.rod)
    carried = (1.0 - step.theta) * last.force
    iterate = _iterate_cases if isinstance(w, np.ndarray) else _iterate
    guess = drift + step.weight * acceleration
    force, state.memory, settled = iterate(step, law, state, w, guess, base, drift, carried)
    state.unconverged_steps += 1 - settled
    state.rod = step.end(state.rod, motion, carried + step.theta * force)
    indentation = -state.rod.tip - w
    state.memory = law.accept(state.memory, last, indentation)
    state.contact = ContactPoint(indentation, force)
    state.plate_w = w
    state.contact_work += (last.force + force) / 2.0 * (indentation - last.indentation)


def _iterate(
    step: TipStep,
    law: Law,
    state: ContactState,
    w: float,
    tip: float,
    base: float,
    drift: float,
    carried: float,
) -> tuple[float, LoadingHistory, bool]:
    """Contact force of one case, the memory that its trials leave, and whether it settled."""
    memory, last = state.memory, state.contact
    theta, gain, weight = step.theta, step.gain, step.weight
    force = last.force
    for _ in range(PASSES):
        before = tip
        force, memory = law.trial(memory, last, -before - w)
        tip = drift + weight * (base + gain * (carried + theta * force))
        if abs(tip - before) < TOLERANCE * abs(tip):
            return force, memory, True
    return force, memory, False


def _iterate_cases(
    step: TipStep,
    law: Law,
    state: ContactState,
    w: Floats,
    tip: Floats,
    base: Floats,
    drift: Floats,
    carried: Floats,
) -> tuple[Floats, LoadingHistory, NDArray[np.int_]]:
    """The same of many cases, each of which stands still once it has settled."""
    last, memory = state.contact, state.memory
    force: Floats = last.force
    open_cases = np.ones(len(w), dtype=bool)
    for _ in range(PASSES):
        before = tip
        trial, memory = law.trial(memory, last, -before - w)
        force = np.asarray(np.where(open_cases, trial, force))
        moved = drift + step.weight * (base + step.gain * (carried + step.theta * force))
        open_cases &= ~(np.abs(moved - before) < TOLERANCE * np.abs(moved))
        tip = moved
        if not open_cases.any():
            break
    return force, memory, np.where(open_cases, 0, 1)
