"""Files that are whole or not there: written beside their final name and renamed."""

from __future__ import annotations

import contextlib
import io
import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any


def partial_of(path: Path) -> Path:
    """Where this process writes a file before it gets its name."""
    return path.with_name(f".{path.stem}.{os.getpid()}.partial{path.suffix}")


@contextlib.contextmanager
def beside(path: Path) -> Iterator[Path]:
    """Give the path of a partial file that takes the final name if the block ends well.

    It has the final name's suffix, by which some writers choose their format.

    Raises
    ------
    OSError
        If the file can't be written; what stood under the final name is then untouched.
    """
    partial = partial_of(path)
    try:
        yield partial
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


def packed(arrays: Mapping[str, Any]) -> memoryview:
    """Arrays as the bytes of an .npz file.

    They are put together in memory: where a disk is full, NumPy before version 2 leaves the archive
    open, which complains once more at the end of the program.
    """
    import numpy as np

    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getbuffer()


def clear_stale(*paths: Path) -> None:
    """Remove partial files that processes have left which are no more."""
    for path in paths:
        for partial in path.parent.glob(f".{path.stem}.*.partial{path.suffix}"):
            process = partial.name.removeprefix(f".{path.stem}.").partition(".")[0]
            if process.isdigit() and not _alive(int(process)):
                partial.unlink(missing_ok=True)


def _alive(process: int) -> bool:
    """Whether a process is still there, as far as this one may know."""
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True


def clear_partials_of(process: int, folders: Iterable[Path]) -> None:
    """Remove the partial files that a process which is no more has left in some folders."""
    for folder in folders:
        for partial in folder.glob(f".*.{process}.partial*"):
            with contextlib.suppress(OSError):
                partial.unlink()
