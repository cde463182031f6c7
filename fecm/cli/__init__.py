"""The command line: ``fecm COMMAND``.

Results go to standard output, everything else to standard error.  Exit status: 0 success, 1 a
failed check, 2 unusable input or call, 130 and 143 after SIGINT and SIGTERM.  A command's module is
imported when the command is called.
"""

from __future__ import annotations

import errno
import functools
import logging
import os
import re
import warnings
from collections.abc import Sequence
from importlib import import_module
from typing import TYPE_CHECKING, NamedTuple, NoReturn, TextIO

import click

from fecm._errors import FecmError, did_you_mean
from fecm._text import printable
from fecm._version import __version__
from fecm._watch import StoppedError
from fecm.cli import isolation, streams
from fecm.cli.common import INTERRUPTED, UNUSABLE, echo, note, with_options
from fecm.cli.interrupts import SIGNALLED, signals
from fecm.cli.terminal import add_output_options, output_options, terminal

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem


class LazyCommand(NamedTuple):
    """Command that is imported when it is called."""

    module: str  # in which it has its name
    summary: str  # its line in ``fecm --help``


# By the headings of ``fecm --help``.
GROUPED = {
    "Make a deck": {
        "new": LazyCommand("fecm.cli.new", "Write a deck from plate, layup, supports and impact."),
        "example": LazyCommand(
            "fecm.cli.example", "List the example decks and tables, or write one."
        ),
        "materials": LazyCommand(
            "fecm.cli.materials", "List the named plies of `fecm new`, or of a file."
        ),
        "fmt": LazyCommand("fecm.cli.decks", "Align the columns of decks."),
    },
    "Run it": {
        "run": LazyCommand("fecm.cli.run", "Run every problem in DECK and write its result."),
        "info": LazyCommand("fecm.cli.info", "Describe the contents of RESULT."),
        "plot": LazyCommand("fecm.cli.plot", "Draw the report's figures, or the map of a sweep."),
        "report": LazyCommand("fecm.cli.report", "Write a report page (HTML) about results."),
        "export": LazyCommand("fecm.cli.export", "Write RESULT for ParaView or a spreadsheet."),
        "tapes": LazyCommand("fecm.cli.export", "Write tape3, tape8 and tape9 as text."),
    },
    "Judge": {
        "check": LazyCommand(
            "fecm.cli.decks", "Check decks without running them, and summarise them."
        ),
        "estimate": LazyCommand(
            "fecm.cli.estimate", "Estimate an impact and its damage threshold."
        ),
        "modes": LazyCommand("fecm.cli.modes", "Find natural frequencies and modes of a plate."),
        "diff": LazyCommand("fecm.cli.diff", "Compare two results dataset by dataset."),
        "verify": LazyCommand(
            "fecm.cli.verify", "Compare fecm with closed forms and the literature."
        ),
    },
    "Many impacts": {
        "sweep": LazyCommand("fecm.cli.sweep", "Run DECK many times with varied parameters."),
        "explore": LazyCommand(
            "fecm.cli.explore", "Write a page (HTML) on which an impact follows sliders."
        ),
    },
    "Measurements": {
        "identify": LazyCommand("fecm.cli.identify", "Fit parameters to a measured contact force."),
        "locate": LazyCommand(
            "fecm.cli.locate", "Find place and force of an impact by strain gages."
        ),
        "indent": LazyCommand("fecm.cli.indent", "Indentation tests and the law of contact."),
        "rod": LazyCommand(
            "fecm.cli.rod", "The instrumented rod: pulses, filters and calibration."
        ),
        "waves": LazyCommand("fecm.cli.waves", "Waves in a laminate."),
    },
    "Help": {
        "help": LazyCommand("fecm.cli.help", "Show the help page of a command."),
        "completion": LazyCommand("fecm.cli.help", "Print the completion script of a shell."),
    },
}
COMMANDS = {name: command for commands in GROUPED.values() for name, command in commands.items()}
# Names that people type, by the command that they mean.
OTHER_NAMES = {
    "new": ("init", "create", "generate", "setup"),
    "run": ("simulate", "solve", "compute", "start"),
    "check": ("validate", "lint"),
    "info": ("show", "inspect", "describe", "summary"),
    "plot": ("draw", "figure", "view"),
    "diff": ("compare", "cmp"),
    "export": ("convert", "csv", "vtk"),
    "sweep": ("find", "search", "random", "vary"),
    "identify": ("fit", "calibrate"),
    "fmt": ("format",),
    "estimate": ("threshold", "energy"),
}


def suggestion(name: str) -> str:
    """Return the end of the message about an unknown command: the command that is probably meant.

    A name of several words, such as plot-force, means the command that is one of them.
    """
    meant = {word: command for command, words in OTHER_NAMES.items() for word in words}
    for word in re.split(r"[-_ ]", name.lower()):
        if (command := meant.get(word, word)) in COMMANDS:
            return f"; did you mean {command}?"
    return did_you_mean(name, COMMANDS)


@functools.cache
def _imported(name: str, module: str) -> click.Command:
    """Import a command, and give it the options that all commands have."""
    return add_output_options(getattr(import_module(module), f"{name}_command"))


