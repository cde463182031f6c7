"""Scenes for the tests: reference tables, plies and laminates, meshes, restraints."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fecm import Ply
from fecm.mechanics.element_matrices import IntegrationRules
from fecm.mechanics.elements import gauss
from fecm.mechanics.laminate import LaminateSection, laminate
from fecm.mechanics.mesh import MeshArrays
from fecm.mechanics.projectile import RodState

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Bools = NDArray[np.bool_]
Corners = tuple[tuple[float, float], ...]

DATA = Path(__file__).parent / "data"


def table(name: str) -> list[dict[str, str]]:
    """Rows of a reference file, by its header's names."""
    with (DATA / name).open(newline="") as file:
        return list(csv.DictReader(file))


# Laminates ---------------------------------------------------------------------------------------

REPORT_PLY = Ply(density=0.000148, nu12=0.3, e1=17.5e6, e2=1.15e6, g12=0.8e6, g13=0.8e6, g23=0.8e6)
REPORT_LAYER = 0.0053
# [0/45/0/-45/0]2s
_HALF = 2 * (0.0, 45.0, 0.0, -45.0, 0.0)
REPORT_ANGLES = _HALF + _HALF[::-1]

# A ply with five different moduli, and a stack in which it leaves no entry of A, B, D zero.
GENERAL_PLY = Ply(density=1.5, nu12=0.3, e1=20.0, e2=1.5, g12=0.9, g13=0.8, g23=0.5)
GENERAL_ANGLES = (0.0, 30.0, 70.0)
GENERAL_LAYERS = (0.1, 0.05, 0.15)


def report_plate() -> LaminateSection:
    """The report's graphite/epoxy plate of 20 layers."""
    return laminate(REPORT_PLY, REPORT_ANGLES, [REPORT_LAYER] * len(REPORT_ANGLES))


def general_plate(turned: float = 0.0) -> LaminateSection:
    """Stack the general laminate, its fibres turned counter-clockwise by some degrees."""
    return laminate(GENERAL_PLY, [angle + turned for angle in GENERAL_ANGLES], GENERAL_LAYERS)


def isotropic_ply(shear_factor: float = 1.0) -> Ply:
    """E = 1, nu = 0.3, density 1; the factor reduces the transverse shear moduli alone."""
    g = 1.0 / 2.6
    return Ply(
        density=1.0, nu12=0.3, e1=1.0, e2=1.0, g12=g, g13=shear_factor * g, g23=shear_factor * g
    )


def isotropic_plate(thickness: float, shear_factor: float = 1.0) -> LaminateSection:
    """One layer of the isotropic ply."""
    return laminate(isotropic_ply(shear_factor), [0.0], [thickness])


def turned_stiffness(ply: Ply, angle: float) -> Floats:
    """Plane-stress stiffness seen from axes to which the fibres lie at `angle` degrees, (3, 3).

    The compliance of the engineering constants is inverted and turned as a tensor of fourth order.
    """
    compliance = np.array(
        [
            [1.0 / ply.e1, -ply.nu12 / ply.e1, 0.0],
            [-ply.nu12 / ply.e1, 1.0 / ply.e2, 0.0],
            [0.0, 0.0, 1.0 / ply.g12],
        ]
    )
    c, s = np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))
    turn = np.array([[c, -s], [s, c]])  # columns: the ply's axes in the laminate's
    voigt = np.array([[0, 2], [2, 1]])
    tensor = np.linalg.inv(compliance)[voigt[:, :, None, None], voigt]
    tensor = np.einsum("ia,jb,kc,ld,abcd->ijkl", turn, turn, turn, turn, tensor)
    first, second = np.array([0, 1, 0]), np.array([0, 1, 1])
    return np.asarray(tensor[first[:, None], second[:, None], first, second])


# Meshes ------------------------------------------------------------------------------------------

SQUARE: Corners = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))
# No side is parallel to another or to an axis.
SKEWED: Corners = ((0.0, 0.0), (2.1, 0.3), (1.7, 1.9), (-0.4, 1.2))
PARALLELOGRAM: Corners = ((0.0, 0.0), (1.3, 0.4), (0.8, 1.3), (-0.5, 0.9))


# Places of an element's nodes on the grid of its mid-sides, and of its third points.
_HALVES = ((0, 2, 2, 0, 1, 2, 1, 0, 1), (0, 0, 2, 2, 0, 1, 2, 1, 1))
_THIRDS = ((0, 3, 3, 0, 1, 3, 2, 0, 0, 2, 3, 1), (0, 0, 3, 3, 0, 1, 3, 2, 1, 0, 2, 3))
# Third points that are absent from every element of a mesh, so that neighbours fit each other.
_ABSENT = {10: [4, 11, 7, 10], 11: [4, 11], 12: []}


