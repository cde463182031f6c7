"""Picture of an impact that strain gages located: place, force, and the strains of every gage."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import LogNorm
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator

from fecm._typing import Floats, Indices
from fecm.deck.model import Gages
from fecm.plot import style
from fecm.plot.kinds import Picture
from fecm.problem.generate import generate

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from fecm.location.location import Location

COLUMNS = 2
MOST_GAGES = 12  # most gages whose strains are drawn
# Heights of the room around the map, of the force, and of a row of strains (in).
AROUND_MAP = 1.05
FORCE = 1.85
STRAINS = 1.15
CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
ROOM = 0.05  # room above and below every graph and its legend (in)
GAGE_LENGTH = 0.05  # length of a gage's mark, over the longer side of the plate
ZOOM = 1.6  # half the side of the zoom over the reach of the ellipse
FOUND = style.COLOURS[1]
FITTED = style.COLOURS[0]
CROSS: style.Look = {"marker": "+", "color": FOUND, "ms": 8.0, "mew": 1.4, "ls": "none"}
OTHER: style.Look = {"marker": "D", "mec": FOUND, "mfc": "white", "ms": 4.5, "ls": "none"}


def location(results: Mapping[str, Location]) -> Picture:
    """Draw the misfit with the located place, the fitted force, and measured and fitted strains.

    The second panel enlarges the place and its 95 % ellipse.
    """
    (located,) = results.values()
    count = len(located.gages)
    shown = min(count, MOST_GAGES)
    rows = -(-shown // COLUMNS)
    outline = _outline(located)
    ends = outline.reshape(-1, 2)
    extent = np.ptp(ends, axis=0)
    inches = style.WIDTHS["full"]
    map_height = AROUND_MAP + min(extent[1] / extent[0], 1.5) * inches / COLUMNS
    heights = [map_height, FORCE, *[STRAINS] * rows]
    figure, axes = style.panels(
        "full",
        len(heights),
        COLUMNS,
        ratio=sum(heights) / inches * COLUMNS / len(heights),
        height_ratios=heights,
    )
    if isinstance(layout := figure.get_layout_engine(), ConstrainedLayoutEngine):
        layout.set(h_pad=ROOM)
    grid = axes[0].get_gridspec()
    assert grid is not None  # of the panels
    for unused in (*axes[2:4], *axes[4 + shown :]):
        unused.remove()

    place = style.scale_in(located.units, "length", ends)
    _draw_map(axes[0], located, outline, place)
    _draw_zoom(axes[1], located, place)
    _draw_force(figure.add_subplot(grid[1, :]), located)
    _draw_strains(axes[4 : 4 + shown], located)
    notes = [f"the strains of {shown} of {count} gages are drawn"] if shown < count else []
    return Picture(figure, notes=notes)


@style.styled
def location_picture(located: Location) -> Picture:
    """Return the picture of :func:`location` in the style of the command line."""
    return location({"": located})


def _outline(located: Location) -> Floats:
    """Return the outline of the plate: sides of elements from corner to corner, (n, 2, 2)."""
    mesh = generate(located.deck)
    sides: list[Indices] = []
    for block in mesh.families:
        corners = block.nodes[:, : block.shape.corners]
        sides.append(np.stack([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 2))
    ends, times = np.unique(np.sort(np.concatenate(sides), axis=1), axis=0, return_counts=True)
    return np.asarray(mesh.coordinates[ends[times == 1], :2])


def _cells(located: Location, size: float) -> Floats:
    """Return the corners of a rectangle around every candidate, (n, 4, 2).

    The rectangles nearly touch. Where all candidates are on a line, they are a tenth of the plate's
    size wide.
    """
    steps = [np.diff(np.unique(values)) for values in located.candidates.T]
    sides = np.array([distances.min() if len(distances) else 0.1 * size for distances in steps])
    return np.asarray(located.candidates[:, None] + 0.46 * sides * CORNERS)


def _draw_map(axes: Axes, located: Location, outline: Floats, place: style.AxisScale) -> None:
    """Draw the misfit of the candidates, the gages, and the best places on the plate."""
    extent = np.ptp(outline.reshape(-1, 2), axis=0)
    axes.add_collection(LineCollection(list(outline), colors="0.3", linewidths=0.8))
    worst = max(float(located.candidate_misfit.max()), 1.1)
    cells = PolyCollection(
        list(_cells(located, float(extent.max()))),
        array=located.candidate_misfit,
        norm=LogNorm(1.0, worst),
        cmap=style.SEQUENTIAL,
    )
    axes.add_collection(cells)
    _draw_gages(axes, located, GAGE_LENGTH * float(extent.max()))
    halo = [withStroke(linewidth=3.0, foreground="white")]
    axes.plot(located.x, located.y, label="place found", path_effects=halo, zorder=5, **CROSS)
    if located.second is not None:
        text = f"second place, misfit × {located.second.ratio:.2f}"
        axes.plot(located.second.x, located.second.y, label=text, zorder=4, **OTHER)
    axes.set_aspect("equal")
    axes.margins(0.04)
    place.name(axes.xaxis, "$x$")
    place.name(axes.yaxis, "$y$")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.17), ncols=2, borderaxespad=0.8)
    ratio = style.AxisScale(1.0, "")
    bar = style.colour_bar(
        axes, cells, ratio, "Misfit over the least misfit", MaxNLocator(6), aspect=40.0
    )
    ticks = [tick for tick in (1, 2, 3, 5, 10, 20, 30, 50, 100) if tick <= worst]
    bar.set_ticks(ticks if len(ticks) > 1 else [1.0, worst])


def _draw_gages(axes: Axes, located: Location, length: float) -> None:
    """Draw a line along the direction of every gage, with its number."""
    degrees = {card.number: card.direction for card in located.deck.require(Gages).records}
    halo = [withStroke(linewidth=2.0, foreground="white")]
    for number, (x, y) in zip(located.gages.tolist(), located.gage_places, strict=True):
        angle = np.deg2rad(degrees[number])
        along = 0.5 * length * np.array([np.cos(angle), np.sin(angle)])
        axes.plot(
            [x - along[0], x + along[0]],
            [y - along[1], y + along[1]],
            color="black",
            lw=2.2,
            solid_capstyle="butt",
            path_effects=halo,
            zorder=3,
        )
        axes.annotate(
            str(number),
            (x, y),
            xytext=(4.0, 4.0),
            textcoords="offset points",
            path_effects=halo,
            zorder=3,
        )


def _draw_zoom(axes: Axes, located: Location, place: style.AxisScale) -> None:
    """Draw the place and its ellipse, enlarged; the axes show distances from the place."""
    ellipse = located.ellipse(0.95) - np.array([located.x, located.y])
    axes.set_title("95 % confidence region", loc="left")
    reach = ZOOM * float(np.abs(ellipse).max())
    axes.fill(*ellipse.T, color=FITTED, alpha=0.25, lw=0.0)
    axes.plot(*ellipse.T, color=FITTED)
    axes.plot(0.0, 0.0, **CROSS)
    axes.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
    axes.xaxis.set_major_locator(MaxNLocator(5))
    axes.yaxis.set_major_locator(MaxNLocator(5))
    place.name(axes.xaxis, "$x$ from the place found")
    place.name(axes.yaxis, "$y$ from the place found")


def _draw_force(axes: Axes, located: Location) -> None:
    """Draw the fitted force with its band, and hatch where it is not determined."""
    # The force begins one interval before its first value.
    begin = 2.0 * located.time[0] - located.time[1]
    time = np.append(begin, located.time)
    force = np.append(0.0, np.where(located.determined, located.force, np.nan))
    room = np.append(0.0, 2.0 * located.force_sd)
    axes.fill_between(
        time,
        force - room,
        force + room,
        color=FITTED,
        alpha=0.25,
        lw=0.0,
        label="± 2 standard deviations",
    )
    axes.plot(time, force, color=FITTED, label="fitted force")
    if located.determined_until < located.time[-1]:
        axes.axvspan(
            located.determined_until,
            located.time[-1],
            fc="0.95",
            ec="0.7",
            hatch="////",
            lw=0.0,
            label="not determined by these strains",
        )
    axes.axhline(0.0, color="0.2", lw=0.6)
    axes.set_xlim(min(0.0, begin), float(located.time[-1]))
    style.scale_in(located.units, "time", located.time).name(axes.xaxis, "Time")
    style.scale_in(located.units, "force", force).name(axes.yaxis, "Contact force")
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 0.96), ncols=3)


def _draw_strains(axes: list[Axes], located: Location) -> None:
    """Draw measured and fitted strains, one graph per gage, all with the same limits."""
    micro = style.scale(style.largest_absolute(located.strains, located.fitted), "")
    clock = style.scale_in(located.units, "time", located.strain_time)
    largest = max(float(values.max()) for values in (located.strains, located.fitted))
    least = min(float(values.min()) for values in (located.strains, located.fitted))
    room = 0.06 * (largest - least)
    for ax, number, measured, fitted in zip(
        axes, located.gages.tolist(), located.strains, located.fitted, strict=False
    ):
        ax.plot(located.strain_time, measured, color="0.65", lw=2.0, label="measured")
        ax.plot(located.strain_time, fitted, color=FITTED, label="fitted")
        ax.set_title(f"gage {number}", loc="left")
        ax.set_xlim(min(0.0, float(located.strain_time[0])), float(located.strain_time[-1]))
        ax.set_ylim(least - room, largest + room)
        clock.name(ax.xaxis, "Time")
        micro.name(ax.yaxis, "Strain")
    axes[min(1, len(axes) - 1)].legend(loc="lower right", bbox_to_anchor=(1.0, 0.95), ncols=2)
    for ax in axes[:-COLUMNS]:
        ax.set_xlabel("")
    for ax in axes[1::COLUMNS]:
        ax.set_ylabel("")
