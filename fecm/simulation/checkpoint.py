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

from fecm._errors import FecmError
from fecm._files import beside, naming, open_ordinary, packed
from fecm._version import __version__
from fecm.simulation.simulation import Simulation
from fecm.simulation.spool import Journal, Part

FORMAT = 1


class CheckpointError(FecmError, ValueError):
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
        flags = os.O_RDWR
        if not self._journal.spooled.length:
            self._spool.unlink(missing_ok=True)
            flags |= os.O_CREAT | os.O_EXCL
        with naming(self._spool), open_ordinary(self._spool, flags) as spool:
            part = self._journal.spool(spool)
        values, arrays = _split(simulation.state())
        about = {"identity": identity(simulation), "spool": vars(part), "values": values}
        told = np.frombuffer(json.dumps(about).encode(), np.uint8)
        with beside(self._checkpoint, follow=False) as partial:
            partial.write_bytes(packed({"about": told, **arrays}))
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
            for name, own in _split(simulation.state())[1].items():
                theirs = arrays[name]
                fits = own.shape == theirs.shape or not name.startswith("state/")
                if own.dtype != theirs.dtype or own.ndim != theirs.ndim or not fits:
                    raise ValueError(f"{name} has another shape or type")
            simulation.restore({**about["values"], **arrays})

    def _read(self) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
        """What a checkpoint says in JSON, and its arrays."""
        if not self._checkpoint.exists():
            raise CheckpointError(f"there is no checkpoint {self._checkpoint}")
        with (
            naming(self._checkpoint),
            open_ordinary(self._checkpoint) as file,
            np.load(file, allow_pickle=False) as stored,
        ):
            if any(member.compress_type != zipfile.ZIP_STORED for member in stored.zip.infolist()):
                raise ValueError("it is compressed")
            arrays = {name: stored[name] for name in stored.files}
        return json.loads(arrays.pop("about").tobytes()), arrays

    @contextlib.contextmanager
    def _reading(self) -> Iterator[None]:
        """Say of whatever does not fit together that the checkpoint is damaged."""
        try:
            yield
        except (CheckpointError, OSError):
            raise
        except Exception as error:  # whatever a file can do to zipfile, json and NumPy
            raise CheckpointError(f"{self._checkpoint} is damaged ({error})") from None

    def clear(self) -> None:
        """Throw the checkpoint away."""
        self._checkpoint.unlink(missing_ok=True)
        self._spool.unlink(missing_ok=True)


def _split(state: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """Values that JSON knows, and arrays, of a state."""
    arrays = {name: value for name, value in state.items() if isinstance(value, np.ndarray)}
    return {name: value for name, value in state.items() if name not in arrays}, arrays
