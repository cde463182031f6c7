"""The judge: what an end decides and where the model no longer holds, for all commands alike."""

from __future__ import annotations

import functools
import json
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.text import Text

import fecm
from fecm import Deck, SweepResult
from fecm.judge.end import (
    ENDS,
    Deflection,
    End,
    LastContact,
    RigidMotion,
    decided,
    ends,
    settled_deflection,
)
from fecm.judge.limits import INDENTATION, LIMITS, ModelLimit, TrustLevel
from fecm.judge.validity import (
    DEFLECTION,
    DOUBTS,
    Extent,
    InPlane,
    Judge,
    counted,
    in_plane_of,
    softness,
)
from fecm.plot.pictures import draw
from fecm.problem.loading import load_deck
from fecm.results.metrics import IndentationMetrics, Projectiles, impact_metrics
from fecm.results.summary import run_summary
from fecm.sweeps.statistics import exceedance_bounds, wilson
from tests.builders import table
from tests.calls import call
from tests.decks import small

pytestmark = pytest.mark.filterwarnings("ignore::fecm.FecmWarning")
WHOLE = 9e-3  # after which the contact of the soft plate is over


@functools.cache
def thin_plate() -> Deck:
    """A thin plate under a heavy mass: a force that rings while it rises for 4 ms."""
    return fecm.impact(
        fecm.Plate.rectangle((150, 100), (4, 4), support="simple"),
        fecm.Laminate("[45/0/-45/90]2s", "IM7/8552", 0.125),
        fecm.RigidMass(2e-3),
        fecm.Contact(49000.0, 1.0, 0.0, 1.5),
        velocity=2330,
        duration=WHOLE,
        units="mm-N-s",
        patch=None,
        damage=True,
        kinematics="linear",
        shear_factor=1.0,
    )


@functools.cache
def soft(duration: float = WHOLE) -> Deck:
    """The same for another time."""
    return thin_plate().with_(duration=duration)


@functools.cache
def swept(duration: float = WHOLE) -> SweepResult:
    """Draws of the velocity around that at which the peak reaches the threshold."""
    return fecm.sweep(
        soft(duration),
        random={"velocity": "normal:2330,150"},
        samples=32,
        exceed={"peak_force": "threshold"},
    )


# The end -----------------------------------------------------------------------------------------


def state(
    force: float,
    leaving: float,
    *,
    contact: float = 100.0,
    at: float = 0.0,
    ratio: float = 5.0,
) -> LastContact:
    """The end of a case whose largest force is 100."""
    values = (force, 100.0, contact, leaving, at, ratio)
    return LastContact(*(np.array([value]) for value in values))


def plate(speed: float = 100.0, energy: float = 3.0) -> Deflection:
    """A plate that reaches 3 with an energy of 3."""
    values = (1.0, 0.5, speed, energy, 1.0)
    return Deflection(*(np.array([value]) for value in values))


@pytest.mark.parametrize(
    ("last", "expected"),
    [
        (state(0.0, 91.0), End.OVER),  # nearly as fast as the plate ever was
        (state(0.0, 89.0), End.APART),
        (state(0.0, 36.0), End.APART),
        (state(0.0, 34.0), End.AGAIN),
        (state(0.0, 1.0, ratio=0.09), End.APART),  # a light projectile
        (state(0.0, 34.0, ratio=math.nan), End.AGAIN),
        (state(0.0, 29.0, at=-2.9), End.AGAIN),
        (state(0.0, 29.0, at=-3.1), End.OVER),  # out of reach
        (state(0.0, -1.0, at=-3.1), End.BETWEEN),
        (state(0.0, -1.0, ratio=0.1), End.BETWEEN),
        (state(0.0, math.nan), End.OVER),
        (state(80.0, 68.0), End.PASSED),
        (state(80.0, 66.0), End.RISING),
        (state(10.0, 40.0), End.PASSED),
        (state(10.0, 38.0), End.RISING),
        (state(80.0, 1.0, ratio=0.09), End.PASSED),
        (state(80.0, 70.0, contact=85.0), End.RISING),  # near the peak of a second contact
        (state(95.0, 90.0), End.RISING),  # near the largest force
        (state(80.0, -1.0), End.RISING),  # the projectile still approaches
        (state(80.0, math.nan), End.RISING),
    ],
)
def test_an_end_is_judged_by_the_force_and_the_way_of_the_projectile(
    last: LastContact, expected: End
) -> None:
    assert ends(last, plate()).tolist() == [expected]


