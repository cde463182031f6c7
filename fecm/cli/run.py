"""``fecm run``."""

from __future__ import annotations

import contextlib
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click

from fecm.choices import ENERGY_LIMIT, Choices
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
from fecm.cli.numbers import POSITIVE, Finite
from fecm.files import clear_stale
from fecm.memory import said
from fecm.rod_method import INTEGRATORS, LUMPED, MASSES, WILSON, RodMethod
from fecm.slips import NAMES, active_slips
from fecm.solvers import AUTO, SOLVERS

if TYPE_CHECKING:
    from click._termui_impl import ProgressBar

    from fecm.check import Checked
    from fecm.checkpoint import Checkpointer
    from fecm.simulation import Simulation


@click.command()
@click.argument("deck", type=DECK_PATH)
@click.option("-o", "--output", type=FILE_PATH, metavar="OUT.h5",
              help="Result file.  [default: the deck's name with .h5, in this folder]")  # fmt: skip
@MODE_OPTION
@click.option("--slip", "slips", type=click.Choice(NAMES), multiple=True, metavar="NAME",
              help=f"Add a single slip of the program to report mode; may be repeated.  Names: "
                   f"{', '.join(NAMES)}.")  # fmt: skip
@click.option(
    "--overwrite",
    is_flag=True,
    help="Replace result files that exist, and what interrupted runs have left.",
)
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
@click.option("--checkpoint", "every", type=Finite(min=0.0), metavar="SECONDS",
              help="Keep a checkpoint beside the output, written every so often.")  # fmt: skip
@click.option("--resume", is_flag=True,
              help="Go on from the checkpoint that an interrupted run has left.")  # fmt: skip
@click.option("--energy-limit", type=POSITIVE, default=ENERGY_LIMIT,
              show_default=True, metavar="PART",
              help="Error of the energy balance, as a part of what was given, that ends a run "
                   "without slips.")  # fmt: skip
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
    force: bool,
    printed: Path | None,
    resume: bool,
    rod_mass: str,
    rod_integrator: str,
    solver: str,
    threads: int,
    every: float | None,
    energy_limit: float,
) -> None:
    """Run every problem in DECK and write its result.

    A second problem in the deck goes to OUT-2.h5, and so on.  An interrupted run leaves a
    checkpoint beside its output; --resume with the same options goes on from it, to the same bytes.
    """
    try:
        active = active_slips(mode, slips)
    except ValueError as error:
        raise click.UsageError(str(error)) from None
    from fecm.api import numbered, prepare
    from fecm.checkpoint import checkpoint_of

    prepared = prepare(deck, mode)
    report(prepared)
    if errors := prepared.errors(force):
        raise Refused(f"{count_errors(errors)}; nothing was run")
    first = output or Path(f"{deck.stem}.h5")
    paths = [numbered(first, n) for n in range(1, len(prepared.problems) + 1)]
    prints = [None if printed is None else numbered(printed, n + 1) for n in range(len(paths))]
    check_outputs([p for p in (*paths, *prints) if p is not None], overwrite=True)
    left = next((n for n, path in enumerate(paths) if checkpoint_of(path).exists()), None)
    if resume and left is None:
        raise Refused(f"there is no checkpoint {checkpoint_of(paths[0])} to go on from")
    if left is not None and not (resume or overwrite):
        raise Refused(
            f"{checkpoint_of(paths[left])} is what an interrupted run has left: --resume goes on "
            "from it, --overwrite begins anew"
        )
    # The interrupted run had got this far; what stands beyond is not its own.
    own = left + 1 if resume and left is not None else 0
    check_outputs([p for p in (*paths[own:], *prints[own:]) if p is not None], overwrite)
    choices = Choices(
        active, solver, threads, RodMethod(rod_mass, rod_integrator), energy_limit
    )  # fmt: skip
    for number, path in enumerate(paths):
        if number:
            click.echo()
        if number < own - 1 and path.exists():
            click.echo(f"fecm: note: {path} is whole already", err=True)
            continue
        _run_one(prepared.problems[number], path, prints[number], choices, every,
                 resumes=number == own - 1)  # fmt: skip


