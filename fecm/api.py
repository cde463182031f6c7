"""Python interface: load and check a deck, run it."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from typing import Literal, NamedTuple

from fecm._errors import OptionsError, warn
from fecm._files import ARGUMENT, check_outputs
from fecm._progress import once_a_minute
from fecm._text import html_table
from fecm._typing import AnyFile
from fecm.deck.findings import DeckError, Finding, Severity
from fecm.deck.model import Deck
from fecm.deck.reader import Reader, load_text, read_deck
from fecm.listing.slips import LISTING, REPORT, active_slips
from fecm.mechanics.contact_law import Law
from fecm.mechanics.failure import FailureCriterion, own_criteria
from fecm.mechanics.own_law import own_law
from fecm.mechanics.projectile import (
    DeckProjectile,
    Integrator,
    LinearProjectile,
    MassMatrix,
    RodMethod,
    own_projectile,
)
from fecm.problem.build import ENERGY_LIMIT, RunOptions, check_run_options
from fecm.problem.check import check_listing, check_problem
from fecm.problem.memory import check_run_memory
from fecm.problem.problem import Problem
from fecm.problem.rules.quadrature import HOURGLASS
from fecm.problem.rules.time_step import UNSTABLE
from fecm.problem.summary import ProblemSummary, deck_summary
from fecm.results.result import Result, load
from fecm.results.sinks import MemorySink
from fecm.simulation.run import simulate
from fecm.simulation.simulation import Simulation

Mode = Literal["report", "listing"]
Solver = Literal["auto", "kernels", "numpy", "csr"]

# Called with the number of steps taken and of all steps.
Progress = Callable[[int, int], object]

LOGGER = logging.getLogger("fecm")


class LoadedDeck(NamedTuple):
    """A file that was read and checked."""

    source: str  # its name
    problems: list[Problem]  # the problems that could be read
    findings: list[Finding]  # all findings, in the deck's order

    def errors(self, force: bool = False) -> list[Finding]:
        """Findings that make the deck unusable; with `force`, without unstable motions."""
        allowed = (UNSTABLE, HOURGLASS) if force else ()
        return [f for f in self.findings if f.severity == "error" and f.code not in allowed]


def load_deck(path_or_text: str | Path | AnyFile | Deck, mode: str = REPORT) -> LoadedDeck:
    """Read and check the deck of a path, a text, an open file or a model, without running it.

    In listing mode blanks inside numbers are zeros, and decks that the printed program can't
    compute are errors.  Raises OSError if the file can't be read.
    """
    if isinstance(path_or_text, Deck):
        text, source = path_or_text.to_text(), "<deck>"
    else:
        text, source = load_text(path_or_text)
    listing = mode == LISTING
    reader = Reader(text, blanks_are_zeros=listing)
    problems: list[Problem] = []
    for read in reader.problems():
        if reader.findings.closed:
            break
        if (checked := check_problem(read, reader.findings, listing=listing)) is not None:
            problems.append(checked)
    if listing and not reader.findings.errors:
        for problem in problems:
            check_listing(problem, reader.findings)
    return LoadedDeck(source, problems, list(reader.findings))


@dataclass(frozen=True)
class DeckCheck:
    """What is known of a deck before it runs; ``str()`` is what ``fecm check`` prints.

    Attributes
    ----------
    source : str
        Name of the deck's file.
    findings : tuple of Finding
        Errors, warnings and notes, in the deck's order.
    problems : tuple of ProblemSummary
        Size, stiffness, masses and time step of each problem; empty if the deck has errors.
    """

    source: str
    findings: tuple[Finding, ...]
    problems: tuple[ProblemSummary, ...]

    @property
    def errors(self) -> tuple[Finding, ...]:
        """Findings that make the deck unusable."""
        return self._found(Severity.ERROR)

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """Findings that are probably mistakes."""
        return self._found(Severity.WARNING)

    @property
    def ok(self) -> bool:
        """Whether the deck has no errors."""
        return not self.errors

    def _found(self, severity: Severity) -> tuple[Finding, ...]:
        return tuple(finding for finding in self.findings if finding.severity is severity)

    def to_dicts(self) -> list[dict[str, object]]:
        """Findings and problems as plain values: the lines of ``fecm check --format json``."""
        found = [finding.to_dict(self.source) for finding in self.findings]
        head = {"kind": "summary", "file": self.source}
        return [*found, *({**head, **problem.to_dict()} for problem in self.problems)]

    def __str__(self) -> str:
        texts = [finding.render(self.source) for finding in self.findings]
        return "\n".join([*texts, *(line for one in self.problems for line in one.lines())])

    def _repr_html_(self) -> str:
        """Table of the findings and of each problem, for notebooks."""
        rows = [(f"{one.severity} {one.code}", one.message) for one in self.findings]
        for problem in self.problems:
            rows += [("title", problem.title), *problem.rows()]
        return html_table(repr(self)[1:-1], rows)

    def __repr__(self) -> str:
        counts = {"error": len(self.errors), "warning": len(self.warnings)}
        texts = (f"{count} {word}{'s' * (count != 1)}" for word, count in counts.items())
        return f"<fecm check of {self.source}: {', '.join(texts)}>"


def load_one(deck: str | Path | Deck, mode: str = REPORT) -> Problem:
    """Load a deck with exactly one problem; raises as :func:`run_one` does."""
    loaded = load_deck(deck, mode)
    if loaded.errors():
        raise DeckError(loaded.findings, loaded.source)
    _check_one(loaded.problems)
    return loaded.problems[0]


def check_loaded(loaded: LoadedDeck) -> DeckCheck:
    """Summarise the problems of a deck that was loaded, if it has no errors."""
    problems = () if loaded.errors() else loaded.problems
    return DeckCheck(loaded.source, tuple(loaded.findings), tuple(map(deck_summary, problems)))


def check(deck: str | Path | AnyFile | Deck, mode: Mode = "report") -> DeckCheck:
    """Check a deck without running it.

    Parameters
    ----------
    deck : str, Path, file or Deck
        A file's path, a deck's text, an open file, or a model built in Python.
    mode : str
        ``"report"``, or ``"listing"``, which refuses what the printed program can't compute.

    Returns
    -------
    DeckCheck
        Findings, and a summary of each problem.  A deck with errors raises nothing.

    Raises
    ------
    OptionsError
        If the mode is unknown.
    OSError
        If the file can't be read.

    Examples
    --------
    >>> import fecm
    >>> found = fecm.check(fecm.examples.path("impact-patch"))
    >>> found.ok, len(found.warnings)
    (True, 0)
    >>> (problem,) = found.problems
    >>> print(f"{problem.nodes} nodes, DT at most {problem.critical_time_step:.3g} s")
    609 nodes, DT at most 5.07e-07 s
    """
    active_slips(mode, ())  # refuses an unknown mode
    return check_loaded(load_deck(deck, mode))


def read_one(path_or_text: str | Path | AnyFile) -> Deck:
    """Read a deck with exactly one problem; see :func:`read_deck`.

    Raises
    ------
    DeckError
        If the deck has errors.
    OptionsError
        If it has several problems, or none.
    """
    found = read_deck(path_or_text)
    decks = [found] if isinstance(found, Deck) else found
    _check_one(decks)
    return decks[0]


def run_one(
    deck: str | Path | AnyFile | Deck,
    mode: Mode = "report",
    slips: Iterable[str] = (),
    output: str | Path | None = None,
    force: bool = False,
    solver: Solver = "auto",
    threads: int = 0,
    rod_mass: MassMatrix = "lumped",
    rod_integrator: Integrator = "wilson",
    energy_limit: float = ENERGY_LIMIT,
    progress: Progress | None = None,
    law: Law | str | None = None,
    projectile: DeckProjectile | LinearProjectile | None = None,
    criteria: Iterable[FailureCriterion | str] = (),
    *,
    overwrite: bool = False,
) -> Result:
    """Run a deck with exactly one problem; parameters and errors are those of :func:`run`.

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
    choices = RunOptions(
        active_slips(mode, slips),
        solver,
        threads,
        RodMethod(rod_mass, rod_integrator),
        energy_limit,
        law=own_law(law),
        projectile=own_projectile(projectile),
        criteria=own_criteria(criteria),
    )
    return _run(deck, mode, force, choices, output, progress, one=True, overwrite=overwrite)[0]


