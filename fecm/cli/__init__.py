"""The command line: ``fecm COMMAND``.

Results go to standard output, everything else to standard error.  Exit status: 0 done, 1 the answer
is no, 2 unusable input or call, 130 and 143 after SIGINT and SIGTERM.  Heavy modules are imported
by the command that needs them.
"""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator, Sequence
from typing import Any, NoReturn

import click

from fecm.cli import apart
from fecm.cli.common import INTERRUPTED, UNUSABLE, signals
from fecm.cli.decks import check, fmt, materials, new
from fecm.cli.diff import diff
from fecm.cli.export import export
from fecm.cli.indent import indent
from fecm.cli.info import info
from fecm.cli.plot import plot
from fecm.cli.results import tapes
from fecm.cli.rod import rod
from fecm.cli.run import run
from fecm.cli.sweep import sweep
from fecm.cli.verify import verify
from fecm.cli.waves import waves
from fecm.memory import NotEnoughMemoryError
from fecm.results.plain import printable
from fecm.results.schema import ResultFileError
from fecm.version import __version__


@contextlib.contextmanager
def _unread() -> Iterator[None]:
    """End with 2 when the reader of the output has left; click itself would answer 1."""
    try:
        yield
        sys.stdout.flush()
    except BrokenPipeError:
        # What is still buffered would be complained of when the program ends.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise SystemExit(UNUSABLE) from None


class _Program(click.Group):
    """The program."""

    def make_context(self, *arguments: Any, **extra: Any) -> click.Context:
        """Read the command line; tell the help or the version."""
        with _unread():
            return super().make_context(*arguments, **extra)

    def invoke(self, ctx: click.Context) -> Any:
        """Carry out a command."""
        with _unread():
            return super().invoke(ctx)


@click.group(
    cls=_Program, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100}
)
@click.version_option(__version__, prog_name="fecm")
def cli() -> None:
    """Impact on laminated composite plates, from the punched-card decks of NASA CR-168057."""


for _command in (
    run, check, new, fmt, materials, info, tapes, diff, export, plot, waves, indent, rod, sweep,
    verify,
):  # fmt: skip
    cli.add_command(_command)


def main(arguments: Sequence[str] | None = None, prog_name: str = "fecm") -> NoReturn:
    """Run the command line and leave with its exit status."""
    signals.install()
    apart.switch.on = arguments is None
    try:
        cli.main(arguments, prog_name=prog_name, standalone_mode=False)
    except click.ClickException as error:
        error.show()
        raise SystemExit(error.exit_code) from None
    except (KeyboardInterrupt, click.Abort):
        click.echo("fecm: interrupted", err=True)
        raise SystemExit(INTERRUPTED) from None
    except (OSError, MemoryError) as error:
        click.echo(f"fecm: error: {printable(_told(error))}", err=True)
        raise SystemExit(UNUSABLE) from None
    except ResultFileError as error:
        click.echo(f"fecm: error: {printable(str(error))}", err=True)
        raise SystemExit(UNUSABLE) from None
    raise SystemExit(0)


def _told(error: Exception) -> str:
    """One line about an error of the operating system."""
    if isinstance(error, NotEnoughMemoryError):
        return str(error)
    if isinstance(error, MemoryError):
        return "there is not enough memory"
    if isinstance(error, OSError) and error.strerror:
        name = error.filename2 or error.filename  # of a renaming its target
        return f"{name}: {error.strerror}" if name else error.strerror
    return str(error)
