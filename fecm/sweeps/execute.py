"""Carries out the tasks of a sweep: workers, partial results for a resume, expected time.

Partial results of a sweep, in a folder beside its result.

One file per task, renamed into place when complete.  It has the fingerprint of its sweep and, at
its end, a checksum that reveals damage.  Only regular files are read; the folder must not be a
link.

Run tasks in this process, in worker processes on this machine, on a Dask cluster or an executor.

Tasks are independent, and their outcomes do not depend on where they run.  Each outcome is reported
as soon as it is available, so that an interrupted sweep loses only the tasks in progress.
"""

from __future__ import annotations

import hashlib
import io
import json
import multiprocessing
import os
import pickle
import shutil
import signal
import socket
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent import futures
from contextlib import AbstractContextManager, nullcontext
from multiprocessing import resource_tracker
from multiprocessing.synchronize import Event
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit
from zipfile import ZIP_STORED

import numpy as np

from fecm._errors import FecmError
from fecm._files import OutputError, beside, held, make_folder, open_ordinary, packed
from fecm._inputs import read_input
from fecm._machine import free_processors
from fecm._typing import Array
from fecm.authoring.case import Case, CasesError
from fecm.authoring.timing import duration_of, lengthened
from fecm.authoring.values import REFINE
from fecm.problem.problem import Problem
from fecm.results.metrics import COLUMNS, GAGE, SUMMARY
from fecm.sweeps.batch import run_task
from fecm.sweeps.in_full import run_case_in_full, told
from fecm.sweeps.outcome import About, Forces, Outcome
from fecm.sweeps.plan import Plan, Task, tasks
from fecm.sweeps.search import USUAL

CHECKSUM = hashlib.sha256().digest_size  # bytes of the checksum after the arrays of a file
MOST_MARK = 1000  # bytes of the file with the fingerprint of the folder's sweep
KINDS = {
    About.STATUS: "U", About.VALIDITY: "U", About.DT: "f", About.STEPS: "iu",
    About.UNSETTLED: "iu", About.REACHED: "f",
}  # fmt: skip


class OtherSweepError(FecmError, ValueError):
    """The folder holds the outcomes of another sweep."""


class DamagedPartError(FecmError, ValueError):
    """A file of the folder is damaged, or belongs to another sweep."""


def parts_of(result: Path) -> Path:
    """Folder of the partial results of a sweep."""
    return result.with_name(f".{result.name}.parts")


def exclusive_result(result: Path) -> AbstractContextManager[None]:
    """Keep other processes from this result; raises OutputError if one computes it."""
    return held(parts_of(result), f"{result} is being computed by another process")


