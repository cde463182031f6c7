"""Picture of failure: largest exposures over the plate and of every ply."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import cycle
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import Normalize
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch
from matplotlib.ticker import MaxNLocator

from fecm._errors import warn
from fecm._typing import Bools, Floats
from fecm.deck.model import Material
from fecm.judge.criteria import failure_in_words
from fecm.judge.exposures import LargestExposure
from fecm.mechanics.elements import Quadrature
from fecm.mechanics.failure import CRITERIA, UNIDIRECTIONAL
from fecm.mechanics.failure_monitor import UNKNOWN
from fecm.plot import style
from fecm.plot.data import mesh_of, require_datasets, result_deck, struck
from fecm.plot.kinds import Picture, PlotError, Width
from fecm.plot.plate import aspect, mark_impact
from fecm.problem.parts import rules
from fecm.results.exposures import largest_exposures, near_load
from fecm.results.plies import places
from fecm.results.result import Result

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BETWEEN = "interlaminar"
NAMES = (*CRITERIA, BETWEEN)
COLOUR_OF = dict(zip(NAMES, cycle(style.COLOURS), strict=False))
RED = "#C00000"
LIMIT: style.Look = {"color": RED, "linewidth": 1.0}
HATCH: style.Look = {"facecolor": "white", "edgecolor": "0.55", "hatch": "//////"}
OPEN: style.Look = {"mfc": "none", "ls": "none"}
LARGEST: style.Look = OPEN | {"color": RED, "marker": "o", "ms": 5.0, "mew": 0.9}
CIRCLE: style.Look = {"color": "black", "linewidth": 0.6, "linestyle": style.DASHED}
# Marks of the criteria in the bars. Each criterion has a lane, as values may coincide.
LANE = 0.68 / len(CRITERIA)  # distance of lanes, over the distance of bars
FILLED: style.Look = {"ls": "none", "mew": 0.0, "zorder": 3.5}
MARKS: tuple[style.Look, ...] = (
    FILLED | {"marker": "s", "ms": 2.0},
    FILLED | {"marker": "D", "ms": 2.0},
    FILLED | {"marker": "o", "ms": 2.3},
    FILLED | {"marker": "^", "ms": 2.5},
)
MANY = 5000  # cells above which PDF and SVG have the map as pixels
NAMED = 12  # elements under the load that a warning names; it counts the others
TICKS = 16  # most numbers on the axis of the plies


class DrawnExposures(NamedTuple):
    """Exposures that a picture shows."""

    under_load: Bools  # (numel, points): mask of the points under the load, which are left out
    # (numel, points): largest exposure at every point, of all plies or of all interfaces.
    over_plate: Floats
    # (plies,) or (plies - 1,) each: largest exposure outside the load, by criterion.
    over_plies: dict[str, Floats]
    largest: list[LargestExposure]  # largest exposure of each criterion, in descending order

    @property
    def worst(self) -> LargestExposure:
        """The largest exposure of all criteria."""
        return self.largest[0]

    @property
    def title(self) -> str:
        """The largest exposure, and the largest of the interfaces or plies below it."""
        between = self.worst.criterion == BETWEEN
        of_other_kind = [
            exposure for exposure in self.largest if (exposure.criterion == BETWEEN) != between
        ]
        return "\n".join(map(_in_words, (self.worst, *of_other_kind[:1])))


def failure(results: Mapping[str, Result], *, quantity: str = "", width: Width = "full") -> Picture:
    """Draw the largest exposures over time.

    The plate shows the worst ply, the bars show every ply. Points under the load are hatched on the
    plate and left out of the bars. Interlaminar values belong to an element; the bars leave it out
    if its centre is under the load. Exposures are also evaluated on the dashed circle around the
    load. The largest exposures have rings in the bars. `quantity` is a criterion. By default the
    bars show all criteria, and the plate shows the plies, or the interfaces if their exposure is
    the largest.
    """
    ((name, result),) = results.items()
    exposures = _exposures(result, name, quantity)
    corners = _cells(result, name, exposures.under_load.shape[1])
    place = style.scale_of(results, "length", [corners])
    most = max(map(len, exposures.over_plies.values()))
    figure, plate, bars = _panels(width, aspect(corners.reshape(-1, 2)), most)
    _map(plate, corners, exposures)
    mark_impact(plate, result, name)
    has_circle = _draw_circle(plate, result, name)
    plate.plot(exposures.worst.x, exposures.worst.y, clip_on=False, **LARGEST)
    title = exposures.title
    if result.still_in_contact:
        title += "\nstill in contact at the end: exposures may grow"
    plate.set_title(title, loc="left")
    place.name(plate.xaxis, "$x$")
    place.name(plate.yaxis, "$y$")
    entries = _bars(bars, exposures)
    if has_circle:
        entries["circle around the load"] = Line2D([], [], **CIRCLE)
    style.legend(figure, list(entries.values()), list(entries))
    if text := style.open_ends_note(results):
        bars.set_title(f"{text}: lower bounds", loc="right", fontsize=7.0)
    _warn_of_load(name, exposures.under_load)
    return Picture(figure)


def _in_words(exposure: LargestExposure) -> str:
    """Format an exposure for a title; names of materials take their own line."""
    words = failure_in_words(exposure.criterion, exposure.mode, exposure.plies)
    text = f"{exposure.exposure:.4g}: {words}"
    return text.replace(", ", ",\n", 1) if exposure.materials else text


def _panels(width: Width, high: float, bars: int) -> tuple[Figure, Axes, Axes]:
    """Return the axes of the plate, with the aspect `high`, and of the bars, below or beside it."""
    inches = style.WIDTHS[width]
    height_of_bars = float(np.clip(0.8 + 0.1 * bars, 1.4, 5.0))
    if width == "column":
        height_of_plate = 0.85 * inches * high + 1.5
        heights = (height_of_plate, height_of_bars)
        ratio = sum(heights) / (inches * 2)
        figure, (plate, below) = style.panels(width, 2, 1, ratio=ratio, height_ratios=heights)
        return figure, plate, below
    ratio = max(0.54 * inches * high + 1.5, height_of_bars + 0.4) * 2 / inches
    figure, (plate, beside) = style.panels(width, 1, 2, ratio=ratio, width_ratios=(5.0, 3.0))
    return figure, plate, beside


def _draw_circle(axes: Axes, result: Result, name: str) -> bool:
    """Draw the circle around the load on which exposures are evaluated, if there is one."""
    load = struck(result, name)
    if "failure/circle/x" not in result or not len(load):
        return False
    places = np.column_stack([result[f"failure/circle/{axis}"] for axis in "xy"])
    places = places[np.isfinite(places).all(axis=1)]
    if not len(places):
        return False
    radius = float(np.hypot(*(places[0] - load[0])))
    axes.add_patch(Circle((load[0, 0], load[0, 1]), radius, fill=False, **CIRCLE))
    return True


def _warn_of_load(name: str, under_load: Bools) -> None:
    """Warn that points under the load, (numel, points), are left out."""
    elements = 1 + np.flatnonzero(under_load.any(axis=1))
    if not len(elements):
        return
    texts = ", ".join(map(str, elements[:NAMED]))
    more = f" and {len(elements) - NAMED} more" if len(elements) > NAMED else ""
    points = np.count_nonzero(under_load)
    warn(
        f"exposures of {name} under the load, where plate theory does not hold, are left out: "
        f"{points} {'point' if points == 1 else 'points'} of "
        f"{'element' if len(elements) == 1 else 'elements'} {texts}{more}"
    )


def _exposures(result: Result, name: str, quantity: str) -> DrawnExposures:
    """Return the largest exposures by one criterion or by all."""
    if quantity and quantity not in NAMES:
        raise PlotError(f"there is no criterion {quantity!r}; there are {', '.join(NAMES)}")
    (near,) = require_datasets(result, name, "failure/under_load")
    is_under = near != 0
    centre_under = np.broadcast_to(near_load(result, BETWEEN), is_under.shape)  # elements
    over_plies: dict[str, Floats] = {}
    fields: dict[str, Floats] = {}
    for criterion in (quantity,) if quantity else NAMES:
        path = f"failure/{criterion}/exposure"
        if criterion == BETWEEN and not quantity and path in result and not result[path].size:
            continue  # a single ply
        if criterion in UNIDIRECTIONAL and path in result and np.isnan(result[path]).all():
            if not quantity:
                continue
            raise PlotError(f"{criterion} is not evaluated for the plies of {name}")
        (values,) = require_datasets(result, name, path, padded=True)
        if np.isnan(values).all():
            if criterion == BETWEEN and not quantity:
                continue  # no interface of two plies with strengths
            what = "pair of neighbouring plies" if criterion == BETWEEN else "ply"
            raise PlotError(f"no {what} of {name} has strengths (ALLO)")
        values = np.where(np.isnan(values), UNKNOWN, values)
        if criterion == BETWEEN:
            field, outside = values.max(axis=1)[:, None], values[~centre_under[:, 0]]
        else:
            field, outside = values.max(axis=(2, 3)), values[~is_under].max(axis=2)
        if (outside != UNKNOWN).any():
            over_plies[criterion] = _without_unknown(outside.max(axis=0))
        fields[criterion] = np.broadcast_to(field, is_under.shape)
    largest = [
        exposure for exposure in largest_exposures(result) if exposure.criterion in over_plies
    ]
    if not largest:
        raise PlotError(f"the load is over all elements of {name}: no exposure is left to show")
    largest.sort(key=lambda exposure: -exposure.exposure)
    is_interlaminar = largest[0].criterion == BETWEEN
    shown = [
        field for criterion, field in fields.items() if (criterion == BETWEEN) == is_interlaminar
    ]
    left_out = centre_under if is_interlaminar else is_under
    return DrawnExposures(left_out, _without_unknown(np.max(shown, axis=0)), over_plies, largest)


def _without_unknown(exposures: Floats) -> Floats:
    """Return the exposures, with NaN where no ply has strengths."""
    return np.where(exposures == UNKNOWN, np.nan, exposures)


def _cells(result: Result, name: str, count: int) -> Floats:
    """Return the corners of the cell around each point, (numel, points, 4, 2), length."""
    rule = rules(result_deck(result, name).require(Material))[2]
    if len(rule.xi) != count:
        raise PlotError(
            f"{name} has exposures at {count} points of an element, its deck has {len(rule.xi)}"
        )
    abscissae = np.unique(rule.xi.round(12))
    bounds = np.concatenate(([-1.0], (abscissae[1:] + abscissae[:-1]) / 2.0, [1.0]))
    column, row = (
        np.abs(abscissae - local[:, None]).argmin(axis=1) for local in (rule.xi, rule.eta)
    )
    right, upper = np.array([0, 1, 1, 0]), np.array([0, 0, 1, 1])
    xi, eta = bounds[column[:, None] + right].ravel(), bounds[row[:, None] + upper].ravel()
    grid = Quadrature(xi, eta, np.zeros(len(xi)))  # points only; nothing is integrated
    return places(*mesh_of(result, name), grid).reshape(-1, count, 4, 2)


def outline(cells: Floats) -> Floats:
    """Return the outline of cells, (n, 4, 2): the sides of only one cell, (sides, 2, 2)."""
    sides = np.stack([cells, np.roll(cells, -1, axis=1)], axis=2).reshape(-1, 2, 2)
    if not len(sides):
        return sides
    # An offset keeps coordinates of regular meshes off the borders between integers.
    whole = np.floor(sides / (1e-6 * np.ptp(sides, axis=(0, 1)).max()) + 0.377)
    ends = np.sort(whole @ [1.0, 1.0j], axis=1)  # by x, then by y
    _, index, times = np.unique(ends, axis=0, return_index=True, return_counts=True)
    return np.asarray(sides[index[times == 1]])


def _map(axes: Axes, cells: Floats, exposures: DrawnExposures) -> None:
    """Draw one cell per point."""
    outside = ~exposures.under_load
    values = exposures.over_plate[outside]
    peak = float(np.nanmax(values))
    drawn = PolyCollection(
        list(cells[outside]),
        array=values,
        cmap=style.SEQUENTIAL,
        norm=Normalize(0.0, peak or 1.0),
        edgecolors="face",
        linewidths=0.2,
        rasterized=len(values) > MANY,
    )
    axes.add_collection(drawn)
    axes.add_collection(PolyCollection(list(cells[~outside]), linewidths=0.0, **HATCH))
    above = outline(cells[outside & (exposures.over_plate >= 1.0)])
    axes.add_collection(LineCollection(list(above), colors=RED, linewidths=0.8))
    low, high = cells.min(axis=(0, 1, 2)), cells.max(axis=(0, 1, 2))
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    what = "the interfaces" if exposures.worst.criterion == BETWEEN else "the plies"
    scale, label = style.AxisScale(1.0, ""), f"Largest exposure of {what}"
    bar = style.colour_bar(axes, drawn, scale, label, MaxNLocator(5))
    if peak >= 1.0:
        bar.ax.axvline(1.0, **LIMIT)


def _bars(axes: Axes, exposures_drawn: DrawnExposures) -> dict[str, Artist]:
    """Draw a bar per ply, the struck face at the top, and one per interface between them.

    Returns the entries of the legend.
    """
    plies = {name: values for name, values in exposures_drawn.over_plies.items() if name != BETWEEN}
    between = exposures_drawn.over_plies.get(BETWEEN)
    entries: dict[str, Artist] = {}
    if plies:
        largest = np.max(list(plies.values()), axis=0)
        number = np.arange(1, len(largest) + 1)
        sole = next(iter(plies)) if len(plies) == 1 else ""
        axes.barh(
            number,
            largest,
            height=0.8,
            color=COLOUR_OF[sole] if sole else "0.85",
        )
        if sole:
            entries[sole.replace("_", " ")] = Patch(color=COLOUR_OF[sole])
        else:
            for lane, ((name, values), mark) in enumerate(zip(plies.items(), cycle(MARKS))):
                place = number + LANE * (lane - (len(plies) - 1) / 2.0)
                (drawn,) = axes.plot(values, place, color=COLOUR_OF[name], **mark)
                entries[name.replace("_", " ")] = drawn
    if between is not None:
        place = np.arange(len(between)) + (1.5 if plies else 1.0)
        height = 0.35 if plies else 0.8
        axes.barh(place, between, height=height, color=COLOUR_OF[BETWEEN], zorder=3)
        entries[BETWEEN] = Patch(color=COLOUR_OF[BETWEEN])
    entries["exposure 1"] = axes.axvline(1.0, zorder=4, **LIMIT)
    entries["largest"] = Line2D([], [], **LARGEST)
    if exposures_drawn.under_load.any():
        entries["under the load"] = Patch(linewidth=0.0, **HATCH)
    for exposure in reversed(exposures_drawn.largest):  # some are on the circle around the load
        height = exposure.ply + (0.5 if plies and exposure.criterion == BETWEEN else 0.0)
        colour = RED if exposure is exposures_drawn.worst else COLOUR_OF[exposure.criterion]
        axes.plot(exposure.exposure, height, **LARGEST | {"color": colour, "zorder": 5.0})
    count = max(map(len, exposures_drawn.over_plies.values()))
    axes.set_ylim(count + 0.6, 0.4)
    most = max(1.0, exposures_drawn.worst.exposure)
    axes.set_xlim(0.0, 1.05 * most)
    axes.yaxis.set_major_locator(MaxNLocator(TICKS, integer=True, min_n_ticks=1))
    axes.set_ylabel("Ply (1: struck face)" if plies else "Interface below ply (1: struck face)")
    axes.set_xlabel("Largest exposure")
    return entries
