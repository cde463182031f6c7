"""What came out of cases, in a few numbers each."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

# Name, description and dimension of every number of a case.
SUMMARY = {
    "peak_force": ("largest contact force", "force"),
    "time_of_peak": ("time of the largest contact force", "time"),
    "contacts": ("number of contacts", ""),
    "contact_time": ("time in contact", "time"),
    "last_contact": ("time of the last step in contact", "time"),
    "max_indentation": ("largest indentation", "length"),
    "permanent_indentation": ("permanent indentation", "length"),
    "impulse": ("time integral of the contact force", "force*time"),
    "rebound_velocity": (
        "velocity of the projectile's centre at the end, positive away from the plate",
        "length/time",
    ),
    "energy_absorbed": (
        "kinetic energy that the projectile's centre has lost at the end", "force*length"
    ),
}  # fmt: skip
WHOLE = ("contacts",)
FINE = "ok"


@dataclass
class Outcome:
    """What came out of some cases.

    Attributes
    ----------
    numbers : list of int
        The cases, from 0.
    summary : dict of ndarray (cases,)
        By the names of :data:`SUMMARY`; NaN where a case failed.
    status : list of str
        ``"ok"``, or why a case failed.
    dt, steps : ndarray (cases,)
        Time step, and number of steps.
    force : ndarray (cases, steps) or None
        Contact force after every step.
    """

    numbers: list[int]
    summary: dict[str, Floats]
    status: list[str]
    dt: Floats
    steps: NDArray[np.int64]
    force: Floats | None = field(default=None, repr=False)

    @classmethod
    def failed(cls, numbers: list[int], reasons: list[str]) -> Outcome:
        """Cases that could not be run."""
        none = np.full(len(numbers), np.nan)
        steps = np.zeros(len(numbers), dtype=np.int64)
        summary = {name: none.copy() for name in SUMMARY}
        return cls(list(numbers), summary, list(reasons), none.copy(), steps)


def summarise(
    force: Floats, times: Floats, deepest: Floats, permanent: Floats, mass: Any, velocity: Any
) -> dict[str, Floats]:
    """Numbers of many cases from their contact forces.

    Parameters
    ----------
    force : ndarray (steps, cases)
        After every step.
    times : ndarray (steps,)
        Of the steps.
    deepest, permanent : ndarray (cases,)
        Largest and permanent indentation.
    mass, velocity : float or ndarray (cases,)
        Of the projectile; its approach.

    Returns
    -------
    dict of ndarray (cases,)
        By the names of :data:`SUMMARY`.
    """
    dt = np.diff(times, prepend=0.0)
    touching = force > 0.0
    before = np.vstack([np.zeros_like(touching[:1]), touching[:-1]])
    last = len(times) - 1 - np.argmax(touching[::-1], axis=0)
    peak = np.argmax(force, axis=0)
    met = touching.any(axis=0)
    # The force is linear between steps, and 0 before the first.
    weights = 0.5 * (dt + np.append(dt[1:], 0.0))
    impulse = weights @ force
    rebound = impulse / mass - velocity
    return {
        "peak_force": force.max(axis=0),
        "time_of_peak": np.where(met, times[peak], np.nan),
        "contacts": (touching & ~before).sum(axis=0).astype(float),
        "contact_time": dt @ touching,
        "last_contact": np.where(met, times[last], np.nan),
        "max_indentation": deepest,
        "permanent_indentation": permanent,
        "impulse": impulse,
        "rebound_velocity": rebound,
        "energy_absorbed": 0.5 * mass * (velocity**2 - rebound**2),
    }
