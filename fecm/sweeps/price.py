"""Price of a sweep: full runs, and their time on this machine."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import replace

from fecm._machine import free_processors
from fecm.authoring.case import Case, CasesError
from fecm.authoring.timing import duration_of, lengthened
from fecm.authoring.values import REFINE
from fecm.problem.problem import Problem
from fecm.results.metrics import SUMMARY
from fecm.sweeps.backends import run_task
from fecm.sweeps.in_full import run_case_in_full
from fecm.sweeps.plan import WORTH_WORKERS, Plan, Task, shares_plate, tasks
from fecm.sweeps.search import USUAL

FILE = 35_000  # bytes of a file with few cases: groups, attributes, the deck
FEW_CASES = 64  # cases that show what a case costs once its plate is stepped
FEW = 10  # steps of a short run, which shows what a run costs before its steps
MORE = 8  # factor on the steps of each further run
ENOUGH = 0.1  # seconds that the last of these runs takes longer than the short run
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
    chosen = _full_cases(problem, definition)
    if len(chosen) < count:
        runs = f"{len(chosen)} full run{'' if len(chosen) == 1 else 's'}"
        count = len(chosen)
    text = f"a nonlinear plate has no impulse response: {cases}, {runs}"
    _, seconds = _of_full_runs(problem, definition, chosen)
    if math.isnan(seconds):
        return text
    if workers is None:
        workers = free_processors() if seconds >= WORTH_WORKERS else 1
    where = f" by {workers} workers" if workers > 1 else ""
    if not workers:
        where = " of computation"
    return f"{text}: about {_rounded(seconds / max(1, min(workers, count)))}{where}"


def seconds_of(problem: Problem, definition: Plan) -> tuple[int, float]:
    """Return the steps of the plate that a sweep takes, and their seconds in one process.

    The first case of a shared plate is computed, and then some more: their response stays in memory
    for the sweep. The seconds are NaN if they are not known.
    """
    settings = definition.settings
    if settings.build is not None:
        return problem.work.steps * len(definition.cases), math.nan
    if settings.modes is None and (settings.in_full or not shares_plate(problem)):
        return _of_full_runs(problem, definition, _full_cases(problem, definition))
    whole = tasks(problem, definition)
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


def _full_cases(problem: Problem, definition: Plan) -> Sequence[Case]:
    """Return the cases that each take a full run: one for all that share a motion."""
    if not definition.settings.shares_motion:
        return definition.cases
    return tuple(task.cases[0] for task in tasks(problem, definition))


def _of_full_runs(problem: Problem, definition: Plan, chosen: Sequence[Case]) -> tuple[int, float]:
    """Return steps and seconds of the full runs of cases; NaN if a run of a few steps fails."""
    each = 1 if definition.settings.search is None else USUAL
    duration = duration_of(problem)
    steps = sum(_full_steps(case, duration, problem.work.steps) for case in chosen)
    try:
        begin, step = _costs(problem, definition)
    except CasesError:
        return int(each * steps), math.nan
    return int(each * steps), each * (begin * len(chosen) + step * steps)


def _costs(problem: Problem, definition: Plan) -> tuple[float, float]:
    """Return the seconds of a run before its steps, and of a step."""
    first, few = _seconds(problem, definition, FEW)
    second, more = first, few
    enough = FEW
    # Other work of the machine changes short times.
    while second - first < ENOUGH and enough < problem.work.steps:
        enough *= MORE
        second, more = _seconds(problem, definition, enough)
    if more == few:
        return 0.0, second / more
    step = max(0.0, second - first) / (more - few)
    return max(0.0, first - step * few), step


def _seconds(problem: Problem, definition: Plan, steps: int) -> tuple[float, int]:
    """Return the seconds of a run of about `steps` steps, and the number of its steps."""
    short = lengthened(problem, min(1.0, steps / problem.work.steps))
    begin = time.perf_counter()
    run_case_in_full(0, short, definition.settings.measures, law=definition.settings.law)
    return time.perf_counter() - begin, short.work.steps


def _full_steps(case: Case, duration: float, steps: int) -> float:
    """Return the steps of a case, counted from the duration and the elements of the deck."""
    dt = float(case.get("dt", 0.0)) or duration / steps
    return float(case.get(REFINE, 1)) ** 2 * float(case.get("duration", duration)) / dt


def _rounded(seconds: float) -> str:
    """Format a duration with two digits."""
    size, unit = next(((s, u) for s, u in UNITS if seconds >= 2.0 * s), UNITS[-1])
    return f"{float(f'{seconds / size:.2g}'):g} {unit}"
