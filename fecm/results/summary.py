"""Summary of a run: the line that answers, rows in groups, and notes."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, Annotated, TypedDict, cast

import numpy as np

from fecm._table import Row, Summary, Table, label_lines
from fecm._text import DECK_DIGITS, DIGITS, significant
from fecm._typing import Floats
from fecm.deck.units import quantity as shown_quantity
from fecm.deck.units import unit_of
from fecm.judge.criteria import failure_in_words, spelt
from fecm.judge.end import ENDS, OPEN_PEAKS, End
from fecm.judge.exposures import (
    LargestExposure,
    finer_meshes,
    no_failure,
    on_this_mesh,
    point_in_words,
)
from fecm.judge.limits import BALANCED, EXPOSURE, FAIL_EVALUATIONS, THRESHOLD
from fecm.judge.threshold import from_threshold, threshold_outcome
from fecm.judge.validity import reasons_of
from fecm.results.exposures import (
    FailureJson,
    evaluations_in_contact,
    failure_metrics,
    first_failures,
    largest_exposures,
)
from fecm.results.metrics import INITIAL_PLATE
from fecm.results.onset import energy_at_force
from fecm.results.run_metrics import end_of, impact_energy, metrics_of, start_w_of
from fecm.results.stored import Stored, whole_plate

if TYPE_CHECKING:
    from fecm.results.exposures import FirstFailure


class SupportsJson(TypedDict):
    """Largest values of springs, one-sided supports and restraints of w, in JSON."""

    push: Annotated[float, "Sum of the forces on w against the push."]
    pull: Annotated[float, "Sum of the forces on w along the push."]
    lift: Annotated[float, "Distance of the plate from a one-sided support."]


class MetricsJson(TypedDict, total=False):
    """Metrics of a run in JSON: numbers by name, and what FAIL found."""

    failure: Annotated[FailureJson, "Of decks with FAIL."]
    supports: Annotated[SupportsJson, "Largest values, of decks with SPRI or UNIL and DISP."]


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
    answer: Annotated[str, "The summary in one line."]
    summary: list[str]


NEAR = 0.05  # distance of a row from the peak, over its time, that counts as the peak
RUN = "Run"  # heading of the group about steps and files
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


def summary_of_run(result: Stored) -> Summary:
    """Return answer, groups of rows and notes of a result, in the deck's units."""
    title, notes = result.title or "(no title)", tuple(result.notes)
    if missing := _missing(result):
        return Summary(title, missing, (), notes)
    groups = (
        Table(tuple(_response(result)), title="Response"),
        Table(tuple(_damage(result)), title="Damage"),
        Table(tuple(_model(result)), title="Model"),
        Table(tuple(_steps(result)), title=RUN),
    )
    return Summary(title, run_answer(result), groups, notes)


def run_summary(result: Stored) -> list[str]:
    """Return the rows of :func:`summary_of_run` as lines of text."""
    summary = summary_of_run(result)
    return label_lines(summary.rows) or [summary.answer]


def run_table(result: Stored) -> Table:
    """Return the rows of :func:`summary_of_run` as one table."""
    summary = summary_of_run(result)
    return Table(summary.rows, title=summary.title)


def run_answer(result: Stored) -> str:
    """Say in one line what happened: peak force, delamination, first failure."""
    if "history/force" in result:
        parts = [_peak_answer(result)]
    else:
        (label, text), *_ = [*_response(result), ("nothing was stored", "")]
        parts = [f"{label} {text}".rstrip()]
    if result.threshold:
        parts.append(_delamination_answer(result))
    parts += [*_failure_answer(result), *_doubt_answer(result)]
    answer = "; ".join(parts)
    return f"{answer[0].upper()}{answer[1:]}"


def _peak_answer(result: Stored) -> str:
    """Say how large the peak force is, and whether it is an elastic prediction."""
    peak = float(result.whole("history/force").max())
    if not peak > 0.0:
        return "there was no contact"
    least = "at least " if end_of(result) in OPEN_PEAKS else ""
    doubt = " (elastic)" if elastic_doubt(result, peak) else ""
    return f"peak force {least}{_quantity(result, peak, 'force')}{doubt}"