def mesh_on(corners: Floats, kind: int) -> tuple[Floats, Ints]:
    """Lay straight-sided elements on a grid of corners.

    Parameters
    ----------
    corners : ndarray (rows, columns, 2)
        Columns follow each other in the sense of xi, rows in that of eta.
    kind : int
        Nodes an element: 4, 8 or 9; 3 for two triangles in the place of each quadrilateral; 10, 11
        or 12 for the last node of cubic elements, those with 10 or 11 having one third point on all
        sides or on every other side.

    Returns
    -------
    coordinates : ndarray (numnp, 2)
    elements : ndarray (numel, kind)
    """
    if kind == 3:
        coordinates, elements = mesh_on(corners, 4)
        return coordinates, _halved(elements, corners.shape[1] - 1)
    pitch, places = (2, _HALVES) if kind <= 9 else (3, _THIRDS)
    rows, columns = corners.shape[0] - 1, corners.shape[1] - 1
    fine = _refined(_refined(corners, pitch).swapaxes(0, 1), pitch).swapaxes(0, 1)
    number = np.arange(fine[..., 0].size).reshape(fine.shape[:2])
    j, i = np.mgrid[0 : pitch * rows : pitch, 0 : pitch * columns : pitch]
    right, up = np.array(places)[:, :kind]
    elements = number[j.ravel()[:, None] + up, i.ravel()[:, None] + right] + 1
    elements[:, [node for node in _ABSENT.get(kind, []) if node < kind]] = 0
    used = np.unique(elements[elements > 0])
    renumbered = np.where(elements > 0, np.searchsorted(used, elements) + 1, 0)
    return fine.reshape(-1, 2)[used - 1], renumbered.astype(np.int32)


def _refined(corners: Floats, pitch: int) -> Floats:
    """Put points at equal distances between those of the first axis."""
    fine = np.zeros((pitch * (len(corners) - 1) + 1, *corners.shape[1:]))
    fine[-1] = corners[-1]
    for part in range(pitch):
        fine[part:-1:pitch] = ((pitch - part) * corners[:-1] + part * corners[1:]) / pitch
    return fine