def test_a_free_plate_that_bends_back_needs_a_faster_projectile() -> None:
    for last in (state(0.0, 40.0), state(10.0, 45.0)):
        held, free = (ends(last, plate(), is_held=held).item() for held in (True, False))
        assert held in (End.APART, End.PASSED)
        assert free in (End.AGAIN, End.RISING)
    assert ends(state(0.0, 46.0), plate(), is_held=False).tolist() == [End.APART]
    # About its rigid motion it reaches as far as a held plate.
    assert ends(state(0.0, 1.0, at=-3.1), plate(), is_held=False).tolist() == [End.OVER]


def test_a_rigid_motion_is_that_of_a_body_under_the_same_impulse() -> None:
    times, mobility = np.linspace(0.001, 2.0, 2000), 4.0
    force = np.where(times <= 1.0, 3.0, 0.0)
    motion = RigidMotion.of(force, times, mobility)
    # 3 for a time of 1 moves the mass 1/4 by 6, then by 12 per time.
    assert motion.displacement[[999, -1]] == pytest.approx([6.0, 18.0], rel=2e-3)
    assert motion.energy[-1] == pytest.approx(0.5 * 12.0 * 3.0, rel=2e-3)


def test_a_deflection_is_known_once_the_energy_of_the_plate_cannot_exceed_it() -> None:
    over = np.array([End.OVER])
    assert plate(energy=0.34).reach == pytest.approx(1.01, rel=1e-3)
    assert settled_deflection(over, plate(energy=0.33)).tolist() == [1.0]
    assert np.isnan(settled_deflection(over, plate(energy=0.35)))
    assert np.isnan(settled_deflection(np.array([End.PASSED]), plate(energy=0.33)))


def test_a_value_that_is_largest_at_the_last_step_in_contact_is_open() -> None:
    passed, largest = np.array([End.PASSED]), np.array([5.0])
    assert np.isnan(decided(largest, largest, passed))
    assert decided(largest, np.array([4.9]), passed).tolist() == [5.0]


def test_no_plate_exceeds_the_deflection_that_its_energy_allows() -> None:
    # A mass on a spring: the compliance seen is the static one.
    times = np.linspace(0.01, 20.0, 2000)
    w = np.sin(times) * np.where(times < 2.0 * np.pi, 1.0, 0.5)
    energy = np.where(times < 2.0 * np.pi, 0.5, 0.125)
    seen = Deflection.of(w[:, None], times, energy[:, None], 0.5)
    assert seen.compliance == pytest.approx(1.0, rel=1e-4)
    assert seen.reach == pytest.approx(0.5 * math.sqrt(1.5), rel=1e-4)
    assert seen.speed == pytest.approx(1.0, rel=1e-4)


@pytest.mark.parametrize("mass", [4e-6, 4e-5, 2e-3])
@pytest.mark.few(1)  # of 3, 0.7 s each
def test_a_peak_that_is_known_at_some_end_is_that_of_the_whole_run(mass: float) -> None:
    deck = soft().with_(mass=mass)
    run = fecm.run_one(deck)
    assert run.end is End.OVER
    known = 0
    for steps in range(1, len(run.force), 40):
        none = np.zeros(1)
        force, hit = run.force[:steps, None], Projectiles(mass, 2330.0)
        motion = Deflection.of(
            run.plate_w[:steps, None],
            run.time[:steps],
            (run["energy/plate_kinetic"] + run["energy/plate_strain"])[:steps, None],
            0.5 * mass * 2330.0**2,
        )
        actual = impact_metrics(
            force, run.time[:steps], IndentationMetrics(none, none, none, none), hit, motion
        )
        peak = actual.columns["peak_force"][0]
        if not math.isnan(peak):
            known += 1
            assert peak == run.force.max()
    assert known > 10


