"""Style of the pictures: journal sizes and colours, units on the axes, legends beside the data.

Axes hold numbers in the deck's units. Their ticks show the numbers times the factor of an
:class:`AxisScale`.
"""

from __future__ import annotations

import itertools
import math
import os
import re
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from contextlib import ContextDecorator
from contextvars import ContextVar
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Literal, NamedTuple, cast

import matplotlib
import numpy as np
from cycler import cycler
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.ticker import Formatter, Locator

from fecm._text import printable
from fecm._typing import Array
from fecm.deck.units import PREFIXED, SUPERSCRIPTS, thousands, unit_of, with_prefix
from fecm.plot.kinds import PlotError, Width
from fecm.results.result import Result

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.collections import Collection
    from matplotlib.colorbar import Colorbar
    from matplotlib.typing import LineStyleType

# Properties of an artist, as keywords of matplotlib's functions, which are Any there.
Look = dict[str, Any]

WIDTHS: dict[Width, float] = {"column": 3.5, "full": 7.2}  # inches
RATIO: dict[Width, float] = {"column": 0.68, "full": 0.45}  # height over width of a graph
LETTERS = 16  # letters of small text per inch
FOOTER = 7.0  # size of small text (points)
TITLE, TITLE_LINE = 8.0, 0.16  # size of a title (points), and height of its lines (in)
COLOUR_BAR_HEIGHT = 0.32  # height of a colour bar with its labels (in)
# Dots per inch in print and on a screen.
RESOLUTION = 300
SCREEN = 150

# Okabe and Ito's colours, without yellow, which is hard to see on white.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
SOLID: LineStyleType = "-"
DASHED: LineStyleType = (0, (5, 1.5))
DOTTED: LineStyleType = (0, (1, 1))
DASH_DOTTED: LineStyleType = (0, (5, 1.5, 1, 1.5))
STYLES = (SOLID, DASHED, DOTTED, DASH_DOTTED)
SEQUENTIAL = "viridis"
DIVERGING = "RdBu_r"  # about zero

# Where pictures are drawn: on given axes, on a new figure of pyplot, or on their own figure.
TARGET: ContextVar[Axes | Literal["pyplot"] | None] = ContextVar("TARGET", default=None)
# Any: matplotlib's types of these names differ between versions.
RC: Any = {
    "axes.prop_cycle": cycler(color=COLOURS),
    "figure.dpi": SCREEN,
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 8.0,
    "axes.labelsize": 8.0,
    "axes.titlesize": 8.0,
    "xtick.labelsize": 7.0,
    "ytick.labelsize": 7.0,
    "legend.fontsize": 7.0,
    "legend.title_fontsize": 7.0,
    "axes.linewidth": 0.6,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "lines.linewidth": 0.9,
    "hatch.linewidth": 0.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.formatter.use_mathtext": True,
    "legend.frameon": False,
    "legend.handlelength": 1.8,
    "legend.columnspacing": 1.2,
    "legend.borderaxespad": 0.2,
    "figure.constrained_layout.h_pad": 0.02,
    "figure.constrained_layout.w_pad": 0.02,
    "savefig.facecolor": "white",
    "pdf.fonttype": 42,
    "svg.hashsalt": "fecm",
}
# Metadata to leave out of files, by their suffix, so that equal pictures have equal bytes.
UNDATED: dict[str, dict[str, None]] = {
    ".png": {"Software": None},
    ".svg": {"Date": None, "Creator": None},
    ".pdf": {"CreationDate": None, "Creator": None, "Producer": None},
}
DATE = "SOURCE_DATE_EPOCH"  # which Matplotlib reads, and refuses if it is not a number


def save(figure: Figure, file: Path | IO[bytes], suffix: str, dpi: float) -> None:
    """Save a figure without a date: equal figures give equal bytes."""
    date = os.environ.pop(DATE, None)
    try:
        figure.savefig(file, format=suffix[1:], dpi=dpi, metadata=UNDATED[suffix])
    finally:
        if date is not None:
            os.environ[DATE] = date


# Decorator of functions that draw in this style.
styled = cast(ContextDecorator, matplotlib.rc_context(RC))


