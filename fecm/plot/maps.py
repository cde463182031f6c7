"""Maps of a sweep: a quantity of every case over one or two varying parameters."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis as PlotAxis
from matplotlib.colors import BoundaryNorm, Normalize
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from fecm._errors import did_you_mean, warn
from fecm._frozen import frozen
from fecm._typing import Bools, Floats
from fecm.plot import style
from fecm.plot.kinds import Picture, PlotError
from fecm.results.metrics import COLUMNS, VERDICTS
from fecm.results.metrics import INTEGERS as WHOLE_NUMBERS
from fecm.results.validity import MEANING, Reason, counted
from fecm.sweeps.cases import INTEGERS as WHOLE_VALUES
from fecm.sweeps.cases import NAMES
from fecm.sweeps.result import SweepResult, reasons

Array = NDArray[Any]
Ints = NDArray[np.intp]

INTEGERS = (*WHOLE_VALUES, *WHOLE_NUMBERS)
CURVES = len(style.COLOURS)  # most texts with one curve each
LABELS = {
    "velocity": "Impact velocity", "k": "Contact coefficient $k$", "alpha_p": r"$\alpha_p$",
    "s_p": "$s_p$", "q": "$q$", "rod_length": "Length of the rod",
    "rod_modulus": "Modulus of the rod", "rod_density": "Density of the rod",
    "mass": "Mass of the projectile", "rod_mass": "Mass of the projectile",
    "energy": "Impact energy", "radius": "Radius of the sphere", "at": "Impact point",
    "angle": "Angle added (°)", "nu12": r"$\nu_{12}$", "e1": "$E_1$", "e2": "$E_2$",
    "g12": "$G_{12}$", "g13": "$G_{13}$", "g23": "$G_{23}$", "dt": "Time step",
    "patch": "Radius of the patch", "x0": "$x_0$", "y0": "$y_0$",
    "max_indentation": "Largest indentation",
}  # fmt: skip
MANY = 10_000  # more cells or points are stored as an image in vector formats
STILL, ENDED = "still in contact at the end", "contact not over at the end"
LINES = 8  # contour lines, approximately
# Heights of a row of texts, of everything around the rows, and of a colour bar (in).
ROW, HEAD, BAR = 0.17, 0.75, 0.45
THRESHOLD = "delamination threshold"
DASHES, DOTS = (0, (5, 1.5)), (0, (1, 1))
# Style of a level among curves, and its colour and contour lines on a map.
LEVEL: Any = {"color": "0.2", "linestyle": DASHES, "linewidth": 1.1}
LEVEL_COLOUR = style.COLOURS[1]
CONTOUR: Any = {"colors": LEVEL_COLOUR, "linestyles": [DASHES], "linewidths": 1.2}
RING: Any = {"ms": 4.2, "mfc": "none", "mec": LEVEL_COLOUR}  # around points from a level on
SHADES = 256  # of a colour map
MARKERS = "osD^vP*"
# A quantity on a full grid of two parameters: x (nx,) and y (ny,), ascending, and the values,
# (ny, nx), masked where a case has none.
Grid = tuple[Floats, Floats, Any]


@frozen
class Axis:
    """A parameter or quantity, shown by an axis or by colours."""

    name: str
    scale: style.Scale
    values: Array  # (cases,): numbers; for texts their positions in `ticks`
    ticks: tuple[str, ...] = ()  # texts in the order of the cases; empty for numbers

    @property
    def label(self) -> str:
        """Name in words."""
        plain = self.name.replace("_", " ")
        own = self.name not in (*COLUMNS, *NAMES)  # the caller's symbol or word
        return LABELS.get(self.name, plain if own else plain.capitalize())

    @property
    def whole(self) -> bool:
        """Whether the numbers are counts."""
        return self.name in INTEGERS

    def mark(self, axis: PlotAxis) -> None:
        """Label an axis of a graph; counts have ticks at integers only."""
        self.scale.name(axis, self.label)
        if self.whole:
            axis.set_major_locator(MaxNLocator(integer=True))


@frozen
class Choice:
    """Contents of a map."""

    over: list[Axis]  # one or two
    shown: Axis  # quantity; NaN where a case has none
    levels: dict[float, str]  # values to mark, and what they are
    title: str  # values that select the cases; empty for all cases
    other: Axis | None  # second varying parameter of a map over one
    beyond: dict[str, Bools]  # by what they are: masks of the cases beyond the range of the model
    ended: dict[str, Bools]  # the same of the cases whose contact is not over
    # (cases,): delamination thresholds, if they differ and peak forces are shown; else empty.
    limits: Array


def choose(
    sweep: SweepResult,
    name: str,
    quantity: str,
    over: Sequence[str],
    where: Mapping[str, Any],
    level: Sequence[float],
) -> Choice:
    """Select the contents of a map; warn of cases without a value.

    Raises PlotError if the options do not fit the sweep, or no case remains.
    """
    rows = case_rows(sweep, name, where)
    varying = [n for n, values in sweep.cases.items() if len(np.unique(values[rows])) > 1]
    axes = [axis_of(sweep, n, sweep[n][rows]) for n in _over(sweep, name, varying, over)]
    others = [parameter for parameter in varying if parameter not in [axis.name for axis in axes]]
    other = None
    if others and len(axes) == 1:
        other = axis_of(sweep, others[0], sweep[others[0]][rows])
    if others:  # refuse them if cases would hide one another
        vary = f"{_listed(others)} {'varies' if len(others) == 1 else 'vary'} too"
        selects = f"--where {others[0]}=VALUE selects some of"
        points = np.column_stack([axis.values for axis in axes])
        if other is None and len(np.unique(points, axis=0)) < len(points):
            raise PlotError(f"{vary}, so that cases would hide one another; {selects} them")
        if other is not None and (len(others) > 1 or len(other.ticks) > CURVES):
            both = f"--over {axes[0].name},{others[0]} draws over both"
            raise PlotError(f"{vary}; {selects} the cases, {both}")
    shown = quantity_of(sweep, name, rows, quantity)
    title = ", ".join(f"{held} {_text(sweep, held, rows[0])}" for held in where)
    levels = dict.fromkeys(level, "level")
    limits = np.empty(0)
    if shown.name == "peak_force" and "threshold_force" in sweep.summary:
        limits = sweep["threshold_force"][rows]
        highest = float(np.nanmax(limits))
        if highest - np.nanmin(limits) <= 1e-9 * highest:
            levels[highest], limits = THRESHOLD, np.empty(0)
    low, high = np.nanmin(shown.values), np.nanmax(shown.values)
    for value in level:
        if not low <= value <= high:
            warn(
                f"the level {value:g} is outside the picture's values, which range from {low:g} "
                f"to {high:g}"
            )
    return Choice(
        axes, shown, levels, title, other, beyond(sweep, rows), ended(sweep, rows), limits
    )


def beyond(sweep: SweepResult, rows: Ints) -> dict[str, Bools]:
    """Cases beyond the range of the model, by what they are."""
    found = dict(counted(sweep.validity[rows]))
    for other in (Reason.OPEN, Reason.DELAMINATED):  # which have a mark and a line of their own
        found.pop(other, None)
    return {MEANING[reason]: some for reason, some in found.items()}


def ended(sweep: SweepResult, rows: Ints) -> dict[str, Bools]:
    """Cases whose contact is not over, by what they are; empty if there are none."""
    some = sweep.fine[rows] & ~sweep.over[rows]
    what = STILL if np.array_equal(some, sweep.still[rows]) else ENDED
    return {what: some} if some.any() else {}


def counts(masks: Mapping[str, Bools], sign: str = "") -> str:
    """Lines for below a picture: how many cases are what."""
    texts = (f"{sign}{what}: {some.sum()} of {len(some)} cases" for what, some in masks.items())
    return "".join(f"\n{text}" for text in texts if text)


def case_rows(sweep: SweepResult, name: str, where: Mapping[str, Any]) -> Ints:
    """Cases at given values; numbers select the nearest value."""
    kept = np.ones(len(sweep), dtype=bool)
    for parameter, wanted in where.items():
        values = _values(sweep, name, parameter)
        if values.dtype.kind == "U":
            chosen = values == str(wanted)
            if not chosen.any():
                raise PlotError(
                    f"{name} has no {parameter} {wanted}; there is {_listed(dict.fromkeys(values))}"
                )
        else:
            try:
                number = float(wanted)
            except ValueError:
                number = np.nan
            low, high = values.min(), values.max()
            room = 1e-6 * (high - low)
            if not low - room <= number <= high + room:
                raise PlotError(
                    f"{name} has no {parameter} {wanted}; its values range from {low:g} to {high:g}"
                )
            chosen = values == values[np.abs(values - number).argmin()]
        kept &= chosen
    if not kept.any():
        raise PlotError(f"{name} has no case with these values of {_listed(where)}")
    return np.flatnonzero(kept)


def _values(sweep: SweepResult, name: str, parameter: str) -> Array:
    if parameter not in sweep.cases:
        raise PlotError(f"{name} has no parameter {parameter}; it has {_listed(sweep.cases)}")
    return sweep.cases[parameter]


def _listed(names: Iterable[Any]) -> str:
    """Join names in words."""
    *most, last = map(str, names)
    return f"{', '.join(most)} and {last}" if most else last


def _text(sweep: SweepResult, name: str, row: int) -> str:
    """A value for a title."""
    value = sweep[name][row]
    if isinstance(value, str):
        return str(value)
    return style.scale(abs(float(value)), sweep.unit(name)).show(float(value))


def _over(sweep: SweepResult, name: str, varying: list[str], asked: Sequence[str]) -> list[str]:
    """One or two parameters of the axes."""
    for parameter in asked:
        if parameter not in varying and len(_values(sweep, name, parameter)):
            raise PlotError(f"{parameter} does not vary among the cases; a map needs one that does")
    over = list(dict.fromkeys(asked)) or varying
    if not over:
        raise PlotError(f"nothing varies in {name}: all cases are equal")
    if len(over) > 2:
        raise PlotError(
            f"a map has at most two axes, and {_listed(over)} vary; choose with --over NAME or "
            "NAME,NAME"
        )
    return over


def quantity_of(sweep: SweepResult, name: str, rows: Ints, quantity: str) -> Axis:
    """The quantity to show, with a note about cases that lack it."""
    quantity = quantity or ("found_velocity" if "found_velocity" in sweep.summary else "peak_force")
    known = [name for name in sweep.summary if name not in VERDICTS]
    if quantity not in known:
        others = did_you_mean(quantity, known) or f"; the sweep has {_listed(known)}"
        raise PlotError(f"unknown quantity {quantity}{others}")
    status, values = sweep["status"][rows], sweep[quantity][rows].astype(float)
    run, ends = sweep.fine[rows], ended(sweep, rows)
    still = next(iter(ends.values()), np.zeros_like(run))
    values = np.where(run, values, np.nan)
    cases = f"of {len(rows)} cases of {name}"
    failures = "" if run.all() else f"{(~run).sum()} {cases} failed ({reasons(status[~run])})"
    what = f"were {STILL}" if STILL in ends else "ended before their contact was over"
    open_ends = f"{still.sum()} {cases} {what}"
    if np.isnan(values).all():
        nothing = f"no case of {name} has a {quantity}"
        if still.any():
            raise PlotError(f"{nothing}: {open_ends}; a deck with a longer duration may show it")
        raise PlotError(failures or f"{nothing}: there was no contact")
    if failures:
        warn(f"{failures}; they are gaps in the picture")
    if still.any():
        gaps = "; they have no value in the picture" if np.isnan(values[still]).any() else ""
        warn(f"{open_ends}{gaps}")
    if lacking := int((np.isnan(values) & run & ~still).sum()):
        warn(f"{lacking} cases of {name} without contact have no {quantity}")
    return axis_of(sweep, quantity, values)


def axis_of(sweep: SweepResult, name: str, values: Array) -> Axis:
    """Axis of a parameter or quantity; counts are not scaled."""
    plain = style.Scale(1.0, "")
    if values.dtype.kind == "U":
        ticks = tuple(dict.fromkeys(values.tolist()))
        places = {text: place for place, text in enumerate(ticks)}
        return Axis(name, plain, np.array([places[text] for text in values.tolist()]), ticks)
    if name in INTEGERS:
        return Axis(name, plain, values)
    return Axis(name, style.scale(style.peak(values), sweep.unit(name)), values)


def parameter_map(
    results: Mapping[str, SweepResult],
    *,
    quantity: str = "",
    over: Sequence[str] = (),
    where: Mapping[str, float | str] | None = None,
    level: Sequence[float] = (),
    width: str = "column",
) -> Picture:
    """Draw a quantity of a sweep's cases over one or two varying parameters.

    One parameter: points, joined if each has one case; texts are rows.  Two: cells with contour
    lines if the cases form a full grid, else coloured points; if one parameter is a text, one curve
    per text, or rows of cells if there are too many curves.

    `quantity` is a name of the sweep's summary, by default the peak force, or the velocity found;
    `over` one or two parameters, by default all that vary.  `where` selects the cases with these
    values, of numbers the nearest; `level` are values to mark (the deck's unit).
    """
    ((name, sweep),) = results.items()
    choice = choose(sweep, name, quantity, over, where or {}, level)
    axes, x, y = _draw(choice, width)
    marks = {  # by their signs in the text
        ("x", "\N{MULTIPLICATION SIGN} "): choice.ended,
        ("$/$", "/ "): choice.beyond,
    }
    for (marker, sign), masks in marks.items():
        if masks:
            some = np.logical_or.reduce(list(masks.values()))
            mark: Any = {"marker": marker, "color": "0.25", "ms": 3.5, "ls": "none"}
            mark |= {"mew": 0.0} if marker != "x" else {}  # a thin hatching
            axes.plot(x.values[some], y.values[some], zorder=4, clip_on=False, **mark)
            axes.set_xlabel(f"{axes.get_xlabel()}{counts(masks, sign)}")
    if len(choice.limits):
        _mark_limits(axes, x, y, choice)
    notes = [] if choice.shown in (x, y) else _name_levels(axes, x, y, choice)
    if choice.title:
        axes.set_title(choice.title, loc="left")
    figure: Any = axes.figure
    style.lines_legend(figure, axes)
    return Picture(figure, notes=notes)


def _name_levels(axes: Axes, x: Axis, y: Axis, choice: Choice) -> list[str]:
    """Name levels among colours in the legend; the note of a threshold that no colour reaches."""
    shown, notes = choice.shown, []
    low, high = np.nanmin(shown.values), np.nanmax(shown.values)
    points = _grid(x, y, shown) is None
    for value, name in choice.levels.items():
        text = f"{name} {shown.scale.show(value)}"
        if low < value < high and not points:
            look: Any = {"color": LEVEL_COLOUR, "ls": "-" if y.ticks else DASHES, "lw": 1.2}
            axes.plot([], [], label=text, **look)
        elif low < value < high and value == min(choice.levels):
            axes.plot([], [], "o", label=f"from {text} on", **RING)
        elif not low < value < high and name == THRESHOLD:
            side = "below" if high <= value else "above"
            notes.append(f"all values of {shown.name} are {side} the {text}")
    return notes


def _draw(choice: Choice, width: str) -> tuple[Axes, Axis, Axis]:
    """Draw the values; the axes, and what lies along x and y."""
    shown, other, levels = choice.shown, choice.other, choice.levels
    x, y = choice.over if len(choice.over) > 1 else (choice.over[0], shown)
    if x.ticks:  # texts lie along y
        x, y = y, x
    texts = None if x is shown else other if y is shown else y
    if texts and 0 < len(texts.ticks) <= CURVES:
        return _curves(x, texts, choice, width), x, shown
    if y.ticks:  # in rows, the first at the top
        bar = 0.0 if x is shown and other is None else BAR
        height = HEAD + ROW * max(len(y.ticks), 4) + bar
        _, (axes,) = style.panels(width, ratio=height / style.WIDTHS[width])
        axes.set_yticks(range(len(y.ticks)), y.ticks)
        axes.set_ylim(len(y.ticks) - 0.5, -0.5)
    else:
        _, (axes,) = style.panels(width, tall=1.0 if y is shown else 1.35)
    if len(choice.over) > 1:
        _label(axes, x, y)
        if (found := _grid(x, y, shown)) is None:
            _points(axes, x, y, shown, levels)
        else:
            _cells(axes, found, shown, levels, rows=bool(y.ticks))
        return axes, x, y
    if other is not None:
        look: Any = {"s": 9.0, "cmap": style.IN_ORDER, "norm": _colours(other), "linewidths": 0.0}
        _bar(axes, axes.scatter(x.values, y.values, c=other.values, **look), other, [])
    elif x is shown:
        axes.plot(x.values, y.values, "o", color=style.colours()[0], ms=3.5)
    else:
        (order,) = _runs(x, None)
        axes.plot(x.values[order], y.values[order], "o-", color=style.colours()[0], ms=2.5)
    _finish(axes, x, y, choice)
    return axes, x, y


def _curves(x: Axis, texts: Axis, choice: Choice, width: str) -> Axes:
    """A curve a text."""
    _, (axes,) = style.panels(width, tall=1.15)
    looks = zip(texts.ticks, style.colours(), MARKERS, strict=False)
    for here, (text, colour, marker) in zip(_runs(x, texts), looks, strict=True):
        values = choice.shown.values[here]
        if not np.isnan(values).all():  # else they have failed
            axes.plot(x.values[here], values, marker=marker, color=colour, ms=2.2, label=text)
    _finish(axes, x, choice.shown, choice)
    return axes


def _runs(x: Axis, texts: Axis | None) -> list[Ints]:
    """Cases in the order of x: those of every text, or all."""
    order = np.argsort(x.values, kind="stable")
    if texts is None:
        return [order]
    return [order[texts.values[order] == row] for row in range(len(texts.ticks))]


def _label(axes: Axes, x: Axis, y: Axis) -> None:
    x.mark(axes.xaxis)
    if not y.ticks:
        y.mark(axes.yaxis)


def _finish(axes: Axes, x: Axis, y: Axis, choice: Choice) -> None:
    """Label the axes and mark the levels; the axis of the quantity begins at zero if it can."""
    shown, across = choice.shown, x is choice.shown
    _label(axes, x, y)
    for level, name in choice.levels.items():
        look = LEVEL | {"label": f"{name} {shown.scale.show(level)}"}
        if name != THRESHOLD:
            look["linestyle"] = DOTS
        (axes.axvline if across else axes.axhline)(level, **look)
    if np.nanmin(shown.values) >= 0.0:
        limits = [level for level, name in choice.levels.items() if name == THRESHOLD]
        room = 1.05 * max(np.nanmax(shown.values), *limits, 0.0)  # also for the markers
        axes.set(**{"xlim" if across else "ylim": (0.0, room or 1.0)})
    if across:
        axes.grid(axis="y", linewidth=0.4, color="0.85")
        axes.set_axisbelow(True)


def _mark_limits(axes: Axes, x: Axis, y: Axis, choice: Choice) -> None:
    """Mark the delamination thresholds of cases whose plates differ."""
    shown, limits = choice.shown, choice.limits
    above = replace(shown, values=shown.values - limits)
    highest = 1.05 * np.nanmax(limits)
    texts = next((axis for axis in (*choice.over, choice.other) if axis and axis.ticks), None)
    if x is shown:
        axes.set_xlim(right=max(axes.get_xlim()[1], highest))
        axes.plot(limits, y.values, "|", color="0.2", ms=11.0, label=THRESHOLD)
    elif y is shown:
        axes.set_ylim(top=max(axes.get_ylim()[1], highest))
        if texts is None and choice.other is not None:
            axes.plot(x.values, limits, "_", color="0.2", label=THRESHOLD)
            return
        axes.plot([], [], label=THRESHOLD, **LEVEL)  # for the legend
        for row, here in enumerate(_runs(x, texts)):
            look = LEVEL | ({"color": style.colours()[row]} if texts else {})
            axes.plot(x.values[here], limits[here], **look)
    elif (found := _grid(x, y, above)) is None:
        at = above.values >= 0.0
        axes.plot(x.values[at], y.values[at], "o", label=f"from {THRESHOLD} on", **RING)
    elif found[2].min() < 0.0 < found[2].max():
        if y.ticks:
            _crossings(axes, found, 0.0)
        else:
            axes.contour(*found, [0.0], **CONTOUR)
        dashes = "-" if y.ticks else DASHES
        axes.plot([], [], color=LEVEL_COLOUR, ls=dashes, lw=1.2, label=THRESHOLD)  # for the legend


def _colours(shown: Axis) -> Normalize:
    """Colour scale of the values; counts have one colour each."""
    low, high = float(np.nanmin(shown.values)), float(np.nanmax(shown.values))
    if shown.whole and high - low < SHADES - 1:
        return BoundaryNorm(np.arange(low - 0.5, high + 1.0), SHADES)
    return Normalize(low, high)


def _bar(axes: Axes, drawn: Any, shown: Axis, levels: Collection[float]) -> None:
    locator = MaxNLocator(6, integer=shown.whole)
    bar = style.colour_bar(axes, drawn, shown.scale, shown.label, locator)
    for level in levels:
        if drawn.norm.vmin <= level <= drawn.norm.vmax:
            bar.ax.axvline(level, color=LEVEL_COLOUR, linewidth=1.5)


def _cells(axes: Axes, grid: Grid, shown: Axis, levels: Collection[float], *, rows: bool) -> None:
    """One cell per case, with contour lines unless the rows are texts."""
    values = grid[2]
    look: Any = {"edgecolor": "face", "linewidth": 0.1, "rasterized": values.size > MANY}
    drawn = axes.pcolormesh(
        *grid, shading="nearest", cmap=style.IN_ORDER, norm=_colours(shown), **look
    )
    _bar(axes, drawn, shown, levels)
    low, high = values.min(), values.max()
    if rows:
        for level in levels:
            _crossings(axes, grid, level)
        return
    text: Any = {"fontsize": 6.0, "inline_spacing": 2, "fmt": style.Multiple(shown.scale.factor)}
    if not shown.whole and low < high:
        ticks = MaxNLocator(LINES).tick_values(low, high)
        apart = 0.3 * np.diff(ticks).min()  # the numbers of near lines would collide
        inner = [
            tick for tick in ticks
            if low < tick < high and all(abs(tick - level) > apart for level in levels)
        ]  # fmt: skip
        axes.clabel(axes.contour(*grid, inner, colors="white", linewidths=0.5), **text)
    if inside := sorted({level for level in levels if low < level < high}):
        axes.clabel(axes.contour(*grid, inside, **CONTOUR), colors="white", **text)


def _crossings(axes: Axes, grid: Grid, level: float) -> None:
    """Mark where a row crosses a level, interpolated linearly between cases."""
    x, y, shown = grid
    for row, values in zip(y, shown.filled(np.nan) - level, strict=True):
        before, after = values[:-1], values[1:]
        passed = np.isfinite(before + after) & ((before < 0.0) != (after < 0.0))
        share = before[passed] / (before[passed] - after[passed])
        at = x[:-1][passed] + share * np.diff(x)[passed]
        axes.vlines(at, row - 0.5, row + 0.5, color=LEVEL_COLOUR, linewidth=1.2)


def _points(axes: Axes, x: Axis, y: Axis, shown: Axis, levels: Collection[float]) -> None:
    """One coloured point per case; those above the lowest level have an edge."""
    fine = np.isfinite(shown.values)
    values = shown.values[fine]
    drawn: Any = axes.scatter(
        x.values[fine], y.values[fine], c=values, s=14.0, cmap=style.IN_ORDER,
        norm=_colours(shown), linewidths=0.0, rasterized=len(values) > MANY,
    )  # fmt: skip
    if levels:
        drawn.set_linewidths(np.where(values >= min(levels), 0.9, 0.0))
        drawn.set_edgecolors(LEVEL_COLOUR)
    _bar(axes, drawn, shown, levels)


def _grid(first: Axis, second: Axis, shown: Axis) -> Grid | None:
    """The cases as a full grid; None if they do not form one."""
    x, column = np.unique(first.values, return_inverse=True)
    y, row = np.unique(second.values, return_inverse=True)
    places = row * len(x) + column
    if not np.array_equal(np.sort(places), np.arange(len(x) * len(y))):
        return None
    return x, y, np.ma.masked_invalid(shown.values[np.argsort(places)].reshape(len(y), len(x)))