def test_a_free_plate_is_left_by_a_projectile_that_still_goes_forward() -> None:
    # The plate is lighter than the projectile: after the contact both fly on.
    run = fecm.run_one(small().replace("LOOP         10", "LOOP        400"))
    assert run.metrics["rebound_velocity"] < 0.0
    assert run.end is End.OVER


def test_a_free_plate_moves_under_an_impulse_as_a_rigid_body() -> None:
    mass = 0.000148 * 2.0 * 2.0 * 0.106  # of the small plate, free at x = y = 2 alone
    (problem,) = load_deck(small()).problems
    # Hit at the centre it does not turn.
    assert problem.judge.mobility == pytest.approx(1.0 / mass, rel=1e-9)
    (held,) = load_deck(soft()).problems
    assert held.judge.mobility == 0.0


# What it decides ---------------------------------------------------------------------------------


def test_no_interval_of_a_probability_excludes_that_of_whole_runs() -> None:
    whole = swept().random
    assert whole is not None
    right = whole.exceedance.probability[0]
    assert 0.2 < right < 0.8
    for duration in (3e-3, 5e-3):  # before the peaks and after
        cut = swept(duration).random
        assert cut is not None
        assert cut.exceedance.lower[0] <= right <= cut.exceedance.upper[0]
        assert cut.exceedance.draws[0] + cut.exceedance.open[0] == 32
    assert swept(3e-3)["status"].tolist() == ["still in contact"] * 32
    assert np.isnan(swept(3e-3)["peak_force"]).all()


def test_bounds_hold_whatever_the_open_draws_are() -> None:
    hits, count, lacking = (np.array(n, dtype=np.int64) for n in (3, 10, 4))
    share, low, high = exceedance_bounds(hits, count, lacking)
    assert np.isnan(share)  # the open draws are not a random choice
    assert exceedance_bounds(hits, count, np.zeros_like(lacking))[0] == 0.3
    every = [wilson(hits + more, count + lacking) for more in range(5)]
    assert low == min(lower for lower, _ in every)
    assert high == max(upper for _, upper in every)


def test_a_velocity_is_found_whatever_the_duration_of_the_deck() -> None:
    energies = []
    for duration in (3e-3, WHOLE):
        sweep_result = fecm.sweep(soft(duration), until="threshold")
        energies.append(sweep_result["found_energy"][0])
        assert sweep_result["validity"].tolist() == ["w > 0.3 h"]
    np.testing.assert_allclose(energies, energies[-1], rtol=1e-5)


def test_a_search_ends_where_no_run_is_long_enough() -> None:
    sweep_result = fecm.sweep(soft(1e-4), until="threshold")
    (status,) = sweep_result["status"]
    assert "open even in a run 8 times as long" in status
    assert sweep_result["validity"].tolist() == ["failed"]


def test_cases_together_and_full_runs_are_judged_alike() -> None:
    for duration in (3e-3, WHOLE):
        deck, speeds = soft(duration), [150.0, 600.0, 2330.0]
        together = fecm.sweep(deck, {"velocity": speeds})
        full = fecm.sweep(deck, {"velocity": speeds}, measure=lambda run: {"n": len(run.force)})
        for name in ("status", "validity"):
            assert together[name].tolist() == full[name].tolist()
        np.testing.assert_allclose(together["deflection_ratio"], full["deflection_ratio"], 1e-9)
        np.testing.assert_allclose(together["peak_force"], full["peak_force"], 1e-9)


# The range of the model --------------------------------------------------------------------------


