"""VTKHDF: a result as one file of time steps for ParaView and VTK.

VTKHDF File Format, version 2.2, type UnstructuredGrid, temporal: the arrays of all time steps are
concatenated, with the offset of each step.  The mesh is stored once, with all offsets 0.  Point
n - 1 is node n, cell n - 1 element n.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from fecm._typing import Array
from fecm.mechanics.strains import STRAINS
from fecm.results.errors import ExportError
from fecm.results.hdf5_writer import new_hdf5
from fecm.results.missing import remedy
from fecm.results.plies import IN_PLANE, INTERLAMINAR
from fecm.results.stored import Stored
from fecm.results.vtk_cells import Ints, vtk_cells

Note = Callable[[str], None]


class At(StrEnum):
    """What a field belongs to, as VTKHDF names it."""

    POINTS = "Point"
    CELLS = "Cell"
    TIME = "Field"  # a number per time step


VERSION = (2, 2)
# Numbers of points that are the first nodes of an element (K = -2: corners, K = -3: nine).
NODAL_POINTS = (4, 9)
CONTACT = ("force", "indentation", "transducer")
BLOCK = 4_000_000  # numbers per block of a field


def write_vtkhdf(
    result: Stored, path: Path, note: Note = lambda text: None, *, overwrite: bool = True
) -> None:
    """Write a result as VTKHDF, one time step per row of tape3.

    `note` receives a sentence about fields that are exported incompletely.  Raises ExportError if
    the result has no displacements.  Raises OSError if the file can't be written.
    """
    if "tape3/displacement" not in result:
        lack = "the result has no displacements (tape3), and hence no time step to export"
        raise ExportError(f"{lack}{remedy('tape3')}")
    # A state stored twice is one time step.
    steps, rows = np.unique(result["tape3/step"], return_index=True)
    with new_hdf5(path, overwrite=overwrite) as (file, _):
        root = file.create_group("VTKHDF")
        root.attrs["Version"] = np.array(VERSION, dtype="i8")
        root.attrs.create("Type", np.bytes_(b"UnstructuredGrid"))
        _write_mesh(root, result, result["tape3/time"][rows])
        _write_displacements(root, result["tape3/displacement"], rows)
        _write_contact(root, result, steps)
        _write_strains(root, result, steps, note)
        _write_plies(root, result, steps, note)
        _write_laminates(root, result, len(steps))


def _write_mesh(root: h5py.Group, result: Stored, times: Array) -> None:
    """The mesh, once, and the times at which it has fields."""
    coordinates = result["mesh/coordinates"]
    connectivity, offsets, types = vtk_cells(result["mesh/elements"])
    points = np.zeros((len(coordinates), 3))
    points[:, : coordinates.shape[1]] = coordinates
    root["Points"] = points
    root["Connectivity"], root["Offsets"] = connectivity, offsets.astype("i8")
    root["Types"] = types.astype("u1")
    sizes = {"Points": points, "Cells": types, "ConnectivityIds": connectivity}
    for name, values in sizes.items():
        root[f"NumberOf{name}"] = np.array([len(values)], dtype="i8")
    clock = root.create_group("Steps")
    clock.attrs["NSteps"] = np.int64(len(times))
    clock["Values"] = times.astype("f8")
    zeros = np.zeros(len(times), dtype="i8")
    clock["PartOffsets"] = clock["PointOffsets"] = zeros
    clock["NumberOfParts"] = zeros + 1
    clock["CellOffsets"] = clock["ConnectivityIdOffsets"] = zeros[:, None]


def _field(root: h5py.Group, at: At, name: str, steps: int, shape: tuple[int, ...]) -> Any:
    """Create a field with an array of `shape` per step, concatenated."""
    data = root.require_group(f"{at}Data")
    dataset = data.create_dataset(name, (steps * shape[0], *shape[1:]), "f8")
    offsets = np.arange(steps, dtype="i8") * shape[0]
    root.require_group(f"Steps/{at}DataOffsets")[name] = offsets
    if at is At.TIME:
        sizes = np.tile(np.array([1, shape[0]], dtype="i8"), (steps, 1))
        root.require_group("Steps/FieldDataSizes")[name] = sizes
    return dataset


def _write_displacements(root: h5py.Group, stored: Array, rows: Ints) -> None:
    """Point data: displacement (u, v, w), w alone, rotations (theta_x, theta_y)."""
    _, numnp, ndf = stored.shape
    parts: dict[str, Any] = {"displacement": slice(3), "w": 2, "rotation": slice(3, ndf)}
    one = np.empty((numnp, ndf))
    fields = [
        (_field(root, At.POINTS, name, len(rows), one[:, columns].shape), columns)
        for name, columns in parts.items()
        if one[:, columns].size
    ]
    block = max(1, BLOCK // (numnp * ndf))
    for start in range(0, len(rows), block):
        values = stored[rows[start : start + block]].reshape(-1, ndf)
        for dataset, columns in fields:
            dataset[start * numnp : start * numnp + len(values)] = values[:, columns]


def _write_contact(root: h5py.Group, result: Stored, steps: Ints) -> None:
    """Field data: contact at each step; zero before the first step."""
    if "history/step" not in result:
        return
    at = np.searchsorted(result["history/step"], steps)
    for name in CONTACT:
        values = np.concatenate((result[f"history/{name}"], [0.0]))
        at_step = np.where(steps > 0, values[np.minimum(at, len(values) - 1)], 0.0)
        _field(root, At.TIME, name, len(steps), (1,))[:] = at_step


def _write_strains(root: h5py.Group, result: Stored, steps: Ints, note: Note) -> None:
    """Curvatures and transverse shear strains: at nodes if stored there, else cell means."""
    if "tape8/step" not in result:
        note("the result has no strains (tape8), which the macro RODP stores")
        return
    at, shared = _rows_of(result, "tape8", steps, "strains", note)
    if not shared.any():
        return
    elements = result["mesh/elements"]
    numnp = len(result["mesh/coordinates"])
    npt = result["tape8/kappa_x"].shape[2]
    all_nodes = npt in NODAL_POINTS and not (elements[:, npt:] > 0).any()
    at_nodes = all_nodes and result.attributes_of("tape8").get("location") == "nodes"
    length = numnp if at_nodes else len(elements)
    there = elements[:, :npt] > 0
    points = elements[:, :npt][there] - 1
    shares = np.bincount(points, minlength=numnp)  # elements at each node
    for name in STRAINS:
        field = _field(root, At.POINTS if at_nodes else At.CELLS, name, len(steps), (length,))
        values = result[f"tape8/{name}"]
        for number in range(len(steps)):
            row = values[at[number]] if shared[number] else np.full(values.shape[1:], np.nan)
            if at_nodes:
                own = row[:, : there.shape[1]][there]
                step = np.bincount(points, weights=own, minlength=numnp) / shares
            else:
                step = row.mean(axis=1)
            field[number * length : (number + 1) * length] = step


def _rows_of(
    result: Stored, group: str, steps: Ints, what: str, note: Note
) -> tuple[Ints, NDArray[np.bool_]]:
    """Rows of a group at the time steps, and which of these have one."""
    stored = result[f"{group}/step"]
    at = np.minimum(np.searchsorted(stored, steps), len(stored) - 1)
    shared = stored[at] == steps
    if not shared.any():
        note(f"{what} ({group}) and displacements (tape3) share no step; {what} are omitted")
    elif not shared.all():
        were = f"were stored at {shared.sum()} of {len(steps)} time steps"
        note(f"{what} ({group}) {were}; at the others they are NaN")
    return at, shared


def _write_plies(root: h5py.Group, result: Stored, steps: Ints, note: Note) -> None:
    """Cell data: of each component the value of largest magnitude, and the ply that has it."""
    if "plies/step" not in result:
        return
    at, shared = _rows_of(result, "plies", steps, "ply stresses", note)
    if not shared.any():
        return
    cells = result["plies/element"] - 1
    length = len(result["mesh/elements"])
    if not 0 <= cells.min() <= cells.max() < length:
        raise ExportError(f"elements outside 1 to {length} have ply stresses")
    for name in (*IN_PLANE, *INTERLAMINAR):
        values = result[f"plies/{name}"]
        largest = _field(root, At.CELLS, name, len(steps), (length,))
        ply = _field(root, At.CELLS, f"{name}_ply", len(steps), (length,))
        for number in range(len(steps)):
            step = np.full((2, length), np.nan)
            if shared[number]:
                step[:, cells] = _largest(values[at[number]])
            largest[number * length : (number + 1) * length] = step[0]
            ply[number * length : (number + 1) * length] = step[1]


def _write_laminates(root: h5py.Group, result: Stored, steps: int) -> None:
    """Cell data: the number of each element's laminate, where there are several."""
    if "mesh/laminate" in result:
        numbers = result["mesh/laminate"]
        field = _field(root, At.CELLS, "laminate", steps, numbers.shape)
        field[:] = np.tile(numbers, steps)


def _largest(row: Array) -> Array:
    """Value of largest magnitude in (..., plies, levels) of every element, and its ply, (2, n).

    NaN, of plies that only other laminates have, is left out unless an element has nothing else.
    """
    values = np.moveaxis(row, -2, 1)
    flat = values.reshape(len(values), -1)
    place = np.where(np.isnan(flat), -1.0, np.abs(flat)).argmax(axis=1)
    found = flat[np.arange(len(flat)), place]
    ply = place // (flat.shape[1] // values.shape[1]) + 1.0
    return np.stack([found, np.where(np.isnan(found), np.nan, ply)])
