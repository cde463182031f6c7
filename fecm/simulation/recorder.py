"""The recorders of a run: they create its datasets and store their rows in a sink.

Scalars of every step are gathered in blocks.  What can be computed from a block (transducer,
projectile energies, energy balance) is computed when the block is full.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from fecm._typing import Array, Floats
from fecm.deck.macros import WorkEstimate
from fecm.mechanics.failure import CRITERIA, MODES
from fecm.mechanics.impact import ImpactState
from fecm.mechanics.plate_motion import DofSums, PlateState
from fecm.mechanics.ply_stresses import FailureEnvelope
from fecm.mechanics.projectile import Rod
from fecm.mechanics.strains import STRAINS
from fecm.problem.build import ImpactModel
from fecm.results.criteria import ALL_CRITERIA, INTERLAMINAR
from fecm.results.groups import STORED_BY
from fecm.results.schema import CONTACT, DATASETS, FIXED, Dataset
from fecm.results.sinks import RowBuffer, Sink

Steps = Sequence[int]  # of rows
Times = Sequence[float]
FAILURE = ("failure", *(f"failure/{name}" for name in ALL_CRITERIA))
AT_MACROS = ("tape3", "tape8", "stresses", "plies", "exposures", "reactions", "modes")
EVERY_STEP = ("energy", "history", "gages")
BLOCK = 1024
SCALARS = (
    "step", "time", "plate_kinetic", "plate_strain", "external_work",
    "force", "indentation", "plate_w", "contact_work", "displacement", "on_tape9",
)  # fmt: skip
# Those that follow from the motion of the projectile.
PROJECTILE = ("velocity", "acceleration", "projectile_kinetic", "projectile_strain", "station")
NAMES = (*SCALARS, *PROJECTILE)
Columns = Mapping[str, Floats]  # of steps, by name
OnBlock = Callable[[Columns, float], object]


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
        self._motion, self._impact, self._station = model.motion, model.impact, model.station
        self._on_block = on_block
        self._tapes = tapes
        self._gages: DofSums | None = None
        gages = 0
        if model.impact is not None:
            self._rod = np.empty((BLOCK, 3, len(model.impact.rod_mass)))
        if model.gages is not None:
            self._gages = model.motion.dof_sums(model.gages.dof_indices, model.gages.weights)
            gages = len(model.gages.numbers)
        # The names, then the gages' strains, of the steps that are not stored yet.
        self._table = np.zeros((len(NAMES) + gages, BLOCK))
        self._count = self._known = 0  # of these steps, and those with the projectile's columns
        self.initial = 0.0
        self._damped = (0.0, 0.0, 0.0)  # last time, power and work of the damping

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
            self._table[len(NAMES) :, self._count] = self._gages.evaluate(plate, factor)
        if impact is not None:
            self._rod[self._count] = impact.rod.motion
            indentation, force = impact.contact
            row += [force, indentation, impact.plate_w, impact.contact_work, impact.rod.tip]
            row.append(on_tape9 or self._tapes)
        self._table[: len(row), self._count] = row
        self._count += 1
        if self._count == BLOCK:
            self.flush()

    def add(self, plate: PlateState, columns: Columns, strains: Floats, on_tape9: Array) -> None:
        """Add rows for many steps, and the contact of some of them to tape9."""
        work = np.full(len(strains), plate.external_work)
        given = {**columns, "external_work": work, "on_tape9": on_tape9}
        values = np.vstack([*(given[name] for name in NAMES), strains.T])
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
            "rows": self._table[:, : self._count].copy(), "initial": self.initial,
            "damped": self._damped,
        }  # fmt: skip

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue from a :meth:`state`."""
        self._count = self._known = state["rows"].shape[1]
        self._table[:, : self._count] = state["rows"]
        self.initial, self._damped = state["initial"], tuple(state["damped"])

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
            table["plate_kinetic"] + table["plate_strain"]
            + table["projectile_kinetic"] + table["projectile_strain"] + table["contact_work"]
        )  # fmt: skip
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
        last_time, last_power, work = self._damped
        time, power = table["time"], 2.0 * self._motion.damping * table["plate_kinetic"]
        means = 0.5 * (power + np.concatenate([[last_power], power[:-1]]))
        table["damping_work"] = work + np.cumsum(means * np.diff(time, prepend=last_time))
        table["balance_error"] += table["damping_work"]
        self._damped = (float(time[-1]), float(power[-1]), float(table["damping_work"][-1]))

    def _add_projectile(self) -> None:
        """Set the columns that follow from the motion of the projectile."""
        rows = slice(self._known, self._count)
        self._known = self._count
        if self._impact is None or rows.start == rows.stop:
            return
        u, v, a = self._rod[rows].swapaxes(0, 1)
        u[:, 0] = 0.0  # displacements are relative to the tip
        rod = self._impact.rod
        self._table[len(SCALARS) : len(NAMES), rows] = (
            v[:, 0], a[:, 0], rod.kinetic_energy(v), rod.strain_energy(u), u[:, self._station.dof],
        )  # fmt: skip

    def _transducer(self, force: Floats, deformation: Floats) -> Floats:
        """Force at the transducer: E A du/dx of its node; the contact force on a rigid mass."""
        sign, rod = self._station.sign, None if self._impact is None else self._impact.rod
        if not isinstance(rod, Rod):
            return -sign * force
        area = float(rod.areas[min(self._station.node, rod.elements) - 1])
        return sign * rod.modulus * area * deformation


