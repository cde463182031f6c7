"""Sweeps, searches and estimates of decks with NONL, whose cases are run in full."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import fecm
from fecm.authoring.case import Case
from fecm.deck.model import Impact
from fecm.problem.estimates import NoCurveError, nonlinear_curve
from fecm.problem.loading import load_deck
from fecm.problem.problem import Problem
from fecm.results.sinks import MemorySink
from fecm.simulation.run import run_program
from fecm.simulation.simulation import Simulation
from fecm.studies.estimate import quick_estimate, velocity_at
from fecm.sweeps import in_full, price
from fecm.sweeps.plan import plan
from fecm.sweeps.task import tasks
from tests.calls import call
from tests.test_nonlinear_decks import STRUCK, forces, text

PROGRAM = "LMAS\nDT        4.E-7\nLOOP        600\nTIME\nRODP         50\nNEXT\n"
# A soft contact, so that the plate is bent to 0.7 of its thickness.
BLOW = STRUCK.replace("300.0", "600.0").replace("1912000.", "  50000.")
BLOW += "PATC\nHERT,.2\nPROJ\n0, 0, 2e-5\n\nDELA\n.5\n"
DECK = text(PROGRAM, data=BLOW)
LINEAR = text(PROGRAM, data=BLOW, words="")
THRESHOLD = 77.623436


def problem_of(deck: str) -> Problem:
    (problem,) = load_deck(deck).problems
    return problem


@pytest.fixture
def runs(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Peak forces of the full runs that are taken."""
    taken: list[float] = []

    def counted(simulation: Simulation) -> None:
        taken.append(run_program(simulation).metrics["peak_force"])

    monkeypatch.setattr(in_full, "run_program", counted)
    return taken


def test_every_case_is_a_full_run_of_the_stretched_plate(runs: list[float]) -> None:
    velocities = [300.0, 600.0]
    swept = fecm.sweep(DECK, {"velocity": velocities}, history=True, measure="max_deflection")
    assert len(runs) == 2
    assert swept.force is not None
    for row, velocity in enumerate(velocities):
        full = fecm.run_one(DECK.replace("600.0", f"{velocity}"))
        np.testing.assert_array_equal(swept.force[row], full.force)
        np.testing.assert_equal(swept["max_deflection"][row], full.metrics["max_deflection"])
    linear = fecm.sweep(LINEAR, {"velocity": velocities}, measure="max_deflection")
    assert set(linear.summary) == set(swept.summary)
    # The linear plate deflects by 1.1 times as much.
    assert fecm.run_one(LINEAR).plate_w.max() > 1.09 * fecm.run_one(DECK).plate_w.max()


def test_the_limit_of_the_linear_plate_is_none_of_a_nonlinear_one() -> None:
    linear, nonlinear = (fecm.sweep(deck, {"k": [5e4]}) for deck in (LINEAR, DECK))
    deflections = [fecm.run_one(deck).plate_w.max() for deck in (LINEAR, DECK)]
    assert min(deflections) > 0.6 * problem_of(DECK).judge.thickness
    assert "w > 0.3 h" in linear["validity"][0]
    assert "w > " not in nonlinear["validity"][0]
    assert "indentation > h/4" in nonlinear["validity"][0]


def test_cases_are_tasks_of_their_own_and_resume() -> None:
    problem = problem_of(DECK)
    cases: list[Case] = [{"velocity": float(v)} for v in range(1, 6)]
    assert [task.numbers for task in tasks(plan(problem, cases))] == [
        (0,), (1,), (2,), (3,), (4,)
    ]  # fmt: skip
    searches = plan(problem, [{"k": 5e4}, {"k": 6e4}], until=50.0, model="full")
    assert [task.numbers for task in tasks(searches)] == [(0,), (1,)]
    assert len(tasks(plan(problem_of(LINEAR), cases))) == 1


def test_a_search_takes_few_runs_and_its_velocity_gives_the_same_run_again(
    runs: list[float],
) -> None:
    swept = fecm.sweep(DECK, {"k": [6e4]}, until="threshold", model="full")
    assert 3 <= len(runs) <= 6
    assert THRESHOLD <= swept["peak_force"][0] <= THRESHOLD * (1.0 + 2e-5)
    velocity = float(swept["found_velocity"][0])
    assert swept["found_energy"][0] == pytest.approx(0.5 * 2e-5 * velocity**2, rel=1e-12)
    again = fecm.sweep(DECK, {"k": [6e4], "velocity": [velocity]})
    for name in again.summary:
        if again[name].dtype.kind == "f":
            np.testing.assert_allclose(again[name][0], swept[name][0], rtol=1e-9)


