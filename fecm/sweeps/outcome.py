"""Summary of each case."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fecm._typing import Floats

# Description and dimension of every quantity, by name.
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
INTEGERS = ("contacts",)
FINE = "ok"
# The run ends during contact.
STILL = "still in contact"
RUN = (FINE, STILL)
# Peaks: valid even if the run ends in contact, unless they occur at the end.
PEAKS = ("peak_force", "time_of_peak", "max_indentation")


# Columns of an outcome.
COLUMNS = (*SUMMARY, "status", "dt", "steps", "unsettled")


@dataclass
class Outcome:
    """Results of some cases.

    Attributes
    ----------
    numbers : list of int
        Numbers of the cases, from 0.
    columns : dict of ndarray (cases,)
        Values by the names of :data:`COLUMNS`.  Those of :data:`SUMMARY` are NaN if the case
        failed, or if they are unknown because the run ended in contact.  ``status`` is ``"ok"``,
        ``"still in contact"``, or the reason for the failure; ``unsettled`` counts the steps whose
        contact iteration did not converge.
    force : ndarray (cases, steps) or None
        Contact force after every step.
    """

    numbers: list[int]
    columns: dict[str, NDArray[Any]]
    force: Floats | None = field(default=None, repr=False)

    @property
    def status(self) -> list[str]:
        """Status of each case."""
        texts: list[str] = self.columns["status"].tolist()
        return texts

    def select(self, rows: NDArray[np.intp]) -> Outcome:
        """Return the outcome of some of the cases."""
        columns = {name: values[rows] for name, values in self.columns.items()}
        force = None if self.force is None else self.force[rows]
        return Outcome([self.numbers[row] for row in rows], columns, force)

    @classmethod
    def failed(cls, numbers: Sequence[int], reasons: Sequence[str]) -> Outcome:
        """Return the outcome of cases that could not be run."""
        count = len(numbers)
        columns: dict[str, NDArray[Any]] = {name: np.full(count, np.nan) for name in SUMMARY}
        columns |= {"status": np.array(reasons, dtype=np.str_), "dt": np.full(count, np.nan)}
        columns |= {name: np.zeros(count, dtype=np.int64) for name in ("steps", "unsettled")}
        return cls(list(numbers), columns)


def merge(parts: Sequence[Outcome]) -> Outcome:
    """Merge outcomes, ordered by the numbers of the cases."""
    numbers = [number for part in parts for number in part.numbers]
    order = np.argsort(numbers)
    longest = max((0 if part.force is None else part.force.shape[1] for part in parts), default=0)
    force = np.full((len(numbers), longest), np.nan)
    row = 0
    for part in parts:
        if part.force is not None:
            force[row : row + len(part.numbers), : part.force.shape[1]] = part.force
        row += len(part.numbers)
    columns = {n: np.concatenate([part.columns[n] for part in parts])[order] for n in COLUMNS}
    return Outcome([numbers[i] for i in order], columns, force[order])


class Indentation(NamedTuple):
    """Largest, last and permanent indentation of cases (length)."""

    largest: Floats
    last: Floats
    permanent: Floats


def summarise(
    force: Floats, times: Floats, indentation: Indentation, mass: Any, velocity: Any
) -> dict[str, Floats]:
    """Summarise many cases from their contact forces.

    If the last step is in contact, quantities that depend on the rest of the contact are NaN:
    everything except the peaks, and a peak at the last step.

    Parameters
    ----------
    force : ndarray (steps, cases)
        Contact force after every step.
    times : ndarray (steps,)
        Times of the steps.
    indentation : Indentation
    mass, velocity : float or ndarray (cases,)
        Mass and impact velocity of the projectile.

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
    found = {
        "peak_force": force.max(axis=0),
        "time_of_peak": np.where(met, times[peak], np.nan),
        "contacts": (touching & ~before).sum(axis=0).astype(float),
        "contact_time": dt @ touching,
        "last_contact": np.where(met, times[last], np.nan),
        "max_indentation": indentation.largest,
        "permanent_indentation": indentation.permanent,
        "impulse": impulse,
        "rebound_velocity": rebound,
        "energy_absorbed": 0.5 * mass * (velocity**2 - rebound**2),
    }
    still = touching[-1]
    rising = {name: still & (peak == len(times) - 1) for name in PEAKS}
    rising["max_indentation"] = still & (indentation.last >= indentation.largest)
    return {
        name: np.where(rising.get(name, still), np.nan, values) for name, values in found.items()
    }


def status_of(force: Floats) -> NDArray[np.str_]:
    """Return the status of cases from their contact forces (steps, cases)."""
    return np.where(force[-1] > 0.0, STILL, FINE)
