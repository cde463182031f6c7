"""Summary of a run in a few lines, and contents of a result file for `fecm info`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from fecm._frozen import frozen
from fecm.deck.units import quantity as shown_quantity
from fecm.mechanics.failure import CRITERIA
from fecm.results.first_failure import (
    evaluations_in_contact,
    failure_metrics,
    first_failures,
    where,
)
from fecm.results.result import Result
from fecm.results.schema import DATASETS, GROUPS, ResultFileError, row_blocks
from fecm.results.validity import CROSSED, End

if TYPE_CHECKING:
    from fecm.results.hdf5_reader import Contents

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
        lines.append(f"{exposure.line(result)}{known}")
    count = evaluations_in_contact(result)
    if count is not None and "history/force" in result:
        lines.append(f"evaluations       {count} of FAIL during contact")
    if first:
        one, rounded = first[0], partial(_rounded, result)
        texts = [
            f"{one.mode} ({one.criterion.replace('_', ' ')})",
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
        between = self.criterion == "interlaminar"
        return f"plies {self.ply} and {self.ply + 1}" if between else f"ply {self.ply}"

    def line(self, result: Result) -> str:
        """One line of the summary."""
        place, least = (
            where(self.criterion, self.ply),
            "at least " if result.end in UNDECIDED else "",
        )
        value = f"{least}{self.exposure:.4g}"
        return (
            f"{self.criterion.replace('_', ' '):18}{value}: {self.mode}, {place} at "
            f"({self.x:.6g}, {self.y:.6g}), time {_quantity(result, self.time, 'time')}"
        )


def largest_exposures(result: Result) -> list[LargestExposure]:
    """Largest exposure of each criterion; empty without FAIL."""
    if "failure/x" not in result:
        return []
    under = result["failure/under_load"] != 0
    x, y = result["failure/x"], result["failure/y"]
    modes = result.failure.attributes.get("modes", ())
    found = []
    for name in (*CRITERIA, "interlaminar"):
        exposure = result[f"failure/{name}/exposure"]
        # Interlaminar exposures belong to the element.
        near = under.any(axis=1)[:, None] if name == "interlaminar" else under[:, :, None, None]
        outside = np.where(near, -1.0, exposure)
        if not outside.size or not (outside >= 0.0).any():
            continue
        place = np.unravel_index(int(np.nanargmax(outside)), outside.shape)
        # (element, point, ply, face), or (element, interface)
        at, ply = (place[:2], place[2]) if exposure.ndim > 2 else (place[:1], place[1])
        code = int(result[f"failure/{name}/mode"][place])
        if not 0 <= code < len(modes):
            raise ResultFileError(f"failure/{name}/mode has the mode {code}, which has no name")
        mode = modes[code]
        time = float(result[f"failure/{name}/time"][place])
        where = int(ply) + 1, float(x[at].mean()), float(y[at].mean())
        found.append(LargestExposure(name, float(exposure[place]), mode, *where, time))
    return found


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


def describe_groups(contents: Contents) -> list[dict[str, Any]]:
    """Describe the groups and datasets of a result file, of a run or of a sweep.

    Of each group ``name`` (empty for the file itself), ``description``, ``rows`` (stored instants,
    or None), ``attributes`` and ``datasets``; of each dataset ``name`` (its path), ``shape``,
    ``dtype`` (``"text"`` for texts), ``description``, ``dimension``, ``unit``, ``min`` and ``max``
    of the finite numbers (None without any), ``not_finite`` and, for texts, the number of
    ``different`` ones.
    """
    members: dict[str, list[dict[str, Any]]] = {name: [] for name in contents.groups}
    for path in sorted(contents, key=lambda path: _order(DATASETS, path)):
        members.setdefault(path.rpartition("/")[0], []).append(_describe(contents, path))
    groups: list[dict[str, Any]] = []
    for name in sorted(members, key=lambda name: _order(GROUPS, name)):
        attributes = dict(contents.groups.get(name, {})) if name else {}
        description = str(attributes.pop("description", ""))
        rows, *_ = contents.shapes.get(f"{name}/step") or (None,)
        groups.append({"name": name, "description": description, "rows": rows,
                       "attributes": attributes, "datasets": members[name]})  # fmt: skip
    return groups


def _order(known: Mapping[str, Any], name: str) -> tuple[int, str]:
    """Sort key: known names in their order, then others by name."""
    return list(known).index(name) if name in known else len(known), name


def _describe(contents: Contents, path: str) -> dict[str, Any]:
    """Shape, type, attributes and range of one dataset."""
    attributes, texts = contents.attributes_of(path), contents.lists.get(path)
    minimum, maximum, not_finite = (None, None, 0) if texts is not None else _range(contents, path)
    return {
        "name": path,
        "shape": contents.shapes[path],
        "dtype": str(contents.dtypes[path]) if texts is None else "text",
        **{key: str(attributes.get(key, "")) for key in ("description", "dimension", "unit")},
        "min": minimum,
        "max": maximum,
        "not_finite": not_finite,
        "different": None if texts is None else len(set(texts)),
    }


def _range(contents: Contents, path: str) -> tuple[float | None, float | None, int]:
    """Minimum and maximum of the finite numbers, and number of others, by blocks of rows."""
    minimum, maximum, not_finite = math.inf, -math.inf, 0
    for start, stop in row_blocks(contents.shapes[path]):
        block = contents.rows(path, start, stop)
        finite = np.isfinite(block)
        not_finite += int(block.size - np.count_nonzero(finite))
        if finite.any():
            minimum = min(minimum, block[finite].min().item())
            maximum = max(maximum, block[finite].max().item())
    return (minimum, maximum, not_finite) if minimum <= maximum else (None, None, not_finite)


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
