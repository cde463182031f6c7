"""Filters of given rise time: their answer to a step, and to polygons at any spacing."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fecm.studies.rod_test.filters import Filter, FilterKind, filter_of

RISE = 10e-6
OF_RISE_TIMES = (FilterKind.FIRST_ORDER, FilterKind.MOVING_AVERAGE)
JUMP = 1e-13  # width of what stands for a step


def test_a_first_order_filter_passes_a_tenth_and_nine_tenths_a_rise_time_apart() -> None:
    constant = RISE / math.log(9.0)
    low, high = constant * math.log(10 / 9), constant * math.log(10.0)
    assert high - low == pytest.approx(RISE, rel=1e-14)
    time = np.array([-1e-5, 0.0, JUMP, low, high, 1.0])
    answer = Filter(FilterKind.FIRST_ORDER, RISE)(time, np.array([0.0, 0.0, 1.0, 1.0, 1.0, 1.0]))
    assert answer == pytest.approx([0.0, 0.0, 0.0, 0.1, 0.9, 1.0], abs=1e-7)


def test_a_moving_average_passes_a_tenth_and_nine_tenths_a_rise_time_apart() -> None:
    low, high = RISE / 8, 9 * RISE / 8
    time = np.array([-1e-5, 0.0, JUMP, low, high, 10 * RISE / 8, 1.0])
    answer = Filter(FilterKind.MOVING_AVERAGE, RISE)(
        time, np.array([0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 1.0])
    )
    assert answer == pytest.approx([0.0, 0.0, 0.0, 0.1, 0.9, 1.0, 1.0], abs=1e-7)


@pytest.mark.parametrize("kind", OF_RISE_TIMES)
def test_points_put_on_the_lines_of_a_polygon_change_nothing(kind: str) -> None:
    random = np.random.default_rng(12)
    time = np.cumsum(random.uniform(0.1e-6, 9e-6, 60))
    values = random.normal(size=(60, 2))
    extra = np.sort(np.concatenate([time, random.uniform(time[0], time[-1], 500)]))
    finer = np.column_stack([np.interp(extra, time, column) for column in values.T])
    coarse, fine = Filter(kind, RISE)(time, values), Filter(kind, RISE)(extra, finer)
    np.testing.assert_allclose(fine[np.isin(extra, time)], coarse, rtol=0, atol=1e-12)


@pytest.mark.parametrize(("kind", "delay"), [(FilterKind.FIRST_ORDER, RISE / math.log(9.0)),
                                              (FilterKind.MOVING_AVERAGE, RISE / 1.6)])  # fmt: skip
def test_a_ramp_is_followed_with_a_constant_delay(kind: str, delay: float) -> None:
    time = np.array([n * RISE for n in range(41)])
    answer = Filter(kind, RISE)(time, 3.0 * time)
    late = time > 20 * RISE
    np.testing.assert_allclose(answer[late], 3.0 * (time[late] - delay), rtol=1e-7)


@pytest.mark.parametrize("kind", OF_RISE_TIMES)
def test_what_stands_still_stays_and_a_filter_without_inertia_changes_nothing(kind: str) -> None:
    time, values = np.array([n * 2e-7 for n in range(50)]), np.sin(np.arange(50.0))
    np.testing.assert_allclose(Filter(kind, RISE)(time, np.full(50, 7.0)), 7.0, rtol=1e-13)
    np.testing.assert_allclose(Filter(kind, 1e-22)(time, values), values, rtol=0, atol=1e-13)


def test_a_first_order_filter_weakens_a_wave_by_its_transfer_function() -> None:
    period = 8e-6
    time = np.arange(0.0, 30 * period, period / 2000)
    answer = Filter(FilterKind.FIRST_ORDER, RISE)(time, np.sin(2 * np.pi * time / period))
    w = 2 * np.pi / period * RISE / math.log(9.0)
    settled = answer[time > 20 * period]
    assert np.ptp(settled) / 2 == pytest.approx(1 / math.hypot(1.0, w), rel=1e-4)


@pytest.mark.parametrize("text", ["", "first-order", "first-order:x", "first-order:0", "cfc:100",
                                  "moving-average:-1", "moving-average:nan", "second:1"],
                         )  # fmt: skip
def test_what_is_no_filter_is_refused_with_what_one_is(text: str) -> None:
    with pytest.raises(ValueError, match="use first-order:RISE, moving-average:RISE, butterworth:"):
        filter_of(text)


@pytest.mark.parametrize(("size", "unit"), [(60, "s"), (1000, "ms")])
def test_a_class_follows_the_corridor_of_sae_j211(size: int, unit: str) -> None:
    second = {"s": 1.0, "ms": 1e3}[unit]
    filtered = filter_of(f"cfc:{size}").in_unit(unit)
    period = 1.0 / size
    time = np.arange(-8.0 * period, 8.0 * period, 4e-3 * period)

    def gain(frequency: float) -> float:
        answer = filtered(time * second, np.cos(2.0 * np.pi * frequency * time))
        return float(20.0 * np.log10(answer[len(time) // 2]))  # also: no delay

    assert abs(gain(0.1 * size)) < 0.01
    assert -1.0 < gain(size) < 0.5
    assert -4.0 < gain(5 / 3 * size) < 0.5
    assert gain(5 / 3 * size) == pytest.approx(20.0 * np.log10(math.sqrt(0.5)), abs=0.03)
    assert gain(2.0775 * size) == pytest.approx(20.0 * np.log10(0.5), abs=0.03)
    assert gain(3.5 * size) < -12.0


def test_a_class_is_the_recursion_of_the_standard_forward_and_backward() -> None:
    dt, size = 1e-4, 180.0
    wa = math.tan(2.0 * math.pi * size * 2.0775 * dt / 2.0)
    d = 1.0 + math.sqrt(2.0) * wa + wa**2
    b1, b2 = -2.0 * (wa**2 - 1.0) / d, (-1.0 + math.sqrt(2.0) * wa - wa**2) / d
    x = np.zeros(1200)
    x[500:540] = np.hanning(40)

    def passed(x: list[float]) -> list[float]:
        y = [0.0, 0.0]
        for n in range(2, len(x)):
            y.append(wa**2 / d * (x[n] + 2 * x[n - 1] + x[n - 2]) + b1 * y[-1] + b2 * y[-2])
        return y

    expected = passed(passed(x.tolist())[::-1])[::-1]
    actual = filter_of("cfc:180")(dt * np.arange(1200.0), x)
    np.testing.assert_allclose(actual, np.array(expected), atol=1e-12)


@pytest.mark.parametrize(("time", "told"), [
    ([0.0, 1e-4, 3e-4, 4e-4], "equal time steps"), ([0.0, 1e-3, 2e-3, 3e-3], "10 samples"),
])  # fmt: skip
def test_a_class_refuses_samples_that_it_is_not_made_for(time: list[float], told: str) -> None:
    with pytest.raises(ValueError, match=told):
        filter_of("cfc:180")(np.array(time), np.ones(4))


@pytest.mark.parametrize("order", [1, 2, 4])
@pytest.mark.parametrize(("suffix", "passes"), [("", 1), (",zero-phase", 2)])
def test_a_butterworth_filter_has_the_gain_of_its_poles(
    order: int, suffix: str, passes: int
) -> None:
    filtered = filter_of(f"butterworth:{order},1e4{suffix}").in_unit("ms")
    time = np.arange(0.0, 8.0, 5e-4)  # in ms
    for ratio in (0.5, 1.0, 2.0):
        answer = filtered(time, np.sin(2.0 * np.pi * 10.0 * ratio * time))
        inner = answer[len(time) // 2 : -len(time) // 4]
        gain = (1.0 + ratio ** (2 * order)) ** (-0.5 * passes)
        assert np.ptp(inner) / 2.0 == pytest.approx(gain, rel=0.01)


def test_a_causal_butterworth_filter_is_late_and_a_zero_phase_one_is_not() -> None:
    time = 1e-6 * np.arange(4000.0)
    pulse = np.where(np.abs(time - 2e-3) < 5e-4, np.cos(1e3 * np.pi * (time - 2e-3)), 0.0)
    late, even = (
        filter_of(f"butterworth:4,5e3{suffix}")(time, pulse) for suffix in ("", ",zero-phase")
    )
    # The delay of slow waves: the sum of the poles' real parts, 2.613, over the angular frequency.
    assert time[late.argmax()] - 2e-3 == pytest.approx(2.613 / (2.0 * np.pi * 5e3), rel=0.05)
    assert time[even.argmax()] == pytest.approx(2e-3, abs=2e-6)
    assert filter_of("butterworth:2,1e3")(time, np.full(4000, 7.0)) == pytest.approx(7.0)


@pytest.mark.parametrize(
    "text", ["butterworth:4", "butterworth:0,1e4", "butterworth:4,-1", "butterworth:4,1e4,late",
             "butterworth:2.5,1e4", "butterworth:4,1e4,zero-phase,1"],
)  # fmt: skip
def test_what_is_no_butterworth_filter_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="1 to 10 poles and a positive frequency in Hz"):
        filter_of(text)


def test_a_butterworth_filter_refuses_steps_that_are_too_long() -> None:
    with pytest.raises(ValueError, match="4 samples or more in a period"):
        filter_of("butterworth:4,3e5")(1e-6 * np.arange(100.0), np.ones(100))


def test_a_class_refuses_a_unit_of_time_that_it_does_not_know() -> None:
    with pytest.raises(ValueError, match="unit of time is fortnight"):
        filter_of("cfc:180").in_unit("fortnight")
