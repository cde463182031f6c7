"""Plate elements: interpolation, patch tests, mass, vibration and bending against closed forms."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve

from fecm.mechanics import element_matrices, plate
from fecm.mechanics.elements import HIGHEST_ORDER, QUADRILATERAL, Quadrature, gauss, nodal
from fecm.mechanics.mesh import element_blocks
from fecm.mechanics.plate import PlateModel
from fecm.mechanics.stiffness_product import stiffness_operator
from fecm.mechanics.strains import StrainField
from tests.builders import (
    GENERAL_ANGLES,
    GENERAL_LAYERS,
    GENERAL_PLY,
    PARALLELOGRAM,
    SKEWED,
    SQUARE,
    Corners,
    Floats,
    boundary,
    distorted_square,
    general_plate,
    mixed,
    one_element,
    parallelograms,
    rules,
    simple_support,
    square,
    turned_stiffness,
    with_restraints,
)
from tests.patches import (
    CURVATURE,
    STRAIN,
    MeshMaker,
    area_of,
    bent,
    equilibrium,
    free_stiffness,
    patch,
    residual,
    stretched,
)

KINDS = (4, 8, 9)
ORDERS = range(1, HIGHEST_ORDER + 1)

# Patch tests -------------------------------------------------------------------------------------


STRETCHED_PATCHES = [
    (distorted_square, 4), (distorted_square, 8), (distorted_square, 9), (mixed, 9),
    (parallelograms, 4), (parallelograms, 8), (parallelograms, 9),
]  # fmt: skip
BENT_PATCHES = [(distorted_square, 9), (parallelograms, 9), (parallelograms, 8)]


@pytest.mark.parametrize(("maker", "kind"), STRETCHED_PATCHES)
def test_a_patch_of_distorted_elements_reproduces_constant_membrane_strain(
    maker: MeshMaker, kind: int
) -> None:
    mesh = maker(3, 4, kind)
    field = stretched(mesh[0], STRAIN)
    assert residual(mesh, field) < 1e-14
    used = np.isin(np.arange(1, len(field) + 1), mesh[1])
    solution = equilibrium(patch(mesh, field))
    np.testing.assert_allclose(solution[used], field[used], atol=1e-11)


@pytest.mark.parametrize(("maker", "kind"), STRETCHED_PATCHES)
def test_the_energy_of_constant_membrane_strain_is_exact_on_distorted_elements(
    maker: MeshMaker, kind: int
) -> None:
    mesh = maker(3, 4, kind)
    field = stretched(mesh[0], STRAIN).ravel()
    area = area_of(PARALLELOGRAM) if maker is parallelograms else 1.0
    A = sum(
        turned_stiffness(GENERAL_PLY, angle) * thickness
        for angle, thickness in zip(GENERAL_ANGLES, GENERAL_LAYERS, strict=True)
    )
    energy = 0.5 * field @ free_stiffness(mesh) @ field
    assert energy == pytest.approx(0.5 * area * STRAIN @ A @ STRAIN, rel=1e-12)


@pytest.mark.parametrize("shear", [2, 3])
@pytest.mark.parametrize(("maker", "kind"), BENT_PATCHES)
def test_a_patch_of_distorted_9_or_parallel_8_node_elements_reproduces_constant_curvature(
    maker: MeshMaker, kind: int, shear: int
) -> None:
    mesh = maker(3, 4, kind)
    field = bent(mesh[0], CURVATURE) + stretched(mesh[0], STRAIN)
    assert residual(mesh, field) < 1e-14
    np.testing.assert_allclose(equilibrium(patch(mesh, field, shear)), field, atol=1e-10)


@pytest.mark.parametrize("rule", [*map(gauss, ORDERS), *map(nodal, ORDERS)])
@pytest.mark.parametrize(("maker", "kind"), BENT_PATCHES)
def test_strains_of_constant_curvature_are_exact_at_gauss_and_at_nodal_points(
    maker: MeshMaker, kind: int, rule: Quadrature
) -> None:
    coordinates, elements = maker(3, 4, kind)
    actual = StrainField(elements, coordinates, rule).evaluate(bent(coordinates, CURVATURE))
    assert actual.shape == (5, 12, len(rule.xi))
    expected = np.array([*CURVATURE, 0.0, 0.0])[:, None, None]
    np.testing.assert_allclose(actual, np.broadcast_to(expected, actual.shape), atol=1e-12)


@pytest.mark.parametrize("rule", [*map(gauss, ORDERS), *map(nodal, ORDERS)])
@pytest.mark.parametrize(("maker", "kind"), STRETCHED_PATCHES)
def test_a_tilted_midplane_with_upright_normals_is_sheared_by_its_slope(
    maker: MeshMaker, kind: int, rule: Quadrature
) -> None:
    coordinates, elements = maker(3, 4, kind)
    field = np.zeros((len(coordinates), 5))
    field[:, 2] = coordinates @ [0.3, -0.7]  # gamma_xz, gamma_yz
    actual = StrainField(elements, coordinates, rule).evaluate(field)
    expected = np.array([0.0, 0.0, 0.0, -0.7, 0.3])[:, None, None]
    np.testing.assert_allclose(actual, np.broadcast_to(expected, actual.shape), atol=1e-12)


def test_strains_do_not_depend_on_displacements_in_the_plane() -> None:
    coordinates, elements = distorted_square(3, 4)
    field = bent(coordinates, CURVATURE)
    strains = StrainField(elements, coordinates, gauss(3))
    alone = strains.evaluate(field)
    assert np.array_equal(strains.evaluate(field + stretched(coordinates, STRAIN)), alone)


def test_half_the_load_factor_halves_what_prescribed_displacements_do() -> None:
    mesh = distorted_square(3, 4)
    field = bent(mesh[0], CURVATURE)
    model = patch(mesh, field)
    inside = spsolve(model.stiffness.tocsc(), model.nodal_loads)
    np.testing.assert_allclose(model.field(0.5 * inside, 0.5), 0.5 * field, atol=1e-10)


@pytest.mark.parametrize(
    ("corners", "kind"), [(SQUARE, 9), (SQUARE, 8), (SKEWED, 9), (PARALLELOGRAM, 8)]
)
def test_the_energy_of_an_unsymmetric_element_is_that_of_its_layers(
    corners: Corners, kind: int
) -> None:
    coordinates, elements = one_element(corners, kind)
    field = (stretched(coordinates, STRAIN) + bent(coordinates, CURVATURE)).ravel()
    # A layer's strain at the height z is e + z kappa; two Gauss points are exact in z squared.
    energy, lower = 0.0, -sum(GENERAL_LAYERS) / 2.0
    for angle, thickness in zip(GENERAL_ANGLES, GENERAL_LAYERS, strict=True):
        Q = turned_stiffness(GENERAL_PLY, angle)
        for z in lower + thickness * (0.5 + np.array([-0.5, 0.5]) / np.sqrt(3.0)):
            strain = STRAIN + z * CURVATURE
            energy += area_of(corners) * thickness / 2.0 * (strain @ Q @ strain) / 2.0
        lower += thickness
    value = 0.5 * field @ free_stiffness((coordinates, elements)) @ field
    assert value == pytest.approx(energy, rel=1e-12)


# The stiffness as a whole ------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_rigid_motions_cause_neither_strains_nor_forces(kind: int) -> None:
    coordinates, elements = mesh = distorted_square(3, 4, kind)
    none = np.zeros(3)
    field = stretched(coordinates, none) + bent(coordinates, none)
    K = free_stiffness(mesh)
    forces = K @ field.ravel()
    assert np.abs(forces).max() < 1e-14 * (np.abs(K) @ np.abs(field.ravel())).max()
    strains = StrainField(elements, coordinates, gauss(3)).evaluate(field)
    np.testing.assert_allclose(strains, 0.0, atol=1e-13)


# Counted: 3 fields of u and v without strain, 3 of theta without curvature (two constants and the
# rotation), one w a node, less two shear strains a point; but never fewer than the rigid motions.
# With 2 x 2 bending points the 9-node element has 18 - 12 fields of either kind instead of 3.
@pytest.mark.parametrize("corners", [SQUARE, SKEWED])
@pytest.mark.parametrize(
    ("kind", "bending", "shear", "modes"),
    [
        (4, 2, 2, 6), (4, 2, 1, 3 + 3 + 4 - 2), (8, 3, 3, 6), (8, 3, 2, 6),
        (9, 3, 3, 6), (9, 4, 4, 6), (9, 3, 2, 3 + 3 + 9 - 8), (9, 2, 2, 6 + 6 + 9 - 8),
    ],
)  # fmt: skip
def test_a_free_element_has_six_rigid_modes_and_those_its_quadrature_misses(
    kind: int, bending: int, shear: int, modes: int, corners: Corners
) -> None:
    values = np.linalg.eigvalsh(free_stiffness(one_element(corners, kind), bending, shear))
    assert np.abs(values[:modes]).max() < 1e-13 * values[-1]
    assert values[modes] > 1e-5 * values[-1]


def test_two_shear_points_a_direction_miss_the_hourglass_of_the_9_node_element() -> None:
    mesh = one_element(SKEWED)
    hourglass = np.zeros((9, 5))
    xi, eta = QUADRILATERAL.xi, QUADRILATERAL.eta
    hourglass[:, 2] = xi**2 + eta**2 - 3.0 * xi**2 * eta**2
    energies = []
    for shear in (2, 3):
        K = free_stiffness(mesh, 3, shear)
        energies.append(hourglass.ravel() @ K @ hourglass.ravel() / np.abs(K).max())
    assert abs(energies[0]) < 1e-14
    assert energies[1] > 1e-3


@pytest.mark.parametrize("turn", [25.0, -60.0])
def test_turning_a_plate_with_its_fibres_changes_no_eigenvalue(turn: float) -> None:
    coordinates, elements = one_element(SKEWED)
    c, s = np.cos(np.deg2rad(turn)), np.sin(np.deg2rad(turn))
    turned = coordinates @ np.array([[c, s], [-s, c]])

    def eigenvalues(at: Floats, fibres: float) -> Floats:
        (family,) = element_blocks(elements, at)
        K = element_matrices.stiffness(family, general_plate(fibres), rules())[0]
        return np.asarray(np.linalg.eigvalsh(K))

    expected = eigenvalues(coordinates, 0.0)
    small = 1e-13 * expected[-1]
    np.testing.assert_allclose(eigenvalues(turned, turn), expected, rtol=1e-10, atol=small)
    for wrong in (0.0, -turn):
        assert np.abs(eigenvalues(turned, wrong) / expected - 1.0)[6:].max() > 0.05


def test_the_assembled_stiffness_is_symmetric() -> None:
    K = free_stiffness(mixed(3, 4, 9))
    assert np.abs(K - K.T).max() < 1e-14 * np.abs(K).max()


@pytest.mark.parametrize("maker", [mixed, square])
def test_assembling_in_blocks_changes_nothing(
    maker: MeshMaker, monkeypatch: pytest.MonkeyPatch
) -> None:
    coordinates, elements = maker(3, 4, 9)
    mesh = with_restraints(coordinates, elements, simple_support(coordinates))

    def assembled() -> list[Floats]:
        model = PlateModel(mesh, general_plate(), rules())
        return [model.stiffness.toarray(), model.support.toarray(), model.mass]

    whole = assembled()
    monkeypatch.setattr(plate, "BLOCK", 2)
    for cut, expected in zip(assembled(), whole, strict=True):
        assert np.abs(cut - expected).max() < 1e-14 * np.abs(expected).max()


def test_the_assembled_stiffness_is_the_sum_of_the_elements() -> None:
    # Equal squares, but for one corner that is a little off its place.
    coordinates, elements = square(3, 3)
    coordinates[elements[4, 0] - 1] += 1e-6
    expected = np.zeros((len(coordinates), 5, len(coordinates), 5))
    for element in elements:
        (family,) = element_blocks(element[None], coordinates)
        K = element_matrices.stiffness(family, general_plate(), rules()).reshape(9, 5, 9, 5)
        for a, b in product(range(9), repeat=2):
            expected[element[a] - 1, :, element[b] - 1] += K[a, :, b]
    actual = free_stiffness((coordinates, elements))
    difference = np.abs(actual - expected.reshape(actual.shape)).max()
    assert difference < 1e-13 * np.abs(expected).max()


@pytest.mark.parametrize(("maker", "kind"), [*STRETCHED_PATCHES, (square, 4), (square, 9)])
def test_every_way_to_multiply_by_the_stiffness_gives_the_same_forces(
    maker: MeshMaker, kind: int
) -> None:
    coordinates, elements = maker(6, 6, kind)
    mesh = with_restraints(coordinates, elements, boundary(coordinates, elements))
    model = PlateModel(mesh, general_plate(), rules())
    u = np.random.default_rng(2).standard_normal(mesh.number_of_equations)
    expected = model.stiffness.toarray() @ u
    for solver in ("", "csr"):
        actual = stiffness_operator(model, solver)(u)
        np.testing.assert_allclose(actual, expected, atol=1e-13 * np.abs(expected).max())


# The transposed Jacobian -------------------------------------------------------------------------


def stiffness_of(corners: Corners, *, transposed_jacobian: bool) -> Floats:
    """Stiffness of one element of the general laminate."""
    coordinates, elements = one_element(corners)
    (family,) = element_blocks(elements, coordinates)
    chosen = rules(transposed_jacobian=transposed_jacobian)
    return element_matrices.stiffness(family, general_plate(), chosen)


def test_the_transposed_jacobian_does_no_harm_on_rectangles_along_the_axes() -> None:
    upright = ((0.5, 0.2), (2.5, 0.2), (2.5, 0.9), (0.5, 0.9))
    proper = stiffness_of(upright, transposed_jacobian=False)
    np.testing.assert_allclose(
        stiffness_of(upright, transposed_jacobian=True), proper, atol=1e-14 * np.abs(proper).max()
    )


def test_the_transposed_jacobian_spoils_a_skewed_element() -> None:
    proper, spoilt = (
        stiffness_of(SKEWED, transposed_jacobian=slip).reshape(9, 5, 9, 5) for slip in (False, True)
    )
    for unknown in (0, 2):  # in the plane, and by transverse shear alone
        difference = np.abs(spoilt - proper)[:, unknown, :, unknown]
        assert difference.max() > 0.01 * np.abs(proper[:, unknown, :, unknown]).max()


def test_the_transposed_jacobian_fails_the_patch_tests() -> None:
    coordinates, elements = mesh = distorted_square(3, 4)
    for field in (stretched(coordinates, STRAIN), bent(coordinates, CURVATURE)):
        assert residual(mesh, field, transposed_jacobian=True) > 1e-3
        actual = equilibrium(patch(mesh, field, transposed_jacobian=True))
        assert np.abs(actual - field).max() > 1e-3
    strains = StrainField(elements, coordinates, gauss(3), transposed_jacobian=True)
    actual = strains.evaluate(bent(coordinates, CURVATURE))
    assert np.abs(actual[:3] - CURVATURE[:, None, None]).max() > 0.05
    assert np.abs(actual[3:]).max() > 0.01


def test_a_family_holds_the_elements_that_have_the_same_nodes() -> None:
    coordinates, elements = mixed(3, 4, 9)
    actual = element_blocks(elements, coordinates)
    assert sorted(row for family in actual for row in family.rows) == list(range(12))
    for family in actual:
        assert len(family.present) == QUADRILATERAL.nodes
        for row, nodes in zip(family.rows, family.nodes, strict=True):
            assert np.array_equal(elements[row] > 0, family.present)
            assert np.array_equal(elements[row][elements[row] > 0], nodes + 1)


def test_a_matrix_of_many_slabs_has_the_bits_of_one(monkeypatch: pytest.MonkeyPatch) -> None:
    coordinates, elements = distorted_square(7, 5)
    restrained = with_restraints(coordinates, elements, boundary(coordinates, elements))
    model = PlateModel(restrained, general_plate(), rules())
    monkeypatch.setattr(plate, "BLOCK", 4)
    whole = model.assembled(model.stiffness_of)
    monkeypatch.setattr(plate, "SLAB", 16)
    actual = model.assembled(model.stiffness_of)
    assert model.neq > 20 * plate.SLAB
    for part in ("data", "indices", "indptr"):
        np.testing.assert_array_equal(getattr(actual, part), getattr(whole, part))
    assert actual.shape == whole.shape
