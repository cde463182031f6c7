"""Maps of a sweep over two parameters: cells with contour lines, or coloured points."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.colors import BoundaryNorm, Normalize
from matplotlib.ticker import MaxNLocator

from fecm.plot import style
from fecm.plot.map_contents import LEVEL_COLOUR, RING, THRESHOLD, Contents, Graph, Grid, grid_of
from fecm.plot.sweep_data import Variable

if TYPE_CHECKING:
    from matplotlib import collections
    from matplotlib.axes import Axes

MANY = 10_000  # more cells or points are stored as an image in vector formats
CONTOUR_LINES = 8  # approximately
SHADES = 256  # of a colour map
LEVEL_WIDTH = 1.2
# Looks of the contour lines of levels, and of the numbers on contour lines.
CONTOUR: style.Look = {
    "colors": LEVEL_COLOUR,
    "linestyles": [style.DASHED],
    "linewidths": LEVEL_WIDTH,
}
NUMBER: style.Look = {"fontsize": 6.0, "inline_spacing": 2}


def draw_field(graph: Graph, contents: Contents) -> None:
    """Draw the quantity by colours: cells if the cases form a full grid, else points."""
    graph.label()
    levels = [level.value for level in contents.levels]
    grid = grid_of(graph.x, graph.y, contents.shown.values)
    if grid is None:
        _draw_points(graph, contents.shown, levels)
    else:
        _draw_cells(graph.axes, grid, contents.shown, levels, in_rows=bool(graph.y.ticks))


def _draw_cells(
    axes: Axes, grid: Grid, shown: Variable, levels: Collection[float], *, in_rows: bool
) -> None:
    """Draw one cell per case, with contour lines unless the rows are texts."""
    drawn = axes.pcolormesh(
        *grid,
        shading="nearest",
        cmap=style.SEQUENTIAL,
        norm=norm_of(shown),
        edgecolor="face",
        linewidth=0.1,
        rasterized=grid.values.size > MANY,
    )
    draw_bar(axes, drawn, shown, levels)
    if in_rows:
        for level in levels:
            _mark_crossings(axes, grid, level)
        return

    low, high = float(grid.values.min()), float(grid.values.max())
    form = style.Multiple(shown.scale.factor)
    if not shown.whole and low < high:
        ticks = MaxNLocator(CONTOUR_LINES).tick_values(low, high)
        apart = 0.3 * np.diff(ticks).min()  # the numbers of near lines would collide
        inner = [
            tick
            for tick in ticks
            if low < tick < high and all(abs(tick - level) > apart for level in levels)
        ]
        lines = axes.contour(*grid, inner, colors="white", linewidths=0.5)
        axes.clabel(lines, fmt=form, **NUMBER)
    inside = sorted({level for level in levels if low < level < high})
    if inside:
        lines = axes.contour(*grid, inside, **CONTOUR)
        axes.clabel(lines, colors="white", fmt=form, **NUMBER)


def _mark_crossings(axes: Axes, grid: Grid, level: float) -> None:
    """Mark where a row crosses a level, interpolated linearly between cases."""
    x = grid.x
    for row, values in zip(grid.y, grid.values.filled(np.nan) - level, strict=True):
        before, after = values[:-1], values[1:]
        passed = np.isfinite(before + after) & ((before < 0.0) != (after < 0.0))
        share = before[passed] / (before[passed] - after[passed])
        at = x[:-1][passed] + share * np.diff(x)[passed]
        axes.vlines(at, row - 0.5, row + 0.5, color=LEVEL_COLOUR, linewidth=LEVEL_WIDTH)


def _draw_points(graph: Graph, shown: Variable, levels: Collection[float]) -> None:
    """Draw one coloured point per case; those above the lowest level have an edge."""
    fine = np.isfinite(shown.values)
    values = shown.values[fine]
    drawn = graph.axes.scatter(
        graph.x.values[fine],
        graph.y.values[fine],
        c=values,
        s=14.0,
        cmap=style.SEQUENTIAL,
        norm=norm_of(shown),
        linewidths=0.0,
        rasterized=len(values) > MANY,
    )
    if levels:
        drawn.set_linewidth(np.where(values >= min(levels), 0.9, 0.0).tolist())
        drawn.set_edgecolor(LEVEL_COLOUR)
    draw_bar(graph.axes, drawn, shown, levels)


def norm_of(shown: Variable) -> Normalize:
    """Colour scale of the values; counts have one colour each."""
    low, high = shown.range
    if shown.whole and high - low < SHADES - 1:
        return BoundaryNorm(np.arange(low - 0.5, high + 1.0), SHADES)
    return Normalize(low, high)


def draw_bar(
    axes: Axes, drawn: collections.Collection, shown: Variable, levels: Collection[float]
) -> None:
    """Draw the colour bar, with lines at levels."""
    locator = MaxNLocator(6, integer=shown.whole)
    bar = style.colour_bar(axes, drawn, shown.scale, shown.label, locator)
    low, high = drawn.get_clim()
    for level in levels:
        if low <= level <= high:
            bar.ax.axvline(level, color=LEVEL_COLOUR, linewidth=1.5)


def mark_thresholds(graph: Graph, contents: Contents) -> None:
    """Mark the delamination thresholds of cases whose plates differ."""
    axes, x, y = graph.axes, graph.x, graph.y
    above = contents.shown.values - contents.thresholds
    grid = grid_of(x, y, above)
    if grid is None:
        at = above >= 0.0
        axes.plot(x.values[at], y.values[at], "o", label=f"from {THRESHOLD} on", **RING)
    elif grid.values.min() < 0.0 < grid.values.max():
        if y.ticks:
            _mark_crossings(axes, grid, 0.0)
        else:
            axes.contour(*grid, [0.0], **CONTOUR)
        name_level(graph, THRESHOLD)


def name_level(graph: Graph, text: str) -> None:
    """Name the lines of a level in the legend."""
    line = style.SOLID if graph.y.ticks else style.DASHED
    graph.axes.plot([], [], color=LEVEL_COLOUR, ls=line, lw=LEVEL_WIDTH, label=text)


def name_levels(graph: Graph, contents: Contents) -> list[str]:
    """Name levels in the legend; return the note of a threshold that no colour reaches."""
    shown, notes = contents.shown, []
    low, high = shown.range
    in_cells = grid_of(graph.x, graph.y, shown.values) is not None
    lowest = min((level.value for level in contents.levels), default=0.0)
    for level in contents.levels:
        text = f"{level.name} {shown.scale.show(level.value)}"
        inside = low < level.value < high
        if inside and in_cells:
            name_level(graph, text)
        elif inside and level.value == lowest:
            graph.axes.plot([], [], "o", label=f"from {text} on", **RING)
        elif not inside and level.is_threshold:
            side = "below" if high <= level.value else "above"
            notes.append(f"all values of {shown.name} are {side} the {text}")
    return notes
