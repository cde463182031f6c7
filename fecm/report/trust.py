"""Trust in a result: every quantity that bounds the model, and its size."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from fecm._errors import ResultFileError
from fecm._table import Cell, ShownNumber
from fecm.deck.macros import flat
from fecm.listing.slips import LISTING
from fecm.problem.estimates import ENOUGH_PER_WAVE, format_mesh_error
from fecm.problem.loading import load_deck
from fecm.problem.problem import Problem
from fecm.problem.summary import deck_summary
from fecm.report.content import (
    UNKNOWN,
    Judgement,
    TrustLevel,
    number_with_unit,
    share,
)
from fecm.results.criteria import spelt
from fecm.results.end import End
from fecm.results.exposures import (
    FEWEST,
    FailureVerdict,
    evaluations_in_contact,
    failure_verdict,
    largest_exposures,
)
from fecm.results.metrics import MOBILITY
from fecm.results.result import Result
from fecm.results.run_metrics import impact_energy
from fecm.results.summary import UNDECIDED
from fecm.results.validity import (
    BENT,
    CROSSED,
    CURVED,
    INDENTATION,
    SLOPE,
    STRAIN,
    Reason,
    reasons_of,
)

# Errors of the energy balance, relative to the energy put in, up to which it is fine.
BALANCED = 1e-3
# Change of the static deflection by the shear stiffness from equilibrium that is worth a doubt.
NOTABLE_SHEAR = 0.02
SLOPES = "membrane/largest_slope"  # of a nonlinear plate, at the stored rows
SO_FAR = "so far: the run ends before its peak"
ENDS = {
    End.OVER: (TrustLevel.WITHIN, "contact over", ""),
    End.APART: (
        TrustLevel.DOUBTFUL,
        "peak passed, may touch again",
        "what another contact changes is open: rebound, energies, permanent indentation",
    ),
    End.PASSED: (
        TrustLevel.DOUBTFUL,
        "in contact, peak passed",
        "what comes after the end is open: permanent indentation, rebound, energies",
    ),
    End.RISING: (
        TrustLevel.OUTSIDE,
        "in contact, peak not reached",
        "the largest force is a lower bound of the peak; take more steps",
    ),
    End.BETWEEN: (
        TrustLevel.OUTSIDE,
        "between two contacts",
        "the projectile still approaches: the largest force is a lower bound; take more steps",
    ),
    End.AGAIN: (
        TrustLevel.OUTSIDE,
        "may touch again",
        "the projectile leaves slowly: the largest force is a lower bound; take more steps",
    ),
}


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
    if result.end is not None:
        level, size, words = ENDS[result.end]
        yield Judgement(level, "end of the run", size, words)
    if problem is not None:
        yield from _reached(result, problem, reasons)
    yield from _failure(result)
    yield from _threshold(result)
    if problem is not None:
        yield from _mesh(problem)
    yield from _numerical(result)
    yield from _mode(result)


def _reached(result: Result, problem: Problem, reasons: list[str]) -> Iterator[Judgement]:
    """Compare deflection, strain and indentation with the limits of the model."""
    if "history/plate_w" not in result:
        return
    limits = problem.judge
    w = float(result["history/plate_w"].max(initial=0.0)) / limits.thickness
    bent = BENT[limits.in_plane] in reasons
    if result.attributes_of("history").get(MOBILITY):
        if bent:
            words = "less the rigid motion of the plate; see the notes"
            yield Judgement(TrustLevel.OUTSIDE, "deflection", f"beyond {limits.limit} h", words)
    else:
        size = ShownNumber(w, f"{w:.3g} h")
        if problem.plate.nonlinear:
            words = "the plate is nonlinear (von Kármán); its slope is the limit"
            yield Judgement(TrustLevel.WITHIN, "deflection under the load", size, words)
        else:
            words = f"a linear plate holds up to {limits.limit} h with these supports"
            if bent:
                words = f"{words}; {limits.softness(max(w, limits.limit))}"
                words = f"{words}; {CURVED}" if limits.curved else words
            level = TrustLevel.OUTSIDE if bent else TrustLevel.WITHIN
            yield Judgement(level, "deflection under the load", size, words)
    for reason, name, what, limit in (
        (Reason.STEEP, "slope", "the theory holds", f"up to {SLOPE}"),
        (Reason.STRAINED, "strain", "linear plies hold", f"up to {100.0 * STRAIN:g} %"),
    ):
        if reason == Reason.STEEP and not problem.plate.nonlinear:
            continue
        beyond = reason in reasons
        level = TrustLevel.OUTSIDE if beyond else TrustLevel.WITHIN
        place: Cell = "beyond the limit" if beyond else "below the limit"
        words = f"{what} {limit}"
        if reason == Reason.STEEP and SLOPES in result:
            largest = float(result[SLOPES].max(initial=0.0))
            place = ShownNumber(largest, f"{largest:.3g}")
        elif beyond:
            words = f"{words}; the notes of the run have its size"
        yield Judgement(level, name, place, words)
    depth = float(result["history/indentation"].max(initial=0.0)) / limits.indented
    level = TrustLevel.OUTSIDE if Reason.SOFT in reasons else TrustLevel.WITHIN
    of_face = " of the struck face" if limits.struck else ""
    words = f"the contact law of a half-space holds up to {INDENTATION:g} h{of_face}"
    yield Judgement(level, "indentation", ShownNumber(depth, f"{depth:.3g} h"), words)


def _failure(result: Result) -> Iterator[Judgement]:
    """Judge the exposures of the plies, and how often they were evaluated."""
    largest = largest_exposures(result)
    if not largest:
        yield Judgement(TrustLevel.UNJUDGED, "failure of plies", UNKNOWN, "the deck has no FAIL")
        return
    top = max(largest, key=lambda row: row.exposure)
    broken = top.exposure > CROSSED
    words = f"{spelt(top.criterion)}; " + (
        "the run is elastic beyond the first failure" if broken else "1 is failure"
    )
    if is_open := result.end in UNDECIDED and not broken:
        words = f"{words}; {SO_FAR}"
    decided = failure_verdict(largest) is not FailureVerdict.OPEN
    if not decided:
        words = f"{words}; finer meshes may decide otherwise: open"
    level = TrustLevel.DOUBTFUL if broken or is_open or not decided else TrustLevel.WITHIN
    yield Judgement(level, "largest exposure", number_with_unit(top.exposure, digits=4), words)
    count = evaluations_in_contact(result)
    if count is not None and "history/force" in result:
        few = count < FEWEST
        yield Judgement(
            TrustLevel.DOUBTFUL if few else TrustLevel.WITHIN,
            "evaluations of FAIL during contact",
            ShownNumber(count, str(count)),
            f"below {FEWEST} the largest exposure may be missed" if few else "",
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
    crossed = ratio > CROSSED
    is_open = result.end in UNDECIDED and not crossed
    words = "the run is elastic above the threshold" if crossed else SO_FAR if is_open else ""
    level = TrustLevel.DOUBTFUL if crossed or is_open else TrustLevel.WITHIN
    yield Judgement(
        level, "largest force over the threshold", number_with_unit(ratio, digits=3), words
    )


def _mesh(problem: Problem) -> Iterator[Judgement]:
    """Judge mesh, time step, contact patch and shear stiffness."""
    summary = deck_summary(problem)
    if (count := summary.elements_per_wave) is not None:
        coarse = count < ENOUGH_PER_WAVE
        words = f"{ENOUGH_PER_WAVE} are enough for a peak"
        if summary.mesh_error is not None:
            words = f"{words}; {format_mesh_error(summary.mesh_error)}"
        level = TrustLevel.DOUBTFUL if coarse else TrustLevel.WITHIN
        yield Judgement(
            level, "elements per bending wave", number_with_unit(count, digits=3), words
        )
    steps = [m.value for m in flat(problem.program) if m.word == "DT" and m.value > 0.0]
    if steps and math.isfinite(critical := summary.critical_time_step):
        ratio = max(steps) / critical
        level = TrustLevel.WITHIN if ratio < 1.0 else TrustLevel.OUTSIDE
        yield Judgement(level, "time step", share(ratio), "of the critical one")
    if problem.contact is not None:
        yield _load(problem)
    if summary.equilibrium_change is not None:
        change = summary.equilibrium_change
        level = TrustLevel.DOUBTFUL if abs(change) > NOTABLE_SHEAR else TrustLevel.WITHIN
        words = (
            "change of the static deflection by the shear stiffness from equilibrium (SHEA EQUI), "
            "which the deck leaves out"
        )
        yield Judgement(level, "transverse shear factor 1", share(change), words)


def _load(problem: Problem) -> Judgement:
    """Judge whether the contact force acts on a patch or at a point."""
    name, patch = "contact force", problem.patch
    if patch is None:
        words = "the peak depends on the element under a point force; PATC gives it a size"
        return Judgement(TrustLevel.DOUBTFUL, name, "at a point", words)
    ratio = patch.radius / problem.laminate.thickness
    return Judgement(TrustLevel.WITHIN, name, ShownNumber(ratio, f"on a radius of {ratio:.3g} h"))


def _numerical(result: Result) -> Iterator[Judgement]:
    """Judge the energy balance and the contact iteration."""
    energy = impact_energy(result)
    if "energy/balance_error" in result and energy > 0.0:
        error = np.abs(result.whole("energy/balance_error"))
        worst = float(error.max(initial=0.0)) / energy
        level = TrustLevel.WITHIN if worst < BALANCED else TrustLevel.DOUBTFUL
        size: Cell = ShownNumber(worst, f"{worst:.2g}")
        words = "largest error, of the energy put in"
        yield Judgement(level, "energy balance", size, words)
    count = result.attributes_of("history").get("unsettled_steps")
    if count:
        words = "the contact iteration did not converge; a smaller DT helps"
        yield Judgement(TrustLevel.DOUBTFUL, "steps", ShownNumber(float(count), str(count)), words)


def _mode(result: Result) -> Iterator[Judgement]:
    """Name the active slips of the printed program."""
    if result.mode == LISTING:
        words = "the printed program of 1982 with its slips, not the text of the report"
        yield Judgement(TrustLevel.DOUBTFUL, "mode", "listing", words)
    elif result.slips:
        words = "active slips of the printed program of 1982"
        yield Judgement(TrustLevel.DOUBTFUL, "slips", ", ".join(result.slips), words)
