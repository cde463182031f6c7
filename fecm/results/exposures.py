"""Largest exposures of FAIL, and how often it was evaluated."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fecm._frozen import frozen
from fecm._typing import Array
from fecm.results.criteria import ALL_CRITERIA, INTERLAMINAR, plies_of
from fecm.results.errors import ResultFileError

if TYPE_CHECKING:
    from fecm.results.result import Result

FEWEST = 20  # evaluations of FAIL during contact below which maxima may be missed


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

    @property
    def plies(self) -> str:
        """The ply, or the plies of the interface, in words."""
        return plies_of(self.criterion, self.ply)


def largest_exposures(result: Result) -> list[LargestExposure]:
    """Largest exposure of each criterion; empty without FAIL.

    Raises ResultFileError if the result names no such mode.
    """
    if "failure/x" not in result:
        return []
    x, y = result["failure/x"], result["failure/y"]
    modes = result.attributes_of("failure").get("modes", ())
    found = []
    for criterion in ALL_CRITERIA:
        exposure = result[f"failure/{criterion}/exposure"]
        outside = np.where(_near(result, criterion), -1.0, exposure)
        if not outside.size or not (outside >= 0.0).any():
            continue
        place = np.unravel_index(int(np.nanargmax(outside)), outside.shape)
        # (element, point, ply, face), or (element, interface)
        at, ply = (place[:2], place[2]) if exposure.ndim > 2 else (place[:1], place[1])
        code = int(result[f"failure/{criterion}/mode"][place])
        if not 0 <= code < len(modes):
            raise ResultFileError(
                f"failure/{criterion}/mode has the mode {code}, which has no name"
            )
        found.append(
            LargestExposure(
                criterion,
                exposure=float(exposure[place]),
                mode=modes[code],
                ply=int(ply) + 1,
                x=float(x[at].mean()),
                y=float(y[at].mean()),
                time=float(result[f"failure/{criterion}/time"][place]),
            )
        )
    return found


def _near(result: Result, criterion: str) -> Array:
    """Mask of the exposures of a criterion under the load, of a shape that fits theirs."""
    under = result["failure/under_load"] != 0
    if criterion == INTERLAMINAR:  # whose exposures belong to the element
        under = under.any(axis=1)
        return np.asarray(under[:, None])
    return np.asarray(under[:, :, None, None])


def count_evaluations(result: Result) -> int:
    """Count the evaluations of FAIL at steps with a contact force; 0 without impact."""
    if "history/force" not in result or "exposures/step" not in result:
        return 0
    touching = result["history/step"][result["history/force"] > 0.0]
    return int(np.count_nonzero(np.isin(result["exposures/step"], touching)))


def evaluations_in_contact(result: Result) -> int | None:
    """Stored number of :func:`count_evaluations`; None without FAIL and in older results."""
    stored = result.attributes_of("failure").get("evaluations_in_contact")
    return int(stored) if isinstance(stored, int | np.integer) else None
