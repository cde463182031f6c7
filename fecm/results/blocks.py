"""Blocks of rows, in which datasets are read that may be larger than the memory."""

from __future__ import annotations

import math
from collections.abc import Iterator

BLOCK = 4_000_000  # bytes


def row_blocks(shape: tuple[int, ...]) -> Iterator[tuple[int, int]]:
    """First and last + 1 row of the blocks in which a dataset is read; a number is one row."""
    rows = shape[0] if shape else 1
    step = max(1, BLOCK // (8 * max(1, math.prod(shape[1:]))))
    for start in range(0, rows, step):
        yield start, min(start + step, rows)
