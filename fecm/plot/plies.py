"""Pictures of plies: largest failure exposures over time, stresses through the thickness."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from fecm._errors import warn
from fecm._frozen import frozen
from fecm._typing import Bools, Floats
from fecm.deck.model import Material
from fecm.mechanics.elements import Quadrature
from fecm.mechanics.failure import CRITERIA
from fecm.mechanics.mesh import element_blocks, element_centres
from fecm.mechanics.points import locate
from fecm.plot import style
from fecm.plot.data import Array, deck_of, mesh_of, on_plate, reach, require
from fecm.plot.kinds import Picture, PlotError
from fecm.plot.plate import aspect, mark_impact
from fecm.problem.build import rules
from fecm.results.errors import NotStoredError, ResultFileError
from fecm.results.exposures import LargestExposure, largest_exposures
from fecm.results.plies import Plies, places, rows_at
from fecm.results.result import Result

BETWEEN = "interlaminar"
NAMES = (*CRITERIA, BETWEEN)
COLOUR_OF = dict(zip(NAMES, style.COLOURS, strict=False))
LIMIT: dict[str, Any] = {"color": "#C00000", "linewidth": 1.0}
HATCH: dict[str, Any] = {"facecolor": "white", "edgecolor": "0.55", "hatch": "//////"}
LARGEST: dict[str, Any] = {
    "color": LIMIT["color"], "marker": "o", "mfc": "none", "ms": 5.0, "mew": 0.9, "ls": "none",
}  # fmt: skip
# Marks of the criteria in the bars: small ones above large ones, as values may coincide.
MARKS: tuple[dict[str, Any], ...] = tuple(
    {"marker": marker, "ms": size, "mew": 0.6, "mfc": "none", "ls": "none"}
    for marker, size in (("s", 4.0), ("D", 3.0), ("o", 4.0), ("x", 2.5))
)
MANY = 5000  # maps of more cells are drawn as pixels in PDF and SVG
NAMED = 12  # elements under the load that a note names; the others it counts
TICKS = 16  # numbers on the axis of the plies at most
LARGE_RESIDUAL = 0.1  # over the largest interlaminar stress: a note says so
# A parabola through the lower, middle and upper value of a ply, at some parts of its thickness.
_PARTS = np.linspace(0.0, 1.0, 9)
_PARABOLA = np.stack(
    [(1 - _PARTS) * (1 - 2 * _PARTS), 4 * _PARTS * (1 - _PARTS), _PARTS * (2 * _PARTS - 1)]
)


@frozen
class Exposures:
    """What is drawn of a result."""

    under_load: Bools  # (numel, points): mask of the points that are left out
    # (numel, points): largest exposure of all plies (or interfaces) at every point.
    over_plate: Floats
    # (plies,) or (plies - 1,) each: largest exposure outside the load, by criterion.
    over_plies: dict[str, Floats]
    worst: LargestExposure  # the largest of them


def failure(results: Mapping[str, Result], *, quantity: str = "", width: str = "column") -> Picture:
    """Largest exposures over time: of the worst ply on the plate, and of every ply in bars.

    Points under the load are hatched; the bars leave them out.  Values between two plies belong to
    an element, which the bars leave out if one of its points is under the load.  `quantity` is a
    criterion; by default the plate shows the largest of all criteria of the plies, and the bars
    also the interlaminar exposure between them.
    """
    ((name, result),) = results.items()
    found = _exposures(result, name, quantity)
    corners = _cells(result, name, found.under_load.shape[1])
    place = style.scale_of(results, "length", [corners])
    inches, high = style.WIDTHS[width], aspect(corners.reshape(-1, 2))
    most = max(map(len, found.over_plies.values()))
    beside = float(np.clip(0.8 + 0.07 * most, 1.4, 4.0))  # height of the bars
    if width == "column":
        above = 0.85 * inches * high + 1.5
        ratio, heights = (above + beside) / (inches * 2), (above, beside)
        figure, axes = style.panels(width, 2, 1, ratio=ratio, height_ratios=heights)
    else:
        ratio = max(0.54 * inches * high + 1.5, beside + 0.4) * 2 / inches
        figure, axes = style.panels(width, 1, 2, ratio=ratio, width_ratios=(5.0, 3.0))
    plate, bars = axes
    _map(plate, corners, found)
    mark_impact(plate, result, name)
    worst = found.worst
    plate.plot(worst.x, worst.y, clip_on=False, **LARGEST)
    title = (
        f"{worst.exposure:.4g} ({worst.criterion.replace('_', ' ')}): {worst.mode}, {worst.plies}"
    )
    if result.still_in_contact:
        title += "\nstill in contact at the end: exposures may grow"
    plate.set_title(title, loc="left")
    place.name(plate.xaxis, "$x$")
    place.name(plate.yaxis, "$y$")
    _bars(figure, bars, found)
    if text := style.open_ends(results):
        bars.set_title(f"{text}: lower bounds", loc="right", fontsize=7.0)
    if len(elements := 1 + np.flatnonzero(found.under_load.any(axis=1))):
        texts = ", ".join(map(str, elements[:NAMED]))
        more = f" and {len(elements) - NAMED} more" if len(elements) > NAMED else ""
        points = np.count_nonzero(found.under_load)
        warn(
            f"exposures of {name} under the load, where plate theory does not hold, are left out: "
            f"{points} {'point' if points == 1 else 'points'} of "
            f"{'element' if len(elements) == 1 else 'elements'} {texts}{more}"
        )
    return Picture(figure)


def _exposures(result: Result, name: str, quantity: str) -> Exposures:
    """Largest exposures by one criterion or by all."""
    if quantity and quantity not in NAMES:
        raise PlotError(f"there is no criterion {quantity!r}; there are {', '.join(NAMES)}")
    (near,) = require(result, name, "failure/under_load")
    under = near != 0
    whole = np.broadcast_to(under.any(axis=1)[:, None], under.shape)  # elements
    over_plies, fields = {}, []
    for criterion in (quantity,) if quantity else NAMES:
        path = f"failure/{criterion}/exposure"
        if criterion == BETWEEN and not quantity and path in result and not result[path].size:
            continue  # a single ply
        (values,) = require(result, name, path)
        if criterion == BETWEEN:
            field, outside = values.max(axis=1)[:, None], values[~whole[:, 0]]
        else:
            field, outside = values.max(axis=(2, 3)), values[~under].max(axis=2)
        if len(outside):
            over_plies[criterion] = outside.max(axis=0)
        if quantity or criterion != BETWEEN:
            fields.append(np.broadcast_to(field, under.shape))
    names = set(over_plies) - (set() if quantity else {BETWEEN})
    largest = [one for one in largest_exposures(result) if one.criterion in names]
    if not largest:
        raise PlotError(f"the load is over all elements of {name}: no exposure is left to show")
    worst = max(largest, key=lambda one: one.exposure)
    left_out = whole if quantity == BETWEEN else under
    return Exposures(left_out, np.max(fields, axis=0), over_plies, worst)


def _cells(result: Result, name: str, count: int) -> Floats:
    """Corners of the part of the element around each point, (numel, points, 4, 2), length."""
    rule = rules(deck_of(result, name).require(Material))[2]
    if len(rule.xi) != count:
        raise PlotError(
            f"{name} has exposures at {count} points of an element, its deck has {len(rule.xi)}"
        )
    at = np.unique(rule.xi.round(12))
    bounds = np.concatenate(([-1.0], (at[1:] + at[:-1]) / 2.0, [1.0]))
    column, row = (np.abs(at - local[:, None]).argmin(axis=1) for local in (rule.xi, rule.eta))
    right, upper = np.array([0, 1, 1, 0]), np.array([0, 0, 1, 1])
    xi, eta = bounds[column[:, None] + right].ravel(), bounds[row[:, None] + upper].ravel()
    grid = Quadrature(xi, eta, np.zeros(len(xi)))  # points only; nothing is integrated
    return places(*mesh_of(result, name), grid).reshape(-1, count, 4, 2)


def outline(cells: Floats) -> Floats:
    """Sides of cells, (n, 4, 2), that belong to one of them only: (sides, 2, 2)."""
    sides = np.stack([cells, np.roll(cells, -1, axis=1)], axis=2).reshape(-1, 2, 2)
    if not len(sides):
        return sides
    # An offset keeps coordinates of regular meshes off the borders between integers.
    whole = np.floor(sides / (1e-6 * np.ptp(sides, axis=(0, 1)).max()) + 0.377)
    ends = np.sort(whole @ [1.0, 1.0j], axis=1)  # by x, then by y
    _, index, times = np.unique(ends, axis=0, return_index=True, return_counts=True)
    return np.asarray(sides[index[times == 1]])


def _map(axes: Axes, cells: Floats, found: Exposures) -> None:
    """One cell per point."""
    outside = ~found.under_load
    values = found.over_plate[outside]
    peak = float(values.max())
    drawn = PolyCollection(
        list(cells[outside]), array=values, cmap=style.IN_ORDER, norm=Normalize(0.0, peak or 1.0),
        edgecolors="face", linewidths=0.2, rasterized=len(values) > MANY,
    )  # fmt: skip
    axes.add_collection(drawn)
    axes.add_collection(PolyCollection(list(cells[~outside]), linewidths=0.0, **HATCH))
    above = outline(cells[outside & (found.over_plate >= 1.0)])
    axes.add_collection(LineCollection(list(above), colors=LIMIT["color"], linewidths=0.8))
    low, high = cells.min(axis=(0, 1, 2)), cells.max(axis=(0, 1, 2))
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    what = "the interfaces" if found.worst.criterion == BETWEEN else "the plies"
    scale, label = style.Scale(1.0, ""), f"Largest exposure of {what}"
    bar = style.colour_bar(axes, drawn, scale, label, MaxNLocator(5))
    if peak >= 1.0:
        bar.ax.axvline(1.0, **LIMIT)


def _bars(figure: Figure, axes: Axes, found: Exposures) -> None:
    """A bar per ply, the struck face at the top, one per interface between them, and the legend."""
    plies = {name: values for name, values in found.over_plies.items() if name != BETWEEN}
    between = found.over_plies.get(BETWEEN)
    entries: dict[str, Any] = {}
    if plies:
        largest = np.max(list(plies.values()), axis=0)
        number = np.arange(1, len(largest) + 1)
        alone = next(iter(plies)) if len(plies) == 1 else ""
        axes.barh(number, largest, height=0.8, color=COLOUR_OF[alone] if alone else "0.85")
        if alone:
            entries[alone.replace("_", " ")] = Patch(color=COLOUR_OF[alone])
        else:
            for (name, values), mark in zip(plies.items(), MARKS, strict=False):
                (drawn,) = axes.plot(values, number, color=COLOUR_OF[name], **mark)
                entries[name.replace("_", " ")] = drawn
    if between is not None:
        place = np.arange(len(between)) + (1.5 if plies else 1.0)
        height = 0.35 if plies else 0.8
        axes.barh(place, between, height=height, color=COLOUR_OF[BETWEEN], zorder=3)
        entries[BETWEEN] = Patch(color=COLOUR_OF[BETWEEN])
    entries["exposure 1"] = axes.axvline(1.0, zorder=4, **LIMIT)
    entries["largest"] = Line2D([], [], **LARGEST)
    if found.under_load.any():
        entries["under the load"] = Patch(linewidth=0.0, **HATCH)
    style.legend(figure, list(entries.values()), list(entries))
    count = max(map(len, found.over_plies.values()))
    axes.set_ylim(count + 0.6, 0.4)
    axes.set_xlim(0.0, 1.05 * max(1.0, *(values.max() for values in found.over_plies.values())))
    axes.yaxis.set_major_locator(MaxNLocator(TICKS, integer=True, min_n_ticks=1))
    axes.set_ylabel("Ply (1: struck face)" if plies else "Interface below ply (1: struck face)")
    axes.set_xlabel("Largest exposure")


def thickness(
    results: Mapping[str, Result],
    *,
    at: Sequence[tuple[float, float]] = (),
    times: Sequence[float] = (),
    width: str = "column",
) -> Picture:
    """Stresses of the plies of one element over z, the struck face at the top.

    In-plane stresses are in the axes of each ply, interlaminar ones in those of the plate; the last
    graph is the resultant of these.  sigma_z is not computed.

    Of `at` (length) at most one place selects the nearest element with ply stresses, and its
    nearest point; of `times` (the deck's unit) at most one the nearest stored row.  By default both
    are those of the largest abs(sigma_1) outside the elements under the load.
    """
    ((name, result),) = results.items()
    plies, point = _chosen(result, name, at, times)
    z = plies.z
    in_plane = (plies.sigma_1, plies.sigma_2, plies.tau_12)
    names = (r"$\sigma_1$", r"$\sigma_2$", r"$\tau_{12}$")
    drawn = {n: (z[:, ::2], values[0, 0, point]) for n, values in zip(names, in_plane, strict=True)}
    xz, yz, depth = (values @ _PARABOLA for values in (plies.tau_xz[0, 0], plies.tau_yz[0, 0], z))
    if np.isfinite([xz, yz]).all():
        drawn[r"$\tau_{xz}$"], drawn[r"$\tau_{yz}$"] = (depth, xz), (depth, yz)
        drawn[r"$(\tau_{xz}^2 + \tau_{yz}^2)^{1/2}$"] = depth, np.hypot(xz, yz)
    _warn(result, name, plies)
    columns = 2 if width == "column" else 3
    lines = math.ceil(len(drawn) / columns)
    figure, axes = style.panels(width, lines, columns, sharey=True, ratio=1.8 / columns)
    place = style.scale_of(results, "length", [z])
    for ax, (label, (levels, values)) in zip(axes, drawn.items(), strict=False):
        stress = style.scale_of(results, "force/length^2", [values])
        for face in np.unique(z[:, ::2]):
            ax.axhline(face, color="0.6", lw=0.4, ls=":")
        ax.axvline(0.0, color="0.6", lw=0.4)
        ax.plot(values.ravel(), levels.ravel(), color=style.colours()[0])
        stress.name(ax.xaxis, label)
        ax.set_ylim(z[-1, 2], z[0, 0])
    for ax in axes[len(drawn) :]:
        ax.set_axis_off()
    for ax in axes[: len(drawn) : columns]:
        place.name(ax.yaxis, "$z$")
    clock = style.scale_of(results, "time", [plies.time])
    x, y = plies.x[0, point], plies.y[0, point]
    where = f"{x:.4g}, {y:.4g} {style.literal(result.unit('length'))}".rstrip()
    time = clock.show(float(plies.time[0]))
    figure.suptitle(f"element {plies.element[0]} at {where}, time {time}", fontsize=8.0)
    return Picture(figure)


def _chosen(
    result: Result, name: str, at: Sequence[tuple[float, float]], times: Sequence[float]
) -> tuple[Plies, int]:
    """Plies of one element at one time, and the number of the point in it, from 0."""
    if len(at) > 1 or len(times) > 1:
        raise PlotError("the kind thickness shows one point at one time; give --at and --time once")
    sigma, stored, numbers, near = require(
        result, name, "plies/sigma_1", "plies/time", "plies/element", "plies/under_load"
    )
    mesh = mesh_of(result, name)
    outside = near == 0
    try:
        rows = rows_at(stored, times, "ply stresses") if times else np.arange(len(stored))
        largest = np.abs(sigma[rows]).max(axis=(3, 4))  # (rows, elements, points)
        loaded = largest.max(axis=(0, 2))  # (elements,)
        member = int(np.where(outside, loaded, -1.0).argmax() if outside.any() else loaded.argmax())
        if at:
            member = _nearest_element(mesh, numbers, np.array(at[0]), name)
        row, point = np.unravel_index(largest[:, member].argmax(), largest[:, member].shape)
        plies = result.plies(float(stored[rows[row]]), int(numbers[member]))
    except NotStoredError as error:
        raise PlotError(f"{name} has {error}") from None
    except ResultFileError as error:
        raise PlotError(f"{name}: {error}") from None
    if at:
        point = np.hypot(plies.x[0] - at[0][0], plies.y[0] - at[0][1]).argmin()
    return plies, int(point)


def _nearest_element(mesh: tuple[Array, Floats], numbers: Array, at: Floats, name: str) -> int:
    """Position of the element that contains a place, or else of the one with the nearest centre."""
    coordinates = mesh[1]
    elements = mesh[0][numbers - 1]
    on_plate(coordinates, at, name)
    distance = np.hypot(*(element_centres(elements, coordinates) - at).T)
    blocks = element_blocks(elements, coordinates)
    inside = np.concatenate([block.rows[locate(block, at[None])[0]] for block in blocks])
    if len(inside):
        return int(inside[distance[inside].argmin()])
    nearest = int(distance.argmin())
    warn(
        f"{name} has no ply stresses at {at[0]:g},{at[1]:g}; the nearest element with ply stresses "
        f"is {numbers[nearest]}, its centre {distance[nearest]:.3g} away"
    )
    return nearest


def _warn(result: Result, name: str, plies: Plies) -> None:
    """Say what limits the stresses of an element."""
    element = f"element {plies.element[0]} of {name}"
    if plies.under_load[0]:
        near = reach(result, name, 2.0 * float(plies.z[-1, 2]))
        warn(f"{element} is within {near:.3g} of the load, where plate theory does not hold")
    tau = np.abs([plies.tau_xz, plies.tau_yz]).max()
    residual = np.abs(plies.residual).max()
    if np.isnan(tau):
        warn(f"{element} does not have nine nodes: it has no interlaminar stresses")
    elif residual > LARGE_RESIDUAL * tau:
        warn(
            f"at z = h/2 of {element} equilibrium leaves {residual / tau:.0%} of the largest "
            "interlaminar stress, which is removed linearly in z: in-plane supports act there, or "
            "the mesh is coarse"
        )