class Recorder:
    """Stores the rows of a run, of which `sizes` has upper bounds, in a sink."""

    def __init__(
        self, sink: Sink, model: ImpactModel, sizes: WorkEstimate, tapes: bool, on_block: OnBlock
    ) -> None:
        self._sink = sink
        self._model = model
        has_impact = model.impact is not None
        self._room = {  # upper bound of the rows of each group
            **{group: sizes.passes[STORED_BY[group]] for group in AT_MACROS},
            "tape8": has_impact * sizes.contact_rows,
            "tape9": has_impact * (sizes.steps if tapes else sizes.contact_rows),
            "history": has_impact * sizes.steps,
            "energy": sizes.steps,
            "gages": (model.gages is not None) * sizes.steps,
            **dict.fromkeys(FAILURE, int(model.failure is not None)),
            "patch": int(model.patch is not None),
        }
        self._datasets = [
            (dataset, self._shape(dataset))
            for dataset in DATASETS.values()
            if self._room.get(dataset.group) != 0
            and (dataset.path != "energy/damping_work" or model.motion.damping)
        ]
        self._buffers: dict[str, RowBuffer] = {}
        for group in (*EVERY_STEP, "tape9", *AT_MACROS):
            members = [p for p in self._datasets if p[0].group == group and p[0].shape[0] == "rows"]
            if members:
                self._buffers[group] = RowBuffer(sink, members)
        self.steps = StepRecorder(sink, self._buffers, model, tapes, on_block)

    def _shape(self, dataset: Dataset) -> tuple[int, ...]:
        """Shape of a dataset with all its rows."""
        mesh, gages = self._model.plate.mesh, self._model.gages
        numbers = {
            "rows": self._room.get(dataset.group, 0),
            "numnp": mesh.coordinates.shape[0], "ndm": mesh.coordinates.shape[1],
            "numel": mesh.elements.shape[0], "nen": mesh.elements.shape[1],
            "ndf": mesh.equations.shape[1], "npt": self._model.strains.shape[1],
            "nps": self._model.stress_points.shape[1],
            "gages": 0 if gages is None else len(gages.numbers), **FIXED,
        }  # fmt: skip
        if self._model.plies is not None:
            numbers |= zip(("members", "npp", "layers"), self._model.plies.shape, strict=True)
        if self._model.failure is not None:
            _, numbers["npp"], numbers["layers"] = self._model.failure.stresses.shape
            numbers["interfaces"] = numbers["layers"] - 1
        if self._model.patch is not None:
            numbers["patch_nodes"] = np.count_nonzero(self._model.patch.weights)
        return tuple(numbers[n] if isinstance(n, str) else n for n in dataset.shape)

    def create(self, location: str) -> None:
        """Create every dataset that can have rows; store mesh, laminate and locations.

        The location of tape8's strains is ``"nodes"`` or ``"gauss"``.
        """
        model, mesh, laminate = self._model, self._model.plate.mesh, self._model.plate.laminate
        for dataset, shape in self._datasets:
            self._sink.create(dataset, shape)
        constants: dict[str, Array] = {
            **{f"mesh/{n}": getattr(mesh, n) for n in ("coordinates", "elements", "equations")},
            **{f"laminate/{n}": getattr(laminate, n) for n in ("A", "B", "D", "shear")},
        }
        if self._room["gages"] and model.gages is not None:
            constants["gages/number"] = model.gages.numbers
        if (patch := model.patch) is not None:
            (nodes,) = np.nonzero(patch.weights)
            constants |= {"patch/node": nodes + 1, "patch/weight": patch.weights[nodes]}
            values = {"shape": patch.shape, "radius": patch.radius, "x": patch.x, "y": patch.y}
            self._sink.attributes("patch", values)
        if (near := model.under_load) is not None and self._room["plies"] and model.plies:
            constants |= {
                "plies/element": model.plies.members + 1, "plies/z": model.plies.z,
                "plies/under_load": near[model.plies.members].any(axis=1).astype(int),
            }  # fmt: skip
        if near is not None and model.failure is not None:
            x, y = model.stress_points.places(mesh.coordinates)
            constants |= {"failure/x": x, "failure/y": y, "failure/under_load": near.astype(int)}
            self._sink.attributes("failure", {"modes": list(MODES)})
        for path, array in constants.items():
            self._sink.write(path, 0, array)
        if self._room["tape8"]:
            self._sink.attributes("tape8", {"location": location})
        if self._room["stresses"]:
            x, y = model.stress_points.places(mesh.coordinates)
            self._sink.write("stresses/x", 0, x)
            self._sink.write("stresses/y", 0, y)

    def row(self, group: str, step: int, time: float, columns: Mapping[str, Any]) -> None:
        """Store a row of one of the groups :data:`AT_MACROS`: a value or an array per dataset."""
        rows = {name: np.asarray(value)[None] for name, value in columns.items()}
        self.rows(group, [step], [time], rows)

    def rows(self, group: str, steps: Steps, times: Times, columns: Mapping[str, Array]) -> None:
        """Store rows of a group, the first axis of every array."""
        own = {"step": np.array(steps), "time": np.array(times)}
        self._buffers[group].put({**own, **columns})

    def strains(self, steps: Steps, times: Times, fields: Floats) -> None:
        """Store rows of tape8: strains of the displacements at `times`, (rows, numnp, 5)."""
        strains = self._model.strains.evaluate(fields)
        self.rows("tape8", steps, times, dict(zip(STRAINS, strains, strict=True)))

    def _parts(self) -> dict[str, StepRecorder | RowBuffer]:
        """What has rows that are not stored yet, by its path in a checkpoint."""
        return {"steps": self.steps, **{f"rows/{name}": b for name, b in self._buffers.items()}}

    def state(self) -> dict[str, Any]:
        """Rows that are not stored yet, for :meth:`restore`."""
        return {
            f"{path}/{name}": value
            for path, part in self._parts().items()
            for name, value in part.state().items()
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue from a :meth:`state`."""
        for path, part in self._parts().items():
            part.restore(subset(state, f"{path}/"))

    def failure(self, found: FailureEnvelope) -> None:
        """Store the largest exposures of FAIL."""
        for part in ("exposure", "time", "mode"):
            for name, values in zip(CRITERIA, getattr(found.plies, part), strict=True):
                path = f"failure/{name}/{part}"
                self._sink.write(path, 0, values.reshape(self._shape(DATASETS[path])))
            self._sink.write(f"failure/{INTERLAMINAR}/{part}", 0, getattr(found.interfaces, part))

    def finish(self) -> None:
        """Store the remaining rows and trim each dataset to its rows."""
        self.steps.flush()
        for buffer in self._buffers.values():
            buffer.flush()
        stored = {group: buffer.stored for group, buffer in self._buffers.items()}
        for dataset, _ in self._datasets:
            room, rows = self._room.get(dataset.group, 0), stored.get(dataset.group, 0)
            if room > rows and dataset.shape[0] == "rows":
                self._sink.trim(dataset.path, rows)


def subset(stored: Mapping[str, Any], prefix: str) -> dict[str, Any]:
    """Return the entries whose names have a prefix, without it."""
    return {n.removeprefix(prefix): v for n, v in stored.items() if n.startswith(prefix)}
