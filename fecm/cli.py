"""The command line: ``fecm COMMAND``.

Results go to standard output, everything else to standard error.  Exit status: 0 done, 1 the answer
is no, 2 unusable input or call, 130 and 143 after SIGINT and SIGTERM.  Heavy modules are imported
by the command that needs them.
"""

from __future__ import annotations

import contextlib
import signal
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, NoReturn

import click

from fecm.results.schema import ResultFileError
from fecm.slips import MODES, NAMES, REPORT, active_slips
from fecm.version import __version__

if TYPE_CHECKING:
    from click._termui_impl import ProgressBar

    from fecm.api import Prepared
    from fecm.deck.findings import Finding

NO, UNUSABLE, INTERRUPTED, TERMINATED = 1, 2, 130, 143

_DECK = click.Path(exists=True, dir_okay=False, path_type=Path)
_FILE = click.Path(path_type=Path)


class Refused(click.ClickException):
    """The input or the call can't be used."""

    exit_code = UNUSABLE

    def show(self, file: object = None) -> None:
        """Print the message on standard error."""
        click.echo(f"fecm: error: {self.message}", err=True)


class AnswerIsNo(Refused):
    """Everything was understood, and the answer is no."""

    exit_code = NO


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(__version__, prog_name="fecm")
def cli() -> None:
    """Impact on laminated composite plates, from the punched-card decks of NASA CR-168057."""


@cli.command()
@click.argument("deck", type=_DECK)
@click.option("-o", "--output", type=_FILE, metavar="OUT.h5",
              help="Result file.  [default: the deck's name with .h5, in this folder]")  # fmt: skip
@click.option("--mode", type=click.Choice(MODES), default=REPORT, show_default=True,
              help="Follow the report's text, or its printed program slip by slip.")  # fmt: skip
@click.option("--slip", "slips", type=click.Choice(NAMES), multiple=True, metavar="NAME",
              help=f"Add a single slip of the program to report mode; may be repeated.  Names: "
                   f"{', '.join(NAMES)}.")  # fmt: skip
@click.option("--overwrite", is_flag=True, help="Replace result files that exist.")
def run(
    deck: Path, output: Path | None, mode: str, slips: tuple[str, ...], overwrite: bool
) -> None:
    """Run every problem in DECK and write its result.

    A second problem in the deck goes to OUT-2.h5, and so on.
    """
    try:
        active = active_slips(mode, slips)
    except ValueError as error:
        raise click.UsageError(str(error)) from None
    from fecm.api import numbered, prepare

    prepared = prepare(deck, mode)
    _report(prepared)
    if prepared.has_errors:
        raise Refused(_count(prepared.findings) + "; nothing was run")
    first = output or Path(f"{deck.stem}.h5")
    paths = [numbered(first, n) for n in range(1, len(prepared.problems) + 1)]
    _check_outputs(paths, overwrite)
    for number, path in enumerate(paths):
        if number:
            click.echo()
        _run_one(prepared, number, active, path)


def _run_one(prepared: Prepared, number: int, active: frozenset[str], path: Path) -> None:
    """Run one problem of a deck into a file and say what came out."""
    from fecm.impact import DivergenceError
    from fecm.program import tally
    from fecm.results import hdf5
    from fecm.results.result import load
    from fecm.results.summary import summary
    from fecm.simulation import simulate

    problem = prepared.problems[number]
    with contextlib.ExitStack() as stack:
        sink = stack.enter_context(hdf5.writing(path))
        advance = stack.enter_context(_progress(tally(problem.program).steps))
        try:
            simulate(problem, active, sink, advance)
        except DivergenceError as diverged:
            raise AnswerIsNo(
                f"the run diverged at step {diverged.step}: {diverged.reason}; "
                f"{path} was not written"
            ) from None
    click.echo(problem.deck.title or prepared.source)
    for line in summary(load(path)):
        click.echo(f"  {line}")
    click.echo(f"  result            {path}")


@contextlib.contextmanager
def _progress(steps: int) -> Iterator[_Advance]:
    """Show a progress bar where standard error is a terminal."""
    advance = _Advance()
    if not sys.stderr.isatty():
        yield advance
        return
    with click.progressbar(length=steps, label="fecm", file=sys.stderr) as bar:
        advance.bar = bar
        yield advance
        bar.update(steps - advance.done)


class _Advance:
    """Moves a progress bar to the step that a run has reached."""

    def __init__(self) -> None:
        self.bar: ProgressBar[int] | None = None
        self.done = 0

    def __call__(self, done: int, steps: int) -> None:
        if self.bar is not None:
            self.bar.update(done - self.done)
        self.done = done


def _report(prepared: Prepared) -> None:
    """Print the findings of a deck on standard error."""
    for finding in prepared.findings:
        click.echo(finding.render(prepared.source), err=True)


def _count(findings: Sequence[Finding]) -> str:
    errors = sum(finding.severity == "error" for finding in findings)
    return f"the deck has {errors} error{'s' if errors != 1 else ''}"


def _check_outputs(paths: Sequence[Path], overwrite: bool) -> None:
    """Refuse outputs that exist or can't be written, before the first run."""
    for path in paths:
        if path.is_dir():
            raise Refused(f"{path} is a folder")
        if not path.parent.is_dir():
            raise Refused(f"{path}: there is no folder {path.parent}")
        if path.exists() and not overwrite:
            raise Refused(f"{path} exists already; --overwrite replaces it")


@cli.command()
@click.argument("result", type=_DECK)
@click.option("-d", "--directory", type=_FILE, default=Path(), metavar="DIR",
              help="Folder for the tapes.  [default: this folder]")  # fmt: skip
def tapes(result: Path, directory: Path) -> None:
    """Write tape3, tape8 and tape9 of RESULT as text, in the original program's formats."""
    from fecm.results.result import load
    from fecm.results.tapes import write_tapes

    for path in write_tapes(load(result), directory):
        click.echo(path)


def _terminated(number: int, frame: FrameType | None) -> NoReturn:
    raise SystemExit(TERMINATED)


def main(arguments: Sequence[str] | None = None, prog_name: str = "fecm") -> NoReturn:
    """Run the command line and leave with its exit status."""
    with contextlib.suppress(ValueError):  # only the main thread may do so
        signal.signal(signal.SIGTERM, _terminated)
    try:
        cli.main(arguments, prog_name=prog_name, standalone_mode=False)
    except click.ClickException as error:
        error.show()
        raise SystemExit(error.exit_code) from None
    except (KeyboardInterrupt, click.Abort):
        click.echo("fecm: interrupted", err=True)
        raise SystemExit(INTERRUPTED) from None
    except BrokenPipeError:
        sys.stderr.close()
        raise SystemExit(UNUSABLE) from None
    except (OSError, MemoryError) as error:
        click.echo(f"fecm: error: {_told(error)}", err=True)
        raise SystemExit(UNUSABLE) from None
    except ResultFileError as error:
        click.echo(f"fecm: error: {error}", err=True)
        raise SystemExit(UNUSABLE) from None
    raise SystemExit(0)


def _told(error: Exception) -> str:
    """One line about an error of the operating system."""
    if isinstance(error, MemoryError):
        return "there is not enough memory"
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename}: {error.strerror}" if error.filename else error.strerror
    return str(error)
