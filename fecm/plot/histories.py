"""Pictures against time, and force against indentation (the report's figures 4.12 to 4.19)."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from fecm._errors import warn
from fecm.deck.model import Material
from fecm.plot import data, style
from fecm.plot.kinds import Picture, PlotError
from fecm.results.comparison import Source, compare, measurement_of
from fecm.results.result import Result
from fecm.results.schema import declared_units

if TYPE_CHECKING:
    from fecm.sweeps.identify import Identification

Results = Mapping[str, Result]

POINTS = 200  # measured points drawn one by one at most
LETTERS = 16  # of small text per inch
# What a loop is drawn against: column of the history, sign, and label.
AGAINST = {
    "indentation": ("indentation", 1.0, "Indentation"),
    "deflection": ("plate_w", 1.0, "Deflection under the load"),
    "displacement": ("displacement", -1.0, "Displacement of the projectile"),
}
ENERGIES = {
    "plate_kinetic": "plate, kinetic",
    "plate_strain": "plate, strain",
    "projectile_kinetic": "projectile, kinetic",
    "projectile_strain": "projectile, strain",
    "contact_work": "indentation",
    "damping_work": "damping",
}


def _time_axis(axes: Axes, clock: style.Scale, times: Iterable[data.Array]) -> None:
    clock.name(axes.xaxis, "Time")
    axes.set_xlim(0.0, max(float(array[-1]) for array in times))


def _mark_open_ends(axes: Axes, results: Results, width: str) -> None:
    """Say above a graph that contacts last to the end; name the results unless all do."""
    if text := style.open_ends(results):
        text = textwrap.fill(text, int(LETTERS * style.WIDTHS[width]))
        axes.set_title(text, loc="right", fontsize=7.0).set_parse_math(False)


def force(
    results: Results, *, overlay: Source | None = None, delay: float = 0.0, offset: float = 0.0,
    width: str = "column",
) -> Picture:  # fmt: skip
    """Contact force and transducer against time; of several results, one above the other.

    The transducers of rigid masses show the contact force and are not drawn again.  A dashed line
    marks the delamination threshold of a result that has one.  `overlay` is a
    measured force: a CSV file with the columns time and force (or transducer), or times and forces,
    in the deck's units.  `delay` and `offset` are subtracted from its times and forces.
    """
    if overlay is None and (delay or offset):
        raise PlotError("delay and offset are those of a measured force; give an overlay too")
    style.limit_count(len(results), "forces")
    paths = ("history/time", "history/force", "history/transducer")
    drawn = {name: data.require(result, name, *paths) for name, result in results.items()}
    times = [columns[0] for columns in drawn.values()]
    clock = style.scale_of(results, "time", times)
    limits = _thresholds(results)
    forces = [c for columns in drawn.values() for c in columns[1:]]
    measured = None
    if overlay is not None:
        first = next(iter(results.values()))
        units = declared_units(first.attributes)
        measured = measurement_of(overlay, units).corrected(delay, offset)
        forces.append(measured.force)
    pound = style.scale_of(results, "force", [*forces, np.array(list(limits.values()))])
    equal = all(np.array_equal(c, t) for _, c, t in drawn.values())  # of rigid masses
    if len(drawn) == 1:
        figure, axes = style.panels(width)
        ((time, contact, transducer),) = drawn.values()
        axes[0].plot(time, contact, color=style.colours()[0], label="contact force")
        if not equal:
            axes[0].plot(time, transducer, color=style.colours()[1], label="transducer")
        pound.name(axes[0].yaxis, "Contact force" if equal else "Force")
    else:
        rows, tall = (1, 1.0) if equal else (2, 0.65)
        figure, axes = style.panels(width, rows, sharex=True, sharey=True, tall=tall)
        for (name, (time, *both)), colour in zip(drawn.items(), style.colours(), strict=False):
            for ax, values in zip(axes, both, strict=False):
                ax.plot(time, values, color=colour, label=name)
        for ax, text in zip(axes, ("Contact force", "Transducer"), strict=False):
            pound.name(ax.yaxis, text)
    _mark_thresholds(axes[0], limits, list(drawn), pound)
    _time_axis(axes[-1], clock, times)
    _mark_open_ends(axes[0], results, width)
    notes = []
    if measured is not None:  # over what it is compared with
        look = _measured_look(measured.time) | {"color": "0.2", "zorder": 3.0}
        ax = axes[-1] if measured.column == "transducer" else axes[0]
        if ax is not axes[0]:
            axes[0].plot([], [], label=measured.name, **look)  # for the legend
        ax.plot(measured.time, measured.force, label=measured.name, **look)
        for name, result in results.items():
            compared = compare(result, measured)
            notes.append(f"{measured.quantity} of {name} against {measured.name}: {compared}")
    style.lines_legend(figure, axes[0])
    return Picture(figure, notes=notes)


def _mark_thresholds(
    axes: Axes, limits: Mapping[str, float], names: Sequence[str], pound: style.Scale
) -> None:
    """Draw thresholds, and name their results unless all have the same one."""
    colours = dict(zip(names, style.colours(), strict=False))
    for limit in dict.fromkeys(limits.values()):
        owners = [name for name in limits if limits[name] == limit]
        whose = f"{', '.join(owners)}: " if len(owners) < len(names) else ""
        axes.axhline(
            limit, ls=style.STYLES[1], lw=0.8, color=colours[owners[0]] if whose else "0.3",
            label=f"{whose}delamination threshold {pound.show(limit)}",
        )  # fmt: skip


def _measured_look(time: data.Array) -> dict[str, Any]:
    """Look of measured numbers: points if they are few, else a thin line."""
    return {"lw": 0.6} | ({"ls": "none", "marker": ".", "ms": 3.0} if len(time) <= POINTS else {})


@style.styled
def fit_picture(found: Identification, units: Mapping[str, str]) -> Picture:
    """Measured and fitted force above, the residual below with plus and minus its rms."""
    clock = style.scale_in(units, "time", found.time)
    figure, (above, below) = style.panels("column", 2, sharex=True, tall=0.6)
    look = _measured_look(found.time)
    above.plot(found.time, found.force, color="0.4", label="measured", **look)
    above.plot(found.time, found.model, color=style.COLOURS[0], label="fitted")
    below.plot(found.time, found.residual, color="0.4", **look)
    below.axhline(0.0, color=style.COLOURS[0])
    for value in (-found.rms, found.rms):
        below.axhline(value, color=style.COLOURS[0], ls=style.STYLES[1], lw=0.6)
    for axes, name, values in ((above, "Force", found.force), (below, "Residual", found.residual)):
        style.scale_in(units, "force", values).name(axes.yaxis, name)
    clock.name(below.xaxis, "Time")
    style.lines_legend(figure, above)
    return Picture(figure)


def _thresholds(results: Results) -> dict[str, float]:
    """Delamination thresholds by the names of the results that have one."""
    values: dict[str, Any] = {
        name: result.threshold.get("force") for name, result in results.items() if result.threshold
    }
    for name, value in values.items():
        if not isinstance(value, int | float) or not 0.0 < value <= data.LARGEST:
            raise PlotError(f"{name} has a delamination threshold that can't be drawn: {value}")
    return values


def loop(results: Results, *, against: str = "indentation", width: str = "column") -> Picture:
    """Contact force against indentation or displacement, beginning at rest.

    ``"deflection"`` is the displacement of the plate under the load, ``"displacement"`` that of the
    projectile's impacted end towards the plate, in contact the sum of both others.
    """
    style.limit_count(len(results), "loops")
    if against not in AGAINST:
        raise PlotError(f"unknown against {against}; a loop is drawn against {', '.join(AGAINST)}")
    column, sign, label = AGAINST[against]
    drawn = {}
    for name, result in results.items():
        x, values = data.require(result, name, f"history/{column}", "history/force")
        drawn[name] = np.append(0.0, sign * x), np.append(0.0, values)
    # Without force the bodies move apart.
    touched = np.concatenate([[0.0], *(x[force > 0.0] for x, force in drawn.values())])
    length = style.scale_of(results, "length", [touched])
    pound = style.scale_of(results, "force", [f for _, f in drawn.values()])
    figure, (axes,) = style.panels(width, tall=1.2)
    for (name, (x, values)), colour in zip(drawn.items(), style.colours(), strict=False):
        axes.plot(x, values, color=colour, label=name)
    if touched.any():
        axes.set_xlim(1.05 * touched.min(), 1.05 * touched.max())
    axes.set_ylim(bottom=0.0)
    length.name(axes.xaxis, label)
    pound.name(axes.yaxis, "Contact force")
    _mark_open_ends(axes, results, width)
    if len(drawn) > 1:
        style.lines_legend(figure, axes)
    return Picture(figure)


def energy(results: Results, *, width: str = "column") -> Picture:
    """Energies of plate, projectile and indentation, and their sum; one line style per result."""
    style.limit_count(len(results), "results", len(style.STYLES))
    energies = dict(ENERGIES)
    if not all("energy/damping_work" in result for result in results.values()):
        del energies["damping_work"]
    paths = ("energy/time", *(f"energy/{column}" for column in energies))
    drawn = {name: data.require(result, name, *paths) for name, result in results.items()}
    times = [columns[0] for columns in drawn.values()]
    clock = style.scale_of(results, "time", times)
    parts = [values for columns in drawn.values() for values in columns[1:]]
    work = style.scale_of(results, "force*length", parts)
    figure, (axes,) = style.panels(width, tall=1.1)
    shades = [*style.colours()[: len(energies)], "0.5"]
    for (time, *columns), look in zip(drawn.values(), style.STYLES, strict=False):
        for values, colour in zip((*columns, np.sum(columns, axis=0)), shades, strict=True):
            axes.plot(time, values, color=colour, ls=look)
    axes.set_ylim(bottom=0.0)
    work.name(axes.yaxis, "Energy")
    _mark_open_ends(axes, results, width)
    _time_axis(axes, clock, times)
    handles = [Line2D([], [], color=c) for c in shades]
    labels = [*energies.values(), "sum"]
    if len(drawn) > 1:
        handles += [Line2D([], [], color="0.3", ls=look) for look in style.STYLES[: len(drawn)]]
        labels += list(drawn)
    style.legend(figure, handles, labels)
    return Picture(figure)


def strain(
    results: Results,
    *,
    at: Sequence[tuple[float, float]] = (),
    gages: Sequence[float] = (0.0, 90.0),
    face: str = "far",
    width: str = "column",
) -> Picture:
    """Surface strain z κ, or curvature, in given directions at given points against time.

    At an angle θ from the x-axis κ = κx cos² θ + κy sin² θ + κxy sin θ cos θ, with the engineering
    twist κxy.  At a node it is the mean of the adjacent elements.

    The points `at` (length) are by default the one with the largest bending strain outside the
    load; `gages` are degrees from the x-axis; `face` is ``"far"`` (z = h/2), ``"struck"``
    (z = -h/2), or ``"curvature"``.
    """
    lines: dict[str, tuple[data.Array, data.Array]] = {}
    for name, result in results.items():
        for label, values in _strains(result, name, at, gages, face).items():
            text = f"{name}, {label}" if len(results) > 1 else label
            lines[text] = data.require(result, name, "tape8/time")[0], values
    if len(lines) > len(style.COLOURS):
        raise PlotError(
            f"{len(lines)} lines can't be told apart in one picture; ask for fewer points, "
            f"directions or results, at most {len(style.COLOURS)} in all"
        )
    times, values_of = zip(*lines.values(), strict=True)
    shown, name = style.scale(style.peak(*values_of), ""), f"Strain, {face} face"
    if face == "curvature":
        shown, name = style.scale_of(results, "1/length", values_of), "Curvature"
    figure, (axes,) = style.panels(width)
    for (label, (time, values)), colour in zip(lines.items(), style.colours(), strict=False):
        axes.plot(time, values, color=colour, label=label)
    shown.name(axes.yaxis, name)
    _time_axis(axes, style.scale_of(results, "time", times), times)
    style.lines_legend(figure, axes)
    return Picture(figure)


def _strains(
    result: Result, name: str, at: Sequence[tuple[float, float]], gages: Sequence[float], face: str
) -> dict[str, data.Array]:
    """Histories of one result, by point and direction."""
    columns = data.require(result, name, "tape8/kappa_x", "tape8/kappa_y", "tape8/kappa_xy")
    points = data.strain_points(result, name)
    layers = data.deck_of(result, name).require(Material).layers
    thickness = sum(layer.thickness for layer in layers)
    places = [np.array(place) for place in at]
    if not places:
        outside = _distance(result, name, points) >= data.reach(result, name, thickness)
        places = [_most_strained(columns, points, outside)]
    height = {"far": thickness / 2.0, "curvature": 1.0}.get(face, -thickness / 2.0)
    symbol = "κ" if face == "curvature" else "ε"
    if face != "curvature" and result["mesh/equations"][:, :2].any():
        warn(
            f"the midplane of {name} may stretch; its strains are not stored, and the picture "
            "shows those of bending alone"
        )
    found: dict[str, data.Array] = {}
    for place in places:
        there = data.nearest(points, place, name)
        x, y = points[there].mean(axis=0)
        kappa_x, kappa_y, kappa_xy = (column[:, there].mean(axis=1) for column in columns)
        for angle in gages:
            c, s = np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))
            values = height * (c * c * kappa_x + s * s * kappa_y + s * c * kappa_xy)
            direction = {0.0: "x", 90.0: "y"}.get(angle, f" {angle:g}°")
            found[f"{symbol}{direction} at {x:.4g}, {y:.4g}"] = values
    return found


def _distance(result: Result, name: str, points: data.Array) -> data.Array:
    """Distance of points, (..., 2), from the load; infinite without a load."""
    load = data.struck(result, name)
    if not len(load):
        return np.full(points.shape[:-1], np.inf)
    return np.asarray(np.hypot(*np.moveaxis(points - load[0], -1, 0)))


def _most_strained(
    curvatures: Sequence[data.Array], points: data.Array, outside: data.Array
) -> data.Array:
    """Place, (2,), of the largest principal curvature of all rows, outside the load if possible.

    Of equal ones, as of a symmetric plate, the place with the largest x, then y.
    """
    x, y, xy = curvatures
    largest = (np.abs(x + y) + np.hypot(x - y, xy)).max(axis=0)
    if outside.any():
        largest = np.where(outside, largest, -1.0)
    equal = largest >= largest.max() * (1.0 - 1e-9)
    return np.array(max(points[equal].round(12).tolist()))
