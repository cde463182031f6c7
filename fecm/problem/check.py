"""Checks of a deck: which rules apply, and in which order.

A stage is entered only if the stages before it found nothing that would mislead it, so that one
mistake gives one finding. For the same reason nothing is reported about missing data of a segment
with an unreadable card.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from fecm.deck import model
from fecm.deck.findings import Finding, Findings
from fecm.deck.macros import Body, compile_program
from fecm.deck.reader import ParsedProblem
from fecm.deck.rules import apply, apply_first
from fecm.mechanics.interpolation import W
from fecm.problem.generate import generate, rod_diameters
from fecm.problem.parts import has_assumed_shear, is_curved
from fecm.problem.problem import Problem
from fecm.problem.rules import (
    cards,
    contact,
    cure,
    curvature,
    damage,
    gages,
    impact,
    laminate,
    mesh,
    nonlinear,
    patch,
    preload,
    program,
    projectile,
    quadrature,
    supports,
    symmetry,
    time_step,
    units,
    zones,
)
from fecm.problem.rules import listing as listing_mode
from fecm.problem.supports import report_unknown_nodes

ELEMENT_ERRORS = ("E303", "E304", "E305")  # after which the numbers of elements mean nothing


def check_problem(
    problem: ParsedProblem, findings: Findings, *, uses_l2: bool = True
) -> Problem | None:
    """Check a problem; return None without a control card.

    L2 is checked only if the run `uses_l2`.
    """
    deck, unsound = problem.deck, problem.unsound
    if deck is None:
        return None
    before = findings.error_count

    def sound() -> bool:
        return findings.error_count == before and not unsound

    compiled = compile_program(deck.macros, findings)
    apply(cards.OF_SEGMENTS, findings, deck, unsound)
    checked = _generated(deck, compiled, unsound, findings, uses_l2=uses_l2)
    _check_each_segment(checked, findings, unsound)
    with np.errstate(all="ignore"):  # numbers out of range end in a finding
        if sound():
            _check_points(checked, findings)
        if sound():
            _check_run(checked, findings, sound)
    return checked


def _generated(
    deck: model.Deck, compiled: Body, unsound: set[str], findings: Findings, *, uses_l2: bool
) -> Problem:
    """Generate the mesh and check it as far as it is complete."""
    errors, element_errors = findings.error_count, _element_errors(findings)
    checked = Problem(deck, generate(deck, findings), compiled)
    complete = findings.error_count == errors and not unsound & {"COOR", "ELEM"}
    are_given = _element_errors(findings) == element_errors and "ELEM" not in unsound
    if not are_given or not deck.has(model.Elements):
        return checked
    valid = apply(mesh.OF_ELEMENTS, findings, checked)
    if valid and complete and deck.has(model.Coordinates):
        apply(mesh.OF_NODES, findings, checked)
        if checked.mesh.given.all():
            apply(mesh.OF_PLACES, findings, checked)
            _check_supports(checked, findings)
            _check_shapes(checked, findings, uses_l2=uses_l2)
    return checked


def _check_supports(checked: Problem, findings: Findings) -> None:
    """Check springs, one-sided supports and point masses on a complete mesh."""
    deck = checked.deck
    if not any(deck.has(kind) for kind in supports.KINDS):
        return
    before = findings.error_count
    apply(supports.OF_CARDS, findings, deck)
    apply(supports.OF_LINES, findings, checked)
    if findings.error_count == before:
        report_unknown_nodes(deck, checked.mesh, findings)
    if findings.error_count == before:
        apply(supports.OF_NODES, findings, checked)


def _element_errors(findings: Findings) -> int:
    return sum(findings.counts[code] for code in ELEMENT_ERRORS)


def _check_shapes(checked: Problem, findings: Findings, *, uses_l2: bool) -> None:
    """Check Jacobians, lumped masses and zero-energy modes where the orders are valid.

    An L2 that is not used is not checked. Assumed strains need no L2.
    """
    material = checked.deck.last(model.Material)
    if material is None or laminate.unknown_stress_points(material):
        return
    apply(quadrature.OF_SHAPES, findings, checked)
    if uses_l2 and not has_assumed_shear(checked.deck):
        apply(quadrature.OF_SHEAR_ORDER, findings, checked)


def _check_each_segment(checked: Problem, findings: Findings, unsound: set[str]) -> None:
    """Check each segment as far as possible without a sound mesh."""
    if checked.deck.has(model.Impact):
        check_impact(checked, findings)
    check_segments(checked.deck, findings)
    if (laminates := checked.deck.last(model.Laminates)) is not None:
        for numbered in laminates.laminates:
            apply(laminate.OF_LAYERS, findings, numbered)
    if unsound.isdisjoint(zones.KEYWORDS):
        _check_materials(checked.deck, findings)


def _check_materials(deck: model.Deck, findings: Findings) -> None:
    """Check that materials and laminates of all segments exist."""
    before = findings.error_count
    apply(zones.OF_DECK, findings, deck)
    if (zone := deck.last(model.Zones)) is not None:
        apply(zones.OF_ZONES, findings, deck, zone)
    if (strengths := deck.last(model.Allowables)) is not None:
        apply(damage.OF_MATERIALS, findings, deck, strengths)
    if (card := deck.last(model.Cure)) is not None and findings.error_count == before:
        apply(cure.OF_MATERIALS, findings, deck, card)


def check_impact(checked: Problem, findings: Findings) -> None:
    """Check the ROD segment of a deck."""
    apply(impact.OF_NODE, findings, checked)
    apply_first(impact.OF_DOF, findings, checked)
    apply(impact.OF_VELOCITY, findings, checked)


def _check_projectile(card: model.Projectile, findings: Findings) -> None:
    if not apply(projectile.OF_NUMBER, findings, card):
        return
    apply(projectile.OF_PROJECTILE, findings, card)
    if not card.elements:
        return
    before = findings.error_count
    diameters = rod_diameters(card, findings)
    if findings.error_count == before:
        apply_first(projectile.OF_DIAMETERS, findings, card, diameters)


def _by(rules: Iterable[Callable[[Any], list[Finding]]]) -> Callable[[Any, Findings], object]:
    """Return the check of a segment by rules."""
    return lambda segment, findings: apply(rules, findings, segment)


# Checks of the segments that can be judged individually, in their order.
OF_SEGMENT: dict[type[model.Segment], Callable[[Any, Findings], object]] = {
    model.Material: _by(laminate.OF_MATERIAL),
    model.Indentation: _by(contact.OF_LAW),
    model.Allowables: _by(damage.OF_STRENGTHS),
    model.Delamination: _by(damage.OF_DELAMINATION),
    model.Damping: _by(time_step.OF_DAMPING),
    model.Preload: _by(preload.ALONE),
    model.Curvature: _by(curvature.ALONE),
    model.Cure: _by(cure.OF_CURE),
    model.Projectile: _check_projectile,
    model.Shear: _by(laminate.OF_SHEAR),
    model.Units: _by(units.OF_NAMES),
    model.Materials: _by(laminate.OF_MATERIALS),
}


def check_segments(deck: model.Deck, findings: Findings) -> None:
    """Check the segments of a deck that can be judged individually."""
    for kind, check in OF_SEGMENT.items():
        if (segment := deck.last(kind)) is not None:
            check(segment, findings)


def check_segment(segment: model.Segment, findings: Findings) -> None:
    """Check one segment, if it can be judged individually."""
    for kind, check in OF_SEGMENT.items():
        if isinstance(segment, kind):
            check(segment, findings)


def _check_points(checked: Problem, findings: Findings) -> None:
    """Check gages, assumed strains and patch on a sound mesh; add the patch's static load."""
    before = findings.error_count
    if checked.deck.has(model.Gages) and apply(gages.OF_COUNT, findings, checked):
        apply(gages.OF_GAGES, findings, checked)
    if findings.error_count > before:
        return
    if checked.deck.has(model.Nonlinear):
        apply(nonlinear.OF_NONLINEAR, findings, checked)
    elif has_assumed_shear(checked.deck):
        apply(quadrature.OF_ASSUMED_SHEAR, findings, checked)
    if is_curved(checked.deck):
        apply(curvature.OF_PANEL, findings, checked)
    if (card := checked.deck.last(model.Patch)) is None:
        return
    apply_first(patch.OF_PATCH, findings, checked)
    if findings.error_count == before and card.load and checked.patch is not None:
        checked.mesh.forces[:, W] += card.load * checked.patch.weights


