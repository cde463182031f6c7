"""Results as objects of other libraries: xarray and PyVista."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from fecm.results.plies import rows_at
from fecm.results.schema import AXIS_NAMES, DATASETS, SCALES, Dataset, NotStoredError
from fecm.results.vtkhdf import vtk_cells

if TYPE_CHECKING:
    import pyvista
    import xarray

    from fecm.results.result import Result


def to_xarray(result: Result) -> xarray.DataTree:
    """Build a tree of a result's groups: see :meth:`fecm.Result.to_xarray`."""
    try:
        import xarray
    except ImportError:
        raise ImportError("a DataTree needs xarray: pip install 'fecm[xarray]'") from None
    groups: dict[str, dict[str, Any]] = {}
    for path in result:
        values = result[path]
        known = DATASETS.get(path, Dataset(path, values.shape, ""))
        texts = {"long_name": known.description, "units": result.unit(known.dimension)}
        axes = [
            "time" if size == "rows" else SCALES.get(str(size), (f"{known.name}_{n}",))[0]
            for n, size in enumerate(known.shape)
        ]
        attributes = {name: text for name, text in texts.items() if text}
        groups.setdefault(known.group, {})[known.name] = (axes, values, attributes)
    units = {"units": unit} if (unit := result.unit("length")) else {}
    places = {
        axis: ("node", values, units)
        for axis, values in zip(AXIS_NAMES["ndm"], result["mesh/coordinates"].T, strict=False)
    }
    unknowns = {"unknown": list(AXIS_NAMES["ndf"][: result["mesh/equations"].shape[1]])}
    tree = {}
    for name, variables in groups.items():
        at_nodes = any("node" in axes for axes, _, _ in variables.values())
        attributes = result.attributes_of(name)
        tree[name] = xarray.Dataset(variables, places if at_nodes else {}, attributes)
    root = xarray.Dataset(coords=unknowns, attrs=result.attributes)
    return xarray.DataTree.from_dict({"/": root, **tree})


def to_pyvista(result: Result, time: float | None) -> pyvista.UnstructuredGrid:
    """Build a grid with the displacements of a time: see :meth:`fecm.Result.to_pyvista`."""
    try:
        import pyvista
    except ImportError:
        raise ImportError("a grid needs PyVista: pip install 'fecm[pyvista]'") from None
    if "tape3/w" not in result:
        raise NotStoredError("there are no displacements (tape3) in this result; add DISP")
    (row,) = [-1] if time is None else rows_at(result["tape3/time"], [time], "displacements")
    connectivity, offsets, types = vtk_cells(result["mesh/elements"])
    points = np.zeros((len(result["mesh/coordinates"]), 3))
    points[:, :2] = result["mesh/coordinates"][:, :2]
    cells = np.insert(connectivity, offsets[:-1], np.diff(offsets))
    grid = pyvista.UnstructuredGrid(cells, types, points)
    field = result["tape3/displacement"][row]
    grid.point_data["displacement"] = field[:, :3]
    grid.point_data["w"], grid.point_data["rotation"] = field[:, 2], field[:, 3:]
    grid.field_data["time"] = [result["tape3/time"][row]]
    return grid
