"""Exposures of FAIL in words, and whether they reach 1."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from enum import StrEnum
from typing import NamedTuple, Protocol

from fecm._text import significant
from fecm.judge.criteria import failure_in_words, plies_in_words, where
from fecm.judge.end import ENDS, End
from fecm.judge.exposure_bands import is_bounded, may_decide_otherwise

LOWER_BOUNDS = "the run ends in contact: exposures are lower bounds"
FINER_MESHES_DECIDE = "open, as finer meshes may decide otherwise"


class FailurePoint(Protocol):
    """Mode of a criterion in a ply or an interface, at a place."""

    @property
    def criterion(self) -> str:
        """Name of the criterion."""

    @property
    def mode(self) -> str:
        """Name of its mode."""

    @property
    def where(self) -> str:
        """The ply, or the interface, in words."""

    @property
    def x(self) -> float:
        """Place."""

    @property
    def y(self) -> float:
        """Place."""


def point_in_words(point: FailurePoint) -> str:
    """Name mode, criterion, ply or interface, and place."""
    words = failure_in_words(point.criterion, point.mode, point.where)
    return f"{words} at ({significant(point.x)}, {significant(point.y)})"


def finer_meshes(band: tuple[float, float], shown: Callable[[float], str]) -> str:
    """Say which values finer meshes may give; `shown` formats one.

    Examples
    --------
    >>> finer_meshes((0.9, 1.1), "{:.3g}".format), finer_meshes((0.0, math.inf), str)
    ('finer meshes 0.9 to 1.1', 'finer meshes not bounded')
    """
    if not is_bounded(band):
        return "finer meshes not bounded"
    low, high = band
    return f"finer meshes {shown(low)} {f'to {shown(high)}' if math.isfinite(high) else 'or more'}"


class LargestExposure(NamedTuple):
    """Largest exposure of a criterion outside the load and on the circle around it."""

    criterion: str
    exposure: float
    mode: str
    ply: int  # from 1 at the struck face; of an interface the ply above it
    x: float
    y: float
    time: float
    mirrors: int = 0  # other points that have the same exposure
    # Lowest and highest exposure that finer meshes may give, (0, inf) where the mesh does not
    # bound it; None without a load.
    band: tuple[float, float] | None = None
    # With CURE; None without it.
    at_rest: float | None = None  # largest exposure of the residual stresses alone
    # Factor on all other stresses at the place at which the exposure is 1.
    load_factor: float | None = None
    # Names of the material of the ply, or of both plies; empty if the deck has one material.
    materials: tuple[str, ...] = ()

    @property
    def plies(self) -> str:
        """The ply, or the plies of the interface, in words."""
        return plies_in_words(self.criterion, self.ply, self.materials)

    @property
    def where(self) -> str:
        """The ply, or the interface, in words."""
        return where(self.criterion, self.ply, self.materials)

    @property
    def is_open(self) -> bool:
        """Whether finer meshes may decide otherwise whether the exposure reaches 1."""
        return self.band is not None and may_decide_otherwise(self.exposure, self.band)


class FailureVerdict(StrEnum):
    """Whether an exposure reaches 1, as far as the mesh decides it."""

    REACHED = "reached"
    NOT_REACHED = "not reached"
    OPEN = "open"


def failure_verdict(largest: Sequence[LargestExposure]) -> FailureVerdict:
    """Judge whether any of the largest exposures reaches 1 on every, no, or some finer mesh."""
    if any(exposure.exposure >= 1.0 and not exposure.is_open for exposure in largest):
        return FailureVerdict.REACHED
    return (
        FailureVerdict.OPEN
        if any(exposure.is_open for exposure in largest)
        else FailureVerdict.NOT_REACHED
    )


def band_of_largest(largest: Sequence[LargestExposure]) -> tuple[float, float]:
    """Return the lowest and the highest value that finer meshes may give the largest exposure.

    They are 0 and infinite where the mesh does not bound it. Both are NaN where they are not known.
    """
    bands = [exposure.band for exposure in largest if exposure.band is not None]
    if not bands or len(bands) < len(largest):
        return math.nan, math.nan
    low, high = (max(ends) for ends in zip(*bands, strict=True))
    return low, high


def no_failure(largest: Sequence[LargestExposure], end: End | None) -> str:
    """Say that no exposure reaches 1, and what may decide otherwise.

    Examples
    --------
    >>> no_failure([], End.OVER), no_failure([], End.RISING)
    ('none', 'none by the end of the run, which is in contact: open')
    """
    brief = "" if end is None else ENDS[end].brief
    ends = f" by the end of the run, which is {brief}: open" if brief else ""
    return f"{on_this_mesh(largest)}none{ends}"


def on_this_mesh(largest: Sequence[LargestExposure]) -> str:
    """Return the words before the first failure on a mesh that does not decide it, else none."""
    is_open = failure_verdict(largest) is FailureVerdict.OPEN
    return f"{FINER_MESHES_DECIDE}; on this mesh " if is_open else ""
