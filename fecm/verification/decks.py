"""Decks of the verification cases, built in Python."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Sequence

import numpy as np

from fecm._errors import FecmWarning
from fecm._typing import Floats
from fecm.api import Mode, run_one
from fecm.deck.grid import Grid, Section, lines, uniform
from fecm.deck.model import Deck, Forces, Impact, Indentation, Material, Projectile, Segment
from fecm.deck.records import Control, Integration, Layer, Macro, NodeValues, Ply
from fecm.results.result import Result
from fecm.verification.case import farthest

ORDER = 3
NODAL_POINTS = -3


def isotropic(e: float, nu: float, rho: float, shear_factor: float = 1.0) -> Ply:
    """Build an isotropic ply; the factor multiplies its transverse shear moduli."""
    g = e / (2.0 * (1.0 + nu))
    return Ply(rho, nu, e, e, g, shear_factor * g, shear_factor * g)


def material(
    ply: Ply, angles: Sequence[float], thickness: float, shear_order: int = ORDER
) -> Material:
    """Build a MATE segment of layers of equal thickness."""
    layers = tuple(Layer(n, angle, thickness) for n, angle in enumerate(angles, start=1))
    total = float(f"{len(layers) * thickness:.9g}")
    return Material(Integration(ORDER, shear_order, NODAL_POINTS, total), ply, layers)


def deck(
    title: str, grid: Grid, segments: Iterable[Segment | None], macros: Iterable[Macro]
) -> Deck:
    """Build a deck of 9-node elements on a grid's numbering."""
    given = tuple(segment for segment in segments if segment is not None)
    layers = next(len(s.layers) for s in given if isinstance(s, Material))
    control = Control(grid.nodes, grid.elements, layers, 2, 5, 9)
    return Deck(title, control, (grid.element_cards(), *given), tuple(macros))


def impact_program(dt: float, steps: int) -> tuple[Macro, ...]:
    """Macros of an impact that stores only the history."""
    return (
        Macro("LMAS"), Macro("DT", value=dt), Macro("LOOP", value=float(steps)), Macro("TIME"),
        Macro("RODP", value=float(steps)), Macro("NEXT"),
    )  # fmt: skip


def result_of(one: Deck, mode: Mode = "report") -> Result:
    """Run a deck of one problem."""
    with warnings.catch_warnings(action="ignore", category=FecmWarning):
        return run_one(one, mode=mode)


def farthest_of(
    found: Result, group: str, names: Sequence[str], values: Iterable[float], first: int = 0
) -> list[float]:
    """Value farthest from the expected one of each field of a group, without `first` elements."""
    return [
        farthest(found[f"{group}/{name}"][:, first:].ravel().tolist(), value)
        for name, value in zip(names, values, strict=True)
    ]


def constant_strains(
    x: Floats, y: Floats, curvature: Sequence[float], *,
    strain: Sequence[float] = (0.0, 0.0, 0.0), shear: Sequence[float] = (0.0, 0.0),
) -> Floats:  # fmt: skip
    """Dofs (nodes, 5) of a field of constant midplane strains, curvatures and shear yz, xz."""
    (ex, ey, exy), (kx, ky, kxy), (gyz, gxz) = strain, curvature, shear
    w = -(kx * x**2 + ky * y**2 + kxy * x * y) / 2.0 + gxz * x + gyz * y
    u, v = ex * x + exy / 2.0 * y, ey * y + exy / 2.0 * x
    return np.stack([u, v, w, -kx * x - kxy / 2.0 * y, -ky * y - kxy / 2.0 * x], axis=1)


def forces(field: Floats, nodes: Iterable[int] | None = None) -> Forces:
    """Build a FORC segment of the rows of a field, of all or of some nodes from 0."""
    chosen = range(len(field)) if nodes is None else nodes
    return Forces(tuple(NodeValues(n + 1, 0, tuple(field[n].tolist())) for n in chosen))


# Codes of every node of a quarter of a plate, and of the nodes of its edges.
Supports = tuple[tuple[int, ...], dict[str, tuple[int, ...]]]


def _supports(every: str, left: str, bottom: str, right: str, top: str) -> Supports:
    edges = {"left": left, "bottom": bottom, "right": right, "top": top}
    return tuple(map(int, every)), {name: tuple(map(int, codes)) for name, codes in edges.items()}


