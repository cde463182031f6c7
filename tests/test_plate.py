"""Plate elements: interpolation, patch tests, mass, vibration and bending against closed forms."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import eigh
from scipy.sparse.linalg import eigsh, spsolve

from fecm import assembly, plate
from fecm.assembly import PlateModel, assemble
from fecm.elements import quadrilateral
from fecm.elements.quadrature import HIGHEST_ORDER, Rule, gauss, nodal
from fecm.elements.quadrilateral import ETA, XI, shape_functions
from tests.builders import (
    GENERAL_ANGLES,
    GENERAL_LAYERS,
    GENERAL_PLY,
    PARALLELOGRAM,
    SKEWED,
    SQUARE,
    Bools,
    Corners,
    Floats,
    Ints,
    boundary,
    distorted_square,
    general_plate,
    isotropic_plate,
    nothing,
    one_element,
    parallelograms,
    report_plate,
    rules,
    simple_support,
    square,
    table,
    turned_stiffness,
    with_restraints,
    without_some_nodes,
)

KINDS = (4, 8, 9)
ORDERS = range(1, HIGHEST_ORDER + 1)
# Corners are always there, each of the other five nodes may be absent.
PATTERNS = [np.array([True] * 4 + list(rest)) for rest in product((False, True), repeat=5)]

Indices = NDArray[np.signedinteger]
MeshMaker = Callable[[int, int, int], tuple[Floats, Ints]]


def stretched(coordinates: Floats, strain: Floats) -> Floats:
    """Field of a constant midplane strain xx, yy, xy with a rotation in the plane."""
    x, y = coordinates.T
    field = np.zeros((len(coordinates), 5))
    field[:, 0] = 0.2 + strain[0] * x + (0.5 * strain[2] - 0.3) * y
    field[:, 1] = -0.1 + (0.5 * strain[2] + 0.3) * x + strain[1] * y
    return field


def bent(coordinates: Floats, curvature: Floats) -> Floats:
    """Field of a constant curvature xx, yy, xy without transverse shear: theta is w's gradient."""
    x, y = coordinates.T
    kx, ky, kxy = curvature
    field = np.zeros((len(coordinates), 5))
    field[:, 2] = 0.4 - 0.2 * x + 0.1 * y - 0.5 * (kx * x**2 + ky * y**2 + kxy * x * y)
    field[:, 3] = -0.2 - kx * x - 0.5 * kxy * y
    field[:, 4] = 0.1 - ky * y - 0.5 * kxy * x
    return field


STRAIN = np.array([0.7, -0.4, 0.9])
CURVATURE = np.array([1.1, -0.6, 0.8])


def area_of(corners: Corners) -> float:
    """A polygon's area, by the shoelace formula."""
    x, y = np.array(corners).T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2.0


def equilibrium(model: PlateModel) -> Floats:
    """Displacements of every node under the mesh's loads and prescribed displacements."""
    return model.field(spsolve(model.stiffness.tocsc(), model.nodal_loads))


def patch(
    mesh: tuple[Floats, Ints], field: Floats, shear: int = 3, *, transposed: bool = False
) -> PlateModel:
    """Prescribe a field on a patch's boundary."""
    held = boundary(*mesh)
    values = np.where(held, field, 0.0)
    model = assemble(
        with_restraints(*mesh, held, values),
        general_plate(),
        rules(3, shear, transposed=transposed),
    )
    assert model.mesh.number_of_equations > 0
    return model


def residual(mesh: tuple[Floats, Ints], field: Floats, *, transposed: bool = False) -> float:
    """Largest force left on an inner node by a field, over the largest that its parts exert."""
    model = patch(mesh, field, transposed=transposed)
    inside = model.mesh.equations > 0
    left = model.stiffness @ field[inside] + model.support @ field[~inside]
    parts = abs(model.stiffness) @ abs(field[inside]) + abs(model.support) @ abs(field[~inside])
    return float(np.abs(left).max() / parts.max())


def free_stiffness(mesh: tuple[Floats, Ints], bending: int = 3, shear: int = 3) -> Floats:
    """Stiffness of an unrestrained plate of the general laminate, unknowns node by node."""
    coordinates, elements = mesh
    model = assemble(
        with_restraints(coordinates, elements, nothing(coordinates)),
        general_plate(),
        rules(bending, shear),
    )
    return np.asarray(model.stiffness.toarray())