def _delamination_answer(result: Stored) -> str:
    """Say whether the plate delaminates, and from which force and energy."""
    threshold = float(result.threshold["force"])
    force = _quantity(result, threshold, "force")
    if energy := _scaled_energy(result, threshold):
        force = f"{force} ({energy})"
    if math.isfinite(float(result.threshold["time"])):
        return f"delaminates, {from_threshold(result.threshold.get('number'))} {force}"
    return f"delamination threshold of {force} {threshold_verdict(result)}"


def _scaled_energy(result: Stored, force: float) -> str:
    """Format the impact energy whose peak force is `force`, scaled from the run.

    The text is empty if the energy is not known.
    """
    energy = energy_at_force(result, force)
    return "" if math.isnan(energy) else f"about {_quantity(result, energy, 'force*length', 3)}"


def _failure_answer(result: Stored) -> list[str]:
    """Say where and from which force the first failure is; empty without FAIL."""
    largest = largest_exposures(result)
    if not largest:
        return []
    if not (first := _first_failures(result)):
        most = max(exposure.exposure for exposure in largest)
        return [f"failure: {no_failure(largest, end_of(result))} (largest exposure {most:.3g})"]
    failure = first[0]
    words = failure_in_words(failure.criterion, failure.mode, failure.where)
    at = "" if math.isnan(failure.force) else f", at {_quantity(result, failure.force, 'force')}"
    return [f"first failure: {on_this_mesh(largest)}{words}{at}"]


def _doubt_answer(result: Stored) -> list[str]:
    """Say which limits of the model are exceeded, besides what the other parts say."""
    said = {EXPOSURE.reason, THRESHOLD.reason, *(ENDS[end].reason for end in OPEN_PEAKS)}
    doubts = [reason for reason in reasons_of(result.validity) if reason not in said]
    return [f"doubtful: {', '.join(doubts)}"] if doubts else []


def _response(result: Stored) -> list[Row]:
    """Return rows about force, contact, indentation, deflection and energy, and frequencies."""
    rows: list[Row] = []
    if "history/force" in result:
        rows += _impact(result)
    elif "tape3/w" in result and (w := result["tape3/w"]).any():
        row, node = np.unravel_index(int(np.abs(w).argmax()), w.shape)
        text = f"{_quantity(result, w[row, node], 'length')} at node {node + 1}"
        rows.append(("largest w", text))
    elif "tape3/w" in result:
        rows.append(("largest w", "0: nothing moved the plate"))
    if text := _membrane(result):
        rows.append(("membrane", text))
    if largest := largest_of_supports(result):
        rows.append(("supports", _supports(result, largest)))
    if "modes/angular_frequency" in result:
        frequencies = result["modes/angular_frequency"]
        texts = ", ".join(significant(omega) for omega in frequencies[:LISTED])
        more = f" and {len(frequencies) - LISTED} more" if len(frequencies) > LISTED else ""
        unit = result.unit("modes/angular_frequency")
        rows.append(("frequencies", f"{texts}{more} {unit}".rstrip()))
    return rows


def _damage(result: Stored) -> list[Row]:
    """Return rows about delamination, first failure and exposures."""
    rows: list[Row] = []
    if result.threshold:
        rows.append(("delamination", _delamination(result)))
        if energy := _scaled_energy(result, float(result.threshold["force"])):
            rows.append(("", f"{energy} of impact energy for it, scaled from this run"))
        if math.isfinite(float(result.threshold["time"])):
            rows.append(("", search_for(*THRESHOLD_EVENT)))
    if "failure/x" in result:
        rows += _exposures(result)
    return rows


def _model(result: Stored) -> list[Row]:
    """Return rows about parts, symmetry, curvature, preload and the load before the impact."""
    rows: list[Row] = [
        (what, f"{result.attributes[name]}, instead of {card}")
        for name, what, card in OWN_PARTS
        if name in result.attributes
    ]
    if text := whole_plate(result.symmetry_factor):
        rows.append(("symmetry", text))
    rows += [*_curved(result), *_preload(result)]
    if "history/force" in result:
        rows += _before_impact(result)
    return rows


