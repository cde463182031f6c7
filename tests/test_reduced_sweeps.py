"""Sweeps of nonlinear plates by the reduced model, beside full runs."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import fecm
from fecm import RigidMass
from fecm.authoring.case import CasesError
from fecm.authoring.strike_values import strike_of
from fecm.mechanics import reduced_plate
from fecm.mechanics.contact_law import HystereticLaw, LinearPermanent
from fecm.mechanics.reduced_plate import ReducedPlate
from fecm.problem.loading import load_deck
from fecm.results.metrics import RATIO
from fecm.simulation.run import run_program
from fecm.simulation.simulation import Simulation
from fecm.sweeps import execute, in_full
from fecm.sweeps.about import about_sweep
from fecm.sweeps.backends import BendingModes
from fecm.sweeps.impact_columns import Impacts, impacts_from_cards
from fecm.sweeps.methods import _plate
from fecm.sweeps.outcome import Outcome
from fecm.sweeps.plan import plan
from fecm.sweeps.reduced import MOST_MODES, ReducedImpacts, by_halvings, count_held, reduced
from fecm.sweeps.responses import Hits
from fecm.sweeps.task import Task, tasks
from tests.builders import table
from tests.calls import call
from tests.nonlinear_impacts import struck_rectangle
from tests.test_kernels import compiled
from tests.test_nonlinear_decks import forces, text
from tests.test_nonlinear_sweeps import BLOW, LINEAR
from tests.test_nonlinear_sweeps import PROGRAM as LONGER

STEPS = 390  # beyond the largest force, and the contact at the highest speed
PROGRAM = LONGER.replace("600", str(STEPS))
WHOLE = LONGER.replace("600", "480")  # beyond the contact
DECK = text(PROGRAM, data=BLOW)
SPEEDS = [300.0, 600.0, 900.0]
SOFT = 0.018  # share of the spring of a plate that is too soft
ENOUGH = 4  # modes of this plate, which has few nodes
ROD = BLOW.replace("PROJ\n0, 0, 2e-5\n\n", "PROJ\n4, 0, .5, 1e7, 2e-4\n1, 1, .5\n4, 0, .5\n\n")
GAGED = text(PROGRAM, data=BLOW + "GAGE\n1, .5, .5, .01, 0.\n\n")


@contextmanager
def reduced_with(**constants: object) -> Iterator[None]:
    """Reduce plates with other constants of the model, and forget them."""
    with pytest.MonkeyPatch.context() as patch:
        for name, value in constants.items():
            patch.setattr(reduced_plate, name, value)
        _plate.cache_clear()
        yield
    _plate.cache_clear()


@pytest.fixture
def every_vector() -> Iterator[None]:
    """Take all vectors as coordinates, none as a spring."""
    with reduced_with(SPRING=-1.0):
        yield


@pytest.fixture(scope="module")
def swept() -> fecm.SweepResult:
    """ComputedImpacts by the reduced model."""
    given = {"velocity": SPEEDS}
    with reduced_with(SPRING=-1.0):
        return fecm.sweep(DECK, given, model="reduced", modes=ENOUGH, measure="max_deflection")


@pytest.mark.long
@pytest.mark.usefixtures("every_vector")
def test_in_all_modes_the_cases_are_those_of_full_runs() -> None:
    # All modes that the load moves take thrice the steps of a few.
    given = {"velocity": [300.0, 1000.0]}
    deck = text(WHOLE, data=BLOW)
    swept = fecm.sweep(deck, given, model="reduced", measure="max_deflection")
    full = fecm.sweep(deck, given, measure="max_deflection")
    assert set(swept.summary) == set(full.summary)
    for name in ("peak_force", "max_deflection", "max_indentation", "permanent_indentation"):
        np.testing.assert_allclose(swept[name], full[name], rtol=1e-4)
    for name in ("impulse", "rebound_velocity", "energy_absorbed"):
        np.testing.assert_allclose(swept[name], full[name], rtol=1e-4)
    np.testing.assert_allclose(swept["contact_time"], full["contact_time"], rtol=5e-3)
    assert swept["validity"].tolist() == full["validity"].tolist()


@pytest.mark.long
@pytest.mark.parametrize("case", ["iso_ss_movable", "iso_clamped_immovable", "cross_ss_immovable"])
def test_impacts_up_to_twice_the_thickness_are_those_of_a_spectral_program(case: str) -> None:
    """The table is that of nonlinear_impacts.csv, see test_nonlinear_impacts.py."""
    rows = [row for row in table("nonlinear_impacts.csv") if row["case"] == case]
    rows = [row for row in rows if float(row["target_w_over_h"]) <= 2.0]
    wanted = {
        name: np.array([float(row[name]) for row in rows])
        for name in ("velocity_mm_per_s", "peak_N", "W_max_mm", "contact_end_s")
    }
    # The largest deflection is open until the plate can't reach the projectile any more.
    deck = struck_rectangle(case, 16, 1.0, 1.3 * float(wanted["contact_end_s"].max()))
    sweep_result = fecm.sweep(
        deck,
        {"velocity": wanted["velocity_mm_per_s"].tolist()},
        model="reduced",
        modes=21,
        measure="max_deflection",
    )
    np.testing.assert_allclose(sweep_result["peak_force"], wanted["peak_N"], rtol=1e-2)
    np.testing.assert_allclose(sweep_result["max_deflection"], wanted["W_max_mm"], rtol=1e-3)
    np.testing.assert_allclose(sweep_result["last_contact"], wanted["contact_end_s"], rtol=1e-2)
    assert sweep_result.reduced is not None
    assert np.abs(sweep_result.reduced.difference("peak_force")).max() < 1e-2
    assert np.abs(sweep_result.reduced.difference(RATIO)).max() < 1e-3


@pytest.mark.long
def test_three_full_runs_are_stored_beside_the_cases_and_shown(
    swept: fecm.SweepResult, tmp_path: Path
) -> None:
    assert swept.reduced is not None
    assert swept.reduced.columns["case"].tolist() == [0, 1, 2]
    assert swept.reduced.columns["peak_force"] == pytest.approx(swept["peak_force"], rel=1e-12)
    assert np.abs(swept.reduced.difference("peak_force")).max() < 1e-4
    (tmp_path / "d.inp").write_text(DECK)
    given = ("--vary", "velocity=300:900:5", "--model", "reduced", "--modes", str(ENOUGH))
    done = call("sweep", "d.inp", *given, "-o", "s.h5", cwd=tmp_path)
    assert done.exit_code == 0, done.stderr
    lines = done.stdout.splitlines()
    start = next(n for n, line in enumerate(lines) if "reduced model" in line)
    assert f"{ENOUGH} modes of bending" in lines[start]
    assert [line.split("(case ")[1].rstrip(")") for line in lines[start + 1 : start + 4]] == [
        "0", "2", "4"
    ]  # fmt: skip
    stored = fecm.load_sweep(tmp_path / "s.h5")
    assert stored.reduced is not None
    assert stored.reduced.modes == ENOUGH
    shown = f"peak {stored.reduced.difference('peak_force')[0]:+.2%}"
    assert shown in lines[start + 1]
    assert shown in call("info", "s.h5", cwd=tmp_path).stdout
    with h5py.File(tmp_path / "s.h5") as file:
        assert file["reduced/full_peak_force"].shape == (3,)
        assert file["reduced"].attrs["modes"] == ENOUGH


@pytest.fixture
def coarse() -> Iterator[None]:
    """Reduce plates to as many vectors as modes, without static deflections."""
    with reduced_with(VECTORS=1, _bent_plates=lambda *given: []):
        yield


@pytest.mark.usefixtures("coarse")
def test_too_few_modes_are_refused_before_the_sweep(monkeypatch: pytest.MonkeyPatch) -> None:
    ran: list[Task] = []
    _outcomes = execute._outcomes

    def counted(*given: Any) -> Any:
        ran.extend(given[-2])
        return _outcomes(*given)

    monkeypatch.setattr(execute, "_outcomes", counted)
    with pytest.raises(CasesError, match=r"1 mode differs by \+.* case 3; .*2%.*more modes"):
        fecm.sweep(DECK, {"velocity": [100.0, *SPEEDS]}, model="reduced", modes=1)
    # The largest energy and the smallest, each in full and by the model.
    assert [task.numbers for task in ran] == [(3,)] * 2 + [(0,)] * 2


@pytest.fixture
def soft(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Reduce plates that are too soft, which matters where the contact is stiff."""
    right = reduced_plate.reduced_plate

    def reduce_softly(*given: Any, **options: Any) -> ReducedPlate:
        plate = right(*given, **options)
        shares = plate.deflection**2 / plate.stiffness
        return replace(plate, flexibility=SOFT * float(shares.sum()))

    monkeypatch.setattr("fecm.sweeps.reduced.reduced_plate", reduce_softly)
    _plate.cache_clear()
    yield
    _plate.cache_clear()


