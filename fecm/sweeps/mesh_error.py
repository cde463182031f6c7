"""Mesh error of a peak force and of exposures, from a second run with bisected elements."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from fecm._typing import FiniteFloat
from fecm._watch import Progress
from fecm.authoring.case import CasesError, check_deck
from fecm.authoring.time_values import stable_time_step, with_time_step
from fecm.deck.macros import flat
from fecm.deck.model import Deck
from fecm.judge.end import OPEN_PEAKS
from fecm.listing.slips import Mode, active_slips
from fecm.mechanics.time_step import taken_time_step
from fecm.problem.build import RunOptions
from fecm.problem.estimates import resolution
from fecm.problem.loading import load_one
from fecm.problem.memory import check_run_memory
from fecm.problem.problem import Problem
from fecm.problem.refine import RefineError, refined_deck
from fecm.results.exposures import largest_exposures
from fecm.results.run_metrics import end_of
from fecm.results.sinks import MemorySink
from fecm.results.stored import Stored
from fecm.simulation.run import run_program
from fecm.simulation.simulation import Simulation
from fecm.sweeps.in_full import without_output
from fecm.sweeps.task import Measure


@dataclass(frozen=True, eq=False)
class MeshErrorEstimate:
    """Peak force and exposures on a mesh, and on one with bisected elements around the load.

    Attributes
    ----------
    peak_force, refined_peak_force : float
        Largest forces of both runs.
    elements, refined_elements : int
        Sizes of both meshes.
    distance : float
        Distance from the load within which elements are bisected: a bending wave of the contact.
    undecided : bool
        Whether a run ends before its peak: its largest force is then a lower bound of the peak.
    exposures, refined_exposures : dict of str to float
        Largest exposure by criterion, 1 at failure; empty without FAIL.
    """

    peak_force: float
    refined_peak_force: float
    elements: int
    refined_elements: int
    distance: FiniteFloat
    undecided: bool
    exposures: dict[str, float]
    refined_exposures: dict[str, float]

    @property
    def change(self) -> float:
        """Change of the peak force."""
        return self.refined_peak_force - self.peak_force

    @property
    def relative_change(self) -> float | None:
        """Change over the peak force; None without a contact."""
        return self.change / self.peak_force if self.peak_force else None


def mesh_error(
    deck: str | Path | Deck, mode: Mode = "report", *, progress: Progress | None = None
) -> MeshErrorEstimate:
    """Run a deck on its mesh and on one with bisected elements around the load.

    Parameters
    ----------
    deck : str, Path or Deck
        A deck with one problem, whose elements are quadrilaterals with 4 or 9 nodes.
    mode : str
        ``"report"`` or ``"listing"``.
    progress : callable, optional
        Called now and then with the numbers of completed and of all steps of both runs.

    Returns
    -------
    MeshErrorEstimate
        Peak forces and largest exposures of both; the change estimates the error of the deck's
        mesh.

    Raises
    ------
    DeckError
        If the deck has errors.
    RefineError
        If nothing hits the plate, or its elements cannot be bisected.
    ValueError
        If the deck has several problems, or none.
    DivergenceError
        If a motion grows without bound.
    NotEnoughMemoryError
        If a run needs more memory than is free.
    OSError
        If the file can't be read.

    Examples
    --------
    >>> import fecm
    >>> error = fecm.mesh_error(fecm.examples.path("impact-patch"))
    >>> print(f"{error.peak_force:.3f} lb, {error.refined_peak_force:.3f} lb")
    85.013 lb, 85.101 lb
    """
    options = RunOptions(active_slips(mode, ()))
    problem = load_one(deck, mode)
    fine = bisected(problem)
    steps, done = problem.work.steps + fine.work.steps, 0

    def advance(more: int) -> None:
        nonlocal done
        done += more
        if progress is not None:
            progress(done, steps)

    estimate = compare_peaks(problem, fine, options, advance)
    advance(steps - done)  # short runs have reported nothing
    return estimate


def bisected(problem: Problem) -> Problem:
    """Bisect the elements around the load of a problem.

    DT is kept, or shortened to the step that DT 0 takes on the new mesh. Raises RefineError if the
    deck has no impact, or its elements can't be bisected.
    """
    near = problem.distances <= max(_distance(problem), problem.distances.min())
    deck = refined_deck(problem.deck, problem.mesh, near)
    default_step = taken_time_step(problem.critical_time_step)
    sizes = [macro.value or default_step for macro in flat(problem.program) if macro.word == "DT"]
    try:
        return check_deck(with_time_step(deck, min(*sizes, stable_time_step(deck)), default_step))
    except CasesError as error:
        raise RefineError(f"the mesh with bisected elements cannot be run: {error}") from None


def _distance(problem: Problem) -> float:
    """Return the distance from the load within which elements are bisected: a bending wave."""
    waves = resolution(problem) if problem.has_impact else None
    if waves is None:
        raise RefineError("the deck has no impact: there is no peak force to find a mesh error for")
    return waves.wave


def compare_peaks(
    problem: Problem, fine: Problem, options: RunOptions, advance: Callable[[int], object]
) -> MeshErrorEstimate:
    """Run a problem and its :func:`bisected` problem, and compare peak forces and exposures.

    `advance` is called with the number of new steps. Raises DivergenceError if a motion grows
    without bound, NotEnoughMemoryError if a run needs more memory than is free.
    """
    coarse, refined = (_run(item, options, advance) for item in (problem, fine))
    return MeshErrorEstimate(
        peak_force=float(coarse.whole("history/force").max()),
        refined_peak_force=float(refined.whole("history/force").max()),
        elements=problem.deck.control.numel,
        refined_elements=fine.deck.control.numel,
        distance=_distance(problem),
        undecided=any(end_of(item) in OPEN_PEAKS for item in (coarse, refined)),
        exposures=_exposures(coarse),
        refined_exposures=_exposures(refined),
    )


def _exposures(stored: Stored) -> dict[str, float]:
    """Return the largest exposure by criterion."""
    return {exposure.criterion: exposure.exposure for exposure in largest_exposures(stored)}


def _run(problem: Problem, options: RunOptions, advance: Callable[[int], object]) -> Stored:
    """Run a problem without storing fields."""
    plain = without_output(problem, [Measure.FAILURE])
    check_run_memory(plain, solver=options.solver, in_memory=True)
    sink = MemorySink()
    observers = (lambda simulation: advance(simulation.interval),)
    run_program(Simulation(plain, sink, options, observers=observers))
    return Stored(sink.arrays, sink.texts, sink.groups, plain.deck)
