"""Standard errors of a location, and the contact of its force, against values found by hand."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from fecm.location.fit import Errors, LocationFit, PlaceTrial, judged_force
from tests.panels import Floats

NOISE = 2e-6


def strains_of_two_gages(x: float, y: float, shift: float = 0.0) -> Floats:
    """Strains per force of two gages at two times, (2, 2, 1)."""
    assert shift == 0.0
    return np.array([[1.0 + 0.1 * x, 2.0], [1.0 + 0.2 * y, 2.0]])[:, :, None]


@pytest.fixture
def pair() -> tuple[LocationFit, PlaceTrial]:
    """A unit force at the origin."""
    design, one = strains_of_two_gages(0.0, 0.0), np.ones(1)
    model = SimpleNamespace(
        design=strains_of_two_gages, observation=SimpleNamespace(interval=1.0, count=4)
    )
    fit = LocationFit(model, side=1.0)  # type: ignore[arg-type]
    return fit, PlaceTrial(0.0, 0.0, 0.0, np.ones(2), one, design, np.zeros((2, 2)), 0.0)


# The derivatives of the four strains by x, y and force are (.1, 0, 1), (0, 0, 2), (0, .2, 1) and
# (0, 0, 2).  Without the force their normal matrix is [[.009, -.002], [-.002, .036]].
COVARIANCE = NOISE**2 * np.array([[112.5, 6.25], [6.25, 28.125]])


def test_the_covariance_of_two_gages_is_the_inverse_of_their_normal_matrix(
    pair: tuple[LocationFit, PlaceTrial],
) -> None:
    fit, trial = pair
    errors = fit.errors(trial, NOISE)
    assert errors.place == pytest.approx(COVARIANCE, rel=1e-9)
    # The inverse of the normal matrix [[.01, 0, .1], [0, .04, .2], [.1, .2, 10]] has .125 there.
    assert errors.force[0] == pytest.approx(NOISE * np.sqrt(0.125), rel=1e-9)
    assert errors.covariance == pytest.approx(errors.force[:, None] ** 2)


def test_strains_of_another_model_move_the_place_and_widen_its_errors(
    pair: tuple[LocationFit, PlaceTrial],
) -> None:
    fit, trial = pair
    moved, force = np.array([3e-5, -2e-5]), 1e-5
    # Strains of a place that is off by this much, and of a force that is larger.
    change = np.array(
        [[0.1 * moved[0] + force, 2.0 * force], [0.2 * moved[1] + force, 2.0 * force]]
    )
    errors = fit.errors(trial, NOISE, change)
    assert errors.place_change == pytest.approx(moved)
    assert errors.force_change == pytest.approx([force])
    assert errors.place == pytest.approx(COVARIANCE + np.outer(moved, moved), rel=1e-9)


def independent(force: Floats, sd: float) -> Errors:
    """Errors of forces that are independent of each other."""
    count, none = len(force), np.zeros(2)
    covariance = np.diag(np.where(force > 0.0, sd**2, 0.0))
    return Errors(np.eye(2), 0.0, none, np.full(count, sd), covariance, none, np.zeros(count))


@pytest.mark.parametrize("tail", [0, 6, 12])
def test_a_weak_force_whose_impulse_is_above_its_noise_belongs_to_the_contact(tail: int) -> None:
    # Every value of the tail is below three standard deviations; their sum is not.
    force = np.concatenate([np.full(12, 10.0), np.full(tail, 2.0), np.zeros(40)])
    judged = judged_force(np.arange(1.0, len(force) + 1.0), force, independent(force, 1.0), 1.0)
    assert judged.end is not None
    # The sum of the last hats is below its noise again.
    assert 13.0 + tail - 2.0 <= judged.end <= 13.0 + tail
    assert judged.impulse == pytest.approx(force.sum(), abs=4.0)


def test_a_contact_whose_end_the_record_does_not_show_is_open() -> None:
    # A third of the contact's time must follow without an impulse.
    force = np.concatenate([np.full(30, 10.0), np.zeros(9)])
    time = np.arange(1.0, len(force) + 1.0)
    assert judged_force(time, force, independent(force, 1.0), 1.0).end is None
    longer = np.append(force, [0.0, 0.0])
    judged = judged_force(np.append(time, [40.0, 41.0]), longer, independent(longer, 1.0), 1.0)
    assert judged.end == 31.0
    assert judged.impulse_sd == pytest.approx(np.sqrt(30.0))


def test_the_largest_of_equal_forces_is_too_high_by_the_mean_of_their_largest_error() -> None:
    # The mean of the largest of five independent normal errors is 1.1630 standard deviations.
    force = np.full(5, 100.0)
    judged = judged_force(np.arange(5.0), force, independent(force, 2.0), 1.0)
    assert judged.peak_bias == pytest.approx(2.0 * 1.1630, rel=0.03)
    assert judged.peak_sd == 2.0
