"""Contents of a map of a sweep: what varies, what is shown, and what is marked."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fecm._dataclasses import frozen
from fecm._errors import warn
from fecm._typing import Array, Bools, Floats, Indices
from fecm.plot import style
from fecm.plot.kinds import PlotError
from fecm.plot.sweep_data import (
    Variable,
    Where,
    beyond,
    case_rows,
    ended,
    listed,
    parameter_values,
    quantity_of,
    variable_of,
)
from fecm.sweeps.result import SweepResult

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_CURVES = len(style.COLOURS)
THRESHOLD = "delamination threshold"
LEVEL_COLOUR = style.COLOURS[1]  # among colours
# Looks of a level among curves, and of the points from a level on.
LEVEL: style.Look = {"color": "0.2", "linestyle": style.DASHED, "linewidth": 1.1}
RING: style.Look = {"ms": 4.2, "mfc": "none", "mec": LEVEL_COLOUR}


@frozen
class Level:
    """A value of the quantity to mark."""

    value: float
    is_threshold: bool = False  # of delamination

    @property
    def name(self) -> str:
        """What the value is."""
        return THRESHOLD if self.is_threshold else "level"


@frozen
class Contents:
    """Contents of a map."""

    over: list[Variable]  # one or two parameters
    shown: Variable  # quantity; NaN where a case has none
    levels: list[Level]
    title: str  # values that select the cases; empty for all cases
    other: Variable | None  # second varying parameter of a map over one
    beyond: dict[str, Bools]  # by what they are: masks of the cases beyond the range of the model
    ended: dict[str, Bools]  # the same of the cases whose contact is not over
    # (cases,): delamination thresholds, if they differ and peak forces are shown; else empty.
    thresholds: Floats


@frozen
class Graph:
    """Axes, and what lies along them."""

    axes: Axes
    x: Variable
    y: Variable

    def label(self) -> None:
        """Label the axes, but for texts in rows."""
        self.x.mark(self.axes.xaxis)
        if not self.y.ticks:
            self.y.mark(self.axes.yaxis)


class Grid(NamedTuple):
    """A quantity on a full grid of two parameters."""

    x: Array  # (nx,), ascending
    y: Array  # (ny,), ascending
    values: np.ma.MaskedArray[tuple[int, ...], np.dtype[np.float64]]  # (ny, nx); masked: no value


def grid_of(x: Variable, y: Variable, values: Floats) -> Grid | None:
    """Values of all cases as a full grid; None if the cases do not form one."""
    columns, column = np.unique(x.values, return_inverse=True)
    rows, row = np.unique(y.values, return_inverse=True)
    places = row * len(columns) + column
    if not np.array_equal(np.sort(places), np.arange(len(columns) * len(rows))):
        return None
    ordered = values[np.argsort(places)].reshape(len(rows), len(columns))
    return Grid(columns, rows, np.ma.masked_invalid(ordered))


def choose(
    sweep: SweepResult,
    name: str,
    *,
    quantity: str,
    over: Sequence[str],
    where: Where,
    level: Sequence[float],
) -> Contents:
    """Select the contents of a map; warn of cases without a value.

    Raises PlotError if the options do not fit the sweep, or no case remains.
    """
    rows = case_rows(sweep, name, where)
    axes, other = _parameters(sweep, name, rows, over)
    shown = quantity_of(sweep, name, rows, quantity)
    levels = {value: Level(value) for value in level}
    thresholds: Floats = np.empty(0)
    if shown.name == "peak_force" and "threshold_force" in sweep.summary:
        thresholds = sweep["threshold_force"][rows]
        highest = float(np.nanmax(thresholds))
        if highest - np.nanmin(thresholds) <= 1e-9 * highest:
            levels[highest] = Level(highest, is_threshold=True)
            thresholds = np.empty(0)
    low, high = shown.range
    for value in level:
        if not low <= value <= high:
            warn(
                f"the level {value:g} is outside the picture's values, which range from {low:g} "
                f"to {high:g}"
            )
    return Contents(
        over=axes,
        shown=shown,
        levels=list(levels.values()),
        title=", ".join(f"{held} {_text(sweep, held, rows[0])}" for held in where),
        other=other,
        beyond=beyond(sweep, rows),
        ended=ended(sweep, rows),
        thresholds=thresholds,
    )


def _parameters(
    sweep: SweepResult, name: str, rows: Indices, over: Sequence[str]
) -> tuple[list[Variable], Variable | None]:
    """Parameters of the axes, and the other one of a map over one; refuse hidden cases."""
    varying = [n for n, values in sweep.cases.items() if len(np.unique(values[rows])) > 1]
    axes = [
        variable_of(sweep, parameter, sweep[parameter][rows])
        for parameter in _names_of_axes(sweep, name, varying, over)
    ]
    others = [parameter for parameter in varying if parameter not in [axis.name for axis in axes]]
    if not others:
        return axes, None

    vary = f"{listed(others)} {'varies' if len(others) == 1 else 'vary'} too"
    selects = f"--where {others[0]}=VALUE selects some of"
    if len(axes) > 1:
        points = np.column_stack([axis.values for axis in axes])
        if len(np.unique(points, axis=0)) < len(points):
            raise PlotError(f"{vary}, so that cases would hide one another; {selects} them")
        return axes, None
    other = variable_of(sweep, others[0], sweep[others[0]][rows])
    if len(others) > 1 or len(other.ticks) > MOST_CURVES:
        both = f"--over {axes[0].name},{others[0]} draws over both"
        raise PlotError(f"{vary}; {selects} the cases, {both}")
    return axes, other


def _names_of_axes(
    sweep: SweepResult, name: str, varying: list[str], asked: Sequence[str]
) -> list[str]:
    """One or two parameters of the axes."""
    for parameter in asked:
        if parameter not in varying and len(parameter_values(sweep, name, parameter)):
            raise PlotError(f"{parameter} does not vary among the cases; a map needs one that does")
    over = list(dict.fromkeys(asked)) or varying
    if not over:
        raise PlotError(f"nothing varies in {name}: all cases are equal")
    if len(over) > 2:
        raise PlotError(
            f"a map has at most two axes, and {listed(over)} vary; choose with --over NAME or "
            "NAME,NAME"
        )
    return over


def _text(sweep: SweepResult, name: str, row: int) -> str:
    """A value for a title."""
    value = sweep[name][row]
    if isinstance(value, str):
        return str(value)
    return style.scale(abs(float(value)), sweep.unit(name)).show(float(value))
