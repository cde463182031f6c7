"""Largest exposures over time, in the elements and on the circle around the load.

Exposures of plies are largest on this circle, r = R, and no point of an element lies on it.
Strains are interpolated in the elements; where elements meet, they are the mean of both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from fecm._typing import Bools, Floats, Indices
from fecm.mechanics.elements import Quadrature
from fecm.mechanics.failure import Codes
from fecm.mechanics.interpolation import interpolate
from fecm.mechanics.mesh import ElementBlock
from fecm.mechanics.ply_stresses import ElementZone, PlyStresses, Zones, strains_of
from fecm.mechanics.points import containing_elements
from fecm.mechanics.strains import FLAT, Curvature, strain_of_deflection

Numbers = NDArray[np.int64]
NOWHERE = -1  # number of the state of a criterion none of whose exposures counts
# Exposures that differ by less than this share are equal: rounding does not decide which is the
# largest, nor when.  kernels.c has it too.
TIE = 1.0e-9


@dataclass
class Maxima:
    """Largest exposure of every state so far, its time and mode."""

    exposure: Floats
    time: Floats
    mode: Codes  # index into :data:`~fecm.mechanics.failure.MODES`

    @classmethod
    def none(cls, *shape: int) -> Maxima:
        """No exposure yet."""
        return cls(np.zeros(shape), np.zeros(shape), np.zeros(shape, np.int8))


@dataclass
class Largest:
    """Largest exposure so far of each criterion, of those that count.

    The interlaminar criterion comes last.  Ties go to the lowest number.
    """

    exposure: Floats  # (criteria,); NaN where none counts
    state: Numbers  # (criteria,): number among the evaluated states, or the interfaces; or NOWHERE
    mode: Codes  # (criteria,)
    # (criteria, 6): midplane strains and curvatures at its point when it was reached.
    strain: Floats

    @classmethod
    def none(cls, count: int) -> Largest:
        """No exposure yet, of so many criteria."""
        states = np.full(count, NOWHERE, dtype=np.int64)
        return cls(np.full(count, np.nan), states, np.zeros(count, np.int8), np.zeros((count, 6)))


@dataclass
class FailureEnvelope:
    """Largest exposures over time, in arrays that are changed in place."""

    # (criteria, states): states are points and those that a monitor evaluates at each; UNKNOWN of
    # plies without strengths or that an element lacks, and of those that a criterion is not
    # evaluated for.
    plies: Maxima
    # (elements, plies - 1); NaN where there is none, or no strength, or an element lacks nodes.
    interfaces: Maxima
    largest: Largest
    # Structures of the kernels that point to these arrays; no checkpoint has it.
    kept: object = field(default=None, init=False, repr=False, compare=False)
    # Exposures on the circle around the load; None without a load.
    circle: FailureEnvelope | None = None

    def find_largest(self, counts: Bools, far: Bools, strains: Floats | None = None) -> None:
        """Find the largest exposures of the points, (elements, points), and elements that count.

        The strains, (elements, points, 6), are those of the exposures that have just risen.
        """
        largest, plies = self.largest, self.plies
        of_point = plies.exposure.shape[1] // counts.size
        for number, state in enumerate(_of_plies(plies.exposure, counts).tolist()):
            exposure = np.nan if state == NOWHERE else plies.exposure[number, state]
            risen = exposure > largest.exposure[number] or state != largest.state[number]
            if strains is not None and risen:
                largest.strain[number] = strains.reshape(-1, 6)[state // of_point]
            largest.exposure[number], largest.state[number] = exposure, state
            largest.mode[number] = 0 if state == NOWHERE else plies.mode[number, state]
        between = self.interfaces
        largest.state[-1] = state = _of_interfaces(between.exposure, far)
        largest.exposure[-1] = np.nan if state == NOWHERE else between.exposure.flat[state]
        largest.mode[-1] = 0 if state == NOWHERE else between.mode.flat[state]


def _of_plies(exposure: Floats, counts: Bools) -> Indices:
    """State of the largest exposure of each criterion, (criteria,), of points that count."""
    at = counts.ravel()
    if not at.any():
        return np.full(len(exposure), NOWHERE)
    of_point = exposure.reshape(len(exposure), at.size, -1)
    points = first_of_largest(np.where(at, of_point.max(axis=2), -np.inf))
    criteria = np.arange(len(exposure))
    states = first_of_largest(of_point[criteria, points])
    found = points * of_point.shape[2] + states
    # Below 0 where no ply has strengths.
    return np.where(exposure[criteria, found] < 0.0, NOWHERE, found)


def _of_interfaces(exposure: Floats, far: Bools) -> int:
    """Number of the interface with the largest exposure, of elements that count."""
    known = np.where(far[:, None] & np.isfinite(exposure), exposure, -1.0)
    if not (known >= 0.0).any():
        return NOWHERE
    return int(first_of_largest(known.ravel()))


def first_of_largest(exposures: Floats) -> Indices:
    """Position along the last axis of the first exposure that is the largest, but for a tie."""
    largest = exposures.max(axis=-1, keepdims=True)
    return np.asarray((exposures >= largest - TIE * np.abs(largest)).argmax(axis=-1))


class Evaluations(NamedTuple):
    """Largest exposures that count after each of some evaluations; see :class:`Largest`."""

    # (evaluations, criteria) each.
    exposure: Floats
    state: Numbers
    mode: Codes

    @classmethod
    def of(cls, rows: Sequence[Largest]) -> Self:
        """Those of some evaluations."""
        return cls(
            np.array([row.exposure for row in rows]),
            np.array([row.state for row in rows]),
            np.array([row.mode for row in rows]),
        )


@dataclass(frozen=True)
class PlyPoints:
    """Coordinates of the points of the plies, (elements, points)."""

    x: Floats
    y: Floats

    @cached_property
    def centres(self) -> tuple[Floats, Floats]:
        """Means of the points of each element, (elements,): x and y."""
        return self.x.mean(axis=1), self.y.mean(axis=1)


ANGLES = 48  # points of a whole circle, from the x-axis on


class CircleStresses(PlyStresses):
    """Stresses of plies at the points of a circle, each of which counts as an element of one point.

    Parameters
    ----------
    families : sequence of ElementBlock
        The elements of the plate.
    centre : tuple of float
        Place of the load, length.
    radius : float
        Radius R of the circle, length.  Points beyond the edge of the plate are left out.
    laminates : Zones
        Laminates with the rows of their elements.
    initial, curvature, nonlinear, stretches
        As in :class:`~fecm.mechanics.ply_stresses.PlyStresses`.
    """

    def __init__(
        self,
        families: Sequence[ElementBlock],
        centre: tuple[float, float],
        radius: float,
        laminates: Zones,
        initial: Floats | None = None,
        *,
        curvature: Curvature = FLAT,
        nonlinear: bool = False,
        stretches: bool = True,
    ) -> None:
        angles = np.arange(ANGLES) * (2.0 * np.pi / ANGLES)
        points = np.array(centre) + radius * np.column_stack([np.cos(angles), np.sin(angles)])
        entries = [
            (int(number), int(family.rows[member]), family.take(np.array([member])), xi)
            for family in families
            for member, number, xi in zip(*containing_elements(family, points), strict=True)
        ]
        on_plate = np.unique([entry[0] for entry in entries]).astype(np.intp)
        self.points = points[on_plate]  # (n, 2)
        self.elements = np.unique([entry[1] for entry in entries]).astype(np.intp)  # on the circle
        # Shape functions and their slopes of the elements that have a point, filled with zeros.
        most = max((element.nodes.shape[1] for _, _, element, _ in entries), default=1)
        self._nodes = np.zeros((len(entries), most), dtype=np.intp)
        self._shapes = np.zeros((len(entries), 3, most))
        self._means = np.zeros((len(on_plate), len(entries)))
        rows = np.zeros(len(on_plate), dtype=np.intp)  # of an element with each point
        for entry, (number, row, element, xi) in enumerate(entries):
            at = interpolate(element, Quadrature(xi[:1], xi[1:], np.ones(1)))
            count = element.nodes.shape[1]
            self._nodes[entry, :count] = element.nodes[0]
            self._shapes[entry, 0, :count] = at.N[0]
            self._shapes[entry, 1:, :count] = at.dN[0, 0]
            point = np.searchsorted(on_plate, number)
            self._means[point, entry] = 1.0
            rows[point] = row
        self._means /= self._means.sum(axis=1, keepdims=True)
        self.zones = [
            ElementZone.of(laminate, _points_in(rows, members)) for laminate, members in laminates
        ]
        self.shape = (len(on_plate), 1, max(zone.plies for zone in self.zones))
        self.initial, self.curvature, self.nonlinear = initial, curvature, nonlinear
        self.stretches = stretches

    @property
    def families(self) -> list[tuple[ElementBlock, bool]]:
        """No elements of its own."""
        return []

    def strains(self, field: Floats) -> tuple[Floats, Floats]:
        """Strains of a displacement field, (numnp, 5), at the points, (n, 1, 6); no gradients."""
        q = field[self._nodes]  # (entries, nodes, 5)
        values = (self._means @ (self._shapes @ q).reshape(len(q), -1)).reshape(-1, 3, 5)
        slopes = values[:, 1:]
        strains = strains_of(np.concatenate([slopes[..., :2], -slopes[..., 3:]], axis=2))
        strains[:, :3] += values[:, :1, 2] * strain_of_deflection(self.curvature)
        if self.nonlinear:
            x, y = slopes[:, 0, 2], slopes[:, 1, 2]
            strains[:, :3] += np.stack([x * x / 2.0, y * y / 2.0, x * y], axis=1)
        if self.initial is not None:
            strains[:, :3] += self.initial
        return strains[:, None], np.full((len(strains), 2, 6), np.nan)


def _points_in(rows: Indices, members: Indices | slice) -> Indices | slice:
    """Points whose element is among some; all of them where these are all elements."""
    return members if isinstance(members, slice) else np.flatnonzero(np.isin(rows, members))
