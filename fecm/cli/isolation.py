"""Commands that read result files run in a child process.

HDF5 can crash on a damaged file or never return from it.  The program forks before it imports large
libraries; the child runs the command under limits, and the parent waits for it and ends with its
exit status.  A child that crashes, hangs or takes too much memory becomes one line.

Limits of the child:

- memory: three quarters of the free memory, and at most ``ROOM`` plus ``ROOM_A_BYTE`` bytes per
  byte of the files;
- one call of a library, during which no Python code runs: ``PATIENCE`` seconds plus one per
  ``SPEED`` bytes of the files; the variable FECM_PATIENCE replaces ``PATIENCE``;
- processor time of the command: ``TOTAL`` seconds plus one per ``TOTAL_SPEED`` bytes.

A timer makes the child write to a pipe while Python code runs, also while it waits for a reader of
its output; the parent measures the time without a byte.  The child is killed when its parent ends.
On systems without fork, the command reads the files in its own process.
"""

from __future__ import annotations

import atexit
import contextlib
import functools
import math
import os
import select
import signal
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from types import FrameType, SimpleNamespace
from typing import Any, NamedTuple, NoReturn, TypeVar

from fecm._files import clear_partials
from fecm._machine import available_memory, format_bytes
from fecm._text import printable
from fecm.cli.common import RefusedError, echo
from fecm.cli.interrupts import SIGNALLED, SIGNALS, signals
from fecm.cli.streams import standard_error

GB = 10**9
ROOM = 4 * GB
ROOM_A_BYTE = 50
PATIENCE = 30.0
SPEED = 5_000_000
TOTAL = 600.0
TOTAL_SPEED = 100_000
FREE_SHARE = 0.75
PR_SET_PDEATHSIG = 1  # prctl(2): signal of this process when its parent ends
WAIT = 0.1  # time between two looks at the child (s)
# Time that a child has to end after a signal, first by itself, then after it gets the signal (s).
GRACE = 0.3, 2.0

Command = TypeVar("Command", bound=Callable[..., None])


# Whether commands are isolated, which `main` turns on, and the pipe of a child.
switch = SimpleNamespace(on=False, pipe=None)


class Limits(NamedTuple):
    """Limits of a child."""

    memory: int  # bytes
    call: float  # time of one call of a library (s)
    total: float  # processor time of the command (s)


def limits_for(size: int, free: int | None) -> Limits:
    """Limits of a command that reads `size` bytes of files; `free` is the free memory, if known."""
    text = os.environ.get("FECM_PATIENCE") or str(PATIENCE)
    try:
        patience = float(text)
    except ValueError:
        patience = math.nan
    if not 0.0 < patience < 1e6:
        raise RefusedError(f"FECM_PATIENCE is `{printable(text)}`; it must be a number of seconds")
    memory = ROOM + ROOM_A_BYTE * size
    if free is not None:
        memory = min(memory, int(FREE_SHARE * free))
    return Limits(memory, patience + size / SPEED, TOTAL + size / TOTAL_SPEED)


def fork() -> None:
    """Continue in a child process; the parent waits for it and ends as it does."""
    if not (switch.on and hasattr(os, "fork")):
        return
    sys.stdout.flush()
    sys.stderr.flush()
    parent = os.getpid()
    reading, writing = os.pipe()
    if child := os.fork():
        os.close(writing)
        _wait(child, reading)
    signals.restore()  # the parent removes partial files
    os.close(reading)
    if sys.platform == "linux":  # it kills this process when its parent ends
        import ctypes

        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent:  # which may have happened since the fork
            os.kill(os.getpid(), signal.SIGKILL)
    switch.pipe = writing


def reads(*names: str) -> Callable[[Command], Command]:
    """Put limits on a command when it runs in a child process.

    The parameters of these names are the files to read: a path, or a tuple of paths.
    """

    def decorate(function: Command) -> Command:
        @functools.wraps(function)
        def command(**values: Any) -> None:
            if switch.pipe is None:
                function(**values)
                return
            import json  # 1.3 ms, only in the child

            given = (values[name] for name in names)
            files = [f for value in given for f in (value if isinstance(value, tuple) else [value])]
            limits = limits_for(sum(map(_size, files)), available_memory())
            label = printable(" or ".join(map(str, dict.fromkeys(files))))
            named = [values.get(name) for name in ("output", "directory")]  # it may write there
            own = [path for path in named if isinstance(path, Path)]
            folders = sorted({str(path) for path in (Path(), *own, *(path.parent for path in own))})
            job = {"files": label, "folders": folders, **limits._asdict()}
            os.write(switch.pipe, json.dumps(job).encode() + b"\n")
            _confine(limits, switch.pipe)
            try:
                function(**values)
            except MemoryError:
                raise RefusedError(
                    f"{label}: this takes more memory than the {format_bytes(limits.memory)} "
                    "that reading it may take"
                ) from None

        return command  # type: ignore[return-value]

    return decorate


