"""Sweeps from Python."""

from __future__ import annotations

import pickle
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from fecm._errors import warn
from fecm._files import ARGUMENT, check_outputs
from fecm._machine import NotEnoughMemoryError, free_processors
from fecm._progress import once_a_minute
from fecm.api import LOGGER, LoadedDeck, Progress, load_deck, warn_of_findings
from fecm.authoring.case import Case, CasesError, Limit, parse_exceed
from fecm.authoring.cases import CaseTable, checked, combined
from fecm.deck.catalogue import system_of
from fecm.deck.findings import DeckError
from fecm.deck.model import Deck
from fecm.mechanics.contact_law import Law
from fecm.mechanics.own_law import own_law
from fecm.problem.problem import Problem
from fecm.sweeps import execute
from fecm.sweeps.batch import case_deck
from fecm.sweeps.checks import check_sweep_memory, doubtful_values, unused_values
from fecm.sweeps.convergence import refined_cases
from fecm.sweeps.distributions import OwnDistribution, distribution_of
from fecm.sweeps.execute import DamagedPartError, PartialResults
from fecm.sweeps.files import save_sweep
from fecm.sweeps.in_full import built
from fecm.sweeps.outcome import Outcome, Status, merge
from fecm.sweeps.plan import (
    MODES,
    REDUCED,
    BuildFunction,
    Measure,
    MeasureFunction,
    Plan,
    Task,
    plan,
    tasks,
)
from fecm.sweeps.random import (
    REMEDY,
    DesignKind,
    Pair,
    correlation_of,
    design_of,
    doubt,
    random_cases,
)
from fecm.sweeps.reduced import ReducedModel, Trials, by_energy, count_held, trials
from fecm.sweeps.result import SweepResult, sweep_result


def checked_problem(deck: str | Path | Deck) -> Problem:
    """Checked problem of a deck; DeckError if it has errors, CasesError if several problems."""
    return _loaded(deck).problems[0]


def _loaded(deck: str | Path | Deck) -> LoadedDeck:
    prepared = load_deck(deck)
    if prepared.errors(force=True):
        raise DeckError(prepared.findings, prepared.source)
    if (count := len(prepared.problems)) != 1:
        raise CasesError(f"{prepared.source} has {count} problems; a sweep takes one")
    return prepared


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


def _first_built(build: BuildFunction, cases: Sequence[Case]) -> LoadedDeck:
    """The first deck that can be built: it has the units, and tells the memory of a case."""
    first = ""
    for case in cases:
        try:
            return built(build, case)
        except CasesError as error:
            first = first or str(error)
    raise CasesError(f"no case has a deck; case 0: {first}")


def _check_sendable(spawned: bool, **functions: object) -> None:
    """Refuse functions that worker processes can't import."""
    for name, function in functions.items():
        try:
            pickle.dumps(function)
        except Exception:  # pickle raises several types
            hint = "define it at the top level of a module"
            raise CasesError(f"{name} can't be sent to worker processes; {hint}") from None
        own = getattr(function, "__module__", "") == "__main__"
        if spawned and own and not hasattr(sys.modules["__main__"], "__file__"):
            where = "in an interactive session, where worker processes can't import it"
            hint = "define it in a module, or use an executor of threads"
            raise CasesError(f"{name} is defined {where}; {hint}")


def carry_out_plan(
    problem: Problem,
    made: Plan,
    *,
    workers: int | None = 1,
    scheduler: object = None,
    executor: Executor | None = None,
    parts: PartialResults | None = None,
    done: execute.Done = lambda task, outcome: None,
    idle: execute.Idle = lambda: None,
    note: Callable[[str], None] = warn,
) -> SweepResult:
    """Run the tasks of a plan in this process, on an executor, a scheduler or several workers.

    Without a number of workers, tasks begin in this process, see
    :func:`~fecm.sweeps.execute.here_first`.
    Tasks that `parts` has stored are not run again; with it, the result has no forces.  `done` is
    called with each task and its outcome, including tasks finished earlier, `idle` regularly,
    `note` with messages for the user.  Raises SchedulerError if the scheduler cannot be used, and
    CasesError if full runs show that the reduced model of the plan holds for no case.
    """
    run = partial(
        _outcomes,
        workers=workers,
        most_workers=partial(_most_workers, problem, made, streamed=parts is not None),
        scheduler=scheduler,
        executor=executor,
        parts=parts,
        idle=idle,
        note=note,
    )
    if made.settings.modes is None:
        model, whole = None, tasks(problem, made)
    else:
        model, whole = _by_model(problem, made, made.settings.modes, run, note)
    if parts is not None:
        parts.tasks = whole
    outcomes = [outcome for _, outcome in run(whole, done=done)]
    history = made.settings.history and parts is None
    return sweep_result(made, merge(outcomes, history=history), model)


