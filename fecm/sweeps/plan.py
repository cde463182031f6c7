"""Memory that a sweep will take, known before it takes any."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

from fecm import _memory
from fecm._version import __version__
from fecm.deck.macros import Body, Loop, flat
from fecm.deck.model import Boundary, Deck
from fecm.problem.memory import needed_bytes
from fecm.problem.problem import Problem
from fecm.sweeps.cases import CONTACT, PLATE, Case, CasesError
from fecm.sweeps.clock import Clock, clock_of
from fecm.sweeps.vary import apply_case

# Cases that are advanced together; fixed, as sums depend on it in their last digit.
TOGETHER = 1024
# Bytes a step of each case that is advanced with others: more than was measured.
ADVANCED = 28


@dataclass(frozen=True)
class Plan:
    """What a sweep does.

    Attributes
    ----------
    deck : Deck
        What is varied.
    cases : tuple of dict
        Values of every case.
    history : bool
        Whether forces are stored.
    clock : Clock or None
        Rule by which each plate has its own time step; None where the deck's holds for all.
    """

    deck: Deck
    cases: tuple[Case, ...]
    history: bool = False
    clock: Clock | None = None

    def fingerprint(self) -> str:
        """What tells this sweep from another one."""
        parts = [__version__, self.deck.to_text(), self.cases, self.history, TOGETHER]
        return hashlib.sha256(json.dumps(parts).encode()).hexdigest()


@dataclass(frozen=True)
class Task:
    """Cases that are run together.

    Attributes
    ----------
    number : int
        The task's number.
    deck : Deck
        What is varied.
    numbers : tuple of int
        The cases' numbers.
    cases : tuple of dict
        Their values.
    history : bool
        Whether the forces are wanted.
    clock : Clock or None
        Rule by which the plate has its own time step; None where the deck's holds.
    """

    number: int
    deck: Deck
    numbers: tuple[int, ...]
    cases: tuple[Case, ...]
    history: bool = False
    clock: Clock | None = None


def plan(checked: Problem, cases: Sequence[Case], *, history: bool = False) -> Plan:
    """Make the plan of a sweep.

    Raises
    ------
    CasesError
        If the deck has no impact, or there are no cases.
    """
    if not any(macro.word == "RODP" for macro in checked.deck.macros):
        raise CasesError("the deck takes no impact step (RODP): there is nothing to sweep")
    if not cases:
        raise CasesError("there are no cases")
    own = "dt" not in cases[0] and not {"impact_node", *CONTACT}.issuperset(cases[0])
    clock = clock_of(checked) if own else None
    return Plan(checked.deck, tuple(cases), history, clock)


def shares_plate(checked: Problem) -> bool:
    """Whether a program only takes impact steps of one size, on a plate without other loads."""
    words = [macro.word for macro in flat(checked.program)]
    sizes = {macro.value for macro in flat(checked.program) if macro.word == "DT"}
    return (
        "RODP" in words
        and len(sizes) == 1
        and words.index("DT") < words.index("RODP")
        and not {"EXCD", "TANG", "FORM", "SOLV"}.intersection(words)
        and not checked.mesh.forces.any()
    )


def tasks(checked: Problem, made: Plan) -> list[Task]:
    """Cut a plan into tasks: cases that share a plate together, whole runs one by one."""
    together = TOGETHER if shares_plate(checked) else 1
    groups: dict[tuple[object, ...], list[int]] = {}
    for number, case in enumerate(made.cases):
        key = tuple(case[name] for name in PLATE if name in case)
        groups.setdefault(key, []).append(number)
    cut: list[Task] = []
    for numbers in groups.values():
        for start in range(0, len(numbers), together):
            some = tuple(numbers[start : start + together])
            cases = tuple(made.cases[n] for n in some)
            cut.append(Task(len(cut), made.deck, some, cases, made.history, made.clock))
    return cut


def freed(some: Sequence[Task]) -> int:
    """Count the cases with B != 0 in which u and v, restrained at every node, are set free."""
    count = 0
    for task in some:
        plate = {name: value for name, value in task.cases[0].items() if name in PLATE}
        with suppress(CasesError):
            if apply_case(task.deck, plate).all(Boundary) != task.deck.all(Boundary):
                count += len(task.numbers)
    return count


def without_output(body: Body) -> Body:
    """A program that stores no fields."""
    kept: list[Any] = []
    for item in body:
        if isinstance(item, Loop):
            kept.append(replace(item, body=without_output(item.body)))
        elif item.word == "RODP":
            kept.append(replace(item, value=1e9))
        elif item.word not in ("DISP", "STRE", "REAC", "EIGE"):
            kept.append(item)
    return tuple(kept)


# Bytes a step of each case whose history is kept: more than was measured.
KEPT = 24


def check_memory(checked: Problem, made: Plan, workers: int) -> None:
    """Refuse a sweep that takes more memory than is free.

    Parameters
    ----------
    checked : Problem
        The deck that is varied.
    made : Plan
    workers : int
        Processes on this machine that run cases; 0 where others do.

    Raises
    ------
    NotEnoughMemoryError
        With both numbers.
    """
    steps, cases = checked.work.steps, len(made.cases)
    together = min(TOGETHER, cases) if shares_plate(checked) else 1
    at_once = min(workers, len(tasks(checked, made)))
    plate = replace(checked, program=without_output(checked.program))
    kept = KEPT * steps * cases if made.history else 0

    def needed(exact: bool) -> int:
        if not at_once:
            return kept
        one = needed_bytes(plate, exact=exact) + ADVANCED * steps * together
        return kept + at_once * one

    def remedy(free: int) -> str:
        if needed(True) - kept <= free:
            return "take fewer cases, or none of their histories"
        return "take fewer workers" if at_once > 1 else "take fewer steps or a coarser mesh"

    _memory.check("the sweep", needed, remedy)
