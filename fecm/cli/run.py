"""``fecm run``."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import click
from click import option

from fecm._files import check_outputs, open_for_writing
from fecm._machine import format_bytes
from fecm.api import numbered
from fecm.cli.common import CheckFailedError, RefusedError, echo, echo_json, note, progress
from fecm.cli.decks import load_valid
from fecm.cli.interrupts import signals
from fecm.cli.options import (
    DECK_PATH,
    FORMAT_OPTION,
    LAW_OPTION,
    MODE_OPTION,
    NAMED_PATH,
    POSITIVE,
    Finite,
    Format,
    GroupedCommand,
    OneOf,
    collected,
    typical,
)
from fecm.listing.printout import Printer
from fecm.listing.slips import NAMES, active_slips
from fecm.mechanics.failure import CriterionError, own_criteria
from fecm.mechanics.own_law import LawError, own_law
from fecm.mechanics.plate_motion import DivergenceError
from fecm.mechanics.projectile import (
    INTEGRATORS,
    LUMPED,
    MASSES,
    WILSON,
    Integrator,
    MassMatrix,
    RodMethod,
)
from fecm.mechanics.solutions import SingularStiffnessError
from fecm.mechanics.stiffness_product import AUTO, SOLVERS
from fecm.problem.build import ENERGY_LIMIT, RunOptions, check_run_options
from fecm.problem.memory import check_run_memory
from fecm.problem.problem import Problem
from fecm.problem.summary import larger_steps
from fecm.results import hdf5_writer
from fecm.results.exposures import LargestExposure, largest_exposures
from fecm.results.summary import about_run
from fecm.simulation.checkpoint import (
    Checkpointer,
    CheckpointError,
    checkpoint_of,
    fingerprint,
    finished_before,
    spool_of,
)
from fecm.simulation.run import run_program as simulate_run
from fecm.simulation.simulation import Simulation

STARTS_OVER = "--overwrite without --resume discards the checkpoint and starts over"
GROUPS = {
    "Result": ("output", "overwrite", "printed", "form"),
    "Model": ("mode", "slips", "law", "criteria", "rod_mass", "rod_integrator"),
    "Computation": ("solver", "threads"),
    "Interrupted runs": ("interval", "resume"),
    "Limits": ("energy_limit", "fail_limit", "force"),
}


@dataclass(frozen=True)
class RunOptionsOfCommand:
    """Argument and options of ``fecm run``."""

    deck: Path
    output: Path | None
    overwrite: bool
    printed: Path | None  # file of the printed output
    form: Format  # "text" or "json"
    mode: str
    slips: tuple[str, ...]
    rod_mass: MassMatrix
    rod_integrator: Integrator
    solver: str
    threads: int
    interval: float | None  # seconds between two checkpoints
    resume: bool
    energy_limit: float
    fail_limit: float | None  # largest exposure that passes
    force: bool
    # Names that installed packages give to a contact law and to failure criteria.
    law: str | None
    criteria: tuple[str, ...]

    def choices(self) -> RunOptions:
        """What the computation needs to know; ValueError if one is unknown."""
        return RunOptions(
            slips=active_slips(self.mode, self.slips),
            solver=self.solver,
            threads=self.threads,
            rod_method=RodMethod(self.rod_mass, self.rod_integrator),
            energy_limit=self.energy_limit,
            law=own_law(self.law),
            criteria=own_criteria(self.criteria),
        )


class Job(NamedTuple):
    """A problem of the deck, and its files."""

    problem: Problem
    path: Path  # of the result
    printed: Path | None  # of the printed output
    resumes: bool  # from the checkpoint of an interrupted run
    complete: bool  # in an interrupted run that is resumed
    overwrite: bool

    @property
    def outputs(self) -> list[Path]:
        """Result and printed output."""
        return _outputs(self.path, self.printed)


def _outputs(path: Path, printed: Path | None) -> list[Path]:
    return [path] if printed is None else [path, printed]


@click.command(
    "run",
    cls=GroupedCommand,
    groups=GROUPS,
    epilog=typical(
        "fecm run impact-patch.inp",
        "fecm run drop-weight.inp -o drop.h5 --overwrite --fail-limit 1",
    ),
)
@click.argument("deck", type=DECK_PATH)
@option(
    "-o",
    "--output",
    type=NAMED_PATH,
    metavar="OUT.h5",
    help="Result file.  [default: the deck's name with .h5, in this folder]",
)
@MODE_OPTION
@LAW_OPTION
@option(
    "--criterion",
    "criteria",
    metavar="NAME",
    multiple=True,
    help="Failure criterion that FAIL also evaluates, by the name that an installed package gives "
    "it (entry points of the group fecm.criteria); may be repeated.",
)
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
    help="Threads that share the work of a step; 0 takes as many for a large mesh as "
    "other work leaves processors free.  [default: 0]",
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
    "interval",
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
    type=NAMED_PATH,
    metavar="OUT.txt",
    help="Also write the printed output of the original program.",
)
@FORMAT_OPTION
@collected(RunOptionsOfCommand)
def run_command(options: RunOptionsOfCommand) -> None:
    """Run every problem in DECK and write its result.

    The result of a second problem goes to OUT-2.h5, and so on.  An interrupted run leaves a
    checkpoint beside its output; --resume with the same options gives the same bytes.
    """
    try:
        choices = options.choices()
    except ValueError as error:
        raise click.UsageError(str(error)) from None
    problems = load_valid(options.deck, "; nothing was run", options.mode, force=options.force)
    for problem in problems:
        check_run_options(problem, choices)
    jobs = _jobs(problems, options)
    limit = options.fail_limit
    if limit is not None and not any(problem.work.passes["FAIL"] for problem in problems):
        raise RefusedError(f"--fail-limit needs the macro FAIL; {options.deck} has none")

    exceeded: list[str] = []
    finished: list[str] = []  # fingerprints
    for number, job in enumerate(jobs):
        if number and options.form is Format.TEXT:
            echo()
        if job.complete:
            note(f"{job.path} is complete")
        exposures = [] if job.complete else _run_one(job, choices, options, finished)
        if len(jobs) > 1:
            finished.append(fingerprint(job.problem, job.outputs))
        if limit is not None:
            exceeded += [
                f"exposure {e.exposure:.4g} of {e.criterion}"
                for e in exposures
                if e.exposure > limit
            ]
    if exceeded:
        raise CheckFailedError(f"{'; '.join(exceeded)}: more than the limit of {limit:g}")


def _jobs(problems: Sequence[Problem], options: RunOptionsOfCommand) -> list[Job]:
    """The problems with their files, which are checked."""
    count = len(problems)
    first, printed = options.output or Path(f"{options.deck.stem}.h5"), options.printed
    paths = [numbered(first, n) for n in range(1, count + 1)]
    prints = [numbered(printed, n) if printed else None for n in range(1, count + 1)]
    partial = [p for path in paths if path.name for p in (checkpoint_of(path), spool_of(path))]
    check_outputs([*paths, *filter(None, prints)], True, [options.deck], partial)

    interrupted = [n for n, path in enumerate(paths) if checkpoint_of(path).exists()]
    if options.resume and not interrupted:
        raise RefusedError(f"there is no checkpoint {checkpoint_of(paths[0])} to resume from")
    if interrupted and not (options.resume or options.overwrite):
        raise RefusedError(
            f"{checkpoint_of(paths[interrupted[0]])} belongs to an interrupted run: --resume "
            "continues it, --overwrite starts over"
        )
    # Outputs of problems that are complete, and of the interrupted one, belong to this run.
    resumed = interrupted[0] if options.resume else -1
    before = _finished(paths[resumed]) if resumed > 0 else []
    jobs = []
    for number, (problem, path, print_to) in enumerate(zip(problems, paths, prints, strict=True)):
        outputs = _outputs(path, print_to)
        existing = [output for output in outputs if output.exists()]
        complete = (
            number < len(before)
            and existing == outputs
            and before[number] == fingerprint(problem, outputs)
        )
        if number < resumed and existing and not (complete or options.overwrite):
            raise RefusedError(
                f"{existing[0]} is not what the interrupted run has written for problem "
                f"{number + 1} of this deck; --overwrite runs the problem again"
            )
        if not complete and number != resumed:
            check_outputs(outputs, options.overwrite)
        jobs.append(
            Job(
                problem,
                path,
                print_to,
                resumes=number == resumed,
                complete=complete,
                overwrite=options.overwrite or number == resumed,
            )
        )
    return jobs


def _finished(interrupted: Path) -> list[str]:
    """Fingerprints of the problems that were finished before the interrupted one."""
    try:
        return finished_before(interrupted)
    except CheckpointError as error:
        raise RefusedError(f"{error}; {STARTS_OVER}") from None


def _run_one(
    job: Job, choices: RunOptions, options: RunOptionsOfCommand, finished: Sequence[str]
) -> list[LargestExposure]:
    """Run one problem of a deck into a file, print what came out and return its exposures.

    `finished` are the fingerprints of the problems before it.
    """
    problem, path = job.problem, job.path
    _check_space(problem, path)
    check_run_memory(problem, solver=choices.solver)
    with contextlib.ExitStack() as stack:
        stack.enter_context(signals.deferred())
        stack.enter_context(_ends(path, resumes=job.resumes))
        sink = stack.enter_context(hdf5_writer.result_writing(path, overwrite=job.overwrite))
        checkpointer = Checkpointer(path, sink, finished)
        printer = Printer()
        if job.printed is not None:
            file = stack.enter_context(open_for_writing(job.printed, overwrite=job.overwrite))
            printer = Printer(file)
        advance = stack.enter_context(progress("fecm", problem.work.steps))
        on_step, on_macro = _observers(checkpointer, options.interval, advance)
        simulation = Simulation(problem, sink, choices, printer, (on_step,), on_macro)
        if job.resumes:
            checkpointer.restore(simulation)
            note(f"{path} resumes after step {simulation.state.plate.step}")
        result = simulate_run(simulation)
        about = about_run(result)
        exposures = largest_exposures(result)
    checkpointer.clear()
    note(*simulation.state.notes, *result.notes)
    if options.form is Format.JSON:
        named = {"title": problem.deck.title, "result": str(path), "printed": job.printed}
        echo_json({**named, "units": result.units, **about})
        return exposures
    echo(problem.deck.title or "(no title)")
    for line in (*about["summary"], *larger_steps(problem)):
        echo(f"  {line}")
    echo(f"  result            {path}")
    if job.printed is not None:
        echo(f"  printed           {job.printed}")
    return exposures


def _check_space(problem: Problem, path: Path) -> None:
    """Refuse a run whose result does not fit on the disk."""
    free = _free_space(path.parent)
    if problem.output_bytes > free:
        size = format_bytes(problem.output_bytes)
        left = f"the disk has {format_bytes(free)} left"
        raise RefusedError(f"{path}: the result takes about {size}, and {left}")


def _free_space(folder: Path) -> int:
    """Bytes that the user may still write to the disk of a folder."""
    if sys.platform != "win32":
        found = os.statvfs(folder)
        return found.f_bavail * found.f_frsize
    import shutil  # 2 ms

    return shutil.disk_usage(folder).free


@contextlib.contextmanager
def _ends(path: Path, *, resumes: bool) -> Iterator[None]:
    """Turn the errors of a run into messages."""
    try:
        yield
    except (LawError, CriterionError) as error:
        raise RefusedError(f"{error}; {path} was not written") from None
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
        raise RefusedError(f"{error}; {STARTS_OVER}") from None
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
