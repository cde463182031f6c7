"""Checks of a deck.

Findings about missing data of a segment are suppressed if one of its cards is unreadable, so that
one mistake gives one finding.
"""

from __future__ import annotations

import math
import sys

import numpy as np

from fecm.deck import model
from fecm.deck.findings import Findings
from fecm.deck.macros import MOST_MACROS, STEPS, compile_program, every, flat
from fecm.deck.reader import ParsedProblem
from fecm.mechanics.plate import UnsoundPlateError
from fecm.mechanics.ply_stresses import is_complete
from fecm.problem import (
    check_contact,
    check_damage,
    check_gages,
    check_mesh,
    check_plausibility,
    check_segments,
)
from fecm.problem.build import Problem, W
from fecm.problem.generate import generate

__all__ = ["Problem", "check"]

ALWAYS: tuple[type[model.Segment], ...] = (model.Coordinates, model.Elements, model.Material)
IN_AN_IMPACT: tuple[type[model.Segment], ...] = (model.Impact, model.Indentation)
# Segments of which only the last is effective.
SINGLE: tuple[type[model.Segment], ...] = (
    *ALWAYS, *IN_AN_IMPACT, model.Projectile, model.Shear, model.Patch, model.Gages, model.Units,
    model.Allowables, model.Delamination, model.Damping,
)  # fmt: skip
MOST_TWIST = 0.1  # largest |D16| and |D26|, over (D11 D22)^(1/2), without a warning of DELA


def check(problem: ParsedProblem, findings: Findings, *, listing: bool = False) -> Problem | None:
    """Check a problem, in listing mode or not; None without a control card."""
    deck, unsound = problem.deck, problem.unsound
    if deck is None:
        return None
    before = findings.error_count
    program = compile_program(deck.macros, findings)
    _check_segments(deck, unsound, findings)
    generated, elements_generated = findings.error_count, _element_errors(findings)
    mesh = generate(deck, findings)
    complete = findings.error_count == generated and not unsound & {"COOR", "ELEM"}
    given = _element_errors(findings) == elements_generated and "ELEM" not in unsound
    if given and deck.has(model.Elements):
        valid = check_mesh.check_elements(deck, mesh, findings)
        if valid and complete and deck.has(model.Coordinates):
            check_mesh.check_mesh(deck, mesh, findings, listing=listing)
    if (material := deck.last(model.Material)) is not None:
        check_segments.check_material(material, findings)
    if (impact := deck.last(model.Impact)) is not None:
        check_segments.check_impact(impact, deck, mesh, findings)
    for kind, check_segment in check_segments.CHECKS:
        if (segment := deck.last(kind)) is not None:
            check_segment(segment, findings)

    def sound() -> bool:
        return findings.error_count == before and not unsound

    if (gages := deck.last(model.Gages)) is not None and sound():
        check_gages.check_gages(gages, mesh, deck, findings)
    checked = Problem(deck, mesh, program)
    if sound():
        if deck.has(model.Shear):
            check_mesh.check_assumed_shear(deck, mesh, findings)
        if (patch := deck.last(model.Patch)) is not None:
            check_segments.check_patch(checked, findings)
            if sound() and patch.load and checked.patch is not None:
                mesh.forces[:, W] += patch.load * checked.patch.weights
    if sound():
        with np.errstate(all="ignore"):  # numbers out of range end in a finding
            _check_threshold(checked, findings)
            check_time_step(checked, findings)
            check_program(checked, findings)
            check_plausibility.check_purpose(deck, mesh, findings)
            if sound():
                check_mesh.check_side_nodes(deck, mesh, findings)
                check_mesh.check_support(deck, mesh, findings)
                check_mesh.check_in_plane_supports(checked, findings)
                check_values(checked, findings)
                if STEPS.intersection(macro.word for macro in deck.macros):
                    check_plausibility.check_time_step_of_contact(checked, findings)
            if checked.has_impact:
                if not deck.has(model.Projectile):
                    check_segments.warn_of_the_reports_rod(deck, findings)
                check_segments.check_resolution(checked, findings)
                check_gages.check_gages_under_force(checked, findings)
    return checked