def _size(path: Path) -> int:
    """Bytes of a file or of a folder's files; 0 if it can't be read, which is reported later."""
    try:
        files = path.iterdir() if path.is_dir() else [path]
        return sum(file.stat().st_size for file in files)
    except OSError:
        return 0


def _confine(limits: Limits, pipe: int) -> None:
    """Put the limits on this process, and take the noise of libraries from standard error."""
    import resource  # not on Windows

    def limit(what: int, most: int) -> None:
        soft, hard = resource.getrlimit(what)
        known = [bound for bound in (soft, hard, most) if bound != resource.RLIM_INFINITY]
        with contextlib.suppress(OSError, ValueError):  # macOS refuses some
            resource.setrlimit(what, (min(known), hard))

    limit(resource.RLIMIT_CORE, 0)
    limit(resource.RLIMIT_DATA, limits.memory)
    limit(resource.RLIMIT_CPU, math.ceil(limits.total))
    # Standard error is left to Python: C libraries write there when they crash.
    with contextlib.suppress(OSError, ValueError, AttributeError):
        number = sys.stderr.fileno()
        sys.stderr = standard_error(os.dup(number), sys.stderr)
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, number)
        os.close(nowhere)
    os.set_blocking(pipe, False)

    def beat(number: int, frame: FrameType | None) -> None:
        with contextlib.suppress(OSError):  # the pipe is full: the parent is stopped
            os.write(pipe, b".")

    # Python runs a handler between two of its instructions, and when a signal interrupts its own
    # reading or writing; inside a call of a library it does not.
    signal.signal(signal.SIGALRM, beat)
    every = min(1.0, limits.call / 8.0)
    signal.setitimer(signal.ITIMER_REAL, every, every)
    atexit.register(signal.setitimer, signal.ITIMER_REAL, 0.0)


def _wait(child: int, pipe: int) -> NoReturn:
    """Wait for a child and end as it does."""
    received: list[int] = []
    handlers = {n: signal.signal(n, lambda number, frame: received.append(number)) for n in SIGNALS}
    job, hangs = _watch(child, pipe, received)
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    for number, handler in handlers.items():
        signal.signal(number, handler)
    if job and (received or status < 0 or status in SIGNALLED):
        clear_partials(map(Path, job["folders"]))
    if received or -status in SIGNALS:
        received.append(-status)
        if received[0] == signal.SIGINT and status < 0:
            echo("fecm: interrupted", err=True)
        raise SystemExit(128 + received[0])
    if status >= 0:
        raise SystemExit(status)
    files = job["files"] if job else "the command"
    raise RefusedError(f"{files} can't be read: {_death(-status, job, hangs=hangs)}")


def _watch(child: int, pipe: int, received: Sequence[int]) -> tuple[dict[str, Any] | None, bool]:
    """Wait until a child closes its pipe; kill it if it hangs, or after a signal.

    Silence is counted in waits instead of seconds: a stop of both processes (Ctrl-Z) is one wait.
    The result is what the child said about its job, and whether it was killed because it hung.
    """
    import json  # 1.3 ms, only where there is a child

    job: dict[str, Any] | None = None
    start, silent, hangs = b"", 0, False
    orders: list[tuple[float, int]] = []  # when the child gets which signal
    while True:
        if received and not orders:
            orders = [(time.monotonic() + GRACE[0], received[0])]
            orders += [(orders[0][0] + GRACE[1], signal.SIGKILL)]
        if orders and time.monotonic() > orders[0][0]:
            os.kill(child, orders[0][1])
            orders = orders[1:] or [(math.inf, signal.SIGKILL)]
        if job and silent * WAIT >= job["call"] and not hangs:
            os.kill(child, signal.SIGKILL)
            hangs = True
        if not select.select([pipe], [], [], WAIT)[0]:
            silent += 1
            continue
        silent = 0
        if not (data := os.read(pipe, 4096)):
            return job, hangs
        start += b"" if job else data
        if not job and b"\n" in start:
            job = json.loads(start.partition(b"\n")[0])


def _death(number: int, job: dict[str, Any] | None, *, hangs: bool) -> str:
    """Say how a signal ended a child."""
    if hangs and job and number == signal.SIGKILL:
        return (
            f"the HDF5 library did not return within {job['call']:.3g} s, as happens with damaged "
            "files and with disks that hang (FECM_PATIENCE=SECONDS allows more)"
        )
    if number == signal.SIGXCPU:
        return f"it took more than {job['total'] if job else TOTAL:.3g} s of processor time"
    if number == signal.SIGKILL:
        return "the reading process was killed, as the system does when memory runs out"
    name = signal.Signals(number).name if number in set(signal.Signals) else f"signal {number}"
    return f"the HDF5 library crashed ({name}), as happens with damaged files"
