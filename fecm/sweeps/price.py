"""Price of a sweep: full runs, and their time on this machine."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Sequence
from dataclasses import replace

from fecm._machine import free_processors
from fecm.authoring.case import Case, CasesError
from fecm.authoring.time_values import duration_of
from fecm.authoring.values import REFINE
from fecm.deck.macros import EXTENDED
from fecm.problem.problem import Problem
from fecm.results.metrics import SUMMARY
from fecm.results.sinks import MemorySink
from fecm.simulation.run import seconds_of_steps
from fecm.sweeps.in_full import motion, problem_of_case
from fecm.sweeps.search import USUAL
from fecm.sweeps.task import WORTH_WORKERS, Plan, Settings, Task, run_task, tasks

FILE = 35_000  # bytes of a file with few cases: groups, attributes, the deck
FEW_CASES = 64  # cases that show what a case costs once its plate is stepped
UNITS = ((3600.0, "h"), (60.0, "min"), (1.0, "s"))


def expected(problem: Problem, definition: Plan, workers: int | None) -> str:
    """Say how many full runs the cases of a plan take, and about how long.

    The time is for `workers` on this machine. `workers` is 0 if a cluster runs the cases, and None
    if their number depends on the time.
    """
    count = len(definition.cases)
    cases = f"{count} case{'' if count == 1 else 's'}"
    runs = "one full run each"
    if definition.settings.search is not None:
        runs = f"about {USUAL} full runs each"
    if (motions := len(tasks(definition))) < count:
        runs = f"{motions} full run{'' if motions == 1 else 's'}"
    words = problem.deck.nonlinear_words
    seconds = time_of_runs(problem, definition, workers)
    return f"a plate with {words} has no impulse response: {cases}, {runs}{seconds}"


def time_of_runs(problem: Problem, definition: Plan, workers: int | None) -> str:
    """Say about how long the full runs of a plan take; empty if that is not known."""
    _, seconds = work_of_runs(problem, definition)
    if math.isnan(seconds):
        return ""
    count = len(tasks(definition))
    if workers is None:
        workers = free_processors() if seconds >= WORTH_WORKERS else 1
    where = f" by {workers} workers" if workers > 1 else ""
    if not workers:
        where = " of computation"
    return f": about {_rounded(seconds / max(1, min(workers, count)))}{where}"


def work_of_plates(problem: Problem, definition: Plan) -> tuple[int, float]:
    """Return the steps of the plates of a sweep, and its seconds in one process.

    The first case of a plate is computed, and then some more: their response stays in memory for
    the sweep.
    """
    whole = tasks(definition)
    first = whole[0]
    alone, several = (
        replace(first, numbers=first.numbers[:count], cases=first.cases[:count])
        for count in (1, FEW_CASES)
    )
    of_plate, of_cases = (_seconds_of_task(task) for task in (alone, several))
    seconds = of_plate * len(whole) + of_cases / len(several.cases) * len(definition.cases)
    return problem.work.steps * len(whole), seconds


def _seconds_of_task(task: Task) -> float:
    begin = time.perf_counter()
    run_task(task)
    return time.perf_counter() - begin


def output_bytes(problem: Problem, definition: Plan) -> int:
    """Estimate the size of the file of a sweep."""
    columns = len(SUMMARY) + len(definition.cases[0])
    steps = problem.work.steps if definition.settings.history else 0
    return FILE + 8 * len(definition.cases) * (columns + steps)


def work_of_runs(problem: Problem, definition: Plan) -> tuple[int, float]:
    """Return steps and seconds of full runs; the seconds are NaN if a run of a few steps fails."""
    each = 1 if definition.settings.search is None else USUAL
    motions = [task.cases for task in tasks(definition)]
    duration = duration_of(problem)
    steps = sum(_full_steps(cases[0], duration, problem.work.steps) for cases in motions)
    before, step = _costs(problem, definition.settings, motions[0])
    usual = steps / EXTENDED if problem.work.at_most else steps  # OVER ends a run long before
    return int(each * steps), each * (before * len(motions) + step * usual)


def _costs(problem: Problem, settings: Settings, cases: Sequence[Case]) -> tuple[float, float]:
    """Return the seconds of the motion of cases before its steps, and of a step."""
    begin = time.perf_counter()
    with contextlib.suppress(CasesError):  # the time until then counts, too
        problem_of_case(settings, cases[0])
    checking = time.perf_counter() - begin
    problems = [problem] * len(cases)
    before, step = seconds_of_steps(
        lambda observer: motion(
            problems,
            MemorySink(),
            settings.measures,
            settings.measure,
            settings.law,
            [observer],
        )
    )
    return checking * len(cases) + before, step


def _full_steps(case: Case, duration: float, steps: int) -> float:
    """Return the steps of a case, counted from the duration and the elements of the deck."""
    dt = float(case.get("dt", 0.0)) or duration / steps
    return float(case.get(REFINE, 1)) ** 2 * float(case.get("duration", duration)) / dt


def _rounded(seconds: float) -> str:
    """Format a duration with two digits."""
    size, unit = next(((s, u) for s, u in UNITS if seconds >= 2.0 * s), UNITS[-1])
    return f"{float(f'{seconds / size:.2g}'):g} {unit}"
