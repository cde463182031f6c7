"""Summary of a run: in a few lines, and as values for `fecm info`."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import numpy as np

from fecm.deck.units import quantity as shown_quantity
from fecm.results.criteria import spelt, where
from fecm.results.end import End
from fecm.results.exposures import LargestExposure, evaluations_in_contact, largest_exposures
from fecm.results.first_failure import failure_metrics, first_failures
from fecm.results.result import Result
from fecm.results.validity import CROSSED

LEFT = "left in plate, indentation and projectile"
LISTED = 6  # most contacts and frequencies listed individually
# Where a run has ended that has not decided its peak.
UNDECIDED = {
    End.RISING: "in contact",
    End.BETWEEN: "between two contacts",
}


def summary(result: Result) -> list[str]:
    """Summarise a result, in the deck's units."""
    quantity = partial(_quantity, result)
    lines: list[str] = []
    clock = "history/time" if "history/force" in result else "energy/time"
    if clock in result:
        time = result[clock]
        lines.append(f"steps             {len(time)}, up to time {quantity(time[-1], 'time')}")
    if "history/force" in result:
        lines += _impact(result)
    elif "tape3/w" in result and (w := result["tape3/w"]).any():
        row, node = np.unravel_index(int(np.abs(w).argmax()), w.shape)
        lines.append(f"largest w         {quantity(w[row, node], 'length')} at node {node + 1}")
    elif "tape3/w" in result:
        lines.append("largest w         0: nothing moved the plate")
    if result.threshold:
        lines.append(f"delamination      {_delamination(result)}{_delaminations(result)}")
    lines += _exposures(result)
    if "failure/x" in result and (count := np.count_nonzero(result["failure/under_load"])):
        lines.append(f"under the load    {count} points are left out of these exposures")
    if "modes/angular_frequency" in result:
        found = result["modes/angular_frequency"]
        texts = ", ".join(f"{omega:.6g}" for omega in found[:LISTED])
        more = f" and {len(found) - LISTED} more" if len(found) > LISTED else ""
        lines.append(f"frequencies       {texts}{more} {result.unit('1/time')}".rstrip())
    return lines or ["nothing was stored"]


def _delaminations(result: Result) -> str:
    """How many delaminations the threshold assumes, and the forces for other numbers of them."""
    known = result.threshold
    band, number, interfaces = (
        np.asarray(known.get(name, "")) for name in ("band", "number", "interfaces")
    )
    kinds = [(array.dtype.kind, array.shape) for array in (band, number, interfaces)]
    if kinds != [("f", (2,)), ("i", ()), ("i", ())]:
        return ""  # a result of an older version
    least, most = (_quantity(result, force, "force") for force in band.tolist())
    others = {1: most, max(1, int(interfaces)): least}
    others.pop(int(number), None)
    count = "one delamination" if number == 1 else f"{number} delaminations"
    texts = [f"{force} with {n}" for n, force in others.items()]
    return f" (for {'; '.join([count, *texts])})"


def _exposures(result: Result) -> list[str]:
    """Lines about the largest exposures and the first failure."""
    largest, first = largest_exposures(result), first_failures(result)
    reached = {one.criterion: one.force for one in first if not math.isnan(one.force)}
    lines = []
    for exposure in largest:
        force = reached.get(exposure.criterion)
        known = "" if force is None else f"; reaches 1 at {_rounded(result, force, 'force')}"
        lines.append(f"{_exposure(result, exposure)}{known}")
    count = evaluations_in_contact(result)
    if count is not None and "history/force" in result:
        lines.append(f"evaluations       {count} of FAIL during contact")
    if first:
        one, rounded = first[0], partial(_rounded, result)
        texts = [
            f"{one.mode} ({spelt(one.criterion)})",
            f"{one.where} at ({one.x:.6g}, {one.y:.6g})",
            f"time {rounded(one.time, 'time')}, between {one.earliest:.4g} and {one.latest:.4g}",
        ]
        if one.criterion in reached:
            texts.append(f"force {rounded(one.force, 'force')}")
            texts.append(f"energy {rounded(one.energy, 'force*length')}")
        lines.append(f"first failure     {', '.join(texts)}")
    elif largest and count:
        ends = " by the end of the run, which is in contact: open"
        lines.append(f"first failure     none{ends if result.still_in_contact else ''}")
    return lines


def _exposure(result: Result, largest: LargestExposure) -> str:
    """Line of the largest exposure of a criterion."""
    least = "at least " if result.end in UNDECIDED else ""
    return (
        f"{spelt(largest.criterion):18}{least}{largest.exposure:.4g}: {largest.mode}, "
        f"{where(largest.criterion, largest.ply)} at ({largest.x:.6g}, {largest.y:.6g}), "
        f"time {_quantity(result, largest.time, 'time')}"
    )


