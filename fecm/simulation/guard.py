"""Checks of a run: divergence, the energy balance, and the likely cause."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fecm._typing import Floats
from fecm.mechanics.plate import UnsoundPlateError
from fecm.mechanics.plate_motion import DivergenceError
from fecm.mechanics.time_step import critical_time_step
from fecm.problem.build import ImpactModel
from fecm.problem.check_plausibility import contact_step
from fecm.problem.problem import Problem

# Error of the energy balance, relative to the supplied energy, that triggers a warning.
ENERGY_WARNING = 0.01


@dataclass
class EnergyBalance:
    """The energy balance of a run so far."""

    # Largest and last work of the nodal forces, and its largest change in a step (force*length).
    largest_work: float = 0.0
    last_work: float = 0.0
    largest_jump: float = 0.0
    worst_error: float = 0.0  # largest error, relative to the supplied energy
    worst_step: int = 0  # its step

    def add(
        self, block: Mapping[str, Floats], initial: float, *, limit: float | None = None
    ) -> None:
        """Add a block of steps; end the run if it diverges or exceeds the limit.

        The error is relative to the energy supplied up to the end of the block: in its first steps
        a load has done almost no work.  The work of one step is not counted as an error: the work
        belongs to the step, the energies to its end.  `initial` is the energy before the first
        step.  Without a limit only an energy that is not finite ends the run.  Raises
        DivergenceError if the energy is not finite, or the error exceeds the limit.
        """
        lost = ~np.isfinite(block["held_energy"])
        if lost.any():
            step = int(block["step"][np.flatnonzero(lost)[0]])
            raise DivergenceError(step, "the motion is no longer finite")
        work = block["external_work"]
        self.largest_work = max(self.largest_work, float(np.abs(work).max()))
        jump = float(np.abs(np.diff(work, prepend=self.last_work)).max())
        self.largest_jump, self.last_work = max(self.largest_jump, jump), float(work[-1])
        supplied = initial + self.largest_work
        if not supplied > 0.0:
            return
        error = np.maximum(np.abs(block["balance_error"]) - self.largest_jump, 0.0) / supplied
        row = int(error.argmax())
        if error[row] > self.worst_error:
            self.worst_error, self.worst_step = float(error[row]), int(block["step"][row])
        if limit is not None and error[row] > limit:
            row = int(np.flatnonzero(error > limit)[0])
            raise DivergenceError(
                int(block["step"][row]),
                f"the energy balance is off by {error[row]:.2%} of the supplied energy, more than "
                f"the limit of {limit:.3g}",
            )


def likely_cause(problem: Problem, model: ImpactModel, dt: float) -> str:
    """Explain a divergence, as far as the time step does."""
    try:
        plate = model.motion.plate
        critical = critical_time_step(plate)
        contact = contact_step(problem, plate, dt, critical)
    except UnsoundPlateError as error:
        return str(error)
    above = dt > critical
    cause = (
        f"DT = {dt:.4g} is {'above' if above else 'below'} the plate's critical time step "
        f"{critical:.4g}"
    )
    if above:
        return cause
    if contact is not None and dt >= contact.limit:
        return (
            f"{cause}, but not below {contact.limit:.4g}, the stable step with the contact's "
            f"stiffness k_t of about {contact.stiffness:.3g} (the contact needs DT < "
            f"2 (m/k_t)^(1/2), m = {contact.mass:.3g})"
        )
    if len({macro.value for macro in problem.deck.macros if macro.word == "DT"}) > 1:
        return f"{cause}, but DT changes: steps that alternate diverge below the critical one"
    return cause
