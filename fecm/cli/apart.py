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
- processor time of the whole command: ``WHOLE`` seconds and one for every ``WHOLE_SPEED`` bytes.

Waiting (a slow disk, a busy or sleeping machine) takes no processor time and does not count.  Where
the system has no fork, the command reads the files itself.
"""

from __future__ import annotations

import atexit
import contextlib
import functools
import math
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any, NoReturn, TypeVar

import click

from fecm.cli.common import INTERRUPTED, TERMINATED, Refused
from fecm.files import clear_partials_of
from fecm.memory import available, said
from fecm.results.plain import printable

GB = 10**9
ROOM, ROOM_A_BYTE = 4 * GB, 50
PATIENCE, SPEED = 10.0, 20_000_000
WHOLE, WHOLE_SPEED = 600.0, 100_000
FREE_SHARE = 0.75

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
    """

    memory: int
    call: float
    whole: float


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
    return Limits(memory, _patience() + size / SPEED, WHOLE + size / WHOLE_SPEED)


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
            if child := os.fork():
                _end_like(child, _wait(child), told, limits, _folders(values))
            _confine(limits)
            try:
                function(**values)
            except MemoryError:
                raise Refused(
                    f"{told}: this takes more memory than the {said(limits.memory)} that reading "
                    "it may take"
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


def _confine(limits: Limits) -> None:
    """Put the limits on this process, and take the noise of libraries from standard error."""
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

    def beat(number: int, frame: FrameType | None) -> None:
        signal.setitimer(signal.ITIMER_PROF, limits.call)

    # Python carries out a handler between two of its own instructions: as long as it does, the
    # timer that would end the process is wound up again.
    signal.signal(signal.SIGPROF, signal.SIG_DFL)
    signal.signal(signal.SIGALRM, beat)
    signal.siginterrupt(signal.SIGALRM, False)
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
        sys.stderr = os.fdopen(own, "w", 1, encoding=old.encoding, errors="backslashreplace")


# The parent -------------------------------------------------------------------------------------


class _CameError(Exception):
    """A signal came while the child was waited for."""


@contextlib.contextmanager
def _noticing() -> Iterator[None]:
    """Turn SIGINT and SIGTERM into an exception."""

    def came(number: int, frame: FrameType | None) -> None:
        raise _CameError(number)

    old = {number: signal.signal(number, came) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in old.items():
            signal.signal(number, handler)


def _wait(child: int) -> int:
    """Exit status of a child, negative for a signal; ends it when a signal asks for that."""
    try:
        with _noticing():
            return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
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
        click.echo("fecm: interrupted", err=True)
        return 128 + number


def _ended(child: int) -> bool:
    try:
        return os.waitpid(child, os.WNOHANG)[0] == child
    except ChildProcessError:
        return True


def _end_like(child: int, status: int, told: str, limits: Limits, folders: set[Path]) -> NoReturn:
    """End this program as the child has ended."""
    if status < 0 or status in (INTERRUPTED, TERMINATED):
        clear_partials_of(child, folders)
    if status >= 0:
        raise SystemExit(status)
    if status in (-signal.SIGINT, -signal.SIGTERM):
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