def _by_model(
    problem: Problem,
    made: Plan,
    modes: int,
    run: Callable[..., list[tuple[Task, Outcome]]],
    note: Callable[[str], None],
) -> tuple[ReducedModel, list[Task]]:
    """Compare the reduced model with full runs; tasks of the cases, by the model or in full.

    Raises CasesError if the model holds for no case.
    """
    ordered, count = by_energy(made), len(made.cases)
    tried = Trials(made, count, partial(run, done=lambda task, outcome: None))
    held = count_held(ordered, tried.failing)
    model = replace(tried.compared(modes), in_full=len(ordered) - held)
    if not held:
        model.check()
    in_full = set(ordered[held:])
    if not in_full:
        return model, tasks(problem, made)
    note(model.note)
    rest = [case for case in range(count) if case not in in_full]
    fulls = [task for task in trials(made, sorted(in_full), count) if task.settings.modes is None]
    return model, [*tasks(problem, made, rest), *fulls]


def _outcomes(
    whole: Sequence[Task],
    *,
    workers: int | None,
    most_workers: Callable[[], int],
    scheduler: object,
    executor: Executor | None,
    parts: PartialResults | None,
    done: execute.Done,
    idle: execute.Idle,
    note: Callable[[str], None],
) -> list[tuple[Task, Outcome]]:
    """Run tasks, or take their stored outcomes; see :func:`carry_out_plan`."""
    outcomes: list[tuple[Task, Outcome]] = []
    left: list[Task] = []

    def keep(task: Task, outcome: Outcome, *, new: bool = True) -> None:
        if parts is not None:
            if new and not any(text.startswith(execute.LOST) for text in outcome.status):
                parts.put(task, outcome)  # cases that were lost with their worker may be run again
            outcome.force = None
        outcomes.append((task, outcome))
        done(task, outcome)

    for task in whole:
        before = None
        try:
            before = None if parts is None else parts.get(task)
        except DamagedPartError as error:
            note(f"{error}; its cases are run again")
        if before is None:
            left.append(task)
        else:
            keep(task, before, new=False)
    if executor is not None:
        execute.on_executor(left, executor, keep, idle)
    elif scheduler is not None:
        execute.on_dask(left, scheduler, keep, idle)
    elif workers is None:
        execute.here_first(left, most_workers, keep, idle)
    elif workers > 1 and len(left) > 1:
        execute.on_workers(left, workers, keep, idle)
    else:
        execute.here(left, keep, idle)
    return outcomes


def _most_workers(problem: Problem, made: Plan, *, streamed: bool) -> int:
    """Worker processes for which processors and memory are free."""
    for count in range(free_processors(), 1, -1):
        with suppress(NotEnoughMemoryError):
            check_sweep_memory(problem, made, count, streamed=streamed)
            return count
    return 1


