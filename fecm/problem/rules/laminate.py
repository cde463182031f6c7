"""Rules about MATE and SHEA: integration orders, constants of the ply, layers, shear."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from fecm.deck import model
from fecm.deck.layup import LARGEST_ANGLE
from fecm.deck.rules import Report, Reports, Subject, rule
from fecm.mechanics.elements import HIGHEST_ORDER
from fecm.mechanics.laminate import are_cores
from fecm.problem.problem import Problem

THICKNESS_TOLERANCE = 1.0e-6  # difference of thicknesses that is rounding
LARGEST_RATIO = 1e12  # of the transverse shear moduli of a ply
THINNEST = 1.0e-4  # thickness over the longer side of the plate
# Thickness over the distance between supports above which plate theory is inaccurate, and above
# which it fails.
THICK = 0.1
THICKEST = 0.25
# Difference from elasticity: docs/plies.md, from Pagano's exact solution.
ERRORS = (
    "at 0.1 the deflection of a [0/90/0] plate with E1/E2 = 25 is 16 % too small and its largest "
    "stress 12 %, at 0.25 they are 22 % and 44 %; isotropic plates are closer"
)
LOWEST_RATIO = 0.5  # E1/E2 of a ply whose fibres are along 1
# E1/E2 above which a ply has parallel fibres, and the least and largest NU12 of such plies.
FIBROUS = 3.0
LEAST_NU12, MOST_NU12 = 0.1, 0.6
LARGEST_MODULI_RATIO = 120.0  # E1/E2; plies of pitch fibres have 100
# Plies of carbon, glass, aramid and boron fibres have G12/E2 and G13/E2 from 0.3 to 0.8 and G23/E2
# from 0.33 to 0.4; wood has up to 1.6. Outside these limits a digit is missing or too many.
SHEAR_OF_FIBROUS = {"G12": (0.12, 2.0), "G13": (0.12, 2.0), "G23": (0.06, 2.0)}
MOST_EXCHANGED = 1.3  # G23/G13 and G13/G12 of plies of parallel fibres are below; boron has 1.2
SAME_SHEAR = 0.1  # relative difference from an isotropic solid's shear modulus
OTHER_SHEAR = 1.5  # factor on that modulus above which a digit is missing or too many
# E1/E2 of a ply with the shear moduli and NU12 of parallel fibres, but one modulus of ten times or
# a tenth of its value; unbalanced fabrics have smaller NU12, and G12 between the two ratios.
LOST_DIGIT = (1.1, 2.5)
TOO_MANY, TOO_FEW = "looks like it has a digit too many", "looks like it has a digit too few"
NU12_OF_FIBRES = (0.2, 0.4)
STIFF_IN_SHEAR, SOFT_IN_SHEAR = 0.41, 0.1  # G12/E2
FIELD = "shear correction factor"
LEAST_FACTOR = 0.5  # shear correction factor of a solid laminate
SHOWN_ANGLES = 8
SHARES = 3  # of plies at 0, ±45 and 90 degrees
POISSONS_RATIO = "Poisson's ratio NU12"


@rule("W401", Subject.LAMINATE)
def unknown_order(material: model.Material) -> Reports:
    """L1 or L2 is outside 1 to 4.

    Remedy: The nearest of these is used.
    """
    card = material.integration
    for name, order in (("bending order L1", card.bending), ("shear order L2", card.shear)):
        if not 1 <= order <= HIGHEST_ORDER:
            used = min(HIGHEST_ORDER, max(1, order))
            message = f"The {name} is {order}; {used} is used instead."
            yield Report(message, card.place(name))


@rule("E402", Subject.LAMINATE)
def unknown_stress_points(material: model.Material) -> Reports:
    """The stress-point order K is not 1 to 4 or -1 to -4.

    Remedy: K > 0: Gauss points; K < 0: nodal points.
    """
    card = material.integration
    if not 1 <= abs(card.points) <= HIGHEST_ORDER:
        must = "1 to 4 (Gauss points) or -1 to -4 (nodal points)"
        message = f"The stress-point order K is {card.points}; it must be {must}."
        yield Report(message, card.place("stress-point order K"))


Plies = model.Material | model.Materials
Layers = model.Material | model.NumberedLaminate


def _plies_of(segment: Plies) -> list[model.Ply]:
    """Return the materials of a segment."""
    if isinstance(segment, model.Material):
        return [segment.ply]
    return [numbered.ply for numbered in segment.plies]


def _invalid_constants(ply: model.Ply) -> list[tuple[str, float]]:
    """Yield name and value of a ply's constants that must be positive and are not."""
    named = zip((field.name for field in ply.fields), map(float, ply.row()), strict=True)
    return [(name, value) for name, value in named if value <= 0.0 and name != POISSONS_RATIO]


