"""What of a fitted force the strains determine, and its contact."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fecm._typing import Bools, Floats

UNCERTAIN = 5.0  # standard deviation of a force that is not determined, over the usual one
USUAL = 25.0  # percentile of the standard deviations that is the usual one
STAYS = 3  # hats that stay below at the end of the contact
CLEAR = 3.0  # standard deviations of a force that is not 0


def is_determined(error: Floats) -> Bools:
    """Whether a force is determined at the peaks of hats, by its standard errors there.

    A force shortly before the end of the record has hardly reached a gage: its standard error is
    far above those of the others.
    """
    return np.asarray(error <= UNCERTAIN * float(np.percentile(error, USUAL)))


class Force(NamedTuple):
    """A fitted force as far as it is determined."""

    determined: Bools  # (hats,)
    determined_until: float
    peak: float
    time_of_peak: float
    end: float | None  # of the contact
    impulse: float


def judged_force(time: Floats, force: Floats, error: Floats, basis: float) -> Force:
    """Judge a force and its standard errors at the peaks of hats (:func:`is_determined`)."""
    determined = is_determined(error)
    known = np.where(determined, force, 0.0)
    top = int(known.argmax())
    quiet = known < CLEAR * error
    end = None
    for hat in range(top + 1, len(force)):
        after = slice(hat, hat + STAYS)
        if determined[hat] and quiet[after][determined[after]].all():
            end = hat
            break
    return Force(
        determined=determined,
        determined_until=float(time[np.flatnonzero(determined)[-1]]),
        peak=float(known[top]),
        time_of_peak=float(time[top]),
        end=None if end is None else float(time[end]),
        impulse=basis * float(known[:end].sum()),
    )
