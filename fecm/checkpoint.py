"""Checkpoints: the whole state of a run, kept beside its result.

Two files: the checkpoint with the state, which is written beside its name, synced and renamed, and
the spool with everything stored so far, which only grows.  A checkpoint names the part of the spool
that belongs to it, by length and checksum, so that whatever ends a run, the last checkpoint is
whole.  The run that goes on from it ends in the same bytes as one that was never stopped.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import time
import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fecm.files import packed, partial_of
from fecm.results.journal import Journal, Part
from fecm.simulation import Simulation
from fecm.version import __version__

FORMAT = 1


class CheckpointError(ValueError):
    """A checkpoint can't be used; the message says why."""


def checkpoint_of(result: Path) -> Path:
    """Path of a result's checkpoint."""
    return result.with_name(f"{result.name}.checkpoint")


def spool_of(result: Path) -> Path:
    """Path of a result's spool."""
    return result.with_name(f"{result.name}.spool")


def identity(simulation: Simulation) -> dict[str, Any]:
    """What a run must have in common with the one that goes on from its checkpoint."""
    deck, choices = simulation.checked.deck, simulation.choices
    text = deck.text or deck.to_text()
    return {
        "format": FORMAT,
        "version": __version__,
        "deck": hashlib.sha256(text.encode()).hexdigest(),
        "slips": sorted(choices.slips),
        "solver": choices.solver,
        "rod": [choices.rod_method.mass, choices.rod_method.integrator],
        "printed": simulation.printer.is_on,
    }


# How a message names what differs.
_NAMES = {
    "format": "another kind of checkpoint",
    "version": "another version of fecm",
    "deck": "another deck",
    "slips": "another mode or other slips",
    "solver": "another solver",
    "rod": "another mass matrix or integrator of the rod",
    "printed": "a run with another choice of --print",
}


class Checkpointer:
    """Keeps the checkpoints of a run.

    Parameters
    ----------
    result : Path
        Where the run's result will stand.
    journal : Journal
        What it was given.
    """

    def __init__(self, result: Path, journal: Journal) -> None:
        self._checkpoint, self._spool = checkpoint_of(result), spool_of(result)
        self._journal = journal
        self._written = time.monotonic()

    @property
    def age(self) -> float:
        """Seconds since the last checkpoint, or since the run began."""
        return time.monotonic() - self._written

    def write(self, simulation: Simulation) -> None:
        """Write a checkpoint.

        Raises
        ------
        OSError
            If it can't be written; the one before is then untouched.
        """
        with self._spool.open("r+b" if self._journal.spooled.length else "w+b") as spool:
            part = self._journal.spool(spool)
        values, arrays = _split(simulation.state())
        about = {"identity": identity(simulation), "spool": vars(part), "values": values}
        partial = partial_of(self._checkpoint)
        try:
            with partial.open("wb") as file:
                told = np.frombuffer(json.dumps(about).encode(), np.uint8)
                file.write(packed({"about": told, **arrays}))
                file.flush()
                os.fsync(file.fileno())
            partial.replace(self._checkpoint)
        finally:
            partial.unlink(missing_ok=True)
        _sync(self._checkpoint.parent)
        self._journal.keep(part)
        self._written = time.monotonic()

    def restore(self, simulation: Simulation) -> None:
        """Bring a new simulation, its sink muted, to where the checkpoint was written.

        Raises
        ------
        CheckpointError
            If there is no checkpoint, it is damaged, or belongs to another run.
        OSError
            If it can't be read.
        """
        with self._reading():
            about, arrays = self._read()
            theirs, ours = about["identity"], identity(simulation)
            for name, value in ours.items():
                if theirs.get(name) != value:
                    told = f" ({theirs['version']}, not {value})" if name == "version" else ""
                    raise CheckpointError(f"{self._checkpoint} belongs to {_NAMES[name]}{told}")
            part = Part(**about["spool"])
        self._journal.replay(self._spool, part)
        with self._reading():
            simulation.restore({**about["values"], **arrays})

    def _read(self) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
        """What a checkpoint says in JSON, and its arrays."""
        if not self._checkpoint.exists():
            raise CheckpointError(f"there is no checkpoint {self._checkpoint}")
        with self._checkpoint.open("rb") as file, np.load(file, allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in stored.files}
        return json.loads(arrays.pop("about").tobytes()), arrays

    @contextlib.contextmanager
    def _reading(self) -> Iterator[None]:
        """Say of whatever does not fit together that the checkpoint is damaged."""
        try:
            yield
        except CheckpointError:
            raise
        except (ValueError, LookupError, TypeError, AttributeError, zipfile.BadZipFile,
                EOFError) as error:  # fmt: skip
            raise CheckpointError(f"{self._checkpoint} is damaged ({error})") from None

    def clear(self) -> None:
        """Throw the checkpoint away."""
        self._checkpoint.unlink(missing_ok=True)
        self._spool.unlink(missing_ok=True)


def _split(state: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """Values that JSON knows, and arrays, of a state."""
    arrays = {name: value for name, value in state.items() if isinstance(value, np.ndarray)}
    return {name: value for name, value in state.items() if name not in arrays}, arrays


def _sync(folder: Path) -> None:
    """Bring a folder's names to the disk, where folders can be opened."""
    try:
        handle = os.open(folder, os.O_RDONLY)
    except OSError:
        return
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
