"""Rules about PREL: the initial membrane force, and buckling under it."""

from __future__ import annotations

import re

import numpy as np

from fecm.deck import model
from fecm.deck.rules import Report, Reports, Subject, rule
from fecm.deck.units import in_si, unit_names
from fecm.mechanics.laminate import ROUNDING
from fecm.mechanics.mesh import rigid_deflections
from fecm.problem.outline import holes
from fecm.problem.problem import Problem

FORCE = "force/length"
LARGEST_STRAIN = 0.01  # by the preload, above which its unit is doubted
# Strain by the preload, over the square of thickness over the longer side, below which it changes
# the lowest frequency by less than 0.1 %. Buckling strains are of the order of 1.
LEAST_EFFECT = 1e-3


@rule("W485", Subject.LAMINATE)
def no_preload(card: model.Preload) -> Reports:
    """All forces of PREL are zero.

    Remedy: Give N0x, N0y or N0xy, or remove the segment.
    """
    if not any(card.forces):
        hint = "its fields are N0x, N0y and N0xy, a force over a length; tension is positive"
        yield Report("PREL is without effect: all its forces are zero.", card.place(), hint)


@rule("E483", Subject.LAMINATE)
def preload_of_coupled_laminate(problem: Problem, card: model.Preload) -> Reports:
    """PREL is used with a laminate whose B is not zero.

    Such a laminate bends under a force in its plane.

    Remedy: A static solution under that force before the impact, with `NONL`. The projectile then
    starts on the bent plate.
    """
    if any(card.forces) and problem.plate.is_coupled:
        message = "B is not zero: the plate bends under the force of PREL, and is not flat."
        hint = "preload it by a static solution before the impact, with NONL: FORC, TANG to CONV"
        yield Report(message, card.place(), hint)


@rule("W484", Subject.LAMINATE)
def large_preload(problem: Problem, card: model.Preload) -> Reports:
    """The preload of PREL strains the plate by more than 1 %.

    Remedy: The unit of force over length: N/mm in mm and N.
    """
    largest = float(np.abs(problem.plate.preload_strain).max())
    if largest > LARGEST_STRAIN:
        factor = in_si(FORCE, unit_names(problem.deck))
        force = max(map(abs, card.forces))
        in_newtons = (
            "" if factor is None else f", up to {force * factor:.3g} N/m in the units of UNIT,"
        )
        message = f"The preload of PREL{in_newtons} strains the plate by {largest:.2%}."
        hint = "N0 is a stress times the thickness: N/mm in mm and N; 1 N/mm is 1000 N/m"
        yield Report(message, card.place(), hint)


@rule("W569", Subject.LAMINATE)
def small_preload(problem: Problem, card: model.Preload) -> Reports:
    """The preload of PREL is without effect.

    The strain by the preload is below 10⁻³ (h/a)² of thickness h and longer side a; plates buckle
    at about (h/a)².

    Remedy: The unit of force over length: N/m in m and N.
    """
    if not any(card.forces):
        return
    largest = float(np.abs(problem.plate.preload_strain).max())
    slenderness = problem.laminate.thickness / problem.longer_side
    if largest < LEAST_EFFECT * slenderness**2:
        message = f"The preload of PREL has no effect: it strains the plate by {largest:.2g}."
        hint = "N0 is a stress times the thickness: 1 N/mm is 1000 N/m"
        yield Report(message, card.place(), hint)


@rule("E499", Subject.LAMINATE)
def preload_of_unlike_laminates(problem: Problem, card: model.Preload) -> Reports:
    """PREL is used with laminates of different stiffness.

    Their strains under the same force differ: the forces in such a plate are not uniform.

    Remedy: A static solution under that force before the impact, with `NONL`.
    """
    if not any(card.forces):
        return
    first, *other_stiffnesses = (problem.plate.laminates[n].A for n in problem.used_laminates)
    if any(np.abs(A - first).max() > ROUNDING * np.abs(first).max() for A in other_stiffnesses):
        message = "The laminates differ in A: a force in the plane is not uniform, but PREL is."
        hint = "preload it by a static solution before the impact, with NONL: FORC, TANG to CONV"
        yield Report(message, card.place(), hint)


