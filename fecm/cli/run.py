"""``fecm run``."""

from __future__ import annotations

import contextlib
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click

from fecm.cli.common import (
    DECK_PATH,
    FILE_PATH,
    MODE_OPTION,
    AnswerIsNo,
    Refused,
    check_outputs,
    count_errors,
    report,
    signals,
    writing,
)
from fecm.rod_method import INTEGRATORS, LUMPED, MASSES, WILSON, RodMethod
from fecm.slips import NAMES, active_slips
from fecm.solvers import AUTO, SOLVERS

if TYPE_CHECKING:
    from click._termui_impl import ProgressBar

    from fecm.api import Prepared


@click.command()
@click.argument("deck", type=DECK_PATH)
@click.option("-o", "--output", type=FILE_PATH, metavar="OUT.h5",
              help="Result file.  [default: the deck's name with .h5, in this folder]")  # fmt: skip
@MODE_OPTION
@click.option("--slip", "slips", type=click.Choice(NAMES), multiple=True, metavar="NAME",
              help=f"Add a single slip of the program to report mode; may be repeated.  Names: "
                   f"{', '.join(NAMES)}.")  # fmt: skip
@click.option("--overwrite", is_flag=True, help="Replace result files that exist.")
@click.option(
    "--solver",
    type=click.Choice(SOLVERS),
    default=AUTO,
    show_default=True,
    help="How K u is had: by what suits the mesh, or by a sparse matrix in any case.",
)
@click.option(
    "--threads",
    type=click.IntRange(0, 1024),
    default=0,
    metavar="N",
    help="Threads that share the work of a step; 0 takes every core for a large mesh.  "
    "[default: 0]",
)
@click.option("--rod-mass", type=click.Choice(MASSES), default=LUMPED, show_default=True,
              help="The projectile's mass matrix; the report's program lumps it.")  # fmt: skip
@click.option("--rod-integrator", type=click.Choice(INTEGRATORS), default=WILSON,
              show_default=True,
              help="The projectile's integration; the report's is Wilson's.")  # fmt: skip
@click.option("--force", is_flag=True, help="Run with a time step above the critical one.")
@click.option(
    "--print",
    "printed",
    type=FILE_PATH,
    metavar="OUT.txt",
    help="Also write what the original program sent to its printer.",
)
def run(
    deck: Path,
    output: Path | None,
    mode: str,
    slips: tuple[str, ...],
    overwrite: bool,
    solver: str,
    threads: int,
    rod_mass: str,
    rod_integrator: str,
    force: bool,
    printed: Path | None,
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
    report(prepared)
    if errors := prepared.errors(force):
        raise Refused(f"{count_errors(errors)}; nothing was run")
    first = output or Path(f"{deck.stem}.h5")
    paths = [numbered(first, n) for n in range(1, len(prepared.problems) + 1)]
    prints = [None if printed is None else numbered(printed, n + 1) for n in range(len(paths))]
    check_outputs([*paths, *(path for path in prints if path is not None)], overwrite)
    method = RodMethod(rod_mass, rod_integrator)
    for number, path in enumerate(paths):
        if number:
            click.echo()
        _run_one(prepared, number, active, solver, threads, method, path, prints[number])


def _run_one(
    prepared: Prepared,
    number: int,
    active: frozenset[str],
    solver: str,
    threads: int,
    method: RodMethod,
    path: Path,
    printed: Path | None,
) -> None:
    """Run one problem of a deck into a file and say what came out."""
    from fecm.check.run import output_bytes
    from fecm.dynamics import DivergenceError
    from fecm.printout import Printer
    from fecm.program import tally
    from fecm.results import hdf5
    from fecm.results.result import load
    from fecm.results.summary import summary
    from fecm.simulation import simulate
    from fecm.statics import SingularStiffnessError

    problem = prepared.problems[number]
    _check_room(path, output_bytes(problem.deck, tally(problem.program)))
    with contextlib.ExitStack() as stack:
        stack.enter_context(signals.deferred())
        sink = stack.enter_context(hdf5.writing(path))
        printer = Printer() if printed is None else Printer(stack.enter_context(writing(printed)))
        advance = stack.enter_context(_progress(tally(problem.program).steps))
        try:
            simulation = simulate(problem, active, sink, advance, printer, solver, threads, method)
        except SingularStiffnessError as error:
            raise Refused(
                f"{error}: the plate is not held, so that it has no static displacement; restrain "
                f"it with BOUN; {path} was not written"
            ) from None
        except DivergenceError as diverged:
            raise AnswerIsNo(
                f"the run diverged at step {diverged.step}: {diverged.reason}; "
                f"{path} was not written"
            ) from None
    for note in simulation.notes:
        click.echo(f"fecm: note: {note}", err=True)
    click.echo(problem.deck.title or prepared.source)
    for line in summary(load(path)):
        click.echo(f"  {line}")
    click.echo(f"  result            {path}")
    if printed is not None:
        click.echo(f"  printed           {printed}")


def _check_room(path: Path, size: int) -> None:
    """Refuse a result that the disk has no room for."""
    free = shutil.disk_usage(path.parent).free
    if size > free:
        raise Refused(
            f"{path}: the result takes about {size / 1e6:.3g} MB, and the disk has "
            f"{free / 1e6:.3g} MB left"
        )


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
        signals.heed()
        if self.bar is not None:
            self.bar.update(done - self.done)
        self.done = done
