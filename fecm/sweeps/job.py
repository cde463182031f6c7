"""Sweeps as jobs: cases, checks, outputs, price, execution, resume."""

from __future__ import annotations

import contextlib
import pickle
import sys
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from fecm._files import beside, check_outputs
from fecm._options import documented, option, with_parameters_of
from fecm._table import Row, html_summary
from fecm._watch import LOGGER, CallerWatch, Progress, Watch
from fecm.authoring.case import Case, CasesError
from fecm.authoring.values import NAMES
from fecm.deck.catalogue import system_of
from fecm.mechanics.contact_law import Law
from fecm.mechanics.own_law import own_law
from fecm.problem.build import RunOptions
from fecm.problem.loading import AnyDeck, LoadedDeck, load_again, load_deck, sole
from fecm.problem.problem import Problem
from fecm.simulation.job import Price, ProblemRun
from fecm.sweeps.case_tables import (
    CaseTable,
    index_of,
    table_of_cases,
    texts_of,
)
from fecm.sweeps.checks import (
    check_sweep_memory,
    doubtful_values,
    freed,
    sweep_memory,
    unused_values,
)
from fecm.sweeps.convergence import refined_cases
from fecm.sweeps.distributions import FORMS, OwnDistribution, distribution_of
from fecm.sweeps.exclusions import check_options
from fecm.sweeps.execute import LOST, Done, Means, SchedulerError, carry_out_plan
from fecm.sweeps.files import write_sweep
from fecm.sweeps.in_full import built, case_deck
from fecm.sweeps.limits import Limit, parse_exceed
from fecm.sweeps.outcome import MeasuredColumn, Outcome, Status
from fecm.sweeps.partial_results import PartialResults
from fecm.sweeps.plan import plan
from fecm.sweeps.price import output_bytes
from fecm.sweeps.random import (
    DESIGNS,
    REMEDY,
    Design,
    DesignKind,
    Pair,
    correlation_of,
    design_of,
    doubt,
    parse_correlation,
    random_cases,
)
from fecm.sweeps.result import SweepResult
from fecm.sweeps.search import with_level
from fecm.sweeps.task import (
    MEASURES,
    MODELS,
    MODES,
    BuildFunction,
    Measure,
    MeasureFunction,
    Plan,
    Task,
    tasks,
)

Named = str | Sequence[str]  # one text of the form NAME=..., or several


