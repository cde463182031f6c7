"""What a sweep accepts: the verdict of a run, whether a case is run alone or with others."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fecm
from fecm import DivergenceError, RigidMass
from fecm.authoring.values import apply_case
from fecm.deck.model import Deck
from fecm.mechanics.contact_law import HystereticLaw, LinearPermanent, stack_parameters
from fecm.results.metrics import SUMMARY
from fecm.sweeps import backends
from fecm.sweeps.outcome import Status
from fecm.sweeps.responses import ComputedImpacts, Hits, TipSteps, balance_errors, by_numpy, impacts
from tests.calls import call
from tests.decks import DATA_CARDS, LONG, PROGRAM, small

STEPS = PROGRAM.replace("LOOP         10", "LOOP        400")
SHORT = PROGRAM.replace("LOOP         10", "LOOP        320")
MASS = "PROJ\n    0    0    1.8E-4\n"


def balance(deck: Deck) -> float:
    """Worst error of the energy balance of a run, as a part of the initial energy."""
    result = fecm.run_one(deck, energy_limit=1e300)
    initial = float(result.energy.attributes["initial"])
    return float(np.abs(result["energy/balance_error"]).max()) / initial


# The energy balance ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("data", "case"),
    [
        (DATA_CARDS, {"k": 3e10}),
        (DATA_CARDS, {"k": 1e13}),
        (MASS + DATA_CARDS, {"rod_mass": 1e-14}),
        (DATA_CARDS, {"velocity": 1e200}),
    ],
)
def test_a_case_that_a_run_rejects_fails_with_the_runs_reason(
    data: str, case: dict[str, float]
) -> None:
    deck = fecm.read_one(small(STEPS, data=data))
    with pytest.raises(DivergenceError) as rejected:
        fecm.run(apply_case(deck, dict(case)))
    (name,) = case
    usual = {"k": 2e6, "rod_mass": 1.8e-4, "velocity": 100.0}[name]
    swept = fecm.sweep(deck, {name: [case[name], usual]})
    assert swept["status"].tolist() == [str(rejected.value), "ok"]
    assert np.isnan(swept["peak_force"][0])


def test_cases_together_keep_the_energy_as_well_as_their_runs_do(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    seen: list[float] = []

    def watched(*arguments: Any) -> ComputedImpacts:
        built = impacts(*arguments)
        seen.extend(built.error.tolist())
        return built

    monkeypatch.setattr(backends, "impacts", watched)
    deck = fecm.read_one(small(STEPS))
    stiffnesses = [2e6, 1e8, 1e9]
    assert fecm.sweep(deck, {"k": stiffnesses}).completed.all()
    for k, error in zip(stiffnesses, seen, strict=True):
        exact = balance(apply_case(deck, {"k": k}))
        assert 0.2 * exact < error < 5.0 * exact + 1e-5
    assert seen[-1] > 100.0 * seen[0]


def test_a_force_with_no_projectile_behind_it_is_an_error_of_the_balance() -> None:
    mass, dt, steps = RigidMass(1.8e-4), 5e-7, 400
    kind = np.zeros(1, dtype=np.intp)
    law = HystereticLaw(stack_parameters([LinearPermanent(1.9e6, 1.0, 0.0, 2.0)]))
    tips = TipSteps(Hits([mass], kind, np.ones(1), law, np.array([100.0])), dt, steps)
    actual, work = by_numpy(np.zeros(steps), 1e-6, tips)
    assert actual.error[0] < 1e-4
    work.done[-1] += 0.05 * 0.5 * 1.8e-4 * 100.0**2
    (error,) = balance_errors(actual.force, work, tips)
    assert error == pytest.approx(0.05, abs=1e-4)


# The end -----------------------------------------------------------------------------------------


def test_a_case_cut_off_in_contact_keeps_its_peaks_alone() -> None:
    cut = fecm.sweep(small(SHORT), {"velocity": [50.0, 150.0]})
    whole = fecm.sweep(small(STEPS), {"velocity": [50.0, 150.0]})
    assert cut["status"].tolist() == [Status.STILL, "ok"]
    assert whole["status"].tolist() == ["ok", "ok"]
    assert cut.completed.all()
    for name in SUMMARY:
        if name in ("peak_force", "time_of_peak", "peak_contact", "first_peak", "max_indentation"):
            assert cut[name][0] == whole[name][0]
        else:
            assert np.isnan(cut[name][0])
            assert np.isfinite(whole[name][0])
        assert cut[name][1] == pytest.approx(whole[name][1], rel=1e-12)


@pytest.mark.parametrize(
    "data", [DATA_CARDS, "FORC\n    8    0       0.0       0.0      1E-9\n\n" + DATA_CARDS]
)
def test_a_peak_at_the_last_step_is_no_peak(data: str) -> None:
    swept = fecm.sweep(small(data=data), {"velocity": [50.0]})
    assert swept["status"].tolist() == [Status.STILL]
    assert all(np.isnan(swept[name][0]) for name in SUMMARY)


# The command -------------------------------------------------------------------------------------


def test_the_last_line_counts_and_failed_cases_end_in_1(tmp_path: Path) -> None:
    deck = tmp_path / "plate.inp"
    deck.write_text(small(SHORT))

    def last(*options: str) -> tuple[int, str]:
        done = call("sweep", deck, "-o", tmp_path / "s.h5", "--overwrite", *options)
        return done.exit_code, done.stdout.splitlines()[-1]

    assert last("--vary", "velocity=100,150") == (0, "2 cases: all ok")
    text = "1 case: 1 still in contact at the end"
    assert last("--vary", "velocity=50") == (0, text)
    both = ("--vary", "velocity=50,150", "--vary", "k=-1,2e6")
    text = "4 cases: 1 still in contact at the end, 2 failed"
    assert last(*both) == (1, text)
    assert last(*both, "--allow-failed") == (0, text)


def test_texts_that_spreadsheets_compute_are_exported_as_texts(tmp_path: Path) -> None:
    layups = ["=cmd|x", "+1", "-1", "@a", "\t=1", "[0/90]"]
    fecm.sweep(small(STEPS), {"layup": layups}, output=tmp_path / "s.h5")
    text = call("export", tmp_path / "s.h5", "--to", "csv", "-o", "-").stdout
    rows = list(csv.DictReader(io.StringIO(text)))
    assert [row["layup"] for row in rows] == ["'=cmd|x", "'+1", "'-1", "'@a", "'=1", "[0/90]"]


@pytest.mark.parametrize("more", [(), ("--random", "k=normal:1e6,1e4", "--samples", "16")])
def test_a_sweep_without_values_is_one_line(tmp_path: Path, more: tuple[str, ...]) -> None:
    done = call("sweep", LONG, "--vary", "velocity=,", *more, "-o", tmp_path / "s.h5")
    assert done.exit_code == 2
    assert done.stderr.splitlines() == ["fecm: error: a sweep needs at least one case"]


def test_a_range_beyond_all_numbers_is_one_line(tmp_path: Path) -> None:
    done = call("sweep", LONG, "--vary", "velocity=-1e308:1e308:3", "-o", tmp_path / "s.h5")
    assert done.exit_code == 2
    (line,) = done.stderr.splitlines()
    assert "beyond the range of numbers" in line
