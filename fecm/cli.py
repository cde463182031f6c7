"""The command line: ``fecm COMMAND``.

Results go to standard output, everything else to standard error.  Exit status: 0 done, 1 the answer
is no, 2 unusable input or call, 130 and 143 after SIGINT and SIGTERM.  Heavy modules are imported
by the command that needs them.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any, NoReturn

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


_MODE = click.option(
    "--mode",
    type=click.Choice(MODES),
    default=REPORT,
    show_default=True,
    help="Follow the report's text, or its printed program slip by slip.",
)
_FORMAT = click.option(
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
@_MODE
@click.option("--slip", "slips", type=click.Choice(NAMES), multiple=True, metavar="NAME",
              help=f"Add a single slip of the program to report mode; may be repeated.  Names: "
                   f"{', '.join(NAMES)}.")  # fmt: skip
@click.option("--overwrite", is_flag=True, help="Replace result files that exist.")
@click.option("--force", is_flag=True, help="Run with a time step above the critical one.")
def run(
    deck: Path,
    output: Path | None,
    mode: str,
    slips: tuple[str, ...],
    overwrite: bool,
    force: bool,
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
    if errors := prepared.errors(force):
        raise Refused(f"{_count(errors)}; nothing was run")
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
        stack.enter_context(_signals.deferred())
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
        _signals.heed()
        if self.bar is not None:
            self.bar.update(done - self.done)
        self.done = done


def _report(prepared: Prepared) -> None:
    """Print the findings of a deck on standard error."""
    for finding in prepared.findings:
        click.echo(finding.render(prepared.source), err=True)


def _count(errors: Sequence[Finding]) -> str:
    return f"the deck has {len(errors)} error{'s' if len(errors) != 1 else ''}"


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
@click.argument("deck", type=_DECK)
@_MODE
@_FORMAT
def check(deck: Path, mode: str, form: str) -> None:
    """Read and check DECK without running it: findings, then a summary.

    With --format json, one JSON object a finding and one a problem, a line each.  Exit status 1 if
    the deck has errors.
    """
    from fecm.api import prepare
    from fecm.overview import overview

    prepared = prepare(deck, mode)
    errors = prepared.errors()
    views = [] if errors else [overview(problem) for problem in prepared.problems]
    if form == "json":
        for finding in prepared.findings:
            click.echo(json.dumps(finding.to_dict(str(deck))))
        for view in views:
            click.echo(json.dumps({"kind": "summary", **view.to_dict()}))
    else:
        for finding in prepared.findings:
            click.echo(finding.render(str(deck)))
        for view in views:
            click.echo("\n".join(view.lines()))
    if errors:
        raise AnswerIsNo(_count(errors))


@cli.command()
@click.argument("deck", type=_DECK)
@click.option("-o", "--output", type=click.Path(path_type=Path, allow_dash=True), metavar="FILE",
              help="Where to write; - is standard output.  [default: DECK itself]")  # fmt: skip
@click.option("--check", "only_check", is_flag=True,
              help="Write nothing; exit with 1 if the deck would change.")  # fmt: skip
def fmt(deck: Path, output: Path | None, only_check: bool) -> None:
    """Align the columns of DECK and put a ruler above each kind of card.

    The model, comments and blank cards stay as they are.
    """
    from fecm.deck.findings import DeckError
    from fecm.deck.formatting import format_deck
    from fecm.deck.reader import decode

    before = decode(deck.read_bytes())
    try:
        after = format_deck(before, str(deck))
    except DeckError as error:
        click.echo(str(error), err=True)
        raise Refused("the deck can't be read; nothing was written") from None
    if only_check:
        if after != before:
            raise AnswerIsNo(f"{deck} would change")
    elif str(output) == "-":
        click.echo(after, nl=False)
    else:
        _write_text(output or deck, after)


@cli.command()
@click.argument("output", type=click.Path(path_type=Path, allow_dash=True), metavar="DECK")
@click.option("--title", default="", help="Title of the deck.")
@click.option("--size", metavar="LXxLY", help="Size of the plate, as in 6x4.")
@click.option("--mesh", metavar="NXxNY", help="Elements along x and y, as in 14x10.")
@click.option("--grading", type=click.FloatRange(min=1.0), default=1.0, metavar="RATIO",
              help="Largest over smallest element; the smallest at the impact point.")  # fmt: skip
@click.option("--columns", metavar="LIST",
              help="Elements along x one by one, as in 3*0.5,8*0.375,3*0.5, instead of --size and "
                   "--mesh.")  # fmt: skip
@click.option("--rows", metavar="LIST", help="The same along y.")
@click.option("--layup", required=True, metavar="LAYUP",
              help='Layup from the struck face on, as in "[0/45/0/-45/0]2s".')  # fmt: skip
@click.option("--ply-thickness", type=float, required=True, help="Thickness of a ply.")
@click.option("--ply", metavar="RHO,NU12,E1,E2,G12,G13,G23", help="Constants of a ply.")
@click.option("--material", metavar="NAME",
              help="A named ply instead; `fecm materials` lists them.")  # fmt: skip
@click.option("--units", metavar="SYSTEM",
              help="in-lbf-s, m-N-s or mm-N-s: names the deck's units, and gives a named ply in "
                   "them.  [default for a named ply: its source's]")  # fmt: skip
@click.option("--support", type=click.Choice(["free", "simple", "clamped"]), default="free",
              show_default=True, help="Support of all edges.")  # fmt: skip
@click.option("--edge", "edges", multiple=True, metavar="EDGE=SUPPORT",
              help="Support of one edge: left, right, bottom or top; may be repeated.")  # fmt: skip
@click.option("--at", metavar="X,Y", help="Impact point.  [default: the plate's middle]")
@click.option("--velocity", type=float, required=True, help="Approach velocity.")
@click.option("--law", required=True, metavar="K,ALPHA_P,S_P,Q", help="The indentation law.")
@click.option("--duration", type=float, required=True, help="Time to run.")
@click.option("--dt", type=float, help="Time step.  [default: 0.9 of the critical one]")
@click.option("--every", type=click.IntRange(min=1),
              help="Steps between stored rows.  [default: for about 200 rows]")  # fmt: skip
@click.option("--overwrite", is_flag=True, help="Replace a deck that exists.")
def new(output: Path, overwrite: bool, **options: Any) -> None:
    """Write a ready deck from plate, layup, supports and impact; - is standard output."""
    from fecm.authoring.options import OptionError, deck_of_options
    from fecm.deck.formatting import format_deck

    if str(output) != "-":
        _check_outputs([output], overwrite)
    try:
        deck, notes = deck_of_options(**options)
    except OptionError as error:
        raise click.UsageError(str(error)) from None
    from fecm.api import prepare

    text = format_deck(deck.to_text())
    if errors := prepare(text).errors():
        for finding in errors:
            click.echo(finding.render("the new deck"), err=True)
        raise Refused("these options make no sound deck; nothing was written")
    for note in notes:
        click.echo(f"fecm: note: {note}", err=True)
    if str(output) == "-":
        click.echo(text, nl=False)
    else:
        _write_text(output, text)
        click.echo(output)


def _write_text(path: Path, text: str) -> None:
    """Write a text file whole, or leave what is there."""
    partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
    try:
        partial.write_text(text, encoding="utf-8", newline="\n")
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


@cli.command()
def materials() -> None:
    """List the named plies of `fecm new`, with their sources."""
    from fecm.authoring.materials import MATERIALS

    for material in MATERIALS.values():
        ply = material.ply
        click.echo(f"{material.name} ({material.system})")
        click.echo(
            f"  E1 {ply.e1:g}, E2 {ply.e2:g}, NU12 {ply.nu12:g}, G12 {ply.g12:g}, G13 {ply.g13:g}, "
            f"G23 {ply.g23:g}, density {ply.density:g}"
        )
        click.echo(f"  {material.source}{'; ' + material.assumed if material.assumed else ''}")


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


class _Signals:
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

    def heed(self) -> None:
        """End the program if a signal came."""
        if self._received == signal.SIGTERM:
            raise SystemExit(TERMINATED)
        if self._received:
            raise KeyboardInterrupt


_signals = _Signals()


def main(arguments: Sequence[str] | None = None, prog_name: str = "fecm") -> NoReturn:
    """Run the command line and leave with its exit status."""
    _signals.install()
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
