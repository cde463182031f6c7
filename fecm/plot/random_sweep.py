"""Pictures of a random sweep: probabilities of exceedance, sensitivity indices, scatter plots."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from fecm.plot.kinds import LackingError, Picture, PlotError
from fecm.plot.maps import LEVEL, Ints, axis_of, beyond, case_rows, counts, quantity_of
from fecm.plot.style import WIDTHS, colours, legend, limit_count, lines_legend, panels
from fecm.sweeps.random_result import Indices, RandomResult, bounds, chance
from fecm.sweeps.result import SweepResult

Sweeps = Mapping[str, SweepResult]
BESIDE = {"column": 2, "full": 4}  # scatter plots side by side
PAIR, AROUND = 0.3, 0.75  # height of a pair of bars, and of what is around them (in)


def _random(
    results: Sweeps, where: Mapping[str, Any] | None
) -> tuple[str, SweepResult, RandomResult, dict[int, Ints]]:
    """The sweep, its random result, and the cases drawn of the combinations of varied values."""
    where = where or {}
    ((name, sweep),) = results.items()
    if sweep.random is None:
        raise PlotError(f"{name} has no random values; `fecm sweep --random` makes such a sweep")
    design = sweep.random.design
    if wrong := [one for one in where if one in design.laws]:
        raise PlotError(f"{wrong[0]} is random; where selects values that are varied")
    firsts = np.arange(0, len(sweep), design.rows)
    chosen = np.flatnonzero(np.isin(firsts, case_rows(sweep, name, where))).tolist()
    if not chosen:
        raise PlotError(f"{name} has no draws")
    return name, sweep, sweep.random, {n: firsts[n] + np.arange(design.draws) for n in chosen}


def _one(random: RandomResult, name: str, chosen: dict[int, Ints]) -> tuple[int, Ints]:
    """The only combination, and its draws."""
    if len(chosen) > 1:
        raise PlotError(
            f"{name} has {len(chosen)} combinations of varied values; select one of them with "
            f"--where {next(iter(random.combinations))}=VALUE"
        )
    return next(iter(chosen.items()))


def _limits(random: RandomResult, quantity: str, level: Sequence[float]) -> list[float]:
    """Limits to mark: those given, or else those of the sweep."""
    found = random.exceedance
    own = found.limit[(found.quantity == quantity) & np.isfinite(found.limit)]
    return list(level) or own.tolist()


def _say_doubts(axes: Axes, sweep: SweepResult, chosen: dict[int, Ints]) -> None:
    """Count the draws beyond the range of the model below a graph."""
    text = counts(beyond(sweep, np.concatenate(list(chosen.values()))))
    axes.set_xlabel(f"{axes.get_xlabel()}{text}")


def exceedance(
    results: Sweeps,
    *,
    quantity: str = "",
    where: Mapping[str, float | str] | None = None,
    level: Sequence[float] = (),
    width: str = "column",
) -> Picture:
    """Draw the probability that a quantity is larger than a value, with 95 % intervals at limits.

    Each combination of varied values has a curve; `where` selects some.  `quantity` is a name of
    the sweep's summary, by default the peak force, or the velocity found; `level` are limits (the
    deck's unit), by default those of the sweep.
    """
    name, sweep, random, chosen = _random(results, where)
    limit_count(len(chosen), "curves")
    figure, (axes,) = panels(width)
    notes: list[str] = []
    every = [quantity_of(sweep, name, rows, quantity) for rows in chosen.values()]
    limits = _limits(random, every[0].name, level)
    for (place, rows), shown, colour in zip(chosen.items(), every, colours(), strict=False):
        values = np.sort(shown.values[np.isfinite(shown.values)])
        count = len(values)
        ended = sweep.fine[rows] & ~sweep.over[rows]
        is_open = int((np.isnan(shown.values) & ended).sum())
        label = random.label(place)
        above = (count - np.arange(count) - 0.5) / count
        axes.plot(values, above, color=colour, label=label or "_")
        for limit in limits:
            hits = np.array((values > limit).sum())
            p, low, high = map(float, bounds(hits, np.array(count), np.array(is_open)))
            bar: Any = {"color": colour, "capsize": 2.0, "ms": 3.0, "lw": 0.9}
            axes.errorbar(limit, p, [[p - low], [high - p]], fmt="o", **bar)
            case = f", {label}" if label else ""
            text = chance(p, low, high, is_open, is_open)
            notes.append(f"P({shown.name} > {limit:g}) = {text}{case}")
    for limit in limits:
        axes.axvline(limit, zorder=0, label=f"limit {every[-1].scale.show(limit)}", **LEVEL)
    axes.set_yscale("log")
    axes.set_ylim(top=1.15)
    axes.set_ylabel("Probability of exceedance")
    every[-1].scale.name(axes.xaxis, every[-1].label)
    _say_doubts(axes, sweep, chosen)
    if len(chosen) > 1 or limits:
        lines_legend(figure, axes)
    return Picture(figure, notes=notes)


def sensitivity(
    results: Sweeps,
    *,
    quantity: str = "",
    where: Mapping[str, float | str] | None = None,
    width: str = "column",
) -> Picture:
    """Draw the Sobol' indices of a quantity as bars, with their 95 % intervals.

    `where` selects one of several combinations of varied values; `quantity` as of `exceedance`.
    """
    name, sweep, random, chosen = _random(results, where)
    if not random.sensitivity:
        raise LackingError(f"{name} has no indices; run the sweep with --sensitivity")
    place, draws = _one(random, name, chosen)
    shown = quantity_of(sweep, name, draws, quantity)
    found = random.sensitivity[shown.name]
    if random.combinations:
        found = Indices(*(values[place] for values in found))
    if np.isnan(found.total).all():
        raise PlotError(f"{shown.name} has no indices: it is constant, or a case has no value")
    names = [axis_of(sweep, law, sweep[law][:1]).label for law in random.design.laws]
    figure, (axes,) = panels(width, ratio=(AROUND + PAIR * len(names)) / WIDTHS[width])
    rows = np.arange(len(names))
    look: Any = {"error_kw": {"elinewidth": 0.8, "capsize": 2.0, "ecolor": "0.2"}}
    for part, interval, offset, colour, label in (
        (found.first, found.first_interval, -0.19, colours()[0], "first order"),
        (found.total, found.total_interval, 0.19, colours()[1], "total"),
    ):
        ends = np.abs(interval.T - part)
        axes.barh(rows + offset, part, 0.36, xerr=ends, color=colour, label=label, **look)
    axes.set_yticks(rows, names)
    axes.invert_yaxis()
    axes.set_xlim(left=min(0.0, axes.get_xlim()[0]))
    axes.axvline(0.0, color="0.2", linewidth=0.6)
    axes.set_xlabel(f"Sobol' index: {shown.label}")
    _say_doubts(axes, sweep, chosen)
    legend(figure, *axes.get_legend_handles_labels())
    return Picture(figure)


def scatter(
    results: Sweeps,
    *,
    quantity: str = "",
    where: Mapping[str, float | str] | None = None,
    level: Sequence[float] = (),
    width: str = "column",
) -> Picture:
    """Draw a quantity over every random value.

    `where` selects one of several combinations of varied values; `quantity` and `level` as of
    `exceedance`.
    """
    name, sweep, random, chosen = _random(results, where)
    _, rows = _one(random, name, chosen)
    shown = quantity_of(sweep, name, rows, quantity)
    laws, limits = random.design.laws, _limits(random, shown.name, level)
    columns = min(len(laws), BESIDE[width])
    lines = -(-len(laws) // columns)
    figure, every = panels(width, lines, columns, ratio=0.85, sharey=True)
    look: Any = {"color": colours()[0], "ms": 1.5, "alpha": 0.5, "mew": 0.0, "rasterized": True}
    for axes in every[len(laws) :]:
        axes.set_visible(False)
    for place, (axes, law) in enumerate(zip(every, laws, strict=False)):
        over = axis_of(sweep, law, sweep[law][rows])
        axes.plot(over.values, shown.values, ".", **look)
        for limit in limits:
            axes.axhline(limit, label=f"limit {shown.scale.show(limit)}", **LEVEL)
        over.scale.name(axes.xaxis, over.label)
        if not place % columns:
            shown.scale.name(axes.yaxis, shown.label)
        for axis in (axes.xaxis, axes.yaxis):  # a half column is narrow
            axis.set_label_text(axis.get_label_text().replace(" (", "\n("))
    _say_doubts(every[len(laws) - 1], sweep, chosen)
    if limits:
        lines_legend(figure, every[0])
    return Picture(figure)
