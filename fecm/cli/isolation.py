"""Commands that read result files are carried out in a child process.

HDF5 can fall over a damaged file, or never come back from it.  The program forks before it has
imported anything heavy; the child is the command, under limits, and the parent waits for it and
hands on its exit status.  A child that a signal ends, or that takes too much, becomes one line.

Limits of the child:

- memory: three quarters of what is free, and no more than ``ROOM`` and ``ROOM_A_BYTE`` bytes for
  each byte of the files;
- processor time of one call of a library, in which no Python is carried out: ``PATIENCE`` seconds
  and one for every ``SPEED`` bytes of the files; the variable FECM_PATIENCE puts another number in
  the place of ``PATIENCE``;
- processor time of the whole command: ``WHOLE`` seconds and one for every ``WHOLE_SPEED`` bytes;
- waiting inside of one call of a library, without any processor time: ``WAIT`` seconds, or
  ``WAIT_SHARE`` times the patience if that is longer, and one for every ``WAIT_SPEED`` bytes.

A child that runs Python sends a byte through a pipe about once a second, also while Python waits
for a reader of its output; the parent counts the time without such a byte.  A machine that is busy
or asleep does not count.  The child is killed when its parent ends.  Where the system has no fork,
the command reads the files itself.
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
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any, NoReturn, TypeVar

from fecm._children import die_with_parent
from fecm._files import clear_partials
from fecm._memory import available, format_bytes
from fecm.cli import streams
from fecm.cli.common import SIGNALLED, SIGNALS, Refused, echo
from fecm.results.schema import printable

GB = 10**9
ROOM, ROOM_A_BYTE = 4 * GB, 50
PATIENCE, SPEED = 10.0, 20_000_000
WHOLE, WHOLE_SPEED = 600.0, 100_000
WAIT, WAIT_SHARE, WAIT_SPEED = 60.0, 6.0, 1_000_000
FREE_SHARE = 0.75

# Parts of the time that a child may wait; a stop of parent and child (Ctrl-Z) spoils one of them.
PARTS = 4

# Seconds that a child is given to end after a signal, first by itself, then when told.
GRACE = 0.3, 2.0

Command = TypeVar("Command", bound=Callable[..., None])


class _Switch:
    """Whether commands are carried out apart; the program turns it on, its tests do not."""

    on = False


switch = _Switch()


@dataclass(frozen=True)
class Limits:
    """What a child may take.

    Attributes
    ----------
    memory : int
        Bytes.
    call, whole : float
        Processor time of one call of a library, and of the command (s).
    wait : float
        Time that one call of a library may wait without processor time (s).
    """

    memory: int
    call: float
    whole: float
    wait: float


def limits_for(size: int, free: int | None) -> Limits:
    """Limits of a command that reads files of this many bytes together.

    Parameters
    ----------
    size : int
    free : int or None
        Bytes of memory that are free; None where nobody knows.
    """
    memory = ROOM + ROOM_A_BYTE * size
    if free is not None:
        memory = min(memory, int(FREE_SHARE * free))
    patience = _patience()
    return Limits(
        memory,
        call=patience + size / SPEED,
        whole=WHOLE + size / WHOLE_SPEED,
        wait=max(WAIT, WAIT_SHARE * patience) + size / WAIT_SPEED,
    )


def _patience() -> float:
    text = os.environ.get("FECM_PATIENCE", "")
    try:
        seconds = float(text) if text else PATIENCE
    except ValueError:
        seconds = math.nan
    if not 0.0 < seconds < 1e6:
        raise Refused(f"FECM_PATIENCE is `{printable(text)}`; it must be a number of seconds")
    return seconds


def reads(*names: str) -> Callable[[Command], Command]:
    """Carry out a command in a child process.

    Parameters
    ----------
    *names : str
        Parameters that are the files to read: a path, or a tuple of paths.
    """

    def decorate(function: Command) -> Command:
        @functools.wraps(function)
        def command(**values: Any) -> None:
            if not (switch.on and hasattr(os, "fork")):
                function(**values)
                return
            files: list[Path] = []
            for name in names:
                value = values[name]
                files += value if isinstance(value, tuple) else [value]
            limits = limits_for(sum(map(_size, files)), available())
            told = printable(" or ".join(map(str, dict.fromkeys(files))))
            sys.stdout.flush()
            sys.stderr.flush()
            parent = os.getpid()
            beats, heart = os.pipe()
            if child := os.fork():
                os.close(heart)
                ended = _wait(child, beats, limits)
                _end_like(child, ended, told, limits, _folders(values))
            os.close(beats)
            die_with_parent(parent)
            _confine(limits, heart)
            try:
                function(**values)
            except MemoryError:
                raise Refused(
                    f"{told}: this takes more memory than the {format_bytes(limits.memory)} "
                    "that reading it may take"
                ) from None

        return command  # type: ignore[return-value]

    return decorate


def _size(path: Path) -> int:
    """Bytes of a file, or of a folder's files; 0 of what can't be read, which is told later."""
    try:
        if path.is_dir():
            return sum(member.stat().st_size for member in path.iterdir())
        return path.stat().st_size
    except OSError:
        return 0


def _folders(values: dict[str, Any]) -> set[Path]:
    """Folders that a command may write to."""
    named = [values[name] for name in ("output", "directory") if isinstance(values.get(name), Path)]
    return {Path(), *named, *(path.parent for path in named)}


# The child --------------------------------------------------------------------------------------


def _confine(limits: Limits, heart: int) -> None:
    """Put the limits on this process, and take the noise of libraries from standard error.

    The open pipe `heart` tells the parent that this process runs.
    """
    import resource

    def limit(what: int, most: int) -> None:
        soft, hard = resource.getrlimit(what)
        known = [bound for bound in (soft, hard, most) if bound != resource.RLIM_INFINITY]
        with contextlib.suppress(OSError, ValueError):  # macOS refuses some
            resource.setrlimit(what, (min(known), hard))

    limit(resource.RLIMIT_CORE, 0)
    limit(resource.RLIMIT_DATA, limits.memory)
    limit(resource.RLIMIT_CPU, math.ceil(limits.whole))
    _quieten()

    os.set_blocking(heart, False)

    def beat(number: int, frame: FrameType | None) -> None:
        signal.setitimer(signal.ITIMER_PROF, limits.call)
        with contextlib.suppress(OSError):  # the pipe is full: the parent is stopped
            os.write(heart, b".")

    # Python carries out a handler between two of its own instructions, and when a signal interrupts
    # its own reading or writing: as long as it does, the timer that would end the process is wound
    # up again.
    signal.signal(signal.SIGPROF, signal.SIG_DFL)
    signal.signal(signal.SIGALRM, beat)
    every = min(1.0, limits.call / 4.0)
    signal.setitimer(signal.ITIMER_REAL, every, every)
    signal.setitimer(signal.ITIMER_PROF, limits.call)
    atexit.register(signal.setitimer, signal.ITIMER_REAL, 0.0)


def _quieten() -> None:
    """Leave standard error to Python: C libraries write there when they fall over."""
    with contextlib.suppress(OSError, ValueError, AttributeError):
        old = sys.stderr
        own = os.dup(old.fileno())
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, old.fileno())
        os.close(nowhere)
        sys.stderr = streams.standard_error(own, old)


# The parent -------------------------------------------------------------------------------------


class _CameError(Exception):
    """A signal came while the child was waited for."""


@contextlib.contextmanager
def _noticing() -> Iterator[None]:
    """Turn signals that end the program into an exception."""

    def came(number: int, frame: FrameType | None) -> None:
        raise _CameError(number)

    old = {number: signal.signal(number, came) for number in SIGNALS}
    try:
        yield
    finally:
        for number, handler in old.items():
            signal.signal(number, handler)


def _wait(child: int, beats: int, limits: Limits) -> int | None:
    """Exit status of a child, negative for a signal, None for one that waited too long.

    Ends the child when a signal asks for that.
    """
    try:
        with _noticing():
            waited = not _watch(child, beats, limits.wait)
            if waited:
                os.kill(child, signal.SIGKILL)
            status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
            return None if waited and status == -signal.SIGKILL else status
    except _CameError as came:
        number = int(came.args[0])
        # Ctrl-C goes to the child as well, which may say so itself; a hanging one can't.
        for seconds, then in zip(GRACE, (number, signal.SIGKILL), strict=True):
            until = time.monotonic() + seconds
            while time.monotonic() < until:
                if _ended(child):
                    return 128 + number
                time.sleep(0.01)
            with contextlib.suppress(ProcessLookupError):
                os.kill(child, then)
        with contextlib.suppress(ChildProcessError):
            os.waitpid(child, 0)
        echo("fecm: interrupted", err=True)
        return 128 + number


def _watch(child: int, beats: int, wait: float) -> bool:
    """Wait for the end of a child; False if it neither beats nor computes for too long."""
    silent, before = 0, _processor_time(child)
    while silent < PARTS:
        silent += 1
        if select.select([beats], [], [], wait / PARTS)[0]:
            if not os.read(beats, 4096):
                return True
            silent = 0
        now = _processor_time(child)
        if now != before:
            silent, before = 0, now
    return False


def _processor_time(child: int) -> tuple[bytes, ...]:
    """Processor time of a child by proc(5); nothing where the system does not tell."""
    try:
        stat = Path(f"/proc/{child}/stat").read_bytes()
    except OSError:
        return ()
    return tuple(stat.rpartition(b")")[2].split()[11:13])


def _ended(child: int) -> bool:
    try:
        return os.waitpid(child, os.WNOHANG)[0] == child
    except ChildProcessError:
        return True


def _end_like(
    child: int, status: int | None, told: str, limits: Limits, folders: set[Path]
) -> NoReturn:
    """End this program as the child has ended."""
    if status is None or status < 0 or status in SIGNALLED:
        clear_partials(folders)
    if status is None:
        raise Refused(
            f"{told} can't be read: the system did not deliver it within {limits.wait:.3g} s, as "
            "happens with a disk or network that hangs (FECM_PATIENCE=SECONDS gives it longer)"
        )
    if status >= 0:
        raise SystemExit(status)
    if -status in SIGNALS:
        raise SystemExit(128 - status)
    raise Refused(f"{told} can't be read: {_death(-status, limits)}")


def _death(number: int, limits: Limits) -> str:
    """What ended a child."""
    if number == signal.SIGPROF:
        return (
            f"the HDF5 library did not come back within {limits.call:.3g} s of processor time, as "
            "happens with damaged files (FECM_PATIENCE=SECONDS gives it longer)"
        )
    if number == signal.SIGXCPU:
        return f"it took more than {limits.whole:.3g} s of processor time"
    if number == signal.SIGKILL:
        return "the reading process was killed, as the system does when memory runs out"
    name = signal.Signals(number).name if number in set(signal.Signals) else f"signal {number}"
    return f"the HDF5 library broke off ({name}), as happens with damaged files"