def test_the_limit_of_the_deflection_depends_on_the_support_in_the_plane() -> None:
    codes = np.zeros((9, 5), dtype=np.int32)
    assert in_plane_of(codes) is InPlane.FREE
    codes[:8, 2] = 1  # w at the edges
    assert in_plane_of(codes) is InPlane.FREE
    codes[:2, :2] = 1  # as few as hold the plate against rigid motion
    assert in_plane_of(codes) is InPlane.FREE
    codes[:8, :2] = 1
    assert in_plane_of(codes) is InPlane.HELD
    codes[:, :2] = 1
    assert in_plane_of(codes) is InPlane.UNKNOWN
    codes[:, 1] = 0  # v is free
    assert in_plane_of(codes) is InPlane.HELD
    assert DEFLECTION[InPlane.HELD].value < DEFLECTION[InPlane.FREE].value


def test_a_plate_lies_on_a_window_unless_the_supports_inside_its_outline_hold_u_or_v() -> None:
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(5.0), np.arange(5.0)))
    places = np.column_stack([x, y])
    ring = np.maximum(np.abs(x - 2.0), np.abs(y - 2.0)) == 1.0
    codes = np.zeros((25, 5), dtype=np.int32)
    codes[ring, 2] = 1
    assert in_plane_of(codes, places) is InPlane.WINDOW
    codes[ring, :2] = 1
    assert in_plane_of(codes, places) is InPlane.HELD
    codes[:, :2] = 1  # no membrane at all
    assert in_plane_of(codes, places) is InPlane.WINDOW
    codes[:, 1] = 0
    assert in_plane_of(codes, places) is InPlane.HELD


@pytest.mark.parametrize("row", table("linear_error.csv"), ids=lambda row: row["case"])
def test_the_error_that_is_told_is_that_of_nonlinear_impacts(row: dict[str, str]) -> None:
    # Impacts of the same energy on plates of thickness 2 mm.
    ratio, error = float(row["linear_W_mm"]) / 2.0, -float(row["force_error_of_linear_percent"])
    in_plane = InPlane.FREE if row["case"].endswith("_movable") else InPlane.HELD
    if ratio > 5.0:
        assert "at least" in softness(ratio, in_plane)
        return
    for text in (softness(ratio, in_plane), softness(ratio, InPlane.UNKNOWN)):
        low, high = (int(word) for word in text.split() if word.isdigit())
        assert low - 1.5 <= error <= high + 1.5


def test_a_run_says_what_is_open_and_what_is_elastic_only() -> None:
    cut, whole = fecm.run_one(soft(3e-4)), fecm.run_one(soft().with_(velocity=2500))
    assert (cut.end, whole.end) == (End.RISING, End.OVER)
    text = "\n".join(run_summary(cut))
    assert "not reached by the end of the run, which is in contact: open" in text
    assert "peak force        at least" in text
    assert math.isnan(cut.metrics["peak_force"])
    assert math.isnan(float(cut.threshold["margin"]))
    assert "peak not reached" in cut.validity
    threshold = float(whole.threshold["force"])
    text = "\n".join(run_summary(whole))
    assert (
        f"(elastic prediction; delamination is expected at the latest from {threshold:.4g} N"
        in text
    )
    assert " absorbed (left in plate, indentation and projectile)" in text
    assert {"w > 0.3 h", "peak force > threshold"} <= set(whole.validity.split("; "))


def test_one_place_has_one_deflection() -> None:
    run = fecm.run_one(soft())
    (note,) = [note for note in run.notes if note.startswith("the deflection")]
    (line,) = [line for line in run_summary(run) if line.startswith("largest w")]
    assert float(note.split()[3]) == pytest.approx(float(line.split()[2]), rel=1e-3)
    assert "too low at the same energy" in note
    assert "unsafe" in note


def test_an_end_between_two_contacts_is_no_end() -> None:
    # The plate is hit three times; what lies between is seen by its forces alone.
    run = fecm.run_one(soft().with_(mass=4e-5))
    touching = run.force > 0.0
    gap = int(np.flatnonzero(~touching)[0])
    assert touching[gap:].any()
    cut = fecm.run_one(soft(float(run.time[gap])).with_(mass=4e-5))
    assert not cut.still_in_contact
    assert cut.end is End.BETWEEN
    assert any("ends between two contacts" in note for note in cut.notes)
    assert math.isnan(cut.metrics["peak_force"])


