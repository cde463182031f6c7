"""Pictures of the plate's deflection, along a line and from above (the report's figure 4.20)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import matplotlib
import numpy as np
from matplotlib.colors import Normalize
from matplotlib.ticker import MaxNLocator
from matplotlib.tri import LinearTriInterpolator, Triangulation

from fecm._typing import Array, Floats
from fecm.mechanics.mesh import longest_sides
from fecm.plot import data, style
from fecm.plot.kinds import Direction, Picture, PlotError, Width
from fecm.results.result import Result

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Results = Mapping[str, Result]

AXES: dict[Direction, int] = {"x": 0, "y": 1}
SAMPLES = 401
LEVELS = 21


def aspect(points: Floats) -> float:
    """Height over width of the plate's picture, from its points (n, 2)."""
    wide, high = np.ptp(points, axis=0)
    return float(np.clip(high / wide, 0.3, 2.0))


def draw_circle(axes: Axes, result: Result, name: str, **look: Any) -> None:
    """Draw the circle of the contact patch, if there is one, on axes of x and y."""
    if (found := data.circle(result, name)) is not None:
        centre, radius = found
        angle = np.linspace(0.0, 2.0 * np.pi, 73)
        x, y = centre[:, None] + radius * np.stack([np.cos(angle), np.sin(angle)])
        axes.plot(x, y, lw=0.7, **look)


def mark_impact(axes: Axes, result: Result, name: str) -> None:
    """Mark the impact point and the contact patch in black."""
    axes.plot(*data.struck(result, name).T, "+", color="black", ms=4, mew=0.6, clip_on=False)
    draw_circle(axes, result, name, color="black")


def profile(result: Result, name: str, along: Direction, rows: Array) -> tuple[Floats, Floats]:
    """Deflection on a line through the impact point along x or y, at some rows of tape3.

    Returns the positions, (n,), and w, (rows, n), of the nodes on the line if they cover it, else
    of equidistant points.
    """
    coordinates, w = result["mesh/coordinates"], result["tape3/w"][rows]
    axis, across = AXES[along], 1 - AXES[along]
    level = data.impact_point(result, name)[across]
    extent = float(np.ptp(coordinates[:, axis]))
    on = np.flatnonzero(np.abs(coordinates[:, across] - level) <= 1e-6 * extent)
    on = on[np.argsort(coordinates[on, axis])]
    cut = data.patches(result, 4, name)
    # The ends of the plate on the line, from its intersections with sides of quadrilaterals.
    corners = cut.points[cut.quads]
    ends = np.roll(corners, -1, axis=1)
    a, b = corners[..., across] - level, ends[..., across] - level
    crossed = (a * b <= 0.0) & (a != b)
    share = a[crossed] / (a[crossed] - b[crossed])
    at = corners[crossed][:, axis] + share * (ends[crossed] - corners[crossed])[:, axis]
    position = np.linspace(at.min(), at.max(), SAMPLES)
    inside = coordinates[on, axis]
    sides = np.diff(inside).max() if len(on) > 2 else math.inf
    longest = longest_sides(result["mesh/elements"], coordinates).max()
    if sides <= 2.0 * longest and np.isclose(np.ptp(inside), np.ptp(position)):
        return inside, w[:, on]
    points = np.empty((2, SAMPLES))
    points[axis], points[across] = position, level
    triangles = Triangulation(cut.points[:, 0], cut.points[:, 1], cut.triangles)
    values = [LinearTriInterpolator(triangles, cut.values(row))(*points) for row in w]
    return position, np.ma.filled(np.ma.stack(values), np.nan)


