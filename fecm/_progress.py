"""Lines about the progress, of which a log gets one a minute."""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic

MINUTE = 60.0  # seconds between two lines


def once_a_minute(clock: Callable[[], float] = monotonic) -> Callable[[], bool]:
    """Return a function that says whether a minute has passed since it last said so."""
    last = clock()

    def due() -> bool:
        nonlocal last
        if clock() - last < MINUTE:
            return False
        last = clock()
        return True

    return due