def followed(duration: float) -> fecm.Deck:
    """A plate that follows a light ball and hits it again, a fifth harder."""
    return fecm.impact(
        fecm.Plate.rectangle((90, 45), (6, 3), support="simple"),
        fecm.Laminate("[0/90]4s", "IM7/8552", 0.13333),
        fecm.RigidMass(4.358e-6),
        fecm.Contact(62994.0, 1.0, 0.0, 1.5),
        velocity=5230.0,
        duration=duration,
        units="mm-N-s",
        shear_factor=1.0,
        kinematics="linear",
    )


def test_a_run_says_that_the_plate_may_touch_the_projectile_again() -> None:
    cut, whole = fecm.run_one(followed(1.35e-4)), fecm.run_one(followed(1e-3))
    assert cut.force[-1] == 0.0
    assert whole.force.max() > 1.15 * cut.force.max()
    assert cut.end is End.AGAIN
    assert "may touch again" in cut.validity
    (note,) = [note for note in cut.notes if "may touch it again" in note]
    steps = int(re.search(r"about (\d+) more steps", note)[1])  # type: ignore[index]
    decided_by = cut.time[-1] * (1.0 + steps / len(cut.time))
    assert decided_by > whole.metrics["last_contact"]
    assert any("reached in contact 3" in note for note in whole.notes)
    assert whole.metrics["peak_contact"] == 3
    first = whole.force[: int(np.flatnonzero(np.diff((whole.force > 0.0).astype(int)) < 0)[0]) + 1]
    assert whole.metrics["first_peak"] == first.max()
    assert cut.metrics["first_peak"] == first.max()


def test_a_sweep_continues_until_no_contact_can_follow() -> None:
    cut, whole = (
        fecm.sweep(followed(duration), {"velocity": [5230.0]}) for duration in (1.35e-4, 1e-3)
    )
    for name in ("peak_force", "first_peak", "peak_contact", "impulse"):
        assert cut[name] == pytest.approx(whole[name], rel=1e-6)
    assert cut["status"].tolist() == ["ok"]


# The commands ------------------------------------------------------------------------------------


def test_a_sweep_counts_what_is_beyond_its_model(tmp_path: Path) -> None:
    (tmp_path / "d.inp").write_text(soft().to_text())
    done = call("sweep", "d.inp", "--vary", "velocity=100,600,2500", "-o", "s.h5", cwd=tmp_path)
    assert done.exit_code == 0
    last = done.stdout.splitlines()[-1]
    assert last.startswith("3 cases: 2 beyond the linear plate (w > 0.3 h, up to 3.")
    assert last.endswith("h), 1 elastic predictions (peak force > threshold)")
    assert "therefore too high (unsafe)" in done.stderr
    loaded = fecm.load_sweep(tmp_path / "s.h5")
    assert loaded["validity"].tolist() == ["ok", "w > 0.3 h", "w > 0.3 h; peak force > threshold"]
    picture: Any = draw("map", {"s": loaded}).figure
    (axes, *_) = picture.axes
    texts = [text.get_text() for text in picture.findobj(match=Text)]
    assert any("beyond the linear plate (w > 0.3 h): 2 of 3 cases" in text for text in texts)
    assert axes.get_lines()[-1].get_xdata().tolist() == [600.0, 2500.0]


def test_reasons_of_other_versions_count_together() -> None:
    texts = np.array(["ok", "failed", "", "w > 0.3 h; moon full", "sun low"])
    by_name = {doubt.reason: some.tolist() for doubt, some in counted(texts)}
    assert by_name == {
        "w > 0.3 h": [False, False, False, True, False],
        "other": [False, False, False, True, True],
    }


def test_a_case_run_in_full_has_the_notes_of_a_run(tmp_path: Path) -> None:
    (tmp_path / "d.inp").write_text(soft().to_text())
    given = ("sweep", "d.inp", "--vary", "velocity=100,2500", "--full", "1", "-o", "s.h5")
    done = call(*given, cwd=tmp_path)
    notes = fecm.load(tmp_path / "s-1.h5").notes
    assert notes
    assert all(f"note: case 1: {text}" in done.stderr for text in notes)