@documented
@dataclass(eq=False, repr=False)
class Sweep:
    """Deck with many cases, ready to be computed.

    Cases that differ only in the projectile, its velocity or the contact law share one run of the
    plate. On a nonlinear plate (NONL) each case is one full run, and each search about five. Deck,
    cases, options and output files are checked at once. :attr:`price` says what the sweep takes,
    :attr:`doubts` lists what looks like a mistake, and :meth:`execute` computes it.

    Parameters
    ----------
    deck : str, Path or Deck
        Deck with a single problem; not with `build`.
    {parameters}

    Attributes
    ----------
    all_cases : tuple of dict
        Values of every case, by name.
    problem : Problem
        The problem of the deck, checked.

    Raises
    ------
    CasesError
        If the cases are invalid, options exclude each other, or no case has a deck.
    DeckError
        If the deck has errors.
    LawError
        If `law` lacks a method; where it fails in a case, that is the status of the case.
    ExtensionError
        If no installed package has an entry point of the name `law`.
    FileExistsError
        If an output file exists and may not be replaced.
    OSError
        If a file can't be read or written.

    Examples
    --------
    >>> job = Sweep("decks/impact-115.inp", {"velocity": [50.0, 115.0]}, progress=True)
    >>> len(job.all_cases)
    2
    >>> result = job.execute()  # doctest: +SKIP
    """

    deck: AnyDeck | None = None
    vary: Mapping[str, Sequence[Any]] | Named | None = option(
        None,
        "Values by name, FROM:TO:N or A,B,C, also with a unit, as in energy=5J:30J:6; all "
        f"combinations are run.  Names: {', '.join(NAMES)}.",
        form='Mapping of names to values, as in ``{"velocity": [50.0, 115.0]}``, or to texts; or '
        'texts, as in ``"velocity=50,115"``.',
        group="Cases",
    )
    cases: Iterable[Mapping[str, Any]] | CaseTable | Path | None = option(
        None,
        "A table instead: a header of names, one row per case.",
        python="The path of a CSV file, a mapping for each case, or a DataFrame.",
        group="Cases",
        metavar="CASES.csv",
    )
    _: KW_ONLY
    refine: Sequence[int] | None = option(
        None,
        "Instead: divide the sides of all elements and DT by factors of 1, 2, 4 and 8; order, "
        "limit and error band of every quantity.",
        group="Cases",
        metavar="1,2,4",
    )
    random: Mapping[str, str | OwnDistribution] | Named | None = option(
        None,
        f"Random value by its law: {', '.join(FORMS[:-1])} or {FORMS[-1]}.  With vary all "
        "combinations get the same draws.",
        form='Mapping of names to laws, as in ``{"k": "lognormal:1.9e6,.15"}``; a law is a text or '
        "an object whose method ppf or icdf gives its quantiles, such as a distribution of "
        "scipy.stats with its parameters.",
        group="Random values",
    )
    correlation: Mapping[Pair, float] | ArrayLike | CaseTable | Named | None = option(
        None,
        "Correlation of two random values (of their normal scores, if their laws are not normal).",
        python="By pairs of names, or as a matrix in the order of `random`.",
        group="Random values",
    )
    samples: int | None = option(
        None, "Number of samples of the design.", group="Random values", metavar="N"
    )
    seed: int = option(0, "Seed of the design.", group="Random values", metavar="S")
    design: DesignKind = option(
        "lhs",
        "Design: Latin hypercube, Sobol' sequence, or independent draws (Monte Carlo).",
        group="Random values",
        choices=DESIGNS,
    )
    sensitivity: bool = option(
        False,
        "Sobol' indices of the random values, from N times (their number + 2) cases.",
        group="Random values",
    )
    exceed: Mapping[str, float | str | Sequence[float]] | Named | None = option(
        None,
        "Probability that a quantity of the summary exceeds a value; of peak_force also "
        "threshold, DELA's.",
        form='Mapping of quantities to values, as in ``{"peak_force": 5000.0}``, or texts.',
        group="Random values",
    )
    until: float | Literal["threshold"] | Mapping[str, float | str] | None = option(
        None,
        "Search in every case for the velocity at which a quantity is reached: peak_force=NUMBER, "
        "peak_force=threshold (DELA's), or exposure=NUMBER, the largest of FAIL outside the "
        "load, by full runs.",
        form='A peak force, ``"threshold"``, or a mapping, as in ``{"exposure": 1.0}``.',
        group="Search",
    )
    history: bool = option(False, "Also store the contact force of every step.", group="Result")
    build: BuildFunction | None = option(
        None,
        "Takes a case, a dict, and returns its Deck, instead of `deck`.  Names and values are then "
        "any.  Each case is run in full with the DT of its own deck; an exception is the status of "
        "the case.  The units of all decks must be the same.",
    )
    measure: MeasureFunction | str | Sequence[str] | None = option(
        None,
        f"Also store {', '.join(MEASURES)}: the largest deflection, strains of gages (GAGE), "
        "exposures (FAIL).",
        python="Or a function of the Result of a case that returns numbers by name; each case is "
        "then run in full, with all that its deck stores.",
        group="Result",
    )
    model: Literal["reduced", "full"] | None = option(
        None,
        "Compute the cases of a nonlinear plate (NONL) together, in a few bending modes, or each "
        "by a full run; by default in modes where that saves time and full runs agree.",
        group="Computation",
        choices=MODELS,
    )
    modes: int | None = option(
        None,
        f"Bending modes of the reduced model, by default {MODES}.",
        group="Computation",
        metavar="M",
    )
    workers: int | None = option(
        1,
        "Worker processes on this machine.",
        python="None: one for each free processor, if the sweep takes more than some seconds.  A "
        'script with several workers needs `if __name__ == "__main__"`.',
        group="Computation",
        metavar="N",
    )
    scheduler: object = option(
        None,
        "Running Dask scheduler, as in tcp://host:8786, to use instead.",
        python="Or a client or cluster of Dask.",
        group="Computation",
        metavar="ADDRESS",
    )
    executor: Executor | None = option(
        None, "Pool of threads or processes, or another executor.  It is not shut down."
    )
    output: str | Path | None = option(
        None, "Result file.", group="Result", metavar="SWEEP.h5", flag="-o"
    )
    overwrite: bool = option(False, "Replace existing results.", group="Result")
    progress: Progress | bool | None = option(
        None,
        "Called with the number of finished cases and the number of all; True shows them on "
        "standard error, with the seconds that are left.",
    )
    law: Law | str | None = option(
        None,
        "Contact law of all cases instead of EXPE: the name that an installed package gives it "
        "(entry points of the group fecm.laws).",
        python="Or an object with the methods of Law.  Each case then asks the law in Python at "
        "every step.",
        group="Computation",
        metavar="NAME",
    )
    full: Sequence[int] = option(
        (),
        "Also run these cases in full, into SWEEP-CASE.h5; cases count from 0.",
        group="Result",
    )
    resume: bool = option(
        True,
        "Take the finished cases of an interrupted sweep with the same output.  Cases of functions "
        "and objects of the caller are always computed.",
    )

    def __post_init__(self) -> None:
        self._means = Means(self.workers, self.scheduler, self.executor)
        check_options(self)
        own_measure, measures = _measures(self.measure)
        law = own_law(self.law)
        loaded = None
        if self.deck is not None:
            loaded = _loaded(self.deck)
        cases, design, measured = self._cases(loaded)
        self._check_sendable(own_measure, law)
        self._loaded = loaded or _first_built(self.build, cases)
        self.problem: Problem = self._loaded.problems[0]
        if self.refine is not None:
            cases, measures = refined_cases(self.problem, self.refine), (Measure.DEFLECTION,)
        self._prepare_outputs(len(cases))
        system = system_of(self.problem.deck)
        self.plan: Plan = plan(
            self.problem,
            cases,
            history=self.history,
            until=with_level(self.until, system),
            build=self.build,
            measure=own_measure,
            extra=measures,
            design=design,
            limits=_limits(self.exceed, system),
            model=_checked_model(self.model),
            modes=MODES if self.modes is None else self.modes,
            law=law,
            measured=measured,
        )
        check_draws(self.plan)

    def _cases(
        self, loaded: LoadedDeck | None
    ) -> tuple[list[Case], Design | None, Mapping[str, MeasuredColumn]]:
        """Return the cases, the design of random cases, and the measured columns of a table."""
        free = self.build is not None
        system = None if loaded is None else system_of(loaded.problems[0].deck)
        cases, measured = table_of_cases(self.vary, self.cases, free=free, system=system)
        if not self.random:
            return cases, None, measured
        named = _by_name("random", self.random, "NAME=LAW")
        laws = {name: distribution_of(name, law, free=free) for name, law in named.items()}
        correlation: Any = self.correlation
        if pairs := texts_of(correlation):
            parsed = [parse_correlation(text) for text in pairs]
            if len(correlation := dict(parsed)) < len(parsed):
                raise CasesError("`correlation`: a pair is given twice")
        is_given = correlation is not None and not isinstance(correlation, tuple)
        joined = correlation_of([*laws], correlation) if is_given else ()
        design = design_of(
            laws,
            self.samples,
            self.seed,
            self.design,
            sensitivity=self.sensitivity,
            correlation=joined,
        )
        return random_cases(design, cases), design, measured

    def _check_sendable(self, measure: MeasureFunction | None, law: Law | None) -> None:
        """Refuse functions that worker processes can't import."""
        spawns = not self._means.is_chosen and (self.workers is None or self.workers > 1)
        if not (spawns or isinstance(self.executor, ProcessPoolExecutor)):
            return
        for name, function in {"build": self.build, "measure": measure, "law": law}.items():
            try:
                pickle.dumps(function)
            except Exception:  # pickle raises several types
                hint = "define it at the top level of a module"
                raise CasesError(f"{name} can't be sent to worker processes; {hint}") from None
            is_of_script = getattr(function, "__module__", "") == "__main__"
            if spawns and is_of_script and not hasattr(sys.modules["__main__"], "__file__"):
                where = "in an interactive session, where worker processes can't import it"
                hint = "define it in a module, or use an executor of threads"
                raise CasesError(f"{name} is defined {where}; {hint}")

    def _prepare_outputs(self, count: int) -> None:
        """Check the output files."""
        chosen = tuple(dict.fromkeys(self.full))
        if chosen and max(chosen) >= count:
            raise CasesError(f"`full` {max(chosen)}: the cases are 0 to {count - 1}")
        self.path: Path | None = None if self.output is None else Path(self.output)
        self.full_paths: dict[int, Path] = {}
        if self.path is None:
            if chosen:
                raise CasesError("`full` needs an output file")
            return
        name = self.path
        self.full_paths = {
            case: name.with_name(f"{name.stem}-{case}{name.suffix}") for case in chosen
        }
        inputs = [Path(self._loaded.source)]
        if isinstance(self.cases, str | Path):
            inputs.append(Path(self.cases))
        check_outputs([name, *self.full_paths.values()], self.overwrite, inputs)

    @property
    def all_cases(self) -> tuple[Case, ...]:
        """Values of every case, by name."""
        return self.plan.cases

    @property
    def title(self) -> str:
        """Title of the deck."""
        return self.problem.deck.title or "sweep"

    @cached_property
    def doubts(self) -> tuple[str, ...]:
        """Sentences about values that look like a mistake, or that change nothing."""
        design = self.plan.design
        texts = []
        if self.build is None and self.refine is None:
            cases = self.all_cases
            texts += [*unused_values(self.plan), *doubtful_values(self.problem, cases)]
        if design is not None and (text := doubt(design)):
            texts.append(text)
        if self.build is None and (count := freed(self.plan)):
            texts.append(
                f"B is not zero in {count} case{'' if count == 1 else 's'}: u and v, which the "
                "deck restrains at every node, are free there except where w is held"
            )
        return tuple(texts)

    @property
    def _streams(self) -> bool:
        """Whether outcomes can be stored and read again; functions of the caller forbid it."""
        is_own = self.law is not None and not isinstance(self.law, str)
        return self.path is not None and not (self.build or callable(self.measure) or is_own)

    def expectation(self) -> list[str]:
        """Say how many runs of the plate the cases take.

        On a nonlinear plate, say how long they take, too.
        """
        workers = 0 if self.scheduler is not None else self.workers
        return self.plan.method.expectation(self.problem, self.plan, workers)

    @cached_property
    def price(self) -> Price:
        """What the sweep takes. The time is estimated from its first cases.

        Steps are steps of the plate: cases that share a plate take its steps once.
        """
        problem, definition = self.problem, self.plan
        steps, seconds = definition.method.work(problem, definition)
        if not self._means.is_chosen:
            seconds /= max(1, min(self.workers or 1, len(tasks(definition))))
        memory = sweep_memory(problem, definition, self._means.here, streamed=self._streams)
        return Price(steps, output_bytes(problem, definition), memory.needed(), seconds)

    def execute(self, watch: Watch | None = None) -> SweepResult:
        """Compute the cases that are not stored, write the result, and run the cases of `full`.

        Parameters
        ----------
        watch : Watch, optional
            Gets the progress and the notes, and may stop the sweep.  Without one the progress goes
            to `progress`, and the warnings of the deck, :attr:`doubts` and the notes of the result
            are :class:`FecmWarning`.

        Returns
        -------
        SweepResult
            One row per case, in the order of the cases.

        Raises
        ------
        CasesError
            If `measure` returns different names in different cases, or the reduced model holds for
            no case.
        NotEnoughMemoryError
            If the sweep needs more memory than is free; a MemoryError.
        SchedulerError
            If the scheduler can't be used.
        OtherSweepError
            If there are finished cases of another sweep with the same output.
        StoppedError
            If the watch stops the sweep.  With an output file, the message says how to resume it.
        KeyboardInterrupt
            After an interrupt, without a watch.
        OSError
            If a file can't be written.
        """
        caller = CallerWatch(self.title, self.progress)
        defers_interrupts = watch is None and self.path is not None
        watch = watch or caller
        for text in (*self._loaded.warnings, *self.doubts):
            watch.note(text)
        with contextlib.ExitStack() as stack:
            if defers_interrupts:
                stack.enter_context(caller.deferring_interrupts())
            result = self.compute(watch)
        watch.note(*result.notes)
        for run in self.full_runs().values():
            run.execute(watch)
        return result

    def compute(self, watch: Watch, *, keeps_forces: bool = True) -> SweepResult:
        """Compute the cases that are not stored and write the result; see :meth:`execute`.

        Without `keeps_forces`, the forces of `history` are only in the file.
        """
        streams = self._streams and not keeps_forces
        check_sweep_memory(self.problem, self.plan, self._means.here, streamed=streams)
        LOGGER.info("%s: %d cases", self.title, len(self.all_cases))
        parts = None
        with contextlib.ExitStack() as stack:
            partial = None
            if self.path is not None:  # no other process writes the same output meanwhile
                partial = stack.enter_context(beside(self.path, overwrite=self.overwrite))
            if self._streams and self.path is not None:
                parts = PartialResults(
                    self.path, self.plan.fingerprint(), restart=self.overwrite, resume=self.resume
                )
            result = self._computed(parts, watch, keeps_forces=keeps_forces or parts is None)
            result.index = index_of(self.cases)
            if partial is not None and self.path is not None:
                stored = parts if parts and self.history and result.force is None else None
                write_sweep(result, partial, self.path, () if stored is None else stored.forces())
        if parts is not None:
            _clear(parts, result, watch)
        return result

    def _computed(
        self, parts: PartialResults | None, watch: Watch, *, keeps_forces: bool
    ) -> SweepResult:
        """Compute the cases; delete the partial results of a sweep that can't be computed.

        If workers are missing, finished tasks are kept.
        """
        done = _same_names() if callable(self.measure) else lambda task, outcome: None
        try:
            return carry_out_plan(
                self.problem,
                self.plan,
                self._means,
                parts=parts,
                watch=watch,
                done=done,
                keeps_forces=keeps_forces,
            )
        except CasesError:
            if parts is not None:
                parts.clear()
            raise
        except SchedulerError:
            if parts is not None and not parts.has_tasks:
                parts.clear()
            raise

    def full_runs(self) -> dict[int, ProblemRun]:
        """Return the runs of the cases of `full`, with all rows that their deck stores, by number.

        Raises CasesError if the deck of a case has errors.
        """
        runs = {}
        for case, path in self.full_paths.items():
            loaded = load_deck(case_deck(self.plan, case))
            if errors := loaded.errors(force=True):
                raise CasesError(errors[0].message)
            options = RunOptions(law=self.plan.settings.law)
            runs[case] = ProblemRun(loaded.problems[0], options, path, overwrite=self.overwrite)
        return runs

    def __repr__(self) -> str:
        return f"<fecm sweep of {self._loaded.source}: {len(self.all_cases)} cases>"

    def _repr_html_(self) -> str:
        """Return a table of names, output and price, for notebooks."""
        names = ", ".join(self.all_cases[0])
        rows: list[Row] = [("title", self.title), ("names", names), ("price", str(self.price))]
        rows += [("result", str(self.path))] * (self.path is not None)
        rows += (("doubt", text) for text in self.doubts)
        return html_summary(self, rows)


