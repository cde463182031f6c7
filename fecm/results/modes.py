"""Natural modes of a result: frequencies in Hz, and modes in the plane."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fecm._typing import Floats
from fecm.deck.units import in_si
from fecm.mechanics.interpolation import W
from fecm.results.result import Result

IN_PLANE = 1e-6  # w over u and v below which a mode is one in the plane


class Frequencies(NamedTuple):
    """Natural frequencies with their unit."""

    values: Floats  # (n,)
    unit: str  # Hz; 1/time in the deck's unit if it is not known, empty without one


def frequencies_of(result: Result) -> Frequencies:
    """Return the natural frequencies, in Hz if the time unit of the deck is known."""
    cycles = result["modes/angular_frequency"] / (2.0 * np.pi)
    second = in_si("time", result.units)
    if second is not None:
        return Frequencies(cycles / second, "Hz")
    return Frequencies(cycles, result.unit("modes/angular_frequency"))


def is_in_plane(shape: Floats) -> bool:
    """Return whether a mode, (numnp, 5), moves the plate in its plane only."""
    return bool(np.abs(shape[:, W]).max() <= IN_PLANE * np.abs(shape[:, :W]).max())
