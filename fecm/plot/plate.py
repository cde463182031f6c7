"""Pictures of the plate: its mesh (the report's figure 4.11 a), its deflection (figure 4.20)."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from matplotlib.tri import LinearTriInterpolator, Triangulation

from fecm._typing import Bools, Floats
from fecm.deck.model import Impact
from fecm.mechanics.mesh import longest_sides
from fecm.plot import data, style
from fecm.plot.kinds import Picture, PlotError
from fecm.results.result import Result

Results = Mapping[str, Result]
Show = Callable[[int], None]  # shows a row of tape3

AXES = {"x": 0, "y": 1}
FRAMES = 60
SAMPLES = 401
LEVELS = 21
EXAGGERATION = 0.3  # height of the deflected plate over its longer side
# Marks of the supports by their label.
MARKS: dict[str, dict[str, Any]] = {
    "clamped": {"marker": "s", "color": style.COLOURS[0], "ms": 3.0},
    "w held": {"marker": "^", "color": style.COLOURS[0], "ms": 3.5, "mfc": "white", "mew": 0.7},
    "rotation held": {
        "marker": "o", "color": style.COLOURS[2], "ms": 3.0, "mfc": "white", "mew": 0.7
    },
}  # fmt: skip


def supports(result: Result) -> dict[str, Bools]:
    """Masks of the nodes held against bending, by kind of support; each (numnp,)."""
    held = result["mesh/equations"][:, 2:5] == 0
    w, rotations = held[:, 0], held[:, 1:]
    full = w & rotations.all(axis=1)
    # At a corner of a simply supported plate one node of an element is fully held, others hold w.
    nodes, present = result["mesh/elements"] - 1, result["mesh/elements"] > 0
    one = (full[nodes] & present).sum(axis=1) == 1
    several = (w[nodes] & present).sum(axis=1) > 1
    corners, others = np.zeros_like(full), np.zeros_like(full)
    corners[nodes[(one & several)[:, None] & present]] = True
    others[nodes[~one[:, None] & present]] = True
    clamped = full & ~(corners & ~others)
    return {"clamped": clamped, "w held": w & ~clamped, "rotation held": ~w & rotations.any(axis=1)}


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


def mesh(
    results: Results, *, at: Sequence[tuple[float, float]] = (), width: str = "column"
) -> Picture:
    """Elements, supports, impact point, contact patch, and points to mark (`at`)."""
    ((name, result),) = results.items()
    coordinates, _ = data.require(result, name, "mesh/coordinates", "mesh/elements")
    cut = data.patches(result, 4, name)
    place = style.scale_of(results, "length", [coordinates])
    low, high = cut.points.min(axis=0), cut.points.max(axis=0)
    height = aspect(cut.points)
    ratio = height + (0.55 - 0.5 * height) / style.WIDTHS[width]
    figure, (axes,) = style.panels(width, ratio=ratio)
    sides = [cut.points[edge] for edge in cut.edges]
    axes.add_collection(LineCollection(sides, colors="0.4", linewidths=0.4))
    for label, nodes in supports(result).items():
        if nodes.any():
            held = coordinates[nodes, :2].T
            axes.plot(*held, ls="none", clip_on=False, label=label, **MARKS[label])
    if len(where := data.struck(result, name)):
        in_patch = data.circle(result, name) is not None
        mark: Any = {"marker": "+"} if in_patch else {"marker": "X", "mec": "white"}
        mark["label"] = "impact" if data.deck_of(result, name).has(Impact) else "load"
        axes.plot(*where.T, color=style.COLOURS[1], ms=6.0, mew=0.5, ls="", clip_on=False, **mark)
    draw_circle(axes, result, name, color=style.COLOURS[1], label="contact patch")
    if at:
        look: Any = {"color": style.COLOURS[3], "ms": 3.5, "label": "points"}
        axes.plot(*np.array(at).T, "D", clip_on=False, **look)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    place.name(axes.xaxis, "$x$")
    place.name(axes.yaxis, "$y$")
    style.lines_legend(figure, axes)
    return Picture(figure)


def profile(result: Result, name: str, along: str, rows: data.Array) -> tuple[Floats, Floats]:
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
    results: Results, *, times: Sequence[float] = (), along: str = "x", width: str = "column"
) -> Picture:
    """Deflection along a line through the impact point; of several results, one graph per time.

    Drawn are the stored rows nearest to `times` (the deck's unit), by default a few, in the
    direction `along`, ``"x"`` or ``"y"``.
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
        shades = matplotlib.colormaps[style.IN_ORDER](np.linspace(0.0, 0.85, len(stored)))
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


def contour(results: Results, *, times: Sequence[float] = (), width: str = "column") -> Picture:
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
    ratio = aspect(cut.points) + 0.65 * columns / lines / style.WIDTHS[width]
    figure, axes = style.panels(width, lines, columns, sharex=True, sharey=True, ratio=ratio)
    fields = [cut.values(row) for row in w]
    peak = float(np.abs(fields).max()) or 1.0  # may exceed the nodal values
    levels = MaxNLocator(LEVELS).tick_values(np.min(fields), np.max(fields))
    triangles = Triangulation(cut.points[:, 0], cut.points[:, 1], cut.triangles)
    fills = []
    for ax, row, values in zip(axes, rows, fields, strict=False):
        norm = Normalize(-peak, peak)
        fills.append(ax.tricontourf(triangles, values, levels, cmap=style.SIGNED, norm=norm))
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


def surface(results: Results, *, times: Sequence[float] = (), width: str = "column") -> Picture:
    """The deflected plate; by default at the instant of largest deflection range."""
    ((name, result),) = results.items()
    (w,) = data.require(result, name, "tape3/w")
    largest = np.array([int(np.ptp(w, axis=1).argmax())])
    rows = data.stored_rows(result, name, times, 1) if times else largest
    clock = style.scale_of(results, "time", [result["tape3/time"]])
    figure, shows = _plates(results, width, rows, len(rows), clock)
    for show, row in zip(shows, rows, strict=True):
        show(row)
    return Picture(figure)


def animation(results: Results, *, times: Sequence[float] = (), width: str = "column") -> Picture:
    """The deflected plate, frame by frame; the figure shows the last frame."""
    ((name, result),) = results.items()
    data.require(result, name, "tape3/w")
    rows = data.stored_rows(result, name, times, FRAMES)
    clock = style.scale_of(results, "time", [result["tape3/time"][rows]])
    figure, (show,) = _plates(results, width, rows, 1, clock)
    show(rows[-1])
    return Picture(figure, [functools.partial(show, row) for row in rows])


def _plates(
    results: Results, width: str, rows: data.Array, count: int, clock: style.Scale
) -> tuple[Figure, list[Show]]:
    """Draw `count` flat plates on the common scale of all rows, and what shows a row on each."""
    ((name, result),) = results.items()
    cut, w = data.patches(result, 2, name), result["tape3/w"]
    place = style.scale_of(results, "length", [cut.points])
    flat, stored = cut.points[cut.quads], w[rows]
    length = style.scale_of(results, "length", [stored])
    span = (float(stored.min()), float(stored.max()))
    columns = 1 if width == "column" else min(count, 2)
    lines = math.ceil(count / columns)
    figure, axes = style.panels(width, lines, columns, ratio=0.7, subplot_kw={"projection": "3d"})
    for ax in axes[count:]:
        ax.set_axis_off()

    def show(collection: Any, title: Any, row: int) -> None:
        heights = cut.values(w[row])[cut.quads]
        collection.set_verts(np.dstack([flat, heights]))
        collection.set_array(heights.mean(axis=1))
        title.set_text(f"time {clock.show(float(result['tape3/time'][row]))}")

    plates = [_plate(ax, cut, place, length, span) for ax in axes[:count]]
    look = {"shrink": 0.6, "pad": 0.0, "fraction": 0.06, "aspect": 30 * columns}
    bar = style.colour_bar(axes, plates[0][0], length, "Deflection", MaxNLocator(5), **look)
    if span[0] < span[1]:
        bar.ax.set_xlim(span)
    return figure, [functools.partial(show, *plate) for plate in plates]


def _plate(
    axes: Any, cut: data.Patches, place: style.Scale, length: style.Scale, span: tuple[float, float]
) -> tuple[Any, Any]:
    """Draw the flat plate in three-dimensional axes; what is drawn, and an empty title."""
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    flat = cut.points[cut.quads]
    peak = max(map(abs, span)) or 1.0
    title = axes.text2D(0.03, 0.94, "", transform=axes.transAxes)
    collection = Poly3DCollection(
        np.pad(flat, ((0, 0), (0, 0), (0, 1))), cmap=style.SIGNED, norm=Normalize(-peak, peak),
        edgecolors="0.25", linewidths=0.12, clip_on=False,
    )  # fmt: skip
    axes.add_collection3d(collection)
    low, high = flat.min(axis=(0, 1)), flat.max(axis=(0, 1))
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    axes.set_zlim(min(span[0], 0.0), max(span[1], 0.0))
    side = float((high - low).max())
    axes.set_box_aspect((*(high - low) / side, EXAGGERATION), zoom=1.3)
    axes.view_init(elev=28.0, azim=-62.0)
    for axis, shown, text, pad in (
        (axes.xaxis, place, "$x$", -4.0), (axes.yaxis, place, "$y$", -4.0),
        (axes.zaxis, length, "Deflection", -7.0),
    ):  # fmt: skip
        shown.name(axis, text)
        axis.labelpad = pad
        axis.pane.set_visible(False)
        axis._axinfo["grid"]["linewidth"] = 0.3
    axes.tick_params(pad=-3.0)
    axes.locator_params(nbins=5)
    axes.locator_params(axis="y", prune="lower")  # it would collide with the last of x
    axes.locator_params(axis="z", nbins=4)
    return collection, title
