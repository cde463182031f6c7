"""Elements as the cells of VTK."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fecm._typing import Array, Floats
from fecm.results.stored import Stored

Ints = NDArray[np.int64]

CORNERS = 4
# VTK's cell types (vtkCellType.h) of elements with 3, 4, 8 or 9 nodes.
TYPES = {3: 5, 4: 9, 8: 23, 9: 28}


def vtk_points(stored: Stored) -> Floats:
    """Places x, y and z of the nodes at rest, (numnp, 3); z is 0 on a flat plate."""
    coordinates = stored["mesh/coordinates"][:, :2]
    points = np.zeros((len(coordinates), 3))
    points[:, : coordinates.shape[1]] = coordinates
    if "mesh/z" in stored:
        points[:, 2] = stored["mesh/z"]
    return points


def vtk_cells(elements: Array) -> tuple[Ints, Ints, Ints]:
    """Connectivity, offsets and types; elements that VTK lacks are reduced to corners."""
    count = np.cumprod(elements > 0, axis=1).sum(axis=1)  # nodes before the first absent one
    whole = (count == (elements > 0).sum(axis=1)) & np.isin(count, list(TYPES))
    used = np.where(whole, count, np.minimum(count, CORNERS))
    connectivity = elements[np.arange(elements.shape[1]) < used[:, None]] - 1
    types = np.array([TYPES[int(n)] for n in used])
    return connectivity.astype("i8"), np.concatenate(([0], np.cumsum(used))), types
