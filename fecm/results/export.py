"""Results for other programs: CSV, VTKHDF, and objects of pandas, xarray and PyVista.

CSV has datasets of a result as tables in long form, for spreadsheets and data frames. Key columns
come first (step and time, then node, element or point, from 1), then values. Units follow the names
in the header. Numbers are written by Python's repr and can be read back exactly.

VTKHDF has a result as one file of time steps for ParaView and VTK (VTKHDF File Format, version 2.2,
type UnstructuredGrid, temporal). The arrays of all time steps are concatenated, with the offset of
each step. The mesh is stored once, with all offsets 0. Point n - 1 is node n, cell n - 1 is element
n.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from fecm._files import check_outputs, open_for_writing
from fecm._text import Decimal, csv_lines
from fecm._typing import Array
from fecm.deck.mesh_cards import AXES, DOF_NAMES
from fecm.deck.units import column_name, units_of_columns
from fecm.judge.criteria import criteria_of
from fecm.judge.exposures import LOWER_BOUNDS
from fecm.results import schema
from fecm.results.groups import ExportError, NotStoredError, remedy, stored_by, suggestion
from fecm.results.hdf5_writer import new_hdf5
from fecm.results.plate_fields import At, Fields, Ints, Note, plate_fields, vtk_cells, vtk_points
from fecm.results.plies import IN_PLANE, INTERLAMINAR, rows_at
from fecm.results.schema import (
    AXIS_NAMES,
    COLUMN_UNITS,
    DATASETS,
    SCALES,
    Dataset,
    dataset_of,
)
from fecm.results.stored import Stored

if TYPE_CHECKING:
    import pandas
    import pyvista
    import xarray


CLOCK = ("step", "time", "number")  # key columns of rows: the instant, or the number of a mode
# Axes with named positions become columns.
NAMED: dict[str | int, tuple[str, ...]] = {
    **schema.AXIS_NAMES,
    "nen": tuple(f"node_{n}" for n in range(1, 13)),
    3: ("xx", "yy", "xy"),
    2: ("xz", "yz"),
    "faces": ("lower", "upper"),
    "levels": ("lower", "middle", "upper"),
    "directions": ("xz", "yz"),
}
# Names of the other axes' columns.
KEYS = {
    **{size: name for size, (name, _) in schema.SCALES.items()},
    "members": "element",
    "npp": "point",
    "patch_nodes": "node",
    "supports": "support",
}
# Datasets that number the positions along an axis.
LABELS = {"gages": "gages/number", "members": "plies/element", "patch_nodes": "patch/node"}
# Datasets of the table of ply stresses.
PLIES = tuple(f"plies/{name}" for name in (*IN_PLANE, *INTERLAMINAR))
FAILURE = ("failure", "exposures")  # groups of FAIL
HISTORY = "history"  # the group that is exported by default
BLOCK = 100_000  # lines per block


def dataset_csv_lines(
    result: Stored,
    name: str = HISTORY,
    note: Callable[[str], None] = lambda text: None,
    decimal: Decimal = "point",
) -> Iterator[str]:
    """Return the lines of one dataset such as ``tape3/w``, or of a group such as ``history``.

    The first line is the header. `note` receives a sentence about values that are not final. Raises
    ExportError if there is no such dataset or group, or if the datasets of the group differ in
    shape.
    """
    plain = name.strip("/")
    members = _members(result, plain)
    if plain.partition("/")[0] in FAILURE and result.still_in_contact:
        note(LOWER_BOUNDS)
    group = members[0].rpartition("/")[0]
    beside = [f"{group}/{column}" for column in CLOCK]
    clock = [path for path in beside if path in result and _in_rows(path)]
    values = [path for path in members if path not in clock]
    if clock and values and not any(map(_in_rows, values)):
        clock = []
    elif clock:
        values = list(filter(_in_rows, values))  # the others do not change
    if plain == "tape3":
        values = ["tape3/displacement"]  # w is one of its columns
    instants = [result[path] for path in clock]
    if not values:  # only step or time
        header = _headings(result, clock)
        rows = zip(*(times.tolist() for times in instants), strict=True)
        return csv_lines([header, *rows], decimal)
    values = [path for path in values if path not in LABELS.values()] or values
    arrays = [result[path] for path in values]
    if plain == "plies" and len(values) > len(PLIES):
        values = list(PLIES)
        *in_plane, xz, yz = (result[path] for path in values)
        # Interlaminar stresses are the same at every point of an element.
        whole = [np.broadcast_to(t[:, :, None, :, ::2], in_plane[0].shape) for t in (xz, yz)]
        arrays = in_plane + whole
    shape = arrays[0].shape
    if any(array.shape != shape for array in arrays):
        choice = f"choose {', '.join(values[:-1])} or {values[-1]}"
        raise ExportError(f"the datasets of {name} do not fit into one table; {choice}")
    dataset = schema.dataset_of(values[0], len(shape))
    sizes = shape if dataset is None else dataset.shape
    axes = list(zip(sizes, shape, strict=True))[bool(clock) :]
    columns = _headings(result, values)
    if len(values) == 1 and axes and len(names := NAMED.get(axes[-1][0], ())) >= axes[-1][1]:
        columns = _components(names[: axes.pop()[1]], result.unit(values[0]))
    keys = tuple(KEYS.get(str(size), "row") for size, _ in axes)
    numbers: list[Sequence[int]] = []  # along each axis: those that are stored, else from 1
    for size, length in axes:
        path = LABELS.get(str(size), "")
        numbers.append(result[path].tolist() if path in result else range(1, length + 1))
    header = (*_headings(result, clock), *keys, *columns)
    return csv_lines(itertools.chain([header], _rows(arrays, instants, numbers)), decimal)


def _members(result: Stored, name: str) -> list[str]:
    """Return the path of a dataset, or the paths of a group's datasets in the schema's order."""
    if name in result:
        return [name]
    if members := [path for path in result if path.startswith(f"{name}/")]:
        order = list(schema.DATASETS)
        return sorted(members, key=lambda path: order.index(path) if path in order else len(order))
    group = name.partition("/")[0]
    if stored_by(group) and not any(path.startswith(f"{group}/") for path in result):
        raise ExportError(f"the result has no {name}{remedy(name)}")
    raise ExportError(f"the result has no dataset {name}{suggestion(name, result)}")


def _headings(result: Stored, paths: Sequence[str]) -> tuple[str, ...]:
    """Return the names of datasets within their groups, with units."""
    return tuple(column_name(path.rpartition("/")[2], result.unit(path)) for path in paths)


def _components(names: Sequence[str], unit: str) -> tuple[str, ...]:
    """Return the names of the components of a dataset, with units.

    `unit` applies to all components, or lists them: ``mm (u, v, w), 1 (theta_x, theta_y)``.
    """
    units = units_of_columns(unit, names) or [unit] * len(names)
    return tuple(
        column_name(name, "" if of_name == "1" else of_name)
        for name, of_name in zip(names, units, strict=True)
    )


def _in_rows(path: str) -> bool:
    """Return whether the rows of a dataset in a group with step and time are instants."""
    return path not in schema.DATASETS or schema.DATASETS[path].shape[0] == "rows"


def _rows(
    arrays: Sequence[Array], clock: Sequence[Array], keys: Sequence[Sequence[int]]
) -> Iterator[tuple[float, ...]]:
    """Yield rows of arrays with the axes (instants, keys, columns), instants only with a clock."""
    if not clock:
        arrays = [array[None] for array in arrays]
    numbers = list(itertools.product(*keys))
    step = max(1, BLOCK // len(numbers))
    for start in range(0, len(arrays[0]), step):
        block = slice(start, start + step)
        instants = list(zip(*(times[block].tolist() for times in clock), strict=True))
        parts = [array[block] for array in arrays]
        tables = np.concatenate(
            [part.reshape(len(part), len(numbers), -1) for part in parts], axis=2
        ).tolist()
        for instant, rows in zip(instants or [()], tables, strict=True):
            for number, row in zip(numbers, rows, strict=True):
                yield (*instant, *number, *row)


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
        lack = "the result has no displacements (tape3), so there is no time step to export"
        if any(path.startswith("modes/") for path in result):
            raise ExportError(
                f"{lack}; natural modes are exported as csv, with the dataset modes/shape"
            )
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
        for fields in plate_fields(result, rows, note):
            _write_fields(root, len(steps), fields)


def _write_mesh(root: h5py.Group, result: Stored, times: Array) -> None:
    """Write the mesh once, and the times at which it has fields."""
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
    path: str,
    name: str,
    steps: int,
    shape: tuple[int, ...],
    *,
    constant: bool = False,
) -> Any:
    """Create a field with an array of `shape` per step, concatenated, or with a single array."""
    data = root.require_group(f"{path}Data")
    count = 1 if constant else steps
    dataset = data.create_dataset(name, (count * shape[0], *shape[1:]), "f8")
    offsets = np.arange(steps, dtype="i8") % count * shape[0]
    root.require_group(f"Steps/{path}DataOffsets")[name] = offsets
    if path == TIME:
        sizes = np.tile(np.array([1, shape[0]], dtype="i8"), (steps, 1))
        root.require_group("Steps/FieldDataSizes")[name] = sizes
    return dataset


def _write_fields(root: h5py.Group, steps: int, of: Fields) -> None:
    """Write point or cell data, step after step, or once if they are constant."""
    datasets = [
        (_field(root, of.at, name, steps, shape, constant=of.constant), shape[0])
        for name, shape in of.shapes.items()
    ]
    for number in range(1 if of.constant else steps):
        for (dataset, length), values in zip(datasets, of.of_step(number), strict=True):
            dataset[number * length : (number + 1) * length] = values


def _write_contact(root: h5py.Group, result: Stored, steps: Ints) -> None:
    """Write the contact at each step as field data; zero before the first step."""
    if "history/step" not in result:
        return
    rows = np.searchsorted(result["history/step"], steps)
    for name in CONTACT:
        values = np.concatenate((result[f"history/{name}"], [0.0]))
        at_step = np.where(steps > 0, values[np.minimum(rows, len(values) - 1)], 0.0)
        _field(root, TIME, name, len(steps), (1,))[:] = at_step


def _write_exposures(root: h5py.Group, result: Stored, steps: Ints) -> None:
    """Write the largest exposure so far by criterion as field data; zero before the first."""
    if any(f"exposures/{name}" not in result for name in ("step", "exposure")):
        return
    evaluations = np.searchsorted(result["exposures/step"], steps, side="right")
    criteria = criteria_of(result.attributes_of("failure"))
    for criterion, exposures in zip(criteria, result["exposures/exposure"].T, strict=False):
        if not np.isfinite(exposures).any():
            continue  # its strengths are not known
        so_far = np.concatenate(([0.0], exposures))[evaluations]
        _field(root, TIME, f"largest_{criterion}", len(steps), (1,))[:] = so_far


def dataframe(stored: Stored) -> pandas.DataFrame:
    """Return the history as a pandas DataFrame; see :meth:`fecm.Result.to_dataframe`."""
    try:
        import pandas  # optional
    except ImportError:
        raise ImportError("a DataFrame needs pandas: pip install pandas") from None
    members = [path for path in stored if path.startswith("history/")]
    if not members:
        raise NotStoredError("the result has no history: no impact step was taken")
    paths = [path for path in DATASETS if path in members]
    columns = {path.partition("/")[2]: stored[path] for path in dict.fromkeys(paths + members)}
    index = pandas.Index(columns.pop("time"), name="time")
    table = pandas.DataFrame(columns, index=index)
    table.attrs["units"] = {
        name: unit for name in ("time", *columns) if (unit := stored.unit(f"history/{name}"))
    }
    return table


def datatree(stored: Stored) -> xarray.DataTree:
    """Return the result as a tree of labelled arrays; see :meth:`fecm.Result.to_xarray`."""
    try:
        import xarray  # optional
    except ImportError:
        raise ImportError("a DataTree needs xarray: pip install 'fecm[xarray]'") from None
    groups: dict[str, dict[str, tuple[list[str], Array, dict[str, Sequence[str]]]]] = {}
    for path in stored:
        values = stored[path]
        dataset = dataset_of(path, values.ndim) or Dataset(path, values.shape, "")
        unit = stored.unit(path)
        columns = units_of_columns(unit, AXIS_NAMES.get(dataset.shape[-1], ())[: values.shape[-1]])
        texts = {
            "long_name": dataset.description,
            "units": "" if columns else unit,
            COLUMN_UNITS: columns,
        }
        attributes = {name: text for name, text in texts.items() if text}
        groups.setdefault(dataset.group, {})[dataset.name] = (
            _axis_names(dataset),
            values,
            attributes,
        )
    units = {"units": unit} if (unit := stored.unit("mesh/coordinates")) else {}
    places = {
        axis: ("node", values, units)
        for axis, values in zip(AXES, stored["mesh/coordinates"].T, strict=False)
    }
    unknowns = {"unknown": list(DOF_NAMES[: stored["mesh/equations"].shape[1]])}
    tree = {"/": xarray.Dataset(coords=unknowns, attrs=stored.attributes)}
    for name, variables in groups.items():
        at_nodes = any("node" in axes for axes, _, _ in variables.values())
        group_attributes = stored.attributes_of(name)
        tree[name] = xarray.Dataset(variables, places if at_nodes else {}, group_attributes)
    return xarray.DataTree.from_dict(tree)


def _axis_names(dataset: Dataset) -> list[str]:
    """Return the names of the axes: scales of the file, or else the dataset with a number."""
    names = {"rows": "time", **{size: name for size, (name, _) in SCALES.items()}}
    return [
        names.get(str(size), f"{dataset.name}_{axis}") for axis, size in enumerate(dataset.shape)
    ]


def pyvista_grid(stored: Stored, time: float | str | None) -> pyvista.UnstructuredGrid:
    """Return the plate with its displacements at a time; see :meth:`fecm.Result.to_pyvista`."""
    try:
        import pyvista  # optional
    except ImportError:
        raise ImportError("a grid needs PyVista: pip install 'fecm[pyvista]'") from None

    if "tape3/w" not in stored:
        raise NotStoredError("there are no displacements (tape3) in this result; add DISP")
    (row,) = (
        [-1]
        if time is None
        else rows_at(stored["tape3/time"], stored.times_of(time), "displacements")
    )
    connectivity, offsets, types = vtk_cells(stored["mesh/elements"])
    cells = np.insert(connectivity, offsets[:-1], np.diff(offsets))
    grid: Any = pyvista.UnstructuredGrid(cells, types, vtk_points(stored))
    notes = [*stored.notes]
    for fields in plate_fields(stored, np.array([row]), notes.append):
        data = grid.point_data if fields.at is At.POINTS else grid.cell_data
        for name, values in zip(fields.shapes, fields.of_step(0), strict=True):
            data[name] = values
    grid.field_data["time"] = [stored["tape3/time"][row]]
    if notes:
        grid.field_data["notes"] = notes
    return grid


class ExportFormat(StrEnum):
    """Format of another program."""

    VTKHDF = "vtkhdf"
    CSV = "csv"


def format_of(path: Path, to: str | None) -> ExportFormat:
    """Return the format of this name, or of the file's suffix.

    Raises ExportError if there is no such format.
    """
    name = path.suffix.lower().removeprefix(".") if to is None else to
    try:
        return ExportFormat(name)
    except ValueError:
        formats = " and ".join(ExportFormat)
        raise ExportError(
            f"{path}: {name!r} is not a format of exports; known are {formats}"
        ) from None


def export_result(
    result: Stored,
    path: Path,
    form: ExportFormat,
    dataset: str,
    note: Callable[[str], None],
    *,
    overwrite: bool,
    decimal: Decimal = "point",
) -> None:
    """Write a result; as CSV, one of its datasets or groups; see :meth:`fecm.Result.export`.

    `note` receives a sentence about what is exported incompletely, or is not final.
    """
    check_outputs([path], overwrite)
    if form is ExportFormat.VTKHDF:
        if dataset:
            raise ExportError("a dataset is chosen for csv; vtkhdf holds all fields")
        write_vtkhdf(result, path, note, overwrite=overwrite)
        return
    lines = dataset_csv_lines(result, dataset or HISTORY, note, decimal)
    with open_for_writing(path, overwrite=overwrite) as file:
        file.writelines(lines)
