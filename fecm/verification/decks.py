"""Builders of the decks of the verification cases."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Sequence

import numpy as np

from fecm import examples
from fecm._errors import FecmWarning
from fecm._typing import Floats
from fecm.deck import model
from fecm.deck.grid import ElementGrid, GridSection, grid_lines, uniform_section
from fecm.deck.model import Control, Integration, Layer, Macro, NodeCodes, NodeValues, Ply
from fecm.listing.slips import Mode
from fecm.problem.loading import read_one
from fecm.results.result import Result
from fecm.simulation.job import run_one

MITC = model.Shear(assumed=True)
# The report's laminate (lb, in, s).
REPORT_PLY = Ply(0.000148, 0.3, 17.5e6, 1.15e6, 0.8e6, 0.8e6, 0.8e6)
REPORT_HALF = (0.0, 45.0, 0.0, -45.0, 0.0) * 2
REPORT_ANGLES = REPORT_HALF + REPORT_HALF[::-1]
REPORT_THICKNESS = 0.0053
SIDES = (6.0, 4.0)  # sides of rectangles (in)

# Codes of every node of a rectangle, and of the left, bottom, right and top edge.
FREE = "11000 00000 00000 00000 00000"
SUPPORTED = "11000 11101 11110 11101 11110"
# The same of a quarter whose left and bottom edges are lines of symmetry.  The first restrains u
# and v everywhere; the others belong to Navier's solutions for antisymmetric laminates.
BENDING = "11000 00010 00001 00101 00110"
CROSS_PLY = "00000 10010 01001 01101 10110"
ANGLE_PLY = "00000 01010 10001 10101 01110"


def isotropic(e: float, nu: float, rho: float, shear_factor: float = 1.0) -> Ply:
    """Build an isotropic ply; the factor multiplies its transverse shear moduli."""
    g = e / (2.0 * (1.0 + nu))
    return Ply(rho, nu, e, e, g, shear_factor * g, shear_factor * g)


ONE = isotropic(1.0, 0.3, 1.0)


def material(
    ply: Ply, angles: Sequence[float], thickness: float, shear_order: int = 3, points: int = -3
) -> model.Material:
    """Build a MATE segment of equal layers; `points` -3 computes strains at the nodes."""
    layers = tuple(Layer(n, angle, thickness) for n, angle in enumerate(angles, start=1))
    total = float(f"{len(layers) * thickness:.9g}")
    return model.Material(Integration(3, shear_order, points, total), ply, layers)


def elastic(k: float) -> model.Indentation:
    """Build Hertz's law, without permanent indentation."""
    return model.Indentation(k, 1.0, 0.0, 1.5)


def program(text: str) -> tuple[Macro, ...]:
    """Parse a program of words such as ``LMAS EIGE=4``."""
    parts = (word.partition("=") for word in text.split())
    return tuple(Macro(word, value=float(value or 0.0)) for word, _, value in parts)


def history_program(dt: float, steps: int) -> tuple[Macro, ...]:
    """Return the macros of an impact that stores only the history."""
    return program(f"LMAS DT={dt!r} LOOP={steps} TIME RODP={steps} NEXT")


DEFLECTION = program("TANG FORM SOLV DISP")
STRESSES = program("TANG FORM SOLV STRE")


def restraints(grid: ElementGrid, codes: str) -> model.Boundary | None:
    """Build restraints from codes such as `SUPPORTED`."""
    every, *edges = ([int(code) for code in word] for word in codes.split())
    return grid.boundary(every, dict(zip(("left", "bottom", "right", "top"), edges, strict=True)))


def held_but(dof: int, node: int = 1) -> model.Boundary:
    """Hold all dofs of an element except one, because a deck needs an equation."""
    codes = tuple(int(number != dof) for number in range(5))
    return model.Boundary(
        tuple(NodeCodes(n, 0, codes if n == node else (1,) * 5) for n in range(1, 10))
    )


def deck(
    grid: ElementGrid,
    segments: Iterable[model.Segment | None],
    macros: Iterable[Macro],
    coordinates: model.Coordinates | None = None,
) -> model.Deck:
    """Build a deck with the elements of a grid and, by default, its coordinates."""
    optional = (grid.element_cards(), coordinates or grid.coordinates(), *segments)
    present = tuple(segment for segment in optional if segment is not None)
    layers = next(len(s.layers) for s in present if isinstance(s, model.Material))
    control = Control(grid.nodes, grid.elements, layers, 2, 5, 9)
    return model.Deck("verification", control, present, tuple(macros))


def run_of_deck(deck_of_run: model.Deck, mode: Mode = "report") -> Result:
    """Run a deck without its warnings."""
    with warnings.catch_warnings(action="ignore", category=FecmWarning):
        return run_one(deck_of_run, mode=mode)


def field_values(result: Result, group: str, names: str) -> list[Floats]:
    """Return datasets of a group; `names` are separated by blanks."""
    return [result[f"{group}/{name}"] for name in names.split()]


def constant_strains(
    x: Floats,
    y: Floats,
    curvature: Sequence[float],
    *,
    strain: Sequence[float] = (0.0, 0.0, 0.0),
    shear: Sequence[float] = (0.0, 0.0),
) -> Floats:
    """Return dofs (nodes, 5) with constant mid-plane strains, curvatures and shears yz, xz."""
    (ex, ey, exy), (kx, ky, kxy), (gyz, gxz) = strain, curvature, shear
    w = -(kx * x**2 + ky * y**2 + kxy * x * y) / 2.0 + gxz * x + gyz * y
    u, v = ex * x + exy / 2.0 * y, ey * y + exy / 2.0 * x
    return np.stack([u, v, w, -kx * x - kxy / 2.0 * y, -ky * y - kxy / 2.0 * x], axis=1)


