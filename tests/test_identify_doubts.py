"""Onsets, lags, offsets and other models: what a fit to a measured force must not mistake."""

from __future__ import annotations

import re
from collections.abc import Iterable
from contextlib import nullcontext
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from numpy.typing import NDArray

import fecm
from fecm._errors import StudyError
from fecm.identification.alignment import IdentifyError, level, noise, onset
from fecm.identification.misfit import sign_runs
from fecm.report.report import page_of
from fecm.studies.rod_test.filters import filter_of
from tests.calls import call

Floats = NDArray[np.float64]
NOISE = 0.02  # standard deviation over the peak

# A plate whose first hump is just below half of its peak -----------------------------------------

HUMPS = 1e-6 * np.arange(1.0, 241.0)
TRUE = {"k": 6e4, "mass": 4e-5, "velocity": 2500.0, "delay": 0.0}


Support = Literal["simple", "clamped"]


def clamped(k: float, mass: float, velocity: float, support: Support = "clamped") -> fecm.Deck:
    """A mass of 40 g on a thin plate, mm-N-s: humps of 480, 288, 361 and 996 N."""
    return fecm.impact(
        fecm.Plate.rectangle((120, 80), (12, 8), support=support),
        fecm.Laminate("[0/90]3s", "IM7/8552", 0.2),
        fecm.RigidMass(mass),
        fecm.Contact(k, 1.0, 0.0, 1.5),
        velocity=velocity,
        duration=2.4e-4,
        dt=4e-7,
        units="mm-N-s",
        patch="disc:12",
        kinematics="linear",
        shear_factor=1.0,
    )


@cache
def humps() -> Floats:
    """Force of the true values."""
    result = fecm.run_one(clamped(TRUE["k"], TRUE["mass"], TRUE["velocity"]))
    force: Floats = np.interp(HUMPS, result.time, result.force)
    return force


@cache
def started(support: Support = "clamped") -> fecm.Deck:
    """Deck with values that are 6 to 17 % off."""
    return clamped(TRUE["k"] / 1.17, 1.1 * TRUE["mass"], 0.94 * TRUE["velocity"], support)


def noisy(force: Floats, seed: int) -> Floats:
    errors = NOISE * float(force.max()) * np.random.default_rng(seed).normal(size=len(force))
    return np.asarray(force + errors)


def deviations(seed: int, free: list[str]) -> list[float]:
    """Fitted minus true values over their standard errors."""
    fit = fecm.identify(started(), HUMPS, noisy(humps(), seed), free)
    assert fit.accepted
    return [(fit.values[name] - TRUE[name]) / fit.errors[name] for name in free]


def assert_inside(seeds: Iterable[int]) -> Floats:
    """Assert that all values are within four errors, without and with a delay; returns the last."""
    free = ["k", "mass", "velocity"]
    without = np.array([deviations(seed, free) for seed in seeds])
    assert np.abs(without).max() < 4.0
    values = np.array([deviations(seed, [*free, "delay"]) for seed in seeds])
    assert np.abs(values).max() < 4.0
    return values


@pytest.mark.filterwarnings("ignore:. of 240 points:fecm.FecmWarning")
def test_humps_near_half_of_the_peak_are_neither_refused_nor_shifted() -> None:
    # With it, the first hump is above half of the largest force; the long test has a hundred.
    assert_inside([3])


@pytest.mark.long
@pytest.mark.filterwarnings("ignore:. of 240 points:fecm.FecmWarning")
def test_100_noises_of_humps_are_fitted_within_four_standard_errors() -> None:
    assert np.std(assert_inside(range(100)), axis=0) == pytest.approx(np.ones(4), abs=0.25)


