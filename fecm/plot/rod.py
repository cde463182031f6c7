"""Pictures of the rod: pulse and response (figures 4.7 to 4.9), calibration (4.5, 4.6), filter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from fecm._typing import Floats
from fecm.deck.units import unit_of
from fecm.plot.kinds import Picture
from fecm.plot.style import (
    COLOURS,
    RATIO,
    STYLES,
    legend,
    lines_legend,
    literal,
    panels,
    peak,
    scale,
    scale_in,
    styled,
)
from fecm.studies.rod_test.filters import Calibration
from fecm.studies.rod_test.pulse_test import RodHistory

WIDTH = "column"
MOST_LINES = len(COLOURS) - 1


# Label, values, colour and style of a line.
Line = tuple[str, Floats, str, Any]


def _against_time(
    axes: Axes,
    time: Floats,
    lines: Sequence[Line],
    name: str,
    dimension: str,
    units: Mapping[str, str] | None,
) -> None:
    """Draw lines against time, both axes scaled."""
    clock = scale(float(time[-1]), unit_of("time", dict(units or {})))
    size = scale_in(units, dimension, *(values for _, values, _, _ in lines))
    for label, values, colour, style in lines:
        axes.plot(time, values, color=colour, linestyle=style, label=label)
    clock.name(axes.xaxis, "Time")
    size.name(axes.yaxis, name)
    axes.set_xlim(min(0.0, float(time[0])), float(time[-1]))


@styled
def pulse_picture(
    history: RodHistory, filtered: Floats | None = None, units: Mapping[str, str] | None = None
) -> Picture:
    """Forces above, accelerations below, as in figures 4.7 and 4.8.

    `filtered` are the filtered forces at the stations, (rows, stations).
    """
    figure, (above, below) = panels(WIDTH, 2, ratio=RATIO[WIDTH], sharex=True)
    forces: list[Line] = [("applied", history.applied, COLOURS[-1], STYLES[2])]
    for number, x in enumerate(history.stations):
        colour = COLOURS[number % MOST_LINES]
        place = f"at {x:.4g} {unit_of('length', dict(units or {}))}".rstrip()
        forces.append((place, history.forces[:, number], colour, "-"))
        if filtered is not None:
            forces.append((f"{place}, filtered", filtered[:, number], colour, STYLES[1]))
    _against_time(above, history.time, forces, "Force", "force", units)
    above.set_xlabel("")
    ends: list[Line] = [
        (label, history.accelerations[:, number], COLOURS[number], STYLES[number])
        for number, label in enumerate(("struck end", "middle", "far end"))
    ]
    _against_time(below, history.time, ends, "Acceleration", "length/time^2", units)
    lines_legend(figure, above)
    # The pulse is over by then: this corner is free.
    below.legend(loc="upper right")
    return Picture(figure)


@styled
def filter_picture(
    time: Floats,
    named: Mapping[str, Floats],
    units: Mapping[str, str] | None = None,
    dimension: str = "",
) -> Picture:
    """A history, the filtered history, and others beside them, (rows,) each, against time.

    The histories have their names in the legend; their dimension is empty if it is unknown.
    """
    figure, (axes,) = panels(WIDTH, ratio=RATIO[WIDTH])
    lines: list[Line] = [
        (name, values, colour, "-")
        for (name, values), colour in zip(named.items(), COLOURS, strict=False)
    ]
    name = "Force" if dimension == "force" else next(reversed(list(named)[:-1])).capitalize()
    _against_time(axes, time, lines, literal(name), dimension, units)
    lines_legend(figure, axes)
    return Picture(figure)


@styled
def calibration_picture(
    time: Floats, v_f: Floats, v_a: Floats, found: Calibration, units: Sequence[str] = ()
) -> Picture:
    """Both outputs against time (figure 4.5), and one against the other with the fit (4.6).

    `units` are those of time, V_F and V_a.
    """
    figure, (left, right) = panels("full", 1, 2, ratio=2 * RATIO["full"])
    time_unit, f_unit, a_unit = units or ("", "", "")
    other = left.twinx()
    other.spines["right"].set_visible(True)
    handles = []
    for axes, colour, values in ((left, COLOURS[0], v_f), (other, COLOURS[1], v_a)):
        handles += axes.plot(time, values, color=colour)
    handles += right.plot(v_a, v_f, "o", color=COLOURS[0], markersize=2.0)
    ends = np.array([min(0.0, float(v_a.min())), max(0.0, float(v_a.max()))])
    handles += right.plot(ends, found.offset + found.slope * ends, color=COLOURS[-1])
    scale(float(time[-1]), time_unit).name(left.xaxis, "Time")
    for ax in (left, right):
        scale(peak(v_f), f_unit).name(ax.yaxis, "$V_F$")
    scale(peak(v_a), a_unit).name(other.yaxis, "$V_a$")
    scale(peak(v_a), a_unit).name(right.xaxis, "$V_a$")
    labels = ["$V_F$", "$V_a$", "measured", f"slope {found.slope:.4g} ± {found.slope_error:.2g}"]
    legend(figure, handles, labels, mathematics=True)
    return Picture(figure)
