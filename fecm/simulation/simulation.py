"""A run: one problem's macro program, carried out from its model to its result."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from fecm._typing import Floats
from fecm._version import __version__
from fecm.deck.macros import number
from fecm.deck.model import Material
from fecm.deck.records import LoadTable, Macro, load_factor
from fecm.deck.units import unit_names
from fecm.mechanics.impact import ImpactState
from fecm.mechanics.natural_modes import modes
from fecm.mechanics.plate import UnsoundPlateError
from fecm.mechanics.plate_motion import DivergenceError, PlateState
from fecm.mechanics.statics import Tangent, reactions
from fecm.mechanics.stiffness_product import SAFE
from fecm.mechanics.strains import strains_and_resultants
from fecm.mechanics.time_step import critical_time_step, taken_time_step
from fecm.problem.build import ImpactModel, build_model
from fecm.problem.contact_step import contact_step
from fecm.problem.options import RunOptions
from fecm.problem.problem import Problem
from fecm.problem.slips import LISTING, NAMES, REPORT
from fecm.results.schema import FORMAT, FORMAT_VERSION
from fecm.results.sinks import Sink
from fecm.simulation.interpreter import Act, Course, EndedError, tally
from fecm.simulation.printout import Printer
from fecm.simulation.recorder import Recorder, with_prefix

Progress = Callable[[int, int], None]
Look = Callable[["Simulation"], None]

# Error of the energy balance, as a part of what was given, that is told.
ENERGY_WARNING = 0.01

# Change of the displacement, relative to it, below which CONV leaves its loop.
TOLERANCE = 1.0e-9


@dataclass
class Simulation:
    """Carries out a macro program.

    Attributes
    ----------
    checked : Problem
        The problem.
    sink : Sink
        Receives the result.
    choices : RunOptions
        How it is run.
    progress : callable
        Told of steps taken and steps to take, now and then.
    printer : Printer
        Writes the printed output.
    look : callable
        Called between two steps, as often as `progress`; may write a checkpoint, or end the run.
    urgent : callable
        Asked between two macros whether to call `look` at once; may raise before the run begins.
    notes : list of str
        What the user should know of the run.
    """

    checked: Problem
    sink: Sink
    choices: RunOptions = field(default_factory=RunOptions)
    progress: Progress = lambda done, steps: None
    printer: Printer = field(default_factory=Printer)
    look: Look = lambda simulation: None
    urgent: Callable[[], bool] = lambda: False
    notes: list[str] = field(default_factory=list, init=False)
    slips: frozenset[str] = field(init=False)
    setup: ImpactModel = field(init=False)
    plate: PlateState = field(init=False)
    impact: ImpactState | None = field(default=None, init=False)
    dt: float = field(default=0.0, init=False)
    clock: float = field(default=0.0, init=False)
    constant_factor: float = field(default=1.0, init=False)
    table: LoadTable | None = field(default=None, init=False)
    tolerance: float = field(default=TOLERANCE, init=False)
    consistent: bool = field(default=False, init=False)
    course: Course = field(init=False)
    _tangent: Tangent | None = field(default=None, init=False)
    _residual: Floats | None = field(default=None, init=False)
    _settled: bool = field(default=False, init=False)
    _state_clock: float = field(default=0.0, init=False)
    # Under the slip `counter`, impact steps since the last output.
    _counted: int = field(default=0, init=False)
    # Under the slip `prop-contact`, what PROP has put in the place of the contact force.
    _replaced: float | None = field(default=None, init=False)
    _place: list[tuple[int, int]] = field(default_factory=list, init=False)

    def __post_init__(self) -> None:
        deck, mesh, program = self.checked.deck, self.checked.mesh, self.checked.program
        self.slips = self.choices.slips
        with np.errstate(all="ignore"):
            self.setup = build_model(self.checked, self.choices)
        self.plate = self.setup.motion.start()
        if self.setup.impact is not None:
            self.impact = self.setup.impact.start(self.plate)
        self.course = Course(program)
        self._sizes = tally(program, self.urgent, counts_anew="counter" in self.slips)
        if "prop-contact" in self.slips:
            self._replaced = 1.0  # PROP's first value in the listing
        self._tables = list(deck.tables)
        self._tick = max(1, min(64, 100_000 // self.setup.plate.neq))
        self._header()
        self._recorder = Recorder(
            self.sink,
            self.setup,
            self._sizes,
            contact_at_every_step="tapes" in self.slips,
            limit=None if self.slips else self.choices.energy_limit,
        )
        if self._sizes.contact_rows and self.impact is not None:
            self.sink.attributes("tape8", {"location": self._location()})
        if self._sizes.passes["STRE"]:
            x, y = self.setup.stress_points.places(mesh.coordinates)
            self._recorder.constant("stresses/x", x)
            self._recorder.constant("stresses/y", y)

    def _location(self) -> str:
        at_nodes = self.checked.deck.require(Material).integration.points < 0
        return "nodes" if at_nodes and "tapes" not in self.slips else "gauss"

    def _header(self) -> None:
        deck = self.checked.deck
        listing = self.slips == frozenset(NAMES)
        attributes = {
            "format": FORMAT,
            "format_version": FORMAT_VERSION,
            "fecm_version": __version__,
            "title": deck.title,
            "mode": LISTING if listing else REPORT,
            "slips": sorted(self.slips),
            **self.choices.rod_method.attributes,
            **{f"unit_{name}": unit for name, unit in unit_names(deck).items()},
        }
        self.sink.attributes("", attributes)
        self.sink.text("deck", deck.text or deck.to_text(), "the cards of the problem")

    def _footer(self) -> None:
        if self.impact is None or self.setup.impact is None or not self.plate.step:
            return
        memory, point = self.impact.memory, self.impact.contact
        permanent = self.setup.impact.law.permanent(memory, point)
        values = {
            "permanent_indentation": permanent,
            "unsettled_steps": self.impact.unconverged_steps,
        }
        self.sink.attributes("history", values)

    def run(self) -> None:
        """Carry out the program, from its begin or from where :meth:`restore` has put it.

        Raises
        ------
        DivergenceError
            If the motion grows without bound; the message names the likely cause.
        SingularStiffnessError
            If a static solution is asked for and the plate is not held.
        """
        if not self._place:
            self.printer.problem(self.checked.deck, self.checked.mesh, self.setup.plate)
        try:
            with np.errstate(all="ignore"):  # an overflow is found, and said better, below
                self.course.run(self._bind, self._place, self._between)
                self._recorder.finish()
            self._footer()
            self._judge()
        except DivergenceError as diverged:
            raise DivergenceError(diverged.step, f"{diverged.reason}; {self._cause()}") from None

    def _judge(self) -> None:
        """Note what makes the result doubtful."""
        error, step = self._recorder.steps.worst
        if error > ENERGY_WARNING:
            why = " (slips are on: it is not judged)" if self.slips else ""
            self.notes.append(
                f"the energy balance is off by {error:.2%} of what was given, at step {step}{why}"
            )
        if self.impact is not None and self.impact.unconverged_steps and not self.slips:
            self.notes.append(
                f"the contact iteration did not settle in {self.impact.unconverged_steps} "
                "steps; a smaller DT helps"
            )

    def state(self) -> dict[str, Any]:
        """Everything that :meth:`restore` needs: values that JSON knows, and arrays."""
        plate = self.impact.to_arrays() if self.impact is not None else self.plate.to_arrays()
        table = None if self.table is None else self.checked.deck.tables.index(self.table)
        state = {
            "place": [list(with_prefix) for with_prefix in self.course.place],
            "dt": self.dt, "clock": self.clock, "state_clock": self._state_clock,
            "constant_factor": self.constant_factor, "table": table, "tables": len(self._tables),
            "tolerance": self.tolerance, "consistent": self.consistent, "notes": list(self.notes),
            "tangent": self._tangent is not None, "settled": self._settled,
            "residual": np.empty(0) if self._residual is None else self._residual,
            "counted": self._counted, "replaced": self._replaced,
            "printed": self.printer.state(),
            "first_dt": None if self.setup.impact is None else self.setup.impact.first_dt,
        }  # fmt: skip
        state |= {f"state/{name}": array for name, array in plate.items()}
        state |= {f"recorder/{name}": value for name, value in self._recorder.state().items()}
        return state

    def restore(self, state: Mapping[str, Any]) -> None:
        """Take the state that another simulation of the same problem gave."""
        if self.impact is not None:
            self.impact = ImpactState.from_arrays(with_prefix(state, "state/"))
            self.plate = self.impact.plate
        else:
            self.plate = PlateState.from_arrays(with_prefix(state, "state/"))
        self.dt, self.clock, self._state_clock = state["dt"], state["clock"], state["state_clock"]
        self.constant_factor, self.tolerance = state["constant_factor"], state["tolerance"]
        tables = self.checked.deck.tables
        self.table = None if state["table"] is None else tables[state["table"]]
        self._tables = list(tables[len(tables) - state["tables"] :])
        self.consistent, self.notes = state["consistent"], list(state["notes"])
        if state["tangent"]:
            self._tangent = Tangent(self.setup.plate)
        self._settled = state["settled"]
        self._counted, self._replaced = state["counted"], state["replaced"]
        self._residual = state["residual"] if len(state["residual"]) else None
        if self.setup.impact is not None:
            self.setup.impact.first_dt = state["first_dt"]
        self.printer.restore(state["printed"])
        self._recorder.restore(with_prefix(state, "recorder/"))
        self._place = [(index, current) for index, current in state["place"]]

    def _between(self) -> None:
        if self.urgent():
            self.look(self)

    def _bind(self, macro: Macro) -> Act:
        """What a macro does, given the pass."""
        return partial(ACTIONS[macro.word], self, number(macro))

    def _cause(self) -> str:
        """Why a run diverged, as far as the time step tells."""
        deck, plate = self.checked.deck, self.setup.plate
        try:
            critical = critical_time_step(self.setup.motion.plate)
            contact = None
            if self.impact is not None:
                contact = contact_step(deck, plate, self.dt)
        except UnsoundPlateError as error:
            return str(error)
        above = self.dt > critical
        cause = (
            f"DT = {self.dt:.4g} is {'above' if above else 'below'} the plate's critical time "
            f"step {critical:.4g}"
        )
        if above:
            return cause
        if contact is not None and self.dt >= contact.limit:
            return (
                f"{cause}, but not below {contact.limit:.4g}, the stable step with the contact's "
                f"stiffness k_t of about {contact.stiffness:.3g} (the contact needs DT < "
                f"2 (m/k_t)^(1/2), m = {contact.mass:.3g})"
            )
        if len({macro.value for macro in deck.macros if macro.word == "DT"}) > 1:
            return f"{cause}, but DT changes: steps that alternate diverge below the critical one"
        return cause

    # Loads ---------------------------------------------------------------------------------------

    def factor(self, clock: float | None = None) -> float:
        """Load factor of FORC's values at a time of the clock, now without one."""
        if "force-scale" in self.slips and self.impact is not None:
            contact = float(self.impact.contact.force)
            return contact if self._replaced is None else self._replaced
        return self._load_factor(clock)

    def _load_factor(self, clock: float | None = None) -> float:
        """PROP's load factor at a time of the clock, now without one."""
        if self.table is None or "prop" in self.slips:
            return self.constant_factor
        return load_factor(self.table, self.clock if clock is None else clock)

    def field(self) -> Floats:
        """Every unknown of every node now, (numnp, 5)."""
        return self.setup.motion.field(self.plate, self.factor())

    def proportional_load(self, n: float, current: int) -> None:
        """PROP: read a table, or (under the slip ``prop``) take its value at t = 0."""
        if n > 0:
            self.table = self._tables.pop(0) if self._tables else self.table
            self.constant_factor = 0.0
        elif self.table is not None:
            self.constant_factor = load_factor(self.table, 0.0)
        if "prop-contact" in self.slips:
            self._replaced = self._load_factor()

    def set_time_step(self, n: float, current: int) -> None:
        """DT; 0 takes a part of the critical time step."""
        self.dt = n
        if not self.dt:
            critical = critical_time_step(self.setup.motion.plate)
            self.dt = taken_time_step(critical)
            self.notes.append(f"DT 0: took {self.dt:g}, {SAFE:g} of the critical {critical:.4g}")

    def advance_clock(self, n: float, current: int) -> None:
        """TIME."""
        if "time" not in self.slips:
            self.clock += self.dt

    # Time steps ----------------------------------------------------------------------------------

    def _before_step(self) -> None:
        if not self.plate.step:
            self._recorder.steps.begin(self.plate, self.impact)

    def _after_step(self) -> None:
        if not self.plate.step % self._tick:
            self.progress(self.plate.step, self._sizes.steps)
            self.look(self)

    def impact_step(self, n: int, current: int) -> None:
        """RODP: one impact step; contact and strains at every N-th."""
        if self.setup.impact is None or self.impact is None:
            return
        self._before_step()
        plate = self.plate
        if not plate.step:
            self._replaced = None  # the listing's first impact step begins with PROP = 0
        stores = self._stores(n)
        if stores and "tapes" in self.slips:
            self._recorder.strains(plate.step + 1, plate.time, self.field())
        self.setup.impact.advance(self.impact, self.dt, self.factor(), self._replaced)
        self._replaced = None
        self._recorder.steps.step(plate, self.impact, self.factor(), contact_row=stores)
        if stores and "tapes" not in self.slips:
            self._recorder.strains(plate.step, plate.time, self.field())
        self._after_step()

    def _stores(self, n: int) -> bool:
        """Whether the impact step that begins stores contact and strains."""
        if "counter" not in self.slips:
            return not (self.plate.step + 1) % n
        self._counted += 1
        stores = self._counted == n
        if self._counted >= n:
            self._counted = 0
        return stores

    def central_difference(self, n: float, current: int) -> None:
        """EXCD: one step of the plate alone, under the given loads."""
        self._before_step()
        # Central differences take the loads of the state's own instant, which TIME has left.
        factor = self.factor(self._state_clock)
        self.setup.motion.central_difference(self.plate, self.dt, factor)
        self._state_clock = self.clock
        self._recorder.steps.step(self.plate, self.impact, self.factor())
        self._after_step()

    # Statics and modes ---------------------------------------------------------------------------

    def form_tangent(self, n: float, current: int) -> None:
        """TANG."""
        if self._tangent is None:
            self._tangent = Tangent(self.setup.plate)

    def form_residual(self, n: float, current: int) -> None:
        """FORM."""
        self._residual = self.setup.motion.unbalanced(self.plate, self.factor())

    def solve(self, n: float, current: int) -> None:
        """SOLV."""
        if self._tangent is None or self._residual is None:
            return
        change = self._tangent.solve(self._residual)
        self.setup.motion.displace(self.plate, change)
        size = float(np.linalg.norm(self.plate.displacement))
        self._settled = float(np.linalg.norm(change)) <= self.tolerance * size

    def set_tolerance(self, n: float, current: int) -> None:
        """TOL."""
        self.tolerance = n

    def leave_if_settled(self, n: float, current: int) -> bool:
        """CONV: leave the loop once the last solution changed nothing."""
        return self._settled

    def lump_mass(self, n: float, current: int) -> None:
        """LMAS."""
        self.consistent = False

    def form_consistent_mass(self, n: float, current: int) -> None:
        """CMAS."""
        self.consistent = True

    def find_modes(self, n: int, current: int) -> None:
        """EIGE."""
        found = modes(self.setup.plate, n, consistent=self.consistent)
        for mode, (omega, shape) in enumerate(
            zip(found.angular_frequency, found.shapes, strict=True), start=1
        ):
            field = self.setup.plate.field(shape, 0.0)
            columns = {"number": mode, "angular_frequency": omega, "shape": field}
            self._recorder.row("modes", self.plate.step, self.plate.time, columns)
        self.printer.modes(found.angular_frequency)

    # Output --------------------------------------------------------------------------------------

    def store_displacements(self, n: float, current: int) -> None:
        """DISP."""
        if current % n == 0:
            field = self.field()
            self._recorder.displacements(self.plate.step, self.plate.time, field)
            if self.impact is None:
                self.printer.displacements(field, self.plate.time)

    def store_reactions(self, n: float, current: int) -> None:
        """REAC."""
        force = reactions(self.setup.plate, self.field(), self.factor())
        self._recorder.row("reactions", self.plate.step, self.plate.time, {"force": force})
        self.printer.reactions(force, self.checked.mesh, self.plate.time)

    def store_stresses(self, n: float, current: int) -> None:
        """STRE."""
        if current % n:
            return
        points = self.setup.stress_points
        values = strains_and_resultants(points, self.setup.plate.laminate, self.field())
        self._recorder.row("stresses", self.plate.step, self.plate.time, values)
        places = points.places(self.checked.mesh.coordinates)
        self.printer.stresses(values, places, self.clock)

    def check(self, n: float, current: int) -> None:
        """CHEC; ends the program under its slip."""
        profile = self.setup.plate.profile()
        self.sink.attributes("mesh", {"equations": self.setup.plate.neq, "profile": profile})
        self.printer.check(self.setup.plate, profile)
        if "check-end" in self.slips:
            raise EndedError


