"""State of the contact at the end of a run, which of its values can still change, and its words.

The functions take many cases at once: arrays (cases,).
"""

from __future__ import annotations

from enum import StrEnum
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from fecm._typing import Bools, Floats
from fecm.judge.limits import Doubt, TrustLevel

Texts = NDArray[np.str_]

# The largest force so far is the peak force if the projectile leaves clearly and, in contact, the
# force is below FALLEN of the largest force of this contact and of the run.  The force of a drop
# weight rings: it falls and rises again many times before the projectile turns.
FALLEN = 0.9
# A projectile leaves clearly if its velocity is above (CLEAR + PRESSED F/F_peak) times the largest
# velocity that the plate had under the load, where F is the present force.  A plate that nothing
# holds bends back as a whole, so that it needs CLEAR_FREE.
CLEAR, CLEAR_FREE, PRESSED = 0.35, 0.45, 0.4
# A projectile whose mass is below LIGHT of the plate's leaves clearly at any velocity: it has given
# its momentum away, and a plate that returns it hits it more softly.
LIGHT = 0.1
# A projectile is gone if it is out of reach of the plate, or leaves faster than GONE of the largest
# velocity that the plate had.  Of 586 random impacts, a third on free plates and a third with NONL,
# each cut at 400 times, no peak force that was called known grew by 1 %.
GONE = 0.9
# Factor on the largest compliance w^2/(2 E) seen in a run, as the static one may be larger.
RESERVE = 1.5
LEAST_WORK = 1.0e-3  # energy of the plate over the initial energy for which w^2/(2 E) is used
RINGING = 1.01  # least ratio of a new largest deflection to the largest so far


class End(StrEnum):
    """State of the contact at the end of a run."""

    OVER = "contact over"
    APART = "peak passed, may touch again"  # no contact, and the projectile leaves clearly
    AGAIN = "may touch again"  # no contact, and the projectile leaves slowly
    PASSED = "in contact, peak passed"
    RISING = "in contact, peak not reached"
    BETWEEN = "between contacts"  # no contact, but the projectile still approaches the plate


class EndMeaning(NamedTuple):
    """What an end means for the numbers of a run.

    Attributes
    ----------
    level : TrustLevel
        Trust in the numbers.
    where : str
        Where the run ends, in a note.
    what_is_open : str
        What the end leaves open.
    remedy : str
        What to do about it.
    brief : str
        Where the run ends, beside a number that it leaves open.
    doubt : Doubt, optional
        What is said of cases; None where the peak is known.
    """

    level: TrustLevel
    where: str = ""
    what_is_open: str = ""
    remedy: str = ""
    brief: str = ""
    doubt: Doubt | None = None

    @property
    def words(self) -> str:
        """What is open, and what to do about it."""
        return "; ".join(filter(None, [self.what_is_open, self.remedy]))

    @property
    def reason(self) -> str:
        """Reason to doubt a case; empty where the peak is known."""
        return "" if self.doubt is None else self.doubt.reason

    def note(self, remedy: str = "") -> str:
        """Return the note of a run, by default with the remedy of the row."""
        return f"the run ends {self.where}: {self.what_is_open}; {remedy or self.remedy}"


OPEN_LATER = "the end of the contact, the permanent indentation and the energies after it"
LATER_IS_OPEN = f"{OPEN_LATER} are open"
LOWER_BOUND = f"its largest force is a lower bound of the peak force, and {LATER_IS_OPEN}"
GO_ON = "take more steps, or run it with --extend"
DECIDING_STEPS = "about {steps} more steps decide it (--extend)"  # instead, if they are known
PEAK_NOT_REACHED = Doubt("peak not reached", "with an open peak", TrustLevel.OUTSIDE)
MAY_TOUCH = Doubt(
    "may touch again", "in which the plate may touch again (open peak)", TrustLevel.OUTSIDE
)
ENDS = {
    End.OVER: EndMeaning(TrustLevel.WITHIN),
    End.APART: EndMeaning(
        TrustLevel.DOUBTFUL,
        "without contact, after the peak force, but the plate may touch the projectile again",
        LATER_IS_OPEN,
        GO_ON,
    ),
    End.PASSED: EndMeaning(
        TrustLevel.DOUBTFUL, "in contact, after the peak force", LATER_IS_OPEN, GO_ON, "in contact"
    ),
    End.RISING: EndMeaning(
        TrustLevel.OUTSIDE,
        "in contact, before the projectile leaves",
        LOWER_BOUND,
        GO_ON,
        "in contact",
        PEAK_NOT_REACHED,
    ),
    End.BETWEEN: EndMeaning(
        TrustLevel.OUTSIDE,
        "between two contacts, as the projectile still approaches",
        LOWER_BOUND,
        GO_ON,
        "between two contacts",
        PEAK_NOT_REACHED,
    ),
    End.AGAIN: EndMeaning(
        TrustLevel.OUTSIDE,
        "without contact, but the projectile leaves so slowly that the plate may touch it again",
        LOWER_BOUND,
        GO_ON,
        "before the plate is out of reach of the projectile",
        MAY_TOUCH,
    ),
}
# States that leave the peak force open.
OPEN_PEAKS = tuple(end for end, meaning in ENDS.items() if meaning.doubt is not None)


