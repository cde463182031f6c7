"""``fecm run``."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from pathlib import Path

import click
from click import option

from fecm._files import check_outputs
from fecm._memory import format_bytes
from fecm.api import numbered
from fecm.cli import common
from fecm.cli.common import CheckFailedError, RefusedError, echo, note, signals
from fecm.cli.decks import load_valid
from fecm.cli.help import typical
from fecm.cli.types import POSITIVE, Finite, OneOf
from fecm.mechanics.plate_motion import DivergenceError
from fecm.mechanics.projectile import INTEGRATORS, LUMPED, MASSES, WILSON, RodMethod
from fecm.mechanics.solutions import SingularStiffnessError
from fecm.mechanics.stiffness_product import AUTO, SOLVERS
from fecm.problem.build import ENERGY_LIMIT, RunOptions
from fecm.problem.memory import check_memory
from fecm.problem.problem import Problem
from fecm.problem.slips import NAMES, active_slips
from fecm.problem.summary import larger_steps
from fecm.results import hdf5_writer
from fecm.results.exposures import largest_exposures
from fecm.results.hdf5_reader import read
from fecm.results.result import Result, result_of
from fecm.results.schema import declared_units
from fecm.results.summary import about_run
from fecm.simulation.checkpoint import Checkpointer, CheckpointError, checkpoint_of, spool_of
from fecm.simulation.printout import Printer
from fecm.simulation.run import run as simulate_run
from fecm.simulation.simulation import Simulation


@click.command(
    epilog=typical(
        "fecm run impact-115.inp",
        "fecm run drop-weight.inp -o drop.h5 --overwrite --fail-limit 1",
    )
)
@click.argument("deck", type=common.DECK_PATH)
@option(
    "-o",
    "--output",
    type=common.FILE_PATH,
    metavar="OUT.h5",
    help="Result file.  [default: the deck's name with .h5, in this folder]",
)
@common.MODE_OPTION
@option(
    "--slip",
    "slips",
    type=OneOf(NAMES),
    multiple=True,
    metavar="NAME",
    help="Add a single slip of the program to report mode; may be repeated.  Names: "
    f"{', '.join(NAMES)}.",
)
@option(
    "--overwrite",
    is_flag=True,
    help="Replace existing results and the checkpoints of interrupted runs.",
)
@option(
    "--solver",
    type=click.Choice(SOLVERS),
    default=AUTO,
    show_default=True,
    help="Computation of K·u: by compiled kernels where there are any, else by NumPy; by one "
    "of them; or by a sparse matrix.",
)
@option(
    "--threads",
    type=click.IntRange(0, 1024),
    default=0,
    metavar="N",
    help="Threads that share the work of a step; 0 uses every core for a large mesh.  [default: 0]",
)
@option(
    "--rod-mass",
    type=click.Choice(MASSES),
    default=LUMPED,
    show_default=True,
    help="The projectile's mass matrix; the report's program lumps it.",
)
@option(
    "--rod-integrator",
    type=click.Choice(INTEGRATORS),
    default=WILSON,
    show_default=True,
    help="The projectile's integration; the report's is Wilson's.",
)
@option(
    "--checkpoint",
    "every",
    type=Finite(min=0.0),
    metavar="SECONDS",
    help="Write a checkpoint beside the output at this interval.",
)
@option("--resume", is_flag=True, help="Resume from the checkpoint of an interrupted run.")
@option(
    "--energy-limit",
    type=POSITIVE,
    default=ENERGY_LIMIT,
    show_default=True,
    metavar="RATIO",
    help="Relative energy error that ends a run without slips.",
)
@option(
    "--fail-limit",
    type=POSITIVE,
    metavar="EXPOSURE",
    help="Exit with status 1 if an exposure of FAIL exceeds this value.",
)
@option(
    "--force",
    is_flag=True,
    help="Run despite a time step above the critical one (E508) or L2 = 2 in a free plate (E321).",
)
@option(
    "--print",
    "printed",
    type=common.FILE_PATH,
    metavar="OUT.txt",
    help="Also write the printed output of the original program.",
)
@common.FORMAT_OPTION
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
    fail_limit: float | None,
    form: str,
) -> None:
    """Run every problem in DECK and write its result.

    The result of a second problem goes to OUT-2.h5, and so on.  An interrupted run leaves a
    checkpoint beside its output; --resume with the same options gives the same bytes.
    """
    try:
        active = active_slips(mode, slips)
    except ValueError as error:
        raise click.UsageError(str(error)) from None
    problems = load_valid(deck, "; nothing was run", mode, force=force)
    first = output or Path(f"{deck.stem}.h5")
    paths = [numbered(first, n) for n in range(1, len(problems) + 1)]
    prints = [numbered(printed, n) if printed else None for n in range(1, len(problems) + 1)]
    partial = [p for path in paths if path.name for p in (checkpoint_of(path), spool_of(path))]
    check_outputs([*paths, *filter(None, prints)], True, [deck], partial)
    left = [n for n, path in enumerate(paths) if checkpoint_of(path).exists()]  # interrupted runs
    if resume and not left:
        raise RefusedError(f"there is no checkpoint {checkpoint_of(paths[0])} to resume from")
    if left and not (resume or overwrite):
        raise RefusedError(
            f"{checkpoint_of(paths[left[0]])} belongs to an interrupted run: --resume continues "
            "it, --overwrite starts over"
        )
    # Outputs up to the interrupted problem belong to the run that is resumed.
    own = left[0] + 1 if resume else 0
    check_outputs([*paths[own:], *filter(None, prints[own:])], overwrite)
    rod = RodMethod(rod_mass, rod_integrator)
    choices = RunOptions(active, solver, threads, rod, energy_limit)
    if fail_limit is not None and not any(problem.work.passes["FAIL"] for problem in problems):
        raise RefusedError(f"--fail-limit needs the macro FAIL; {deck} has none")
    exceeded: list[str] = []
    for number, (problem, path, print_to) in enumerate(zip(problems, paths, prints, strict=True)):
        if number and form == "text":
            echo()
        if number < own - 1 and path.exists():
            note(f"{path} is complete")
            continue
        result = _run_one(
            problem,
            path,
            print_to,
            choices,
            every,
            resumes=number == own - 1,
            overwrite=overwrite or number < own,
            form=form,
        )
        if fail_limit is not None:
            exceeded += [
                f"exposure {e.exposure:.4g} of {e.criterion}"
                for e in largest_exposures(result)
                if e.exposure > fail_limit
            ]
    if exceeded:
        raise CheckFailedError(f"{'; '.join(exceeded)}: more than the limit of {fail_limit:g}")


def _run_one(
    problem: Problem,
    path: Path,
    printed: Path | None,
    choices: RunOptions,
    every: float | None,
    *,
    resumes: bool,
    overwrite: bool,
    form: str,
) -> Result:
    """Run one problem of a deck into a file, print what came out and return its result."""
    import shutil

    if problem.output_bytes > (free := shutil.disk_usage(path.parent).free):
        size = format_bytes(problem.output_bytes)
        left = f"the disk has {format_bytes(free)} left"
        raise RefusedError(f"{path}: the result takes about {size}, and {left}")
    check_memory(problem, solver=choices.solver)
    with contextlib.ExitStack() as stack:
        stack.enter_context(signals.deferred())
        stack.enter_context(_ends(path, resumes=resumes))
        sink = stack.enter_context(hdf5_writer.writing(path, overwrite=overwrite))
        checkpointer = Checkpointer(path, sink)
        printer = Printer()
        if printed is not None:
            printer = Printer(stack.enter_context(common.writing(printed, overwrite=overwrite)))
        advance = stack.enter_context(common.progress("fecm", problem.work.steps))
        on_step, on_macro = _observers(checkpointer, every, advance)
        simulation = Simulation(problem, sink, choices, printer, (on_step,), on_macro)
        if resumes:
            checkpointer.restore(simulation)
            note(f"{path} resumes after step {simulation.state.plate.step}")
        simulate_run(simulation)
    checkpointer.clear()
    contents = read(path)
    result = result_of(contents, problem.deck)
    with contents.held():
        about = about_run(result)
    note(*simulation.state.notes, *result.notes)
    if form == "json":
        named = {"title": problem.deck.title, "result": str(path), "printed": printed}
        common.echo_json({**named, "units": declared_units(result.attributes), **about})
        return result
    echo(problem.deck.title or "(no title)")
    for line in (*about["summary"], *larger_steps(problem)):
        echo(f"  {line}")
    echo(f"  result            {path}")
    if printed is not None:
        echo(f"  printed           {printed}")
    return result


@contextlib.contextmanager
def _ends(path: Path, *, resumes: bool) -> Iterator[None]:
    """Turn the errors of a run into messages."""
    try:
        yield
    except SingularStiffnessError as error:
        raise RefusedError(
            f"{error}: the plate is not restrained and has no static displacement; restrain "
            f"it with BOUN; {path} was not written"
        ) from None
    except DivergenceError as diverged:
        raise CheckFailedError(
            f"the run diverged at step {diverged.step}: {diverged.reason}; {path} was not written"
        ) from None
    except CheckpointError as error:
        message = f"{error}; --overwrite without --resume discards the checkpoint and starts over"
        raise RefusedError(message) from None
    except _StoppedError as stopped:
        more = f"the same command with --resume continues {path}"
        echo(f"fecm: stopped after step {stopped}; {more}", err=True)
        raise SystemExit(128 + signals.received) from None
    except Exception as error:
        # h5py's own errors are OSErrors without a number.
        of_disk = isinstance(error, OSError) and (error.errno or type(error) is not OSError)
        if not resumes or of_disk or isinstance(error, MemoryError):
            raise
        # A forged checkpoint can fail at any place.
        raise RefusedError(
            f"the run can't resume from {checkpoint_of(path)} ({error}); --overwrite without "
            "--resume discards it and starts over"
        ) from None


class _StoppedError(Exception):
    """A signal stopped the run after the step in `args`; its checkpoint is written."""


def _observers(
    checkpointer: Checkpointer, every: float | None, advance: Callable[[int], object]
) -> tuple[Callable[[Simulation], None], Callable[[Simulation], None]]:
    """Functions that are called after a step and after a macro.

    They show the progress, write a checkpoint when `every` seconds have passed since the last one,
    and stop the run after a signal.
    """
    shown = 0

    def on_macro(simulation: Simulation) -> None:
        if signals.received:
            checkpointer.write(simulation)
            raise _StoppedError(simulation.state.plate.step)

    def on_step(simulation: Simulation) -> None:
        nonlocal shown
        step = simulation.state.plate.step
        advance(step - shown)
        shown = step
        on_macro(simulation)
        if every is not None and checkpointer.age >= every:
            checkpointer.write(simulation)

    return on_step, on_macro