def _loaded(deck: AnyDeck) -> LoadedDeck:
    loaded = load_again(deck)
    loaded.refuse_errors(force=True)
    sole(loaded.problems, loaded.source)
    return loaded


def _clear(parts: PartialResults, result: SweepResult, watch: Watch) -> None:
    """Delete the partial results of a sweep that is written, unless cases are lost."""
    lost = sum(status.startswith(LOST) for status in result["status"].tolist())
    if lost:
        text = f"{lost} cases were lost with their workers"
        watch.note(f"{text}; overwrite=True runs them again")
    else:
        parts.clear()


def _first_built(build: BuildFunction | None, cases: Sequence[Case]) -> LoadedDeck:
    """Return the first deck that can be built, which gives the units and the memory of a case."""
    assert build is not None  # as the options are checked
    first = ""
    for case in cases:
        try:
            return built(build, case)
        except CasesError as error:
            first = first or str(error)
    raise CasesError(f"no case has a deck; case 0: {first}")


def check_draws(planned: Plan) -> None:
    """Raise CasesError if the least or largest draw of a sensitivity study is impossible."""
    design = planned.design
    if design is None or not design.sensitivity or planned.settings.build is not None:
        return
    for name in design.laws:
        values = [case[name] for case in planned.cases[: design.draws]]
        for value in (min(values), max(values)):
            try:
                case_deck(planned, values.index(value))
            except CasesError as error:
                text = f"{name} {value:.6g}: {str(error).rstrip('.')}; sensitivity needs all draws"
                raise CasesError(f"{text}; {REMEDY}") from None


