"""Checks before a sweep: values that look like mistakes, and memory."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import cache
from typing import NamedTuple

import numpy as np

from fecm import _machine
from fecm.authoring.case import Case, CasesError, check_deck, pair_of_text
from fecm.authoring.values import (
    EXPOSURE_NAMES,
    REFINE,
    Changes,
    ValueKind,
    apply_case,
    kind_of,
    names_of,
)
from fecm.deck import model
from fecm.deck.findings import Finding, Findings
from fecm.mechanics.kernels import LIBRARY
from fecm.mechanics.mesh import element_centres
from fecm.problem.check import check_segments, check_values
from fecm.problem.problem import Problem
from fecm.problem.symmetry import SAME_LINE
from fecm.sweeps.task import MOST_TOGETHER, Plan, tasks

THICKNESS = "thickness"
LAMINATE = names_of(Changes.LAMINATE)
_CHANGES = (Changes.FAILURE, Changes.STRIKE, Changes.LAMINATE)
_NUMBERS = (n for n in names_of(*_CHANGES) if kind_of(n) is ValueKind.NUMBER)
JUDGED = {"patch", *_NUMBERS} - {"angle"}
OTHER_PLATE = {"size", "support"}  # names that change the mesh or its supports
FEW = 4  # plies below which a laminate as thin as two of them is possible


def doubtful_values(checked: Problem, cases: Sequence[Case]) -> list[str]:
    """Say which values of a deck's cases look like a mistake, such as another unit.

    The rules are the rules for a deck's values. They are limits. It is enough to check the smallest
    and the largest value of each name, one name at a time.
    """
    notes = [*_notes_of_places(checked, cases), *_notes_of_symmetry(checked, cases)]

    @cache
    def known() -> set[tuple[str, str]]:  # needed where a value has findings, which is rare
        return {(finding.code, finding.message) for finding in _findings(checked)}

    for name in cases[0]:
        if name not in JUDGED:
            continue
        values = [float(case[name]) for case in cases]
        least, greatest = min(values), max(values)
        notes += _thickness_notes(checked.deck, name, least)
        reported: set[str] = set()  # codes of this name
        for value in dict.fromkeys((least, greatest)):
            doubts = [
                finding
                for finding in _of_value(checked, name, value)
                if (finding.code, finding.message) not in known()
            ]
            if not doubts:
                continue
            best = max(doubts, key=lambda finding: "looks like" in finding.message)
            if best.code not in reported:
                reported.add(best.code)
                notes.append(f"{name} = {value:g}: {best.message} [{best.code}]")
    return notes


def unused_values(planned: Plan) -> list[str]:
    """Say which values change nothing, because the sweep leaves out the exposures."""
    if planned.settings.has_exposures:
        return []
    if not (names := [name for name in EXPOSURE_NAMES if name in planned.cases[0]]):
        return []
    verb = "changes" if len(names) == 1 else "change"
    text = "only exposures, which this sweep leaves out; --measure failure computes them"
    return [f"{' and '.join(names)} {verb} {text}"]


def _notes_of_places(checked: Problem, cases: Sequence[Case]) -> Iterator[str]:
    """Name the impact points that lie outside the supports of the deck's plate."""
    if not checked.outside_supports.any() or not cases[0].keys().isdisjoint(OTHER_PLATE):
        return
    places = [place for case in cases if (place := _place_of(checked, case)) is not None]
    if not places:
        return
    centres = element_centres(checked.mesh.elements, checked.mesh.coordinates)
    nearest = [int(np.hypot(*(centres - place).T).argmin()) for place in places]
    outside = [p for p, row in zip(places, nearest, strict=True) if checked.outside_supports[row]]
    if outside:
        (x, y), count = outside[0], len(outside)
        which = "1 case hits" if count == 1 else f"{count} cases hit"
        yield (
            f"{which} the free rim outside the supports, the first at ({x:g}, {y:g}): a fixture is "
            "solid there [W556]"
        )


def _notes_of_symmetry(checked: Problem, cases: Sequence[Case]) -> Iterator[str]:
    """Name the impact points beside the lines of symmetry of the deck's part of a plate."""
    if not checked.symmetry.lines or not cases[0].keys().isdisjoint(OTHER_PLATE):
        return
    places = [place for case in cases if (place := _place_of(checked, case)) is not None]
    near = SAME_LINE * checked.longer_side
    for line in checked.symmetry.lines:
        beside = [place for place in places if abs(place[line.axis] - line.place) > near]
        if beside:
            (x, y), count = beside[0], len(beside)
            yield (
                f"{count} case{'s' * (count > 1)} beside the line of symmetry {line}, the first at "
                f"({x:g}, {y:g}): mirror images hit the plate at the same time [W565]"
            )


def _place_of(checked: Problem, case: Case) -> tuple[float, float] | None:
    """Return the impact point of a case, or None if the case does not move it."""
    if "at" in case:
        return pair_of_text("at", str(case["at"]))
    if "impact_node" in case:
        row = int(case["impact_node"]) - 1
        rows = checked.mesh.coordinates
        return (float(rows[row, 0]), float(rows[row, 1])) if 0 <= row < len(rows) else None
    if (place := checked.load_place) is None or case.keys().isdisjoint({"x0", "y0"}):
        return None
    return float(case.get("x0", place[0])), float(case.get("y0", place[1]))