def _delamination(result: Result) -> str:
    """The threshold of delamination, and whether it is reached."""
    quantity, known = partial(_quantity, result), result.threshold
    force, crossing = quantity(float(known["force"]), "force"), float(known["time"])
    if math.isfinite(crossing):
        return f"{force} reached at time {quantity(crossing, 'time')}"
    if (end := result.end) in UNDECIDED:
        return f"{force} not reached by the end of the run, which is {UNDECIDED[end]}: open"
    margin = result.metrics.get("threshold_margin", 1.0)
    return f"{force} not reached: the peak is {margin:.1%} below"


def _rounded(result: Result, value: float, dimension: str) -> str:
    """An interpolated quantity, to four digits."""
    return _quantity(result, float(f"{value:.4g}"), dimension)


def _quantity(result: Result, value: float, dimension: str) -> str:
    return shown_quantity(value, result.unit(dimension))


def _impact(result: Result) -> list[str]:
    """Lines about forces, contacts, indentation and energy of an impact."""
    quantity = partial(_quantity, result)
    force, time = result["history/force"], result["history/time"]
    peak = int(np.argmax(force))
    at = f"{quantity(force[peak], 'force')} at time {quantity(time[peak], 'time')}"
    text = f"{at} (step {peak + 1})" if force[peak] > 0.0 else "0: there was no contact"
    if (end := result.end) in UNDECIDED and force[peak] > 0.0:
        text = f"at least {text}, as the run ends {UNDECIDED[end]}"
    if doubt := _elastic(result, float(force[peak])):
        text += f" ({doubt})"
    lines = [f"peak force        {text}"]
    edges = np.flatnonzero(np.diff(np.concatenate(([0], force > 0.0, [0])).astype(int)))
    intervals = list(zip(time[edges[::2]], time[edges[1::2] - 1], strict=True))  # in contact
    texts = [f"{begin:.6g} to {quantity(end, 'time')}" for begin, end in intervals[:LISTED]]
    if len(intervals) > LISTED:
        texts.append(f"and {len(intervals) - LISTED} more")
    if result.still_in_contact:
        if len(intervals) <= LISTED:
            texts[-1] = f"from {quantity(intervals[-1][0], 'time')}"
        texts[-1] += ", still in contact at the end"
    if texts:
        indentation, w = result["history/indentation"], result["history/plate_w"]
        deepest, last = (quantity(time[v.argmax()], "time") for v in (indentation, w))
        permanent = float(result.history.attributes["permanent_indentation"])
        left = "open" if end is not End.OVER else quantity(permanent, "length")
        alpha, bent = (quantity(values.max(), "length") for values in (indentation, w))
        lines += [
            f"contact           {', '.join(texts)}",
            f"largest indent    {alpha} at time {deepest}, permanent {left}",
            f"largest w         {bent} under the load at time {last}",
        ]
        metrics = result.metrics
        if not math.isnan(metrics["rebound_velocity"]):
            lines.append(
                f"rebound           {quantity(metrics['rebound_velocity'], 'length/time')}, "
                f"impulse {quantity(metrics['impulse'], 'force*time')}, "
                f"{quantity(metrics['energy_absorbed'], 'force*length')} {LEFT}"
            )
    initial = float(result.energy.attributes["initial"])
    worst = float(np.abs(result["energy/balance_error"]).max())
    share = f"{worst / initial:.2g} of the initial" if initial else f"{worst:.3g}, initially"
    lines.append(f"energy balance    worst error {share} {quantity(initial, 'force*length')}")
    return lines


def _elastic(result: Result, peak: float) -> str:
    """Why a peak force is that of an elastic plate only; empty if it may be real."""
    beyond = []
    if result.threshold and peak > CROSSED * (force := float(result.threshold["force"])):
        beyond.append(f"delamination at {_quantity(result, force, 'force')}")
    if any(found.exposure > 1.0 for found in largest_exposures(result)):
        beyond.append("the first failure")
    return f"elastic: beyond {' and '.join(beyond)}" if beyond else ""


def about_run(result: Result) -> dict[str, Any]:
    """Steps, first and last time, metrics and summary of a run."""
    steps = len(result["history/time"]) if "history/time" in result else 0
    missing = _missing(result)
    return {
        "steps": steps,
        "time": result["history/time"][[0, -1]].tolist() if steps else None,
        "still_in_contact": result.still_in_contact,
        "end": None if missing else result.end,
        "validity": result.validity,
        "notes": list(result.notes),
        "metrics": {} if missing else _metrics(result),
        "summary": missing or summary(result),
    }


def _metrics(result: Result) -> dict[str, Any]:
    """Impact metrics, and those of FAIL under ``failure``."""
    failure = failure_metrics(result)
    return {**result.metrics, "failure": failure} if failure else result.metrics


def _missing(result: Result) -> list[str]:
    """Reason why an incomplete file has no summary; empty if it has one."""
    needed = ("history/time", "history/indentation", "history/plate_w", "energy/balance_error")
    if "history/force" in result:
        if not len(result["history/force"]) or any(name not in result for name in needed):
            return ["no summary: history or energies are not complete"]
        permanent = result.history.attributes.get("permanent_indentation")
        initial = result.energy.attributes.get("initial")
        if not all(isinstance(value, int | float) for value in (permanent, initial)):
            return ["no summary: permanent_indentation or the initial energy is missing"]
    return []
