"""Execution of the tasks of a sweep: here, in worker processes, on a Dask cluster or an executor.

Tasks are independent, and their outcomes do not depend on where they run. Each outcome is reported
as soon as it is available, so that an interrupted sweep loses only the tasks in progress.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import pickle
import signal
import socket
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent import futures
from contextlib import contextmanager, nullcontext, suppress
from functools import partial
from multiprocessing import resource_tracker
from multiprocessing.synchronize import Event
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import urlsplit

from fecm._errors import FecmError
from fecm._inputs import read_input
from fecm._machine import NotEnoughMemoryError, free_processors
from fecm._watch import SILENT, StoppedError, Watch
from fecm.problem.problem import Problem
from fecm.sweeps.checks import check_sweep_memory
from fecm.sweeps.in_full import format_exception
from fecm.sweeps.outcome import Outcome, merge
from fecm.sweeps.partial_results import DamagedPartError, PartialResults
from fecm.sweeps.result import SweepResult, sweep_result
from fecm.sweeps.task import WORTH_WORKERS, Plan, Task, run_task

Done = Callable[[Task, Outcome], None]
Submit = Callable[[Callable[[Task], Outcome], Task], futures.Future[Outcome]]
Idle = Callable[[], None]  # called regularly while workers run, to handle signals
DEATHS = 3  # of workers without a finished task, after which the remaining tasks count as lost
LOOK = 0.5  # polling interval in seconds
PATIENCE = 5.0  # seconds for the scheduler to answer
LOST = "lost with its worker"
GUARD = '`if __name__ == "__main__":`'
UNGUARDED = (
    "no worker process could start: each imports the script that is running; call fecm there under "
    f"{GUARD}"
)
ENDING = {n for n in signal.Signals if n.name in ("SIGINT", "SIGTERM", "SIGHUP")}
MOST_ADDRESS = 100_000  # bytes of a file with the scheduler's address


class SchedulerError(FecmError, RuntimeError):
    """The scheduler cannot be used."""


def attempt(task: Task) -> Outcome:
    """Run a task; an exception becomes the status of its cases."""
    try:
        return run_task(task)
    except Exception as error:  # a failed case must not end the sweep
        return Outcome.failed(dict.fromkeys(task.numbers, f"{type(error).__name__}: {error}"))


def _begin(started: Event, ended: Event, parent: int) -> None:
    """Report that this worker process has started; end it soon after its parent, or at `ended`."""
    started.set()

    def watch() -> None:
        while os.getppid() == parent and not ended.is_set():
            time.sleep(LOOK)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # an interrupt has no traceback
    if hasattr(signal, "pthread_sigmask"):  # not on Windows
        signal.pthread_sigmask(signal.SIG_UNBLOCK, ENDING)


@contextmanager
def _signals_blocked() -> Iterator[None]:
    """Block the signals that end a program; a process that is started inherits this.

    A terminal sends its signals to all processes. Python would print a traceback for a signal that
    comes while it starts.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, ENDING)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _run_on(
    submit: Submit, tasks: Iterable[Task], idle: Idle
) -> Iterator[tuple[Task, futures.Future[Outcome]]]:
    """Yield tasks and futures as an executor finishes them.

    Raises SchedulerError if the executor takes no tasks.
    """
    running: dict[futures.Future[Outcome], Task] = {}
    try:
        for task in tasks:
            try:
                running[submit(attempt, task)] = task
            except futures.BrokenExecutor:
                raise
            except (RuntimeError, TypeError, pickle.PicklingError) as error:
                raise SchedulerError(f"the executor takes no tasks: {error}") from None
        while running:
            idle()
            for future in futures.wait(running, LOOK, futures.FIRST_COMPLETED).done:
                yield running.pop(future), future
    finally:
        for future in running:
            future.cancel()


def here(tasks: Sequence[Task], done: Done, idle: Idle) -> None:
    """Run tasks in this process."""
    for task in tasks:
        idle()
        done(task, attempt(task))


def here_first(
    tasks: Sequence[Task], most_workers: Callable[[], int], done: Done, idle: Idle
) -> None:
    """Run tasks in this process; use workers if the tasks take longer than workers to start.

    `most_workers` returns the largest number of workers.
    """
    begin = time.monotonic()
    for count, task in enumerate(tasks):
        remaining = tasks[count:]
        expected = len(remaining) * (time.monotonic() - begin) / max(1, count)
        worth = expected >= WORTH_WORKERS and _can_be_sent(task)
        workers = min(most_workers(), len(remaining)) if worth else 1
        if workers > 1:
            on_workers(remaining, workers, done, idle)
            return
        here([task], done, idle)


def _can_be_sent(task: Task) -> bool:
    """Return whether another process can get a task, whose contact law may be any object."""
    try:
        pickle.dumps(task)
    except Exception:  # pickle raises several types
        return False
    return True


def start_resource_tracker() -> None:
    """Start the process with which multiprocessing cleans up, shielded from SIGHUP.

    A closing terminal sends SIGHUP to all processes. Without its first tracker, multiprocessing
    starts another one, which prints a traceback for each semaphore that it does not know.
    """
    if hasattr(signal, "SIGHUP"):  # Windows has no tracker
        with _signals_blocked():
            resource_tracker.ensure_running()


