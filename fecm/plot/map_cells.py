"""Cells of a map over two parameters: their grid, hatched areas, and lines of equal energy."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from matplotlib.patches import PathPatch
from matplotlib.path import Path
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator

from fecm._typing import Array, Bools, Floats
from fecm.deck.units import quantity, unit_of
from fecm.plot import style
from fecm.plot.sweep_data import DrawnVariable
from fecm.results.metrics import FACTOR
from fecm.sweeps.result import SweepResult

if TYPE_CHECKING:
    from matplotlib.axes import Axes

HATCHING: style.Look = {"fill": False, "hatch": "////", "ec": "0.25", "lw": 0.0, "zorder": 1.5}
FINE = 100  # points along each axis of a field of energies
ENERGY_LINES = 6  # approximate number
ENERGY: style.Look = {"colors": "black", "linestyles": [style.DOTTED], "linewidths": 0.9}
ENERGY_LABEL = {"fontsize": 6.0, "inline_spacing": 2}


class ValueGrid(NamedTuple):
    """Quantity on a full grid of two parameters."""

    x: Array  # (nx,), ascending
    y: Array  # (ny,), ascending
    values: np.ma.MaskedArray[tuple[int, ...], np.dtype[np.float64]]  # (ny, nx); masked: no value


def value_grid(x: DrawnVariable, y: DrawnVariable, values: Floats) -> ValueGrid | None:
    """Return the values of all cases as a full grid; None if the cases do not form one."""
    columns, column = np.unique(x.values, return_inverse=True)
    rows, row = np.unique(y.values, return_inverse=True)
    places = row * len(columns) + column
    if not np.array_equal(np.sort(places), np.arange(len(columns) * len(rows))):
        return None
    ordered = values[np.argsort(places)].reshape(len(rows), len(columns))
    return ValueGrid(columns, rows, np.ma.masked_invalid(ordered))


def hatch(axes: Axes, x: DrawnVariable, y: DrawnVariable, marked: Bools) -> bool:
    """Hatch the cells of the marked cases as one area; return whether the cases have cells."""
    grid = value_grid(x, y, marked.astype(float))
    if grid is None:
        return False
    columns, rows = _edges(grid.x), _edges(grid.y)
    cells = []
    for row, column in np.argwhere(grid.values == 1.0).tolist():
        left, right, low, high = *columns[column : column + 2], *rows[row : row + 2]
        corners = [(left, low), (right, low), (right, high), (left, high), (left, low)]
        cells.append(Path(corners, closed=True))
    axes.add_patch(PathPatch(Path.make_compound_path(*cells), **HATCHING))
    return True


def _edges(centres: Array) -> Floats:
    """Return the edges of cells, midway between ascending centres."""
    half = 0.5 * np.diff(centres)
    ends = [centres[0] - half[0], *(centres[:-1] + half), centres[-1] + half[-1]]
    return np.asarray(ends, float)


def draw_equal_energies(axes: Axes, sweep: SweepResult, x: DrawnVariable, y: DrawnVariable) -> bool:
    """Draw lines of equal impact energy on a map over mass and velocity; False for other maps."""
    masses = [v for v in (x, y) if v.name in ("mass", "rod_mass")]
    velocities = [v for v in (x, y) if v.name == "velocity"]
    if not (masses and velocities):
        return False
    across, up = (np.linspace(*ends, FINE) for ends in (axes.get_xlim(), axes.get_ylim()))
    mass, velocity = (across, up[:, None]) if x is masses[0] else (up[:, None], across)
    parts = float(sweep[FACTOR].max()) if FACTOR in sweep else 1.0  # of a symmetric plate
    energy = 0.5 * parts * mass * velocity**2
    unit = unit_of("force*length", sweep.units)
    levels = MaxNLocator(ENERGY_LINES).tick_values(0.0, float(energy.max()))
    inner = [level for level in levels if energy.min() < level < energy.max()]
    lines = axes.contour(across, up, energy, inner, **ENERGY)
    for label in axes.clabel(lines, fmt=lambda level: quantity(float(level), unit), **ENERGY_LABEL):
        label.set_path_effects([withStroke(linewidth=1.5, foreground="white")])
    axes.plot([], [], color="black", ls=style.DOTTED, lw=0.9, label="equal energy")
    return True