# Quadrature --------------------------------------------------------------------------------------


@pytest.mark.parametrize("order", ORDERS)
def test_a_gauss_rule_of_n_points_integrates_powers_below_2n_in_each_direction(order: int) -> None:
    rule = gauss(order)

    def integral(p: int, q: int) -> float:
        return float(rule.weights @ (rule.xi**p * rule.eta**q))

    def exact(p: int) -> float:
        return (1.0 - (-1.0) ** (p + 1)) / (p + 1)

    for p, q in product(range(2 * order), repeat=2):
        assert integral(p, q) == pytest.approx(exact(p) * exact(q), abs=1e-13)
    assert abs(integral(2 * order, 0) - 2.0 * exact(2 * order)) > 1e-3
    assert abs(integral(0, 2 * order) - 2.0 * exact(2 * order)) > 1e-3


@pytest.mark.parametrize("order", [2, 3])
@pytest.mark.parametrize("rule_of", [gauss, nodal])
def test_points_come_as_corners_from_lower_left_then_mid_sides_then_the_centre(
    order: int, rule_of: Callable[[int], Rule]
) -> None:
    rule = rule_of(order)
    counter_clockwise = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
    rest = [(0, -1), (1, 0), (0, 1), (-1, 0), (0, 0)]
    expected = counter_clockwise + (rest if order == 3 else [])
    signs = np.sign(np.where(np.abs([rule.xi, rule.eta]) < 1e-15, 0.0, [rule.xi, rule.eta]))
    assert [(int(a), int(b)) for a, b in signs.T] == expected


def test_the_only_point_of_order_1_is_the_centre() -> None:
    for rule in (gauss(1), nodal(1)):
        assert (rule.xi.tolist(), rule.eta.tolist(), rule.weights.tolist()) == ([0], [0], [4])


@pytest.mark.parametrize(("rule_of", "inner", "outer"), [
    (gauss, 0.339981043584856, 0.861136311594053),
    (nodal, 1.0 / 3.0, 1.0),
])  # fmt: skip
def test_order_4_takes_four_rectangles_in_the_printed_program_s_order(
    rule_of: Callable[[int], Rule], inner: float, outer: float
) -> None:
    rule = rule_of(4)
    expected = [
        (sx * half_width, sy * half_height)
        for half_width, half_height in (
            (outer, outer), (inner, outer), (outer, inner), (inner, inner),
        )
        for sx, sy in ((-1, -1), (1, -1), (1, 1), (-1, 1))
    ]  # fmt: skip
    np.testing.assert_allclose(np.stack([rule.xi, rule.eta], axis=-1), expected, atol=1e-14)


def test_nodal_points_of_order_3_are_the_element_s_nodes() -> None:
    rule = nodal(3)
    assert np.array_equal(rule.xi, XI)
    assert np.array_equal(rule.eta, ETA)


@pytest.mark.parametrize("order", [-3, 0, 5])
@pytest.mark.parametrize("rule_of", [gauss, nodal])
def test_orders_outside_1_to_4_are_refused(order: int, rule_of: Callable[[int], Rule]) -> None:
    with pytest.raises(ValueError):  # noqa: PT011
        rule_of(order)


# Shape functions ---------------------------------------------------------------------------------


def sample() -> tuple[Floats, Floats]:
    """Some points of the square."""
    xi, eta = np.random.default_rng(0).uniform(-1.0, 1.0, (2, 20))
    return xi, eta


@pytest.mark.parametrize("present", PATTERNS)
def test_shape_functions_are_1_at_their_node_and_0_at_the_others(present: Bools) -> None:
    values, _ = shape_functions(XI[present], ETA[present], present)
    expected = np.eye(9)[present]
    assert np.array_equal(values, expected)


@pytest.mark.parametrize("present", PATTERNS)
def test_shape_functions_reproduce_every_linear_field(present: Bools) -> None:
    xi, eta = sample()
    values, local = shape_functions(xi, eta, present)
    np.testing.assert_allclose(values.sum(axis=1), 1.0, atol=1e-14)
    np.testing.assert_allclose(values @ XI, xi, atol=1e-14)
    np.testing.assert_allclose(values @ ETA, eta, atol=1e-14)
    for row, gradient in ((0, [0, 1, 0]), (1, [0, 0, 1])):
        fields = np.stack([np.ones(9), XI, ETA], axis=-1)
        np.testing.assert_allclose(local[:, row] @ fields, [gradient] * len(xi), atol=1e-14)