def on_workers(tasks: Sequence[Task], count: int, done: Done, idle: Idle) -> None:
    """Run tasks in worker processes; rerun the tasks of a worker that died.

    Raises SchedulerError if no worker starts. Each worker imports the running script. A script that
    calls this function whenever it is imported can't have workers.
    """
    remaining = {task.number: task for task in tasks}
    deaths, is_guarded = 0, False  # once a worker has started, the script is guarded
    start_resource_tracker()
    while remaining and deaths < DEATHS:
        before = len(remaining)
        context = multiprocessing.get_context("spawn")
        started, ended = context.Event(), context.Event()
        pool = futures.ProcessPoolExecutor(count, context, _begin, (started, ended, os.getpid()))
        submit = _signals_blocked()(pool.submit)  # the first task starts the processes
        try:
            for task, future in _run_on(submit, list(remaining.values()), idle):
                done(task, future.result())
                del remaining[task.number]
        except SchedulerError:  # Python starts no process while it imports the script
            raise SchedulerError(UNGUARDED) from None
        except futures.BrokenExecutor:
            idle()  # a signal to all processes ends the sweep
            is_guarded = is_guarded or started.is_set()
            if not is_guarded:
                raise SchedulerError(UNGUARDED) from None
            deaths = 0 if len(remaining) < before else deaths + 1
        finally:  # workers that are starting need the semaphores
            ended.set()
            pool.shutdown(cancel_futures=True)
    for task in remaining.values():
        done(task, Outcome.failed(dict.fromkeys(task.numbers, LOST)))


def _check_address(address: str) -> None:
    """Reject an invalid address, or one where nothing listens."""
    try:
        url = urlsplit(address if "://" in address else f"tcp://{address}")
        host, port = url.hostname or "", url.port or 0
        if not (host and port):
            raise ValueError
    except ValueError:
        what = "is not the address of a Dask scheduler (tcp://host:8786)"
        raise SchedulerError(f"`{address}` {what}") from None
    if url.scheme in ("tcp", "tls"):
        try:
            socket.create_connection((host, port), PATIENCE).close()
        except OSError as error:
            raise SchedulerError(f"no Dask scheduler answers at {address} ({error})") from None


def _client(scheduler: Any) -> Any:
    """Return the context of a scheduler's client.

    The context closes the client unless it is the caller's client.
    """
    if hasattr(scheduler, "get_executor"):
        return nullcontext(scheduler)
    address = getattr(scheduler, "scheduler_address", scheduler)
    if not isinstance(address, str):
        message = f"scheduler is {scheduler!r}, not an address, a Dask client or a cluster"
        raise SchedulerError(message)
    try:
        import distributed
    except ImportError:
        raise SchedulerError("a scheduler needs Dask: pip install 'fecm[sweep]'") from None
    module: Any = distributed
    is_cluster = hasattr(scheduler, "get_client")
    try:
        if not is_cluster:
            _check_address(address)
        # A new client: get_client of a cluster may return the caller's.
        where = scheduler if is_cluster else address
        return module.Client(where, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError, RuntimeError, TimeoutError) as error:
        raise SchedulerError(f"no Dask scheduler answers at {address} ({error})") from None


def on_dask(tasks: Sequence[Task], scheduler: Any, done: Done, idle: Idle) -> None:
    """Run tasks on Dask, by address, client or cluster; it reruns tasks of a dead worker."""
    with _client(scheduler) as client:
        if getattr(client, "status", "running") != "running":
            raise SchedulerError(f"the Dask client is {client.status}; make a new one")
        on_executor(tasks, client.get_executor(pure=False), done, idle)


def on_executor(tasks: Sequence[Task], executor: futures.Executor, done: Done, idle: Idle) -> None:
    """Run tasks on any executor; tasks that it loses become failed cases.

    Raises SchedulerError if the executor breaks: it takes no further tasks.
    """
    broken: futures.BrokenExecutor | None = None
    try:
        for task, future in _run_on(executor.submit, tasks, idle):
            try:
                outcome = future.result()
            except futures.BrokenExecutor as error:  # tasks that are finished still follow
                broken = error
                continue
            except Exception as error:
                outcome = Outcome.failed(
                    dict.fromkeys(task.numbers, f"{LOST} ({format_exception(error)})")
                )
            done(task, outcome)
    except futures.BrokenExecutor as error:
        broken = error
    if broken is not None:
        raise SchedulerError(
            f"the executor broke ({format_exception(broken)}): a worker process died or could not "
            f"start; a script whose pool spawns processes calls fecm under {GUARD}"
        )


def address_in(file: Path) -> str:
    """Return the address in a file of ``dask scheduler --scheduler-file``.

    Raises SchedulerError if the file has no address.
    """
    try:
        return str(json.loads(read_input(file, MOST_ADDRESS))["address"])
    except (ValueError, KeyError, TypeError):
        message = f"{file} has no address; dask scheduler --scheduler-file writes such a file"
        raise SchedulerError(message) from None


