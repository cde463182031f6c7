"""A plugin that takes from Python what it lacks on Windows: ``pytest -p tests.without_posix``.

Test modules must be importable then, and tests that need more have the marker `posix`, `links` or
`linux`.
"""

from __future__ import annotations

import errno
import os
import pathlib
import signal
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from typing import Any, NoReturn

MODULES = "fcntl grp pty pwd resource termios"
NAMES = {
    os: "fork forkpty mkfifo mknod",
    signal: "ITIMER_REAL SIGALRM SIGHUP SIGKILL SIGPROF alarm setitimer",
}
# They look for these names when they are imported, and have another way on Windows.
OTHERS = "distributed h5py matplotlib.pyplot multiprocessing.pool pandas xarray"


def _refuse(*arguments: object, **options: object) -> NoReturn:
    raise OSError("not on Windows")


def _same(handle: pathlib.Path, path: Any) -> bool:
    with suppress(OSError, TypeError):
        return os.path.samestat(handle.stat(), os.lstat(path))
    return False


def of_closed_files(plain: Callable[..., None]) -> Callable[..., None]:
    """A function of `os` that refuses to remove or rename what this process has open."""

    def change(*paths: Any, **options: Any) -> None:
        for path in paths:
            if any(_same(handle, path) for handle in pathlib.Path("/proc/self/fd").iterdir()):
                raise PermissionError(errno.EACCES, "the file is open", str(path))
        plain(*paths, **options)

    return change


class _Popen(subprocess.Popen[Any]):
    """Processes without shell, and without a signal but that to end."""

    def __init__(self, arguments: Any, *others: Any, **options: Any) -> None:
        if options.get("preexec_fn") or options.get("shell") or arguments[0] in ("bash", "sh"):
            _refuse()
        super().__init__(arguments, *others, **options)

    def kill(self) -> None:
        self.terminate()

    def send_signal(self, number: int) -> None:
        if number != signal.SIGTERM:
            raise ValueError(f"Unsupported signal: {number}")
        super().send_signal(number)


def pytest_configure() -> None:
    """Take away what Windows lacks; pytest and its plugins are imported."""
    for name in OTHERS.split():
        with suppress(ImportError):
            import_module(name)
    for module, names in NAMES.items():
        for name in names.split():
            delattr(module, name)
    sys.modules.update(dict.fromkeys(MODULES.split()))  # type: ignore[arg-type]
    os.kill = os.symlink = _refuse
    for name in ("remove", "rename", "replace", "unlink"):
        setattr(os, name, of_closed_files(getattr(os, name)))
    import_module("fecm._files").OPEN_FILES_STAY = True  # type: ignore[attr-defined]
    pathlib.Path.symlink_to = _refuse  # type: ignore[method-assign]
    subprocess.Popen = _Popen  # type: ignore[assignment,misc]
