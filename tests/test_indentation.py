"""The indentation laws, against the report's equations."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fecm import ContactPoint, Law
from fecm.listing.law import ListingLaw
from fecm.mechanics.contact_law import (
    RELOADING,
    UNLOADING,
    VIRGIN,
    HystereticLaw,
    LinearPermanent,
    LoadingHistory,
)

# The report's laminate with the 0.75 in indenter.
REPORT = LinearPermanent(k=1.912e6, alpha_p=6.564e-4, s_p=0.094, q=2.0)

# Multiples of 1e-9: below, powers of ratios leave the range of numbers.
indentations = st.integers(-500_000, 4_000_000).map(lambda n: n * 1e-9)


def follow(law: Law, path: list[float]) -> tuple[list[float], list[LoadingHistory]]:
    """Forces and memories along a path of accepted indentations."""
    memory, last = law.start(), ContactPoint(0.0, 0.0)
    forces: list[float] = []
    memories: list[LoadingHistory] = []
    for indentation in path:
        force, memory = law.trial(memory, last, indentation)
        memory = law.accept(memory, last, indentation)
        last = ContactPoint(indentation, force)
        forces.append(force)
        memories.append(memory)
    return forces, memories


def test_loading_is_equation_3_1() -> None:
    forces, memories = follow(HystereticLaw(REPORT), [2e-4, 6.564e-4, 1e-3])
    assert forces == pytest.approx([1.912e6 * a**1.5 for a in (2e-4, 6.564e-4, 1e-3)], rel=1e-14)
    assert {m.branch for m in memories} == {VIRGIN}


def test_the_critical_indentation_carries_the_reports_22_4_lb() -> None:
    # Page 77 gives about 20 lb for alpha_p with the 0.5 in indenter's k.
    half_inch = LinearPermanent(k=1.330e6, alpha_p=6.564e-4, s_p=0.094, q=2.5)
    assert half_inch.loading(6.564e-4) == pytest.approx(22.4, abs=0.05)


def test_unloading_is_equation_3_3_down_to_the_permanent_indentation_of_3_8() -> None:
    peak = 2e-3
    permanent = 0.094 * (peak - 6.564e-4)
    path = [peak, 1.5e-3, 5e-4, permanent, 0.5 * permanent, -1e-3]
    forces, memories = follow(HystereticLaw(REPORT), path)
    top = 1.912e6 * peak**1.5
    expected = [top * ((a - permanent) / (peak - permanent)) ** 2.0 for a in (1.5e-3, 5e-4)]
    assert forces[1:] == pytest.approx([*expected, 0.0, 0.0, 0.0], rel=1e-13)
    assert memories[-1].branch == UNLOADING


def test_below_the_critical_indentation_nothing_remains() -> None:
    forces, _ = follow(HystereticLaw(REPORT), [5e-4, 1e-9])
    assert REPORT.permanent(5e-4) == 0.0
    assert forces[1] == pytest.approx(1.912e6 * 5e-4**1.5 * (1e-9 / 5e-4) ** 2.0, rel=1e-12)


def test_reloading_after_separation_is_equation_3_11_back_to_the_peak() -> None:
    peak = 2e-3
    permanent = 0.094 * (peak - 6.564e-4)
    forces, memories = follow(HystereticLaw(REPORT), [peak, 0.0, 1e-3, peak, 2.1e-3])
    top = 1.912e6 * peak**1.5
    k1 = top / (peak - permanent) ** 1.5  # equation 3-12
    assert memories[2].branch == RELOADING
    assert forces[2] == pytest.approx(k1 * (1e-3 - permanent) ** 1.5, rel=1e-13)
    assert forces[3] == pytest.approx(top, rel=1e-13)
    assert memories[3].branch == VIRGIN
    assert forces[4] == pytest.approx(1.912e6 * 2.1e-3**1.5, rel=1e-13)


def test_a_turn_before_separation_reloads_from_where_it_turned() -> None:
    peak, turn = 2e-3, 1.2e-3
    forces, _ = follow(HystereticLaw(REPORT), [peak, turn, 1.6e-3])
    top = 1.912e6 * peak**1.5
    ratio = (forces[1] / top) ** (2.0 / 3.0)
    origin = (turn - ratio * peak) / (1.0 - ratio)
    assert forces[2] == pytest.approx(top * ((1.6e-3 - origin) / (peak - origin)) ** 1.5, rel=1e-12)


@settings(max_examples=40)
@given(
    st.lists(indentations, min_size=1, max_size=30),
    st.sampled_from(
        [REPORT, LinearPermanent(1.33e6, 6.564e-4, 0.094, 2.5), LinearPermanent(1e6, 0.0, 0.5, 1.5)]
    ),
)
def test_the_force_is_continuous_at_every_turn(
    path: list[float], constants: LinearPermanent
) -> None:
    law = HystereticLaw(constants)
    memory, last = law.start(), ContactPoint(0.0, 0.0)
    for indentation in path:
        up, _ = law.trial(memory, last, last.indentation + 1e-12)
        down, _ = law.trial(memory, last, last.indentation - 1e-12)
        assert up == pytest.approx(down, abs=1e-4)
        assert up >= 0.0
        assert down >= 0.0
        force, _ = law.trial(memory, last, indentation)
        assert force <= constants.loading(indentation) * (1 + 1e-9) + 1e-6
        memory = law.accept(memory, last, indentation)
        last = ContactPoint(indentation, force)


@settings(max_examples=40)
@given(st.lists(indentations, min_size=2, max_size=30))
def test_a_closed_path_never_gives_energy_back(path: list[float]) -> None:
    # Walked in small steps, out and back to zero: the work done on the law is not negative.
    law = HystereticLaw(REPORT)
    memory, last, work = law.start(), ContactPoint(0.0, 0.0), 0.0
    for target in [*path, 0.0]:
        for indentation in np.linspace(last.indentation, target, 40)[1:].tolist():
            force, _ = law.trial(memory, last, indentation)
            work += 0.5 * (force + last.force) * (indentation - last.indentation)
            memory = law.accept(memory, last, indentation)
            last = ContactPoint(indentation, force)
    assert work >= -1e-4


@pytest.mark.parametrize("kind", [HystereticLaw, ListingLaw])
@settings(max_examples=25)
@given(paths=st.lists(st.lists(indentations, min_size=6, max_size=6), min_size=1, max_size=8))
@pytest.mark.few(1)  # of 2, 0.2 s each
def test_many_cases_at_once_are_each_the_single_case(
    kind: type[HystereticLaw[Any]] | type[ListingLaw[Any]], paths: list[list[float]]
) -> None:
    k = np.full(len(paths), 1.912e6)
    law = kind(LinearPermanent(k, 6.564e-4 + 0 * k, 0.094 + 0 * k, 2.0 + 0 * k))
    memory, last = law.start(), ContactPoint(0 * k, 0 * k)
    singles = [follow(kind(REPORT), path)[0] for path in paths]
    for step, indentations in enumerate(np.array(paths).T):
        force, memory = law.trial(memory, last, indentations)
        memory = law.accept(memory, last, indentations)
        last = ContactPoint(indentations, force)
        expected = [forces[step] for forces in singles]
        np.testing.assert_allclose(force, expected, rtol=1e-12, atol=1e-12)


def test_a_trial_leaves_the_laws_memory_as_it_was() -> None:
    law = HystereticLaw(REPORT)
    memory = law.start()
    last = ContactPoint(1e-3, float(REPORT.loading(1e-3)))
    assert law.trial(memory, last, 5e-4)[1] is memory


def test_the_sticky_law_reloads_for_good_after_its_first_rise() -> None:
    # Peak, fall, rise, and a second fall that stays on the reloading curve of 3-11.
    peak, permanent = 2e-3, 0.094 * (2e-3 - 6.564e-4)
    forces, memories = follow(ListingLaw(REPORT), [peak, 1.5e-3, 1.7e-3, 1.2e-3, 3e-3])
    top = 1.912e6 * peak**1.5
    curve = [top * ((a - permanent) / (peak - permanent)) ** 1.5 for a in (1.7e-3, 1.2e-3, 3e-3)]
    assert forces[2:] == pytest.approx(curve, rel=1e-13)
    assert memories[-1].branch == RELOADING
