"""``fecm sweep``."""

from __future__ import annotations

import time
from pathlib import Path

import click
from click import option

from fecm._files import check_outputs
from fecm.api import load_deck
from fecm.cli.common import DECK_PATH, FILE_PATH, NO, RefusedError, echo, note, progress, signals
from fecm.cli.decks import count_findings
from fecm.cli.help import typical
from fecm.cli.types import OneOf, Parsed, list_of
from fecm.deck.findings import DeckError
from fecm.problem.problem import Problem
from fecm.results import hdf5_writer
from fecm.results.hdf5_reader import read
from fecm.results.result import result_of
from fecm.simulation.run import simulate
from fecm.sweeps import cases as inputs
from fecm.sweeps import plan as plans
from fecm.sweeps.api import carry_out, check_draws, problem_of
from fecm.sweeps.batch import deck_of
from fecm.sweeps.convergence import refined_cases
from fecm.sweeps.convergence import table as table_of
from fecm.sweeps.doubts import doubtful_values
from fecm.sweeps.random_result import tables
from fecm.sweeps.result import SweepResult, remarks, save, summary, verdict
from fecm.sweeps.schedule import LOST, PartialResults, SchedulerError, address_in, alone

NAMED = [f"{name}=" for name in inputs.NAMES]  # for the shell's completion