class PartialResults:
    """Outcomes of finished tasks of the sweep with a fingerprint, for its result file.

    `restart` deletes the outcomes of another sweep, for which OtherSweepError is raised otherwise.
    """

    def __init__(self, result: Path, fingerprint: str, *, restart: bool = False) -> None:
        self.folder = parts_of(result)
        self.tasks: Sequence[Task] = ()  # those of all cases, once they are known
        self._fingerprint = fingerprint
        make_folder(self.folder)
        mark = self.folder / "sweep.json"
        # A sweep that was killed while it began has left a folder without outcomes.
        outcomes = list(self.folder.glob("task-*"))
        if outcomes and _fingerprint_in(mark) != fingerprint:
            if not restart:
                raise OtherSweepError(
                    f"{self.folder} holds the outcomes of another sweep, or of another version of "
                    "fecm; --overwrite deletes them"
                )
            for path in outcomes:
                _remove(path)
        _remove_folder(mark)
        with beside(mark, follow=False) as partial:
            partial.write_text(json.dumps({"fingerprint": fingerprint}))

    def _path(self, task: Task) -> Path:
        return self.folder / f"task-{task.number:06d}.npz"

    def get(self, task: Task) -> Outcome | None:
        """Outcome of a finished task, None if there is none.

        Raises DamagedPartError if its file is damaged, or was not written by this sweep.
        """
        path = self._path(task)
        try:
            with open_ordinary(path) as file:
                data = file.read()
        except FileNotFoundError:
            return None
        except OutputError as error:
            raise DamagedPartError(str(error)) from None
        except OSError as error:
            raise DamagedPartError(f"{path}: {error.strerror}") from None
        packed_arrays, checksum = data[:-CHECKSUM], data[-CHECKSUM:]
        if hashlib.sha256(packed_arrays).digest() != checksum:
            raise DamagedPartError(f"{path} is damaged")
        try:
            arrays = _unpacked(packed_arrays)
        except Exception:  # a forged file raises anything in zipfile and NumPy
            raise DamagedPartError(f"{path} is damaged") from None
        if str(arrays.pop("sweep", None)) != self._fingerprint:
            raise DamagedPartError(f"{path} belongs to another sweep, or another version of fecm")
        numbers = arrays.pop("numbers", np.empty(0))
        if numbers.tolist() != list(task.numbers):
            raise DamagedPartError(f"{path} holds other cases")
        outcome = Outcome(list(task.numbers), arrays, arrays.pop("force", None))
        if not _is_sound(outcome):
            raise DamagedPartError(f"{path} does not hold the results of its cases")
        return outcome

    def put(self, task: Task, outcome: Outcome) -> None:
        """Store the outcome of a task."""
        numbers, sweep = np.array(outcome.numbers), np.array(self._fingerprint)
        arrays = {**outcome.columns, "numbers": numbers, "sweep": sweep}
        if outcome.force is not None:
            arrays["force"] = outcome.force
        data = packed(arrays)
        path = self._path(task)
        _remove_folder(path)
        with beside(path, follow=False) as partial, partial.open("wb") as file:
            file.write(data)
            file.write(hashlib.sha256(data).digest())

    def forces(self) -> Iterator[Forces]:
        """Read the contact forces of one task after the other; None if all its cases failed."""
        for task in self.tasks:
            outcome = self.get(task)
            yield task.numbers, None if outcome is None else outcome.force

    def clear(self) -> None:
        """Delete the folder."""
        shutil.rmtree(self.folder, ignore_errors=True)


def _fingerprint_in(mark: Path) -> str:
    """Fingerprint of the sweep whose outcomes a folder holds; empty if it can't be read."""
    try:
        with open_ordinary(mark) as file:
            return str(json.loads(file.read(MOST_MARK))["fingerprint"])
    except (OSError, ValueError, LookupError, TypeError, RecursionError):
        return ""


def _unpacked(data: bytes) -> dict[str, Array]:
    """Arrays of an .npz file."""
    with np.load(io.BytesIO(data), allow_pickle=False) as stored:
        if any(member.compress_type != ZIP_STORED for member in stored.zip.infolist()):
            raise ValueError("it is compressed")
        return {name: np.asarray(stored[name]) for name in stored.files}


def _is_sound(outcome: Outcome) -> bool:
    """Whether the columns of an outcome are those of a sweep, and of the right shapes and types."""
    columns, force, count = outcome.columns, outcome.force, len(outcome.numbers)
    if not columns.keys() >= {*KINDS, *SUMMARY}:
        return False
    for name, values in columns.items():
        is_gage = name.startswith(GAGE) and name.removeprefix(GAGE).isdecimal()
        kinds = KINDS.get(About(name), "") if name in KINDS else "fiu"
        known = is_gage or name in KINDS or name in COLUMNS
        if not known or values.shape != (count,) or values.dtype.kind not in kinds:
            return False
    steps = columns[About.STEPS]
    if (steps < 0).any():
        return False
    return force is None or (
        force.dtype.kind == "f"
        and force.shape[:1] == (count,)
        and force.ndim == 2
        and force.shape[1] <= steps.max(initial=0)
    )


def _remove(path: Path) -> None:
    """Remove a file, link or folder; a link is not followed."""
    _remove_folder(path)
    path.unlink(missing_ok=True)


