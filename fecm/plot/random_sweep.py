"""Pictures of a random sweep: probabilities of exceedance, sensitivity indices, scatter plots."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fecm._typing import Floats, Indices
from fecm.plot.kinds import LackingError, Picture, PlotError, Width
from fecm.plot.maps import LEVEL
from fecm.plot.style import (
    WIDTHS,
    AxisScale,
    Look,
    colours,
    footer,
    legend,
    limit_count,
    lines_legend,
    panels,
)
from fecm.plot.sweep_data import Where, beyond, case_counts, case_rows, quantity_of, variable_of
from fecm.results.metrics import THRESHOLD_FORCE
from fecm.sweeps.limits import PEAK_FORCE
from fecm.sweeps.result import SweepResult
from fecm.sweeps.statistics import Indices as SobolIndices
from fecm.sweeps.statistics import RandomResult, exceedance_bounds, with_threshold
from fecm.sweeps.summary import chance, from_threshold_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Sweeps = Mapping[str, SweepResult]
BESIDE: dict[Width, int] = {"column": 2, "full": 4}  # scatter plots in a row
# Heights of a pair of bars, and of the room around the pairs (in).
PAIR = 0.3
AROUND = 0.75
MOST_NOTES = 2  # probabilities that are written below the curves
POINT: Look = {"alpha": 0.5, "mew": 0.0, "rasterized": True}
BETWEEN: Look = {"color": "0.2", "alpha": 0.15, "lw": 0.0}  # thresholds that differ
POINT_SIZES = (2.2, 5.0)  # size of many points and of few points (pt)


class Draws(NamedTuple):
    """Draws of a random sweep."""

    name: str  # of the sweep
    sweep: SweepResult
    random: RandomResult
    rows: dict[int, Indices]  # cases by the number of the combination of varied values

    def only(self) -> tuple[int, Indices]:
        """Return the only combination and its cases.

        Raises PlotError if there are several combinations.
        """
        if len(self.rows) > 1:
            raise PlotError(
                f"{self.name} has {len(self.rows)} combinations of varied values; select one of "
                f"them with --where {next(iter(self.random.combinations))}=VALUE"
            )
        return next(iter(self.rows.items()))

    def limits(self, quantity: str, level: Sequence[float]) -> list[float]:
        """Return the limits of a quantity to mark: `level`, or the limits of the sweep."""
        exceedance = self.random.exceedance
        limits_of_sweep = exceedance.limit[
            (exceedance.quantity == quantity) & np.isfinite(exceedance.limit)
        ]
        return list(level) or limits_of_sweep.tolist()

    def thresholds(self, quantity: str) -> Floats:
        """Return the delamination thresholds to mark, ascending: one if all draws have the same.

        There are none for other quantities than the peak force.
        """
        if quantity != PEAK_FORCE or THRESHOLD_FORCE not in self.sweep.summary:
            return np.empty(0)
        values = self.sweep[THRESHOLD_FORCE][np.concatenate(list(self.rows.values()))]
        return np.unique(values[np.isfinite(values)])

    def words_of(self, quantity: str, limit: float) -> str:
        """Return the words before a limit: whether it is the delamination threshold."""
        if [limit] == self.thresholds(quantity).tolist():
            return f"delamination {from_threshold_of(self.sweep)}"
        return "limit"

    def count_doubts(self, axes: Axes, lines: Sequence[str] = ()) -> None:
        """Count the draws beyond the range of the model below a graph, under other lines."""
        doubts = beyond(self.sweep, np.concatenate(list(self.rows.values())))
        footer(axes, [*lines, *case_counts(doubts)])


def _select_draws(results: Sweeps, where: Where | None) -> Draws:
    """Return the draws of the combinations of varied values that `where` selects."""
    where = where or {}
    ((name, sweep),) = results.items()
    if sweep.random is None:
        raise PlotError(f"{name} has no random values; `fecm sweep --random` makes such a sweep")
    design = sweep.random.design
    if wrong := [parameter for parameter in where if parameter in design.laws]:
        raise PlotError(f"{wrong[0]} is random; where selects values that are varied")
    firsts = np.arange(0, len(sweep), design.rows)
    chosen = np.flatnonzero(np.isin(firsts, case_rows(sweep, name, where))).tolist()
    if not chosen:
        raise PlotError(f"{name} has no draws")
    rows = {n: firsts[n] + np.arange(design.draws) for n in chosen}
    return Draws(name, sweep, sweep.random, rows)


def exceedance(
    results: Sweeps,
    *,
    quantity: str = "",
    where: Where | None = None,
    level: Sequence[float] = (),
    width: Width = "column",
) -> Picture:
    """Draw the probability that a quantity is larger than a value, with 95 % intervals at limits.

    Each combination of varied values has a curve; `where` selects some of them. `quantity` is a
    name of the sweep's summary, by default the peak force, or the velocity that was searched.
    `level` has limits (the deck's unit), by default the limits of the sweep.
    """
    drawn = _select_draws(results, where)
    limit_count(len(drawn.rows), "curves")
    every = [quantity_of(drawn.sweep, drawn.name, rows, quantity) for rows in drawn.rows.values()]
    limits = drawn.limits(every[0].name, level)
    thresholds = drawn.thresholds(every[0].name)
    if len(thresholds) == 1:
        limits = list(dict.fromkeys([*thresholds.tolist(), *limits]))
    figure, (axes,) = panels(width)
    notes: list[str] = []
    for (place, rows), shown, colour in zip(drawn.rows.items(), every, colours(), strict=False):
        values = np.sort(shown.values[np.isfinite(shown.values)])
        count = len(values)
        ended = drawn.sweep.completed[rows] & ~drawn.sweep.contact_over[rows]
        open_ends = int((np.isnan(shown.values) & ended).sum())
        label = drawn.random.label(place)
        above = (count - np.arange(count) - 0.5) / count
        axes.plot(values, above, color=colour, label=label or "_")
        for limit in limits:
            hits = np.array((values > limit).sum())
            p, low, high = map(float, exceedance_bounds(hits, np.array(count), np.array(open_ends)))
            centre = p if np.isfinite(p) else (low + high) / 2.0
            interval = [[centre - low], [high - centre]]
            marker = "o" if np.isfinite(p) else "none"  # with open draws only the interval is known
            style: dict[str, Any] = {"fmt": marker, "capsize": 2.0, "ms": 3.0, "lw": 0.9}
            axes.errorbar(limit, centre, interval, color=colour, **style)
            case = f", {label}" if label else ""
            text = chance(p, low, high, open_ends, open_ends)
            notes.append(f"P({shown.name} > {limit:g}) = {text}{case}")
    last = every[-1]
    if len(thresholds) > 1:
        notes += _draw_thresholds(axes, drawn, thresholds, last.scale)
    for limit in limits:
        words = drawn.words_of(last.name, limit)
        axes.axvline(limit, zorder=0, label=f"{words} {last.scale.show(limit)}", **LEVEL)
    axes.set_yscale("log")
    axes.set_ylim(top=1.15)
    axes.set_ylabel("Probability of exceedance")
    last.scale.name(axes.xaxis, last.label)
    drawn.count_doubts(axes, notes if len(notes) <= MOST_NOTES else ())
    if len(drawn.rows) > 1 or limits or len(thresholds):
        lines_legend(figure, axes)
    return Picture(figure, notes=notes)


def _draw_thresholds(
    axes: Axes, drawn: Draws, thresholds: Floats, scale: AxisScale
) -> Iterator[str]:
    """Draw the range of delamination thresholds; yield the probabilities of reaching them."""
    low, high = float(thresholds[0]), float(thresholds[-1])
    axes.axvspan(low, high, zorder=0, **BETWEEN)
    ends = f"{scale.show(low)} to {scale.show(high)}"
    label = f"delamination {from_threshold_of(drawn.sweep)} {ends}"
    axes.plot([], [], lw=5.0, color=BETWEEN["color"], alpha=BETWEEN["alpha"], label=label)
    exceedance = with_threshold(drawn.random, drawn.sweep.summary)
    row = int(np.flatnonzero((exceedance.quantity == PEAK_FORCE) & np.isnan(exceedance.limit))[0])
    for place in drawn.rows:
        case = f", {drawn.random.label(place)}" if drawn.random.combinations else ""
        where = (place, row) if drawn.random.combinations else (row,)
        p, lower, upper, count, is_open = (float(values[where]) for values in exceedance[2:])
        lacking = drawn.random.design.draws - int(count)
        text = chance(p, lower, upper, int(is_open), lacking)
        yield f"P({PEAK_FORCE} > threshold) = {text}{case}"


def sensitivity(
    results: Sweeps,
    *,
    quantity: str = "",
    where: Where | None = None,
    width: Width = "column",
) -> Picture:
    """Draw the Sobol' indices of a quantity as bars, with their 95 % intervals.

    `where` selects one of several combinations of varied values. `quantity` is as in `exceedance`.
    """
    drawn = _select_draws(results, where)
    name, sweep, random = drawn.name, drawn.sweep, drawn.random
    if not random.sensitivity:
        raise LackingError(f"{name} has no indices; run the sweep with --sensitivity")
    place, rows = drawn.only()
    shown = quantity_of(sweep, name, rows, quantity)
    indices = random.sensitivity[shown.name]
    if random.combinations:
        indices = SobolIndices(*(values[place] for values in indices))
    if np.isnan(indices.total).all():
        raise PlotError(f"{shown.name} has no indices: it is constant, or a case has no value")
    names = [variable_of(sweep, law, sweep[law][:1]).label for law in random.design.laws]
    figure, (axes,) = panels(width, ratio=(AROUND + PAIR * len(names)) / WIDTHS[width])
    heights = np.arange(len(names))
    whiskers: Look = {"elinewidth": 0.8, "capsize": 2.0, "ecolor": "0.2"}
    for part, interval, offset, colour, label in (
        (indices.first, indices.first_interval, -0.19, colours()[0], "first order"),
        (indices.total, indices.total_interval, 0.19, colours()[1], "total"),
    ):
        ends = np.abs(interval.T - part)
        axes.barh(
            heights + offset, part, 0.36, xerr=ends, color=colour, label=label, error_kw=whiskers
        )
    axes.set_yticks(heights, names)
    axes.invert_yaxis()
    axes.set_xlim(left=min(0.0, axes.get_xlim()[0]))
    axes.axvline(0.0, color="0.2", linewidth=0.6)
    axes.set_xlabel(f"Sobol' index: {shown.label}")
    drawn.count_doubts(axes)
    legend(figure, *axes.get_legend_handles_labels())
    return Picture(figure)


def scatter(
    results: Sweeps,
    *,
    quantity: str = "",
    where: Where | None = None,
    level: Sequence[float] = (),
    width: Width = "column",
) -> Picture:
    """Draw a quantity over every random value.

    `where` selects one of several combinations of varied values. `quantity` and `level` are as in
    `exceedance`.
    """
    drawn = _select_draws(results, where)
    _, rows = drawn.only()
    shown = quantity_of(drawn.sweep, drawn.name, rows, quantity)
    limits = drawn.limits(shown.name, level)
    laws = drawn.random.design.laws
    columns = min(len(laws), BESIDE[width])
    lines = -(-len(laws) // columns)
    figure, every = panels(width, lines, columns, ratio=0.85, sharey=True)
    for axes in every[len(laws) :]:
        axes.set_visible(False)
    size = np.clip(60.0 / np.sqrt(len(rows)), *POINT_SIZES)  # as much ink for any number
    for place, (axes, law) in enumerate(zip(every, laws, strict=False)):
        over = variable_of(drawn.sweep, law, drawn.sweep[law][rows])
        axes.plot(over.values, shown.values, ".", ms=size, color=colours()[0], **POINT)
        for limit in limits:
            words = drawn.words_of(shown.name, limit)
            axes.axhline(limit, label=f"{words} {shown.scale.show(limit)}", **LEVEL)
        over.scale.name(axes.xaxis, over.label)
        if not place % columns:
            shown.scale.name(axes.yaxis, shown.label)
        for axis in (axes.xaxis, axes.yaxis):  # a half column is narrow
            axis.set_label_text(axis.get_label_text().replace(" (", "\n("))
    drawn.count_doubts(every[len(laws) - 1])
    if limits:
        lines_legend(figure, every[0])
    return Picture(figure)
