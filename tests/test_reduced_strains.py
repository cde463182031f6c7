"""Exposures, strains of gages, and the judge's slopes and strains, by the reduced model."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import fsolve

import fecm
from fecm.authoring.case import CasesError
from fecm.deck.macros import steps_at
from fecm.mechanics.reduced_plate import ReducedFields, reduced_plate
from fecm.mechanics.solutions import static_response
from fecm.problem.loading import load_deck
from fecm.problem.problem import Problem
from fecm.results.metrics import EXPOSURES
from fecm.sweeps import methods
from fecm.sweeps.in_full import run_in_full
from tests.calls import call
from tests.test_nonlinear_decks import NEWTON, STRUCK, forces, result, text
from tests.test_nonlinear_sweeps import BLOW
from tests.test_reduced_sweeps import reduced_with

ENOUGH = 4  # modes of this plate, which has few nodes
PROGRAM = "LMAS\nDT        4.E-7\nLOOP        480\nTIME\nRODP         10\nFAIL         10\nNEXT\n"
STRENGTHS = "ALLO\n1.E5,1.E5,5.E3,2.E4,9.E3,9.E3,6.E3\n\n"
GAGES = "GAGE\n1, .5, .5, .01, 0.\n2, 1.4, .8, -.025, 30.\n\n"
DECK = text(PROGRAM, data=BLOW + STRENGTHS + GAGES)
MEASURED = ("failure", "gages")


def coupled(deck: str) -> str:
    """The plate as [0/90], with B and stiffer along the fibres."""
    return deck.replace("1.E7, 1.E7,", "2.E7, 1.E7,").replace("2   0.     .025", "2  90.     .025")


def problem_of(deck: str) -> Problem:
    (problem,) = load_deck(deck).problems
    return problem


def compare(swept: fecm.SweepResult, full: fecm.SweepResult) -> None:
    assert swept.reduced is not None
    assert swept.reduced.in_full == 0
    for name in full.summary:
        if name.startswith(("exposure_", "gage_")):
            np.testing.assert_allclose(swept[name], full[name], rtol=0.01, err_msg=name)
    assert np.isfinite(full["exposure_puck"][1:]).all()
    assert np.isfinite(full["gage_1"][1:]).all()
    assert swept["validity"].tolist() == full["validity"].tolist()
    np.testing.assert_allclose(swept["fail_evaluations"], full["fail_evaluations"], atol=1.0)
    differences = [swept.reduced.difference(name) for name in ("exposure", "gage_strain")]
    assert 0.0 < np.nanmax(np.abs(differences)) < 0.02


@pytest.fixture(scope="module")
def swept() -> fecm.SweepResult:
    """Impacts up to 1.2 times the thickness by the reduced model."""
    given = {"velocity": [100.0, 600.0, 1500.0]}
    return fecm.sweep(DECK, given, model="reduced", modes=ENOUGH, measure=MEASURED)


def test_exposures_strains_and_doubts_are_those_of_full_runs(swept: fecm.SweepResult) -> None:
    full = fecm.sweep(DECK, {"velocity": [100.0, 600.0, 1500.0]}, measure=MEASURED)
    compare(swept, full)
    assert ["strain > 1 %" in reasons for reasons in full["validity"]] == [False, False, True]


@pytest.mark.long
def test_they_are_in_a_plate_whose_bending_stretches_it() -> None:
    given = {"velocity": [100.0, 600.0, 700.0]}
    deck = coupled(DECK)
    model = fecm.sweep(deck, given, model="reduced", modes=ENOUGH, measure=MEASURED)
    compare(model, fecm.sweep(deck, given, measure=MEASURED))


@pytest.mark.long
def test_random_impacts_have_the_peaks_failures_and_probabilities_of_64_full_runs() -> None:
    random = {"velocity": "uniform:300,1200", "k": "lognormal:5e4,.15"}
    given: dict[str, Any] = {"random": random, "samples": 64, "measure": "failure"}
    given |= {"exceed": {"peak_force": [200.0, 300.0]}}
    deck = DECK.replace(STRENGTHS, "ALLO\n1.1E6,1.1E6,5.5E4,2.2E5,9.9E4,9.9E4,6.E4\n\n")
    swept = fecm.sweep(deck, **given)
    full = fecm.sweep(deck, model="full", **given)
    assert swept.reduced is not None
    assert swept.reduced.in_full == 0
    np.testing.assert_allclose(swept["peak_force"], full["peak_force"], rtol=1e-2)
    names = [name for name in EXPOSURES if np.isfinite(full.summary.get(name, np.nan)).all()]
    exposures, in_full = (np.array([part[name] for name in names]) for part in (swept, full))
    assert len(names) == 4
    np.testing.assert_allclose(exposures, in_full, rtol=1e-2)
    np.testing.assert_array_equal(exposures.argmax(axis=0), in_full.argmax(axis=0))
    failed = (exposures >= 1.0).any(axis=0)
    np.testing.assert_array_equal(failed, (in_full >= 1.0).any(axis=0))
    assert 5 < failed.sum() < 59
    assert swept.random is not None
    assert full.random is not None
    chances = full.random.exceedance.probability
    assert np.all((chances > 0.1) & (chances < 0.9))
    np.testing.assert_array_equal(swept.random.exceedance.probability, chances)


def test_strengths_of_a_case_change_its_exposures_alone() -> None:
    given = {"yt": [5e3, 2e3], "s12": [9e3]}
    swept = fecm.sweep(DECK, given, model="reduced", modes=ENOUGH, measure="failure")
    assert swept["exposure_max_stress"][1] == pytest.approx(2.5 * swept["exposure_max_stress"][0])
    assert swept["peak_force"][0] == swept["peak_force"][1]


def test_a_case_has_the_same_exposures_with_any_others(swept: fecm.SweepResult) -> None:
    others = {"velocity": [600.0, 450.0], "k": [5e4]}
    again = fecm.sweep(DECK, others, model="reduced", modes=ENOUGH, measure=MEASURED)
    for name in ("exposure_tsai_wu", "exposure_puck", "gage_1"):
        assert again[name][0] == swept[name][1]


def test_a_model_whose_exposures_are_wrong_is_refused_by_its_full_run(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    right = ReducedFields.amplitudes
    monkeypatch.setattr(ReducedFields, "amplitudes", lambda *given: 1.05 * right(*given))
    with pytest.raises(CasesError, match=r"the exposure of the reduced model .* differs by \+"):
        fecm.sweep(DECK, {"velocity": [600.0]}, model="reduced", modes=ENOUGH, measure="failure")


@pytest.mark.parametrize("force", [200.0, 2000.0])
@pytest.mark.parametrize(("modes", "error"), [(2, 0.05), (4, 1e-5)])
def test_a_static_field_is_that_of_newtons_method(force: float, modes: int, error: float) -> None:
    full = result(NEWTON + "DISP\n", data=forces(force)).tape3.displacement[0]
    problem = problem_of(text(PROGRAM.replace("FAIL         10\n", ""), data=STRUCK))
    assert problem.contact is not None
    plate = reduced_plate(problem.plate, problem.contact, modes, error=0.0, has_fields=True)
    assert plate.fields is not None

    def residual(q: np.ndarray) -> np.ndarray:
        return plate.internal_forces(q[:, None])[:, 0] - force * plate.deflection

    q = fsolve(residual, np.zeros(len(plate.stiffness)), xtol=1e-13)
    field = plate.fields.fields(plate.fields.amplitudes(q[None], np.array([force])))[0]
    assert np.abs(full[:, 2]).max() > 0.9 * 0.05
    assert np.abs(field - full)[:, 2].max() <= error * np.abs(full[:, 2]).max()


def test_a_small_static_field_is_that_of_the_linear_plate_with_any_number_of_modes() -> None:
    problem = problem_of(DECK)
    assert problem.contact is not None
    plate = reduced_plate(problem.plate, problem.contact, 1, has_fields=True)
    assert plate.fields is not None
    force = 1e-6
    q = force * plate.deflection / plate.stiffness
    field = plate.fields.fields(plate.fields.amplitudes(q[None], np.array([force])))[0]
    linear = force * static_response(problem.plate, problem.contact).field
    assert np.abs(field - linear)[:, 2:].max() < 1e-6 * np.abs(linear).max()


def test_rows_of_fail_are_at_the_steps_of_a_run() -> None:
    program = (
        "LMAS\nDT        4.E-7\nLOOP          3\nLOOP         20\nTIME\nRODP         10\n"
        "FAIL          7\nNEXT\nNEXT\n"
        "LOOP         30\nTIME\nFAIL         10\nRODP         10\nNEXT\n"
    )
    deck = text(program, data=BLOW + STRENGTHS)
    steps = fecm.run_one(fecm.read_one(deck))["exposures/step"]
    assert steps_at(problem_of(deck).program, "FAIL").tolist() == steps.tolist()
    assert steps.tolist() == [7, 14, 27, 34, 47, 54, 69, 79, 89]


@pytest.mark.long
def test_workers_change_no_byte(tmp_path: Path) -> None:
    (tmp_path / "d.inp").write_text(DECK)
    given = ("--vary", "velocity=300,900", "--vary", "thickness=.05,.06", "--measure", "failure")
    model = ("--model", "reduced", "--modes", str(ENOUGH))
    for count in ("1", "2"):
        done = call("sweep", "d.inp", *given, *model, "--workers", count, "-o", count, cwd=tmp_path)
        assert done.exit_code == 0, done.stderr
    assert (tmp_path / "1").read_bytes() == (tmp_path / "2").read_bytes()


@pytest.mark.parametrize("until", [{"peak_force": 150.0}, {"exposure": 1.5}])
@pytest.mark.few(1)  # of 2
def test_a_velocity_that_the_model_finds_is_that_of_full_runs_and_confirmed_by_one(
    until: dict[str, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    full = fecm.sweep(DECK, until=until)
    taken: list[int] = []

    def counted(*given: Any, **options: Any) -> Any:
        taken.append(1)
        return run_in_full(*given, **options)

    monkeypatch.setattr(methods, "run_in_full", counted)
    with reduced_with(SPRING=-1.0):
        by_model = fecm.sweep(DECK, until=until, model="reduced", modes=ENOUGH)
    np.testing.assert_allclose(by_model["found_velocity"], full["found_velocity"], rtol=2e-3)
    assert len(taken) == 1
    assert by_model.reduced is not None
    assert 0.0 < abs(by_model.reduced.difference("peak_force")[0]) < 1e-3
