"""Impact metrics from contact forces: numbers of one run, or of many cases."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from fecm._typing import Floats
from fecm.mechanics.failure import CRITERIA

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
# Those of decks with a delamination threshold.
THRESHOLD = {
    "threshold_force": ("delamination threshold", "force"),
    "threshold_margin": ("1 less the largest contact force over the threshold", ""),
    "threshold_time": ("time at which the contact force first reaches the threshold", "time"),
    "time_above": ("time at or above the threshold", "time"),
}
# All of a run.
METRICS = {
    **SUMMARY,
    "max_deflection": ("largest displacement of the plate under the load", "length"),
    **THRESHOLD,
}
# Those of a search for velocities, and all of a sweep.
FOUND = {
    "found_velocity": ("velocity at which the value searched for is reached", "length/time"),
    "found_energy": ("kinetic energy of the projectile at that velocity", "force*length"),
}
# Those of a sweep that are measured on request; and the place that is hit instead of the one given.
EXPOSURES = {
    f"exposure_{name}": (f"largest exposure {name.replace('_', ' ')} outside the load", "")
    for name in (*CRITERIA, "interlaminar")
}
EVALUATIONS = {"fail_evaluations": ("evaluations of FAIL during contact", "")}
HIT = {f"hit_{axis}": (f"{axis} of the impact node or of the patch", "length") for axis in "xy"}
COLUMNS = {**METRICS, **FOUND, **EXPOSURES, **EVALUATIONS, **HIT}
GAGE = "gage_"
INTEGERS = ("contacts",)


def described(name: str) -> str:
    """Description of a column of a sweep."""
    if name.startswith(GAGE):
        return f"largest absolute strain of gage {name.removeprefix(GAGE)}"
    return COLUMNS.get(name, ("measured by the caller",))[0]


# Valid even if the run ends in contact, unless they occur at the end.
PEAKS = ("peak_force", "time_of_peak", "max_indentation")
PART = 16  # cases whose forces stay in the cache


class Indentation(NamedTuple):
    """Largest, last and permanent indentation of cases (length)."""

    largest: Floats
    last: Floats
    permanent: Floats


def summarise(
    force: Floats,
    times: Floats,
    indentation: Indentation,
    mass: Any,
    velocity: Any,
    threshold: float | None = None,
) -> dict[str, Floats]:
    """Summarise many cases from their contact forces.

    If the last step is in contact, quantities that depend on the rest of the contact are NaN:
    everything except the peaks, and a peak at the last step.

    Contact forces are (steps, cases), times of the steps (steps,); mass and impact velocity of the
    projectile are numbers or (cases,).  Returns the names of :data:`SUMMARY`, with a delamination
    threshold (force) also those of :data:`THRESHOLD`, (cases,) each.
    """
    cases = force.shape[1]
    mass, velocity = (np.broadcast_to(v, cases) for v in (mass, velocity))
    if cases > PART:
        parts = []
        for some in (slice(start, start + PART) for start in range(0, cases, PART)):
            depths = Indentation(*(values[some] for values in indentation))
            given = force[:, some], times, depths, mass[some], velocity[some], threshold
            parts.append(summarise(*given))
        return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    force = np.ascontiguousarray(force.T)
    dt = np.diff(times, prepend=0.0)
    touching = force > 0.0
    begins = touching.copy()
    begins[:, 1:] &= ~touching[:, :-1]
    last = len(times) - 1 - np.argmax(touching[:, ::-1], axis=1)
    peak = np.argmax(force, axis=1)
    met = touching.any(axis=1)
    # The force is linear between steps, and 0 before the first.  These sums are the same for a case
    # with any others.
    impulse = (0.5 * (dt + np.append(dt[1:], 0.0)) * force).sum(axis=1)
    rebound = impulse / mass - velocity
    found = {
        "peak_force": force.max(axis=1),
        "time_of_peak": np.where(met, times[peak], np.nan),
        "contacts": begins.sum(axis=1).astype(float),
        "contact_time": (dt * touching).sum(axis=1),
        "last_contact": np.where(met, times[last], np.nan),
        "max_indentation": indentation.largest,
        "permanent_indentation": indentation.permanent,
        "impulse": impulse,
        "rebound_velocity": rebound,
        "energy_absorbed": 0.5 * mass * (velocity**2 - rebound**2),
    }
    still = touching[:, -1]
    unknown = {name: still & (peak == len(times) - 1) for name in PEAKS}
    if threshold is not None:
        above = force >= threshold
        first = times[np.argmax(above, axis=1)]
        found["threshold_force"] = np.full(len(force), threshold)
        found["threshold_margin"] = 1.0 - found["peak_force"] / threshold
        found["threshold_time"] = np.where(above.any(axis=1), first, np.nan)
        found["time_above"] = (dt * above).sum(axis=1)
        unknown["threshold_margin"] = unknown["peak_force"]
        unknown |= dict.fromkeys(("threshold_force", "threshold_time"), np.zeros_like(still))
    unknown["max_indentation"] = still & (indentation.last >= indentation.largest)
    return {
        name: np.where(unknown.get(name, still), np.nan, values) for name, values in found.items()
    }
