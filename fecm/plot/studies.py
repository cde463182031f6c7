"""Pictures of tests: indentation (the report's figures 3.2 to 3.19), the rod (4.5 to 4.9)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from fecm._typing import Floats
from fecm.deck.units import unit_of
from fecm.plot import style
from fecm.plot.kinds import Picture
from fecm.studies.indentation_test.constants import Fit
from fecm.studies.indentation_test.curves import FALLING, LOADING, RISING
from fecm.studies.rod_test.filters import Calibration
from fecm.studies.rod_test.pulse_test import RodHistory

LOOKS = {
    LOADING: (style.COLOURS[0], "first loading"),
    FALLING: (style.COLOURS[1], "unloading"),
    RISING: (style.COLOURS[2], "reloading"),
}
POINTS = 100
WIDTH = "column"
MOST_LINES = len(style.COLOURS) - 1


Line = tuple[str, Floats, str, Any]  # label, values, colour and style of a line


# Indentation --------------------------------------------------------------------------------------


@style.styled
def fit_picture(
    indentation: Floats, force: Floats, found: Fit, units: Mapping[str, str]
) -> Picture:
    """Points of a test with the fitted curves, and permanent against largest indentation."""
    length, pound = (
        style.scale_in(units, "length", indentation),
        style.scale_in(units, "force", force),
    )
    both = len(found.cycles) > 1
    width = "full" if both else "column"
    figure, axes = style.panels(width, 1, 2 if both else 1, ratio=style.RATIO["column"])
    curves, p = found.solution.curves, found.solution.scaled
    seen: set[str] = set()
    for number in range(len(curves.division.stretches)):
        stretch = curves.division.stretches[number]
        colour, label = LOOKS[stretch.kind]
        a = indentation[stretch.rows]
        axes[0].plot(
            a, force[stretch.rows], ".", color=colour, alpha=0.5,
            markersize=3.0, markeredgewidth=0.0,
            label="_" if stretch.kind in seen else label,
        )  # fmt: skip
        seen.add(stretch.kind)
        if number in curves.numbers(stretch.kind) and len(a):
            top = float(a.max())
            if stretch.kind == FALLING:  # begin at the turning point
                top = max(top, found.solution.values[curves.layout.corners[stretch.begin]])
            x = np.linspace(max(0.0, a.min()), top, POINTS)
            y = curves.force * curves.stretch(p, number, x / curves.length)
            axes[0].plot(x, y, color=colour)
    length.name(axes[0].xaxis, "Indentation")
    pound.name(axes[0].yaxis, "Force")
    style.lines_legend(figure, axes[0])
    for handle in figure.legends[0].get_lines():
        handle.set(markersize=5.0, alpha=1.0)
    if both:
        _permanent(axes[1], found, length)
    return Picture(figure)


def _permanent(axes: Axes, found: Fit, length: style.Scale) -> None:
    """Permanent against largest indentation (figure 3.6)."""
    x = np.array([cycle.alpha_m.value for cycle in found.cycles])
    y = np.array([cycle.alpha_0.value for cycle in found.cycles])
    down = np.array([cycle.alpha_0.error for cycle in found.cycles])
    across = np.array([cycle.alpha_m.error for cycle in found.cycles])
    axes.errorbar(
        x, y, down, across, "o", color=style.COLOURS[0], markersize=3.0, linewidth=0.8, capsize=2.0
    )
    peaks = np.linspace(0.0, 1.05 * x.max(), 4 * POINTS)
    if (relation := found.relation()) is not None:
        left = np.asarray(relation.permanent(peaks))
        axes.plot(peaks, left, color=style.COLOURS[1])
    axes.set_xlim(left=0.0)
    length.name(axes.xaxis, "Largest indentation")
    length.name(axes.yaxis, "Permanent indentation")


@style.styled
def path_picture(indentation: Floats, force: Floats, units: Mapping[str, str]) -> Picture:
    """Force along an indentation path."""
    length, pound = (
        style.scale_in(units, "length", indentation),
        style.scale_in(units, "force", force),
    )
    figure, (axes,) = style.panels("column")
    axes.plot(indentation, force, color=style.COLOURS[0])
    length.name(axes.xaxis, "Indentation")
    pound.name(axes.yaxis, "Force")
    return Picture(figure)


@style.styled
def rigidity_picture(
    peaks: Floats, relations: Mapping[str, Floats], power: float, units: Mapping[str, str]
) -> Picture:
    """Unloading rigidity against largest indentation (figure 3.19).

    Drawn are the rigidities, force/length^power, of each relation at the `peaks`, (n,).
    """
    length = style.scale_in(units, "length", peaks)
    # The rigidity is unbounded towards zero: the deeper half sets the height of the axis.
    top = 3.0 * max(float(s[len(s) // 2 :].max()) for s in relations.values())
    stiff = style.scale(top, unit_of(f"force/length^{power:g}", dict(units)))
    figure, (axes,) = style.panels("column")
    for (name, values), colour, look in zip(
        relations.items(), style.COLOURS, style.STYLES, strict=False
    ):
        axes.plot(peaks, values, color=colour, linestyle=look, label=name)
    axes.set_ylim(0.0, top)
    axes.set_xlim(left=0.0)
    length.name(axes.xaxis, "Largest indentation")
    stiff.name(axes.yaxis, "Unloading rigidity")
    style.lines_legend(figure, axes)
    return Picture(figure)


# The rod ------------------------------------------------------------------------------------------


def _against_time(
    axes: Axes,
    time: Floats,
    lines: Sequence[Line],
    name: str,
    dimension: str,
    units: Mapping[str, str] | None,
) -> None:
    """Draw lines against time, both axes scaled."""
    clock = style.scale(float(time[-1]), unit_of("time", dict(units or {})))
    size = style.scale_in(units, dimension, *(values for _, values, _, _ in lines))
    for label, values, colour, look in lines:
        axes.plot(time, values, color=colour, linestyle=look, label=label)
    clock.name(axes.xaxis, "Time")
    size.name(axes.yaxis, name)
    axes.set_xlim(min(0.0, float(time[0])), float(time[-1]))


@style.styled
def pulse_picture(
    history: RodHistory, filtered: Floats | None = None, units: Mapping[str, str] | None = None
) -> Picture:
    """Forces above, accelerations below, as in figures 4.7 and 4.8.

    `filtered` are the filtered forces at the stations, (rows, stations).
    """
    figure, (above, below) = style.panels(WIDTH, 2, sharex=True)
    forces: list[Line] = [("applied", history.applied, style.COLOURS[-1], style.STYLES[2])]
    for number, x in enumerate(history.stations):
        colour = style.COLOURS[number % MOST_LINES]
        place = f"at {x:.4g} {unit_of('length', dict(units or {}))}".rstrip()
        forces.append((place, history.forces[:, number], colour, "-"))
        if filtered is not None:
            forces.append((f"{place}, filtered", filtered[:, number], colour, style.STYLES[1]))
    _against_time(above, history.time, forces, "Force", "force", units)
    above.set_xlabel("")
    ends: list[Line] = [
        (label, history.accelerations[:, number], style.COLOURS[number], style.STYLES[number])
        for number, label in enumerate(("struck end", "middle", "far end"))
    ]
    _against_time(below, history.time, ends, "Acceleration", "length/time^2", units)
    style.lines_legend(figure, above)
    below.legend(loc="upper right")  # the pulse is over by then: this corner is free
    return Picture(figure)


@style.styled
def filter_picture(
    time: Floats,
    named: Mapping[str, Floats],
    units: Mapping[str, str] | None = None,
    dimension: str = "",
) -> Picture:
    """A history, the filtered history, and others beside them, (rows,) each, against time.

    The histories have their names in the legend; their dimension is empty if it is unknown.
    """
    figure, (axes,) = style.panels(WIDTH)
    lines: list[Line] = [
        (name, values, colour, "-")
        for (name, values), colour in zip(named.items(), style.COLOURS, strict=False)
    ]
    name = "Force" if dimension == "force" else next(reversed(list(named)[:-1])).capitalize()
    _against_time(axes, time, lines, style.literal(name), dimension, units)
    style.lines_legend(figure, axes)
    return Picture(figure)


@style.styled
def calibration_picture(
    time: Floats, v_f: Floats, v_a: Floats, found: Calibration, units: Sequence[str] = ()
) -> Picture:
    """Both outputs against time (figure 4.5), and one against the other with the fit (4.6).

    `units` are those of time, V_F and V_a.
    """
    figure, (left, right) = style.panels("full", 1, 2, ratio=2 * style.RATIO["full"])
    time_unit, f_unit, a_unit = units or ("", "", "")
    other = left.twinx()
    other.spines["right"].set_visible(True)
    handles = []
    for axes, colour, values in ((left, style.COLOURS[0], v_f), (other, style.COLOURS[1], v_a)):
        handles += axes.plot(time, values, color=colour)
    handles += right.plot(v_a, v_f, "o", color=style.COLOURS[0], markersize=2.0)
    ends = np.array([min(0.0, float(v_a.min())), max(0.0, float(v_a.max()))])
    handles += right.plot(ends, found.offset + found.slope * ends, color=style.COLOURS[-1])
    style.scale(float(time[-1]), time_unit).name(left.xaxis, "Time")
    for ax in (left, right):
        style.scale(style.peak(v_f), f_unit).name(ax.yaxis, "$V_F$")
    style.scale(style.peak(v_a), a_unit).name(other.yaxis, "$V_a$")
    style.scale(style.peak(v_a), a_unit).name(right.xaxis, "$V_a$")
    labels = ["$V_F$", "$V_a$", "measured", f"slope {found.slope:.4g} ± {found.slope_error:.2g}"]
    style.legend(figure, handles, labels, mathematics=True)
    return Picture(figure)