def _checked_model(model: str | None) -> str | None:
    """Return the name of a model; CasesError if there is no such model."""
    if model is not None and model not in MODELS:
        raise CasesError(f"unknown model {model!r}; there are {' and '.join(map(repr, MODELS))}")
    return model


def _measures(
    measure: MeasureFunction | str | Sequence[str] | None,
) -> tuple[MeasureFunction | None, Sequence[str]]:
    """Return the function or the names that were given as `measure`."""
    if callable(measure):
        return measure, ()
    if measure is None:
        return None, ()
    names = (measure,) if isinstance(measure, str) else measure
    if not (isinstance(names, Sequence) and all(isinstance(name, str) for name in names)):
        raise CasesError(f"measure is {measure!r}, not a function or names")
    return None, names


def _by_name(option: str, argument: Any, form: str) -> dict[str, Any]:
    """Return values by name, from a mapping or from texts of a form."""
    if isinstance(argument, Mapping):
        return dict(argument)
    pairs = [text.partition("=")[::2] for text in texts_of(argument)]
    if not pairs or not all(name.strip() and value for name, value in pairs):
        raise CasesError(f"{option} is {argument!r}; write {form}, or a mapping of names to values")
    values = {name.strip(): value.strip() for name, value in pairs}
    if len(values) < len(pairs):
        raise CasesError(f"`{option}`: a name is given twice")
    return values


