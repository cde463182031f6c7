"""The recorder: turns the states of a run into the rows of its result.

Scalars of every step are gathered in blocks; what can be computed from a block (the transducer, the
projectile's energies, the balance) is computed when it is full.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from fecm.assembly import PlateModel
from fecm.impact import DivergenceError, Impact, ImpactState, inner
from fecm.plate import STRAINS, StrainField
from fecm.program import Tally
from fecm.projectile import Station
from fecm.results.schema import DATASETS
from fecm.results.sinks import RowBuffer, Sink

Floats = NDArray[np.float64]

BLOCK = 512
# A run whose energy has grown by this factor has diverged.
GROWTH = 10.0

SCALARS = (
    "step", "time", "force", "indentation", "plate_w",
    "plate_kinetic", "plate_strain", "contact_work", "external_work",
)  # fmt: skip
HISTORY = ("force", "indentation", "transducer", "displacement", "velocity", "acceleration")


class Recorder:
    """Stores a run's rows in a sink.

    Parameters
    ----------
    sink : Sink
        Receives the rows.
    impact : Impact
        The run's plate and projectile.
    station : Station
        The transducer.
    strains : StrainField
        Evaluates strains where they are stored.
    sizes : Tally
        How many rows there will be.
    contact_at_every_step : bool
        Store contact at every step instead of at every N-th (the slip ``tapes``).
    watches : bool
        Stop the run when its energy grows without bound; it is stopped in any case when the energy
        is no longer finite.
    """

    def __init__(
        self,
        sink: Sink,
        impact: Impact,
        station: Station,
        strains: StrainField,
        sizes: Tally,
        *,
        contact_at_every_step: bool = False,
        watches: bool = True,
    ) -> None:
        self._sink = sink
        self._impact = impact
        self._strains = strains
        self._watches = watches
        rod = impact.rod
        element = min(station.node, rod.elements) - 1
        self._station = 2 * station.node - 1
        self._gauge = station.sign * rod.modulus * float(rod.areas[element])
        self._rows: list[tuple[float, ...]] = []
        self._rod = np.empty((BLOCK, *impact.start().rod.motion.shape))
        self._stored = 0
        self._mass = impact.plate.mass
        self._momentum = np.empty_like(self._mass)
        self._flexibility, self._flexibility_dt = self._mass, math.nan
        self._tape9_rows = 0
        self._buffers: dict[str, RowBuffer] = {}
        self._contact_rows: list[int] = []
        self._all_contact = contact_at_every_step
        self._initial = self.initial_energy(impact)
        self._create(sizes)

    @staticmethod
    def initial_energy(impact: Impact) -> float:
        """Kinetic energy of the projectile before the first step (force*length)."""
        velocity = impact.start().rod.velocity
        return float(0.5 * np.einsum("i,i,i", impact.rod_mass, velocity, velocity))

    def _create(self, sizes: Tally) -> None:
        """Make room for every dataset, and store what is known before the first step."""
        mesh = self._impact.plate.mesh
        numbers = {
            "numnp": mesh.coordinates.shape[0], "ndm": mesh.coordinates.shape[1],
            "numel": mesh.elements.shape[0], "nen": mesh.elements.shape[1],
            "ndf": mesh.equations.shape[1], "npt": self._strains.shape[1],
            "steps": sizes.steps, "n3": sizes.displacement_rows, "n8": sizes.contact_rows,
            "n9": sizes.steps if self._all_contact else sizes.contact_rows,
        }  # fmt: skip
        shapes = {
            dataset.path: tuple(numbers[n] if isinstance(n, str) else n for n in dataset.shape)
            for dataset in DATASETS.values()
        }
        for path, shape in shapes.items():
            if all(shape):
                self._sink.create(DATASETS[path], shape)
        for group in ("tape3", "tape8"):
            if shapes[f"{group}/step"][0]:
                members = [d for d in DATASETS.values() if d.group == group]
                self._buffers[group] = RowBuffer(
                    self._sink, members, [shapes[d.path] for d in members]
                )
        if sizes.steps:
            self._sink.attributes("energy", {"initial": self._initial})
        laminate = self._impact.plate.laminate
        for path, array in (
            ("mesh/coordinates", mesh.coordinates),
            ("mesh/elements", mesh.elements),
            ("mesh/equations", mesh.equations),
            ("laminate/A", laminate.A),
            ("laminate/B", laminate.B),
            ("laminate/D", laminate.D),
            ("laminate/shear", laminate.shear),
        ):
            self._sink.write(path, 0, array)

    def step(self, state: ImpactState, proportional: float, contact_row: bool) -> None:
        """Note the state after a step.

        Parameters
        ----------
        state : ImpactState
        proportional : float
            Load factor of nodal forces.
        contact_row : bool
            Whether the step's contact goes to a tape.
        """
        # The stored velocity is half a step old; energy needs it at the displacement's instant.
        velocity = self._impact.unbalanced(state, proportional)
        velocity *= self._half_flexibility(state.dt)
        velocity += state.velocity
        strain = 0.5 * inner(state.displacement, state.internal)
        momentum = np.multiply(self._mass, velocity, out=self._momentum)
        kinetic = 0.5 * inner(momentum, velocity)
        self._rod[len(self._rows)] = state.rod.motion
        if contact_row or self._all_contact:
            self._contact_rows.append(len(self._rows))
        self._rows.append(
            (
                state.step, state.time, state.contact.force, state.contact.indentation,
                state.plate_w, kinetic, strain, state.contact_work, state.external_work,
            )
        )  # fmt: skip
        if len(self._rows) == BLOCK:
            self.flush()

    def _half_flexibility(self, dt: float) -> Floats:
        """Half a time step over the plate's mass, (neq,)."""
        if dt != self._flexibility_dt:
            self._flexibility, self._flexibility_dt = 0.5 * dt / self._mass, dt
        return self._flexibility

    def flush(self) -> None:
        """Store what was gathered.

        Raises
        ------
        DivergenceError
            If the energy has grown without bound.
        """
        count = len(self._rows)
        if not count:
            return
        table = dict(zip(SCALARS, np.array(self._rows).T, strict=True))
        motion = self._rod[:count]
        u, v = motion[:, 0], motion[:, 1]
        table["transducer"] = self._gauge * u[:, self._station]
        table["displacement"], table["velocity"], table["acceleration"] = motion[:, :, 0].T
        table["projectile_kinetic"] = 0.5 * np.einsum("ri,i->r", v**2, self._impact.rod_mass)
        table["projectile_strain"] = 0.5 * np.einsum(
            "ri,ij,rj->r", u, self._impact.rod_stiffness, u, optimize=False
        )
        held = (
            table["plate_kinetic"] + table["plate_strain"]
            + table["projectile_kinetic"] + table["projectile_strain"] + table["contact_work"]
        )  # fmt: skip
        table["balance_error"] = held - self._initial - table["external_work"]
        self._watch(table, held)
        for group in ("history", "energy"):
            for dataset in DATASETS.values():
                if dataset.group == group:
                    self._sink.write(dataset.path, self._stored, table[dataset.name])
        rows = np.array(self._contact_rows, dtype=int)
        if len(rows):
            for name in ("step", "time", *HISTORY):
                self._sink.write(f"tape9/{name}", self._tape9_rows, table[name][rows])
            self._tape9_rows += len(rows)
        self._stored += count
        self._rows.clear()
        self._contact_rows.clear()

    def _watch(self, table: Mapping[str, Floats], held: Floats) -> None:
        lost = ~np.isfinite(held)
        if lost.any():
            row = int(np.flatnonzero(lost)[0])
            raise DivergenceError(int(table["step"][row]), "the motion is no longer finite")
        given = self._initial + np.maximum.accumulate(np.abs(table["external_work"]))
        lost = ~(np.abs(held) <= GROWTH * given) & (given > 0.0)
        if self._watches and lost.any():
            row = int(np.flatnonzero(lost)[0])
            factor = held[row] / given[row]
            raise DivergenceError(
                int(table["step"][row]),
                f"the energy has grown to {factor:.3g} times what was given",
            )

    def displacements(self, plate: PlateModel, state: ImpactState, factor: float) -> None:
        """Store a row of tape3."""
        field = plate.field(state.displacement, factor)
        self._buffers["tape3"].put(
            {"step": state.step, "time": state.time, "w": field[:, 2], "displacement": field}
        )

    def strain_row(self, step: int, time: float, field: Floats) -> None:
        """Store a row of tape8.

        Parameters
        ----------
        step : int
            The step at which it is stored.
        time : float
            The time of the displacements.
        field : ndarray (numnp, 5)
            All unknowns of all nodes.
        """
        columns = dict(zip(STRAINS, self._strains.evaluate(field), strict=True))
        self._buffers["tape8"].put({"step": step, "time": time, **columns})

    def finish(self) -> None:
        """Store all that is still held back.

        Raises
        ------
        DivergenceError
            If the energy has grown without bound.
        """
        self.flush()
        for buffer in self._buffers.values():
            buffer.flush()
