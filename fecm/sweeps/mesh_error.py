"""Mesh error of the peak force, from a second run with bisected elements."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fecm.deck.macros import flat
from fecm.deck.model import Deck
from fecm.mechanics.time_step import taken_time_step
from fecm.problem.check_segments import resolution
from fecm.problem.memory import check_memory
from fecm.problem.options import RunOptions
from fecm.problem.problem import Problem
from fecm.problem.refine import RefineError, refined
from fecm.results.sinks import MemorySink
from fecm.simulation.run import run
from fecm.simulation.simulation import Simulation
from fecm.sweeps.cases import CasesError
from fecm.sweeps.plan import without_output
from fecm.sweeps.vary import check_deck, with_time_step


@dataclass(frozen=True)
class MeshError:
    """Peak force on a mesh and on one with bisected elements around the load."""

    peak_force: float
    refined_peak_force: float
    elements: int
    refined_elements: int
    # Elements up to this distance from the load are bisected: a bending wave of the contact.
    distance: float

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
    try:
        return check_deck(_timed(deck, problem))
    except CasesError as error:
        raise RefineError(f"the mesh with bisected elements cannot be run: {error}") from None


def _distance(problem: Problem) -> float:
    """Distance from the load within which elements are bisected: a bending wave."""
    found = resolution(problem) if problem.has_impact else None
    if found is None:
        raise RefineError("nothing hits the plate: there is no peak force whose mesh error to find")
    return found.wave


def _timed(deck: Deck, problem: Problem) -> Deck:
    """The bisected deck of a problem with a stable time step."""
    taken = taken_time_step(problem.critical_time_step)
    sizes = [macro.value or taken for macro in flat(problem.program) if macro.word == "DT"]
    stable = taken_time_step(check_deck(with_time_step(deck, 0.0)).critical_time_step)
    return with_time_step(deck, min(*sizes, stable), taken)


def mesh_error(
    problem: Problem, fine: Problem, options: RunOptions, advance: Callable[[int], object]
) -> MeshError:
    """Run a problem and its :func:`bisected` one, and compare their peak forces.

    `advance` is called with numbers of steps that were taken.  Raises DivergenceError if a motion
    grows without bound.  Raises NotEnoughMemoryError if a run needs more memory than is free.
    """
    return MeshError(
        _peak_force(problem, options, advance),
        _peak_force(fine, options, advance),
        problem.deck.control.numel,
        fine.deck.control.numel,
        _distance(problem),
    )


def _peak_force(problem: Problem, options: RunOptions, advance: Callable[[int], object]) -> float:
    """Peak force of a run without stored fields."""
    plain = without_output(problem)
    check_memory(plain, solver=options.solver, in_memory=True)
    sink = MemorySink()
    observers = (lambda simulation: advance(simulation.interval),)
    run(Simulation(plain, sink, options, observers=observers))
    return float(np.max(sink.arrays["history/force"]))
