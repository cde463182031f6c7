"""Child processes that do not outlive their parent."""

from __future__ import annotations

import os
import signal
import sys

PR_SET_PDEATHSIG = 1  # prctl(2): signal of this process when its parent ends


def die_with_parent(parent: int) -> None:
    """Have Linux kill this process when its parent ends; do nothing on other systems.

    `parent` is its process id, taken before the fork: it may have ended since.
    """
    if sys.platform != "linux":
        return
    import ctypes

    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        os.kill(os.getpid(), signal.SIGKILL)
