"""Maps of a sweep: a number of every case over the one or two values that vary."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from fecm._typing import Floats
from fecm.plot.kinds import Picture
from fecm.plot.map_data import CURVES, Axis, Choice, choose
from fecm.plot.pictures import Options
from fecm.plot.style import COLOURS, IN_ORDER, RATIO, lines_legend, panels
from fecm.sweeps.result import SweepResult

# Cells and points beyond which a drawing of lines holds them as an image.
MANY = 10_000
LINES = 8  # of equal value, about
ROW, HEAD = 0.17, 0.75  # height of a row of texts, and of what stands around rows (in)
DASHES = (0, (5, 1.5))
# A level among curves, and on colours.
LEVEL: Any = {"color": "0.2", "linestyle": DASHES, "linewidth": 1.1}
LEVEL_COLOUR = COLOURS[1]
SHADES = 256  # of a map of colours
MARKERS = "osD^vP*"


@dataclass(frozen=True)
class MapGrid:
    """A number on every crossing of two values' rows.

    Attributes
    ----------
    x, y : ndarray (nx,), (ny,)
        Rising.
    values : masked array (ny, nx)
        Masked where a case has none.
    """

    x: Floats
    y: Floats
    values: Any = field(repr=False)


def parameter_map(results: Mapping[str, SweepResult], options: Options) -> Picture:
    """Draw a number of a sweep's cases over one or two of the values that vary.

    One value: points, joined where there is one case each; texts stand as rows.  Two: cells with
    lines of equal value where the cases are a full grid, coloured points where not; a curve a text
    where one of them is a text, or rows of cells where there are too many curves.
    """
    ((name, sweep),) = results.items()
    choice = choose(sweep, name, options)
    shown = choice.shown
    if len(choice.over) == 1:
        (over,) = choice.over
        figure = _one(choice, options)
        place = (shown, over) if over.ticks else (over, shown)
    else:
        first, second = choice.over
        figure = _two(first, second, shown, choice.levels, options)
        first, second = (second, first) if first.ticks else (first, second)
        place = (first, shown) if 0 < len(second.ticks) <= CURVES else (first, second)
    _mark_still(figure, *place, choice.still)
    if choice.title:
        figure.axes[0].set_title(choice.title, loc="left")
    return Picture(figure)


def _mark_still(figure: Figure, x: Axis, y: Axis, still: NDArray[np.bool_]) -> None:
    """Cross the cases that ended in contact, and count them."""
    if not still.any():
        return
    mark: Any = {"marker": "x", "color": "0.25", "markersize": 3.5, "linestyle": "none"}
    figure.axes[0].plot(x.values[still], y.values[still], zorder=4, **mark)
    text = (
        f"\N{MULTIPLICATION SIGN} still in contact at the end: {still.sum()} of {len(still)} cases"
    )
    figure.supxlabel(text, fontsize=7.0, color="0.25")


# One value ---------------------------------------------------------------------------------------


def _one(choice: Choice, options: Options) -> Figure:
    """Points, joined where the cases differ in nothing else; texts stand as rows."""
    (over,), shown, levels, other = choice.over, choice.shown, choice.levels, choice.other
    if other is not None and other.ticks and not over.ticks:
        return _curves(over, other, shown, levels, options)
    if over.ticks:
        figure, axes = _text_rows(options, over)
        if other is None:
            axes.plot(shown.values, over.values, "o", color=COLOURS[0], markersize=3.5)
        else:
            figure.set_figheight(figure.get_figheight() + 0.45)
            _coloured(figure, axes, shown, over, other)
        _name_axes(axes, shown, None)
        if np.nanmin(shown.values) >= 0.0:
            axes.set_xlim(left=0.0)
        for level in levels:
            axes.axvline(level, **LEVEL)
        axes.grid(axis="y", linewidth=0.4, color="0.85")
        axes.set_axisbelow(True)
        return figure
    figure, (axes,) = panels(options.width, ratio=RATIO[options.width])
    if other is not None:
        _coloured(figure, axes, over, shown, other)
    else:
        order = np.argsort(over.values, kind="stable")
        axes.plot(over.values[order], shown.values[order], "o-", color=COLOURS[0], markersize=2.5)
    _finish_curves(axes, over, shown, levels)
    return figure


def _coloured(figure: Figure, axes: Axes, x: Axis, y: Axis, other: Axis) -> None:
    """Points whose colours show another value."""
    drawn = axes.scatter(
        x.values, y.values, c=other.values, s=9.0, cmap=IN_ORDER, norm=_colours(other),
        linewidths=0.0,
    )  # fmt: skip
    _bar(figure, axes, drawn, other, [])


def _finish_curves(axes: Axes, over: Axis, shown: Axis, levels: list[float]) -> None:
    if np.nanmin(shown.values) >= 0.0:
        axes.set_ylim(bottom=0.0)
    _name_axes(axes, over, shown)
    for level in levels:
        axes.axhline(level, **LEVEL)


def _name_axes(axes: Axes, x: Axis, y: Axis | None) -> None:
    """Labels, and ticks at whole numbers where there are no others."""
    axes.set_xlabel(x.label)
    if x.whole:
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    if y is not None:
        axes.set_ylabel(y.label)
        if y.whole:
            axes.yaxis.set_major_locator(MaxNLocator(integer=True))


def _text_rows(options: Options, over: Axis) -> tuple[Figure, Axes]:
    """Axes whose rows are texts, the first one above."""
    figure, (axes,) = panels(options.width, ratio=1.0)
    figure.set_figheight(HEAD + ROW * max(len(over.ticks), 4))
    axes.set_yticks(range(len(over.ticks)), over.ticks)
    axes.set_ylim(len(over.ticks) - 0.5, -0.5)
    return figure, axes


# Two values --------------------------------------------------------------------------------------


def _two(first: Axis, second: Axis, shown: Axis, levels: list[float], options: Options) -> Figure:
    if first.ticks:
        first, second = second, first
    if second.ticks and len(second.ticks) <= CURVES:
        return _curves(first, second, shown, levels, options)
    found = _grid(first, second, shown)
    if second.ticks:
        figure, axes = _text_rows(options, second)
        figure.set_figheight(figure.get_figheight() + 0.45)
    else:
        figure, (axes,) = panels(options.width, ratio=1.35 * RATIO[options.width])
    _name_axes(axes, first, None if second.ticks else second)
    if found is None:
        _points(figure, axes, first, second, shown, levels)
    else:
        _cells(figure, axes, found, shown, levels, rows=bool(second.ticks))
    return figure


def _curves(over: Axis, texts: Axis, shown: Axis, levels: list[float], options: Options) -> Figure:
    """A curve a text."""
    figure, (axes,) = panels(options.width, ratio=1.15 * RATIO[options.width])
    for row, (text, colour) in enumerate(zip(texts.ticks, COLOURS, strict=False)):
        here = np.flatnonzero(texts.values == row)
        here = here[np.argsort(over.values[here], kind="stable")]
        axes.plot(
            over.values[here], shown.values[here], marker=MARKERS[row], color=colour,
            markersize=2.2, label=text,
        )  # fmt: skip
    _finish_curves(axes, over, shown, levels)
    lines_legend(figure, axes)
    return figure


def _colours(shown: Axis) -> Normalize:
    """Colours of the values; a colour a number where they are whole."""
    low, high = float(np.nanmin(shown.values)), float(np.nanmax(shown.values))
    if shown.whole and high - low < SHADES - 1:
        return BoundaryNorm(np.arange(low - 0.5, high + 1.0), SHADES)
    return Normalize(low, high)


def _bar(figure: Figure, axes: Axes, drawn: Any, shown: Axis, levels: list[float]) -> None:
    bar = figure.colorbar(drawn, ax=axes, location="top", aspect=30, pad=0.03)
    bar.set_label(shown.label)
    bar.outline.set_linewidth(0.6)
    bar.locator = MaxNLocator(6, integer=shown.whole)
    bar.minorticks_off()
    bar.update_ticks()
    for level in levels:
        if drawn.norm.vmin <= level <= drawn.norm.vmax:
            bar.ax.axvline(level, color=LEVEL_COLOUR, linewidth=1.5)


def _cells(
    figure: Figure, axes: Axes, grid: MapGrid, shown: Axis, levels: list[float], *, rows: bool
) -> None:
    """A cell a case, with lines of equal value; between rows of texts there are none."""
    many = grid.values.size > MANY
    drawn = axes.pcolormesh(
        grid.x, grid.y, grid.values, shading="nearest", cmap=IN_ORDER, norm=_colours(shown),
        edgecolor="face", linewidth=0.1, rasterized=many,
    )  # fmt: skip
    _bar(figure, axes, drawn, shown, levels)
    low, high = grid.values.min(), grid.values.max()
    if rows:
        for level in levels:
            _crossings(axes, grid, level)
        return
    if not shown.whole and low < high:
        ticks = MaxNLocator(LINES).tick_values(low, high)
        inner = [tick for tick in ticks if low < tick < high and tick not in levels]
        lines = axes.contour(grid.x, grid.y, grid.values, inner, colors="white", linewidths=0.5)
        axes.clabel(lines, fontsize=6.0, inline_spacing=2)
    if inside := sorted({level for level in levels if low < level < high}):
        marked = axes.contour(
            grid.x, grid.y, grid.values, inside, colors=LEVEL_COLOUR,
            linestyles=[DASHES], linewidths=1.2,
        )  # fmt: skip
        axes.clabel(marked, fontsize=6.0, inline_spacing=2, colors="white")


def _crossings(axes: Axes, grid: MapGrid, level: float) -> None:
    """Mark where a row passes a level, between two cases by a straight line."""
    for row, values in zip(grid.y, grid.values.filled(np.nan) - level, strict=True):
        before, after = values[:-1], values[1:]
        passed = np.flatnonzero((before < 0.0) != (after < 0.0))
        passed = passed[np.isfinite(before[passed]) & np.isfinite(after[passed])]
        share = before[passed] / (before[passed] - after[passed])
        at = grid.x[passed] + share * np.diff(grid.x)[passed]
        axes.vlines(at, row - 0.5, row + 0.5, color=LEVEL_COLOUR, linewidth=1.2)


def _points(
    figure: Figure, axes: Axes, first: Axis, second: Axis, shown: Axis, levels: list[float]
) -> None:
    """A coloured point a case; those above the lowest level have an edge."""
    fine = np.isfinite(shown.values)
    drawn: Any = axes.scatter(
        first.values[fine], second.values[fine], c=shown.values[fine], s=14.0, cmap=IN_ORDER,
        norm=_colours(shown), linewidths=0.0, rasterized=bool(fine.sum() > MANY),
    )  # fmt: skip
    if levels:
        above = shown.values[fine] >= min(levels)
        drawn.set_linewidths(np.where(above, 0.9, 0.0))
        drawn.set_edgecolors(LEVEL_COLOUR)
    _bar(figure, axes, drawn, shown, levels)


def _grid(first: Axis, second: Axis, shown: Axis) -> MapGrid | None:
    """The cases as a full grid; None where they are none."""
    x, column = np.unique(first.values, return_inverse=True)
    y, row = np.unique(second.values, return_inverse=True)
    if len(x) * len(y) != len(shown.values):
        return None
    filled = np.zeros((len(y), len(x)), dtype=int)
    np.add.at(filled, (row, column), 1)
    if (filled != 1).any():
        return None
    values = np.empty(filled.shape)
    values[row, column] = shown.values
    return MapGrid(x, y, np.ma.masked_invalid(values))