def _steps(result: Stored) -> list[Row]:
    """Return rows about the steps, and an energy balance that is off."""
    rows: list[Row] = []
    clock = "history/time" if "history/force" in result else "energy/time"
    if clock in result:
        time = result[clock]
        until = _quantity(result, time[-1], "time")
        rows.append(("steps", f"{len(time)}, up to time {until}"))
    if "history/force" in result:
        rows += _energy_balance(result)
    return rows


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


def largest_of_supports(result: Stored) -> SupportsJson | None:
    """Return the largest forces of the supports, and the lift; None if they are not stored."""
    if "supports/push" not in result or not result["supports/push"].size:
        return None
    push, pull, lift = (
        float(result.whole(f"supports/{name}").max()) for name in ("push", "pull", "lift")
    )
    return {"push": push, "pull": pull, "lift": lift}


def _supports(result: Stored, largest: SupportsJson) -> str:
    """Say how hard the supports push and pull, and how far the plate lifts off."""
    push, pull = (_quantity(result, largest[name], "force") for name in ("push", "pull"))
    pulls = "do not pull"
    if largest["pull"]:
        peak = float(result.whole("history/force").max()) if "history/force" in result else 0.0
        share = f" ({largest['pull'] / peak:.0%} of the peak force)" if peak else ""
        pulls = f"pull with {pull}{share}"
    lift = f", the plate lifts off by {_quantity(result, largest['lift'], 'length')}"
    return f"push with {push}, {pulls}{lift if largest['lift'] else ''}"


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
    """Return rows about the first failure and the largest exposures."""
    largest, first = largest_exposures(result), _first_failures(result)
    count = evaluations_in_contact(result)
    rows: list[Row] = []
    if first:
        text = f"{on_this_mesh(largest)}{_first_failure(result, first[0])}"
        rows.append(("first failure", text))
        if not math.isnan(first[0].force):
            rows.append(("", search_for(*FAILURE_EVENT)))
    elif largest and count:
        rows.append(("first failure", no_failure(largest, end_of(result))))
    reached = {
        failure.criterion: failure.force for failure in first if not math.isnan(failure.force)
    }
    for exposure in largest:
        force = reached.get(exposure.criterion)
        reaches = "" if force is None else f"; reaches 1 at {_quantity(result, force, 'force')}"
        text = f"{_exposure(result, exposure)}{reaches}{_at_rest(exposure)}"
        rows.append((spelt(exposure.criterion), text))
    if count is not None and "history/force" in result and count < FAIL_EVALUATIONS.value:
        rows.append(("evaluations", f"{count} of FAIL during contact"))
    if left_out := np.count_nonzero(result["failure/under_load"]) * result.symmetry_factor:
        rows.append(("left out", f"{left_out} points under the load or at corners of supports"))
    return rows


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
    rows: list[Row] = [("peak force", _peak_force(result))]
    if intervals := _intervals(result):
        indentation, w = result["history/indentation"], result["history/plate_w"]
        rows += [
            ("contact", _contacts(result, intervals)),
            ("largest w", f"{_at_least(result)}{_largest(result, w, ' under the load')}"),
            ("largest indent", f"{_largest(result, indentation)}{_left(result)}"),
        ]
    rows.append(("energy", _energy(result)))
    if not math.isnan(metrics_of(result)["rebound_velocity"]):
        rows.append(("rebound", _rebound(result)))
    return [*rows, *_contact_loop(result)]


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
    """Format the permanent indentation; empty if the contact law has none."""
    if end_of(result) is not End.OVER:
        return ", permanent open"
    permanent = float(result.attributes_of("history")["permanent_indentation"])
    return f", permanent {_quantity(result, permanent, 'length')}" if permanent else ""


