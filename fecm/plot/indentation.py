"""Pictures of indentation: a test and its fit, a path, rigidities (figures 3.2 to 3.19)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes

from fecm._typing import Floats
from fecm.deck.units import unit_of
from fecm.plot.kinds import Picture
from fecm.plot.style import COLOURS, RATIO, STYLES, Scale, lines_legend, panels, scale, styled
from fecm.studies.indentation_test.constants import Fit
from fecm.studies.indentation_test.cycles import FALLING, LOADING, RISING

LOOKS = {
    LOADING: (COLOURS[0], "first loading"),
    FALLING: (COLOURS[1], "unloading"),
    RISING: (COLOURS[2], "reloading"),
}
POINTS = 100


def _scale(values: Floats, dimension: str, units: Mapping[str, str]) -> Scale:
    top = float(np.abs(values[np.isfinite(values)]).max(initial=0.0))
    return scale(top, unit_of(dimension, dict(units)))


@styled
def fit_picture(
    indentation: Floats, force: Floats, found: Fit, units: Mapping[str, str]
) -> Picture:
    """A test's points with the fitted curves, and permanent against largest indentation.

    Parameters
    ----------
    indentation, force : ndarray (n,)
    found : Fit
    units : mapping
        Names of the units; empty where there are none.
    """
    length, pound = _scale(indentation, "length", units), _scale(force, "force", units)
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
            length.factor * a, pound.factor * force[stretch.rows], ".", color=colour, alpha=0.5,
            markersize=3.0, markeredgewidth=0.0,
            label="_" if stretch.kind in seen else label,
        )  # fmt: skip
        seen.add(stretch.kind)
        if number in curves.numbers(stretch.kind) and len(a):
            top = float(a.max())
            if stretch.kind == FALLING:  # from the turn itself, which is no point of the stretch
                top = max(top, found.solution.values[curves.layout.corners[stretch.begin]])
            x = np.linspace(max(0.0, a.min()), top, POINTS)
            y = curves.force * curves.stretch(p, number, x / curves.length)
            axes[0].plot(length.factor * x, pound.factor * y, color=colour)
    axes[0].set_xlabel(length.label("Indentation"))
    axes[0].set_ylabel(pound.label("Force"))
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
    by = length.factor
    axes.errorbar(
        by * x, by * y, by * down, by * across, "o",
        color=COLOURS[0], markersize=3.0, linewidth=0.8, capsize=2.0,
    )  # fmt: skip
    peaks = np.linspace(0.0, 1.05 * x.max(), 4 * POINTS)
    if (relation := found.relation()) is not None:
        left = np.asarray(relation.permanent(peaks))
        axes.plot(length.factor * peaks, length.factor * left, color=COLOURS[1])
    axes.set_xlim(left=0.0)
    axes.set_xlabel(length.label("Largest indentation"))
    axes.set_ylabel(length.label("Permanent indentation"))


@styled
def path_picture(indentation: Floats, force: Floats, units: Mapping[str, str]) -> Picture:
    """Force along an indentation path."""
    length, pound = _scale(indentation, "length", units), _scale(force, "force", units)
    figure, axes = panels("column", ratio=RATIO["column"])
    axes[0].plot(length.factor * indentation, pound.factor * force, color=COLOURS[0])
    axes[0].set_xlabel(length.label("Indentation"))
    axes[0].set_ylabel(pound.label("Force"))
    return Picture(figure)


@styled
def rigidity_picture(
    peaks: Floats, relations: Mapping[str, Floats], power: float, units: Mapping[str, str]
) -> Picture:
    """Unloading rigidity against largest indentation (figure 3.19).

    Parameters
    ----------
    peaks : ndarray (n,)
        Largest indentations (length).
    relations : mapping of str to ndarray (n,)
        Rigidities, force/length^power, by what the legend calls them.
    power : float
        q.
    units : mapping
        Names of the units.
    """
    length = _scale(peaks, "length", units)
    # The rigidity grows without bound towards zero: the deepest half says how high the axis is.
    top = 3.0 * max(float(s[len(s) // 2 :].max()) for s in relations.values())
    raised = f"{power:g}".translate(str.maketrans("0123456789.", "⁰¹²³⁴⁵⁶⁷⁸⁹·"))
    unit = unit_of(f"force/length{raised}", dict(units))
    stiff = Scale(scale(top, "").factor, f"{scale(top, '').unit} {unit}".strip())
    figure, axes = panels("column", ratio=RATIO["column"])
    for (name, values), colour, style in zip(relations.items(), COLOURS, STYLES, strict=False):
        axes[0].plot(
            length.factor * peaks, stiff.factor * values, color=colour, linestyle=style, label=name
        )
    axes[0].set_ylim(0.0, stiff.factor * top)
    axes[0].set_xlim(left=0.0)
    axes[0].set_xlabel(length.label("Largest indentation"))
    axes[0].set_ylabel(stiff.label("Unloading rigidity"))
    lines_legend(figure, axes[0])
    return Picture(figure)
