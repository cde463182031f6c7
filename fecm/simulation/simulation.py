"""Simulation of a problem: its model, state, outputs and observers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fecm._typing import Floats
from fecm.listing.printout import Printer
from fecm.mechanics.impact_steps import SINGLY, TOGETHER
from fecm.mechanics.solutions import Tangent
from fecm.problem.build import RunOptions, build_model
from fecm.problem.problem import Problem
from fecm.results.sinks import Sink
from fecm.simulation.interpreter import Interpreter
from fecm.simulation.recorder import Recorder
from fecm.simulation.saved import restore, saved_values, subset
from fecm.simulation.state import RunState

if TYPE_CHECKING:
    from fecm.mechanics.exposures import FailureEnvelope
    from fecm.mechanics.failure_monitor import FailureMonitor


class Criteria(NamedTuple):
    """Failure criteria of plies with other residual stresses, and their largest exposures."""

    monitor: FailureMonitor
    envelope: FailureEnvelope


Observer = Callable[["Simulation"], object]


@dataclass
class Simulation:
    """Simulation of a problem. Building it writes nothing."""

    problem: Problem
    sink: Sink  # receives the result
    options: RunOptions = field(default_factory=RunOptions)  # how the problem is run
    printer: Printer = field(default_factory=Printer)  # writes the printed output
    # Called with the simulation every `interval` steps; may write a checkpoint or raise.
    observers: Sequence[Observer] = ()
    on_macro: Observer = lambda simulation: None  # called after every macro; must be fast
    others: Sequence[Criteria] = ()  # FAIL evaluates them too; checkpoints do not store them

    def __post_init__(self) -> None:
        problem, options = self.problem, self.options
        with np.errstate(all="ignore"):
            self.model = build_model(problem, options)
        self.state = state = RunState(self.model.motion.start())
        if self.model.impact is not None:
            state.impact = self.model.impact.start(state.plate)
        if self.model.failure is not None:
            state.failure = self.model.failure.start()
        self._program = self.model.variant.program
        state.prop_force = self._program.prop_force(1.0)  # PROP's first value
        self.interpreter = Interpreter(problem.program)
        pace = SINGLY if self.model.steps is None else TOGETHER
        # Steps between two calls of the observers.
        self.interval = pace.interval(self.model.plate.neq)
        limit = options.energy_limit if self.model.variant.is_report else None
        # Without a reference to the run, which would keep it alive.
        threshold = problem.threshold
        force = None if threshold is None else threshold.force / problem.symmetry.factor
        on_block = partial(state.monitor.add, limit=limit, threshold=force)
        self.recorder = Recorder(self.sink, self.model, problem.work, on_block)

    @cached_property
    def tangent(self) -> Tangent:
        """Factorised stiffness about the displacement of the last TANG."""
        return Tangent(self.model.plate, self.state.linearised)

    def linearise(self, field: Floats) -> None:
        """Form the stiffness about a displacement field, (numnp, 5)."""
        self.state.linearised = field
        self.__dict__.pop("tangent", None)

    def load_factor(self, clock: float) -> float:
        """Return the load factor of PROP at a time of the clock."""
        state = self.state
        if state.table is None:
            return state.constant_factor
        table = self.problem.deck.tables[state.table]
        return self._program.table_factor(table, clock, state.constant_factor)

    def force_factor(self, clock: float | None = None) -> float:
        """Return the factor of FORC's values at a time of the clock, by default the present."""
        state = self.state
        factor = self.load_factor(state.clock if clock is None else clock)
        contact = None
        if state.impact is not None:
            force = float(state.impact.contact.force)
            contact = force if state.prop_force is None else state.prop_force
        return self._program.force_factor(factor, contact)

    def displacement_field(self) -> Floats:
        """Return the displacement of every dof of every node, (numnp, 5)."""
        return self.model.motion.field(self.state.plate, self.force_factor())

    def observe(self) -> None:
        """Call the observers after every `interval` steps."""
        if not self.state.plate.step % self.interval:
            for observer in self.observers:
                observer(self)

    def save(self) -> dict[str, Any]:
        """Return values that JSON can hold, and arrays, for :meth:`restore`."""
        self.state.position = self.interpreter.position
        if self.model.impact is not None:
            self.state.first_dt = self.model.impact.first_dt
        recorder = {f"recorder/{name}": value for name, value in self.recorder.state().items()}
        return {**saved_values(self.state, "state"), **recorder, "printed": self.printer.state()}

    def restore(self, stored: dict[str, Any]) -> None:
        """Continue from the saved state of another simulation of the same problem.

        Raises KeyError if something is missing, ValueError if an array has another shape or type.
        """
        restore(self.state, "state", stored)
        if self.model.impact is not None:
            self.model.impact.first_dt = self.state.first_dt
        self.printer.restore(stored["printed"])
        self.recorder.restore(subset(stored, "recorder/"))
