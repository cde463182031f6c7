"""Nonlinear plates under static loads, by Newton's method with a given deflection.

Quarters of plates: x = 0 and y = 0 are lines of symmetry, so that the laminate must be cross-ply.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from fecm.mechanics.element_matrices import IntegrationRules
from fecm.mechanics.elements import gauss
from fecm.mechanics.interpolation import interpolate
from fecm.mechanics.laminate import LaminateSection
from fecm.mechanics.membrane import MembraneForces
from fecm.mechanics.mesh import MeshArrays
from fecm.mechanics.plate import PlateModel
from fecm.mechanics.points import patch_weights
from fecm.mechanics.solutions import tangent_stiffness
from tests.builders import Bools, Floats, mesh_on, nothing, with_restraints

Ints = NDArray[np.int32]
RULES = IntegrationRules(gauss(3), gauss(3), gauss(3), assumes_shear=True)


@dataclass
class Equilibrium:
    """A state of equilibrium."""

    load: float  # factor of the given load
    field: Floats  # (numnp, 5)
    energy: float  # strain energy of the whole plate
    deflection: float  # of the given weights


def quarter_mesh(a: float, b: float, n: int, m: int | None = None) -> tuple[Floats, Ints]:
    """Mesh a quarter of a rectangle a x b around the origin with n x m equal elements."""
    x, y = np.meshgrid(np.linspace(0.0, a / 2.0, n + 1), np.linspace(0.0, b / 2.0, (m or n) + 1))
    return mesh_on(np.stack([x, y], axis=-1), 9)


def disc_mesh(radius: float, n: int) -> tuple[Floats, Ints]:
    """Mesh a quarter of a circle with 3 n^2 elements, curved towards the rim.

    A square block in the centre, and one block between each of its outer sides and the rim.
    """
    fine = np.linspace(0.0, 1.0, 2 * n + 1)
    s, t = np.meshgrid(fine, fine)  # along rows and across them
    square = 0.5 * np.stack([s, t], axis=-1)
    angle = np.pi / 4.0 * t
    rim = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    side = 0.5 * np.stack([np.ones_like(t), t], axis=-1)
    right = (1.0 - s)[..., None] * side + s[..., None] * rim
    above = right[..., ::-1].swapaxes(0, 1)
    points = np.concatenate([block.reshape(-1, 2) for block in (square, right, above)])
    _, first, number = np.unique(
        points.round(9) + 0.0, axis=0, return_index=True, return_inverse=True
    )
    # Columns and rows of the nodes of an element on the fine grid.
    across = np.array([0, 2, 2, 0, 1, 2, 1, 0, 1])
    up = np.array([0, 0, 2, 2, 0, 1, 2, 1, 1])
    j, i = 2 * np.indices((n, n)).reshape(2, -1, 1)
    grids = number.ravel().reshape(3, 2 * n + 1, 2 * n + 1)
    elements = np.concatenate([grid[j + up, i + across] for grid in grids])
    return radius * points[first], (elements + 1).astype(np.int32)


def held(coordinates: Floats, edge: str, outside: tuple[Bools, Bools]) -> Bools:
    """Restrain a quarter: symmetry, and an edge such as ``"ss_immovable"`` where it is outside.

    `outside` says which nodes are on an edge of constant x, and on one of constant y.
    """
    kind, in_plane = edge.split("_")
    restrained = nothing(coordinates)
    for axis in (0, 1):
        symmetric = np.isclose(coordinates[:, axis], 0.0)
        restrained[symmetric, axis] = restrained[symmetric, 3 + axis] = True
        here = outside[axis]
        restrained[here, 2] = True
        restrained[here, 4 - axis] = True
        if kind == "clamped":
            restrained[here, 3 + axis] = True
        if in_plane != "movable":
            restrained[here, axis] = True
        if in_plane == "immovable":
            restrained[here, 1 - axis] = True
    return restrained


def rectangle(
    a: float, b: float, n: int, laminate: LaminateSection, edge: str, m: int | None = None
) -> PlateModel:
    """Build a quarter of a rectangular plate with an edge such as ``"clamped_immovable"``."""
    coordinates, elements = quarter_mesh(a, b, n, m)
    outside = (np.isclose(coordinates[:, 0], a / 2.0), np.isclose(coordinates[:, 1], b / 2.0))
    restrained = held(coordinates, edge, outside)
    return PlateModel(
        with_restraints(coordinates, elements, restrained), laminate, RULES, nonlinear=True
    )


def disc(radius: float, n: int, laminate: LaminateSection, edge: str) -> PlateModel:
    """Build a quarter of a circular plate; `edge` holds all directions or none of the rim."""
    coordinates, elements = disc_mesh(radius, n)
    rim = np.isclose(np.hypot(*coordinates.T), radius)
    none = np.zeros_like(rim)
    restrained = held(coordinates, edge, (none, none))
    kind, in_plane = edge.split("_")
    restrained[rim, 2] = True
    if kind == "clamped":
        restrained[rim, 3:] = True
    if in_plane == "immovable":
        restrained[rim, :2] = True
    return PlateModel(
        with_restraints(coordinates, elements, restrained), laminate, RULES, nonlinear=True
    )


def pressure(plate: PlateModel) -> Floats:
    """Nodal forces of a unit pressure, (numnp,)."""
    loads = np.zeros(len(plate.mesh.coordinates))
    for family in plate.families:
        at = interpolate(family, plate.rules.bending)
        np.add.at(loads, family.nodes, at.jxw @ at.N)
    return loads


def patch(plate: PlateModel, shape: str, radius: float) -> Floats:
    """Nodal forces on the quarter of a unit force on a circle about the origin, (numnp,)."""
    mesh = plate.mesh
    places, number, elements = _whole(mesh)
    whole = patch_weights(
        MeshArrays(places, elements, np.zeros((len(places), 5), np.int32),
                   np.zeros((len(places), 5)),
             np.ones((len(places), 5), np.int32)), shape, radius, 0.0, 0.0)  # fmt: skip
    share = np.where(np.isclose(mesh.coordinates, 0.0), 0.5, 1.0).prod(axis=1)
    return np.asarray(share * whole[number])


def _whole(mesh: MeshArrays) -> tuple[Floats, NDArray[np.intp], Ints]:
    """The plate of a quarter: its nodes, the quarter's among them, its elements."""
    orders = (
        (1, 1, (0, 1, 2, 3, 4, 5, 6, 7, 8)),
        (-1, -1, (0, 1, 2, 3, 4, 5, 6, 7, 8)),
        (-1, 1, (1, 0, 3, 2, 4, 7, 6, 5, 8)),
        (1, -1, (1, 0, 3, 2, 4, 7, 6, 5, 8)),
    )
    points = np.concatenate([mesh.coordinates * [i, j] for i, j, _ in orders])
    size = np.abs(points).max()
    _, first, number = np.unique(
        np.round(points / size, 9) + 0.0, axis=0, return_index=True, return_inverse=True
    )
    number = number.ravel().reshape(4, -1)
    elements = np.concatenate(
        [number[k][mesh.elements - 1][:, order] for k, (_, _, order) in enumerate(orders)]
    )
    return points[first], number[0], (elements + 1).astype(np.int32)


