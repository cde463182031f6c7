"""Plans and tasks of sweeps, and what a method of computation answers about them.

A study (grid, cases, random, refine) gives cases. A plan has the cases, their common
:class:`Settings`, and the :class:`Method` that computes them, which :func:`fecm.sweeps.plan.plan`
chooses. :func:`tasks` splits a plan. :func:`run_task` computes a task, and
:func:`fecm.sweeps.result.sweep_result` makes the result of the plan from all outcomes.
"""

from __future__ import annotations

import hashlib
import json
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING, Any, NamedTuple

from fecm._version import __version__
from fecm._watch import Watch
from fecm.authoring.case import Case, Value
from fecm.authoring.time_values import Clock
from fecm.authoring.values import OF_PLATE
from fecm.deck.model import Deck
from fecm.mechanics.contact_law import Law
from fecm.mechanics.own_law import law_name
from fecm.problem.problem import Problem
from fecm.results.result import Result
from fecm.sweeps.limits import Limit
from fecm.sweeps.outcome import MeasuredColumn, Outcome, merge
from fecm.sweeps.random import Design
from fecm.sweeps.search import Search

if TYPE_CHECKING:
    from fecm.sweeps.reduced import ReducedModel

BuildFunction = Callable[[dict[str, Any]], Deck]  # of a case, whose values are any
MeasureFunction = Callable[[Result], Mapping[str, float]]
NO_COLUMNS: Mapping[str, MeasuredColumn] = {}
MOST_TOGETHER = 2048  # cases advanced together
REDUCED, FULL = "reduced", "full"  # models of a nonlinear plate
MODELS = (REDUCED, FULL)
MODES = 13  # bending modes of the reduced model, if the caller gives no number
WORTH_WORKERS = 10.0  # seconds that tasks take, from which on workers are worth their start


class Measure(StrEnum):
    """Columns that are measured on request."""

    DEFLECTION = "max_deflection"
    GAGES = "gages"
    FAILURE = "failure"


MEASURES = tuple(measure.value for measure in Measure)


@dataclass(frozen=True)
class Settings:
    """What the cases of a sweep have in common."""

    deck: Deck  # that is varied; with `build` the deck of a case
    history: bool = False  # whether contact forces are stored
    clock: Clock | None = None  # None if the time step of the deck applies to every plate
    search: Search | None = None  # for the velocity of every case
    build: BuildFunction | None = None  # makes the deck of a case
    measure: MeasureFunction | None = None  # computes more columns from the result of a case
    measures: tuple[Measure, ...] = ()  # more columns
    model: str | None = None  # that the caller asks for: REDUCED, FULL, or None for either
    modes: int = MODES  # bending modes of the reduced model
    law: Law | None = None  # a user's contact law instead of the deck's

    @property
    def has_exposures(self) -> bool:
        """Whether the results of cases have the exposures of FAIL."""
        return self.measure is not None or Measure.FAILURE in self.measures


@dataclass(frozen=True)
class Plan:
    """Definition of a sweep."""

    settings: Settings
    cases: tuple[Case, ...]
    method: Method  # that computes the cases
    design: Design | None = None  # of random cases
    limits: tuple[Limit, ...] = ()  # whose probability of exceedance is asked for
    measured: Mapping[str, MeasuredColumn] = field(default_factory=dict)  # of the table of cases

    def fingerprint(self) -> str:
        """Return the hash that identifies the outcomes of this sweep."""
        settings = self.settings
        parts = [
            __version__,
            settings.deck.to_text(),
            self.cases,
            settings.history,
            settings.search,
        ]
        law = () if settings.law is None else (law_name(settings.law),)
        model = (type(self.method).__name__, settings.modes)
        text = json.dumps([*parts, settings.measures, model, MOST_TOGETHER, *law])
        return hashlib.sha256(text.encode()).hexdigest()


