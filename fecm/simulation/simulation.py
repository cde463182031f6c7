"""One run of a problem: its model, state, outputs and observers."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any

import numpy as np

from fecm._typing import Floats
from fecm.deck.records import load_factor
from fecm.mechanics.impact import ImpactState
from fecm.mechanics.plate_motion import DivergenceError, PlateState
from fecm.mechanics.ply_stresses import FailureEnvelope
from fecm.mechanics.solutions import Tangent
from fecm.problem.build import RunOptions, Threshold, build_model
from fecm.problem.problem import Problem
from fecm.results.sinks import Sink
from fecm.simulation.interpreter import Interpreter
from fecm.simulation.printout import Printer
from fecm.simulation.recorder import Recorder, subset
from fecm.simulation.step_recorder import Columns

TOLERANCE = 1.0e-9  # relative change of the displacement below which CONV leaves its loop


@dataclass
class Monitor:
    """Energy balance and largest contact force of the steps so far."""

    # Largest and last work of the nodal forces, and its largest change in a step (force*length).
    largest_work: float = 0.0
    last_work: float = 0.0
    largest_jump: float = 0.0
    worst_error: float = 0.0  # largest error, relative to the supplied energy
    worst_step: int = 0  # its step
    peak_force: float = 0.0  # largest contact force
    crossing: float = math.nan  # when it first reached the delamination threshold

    def add(
        self, block: Columns, initial: float, limit: float | None, threshold: Threshold | None
    ) -> None:
        """Add a block of steps; `initial` is the energy before the first.

        The error is relative to the energy supplied up to the end of the block: in its first steps
        a load has done almost no work.  The work of one step is not counted as an error: the work
        belongs to the step, the energies to its end.  Raises DivergenceError if the energy is not
        finite, or the error exceeds the limit, if there is one.
        """
        lost = ~np.isfinite(block["held_energy"])
        if lost.any():
            step = int(block["step"][np.flatnonzero(lost)[0]])
            raise DivergenceError(step, "the motion is no longer finite")
        if threshold is not None:
            self.peak_force = max(self.peak_force, float(block["force"].max()))
            above = np.flatnonzero(block["force"] >= threshold.force)
            if len(above) and math.isnan(self.crossing):
                self.crossing = float(block["time"][above[0]])
        work = block["external_work"]
        self.largest_work = max(self.largest_work, float(np.abs(work).max()))
        jump = float(np.abs(np.diff(work, prepend=self.last_work)).max())
        self.largest_jump, self.last_work = max(self.largest_jump, jump), float(work[-1])
        supplied = initial + self.largest_work
        if not supplied > 0.0:
            return
        error = np.maximum(np.abs(block["balance_error"]) - self.largest_jump, 0.0) / supplied
        row = int(error.argmax())
        if error[row] > self.worst_error:
            self.worst_error, self.worst_step = float(error[row]), int(block["step"][row])
        if limit is not None and error[row] > limit:
            row = int(np.flatnonzero(error > limit)[0])
            off = f"the energy balance is off by {error[row]:.2%} of the supplied energy"
            reason = f"{off}, more than the limit of {limit:.3g}"
            raise DivergenceError(int(block["step"][row]), reason)


@dataclass
class RunState:
    """State passed from one macro to the next; a checkpoint stores every field."""

    plate: PlateState
    impact: ImpactState | None = None  # plate, projectile and contact; shares `plate`
    # The interpreter's position; empty before the first macro.
    position: list[tuple[int, int]] = field(default_factory=list)
    dt: float = 0.0  # time step
    clock: float = 0.0  # time that TIME advances
    load_clock: float = 0.0  # clock at the plate's last central difference
    constant_factor: float = 1.0  # load factor without a table
    table: int | None = None  # index of the current table of proportional loads
    tables_read: int = 0  # tables that PROP has read
    tolerance: float = TOLERANCE  # tolerance of CONV
    consistent_mass: bool = False  # whether CMAS came after LMAS
    factorised: bool = False  # whether TANG was carried out
    converged: bool = False  # whether the last SOLV met the tolerance
    residual: Floats | None = None  # (neq,): load less internal force, formed by FORM
    steps_since_output: int = 0  # impact steps since the last output (the slip ``counter``)
    prop_force: float | None = None  # instead of the contact force (the slip ``prop-contact``)
    first_dt: float | None = None  # time step of the rod's constants
    monitor: Monitor = field(default_factory=Monitor)
    failure: FailureEnvelope | None = None  # largest exposures so far, of FAIL
    notes: list[str] = field(default_factory=list)  # remarks for the user


Observer = Callable[["Simulation"], object]


@dataclass
class Simulation:
    """A run; building it writes nothing."""

    problem: Problem
    sink: Sink  # receives the result
    options: RunOptions = field(default_factory=RunOptions)  # how the problem is run
    printer: Printer = field(default_factory=Printer)  # writes the printed output
    # Called with the simulation every `interval` steps; may write a checkpoint or raise.
    observers: Sequence[Observer] = ()
    on_macro: Observer = lambda simulation: None  # the same after every macro; must be fast

    def __post_init__(self) -> None:
        problem, options = self.problem, self.options
        with np.errstate(all="ignore"):
            self.model = build_model(problem, options)
        self.state = state = RunState(self.model.motion.start())
        if self.model.impact is not None:
            state.impact = self.model.impact.start(state.plate)
        if self.model.failure is not None:
            state.failure = self.model.failure.start()
        if "prop-contact" in options.slips:
            state.prop_force = 1.0  # PROP's first value in the listing
        self.interpreter = Interpreter(problem.program)
        # Steps between two calls of the observers.
        most, work = (64, 100_000) if self.model.steps is None else (4096, 20_000_000)
        self.interval = max(1, min(most, work // self.model.plate.neq))
        limit = None if options.slips else options.energy_limit
        # Without a reference to the run, which would keep it alive.
        on_block = partial(state.monitor.add, limit=limit, threshold=problem.threshold)
        tapes = "tapes" in options.slips
        self.recorder = Recorder(self.sink, self.model, problem.work, tapes, on_block)

    @cached_property
    def tangent(self) -> Tangent:
        """The factorised stiffness."""
        return Tangent(self.model.plate)

    def load_factor(self, clock: float) -> float:
        """Load factor of PROP at a time of the clock; under its slip that of t = 0."""
        state = self.state
        if state.table is None or "prop" in self.options.slips:
            return state.constant_factor
        return load_factor(self.problem.deck.tables[state.table], clock)

    def force_factor(self, clock: float | None = None) -> float:
        """Factor of FORC's values at a time of the clock, by default now."""
        state = self.state
        if "force-scale" in self.options.slips and state.impact is not None:
            contact = float(state.impact.contact.force)
            return contact if state.prop_force is None else state.prop_force
        return self.load_factor(state.clock if clock is None else clock)

    def displacement_field(self) -> Floats:
        """Displacement of every dof of every node, (numnp, 5)."""
        return self.model.motion.field(self.state.plate, self.force_factor())

    def observe(self) -> None:
        """Call the observers after every `interval` steps."""
        if not self.state.plate.step % self.interval:
            for observer in self.observers:
                observer(self)

    def save(self) -> dict[str, Any]:
        """Values that JSON can hold and arrays, for :meth:`restore`."""
        self.state.position = self.interpreter.position
        if self.model.impact is not None:
            self.state.first_dt = self.model.impact.first_dt
        recorder = {f"recorder/{name}": value for name, value in self.recorder.state().items()}
        return {**save(self.state, "state"), **recorder, "printed": self.printer.state()}

    def restore(self, stored: dict[str, Any]) -> None:
        """Continue from the saved state of another simulation of the same problem.

        Raises KeyError if something is missing.  Raises ValueError if an array has another shape or
        type.
        """
        restore(self.state, "state", stored)
        if self.model.impact is not None:
            self.model.impact.first_dt = self.state.first_dt
        self.printer.restore(stored["printed"])
        self.recorder.restore(subset(stored, "recorder/"))


