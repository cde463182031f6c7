"""Roots of functions of one number."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from fecm.mechanics.roots import root


@pytest.mark.parametrize(
    ("function", "low", "high", "expected"),
    [
        (lambda x: x * x - 2.0, 0.0, 2.0, math.sqrt(2.0)),
        (lambda x: 2.0 - x * x, 2.0, 0.0, math.sqrt(2.0)),
        (lambda x: math.exp(x) - 1e6, 0.0, 100.0, math.log(1e6)),
        (lambda x: math.atan(1e4 * (x - 0.3)), 0.0, 1e3, 0.3),
        (lambda x: math.copysign(1.0, x - 0.7), 0.0, 1.0, 0.7),
    ],
)
def test_a_root_is_found_wherever_the_ends_are(
    function: Callable[[float], float], low: float, high: float, expected: float
) -> None:
    assert root(function, low, high, 1e-12) == pytest.approx(expected, abs=1e-11)


def test_an_end_can_be_the_root() -> None:
    assert root(lambda x: x - 1.0, 1.0, 3.0, 1e-9) == 1.0
    assert root(lambda x: x - 3.0, 1.0, 3.0, 1e-9) == 3.0


def test_few_values_are_needed() -> None:
    calls = []

    def function(x: float) -> float:
        calls.append(x)
        return x**3 - 5.0

    assert root(function, 0.0, 10.0, 1e-12) == pytest.approx(5.0 ** (1.0 / 3.0), rel=1e-14)
    assert len(calls) < 20


def test_ends_of_one_sign_are_refused() -> None:
    with pytest.raises(ValueError, match="the same sign at 1 and 2"):
        root(lambda x: x, 1.0, 2.0, 1e-9)
