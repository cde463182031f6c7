"""fecm sweep --find velocity: velocities at which the peak force reaches a value."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fecm
from fecm.results.metrics import FOUND
from fecm.sweeps.search import lowest_velocities
from tests.calls import assert_unusable, call
from tests.decks import DATA_CARDS, PROGRAM, small

FIND = ("--find", "velocity", "--until")
PLATE = DATA_CARDS.replace("EXPE", "DELA\n.2,\nEXPE")


def deck(steps: int, data: str = PLATE) -> str:
    """A small plate, which the projectile has left after 400 steps."""
    return small(PROGRAM.replace(" 10\n", f"{steps:3}\n"), data=data)


def test_the_peak_of_a_power_law_is_found_to_1e_6() -> None:
    factors, rounds = (0.5, 3.0, 1e4, 1e-9), 0

    def peaks(pairs: list[tuple[int, float]]) -> Any:
        nonlocal rounds
        rounds += 1
        return np.array([factors[n] * v**1.2 for n, v in pairs])

    *actual, low, high = lowest_velocities(
        dict.fromkeys(range(4), 2.0), dict.fromkeys(range(4), 7.0), peaks
    ).values()
    for n, velocity in enumerate(actual):
        assert velocity == pytest.approx((7.0 / factors[n]) ** (1.0 / 1.2), rel=1e-6)
    assert low == "the peak force is above 7 from velocity 0.02 on"
    assert high == "the peak force is below 7 up to velocity 200"
    assert rounds <= 4


def test_a_run_at_the_found_velocity_has_the_threshold_as_its_peak(tmp_path: Path) -> None:
    (tmp_path / "d.inp").write_text(deck(400))
    done = call("sweep", "d.inp", *FIND, "peak_force=threshold", "-o", "s.h5", cwd=tmp_path)
    assert "delamination      at the latest from these energies" in done.stdout
    assert done.exit_code == 0
    swept = fecm.load_sweep(tmp_path / "s.h5")
    (velocity,) = swept["found_velocity"]
    assert f"found             {velocity:.4g}, " in done.stdout
    result = fecm.run_one(deck(400).replace("   13    3     115.0", f"13,3,{velocity:.10g}"))
    assert result.force.max() == pytest.approx(result.threshold["force"], rel=1e-5)
    assert swept["peak_force"][0] == pytest.approx(result.force.max(), rel=1e-8)
    # The mass of the report's rod is 1.8096e-4.
    assert swept["found_energy"][0] == pytest.approx(0.5 * 1.8096e-4 * velocity**2, rel=1e-4)


def test_the_command_that_a_summary_names_finds_the_energy_of_the_threshold(tmp_path: Path) -> None:
    (tmp_path / "d.inp").write_text(deck(400))
    printed = call("run", "d.inp", cwd=tmp_path).stdout
    (command,) = re.findall(r"fecm (sweep .*) finds the impact energy of the threshold", printed)
    done = call(*command.replace("DECK", "d.inp").split(), cwd=tmp_path)
    (velocity,) = fecm.sweep(deck(400), until="threshold")["found_velocity"]
    assert f"found             {velocity:.4g}, " in done.stdout
    (tmp_path / "slow.inp").write_text(deck(400).replace("115.0", " 90.0"))
    assert "finds the impact energy" not in call("run", "slow.inp", cwd=tmp_path).stdout


def test_a_case_among_others_equals_a_search_of_its_own() -> None:
    vary: dict[str, list[Any]] = {"layup": ["[0/90]", "[0/0]"], "k": [1e6, 3e6]}
    together = fecm.sweep(deck(400), vary, until="threshold")
    assert {*FOUND, "status", "validity"} <= together.summary.keys()
    by_name = {name: values[2] for name, values in together.cases.items()}
    alone = fecm.sweep(deck(400), cases=[by_name], until=float(together["threshold_force"][2]))
    velocity = together["found_velocity"][2]
    assert alone["found_velocity"][0] == pytest.approx(velocity, rel=2e-6)
    assert len(set(together["found_velocity"])) == 4


def test_decks_that_are_run_in_full_are_searched_too() -> None:
    force = "FORC\n    8    0       0.0       0.0      1E-9\n\n"
    plain, loaded = (fecm.sweep(deck(200, data + PLATE), until=100.0) for data in ("", force))
    assert loaded["found_velocity"][0] == pytest.approx(plain["found_velocity"][0], rel=1e-5)


def test_what_is_not_reached_is_a_failed_case_with_its_reason(tmp_path: Path) -> None:
    (tmp_path / "d.inp").write_text(deck(100))
    for force, words in (
        ("1e7", "the peak force is below 1e+07 up to velocity 11500"),
        ("0.5", "the peak force is above 0.5 from velocity 1.15 on"),
    ):
        options = (*FIND, f"peak_force={force}", "-o", "s.h5", "--overwrite")
        done = call("sweep", "d.inp", *options, cwd=tmp_path)
        assert (done.exit_code, words in done.stdout) == (1, True), done.stdout
        swept = fecm.load_sweep(tmp_path / "s.h5")
        assert np.isnan(swept["found_velocity"][0])
        assert np.isnan(swept["peak_force"][0])


def test_a_search_that_makes_no_sense_is_refused(tmp_path: Path) -> None:
    (tmp_path / "d.inp").write_text(deck(10, DATA_CARDS))
    for options, words in (
        ((*FIND, "peak_force=threshold"), "the threshold needs a DELA segment"),
        ((*FIND, "peak_force=-3"), "a positive number, not -3"),
        ((*FIND, "peak_force=3", "--vary", "velocity=1,2"), "velocity is searched"),
        ((*FIND, "force=3"), "write peak_force=NUMBER or peak_force=threshold"),
        (("--find", "velocity", "--vary", "k=1e6"), "belong together"),
        ((*FIND, "peak_force=3", "--full", "0"), "--vary velocity=FOUND"),
    ):
        done = call("sweep", "d.inp", *options, cwd=tmp_path)
        assert_unusable(done)
        assert words in done.stderr