def _limits(exceed: Any, system: str | None) -> tuple[Limit, ...]:
    """Return limits of quantities, from texts or from values by name."""
    if texts := texts_of(exceed):
        return tuple(parse_exceed(text, system) for text in texts)
    if not isinstance(exceed or {}, Mapping):
        raise CasesError(f'exceed is {exceed!r}; write {{"peak_force": [100.0]}} or the like')
    return tuple(
        parse_exceed(f"{name}={value}", system)
        for name, limit in (exceed or {}).items()
        for value in np.atleast_1d(limit).tolist()
    )


def _same_names() -> Done:
    """Return a function that raises CasesError if `measure` returns different names."""
    first: dict[str, int] = {}  # case by the names that it was the first to have

    def check(task: Task, outcome: Outcome) -> None:
        if outcome.status[0] not in tuple(Status):
            return
        first.setdefault(", ".join(sorted(outcome.measured)), task.numbers[0])
        if len(first) > 1:
            names_a, names_b = (f"{names} for case {case}" for names, case in first.items())
            hint = "return the same names, NaN where there is no value"
            raise CasesError(f"measure returns {names_b}, and {names_a}; {hint}")

    return check


@with_parameters_of(Sweep)
def sweep(job: Sweep) -> SweepResult:
    """Run a deck many times with varied values.

    :class:`Sweep` has the parameters and their errors. :meth:`Sweep.execute` has the errors of the
    computation. The warnings about the deck and the numbers of failed and doubtful cases
    (:attr:`SweepResult.notes`) are :class:`FecmWarning`.

    Parameters
    ----------
    {parameters}

    Returns
    -------
    SweepResult
        One row per case, in the order of the cases.

    Examples
    --------
    >>> result = sweep("decks/impact-115.inp", {"velocity": [50.0, 115.0]})
    >>> [f"{force:.3f}" for force in result["peak_force"]]
    ['36.058', '86.202']

    >>> result = sweep("decks/appendix.inp", random={"k": "lognormal:1.9e6,0.15"}, samples=64,
    ...                exceed={"peak_force": 5.0})
    >>> result.random.statistics["peak_force"].quantiles.shape
    (5,)

    >>> from scipy.stats import gamma
    >>> result = sweep("decks/appendix.inp",
    ...                random={"k": gamma(40, scale=5e4), "velocity": "truncnormal:115,9,90,140"},
    ...                correlation={("k", "velocity"): 0.5}, samples=16)
    >>> bool(90.0 < result["velocity"].min() < result["velocity"].max() < 140.0)
    True

    >>> def largest_w(result):
    ...     return {"w": result.plate_w.max()}
    >>> result = sweep("decks/appendix.inp", {"velocity": [50.0, 115.0]}, measure=largest_w)
    >>> result["w"].shape
    (2,)
    """
    return job.execute()
