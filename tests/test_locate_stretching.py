"""Impacts located on a plate that stretches as it bends (NONL)."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import fecm
from fecm.location import stretching
from fecm.location.location import LocateError
from tests.panels import OFF_AXIS, STRUCK, TIME, Floats, at_times, scatter, with_patch

CLOSE = (52.0, 38.0, 72.0, 58.0)  # of one candidate


def panel(velocity: float, *, stretches: bool = True) -> fecm.Deck:
    """A panel of 1.4 mm, struck by 2 g."""
    deck = fecm.impact(
        fecm.Plate.rectangle((100.0, 80.0), (8, 6), support="simple"),
        fecm.Laminate("[45/0/-45/90]s", "AS4/8552", 0.18),
        fecm.RigidMass(2e-6),
        fecm.Contact(2e4, 0.0, 0.0, 1.5),
        velocity=velocity,
        duration=TIME[-1],
        units="mm-N-s",
        patch=None,
        kinematics="von-karman" if stretches else "linear",
        gages=OFF_AXIS,
    )
    return with_patch(deck, 5.0, STRUCK)


@cache
def struck(velocity: float) -> tuple[fecm.Result, Floats]:
    """A run of the panel, and its strains with 1 % of noise."""
    run = fecm.run_one(panel(velocity))
    strains, _ = scatter(at_times(run), 0.01, seed=0)
    return run, strains


def located(velocity: float, *, stretches: bool = True) -> fecm.Location:
    """The impact from the strains of the plate that stretches."""
    table = TIME, struck(velocity)[1]
    deck = panel(velocity, stretches=stretches)
    return fecm.locate(deck, table, region=CLOSE, grid=20.0, mesh_error=False)


def deviations(location: fecm.Location) -> float:
    """Distance from the place that was struck, in standard deviations."""
    off = np.array([location.x, location.y]) - STRUCK
    return float(np.sqrt(off @ np.linalg.solve(location.covariance, off)))


def test_place_and_force_on_a_plate_that_stretches_are_those_of_its_full_run() -> None:
    run, _ = struck(12000.0)
    assert run.plate_w.max() > 0.45 * 1.44
    location = located(12000.0)
    assert location.accepted
    assert deviations(location) < 3.0
    assert location.peak_force == pytest.approx(float(run.force.max()), rel=0.06)
    assert any(note.startswith("the plate stretches") for note in location.notes)
    assert location.mesh_error is None


@pytest.mark.long
def test_the_linear_plate_is_far_off_where_the_plate_stretches() -> None:
    linear = located(12000.0, stretches=False)
    assert not linear.accepted
    assert deviations(linear) > 3.0


@pytest.mark.long
def test_a_place_that_full_runs_do_not_settle_is_not_given(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(stretching, "MOST_RUNS", 1)
    with pytest.raises(LocateError, match="after 1 runs of the whole plate"):
        located(12000.0)


def test_strains_that_a_full_run_does_not_confirm_are_rejected() -> None:
    strains = np.array([[1e-3, -2e-3]])
    (reason,) = stretching.unconfirmed(0.05 * strains, strains)
    assert "5.0% of the largest strain" in reason
    assert not stretching.unconfirmed(0.01 * strains, strains)
