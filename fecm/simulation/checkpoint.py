"""Checkpoints: the complete state of a run, stored beside its result.

A checkpoint is two files. The checkpoint file holds the state. It is written under another name,
synced and renamed. The spool holds the operations on the result file so far. Each operation is a
line of JSON, followed by the bytes of its rows, if it has any. The spool only grows, and repeating
its operations gives a result file of the same bytes.

A checkpoint names its part of the spool by length and checksum. The last checkpoint is therefore
valid however a run ends. A resumed run gives the same bytes as an uninterrupted one.
"""

from __future__ import annotations

import contextlib
import os
import time
import zlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np

from fecm._errors import FecmError
from fecm._files import beside, naming, open_ordinary, packed, sync
from fecm._typing import Array
from fecm._version import __version__
from fecm.mechanics import kernels
from fecm.mechanics.own_law import law_name
from fecm.mechanics.stiffness_product import KERNELS
from fecm.problem.problem import Problem
from fecm.results.hdf5_writer import FileSink
from fecm.results.schema import dataset_of
from fecm.results.sinks import Operation
from fecm.simulation.simulation import Simulation

FORMAT = 7
OTHER_FORMAT = "another kind of checkpoint"
SOLVER = "another solver"
STARTS_OVER = "overwrite=True without resume=True discards the checkpoint and starts over"
CHUNK = 1_000_000  # bytes read at once when a spool is checked


class CheckpointError(FecmError, ValueError):
    """A checkpoint, or its spool, can't be used."""


class SpoolPart(NamedTuple):
    """Part of a spool that a checkpoint names."""

    length: int = 0  # bytes
    checksum: int = 0  # their CRC


def checkpoint_of(result: Path) -> Path:
    """Return the path of a result's checkpoint."""
    return result.with_name(f"{result.name}.checkpoint")


def spool_of(result: Path) -> Path:
    """Return the path of a result's spool."""
    return result.with_name(f"{result.name}.spool")


def files_of(result: Path) -> tuple[Path, Path]:
    """Return the paths of a result's checkpoint and spool."""
    return checkpoint_of(result), spool_of(result)


def interrupted(paths: Sequence[Path], *, resume: bool, overwrite: bool) -> int | None:
    """Return the index of the result whose interrupted run is to be resumed, or None.

    Raises CheckpointError if there is no checkpoint to resume from, or if a checkpoint is neither
    resumed nor overwritten.
    """
    stopped = [place for place, path in enumerate(paths) if checkpoint_of(path).exists()]
    if resume and not stopped:
        raise CheckpointError(f"there is no checkpoint {checkpoint_of(paths[0])} to resume from")
    if stopped and not (resume or overwrite):
        raise CheckpointError(
            f"{checkpoint_of(paths[stopped[0]])} belongs to an interrupted run: resume=True "
            "continues it, overwrite=True starts over"
        )
    return stopped[0] if resume else None


@contextlib.contextmanager
def resuming(result: Path) -> Iterator[None]:
    """Say in a CheckpointError how to start over.

    Any other error comes from a forged checkpoint and becomes a CheckpointError.
    """
    try:
        yield
    except CheckpointError as error:
        raise CheckpointError(f"{error}; {STARTS_OVER}") from None
    except (FecmError, MemoryError):
        raise
    except Exception as error:
        # h5py's own errors are OSErrors without a number.
        if isinstance(error, OSError) and (error.errno or type(error) is not OSError):
            raise
        text = f"the run can't resume from {checkpoint_of(result)} ({error})"
        raise CheckpointError(f"{text}; {STARTS_OVER}") from None


def identity(simulation: Simulation) -> dict[str, Any]:
    """Return the properties that must match between a run and its checkpoint.

    The keys are the messages for a mismatch.
    """
    options = simulation.options
    return {
        OTHER_FORMAT: FORMAT,
        "another version of fecm": __version__,
        "another deck": _deck_hash(simulation.problem),
        "another mode or other slips": sorted(options.slips),
        "a run with another choice of --extend": simulation.problem.work.steps,
        SOLVER: simulation.model.motion.solver,
        "another mass matrix or integrator of the rod": [
            options.rod_method.mass,
            options.rod_method.integrator,
        ],
        "a run with another contact law": None if options.law is None else law_name(options.law),
        "a run with another projectile": (
            None if options.projectile is None else options.projectile.name
        ),
        "a run with other failure criteria": [criterion.name for criterion in options.criteria]
        or None,
        "a run with another choice of --print": simulation.printer.is_on,
    }


