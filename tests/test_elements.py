"""Families of elements: what their shape functions are 1 at, reproduce, and share with others."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import numpy as np
import pytest

from fecm.mechanics import interpolation
from fecm.mechanics.elements import CUBIC, QUADRILATERAL, TRIANGLE, ElementShape, Quadrature, nodal
from fecm.mechanics.mesh import SHAPES, ElementBlock, element_blocks, longest_sides, shape_of
from tests.builders import Bools, Floats

BY_NAME = pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: shape.name)

# Where the report's program puts the nodes 1 to 12 of a cubic element, in thirds.
CUBIC_PLACES = [
    (-3, -3), (3, -3), (3, 3), (-3, 3), (-1, -3), (3, -1), (1, 3), (-3, 1), (-3, -1), (1, -3),
    (3, 1), (-1, 3),
]  # fmt: skip
# Nodes of the sides eta = -1, xi = 1, eta = 1, xi = -1, by their number.
SIDES = {
    "quadrilateral": ((1, 2, 5), (2, 3, 6), (4, 3, 7), (1, 4, 8)),
    "cubic quadrilateral": ((1, 2, 5, 10), (2, 3, 6, 11), (4, 3, 12, 7), (1, 4, 9, 8)),
}


def patterns(shape: ElementShape) -> Iterator[Bools]:
    """Every way a family's nodes beyond the corners can be present."""
    for rest in product((False, True), repeat=shape.nodes - shape.corners):
        yield np.array([True] * shape.corners + list(rest))


def first(shape: ElementShape, nodes: int) -> Bools:
    """The first nodes of a family, none of them absent."""
    return np.arange(shape.nodes) < nodes


def sample(count: int = 20) -> tuple[Floats, Floats]:
    """Some points of the square."""
    xi, eta = np.random.default_rng(0).uniform(-1.0, 1.0, (2, count))
    return xi, eta


def on_side(side: int, t: Floats) -> tuple[Floats, Floats]:
    """Points of a side, t running as xi or eta does."""
    ones = np.ones_like(t)
    return ((t, -ones), (ones, t), (t, ones), (-ones, t))[side]


def lagrange(t: Floats, places: list[float]) -> Floats:
    """Polynomials in t that are 1 at one of some places and 0 at the others, (n, places)."""
    columns = [
        np.prod([(t - b) / (a - b) for b in places if b != a], axis=0) * np.ones_like(t)
        for a in places
    ]
    return np.stack(columns, axis=1)


# One family ---------------------------------------------------------------------------------------


@BY_NAME
def test_a_function_is_1_at_its_node_and_0_at_the_others_whichever_are_absent(
    shape: ElementShape,
) -> None:
    for present in patterns(shape):
        values, _ = shape.shape_functions(shape.xi[present], shape.eta[present], present)
        np.testing.assert_allclose(values, np.eye(shape.nodes)[present], atol=1e-15)


@BY_NAME
def test_functions_add_up_to_1_and_their_derivatives_to_0(shape: ElementShape) -> None:
    for present in patterns(shape):
        values, local = shape.shape_functions(*sample(), present)
        np.testing.assert_allclose(values.sum(axis=1), 1.0, atol=1e-14)
        np.testing.assert_allclose(local.sum(axis=2), 0.0, atol=1e-14)


@BY_NAME
def test_functions_of_absent_nodes_are_zero(shape: ElementShape) -> None:
    for present in patterns(shape):
        values, local = shape.shape_functions(*sample(), present)
        assert not values[:, ~present].any()
        assert not local[:, :, ~present].any()


@BY_NAME
def test_derivatives_are_differences(shape: ElementShape) -> None:
    xi, eta = sample()
    h = 0.25
    # Derivatives by five points: exact up to the fourth power, whatever the distance.
    shifts = h * np.array([-2.0, -1.0, 1.0, 2.0])[:, None]
    around = (
        np.stack([xi + shifts, xi + 0.0 * shifts]),
        np.stack([eta + 0.0 * shifts, eta + shifts]),
    )
    for present in patterns(shape):
        at = shape.shape_functions(around[0].ravel(), around[1].ravel(), present)[0]
        at = at.reshape(2, 4, len(xi), -1)
        expected = (at[:, 0] - 8.0 * at[:, 1] + 8.0 * at[:, 2] - at[:, 3]) / (12.0 * h)
        local = shape.shape_functions(xi, eta, present)[1]
        np.testing.assert_allclose(local, expected.swapaxes(0, 1), atol=1e-12)


