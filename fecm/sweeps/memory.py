"""Memory that a sweep needs."""

from __future__ import annotations

from contextlib import suppress

from fecm import _memory
from fecm.mechanics.kernels import LIBRARY
from fecm.problem.memory import needed_bytes
from fecm.problem.problem import Problem
from fecm.sweeps.case import Case, CasesError
from fecm.sweeps.checks import check_deck
from fecm.sweeps.in_full import stores_rows, without_output
from fecm.sweeps.plan import MOST_TOGETHER, Plan, runs_together, tasks
from fecm.sweeps.values import REFINE
from fecm.sweeps.vary import apply_case

# Bytes per step and case, above the measured values: of a case that is advanced, and of a case
# whose history is stored.
ADVANCED_BYTES = 34 if LIBRARY is None else 12
HISTORY_BYTES = 24
LONGER = frozenset(("duration", "dt"))  # values on which the number of steps depends


def _steps(case: Case) -> float:
    """Measure of the steps of a case, compared with other cases of the same names."""
    duration, dt = (float(case.get(name, 1.0)) for name in ("duration", "dt"))
    return duration / dt if dt > 0.0 else 0.0


def check_memory(checked: Problem, made: Plan, workers: int, *, streamed: bool = False) -> None:
    """Reject a sweep that needs more memory than is free, by a NotEnoughMemoryError.

    `workers` are those on this machine; 0 if a cluster runs the cases.  If histories are
    `streamed` to files, only those of one task are held.
    """
    settings = made.settings
    if REFINE in made.cases[-1]:
        checked = check_deck(apply_case(settings.deck, made.cases[-1]))
    elif not LONGER.isdisjoint(made.cases[-1]):
        with suppress(CasesError):  # of a case that fails
            checked = check_deck(apply_case(settings.deck, max(made.cases, key=_steps)))
    steps, cases = checked.work.steps, len(made.cases)
    at_once = min(workers, len(tasks(checked, made))) if workers > 1 else workers
    plate = checked if settings.measure else without_output(checked, settings.measures)
    in_memory = settings.measure is not None or (
        settings.modes is None and stores_rows(checked, settings.measures)
    )
    stored = 0
    if settings.history:
        stored = HISTORY_BYTES * steps * (min(cases, MOST_TOGETHER) if streamed else cases)

    def needed(exact: bool) -> int:
        if not at_once:
            return stored
        one = needed_bytes(plate, in_memory=in_memory, exact=exact)
        one += ADVANCED_BYTES * steps * runs_together(checked, made)
        return stored + at_once * one

    def remedy(free: int) -> str:
        if needed(True) - stored <= free:
            return "take fewer cases, or none of their histories"
        return "take fewer workers" if at_once > 1 else "take fewer steps or a coarser mesh"

    _memory.check("the sweep", needed, remedy)
