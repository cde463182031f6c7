"""Quadrature rules, and shape functions of the quadratic quadrilaterals."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np
import pytest

from fecm.mechanics.elements import HIGHEST_ORDER, QUADRILATERAL, Quadrature, gauss, nodal
from tests.builders import Bools, Floats
from tests.patches import PATTERNS

shape_functions = QUADRILATERAL.shape_functions
XI, ETA = QUADRILATERAL.xi, QUADRILATERAL.eta
ORDERS = range(1, HIGHEST_ORDER + 1)


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
    order: int, rule_of: Callable[[int], Quadrature]
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
def test_order_4_takes_four_rectangles_in_the_printed_programs_order(
    rule_of: Callable[[int], Quadrature], inner: float, outer: float
) -> None:
    rule = rule_of(4)
    expected = [
        (sx * half_width, sy * half_height)
        for half_width, half_height in (
            (outer, outer),
            (inner, outer),
            (outer, inner),
            (inner, inner),
        )
        for sx, sy in ((-1, -1), (1, -1), (1, 1), (-1, 1))
    ]
    np.testing.assert_allclose(np.stack([rule.xi, rule.eta], axis=-1), expected, atol=1e-14)


def test_nodal_points_of_order_3_are_the_elements_nodes() -> None:
    rule = nodal(3)
    assert np.array_equal(rule.xi, XI)
    assert np.array_equal(rule.eta, ETA)


@pytest.mark.parametrize("order", [-3, 0, 5])
@pytest.mark.parametrize("rule_of", [gauss, nodal])
def test_orders_outside_1_to_4_are_refused(
    order: int, rule_of: Callable[[int], Quadrature]
) -> None:
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


def test_nine_node_shape_functions_are_the_products_of_lagranges_parabolas() -> None:
    xi, eta = sample()

    def parabola(t: Floats, node: float) -> Floats:
        return 1.0 - t**2 if node == 0.0 else t * (t + node) / 2.0

    values, _ = shape_functions(xi, eta, np.ones(9, dtype=bool))
    expected = [parabola(xi, a) * parabola(eta, b) for a, b in zip(XI, ETA, strict=True)]
    np.testing.assert_allclose(values.T, expected, atol=1e-14)
