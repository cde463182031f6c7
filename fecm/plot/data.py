"""Data of pictures: rows by time, points of the plate, segments of the deck.

Data that a result lacks, or that can't be drawn, raise :class:`~fecm.plot.kinds.PlotError`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fecm._errors import ResultFileError
from fecm._typing import Array, Bools, Floats, Indices
from fecm.deck.model import Deck, Impact
from fecm.mechanics.elements import Quadrature
from fecm.mechanics.interpolation import local_shape_functions
from fecm.mechanics.mesh import ElementBlock, element_blocks
from fecm.plot.kinds import LackingError, PlotError
from fecm.results.groups import NotStoredError, remedy
from fecm.results.plies import points_of, rows_at
from fecm.results.result import Result

LARGEST = 1e100  # numbers above it are refused: axes fail long before numbers overflow
MANY = 2000  # meshes with more elements are drawn with fewer points per element


def require_datasets(result: Result, name: str, *paths: str, padded: bool = False) -> list[Array]:
    """Return datasets of a result. Contact forces and energies are those of the whole plate.

    Raises LackingError if a dataset is empty or missing; the message names the macro that stores
    it. Raises PlotError if a dataset holds numbers that an axis can't show. `padded` allows NaN in
    results of several laminates or materials, for plies that an element lacks or that have no
    strengths.
    """
    padded &= "mesh/laminate" in result or "plies/material" in result
    for path in paths:
        if path not in result:
            raise LackingError(f"{name} has no {path}{remedy(path)}")
    for path in paths:
        if not result[path].size:
            raise LackingError(f"{name} has no rows of {path}")
        is_drawable = np.abs(result[path]) <= LARGEST
        if padded:
            is_drawable |= np.isnan(result[path])
        if not is_drawable.all():
            raise PlotError(
                f"{path} of {name} holds numbers beyond ±{LARGEST:g}, infinities or NaN, which "
                "can't be drawn"
            )
    return [result.whole(path) for path in paths]


def mesh_of(result: Result, name: str) -> tuple[Array, Floats]:
    """Return the elements, and x and y of all nodes (length).

    Raises PlotError if the nodes lie on a line along an axis.
    """
    elements, coordinates = require_datasets(result, name, "mesh/elements", "mesh/coordinates")
    coordinates = coordinates[:, :2]
    extent = np.ptp(coordinates, axis=0)
    if not (extent > 1e-9 * np.abs(coordinates).max()).all():
        raise PlotError(
            f"the mesh of {name} has no area: it is {extent[0]:g} wide in x and {extent[1]:g} in y"
        )
    return elements, coordinates


def result_deck(result: Result, name: str) -> Deck:
    """Return the deck of a result."""
    try:
        return result.deck
    except ResultFileError:
        raise PlotError(f"{name} holds no deck that can be read") from None


def circle(result: Result, name: str) -> tuple[Floats, float] | None:
    """Return centre, (2,), and radius of the contact patch, length; None without a patch."""
    if "patch/weight" not in result:
        return None
    stored = [result.patch.attributes.get(key) for key in ("x", "y", "radius")]
    values = [
        float(value) for value in stored if isinstance(value, int | float) and abs(value) <= LARGEST
    ]
    if len(values) < len(stored):
        raise PlotError(f"{name} has a contact patch without a centre and a radius")
    x, y, radius = values
    return np.array([x, y]), radius


def struck(result: Result, name: str) -> Floats:
    """Return the centre of the contact patch, or the impact node, (1, 2); (0, 2) without either."""
    patch = circle(result, name)
    if patch is not None:
        return patch[0][None]
    impact = result_deck(result, name).last(Impact)
    nodes = [] if impact is None else [impact.node - 1]
    coordinates = result["mesh/coordinates"][:, :2]
    if impact is not None and not 1 <= impact.node <= len(coordinates):
        raise PlotError(f"{name} has no node {impact.node}, the impact node of its deck")
    return np.asarray(coordinates[nodes])


def impact_point(result: Result, name: str) -> Floats:
    """Return the centre of the contact patch, or the impact node, (2,), length.

    Raises PlotError if the deck has neither.
    """
    points = struck(result, name)
    if not len(points):
        raise PlotError(f"nothing strikes the plate of {name}: its deck has no ROD segment")
    return np.asarray(points[0])


def stored_rows(result: Result, name: str, times: Sequence[float], count: int) -> Indices:
    """Return the rows of tape3 nearest to the given times.

    Without times, `count` equally spaced rows are returned. They lie before the end of the contact
    if it ends within the run.
    """
    (stored,) = require_datasets(result, name, "tape3/time")
    if not times:
        end = contact_end(result)
        rows = int(np.searchsorted(stored, end)) or len(stored)
        if rows <= count:
            return np.arange(rows)
        parts = count if end == np.inf else count + 1
        return (np.arange(1, count + 1) / parts * rows).round().astype(np.intp) - 1
    try:
        return rows_at(stored, times, "displacements")
    except NotStoredError as error:
        raise PlotError(f"{name} has {error}") from None


def contact_end(result: Result) -> float:
    """Return the time at which the last contact ends; infinite without an impact or an end."""
    if "history/force" not in result or result.still_in_contact:
        return np.inf
    touching = result["history/time"][result["history/force"] > 0.0]
    return float(touching[-1]) if len(touching) else np.inf


class Patches(NamedTuple):
    """Plate divided into small quadrilaterals, the same number in every element."""

    points: Floats  # (n, 2): corners (length)
    quads: Indices  # (m, 4): rows of the corners in `points`
    # (k,) each: rows of the points around an element, with the first repeated at the end.
    edges: list[Indices]
    parts: list[tuple[ElementBlock, Floats]]  # elements and the shape functions at their points

    def values(self, nodal: Array) -> Floats:
        """Interpolate nodal values to the points with the shape functions of the elements."""
        return np.concatenate([(nodal[family.nodes] @ N.T).ravel() for family, N in self.parts])

    @property
    def triangles(self) -> Indices:
        """Two triangles per quadrilateral, (n, 3), without triangles that have no area."""
        corners = np.concatenate([self.quads[:, [0, 1, 2]], self.quads[:, [0, 2, 3]]])
        first, second = (self.points[corners[:, n]] - self.points[corners[:, 0]] for n in (1, 2))
        area = np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])
        kept = area > 1e-9 * float(area.max())
        return np.asarray(corners[kept])


def patches(result: Result, cuts: int, name: str = "the result") -> Patches:
    """Divide every element into cuts × cuts quadrilaterals."""
    elements, coordinates = mesh_of(result, name)
    cuts = min(cuts, 2) if len(elements) > MANY else cuts
    ticks = np.linspace(-1.0, 1.0, cuts + 1)
    eta, xi = (places.ravel() for places in np.meshgrid(ticks, ticks, indexing="ij"))
    grid = Quadrature(xi, eta, np.zeros(len(xi)))  # points only; nothing is integrated
    number = np.arange(len(xi)).reshape(cuts + 1, cuts + 1)
    quad = number[:-1, :-1].reshape(-1, 1) + np.array([0, 1, cuts + 2, cuts + 1])
    around = np.concatenate([*(np.rot90(number, turn)[0, :-1] for turn in range(4)), [0]])
    points, quads, edges, parts, start = [], [], [], [], 0
    for family in element_blocks(elements, coordinates):
        N = local_shape_functions(family, grid)[0]
        parts.append((family, N))
        points.append(np.einsum("pn,eni->epi", N, family.coordinates).reshape(-1, 2))
        starts = start + len(xi) * np.arange(len(family.rows))
        quads.append((starts[:, None, None] + quad).reshape(-1, 4))
        edges += list(starts[:, None] + around)
        start += len(points[-1])
    return Patches(np.concatenate(points), np.concatenate(quads), edges, parts)


def reach(result: Result, name: str, thickness: float) -> float:
    """Return the distance from the load below which plate theory does not hold: radius + h/2."""
    patch = circle(result, name)
    return thickness / 2.0 + (0.0 if patch is None else patch[1])


def strain_points(result: Result, name: str) -> Floats:
    """Return the coordinates of the points of tape8, (numel, npt, 2), length."""
    (stored,) = require_datasets(result, name, "tape8/kappa_x")
    elements, _ = mesh_of(result, name)
    at_nodes = result.tape8.attributes.get("location") == "nodes"
    try:
        return points_of(result, 1 + np.arange(len(elements)), stored.shape[2], at_nodes)
    except ResultFileError as error:
        raise PlotError(f"{name}: {error}") from None


def check_on_plate(points: Floats, place: Floats, name: str) -> None:
    """Raise PlotError if a place is outside the plate's points, (..., 2)."""
    low, high = points.reshape(-1, 2).min(axis=0), points.reshape(-1, 2).max(axis=0)
    room = 0.02 * float((high - low).max())
    if not ((place >= low - room) & (place <= high + room)).all():
        raise PlotError(
            f"the point {place[0]:g},{place[1]:g} is not on the plate of {name}, which extends "
            f"from {low[0]:g},{low[1]:g} to {high[0]:g},{high[1]:g}"
        )


def nearest(points: Floats, place: Floats, name: str) -> Bools:
    """Return a mask of the points nearest to a place on the plate.

    Several points are nearest if elements meet there.
    """
    check_on_plate(points, place, name)
    distance = np.hypot(*np.moveaxis(points - place, -1, 0))
    size = float(np.ptp(points, axis=(0, 1)).max())
    return np.asarray(distance <= distance.min() + 1e-6 * size)
