"""State of the contact at the end of a run, and which of its values can still change.

The functions take many cases at once: arrays (cases,).
"""

from __future__ import annotations

from enum import StrEnum
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from fecm._typing import Bools, Floats

Texts = NDArray[np.str_]

# The peak of a contact has passed if the force falls, is below FALLEN of the largest force of this
# contact, and the projectile leaves clearly.  The force of a drop weight rings: it falls and rises
# again many times before the projectile turns.
FALLEN = 0.9
# A projectile leaves clearly if its velocity is above CLEAR of the largest velocity that the plate
# had under the load.  In 300 random impacts, each cut at 40 times, no plate reached such a
# projectile again; projectiles that were reached again left at 0.04 to 0.24 of this velocity.
CLEAR = 0.3
# Factor on the largest compliance w^2/(2 E) seen in a run, as the static one may be larger.
RESERVE = 1.5
LEAST_WORK = 1.0e-3  # energy of the plate over the initial energy for which w^2/(2 E) is used
LATE = 0.8  # share of the run; a largest value that comes later may still grow
RINGING = 1.01  # least ratio of a new largest deflection to the largest so far


class End(StrEnum):
    """State of the contact at the end of a run."""

    OVER = "contact over"
    AGAIN = "may touch again"  # no contact, and the projectile leaves slowly
    PASSED = "in contact, peak passed"
    RISING = "in contact, peak not reached"
    BETWEEN = "between contacts"  # no contact, but the projectile still approaches the plate


# States that leave the peak force open.
OPEN_PEAKS = (End.AGAIN, End.RISING, End.BETWEEN)
OPEN_LATER = "the end of the contact, the permanent indentation and the energies after it"
LOWER_BOUND = f"its largest force is a lower bound of the peak force, and {OPEN_LATER} are open"
# Notes of runs whose end leaves something open.
OPEN_ENDS = {
    End.PASSED: (
        f"the run ends in contact, after the peak force: {OPEN_LATER} are open; take more steps"
    ),
    End.RISING: (
        f"the run ends in contact, before the projectile leaves: {LOWER_BOUND}; take more steps"
    ),
    End.BETWEEN: (
        "the run ends between two contacts, as the projectile still approaches: "
        f"{LOWER_BOUND}; take more steps"
    ),
    End.AGAIN: (
        "the run ends without contact, but the projectile leaves so slowly that the plate may "
        f"touch it again: {LOWER_BOUND}"
    ),
}


class LastContact(NamedTuple):
    """Contact and projectile at the end of cases, (cases,) each."""

    force: Floats
    before: Floats  # contact force one step earlier
    peak: Floats  # largest force of the case
    contact_peak: Floats  # largest force of the present contact
    # Velocity of the projectile away from the plate, relative to the rigid motion of a plate that
    # is not held; NaN if it is not known.
    leaving: Floats
    position: Floats  # displacement of the projectile's centre from its start, along the push


class Deflection(NamedTuple):
    """Displacement of the plate under the load, (cases,) each."""

    largest: Floats  # displacement, length
    last: Floats
    speed: Floats  # largest velocity of either sign
    energy: Floats  # kinetic and strain energy at the end
    # Largest w |w|/(2 E): under a static load the ratio is the flexibility of a plate that its
    # supports hold, and under no load it is larger.
    compliance: Floats
    # Displacement when the impact started, and where the plate rests under its load: both are 0
    # without a static load.
    start: Floats | float = 0.0
    rest: Floats | float = 0.0

    @classmethod
    def of(
        cls,
        w: Floats,
        times: Floats,
        energy: Floats,
        initial: float,
        *,
        start: float = 0.0,
        rest: float = 0.0,
    ) -> Self:
        """Summarise the history of one case.

        Parameters
        ----------
        w, times, energy : ndarray (steps,)
            Displacement under the load, time, and energy of the plate after each step. The energy
            is that above the rest.
        initial : float
            Energy of the projectile before the impact.
        start, rest : float
            Displacement before the first step, and at rest under the load.
        """
        row = int(w.argmax())
        dw, dt = np.diff(w, prepend=start), np.diff(times, prepend=0.0)
        moved = w - rest
        ratio = moved * np.abs(moved) / (2.0 * np.maximum(energy, LEAST_WORK * initial))
        return cls(
            w[[row]],
            w[-1:],
            np.abs(dw / dt).max(keepdims=True),
            energy[-1:],
            np.nanmax(ratio, keepdims=True, initial=0.0),
            start,
            rest,
        )

    @property
    def reach(self) -> Floats:
        """Return the largest displacement from its rest that the energy of the plate can cause.

        A plate that is held by its supports and has the energy E deflects by at most sqrt(2 C E),
        where C is its static flexibility.
        """
        return np.sqrt(2.0 * RESERVE * self.compliance * np.maximum(self.energy, 0.0))