@pytest.mark.parametrize("present", PATTERNS)
def test_derivatives_of_shape_functions_are_their_differences(present: Bools) -> None:
    xi, eta = sample()
    local = shape_functions(xi, eta, present)[1]
    # Quadratic in either direction: the central difference is exact at any width.
    d = 0.5
    along = shape_functions(xi + d, eta, present)[0] - shape_functions(xi - d, eta, present)[0]
    up = shape_functions(xi, eta + d, present)[0] - shape_functions(xi, eta - d, present)[0]
    np.testing.assert_allclose(local, np.stack([along, up], axis=1) / (2.0 * d), atol=1e-13)


def test_nine_node_shape_functions_are_the_products_of_lagrange_s_parabolas() -> None:
    xi, eta = sample()

    def parabola(t: Floats, node: float) -> Floats:
        return 1.0 - t**2 if node == 0.0 else t * (t + node) / 2.0

    values, _ = shape_functions(xi, eta, np.ones(9, dtype=bool))
    expected = [parabola(xi, a) * parabola(eta, b) for a, b in zip(XI, ETA, strict=True)]
    np.testing.assert_allclose(values.T, expected, atol=1e-14)


# Patch tests -------------------------------------------------------------------------------------


def mixed(nx: int, ny: int, kind: int) -> tuple[Floats, Ints]:
    """Mesh the unit square with distorted elements of which some nodes are absent."""
    coordinates, elements = without_some_nodes(*distorted_square(nx, ny, kind))
    assert len(np.unique(elements > 0, axis=0)) > 5
    return coordinates, elements


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
    found = equilibrium(patch(mesh, field))
    np.testing.assert_allclose(found[used], field[used], atol=1e-11)


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
    maker: MeshMaker, kind: int, rule: Rule
) -> None:
    coordinates, elements = maker(3, 4, kind)
    found = plate.StrainField(elements, coordinates, rule).evaluate(bent(coordinates, CURVATURE))
    assert found.shape == (5, 12, len(rule.xi))
    expected = np.array([*CURVATURE, 0.0, 0.0])[:, None, None]
    np.testing.assert_allclose(found, np.broadcast_to(expected, found.shape), atol=1e-12)


@pytest.mark.parametrize("rule", [*map(gauss, ORDERS), *map(nodal, ORDERS)])
@pytest.mark.parametrize(("maker", "kind"), STRETCHED_PATCHES)
def test_a_tilted_midplane_with_upright_normals_is_sheared_by_its_slope(
    maker: MeshMaker, kind: int, rule: Rule
) -> None:
    coordinates, elements = maker(3, 4, kind)
    field = np.zeros((len(coordinates), 5))
    field[:, 2] = coordinates @ [0.3, -0.7]  # gamma_xz, gamma_yz
    found = plate.StrainField(elements, coordinates, rule).evaluate(field)
    expected = np.array([0.0, 0.0, 0.0, -0.7, 0.3])[:, None, None]
    np.testing.assert_allclose(found, np.broadcast_to(expected, found.shape), atol=1e-12)


def test_strains_do_not_depend_on_displacements_in_the_plane() -> None:
    coordinates, elements = distorted_square(3, 4)
    field = bent(coordinates, CURVATURE)
    strains = plate.StrainField(elements, coordinates, gauss(3))
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
    found = 0.5 * field @ free_stiffness((coordinates, elements)) @ field
    assert found == pytest.approx(energy, rel=1e-12)


# The stiffness as a whole ------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_rigid_motions_cause_neither_strains_nor_forces(kind: int) -> None:
    coordinates, elements = mesh = distorted_square(3, 4, kind)
    none = np.zeros(3)
    field = stretched(coordinates, none) + bent(coordinates, none)
    K = free_stiffness(mesh)
    forces = K @ field.ravel()
    assert np.abs(forces).max() < 1e-14 * (np.abs(K) @ np.abs(field.ravel())).max()
    strains = plate.StrainField(elements, coordinates, gauss(3)).evaluate(field)
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
    hourglass[:, 2] = XI**2 + ETA**2 - 3.0 * XI**2 * ETA**2
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
        (family,) = plate.families(elements, at)
        K = plate.stiffness(family, general_plate(fibres), gauss(3), gauss(3))[0]
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
        model = assemble(mesh, general_plate(), rules())
        return [model.stiffness.toarray(), model.support.toarray(), model.mass]

    whole = assembled()
    monkeypatch.setattr(assembly, "BLOCK", 2)
    for cut, expected in zip(assembled(), whole, strict=True):
        assert np.abs(cut - expected).max() < 1e-14 * np.abs(expected).max()


