"""Masses, vibration and bending of plates of every family of elements."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from scipy import sparse
from scipy.sparse.linalg import eigsh

from fecm.mechanics import element_matrices, interpolation
from fecm.mechanics.elements import gauss
from fecm.mechanics.mesh import element_blocks
from fecm.mechanics.plate import PlateModel
from tests.builders import (
    GENERAL_LAYERS,
    GENERAL_PLY,
    PARALLELOGRAM,
    SQUARE,
    Corners,
    Floats,
    Ints,
    boundary,
    distorted_square,
    general_plate,
    isotropic_plate,
    nothing,
    one_element,
    rules,
    simple_support,
    square,
    with_restraints,
)
from tests.patches import (
    area_of,
    deflections,
    reference_deflections,
    reference_frequencies,
    summed,
)

Mesh = tuple[Floats, Ints]

# Orders under which mass and stiffness of a family are exact on parallelograms.
EXACT = {3: 2, 4: 2, 8: 3, 9: 3, 10: 4, 11: 4, 12: 4}
TRIANGLE_AND_CUBICS = (3, 10, 11, 12)
KINDS = (3, 4, 8, 9, 10, 11, 12)
DENSITY, THICKNESS = GENERAL_PLY.density, sum(GENERAL_LAYERS)


# Mass ---------------------------------------------------------------------------------------------


def free_plate(mesh: Mesh, order: int) -> PlateModel:
    """A free plate of the general laminate, all its quadrature of one order."""
    coordinates, elements = mesh
    restraints = with_restraints(coordinates, elements, nothing(coordinates))
    return PlateModel(restraints, general_plate(), rules(order, order))


@pytest.mark.parametrize("order", [2, 3, 4])
@pytest.mark.parametrize("kind", TRIANGLE_AND_CUBICS)
def test_lumped_masses_are_positive_and_add_up_under_orders_2_to_4(kind: int, order: int) -> None:
    mass = free_plate(distorted_square(3, 4, kind), order).mass.reshape(-1, 5)
    assert mass.min() > 0.0
    np.testing.assert_allclose(mass[:, :3].sum(axis=0), DENSITY * THICKNESS, rtol=1e-13)
    np.testing.assert_allclose(mass[:, 3:].sum(axis=0), DENSITY * THICKNESS**3 / 12, rtol=1e-13)


# Under order 1 a triangle has one point, halfway between node 3 and the opposite side, where its
# functions are 1/4, 1/4 and 1/2.  The squares of the 12-node element's textbook functions have the
# integrals 2063/12600 at corners and 6480/12600 at third points.
@pytest.mark.parametrize(
    ("kind", "order", "shares"),
    [
        (3, 1, [1 / 6, 1 / 6, 4 / 6]),
        (3, 2, [1 / 3] * 3),
        (3, 4, [1 / 3] * 3),
        (12, 4, [2063 / 60092] * 4 + [6480 / 60092] * 8),
    ],
)
def test_mass_is_shared_as_the_squares_of_the_shape_functions(
    kind: int, order: int, shares: list[float]
) -> None:
    coordinates, elements = one_element(SQUARE, kind)
    (family,) = element_blocks(elements, coordinates)
    lumped = element_matrices.lumped_mass(family, isotropic_plate(0.2), gauss(order))[0]
    area = area_of(SQUARE[:3] if kind == 3 else SQUARE)
    inertia = area * np.array([0.2, 0.2, 0.2, 0.2**3 / 12.0, 0.2**3 / 12.0])
    np.testing.assert_allclose(lumped, np.outer(shares, inertia), rtol=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_consistent_mass_is_that_of_the_plate_symmetric_and_positive_definite(kind: int) -> None:
    model = free_plate(distorted_square(2, 3, kind), EXACT[kind])
    M = model.consistent_mass
    assert M.format == "csr"
    assert M.shape == (model.neq, model.neq)
    assert model.consistent_mass is M
    dense = M.toarray()
    assert np.array_equal(dense, dense.T)
    assert np.linalg.eigvalsh(dense)[0] > 0.0
    inertia = np.repeat([DENSITY * THICKNESS, DENSITY * THICKNESS**3 / 12.0], (3, 2))
    # A unit motion of every unknown in turn: the plate's mass, and nothing between the unknowns.
    motions = np.tile(np.eye(5), (len(model.mesh.coordinates), 1))
    np.testing.assert_allclose(motions.T @ dense @ motions, np.diag(inertia), atol=1e-14)


@pytest.mark.parametrize("kind", KINDS)
def test_consistent_mass_holds_the_kinetic_energy_of_linear_motions(kind: int) -> None:
    coordinates, _ = mesh = distorted_square(3, 4, kind)
    motion = np.zeros((len(coordinates), 5))
    motion[:, 2] = coordinates @ [1.0, 2.0]  # over the unit square: 1/3 + 4/3 + 4/4
    value = motion.ravel() @ free_plate(mesh, EXACT[kind]).consistent_mass @ motion.ravel()
    assert value == pytest.approx(DENSITY * THICKNESS * 8.0 / 3.0, rel=1e-12)


@pytest.mark.parametrize(
    ("kind", "corners", "table", "divisor"),
    [
        (3, SQUARE[:3], [[2, 1, 1], [1, 2, 1], [1, 1, 2]], 12.0),
        (4, PARALLELOGRAM, [[4, 2, 1, 2], [2, 4, 2, 1], [1, 2, 4, 2], [2, 1, 2, 4]], 36.0),
    ],
)
def test_consistent_mass_of_small_elements_is_that_of_textbooks(
    kind: int, corners: Corners, table: list[list[int]], divisor: float
) -> None:
    coordinates, elements = one_element(corners, kind)
    (family,) = element_blocks(elements, coordinates)
    M = element_matrices.consistent_mass(family, isotropic_plate(0.2), gauss(2))
    assert M.shape == (1, 5 * kind, 5 * kind)
    shared = area_of(corners) * np.array(table) / divisor
    actual = M.reshape(kind, 5, kind, 5)
    for a, b in product(range(5), repeat=2):
        inertia = 0.0 if a != b else 0.2 if a < 3 else 0.2**3 / 12.0
        np.testing.assert_allclose(actual[:, a, :, b], inertia * shared, rtol=1e-12, atol=1e-18)


def test_consistent_mass_of_restrained_unknowns_is_left_out() -> None:
    coordinates, elements = mesh = distorted_square(3, 3, 9)
    held = boundary(coordinates, elements)
    model = PlateModel(with_restraints(*mesh, held), general_plate(), rules())
    whole = free_plate(mesh, 3).consistent_mass.toarray()
    free = ~held.ravel()
    np.testing.assert_allclose(model.consistent_mass.toarray(), whole[np.ix_(free, free)])


# Vibration and bending ----------------------------------------------------------------------------


def frequency(n: int, kind: int, *, lumped: bool = False) -> float:
    """Lowest frequency of the simply supported plate with exact quadrature, h/a = 0.1."""
    h, order = 0.1, EXACT[kind]
    coordinates, elements = square(n, n, kind)
    mesh = with_restraints(coordinates, elements, simple_support(coordinates))
    model = PlateModel(mesh, isotropic_plate(h), rules(order, order))
    K = model.stiffness.tocsc()
    M = sparse.diags_array(model.mass).tocsc() if lumped else model.consistent_mass.tocsc()
    start = np.random.default_rng(0).standard_normal(model.neq)
    (square_of_it,) = eigsh(K, k=1, M=M, sigma=0.0, v0=start, return_eigenvectors=False)
    return float(np.sqrt(square_of_it * h * 12.0 * (1.0 - 0.3**2) / h**3))


# Conforming elements and exact integrals: Rayleigh's quotient over fewer fields, so every frequency
# is above the plate's.  Elements complete to degree p converge with n^-2p: p = 1 for the triangle,
# the 4-node element and those with a third point missing on some side, 2 for 8 and 9 nodes, 3 for
# 12.
@pytest.mark.parametrize(
    ("kind", "meshes", "rate", "ceiling"),
    [
        (3, (16, 32), 2.0, 0.03),
        (4, (16, 32), 2.0, 0.01),
        (8, (8, 16), 4.0, 3e-5),
        (9, (8, 16), 4.0, 3e-5),
        (10, (8, 16), 2.0, 0.04),
        (11, (8, 16), 2.0, 0.02),
        (12, (8, 16), 6.0, 1e-7),
    ],
)
@pytest.mark.few(2)  # of 7, 0.1 s each
def test_frequencies_with_consistent_mass_come_from_above_at_the_rate_of_theory(
    kind: int, meshes: tuple[int, ...], rate: float, ceiling: float
) -> None:
    exact = reference_frequencies("1.000000")[0]
    errors = np.array([frequency(n, kind) / exact - 1.0 for n in meshes])
    assert errors.min() > 0.0
    assert abs(np.log2(errors[0] / errors[1]) - rate) < 0.25
    assert errors[1] < ceiling


# The lumped mass of the 12-node element is no quadrature that is exact for more than linear fields.
def test_lumping_takes_the_12_node_elements_rate_down_to_2() -> None:
    exact = reference_frequencies("1.000000")[0]
    errors = [abs(frequency(n, 12, lumped=True) / exact - 1.0) for n in (8, 16)]
    assert abs(np.log2(errors[0] / errors[1]) - 2.0) < 0.25
    assert errors[1] < 1e-4


# Theory: twice the degree to which the fields are complete on quadrilaterals that are no
# parallelograms.  That is 1 even for the 12-node element, which on coarse meshes is faster.
@pytest.mark.parametrize(
    ("kind", "orders", "rate", "ceiling"),
    [(3, (2, 1), 1.5, 0.13), (10, (4, 4), 1.5, 0.07), (11, (4, 4), 1.6, 0.04),
     (12, (4, 4), 2.0, 1e-4)],
)  # fmt: skip
@pytest.mark.few(2)  # of 4, 0.2 s each
def test_bending_converges_on_ever_finer_distorted_meshes_of_triangles_and_cubics(
    kind: int, orders: tuple[int, int], rate: float, ceiling: float
) -> None:
    exact = reference_deflections(0.1, "1.000000")[0]
    errors = []
    for n in (4, 8, 16):
        coordinates, elements = mesh = distorted_square(n, n, kind)
        (family,) = element_blocks(elements, coordinates)
        at = interpolation.interpolate(family, gauss(3))
        loads = summed(family.nodes, at.jxw @ at.N, len(coordinates))
        errors.append(1.0 - deflections(mesh, loads, 0.1, orders)[0] / exact)
    assert errors[0] > errors[1] > errors[2] > 0.0  # too stiff, less and less
    assert np.log2(errors[1] / errors[2]) > rate
    assert errors[2] < ceiling
