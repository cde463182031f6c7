"""Picture of computed against measured values of the cases of a sweep."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from fecm._errors import StudyError
from fecm.judge.end import PEAK_NOT_REACHED
from fecm.judge.validity import counted
from fecm.plot import style
from fecm.plot.kinds import LackingError, Picture, Width
from fecm.plot.maps import AROUND_POINT
from fecm.plot.sweep_data import Where, case_counts, case_rows, variable_of
from fecm.sweeps.measured import BAND, CaseComparison, compare_cases, ratios_in_words
from fecm.sweeps.result import SweepResult

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ROOM = 0.08  # above the largest value, relative to the range


def measured(
    results: Mapping[str, SweepResult],
    *,
    quantity: str = "",
    where: Where | None = None,
    width: Width = "column",
) -> Picture:
    """Draw computed over measured values, with the line of equal values and a band of ±10 %.

    `quantity` is a name of the sweep's summary that has a measured column, by default the first.
    `where` selects the cases with these values; numbers select the nearest value.
    """
    ((name, sweep),) = results.items()
    try:
        every = compare_cases(sweep, quantity)
    except StudyError as error:
        raise LackingError(f"{name}: {error}") from None
    rows = case_rows(sweep, name, where or {})
    compared = CaseComparison(every.name, every.unit, every.computed[rows], every.measured[rows])
    pairs = compared.pairs
    if not pairs.any():
        raise LackingError(f"no case of {name} has a computed and a measured {compared.name}")
    values = np.concatenate([compared.computed[pairs], compared.measured[pairs]])
    shown = variable_of(sweep, compared.name, values)
    figure, (axes,) = style.panels(width, ratio=1.0 if width == "column" else 0.6)
    _draw_band(axes, values)
    axes.plot(
        compared.measured[pairs],
        compared.computed[pairs],
        "o",
        color=style.colours()[0],
        ms=3.5,
        zorder=3,
    )
    doubts = {
        doubt.case: mask & pairs
        for doubt, mask in counted(sweep.validity[rows])
        if doubt != PEAK_NOT_REACHED and (mask & pairs).any()
    }
    if doubts:
        ringed = np.logical_or.reduce(list(doubts.values()))
        axes.plot(compared.measured[ringed], compared.computed[ringed], **AROUND_POINT)
    axes.set_aspect("equal")
    shown.scale.name(axes.xaxis, f"{shown.label}, measured")
    shown.scale.name(axes.yaxis, f"{shown.label}, computed")
    bias, rms = (shown.scale.show(value) for value in (compared.bias, compared.rms))
    numbers = f"{ratios_in_words(compared)}; bias {bias}, rms {rms}"
    lines = [f"{numbers[0].upper()}{numbers[1:]}", *case_counts(doubts, "\N{WHITE CIRCLE} ")]
    style.footer(axes, lines)
    style.lines_legend(figure, axes)
    return Picture(figure, notes=[f"{compared.name}: {compared}"])


def _draw_band(axes: Axes, values: np.ndarray) -> None:
    """Draw the line of equal values and the band around it, over the range of all values."""
    low, high = min(0.0, float(values.min())), max(0.0, float(values.max()))
    room = ROOM * (high - low)
    ends = np.array([low - room if low < 0.0 else 0.0, high + room if high > 0.0 else 0.0])
    axes.plot(ends, ends, color="0.2", lw=0.8, label="equal")
    axes.fill_between(
        ends, (1.0 - BAND) * ends, (1.0 + BAND) * ends, color="0.2", alpha=0.12, lw=0.0
    )
    # The legend names lines, and the band is an area.
    axes.plot([], [], color="0.2", alpha=0.12, lw=5.0, label=f"±{100.0 * BAND:g} %")
    axes.set(xlim=ends, ylim=ends)