def test_the_assembled_stiffness_is_the_sum_of_the_elements() -> None:
    # Equal squares, but for one corner that is a little off its place.
    coordinates, elements = square(3, 3)
    coordinates[elements[4, 0] - 1] += 1e-6
    expected = np.zeros((len(coordinates), 5, len(coordinates), 5))
    for element in elements:
        (family,) = plate.families(element[None], coordinates)
        K = plate.stiffness(family, general_plate(), gauss(3), gauss(3)).reshape(9, 5, 9, 5)
        for a, b in product(range(9), repeat=2):
            expected[element[a] - 1, :, element[b] - 1] += K[a, :, b]
    found = free_stiffness((coordinates, elements))
    difference = np.abs(found - expected.reshape(found.shape)).max()
    assert difference < 1e-13 * np.abs(expected).max()


@pytest.mark.parametrize(("maker", "kind"), [*STRETCHED_PATCHES, (square, 4), (square, 9)])
def test_every_way_to_multiply_by_the_stiffness_gives_the_same_forces(
    maker: MeshMaker, kind: int
) -> None:
    coordinates, elements = maker(6, 6, kind)
    mesh = with_restraints(coordinates, elements, boundary(coordinates, elements))
    model = assemble(mesh, general_plate(), rules())
    u = np.random.default_rng(2).standard_normal(mesh.number_of_equations)
    expected = model.stiffness.toarray() @ u
    for solver in ("", "csr"):
        found = model.product(solver)(u)
        np.testing.assert_allclose(found, expected, atol=1e-13 * np.abs(expected).max())


# The transposed Jacobian -------------------------------------------------------------------------


def stiffness_of(corners: Corners, *, transposed: bool) -> Floats:
    """Stiffness of one element of the general laminate."""
    coordinates, elements = one_element(corners)
    (family,) = plate.families(elements, coordinates)
    return plate.stiffness(family, general_plate(), gauss(3), gauss(3), transposed=transposed)


def test_the_transposed_jacobian_does_no_harm_on_rectangles_along_the_axes() -> None:
    upright = ((0.5, 0.2), (2.5, 0.2), (2.5, 0.9), (0.5, 0.9))
    proper = stiffness_of(upright, transposed=False)
    np.testing.assert_allclose(
        stiffness_of(upright, transposed=True), proper, atol=1e-14 * np.abs(proper).max()
    )


def test_the_transposed_jacobian_spoils_a_skewed_element() -> None:
    proper, spoilt = (
        stiffness_of(SKEWED, transposed=slip).reshape(9, 5, 9, 5) for slip in (False, True)
    )
    for unknown in (0, 2):  # in the plane, and by transverse shear alone
        difference = np.abs(spoilt - proper)[:, unknown, :, unknown]
        assert difference.max() > 0.01 * np.abs(proper[:, unknown, :, unknown]).max()


def test_the_transposed_jacobian_fails_the_patch_tests() -> None:
    coordinates, elements = mesh = distorted_square(3, 4)
    for field in (stretched(coordinates, STRAIN), bent(coordinates, CURVATURE)):
        assert residual(mesh, field, transposed=True) > 1e-3
        found = equilibrium(patch(mesh, field, transposed=True))
        assert np.abs(found - field).max() > 1e-3
    strains = plate.StrainField(elements, coordinates, gauss(3), transposed=True)
    found = strains.evaluate(bent(coordinates, CURVATURE))
    assert np.abs(found[:3] - CURVATURE[:, None, None]).max() > 0.05
    assert np.abs(found[3:]).max() > 0.01


