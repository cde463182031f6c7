"""``fecm sweep``."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

import click
from click import option

from fecm._files import check_outputs
from fecm.api import load_deck
from fecm.authoring.case import Case, CasesError, Limit, parse_exceed
from fecm.authoring.cases import grid_cases, parse_vary, read_cases
from fecm.authoring.values import NAMES
from fecm.cli.common import FAILED, RefusedError, echo, every_minute, note, progress
from fecm.cli.decks import count_findings
from fecm.cli.interrupts import signals
from fecm.cli.options import (
    DECK_PATH,
    LAW_OPTION,
    NAMED_PATH,
    GroupedCommand,
    OneOf,
    Parsed,
    collected,
    list_of,
    typical,
)
from fecm.deck.catalogue import system_of
from fecm.deck.findings import DeckError
from fecm.mechanics.own_law import LawError, own_law
from fecm.problem.build import RunOptions
from fecm.problem.problem import Problem
from fecm.results import hdf5_writer
from fecm.results.hdf5_reader import read
from fecm.results.result import result_of
from fecm.simulation.run import run_program as simulate_run
from fecm.simulation.simulation import Simulation
from fecm.sweeps.api import carry_out_plan, check_draws, checked_problem, reduced_mode_count
from fecm.sweeps.batch import case_deck
from fecm.sweeps.checks import check_sweep_memory, doubtful_values, freed, unused_values
from fecm.sweeps.convergence import convergence_lines as table_of
from fecm.sweeps.convergence import refined_cases
from fecm.sweeps.distributions import FORMS, ValueDistribution, parse_random
from fecm.sweeps.execute import (
    LOST,
    PartialResults,
    SchedulerError,
    address_in,
    exclusive_result,
    expected,
)
from fecm.sweeps.files import save_sweep
from fecm.sweeps.outcome import Outcome
from fecm.sweeps.plan import (
    MEASURES,
    MODES,
    MOST_MODES,
    REDUCED,
    Measure,
    Plan,
    Task,
    plan,
    shares_plate,
    tasks,
)
from fecm.sweeps.random import (
    DESIGNS,
    Design,
    DesignKind,
    Pair,
    correlation_of,
    cost,
    design_of,
    doubt,
    parse_correlation,
    random_cases,
)
from fecm.sweeps.result import SweepResult
from fecm.sweeps.search import Until, parse_until
from fecm.sweeps.summary import remarks, sweep_summary, sweep_verdict, tables

NAMED = [f"{name}=" for name in NAMES]  # for the shell's completion


GROUPS = {
    "Cases": ("vary", "cases", "refine"),
    "Random values": (
        "random",
        "correlation",
        "samples",
        "seed",
        "design",
        "sensitivity",
        "exceed",
    ),
    "Search": ("find", "until"),
    "Result": ("output", "history", "measure", "full", "overwrite"),
    "Computation": ("law", "model", "modes", "workers", "scheduler", "scheduler_file"),
}


@dataclass(frozen=True)
class SweepOptions:
    """Argument and options of ``fecm sweep``; those of :func:`fecm.sweep` have its names."""

    deck: Path
    vary: tuple[str, ...]
    cases: Path | None  # table of the cases
    refine: tuple[int, ...] | None
    random: tuple[tuple[str, ValueDistribution], ...]
    correlation: tuple[tuple[Pair, float], ...]
    samples: int | None
    seed: int | None
    design: DesignKind | None
    sensitivity: bool
    exceed: tuple[Limit, ...]
    find: str | None
    until: Until | None
    output: Path | None
    history: bool
    measure: tuple[str, ...]
    full: tuple[int, ...] | None  # cases that are also run in full
    overwrite: bool
    model: str | None
    modes: int | None
    workers: int | None
    scheduler: str | None
    scheduler_file: Path | None
    allow_failed: bool
    law: str | None  # name of a contact law of an installed package

    @property
    def path(self) -> Path:
        """Result file."""
        return self.output or Path(f"{self.deck.stem}-sweep.h5")

    @property
    def sources(self) -> list[Path]:
        """Files that are read, and never replaced."""
        return [self.deck] if self.cases is None else [self.deck, self.cases]

    def check(self) -> None:
        """Raise UsageError if options exclude each other, or one lacks another."""
        if self.refine and (self.vary or self.cases or self.random or self.until or self.measure):
            raise click.UsageError("--refine varies nothing else and measures no more")
        other = self.until is not None or self.random or self.refine
        if bool(self.vary) == (self.cases is not None) and (self.vary or not other):
            raise click.UsageError("give either --vary or --cases")
        self._check_random()
        if (self.find is None) != (self.until is None):
            raise click.UsageError("--find velocity and --until QUANTITY=VALUE belong together")
        scheduled = (self.scheduler is not None) + (self.scheduler_file is not None)
        if ((self.workers or 1) > 1) + scheduled > 1:
            raise click.UsageError("give only one of --workers, --scheduler and --scheduler-file")
        if self.full and self.find:
            raise click.UsageError("--full runs given velocities: --vary velocity=FOUND --full 0")
        if self.modes is not None and self.model is None:
            raise click.UsageError("--modes needs --model reduced")

    def _check_random(self) -> None:
        """Raise UsageError if the options of random values do not fit together."""
        if not self.random:
            for name in ("correlation", "samples", "seed", "design", "exceed", "sensitivity"):
                if getattr(self, name) not in (None, (), False):
                    raise click.UsageError(f"--{name} needs --random NAME=LAW")
            return
        if self.cases is not None:
            raise click.UsageError("--random goes with --vary, not with --cases")
        if self.samples is None:
            raise click.UsageError("--random needs --samples N")
        if len(dict(self.random)) < len(self.random):
            raise click.UsageError("--random: a name is given twice")
        if len(dict(self.correlation)) < len(self.correlation):
            raise click.UsageError("--correlation: a pair is given twice")


def _checked_vary(text: str) -> str:
    """Check a text of --vary before its deck is read, whose units its values then get."""
    parse_vary(text, "m-N-s")
    return text


@click.command(
    "sweep",
    cls=GroupedCommand,
    groups=GROUPS,
    epilog=typical(
        "fecm sweep impact-patch.inp --vary velocity=50:150:11 --vary k=1e6,2e6",
        "fecm sweep drop-weight.inp --find velocity --until peak_force=threshold",
        "fecm sweep drop-weight.inp --random k=lognormal:42000,.2 --samples 200 "
        "--exceed peak_force=threshold",
    ),
)
@click.argument("deck", type=DECK_PATH)
@option(
    "--vary",
    type=Parsed(_checked_vary, "NAME=VALUES", NAMED),
    multiple=True,
    help="FROM:TO:N or A,B,C, also with a unit, as in energy=5J:30J:6; may be repeated, for a full "
    f"grid.  Names: {', '.join(NAMES)}.",
)
@option(
    "--cases",
    type=DECK_PATH,
    metavar="CASES.csv",
    help="A table instead of --vary: a header of names, one row per case.",
)
@option(
    "--refine",
    type=list_of("FACTOR,...", click.IntRange(1, 8)),
    metavar="1,2,4",
    help="Instead: divide the sides of all elements and DT by factors; order, limit and error "
    "band of every quantity.",
)
@option(
    "--random",
    type=Parsed(parse_random, "NAME=LAW", NAMED),
    multiple=True,
    help=f"Random value: {', '.join(FORMS[:-1])} or {FORMS[-1]}; may be repeated, together with "
    "--vary.",
)
@option(
    "--correlation",
    type=Parsed(parse_correlation, "NAME,NAME=RHO"),
    multiple=True,
    help="Correlation of two random values (of their normal scores, if their laws are not normal); "
    "may be repeated.",
)
@option("--samples", type=int, metavar="N", help="Number of samples of --random.")
@option("--seed", type=int, metavar="S", help="Seed of --random.  [default: 0]")
@option(
    "--design",
    type=click.Choice(DESIGNS),
    help="Design of --random: Latin hypercube, Sobol' sequence, or independent draws (Monte "
    "Carlo).  [default: lhs]",
)
@option(
    "--sensitivity",
    is_flag=True,
    help="Sobol' indices of the random values, from N times (their number + 2) cases.",
)
@option(
    "--exceed",
    type=Parsed(parse_exceed, "QUANTITY=VALUE"),
    multiple=True,
    help="Probability that a quantity of the summary exceeds a value; of peak_force also "
    "threshold, that of DELA.  May be repeated.",
)
@option(
    "--find",
    type=click.Choice(["velocity"]),
    help="Search in every case for the velocity at which --until holds.",
)
@option(
    "--until",
    type=Parsed(parse_until, "QUANTITY=VALUE"),
    help="What to reach: peak_force=NUMBER, peak_force=threshold (that of DELA), or "
    "exposure=NUMBER, the largest of FAIL outside the load, by full runs.",
)
@option(
    "-o",
    "--output",
    type=NAMED_PATH,
    metavar="SWEEP.h5",
    help="Result file.  [default: the deck's name with -sweep.h5, in this folder]",
)
@option("--history", is_flag=True, help="Also store the contact force of every step.")
@option(
    "--measure",
    type=list_of("NAME,...", OneOf(MEASURES)),
    default=(),
    help=f"Also store {', '.join(MEASURES)}: the largest deflection, strains of gages "
    "(GAGE), exposures (FAIL).",
)
@option(
    "--full",
    type=list_of("CASE,...", click.IntRange(min=0)),
    help="Also run these cases in full, into SWEEP-CASE.h5; cases count from 0.",
)
@LAW_OPTION
@option(
    "--model",
    type=click.Choice([REDUCED]),
    help="Compute the cases of a nonlinear plate (NONL) together, in a few bending modes, instead "
    "of by full runs; three of these check it.",
)
@option(
    "--modes",
    type=click.IntRange(1, MOST_MODES),
    metavar="M",
    help=f"Bending modes of --model reduced.  [default: {MODES}]",
)
@option(
    "--workers",
    type=click.IntRange(1, 1024),
    metavar="N",
    help="Worker processes on this machine.  [default: if the sweep takes more than some seconds, "
    "as many as other work leaves processors free]",
)
@option(
    "--scheduler",
    metavar="ADDRESS",
    help="Running Dask scheduler, as in tcp://host:8786, to use instead.",
)
@option(
    "--scheduler-file",
    type=DECK_PATH,
    metavar="FILE",
    help="File of `dask scheduler --scheduler-file` instead of its address.",
)
@option(
    "--allow-failed",
    is_flag=True,
    help="Exit with 0 even if cases failed, or probabilities are open.",
)
@option("--overwrite", is_flag=True, help="Replace existing results.")
@collected(SweepOptions)
def sweep_command(options: SweepOptions) -> None:
    """Run DECK many times with varied parameters.

    Cases that differ only in the projectile, its velocity or the indentation law share one run of
    the plate; with NONL each takes a full run.  The same command resumes an interrupted sweep.  The
    last line counts the cases that failed, those that ended in contact, and those that are beyond
    the range of the model.  The exit status is 1 if a case failed, or ended before a quantity of
    --exceed was known.
    """
    options.check()
    path = options.path
    problem = _problem(options.deck)
    cases, design = _cases(problem, options)
    fulls = _full_runs(options, len(cases))
    check_outputs([path, *fulls.values()], options.overwrite, options.sources)
    scheduler = options.scheduler
    if options.scheduler_file is not None:
        scheduler = address_in(options.scheduler_file)
    planned = plan(
        problem,
        cases,
        history=options.history,
        until=options.until,
        extra=(Measure.DEFLECTION,) if options.refine else options.measure,
        design=design,
        limits=options.exceed,
        modes=reduced_mode_count(options.model, options.modes),
        law=own_law(options.law),
    )
    check_draws(planned)
    if not options.refine:
        note(*unused_values(planned), *doubtful_values(problem, cases))
    if design is not None:
        reduced = planned.settings.modes is not None
        shared = reduced or (shares_plate(problem) and not planned.settings.in_full)
        motions = planned.settings.shares_motion
        told = cost(cases, design, shared=shared, motions=motions)
        note(*filter(None, (doubt(design), told)))
    here = options.workers if scheduler is None else 0
    check_sweep_memory(problem, planned, 1 if here is None else here, streamed=True)
    if count := freed(tasks(problem, planned)):
        note(
            f"B is not zero in {count} case{'' if count == 1 else 's'}: u and v, which the deck "
            "restrains at every node, are free there except where w is held"
        )
    if planned.settings.modes is None and problem.plate.nonlinear:
        note(expected(problem, planned, here))

    click.get_current_context().with_resource(exclusive_result(path))
    parts = PartialResults(path, planned.fingerprint(), restart=options.overwrite)
    result = _carry_out(problem, planned, parts, options.workers, scheduler)
    forces = parts.forces() if options.history else ()
    with signals.deferred():
        save_sweep(result, path, overwrite=options.overwrite, forces=forces)
        if lost := sum(status.startswith(LOST) for status in result["status"].tolist()):
            note(f"{lost} cases were lost with their workers; --overwrite runs them again")
        else:
            parts.clear()

    _print(result, path)
    _run_in_full(planned, fulls, overwrite=options.overwrite)
    if result.random is not None:
        note(*result.random.notes)
    note(*remarks(result))
    echo(sweep_verdict(result))
    is_open = result.random is not None and result.random.exceedance.open.any()
    if (is_open or not result.completed.all()) and not options.allow_failed:
        raise SystemExit(FAILED)


def _problem(deck: Path) -> Problem:
    """The checked problem of the deck, whose findings go to standard error if it has errors."""
    try:
        return checked_problem(deck)
    except DeckError as error:
        echo(error, err=True)
        errors = [finding for finding in error.findings if finding.severity == "error"]
        raise RefusedError(f"{count_findings(errors)}; nothing was run") from None


def _cases(problem: Problem, options: SweepOptions) -> tuple[list[Case], Design | None]:
    """Cases of the sweep, and the design of random ones."""
    if options.refine:
        return refined_cases(problem, options.refine), None
    system = system_of(problem.deck)
    if options.cases is not None:
        given = read_cases(options.cases, system)
    else:
        given = grid_cases([parse_vary(text, system) for text in options.vary])
    if not options.random:
        return given, None
    laws = dict(options.random)
    design = design_of(
        laws,
        options.samples,
        options.seed or 0,
        options.design or "lhs",
        sensitivity=options.sensitivity,
        correlation=(
            correlation_of([*laws], dict(options.correlation)) if options.correlation else ()
        ),
    )
    return random_cases(design, given), design


def _full_runs(options: SweepOptions, count: int) -> dict[int, Path]:
    """Result files of the cases that are also run in full, by their numbers."""
    chosen = tuple(dict.fromkeys(options.full or ()))
    if chosen and max(chosen) >= count:
        raise click.UsageError(f"--full {max(chosen)}: the cases are 0 to {count - 1}")
    path = options.path
    return {case: path.with_name(f"{path.stem}-{case}{path.suffix}") for case in chosen}


def _print(result: SweepResult, path: Path) -> None:
    """Print title, summary and the tables of a study of the mesh or of random values."""
    echo(result.title or "sweep")
    for line in (
        *sweep_summary(result),
        *table_of(result.cases, result.summary, result.convergence),
    ):
        echo(f"  {line}")
    for line in () if result.random is None else tables(result.random, result.unit):
        echo(f"  {line}".rstrip())
    echo(f"  result            {path}")


def _carry_out(
    problem: Problem,
    planned: Plan,
    parts: PartialResults,
    workers: int | None,
    scheduler: str | None,
) -> SweepResult:
    """Run the plan with a progress bar; finished cases survive any interruption."""
    begin, finished = time.monotonic(), 0

    def rate(_: object) -> str:
        seconds = time.monotonic() - begin
        per_core = finished / seconds / (workers or 1) if seconds else 0.0
        of_each = "" if workers is None else " per worker"
        return f"{per_core:.3g} cases a second{of_each}" if finished else ""

    def done(task: Task, outcome: Outcome) -> None:
        nonlocal finished
        finished += len(task.numbers)
        advance(len(task.numbers))

    try:
        with signals.deferred(), progress("fecm", len(planned.cases), rate) as advance:

            def idle() -> None:
                signals.heed()
                advance(0)

            return carry_out_plan(
                problem,
                planned,
                workers=workers,
                scheduler=scheduler,
                parts=parts,
                done=done,
                idle=idle,
                note=note,
            )
    except (CasesError, SchedulerError):
        parts.clear()
        raise
    except (KeyboardInterrupt, SystemExit):
        echo("fecm: the same command resumes this sweep", err=True)
        raise


def _run_in_full(planned: Plan, fulls: dict[int, Path], *, overwrite: bool) -> None:
    """Run chosen cases with all rows that their deck stores."""

    def heed(simulation: Simulation) -> None:
        signals.heed()

    for case, path in fulls.items():
        try:
            prepared = load_deck(case_deck(planned, case))
            if errors := prepared.errors(force=True):
                raise CasesError(errors[0].message)
            with (
                signals.deferred(),
                every_minute(f"fecm: case {case} is run in full, {{}} min so far".format),
                hdf5_writer.result_writing(path, overwrite=overwrite) as sink,
            ):
                options = RunOptions(law=planned.settings.law)
                simulation = Simulation(prepared.problems[0], sink, options)
                simulation.observers = (heed,)
                simulation.on_macro = heed
                simulate_run(simulation)
        except (CasesError, LawError, ArithmeticError) as error:
            note(f"case {case} was not run in full: {error}")
            continue
        except (KeyboardInterrupt, SystemExit):
            note(f"case {case} was not run in full: a signal stopped the program")
            raise
        echo(f"  case {case:<12} {path}")
        note(*(f"case {case}: {text}" for text in result_of(read(path)).notes))
