"""Pictures of small results, and what their axes and legends hold."""

from __future__ import annotations

from typing import Any

import fecm
from fecm import Result
from fecm._typing import Array
from fecm.plot.kinds import KINDS, Shows
from fecm.plot.pictures import draw
from tests.decks import DATA_CARDS, PROGRAM, small

OF_RUNS = [name for name, kind in KINDS.items() if kind.shows in (Shows.RUN, Shows.RUNS)]

NAMED = small(data=DATA_CARDS + "UNIT\nin lbf s\n")


# As many steps as the contact lasts, and some more.
LONG_PROGRAM = PROGRAM.replace(" 10\n", "330\n")


def run(deck: str) -> Result:
    """Result of a deck of one problem."""
    return fecm.run_one(deck)


def plot(result: Result, kind: str, **options: Any) -> Any:
    """The command line's figure of one result."""
    return draw(kind, {"the result": result}, **options).figure


def lines(axes: Any) -> dict[str, tuple[Array, Array]]:
    """Data of an axes' lines by their labels."""
    return {line.get_label(): line.get_data() for line in axes.get_lines()}


def ticks(axis: Any) -> list[tuple[float, str]]:
    """Places and texts of the ticks of an axis."""
    texts = [text.get_text() for text in axis.get_ticklabels()]
    return list(zip(axis.get_ticklocs().tolist(), texts, strict=True))


def legend_of(figure: Any) -> list[str]:
    """Texts of a figure's legend."""
    return [text.get_text() for text in figure.legends[0].get_texts()]


def footer_of(figure: Any) -> str:
    """Text below a figure, which ends within it; empty if there is none."""
    text = figure._supxlabel
    if text is None:
        return ""
    figure.draw_without_rendering()
    box = text.get_window_extent()
    assert box.x0 >= 0.0
    assert box.x1 <= figure.bbox.x1
    return str(text.get_text())


def legend_of_axes(axes: Any) -> list[str]:
    """Texts of the legend in an axes."""
    return [text.get_text() for text in axes.get_legend().get_texts()]
