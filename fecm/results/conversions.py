"""A result as objects of pandas, xarray and PyVista."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from fecm._typing import Array
from fecm.deck.mesh_cards import AXES, DOF_NAMES
from fecm.results.errors import NotStoredError
from fecm.results.plies import rows_at
from fecm.results.schema import DATASETS, SCALES, Dataset, dataset_of
from fecm.results.stored import Stored
from fecm.results.vtk_cells import vtk_cells, vtk_points

if TYPE_CHECKING:
    import pandas
    import pyvista
    import xarray


def dataframe(stored: Stored) -> pandas.DataFrame:
    """The history as a pandas DataFrame; see :meth:`fecm.Result.to_dataframe`."""
    try:
        import pandas  # optional
    except ImportError:
        raise ImportError("a DataFrame needs pandas: pip install pandas") from None
    members = [path for path in stored if path.startswith("history/")]
    if not members:
        raise NotStoredError("the result has no history: no impact step was taken")
    known = [path for path in DATASETS if path in members]
    columns = {path.partition("/")[2]: stored[path] for path in dict.fromkeys(known + members)}
    index = pandas.Index(columns.pop("time"), name="time")
    table = pandas.DataFrame(columns, index=index)
    table.attrs["units"] = {
        name: unit for name in ("time", *columns) if (unit := stored.unit(f"history/{name}"))
    }
    return table


def datatree(stored: Stored) -> xarray.DataTree:
    """The result as a tree of labelled arrays; see :meth:`fecm.Result.to_xarray`."""
    try:
        import xarray  # optional
    except ImportError:
        raise ImportError("a DataTree needs xarray: pip install 'fecm[xarray]'") from None
    groups: dict[str, dict[str, tuple[list[str], Array, dict[str, str]]]] = {}
    for path in stored:
        values = stored[path]
        dataset = dataset_of(path, values.ndim) or Dataset(path, values.shape, "")
        texts = {"long_name": dataset.description, "units": stored.unit(path)}
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
        own = stored.attributes_of(name)
        tree[name] = xarray.Dataset(variables, places if at_nodes else {}, own)
    return xarray.DataTree.from_dict(tree)


def _axis_names(dataset: Dataset) -> list[str]:
    """Names of the axes: those of the file's scales, else that of the dataset with a number."""
    names = {"rows": "time", **{size: name for size, (name, _) in SCALES.items()}}
    return [
        names.get(str(size), f"{dataset.name}_{axis}") for axis, size in enumerate(dataset.shape)
    ]


def grid(stored: Stored, time: float | None) -> pyvista.UnstructuredGrid:
    """The plate with its displacements at a time; see :meth:`fecm.Result.to_pyvista`."""
    try:
        import pyvista  # optional
    except ImportError:
        raise ImportError("a grid needs PyVista: pip install 'fecm[pyvista]'") from None
    from fecm.results.plate_fields import At, fields  # 5 ms, which other uses of results save

    if "tape3/w" not in stored:
        raise NotStoredError("there are no displacements (tape3) in this result; add DISP")
    (row,) = [-1] if time is None else rows_at(stored["tape3/time"], [time], "displacements")
    connectivity, offsets, types = vtk_cells(stored["mesh/elements"])
    cells = np.insert(connectivity, offsets[:-1], np.diff(offsets))
    made: Any = pyvista.UnstructuredGrid(cells, types, vtk_points(stored))
    notes = [*stored.notes]
    for one in fields(stored, np.array([row]), notes.append):
        data = made.point_data if one.at is At.POINTS else made.cell_data
        for name, values in zip(one.shapes, one.of_step(0), strict=True):
            data[name] = values
    made.field_data["time"] = [stored["tape3/time"][row]]
    if notes:
        made.field_data["notes"] = notes
    return made
