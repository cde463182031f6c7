"""Largest exposures over time, in the elements and on the circle around the load.

Exposures of plies are largest on this circle, r = R, but no point of an element lies on it.
Strains are therefore interpolated in the elements.  Where elements meet, the strains are averaged.
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
from fecm.mechanics.symmetry import Mirror

Numbers = NDArray[np.int64]
NOWHERE = -1  # state of a criterion without an exposure that counts
# Exposures that differ by less than this share are equal, so that rounding decides neither which
# exposure is the largest nor when.  kernels.c has the same constant.
TIE = 1.0e-9
ON_LINE = 1.0e-6  # distance of a point of the circle from a line of symmetry, over the radius


@dataclass
class Maxima:
    """Largest exposure of every state so far, with its time and mode."""

    exposure: Floats
    time: Floats
    mode: Codes  # index into :data:`~fecm.mechanics.failure.MODES`

    @classmethod
    def none(cls, *shape: int) -> Maxima:
        """Return zeros: no exposure yet."""
        return cls(np.zeros(shape), np.zeros(shape), np.zeros(shape, np.int8))


@dataclass
class Largest:
    """Largest exposure of each criterion so far, among the exposures that count.

    The interlaminar criterion comes last.  Ties go to the lowest number.
    """

    exposure: Floats  # (criteria,); NaN if no exposure counts
    state: Numbers  # (criteria,): number of the evaluated state, or of the interface; or NOWHERE
    mode: Codes  # (criteria,)
    # (criteria, 6): midplane strains and curvatures at the point when the exposure was reached.
    strain: Floats

    @classmethod
    def none(cls, count: int) -> Largest:
        """Return the start for `count` criteria: no exposure yet."""
        states = np.full(count, NOWHERE, dtype=np.int64)
        return cls(np.full(count, np.nan), states, np.zeros(count, np.int8), np.zeros((count, 6)))

    def copy(self) -> Largest:
        """Return a copy, which later evaluations do not change."""
        return Largest(*(values.copy() for values in vars(self).values()))


@dataclass
class FailureEnvelope:
    """Largest exposures over time, in arrays that are changed in place."""

    # (criteria, states): the states that a monitor evaluates at each point.  UNKNOWN for plies
    # without strengths, for plies that an element lacks, and for plies that a criterion is not
    # evaluated for.
    plies: Maxima
    # (elements, plies - 1); NaN if an interface or its strength is missing, or an element lacks
    # nodes.
    interfaces: Maxima
    largest: Largest
    # Structures of the kernels that point to these arrays.  Checkpoints do not store them.
    kept: object = field(default=None, init=False, repr=False, compare=False)
    # Exposures on the circle around the load; None without a load.
    circle: FailureEnvelope | None = None

    def reset_to(self, start: FailureEnvelope) -> None:
        """Copy the exposures of another envelope of the same monitor into these arrays."""
        for part in ("plies", "interfaces", "largest"):
            for name, values in vars(getattr(start, part)).items():
                getattr(getattr(self, part), name)[...] = values
        if self.circle is not None and start.circle is not None:
            self.circle.reset_to(start.circle)

    def find_largest(self, counts: Bools, far: Bools, strains: Floats | None = None) -> None:
        """Find the largest exposures among the points and elements that count.

        `counts` (elements, points) marks points, `far` (elements,) marks elements for the
        interfaces.  `strains` (elements, points, 6) belong to the exposures that have just risen.
        """
        largest, plies = self.largest, self.plies
        states_per_point = plies.exposure.shape[1] // counts.size
        for number, state in enumerate(_largest_states(plies.exposure, counts).tolist()):
            exposure = np.nan if state == NOWHERE else plies.exposure[number, state]
            has_risen = exposure > largest.exposure[number] or state != largest.state[number]
            if strains is not None and has_risen:
                largest.strain[number] = strains.reshape(-1, 6)[state // states_per_point]
            largest.exposure[number], largest.state[number] = exposure, state
            largest.mode[number] = 0 if state == NOWHERE else plies.mode[number, state]
        interfaces = self.interfaces
        largest.state[-1] = state = _largest_interface(interfaces.exposure, far)
        largest.exposure[-1] = np.nan if state == NOWHERE else interfaces.exposure.flat[state]
        largest.mode[-1] = 0 if state == NOWHERE else interfaces.mode.flat[state]


def _largest_states(exposure: Floats, counts: Bools) -> Indices:
    """Return the state of each criterion's largest exposure, (criteria,), at points that count."""
    is_counted = counts.ravel()
    if not is_counted.any():
        return np.full(len(exposure), NOWHERE)
    by_point = exposure.reshape(len(exposure), is_counted.size, -1)
    points = first_of_largest(np.where(is_counted, by_point.max(axis=2), -np.inf))
    criteria = np.arange(len(exposure))
    states = first_of_largest(by_point[criteria, points])
    largest = points * by_point.shape[2] + states
    # The exposure is below 0 if no ply has strengths.
    return np.where(exposure[criteria, largest] < 0.0, NOWHERE, largest)


def _largest_interface(exposure: Floats, far: Bools) -> int:
    """Return the number of the interface with the largest exposure in elements that count."""
    counted = np.where(far[:, None] & np.isfinite(exposure), exposure, -1.0)
    if not (counted >= 0.0).any():
        return NOWHERE
    return int(first_of_largest(counted.ravel()))


def first_of_largest(exposures: Floats) -> Indices:
    """Return the first position along the last axis whose exposure ties with the largest."""
    largest = exposures.max(axis=-1, keepdims=True)
    return np.asarray((exposures >= largest - TIE * np.abs(largest)).argmax(axis=-1))