def test_a_search_starts_at_the_quick_models_and_lengthens_runs_that_end_too_early(
    runs: list[float],
) -> None:
    swept = fecm.sweep(DECK.replace("LOOP        600", "LOOP        120"), until=20.0, model="full")
    assert np.isnan(runs[0])
    assert swept.steps[0] in (240, 480)
    assert swept["peak_force"][0] == pytest.approx(20.0, rel=2e-5)
    starts = [velocity_at(problem_of(DECK.replace("600.0", v)), 20.0) for v in ("600.0", "  6.0")]
    assert starts[0] == pytest.approx(starts[1], rel=1e-8)
    # Both models are too soft.
    assert 1.0 < starts[0] / swept["found_velocity"][0] < 1.3


@pytest.mark.long
def test_the_number_of_runs_and_their_time_are_told_first(tmp_path: Path) -> None:
    (tmp_path / "d.inp").write_text(DECK)
    done = call("sweep", "d.inp", "--vary", "velocity=300,400,500", cwd=tmp_path)
    assert done.exit_code == 0, done.stderr
    assert re.search(r"response: 3 cases, one full run each: about [\d.]+ s", done.stderr)
    assert "3 cases: 3 beyond the contact law" in done.stdout
    problem = problem_of(DECK)
    searched = price.expected(problem, plan(problem, [{}], until=50.0, model="full"), 0)
    assert "1 case, about 5 full runs each: about " in searched
    assert searched.endswith(" s of computation")


