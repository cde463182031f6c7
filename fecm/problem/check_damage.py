"""Findings about strengths, toughness and failure criteria that look like a mistake."""

from __future__ import annotations

from collections import Counter

import numpy as np

from fecm.deck import model
from fecm.deck.findings import Findings
from fecm.deck.macros import Loop, every, flat
from fecm.deck.records import Ply
from fecm.deck.units import MODULUS, TOUGHNESS, in_si, unit_names
from fecm.problem.build import Problem
from fecm.problem.check_units import USED, has_real_moduli, likely_unit, looks_like, needed_unit

# Strengths over the modulus of their direction.  Annealed glass has 1e-4, soft matrices 0.1.
WEAKEST, STRONGEST = 5e-5, 0.3
ENDLESS = 1e6  # strength over modulus that stands for no failure
# Strength, modulus in its direction, and the usual ratio of both.
SHARES = (
    ("XT", "E1", 0.012), ("XC", "E1", 0.008), ("YT", "E2", 0.005), ("YC", "E2", 0.02),
    ("S12", "G12", 0.016), ("S13", "G13", 0.016), ("S23", "G23", 0.02),
)  # fmt: skip
FIBROUS = 2.0  # E1/E2 above which a ply has fibres in one direction
USUAL_MODULUS = 1e11  # Pa, along fibres; with it the unit of a deck without UNIT is guessed
# Other orders of XT, XC, YT and YC on a card, and where the values belong.
ORDERS = {
    "in the order XT, YT, XC, YC": (0, 2, 1, 3),
    "with X and Y exchanged": (2, 3, 0, 1),
    "with tension and compression exchanged": (1, 0, 3, 2),
}
LOWEST_TOUGHNESS, HIGHEST_TOUGHNESS, USUAL_TOUGHNESS = 50.0, 5000.0, 700.0  # G_IIc, J/m^2
# G_IIc/(E2 h) of plates from 0.5 to 20 mm.
LOWEST_RELATIVE, HIGHEST_RELATIVE = 1e-7, 5e-3
ENOUGH_EVALUATIONS = 20  # of FAIL, that a largest exposure over time is not missed


def check_damage(problem: Problem, findings: Findings) -> None:
    """Check strengths, toughness and the evaluation of the failure criteria of a sound problem."""
    deck = problem.deck
    ply, names = deck.require(model.Material).ply, unit_names(deck)
    if (card := deck.last(model.Allowables)) is not None:
        before = len(findings)
        if has_real_moduli(ply, names):  # otherwise W435 says so
            check_strength_units(card, ply, names, findings)
        if len(findings) == before:
            check_strength_order(card, ply, findings)
        check_evaluations(problem, card, findings)
    if (interface := deck.last(model.Delamination)) is not None:
        check_toughness(interface, deck, names, findings)
        check_number_of_delaminations(interface, deck, findings)


def check_strength_units(
    card: model.Allowables, ply: Ply, names: dict[str, str], findings: Findings
) -> None:
    """Warn of strengths that no material of these moduli has."""
    own = in_si(MODULUS, names)
    guessed = likely_unit(ply.e1, MODULUS, USUAL_MODULUS) if own is None else ""
    unit_of_stress = own or USED[MODULUS].get(guessed, 1.0)
    wrong: dict[str, str] = {}  # what is said of a strength
    likely = Counter[str]()
    for (name, modulus, usual), strength in zip(SHARES, card.row(), strict=False):
        value, stiffness = float(strength), float(getattr(ply, modulus.lower()))
        share = value / stiffness
        if WEAKEST <= share <= STRONGEST or share > ENDLESS:
            continue
        wrong[name] = f"{name} = {value:g} is {share:.2g} times {modulus}"
        if own is not None:
            wrong[name] += f", {value * own:.2g} Pa in the units of UNIT"
        likely[likely_unit(value, MODULUS, usual * stiffness * unit_of_stress)] += 1
    if not wrong:
        return
    first, *others = wrong
    message = wrong[first] + (f" (also {', '.join(others)})" if others else "")
    unit = likely.most_common(1)[0][0]
    if unit and unit != guessed:
        needed = f"E1 = {ply.e1:g} looks like {guessed}" if guessed else needed_unit(MODULUS, names)
        these = "the strengths look" if others else "it looks"
        message += f": {these} like {unit}; {needed}"
    hint = "strengths and moduli must be in the same unit"
    findings.add("W467", f"{message}.", card.place(first), hint)


