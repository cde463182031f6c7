"""Partial results of a sweep: a folder beside the result.

There is one file per task.  It is written under a temporary name, synchronised and renamed, so that
an interrupted sweep leaves only complete files.  A checksum at its end reveals damage.
"""

from __future__ import annotations

import hashlib
import io
import json
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from fecm._errors import FecmError
from fecm._files import beside, packed
from fecm.sweeps.outcome import Forces, Outcome
from fecm.sweeps.plan import Task

MARK = "sweep.json"
# Bytes of the checksum after the arrays of a file.
CHECKSUM = hashlib.sha256().digest_size


class OtherSweepError(FecmError, ValueError):
    """The folder holds the outcomes of another sweep."""


class DamagedPartError(FecmError, ValueError):
    """A file of the folder is damaged."""


class PartialResults:
    """Outcomes of finished tasks of the sweep with a fingerprint, for its result file.

    `restart` deletes the outcomes of another sweep.  Raises OtherSweepError if the folder holds
    another sweep's outcomes.  Raises OSError if the folder cannot be created.
    """

    def __init__(self, result: Path, fingerprint: str, *, restart: bool = False) -> None:
        self.folder = result.with_name(f".{result.name}.parts")
        mark = self.folder / MARK
        if self.folder.exists() and _mark(mark) != fingerprint:
            if not restart:
                raise OtherSweepError(
                    f"{self.folder} holds the outcomes of another sweep; --overwrite deletes them"
                )
            shutil.rmtree(self.folder)
        self.folder.mkdir(exist_ok=True)
        with beside(mark) as partial:
            partial.write_text(json.dumps({"fingerprint": fingerprint}))

    def _path(self, task: Task) -> Path:
        return self.folder / f"task-{task.number:06d}.npz"

    def get(self, task: Task) -> Outcome | None:
        """Return the outcome of a finished task; None if there is none.

        Raises DamagedPartError if the file is damaged.
        """
        path = self._path(task)
        try:
            data = path.read_bytes()
        except FileNotFoundError:
            return None
        except OSError as error:
            raise DamagedPartError(f"{path}: {error.strerror}") from None
        packed_arrays, checksum = data[:-CHECKSUM], data[-CHECKSUM:]
        if hashlib.sha256(packed_arrays).digest() != checksum:
            raise DamagedPartError(f"{path} is damaged")
        with np.load(io.BytesIO(packed_arrays), allow_pickle=False) as arrays:
            if arrays["numbers"].tolist() != list(task.numbers):
                raise DamagedPartError(f"{path} holds other cases")
            columns = dict(arrays)
            force = columns.pop("force", None)
            return Outcome(columns.pop("numbers").tolist(), columns, force)

    def put(self, task: Task, outcome: Outcome) -> None:
        """Store the outcome of a task."""
        arrays = {**outcome.columns, "numbers": np.array(outcome.numbers)}
        if outcome.force is not None:
            arrays["force"] = outcome.force
        data = packed(arrays)
        with beside(self._path(task)) as partial, partial.open("wb") as file:
            file.write(data)
            file.write(hashlib.sha256(data).digest())

    def forces(self, tasks: Sequence[Task]) -> Iterator[Forces]:
        """Read the contact forces of one task after the other; None if all its cases failed."""
        for task in tasks:
            outcome = self.get(task)
            yield task.numbers, None if outcome is None else outcome.force

    def clear(self) -> None:
        """Delete the folder."""
        shutil.rmtree(self.folder, ignore_errors=True)


def _mark(path: Path) -> str:
    try:
        return str(json.loads(path.read_text())["fingerprint"])
    except (OSError, ValueError, KeyError, TypeError):
        return ""
