"""Drawing of the test: plate with supports and load from above, a section, and the plies."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib import colormaps, rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from fecm._typing import Bools, Floats
from fecm.deck.catalogue import material_names
from fecm.deck.material_cards import Layer
from fecm.deck.units import mass_in_si, quantity, unit_names, unit_of
from fecm.plot import data, style
from fecm.plot.mesh import MARKS, MASS, Support, draw_plate, masses, support_masks
from fecm.plot.plate import aspect
from fecm.problem.parts import rod_of_deck
from fecm.problem.problem import Problem
from fecm.report.subject import Impactor
from fecm.results.result import Result

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.axes import Axes

WIDTH = 3.5  # of the figure (in)
OF_PLATE, OF_STACK = 0.8, 0.2  # of the width
DRAWN = 2.3  # width of the plate without the axis (in)
ROOM = 0.9  # for axes and legend, above and below the plate (in)
LEAST_HEIGHT = 2.6  # of the figure, for the labels of the plies (in)
OF_SECTION = 0.28  # height of the section over the width of the plate
PERIOD = 180.0  # degrees after which a fibre direction repeats
MOST_NAMED = 40  # plies that are labelled one by one
LARGEST_LABEL, SMALLEST_LABEL = 6.5, 4.0  # points


def arrangement(name: str, result: Result, problem: Problem, hits: Impactor) -> Figure:
    """Draw the test to scale. Raises PlotError if the result lacks the mesh or the deck."""
    with rc_context(style.RC | {"axes.formatter.use_mathtext": False}):
        cut = data.patches(result, 4, name)
        length = style.scale_of({name: result}, "length", [result["mesh/coordinates"]])
        high = max(LEAST_HEIGHT, DRAWN * (aspect(cut.points) + OF_SECTION) + ROOM)
        figure = Figure(figsize=(WIDTH, high), layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.subplot_mosaic(
            [["plate", "plies"], ["section", "plies"]],
            width_ratios=(OF_PLATE, OF_STACK),
            height_ratios=(aspect(cut.points), OF_SECTION),
        )
        plate, section = axes["plate"], axes["section"]
        draw_plate(plate, result, name, cut, "0.85")
        low, high_end = cut.points.min(axis=0), cut.points.max(axis=0)
        plate.set(xlim=(low[0], high_end[0]), ylim=(low[1], high_end[1]), aspect="equal")
        length.name(plate.yaxis, "$y$")
        plate.tick_params(labelbottom=False)
        _section(section, name, result, problem, hits)
        section.set(xlim=(low[0], high_end[0]))
        length.name(section.xaxis, "$x$")
        layers = list(problem.deck.layers.values())[problem.laminate_number]
        draw_stack(axes["plies"], layers, material_names(problem.deck), high)
        depth = style.scale_of({name: result}, "length", [np.array([problem.laminate.thickness])])
        depth.name(axes["plies"].yaxis, "Depth")
        style.lines_legend(figure, plate)
    return figure


def _section(axes: Axes, name: str, result: Result, problem: Problem, hits: Impactor) -> None:
    """Draw the section along x through the impact point, to scale, and the projectile.

    Clamps and point masses behind it are drawn as well.
    """
    coordinates = result["mesh/coordinates"]
    (x0, y0) = data.impact_point(result, name)
    ends = coordinates[:, 0].min(), coordinates[:, 0].max()
    wide, h = float(ends[1] - ends[0]), problem.laminate.thickness
    axes.add_patch(Rectangle((ends[0], 0.0), wide, -h, fc="0.6", ec="0.2", lw=0.5))
    level = np.abs(coordinates[:, 1] - y0)
    on_section = level <= level.min() + 1e-6 * wide
    struck = np.zeros_like(on_section)  # nodes with a one-sided support on the struck face
    if (supports := problem.moving_plate.supports) is not None:
        struck[supports.node[supports.side < 0.0]] = True
    tips = problem.rests & ~problem.knife_edges  # of clamps, seen behind the section
    masks = support_masks(result)
    above, below = 0.03 * wide, -h - 0.03 * wide
    for support in (Support.CLAMPED, Support.W_HELD, Support.SPRING, Support.ONE_SIDED):
        look = MARKS[support] | {"ls": "none", "clip_on": False}
        at_section = masks[support] & on_section & ~tips
        axes.plot(*_row(coordinates, at_section & ~struck, below), **look)
        axes.plot(
            *_row(coordinates, (at_section & struck) | (masks[support] & tips), above), **look
        )
    axes.plot(*_row(coordinates, masses(result, name), above), clip_on=False, **MASS)
    top, names = 0.2 * wide, unit_names(problem.deck)
    rod = rod_of_deck(problem.deck)
    if rod is not None and hits.name == rod.kind:
        d = rod.diameters[0]
        shown = min(rod.length, top)
        axes.add_patch(Rectangle((x0 - d / 2.0, 0.0), d, shown, fc="0.8", ec="0.2", lw=0.5))
    else:
        axes.annotate(
            "", (x0, 0.0), (x0, top), arrowprops={"arrowstyle": "-|>", "lw": 0.8, "color": "0.2"}
        )
    mass = mass_in_si(hits.mass, names) or f"{hits.mass:.4g}"
    speed = quantity(hits.velocity, unit_of("length/time", names))
    words = f" {mass} at {speed}"
    axes.text(x0, 0.7 * top, f"   {words}", va="center", fontsize=LARGEST_LABEL)
    axes.set(ylim=(-h - 0.06 * wide, 1.05 * top), aspect="equal", yticks=[])
    axes.spines["left"].set_visible(False)


def _row(coordinates: Floats, nodes: Bools, height: float) -> tuple[Floats, Floats]:
    """Return x of nodes of a mask, (n,), and a height for each."""
    x = coordinates[nodes, 0]
    return x, np.full(len(x), height)


def draw_stack(
    axes: Axes, layers: Sequence[Layer], names: Mapping[int, str], height: float
) -> None:
    """Draw the plies from the struck face down, to scale, on axes of a height in inches.

    `names` has the names of the materials by number. They are left out if there is one material.
    """
    edges = np.concatenate([[0.0], np.cumsum([layer.thickness for layer in layers])])
    several = len({layer.material for layer in layers}) > 1
    colours = colormaps["twilight"]
    size = float(np.clip(0.75 * 72.0 * height / len(layers), SMALLEST_LABEL, LARGEST_LABEL))
    for layer, top, bottom in zip(layers, edges[:-1], edges[1:], strict=True):
        colour = colours(0.15 + 0.7 * (layer.angle % PERIOD) / PERIOD)
        axes.add_patch(
            Rectangle((0.0, top), 1.0, bottom - top, fc=colour, ec="white", lw=0.5, alpha=0.6)
        )
        if len(layers) <= MOST_NAMED:
            label = f"{layer.angle:g}°"
            if several:
                label = f"{label}  {names.get(layer.material, layer.material)}"
            middle = 0.5 * (top + bottom)
            axes.text(0.5, middle, label, va="center", ha="center", fontsize=size)
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(edges[-1], 0.0)
    axes.set_xticks([])
    axes.spines["bottom"].set_visible(False)
