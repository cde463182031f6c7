"""What all commands have in common: exit statuses, messages, progress and text files."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from time import monotonic as clock

import click

from fecm._errors import FecmError
from fecm._files import writing
from fecm._json import jsonable
from fecm._text import printable

# Exit statuses.
FAILED = 1  # a check
UNUSABLE = 2
INTERRUPTED = 130

MINUTE = 60.0  # seconds between two lines about the progress
DASH = Path("-")  # standard input or output


class RefusedError(FecmError):
    """The input or the call can't be used."""


class CheckFailedError(FecmError):
    """The input was understood, and the check failed."""

    exit_code = FAILED


def echo(text: object = "", *, err: bool = False) -> None:
    """Print lines to the terminal, with control characters escaped.

    An error of standard output does not end the command; the exit status reports it.
    """
    with contextlib.suppress(OSError):
        click.echo("\n".join(map(printable, str(text).split("\n"))), err=err)


def echo_json(value: object) -> None:
    """Print a value as one line of JSON."""
    import json  # 1.3 ms, which most calls don't need

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


def write_text(path: Path, text: str, *, overwrite: bool) -> None:
    """Write a complete text file, or print it, on a terminal with control characters escaped."""
    if path != DASH:
        with writing(path, overwrite=overwrite) as file:
            file.write(text)
    elif sys.stdout.isatty():
        echo(text.removesuffix("\n"))
    else:
        click.echo(text, nl=False)
