"""The command line: ``fecm COMMAND``.

Results go to standard output, everything else to standard error.  Exit status: 0 done, 1 the answer
is no, 2 unusable input or call, 130 and 143 after SIGINT and SIGTERM.  Heavy modules are imported
by the command that needs them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NoReturn

import click

from fecm._memory import NotEnoughMemoryError
from fecm._version import __version__
from fecm.cli import isolation, streams
from fecm.cli.common import INTERRUPTED, SIGNALLED, UNUSABLE, echo, signals
from fecm.cli.decks import check, fmt, materials, new
from fecm.cli.diff import diff
from fecm.cli.export import export, tapes
from fecm.cli.indent import indent
from fecm.cli.info import info
from fecm.cli.plot import plot
from fecm.cli.rod import rod
from fecm.cli.run import run
from fecm.cli.sweep import sweep
from fecm.cli.verify import verify
from fecm.cli.waves import waves
from fecm.results.schema import ResultFileError, printable


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
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
    streams.prepare()
    isolation.switch.on = arguments is None
    status = _status(arguments, prog_name)
    if (error := streams.failure()) is not None and status not in SIGNALLED:
        status = UNUSABLE
        if not streams.is_of_reader(error):
            echo(f"fecm: error: standard output: {error.strerror}", err=True)
    signals.ignore()
    raise SystemExit(status)


def _status(arguments: Sequence[str] | None, prog_name: str) -> int:
    """Carry out a command; its exit status."""
    try:
        cli.main(arguments, prog_name=prog_name, standalone_mode=False)
    except SystemExit as left:
        return left.code if isinstance(left.code, int) else 0
    except click.ClickException as error:
        error.show()
        return error.exit_code
    except (KeyboardInterrupt, click.Abort):
        echo("fecm: interrupted", err=True)
        return INTERRUPTED
    except (OSError, MemoryError, ImportError, ResultFileError) as error:
        if error is not streams.failure():
            echo(f"fecm: error: {_told(error)}", err=True)
        return UNUSABLE
    return 0


def _told(error: Exception) -> str:
    """One line about an error of the operating system, or of a file."""
    if isinstance(error, MemoryError) and not isinstance(error, NotEnoughMemoryError):
        return "there is not enough memory"
    if isinstance(error, OSError) and error.strerror:
        name = error.filename2 or error.filename  # of a renaming its target
        told = error.strerror if isinstance(name, int) or not name else f"{name}: {error.strerror}"
        return printable(told)
    if isinstance(error, ImportError):
        while isinstance(error.__cause__, ImportError):  # NumPy wraps the error in advice
            error = error.__cause__
        line = str(error).partition("\n")[0]
        return printable(f"a part of the program can't be loaded: {line}")
    return printable(str(error))