def equilibrium(
    plate: PlateModel,
    load: Floats,
    weights: Floats,
    deflection: float,
    start: Floats | None = None,
    steps: int = 1,
) -> Equilibrium:
    """Equilibrium in which the weighted sum of w has a value, under a multiple of a load.

    Load and weights are (numnp,).  Newton's method with the load's factor as an unknown.
    """
    free = plate.mesh.equations > 0
    membrane = MembraneForces(plate)
    K, support = plate.stiffness, plate.support
    fields = np.zeros((2, *free.shape))
    fields[0, :, 2], fields[1, :, 2] = load, weights
    P, c = fields[0][free], fields[1][free]
    prescribed = np.where(free, 0.0, plate.mesh.forces)
    of_supports = support @ plate.mesh.forces[~free] if (~free).any() else 0.0
    field = prescribed.copy() if start is None else start.copy()
    factor = 0.0
    for step in range(steps):
        goal = deflection * (step + 1) / steps
        for _ in range(40):
            forces, work = membrane.forces(field)
            residual = factor * P - K @ field[free] - of_supports - forces[free]
            factors = splu(tangent_stiffness(plate, field).tocsc(), permc_spec="MMD_AT_PLUS_A",
                           diag_pivot_thresh=0.0, options={"SymmetricMode": True})  # fmt: skip
            one, other = factors.solve(residual), factors.solve(P)
            change = (goal - c @ (field[free] + one)) / (c @ other)
            moved = one + change * other
            factor += change
            field[free] += moved
            # The next correction would be about the square of this one.
            if np.linalg.norm(moved) <= 1e-7 * np.linalg.norm(field[free]):
                break
        else:
            raise ArithmeticError("no equilibrium")
    forces, work = membrane.forces(field)
    u = field[free]
    energy = 0.5 * float(u @ (K @ u) + (field * forces).sum() - work)
    return Equilibrium(factor, field, 4.0 * energy, float(c @ u))


def with_preload(plate: PlateModel, n_x: float, n_y: float, n_xy: float = 0.0) -> PlateModel:
    """The plate with a uniform initial membrane force."""
    return replace(plate, preload=(n_x, n_y, n_xy))
