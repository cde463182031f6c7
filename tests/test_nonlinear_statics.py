"""Plates that stretch as they bend, under static loads.

The reference tables are those of von Karman plates in first-order shear deformation theory, of
independent programs; lengths in mm, forces in N, thickness 2 mm unless said otherwise:

- nonlinear_rectangles.csv: Legendre-Ritz solutions with 7 to 16 functions in a direction;
- nonlinear_levy.csv: Levy's clamped square plate (NACA TN 847, 1942), computed anew in the same
  way, as Levy's truncated series is up to 2.4 % high;
- nonlinear_circles.csv: circular plates, by spectral elements and by a boundary value solver;
- nonlinear_cylindrical.csv: cylindrical bending, closed form with one scalar root;
- nonlinear_preload.csv: a plate with an initial membrane force, Ritz.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from itertools import groupby

import numpy as np
import pytest

from fecm import Ply
from fecm.mechanics.laminate import LaminateSection, laminate
from fecm.mechanics.membrane import MembraneForces, quadratic_strains, tangent
from fecm.mechanics.plate import PlateModel
from fecm.mechanics.strains import FLAT, Curvature
from tests.builders import (
    PARALLELOGRAM,
    SKEWED,
    SQUARE,
    Corners,
    Floats,
    Ints,
    boundary,
    distorted_square,
    general_plate,
    isotropic_plate,
    mesh_on,
    nothing,
    one_element,
    parallelograms,
    square,
    table,
    with_restraints,
)
from tests.nonlinear_plates import (
    RULES,
    disc,
    equilibrium,
    patch,
    pressure,
    rectangle,
    with_preload,
)

H = 2.0
Row = dict[str, str]


def isotropic(nu: float = 0.3, thickness: float = H) -> LaminateSection:
    """The tables' isotropic plate, E = 70000, with the shear factor 5/6."""
    g = 70000.0 / (2.0 + 2.0 * nu)
    plain = laminate(Ply(2.7e-9, nu, 70000.0, 70000.0, g, g, g), [0.0], [thickness])
    return replace(plain, shear=5.0 / 6.0 * plain.shear)


def layered(*angles: float) -> LaminateSection:
    """The tables' plies of 0.25 mm, with the shear factor 5/6."""
    ply = Ply(1.53e-9, 0.3, 141000.0, 9700.0, 5500.0, 5500.0, 3700.0)
    plain = laminate(ply, angles, [0.25] * len(angles))
    return replace(plain, shear=5.0 / 6.0 * plain.shear)


LAMINATES = {
    "iso": isotropic(),
    "cross": layered(0, 90, 0, 90, 90, 0, 90, 0),
    "unsym": layered(0, 0, 0, 0, 90, 90, 90, 90),
}


def centre(plate: PlateModel) -> Floats:
    """Weights of the deflection of the node at the origin."""
    weights = np.zeros(len(plate.mesh.coordinates))
    weights[np.hypot(*plate.mesh.coordinates.T).argmin()] = 1.0
    return weights


# The element --------------------------------------------------------------------------------------


def one(corners: Corners, seed: int = 0, curvature: Curvature = FLAT) -> PlateModel:
    """A free element of the general laminate, its mid-sides off the middle with a seed."""
    coordinates, elements = one_element(corners, 9)
    if seed:
        coordinates = coordinates + np.random.default_rng(seed).normal(0.0, 0.03, (9, 2))
    mesh = with_restraints(coordinates, elements, nothing(coordinates))
    return PlateModel(mesh, general_plate(), RULES, nonlinear=True, curvature=curvature)


SHAPES = pytest.mark.parametrize("curvature", [FLAT, (0.7, -0.4, 0.3)])
ELEMENTS = pytest.mark.parametrize(
    ("corners", "seed"), [(SQUARE, 0), (PARALLELOGRAM, 0), (SKEWED, 0), (SKEWED, 5)]
)