def test_an_open_probability_ends_in_1(tmp_path: Path) -> None:
    (tmp_path / "d.inp").write_text(soft(1e-3).to_text())
    options = ("--random", "velocity=normal:2330,150", "--samples", "16", "--exceed")
    given = ("sweep", "d.inp", *options, "peak_force=threshold", "-o", "s.h5", "--overwrite")
    done = call(*given, cwd=tmp_path)
    assert done.exit_code == 1
    assert "= open (0 to 1); 16 draws are open" in done.stdout
    assert re.search(r"no value +16", done.stdout)
    assert "--vary duration=0.002" in done.stderr
    assert call(*given, "--allow-failed", cwd=tmp_path).exit_code == 0


@pytest.mark.long  # the infinite plate takes seconds at such a mass
def test_an_estimate_tells_the_deflection_at_the_threshold(tmp_path: Path) -> None:
    (tmp_path / "d.inp").write_text(soft(3e-3).with_(velocity=200).to_text())
    done = call("estimate", "d.inp", cwd=tmp_path)
    assert done.exit_code == 0
    text = re.findall(r"the (.*) at the threshold deflects by (\S+) h", done.stderr)
    deflections = {model: float(ratio) for model, ratio in text}
    assert list(deflections) == ["static plate", "run"]
    # The run at the threshold goes on until its contact is over.
    longer = fecm.run_one(soft(12e-3).with_(velocity=2222))
    (problem,) = load_deck(soft()).problems
    ratio = longer.metrics["max_deflection"] / problem.judge.thickness
    assert deflections["run"] == pytest.approx(ratio, rel=0.01)
    assert 2.0 < deflections["static plate"] < 4.0
    (own,) = [line for line in done.stdout.splitlines() if line.lstrip().startswith("run ")]
    assert own.split()[1:3] == ["open", "open"]
    assert "needs a longer duration" in done.stderr


def test_the_json_of_a_run_has_its_end_and_its_validity(tmp_path: Path) -> None:
    (tmp_path / "d.inp").write_text(soft(3e-4).to_text())
    done = call("run", "d.inp", "--format", "json", cwd=tmp_path)
    said = json.loads(done.stdout)
    assert said["end"] == "in contact, peak not reached"
    assert said["validity"].startswith("peak not reached")
    assert said["metrics"]["threshold_margin"] == "NaN"


@pytest.mark.parametrize("limit", LIMITS, ids=lambda limit: limit.reason)
def test_a_case_beyond_a_limit_has_its_reason_and_a_case_at_it_has_none(limit: ModelLimit) -> None:
    in_plane = next((place for place, row in DEFLECTION.items() if row is limit), InPlane.HELD)
    judge, above = Judge(2.0, in_plane), np.array([False, True])
    bound = 100.0 * limit.value if limit.symbol == "peak force" else judge.largest(limit)
    largest = {limit: np.where(above, 1.001 * bound, bound)}
    extent = Extent(np.array([End.OVER, End.OVER]), largest, threshold=100.0)
    assert judge.validity(extent).tolist() == ["ok", limit.reason]
    of_rows = Extent(np.array([End.OVER]), {}, of_rows=[limit.reason])
    assert judge.validity(of_rows).tolist() == [limit.reason]
    assert DOUBTS[limit.reason] == limit.doubt
    assert limit.judgement("x", beyond=True).level is limit.doubt.level


@pytest.mark.parametrize("end", End)
def test_an_end_that_leaves_the_peak_open_is_outside_the_model_for_runs_and_cases(end: End) -> None:
    meaning = ENDS[end]
    (validity,) = Judge(2.0).validity(Extent(np.array([end]), {})).tolist()
    peak_known = end in (End.OVER, End.PASSED, End.APART)
    assert (validity == "ok") == peak_known
    assert (meaning.level is TrustLevel.OUTSIDE) == (not peak_known)
    assert ("lower bound" in meaning.words) == (not peak_known)
    if meaning.doubt is not None:
        assert validity == meaning.doubt.reason


