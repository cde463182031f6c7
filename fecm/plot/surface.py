"""Pictures of the deflected plate in three dimensions, still and moving."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, cast

import numpy as np
from matplotlib.colors import Normalize
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from fecm._typing import Array, Floats
from fecm.plot import data, style
from fecm.plot.kinds import Picture, Width
from fecm.results.result import Result

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.text import Text
    from mpl_toolkits.mplot3d.axes3d import Axes3D

Results = Mapping[str, Result]
Show = Callable[[int], None]  # shows a row of tape3

FRAMES = 60
EXAGGERATION = 0.3  # height of the deflected plate over its longer side
ON_PANEL = 0.15  # the same of the deflection that is drawn on a curved panel


def surface(results: Results, *, times: Sequence[float] = (), width: Width = "column") -> Picture:
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


def animation(results: Results, *, times: Sequence[float] = (), width: Width = "column") -> Picture:
    """The deflected plate, frame by frame; the figure shows the last frame."""
    ((name, result),) = results.items()
    data.require(result, name, "tape3/w")
    rows = data.stored_rows(result, name, times, FRAMES)
    clock = style.scale_of(results, "time", [result["tape3/time"][rows]])
    figure, (show,) = _plates(results, width, rows, 1, clock)
    show(rows[-1])
    return Picture(figure, [functools.partial(show, row) for row in rows])


def _plates(
    results: Results, width: Width, rows: Array, count: int, clock: style.Scale
) -> tuple[Figure, list[Show]]:
    """Draw `count` plates at rest on the common scale of all rows, and what shows a row on each."""
    ((name, result),) = results.items()
    cut, w = data.patches(result, 2, name), result["tape3/w"]
    stored = w[rows]
    place = style.scale_of(results, "length", [cut.points])
    length = style.scale_of(results, "length", [stored])
    low, high = float(stored.min()), float(stored.max())
    rest, factor = _at_rest(result, name, cut, max(abs(low), abs(high)))
    columns = 1 if width == "column" else min(count, 2)
    lines = math.ceil(count / columns)
    figure, found = style.panels(width, lines, columns, ratio=0.7, projection="3d")
    axes = cast("list[Axes3D]", found)
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
    """Heights of the points at rest, (n,), and the factor by which deflections are drawn.

    The shape of a curved panel has the scale of its sides, on which a deflection would not be seen.
    """
    if "mesh/z" not in result:
        return np.zeros(len(cut.points)), 1.0
    (z,) = data.require(result, name, "mesh/z")
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


def _label(axes: Axes3D, place: style.Scale, length: style.Scale) -> None:
    """Label three-dimensional axes, and thin out their ticks."""
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
