"""The mesh with its supports, impact point and contact patch (the report's figure 4.11 a)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D

from fecm._typing import Bools
from fecm.deck.model import Impact
from fecm.plot.data import Array, circle, deck_of, patches, require, struck
from fecm.plot.kinds import Picture
from fecm.plot.style import COLOURS, WIDTHS, legend, panels, scale_of
from fecm.results.result import Result

# Marks of the supports by their label.
MARKS: dict[str, dict[str, Any]] = {
    "clamped": {"marker": "s", "color": COLOURS[0], "ms": 3.0},
    "w held": {"marker": "^", "color": COLOURS[0], "ms": 3.5, "mfc": "white", "mew": 0.7},
    "rotation held": {"marker": "o", "color": COLOURS[2], "ms": 3.0, "mfc": "white", "mew": 0.7},
}


def supports(result: Result) -> dict[str, Bools]:
    """Masks of the nodes held against bending, by kind of support; each (numnp,)."""
    held = result["mesh/equations"][:, 2:5] == 0
    w, rotations = held[:, 0], held[:, 1:]
    clamped = w & rotations.all(axis=1)
    clamped &= ~_corners(result["mesh/elements"], w, clamped)
    return {"clamped": clamped, "w held": w & ~clamped, "rotation held": ~w & rotations.any(axis=1)}


def _corners(elements: Array, w: Bools, full: Bools) -> Bools:
    """Fully held nodes of elements with other nodes that hold w, none of these fully held."""
    nodes, present = elements - 1, elements > 0
    one = (full[nodes] & present).sum(axis=1) == 1
    several = (w[nodes] & present).sum(axis=1) > 1
    found, others = np.zeros_like(full), np.zeros_like(full)
    found[nodes[(one & several)[:, None] & present]] = True
    others[nodes[~one[:, None] & present]] = True
    return np.asarray(full & found & ~others)


def draw_circle(axes: Axes, result: Result, name: str, **style: Any) -> list[Line2D]:
    """Draw the circle of the contact patch, if there is one, on axes of x and y."""
    found = circle(result, name)
    if found is None:
        return []
    centre, radius = found
    angle = np.linspace(0.0, 2.0 * np.pi, 73)
    x, y = centre[:, None] + radius * np.stack([np.cos(angle), np.sin(angle)])
    return axes.plot(x, y, lw=0.7, **style)


def mark_impact(axes: Axes, result: Result, name: str) -> None:
    """Mark the impact point and the contact patch in black."""
    axes.plot(*struck(result, name).T, "+", color="black", ms=4, mew=0.6, clip_on=False)
    draw_circle(axes, result, name, color="black")


def mesh(
    results: Mapping[str, Result], *, at: Sequence[tuple[float, float]] = (), width: str = "column"
) -> Picture:
    """Elements, supports, impact point, contact patch, and points to mark (`at`)."""
    ((name, result),) = results.items()
    coordinates, _ = require(result, name, "mesh/coordinates", "mesh/elements")
    cut = patches(result, 4, name)
    place = scale_of(results, "length", [coordinates])
    low, high = cut.points.min(axis=0), cut.points.max(axis=0)
    height = float(np.clip((high - low)[1] / (high - low)[0], 0.3, 2.0))
    figure, (axes,) = panels(width, ratio=height + (0.55 - 0.5 * height) / WIDTHS[width])
    sides = [cut.points[edge] for edge in cut.edges]
    axes.add_collection(LineCollection(sides, colors="0.4", linewidths=0.4))
    handles, labels = [], []
    for label, nodes in supports(result).items():
        if nodes.any():
            held = coordinates[nodes, :2]
            handles += axes.plot(*held.T, ls="none", clip_on=False, **MARKS[label])
            labels.append(label)
    where = struck(result, name)
    if len(where):
        mark: dict[str, Any] = (
            {"marker": "+"} if circle(result, name) else {"marker": "X", "mec": "white"}
        )
        handles += axes.plot(
            *where.T, color=COLOURS[1], ms=6.0, mew=0.5, ls="", clip_on=False, **mark
        )
        labels.append("impact" if deck_of(result, name).has(Impact) else "load")
    if ring := draw_circle(axes, result, name, color=COLOURS[1]):
        handles += ring
        labels.append("contact patch")
    if at:
        handles += axes.plot(*np.array(at).T, "D", color=COLOURS[3], ms=3.5, clip_on=False)
        labels.append("points")
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    place.name(axes.xaxis, "$x$")
    place.name(axes.yaxis, "$y$")
    legend(figure, handles, labels)
    return Picture(figure)