def check_strength_order(card: model.Allowables, ply: Ply, findings: Findings) -> None:
    """Warn of strengths of a fibrous ply that are not in the order of the card."""
    given = card.xt, card.xc, card.yt, card.yc
    faults = _faults(*given)
    if ply.e1 <= FIBROUS * ply.e2 or not faults or max(given) > ENDLESS * ply.e1:
        return
    message = f"{' and '.join(faults.values())}, unlike in any ply of parallel fibres"
    for order, places in ORDERS.items():
        if not _faults(*(given[place] for place in places)):
            message += f": the strengths look typed {order}"
            break
    hint = "the card's order is XT, XC, YT, YC, S12, S13, S23: X along the fibres, T in tension"
    findings.add("W468", f"{message}.", card.place(next(iter(faults))), hint)


def _faults(xt: float, xc: float, yt: float, yc: float) -> dict[str, str]:
    """What is wrong with strengths of a ply with fibres in one direction, by the field."""
    faults = {}
    if yt >= xt:
        faults["YT"] = f"YT = {yt:g} is not below XT = {xt:g}"
    if yc >= xc:
        faults["YC"] = f"YC = {yc:g} is not below XC = {xc:g}"
    if yc < yt:
        faults["YC"] = f"YC = {yc:g} is below YT = {yt:g}"
    return faults


def check_toughness(
    card: model.Delamination, deck: model.Deck, names: dict[str, str], findings: Findings
) -> None:
    """Warn of a toughness that no laminate has: absolute with UNIT, otherwise over E2 h."""
    place, value = card.place("G_IIc"), card.toughness
    factor = in_si(TOUGHNESS, names)
    if factor is not None:
        if LOWEST_TOUGHNESS <= value * factor <= HIGHEST_TOUGHNESS:
            return
        limits = f"{LOWEST_TOUGHNESS:g} to {HIGHEST_TOUGHNESS:g}"
        message = f"G_IIc = {value:g} is {value * factor:.3g} J/m^2 in the units of UNIT"
        message += f", outside {limits}"
        if looks := looks_like(value, TOUGHNESS, USUAL_TOUGHNESS, names):
            message += f": it {looks}"
        findings.add("W469", f"{message}.", place, "1 N/mm is 1000 J/m^2, 1 lbf/in 175 J/m^2")
        return
    material = deck.require(model.Material)
    relative = value / (material.ply.e2 * material.integration.thickness)
    if LOWEST_RELATIVE <= relative <= HIGHEST_RELATIVE:
        return
    limits = f"{LOWEST_RELATIVE:g} to {HIGHEST_RELATIVE:g}"
    message = f"G_IIc = {value:g} is {relative:.2g} times E2 h, outside {limits}"
    hint = "it is a force over a length in the deck's units: N/mm (1000 J/m^2) in mm and N"
    findings.add("W469", f"{message}: it looks like another unit.", place, hint)


def check_number_of_delaminations(
    card: model.Delamination, deck: model.Deck, findings: Findings
) -> None:
    """Warn of more delaminations than there are interfaces."""
    plies = len(deck.require(model.Material).layers)
    if card.number <= max(1, plies - 1):
        return
    interfaces = f"{plies} layers have {plies - 1} interfaces"
    message = f"DELA has {card.number:g} delaminations, but {interfaces}."
    place = card.place("number of delaminations")
    findings.add("W470", message, place, "a blank takes one, whose threshold is the highest")


def check_evaluations(problem: Problem, card: model.Allowables, findings: Findings) -> None:
    """Warn of strengths that the program never uses, or at too few times of an impact."""
    cards = [macro for macro in flat(problem.program) if macro.word == "FAIL"]
    if not cards:
        message = "ALLO has strengths, but the program has no FAIL: no exposure is computed."
        findings.add("W471", message, card.place(), "put FAIL into the loop of RODP")
        return
    if not problem.has_impact or problem.work.passes["FAIL"] == 0:  # W510 says so
        return
    loops = [item for item in problem.program if isinstance(item, Loop)]
    stepping = [loop for loop in loops if "RODP" in {macro.word for macro in flat(loop.body)}]
    inside = any(macro.word == "FAIL" for loop in stepping for macro in flat(loop.body))
    count, place = problem.work.passes["FAIL"], cards[0].place("value")
    if stepping and not inside:
        message = (
            "FAIL is outside the loop of RODP: it sees the plate at one time only, not at the peak."
        )
        findings.add("W472", message, cards[0].place("macro"), "put FAIL into the loop of RODP")
    elif count < ENOUGH_EVALUATIONS and every(cards[0]) > 1:
        message = (
            f"FAIL is evaluated {count} time{'s' * (count > 1)} in {problem.work.steps} steps: the "
            "largest exposures may be missed."
        )
        best = int(np.clip(problem.work.steps // 200, 1, every(cards[0]) - 1))
        findings.add("W472", message, place, f"FAIL,,{best} evaluates it more often")
