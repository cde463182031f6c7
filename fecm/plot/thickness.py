"""Stresses through the thickness of one element."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from fecm._errors import warn
from fecm._typing import Floats
from fecm.mechanics.element_groups import element_blocks, element_centres
from fecm.mechanics.locate import locate
from fecm.plot.data import Array, circle, mesh_of, on_plate, require, struck
from fecm.plot.kinds import Picture, PlotError
from fecm.plot.style import colours, literal, panels, scale_of
from fecm.results.plies import Plies, rows_at
from fecm.results.result import Result
from fecm.results.schema import NotStoredError, ResultFileError

STRESS = "force/length^2"
LARGE_RESIDUAL = 0.1  # over the largest interlaminar stress: a note says so
# A parabola through the lower, middle and upper value of a ply, at some parts of its thickness.
_PARTS = np.linspace(0.0, 1.0, 9)
_PARABOLA = np.stack(
    [(1 - _PARTS) * (1 - 2 * _PARTS), 4 * _PARTS * (1 - _PARTS), _PARTS * (2 * _PARTS - 1)]
)


def thickness(
    results: Mapping[str, Result],
    *,
    at: Sequence[tuple[float, float]] = (),
    times: Sequence[float] = (),
    width: str = "column",
) -> Picture:
    """Stresses of the plies of one element over z, the struck face at the top.

    In-plane stresses are in the axes of each ply, interlaminar ones in those of the plate; the last
    graph is the resultant of these.  sigma_z is not computed.

    Of `at` (length) at most one place selects the nearest element with ply stresses, and its
    nearest point; of `times` (the deck's unit) at most one the nearest stored row.  By default both
    are those of the largest abs(sigma_1).
    """
    ((name, result),) = results.items()
    plies, point = _chosen(result, name, at, times)
    z = plies.z
    drawn = {
        label: (z[:, ::2], values[0, 0, point])
        for label, values in (
            (r"$\sigma_1$", plies.sigma_1), (r"$\sigma_2$", plies.sigma_2),
            (r"$\tau_{12}$", plies.tau_12),
        )
    }  # fmt: skip
    xz, yz, depth = (values @ _PARABOLA for values in (plies.tau_xz[0, 0], plies.tau_yz[0, 0], z))
    if np.isfinite([xz, yz]).all():
        drawn[r"$\tau_{xz}$"], drawn[r"$\tau_{yz}$"] = (depth, xz), (depth, yz)
        drawn[r"$(\tau_{xz}^2 + \tau_{yz}^2)^{1/2}$"] = depth, np.hypot(xz, yz)
    _warn(result, name, plies, point)
    columns = 2 if width == "column" else 3
    figure, axes = panels(
        width, math.ceil(len(drawn) / columns), columns, sharey=True, ratio=1.8 / columns
    )
    place = scale_of(results, "length", [z])
    for ax, (label, (levels, values)) in zip(axes, drawn.items(), strict=False):
        stress = scale_of(results, STRESS, [values])
        for face in np.unique(z[:, ::2]):
            ax.axhline(face, color="0.6", lw=0.4, ls=":")
        ax.axvline(0.0, color="0.6", lw=0.4)
        ax.plot(values.ravel(), levels.ravel(), color=colours()[0])
        stress.name(ax.xaxis, label)
        ax.set_ylim(z[-1, 2], z[0, 0])
    for ax in axes[len(drawn) :]:
        ax.set_axis_off()
    for ax in axes[: len(drawn) : columns]:
        place.name(ax.yaxis, "$z$")
    clock = scale_of(results, "time", [plies.time])
    x, y = plies.x[0, point], plies.y[0, point]
    where = f"{x:.4g}, {y:.4g} {literal(result.unit('length'))}".rstrip()
    figure.suptitle(
        f"element {plies.element[0]} at {where}, time {clock.show(float(plies.time[0]))}",
        fontsize=8.0,
    )
    return Picture(figure)


def _chosen(
    result: Result, name: str, at: Sequence[tuple[float, float]], times: Sequence[float]
) -> tuple[Plies, int]:
    """Plies of one element at one time, and the number of the point in it, from 0."""
    if len(at) > 1 or len(times) > 1:
        raise PlotError("the kind thickness shows one point at one time; give --at and --time once")
    sigma, stored, numbers = require(result, name, "plies/sigma_1", "plies/time", "plies/element")
    mesh = mesh_of(result, name)
    try:
        rows = rows_at(stored, times, "ply stresses") if times else np.arange(len(stored))
        largest = np.abs(sigma[rows]).max(axis=(3, 4))  # (rows, elements, points)
        member = (
            _nearest_element(mesh, numbers, np.array(at[0]), name)
            if at else int(largest.max(axis=(0, 2)).argmax())
        )  # fmt: skip
        row, point = np.unravel_index(largest[:, member].argmax(), largest[:, member].shape)
        plies = result.plies(float(stored[rows[row]]), int(numbers[member]))
    except NotStoredError as error:
        raise PlotError(f"{name} has {error}") from None
    except ResultFileError as error:
        raise PlotError(f"{name}: {error}") from None
    if at:
        point = np.hypot(plies.x[0] - at[0][0], plies.y[0] - at[0][1]).argmin()
    return plies, int(point)


def _nearest_element(mesh: tuple[Array, Floats], numbers: Array, at: Floats, name: str) -> int:
    """Position of the element that contains a place, or else of the one with the nearest centre."""
    coordinates = mesh[1]
    elements = mesh[0][numbers - 1]
    on_plate(coordinates, at, name)
    distance = np.hypot(*(element_centres(elements, coordinates) - at).T)
    blocks = element_blocks(elements, coordinates)
    inside = np.concatenate([block.rows[locate(block, at[None])[0]] for block in blocks])
    if len(inside):
        return int(inside[distance[inside].argmin()])
    nearest = int(distance.argmin())
    warn(
        f"{name} has no ply stresses at {at[0]:g},{at[1]:g}; the nearest element with ply stresses "
        f"is {numbers[nearest]}, its centre {distance[nearest]:.3g} away"
    )
    return nearest


def _warn(result: Result, name: str, plies: Plies, point: int) -> None:
    """Say what limits the stresses of an element."""
    element, patch = f"element {plies.element[0]} of {name}", circle(result, name)
    reach = plies.z[-1, 2] + (0.0 if patch is None else patch[1])
    distance = np.hypot(*(struck(result, name) - [plies.x[0, point], plies.y[0, point]]).T)
    if plies.under_load[0] or (distance < reach).any():
        warn(f"{element} is within {reach:.3g} of the load, where plate theory does not hold")
    tau = np.abs([plies.tau_xz, plies.tau_yz]).max()
    if np.isnan(tau):
        warn(f"{element} does not have nine nodes: it has no interlaminar stresses")
        return
    residual = np.abs(plies.residual).max()
    if residual > LARGE_RESIDUAL * tau:
        warn(
            f"at z = h/2 of {element} equilibrium leaves {residual / tau:.0%} of the largest "
            "interlaminar stress, which is removed linearly in z: in-plane supports act there, or "
            "the mesh is coarse"
        )