def test_the_expected_time_grows_with_the_work(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(price, "_costs", lambda *_: (1.0, 0.01))  # seconds of a run, of a step
    problem = problem_of(DECK)

    def expected_time(cases: list[dict[str, Any]], workers: int = 1, **more: Any) -> str:
        return price.expected(problem, plan(problem, cases, model="full", **more), workers).split(
            "about "
        )[-1]

    assert expected_time([{"k": 5e4}]) == "7 s"
    assert expected_time([{"k": 5e4 + n} for n in range(6)], 2) == "21 s by 2 workers"
    assert expected_time([{}], until=50.0) == "35 s"
    assert expected_time([{"duration": 2.4e-4}, {"duration": 4.8e-4}]) == "20 s"
    assert expected_time([{"k": 5e4 + n} for n in range(900)]) == "100 min"
    assert expected_time([{"dt": 4e-7}, {"dt": 2e-7}]) == "20 s"
    cases = [{"refine": 1, "elements": 4, "dt": 4e-7}, {"refine": 2, "elements": 16, "dt": 2e-7}]
    assert expected_time(cases) == "56 s"


def test_a_step_is_timed_with_the_rows_and_the_criteria_of_the_sweep(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    timed: list[Simulation] = []

    def record(start: Callable[[Any], Simulation]) -> tuple[float, float]:
        timed.append(start(lambda _: None))
        run_program(timed[-1])
        return 1.0, 0.01

    monkeypatch.setattr(price, "seconds_of_steps", record)
    monkeypatch.setattr(price, "time", SimpleNamespace(perf_counter=lambda: 0.0))
    deck = DECK.replace("RODP         50\n", "RODP         50\nFAIL         50\n")
    deck = deck.replace("DELA\n.5\n", "ALLO\n200.,120.,8.,20.,10.\n\n")
    job = fecm.Sweep(deck, {"xt": [200.0, 210.0, 220.0]}, measure="failure")
    assert job.price.seconds == pytest.approx(1.0 + 600 * 0.01)  # one run for three cases
    (simulation,) = timed
    assert len(simulation.others) == 2
    assert isinstance(simulation.sink, MemorySink)
    assert len(simulation.sink.arrays["tape9/step"]) == 600 // 50


@pytest.mark.long
def test_refined_and_random_cases_are_full_runs_too(runs: list[float]) -> None:
    short = DECK.replace("LOOP        600", "LOOP         60")
    refined = fecm.sweep(short, refine=[1, 2])
    assert len(runs) == 2
    assert refined.completed.all()
    random = {"velocity": "uniform:300,600"}
    drawn = fecm.sweep(short, random=random, samples=16, model="full")
    assert len(runs) == 18
    assert drawn.random is not None
    assert drawn.completed.all()


# Estimates ----------------------------------------------------------------------------------------

HEAVY = DECK.replace("2e-5", "2e-2").replace("600.0", " 20.0")  # M/M_plate = 100


@pytest.mark.long
def test_the_estimate_of_a_nonlinear_plate_has_a_static_row_from_its_curve(tmp_path: Path) -> None:
    program = PROGRAM.replace("        600", "         20")
    (tmp_path / "d.inp").write_text(HEAVY.replace(PROGRAM, program))
    done = call("estimate", "d.inp", "--format", "json", cwd=tmp_path)
    assert done.exit_code == 0, done.stderr
    document = json.loads(done.stdout)
    assert "9 to 26 % low in force at M/M_plate = 24" in document["nonlinear"]
    rows = {row["model"]: row for row in document["models"]}
    assert [*rows] == ["infinite plate", "static plate", "nonlinear static plate", "run"]
    assert [row["applies"] for row in rows.values()] == [False, False, True, True]
    static = rows["nonlinear static plate"]
    # The energy is that in plate and contact at the peak.
    problem = problem_of(HEAVY)
    energy = 0.5 * 2e-2 * 20.0**2
    curve = nonlinear_curve(problem, energy, np.nan)
    w = np.linspace(0.0, curve.deflection[-1], 20001)
    force, work = curve.at(w)
    stored = work + 0.4 * np.cbrt(force**5 / 5e4**2)
    assert static["peak_force"] == pytest.approx(np.interp(energy, stored, force), rel=1e-6)
    assert static["energy"] == pytest.approx(np.interp(THRESHOLD, force, stored), rel=1e-5)
    # A search for the force would start there.
    assert velocity_at(problem, THRESHOLD) == pytest.approx(static["velocity"], rel=1e-3)
    assert static["peak_force"] > 1.2 * rows["static plate"]["peak_force"]
    assert "too soft" not in done.stderr
    page = call("estimate", "d.inp", cwd=tmp_path).stdout
    assert "  stretching  the nonlinear static plate is 9 to 26 % low" in page


def test_the_row_of_a_linear_deck_stays_alone() -> None:
    estimate = quick_estimate(problem_of(LINEAR))
    assert [model.name for model in estimate.models] == ["infinite plate", "static plate"]
    assert estimate.remark == ""


def test_both_static_rows_of_a_small_deflection_agree_and_apply() -> None:
    problem = problem_of(HEAVY)
    slow = tuple(
        replace(segment, velocity=0.02) if isinstance(segment, Impact) else segment
        for segment in problem.deck.segments
    )
    estimate = quick_estimate(replace(problem, deck=replace(problem.deck, segments=slow)))
    _, static, nonlinear = estimate.models
    assert static.applies
    assert nonlinear.applies
    assert nonlinear.impact.peak == pytest.approx(static.impact.peak, rel=1e-6)
    assert nonlinear.impact.duration == pytest.approx(static.impact.duration, rel=1e-6)


def test_a_loaded_plate_has_no_static_curve() -> None:
    loaded = problem_of(text(PROGRAM, data=BLOW + forces(1.0)))
    with pytest.raises(NoCurveError, match="no nonlinear static plate: the deck has FORC"):
        nonlinear_curve(loaded, 1.0, np.nan)
    estimate = quick_estimate(loaded)
    assert "FORC" in estimate.remark
    assert [model.name for model in estimate.models] == ["infinite plate", "static plate"]
    heavy = problem_of(text(PROGRAM, data=BLOW.replace("2e-5", "2e-2") + forces(1.0)))
    static = quick_estimate(heavy).models[1]
    assert velocity_at(heavy, static.threshold) == pytest.approx(static.velocity, rel=1e-8)


def test_a_case_that_is_run_in_full_is_judged_as_the_run_of_its_deck() -> None:
    """Slope and strain need the rows of RODP, which the case keeps for its judge."""
    deck = problem_of(DECK).deck
    ran = fecm.run(deck.with_(velocity=12000.0))
    slow = fecm.run(deck.with_(velocity=300.0))
    assert isinstance(ran, fecm.Result)
    assert isinstance(slow, fecm.Result)
    assert {"slope > 0.25", "strain > 1 %"} <= {*ran.validity.split("; ")}
    swept = fecm.sweep(deck, {"velocity": [300.0, 12000.0]})
    assert swept.validity.tolist() == [slow.validity, ran.validity]