def check_values(problem: Problem, findings: Findings) -> None:
    """Warn of the valid values of a sound problem that look like a mistake."""
    check_plausibility.check_plausibility(problem, findings)
    check_damage.check_damage(problem, findings)
    check_gages.check_gage_places(problem, findings)
    if problem.has_impact:
        check_contact.check_contact(problem, findings)


def _check_threshold(problem: Problem, findings: Findings) -> None:
    """Warn of laminates to which the threshold of an isotropic plate is only an approximation."""
    delamination, laminate = problem.deck.last(model.Delamination), problem.laminate
    if delamination is None:
        return
    if laminate.is_coupled:
        message = "B is not zero: the delamination threshold takes D - B A^-1 B for D."
        findings.add("W458", message, delamination.place())
    D = laminate.D
    twist = float(np.abs(D[:2, 2]).max() / np.sqrt(D[0, 0] * D[1, 1]))
    if twist > MOST_TWIST:
        message = (
            f"Bending twists the plate: D16 or D26 is {twist:.2g} (D11 D22)^(1/2). The threshold "
            "is that of an isotropic plate with the mean stiffness D*."
        )
        hint = "threshold and D* do not depend on the axes; how delaminations grow does"
        findings.add("W461", message, delamination.place(), hint)


def _element_errors(findings: Findings) -> int:
    return sum(findings.counts[code] for code in ("E303", "E304", "E305"))


def _check_segments(deck: model.Deck, unsound: set[str], findings: Findings) -> None:
    """Report missing segments, and those that a later one of the same keyword replaces."""
    words = {macro.word for macro in deck.macros}
    impact = IN_AN_IMPACT if "RODP" in words else ()
    failure: tuple[type[model.Segment], ...] = (model.Allowables,) if "FAIL" in words else ()
    for kind in (*ALWAYS, *impact, *failure):
        if not deck.has(kind) and kind.keyword not in unsound:
            message = f"The deck has no {kind.keyword} segment."
            findings.add("E203", message, deck.place(), "it belongs before END")
    for kind in SINGLE:
        for segment in deck.all(kind)[1:]:
            message = f"A second {kind.keyword} segment replaces the first."
            findings.add("W204", message, segment.place(), "remove one of them")
    if len(boundaries := deck.all(model.Boundary)) > 1:
        message = "A second BOUN segment adds to the first and replaces the codes of its nodes."
        findings.add("W204", message, boundaries[1].place())


LARGE_OUTPUT = 10**9
# Fraction of the critical time step below which a step's change, of its square, is rounded off.
LEAST_STEP = math.sqrt(sys.float_info.epsilon)
UNSTABLE = "E508"


def check_program(problem: Problem, findings: Findings) -> None:
    """Check the length of a program, and that its loops reach the steps to be stored."""
    deck, sizes = problem.deck, problem.work
    if sizes.macros > MOST_MACROS:
        from decimal import Context, Decimal

        count = Decimal(sizes.macros).normalize(Context(prec=3))  # may be beyond all floats
        message = f"The program executes {count:g} macros, more than {MOST_MACROS:g}."
        findings.add("E509", message, deck.macros[0].place("macro"), "nested LOOPs multiply")
        return
    for macro in flat(problem.program):
        if macro.word == "RODP" and every(macro) > max(1, sizes.steps):
            what = f"RODP stores every {every(macro)} steps"
            message = f"{what}, but the program takes only {sizes.steps}: no strains are stored."
            findings.add("W510", message, macro.place("value"))
        if macro.word in ("DISP", "STRE", "PLYS", "FAIL") and not sizes.passes[macro.word]:
            what = f"{macro.word} stores every {every(macro)} passes"
            message = f"{what}, but no loop has so many: nothing is stored."
            findings.add("W510", message, macro.place("value"))
    if not sizes.steps and not any(sizes.passes.values()):
        place = deck.macros[0].place("macro") if deck.macros else None
        findings.add("W511", "The program takes no step and stores nothing.", place)
    _check_ply_stresses(problem, findings)
    if problem.output_bytes > LARGE_OUTPUT:
        word = max(problem.stored_bytes, key=problem.stored_bytes.__getitem__)
        share = problem.stored_bytes[word]
        message = (
            f"The result will take {problem.output_bytes / 1e9:.3g} GB, {share / 1e9:.3g} GB of "
            f"them for {word}."
        )
        storing = next((macro for macro in flat(problem.program) if macro.word == word), None)
        hint = f"{word} stores every N steps: take a larger N"
        if word == "PLYS":
            hint += ", or only the M elements nearest to the load: PLYS,,N,M"
        findings.add("W512", message, storing.place("value") if storing else None, hint)


