"""Delamination threshold: from which force it holds, and whether a run reaches it, in words."""

from __future__ import annotations

import numpy as np

from fecm.judge.end import ENDS, OPEN_PEAKS, End

# Start of a threshold of one delamination: more delaminations, and bending cracks, come before.
AT_THE_LATEST = "at the latest from"


def from_threshold(delaminations: object) -> str:
    """Return the words before the threshold force, or energy, of a number of delaminations.

    The number comes from a file and may be damaged.
    """
    return AT_THE_LATEST if np.array_equal(np.asarray(delaminations), 1) else "from"


def threshold_outcome(reached: str, end: End | None, margin: float) -> str:
    """Say whether a run reaches the threshold.

    Parameters
    ----------
    reached : str
        When it does, in words; empty if it does not.
    end : End or None
        State of the contact at the end of the run.
    margin : float
        1 less the peak over the threshold.

    Examples
    --------
    >>> threshold_outcome("", End.OVER, 0.26)
    'not reached: the peak is 26.0% below'
    >>> threshold_outcome("", End.RISING, 0.26)
    'not reached by the end of the run, which is in contact: open'
    """
    if reached:
        return f"reached {reached}"
    if end in OPEN_PEAKS:
        return f"not reached by the end of the run, which is {ENDS[end].brief}: open"
    return f"not reached: the peak is {margin:.1%} below"