def sweep(
    deck: str | Path | Deck | None = None,
    vary: Mapping[str, Sequence[Any]] | None = None,
    cases: Iterable[Mapping[str, Any]] | CaseTable | None = None,
    *,
    refine: Sequence[int] | None = None,
    random: Mapping[str, str | OwnDistribution] | None = None,
    correlation: Mapping[Pair, float] | ArrayLike | CaseTable | None = None,
    samples: int | None = None,
    seed: int = 0,
    design: DesignKind = "lhs",
    sensitivity: bool = False,
    exceed: str | Mapping[str, float | Literal["threshold"] | Sequence[float]] | None = None,
    until: float | Literal["threshold"] | Mapping[str, float | str] | None = None,
    history: bool = False,
    build: BuildFunction | None = None,
    measure: MeasureFunction | str | Sequence[str] | None = None,
    model: Literal["reduced"] | None = None,
    modes: int | None = None,
    workers: int | None = 1,
    scheduler: object = None,
    executor: Executor | None = None,
    output: str | Path | None = None,
    overwrite: bool = False,
    progress: Progress | None = None,
    law: Law | str | None = None,
) -> SweepResult:
    """Run a deck many times with varied values.

    Cases that differ only in the projectile, its velocity or the contact law share one run of the
    plate; of a nonlinear plate (NONL) each case is one full run, and each search about five.

    The warnings about the deck and the numbers of failed and doubtful cases
    (:attr:`SweepResult.notes`) are :class:`FecmWarning`.

    Parameters
    ----------
    deck : str, Path or Deck
        Deck with a single problem; not with `build`.
    vary : mapping of str to sequence
        Values by name; all combinations are run.  A text has a unit, as in ``"5J"``, and is
        converted to the units of the deck.
    cases : iterable of mapping or DataFrame, optional
        Cases instead: one mapping each, or a table with a column per name.
    refine : sequence of int, optional
        Factors 1, 2, 4, 8 or a part of them, instead: the sides of all elements and DT are divided
        by each.  :attr:`SweepResult.convergence` has orders, limits and error bands.
    random : mapping of str to str or distribution, optional
        Laws of random values by name: ``"normal:MEAN,SD"``, ``"truncnormal:MEAN,SD,A,B"``,
        ``"lognormal:MEDIAN,SIGMA"``, ``"weibull:SCALE,SHAPE"``, ``"uniform:A,B"`` or
        ``"triangular:A,MODE,B"``; or an object whose method ``ppf`` or ``icdf`` gives its
        quantiles, such as a distribution of :mod:`scipy.stats` with its parameters.  With `vary`
        all combinations get the same draws.
    correlation : mapping of pair to float, array_like or DataFrame, optional
        Correlations of the random values by pairs of names, or as a matrix in the order of
        `random`; those of the normal scores of values with other laws.
    samples : int, optional
        Number of samples of the design; with `random`.
    seed : int
        Seed of the design.
    design : {"lhs", "sobol", "mc"}
        Latin hypercube, scrambled Sobol' sequence, or independent draws.
    sensitivity : bool
        Estimate Sobol' indices, from `samples` times (number of random names + 2) cases.
    exceed : str or mapping of str to float, str or sequence of float, optional
        Limits of quantities, whose probability of exceedance is estimated; ``"threshold"`` for
        the peak force: the delamination threshold.  Also a text: ``"peak_force=threshold"``.
    until : float, str or mapping of str to float, optional
        Search in every case for the velocity at which the peak force reaches this value;
        ``"threshold"``: the delamination threshold.  ``{"exposure": 1.0}``: at which the largest
        exposure of FAIL outside the load reaches 1, by some six full runs.  Without `vary` and
        `cases`, of the deck alone.
    history : bool
        Store the contact force of every step.
    build : callable, optional
        Takes a case, a dict, and returns its :class:`Deck`, instead of `deck`.  Names and values
        are then any.  Each case is run in full with the DT of its own deck; an exception is the
        status of the case.  The units of all decks must be the same.
    measure : str, sequence of str or callable, optional
        More columns of the summary: ``"max_deflection"``, ``"gages"``, ``"failure"``.  A callable
        takes the :class:`Result` of a case and returns numbers by name, without units; each case is
        then run in full, with all that its deck stores.
    model : {"reduced"}, optional
        Compute the cases of a nonlinear plate together, in a few bending modes, instead of by full
        runs; :attr:`SweepResult.reduced` has its differences from three of these.
    modes : int, optional
        Number of bending modes of that model; 21 by default.
    workers : int or None
        Worker processes on this machine.  None: if the sweep takes more than some seconds, as many
        as other work leaves processors free.  With None or more than 1, a script needs
        ``if __name__ == "__main__"``.
    scheduler : str, distributed.Client or cluster, optional
        Dask scheduler, by its address or by an object of Dask (requires dask.distributed).
    executor : concurrent.futures.Executor, optional
        Pool of threads or processes, or another executor.  It is not shut down.
    output : str or Path, optional
        Output file.
    overwrite : bool
        Replace an existing output file.
    progress : callable, optional
        Called with the number of finished cases and that of all cases.
    law : Law or str, optional
        Contact law of all cases instead of that of EXPE, as in :func:`run`.  The cases still share
        the response of their plate, but each asks the law in Python at every step.  The constants
        of EXPE can't vary then, and the reduced model is not for such a law.

    Returns
    -------
    SweepResult
        One row per case, in the order of the cases.

    Raises
    ------
    CasesError
        If the cases are invalid, options exclude each other, no case has a deck, `measure` returns
        different names in different cases, or the reduced model holds for no case.
    DeckError
        If the deck has errors.
    NotEnoughMemoryError
        If the sweep needs more memory than is free; a MemoryError.
    SchedulerError
        If the scheduler cannot be used.
    LawError
        If `law` lacks a method; where it fails in a case, that is the status of the case.
    ExtensionError
        If no installed package has an entry point of the name `law`.
    FileExistsError
        If the output file exists and may not be replaced; nothing is then run.
    OSError
        If a file cannot be read or written.

    Examples
    --------
    >>> found = sweep("decks/impact-115.inp", {"velocity": [50.0, 115.0]})
    >>> [f"{force:.3f}" for force in found["peak_force"]]
    ['36.058', '86.202']

    >>> found = sweep("decks/appendix.inp", random={"k": "lognormal:1.9e6,0.15"}, samples=64,
    ...               exceed={"peak_force": 5.0})
    >>> found.random.statistics["peak_force"].quantiles.shape
    (5,)

    >>> from scipy.stats import gamma
    >>> found = sweep("decks/appendix.inp",
    ...               random={"k": gamma(40, scale=5e4), "velocity": "truncnormal:115,9,90,140"},
    ...               correlation={("k", "velocity"): 0.5}, samples=16)
    >>> bool(90.0 < found["velocity"].min() < found["velocity"].max() < 140.0)
    True

    >>> def largest_w(result):
    ...     return {"w": result.plate_w.max()}
    >>> found = sweep("decks/appendix.inp", {"velocity": [50.0, 115.0]}, measure=largest_w)
    >>> found["w"].shape
    (2,)
    """
    of_random = samples is not None or correlation is not None or sensitivity or exceed
    if random is None and (of_random or seed):
        raise CasesError("correlation, samples, seed, sensitivity and exceed need random values")
    _check_options(vary, cases, refine, random, until, build, measure)
    _check_means(workers, scheduler, executor)
    if progress is not None and not callable(progress):
        raise CasesError(f"progress is {progress!r}, not a function")
    own, measures = _measures(measure)
    own_contact = own_law(law)
    free = build is not None
    grid = {} if vary is None else vary
    loaded = None if deck is None or free else _loaded(deck)
    system = None if loaded is None else system_of(loaded.problems[0].deck)
    made = (
        combined(grid, free=free, system=system)
        if cases is None
        else checked(cases, free=free, system=system)
    )
    drawn = None
    if random is not None:
        laws = {name: distribution_of(name, law, free=free) for name, law in random.items()}
        joined = () if correlation is None else correlation_of([*laws], correlation)
        drawn = design_of(laws, samples, seed, design, sensitivity=sensitivity, correlation=joined)
        made = random_cases(drawn, made)
        if text := doubt(drawn):
            warn(text)
    spawns = (workers is None and scheduler is None and executor is None) or (workers or 1) > 1
    if spawns or isinstance(executor, ProcessPoolExecutor):
        _check_sendable(spawns, build=build, measure=own, law=own_contact)
    prepared = _prepared(deck, loaded, build, made)
    if output is not None:
        check_outputs([Path(output)], overwrite, [Path(prepared.source)], allowed_by=ARGUMENT)
    (problem,) = prepared.problems
    if refine is not None:
        made, measures = refined_cases(problem, refine), (Measure.DEFLECTION,)
    planned = plan(
        problem,
        made,
        history=history,
        until=until,
        build=build,
        measure=own,
        extra=measures,
        design=drawn,
        limits=_limits(exceed),
        modes=reduced_mode_count(model, modes),
        law=own_contact,
    )
    check_draws(planned)
    doubts = (*unused_values(planned), *doubtful_values(problem, made)) if build is None else ()
    for text in doubts:
        warn(text)
    here = workers or 1 if executor is None else getattr(executor, "_max_workers", 0)
    check_sweep_memory(problem, planned, 0 if scheduler is not None else here)
    LOGGER.info("%s: %d cases", problem.deck.title, len(made))
    result = carry_out_plan(
        problem,
        planned,
        workers=workers,
        scheduler=scheduler,
        executor=executor,
        done=_Watch(len(made), progress, same_names=own is not None),
    )
    if output is not None:
        save_sweep(result, Path(output), overwrite=overwrite)
    for text in result.notes:
        warn(text)
    return result


