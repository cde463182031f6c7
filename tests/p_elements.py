"""A plate on a window with p-elements: NumPy and SciPy only, nothing of fecm.

Elements of the order p have w and both rotations at Gauss-Lobatto nodes, and p + 1 Gauss points
each way.  The plate is the one of liftoff_static.csv.  ``python -m tests.p_elements`` prints
tests/data/window_pull.csv, the flexibility and the pull of the window on finer and finer meshes.
"""

from __future__ import annotations

import csv
import sys
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from tests.builders import Floats

Indices = NDArray[np.intp]

SIZE, MARGIN = (150.0, 100.0), 12.5
E1, E2, NU, G12, G13, G23, SHEAR = 161000.0, 11380.0, 0.32, 5170.0, 5170.0, 3980.0, 5.0 / 6.0
LAYUPS = {
    "QI24": ([45, 0, -45, 90] * 3, 4.4 / 24),
    "QI16": ([45, 0, -45, 90] * 2, 2.93 / 16),
    "CP24": ([0, 90] * 6, 4.4 / 24),
}  # plies of one half, and their thickness
MESHES = [(6, 4, 1), (12, 8, 2), (18, 12, 2), (24, 16, 3), (30, 18, 3)]
ORDER = 5


# Lines of elements, by trial: with these all numbers of liftoff_static.csv about a held window
# follow to the last digit.
WITNESS = (
    np.array([0.0, 12.5, 30.0, 50.0, 75.0, 100.0, 120.0, 137.5, 150.0]),
    np.array([0.0, 12.5, 30.0, 50.0, 70.0, 87.5, 100.0]),
)


# The node of that mesh nearest to (19, 6), the tip of a clamp, and lines of elements through it.
TIP = (18.752643, 4.467303)
THROUGH_TIP = (
    np.array([0.0, 12.5, TIP[0], 30.0, 50.0, 75.0, 100.0, 120.0, 150.0 - TIP[0], 137.5, 150.0]),
    np.array([0.0, TIP[1], 12.5, 30.0, 50.0, 70.0, 87.5, 100.0 - TIP[1], 100.0]),
)


class HeldWindow(NamedTuple):
    """Static answer to a unit load."""

    points: int  # nodes of the window's line
    flexibility: float
    pull: float  # sum of the nodal reactions that pull
    total: float  # sum of all of them
    lowest: float  # lowest w of the plate


def lobatto(p: int) -> Floats:
    """Return the Gauss-Lobatto points of the order p."""
    inner = legendre.legroots(legendre.legder([0.0] * p + [1.0]))
    return np.concatenate([[-1.0], np.sort(inner), [1.0]])


def shapes(points: Floats, at: Floats) -> tuple[Floats, Floats]:
    """Return Lagrange's polynomials of the points, and their derivatives, (points, at)."""
    powers = np.linalg.inv(np.vander(points, increasing=True))  # (power, polynomial)
    values = np.vander(at, len(points), increasing=True)
    slopes = np.zeros_like(values)
    slopes[:, 1:] = values[:, :-1] * np.arange(1, len(points))
    return (values @ powers).T, (slopes @ powers).T


def rigidities(layup: str) -> tuple[Floats, Floats, float]:
    """Return bending and shear stiffness of a symmetric laminate, and its thickness."""
    half, ply = LAYUPS[layup]
    angles = half + half[::-1]
    factor = 1.0 - NU**2 * E2 / E1
    Q = np.array([[E1, NU * E2, 0.0], [NU * E2, E2, 0.0], [0.0, 0.0, G12 * factor]]) / factor
    h = ply * len(angles)
    D, A = np.zeros((3, 3)), np.zeros((2, 2))
    for n, (c, s) in enumerate((np.cos(t), np.sin(t)) for t in np.radians(angles)):
        low = n * ply - h / 2.0
        T = np.array([[c * c, s * s, c * s], [s * s, c * c, -c * s], [-2 * c * s, 2 * c * s, 0]])
        T[2, 2] = c * c - s * s
        D += T.T @ Q @ T * ((low + ply) ** 3 - low**3) / 3.0
        R = np.array([[c, s], [-s, c]])
        A += SHEAR * ply * R.T @ np.diag([G13, G23]) @ R
    return D, A, h