@click.command(
    epilog=typical(
        "fecm sweep impact-115.inp --vary velocity=50:150:11 --vary k=1e6,2e6",
        "fecm sweep drop-weight.inp --find velocity --until peak_force=threshold",
        "fecm sweep drop-weight.inp --random k=lognormal:42000,.2 --samples 200 "
        "--exceed peak_force=threshold",
    )
)
@click.argument("deck", type=DECK_PATH)
@option(
    "--vary",
    "varied",
    type=Parsed(inputs.parse_vary, "NAME=VALUES", NAMED),
    multiple=True,
    help="FROM:TO:N or A,B,C; may be repeated, for a full grid.  Names: "
    f"{', '.join(inputs.NAMES)}.",
)
@option(
    "--cases",
    "table",
    type=DECK_PATH,
    metavar="CASES.csv",
    help="A table instead of --vary: a header of names, one row per case.",
)
@option(
    "--refine",
    "factors",
    type=list_of("FACTOR,...", click.IntRange(1, 8)),
    metavar="1,2,4",
    help="Instead: divide the sides of all elements and DT by factors; order, limit and error "
    "band of every quantity.",
)
@option(
    "--random",
    "laws",
    type=Parsed(inputs.parse_random, "NAME=LAW", NAMED),
    multiple=True,
    help="Random value: normal:MEAN,SD, lognormal:MEDIAN,SIGMA, uniform:A,B or "
    "triangular:A,MODE,B; may be repeated, together with --vary.",
)
@option("--samples", type=int, metavar="N", help="Number of samples of --random.")
@option("--seed", type=int, metavar="S", help="Seed of --random.  [default: 0]")
@option(
    "--design",
    "kind",
    type=click.Choice(inputs.DESIGNS),
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
    "limits",
    type=Parsed(inputs.parse_exceed, "QUANTITY=VALUE"),
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
    type=Parsed(inputs.parse_until, "QUANTITY=VALUE"),
    help="What to reach: peak_force=NUMBER, peak_force=threshold (that of DELA), or "
    "exposure=NUMBER, the largest of FAIL outside the load, by full runs.",
)
@option(
    "-o",
    "--output",
    type=FILE_PATH,
    metavar="SWEEP.h5",
    help="Result file.  [default: the deck's name with -sweep.h5, in this folder]",
)
@option("--history", is_flag=True, help="Also store the contact force of every step.")
@option(
    "--measure",
    "extra",
    type=list_of("NAME,...", OneOf(plans.MEASURES)),
    default=(),
    help=f"Also store {', '.join(plans.MEASURES)}: the largest deflection, strains of gages "
    "(GAGE), exposures (FAIL).",
)
@option(
    "--full",
    type=list_of("CASE,...", click.IntRange(min=0)),
    help="Also run these cases in full, into SWEEP-CASE.h5; cases count from 0.",
)
@option(
    "--workers",
    type=click.IntRange(1, 1024),
    default=1,
    show_default=True,
    metavar="N",
    help="Worker processes on this machine.",
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
def sweep(
    deck: Path,
    varied: tuple[tuple[str, list[inputs.Value]], ...],
    table: Path | None,
    factors: tuple[int, ...] | None,
    laws: tuple[tuple[str, inputs.Law], ...],
    samples: int | None,
    seed: int | None,
    kind: inputs.DesignKind | None,
    sensitivity: bool,
    limits: tuple[inputs.Limit, ...],
    find: str | None,
    until: inputs.Until | None,
    output: Path | None,
    history: bool,
    extra: tuple[str, ...],
    full: tuple[int, ...] | None,
    workers: int,
    scheduler: str | None,
    scheduler_file: Path | None,
    allow_failed: bool,
    overwrite: bool,
) -> None:
    """Run DECK many times with varied parameters.

    Cases that differ only in the projectile, its velocity or the indentation law share one run of
    the plate.  The same command resumes an interrupted sweep.  The last line counts the cases that
    failed, those that ended in contact, and those that are beyond the range of the model.  The exit
    status is 1 if a case failed, or ended before a quantity of --exceed was known.
    """
    path = output or Path(f"{deck.stem}-sweep.h5")
    if factors and (varied or table or laws or until or extra):
        raise click.UsageError("--refine varies nothing else and measures no more")
    other = until is not None or laws or factors
    if bool(varied) == (table is not None) and (varied or not other):
        raise click.UsageError("give either --vary or --cases")
    if laws and table is not None:
        raise click.UsageError("--random goes with --vary, not with --cases")
    asked = {"--samples": samples, "--seed": seed, "--design": kind, "--exceed": limits}
    for name, value in {**asked, "--sensitivity": sensitivity}.items():
        if not laws and value not in (None, (), False):
            raise click.UsageError(f"{name} needs --random NAME=LAW")
    if laws and samples is None:
        raise click.UsageError("--random needs --samples N")
    if len(dict(laws)) < len(laws):
        raise click.UsageError("--random: a name is given twice")
    if (find is None) != (until is None):
        raise click.UsageError("--find velocity and --until QUANTITY=VALUE belong together")
    if (workers > 1) + (scheduler is not None) + (scheduler_file is not None) > 1:
        raise click.UsageError("give only one of --workers, --scheduler and --scheduler-file")
    if full and find:
        raise click.UsageError("--full runs given velocities: --vary velocity=FOUND --full 0")
    try:
        problem = problem_of(deck)
    except DeckError as error:
        echo(error, err=True)
        errors = [finding for finding in error.findings if finding.severity == "error"]
        raise RefusedError(f"{count_findings(errors)}; nothing was run") from None
    cases = inputs.grid(varied) if table is None else inputs.read_cases(table)
    if factors:
        cases, extra = refined_cases(problem, factors), (plans.DEFLECTION,)
    design = None
    if laws:
        design = inputs.design_of(
            dict(laws), samples, seed or 0, kind or "lhs", sensitivity=sensitivity
        )
        cases = inputs.random_cases(design, cases)
    chosen = tuple(dict.fromkeys(full or ()))
    if chosen and max(chosen) >= len(cases):
        raise click.UsageError(f"--full {max(chosen)}: the cases are 0 to {len(cases) - 1}")
    fulls = {case: path.with_name(f"{path.stem}-{case}{path.suffix}") for case in chosen}
    check_outputs([path, *fulls.values()], overwrite, [deck] if table is None else [deck, table])
    scheduler = scheduler if scheduler_file is None else address_in(scheduler_file)
    planned = plans.plan(
        problem, cases, history=history, until=until, extra=extra, design=design, limits=limits
    )
    check_draws(planned)
    note(*(() if factors else doubtful_values(problem, cases)))
    if design is not None:
        shared = plans.shares_plate(problem) and not planned.alone
        cost = inputs.cost(cases, design, shared=shared)
        note(*filter(None, (inputs.doubt(design), cost)))
    plans.check_memory(problem, planned, 0 if scheduler is not None else workers, streamed=True)
    if count := plans.freed(plans.tasks(problem, planned)):
        note(
            f"B is not zero in {count} case{'' if count == 1 else 's'}: u and v, which the deck "
            "restrains at every node, are free there except where w is held"
        )
    click.get_current_context().with_resource(alone(path))
    parts = PartialResults(path, planned.fingerprint(), restart=overwrite)
    result = _carry_out(problem, planned, parts, workers, scheduler)
    forces = parts.forces(plans.tasks(problem, planned)) if history else ()
    save(result, path, overwrite=overwrite, forces=forces)
    if lost := sum(status.startswith(LOST) for status in result["status"].tolist()):
        note(f"{lost} cases were lost with their workers; --overwrite runs them again")
    else:
        parts.clear()
    echo(result.title or "sweep")
    for line in (*summary(result), *table_of(result.cases, result.summary, result.convergence)):
        echo(f"  {line}")
    for line in () if result.random is None else tables(result.random, result.unit):
        echo(f"  {line}".rstrip())
    echo(f"  result            {path}")
    _run_in_full(planned, fulls, overwrite=overwrite)
    note(*(() if result.random is None else result.random.notes))
    note(*remarks(result))
    echo(verdict(result))
    is_open = result.random is not None and result.random.exceedance.open.any()
    if (is_open or not result.fine.all()) and not allow_failed:
        raise SystemExit(NO)


def _carry_out(
    problem: Problem,
    planned: plans.Plan,
    parts: PartialResults,
    workers: int,
    scheduler: str | None,
) -> SweepResult:
    """Run the plan with a progress bar; finished cases survive any interruption."""
    begin, finished = time.monotonic(), 0

    def rate(_: object) -> str:
        seconds = time.monotonic() - begin
        per_core = finished / seconds / workers if seconds else 0.0
        return f"{per_core:.3g} cases a second per worker" if finished else ""

    def done(task: plans.Task, outcome: plans.Outcome) -> None:
        nonlocal finished
        finished += len(task.numbers)
        advance(len(task.numbers))

    try:
        with signals.deferred(), progress("fecm", len(planned.cases), rate) as advance:

            def idle() -> None:
                signals.heed()
                advance(0)

            return carry_out(
                problem,
                planned,
                workers=workers,
                scheduler=scheduler,
                parts=parts,
                done=done,
                idle=idle,
                note=note,
            )
    except SchedulerError:
        parts.clear()
        raise
    except (KeyboardInterrupt, SystemExit):
        echo("fecm: the same command resumes this sweep", err=True)
        raise


def _run_in_full(planned: plans.Plan, fulls: dict[int, Path], *, overwrite: bool) -> None:
    """Run chosen cases with all rows that their deck stores."""
    for case, path in fulls.items():
        try:
            prepared = load_deck(deck_of(planned, case))
            if errors := prepared.errors(force=True):
                raise inputs.CasesError(errors[0].message)
            with hdf5_writer.writing(path, overwrite=overwrite) as sink:
                simulate(prepared.problems[0], sink)
        except (inputs.CasesError, ArithmeticError) as error:
            note(f"case {case} was not run in full: {error}")
            continue
        echo(f"  case {case:<12} {path}")
        note(*(f"case {case}: {text}" for text in result_of(read(path)).notes))