@rule("E403", Subject.LAMINATE)
def invalid_constant(segment: Plies) -> Reports:
    """A constant of the ply is not positive.

    Remedy: Correct MATE or MATS.
    """
    for ply in _plies_of(segment):
        for name, value in _invalid_constants(ply):
            yield Report(f"The {name} is {value:g}; it must be positive.", ply.place(name))


@rule("E534", Subject.LAMINATE)
def unequal_shear_moduli(segment: Plies) -> Reports:
    """G13 and G23 of a ply differ by a factor of more than 1e12.

    Their stiffness can't be inverted within the precision of numbers.

    Remedy: Correct MATE or MATS.
    """
    for ply in _plies_of(segment):
        small, large = sorted((ply.g13, ply.g23))
        if not _invalid_constants(ply) and small < large / LARGEST_RATIO:
            message = (
                f"G13 = {ply.g13:g} and G23 = {ply.g23:g} differ by a factor of more than "
                f"{LARGEST_RATIO:g}."
            )
            yield Report(message, ply.place("shear modulus G13"))


@rule("E404", Subject.LAMINATE)
def impossible_poissons_ratio(segment: Plies) -> Reports:
    """NU12² is not below E1/E2.

    Remedy: NU12 of fibre composites is 0.2 to 0.4.
    """
    for ply in _plies_of(segment):
        # The square of nu12 against E1/E2, written so that no number overflows.
        if not _invalid_constants(ply) and abs(ply.nu12) >= (ply.e1 / ply.e2) ** 0.5:
            why = f"its square must stay below E1/E2 = {ply.e1 / ply.e2:g}"
            message = f"Poisson's ratio NU12 = {ply.nu12:g} is too large: {why}."
            exchanged = ply.e1 / ply.e2 < LOWEST_RATIO
            hint = "E1 is along the fibres: E1 and E2 look exchanged" if exchanged else ""
            yield Report(message, ply.place(POISSONS_RATIO), hint)


@rule("E405", Subject.LAMINATE)
def invalid_layer_thickness(laminate: Layers) -> Reports:
    """The thickness of a layer is not positive.

    Remedy: Correct the layer.
    """
    for position, layer in enumerate(laminate.layers, start=1):
        if layer.thickness <= 0.0:
            what = f"Layer {position} has the thickness {layer.thickness:g}"
            yield Report(f"{what}; it must be positive.", layer.place("layer thickness"))


@rule("W408", Subject.LAMINATE)
def layer_out_of_order(laminate: Layers) -> Reports:
    """The number of a layer differs from its position.

    Remedy: Layers are stacked in the order of their cards.
    """
    for position, layer in enumerate(laminate.layers, start=1):
        if layer.number != position:
            why = "layers are stacked in the order of their cards, whatever their numbers"
            message = f"Layer {position} has the number {layer.number}: {why}."
            yield Report(message, layer.place("layer"))


@rule("E406", Subject.LAMINATE)
def invalid_thickness(material: model.Material) -> Reports:
    """The total thickness is not positive.

    Remedy: Correct MATE.
    """
    card = material.integration
    if card.thickness <= 0.0:
        message = f"The total thickness is {card.thickness:g}; it must be positive."
        yield Report(message, card.place("total thickness"))


@rule("E407", Subject.LAMINATE)
def layers_do_not_add_up(material: model.Material) -> Reports:
    """The layers together are not as thick as MATE says.

    Remedy: Stiffness follows the layers, inertia the card: they must agree.
    """
    card, thicknesses = material.integration, [layer.thickness for layer in material.layers]
    total, stated = sum(thicknesses), card.thickness
    if stated <= 0.0 or any(h <= 0.0 for h in thicknesses):
        return
    if abs(total - stated) > THICKNESS_TOLERANCE * stated:
        message = f"The layers are {total:g} thick together, the MATE card says {stated:g}."
        hint = "stiffness follows the layers, inertia the card: they must agree"
        yield Report(message, card.place("total thickness"), hint)


