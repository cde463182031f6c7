"""Pictures against time, and force against indentation (the report's figures 4.12 to 4.19)."""

from __future__ import annotations

import textwrap
import warnings
from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from fecm.deck.model import Material
from fecm.plot.data import Array, deck_of, impact_point, nearest, require, strain_points
from fecm.plot.kinds import Picture, PlotError, PlotNote
from fecm.plot.pictures import Options
from fecm.plot.style import (
    COLOURS,
    RATIO,
    STYLES,
    WIDTHS,
    legend,
    lines_legend,
    panels,
    scale,
    scale_of,
)
from fecm.results.result import Result

Results = Mapping[str, Result]

# Letters of a small text that an inch holds.
LETTERS = 16

ENERGIES = {
    "plate_kinetic": "plate, kinetic",
    "plate_strain": "plate, strain",
    "projectile_kinetic": "projectile, kinetic",
    "projectile_strain": "projectile, strain",
    "contact_work": "indentation",
}


def _within(results: Results, most: int, what: str) -> None:
    if len(results) > most:
        raise PlotError(f"{what} of more than {most} results can't be told apart in one picture")


def _time_axis(axes: Axes, label: str, times: list[Array], factor: float) -> None:
    axes.set_xlabel(label)
    axes.set_xlim(0.0, factor * max(float(array[-1]) for array in times))


def _mark_open_ends(axes: Axes, results: Results, options: Options) -> None:
    """Say above a graph that contacts last to the end; of which results, if not of all."""
    named = [name for name, result in results.items() if result.still_in_contact]
    if named:
        which = f" ({', '.join(named)})" if len(named) < len(results) else ""
        width = int(LETTERS * WIDTHS[options.width])
        text = textwrap.fill(f"still in contact at the end{which}", width)
        axes.set_title(text, loc="right", fontsize=7.0).set_parse_math(False)


def force(results: Results, options: Options) -> Picture:
    """Contact force and transducer against time; of several results, one above the other."""
    _within(results, len(COLOURS), "forces")
    paths = ("history/time", "history/force", "history/transducer")
    data = {name: require(result, name, *paths) for name, result in results.items()}
    times = [columns[0] for columns in data.values()]
    clock = scale_of(results, "time", times)
    pound = scale_of(results, "force", [c for columns in data.values() for c in columns[1:]])
    if len(data) == 1:
        figure, axes = panels(options.width, ratio=RATIO[options.width])
        ((time, contact, transducer),) = data.values()
        for values, label, colour in (
            (contact, "contact force", COLOURS[0]),
            (transducer, "transducer", COLOURS[1]),
        ):
            axes[0].plot(clock.factor * time, pound.factor * values, color=colour, label=label)
        axes[0].set_ylabel(pound.label("Force"))
    else:
        figure, axes = panels(
            options.width, 2, sharex=True, sharey=True, ratio=0.65 * RATIO[options.width]
        )
        for (name, (time, *both)), colour in zip(data.items(), COLOURS, strict=False):
            for ax, values in zip(axes, both, strict=True):
                ax.plot(clock.factor * time, pound.factor * values, color=colour, label=name)
        for ax, label in zip(axes, ("Contact force", "Transducer"), strict=True):
            ax.set_ylabel(pound.label(label))
    _time_axis(axes[-1], clock.label("Time"), times, clock.factor)
    _mark_open_ends(axes[0], results, options)
    lines_legend(figure, axes[0])
    return Picture(figure)


def loop(results: Results, options: Options) -> Picture:
    """Contact force against indentation, from the start at rest on."""
    _within(results, len(COLOURS), "loops")
    paths = ("history/indentation", "history/force")
    data = {
        name: [np.concatenate(([0.0], column)) for column in require(result, name, *paths)]
        for name, result in results.items()
    }
    length = scale_of(results, "length", [a.clip(min=0.0) for a, _ in data.values()])
    pound = scale_of(results, "force", [f for _, f in data.values()])
    figure, (axes,) = panels(options.width, ratio=1.2 * RATIO[options.width])
    for (name, (indentation, values)), colour in zip(data.items(), COLOURS, strict=False):
        axes.plot(length.factor * indentation, pound.factor * values, color=colour, label=name)
    deepest = max(float(indentation.max()) for indentation, _ in data.values())
    if deepest > 0.0:
        # Where the bodies are apart there is no force, and nothing to see.
        axes.set_xlim(0.0, 1.05 * length.factor * deepest)
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel(length.label("Indentation"))
    axes.set_ylabel(pound.label("Contact force"))
    _mark_open_ends(axes, results, options)
    if len(data) > 1:
        lines_legend(figure, axes)
    return Picture(figure)


