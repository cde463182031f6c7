"""Rules about decks that the printed program can't compute."""

from __future__ import annotations

import numpy as np

from fecm.deck import model
from fecm.deck.rules import Report, Reports, Subject, rule
from fecm.problem.generate import place_of_element
from fecm.problem.problem import Problem

MOST_LAYERS = 25  # layers that the listing's arrays hold (CNPD: QBR(3,3,25), TH(25))
REMEDY = "Report mode."
HINT = "run the deck in report mode"
LATER_MACROS = ("PLYS", "FAIL", "OVER")
LATER_SEGMENTS = (
    model.Allowables,
    model.Delamination,
    model.Damping,
    model.Patch,
    model.Nonlinear,
    model.Preload,
    model.Curvature,
    model.Cure,
    model.Materials,
    model.Laminates,
    model.Zones,
    model.Springs,
    model.OneSidedSupports,
    model.PointMasses,
)


@rule("E601", Subject.LISTING)
def mixed_elements(problem: Problem) -> Reports:
    """An element has other nodes than element 1.

    The printed program takes the node list of element 1 for all.

    Remedy: Report mode.
    """
    present = problem.mesh.elements != 0
    different = np.flatnonzero((present != present[:1]).any(axis=1))
    if len(different):
        number = int(different[0]) + 1
        counts = f"{present[number - 1].sum()} against {present[0].sum()}"
        why = "the printed program takes element 1's node list for the mass of every element"
        message = f"Element {number} has other nodes than element 1 ({counts}): {why}."
        yield Report(message, place_of_element(problem.deck, number), HINT)


@rule("E602", Subject.LISTING)
def too_many_layers(problem: Problem) -> Reports:
    """There are more layers than the printed program has room for.

    Remedy: Report mode.
    """
    layers = problem.deck.require(model.Material).layers
    if len(layers) > MOST_LAYERS:
        room = f"the {MOST_LAYERS} that the printed program has room for"
        message = f"{len(layers)} layers are more than {room}."
        yield Report(message, layers[MOST_LAYERS].place("layer"), HINT)


@rule("E603", Subject.LISTING)
def later_words(problem: Problem) -> Reports:
    """The deck has a word that the printed program does not have.

    These are PATC, PLYS, FAIL, OVER, ALLO, DELA, DAMP, NONL, PREL, CURV, CURE, MATS, LAMS, ZONE,
    SHEA MITC and SHEA EQUI.

    Remedy: Report mode.
    """
    deck = problem.deck
    later = {macro.word: macro for macro in deck.macros if macro.word in LATER_MACROS}
    words = [(word, macro.place("macro")) for word, macro in later.items()]
    for kind in LATER_SEGMENTS:
        if (segment := deck.last(kind)) is not None:
            words.append((kind.keyword, segment.place()))
    if (shear := deck.last(model.Shear)) is not None:
        words += [(f"SHEA {word}", shear.place()) for word in shear.words()]
    for word, place in words:
        yield Report(f"The printed program has no {word}.", place, HINT)


OF_LISTING = (mixed_elements, too_many_layers, later_words)
