"""The recorder of steps: scalars of every step, gathered in blocks.

What can be computed from a block (transducer, projectile energies, energy balance) is computed when
the block is full.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from fecm._typing import Array, Floats
from fecm.mechanics.impact import ImpactState
from fecm.mechanics.plate_motion import DofSums, PlateState
from fecm.mechanics.projectile import Rod
from fecm.problem.build import ImpactModel
from fecm.results.schema import CONTACT
from fecm.results.sinks import RowBuffer, Sink

EVERY_STEP = ("energy", "history", "gages")  # groups with a row for every step
BLOCK = 1024  # steps that are gathered
# Columns of a step that are known when it is taken.
SCALARS = (
    "step",
    "time",
    "plate_kinetic",
    "plate_strain",
    "external_work",
    "force",
    "indentation",
    "plate_w",
    "contact_work",
    "displacement",
    "on_tape9",
)
# Those that follow from the motion of the projectile.
PROJECTILE = ("velocity", "acceleration", "projectile_kinetic", "projectile_strain", "station")
NAMES = (*SCALARS, *PROJECTILE)
Columns = Mapping[str, Floats]  # of steps, by name
OnBlock = Callable[[Columns, float], object]


class Damped(NamedTuple):
    """State of the damping after the last step that is stored."""

    time: float = 0.0
    power: float = 0.0
    work: float = 0.0


class StepRecorder:
    """Stores every step in `buffers`; of a plate alone energies and gages only.

    The slip `tapes` stores contact on tape9 at every step instead of every N-th; `on_block` is
    called with the columns of each block and the initial energy.
    """

    def __init__(
        self,
        sink: Sink,
        buffers: Mapping[str, RowBuffer],
        model: ImpactModel,
        tapes: bool,
        on_block: OnBlock,
    ) -> None:
        self._sink = sink
        self._buffers = {group: buffers[group] for group in EVERY_STEP if group in buffers}
        self._tape9 = buffers.get("tape9")
        self._motion = model.motion
        self._impact = model.impact
        self._station = model.station
        self._on_block = on_block
        self._tapes = tapes
        self._gages: DofSums | None = None
        gages = 0
        if model.impact is not None:
            self._rod = np.empty((BLOCK, 3, len(model.impact.rod_mass)))
        self._gage_array = model.gages
        if model.gages is not None:
            self._gages = model.motion.dof_sums(model.gages.dof_indices, model.gages.weights)
            gages = len(model.gages.numbers)
        # The names, then the gages' strains, of the steps that are not stored yet.
        self._table = np.zeros((len(NAMES) + gages, BLOCK))
        self._count = 0  # of these steps
        self._known = 0  # those with the projectile's columns
        self.initial = 0.0
        self._damped = Damped()

    def begin(self, plate: PlateState, impact: ImpactState | None) -> None:
        """Store the energy before the first step (force*length)."""
        self.initial = float(plate.strain_energy)
        if self._impact is not None and impact is not None:
            self.initial += float(self._impact.rod.kinetic_energy(impact.rod.velocity[None])[0])
        self._sink.attributes("energy", {"initial": self.initial})

    def step(
        self, plate: PlateState, impact: ImpactState | None, factor: float, on_tape9: bool = False
    ) -> None:
        """Add a row for the state after a step, with the load factor of the nodal forces.

        Its contact is stored `on_tape9` if asked for.
        """
        applied = None
        if self._impact is not None and impact is not None:
            applied = self._impact.applied(impact)
        kinetic = self._motion.kinetic_energy(plate, factor, applied)
        row = [plate.step, plate.time, kinetic, plate.strain_energy, plate.external_work]
        if self._gages is not None:
            sums = self._gages.evaluate(plate, factor)
            self._table[len(NAMES) :, self._count] = self._strains(sums)
        if impact is not None:
            self._rod[self._count] = impact.rod.motion
            indentation, force = impact.contact
            row += [force, indentation, impact.plate_w, impact.contact_work, impact.rod.tip]
            row.append(on_tape9 or self._tapes)
        self._table[: len(row), self._count] = row
        self._count += 1
        if self._count == BLOCK:
            self.flush()

    def _strains(self, sums: Floats) -> Floats:
        """Strains of the gages, (..., gages), of their weighted sums."""
        return sums if self._gage_array is None else self._gage_array.strains(sums)

    def add(self, plate: PlateState, columns: Columns, sums: Floats, on_tape9: Array) -> None:
        """Add rows for many steps, and the contact of some of them to tape9.

        `sums` are the weighted sums of the gages, (steps, rows).
        """
        work = np.full(len(sums), plate.external_work)
        given = {**columns, "external_work": work, "on_tape9": on_tape9}
        values = np.vstack([*(given[name] for name in NAMES), self._strains(sums).T])
        while values.size:
            self._add_projectile()
            part, values = np.split(values, [BLOCK - self._count], axis=1)
            rows = slice(self._count, self._count + part.shape[1])
            self._table[:, rows] = part
            self._count = self._known = rows.stop
            if self._count == BLOCK:
                self.flush()

    def state(self) -> dict[str, Any]:
        """Rows that are not stored yet, and how many are."""
        self._add_projectile()
        return {
            "rows": self._table[:, : self._count].copy(),
            "initial": self.initial,
            "damped": self._damped,
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue from a :meth:`state`."""
        self._count = self._known = state["rows"].shape[1]
        self._table[:, : self._count] = state["rows"]
        self.initial = state["initial"]
        self._damped = Damped(*state["damped"])

    def flush(self) -> None:
        """Store the gathered rows and pass them to `on_block`."""
        count = self._count
        if not count:
            return
        self._add_projectile()
        columns = self._table[:, :count].copy()
        table = dict(zip(NAMES, columns, strict=False))
        if self._impact is not None:
            table["transducer"] = self._transducer(table["force"], table["station"])
        table["held_energy"] = (
            table["plate_kinetic"]
            + table["plate_strain"]
            + table["projectile_kinetic"]
            + table["projectile_strain"]
            + table["contact_work"]
        )
        table["balance_error"] = table["held_energy"] - self.initial - table["external_work"]
        if self._motion.damping:
            self._add_damping(table)
        self._on_block(table, self.initial)
        table["strain"] = columns[len(NAMES) :].T
        for buffer in self._buffers.values():
            buffer.put(table)
        if self._tape9 is not None:
            (on_tape9,) = np.nonzero(table["on_tape9"])
            contact = {name: table[name][on_tape9] for name in ("step", "time", *CONTACT)}
            self._tape9.put(contact)
        self._count = self._known = 0

    def _add_damping(self, table: dict[str, Floats]) -> None:
        """Add the work of damping: its power v C v is 2 a times the plate's kinetic energy."""
        last, time = self._damped, table["time"]
        power = 2.0 * self._motion.damping * table["plate_kinetic"]
        means = 0.5 * (power + np.concatenate([[last.power], power[:-1]]))
        work = last.work + np.cumsum(means * np.diff(time, prepend=last.time))
        table["damping_work"] = work
        table["balance_error"] += work
        self._damped = Damped(float(time[-1]), float(power[-1]), float(work[-1]))

    def _add_projectile(self) -> None:
        """Set the columns that follow from the motion of the projectile."""
        rows = slice(self._known, self._count)
        self._known = self._count
        if self._impact is None or rows.start == rows.stop:
            return
        u, v, a = self._rod[rows].swapaxes(0, 1)
        u[:, 0] = 0.0  # displacements are relative to the tip
        rod = self._impact.rod
        columns = {
            "velocity": v[:, 0],
            "acceleration": a[:, 0],
            "projectile_kinetic": rod.kinetic_energy(v),
            "projectile_strain": rod.strain_energy(u),
            "station": u[:, self._station.dof],
        }
        self._table[len(SCALARS) : len(NAMES), rows] = [columns[name] for name in PROJECTILE]

    def _transducer(self, force: Floats, deformation: Floats) -> Floats:
        """Force at the transducer: E A du/dx of its node; the contact force on a rigid mass."""
        sign = self._station.sign
        rod = None if self._impact is None else self._impact.rod
        if not isinstance(rod, Rod):
            return -sign * force
        area = float(rod.areas[min(self._station.node, rod.elements) - 1])
        return sign * rod.modulus * area * deformation
