"""Summary of a run, and the contents of a result file for `fecm info`."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, TypedDict, cast

import numpy as np

from fecm._table import Row, Table, label_lines, text_lines
from fecm._text import DECK_DIGITS, DIGITS, significant
from fecm._typing import FiniteFloat, Floats
from fecm.deck.units import quantity as shown_quantity
from fecm.deck.units import unit_of
from fecm.judge.criteria import spelt
from fecm.judge.end import ENDS, OPEN_PEAKS, End
from fecm.judge.exposures import (
    LargestExposure,
    finer_meshes,
    no_failure,
    on_this_mesh,
    point_in_words,
)
from fecm.judge.limits import EXPOSURE, THRESHOLD
from fecm.judge.threshold import from_threshold, threshold_outcome
from fecm.results.exposures import (
    FailureJson,
    evaluations_in_contact,
    failure_metrics,
    first_failures,
    largest_exposures,
)
from fecm.results.groups import GROUPS
from fecm.results.metrics import INITIAL_PLATE
from fecm.results.run_metrics import end_of, impact_energy, metrics_of, start_w_of
from fecm.results.schema import DATASETS
from fecm.results.stored import Stored, row_blocks, whole_plate

if TYPE_CHECKING:
    from fecm.results.exposures import FirstFailure
    from fecm.results.hdf5_reader import FileContents


class DatasetJson(TypedDict):
    """Dataset of a result file in JSON."""

    name: str
    shape: Sequence[int]
    dtype: str
    description: str
    dimension: str
    unit: str
    min: FiniteFloat | None
    max: FiniteFloat | None
    not_finite: int
    different: Annotated[int | None, "Number of different texts; null for numbers."]


class GroupJson(TypedDict):
    """Group of a result file in JSON."""

    name: str
    description: str
    rows: int | None
    attributes: dict[str, Any]
    datasets: list[DatasetJson]


class MetricsJson(TypedDict, total=False):
    """Metrics of a run in JSON: numbers by name, and what FAIL found."""

    failure: Annotated[FailureJson, "Of decks with FAIL."]


class RunJson(TypedDict):
    """Summary of a run in JSON."""

    steps: int
    time: Annotated[Annotated[list[float], (2,)] | None, "First and last; null without steps."]
    still_in_contact: bool
    end: Annotated[End | None, "State of the contact at the end; null without impact steps."]
    validity: Annotated[
        str,
        "ok, or the reasons to doubt the result, separated by semicolons; empty without impact "
        "steps.",
    ]
    notes: list[str]
    metrics: MetricsJson
    summary: list[str]


def describe_groups(contents: FileContents) -> list[GroupJson]:
    """Describe the groups and datasets of a result file of a run or a sweep.

    Each group has ``name`` (empty for the file itself), ``description``, ``rows`` (stored instants,
    or None), ``attributes`` and ``datasets``. Each dataset has ``name`` (its path), ``shape``,
    ``dtype`` (``"text"`` for texts), ``description``, ``dimension``, ``unit``, ``min`` and ``max``
    of the finite numbers (None without any), ``not_finite`` and, for texts, the number of
    ``different`` texts.
    """
    members: dict[str, list[DatasetJson]] = {name: [] for name in contents.groups}
    for path in _sorted(contents, DATASETS):
        members.setdefault(path.rpartition("/")[0], []).append(_describe(contents, path))
    groups: list[GroupJson] = []
    for name in _sorted(members, GROUPS):
        attributes = dict(contents.groups.get(name, {})) if name else {}
        description = str(attributes.pop("description", ""))
        rows, *_ = contents.shapes.get(f"{name}/step") or (None,)
        groups.append(
            {
                "name": name,
                "description": description,
                "rows": rows,
                "attributes": attributes,
                "datasets": members[name],
            }
        )
    return groups


def _sorted(names: Iterable[str], order_of_known: Iterable[str]) -> list[str]:
    """Return known names in their order, then other names sorted."""
    order = {name: number for number, name in enumerate(order_of_known)}
    return sorted(names, key=lambda name: (order.get(name, len(order)), name))


def _describe(contents: FileContents, path: str) -> DatasetJson:
    """Return shape, type, attributes and range of one dataset."""
    attributes, texts = contents.attributes_of(path), contents.lists.get(path)
    minimum, maximum, not_finite = (None, None, 0) if texts is not None else _range(contents, path)
    return {
        "name": path,
        "shape": contents.shapes[path],
        "dtype": str(contents.dtypes[path]) if texts is None else "text",
        "description": str(attributes.get("description", "")),
        "dimension": str(attributes.get("dimension", "")),
        "unit": str(attributes.get("unit", "")),
        "min": minimum,
        "max": maximum,
        "not_finite": not_finite,
        "different": None if texts is None else len(set(texts)),
    }


def _range(contents: FileContents, path: str) -> tuple[float | None, float | None, int]:
    """Return minimum and maximum of the finite numbers, and the count of others."""
    minimum, maximum, not_finite = math.inf, -math.inf, 0
    for start, stop in row_blocks(contents.shapes[path]):
        block = contents.rows(path, start, stop)
        finite = np.isfinite(block)
        not_finite += int(block.size - np.count_nonzero(finite))
        if finite.any():
            minimum = min(minimum, block[finite].min().item())
            maximum = max(maximum, block[finite].max().item())
    return (minimum, maximum, not_finite) if minimum <= maximum else (None, None, not_finite)


NEAR = 0.05  # distance of a row from the peak, over its time, that counts as the peak
LISTED = 6  # most contacts and frequencies listed individually
# Parts by the caller of the run: attribute, name, and the segment of the deck that they replace.
OWN_PARTS = (("law", "contact law", "EXPE"), ("projectile", "projectile", "PROJ"))

# Events whose impact energy a search finds, with the search's condition.
THRESHOLD_EVENT = ("the threshold", "peak_force=threshold")
FAILURE_EVENT = ("the first failure", "exposure=1")


def search_for(event: str, until: str) -> str:
    """Return the command that finds the impact energy of an event."""
    command = f"fecm sweep DECK --find velocity --until {until}"
    return f"{command} finds the impact energy of {event}"


def run_summary(result: Stored) -> list[str]:
    """Return the rows of :func:`run_table` as lines of text."""
    return text_lines(run_table(result))


def run_table(result: Stored) -> Table:
    """Return the summary of a result, in the deck's units."""
    return Table(tuple(_run_rows(result)), title=result.title or "(no title)")