@pytest.mark.parametrize(
    "free",
    [
        pytest.param(["k", "mass", "velocity"], marks=pytest.mark.long),
        ["k", "mass", "velocity", "delay"],
    ],
)
@pytest.mark.long
def test_wrong_supports_are_called_a_wrong_model_and_not_a_delay(free: list[str]) -> None:
    with pytest.raises(IdentifyError, match="the model does not describe the data") as caught:
        fecm.identify(started("simple"), HUMPS, noisy(humps(), 0), free)
    assert "delay" not in str(caught.value)


def test_a_wrong_model_that_is_not_refused_is_not_accepted() -> None:
    force = humps()[::-1].copy()  # the largest hump first
    with pytest.warns(fecm.FecmWarning, match="the model does not describe the data"):
        fit = fecm.identify(started(), HUMPS, force, ["velocity"])
    assert not fit.accepted


@pytest.mark.parametrize("deviation", [0.05, 0.5, 3.0])
def test_noise_is_found_under_a_smooth_force(deviation: float) -> None:
    errors = deviation * np.random.default_rng(2).normal(size=2000)
    force = 100.0 * np.sin(np.linspace(0.0, np.pi, 2000)) + errors
    assert noise(force) == pytest.approx(deviation, rel=0.1)


def test_an_onset_is_that_of_the_first_hump_above_any_base_line() -> None:
    time = np.linspace(0.0, 1.0, 1001)
    force = np.where(time < 0.3, 0.0, 20.0) + np.where(time < 0.7, 0.0, 80.0)
    assert onset(time, force, 0.1) == pytest.approx(0.3)
    assert onset(time, force + 15.0, 0.1) == pytest.approx(0.3)
    force[100] = 100.0  # a single point
    assert onset(time, force, 0.1) == pytest.approx(0.3)


def test_the_level_of_an_onset_is_that_of_the_noise_and_not_half_of_the_peak() -> None:
    assert level(humps()) == 0.1
    errors = 0.05 * humps().max() * np.random.default_rng(5).normal(size=len(HUMPS))
    assert level(humps() + errors) == pytest.approx(0.25, rel=0.25)


# A zero error of the force, and a trigger ---------------------------------------------------------

LONG = np.linspace(0.0, 3e-3, 1000)
BASE, LATE = 60.0, 2.3e-4
HEAVY = {"k": 1e5, "mass": 5e-4, "velocity": 2000.0, "offset": BASE, "delay": LATE}


def heavy(k: float, mass: float, velocity: float, thickness: float = 0.18) -> fecm.Deck:
    """A mass of 0.5 kg that leaves the plate after 2.1 ms, mm-N-s; its peak is 2080 N."""
    return fecm.impact(
        fecm.Plate.rectangle((100, 100), (6, 6), support="simple"),
        fecm.Laminate("[45/0/-45/90]2s", "AS4/8552", thickness),
        fecm.RigidMass(mass),
        fecm.Contact(k, 1.0, 0.0, 1.5),
        velocity=velocity,
        duration=3e-3,
        dt=7e-7,
        units="mm-N-s",
        patch="hertz:18",
        kinematics="linear",
        shear_factor=1.0,
    )


def recorded(offset: float = 0.0, delay: float = 0.0) -> Floats:
    """A noisy force of the true values with errors of the record."""
    time, force = _heavy_force()
    return noisy(np.interp(LONG - delay, time, force), seed=1) + offset


@cache
def _heavy_force() -> tuple[Floats, Floats]:
    result = fecm.run_one(heavy(HEAVY["k"], HEAVY["mass"], HEAVY["velocity"]))
    return np.append([-1.0, 0.0], result.time), np.append([0.0, 0.0], result.force)


@cache
def doubted() -> fecm.Deck:
    return heavy(1.15 * HEAVY["k"], 1.08 * HEAVY["mass"], 0.94 * HEAVY["velocity"])


def found_inside(force: Floats, more: list[str], errors: float) -> fecm.Identification:
    fit = fecm.identify(doubted(), LONG, force, ["k", "mass", "velocity", *more])
    assert fit.accepted
    for name, value in fit.values.items():
        assert abs(value - HEAVY[name]) < errors * fit.errors[name], name
    return fit


