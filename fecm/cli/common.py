"""Common parts of all commands: exit statuses, messages, progress and text files."""

from __future__ import annotations

import contextlib
import re
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from fecm._errors import FecmError
from fecm._files import open_for_writing
from fecm._table import Part, Summary, hanging, summary_lines
from fecm._text import jsonable, printable
from fecm._watch import MINUTE, Watch
from fecm.cli.interrupts import signals
from fecm.cli.terminal import terminal, with_colored_head

if TYPE_CHECKING:
    from fecm.deck.findings import Finding

# Exit statuses.
FAILED = 1  # a check
UNUSABLE = 2
INTERRUPTED = 130

# Options whose names messages have in backticks.
NAMED_IN_MESSAGES = (
    "build|cases|columns|correlation|deck|design|exceed|full|measure|model|modes|random|refine|"
    "samples|scheduler|seed|sensitivity|units|until|vary"
)
WIDEST_BAR, AROUND_BAR = 36, 46  # characters of a progress bar, and of its texts
LONGEST = 1000  # characters of a line of standard error
# Styles of the lines of a summary on a terminal.
STYLES: dict[Part, dict[str, Any]] = {Part.ANSWER: {"bold": True}, Part.HEADING: {"fg": "cyan"}}
DASH = Path("-")  # standard input or output


class RefusedError(FecmError):
    """The input or the call can't be used."""


class CheckFailedError(FecmError):
    """The input was understood, and the check failed."""

    exit_code = FAILED


def echo(text: object = "", *, err: bool = False, whole: bool = False, **style: Any) -> None:
    """Print lines to the terminal, with control characters escaped.

    Lines are wrapped to the width of a terminal, unless they are to stay `whole`. A line of
    standard error that is longer than LONGEST loses its middle. An error of standard output does
    not end the command; the exit status reports it. `style` has arguments of :func:`click.style`.
    """
    stream = sys.stderr if err else sys.stdout
    lines = [printable(line) for line in str(text).split("\n")]
    if err:
        lines = [_shortened(line) for line in lines]
    if not whole:
        columns = terminal.columns(stream)
        lines = [part for line in lines for part in hanging(line, columns)]
    color = terminal.uses_color(stream)
    if color and err:
        lines = [with_colored_head(line) for line in lines]
    shown = "\n".join(lines)
    with contextlib.suppress(OSError):
        click.echo(click.style(shown, **style) if color and style else shown, err=err, color=color)


def echo_summary(summary: Summary) -> None:
    """Print a summary without its notes; lines are wrapped to the width of a terminal.

    A command that writes a result file does not call it if the user wants quiet.
    """
    for line in summary_lines(summary, terminal.columns(sys.stdout)):
        echo(printable(line.text), **STYLES.get(line.part, {}))


def echo_lines(lines: Callable[[int | None], Iterable[str]]) -> None:
    """Print lines that a function gives for the width of the terminal."""
    echo("\n".join(lines(terminal.columns(sys.stdout))))


def echo_findings(findings: Iterable[Finding], source: str, *, err: bool = True) -> None:
    """Print findings of a deck; `source` is the name of its file."""
    columns = terminal.columns(sys.stderr if err else sys.stdout)
    for finding in findings:
        echo(finding.render(source, columns), err=err, whole=True)


def _shortened(line: str) -> str:
    """Return a line without its middle if it is too long; a message ends with the remedy."""
    half = LONGEST // 2
    return line if len(line) <= LONGEST else f"{line[:half]} … {line[-half:]}"


def echo_path(path: object, label: str = "") -> None:
    """Print the name of a file in one line, after a label."""
    echo(label + printable(str(path)), whole=True)


def echo_json(value: object) -> None:
    """Print a value as one line of JSON."""
    import json  # 1.3 ms, which most calls don't need

    click.echo(json.dumps(jsonable(value)))


def note(*texts: object) -> None:
    """Print notes on standard error."""
    for text in texts:
        echo(f"fecm: note: {with_options(str(text))}", err=True)


def inform(*texts: object) -> None:
    """Print notes that are no warnings, such as the name of a file that was written."""
    if not terminal.is_quiet:
        note(*texts)


