"""``fecm sweep``."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import click
from click import option

from fecm.authoring.case import CasesError
from fecm.authoring.values import NAMES
from fecm.cli.common import (
    FAILED,
    TerminalWatch,
    echo,
    echo_json,
    echo_path,
    echo_summary,
    every_minute,
    inform,
    note,
    watching,
)
from fecm.cli.decks import refusing_errors
from fecm.cli.interrupts import signals
from fecm.cli.options import (
    DECK_PATH,
    FORMAT_OPTION,
    NAMED_PATH,
    Format,
    GroupedCommand,
    OneOf,
    Parsed,
    groups_of,
    job_options,
    list_of,
    typical,
)
from fecm.cli.terminal import terminal
from fecm.mechanics.own_law import LawError
from fecm.results.summary import RUN
from fecm.simulation.job import ProblemRun
from fecm.sweeps.about import about_sweep
from fecm.sweeps.distributions import FORMS
from fecm.sweeps.execute import address_in
from fecm.sweeps.job import Sweep
from fecm.sweeps.reduced import MOST_MODES
from fecm.sweeps.result import SweepResult
from fecm.sweeps.search import parse_until
from fecm.sweeps.summary import remarks, summary_of_sweep, sweep_verdict
from fecm.sweeps.task import MEASURES

# For the shell's completion.
NAMED = [f"{name}=" for name in NAMES]
RANGES = ("FROM:TO:N", "A,B,C")

# Headings of the help page, with options of the command itself.
GROUPS: dict[str, list[str]] = {
    "Cases": [],
    "Random values": [],
    "Search": ["find"],
    "Result": ["form"],
    "Computation": ["scheduler_file"],
}


def _texts(form: str, values: Iterable[str] = (), forms: Sequence[str] = ()) -> dict[str, Any]:
    """Return the settings of an option that takes several texts, which the sweep parses."""
    return {"type": Parsed(str, form, values, forms), "multiple": True}


@click.command(
    "sweep",
    cls=GroupedCommand,
    groups=groups_of(Sweep, GROUPS),
    epilog=typical(
        "fecm sweep impact-patch.inp --vary velocity=50:150:11 --vary k=1e6,2e6",
        "fecm sweep drop-weight-held.inp --find velocity --until peak_force=threshold",
        "fecm sweep drop-weight-held.inp --random k=lognormal:42000,.2 --samples 200 "
        "--exceed peak_force=threshold",
    ),
)
@click.argument("deck", type=DECK_PATH)
@job_options(
    Sweep,
    vary=_texts("NAME=VALUES", NAMED, RANGES),
    cases={"type": DECK_PATH},
    refine={"type": list_of("FACTOR,...", click.IntRange(1, 8))},
    random=_texts("NAME=LAW", NAMED, FORMS),
    correlation=_texts("NAME,NAME=RHO", NAMES),
    samples={"type": int},
    exceed=_texts("QUANTITY=VALUE"),
    until={"type": Parsed(parse_until, "QUANTITY=VALUE")},
    measure={"type": list_of("NAME,...", OneOf(MEASURES))},
    modes={"type": click.IntRange(1, MOST_MODES)},
    workers={
        "type": click.IntRange(1, 1024),
        "default": None,
        "help": "Worker processes on this machine.  [default: one for each free processor, if the "
        "sweep takes more than some seconds]",
    },
    output={
        "type": NAMED_PATH,
        "help": "Result file.  [default: the deck's name with -sweep.h5, in this folder]",
    },
    full={"type": list_of("CASE,...", click.IntRange(min=0)), "multiple": False, "default": ()},
)
@option(
    "--find",
    type=click.Choice(["velocity", "energy"]),
    help="Search in every case for the velocity and the energy at which --until holds.",
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
@FORMAT_OPTION
def sweep_command(
    deck: Path,
    options: dict[str, Any],
    find: str | None,
    scheduler_file: Path | None,
    allow_failed: bool,
    form: Format,
) -> None:
    """Run DECK many times with varied parameters.

    Cases that differ only in the projectile, its velocity or the indentation law share one run of
    the plate; with NONL each takes a full run.  The same command resumes an interrupted sweep.  The
    last line counts the cases that failed, those that ended in contact, and those that are beyond
    the range of the model.  The exit status is 1 if a case failed, or ended before a quantity of
    --exceed was known.
    """
    if (find is None) != (options["until"] is None):
        raise click.UsageError("--find velocity and --until QUANTITY=VALUE belong together")
    if scheduler_file is not None:
        if options["scheduler"] is not None:
            raise click.UsageError("give only one of --scheduler and --scheduler-file")
        options["scheduler"] = address_in(scheduler_file)
    options["output"] = options["output"] or Path(f"{deck.stem}-sweep.h5")
    with refusing_errors("; nothing was run"):
        job = Sweep(deck, **options)
    note(*job.doubts)
    inform(*job.expectation())
    result, watch = _computed(job)
    shows = form is Format.TEXT and not terminal.is_quiet
    if shows:
        echo_summary(summary_of_sweep(result).with_rows(RUN, ("result", str(job.path))))
    for case, run in job.full_runs().items():
        _run_in_full(case, run, shows=shows)
    if shows:
        echo(f"\n{sweep_verdict(result)}")
    elif form is Format.JSON:
        echo_json(about_sweep(result, job.path))
    watch.close()
    if result.random is not None:
        note(*result.random.notes)
    note(*remarks(result))
    is_open = result.random is not None and result.random.exceedance.open.any()
    if (is_open or not result.completed.all()) and not allow_failed:
        raise SystemExit(FAILED)


def _computed(job: Sweep) -> tuple[SweepResult, TerminalWatch]:
    """Compute the cases with a progress bar that shows the rate; the watch has its notes."""
    begin = time.monotonic()
    workers = job.workers

    def rate(done: int) -> str:
        seconds = time.monotonic() - begin
        each = "" if workers is None else " per worker"
        return f"{done / seconds / (workers or 1):.3g} cases a second{each}" if done else ""

    with (
        signals.deferred(),
        watching("fecm", len(job.all_cases), rate) as watch,
    ):
        return job.compute(watch, keeps_forces=False), watch


class _EndingWatch(TerminalWatch):
    """Watch that lets a signal end the program at once; notes wait for the end of the run."""

    def stops(self) -> bool:
        """End the program if a signal came."""
        signals.heed()
        return False


def _run_in_full(case: int, run: ProblemRun, *, shows: bool) -> None:
    """Run a case with all rows that its deck stores."""
    watch = _EndingWatch(lambda steps: None)
    try:
        with (
            signals.deferred(),
            every_minute(f"fecm: case {case} is run in full, {{}} min so far".format),
            run.executing(watch) as result,
        ):
            notes = result.notes
    except (CasesError, LawError, ArithmeticError) as error:
        note(f"case {case} was not run in full: {error}")
        return
    except (KeyboardInterrupt, SystemExit):
        note(f"case {case} was not run in full: a signal stopped the program")
        raise
    if shows:
        echo_path(run.path, f"  case {case:<12} ")
    note(*(f"case {case}: {text}" for text in notes))
