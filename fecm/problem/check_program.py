"""Checks of a program: its time step, length and output."""

from __future__ import annotations

import math
import sys

import numpy as np

from fecm.deck.findings import Findings
from fecm.deck.macros import MOST_MACROS, STEPS, every, flat
from fecm.deck.model import Damping, Material
from fecm.deck.records import Macro
from fecm.mechanics.plate import UnsoundPlateError
from fecm.mechanics.ply_stresses import is_complete
from fecm.problem.build import Problem

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
        findings.add(
            "E509",
            f"The program executes {count:g} macros, more than {MOST_MACROS:g}.",
            deck.macros[0].place("macro"),
            "nested LOOPs multiply",
        )
        return
    for macro in flat(problem.program):
        if macro.word == "RODP" and every(macro) > max(1, sizes.steps):
            findings.add(
                "W510",
                f"RODP stores every {every(macro)} steps, but the program takes only "
                f"{sizes.steps}: no strains are stored.",
                macro.place("value"),
            )
        if macro.word in ("DISP", "STRE", "PLYS", "FAIL") and not sizes.passes[macro.word]:
            findings.add(
                "W510",
                f"{macro.word} stores every {every(macro)} passes, but no loop has so many: "
                "nothing is stored.",
                macro.place("value"),
            )
    if not sizes.steps and not any(sizes.passes.values()):
        place = deck.macros[0].place("macro") if deck.macros else None
        findings.add("W511", "The program takes no step and stores nothing.", place)
    _check_ply_stresses(problem, findings)
    if problem.output_bytes > LARGE_OUTPUT:
        storing = next((m for m in flat(problem.program) if m.word in ("RODP", "DISP")), None)
        findings.add(
            "W512",
            f"The result will take {problem.output_bytes / 1e9:.3g} GB.",
            storing.place("value") if storing else None,
            "RODP and DISP store every N steps: take a larger N",
        )


def _check_ply_stresses(problem: Problem, findings: Findings) -> None:
    """Check the PLYS cards of a program."""
    cards = [macro for macro in flat(problem.program) if macro.word in ("PLYS", "FAIL")]
    if not cards:
        return
    _check_stresses_under_load(problem, cards[0], findings)
    cards = [macro for macro in cards if macro.word == "PLYS"]
    numel = problem.deck.control.numel
    for card in cards:
        if card.second > numel:
            findings.add(
                "E448", f"PLYS takes {card.second:g} elements; the deck has {numel}.",
                card.place("second value"), "0 or a blank takes all elements",
            )  # fmt: skip
        elif card.second != cards[0].second:
            findings.add(
                "E448", "The PLYS cards take different numbers of elements.",
                card.place("second value"), "give each the same number",
            )  # fmt: skip
    if cards and cards[0].second and problem.has_impact is False and problem.patch is None:
        findings.add(
            "E448", "PLYS takes the elements nearest to the load, but nothing hits the plate.",
            cards[0].place("second value"), "leave the number blank for all elements",
        )  # fmt: skip


def _check_stresses_under_load(problem: Problem, card: Macro, findings: Findings) -> None:
    """Warn of ply stresses that depend on the mesh or are not computed."""
    if problem.has_impact and problem.patch is None:
        findings.add(
            "W449", "Ply stresses under a point force grow without bound as the mesh is refined.",
            card.place("macro"), "a PATC segment gives the contact force an area",
        )  # fmt: skip
    others = np.flatnonzero(~is_complete(problem.mesh.elements))
    if len(others):
        findings.add(
            "W450",
            f"Interlaminar stresses of {len(others)} elements without nine nodes are not computed "
            f"(element {others[0] + 1} first): they are NaN.",
            card.place("macro"),
        )


def check_time_step(problem: Problem, findings: Findings) -> None:
    """Compare every DT with the plate's critical time step if the program takes steps."""
    deck = problem.deck
    steps = [macro for macro in deck.macros if macro.word == "DT"]
    if not steps or not STEPS.intersection(macro.word for macro in deck.macros):
        return
    try:
        safe = problem.safe_time_step
        for macro in steps:
            if 0.0 < macro.value < LEAST_STEP * safe:
                findings.add(
                    "E515",
                    f"DT = {macro.value:.4g} is so far below the plate's critical time step (about "
                    f"{safe:.4g}) that the motion is lost by rounding.",
                    macro.place("value"),
                    "check the unit of time; DT without a number takes 0.9 of the critical step",
                )
        _check_damping(problem, max(m.value or safe for m in steps), findings)
        if min(m.value for m in steps) > 0.0 and max(m.value for m in steps) < safe:
            return
        critical = problem.critical_time_step
    except UnsoundPlateError as error:
        findings.add(
            "E417",
            f"The plate has no critical time step: {error}.",
            deck.require(Material).place(),
            "check the units of the ply's constants, the thickness and the coordinates",
        )
        return
    for macro in steps:
        if macro.value >= critical:
            findings.add(
                UNSTABLE,
                f"DT = {macro.value:.4g} is not below the plate's critical time step "
                f"{critical:.4g}: the motion would grow without bound.",
                macro.place("value"),
                f"take {0.95 * critical:.2g} or less; --force runs the deck nevertheless",
            )


def _check_damping(problem: Problem, dt: float, findings: Findings) -> None:
    """Report a damping whose rate the time step does not resolve, by (a dt)^2/12."""
    card = problem.deck.last(Damping)
    if card is not None and (error := (card.coefficient * dt) ** 2 / 12.0) > 0.01:
        findings.add(
            "W460",
            f"The damping a = {card.coefficient:g} is resolved badly by DT = {dt:.4g}: its rate is "
            f"off by (a DT)^2/12 = {error:.2g}.",
            card.place("a"),
            "check the unit of time, or take a smaller DT",
        )
