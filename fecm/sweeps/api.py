"""Sweeps from Python."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path
from typing import Any

from fecm._errors import FecmWarning
from fecm.api import load_deck
from fecm.deck.findings import DeckError
from fecm.deck.model import Deck
from fecm.problem.problem import Problem
from fecm.sweeps.cases import CasesError, checked, combined
from fecm.sweeps.outcome import Outcome, merge
from fecm.sweeps.plan import Plan, Task, check_memory, plan, tasks
from fecm.sweeps.result import SweepResult, result_of, save
from fecm.sweeps.schedule import Done, Idle, lost, on_dask, on_executor, on_workers, run_serial
from fecm.sweeps.store import DamagedPartError, PartialResults

# Executors whose tasks take memory of this machine.
LOCAL = (ThreadPoolExecutor, ProcessPoolExecutor)


def warn(text: str) -> None:
    """Warn with a :class:`FecmWarning`."""
    warnings.warn(FecmWarning(text), stacklevel=3)


def problem_of(deck: str | Path | Deck) -> Problem:
    """Return the checked problem of a deck with a single problem.

    Raises
    ------
    DeckError
        If the deck has errors.
    CasesError
        If the deck has several problems.
    """
    prepared = load_deck(deck)
    if prepared.errors(force=True):
        raise DeckError(prepared.findings, prepared.source)
    if (count := len(prepared.problems)) != 1:
        raise CasesError(f"{prepared.source} has {count} problems; a sweep takes one")
    return prepared.problems[0]


def carry_out(
    problem: Problem,
    made: Plan,
    *,
    workers: int = 1,
    scheduler: object = None,
    executor: Executor | None = None,
    parts: PartialResults | None = None,
    done: Done = lambda task, outcome: None,
    idle: Idle = lambda: None,
    note: Callable[[str], None] = warn,
) -> SweepResult:
    """Run the tasks of a plan.

    Parameters
    ----------
    problem : Problem
        Checked problem of the deck.
    made : Plan
    workers : int
        Worker processes on this machine; 1 runs all tasks in this process.
    scheduler : str, distributed.Client or cluster, optional
        Dask cluster whose workers run the tasks instead.
    executor : concurrent.futures.Executor, optional
        Runs the tasks instead; it is not shut down.
    parts : PartialResults, optional
        Store of finished tasks, which are not run again.
    done : callable
        Called with each task and its outcome, including tasks finished earlier.
    idle : callable
        Called regularly.
    note : callable
        Called with messages for the user.

    Raises
    ------
    SchedulerError
        If the scheduler cannot be used.
    """
    outcomes: list[Outcome] = []
    left: list[Task] = []
    for task in tasks(problem, made):
        before = None
        try:
            before = None if parts is None else parts.get(task)
        except DamagedPartError as error:
            note(f"{error}; its cases are run again")
        if before is None:
            left.append(task)
        else:
            outcomes.append(before)
            done(task, before)

    def keep(task: Task, outcome: Outcome) -> None:
        if parts is not None and not lost(outcome):
            parts.put(task, outcome)
        outcomes.append(outcome)
        done(task, outcome)

    if executor is not None:
        on_executor(left, executor, keep, idle)
    elif scheduler is not None:
        on_dask(left, scheduler, keep, idle)
    elif workers > 1 and len(left) > 1:
        on_workers(left, workers, keep, idle)
    else:
        run_serial(left, keep, idle)
    outcome = merge(outcomes)
    if not made.history:
        outcome.force = None
    return result_of(made, outcome)


def sweep(
    deck: str | Path | Deck,
    vary: Mapping[str, Sequence[Any]] | None = None,
    cases: Iterable[Mapping[str, Any]] | None = None,
    *,
    until: float | str | None = None,
    history: bool = False,
    workers: int = 1,
    scheduler: object = None,
    executor: Executor | None = None,
    output: str | Path | None = None,
) -> SweepResult:
    """Run a deck many times with varied values.

    Parameters
    ----------
    deck : str, Path or Deck
        Deck with a single problem.
    vary : mapping of str to sequence
        Values by name; all combinations are run.
    cases : iterable of mapping, optional
        Cases instead, one mapping each.
    until : float or str, optional
        Search in every case for the velocity at which the peak force reaches this value;
        ``"threshold"``: the delamination threshold.  Without `vary` and `cases`, of the deck alone.
    history : bool
        Store the contact force of every step.
    workers : int
        Worker processes on this machine.  With more than 1, a script needs
        ``if __name__ == "__main__"``.
    scheduler : str, distributed.Client or cluster, optional
        Dask scheduler, by its address or by an object of Dask (requires dask.distributed).
    executor : concurrent.futures.Executor, optional
        Pool of threads or processes, or another executor.  It is not shut down.
    output : str or Path, optional
        Output file, which is overwritten.

    Returns
    -------
    SweepResult

    Raises
    ------
    CasesError
        If the cases are invalid.
    DeckError
        If the deck has errors.
    NotEnoughMemoryError
        If the sweep needs more memory than is free; a MemoryError.
    SchedulerError
        If the scheduler cannot be used.
    OSError
        If a file cannot be read or written.

    Examples
    --------
    >>> found = sweep("decks/impact-115.inp", {"velocity": [50.0, 115.0]})
    >>> [f"{force:.3f}" for force in found["peak_force"]]
    ['36.058', '86.202']
    """
    if (vary is None) == (cases is None) and not (vary is None and until is not None):
        raise CasesError("give either vary or cases")
    if executor is not None and not isinstance(executor, Executor):
        raise CasesError(f"executor is {executor!r}, not a concurrent.futures.Executor")
    if (workers > 1) + (scheduler is not None) + (executor is not None) > 1:
        raise CasesError("give only one of workers, scheduler and executor")
    made = combined({} if vary is None else vary) if cases is None else checked(cases)
    problem = problem_of(deck)
    planned = plan(problem, made, history=history, until=until)
    here = getattr(executor, "_max_workers", 0) if isinstance(executor, LOCAL) else workers
    check_memory(problem, planned, 0 if scheduler is not None else here)
    result = carry_out(problem, planned, workers=workers, scheduler=scheduler, executor=executor)
    if output is not None:
        save(result, Path(output))
    return result
