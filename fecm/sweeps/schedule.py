"""Who runs the tasks: this process, worker processes on this machine, or a Dask cluster.

Tasks are independent and their outcome does not depend on who runs them.  Each is told of as soon
as it is done, so that an interrupted sweep has lost no more than what was under way.
"""

from __future__ import annotations

import multiprocessing
import os
import socket
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from typing import Any
from urllib.parse import urlsplit

from fecm._errors import FecmError
from fecm.sweeps.batch import run
from fecm.sweeps.outcome import Outcome
from fecm.sweeps.plan import Task

Done = Callable[[Task, Outcome], None]
# Given now and then while others work, so that a signal can be heeded.
Idle = Callable[[], None]

# Times that workers may die without a task being finished, before what is left counts as lost.
DEATHS = 3
# Seconds between two looks at what else there is.
LOOK = 0.5
# How long a scheduler may take to answer.
PATIENCE = "5s"
LOST = "the worker that ran this case died, again and again"


def lost(outcome: Outcome) -> bool:
    """Whether the worker of a task died, so that its cases may be run again."""
    return any(text.startswith(LOST) for text in outcome.status)


class SchedulerError(FecmError, RuntimeError):
    """A scheduler can't be used."""


def attempt(task: Task) -> Outcome:
    """Run a task; whatever goes wrong in it is its cases' reason."""
    try:
        return run(task)
    except Exception as error:  # a case that fails is a row, not the end of the sweep
        reason = f"{type(error).__name__}: {error}"
        return Outcome.failed(list(task.numbers), [reason] * len(task.numbers))


def run_serial(tasks: Sequence[Task], done: Done, idle: Idle) -> None:
    """Run tasks one after the other."""
    for task in tasks:
        idle()
        done(task, attempt(task))


def _end_with(parent: int) -> None:
    """End this worker process soon after the process that started it."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(LOOK)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def on_workers(tasks: Sequence[Task], count: int, done: Done, idle: Idle) -> None:
    """Run tasks in worker processes; those of a worker that died are run again."""
    left = {task.number: task for task in tasks}
    deaths = 0
    while left and deaths < DEATHS:
        before = len(left)
        pool = ProcessPoolExecutor(
            count, multiprocessing.get_context("spawn"), _end_with, (os.getpid(),)
        )
        try:
            running: dict[Future[Outcome], Task] = {
                pool.submit(attempt, task): task for task in left.values()
            }
            while running:
                idle()
                finished, _ = wait(running, timeout=LOOK, return_when=FIRST_COMPLETED)
                for future in finished:
                    task = running.pop(future)
                    done(task, future.result())
                    del left[task.number]
        except BrokenProcessPool:
            deaths = 0 if len(left) < before else deaths + 1
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
    for task in left.values():
        done(task, Outcome.failed(list(task.numbers), [LOST] * len(task.numbers)))


def _check_address(address: str) -> None:
    """Refuse an address that is none, or where nothing listens, before a client is made for it."""
    none = f"`{address}` is not the address of a Dask scheduler, as in tcp://host:8786"
    try:
        place = urlsplit(address if "://" in address else f"tcp://{address}")
        host, port = place.hostname, place.port
    except ValueError:
        raise SchedulerError(none) from None
    if not (host and port):
        raise SchedulerError(none)
    if place.scheme in ("tcp", "tls"):
        try:
            socket.create_connection((host, port), float(PATIENCE.rstrip("s"))).close()
        except OSError as error:
            raise SchedulerError(f"no Dask scheduler answers at {address} ({error})") from None


def on_dask(tasks: Sequence[Task], address: str, done: Done, idle: Idle) -> None:
    """Run tasks on a Dask cluster, which runs those of a dead worker again.

    Raises
    ------
    SchedulerError
        If dask.distributed is missing, or nothing answers at the address.
    """
    try:
        import distributed
    except ImportError:
        raise SchedulerError(
            "--scheduler needs dask.distributed: pip install 'fecm[sweep]'"
        ) from None
    _check_address(address)
    try:
        module: Any = distributed
        client = module.Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise SchedulerError(f"no Dask scheduler answers at {address} ({error})") from None
    with client:
        futures = {client.submit(attempt, task, pure=False): task for task in tasks}
        for future in module.as_completed(futures, loop=client.loop):
            idle()
            task = futures[future]
            if future.status == "finished":
                done(task, future.result())
            else:
                reason = f"{LOST} ({type(future.exception()).__name__})"
                done(task, Outcome.failed(list(task.numbers), [reason] * len(task.numbers)))