# Mass --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("order", [2, 3, 4])
@pytest.mark.parametrize(
    ("maker", "kind"), [(distorted_square, 4), (distorted_square, 8), (distorted_square, 9),
    (mixed, 9)]
)  # fmt: skip
def test_lumped_mass_is_positive_and_adds_up_to_the_plate_s_mass_and_inertia(
    maker: MeshMaker, kind: int, order: int
) -> None:
    coordinates, elements = mesh = maker(3, 4, kind)
    model = assemble(
        with_restraints(*mesh, nothing(coordinates)), general_plate(), rules(order, order)
    )
    used = np.isin(np.arange(1, len(coordinates) + 1), elements)
    mass = model.mass.reshape(-1, 5)[used]
    assert mass.min() > 0.0
    density, h = GENERAL_PLY.density, sum(GENERAL_LAYERS)
    np.testing.assert_allclose(mass[:, :3].sum(axis=0), density * h, rtol=1e-13)
    np.testing.assert_allclose(mass[:, 3:].sum(axis=0), density * h**3 / 12.0, rtol=1e-13)


# A node's share is the integral of its squared shape function.  Along a side of the 9-node element
# that is 4/15, 16/15, 4/15; the 8-node element's consistent mass has 6/180 at corners and 32/180 at
# mid-sides, of which 2 x 2 points make other shares.
@pytest.mark.parametrize(
    ("kind", "order", "shares"),
    [
        (4, 2, [1 / 4] * 4),
        (8, 2, [1 / 36] * 4 + [8 / 36] * 4),
        (8, 3, [3 / 76] * 4 + [16 / 76] * 4),
        (9, 3, [1 / 36] * 4 + [4 / 36] * 4 + [16 / 36]),
        (9, 4, [1 / 36] * 4 + [4 / 36] * 4 + [16 / 36]),
    ],
)
def test_a_square_s_mass_is_shared_as_the_squares_of_its_shape_functions(
    kind: int, order: int, shares: list[float]
) -> None:
    coordinates, elements = one_element(SQUARE, kind)
    (family,) = plate.families(elements, coordinates)
    lumped = plate.lumped_mass(family, isotropic_plate(0.2), gauss(order))[0]
    inertia = np.array([0.2, 0.2, 0.2, 0.2**3 / 12.0, 0.2**3 / 12.0])
    np.testing.assert_allclose(lumped, np.outer(shares, inertia), rtol=1e-13)


# Vibration ---------------------------------------------------------------------------------------


def reference_frequencies(ks: str) -> Floats:
    """Flexural frequencies of the simply supported square plate, h/a = 0.1, with multiplicity."""
    found: list[float] = []
    for row in table("freq_ssss_mindlin.csv"):
        if f"h/a=0.1 ks={ks}" in row["case"]:
            found += [float(row["omega_flex_rad/s_or_nondim"])] * (1 + (row["m"] != row["n"]))
    return np.sort(found)


def frequencies(n: int, kind: int, shear: int, count: int = 1, ks: float = 1.0) -> Floats:
    """Lowest frequencies of the same plate on n x n elements, omega a^2 sqrt(rho h/D)."""
    h = 0.1
    coordinates, elements = square(n, n, kind)
    model = assemble(
        with_restraints(coordinates, elements, simple_support(coordinates)),
        isotropic_plate(h, ks),
        rules(2 if kind == 4 else 3, shear),
    )
    scale = sparse.diags_array(1.0 / np.sqrt(model.mass))
    scaled = (scale @ model.stiffness @ scale).tocsc()
    start = np.random.default_rng(0).standard_normal(len(model.mass))
    squares = eigsh(scaled, k=count, sigma=0.0, v0=start, return_eigenvectors=False)
    D = h**3 / 12.0 / (1.0 - 0.3**2)
    return np.sort(np.sqrt(squares * h / D))


# Theory: the stiffness of elements complete to degree p makes a frequency's error O(n^-2p).  On
# rectangles the 9-node element's lumped mass is Simpson's rule (1:4:1 in each direction), which
# integrates cubics and so keeps the 4 of p = 2.  The 4-node element's is the trapezoidal rule,
# which keeps the 2 of p = 1.  Full shear quadrature stiffens coarse meshes, so that its rate shows
# later.
@pytest.mark.parametrize(
    ("kind", "shear", "meshes", "rate", "ceiling"),
    [
        (9, 2, (4, 8, 16), 4.0, 1e-6),
        (9, 3, (8, 16, 32), 4.0, 2e-6),
        (4, 1, (8, 16, 32), 2.0, 1e-3),
    ],
)
def test_the_fundamental_frequency_converges_to_mindlin_s_at_the_rate_of_theory(
    kind: int, shear: int, meshes: tuple[int, ...], rate: float, ceiling: float
) -> None:
    expected = reference_frequencies("1.000000")[0]
    errors = [abs(frequencies(n, kind, shear)[0] / expected - 1.0) for n in meshes]
    slope = -np.polyfit(np.log(meshes), np.log(errors), 1)[0]
    assert abs(slope - rate) < 0.3
    assert errors[-1] < ceiling


