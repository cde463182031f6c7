"""Plan of a sweep: its cases, its tasks and their outcomes, and the memory that they need."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fecm import _memory
from fecm._typing import Floats
from fecm._version import __version__
from fecm.deck.macros import Body, Loop, flat
from fecm.deck.model import Boundary, Deck, Delamination, Gages, Impact
from fecm.deck.records import Macro
from fecm.mechanics.kernels import LIBRARY
from fecm.problem.memory import needed_bytes
from fecm.problem.problem import Problem
from fecm.results.metrics import COLUMNS, FOUND, GAGE, SUMMARY, Metrics
from fecm.results.metrics import THRESHOLD as LIMITED
from fecm.results.result import Result
from fecm.results.validity import FAILED, VALID
from fecm.sweeps import cases as inputs
from fecm.sweeps.cases import (
    EXPOSURE,
    PEAK_FORCE,
    REFINE,
    THRESHOLD,
    Case,
    CasesError,
    Design,
    Limit,
    Until,
    plate_values,
)
from fecm.sweeps.vary import Clock, apply_case, check_deck, clock_of

Build = Callable[[dict[str, Any]], Deck]
Measure = Callable[[Result], Mapping[str, float]]
TOGETHER = 2048  # cases advanced together
ADVANCED = 34 if LIBRARY is None else 12  # bytes per step and case, above the measured value
KEPT = 24  # bytes per step and case whose history is stored: above the measured value
COUNT = 25  # velocities of the first round of a search
# Names of columns that are measured on request.
DEFLECTION, GAGES, FAILURE = MEASURES = ("max_deflection", "gages", "failure")
Forces = tuple[Sequence[int], Floats | None]  # of cases, with contact forces (cases, steps)


class Status(StrEnum):
    """Status of a case that was run; that of another one is the reason of its failure."""

    OK = "ok"
    STILL = "still in contact"  # at the end


RUN = tuple(Status)
# Columns that describe the run of a case.
REACHED = "reached"  # the largest contact force, a lower bound of the peak
ABOUT = ("status", "validity", "dt", "steps", "unsettled", REACHED)


@dataclass(frozen=True)
class Plan:
    """Definition of a sweep."""

    deck: Deck  # deck that is varied
    cases: tuple[Case, ...]  # values of every case
    history: bool = False  # whether contact forces are stored
    clock: Clock | None = None  # None if the deck's time step applies to every plate
    until: float | str | None = None  # value whose velocity is searched, or "threshold"
    sought: str = PEAK_FORCE  # quantity of this value
    build: Build | None = None  # makes the deck of a case; `deck` is that of one of the cases
    measure: Measure | None = None  # computes more columns from the result of a case
    extra: tuple[str, ...] = ()  # more columns, of :data:`MEASURES`
    design: Design | None = None  # of random cases
    limits: tuple[Limit, ...] = ()  # whose probability of exceedance is asked for

    @property
    def alone(self) -> bool:
        """Whether every case is run in full."""
        return self.build is not None or self.measure is not None or FAILURE in self.extra

    def fingerprint(self) -> str:
        """Hash that identifies this sweep."""
        parts = [__version__, self.deck.to_text(), self.cases, self.history, TOGETHER, self.until]
        parts += [self.extra] if self.extra else []
        return hashlib.sha256(json.dumps(parts).encode()).hexdigest()


@dataclass(frozen=True)
class Task(Plan):
    """The part of a plan whose cases are run together."""

    number: int = 0  # number of the task
    numbers: tuple[int, ...] = ()  # numbers of the cases


def check_limits(limits: Sequence[Limit], known: Sequence[str], *, threshold: bool) -> None:
    """Raise CasesError if a quantity is not among the known ones, or the deck has no threshold."""
    for name, value in limits:
        if name not in known:
            raise CasesError(f"there is no quantity `{name}`; there are {', '.join(known)}")
        if value == THRESHOLD and not threshold:
            raise CasesError("the threshold needs a DELA segment, which the deck does not have")


def plan(
    checked: Problem,
    cases: Sequence[Case],
    *,
    history: bool = False,
    until: Until | None = None,
    build: Build | None = None,
    measure: Measure | None = None,
    extra: Sequence[str] = (),
    design: Design | None = None,
    limits: Sequence[Limit] = (),
) -> Plan:
    """Create the plan of a sweep; the options are fields of :class:`Plan`.

    Raises CasesError if the deck has no impact, names exclude each other, or the deck lacks what is
    searched or measured.
    """
    deck, (sought, value) = checked.deck, inputs.sought_of(until)
    if sought == EXPOSURE:
        extra = (*extra, FAILURE)
    made = Plan(
        deck, tuple(cases), history=history, until=value, sought=sought, build=build,
        measure=measure, extra=tuple(extra), design=design, limits=tuple(limits),
    )  # fmt: skip
    words = {macro.word for macro in deck.macros}
    if "RODP" not in words:
        raise CasesError("the deck has no impact step (RODP); there is nothing to sweep")
    if build is None:
        inputs.check_names(cases[0])
    if unknown := sorted({*extra} - {*MEASURES}):
        raise CasesError(f"measure has {unknown[0]!r}; the names are {', '.join(MEASURES)}")
    if GAGES in extra and not deck.has(Gages):
        raise CasesError("measure gages: the deck has no strain gages; add a GAGE segment")
    if FAILURE in extra and "FAIL" not in words:
        raise CasesError("measure failure: the program of the deck has no FAIL; add it to the loop")
    limited = deck.last(Delamination) is not None
    if value is not None:
        if made.alone and not (sought == EXPOSURE and build is None and measure is None):
            raise CasesError("until can't be given together with build, measure or failure")
        if not {"velocity", "energy"}.isdisjoint(cases[0]):
            raise CasesError("velocity is what is searched; it can't be varied as well")
        if not deck.require(Impact).velocity:
            raise CasesError("the search begins at the velocity of ROD, which must not be 0")
        if value == THRESHOLD and not limited:
            raise CasesError("the threshold needs a DELA segment, which the deck does not have")
        if value != THRESHOLD and not (isinstance(value, float | int) and 0.0 < value < math.inf):
            name = sought.replace("_", " ")
            raise CasesError(f"the {name} to reach is a positive number, not {value}")
    if measure is None:
        known = [*SUMMARY, *(FOUND if until is not None else ())]
        if extra:
            known += [name for name, _ in limits if name in COLUMNS or name.startswith(GAGE)]
        check_limits(limits, [*known, *(LIMITED if limited else ())], threshold=limited)
    keeping = {*inputs.LOAD, *inputs.CONTACT, "duration"}  # the critical time step
    own = build is None and "dt" not in cases[0] and not keeping.issuperset(cases[0])
    chosen = tuple(name for name in MEASURES if name in extra)
    return replace(made, clock=clock_of(checked) if own else None, extra=chosen)


def shares_plate(checked: Problem) -> bool:
    """Whether a program has only impact steps of one size, and the plate no other loads."""
    words = [macro.word for macro in flat(checked.program)]
    sizes = {macro.value for macro in flat(checked.program) if macro.word == "DT"}
    if "RODP" not in words or len(sizes) != 1 or words.index("DT") > words.index("RODP"):
        return False
    return {"EXCD", "TANG", "FORM", "SOLV"}.isdisjoint(words) and not checked.mesh.forces.any()


def _together(checked: Problem, made: Plan) -> int:
    """Most runs advanced together."""
    runs = len(made.cases) * (1 if made.until is None else COUNT)
    return min(TOGETHER, runs) if shares_plate(checked) and not made.alone else 1


def tasks(checked: Problem, made: Plan) -> list[Task]:
    """Split a plan into tasks: cases that share a plate together, full runs one by one."""
    together = max(1, _together(checked, made) // (1 if made.until is None else COUNT))
    groups: dict[object, list[int]] = {}
    for number, case in enumerate(made.cases):
        groups.setdefault(frozenset(plate_values(case).items()), []).append(number)
    found: list[Task] = []
    for numbers in groups.values():
        for start in range(0, len(numbers), together):
            some = tuple(numbers[start : start + together])
            given = {**vars(made), "cases": tuple(made.cases[n] for n in some)}
            found.append(Task(**given, number=len(found), numbers=some))
    return found


@dataclass
class Outcome:
    """Results of some cases."""

    numbers: list[int]  # of the cases, from 0
    # (cases,) each, by name: those of :data:`~fecm.results.metrics.METRICS` are NaN if the case
    # failed, or if its end has not decided them.  ``status`` is a :class:`Status` or the reason for
    # the failure; ``validity`` is ``"ok"``, the reasons to doubt the case, or ``"failed"``; ``dt``,
    # ``steps``; ``unsettled`` counts the steps whose contact iteration did not converge;
    # ``reached`` is the largest contact force, a lower bound of the peak.
    columns: dict[str, NDArray[Any]]
    force: Floats | None = None  # (cases, steps): contact force after every step

    @property
    def status(self) -> list[str]:
        """Status of each case."""
        return list(map(str, self.columns["status"]))

    @property
    def measured(self) -> list[str]:
        """Names of the columns that the caller computes."""
        return [name for name in self.columns if name not in (*COLUMNS, *ABOUT)]

    def select(self, rows: NDArray[np.intp]) -> Outcome:
        """Return the outcome of some of the cases."""
        columns = {name: values[rows] for name, values in self.columns.items()}
        force = None if self.force is None else self.force[rows]
        return Outcome([self.numbers[row] for row in rows], columns, force)

    @classmethod
    def failed(cls, reasons: Mapping[int, str]) -> Outcome:
        """Return the outcome of cases that could not be run, from the reasons by their numbers."""
        count, texts = len(reasons), list(reasons.values())
        columns: dict[str, NDArray[Any]] = {name: np.full(count, np.nan) for name in SUMMARY}
        columns |= {"status": np.array(texts, dtype=np.str_)}
        columns |= {"validity": np.full(count, FAILED), "dt": np.full(count, np.nan)}
        columns |= {name: np.zeros(count, dtype=np.int64) for name in ("steps", "unsettled")}
        columns |= {REACHED: np.full(count, np.nan)}
        return cls(list(reasons), columns)


def merge(parts: Sequence[Outcome], history: bool = True) -> Outcome:
    """Merge outcomes, ordered by the numbers of the cases; their forces only with `history`."""
    given = [number for part in parts for number in part.numbers]
    order, numbers = np.argsort(given), sorted(given)
    columns: dict[str, NDArray[Any]] = {}
    for name in dict.fromkeys(name for part in parts for name in part.columns):
        found = [part.columns.get(name, np.full(len(part.numbers), np.nan)) for part in parts]
        columns[name] = np.concatenate(found)[order]
    if not history:
        return Outcome(numbers, columns)
    longest = max((0 if part.force is None else part.force.shape[1] for part in parts), default=0)
    force = np.full((len(numbers), longest), np.nan)
    ends = np.cumsum([len(part.numbers) for part in parts])
    for part, end in zip(parts, ends, strict=True):
        if part.force is not None:
            force[end - len(part.numbers) : end, : part.force.shape[1]] = part.force
    return Outcome(numbers, columns, force[order])


def outcome_of(
    numbers: list[int], metrics: Metrics, last: Floats, steps: int, dt: float,
    unsettled: NDArray[np.int64], force: Floats | None = None,
) -> Outcome:  # fmt: skip
    """Return the outcome of cases that were run with one time step, before they are judged.

    `last` (cases,) are the contact forces after the last step, `force` (cases, steps) all.
    """
    cases = len(numbers)
    about = {
        "status": np.where(last > 0.0, Status.STILL, Status.OK),
        "validity": np.full(cases, VALID),
        "dt": np.full(cases, dt),
        "steps": np.full(cases, steps, dtype=np.int64),
        "unsettled": unsettled,
        REACHED: metrics.reached,
    }
    return Outcome(numbers, {**metrics.columns, **about}, force)


def freed(some: Sequence[Task]) -> int:
    """Count cases with B != 0 in which u and v, restrained at every node, are released."""
    count = 0
    for task in some:
        if "support" in task.cases[0]:  # which has its own u and v
            continue
        plate = {name: value for name, value in task.cases[0].items() if name in inputs.LAMINATE}
        with suppress(CasesError):
            if apply_case(task.deck, plate).all(Boundary) != task.deck.all(Boundary):
                count += len(task.numbers)
    return count


def without_output(checked: Problem, extra: Sequence[str] = ()) -> Problem:
    """Return a problem whose program stores no fields, but those of more columns."""
    dropped = {"DISP", "STRE", "PLYS", "REAC", "EIGE"}
    if FAILURE not in extra:
        dropped.add("FAIL")

    def kept(body: Body) -> Iterator[Macro | Loop]:
        for item in body:
            if isinstance(item, Loop):
                yield replace(item, body=tuple(kept(item.body)))
            elif item.word not in dropped:
                yield replace(item, value=1e9) if item.word == "RODP" else item

    return replace(checked, program=tuple(kept(checked.program)))


def check_memory(checked: Problem, made: Plan, workers: int, *, streamed: bool = False) -> None:
    """Reject a sweep that needs more memory than is free, by a NotEnoughMemoryError.

    `workers` are those on this machine; 0 if a cluster runs the cases.  If histories are
    `streamed` to files, only those of one task are held.
    """
    if REFINE in made.cases[-1]:
        checked = check_deck(apply_case(made.deck, made.cases[-1]))
    steps, cases = checked.work.steps, len(made.cases)
    at_once = min(workers, len(tasks(checked, made)))
    plate = checked if made.measure else without_output(checked, made.extra)
    kept = KEPT * steps * (min(cases, TOGETHER) if streamed else cases) if made.history else 0

    def needed(exact: bool) -> int:
        if not at_once:
            return kept
        one = needed_bytes(plate, in_memory=made.measure is not None, exact=exact)
        one += ADVANCED * steps * _together(checked, made)
        return kept + at_once * one

    def remedy(free: int) -> str:
        if needed(True) - kept <= free:
            return "take fewer cases, or none of their histories"
        return "take fewer workers" if at_once > 1 else "take fewer steps or a coarser mesh"

    _memory.check("the sweep", needed, remedy)