def energy(results: Results, options: Options) -> Picture:
    """Energies of plate, projectile and indentation, and their sum; a line style a result."""
    _within(results, len(STYLES), "energies")
    paths = ("energy/time", *(f"energy/{column}" for column in ENERGIES))
    data = {name: require(result, name, *paths) for name, result in results.items()}
    times = [columns[0] for columns in data.values()]
    clock = scale_of(results, "time", times)
    work = scale_of(results, "force*length", [c for columns in data.values() for c in columns[1:]])
    figure, (axes,) = panels(options.width, ratio=1.1 * RATIO[options.width])
    for (time, *columns), style in zip(data.values(), STYLES, strict=False):
        for values, colour in zip(columns, COLOURS, strict=False):
            axes.plot(clock.factor * time, work.factor * values, color=colour, ls=style)
        axes.plot(clock.factor * time, work.factor * np.sum(columns, axis=0), color="0.5", ls=style)
    axes.set_ylim(bottom=0.0)
    axes.set_ylabel(work.label("Energy"))
    _mark_open_ends(axes, results, options)
    _time_axis(axes, clock.label("Time"), times, clock.factor)
    handles = [Line2D([], [], color=c) for c in (*COLOURS[: len(ENERGIES)], "0.5")]
    labels = [*ENERGIES.values(), "sum"]
    if len(data) > 1:
        handles += [Line2D([], [], color="0.3", ls=style) for style in STYLES[: len(data)]]
        labels += list(data)
    legend(figure, handles, labels)
    return Picture(figure)


def strain(results: Results, options: Options) -> Picture:
    """Surface strain z κ, or curvature, in given directions at given points against time.

    In a direction at the angle θ from the x-axis κ = κx cos² θ + κy sin² θ + κxy sin θ cos θ, as
    κxy is an engineering twist.  At a node it is the mean of the elements that meet there.
    """
    lines: dict[str, tuple[Array, Array]] = {}
    several = len(results) > 1
    for name, result in results.items():
        for label, values in _strains(result, name, options).items():
            text = f"{name}, {label}" if several else label
            lines[text] = (require(result, name, "tape8/time")[0], values)
    if len(lines) > len(COLOURS):
        raise PlotError(
            f"{len(lines)} lines can't be told apart in one picture; ask for fewer points, "
            f"directions or results, {len(COLOURS)} at the most in all"
        )
    times = [time for time, _ in lines.values()]
    clock = scale_of(results, "time", times)
    figure, (axes,) = panels(options.width, ratio=RATIO[options.width])
    if options.face == "curvature":
        shown = scale_of(results, "1/length", [values for _, values in lines.values()])
        axes.set_ylabel(shown.label("Curvature"))
    else:
        shown = scale(max(float(abs(values).max()) for _, values in lines.values()), "")
        axes.set_ylabel(shown.label(f"Strain, {options.face} face"))
    for (label, (time, values)), colour in zip(lines.items(), COLOURS, strict=False):
        axes.plot(clock.factor * time, shown.factor * values, color=colour, label=label)
    _time_axis(axes, clock.label("Time"), times, clock.factor)
    lines_legend(figure, axes)
    return Picture(figure)


def _strains(result: Result, name: str, options: Options) -> dict[str, Array]:
    """Histories of one result, by point and direction."""
    columns = require(result, name, "tape8/kappa_x", "tape8/kappa_y", "tape8/kappa_xy")
    points = strain_points(result, name)
    places = [np.array(at) for at in options.at] or [impact_point(result, name)[:2]]
    height = 1.0
    if options.face != "curvature":
        thickness = sum(a.thickness for a in deck_of(result, name).require(Material).layers)
        height = thickness / 2.0 if options.face == "far" else -thickness / 2.0
        if result["mesh/equations"][:, :2].any():
            warnings.warn(
                f"the midplane of {name} may stretch; its strains are not stored, and the "
                "picture shows those of bending alone",
                PlotNote,
                stacklevel=2,
            )
    found: dict[str, Array] = {}
    for at in places:
        there = nearest(points, at, name)
        x, y = points[there].mean(axis=0)
        kappa_x, kappa_y, kappa_xy = (column[:, there].mean(axis=1) for column in columns)
        where = f" at {x:.4g}, {y:.4g}"
        for angle in options.gages:
            c, s = np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))
            values = height * (c * c * kappa_x + s * s * kappa_y + s * c * kappa_xy)
            found[_direction(angle) + where] = values
    return found


def _direction(angle: float) -> str:
    """Direction of strain in a legend."""
    return {0.0: "x", 90.0: "y"}.get(angle, f"{angle:g}°")
