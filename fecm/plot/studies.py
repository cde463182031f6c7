"""Pictures of waves, indentation tests and the rod (figures 2.4 to 4.9 of the report)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np
from matplotlib.lines import Line2D

from fecm._typing import Floats
from fecm.deck.units import unit_of
from fecm.plot import style
from fecm.plot.kinds import Picture
from fecm.plot.style import (
    COLOURS,
    DASHED,
    DOTTED,
    SOLID,
    Look,
    Multiple,
    limit_count,
    panels,
    scale_in,
    styled,
)
from fecm.studies.indentation_test.constants import ContactLawFit
from fecm.studies.indentation_test.turns import StretchKind
from fecm.studies.rod_test.pulse_test import Calibration, RodHistory
from fecm.studies.waves import FRONTS, MODES, Dispersion, Medium, WaveSurfaces

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.projections.polar import PolarAxes
    from matplotlib.typing import LineStyleType


COLOUR_OF = dict(zip(StretchKind, style.COLOURS, strict=False))
POINTS = 100


class GraphLine(NamedTuple):
    """Line of a graph."""

    label: str
    values: Floats
    colour: str
    style: LineStyleType = style.SOLID


@style.styled
def indentation_fit_picture(
    indentation: Floats, force: Floats, fit: ContactLawFit, units: Mapping[str, str]
) -> Picture:
    """Draw a test with its fitted curves, and permanent against largest indentation."""
    has_line = len(fit.cycles) > 1
    ratio = style.RATIO["column"]
    if has_line:
        figure, axes = style.panels("full", 1, 2, ratio=ratio)
    else:
        figure, axes = style.panels("column", ratio=ratio)
    curves, p = fit.solution.curves, fit.solution.scaled
    labels = {
        StretchKind.LOADING: "first loading",
        StretchKind.FALLING: "unloading",
        StretchKind.RISING: "reloading",
    }
    for number, stretch in enumerate(curves.division.stretches):
        colour, a = COLOUR_OF[stretch.kind], indentation[stretch.rows]
        label = labels.pop(stretch.kind, "_")
        axes[0].plot(
            a, force[stretch.rows], ".", label=label, color=colour, alpha=0.5, ms=3.0, mew=0.0
        )
        if number in curves.numbers(stretch.kind) and len(a):
            top = float(a.max())
            if stretch.kind is StretchKind.FALLING:  # it starts at the turning point
                top = max(top, fit.solution.values[curves.layout.corners[stretch.begin]])
            x = np.linspace(max(0.0, a.min()), top, POINTS)
            y = curves.force * curves.stretch(p, number, x / curves.length)
            axes[0].plot(x, y, color=colour)
    length = style.scale_in(units, "length", indentation)
    length.name(axes[0].xaxis, "Indentation")
    style.scale_in(units, "force", force).name(axes[0].yaxis, "Force")
    style.lines_legend(figure, axes[0])
    for handle in figure.legends[0].get_lines():
        handle.set(markersize=5.0, alpha=1.0)
    if has_line:
        _permanent(axes[1], fit, length)
    return Picture(figure)


def _permanent(axes: Axes, fit: ContactLawFit, length: style.AxisScale) -> None:
    """Draw permanent against largest indentation (figure 3.6)."""
    pairs = [(cycle.alpha_m, cycle.alpha_0) for cycle in fit.cycles]
    x, y, down, across = np.array([(m.value, o.value, o.error, m.error) for m, o in pairs]).T
    axes.errorbar(x, y, down, across, "o", color=style.COLOURS[0], ms=3.0, lw=0.8, capsize=2.0)
    peaks = np.linspace(0.0, 1.05 * x.max(), 4 * POINTS)
    if (relation := fit.relation()) is not None:
        axes.plot(peaks, np.asarray(relation.permanent(peaks)), color=style.COLOURS[1])
    axes.set_xlim(left=0.0)
    length.name(axes.xaxis, "Largest indentation")
    length.name(axes.yaxis, "Permanent indentation")


@style.styled
def path_picture(curves: Mapping[str, Floats], units: Mapping[str, str]) -> Picture:
    """Draw the forces along an indentation path by one or several laws (figures 3.2 to 3.18).

    Each law has its indentations and forces, (2, n).
    """
    return _draw_laws(curves, units, ("Indentation", "length"), ("Force", "force"))


@style.styled
def permanent_picture(curves: Mapping[str, Floats], units: Mapping[str, str]) -> Picture:
    """Draw permanent against largest indentations, (2, n), of some laws (figure 3.6)."""
    labels = ("Largest indentation", "length"), ("Permanent indentation", "length")
    return _draw_laws(curves, units, *labels)


def _draw_laws(
    curves: Mapping[str, Floats],
    units: Mapping[str, str],
    horizontal: tuple[str, str],
    vertical: tuple[str, str],
) -> Picture:
    """Draw a line for each law; the axes have a label and a dimension each."""
    limit_count(len(curves), "laws")
    figure, (axes,) = style.panels("column")
    for (name, curve), colour in zip(curves.items(), COLOURS, strict=False):
        axes.plot(*curve, color=colour, label=name)
    for axis, (label, dimension), row in (
        (axes.xaxis, horizontal, 0),
        (axes.yaxis, vertical, 1),
    ):
        values = [curve[row] for curve in curves.values()]
        style.scale_in(units, dimension, *values).name(axis, label)
    if any(curves):
        style.lines_legend(figure, axes)
    return Picture(figure)


@style.styled
def rigidity_picture(
    peaks: Floats, relations: Mapping[str, Floats], power: float, units: Mapping[str, str]
) -> Picture:
    """Draw the unloading rigidity against the largest indentation (figure 3.19).

    Each relation has its rigidities, force/length^power, at the `peaks`, (n,).
    """
    # The rigidity is unbounded towards zero: the deeper half sets the height of the axis.
    top = 3.0 * max(float(s[len(s) // 2 :].max()) for s in relations.values())
    stiff = style.scale(top, unit_of(f"force/length^{power:g}", dict(units)))
    figure, (axes,) = style.panels("column")
    looks = zip(relations.items(), style.COLOURS, style.STYLES, strict=False)
    for (name, values), colour, look in looks:
        axes.plot(peaks, values, color=colour, ls=look, label=name)
    axes.set_ylim(0.0, top)
    axes.set_xlim(left=0.0)
    style.scale_in(units, "length", peaks).name(axes.xaxis, "Largest indentation")
    stiff.name(axes.yaxis, "Unloading rigidity")
    style.lines_legend(figure, axes)
    return Picture(figure)


def _against_time(
    axes: Axes,
    time: Floats,
    lines: Sequence[GraphLine],
    name: str,
    dimension: str,
    units: Mapping[str, str],
) -> None:
    """Draw lines against time, and label both axes."""
    for line in lines:
        axes.plot(time, line.values, color=line.colour, ls=line.style, label=line.label)
    style.scale(float(time[-1]), unit_of("time", dict(units))).name(axes.xaxis, "Time")
    size = style.scale_in(units, dimension, *(line.values for line in lines))
    size.name(axes.yaxis, name)
    axes.set_xlim(min(0.0, float(time[0])), float(time[-1]))


@style.styled
def pulse_picture(
    history: RodHistory, filtered: Floats | None, units: Mapping[str, str]
) -> Picture:
    """Draw forces, and accelerations below them, as in figures 4.7 and 4.8.

    `filtered` are the filtered forces at the stations, (rows, stations).
    """
    figure, (above, below) = style.panels("column", 2, sharex=True)
    forces = [GraphLine("applied", history.applied, style.COLOURS[-1], style.DOTTED)]
    for number, x in enumerate(history.stations):
        colour = style.COLOURS[number % (len(style.COLOURS) - 1)]
        place = f"at {x:.4g} {unit_of('length', dict(units))}".rstrip()
        forces.append(GraphLine(place, history.forces[:, number], colour))
        if filtered is not None:
            values = filtered[:, number]
            forces.append(GraphLine(f"{place}, filtered", values, colour, style.DASHED))
    _against_time(above, history.time, forces, "Force", "force", units)
    above.set_xlabel("")
    ends = [
        GraphLine(label, values, colour, line_style)
        for label, values, colour, line_style in zip(
            ("struck end", "middle", "far end"),
            history.accelerations.T,
            style.COLOURS,
            style.STYLES,
            strict=False,
        )
    ]
    _against_time(below, history.time, ends, "Acceleration", "length/time^2", units)
    style.lines_legend(figure, above)
    below.legend(loc="upper right")  # the pulse is over by then: this corner is free
    return Picture(figure)


@style.styled
def filter_picture(
    time: Floats, named: Mapping[str, Floats], units: Mapping[str, str], dimension: str
) -> Picture:
    """Draw histories, (rows,) each, against time: measured, filtered and others.

    The legend has the names of the histories. `dimension` is empty if it is unknown.
    """
    figure, (axes,) = style.panels("column")
    looks = zip(named.items(), style.COLOURS, strict=False)
    lines = [GraphLine(name, values, colour) for (name, values), colour in looks]
    name = "Force" if dimension == "force" else next(reversed(list(named)[:-1])).capitalize()
    _against_time(axes, time, lines, style.literal(name), dimension, units)
    style.lines_legend(figure, axes)
    return Picture(figure)


@style.styled
def calibration_picture(
    time: Floats, v_f: Floats, v_a: Floats, calibration: Calibration, units: Sequence[str]
) -> Picture:
    """Draw both outputs against time (figure 4.5), and against each other with the fit (4.6).

    `units` are the units of time, V_F and V_a.
    """
    figure, (left, right) = style.panels("full", 1, 2, ratio=2 * style.RATIO["full"])
    a_axes = left.twinx()
    a_axes.spines["right"].set_visible(True)
    handles: list[Artist] = [*left.plot(time, v_f, color=style.COLOURS[0])]
    handles += a_axes.plot(time, v_a, color=style.COLOURS[1])
    handles += right.plot(v_a, v_f, "o", color=style.COLOURS[0], ms=2.0)
    ends = np.array([min(0.0, float(v_a.min())), max(0.0, float(v_a.max()))])
    handles += right.plot(
        ends, calibration.offset + calibration.slope * ends, color=style.COLOURS[-1]
    )
    peaks = float(time[-1]), style.largest_absolute(v_f), style.largest_absolute(v_a)
    clock, f_scale, a_scale = map(style.scale, peaks, units)
    clock.name(left.xaxis, "Time")
    f_scale.name(left.yaxis, "$V_F$")
    f_scale.name(right.yaxis, "$V_F$")
    a_scale.name(a_axes.yaxis, "$V_a$")
    a_scale.name(right.xaxis, "$V_a$")
    labels = [
        "$V_F$",
        "$V_a$",
        "measured",
        f"slope {calibration.slope:.4g} ± {calibration.slope_error:.2g}",
    ]
    style.legend(figure, handles, labels)
    for text in figure.legends[0].get_texts():
        text.set_parse_math(True)
    return Picture(figure)


AROUND = np.arange(1441) / 4.0  # directions of the normals, degrees
RAYS = 45.0  # degrees between the normals of the rays
WORDS = {name: name.replace("_", " ").replace("in plane", "in-plane") for name in (*MODES, *FRONTS)}
# One style per mode.
DASH_DOT: LineStyleType = (0, (7, 1.5, 1, 1.5))
DASH_DOT_DOT: LineStyleType = (0, (7, 1.5, 1, 1.5, 1, 1.5))
DASHES = (SOLID, DASHED, DOTTED, DASH_DOT, DASH_DOT_DOT)
CUSP: Look = {"ls": "", "marker": "o", "ms": 3.0, "mfc": "white", "mec": "black", "mew": 0.6}


# Modes whose phase velocity is bounded; the other two grow with the wavelength.
BOUNDED = ("flexural_1", "extension", "in_plane_shear")


@styled
def dispersion_picture(
    medium: Medium, curves: Sequence[Dispersion], modes: Sequence[str] = MODES
) -> Picture:
    """Draw phase velocities and frequencies of some modes against the wavelength.

    Velocities are divided by the transverse shear velocity, frequencies by the ratio of this
    velocity to the thickness, as in figures 2.4 and 2.5. The axes end just above the in-plane modes
    and the cut-off.
    """
    limit_count(len(curves), "directions")
    unit = medium.shear_velocity
    velocities = [curve.phase_velocity / unit for curve in curves]
    frequencies = [c.angular_frequency * medium.laminate.thickness / unit for c in curves]
    figure, axes = panels("full", 1, 2, ratio=0.66)
    for curve, colour, *both in zip(curves, COLOURS, velocities, frequencies, strict=False):
        for ax, values in zip(axes, both, strict=True):
            for mode, column, dashes in zip(MODES, values.T, DASHES, strict=True):
                if mode in modes:
                    ax.plot(curve.wavelength, column, color=colour, ls=dashes)
    angles = [f"{curve.angle:g}°" for curve in curves]
    colours = [Line2D([], [], color=colour) for colour in COLOURS[: len(curves)]]
    figure.legend(colours, angles, loc="outside upper left", ncols=4)
    looks = {mode: dashes for mode, dashes in zip(MODES, DASHES, strict=True) if mode in modes}
    lines = [Line2D([], [], color="0.3", ls=dashes) for dashes in looks.values()]
    words = [WORDS[mode] for mode in looks]
    figure.legend(lines, words, loc="outside upper right", ncols=5, handlelength=2.6)
    longest = max(float(curve.wavelength[-1]) for curve in curves)
    for ax in axes:
        ax.set(xlim=(0.0, longest), xlabel="Wavelength $\\lambda/h$")
    bounded = [n for n, mode in enumerate(MODES) if mode in modes and mode in BOUNDED] or [3, 4]
    top = 1.15 * max(float(values[:, bounded].max()) for values in velocities)
    axes[0].set(ylim=(0.0, top), ylabel="Phase velocity $c/c_s$")
    top = 2.6 * max(float(values[-1, 1:3].max()) for values in frequencies)
    axes[1].set(ylim=(0.0, top), ylabel="Frequency $\\omega h/c_s$")
    return Picture(figure)


@styled
def speeds_picture(surfaces: WaveSurfaces, units: Mapping[str, str]) -> Picture:
    """Draw the normal velocities of in-plane and flexural fronts as polar graphs."""
    fronts = surfaces.fronts(AROUND)
    speed = scale_in(units, "length/time", fronts.velocity)
    figure, axes = panels("full", 1, 2, ratio=1.16, projection="polar")
    figure.set_layout_engine("constrained")
    graphs = cast("list[PolarAxes]", axes)
    for place, (front, colour) in enumerate(zip(FRONTS, COLOURS, strict=False)):
        curve = np.deg2rad(fronts.normal), fronts.velocity[:, place]
        graphs[0 if place < 2 else 1].plot(*curve, color=colour, label=WORDS[front])
    for ax, title in zip(graphs, ("In-plane fronts", "Flexural fronts"), strict=True):
        ax.set_title(speed.label(f"{title}: normal velocity"))
        ax.set_rlim(0.0, 1.06 * float(fronts.velocity.max()))
        ax.yaxis.set_major_formatter(Multiple(speed.factor))
        ax.set_rlabel_position(112.5)
        ax.tick_params(labelsize=6.5, pad=1)
        ax.grid(lw=0.4, color="0.8")
        ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.07), ncols=3)
    return Picture(figure)


@styled
def fronts_picture(
    surfaces: WaveSurfaces, times: Sequence[float], radius: float, units: Mapping[str, str]
) -> Picture:
    """Draw fronts with rays and cusps at several times, one graph per mode."""
    limit_count(len(times), "times")
    fronts, rays = surfaces.fronts(AROUND), surfaces.fronts(np.arange(0.0, 360.0, RAYS))
    places = [fronts.positions(time, radius) for time in times]
    ends = rays.positions(0.0, radius), rays.positions(max(times), radius)
    turns = [surfaces.cusps(time, radius) for time in times]
    length = scale_in(units, "length", *places)
    clock = scale_in(units, "time", np.array(times))
    around = np.linspace(0.0, 2.0 * np.pi, 181)
    circle = radius * np.cos(around), radius * np.sin(around)
    figure, axes = panels("full", 2, 3, ratio=0.95)
    for mode, ax in enumerate(axes[:5]):
        ax.plot(*circle, color="0.4", ls=DOTTED)
        for start, end in zip(*(position[:, mode] for position in ends), strict=True):
            ax.plot(*zip(start, end, strict=True), color="0.6", lw=0.5)
        for position, colour in zip(places, COLOURS, strict=False):
            ax.plot(*position[:, mode].T, color=colour)
        dots = [(c.x, c.y) for cusps in turns for c in cusps if c.mode == FRONTS[mode]]
        ax.plot(*np.reshape(dots, (-1, 2)).T, **CUSP)
        ax.set_title(WORDS[FRONTS[mode]])
        ax.locator_params(nbins=5)
        ax.set_aspect("equal")
        length.name(ax.xaxis, "$x$")
        length.name(ax.yaxis, "$y$")
    axes[5].set_axis_off()
    handles = [Line2D([], [], color=colour) for _, colour in zip(times, COLOURS, strict=False)]
    labels = [clock.show(time) for time in times]
    handles += [Line2D([], [], color="0.4", ls=DOTTED), Line2D([], [], color="0.6", lw=0.5)]
    labels += ["time 0", f"rays, normals {RAYS:g}° apart"]
    if any(turns):
        handles.append(Line2D([], [], **CUSP))
        labels.append("cusps")
    axes[5].legend(handles, labels, loc="center")
    return Picture(figure)
