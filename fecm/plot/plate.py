"""Pictures of the plate's deflection: along a line, from above, in three dimensions, animated."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, cast

import matplotlib
import numpy as np
from matplotlib.colors import Normalize
from matplotlib.ticker import MaxNLocator
from matplotlib.tri import LinearTriInterpolator, Triangulation
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from fecm._typing import Array, Floats
from fecm.mechanics.mesh import longest_sides
from fecm.plot import data, style
from fecm.plot.kinds import Direction, Picture, PlotError, Width
from fecm.results.result import Result

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.text import Text
    from mpl_toolkits.mplot3d.axes3d import Axes3D


Results = Mapping[str, Result]

AXES: dict[Direction, int] = {"x": 0, "y": 1}
SAMPLES = 401
LEVELS = 21


def aspect(points: Floats) -> float:
    """Return height over width of the plate's picture, from points of the plate, (n, 2)."""
    wide, high = np.ptp(points, axis=0)
    return float(np.clip(high / wide, 0.3, 2.0))


def draw_circle(axes: Axes, result: Result, name: str, **look: Any) -> None:
    """Draw the circle of the contact patch, if there is one, on axes of x and y."""
    if (patch := data.circle(result, name)) is not None:
        centre, radius = patch
        angle = np.linspace(0.0, 2.0 * np.pi, 73)
        x, y = centre[:, None] + radius * np.stack([np.cos(angle), np.sin(angle)])
        axes.plot(x, y, lw=0.7, **look)


def mark_impact(axes: Axes, result: Result, name: str) -> None:
    """Mark the impact point and the contact patch in black."""
    axes.plot(*data.struck(result, name).T, "+", color="black", ms=4, mew=0.6, clip_on=False)
    draw_circle(axes, result, name, color="black")


def profile(result: Result, name: str, along: Direction, rows: Array) -> tuple[Floats, Floats]:
    """Return positions on a line through the impact point, and the deflection at rows of tape3.

    The line is along x or y. The deflection is (rows, positions).
    """
    coordinates, w = result["mesh/coordinates"], result["tape3/w"][rows]
    axis, across = AXES[along], 1 - AXES[along]
    level = data.impact_point(result, name)[across]
    extent = float(np.ptp(coordinates[:, axis]))
    nodes = np.flatnonzero(np.abs(coordinates[:, across] - level) <= 1e-6 * extent)
    nodes = nodes[np.argsort(coordinates[nodes, axis])]
    cut = data.patches(result, 4, name)
    # The line ends at the outermost intersections with sides of quadrilaterals.
    corners = cut.points[cut.quads]
    ends = np.roll(corners, -1, axis=1)
    a, b = corners[..., across] - level, ends[..., across] - level
    crossed = (a * b <= 0.0) & (a != b)
    share = a[crossed] / (a[crossed] - b[crossed])
    positions = corners[crossed][:, axis] + share * (ends[crossed] - corners[crossed])[:, axis]
    position = np.linspace(positions.min(), positions.max(), SAMPLES)
    inside = coordinates[nodes, axis]
    sides = np.diff(inside).max() if len(nodes) > 2 else math.inf
    longest = longest_sides(result["mesh/elements"], coordinates).max()
    if sides <= 2.0 * longest and np.isclose(np.ptp(inside), np.ptp(position)):
        return inside, w[:, nodes]
    points = np.empty((2, SAMPLES))
    points[axis], points[across] = position, level
    triangles = Triangulation(cut.points[:, 0], cut.points[:, 1], cut.triangles)
    values = [LinearTriInterpolator(triangles, cut.values(row))(*points) for row in w]
    return position, np.ma.filled(np.ma.stack(values), np.nan)


def line_picture(
    results: Results,
    *,
    times: Sequence[float] = (),
    along: Direction = "x",
    width: Width = "column",
) -> Picture:
    """Draw the deflection along a line through the impact point.

    The line is in the direction `along`. Several results have one graph per time. The picture shows
    the stored rows nearest to `times` (the deck's unit), by default a few.
    """
    drawn = {}
    for name, result in results.items():
        data.require_datasets(result, name, "tape3/w")
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
    """Draw the deflection of the plate at given times, seen from above, on one colour scale."""
    ((name, result),) = results.items()
    data.require_datasets(result, name, "tape3/w")
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


Show = Callable[[int], None]  # shows a row of tape3

FRAMES = 60
EXAGGERATION = 0.3  # height of the deflected plate over its longer side
ON_PANEL = 0.15  # height of the deflection drawn on a curved panel, over its longer side


def surface_picture(
    results: Results, *, times: Sequence[float] = (), width: Width = "column"
) -> Picture:
    """Draw the deflected plate, by default when its deflections differ most."""
    ((name, result),) = results.items()
    (w,) = data.require_datasets(result, name, "tape3/w")
    largest = np.array([int(np.ptp(w, axis=1).argmax())])
    rows = data.stored_rows(result, name, times, 1) if times else largest
    clock = style.scale_of(results, "time", [result["tape3/time"]])
    figure, shows = _plates(results, width, rows, len(rows), clock)
    for show, row in zip(shows, rows, strict=True):
        show(row)
    return Picture(figure)


def animation(results: Results, *, times: Sequence[float] = (), width: Width = "column") -> Picture:
    """Draw the deflected plate, frame by frame; the figure shows the last frame."""
    ((name, result),) = results.items()
    data.require_datasets(result, name, "tape3/w")
    rows = data.stored_rows(result, name, times, FRAMES)
    clock = style.scale_of(results, "time", [result["tape3/time"][rows]])
    figure, (show,) = _plates(results, width, rows, 1, clock)
    show(rows[-1])
    return Picture(figure, [functools.partial(show, row) for row in rows])