def lines(size: float, inside: int, outside: int) -> Floats:
    """Return lines of elements: equal ones inside of the window and equal ones beyond it."""
    edge = np.linspace(0.0, MARGIN, outside + 1)
    window = np.linspace(MARGIN, size - MARGIN, inside + 1)
    return np.concatenate([edge[:-1], window, size - edge[-2::-1]])


def lines_of(nx: int, ny: int, beyond: int) -> tuple[Floats, Floats]:
    """Return the lines of a mesh with nx x ny elements in the window."""
    return lines(SIZE[0], nx, beyond), lines(SIZE[1], ny, beyond)


class Plate(NamedTuple):
    """Stiffness and unit load of a free plate; three dofs a node, w first."""

    K: sparse.csc_array
    load: Floats
    x: Floats  # of the nodes
    y: Floats

    def nearest(self, x: float, y: float) -> int:
        """Return the node nearest to a place."""
        return int(np.hypot(self.x - x, self.y - y).argmin())

    @property
    def window(self) -> Indices:
        """Nodes of the window's line."""
        inside = np.minimum(
            np.minimum(self.x, SIZE[0] - self.x), np.minimum(self.y, SIZE[1] - self.y)
        )
        return np.flatnonzero(np.abs(inside - MARGIN) < 1e-9)

    def solved(self, held: Indices) -> tuple[Floats, Floats]:
        """Return displacements and residual forces with w held at nodes."""
        free = np.setdiff1d(np.arange(len(self.load)), 3 * held)
        u = np.zeros(len(self.load))
        u[free] = splu(self.K[free][:, free]).solve(self.load[free])
        return u, self.K @ u - self.load


def held_window(layup: str, x_lines: Floats, y_lines: Floats) -> HeldWindow:
    """Solve the plate whose window holds w under a disc of 0.327 h in the middle."""
    plate = free_plate(layup, x_lines, y_lines)
    u, residual = plate.solved(plate.window)
    reactions = residual[3 * plate.window]
    pulling, total = float(reactions[reactions > 0.0].sum()), float(reactions.sum())
    lowest = float(u[::3].min())
    return HeldWindow(len(plate.window), float(plate.load @ u), pulling, total, lowest)


def pushing_window(
    layup: str, x_lines: Floats, y_lines: Floats, tip: tuple[float, float] | None
) -> float:
    """Return the flexibility on a rigid window that only pushes.

    w is held at the node nearest to a place near a corner, and at its images in the other three.
    """
    plate = free_plate(layup, x_lines, y_lines)
    tips = np.empty(0, dtype=int)
    if tip is not None:
        x, y = tip
        places = [(a, b) for a in (x, SIZE[0] - x) for b in (y, SIZE[1] - y)]
        tips = np.array([plate.nearest(*place) for place in places])
    closed = np.ones(len(plate.window), dtype=bool)
    for _ in range(50):
        u, residual = plate.solved(np.concatenate([plate.window[closed], tips]))
        w, reactions = u[3 * plate.window], residual[3 * plate.window]
        before, closed = closed, np.where(closed, reactions <= 0.0, w > 0.0)
        if np.array_equal(before, closed):
            return float(plate.load @ u)
    raise ArithmeticError("the points of contact do not settle")


def free_plate(layup: str, x_lines: Floats, y_lines: Floats, p: int = ORDER) -> Plate:
    """Return the plate between lines of elements, under a disc of 0.327 h in the middle."""
    D, A, h = rigidities(layup)
    points = lobatto(p)
    gauss, weights = legendre.leggauss(p + 1)
    across = shapes(points, gauss)
    places = [
        np.concatenate([line[:1], *(a + (b - a) * (points[1:] + 1) / 2 for a, b in pairs(line))])
        for line in (x_lines, y_lines)
    ]
    rows = len(places[1])
    count = 3 * rows * len(places[0])
    load = disc_load(h, x_lines, y_lines, points, rows, count)
    dofs, blocks = [], []
    known: dict[tuple[float, float], Floats] = {}  # by the sides
    for i, (x, x_end) in enumerate(pairs(x_lines)):
        for j, (y, y_end) in enumerate(pairs(y_lines)):
            key = round(x_end - x, 9), round(y_end - y, 9)
            if key not in known:
                known[key] = element_stiffness(*key, across, weights, D, A)
            blocks.append(known[key])
            dofs.append((3 * element_nodes(i, j, p, rows)[:, None] + np.arange(3)).ravel())
    of_element = np.array(dofs)
    size = of_element.shape[1]
    K = sparse.csc_array(
        (
            np.array(blocks).ravel(),
            (np.repeat(of_element, size, axis=1).ravel(), np.tile(of_element, size).ravel()),
        ),
        shape=(count, count),
    )
    x, y = (place.ravel() for place in np.meshgrid(*places, indexing="ij"))
    return Plate(K, load, x, y)


