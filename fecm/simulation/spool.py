"""A journal of what a file sink was given, from which an equal file can be made again.

What is stored in a result is spooled, operation by operation, into a second file: a line of JSON,
and behind the operations that have any their numbers as bytes.  Replaying it makes a file of the
same bytes.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from fecm._errors import FecmError
from fecm._files import naming, open_ordinary, sync
from fecm.results.hdf5_writer import FileSink
from fecm.results.schema import DATASETS, Dataset

Array = NDArray[Any]

# Bytes that are read at once to check a spool.
CHUNK = 1_000_000


class SpoolError(FecmError, ValueError):
    """A spool is not whole."""


@dataclass(frozen=True)
class Part:
    """The part of a spool that belongs to a checkpoint: its first bytes, and their CRC."""

    length: int
    checksum: int


class Journal:
    """Passes everything on to a file sink and remembers what it was.

    Rows are not kept in memory: they are read back from the file when they are spooled.

    Parameters
    ----------
    sink : FileSink
        The result.
    muted : bool
        Take nothing in: what comes stands in a spool already.

    Attributes
    ----------
    spooled : Part
        What stands in the spool for good.
    """

    def __init__(self, sink: FileSink, *, muted: bool = False) -> None:
        self._sink = sink
        self.muted = muted
        self.spooled = Part(0, 0)
        self._new: list[dict[str, Any]] = []

    def attributes(self, group: str, values: Mapping[str, Any]) -> None:
        """Set attributes of a group."""
        if not self.muted:
            self._new.append({"do": "attributes", "group": group, "values": dict(values)})
            self._sink.attributes(group, values)

    def create(self, dataset: Dataset, shape: tuple[int, ...]) -> None:
        """Make room for a dataset."""
        if not self.muted:
            self._new.append({"do": "create", "path": dataset.path, "shape": shape})
            self._sink.create(dataset, shape)

    def write(self, path: str, start: int, rows: Array) -> None:
        """Store rows of a dataset."""
        if not self.muted:
            self._new.append({"do": "write", "path": path, "start": start, "rows": len(rows)})
            self._sink.write(path, start, rows)

    def trim(self, path: str, rows: int) -> None:
        """Cut a dataset down to its first rows; behind that nothing is spooled any more."""
        self._sink.trim(path, rows)

    def text(self, path: str, value: str, description: str) -> None:
        """Store a text."""
        if not self.muted:
            told = {"do": "text", "path": path, "value": value, "description": description}
            self._new.append(told)
            self._sink.text(path, value, description)

    def spool(self, file: BinaryIO) -> Part:
        """Write what is new behind what stands in a spool for good, and bring it to the disk.

        It stands there for good once a checkpoint names it: see :meth:`keep`.

        Raises
        ------
        OSError
            If it can't be written, or the result can't.
        """
        self._sink.check()
        file.truncate(self.spooled.length)
        file.seek(self.spooled.length)
        checksum = self.spooled.checksum
        for told in self._new:
            for data in self._data(told):
                file.write(data)
                checksum = zlib.crc32(data, checksum)
        file.flush()
        sync(file.fileno())
        return Part(file.tell(), checksum)

    def _data(self, told: dict[str, Any]) -> list[bytes | memoryview]:
        """What a spool says of an operation: its line, and its rows if it has any."""
        if told["do"] != "write":
            return [_line(told)]
        stop = told["start"] + told["rows"]
        rows = np.ascontiguousarray(self._sink.stored(told["path"], told["start"], stop))
        return [_line({**told, "dtype": rows.dtype.str, "shape": rows.shape}), rows.data.cast("B")]

    def keep(self, part: Part) -> None:
        """Take it that a checkpoint names this part of the spool."""
        self.spooled = part
        self._new.clear()

    def replay(self, path: Path, part: Part) -> None:
        """Do again what a part of a spool says, and take it from there.

        Raises
        ------
        SpoolError
            If it is not whole.
        OSError
            If it can't be read, or the result can't be written.
        """
        with naming(path), open_ordinary(path) as file:
            if _checksum(file, part.length) != part.checksum:
                raise SpoolError(f"{path} is damaged, or was written by another run")
            file.seek(0)
            while file.tell() < part.length:
                try:
                    self._do(json.loads(file.readline()), file)
                except Exception as error:  # whatever a file can do to json, NumPy and h5py
                    self._sink.check()
                    raise SpoolError(f"{path} is damaged ({error})") from None
        self.spooled = part
        self.muted = False

    def _do(self, told: dict[str, Any], file: BinaryIO) -> None:
        match told["do"]:
            case "attributes":
                self._sink.attributes(told["group"], told["values"])
            case "create":
                self._sink.create(DATASETS[told["path"]], tuple(told["shape"]))
            case "text":
                self._sink.text(told["path"], told["value"], told["description"])
            case "write":
                dtype, shape = np.dtype(told["dtype"]), tuple(told["shape"])
                data = file.read(int(np.prod(shape)) * dtype.itemsize)
                rows = np.frombuffer(data, dtype).reshape(shape)
                self._sink.write(told["path"], told["start"], rows)
            case other:
                raise ValueError(f"it says `{other}`")


def _checksum(file: BinaryIO, length: int) -> int:
    """CRC of so many bytes; of fewer if there are not as many."""
    checksum = 0
    while length > 0 and (data := file.read(min(length, CHUNK))):
        checksum = zlib.crc32(data, checksum)
        length -= len(data)
    return checksum


def _line(told: Mapping[str, Any]) -> bytes:
    return json.dumps(told, default=_plain).encode() + b"\n"


def _plain(value: Any) -> Any:
    """NumPy's numbers and arrays as Python's."""
    return value.tolist()
