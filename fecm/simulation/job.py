"""Runs as jobs: inputs, outputs, price, execution, resume."""

from __future__ import annotations

import contextlib
import math
import shutil
from collections.abc import Callable, Iterable, Iterator
from dataclasses import KW_ONLY, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Literal, NamedTuple

from fecm._errors import OptionsError, warn
from fecm._files import OutputError, check_outputs, open_for_writing
from fecm._machine import format_bytes
from fecm._options import documented, option, with_parameters_of
from fecm._table import Row, html_summary
from fecm._watch import LOGGER, SILENT, CallerWatch, Progress, StoppedError, Watch
from fecm.deck.findings import Finding
from fecm.deck.macros import EXTENDED, extended
from fecm.deck.output_cards import Compact
from fecm.listing.printout import Printer
from fecm.listing.slips import MODES, NAMES, REPORT, Mode, active_slips
from fecm.mechanics.contact_law import Law
from fecm.mechanics.failure import FailureCriterion, own_criteria
from fecm.mechanics.own_law import own_law
from fecm.mechanics.projectile import (
    INTEGRATORS,
    LUMPED,
    MASSES,
    WILSON,
    DeckProjectile,
    Integrator,
    LinearProjectile,
    MassMatrix,
    RodMethod,
    own_projectile,
)
from fecm.mechanics.stiffness_product import AUTO, SOLVERS
from fecm.problem.build import ENERGY_LIMIT, RunOptions, check_run_options
from fecm.problem.loading import AnyDeck, load_deck, sole
from fecm.problem.memory import check_run_memory, needed_bytes
from fecm.problem.problem import Problem
from fecm.results.result import Result, load
from fecm.results.sinks import MemorySink
from fecm.simulation.run import run_program, seconds_of_steps, simulate
from fecm.simulation.simulation import Simulation

Solver = Literal["auto", "kernels", "numpy", "csr"]


class Price(NamedTuple):
    """Steps, bytes, memory and seconds that a job takes.

    Attributes
    ----------
    steps : int
        Steps of the plate.
    output_bytes : int
        Approximate size of the results.
    memory_bytes : int
        Memory at once, without the interpreter and its libraries; between 0.7 and 2 times the
        measured memory.
    seconds : float
        Approximate time on this machine; NaN if it is not known.
    at_most : bool
        Whether the program may end earlier, so that steps, bytes and seconds are upper bounds.
    """

    steps: int
    output_bytes: int
    memory_bytes: int
    seconds: float
    at_most: bool = False

    def __repr__(self) -> str:
        return f"<fecm price: {self}>"

    def __str__(self) -> str:
        parts = [f"at most {self.steps} steps" if self.at_most else f"{self.steps} steps"]
        if self.output_bytes:
            parts.append(f"{format_bytes(self.output_bytes)} of results")
        parts.append(f"{format_bytes(self.memory_bytes)} of memory")
        if not math.isnan(self.seconds):
            parts.append(f"about {self.seconds:.2g} s")
        return ", ".join(parts)


