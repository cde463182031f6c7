"""Free memory and processors, as the operating system reports them."""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from fecm._errors import FecmError

MEMINFO = Path("/proc/meminfo")
CGROUP = Path("/proc/self/cgroup")
CGROUPS = Path("/sys/fs/cgroup")
UNNOTICED = 100_000_000  # bytes that are allocated without a check


class NotEnoughMemoryError(MemoryError, FecmError):
    """A computation needs more memory than is free; the message contains both numbers."""


def available_memory() -> int | None:
    """Return the bytes that can be allocated without swapping; None if they are not known.

    This is the smallest of the free memory of the machine and the remainders of the limits of its
    control groups, such as a container or a batch job (memory.max, cgroups(7)). The free memory of
    the machine is MemAvailable of proc(5) on Linux, and elsewhere the value of psutil, if it is
    installed.
    """
    counts = [count for count in (_of_machine(), *_of_groups()) if count is not None]
    return max(0, min(counts)) if counts else None


def require_memory(count: int, what: str) -> None:
    """Refuse to allocate more memory than is free."""
    if count >= UNNOTICED and (free := available_memory()) is not None and count > free:
        raise NotEnoughMemoryError(_shortage(what, count, free))


def check_available_memory(
    what: str, needed: Callable[[bool], int], remedy: Callable[[int], str]
) -> None:
    """Refuse a computation that needs more memory than is free.

    `needed` returns bytes: a quick bound for False, the best estimate for True. `remedy` is advice.
    """
    free = available_memory()
    if free is not None and needed(False) > free and (count := needed(True)) > free:
        raise NotEnoughMemoryError(f"{_shortage(what, count, free)}; {remedy(free)}")


def _shortage(what: str, count: int, free: int) -> str:
    needed, remaining = format_bytes(count), format_bytes(free)
    return f"{what} takes about {needed} of memory, and {remaining} are free"


def _of_machine() -> int | None:
    with suppress(OSError, ValueError, IndexError):
        for line in MEMINFO.read_text().splitlines():
            if line.startswith("MemAvailable:"):
                return 1024 * int(line.split()[1])
    with suppress(ImportError):
        import psutil

        return int(psutil.virtual_memory().available)
    return None


def _of_groups() -> list[int]:
    """Yield the remaining bytes of the control groups of the process."""
    remaining: list[int] = []
    with suppress(OSError, ValueError, IndexError):
        (group,) = [line[3:] for line in CGROUP.read_text().splitlines() if line.startswith("0::")]
        folder = CGROUPS / group.strip("/")
        while folder != CGROUPS.parent:
            with suppress(OSError, ValueError):
                most = int((folder / "memory.max").read_text())  # "max" is not a number
                remaining.append(most - int((folder / "memory.current").read_text()))
            folder = folder.parent
    return remaining


def format_bytes(count: float) -> str:
    """Format a number of bytes with a unit."""
    for unit, size in (("TB", 1e12), ("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if (rounded := float(f"{count / size:.3g}")) >= 1.0:
            return f"{rounded:,.15g} {unit}"
    return f"{count:g} bytes"


LOADS = Path("/proc/loadavg")  # proc(5), on Linux


def available_processors() -> int:
    """Return the number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def free_processors() -> int:
    """Return the number of processors that this process may use and other work leaves free.

    It is at least 1.
    """
    return max(1, min(available_processors(), round((os.cpu_count() or 1) - _busy())))


def _busy() -> float:
    """Return the number of processors that other work uses.

    This is the load of the last minute, or the number of running processes if that is less, as the
    load contains work that has just ended. It is 0 where the system does not report it.
    """
    try:
        load = os.getloadavg()[0]
    except (AttributeError, OSError):
        return 0.0
    with suppress(OSError, ValueError, IndexError):
        running, _, _ = LOADS.read_text(encoding="ascii").split()[3].partition("/")
        load = min(load, float(running) - 1.0)  # without this process
    return load