def run(
    deck: str | Path | AnyFile | Deck,
    mode: Mode = "report",
    slips: Iterable[str] = (),
    output: str | Path | None = None,
    force: bool = False,
    solver: Solver = "auto",
    threads: int = 0,
    rod_mass: MassMatrix = "lumped",
    rod_integrator: Integrator = "wilson",
    energy_limit: float = ENERGY_LIMIT,
    progress: Progress | None = None,
    law: Law | str | None = None,
    projectile: DeckProjectile | LinearProjectile | None = None,
    criteria: Iterable[FailureCriterion | str] = (),
    *,
    overwrite: bool = False,
) -> Result | list[Result]:
    """Run every problem of a deck.

    Each warning about the deck and each reason to doubt the result is a :class:`FecmWarning`.

    Parameters
    ----------
    deck : str, Path, file or Deck
        A file's path, a deck's text, an open file, or a model built in Python.
    mode : str
        ``"report"`` or ``"listing"``.
    slips : iterable of str
        Slips to add to report mode.
    output : str or Path, optional
        Result file; a second problem goes to ``-2.h5``, and so on.  Nothing is written by default.
    force : bool
        Run even if the time step is above the critical one, or with a checkerboard motion (E321).
    solver : str
        How K·u is computed: ``"auto"`` depends on the mesh, ``"csr"`` uses a sparse matrix.
    threads : int
        Threads that share the work of a step; 0 takes as many for a large mesh as other work leaves
        processors free.  The result does not depend on it.
    rod_mass : str
        The projectile's mass matrix: ``"lumped"`` as in the report's program, or ``"consistent"``.
    rod_integrator : str
        The projectile's integration: ``"wilson"`` as in the report's program, or
        ``"average-acceleration"``.
    energy_limit : float
        Relative error of the energy balance above which a run without slips ends.
    progress : callable, optional
        Called now and then with the number of steps taken and that of all steps of the problem.
    law : Law or str, optional
        Contact law instead of that of EXPE, which the deck has all the same: an object with the
        methods of :class:`~fecm.mechanics.contact_law.Law`, or the name of an entry point of the
        group ``fecm.laws``.  The name of its class, or that of the entry point, is stored as the
        attribute ``law`` of the result.
    projectile : LinearProjectile, Rod or RigidMass, optional
        Projectile instead of that of PROJ, by its mass and stiffness matrices, at the velocity of
        ROD.  The name of its class is stored as the attribute ``projectile`` of the result.
    criteria : iterable of FailureCriterion or str
        Failure criteria that FAIL evaluates beside its own: functions, or names of entry points of
        the group ``fecm.criteria``.  The result has a group ``failure/NAME`` of each.
    overwrite : bool
        Replace existing result files.

    Returns
    -------
    Result or list of Result
        A list if the deck has several problems; :func:`run_one` returns one result.

    Raises
    ------
    DeckError
        If the deck has errors.
    DivergenceError
        If the motion grows without bound, or the energy balance exceeds its limit.
    OptionsError
        If the mode, a slip, the solver, the rod's mass or its integrator is unknown, a number is
        invalid, or the solver or a slip is not for a nonlinear plate.
    LawError
        If `law` lacks a method, raises an exception, or returns a value that is not a number.
    ExtensionError
        If no installed package has an entry point of that name.
    CriterionError
        If a function of `criteria` raises an exception, or does not return exposures.
    ProjectileError
        If the matrices of `projectile` are not those of one free elastic body.
    NotEnoughMemoryError
        If the run needs more memory than is free; a MemoryError.
    FileExistsError
        If a result file exists and may not be replaced; nothing is then run.
    OSError
        If a file can't be read or written.

    Examples
    --------
    >>> result = run("decks/appendix.inp")
    >>> print(f"{result.force.max():.2f} lb")
    6.19 lb
    """
    choices = RunOptions(
        active_slips(mode, slips),
        solver,
        threads,
        RodMethod(rod_mass, rod_integrator),
        energy_limit,
        law=own_law(law),
        projectile=own_projectile(projectile),
        criteria=own_criteria(criteria),
    )
    results = _run(deck, mode, force, choices, output, progress, one=False, overwrite=overwrite)
    return results[0] if len(results) == 1 else results