def literal(text: str) -> str:
    """Escape a text so that matplotlib does not read mathematics in it."""
    return printable(text).replace("$", r"\$")


class Multiple(Formatter):
    """Formatter of ticks times a factor; all ticks have the decimals that the longest needs."""

    MOST_DECIMALS = 11

    def __init__(self, factor: float) -> None:
        self._factor = factor
        self._decimals: int | None = None  # None if ticks need more than MOST_DECIMALS

    def set_locs(self, locs: Sequence[float]) -> None:
        """Receive the positions of the ticks."""
        if not len(locs):
            return
        shown = self._factor * np.asarray(locs)
        room = np.diff(np.sort(shown)).max() if len(shown) > 1 else np.abs(shown).max()
        self._decimals = None
        for decimals in range(self.MOST_DECIMALS + 1):
            if (np.abs(shown - shown.round(decimals)) <= 1e-4 * room).all():
                self._decimals = decimals
                break

    def __call__(self, x: float, pos: int | None = None) -> str:
        """Return the text of a tick."""
        form = ".4g" if self._decimals is None else f".{self._decimals}f"
        return self.fix_minus(f"{self._factor * x:z{form}}")

    def format_data_short(self, value: float) -> str:
        """Return the text of the cursor's position."""
        return f"{self._factor * value:.4g}"


class AxisScale(NamedTuple):
    """Scale of an axis: factor of the numbers at its ticks, and the unit."""

    factor: float
    unit: str

    @property
    def shown(self) -> str:
        """Unit for matplotlib, with fractional powers, as in N/mm^1.5, as superscripts."""
        return re.sub(r"\^(\d+\.\d+)", r"$^{\1}$", literal(self.unit))

    def label(self, name: str) -> str:
        """Return the label of an axis."""
        return f"{name} ({self.shown})" if self.unit else name

    def name(self, axis: Axis, name: str) -> None:
        """Label an axis, and show its ticks in the unit."""
        axis.set_label_text(self.label(name))
        axis.set_major_formatter(Multiple(self.factor))

    def show(self, value: float) -> str:
        """Format a value with its unit, to four significant digits."""
        times = " ×" if self.unit.startswith("10") else ""
        return f"{self.factor * value:.4g}{times} {self.shown}".rstrip()


def scale(peak: float, unit: str) -> AxisScale:
    """Return the scale for numbers up to `peak`, in powers of 1000; 1 for numbers near 1.

    Some units take a prefix (800 µs); other units follow the power of ten (1.3, 10⁻³ in).
    """
    power = 0
    if 1e-100 < peak < math.inf and not (1.0 if unit in PREFIXED else 0.1) <= peak < 1e4:
        power = thousands(peak)
    if name := with_prefix(unit, power):
        return AxisScale(10.0**-power, name)
    text = f"{unit[2:]}⁻¹" if unit.startswith("1/") else unit
    text = re.sub(r"\^(\d+)(?![\d.])", lambda match: match[1].translate(SUPERSCRIPTS), text)
    power_of_ten = f"10{str(power).translate(SUPERSCRIPTS)} " if power else ""
    return AxisScale(10.0**-power, f"{power_of_ten}{text.replace('*', '·')}".strip())


def open_ends_note(results: Mapping[str, Result]) -> str:
    """Return a note about contacts that last to the end; empty if no contact does.

    It names the results unless all contacts last to the end.
    """
    named = [name for name, result in results.items() if result.still_in_contact]
    which = f" ({', '.join(named)})" if len(named) < len(results) else ""
    return f"still in contact at the end{which}" if named else ""


def scale_of(results: Mapping[str, Result], dimension: str, arrays: Iterable[Array]) -> AxisScale:
    """Return the scale for arrays of one dimension, in the unit of the results.

    Raises PlotError if the results differ in this unit.
    """
    units = {name: unit_of(dimension, result.units) for name, result in results.items()}
    named = {unit: name for name, unit in units.items() if unit}
    if len(named) > 1:
        units_in = " and ".join(f"{unit} in {name}" for unit, name in named.items())
        raise PlotError(f"the results can't share axes: the unit of {dimension} is {units_in}")
    return scale(largest_absolute(*arrays), "" if "" in units.values() else next(iter(named)))


