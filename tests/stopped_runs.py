"""Runs that stop with a checkpoint when a test says so."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from fecm.mechanics.stiffness_product import AUTO
from fecm.problem.build import RunOptions
from fecm.problem.loading import load_deck
from fecm.problem.problem import Problem
from fecm.results import hdf5_writer
from fecm.simulation.checkpoint import Checkpointer
from fecm.simulation.run import run_program as simulate_run
from fecm.simulation.simulation import Simulation


@cache
def problem_of(text: str) -> Problem:
    """The problem of a deck, checked once for all runs of it."""
    (problem,) = load_deck(text).problems
    return problem


class StoppedError(Exception):
    """The run is stopped for the test's sake."""


def run(
    text: str,
    path: Path,
    stop: int = 0,
    *,
    resume: bool = False,
    slips: str = "",
    macros: bool = False,
    solver: str = AUTO,
    interval: int = 1,
) -> int:
    """Run a deck into a file; stop with a checkpoint at the n-th look, between steps or macros.

    There is a look every `interval` steps, or after each macro.

    Returns
    -------
    int
        Looks that there were.
    """
    looks = 0

    def look(simulation: Simulation) -> None:
        nonlocal looks
        looks += 1
        if looks == stop:
            checkpointer.write(simulation)
            raise StoppedError

    problem = problem_of(text)
    names = frozenset(slips.split())
    with hdf5_writer.result_writing(path) as sink:
        checkpointer = Checkpointer(path, sink)
        simulation = Simulation(problem, sink, RunOptions(names, solver=solver))
        if macros:
            simulation.on_macro = look
        else:
            simulation.observers, simulation.interval = (look,), interval
        if resume:
            checkpointer.restore(simulation)
        simulate_run(simulation)
    checkpointer.clear()
    return looks


def stop_at_once(problem: Problem, path: Path) -> None:
    """Stop a run with a checkpoint, as soon as it looks up."""
    with hdf5_writer.result_writing(path) as sink:
        checkpointer = Checkpointer(path, sink)

        def look(simulation: Simulation) -> None:
            checkpointer.write(simulation)
            raise StoppedError

        options = RunOptions(solver="numpy")  # which looks up in short runs too
        simulation = Simulation(problem, sink, options, observers=(look,))
        simulate_run(simulation)
