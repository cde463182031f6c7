"""Sinks: destinations of a run's rows.

Every dataset is created once with its full shape. Then its rows are written in order. The memory
sink keeps arrays; the file sink (:mod:`fecm.results.hdf5_writer`) writes them at once.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from enum import StrEnum
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from fecm._typing import Array
from fecm.results.schema import Dataset, required_dataset

if TYPE_CHECKING:
    from fecm.results.hdf5_writer import FileSink


class Operation(StrEnum):
    """Operation on a result file, which a checkpoint repeats."""

    ATTRIBUTES = "attributes"
    CREATE = "create"
    TEXT = "text"
    WRITE = "write"


class MemorySink:
    """Sink that keeps a result in arrays."""

    def __init__(self) -> None:
        self.arrays: dict[str, Array] = {}
        self.texts: dict[str, str] = {}
        self.groups: dict[str, dict[str, Any]] = {}
        self.axis_names: dict[str | int, tuple[str, ...]] = {}  # which only files have

    def attributes(self, group: str, values: Mapping[str, Any]) -> None:
        """Set attributes of a group; ``""`` is the file itself."""
        self.groups.setdefault(group, {}).update(values)

    def create(self, dataset: Dataset, shape: tuple[int, ...], *, grows: bool = False) -> None:
        """Create a dataset; one that grows may get fewer rows.

        Raises ValueError if the dataset is not in the schema.
        """
        required_dataset(dataset.path, len(shape))
        self.arrays[dataset.path] = np.zeros(shape, dtype=dataset.dtype)

    def write(self, path: str, start: int, rows: Array) -> None:
        """Store rows of a dataset, from row `start`."""
        self.arrays[path][start : start + len(rows)] = rows

    def trim(self, path: str, rows: int) -> None:
        """Truncate a dataset to its first rows; delete a dataset without rows."""
        kept = self.arrays.pop(path)[:rows].copy()
        if rows:
            self.arrays[path] = kept

    def deck(self, text: str) -> None:
        """Store the text of the deck."""
        self.texts["deck"] = text


Sink: TypeAlias = "MemorySink | FileSink"


def doubles(values: Array) -> Array:
    """Return numbers that a compact file has in single precision as double ones."""
    return values.astype(np.float64) if values.dtype == np.float32 else values


class ReadOnce(Mapping[str, Array]):
    """Datasets of a sink by path, for the result of a run that is about to end.

    Each dataset is read when it is first needed, and kept. Single rows are not kept.
    """

    def __init__(self, sink: Sink) -> None:
        self._datasets: Mapping[str, Any] = sink.arrays
        self._read: dict[str, Array] = {}

    def __getitem__(self, path: str) -> Array:
        if path not in self._read:
            self._read[path] = doubles(np.asarray(self._datasets[path]))
        return self._read[path]

    def rows(self, path: str, start: int, stop: int) -> Array:
        """Return rows `start` to `stop` of a dataset."""
        return doubles(np.asarray(self._read.get(path, self._datasets[path])[start:stop]))

    def __contains__(self, path: object) -> bool:
        return path in self._datasets  # Mapping's own method would read the dataset

    def __iter__(self) -> Iterator[str]:
        return iter(self._datasets)

    def __len__(self) -> int:
        return len(self._datasets)


class RowBuffer:
    """Buffer of the rows of one group, which writes them to a sink in blocks.

    Its members are datasets with their full shapes, rows first. `stored` counts the rows written.
    """

    BYTES = 1_000_000  # of a block at most

    def __init__(self, sink: Sink, members: Sequence[tuple[Dataset, tuple[int, ...]]]) -> None:
        self._sink = sink
        row_bytes = 8 * max(1, sum(math.prod(shape[1:]) for _, shape in members))
        rows = min(members[0][1][0], max(1, self.BYTES // row_bytes))
        self._paths = {d.name: d.path for d, _ in members}
        self._blocks = {d.name: np.empty((rows, *shape[1:]), d.dtype) for d, shape in members}
        self._room = rows
        self._filled = 0
        self.stored = 0

    def state(self) -> dict[str, Any]:
        """Return the rows not yet written, and the number of written ones."""
        held = {name: block[: self._filled].copy() for name, block in self._blocks.items()}
        return {"stored": self.stored, **held}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Restore a :meth:`state`."""
        self.stored = state["stored"]
        for name, block in self._blocks.items():
            self._filled = len(state[name])
            block[: self._filled] = state[name]

    def put(self, columns: Mapping[str, Array]) -> None:
        """Add rows: for every dataset an array whose first axis is the row."""
        count = len(next(iter(columns.values())))
        if self._filled + count > self._room:
            self.flush()
        if count >= self._room:
            self._write(columns, count)
            return
        for name, block in self._blocks.items():
            block[self._filled : self._filled + count] = columns[name]
        self._filled += count
        if self._filled == self._room:
            self.flush()

    def flush(self) -> None:
        """Write the collected rows."""
        if self._filled:
            blocks = {name: block[: self._filled] for name, block in self._blocks.items()}
            self._write(blocks, self._filled)
        self._filled = 0

    def _write(self, blocks: Mapping[str, Array], rows: int) -> None:
        for name, path in self._paths.items():
            self._sink.write(path, self.stored, blocks[name])
        self.stored += rows