def _check_run(checked: Problem, findings: Findings, sound: Callable[[], bool]) -> None:
    """Check a problem whose segments and mesh are sound."""
    deck = checked.deck
    if (force := deck.last(model.Preload)) is not None:
        apply(preload.OF_PRELOAD, findings, checked, force)
    if (delamination := deck.last(model.Delamination)) is not None:
        apply(damage.OF_THRESHOLD, findings, checked, delamination)
    _check_time_step(checked, findings)
    check_program(checked, findings)
    apply(program.WITH_IMPACT if checked.has_impact else program.WITHOUT_IMPACT, findings, checked)
    if sound():
        apply(mesh.OF_SUPPORTS, findings, checked)
        if deck.has(model.Nonlinear) or is_curved(deck):
            apply(nonlinear.OF_SYMMETRY, findings, checked)
        if is_curved(deck):
            apply(curvature.OF_SUPPORTS, findings, checked)
        if force is not None:
            apply_first(preload.OF_BUCKLING, findings, checked, force)
        check_values(checked, findings)
        if time_step.takes_steps(checked):
            apply(time_step.OF_CONTACT, findings, checked)
    if checked.has_impact:
        if not deck.has(model.Projectile):
            apply(projectile.WITHOUT_PROJECTILE, findings, checked)
        apply((*impact.OF_MESH, *symmetry.OF_IMPACT), findings, checked)
        if (segment := deck.last(model.Gages)) is not None and not deck.has(model.Patch):
            apply(gages.OF_POINT_FORCE, findings, checked, segment)


