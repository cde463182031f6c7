"""When a run first reaches an exposure: time, force, energy, ply, mode and place."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from fecm._frozen import frozen
from fecm._typing import Floats
from fecm.mechanics.failure import CRITERIA

if TYPE_CHECKING:
    from fecm.results.result import Result

COLUMNS = ("exposure", "mode", "ply", "x", "y")
FEWEST = 20  # evaluations of FAIL during contact below which maxima may be missed


@frozen
class FirstFailure:
    """First exposure of a criterion at a level, 1 for failure, outside the load.

    FAIL evaluates every N-th pass, so that the time lies between two evaluations.  It is
    interpolated linearly between them, force and energy are those of this time.  Mode, ply and
    place are those of the largest exposure at the later evaluation.
    """

    criterion: str
    mode: str
    ply: int  # from 1 at the struck face; of an interface the ply above it
    # Place.
    x: float
    y: float
    time: float
    # The last evaluation below the level, 0 before the first evaluation, and the next one.
    earliest: float
    latest: float
    force: float  # contact force; NaN without impact
    # Work of the contact force so far on plate and indentation: what the projectile has given up of
    # its kinetic energy (force*length); NaN without impact.
    energy: float

    @property
    def where(self) -> str:
        """The ply, or the interface, in words."""
        return where(self.criterion, self.ply)


def where(criterion: str, ply: int) -> str:
    """A ply, or of the interlaminar criterion an interface, in words."""
    between = criterion == "interlaminar"
    return f"interface of plies {ply} and {ply + 1}" if between else f"ply {ply}"


def first_failures(result: Result, level: float = 1.0) -> list[FirstFailure]:
    """First time at which each criterion reaches an exposure, the earliest first.

    Empty without FAIL.  Criteria that stay below the level are not in the list.
    """
    if any(f"exposures/{name}" not in result for name in ("time", *COLUMNS)):
        return []
    exposure, times = result["exposures/exposure"], result["exposures/time"]
    modes = dict(enumerate(map(str, result.attributes_of("failure").get("modes", ()))))
    clock, force, work = _histories(result)
    found = []
    for number, criterion in enumerate((*CRITERIA, "interlaminar")):
        (reached,) = np.nonzero(exposure[:, number] >= level)
        if not len(reached):
            continue
        row = int(reached[0])
        before, below = (times[row - 1], exposure[row - 1, number]) if row else (0.0, 0.0)
        share = (level - below) / (exposure[row, number] - below)
        time = float(before + share * (times[row] - before))
        mode, ply, x, y = (result[f"exposures/{name}"][row, number].item() for name in COLUMNS[1:])
        at_time = (float(np.interp(time, clock, values)) for values in (force, work))
        span = float(before), float(times[row])
        name = modes.get(mode, "unknown")
        found.append(FirstFailure(criterion, name, ply, x, y, time, *span, *at_time))
    return sorted(found, key=lambda one: one.time)


def _histories(result: Result) -> tuple[Floats, Floats, Floats]:
    """Time, contact force and its work on the plate at every step; NaN without impact."""
    if "history/force" not in result:
        return np.zeros(1), np.full(1, math.nan), np.full(1, math.nan)
    time, force, tip = (
        np.concatenate([[0.0], result[f"history/{name}"]])
        for name in ("time", "force", "displacement")
    )
    means = 0.5 * (force[1:] + force[:-1])
    # The tip's displacement is positive away from the plate.
    return time, force, np.concatenate([[0.0], np.cumsum(-means * np.diff(tip))])


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


def failure_metrics(result: Result) -> dict[str, Any]:
    """Evaluations, largest exposures and first failures as plain values; empty without FAIL."""
    if "failure/x" not in result:
        return {}
    names, largest = (*CRITERIA, "interlaminar"), []
    if "exposures/exposure" in result:
        largest = result["exposures/exposure"][-1].tolist()
    return {
        "evaluations_in_contact": evaluations_in_contact(result),
        "largest": dict(zip(names, largest, strict=False)),
        "first": [asdict(one) for one in first_failures(result)],
    }