def test_an_offset_is_fitted_or_proposed() -> None:
    force = recorded(offset=BASE)
    found_inside(force, ["offset"], errors=3.0)
    with pytest.warns(fecm.FecmWarning, match=r"fit offset too: with offset 5\d\.\d N the rms"):
        fit = fecm.identify(doubted(), LONG, force, ["k", "mass", "velocity"])
    assert (fit.accepted, fit.verdict) == (False, "no")
    assert fit.doubts[0] == fit.notes[0]


def test_an_offset_shows_before_the_contact_though_the_model_is_wrong() -> None:
    time = np.concatenate([np.linspace(-4e-5, -1e-6, 40), HUMPS])
    force = np.concatenate([np.zeros(40), humps()]) + 30.0
    with pytest.warns(fecm.FecmWarning, match="fit offset too: without contact the measured force"):
        fecm.identify(started("simple"), time, noisy(force, 0), ["velocity"])


@pytest.mark.parametrize("late", [pytest.param(LATE, marks=pytest.mark.long), -LATE])
@pytest.mark.long
def test_a_delay_is_fitted_or_proposed(late: float) -> None:
    force = recorded(delay=late)
    with pytest.warns(fecm.FecmWarning, match=rf"fit delay too: with delay {late:.1g}\d* s"):
        fit = fecm.identify(doubted(), LONG, force, ["k", "mass", "velocity"])
    assert not fit.accepted


def test_delay_and_offset_are_fitted_together() -> None:
    found_inside(recorded(BASE, LATE), ["delay", "offset"], errors=3.0)


def test_a_fit_with_a_doubt_says_so_in_table_json_and_page() -> None:
    fit = fecm.identify(doubted(), LONG, recorded(), ["k", "mass", "velocity"])
    doubted_fit = replace(fit, notes=("a reason",), doubts=("a reason",))
    assert doubted_fit.verdict == doubted_fit.to_dict()["verdict"] == "with doubts"
    assert "; accepted with doubts\n" in str(doubted_fit)
    page = page_of({"measured": doubted_fit})
    assert page.verdict[-1] == ("Accepted", "with doubts", ": a reason")
    assert page.level.value == "doubtful"


def test_points_of_the_contact_beyond_the_run_are_refused_and_others_are_not() -> None:
    longer = np.linspace(0.0, 3e-2, 10000)
    time, force = _heavy_force()
    force = np.interp(longer, time, force, right=0.0)
    with pytest.warns(fecm.FecmWarning, match="9000 of 10000 points are outside"):
        fit = fecm.identify(doubted(), longer, force, ["k", "mass", "velocity"])
    assert "9000 of 10000 points are outside the run of the deck and left out" in fit.notes
    # The contact is inside the run: the points left out are a remark and no reason to doubt.
    assert not any("outside" in doubt for doubt in fit.doubts)
    assert fit.verdict == ("with doubts" if fit.doubts else "yes")
    short = HUMPS < 1.7e-4
    deck = started().with_(duration=1.2e-4)
    with pytest.raises(StudyError, match="more than 20 % of the points of the contact"):
        fecm.identify(deck, HUMPS[short], humps()[short], ["k", "velocity"])


# Errors of the plate ------------------------------------------------------------------------------


@pytest.mark.long
def test_errors_of_the_plate_are_those_of_a_fit_with_another_plate() -> None:
    free = ["k", "mass", "velocity", "offset"]
    force = np.interp(LONG, *_heavy_force()) + BASE
    fit = fecm.identify(doubted(), LONG, force, free)
    e1 = doubted().require(fecm.deck.model.Material).ply.e1
    for name, other in (
        ("thickness", doubted().with_(thickness=1.01 * 16 * 0.18)),
        ("e1", doubted().with_(e1=1.01 * e1)),
    ):
        again = fecm.identify(other, LONG, force, free)
        for one in free[:3]:
            change = again.values[one] - fit.values[one]
            expected = pytest.approx(change, rel=0.1)
            assert fit.plate_errors[name][one] == expected, (name, one)