def forces(field: Floats) -> model.Forces:
    """Build a FORC segment of a field: forces, or displacements of restrained dofs."""
    rows = field.reshape(-1, 5).tolist()
    return model.Forces(tuple(NodeValues(n, 0, tuple(row)) for n, row in enumerate(rows, start=1)))


def weights(coordinates: Sequence[float]) -> Floats:
    """Return the integrals of the shape functions of lines of nodes: Simpson's weights."""
    integrals = np.zeros(len(coordinates))
    for first in range(0, len(coordinates) - 1, 2):
        sixth = (coordinates[first + 2] - coordinates[first]) / 6.0
        integrals[first : first + 3] += sixth * np.array([1.0, 4.0, 1.0])
    return integrals


def quarter_plate(
    elements: int,
    plate: model.Material,
    macros: Iterable[Macro],
    load: float | Floats = 0.0,
    codes: str = BENDING,
    further: Sequence[model.Segment] = (),
    side: float = 1.0,
) -> model.Deck:
    """Build a quarter of a simply supported square plate.

    x = 0 and y = 0 are lines of symmetry. Node 1 is the middle of the plate. `elements` is the
    number of elements along a side of the quarter, and `side` the side of the whole plate. `load`
    is a force/area at the nodes, (nodes along y, nodes along x). `codes` are supports such as
    `BENDING`, and `further` are more segments.
    """
    half = uniform_section(side / 2.0, elements)
    grid = ElementGrid(half, half)
    along = weights(grid_lines(grid.columns))
    loads = np.zeros((grid.up, grid.across, 5))
    loads[..., 2] = np.outer(along, along) * load
    loads[-1] = loads[:, -1] = 0.0  # on a restrained dof, FORC is a displacement
    load_segment = forces(loads) if np.any(load) else None
    return deck(grid, (restraints(grid, codes), load_segment, plate, *further), macros)


def pressed_rectangle(
    along: int, patch: model.Patch, macros: Iterable[Macro], *further: model.Segment
) -> model.Deck:
    """Build a simply supported [0/90]5s of the report's ply with MITC, pressed on a patch.

    `along` is the number of elements along x.
    """
    grid = ElementGrid(uniform_section(SIDES[0], along), uniform_section(SIDES[1], along * 2 // 3))
    plate = material(REPORT_PLY, 5 * (0.0, 90.0) + 5 * (90.0, 0.0), 0.106 / 20)
    supports = restraints(grid, SUPPORTED)
    return deck(grid, (supports, patch, *further, MITC, plate), macros)


def struck_plate(
    grid: ElementGrid,
    plate: model.Material,
    projectile: model.Projectile | None,
    velocity: float,
    law: model.Indentation,
    dt: float,
    steps: int,
) -> model.Deck:
    """Build a plate without supports and an impact in its middle."""
    middle = grid.nearest(grid.columns[-1].end / 2.0, grid.rows[-1].end / 2.0)[0]
    segments = (restraints(grid, FREE), projectile, model.Impact(middle, 3, velocity), law, plate)
    return deck(grid, segments, history_program(dt, steps))


def fixed_target(
    mass: float, velocity: float, law: model.Indentation, dt: float, steps: int
) -> model.Deck:
    """Build the impact of a rigid mass on a plate of extreme stiffness and density."""
    grid = ElementGrid(uniform_section(2.0, 2), uniform_section(2.0, 2))
    ply = Ply(1.48e6, 0.3, 1.75e16, 1.75e16, 5e15, 5e15, 5e15)
    plate, hit = material(ply, (0.0, 90.0), 0.053), model.Projectile(0, 0, mass)
    return struck_plate(grid, plate, hit, velocity, law, dt, steps)


def report_impact(steps: int = 4000) -> model.Deck:
    """Build the report's experiment: 115 in/s on a plate of 20 layers (lb, in, s)."""
    grid = ElementGrid(
        [GridSection(0.0, 1.5, 3), GridSection(1.5, 4.5, 8), GridSection(4.5, 6.0, 3)],
        [GridSection(0.0, 0.5, 1), GridSection(0.5, 3.5, 8), GridSection(3.5, 4.0, 1)],
    )
    plate = material(REPORT_PLY, REPORT_ANGLES, REPORT_THICKNESS)
    law = model.Indentation(1.912e6, 6.564e-4, 0.094, 2.0)
    return struck_plate(grid, plate, None, 115.0, law, 2e-7, steps)


def panel_with_gages(along: int, up: int) -> model.Deck:
    """Build the panel of examples/panel-with-gages.inp (mm, N, s) with another mesh."""
    example = read_one(examples.path("panel-with-gages.inp"))
    grid = ElementGrid(uniform_section(300.0, along), uniform_section(200.0, up))
    kinds = (model.Material, model.Shear, model.Patch, model.Gages)
    middle = grid.nearest(150.0, 100.0)[0]
    kept = (*(example.require(kind) for kind in kinds), model.Impact(middle, 3, 0.0))
    return deck(grid, (restraints(grid, SUPPORTED), *kept), DEFLECTION)