def _plates(
    results: Results, width: Width, rows: Array, count: int, clock: style.AxisScale
) -> tuple[Figure, list[Show]]:
    """Draw `count` plates at rest, on the common scale of all rows.

    Returns a function for each plate that shows a row on it.
    """
    ((name, result),) = results.items()
    cut, w = data.patches(result, 2, name), result["tape3/w"]
    stored = w[rows]
    place = style.scale_of(results, "length", [cut.points])
    length = style.scale_of(results, "length", [stored])
    low, high = float(stored.min()), float(stored.max())
    rest, factor = _at_rest(result, name, cut, max(abs(low), abs(high)))
    columns = 1 if width == "column" else min(count, 2)
    lines = math.ceil(count / columns)
    figure, plate_axes = style.panels(width, lines, columns, ratio=0.7, projection="3d")
    axes = cast("list[Axes3D]", plate_axes)
    for ax in axes[count:]:
        ax.set_axis_off()

    def show(plate: Poly3DCollection, title: Text, row: int) -> None:
        deflection = cut.values(w[row])[cut.quads]
        heights = rest[cut.quads] + factor * deflection
        plate.set_verts(np.dstack([cut.points[cut.quads], heights]))
        plate.set_array(deflection.mean(axis=1))
        title.set_text(f"time {clock.show(float(result['tape3/time'][row]))}")

    plates: list[Poly3DCollection] = []
    shows: list[Show] = []
    for ax in axes[:count]:
        plate = _draw_at_rest(ax, cut, low, high)
        title = ax.text2D(0.03, 0.94, "", transform=ax.transAxes)
        _label(ax, place, length)
        if "mesh/z" in result:
            _show_shape(ax, cut, rest, factor * np.array([min(low, 0.0), max(high, 0.0)]))
            ax.text2D(0.03, 0.87, f"deflection times {factor:g}", transform=ax.transAxes)
        plates.append(plate)
        shows.append(functools.partial(show, plate, title))
    bar = style.colour_bar(
        axes,
        plates[0],
        length,
        "Deflection",
        MaxNLocator(5),
        shrink=0.6,
        pad=0.0,
        fraction=0.06,
        aspect=30 * columns,
    )
    if low < high:
        bar.ax.set_xlim(low, high)
    return figure, shows


def _at_rest(result: Result, name: str, cut: data.Patches, largest: float) -> tuple[Floats, float]:
    """Return the heights of the points at rest, (n,), and the scale of the deflections.

    A curved panel has one scale for its shape and its sides. Deflections are magnified, as they
    would not be visible on this scale.
    """
    if "mesh/z" not in result:
        return np.zeros(len(cut.points)), 1.0
    (z,) = data.require_datasets(result, name, "mesh/z")
    side = float(np.ptp(cut.points, axis=0).max())
    return cut.values(z), float(f"{ON_PANEL * side / (largest or side):.1g}")


def _show_shape(axes: Axes3D, cut: data.Patches, rest: Floats, drawn: Floats) -> None:
    """Give the axes of a curved panel one scale, with room for the deflections as drawn."""
    low, high = float(rest.min() + drawn.min()), float(rest.max() + drawn.max())
    extent = np.ptp(cut.points, axis=0)
    axes.set_zlim(low, high)
    axes.set_box_aspect((*(extent / extent.max()), (high - low) / extent.max()), zoom=1.3)
    axes.set(zlabel="", zticks=[])


def _draw_at_rest(axes: Axes3D, cut: data.Patches, low: float, high: float) -> Poly3DCollection:
    """Draw the flat plate in axes with room for deflections from `low` to `high`."""
    flat = cut.points[cut.quads]
    peak = max(abs(low), abs(high)) or 1.0
    plate = Poly3DCollection(
        np.pad(flat, ((0, 0), (0, 0), (0, 1))),
        cmap=style.DIVERGING,
        norm=Normalize(-peak, peak),
        edgecolors="0.25",
        linewidths=0.12,
        clip_on=False,
    )
    axes.add_collection3d(plate)
    first, last = flat.min(axis=(0, 1)), flat.max(axis=(0, 1))
    axes.set(xlim=(first[0], last[0]), ylim=(first[1], last[1]))
    axes.set_zlim(min(low, 0.0), max(high, 0.0))
    side = float((last - first).max())
    axes.set_box_aspect((*(last - first) / side, EXAGGERATION), zoom=1.3)
    axes.view_init(elev=28.0, azim=-62.0)
    return plate


def _label(axes: Axes3D, place: style.AxisScale, length: style.AxisScale) -> None:
    """Label three-dimensional axes and thin out their ticks."""
    for axis, shown, text, pad in (
        (axes.xaxis, place, "$x$", -4.0),
        (axes.yaxis, place, "$y$", -4.0),
        (axes.zaxis, length, "Deflection", -7.0),
    ):
        shown.name(axis, text)
        axis.labelpad = pad
        axis.pane.set_visible(False)
        axis._axinfo["grid"]["linewidth"] = 0.3
    axes.tick_params(pad=-3.0)
    axes.locator_params(nbins=5)
    axes.locator_params(axis="y", prune="lower")  # it would collide with the last of x
    axes.locator_params(axis="z", nbins=4)