@pytest.mark.parametrize(("ks", "label"), [(1.0, "1.000000"), (5.0 / 6.0, "0.833333")])
@pytest.mark.parametrize(("kind", "shear", "error"), [(9, 2, 0.002), (9, 3, 0.005), (8, 2, 0.005)])
def test_the_lowest_six_frequencies_are_mindlin_s(
    kind: int, shear: int, error: float, ks: float, label: str
) -> None:
    expected = reference_frequencies(label)[:6]
    np.testing.assert_allclose(frequencies(8, kind, shear, 6, ks), expected, rtol=error)


def test_a_plate_sheared_uniformly_in_its_thickness_swings_at_the_cutoff_frequency() -> None:
    (omega,) = (
        float(row["value"])
        for row in table("laminate_report_ABD.csv")
        if row["quantity"] == "cutoff_omega"
    )
    coordinates, elements = square(3, 2)
    held = nothing(coordinates)
    held[:, :3] = True
    model = assemble(with_restraints(coordinates, elements, held), report_plate(), rules())
    for direction in ([1.0, 0.0], [0.0, 1.0]):
        theta = np.tile(direction, len(coordinates))
        np.testing.assert_allclose(
            model.stiffness @ theta,
            omega**2 * model.mass * theta,
            atol=1e-10 * omega**2 * model.mass.max(),
        )


def free_plate(n: int, kind: int) -> PlateModel:
    """A free distorted plate of the general laminate."""
    coordinates, elements = distorted_square(n, n, kind)
    return assemble(
        with_restraints(coordinates, elements, nothing(coordinates)), general_plate(), rules()
    )


def element_held_in_its_plane() -> PlateModel:
    """One 4-node element with u and v restrained: twelve equations."""
    coordinates, elements = one_element(SKEWED, 4)
    held = nothing(coordinates)
    held[:, :2] = True
    return assemble(with_restraints(coordinates, elements, held), general_plate(), rules())


@pytest.mark.parametrize(
    "model", [free_plate(4, 9), free_plate(5, 8), free_plate(6, 4), element_held_in_its_plane()]
)
def test_the_critical_time_step_is_2_over_the_highest_frequency(model: PlateModel) -> None:
    squares = eigh(model.stiffness.toarray(), np.diag(model.mass), eigvals_only=True)
    assert model.critical_time_step() == pytest.approx(2.0 / np.sqrt(squares[-1]), rel=1e-3)


def test_central_differences_stay_bounded_below_the_critical_step_and_grow_above_it() -> None:
    model = free_plate(4, 9)
    largest = []
    for factor in (0.995, 1.01):
        step = factor * model.critical_time_step()
        u = np.random.default_rng(1).standard_normal(len(model.mass))
        v = np.zeros_like(u)
        for _ in range(400):
            v -= step * (model.stiffness @ u) / model.mass
            u += step * v
        largest.append(float(np.abs(u).max()))
    assert largest[0] < 1e3
    assert largest[1] > 1e20


# Bending under load ------------------------------------------------------------------------------


def reference_deflections(ratio: float, ks: str) -> tuple[float, float]:
    """Deflections in the centre and at the quarter point under a uniform unit load."""
    (row,) = (
        row
        for row in table("static_ssss_mindlin.csv")
        if f"h/a={ratio:g} ks={ks} " in row["case"] and row["load"].startswith("uni")
    )
    return float(row["w_centre"]), float(row["quarter_point w(a/4,b/4)"])


def deflections(
    mesh: tuple[Floats, Ints], loads: Floats, h: float, orders: tuple[int, int], ks: float = 1.0
) -> tuple[float, ...]:
    """Deflections in the centre and at the quarter point of the simply supported unit square."""
    coordinates, elements = mesh
    held = simple_support(coordinates)
    forces = np.zeros(held.shape)
    forces[:, 2] = loads
    model = assemble(
        with_restraints(coordinates, elements, held, np.where(held, 0.0, forces)),
        isotropic_plate(h, ks),
        rules(*orders),
    )
    w = equilibrium(model)[:, 2]
    places = [np.hypot(*(coordinates - place).T) for place in (0.5, 0.25)]
    return tuple(float(w[place.argmin()]) for place in places)