def state(seed: int = 3) -> Floats:
    """Displacements of nine nodes, with slopes of about one half."""
    return np.random.default_rng(seed).normal(0.0, 0.3, (9, 5))


def forces_of(plate: PlateModel) -> Callable[[Floats], Floats]:
    """Internal force of an element in a field, and behind it its strain energy, (46,)."""
    (K,) = plate.stiffness_of(plate.families[0])
    membrane = MembraneForces(plate)
    nodes = plate.mesh.elements[0] - 1

    def force(field: Floats) -> Floats:
        forces, work = membrane.forces(field)
        u = field[nodes].ravel()
        total = K @ u + forces[nodes].ravel()
        return np.append(total, 0.5 * (u @ total - work))

    return force


@cache
def gradient(corners: Corners, seed: int, curvature: Curvature) -> Floats:
    """Derivatives of the force and of the energy by the dofs of an element, (45, 46)."""
    plate, field = one(corners, seed, curvature), state()
    force = forces_of(plate)
    step = 1e-4
    slopes = []
    for dof in range(45):
        change = np.zeros((9, 5))
        change[plate.mesh.elements[0, dof // 5] - 1, dof % 5] = step
        # The energy is of the fourth degree, for which this difference is exact.
        once, twice = (force(field + n * change) - force(field - n * change) for n in (1, 2))
        slopes.append((8.0 * once - twice) / (12.0 * step))
    return np.array(slopes)


@ELEMENTS
@SHAPES
@pytest.mark.few(3)  # of 8, 0.08 s each
def test_the_internal_force_is_the_gradient_of_the_strain_energy(
    corners: Corners, seed: int, curvature: Curvature
) -> None:
    *values, _ = forces_of(one(corners, seed, curvature))(state())
    array = np.array(values)
    wanted = gradient(corners, seed, curvature)[:, -1]
    assert np.abs(array - wanted).max() < 1e-9 * np.abs(array).max()


@ELEMENTS
@SHAPES
def test_the_tangent_is_the_gradient_of_the_internal_force(
    corners: Corners, seed: int, curvature: Curvature
) -> None:
    plate, field = one(corners, seed, curvature), state()
    (family,) = plate.families
    value = plate.stiffness_of(family)[0] + tangent(plate, family, field)[0]
    wanted = gradient(corners, seed, curvature)[:, :-1]
    assert np.abs(value - wanted).max() < 1e-9 * np.abs(value).max()
    np.testing.assert_array_equal(value, value.T)


@ELEMENTS
def test_a_free_element_has_six_motions_without_energy(corners: Corners, seed: int) -> None:
    plate = one(corners, seed)
    values = np.linalg.eigvalsh(plate.stiffness_of(plate.families[0])[0])
    assert np.count_nonzero(values < 1e-12 * values[-1]) == 6


def inclined(coordinates: Floats) -> tuple[Floats, Floats]:
    """A field of constant strains and slopes, and its membrane strain eps_l + eps_q."""
    x, y = coordinates.T
    gradient = np.array([[3e-3, -2e-3], [4e-3, 1e-3]])  # du/dx, du/dy; dv/dx, dv/dy
    slope = np.array([0.4, -0.3])
    field = np.zeros((len(coordinates), 5))
    field[:, :2] = coordinates @ gradient.T
    field[:, 2] = slope[0] * x + slope[1] * y
    field[:, 3:] = slope
    strain = [
        gradient[0, 0] + slope[0] ** 2 / 2.0,
        gradient[1, 1] + slope[1] ** 2 / 2.0,
        gradient[0, 1] + gradient[1, 0] + slope[0] * slope[1],
    ]
    return field, np.array(strain)


@pytest.mark.parametrize("mesh", [square, parallelograms, distorted_square])
def test_a_constant_membrane_force_at_finite_slopes_is_exact_on_straight_sided_meshes(
    mesh: Callable[[int, int], tuple[Floats, Ints]],
) -> None:
    coordinates, elements = mesh(3, 3)
    held = boundary(coordinates, elements)
    plate = PlateModel(
        with_restraints(coordinates, elements, held), general_plate(), RULES, nonlinear=True
    )
    field, strain = inclined(coordinates)
    quadratic = strain - [3e-3, 1e-3, 2e-3]
    for family in plate.families:
        actual = quadratic_strains(family, RULES.bending, field)
        np.testing.assert_allclose(actual, np.broadcast_to(quadratic[:, None, None], actual.shape),
                                   rtol=1e-12)  # fmt: skip
    forces = plate.internal_forces(field) + MembraneForces(plate).forces(field)[0]
    assert np.abs(forces[~held]).max() < 1e-12 * np.abs(forces).max()


def strip(distorted: bool) -> PlateModel:
    """Half of a strip in cylindrical bending, of length 1, that is free to shorten."""
    x, y = np.meshgrid(np.linspace(0.0, 0.5, 5), [0.0, 0.125, 0.25])
    corners = np.stack([x, y], axis=-1)
    if distorted:
        inner = (slice(1, -1), slice(1, -1))
        shifts = np.random.default_rng(9).uniform(-0.2, 0.2, corners.shape) * 0.125
        corners[inner] += shifts[inner]
    coordinates, elements = mesh_on(corners, 9)
    restrained = nothing(coordinates)
    restrained[:, [1, 4]] = True
    restrained[np.isclose(coordinates[:, 0], 0.0), 0] = True
    restrained[np.isclose(coordinates[:, 0], 0.0), 3] = True
    restrained[np.isclose(coordinates[:, 0], 0.5), 2] = True
    mesh = with_restraints(coordinates, elements, restrained)
    return PlateModel(mesh, isotropic_plate(0.01, 5.0 / 6.0), RULES, nonlinear=True)


@pytest.mark.parametrize(("distorted", "limit"), [(False, 1e-9), (True, 5e-4)])
@pytest.mark.few(1)  # of 2, 0.2 s each
def test_a_strip_that_is_free_to_shorten_bends_without_membrane_locking(
    distorted: bool, limit: float
) -> None:
    plate = strip(distorted)
    load, weights = pressure(plate), centre(plate)
    small, large = (
        equilibrium(plate, load, weights, thicknesses * 0.01, steps=4)
        for thicknesses in (1e-3, 5.0)
    )
    assert large.load / small.load == pytest.approx(5000.0, rel=limit)


# Plates -------------------------------------------------------------------------------------------


@cache
def rectangles() -> dict[str, list[Row]]:
    """Rows of the rectangles by plate and load."""
    rows = table("nonlinear_rectangles.csv")
    return {
        name: list(part)
        for name, part in groupby(rows, lambda row: f"{row['case']} {row['load']} {row['sign']}")
    }


def at(rows: list[Row], column: str, *deflections: float) -> list[Row]:
    """The rows at some deflections over the thickness."""
    values = [row for row in rows if float(row[column]) in deflections]
    assert len(values) == len(deflections)
    return values


def solved(name: str, rows: list[Row], n: int) -> list[tuple[float, float]]:
    """Load and energy over those of the rows, less 1, on a quarter of n x n elements."""
    case, load, _ = name.split()
    kind, *_ = case.split("_")
    size = next(part for part in case.split("_") if part[:2] in ("10", "12") and "x" in part)
    a, b, _ = map(float, size.split("x"))
    plate = rectangle(a, b, n, LAMINATES[kind], "_".join(case.split("_")[-2:]))
    uniform = load == "uniform"
    forces = pressure(plate) if uniform else patch(plate, "HERT", 10.0)
    weights = centre(plate) if uniform else 4.0 * forces
    field, errors = None, []
    for row in rows:
        deflection = float(row["sign"]) * float(row["control_over_h"]) * H
        solution = equilibrium(plate, forces, weights, deflection, field)
        field = solution.field
        errors.append((
            solution.load / float(row["load_value"]) - 1.0,
            solution.energy / float(row["strain_energy_mJ"]) - 1.0,
        ))  # fmt: skip
    return errors


@pytest.mark.parametrize("name", [name for name in rectangles() if "uniform" in name])
@pytest.mark.few(1)  # of 5, 0.2 s each
def test_rectangles_under_pressure_follow_the_spectral_solution_up_to_three_thicknesses(
    name: str,
) -> None:
    rows = at(rectangles()[name], "control_over_h", 1.0, 3.0)
    n = 8 if "_movable" in name else 6  # the membrane forces of movable edges vary more
    assert np.abs(solved(name, rows, n)).max() < 4e-4


@pytest.mark.parametrize("name", ["iso_100x100x2_clamped_immovable uniform 1"])
def test_the_error_under_pressure_falls_with_more_than_the_third_order(name: str) -> None:
    rows = at(rectangles()[name], "control_over_h", 1.0)
    coarse, fine = (np.array(solved(name, rows, n))[:, 1] for n in (4, 8))
    assert (np.log2(np.abs(coarse / fine)) > 3.5).all()


@pytest.mark.parametrize("name", [name for name in rectangles() if "hert" in name])
@pytest.mark.few(2)  # of 4, 0.3 s each
def test_rectangles_under_a_patch_follow_the_spectral_solution(name: str) -> None:
    known = [row for row in rectangles()[name] if float(row["rel_change_n"]) < 1e-3]
    assert np.abs(solved(name, [known[2], known[-1]], 8)).max() < 1e-3


@pytest.mark.parametrize("name", ["iso_100x100x2_clamped_immovable hert 1"])
def test_an_isotropic_plate_under_a_patch_is_within_two_ten_thousandths_on_a_fine_mesh(
    name: str,
) -> None:
    rows = at(rectangles()[name], "control_over_h", 2.0)
    assert np.abs(solved(name, rows, 12)).max() < 2e-4


def test_levys_clamped_plate_deflects_as_computed() -> None:
    E, h, a = 70000.0, 1.0, 100.0
    plate = rectangle(a, a, 8, isotropic(0.1**0.5, h), "clamped_immovable")
    load, weights, field = pressure(plate), centre(plate), None
    for row in table("nonlinear_levy.csv")[::4]:
        solution = equilibrium(plate, load, weights, float(row["this_w_over_h"]) * h, field)
        field = solution.field
        wanted = float(row["q_a4_over_E_h4"]) * E * h**4 / a**4
        # The load rises faster than the deflection, so that its error is the larger one.
        assert solution.load == pytest.approx(wanted, rel=3e-4)


def circle(edge: str, load: str) -> object:
    """A circular plate; short are every edge under the small disc and one under pressure."""
    short = load == "disc 10" or (edge, load) == ("clamped_immovable", "uniform 0")
    return pytest.param(edge, load, marks=() if short else pytest.mark.long)


CIRCLES = [
    circle(edge, load)
    for edge in ("clamped_immovable", "clamped_movable", "ss_immovable", "ss_movable")
    for load in ("uniform 0", "disc 10", "disc 30")
]


@pytest.mark.parametrize(("edge", "load"), CIRCLES)
@pytest.mark.few(1)  # of 5, 0.4 s each
def test_circular_plates_follow_the_axisymmetric_solution(edge: str, load: str) -> None:
    kind, radius = load.split()
    rows = [
        row
        for row in table("nonlinear_circles.csv")
        if (row["edge"], row["load"], row["c_mm"]) == (edge, kind, radius)
    ]
    plate = disc(100.0, 5, isotropic(), edge)
    forces = pressure(plate) if kind == "uniform" else patch(plate, "DISC", float(radius))
    field, weights = None, centre(plate)
    for row in at(rows, "w0_over_h", 1.0, 3.0):
        solution = equilibrium(plate, forces, weights, float(row["w0_over_h"]) * H, field)
        field = solution.field
        assert solution.load == pytest.approx(float(row["load_value"]), rel=1e-3)
        assert solution.energy == pytest.approx(float(row["strain_energy_mJ"]), rel=3e-3)


@pytest.mark.parametrize("ends", ["pinned", "clamped"])
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.few(2)  # of 4, 0.2 s each
def test_an_unsymmetric_strip_bends_as_the_closed_form_for_both_signs_of_the_load(
    ends: str, sign: float
) -> None:
    rows = [
        row
        for row in table("nonlinear_cylindrical.csv")
        if row["ends"] == ends and float(row["q_N_per_mm2"]) * sign > 0.0
    ]
    coordinates, elements = mesh_on(
        np.stack(np.meshgrid(np.linspace(0.0, 50.0, 9), [0.0, 5.0]), axis=-1), 9
    )
    at_end = np.isclose(coordinates[:, 0], 50.0)
    restrained = nothing(coordinates)
    restrained[:, [1, 4]] = True
    restrained[np.isclose(coordinates[:, 0], 0.0), 0] = True
    restrained[np.isclose(coordinates[:, 0], 0.0), 3] = True
    restrained[at_end, 0] = restrained[at_end, 2] = True
    restrained[at_end, 3] = ends == "clamped"
    plate = PlateModel(
        with_restraints(coordinates, elements, restrained),
        layered(0, 0, 0, 0, 90, 90, 90, 90),
        RULES,
        nonlinear=True,
    )
    load, weights, field = pressure(plate), centre(plate), None
    assert len(rows) == 5
    for row in rows:
        solution = equilibrium(plate, load, weights, float(row["w_centre_mm"]), field)
        field = solution.field
        assert solution.load == pytest.approx(float(row["q_N_per_mm2"]), rel=5e-5)


# Initial membrane force ---------------------------------------------------------------------------


@pytest.mark.parametrize("ratio", ["-0.5", "5.0"])
@pytest.mark.few(1)  # of 2, 0.2 s each
def test_a_plate_with_preload_stretches_as_the_spectral_solution(ratio: str) -> None:
    rows = [row for row in table("nonlinear_preload.csv") if row["N0_over_Ncr_biaxial"] == ratio]
    N0 = float(rows[0]["N0_N_per_mm"])
    plate = with_preload(rectangle(100.0, 100.0, 8, isotropic(), "ss_immovable"), N0, N0)
    load, weights, field = pressure(plate), centre(plate), None
    for row in at(rows, "w_centre_over_h", 0.5, 3.0):
        solution = equilibrium(plate, load, weights, float(row["w_centre_over_h"]) * H, field)
        field = solution.field
        assert solution.load == pytest.approx(float(row["q_N_per_mm2"]), rel=4e-4)
        # The strain energy contains N0's work on the slopes.
        assert solution.energy == pytest.approx(
            float(row["strain_energy_above_preload_mJ"]), rel=4e-4
        )


def test_a_preload_by_displaced_edges_is_that_of_the_card() -> None:
    by_card = with_preload(
        rectangle(100.0, 100.0, 4, isotropic(), "ss_immovable"), 505.0, -30.0, 0.0
    )
    strain = np.linalg.solve(by_card.laminate.A, [505.0, -30.0, 0.0])
    mesh = by_card.mesh
    forces = np.zeros(mesh.forces.shape)
    forces[:, :2] = np.where(mesh.codes[:, :2] != 0, mesh.coordinates * strain[:2], 0.0)
    by_edges = replace(by_card, preload=(0.0, 0.0, 0.0), mesh=replace(mesh, forces=forces))
    load, weights = pressure(by_card), centre(by_card)
    for deflection in (0.2, 4.0):
        one, other = (
            equilibrium(plate, load, weights, deflection, steps=2) for plate in (by_card, by_edges)
        )
        assert other.load == pytest.approx(one.load, rel=1e-9)