@rule("W433", Subject.LAMINATE)
def moduli_exchanged(problem: Problem) -> Reports:
    """E1 is below E2/2.

    Remedy: E1 is the modulus along the fibres.
    """
    for ply in problem.deck.plies.values():
        if ply.e1 / ply.e2 < LOWEST_RATIO:
            why = "E1 is the modulus along the fibres"
            message = f"E1 = {ply.e1:g} is less than half of E2 = {ply.e2:g}: {why}."
            yield Report(message, ply.place("Young's modulus E1"))


@rule("W434", Subject.LAMINATE)
def doubtful_poissons_ratio(problem: Problem) -> Reports:
    """NU12 is beyond 1, or outside 0.1 to 0.6 in a ply with E1 > 3 E2.

    The value may be NU21, or its decimal point is misplaced.

    Remedy: NU12 of fibre composites is 0.2 to 0.4; NU12 = NU21 E1/E2.
    """
    for ply in problem.deck.plies.values():
        ratio, nu, place = ply.e1 / ply.e2, ply.nu12, ply.place(POISSONS_RATIO)
        if abs(nu) > 1.0:
            message = f"Poisson's ratio NU12 = {nu:g} is beyond 1: no ply has such a value."
            yield Report(message, place, "NU12 of fibre composites is 0.2 to 0.4")
        elif ratio <= FIBROUS or nu == 0.0 or LEAST_NU12 <= nu <= MOST_NU12:
            continue
        elif 0.0 < nu < LEAST_NU12 and 0.2 <= nu * ratio <= 0.45:
            why = f"NU12 would be NU21 E1/E2 = {nu * ratio:.3g}"
            message = f"Poisson's ratio NU12 = {nu:g} looks like NU21: {why}."
            hint = "NU12 is the contraction across the fibres under a stress along them"
            yield Report(message, place, hint)
        else:
            message = f"Poisson's ratio NU12 = {nu:g} is unlike any ply of parallel fibres."
            yield Report(message, place, "NU12 of fibre composites is 0.2 to 0.4")


def is_fibrous(ply: model.Ply) -> bool:
    """Return whether a ply has parallel fibres; the cells of a core are stiffer in shear."""
    return ply.e1 > FIBROUS * ply.e2 and max(ply.g13, ply.g23) < ply.e1


@rule("W583", Subject.LAMINATE)
def doubtful_shear_modulus(problem: Problem) -> Reports:
    """A shear modulus suits neither E2 nor the other shear moduli.

    A digit of the modulus, or of E2, is likely missing or too many. In plies of parallel fibres G12
    and G13 are 0.12 to 2 times E2, G23 is 0.06 to 2 times E2. In an isotropic ply two shear moduli
    are E/(2 (1 + NU12)), and the third is not.

    Remedy: G12, G13 and G23 of fibre composites are 0.3 to 0.8 of E2.
    """
    for ply in problem.deck.plies.values():
        moduli = {"G12": ply.g12, "G13": ply.g13, "G23": ply.g23}
        if is_fibrous(ply) and ply.e1 <= LARGEST_MODULI_RATIO * ply.e2:  # W584 reports it
            wrong = {
                name: f"{name}/E2 = {moduli[name] / ply.e2:.2g}"
                for name, (least, most) in SHEAR_OF_FIBROUS.items()
                if not least * ply.e2 <= moduli[name] <= most * ply.e2
            }
            if wrong:
                message = f"{' and '.join(wrong.values())}, unlike in any ply of parallel fibres."
                hint = (
                    "G12, G13 and G23 are 0.3 to 0.8 of E2: a digit of the shear modulus or of E2 "
                    "is missing or too many"
                )
                yield Report(message, ply.place(f"shear modulus {next(iter(wrong))}"), hint)
        shear = ply.e1 / (2.0 * (1.0 + ply.nu12))
        unlike = [
            name for name, modulus in moduli.items() if abs(modulus / shear - 1.0) > SAME_SHEAR
        ]
        if abs(ply.e1 / ply.e2 - 1.0) < SAME_SHEAR and len(unlike) == 1:
            (name,) = unlike
            if not 1.0 / OTHER_SHEAR <= moduli[name] / shear <= OTHER_SHEAR:
                message = (
                    f"{name} = {moduli[name]:g} differs from the other two shear moduli, which are "
                    f"those of an isotropic ply, E/(2 (1 + NU12)) = {shear:.4g}."
                )
                hint = "a metal has three equal shear moduli"
                yield Report(message, ply.place(f"shear modulus {name}"), hint)


