"""Memory that a sweep will take, known before it takes any."""

from __future__ import annotations

from dataclasses import replace

from fecm import memory
from fecm.check import Checked
from fecm.check.memory import needed_bytes
from fecm.program import estimate
from fecm.sweeps.run import ADVANCED, quiet, shares_plate
from fecm.sweeps.tasks import TOGETHER, Plan, tasks

# Bytes a step of each case whose history is kept: more than was measured.
KEPT = 24


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
    steps, cases = estimate(checked.program).steps, len(made.cases)
    together = min(TOGETHER, cases) if shares_plate(checked) else 1
    at_once = min(workers, len(tasks(checked, made)))
    plate = replace(checked, program=quiet(checked.program))
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

    memory.check("the sweep", needed, remedy)
