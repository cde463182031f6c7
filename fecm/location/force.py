"""What of a fitted force the strains determine, and its contact."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fecm._typing import Bools, Floats

if TYPE_CHECKING:
    from fecm.location.fit import Errors

UNCERTAIN = 5.0  # standard deviation of a force that is not determined, over the usual one
USUAL = 25.0  # percentile of the standard deviations that is the usual one
FEWEST = 3  # hats whose impulse shows the end of the contact
REST = 1.0 / 3.0  # time without an impulse after the contact, over the time of the contact
CLEAR = 3.0  # standard deviations of a force or an impulse that is not 0
ONSET = 0.1  # share of the peak that a force passes at its beginning
DRAWS = 2000  # of the bias of a peak


def is_determined(error: Floats) -> Bools:
    """Whether a force is determined at the peaks of hats, by its standard errors there.

    A force shortly before the end of the record has hardly reached a gage: its standard error is
    far above those of the others.
    """
    return np.asarray(error <= UNCERTAIN * float(np.percentile(error, USUAL)))


class Force(NamedTuple):
    """A fitted force as far as it is determined."""

    determined: Bools  # (hats,)
    sd: Floats  # (hats,)
    determined_until: float
    peak: float
    peak_sd: float
    peak_bias: float  # how much the largest of noisy values is too high on average
    time_of_peak: float
    end: float | None  # of the contact
    impulse: float
    impulse_sd: float


def judged_force(time: Floats, force: Floats, errors: Errors, basis: float) -> Force:
    """Judge a force and its errors at the peaks of hats.

    What is determined, and the end of the contact, follow from the noise; the standard deviations
    include the change of the force with the strains of another model.
    """
    error, covariance, change = errors.force, errors.covariance, errors.force_change
    sd = np.hypot(error, change)
    determined = is_determined(error)
    known = np.where(determined, force, 0.0)
    both = covariance * np.outer(determined, determined)
    top = int(known.argmax())
    last = int(np.flatnonzero(determined)[-1])
    end = _end(known[: last + 1], both, top)
    variance = float(both[:end, :end].sum()) + float((change * determined)[:end].sum()) ** 2
    return Force(
        determined=determined,
        sd=sd,
        determined_until=float(time[last]),
        peak=float(known[top]),
        peak_sd=float(sd[top]),
        peak_bias=_bias(known, both),
        time_of_peak=float(time[top]),
        end=None if end is None else float(time[end]),
        impulse=basis * float(known[:end].sum()),
        impulse_sd=basis * math.sqrt(max(0.0, variance)),
    )


def _end(force: Floats, covariance: Floats, top: int) -> int | None:
    """First hat after which the force has no impulse beyond its noise; None if there is none.

    The force may be small for long, and each of its values below its noise.  Their sums show it:
    that of no number of hats that follow, for a third of the time of the contact, may be beyond
    its standard error.
    """
    first = int(np.argmax(force > ONSET * force[top]))
    for hat in range(top + 1, len(force)):
        length = max(FEWEST, math.ceil(REST * (hat - first)))
        if hat + length > len(force):
            return None
        window = slice(hat, hat + length)
        sums = np.cumsum(force[window])
        # Variances of the sums of the first 1, 2, ... hats.
        variances = np.diagonal(covariance[window, window].cumsum(axis=0).cumsum(axis=1))
        if (sums <= CLEAR * np.sqrt(np.maximum(variances, 0.0))).all():
            return hat
    return None


def _bias(force: Floats, covariance: Floats) -> float:
    """Mean difference of the largest of forces with errors from the largest without."""
    squares, axes = np.linalg.eigh(covariance)
    root = axes * np.sqrt(np.maximum(squares, 0.0))
    draws = np.random.default_rng(0).normal(size=(DRAWS, len(force))) @ root.T
    return max(0.0, float((force + draws).max(axis=1).mean() - force.max()))
