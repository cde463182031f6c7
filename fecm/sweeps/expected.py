"""Expected time of a sweep whose cases are run in full, from a few steps of one run."""

from __future__ import annotations

import time

from fecm._processors import free
from fecm.problem.problem import Problem
from fecm.sweeps.case import Case, CasesError
from fecm.sweeps.find_in_full import USUAL
from fecm.sweeps.in_full import alone
from fecm.sweeps.plan import Plan, tasks
from fecm.sweeps.schedule import WORTH_WORKERS
from fecm.sweeps.timing import duration_of, lengthened
from fecm.sweeps.values import REFINE

# Steps of a short run, which shows what a run costs before its steps; then runs of so many times
# more steps follow, until one takes enough seconds longer.
FEW = 10
MORE = 8
ENOUGH = 0.1
UNITS = ((3600.0, "h"), (60.0, "min"), (1.0, "s"))


def expected(problem: Problem, made: Plan, workers: int | None) -> str:
    """Say how many full runs the cases of a plan take, and about how long.

    The time is that of `workers` on this machine; 0 if a cluster runs the cases, None if their
    number depends on the time.
    """
    count = len(made.cases)
    cases = f"{count} case{'' if count == 1 else 's'}"
    runs = "one full run each"
    each = 1
    if made.settings.search is not None:
        each, runs = USUAL, f"about {USUAL} full runs each"
    chosen = made.cases
    if made.settings.shares_motion:
        chosen = tuple(task.cases[0] for task in tasks(problem, made))
        if len(chosen) < count:
            runs = f"{len(chosen)} full run{'' if len(chosen) == 1 else 's'}"
            count = len(chosen)
    text = f"a nonlinear plate has no impulse response: {cases}, {runs}"
    try:
        begin, step = _costs(problem, made)
    except CasesError:  # no run of a few steps
        return text
    duration = duration_of(problem)
    steps = sum(_full_steps(case, duration, problem.work.steps) for case in chosen)
    seconds = each * (begin * count + step * steps)
    if workers is None:
        workers = free() if seconds >= WORTH_WORKERS else 1
    where = f" by {workers} workers" if workers > 1 else ""
    if not workers:
        where = " of computation"
    return f"{text}: about {_rounded(seconds / max(1, min(workers, count)))}{where}"


def _costs(problem: Problem, made: Plan) -> tuple[float, float]:
    """Seconds of a run before its steps, and of a step."""
    first, few = _seconds(problem, made, FEW)
    second, more = first, few
    wanted = FEW
    # Other work of the machine changes short times.
    while second - first < ENOUGH and wanted < problem.work.steps:
        wanted *= MORE
        second, more = _seconds(problem, made, wanted)
    if more == few:
        return 0.0, second / more
    step = max(0.0, second - first) / (more - few)
    return max(0.0, first - step * few), step


def _seconds(problem: Problem, made: Plan, steps: int) -> tuple[float, int]:
    """Seconds of a run of about so many steps, and their number."""
    short = lengthened(problem, min(1.0, steps / problem.work.steps))
    begin = time.perf_counter()
    alone(0, short, made.settings.measures, law=made.settings.law)
    return time.perf_counter() - begin, short.work.steps


def _full_steps(case: Case, duration: float, steps: int) -> float:
    """Steps of a case, counted by the elements of the deck, whose duration and steps are given."""
    dt = float(case.get("dt", 0.0)) or duration / steps
    return float(case.get(REFINE, 1)) ** 2 * float(case.get("duration", duration)) / dt


def _rounded(seconds: float) -> str:
    """A duration with two digits."""
    size, unit = next(((s, u) for s, u in UNITS if seconds >= 2.0 * s), UNITS[-1])
    return f"{float(f'{seconds / size:.2g}'):g} {unit}"