def ends(last: LastContact, plate: Deflection, *, is_held: bool = True) -> Texts:
    """Return the state of every case at its end, as :class:`End`.

    A plate that is not held may follow the projectile anywhere. Only a projectile that clearly
    leaves it ends the contact.

    Examples
    --------
    >>> ones = np.ones(2)
    >>> last = LastContact(np.array([0.0, 5.0]), 6.0 * ones, 9.0 * ones, 9.0 * ones, ones, -ones)
    >>> ends(last, Deflection(ones, ones, ones, ones, 0.0 * ones, ones)).tolist()
    ['contact over', 'in contact, peak passed']
    """
    touching = last.force > 0.0
    is_slow = last.leaving <= CLEAR * plate.speed  # False where the velocity is not known
    is_clear = last.leaving > CLEAR * plate.speed
    is_falling = last.force < np.minimum(last.before, FALLEN * last.contact_peak)
    passed = touching & is_clear & is_falling & (last.force < FALLEN * last.peak)
    is_near = ~(_from_rest(last, plate) < -plate.reach) if is_held else np.ones_like(touching)
    states = {
        End.PASSED: passed,
        End.RISING: touching,
        End.BETWEEN: last.leaving < 0.0,
        End.AGAIN: is_slow & is_near,
    }
    return np.select(list(states.values()), list(states), End.OVER).astype(np.str_)


def time_to_decide(last: LastContact, plate: Deflection) -> Floats:
    """Return the time until the plate can't reach the projectile any more.

    Only cases that may touch again need it.
    """
    return np.maximum(_from_rest(last, plate) + plate.reach, 0.0) / last.leaving


def _from_rest(last: LastContact, plate: Deflection) -> Floats:
    """Return the position of the projectile relative to the plate at rest."""
    return last.position + (plate.start - plate.rest)


def over(end: Texts) -> Bools:
    """Return a mask of the cases whose contact is over."""
    return np.asarray(end == End.OVER)


def peak_known(end: Texts) -> Bools:
    """Return a mask of the cases whose largest force so far is the peak force."""
    return np.isin(end, (End.OVER, End.PASSED))


def decided(largest: Floats, last: Floats, end: Texts) -> Floats:
    """Return the largest values of a quantity, NaN where the end has not decided them.

    While the projectile leaves, the largest value is the peak of a quantity that has fallen. Waves
    that continue after the contact may exceed strains and exposures: a run notes a largest value
    near its end.
    """
    fallen = peak_known(end) & (last < largest)
    return np.where(over(end) | fallen, largest, np.nan)


def settled_deflection(end: Texts, plate: Deflection, *, is_held: bool = True) -> Floats:
    """Return the largest deflection under the load, NaN where the plate can still exceed it.

    The plate continues to vibrate after the contact. Of 300 random plates without damping, two
    thirds of those that had the energy to exceed their largest deflection later did so. The
    displacement of a plate that is not held by its supports only says that the plate moves.
    """
    is_bounded = plate.reach <= RINGING * (plate.largest - plate.rest)
    return np.where(over(end) & (is_bounded | (not is_held)), plate.largest, np.nan)
