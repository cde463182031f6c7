"""Run tasks in this process, in worker processes on this machine, on a Dask cluster or an executor.

Tasks are independent, and their outcomes do not depend on where they run.  Each outcome is reported
as soon as it is available, so that an interrupted sweep loses only the tasks in progress.

Partial results are in a folder beside the result: one file per task, renamed into place when
complete, with a checksum at its end that reveals damage.
"""

from __future__ import annotations

import hashlib
import io
import json
import multiprocessing
import os
import shutil
import socket
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent import futures
from contextlib import AbstractContextManager, nullcontext, suppress
from pathlib import Path
from pickle import PicklingError
from typing import Any
from urllib.parse import urlsplit

import numpy as np

from fecm._errors import FecmError
from fecm._files import beside, held, packed
from fecm._inputs import read_input
from fecm.sweeps.batch import run, told
from fecm.sweeps.plan import Forces, Outcome, Task

Done = Callable[[Task, Outcome], None]
Idle = Callable[[], None]  # called regularly while workers run, to handle signals
DEATHS = 3  # of workers without a finished task, after which the remaining tasks count as lost
LOOK = 0.5  # polling interval in seconds
PATIENCE = "5s"  # timeout for the scheduler
LOST = "lost with its worker"
MOST_ADDRESS = 100_000  # bytes of a file with the scheduler's address
CHECKSUM = hashlib.sha256().digest_size  # bytes of the checksum after the arrays of a file


class SchedulerError(FecmError, RuntimeError):
    """The scheduler cannot be used."""


def attempt(task: Task) -> Outcome:
    """Run a task; an exception becomes the status of its cases."""
    try:
        return run(task)
    except Exception as error:  # a failed case must not end the sweep
        return Outcome.failed(dict.fromkeys(task.numbers, f"{type(error).__name__}: {error}"))