def element_stiffness(
    width: float,
    height: float,
    across: tuple[Floats, Floats],
    weights: Floats,
    D: Floats,
    A: Floats,
) -> Floats:
    """Return the stiffness of an element, from the shapes at the Gauss points of one direction."""
    N, dN = across
    a, b, m = width / 2.0, height / 2.0, len(N)
    B = np.zeros((5, m, m, m, m, 3))  # of curvatures and shear strains at the Gauss points
    B[0, ..., 1] = B[2, ..., 2] = B[3, ..., 0] = np.einsum("iq,jr->qrij", dN, N) / a
    B[1, ..., 2] = B[2, ..., 1] = B[4, ..., 0] = np.einsum("iq,jr->qrij", N, dN) / b
    B[3, ..., 1] = B[4, ..., 2] = np.einsum("iq,jr->qrij", N, N)
    B = B.reshape(5, m * m, -1) * np.sqrt(a * b * np.outer(weights, weights)).reshape(-1, 1)
    stiffness = np.zeros((5, 5))
    stiffness[:3, :3], stiffness[3:, 3:] = D, A
    return np.asarray(np.einsum("ab,agm,bgn->mn", stiffness, B, B, optimize=True))


def pairs(line: Floats) -> list[tuple[float, float]]:
    """Return the ends of the intervals of a line."""
    return list(zip(line[:-1].tolist(), line[1:].tolist(), strict=True))


def element_nodes(i: int, j: int, p: int, rows: int) -> Indices:
    """Return the nodes of the element in column i and row j."""
    return np.add.outer((i * p + np.arange(p + 1)) * rows, j * p + np.arange(p + 1)).ravel()


def disc_load(
    h: float, x_lines: Floats, y_lines: Floats, points: Floats, rows: int, count: int
) -> Floats:
    """Return the nodal forces of a unit load, a uniform pressure on a disc of 0.327 h."""
    load = np.zeros(count)
    gauss, weights = legendre.leggauss(8)
    number, p = 64, len(points) - 1
    for r, weight in zip((gauss + 1.0) / 2.0, weights / 2.0 * (gauss + 1.0) / number, strict=True):
        for angle in (np.arange(number) + 0.5) * 2.0 * np.pi / number:
            place = np.array(SIZE) / 2.0 + 0.327 * h * r * np.array([np.cos(angle), np.sin(angle)])
            cells, values = [], []
            for at, line in zip(place, (x_lines, y_lines), strict=True):
                cell = int(np.searchsorted(line, at)) - 1
                local = 2.0 * (at - line[cell]) / (line[cell + 1] - line[cell]) - 1.0
                cells.append(cell)
                values.append(shapes(points, np.array([local]))[0][:, 0])
            load[3 * element_nodes(cells[0], cells[1], p, rows)] += (
                weight * np.outer(*values).ravel()
            )
    return load


def main() -> None:
    """Print the table."""
    writer = csv.writer(sys.stdout, lineterminator="\n")
    mesh = ["layup", "elements_x", "elements_y", "beyond"]
    writer.writerow([*mesh, "points_of_line", "flexibility_mm_per_N", "pull"])
    for layup in LAYUPS:
        for nx, ny, beyond in MESHES:
            done = held_window(layup, *lines_of(nx, ny, beyond))
            cells = [done.points, f"{done.flexibility:.6e}", f"{done.pull:.4f}"]
            writer.writerow([layup, nx, ny, beyond, *cells])


if __name__ == "__main__":
    main()
