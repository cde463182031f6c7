"""Partial results of a sweep, in a folder beside its result.

There is one file per task, renamed into place when complete. It has the fingerprint of its sweep
and, at its end, a checksum that reveals damage. Only regular files are read; the folder must not be
a link.
"""

from __future__ import annotations

import hashlib
import io
import json
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path
from zipfile import ZIP_STORED

import numpy as np

from fecm._errors import FecmError
from fecm._files import OutputError, beside, make_folder, open_ordinary, packed
from fecm._typing import Array
from fecm.results.metrics import COLUMNS, GAGE, SUMMARY
from fecm.sweeps.outcome import About, Forces, Outcome
from fecm.sweeps.task import Task

CHECKSUM = hashlib.sha256().digest_size  # bytes of the checksum after the arrays of a file
MOST_MARK = 1000  # bytes of the file with the fingerprint of the folder's sweep
KINDS = {
    About.STATUS: "U", About.VALIDITY: "U", About.DT: "f", About.STEPS: "iu",
    About.UNSETTLED: "iu", About.REACHED: "f",
}  # fmt: skip


class OtherSweepError(FecmError, ValueError):
    """The folder holds the outcomes of another sweep."""


class DamagedPartError(FecmError, ValueError):
    """A file of the folder is damaged, or belongs to another sweep."""


def parts_of(result: Path) -> Path:
    """Return the folder of the partial results of a sweep."""
    return result.with_name(f".{result.name}.parts")


class PartialResults:
    """Outcomes of the finished tasks of a sweep with a fingerprint.

    `restart` deletes the outcomes of another sweep, for which OtherSweepError is raised otherwise.
    Without `resume` the outcomes of this sweep are deleted too.
    """

    def __init__(
        self, result: Path, fingerprint: str, *, restart: bool = False, resume: bool = True
    ) -> None:
        self.folder = parts_of(result)
        self.tasks: Sequence[Task] = ()  # tasks of all cases, once they are known
        self.resumes = resume  # whether the same call takes these outcomes
        self._fingerprint = fingerprint
        make_folder(self.folder)
        mark = self.folder / "sweep.json"
        # A sweep that was killed while it began has left a folder without outcomes.
        outcomes = list(self.folder.glob("task-*"))
        is_other = bool(outcomes) and _fingerprint_in(mark) != fingerprint
        if is_other and not restart:
            raise OtherSweepError(
                f"{self.folder} holds the outcomes of another sweep, or of another version of "
                "fecm; overwrite=True deletes them"
            )
        if is_other or not resume:
            for path in outcomes:
                _remove(path)
        _remove_folder(mark)
        with beside(mark, follow=False) as partial:
            partial.write_text(json.dumps({"fingerprint": fingerprint}))

    def _path(self, task: Task) -> Path:
        return self.folder / f"task-{task.number:06d}.npz"

    def get(self, task: Task) -> Outcome | None:
        """Return the outcome of a finished task; None if the task is not finished.

        Raises DamagedPartError if its file is damaged, or was not written by this sweep.
        """
        path = self._path(task)
        try:
            with open_ordinary(path) as file:
                data = file.read()
        except FileNotFoundError:
            return None
        except OutputError as error:
            raise DamagedPartError(str(error)) from None
        except OSError as error:
            raise DamagedPartError(f"{path}: {error.strerror}") from None
        packed_arrays, checksum = data[:-CHECKSUM], data[-CHECKSUM:]
        if hashlib.sha256(packed_arrays).digest() != checksum:
            raise DamagedPartError(f"{path} is damaged")
        try:
            arrays = _unpacked(packed_arrays)
        except Exception:  # a forged file raises anything in zipfile and NumPy
            raise DamagedPartError(f"{path} is damaged") from None
        if str(arrays.pop("sweep", None)) != self._fingerprint:
            raise DamagedPartError(f"{path} belongs to another sweep, or another version of fecm")
        numbers = arrays.pop("numbers", np.empty(0))
        if numbers.tolist() != list(task.numbers):
            raise DamagedPartError(f"{path} holds other cases")
        outcome = Outcome(list(task.numbers), arrays, arrays.pop("force", None))
        if not _is_sound(outcome):
            raise DamagedPartError(f"{path} does not hold the results of its cases")
        return outcome

    def put(self, task: Task, outcome: Outcome) -> None:
        """Store the outcome of a task."""
        numbers, sweep = np.array(outcome.numbers), np.array(self._fingerprint)
        arrays = {**outcome.columns, "numbers": numbers, "sweep": sweep}
        if outcome.force is not None:
            arrays["force"] = outcome.force
        data = packed(arrays)
        path = self._path(task)
        _remove_folder(path)
        with beside(path, follow=False) as partial, partial.open("wb") as file:
            file.write(data)
            file.write(hashlib.sha256(data).digest())

    @property
    def has_tasks(self) -> bool:
        """Whether an outcome is stored."""
        return any(self.folder.glob("task-*"))

    def forces(self) -> Iterator[Forces]:
        """Read the contact forces of each task; None if all its cases failed."""
        for task in self.tasks:
            outcome = self.get(task)
            yield task.numbers, None if outcome is None else outcome.force

    def clear(self) -> None:
        """Delete the folder."""
        shutil.rmtree(self.folder, ignore_errors=True)


def _fingerprint_in(mark: Path) -> str:
    """Return the fingerprint of the sweep whose outcomes a folder holds; empty if unreadable."""
    try:
        with open_ordinary(mark) as file:
            return str(json.loads(file.read(MOST_MARK))["fingerprint"])
    except (OSError, ValueError, LookupError, TypeError, RecursionError):
        return ""


def _unpacked(data: bytes) -> dict[str, Array]:
    """Return the arrays of an .npz file."""
    with np.load(io.BytesIO(data), allow_pickle=False) as stored:
        if any(member.compress_type != ZIP_STORED for member in stored.zip.infolist()):
            raise ValueError("it is compressed")
        return {name: np.asarray(stored[name]) for name in stored.files}


def _is_sound(outcome: Outcome) -> bool:
    """Return whether the columns of an outcome have the names, shapes and types of a sweep."""
    columns, force, count = outcome.columns, outcome.force, len(outcome.numbers)
    if not columns.keys() >= {*KINDS, *SUMMARY}:
        return False
    for name, values in columns.items():
        is_gage = name.startswith(GAGE) and name.removeprefix(GAGE).isdecimal()
        kinds = KINDS.get(About(name), "") if name in KINDS else "fiu"
        is_known = is_gage or name in KINDS or name in COLUMNS
        if not is_known or values.shape != (count,) or values.dtype.kind not in kinds:
            return False
    steps = columns[About.STEPS]
    if (steps < 0).any():
        return False
    return force is None or (
        force.dtype.kind == "f"
        and force.shape[:1] == (count,)
        and force.ndim == 2
        and force.shape[1] <= steps.max(initial=0)
    )


def _remove(path: Path) -> None:
    """Remove a file, link or folder; a link is not followed."""
    _remove_folder(path)
    path.unlink(missing_ok=True)


def _remove_folder(path: Path) -> None:
    """Remove a folder that has the name of a file, as no file can replace it."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
