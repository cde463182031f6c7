"""State of a run, the monitor of its energies and forces, and causes of divergence."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from fecm._typing import Bools, Floats
from fecm.mechanics.contact_law import Law
from fecm.mechanics.impact import ImpactState
from fecm.mechanics.own_law import law_name
from fecm.mechanics.plate import UnsoundPlateError
from fecm.mechanics.plate_motion import DivergenceError, PlateState
from fecm.mechanics.time_step import critical_time_step
from fecm.problem.build import ImpactModel
from fecm.problem.contact_estimates import contact_step
from fecm.problem.problem import Problem
from fecm.simulation.recorder import Columns

if TYPE_CHECKING:
    from fecm.mechanics.exposures import FailureEnvelope


def cause_of_divergence(
    problem: Problem, model: ImpactModel, dt: float, law: Law | None = None
) -> str:
    """Explain a divergence as far as the time step causes it.

    `law` is the name of the user's law that replaces EXPE.
    """
    plate = model.motion.plate
    try:
        critical = critical_time_step(plate)
        contact = None
        if law is None:
            factor = problem.symmetry.factor
            contact = contact_step(problem.deck, plate, problem.contact, dt, critical, factor)
    except UnsoundPlateError as error:
        return str(error)
    side = "above" if dt > critical else "below"
    cause = f"DT = {dt:.4g} is {side} the plate's critical time step {critical:.4g}"
    if dt > critical:
        return cause
    if contact is not None and dt >= contact.limit:
        return (
            f"{cause}, but not below {contact.limit:.4g}, the stable step with the contact's "
            f"stiffness k_t of about {contact.stiffness:.3g} (the contact needs DT < "
            f"2 (m/k_t)^(1/2), m = {contact.mass:.3g})"
        )
    if len({macro.value for macro in problem.deck.macros if macro.word == "DT"}) > 1:
        return f"{cause}, but DT changes: steps that alternate diverge below the critical one"
    if law is not None:
        return (
            f"{cause}, but it may be too large for the stiffness of the contact law {law_name(law)}"
        )
    return cause


TOLERANCE = 1.0e-9  # relative change of the displacement below which CONV leaves its loop


@dataclass
class Monitor:
    """Monitor of the energy balance and the largest contact force of the steps so far."""

    # Largest and last work of the nodal forces, and its largest change in a step (force*length).
    largest_work: float = 0.0
    last_work: float = 0.0
    largest_jump: float = 0.0
    worst_error: float = 0.0  # largest error, relative to the supplied energy
    worst_step: int = 0  # its step
    peak_force: float = 0.0  # largest contact force
    crossing: float = math.nan  # when it first reached the delamination threshold

    def add(
        self, block: Columns, initial: float, limit: float | None, threshold: float | None
    ) -> None:
        """Add a block of steps; `initial` is the energy before the first step.

        `threshold` is the delamination threshold as a force on the plate of the deck.

        The error is relative to the energy supplied up to the end of the block, as a load has done
        almost no work in its first steps. The work of one step is not counted as an error: the work
        belongs to the step, the energies to its end. A load that only holds the plate where the
        impact started supplies no energy: its work changes the strain energy alone. Raises
        DivergenceError if the energy is not finite, or if the error exceeds its limit.
        """
        lost = ~np.isfinite(block["held_energy"])
        if lost.any():
            step = int(block["step"][np.flatnonzero(lost)[0]])
            raise DivergenceError(step, "the motion is no longer finite")
        if threshold is not None:
            self._add_force(block, threshold)
        self._add_work(block["external_work"], block["is_loaded_at_rest"] > 0.0)
        supplied = initial + self.largest_work
        if not supplied > 0.0:
            return
        error = np.maximum(np.abs(block["balance_error"]) - self.largest_jump, 0.0) / supplied
        row = int(error.argmax())
        if error[row] > self.worst_error:
            self.worst_error = float(error[row])
            self.worst_step = int(block["step"][row])
        if limit is not None and error[row] > limit:
            row = int(np.flatnonzero(error > limit)[0])
            off = f"the energy balance is off by {error[row]:.2%} of the supplied energy"
            reason = f"{off}, more than the limit of {limit:.3g}"
            raise DivergenceError(int(block["step"][row]), reason)

    def _add_force(self, block: Columns, threshold: float) -> None:
        """Add the contact forces of a block."""
        self.peak_force = max(self.peak_force, float(block["force"].max()))
        above = np.flatnonzero(block["force"] >= threshold)
        if len(above) and math.isnan(self.crossing):
            self.crossing = float(block["time"][above[0]])

    def _add_work(self, work: Floats, at_rest: Bools) -> None:
        """Add the work of the nodal forces up to each step of a block; it may not count."""
        counts = ~at_rest
        self.largest_work = max(self.largest_work, float((counts * np.abs(work)).max()))
        jump = counts * np.abs(np.diff(work, prepend=self.last_work))
        self.largest_jump = max(self.largest_jump, float(jump.max()))
        self.last_work = float(work[-1])


@dataclass
class RunState:
    """State passed from one macro to the next; a checkpoint stores every field."""

    plate: PlateState
    impact: ImpactState | None = None  # plate, projectile and contact; shares `plate`
    # The interpreter's position; empty before the first macro.
    position: list[tuple[int, int]] = field(default_factory=list)
    dt: float = 0.0  # time step
    clock: float = 0.0  # time that TIME advances
    load_clock: float = 0.0  # clock at the plate's last central difference
    constant_factor: float = 1.0  # load factor without a table
    table: int | None = None  # index of the current table of proportional loads
    tables_read: int = 0  # tables that PROP has read
    tolerance: float = TOLERANCE  # tolerance of CONV
    consistent_mass: bool = False  # whether CMAS came after LMAS
    factorised: bool = False  # whether TANG was carried out
    converged: bool = False  # whether the last SOLV met the tolerance
    # Load factor under which the nodal forces have held the plate since the impact started; None if
    # they do not hold it, or change.
    rest_factor: float | None = None
    residual: Floats | None = None  # (neq,): load less internal force, formed by FORM
    # (numnp, 5): displacement about which TANG has formed the stiffness of a nonlinear plate
    linearised: Floats | None = None
    equilibrium_factor: float = 0.0  # load factor of the last equilibrium that CONV found
    steps_since_output: int = 0  # impact steps since the last output
    undecided_until: int = 0  # step before which OVER does not look at the end of the impact again
    prop_force: float | None = None  # instead of the contact force
    first_dt: float | None = None  # time step of the rod's constants
    monitor: Monitor = field(default_factory=Monitor)
    failure: FailureEnvelope | None = None  # largest exposures so far, of FAIL
    notes: list[str] = field(default_factory=list)  # remarks for the user