def _check_one(found: Sequence[object]) -> None:
    """Refuse a deck that does not have exactly one problem."""
    if len(found) != 1:
        raise OptionsError(f"the deck has {len(found)} problems, not one")


def sole_problem(deck: str | Path | Deck, *, warns: bool = True) -> Problem:
    """Checked problem of a deck that has one; with `warns`, warnings about it are FecmWarnings.

    Raises DeckError if the deck has errors, apart from unstable motions.  Raises OptionsError if
    the deck does not have exactly one problem.
    """
    prepared = load_deck(deck)
    if prepared.errors(force=True):
        raise DeckError(prepared.findings, prepared.source)
    _check_one(prepared.problems)
    if warns:
        warn_of_findings(prepared)
    return prepared.problems[0]


def warn_of_findings(prepared: LoadedDeck) -> None:
    """Warn of the findings that are warnings."""
    for finding in prepared.findings:
        if finding.severity == "warning":
            warn(finding.render(prepared.source))


def _run(
    deck: str | Path | AnyFile | Deck,
    mode: str,
    force: bool,
    choices: RunOptions,
    output: str | Path | None,
    progress: Progress | None,
    *,
    one: bool,
    overwrite: bool,
) -> list[Result]:
    """Run the problems of a deck; warn of what is doubtful."""
    prepared = load_deck(deck, mode)
    if prepared.errors(force):
        raise DeckError(prepared.findings, prepared.source)
    if one:
        _check_one(prepared.problems)
    for problem in prepared.problems:
        check_run_options(problem, choices)
    numbers = range(1, 1 + len(prepared.problems))
    paths = [] if output is None else [numbered(Path(output), number) for number in numbers]
    check_outputs(paths, overwrite, [Path(prepared.source)], allowed_by=ARGUMENT)
    found = tuple(finding for finding in prepared.findings if finding.severity != "error")
    warn_of_findings(prepared)
    results: list[Result] = []
    for problem, path in zip_longest(prepared.problems, paths):
        check_run_memory(problem, solver=choices.solver, in_memory=path is None)
        title = problem.deck.title or prepared.source
        LOGGER.info("%s: %d steps", title, problem.work.steps)
        result = _run_one(problem, choices, path, progress, overwrite=overwrite)
        LOGGER.info("%s: done", title)
        result.findings = found
        for note in result.notes:
            warn(note)
        results.append(result)
    return results


def _run_one(
    problem: Problem,
    choices: RunOptions,
    path: Path | None,
    progress: Progress | None,
    *,
    overwrite: bool,
) -> Result:
    """Run one problem, into a file if there is a path."""
    due = once_a_minute()

    def report(simulation: Simulation) -> None:
        step, steps = simulation.state.plate.step, problem.work.steps
        if progress is not None:
            progress(step, steps)
        if due():
            LOGGER.info("%s: step %d of %d", problem.deck.title, step, steps)

    if path is None:
        memory = MemorySink()
        report(simulate(problem, memory, choices, [report]))
        return Result(memory.arrays, memory.texts, memory.groups)
    from fecm.results.hdf5_writer import result_writing  # 25 ms with h5py

    with result_writing(path, overwrite=overwrite) as sink:
        report(simulate(problem, sink, choices, [report]))
    return load(path)


def numbered(path: Path, number: int) -> Path:
    """Output of problem `number`: the path itself, then with ``-2``, ``-3`` before its suffix."""
    return path if number == 1 else path.with_name(f"{path.stem}-{number}{path.suffix}")