def _energy(result: Stored) -> str:
    """Format the impact energy, and how much of it the projectile has left behind."""
    text = _quantity(result, impact_energy(result), "force*length")
    absorbed = metrics_of(result)["energy_absorbed"]
    if math.isnan(absorbed):
        return text
    left = _quantity(result, absorbed, "force*length")
    return f"{text}, {left} absorbed (left in plate, indentation and projectile)"


def _rebound(result: Stored) -> str:
    """Format the velocity of the projectile after the impact, and its impulse."""
    metrics = metrics_of(result)
    velocity = _quantity(result, metrics["rebound_velocity"], "length/time")
    return f"{velocity}, impulse {_quantity(result, metrics['impulse'], 'force*time')}"


def keeps_work(result: Stored) -> bool:
    """Return whether the indentation keeps work, beyond rounding; an elastic law keeps none."""
    work = metrics_of(result).get("contact_loop", math.nan)
    if math.isnan(work):
        return False
    return bool(abs(work) > np.abs(result.whole("energy/balance_error")).max(initial=0.0))


def _contact_loop(result: Stored) -> list[Row]:
    """Return the row of the work that the indentation keeps, which an elastic law does not."""
    work = metrics_of(result)["contact_loop"]
    if not keeps_work(result):
        return []
    share = f"{work / impact_energy(result):.1%} of the impact energy"
    kept = _quantity(result, work, "force*length")
    return [("contact loop", f"{kept} kept by the indentation, {share}")]


def _energy_balance(result: Stored) -> list[Row]:
    """Return the row of the largest error of the energy balance, if it is doubtful."""
    initial = impact_energy(result)
    worst = float(np.abs(result.whole("energy/balance_error")).max())
    if worst <= BALANCED * initial:
        return []
    share = f"{worst / initial:.2g} of the initial" if initial else f"{worst:.3g}, initially"
    text = f"worst error {share} {_quantity(result, initial, 'force*length')}"
    return [("energy balance", text)]


def elastic_doubt(result: Stored, peak: float) -> str:
    """Say why a peak force is only an elastic prediction; empty if it may be real."""
    beyond = []
    if result.threshold and peak > THRESHOLD.value * float(result.threshold["force"]):
        beyond.append(f"delamination is expected {threshold_in_words(result)}")
    if any(exposure.exposure > EXPOSURE.value for exposure in largest_exposures(result)):
        beyond.append("the first ply fails before")
    return f"elastic prediction; {', and '.join(beyond)}" if beyond else ""


def about_run(result: Stored) -> RunJson:
    """Return steps, first and last time, metrics and summary of a run."""
    steps = len(result["history/time"]) if "history/time" in result else 0
    missing, summary = _missing(result), summary_of_run(result)
    return {
        "steps": steps,
        "time": result["history/time"][[0, -1]].tolist() if steps else None,
        "still_in_contact": result.still_in_contact,
        "end": None if missing else end_of(result),
        "validity": result.validity,
        "notes": list(result.notes),
        "metrics": {} if missing else _metrics(result),
        "answer": summary.answer,
        "summary": run_summary(result),
    }


def _metrics(result: Stored) -> MetricsJson:
    """Return the metrics of the impact, of FAIL and of the supports."""
    metrics = cast("MetricsJson", dict(metrics_of(result)))
    if "failure/x" in result:
        metrics["failure"] = failure_metrics(result)
    if largest := largest_of_supports(result):
        metrics["supports"] = largest
    return metrics


def _missing(result: Stored) -> str:
    """Return the reason why an incomplete file has no summary; empty if it has one."""
    needed = ("history/time", "history/indentation", "history/plate_w", "energy/balance_error")
    if "history/force" in result:
        if not len(result["history/force"]) or any(name not in result for name in needed):
            return "no summary: history or energies are not complete"
        permanent = result.attributes_of("history").get("permanent_indentation")
        initial = result.attributes_of("energy").get("initial")
        if not all(isinstance(value, int | float) for value in (permanent, initial)):
            return "no summary: permanent_indentation or the initial energy is missing"
    return ""