def _deck_hash(problem: Problem) -> str:
    """Return the hash of the cards of a problem."""
    import hashlib  # 3 ms, and few runs have a checkpoint

    deck = problem.deck
    return hashlib.sha256((deck.text or deck.to_text()).encode()).hexdigest()


def fingerprint(problem: Problem, outputs: Sequence[Path]) -> str:
    """Return the hash of a problem's cards and outputs."""
    import hashlib  # 3 ms, and few decks have a second problem

    whole = hashlib.sha256(_deck_hash(problem).encode())
    for path in outputs:
        with path.open("rb") as file:
            whole.update(hashlib.file_digest(file, "sha256").digest())
    return whole.hexdigest()


def finished_before(result: Path) -> list[str]:
    """Return the fingerprints of the problems that finished before the interrupted one.

    Raises CheckpointError if the checkpoint of `result` can't be used, OSError if it can't be read.
    """
    path = checkpoint_of(result)
    with _reading(path):
        about, _ = _read(path)
        if about["identity"].get(OTHER_FORMAT) != FORMAT:
            raise CheckpointError(f"{path} belongs to {OTHER_FORMAT}")
        return [str(item) for item in about["finished"]]


def _difference(what: str, theirs: object, ours: object) -> str:
    """Describe how a checkpoint differs from the run, starting with a blank.

    The text is empty if the difference would not help.
    """
    if what == SOLVER and theirs == KERNELS and kernels.LIBRARY is None:
        return ", the compiled kernels, which this installation lacks"
    if what == SOLVER:
        return f" ({theirs}, not {ours}): --solver {theirs} continues it"
    return f" ({theirs}, not {ours})" if ours == __version__ else ""