@pytest.mark.parametrize("shape", [QUADRILATERAL, CUBIC], ids=lambda shape: shape.name)
def test_whatever_is_absent_linear_fields_are_reproduced(shape: ElementShape) -> None:
    xi, eta = sample()
    for present in patterns(shape):
        values, _ = shape.shape_functions(xi, eta, present)
        np.testing.assert_allclose(values @ shape.xi, xi, atol=1e-14)
        np.testing.assert_allclose(values @ shape.eta, eta, atol=1e-14)


BILINEAR = {(0, 0), (1, 0), (0, 1), (1, 1)}
SERENDIPITY = BILINEAR | {(2, 0), (0, 2), (2, 1), (1, 2)}


@pytest.mark.parametrize(
    ("shape", "nodes", "powers"),
    [
        (QUADRILATERAL, 4, BILINEAR),
        (QUADRILATERAL, 8, SERENDIPITY),
        (QUADRILATERAL, 9, SERENDIPITY | {(2, 2)}),
        (CUBIC, 12, SERENDIPITY | {(3, 0), (0, 3), (3, 1), (1, 3)}),
    ],
    ids=["4", "8", "9", "12"],
)
def test_a_square_reproduces_as_many_powers_of_xi_and_eta_as_it_has_nodes_and_no_others(
    shape: ElementShape, nodes: int, powers: set[tuple[int, int]]
) -> None:
    xi, eta = sample()
    values, _ = shape.shape_functions(xi, eta, first(shape, nodes))
    names = {
        (p, q)
        for p, q in product(range(5), repeat=2)
        if np.abs(values @ (shape.xi**p * shape.eta**q) - xi**p * eta**q).max() < 1e-13
    }
    assert names == powers
    assert len(names) == nodes


def test_a_triangles_functions_are_its_area_coordinates() -> None:
    corners = np.array([[0.2, 0.1], [2.1, 0.7], [0.9, 1.8]])
    values, _ = TRIANGLE.shape_functions(*sample(), first(TRIANGLE, 3))
    points = values @ corners

    def area(a: Floats, b: Floats, c: Floats) -> Floats:
        u, v = b - a, c - a
        return np.asarray(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0])

    whole = area(*corners)
    for i in range(3):
        part = area(points, corners[(i + 1) % 3], corners[(i + 2) % 3])
        np.testing.assert_allclose(values[:, i], part / whole, atol=1e-14)
    assert len(np.unique(points.round(6), axis=0)) == len(points)  # the square fills the triangle


def test_a_triangle_is_the_4_node_square_with_corners_3_and_4_in_one_place() -> None:
    merged, local = TRIANGLE.shape_functions(*sample(), first(TRIANGLE, 3))
    square, slopes = QUADRILATERAL.shape_functions(*sample(), first(QUADRILATERAL, 4))
    np.testing.assert_allclose(merged[:, 2], square[:, 2] + square[:, 3], atol=1e-15)
    np.testing.assert_allclose(merged[:, :2], square[:, :2], atol=1e-15)
    np.testing.assert_allclose(local[..., 2], slopes[..., 2] + slopes[..., 3], atol=1e-15)


def test_nodes_of_a_cubic_element_stand_where_the_reports_program_puts_them() -> None:
    np.testing.assert_allclose(3.0 * np.stack([CUBIC.xi, CUBIC.eta], axis=1), CUBIC_PLACES)


def test_twelve_node_functions_are_the_serendipity_ones_of_textbooks() -> None:
    xi, eta = sample()
    values, _ = CUBIC.shape_functions(xi, eta, first(CUBIC, 12))
    for i in range(4):
        a, b = CUBIC_PLACES[i][0] / 3.0, CUBIC_PLACES[i][1] / 3.0
        corner = (1 + a * xi) * (1 + b * eta) * (9.0 * (xi**2 + eta**2) - 10.0) / 32.0
        np.testing.assert_allclose(values[:, i], corner, atol=1e-14)
    fifth = 9.0 / 32.0 * (1.0 - eta) * (1.0 - xi**2) * (1.0 - 3.0 * xi)
    np.testing.assert_allclose(values[:, 4], fifth, atol=1e-14)
    eleventh = 9.0 / 32.0 * (1.0 + xi) * (1.0 - eta**2) * (1.0 + 3.0 * eta)
    np.testing.assert_allclose(values[:, 10], eleventh, atol=1e-14)


# Along sides --------------------------------------------------------------------------------------


