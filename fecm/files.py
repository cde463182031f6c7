"""Files that are whole or not there: written beside their final name and renamed."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path


@contextlib.contextmanager
def beside(path: Path) -> Iterator[Path]:
    """Give the path of a partial file that takes the final name if the block ends well.

    It has the final name's suffix, by which some writers choose their format.

    Raises
    ------
    OSError
        If the file can't be written; what stood under the final name is then untouched.
    """
    partial = path.with_name(f".{path.stem}.{os.getpid()}.partial{path.suffix}")
    try:
        yield partial
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)
