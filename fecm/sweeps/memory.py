"""Memory that a sweep will take, known before it takes any."""

from __future__ import annotations

from dataclasses import replace

from fecm.check import Checked
from fecm.check.memory import needed_bytes
from fecm.memory import NotEnoughMemoryError, available, said
from fecm.program import estimate
from fecm.sweeps.run import quiet, shares_plate
from fecm.sweeps.tasks import TOGETHER, Plan, tasks

# Bytes a step of each case: while it is advanced with others, and where its history is kept.  Both
# are more than was measured.
ADVANCED, KEPT = 28, 24


def check_memory(checked: Checked, made: Plan, workers: int) -> None:
    """Refuse a sweep that takes more memory than is free.

    Parameters
    ----------
    checked : Checked
        The deck that is varied.
    made : Plan
    workers : int
        Processes on this machine that run cases; 0 where others do.

    Raises
    ------
    NotEnoughMemoryError
        With both numbers.
    """
    free = available()
    if free is None:
        return
    steps, cases = estimate(checked.program).steps, len(made.cases)
    together = min(TOGETHER, cases) if shares_plate(checked) else 1
    plate = replace(checked, program=quiet(checked.program))
    kept = KEPT * steps * cases if made.history else 0
    at_once = min(workers, len(tasks(checked, made)))
    needed = 0
    for exact in (False, True):  # the congruent elements need not always be counted
        needed = kept
        if at_once:
            needed += at_once * (needed_bytes(plate, exact=exact) + ADVANCED * steps * together)
        if needed <= free:
            return
    remedy = "take fewer workers" if at_once > 1 else "take fewer steps or a coarser mesh"
    if needed - kept <= free:
        remedy = "take fewer cases, or none of their histories"
    raise NotEnoughMemoryError(
        f"the sweep takes about {said(needed)} of memory, and {said(free)} are free; {remedy}"
    )