class Means(NamedTuple):
    """Place where the tasks of a sweep are computed, by default this process.

    Attributes
    ----------
    workers : int or None
        Worker processes.  None: tasks begin in this process, see :func:`here_first`.
    scheduler : str, distributed.Client or cluster, optional
        Dask scheduler.
    executor : concurrent.futures.Executor, optional
        Any executor.
    """

    workers: int | None = 1
    scheduler: object = None
    executor: futures.Executor | None = None

    @property
    def is_chosen(self) -> bool:
        """Whether a scheduler or an executor is given."""
        return self.scheduler is not None or self.executor is not None

    @property
    def here(self) -> int:
        """Number of tasks that are computed at once on this machine."""
        if self.scheduler is not None:
            return 0
        return self.workers or 1 if self.executor is None else _workers_of(self.executor)


HERE = Means()


def _workers_of(executor: futures.Executor) -> int:
    """Return the number of workers of an executor on this machine; 0 if it is not known."""
    return int(getattr(executor, "_max_workers", 0))


def carry_out_plan(
    problem: Problem,
    definition: Plan,
    means: Means = HERE,
    *,
    parts: PartialResults | None = None,
    watch: Watch = SILENT,
    done: Done = lambda task, outcome: None,
    keeps_forces: bool = True,
) -> SweepResult:
    """Compute the tasks of a plan.

    Tasks that `parts` has stored are not computed again. `done` is called with each task and its
    outcome, including tasks finished earlier. Without `keeps_forces` the result has no forces,
    which `parts` has.

    Raises
    ------
    SchedulerError
        If the scheduler can't be used.
    CasesError
        If full runs show that the reduced model of the plan holds for no case.
    StoppedError
        If the watch stops the sweep.
    """
    finished = 0
    count = len(definition.cases)

    def progress() -> str:
        text = f"after {finished} of {count} cases"
        if parts is not None:
            call = "the same call" if parts.resumes else "the same call with resume=True"
            text += f"; {call} resumes this sweep"
        return text

    def idle() -> None:
        if watch.stops():
            raise StoppedError(f"stopped {progress()}")

    def keep(task: Task, outcome: Outcome) -> None:
        nonlocal finished
        if not keeps_forces:
            outcome.force = None
        finished += len(task.numbers)
        done(task, outcome)
        watch.advance(finished, count)

    most_workers = partial(_most_workers, problem, definition, streamed=not keeps_forces)
    run = partial(_outcomes, means, parts, most_workers, idle, watch)

    def run_tried(tried: Sequence[Task]) -> list[tuple[Task, Outcome]]:
        return run(tried, lambda task, outcome: None)

    whole, model, computed = definition.method.prepared(problem, definition, run_tried, watch)
    if parts is not None:
        parts.tasks = whole
    numbers = {task.number for task, _ in computed}
    for task, outcome in computed:
        keep(task, outcome)
    try:
        computed = [*computed, *run([t for t in whole if t.number not in numbers], keep)]
    except SchedulerError as error:
        if not finished:
            raise
        raise SchedulerError(f"{error}; the sweep ended {progress()}") from None
    history = definition.settings.history and keeps_forces
    outcome = merge([outcome for _, outcome in computed], history=history)
    return sweep_result(definition, outcome, model)


def _outcomes(
    means: Means,
    parts: PartialResults | None,
    most_workers: Callable[[], int],
    idle: Idle,
    watch: Watch,
    whole: Sequence[Task],
    done: Done,
) -> list[tuple[Task, Outcome]]:
    """Compute tasks, or read their stored outcomes."""
    outcomes: list[tuple[Task, Outcome]] = []
    remaining: list[Task] = []

    def keep(task: Task, outcome: Outcome, *, is_new: bool = True) -> None:
        is_lost = any(text.startswith(LOST) for text in outcome.status)
        if parts is not None and is_new and not is_lost:  # lost cases may be computed again
            parts.put(task, outcome)
        done(task, outcome)
        outcomes.append((task, outcome))

    for task in whole:
        stored = None
        try:
            stored = None if parts is None else parts.get(task)
        except DamagedPartError as error:
            watch.note(f"{error}; its cases are run again")
        if stored is None:
            remaining.append(task)
        else:
            keep(task, stored, is_new=False)
    if means.executor is not None:
        on_executor(remaining, means.executor, keep, idle)
    elif means.scheduler is not None:
        on_dask(remaining, means.scheduler, keep, idle)
    elif means.workers is None:
        here_first(remaining, most_workers, keep, idle)
    elif means.workers > 1 and len(remaining) > 1:
        on_workers(remaining, means.workers, keep, idle)
    else:
        here(remaining, keep, idle)
    return outcomes


def _most_workers(problem: Problem, definition: Plan, *, streamed: bool) -> int:
    """Return the number of worker processes for which processors and memory are free."""
    for count in range(free_processors(), 1, -1):
        with suppress(NotEnoughMemoryError):
            check_sweep_memory(problem, definition, count, streamed=streamed)
            return count
    return 1
