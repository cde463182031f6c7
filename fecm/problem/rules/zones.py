"""Rules about plates of several materials and laminates: MATS, LAMS, ZONE."""

from __future__ import annotations

from collections.abc import Iterator

from fecm.deck import model
from fecm.deck.findings import CardPlace
from fecm.deck.material_cards import MATERIAL
from fecm.deck.rules import Report, Reports, Subject, rule
from fecm.mechanics.laminate import LaminateSection
from fecm.problem.problem import Problem

LARGEST_COUPLING = 0.02  # of I1 over I0 h without a warning
# Segments whose unreadable cards would be missing materials and laminates.
KEYWORDS = {kind.keyword for kind in (model.Material, model.Materials, model.Laminates)}


def _materials(deck: model.Deck) -> tuple[model.NumberedPly, ...]:
    card = deck.last(model.Materials)
    return () if card is None else card.plies


def _laminates(deck: model.Deck) -> tuple[model.NumberedLaminate, ...]:
    card = deck.last(model.Laminates)
    return () if card is None else card.laminates


def unknown_material(number: int, known_numbers: set[int], place: CardPlace | None) -> Report:
    """Report a material that the deck does not have."""
    numbers = ", ".join(map(str, sorted(known_numbers)))
    return Report(f"The deck has no material {number}.", place, f"its materials are {numbers}")


def material_numbers(deck: model.Deck) -> set[int]:
    """Return the numbers of the materials."""
    return {MATERIAL, *(material.number for material in _materials(deck))}


@rule("E496", Subject.LAMINATE)
def number_taken(deck: model.Deck) -> Reports:
    """A number on MATS or LAMS is below 2, or taken.

    Number 1 is the material, and the laminate, of MATE.

    Remedy: A number from 2 for each.
    """
    heads = (("material", _materials(deck)), ("laminate", _laminates(deck)))
    for kind, numbered in heads:
        seen: set[int] = set()
        for item in numbered:
            if item.number <= MATERIAL or item.number in seen:
                why = "taken" if item.number in seen else "MATE's or less"
                message = f"The number {item.number} of a {kind} is {why}."
                yield Report(message, item.head.place(kind), f"a {kind} has a number from 2")
            seen.add(item.number)


def _in_layers(deck: model.Deck) -> Iterator[model.Layer]:
    """Return the layers of all laminates, with or without a zone."""
    material = deck.last(model.Material)
    yield from () if material is None else material.layers
    for laminate in _laminates(deck):
        yield from laminate.layers


@rule("E497", Subject.LAMINATE)
def missing_material(deck: model.Deck) -> Reports:
    """A card has a material that the deck does not have, or a laminate no layers.

    Materials are MATE's, number 1, and those on MATS.

    Remedy: The material's cards on MATS, or another number.
    """
    numbers = material_numbers(deck)
    for layer in _in_layers(deck):
        if layer.material not in numbers:
            yield unknown_material(layer.material, numbers, layer.place("material"))
    for laminate in _laminates(deck):
        if not laminate.layers:
            message = f"Laminate {laminate.number} has no layers."
            yield Report(message, laminate.head.place("layers"))


@rule("E498", Subject.LAMINATE)
def invalid_zone(deck: model.Deck, card: model.Zones) -> Reports:
    """A zone has an element or a laminate that the deck does not have.

    Remedy: Elements up to NUMEL; laminate 1 is MATE's, the others are on LAMS.
    """
    count = deck.control.numel
    laminate_numbers = {MATERIAL, *(laminate.number for laminate in _laminates(deck))}
    for zone in card.records:
        last = zone.last or zone.first
        for number, name in ((zone.first, "first element"), (last, "last element")):
            if not 1 <= number <= count:
                message = f"A zone has element {number}; the deck has elements 1 to {count}."
                yield Report(message, zone.place(name))
        if last < zone.first or zone.step < 0:
            message = f"A zone from element {zone.first} to {last} by {zone.step or 1} is empty."
            yield Report(message, zone.place("last element"), "a blank step is 1")
        if zone.laminate not in laminate_numbers:
            numbers = ", ".join(map(str, sorted(laminate_numbers)))
            message = f"The deck has no laminate {zone.laminate}."
            yield Report(message, zone.place("laminate"), f"its laminates are {numbers}")


@rule("W500", Subject.LAMINATE)
def unused(problem: Problem) -> Reports:
    """A material or a laminate of the deck is not used.

    No layer has the material, or no zone the laminate.

    Remedy: Material in columns 21-25 of a layer; ZONE; or remove the cards.
    """
    deck = problem.deck
    in_layers = {layer.material for layers in deck.layers.values() for layer in layers}
    for material in _materials(deck):
        if material.number not in in_layers:
            message = f"No layer of the plate has material {material.number}."
            yield Report(message, material.head.place(), "a layer's material is in columns 21-25")
    used = [number for n, number in enumerate(deck.layers) if n in problem.used_laminates]
    for laminate in _laminates(deck):
        if laminate.number not in used:
            message = f"No element has laminate {laminate.number}."
            yield Report(message, laminate.head.place(), "ZONE gives elements their laminates")


def _used(problem: Problem) -> list[tuple[int, LaminateSection]]:
    """Return the materials and laminates of the elements."""
    numbers, laminates = list(problem.deck.layers), problem.plate.laminates
    return [(numbers[n], laminates[n]) for n in problem.used_laminates]


def _place(deck: model.Deck, number: int) -> CardPlace | None:
    """Return the position of the cards of a laminate."""
    matches = (item for item in _laminates(deck) if item.number == number)
    if (laminate := next(matches, None)) is not None:
        return laminate.head.place()
    return deck.require(model.Material).place()


@rule("W497", Subject.LAMINATE)
def coupled_inertia(problem: Problem) -> Reports:
    """The mass of the laminate is not symmetric about its middle.

    Its first moment I1 is above 0.02 of its mass times the thickness, and is left out.

    Remedy: Accept it: the lowest frequencies change far less. Or a symmetric laminate.
    """
    for number, laminate in _used(problem):
        share = abs(laminate.coupling_inertia) / (laminate.mass * laminate.thickness)
        if share > LARGEST_COUPLING:
            message = f"I1 of laminate {number} is {share:.2g} I0 h: it is left out."
            hint = "I1 = 0.027 I0 h changes the lowest frequency of an example by 7E-6"
            yield Report(message, _place(problem.deck, number), hint)


@rule("W466", Subject.POINTS)
def soft_core(problem: Problem) -> Reports:
    """A core is far softer in shear than the faces, and the deck has no SHEA EQUI.

    G13 of a ply is below 1/50 of the largest. The sum of the plies' shear stiffnesses is then
    several times too large.

    Remedy: `SHEA EQUI`.
    """
    deck = problem.deck
    shear = deck.last(model.Shear) or model.Shear()
    if shear.equilibrium or shear.factor != 1.0:
        return
    for number, laminate in _used(problem):
        moduli = [ply.g13 for ply in laminate.plies.constants]
        if laminate.has_core:
            ratio = max(moduli) / min(moduli)
            message = (
                f"Laminate {number} has a core whose G13 is {ratio:.3g} times below the "
                "faces' G13: the plate is too stiff in shear."
            )
            yield Report(message, shear.place() or _place(deck, number), "use SHEA EQUI")


OF_DECK = (number_taken, missing_material)
OF_ZONES = (invalid_zone,)
VALUES = (unused, coupled_inertia, soft_core)
