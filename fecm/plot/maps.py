"""Maps of a sweep: a quantity of every case over one or two varying parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, Normalize
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from fecm._typing import Floats
from fecm.plot.kinds import Picture
from fecm.plot.map_data import CURVES, Axis, Choice, choose
from fecm.plot.style import (
    COLOURS,
    IN_ORDER,
    RATIO,
    WIDTHS,
    Multiple,
    colour_bar,
    colours,
    lines_legend,
    panels,
)
from fecm.sweeps.result import SweepResult

MANY = 10_000  # more cells or points are stored as an image in vector formats
LINES = 8  # contour lines, approximately
# Heights of a row of texts, of everything around the rows, and of a colour bar (in).
ROW, HEAD, BAR = 0.17, 0.75, 0.45
DASHES = (0, (5, 1.5))
# Style of a level among curves, and its colour and contour lines on a map.
LEVEL: Any = {"color": "0.2", "linestyle": DASHES, "linewidth": 1.1}
LEVEL_COLOUR = COLOURS[1]
CONTOUR: Any = {"colors": LEVEL_COLOUR, "linestyles": [DASHES], "linewidths": 1.2}
SHADES = 256  # of a colour map
MARKERS = "osD^vP*"


# A quantity on a full grid of two parameters: x (nx,) and y (ny,), ascending, and the values,
# (ny, nx), masked where a case has none.
Grid = tuple[Floats, Floats, Any]


def parameter_map(
    results: Mapping[str, SweepResult],
    *,
    quantity: str = "",
    over: Sequence[str] = (),
    where: Mapping[str, float | str] | None = None,
    level: Sequence[float] = (),
    width: str = "column",
) -> Picture:
    """Draw a quantity of a sweep's cases over one or two varying parameters.

    One parameter: points, joined if each has one case; texts are rows.  Two: cells with contour
    lines if the cases form a full grid, else coloured points; if one parameter is a text, one curve
    per text, or rows of cells if there are too many curves.

    `quantity` is a name of the sweep's summary, by default the peak force, or the velocity found;
    `over` one or two parameters, by default all that vary.  `where` selects the cases with these
    values, of numbers the nearest; `level` are values to mark (the deck's unit).
    """
    ((name, sweep),) = results.items()
    choice = choose(sweep, name, quantity, over, where or {}, level)
    shown = choice.shown
    if len(choice.over) == 1:
        (first,) = choice.over
        axes = _one(choice, width)
        place = (shown, first) if first.ticks else (first, shown)
    else:
        first, second = choice.over
        axes = _two(first, second, shown, choice.levels, width)
        first, second = (second, first) if first.ticks else (first, second)
        place = (first, shown) if 0 < len(second.ticks) <= CURVES else (first, second)
    _mark_still(axes, *place, choice.still)
    if len(choice.limits):
        _mark_limits(axes, *place, choice)
    if choice.title:
        axes.set_title(choice.title, loc="left")
    figure: Any = axes.figure
    return Picture(figure)


def _mark_still(axes: Axes, x: Axis, y: Axis, still: NDArray[np.bool_]) -> None:
    """Mark the cases that ended in contact with crosses, and count them."""
    if not still.any():
        return
    mark: Any = {"marker": "x", "color": "0.25", "markersize": 3.5, "linestyle": "none"}
    axes.plot(x.values[still], y.values[still], zorder=4, clip_on=False, **mark)
    text = (
        f"\N{MULTIPLICATION SIGN} still in contact at the end: {still.sum()} of {len(still)} cases"
    )
    axes.set_xlabel(f"{axes.get_xlabel()}\n{text}")


def _mark_limits(axes: Axes, x: Axis, y: Axis, choice: Choice) -> None:
    """Mark the delamination thresholds of cases whose plates differ."""
    shown, limits = choice.shown, choice.limits
    above = replace(shown, values=shown.values - limits)
    if y is shown:
        axes.set_ylim(top=max(axes.get_ylim()[1], 1.05 * np.nanmax(limits)))
    elif x is shown:
        axes.set_xlim(right=max(axes.get_xlim()[1], 1.05 * np.nanmax(limits)))
    if y is shown and choice.other is not None and not choice.other.ticks:
        axes.plot(x.values, limits, "_", color="0.2")
    elif y is shown:
        texts = next((axis for axis in (*choice.over, choice.other) if axis and axis.ticks), None)
        for row in range(len(texts.ticks) if texts else 1):
            here = np.flatnonzero(texts.values == row) if texts else np.arange(len(limits))
            here = here[np.argsort(x.values[here], kind="stable")]
            style = LEVEL | ({"color": colours()[row]} if texts else {})
            axes.plot(x.values[here], limits[here], **style)
    elif x is shown:
        axes.plot(limits, y.values, "|", color="0.2", markersize=11.0)
    elif (found := _grid(x, y, above)) is None:
        reached = above.values >= 0.0
        axes.plot(
            x.values[reached], y.values[reached], "o", markersize=4.2, markerfacecolor="none",
            markeredgecolor=LEVEL_COLOUR,
        )  # fmt: skip
    elif y.ticks:
        _crossings(axes, found, 0.0)
    elif found[2].min() < 0.0 < found[2].max():
        axes.contour(*found, [0.0], **CONTOUR)


# One value ---------------------------------------------------------------------------------------


def _one(choice: Choice, width: str) -> Axes:
    """Points, joined if the cases differ in nothing else; texts are rows."""
    (over,), shown, levels, other = choice.over, choice.shown, choice.levels, choice.other
    if other is not None and other.ticks and not over.ticks:
        return _curves(over, other, shown, levels, width)
    if over.ticks:
        axes = _text_rows(width, over, 0.0 if other is None else BAR)
        if other is None:
            axes.plot(shown.values, over.values, "o", color=colours()[0], markersize=3.5)
        else:
            _coloured(axes, shown, over, other)
        _name_axes(axes, shown, None)
        if np.nanmin(shown.values) >= 0.0:
            axes.set_xlim(left=0.0)
        for level in levels:
            axes.axvline(level, **LEVEL)
        axes.grid(axis="y", linewidth=0.4, color="0.85")
        axes.set_axisbelow(True)
        return axes
    _, (axes,) = panels(width, ratio=RATIO[width])
    if other is not None:
        _coloured(axes, over, shown, other)
    else:
        order = np.argsort(over.values, kind="stable")
        axes.plot(over.values[order], shown.values[order], "o-", color=colours()[0], markersize=2.5)
    _finish_curves(axes, over, shown, levels)
    return axes


def _coloured(axes: Axes, x: Axis, y: Axis, other: Axis) -> None:
    """Points coloured by another parameter."""
    drawn = axes.scatter(
        x.values, y.values, c=other.values, s=9.0, cmap=IN_ORDER, norm=_colours(other),
        linewidths=0.0,
    )  # fmt: skip
    _bar(axes, drawn, other, [])


def _finish_curves(axes: Axes, over: Axis, shown: Axis, levels: list[float]) -> None:
    if np.nanmin(shown.values) >= 0.0:
        axes.set_ylim(bottom=0.0)
    _name_axes(axes, over, shown)
    for level in levels:
        axes.axhline(level, **LEVEL)


def _name_axes(axes: Axes, x: Axis, y: Axis | None) -> None:
    """Label the axes; counts have ticks at integers only."""
    for axis, shown in ((axes.xaxis, x), (axes.yaxis, y)):
        if shown is not None:
            shown.scale.name(axis, shown.label)
            if shown.whole:
                axis.set_major_locator(MaxNLocator(integer=True))


def _text_rows(width: str, over: Axis, more: float) -> Axes:
    """Axes whose rows are texts, the first at the top, with more room above (in)."""
    height = HEAD + ROW * max(len(over.ticks), 4) + more
    _, (axes,) = panels(width, ratio=height / WIDTHS[width])
    axes.set_yticks(range(len(over.ticks)), over.ticks)
    axes.set_ylim(len(over.ticks) - 0.5, -0.5)
    return axes


# Two values --------------------------------------------------------------------------------------


def _two(first: Axis, second: Axis, shown: Axis, levels: list[float], width: str) -> Axes:
    if first.ticks:
        first, second = second, first
    if second.ticks and len(second.ticks) <= CURVES:
        return _curves(first, second, shown, levels, width)
    found = _grid(first, second, shown)
    if second.ticks:
        axes = _text_rows(width, second, BAR)
    else:
        _, (axes,) = panels(width, ratio=1.35 * RATIO[width])
    _name_axes(axes, first, None if second.ticks else second)
    if found is None:
        _points(axes, first, second, shown, levels)
    else:
        _cells(axes, found, shown, levels, rows=bool(second.ticks))
    return axes


def _curves(over: Axis, texts: Axis, shown: Axis, levels: list[float], width: str) -> Axes:
    """A curve a text."""
    figure, (axes,) = panels(width, ratio=1.15 * RATIO[width])
    for row, (text, colour) in enumerate(zip(texts.ticks, colours(), strict=False)):
        here = np.flatnonzero(texts.values == row)
        here = here[np.argsort(over.values[here], kind="stable")]
        if np.isnan(shown.values[here]).all():  # failed
            continue
        axes.plot(
            over.values[here], shown.values[here], marker=MARKERS[row], color=colour,
            markersize=2.2, label=text,
        )  # fmt: skip
    _finish_curves(axes, over, shown, levels)
    lines_legend(figure, axes)
    return axes


def _colours(shown: Axis) -> Normalize:
    """Colour scale of the values; counts have one colour each."""
    low, high = float(np.nanmin(shown.values)), float(np.nanmax(shown.values))
    if shown.whole and high - low < SHADES - 1:
        return BoundaryNorm(np.arange(low - 0.5, high + 1.0), SHADES)
    return Normalize(low, high)


def _bar(axes: Axes, drawn: Any, shown: Axis, levels: list[float]) -> None:
    locator = MaxNLocator(6, integer=shown.whole)
    bar = colour_bar(axes, drawn, shown.scale, shown.label, locator)
    for level in levels:
        if drawn.norm.vmin <= level <= drawn.norm.vmax:
            bar.ax.axvline(level, color=LEVEL_COLOUR, linewidth=1.5)


def _cells(axes: Axes, grid: Grid, shown: Axis, levels: list[float], *, rows: bool) -> None:
    """One cell per case, with contour lines unless the rows are texts."""
    values = grid[2]
    drawn = axes.pcolormesh(
        *grid, shading="nearest", cmap=IN_ORDER, norm=_colours(shown), edgecolor="face",
        linewidth=0.1, rasterized=values.size > MANY,
    )  # fmt: skip
    _bar(axes, drawn, shown, levels)
    low, high = values.min(), values.max()
    if rows:
        for level in levels:
            _crossings(axes, grid, level)
        return
    if not shown.whole and low < high:
        ticks = MaxNLocator(LINES).tick_values(low, high)
        inner = [tick for tick in ticks if low < tick < high and tick not in levels]
        lines = axes.contour(*grid, inner, colors="white", linewidths=0.5)
        axes.clabel(lines, fontsize=6.0, inline_spacing=2, fmt=Multiple(shown.scale.factor))
    if inside := sorted({level for level in levels if low < level < high}):
        marked = axes.contour(*grid, inside, **CONTOUR)
        form = Multiple(shown.scale.factor)
        axes.clabel(marked, fontsize=6.0, inline_spacing=2, colors="white", fmt=form)


def _crossings(axes: Axes, grid: Grid, level: float) -> None:
    """Mark where a row crosses a level, interpolated linearly between cases."""
    x, y, shown = grid
    for row, values in zip(y, shown.filled(np.nan) - level, strict=True):
        before, after = values[:-1], values[1:]
        passed = np.flatnonzero((before < 0.0) != (after < 0.0))
        passed = passed[np.isfinite(before[passed]) & np.isfinite(after[passed])]
        share = before[passed] / (before[passed] - after[passed])
        at = x[passed] + share * np.diff(x)[passed]
        axes.vlines(at, row - 0.5, row + 0.5, color=LEVEL_COLOUR, linewidth=1.2)


def _points(axes: Axes, first: Axis, second: Axis, shown: Axis, levels: list[float]) -> None:
    """One coloured point per case; those above the lowest level have an edge."""
    fine = np.isfinite(shown.values)
    drawn: Any = axes.scatter(
        first.values[fine], second.values[fine], c=shown.values[fine], s=14.0, cmap=IN_ORDER,
        norm=_colours(shown), linewidths=0.0, rasterized=bool(fine.sum() > MANY),
    )  # fmt: skip
    if levels:
        above = shown.values[fine] >= min(levels)
        drawn.set_linewidths(np.where(above, 0.9, 0.0))
        drawn.set_edgecolors(LEVEL_COLOUR)
    _bar(axes, drawn, shown, levels)


def _grid(first: Axis, second: Axis, shown: Axis) -> Grid | None:
    """The cases as a full grid; None if they do not form one."""
    x, column = np.unique(first.values, return_inverse=True)
    y, row = np.unique(second.values, return_inverse=True)
    places = row * len(x) + column
    if not np.array_equal(np.sort(places), np.arange(len(x) * len(y))):
        return None
    return x, y, np.ma.masked_invalid(shown.values[np.argsort(places)].reshape(len(y), len(x)))