def _run_rows(result: Stored) -> list[Row]:
    quantity = partial(_quantity, result)
    lines: list[Row] = [
        (what, f"{result.attributes[name]}, instead of {card}")
        for name, what, card in OWN_PARTS
        if name in result.attributes
    ]
    if text := whole_plate(result.symmetry_factor):
        lines.append(("symmetry", text))
    clock = "history/time" if "history/force" in result else "energy/time"
    if clock in result:
        time = result[clock]
        lines.append(("steps", f"{len(time)}, up to time {quantity(time[-1], 'time')}"))
    lines += _curved(result)
    lines += _preload(result)
    if "history/force" in result:
        lines += _impact(result)
    elif "tape3/w" in result and (w := result["tape3/w"]).any():
        row, node = np.unravel_index(int(np.abs(w).argmax()), w.shape)
        lines.append(("largest w", f"{quantity(w[row, node], 'length')} at node {node + 1}"))
    elif "tape3/w" in result:
        lines.append(("largest w", "0: nothing moved the plate"))
    if text := _membrane(result):
        lines.append(("membrane", text))
    if result.threshold:
        lines.append(("delamination", _delamination(result)))
        if math.isfinite(float(result.threshold["time"])):
            lines.append(("", search_for(*THRESHOLD_EVENT)))
    if "failure/x" in result:
        lines += _exposures(result)
    if "modes/angular_frequency" in result:
        frequencies = result["modes/angular_frequency"]
        texts = ", ".join(significant(omega) for omega in frequencies[:LISTED])
        more = f" and {len(frequencies) - LISTED} more" if len(frequencies) > LISTED else ""
        lines.append(
            ("frequencies", f"{texts}{more} {result.unit('modes/angular_frequency')}".rstrip())
        )
    return lines or [("nothing was stored", "")]


