"""What is noted at every time step: history, energies, and the rows of tape9 among them.

Scalars of every step are gathered in blocks; what can be computed from a block (the transducer, the
projectile's energies, the balance) is computed when it is full.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fecm._typing import Floats
from fecm.mechanics.impact import ImpactState
from fecm.mechanics.plate_motion import DivergenceError, DofSums, PlateState
from fecm.mechanics.projectile import Rod
from fecm.problem.build import ImpactModel
from fecm.results.schema import DATASETS
from fecm.results.sinks import Sink

BLOCK = 1024

SCALARS = (
    "step", "time", "plate_kinetic", "plate_strain", "external_work",
    "force", "indentation", "plate_w", "contact_work", "displacement",
)  # fmt: skip
CONTACT = ("force", "indentation", "transducer", "displacement", "velocity", "acceleration")


class StepRecorder:
    """Notes every step in a sink.

    Parameters
    ----------
    sink : Sink
        Receives the rows; the datasets of history, energy and tape9 stand there already.
    setup : ImpactModel
        The run's parts; a plate alone has energies and gages only.
    contact_at_every_step : bool
        Store contact on tape9 at every step instead of every N-th (the slip ``tapes``).
    limit : float or None
        Error of the energy balance, as a part of what was given, at which the run is stopped; it is
        stopped in any case when the energy is no longer finite.

    Attributes
    ----------
    worst : (float, int)
        Largest error of the energy balance so far, as a part of what was given, and its step.
    """

    def __init__(
        self,
        sink: Sink,
        setup: ImpactModel,
        *,
        contact_at_every_step: bool = False,
        limit: float | None = None,
    ) -> None:
        self._sink = sink
        self._motion = setup.motion
        self._impact = impact = setup.impact
        self._limit = limit
        self._most_work = self._last_work = self._jump = 0.0
        self.worst = (0.0, 0)
        self._all_contact = contact_at_every_step
        self._rows: list[tuple[float, ...]] = []
        self._contact_rows: list[int] = []
        self._stored = self._tape9_rows = 0
        self._station = setup.station
        self._rod = np.empty((0, 3, 0))
        if impact is not None:
            self._rod = np.empty((BLOCK, 3, len(impact.rod_mass)))
        self._gages: DofSums | None = None
        self._strains = np.empty((0, 0))
        if setup.gages is not None:
            self._gages = setup.motion.dof_sums(setup.gages.dof_indices, setup.gages.weights)
            self._strains = np.empty((BLOCK, len(setup.gages.numbers)))
        self.initial = 0.0

    def begin(self, plate: PlateState, impact: ImpactState | None) -> None:
        """Note the energy before the first step (force*length)."""
        energy = plate.strain_energy
        if self._impact is not None and impact is not None:
            energy += float(self._impact.rod.kinetic_energy(impact.rod.velocity[None])[0])
        self.initial = float(energy)
        self._sink.attributes("energy", {"initial": self.initial})

    def step(
        self,
        plate: PlateState,
        impact: ImpactState | None,
        factor: float,
        *,
        contact_row: bool = False,
    ) -> None:
        """Note the state after a step.

        Parameters
        ----------
        plate : PlateState
        impact : ImpactState or None
        factor : float
            Load factor of nodal forces.
        contact_row : bool
            Whether the step's contact goes to tape9.
        """
        point = None
        if self._impact is not None and impact is not None:
            point = self._impact.point_force(impact)
        kinetic = self._motion.kinetic_energy(plate, factor, point)
        strain = plate.strain_energy
        own = (plate.step, plate.time, kinetic, strain, plate.external_work)
        if self._gages is not None:
            self._strains[len(self._rows)] = self._gages.evaluate(plate, factor)
        if impact is None:
            self._rows.append((*own, 0.0, 0.0, 0.0, 0.0, 0.0))
        else:
            self._rod[len(self._rows)] = impact.rod.motion
            if contact_row or self._all_contact:
                self._contact_rows.append(len(self._rows))
            indentation, force = impact.contact
            hit = (force, indentation, impact.plate_w, impact.contact_work, impact.rod.tip)
            self._rows.append((*own, *hit))
        if len(self._rows) == BLOCK:
            self.flush()

    def state(self) -> dict[str, Any]:
        """What is held back, and how much was stored."""
        count = len(self._rows)
        return {
            "rows": np.array(self._rows).reshape(count, len(SCALARS)),
            "contact": list(self._contact_rows),
            "rod": self._rod[:count].copy(),
            "strains": self._strains[:count].copy(),
            "stored": self._stored,
            "tape9": self._tape9_rows,
            "initial": self.initial,
            "work": [self._most_work, self._last_work, self._jump],
            "worst": self.worst,
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Hold back again what :meth:`state` gave."""
        self._rows = [tuple(row) for row in state["rows"].tolist()]
        self._contact_rows = list(state["contact"])
        self._rod[: len(self._rows)] = state["rod"]
        self._strains[: len(self._rows)] = state["strains"]
        self._stored, self._tape9_rows = state["stored"], state["tape9"]
        self.initial = state["initial"]
        self._most_work, self._last_work, self._jump = state["work"]
        self.worst = (state["worst"][0], state["worst"][1])

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
        self._add_projectile(table, count)
        held = (
            table["plate_kinetic"] + table["plate_strain"]
            + table["projectile_kinetic"] + table["projectile_strain"] + table["contact_work"]
        )  # fmt: skip
        table["balance_error"] = held - self.initial - table["external_work"]
        self._watch(table, held)
        table["strain"] = self._strains[:count]
        groups = self.rows.keys() - {"tape9"}
        for dataset in DATASETS.values():
            if dataset.group in groups and dataset.shape[0] == "rows":
                self._sink.write(dataset.path, self._stored, table[dataset.name])
        rows = np.array(self._contact_rows, dtype=int)
        if len(rows):
            for name in ("step", "time", *CONTACT):
                self._sink.write(f"tape9/{name}", self._tape9_rows, table[name][rows])
            self._tape9_rows += len(rows)
        self._stored += count
        self._rows.clear()
        self._contact_rows.clear()

    def _add_projectile(self, table: dict[str, Floats], count: int) -> None:
        """Add what follows from the rod's motion over a block of steps."""
        if self._impact is None:
            table["projectile_kinetic"] = table["projectile_strain"] = np.zeros(count)
            return
        u, v, a = self._rod[:count].swapaxes(0, 1)
        u[:, 0] = 0.0  # the tip, to which the others are relative
        table["transducer"] = self._transducer(table["force"], u)
        table["velocity"], table["acceleration"] = v[:, 0], a[:, 0]
        rod = self._impact.rod
        table["projectile_kinetic"] = rod.kinetic_energy(v)
        table["projectile_strain"] = rod.strain_energy(u)

    def _transducer(self, force: Floats, deformation: Floats) -> Floats:
        """Force at the transducer: E A du/dx of its node; the contact force on a rigid mass."""
        node, sign = self._station.node, self._station.sign
        if self._impact is None or not isinstance(self._impact.rod, Rod):
            return -sign * force
        rod = self._impact.rod
        area = float(rod.areas[min(node, rod.elements) - 1])
        return sign * rod.modulus * area * deformation[:, 2 * node - 1]

    def _watch(self, table: Mapping[str, Floats], held: Floats) -> None:
        """Stop a run that has lost all sense, or more energy than its limit allows.

        The error is judged against what was given up to the end of the block: the first steps of a
        load have done no work yet that it could be compared with.  What a load does in one step is
        no error: the work belongs to the step, the energies to its end.
        """
        lost = ~np.isfinite(held)
        if lost.any():
            step = int(table["step"][np.flatnonzero(lost)[0]])
            raise DivergenceError(step, "the motion is no longer finite")
        work = table["external_work"]
        self._most_work = max(self._most_work, float(np.abs(work).max()))
        jump = float(np.abs(np.diff(work, prepend=self._last_work)).max())
        self._jump, self._last_work = max(self._jump, jump), float(work[-1])
        given = self.initial + self._most_work
        if not given > 0.0:
            return
        error = np.maximum(np.abs(table["balance_error"]) - self._jump, 0.0) / given
        row = int(error.argmax())
        if error[row] > self.worst[0]:
            self.worst = (float(error[row]), int(table["step"][row]))
        if self._limit is not None and error[row] > self._limit:
            row = int(np.flatnonzero(error > self._limit)[0])
            raise DivergenceError(
                int(table["step"][row]),
                f"the energy balance is off by {error[row]:.2%} of what was given, more than the "
                f"limit of {self._limit:.3g}",
            )

    @property
    def rows(self) -> dict[str, int]:
        """Rows stored in each group."""
        rows = {"energy": self._stored, "tape9": self._tape9_rows}
        if self._impact is not None:
            rows["history"] = self._stored
        if self._gages is not None:
            rows["gages"] = self._stored
        return rows
