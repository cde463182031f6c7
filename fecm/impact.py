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
from fecm.dynamics import DivergenceError, PlateMotion, PlateState, PointForce, Sums
from fecm.indentation import Law, Memory, Point
from fecm.projectile import CollocationStep, Projectile, RodState, WilsonStep, rigid_approach

Floats = NDArray[np.float64]

# The contact iteration of the listing; its length is part of the numbers.
PASSES = 5
TOLERANCE = 1.0e-6


@dataclass(slots=True)
class ImpactState:
    """Everything that one step hands to the next.

    Attributes
    ----------
    plate : PlateState
        The plate, with the number of steps and their time.
    rod : RodState
        The projectile.
    memory : Memory
        The indentation law.
    contact : Point
        Accepted indentation and contact force.
    plate_w : float
        The plate's displacement that the law sees.
    contact_work : float
        Work stored in or lost to the indentation.
    unsettled : int
        Steps whose contact iteration did not settle.
    """

    plate: PlateState
    rod: RodState
    memory: Memory
    contact: Point
    plate_w: float = 0.0
    contact_work: float = 0.0
    unsettled: int = 0

    def to_arrays(self) -> dict[str, Floats]:
        """Store the state as plain arrays, from which :meth:`from_arrays` makes it again."""
        plate = self.plate
        scalars = [
            plate.step, plate.time, plate.dt, plate.area, plate.external_work, self.rod.tip,
            self.contact.indentation, self.contact.force, self.plate_w, self.contact_work,
            self.unsettled,
        ]  # fmt: skip
        memory = [getattr(self.memory, f.name) for f in dataclasses.fields(Memory)]
        return {
            "scalars": np.array(scalars, dtype=float),
            "sums": np.array(plate.sums),
            "memory": np.array(memory, dtype=float),
            "extended": plate.extended.copy(),
            "increment": plate.increment.copy(),
            "pull": plate.pull.copy(),
            "rod": self.rod.motion.copy(),
        }

    @classmethod
    def from_arrays(cls, arrays: dict[str, Floats]) -> ImpactState:
        """Make the state again that :meth:`to_arrays` stored."""
        step, time, dt, area, external, tip, a, force, w, work, unsettled = arrays[
            "scalars"
        ].tolist()
        branch, *curve = arrays["memory"].tolist()
        plate = PlateState(
            arrays["extended"].copy(),
            arrays["increment"].copy(),
            arrays["pull"].copy(),
            int(step),
            time,
            dt,
            area,
            external,
            Sums(*arrays["sums"].tolist()),
        )
        return cls(
            plate,
            RodState(arrays["rod"].copy(), tip),
            Memory(int(branch), *curve),
            Point(a, force),
            w,
            work,
            int(unsettled),
        )


@dataclass(frozen=True)
class Contact:
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
    """

    row: int
    velocity: float
    plate_moves: bool = True
    strains_start_moving: bool = False
    keeps_first_step: bool = False


class Impact:
    """Steps a plate and a projectile through time.

    Parameters
    ----------
    motion : PlateMotion
    rod : Rod or RigidMass
    law : Law
    contact : Contact
    integrator : type of CollocationStep
        The rod's.
    """

    def __init__(
        self,
        motion: PlateMotion,
        rod: Projectile,
        law: Law,
        contact: Contact,
        integrator: type[CollocationStep] = WilsonStep,
    ) -> None:
        self.motion = motion
        self.rod = rod
        self.law = law
        self.contact = contact
        self.rod_stiffness = rod.stiffness()
        self.rod_mass = rod.mass()
        self._integrator = integrator
        self._step: CollocationStep | None = None
        self._first_dt: float | None = None

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
        return ImpactState(state, rod, self.law.start(), Point(0.0, 0.0))

    def point_force(self, state: ImpactState) -> PointForce:
        """The contact force on the plate."""
        return PointForce(self.contact.row, state.contact.force)

    def advance(self, state: ImpactState, dt: float, factor: float = 1.0) -> None:
        """Take one step.

        Parameters
        ----------
        state : ImpactState
            Changed in place.
        dt : float
            Time step.
        factor : float
            Load factor of FORC's values.

        Raises
        ------
        DivergenceError
            If a number is no longer finite.
        """
        self.motion.advance(state.plate, dt, factor, self.point_force(state))
        step = state.plate.step
        try:
            self.move_projectile(state, dt)
        except OverflowError:
            raise DivergenceError(step, "the contact force is beyond all bounds") from None
        if not math.isfinite(state.contact.indentation + state.contact.force):
            raise DivergenceError(step, "the motion is no longer finite")

    def _rod_step(self, dt: float) -> CollocationStep:
        """Give the rod's linear map for a time step."""
        if self._step is None or self._step.dt != dt:
            if not self.contact.keeps_first_step or self._first_dt is None:
                self._first_dt = dt
            self._step = self._integrator(self.rod_stiffness, self.rod_mass, dt, self._first_dt)
        return self._step

    def move_projectile(self, state: ImpactState, dt: float) -> None:
        """Iterate force and tip acceleration, then move the whole rod with what came out."""
        law, last, memory = self.law, state.contact, state.memory
        step = self._rod_step(dt)
        w = state.plate.extended.item(self.contact.row) if self.contact.plate_moves else 0.0
        motion = step.free_motion(state.rod)
        base, gain, theta = motion.item(2 * step.n), step.gain, step.theta
        _, v, acceleration = state.rod.motion[:, 0].tolist()
        begin, weight = step.weights
        drift = state.rod.tip + dt * v + begin * acceleration
        carried = (1.0 - theta) * last.force
        tip, force = drift + weight * acceleration, last.force
        for _ in range(PASSES):
            before = tip
            force, memory = law.trial(memory, last, -before - w)
            acceleration = base + gain * (carried + theta * force)
            tip = drift + weight * acceleration
            if abs(tip - before) < TOLERANCE * abs(tip):
                break
        else:
            state.unsettled += 1
        motion += step.h * (carried + theta * force)
        state.rod = rod = RodState(motion.reshape(3, step.n), state.rod.tip + motion.item(0))
        indentation = -rod.tip - w
        state.memory = law.accept(memory, last, indentation)
        state.contact = Point(indentation, force)
        state.plate_w = w
        state.contact_work += (last.force + force) / 2.0 * (indentation - last.indentation)
