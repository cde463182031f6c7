"""Python interface: load and check a deck, run it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from fecm.deck.findings import DeckError, Finding
from fecm.deck.model import Deck
from fecm.deck.reader import Reader, load_text
from fecm.mechanics.rod_integrators import LUMPED, WILSON, RodMethod
from fecm.mechanics.stiffness_product import AUTO
from fecm.problem.check_mesh import HOURGLASS, check_listing
from fecm.problem.check_program import UNSTABLE
from fecm.problem.memory import check_memory
from fecm.problem.options import ENERGY_LIMIT, RunOptions
from fecm.problem.problem import Problem, check
from fecm.problem.slips import LISTING, REPORT, active_slips
from fecm.results.result import Result
from fecm.results.sinks import MemorySink
from fecm.simulation.run import simulate


@dataclass(frozen=True)
class LoadedDeck:
    """A file that was read and checked.

    Attributes
    ----------
    source : str
        Its name.
    problems : list of Problem
        The problems that could be read.
    findings : list of Finding
        All findings, in the deck's order.
    """

    source: str
    problems: list[Problem]
    findings: list[Finding]

    def errors(self, force: bool = False) -> list[Finding]:
        """Findings that make the deck unusable; with `force`, without unstable motions."""
        return [
            finding
            for finding in self.findings
            if finding.severity == "error" and not (force and finding.code in (UNSTABLE, HOURGLASS))
        ]


def load_deck(path_or_text: str | Path | Deck, mode: str = REPORT) -> LoadedDeck:
    """Read and check a deck without running it.

    Parameters
    ----------
    path_or_text : str, Path or Deck
        A file's path, a deck's text, or a model built in Python.
    mode : str
        In listing mode blanks inside numbers are zeros, and decks that the printed program can't
        compute are errors.

    Raises
    ------
    OSError
        If the file can't be read.
    """
    if isinstance(path_or_text, Deck):
        text, source = path_or_text.to_text(), "<deck>"
    else:
        text, source = load_text(path_or_text)
    reader = Reader(text, blanks_are_zeros=mode == LISTING)
    listing = mode == LISTING
    problems: list[Problem] = []
    for read in reader.problems():
        if reader.findings.closed:
            break
        if (checked := check(read, reader.findings, listing=listing)) is not None:
            problems.append(checked)
    if listing and not reader.findings.errors:
        for problem in problems:
            check_listing(problem.deck, problem.mesh, reader.findings)
    return LoadedDeck(source, problems, list(reader.findings))


def run(
    deck: str | Path | Deck,
    mode: str = REPORT,
    slips: Iterable[str] = (),
    output: str | Path | None = None,
    force: bool = False,
    solver: str = AUTO,
    threads: int = 0,
    rod_mass: str = LUMPED,
    rod_integrator: str = WILSON,
    energy_limit: float = ENERGY_LIMIT,
) -> Result | list[Result]:
    """Run every problem of a deck.

    Parameters
    ----------
    deck : str, Path or Deck
        A file's path, a deck's text, or a model built in Python.
    mode : str
        ``"report"`` or ``"listing"``.
    slips : iterable of str
        Slips to add to report mode.
    output : str or Path, optional
        Result file, which is overwritten; a second problem goes to ``-2.h5``, and so on.  Nothing
        is written by default.
    force : bool
        Run even if the time step is above the critical one, or with a checkerboard motion (E321).
    solver : str
        How K·u is computed: ``"auto"`` depends on the mesh, ``"csr"`` uses a sparse matrix.
    threads : int
        Threads that share the work of a step; 0 uses every core for a large mesh.  The result does
        not depend on it.
    rod_mass : str
        The projectile's mass matrix: ``"lumped"`` as in the report's program, or ``"consistent"``.
    rod_integrator : str
        The projectile's integration: ``"wilson"`` as in the report's program, or
        ``"average-acceleration"``.
    energy_limit : float
        Relative error of the energy balance above which a run without slips ends.

    Returns
    -------
    Result or list of Result
        A list if the deck has several problems.

    Raises
    ------
    DeckError
        If the deck has errors.
    DivergenceError
        If the motion grows without bound, or the energy balance exceeds its limit.
    ValueError
        If the mode, a slip, the solver, the rod's mass or its integrator is unknown, or a number
        is invalid.
    NotEnoughMemoryError
        If the run needs more memory than is free; a MemoryError.
    OSError
        If a file can't be read or written.

    Examples
    --------
    >>> result = run("decks/appendix.inp")
    >>> print(f"{result.force.max():.2f} lb")
    6.19 lb
    """
    choices = RunOptions(
        active_slips(mode, slips), solver, threads, RodMethod(rod_mass, rod_integrator),
        energy_limit,
    )  # fmt: skip
    prepared = load_deck(deck, mode)
    if prepared.errors(force):
        raise DeckError(prepared.findings, prepared.source)
    results: list[Result] = []
    for number, problem in enumerate(prepared.problems, start=1):
        check_memory(problem, solver=solver, in_memory=output is None)
        path = None if output is None else numbered(Path(output), number)
        results.append(_run_one(problem, choices, path))
    return results[0] if len(results) == 1 else results


def _run_one(problem: Problem, choices: RunOptions, path: Path | None) -> Result:
    """Run one problem, into a file if there is a path."""
    if path is None:
        memory = MemorySink()
        simulate(problem, memory, choices)
        return Result(memory.arrays, memory.texts, memory.groups)
    from fecm.results.hdf5_writer import writing
    from fecm.results.result import load

    with writing(path) as sink:
        simulate(problem, sink, choices)
    return load(path)


def numbered(path: Path, number: int) -> Path:
    """Output of problem `number`: the path itself, then with ``-2``, ``-3`` before its suffix."""
    return path if number == 1 else path.with_name(f"{path.stem}-{number}{path.suffix}")