class LazyGroup(click.Group):
    """Group that imports only the command that is called."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names of the commands, sorted."""
        return sorted(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import a command."""
        if (command := COMMANDS.get(cmd_name)) is None:
            return None
        return _imported(cmd_name, command.module)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find a command; for an unknown one, suggest the most similar name."""
        name = args[0]
        if not (name in COMMANDS or name.startswith("-") or ctx.resilient_parsing):
            ctx.fail(f"there is no command {name!r}{suggestion(name)}")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands with their summaries."""
        for title, commands in GROUPED.items():
            with formatter.section(title):
                formatter.write_dl([(name, command.summary) for name, command in commands.items()])

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """Complete the name of a command or an option."""
        from click.shell_completion import CompletionItem  # only for a shell

        names = [name for name in sorted(COMMANDS) if name.startswith(incomplete)]
        return [
            *(CompletionItem(name, help=COMMANDS[name].summary) for name in names),
            *click.Command.shell_complete(self, ctx, incomplete),
        ]


@click.group(
    cls=LazyGroup,
    epilog="\b\nTypical calls:\n  fecm example drop-weight.inp\n  fecm run drop-weight.inp",
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)
@click.version_option(__version__, prog_name="fecm")
def cli() -> None:
    """Compute what happens when something hits a laminated composite plate.

    A deck, a text file, describes plate, projectile and contact.  fecm steps both through the
    impact and gives contact force, deflection, strains, ply stresses and failure.  It also reads
    the punched-card decks of NASA CR-168057, whose program it replays.
    """


cli.params += output_options()


def main(arguments: Sequence[str] | None = None, prog_name: str = "fecm") -> NoReturn:
    """Run the command line and leave with its exit status."""
    signals.install()
    terminal.reset()
    streams.guard_streams()
    isolation.enabled = arguments is None
    warnings.showwarning = _show_warning
    os.environ["MPLBACKEND"] = "agg"  # pictures are files, whatever a notebook's environment says
    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # such as a HOME without its cache
    status = _status(arguments, prog_name)
    if (error := streams.output_error()) is not None and status not in SIGNALLED:
        status = UNUSABLE
        if error.errno != errno.EPIPE:  # a reader who has left needs no message
            echo(f"fecm: error: standard output: {error.strerror}", err=True)
    signals.ignore()
    raise SystemExit(status)


def _show_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    """Print a warning as a note, without the line of the program that warns."""
    note(message)


def _status(arguments: Sequence[str] | None, prog_name: str) -> int:
    """Run a command; return its exit status."""
    try:
        cli.main(arguments, prog_name=prog_name, standalone_mode=False)
    except SystemExit as left:
        return left.code if isinstance(left.code, int) else 0
    except click.ClickException as error:
        if isinstance(error, click.NoSuchOption) and error.possibilities:
            name = error.option_name.lstrip("-")  # click compares the dashes too
            similar = [o for o in error.possibilities if did_you_mean(name, [o.lstrip("-")])]
            error.possibilities[:] = similar
        context = error.ctx if isinstance(error, click.UsageError) else None
        if context is not None and error.message == context.get_help():
            echo(error.message, err=True)  # the name of a command is missing
        else:
            line = " ".join(error.format_message().split()).rstrip(".")
            see = "" if context is None else f"see {context.command_path} --help"
            end = f" ({see})" if line.endswith("?") else f"; {see}"
            echo(f"fecm: error: {line}{end if see else ''}", err=True)
        return error.exit_code
    except (KeyboardInterrupt, click.Abort):
        echo("fecm: interrupted", err=True)
        return INTERRUPTED
    except StoppedError as stopped:
        echo(f"fecm: {with_options(str(stopped))}", err=True)
        return 128 + signals.received
    except (FecmError, OSError, MemoryError, ImportError) as error:
        return _report(error)
    except ExceptionGroup as group:
        return max(map(_report, group.exceptions))
    return 0


def _report(error: Exception) -> int:
    """Print an error; return the exit status after it."""
    if error is not streams.output_error():
        echo(f"fecm: error: {_message(error)}", err=True)
    return error.exit_code if isinstance(error, FecmError) else UNUSABLE


def _message(error: Exception) -> str:
    """Format an error of the package, of a file or of the system in one line."""
    if isinstance(error, OSError) and error.strerror:
        name = error.filename2 or error.filename  # the target of a rename
        named = name and not isinstance(name, int)
        if isinstance(error, FileNotFoundError) and not name:  # of os.getcwd
            return "the current folder does not exist any more; change to another one"
        return printable(f"{name}: {error.strerror}" if named else error.strerror)
    if isinstance(error, FecmError):
        return printable(with_options(str(error)))
    if isinstance(error, MemoryError):
        return "there is not enough memory"
    if isinstance(error, ImportError):
        while isinstance(error.__cause__, ImportError):  # NumPy wraps the error in advice
            error = error.__cause__
        line = str(error).partition("\n")[0]
        return printable(f"a part of the program can't be loaded: {line}")
    return printable(str(error))
