"""Pictures of surface strains against time (the report's figures 4.12 to 4.17)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from fecm._errors import warn
from fecm._typing import Array
from fecm.deck.model import Material
from fecm.plot import data, style
from fecm.plot.histories import time_axis
from fecm.plot.kinds import Face, Picture, PlotError, Width
from fecm.results.result import Result

Results = Mapping[str, Result]
AXES = {0.0: "x", 90.0: "y"}  # names of directions (degrees)


def strain(
    results: Results,
    *,
    at: Sequence[tuple[float, float]] = (),
    gages: Sequence[float] = (0.0, 90.0),
    face: Face = "far",
    width: Width = "column",
) -> Picture:
    """Surface strain z κ, or curvature, in given directions at given points against time.

    At an angle θ from the x-axis κ = κx cos² θ + κy sin² θ + κxy sin θ cos θ, with the engineering
    twist κxy.  At a node it is the mean of the adjacent elements.

    The points `at` (length) are by default the one with the largest bending strain outside the
    load; `gages` are degrees from the x-axis; `face` is ``"far"`` (z = h/2), ``"struck"``
    (z = -h/2), or ``"curvature"``.
    """
    lines: dict[str, tuple[Array, Array]] = {}
    for name, result in results.items():
        for label, values in _strains(result, name, at, gages, face).items():
            text = f"{name}, {label}" if len(results) > 1 else label
            lines[text] = data.require(result, name, "tape8/time")[0], values
    if len(lines) > len(style.COLOURS):
        raise PlotError(
            f"{len(lines)} lines can't be told apart in one picture; ask for fewer points, "
            f"directions or results, at most {len(style.COLOURS)} in all"
        )
    times, values_of = zip(*lines.values(), strict=True)
    if face == "curvature":
        shown, name = style.scale_of(results, "1/length", values_of), "Curvature"
    else:
        stretches = any(map(_may_stretch, results.values()))
        what = "Bending strain" if stretches else "Strain"
        shown, name = style.scale(style.peak(*values_of), ""), f"{what}, {face} face"
    figure, (axes,) = style.panels(width)
    for (label, (time, values)), colour in zip(lines.items(), style.colours(), strict=False):
        axes.plot(time, values, color=colour, label=label)
    shown.name(axes.yaxis, name)
    time_axis(axes, style.scale_of(results, "time", times), times)
    style.lines_legend(figure, axes)
    return Picture(figure)


def _strains(
    result: Result, name: str, at: Sequence[tuple[float, float]], gages: Sequence[float], face: Face
) -> dict[str, Array]:
    """Histories of one result, by point and direction."""
    columns = data.require(result, name, "tape8/kappa_x", "tape8/kappa_y", "tape8/kappa_xy")
    points = data.strain_points(result, name)
    layers = data.deck_of(result, name).require(Material).layers
    thickness = sum(layer.thickness for layer in layers)
    places = [np.array(place) for place in at]
    if not places:
        outside = _distance(result, name, points) >= data.reach(result, name, thickness)
        places = [_most_strained(columns, points, outside)]
    match face:
        case "curvature":
            symbol, height = "κ", 1.0
        case "far":
            symbol, height = "ε", thickness / 2.0
        case _:
            symbol, height = "ε", -thickness / 2.0
    if face != "curvature" and _may_stretch(result):
        warn(
            f"the midplane of {name} may stretch; its strains are not stored, and the picture "
            "shows those of bending alone"
        )
    found: dict[str, Array] = {}
    for place in places:
        there = data.nearest(points, place, name)
        x, y = points[there].mean(axis=0)
        kappa_x, kappa_y, kappa_xy = (column[:, there].mean(axis=1) for column in columns)
        for angle in gages:
            c, s = np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))
            values = height * (c * c * kappa_x + s * s * kappa_y + s * c * kappa_xy)
            direction = AXES.get(angle, f" {angle:g}°")
            found[f"{symbol}{direction} at {x:.4g}, {y:.4g}"] = values
    return found


def _may_stretch(result: Result) -> bool:
    """Whether a point of the midplane can move in the plane."""
    return bool(result["mesh/equations"][:, :2].any())


def _distance(result: Result, name: str, points: Array) -> Array:
    """Distance of points, (..., 2), from the load; infinite without a load."""
    load = data.struck(result, name)
    if not len(load):
        return np.full(points.shape[:-1], np.inf)
    return np.asarray(np.hypot(*np.moveaxis(points - load[0], -1, 0)))


def _most_strained(curvatures: Sequence[Array], points: Array, outside: Array) -> Array:
    """Place, (2,), of the largest principal curvature of all rows, outside the load if possible.

    Of equal ones, as of a symmetric plate, the place with the largest x, then y.
    """
    x, y, xy = curvatures
    largest = (np.abs(x + y) + np.hypot(x - y, xy)).max(axis=0)
    if outside.any():
        largest = np.where(outside, largest, -1.0)
    equal = largest >= largest.max() * (1.0 - 1e-9)
    return np.array(max(points[equal].round(12).tolist()))
