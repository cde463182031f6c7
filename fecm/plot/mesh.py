"""Picture of the mesh: elements, supports, impact point, patch; and of the rod (figure 4.11)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np
from matplotlib import colormaps
from matplotlib.collections import LineCollection, PolyCollection

from fecm._typing import Bools
from fecm.deck.model import Impact
from fecm.mechanics.interpolation import W
from fecm.mechanics.projectile import Rod
from fecm.plot import data, style
from fecm.plot.kinds import Picture, PlotError, Width
from fecm.plot.plate import aspect, draw_circle
from fecm.problem.parts import build_projectile, rod_of_deck
from fecm.problem.supports import point_masses
from fecm.results.result import Result
from fecm.results.summary import radii_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes


class Support(StrEnum):
    """Bending support of a node, as the legend names it."""

    CLAMPED = "clamped"
    W_HELD = "w held"
    ROTATION_HELD = "rotation held"
    SPRING = "spring"
    ONE_SIDED = "pushes only"


RESTRAINTS = (Support.CLAMPED, Support.W_HELD, Support.ROTATION_HELD)
HOLLOW: style.Look = {"mfc": "white", "mew": 0.7}
FAINT = 0.45  # opacity of the laminates' colours below the mesh
# Marks of the supports.
MARKS: dict[Support, style.Look] = {
    Support.CLAMPED: {"marker": "s", "color": style.COLOURS[0], "ms": 3.0},
    Support.W_HELD: HOLLOW | {"marker": "^", "color": style.COLOURS[0], "ms": 3.5},
    Support.ROTATION_HELD: HOLLOW | {"marker": "o", "color": style.COLOURS[2], "ms": 3.0},
    Support.SPRING: {"marker": "D", "color": style.COLOURS[3], "ms": 3.0},
    Support.ONE_SIDED: HOLLOW | {"marker": "v", "color": style.COLOURS[0], "ms": 3.5},
}
MASS: style.Look = {"marker": "o", "color": "0.2", "ms": 4.0, "ls": "none"}  # of a point mass


def support_masks(result: Result) -> dict[Support, Bools]:
    """Return masks of the nodes that are supported against bending, (numnp,), by kind."""
    held = result["mesh/equations"][:, 2:5] == 0
    w, rotations = held[:, 0], held[:, 1:]
    full = w & rotations.all(axis=1)
    # At a corner of a simply supported plate, one node of an element is fully held; in other nodes
    # only w is held.
    nodes, present = result["mesh/elements"] - 1, result["mesh/elements"] > 0
    has_one_end = (full[nodes] & present).sum(axis=1) == 1
    several = (w[nodes] & present).sum(axis=1) > 1
    corners, other_nodes = np.zeros_like(full), np.zeros_like(full)
    corners[nodes[(has_one_end & several)[:, None] & present]] = True
    other_nodes[nodes[~has_one_end[:, None] & present]] = True
    clamped = full & ~(corners & ~other_nodes)
    springs, one_sided = np.zeros_like(w), np.zeros_like(w)
    if "supports/node" in result:
        rows, pushes = result["supports/node"] - 1, result["supports/side"] != 0
        springs[rows[~pushes]] = one_sided[rows[pushes]] = True
    return {
        Support.CLAMPED: clamped,
        Support.W_HELD: w & ~clamped,
        Support.ROTATION_HELD: ~w & rotations.any(axis=1),
        Support.SPRING: springs,
        Support.ONE_SIDED: one_sided,
    }


def masses(result: Result, name: str) -> Bools:
    """Return the nodes with point masses, (numnp,)."""
    numnp = len(result["mesh/coordinates"])
    return np.asarray(point_masses(data.result_deck(result, name), numnp)[:, W] > 0.0)


def mesh_picture(
    results: Mapping[str, Result],
    *,
    at: Sequence[tuple[float, float]] = (),
    projectile: bool = False,
    width: Width = "column",
) -> Picture:
    """Draw elements, supports, point masses, impact point, contact patch, and the points `at`.

    With `projectile`, the elements of the rod are drawn below.
    """
    ((name, result),) = results.items()
    coordinates, _ = data.require_datasets(result, name, "mesh/coordinates", "mesh/elements")
    cut = data.patches(result, 4, name)
    place = style.scale_of(results, "length", [coordinates])
    low, high = cut.points.min(axis=0), cut.points.max(axis=0)
    height = aspect(cut.points)
    ratio = height + (0.55 - 0.5 * height) / style.WIDTHS[width]
    rod = _rod(result, name) if projectile else None
    if rod is None:
        figure, (axes,) = style.panels(width, ratio=ratio)
    else:
        slender = max(rod.diameters) / rod.length + 0.5 / style.WIDTHS[width]
        heights, mean = [ratio, slender], 0.5 * (ratio + slender)
        figure, (axes, below) = style.panels(width, 2, ratio=mean, height_ratios=heights)
        _draw_rod(below, rod, place)
    draw_plate(axes, result, name, cut)
    if at:
        x, y = np.array(at).T
        axes.plot(x, y, "D", clip_on=False, color=style.COLOURS[3], ms=3.5, label="points")
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    place.name(axes.xaxis, "$x$")
    place.name(axes.yaxis, "$y$")
    if "mesh/z" in result:
        axes.set_title(_curved(result, name, place), loc="left")
    style.lines_legend(figure, axes)
    return Picture(figure)


def draw_plate(
    axes: Axes, result: Result, name: str, cut: data.Patches, colour: str = "0.4"
) -> None:
    """Draw elements with lines of a colour, supports, masses, impact point and contact patch."""
    _colour_laminates(axes, result, name, cut)
    sides = [cut.points[edge] for edge in cut.edges]
    axes.add_collection(LineCollection(sides, colors=colour, linewidths=0.4))
    for support, nodes in support_masks(result).items():
        if nodes.any():
            x, y = result["mesh/coordinates"][nodes, :2].T
            axes.plot(x, y, ls="none", clip_on=False, label=support, **MARKS[support])
    if (with_mass := masses(result, name)).any():
        x, y = result["mesh/coordinates"][with_mass, :2].T
        axes.plot(x, y, clip_on=False, label="point mass", **MASS)
    _mark_load(axes, result, name)


def _rod(result: Result, name: str) -> Rod:
    """Return the rod of a result; raise PlotError if its projectile is not a rod."""
    deck = data.result_deck(result, name)
    rod = rod_of_deck(deck)
    if rod is None:
        kind = build_projectile(deck).kind
        raise PlotError(f"the projectile of {name} is a {kind}, which has no elements to draw")
    return rod


def _draw_rod(axes: Axes, rod: Rod, place: style.AxisScale) -> None:
    """Draw the elements of a rod, whose impacted end is at 0."""
    ends = rod.element_length * np.arange(rod.elements + 1.0)
    boxes = [
        [(first, -d / 2.0), (last, -d / 2.0), (last, d / 2.0), (first, d / 2.0)]
        for first, last, d in zip(ends[:-1], ends[1:], rod.diameters, strict=True)
    ]
    axes.add_collection(PolyCollection(boxes, facecolors="none", edgecolors="0.4", linewidths=0.4))
    reach = 0.5 * max(rod.diameters)
    axes.set(xlim=(0.0, rod.length), ylim=(-reach, reach), aspect="equal")
    place.name(axes.xaxis, "Distance from the impacted end")
    place.name(axes.yaxis, "Radius")


def _curved(result: Result, name: str, place: style.AxisScale) -> str:
    """Return the title of a curved panel, with its radii and its rise."""
    (z,) = data.require_datasets(result, name, "mesh/z")
    named = [f"$R_{{{axis}}}$ {place.show(radius)}" for axis, radius in radii_of(result).items()]
    return ", ".join(["curved", *named, f"rise {place.show(float(np.ptp(z)))}"])


def _colour_laminates(axes: Axes, result: Result, name: str, cut: data.Patches) -> None:
    """Fill the elements with a colour for each laminate if there are several."""
    if "mesh/laminate" not in result:
        return
    (of_elements,) = data.require_datasets(result, name, "mesh/laminate")
    rows = np.concatenate([block.rows for block, _ in cut.parts])
    numbers = np.unique(of_elements)
    shades = colormaps[style.SEQUENTIAL](np.linspace(1.0, 0.25, len(numbers)))
    for number, shade in zip(numbers, shades, strict=True):
        used = [
            cut.points[edge]
            for edge, row in zip(cut.edges, rows, strict=True)
            if of_elements[row] == number
        ]
        axes.add_collection(PolyCollection(used, facecolors=shade, alpha=FAINT, linewidths=0.0))
        label = f"laminate {number}"
        axes.plot([], [], "s", color=shade, alpha=FAINT, ms=5.0, label=label)


def _mark_load(axes: Axes, result: Result, name: str) -> None:
    """Mark the impact point or the load, and the contact patch."""
    where = data.struck(result, name)
    if len(where):
        in_patch = data.circle(result, name) is not None
        mark: style.Look = {"marker": "+"} if in_patch else {"marker": "X", "mec": "white"}
        mark["label"] = "impact" if data.result_deck(result, name).has(Impact) else "load"
        axes.plot(*where.T, color=style.COLOURS[1], ms=6.0, mew=0.5, ls="", clip_on=False, **mark)
    draw_circle(axes, result, name, color=style.COLOURS[1], label="contact patch")
