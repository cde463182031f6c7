"""The interface of the product K u, whose result is processed in pieces that fit the cache."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import TypeVar

import numpy as np

from fecm._typing import Floats

R = TypeVar("R")

# Equations per piece: BLAS sums vectors of this length in one thread.
PIECE = 8192


def pieces(neq: int) -> list[slice]:
    """Slices of the equations."""
    return [slice(i, min(i + PIECE, neq)) for i in range(0, neq, PIECE)]


class StiffnessOperator(ABC):
    """The internal forces of a displacement."""

    # Entries of a padded vector.
    size: int

    @abstractmethod
    def each(self, padded: Floats, use: Callable[[int, Floats], R]) -> list[R]:
        """Compute K u and apply a function to the number and forces of each piece, in order.

        The padded vector, (size,), starts with the displacement and ends with a zero.
        """

    def __call__(self, displacement: Floats) -> Floats:
        """K u, (neq,)."""
        padded = np.zeros(self.size)
        padded[: len(displacement)] = displacement
        return np.concatenate(self.each(padded, lambda _, forces: forces.copy()))
