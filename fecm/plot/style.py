"""How pictures look: sizes and colours of a journal, units on the axes, legends beside the data."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ParamSpec

import matplotlib
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from fecm.plot.kinds import Picture, PlotError
from fecm.results.result import Result
from fecm.results.schema import printable

# Width of a column and of a page (in); points an inch of pictures in print and on a screen.
WIDTHS = {"column": 3.5, "full": 7.2}

RATIO = {"column": 0.68, "full": 0.45}  # height over width of a graph

RESOLUTION, SCREEN = 300, 150

# Okabe and Ito's colours, without the yellow that is lost on white.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")

STYLES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1, 1)), (0, (5, 1.5, 1, 1.5)))

IN_ORDER = "viridis"  # quantities that grow

SIGNED = "RdBu_r"  # quantities about zero

# Any, as the names that matplotlib types differ from version to version.
RC: Any = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 8.0,
    "axes.labelsize": 8.0,
    "axes.titlesize": 8.0,
    "xtick.labelsize": 7.0,
    "ytick.labelsize": 7.0,
    "legend.fontsize": 7.0,
    "axes.linewidth": 0.6,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "lines.linewidth": 0.9,
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

UNDATED: dict[str, dict[str, Any]] = {
    ".png": {"Software": None},
    ".svg": {"Date": None, "Creator": None},
    ".pdf": {"CreationDate": None, "Creator": None, "Producer": None},
}

# Units that take prefixes: the unit that they are of, and the power of ten.
_PREFIXED = {
    "s": ("s", 0), "ms": ("s", -3), "us": ("s", -6), "µs": ("s", -6),
    "m": ("m", 0), "mm": ("m", -3), "N": ("N", 0), "kN": ("N", 3), "J": ("J", 0),
    "N*m": ("J", 0), "N*mm": ("J", -3), "kN*mm": ("J", 0), "kN*m": ("J", 3),
}  # fmt: skip

_PREFIXES = {-12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}

_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")

Drawn = ParamSpec("Drawn")


def styled(function: Callable[Drawn, Picture]) -> Callable[Drawn, Picture]:
    """Have a function draw in this style."""

    @functools.wraps(function)
    def draw(*arguments: Drawn.args, **options: Drawn.kwargs) -> Picture:
        with matplotlib.rc_context(RC):
            return function(*arguments, **options)

    return draw


def literal(text: str) -> str:
    """A text of a user or a file as matplotlib shows it letter by letter, without mathematics."""
    return printable(text).replace("$", r"\$")


@dataclass(frozen=True)
class Scale:
    """How an axis shows a quantity: the factor of the numbers, and the unit's text."""

    factor: float
    unit: str

    def label(self, name: str) -> str:
        """Text of an axis."""
        return f"{name} ({literal(self.unit)})" if self.unit else name

    def show(self, value: float) -> str:
        """A value with its unit, to four figures."""
        number = f"{self.factor * value:.4g}"
        if self.unit.startswith("10"):
            return f"{number} × {literal(self.unit)}"
        return f"{number} {literal(self.unit)}".rstrip()


def scale(peak: float, unit: str) -> Scale:
    """Scale for numbers up to `peak`: by thousands, unless they are near 1 as they are.

    Units that take prefixes take them (800 µs), others stand after the power (1.3, 10⁻³ in).
    """
    base, own = _PREFIXED.get(unit, ("", 0))
    power = 0
    if 1e-100 < peak < math.inf and not (1.0 if base else 0.1) <= peak < 1e4:
        power = 3 * math.floor(math.log10(peak) / 3.0)
    if base and power + own in _PREFIXES:
        return Scale(10.0**-power, _PREFIXES[power + own] + base)
    text = f"{unit[2:]}⁻¹" if unit.startswith("1/") else unit
    text = text.replace("*", "·").replace("^2", "²")
    return Scale(10.0**-power, f"{_power(power)} {text}".strip())


def _power(power: int) -> str:
    return f"10{str(power).translate(_SUPERSCRIPTS)}" if power else ""


def common_unit(results: Mapping[str, Result], dimension: str) -> str:
    """Unit of a dimension in all results; empty where one of them names none.

    Raises
    ------
    PlotError
        If the results have different units.
    """
    units = {name: result.unit(dimension) for name, result in results.items()}
    named = {unit: name for name, unit in units.items() if unit}
    if len(named) > 1:
        told = " and ".join(f"{unit} in {name}" for unit, name in named.items())
        raise PlotError(f"the results can't share axes: the unit of {dimension} is {told}")
    return "" if "" in units.values() else next(iter(named))


def scale_of(results: Mapping[str, Result], dimension: str, values: Iterable[Any]) -> Scale:
    """Scale for arrays of one dimension."""
    peak = max((float(abs(array).max()) for array in values if len(array)), default=0.0)
    return scale(peak, common_unit(results, dimension))


def panels(
    width: str, rows: int = 1, columns: int = 1, *, ratio: float, **options: Any
) -> tuple[Figure, list[Axes]]:
    """A figure of equal axes, each `ratio` as high as wide; row by row."""
    inches = WIDTHS[width]
    # Layout engines do not know how much room an axes of three dimensions takes.
    layout: Any = None if "subplot_kw" in options else "constrained"
    figure = Figure(figsize=(inches, inches * ratio * rows / columns), layout=layout)
    FigureCanvasAgg(figure)
    axes = figure.subplots(rows, columns, squeeze=False, **options)
    return figure, list(axes.ravel())


def legend(
    figure: Figure,
    handles: Sequence[Any],
    labels: Sequence[str],
    title: str = "",
    *,
    mathematics: bool = False,
) -> None:
    """A legend above the axes, never over data; labels are shown as they are, or as mathematics."""
    letters = max(map(len, labels), default=0)
    room = figure.get_figwidth() - (0.08 * len(title) if title else 0.0)
    columns = max(1, min(len(labels), int(room / (0.062 * letters + 0.45))))
    drawn = figure.legend(
        handles, labels, loc="outside upper center", ncols=columns, title=title or None,
        title_fontsize=7.0,
    )  # fmt: skip
    for text in drawn.get_texts():
        text.set_parse_math(mathematics)


def lines_legend(figure: Figure, axes: Axes, title: str = "") -> None:
    """The legend of an axes' labelled lines."""
    handles = [line for line in axes.get_lines() if not _unlabelled(str(line.get_label()))]
    legend(figure, handles, [str(line.get_label()) for line in handles], title)


def _unlabelled(label: str) -> bool:
    """Whether a line was drawn without a label for the legend."""
    return label == "_" or label.startswith("_child")
