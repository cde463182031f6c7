"""A journal of what a file sink was given, from which an equal file can be made again.

What is stored in a result is spooled, operation by operation, into a second file: a line of JSON,
and behind the operations that have any their numbers as bytes.  Replaying it makes a file of the
same bytes.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from fecm.results.file_writer import FileSink
from fecm.results.schema import DATASETS, Dataset

Array = NDArray[Any]


class SpoolError(ValueError):
    """A spool is not whole."""


class Journal:
    """Passes everything on to a file sink and remembers what it was.

    Rows are not kept in memory: they are read back from the file when they are spooled.

    Parameters
    ----------
    sink : FileSink
        The result.
    muted : bool
        Take nothing in: what comes stands in a spool already.
    """

    def __init__(self, sink: FileSink, *, muted: bool = False) -> None:
        self._sink = sink
        self.muted = muted
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

    def spool(self, file: BinaryIO) -> int:
        """Append what is new to a spool and bring it to the disk; the spool's length.

        Raises
        ------
        OSError
            If it can't be written, or the result can't.
        """
        self._sink.check()
        for told in self._new:
            if told["do"] != "write":
                file.write(_line(told))
                continue
            stop = told["start"] + told["rows"]
            rows = np.ascontiguousarray(self._sink.stored(told["path"], told["start"], stop))
            head = {**told, "dtype": rows.dtype.str, "shape": rows.shape}
            file.write(_line(head))
            file.write(rows.data)
        self._new.clear()
        file.flush()
        os.fsync(file.fileno())
        return file.tell()

    def replay(self, path: Path, length: int) -> None:
        """Do again what the first `length` bytes of a spool say.

        Raises
        ------
        SpoolError
            If it is not whole.
        OSError
            If it can't be read, or the result can't be written.
        """
        with path.open("rb") as file:
            while file.tell() < length:
                try:
                    told = json.loads(file.readline())
                    self._do(told, file)
                except (ValueError, KeyError, TypeError) as error:
                    raise SpoolError(f"{path} is damaged ({error})") from None
            if file.tell() != length:
                raise SpoolError(f"{path} is cut short")

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
                count = int(np.prod(shape)) * dtype.itemsize
                data = file.read(count)
                if len(data) != count:
                    raise ValueError("its rows are cut short")
                rows = np.frombuffer(data, dtype).reshape(shape)
                self._sink.write(told["path"], told["start"], rows)
            case other:
                raise ValueError(f"it says `{other}`")


def _line(told: Mapping[str, Any]) -> bytes:
    return json.dumps(told, default=_plain).encode() + b"\n"


def _plain(value: Any) -> Any:
    """NumPy's numbers and arrays as Python's."""
    return value.tolist()