def radii_of(result: Stored) -> dict[str, float]:
    """Return the finite radii of a curved panel by ``x``, ``y`` and ``xy``, length.

    The result is empty for a flat panel.
    """
    attributes = result.attributes_of("mesh")
    radii = {axis: attributes.get(f"radius_{axis}") for axis in ("x", "y", "xy")}
    return {
        axis: float(radius) for axis, radius in radii.items() if isinstance(radius, int | float)
    }


def _curved(result: Stored) -> list[Row]:
    """Return the row of the radii and the rise of a curved panel.

    The rise of a symmetric part is not that of the whole plate.
    """
    if "mesh/z" not in result:
        return []
    named = [
        f"R{axis} {_quantity(result, radius, 'length', DECK_DIGITS)}"
        for axis, radius in radii_of(result).items()
    ]
    if result.symmetry_factor == 1:
        rise = _quantity(result, float(np.ptp(result["mesh/z"])), "length", DECK_DIGITS)
        named.append(f"rise {rise}")
    return [("curved panel", ", ".join(named))]


def _preload(result: Stored) -> list[Row]:
    """Return the row of the initial membrane force of PREL."""
    attributes = result.attributes_of("laminate")
    forces = {f"N_{name}": attributes.get(f"N0_{name}") for name in ("x", "y", "xy")}
    named = [
        f"{name} = {_quantity(result, force, 'force/length', DECK_DIGITS)}"
        for name, force in forces.items()
        if isinstance(force, float) and force
    ]
    return [("preload", ", ".join(named))] if named else []


def _membrane(result: Stored) -> str:
    """Return the share of the membrane in the strain energy of a nonlinear plate.

    The stored row nearest to the peak force counts; without contact, the row of the largest energy.
    The energy of the preload does not count. The text is empty if the share is not known.
    """
    needed = [f"membrane/{name}" for name in ("time", "energy", "strain_energy")]
    if not all(path in result and result[path].size for path in needed):
        return ""
    elastic = result["membrane/strain_energy"].copy()
    if "membrane/preload_energy" in result:
        elastic -= result["membrane/preload_energy"]
    row, when = int(elastic.argmax()), "where it is largest"
    if "history/force" in result and (force := result["history/force"]).any():
        time, peak = result["membrane/time"], float(result["history/time"][force.argmax()])
        row, when = int(np.abs(time - peak).argmin()), "at the peak"
        if abs(time[row] - peak) > NEAR * peak:
            when = f"at time {_quantity(result, time[row], 'time')}, the row nearest to the peak"
    if not elastic[row] > 0.0:
        return ""
    percent = 100.0 * float(result["membrane/energy"][row]) / float(elastic[row])
    return f"{percent:.{0 if percent > 9.5 else 1}f} % of the strain energy {when}"


def _delamination(result: Stored) -> str:
    """Format the threshold, whether it is reached, and the forces for other delaminations."""
    verdict = f"{threshold_in_words(result)}, {threshold_verdict(result)}"
    threshold = result.threshold
    band, number, interfaces = (
        np.asarray(threshold.get(name, "")) for name in ("band", "number", "interfaces")
    )
    kinds = [(array.dtype.kind, array.shape) for array in (band, number, interfaces)]
    if kinds != [("f", (2,)), ("i", ()), ("i", ())]:
        return verdict  # of an older version
    least, most = (_quantity(result, force, "force") for force in band.tolist())
    other_counts = {1: most, max(1, int(interfaces)): least}
    other_counts.pop(int(number), None)
    count = "one delamination" if number == 1 else f"{number} delaminations"
    texts = [f"{force} for {'one' if n == 1 else n}" for n, force in other_counts.items()]
    texts += lowest_criterion(result)
    return f"{verdict} ({'; '.join([f'for {count}, as in DELA', *texts])})"


def lowest_criterion(result: Stored) -> list[str]:
    """Return a text about the criterion that reaches 1 below the threshold, if there is one."""
    first = [f for f in _first_failures(result) if f.force < float(result.threshold["force"])]
    if not first:
        return []
    lowest = min(first, key=lambda failure: failure.force)
    force = _quantity(result, lowest.force, "force")
    return [f"{spelt(lowest.criterion)} reaches 1 before, at {force}"]