class LastContact(NamedTuple):
    """Contact and projectile at the end of cases, (cases,) each."""

    force: Floats
    peak: Floats  # largest force of the case
    contact_peak: Floats  # largest force of the present contact
    # Velocity of the projectile away from the plate, relative to the rigid motion of a plate that
    # is not held; NaN if it is not known.
    leaving: Floats
    # Displacement of the projectile's centre from its start, positive along the push, relative to
    # that motion.
    position: Floats
    ratio: Floats  # mass of the projectile over the plate's; NaN if it is not known


class RigidMotion(NamedTuple):
    """Rigid motion under the load of a plate that its supports do not hold, (steps, ...) each."""

    displacement: Floats
    energy: Floats

    @classmethod
    def of(cls, force: Floats, times: Floats, mobility: float) -> Self:
        """Compute the motion from contact forces, (steps, ...), and times, (steps,).

        `mobility` (1/mass) is the velocity under the load per impulse. An impulse J gives the
        energy mobility J^2/2.
        """
        dt = np.diff(times, prepend=0.0).reshape(-1, *(1,) * (force.ndim - 1))
        before = np.concatenate([np.zeros_like(force[:1]), force[:-1]])
        impulse = np.add.accumulate(0.5 * dt * (before + force))
        earlier = np.concatenate([np.zeros_like(force[:1]), impulse[:-1]])
        moved = np.add.accumulate(dt * (earlier + 0.5 * dt * before))
        return cls(mobility * moved, 0.5 * mobility * impulse**2)


class Deflection(NamedTuple):
    """Displacement of the plate under the load, (cases,) each.

    Speed, energy and compliance are without the rigid motion of a plate that is not held.
    """

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
        initial: Floats | float,
        rigid: RigidMotion | None = None,
        *,
        start: float = 0.0,
        rest: float = 0.0,
    ) -> Self:
        """Summarise histories.

        Parameters
        ----------
        w, energy : ndarray (steps, cases)
            Displacement under the load, and energy of the plate after each step. The energy is
            that above the rest.
        times : ndarray (steps,)
        initial : ndarray (cases,) or float
            Energy of the projectile before the impact.
        rigid : RigidMotion, optional
            Rigid motion of a plate that is not held.
        start, rest : float
            Displacement before the first step, and at rest under the load.
        """
        bent = w if rigid is None else w - rigid.displacement
        kept = energy if rigid is None else energy - rigid.energy
        speed = np.diff(bent, axis=0, prepend=start) / np.diff(times, prepend=0.0)[:, None]
        moved = bent - rest
        ratio = moved * np.abs(moved) / (2.0 * np.maximum(kept, LEAST_WORK * initial))
        return cls(
            w.max(axis=0),
            w[-1],
            np.abs(speed).max(axis=0),
            kept[-1],
            np.nanmax(ratio, axis=0, initial=0.0),
            start,
            rest,
        )

    @property
    def reach(self) -> Floats:
        """Return the largest displacement from its rest that the energy of the plate can cause.

        A plate that is held by its supports and has the energy E deflects by at most sqrt(2 C E),
        where C is its static flexibility. A plate that is not held does so about its rigid motion.
        """
        return np.sqrt(2.0 * RESERVE * self.compliance * np.maximum(self.energy, 0.0))


def ends(last: LastContact, plate: Deflection, *, is_held: bool = True) -> Texts:
    """Return the state of every case at its end, as :class:`End`.

    Examples
    --------
    >>> ones = np.ones(2)
    >>> last = LastContact(np.array([0.0, 5.0]), 9 * ones, 9 * ones, ones, -2 * ones, ones)
    >>> ends(last, Deflection(ones, ones, ones, ones, ones)).tolist()
    ['contact over', 'in contact, peak passed']
    """
    touching = last.force > 0.0
    share = np.divide(last.force, last.peak, out=np.zeros_like(last.force), where=touching)
    clear = (CLEAR if is_held else CLEAR_FREE) + PRESSED * share
    is_clear = (last.leaving > clear * plate.speed) | ((last.leaving > 0.0) & (last.ratio < LIGHT))
    has_fallen = last.force < FALLEN * np.minimum(last.contact_peak, last.peak)
    # All False where the velocity is not known.
    is_near = (last.leaving <= GONE * plate.speed) & ~(_from_rest(last, plate) < -plate.reach)
    states = {
        End.PASSED: touching & is_clear & has_fallen,
        End.RISING: touching,
        End.BETWEEN: last.leaving < 0.0,
        End.APART: is_near & is_clear,
        End.AGAIN: is_near,
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
    return np.isin(end, OPEN_PEAKS, invert=True)


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
