"""Cases of a nonlinear plate in a few modes, all together: the model ``reduced``.

The theory is that of :mod:`~fecm.mechanics.reduced_plate`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from fecm._typing import Floats
from fecm.mechanics.contact_law import ContactPoint
from fecm.mechanics.impact import ContactState, couple_step
from fecm.mechanics.projectile import Rod
from fecm.mechanics.reduced_motion import ReducedMotion, SeriesLaw
from fecm.mechanics.reduced_plate import ReducedPlate, ReductionError, reduced_plate
from fecm.problem.problem import Problem
from fecm.results.metrics import Indentation
from fecm.sweeps.case import CasesError
from fecm.sweeps.convolution import BLOCK, Convolution
from fecm.sweeps.find import Strikes
from fecm.sweeps.responses import (
    DeflectionRecord,
    Hits,
    Impacts,
    TipState,
    TipSteps,
    Work,
    balance_errors,
)
from fecm.sweeps.strike import Strike
from fecm.sweeps.timing import duration_of

# Time step times the angular frequency of the fastest bending mode and of the contact on the plate,
# and of the projectile on the contact.
PLATE_PHASE = 0.5
PROJECTILE_PHASE = 0.2
# A contact that is still stiffer is left to the balance of energy.
MOST_HALVINGS = 10


@dataclass(frozen=True)
class ReducedImpacts:
    """Impacts on a reduced plate with one time step."""

    plate: ReducedPlate
    dt: float
    steps: int

    @property
    def strains(self) -> dict[str, Floats]:
        """Responses of strain gages, which this model does not have."""
        return {}

    def halved(self, times: int) -> ReducedImpacts:
        """The same with a time step that is halved so many times."""
        return replace(self, dt=self.dt / 2**times, steps=self.steps * 2**times)

    def impacts(self, hits: Hits) -> Impacts:
        """Compute impacts step by step, all cases together."""
        cases = len(hits.speed)
        flexibility, none = self.plate.flexibility, np.zeros(cases)
        law = SeriesLaw(hits.law, flexibility)
        motion = ReducedMotion(self.plate, self.dt, cases)
        tips = TipSteps(hits, self.dt, self.steps)
        sums = Convolution(tips.responses[None], hits.kind)
        state = ContactState(
            rod=TipState(none, -hits.speed, none),
            memory=law.start(),
            contact=ContactPoint(none, none),
            plate_w=none,
            contact_work=np.zeros(cases),  # summed in place
            unconverged_steps=np.zeros(cases, dtype=np.int64),
        )
        force, deepest, w, work = np.empty((self.steps, cases)), none, none, none
        record = DeflectionRecord(tips)
        done: list[Floats] = []
        for step in range(self.steps):
            moved = motion.advance(state.contact.force)
            (tips.sums,) = sums.next()
            couple_step(tips, law, state, moved)
            sums.give(state.contact.force)
            last, before = force[step - 1] if step else none, w
            force[step] = state.contact.force
            w = moved + flexibility * state.contact.force
            work = work + 0.5 * (last + force[step]) * (w - before)
            deepest = np.maximum(deepest, law.of_law(state.contact).indentation)
            record.add(w, work)
            if not (step + 1) % BLOCK or step + 1 == self.steps:
                done.append(state.contact_work + motion.energy(state.contact.force))
        permanent = law.permanent(state.memory, state.contact)
        last = law.of_law(state.contact).indentation
        return Impacts(
            force=force,
            indentation=Indentation(deepest, last, permanent),
            unconverged_steps=state.unconverged_steps,
            plate=record.deflection,
            error=balance_errors(force, Work(np.array(done), none), tips),
        )


def reduced(checked: Problem, modes: int) -> ReducedImpacts:
    """Reduce the plate of a problem to bending modes; CasesError if that is not possible."""
    assert checked.contact is not None  # the program has impact steps
    try:
        plate = reduced_plate(checked.plate, checked.contact, modes, checked.damping)
    except ReductionError as error:
        raise CasesError(str(error)) from None
    duration = duration_of(checked)
    steps = math.ceil(duration * plate.fastest / PLATE_PHASE)
    return ReducedImpacts(plate, duration / steps, steps)


def by_halvings(made: ReducedImpacts, strikes: Strikes) -> Mapping[int, Strikes]:
    """Strikes by how often their time step is halved, so that it resolves the contact."""
    groups: dict[int, dict[int, Strike]] = {}
    for number, strike in strikes.items():
        largest = max(largest_time_step(made.plate, strike), made.dt / 2**MOST_HALVINGS)
        times = max(0, math.ceil(math.log2(made.dt / largest)))
        groups.setdefault(times, {})[number] = strike
    return groups


def largest_time_step(plate: ReducedPlate, strike: Strike) -> float:
    """Largest time step that resolves the contact of a strike; infinite at velocity 0.

    The contact is at most as stiff as at the force that all of the energy would give, in loading or
    unloading, and in series with the modes left out.
    """
    law, energy = strike.law, strike.energy
    force = (2.5 * energy * law.k ** (2.0 / 3.0)) ** 0.6  # of (2/5) F^(5/3)/k^(2/3)
    indentation = (force / law.k) ** (2.0 / 3.0)
    if not indentation > 0.0:
        return math.inf
    width = indentation - float(law.permanent(indentation))
    compliance = min(indentation / 1.5, width / law.q) / force + plate.flexibility
    mobility = float((plate.deflection**2).sum())
    found = min(
        PLATE_PHASE * math.sqrt(compliance / mobility),
        PROJECTILE_PHASE * math.sqrt(compliance * strike.projectile.total_mass),
    )
    if isinstance(rod := strike.projectile, Rod):
        found = min(found, rod.element_length * math.sqrt(rod.density / rod.modulus))
    return found
