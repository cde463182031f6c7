"""Delamination thresholds and quick models against closed forms."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import fecm
from fecm.api import load_deck
from fecm.deck.records import Ply
from fecm.mechanics.laminate import SMALL_MASS, effective_rigidity, laminate, threshold_force
from fecm.results.result import Result
from fecm.studies.estimate import (
    contact_time,
    inelasticity,
    infinite_plate,
    static_plate,
    static_stiffness,
)
from fecm.verification.decks import result_of
from fecm.verification.plates import struck_square
from tests.builders import report_plate, table
from tests.calls import call
from tests.decks import small

THRESHOLDS = table("threshold_loads.csv")


@pytest.mark.parametrize(
    "row", THRESHOLDS, ids=lambda row: f"{row['case']} {row['n delaminations']}"
)
def test_threshold_loads_are_those_of_the_formulas(row: dict[str, str]) -> None:
    force = threshold_force(float(row["D*"]), float(row["GIIc"]), int(row["n delaminations"]))
    factor = SMALL_MASS if row["formula"].startswith("small mass") else 1.0
    assert factor * force == pytest.approx(float(row["F threshold"]), rel=1e-7)


def test_one_delamination_of_an_isotropic_plate_is_davies_and_robinsons() -> None:
    E, nu, h, G = 60e3, 0.3, 2.0, 0.8
    ply = Ply(1.0, nu, E, E, E / 2.6, E / 2.6, E / 2.6)
    rigidity = effective_rigidity(laminate(ply, [0.0], [h]))
    expected = math.sqrt(8.0 * math.pi**2 * E * h**3 * G / (9.0 * (1.0 - nu**2)))
    assert threshold_force(rigidity, G) == pytest.approx(expected, rel=1e-12)


def test_the_effective_rigidity_of_the_reports_plate_is_olssons() -> None:
    (row,) = (row for row in THRESHOLDS if row["case"].startswith("report"))
    assert effective_rigidity(report_plate()) == pytest.approx(float(row["D*"]), rel=1e-7)


def test_an_unsymmetric_laminate_is_softer_than_its_d() -> None:
    ply = Ply(1.0, 0.3, 20.0, 1.0, 0.5, 0.5, 0.5)
    unsymmetric, symmetric = (
        laminate(ply, a, [0.25] * 4) for a in ((0, 0, 90, 90), (0, 90, 90, 0))
    )
    assert effective_rigidity(unsymmetric) < 0.9 * effective_rigidity(symmetric)


@pytest.mark.parametrize("row", table("zener_olsson_small_mass.csv"), ids=lambda row: row["lambda"])
def test_the_infinite_plate_is_zeners(row: dict[str, str]) -> None:
    mass, velocity, k = 0.3, 2.0, 5e5
    scale = (mass / (k * velocity**0.5)) ** 0.4
    found = infinite_plate(mass, velocity, k, float(row["lambda"]))
    peak = float(row["F_max/(M V/T) = F_max/(k^.4 V^1.2 M^.6)"]) * mass * velocity / scale
    assert found.peak == pytest.approx(peak, rel=1e-7)
    assert found.time == pytest.approx(float(row["t_peak/T"]) * scale, rel=1e-7)
    assert found.duration == pytest.approx(float(row["t_contact/T"]) * scale, rel=1e-7)


@pytest.mark.parametrize("row", table("large_mass_energy_balance.csv"), ids=lambda row: row["M"])
def test_a_large_mass_is_stopped_by_bending_and_indentation(row: dict[str, str]) -> None:
    mass, velocity, stiffness, k = (float(row[n]) for n in ("M", "V", "kb", "k contact"))
    found = static_plate(mass, velocity, k, stiffness)
    assert found.peak == pytest.approx(float(row["F max (energy balance)"]), rel=1e-7)
    assert found.duration == pytest.approx(float(row["duration by SDOF pi sqrt(M/keff)"]), rel=1e-5)


def test_the_contact_lasts_as_the_mass_moves_on_plate_and_indentation_in_series() -> None:
    mass, velocity, k, stiffness = 2.0, 3.0, 50.0, 40.0

    def rate(_: float, state: list[float]) -> list[float]:
        # x = F/k_b + (F/k)^(2/3), solved for F.
        force = brentq(
            lambda f: f / stiffness + (f / k) ** (2.0 / 3.0) - max(state[0], 0.0), 0.0, 1e3
        )
        return [state[1], -force / mass]

    def leaves(_: float, state: list[float]) -> float:
        return state[0]

    leaves.terminal, leaves.direction = True, -1.0  # type: ignore[attr-defined]
    moved = solve_ivp(rate, (0.0, 9.0), [0.0, velocity], events=leaves, rtol=1e-8, atol=1e-10)
    found = contact_time(mass, velocity, k, stiffness)
    assert found == pytest.approx(moved.t_events[0][0], rel=1e-5)
    rigid = contact_time(mass, velocity, 1e12, stiffness)
    assert rigid == pytest.approx(math.pi * math.sqrt(mass / stiffness), rel=1e-5)


def test_zeners_parameter_classifies_the_reference_plates() -> None:
    # Steel plate of response_classes.csv: a = b = 0.8, h = 0.0508..: its own numbers give lambda.
    rows = table("response_classes.csv")
    ratio = float(rows[5]["lambda"]) / float(rows[2]["lambda"])
    masses = float(rows[5]["M kg"]) / float(rows[2]["M kg"])
    assert inelasticity(masses, 1.0, 1.0, 1.0, 1.0) / inelasticity(
        1.0, 1.0, 1.0, 1.0, 1.0
    ) == pytest.approx(ratio, rel=1e-4)


@pytest.mark.parametrize(
    "row",
    [r for r in table("plate_stiffness.csv") if r["source"].endswith(("computed", "37"))][::3],
    ids=lambda row: f"{row['plate']} {row['value']}",
)
def test_the_static_stiffness_of_thin_plates_is_timoshenkos(row: dict[str, str]) -> None:
    ratio = row["plate"].partition("b/a=")[2].partition(" ")[0] or "1"
    support = "clamped" if "clamped" in row["plate"] else "simple"
    made = call(
        "new", "-", "--size", f"1x{ratio}", "--mesh", "8x10", "--grading", "3", "--dt", "1e-3",
        "--layup", "[0]", "--ply-thickness", ".005", "--ply", "1,.3,1,1,.384615,.384615,.384615",
        "--support", support, "--patch", "disc:.015", "--projectile", "mass:1",
        "--velocity", "1e-6", "--law", "1,0,0,1.5", "--duration", "1e-3",
    )  # fmt: skip
    (problem,) = load_deck(made.stdout).problems
    assert problem.contact is not None
    rigidity = 0.005**3 / (12.0 * (1.0 - 0.3**2))
    compliance = rigidity / static_stiffness(problem.moving_plate, problem.contact)
    assert compliance == pytest.approx(float(row["value"]), rel=5e-3)


@pytest.mark.long
@pytest.mark.parametrize("row", table("response_classes.csv"), ids=lambda row: row["M/Mp"])
def test_peaks_of_all_response_classes_are_those_of_the_series(row: dict[str, str]) -> None:
    # The file's times are twice those of its peaks.
    deck = struck_square(float(row["M kg"]), 0.55 * float(row["time"]))
    peak = result_of(deck).force.max()
    assert peak == pytest.approx(float(row["peak exact series N"]), rel=0.02)


# In a run ----------------------------------------------------------------------------------------


def with_threshold(card: str) -> str:
    return small().replace("EXPE", f"PATC\nDISC,.2\nDELA\n{card}\nEXPE")


def test_a_run_stores_the_threshold_and_its_first_crossing(tmp_path: Path) -> None:
    plain = run_one(small().replace("EXPE", "PATC\nDISC,.2\nEXPE"))
    found = run_one(with_threshold("1.0E-3,"))
    np.testing.assert_array_equal(found.force, plain.force)
    values = found.threshold
    above = found.time[found.force >= values["force"]]
    assert 0 < len(above) < len(found.time)
    assert values["time"] == above[0]
    assert values["margin"] == pytest.approx(1.0 - found.force.max() / values["force"], rel=1e-12)
    assert values["force"] == pytest.approx(threshold_force(values["d_star"], 1.0e-3), rel=1e-12)
    (tmp_path / "d.inp").write_text(with_threshold("5.,"))
    done = call("run", "d.inp", cwd=tmp_path)
    assert "not reached: the peak is" in done.stdout
    stored = fecm.load(tmp_path / "d.h5")
    assert math.isnan(stored.threshold["time"])
    assert 0.0 < stored.threshold["margin"] < 1.0


@pytest.mark.parametrize("card", ["0.,", "-1.,", "1.,0.5", "1.,2.5", "1.,-1."])
def test_toughness_and_number_of_delaminations_are_checked(card: str) -> None:
    assert "E457" in [finding.code for finding in load_deck(with_threshold(card)).errors()]


def test_more_delaminations_lower_the_threshold() -> None:
    one, seven = (load_deck(with_threshold(f"2.,{n}")).problems[0].threshold for n in ("", "7."))
    assert one is not None
    assert seven is not None
    assert seven.force / one.force == pytest.approx(math.sqrt(3.0 / 9.0), rel=1e-12)
    assert "W458" in [finding.code for finding in load_deck(with_threshold("2.,")).findings]


def run_one(text: str) -> Result:
    found = fecm.run(text)
    assert isinstance(found, Result)
    return found
