"""Pictures of tests: indentation (the report's figures 3.2 to 3.19), the rod (4.5 to 4.9)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fecm._typing import Floats
from fecm.deck.units import unit_of
from fecm.plot import style
from fecm.plot.kinds import Picture
from fecm.studies.indentation_test.constants import Fit
from fecm.studies.indentation_test.turns import Kind
from fecm.studies.rod_test.calibration import Calibration
from fecm.studies.rod_test.pulse_test import RodHistory

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.typing import LineStyleType

COLOUR_OF = dict(zip(Kind, style.COLOURS, strict=False))
POINTS = 100


class Line(NamedTuple):
    """A line of a graph."""

    label: str
    values: Floats
    colour: str
    style: LineStyleType = style.SOLID


@style.styled
def fit_picture(
    indentation: Floats, force: Floats, found: Fit, units: Mapping[str, str]
) -> Picture:
    """Points of a test with the fitted curves, and permanent against largest indentation."""
    both = len(found.cycles) > 1
    ratio = style.RATIO["column"]
    if both:
        figure, axes = style.panels("full", 1, 2, ratio=ratio)
    else:
        figure, axes = style.panels("column", ratio=ratio)
    curves, p = found.solution.curves, found.solution.scaled
    labels = {
        Kind.LOADING: "first loading",
        Kind.FALLING: "unloading",
        Kind.RISING: "reloading",
    }
    for number, stretch in enumerate(curves.division.stretches):
        colour, a = COLOUR_OF[stretch.kind], indentation[stretch.rows]
        label = labels.pop(stretch.kind, "_")
        axes[0].plot(
            a, force[stretch.rows], ".", label=label, color=colour, alpha=0.5, ms=3.0, mew=0.0
        )
        if number in curves.numbers(stretch.kind) and len(a):
            top = float(a.max())
            if stretch.kind is Kind.FALLING:  # begin at the turning point
                top = max(top, found.solution.values[curves.layout.corners[stretch.begin]])
            x = np.linspace(max(0.0, a.min()), top, POINTS)
            y = curves.force * curves.stretch(p, number, x / curves.length)
            axes[0].plot(x, y, color=colour)
    length = style.scale_in(units, "length", indentation)
    length.name(axes[0].xaxis, "Indentation")
    style.scale_in(units, "force", force).name(axes[0].yaxis, "Force")
    style.lines_legend(figure, axes[0])
    for handle in figure.legends[0].get_lines():
        handle.set(markersize=5.0, alpha=1.0)
    if both:
        _permanent(axes[1], found, length)
    return Picture(figure)


def _permanent(axes: Axes, found: Fit, length: style.Scale) -> None:
    """Permanent against largest indentation (figure 3.6)."""
    pairs = [(cycle.alpha_m, cycle.alpha_0) for cycle in found.cycles]
    x, y, down, across = np.array([(m.value, o.value, o.error, m.error) for m, o in pairs]).T
    axes.errorbar(x, y, down, across, "o", color=style.COLOURS[0], ms=3.0, lw=0.8, capsize=2.0)
    peaks = np.linspace(0.0, 1.05 * x.max(), 4 * POINTS)
    if (relation := found.relation()) is not None:
        axes.plot(peaks, np.asarray(relation.permanent(peaks)), color=style.COLOURS[1])
    axes.set_xlim(left=0.0)
    length.name(axes.xaxis, "Largest indentation")
    length.name(axes.yaxis, "Permanent indentation")


@style.styled
def path_picture(indentation: Floats, force: Floats, units: Mapping[str, str]) -> Picture:
    """Force along an indentation path."""
    figure, (axes,) = style.panels("column")
    axes.plot(indentation, force, color=style.COLOURS[0])
    style.scale_in(units, "length", indentation).name(axes.xaxis, "Indentation")
    style.scale_in(units, "force", force).name(axes.yaxis, "Force")
    return Picture(figure)


@style.styled
def rigidity_picture(
    peaks: Floats, relations: Mapping[str, Floats], power: float, units: Mapping[str, str]
) -> Picture:
    """Unloading rigidity against largest indentation (figure 3.19).

    Drawn are the rigidities, force/length^power, of each relation at the `peaks`, (n,).
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
    lines: Sequence[Line],
    name: str,
    dimension: str,
    units: Mapping[str, str],
) -> None:
    """Draw lines against time, both axes scaled."""
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
    """Forces above, accelerations below, as in figures 4.7 and 4.8.

    `filtered` are the filtered forces at the stations, (rows, stations).
    """
    figure, (above, below) = style.panels("column", 2, sharex=True)
    forces = [Line("applied", history.applied, style.COLOURS[-1], style.DOTTED)]
    for number, x in enumerate(history.stations):
        colour = style.COLOURS[number % (len(style.COLOURS) - 1)]
        place = f"at {x:.4g} {unit_of('length', dict(units))}".rstrip()
        forces.append(Line(place, history.forces[:, number], colour))
        if filtered is not None:
            values = filtered[:, number]
            forces.append(Line(f"{place}, filtered", values, colour, style.DASHED))
    _against_time(above, history.time, forces, "Force", "force", units)
    above.set_xlabel("")
    ends = [
        Line(label, values, colour, line_style)
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
    """A history, the filtered history, and others beside them, (rows,) each, against time.

    The histories have their names in the legend; their dimension is empty if it is unknown.
    """
    figure, (axes,) = style.panels("column")
    looks = zip(named.items(), style.COLOURS, strict=False)
    lines = [Line(name, values, colour) for (name, values), colour in looks]
    name = "Force" if dimension == "force" else next(reversed(list(named)[:-1])).capitalize()
    _against_time(axes, time, lines, style.literal(name), dimension, units)
    style.lines_legend(figure, axes)
    return Picture(figure)


@style.styled
def calibration_picture(
    time: Floats, v_f: Floats, v_a: Floats, found: Calibration, units: Sequence[str]
) -> Picture:
    """Both outputs against time (figure 4.5), and one against the other with the fit (4.6).

    `units` are those of time, V_F and V_a.
    """
    figure, (left, right) = style.panels("full", 1, 2, ratio=2 * style.RATIO["full"])
    other = left.twinx()
    other.spines["right"].set_visible(True)
    handles: list[Artist] = [*left.plot(time, v_f, color=style.COLOURS[0])]
    handles += other.plot(time, v_a, color=style.COLOURS[1])
    handles += right.plot(v_a, v_f, "o", color=style.COLOURS[0], ms=2.0)
    ends = np.array([min(0.0, float(v_a.min())), max(0.0, float(v_a.max()))])
    handles += right.plot(ends, found.offset + found.slope * ends, color=style.COLOURS[-1])
    peaks = float(time[-1]), style.peak(v_f), style.peak(v_a)
    clock, f_scale, a_scale = map(style.scale, peaks, units)
    clock.name(left.xaxis, "Time")
    f_scale.name(left.yaxis, "$V_F$")
    f_scale.name(right.yaxis, "$V_F$")
    a_scale.name(other.yaxis, "$V_a$")
    a_scale.name(right.xaxis, "$V_a$")
    labels = ["$V_F$", "$V_a$", "measured", f"slope {found.slope:.4g} ± {found.slope_error:.2g}"]
    style.legend(figure, handles, labels)
    for text in figure.legends[0].get_texts():
        text.set_parse_math(True)
    return Picture(figure)