def _check_options(
    vary: object,
    cases: object,
    refine: object,
    random: object,
    until: object,
    build: object,
    measure: object,
) -> None:
    """Raise CasesError if options exclude each other, or are not of their type."""
    others = (vary, cases, random, until, build, measure)
    if refine is not None and any(other is not None for other in others):
        raise CasesError("refine can't be given together with other cases, until, build or measure")
    if cases is not None and random is not None:
        raise CasesError("give random values together with vary, not with cases")
    alone = until is not None or random is not None or refine is not None
    if (vary is None) == (cases is None) and (vary or not alone):
        raise CasesError("give either vary or cases")
    if not (random is None or (isinstance(random, Mapping) and random)):
        example = '{"k": "uniform:1e6,2e6"}'
        raise CasesError(f"random is {random!r}; write a mapping such as {example}")
    if build is not None and not callable(build):
        raise CasesError(f"build is {build!r}, not a function")


def reduced_mode_count(model: str | None, modes: int | None) -> int | None:
    """Bending modes of a model; None of full runs.  CasesError if there is no such model."""
    if model is None:
        if modes is not None:
            raise CasesError("modes are those of the reduced model, which is not asked for")
        return None
    if model != REDUCED:
        raise CasesError(f"unknown model {model!r}; there is {REDUCED!r}")
    return MODES if modes is None else modes


