"""First sheet of the page of a run: answers, headline figures, and what limits them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from functools import partial

from fecm._table import Cell, ShownNumber
from fecm._text import significant
from fecm.deck import model
from fecm.deck.layup import layup_text
from fecm.deck.units import (
    MASS,
    mass_in_si,
    prefixed,
    quantity,
    uncertain,
    unit_names,
    unit_of,
)
from fecm.judge.criteria import INTERLAMINAR, spelt
from fecm.judge.end import OPEN_PEAKS
from fecm.judge.exposures import (
    FINER_MESHES_DECIDE,
    FailureVerdict,
    failure_verdict,
    no_failure,
)
from fecm.judge.limits import THRESHOLD, Judgement, TrustLevel
from fecm.judge.threshold import from_threshold
from fecm.problem.estimates import MOST_ERROR, resolution
from fecm.problem.problem import Problem
from fecm.report.content import UNKNOWN, Answer, Headline
from fecm.report.subject import impactor, plate_extent
from fecm.results.exposures import FirstFailure, first_failures, largest_exposures
from fecm.results.onset import energy_at_force
from fecm.results.result import Result
from fecm.results.summary import elastic_doubt, later_contact, threshold_verdict

DIGITS = 3  # of headline figures
ENERGY_DIGITS = 2  # of energies that are scaled from one run
SCALED = "±4 %, scaled from this run"


def has_impact(result: Result) -> bool:
    """Return whether a result has steps with a contact force."""
    return "history/force" in result and len(result["history/force"]) > 0


def scene(result: Result, problem: Problem) -> str:
    """Say what hits what, and how hard."""
    deck, units = problem.deck, unit_names(problem.deck)
    hits = impactor(result, deck)
    if hits is None:
        return ""
    mass = mass_in_si(hits.mass, units) or quantity(hits.mass, unit_of(MASS, units))
    speed = f"{hits.velocity:.4g} {unit_of('length/time', units)}".rstrip()
    energy = quantity(hits.energy, unit_of("force*length", units))
    layup = layup_text([layer.angle for layer in deck.require(model.Material).layers])
    thickness = f"{problem.laminate.thickness:.4g} {unit_of('length', units)}".rstrip()
    return (
        f"A mass of {mass} at {speed} ({energy}) on a plate of {plate_extent(problem)}, "
        f"{thickness} of {layup}"
    )


def answers(result: Result) -> Iterator[Answer]:
    """Answer whether the plate delaminates, and which ply fails first."""
    if has_impact(result):
        yield Answer("Delaminates", *_delamination(result))
    yield Answer("First failure", *_first_ply(result))


def _delamination(result: Result) -> tuple[str, str]:
    if not result.threshold:
        return "NOT JUDGED", ", as the deck has no DELA."
    force = float(result.threshold["force"])
    largest = float(result.whole("history/force").max(initial=0.0))
    energy = energy_at_force(result, force)
    words = from_threshold(result.threshold.get("number"))
    if largest > THRESHOLD.value * force:
        about = f"about {_energy(result, energy)}"
        at = _headline(result, force, "force") if math.isnan(energy) else about
        return "YES", f", {words} {at} on."
    answer = "OPEN" if result.end in OPEN_PEAKS else "NO"
    return answer, f", the threshold is {threshold_verdict(result)}."


def _first_ply(result: Result) -> tuple[str, str]:
    largest = largest_exposures(result)
    if not largest:
        return "NOT JUDGED", ", as the deck has no FAIL."
    is_open = failure_verdict(largest) is FailureVerdict.OPEN
    first = next(iter(first_failures(result)), None)
    if first is None:
        is_open |= result.end in OPEN_PEAKS
        return (
            "OPEN" if is_open else "NONE",
            f": {no_failure(largest, result.end)}." if is_open else ".",
        )
    energy = energy_at_force(result, first.force)
    from_energy = "" if math.isnan(energy) else f", from about {_energy(result, energy)} on"
    on_mesh = f"; {FINER_MESHES_DECIDE}" if is_open else ""
    words = f"{first.mode} ({spelt(first.criterion)})"
    return first.where, f", {words}{from_energy}{on_mesh}."


def headlines(result: Result, problem: Problem | None) -> list[Headline]:
    """Return the six figures of an impact."""
    return [
        _peak(result, _mesh_error(problem)),
        *_threshold(result),
        _contact(result),
        _deflection(result, problem),
        _failure(result),
    ]


def _mesh_error(problem: Problem | None) -> float | None:
    """Return the estimated mesh error of the peak, relative to it; None if it is not known."""
    waves = None if problem is None or not problem.has_impact else resolution(problem)
    error = None if waves is None else waves.error
    return None if error is None or error > MOST_ERROR else error


def _peak(result: Result, mesh_error: float | None) -> Headline:
    force, times = result.whole("history/force"), result["history/time"]
    peak, unit = float(force.max()), unit_of("force", result.units)
    remarks = [f"at {_headline(result, float(times[force.argmax()]), 'time')}"]
    if later := later_contact(result):
        remarks.append(later.removeprefix(", "))
    if elastic_doubt(result, peak):
        remarks.append("elastic prediction")
    text = prefixed(peak, unit, DIGITS)
    if mesh_error is not None:
        text = uncertain(peak, mesh_error * peak, unit)
        remarks.append("uncertainty of the mesh")
    at_least = "at least " if result.end in OPEN_PEAKS else ""
    return Headline("peak force", ShownNumber(peak, f"{at_least}{text}"), tuple(remarks))


def _threshold(result: Result) -> list[Headline]:
    """Return the threshold force and the impact energy that reaches it."""
    if not result.threshold:
        no_card = ("the deck has no DELA",)
        return [
            Headline("threshold", UNKNOWN, no_card),
            Headline("energy for it", UNKNOWN),
        ]
    threshold = result.threshold
    force, number = float(threshold["force"]), threshold.get("number")
    remarks = ["one delamination" if number == 1 else f"{number} delaminations"]
    band = threshold.get("band")
    if number == 1 and isinstance(band, list) and len(band) == 2:
        remarks.append(f"{_headline(result, float(band[0]), 'force')} if all interfaces do")
    energy = energy_at_force(result, force)
    about = [] if math.isnan(energy) else [SCALED]
    between = [f for f in first_failures(result) if f.criterion == INTERLAMINAR]
    for failure in between:
        if failure.force < force and not math.isnan(at := energy_at_force(result, failure.force)):
            about.append(f"interface fails from {_energy(result, at)}")
    shown: Cell = UNKNOWN
    if not math.isnan(energy):
        shown = ShownNumber(energy, _energy(result, energy))
    elif result.end not in OPEN_PEAKS:
        about = ["fecm estimate has it"]
    return [
        Headline("threshold", _cell(result, force, "force"), tuple(remarks)),
        Headline("energy for it", shown, tuple(about)),
    ]


def _contact(result: Result) -> Headline:
    duration, contacts = result.metrics["contact_time"], result.metrics["contacts"]
    if math.isnan(duration):
        return Headline("contact", UNKNOWN, ("not over at the end of the run",))
    count = f"{contacts:.0f} contacts" if contacts > 1 else "one contact"
    return Headline("contact", _cell(result, duration, "time"), (count,))


def _deflection(result: Result, problem: Problem | None) -> Headline:
    deflection = result.metrics["max_deflection"]
    remarks = []
    if math.isnan(deflection):
        deflection = float(result["history/plate_w"].max(initial=0.0))
        remarks.append("at least, by the end of the run")
    if problem is not None:
        remarks.insert(0, f"{deflection / problem.laminate.thickness:.2f} h")
    return Headline("deflection", _cell(result, deflection, "length"), tuple(remarks))


def _failure(result: Result) -> Headline:
    name = "first ply fails"
    if not largest_exposures(result):
        return Headline(name, UNKNOWN, ("the deck has no FAIL",))
    first = next(iter(first_failures(result)), None)
    if first is None:
        return Headline(name, "no", (f"exposure {_largest(result)}",))
    remarks = []
    if not math.isnan(energy := energy_at_force(result, first.force)):
        remarks.append(f"from {_energy(result, energy)}{_finer_meshes(result, first)}")
    return Headline(name, _cell(result, first.force, "force"), (first.where, *remarks))


def _largest(result: Result) -> str:
    return significant(max(e.exposure for e in largest_exposures(result)), DIGITS)


def _finer_meshes(result: Result, first: FirstFailure) -> str:
    """Return, in brackets, the energies at which finer meshes may reach the first failure.

    The exposure is taken as proportional to the force.
    """
    largest = next(e for e in largest_exposures(result) if e.criterion == first.criterion)
    if largest.band is None or not 0.0 < largest.band[0] <= largest.band[1] < math.inf:
        return ""
    forces = [first.force * largest.exposure / end for end in reversed(largest.band)]
    low, high = (energy_at_force(result, force) for force in forces)
    if math.isnan(low) or math.isnan(high):
        return ""
    return f" ({_energy(result, low)} to {_energy(result, high)})"


def limits(notes: Iterable[str], judged: Iterable[Judgement]) -> list[str]:
    """Return what limits the figures, the worst first: the notes, and judgements without a note."""
    lines: dict[TrustLevel, list[str]] = {TrustLevel.OUTSIDE: [], TrustLevel.DOUBTFUL: []}
    for judgement in judged:
        if judgement.level in lines and not judgement.noted:
            size = judgement.size if isinstance(judgement.size, str) else judgement.size.text
            text = f"{judgement.name}: {size}"
            lines[judgement.level].append("; ".join(filter(None, [text, judgement.words])))
    return [*lines[TrustLevel.OUTSIDE], *notes, *lines[TrustLevel.DOUBTFUL]]


def _cell(result: Result, value: float, dimension: str) -> Cell:
    return UNKNOWN if math.isnan(value) else ShownNumber(value, _headline(result, value, dimension))


def _headline(result: Result, value: float, dimension: str, digits: int = DIGITS) -> str:
    return prefixed(float(value), unit_of(dimension, result.units), digits)


_energy = partial(_headline, dimension="force*length", digits=ENERGY_DIGITS)
