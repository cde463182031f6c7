"""The recorder of a run: creates its datasets and stores their rows in a sink."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fecm._typing import Floats
from fecm.deck.macros import WorkEstimate
from fecm.mechanics.failure import CRITERIA, MODES
from fecm.mechanics.failure_envelope import FailureEnvelope
from fecm.mechanics.strains import STRAINS
from fecm.problem.build import ImpactModel
from fecm.results.schema import DATASETS, FIXED, INTERLAMINAR, Dataset
from fecm.results.sinks import RowBuffer, Sink
from fecm.simulation.state import subset
from fecm.simulation.step_recorder import OnBlock, StepRecorder

# Of rows.
Steps = Sequence[int]
Times = Sequence[float]

FAILURE = ("failure", INTERLAMINAR, *(f"failure/{name}" for name in CRITERIA))
DAMPING_WORK = "energy/damping_work"
BUFFERED = ("tape3", "tape8", "stresses", "plies", "reactions", "modes")


class Recorder:
    """Stores the rows of a run, of which `sizes` has upper bounds, in a sink."""

    def __init__(
        self,
        sink: Sink,
        model: ImpactModel,
        sizes: WorkEstimate,
        all_contact: bool,
        on_block: OnBlock,
    ) -> None:
        self._sink = sink
        self._model = model
        self.steps = StepRecorder(sink, model, all_contact, on_block)
        self._room = self._rows_to_come(sizes, all_contact)
        self._datasets = [
            (dataset, self._shape(dataset))
            for dataset in DATASETS.values()
            if self._room.get(dataset.group) != 0
            if dataset.path != DAMPING_WORK or model.motion.damping
        ]
        self._buffers: dict[str, RowBuffer] = {}
        for group in BUFFERED:
            members = [p for p in self._datasets if p[0].group == group and p[0].shape[0] == "rows"]
            if members:
                self._buffers[group] = RowBuffer(sink, *zip(*members, strict=True))

    def _rows_to_come(self, sizes: WorkEstimate, all_contact: bool) -> dict[str, int]:
        """Upper bound of the rows of each group."""
        has_impact = self._model.impact is not None
        contact_rows = sizes.steps if all_contact else sizes.contact_rows
        return {
            "tape3": sizes.passes["DISP"],
            "tape8": sizes.contact_rows if has_impact else 0,
            "tape9": contact_rows if has_impact else 0,
            "history": sizes.steps if has_impact else 0,
            "energy": sizes.steps,
            "gages": sizes.steps if self._model.gages is not None else 0,
            "stresses": sizes.passes["STRE"],
            "plies": sizes.passes["PLYS"],
            **dict.fromkeys(FAILURE, int(self._model.failure is not None)),
            "patch": int(self._model.patch is not None),
            "reactions": sizes.passes["REAC"],
            "modes": sizes.passes["EIGE"],
        }

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
        constants: dict[str, NDArray[Any]] = {
            "mesh/coordinates": mesh.coordinates,
            "mesh/elements": mesh.elements,
            "mesh/equations": mesh.equations,
            "laminate/A": laminate.A,
            "laminate/B": laminate.B,
            "laminate/D": laminate.D,
            "laminate/shear": laminate.shear,
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
        """Store a row of one of the groups :data:`BUFFERED`: a value or an array per dataset."""
        rows = {name: np.asarray(value)[None] for name, value in columns.items()}
        self.rows(group, [step], [time], rows)

    def rows(
        self,
        group: str,
        steps: Steps,
        times: Times,
        columns: Mapping[str, NDArray[Any]],
    ) -> None:
        """Store rows of a group, the first axis of every array."""
        own = {"step": np.array(steps), "time": np.array(times)}
        self._buffers[group].put({**own, **columns})

    def displacements(self, steps: Steps, times: Times, fields: Floats) -> None:
        """Store rows of tape3: every dof of every node, (rows, numnp, 5)."""
        self.rows("tape3", steps, times, {"w": fields[:, :, 2], "displacement": fields})

    def strains(self, steps: Steps, times: Times, fields: Floats) -> None:
        """Store rows of tape8: strains of the displacements at `times`, (rows, numnp, 5)."""
        strains = self._model.strains.evaluate(fields)
        self.rows("tape8", steps, times, dict(zip(STRAINS, strains, strict=True)))

    def state(self) -> dict[str, Any]:
        """Rows that are not stored yet, for :meth:`restore`."""
        state = {f"steps/{name}": value for name, value in self.steps.state().items()}
        for group, buffer in self._buffers.items():
            state |= {f"rows/{group}/{name}": value for name, value in buffer.state().items()}
        return state

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue from a :meth:`state`."""
        self.steps.restore(subset(state, "steps/"))
        for group, buffer in self._buffers.items():
            buffer.restore(subset(state, f"rows/{group}/"))

    def failure(self, found: FailureEnvelope) -> None:
        """Store the largest exposures of FAIL."""
        groups = [(f"failure/{name}", n) for n, name in enumerate(CRITERIA)]
        for part in ("exposure", "time", "mode"):
            for group, n in groups:
                values = getattr(found.plies, part)[n]
                shape = self._shape(DATASETS[f"{group}/{part}"])
                self._sink.write(f"{group}/{part}", 0, values.reshape(shape))
            self._sink.write(f"{INTERLAMINAR}/{part}", 0, getattr(found.interfaces, part))

    def finish(self) -> None:
        """Store the remaining rows and trim each dataset to its rows."""
        self.steps.flush()
        stored = dict(self.steps.rows)
        for group, buffer in self._buffers.items():
            buffer.flush()
            stored[group] = buffer.stored
        for dataset, _ in self._datasets:
            room, rows = self._room.get(dataset.group, 0), stored.get(dataset.group, 0)
            if room > rows and dataset.shape[0] == "rows":
                self._sink.trim(dataset.path, rows)