def _check_time_step(checked: Problem, findings: Findings) -> None:
    """Compare every DT with the plate's critical time step, and with the rate of the damping."""
    if not time_step.takes_steps(checked):
        return
    apply(time_step.OF_ROUNDING, findings, checked)
    if (damping := checked.deck.last(model.Damping)) is not None:
        apply(time_step.OF_RESOLUTION, findings, checked, damping)
    if checked.plate.supports is not None:
        apply(supports.OF_STEP, findings, checked)
    apply_first(time_step.OF_PLATE, findings, checked)


def check_program(checked: Problem, findings: Findings) -> None:
    """Check the length of a program, and that its loops reach the steps that are stored."""
    if not apply(program.OF_LENGTH, findings, checked):
        return
    apply(program.OF_OUTPUT, findings, checked)
    if cards := program.macros_of(checked, "PLYS", "FAIL"):
        apply(program.OF_STRESSES, findings, checked, cards)
    if cards := program.macros_of(checked, "PLYS"):
        apply(program.OF_PLY_STRESSES, findings, checked, cards)


# Rules about a segment in its sound problem, in their order.
VALUES_OF_SEGMENT: dict[type[model.Segment], Iterable[Callable[..., list[Finding]]]] = {
    model.Shear: laminate.VALUES_OF_SHEAR,
    model.Preload: (*preload.VALUES, *damage.OF_PRELOAD),
    model.Allowables: damage.VALUES_OF_STRENGTHS,
    model.Delamination: damage.VALUES_OF_DELAMINATION,
    model.Cure: cure.VALUES,
    model.Gages: gages.VALUES,
}


def check_values(checked: Problem, findings: Findings) -> None:
    """Warn about valid values of a sound problem that look like mistakes."""
    deck = checked.deck
    apply((*laminate.VALUES, *zones.VALUES, *units.VALUES), findings, checked)
    for kind, rules in VALUES_OF_SEGMENT.items():
        if (segment := deck.last(kind)) is not None:
            apply(rules, findings, checked, segment)
    if is_curved(deck):
        apply(curvature.VALUES, findings, checked)
    if checked.plate.supports is not None:
        apply(supports.VALUES, findings, checked)
    if (damping := deck.last(model.Damping)) is not None:
        apply_first(time_step.VALUES_OF_DAMPING, findings, checked, damping)
    if (strengths := deck.last(model.Allowables)) is not None:
        apply_first(damage.STRENGTHS, findings, checked, strengths)
    if strengths is not None or deck.has(model.Delamination):
        apply(damage.OF_LAYUP, findings, checked)
    if cards := program.macros_of(checked, "FAIL"):
        apply(damage.OF_EVALUATIONS, findings, checked, cards)
    if checked.has_impact:
        _check_values_of_impact(checked, findings)


def _check_values_of_impact(checked: Problem, findings: Findings) -> None:
    """Warn about values of contact, projectile and patch that look like mistakes."""
    apply((*contact.VALUES, *impact.NEIGHBOURS, *projectile.VALUES), findings, checked)
    if (card := checked.deck.last(model.Projectile)) is not None:
        apply(projectile.OF_ROD, findings, checked, card)
    apply((*impact.VALUES, *contact.OF_COEFFICIENT), findings, checked)
    if (segment := checked.deck.last(model.Patch)) is not None:
        apply(patch.VALUES, findings, checked, segment)


def check_place(checked: Problem, findings: Findings) -> None:
    """Check the place of the impact alone."""
    apply_first(impact.OF_DOF, findings, checked)
    if checked.deck.has(model.Patch):
        apply_first(patch.OF_PATCH, findings, checked)
    if not findings.error_count:
        apply((*impact.NEIGHBOURS, *impact.VALUES, *impact.OF_MESH), findings, checked)


def check_listing(checked: Problem, findings: Findings) -> None:
    """Refuse what the printed program can't compute."""
    apply(listing_mode.OF_LISTING, findings, checked)