def _check_means(workers: int | None, scheduler: object, executor: object) -> None:
    """Raise CasesError if more than one of the means to run cases is given."""
    if executor is not None and not isinstance(executor, Executor):
        raise CasesError(f"executor is {executor!r}, not a concurrent.futures.Executor")
    if ((workers or 1) > 1) + (scheduler is not None) + (executor is not None) > 1:
        raise CasesError("give only one of workers, scheduler and executor")


def _measures(
    measure: MeasureFunction | str | Sequence[str] | None,
) -> tuple[MeasureFunction | None, Sequence[str]]:
    """The function or the names that were given as measure."""
    if callable(measure):
        return measure, ()
    if measure is None:
        return None, ()
    names = (measure,) if isinstance(measure, str) else measure
    if not (isinstance(names, Sequence) and all(isinstance(name, str) for name in names)):
        raise CasesError(f"measure is {measure!r}, not a function or names")
    return None, names


def _limits(exceed: str | Mapping[str, float | str | Sequence[float]] | None) -> tuple[Limit, ...]:
    """Limits of quantities, from a text or from values by name."""
    if isinstance(exceed, str):
        return (parse_exceed(exceed),)
    if not isinstance(exceed or {}, Mapping):
        raise CasesError(f'exceed is {exceed!r}; write {{"peak_force": [100.0]}} or the like')
    return tuple(
        parse_exceed(f"{name}={value}")
        for name, given in (exceed or {}).items()
        for value in np.atleast_1d(given).tolist()
    )


def _prepared(
    deck: str | Path | Deck | None,
    loaded: LoadedDeck | None,
    build: BuildFunction | None,
    cases: Sequence[Case],
) -> LoadedDeck:
    """The deck, or the first that is built; its warnings are issued."""
    if loaded is not None:
        prepared = loaded
    elif deck is None and build is not None:
        prepared = _first_built(build, cases)
    else:
        raise CasesError("give either deck or build")
    warn_of_findings(prepared)
    return prepared


class _Watch:
    """Counts the cases that are done, and checks the names of what the caller measures."""

    def __init__(self, cases: int, progress: Progress | None, *, same_names: bool) -> None:
        self.cases, self.progress, self.same_names = cases, progress, same_names
        self.finished = 0
        self.due = once_a_minute()
        self.first: dict[str, int] = {}  # case by the names that it was the first to have

    def __call__(self, task: Task, outcome: Outcome) -> None:
        """Take note of a finished task."""
        if self.same_names and outcome.status[0] in tuple(Status):
            self.first.setdefault(", ".join(sorted(outcome.measured)), task.numbers[0])
            if len(self.first) > 1:
                first, other = (f"{names} for case {case}" for names, case in self.first.items())
                hint = "return the same names, NaN where there is no value"
                raise CasesError(f"measure returns {other}, and {first}; {hint}")
        self.finished += len(task.numbers)
        if self.progress is not None:
            self.progress(self.finished, self.cases)
        if self.due():
            LOGGER.info("%d of %d cases done", self.finished, self.cases)