def _exposures(result: Stored) -> list[Row]:
    """Return rows about the largest exposures and the first failure."""
    largest, first = largest_exposures(result), _first_failures(result)
    reached = {
        failure.criterion: failure.force for failure in first if not math.isnan(failure.force)
    }
    lines: list[Row] = []
    for exposure in largest:
        force = reached.get(exposure.criterion)
        reaches = "" if force is None else f"; reaches 1 at {_quantity(result, force, 'force')}"
        text = f"{_exposure(result, exposure)}{reaches}{_at_rest(exposure)}"
        lines.append((spelt(exposure.criterion), text))
    count = evaluations_in_contact(result)
    if count is not None and "history/force" in result:
        lines.append(("evaluations", f"{count} of FAIL during contact"))
    if first:
        text = f"{on_this_mesh(largest)}{_first_failure(result, first[0])}"
        lines.append(("first failure", text))
        if not math.isnan(first[0].force):
            lines.append(("", search_for(*FAILURE_EVENT)))
    elif largest and count:
        lines.append(("first failure", no_failure(largest, end_of(result))))
    if left_out := np.count_nonzero(result["failure/under_load"]) * result.symmetry_factor:
        lines.append(("left out", f"{left_out} points under the load or at corners of supports"))
    return lines


def _first_failures(result: Stored) -> list[FirstFailure]:
    """Return the first time at which each criterion reaches 1; empty without FAIL."""
    if "exposures/exposure" not in result:
        return []
    return first_failures(result)


def _first_failure(result: Stored, first: FirstFailure) -> str:
    """Format the first failure: mode, place, time, and force and energy of an impact."""
    quantity = partial(_quantity, result)
    texts = [
        point_in_words(first),
        f"time {quantity(first.time, 'time')}, "
        f"between {significant(first.earliest)} and {significant(first.latest)}",
    ]
    if not math.isnan(first.force):
        texts.append(f"force {quantity(first.force, 'force')}")
        texts.append(f"the projectile has given up {quantity(first.energy, 'force*length')}")
    return ", ".join(texts)


def _exposure(result: Stored, largest: LargestExposure) -> str:
    """Format the largest exposure of a criterion with its place and time."""
    least = "at least " if end_of(result) in OPEN_PEAKS else ""
    return (
        f"{least}{largest.exposure:.4g}: {largest.mode}, "
        f"{largest.where} at ({significant(largest.x)}, {significant(largest.y)}), "
        f"time {_quantity(result, largest.time, 'time')}{_mirrors(result, largest)}{_band(largest)}"
    )


def _mirrors(result: Stored, largest: LargestExposure) -> str:
    """Say how many other points have the same exposure."""
    count = largest.mirrors
    if result.symmetry_factor > 1:
        return ", and the points that mirror it"
    return f", and {count} point{'s' if count > 1 else ''} that mirror{'s' * (count == 1)} it" * (
        count > 0
    )


def _band(largest: LargestExposure) -> str:
    """Format the exposures that finer meshes may give."""
    return "" if largest.band is None else f"; {finer_meshes(largest.band, '{:.3g}'.format)}"


def _at_rest(largest: LargestExposure) -> str:
    """Format the exposure of residual stresses, which makes exposure and load not proportional."""
    if largest.at_rest is None:
        return ""
    text = f"; at rest {largest.at_rest:.3g}"
    if largest.load_factor is None or not math.isfinite(largest.load_factor):
        return text
    return f"{text}, 1 at {largest.load_factor:.4g} of the load's stresses"


def threshold_in_words(result: Stored) -> str:
    """Return the threshold of delamination, and from which number of delaminations it is."""
    threshold = result.threshold
    force = _quantity(result, float(threshold["force"]), "force")
    return f"{from_threshold(threshold.get('number'))} {force}"


