"""Pictures of the rod: pulse and response (figures 4.7 to 4.9), calibration (4.5, 4.6), filter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
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
    scale,
    styled,
)
from fecm.studies.rod_test.calibration import Calibration
from fecm.studies.rod_test.pulse_test import RodHistory

WIDTH = "column"
MOST_LINES = len(COLOURS) - 1


@dataclass(frozen=True)
class _Line:
    """One line of a graph against time."""

    label: str
    values: Floats
    colour: str
    style: Any = field(default="-")


def _against_time(
    axes: Axes, time: Floats, lines: Sequence[_Line], name: str, dimension: str, units: Any
) -> None:
    """Draw lines against time, both axes scaled."""
    clock = scale(float(time[-1]), unit_of("time", units))
    peak = max(float(np.abs(line.values).max()) for line in lines)
    size = scale(peak, unit_of(dimension, units))
    for line in lines:
        axes.plot(
            clock.factor * time, size.factor * line.values, color=line.colour,
            linestyle=line.style, label=line.label,
        )  # fmt: skip
    axes.set_xlabel(clock.label("Time"))
    axes.set_xlim(clock.factor * min(0.0, float(time[0])), clock.factor * float(time[-1]))
    axes.set_ylabel(size.label(name))


@styled
def pulse_picture(
    history: RodHistory, filtered: Floats | None = None, units: Mapping[str, str] | None = None
) -> Picture:
    """Forces above, accelerations below, as in figures 4.7 and 4.8.

    Parameters
    ----------
    history : RodHistory
    filtered : ndarray (rows, stations), optional
        Forces at the stations behind a filter.
    units : mapping, optional
        Names of the units.
    """
    figure, (above, below) = panels(WIDTH, 2, ratio=RATIO[WIDTH], sharex=True)
    forces = [_Line("applied", history.applied, COLOURS[-1], STYLES[2])]
    for number, x in enumerate(history.stations):
        colour = COLOURS[number % MOST_LINES]
        forces.append(_Line(f"at {x:.4g}", history.forces[:, number], colour))
        if filtered is not None:
            forces.append(_Line(f"at {x:.4g}, filtered", filtered[:, number], colour, STYLES[1]))
    _against_time(above, history.time, forces, "Force", "force", units or {})
    above.set_xlabel("")
    ends = [
        _Line(label, history.accelerations[:, number], COLOURS[number], STYLES[number])
        for number, label in enumerate(("struck end", "middle", "far end"))
    ]
    _against_time(below, history.time, ends, "Acceleration", "length/time^2", units or {})
    lines_legend(figure, above)
    # The legend of the lower graph stands in its free corner: the pulse is over by then.
    below.legend(loc="upper right")
    return Picture(figure)


@styled
def filter_picture(
    time: Floats,
    named: Mapping[str, Floats],
    units: Mapping[str, str] | None = None,
    dimension: str = "",
) -> Picture:
    """A history, what a filter leaves of it, and what stands beside them, against time.

    Parameters
    ----------
    time : ndarray (rows,)
    named : mapping of str to ndarray (rows,)
        Histories by the names they have in the legend.
    units : mapping, optional
        Names of the units.
    dimension : str
        Of the histories; empty where it is not known.
    """
    figure, (axes,) = panels(WIDTH, ratio=RATIO[WIDTH])
    lines = [
        _Line(name, values, colour)
        for (name, values), colour in zip(named.items(), COLOURS, strict=False)
    ]
    name = "Force" if dimension == "force" else next(reversed(list(named)[:-1])).capitalize()
    _against_time(axes, time, lines, literal(name), dimension, units or {})
    lines_legend(figure, axes)
    return Picture(figure)


@styled
def calibration_picture(time: Floats, v_f: Floats, v_a: Floats, found: Calibration) -> Picture:
    """Both outputs against time (figure 4.5), and one against the other with the line (4.6)."""
    figure, (left, right) = panels("full", 1, 2, ratio=2 * RATIO["full"])
    clock = scale(float(time[-1]), "")
    sizes = {"V_F": scale(_peak(v_f), ""), "V_a": scale(_peak(v_a), "")}
    names = {"V_F": "$V_F$", "V_a": "$V_a$"}
    shown = {"V_F": v_f, "V_a": v_a}
    other = left.twinx()
    other.spines["right"].set_visible(True)
    handles = []
    for axes, name, colour in ((left, "V_F", COLOURS[0]), (other, "V_a", COLOURS[1])):
        size = sizes[name]
        handles += axes.plot(clock.factor * time, size.factor * shown[name], color=colour)
        axes.set_ylabel(size.label(names[name]))
    left.set_xlabel(clock.label("Time"))
    x, y = sizes["V_a"].factor, sizes["V_F"].factor
    handles += right.plot(x * v_a, y * v_f, "o", color=COLOURS[0], markersize=2.0)
    ends = np.array([min(0.0, float(v_a.min())), max(0.0, float(v_a.max()))])
    fitted = found.offset + found.slope * ends
    handles += right.plot(x * ends, y * fitted, color=COLOURS[-1])
    right.set_xlabel(sizes["V_a"].label("$V_a$"))
    right.set_ylabel(sizes["V_F"].label("$V_F$"))
    labels = ["$V_F$", "$V_a$", "measured", f"slope {found.slope:.4g} ± {found.slope_error:.2g}"]
    legend(figure, handles, labels, mathematics=True)
    return Picture(figure)


def _peak(values: Floats) -> float:
    return float(np.abs(values).max())