@pytest.mark.parametrize("side", range(4))
def test_a_cubic_along_a_side_is_exact_between_its_four_nodes(side: int) -> None:
    t = np.linspace(-1.0, 1.0, 11)
    places = (CUBIC.xi, CUBIC.eta)[side % 2]

    def polynomial(s: Floats) -> Floats:
        return 0.3 - 1.1 * s + 0.7 * s**2 + 2.3 * s**3

    # Whatever the other nodes do: their functions vanish on the side.
    nodal = np.random.default_rng(3).standard_normal(12)
    numbers = np.array(SIDES[CUBIC.name][side]) - 1
    nodal[numbers] = polynomial(places[numbers])
    values, _ = CUBIC.shape_functions(*on_side(side, t), first(CUBIC, 12))
    np.testing.assert_allclose(values @ nodal, polynomial(t), atol=1e-13)


@pytest.mark.parametrize("side", range(4))
@pytest.mark.parametrize("shape", [QUADRILATERAL, CUBIC], ids=lambda shape: shape.name)
def test_on_a_side_functions_depend_on_that_sides_nodes_alone(
    shape: ElementShape, side: int
) -> None:
    t = np.linspace(-1.0, 1.0, 9)
    numbers = np.array(SIDES[shape.name][side]) - 1
    known: dict[tuple[bool, ...], Floats] = {}
    for present in patterns(shape):
        values, _ = shape.shape_functions(*on_side(side, t), present)
        others = np.setdiff1d(np.arange(shape.nodes), numbers)
        assert np.abs(values[:, others]).max() <= 1e-15
        expected = known.setdefault(tuple(present[numbers]), values[:, numbers])
        assert np.abs(values[:, numbers] - expected).max() <= 1e-15
    # Two ends alone make lines, all nodes Lagrange's polynomials through them.
    ends = known[(True, True, *([False] * (len(numbers) - 2)))]
    np.testing.assert_allclose(ends[:, :2], lagrange(t, [-1.0, 1.0]), atol=1e-14)
    inner = {3: [0.0], 4: [-1.0 / 3.0, 1.0 / 3.0]}[len(numbers)]
    full = known[(True,) * len(numbers)]
    np.testing.assert_allclose(full, lagrange(t, [-1.0, 1.0, *inner]), atol=1e-14)


def test_one_third_point_of_a_side_looks_the_same_from_both_elements() -> None:
    t = np.linspace(-1.0, 1.0, 9)
    left, right = first(CUBIC, 12), first(CUBIC, 12)
    left[11 - 1] = False  # node 6 stays, which is node 9 of the neighbour on the right
    right[8 - 1] = False
    at_left, _ = CUBIC.shape_functions(*on_side(1, t), left)
    at_right, _ = CUBIC.shape_functions(*on_side(3, t), right)
    for mine, other in ((2, 1), (3, 4), (6, 9)):
        np.testing.assert_allclose(at_left[:, mine - 1], at_right[:, other - 1], atol=1e-15)
    assert np.abs(at_left[:, 5]).max() > 1.0


def test_a_triangles_sides_are_lines_that_fit_a_4_node_element() -> None:
    t = np.linspace(-1.0, 1.0, 9)
    rising, falling = (1.0 + t) / 2.0, (1.0 - t) / 2.0
    zero = np.zeros_like(t)
    lines = {
        0: (falling, rising, zero), 1: (zero, falling, rising), 2: (zero, zero, 1.0 + zero),
        3: (falling, zero, rising),
    }  # fmt: skip
    for side, expected in lines.items():
        values, _ = TRIANGLE.shape_functions(*on_side(side, t), first(TRIANGLE, 3))
        np.testing.assert_allclose(values.T, expected, atol=1e-15)


def test_a_field_runs_on_without_a_step_from_a_transition_element_to_its_neighbours() -> None:
    t = np.linspace(-1.0, 1.0, 7)
    nodal = np.random.default_rng(5).standard_normal(9)
    for present in patterns(QUADRILATERAL):
        for side, (start, end, inner) in enumerate(SIDES[QUADRILATERAL.name]):
            # The neighbour has the side as its own first one, with the mid-side the element has.
            neighbour = first(QUADRILATERAL, 9)
            neighbour[4] = present[inner - 1]
            values = np.random.default_rng(6).standard_normal(9)
            values[[0, 1, 4]] = nodal[[start - 1, end - 1, inner - 1]]
            mine, _ = QUADRILATERAL.shape_functions(*on_side(side, t), present)
            other, _ = QUADRILATERAL.shape_functions(*on_side(0, t), neighbour)
            np.testing.assert_allclose(mine @ nodal, other @ values, atol=1e-14)


# Which family -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("last", "shape"),
    [(3, TRIANGLE), (4, QUADRILATERAL), (5, QUADRILATERAL), (6, QUADRILATERAL), (7, QUADRILATERAL),
     (8, QUADRILATERAL), (9, QUADRILATERAL), (10, CUBIC), (11, CUBIC), (12, CUBIC)],
    ids=lambda value: getattr(value, "name", value),
)  # fmt: skip
@pytest.mark.parametrize("columns", [12, 16])
def test_the_last_node_present_tells_the_family(
    last: int, shape: ElementShape, columns: int
) -> None:
    present = np.zeros(columns, dtype=bool)
    present[: min(4, last)] = True
    present[last - 1] = True
    assert shape_of(present) is shape


