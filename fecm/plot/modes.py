"""Picture of natural modes: the shape of each one, with its nodal lines."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize
from matplotlib.ticker import MaxNLocator
from matplotlib.tri import Triangulation

from fecm._text import significant
from fecm._typing import Floats
from fecm.mechanics.interpolation import W
from fecm.plot import data, style
from fecm.plot.kinds import Picture, Width
from fecm.plot.plate import LEVELS, aspect, mark_impact
from fecm.results.modes import frequencies_of, is_in_plane
from fecm.results.result import Result

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLUMNS: dict[Width, int] = {"column": 2, "full": 4}
TITLE = 0.3  # height of a title and its room (in)
LABELS = 0.35  # height of the numbers and the name of an axis (in)
MOVED = 0.1  # largest displacement of a mode in the plane, over the longer side
LEAST = 0.01  # of the largest w: a nodal line is drawn between larger values of both signs


def modes_picture(results: Mapping[str, Result], *, width: Width = "full") -> Picture:
    """Draw the deflection of every stored mode, with its frequency.

    Each mode has a scale of its own. Nodal lines are black; a mode in the plane is drawn by the
    displaced elements.
    """
    ((name, result),) = results.items()
    shapes, _ = data.require_datasets(result, name, "modes/shape", "modes/angular_frequency")
    frequencies, numbers = frequencies_of(result), result["modes/number"]
    cut = data.patches(result, 4, name)
    place = style.scale_of(results, "length", [cut.points])
    columns = min(len(shapes), COLUMNS[width])
    rows = math.ceil(len(shapes) / columns)
    texts = TITLE + LABELS / rows
    ratio = aspect(cut.points) + texts * columns / style.WIDTHS[width]
    figure, axes = style.panels(width, rows, columns, sharex=True, sharey=True, ratio=ratio)
    for ax, number, frequency, shape in zip(
        axes, numbers, frequencies.values, shapes, strict=False
    ):
        if is_in_plane(shape):
            _draw_displaced(ax, cut, shape)
        else:
            _draw_deflection(ax, cut, shape)
        mark_impact(ax, result, name)
        value = f"{significant(float(frequency))} {frequencies.unit}" if frequency else "rigid"
        ax.set_title(f"{number}: {value}".rstrip(), loc="left")
        ax.set_aspect("equal")
    for ax in axes[-columns:]:
        place.name(ax.xaxis, "$x$")
        ax.xaxis.set_major_locator(MaxNLocator(3, prune="upper"))
    for ax in axes[::columns]:
        place.name(ax.yaxis, "$y$")
    for ax in axes[len(shapes) :]:
        ax.set_axis_off()
    return Picture(figure)


def _draw_deflection(ax: Axes, cut: data.Patches, shape: Floats) -> None:
    """Draw w of a mode in colours, and its nodal lines."""
    w = cut.values(shape[:, W])
    w = w / np.abs(w).max()
    triangles = Triangulation(cut.points[:, 0], cut.points[:, 1], cut.triangles)
    levels = np.linspace(-1.0, 1.0, LEVELS)
    fill = ax.tricontourf(triangles, w, levels, cmap=style.DIVERGING, norm=Normalize(-1.0, 1.0))
    fill.set(edgecolor="face", linewidth=0.2)  # hides white seams
    if w.min() < -LEAST and w.max() > LEAST:
        ax.tricontour(triangles, w, [0.0], colors="black", linewidths=0.5)


def _draw_displaced(ax: Axes, cut: data.Patches, shape: Floats) -> None:
    """Draw the elements, displaced in the plane."""
    moved = np.column_stack([cut.values(shape[:, dof]) for dof in range(W)])
    size = MOVED * float(np.ptp(cut.points, axis=0).max()) / float(np.abs(moved).max())
    sides = [(cut.points + size * moved)[edge] for edge in cut.edges]
    ax.add_collection(LineCollection(sides, colors="0.4", linewidths=0.4))
    ax.autoscale_view()
