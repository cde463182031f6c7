"""Impacts and pulses on plates that stretch as they bend.

The reference tables are those of von Karman plates in first-order shear deformation theory, of
independent programs in mm, N, s:

- nonlinear_impacts.csv: rectangular plates hit by 1 kg, Hertz's pressure on a circle of 8 mm;
  Legendre-Ritz, explicit in time.  Rows with the changes from 12 to 16 functions in a direction are
  within 2e-4, the others within 1e-3.  nonlinear_histories.csv: every 15th row of three of them;
- nonlinear_impacts_circular.csv: circular plates hit by 1 kg, uniform pressure on a circle of 5 mm;
  spectral elements in the radius, the largest force within 2e-3;
- nonlinear_pulses.csv: free vibration after a pulse of pressure of 20 us; spectral, within 1e-6.
  nonlinear_pulse_history.csv: every 10th row of one of them;
- nonlinear_d7136.csv: drop-weight tests by a prototype of the same elements in another program,
  which shows agreement of two programs and nothing more.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.special import ellipk

import fecm
from fecm import Result
from fecm.authoring.mesh import InPlane
from fecm.verification.decks import run_of_deck
from tests.builders import Floats, table
from tests.nonlinear_impacts import (
    pulsed_square,
    struck_disc,
    struck_rectangle,
    with_rows,
    without_nonlinearity,
)

Row = dict[str, str]
# Beyond the end of the contact.
LONGER = 1.02


def worst_balance(result: Result) -> float:
    """Largest error of the energy balance, relative to the initial energy."""
    energy = result.energy
    return float(np.abs(energy.balance_error).max() / energy.attributes["initial"])


def contact_end(result: Result) -> float:
    """Time at which the force was last above zero."""
    return float(result.time[result.force > 0.0][-1])


def struck(row: Row, n: int) -> Result:
    """The impact of a row of the table of rectangular plates."""
    velocity, end = float(row["velocity_mm_per_s"]), LONGER * float(row["contact_end_s"])
    return run_of_deck(struck_rectangle(row["case"], n, velocity, end))


def rows(name: str, key: str, quick: set[tuple[str, str]]) -> list[object]:
    """Rows of a table of impacts; those whose key and target are not quick are marked long."""
    return [
        pytest.param(
            row,
            id=f"{row[key]} {row['target_w_over_h']} h",
            marks=() if (row[key], row["target_w_over_h"]) in quick else pytest.mark.long,
        )
        for row in table(name)
    ]


# The linear limit ---------------------------------------------------------------------------------


def test_an_impact_of_a_ten_thousandth_of_the_velocity_is_that_of_the_linear_plate() -> None:
    built = struck_rectangle("iso_clamped_immovable", 8, 1e-4 * 2271.56, 4e-4)
    linear, actual = run_of_deck(without_nonlinearity(built)), run_of_deck(built)
    peak = linear.force.max()
    assert peak > 0.0
    assert np.abs(actual.force - linear.force).max() < 1e-6 * peak
    assert np.abs(actual.plate_w - linear.plate_w).max() < 1e-6 * linear.plate_w.max()
    assert not np.array_equal(actual.force, linear.force)


# Free vibration after a pulse ---------------------------------------------------------------------


def vibration(row: Row, n: int) -> tuple[CubicSpline, Floats, float]:
    """Deflection in the middle after a pulse, the first three times it vanishes, and its peak."""
    end = 1.01 * (float(row["zero1_s"]) + float(row["period_s_zero1_to_zero3"]))
    tape3 = run_of_deck(pulsed_square(n, float(row["p0_N_per_mm2"]), end)).tape3
    w = CubicSpline(tape3.time, tape3.w[:, 0])
    zeros = w.roots(extrapolate=False)[:3]
    turns = w.derivative().roots(extrapolate=False)
    return w, zeros, float(w(turns[turns < zeros[0]]).max())


PULSES = [
    pytest.param(
        row, id=row["p0_N_per_mm2"], marks=() if row["p0_N_per_mm2"] == "1" else pytest.mark.long
    )
    for row in table("nonlinear_pulses.csv")
]


@pytest.mark.parametrize("row", PULSES)
@pytest.mark.long
def test_the_period_and_first_peak_after_a_pulse_are_the_spectral_ones(row: Row) -> None:
    _, zeros, peak = vibration(row, 8)
    assert zeros[2] - zeros[0] == pytest.approx(float(row["period_s_zero1_to_zero3"]), rel=1e-4)
    assert zeros[:2] == pytest.approx([float(row["zero1_s"]), float(row["zero2_s"])], rel=1e-4)
    assert peak == pytest.approx(float(row["first_peak_over_h"]), rel=1e-4)


@pytest.mark.long
def test_the_motion_after_a_pulse_is_the_spectral_one_at_every_time() -> None:
    (row,) = [row for row in table("nonlinear_pulses.csv") if row["p0_N_per_mm2"] == "0.6"]
    w, _, peak = vibration(row, 8)
    history = table("nonlinear_pulse_history.csv")
    t, wanted = (np.array([float(r[k]) for r in history]) for k in ("t_s", "w_centre_mm"))
    kept = (t > w.x[0]) & (t < w.x[-1])
    assert kept.sum() > 30
    assert np.abs(w(t[kept]) - wanted[kept]).max() < 1e-4 * peak


def test_a_plate_at_a_quarter_of_its_thickness_vibrates_as_chu_and_herrmanns_oscillator() -> None:
    (row,) = [row for row in table("nonlinear_pulses.csv") if row["p0_N_per_mm2"] == "0.1"]
    _, zeros, amplitude = vibration(row, 4)
    # x'' + x + beta x^3 = 0 for a square plate whose edges hold the displacement across them; the
    # frequency of the linear plate is Kirchhoff's.
    nu, E, rho, side, h = 0.3, 70e3, 2.7e-9, 100.0, 1.0
    beta = 0.75 * (2.0 * (3.0 - nu**2) + 4.0 * nu) / 4.0 * amplitude**2
    linear = 2.0 * np.pi**2 / side**2 * np.sqrt(E * h**2 / 12.0 / (1.0 - nu**2) / rho)
    duffing = np.pi * np.sqrt(1.0 + beta) / 2.0 / ellipk(beta / 2.0 / (1.0 + beta))
    ratio = 2.0 * np.pi / (zeros[2] - zeros[0]) / linear
    assert amplitude == pytest.approx(0.24, rel=0.01)
    assert duffing - 1.0 > 0.027
    assert ratio == pytest.approx(duffing, rel=5e-4)


# Impacts ------------------------------------------------------------------------------------------

QUICK = {("iso_clamped_immovable", "3.0"), ("cross_ss_immovable", "2.0")}


@pytest.mark.parametrize("row", rows("nonlinear_impacts.csv", "case", QUICK))
@pytest.mark.few(1)  # of 2, 0.2 s each
def test_impacts_on_a_coarse_mesh_follow_the_spectral_solution(row: Row) -> None:
    struck_plate = struck(row, 16)
    # The force rings with modes that this mesh does not resolve, and the linear plate's as much.
    assert struck_plate.force.max() == pytest.approx(float(row["peak_N"]), rel=1.1e-2)
    assert struck_plate.plate_w.max() == pytest.approx(float(row["W_max_mm"]), rel=1e-3)
    assert contact_end(struck_plate) == pytest.approx(float(row["contact_end_s"]), rel=3e-3)
    assert worst_balance(struck_plate) < 2e-6


@pytest.mark.long
@pytest.mark.parametrize("row", rows("nonlinear_impacts.csv", "case", set()))
def test_impacts_on_a_fine_mesh_follow_the_spectral_solution(row: Row) -> None:
    struck_plate = struck(row, 32)
    assert struck_plate.force.max() == pytest.approx(float(row["peak_N"]), rel=2e-3)
    # Rows of fewer functions are themselves within 1e-3 only.
    within = 2e-4 if row["W_change_12_16"] else 1e-3
    assert struck_plate.plate_w.max() == pytest.approx(float(row["W_max_mm"]), rel=within)
    assert contact_end(struck_plate) == pytest.approx(float(row["contact_end_s"]), rel=3e-3)
    assert worst_balance(struck_plate) < 1e-6


@pytest.mark.long
@pytest.mark.parametrize("case", ["cross_ss_immovable", "iso_clamped_immovable", "iso_ss_movable"])
def test_force_and_deflection_follow_the_spectral_solution_at_every_time(case: str) -> None:
    history = [row for row in table("nonlinear_histories.csv") if row["case"] == case]
    target = history[0]["target_w_over_h"]
    (row,) = [
        row
        for row in table("nonlinear_impacts.csv")
        if (row["case"], row["target_w_over_h"]) == (case, target)
    ]
    struck_plate = struck(row, 32)
    t, force, w = (np.array([float(r[k]) for r in history]) for k in ("t_s", "F_N", "W_mm"))
    kept = t < struck_plate.time[-1]
    assert kept.sum() > 90
    off = np.interp(t, struck_plate.time, struck_plate.plate_w) - w
    assert np.abs(off[kept]).max() < 4e-4 * w.max()
    off = np.interp(t, struck_plate.time, struck_plate.force) - force
    assert np.sqrt((off[kept] ** 2).mean()) < 4e-3 * force.max()


CIRCULAR = [
    pytest.param(row, id=f"{row['edge']} {row['target_w_over_h']} h")
    for row in table("nonlinear_impacts_circular.csv")
    if row["target_w_over_h"] in ("1", "3")
]


@pytest.mark.long
@pytest.mark.parametrize("row", CIRCULAR)
def test_impacts_on_circular_plates_follow_the_axisymmetric_solution(row: Row) -> None:
    velocity, end = float(row["velocity_mm_per_s"]), LONGER * float(row["contact_end_s"])
    result = run_of_deck(struck_disc(row["edge"], 16, 12, velocity, end))
    assert result.force.max() == pytest.approx(float(row["peak_N"]), rel=1e-2)
    assert result.plate_w.max() == pytest.approx(float(row["W_max_mm"]), rel=2e-3)
    assert worst_balance(result) < 1e-6


def test_an_impact_on_a_coarse_disc_deflects_it_as_the_axisymmetric_solution() -> None:
    (row,) = [
        row
        for row in table("nonlinear_impacts_circular.csv")
        if (row["edge"], row["target_w_over_h"]) == ("clamped_immovable", "3")
    ]
    end = 1.3 * float(row["t_peak_s"])
    result = run_of_deck(struck_disc(row["edge"], 8, 4, float(row["velocity_mm_per_s"]), end))
    assert result.plate_w.max() == pytest.approx(float(row["W_max_mm"]), rel=1e-3)
    assert result.force.max() == pytest.approx(float(row["peak_N"]), rel=0.02)


# Threads -----------------------------------------------------------------------------------------


@pytest.mark.long
def test_a_run_does_not_depend_on_the_number_of_threads(tmp_path: Path) -> None:
    # Half of the plate, which is what the kernels compute, has several parts for the threads.
    built = with_rows(struck_rectangle("iso_clamped_immovable", 56, 2271.56, 3e-6), 10)
    for threads in (1, 2):
        fecm.run_one(built, output=tmp_path / f"{threads}.h5", threads=threads)
    assert (tmp_path / "1.h5").read_bytes() == (tmp_path / "2.h5").read_bytes()


# The drop-weight test ----------------------------------------------------------------------------

WINDOWS: dict[str, InPlane] = {"w held, u v free": "free", "w u v held": "held"}
DROPS = [
    pytest.param(row, id=f"{row['laminate'][8:25]} {WINDOWS[row['window']]} {row['energy_mJ']} mJ")
    for row in table("nonlinear_d7136.csv")
    if row["window"] in WINDOWS
]


@pytest.mark.long
@pytest.mark.parametrize("row", DROPS)
def test_the_drop_weight_test_is_that_of_another_program_of_finite_elements(row: Row) -> None:
    thick = "3s" in row["laminate"]
    deck = fecm.impact(
        fecm.Plate.on_fixture("D7136"),
        fecm.Laminate(
            "[45/0/-45/90]3s" if thick else "[45/0/-45/90]2s", "IM7/8552", 0.184 if thick else 0.131
        ),
        energy=float(row["energy_mJ"]),
        units="mm-N-s",
        nonlinear=True,
        in_plane=WINDOWS[row["window"]],
        shear_factor=1.0,  # of the other program
    )
    result = run_of_deck(deck)
    assert result.force.max() == pytest.approx(float(row["nonlinear_peak_N"]), rel=2e-4)
    assert result.plate_w.max() == pytest.approx(float(row["nonlinear_W_mm"]), rel=1e-4)
    assert worst_balance(result) < 1e-7