@documented
@dataclass(eq=False, repr=False)
class Run:
    """Deck that is ready to run.

    The deck, the options and the output files are checked at once. :attr:`price` says what the run
    takes, and :meth:`execute` runs it.

    Parameters
    ----------
    deck : str, Path, file or Deck
        A file's path, a deck's text, an open file, or a model built in Python.
    {parameters}

    Attributes
    ----------
    problems : list of ProblemRun
        The problems of the deck, each with its files.

    Raises
    ------
    DeckError
        If the deck has errors.
    OptionsError
        If an option is unknown or invalid, or not for this deck.
    LawError, ProjectileError, CriterionError, ExtensionError
        If `law`, `projectile` or one of `criteria` can't be used.
    CheckpointError
        If there is no checkpoint to resume from, or if a checkpoint is in the way.
    OSError
        If a file can't be read or written, or exists and may not be replaced.

    Examples
    --------
    >>> job = Run("decks/impact-115.inp", progress=True)
    >>> job.price.steps
    200
    >>> result = job.execute()  # doctest: +SKIP
    """

    deck: AnyDeck
    mode: Mode = option(
        REPORT,
        "Follow the report's text, or its printed program slip by slip.",
        group="Model",
        choices=MODES,
    )
    slips: Iterable[str] = option(
        (),
        f"Slips of the printed program, added to report mode.  Names: {', '.join(NAMES)}.",
        group="Model",
        choices=NAMES,
        metavar="NAME",
        flag="--slip",
    )
    output: str | Path | None = option(
        None,
        "Result file; a second problem goes to OUT-2.h5, and so on.",
        group="Result",
        metavar="OUT.h5",
        flag="-o",
    )
    extend: bool = option(
        False,
        f"Go on after the deck's steps until the impact is over, for at most {EXTENDED} times as "
        "many steps.  A loop with OVER may then take so many more passes.",
        group="Limits",
    )
    force: bool = option(
        False,
        "Run despite a time step above the critical one (E508) or L2 = 2 in a free plate (E321).",
        group="Limits",
    )
    solver: Solver = option(
        AUTO,
        "Computation of K·u: kernels, numpy, or csr (a sparse matrix); auto takes the compiled "
        "kernels if there are any, else numpy.",
        group="Computation",
        choices=SOLVERS,
    )
    threads: int = option(
        0,
        "Threads that share the work of a step.  With 0 a large mesh takes a thread for each "
        "free processor.  The result does not depend on it.",
        group="Computation",
        metavar="N",
    )
    rod_mass: MassMatrix = option(
        LUMPED,
        "The projectile's mass matrix; the report's program lumps it.",
        group="Model",
        choices=MASSES,
    )
    rod_integrator: Integrator = option(
        WILSON,
        "The projectile's integration; the report's is Wilson's.",
        group="Model",
        choices=INTEGRATORS,
    )
    energy_limit: float = option(
        ENERGY_LIMIT,
        "Relative energy error that ends a run without slips.",
        group="Limits",
        metavar="RATIO",
    )
    progress: Progress | bool | None = option(
        None,
        "Called now and then with the number of steps that are done and the number of all; True "
        "shows them on standard error, with the seconds that are left.",
    )
    law: Law | str | None = option(
        None,
        "Contact law instead of EXPE: the name that an installed package gives it (entry points of "
        "the group fecm.laws).",
        python="Or an object with the methods of Law.",
        group="Model",
        metavar="NAME",
    )
    projectile: DeckProjectile | LinearProjectile | None = option(
        None,
        "Projectile instead of PROJ's, by its mass and stiffness matrices, at the velocity "
        "of ROD: a LinearProjectile, Rod or RigidMass.",
    )
    criteria: Iterable[FailureCriterion | str] = option(
        (),
        "Failure criteria that FAIL also evaluates, by the names that installed packages give them "
        "(entry points of the group fecm.criteria).",
        python="Or functions.",
        group="Model",
        metavar="NAME",
        flag="--criterion",
    )
    _: KW_ONLY
    overwrite: bool = option(
        False, "Replace existing results and the checkpoints of interrupted runs.", group="Result"
    )
    resume: bool = option(
        False,
        "Resume from the checkpoint of an interrupted run.  The result has the same bytes as "
        "without the interruption.",
        group="Interrupted runs",
    )
    checkpoint: float | None = option(
        None,
        "Write a checkpoint beside the output at this interval.",
        group="Interrupted runs",
        metavar="SECONDS",
    )
    printed: str | Path | None = option(
        None,
        "Also write the printed output of the original program.",
        group="Result",
        metavar="OUT.txt",
        flag="--print",
    )

    def __post_init__(self) -> None:
        self.options: RunOptions = RunOptions(
            active_slips(self.mode, self.slips),
            self.solver,
            self.threads,
            RodMethod(self.rod_mass, self.rod_integrator),
            self.energy_limit,
            law=own_law(self.law),
            projectile=own_projectile(self.projectile),
            criteria=own_criteria(self.criteria),
        )
        self._loaded = load_deck(self.deck, self.mode)
        self.source: str = self._loaded.source
        self._loaded.refuse_errors(self.force)
        problems = self._loaded.problems
        if self.extend:
            problems = [self._extended(problem) for problem in problems]
        for problem in problems:
            check_run_options(problem, self.options)
        self.problems: list[ProblemRun]
        if self.output is not None:
            self.problems = self._with_files(problems, Path(self.output))
            return
        if self.printed or self.resume or self.checkpoint is not None:
            raise OptionsError("printed, resume and checkpoint need an output file")
        self.problems = [ProblemRun(problem, self.options) for problem in problems]

    def _extended(self, problem: Problem) -> Problem:
        """Return a problem whose loop of impact steps goes on until the impact is over."""
        if self.options.slips:
            raise OptionsError("extend needs report mode, without slips")
        program = extended(problem.program)
        if program == problem.program:
            raise OptionsError(
                f"extend needs a loop with RODP that no other loop contains; {self.source} has none"
            )
        return replace(problem, program=program)

    def _with_files(self, problems: list[Problem], first: Path) -> list[ProblemRun]:
        """Check the output files, and assign them to the problems."""
        from fecm.simulation.checkpoint import (  # 40 ms, with h5py
            CheckpointError,
            files_of,
            fingerprint,
            finished_before,
            interrupted,
            resuming,
        )

        names = range(1, len(problems) + 1)
        paths = [numbered(first, n) for n in names]
        prints = [numbered(Path(self.printed), n) if self.printed else None for n in names]
        beside = [p for path in paths if path.name for p in files_of(path)]
        check_outputs([*paths, *filter(None, prints)], True, [Path(self.source)], beside)
        unfinished = interrupted(paths, resume=self.resume, overwrite=self.overwrite)
        before: list[str] = []
        if unfinished:
            with resuming(paths[unfinished]):
                before = finished_before(paths[unfinished])
        finished: list[str] = []
        jobs = []
        for number, (problem, path, print_to) in enumerate(
            zip(problems, paths, prints, strict=True)
        ):
            job = ProblemRun(
                problem,
                self.options,
                path,
                print_to,
                overwrite=self.overwrite,
                resumes=number == unfinished,
                interval=self.checkpoint,
                finished=finished if len(problems) > 1 else None,
            )
            existing = [output for output in job.outputs if output.exists()]
            if number < len(before) and existing == job.outputs:
                job.complete = before[number] == fingerprint(problem, job.outputs)
            is_finished = unfinished is not None and number < unfinished
            if is_finished and existing and not (job.complete or self.overwrite):
                raise CheckpointError(
                    f"{existing[0]} is not what the interrupted run has written for problem "
                    f"{number + 1} of this deck; overwrite=True runs the problem again"
                )
            if not (job.complete or job.resumes):
                check_outputs(job.outputs, self.overwrite)
            jobs.append(job)
        return jobs

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Warnings and notes about the deck."""
        return tuple(finding for finding in self._loaded.findings if finding.severity != "error")

    @cached_property
    def price(self) -> Price:
        """What the run takes. The time is estimated from the first steps."""
        prices = [job.price for job in self.problems]
        steps, written, memory, seconds, at_most = (
            zip(*prices, strict=True) if prices else ((),) * 5
        )
        return Price(
            sum(steps),
            sum(written),
            max(memory, default=0),
            math.fsum(seconds),
            any(at_most),
        )

    def execute(self) -> Result | list[Result]:
        """Run the problems that are not complete.

        Each warning about the deck and each reason to doubt the result is a :class:`FecmWarning`.
        With an output file, an interrupt writes a checkpoint. The same run with ``resume=True``
        continues from it.

        Returns
        -------
        Result or list of Result
            A list if the deck has several problems.

        Raises
        ------
        DivergenceError
            If the motion grows without bound, or the energy balance exceeds its limit.
        SingularStiffnessError
            If a static solution is requested, and the plate is not restrained.
        LawError
            If a method of `law` raises an exception, or returns a value that is not a number.
        CriterionError
            If a function of `criteria` raises an exception, or does not return exposures.
        CheckpointError
            If the checkpoint is damaged, or belongs to another run.
        NotEnoughMemoryError
            If the run needs more memory than is free; a MemoryError.
        OSError
            If a file can't be read or written.
        KeyboardInterrupt
            After an interrupt.
        """
        results = self._execute()
        return results[0] if len(results) == 1 else results

    def _execute(self) -> list[Result]:
        """Run the problems and return their results."""
        for text in self._loaded.warnings:
            warn(text)
        results = []
        for job in self.problems:
            title = job.problem.deck.title or self.source
            watch = CallerWatch(title, self.progress)
            LOGGER.info("%s: %d steps", title, job.problem.work.steps)
            with contextlib.ExitStack() as stack:
                if job.path is not None:
                    stack.enter_context(watch.deferring_interrupts())
                result = job.execute(watch)
            LOGGER.info("%s: done", title)
            result.findings = self.findings
            results.append(result)
        return results

    def __repr__(self) -> str:
        count = len(self.problems)
        return f"<fecm run of {self.source}: {count} problem{'' if count == 1 else 's'}>"

    def _repr_html_(self) -> str:
        """Return a table of the title, file and price of each problem, for notebooks."""
        rows: list[Row] = []
        for job in self.problems:
            rows += [("title", job.problem.deck.title), ("price", str(job.price))]
            rows += [("result", str(job.path))] * (job.path is not None)
        return html_summary(self, rows)


@dataclass(eq=False, repr=False)
class ProblemRun:
    """Problem of a deck that is ready to run."""

    problem: Problem
    options: RunOptions
    path: Path | None = None  # of the result, which is kept in memory otherwise
    printed: Path | None = None  # of the printed output
    overwrite: bool = False
    resumes: bool = False  # from the checkpoint of an interrupted run
    interval: float | None = None  # seconds between two checkpoints
    # Fingerprints of the finished problems of the deck; None for a deck with one problem.
    finished: list[str] | None = None
    complete: bool = False  # in an interrupted run that is resumed

    @property
    def outputs(self) -> list[Path]:
        """Paths of the result and the printed output."""
        return [path for path in (self.path, self.printed) if path is not None]

    @cached_property
    def price(self) -> Price:
        """What the run takes. The time is estimated from the first steps."""
        problem, in_memory = self.problem, self.path is None
        before, step = seconds_of_steps(
            lambda observer: Simulation(problem, MemorySink(), self.options, observers=(observer,))
        )
        return Price(
            problem.work.steps,
            problem.output_bytes,
            needed_bytes(problem, solver=self.options.solver, in_memory=in_memory),
            before + step * max(1, problem.work.steps),
            problem.work.at_most,
        )

    def execute(self, watch: Watch = SILENT) -> Result:
        """Run the problem and return its result; see :meth:`executing`."""
        with self.executing(watch) as result:
            pass
        return result if self.path is None else load(self.path)

    @contextlib.contextmanager
    def executing(self, watch: Watch = SILENT) -> Iterator[Result]:
        """Run the problem and yield its result, whose file is still open.

        The file gets its final name after the block. If the watch stops the run, a checkpoint is
        written first. The result of a problem that is already complete is read from its file.

        Raises
        ------
        StoppedError
            If the watch stops the run.
        CheckpointError
            If the run can't resume.
        OutputError
            If the result does not fit on the disk.
        """
        if self.complete and self.path is not None:
            self._finish()
            watch.note(f"{self.path} is complete")
            yield load(self.path)
            return
        problem = self.problem
        check_run_memory(problem, solver=self.options.solver, in_memory=self.path is None)
        if self.path is not None:
            with self._into_file(self.path, watch) as result:
                yield result
        else:
            sink = MemorySink()
            simulation = simulate(problem, sink, self.options, [_observer(watch, problem)])
            watch.advance(simulation.state.plate.step, simulation.state.plate.step)
            result = Result(sink.arrays, sink.texts, sink.groups)
            yield result
        watch.note(*result.notes)

    @contextlib.contextmanager
    def _into_file(self, path: Path, watch: Watch) -> Iterator[Result]:
        """Run the problem into its result file."""
        from fecm.results.hdf5_writer import result_writing  # 25 ms with h5py
        from fecm.simulation.checkpoint import Checkpointer, resuming

        needed, free = self.problem.output_bytes, shutil.disk_usage(path.parent).free
        if needed > free:
            space = f"the disk has {format_bytes(free)} left"
            raise OutputError(f"{path}: the result takes about {format_bytes(needed)}, and {space}")
        with contextlib.ExitStack() as stack:
            if self.resumes:
                stack.enter_context(resuming(path))
            replaces = self.overwrite or self.resumes
            sink = stack.enter_context(result_writing(path, overwrite=replaces))
            sink.compact = self.problem.deck.has(Compact)
            checkpointer = Checkpointer(path, sink, self.finished or ())
            printer = Printer()
            if self.printed is not None:
                file = stack.enter_context(open_for_writing(self.printed, overwrite=replaces))
                printer = Printer(file)

            def stop_or_go_on(simulation: Simulation) -> None:
                if watch.stops():
                    checkpointer.write(simulation)
                    step = simulation.state.plate.step
                    more = f"the same call with resume=True continues {path}"
                    raise StoppedError(f"stopped after step {step}; {more}")

            def on_step(simulation: Simulation) -> None:
                watch.advance(simulation.state.plate.step, self.problem.work.steps)
                stop_or_go_on(simulation)
                if self.interval is not None and checkpointer.age >= self.interval:
                    checkpointer.write(simulation)

            simulation = Simulation(
                self.problem, sink, self.options, printer, (on_step,), stop_or_go_on
            )
            if self.resumes:
                checkpointer.restore(simulation)
                watch.note(f"{path} resumes after step {simulation.state.plate.step}")
            result = run_program(simulation)
            watch.advance(simulation.state.plate.step, simulation.state.plate.step)
            yield result
        checkpointer.clear()
        watch.note(*simulation.state.notes)
        self._finish()

    def _finish(self) -> None:
        """Add the fingerprint of the problem to the fingerprints of the deck."""
        if self.finished is not None:
            from fecm.simulation.checkpoint import fingerprint

            self.finished.append(fingerprint(self.problem, self.outputs))


def _observer(watch: Watch, problem: Problem) -> Callable[[Simulation], None]:
    """Return a function that reports the steps of a run without a file."""

    def on_step(simulation: Simulation) -> None:
        step = simulation.state.plate.step
        watch.advance(step, problem.work.steps)
        if watch.stops():
            raise StoppedError(f"stopped after step {step}")

    return on_step


@with_parameters_of(Run)
def run(job: Run) -> Result | list[Result]:
    """Run every problem of a deck.

    :class:`Run` has the parameters and their errors. :meth:`Run.execute` has the errors of the
    computation.

    Parameters
    ----------
    {parameters}

    Returns
    -------
    Result or list of Result
        A list if the deck has several problems; :func:`run_one` returns one result.

    Examples
    --------
    >>> result = run("decks/appendix.inp")
    >>> print(f"{result.force.max():.2f} lb")
    6.19 lb
    """
    return job.execute()


@with_parameters_of(Run)
def run_one(job: Run) -> Result:
    """Run a deck with exactly one problem; see :func:`run`.

    Raises
    ------
    OptionsError
        Also if the deck has several problems.

    Examples
    --------
    >>> result = run_one("decks/impact-115.inp")
    >>> print(f"{result.force.max():.2f} lb")
    86.20 lb
    """
    sole(job.problems)
    result = job.execute()
    assert isinstance(result, Result)
    return result


def numbered(path: Path, number: int) -> Path:
    """Return the output path of problem `number`.

    The first problem has the path itself; the others have ``-2``, ``-3`` before its suffix.
    """
    return path if number == 1 else path.with_name(f"{path.stem}-{number}{path.suffix}")