def simpson_loads(elements: Ints, numnp: int, area: float) -> Floats:
    """Nodal loads of a unit pressure on equal 9-node rectangles."""
    shares = np.tile(np.array([1, 1, 1, 1, 4, 4, 4, 4, 16]) / 36.0 * area, len(elements))
    return summed(elements - 1, shares, numnp)


def summed(nodes: Indices, values: Floats, numnp: int) -> Floats:
    """Add up what elements give to their nodes."""
    sums = np.bincount(nodes.ravel(), weights=values.ravel(), minlength=numnp)
    return np.asarray(sums, dtype=np.float64)


def errors_of_square(n: int, ratio: float, shear: int, ks: float, label: str) -> Floats:
    """Errors of both deflections under unit pressure on n x n 9-node elements, relative."""
    coordinates, elements = mesh = square(n, n)
    loads = simpson_loads(elements, len(coordinates), 1.0 / n**2)
    found = deflections(mesh, loads, ratio, (3, shear), ks)
    return np.array(found) / reference_deflections(ratio, label) - 1.0


@pytest.mark.parametrize(("ks", "label"), [(1.0, "1.000000"), (5.0 / 6.0, "0.833333")])
@pytest.mark.parametrize("ratio", [0.1, 0.01])
def test_a_uniformly_loaded_plate_bends_as_mindlin_s_however_thin(
    ratio: float, ks: float, label: str
) -> None:
    assert np.abs(errors_of_square(8, ratio, 2, ks, label)).max() < 2e-4


# With nine shear points the elements are conforming, so that the plate is too stiff: the thinner,
# the more.  Errors fall with n^-4 once elements are about as wide as the plate is thick, with n^-2
# before.
@pytest.mark.parametrize(("ks", "label"), [(1.0, "1.000000"), (5.0 / 6.0, "0.833333")])
@pytest.mark.parametrize(("ratio", "in_centre"), [(0.1, 5e-4), (0.01, 5e-3)])
def test_full_shear_quadrature_stiffens_a_plate_less_and_less_on_finer_meshes(
    ratio: float, in_centre: float, ks: float, label: str
) -> None:
    coarse, middle, fine = (errors_of_square(n, ratio, 3, ks, label) for n in (4, 8, 16))
    assert abs(middle[0]) < in_centre
    for errors in (coarse, middle, fine):
        assert errors.max() < 0.0
    assert (np.abs(middle) < np.abs(coarse) / 4.0).all()
    assert (np.abs(fine) < np.abs(middle) / 4.0).all()


@pytest.mark.parametrize(
    ("kind", "orders", "ceiling"), [(4, (2, 1), 1e-2), (8, (3, 2), 1e-3), (9, (3, 2), 1e-3)]
)
def test_bending_converges_on_ever_finer_distorted_meshes(
    kind: int, orders: tuple[int, int], ceiling: float
) -> None:
    expected = reference_deflections(0.1, "1.000000")[0]
    errors = []
    for n in (4, 8, 16):
        coordinates, elements = mesh = distorted_square(n, n, kind)
        (family,) = plate.families(elements, coordinates)
        at = plate.interpolate(family, gauss(3))
        loads = summed(family.nodes, at.area @ at.N, len(coordinates))
        errors.append(abs(deflections(mesh, loads, 0.1, orders)[0] / expected - 1.0))
    assert errors[2] < errors[1] / 2.0 < errors[0] / 4.0
    assert errors[2] < ceiling


def test_a_family_holds_the_elements_that_have_the_same_nodes() -> None:
    coordinates, elements = mixed(3, 4, 9)
    found = plate.families(elements, coordinates)
    assert sorted(row for family in found for row in family.rows) == list(range(12))
    for family in found:
        assert len(family.present) == quadrilateral.NODES
        for row, nodes in zip(family.rows, family.nodes, strict=True):
            assert np.array_equal(elements[row] > 0, family.present)
            assert np.array_equal(elements[row][elements[row] > 0], nodes + 1)
