"""The mesh error of a peak force, by a second run with bisected elements around the load."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fecm.deck.macros import flat
from fecm.mechanics.time_step import taken_time_step
from fecm.problem.build import RunOptions
from fecm.problem.memory import check_memory
from fecm.problem.problem import Problem
from fecm.problem.refine import RefineError, refined
from fecm.problem.resolution import resolution
from fecm.results.sinks import MemorySink
from fecm.simulation.run import run
from fecm.simulation.simulation import Simulation
from fecm.sweeps.case import CasesError
from fecm.sweeps.checks import check_deck
from fecm.sweeps.in_full import without_output
from fecm.sweeps.timing import stable_time_step, with_time_step


@dataclass(frozen=True)
class MeshError:
    """Peak force on a mesh and on one with bisected elements around the load."""

    peak_force: float
    refined_peak_force: float
    elements: int
    refined_elements: int
    distance: float  # elements up to here are bisected: a bending wave of the contact

    @property
    def change(self) -> float:
        """Change of the peak force."""
        return self.refined_peak_force - self.peak_force

    @property
    def relative_change(self) -> float | None:
        """Change over the peak force; None without a contact."""
        return self.change / self.peak_force if self.peak_force else None


def bisected(problem: Problem) -> Problem:
    """Bisect the elements around the load of a problem.

    Its DT is kept, or shortened to that which DT 0 takes on the new mesh.  Raises RefineError if
    nothing hits the plate, or its elements cannot be bisected.
    """
    near = problem.distances <= max(_distance(problem), problem.distances.min())
    deck = refined(problem.deck, problem.mesh, near)
    taken = taken_time_step(problem.critical_time_step)
    sizes = [macro.value or taken for macro in flat(problem.program) if macro.word == "DT"]
    try:
        return check_deck(with_time_step(deck, min(*sizes, stable_time_step(deck)), taken))
    except CasesError as error:
        raise RefineError(f"the mesh with bisected elements cannot be run: {error}") from None


def _distance(problem: Problem) -> float:
    """Distance from the load within which elements are bisected: a bending wave."""
    found = resolution(problem) if problem.has_impact else None
    if found is None:
        raise RefineError("nothing hits the plate: there is no peak force whose mesh error to find")
    return found.wave


def mesh_error(
    problem: Problem, fine: Problem, options: RunOptions, advance: Callable[[int], object]
) -> MeshError:
    """Run a problem and its :func:`bisected` one, and compare their peak forces.

    `advance` is called with numbers of steps that were taken.  Raises DivergenceError if a motion
    grows without bound.  Raises NotEnoughMemoryError if a run needs more memory than is free.
    """
    peak, refined_peak = (_peak_force(one, options, advance) for one in (problem, fine))
    count, refined_count = problem.deck.control.numel, fine.deck.control.numel
    return MeshError(peak, refined_peak, count, refined_count, _distance(problem))


def _peak_force(problem: Problem, options: RunOptions, advance: Callable[[int], object]) -> float:
    """Peak force of a run without stored fields."""
    plain = without_output(problem)
    check_memory(plain, solver=options.solver, in_memory=True)
    sink = MemorySink()
    observers = (lambda simulation: advance(simulation.interval),)
    run(Simulation(plain, sink, options, observers=observers))
    return float(np.max(sink.arrays["history/force"]))
