"""Processors that a computation may use, and those that other work leaves free."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

LOADS = Path("/proc/loadavg")  # proc(5), on Linux


def available() -> int:
    """Processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def free() -> int:
    """Processors that this process may use and other work leaves free, at least 1."""
    return max(1, min(available(), round((os.cpu_count() or 1) - _busy())))


def _busy() -> float:
    """Processors that other work uses: the load of the last minute, or less if less runs now.

    The load contains work that has just ended, such as an earlier run.  It is 0 where the system
    does not tell it.
    """
    try:
        load = os.getloadavg()[0]
    except (AttributeError, OSError):
        return 0.0
    with suppress(OSError, ValueError, IndexError):
        running, _, _ = LOADS.read_text(encoding="ascii").split()[3].partition("/")
        load = min(load, float(running) - 1.0)  # without this process
    return load