def _end_with(parent: int) -> None:
    """End this worker process soon after its parent process has ended."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(LOOK)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def _run_on(
    executor: futures.Executor, tasks: Iterable[Task], idle: Idle
) -> Iterator[tuple[Task, futures.Future[Outcome]]]:
    """Yield tasks and futures as an executor finishes them; SchedulerError if it takes no tasks."""
    running: dict[futures.Future[Outcome], Task] = {}
    try:
        for task in tasks:
            try:
                running[executor.submit(attempt, task)] = task
            except (RuntimeError, TypeError, PicklingError) as error:
                raise SchedulerError(f"the executor takes no tasks: {error}") from None
        while running:
            idle()
            for future in futures.wait(running, LOOK, futures.FIRST_COMPLETED).done:
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
        pool = futures.ProcessPoolExecutor(count, context, _end_with, (os.getpid(),))
        try:
            for task, future in _run_on(pool, list(left.values()), idle):
                done(task, future.result())
                del left[task.number]
        except (futures.BrokenExecutor, SchedulerError):
            deaths = 0 if len(left) < before else deaths + 1
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
    for task in left.values():
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
            socket.create_connection((host, port), float(PATIENCE.rstrip("s"))).close()
        except OSError as error:
            raise SchedulerError(f"no Dask scheduler answers at {address} ({error})") from None


def _client(scheduler: Any) -> Any:
    """Context of a scheduler's client, which it closes unless that is the caller's own."""
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
    try:
        if hasattr(scheduler, "get_client"):
            return scheduler.get_client()
        _check_address(address)
        return module.Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError, RuntimeError, TimeoutError) as error:
        raise SchedulerError(f"no Dask scheduler answers at {address} ({error})") from None


def on_dask(tasks: Sequence[Task], scheduler: Any, done: Done, idle: Idle) -> None:
    """Run tasks on Dask, by address, client or cluster; it reruns those of a dead worker."""
    with _client(scheduler) as client:
        if getattr(client, "status", "running") != "running":
            raise SchedulerError(f"the Dask client is {client.status}; make a new one")
        on_executor(tasks, client.get_executor(pure=False), done, idle)


def on_executor(tasks: Sequence[Task], executor: futures.Executor, done: Done, idle: Idle) -> None:
    """Run tasks on any executor; those that it loses become failed cases."""
    for task, future in _run_on(executor, tasks, idle):
        try:
            outcome = future.result()
        except Exception as error:
            outcome = Outcome.failed(dict.fromkeys(task.numbers, f"{LOST} ({told(error)})"))
        done(task, outcome)


def address_in(file: Path) -> str:
    """Address in a file of ``dask scheduler --scheduler-file``; SchedulerError if it has none."""
    try:
        return str(json.loads(read_input(file, MOST_ADDRESS))["address"])
    except (ValueError, KeyError, TypeError):
        message = f"{file} has no address; dask scheduler --scheduler-file writes such a file"
        raise SchedulerError(message) from None


class OtherSweepError(FecmError, ValueError):
    """The folder holds the outcomes of another sweep."""


class DamagedPartError(FecmError, ValueError):
    """A file of the folder is damaged."""


def parts_of(result: Path) -> Path:
    """Folder of the partial results of a sweep."""
    return result.with_name(f".{result.name}.parts")


def alone(result: Path) -> AbstractContextManager[None]:
    """Keep other processes from this result; raises OutputError if one computes it."""
    return held(parts_of(result), f"{result} is being computed by another process")


class PartialResults:
    """Outcomes of finished tasks of the sweep with a fingerprint, for its result file.

    `restart` deletes the outcomes of another sweep, for which OtherSweepError is raised otherwise.
    """

    def __init__(self, result: Path, fingerprint: str, *, restart: bool = False) -> None:
        self.folder = parts_of(result)
        self.folder.mkdir(exist_ok=True)
        mark, found = self.folder / "sweep.json", ""
        with suppress(OSError, ValueError, KeyError, TypeError):
            found = str(json.loads(mark.read_text())["fingerprint"])
        # A sweep that was killed while it began has left a folder without outcomes.
        outcomes = list(self.folder.glob("task-*"))
        if outcomes and found != fingerprint:
            if not restart:
                text = "holds the outcomes of another sweep; --overwrite deletes them"
                raise OtherSweepError(f"{self.folder} {text}")
            for path in outcomes:
                path.unlink()
        with beside(mark) as partial:
            partial.write_text(json.dumps({"fingerprint": fingerprint}))

    def _path(self, task: Task) -> Path:
        return self.folder / f"task-{task.number:06d}.npz"

    def get(self, task: Task) -> Outcome | None:
        """Outcome of a finished task, None if there is none; DamagedPartError if it is damaged."""
        path = self._path(task)
        try:
            data = path.read_bytes()
        except FileNotFoundError:
            return None
        except OSError as error:
            raise DamagedPartError(f"{path}: {error.strerror}") from None
        packed_arrays, checksum = data[:-CHECKSUM], data[-CHECKSUM:]
        if hashlib.sha256(packed_arrays).digest() != checksum:
            raise DamagedPartError(f"{path} is damaged")
        with np.load(io.BytesIO(packed_arrays), allow_pickle=False) as arrays:
            if arrays["numbers"].tolist() != list(task.numbers):
                raise DamagedPartError(f"{path} holds other cases")
            columns = dict(arrays)
        return Outcome(columns.pop("numbers").tolist(), columns, columns.pop("force", None))

    def put(self, task: Task, outcome: Outcome) -> None:
        """Store the outcome of a task."""
        arrays = {**outcome.columns, "numbers": np.array(outcome.numbers)}
        if outcome.force is not None:
            arrays["force"] = outcome.force
        data = packed(arrays)
        with beside(self._path(task)) as partial, partial.open("wb") as file:
            file.write(data)
            file.write(hashlib.sha256(data).digest())

    def forces(self, tasks: Sequence[Task]) -> Iterator[Forces]:
        """Read the contact forces of one task after the other; None if all its cases failed."""
        for task in tasks:
            outcome = self.get(task)
            yield task.numbers, None if outcome is None else outcome.force

    def clear(self) -> None:
        """Delete the folder."""
        shutil.rmtree(self.folder, ignore_errors=True)
