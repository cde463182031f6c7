"""Picture of ply stresses through the thickness of an element."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fecm._errors import ResultFileError, warn
from fecm._typing import Array, Floats
from fecm.mechanics.mesh import element_blocks, element_centres
from fecm.mechanics.points import containing_elements
from fecm.plot import style
from fecm.plot.data import check_on_plate, mesh_of, reach, require_datasets
from fecm.plot.kinds import Picture, PlotError, Width
from fecm.results.groups import NotStoredError
from fecm.results.plies import IN_PLANE, INTERLAMINAR, PlyResults, cure_stress_of, rows_at
from fecm.results.result import Result

THIN = 0.6  # line width of residual stresses
LARGE_RESIDUAL = 0.1  # residual, over the largest interlaminar stress, above which a note says so
# Weights of the lower, middle and upper value of a ply in a parabola through its thickness.
_PARTS = np.linspace(0.0, 1.0, 9)
_PARABOLA = np.stack(
    [(1 - _PARTS) * (1 - 2 * _PARTS), 4 * _PARTS * (1 - _PARTS), _PARTS * (2 * _PARTS - 1)]
)


class Stress(NamedTuple):
    """Stress through the thickness."""

    label: str
    z: Array  # (plies, n), from the midplane
    values: Array  # (plies, n)
    residual: Array | None = None  # residual stress of CURE, (plies, n); None without CURE


def thickness(
    results: Mapping[str, Result],
    *,
    at: Sequence[tuple[float, float]] = (),
    times: Sequence[float] = (),
    width: Width = "column",
) -> Picture:
    """Draw the stresses of the plies of one element over z, the struck face at the top.

    In-plane stresses are in the axes of each ply, interlaminar stresses in the axes of the plate.
    The last graph shows the resultant of the interlaminar stresses. sigma_z is not computed. A thin
    line shows the residual stress of CURE, which the other lines do not contain.

    `at` (length) has at most one place. It selects the nearest element with ply stresses, and the
    nearest point of this element. `times` (the deck's unit) has at most one time, which selects the
    nearest stored row. By default, both belong to the largest abs(sigma_1) outside the elements
    under the load.
    """
    ((name, result),) = results.items()
    plies, point = _select_plies(result, name, at, times)
    drawn = _stresses(plies, point, result)
    _warn_of_limits(result, name, plies)
    z = plies.z
    columns = 2 if width == "column" else 3
    lines = math.ceil(len(drawn) / columns)
    figure, axes = style.panels(width, lines, columns, sharey=True, ratio=1.8 / columns)
    place = style.scale_of(results, "length", [z])
    for ax, drawn_stress in zip(axes, drawn, strict=False):
        shown = (
            [drawn_stress.values]
            if drawn_stress.residual is None
            else [drawn_stress.values, drawn_stress.residual]
        )
        stress = style.scale_of(results, "force/length^2", shown)
        for face in np.unique(z[:, ::2]):
            ax.axhline(face, color="0.6", lw=0.4, ls=":")
        ax.axvline(0.0, color="0.6", lw=0.4)
        ax.plot(drawn_stress.values.ravel(), drawn_stress.z.ravel(), color=style.colours()[0])
        if drawn_stress.residual is not None:
            ax.plot(
                drawn_stress.residual.ravel(),
                drawn_stress.z.ravel(),
                color=style.colours()[1],
                lw=THIN,
            )
        stress.name(ax.xaxis, drawn_stress.label)
        ax.set_ylim(z[-1, 2], z[0, 0])
    for ax in axes[len(drawn) :]:
        ax.set_axis_off()
    for ax in axes[: len(drawn) : columns]:
        place.name(ax.yaxis, "$z$")
    clock = style.scale_of(results, "time", [plies.time])
    x, y = plies.x[0, point], plies.y[0, point]
    where = f"{x:.4g}, {y:.4g} {style.literal(result.units.get('length', ''))}".rstrip()
    time = clock.show(float(plies.time[0]))
    title = f"element {plies.element[0]} at {where}, time {time}"
    if drawn[0].residual is not None:
        title += "\nthin: residual stress (CURE)"
    figure.suptitle(title, fontsize=8.0)
    return Picture(figure)


def _stresses(plies: PlyResults, point: int, result: Result) -> list[Stress]:
    """Return the stresses at a point; interlaminar stresses only if they are computed."""
    faces = plies.z[:, ::2]
    residual: list[Array | None] = [None] * 3
    cured = cure_stress_of(result, int(plies.element[0]))
    if cured is not None:
        residual = list(np.moveaxis(cured[: len(plies.z)], -1, 0))
    xz, yz, z = (values @ _PARABOLA for values in (plies.tau_xz[0, 0], plies.tau_yz[0, 0], plies.z))
    stresses = [
        Stress(r"$\sigma_1$", faces, plies.sigma_1[0, 0, point], residual[0]),
        Stress(r"$\sigma_2$", faces, plies.sigma_2[0, 0, point], residual[1]),
        Stress(r"$\tau_{12}$", faces, plies.tau_12[0, 0, point], residual[2]),
    ]
    if np.isfinite([xz, yz]).all():
        stresses += [
            Stress(r"$\tau_{xz}$", z, xz),
            Stress(r"$\tau_{yz}$", z, yz),
            Stress(r"$(\tau_{xz}^2 + \tau_{yz}^2)^{1/2}$", z, np.hypot(xz, yz)),
        ]
    return stresses


def _select_plies(
    result: Result, name: str, at: Sequence[tuple[float, float]], times: Sequence[float]
) -> tuple[PlyResults, int]:
    """Return the plies of one element at one time, and the number of the point in it, from 0."""
    if len(at) > 1 or len(times) > 1:
        raise PlotError("the kind thickness shows one point at one time; give --at and --time once")
    sigma, stored, numbers, near = require_datasets(
        result,
        name,
        "plies/sigma_1",
        "plies/time",
        "plies/element",
        "plies/under_load",
        padded=True,
    )
    sigma = np.nan_to_num(sigma)
    mesh = mesh_of(result, name)
    outside = near == 0
    try:
        rows = rows_at(stored, times, "ply stresses") if times else np.arange(len(stored))
        largest = np.abs(sigma[rows]).max(axis=(3, 4))  # (rows, elements, points)
        largest_of_elements = largest.max(axis=(0, 2))  # (elements,)
        member = int(
            np.where(outside, largest_of_elements, -1.0).argmax()
            if outside.any()
            else largest_of_elements.argmax()
        )
        if at:
            member = _nearest_element(mesh, numbers, np.array(at[0]), name)
        row, point = np.unravel_index(largest[:, member].argmax(), largest[:, member].shape)
        plies = result.plies(float(stored[rows[row]]), int(numbers[member]))
    except NotStoredError as error:
        raise PlotError(f"{name} has {error}") from None
    except ResultFileError as error:
        raise PlotError(f"{name}: {error}") from None
    if at:
        point = np.hypot(plies.x[0] - at[0][0], plies.y[0] - at[0][1]).argmin()
    return _drop_missing_plies(plies), int(point)


def _drop_missing_plies(plies: PlyResults) -> PlyResults:
    """Return the plies of one element, without plies that only other laminates have."""
    if plies.z.ndim == 2:
        return plies
    z = plies.z[0]
    is_present = np.isfinite(z[:, 0])
    names = (*IN_PLANE, *INTERLAMINAR)
    return replace(
        plies, z=z[is_present], **{n: getattr(plies, n)[..., is_present, :] for n in names}
    )


def _nearest_element(mesh: tuple[Array, Floats], numbers: Array, at: Floats, name: str) -> int:
    """Return the position of the element that contains a place, or of the nearest one."""
    coordinates = mesh[1]
    elements = mesh[0][numbers - 1]
    check_on_plate(coordinates, at, name)
    distance = np.hypot(*(element_centres(elements, coordinates) - at).T)
    blocks = element_blocks(elements, coordinates)
    inside = np.concatenate(
        [block.rows[containing_elements(block, at[None])[0]] for block in blocks]
    )
    if len(inside):
        return int(inside[distance[inside].argmin()])
    nearest = int(distance.argmin())
    warn(
        f"{name} has no ply stresses at {at[0]:g},{at[1]:g}; the nearest element with ply stresses "
        f"is {numbers[nearest]}, its centre {distance[nearest]:.3g} away"
    )
    return nearest


def _warn_of_limits(result: Result, name: str, plies: PlyResults) -> None:
    """Warn of limits of the stresses of an element."""
    element = f"element {plies.element[0]} of {name}"
    if plies.under_load[0]:
        near = reach(result, name, 2.0 * float(plies.z[-1, 2]))
        warn(f"{element} is within {near:.3g} of the load, where plate theory does not hold")
    tau = np.abs([plies.tau_xz, plies.tau_yz]).max()
    residual = np.abs(plies.residual).max()
    if np.isnan(tau):
        warn(f"{element} does not have nine nodes: it has no interlaminar stresses")
    elif residual > LARGE_RESIDUAL * tau:
        warn(
            f"at z = h/2 of {element} equilibrium leaves {residual / tau:.0%} of the largest "
            "interlaminar stress, which is removed linearly in z: in-plane supports act there, or "
            "the mesh is coarse"
        )