def _run_one(
    problem: Checked,
    path: Path,
    printed: Path | None,
    choices: Choices,
    every: float | None,
    *,
    resumes: bool,
) -> None:
    """Run one problem of a deck into a file and say what came out."""
    from fecm.check.memory import check_memory
    from fecm.check.run import output_bytes
    from fecm.checkpoint import Checkpointer, checkpoint_of
    from fecm.printout import Printer
    from fecm.program import estimate
    from fecm.results import file_writer
    from fecm.results.journal import Journal
    from fecm.results.result import load
    from fecm.results.summary import OPEN_END, summary
    from fecm.simulation import Simulation

    sizes = estimate(problem.program)
    _check_room(path, output_bytes(problem.deck, sizes))
    check_memory(problem, solver=choices.solver)
    clear_stale(path, checkpoint_of(path), *([] if printed is None else [printed]))
    with contextlib.ExitStack() as stack:
        stack.enter_context(signals.deferred())
        stack.enter_context(_ends(path))
        journal = Journal(stack.enter_context(file_writer.writing(path)), muted=resumes)
        checkpointer = Checkpointer(path, journal)
        printer = Printer() if printed is None else Printer(stack.enter_context(writing(printed)))
        advance = stack.enter_context(_progress(sizes.steps))
        simulation = Simulation(
            problem, journal, choices, advance, printer, _Look(checkpointer, every)
        )
        if resumes:
            checkpointer.restore(simulation)
            step = simulation.plate.step
            click.echo(f"fecm: note: {path} goes on behind step {step}", err=True)
        simulation.run()
    checkpointer.clear()
    for note in simulation.notes:
        click.echo(f"fecm: note: {note}", err=True)
    result = load(path)
    if result.still_in_contact:
        click.echo(f"fecm: note: {OPEN_END}", err=True)
    click.echo(problem.deck.title or "(no title)")
    for line in summary(result):
        click.echo(f"  {line}")
    click.echo(f"  result            {path}")
    if printed is not None:
        click.echo(f"  printed           {printed}")


@contextlib.contextmanager
def _ends(path: Path) -> Iterator[None]:
    """Say how a run ended that did not end well."""
    from fecm.checkpoint import CheckpointError
    from fecm.dynamics import DivergenceError
    from fecm.results.journal import SpoolError
    from fecm.statics import SingularStiffnessError

    try:
        yield
    except SingularStiffnessError as error:
        raise Refused(
            f"{error}: the plate is not held, so that it has no static displacement; restrain "
            f"it with BOUN; {path} was not written"
        ) from None
    except DivergenceError as diverged:
        raise AnswerIsNo(
            f"the run diverged at step {diverged.step}: {diverged.reason}; {path} was not written"
        ) from None
    except (CheckpointError, SpoolError) as error:
        raise Refused(f"{error}; run the deck anew, without --resume") from None
    except _StoppedError as stopped:
        click.echo(
            f"fecm: stopped behind step {stopped.step}; the same command with --resume goes on to "
            f"{path}",
            err=True,
        )
        raise SystemExit(signals.status) from None


class _StoppedError(Exception):
    """A signal has ended the run, in good order."""

    def __init__(self, step: int) -> None:
        self.step = step
        super().__init__(step)


class _Look:
    """Looks for signals between two steps, and writes checkpoints.

    Parameters
    ----------
    checkpointer : Checkpointer
    every : float or None
        Seconds between two checkpoints; None writes one only when a signal ends the run.
    """

    def __init__(self, checkpointer: Checkpointer, every: float | None) -> None:
        self._checkpointer = checkpointer
        self._every = every

    def __call__(self, simulation: Simulation) -> None:
        if signals.came:
            self._checkpointer.write(simulation)
            raise _StoppedError(simulation.plate.step)
        if self._every is not None and self._checkpointer.age >= self._every:
            self._checkpointer.write(simulation)


def _check_room(path: Path, size: int) -> None:
    """Refuse a result that the disk has no room for."""
    free = shutil.disk_usage(path.parent).free
    if size > free:
        raise Refused(
            f"{path}: the result takes about {said(size)}, and the disk has {said(free)} left"
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
        if self.bar is not None:
            self.bar.update(done - self.done)
        self.done = done
