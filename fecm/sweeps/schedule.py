"""Run tasks in this process, in worker processes on this machine, on a Dask cluster or an executor.

Tasks are independent, and their outcomes do not depend on where they run.  Each outcome is reported
as soon as it is available, so that an interrupted sweep loses only the tasks in progress.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import socket
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    Executor,
    Future,
    ProcessPoolExecutor,
    wait,
)
from contextlib import contextmanager
from pathlib import Path
from pickle import PicklingError
from typing import Any
from urllib.parse import urlsplit

from fecm._errors import FecmError
from fecm.sweeps.batch import run
from fecm.sweeps.outcome import Outcome
from fecm.sweeps.plan import Task

Done = Callable[[Task, Outcome], None]
# Called regularly while workers run, to handle signals.
Idle = Callable[[], None]

# Deaths of workers without a finished task after which the remaining tasks count as lost.
DEATHS = 3
# Polling interval in seconds.
LOOK = 0.5
# Timeout for the scheduler.
PATIENCE = "5s"
LOST = "lost with its worker"


def lost(outcome: Outcome) -> bool:
    """Whether the worker of a task died; its cases may be run again."""
    return any(text.startswith(LOST) for text in outcome.status)


class SchedulerError(FecmError, RuntimeError):
    """The scheduler cannot be used."""


def attempt(task: Task) -> Outcome:
    """Run a task; an exception becomes the status of its cases."""
    try:
        return run(task)
    except Exception as error:  # a failed case must not end the sweep
        return Outcome.failed(dict.fromkeys(task.numbers, f"{type(error).__name__}: {error}"))


def run_serial(tasks: Sequence[Task], done: Done, idle: Idle) -> None:
    """Run tasks one after the other."""
    for task in tasks:
        idle()
        done(task, attempt(task))


def _end_with(parent: int) -> None:
    """End this worker process soon after its parent process has ended."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(LOOK)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def _run_on(
    executor: Executor, tasks: Iterable[Task], idle: Idle
) -> Iterator[tuple[Task, Future[Outcome]]]:
    """Run tasks on an executor; yield them with their futures as they finish.

    Raises SchedulerError if the executor takes no tasks.
    """
    running: dict[Future[Outcome], Task] = {}
    try:
        for task in tasks:
            try:
                running[executor.submit(attempt, task)] = task
            except (RuntimeError, TypeError, PicklingError) as error:
                raise SchedulerError(f"the executor takes no tasks: {error}") from None
        while running:
            idle()
            for future in wait(running, timeout=LOOK, return_when=FIRST_COMPLETED).done:
                yield running.pop(future), future
    finally:
        for future in running:
            future.cancel()


def on_workers(tasks: Sequence[Task], count: int, done: Done, idle: Idle) -> None:
    """Run tasks in worker processes; rerun the tasks of a worker that died."""
    left = {task.number: task for task in tasks}
    deaths = 0
    while left and deaths < DEATHS:
        before = len(left)
        context = multiprocessing.get_context("spawn")
        pool = ProcessPoolExecutor(count, context, _end_with, (os.getpid(),))
        try:
            for task, future in _run_on(pool, list(left.values()), idle):
                done(task, future.result())
                del left[task.number]
        except (BrokenExecutor, SchedulerError):
            deaths = 0 if len(left) < before else deaths + 1
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
    for task in left.values():
        done(task, Outcome.failed(dict.fromkeys(task.numbers, LOST)))


def _check_address(address: str) -> None:
    """Reject an invalid address, or one where nothing listens."""
    invalid = f"`{address}` is not the address of a Dask scheduler (tcp://host:8786)"
    try:
        url = urlsplit(address if "://" in address else f"tcp://{address}")
        host, port = url.hostname, url.port
    except ValueError:
        raise SchedulerError(invalid) from None
    if not (host and port):
        raise SchedulerError(invalid)
    if url.scheme in ("tcp", "tls"):
        try:
            socket.create_connection((host, port), float(PATIENCE.rstrip("s"))).close()
        except OSError as error:
            raise SchedulerError(f"no Dask scheduler answers at {address} ({error})") from None


@contextmanager
def _client(scheduler: Any) -> Iterator[Any]:
    """Client of a scheduler, closed at the end unless it is the caller's own."""
    if hasattr(scheduler, "get_executor"):
        yield scheduler
        return
    address = getattr(scheduler, "scheduler_address", scheduler)
    if not isinstance(address, str):
        raise SchedulerError(
            f"scheduler is {scheduler!r}, not an address, a Dask client or a cluster"
        )
    try:
        import distributed
    except ImportError:
        raise SchedulerError("a scheduler needs Dask: pip install 'fecm[sweep]'") from None
    module: Any = distributed
    try:
        if hasattr(scheduler, "get_client"):
            client = scheduler.get_client()
        else:
            _check_address(address)
            client = module.Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError, RuntimeError, TimeoutError) as error:
        raise SchedulerError(f"no Dask scheduler answers at {address} ({error})") from None
    with client:
        yield client


def on_dask(tasks: Sequence[Task], scheduler: Any, done: Done, idle: Idle) -> None:
    """Run tasks on a Dask cluster, given by address, client or cluster object.

    It reruns the tasks of a dead worker.  Raises SchedulerError if dask.distributed is missing, or
    nothing answers at the address.
    """
    with _client(scheduler) as client:
        if getattr(client, "status", "running") != "running":
            raise SchedulerError(f"the Dask client is {client.status}; make a new one")
        on_executor(tasks, client.get_executor(pure=False), done, idle)


def on_executor(tasks: Sequence[Task], executor: Executor, done: Done, idle: Idle) -> None:
    """Run tasks on any executor; those that it loses become failed cases.

    Raises SchedulerError if the executor takes no tasks.
    """
    for task, future in _run_on(executor, tasks, idle):
        try:
            outcome = future.result()
        except Exception as error:
            reason = f"{LOST} ({type(error).__name__}: {' '.join(str(error).split())})"
            outcome = Outcome.failed(dict.fromkeys(task.numbers, reason))
        done(task, outcome)


def address_in(file: Path) -> str:
    """Address in the file that ``dask scheduler --scheduler-file`` writes.

    Raises SchedulerError if the file has none.  Raises OSError if it cannot be read.
    """
    try:
        return str(json.loads(file.read_bytes())["address"])
    except (ValueError, KeyError, TypeError):
        raise SchedulerError(
            f"{file} has no address; dask scheduler --scheduler-file writes such a file"
        ) from None
