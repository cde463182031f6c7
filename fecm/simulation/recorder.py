"""Recorder of a run: scalars of every step in blocks, datasets and their rows in a sink.

Transducer force, projectile energies and energy balance are computed when a block is full.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fecm._typing import Array, Floats
from fecm.deck.macros import WorkEstimate
from fecm.judge.criteria import ALL_CRITERIA, INTERLAMINAR, OWN_CRITERIA
from fecm.mechanics.failure import CRITERIA
from fecm.mechanics.impact import ImpactState
from fecm.mechanics.plate_motion import DofSums, PlateState
from fecm.mechanics.strains import STRAINS, midplane_height
from fecm.problem.build import ImpactModel
from fecm.results.exposures import LOAD_FACTOR
from fecm.results.groups import GROUPS
from fecm.results.metrics import INITIAL_PLATE
from fecm.results.schema import (
    CONTACT,
    CURE_STRESS,
    DATASETS,
    EVERY_STEP,
    FIXED,
    Dataset,
    criterion_datasets,
)
from fecm.results.sinks import RowBuffer, Sink
from fecm.simulation.saved import subset

if TYPE_CHECKING:
    from fecm.mechanics.exposures import FailureEnvelope, PlyPoints
    from fecm.mechanics.failure_monitor import FailureMonitor


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
    "is_loaded_at_rest",
)
# Columns that follow from the motion of the projectile.
PROJECTILE = ("velocity", "acceleration", "projectile_kinetic", "projectile_strain", "station")
NAMES = (*SCALARS, *PROJECTILE)
Columns = Mapping[str, Floats]  # of steps, by name
OnBlock = Callable[[Columns, float], object]


class Damped(NamedTuple):
    """State of the damping after the last stored step."""

    time: float = 0.0
    power: float = 0.0
    work: float = 0.0


class StepRecorder:
    """Recorder of every step in `buffers`. A plate without impact has energies and gages only.

    `on_block` is called with the columns of each block and the energy before the first step,
    without the energy of a static load that only holds the plate.
    """

    def __init__(
        self,
        sink: Sink,
        buffers: Mapping[str, RowBuffer],
        model: ImpactModel,
        on_block: OnBlock,
    ) -> None:
        self._sink = sink
        self._buffers = {group: buffers[group] for group in EVERY_STEP if group in buffers}
        self._tape9 = buffers.get("tape9")
        self._motion = model.motion
        self._impact = model.impact
        self._station = model.station
        self._on_block = on_block
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
        self._known = 0  # number of the steps with the projectile's columns
        self.initial = 0.0
        self.initial_plate = 0.0  # part of the plate, of a static load
        self._damped = Damped()

    def begin(self, plate: PlateState, impact: ImpactState | None) -> None:
        """Store the energy before the first step (force*length)."""
        self.initial = self.initial_plate = float(plate.strain_energy)
        if self._impact is not None and impact is not None:
            self.initial += float(self._impact.rod.kinetic_energy(impact.rod.velocity[None])[0])
        of_plate = {INITIAL_PLATE: self.initial_plate} if self.initial_plate else {}
        self._sink.attributes("energy", {"initial": self.initial, **of_plate})

    def step(
        self,
        plate: PlateState,
        impact: ImpactState | None,
        factor: float,
        on_tape9: bool = False,
        is_loaded_at_rest: bool = False,
    ) -> None:
        """Add a row for the state after a step, with the load factor of the nodal forces.

        Its contact is stored `on_tape9` if requested. `is_loaded_at_rest` says that the nodal
        forces only hold the deflection at which the impact started.
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
            row += [on_tape9, is_loaded_at_rest]
        self._table[: len(row), self._count] = row
        self._count += 1
        if self._count == BLOCK:
            self.flush()

    def _strains(self, sums: Floats) -> Floats:
        """Return the strains of the gages, (..., gages), from their weighted sums."""
        return sums if self._gage_array is None else self._gage_array.strains(sums)

    def add(self, plate: PlateState, columns: Columns, sums: Floats, on_tape9: Array) -> None:
        """Add rows for many steps, and the contact of some steps to tape9.

        `sums` has the weighted sums of the gages, (steps, rows).
        """
        work = np.full(len(sums), plate.external_work)
        columns_given = {**columns, "external_work": work, "on_tape9": on_tape9}
        columns_given["is_loaded_at_rest"] = np.zeros(len(sums))
        values = np.vstack([*(columns_given[name] for name in NAMES), self._strains(sums).T])
        while values.size:
            self._add_projectile()
            part, values = np.split(values, [BLOCK - self._count], axis=1)
            rows = slice(self._count, self._count + part.shape[1])
            self._table[:, rows] = part
            self._count = self._known = rows.stop
            if self._count == BLOCK:
                self.flush()

    def state(self) -> dict[str, Any]:
        """Return the rows that are not stored yet, and their number."""
        self._add_projectile()
        return {
            "rows": self._table[:, : self._count].copy(),
            "initial": self.initial,
            "initial_plate": self.initial_plate,
            "damped": self._damped,
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue from a :meth:`state`."""
        self._count = self._known = state["rows"].shape[1]
        self._table[:, : self._count] = state["rows"]
        self.initial = state["initial"]
        self.initial_plate = state["initial_plate"]
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
        at_rest = bool(table["is_loaded_at_rest"].all())
        self._on_block(table, self.initial - self.initial_plate * at_rest)
        table["strain"] = columns[len(NAMES) :].T
        for buffer in self._buffers.values():
            buffer.put(table)
        if self._tape9 is not None:
            (on_tape9,) = np.nonzero(table["on_tape9"])
            contact = {name: table[name][on_tape9] for name in ("step", "time", *CONTACT)}
            self._tape9.put(contact)
        self._count = self._known = 0

    def _add_damping(self, table: dict[str, Floats]) -> None:
        """Add the work of damping. Its power v C v is 2 a times the plate's kinetic energy."""
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

    def _transducer(self, force: Floats, gradient: Floats) -> Floats:
        """Return the force at the transducer; the contact force, zero, in a run without impact."""
        if self._impact is None:
            return -self._station.sign * force
        return self._impact.rod.transducer_force(self._station, force, gradient)


Steps = Sequence[int]  # of rows
Times = Sequence[float]
MEMBRANE = "membrane"
SUPPORTS = "supports"
LAMINATE = "laminate"
MATERIAL = "plies/material"
BY_PASS = {name: info.macro for name, info in GROUPS.items() if info.by_pass}


def _absent(model: ImpactModel) -> set[str]:
    """Return the datasets that a run lacks although it has their group."""
    absent = set()
    if not model.motion.damping:
        absent.add("energy/damping_work")
    if not model.plate.is_preloaded:
        absent.add(f"{MEMBRANE}/preload_energy")
    if model.stretching is None or not model.stretching.has_load:
        absent |= {f"{MEMBRANE}/force_at_load", f"{MEMBRANE}/moment_at_load"}
    if model.cure is None:
        absent.add(CURE_STRESS)
    if not model.plate.others:
        absent.add("mesh/laminate")
    if not model.plate.is_curved:
        absent.add("mesh/z")
    if model.materials is None or (model.plies is None and model.failure is None):
        absent.add(MATERIAL)
    return absent


def _of_laminates(dataset: Dataset, model: ImpactModel) -> list[Dataset]:
    """Return a dataset in the form for a plate of one laminate, or of several."""
    if not model.plate.others:
        return [dataset]
    if dataset.group == LAMINATE:
        return [replace(dataset, path=f"{LAMINATE}/{n}/{dataset.name}") for n in model.laminates]
    return [dataset.with_outer() if dataset.outer else dataset]


def _padded(parts: Sequence[Floats]) -> Floats:
    """Return arrays of plies of each laminate, (laminates, plies, ...), padded with NaN.

    A single laminate gives (plies, ...).
    """
    if len(parts) == 1:
        return parts[0]
    most = max(map(len, parts))
    padded = np.full((len(parts), most, *parts[0].shape[1:]), np.nan)
    for row, part in zip(padded, parts, strict=True):
        row[: len(part)] = part
    return padded


def exposures_of(
    monitor: FailureMonitor, envelope: FailureEnvelope, places: PlyPoints
) -> dict[str, Array]:
    """Return the datasets of the largest exposures by criterion.

    Exposures of plies are (states,).
    """
    monitor.complete(envelope)
    arrays, plies = {}, monitor.every_state(envelope)
    for part in ("exposure", "time", "mode"):
        for name, values in zip(monitor.criteria, getattr(plies, part), strict=True):
            if part == "exposure":
                values = np.where(values < 0.0, np.nan, values)
            arrays[f"failure/{name}/{part}"] = values
        arrays[f"failure/{INTERLAMINAR}/{part}"] = getattr(envelope.interfaces, part)
    on_circle = monitor.circle_columns(envelope, places)
    return arrays | {f"failure/circle/{name}": values for name, values in on_circle.items()}


class Recorder:
    """Recorder of the rows of a run in a sink. `sizes` has upper bounds of their numbers."""

    def __init__(
        self, sink: Sink, model: ImpactModel, sizes: WorkEstimate, on_block: OnBlock
    ) -> None:
        self._sink = sink
        self._model = model
        self._grows = sizes.at_most
        own_criteria = (
            () if model.failure is None else tuple(model.failure.criteria)[len(CRITERIA) :]
        )
        self._own_criteria = own_criteria
        dataset_kinds = [
            *DATASETS.values(),
            *(d for name in own_criteria for d in criterion_datasets(name)),
        ]
        if own_criteria:
            sink.axis_names["criteria"] = (*ALL_CRITERIA, *own_criteria)
        has_impact = model.impact is not None
        self._room = {  # upper bound of the rows of each group
            **{group: sizes.passes[macro] for group, macro in BY_PASS.items()},
            "exposures": sizes.passes["FAIL"] + model.is_stressed_at_rest,
            "tape8": has_impact * sizes.contact_rows,
            "tape9": has_impact * model.variant.program.contact_rows(sizes),
            "history": has_impact * sizes.steps,
            "energy": sizes.steps,
            "gages": (model.gages is not None) * sizes.steps,
            MEMBRANE: 0,
            "failure": int(model.failure is not None),
            **{
                f"failure/{name}": int(model.failure is not None)
                for name in (*ALL_CRITERIA, *own_criteria)
            },
            "failure/circle": int(model.failure is not None and model.failure.circle is not None),
            "patch": int(model.patch is not None),
        }
        if model.stretching is not None:
            rows = sizes.contact_rows if has_impact else sizes.passes["DISP"]
            self._room[MEMBRANE] = rows
        self._room[SUPPORTS] = 0 if model.supports is None else sizes.passes["DISP"]
        absent = _absent(model)
        self._datasets = [
            (dataset, self._shape(dataset))
            for kind in dataset_kinds
            if (self._room.get(kind.group) != 0 or kind.path in (CURE_STRESS, MATERIAL))
            and kind.path not in absent
            for dataset in _of_laminates(kind, model)
        ]
        self._buffers: dict[str, RowBuffer] = {}
        for group in (*EVERY_STEP, "tape8", "tape9", "exposures", *BY_PASS, MEMBRANE, SUPPORTS):
            members = [p for p in self._datasets if p[0].group == group and p[0].shape[0] == "rows"]
            if members:
                self._buffers[group] = RowBuffer(sink, members)
        self.steps = StepRecorder(sink, self._buffers, model, on_block)

    def _shape(self, dataset: Dataset) -> tuple[int, ...]:
        """Return the shape of a dataset with all its rows."""
        mesh, gages = self._model.plate.mesh, self._model.gages
        numbers = {
            "rows": self._room.get(dataset.group, 0),
            "numnp": mesh.coordinates.shape[0],
            "ndm": mesh.coordinates.shape[1],
            "numel": mesh.elements.shape[0],
            "nen": mesh.elements.shape[1],
            "ndf": mesh.equations.shape[1],
            "npt": self._model.strains.shape[1],
            "nps": self._model.stress_points.shape[1],
            "gages": 0 if gages is None else len(gages.numbers),
            "layers": max(len(laminate.plies.angles) for laminate in self._model.plate.laminates),
            "laminates": len(self._model.plate.laminates),
            **FIXED,
            "criteria": len(ALL_CRITERIA) + len(self._own_criteria),
        }
        if self._model.plies is not None:
            numbers["members"], numbers["npp"], _ = self._model.plies.shape
        if self._model.failure is not None:
            _, numbers["npp"], _ = self._model.failure.stresses.shape
            numbers["interfaces"] = numbers["layers"] - 1
        if self._model.supports is not None:
            numbers["supports"] = len(self._model.supports.supports.node)
        if self._model.patch is not None:
            numbers["patch_nodes"] = np.count_nonzero(self._model.patch.weights)
        return tuple(numbers[n] if isinstance(n, str) else n for n in dataset.shape)

    def create(self, location: str) -> None:
        """Create every dataset that can have rows, and store mesh, laminate and locations.

        The location of tape8's strains is ``"nodes"`` or ``"gauss"``.
        """
        for dataset, shape in self._datasets:
            self._sink.create(dataset, shape, grows=self._grows and dataset.shape[0] == "rows")
        model = self._model
        if (patch := model.patch) is not None:
            values = {"shape": patch.shape, "radius": patch.radius, "x": patch.x, "y": patch.y}
            self._sink.attributes("patch", values)
        if model.plate.is_curved:
            radii = zip(("x", "y", "xy"), model.plate.curvature, strict=True)
            values = {
                f"radius_{n}": float(f"{1.0 / curvature:.12g}")
                for n, curvature in radii
                if curvature
            }
            self._sink.attributes("mesh", values)
        if model.plate.is_preloaded:
            values = dict(zip(("N0_x", "N0_y", "N0_xy"), model.plate.preload, strict=True))
            self._sink.attributes(LAMINATE, values)
            if self._room["gages"]:
                self._sink.attributes("gages", {"preload": "excluded"})
        if model.under_load is not None and model.failure is not None:
            self._sink.attributes("failure", {"modes": list(model.failure.modes)})
            if self._own_criteria:
                self._sink.attributes("failure", {OWN_CRITERIA: list(self._own_criteria)})
            if model.load_mesh is not None:
                self._sink.attributes("failure/circle", model.load_mesh._asdict())
        for path, array in self._constants().items():
            self._sink.write(path, 0, array)
        if self._room["tape8"]:
            self._sink.attributes("tape8", {"location": location})

    def _constants(self) -> dict[str, Array]:
        """Yield the datasets that do not change during the run."""
        model = self._model
        mesh, laminates = model.plate.mesh, model.plate.laminates
        datasets: dict[str, Array] = {
            f"mesh/{n}": getattr(mesh, n) for n in ("coordinates", "elements", "equations")
        }
        for number, laminate in zip(model.laminates, laminates, strict=True):
            group = f"{LAMINATE}/{number}" if model.plate.others else LAMINATE
            datasets |= {f"{group}/{n}": getattr(laminate, n) for n in ("A", "B", "D", "shear")}
        if model.plate.laminate_numbers is not None:
            datasets["mesh/laminate"] = np.array(model.laminates)[model.plate.laminate_numbers]
        if model.plate.is_curved:
            datasets["mesh/z"] = midplane_height(mesh.coordinates, model.plate.curvature)
        if self._room["gages"] and model.gages is not None:
            datasets["gages/number"] = model.gages.numbers
        if (patch := model.patch) is not None:
            (nodes,) = np.nonzero(patch.weights)
            datasets["patch/node"] = nodes + 1
            datasets["patch/weight"] = patch.weights[nodes]
        if self._room[SUPPORTS] and model.supports is not None:
            supports = model.supports.supports
            numbers = {"node": supports.node + 1, "dof": supports.dof + 1}
            values = {n: getattr(supports, n) for n in ("side", "stiffness", "gap")}
            datasets |= {f"{SUPPORTS}/{n}": value for n, value in {**numbers, **values}.items()}
        near = model.under_load
        if near is not None and self._room["plies"] and model.plies is not None:
            members = model.plies.members
            datasets["plies/element"] = members + 1
            datasets["plies/z"] = _padded([item.plies.z for item in laminates])
            datasets["plies/under_load"] = near[members].any(axis=1).astype(int)
        if model.cure is not None:
            datasets[CURE_STRESS] = _padded([item.stresses for item in model.cure])
        if model.materials is not None and (model.plies is not None or model.failure is not None):
            datasets[MATERIAL] = model.materials if model.plate.others else model.materials[0]
        if near is not None and model.failure is not None:
            x, y = model.stress_points.places(mesh.coordinates)
            datasets["failure/x"] = x
            datasets["failure/y"] = y
            datasets["failure/under_load"] = near.astype(int)
            datasets["failure/centre_under_load"] = (~model.failure.far).astype(int)
        if self._room["stresses"]:
            x, y = model.stress_points.places(mesh.coordinates)
            datasets["stresses/x"] = x
            datasets["stresses/y"] = y
        return datasets

    def row(self, group: str, step: int, time: float, columns: Mapping[str, Any]) -> None:
        """Store a row of a group: a value or an array for each dataset."""
        rows = {name: np.asarray(value)[None] for name, value in columns.items()}
        self.rows(group, [step], [time], rows)

    def rows(self, group: str, steps: Steps, times: Times, columns: Mapping[str, Array]) -> None:
        """Store rows of a group, the first axis of every array."""
        instants = {"step": np.array(steps), "time": np.array(times)}
        self._buffers[group].put({**instants, **columns})

    def strains(self, steps: Steps, times: Times, fields: Floats) -> None:
        """Store rows of tape8: strains from the displacements at `times`, (rows, numnp, 5)."""
        strains = self._model.strains.evaluate(fields)
        self.rows("tape8", steps, times, dict(zip(STRAINS, strains, strict=True)))
        self.stretching(steps, times, fields)

    def supports(self, steps: Steps, times: Times, fields: Floats) -> None:
        """Store rows about springs and one-sided supports, from displacements at `times`."""
        if self._model.supports is not None:
            for step, time, field in zip(steps, times, fields, strict=True):
                self.row(SUPPORTS, step, time, self._model.supports.evaluate(field)._asdict())

    def stretching(self, steps: Steps, times: Times, fields: Floats) -> None:
        """Store rows about the midplane of a nonlinear plate, from displacements at `times`."""
        if self._model.stretching is not None:
            values = self._model.stretching.evaluate(fields)
            self.rows(MEMBRANE, steps, times, values._asdict())

    def _parts(self) -> dict[str, StepRecorder | RowBuffer]:
        """Return the recorders with rows that are not stored yet, by their path in a checkpoint."""
        return {"steps": self.steps, **{f"rows/{name}": b for name, b in self._buffers.items()}}

    def state(self) -> dict[str, Any]:
        """Return the rows that are not stored yet, for :meth:`restore`."""
        return {
            f"{path}/{name}": value
            for path, part in self._parts().items()
            for name, value in part.state().items()
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue from a :meth:`state`."""
        for path, part in self._parts().items():
            part.restore(subset(state, f"{path}/"))

    def steps_so_far(self, steps: int) -> dict[str, Array]:
        """Store the rows of the steps so far, and return the datasets of history and energy."""
        self.steps.flush()
        groups = ("history", "energy")
        for group in groups:
            self._buffers[group].flush()
        return {
            dataset.path: np.asarray(self._sink.arrays[dataset.path][:steps])
            for dataset, _ in self._datasets
            if dataset.group in groups
        }

    def failure(self, envelope: FailureEnvelope) -> None:
        """Store the largest exposures of FAIL."""
        monitor, places = self._model.failure, self._model.stress_places
        if monitor is None or places is None:
            return
        shapes = {dataset.path: shape for dataset, shape in self._datasets}
        for path, values in exposures_of(monitor, envelope, places).items():
            self._sink.write(path, 0, values.reshape(shapes[path]))
        if monitor.has_residual:
            for name, factor in monitor.load_factors(envelope).items():
                self._sink.attributes(f"failure/{name}", {LOAD_FACTOR: factor})

    def finish(self) -> None:
        """Store the remaining rows, and trim each dataset to its rows."""
        self.steps.flush()
        for buffer in self._buffers.values():
            buffer.flush()
        stored = {group: buffer.stored for group, buffer in self._buffers.items()}
        for dataset, _ in self._datasets:
            room, rows = self._room.get(dataset.group, 0), stored.get(dataset.group, 0)
            if room > rows and dataset.shape[0] == "rows":
                self._sink.trim(dataset.path, rows)
