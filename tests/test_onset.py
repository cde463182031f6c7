"""Energies at which a force is reached, scaled from one run, beside searches that run them."""

from __future__ import annotations

import math
from typing import Literal

import pytest

import fecm
from fecm.results.onset import energy_at_force
from fecm.results.run_metrics import impact_energy
from tests.decks import small


def deck(energy: float, kinematics: Literal["linear", "von-karman"] = "linear") -> fecm.Deck:
    """A drop weight on a coarse simply supported plate with a delamination threshold."""
    return fecm.impact(
        fecm.Plate.rectangle((100, 80), (4, 4), support="simple"),
        fecm.Laminate("[0/45/90/-45]2s", "IM7/8552", 0.131),
        fecm.RigidMass(1e-3),
        fecm.Contact.estimate(radius=8),
        energy=energy,
        kinematics=kinematics,
        giic=0.79,
        units="mm-N-s",
    )


@pytest.fixture(scope="module")
def linear() -> fecm.Result:
    return fecm.run_one(deck(6000.0))


def test_the_energy_of_the_peak_is_the_energy_of_the_impact(linear: fecm.Result) -> None:
    for result in (linear, fecm.run_one(deck(6000.0, "von-karman"))):
        peak = float(result.force.max())
        assert energy_at_force(result, peak) == pytest.approx(impact_energy(result), rel=1e-9)


@pytest.mark.parametrize("energy", [600.0, 6000.0])
def test_the_energy_at_the_threshold_is_the_one_that_a_search_finds(energy: float) -> None:
    given = deck(energy)
    found = fecm.sweep(given, until="threshold")
    result = fecm.run_one(given)
    scaled = energy_at_force(result, float(result.threshold["force"]))
    assert scaled == pytest.approx(float(found["found_energy"][0]), rel=0.035)


@pytest.mark.parametrize("factor", [0.25, 1.5])
@pytest.mark.few(1)
def test_a_plate_that_stretches_needs_the_energy_that_a_second_run_has(factor: float) -> None:
    first, second = (fecm.run_one(deck(e, "von-karman")) for e in (6000.0, 6000.0 * factor))
    scaled = energy_at_force(first, float(second.force.max()))
    assert scaled == pytest.approx(6000.0 * factor, rel=0.035)
    assert first["membrane/energy"].max() > 0.05 * first["membrane/strain_energy"].max()


def test_an_open_peak_has_no_energy_of_another_force() -> None:
    assert math.isnan(energy_at_force(fecm.run_one(small()), 10.0))


def test_a_force_far_above_the_peak_of_a_nonlinear_plate_has_no_energy() -> None:
    result = fecm.run_one(deck(600.0, "von-karman"))
    peak = float(result.force.max())
    assert math.isfinite(energy_at_force(result, 1.4 * peak))
    assert math.isnan(energy_at_force(result, 1.6 * peak))
