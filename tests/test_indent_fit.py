"""Indentation tests: the constants that made a curve come out of it, inside their errors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fecm.studies.indentation_test.constants import ContactLawFit, fit_contact_law, fit_notes
from fecm.studies.indentation_test.curves import FittedValue
from fecm.studies.indentation_test.turns import divide
from tests.indentation_tests import (
    ALPHA_P,
    PEAKS,
    S_P,
    Floats,
    K,
    Q,
    make_test,
    noisy,
    stretch,
)

ALPHA_CR = 3.16e-3


def constants(actual: ContactLawFit) -> dict[str, tuple[FittedValue, float]]:
    """Every estimate of a fit of `make_test()`, and the truth."""
    assert actual.q is not None
    assert actual.line is not None
    pairs = {
        "k": (actual.k, K),
        "n": (actual.free.n, 1.5),
        "k with n": (actual.free.k, K),
        "q": (actual.q, Q),
        "s_p": (actual.line.s_p, S_P),
        "alpha_p": (actual.line.alpha_p, ALPHA_P),
    }
    for n, (cycle, peak) in enumerate(zip(actual.cycles, PEAKS, strict=True)):
        left = S_P * (peak - ALPHA_P)
        pairs[f"alpha_m {n}"] = (cycle.alpha_m, peak)
        pairs[f"alpha_0 {n}"] = (cycle.alpha_0, left)
        pairs[f"k_1 {n}"] = (cycle.k_1, K * (peak / (peak - left)) ** 1.5)
    return pairs


def deviations(*, indentation: float, proportional: bool = False) -> dict[str, Floats]:
    """Deviations from the truth in standard errors, of 50 seeds."""
    a, f = make_test()
    actual: dict[str, list[float]] = {}
    for seed in range(50):
        random = np.random.default_rng(seed).standard_normal(len(f))
        force = f * (1.0 + 0.01 * random) if proportional else noisy(f, seed)
        path = noisy(a, 1000 + seed, indentation) if indentation else a
        for name, (estimate, truth) in constants(fit_contact_law(path, force)).items():
            if estimate.error:  # a peak that was held has none
                deviation = (estimate.value - truth) / estimate.error
                actual.setdefault(name, []).append(abs(deviation))
    return {name: np.array(values) for name, values in actual.items()}


# Of 50 fair draws fewer than 23 or more than 44 within one error, or fewer than 43 within two, come
# about less than once in a thousand times.
def assert_fair(actual: dict[str, Floats]) -> None:
    for name, values in actual.items():
        assert len(values) >= 45
        assert 23 <= np.count_nonzero(values < 1.0) <= 44, name
        assert np.count_nonzero(values < 2.0) >= 43, name


# What the fit finds ------------------------------------------------------------------------------


@pytest.mark.long
def test_constants_lie_inside_their_errors_as_often_as_they_should() -> None:
    actual = deviations(indentation=0.0)
    assert_fair(actual)
    everything = np.concatenate(list(actual.values()))
    assert np.mean(everything < 1.0) == pytest.approx(0.683, abs=0.06)
    assert np.mean(everything < 2.0) == pytest.approx(0.954, abs=0.03)


@pytest.mark.long
def test_errors_hold_for_a_scatter_that_grows_with_the_force() -> None:
    assert_fair(deviations(indentation=0.0, proportional=True))


@pytest.mark.long
def test_errors_hold_where_the_indentation_is_noisy_too() -> None:
    actual = deviations(indentation=0.005)
    assert_fair(actual)


def test_a_test_without_noise_gives_the_constants_themselves() -> None:
    for estimate, truth in constants(fit_contact_law(*make_test())).values():
        assert estimate.value == pytest.approx(truth, rel=1e-6)


def test_a_fit_explains_what_noise_leaves() -> None:
    a, f = make_test()
    fit = fit_contact_law(a, noisy(f, 0))
    assert fit.scatter == pytest.approx(0.01, rel=0.05)
    for kind in ("loading", "unloading", "reloading"):
        share = fit.r_squared[kind]
        assert share is not None
        assert 0.99 < share < 1.0


def test_a_larger_peak_between_two_readings_is_found_where_the_curves_meet() -> None:
    a, f = make_test(points=40)
    keep = np.full(len(a), True)
    keep[np.isin(a, PEAKS)] = False  # no reading at the peaks themselves
    for cycle, peak in zip(fit_contact_law(a[keep], f[keep]).cycles, PEAKS, strict=True):
        assert cycle.alpha_m_recorded < peak - 1e-5
        assert cycle.alpha_m.value == pytest.approx(peak, rel=1e-3)


def test_partial_unloadings_reload_from_an_origin_of_their_own() -> None:
    # Up to 3e-3, down to 2e-3, back up through the peak to 4e-3 and out: the law's formulas.
    peak, turn, left = 3e-3, 2e-3, S_P * (3e-3 - ALPHA_P)
    top = K * peak**1.5
    at_turn = top * ((turn - left) / (peak - left)) ** Q
    ratio = (at_turn / top) ** (2.0 / 3.0)
    origin = (turn - ratio * peak) / (1.0 - ratio)
    last = S_P * (4e-3 - ALPHA_P)
    a, f = np.concatenate(
        [
            np.zeros((2, 1)),
            stretch(0.0, peak, 100, lambda a: K * a**1.5),
            stretch(peak, turn, 50, lambda a: top * ((a - left) / (peak - left)) ** Q),
            stretch(turn, peak, 50, lambda a: top * ((a - origin) / (peak - origin)) ** 1.5),
            stretch(peak, 4e-3, 50, lambda a: K * a**1.5),
            stretch(4e-3, last, 100, lambda a: K * 4e-3**1.5 * ((a - last) / (4e-3 - last)) ** Q),
        ],
        axis=1,
    )
    fit = fit_contact_law(a, f)
    assert [cycle.alpha_0.value for cycle in fit.cycles] == pytest.approx([left, last], rel=1e-5)
    measured = fit.cycles[0].k_1_measured
    assert measured is not None
    assert measured.value == pytest.approx(K * (peak / (peak - origin)) ** 1.5, rel=1e-5)
    assert fit.line is not None
    assert fit.line.alpha_p.value == pytest.approx(ALPHA_P, rel=1e-4)


@pytest.mark.parametrize("part", [0.0, 0.005, 0.01])
@pytest.mark.parametrize("points", [40, 100, 1000])
@pytest.mark.few(3)
def test_cycles_are_found_in_noisy_paths_of_few_and_many_points(part: float, points: int) -> None:
    a, _ = make_test(points=points)
    for seed in range(5):
        division = divide(noisy(a, seed, part) if part else a)
        recorded = [division.corners[n].indentation for n in division.peaks]
        assert recorded == pytest.approx(PEAKS, abs=8e-5)


def test_a_peak_reached_twice_is_one_cycle() -> None:
    a, f = make_test((2e-3,))
    left = S_P * (2e-3 - ALPHA_P)
    k_1 = K * (2e-3 / (2e-3 - left)) ** 1.5
    back = stretch(0.0, 2e-3, 100, lambda a: k_1 * np.maximum(a - left, 0.0) ** 1.5)
    again = np.concatenate([[a, f], back, [a[101:], f[101:]]], axis=1)
    fit = fit_contact_law(again[0], noisy(again[1], 0))
    assert len(fit.cycles) == 1


def test_cycles_below_alpha_p_leave_nothing_and_do_not_bend_the_line() -> None:
    fit = fit_contact_law(*make_test((3e-4, 5e-4, 2e-3, 4e-3)))
    assert fit.line is not None
    assert fit.line.elastic == (0, 1)
    assert fit.line.s_p.value == pytest.approx(S_P, rel=1e-6)
    assert fit.line.alpha_p.value == pytest.approx(ALPHA_P, rel=1e-6)


def test_hertz_own_curve_has_no_peak_in_it_and_the_recorded_one_is_taken() -> None:
    fit = fit_contact_law(*make_test((2e-3,), q=1.5, s_p=0.0))
    assert fit.q is not None
    assert fit.q.value == pytest.approx(1.5, abs=1e-6)
    assert fit.cycles[0].alpha_m == FittedValue(2e-3, 0.0)


def test_permanent_indentations_off_the_line_enlarge_its_errors() -> None:
    # One specimen of four stays 30 % deeper: nothing that the forces' noise could do.
    parts = [make_test((peak,), s_p=S_P * (1.3 if n == 1 else 1.0)) for n, peak in enumerate(PEAKS)]
    both = [np.concatenate([part[axis] for part in parts]) for axis in (0, 1)]
    fit = fit_contact_law(both[0], noisy(both[1], 0, 1e-4))
    assert fit.line is not None
    assert fit.line.scatter > 3.0


@pytest.mark.parametrize(("share", "side"), [(0.5, "above"), (1.0, ""), (1.5, "below")])
def test_a_line_on_one_side_of_all_its_points_is_noted(share: float, side: str) -> None:
    a, f = make_test()
    fit = fit_contact_law(a, noisy(f, 0))
    assert fit.line is not None
    start = replace(fit.line.alpha_p, value=share * fit.line.alpha_p.value)
    text = "; ".join(fit_notes(replace(fit, line=replace(fit.line, alpha_p=start))))
    assert (f"is {side} all of its points" in text) is bool(side)


def test_one_unloading_tells_alpha_cr() -> None:
    # Equation 3-7: above alpha_cr the rigidity is k/alpha_cr, whatever the peak.
    left = 5e-3 * (1.0 - (ALPHA_CR / 5e-3) ** 0.4)
    up = stretch(0.0, 5e-3, 200, lambda a: K * a**1.5)
    down = stretch(5e-3, left, 200, lambda a: K / ALPHA_CR * (a - left) ** 2.5)
    a, f = np.concatenate([np.zeros((2, 1)), up, down], axis=1)
    estimates = [fit_contact_law(a, noisy(f, seed), acr=True).critical for seed in range(20)]
    values = [one.alpha_cr.value for one in estimates if one is not None]
    errors = [one.alpha_cr.error for one in estimates if one is not None]
    assert len(values) == 20
    assert np.std(values) == pytest.approx(np.mean(errors), rel=0.4)
    assert np.mean(values) == pytest.approx(ALPHA_CR, abs=3.0 * float(np.mean(errors)) / 20**0.5)
