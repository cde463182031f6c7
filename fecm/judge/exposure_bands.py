"""Bands of the largest exposures: the values that finer meshes may give.

Largest exposures lie at the circle of radius R = c + h/2 around the load, c being the radius of
the patch and h the thickness. Under a unit force the mesh changes the moment there by an amount
that depends on the side of the elements over R. The moment itself grows with ln(l/R), where l is
the length over which the load bends the plate. Bands are therefore wider on thick plates, under
short impacts and on strongly curved panels, where l/R is small.

The constants enclose the errors of 16 plates on 14 to 27 meshes each. Eleven other plates are the
test. docs/confidence.md has both sets, and benchmarks/exposure_bands.py computes them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from fecm.judge.criteria import INTERLAMINAR

RESOLVED = 2.6  # coarseness up to which the mesh resolves the load


class LoadMesh(NamedTuple):
    """What decides the error of the mesh in exposures at the load.

    Attributes
    ----------
    coarseness : float
        Longest side of the elements on the circle around the load, over the radius R of the circle.
    at_corner : bool
        Whether the load is at a corner of elements. Inside an element errors are larger.
    nine_nodes : bool
        Whether the elements on the circle have nine nodes. Other elements were not measured.
    bending_reach : float
        Length over which the load bends the plate, over R: the shortest of the distance between
        supports, half a bending wave of the contact, and sqrt(radius of curvature * h).
    anisotropy : float
        Fourth root of the larger over the smaller of D11 and D22, at least 1.
    """

    coarseness: float
    at_corner: bool
    nine_nodes: bool
    bending_reach: float
    anisotropy: float

    @classmethod
    def of_attributes(cls, attributes: Mapping[str, Any]) -> LoadMesh | None:
        """Return the record from the attributes of the circle; None without a circle.

        A file that lacks some of them has a mesh with unknown errors.
        """
        if "coarseness" not in attributes:
            return None
        unknown: dict[str, Any] = cls(math.inf, False, False, 1.0, 1.0)._asdict()
        values = {name: attributes.get(name, other) for name, other in unknown.items()}
        return cls(
            float(values["coarseness"]),
            bool(values["at_corner"]),
            bool(values["nine_nodes"]),
            float(values["bending_reach"]),
            float(values["anisotropy"]),
        )

    @property
    def is_measured(self) -> bool:
        """Whether the errors of such a mesh are known: mesh and plate are among the fitted."""
        limit = AT_CORNER.limit if self.at_corner else ELSEWHERE.limit
        return (
            self.nine_nodes
            and self.bending_reach >= LEAST_REACH
            and self.coarseness <= min(limit, self.bending_reach / LEAST_ELEMENTS)
        )

    @property
    def resolved(self) -> float:
        """Coarseness up to which a mesh resolves the load and the bending around it."""
        return min(RESOLVED, self.bending_reach / LEAST_ELEMENTS)


class _Errors(NamedTuple):
    """Largest errors of the fitted meshes with the load at one kind of place in the elements."""

    # Shares by which exposures are too high, by coarseness; of plies times the moment's share.
    coarseness: tuple[float, ...]
    plies_high: tuple[float, ...]
    interlaminar_high: tuple[float, ...]
    # Share by which interlaminar exposures are too low, times a power of the anisotropy.
    interlaminar_low: tuple[float, ...]
    # Share by which exposures of plies are too low, times the moment's share. It is `plies_low`
    # from the coarseness 1 on. From `lost_from` on it grows by `lost` times the logarithm, as the
    # elements are too large for the logarithm of the moment. The coarseness counts times the
    # anisotropy.
    plies_low: float
    lost_from: float
    lost: float

    @property
    def limit(self) -> float:
        """Largest coarseness at which the errors are known."""
        return self.coarseness[-1]


AT_CORNER = _Errors(
    coarseness=(0.4, 0.9, 1.5, 2.0, 2.6, 3.4, 4.4, 5.2),
    plies_high=(0.05, 0.15, 0.24, 0.24, 0.24, 0.24, 0.06, 0.06),
    interlaminar_high=(0.02, 0.04, 0.07, 0.07, 0.07, 0.07, 0.07, 0.07),
    interlaminar_low=(0.05, 0.08, 0.10, 0.15, 0.15, 0.17, 0.20, 0.20),
    plies_low=0.05,
    lost_from=2.6,
    lost=0.62,
)
ELSEWHERE = _Errors(
    coarseness=(0.4, 1.2, 1.5, 2.0, 2.6),
    plies_high=(0.12, 0.40, 0.62, 0.66, 0.80),
    interlaminar_high=(0.04, 0.06, 0.12, 0.12, 0.12),
    interlaminar_low=(0.05, 0.08, 0.10, 0.12, 0.15),
    plies_low=0.14,
    lost_from=2.4,
    lost=0.9,
)
LEAST_REACH = 8.0  # smallest l/R of the plates
LEAST_ELEMENTS = 4.0  # elements over l; fewer do not resolve the bending around the load
ANISOTROPY_POWER = 1.6
UNBOUNDED = (0.0, math.inf)
# Factor that decides whether an exposure without a band may reach 1. On the coarsest meshes of the
# 27 plates, of 3 x 3 elements, exposures are up to 2.7 times too low and 1.8 times too high.
FAR_FROM_1 = 10.0


def mesh_band(exposure: float, criterion: str, mesh: LoadMesh) -> tuple[float, float]:
    """Return the lowest and the highest exposure that finer meshes may give.

    They are 0 and infinite if the errors of such a mesh are not known.

    Parameters
    ----------
    exposure : float
        Largest exposure of this mesh.
    criterion : str
        Its criterion.
    mesh : LoadMesh
        Elements at the load.

    Examples
    --------
    >>> fine = LoadMesh(1.0, True, True, 30.0, 1.1)
    >>> [round(value, 3) for value in mesh_band(1.0, "puck", fine)]
    [0.946, 1.018]
    >>> mesh_band(1.0, "puck", fine._replace(coarseness=7.5))
    (0.0, inf)
    """
    if not mesh.is_measured:
        return UNBOUNDED
    errors = AT_CORNER if mesh.at_corner else ELSEWHERE

    def at(shares: tuple[float, ...]) -> float:
        return float(np.interp(mesh.coarseness, errors.coarseness, shares))

    if criterion == INTERLAMINAR:
        too_high = at(errors.interlaminar_high)
        too_low = at(errors.interlaminar_low) * mesh.anisotropy**ANISOTROPY_POWER
    else:
        share = 1.0 / (math.log(mesh.bending_reach) - 0.5)
        too_high = share * at(errors.plies_high)
        stretched = mesh.coarseness * mesh.anisotropy
        lost = errors.lost * math.log(max(stretched / errors.lost_from, 1.0))
        too_low = share * (errors.plies_low * min(stretched, 1.0) + lost)
    highest = exposure / (1.0 - too_low) if too_low < 1.0 else math.inf
    return exposure / (1.0 + too_high), highest


def is_bounded(band: tuple[float, float]) -> bool:
    """Return whether the mesh bounds an exposure, or what is computed from it."""
    return band != UNBOUNDED


def may_decide_otherwise(exposure: float, band: tuple[float, float]) -> bool:
    """Return whether finer meshes may decide otherwise whether an exposure reaches 1.

    Examples
    --------
    >>> may_decide_otherwise(1.02, (0.97, 1.04)), may_decide_otherwise(1.02, UNBOUNDED)
    (True, True)
    >>> may_decide_otherwise(0.05, UNBOUNDED)
    False
    """
    low, high = band if is_bounded(band) else (exposure / FAR_FROM_1, exposure * FAR_FROM_1)
    return low < 1.0 <= high


def coarse_mesh_note(mesh: LoadMesh, shown: Callable[[float], str]) -> str:
    """Say why finer meshes may change the exposures at the load much; `shown` formats a length/R.

    Examples
    --------
    >>> coarse_mesh_note(LoadMesh(1.0, True, False, 30.0, 1.1), "{:.3g} R".format)
    'exposures at the load are not bounded: the elements there do not have nine nodes; compare \
them with a finer mesh (fecm check --mesh-error)'
    """
    band = "have a wide band" if mesh.is_measured else "are not bounded"
    compare = "compare them with a finer mesh (fecm check --mesh-error)"
    radius = shown(1.0)
    if not mesh.nine_nodes:
        why = f"the elements there do not have nine nodes; {compare}"
    elif mesh.bending_reach < LEAST_REACH:
        why = (
            f"the load bends the plate over {shown(mesh.bending_reach)}, and c + h/2 is {radius}: "
            f"the plate is too thick for a band; {compare}"
        )
    else:
        where = "" if mesh.at_corner else ", and place a corner of elements at the load"
        why = (
            f"the elements there have sides of {shown(mesh.coarseness)}, and c + h/2 is {radius}; "
            f"refine the mesh at the load to sides of {shown(mesh.resolved)}{where}"
        )
    return f"exposures at the load {band}: {why}"