def test_there_is_no_family_with_a_thirteenth_node() -> None:
    with pytest.raises(ValueError, match="at most 12 nodes; this one has a node 13"):
        shape_of(np.ones(13, dtype=bool))


def sorted_elements(*rows: list[int]) -> list[ElementBlock]:
    """Families of elements with twelve columns over nodes on a line of no meaning."""
    elements = np.zeros((len(rows), 12), dtype=np.int32)
    for row, nodes in zip(elements, rows, strict=True):
        row[: len(nodes)] = nodes
    coordinates = np.random.default_rng(0).uniform(size=(30, 2))
    return element_blocks(elements, coordinates)


def test_elements_are_sorted_by_their_nodes_and_keep_their_rows() -> None:
    actual = sorted_elements(
        [1, 2, 3],
        [1, 2, 3, 4],
        [4, 5, 6],
        list(range(1, 13)),
        [1, 2, 3, 4, 0, 6],
        [1, 2, 3, 4, 0, 0, 0, 0, 0, 10],
    )
    by_rows = {tuple(family.rows.tolist()): family for family in actual}
    assert {rows: family.shape.name for rows, family in by_rows.items()} == {
        (0, 2): "triangle",
        (1,): "quadrilateral",
        (4,): "quadrilateral",
        (3,): "cubic quadrilateral",
        (5,): "cubic quadrilateral",
    }
    assert by_rows[0, 2].nodes.tolist() == [[0, 1, 2], [3, 4, 5]]
    assert by_rows[5,].nodes.tolist() == [[0, 1, 2, 3, 9]]
    for family in actual:
        assert len(family.present) == family.shape.nodes
        assert family.present.sum() == family.nodes.shape[1]
        assert family.take(np.array([0])).shape is family.shape


@pytest.mark.parametrize(
    ("nodes", "message"),
    [
        ([1, 2], "element 2 lacks one of the 3 corners of a triangle"),
        ([1, 0, 3], "element 2 lacks one of the 3 corners of a triangle"),
        ([1, 2, 0, 4], "element 2 lacks one of the 4 corners of a quadrilateral"),
        ([1, 2, 3, 0, 5], "element 2 lacks one of the 4 corners of a quadrilateral"),
        ([1, 2, 3, 0, *range(5, 13)], "element 2 lacks one of the 4 corners of a cubic"),
    ],
)
def test_an_element_without_one_of_its_corners_is_named(nodes: list[int], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        sorted_elements([1, 2, 3, 4], nodes)


def test_the_longest_side_of_a_triangle_is_one_of_its_three() -> None:
    coordinates = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 4.0], [0.0, 4.0], [100.0, 0.0]])
    elements = np.array([[1, 2, 3, 0], [1, 2, 3, 4]], dtype=np.int32)
    assert longest_sides(elements, coordinates).tolist() == [5.0, 4.0]


def test_shape_functions_of_a_family_come_for_the_nodes_it_has() -> None:
    rule = Quadrature(np.array([0.1, 0.3]), np.array([-0.2, 0.5]), np.ones(2))
    (family,) = sorted_elements([1, 2, 3, 4, 5, 0, 0, 0, 0, 10])
    values, local = interpolation.local_shape_functions(family, rule)
    assert (values.shape, local.shape) == ((2, 6), (2, 2, 6))
    np.testing.assert_allclose(values.sum(axis=1), 1.0, atol=1e-14)


@pytest.mark.parametrize("away", [0.0, 1.0, 1.0e7])
def test_jacobians_are_positive_where_their_determinants_are_also_at_straight_corners(
    away: float,
) -> None:
    random = np.random.default_rng(2)
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) + 0.2 * random.random((200, 4, 2))
    share = random.random((200, 1))
    corners[:, 2] = corners[:, 1] * (1.0 - share) + corners[:, 3] * share
    nodes = np.arange(800, dtype=np.int32).reshape(-1, 4) + 1
    (family,) = element_blocks(nodes, corners.reshape(-1, 2) + away)
    determinants = interpolation.jacobian_determinants(family, nodal(2))
    assert np.abs(determinants[:, 2]).max() < 1e-6  # rounding decides there
    expected = (determinants > 0.0).all(axis=1)
    actual = interpolation.has_positive_jacobians(family, nodal(2))
    assert actual.tolist() == expected.tolist()
    assert 0 < expected.sum() < 200