@rule("W584", Subject.LAMINATE)
def moduli_with_lost_digit(problem: Problem) -> Reports:
    """E1/E2 is above 120, or near 1 in a ply that is otherwise one of fibres.

    A digit of E1 or E2 is likely missing or too many, or one of them is in another unit. A ply of
    fabric has E1/E2 near 1 too, but a smaller NU12, and G12 of 0.1 to 0.4 E2.

    Remedy: E1/E2 of plies of glass fibres is about 3, of carbon fibres 10 to 25.
    """
    for ply in problem.deck.plies.values():
        if (suspect := _modulus_with_lost_digit(ply)) is None:
            continue
        name, fault = suspect
        message = (
            f"E1/E2 = {ply.e1 / ply.e2:.3g} with G12/E2 = {ply.g12 / ply.e2:.2g} and NU12 = "
            f"{ply.nu12:g} is unlike any ply: {name} = {getattr(ply, name.lower()):g} "
            f"{fault}."
        )
        hint = "E1/E2 is about 3 for glass fibres, and 10 to 25 for carbon fibres"
        yield Report(message, ply.place(f"Young's modulus {name}"), hint)


def _modulus_with_lost_digit(ply: model.Ply) -> tuple[str, str] | None:
    """Return the modulus that is out of order, and what it seems to be."""
    ratio, shear = ply.e1 / ply.e2, ply.g12 / ply.e2
    if ratio > LARGEST_MODULI_RATIO:
        least, most = SHEAR_OF_FIBROUS["G12"]
        name, fault = ("E1", TOO_MANY) if least <= shear <= most else ("E2", TOO_FEW)
        return name, fault if ratio < 10.0 * LARGEST_MODULI_RATIO else "seems to be in another unit"
    (low, high), (least, most) = LOST_DIGIT, NU12_OF_FIBRES
    if not (low < ratio < high and least <= ply.nu12 <= most):
        return None
    if shear > STIFF_IN_SHEAR and 2.0 * min(ply.g13, ply.g23) > ply.g12:
        return "E1", TOO_FEW
    return ("E2", TOO_MANY) if shear < SOFT_IN_SHEAR else None


@rule("W585", Subject.LAMINATE)
def exchanged_shear_moduli(problem: Problem) -> Reports:
    """The shear moduli of a ply of parallel fibres are in another order.

    G12 is more than 1.3 times smaller than G13 and G23, or G13 than G23. In such plies G13 is
    about G12, and G23 is smaller.

    Remedy: G12, G13, G23.
    """
    for ply in problem.deck.plies.values():
        if not is_fibrous(ply):
            continue
        if min(ply.g13, ply.g23) > MOST_EXCHANGED * ply.g12:
            first, others = "G12", f"G13 = {ply.g13:g} and G23 = {ply.g23:g}"
        elif ply.g23 > MOST_EXCHANGED * ply.g13:
            first, others = "G13", f"G23 = {ply.g23:g}"
        else:
            continue
        value = getattr(ply, first.lower())
        message = (
            f"{first} = {value:g} is far below {others}, unlike in any ply of parallel fibres: the "
            "shear moduli look exchanged."
        )
        hint = "the order is G12, G13, G23; G13 is about G12, and G23 is smaller"
        yield Report(message, ply.place(f"shear modulus {first}"), hint)


@rule("W586", Subject.POINTS)
def small_factor(problem: Problem, card: model.Shear) -> Reports:
    """The shear correction factor of a solid laminate is below 0.5.

    Remedy: 5/6 for one material, 0.6 to 0.9 for laminates; `SHEA EQUI` computes it.
    """
    if card.factor < LEAST_FACTOR and not problem.laminate.has_core:
        message = f"The shear correction factor is {card.factor:g}, below {LEAST_FACTOR:g}."
        hint = "laminates have 0.6 to 0.9, one material 5/6; SHEA EQUI needs no factor"
        yield Report(message, card.place(FIELD), hint)


