"""Patch tests and free motions of every family of elements.

Quadrilaterals with 4, 8 and 9 nodes are also tested in ``test_plate``; here are the triangle, the
transitions between these, and the cubic elements with 10 to 12 nodes.
"""

from __future__ import annotations

import numpy as np
import pytest

from fecm.mechanics import interpolation
from fecm.mechanics.elements import Quadrature, gauss, nodal
from fecm.mechanics.mesh import element_blocks
from fecm.mechanics.plate import PlateModel
from fecm.mechanics.stiffness_product import stiffness_operator
from fecm.mechanics.strains import StrainField
from tests.builders import (
    SKEWED,
    SQUARE,
    Bools,
    Corners,
    Floats,
    Ints,
    boundary,
    distorted_square,
    general_plate,
    one_element,
    parallelograms,
    rules,
    square,
    with_restraints,
)
from tests.patches import (
    CURVATURE,
    PATTERNS,
    STRAIN,
    MeshMaker,
    bent,
    equilibrium,
    free_stiffness,
    patch,
    residual,
    stretched,
)

Mesh = tuple[Floats, Ints]

TRIANGLE_AND_CUBICS = (3, 10, 11, 12)


def with_pattern_in_the_middle(present: Bools) -> Mesh:
    """Nine distorted elements; the one in the middle has a pattern, its neighbours follow it."""
    coordinates, elements = distorted_square(3, 3, 12 if len(present) == 12 else 9)
    absent = elements[4][~present]
    return coordinates, np.where(np.isin(elements, absent), 0, elements).astype(np.int32)


def cubic_patterns(count: int) -> list[Bools]:
    """Some of the ways in which third points are absent, one of 10 to 12 staying."""
    rng = np.random.default_rng(12)
    actual: list[Bools] = []
    while len(actual) < count:
        present = np.concatenate([np.ones(4), rng.integers(0, 2, 8)]).astype(bool)
        if present[9:].any():
            actual.append(present)
    return actual


TRANSITIONS = [
    pytest.param(pattern, id="".join(str(n + 1) for n in np.flatnonzero(pattern[4:]) + 4) or "4")
    for pattern in PATTERNS
]
CUBIC_TRANSITIONS = [
    pytest.param(pattern, id="-".join(str(n + 5) for n in np.flatnonzero(pattern[4:])))
    for pattern in cubic_patterns(12)
]


def three_families() -> Mesh:
    """Distorted triangles, quadrilaterals and cubic elements in one mesh of twelve columns."""
    coordinates, corners = distorted_square(3, 3, 4)
    elements = np.zeros((10, 12), dtype=np.int32)
    elements[:9, :4] = corners
    a, b, c, d = corners[4].tolist()
    elements[4, :4], elements[9, :3] = (a, b, c, 0), (c, d, a)
    # Third points on a side that the first two elements have in common: nodes 6 and 11, 9 and 8.
    start, end = corners[0, 1], corners[0, 2]
    ends = coordinates[[start - 1, end - 1]]
    third, two_thirds = (2 * ends[0] + ends[1]) / 3, (ends[0] + 2 * ends[1]) / 3
    numnp = len(coordinates)
    elements[0, [5, 10]] = elements[1, [8, 7]] = numnp + 1, numnp + 2
    # And one at the foot of the second element, which makes it end with node 10.
    foot = (coordinates[corners[1, 0] - 1] + 2 * coordinates[corners[1, 1] - 1]) / 3
    elements[1, 9] = numnp + 3
    return np.vstack([coordinates, third, two_thirds, foot]), elements


def exact_on(mesh: Mesh, field: Floats) -> None:
    """Require equilibrium inside a patch under a field, and the field from its boundary's."""
    assert residual(mesh, field) < 1e-14
    used = np.isin(np.arange(1, len(field) + 1), mesh[1])
    np.testing.assert_allclose(equilibrium(patch(mesh, field))[used], field[used], atol=1e-10)


# Patches ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", TRIANGLE_AND_CUBICS)
@pytest.mark.parametrize("maker", [distorted_square, parallelograms])
def test_a_patch_of_triangles_and_cubics_reproduces_constant_membrane_strain(
    maker: MeshMaker, kind: int
) -> None:
    mesh = maker(3, 4, kind)
    exact_on(mesh, stretched(mesh[0], STRAIN))


@pytest.mark.parametrize("present", [*TRANSITIONS, *CUBIC_TRANSITIONS])
@pytest.mark.few(14)  # of 44, 0.02 s each
def test_a_transition_element_in_a_patch_reproduces_constant_membrane_strain(
    present: Bools,
) -> None:
    mesh = with_pattern_in_the_middle(present)
    assert np.array_equal(mesh[1][4] > 0, present)
    exact_on(mesh, stretched(mesh[0], STRAIN))


def test_triangles_quadrilaterals_and_cubic_elements_in_one_mesh_pass_the_patch_test() -> None:
    coordinates, elements = mesh = three_families()
    names = [family.shape.name for family in element_blocks(elements, coordinates)]
    assert set(names) == {"triangle", "quadrilateral", "cubic quadrilateral"}
    exact_on(mesh, stretched(coordinates, STRAIN))