def _remove_folder(path: Path) -> None:
    """Remove a folder that has the name of a file, for which no file can replace it."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)


Done = Callable[[Task, Outcome], None]
Idle = Callable[[], None]  # called regularly while workers run, to handle signals
DEATHS = 3  # of workers without a finished task, after which the remaining tasks count as lost
WORTH_WORKERS = 10.0  # seconds that tasks take, from which on workers are worth their start
LOOK = 0.5  # polling interval in seconds
PATIENCE = 5.0  # seconds for the scheduler to answer
LOST = "lost with its worker"
UNGUARDED = (
    "no worker process could start: each imports the script that is running; call fecm there under "
    '`if __name__ == "__main__":`'
)
MOST_ADDRESS = 100_000  # bytes of a file with the scheduler's address


class SchedulerError(FecmError, RuntimeError):
    """The scheduler cannot be used."""


def attempt(task: Task) -> Outcome:
    """Run a task; an exception becomes the status of its cases."""
    try:
        return run_task(task)
    except Exception as error:  # a failed case must not end the sweep
        return Outcome.failed(dict.fromkeys(task.numbers, f"{type(error).__name__}: {error}"))


def _begin(started: Event, parent: int) -> None:
    """Say that this worker process has started, and end it soon after its parent process."""
    started.set()

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
    """Run tasks in this process, but on workers those that take longer than workers to start.

    `most_workers` gives the largest number of workers.
    """
    begin = time.monotonic()
    for count, task in enumerate(tasks):
        left = tasks[count:]
        expected = len(left) * (time.monotonic() - begin) / max(1, count)
        worth = expected >= WORTH_WORKERS and _can_be_sent(task)
        workers = min(most_workers(), len(left)) if worth else 1
        if workers > 1:
            on_workers(left, workers, done, idle)
            return
        here([task], done, idle)


def _can_be_sent(task: Task) -> bool:
    """Whether another process can get a task, whose contact law may be any object."""
    try:
        pickle.dumps(task)
    except Exception:  # pickle raises several types
        return False
    return True


def start_resource_tracker() -> None:
    """Start the process with which multiprocessing cleans up, such that SIGHUP does not end it.

    A closing terminal sends SIGHUP to all processes.  Without its first tracker, multiprocessing
    starts another one, which prints a traceback for each semaphore that it does not know.
    """
    if not hasattr(signal, "SIGHUP"):  # Windows, which has no tracker
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGHUP})  # which a child inherits
    try:
        resource_tracker.ensure_running()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def on_workers(tasks: Sequence[Task], count: int, done: Done, idle: Idle) -> None:
    """Run tasks in worker processes; rerun the tasks of a worker that died.

    Raises SchedulerError if no worker starts.  Each worker imports the script that is running: one
    that calls this function whenever it is imported can't have workers.
    """
    left = {task.number: task for task in tasks}
    deaths = 0
    start_resource_tracker()
    while left and deaths < DEATHS:
        before = len(left)
        context = multiprocessing.get_context("spawn")
        started = context.Event()
        pool = futures.ProcessPoolExecutor(count, context, _begin, (started, os.getpid()))
        try:
            for task, future in _run_on(pool, list(left.values()), idle):
                done(task, future.result())
                del left[task.number]
        except SchedulerError:  # Python starts no process while it imports the script
            raise SchedulerError(UNGUARDED) from None
        except futures.BrokenExecutor:
            if not started.is_set():
                raise SchedulerError(UNGUARDED) from None
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
            socket.create_connection((host, port), PATIENCE).close()
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
    is_cluster = hasattr(scheduler, "get_client")
    try:
        if not is_cluster:
            _check_address(address)
        # A client of its own: get_client of a cluster may return that of the caller.
        where = scheduler if is_cluster else address
        return module.Client(where, timeout=PATIENCE, set_as_default=False)
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
        workers = free_processors() if seconds >= WORTH_WORKERS else 1
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
    run_case_in_full(0, short, made.settings.measures, law=made.settings.law)
    return time.perf_counter() - begin, short.work.steps


def _full_steps(case: Case, duration: float, steps: int) -> float:
    """Steps of a case, counted by the elements of the deck, whose duration and steps are given."""
    dt = float(case.get("dt", 0.0)) or duration / steps
    return float(case.get(REFINE, 1)) ** 2 * float(case.get("duration", duration)) / dt


def _rounded(seconds: float) -> str:
    """A duration with two digits."""
    size, unit = next(((s, u) for s, u in UNITS if seconds >= 2.0 * s), UNITS[-1])
    return f"{float(f'{seconds / size:.2g}'):g} {unit}"
