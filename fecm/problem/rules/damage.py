"""Rules about strengths, failure criteria and the delamination threshold: ALLO, FAIL and DELA."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from fecm.deck import model
from fecm.deck.macros import Loop, every, flat
from fecm.deck.rules import Report, Reports, Subject, reports, rule
from fecm.deck.units import MODULUS, TOUGHNESS, in_si, unit_names
from fecm.judge.criteria import exposed
from fecm.mechanics.failure import puck_slope
from fecm.mechanics.laminate import is_fabric
from fecm.problem.parts import ply_strengths
from fecm.problem.problem import Problem
from fecm.problem.rules.units import USED, has_real_moduli, likely_unit, looks_like, needed_unit
from fecm.problem.rules.zones import material_numbers, unknown_material

# Strengths over the modulus of their direction.  Annealed glass has 1e-4, soft matrices 0.1.
WEAKEST = 5e-5
STRONGEST = 0.3
ENDLESS = 1e6  # strength over modulus that means no failure
# Strength, modulus in its direction, and the usual ratio of both.
SHARES = (
    ("XT", "E1", 0.012),
    ("XC", "E1", 0.008),
    ("YT", "E2", 0.005),
    ("YC", "E2", 0.02),
    ("S12", "G12", 0.016),
    ("S13", "G13", 0.016),
    ("S23", "G23", 0.02),
)
FIBROUS = 2.0  # E1/E2 above which a ply has fibres in one direction
# Only boron plies are stronger in compression than in tension.
BORON_ANISOTROPY = 5.0  # least E1/E2 of boron plies
BORON_SHEAR = 0.35  # greatest G12/E2 of boron plies
NEARLY = 1.1  # XC/XT that scatter of tests explains
WEAKEST_SHEAR = 0.25  # least shear strength over YT
USUAL_MODULUS = 1e11  # Pa, along fibres; with it the unit of a deck without UNIT is guessed
# Other orders of XT, XC, YT and YC on a card, and where the values belong.
ORDERS = {
    "in the order XT, YT, XC, YC": (0, 2, 1, 3),
    "with X and Y exchanged": (2, 3, 0, 1),
    "with XT and XC exchanged": (1, 0, 2, 3),
    "with YT and YC exchanged": (0, 1, 3, 2),
    "with tension and compression exchanged": (1, 0, 3, 2),
}
# G_IIc, J/m^2.
LOWEST_TOUGHNESS = 50.0
HIGHEST_TOUGHNESS = 5000.0
# G_IIc of plies of parallel fibres, J/m^2; the first epoxies have 154, PEEK 3000.
LOWEST_OF_FIBRES = 150.0
HIGHEST_OF_FIBRES = 4000.0
USUAL_TOUGHNESS = 700.0
# G_IIc/(E2 h) of plates from 0.5 to 20 mm.
LOWEST_RELATIVE = 1e-7
HIGHEST_RELATIVE = 5e-3
ENOUGH_EVALUATIONS = 20  # evaluations of FAIL that do not miss the largest exposure over time
CLUSTER = 3  # like plies at the far face that crack before the threshold
MOST_TWIST = 0.1  # largest |D16| and |D26|, over (D11 D22)^(1/2), without a warning of DELA


@rule("E455", Subject.DAMAGE)
def invalid_strength(card: model.Allowables) -> Reports:
    """A strength on ALLO's card is not positive.

    Remedy: Compressive strengths are positive too.
    """
    for strengths in (card, *card.others):
        for (name, _, _), value in zip(SHARES, strengths.row(), strict=False):
            if isinstance(value, str) or not value > 0.0:
                is_known = name in ("XC", "YC")
                hint = "compressive strengths are positive on this card" if is_known else ""
                message = f"The strength {name} is {value:g}; it must be positive."
                yield Report(message, strengths.place(name), hint)


@rule("E456", Subject.DAMAGE)
def invalid_constant_of_criterion(card: model.Allowables) -> Reports:
    """F12* is not between -1 and 1, or p+ or p- not between 0 and 1.

    Remedy: Blanks take -0.5, 0.35, 0.3 (carbon fibres; glass: 0.30, 0.25).
    """
    for strengths in (card, *card.others):
        for name, value in (("p+", strengths.p_plus), ("p-", strengths.p_minus)):
            if not 0.0 < value < 1.0:
                message = f"Puck's slope {name} is {value:g}; it must be between 0 and 1."
                yield Report(message, strengths.place(), "a blank takes 0.35 for p+ and 0.3 for p-")
        if not abs(strengths.f12) < 1.0:
            message = f"F12* is {strengths.f12:g}; it must be between -1 and 1."
            yield Report(message, strengths.place(), "a blank takes -0.5")


@rule("E457", Subject.DAMAGE)
def invalid_delamination(card: model.Delamination) -> Reports:
    """G_IIc is not positive, or the number of delaminations not whole.

    The number is a whole number from 1.

    Remedy: Correct DELA.
    """
    if not card.toughness > 0.0:
        message = f"G_IIc is {card.toughness:g}; it must be positive."
        yield Report(message, card.place("G_IIc"))
    if not (card.number >= 1.0 and card.number.is_integer()):
        must = "a whole number from 1"
        message = f"The number of delaminations is {card.number:g}; it must be {must}."
        yield Report(message, card.place("number of delaminations"))


@rule("W458", Subject.DAMAGE)
def coupled_threshold(problem: Problem, card: model.Delamination) -> Reports:
    """B is not zero: the threshold takes D - B A⁻¹ B for D.

    Remedy: A symmetric laminate, or accept it.
    """
    if problem.laminate.is_coupled:
        message = "B is not zero: the delamination threshold takes D - B A^-1 B for D."
        yield Report(message, card.place())


@rule("W461", Subject.DAMAGE)
def twisted_threshold(problem: Problem, card: model.Delamination) -> Reports:
    """Bending twists the plate.

    D16 or D26 is more than a tenth of √(D11 D22). The threshold is computed for an isotropic plate.

    Remedy: An estimate; a test of this layup is better.
    """
    D = problem.laminate.D
    twist = float(np.abs(D[:2, 2]).max() / np.sqrt(D[0, 0] * D[1, 1]))
    if twist > MOST_TWIST:
        message = (
            f"Bending twists the plate: D16 or D26 is {twist:.2g} (D11 D22)^(1/2). The threshold "
            "is computed for an isotropic plate with the mean stiffness D*."
        )
        hint = "threshold and D* do not depend on the axes; how delaminations grow does"
        yield Report(message, card.place(), hint)


@rule("W467", Subject.DAMAGE)
def strengths_in_another_unit(problem: Problem, card: model.Allowables) -> Reports:
    """A strength does not suit the modulus in its direction.

    It is below 5·10⁻⁵ or above 0.3 of the modulus. The finding names the unit that it seems to be
    in.

    Remedy: Strengths in the moduli's unit.
    """
    for strengths, ply in _strengths(problem, card):
        yield from _strengths_in_another_unit(strengths, ply, unit_names(problem.deck))


def _strengths(
    problem: Problem, card: model.Allowables
) -> list[tuple[model.Allowables, model.Ply]]:
    """Return the strengths and constants of the materials that have both."""
    plies = problem.deck.plies
    return [
        (strengths, plies[strengths.material])
        for strengths in (card, *card.others)
        if strengths.material in plies
    ]


def _strengths_in_another_unit(
    card: model.Allowables, ply: model.Ply, names: dict[str, str]
) -> Reports:
    if not has_real_moduli(ply, names):  # W435 reports it
        return
    size = in_si(MODULUS, names)
    guessed = likely_unit(ply.e1, MODULUS, USUAL_MODULUS) if size is None else ""
    unit_of_stress = size or USED[MODULUS].get(guessed, 1.0)
    wrong: dict[str, str] = {}  # fault of each strength
    likely = Counter[str]()
    for (name, modulus, usual), strength in zip(SHARES, card.row(), strict=False):
        value, stiffness = float(strength), float(getattr(ply, modulus.lower()))
        share = value / stiffness
        if WEAKEST <= share <= STRONGEST or share > ENDLESS:
            continue
        wrong[name] = f"{name} = {value:g} is {share:.2g} times {modulus}"
        if size is not None:
            wrong[name] += f", {value * size:.2g} Pa in the units of UNIT"
        likely[likely_unit(value, MODULUS, usual * stiffness * unit_of_stress)] += 1
    if not wrong:
        return
    first, *other_faults = wrong
    message = wrong[first] + (f" (also {', '.join(other_faults)})" if other_faults else "")
    unit = likely.most_common(1)[0][0]
    if unit and unit != guessed:
        needed = f"E1 = {ply.e1:g} looks like {guessed}" if guessed else needed_unit(MODULUS, names)
        these = "the strengths look" if other_faults else "it looks"
        message += f": {these} like {unit}; {needed}"
    hint = "strengths and moduli must be in the same unit"
    yield Report(f"{message}.", card.place(first), hint)


@rule("W468", Subject.DAMAGE)
def strengths_in_another_order(problem: Problem, card: model.Allowables) -> Reports:
    """YT or XC is above XT, YC above XC, or YC below YT in a ply with E1 > 2 E2.

    The finding names the order that the values seem to be in. In plies of boron fibres XC may be
    above XT; E1 > 5 E2 and G12 < 0.35 E2 tell these plies.

    Remedy: XT, XC, YT, YC, S12, S13, S23.
    """
    for strengths, ply in _strengths(problem, card):
        yield from _strengths_in_another_order(strengths, ply)


def _strengths_in_another_order(card: model.Allowables, ply: model.Ply) -> Reports:
    values = card.xt, card.xc, card.yt, card.yc
    faults = _faults(values, ply)
    if ply.e1 <= FIBROUS * ply.e2 or not faults or max(values) > ENDLESS * ply.e1:
        return
    message = f"{' and '.join(faults.values())}, unlike in any ply of parallel fibres"
    for order, places in ORDERS.items():
        if not _faults([values[place] for place in places], ply):
            message += f": the strengths look typed {order}"
            break
    hint = "the card's order is XT, XC, YT, YC, S12, S13, S23: X along the fibres, T in tension"
    yield Report(f"{message}.", card.place(next(iter(faults))), hint)


def _faults(strengths: Sequence[float], ply: model.Ply) -> dict[str, str]:
    """Yield faults of XT, XC, YT, YC of a ply with fibres in one direction, by field."""
    xt, xc, yt, yc = strengths
    faults = {}
    has_boron = ply.e1 > BORON_ANISOTROPY * ply.e2 and ply.g12 < BORON_SHEAR * ply.e2
    if xc > NEARLY * xt and not has_boron:
        faults["XC"] = f"XC = {xc:g} is above XT = {xt:g}"
    if yt >= xt:
        faults["YT"] = f"YT = {yt:g} is not below XT = {xt:g}"
    if yc >= xc:
        faults["YC"] = f"YC = {yc:g} is not below XC = {xc:g}"
    if yc < yt:
        faults["YC"] = f"YC = {yc:g} is below YT = {yt:g}"
    return faults


@rule("W553", Subject.DAMAGE)
def weak_in_shear(problem: Problem, card: model.Allowables) -> Reports:
    """A shear strength is below a quarter of YT in a ply with E1 > 2 E2.

    The finding names the unit that the value seems to be in.

    Remedy: S12, S13 and S23 in the unit of the other strengths.
    """
    names = unit_names(problem.deck)
    for strengths, ply in _strengths(problem, card):
        if ply.e1 <= FIBROUS * ply.e2 or strengths.yt > ENDLESS * ply.e2:
            continue
        shear = {"S12": strengths.s12, "S13": strengths.s13, "S23": strengths.s23}
        weak = {name: s for name, s in shear.items() if s < WEAKEST_SHEAR * strengths.yt}
        if not weak:
            continue
        first, value = next(iter(weak.items()))
        too = f" ({' and '.join([*weak][1:])} too)" if len(weak) > 1 else ""
        message = f"{first} = {value:g} is below a quarter of YT = {strengths.yt:g}{too}"
        size = in_si(MODULUS, names)
        if size is not None and (looks := looks_like(value, MODULUS, strengths.yt * size, names)):
            message += f": it {looks}"
        hint = "no ply of parallel fibres is so weak in shear; all strengths have one unit"
        yield Report(f"{message}.", strengths.place(first), hint)


@rule("W469", Subject.DAMAGE)
def doubtful_toughness(problem: Problem, card: model.Delamination) -> Reports:
    """No laminate has this G_IIc.

    It is outside 150 to 4000 J/m² if E1 > 2 E2, and otherwise outside 50 to 5000 J/m² (without
    UNIT: G_IIc/(E2 h) outside 10⁻⁷ to 5·10⁻³).

    Remedy: N/mm is 1000 J/m², lbf/in 175 J/m².
    """
    deck, names = problem.deck, unit_names(problem.deck)
    place, value = card.place("G_IIc"), card.toughness
    factor = in_si(TOUGHNESS, names)
    if factor is not None:
        ply = deck.require(model.Material).ply
        least, greatest = LOWEST_TOUGHNESS, HIGHEST_TOUGHNESS
        if ply.e1 > FIBROUS * ply.e2:
            least, greatest = LOWEST_OF_FIBRES, HIGHEST_OF_FIBRES
        if least <= value * factor <= greatest:
            return
        limits = f"{least:g} to {greatest:g}"
        message = f"G_IIc = {value:g} is {value * factor:.3g} J/m^2 in the units of UNIT"
        message += f", outside {limits}"
        if looks := looks_like(value, TOUGHNESS, USUAL_TOUGHNESS, names):
            message += f": it {looks}"
        yield Report(f"{message}.", place, "1 N/mm is 1000 J/m^2, 1 lbf/in 175 J/m^2")
        return
    material = deck.require(model.Material)
    relative = value / (material.ply.e2 * material.integration.thickness)
    if LOWEST_RELATIVE <= relative <= HIGHEST_RELATIVE:
        return
    limits = f"{LOWEST_RELATIVE:g} to {HIGHEST_RELATIVE:g}"
    message = f"G_IIc = {value:g} is {relative:.2g} times E2 h, outside {limits}"
    hint = "it is a force over a length in the deck's units: N/mm (1000 J/m^2) in mm and N"
    yield Report(f"{message}: it looks like another unit.", place, hint)


@rule("W470", Subject.DAMAGE)
def too_many_delaminations(problem: Problem, card: model.Delamination) -> Reports:
    """There are more delaminations than interfaces.

    Remedy: A blank is one.
    """
    plies = len(problem.laminate.plies.angles)
    if card.number > max(1, plies - 1):
        interfaces = f"{plies} layers have {plies - 1} interfaces"
        message = f"DELA has {card.number:g} delaminations, but {interfaces}."
        place = card.place("number of delaminations")
        yield Report(message, place, "a blank takes one, whose threshold is the highest")


@rule("W471", Subject.DAMAGE)
def strengths_without_criteria(problem: Problem, card: model.Allowables) -> Reports:
    """ALLO is given without FAIL.

    No exposure is computed.

    Remedy: FAIL in the loop of RODP.
    """
    if all(macro.word != "FAIL" for macro in flat(problem.program)):
        message = "ALLO has strengths, but the program has no FAIL: no exposure is computed."
        yield Report(message, card.place(), "put FAIL into the loop of RODP")


@rule("W472", Subject.DAMAGE)
def few_evaluations(problem: Problem, cards: list[model.Macro]) -> Reports:
    """FAIL is evaluated at too few times of an impact.

    It is outside the loop of RODP, or evaluated less than 20 times at an interval above 1: the
    largest exposure may be missed.

    Remedy: FAIL in the loop, a smaller N.
    """
    count = problem.work.passes["FAIL"]
    if not problem.has_impact or count == 0:  # W510 reports it
        return
    loops = [item for item in problem.program if isinstance(item, Loop)]
    stepping = [loop for loop in loops if "RODP" in {macro.word for macro in flat(loop.body)}]
    inside = any(macro.word == "FAIL" for loop in stepping for macro in flat(loop.body))
    if stepping and not inside:
        message = (
            "FAIL is outside the loop of RODP: it sees the plate at one time only, not at the peak."
        )
        yield Report(message, cards[0].place("macro"), "put FAIL into the loop of RODP")
    elif count < ENOUGH_EVALUATIONS and every(cards[0]) > 1:
        message = (
            f"FAIL is evaluated {count} time{'s' * (count > 1)} in {problem.work.steps} steps: the "
            "largest exposures may be missed."
        )
        best = int(np.clip(problem.work.steps // 200, 1, every(cards[0]) - 1))
        hint = f"FAIL,,{best} evaluates it more often"
        yield Report(message, cards[0].place("value"), hint)


@rule("W489", Subject.DAMAGE)
def preload_beyond_strength(problem: Problem, card: model.Preload) -> Reports:
    """The preload alone fails a ply.

    A criterion of FAIL is at 1 or above under PREL, before anything moves.

    Remedy: A smaller preload; the units of PREL, force/length, and of ALLO.
    """
    worst = problem.worst_under(cure=False)
    if worst is not None and worst[0].exposure >= 1.0:
        exposure, laminate = worst
        where = exposed(problem.deck, laminate, exposure)
        message = f"The preload alone reaches exposure {exposure.exposure:.3g}: {where}."
        yield Report(message, card.place(), "PREL is a force per length, tension positive")


@rule("W541", Subject.DAMAGE)
def threshold_of_a_sandwich(problem: Problem, card: model.Delamination) -> Reports:
    """DELA has no effect: the plate is a sandwich.

    The threshold holds for a solid laminate. The faces of a sandwich delaminate, or leave the
    core, at a small fraction of the threshold, which is not computed.

    Remedy: Remove DELA; FAIL has the exposures of faces and core.
    """
    if problem.laminate.has_core:
        message = (
            "The plate has a core: the threshold of DELA holds for a solid laminate and is not "
            "computed. The faces delaminate, or leave the core, far below it."
        )
        yield Report(message, card.place(), "remove DELA; FAIL has the exposures of the core")


@rule("N559", Subject.DAMAGE)
def puck_of_a_fabric(problem: Problem, card: model.Allowables) -> Reports:
    """FAIL leaves out Puck's criterion for the plies of a fabric.

    The criterion holds for unidirectional plies. A ply is a fabric if E2 is near E1, and G12 far
    below.

    Remedy: The other criteria are evaluated; none of them is made for fabrics either.
    """
    for strengths, ply in _strengths(problem, card):
        if is_fabric(ply):
            message = (
                f"The ply is a fabric (E2/E1 = {ply.e2 / ply.e1:.2g}, G12/E2 = "
                f"{ply.g12 / ply.e2:.2g}): Puck's criterion, of unidirectional plies, is left out."
            )
            hint = "judge it by the other criteria, and by tests of the fabric"
            yield Report(message, strengths.place(), hint)


@rule("N560", Subject.DAMAGE)
def limited_slope(problem: Problem, card: model.Allowables) -> Reports:
    """Puck's slope p+ is above S12/YT, and is taken as S12/YT.

    With a larger slope the exposure at YT would not be 1.

    Remedy: Check YT and S12, or give p+ on the second card of ALLO.
    """
    for strengths, ply in _strengths(problem, card):
        is_endless = strengths.yt > ENDLESS * ply.e2
        slope = puck_slope(ply_strengths(strengths, ply))
        if is_fabric(ply) or is_endless or slope == strengths.p_plus:
            continue
        message = (
            f"Puck's slope p+ = {strengths.p_plus:g} is above S12/YT = {slope:.3g}, which is taken "
            "instead: the exposure at YT must be 1."
        )
        yield Report(message, strengths.place(), "check YT and S12")


@rule("N589", Subject.DAMAGE)
def cluster_at_far_face(problem: Problem) -> Reports:
    """Three or more like plies lie together at the face away from the impact.

    Bending cracks them early, and the crack opens their interface: tests of such laminates had
    damage from half the energy of the delamination threshold.

    Remedy: Quote the lowest criterion of FAIL beside the threshold.
    """
    layers = list(problem.deck.layers.values())[problem.laminate_number]
    last, count = layers[-1], 0
    for layer in reversed(layers):
        if (layer.angle, layer.material) != (last.angle, last.material):
            break
        count += 1
    if CLUSTER <= count < len(layers):
        message = (
            f"{count} like plies lie together at the far face: they crack in bending, and their "
            "interface opens, before the threshold of DELA."
        )
        hint = "quote the lowest exposure of FAIL beside the threshold"
        yield Report(message, last.place("fibre angle"), hint)


@reports("E497")
def strengths_of_missing_material(deck: model.Deck, card: model.Allowables) -> Reports:
    """Find materials of ALLO that the deck does not have."""
    numbers = material_numbers(deck)
    for strengths in (card, *card.others):
        if strengths.material not in numbers:
            yield unknown_material(strengths.material, numbers, strengths.place("material"))


@rule("W498", Subject.DAMAGE)
def layers_without_strengths(problem: Problem, card: model.Allowables) -> Reports:
    """FAIL has no strengths of some layers.

    The exposures of these layers and of the interfaces beside them are not known (NaN).

    Remedy: A pair of cards on ALLO for their material.
    """
    deck = problem.deck
    if all(macro.word != "FAIL" for macro in flat(problem.program)):
        return
    for n, (number, layers) in enumerate(deck.layers.items()):
        if n not in problem.used_laminates:
            continue
        missing = [i for i, layer in enumerate(layers, start=1) if card.of(layer.material) is None]
        if missing:
            materials = sorted({layers[i - 1].material for i in missing})
            named = "layer" if len(missing) == 1 else "layers"
            listed = ", ".join(map(str, missing))
            of = " and ".join(map(str, materials))
            message = (
                f"ALLO has no strengths of {named} {listed} of laminate {number}, material {of}."
            )
            yield Report(message, card.place(), "their exposures are NaN")


OF_MATERIALS = (strengths_of_missing_material,)
OF_STRENGTHS = (invalid_strength, invalid_constant_of_criterion)
OF_DELAMINATION = (invalid_delamination,)
OF_THRESHOLD = (coupled_threshold, twisted_threshold)
OF_EVALUATIONS = (few_evaluations,)
OF_PRELOAD = (preload_beyond_strength,)
OF_LAYUP = (cluster_at_far_face,)
# One of these is enough.
STRENGTHS = (strengths_in_another_unit, strengths_in_another_order, weak_in_shear)
VALUES_OF_STRENGTHS = (
    layers_without_strengths,
    strengths_without_criteria,
    puck_of_a_fabric,
    limited_slope,
)
VALUES_OF_DELAMINATION = (threshold_of_a_sandwich, doubtful_toughness, too_many_delaminations)
