"""Trust in a result: every quantity that bounds the model, and its size."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from fecm._errors import ResultFileError
from fecm._table import Cell, ShownNumber
from fecm.deck.macros import flat
from fecm.judge.criteria import spelt
from fecm.judge.end import ENDS, OPEN_PEAKS
from fecm.judge.exposures import FINER_MESHES_DECIDE, FailureVerdict, failure_verdict
from fecm.judge.limits import (
    BALANCED,
    CLAMPS_PULL,
    ELEMENTS_PER_WAVE,
    ENERGY_BALANCE,
    EXPOSURE,
    FAIL_EVALUATIONS,
    INDENTATION,
    ITERATION,
    POINT_FORCE,
    PULL,
    SHEAR_FACTOR,
    SLOPE,
    STRAIN,
    THRESHOLD,
    TIME_STEP,
    Judgement,
    TrustLevel,
)
from fecm.judge.validity import CURVED, of_face, reasons_of
from fecm.listing.slips import LISTING
from fecm.problem.estimates import format_mesh_error, pull_of_edges
from fecm.problem.loading import load_deck
from fecm.problem.problem import Problem
from fecm.problem.summary import deck_summary
from fecm.report.content import UNKNOWN, number_with_unit, share
from fecm.results.exposures import evaluations_in_contact, largest_exposures
from fecm.results.metrics import MOBILITY
from fecm.results.result import Result
from fecm.results.run_metrics import impact_energy, peak_and_deflection
from fecm.results.summary import largest_of_supports, threshold_verdict

SLOPES = "membrane/largest_slope"  # of a nonlinear plate, at the stored rows


def deck_problem(result: Result) -> tuple[Problem | None, list[str]]:
    """Return the problem of a result's deck and the warnings about it.

    The problem is None if the deck can't be read.
    """
    try:
        loaded = load_deck(result.deck, result.mode)  # the text of a file could be another's path
    except (ResultFileError, ValueError):
        return None, []
    if loaded.errors(force=True) or len(loaded.problems) != 1:
        return None, []
    warnings = [finding for finding in loaded.findings if finding.severity == "warning"]
    return loaded.problems[0], [f"{finding.message} [{finding.code}]" for finding in warnings]


def judgements(result: Result, problem: Problem | None) -> Iterator[Judgement]:
    """Judge a result by the contents of its file and by its deck."""
    reasons = reasons_of(result.validity)
    if problem is None:
        words = "the result holds no deck that can be read: mesh and limits are not judged"
        yield Judgement(TrustLevel.DOUBTFUL, "deck", UNKNOWN, words)
    if result.notes and not result.validity:  # without impact, or of an older version
        count = len(result.notes)
        words = "the run doubts its range; see the notes"
        yield Judgement(
            TrustLevel.OUTSIDE, "notes of the run", ShownNumber(count, str(count)), words
        )
    if (end := result.end) is not None:
        yield Judgement(ENDS[end].level, "end of the run", str(end), ENDS[end].words)
    if problem is not None:
        yield from _reached(result, problem, reasons)
    yield from _failure(result)
    yield from _threshold(result)
    if problem is not None:
        yield from _supports(result, problem)
        yield from _mesh(problem)
    yield from _numerical(result)
    yield from _mode(result)


def _reached(result: Result, problem: Problem, reasons: list[str]) -> Iterator[Judgement]:
    """Compare deflection, strain and indentation with the limits of the model."""
    if "history/plate_w" not in result:
        return
    judge = problem.judge
    limit = judge.deflection
    w = float(result["history/plate_w"].max(initial=0.0)) / judge.thickness
    bent = limit.reason in reasons
    under_load, size = f"{limit.quantity} under the load", ShownNumber(w, f"{w:.3g} h")
    if result.attributes_of("history").get(MOBILITY):
        if bent:
            words = "less the rigid motion of the plate; see the notes"
            yield limit.judgement(f"beyond {limit.shown}", beyond=True, words=words)
    elif problem.plate.nonlinear:
        words = "the plate is nonlinear (von Kármán); its slope is the limit"
        yield limit.judgement(size, beyond=False, quantity=under_load, words=words)
    else:
        words = limit.page
        if bent:
            words = f"{words}; {judge.softness(max(w, limit.value))}"
            words = f"{words}; {CURVED}" if judge.curved else words
        yield limit.judgement(size, beyond=bent, quantity=under_load, words=words)
    for limit in (SLOPE, STRAIN) if problem.plate.nonlinear else (STRAIN,):
        beyond = limit.reason in reasons
        place: Cell = "beyond the limit" if beyond else "below the limit"
        words = limit.page
        if limit is SLOPE and SLOPES in result:
            largest = float(result[SLOPES].max(initial=0.0))
            place = ShownNumber(largest, f"{largest:.3g}")
        elif beyond:
            words = f"{words}; the notes of the run have its size"
        yield limit.judgement(place, beyond=beyond, words=words)
    depth = float(result["history/indentation"].max(initial=0.0)) / judge.indented
    yield INDENTATION.judgement(
        ShownNumber(depth, f"{depth:.3g} h"),
        beyond=INDENTATION.reason in reasons,
        words=f"{INDENTATION.page}{of_face(judge)}",
    )


def _failure(result: Result) -> Iterator[Judgement]:
    """Judge the exposures of the plies, and how often they were evaluated."""
    largest = largest_exposures(result)
    if not largest:
        yield Judgement(TrustLevel.UNJUDGED, "failure of plies", UNKNOWN, "the deck has no FAIL")
        return
    top = max(largest, key=lambda row: row.exposure)
    broken = top.exposure > EXPOSURE.value
    words, end = f"{spelt(top.criterion)}; {EXPOSURE.page}", result.end
    if is_open := end in OPEN_PEAKS and not broken:
        words = f"{words}; at least, as the run ends {ENDS[end].brief}"
    decided = failure_verdict(largest) is not FailureVerdict.OPEN
    if not decided:
        words = f"{words}; {FINER_MESHES_DECIDE}"
    size = number_with_unit(top.exposure, digits=4)
    yield EXPOSURE.judgement(size, beyond=broken or is_open or not decided, words=words)
    count = evaluations_in_contact(result)
    if count is not None and "history/force" in result:
        yield FAIL_EVALUATIONS.judgement(
            ShownNumber(count, str(count)), beyond=count < FAIL_EVALUATIONS.value
        )


def _threshold(result: Result) -> Iterator[Judgement]:
    """Compare the peak force with the delamination threshold."""
    if "history/force" not in result:
        return
    if not result.threshold:
        yield Judgement(TrustLevel.UNJUDGED, "delamination", UNKNOWN, "the deck has no DELA")
        return
    largest = float(result.whole("history/force").max(initial=0.0))
    ratio = largest / float(result.threshold["force"])
    crossed = ratio > THRESHOLD.value
    yield THRESHOLD.judgement(
        number_with_unit(ratio, digits=3),
        beyond=crossed or result.end in OPEN_PEAKS,
        words="; ".join([threshold_verdict(result), *([THRESHOLD.page] if crossed else [])]),
    )


def _supports(result: Result, problem: Problem) -> Iterator[Judgement]:
    """Judge the pull of supports that can only push, or of clamps."""
    if "history/force" not in result:
        return
    peak, deflection = peak_and_deflection(result)
    if pull := pull_of_edges(problem, peak, deflection):
        yield PULL.judgement(share(pull), beyond=pull > PULL.value)
    elif peak and (largest := largest_of_supports(result)):
        ratio = largest["pull"] / (result.symmetry_factor * peak)
        beyond = ratio > CLAMPS_PULL.value and bool(problem.rests.any())
        words = "" if ratio else "the supports only push"
        yield CLAMPS_PULL.judgement(share(ratio), beyond=beyond, words=words or None)


def _mesh(problem: Problem) -> Iterator[Judgement]:
    """Judge mesh, time step, contact patch and shear stiffness."""
    summary = deck_summary(problem)
    if (count := summary.elements_per_wave) is not None:
        words = ELEMENTS_PER_WAVE.page
        if summary.mesh_error is not None:
            words = f"{words}; {format_mesh_error(summary.mesh_error)}"
        yield ELEMENTS_PER_WAVE.judgement(
            number_with_unit(count, digits=3), beyond=count < ELEMENTS_PER_WAVE.value, words=words
        )
    steps = [m.value for m in flat(problem.program) if m.word == "DT" and m.value > 0.0]
    if steps and math.isfinite(critical := summary.critical_time_step):
        ratio = max(steps) / critical
        yield TIME_STEP.judgement(share(ratio), beyond=not ratio < TIME_STEP.value)
    if problem.contact is not None:
        yield _load(problem)
    if summary.equilibrium_change is not None:
        change = summary.equilibrium_change
        yield SHEAR_FACTOR.judgement(share(change), beyond=abs(change) > SHEAR_FACTOR.value)


def _load(problem: Problem) -> Judgement:
    """Judge whether the contact force acts on a patch or at a point."""
    if problem.patch is None:
        return POINT_FORCE.judgement("at a point", beyond=True)
    ratio = problem.patch.radius / problem.laminate.thickness
    size = ShownNumber(ratio, f"on a radius of {ratio:.3g} h")
    return POINT_FORCE.judgement(size, beyond=False, words="")


def _numerical(result: Result) -> Iterator[Judgement]:
    """Judge the energy balance and the contact iteration."""
    energy = impact_energy(result)
    if "energy/balance_error" in result and energy > 0.0:
        error = np.abs(result.whole("energy/balance_error"))
        worst = float(error.max(initial=0.0)) / energy
        size = ShownNumber(worst, f"{worst:.2g}")
        yield ENERGY_BALANCE.judgement(size, beyond=not worst < BALANCED)
    count = result.attributes_of("history").get("unsettled_steps")
    if count:
        yield ITERATION.judgement(ShownNumber(float(count), str(count)), beyond=True)


def _mode(result: Result) -> Iterator[Judgement]:
    """Name the active slips of the printed program."""
    if result.mode == LISTING:
        words = "the printed program of 1982 with its slips, not the text of the report"
        yield Judgement(TrustLevel.DOUBTFUL, "mode", "listing", words)
    elif result.slips:
        words = "active slips of the printed program of 1982"
        yield Judgement(TrustLevel.DOUBTFUL, "slips", ", ".join(result.slips), words)