def largest_absolute(*arrays: Array) -> float:
    """Return the largest finite absolute value of arrays; 0 without finite values."""
    finite = (np.abs(array[np.isfinite(array)]) for array in arrays)
    return max((float(values.max(initial=0.0)) for values in finite), default=0.0)


def scale_in(units: Mapping[str, str], dimension: str, *arrays: Array) -> AxisScale:
    """Return the scale for arrays of one dimension, in named units."""
    return scale(largest_absolute(*arrays), unit_of(dimension, dict(units)))


def limit_count(count: int, what: str, most: int = len(COLOURS)) -> None:
    """Raise PlotError if there are more lines than colours or styles."""
    if count > most:
        raise PlotError(f"{count} {what} can't be told apart in one picture; at most {most} can")


def colours() -> list[str]:
    """Return the colours of lines in the current settings, which may be the user's."""
    cycle = matplotlib.rcParams["axes.prop_cycle"].by_key().get("color", COLOURS)
    return list(itertools.islice(itertools.cycle(cycle), len(COLOURS)))


def style_on(axes: Axes | None) -> Look:
    """Return the settings to draw with on given axes, or on a new figure of pyplot.

    A new figure has this style where the user has not changed matplotlib's defaults. Given axes
    have the user's style, and colours start after the colours of the lines there.
    """
    settings = matplotlib.rcParams
    if axes is not None:
        cycle = settings["axes.prop_cycle"]
        first = len(axes.get_lines()) % len(cycle)
        return {"axes.prop_cycle": cycle[first:].concat(cycle[:first])}
    return {name: RC[name] for name in RC if settings[name] == matplotlib.rcParamsDefault[name]}


def panels(
    width: Width,
    rows: int = 1,
    columns: int = 1,
    *,
    ratio: float = 0.0,
    tall: float = 1.0,
    projection: Literal["3d", "polar"] | None = None,
    sharex: bool = False,
    sharey: bool = False,
    width_ratios: Sequence[float] | None = None,
    height_ratios: Sequence[float] | None = None,
) -> tuple[Figure, list[Axes]]:
    """Return a figure and its axes, row by row.

    Height over width of the axes is `ratio`, or `tall` times the usual ratio. The axes are unequal
    if `width_ratios` or `height_ratios` are given.
    """
    target = TARGET.get()
    if isinstance(target, Axes):
        return _figure_of(target, rows * columns, solid=projection == "3d"), [target]
    inches = WIDTHS[width]
    height = inches * (ratio or tall * RATIO[width]) * rows / columns
    # Layout engines do not know the size of three-dimensional axes.
    layout: Literal["constrained"] | None = None if projection else "constrained"
    if target is None:
        figure = Figure(figsize=(inches, height), layout=layout)
        FigureCanvasAgg(figure)
    else:
        from matplotlib import pyplot  # starts a user interface, which files do not need

        figure = pyplot.figure(figsize=(inches, height), layout=layout)
    axes = figure.subplots(
        rows,
        columns,
        squeeze=False,
        sharex=sharex,
        sharey=sharey,
        width_ratios=width_ratios,
        height_ratios=height_ratios,
        subplot_kw={"projection": projection},
    )
    if projection == "3d":
        top = 1.0 - COLOUR_BAR_HEIGHT / height
        figure.subplots_adjust(left=0.0, bottom=0.07, right=0.91, top=top, wspace=0.1, hspace=0.05)
    return figure, list(axes.ravel())


def _figure_of(target: Axes, count: int, *, solid: bool) -> Figure:
    """Return the figure of the user's axes.

    Raises PlotError if the picture does not fit them.
    """
    if count > 1:
        raise PlotError(f"this picture has {count} axes and can't be drawn on one")
    if solid and target.name != "3d":
        raise PlotError("this picture needs axes made with subplot_kw={'projection': '3d'}")
    if not solid and target.name == "3d":
        raise PlotError("this picture can't be drawn on three-dimensional axes")
    return cast(Figure, target.figure)  # or a SubFigure, which has the same methods


