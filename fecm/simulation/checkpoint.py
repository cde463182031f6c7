"""Checkpoints: the complete state of a run, stored beside its result.

There are two files.  The checkpoint holds the state; it is written under another name, synced and
renamed.  The spool holds everything stored so far and only grows.  A checkpoint names its part of
the spool by length and checksum, so that the last checkpoint is valid however a run ends.  A
resumed run gives the same bytes as an uninterrupted one.
"""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fecm._files import beside, naming, open_ordinary, packed
from fecm._version import __version__
from fecm.simulation.simulation import Simulation
from fecm.simulation.spool import CheckpointError, Journal, Part

FORMAT = 2


def checkpoint_of(result: Path) -> Path:
    """Path of a result's checkpoint."""
    return result.with_name(f"{result.name}.checkpoint")


def spool_of(result: Path) -> Path:
    """Path of a result's spool."""
    return result.with_name(f"{result.name}.spool")


def identity(simulation: Simulation) -> dict[str, Any]:
    """Properties that a run and its checkpoint must have in common."""
    import hashlib

    deck, options = simulation.problem.deck, simulation.options
    text = deck.text or deck.to_text()
    return {
        "format": FORMAT,
        "version": __version__,
        "deck": hashlib.sha256(text.encode()).hexdigest(),
        "slips": sorted(options.slips),
        "solver": simulation.model.motion.solver,
        "rod": [options.rod_method.mass, options.rod_method.integrator],
        "printed": simulation.printer.is_on,
    }


# Messages if they differ.
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
    """Writes and reads the checkpoints of a run, beside the final path of its result."""

    def __init__(self, result: Path, journal: Journal) -> None:
        self._checkpoint, self._spool = checkpoint_of(result), spool_of(result)
        self._journal = journal
        self._written = time.monotonic()

    @property
    def age(self) -> float:
        """Seconds since the last checkpoint, or since the start."""
        return time.monotonic() - self._written

    def write(self, simulation: Simulation) -> None:
        """Write a checkpoint.

        Raises OSError if it can't be written; the previous checkpoint then remains valid.
        """
        import json

        flags = os.O_RDWR
        if not self._journal.spooled.length:
            self._spool.unlink(missing_ok=True)
            flags |= os.O_CREAT | os.O_EXCL
        with naming(self._spool), open_ordinary(self._spool, flags) as spool:
            part = self._journal.spool(spool)
        state = simulation.save()
        arrays = {name: value for name, value in state.items() if isinstance(value, np.ndarray)}
        values = {name: value for name, value in state.items() if name not in arrays}
        about = {"identity": identity(simulation), "spool": vars(part), "values": values}
        text = np.frombuffer(json.dumps(about).encode(), np.uint8)
        with beside(self._checkpoint, follow=False) as partial:
            partial.write_bytes(packed({"about": text, **arrays}))
        self._journal.keep(part)
        self._written = time.monotonic()

    def restore(self, simulation: Simulation) -> None:
        """Set a new simulation and its result to the state of the checkpoint.

        Raises CheckpointError if the checkpoint is missing, damaged, or belongs to another run.
        Raises OSError if it can't be read.
        """
        with self._reading():
            about, arrays = self._read()
            theirs, ours = about["identity"], identity(simulation)
            for name, value in ours.items():
                if theirs.get(name) != value:
                    which = f" ({theirs['version']}, not {value})" if name == "version" else ""
                    raise CheckpointError(f"{self._checkpoint} belongs to {_NAMES[name]}{which}")
            part = Part(**about["spool"])
        self._journal.replay(self._spool, part)
        with self._reading():
            simulation.restore({**about["values"], **arrays})

    def _read(self) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
        """JSON values and arrays of the checkpoint."""
        import json
        import zipfile

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
        """Turn any error in the content into a CheckpointError."""
        try:
            yield
        except (CheckpointError, OSError):
            raise
        except Exception as error:  # a damaged file raises anything in zipfile, json and NumPy
            raise CheckpointError(f"{self._checkpoint} is damaged ({error})") from None

    def clear(self) -> None:
        """Delete the checkpoint."""
        self._checkpoint.unlink(missing_ok=True)
        self._spool.unlink(missing_ok=True)
