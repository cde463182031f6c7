"""The recorder of time steps: history, energies, gages, and contact for tape9.

Scalars of every step are gathered in blocks.  What can be computed from a block (transducer,
projectile energies, energy balance) is computed when the block is full.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from fecm._typing import Floats
from fecm.mechanics.impact import ImpactState
from fecm.mechanics.plate_motion import DofSums, PlateState
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


OnBlock = Callable[[Mapping[str, Floats], float], object]


class StepRecorder:
    """Stores every step in a sink; of a plate alone energies and gages only.

    `all_contact` stores contact on tape9 at every step instead of every N-th (the slip
    ``tapes``); `on_block` is called with the columns of each block and the initial energy.
    """

    def __init__(
        self, sink: Sink, model: ImpactModel, all_contact: bool, on_block: OnBlock
    ) -> None:
        self._sink = sink
        self._motion = model.motion
        self._impact = impact = model.impact
        self._on_block = on_block
        self._all_contact = all_contact
        self._rows: list[tuple[float, ...]] = []
        self._contact_rows: list[int] = []
        self._stored = self._tape9_rows = 0
        self._station = model.station
        self._rod = np.empty((0, 3, 0))
        if impact is not None:
            self._rod = np.empty((BLOCK, 3, len(impact.rod_mass)))
        self._gages: DofSums | None = None
        self._strains = np.empty((0, 0))
        if model.gages is not None:
            self._gages = model.motion.dof_sums(model.gages.dof_indices, model.gages.weights)
            self._strains = np.empty((BLOCK, len(model.gages.numbers)))
        self.initial = 0.0
        # Last time, power and work of the damping.
        self._damped = (0.0, 0.0, 0.0)

    def begin(self, plate: PlateState, impact: ImpactState | None) -> None:
        """Store the energy before the first step (force*length)."""
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
        """Add a row for the state after a step, with the load factor of the nodal forces.

        `contact_row` stores the contact of the step on tape9.
        """
        applied = None
        if self._impact is not None and impact is not None:
            applied = self._impact.applied(impact)
        kinetic = self._motion.kinetic_energy(plate, factor, applied)
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
        """Rows that are not stored yet, and how many are."""
        count = len(self._rows)
        return {
            "rows": np.array(self._rows).reshape(count, len(SCALARS)),
            "contact": list(self._contact_rows),
            "rod": self._rod[:count].copy(),
            "strains": self._strains[:count].copy(),
            "stored": self._stored,
            "tape9": self._tape9_rows,
            "initial": self.initial,
            "damped": self._damped,
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue from a :meth:`state`."""
        self._rows = [tuple(row) for row in state["rows"].tolist()]
        self._contact_rows = list(state["contact"])
        self._rod[: len(self._rows)] = state["rod"]
        self._strains[: len(self._rows)] = state["strains"]
        self._stored, self._tape9_rows = state["stored"], state["tape9"]
        self.initial, self._damped = state["initial"], tuple(state["damped"])

    def flush(self) -> None:
        """Store the gathered rows and pass them to `on_block`."""
        count = len(self._rows)
        if not count:
            return
        table = dict(zip(SCALARS, np.array(self._rows).T, strict=True))
        self._add_projectile(table, count)
        table["held_energy"] = (
            table["plate_kinetic"] + table["plate_strain"]
            + table["projectile_kinetic"] + table["projectile_strain"] + table["contact_work"]
        )  # fmt: skip
        table["balance_error"] = table["held_energy"] - self.initial - table["external_work"]
        if self._motion.damping:
            self._add_damping(table)
        self._on_block(table, self.initial)
        table["strain"] = self._strains[:count]
        groups = self.rows.keys() - {"tape9"}
        for dataset in DATASETS.values():
            if dataset.group in groups and dataset.shape[0] == "rows" and dataset.name in table:
                self._sink.write(dataset.path, self._stored, table[dataset.name])
        rows = np.array(self._contact_rows, dtype=int)
        if len(rows):
            for name in ("step", "time", *CONTACT):
                self._sink.write(f"tape9/{name}", self._tape9_rows, table[name][rows])
            self._tape9_rows += len(rows)
        self._stored += count
        self._rows.clear()
        self._contact_rows.clear()

    def _add_damping(self, table: dict[str, Floats]) -> None:
        """Add the work of damping: its power v C v is 2 a times the plate's kinetic energy."""
        last_time, last_power, work = self._damped
        time, power = table["time"], 2.0 * self._motion.damping * table["plate_kinetic"]
        means = 0.5 * (power + np.concatenate([[last_power], power[:-1]]))
        table["damping_work"] = work + np.cumsum(means * np.diff(time, prepend=last_time))
        table["balance_error"] += table["damping_work"]
        self._damped = (float(time[-1]), float(power[-1]), float(table["damping_work"][-1]))

    def _add_projectile(self, table: dict[str, Floats], count: int) -> None:
        """Add the columns that follow from the motion of the projectile."""
        if self._impact is None:
            table["projectile_kinetic"] = table["projectile_strain"] = np.zeros(count)
            return
        u, v, a = self._rod[:count].swapaxes(0, 1)
        u[:, 0] = 0.0  # displacements are relative to the tip
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

    @property
    def rows(self) -> dict[str, int]:
        """Rows stored in each group."""
        rows = {"energy": self._stored, "tape9": self._tape9_rows}
        if self._impact is not None:
            rows["history"] = self._stored
        if self._gages is not None:
            rows["gages"] = self._stored
        return rows
