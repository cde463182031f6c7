"""Pictures against time: force, loop, energy, strains (figures 4.12 to 4.19 of the report)."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from matplotlib.lines import Line2D

from fecm._errors import warn
from fecm._typing import Array
from fecm.deck.model import Material
from fecm.judge.threshold import from_threshold
from fecm.plot import data, style
from fecm.plot.kinds import Against, Face, Picture, PlotError, Width
from fecm.results.comparison import Source, compare_force, measurement_of
from fecm.results.result import Result
from fecm.results.run_metrics import start_w_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from fecm.identification.result import Identification


Results = Mapping[str, Result]

POINTS = 200  # most measured points that are drawn as points


class DrawnForces(NamedTuple):
    """Forces of a run; a rigid mass has its contact force as the force of the transducer."""

    time: Array
    contact: Array
    transducer: Array


class Abscissa(NamedTuple):
    """Abscissa of a loop."""

    column: str  # of the history
    sign: float
    label: str


AGAINST: dict[Against, Abscissa] = {
    "indentation": Abscissa("indentation", 1.0, "Indentation"),
    "deflection": Abscissa("plate_w", 1.0, "Deflection under the load"),
    "displacement": Abscissa("displacement", -1.0, "Displacement of the projectile"),
}
ENERGIES = {
    "plate_kinetic": "plate, kinetic",
    "plate_strain": "plate, strain",
    "projectile_kinetic": "projectile, kinetic",
    "projectile_strain": "projectile, strain",
    "contact_work": "indentation",
    "damping_work": "damping",
}


def time_axis(axes: Axes, clock: style.AxisScale, times: Iterable[Array]) -> None:
    """Label the time axis, and end it with the longest history."""
    clock.name(axes.xaxis, "Time")
    axes.set_xlim(0.0, max(float(array[-1]) for array in times))


def _mark_open_ends(axes: Axes, results: Results, width: Width) -> None:
    """Note above a graph which contacts last to the end."""
    if text := style.open_ends_note(results):
        text = textwrap.fill(text, int(style.LETTERS * style.WIDTHS[width]))
        axes.set_title(text, loc="right", fontsize=style.FOOTER).set_parse_math(False)


def force(
    results: Results,
    *,
    overlay: Source | None = None,
    columns: Sequence[str] = (),
    units: Sequence[str] = (),
    delay: float = 0.0,
    offset: float = 0.0,
    width: Width = "column",
) -> Picture:
    """Draw contact force and transducer against time.

    The contact forces of several results have one graph, the transducers another. Springs and
    one-sided supports of a single result have their pushing and pulling forces. The transducer of
    a rigid mass is its contact force and is not drawn again. A dashed line marks the delamination
    threshold of a result that has one. `overlay` is a measured force: a CSV file with the columns
    time and force (or transducer), or times and forces. It is converted to the deck's units if it
    names its own. `columns` has the names or the numbers (from 1) of the columns of time and force.
    `units` has their units, for a measurement that names none. `delay` and `offset`, in the deck's
    units, are subtracted from times and forces.
    """
    if overlay is None and (delay or offset or columns or units):
        raise PlotError(
            "delay, offset, columns and units describe a measured force; give an overlay too"
        )
    style.limit_count(len(results), "forces")
    paths = ("history/time", "history/force", "history/transducer")
    drawn = {
        name: DrawnForces(*data.require_datasets(result, name, *paths))
        for name, result in results.items()
    }
    times = [forces.time for forces in drawn.values()]
    limits, words = _thresholds(results)
    sizes = [values for forces in drawn.values() for values in (forces.contact, forces.transducer)]
    sizes.append(np.array(list(limits.values())))
    measured = None
    if overlay is not None:
        first = next(iter(results.values()))
        measured = measurement_of(overlay, first.units, columns, units).corrected(delay, offset)
        sizes.append(measured.force)
    pound = style.scale_of(results, "force", sizes)

    figure, axes = _draw_forces(drawn, pound, width, _of_whole(results))
    _mark_thresholds(axes[0], limits, words, list(drawn), pound)
    if len(results) == 1:
        _draw_supports(axes[0], *results.values())
    time_axis(axes[-1], style.scale_of(results, "time", times), times)
    _mark_open_ends(axes[0], results, width)
    notes = []
    if measured is not None:  # drawn last, over the computed forces
        look = _measured_look(measured.time) | {"color": "0.2", "zorder": 3.0}
        ax = axes[-1] if measured.column == "transducer" else axes[0]
        if ax is not axes[0]:
            axes[0].plot([], [], label=measured.name, **look)  # for the legend
        ax.plot(measured.time, measured.force, label=measured.name, **look)
        for name, result in results.items():
            compared = compare_force(result, measured)
            notes.append(f"{measured.quantity} of {name} against {measured.name}: {compared}")
    style.lines_legend(figure, axes[0])
    return Picture(figure, notes=notes)


def _draw_supports(axes: Axes, result: Result) -> None:
    """Draw the forces with which springs and one-sided supports push and pull, if stored."""
    if "supports/push" not in result:
        return
    for name, colour in (("push", style.COLOURS[2]), ("pull", style.COLOURS[3])):
        if (values := result.whole(f"supports/{name}")).any():
            label = f"supports {name}"
            axes.plot(result["supports/time"], values, ls=style.DASHED, color=colour, label=label)


def _draw_forces(
    drawn: Mapping[str, DrawnForces], pound: style.AxisScale, width: Width, whole: str
) -> tuple[Figure, list[Axes]]:
    """Draw the forces of one result in one graph; of several results, transducers have a second.

    `whole` ends the names of the axes.
    """
    colours = style.colours()
    rigid = all(
        np.array_equal(forces_of_run.contact, forces_of_run.transducer)
        for forces_of_run in drawn.values()
    )
    if len(drawn) == 1:
        figure, axes = style.panels(width)
        (forces,) = drawn.values()
        axes[0].plot(forces.time, forces.contact, color=colours[0], label="contact force")
        if not rigid:
            axes[0].plot(forces.time, forces.transducer, color=colours[1], label="transducer")
        pound.name(axes[0].yaxis, f"{'Contact force' if rigid else 'Force'}{whole}")
        return figure, axes

    rows, tall = (1, 1.0) if rigid else (2, 0.65)
    figure, axes = style.panels(width, rows, sharex=True, sharey=True, tall=tall)
    for (name, forces), colour in zip(drawn.items(), colours, strict=False):
        for ax, values in zip(axes, (forces.contact, forces.transducer), strict=False):
            ax.plot(forces.time, values, color=colour, label=name)
    for ax, text in zip(axes, ("Contact force", "Transducer"), strict=False):
        pound.name(ax.yaxis, f"{text}{whole}")
    return figure, axes


def _of_whole(results: Results) -> str:
    """Return the words that forces and energies of a symmetric part are of the whole plate."""
    is_part = any(result.symmetry_factor > 1 for result in results.values())
    return ", whole plate" if is_part else ""


def _mark_thresholds(
    axes: Axes,
    limits: Mapping[str, float],
    words: Mapping[str, str],
    names: Sequence[str],
    pound: style.AxisScale,
) -> None:
    """Draw thresholds, and name their results unless all share one threshold."""
    colours = dict(zip(names, style.colours(), strict=False))
    for limit in dict.fromkeys(limits.values()):
        owners = [name for name in limits if limits[name] == limit]
        whose = f"{', '.join(owners)}: " if len(owners) < len(names) else ""
        axes.axhline(
            limit,
            ls=style.DASHED,
            lw=0.8,
            color=colours[owners[0]] if whose else "0.3",
            label=f"{whose}delamination {words[owners[0]]} {pound.show(limit)}",
        )


def _measured_look(time: Array) -> style.Look:
    """Return the look of measured values: points if there are few, else a thin line."""
    if len(time) <= POINTS:
        return {"lw": 0.6, "ls": "none", "marker": ".", "ms": 3.0}
    return {"lw": 0.6}


@style.styled
def force_fit_picture(fit: Identification, units: Mapping[str, str]) -> Picture:
    """Draw measured and fitted force, and below them the residual and its rms."""
    clock = style.scale_in(units, "time", fit.time)
    figure, (above, below) = style.panels("column", 2, sharex=True, tall=0.6)
    look = _measured_look(fit.time)
    above.plot(fit.time, fit.force, color="0.4", label="measured", **look)
    above.plot(fit.time, fit.model, color=style.COLOURS[0], label="fitted")
    below.plot(fit.time, fit.residual, color="0.4", **look)
    below.axhline(0.0, color=style.COLOURS[0])
    for value in (-fit.rms, fit.rms):
        below.axhline(value, color=style.COLOURS[0], ls=style.DASHED, lw=0.6)
    for axes, name, values in ((above, "Force", fit.force), (below, "Residual", fit.residual)):
        style.scale_in(units, "force", values).name(axes.yaxis, name)
    clock.name(below.xaxis, "Time")
    style.lines_legend(figure, above)
    return Picture(figure)


def _thresholds(results: Results) -> tuple[dict[str, float], dict[str, str]]:
    """Return delamination thresholds, and the words before them, by the names of results."""
    values: dict[str, float] = {}
    words: dict[str, str] = {}
    for name, result in results.items():
        if result.threshold:
            value = result.threshold.get("force")
            if not isinstance(value, int | float) or not 0.0 < value <= data.LARGEST:
                raise PlotError(f"{name} has a delamination threshold that can't be drawn: {value}")
            values[name] = value
            words[name] = from_threshold(result.threshold.get("number"))
    return values, words


def loop(results: Results, *, against: Against | None = None, width: Width = "column") -> Picture:
    """Draw the contact force against indentation or displacement, from rest.

    ``"deflection"`` is the displacement of the plate under the load. ``"displacement"`` is the
    displacement of the projectile's impacted end towards the plate: in contact, the sum of
    deflection and indentation. The default is the displacement if every projectile is a rigid mass,
    else the indentation.
    """
    style.limit_count(len(results), "loops")
    if against is None:
        against = "displacement" if all(map(_is_rigid, results.values())) else "indentation"
    if against not in AGAINST:
        raise PlotError(f"unknown against {against}; a loop is drawn against {', '.join(AGAINST)}")
    column, sign, label = AGAINST[against]
    drawn = {}
    for name, result in results.items():
        x, values = data.require_datasets(result, name, f"history/{column}", "history/force")
        start = start_w_of(result) if against == "deflection" else 0.0
        drawn[name] = np.append(start, sign * x), np.append(0.0, values)
    # Without force the bodies move apart: the axis ends with the contact.
    touched = np.concatenate(
        [part for x, force in drawn.values() for part in (x[:1], x[force > 0.0])]
    )
    length = style.scale_of(results, "length", [touched])
    pound = style.scale_of(results, "force", [f for _, f in drawn.values()])
    figure, (axes,) = style.panels(width, tall=1.2)
    for (name, (x, values)), colour in zip(drawn.items(), style.colours(), strict=False):
        axes.plot(x, values, color=colour, label=name)
    if touched.any():
        axes.set_xlim(1.05 * touched.min(), 1.05 * touched.max())
    axes.set_ylim(bottom=0.0)
    length.name(axes.xaxis, label)
    pound.name(axes.yaxis, f"Contact force{_of_whole(results)}")
    _mark_open_ends(axes, results, width)
    if len(drawn) > 1:
        style.lines_legend(figure, axes)
    return Picture(figure)


def energy(results: Results, *, width: Width = "column") -> Picture:
    """Draw energies of plate, projectile and indentation, and their sum.

    Each result has a line style.
    """
    style.limit_count(len(results), "results", len(style.STYLES))
    energies = dict(ENERGIES)
    if not all("energy/damping_work" in result for result in results.values()):
        del energies["damping_work"]
    if all(map(_is_rigid, results.values())):
        del energies["projectile_strain"]
        energies["projectile_kinetic"] = "projectile"
    paths = ("energy/time", *(f"energy/{column}" for column in energies))
    drawn = {name: data.require_datasets(result, name, *paths) for name, result in results.items()}
    times = [columns[0] for columns in drawn.values()]
    clock = style.scale_of(results, "time", times)
    parts = [values for columns in drawn.values() for values in columns[1:]]
    work = style.scale_of(results, "force*length", parts)
    figure, (axes,) = style.panels(width, tall=1.1)
    shades = [style.colours()[list(ENERGIES).index(column)] for column in energies] + ["0.5"]
    for (time, *columns), look in zip(drawn.values(), style.STYLES, strict=False):
        for values, colour in zip((*columns, np.sum(columns, axis=0)), shades, strict=True):
            axes.plot(time, values, color=colour, ls=look)
    axes.set_ylim(bottom=0.0)
    work.name(axes.yaxis, f"Energy{_of_whole(results)}")
    _mark_open_ends(axes, results, width)
    time_axis(axes, clock, times)
    handles = [Line2D([], [], color=c) for c in shades]
    labels = [*energies.values(), "sum"]
    if len(drawn) > 1:
        handles += [Line2D([], [], color="0.3", ls=look) for look in style.STYLES[: len(drawn)]]
        labels += list(drawn)
    elif points := _membrane(axes, results):
        handles.append(points)
        labels.append("plate, membrane")
    style.legend(figure, handles, labels)
    return Picture(figure)


def _is_rigid(result: Result) -> bool:
    """Return whether the projectile is a rigid mass, which has no strain energy."""
    path = "energy/projectile_strain"
    return path in result and not result[path].any()


def _membrane(axes: Axes, results: Results) -> Line2D | None:
    """Draw the membrane's part of the strain energy at the stored rows.

    Returns None if it is not stored.
    """
    ((name, result),) = results.items()
    if "membrane/energy" not in result:
        return None
    time, values = data.require_datasets(result, name, "membrane/time", "membrane/energy")
    colour = style.colours()[len(ENERGIES)]
    (points,) = axes.plot(time, values, color=colour, ls="none", marker=".", ms=3.0)
    return points


AXES = {0.0: "x", 90.0: "y"}  # names of directions (degrees)


def strain_picture(
    results: Results,
    *,
    at: Sequence[tuple[float, float]] = (),
    gages: Sequence[float] = (0.0, 90.0),
    face: Face = "far",
    width: Width = "column",
) -> Picture:
    """Draw surface strain z κ, or curvature, in directions at points against time.

    At an angle θ from the x-axis, κ = κx cos² θ + κy sin² θ + κxy sin θ cos θ, with the engineering
    twist κxy. At a node, κ is the mean of the adjacent elements. `at` has points (length), by
    default the point with the largest bending strain outside the load. `gages` has directions in
    degrees from the x-axis. `face` is ``"far"`` (z = h/2), ``"struck"`` (z = -h/2), or
    ``"curvature"``.
    """
    lines: dict[str, tuple[Array, Array]] = {}
    for name, result in results.items():
        for label, values in _strains(result, name, at, gages, face).items():
            text = f"{name}, {label}" if len(results) > 1 else label
            lines[text] = data.require_datasets(result, name, "tape8/time")[0], values
    if len(lines) > len(style.COLOURS):
        raise PlotError(
            f"{len(lines)} lines can't be told apart in one picture; ask for fewer points, "
            f"directions or results, at most {len(style.COLOURS)} in all"
        )
    times, values_of = zip(*lines.values(), strict=True)
    if face == "curvature":
        shown, name = style.scale_of(results, "1/length", values_of), "Curvature"
    else:
        stretches = any(map(_may_stretch, results.values()))
        what = "Bending strain" if stretches else "Strain"
        shown, name = style.scale(style.largest_absolute(*values_of), ""), f"{what}, {face} face"
    figure, (axes,) = style.panels(width)
    for (label, (time, values)), colour in zip(lines.items(), style.colours(), strict=False):
        axes.plot(time, values, color=colour, label=label)
    shown.name(axes.yaxis, name)
    time_axis(axes, style.scale_of(results, "time", times), times)
    style.lines_legend(figure, axes)
    return Picture(figure)


def _strains(
    result: Result, name: str, at: Sequence[tuple[float, float]], gages: Sequence[float], face: Face
) -> dict[str, Array]:
    """Return the histories of one result, by the name of point and direction."""
    columns = data.require_datasets(
        result, name, "tape8/kappa_x", "tape8/kappa_y", "tape8/kappa_xy"
    )
    points = data.strain_points(result, name)
    layers = data.result_deck(result, name).require(Material).layers
    thickness = sum(layer.thickness for layer in layers)
    places = [np.array(place) for place in at]
    if not places:
        outside = _distance(result, name, points) >= data.reach(result, name, thickness)
        places = [_most_strained(columns, points, outside)]
    match face:
        case "curvature":
            symbol, height = "κ", 1.0
        case "far":
            symbol, height = "ε", thickness / 2.0
        case _:
            symbol, height = "ε", -thickness / 2.0
    if face != "curvature" and _may_stretch(result):
        warn(
            f"the midplane of {name} may stretch; its strains are not stored, and the picture "
            "shows bending strains only"
        )
    histories: dict[str, Array] = {}
    for place in places:
        there = data.nearest(points, place, name)
        x, y = points[there].mean(axis=0)
        kappa_x, kappa_y, kappa_xy = (column[:, there].mean(axis=1) for column in columns)
        for angle in gages:
            c, s = np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))
            values = height * (c * c * kappa_x + s * s * kappa_y + s * c * kappa_xy)
            direction = AXES.get(angle, f" {angle:g}°")
            histories[f"{symbol}{direction} at {x:.4g}, {y:.4g}"] = values
    return histories


def _may_stretch(result: Result) -> bool:
    """Return whether a point of the midplane can move in the plane."""
    return bool(result["mesh/equations"][:, :2].any())


def _distance(result: Result, name: str, points: Array) -> Array:
    """Return the distance of points, (..., 2), from the load; infinite without a load."""
    load = data.struck(result, name)
    if not len(load):
        return np.full(points.shape[:-1], np.inf)
    return np.asarray(np.hypot(*np.moveaxis(points - load[0], -1, 0)))


def _most_strained(curvatures: Sequence[Array], points: Array, outside: Array) -> Array:
    """Return the place, (2,), of the largest principal curvature, outside the load if possible.

    If values are equal, as in a symmetric plate, it is the place with the largest x, then y.
    """
    x, y, xy = curvatures
    largest = (np.abs(x + y) + np.hypot(x - y, xy)).max(axis=0)
    if outside.any():
        largest = np.where(outside, largest, -1.0)
    equal = largest >= largest.max() * (1.0 - 1e-9)
    return np.array(max(points[equal].round(12).tolist()))