class Evaluations(NamedTuple):
    """Largest exposures that count, after each evaluation; see :class:`Largest`."""

    # (evaluations, criteria) each.
    exposure: Floats
    state: Numbers
    mode: Codes

    @classmethod
    def of(cls, rows: Sequence[Largest]) -> Self:
        """Stack the largest exposures after each evaluation."""
        return cls(
            np.array([row.exposure for row in rows]),
            np.array([row.state for row in rows]),
            np.array([row.mode for row in rows]),
        )


@dataclass(frozen=True)
class PlyPoints:
    """Coordinates of the points at which plies are evaluated, (elements, points)."""

    x: Floats
    y: Floats

    @cached_property
    def centres(self) -> tuple[Floats, Floats]:
        """Mean x and y of the points of each element, (elements,)."""
        return self.x.mean(axis=1), self.y.mean(axis=1)


ANGLES = 48  # points of a whole circle, starting at the x-axis


class CircleStresses(PlyStresses):
    """Stresses of plies at the points of a circle.  Each point counts as an element of one point.

    Parameters
    ----------
    families : sequence of ElementBlock
        The elements of the plate.
    centre : tuple of float
        Place of the load, length.
    radius : float
        Radius R of the circle, length.  Points outside the plate are left out.
    laminates : Zones
        Laminates with the rows of their elements.
    initial, curvature, nonlinear, stretches
        As in :class:`~fecm.mechanics.ply_stresses.PlyStresses`.
    mirrors : sequence of Mirror
        Lines of symmetry, where the mean is taken with the mirrored element.
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
        mirrors: Sequence[Mirror] = (),
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
        # Shape functions and slopes of the elements that contain a point, padded with zeros.
        most_nodes = max((element.nodes.shape[1] for _, _, element, _ in entries), default=1)
        self._nodes = np.zeros((len(entries), most_nodes), dtype=np.intp)
        self._shapes = np.zeros((len(entries), 3, most_nodes))
        self._means = np.zeros((len(on_plate), len(entries)))
        rows = np.zeros(len(on_plate), dtype=np.intp)  # row of one element that contains each point
        for entry, (number, row, element, xi) in enumerate(entries):
            shapes = interpolate(element, Quadrature(xi[:1], xi[1:], np.ones(1)))
            count = element.nodes.shape[1]
            self._nodes[entry, :count] = element.nodes[0]
            self._shapes[entry, 0, :count] = shapes.N[0]
            self._shapes[entry, 1:, :count] = shapes.dN[0, 0]
            point = np.searchsorted(on_plate, number)
            self._means[point, entry] = 1.0
            rows[point] = row
        self._means /= self._means.sum(axis=1, keepdims=True)
        self._mirrored = _mirrored(self.points, mirrors, radius)
        self.zones = [
            ElementZone.of(laminate, _points_in(rows, members)) for laminate, members in laminates
        ]
        self.shape = (len(on_plate), 1, max(zone.plies for zone in self.zones))
        self.initial, self.curvature, self.nonlinear = initial, curvature, nonlinear
        self.stretches = stretches

    @property
    def families(self) -> list[tuple[ElementBlock, bool]]:
        """Empty: the points have no elements of their own."""
        return []

    def strains(self, field: Floats) -> tuple[Floats, Floats]:
        """Return the strains of a field (numnp, 5) at the points, (n, 1, 6); gradients are NaN."""
        (strains,) = self.strains_of_fields(field[None])
        return strains, np.full((len(strains), 2, 6), np.nan)

    def strains_of_fields(self, fields: Floats) -> Floats:
        """Return the strains of fields (fields, numnp, 5) at the points, (fields, n, 1, 6)."""
        q = fields[:, self._nodes]  # (fields, entries, nodes, 5)
        values = self._means @ (self._shapes @ q).reshape(*q.shape[:2], -1)
        values = values.reshape(len(q), -1, 3, 5)
        if self._mirrored is not None:
            values[:, self._mirrored] = 0.0
        slopes = values[:, :, 1:]
        strains = strains_of(np.concatenate([slopes[..., :2], -slopes[..., 3:]], axis=3))
        strains[..., :3] += values[:, :, :1, 2] * strain_of_deflection(self.curvature)
        if self.nonlinear:
            x, y = slopes[:, :, 0, 2], slopes[:, :, 1, 2]
            strains[..., :3] += np.stack([x * x / 2.0, y * y / 2.0, x * y], axis=2)
        if self.initial is not None:
            strains[..., :3] += self.initial
        return strains[:, :, None]


def _mirrored(points: Floats, mirrors: Sequence[Mirror], radius: float) -> Bools | None:
    """Return the values at points that a mirrored element cancels, (n, 3, 5); None without mirrors.

    The values are each dof and its slopes in x and y. Across a line of symmetry the slopes of the
    dofs that are even cancel.
    """
    if not mirrors:
        return None
    cancelled = np.zeros((len(points), 3, 5), dtype=bool)
    for mirror in mirrors:
        on_line = np.abs(points[:, mirror.axis] - mirror.place) <= ON_LINE * radius
        is_even = np.isin(np.arange(5), mirror.odd, invert=True)
        cancelled[:, 1 + mirror.axis] |= on_line[:, None] & is_even
    return cancelled


def _points_in(rows: Indices, members: Indices | slice) -> Indices | slice:
    """Return the points whose element is in `members`; a slice selects all points."""
    return members if isinstance(members, slice) else np.flatnonzero(np.isin(rows, members))
