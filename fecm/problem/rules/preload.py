"""Rules about the PREL segment: an initial membrane force."""

from __future__ import annotations

import re

import numpy as np

from fecm.deck import model
from fecm.deck.rules import Report, Reports, Subject, rule
from fecm.deck.units import in_si, unit_names
from fecm.mechanics.laminate import ROUNDING
from fecm.problem.outline import holes
from fecm.problem.problem import Problem

FORCE = "force/length"
LARGEST_STRAIN = 0.01  # by the preload, above which its unit is doubted


@rule(
    "W485",
    Subject.LAMINATE,
    "All forces of PREL are zero.",
    remedy="Give N0x, N0y or N0xy, or remove the segment.",
)
def no_preload(card: model.Preload) -> Reports:
    """Find a preload without a force."""
    if not any(card.forces):
        hint = "its fields are N0x, N0y and N0xy, a force over a length; tension is positive"
        yield Report("PREL is without effect: all its forces are zero.", card.place(), hint)


@rule(
    "E483",
    Subject.LAMINATE,
    "PREL is with a laminate whose B is not zero.",
    cause="Such a laminate bends under a force in its plane.",
    remedy="A static solution under that force before the impact, with `NONL`.",
)
def preload_of_coupled_laminate(problem: Problem) -> Reports:
    """Find a preload that would bend the plate."""
    card = problem.deck.last(model.Preload)
    if card is not None and any(card.forces) and problem.plate.is_coupled:
        message = "B is not zero: the plate bends under the force of PREL, and is not flat."
        hint = "preload it by a static solution before the impact, with NONL: FORC, TANG to CONV"
        yield Report(message, card.place(), hint)


@rule(
    "W484",
    Subject.LAMINATE,
    "The preload of PREL strains the plate by more than 1 %.",
    remedy="The unit of force over length: N/mm in mm and N.",
)
def large_preload(problem: Problem) -> Reports:
    """Find a preload that few laminates would survive."""
    if (card := problem.deck.last(model.Preload)) is None:
        return
    largest = float(np.abs(problem.plate.preload_strain).max())
    if largest > LARGEST_STRAIN:
        factor = in_si(FORCE, unit_names(problem.deck))
        force = max(map(abs, card.forces))
        known = "" if factor is None else f", up to {force * factor:.3g} N/m in the units of UNIT,"
        message = f"The preload of PREL{known} strains the plate by {largest:.2%}."
        hint = "N0 is a stress times the thickness: N/mm in mm and N; 1 N/mm is 1000 N/m"
        yield Report(message, card.place(), hint)


@rule(
    "E499",
    Subject.LAMINATE,
    "PREL is with laminates of different stiffness.",
    cause="Their strains under the same force differ: the forces in such a plate are not uniform.",
    remedy="A static solution under that force before the impact, with `NONL`.",
)
def preload_of_unlike_laminates(problem: Problem) -> Reports:
    """Find a preload whose strains would not fit together."""
    card = problem.deck.last(model.Preload)
    if card is None or not any(card.forces):
        return
    first, *others = (problem.plate.laminates[n].A for n in problem.used_laminates)
    if any(np.abs(A - first).max() > ROUNDING * np.abs(first).max() for A in others):
        message = "The laminates differ in A: a force in the plane is not uniform, as PREL says."
        hint = "preload it by a static solution before the impact, with NONL: FORC, TANG to CONV"
        yield Report(message, card.place(), hint)


@rule(
    "W557",
    Subject.LAMINATE,
    "PREL is with a plate that has a hole.",
    cause="PREL is uniform over the plate; around a hole the force in the plane is not.",
    remedy="A static solution under that force before the impact, with `NONL`.",
)
def preload_around_hole(problem: Problem) -> Reports:
    """Find a preload of a plate whose outline has more than one closed part."""
    card = problem.deck.last(model.Preload)
    if card is None or not any(card.forces) or not (count := holes(problem.mesh)) > 0:
        return
    has = "a hole" if count == 1 else f"{count} holes"
    message = f"The plate has {has}: a force in the plane is not uniform, as PREL says."
    hint = "preload it by a static solution before the impact, with NONL: FORC, TANG to CONV"
    yield Report(message, card.place(), hint)


@rule(
    "E535",
    Subject.LAMINATE,
    "PREL has two whole numbers that may be one with a decimal comma.",
    remedy="Write -12.5, or give all three forces: -12,5,0.",
)
def decimal_comma(card: model.Preload) -> Reports:
    """Find a card such as `-12,5`."""
    text = "" if card.source is None else card.source.card.data.strip()
    if match := re.fullmatch(r"([+-]?[0-9]+),([0-9]*[1-9][0-9]*)", text):
        message = f"PREL has `{text}`, which is two forces or one with a decimal comma."
        hint = f"write {match[1]}.{match[2]}, or {match[1]},{match[2]},0"
        yield Report(message, card.place(), hint)


ALONE = (no_preload, decimal_comma)
OF_PRELOAD = (preload_of_coupled_laminate, preload_of_unlike_laminates)
VALUES = (large_preload, preload_around_hole)