def test_a_patch_of_12_node_parallelograms_reproduces_constant_curvature() -> None:
    mesh = parallelograms(3, 4, 12)
    exact_on(mesh, bent(mesh[0], CURVATURE) + stretched(mesh[0], STRAIN))


# Off parallelograms the squares of x and y hold a xi^2 eta^2, which a 12-node element lacks; the
# triangle's and the one-point sides' fields are linear.
@pytest.mark.parametrize(
    ("maker", "kind"),
    [(distorted_square, 12), (parallelograms, 3), (parallelograms, 10), (parallelograms, 11)],
)
def test_elsewhere_constant_curvature_is_not_in_the_elements_fields(
    maker: MeshMaker, kind: int
) -> None:
    mesh = maker(3, 4, kind)
    assert residual(mesh, bent(mesh[0], CURVATURE)) > 1e-6


@pytest.mark.parametrize("rule", [gauss(2), gauss(4), nodal(3), nodal(4)])
def test_strains_of_linear_curvature_are_exact_in_12_node_parallelograms(
    rule: Quadrature,
) -> None:
    coordinates, elements = parallelograms(2, 3, 12)
    (x, y), (a, b, c, d) = coordinates.T, (0.3, -0.7, 0.4, 0.9)
    field = np.zeros((len(coordinates), 5))
    field[:, 2] = a * x**3 + b * x**2 * y + c * x * y**2 + d * y**3
    field[:, 3] = 3 * a * x**2 + 2 * b * x * y + c * y**2
    field[:, 4] = b * x**2 + 2 * c * x * y + 3 * d * y**2
    strains = StrainField(elements, coordinates, rule).evaluate(field)
    (family,) = element_blocks(elements, coordinates)
    values, _ = interpolation.local_shape_functions(family, rule)
    px, py = np.einsum("pn,enk->kep", values, family.coordinates)
    expected = [-6 * a * px - 2 * b * py, -2 * c * px - 6 * d * py, -4 * (b * px + c * py)]
    np.testing.assert_allclose(strains[:3], expected, atol=1e-12)
    np.testing.assert_allclose(strains[3:], 0.0, atol=1e-12)


@pytest.mark.parametrize("kind", TRIANGLE_AND_CUBICS)
def test_rigid_motions_of_triangles_and_cubics_cause_neither_strains_nor_forces(kind: int) -> None:
    rigid(distorted_square(3, 4, kind))


def test_rigid_motions_of_transition_elements_cause_neither_strains_nor_forces() -> None:
    for present in (*PATTERNS, *cubic_patterns(12)):
        rigid(with_pattern_in_the_middle(present))
    rigid(three_families())


def rigid(mesh: Mesh) -> None:
    """Require that a plate moved as a whole has no strains and no forces."""
    coordinates, elements = mesh
    none = np.zeros(3)
    field = stretched(coordinates, none) + bent(coordinates, none)
    K = free_stiffness(mesh)
    assert np.abs(K @ field.ravel()).max() < 1e-14 * (np.abs(K) @ np.abs(field.ravel())).max()
    strains = StrainField(elements, coordinates, gauss(3)).evaluate(field)
    np.testing.assert_allclose(strains, 0.0, atol=1e-12)


# Counted as in ``test_plate``: a triangle has 3 fields without membrane strain, 3 without curvature
# and 3 w's, less two shear strains a point; the seventh ends where a second triangle joins in.
@pytest.mark.parametrize("corners", [SQUARE, SKEWED])
@pytest.mark.parametrize(
    ("kind", "bending", "shear", "modes"),
    [(3, 1, 1, 3 + 3 + 3 - 2), (3, 2, 2, 6), (12, 3, 3, 6), (12, 4, 4, 6),
     (12, 4, 2, 3 + 3 + 12 - 8)],
)  # fmt: skip
def test_triangles_and_cubics_have_six_rigid_modes_and_those_their_quadrature_misses(
    kind: int, bending: int, shear: int, modes: int, corners: Corners
) -> None:
    values = np.linalg.eigvalsh(free_stiffness(one_element(corners, kind), bending, shear))
    assert np.abs(values[:modes]).max() < 1e-13 * values[-1]
    assert values[modes] > 1e-6 * values[-1]


def test_two_triangles_have_six_rigid_modes_under_one_shear_point_each() -> None:
    coordinates = np.array(SKEWED)
    elements = np.array([[1, 2, 3], [4, 1, 3]], dtype=np.int32)
    values = np.linalg.eigvalsh(free_stiffness((coordinates, elements), 1, 1))
    assert np.abs(values[:6]).max() < 1e-13 * values[-1]
    assert values[6] > 1e-4 * values[-1]


@pytest.mark.parametrize("kind", TRIANGLE_AND_CUBICS)
def test_every_way_to_multiply_by_the_stiffness_gives_the_same_forces(kind: int) -> None:
    coordinates, elements = square(6, 6, kind)
    mesh = with_restraints(coordinates, elements, boundary(coordinates, elements))
    model = PlateModel(mesh, general_plate(), rules())
    u = np.random.default_rng(2).standard_normal(mesh.number_of_equations)
    expected = model.stiffness.toarray() @ u
    for solver in ("", "csr"):
        product = stiffness_operator(model, solver)(u)
        np.testing.assert_allclose(product, expected, atol=1e-13 * np.abs(expected).max())
