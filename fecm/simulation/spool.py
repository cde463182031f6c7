"""A journal of the operations on a result file, from which an identical file can be built.

Each operation is appended to a second file, the spool: a line of JSON, followed by the bytes of its
rows if it has any.  Replaying the spool produces a file of the same bytes.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from fecm._errors import FecmError
from fecm._files import naming, open_ordinary, sync
from fecm._frozen import frozen
from fecm.results.hdf5_writer import FileSink
from fecm.results.schema import DATASETS, Dataset

Array = NDArray[Any]

# Bytes read at once when a spool is checked.
CHUNK = 1_000_000


class CheckpointError(FecmError, ValueError):
    """The checkpoint, or its spool, can't be used."""


@frozen
class Part:
    """The part of a spool that belongs to a checkpoint: number of bytes and their CRC."""

    length: int
    checksum: int


class Journal:
    """Passes operations to a file sink and records them.

    Rows are not kept in memory: they are read back from the file when they are spooled.
    """

    def __init__(self, sink: FileSink) -> None:
        self._sink = sink
        self.spooled = Part(0, 0)  # the part that a checkpoint names
        self._new: list[dict[str, Any]] = []

    def attributes(self, group: str, values: Mapping[str, Any]) -> None:
        """Set attributes of a group."""
        self._new.append({"do": "attributes", "group": group, "values": dict(values)})
        self._sink.attributes(group, values)

    def create(self, dataset: Dataset, shape: tuple[int, ...]) -> None:
        """Create a dataset."""
        self._new.append({"do": "create", "path": dataset.path, "shape": shape})
        self._sink.create(dataset, shape)

    def write(self, path: str, start: int, rows: Array) -> None:
        """Store rows of a dataset."""
        self._new.append({"do": "write", "path": path, "start": start, "rows": len(rows)})
        self._sink.write(path, start, rows)

    def trim(self, path: str, rows: int) -> None:
        """Trim a dataset; nothing is spooled after that."""
        self._sink.trim(path, rows)

    def text(self, path: str, value: str, description: str) -> None:
        """Store a text."""
        entry = {"do": "text", "path": path, "value": value, "description": description}
        self._new.append(entry)
        self._sink.text(path, value, description)

    @property
    def arrays(self) -> Mapping[str, Array]:
        """Datasets that are stored so far, by path."""
        return self._sink.arrays

    def spool(self, file: BinaryIO) -> Part:
        """Append the new operations to the spool and sync it.

        The next call overwrites them unless a checkpoint names them: see :meth:`keep`.  Raises
        OSError if the spool or the result can't be written.
        """
        self._sink.check()
        file.truncate(self.spooled.length)
        file.seek(self.spooled.length)
        checksum = self.spooled.checksum
        for entry in self._new:
            for data in self._data(entry):
                file.write(data)
                checksum = zlib.crc32(data, checksum)
        file.flush()
        sync(file.fileno())
        return Part(file.tell(), checksum)

    def _data(self, entry: dict[str, Any]) -> list[bytes | memoryview]:
        """Return the line of an operation and its rows, if any."""
        if entry["do"] != "write":
            return [_line(entry)]
        stop = entry["start"] + entry["rows"]
        rows = np.ascontiguousarray(self._sink.stored(entry["path"], entry["start"], stop))
        return [_line({**entry, "dtype": rows.dtype.str, "shape": rows.shape}), rows.data.cast("B")]

    def keep(self, part: Part) -> None:
        """Note that a checkpoint names this part of the spool."""
        self.spooled = part
        self._new.clear()

    def replay(self, path: Path, part: Part) -> None:
        """Repeat the operations of a part of a spool.

        Raises CheckpointError if the part is incomplete or damaged.  Raises OSError if the spool
        can't be read or the result can't be written.
        """
        with naming(path), open_ordinary(path) as file:
            if _checksum(file, part.length) != part.checksum:
                raise CheckpointError(f"{path} is damaged, or was written by another run")
            import json

            file.seek(0)
            while file.tell() < part.length:
                try:
                    self._do(json.loads(file.readline()), file)
                except Exception as error:  # a damaged file raises anything in json, NumPy and h5py
                    self._sink.check()
                    raise CheckpointError(f"{path} is damaged ({error})") from None
        self.spooled = part

    def _do(self, entry: dict[str, Any], file: BinaryIO) -> None:
        match entry["do"]:
            case "attributes":
                self._sink.attributes(entry["group"], entry["values"])
            case "create":
                self._sink.create(DATASETS[entry["path"]], tuple(entry["shape"]))
            case "text":
                self._sink.text(entry["path"], entry["value"], entry["description"])
            case "write":
                dtype, shape = np.dtype(entry["dtype"]), tuple(entry["shape"])
                data = file.read(int(np.prod(shape)) * dtype.itemsize)
                rows = np.frombuffer(data, dtype).reshape(shape)
                self._sink.write(entry["path"], entry["start"], rows)
            case other:
                raise ValueError(f"unknown operation `{other}`")


def _checksum(file: BinaryIO, length: int) -> int:
    """CRC of the first `length` bytes, or of all if there are fewer."""
    checksum = 0
    while length > 0 and (data := file.read(min(length, CHUNK))):
        checksum = zlib.crc32(data, checksum)
        length -= len(data)
    return checksum


def _line(entry: Mapping[str, Any]) -> bytes:
    """An operation in JSON, with NumPy's numbers and arrays as Python's."""
    import json

    return json.dumps(entry, default=lambda value: value.tolist()).encode() + b"\n"