# Given N, or what else stands on the card, and the pass; True leaves the innermost loop.
Action = Callable[[Simulation, Any, int], "bool | None"]

ACTIONS: dict[str, Action] = {
    "DT": Simulation.set_time_step,
    "TIME": Simulation.advance_clock,
    "PROP": Simulation.proportional_load,
    "LMAS": Simulation.lump_mass,
    "CMAS": Simulation.form_consistent_mass,
    "TANG": Simulation.form_tangent,
    "FORM": Simulation.form_residual,
    "SOLV": Simulation.solve,
    "TOL": Simulation.set_tolerance,
    "CONV": Simulation.leave_if_settled,
    "REAC": Simulation.store_reactions,
    "EIGE": Simulation.find_modes,
    "EXCD": Simulation.central_difference,
    "RODP": Simulation.impact_step,
    "DISP": Simulation.store_displacements,
    "STRE": Simulation.store_stresses,
    "CHEC": Simulation.check,
}


def simulate(checked: Problem, sink: Sink, choices: RunOptions | None = None) -> Simulation:
    """Run a problem into a sink and return the finished simulation.

    Raises
    ------
    DivergenceError
        If the motion grows without bound, or the energy balance passes its limit.
    SingularStiffnessError
        If a static solution is asked for and the plate is not held.
    """
    simulation = Simulation(checked, sink, choices or RunOptions())
    simulation.run()
    return simulation
