"""Style of the pictures: journal sizes and colours, units on the axes, legends beside the data.

Axes hold numbers in the deck's units; their ticks show them times the factor of a :class:`Scale`.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from contextlib import ContextDecorator
from contextvars import ContextVar
from typing import Any, Literal, cast

import matplotlib
import numpy as np
from cycler import cycler
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import Formatter, Locator

from fecm._frozen import frozen
from fecm._text import printable
from fecm.deck.units import PREFIXED, thousands, unit_of, with_prefix
from fecm.plot.kinds import PlotError
from fecm.results.result import Result

WIDTHS = {"column": 3.5, "full": 7.2}  # width of a column and of a page (in)
RATIO = {"column": 0.68, "full": 0.45}  # height over width of a graph
BAR = 0.32  # height of a colour bar with its labels (in)
RESOLUTION, SCREEN = 300, 150  # dots per inch in print and on a screen

# Okabe and Ito's colours, without yellow, which is hard to see on white.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
STYLES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1, 1)), (0, (5, 1.5, 1, 1.5)))
IN_ORDER = "viridis"  # sequential
SIGNED = "RdBu_r"  # diverging, about zero

# Where pictures are drawn: on axes, on a new figure of pyplot, or on a figure by itself.
TARGET: ContextVar[Axes | Literal["pyplot"] | None] = ContextVar("TARGET", default=None)
# Any: matplotlib's types of these names differ between versions.
RC: Any = {
    "axes.prop_cycle": cycler(color=COLOURS),
    "figure.dpi": SCREEN,
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    **dict.fromkeys(("font.size", "axes.labelsize", "axes.titlesize"), 8.0),
    **dict.fromkeys(("xtick.labelsize", "ytick.labelsize"), 7.0),
    **dict.fromkeys(("legend.fontsize", "legend.title_fontsize"), 7.0),
    **dict.fromkeys(("axes.linewidth", "xtick.major.width", "ytick.major.width"), 0.6),
    "lines.linewidth": 0.9,
    **dict.fromkeys(("axes.spines.top", "axes.spines.right", "legend.frameon"), False),
    "axes.formatter.use_mathtext": True,
    "legend.handlelength": 1.8,
    "legend.columnspacing": 1.2,
    "legend.borderaxespad": 0.2,
    **dict.fromkeys(("figure.constrained_layout.h_pad", "figure.constrained_layout.w_pad"), 0.02),
    "savefig.facecolor": "white",
    "pdf.fonttype": 42,
    "svg.hashsalt": "fecm",
}
UNDATED: dict[str, dict[str, Any]] = {
    ".png": {"Software": None},
    ".svg": {"Date": None, "Creator": None},
    ".pdf": {"CreationDate": None, "Creator": None, "Producer": None},
}
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")

# Decorates functions to draw in this style.
styled = cast(ContextDecorator, matplotlib.rc_context(RC))


def literal(text: str) -> str:
    """Escape a text so that matplotlib shows it literally, without mathematics."""
    return printable(text).replace("$", r"\$")


class Multiple(Formatter):
    """Shows ticks times a factor, all with the decimals that one of them needs."""

    def __init__(self, factor: float) -> None:
        self._factor, self._decimals = factor, 12

    def set_locs(self, locs: Any) -> None:
        """Take the positions of the ticks."""
        if not len(locs):
            return
        shown = self._factor * np.asarray(locs)
        near = 1e-4 * (np.diff(np.sort(shown)).max() if len(shown) > 1 else np.abs(shown).max())
        rounded = (n for n in range(12) if (np.abs(shown - shown.round(n)) <= near).all())
        self._decimals = next(rounded, 12)

    def __call__(self, x: float, pos: int | None = None) -> str:
        """Text of a tick."""
        form = ".4g" if self._decimals == 12 else f".{self._decimals}f"
        return self.fix_minus(f"{self._factor * x:z{form}}")

    def format_data_short(self, value: float) -> str:
        """Text of the cursor's position."""
        return f"{self._factor * value:.4g}"


@frozen
class Scale:
    """Scale of an axis: factor of the numbers at its ticks, and text of the unit."""

    factor: float
    unit: str

    @property
    def shown(self) -> str:
        """The unit with its broken powers, as in N/mm^1.5, above the line."""
        return re.sub(r"\^(\d+\.\d+)", r"$^{\1}$", literal(self.unit))

    def label(self, name: str) -> str:
        """Label of an axis."""
        return f"{name} ({self.shown})" if self.unit else name

    def name(self, axis: Axis, name: str) -> None:
        """Label an axis; its ticks show the numbers in the unit."""
        axis.set_label_text(self.label(name))
        axis.set_major_formatter(Multiple(self.factor))

    def show(self, value: float) -> str:
        """A value with its unit, to four significant digits."""
        times = " ×" if self.unit.startswith("10") else ""
        return f"{self.factor * value:.4g}{times} {self.shown}".rstrip()


def scale(peak: float, unit: str) -> Scale:
    """Scale for numbers up to `peak`, in powers of 1000; none for numbers near 1.

    Some units take a prefix (800 µs), others follow the power (1.3, 10⁻³ in).
    """
    power = 0
    if 1e-100 < peak < math.inf and not (1.0 if unit in PREFIXED else 0.1) <= peak < 1e4:
        power = thousands(peak)
    if name := with_prefix(unit, power):
        return Scale(10.0**-power, name)
    text = f"{unit[2:]}⁻¹" if unit.startswith("1/") else unit
    text = re.sub(r"\^(\d+)(?![\d.])", lambda found: found[1].translate(_SUPERSCRIPTS), text)
    power_of_ten = f"10{str(power).translate(_SUPERSCRIPTS)} " if power else ""
    return Scale(10.0**-power, f"{power_of_ten}{text.replace('*', '·')}".strip())


