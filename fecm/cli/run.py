"""``fecm run``."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import click
from click import option

from fecm.cli.common import (
    CheckFailedError,
    RefusedError,
    echo,
    echo_findings,
    echo_json,
    echo_summary,
    watching,
)
from fecm.cli.decks import refusing_errors
from fecm.cli.interrupts import signals
from fecm.cli.options import (
    DECK_PATH,
    FORMAT_OPTION,
    NAMED_PATH,
    POSITIVE,
    Finite,
    Format,
    GroupedCommand,
    groups_of,
    job_options,
    typical,
)
from fecm.cli.terminal import terminal
from fecm.mechanics.failure import CriterionError
from fecm.mechanics.own_law import LawError
from fecm.mechanics.plate_motion import DivergenceError
from fecm.mechanics.solutions import SingularStiffnessError
from fecm.problem.summary import larger_steps
from fecm.results.exposures import largest_exposures
from fecm.results.summary import RUN, RunJson, about_run, summary_of_run
from fecm.simulation.job import ProblemRun, Run

# Headings of the help page, with options of the command itself.
GROUPS: dict[str, list[str]] = {
    "Result": ["form"],
    "Model": [],
    "Computation": [],
    "Interrupted runs": [],
    "Limits": ["fail_limit"],
}


class ProblemRunJson(RunJson):
    """Run of a problem in JSON."""

    title: str
    result: str
    printed: str | None
    units: Annotated[dict[str, str], "Names of the units; empty if the deck names none."]


@click.command(
    "run",
    cls=GroupedCommand,
    groups=groups_of(Run, GROUPS),
    epilog=typical(
        "fecm run impact-patch.inp",
        "fecm run drop-weight.inp -o drop.h5 --overwrite --fail-limit 1",
    ),
)
@click.argument("deck", type=DECK_PATH)
@job_options(
    Run,
    output={
        "type": NAMED_PATH,
        "help": "Result file; a second problem goes to OUT-2.h5, and so on.  [default: the deck's "
        "name with .h5, in this folder]",
    },
    printed={"type": NAMED_PATH},
    threads={"type": click.IntRange(0, 1024)},
    energy_limit={"type": POSITIVE},
    checkpoint={"type": Finite(min=0.0)},
)
@option(
    "--fail-limit",
    type=POSITIVE,
    metavar="EXPOSURE",
    help="Exit with status 1 if an exposure of FAIL exceeds this value.",
)
@FORMAT_OPTION
def run_command(
    deck: Path, options: dict[str, Any], fail_limit: float | None, form: Format
) -> None:
    """Run every problem in DECK and write its result.

    The result of a second problem goes to OUT-2.h5, and so on.  An interrupted run leaves a
    checkpoint beside its output; --resume with the same options gives the same bytes.
    """
    options["output"] = options["output"] or Path(f"{deck.stem}.h5")
    with refusing_errors("; nothing was run"):
        run = Run(deck, **options)
    echo_findings(run.findings, run.source)
    jobs = run.problems
    if fail_limit is not None and not any(job.problem.work.passes["FAIL"] for job in jobs):
        raise RefusedError(f"--fail-limit needs the macro FAIL; {deck} has none")
    exceeded: list[str] = []
    for number, job in enumerate(jobs):
        if number and form is Format.TEXT and not terminal.is_quiet:
            echo()
        exposures = _run_and_print(job, form)
        if fail_limit is not None:
            exceeded += [f"{name}" for name, value in exposures if value > fail_limit]
    if exceeded:
        raise CheckFailedError(f"{'; '.join(exceeded)}: more than the limit of {fail_limit:g}")


def _run_and_print(job: ProblemRun, form: Format) -> list[tuple[str, float]]:
    """Run a problem and print its summary; return its largest exposures with their names."""
    path, title = job.path, job.problem.deck.title
    with (
        signals.deferred(),
        _messages(path),
        watching("fecm", job.problem.work.steps) as watch,
        job.executing(watch) as result,
    ):
        about, summary = about_run(result), summary_of_run(result)
        exposures = [
            (f"exposure {e.exposure:.4g} of {e.criterion}", e.exposure)
            for e in largest_exposures(result)
        ]
    if not job.complete and form is Format.JSON:
        named = {"title": title, "result": str(path), "printed": job.printed}
        echo_json({**named, "units": result.units, **about})
    elif not (job.complete or terminal.is_quiet):
        files = {"result": job.path, "printed": job.printed}
        paths = [(label, str(path)) for label, path in files.items() if path is not None]
        echo_summary(summary.with_rows(RUN, *larger_steps(job.problem), *paths))
    watch.close()
    return [] if job.complete else exposures


@contextlib.contextmanager
def _messages(path: Path | None) -> Iterator[None]:
    """Add to the errors of a run that its result was not written."""
    end = f"; {path} was not written"
    try:
        yield
    except (LawError, CriterionError) as error:
        raise RefusedError(f"{error}{end}") from None
    except SingularStiffnessError as error:
        raise RefusedError(f"{error}: {error.remedy}{end}") from None
    except DivergenceError as diverged:
        raise CheckFailedError(
            f"the run diverged at step {diverged.step}: {diverged.reason}{end}"
        ) from None
