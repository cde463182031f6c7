"""Maps of a sweep over one parameter: points, curves by the texts of another, rows of texts."""

from __future__ import annotations

import numpy as np

from fecm._typing import Indices
from fecm.plot import style
from fecm.plot.kinds import Width
from fecm.plot.map_contents import LEVEL, THRESHOLD, Contents, Graph
from fecm.plot.map_fields import draw_bar, norm_of
from fecm.plot.sweep_data import Variable

MARKERS = "osD^vP*"


def draw_curves(x: Variable, texts: Variable, contents: Contents, width: Width) -> Graph:
    """Draw a curve of the quantity over x for each text."""
    _, (axes,) = style.panels(width, tall=1.15)
    looks = zip(texts.ticks, style.colours(), MARKERS, strict=False)
    for here, (text, colour, marker) in zip(runs(x, texts), looks, strict=True):
        values = contents.shown.values[here]
        if not np.isnan(values).all():  # else they have failed
            axes.plot(x.values[here], values, marker=marker, color=colour, ms=2.2, label=text)
    graph = Graph(axes, x, contents.shown)
    _finish(graph, contents)
    return graph


def draw_points(graph: Graph, contents: Contents) -> None:
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
        (order,) = runs(x, None)
        axes.plot(x.values[order], y.values[order], "o-", color=style.colours()[0], ms=2.5)
    _finish(graph, contents)


def runs(x: Variable, texts: Variable | None) -> list[Indices]:
    """Cases in the order of x: those of every text, or all."""
    order = np.argsort(x.values, kind="stable")
    if texts is None:
        return [order]
    return [order[texts.values[order] == row] for row in range(len(texts.ticks))]


def _finish(graph: Graph, contents: Contents) -> None:
    """Label the axes and mark the levels; the axis of the quantity begins at zero if it can."""
    axes, shown = graph.axes, contents.shown
    across = graph.x is shown
    graph.label()
    for level in contents.levels:
        look = LEVEL | {"label": f"{level.name} {shown.scale.show(level.value)}"}
        if not level.is_threshold:
            look["linestyle"] = style.DOTTED
        if across:
            axes.axvline(level.value, **look)
        else:
            axes.axhline(level.value, **look)
    lowest, highest = shown.range
    if lowest >= 0.0:
        thresholds = [level.value for level in contents.levels if level.is_threshold]
        end = 1.05 * max(highest, *thresholds, 0.0) or 1.0  # with room for the markers
        if across:
            axes.set_xlim(0.0, end)
        else:
            axes.set_ylim(0.0, end)
    if across:
        axes.grid(axis="y", linewidth=0.4, color="0.85")
        axes.set_axisbelow(True)


def mark_thresholds(graph: Graph, contents: Contents) -> None:
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
    texts = next((one for one in parameters if one is not None and one.ticks), None)
    if texts is None and contents.other is not None:
        axes.plot(x.values, thresholds, "_", color="0.2", label=THRESHOLD)
        return
    axes.plot([], [], label=THRESHOLD, **LEVEL)  # for the legend
    for row, here in enumerate(runs(x, texts)):
        look = LEVEL | ({"color": style.colours()[row]} if texts else {})
        axes.plot(x.values[here], thresholds[here], **look)