def open_ends(results: Mapping[str, Result]) -> str:
    """Say that contacts last to the end; name the results unless all do.  Empty if none does."""
    named = [name for name, result in results.items() if result.still_in_contact]
    which = f" ({', '.join(named)})" if len(named) < len(results) else ""
    return f"still in contact at the end{which}" if named else ""


def scale_of(results: Mapping[str, Result], dimension: str, arrays: Iterable[Any]) -> Scale:
    """Scale for arrays of one dimension, in the results' unit if all name it; units must agree."""
    units = {name: result.unit(dimension) for name, result in results.items()}
    named = {unit: name for name, unit in units.items() if unit}
    if len(named) > 1:
        units_in = " and ".join(f"{unit} in {name}" for unit, name in named.items())
        raise PlotError(f"the results can't share axes: the unit of {dimension} is {units_in}")
    return scale(peak(*arrays), "" if "" in units.values() else next(iter(named)))


def peak(*arrays: Any) -> float:
    """Largest finite absolute value of arrays; 0 if there is none."""
    finite = (np.abs(array[np.isfinite(array)]) for array in arrays)
    return max((float(values.max(initial=0.0)) for values in finite), default=0.0)


def scale_in(units: Mapping[str, str], dimension: str, *arrays: Any) -> Scale:
    """Scale for arrays of one dimension, in named units."""
    return scale(peak(*arrays), unit_of(dimension, dict(units)))


def limit_count(count: int, what: str, most: int = len(COLOURS)) -> None:
    """Refuse more lines than there are colours or styles."""
    if count > most:
        raise PlotError(f"{count} {what} can't be told apart in one picture; at most {most} can")


def colours() -> list[str]:
    """Colours of the lines: this style's, or the user's own."""
    own = matplotlib.rcParams["axes.prop_cycle"].by_key().get("color", COLOURS)
    return list(itertools.islice(itertools.cycle(own), len(COLOURS)))


def style_on(axes: Axes | None) -> dict[str, Any]:
    """The part of this style that the user's settings leave open, or the style on given axes.

    On given axes it is the user's, with the colours after those of the lines there.
    """
    own: Any = matplotlib.rcParams
    if axes is not None:
        cycle = own["axes.prop_cycle"]
        first = len(axes.get_lines()) % len(cycle)
        return {"axes.prop_cycle": cycle[first:].concat(cycle[:first])}
    return {name: RC[name] for name in RC if own[name] == matplotlib.rcParamsDefault[name]}


def panels(
    width: str, rows: int = 1, columns: int = 1, *, ratio: float = 0.0, tall: float = 1.0,
    **options: Any,
) -> tuple[Figure, list[Axes]]:  # fmt: skip
    """Figure with equal axes by rows: height over width is `ratio`, or `tall` times a graph's."""
    inches, target, ratio = WIDTHS[width], TARGET.get(), ratio or tall * RATIO[width]
    solid = "subplot_kw" in options and options["subplot_kw"].get("projection") == "3d"
    if isinstance(target, Axes):
        if rows * columns > 1:
            raise PlotError(f"this picture has {rows * columns} axes and can't be drawn on one")
        if solid != (target.name == "3d"):
            raise PlotError(
                "this picture needs axes made with subplot_kw={'projection': '3d'}"
                if solid else "this picture can't be drawn on three-dimensional axes"
            )  # fmt: skip
        figure: Any = target.figure
        return figure, [target]
    # Layout engines do not know the size of three-dimensional axes.
    layout: Any = None if "subplot_kw" in options else "constrained"
    size = (inches, inches * ratio * rows / columns)
    if target is None:
        figure = Figure(figsize=size, layout=layout)
        FigureCanvasAgg(figure)
    else:
        from matplotlib import pyplot

        figure = pyplot.figure(figsize=size, layout=layout)
    axes = figure.subplots(rows, columns, squeeze=False, **options)
    if solid:  # with room for a colour bar
        top = 1.0 - BAR / size[1]
        figure.subplots_adjust(0.0, 0.07, 0.91, top, wspace=0.1, hspace=0.05)
    return figure, list(axes.ravel())


def colour_bar(
    axes: Axes | Sequence[Axes], drawn: Any, shown: Scale, name: str, locator: Locator,
    **options: Any,
) -> Any:  # fmt: skip
    """Draw the colour bar of what is drawn above axes."""
    place: dict[str, Any] = {"location": "top", "aspect": 30, "pad": 0.03} | options
    bar = drawn.axes.figure.colorbar(drawn, ax=axes, **place)
    bar.set_label(shown.label(name))
    bar.outline.set_linewidth(0.6)
    bar.locator, bar.formatter = locator, Multiple(shown.factor)
    bar.minorticks_off()
    bar.update_ticks()
    return bar


def legend(figure: Figure, handles: Sequence[Any], labels: Sequence[str], title: str = "") -> None:
    """Draw a legend with literal labels above the axes, or in the axes if they are given."""
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


def lines_legend(figure: Figure, axes: Axes, title: str = "") -> None:
    """Draw the legend of the labelled lines of axes, if there are any."""
    named = [(str(line.get_label()), line) for line in axes.get_lines()]
    unnamed = ("_", "_nolegend_")  # matplotlib gives the latter to error bars
    named = [
        (text, line) for text, line in named
        if text not in unnamed and not text.startswith("_child")
    ]  # fmt: skip
    if named:
        legend(figure, [line for _, line in named], [text for text, _ in named], title)
