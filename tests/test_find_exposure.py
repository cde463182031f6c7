"""fecm sweep --until exposure=VALUE: velocities at which the largest exposure reaches a value."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import fecm
from fecm.authoring.case import CasesError
from fecm.deck.units import quantity
from fecm.judge.exposures import band_of_largest
from fecm.results.exposures import largest_exposures
from fecm.results.metrics import EXPOSURES
from fecm.sweeps.search import LEVEL_EXCESS, velocity_at_level
from tests.calls import assert_unusable, call
from tests.decks import DATA_CARDS, small
from tests.test_first_failure import failing, run

# The projectile has left the plate.
DECK = failing(every=4, steps=400)


def resolved() -> fecm.Deck:
    """A plate whose mesh bounds the exposures, unlike the four elements of DECK."""
    return fecm.impact(
        fecm.Plate.rectangle((40, 40), (8, 8), support="simple"),
        fecm.Laminate("[0/90]2s", "IM7/8552", 0.25),
        fecm.RigidMass(1e-5),
        fecm.Contact.estimate(radius=6),
        velocity=3000,
        duration=4e-4,
        units="mm-N-s",
        damage=True,
        plies=False,
        kinematics="linear",
    )


@pytest.mark.parametrize(("factor", "power"), [(0.5, 1.2), (3.0, 0.9), (0.1, 1.0)])
def test_the_velocity_of_a_power_law_is_found_in_a_few_runs(factor: float, power: float) -> None:
    trials: list[float] = []

    def exposure(velocity: float) -> float:
        trials.append(velocity)
        return float(factor * velocity**power)

    velocity = velocity_at_level(2.0, 1.5, exposure)
    assert 1.5 <= factor * velocity**power <= 1.5 * (1.0 + LEVEL_EXCESS)
    assert len(trials) <= 4


def test_a_bent_law_is_found_too_and_a_jump_is_told() -> None:
    trials = 0

    def bent(velocity: float) -> float:
        nonlocal trials
        trials += 1
        return float(max(0.1 * velocity, 0.01 * velocity**2.5))

    assert bent(velocity_at_level(1.0, 7.0, bent)) == pytest.approx(7.0, rel=LEVEL_EXCESS)
    assert trials <= 12
    with pytest.raises(CasesError, match="no exposure of 1: it jumps at velocity 3"):
        velocity_at_level(2.0, 1.0, lambda velocity: 0.5 if velocity < 3.0 else 2.0)


@pytest.mark.parametrize(
    ("law", "words"),
    [
        (lambda _: 0.5, "the exposure is below 1 up to velocity 200"),
        (lambda _: 2.0, "the exposure is above 1 from velocity 0.02 on"),
        (lambda _: 0.0, "there is no exposure at velocity 2"),
    ],
)  # fmt: skip
def test_what_is_not_reached_is_told(law: object, words: str) -> None:
    with pytest.raises(CasesError, match=words):
        velocity_at_level(2.0, 1.0, law)  # type: ignore[arg-type]


def test_a_run_at_the_found_velocity_has_this_exposure(tmp_path: Path) -> None:
    (tmp_path / "d.inp").write_text(DECK)
    options = ("--find", "velocity", "--until", "exposure=1", "-o", "s.h5")
    done = call("sweep", "d.inp", *options, cwd=tmp_path)
    assert done.exit_code == 0, done.stdout + done.stderr
    swept = fecm.load_sweep(tmp_path / "s.h5")
    command = " ".join(("fecm sweep DECK", *options[:4], "finds the impact energy of the first"))
    assert command in call("run", "d.inp", cwd=tmp_path).stdout
    (velocity,) = swept["found_velocity"]
    assert f"found             {velocity:.4g}, " in done.stdout
    low, high = (swept[name][0] for name in ("found_energy_low", "found_energy_high"))
    assert (low, high) == (0.0, np.inf)  # four elements
    assert "; finer meshes not bounded" in done.stdout
    result = run(DECK.replace("     115.0", f"{velocity:10.6f}"))
    largest = result["exposures/exposure"][-1]
    assert largest.max() == pytest.approx(1.0, rel=2e-5)
    assert "exposure > 1" not in swept["validity"][0]
    columns = [swept[name][0] for name in EXPOSURES]
    assert columns == pytest.approx(largest.tolist(), rel=1e-5)
    assert swept["fail_evaluations"][0] == result.failure.attributes["evaluations_in_contact"]
    # The mass of the report's rod is 1.8096e-4.
    assert swept["found_energy"][0] == pytest.approx(0.5 * 1.8096e-4 * velocity**2, rel=1e-4)


@pytest.mark.long
def test_at_the_ends_of_the_energies_the_band_of_the_exposure_ends_at_the_level() -> None:
    deck = resolved()
    swept = fecm.sweep(deck, until={"exposure": 1.0})
    low, energy, high = (
        swept[name][0] for name in ("found_energy_low", "found_energy", "found_energy_high")
    )
    assert low < energy < high
    for end, of_band in ((low, 1), (high, 0)):
        velocity = swept["found_velocity"][0] * np.sqrt(end / energy)
        result = fecm.run_one(deck.with_(velocity=velocity))
        assert band_of_largest(largest_exposures(result))[of_band] == pytest.approx(1.0, rel=0.01)
    exposures = fecm.sweep(deck, {"velocity": [3000.0]}, measure=["failure"])
    band = band_of_largest(largest_exposures(fecm.run_one(deck)))
    assert (exposures["exposure_low"][0], exposures["exposure_high"][0]) == pytest.approx(band)


@pytest.mark.parametrize(
    ("deck", "noted"),
    [
        pytest.param(lambda: DECK, True, id="four elements"),
        pytest.param(lambda: resolved().to_text(), False, id="resolved", marks=pytest.mark.long),
    ],
)
def test_a_note_says_where_the_mesh_decides_the_energy(
    deck: Callable[[], str], noted: bool, tmp_path: Path
) -> None:
    (tmp_path / "d.inp").write_text(deck())
    options = ("--find", "velocity", "--until", "exposure=1", "-o", "s.h5")
    done = call("sweep", "d.inp", *options, cwd=tmp_path)
    assert ("the mesh decides the energy in 1 of 1 cases" in done.stderr) is noted
    sweep = fecm.load_sweep(tmp_path / "s.h5")
    low, energy, high = (
        sweep[name][0] for name in ("found_energy_low", "found_energy", "found_energy_high")
    )
    assert (low < 0.75 * energy) == noted
    assert ("; finer meshes not bounded" in done.stdout) is noted
    unit = sweep.unit("found_energy")
    text = f"; finer meshes {quantity(low, unit, 3)} to {quantity(high, unit, 3)}"
    assert (text in done.stdout) is not noted


def test_the_note_counts_the_cases_whose_energy_the_mesh_decides() -> None:
    sweep = fecm.sweep(small(), {"velocity": [50.0, 80.0, 110.0]})

    def notes(*low: float) -> str:
        energies = {"found_energy": np.ones(3), "found_energy_low": np.array(low)}
        swept = fecm.SweepResult(sweep.cases, sweep.summary | energies, sweep.dt, sweep.steps)
        return "\n".join(swept.notes)

    assert "the mesh decides the energy in 1 of 3 cases" in notes(0.74, 0.76, 1.0)
    assert "the mesh decides the energy" not in notes(0.76, 1.0, 1.0)


@pytest.mark.long
def test_each_case_of_a_sweep_has_its_velocity() -> None:
    together = fecm.sweep(DECK, {"layup": ["[0/90]", "[0/0]"]}, until={"exposure": 0.5})
    alone = fecm.sweep(DECK, {"layup": ["[0/0]"]}, until={"exposure": 0.5})
    velocities = together["found_velocity"]
    assert velocities[1] == alone["found_velocity"][0]
    assert velocities[0] != pytest.approx(velocities[1], rel=0.05)
    for row in range(2):
        exposures = [together[name][row] for name in EXPOSURES]
        assert np.max(exposures) == pytest.approx(0.5, rel=2e-5)


@pytest.mark.long
def test_a_run_that_leaves_the_exposure_open_is_repeated_longer() -> None:
    short = fecm.sweep(failing(steps=40), until={"exposure": 1.0})
    (steps,) = short.steps
    assert steps in (80, 160, 320)
    longer = fecm.sweep(failing(steps=int(steps)), until={"exposure": 1.0})
    assert short["found_velocity"][0] == pytest.approx(
        longer["found_velocity"][0], rel=LEVEL_EXCESS
    )


def test_few_evaluations_and_short_runs_find_no_velocity() -> None:
    rare = fecm.sweep(failing(every=40, steps=400), until={"exposure": 1.0})
    assert "FAIL was evaluated" in rare["status"][0]
    short = fecm.sweep(failing(steps=8), until={"exposure": 1.0})
    assert "largest exposure is open even in a run 8 times as long" in short["status"][0]
    assert np.isnan(short["found_velocity"][0])


def test_a_search_that_makes_no_sense_is_refused(tmp_path: Path) -> None:
    (tmp_path / "d.inp").write_text(small(data=DATA_CARDS))
    (tmp_path / "f.inp").write_text(DECK)
    for deck, until, words in (
        ("d.inp", "exposure=1", "the program of the deck has no FAIL"),
        ("f.inp", "exposure=-1", "the exposure to reach is a positive number, not -1"),
        ("f.inp", "exposure=threshold", "write QUANTITY=NUMBER"),
        ("f.inp", "force=3", "peak_force=threshold, or exposure=NUMBER"),
    ):
        done = call("sweep", deck, "--find", "velocity", "--until", until, cwd=tmp_path)
        assert_unusable(done)
        assert words in done.stderr
    with pytest.raises(CasesError, match="until is"):
        fecm.sweep(DECK, until={"exposures": 1.0})