@rule("W558", Subject.LAMINATE)
def thin_core(problem: Problem) -> Reports:
    """The core of a sandwich is thinner than its thinnest ply.

    The thickness of the core is likely in another unit, as in 0.012 for 12 mm.

    Remedy: The thickness of the core in the deck's unit of length.
    """
    plies = problem.deck.plies
    for layers in problem.deck.layers.values():
        soft = are_cores([plies[layer.material] for layer in layers])
        thinnest = min(
            layer.thickness for layer, is_core in zip(layers, soft, strict=True) if not is_core
        )
        for layer, is_core in zip(layers, soft, strict=True):
            if is_core and layer.thickness < thinnest:
                message = (
                    f"The core is {layer.thickness:g} thick, less than the thinnest ply of the "
                    f"faces, {thinnest:g}."
                )
                hint = "the thickness of a core is in the deck's unit of length, as for plies"
                yield Report(message, layer.place("layer thickness"), hint)


@rule("W562", Subject.LAMINATE)
def shares_as_angles(problem: Problem) -> Reports:
    """The angles look like shares in per cent.

    25/50/25 may mean 25 % of plies at 0, 50 % at ±45 and 25 % at 90 degrees.

    Remedy: The angle of every ply, as in `[0/45/-45/90]s`.
    """
    for layers in problem.deck.layers.values():
        angles = [layer.angle for layer in layers]
        half = angles[: len(angles) // 2] if angles == angles[::-1] else []
        for shares in (angles, half):
            if len(shares) == SHARES and min(shares) > 0.0 and sum(shares) == 100.0:
                listed = "/".join(f"{angle:g}" for angle in shares)
                message = f"The angles {listed} add up to 100: they look like shares in per cent."
                yield Report(message, layers[0].place("fibre angle"), "give the angle of every ply")
                break


@rule("W431", Subject.LAMINATE)
def large_angle(problem: Problem) -> Reports:
    """A fibre angle is beyond ±180.

    Remedy: Degrees, counter-clockwise from the x-axis.
    """
    for layer in _all_layers(problem):
        if abs(layer.angle) > LARGEST_ANGLE:
            message = f"The fibre angle {layer.angle:g} is beyond {LARGEST_ANGLE:g} degrees."
            hint = "angles are in degrees, counter-clockwise from the x-axis"
            yield Report(message, layer.place("fibre angle"), hint)


@rule("W432", Subject.LAMINATE)
def angles_in_radians(problem: Problem) -> Reports:
    """All fibre angles are multiples of 5° in radians.

    Remedy: Degrees.
    """
    turned = [layer for layer in _all_layers(problem) if layer.angle]
    if turned and are_like_radians([layer.angle for layer in turned]):
        distinct = dict.fromkeys(layer.angle for layer in turned[:SHOWN_ANGLES])
        shown = ", ".join(f"{angle:g} is {math.degrees(angle):.0f} degrees" for angle in distinct)
        message = f"The fibre angles look like radians: {shown}."
        yield Report(message, turned[0].place("fibre angle"), "angles are in degrees")


def _all_layers(problem: Problem) -> list[model.Layer]:
    """Return the layers of all laminates."""
    return [layer for layers in problem.deck.layers.values() for layer in layers]


def are_like_radians(angles: Sequence[float]) -> bool:
    """Return whether all angles are small multiples of 5 degrees in radians."""
    sizes = np.abs(angles)
    multiples = np.degrees(sizes) / 5.0
    off = np.abs(multiples - np.rint(multiples))
    return bool(((sizes > 0.08) & (sizes <= 1.6) & (off < 0.08)).all())


def _is_too_thin(problem: Problem) -> bool:
    return _thickest(problem) < THINNEST * problem.longer_side


def _thickest(problem: Problem) -> float:
    """Return the thickness of the plate, the largest of several laminates."""
    laminates = problem.plate.laminates
    return max(laminates[number].thickness for number in problem.used_laminates)


def _thick_plate(problem: Problem) -> tuple[float, str]:
    """Return thickness over distance between supports, and the start of a sentence about it."""
    thickness = _thickest(problem)
    span = problem.span
    share = thickness / span.length
    return share, f"thickness {thickness:g} is {share:.2g} of the {span.name} {span.length:.4g}"


@rule("W430", Subject.LAMINATE)
def impossible_thickness(problem: Problem) -> Reports:
    """The plate is far too thin, or too thick.

    The thickness is below 10⁻⁴ of the longer side, or above 1/4 of the distance between supports
    (without supports, of the shorter side).

    Remedy: One unit of length for thickness and coordinates.
    """
    card, side = problem.deck.require(model.Material).integration, problem.longer_side
    thickness, place = _thickest(problem), card.place("total thickness")
    hint = "thickness and coordinates must be in the same unit of length"
    if _is_too_thin(problem):
        of_side = f"{thickness / side:.2g} of the plate's longer side {side:g}"
        message = f"The thickness {thickness:g} is {of_side}, less than {THINNEST:g}."
        yield Report(message, place, hint)
        return
    share, what = _thick_plate(problem)
    if share > THICKEST:
        message = f"The {what}, more than {THICKEST:g}: plate theory does not hold; {ERRORS}."
        yield Report(message, place, hint)


@rule("N430", Subject.LAMINATE)
def thick_plate(problem: Problem) -> Reports:
    """The thickness is above 1/10 of the distance between supports.

    [Plate theory](assumptions.md#plate-theory) is off by more than 10 %.

    Remedy: `SHEA EQUI`; a thinner plate, or elasticity in three dimensions.
    """
    if _is_too_thin(problem):
        return
    share, what = _thick_plate(problem)
    if THICK * (1.0 + 1e-9) < share <= THICKEST:
        place = problem.deck.require(model.Material).integration.place("total thickness")
        card = problem.deck.last(model.Shear)
        has_equilibrium = card is not None and card.equilibrium
        subject = "the deck has SHEA EQUI, which" if has_equilibrium else "SHEA EQUI"
        hint = f"{subject} reduces the error of this deflection to 1 % at 0.1"
        yield Report(f"the {what}: {ERRORS}", place, hint)


OF_MATERIAL = (
    unknown_order,
    unknown_stress_points,
    invalid_constant,
    unequal_shear_moduli,
    impossible_poissons_ratio,
    invalid_layer_thickness,
    layer_out_of_order,
    invalid_thickness,
    layers_do_not_add_up,
)
OF_MATERIALS = (invalid_constant, unequal_shear_moduli, impossible_poissons_ratio)
OF_LAYERS = (invalid_layer_thickness, layer_out_of_order)
VALUES = (
    moduli_exchanged,
    doubtful_poissons_ratio,
    moduli_with_lost_digit,
    doubtful_shear_modulus,
    exchanged_shear_moduli,
    thin_core,
    large_angle,
    shares_as_angles,
    angles_in_radians,
    impossible_thickness,
    thick_plate,
)


@rule("E427", Subject.POINTS)
def invalid_factor(segment: model.Shear) -> Reports:
    """The shear correction factor is not positive.

    Remedy: 1 as in the report, or π²/12.
    """
    if not segment.factor > 0.0:
        message = f"The shear correction factor is {segment.factor:g}; it must be positive."
        hint = "1 as in the report, or pi^2/12 = 0.822467"
        yield Report(message, segment.place(FIELD), hint)


@rule("W428", Subject.POINTS)
def large_factor(segment: model.Shear) -> Reports:
    """The shear correction factor is more than 1.

    Remedy: At most 1.
    """
    if segment.factor > 1.0:
        message = f"The shear correction factor is {segment.factor:g}, more than 1."
        yield Report(message, segment.place(FIELD))


@rule("W481", Subject.POINTS)
def factor_with_equilibrium(segment: model.Shear) -> Reports:
    """SHEA EQUI has a factor other than 1.

    The stiffness is reduced twice.

    Remedy: Leave out the factor.
    """
    if segment.equilibrium and segment.factor != 1.0:
        message = (
            f"SHEA has EQUI and the factor {segment.factor:g}: the stiffness from equilibrium is "
            "reduced once more."
        )
        hint = "leave out the factor's card; a factor is for the sum of the plies' stiffnesses"
        yield Report(message, segment.place(FIELD), hint)


VALUES_OF_SHEAR = (small_factor,)
OF_SHEAR = (invalid_factor, large_factor, factor_with_equilibrium)