def threshold_verdict(result: Stored) -> str:
    """Say whether the threshold of delamination is reached."""
    time = float(result.threshold["time"])
    reached = f"at time {_quantity(result, time, 'time')}" if math.isfinite(time) else ""
    margin = metrics_of(result).get("threshold_margin", 1.0)
    return threshold_outcome(reached, end_of(result), margin)


def _quantity(result: Stored, value: float, dimension: str, digits: int = DIGITS) -> str:
    return shown_quantity(value, unit_of(dimension, result.units), digits)


def _impact(result: Stored) -> list[Row]:
    """Return rows about forces, contacts, indentation and energy of an impact."""
    lines = [*_before_impact(result), ("peak force", _peak_force(result))]
    if intervals := _intervals(result):
        indentation, w = result["history/indentation"], result["history/plate_w"]
        lines += [
            ("contact", _contacts(result, intervals)),
            ("largest indent", f"{_largest(result, indentation)}, permanent {_left(result)}"),
            ("largest w", f"{_at_least(result)}{_largest(result, w, ' under the load')}"),
        ]
        if not math.isnan(metrics_of(result)["rebound_velocity"]):
            lines.append(("rebound", _rebound(result)))
            lines.append(("contact loop", _contact_loop(result)))
    return [*lines, ("energy balance", _energy_balance(result))]


def _before_impact(result: Stored) -> list[Row]:
    """Return the row about a plate that a static load has deflected before the impact."""
    start = start_w_of(result)
    energy = result.symmetry_factor * result.attributes_of("energy").get(INITIAL_PLATE, 0.0)
    if not (start or energy):
        return []
    deflection = f"w {_quantity(result, start, 'length')} under the load"
    text = f"{deflection}, strain energy {_quantity(result, energy, 'force*length')}"
    return [("before impact", f"{text}, which is not impact energy")]


def _peak_force(result: Stored) -> str:
    """Format the peak force, its time and step, and its doubts."""
    force, time = result.whole("history/force"), result["history/time"]
    peak = int(np.argmax(force))
    text = "0: there was no contact"
    if force[peak] > 0.0:
        when = _quantity(result, time[peak], "time")
        text = f"{_quantity(result, force[peak], 'force')} at time {when} (step {peak + 1})"
        if (end := end_of(result)) in OPEN_PEAKS:
            text = f"at least {text}, as the run ends {ENDS[end].brief}"
        text += later_contact(result)
    doubt = elastic_doubt(result, float(force[peak]))
    return f"{text} ({doubt})" if doubt else text


def later_contact(result: Stored) -> str:
    """Name the contact of the peak force, and the first contact's peak, if it is later."""
    metrics = metrics_of(result)
    if not metrics["peak_contact"] > 1:
        return ""
    first = _quantity(result, metrics["first_peak"], "force")
    return f", in contact {metrics['peak_contact']}; {first} in the first"


def _at_least(result: Stored) -> str:
    """Say that the largest deflection is a lower bound, where the plate can still exceed it."""
    return "at least " if math.isnan(metrics_of(result)["max_deflection"]) else ""


def _intervals(result: Stored) -> list[tuple[float, float]]:
    """Return the first and the last time of every contact."""
    force, time = result["history/force"], result["history/time"]
    edges = np.flatnonzero(np.diff(np.concatenate(([0], force > 0.0, [0])).astype(int)))
    return list(zip(time[edges[::2]], time[edges[1::2] - 1], strict=True))


def _contacts(result: Stored, intervals: list[tuple[float, float]]) -> str:
    """Format the times of the contacts."""
    texts = [
        f"{significant(begin)} to {_quantity(result, end, 'time')}"
        for begin, end in intervals[:LISTED]
    ]
    if len(intervals) > LISTED:
        texts.append(f"and {len(intervals) - LISTED} more")
    if result.still_in_contact:
        if len(intervals) <= LISTED:
            texts[-1] = f"from {_quantity(result, intervals[-1][0], 'time')}"
        texts[-1] += ", still in contact at the end"
    return ", ".join(texts)


def _largest(result: Stored, lengths: Floats, where: str = "") -> str:
    """Format the largest of the lengths of every step, and its time."""
    time = result["history/time"][lengths.argmax()]
    value = _quantity(result, lengths.max(), "length")
    return f"{value}{where} at time {_quantity(result, time, 'time')}"


