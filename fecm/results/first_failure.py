"""When a run first reaches an exposure: time, force, energy, ply, mode and place."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any, NamedTuple

import numpy as np

from fecm._dataclasses import frozen
from fecm._typing import Floats
from fecm.results.criteria import criteria_of, where
from fecm.results.exposures import AT_REST, LOAD_FACTOR, evaluations_in_contact, of_material
from fecm.results.stored import Stored

NEEDED = tuple(f"exposures/{name}" for name in ("time", "exposure", "mode", "ply", "x", "y"))


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
    # Names of the material of the ply, or of both plies; empty if all plies are of one.
    materials: tuple[str, ...] = ()

    @property
    def where(self) -> str:
        """The ply, or the interface, in words."""
        return where(self.criterion, self.ply, self.materials)


def first_failures(stored: Stored, level: float = 1.0) -> list[FirstFailure]:
    """First time at which each criterion reaches an exposure, the earliest first.

    Empty without FAIL.  Criteria that stay below the level are not in the list.
    """
    if any(path not in stored for path in NEEDED):
        return []
    exposures, times = stored["exposures/exposure"], stored["exposures/time"]
    about = stored.attributes_of("failure")
    modes = dict(enumerate(map(str, about.get("modes", ()))))
    history = _history(stored)
    found = []
    for number, (criterion, exposure) in enumerate(
        zip(criteria_of(about), exposures.T, strict=False)
    ):
        (reached,) = np.nonzero(exposure >= level)
        if not len(reached):
            continue
        row = int(reached[0])
        before, below = (times[row - 1], exposure[row - 1]) if row else (0.0, 0.0)
        share = (level - below) / (exposure[row] - below)
        time = float(before + share * (times[row] - before))
        mode, ply, x, y = (
            stored[f"exposures/{name}"][row, number].item() for name in ("mode", "ply", "x", "y")
        )
        name, materials = of_material(stored, criterion, ply, (x, y), modes.get(mode, "unknown"))
        found.append(
            FirstFailure(
                criterion,
                mode=name,
                ply=ply,
                x=x,
                y=y,
                time=time,
                earliest=float(before),
                latest=float(times[row]),
                force=float(np.interp(time, history.time, history.force)),
                energy=float(np.interp(time, history.time, history.work)),
                materials=materials,
            )
        )
    return sorted(found, key=lambda one: one.time)


def threshold_energy(stored: Stored) -> float:
    """Work of the contact force when it first reaches the delamination threshold (force*length).

    NaN if it does not.
    """
    time = float(stored.threshold.get("time", math.nan)) if stored.threshold else math.nan
    if not math.isfinite(time):
        return math.nan
    history = _history(stored)
    return float(np.interp(time, history.time, history.work))


class _History(NamedTuple):
    """Contact force and its work on the plate at every step, from rest; NaN without impact."""

    time: Floats
    force: Floats
    work: Floats


def _history(stored: Stored) -> _History:
    if "history/force" not in stored:
        unknown = np.full(1, math.nan)
        return _History(np.zeros(1), unknown, unknown)
    time, force, tip = (
        np.concatenate([[0.0], stored[f"history/{name}"]])
        for name in ("time", "force", "displacement")
    )
    means = 0.5 * (force[1:] + force[:-1])
    # The tip's displacement is positive away from the plate.
    work = np.concatenate([[0.0], np.cumsum(-means * np.diff(tip))])
    return _History(time, force, work)


def failure_metrics(stored: Stored) -> dict[str, Any]:
    """Evaluations, largest exposures and first failures of a run with FAIL, as plain values.

    ``history`` has the largest exposures so far at every evaluation.  With CURE also the exposures
    at rest and the load factors.
    """
    times: list[float] = []
    so_far: dict[str, list[float]] = {}
    if "exposures/exposure" in stored and "exposures/time" in stored:
        times = stored["exposures/time"].tolist()
        columns = stored["exposures/exposure"].T.tolist()
        criteria = criteria_of(stored.attributes_of("failure"))
        so_far = dict(zip(criteria, columns, strict=False))
    return {
        "evaluations_in_contact": evaluations_in_contact(stored),
        "largest": {criterion: exposures[-1] for criterion, exposures in so_far.items()},
        "history": {"time": times, "exposure": so_far},
        "first": [asdict(one) for one in first_failures(stored)],
        **_of_cure(stored),
    }


def _of_cure(stored: Stored) -> dict[str, dict[str, float]]:
    """Attributes of the criteria that runs with CURE have, by criterion."""
    criteria = criteria_of(stored.attributes_of("failure"))
    known = {name: stored.attributes_of(f"failure/{name}") for name in criteria}
    found = {
        attribute: {name: float(own[attribute]) for name, own in known.items() if attribute in own}
        for attribute in (AT_REST, LOAD_FACTOR)
    }
    return {attribute: values for attribute, values in found.items() if values}
