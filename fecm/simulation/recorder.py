"""The recorder of a run: makes room for every dataset, and stores rows in a sink."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fecm._typing import Floats
from fecm.deck.macros import WorkEstimate
from fecm.mechanics.plate import PlateModel
from fecm.mechanics.strains import STRAINS
from fecm.problem.build import ImpactModel
from fecm.results.schema import DATASETS
from fecm.results.sinks import RowBuffer, Sink
from fecm.simulation.step_recorder import StepRecorder

BUFFERED = ("tape3", "tape8", "stresses", "reactions", "modes")


def with_prefix(state: Mapping[str, Any], prefix: str) -> dict[str, Any]:
    """What a state holds under names that begin so, by the rest of them."""
    return {n.removeprefix(prefix): v for n, v in state.items() if n.startswith(prefix)}


class Recorder:
    """Stores what a run gives.

    Parameters
    ----------
    sink : Sink
        Receives the rows.
    setup : ImpactModel
        The run's parts.
    sizes : WorkEstimate
        How many rows there will be at the most.
    contact_at_every_step, limit
        See :class:`~fecm.simulation.step_recorder.StepRecorder`.
    """

    def __init__(
        self,
        sink: Sink,
        setup: ImpactModel,
        sizes: WorkEstimate,
        *,
        contact_at_every_step: bool = False,
        limit: float | None = None,
    ) -> None:
        self._sink = sink
        self._setup = setup
        self.steps = StepRecorder(
            sink,
            setup,
            contact_at_every_step=contact_at_every_step,
            limit=limit,
        )
        self._room = self._rows_to_come(sizes, contact_at_every_step)
        self._buffers: dict[str, RowBuffer] = {}
        self._create()
        self._store_plate(setup.plate)

    def _rows_to_come(self, sizes: WorkEstimate, contact_at_every_step: bool) -> dict[str, int]:
        """Rows of each group at the most."""
        hits = self._setup.impact is not None
        return {
            "tape3": sizes.passes["DISP"],
            "tape8": sizes.contact_rows if hits else 0,
            "tape9": (sizes.steps if contact_at_every_step else sizes.contact_rows) if hits else 0,
            "history": sizes.steps if hits else 0,
            "energy": sizes.steps,
            "gages": sizes.steps if self._setup.gages is not None else 0,
            "stresses": sizes.passes["STRE"],
            "reactions": sizes.passes["REAC"],
            "modes": sizes.passes["EIGE"],
        }

    def _create(self) -> None:
        """Make room for every dataset of which there will be a row."""
        mesh = self._setup.plate.mesh
        numbers = {
            "numnp": mesh.coordinates.shape[0], "ndm": mesh.coordinates.shape[1],
            "numel": mesh.elements.shape[0], "nen": mesh.elements.shape[1],
            "ndf": mesh.equations.shape[1], "npt": self._setup.strains.shape[1],
            "nps": self._setup.stress_points.shape[1],
            "gages": 0 if self._setup.gages is None else len(self._setup.gages.numbers),
        }  # fmt: skip
        for dataset in DATASETS.values():
            rows = self._room.get(dataset.group)
            if rows == 0:
                continue
            known = numbers | {"rows": rows or 0}
            shape = tuple(known[n] if isinstance(n, str) else n for n in dataset.shape)
            self._sink.create(dataset, shape)
        for group in BUFFERED:
            if rows := self._room[group]:
                known = numbers | {"rows": rows}
                members = [
                    d for d in DATASETS.values() if d.group == group and d.shape[0] == "rows"
                ]
                shapes = [
                    tuple(known[n] if isinstance(n, str) else n for n in d.shape) for d in members
                ]
                self._buffers[group] = RowBuffer(self._sink, members, shapes)

    def _store_plate(self, plate: PlateModel) -> None:
        """Store mesh and laminate."""
        mesh, laminate = plate.mesh, plate.laminate
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
        if self._room["gages"] and self._setup.gages is not None:
            self._sink.write("gages/number", 0, self._setup.gages.numbers)

    def constant(self, path: str, array: Floats) -> None:
        """Store a dataset that has no rows."""
        self._sink.write(path, 0, array)

    def row(self, group: str, step: int, time: float, columns: Mapping[str, Any]) -> None:
        """Store a row of a group.

        Parameters
        ----------
        group : str
            One of :data:`BUFFERED`.
        step, time : int, float
            When.
        columns : mapping
            A value or an array for each of the group's other datasets.
        """
        self._buffers[group].put({"step": step, "time": time, **columns})

    def displacements(self, step: int, time: float, field: Floats) -> None:
        """Store a row of tape3: every unknown of every node, (numnp, 5)."""
        self.row("tape3", step, time, {"w": field[:, 2], "displacement": field})

    def strains(self, step: int, time: float, field: Floats) -> None:
        """Store a row of tape8: strains of a field that belongs to `time`."""
        values = self._setup.strains.evaluate(field)
        self.row("tape8", step, time, dict(zip(STRAINS, values, strict=True)))

    def state(self) -> dict[str, Any]:
        """What is held back."""
        state = {f"steps/{name}": value for name, value in self.steps.state().items()}
        for group, buffer in self._buffers.items():
            state |= {f"rows/{group}/{name}": value for name, value in buffer.state().items()}
        return state

    def restore(self, state: Mapping[str, Any]) -> None:
        """Hold back again what :meth:`state` gave."""
        self.steps.restore(with_prefix(state, "steps/"))
        for group, buffer in self._buffers.items():
            buffer.restore(with_prefix(state, f"rows/{group}/"))

    def finish(self) -> None:
        """Store all that is held back, and cut off the rows that never came.

        Raises
        ------
        DivergenceError
            If the energy has grown without bound.
        """
        self.steps.flush()
        stored = dict(self.steps.rows)
        for group, buffer in self._buffers.items():
            buffer.flush()
            stored[group] = buffer.stored
        for dataset in DATASETS.values():
            room, came = self._room.get(dataset.group, 0), stored.get(dataset.group, 0)
            if room > came and dataset.shape[0] == "rows":
                self._sink.trim(dataset.path, came)