def _check_ply_stresses(problem: Problem, findings: Findings) -> None:
    """Check the PLYS cards of a program; warn of stresses that depend on the mesh or are NaN."""
    cards = [macro for macro in flat(problem.program) if macro.word in ("PLYS", "FAIL")]
    if not cards:
        return
    if problem.has_impact and problem.patch is None:
        message = "Ply stresses under a point force grow without bound as the mesh is refined."
        hint = "a PATC segment gives the contact force an area"
        findings.add("W449", message, cards[0].place("macro"), hint)
    others = np.flatnonzero(~is_complete(problem.mesh.elements))
    if len(others):
        what = f"Interlaminar stresses of {len(others)} elements without nine nodes"
        message = f"{what} are not computed (element {others[0] + 1} first): they are NaN."
        findings.add("W450", message, cards[0].place("macro"))
    cards = [macro for macro in cards if macro.word == "PLYS"]
    numel = problem.deck.control.numel
    for card in cards:
        if card.second > numel:
            message = f"PLYS takes {card.second:g} elements; the deck has {numel}."
            hint = "0 or a blank takes all elements"
            findings.add("E448", message, card.place("second value"), hint)
        elif card.second != cards[0].second:
            message = "The PLYS cards take different numbers of elements."
            findings.add("E448", message, card.place("second value"), "give each the same number")
    if cards and cards[0].second and problem.has_impact is False and problem.patch is None:
        message = "PLYS takes the elements nearest to the load, but nothing hits the plate."
        hint = "leave the number blank for all elements"
        findings.add("E448", message, cards[0].place("second value"), hint)


def check_time_step(problem: Problem, findings: Findings) -> None:
    """Compare every DT with the plate's critical time step, and with the rate of the damping."""
    deck = problem.deck
    steps = [macro for macro in deck.macros if macro.word == "DT"]
    if not steps or not STEPS.intersection(macro.word for macro in deck.macros):
        return
    try:
        safe = problem.safe_time_step
        for macro in steps:
            if 0.0 < macro.value < LEAST_STEP * safe:
                what = f"DT = {macro.value:.4g} is so far below the plate's critical time step"
                message = f"{what} (about {safe:.4g}) that the motion is lost by rounding."
                hint = "check the unit of time; DT without a number takes 0.9 of the critical step"
                findings.add("E515", message, macro.place("value"), hint)
        dt, card = max(m.value or safe for m in steps), deck.last(model.Damping)
        if card is not None and (error := (card.coefficient * dt) ** 2 / 12.0) > 0.01:
            why = f"its rate is off by (a DT)^2/12 = {error:.2g}"
            what = f"The damping a = {card.coefficient:g} is resolved badly by DT = {dt:.4g}"
            hint = "check the unit of time, or take a smaller DT"
            findings.add("W460", f"{what}: {why}.", card.place("a"), hint)
        if min(m.value for m in steps) > 0.0 and max(m.value for m in steps) < safe:
            return
        critical = problem.critical_time_step
    except UnsoundPlateError as error:
        message = f"The plate has no critical time step: {error}."
        hint = "check the units of the ply's constants, the thickness and the coordinates"
        findings.add("E417", message, deck.require(model.Material).place(), hint)
        return
    for macro in steps:
        if macro.value >= critical:
            what = f"DT = {macro.value:.4g} is not below the plate's critical time step"
            message = f"{what} {critical:.4g}: the motion would grow without bound."
            hint = f"take {0.95 * critical:.2g} or less; --force runs the deck nevertheless"
            findings.add(UNSTABLE, message, macro.place("value"), hint)
