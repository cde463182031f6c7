"""VTKHDF: a result as one file of time steps for ParaView and VTK.

VTKHDF File Format, version 2.2, type UnstructuredGrid, temporal: the arrays of all time steps are
concatenated, with the offset of each step.  The mesh is stored once, with all offsets 0.  Point
n - 1 is node n, cell n - 1 element n.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np

from fecm._typing import Array
from fecm.results.criteria import criteria_of
from fecm.results.errors import ExportError
from fecm.results.hdf5_writer import new_hdf5
from fecm.results.missing import remedy
from fecm.results.plate_fields import Fields, Note, fields
from fecm.results.stored import Stored
from fecm.results.vtk_cells import Ints, vtk_cells, vtk_points

VERSION = (2, 2)
CONTACT = ("force", "indentation", "transducer")
TIME = "Field"  # a number per time step, as VTKHDF names it


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
        _write_contact(root, result, steps)
        _write_exposures(root, result, steps)
        for one in fields(result, rows, note):
            _write_fields(root, len(steps), one)


def _write_mesh(root: h5py.Group, result: Stored, times: Array) -> None:
    """The mesh, once, and the times at which it has fields."""
    connectivity, offsets, types = vtk_cells(result["mesh/elements"])
    points = vtk_points(result)
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


def _field(
    root: h5py.Group,
    at: str,
    name: str,
    steps: int,
    shape: tuple[int, ...],
    *,
    constant: bool = False,
) -> Any:
    """Create a field with an array of `shape` per step, concatenated, or with a single one."""
    data = root.require_group(f"{at}Data")
    count = 1 if constant else steps
    dataset = data.create_dataset(name, (count * shape[0], *shape[1:]), "f8")
    offsets = np.arange(steps, dtype="i8") % count * shape[0]
    root.require_group(f"Steps/{at}DataOffsets")[name] = offsets
    if at == TIME:
        sizes = np.tile(np.array([1, shape[0]], dtype="i8"), (steps, 1))
        root.require_group("Steps/FieldDataSizes")[name] = sizes
    return dataset


def _write_fields(root: h5py.Group, steps: int, of: Fields) -> None:
    """Point or cell data, one step after the other; once if they are constant."""
    made = [
        (_field(root, of.at, name, steps, shape, constant=of.constant), shape[0])
        for name, shape in of.shapes.items()
    ]
    for number in range(1 if of.constant else steps):
        for (dataset, length), values in zip(made, of.of_step(number), strict=True):
            dataset[number * length : (number + 1) * length] = values


def _write_contact(root: h5py.Group, result: Stored, steps: Ints) -> None:
    """Field data: contact at each step; zero before the first step."""
    if "history/step" not in result:
        return
    at = np.searchsorted(result["history/step"], steps)
    for name in CONTACT:
        values = np.concatenate((result[f"history/{name}"], [0.0]))
        at_step = np.where(steps > 0, values[np.minimum(at, len(values) - 1)], 0.0)
        _field(root, TIME, name, len(steps), (1,))[:] = at_step


def _write_exposures(root: h5py.Group, result: Stored, steps: Ints) -> None:
    """Field data: largest exposure so far of each criterion; zero before the first evaluation."""
    if any(f"exposures/{name}" not in result for name in ("step", "exposure")):
        return
    evaluations = np.searchsorted(result["exposures/step"], steps, side="right")
    criteria = criteria_of(result.attributes_of("failure"))
    for criterion, exposures in zip(criteria, result["exposures/exposure"].T, strict=False):
        if not np.isfinite(exposures).any():
            continue  # its strengths are not known
        so_far = np.concatenate(([0.0], exposures))[evaluations]
        _field(root, TIME, f"largest_{criterion}", len(steps), (1,))[:] = so_far
