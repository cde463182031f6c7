"""Exit statuses, options, output, standard streams and signals of all commands.

Nothing that happens to standard error disturbs a command.  Standard output raises its first error,
remembers it, and drops what follows: the command's exit status then says that something was not
printed.  Characters that an encoding lacks are escaped.
"""

from __future__ import annotations

import contextlib
import io
import os
import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from time import monotonic as clock
from types import FrameType
from typing import Any, TextIO

import click

from fecm._errors import FecmError
from fecm._files import beside
from fecm._json import jsonable
from fecm._text import printable
from fecm.problem.slips import MODES, REPORT

NO, UNUSABLE, INTERRUPTED = 1, 2, 130

# Signals that end a run in good order; Windows has no SIGHUP.
SIGNALS = tuple(n for n in signal.Signals if n.name in ("SIGINT", "SIGTERM", "SIGHUP"))
SIGNALLED = tuple(128 + number for number in SIGNALS)  # exit status after each of them

MINUTE = 60.0  # seconds between two lines about the progress
DASH = Path("-")  # standard input or output
DECK_PATH = click.Path(exists=True, dir_okay=False, path_type=Path)
FILE_PATH = click.Path(path_type=Path, allow_dash=True)

MODE_OPTION = click.option(
    "--mode",
    type=click.Choice(MODES),
    default=REPORT,
    show_default=True,
    help="Follow the report's text, or its printed program slip by slip.",
)
FORMAT_OPTION = click.option(
    "--format",
    "form",
    type=click.Choice(["text", "json"]),
    default="text",
    show_default=True,
    help="Text for people, or JSON for programs.",
)


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


def note(*texts: object) -> None:
    """Print notes on standard error."""
    for text in texts:
        echo(f"fecm: note: {text}", err=True)


@contextlib.contextmanager
def progress(
    label: str, length: int, remark: Callable[[object], str] | None = None
) -> Iterator[Callable[[int], object]]:
    """Show a progress bar on standard error; yield the function that advances it.

    The bar ends with a remark, and is left out for a single step without one.  If standard error is
    no terminal, a line a minute takes its place.
    """
    if length < 2 and remark is None:
        yield lambda steps: None
        return
    if not sys.stderr.isatty():
        yield _by_the_minute(label, length, remark)
        return
    with click.progressbar(
        length=length, label=label, file=sys.stderr, item_show_func=remark
    ) as bar:
        yield bar.update


def _by_the_minute(
    label: str, length: int, remark: Callable[[object], str] | None
) -> Callable[[int], object]:
    """Return a function that counts steps, and at most once a minute says how many are done."""
    done, last = 0, clock()

    def advance(steps: int) -> None:
        nonlocal done, last
        done += steps
        if clock() - last >= MINUTE:
            last = clock()
            more = remark(None) if remark is not None else ""
            echo(f"{label}: {done} of {length} done{more and ', '}{more}", err=True)

    return advance


@contextlib.contextmanager
def writing(path: Path, *, overwrite: bool) -> Iterator[TextIO]:
    """Open a text file that gets its final name when it is complete."""
    with (
        beside(path, overwrite=overwrite) as partial,
        partial.open("w", encoding="utf-8", newline="\n") as file,
    ):
        yield file


def write_text(path: Path, text: str, *, overwrite: bool) -> None:
    """Write a complete text file, or print it, on a terminal with control characters escaped."""
    if path != DASH:
        with writing(path, overwrite=overwrite) as file:
            file.write(text)
    elif sys.stdout.isatty():
        echo(text.removesuffix("\n"))
    else:
        click.echo(text, nl=False)


class _Guarded(io.FileIO):
    """A stream that remembers its first error of writing and drops what follows."""

    error: OSError | None = None

    def __init__(self, number: int, *, raises: bool) -> None:
        super().__init__(number, "w", closefd=False)
        self._raises = raises

    def write(self, data: object) -> int:
        """Write bytes; return their number."""
        view = memoryview(data)  # type: ignore[arg-type]
        if self.error is None:
            try:
                return super().write(view)
            except OSError as error:
                self.error = error
                if self._raises:
                    raise
        return view.nbytes


_guarded: list[_Guarded] = []  # the standard output, once it is guarded


def guard_streams() -> None:
    """Guard the standard streams of this process; streams that a caller has put there stay."""
    # In order, as each takes the lowest free number.  No other file may get such a number, or what
    # is printed would go there.  A write to what is open for reading fails.
    for number, flags in enumerate((os.O_RDONLY, os.O_RDONLY, os.O_WRONLY)):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, flags)
    if _is_own(sys.stdout, 1):
        _guarded[:] = [_Guarded(1, raises=True)]
        sys.stdout = _text(_guarded[0], sys.stdout)
    if _is_own(sys.stderr, 2):
        sys.stderr = standard_error(2, sys.stderr)


def standard_error(number: int, like: TextIO | None) -> TextIO:
    """A guarded text stream to an open file, in the encoding of another stream."""
    return _text(_Guarded(number, raises=False), like, line_buffering=True)


def _is_own(stream: TextIO | None, number: int) -> bool:
    """Whether a stream is the process's own, or was closed before the process began."""
    if stream is None:
        return True
    try:
        return isinstance(stream, io.TextIOWrapper) and stream.fileno() == number
    except (OSError, ValueError):
        return False


def _text(raw: _Guarded, like: TextIO | None, *, line_buffering: bool = False) -> TextIO:
    encoding = "utf-8" if like is None else like.encoding
    through = isinstance(like, io.TextIOWrapper) and (like.line_buffering or like.write_through)
    buffer = io.BufferedWriter(raw)
    lines = line_buffering or through
    return io.TextIOWrapper(buffer, encoding, "backslashreplace", line_buffering=lines)


def output_error() -> OSError | None:
    """Print what is still buffered; the first error of standard output, if there was one."""
    with contextlib.suppress(OSError, ValueError):
        sys.stdout.flush()
    return _guarded[0].error if _guarded else None


class Signals:
    """Ends the program at SIGINT, SIGTERM and SIGHUP.

    A run looks for a signal between two macros and ends in good order; an exception that a handler
    raised in the middle of it could be lost in a finaliser.  A second signal ends it at once.
    """

    received = 0  # number of the signal that came
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
        again, self.received = bool(self.received), number
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

    def heed(self) -> None:
        """End the program if a signal came."""
        if self.received == signal.SIGINT:
            raise KeyboardInterrupt
        if self.received:
            raise SystemExit(128 + self.received)


signals = Signals()
