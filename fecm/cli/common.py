"""What the commands share: exit status, options, files, signals."""

from __future__ import annotations

import contextlib
import signal
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, TextIO

import click

from fecm.files import beside
from fecm.results.plain import printable
from fecm.slips import MODES, REPORT

if TYPE_CHECKING:
    from fecm.api import Prepared
    from fecm.deck.findings import Finding

NO, UNUSABLE, INTERRUPTED, TERMINATED = 1, 2, 130, 143

DECK_PATH = click.Path(exists=True, dir_okay=False, path_type=Path)
FILE_PATH = click.Path(path_type=Path)


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
    help="For persons, or for programs.",
)


class Refused(click.ClickException):
    """The input or the call can't be used."""

    exit_code = UNUSABLE

    def show(self, file: object = None) -> None:
        """Print the message on standard error."""
        click.echo(f"fecm: error: {printable(self.message)}", err=True)


class AnswerIsNo(Refused):
    """Everything was understood, and the answer is no."""

    exit_code = NO


def report(prepared: Prepared) -> None:
    """Print the findings of a deck on standard error."""
    for finding in prepared.findings:
        click.echo(finding.render(prepared.source), err=True)


def count_errors(errors: Sequence[Finding]) -> str:
    """Say how many errors a deck has."""
    count = sum(error.code != "E000" for error in errors)
    more = " or more" if count < len(errors) else ""
    return f"the deck has {count} error{'s' if count != 1 else ''}{more}"


def check_outputs(paths: Sequence[Path], overwrite: bool) -> None:
    """Refuse outputs that exist or can't be written, before the first run."""
    for path in paths:
        if path.is_dir():
            raise Refused(f"{path} is a folder")
        if path.exists() and not path.is_file():
            raise Refused(f"{path} is no ordinary file")  # a device would be replaced
        if not path.parent.is_dir():
            raise Refused(f"{path}: there is no folder {path.parent}")
        if path.exists() and not overwrite:
            raise Refused(f"{path} exists already; --overwrite replaces it")


@contextlib.contextmanager
def writing(path: Path) -> Iterator[TextIO]:
    """Open a text file that gets its final name only when all went well."""
    with beside(path) as partial, partial.open("w", encoding="utf-8", newline="\n") as file:
        yield file


def write_text(path: Path, text: str) -> None:
    """Write a text file whole, or leave what is there."""
    with writing(path) as file:
        file.write(text)


class Signals:
    """Ends the program at SIGINT and SIGTERM.

    A run looks for a signal now and then and ends in good order; an exception that a handler raised
    in the middle of it could be lost in a finaliser.  A second signal ends the program at once.
    """

    def __init__(self) -> None:
        self._received = 0
        self._deferred = False

    def install(self) -> None:
        """Handle the signals from now on."""
        with contextlib.suppress(ValueError):  # only the main thread may do so
            signal.signal(signal.SIGTERM, self._handle)
            signal.signal(signal.SIGINT, self._handle)

    def _handle(self, number: int, frame: FrameType | None) -> None:
        again, self._received = bool(self._received), number
        if again or not self._deferred:
            self.heed()

    @contextlib.contextmanager
    def deferred(self) -> Iterator[None]:
        """Leave it to the block to :meth:`heed` signals."""
        self._deferred = True
        try:
            yield
        finally:
            self._deferred = False
        self.heed()

    @property
    def came(self) -> bool:
        """Whether a signal came that asks for the program's end."""
        return bool(self._received)

    @property
    def status(self) -> int:
        """Exit status of a program that a signal has ended."""
        return TERMINATED if self._received == signal.SIGTERM else INTERRUPTED

    def heed(self) -> None:
        """End the program if a signal came."""
        if self._received == signal.SIGTERM:
            raise SystemExit(self.status)
        if self._received:
            raise KeyboardInterrupt


signals = Signals()