def with_options(text: str) -> str:
    """Replace names of arguments in a message by the options of a command."""
    text = re.sub(r"\bthe same call (?=resumes|with \w+=True\b)", "the same command ", text)
    return re.sub(rf"`({NAMED_IN_MESSAGES})`|\b(force|overwrite|resume)=True\b", _named, text)


def _named(argument: re.Match[str]) -> str:
    """Return the option of a command for an argument of a call."""
    return f"--{argument[1] or argument[2]}"


class TerminalWatch(Watch):
    """Watch that shows progress and notes of a job on standard error; a signal stops the job.

    `advance` takes the number of new steps. Notes wait until :meth:`close`, which a command calls
    after its summary.
    """

    def __init__(self, advance: Callable[[int], object]) -> None:
        self._advance = advance
        self.done = 0
        self._notes: list[str] = []

    def advance(self, done: int, total: int) -> None:
        """Move the bar."""
        new, self.done = done - self.done, done
        self._advance(new)

    def note(self, *texts: str) -> None:
        """Keep notes."""
        self._notes += texts

    def close(self) -> None:
        """Print the waiting notes."""
        note(*self._notes)
        self._notes.clear()

    def stops(self) -> bool:
        """Return whether a signal came; the bar shows that the job continues."""
        self._advance(0)
        return bool(signals.received)


@contextlib.contextmanager
def watching(
    label: str, length: int, remark: Callable[[int], str] | None = None
) -> Iterator[TerminalWatch]:
    """Show the progress of a job; see :func:`progress`.

    `remark` takes the number of steps or cases that are done. Notes are printed after an error;
    otherwise the caller prints them.
    """
    watch = TerminalWatch(lambda steps: None)
    end = None if remark is None else lambda _: remark(watch.done)
    try:
        with progress(label, length, end) as advance:
            watch._advance = advance
            yield watch
    except BaseException:
        watch.close()
        raise


@contextlib.contextmanager
def progress(
    label: str, length: int, remark: Callable[[object], str] | None = None
) -> Iterator[Callable[[int], object]]:
    """Show a progress bar on standard error; yield the function that advances it.

    The bar ends with a remark. A single step without a remark has no bar. If standard error is not
    a terminal, a line a minute replaces the bar.
    """
    if terminal.is_quiet or (length < 2 and remark is None):
        yield lambda steps: None
        return
    if not sys.stderr.isatty():
        done = 0

        def advance(steps: int) -> None:
            nonlocal done
            done += steps

        def line(minutes: int) -> str:
            more = remark(None) if remark is not None else ""
            return f"{label}: {done} of {length} done after {minutes} min{more and ', '}{more}"

        with every_minute(line):
            yield advance
        return
    room = terminal.columns(sys.stderr) or WIDEST_BAR + AROUND_BAR
    with click.progressbar(
        length=length,
        label=label,
        file=sys.stderr,
        item_show_func=remark,
        width=max(1, min(WIDEST_BAR, room - AROUND_BAR)),
    ) as bar:
        yield bar.update


@contextlib.contextmanager
def every_minute(line: Callable[[int], str]) -> Iterator[None]:
    """Print a line for every minute that the block takes, unless standard error is a terminal.

    `line` takes the number of minutes.  A thread prints, because the block may be a single call.
    """
    if sys.stderr.isatty() or terminal.is_quiet:
        yield
        return
    ended = threading.Event()

    def tell() -> None:
        for minutes in count(1):
            if ended.wait(MINUTE):
                return
            echo(line(minutes), err=True)

    teller = threading.Thread(target=tell, daemon=True)
    with contextlib.suppress(RuntimeError):  # no more threads: the block goes on without lines
        teller.start()
    try:
        yield
    finally:
        ended.set()
        if teller.ident is not None:
            teller.join()


def write_text(path: Path, text: str, *, overwrite: bool) -> None:
    """Write a complete text file, or print it; a terminal gets control characters escaped."""
    if path != DASH:
        with open_for_writing(path, overwrite=overwrite) as file:
            file.write(text)
    elif sys.stdout.isatty():
        echo(text.removesuffix("\n"), whole=True)
    else:
        click.echo(text, nl=False)
