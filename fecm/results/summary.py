"""The few lines that a person wants at the end of a run."""

from __future__ import annotations

import numpy as np

from fecm.results.result import Result, contact_intervals

# Contacts that are listed one by one.
LISTED = 6


def summary(result: Result) -> list[str]:
    """Summarise a result: forces, contacts, indentation and energy, in the deck's own units."""
    if "history/force" not in result:
        return ["no impact step was taken"]
    force, time = result["history/force"], result["history/time"]
    peak = int(np.argmax(force))
    lines = [f"steps             {len(time)}, up to time {time[-1]:.6g}"]
    if force[peak] > 0.0:
        lines.append(
            f"peak force        {force[peak]:.6g} at time {time[peak]:.6g} (step {peak + 1})"
        )
    else:
        lines.append("peak force        0: there was no contact")
    intervals = contact_intervals(force, time)
    texts = [f"{begin:.6g} to {end:.6g}" for begin, end in intervals[:LISTED]]
    if len(intervals) > LISTED:
        texts.append(f"and {len(intervals) - LISTED} more")
    if texts:
        lines.append(f"contact           {', '.join(texts)}")
    indentation = result["history/indentation"]
    deepest = int(np.argmax(indentation))
    lines.append(
        f"largest indent    {indentation[deepest]:.6g} at time {time[deepest]:.6g}, "
        f"permanent {result.history.attributes['permanent_indentation']:.6g}"
    )
    initial = float(result.energy.attributes["initial"])
    worst = float(np.abs(result["energy/balance_error"]).max())
    share = f"{worst / initial:.2g} of the initial" if initial else f"{worst:.3g}, initially"
    lines.append(f"energy balance    worst error {share} {initial:.6g}")
    return lines
