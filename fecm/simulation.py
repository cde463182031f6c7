"""A run: one problem's macro program, carried out from its model to its result."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import numpy as np

from fecm.check import Checked
from fecm.deck.model import Macro, Material
from fecm.impact import DivergenceError, ImpactState
from fecm.indentation import VIRGIN
from fecm.parts import Setup, set_up
from fecm.program import every, tally, walk
from fecm.recorder import Recorder
from fecm.results.schema import FORMAT, FORMAT_VERSION
from fecm.results.sinks import Sink
from fecm.slips import LISTING, NAMES, REPORT
from fecm.units import unit_names
from fecm.version import __version__

Progress = Callable[[int, int], None]


@dataclass
class Simulation:
    """Carries out a macro program.

    Attributes
    ----------
    checked : Checked
        The problem.
    slips : frozenset of str
        Slips that are on.
    sink : Sink
        Receives the result.
    progress : callable
        Told of steps taken and steps to take, now and then.
    """

    checked: Checked
    slips: frozenset[str]
    sink: Sink
    progress: Progress = lambda done, steps: None
    setup: Setup = field(init=False)
    state: ImpactState = field(init=False)
    dt: float = field(default=0.0, init=False)
    clock: float = field(default=0.0, init=False)
    proportional: float = field(default=1.0, init=False)

    def __post_init__(self) -> None:
        self.setup = set_up(self.checked.deck, self.checked.mesh, self.slips)
        self.state = self.setup.impact.start()
        self._sizes = tally(self.checked.program)
        self._tick = max(1, min(64, 100_000 // self.setup.plate.neq))
        self._header()
        self._recorder = Recorder(
            self.sink,
            self.setup.impact,
            self.setup.station,
            self.setup.strains,
            self._sizes,
            contact_at_every_step="tapes" in self.slips,
            watches=not self.slips,
        )
        if self._sizes.contact_rows:
            self.sink.attributes("tape8", {"location": self._location()})

    def _location(self) -> str:
        at_nodes = self.checked.deck.need(Material).integration.points < 0
        return "nodes" if at_nodes and "tapes" not in self.slips else "gauss"

    def _header(self) -> None:
        deck = self.checked.deck
        listing = self.slips == frozenset(NAMES)
        self.sink.attributes(
            "",
            {
                "format": FORMAT,
                "format_version": FORMAT_VERSION,
                "fecm_version": __version__,
                "title": deck.title,
                "mode": LISTING if listing else REPORT,
                "slips": sorted(self.slips),
                **{f"unit_{name}": unit for name, unit in unit_names(deck).items()},
            },
        )
        self.sink.text("deck", deck.text or deck.to_text(), "the cards of the problem")

    def _footer(self) -> None:
        if self.state.step:
            memory, point = self.state.memory, self.state.contact
            peak = point.indentation if memory.branch == VIRGIN else memory.peak
            permanent = self.setup.impact.law.constants.permanent(max(peak, memory.peak))
            self.sink.attributes(
                "history",
                {
                    "permanent_indentation": float(permanent),
                    "unsettled_steps": self.state.unsettled,
                },
            )

    def run(self) -> None:
        """Carry out the program.

        Raises
        ------
        DivergenceError
            If the motion grows without bound; the message names the likely cause.
        """
        actions = {
            "LMAS": self._form_mass,
            "DT": self._set_time_step,
            "TIME": self._advance_clock,
            "RODP": self._impact_step,
            "DISP": self._store_displacements,
        }
        try:
            with np.errstate(all="ignore"):  # an overflow is found, and said better, below
                for macro, current in walk(self.checked.program):
                    actions[macro.word](macro, current)
                self._recorder.finish()
            self._footer()
        except DivergenceError as diverged:
            raise DivergenceError(diverged.step, f"{diverged.reason}; {self._cause()}") from None

    def _cause(self) -> str:
        """Why a run diverged, as far as the time step tells."""
        critical = self.setup.plate.critical_time_step()
        if self.dt > critical:
            return f"DT = {self.dt:.4g} is above the plate's critical time step {critical:.4g}"
        return f"DT = {self.dt:.4g} is below the plate's critical time step {critical:.4g}"

    # Macros --------------------------------------------------------------------------------------

    def _form_mass(self, macro: Macro, current: int) -> None:
        """LMAS: the lumped mass is assembled with the plate."""

    def _set_time_step(self, macro: Macro, current: int) -> None:
        self.dt = macro.value

    def _advance_clock(self, macro: Macro, current: int) -> None:
        if "time" not in self.slips:
            self.clock += self.dt

    def _impact_step(self, macro: Macro, current: int) -> None:
        setup, state = self.setup, self.state
        stores = (state.step + 1) % every(macro) == 0
        if stores and "tapes" in self.slips:
            self._store_strains(state.step + 1)
        setup.impact.advance(state, self.dt, self.proportional)
        self._recorder.step(state, self.proportional, stores)
        if stores and "tapes" not in self.slips:
            self._store_strains(state.step)
        if not state.step % self._tick:
            self.progress(state.step, self._sizes.steps)

    def _load_factor(self) -> float:
        return self.setup.impact.load_factor(self.state, self.proportional)

    def _store_strains(self, step: int) -> None:
        displacement = self.setup.plate.field(self.state.displacement, self._load_factor())
        self._recorder.strain_row(step, self.state.time, displacement)

    def _store_displacements(self, macro: Macro, current: int) -> None:
        if current % every(macro) == 0:
            self._recorder.displacements(self.setup.plate, self.state, self._load_factor())


def simulate(
    checked: Checked,
    slips: Iterable[str],
    sink: Sink,
    progress: Progress = lambda done, steps: None,
) -> Simulation:
    """Run a problem into a sink and return the finished simulation.

    Raises
    ------
    DivergenceError
        If the motion grows without bound.
    """
    simulation = Simulation(checked, frozenset(slips), sink, progress)
    simulation.run()
    return simulation
