"""Progress of long jobs, and requests to stop them."""

from __future__ import annotations

import contextlib
import logging
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from time import monotonic

from fecm._errors import FecmError, warn

# Called with the number of steps or cases that are done, and the number of all.
Progress = Callable[[int, int], object]

LOGGER = logging.getLogger("fecm")
MINUTE = 60.0  # seconds between two lines of a log
WIDTH = 60  # of a line of progress


class StoppedError(FecmError):
    """A job was stopped before its end; the message says where."""


class Watch:
    """Receiver of progress and messages of a long job, which also asks it whether to stop.

    This base class is silent. A job calls the methods between two steps or two cases.
    """

    def advance(self, done: int, total: int) -> None:
        """Receive the number of steps or cases that are done, and their total."""

    def note(self, *texts: str) -> None:
        """Receive messages for the user."""

    def stops(self) -> bool:
        """Return whether the job should stop in good order."""
        return False


SILENT = Watch()


class CallerWatch(Watch):
    """Watch of a job that is called from Python.

    Messages are warnings. The log has a line a minute. SIGINT stops the job after the present step.

    Parameters
    ----------
    name : str
        What the log calls the job.
    progress : callable or bool, optional
        Called with the number of steps or cases that are done, and the number of all.  True shows
        them on standard error, with the seconds that are left.
    """

    def __init__(self, name: str, progress: Progress | bool | None = None) -> None:
        self._name = name
        self._progress = show_progress() if progress is True else progress or None
        self._due = once_a_minute()
        self._interrupted = False

    def advance(self, done: int, total: int) -> None:
        """Call the caller's function, and log a line a minute."""
        if self._progress is not None:
            self._progress(done, total)
        if self._due():
            LOGGER.info("%s: %d of %d done", self._name, done, total)

    def note(self, *texts: str) -> None:
        """Issue one warning."""
        warn(*texts)

    def stops(self) -> bool:
        """Return whether SIGINT came in the block of :meth:`deferring_interrupts`."""
        return self._interrupted

    @contextlib.contextmanager
    def deferring_interrupts(self) -> Iterator[None]:
        """Let the first SIGINT stop the job in good order, and the second one at once.

        The block ends in KeyboardInterrupt, which says what the job has left. Only the main thread
        gets signals. A handler of the caller stays in place.
        """
        is_main = threading.current_thread() is threading.main_thread()
        if not is_main or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
            yield
            return

        def handle(number: int, frame: object) -> None:
            self._interrupted = True
            signal.signal(signal.SIGINT, signal.default_int_handler)

        signal.signal(signal.SIGINT, handle)
        try:
            yield
        except StoppedError as stopped:
            raise KeyboardInterrupt(str(stopped)) from None
        else:
            if self._interrupted:
                raise KeyboardInterrupt(f"stopped; the result of {self._name} is complete")
        finally:
            signal.signal(signal.SIGINT, signal.default_int_handler)


def once_a_minute(clock: Callable[[], float] = monotonic) -> Callable[[], bool]:
    """Return a function that returns whether a minute has passed since it last returned True."""
    last = clock()

    def due() -> bool:
        nonlocal last
        if clock() - last < MINUTE:
            return False
        last = clock()
        return True

    return due


def show_progress(clock: Callable[[], float] = monotonic) -> Progress:
    """Return a function that shows the progress in one line on standard error.

    The line has the seconds that are left, at the average speed since the first call.
    """
    begin: float | None = None
    first = 0

    def show(done: int, total: int) -> None:
        nonlocal begin, first
        if begin is None:
            begin, first = clock(), done
        remaining = ""
        if first < done < total:
            seconds = (clock() - begin) * (total - done) / (done - first)
            remaining = f", {seconds:.0f} s left"
        end = "\n" if done >= total else ""
        sys.stderr.write(f"\r{f'fecm: {done} of {total}{remaining}':<{WIDTH}}{end}")
        sys.stderr.flush()

    return show
