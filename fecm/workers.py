"""Threads that share the work of one step; what comes out does not depend on their number."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

T = TypeVar("T")
R = TypeVar("R")


def available() -> int:
    """Cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class Workers:
    """A few threads, the caller's own among them.

    Parameters
    ----------
    count : int
        Number of threads; 1 starts none.

    Attributes
    ----------
    count : int
    """

    def __init__(self, count: int = 1) -> None:
        self.count = count
        self._pool = ThreadPoolExecutor(self.count - 1) if self.count > 1 else None

    def map(self, function: Callable[[T], R], items: Sequence[T]) -> list[R]:
        """Results of a function that lets other threads run, in the order of the items.

        Each thread takes ceil(items / count) items that follow one another.
        """
        if self._pool is None or len(items) < 2:
            return [function(item) for item in items]
        share = -(-len(items) // self.count)
        others = [
            self._pool.submit(_each, function, items[start : start + share])
            for start in range(share, len(items), share)
        ]
        results = _each(function, items[:share])
        for other in others:
            results += other.result()
        return results


def _each(function: Callable[[T], R], items: Sequence[T]) -> list[R]:
    return [function(item) for item in items]
