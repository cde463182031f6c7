"""Parameters fitted to the measured force of a plate that stretches as it bends (NONL)."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import fecm
from fecm._errors import StudyError
from fecm.deck.model import Deck, Material
from fecm.deck.units import unit_names
from fecm.identification import confirmation
from fecm.identification.fitting import (
    FittedPoints,
    ForceModel,
    Scaling,
    covariance,
    fit_parameters,
)
from fecm.identification.identify import IdentificationJob
from fecm.identification.plates import ExactPlate, ForceExpansion
from fecm.identification.result import Identification
from fecm.problem.loading import sole_problem
from fecm.report.content import render
from fecm.report.report import page_of
from fecm.results.comparison import measurement_of
from fecm.sweeps.backends import FullRuns
from fecm.sweeps.impact_columns import Impacts
from fecm.sweeps.outcome import Outcome
from tests.builders import Floats
from tests.calls import call
from tests.decks import small

K, VELOCITY = 48000.0, 5800.0
FREE = ["k", "velocity"]
TIME = np.linspace(0.0, 3e-3, 200)


@cache
def coupon(k: float = 42000.0, velocity: float = 6000.0) -> Deck:
    """A drop-weight test of 17 J on a coupon of 2 mm, which bends by 2 h."""
    return fecm.impact(
        fecm.Plate.rectangle((125.0, 75.0), (6, 4), support="clamped"),
        fecm.Laminate("[45/0/-45/90]2s", "IM7/8552", 0.125),
        fecm.RigidMass(1e-3),
        fecm.Contact(k, 0.0, 0.0, 1.5),
        velocity=velocity,
        units="mm-N-s",
        patch="hertz:8",
        kinematics="von-karman",
    )


def at_times(run: fecm.Result) -> Floats:
    """Force of a run at the times of the record; it has no row of time 0."""
    time, force = np.append(0.0, run.time), np.append(0.0, run.force)
    return np.asarray(np.interp(TIME, time, force, right=0.0))


@cache
def true_force() -> Floats:
    """Force of the true values, by a full run."""
    run = fecm.run_one(coupon(K, VELOCITY))
    assert run.plate_w.max() > 3.5  # mm
    return at_times(run)


def measured(seed: int) -> Floats:
    """Force of the true values with a noise of 2 % of the peak."""
    force = true_force()
    noise = np.random.default_rng(seed).normal(size=len(TIME))
    return np.asarray(force + 0.02 * force.max() * noise)


@cache
def fit_of(seed: int) -> Identification:
    return IdentificationJob(coupon(), (TIME, measured(seed)), FREE).execute()


class Linear:
    """A contact law of a user: a spring."""

    def start(self) -> None:
        """Nothing is kept."""

    def trial(
        self, memory: None, last: fecm.ContactPoint, indentation: float
    ) -> tuple[float, None]:
        """The force of the spring."""
        return 1e4 * max(indentation, 0.0), None

    def accept(self, memory: None, last: fecm.ContactPoint, indentation: float) -> None:
        """Nothing is kept."""

    def permanent(self, memory: None, last: fecm.ContactPoint) -> float:
        """No dent."""
        return 0.0


class RunsOfOneLength(FullRuns):
    """Full runs; their force is 0 after the end."""

    def outcomes(self, impacts: Impacts, *, judged: bool = True) -> Outcome:
        """Run each impact."""
        outcome = super().outcomes(impacts, judged=judged)
        assert outcome.force is not None
        steps = int(TIME[-1] / outcome.columns["dt"][0]) + 1
        force = np.nan_to_num(outcome.force)[:, :steps]
        outcome.force = np.pad(force, ((0, 0), (0, steps - force.shape[1])))
        return outcome


def by_full_runs(force: Floats, deck: Deck | None = None) -> FittedPoints:
    """A fit whose trial forces are full runs, from the true values."""
    deck = deck or coupon()
    problem = sole_problem(deck, warns=False)
    model = ForceModel(deck, ExactPlate(problem, RunsOfOneLength(problem)), None)
    table = measurement_of((TIME, force), unit_names(deck))
    start = {"k": K, "velocity": VELOCITY}
    scaling = Scaling(start, np.zeros(2), np.full(2, -1.0), np.ones(2))
    points = fit_parameters(model, table, scaling, np.zeros(2), 30)
    assert points is not None
    assert points.converged
    return points


def deviations(seed: int) -> Floats:
    """Differences of the values from those by full runs alone, in standard errors."""
    fit, values = fit_of(seed), by_full_runs(measured(seed)).values
    return np.array([(fit.values[name] - values[name]) / fit.errors[name] for name in FREE])


def test_values_of_a_plate_that_stretches_are_those_of_a_fit_by_full_runs_alone() -> None:
    fit = fit_of(0)
    assert fit.full_run is not None
    assert np.abs(deviations(0)).max() < 0.5
    for name, true in zip(FREE, (K, VELOCITY), strict=True):
        assert abs(fit.values[name] - true) < 2.5 * fit.errors[name]
    assert fit.share == pytest.approx(0.02, rel=0.2)


def test_standard_errors_are_those_of_a_fit_by_full_runs_alone() -> None:
    fit, points = fit_of(0), by_full_runs(measured(0))
    deviation = np.sqrt(np.diagonal(covariance(points))) * points.scaling.slopes(points.x)
    assert list(fit.errors.values()) == pytest.approx(deviation.tolist(), rel=0.05)


def test_values_settle_after_few_fits_to_forces_near_full_runs() -> None:
    run = fit_of(0).full_run
    assert run is not None
    assert run.is_settled
    assert run.fits <= 3


@pytest.mark.long
def test_20_seeds_are_within_two_standard_errors_of_fits_by_full_runs_in_18_cases() -> None:
    inside = [np.abs(deviations(seed)).max() < 2.0 for seed in range(20)]
    assert np.count_nonzero(inside) >= 18


def test_the_full_run_beside_the_fit_is_that_of_the_deck_with_the_fitted_values() -> None:
    fit = fit_of(0)
    assert fit.full_run is not None
    in_full = at_times(fecm.run_one(fit.deck))
    peak = in_full.max()
    assert fit.full_run.peak == pytest.approx(fit.model.max() / peak - 1.0, abs=1e-4)
    rms = math.sqrt(np.mean((fit.model - in_full) ** 2))
    assert fit.full_run.misfit == pytest.approx(rms / peak, abs=1e-4)
    assert fit.full_run.largest == pytest.approx(np.abs(fit.model - in_full).max() / peak, abs=2e-4)
    assert fit.full_run.largest < 0.02


@pytest.mark.long
def test_errors_of_a_plate_that_stretches_are_those_of_a_fit_with_another_plate() -> None:
    force = true_force()
    fit = fecm.identify(coupon(), TIME, force, FREE)
    e1 = coupon().require(Material).ply.e1
    thicker = coupon().with_(thickness=1.002 * 2.0)
    stiffer = coupon().with_(e1=1.002 * e1)
    true = by_full_runs(force)
    for name, other in (("thickness", thicker), ("e1", stiffer)):
        again = by_full_runs(force, other)
        for value in FREE:
            change = 5.0 * (again.values[value] - true.values[value])
            assert fit.plate_errors[name][value] == pytest.approx(change, rel=0.15), (name, value)


# What is said ------------------------------------------------------------------------------------


def test_the_difference_from_the_full_run_is_in_summary_json_and_page() -> None:
    fit = fit_of(0)
    run = fit.full_run
    assert run is not None
    (line,) = (line for line in str(fit).split("\n") if line.startswith("  full run "))
    assert f"peak {run.peak:+.2%}, rms {run.misfit:.2%} of the peak" in line
    stored = json.loads(json.dumps(fit.to_dict()))["full_run"]
    assert stored == run._asdict()
    page = page_of({"measured": fit})
    assert "difference from the full run" in render(page)


def test_a_fit_that_the_full_run_does_not_confirm_is_rejected(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    signs, at = itertools.cycle([1.0, -1.0]), ForceExpansion.at

    def other_force(self: ForceExpansion, trials: Sequence[Mapping[str, float]]) -> Floats:
        """Forces that do not hold at the next values."""
        return at(self, trials) * (1.0 + 0.03 * next(signs))

    monkeypatch.setattr(ForceExpansion, "at", other_force)
    monkeypatch.setattr(confirmation, "MOST_FITS", 1)
    (tmp_path / "d.inp").write_text(coupon().to_text())
    table = np.array([TIME, 1.1 * measured(0)]).T
    np.savetxt(tmp_path / "m.csv", table, delimiter=",", header="time,force", comments="")
    done = call("identify", "d.inp", "m.csv", "--free", "k", "--format", "json", cwd=tmp_path)
    assert "of the peak from the full run of the fitted deck" in done.stderr
    assert json.loads(done.stdout)["verdict"] == "no"
    assert done.exit_code == 1


def test_values_that_have_not_settled_are_doubted() -> None:
    fit = fit_of(0)
    assert fit.full_run is not None
    run = fit.full_run._replace(effect=0.7, largest=0.004)
    assert not run.rejects
    assert "would change the values by up to 0.7 standard errors" in run.doubt
    assert run._replace(largest=0.021).rejects
    assert not run._replace(effect=0.1).doubt


def test_what_a_reduced_plate_does_not_have_is_refused_with_the_remedy() -> None:
    with pytest.raises(StudyError, match="the reduced model of a plate that stretches"):
        fecm.identify(coupon(), TIME, true_force(), ["velocity"], law=Linear())
    lifting = small().replace("ROD\n", "UNIL\n13,0,1,0.,0.\n\nROD\n", 1)
    with pytest.raises(StudyError, match=r"UNIL, from which the plate lifts off: .*--window held"):
        fecm.identify(lifting, TIME, true_force(), ["velocity"])


# Forces near a full run --------------------------------------------------------------------------


def test_forces_near_a_full_run_are_linear_in_the_values_of_the_impact() -> None:
    times, shape = np.linspace(0.0, 1.0, 5), np.sin(np.linspace(0.0, 3.0, 5))
    place = {"k": 1000.0, "velocity": 50.0, "delay": 2.0}

    def force(values: Mapping[str, float]) -> Floats:
        return np.asarray((3.0 + 1e-3 * values["k"] + 0.2 * values["velocity"]) * shape)

    expansion = ForceExpansion(
        times, force(place), place, {"k": 1e-3 * shape, "velocity": 0.2 * shape}
    )
    beside = [place, place | {"k": 1300.0, "delay": 1.0}, place | {"k": 900.0, "velocity": 47.0}]
    assert expansion.at(beside) == pytest.approx(np.stack([force(v) for v in beside], axis=1))