def colour_bar(
    axes: Axes | Sequence[Axes],
    drawn: Collection,
    shown: AxisScale,
    name: str,
    locator: Locator,
    *,
    aspect: float = 30.0,
    fraction: float = 0.15,
    pad: float = 0.03,
    shrink: float = 1.0,
) -> Colorbar:
    """Draw a colour bar above axes.

    `aspect` is length over height of the bar; `fraction`, `pad` and `shrink` are relative to the
    axes.
    """
    figure = cast(Figure, drawn.figure)
    bar = figure.colorbar(
        drawn, ax=axes, location="top", aspect=aspect, fraction=fraction, pad=pad, shrink=shrink
    )
    bar.set_label(shown.label(name))
    bar.outline.set_linewidth(0.6)
    bar.locator = locator
    bar.formatter = Multiple(shown.factor)
    bar.minorticks_off()
    bar.update_ticks()
    return bar


def legend(
    figure: Figure, handles: Sequence[Artist], labels: Sequence[str], title: str = ""
) -> None:
    """Draw a legend with literal labels above the axes, or in the user's axes."""
    target = TARGET.get()
    if isinstance(target, Axes):
        drawn = target.legend(handles, labels, title=title or None)
    else:
        letters = max(map(len, labels), default=0)
        room = figure.get_figwidth() - (0.08 * len(title) if title else 0.0)
        columns = max(1, min(len(labels), int(room / (0.062 * letters + 0.45))))
        drawn = figure.legend(
            handles, labels, loc="outside upper center", ncols=columns, title=title or None
        )
    for text in drawn.get_texts():
        text.set_parse_math(False)


def footer(axes: Axes, lines: Sequence[str]) -> None:
    """Write lines below a picture, or below the user's axes, wrapped to their width."""
    if not lines:
        return
    on_given = isinstance(TARGET.get(), Axes)
    figure = cast(Figure, axes.figure)
    share = axes.get_position().width if on_given else 1.0
    wide = max(20, int(LETTERS * share * figure.get_figwidth()))
    text = "\n".join(textwrap.fill(line, wide) for line in lines)
    if on_given:
        axes.set_xlabel(f"{axes.get_xlabel()}\n{text}")
    else:
        figure.supxlabel(text, fontsize=FOOTER)


def entitle(figure: Figure, title: str) -> None:
    """Write the title of a deck above a complete picture, which becomes higher by its lines."""
    if title and (above := figure.get_suptitle()):
        figure.suptitle(f"{literal(title)}\n{above}", fontsize=TITLE)
        return
    wide, high = figure.get_size_inches()
    lines = textwrap.wrap(printable(title), int(LETTERS * wide))
    room = high / (high + TITLE_LINE * len(lines))
    figure.set_figheight(high / room)
    for drawn in figure.legends:  # at the edge of the figure
        drawn.borderaxespad += 72.0 * TITLE_LINE * len(lines) / drawn.prop.get_size_in_points()
    if (engine := figure.get_layout_engine()) is not None:
        cast(ConstrainedLayoutEngine, engine).set(rect=(0.0, 0.0, 1.0, room))
    else:
        for axes in figure.axes:
            box = axes.get_position(original=True)
            axes.set_position((box.x0, box.y0 * room, box.width, box.height * room))
    at_top = {"x": 0.02, "y": 1.0 - 0.02 * room, "va": "top", "fontsize": TITLE}
    figure.text(s="\n".join(lines), parse_math=False, **at_top)


def lines_legend(figure: Figure, axes: Axes, title: str = "") -> None:
    """Draw the legend of the labelled lines of axes, if there are any."""
    unnamed = ("_", "_nolegend_")  # matplotlib labels error bars with the second
    lines: list[Artist] = []
    labels: list[str] = []
    for line in axes.get_lines():
        label = str(line.get_label())
        if label not in unnamed and not label.startswith("_child"):
            lines.append(line)
            labels.append(label)
    if lines:
        legend(figure, lines, labels, title)