# The first restrains u and v everywhere; the others are those of Navier's solutions for
# antisymmetric laminates.
BENDING = _supports("11000", "00010", "00001", "00101", "00110")
CROSS_PLY = _supports("00000", "10010", "01001", "01101", "10110")
ANGLE_PLY = _supports("00000", "01010", "10001", "10101", "01110")


def quarter_plate(
    elements: int,
    plate: Material,
    macros: Iterable[Macro],
    load: float | None = None,
    supports: Supports = BENDING,
    others: Sequence[Segment] = (),
) -> Deck:
    """Build a quarter of a simply supported square plate of side 1.

    x = 0 and y = 0 are lines of symmetry, so that node 1 is the middle.

    Parameters
    ----------
    elements : int
        Elements per side.
    plate : Material
    macros : iterable of Macro
    load : float, optional
        Uniform load, force/area.
    supports : Supports
    others : sequence of Segment
        Further segments, such as impact and gages.
    """
    grid = Grid(uniform(0.5, elements), uniform(0.5, elements))
    boundary = grid.boundary(*supports)
    loads = None if load is None else uniform_load(grid, load)
    segments = (grid.coordinates(), boundary, loads, plate, *others)
    return deck("quarter of a simply supported plate", grid, segments, macros)


def weights(coordinates: Sequence[float]) -> list[float]:
    """Simpson's weights of the lines of nodes: integrals of their shape functions."""
    found = [0.0] * len(coordinates)
    for first in range(0, len(coordinates) - 1, 2):
        part = (coordinates[first + 2] - coordinates[first]) / 6.0
        for place, times in enumerate((1.0, 4.0, 1.0)):
            found[first + place] += times * part
    return found


def uniform_load(grid: Grid, load: float) -> Forces:
    """Build consistent nodal forces of a uniform load by Simpson's weights in both directions.

    The last line in each direction is restrained; a value there would be a displacement.
    """
    xs, ys = weights(lines(grid.columns))[:-1], weights(lines(grid.rows))[:-1]
    return Forces(
        tuple(
            NodeValues(1 + i + j * grid.across, 0, (0.0, 0.0, load * x * y, 0.0, 0.0))
            for j, y in enumerate(ys)
            for i, x in enumerate(xs)
        )
    )


def struck_plate(
    grid: Grid, plate: Material, projectile: Projectile | None, velocity: float,
    law: Indentation, dt: float, steps: int,
) -> Deck:  # fmt: skip
    """Build a plate without supports that is hit in the middle."""
    middle = grid.nearest(grid.columns[-1].end / 2.0, grid.rows[-1].end / 2.0)[0]
    boundary = grid.boundary((1, 1, 0, 0, 0), {})
    segments = (
        grid.coordinates(), boundary, projectile, Impact(middle, 3, velocity), law, plate,
    )  # fmt: skip
    return deck("impact", grid, segments, impact_program(dt, steps))


def report_impact(steps: int = 4000) -> Deck:
    """Build the report's experiment: 115 in/s on a plate of 20 layers (lb, in, s)."""
    grid = Grid(
        [Section(0.0, 1.5, 3), Section(1.5, 4.5, 8), Section(4.5, 6.0, 3)],
        [Section(0.0, 0.5, 1), Section(0.5, 3.5, 8), Section(3.5, 4.0, 1)],
    )
    half = (0.0, 45.0, 0.0, -45.0, 0.0) * 2
    ply = Ply(0.000148, 0.3, 17.5e6, 1.15e6, 0.8e6, 0.8e6, 0.8e6)
    law = Indentation(1.912e6, 6.564e-4, 0.094, 2.0)
    return struck_plate(
        grid, material(ply, half + half[::-1], 0.0053), None, 115.0, law, 2e-7, steps
    )


def hertz(mass: float, velocity: float, k: float) -> tuple[float, float, float]:
    """Largest indentation, largest force and duration of an impact on a rigid target.

    m v²/2 = 2 k a^2.5/5; the contact lasts 2.9432 a/v (H. Hertz; the integral of
    2 dx/sqrt(1 - x^2.5) from 0 to 1 in closed form by gamma functions).
    """
    deepest = (5.0 * mass * velocity**2 / (4.0 * k)) ** 0.4
    integral = 2.0 * math.sqrt(math.pi) * math.gamma(1.4) / math.gamma(0.9)
    return deepest, k * deepest**1.5, integral * deepest / velocity
