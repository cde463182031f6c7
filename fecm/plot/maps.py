"""Maps of a sweep: a quantity of every case over one or two varying parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import cast

import numpy as np
from matplotlib.figure import Figure

from fecm._typing import Bools
from fecm.plot import map_fields, map_graphs, style
from fecm.plot.kinds import Picture, Width
from fecm.plot.map_contents import MOST_CURVES, Contents, Graph, choose
from fecm.plot.sweep_data import Where, counts
from fecm.sweeps.result import SweepResult

# Heights of a row of texts, of everything around the rows, and of a colour bar (in).
ROW = 0.17
AROUND = 0.75
BAR = 0.45
FEWEST_ROWS = 4  # that the height has room for
MARK: style.Look = {"color": "0.25", "ms": 3.5, "ls": "none", "zorder": 4, "clip_on": False}
# Marks of cases beyond the range of the model, on colours and around the points of a graph.
HATCHING = MARK | {"marker": "$/$", "mew": 0.0}
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

    One parameter: points, joined if each has one case; texts are rows.  Two: cells with contour
    lines if the cases form a full grid, else coloured points; if one parameter is a text, one curve
    per text, or rows of cells if there are too many curves.

    `quantity` is a name of the sweep's summary, by default the peak force, or the velocity found;
    `over` one or two parameters, by default all that vary.  `where` selects the cases with these
    values, of numbers the nearest; `level` are values to mark (the deck's unit).
    """
    ((name, sweep),) = results.items()
    contents = choose(sweep, name, quantity=quantity, over=over, where=where or {}, level=level)
    graph = _draw(contents, width)
    by_colours = contents.shown is not graph.x and contents.shown is not graph.y
    beyond, sign = (HATCHING, "/") if by_colours else (AROUND_POINT, "\N{WHITE CIRCLE}")
    lines = [
        *_mark_cases(graph, contents.ended, MARK | {"marker": "x"}, "\N{MULTIPLICATION SIGN}"),
        *_mark_cases(graph, contents.beyond, beyond, sign),
    ]
    style.footer(graph.axes, lines)
    if len(contents.thresholds):
        (map_fields if by_colours else map_graphs).mark_thresholds(graph, contents)
    notes = map_fields.name_levels(graph, contents) if by_colours else []
    if contents.title:
        graph.axes.set_title(contents.title, loc="left")
    figure = cast(Figure, graph.axes.figure)
    style.lines_legend(figure, graph.axes)
    return Picture(figure, notes=notes)


def _draw(contents: Contents, width: Width) -> Graph:
    """Draw the values: over one parameter as a graph, over two by colours or as curves."""
    shown, other = contents.shown, contents.other
    x, y = contents.over if len(contents.over) > 1 else (contents.over[0], shown)
    if x.ticks:  # texts lie along y
        x, y = y, x

    texts = other if y is shown else y  # of the curves
    if x is not shown and texts is not None and 0 < len(texts.ticks) <= MOST_CURVES:
        return map_graphs.draw_curves(x, texts, contents, width)

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
        map_fields.draw_field(graph, contents)
    else:
        map_graphs.draw_points(graph, contents)
    return graph


def _mark_cases(graph: Graph, masks: Mapping[str, Bools], look: style.Look, sign: str) -> list[str]:
    """Mark cases that are something; return lines that count them, `sign` is the mark as text."""
    if masks:
        some = np.logical_or.reduce(list(masks.values()))
        graph.axes.plot(graph.x.values[some], graph.y.values[some], **look)
    return counts(masks, f"{sign} ")
