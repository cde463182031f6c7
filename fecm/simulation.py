"""A run: one problem from its model to its result.

Here, and only here, the slips that are on become parameters of the plate, the projectile, the law
and the recorder.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import numpy as np

from fecm.assembly import PlateModel, Rules, assemble
from fecm.check import Checked, rules
from fecm.deck.model import Impact as ImpactCard
from fecm.deck.model import Indentation, Macro, Material
from fecm.impact import Contact, DivergenceError, Impact, ImpactState
from fecm.indentation import VIRGIN, Constants, Law, MemoryLaw, StickyLaw
from fecm.laminate import laminate_of
from fecm.plate import StrainField
from fecm.program import every, tally, walk
from fecm.projectile import LISTING_DENSITY, REPORT_DENSITY, report_rod
from fecm.recorder import Recorder, Station
from fecm.results.schema import FORMAT, FORMAT_VERSION
from fecm.results.sinks import Sink
from fecm.slips import LISTING, NAMES, REPORT
from fecm.version import __version__

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Setup:
    """A problem's parts, ready to run."""

    plate: PlateModel
    impact: Impact
    station: Station
    strains: StrainField


def set_up(checked: Checked, slips: frozenset[str]) -> Setup:
    """Make plate, projectile and law of a checked problem, with the slips that are on."""
    deck, mesh = checked.deck, checked.mesh
    material = deck.need(Material)
    bending, shear, points = rules(material)
    plate = assemble(
        mesh,
        laminate_of(material, isotropic_g12="g12" in slips),
        Rules(
            bending=bending,
            shear=bending if "shear-order" in slips else shear,
            strains=bending if "tapes" in slips else points,
            transposed="jacobian" in slips,
        ),
    )
    card, measured = deck.need(ImpactCard), deck.need(Indentation)
    constants = Constants(measured.k, measured.alpha_p, measured.s_p, measured.q)
    law: Law = StickyLaw(constants) if "reload" in slips else MemoryLaw(constants)
    rod = report_rod(LISTING_DENSITY if "density" in slips else REPORT_DENSITY)
    contact = Contact(
        equation=int(mesh.equations[card.node - 1, card.dof - 1]) - 1,
        velocity=card.velocity,
        plate_moves="target" not in slips,
        strains_start_moving="rod-start" in slips,
        scales_forces="force-scale" in slips,
        keeps_first_step="rod-dt" in slips,
    )
    middle = rod.elements // 2 + 1
    station = Station(middle + 1, 1.0) if "station" in slips else Station(middle)
    return Setup(plate, Impact(plate, rod, law, contact), station, plate.strain_field())


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
        self.setup = set_up(self.checked, self.slips)
        self.state = self.setup.impact.start()
        self._sizes = tally(self.checked.program)
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
        if not state.step % 64:
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