# The command --------------------------------------------------------------------------------------


def write(path: Path, time: Floats, force: Floats) -> None:
    np.savetxt(path, np.array([time, force]).T, delimiter=",", header="time,force", comments="")


def test_the_command_fails_where_values_are_not_to_be_used(tmp_path: Path) -> None:
    (tmp_path / "d.inp").write_text(doubted().to_text())
    write(tmp_path / "constant.csv", LONG, np.full(len(LONG), 1000.0))
    done = call("identify", "d.inp", "constant.csv", "--free", "k", cwd=tmp_path)
    assert (done.exit_code, done.stdout) == (1, "")
    assert "the measured force is constant, 1e+03; it contains no contact" in done.stderr
    write(tmp_path / "offset.csv", LONG, recorded(BASE))
    free = "k,mass,velocity"
    done = call("identify", "d.inp", "offset.csv", "--free", free, cwd=tmp_path)
    assert done.exit_code == 1
    assert "fit offset too" in done.stderr
    done = call("identify", "d.inp", "offset.csv", "--free", f"{free},offset", cwd=tmp_path)
    assert done.exit_code == 0
    assert re.search("1 % more in the deck +thickness +e1", done.stdout)


# A filter that nobody named ----------------------------------------------------------------------


def test_a_filter_that_was_not_named_is_named_with_its_rise_time() -> None:
    clock = np.concatenate([[-1e-4], 1e-7 * np.arange(2401.0)])
    run = fecm.run_one(clamped(TRUE["k"], TRUE["mass"], TRUE["velocity"]))
    force = np.interp(clock, run.time, run.force, left=0.0)
    rise = 1e-5
    measured = np.interp(HUMPS, clock, filter_of(f"first-order:{rise}")(clock, force))
    measured += 0.005 * measured.max() * np.random.default_rng(0).normal(size=len(HUMPS))
    free = ["k", "mass", "velocity"]
    fit = fecm.identify(started(), HUMPS, measured, free)
    assert not fit.accepted
    (named,) = [note for note in fit.notes if "seems to be filtered" in note]
    text = named.partition("--filter ")[2].partition(" ")[0]
    assert float(text.partition(":")[2]) == pytest.approx(rise, rel=0.1)
    right = fecm.identify(started(), HUMPS, measured, free, filter=f"first-order:{rise}")
    assert right.accepted
    assert not any("filter" in note for note in right.notes)
    assert abs(right.values["k"] / TRUE["k"] - 1.0) < 0.5 * abs(fit.values["k"] / TRUE["k"] - 1.0)


def test_runs_of_equal_signs_are_counted_in_standard_deviations() -> None:
    # Ten signs of each kind have 11 runs on average, with the variance 90/19.
    alternating = np.array([1.0, -1.0] * 10)
    assert sign_runs(alternating) == pytest.approx(9.0 / np.sqrt(90.0 / 19.0))
    assert sign_runs(np.sort(alternating)) == pytest.approx(-9.0 / np.sqrt(90.0 / 19.0))
    assert sign_runs(np.ones(20)) == 0.0


def test_a_fit_to_a_clipped_record_is_accepted_with_doubts_at_most() -> None:
    force = humps()
    for limit in (np.inf, 0.7 * force.max()):
        with pytest.warns(fecm.FecmWarning) if np.isfinite(limit) else nullcontext():
            fit = fecm.identify(started(), HUMPS, np.minimum(force, limit), ["velocity"])
        assert any("is clipped" in doubt for doubt in fit.doubts) == np.isfinite(limit)
        assert np.isfinite(limit) <= (fit.verdict != "yes")
