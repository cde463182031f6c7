"""Largest exposures of FAIL, and how often it was evaluated."""

from __future__ import annotations

import numpy as np

from fecm._dataclasses import frozen
from fecm._typing import Array
from fecm.results.criteria import INTERLAMINAR, criteria_of, plies_of
from fecm.results.errors import ResultFileError
from fecm.results.stored import Stored

LOWER_BOUNDS = "the run ends in contact: exposures are lower bounds"
FEWEST = 20  # evaluations of FAIL during contact below which maxima may be missed
# Attributes of a criterion's group, with CURE.
AT_REST = "at_rest"
LOAD_FACTOR = "load_factor"


@frozen
class LargestExposure:
    """Largest exposure of a criterion outside the elements under the load."""

    criterion: str
    exposure: float
    mode: str
    ply: int  # from 1 at the struck face; of an interface the ply above it
    x: float
    y: float
    time: float
    # With CURE; None without it.
    at_rest: float | None = None  # largest exposure of the residual stresses alone
    # Factor on all other stresses at the place at which the exposure is 1.
    load_factor: float | None = None

    @property
    def plies(self) -> str:
        """The ply, or the plies of the interface, in words."""
        return plies_of(self.criterion, self.ply)


def largest_exposures(stored: Stored) -> list[LargestExposure]:
    """Largest exposure of each criterion; empty without FAIL.

    Raises ResultFileError if the result names no such mode.
    """
    if "failure/x" not in stored:
        return []
    x, y = stored["failure/x"], stored["failure/y"]
    modes = stored.attributes_of("failure").get("modes", ())
    found = []
    for criterion in criteria_of(stored.attributes_of("failure")):
        exposure = stored[f"failure/{criterion}/exposure"]
        outside = np.where(near_load(stored, criterion), -1.0, exposure)
        if not outside.size or not (outside >= 0.0).any():
            continue
        place = np.unravel_index(int(np.nanargmax(outside)), outside.shape)
        # (element, point, ply, face), or (element, interface)
        at, ply = (place[:2], place[2]) if exposure.ndim > 2 else (place[:1], place[1])
        code = int(stored[f"failure/{criterion}/mode"][place])
        if not 0 <= code < len(modes):
            raise ResultFileError(
                f"failure/{criterion}/mode has the mode {code}, which has no name"
            )
        about = stored.attributes_of(f"failure/{criterion}")
        found.append(
            LargestExposure(
                criterion,
                exposure=float(exposure[place]),
                mode=modes[code],
                ply=int(ply) + 1,
                x=float(x[at].mean()),
                y=float(y[at].mean()),
                time=float(stored[f"failure/{criterion}/time"][place]),
                at_rest=_number(about.get(AT_REST)),
                load_factor=_number(about.get(LOAD_FACTOR)),
            )
        )
    return found


def _number(value: object) -> float | None:
    """An attribute that is a number; None if there is none."""
    return float(value) if isinstance(value, int | float) else None


def near_load(stored: Stored, criterion: str) -> Array:
    """Mask of the exposures of a criterion under the load, of a shape that fits theirs."""
    under = stored["failure/under_load"] != 0
    if criterion == INTERLAMINAR:  # whose exposures belong to the element
        under = under.any(axis=1)
        return np.asarray(under[:, None])
    return np.asarray(under[:, :, None, None])


def count_evaluations(stored: Stored) -> int:
    """Count the evaluations of FAIL at steps with a contact force; 0 without impact."""
    if "history/force" not in stored or "exposures/step" not in stored:
        return 0
    touching = stored["history/step"][stored["history/force"] > 0.0]
    return int(np.count_nonzero(np.isin(stored["exposures/step"], touching)))


def evaluations_in_contact(stored: Stored) -> int | None:
    """Number of :func:`count_evaluations` in the file; None without FAIL and in older results."""
    count = stored.attributes_of("failure").get("evaluations_in_contact")
    return int(count) if isinstance(count, int | np.integer) else None
