"""Partial results of a sweep, in a folder beside its result.

One file per task, renamed into place when complete, with a checksum at its end that reveals damage.
"""

from __future__ import annotations

import hashlib
import io
import json
import shutil
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, suppress
from pathlib import Path

import numpy as np

from fecm._errors import FecmError
from fecm._files import beside, held, packed
from fecm.sweeps.outcome import Forces, Outcome
from fecm.sweeps.plan import Task

CHECKSUM = hashlib.sha256().digest_size  # bytes of the checksum after the arrays of a file


class OtherSweepError(FecmError, ValueError):
    """The folder holds the outcomes of another sweep."""


class DamagedPartError(FecmError, ValueError):
    """A file of the folder is damaged."""


def parts_of(result: Path) -> Path:
    """Folder of the partial results of a sweep."""
    return result.with_name(f".{result.name}.parts")


def alone(result: Path) -> AbstractContextManager[None]:
    """Keep other processes from this result; raises OutputError if one computes it."""
    return held(parts_of(result), f"{result} is being computed by another process")


class PartialResults:
    """Outcomes of finished tasks of the sweep with a fingerprint, for its result file.

    `restart` deletes the outcomes of another sweep, for which OtherSweepError is raised otherwise.
    """

    def __init__(self, result: Path, fingerprint: str, *, restart: bool = False) -> None:
        self.folder = parts_of(result)
        self.tasks: Sequence[Task] = ()  # those of all cases, once they are known
        self.folder.mkdir(exist_ok=True)
        mark, found = self.folder / "sweep.json", ""
        with suppress(OSError, ValueError, KeyError, TypeError):
            found = str(json.loads(mark.read_text())["fingerprint"])
        # A sweep that was killed while it began has left a folder without outcomes.
        outcomes = list(self.folder.glob("task-*"))
        if outcomes and found != fingerprint:
            if not restart:
                text = "holds the outcomes of another sweep; --overwrite deletes them"
                raise OtherSweepError(f"{self.folder} {text}")
            for path in outcomes:
                path.unlink()
        with beside(mark) as partial:
            partial.write_text(json.dumps({"fingerprint": fingerprint}))

    def _path(self, task: Task) -> Path:
        return self.folder / f"task-{task.number:06d}.npz"

    def get(self, task: Task) -> Outcome | None:
        """Outcome of a finished task, None if there is none; DamagedPartError if it is damaged."""
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
        return Outcome(columns.pop("numbers").tolist(), columns, columns.pop("force", None))

    def put(self, task: Task, outcome: Outcome) -> None:
        """Store the outcome of a task."""
        arrays = {**outcome.columns, "numbers": np.array(outcome.numbers)}
        if outcome.force is not None:
            arrays["force"] = outcome.force
        data = packed(arrays)
        with beside(self._path(task)) as partial, partial.open("wb") as file:
            file.write(data)
            file.write(hashlib.sha256(data).digest())

    def forces(self) -> Iterator[Forces]:
        """Read the contact forces of one task after the other; None if all its cases failed."""
        for task in self.tasks:
            outcome = self.get(task)
            yield task.numbers, None if outcome is None else outcome.force

    def clear(self) -> None:
        """Delete the folder."""
        shutil.rmtree(self.folder, ignore_errors=True)
