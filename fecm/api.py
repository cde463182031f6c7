"""What Python users call: read a deck, run it, load a result."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from fecm.check import Checked, check
from fecm.check.listing import check_listing
from fecm.check.memory import check_memory
from fecm.check.mesh import HOURGLASS
from fecm.check.run import UNSTABLE
from fecm.choices import ENERGY_LIMIT, Choices
from fecm.deck.findings import DeckError, Finding
from fecm.deck.model import Deck
from fecm.deck.reader import Reader, load_text
from fecm.results.result import Result
from fecm.results.sinks import MemorySink
from fecm.rod_method import LUMPED, WILSON, RodMethod
from fecm.simulation import simulate
from fecm.slips import LISTING, REPORT, active_slips
from fecm.solvers import AUTO


@dataclass(frozen=True)
class Prepared:
    """A file that was read and checked.

    Attributes
    ----------
    source : str
        Its name.
    problems : list of Checked
        The problems that could be read.
    findings : list of Finding
        Everything that was found, in the deck's order.
    """

    source: str
    problems: list[Checked]
    findings: list[Finding]

    def errors(self, force: bool = False) -> list[Finding]:
        """Findings that make the deck unusable; with `force`, without unstable motions."""
        return [
            finding
            for finding in self.findings
            if finding.severity == "error" and not (force and finding.code in (UNSTABLE, HOURGLASS))
        ]


def prepare(path_or_text: str | Path | Deck, mode: str = REPORT) -> Prepared:
    """Read and check a deck without running it.

    Parameters
    ----------
    path_or_text : str, Path or Deck
        A file's path, a deck's text, or a model made in Python.
    mode : str
        In listing mode blanks inside numbers are zeros, and what the printed program can't compute
        is an error.

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
    problems: list[Checked] = []
    for read in reader.problems():
        if reader.findings.closed:
            break
        if (checked := check(read, reader.findings, listing=listing)) is not None:
            problems.append(checked)
    if listing and not reader.findings.errors:
        for problem in problems:
            check_listing(problem.deck, problem.mesh, reader.findings)
    return Prepared(source, problems, list(reader.findings))


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
        A file's path, a deck's text, or a model made in Python.
    mode : str
        ``"report"`` or ``"listing"``.
    slips : iterable of str
        Single slips to add to report mode.
    output : str or Path, optional
        Result file to write, in place of an earlier one; a second problem goes to ``-2.h5``, and so
        on.  Without it nothing is written.
    force : bool
        Run with a time step above the critical one, or with a checkerboard motion (E321), all the
        same.
    solver : str
        How K u is had: ``"auto"`` by what suits the mesh, ``"csr"`` by a sparse matrix.
    threads : int
        Threads that share the work of a step; 0 takes every core for a large mesh. The result does
        not depend on it.
    rod_mass : str
        The projectile's mass matrix: ``"lumped"`` as in the report's program, or ``"consistent"``.
    rod_integrator : str
        The projectile's integration: ``"wilson"`` as in the report's program, or
        ``"average-acceleration"``.
    energy_limit : float
        Error of the energy balance, as a part of what was given, that ends a run without slips.

    Returns
    -------
    Result or list of Result
        A list where the deck holds several problems.

    Raises
    ------
    DeckError
        If the deck has errors.
    DivergenceError
        If the motion grows without bound, or the energy balance passes its limit.
    ValueError
        If the mode, a slip, the solver, the rod's mass or its integrator is unknown, or a number
        can't be meant.
    NotEnoughMemoryError
        If the run takes more memory than is free: a MemoryError.
    OSError
        If a file can't be read or written.

    Examples
    --------
    >>> result = run("decks/appendix.inp")
    >>> print(f"{result.force.max():.2f} lb")
    6.19 lb
    """
    choices = Choices(
        active_slips(mode, slips), solver, threads, RodMethod(rod_mass, rod_integrator),
        energy_limit,
    )  # fmt: skip
    prepared = prepare(deck, mode)
    if prepared.errors(force):
        raise DeckError(prepared.findings, prepared.source)
    results: list[Result] = []
    for number, problem in enumerate(prepared.problems, start=1):
        check_memory(problem, solver=solver, in_memory=output is None)
        path = None if output is None else numbered(Path(output), number)
        results.append(_run_one(problem, choices, path))
    return results[0] if len(results) == 1 else results


def _run_one(problem: Checked, choices: Choices, path: Path | None) -> Result:
    """Run one problem, into a file if there is a path."""
    if path is None:
        memory = MemorySink()
        simulate(problem, memory, choices)
        return Result(memory.arrays, memory.texts, memory.groups)
    from fecm.results.file_writer import writing
    from fecm.results.result import load

    with writing(path) as sink:
        simulate(problem, sink, choices)
    return load(path)


def numbered(path: Path, number: int) -> Path:
    """Output of problem `number`: the path itself, then with ``-2``, ``-3`` before its suffix."""
    return path if number == 1 else path.with_name(f"{path.stem}-{number}{path.suffix}")
