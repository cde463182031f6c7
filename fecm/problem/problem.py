"""Checks of a deck.

Findings about missing data of a segment are suppressed if one of its cards is unreadable, so that
one mistake gives one finding.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from fecm.deck.findings import Findings
from fecm.deck.macros import STEPS, compile_program
from fecm.deck.model import (
    Allowables,
    Boundary,
    Coordinates,
    Damping,
    Deck,
    Delamination,
    Elements,
    Gages,
    Impact,
    Indentation,
    Material,
    Patch,
    Projectile,
    Segment,
    Shear,
    Units,
)
from fecm.deck.reader import ParsedProblem
from fecm.problem.build import Problem, W
from fecm.problem.check_impact import (
    check_gages,
    check_gages_under_force,
    check_impact,
    check_law,
    check_projectile,
    check_resolution,
    check_shear_correction,
    warn_of_the_reports_rod,
)
from fecm.problem.check_material import (
    check_allowables,
    check_damping,
    check_delamination,
    check_material,
)
from fecm.problem.check_mesh import (
    check_assumed_shear,
    check_elements,
    check_in_plane_supports,
    check_mesh,
    check_side_nodes,
    check_support,
)
from fecm.problem.check_patch import check_patch
from fecm.problem.check_plausibility import (
    check_plausibility,
    check_purpose,
    check_time_step_of_contact,
)
from fecm.problem.check_program import check_program, check_time_step
from fecm.problem.generate import generate

__all__ = ["Problem", "check"]

ALWAYS: tuple[type[Segment], ...] = (Coordinates, Elements, Material)
IN_AN_IMPACT: tuple[type[Segment], ...] = (Impact, Indentation)
# Segments of which only the last is effective.
SINGLE: tuple[type[Segment], ...] = (
    Coordinates, Elements, Material, Impact, Indentation, Projectile, Shear, Patch, Gages, Units,
    Allowables, Delamination, Damping,
)  # fmt: skip


# Checks of a segment by itself.
CHECKS: tuple[tuple[type[Segment], Callable[[Any, Findings], None]], ...] = (
    (Indentation, check_law), (Allowables, check_allowables), (Delamination, check_delamination),
    (Damping, check_damping), (Projectile, check_projectile), (Shear, check_shear_correction),
)  # fmt: skip


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
    if given and deck.has(Elements):
        valid = check_elements(deck, mesh, findings)
        if valid and complete and deck.has(Coordinates):
            check_mesh(deck, mesh, findings, listing=listing)
    if (material := deck.last(Material)) is not None:
        check_material(material, findings)
    if (impact := deck.last(Impact)) is not None:
        check_impact(impact, deck, mesh, findings)
    for kind, check_segment in CHECKS:
        if (segment := deck.last(kind)) is not None:
            check_segment(segment, findings)
    if (gages := deck.last(Gages)) is not None and findings.error_count == before and not unsound:
        check_gages(gages, mesh, deck, findings)
    checked = Problem(deck, mesh, program)
    if findings.error_count == before and not unsound:
        if deck.has(Shear):
            check_assumed_shear(deck, mesh, findings)
        if (patch := deck.last(Patch)) is not None:
            check_patch(checked, findings)
            if findings.error_count == before and patch.load and checked.patch is not None:
                mesh.forces[:, W] += patch.load * checked.patch.weights
    if findings.error_count == before and not unsound:
        with np.errstate(all="ignore"):  # numbers out of range end in a finding
            delamination = deck.last(Delamination)
            if delamination is not None and checked.laminate.is_coupled:
                findings.add(
                    "W458",
                    "B is not zero: the delamination threshold takes D - B A^-1 B for D.",
                    delamination.place(),
                )
            check_time_step(checked, findings)
            check_program(checked, findings)
            check_purpose(deck, mesh, findings)
            if findings.error_count == before:
                check_side_nodes(deck, mesh, findings)
                check_support(deck, mesh, findings)
                check_in_plane_supports(checked, findings)
                check_plausibility(checked, findings)
                if STEPS.intersection(macro.word for macro in deck.macros):
                    check_time_step_of_contact(checked, findings)
            if checked.has_impact:
                if not deck.has(Projectile):
                    warn_of_the_reports_rod(deck, findings)
                check_resolution(checked, findings)
                check_gages_under_force(checked, findings)
    return checked


def _element_errors(findings: Findings) -> int:
    """Number of ELEM cards that generate no elements."""
    return sum(findings.counts[code] for code in ("E303", "E304", "E305"))


def _check_segments(deck: Deck, unsound: set[str], findings: Findings) -> None:
    """Report missing segments, and those that a later one of the same keyword replaces."""
    words = {macro.word for macro in deck.macros}
    impact = IN_AN_IMPACT if "RODP" in words else ()
    failure: tuple[type[Segment], ...] = (Allowables,) if "FAIL" in words else ()
    for kind in (*ALWAYS, *impact, *failure):
        if not deck.has(kind) and kind.keyword not in unsound:
            findings.add(
                "E203",
                f"The deck has no {kind.keyword} segment.",
                deck.place(),
                "it belongs before END",
            )
    for kind in SINGLE:
        for segment in deck.all(kind)[1:]:
            findings.add(
                "W204",
                f"A second {kind.keyword} segment replaces the first.",
                segment.place(),
                "remove one of them",
            )
    if len(deck.all(Boundary)) > 1:
        findings.add(
            "W204",
            "A second BOUN segment adds to the first and replaces the codes of its nodes.",
            deck.all(Boundary)[1].place(),
        )