def line(
    results: Results,
    *,
    times: Sequence[float] = (),
    along: Direction = "x",
    width: Width = "column",
) -> Picture:
    """Deflection along a line through the impact point; of several results, one graph per time.

    Drawn are the stored rows nearest to `times` (the deck's unit), by default a few, in the
    direction `along`.
    """
    drawn = {}
    for name, result in results.items():
        data.require(result, name, "tape3/w")
        rows = data.stored_rows(result, name, times, 6 if len(results) == 1 else 3)
        drawn[name] = (result["tape3/time"][rows], *profile(result, name, along, rows))
    style.limit_count(len(drawn), "results")
    instants = [stored for stored, _, _ in drawn.values()]
    if len({len(stored) for stored in instants}) > 1:
        raise PlotError("the results differ in the number of stored rows; give --times")
    clock = style.scale_of(results, "time", instants)
    place = style.scale_of(results, "length", [position for _, position, _ in drawn.values()])
    length = style.scale_of(results, "length", [w for _, _, w in drawn.values()])
    if len(drawn) == 1:
        figure, axes = style.panels(width)
        ((stored, position, w),) = drawn.values()
        shades = matplotlib.colormaps[style.SEQUENTIAL](np.linspace(0.0, 0.85, len(stored)))
        for time, values, shade in zip(stored, w, shades, strict=True):
            axes[0].plot(position, values, color=shade, label=f"{clock.factor * time:.4g}")
    else:
        figure, axes = style.panels(width, len(instants[0]), sharex=True, sharey=True, tall=0.6)
        looks = zip(drawn.items(), style.colours(), strict=False)
        for (name, (stored, position, w)), colour in looks:
            for ax, time, values in zip(axes, stored, w, strict=True):
                ax.plot(position, values, color=colour, label=name)
                ax.set_title(f"time {clock.show(time)}", loc="left")
    style.lines_legend(figure, axes[0], clock.label("Time") if len(drawn) == 1 else "")
    for ax in axes:
        length.name(ax.yaxis, "Deflection")
        ax.margins(x=0.0)
    place.name(axes[-1].xaxis, f"${along}$")
    return Picture(figure)


def contour(results: Results, *, times: Sequence[float] = (), width: Width = "column") -> Picture:
    """Deflection of the plate at given times, seen from above, on one colour scale."""
    ((name, result),) = results.items()
    data.require(result, name, "tape3/w")
    rows = data.stored_rows(result, name, times, 4)
    cut, w = data.patches(result, 4, name), result["tape3/w"][rows]
    clock = style.scale_of(results, "time", [result["tape3/time"][rows]])
    length = style.scale_of(results, "length", [w])
    place = style.scale_of(results, "length", [cut.points])
    columns = min(len(rows), 2 if width == "column" else 4)
    lines = math.ceil(len(rows) / columns)
    words = 0.7 + 0.3 * lines  # height of colour bar, titles and the name of x (in)
    ratio = aspect(cut.points) + words * columns / lines / style.WIDTHS[width]
    figure, axes = style.panels(width, lines, columns, sharex=True, sharey=True, ratio=ratio)
    fields = [cut.values(row) for row in w]
    peak = float(np.abs(fields).max()) or 1.0  # may exceed the nodal values
    levels = MaxNLocator(LEVELS).tick_values(np.min(fields), np.max(fields))
    triangles = Triangulation(cut.points[:, 0], cut.points[:, 1], cut.triangles)
    fills = []
    for ax, row, values in zip(axes, rows, fields, strict=False):
        norm = Normalize(-peak, peak)
        fills.append(ax.tricontourf(triangles, values, levels, cmap=style.DIVERGING, norm=norm))
        fills[-1].set(edgecolor="face", linewidth=0.2)  # hides white seams
        mark_impact(ax, result, name)
        ax.set_title(f"time {clock.show(float(result['tape3/time'][row]))}", loc="left")
        ax.set_aspect("equal")
    for ax in axes[-columns:]:
        place.name(ax.xaxis, "$x$")
    for ax in axes[::columns]:
        place.name(ax.yaxis, "$y$")
    for ax in axes[len(rows) :]:
        ax.set_axis_off()
    style.colour_bar(axes, fills[0], length, "Deflection", MaxNLocator(6), aspect=40, shrink=0.8)
    return Picture(figure)