# Linear against nonlinear runs of D7136 with 2.096 mm of [45/0/-45/90]2s IM7/8552 (w/h of the
# linear plate, per cent that its force is too low), and with 4.416 mm of [45/0/-45/90]3s.
ON_THE_WINDOW = [
    (1.88, 24.0), (2.66, 33.0), (3.76, 42.0), (4.61, 47.0),
    *(
        (float(row["linear_W_mm"]) / float(row["laminate"].split()[-2]),
         -float(row["force_error_of_linear_percent"]))
        for row in table("nonlinear_d7136.csv")
        if row["window"] == "w held, u v free" and row["linear_W_mm"]
    ),
]  # fmt: skip


def test_a_plate_on_a_window_is_told_one_error_which_is_that_of_nonlinear_runs() -> None:
    deck = fecm.impact(
        fecm.Plate.on_fixture("D7136", (4, 4)),
        fecm.Laminate("[45/0/-45/90]2s", "IM7/8552", 0.131),
        energy="10J",
        duration=1e-5,
        kinematics="linear",
    )
    (problem,) = load_deck(deck.to_text()).problems
    for ratio, low in ON_THE_WINDOW:
        words = problem.judge.softness(ratio)
        (said,) = re.findall(r"about (\d+) % too low", words)
        assert abs(float(said) - low) <= 2.0
        assert "window" in words


def on_metal(contact: fecm.Contact, energy: str) -> fecm.Result:
    """A steel sphere of 1 kg on 4 mm of aluminium, mm-N-s."""
    deck = fecm.impact(
        fecm.Plate.rectangle((100.0, 100.0), (4, 4), support="clamped"),
        fecm.Laminate([0], "2024-T3", 4.0),
        fecm.RigidMass(1e-3),
        contact,
        energy=energy,
        duration=1.5e-3,
        kinematics="linear",
    )
    return fecm.run_one(deck)


def test_an_elastic_contact_far_beyond_yield_has_a_note_with_the_mean_pressure() -> None:
    law = fecm.Contact(228617.0)  # of a steel sphere of 8 mm on 2024-T3, by Hertz
    (note,) = [text for text in on_metal(law, "5J").notes if "mean contact pressure" in text]
    force = float(on_metal(law, "5J").force.max())
    indentation = (force / 228617.0) ** (2.0 / 3.0)
    times = force / (np.pi * 8.0 * indentation) / 345.0  # sigma_y of the catalogue, MPa
    assert times > 5.0
    said = re.search(r"about (\S+) times the yield stress 345 N/mm\^2", note)
    assert said is not None
    assert float(said[1]) == pytest.approx(times, rel=0.02)
    for other in (on_metal(law, "1mJ"), on_metal(fecm.Contact(228617.0, 0.0, 0.4, 2.5), "5J")):
        assert not any("mean contact pressure" in text for text in other.notes)


def test_the_indentation_of_a_sandwich_is_compared_with_the_face_that_is_struck() -> None:
    core: Any = (0, "Divinycell-H60", 10.0)
    deck = fecm.impact(
        fecm.Plate.rectangle((100.0, 100.0), (4, 4), support="simple"),
        fecm.Laminate([0, 90, core, 90, 0], "AS4/8552", 0.13),
        fecm.RigidMass(1e-5),
        fecm.Contact(5e4),
        velocity=2000.0,
        duration=2e-4,
    )
    (problem,) = load_deck(deck.to_text()).problems
    assert problem.laminate.struck_thickness == pytest.approx(0.26)
    extent = Extent(np.array([End.OVER]), {INDENTATION: np.array([0.07])})
    assert problem.judge.validity(extent).tolist() == ["indentation > h/4"]
    shallow = replace(extent, largest={INDENTATION: np.array([0.06])})
    assert problem.judge.validity(shallow).tolist() == ["ok"]