def _left(result: Stored) -> str:
    """Format the permanent indentation."""
    if end_of(result) is not End.OVER:
        return "open"
    permanent = float(result.attributes_of("history")["permanent_indentation"])
    text = _quantity(result, permanent, "length")
    return text if permanent else f"{text} by the contact law"


def _rebound(result: Stored) -> str:
    """Format the velocity and the energy that the projectile has left."""
    metrics = metrics_of(result)
    return (
        f"{_quantity(result, metrics['rebound_velocity'], 'length/time')}, "
        f"impulse {_quantity(result, metrics['impulse'], 'force*time')}, "
        f"{_quantity(result, metrics['energy_absorbed'], 'force*length')} "
        "absorbed (left in plate, indentation and projectile)"
    )


def _contact_loop(result: Stored) -> str:
    """Format the work that the indentation keeps, and its share of the impact energy."""
    work = metrics_of(result)["contact_loop"]
    if abs(work) <= np.abs(result.whole("energy/balance_error")).max():  # of an elastic law
        return f"{_quantity(result, 0.0, 'force*length')} kept by the indentation"
    share = f"{work / impact_energy(result):.1%} of the impact energy"
    return f"{_quantity(result, work, 'force*length')} kept by the indentation, {share}"


def _energy_balance(result: Stored) -> str:
    """Format the largest error of the energy balance, relative to the impact energy."""
    initial = impact_energy(result)
    worst = float(np.abs(result.whole("energy/balance_error")).max())
    share = f"{worst / initial:.2g} of the initial" if initial else f"{worst:.3g}, initially"
    return f"worst error {share} {_quantity(result, initial, 'force*length')}"


def elastic_doubt(result: Stored, peak: float) -> str:
    """Say why a peak force is only an elastic prediction; empty if it may be real."""
    beyond = []
    if result.threshold and peak > THRESHOLD.value * float(result.threshold["force"]):
        beyond.append(f"delamination is expected {threshold_in_words(result)}")
    if any(exposure.exposure > EXPOSURE.value for exposure in largest_exposures(result)):
        beyond.append("the first ply fails before")
    return f"elastic prediction; {', and '.join(beyond)}" if beyond else ""


def run_text(result: Stored) -> list[str]:
    """Return title, summary and notes, as ``fecm run`` prints them."""
    notes = label_lines(("note", note) for note in result.notes)
    lines = [*(_missing(result) or run_summary(result)), *notes]
    return [result.title or "(no title)", *(f"  {line}" for line in lines)]


def about_run(result: Stored) -> RunJson:
    """Return steps, first and last time, metrics and summary of a run."""
    steps = len(result["history/time"]) if "history/time" in result else 0
    missing = _missing(result)
    return {
        "steps": steps,
        "time": result["history/time"][[0, -1]].tolist() if steps else None,
        "still_in_contact": result.still_in_contact,
        "end": None if missing else end_of(result),
        "validity": result.validity,
        "notes": list(result.notes),
        "metrics": {} if missing else _metrics(result),
        "summary": missing or run_summary(result),
    }


def _metrics(result: Stored) -> MetricsJson:
    """Return the impact metrics, and the metrics of FAIL under ``failure``."""
    if "failure/x" not in result:
        return cast("MetricsJson", metrics_of(result))
    metrics = {**metrics_of(result), "failure": failure_metrics(result)}
    return cast("MetricsJson", metrics)


def _missing(result: Stored) -> list[str]:
    """Return the reason why an incomplete file has no summary; empty if it has one."""
    needed = ("history/time", "history/indentation", "history/plate_w", "energy/balance_error")
    if "history/force" in result:
        if not len(result["history/force"]) or any(name not in result for name in needed):
            return ["no summary: history or energies are not complete"]
        permanent = result.attributes_of("history").get("permanent_indentation")
        initial = result.attributes_of("energy").get("initial")
        if not all(isinstance(value, int | float) for value in (permanent, initial)):
            return ["no summary: permanent_indentation or the initial energy is missing"]
    return []
