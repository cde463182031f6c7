"""Isolation of commands that read results or meshes: a child process under limits.

HDF5 can crash on a damaged file or never return from it, which no exception handler catches. The
program forks. The child runs the command under the kernel's limits of memory and processor time,
and the parent ends as the child does. A child that a signal ended becomes one line. Waiting takes
no processor time and has no limit.

Only Linux has this. On macOS, libraries that NumPy has loaded may fail after a fork, and Windows
has no fork. There the command reads the files in its own process.
"""

from __future__ import annotations

import contextlib
import functools
import os
import signal
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NoReturn

from fecm._files import clear_partials
from fecm._machine import available_memory, format_bytes
from fecm._text import printable
from fecm.cli.common import RefusedError
from fecm.cli.interrupts import SIGNALS, signals
from fecm.cli.streams import standard_error

ROOM = 4 * 10**9  # memory, and more for each byte of the files
ROOM_A_BYTE = 50
FREE_SHARE = 0.75  # of the free memory, at most
PATIENCE = 120.0  # processor time for each file (s), unless FECM_PATIENCE says otherwise
SPEED = 100_000  # bytes of the files for each further second
PR_SET_PDEATHSIG = 1  # prctl(2): signal that a process gets when its parent ends

Command = Callable[..., None]

enabled = False  # `main` turns it on for a process of its own


def limits_for(sizes: list[int], free: int | None) -> tuple[int, float]:
    """Return memory (bytes) and processor time (s) of a command that reads files of these sizes.

    `free` is the free memory, if known.
    """
    text = os.environ.get("FECM_PATIENCE") or str(PATIENCE)
    try:
        patience = float(text)
    except ValueError:
        patience = 0.0
    if not 0.0 < patience < 1e6:
        raise RefusedError(f"FECM_PATIENCE is `{printable(text)}`; it must be a number of seconds")
    memory = ROOM + ROOM_A_BYTE * sum(sizes)
    if free is not None:
        memory = min(memory, int(FREE_SHARE * free))
    return memory, patience * len(sizes) + sum(sizes) / SPEED


def reads(*names: str) -> Callable[[Command], Command]:
    """Run a command in a child process.

    `names` are the parameters with the files to read: a path, or a tuple of paths. Without a path
    the command runs in this process.
    """

    def decorate(function: Command) -> Command:
        @functools.wraps(function)
        def command(**values: Any) -> None:
            inputs = (values[name] for name in names)
            given = [
                f for value in inputs for f in (value if isinstance(value, tuple) else [value])
            ]
            files = [file for file in given if isinstance(file, Path)]
            if not (files and enabled and sys.platform == "linux"):
                function(**values)
                return
            memory, seconds = limits_for(list(map(_size, files)), available_memory())
            label = printable(" or ".join(map(str, dict.fromkeys(files))))
            sys.stdout.flush()
            sys.stderr.flush()
            if child := os.fork():
                written = [values.get(name) for name in ("output", "directory")]
                paths = [path for path in written if isinstance(path, Path)]
                _wait(child, label, seconds, {Path(), *paths, *(path.parent for path in paths)})
            _confine(memory, seconds)
            try:
                function(**values)
            except MemoryError:
                most = format_bytes(memory)
                message = (
                    f"{label}: this takes more memory than the {most} that reading it may take"
                )
                raise RefusedError(message) from None

        return command

    return decorate


def _size(path: Path) -> int:
    """Return the bytes of a file or of a folder's files; 0 if they can't be read."""
    with contextlib.suppress(OSError):
        return sum(file.stat().st_size for file in (path.iterdir() if path.is_dir() else [path]))
    return 0


def _confine(memory: int, seconds: float) -> None:
    """Limit this process, and silence the messages of libraries on standard error."""
    import ctypes
    import resource  # not on Windows

    signals.restore()  # the parent clears up
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    for what, most in ((resource.RLIMIT_CORE, 0), (resource.RLIMIT_DATA, memory)):
        soft, hard = resource.getrlimit(what)
        resource.setrlimit(
            what, (most if soft == resource.RLIM_INFINITY else min(soft, most), hard)
        )
    signal.setitimer(signal.ITIMER_PROF, seconds)  # SIGPROF ends the process, also inside HDF5
    # C libraries write to the file descriptor when they crash; Python gets one of its own.
    sys.stderr = standard_error(os.dup(2), sys.stderr)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)


def _wait(child: int, label: str, seconds: float, folders: Iterable[Path]) -> NoReturn:
    """Wait for a child and end as it does.

    After a signal, the partial files in these folders are removed.
    """
    status = -1
    try:
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    except BaseException:  # a signal to this process
        with contextlib.suppress(OSError):  # the child has ended
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
        raise
    finally:
        if status < 0:
            clear_partials(folders)
    if status >= 0:
        raise SystemExit(status)
    if -status in SIGNALS:
        signal.raise_signal(-status)
    reason = {
        -signal.SIGPROF: f"it takes more than {seconds:.3g} s of processor time, as happens with "
        "damaged files (FECM_PATIENCE=SECONDS allows more)",
        -signal.SIGKILL: "the reading process was killed, as the system does when memory runs out",
    }.get(
        status,
        f"a library crashed ({signal.Signals(-status).name}), as happens with damaged files",
    )
    raise RefusedError(f"{label} can't be read: {reason}")