@pytest.fixture
def full_runs(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Velocities of the full runs that are taken."""
    taken: list[float] = []

    def counted(simulation: Simulation) -> None:
        taken.append(strike_of(simulation.problem.deck).velocity)
        run_program(simulation)

    monkeypatch.setattr(in_full, "run_program", counted)
    return taken


def test_a_model_that_agrees_with_full_runs_computes_a_sweep_by_itself(
    full_runs: list[float],
) -> None:
    velocities = np.linspace(300.0, 900.0, 8).tolist()
    swept = fecm.sweep(DECK, {"velocity": velocities})
    assert sorted(full_runs) == [300.0, pytest.approx(4.5e3 / 7.0), 900.0]
    assert swept.reduced is not None
    assert (swept.reduced.limit, swept.reduced.in_full) == (0.01, 0)
    full = fecm.sweep(DECK, {"velocity": velocities}, model="full")
    assert full.reduced is None
    np.testing.assert_allclose(swept["peak_force"], full["peak_force"], rtol=1e-2)
    np.testing.assert_allclose(swept["impulse"], full["impulse"], rtol=1e-2)
    about = about_sweep(swept)["reduced"]
    assert about is not None
    assert about["cases"] == [0, 4, 7]
    assert np.abs(about["differences"]["peak_force"]).max() < 0.01
    assert about_sweep(full)["reduced"] is None


def test_a_model_that_disagrees_leaves_a_sweep_to_full_runs(
    soft: None, full_runs: list[float]
) -> None:
    velocities = np.linspace(400.0, 900.0, 8).tolist()
    with pytest.warns(fecm.FecmWarning) as caught:
        swept = fecm.sweep(DECK, {"velocity": velocities})
    assert swept.reduced is None
    assert len(full_runs) == 2 + 8  # the largest energy and the smallest are tried
    full = fecm.sweep(DECK, {"velocity": velocities}, model="full")
    np.testing.assert_array_equal(swept["peak_force"], full["peak_force"])
    notes = " ".join(str(warning.message) for warning in caught)
    assert re.search(r"13 modes differs by -.*%.* at most 1% is allowed", notes)
    assert re.search(r"8 cases, one full run each: about .* of computation", notes)


def test_a_search_by_the_model_is_repeated_in_full_if_a_full_run_denies_it(
    soft: None, tmp_path: Path
) -> None:
    (tmp_path / "d.inp").write_text(DECK)
    given = ("sweep", "d.inp", "--find", "velocity", "--until", "peak_force=150")
    done = call(*given, "-o", "s.h5", cwd=tmp_path)
    assert done.exit_code == 0, done.stderr
    assert "at most 1% is allowed" in done.stderr
    full = call(*given, "--model", "full", "-o", "full.h5", cwd=tmp_path)
    assert full.exit_code == 0, full.stderr
    found, in_full = (
        fecm.load_sweep(tmp_path / name)["found_velocity"] for name in ("s.h5", "full.h5")
    )
    np.testing.assert_array_equal(found, in_full)


def test_a_search_in_which_the_model_finds_no_velocity_is_repeated_in_full(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def nothing(plate: BendingModes, impacts: Impacts, *, judged: bool = True) -> Outcome:
        return Outcome.failed(dict.fromkeys(impacts.numbers, "it jumps"))

    full = fecm.sweep(DECK, until=150.0, model="full")
    monkeypatch.setattr(BendingModes, "outcomes", nothing)
    with pytest.warns(fecm.FecmWarning, match="the reduced model fails in case 0: .* it jumps"):
        swept = fecm.sweep(DECK, until=150.0)
    np.testing.assert_array_equal(swept["found_velocity"], full["found_velocity"])


@pytest.mark.parametrize(
    ("given", "name"),
    [
        ({"vary": {"velocity": [300.0 + n for n in range(7)]}}, "SharedMotion"),
        ({"vary": {"velocity": [300.0 + n for n in range(8)]}}, "ReducedOrFullRuns"),
        # Eight plates, each with a reduction and cases enough for none of them.
        ({"vary": {"thickness": [0.02 + n / 1000 for n in range(8)]}}, "SharedMotion"),
        ({"vary": {"velocity": [300.0 + n for n in range(8)]}, "model": "full"}, "SharedMotion"),
        ({"refine": [1, 2]}, "SharedMotion"),
        ({"until": 50.0}, "ReducedOrFullRuns"),
    ],
)
def test_the_model_is_tried_where_it_saves_half_of_the_full_runs(
    given: dict[str, Any], name: str
) -> None:
    assert type(fecm.Sweep(DECK, **given).plan.method).__name__ == name


@pytest.mark.usefixtures("soft")
def test_cases_of_energies_at_which_the_model_does_not_hold_are_run_in_full(
    tmp_path: Path,
) -> None:
    (tmp_path / "d.inp").write_text(DECK)
    given = ("sweep", "d.inp", "--vary", "velocity=50,100,200,300,400,600,900", "--history")
    full_sweep = call(*given, "--model", "full", "-o", "full.h5", cwd=tmp_path)
    assert full_sweep.exit_code == 0
    done = call(*given, "--model", "reduced", "--modes", "2", "-o", "s.h5", cwd=tmp_path)
    assert done.exit_code == 0, done.stderr
    actual, full = (fecm.load_sweep(tmp_path / name) for name in ("s.h5", "full.h5"))
    assert actual.reduced is not None
    assert actual.reduced.in_full == 3
    np.testing.assert_array_equal(actual["peak_force"][4:], full["peak_force"][4:])
    assert np.all(np.abs(actual["peak_force"][:4] / full["peak_force"][:4] - 1.0) < 0.02)
    assert "the 3 cases of the largest energies are run in full" in done.stderr
    assert "with more modes they may be fewer" in done.stderr
    for shown in (done.stdout, call("info", "s.h5", cwd=tmp_path).stdout):
        assert "3 cases of the largest energies: in full, as above 2%" in shown
    assert actual.force is not None
    assert full.force is not None
    np.testing.assert_array_equal(actual.force[5, :STEPS], full.force[5])
    np.testing.assert_allclose(np.nanmax(actual.force, axis=1)[1:], actual["peak_force"][1:])


@pytest.mark.parametrize("held", [*range(9), 29, 30])
def test_the_model_holds_up_to_the_smallest_energy_at_which_it_fails(held: int) -> None:
    ordered = list(range(100, 130))
    ran: list[int] = []

    def failing(cases: Iterable[int]) -> set[int]:
        ran.extend(case for case in cases if case not in ran)
        return {case for case in ran if case >= 100 + held}

    assert count_held(ordered, failing) == held
    assert ran[0] == 129  # the largest energy first
    assert len(ran) <= 2 + 5 + 1  # smallest and largest, bisection of 30, the middle


def test_a_model_that_fails_in_the_middle_is_not_taken_beyond_it() -> None:
    assert count_held(list(range(30)), lambda cases: {case for case in cases if case == 15}) == 15


def test_a_model_with_all_its_modes_is_not_told_to_take_more(soft: None) -> None:
    with pytest.raises(CasesError, match="these are all its modes; take full runs"):
        fecm.sweep(DECK, {"velocity": [900.0]}, model="reduced", modes=MOST_MODES)


@pytest.mark.usefixtures("every_vector")
def test_a_case_does_not_depend_on_the_others(swept: fecm.SweepResult) -> None:
    others = {"velocity": [900.0, 450.0], "k": [5e4]}
    again = fecm.sweep(DECK, others, model="reduced", modes=ENOUGH, measure="max_deflection")
    for name in ("peak_force", "max_deflection", "impulse", "permanent_indentation"):
        np.testing.assert_equal(again[name][0], swept[name][2])


def test_an_elastic_rod_hits_the_reduced_plate_as_the_full_one() -> None:
    deck = text(WHOLE, data=ROD)
    given = {"velocity": [300.0]}
    model = fecm.sweep(deck, given, model="reduced", modes=ENOUGH)
    full = fecm.sweep(deck, given)
    assert model["peak_force"] == pytest.approx(full["peak_force"], rel=1e-3)
    assert model["rebound_velocity"] == pytest.approx(full["rebound_velocity"], rel=2e-3)


@compiled
@pytest.mark.parametrize("coupled", [False, True], ids=["flat-mass", "curved-damped-rod"])
def test_kernels_give_what_numpy_gives_and_a_case_the_same_bytes_with_any_others(
    coupled: bool,
) -> None:
    deck = text(PROGRAM, data=ROD + "CURV\n.02, .01, 0.\n\n" if coupled else BLOW)
    (problem,) = load_deck(deck).problems
    model = reduced(problem, ENOUGH)
    spring = 0.01 * float((model.plate.deflection**2 / model.plate.stiffness).sum())
    model = replace(model, plate=replace(model.plate, flexibility=spring))
    if coupled:
        model = replace(model, plate=replace(model.plate, damping=1000.0)).halved(3)
    model = replace(model, steps=2000 if coupled else 500)
    model = replace(model, times=model.dt * np.array([0.4, 1.0, 77.3, 77.9, model.steps]))
    assert model.plate.coupled == (0 if coupled else model.plate.shapes)
    rng = np.random.default_rng(3)
    count = 11
    scale, speed = rng.uniform(0.5, 2.0, count), rng.uniform(0.0, 900.0, count)
    k, critical = rng.uniform(2e4, 8e4, count), rng.uniform(1e-3, 3e-3, count)
    slope, q = rng.uniform(0.0, 0.2, count), rng.uniform(1.5, 2.5, count)

    def hits(rows: list[int]) -> Hits:
        law = HystereticLaw(LinearPermanent(k[rows], critical[rows], slope[rows], q[rows]))
        kind = np.zeros(len(rows), np.intp)
        return Hits([strike_of(problem.deck).projectile], kind, scale[rows], law, speed[rows])

    whole = list(range(count))
    actual, wanted = model.impacts(hits(whole)), model.by_numpy(hits(whole))
    assert wanted.force.max() > 10.0
    assert (np.abs(actual.force - wanted.force) <= 1e-10 * wanted.force.max()).all()
    np.testing.assert_array_equal(actual.unconverged_steps, wanted.unconverged_steps)
    assert actual.coordinates is not None
    assert wanted.coordinates is not None
    size = np.abs(wanted.coordinates).max()
    assert np.abs(actual.coordinates - wanted.coordinates).max() <= 1e-10 * size
    assert np.abs(np.diff(wanted.coordinates[:, 1:4], axis=1)).max() > 1e-3 * size
    np.testing.assert_allclose(actual.error, wanted.error, rtol=0.0, atol=1e-10)
    for kind in ("indentation", "plate"):
        for name, values in getattr(wanted, kind)._asdict().items():
            atol = 1e-10 * np.abs(values).max()
            computed = getattr(getattr(actual, kind), name)
            np.testing.assert_allclose(computed, values, rtol=0.0, atol=atol, err_msg=name)
    for some in ([3], [0, 10], [9, 8, 7, 6, 5, 4]):
        part = model.impacts(hits(some))
        np.testing.assert_array_equal(part.force, actual.force[:, some])
        np.testing.assert_array_equal(part.error, actual.error[some])
        np.testing.assert_array_equal(part.plate.largest, actual.plate.largest[some])


def test_cases_of_many_velocities_are_few_tasks() -> None:
    (problem,) = load_deck(DECK).problems
    cases: list[Any] = [{"velocity": float(v)} for v in range(1, 301)]
    built = tasks(plan(problem, cases, modes=5))
    assert [len(task.numbers) for task in built] == [256, 44]


def test_a_rod_takes_a_step_in_which_a_wave_crosses_one_element_at_most() -> None:
    (problem,) = load_deck(text(PROGRAM, data=ROD)).problems
    reduced_model = reduced(problem, 1)
    (times,) = by_halvings(reduced_model, impacts_from_cards({0: strike_of(problem.deck)}))
    assert times > 0
    assert reduced_model.halved(times).dt <= 0.5 / 4 * (2e-4 / 1e7) ** 0.5


@pytest.mark.long
def test_the_compliance_left_out_is_in_series_with_the_contact() -> None:
    # A plate that does not move but by the spring: the energy of the projectile is that of both.
    k, c, mass, speeds = 1e5, 2e-5, 1e-3, np.array([500.0, 2000.0])
    none = np.zeros((1, 1))
    plate = ReducedPlate(np.array([1e16]), np.array([1e-3]), c, np.ones((1, 1)), none, none)
    law = LinearPermanent(*(np.full(2, x) for x in (k, 1e9, 0.0, 1.5)))
    hits = Hits([RigidMass(mass)], np.zeros(2, np.intp), np.ones(2), HystereticLaw(law), speeds)
    actual = ReducedImpacts(plate, 5e-7, 2000).impacts(hits)
    peak = actual.force.max(axis=0)
    assert actual.force[-1].max() == 0.0
    assert actual.error.max() < 1e-4
    stored = 0.4 * peak ** (5.0 / 3.0) / k ** (2.0 / 3.0) + 0.5 * c * peak**2
    np.testing.assert_allclose(stored, 0.5 * mass * speeds**2, rtol=1e-4)
    np.testing.assert_allclose(actual.plate.largest, c * peak, rtol=1e-6)
    np.testing.assert_allclose(actual.indentation.largest, (peak / k) ** (2.0 / 3.0), rtol=1e-4)


def test_a_stiff_contact_halves_the_time_step_of_its_cases() -> None:
    (problem,) = load_deck(DECK).problems
    reduced_model = reduced(problem, 3)
    soft = strike_of(problem.deck)
    stiff = soft.with_constant("k", 1e4 * soft.law.k)
    groups = by_halvings(reduced_model, impacts_from_cards({0: soft, 1: stiff, 2: soft}))
    times = {number: n for n, group in groups.items() for number in group}
    assert times[0] == times[2] < times[1]
    halved = reduced_model.halved(times[1])
    assert halved.dt * halved.steps == pytest.approx(
        reduced_model.dt * reduced_model.steps, rel=1e-14
    )
    assert reduced_model.dt * reduced_model.steps == pytest.approx(STEPS * 4e-7, rel=1e-12)


NOT_GIVEN: list[tuple[str, dict[str, Any], str]] = [
    (LINEAR, {}, "for decks with NONL"),
    (DECK, {"measure": lambda result: {"w": 0.0}}, "stores no result for a function"),
    (DECK, {"vary": {"dt": [4e-7]}}, "time step of its own"),
    (DECK, {"vary": None, "refine": [1, 2]}, "time step of its own"),
    (DECK, {"modes": 0}, "1 to 40 bending modes, not 0"),
    (DECK, {"modes": 41}, "1 to 40 bending modes, not 41"),
    (DECK, {"model": None, "modes": 5}, "`modes` needs `model`"),
    (DECK, {"model": "linear"}, "unknown model 'linear'"),
    (DECK, {"vary": {"velocity": [0.0]}}, "no case has an energy"),
    (text(PROGRAM, data=BLOW + forces(1.0)), {}, "starts at rest"),
]


@pytest.mark.parametrize(("deck", "given", "reason"), NOT_GIVEN)
def test_what_the_model_does_not_give_is_refused(
    deck: str, given: dict[str, Any], reason: str
) -> None:
    options: dict[str, Any] = {"vary": {"velocity": [600.0]}, "model": "reduced"}
    with pytest.raises(CasesError, match=reason):
        fecm.sweep(deck, **(options | given))


@pytest.mark.usefixtures("coarse")
def test_a_refused_sweep_leaves_nothing_behind(tmp_path: Path) -> None:
    (tmp_path / "d.inp").write_text(DECK)
    given = ("sweep", "d.inp", "--vary", "velocity=900", "--model", "reduced", "--modes")
    refused = call(*given, "1", cwd=tmp_path)
    assert refused.exit_code == 2
    assert "take more modes" in refused.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["d.inp"]


def test_modes_without_the_model_are_a_usage_error(tmp_path: Path) -> None:
    (tmp_path / "d.inp").write_text(DECK)
    done = call("sweep", "d.inp", "--vary", "velocity=300", "--modes", "5", cwd=tmp_path)
    assert done.exit_code == 2
    assert "--modes needs --model" in done.stderr