@rule("W557", Subject.LAMINATE)
def preload_around_hole(problem: Problem, card: model.Preload) -> Reports:
    """PREL is used with a plate that has a hole.

    PREL is uniform over the plate; around a hole the force in the plane is not.

    Remedy: A static solution under that force before the impact, with `NONL`.
    """
    if not any(card.forces) or not (count := holes(problem.mesh)) > 0:
        return
    has = "a hole" if count == 1 else f"{count} holes"
    message = f"The plate has {has}: a force in the plane is not uniform, but PREL is."
    hint = "preload it by a static solution before the impact, with NONL: FORC, TANG to CONV"
    yield Report(message, card.place(), hint)


@rule("E535", Subject.LAMINATE)
def decimal_comma(card: model.Preload) -> Reports:
    """PREL has two whole numbers that may be one with a decimal comma.

    Remedy: Write -12.5, or give all three forces: -12,5,0.
    """
    text = "" if card.source is None else card.source.card.data.strip()
    if match := re.fullmatch(r"([+-]?[0-9]+),([0-9]*[1-9][0-9]*)", text):
        message = f"PREL has `{text}`, which is two forces or one with a decimal comma."
        hint = f"write {match[1]}.{match[2]}, or {match[1]},{match[2]},0"
        yield Report(message, card.place(), hint)


ALONE = (no_preload, decimal_comma)
OF_PRELOAD = (preload_of_coupled_laminate, preload_of_unlike_laminates)
VALUES = (large_preload, small_preload, preload_around_hole)


STIFFLESS = "PREL is far beyond the buckling load, or the plate has motions without stiffness"
NEAR = 1.1  # buckling load over the preload below which the response is doubtful
# Elements along a half wave below which the buckling load of a curved panel is too high: by 3 %
# with 1.2 elements, 8 % with 0.9 and 50 % with 0.5, and by 0.2 % with 2.4.
FEWEST_ELEMENTS = 2.0


@rule("E486", Subject.LAMINATE)
def compressed_free_plate(problem: Problem, card: model.Preload) -> Reports:
    """PREL compresses a plate that its supports let move along w.

    It has no buckling load, and its edge loads may or may not keep their direction.

    Remedy: Restrain w at the edges, or a preload in tension.
    """
    if problem.plate.is_compressed and rigid_deflections(problem.plate.supported).size:
        message = "PREL compresses a plate that its supports let move along w."
        yield Report(message, card.place(), "restrain w at every node of a supported edge")


@rule("E487", Subject.LAMINATE)
def buckled(problem: Problem, card: model.Preload) -> Reports:
    """The preload is at or beyond the buckling load.

    The flat plate is not stable: its deflection would grow without bound.

    Remedy: A smaller compression; the units of PREL, force/length.
    """
    factor = problem.buckling_factor
    if not factor <= 1.0:
        return
    message = (
        f"The preload N0 is {1.0 / factor:.3g} times the buckling load" if factor else STIFFLESS
    )
    hint = "PREL is a force per length, tension positive"
    yield Report(f"{message}: the plate is not stable.", card.place(), hint)


@rule("W488", Subject.LAMINATE)
def nearly_buckled(problem: Problem, card: model.Preload) -> Reports:
    """The preload is above 1/1.1 of the buckling load.

    Stiffness and frequencies depend on a small difference.

    Remedy: A finer mesh and exact loads and supports, or a smaller compression.
    """
    factor = problem.buckling_factor
    if not 1.0 < factor < NEAR:
        return
    message = f"The preload N0 is {1.0 / factor:.3g} times the buckling load"
    why = "stiffness and frequencies depend on a small difference"
    yield Report(f"{message}: {why}.", card.place(), "imperfections of a real plate matter here")


@rule("W561", Subject.LAMINATE)
def coarse_for_buckles(problem: Problem, card: model.Preload) -> Reports:
    """The elements are too large for the buckles of a curved panel.

    A buckle is about 1.73 (R h)^(1/2) long. With less than two elements along it the buckling load
    is too high: by 3 % with 1.2 elements, 50 % with 0.5.

    Remedy: A finer mesh. `fecm check` prints the buckling load, here with `at most`.
    """
    count = problem.elements_per_buckle
    if not problem.plate.is_compressed or count >= FEWEST_ELEMENTS:
        return
    message = (
        f"The panel has {count:.2g} elements along a buckle: its buckling load is at most "
        f"{problem.buckling_factor:.4g} times the preload, and may be much lower."
    )
    yield Report(
        message, card.place(), "use at least 2 elements of its largest side along a buckle"
    )


OF_BUCKLING = (compressed_free_plate, buckled, coarse_for_buckles, nearly_buckled)
