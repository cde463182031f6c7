"""Signals that end the program in good order."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
from collections.abc import Iterator
from types import FrameType
from typing import Any

# Windows has no SIGHUP.
SIGNALS = tuple(n for n in signal.Signals if n.name in ("SIGINT", "SIGTERM", "SIGHUP"))
SIGNALLED = tuple(128 + number for number in SIGNALS)  # exit status after each of them


class Signals:
    """Handler that ends the program at SIGINT, SIGTERM and SIGHUP.

    A run looks for a signal between two macros and ends in good order. An exception that a handler
    raised in the middle of a run could be lost in a finaliser. A second signal ends the program at
    once.
    """

    received = 0  # number of the signal that came
    _deferred = _installed = False

    def install(self) -> None:
        """Handle the signals from now on; a SIGHUP that nohup has switched off stays off."""
        with contextlib.suppress(ValueError):  # only the main thread may do so
            for number in SIGNALS:
                ignored = signal.getsignal(number) == signal.SIG_IGN
                if number in (signal.SIGINT, signal.SIGTERM) or not ignored:
                    signal.signal(number, self._handle)
            self._installed = True
            sys.unraisablehook = self._unraisable

    def restore(self) -> None:
        """Let the signals end this process at once, as another process cleans up."""
        for number in SIGNALS if self._installed else ():
            if signal.getsignal(number) != signal.SIG_IGN:
                signal.signal(number, signal.SIG_DFL)

    def ignore(self) -> None:
        """Ignore the signals while the program ends: its exit status is known."""
        if self._installed:
            for number in SIGNALS:
                signal.signal(number, signal.SIG_IGN)

    def _handle(self, number: int, frame: FrameType | None) -> None:
        again, self.received = bool(self.received), number
        if again or not self._deferred:
            self.heed()

    def _unraisable(self, lost: Any) -> None:
        """End the program if a finaliser or a callback has swallowed the exception of a handler."""
        if not (self.received and issubclass(lost.exc_type, KeyboardInterrupt | SystemExit)):
            sys.__unraisablehook__(lost)
            return
        with contextlib.suppress(OSError, ValueError):
            if self.received == signal.SIGINT:
                sys.stderr.write("fecm: interrupted\n")
            sys.stderr.flush()
        os._exit(128 + self.received)

    @contextlib.contextmanager
    def deferred(self) -> Iterator[None]:
        """Defer signals; the block calls :meth:`heed`."""
        self._deferred = True
        try:
            yield
        finally:
            self._deferred = False
        self.heed()

    def heed(self) -> None:
        """End the program if a signal came."""
        if self.received == signal.SIGINT:
            raise KeyboardInterrupt
        if self.received:
            raise SystemExit(128 + self.received)


signals = Signals()
