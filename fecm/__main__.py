"""The command ``fecm``, also as ``python -m fecm``."""

from __future__ import annotations

import contextlib
import gc
import os
import signal
from types import FrameType
from typing import NoReturn


def _leave(number: int, frame: FrameType | None) -> None:
    """End the program during imports, when there is nothing to clean up."""
    os._exit(128 + number)


LEAST_SPACE = 600_000_000  # address space of NumPy and SciPy; with less, OpenBLAS may hang


def _refuse(message: str) -> NoReturn:
    """Print an error and end the program, without the command line's modules."""
    with contextlib.suppress(OSError):
        os.write(2, f"fecm: error: {message}\n".encode())
    os._exit(2)


def main() -> NoReturn:
    """Run the command line and exit with its status."""
    with contextlib.suppress(ValueError):  # only in the main thread
        signal.signal(signal.SIGINT, _leave)
        signal.signal(signal.SIGTERM, _leave)
    with contextlib.suppress(ImportError):  # Windows has no such limits
        import resource  # Unix only

        space = resource.getrlimit(resource.RLIMIT_AS)[0]
        if space < LEAST_SPACE and space != resource.RLIM_INFINITY:
            _refuse(
                f"the process may have {space / 1e6:.0f} MB of address space (ulimit -v), and "
                f"{LEAST_SPACE / 1e6:.0f} MB are needed"
            )
    # Matrix products are small; the threads of OpenBLAS would only wait for work, and busily.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    gc.set_threshold(100_000)  # modules and arrays make little garbage in cycles
    _run()


def _run() -> NoReturn:
    """Import the command line and run it."""
    try:
        from fecm.cli import main as run
    except (ImportError, MemoryError) as error:
        line = str(error).partition("\n")[0] or "there is not enough memory"
        _refuse(f"a part of the program can't be loaded: {line}")
    try:
        run()
    finally:
        gc.freeze()  # nothing is left to collect: the interpreter need not look for garbage at exit


if __name__ == "__main__":
    main()