def _thickness_notes(deck: model.Deck, name: str, least: float) -> Iterator[str]:
    """Yield notes about a thickness that may be misunderstood."""
    if name not in (THICKNESS, "laminate_thickness"):
        return
    if name == THICKNESS:
        yield (
            f"{THICKNESS} is the thickness of the laminate, like laminate_thickness; ply_thickness "
            "is the thickness of a ply"
        )
    layers = deck.require(model.Material).layers
    ply = max(layer.thickness for layer in layers)
    if len(layers) >= FEW and least < 2.0 * ply:
        yield (
            f"{name} = {least:g} is less than two plies of the deck, whose {len(layers)} plies are "
            f"up to {ply:g} thick: ply_thickness varies the thickness of every ply"
        )


def _of_value(checked: Problem, name: str, value: float) -> list[Finding]:
    """Return warnings about the deck with one value.

    An invalid value has none, as its cases fail with the reason.
    """
    try:
        deck = apply_case(checked.deck, {name: value})
    except CasesError:
        return []
    errors = Findings()
    check_segments(deck, errors)
    if errors.errors:
        return []
    try:
        return _findings(Problem(deck, checked.mesh, checked.program))
    except (ArithmeticError, ValueError):  # no plate, a patch beyond it, or numbers out of range
        return []


def _findings(problem: Problem) -> list[Finding]:
    findings = Findings()
    with np.errstate(all="ignore"):
        check_values(problem, findings)
    return [finding for finding in findings if finding.severity == "warning"]


def freed(definition: Plan) -> int:
    """Count cases with B != 0 in which u and v, restrained at every node, are released."""
    count = 0
    if definition.cases[0].keys().isdisjoint(LAMINATE):
        return count
    for task in tasks(definition):
        if "support" in task.cases[0]:  # which has its own u and v
            continue
        deck = task.settings.deck
        laminate = {name: value for name, value in task.cases[0].items() if name in LAMINATE}
        with suppress(CasesError):
            if apply_case(deck, laminate).all(model.Boundary) != deck.all(model.Boundary):
                count += len(task.numbers)
    return count


# Bytes per step and case, above the measured values: of a case that is advanced, and of a case
# whose history is stored.
ADVANCED_BYTES = 34 if LIBRARY is None else 12
HISTORY_BYTES = 24
LONGER = frozenset(("duration", "dt"))  # values on which the number of steps depends


def _steps(case: Case) -> float:
    """Return a measure of the steps of a case, to compare cases of the same names."""
    duration, dt = (float(case.get(name, 1.0)) for name in ("duration", "dt"))
    return duration / dt if dt > 0.0 else 0.0


class SweepMemory(NamedTuple):
    """Parts of the memory of a sweep, in bytes."""

    stored: int  # bytes of the histories
    at_once: int  # cases on this machine
    of_process: Callable[[bool], int]

    def needed(self, exact: bool = True) -> int:
        """Return the bytes needed at once. An exact number takes longer."""
        return self.stored + (self.at_once * self.of_process(exact) if self.at_once else 0)


def sweep_memory(
    checked: Problem, definition: Plan, workers: int, *, streamed: bool = False
) -> SweepMemory:
    """Return the memory of a sweep.

    `workers` is the number of workers on this machine, 0 if a cluster runs the cases. If histories
    are `streamed` to files, only the histories of one task are held.
    """
    settings, method = definition.settings, definition.method
    if REFINE in definition.cases[-1]:
        checked = check_deck(apply_case(settings.deck, definition.cases[-1]))
    elif not LONGER.isdisjoint(definition.cases[-1]):
        with suppress(CasesError):  # of a case that fails
            checked = check_deck(apply_case(settings.deck, max(definition.cases, key=_steps)))
    steps, cases = checked.work.steps, len(definition.cases)
    at_once = min(workers, len(tasks(definition))) if workers > 1 else workers
    stored = 0
    if settings.history:
        stored = HISTORY_BYTES * steps * (min(cases, MOST_TOGETHER) if streamed else cases)

    def of_process(exact: bool) -> int:
        run = method.process_bytes(checked, settings, exact=exact)
        return run + ADVANCED_BYTES * steps * method.most_forces(definition, steps)

    return SweepMemory(stored, at_once, of_process)


def check_sweep_memory(
    checked: Problem, definition: Plan, workers: int, *, streamed: bool = False
) -> None:
    """Raise NotEnoughMemoryError for a sweep that needs more memory than is free.

    See :func:`sweep_memory` for the parameters.
    """
    memory = sweep_memory(checked, definition, workers, streamed=streamed)

    def remedy(free: int) -> str:
        if memory.needed() - memory.stored <= free:
            return "take fewer cases, or none of their histories"
        return "take fewer workers" if memory.at_once > 1 else "take fewer steps or a coarser mesh"

    _machine.check_available_memory("the sweep", memory.needed, remedy)