@dataclass(frozen=True)
class Task:
    """Cases that are computed together."""

    settings: Settings
    method: Method
    number: int
    numbers: tuple[int, ...]  # of the cases
    cases: tuple[Case, ...]

    @property
    def plate_values(self) -> Case:
        """Values of the plate, which the cases share unless each is run in full."""
        return {name: value for name, value in self.cases[0].items() if name in OF_PLATE}


RunTasks = Callable[[Sequence[Task]], list[tuple[Task, Outcome]]]


class Prepared(NamedTuple):
    """Tasks that compute all cases of a plan, and the reduced model that some of them take."""

    tasks: list[Task]
    model: ReducedModel | None = None
    outcomes: Sequence[tuple[Task, Outcome]] = ()  # of the tasks that are computed


class Method(ABC):
    """How the cases of a plan are computed; :data:`fecm.sweeps.methods.METHODS` has all methods.

    A method has no state: it is sent to other processes with its tasks.
    """

    @abstractmethod
    def applies(self, checked: Problem, settings: Settings, cases: Sequence[Case]) -> bool:
        """Return whether the method is for cases of a problem, which all have the same names.

        It is asked after the methods before it in the table.
        """

    def refusal(self, checked: Problem, definition: Plan) -> str:
        """Explain why the method can't compute a plan; empty if it can."""
        return ""

    @abstractmethod
    def most_cases(self, definition: Plan) -> int:
        """Return the largest number of cases of a task."""

    def separates(self, name: str) -> bool:
        """Return whether cases of a task have the same value of a name."""
        return name in OF_PLATE

    def prepared(self, checked: Problem, definition: Plan, run: RunTasks, watch: Watch) -> Prepared:
        """Return the tasks of a plan; `run` computes tasks that decide which they are."""
        return Prepared(tasks(definition))

    @abstractmethod
    def outcomes(self, task: Task) -> list[Outcome]:
        """Compute the cases of a task; the status of a failed case is the reason."""

    @abstractmethod
    def work(self, checked: Problem, definition: Plan) -> tuple[int, float]:
        """Return the steps of the plate that a plan takes, and their seconds in one process.

        The seconds are NaN if they are not known.
        """

    @abstractmethod
    def expectation(self, checked: Problem, definition: Plan, workers: int | None) -> list[str]:
        """Say how many runs of the plate the cases take, where that is not obvious.

        `workers` is 0 if a cluster runs the cases, and None if their number depends on the time.
        """

    @abstractmethod
    def process_bytes(self, checked: Problem, settings: Settings, *, exact: bool) -> int:
        """Return the memory of a process beside the forces of its cases."""

    @abstractmethod
    def most_forces(self, definition: Plan, steps: int) -> int:
        """Return the largest number of runs of so many steps whose forces are held at once."""


def tasks(definition: Plan, cases: Sequence[int] | None = None) -> list[Task]:
    """Split a plan, or some of its cases, into tasks."""
    settings, method = definition.settings, definition.method
    together = method.most_cases(definition)
    chosen = range(len(definition.cases)) if cases is None else cases
    parts = [
        tuple(numbers[start : start + together])
        for numbers in sharing(method, definition.cases, chosen)
        for start in range(0, len(numbers), together)
    ]
    return [
        Task(settings, method, number, numbers, tuple(definition.cases[n] for n in numbers))
        for number, numbers in enumerate(parts)
    ]


def sharing(method: Method, cases: Sequence[Case], chosen: Iterable[int]) -> list[list[int]]:
    """Group the numbers of some of the cases by the values in which a task's cases agree."""
    names = [name for name in cases[0] if method.separates(name)]
    groups: dict[tuple[Value, ...], list[int]] = {}
    for number in chosen:
        key = tuple(cases[number][name] for name in names)
        groups.setdefault(key, []).append(number)
    return [*groups.values()]


def run_task(task: Task) -> Outcome:
    """Compute the cases of a task; the status of a failed case is the reason."""
    return merge(task.method.outcomes(task), history=task.settings.history)
