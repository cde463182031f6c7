"""Page about the results of runs: one run in full, or several side by side."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from fecm._table import Cell, Row, ShownNumber
from fecm.deck import model
from fecm.deck.layup import layup_text
from fecm.deck.units import mass_in_si, unit_names, unit_of
from fecm.judge.criteria import spelt
from fecm.judge.end import OPEN_PEAKS
from fecm.judge.limits import Judgement, TrustLevel
from fecm.judge.threshold import from_threshold
from fecm.problem.problem import Problem
from fecm.report import figures
from fecm.report.content import (
    UNKNOWN,
    Judgements,
    PageBlock,
    PageSection,
    ReportPage,
    listing,
    note_list,
    number_with_unit,
    page_table,
    sections,
    share,
    worst,
)
from fecm.report.first_sheet import answers, has_impact, headlines, limits, scene
from fecm.report.measured_force import compare_forces, overlay_of, with_measured_force
from fecm.report.model import of_problem
from fecm.report.sources import assumptions, command_of, short_deck, sources
from fecm.report.subject import impactor, plate_extent
from fecm.report.trust import deck_problem, judgements
from fecm.results.exposures import first_failures, largest_exposures, threshold_energy
from fecm.results.metrics import INTEGERS, METRICS, THRESHOLD
from fecm.results.onset import energy_at_force
from fecm.results.result import Result
from fecm.results.stored import whole_plate
from fecm.results.summary import (
    elastic_doubt,
    keeps_work,
    lowest_criterion,
    radii_of,
    run_answer,
    run_table,
)
from fecm.results.written import PageOptions

WORDS = {
    TrustLevel.WITHIN: "All quantities are within the range of the model.",
    TrustLevel.DOUBTFUL: "Some quantities are doubtful: see Trust.",
    TrustLevel.OUTSIDE: "Some quantities are outside the range of the model: see Trust.",
}


def run_page(
    results: Mapping[str, Result], digests: Mapping[str, str], options: PageOptions
) -> ReportPage:
    """Return the page about the results of one or more runs.

    Parameters
    ----------
    results : mapping of str to Result
        Results by name.
    digests : mapping of str to str
        SHA-256 of the files of results, by name; those in memory have none.
    options : PageOptions
        Whether the decks are shown in full.
    """
    loaded = {name: deck_problem(result) for name, result in results.items()}
    problems = {name: problem for name, (problem, _) in loaded.items()}
    judged = {name: list(judgements(result, problems[name])) for name, result in results.items()}
    compared = compare_forces(results, options)
    level = worst(judgement for judgements_of in judged.values() for judgement in judgements_of)
    if level is TrustLevel.WITHIN and any(result.notes for result in results.values()):
        level = TrustLevel.DOUBTFUL
    if len(results) == 1:
        ((name, result),) = results.items()
        page = _single(name, result, *loaded[name], judged[name], level, overlay_of(options))
    else:
        title = f"{len(results)} impacts: {', '.join(results)}"
        sentences = (
            f"{name}: {_sentence(judgement, problems[name])}" for name, judgement in results.items()
        )
        body = _several(results, problems, judged, overlay_of(options))
        page = ReportPage(title, (*sentences, WORDS[level]), level, body)
    last = sections([("Deck", _decks(results, digests, full=options.full_deck))])
    if compared is not None:
        page = with_measured_force(page, compared, options)
    return page._replace(sections=(*page.sections, *last))


def _single(
    name: str,
    result: Result,
    problem: Problem | None,
    warnings: list[str],
    judged: list[Judgement],
    level: TrustLevel,
    overlay: Mapping[str, Any],
) -> ReportPage:
    """Return the page about one result, without its deck."""
    named = {name: result}
    trust: list[PageBlock] = [Judgements(tuple(judged))] if judged else []
    trust += note_list(warnings, "Warnings about the deck")
    if not has_impact(result):
        trust += note_list(result.notes, "Notes of the run")
    body = sections(
        [
            ("Assumptions and sources", _sources(result, problem)),
            ("Trust", trust),
            ("Results", [*_results(named), *_threshold(result), *_criteria(result)]),
            ("Pictures", [*figures.of_runs(named), *figures.of_run(name, result)]),
            ("Model", [] if problem is None else of_problem(result, problem)),
        ]
    )
    page = ReportPage(result.title or name, ("No impact: see Results.",), level, body)
    if not has_impact(result):
        return page
    symmetry = whole_plate(result.symmetry_factor)
    parts = [] if problem is None else [scene(result, problem)]
    subject = "; ".join(filter(None, [*parts, symmetry]))
    return page._replace(
        verdict=tuple(answers(result)),
        subject=f"{subject[0].upper()}{subject[1:]}." if subject else "",
        headlines=tuple(headlines(result, problem)),
        first_sheet=(
            *([] if problem is None else figures.arranged(name, result, problem)),
            *figures.force(name, result, **overlay),
            *note_list(limits(result.notes, judged), "What limits these figures, worst first"),
        ),
    )


def _sources(result: Result, problem: Problem | None) -> list[PageBlock]:
    """Return what the model assumes, and the sources of its constants."""
    if problem is None:
        return []
    table = page_table(sources(result, problem), ("constants", "source"), "Sources")
    return [*note_list(assumptions(result, problem)), *table]


def _several(
    results: Mapping[str, Result],
    problems: Mapping[str, Problem | None],
    judged: Mapping[str, list[Judgement]],
    overlay: Mapping[str, Any],
) -> tuple[PageSection, ...]:
    """Return the sections about several results, with a column for each."""
    trust: list[PageBlock] = []
    for name, result in results.items():
        doubts = tuple(
            judgement for judgement in judged[name] if judgement.level is not TrustLevel.WITHIN
        )
        trust += [Judgements(doubts, title=name)] if doubts else []
        trust += note_list(result.notes, f"Notes of {name}")
    models = {name: _model_row(judgement, problems[name]) for name, judgement in results.items()}
    names = list(dict.fromkeys(key for row in models.values() for key in row))
    rows = [(key, *(row.get(key, UNKNOWN) for row in models.values())) for key in names]
    return sections(
        [
            ("Trust", trust),
            ("Results", _results(results)),
            ("Pictures", _common_pictures(results, overlay)),
            ("Model", page_table(rows, ("quantity", *results))),
        ]
    )


def _common_pictures(results: Mapping[str, Result], overlay: Mapping[str, Any]) -> list[PageBlock]:
    """Draw the histories of all results in the same pictures, if their units are the same."""
    if len({tuple(result.units.items()) for result in results.values()}) > 1:
        return note_list(["The results have different units: they have no pictures in common."])
    return [*figures.forces(results, **overlay), *figures.of_runs(results)]


def _model_row(result: Result, problem: Problem | None) -> dict[str, Cell]:
    """Return what distinguishes the models of several results."""
    if problem is None:
        return {}
    deck, units = problem.deck, unit_names(problem.deck)
    layers = deck.require(model.Material).layers
    row: dict[str, Cell] = {
        "plate": plate_extent(problem),
        **({"symmetry": text} if (text := whole_plate(result.symmetry_factor)) else {}),
        "thickness": number_with_unit(problem.laminate.thickness, unit_of("length", units)),
        "layup": layup_text([layer.angle for layer in layers]),
        "kinematics": "von Kármán" if problem.plate.nonlinear else "linear",
        "elements": ShownNumber(deck.control.numel, str(deck.control.numel)),
    }
    if radii := radii_of(result):
        unit = unit_of("length", units)
        named = ", ".join(f"R{axis} {radius:.5g}" for axis, radius in radii.items())
        row["curved panel"] = f"{named} {unit}".rstrip()
    if (hits := impactor(result, deck)) is not None:
        weight = mass_in_si(hits.mass, units) or f"{hits.mass:.5g}"
        row["projectile"] = hits.name
        row["projectile mass"] = ShownNumber(hits.mass, weight)
        row["velocity"] = number_with_unit(hits.velocity, unit_of("length/time", units))
        row["energy"] = number_with_unit(hits.energy, unit_of("force*length", units))
    return row


def _sentence(result: Result, problem: Problem | None) -> str:
    """Say in one sentence what hit what, and what happened."""
    if not has_impact(result):
        return "No impact: see Results."
    what = "" if problem is None else scene(result, problem)
    return f"{': '.join(filter(None, [what, run_answer(result)]))}."


def _results(results: Mapping[str, Result]) -> list[PageBlock]:
    """Return the metrics of impacts, or the summary of a result without impact."""
    if any(result.metrics for result in results.values()):
        return _metrics(results)
    blocks: list[PageBlock] = []
    for name, result in results.items():
        title = f"Summary of {name}" if len(results) > 1 else "Summary"
        blocks.append(replace(run_table(result), title=title))
    return blocks


def _metrics(results: Mapping[str, Result]) -> list[PageBlock]:
    """Return a table of impact metrics with a column for each result."""
    metrics = {name: result.metrics for name, result in results.items()}
    useless = {name: _useless(result, alone=len(results) == 1) for name, result in results.items()}
    rows: list[Row] = []
    if any(result.end in OPEN_PEAKS for result in results.values()):
        bounds = [_lower_bound(result) for result in results.values()]
        rows.append(("largest force by the end", *bounds, "lower bound of the peak force"))
    for key, (description, dimension) in METRICS.items():
        if all(key not in metrics[name] or key in useless[name] for name in results):
            continue
        cells: list[Cell] = []
        for name, result in results.items():
            value = float(metrics[name].get(key, math.nan))
            whole = key in INTEGERS and math.isfinite(value)
            unit = unit_of(dimension, result.units)
            cells.append(
                ShownNumber(value, f"{value:.0f}") if whole else number_with_unit(value, unit)
            )
        if key == "peak_force":
            description = f"{description}{_elastic_peaks(results)}"
        rows.append((key.replace("_", " "), *cells, description))
    return page_table(rows, ("metric", *(results if len(results) > 1 else ("value",)), "meaning"))


def _useless(result: Result, *, alone: bool) -> set[str]:
    """Return the metrics that say nothing about a run, or that a page of it has elsewhere."""
    metrics = result.metrics
    names = {*THRESHOLD} if alone else set()
    if metrics.get("contacts") == 1:
        names |= {"contacts", "peak_contact", "first_peak", "last_contact"}
    if metrics and not keeps_work(result):
        names |= {"contact_loop"}
        names |= {"permanent_indentation"} if metrics["permanent_indentation"] == 0.0 else set()
    return names


def _elastic_peaks(results: Mapping[str, Result]) -> str:
    """List, in brackets, the peaks that are elastic predictions only."""
    doubts = {
        name: elastic_doubt(result, float(result.whole("history/force").max(initial=0.0)))
        for name, result in results.items()
        if "history/force" in result
    }
    texts = [f"{name} {doubt}" for name, doubt in doubts.items() if doubt]
    if len(results) == 1:
        texts = [doubt for doubt in doubts.values() if doubt]
    return f" ({'; '.join(texts)})" if texts else ""


def _lower_bound(result: Result) -> Cell:
    """Return the largest force of a run whose peak is open."""
    if result.end not in OPEN_PEAKS:
        return UNKNOWN
    force = float(result.whole("history/force").max())
    return number_with_unit(force, unit_of("force", result.units))


def _threshold(result: Result) -> list[PageBlock]:
    """Return a table of the delamination threshold and its band."""
    threshold = result.threshold
    if not threshold:
        return []
    unit = unit_of("force", result.units)
    words = from_threshold(threshold.get("number"))
    rows: list[Row] = [
        (f"delamination {words}", number_with_unit(float(threshold["force"]), unit)),
        ("number of delaminations", str(threshold.get("number", UNKNOWN))),
    ]
    if np.shape(threshold.get("band", 0)) == (2,):
        low, high = (number_with_unit(float(force), unit) for force in threshold["band"])
        rows += [
            ("one delamination in each interface of unlike plies", low),
            ("a single delamination", high),
        ]
    rows += [("criteria of plies and interfaces", text) for text in lowest_criterion(result)]
    metrics = result.metrics
    rows.append(("1 less the largest force over it", share(metrics["threshold_margin"])))
    if math.isfinite(energy := energy_at_force(result, float(threshold["force"]))):
        shown = number_with_unit(energy, unit_of("force*length", result.units))
        rows.append(("energy of the impact that reaches it, about", shown))
    reached = float(threshold["time"])
    if math.isfinite(reached):
        above = number_with_unit(metrics["time_above"], unit_of("time", result.units))
        rows.append(("time at or above it", above))
        rows.append(("reached at time", number_with_unit(reached, unit_of("time", result.units))))
        rows.append(
            (
                "given up by then",
                number_with_unit(threshold_energy(result), unit_of("force*length", result.units)),
            )
        )
    return page_table(rows, title="Delamination threshold")


def _criteria(result: Result) -> list[PageBlock]:
    """Return tables of the largest exposures and of the first failures, by criterion.

    The two may be in different plies: an exposure goes on to grow after it has reached 1.
    """
    length, time, force, energy = (
        unit_of(name, result.units) for name in ("length", "time", "force", "force*length")
    )
    largest: list[Row] = [
        (
            spelt(exposure.criterion),
            number_with_unit(exposure.exposure),
            exposure.mode,
            exposure.where,
            number_with_unit(exposure.x, length),
            number_with_unit(exposure.y, length),
            number_with_unit(exposure.time, time),
        )
        for exposure in largest_exposures(result)
    ]
    first: list[Row] = [
        (
            spelt(failure.criterion),
            failure.mode,
            failure.where,
            number_with_unit(failure.x, length),
            number_with_unit(failure.y, length),
            number_with_unit(failure.time, time),
            number_with_unit(failure.force, force),
            number_with_unit(failure.energy, energy),
        )
        for failure in first_failures(result)
    ]
    place = ("mode", "where", "x", "y", "time")
    return [
        *page_table(largest, ("criterion", "exposure", *place), "Largest exposures"),
        *page_table(
            first, ("criterion", *place, "force", "given up by then"), "First failure by criterion"
        ),
    ]


def _decks(
    results: Mapping[str, Result], digests: Mapping[str, str], *, full: bool
) -> Iterator[PageBlock]:
    """Yield version, solver, checksums, and the decks."""
    texts = {name: result.deck_text for name, result in results.items()}
    rows: dict[str, list[Cell]] = {
        "fecm": [str(r.attributes.get("fecm_version", UNKNOWN)) for r in results.values()],
        "solver": [str(r.attributes.get("solver", UNKNOWN)) for r in results.values()],
        "mode": [r.mode for r in results.values()],
        "slips": [", ".join(r.slips) or "none" for r in results.values()],
        "deck, SHA-256": [hashlib.sha256(t.encode()).hexdigest() for t in texts.values()],
    }
    if digests:
        rows["result, SHA-256"] = [digests.get(name, "in memory") for name in results]
    yield from page_table(
        ((key, *cells) for key, cells in rows.items()),
        ("property", *results) if len(results) > 1 else (),
        "Versions and checksums",
    )
    for name, result in results.items():
        text, whose = result.deck_text, f" of {name}" if len(texts) > 1 else ""
        if command := command_of(result):
            yield listing(f"The command that wrote the deck{whose}", command)
        yield listing(f"The deck{whose}", text if full else short_deck(text))