class Checkpointer:
    """Writer and reader of the checkpoints of a run, beside the final path of its result.

    Rows are not kept in memory: they are read back from the result when they are spooled. A killed
    run may leave a spool without a checkpoint. It is removed; the lock of `sink` shows that no
    other run is writing it. `finished` has the fingerprints of the problems before this one.
    """

    def __init__(self, result: Path, sink: FileSink, finished: Sequence[str] = ()) -> None:
        self._finished = list(finished)
        self._checkpoint = checkpoint_of(result)
        self._spool = spool_of(result)
        self._sink = sink
        self._new = sink.operations = []
        self._spooled = SpoolPart()
        self._written = time.monotonic()
        if not self._checkpoint.exists():
            self._spool.unlink(missing_ok=True)

    @property
    def age(self) -> float:
        """Seconds since the last checkpoint, or since the start."""
        return time.monotonic() - self._written

    def write(self, simulation: Simulation) -> None:
        """Write a checkpoint.

        Raises OSError if it can't be written; the previous checkpoint then remains valid.
        """
        import json  # 2 ms

        flags = os.O_RDWR
        if not self._spooled.length:
            self._spool.unlink(missing_ok=True)
            flags |= os.O_CREAT | os.O_EXCL
        with naming(self._spool), open_ordinary(self._spool, flags) as file:
            spooled = self._append(file)
        state = simulation.save()
        arrays = {name: value for name, value in state.items() if isinstance(value, np.ndarray)}
        values = {name: value for name, value in state.items() if name not in arrays}
        about = {
            "identity": identity(simulation),
            "finished": self._finished,
            "spool": spooled._asdict(),
            "values": values,
        }
        try:
            text = np.frombuffer(json.dumps(about).encode(), np.uint8)
        except TypeError as error:  # in the memory of a user's law
            raise CheckpointError(
                f"{self._checkpoint} can't be written ({error}): a contact law remembers numbers, "
                "texts, None, arrays, or tuples of them"
            ) from None
        with beside(self._checkpoint, follow=False) as partial:
            partial.write_bytes(packed({"about": text, **arrays}))
        self._spooled = spooled
        self._new.clear()
        self._written = time.monotonic()

    def _append(self, file: BinaryIO) -> SpoolPart:
        """Append the new operations to the spool, sync it, and return its length and checksum.

        The next call overwrites the new operations unless a checkpoint names them.
        """
        import json  # 2 ms

        self._sink.check()
        length, checksum = self._spooled
        file.truncate(length)
        file.seek(length)
        for entry in self._new:
            about = entry
            rows = np.empty(0)
            if entry["do"] == Operation.WRITE:
                stop = entry["start"] + entry["rows"]
                rows = np.ascontiguousarray(self._sink.arrays[entry["path"]][entry["start"] : stop])
                about = {**entry, "dtype": rows.dtype.str, "shape": rows.shape}
            # With NumPy's numbers and arrays as Python's.
            line = json.dumps(about, default=lambda value: value.tolist()).encode() + b"\n"
            for data in (line, rows.data):
                file.write(data)
                checksum = zlib.crc32(data, checksum)
        file.flush()
        sync(file.fileno())
        return SpoolPart(file.tell(), checksum)

    def restore(self, simulation: Simulation) -> None:
        """Restore a new simulation and its result to the state of the checkpoint.

        Raises CheckpointError if the checkpoint or the spool is missing, damaged, or belongs to
        another run. Raises OSError if they can't be read or the result can't be written.
        """
        with _reading(self._checkpoint):
            about, arrays = _read(self._checkpoint)
            theirs = about["identity"]
            for what, value in identity(simulation).items():
                if theirs.get(what) != value:
                    which = _difference(what, theirs.get(what), value)
                    raise CheckpointError(f"{self._checkpoint} belongs to {what}{which}")
            spooled = SpoolPart(about["spool"]["length"], about["spool"]["checksum"])
        with naming(self._spool), open_ordinary(self._spool) as file:
            self._replay(file, spooled)
        self._spooled = spooled
        self._new.clear()
        with _reading(self._checkpoint):
            simulation.restore({**about["values"], **arrays})

    def _replay(self, file: BinaryIO, part: SpoolPart) -> None:
        """Repeat the operations in the first part of a spool on the result."""
        import json  # 2 ms

        checksum = 0
        remaining = part.length
        while remaining > 0 and (data := file.read(min(remaining, CHUNK))):
            checksum = zlib.crc32(data, checksum)
            remaining -= len(data)
        if checksum != part.checksum:
            raise CheckpointError(f"{self._spool} is damaged, or was written by another run")
        file.seek(0)
        while file.tell() < part.length:
            try:
                self._repeat(json.loads(file.readline()), file)
            except Exception as error:  # a damaged file raises anything in json, NumPy and h5py
                self._sink.check()
                raise CheckpointError(f"{self._spool} is damaged ({error})") from None

    def _repeat(self, entry: dict[str, Any], file: BinaryIO) -> None:
        """Repeat one operation."""
        match Operation(entry["do"]):
            case Operation.ATTRIBUTES:
                self._sink.attributes(entry["group"], entry["values"])
            case Operation.CREATE:
                shape = tuple(entry["shape"])
                dataset = dataset_of(entry["path"], len(shape))
                if dataset is None:
                    raise CheckpointError(f"{self._spool} has an unknown dataset {entry['path']}")
                self._sink.create(dataset, shape, grows=entry["grows"])
            case Operation.TEXT:
                self._sink.deck(entry["value"])
            case Operation.WRITE:
                dtype = np.dtype(entry["dtype"])
                shape = tuple(entry["shape"])
                data = file.read(int(np.prod(shape)) * dtype.itemsize)
                rows = np.frombuffer(data, dtype).reshape(shape)
                self._sink.write(entry["path"], entry["start"], rows)

    def clear(self) -> None:
        """Delete the checkpoint."""
        self._checkpoint.unlink(missing_ok=True)
        self._spool.unlink(missing_ok=True)


def _read(path: Path) -> tuple[dict[str, Any], dict[str, Array]]:
    """Read the JSON values and the arrays of a checkpoint."""
    import json  # 2 ms
    import zipfile  # 10 ms

    if not path.exists():
        raise CheckpointError(f"there is no checkpoint {path}")
    with (
        naming(path),
        open_ordinary(path) as file,
        np.load(file, allow_pickle=False) as stored,
    ):
        if any(member.compress_type != zipfile.ZIP_STORED for member in stored.zip.infolist()):
            raise ValueError("it is compressed")
        arrays = {name: stored[name] for name in stored.files}
    return json.loads(arrays.pop("about").tobytes()), arrays


@contextlib.contextmanager
def _reading(path: Path) -> Iterator[None]:
    """Turn any error in the content of a checkpoint into a CheckpointError."""
    try:
        yield
    except (CheckpointError, OSError):
        raise
    except Exception as error:  # a damaged file raises anything in zipfile, json and NumPy
        raise CheckpointError(f"{path} is damaged ({error})") from None
