"""The report's decks against the original program's own output."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import fecm
from fecm import Result
from fecm.deck.grid import ElementGrid, GridSection
from fecm.deck.model import Indentation, Material
from fecm.listing.tapes import tape_texts
from fecm.mechanics.impact import ImpactSystem
from fecm.mechanics.plate_motion import PlateMotion
from fecm.simulation.saved import restore, saved_values
from fecm.verification.decks import run_of_deck, struck_plate
from tests.decks import APPENDIX, DATA, LONG, ready

Floats = NDArray[np.float64]

COLUMNS = (
    "time", "force", "indentation", "transducer", "displacement", "velocity", "acceleration",
    "plate_w",
)  # fmt: skip
DECKS = {"appendix": (APPENDIX, slice(None)), "long": (LONG, slice(9, None, 10))}


@pytest.fixture(scope="module")
def results() -> dict[tuple[str, str], Result]:
    """Both decks in both modes."""
    built: dict[tuple[str, str], Result] = {}
    for name, (deck, _) in DECKS.items():
        for mode in ("report", "listing"):
            result = fecm.run_one(deck, mode=mode)
            built[name, mode] = result
    return built


def reference(name: str) -> dict[str, Floats]:
    """Columns of a history of the original program."""
    with (DATA / f"{name}-history.csv").open() as file:
        rows = list(csv.DictReader(file))
    return {column: np.array([float(row[column]) for row in rows]) for column in COLUMNS}


@pytest.mark.parametrize("deck", DECKS)
@pytest.mark.parametrize("mode", ["report", "listing"])
def test_every_column_of_the_history_is_the_original_programs(
    results: dict[tuple[str, str], Result], deck: str, mode: str
) -> None:
    expected = reference(f"{deck}-{mode}")
    for column in COLUMNS:
        got = results[deck, mode][f"history/{column}"][DECKS[deck][1]]
        assert got.shape == expected[column].shape
        worst = np.abs(got - expected[column]).max()
        assert worst <= 1e-6 * np.abs(expected[column]).max(), column


@pytest.mark.parametrize("mode", ["report", "listing"])
def test_tapes_are_the_original_programs_line_for_line(
    results: dict[tuple[str, str], Result], mode: str
) -> None:
    texts = tape_texts(results["appendix", mode])
    assert list(texts) == ["tape3", "tape8", "tape9"]
    for name, lines in texts.items():
        expected = (DATA / f"appendix-{mode}-{name}.txt").read_text().splitlines()
        got = list(lines)
        assert len(got) == len(expected)
        numbered = "strain" if len(expected[0]) == 72 and expected[0][5] == "1" else "plain"
        lead = 12 if numbered == "strain" else 0
        assert [line[:lead] for line in got] == [line[:lead] for line in expected]
        assert_same_to_the_last_digit(
            [fields(line[lead:]) for line in got], [fields(line[lead:]) for line in expected]
        )


def fields(line: str) -> list[str]:
    """Columns of twelve characters."""
    return [line[i : i + 12] for i in range(0, len(line), 12)]


def assert_same_to_the_last_digit(got: list[list[str]], expected: list[list[str]]) -> None:
    """Every number equal up to one unit in its last printed digit.

    Numbers below 1e-6 of their column's maximum are rounding of the original's zeros.
    """
    columns = max(map(len, expected))
    largest = [max(abs(float(r[c])) for r in expected if c < len(r)) for c in range(columns)]
    for mine, theirs in zip(got, expected, strict=True):
        assert [len(text) for text in mine] == [len(text) for text in theirs]
        for c, (a, b) in enumerate(zip(mine, theirs, strict=True)):
            if abs(float(b)) < 1e-6 * largest[c]:
                assert abs(float(a)) < 2e-6 * largest[c]
            elif a != b:
                assert a[-4:] == b[-4:]
                assert abs(round(float(a[:-4]) * 1e4) - round(float(b[:-4]) * 1e4)) <= 1


def test_energy_balances_within_1e_4_at_every_step_of_the_long_run(
    results: dict[tuple[str, str], Result],
) -> None:
    energy = results["long", "report"].energy
    initial = energy.attributes["initial"]
    # 1/2 m v^2 of the report's projectile, page 81: 0.000181 lb s^2/in at 115 in/s.
    assert initial == pytest.approx(0.5 * 0.000181 * 115.0**2, rel=5e-3)
    held = (
        energy.plate_kinetic
        + energy.plate_strain
        + energy.projectile_kinetic
        + energy.projectile_strain
        + energy.contact_work
    )
    assert np.abs(held - initial).max() < 1e-4 * initial
    np.testing.assert_allclose(energy.balance_error, held - initial, atol=1e-12 * initial)


def test_the_contacts_and_peaks_of_the_long_run_are_the_reports(
    results: dict[tuple[str, str], Result],
) -> None:
    result = results["long", "report"]
    first, later = result.time < 5e-4, result.time > 5e-4
    assert result.force[first].max() == pytest.approx(78.7, abs=0.05)
    assert result.time[first][result.force[first].argmax()] == pytest.approx(42.6e-6, abs=0.2e-6)
    assert result.force[later].max() == pytest.approx(86.2, abs=0.05)
    touching = result.time[result.force > 0]
    assert touching[touching < 5e-4].max() == pytest.approx(439e-6, abs=1e-6)
    assert touching[touching > 5e-4].min() == pytest.approx(568e-6, abs=1e-6)
    assert touching.max() == pytest.approx(766e-6, abs=1e-6)
    listing = results["long", "listing"]
    assert listing.force.max() == pytest.approx(395.0, abs=0.5)
    assert listing.time[listing.force > 0].max() == pytest.approx(91e-6, abs=0.5e-6)


def test_the_rod_rings_between_the_contacts_faster_than_a_wave_goes_there_and_back(
    results: dict[tuple[str, str], Result],
) -> None:
    result = results["long", "report"]
    free = (result.time > 445e-6) & (result.time < 563e-6)
    time, ringing = result.time[free], result.transducer[free]
    periods = np.linspace(4e-6, 12e-6, 1601)
    turns = np.exp(-2j * np.pi * time / periods[:, None])
    period = periods[np.abs(turns @ (ringing - ringing.mean())).argmax()]
    assert period == pytest.approx(8.35e-6, abs=0.02e-6)
    through = 1.0 / np.sqrt(30.0e6 / 0.0006875)  # 1 in of steel
    assert through == pytest.approx(4.79e-6, abs=0.01e-6)
    assert 1.7 * through < period < 0.9 * 2.0 * through


def test_the_reports_mesh_has_not_converged(results: dict[tuple[str, str], Result]) -> None:
    grid = ElementGrid(
        [GridSection(0.0, 1.5, 6), GridSection(1.5, 4.5, 16), GridSection(4.5, 6.0, 6)],
        [GridSection(0.0, 0.5, 2), GridSection(0.5, 3.5, 16), GridSection(3.5, 4.0, 2)],
    )
    deck = fecm.read_one(LONG)
    law = deck.require(Indentation)
    finer = struck_plate(grid, deck.require(Material), None, 115.0, law, 1e-7, 600)
    coarse = results["long", "report"]
    first = coarse.force[coarse.time < 60e-6].max()
    # 2.7 % of the first peak; with four times the elements a side it is 75.90 lb.
    assert first == pytest.approx(78.69, abs=0.005)
    assert run_of_deck(finer).force.max() == pytest.approx(76.60, abs=0.005)


def test_running_twice_gives_the_same_bytes(tmp_path: Path) -> None:
    first, second = tmp_path / "a.h5", tmp_path / "b.h5"
    fecm.run(APPENDIX, output=first)
    fecm.run(APPENDIX, output=second)
    assert first.read_bytes() == second.read_bytes()


def test_rows_of_the_tapes_are_the_historys_own(results: dict[tuple[str, str], Result]) -> None:
    result = results["appendix", "report"]
    assert result.tape9.step.tolist() == [5, 10]
    assert result.tape8.step.tolist() == [5, 10]
    assert result.tape3.step.tolist() == [5, 10]
    for name in ("time", "force", "indentation", "transducer", "acceleration"):
        np.testing.assert_array_equal(result[f"tape9/{name}"], result[f"history/{name}"][[4, 9]])
    np.testing.assert_array_equal(result.tape3.w[:, 304], result.plate_w[[4, 9]])
    np.testing.assert_array_equal(result.tape3.w, result.tape3.displacement[:, :, 2])
    assert result.tape8.attributes["location"] == "nodes"


def test_the_listing_stores_contact_at_every_step_and_strains_one_step_old(
    results: dict[tuple[str, str], Result],
) -> None:
    result = results["appendix", "listing"]
    assert len(result.tape9.force) == 10
    assert result.tape8.step.tolist() == [5, 10]
    np.testing.assert_allclose(result.tape8.time, [4 * 2e-7, 9 * 2e-7], rtol=1e-12)
    assert result.tape8.attributes["location"] == "gauss"


@pytest.mark.parametrize("solver", ["csr", "auto"])
def test_both_products_give_the_same_history(solver: str) -> None:
    built = impact_of(APPENDIX)
    motion = PlateMotion(built.motion.plate, solver)
    impact = ImpactSystem(motion, built.rod, built.law, built.contact)
    state = impact.start()
    for _ in range(10):
        impact.advance(state, 2e-7)
    assert state.contact.force == pytest.approx(reference("appendix-report")["force"][-1], rel=1e-8)


def test_a_stored_state_goes_on_as_if_nothing_had_happened() -> None:
    impact = impact_of(LONG)
    state = impact.start()
    for _ in range(300):  # past the first peak, so that the law has a memory
        impact.advance(state, 2e-7)
    stored = saved_values(state, "state")
    for _ in range(50):
        impact.advance(state, 2e-7)
    fresh = impact_of(LONG)
    again = fresh.start()
    restore(again, "state", stored)
    for _ in range(50):
        fresh.advance(again, 2e-7)
    for name, array in saved_values(state, "state").items():
        np.testing.assert_array_equal(saved_values(again, "state")[name], array)


@pytest.mark.parametrize("at_start", [None, (0.0, None)])
def test_the_tuples_of_a_laws_memory_are_tuples_again_after_json(at_start: Any) -> None:
    memory = (1.5, (2.5, None), "loaded")
    stored = json.loads(json.dumps(saved_values(memory, "memory")))
    assert restore(at_start, "memory", stored) == memory


def impact_of(deck: Path) -> ImpactSystem:
    """Plate and projectile of a deck."""
    impact = ready(deck).impact
    assert impact is not None
    return impact