def _halved(elements: Ints, columns: int) -> Ints:
    """Cut quadrilaterals into triangles, along either diagonal and beginning with any corner."""
    halves: list[tuple[int, ...]] = []
    for number, (a, b, c, d) in enumerate(elements.tolist()):
        straight = (number // columns + number % columns) % 2 == 0
        pair = ((a, b, c), (c, d, a)) if straight else ((b, c, d), (d, a, b))
        for triangle in pair:
            first = len(halves) % 3
            halves.append(triangle[first:] + triangle[:first])
    return np.array(halves, dtype=np.int32)


def _grid(nx: int, ny: int) -> Floats:
    x, y = np.meshgrid(np.linspace(0.0, 1.0, nx + 1), np.linspace(0.0, 1.0, ny + 1))
    return np.stack([x, y], axis=-1)


def square(nx: int, ny: int, kind: int = 9) -> tuple[Floats, Ints]:
    """Mesh the unit square with equal rectangles; its lower left corner is the origin."""
    return mesh_on(_grid(nx, ny), kind)


def distorted_square(nx: int, ny: int, kind: int = 9) -> tuple[Floats, Ints]:
    """Mesh the unit square with quadrilaterals, each of another shape.

    Inner corners are shifted by up to a quarter of their spacing; one in the middle stays.
    """
    corners = _grid(nx, ny)
    shifts = np.random.default_rng(1983).uniform(-0.25, 0.25, corners.shape) / [nx, ny]
    shifts[[0, -1]] = shifts[:, [0, -1]] = 0.0
    if nx % 2 == ny % 2 == 0:
        shifts[ny // 2, nx // 2] = 0.0
    return mesh_on(corners + shifts, kind)


def parallelograms(nx: int, ny: int, kind: int = 9) -> tuple[Floats, Ints]:
    """Mesh a parallelogram with equal ones, no side of them parallel to an axis."""
    origin, along, _, up = np.array(PARALLELOGRAM)
    return mesh_on(_grid(nx, ny) @ np.array([along - origin, up - origin]), kind)


def one_element(corners: Corners, kind: int = 9) -> tuple[Floats, Ints]:
    """Make a single straight-sided element whose n-th node has the number n."""
    if kind == 3:
        return np.array(corners[:3]), np.array([[1, 2, 3]], dtype=np.int32)
    a, b, c, d = corners
    coordinates, elements = mesh_on(np.array([[a, b], [d, c]]), 12 if kind > 9 else kind)
    return coordinates[elements[0, :kind] - 1], np.arange(1, kind + 1, dtype=np.int32)[None]


def without_some_nodes(coordinates: Floats, elements: Ints) -> tuple[Floats, Ints]:
    """Take a third of the mid-sides and centres out of 9-node elements; 0 stands for them then."""
    beyond_corners = np.setdiff1d(elements, elements[:, :4])
    absent = np.random.default_rng(57).permutation(beyond_corners)[: len(beyond_corners) // 3]
    return coordinates, np.where(np.isin(elements, absent), 0, elements).astype(np.int32)


# Restraints --------------------------------------------------------------------------------------


def with_restraints(
    coordinates: Floats, elements: Ints, restrained: Bools, values: Floats | None = None
) -> MeshArrays:
    """Put a mesh together.

    Parameters
    ----------
    coordinates, elements : ndarray
        As the other builders return them.
    restrained : ndarray (numnp, 5) of bool
        Restrained unknowns.
    values : ndarray (numnp, 5), optional
        Displacements of restrained unknowns, forces on the others; zero without it.
    """
    free = ~restrained.ravel()
    equations = np.where(free, np.cumsum(free), 0).astype(np.int32).reshape(restrained.shape)
    forces = np.zeros(restrained.shape) if values is None else values
    return MeshArrays(coordinates, elements, restrained.astype(np.int32), forces, equations)


def nothing(coordinates: Floats) -> Bools:
    """Restrain no unknown."""
    return np.zeros((len(coordinates), 5), dtype=bool)


def boundary(coordinates: Floats, elements: Ints) -> Bools:
    """Restrain every unknown on the sides that belong to one element only, and unused nodes."""
    padded = np.zeros((len(elements), 13), dtype=np.int32)
    padded[:, : elements.shape[1]] = elements
    sides = np.concatenate([_sides(element) for element in padded])
    _, which, count = np.unique(
        np.sort(sides[:, :2], axis=1), axis=0, return_inverse=True, return_counts=True
    )
    outer = sides[count[which.ravel()] == 1]
    numbers = np.arange(1, len(coordinates) + 1)
    held = np.isin(numbers, outer) | ~np.isin(numbers, elements)
    return np.repeat(held[:, None], 5, axis=1)


def _sides(element: Ints) -> Ints:
    """Nodes of an element's sides, the ends first; 0 where there is no node."""
    last = int(np.flatnonzero(element)[-1]) + 1
    none = 12  # a place that never holds a node
    if last == 3:
        return element[[[0, 1, none, none], [1, 2, none, none], [2, 0, none, none]]]
    if last <= 9:
        return element[[[0, 1, 4, none], [1, 2, 5, none], [2, 3, 6, none], [3, 0, 7, none]]]
    return element[[[0, 1, 4, 9], [1, 2, 5, 10], [2, 3, 6, 11], [3, 0, 7, 8]]]


def simple_support(coordinates: Floats) -> Bools:
    """Restrain w and the tangential rotation on the unit square's edges, u and v everywhere."""
    at_x_ends, at_y_ends = (np.isclose(coordinates, 0.0) | np.isclose(coordinates, 1.0)).T
    restrained = nothing(coordinates)
    restrained[:, :2] = True
    restrained[:, 2] = at_x_ends | at_y_ends
    restrained[:, 3] = at_y_ends
    restrained[:, 4] = at_x_ends
    return restrained


def rules(
    bending: int = 3, shear: int = 3, *, transposed_jacobian: bool = False
) -> IntegrationRules:
    """Gauss rules of the given orders; strains are stored at those of the bending rule."""
    return IntegrationRules(
        gauss(bending), gauss(shear), gauss(bending), transposed_jacobian=transposed_jacobian
    )


def mixed(nx: int, ny: int, kind: int) -> tuple[Floats, Ints]:
    """Mesh the unit square with distorted elements of which some nodes are absent."""
    coordinates, elements = without_some_nodes(*distorted_square(nx, ny, kind))
    assert len(np.unique(elements > 0, axis=0)) > 5
    return coordinates, elements


def displacement(state: RodState) -> Floats:
    """Displacement of every dof."""
    deformation = state.deformation
    deformation[::2] += state.tip
    return deformation
