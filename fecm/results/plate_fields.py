"""Fields over the plate at stored time steps, and its elements as the cells of VTK."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from enum import StrEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fecm._typing import Array, Floats
from fecm.judge.criteria import INTERLAMINAR, criteria_of
from fecm.judge.exposures import LOWER_BOUNDS
from fecm.mechanics.strains import STRAINS
from fecm.results.exposures import near_load
from fecm.results.groups import ExportError
from fecm.results.plies import IN_PLANE
from fecm.results.plies import INTERLAMINAR as BETWEEN_PLIES
from fecm.results.stored import Stored

Ints = NDArray[np.int64]

CORNERS = 4
# VTK's cell types (vtkCellType.h) of elements with 3, 4, 8 or 9 nodes.
TYPES = {3: 5, 4: 9, 8: 23, 9: 28}


def vtk_points(stored: Stored) -> Floats:
    """Return the places x, y and z of the nodes at rest, (numnp, 3); z is 0 on a flat plate."""
    coordinates = stored["mesh/coordinates"][:, :2]
    points = np.zeros((len(coordinates), 3))
    points[:, : coordinates.shape[1]] = coordinates
    if "mesh/z" in stored:
        points[:, 2] = stored["mesh/z"]
    return points


def vtk_cells(elements: Array) -> tuple[Ints, Ints, Ints]:
    """Return connectivity, offsets and types; elements that VTK lacks are reduced to corners."""
    count = np.cumprod(elements > 0, axis=1).sum(axis=1)  # nodes before the first absent one
    whole = (count == (elements > 0).sum(axis=1)) & np.isin(count, list(TYPES))
    used = np.where(whole, count, np.minimum(count, CORNERS))
    connectivity = elements[np.arange(elements.shape[1]) < used[:, None]] - 1
    types = np.array([TYPES[int(n)] for n in used])
    return connectivity.astype("i8"), np.concatenate(([0], np.cumsum(used))), types


Note = Callable[[str], None]
SHARE = "The number of their macro should be a multiple of the number of DISP"
# Numbers of points that are the first nodes of an element (K = -2: corners, K = -3: nine).
NODAL_POINTS = (4, 9)


class At(StrEnum):
    """Location of a field, as VTKHDF names it."""

    POINTS = "Point"
    CELLS = "Cell"


class Fields(NamedTuple):
    """Fields that are computed together."""

    at: At
    shapes: Mapping[str, tuple[int, ...]]  # of a time step, by name
    # The fields of the time step with this number, in the order of `shapes`.
    of_step: Callable[[int], Iterable[Array]]
    constant: bool = False  # whether they are the same at all time steps


def plate_fields(stored: Stored, rows: Ints, note: Note = lambda text: None) -> Iterator[Fields]:
    """Return the fields at the time steps of some rows of tape3.

    `note` receives a sentence about fields that were not stored at all of these steps. Raises
    ExportError if elements that do not exist have ply stresses.
    """
    steps = stored["tape3/step"][rows]
    yield _displacements(stored["tape3/displacement"], rows)
    yield from _strains(stored, steps, note)
    yield from _ply_stresses(stored, steps, note)
    yield from _exposures(stored, note)
    if "mesh/laminate" in stored:
        yield _constant({"laminate": stored["mesh/laminate"]})


def _constant(values: Mapping[str, Array]) -> Fields:
    """Return values of the cells that do not depend on time."""
    shapes = {name: array.shape for name, array in values.items()}
    return Fields(At.CELLS, shapes, lambda number: list(values.values()), constant=True)


def _displacements(stored: Array, rows: Ints) -> Fields:
    """Return displacement (u, v, w), w, and rotations (theta_x, theta_y) at the points."""
    _, numnp, ndf = stored.shape
    shapes = {"displacement": (numnp, 3), "w": (numnp,), "rotation": (numnp, ndf - 3)}
    if ndf == 3:
        del shapes["rotation"]

    def of_step(number: int) -> list[Array]:
        fields = stored[rows[number]]
        return [fields[:, :3], fields[:, 2], fields[:, 3:]][: len(shapes)]

    return Fields(At.POINTS, shapes, of_step)


def _strains(stored: Stored, steps: Ints, note: Note) -> Iterator[Fields]:
    """Return curvatures and transverse shear strains, at the points or as means of the cells."""
    if "tape8/step" not in stored:
        note("the result has no strains (tape8), which the macro RODP stores")
        return
    rows, shared = _rows_of(stored, "tape8", steps, "strains", note)
    if not shared.any():
        return
    elements = stored["mesh/elements"]
    numnp = len(stored["mesh/coordinates"])
    values = [stored[f"tape8/{name}"] for name in STRAINS]
    npt = values[0].shape[2]
    all_nodes = npt in NODAL_POINTS and not (elements[:, npt:] > 0).any()
    at_nodes = all_nodes and stored.attributes_of("tape8").get("location") == "nodes"
    there = elements[:, :npt] > 0
    points = elements[:, :npt][there] - 1
    shares = np.bincount(points, minlength=numnp)  # elements at each node
    length = numnp if at_nodes else len(elements)

    def mean(row: Array) -> Array:
        if not at_nodes:
            return np.asarray(row.mean(axis=1))
        at_points = row[:, : there.shape[1]][there]
        return np.bincount(points, weights=at_points, minlength=numnp) / shares

    def of_step(number: int) -> list[Array]:
        if not shared[number]:
            return [np.full(length, np.nan) for _ in STRAINS]
        return [mean(fields[rows[number]]) for fields in values]

    where = At.POINTS if at_nodes else At.CELLS
    yield Fields(where, dict.fromkeys(STRAINS, (length,)), of_step)


def _rows_of(
    stored: Stored, group: str, steps: Ints, what: str, note: Note
) -> tuple[Ints, NDArray[np.bool_]]:
    """Return the rows of a group at the time steps, and a mask of the steps that have one."""
    stored_steps = stored[f"{group}/step"]
    nearest = np.minimum(np.searchsorted(stored_steps, steps), len(stored_steps) - 1)
    shared = stored_steps[nearest] == steps
    without = int((~np.isin(stored_steps, stored["tape3/step"])).sum())
    if not shared.any():
        note(
            f"{what} ({group}) and displacements (tape3) share no step; {what} are omitted. {SHARE}"
        )
        return nearest, shared
    if not shared.all():
        were = f"were stored at {shared.sum()} of {len(steps)} time steps"
        note(f"{what} ({group}) {were}; at the others they are NaN")
    if without and len(steps) == len(stored["tape3/step"]):  # all rows, not one time
        note(
            f"{without} of {len(stored_steps)} rows of {what} ({group}) have no displacements "
            f"(tape3) at their step and are omitted. {SHARE}"
        )
    return nearest, shared


def _ply_stresses(stored: Stored, steps: Ints, note: Note) -> Iterator[Fields]:
    """Return the ply stress of largest magnitude in each cell, by component, and its ply."""
    if "plies/step" not in stored:
        return
    rows, shared = _rows_of(stored, "plies", steps, "ply stresses", note)
    if not shared.any():
        return
    cells = stored["plies/element"] - 1
    length = len(stored["mesh/elements"])
    if not 0 <= cells.min() <= cells.max() < length:
        raise ExportError(f"elements outside 1 to {length} have ply stresses")

    def component(name: str) -> Fields:
        values = stored[f"plies/{name}"]

        def of_step(number: int) -> Array:
            extremes = np.full((2, length), np.nan)
            if shared[number]:
                extremes[:, cells] = _largest(values[rows[number]])
            return extremes

        return Fields(At.CELLS, dict.fromkeys((name, f"{name}_ply"), (length,)), of_step)

    yield from map(component, (*IN_PLANE, *BETWEEN_PLIES))
    if "failure/under_load" not in stored:
        under = np.full(length, np.nan)
        under[cells] = stored["plies/under_load"] != 0
        yield _constant({"under_load": under})


def _exposures(stored: Stored, note: Note) -> Iterator[Fields]:
    """Return the largest exposure of each criterion in the cells over the run, and its ply.

    Points under the load are left out; a cell without others is NaN.
    """
    if "failure/under_load" not in stored:
        return
    if stored.still_in_contact:
        note(LOWER_BOUNDS)
    for criterion in criteria_of(stored.attributes_of("failure")):
        values = stored[f"failure/{criterion}/exposure"]
        left_out = near_load(stored, criterion) | (values < 0.0)  # plies without strengths
        counted = np.where(left_out, np.nan, values)
        if not np.isfinite(counted).any():
            continue
        name = f"exposure_{criterion}"
        exposure, ply = _largest(counted[..., None] if criterion == INTERLAMINAR else counted)
        yield _constant({name: exposure, f"{name}_ply": ply})
    under = (stored["failure/under_load"] != 0).any(axis=1)
    yield _constant({"under_load": under.astype(float)})


def _largest(row: Array) -> Array:
    """Return the value of largest magnitude of every element, and its ply, (2, n).

    Values are (..., plies, levels). NaN, of plies that only other laminates have, is left out
    unless an element has nothing else.
    """
    values = np.moveaxis(row, -2, 1)
    flat = values.reshape(len(values), -1)
    place = np.where(np.isnan(flat), -1.0, np.abs(flat)).argmax(axis=1)
    largest = flat[np.arange(len(flat)), place]
    ply = place // (flat.shape[1] // values.shape[1]) + 1.0
    return np.stack([largest, np.where(np.isnan(largest), np.nan, ply)])
