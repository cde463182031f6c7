"""Pictures of indentation: a test and its fit, a path, rigidities (figures 3.2 to 3.19)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes

from fecm._typing import Floats
from fecm.deck.units import unit_of
from fecm.plot.kinds import Picture
from fecm.plot.style import (
    COLOURS,
    RATIO,
    STYLES,
    Scale,
    lines_legend,
    panels,
    scale,
    scale_in,
    styled,
)
from fecm.studies.indentation_test.constants import Fit
from fecm.studies.indentation_test.curves import FALLING, LOADING, RISING

LOOKS = {
    LOADING: (COLOURS[0], "first loading"),
    FALLING: (COLOURS[1], "unloading"),
    RISING: (COLOURS[2], "reloading"),
}
POINTS = 100


@styled
def fit_picture(
    indentation: Floats, force: Floats, found: Fit, units: Mapping[str, str]
) -> Picture:
    """Points of a test with the fitted curves, and permanent against largest indentation."""
    length, pound = scale_in(units, "length", indentation), scale_in(units, "force", force)
    both = len(found.cycles) > 1
    width = "full" if both else "column"
    figure, axes = panels(width, 1, 2 if both else 1, ratio=RATIO["column"])
    curves, p = found.solution.curves, found.solution.scaled
    seen: set[str] = set()
    for number in range(len(curves.division.stretches)):
        stretch = curves.division.stretches[number]
        colour, label = LOOKS[stretch.kind]
        a = indentation[stretch.rows]
        axes[0].plot(
            a, force[stretch.rows], ".", color=colour, alpha=0.5,
            markersize=3.0, markeredgewidth=0.0,
            label="_" if stretch.kind in seen else label,
        )  # fmt: skip
        seen.add(stretch.kind)
        if number in curves.numbers(stretch.kind) and len(a):
            top = float(a.max())
            if stretch.kind == FALLING:  # begin at the turning point
                top = max(top, found.solution.values[curves.layout.corners[stretch.begin]])
            x = np.linspace(max(0.0, a.min()), top, POINTS)
            y = curves.force * curves.stretch(p, number, x / curves.length)
            axes[0].plot(x, y, color=colour)
    length.name(axes[0].xaxis, "Indentation")
    pound.name(axes[0].yaxis, "Force")
    lines_legend(figure, axes[0])
    for handle in figure.legends[0].get_lines():
        handle.set(markersize=5.0, alpha=1.0)
    if both:
        _permanent(axes[1], found, length)
    return Picture(figure)


def _permanent(axes: Axes, found: Fit, length: Scale) -> None:
    """Permanent against largest indentation (figure 3.6)."""
    x = np.array([cycle.alpha_m.value for cycle in found.cycles])
    y = np.array([cycle.alpha_0.value for cycle in found.cycles])
    down = np.array([cycle.alpha_0.error for cycle in found.cycles])
    across = np.array([cycle.alpha_m.error for cycle in found.cycles])
    axes.errorbar(
        x, y, down, across, "o", color=COLOURS[0], markersize=3.0, linewidth=0.8, capsize=2.0
    )
    peaks = np.linspace(0.0, 1.05 * x.max(), 4 * POINTS)
    if (relation := found.relation()) is not None:
        left = np.asarray(relation.permanent(peaks))
        axes.plot(peaks, left, color=COLOURS[1])
    axes.set_xlim(left=0.0)
    length.name(axes.xaxis, "Largest indentation")
    length.name(axes.yaxis, "Permanent indentation")


@styled
def path_picture(indentation: Floats, force: Floats, units: Mapping[str, str]) -> Picture:
    """Force along an indentation path."""
    length, pound = scale_in(units, "length", indentation), scale_in(units, "force", force)
    figure, (axes,) = panels("column", ratio=RATIO["column"])
    axes.plot(indentation, force, color=COLOURS[0])
    length.name(axes.xaxis, "Indentation")
    pound.name(axes.yaxis, "Force")
    return Picture(figure)


@styled
def rigidity_picture(
    peaks: Floats, relations: Mapping[str, Floats], power: float, units: Mapping[str, str]
) -> Picture:
    """Unloading rigidity against largest indentation (figure 3.19).

    Drawn are the rigidities, force/length^power, of each relation at the `peaks`, (n,).
    """
    length = scale_in(units, "length", peaks)
    # The rigidity is unbounded towards zero: the deeper half sets the height of the axis.
    top = 3.0 * max(float(s[len(s) // 2 :].max()) for s in relations.values())
    stiff = scale(top, unit_of(f"force/length^{power:g}", dict(units)))
    figure, (axes,) = panels("column", ratio=RATIO["column"])
    for (name, values), colour, style in zip(relations.items(), COLOURS, STYLES, strict=False):
        axes.plot(peaks, values, color=colour, linestyle=style, label=name)
    axes.set_ylim(0.0, top)
    axes.set_xlim(left=0.0)
    length.name(axes.xaxis, "Largest indentation")
    stiff.name(axes.yaxis, "Unloading rigidity")
    lines_legend(figure, axes)
    return Picture(figure)
