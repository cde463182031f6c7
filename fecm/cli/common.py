"""Exit statuses, options, output and signals of all commands."""

from __future__ import annotations

import contextlib
import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType
from typing import Any, TextIO

import click

from fecm._errors import FecmError
from fecm._files import beside
from fecm.problem.slips import MODES, REPORT
from fecm.results.schema import jsonable, printable

NO, UNUSABLE, INTERRUPTED = 1, 2, 130

# Signals that end a run in good order; Windows has no SIGHUP.
SIGNALS = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
)
SIGNALLED = tuple(128 + number for number in SIGNALS)  # exit status after each of them

DECK_PATH = click.Path(exists=True, dir_okay=False, path_type=Path)
FILE_PATH = click.Path(path_type=Path)

MODE_OPTION = click.option("--mode", type=click.Choice(MODES), default=REPORT, show_default=True,
                           help="Follow the report's text, or its printed program slip by "
                                "slip.")  # fmt: skip
FORMAT_OPTION = click.option("--format", "form", type=click.Choice(["text", "json"]),
                             default="text", show_default=True,
                             help="Text for people, or JSON for programs.")  # fmt: skip


class RefusedError(FecmError):
    """The input or the call can't be used."""


class CheckFailedError(FecmError):
    """The input was understood, and the check failed."""

    exit_code = NO


def echo(text: object = "", *, err: bool = False) -> None:
    """Print lines to the terminal, with control characters escaped.

    An error of standard output does not end the command; the exit status reports it.
    """
    with contextlib.suppress(OSError):
        click.echo("\n".join(map(printable, str(text).split("\n"))), err=err)


def echo_json(value: Any) -> None:
    """Print a value as one line of JSON."""
    import json

    click.echo(json.dumps(jsonable(value)))


def note(text: object) -> None:
    """Print a note on standard error."""
    echo(f"fecm: note: {text}", err=True)


def echo_file(text: str) -> None:
    """Print a file as it is, or on a terminal with control characters escaped."""
    if sys.stdout.isatty():
        echo(text.removesuffix("\n"))
    else:
        click.echo(text, nl=False)


@contextlib.contextmanager
def progress(
    label: str, length: int, remark: Callable[[object], str] | None = None
) -> Iterator[Callable[[int], object]]:
    """Show a progress bar if standard error is a terminal; yield the function that advances it.

    The bar ends with a remark, and is left out for a single step without one.
    """
    if (length < 2 and remark is None) or not sys.stderr.isatty():
        yield lambda steps: None
        return
    with click.progressbar(
        length=length, label=label, file=sys.stderr, item_show_func=remark
    ) as bar:
        yield bar.update


@contextlib.contextmanager
def writing(path: Path, *, overwrite: bool) -> Iterator[TextIO]:
    """Open a text file that gets its final name when it is complete."""
    with (
        beside(path, overwrite=overwrite) as partial,
        partial.open("w", encoding="utf-8", newline="\n") as file,
    ):
        yield file


def write_text(path: Path, text: str, *, overwrite: bool) -> None:
    """Write a complete text file, or leave an existing one untouched."""
    with writing(path, overwrite=overwrite) as file:
        file.write(text)


class Signals:
    """Ends the program at SIGINT, SIGTERM and SIGHUP.

    A run looks for a signal between two macros and ends in good order; an exception that a handler
    raised in the middle of it could be lost in a finaliser.  A second signal ends the program at
    once.
    """

    _received = 0
    _deferred = _installed = False

    def install(self) -> None:
        """Handle the signals from now on; a SIGHUP that nohup has switched off stays so."""
        with contextlib.suppress(ValueError):  # only the main thread may do so
            for number in SIGNALS:
                ignored = signal.getsignal(number) == signal.SIG_IGN
                if number in (signal.SIGINT, signal.SIGTERM) or not ignored:
                    signal.signal(number, self._handle)
            self._installed = True

    def ignore(self) -> None:
        """Ignore the signals while the program ends: its exit status is known."""
        if self._installed:
            for number in SIGNALS:
                signal.signal(number, signal.SIG_IGN)

    def _handle(self, number: int, frame: FrameType | None) -> None:
        again, self._received = bool(self._received), number
        if again or not self._deferred:
            self.heed()

    @contextlib.contextmanager
    def deferred(self) -> Iterator[None]:
        """Defer signals; the block calls :meth:`heed`."""
        self._deferred = True
        try:
            yield
        finally:
            self._deferred = False
        self.heed()

    def came(self) -> bool:
        """Whether a signal was received."""
        return bool(self._received)

    @property
    def status(self) -> int:
        """Exit status after the signal."""
        return 128 + self._received

    def heed(self) -> None:
        """End the program if a signal came."""
        if self._received == signal.SIGINT:
            raise KeyboardInterrupt
        if self._received:
            raise SystemExit(self.status)


signals = Signals()
