"""State of the contact at the end of a run, and what it has decided.

The functions take many cases at once: arrays (cases,).
"""

from __future__ import annotations

from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from fecm._typing import Bools, Floats

Texts = NDArray[np.str_]

# The peak of a contact has passed if the force is below FALLEN of it, and the projectile leaves
# with more than LEAVING of its impact velocity.  The force of a drop weight rings: it falls and
# rises again many times before the projectile turns.
FALLEN = 0.9
LEAVING = 0.1


class End(StrEnum):
    """State of the contact at the end of a run."""

    OVER = "contact over"
    PASSED = "in contact, peak passed"
    RISING = "in contact, peak not reached"
    BETWEEN = "between contacts"  # no contact, but the projectile still approaches the plate


OPEN_LATER = "the end of the contact, the permanent indentation and the energies after it"
# Notes of runs whose end leaves something open.
OPEN_ENDS = {
    End.PASSED: (
        f"the run ends in contact, after the peak force: {OPEN_LATER} are open; take more steps"
    ),
    End.RISING: (
        "the run ends in contact, before the projectile leaves: its largest force is a lower bound "
        f"of the peak force, and {OPEN_LATER} are open; take more steps"
    ),
    End.BETWEEN: (
        "the run ends between two contacts, as the projectile still approaches: its largest force "
        f"is a lower bound of the peak force, and {OPEN_LATER} are open; take more steps"
    ),
}


def ends(last: Floats, peak: Floats, leaving: Floats, velocity: Floats) -> Texts:
    """State of every case at its end, of :class:`End`.

    Parameters
    ----------
    last, peak : ndarray (cases,)
        Last and largest contact force.
    leaving : ndarray (cases,)
        Velocity of the projectile away from the plate at the end, relative to the rigid motion of
        a plate that is not held; NaN if it is not known.
    velocity : ndarray (cases,)
        Impact velocity.

    Examples
    --------
    >>> ends(np.array([0.0, 5.0]), np.array([9.0, 9.0]), np.array([1.0, 1.0]), np.ones(2)).tolist()
    ['contact over', 'in contact, peak passed']
    """
    touching = last > 0.0
    passed = (last < FALLEN * peak) & (leaving > LEAVING * velocity)
    states = {
        End.PASSED: touching & passed,
        End.RISING: touching,
        End.BETWEEN: leaving < 0.0,
    }
    return np.select(list(states.values()), list(states), End.OVER).astype(np.str_)


def over(end: Texts) -> Bools:
    """Cases whose contact is over, so that all their values are decided."""
    return np.asarray(end == End.OVER)


def peak_known(end: Texts) -> Bools:
    """Cases whose largest force so far is the peak force."""
    return np.isin(end, (End.OVER, End.PASSED))


def decided(largest: Floats, last: Floats, end: Texts) -> Floats:
    """Largest values of a quantity, NaN where the end has not decided them.

    While the projectile leaves, the largest value is the peak of a quantity that has fallen.
    """
    fallen = peak_known(end) & (last < largest)
    return np.where(over(end) | fallen, largest, np.nan)
