"""Where a sweep's outcomes are kept until all are there: a folder beside the result.

One file a task, each written beside its name and renamed, so that whatever ends a sweep leaves
whole files behind.
"""

from __future__ import annotations

import json
import shutil
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from fecm.files import beside, packed
from fecm.sweeps.outcome import SUMMARY, Outcome
from fecm.sweeps.run import Task

MARK = "sweep.json"


class OtherSweepError(ValueError):
    """The folder holds what another sweep has finished."""


class Parts:
    """The outcomes that a sweep has finished.

    Parameters
    ----------
    result : Path
        The sweep's result.
    fingerprint : str
        What tells this sweep from another one.
    restart : bool
        Throw away what another sweep has left.

    Raises
    ------
    OtherSweepError
        If the folder holds another sweep's outcomes.
    OSError
        If it can't be made.
    """

    def __init__(self, result: Path, fingerprint: str, *, restart: bool = False) -> None:
        self.folder = result.with_name(f".{result.name}.parts")
        mark = self.folder / MARK
        if self.folder.exists() and _mark(mark) != fingerprint:
            if not restart:
                raise OtherSweepError(
                    f"{self.folder} holds what another sweep has finished; --overwrite throws it "
                    "away"
                )
            shutil.rmtree(self.folder)
        self.folder.mkdir(exist_ok=True)
        with beside(mark) as partial:
            partial.write_text(json.dumps({"fingerprint": fingerprint}))

    def _path(self, task: Task) -> Path:
        return self.folder / f"task-{task.number:06d}.npz"

    def get(self, task: Task) -> Outcome | None:
        """Outcome of a task that was finished before; None if it was not, or can't be read."""
        path = self._path(task)
        if not path.exists():
            return None
        try:
            with path.open("rb") as file, np.load(file, allow_pickle=False) as arrays:
                return Outcome(
                    arrays["numbers"].tolist(),
                    {name: arrays[name] for name in SUMMARY},
                    arrays["status"].tolist(),
                    arrays["dt"],
                    arrays["steps"],
                    arrays.get("force", None),
                )
        except (OSError, KeyError, ValueError, zipfile.BadZipFile):
            return None

    def put(self, task: Task, outcome: Outcome) -> None:
        """Keep the outcome of a task."""
        arrays: dict[str, Any] = {
            **outcome.summary,
            "numbers": np.array(outcome.numbers),
            "status": np.array(outcome.status, dtype=np.str_),
            "dt": outcome.dt,
            "steps": outcome.steps,
        }
        if outcome.force is not None:
            arrays["force"] = outcome.force
        with beside(self._path(task)) as partial:
            partial.write_bytes(packed(arrays))

    def clear(self) -> None:
        """Throw everything away."""
        shutil.rmtree(self.folder, ignore_errors=True)


def _mark(path: Path) -> str:
    try:
        return str(json.loads(path.read_text())["fingerprint"])
    except (OSError, ValueError, KeyError, TypeError):
        return ""
