"""Summary of a run in a few lines."""

from __future__ import annotations

import numpy as np

from fecm.results.result import Result, contact_intervals

# Most contacts and frequencies listed individually.
LISTED = 6

OPEN_END = (
    "the run ends in contact: the end of the contact, the permanent indentation and the energies "
    "after it are open; take more steps"
)


def summary(result: Result) -> list[str]:
    """Summarise a result, in the deck's units."""
    lines: list[str] = []
    if "history/force" in result:
        lines += _impact(result)
    elif "energy/time" in result:
        time = result["energy/time"]
        lines.append(
            f"steps             {len(time)}, up to time {_quantity(result, time[-1], 'time')}"
        )
    if "history/force" not in result and "tape3/w" in result:
        lines += _deflection(result)
    if "modes/angular_frequency" in result:
        found = result["modes/angular_frequency"]
        texts = ", ".join(f"{omega:.6g}" for omega in found[:LISTED])
        more = f" and {len(found) - LISTED} more" if len(found) > LISTED else ""
        lines.append(f"frequencies       {texts}{more} {result.unit('1/time')}".rstrip())
    return lines or ["nothing was stored"]


def _deflection(result: Result) -> list[str]:
    """Line about the largest deflection of a run without impact."""
    w = result["tape3/w"]
    if not w.any():
        return ["largest w         0: nothing moved the plate"]
    row, node = np.unravel_index(int(np.abs(w).argmax()), w.shape)
    return [f"largest w         {_quantity(result, w[row, node], 'length')} at node {node + 1}"]


def _quantity(result: Result, value: float, dimension: str) -> str:
    return f"{value:.6g} {result.unit(dimension)}".rstrip()


def _impact(result: Result) -> list[str]:
    """Lines about forces, contacts, indentation and energy of an impact."""

    def quantity(value: float, dimension: str) -> str:
        return _quantity(result, value, dimension)

    force, time = result["history/force"], result["history/time"]
    peak = int(np.argmax(force))
    lines = [f"steps             {len(time)}, up to time {quantity(time[-1], 'time')}"]
    if force[peak] > 0.0:
        lines.append(
            f"peak force        {quantity(force[peak], 'force')} at time "
            f"{quantity(time[peak], 'time')} (step {peak + 1})"
        )
    else:
        lines.append("peak force        0: there was no contact")
    intervals = contact_intervals(force, time)
    texts = [f"{begin:.6g} to {quantity(end, 'time')}" for begin, end in intervals[:LISTED]]
    if len(intervals) > LISTED:
        texts.append(f"and {len(intervals) - LISTED} more")
    if result.still_in_contact:
        if len(intervals) <= LISTED:
            texts[-1] = f"from {quantity(intervals[-1][0], 'time')}"
        texts[-1] += ", still in contact at the end"
    if texts:
        lines.append(f"contact           {', '.join(texts)}")
        indentation = result["history/indentation"]
        deepest = int(np.argmax(indentation))
        permanent = float(result.history.attributes["permanent_indentation"])
        left = "open" if result.still_in_contact else quantity(permanent, "length")
        lines.append(
            f"largest indent    {quantity(indentation[deepest], 'length')} at time "
            f"{quantity(time[deepest], 'time')}, permanent {left}"
        )
    initial = float(result.energy.attributes["initial"])
    worst = float(np.abs(result["energy/balance_error"]).max())
    share = f"{worst / initial:.2g} of the initial" if initial else f"{worst:.3g}, initially"
    lines.append(f"energy balance    worst error {share} {quantity(initial, 'force*length')}")
    return lines
