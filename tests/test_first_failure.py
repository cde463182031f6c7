"""FAIL: when, and at what force and energy, each criterion first reaches 1."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import fecm
from fecm import Result
from fecm._typing import Bools
from fecm.mechanics.exposures import FailureEnvelope, Largest, Maxima
from fecm.mechanics.failure import CRITERIA, exposure_of
from fecm.mechanics.ply_stresses import PlyStresses
from fecm.problem.loading import load_deck
from fecm.problem.parts import strengths_of_deck
from fecm.results.exposures import evaluations_in_contact, first_failures
from tests.calls import call
from tests.decks import DATA_CARDS, DISC, PROGRAM, small
from tests.test_machines import validate

STEPS = 60
# In plies of one thickness two faces or two elements would reach 1 together, but for rounding.
UNLIKE = DATA_CARDS.replace(".106", ".116").replace("2  90.     0.053", "2  90.     0.063")
WEAK = "ALLO\n5000.,5000.,150.,700.,300.,25.\n\nEXPE"


def failing(
    every: int = 1, allowables: str = WEAK, steps: int = STEPS, data: str = DATA_CARDS
) -> str:
    """The small plate hit off its middle, whose displacements are stored at every step."""
    program = PROGRAM.replace("LOOP         10", f"LOOP{steps:11}")
    program = program.replace("DISP          5", f"DISP          1\nFAIL{every:11}")
    return small(program, data=data).replace("EXPE", f"{DISC}{allowables}", 1)


def run(text: str, **options: object) -> Result:
    actual = fecm.run(text, **options)  # type: ignore[arg-type]
    assert isinstance(actual, Result)
    return actual


@pytest.fixture(scope="module")
def every_step() -> Result:
    return run(failing())


def histories(result: Result) -> dict[str, np.ndarray]:
    """Largest exposure outside the load at every stored row, from the ply stresses."""
    (problem,) = load_deck(failing()).problems
    stresses = PlyStresses(problem.mesh, problem.laminate, problem.rules[2])
    ((card, *_),) = strengths_of_deck(problem.deck)
    assert card is not None
    outside = result["failure/under_load"] == 0
    rows = [stresses.evaluate(field) for field in result["tape3/displacement"]]
    return {
        name: np.array(
            [
                exposure_of(criterion(card, row["sigma_1"], row["sigma_2"], row["tau_12"]))[
                    outside
                ].max()
                for row in rows
            ]
        )
        for name, criterion in CRITERIA.items()
    }


def test_first_failures_are_the_first_crossings_of_the_stresses(every_step: Result) -> None:
    by_name = {one.criterion: one for one in every_step.first_failures}
    times = every_step["tape3/time"]
    expected = histories(every_step)
    assert {*CRITERIA} <= {*by_name}
    for name, exposures in expected.items():
        so_far = np.maximum.accumulate(exposures)
        row = int(np.argmax(so_far >= 1.0))
        assert 0 < row < len(times) - 1
        one = by_name[name]
        assert (one.earliest, one.latest) == (times[row - 1], times[row])
        assert one.time == pytest.approx(np.interp(1.0, so_far, times), rel=1e-12)
        assert one.force == pytest.approx(np.interp(one.time, every_step.time, every_step.force))
    assert every_step.first_failures == sorted(by_name.values(), key=lambda one: one.time)


def test_the_energy_of_the_first_failure_is_what_the_projectile_has_lost(
    every_step: Result,
) -> None:
    left = every_step["energy/projectile_kinetic"] + every_step["energy/projectile_strain"]
    initial = every_step.energy.attributes["initial"]
    for one in every_step.first_failures:
        lost = np.interp(one.time, every_step.time, initial - left)
        assert one.energy == pytest.approx(lost, rel=2e-3)


def test_place_ply_and_mode_are_those_of_the_state_that_reaches_1(every_step: Result) -> None:
    (one,) = (one for one in every_step.first_failures if one.criterion == "max_stress")
    until = int(np.searchsorted(every_step["tape3/time"], one.latest)) + 1
    cut = run(failing(steps=until))
    exposure = cut["failure/max_stress/exposure"].copy()
    exposure[cut["failure/under_load"] != 0] = 0.0
    element, point, ply, face = np.unravel_index(exposure.argmax(), exposure.shape)
    modes = cut.failure.attributes["modes"]
    assert one.ply == ply + 1
    assert one.mode == modes[cut["failure/max_stress/mode"][element, point, ply, face]]
    places = [cut[f"failure/{axis}"][element, point] for axis in "xy"]
    assert [one.x, one.y] == pytest.approx(places, rel=1e-12)


def test_rare_evaluations_bracket_the_first_failure_and_are_counted(every_step: Result) -> None:
    rare = run(failing(every=7))
    assert evaluations_in_contact(rare) == np.count_nonzero(rare.force[6::7] > 0.0) < 20
    assert any(f"evaluated {STEPS // 7} times during contact" in note for note in rare.notes)
    assert evaluations_in_contact(every_step) == np.count_nonzero(every_step.force > 0.0)
    assert not any("evaluated" in note for note in every_step.notes)
    exact = {one.criterion: one for one in every_step.first_failures}
    for one in first_failures(rare):
        assert one.earliest <= exact[one.criterion].latest
        assert exact[one.criterion].earliest <= one.latest
        assert one.latest - one.earliest <= 7 * 0.5e-6 * (1.0 + 1e-9)


@pytest.mark.parametrize("where", ["interval", "outside"])
@pytest.mark.few(1)  # of 2, 0.2 s each
def test_fail_that_is_never_evaluated_in_contact_is_told(tmp_path: Path, where: str) -> None:
    text = failing(every=9000)
    if where == "outside":
        text = text.replace("FAIL       9000\n", "").replace("LOOP", "FAIL\nLOOP")
    (tmp_path / "d.inp").write_text(text)
    done = call("run", "d.inp", cwd=tmp_path)
    assert "note: FAIL was evaluated 0 times during contact, less than 20" in done.stderr
    assert "evaluations       0 of FAIL during contact" in done.stdout
    assert "first failure" not in done.stdout
    assert run(text).first_failures == []


def test_numpy_and_the_kernels_find_the_same_first_failures() -> None:
    actual, other = (run(failing(data=UNLIKE), solver=solver) for solver in ("auto", "numpy"))
    assert [one.criterion for one in other.first_failures] == [
        one.criterion for one in actual.first_failures
    ]
    for one, same in zip(actual.first_failures, other.first_failures, strict=True):
        assert (one.mode, one.ply, one.x, one.y) == (same.mode, same.ply, same.x, same.y)
        assert one.time == pytest.approx(same.time, rel=1e-9)


def test_summary_and_json_have_the_first_failure(tmp_path: Path, every_step: Result) -> None:
    (tmp_path / "d.inp").write_text(failing())
    done = call("run", "d.inp", cwd=tmp_path)
    first = every_step.first_failures[0]
    lines = [line.strip() for line in done.stdout.splitlines()]
    (line,) = (line for line in lines if line.startswith("first failure"))
    for words in (
        f"{first.mode} ({first.criterion})",
        f"{first.where} at ({first.x:.6g}, {first.y:.6g})",
        f"time {float(f'{first.time:.4g}'):.6g}",
        f"force {float(f'{first.force:.4g}'):.6g}",
    ):
        assert words in line
    for command in (("run", "d.inp", "--overwrite"), ("info", "d.h5")):
        output = call(*command, "--format", "json", cwd=tmp_path).stdout
        validate(command[0], output)
        given = json.loads(output)
        failure = given.get("run", given)["metrics"]["failure"]
        assert failure["evaluations_in_contact"] == evaluations_in_contact(every_step)
        assert failure["first"][0] == vars(first) | {"materials": []}
        assert failure["largest"]["puck"] == every_step["exposures/exposure"][-1, 3]
        assert failure["history"]["time"] == every_step["exposures/time"].tolist()
        puck = failure["history"]["exposure"]["puck"]
        assert puck == every_step["exposures/exposure"][:, 3].tolist()
        # It first reaches 1 between the evaluations that the first failure names.
        (own,) = (one for one in failure["first"] if one["criterion"] == "puck")
        reached = next(row for row, value in enumerate(puck) if value >= 1.0)
        assert failure["history"]["time"][reached] == own["latest"]


def test_exposures_below_1_have_no_first_failure(tmp_path: Path) -> None:
    strong = "ALLO\n1e9,1e9,1e9,1e9,1e9\n\nEXPE"
    (tmp_path / "d.inp").write_text(failing(allowables=strong))
    done = call("run", "d.inp", cwd=tmp_path)
    assert "first failure     none by the end of the run, which is in contact: open" in done.stdout
    assert fecm.load(tmp_path / "d.h5").first_failures == []


def test_points_under_the_load_do_not_count_and_keep_their_exposures() -> None:
    generator = np.random.default_rng(4)
    elements, points, plies = 3, 4, 5
    near = np.zeros((elements, points), dtype=bool)
    near[1, 2:] = near[2, 0] = True
    states = Maxima.none(len(CRITERIA), elements * points * plies * 2)
    states.exposure[:] = generator.random(states.exposure.shape)
    each = states.exposure.reshape(len(CRITERIA), elements, points, plies, 2)
    each[:, near] += 1.0  # the largest of all
    interfaces = Maxima.none(elements, plies - 1)
    interfaces.exposure[:] = [[3.0] * 4, [9.0] * 4, [1.0, 2.0, 8.0, 2.0]]
    before = states.exposure.copy()

    def largest(counts: Bools) -> Largest:
        envelope = FailureEnvelope(states, interfaces, Largest.none(len(CRITERIA) + 1))
        envelope.find_largest(counts, np.asarray(counts.all(axis=1)))
        return envelope.largest

    actual = largest(~near)
    np.testing.assert_array_equal(states.exposure, before)
    for number in range(len(CRITERIA)):
        outside = np.where(near[:, :, None, None], 0.0, each[number])
        assert actual.exposure[number] == outside.max() < 1.0
        assert actual.state[number] == outside.argmax()
    # Elements 2 and 3 have a point under the load.
    assert (actual.exposure[-1], actual.state[-1]) == (3.0, 0)
    nothing = largest(np.zeros_like(near))
    assert np.isnan(nothing.exposure).all()
