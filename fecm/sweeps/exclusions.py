"""Options of a sweep that exclude each other, or need another one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from typing import TYPE_CHECKING, NamedTuple

from fecm._options import declared_options
from fecm.authoring.case import CasesError
from fecm.sweeps.search import Sought, search_of
from fecm.sweeps.task import REDUCED, Measure

if TYPE_CHECKING:
    from fecm.sweeps.job import Sweep

# Names of what is given beside the options themselves.
FUNCTION = "a function as measure"
FAILURE = "failure as measure"
PEAK = "until of the peak force"
REDUCED_MODEL = f"`model` {REDUCED}"
SEVERAL = "several workers"


class Exclusion(NamedTuple):
    """Option, the options that it excludes, and the reason."""

    option: str
    others: tuple[str, ...]
    reason: str


class Need(NamedTuple):
    """Options that need another one, and the reason."""

    options: tuple[str, ...]
    needed: str
    reason: str


EXCLUSIONS = (
    Exclusion("deck", ("build",), "build makes the deck of every case"),
    Exclusion("vary", ("cases",), "a table has all cases"),
    Exclusion("cases", ("random",), "random values go with `vary`"),
    Exclusion(
        "refine",
        ("vary", "cases", "random", "until", "build", "measure"),
        "a study of the mesh varies nothing else, and measures what it needs",
    ),
    Exclusion("sensitivity", ("correlation",), "Sobol' indices need independent values"),
    Exclusion("until", ("build", FUNCTION), "a search varies the velocity of the deck"),
    Exclusion("until", ("full",), "run the velocity found: `vary` velocity=FOUND and `full` 0"),
    Exclusion(PEAK, (FAILURE,), "exposures need full runs, and this search takes none"),
    Exclusion(
        REDUCED_MODEL,
        ("build", FUNCTION),
        "the reduced model is of one deck, and stores no result for a function",
    ),
    Exclusion("scheduler", ("executor", SEVERAL), "the cases are computed in one place"),
    Exclusion("executor", (SEVERAL,), "the cases are computed in one place"),
)
OF_RANDOM = ("correlation", "samples", "seed", "design", "sensitivity", "exceed")
NEEDS = (
    Need(OF_RANDOM, "random", "they describe random values"),
    Need(("random",), "samples", "a design has a number of samples"),
    Need(("modes",), REDUCED_MODEL, "they are the modes of the reduced model"),
)


def check_options(job: Sweep) -> None:
    """Raise CasesError if options exclude each other, lack another one, or have the wrong type."""
    _check_types(job)
    options_given = _given(job)
    for option, excluded, reason in EXCLUSIONS:
        for other in excluded:
            if {option, other} <= options_given:
                raise CasesError(f"{_quoted(option)} excludes {_quoted(other)}: {reason}")
    for options, needed, reason in NEEDS:
        if needed not in options_given and (
            lacking := [name for name in options if name in options_given]
        ):
            raise CasesError(f"{_quoted(lacking[0])} needs {_quoted(needed)}: {reason}")
    if not options_given & {"deck", "build"}:
        raise CasesError("give either deck or build")
    if not options_given & {"vary", "cases", "random", "until", "refine"}:
        raise CasesError("a sweep needs `vary`, `cases`, `random`, `refine` or `until`")


def exclusions_table() -> list[str]:
    """Return the rows of the table in the docs."""
    lines = ["| option | not with | because |", "|---|---|---|"]
    lines += [f"| {_quoted(o)} | {', '.join(map(_quoted, b))} | {r} |" for o, b, r in EXCLUSIONS]
    lines += ["", "| option | needs | because |", "|---|---|---|"]
    return [
        *lines,
        *(f"| {', '.join(map(_quoted, o))} | {_quoted(n)} | {r} |" for o, n, r in NEEDS),
    ]


def _given(job: Sweep) -> set[str]:
    """Return the names of the options that are given."""
    names = {"deck"} if job.deck is not None else set()
    for name, (_, default) in declared_options(job).items():
        value = getattr(job, name)
        is_simple = isinstance(value, str | int)
        if value is None or value is False or (isinstance(value, tuple) and not value):
            continue
        if not (is_simple and value == default):
            names.add(name)
    if callable(job.measure):
        names.add(FUNCTION)
    elif isinstance(job.measure, str | Sequence) and Measure.FAILURE in job.measure:
        names.add(FAILURE)
    search = search_of(job.until)
    if search is not None and search.quantity is Sought.PEAK_FORCE:
        names.add(PEAK)
    if job.model == REDUCED:
        names.add(REDUCED_MODEL)
    if (job.workers or 1) > 1:
        names.add(SEVERAL)
    return names


def _check_types(job: Sweep) -> None:
    """Raise CasesError if an option is not of its type."""
    if job.build is not None and not callable(job.build):
        raise CasesError(f"build is {job.build!r}, not a function")
    if job.executor is not None and not isinstance(job.executor, Executor):
        raise CasesError(f"executor is {job.executor!r}, not a concurrent.futures.Executor")
    if job.progress is not None and not (isinstance(job.progress, bool) or callable(job.progress)):
        raise CasesError(f"progress is {job.progress!r}, not a function")
    laws = job.random
    if laws is not None and laws != () and not (laws and isinstance(laws, Mapping | Sequence)):
        example = '{"k": "uniform:1e6,2e6"}'
        raise CasesError(f"random is {job.random!r}; write a mapping such as {example}")


def _quoted(option: str) -> str:
    """Mark the name of an argument, which the command line replaces by its own."""
    return f"`{option}`" if option.isidentifier() else option