def _names(value: object) -> tuple[str, ...]:
    """Names of the fields of a dataclass or named tuple."""
    if dataclasses.is_dataclass(value):
        return tuple(f.name for f in dataclasses.fields(value) if f.init)
    return getattr(value, "_fields", ())


def save(value: object, path: str, seen: set[int] | None = None) -> dict[str, Any]:
    """Values and arrays of a dataclass and its members, by path; shared members only once."""
    names, seen = _names(value), set() if seen is None else seen
    if not names:
        return {path: value.copy() if isinstance(value, np.ndarray) else value}
    if id(value) in seen:
        return {}
    seen.add(id(value))
    members = (save(getattr(value, name), f"{path}/{name}", seen) for name in names)
    return {name: one for member in members for name, one in member.items()}


def restore(value: Any, path: str, stored: Mapping[str, Any], seen: set[int] | None = None) -> Any:
    """Set a dataclass to the state that :func:`save` returned for another of the same type.

    Returns the value; dataclasses and arrays are changed in place where they can be.
    """
    names, seen = _names(value), set() if seen is None else seen
    if not names:
        new = stored[path]
        if not isinstance(value, np.ndarray):
            return new
        if new.shape != value.shape or new.dtype != value.dtype:
            raise ValueError(f"{path} has another shape or type")
        value[...] = new
        return value
    if id(value) in seen:
        return value
    seen.add(id(value))
    new = {name: restore(getattr(value, name), f"{path}/{name}", stored, seen) for name in names}
    if isinstance(value, tuple) or "__setattr__" in vars(type(value)):  # frozen
        return type(value)(**new)
    for name, one in new.items():
        setattr(value, name, one)
    return value
