"""Strains on the circle around the load within which plate theory does not hold.

Exposures of plies are largest on this circle, r = R, and no point of an element lies on it.
Strains are interpolated in the elements; where elements meet, they are the mean of both.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fecm._typing import Floats, Indices
from fecm.mechanics.curvature import FLAT, Curvature, strain_of_deflection
from fecm.mechanics.elements import Quadrature
from fecm.mechanics.interpolation import interpolate
from fecm.mechanics.mesh import ElementBlock
from fecm.mechanics.ply_stresses import PlyStresses, Zone, Zones, strains_of
from fecm.mechanics.points import locate

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
            for member, number, xi in zip(*locate(family, points), strict=True)
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
            Zone.of(laminate, _points_in(rows, members)) for laminate, members in laminates
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
