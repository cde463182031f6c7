"""Maps of a sweep: a quantity of every case over one or two varying parameters."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np
from matplotlib.colors import BoundaryNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from fecm._errors import warn
from fecm._typing import Bools, Floats, Indices
from fecm.plot import style
from fecm.plot.kinds import Picture, PlotError, Width
from fecm.plot.map_cells import ValueGrid, draw_equal_energies, hatch, value_grid
from fecm.plot.sweep_data import (
    DrawnVariable,
    Where,
    beyond,
    case_counts,
    case_rows,
    ended,
    names_in_words,
    parameter_values,
    quantity_of,
    variable_of,
)
from fecm.sweeps.result import SweepResult
from fecm.sweeps.summary import from_threshold_of

if TYPE_CHECKING:
    from matplotlib import collections
    from matplotlib.axes import Axes


MOST_CURVES = len(style.COLOURS)
THRESHOLD = "delamination threshold"
LEVEL_COLOUR = style.COLOURS[1]  # among colours
# Looks of a level among curves, and of points at or above a level.
LEVEL: style.Look = {"color": "0.2", "linestyle": style.DASHED, "linewidth": 1.1}
RING: style.Look = {"ms": 4.2, "mfc": "none", "mec": LEVEL_COLOUR}


class MarkedLevel(NamedTuple):
    """Value of the quantity that is marked."""

    value: float
    words: str = "level"  # before the value in the legend
    is_threshold: bool = False  # of delamination


class MapContents(NamedTuple):
    """Contents of a map."""

    over: list[DrawnVariable]  # one or two parameters
    shown: DrawnVariable  # quantity; NaN where a case has none
    levels: list[MarkedLevel]
    title: str  # values that select the cases; empty for all cases
    other: DrawnVariable | None  # second varying parameter of a map over one
    beyond: dict[str, Bools]  # masks of the cases beyond the range of the model, by reason
    ended: dict[str, Bools]  # masks of the cases whose contact is not over, by reason
    # (cases,): delamination thresholds if they differ and the map shows peak forces; else empty.
    thresholds: Floats


class Graph(NamedTuple):
    """Axes and the variables along them."""

    axes: Axes
    x: DrawnVariable
    y: DrawnVariable

    def label(self) -> None:
        """Label the axes, except y if it has texts."""
        self.x.mark(self.axes.xaxis)
        if not self.y.ticks:
            self.y.mark(self.axes.yaxis)


def choose(
    sweep: SweepResult,
    name: str,
    *,
    quantity: str,
    over: Sequence[str],
    where: Where,
    level: Sequence[float],
) -> MapContents:
    """Select the contents of a map; warn of cases without a value.

    Raises PlotError if the options do not fit the sweep, or no case remains.
    """
    rows = case_rows(sweep, name, where)
    axes, other = _parameters(sweep, name, rows, over)
    shown = quantity_of(sweep, name, rows, quantity)
    levels = {value: MarkedLevel(value) for value in level}
    thresholds: Floats = np.empty(0)
    if shown.name == "peak_force" and "threshold_force" in sweep.summary:
        thresholds = sweep["threshold_force"][rows]
        highest = float(np.nanmax(thresholds))
        if highest - np.nanmin(thresholds) <= 1e-9 * highest:
            words = f"delamination {from_threshold_of(sweep)}"
            levels[highest] = MarkedLevel(highest, words, is_threshold=True)
            thresholds = np.empty(0)
    low, high = shown.range
    for value in level:
        if not low <= value <= high:
            warn(
                f"the level {value:g} is outside the picture's values, which range from {low:g} "
                f"to {high:g}"
            )
    return MapContents(
        over=axes,
        shown=shown,
        levels=list(levels.values()),
        title=", ".join(f"{held} {_text(sweep, held, rows[0])}" for held in where),
        other=other,
        beyond=beyond(sweep, rows),
        ended=ended(sweep, rows),
        thresholds=thresholds,
    )


def _parameters(
    sweep: SweepResult, name: str, rows: Indices, over: Sequence[str]
) -> tuple[list[DrawnVariable], DrawnVariable | None]:
    """Return the parameters of the axes, and a second varying parameter if there is one axis.

    Raises PlotError if cases would hide one another.
    """
    varying = [n for n, values in sweep.cases.items() if len(np.unique(values[rows])) > 1]
    axes = [
        variable_of(sweep, parameter, sweep[parameter][rows])
        for parameter in _names_of_axes(sweep, name, varying, over)
    ]
    other_parameters = [
        parameter for parameter in varying if parameter not in [axis.name for axis in axes]
    ]
    if not other_parameters:
        return axes, None

    verb = "varies" if len(other_parameters) == 1 else "vary"
    vary = f"{names_in_words(other_parameters)} {verb} too"
    selects = f"--where {other_parameters[0]}=VALUE selects some of"
    if len(axes) > 1:
        points = np.column_stack([axis.values for axis in axes])
        if len(np.unique(points, axis=0)) < len(points):
            raise PlotError(f"{vary}, so that cases would hide one another; {selects} them")
        return axes, None
    other = variable_of(sweep, other_parameters[0], sweep[other_parameters[0]][rows])
    if len(other_parameters) > 1 or len(other.ticks) > MOST_CURVES:
        both = f"--over {axes[0].name},{other_parameters[0]} draws over both"
        raise PlotError(f"{vary}; {selects} the cases, {both}")
    return axes, other


def _names_of_axes(
    sweep: SweepResult, name: str, varying: list[str], names_given: Sequence[str]
) -> list[str]:
    """Return the names of the parameters on the axes, one or two."""
    for parameter in names_given:
        if parameter not in varying and len(parameter_values(sweep, name, parameter)):
            raise PlotError(f"{parameter} does not vary among the cases; a map needs one that does")
    over = list(dict.fromkeys(names_given)) or varying
    if not over:
        raise PlotError(f"nothing varies in {name}: all cases are equal")
    if len(over) > 2:
        raise PlotError(
            f"a map has at most two axes, and {names_in_words(over)} vary; choose with "
            "--over NAME or "
            "NAME,NAME"
        )
    return over


def _text(sweep: SweepResult, name: str, row: int) -> str:
    """Format a value for a title."""
    value = sweep[name][row]
    if isinstance(value, str):
        return str(value)
    return style.scale(abs(float(value)), sweep.unit(name)).show(float(value))


MANY = 10_000  # cells or points above which vector formats store an image
CONTOUR_LINES = 8  # approximate number
SHADES = 256  # shades of a colour map
LEVEL_WIDTH = 1.2
# Looks of the contour lines of levels, and of the numbers on contour lines.
CONTOUR: style.Look = {
    "colors": LEVEL_COLOUR,
    "linestyles": [style.DASHED],
    "linewidths": LEVEL_WIDTH,
}
NUMBER: style.Look = {"fontsize": 6.0, "inline_spacing": 2}


def draw_field(graph: Graph, contents: MapContents) -> None:
    """Draw the quantity by colours: cells if the cases form a full grid, else points."""
    graph.label()
    levels = [level.value for level in contents.levels]
    grid = value_grid(graph.x, graph.y, contents.shown.values)
    if grid is None:
        _draw_points(graph, contents.shown, levels)
    else:
        _draw_cells(graph.axes, grid, contents.shown, levels, in_rows=bool(graph.y.ticks))


def _draw_cells(
    axes: Axes, grid: ValueGrid, shown: DrawnVariable, levels: Collection[float], *, in_rows: bool
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
        apart = 0.3 * np.diff(ticks).min()  # the numbers of close lines would collide
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


def _mark_crossings(axes: Axes, grid: ValueGrid, level: float) -> None:
    """Mark where a row crosses a level; values between cases are interpolated linearly."""
    x = grid.x
    for row, values in zip(grid.y, grid.values.filled(np.nan) - level, strict=True):
        before, after = values[:-1], values[1:]
        passed = np.isfinite(before + after) & ((before < 0.0) != (after < 0.0))
        share = before[passed] / (before[passed] - after[passed])
        crossings = x[:-1][passed] + share * np.diff(x)[passed]
        axes.vlines(crossings, row - 0.5, row + 0.5, color=LEVEL_COLOUR, linewidth=LEVEL_WIDTH)


def _draw_points(graph: Graph, shown: DrawnVariable, levels: Collection[float]) -> None:
    """Draw one coloured point per case; points above the lowest level have an edge."""
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


def norm_of(shown: DrawnVariable) -> Normalize:
    """Return the colour scale of the values; every count has its own colour."""
    low, high = shown.range
    if shown.whole and high - low < SHADES - 1:
        return BoundaryNorm(np.arange(low - 0.5, high + 1.0), SHADES)
    return Normalize(low, high)


def draw_bar(
    axes: Axes, drawn: collections.Collection, shown: DrawnVariable, levels: Collection[float]
) -> None:
    """Draw the colour bar, with lines at levels."""
    locator = MaxNLocator(6, integer=shown.whole)
    bar = style.colour_bar(axes, drawn, shown.scale, shown.label, locator)
    low, high = drawn.get_clim()
    for level in levels:
        if low <= level <= high:
            bar.ax.axvline(level, color=LEVEL_COLOUR, linewidth=1.5)


def mark_threshold_contours(graph: Graph, contents: MapContents) -> None:
    """Mark the delamination thresholds of cases whose plates differ."""
    axes, x, y = graph.axes, graph.x, graph.y
    above = contents.shown.values - contents.thresholds
    grid = value_grid(x, y, above)
    if grid is None:
        is_above = above >= 0.0
        axes.plot(x.values[is_above], y.values[is_above], "o", label=f"from {THRESHOLD} on", **RING)
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


def name_levels(graph: Graph, contents: MapContents) -> list[str]:
    """Name the levels in the legend; return notes on thresholds outside the values."""
    shown, notes = contents.shown, []
    low, high = shown.range
    in_cells = value_grid(graph.x, graph.y, shown.values) is not None
    lowest = min((level.value for level in contents.levels), default=0.0)
    for level in contents.levels:
        value = shown.scale.show(level.value)
        text = f"{level.words} {value}"
        inside = low < level.value < high
        if inside and in_cells:
            name_level(graph, text)
        elif inside and level.value == lowest:
            ring = text if level.is_threshold else f"from {text} on"
            graph.axes.plot([], [], "o", label=ring, **RING)
        elif not inside and level.is_threshold:
            side = "below" if high <= level.value else "above"
            notes.append(f"all values of {shown.name} are {side} the {THRESHOLD} {value}")
    return notes


MARKERS = "osD^vP*"


def draw_curves(
    x: DrawnVariable, texts: DrawnVariable, contents: MapContents, width: Width
) -> Graph:
    """Draw a curve of the quantity over x for each text."""
    _, (axes,) = style.panels(width, tall=1.15)
    looks = zip(texts.ticks, style.colours(), MARKERS, strict=False)
    for here, (text, colour, marker) in zip(runs_in_order(x, texts), looks, strict=True):
        values = contents.shown.values[here]
        if not np.isnan(values).all():  # else all cases have failed
            axes.plot(x.values[here], values, marker=marker, color=colour, ms=2.2, label=text)
    graph = Graph(axes, x, contents.shown)
    _finish(graph, contents)
    return graph


def draw_points(graph: Graph, contents: MapContents) -> None:
    """Draw a point per case, coloured by the other parameter or joined to a curve."""
    axes, x, y = graph.axes, graph.x, graph.y
    if contents.other is not None:
        drawn = axes.scatter(
            x.values,
            y.values,
            c=contents.other.values,
            s=9.0,
            cmap=style.SEQUENTIAL,
            norm=norm_of(contents.other),
            linewidths=0.0,
        )
        draw_bar(axes, drawn, contents.other, [])
    elif x is contents.shown:
        axes.plot(x.values, y.values, "o", color=style.colours()[0], ms=3.5)
    else:
        (order,) = runs_in_order(x, None)
        axes.plot(x.values[order], y.values[order], "o-", color=style.colours()[0], ms=2.5)
    _finish(graph, contents)


def runs_in_order(x: DrawnVariable, texts: DrawnVariable | None) -> list[Indices]:
    """Return the cases in the order of x, one array for each text, or one for all."""
    order = np.argsort(x.values, kind="stable")
    if texts is None:
        return [order]
    return [order[texts.values[order] == row] for row in range(len(texts.ticks))]


def _finish(graph: Graph, contents: MapContents) -> None:
    """Label the axes and mark the levels; the quantity starts at zero unless it is negative."""
    axes, shown = graph.axes, contents.shown
    along_x = graph.x is shown
    graph.label()
    for level in contents.levels:
        look = LEVEL | {"label": f"{level.words} {shown.scale.show(level.value)}"}
        if not level.is_threshold:
            look["linestyle"] = style.DOTTED
        if along_x:
            axes.axvline(level.value, **look)
        else:
            axes.axhline(level.value, **look)
    lowest, highest = shown.range
    if lowest >= 0.0:
        thresholds = [level.value for level in contents.levels if level.is_threshold]
        end = 1.05 * max(highest, *thresholds, 0.0) or 1.0  # with room for the markers
        if along_x:
            axes.set_xlim(0.0, end)
        else:
            axes.set_ylim(0.0, end)
    if along_x:
        axes.grid(axis="y", linewidth=0.4, color="0.85")
        axes.set_axisbelow(True)


def mark_threshold_curves(graph: Graph, contents: MapContents) -> None:
    """Mark the delamination thresholds of cases whose plates differ."""
    axes, x, y = graph.axes, graph.x, graph.y
    thresholds = contents.thresholds
    highest = 1.05 * float(np.nanmax(thresholds))
    if x is contents.shown:
        axes.set_xlim(right=max(axes.get_xlim()[1], highest))
        axes.plot(thresholds, y.values, "|", color="0.2", ms=11.0, label=THRESHOLD)
        return

    axes.set_ylim(top=max(axes.get_ylim()[1], highest))
    parameters = [*contents.over, contents.other]
    texts = next(
        (parameter for parameter in parameters if parameter is not None and parameter.ticks), None
    )
    if texts is None and contents.other is not None:
        axes.plot(x.values, thresholds, "_", color="0.2", label=THRESHOLD)
        return
    axes.plot([], [], label=THRESHOLD, **LEVEL)  # for the legend
    for row, here in enumerate(runs_in_order(x, texts)):
        look = LEVEL | ({"color": style.colours()[row]} if texts else {})
        axes.plot(x.values[here], thresholds[here], **look)


# Heights of a row of texts, of the room around the rows, and of a colour bar (in).
ROW = 0.17
AROUND = 0.75
BAR = 0.45
FEWEST_ROWS = 4  # rows for which there is room at least
MARK: style.Look = {"color": "0.25", "ms": 3.5, "ls": "none", "zorder": 4, "clip_on": False}
# Marks of cases beyond the range of the model, on coloured points and around points of a graph.
ON_POINT = MARK | {"marker": "$/$", "mew": 0.0}
AROUND_POINT = MARK | {"marker": "o", "mfc": "none", "mew": 0.6, "ms": 5.5}


def parameter_map(
    results: Mapping[str, SweepResult],
    *,
    quantity: str = "",
    over: Sequence[str] = (),
    where: Where | None = None,
    level: Sequence[float] = (),
    width: Width = "column",
) -> Picture:
    """Draw a quantity of a sweep's cases over one or two varying parameters.

    Over one parameter, the map has points, which are joined if each value has one case; texts have
    rows. Over two parameters, it has cells with contour lines if the cases form a full grid, else
    coloured points. If one parameter is a text, each text has a curve, or a row of cells if there
    are too many curves.

    `quantity` is a name of the sweep's summary, by default the peak force, or the velocity that was
    searched. `over` has one or two parameters, by default all that vary. `where` selects the cases
    with these values; numbers select the nearest value. `level` has values to mark (the deck's
    unit).
    """
    ((name, sweep),) = results.items()
    contents = choose(sweep, name, quantity=quantity, over=over, where=where or {}, level=level)
    graph = _draw(contents, width)
    by_colours = contents.shown is not graph.x and contents.shown is not graph.y
    crosses = MARK | {"marker": "x"}
    lines = _mark_cases(graph, contents.ended, crosses, "\N{MULTIPLICATION SIGN}")
    lines += _mark_beyond(graph, contents.beyond, by_colours=by_colours)
    if by_colours:
        draw_equal_energies(graph.axes, sweep, graph.x, graph.y)
    style.footer(graph.axes, lines)
    if len(contents.thresholds):
        (mark_threshold_contours if by_colours else mark_threshold_curves)(graph, contents)
    notes = name_levels(graph, contents) if by_colours else []
    if contents.title:
        graph.axes.set_title(contents.title, loc="left")
    figure = cast(Figure, graph.axes.figure)
    style.lines_legend(figure, graph.axes)
    return Picture(figure, notes=notes)


def _draw(contents: MapContents, width: Width) -> Graph:
    """Draw the values: over one parameter as a graph, over two by colours or as curves."""
    shown, other = contents.shown, contents.other
    x, y = contents.over if len(contents.over) > 1 else (contents.over[0], shown)
    if x.ticks:  # texts lie along y
        x, y = y, x

    texts = other if y is shown else y  # one curve each
    if x is not shown and texts is not None and 0 < len(texts.ticks) <= MOST_CURVES:
        return draw_curves(x, texts, contents, width)

    if y.ticks:  # in rows, the first at the top
        bar = 0.0 if x is shown and other is None else BAR
        height = AROUND + ROW * max(len(y.ticks), FEWEST_ROWS) + bar
        _, (axes,) = style.panels(width, ratio=height / style.WIDTHS[width])
        axes.set_yticks(range(len(y.ticks)), y.ticks)
        axes.set_ylim(len(y.ticks) - 0.5, -0.5)
    else:
        _, (axes,) = style.panels(width, tall=1.0 if y is shown else 1.35)
    graph = Graph(axes, x, y)
    if len(contents.over) > 1:
        draw_field(graph, contents)
    else:
        draw_points(graph, contents)
    return graph


def _mark_beyond(graph: Graph, masks: Mapping[str, Bools], *, by_colours: bool) -> list[str]:
    """Mark cases beyond the range of the model; return lines that count them by reason."""
    if not by_colours:
        return _mark_cases(graph, masks, AROUND_POINT, "\N{WHITE CIRCLE}")
    if masks and hatch(graph.axes, graph.x, graph.y, _any_of(masks)):
        return case_counts(masks, "hatched: ")
    return _mark_cases(graph, masks, ON_POINT, "/")


def _mark_cases(graph: Graph, masks: Mapping[str, Bools], look: style.Look, sign: str) -> list[str]:
    """Mark cases; return lines that count them by reason. `sign` is the mark as text."""
    if masks:
        is_marked = _any_of(masks)
        graph.axes.plot(graph.x.values[is_marked], graph.y.values[is_marked], **look)
    return case_counts(masks, f"{sign} ")


def _any_of(masks: Mapping[str, Bools]) -> Bools:
    return np.asarray(np.logical_or.reduce(list(masks.values())))
