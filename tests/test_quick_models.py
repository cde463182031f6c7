"""Delamination thresholds and quick models against closed forms."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.special import beta, ellipk

import fecm
from fecm import Ply, Result
from fecm.mechanics import quick_models
from fecm.mechanics.laminate import (
    SMALL_MASS,
    LaminateSection,
    effective_rigidity,
    laminate,
    threshold_force,
)
from fecm.mechanics.quick_models import inelasticity, infinite_plate, static_plate
from fecm.mechanics.solutions import static_stiffness
from fecm.problem.contact_estimates import wave_impedance
from fecm.problem.loading import load_deck
from fecm.results.summary import run_summary
from fecm.verification.decks import run_of_deck
from fecm.verification.impacts import struck_square
from tests.builders import REPORT_ANGLES, report_plate, table
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


@pytest.mark.parametrize("row", [row for row in THRESHOLDS if row["D11"]], ids=lambda r: r["case"])
def test_the_effective_rigidity_is_near_olssons_for_orthotropic_laminates(
    row: dict[str, str],
) -> None:
    d11, d12, d22, d66 = (float(row[name]) for name in ("D11", "D12", "D22", "D66"))
    actual = effective_rigidity(with_stiffness([[d11, d12, 0.0], [d12, d22, 0.0], [0.0, 0.0, d66]]))
    assert actual == pytest.approx(float(row["D*"]), rel=0.01)
    assert actual >= float(row["D*"]) * (1.0 - 1e-7)  # an arithmetic-geometric mean's lower bound


def with_stiffness(D: Sequence[Sequence[float]]) -> LaminateSection:
    """A plate with this bending stiffness."""
    return replace(report_plate(), B=np.zeros((3, 3)), D=np.array(D))


@pytest.mark.parametrize("ratio", [1.0, 1.001, 15.0, 300.0, 1e6])
@pytest.mark.parametrize("shear", [1e-3, 0.3, 1.0, 30.0])
@pytest.mark.few(4)
def test_the_effective_rigidity_is_the_elliptic_integral_of_orthotropic_plates(
    ratio: float, shear: float
) -> None:
    twist = shear * math.sqrt(ratio)
    D = [[ratio, 0.1, 0.0], [0.1, 1.0, 0.0], [0.0, 0.0, twist]]
    # D(theta) = D22 (t^2 + a)(t^2 + b)/(1 + t^2)^2 with t = tan(theta), a and b maybe conjugate.
    a, b = np.roots([1.0, 2.0 * (0.1 + 2.0 * twist), ratio]) * -1.0
    middle, product = (np.sqrt(a) + np.sqrt(b)).real / 2.0, ratio**0.25
    m = 1.0 - (min(middle, product) / max(middle, product)) ** 2
    expected = (math.pi * max(middle, product) / (2.0 * ellipk(m))) ** 2
    assert effective_rigidity(with_stiffness(D)) == pytest.approx(expected, rel=1e-12)


ANGLES = {
    "[0]16": [0.0] * 16,
    "[0/90]4s": 4 * [0.0, 90.0] + 4 * [90.0, 0.0],
    "quasi-isotropic": 2 * [45.0, 0.0, -45.0, 90.0] + 2 * [90.0, -45.0, 0.0, 45.0],
    "unsymmetric": [0.0, 30.0, 30.0, 75.0, -20.0],
}


@pytest.mark.parametrize("turn", [22.5, 37.0, 45.0, 90.0, -71.0])
@pytest.mark.parametrize("layup", ANGLES)
@pytest.mark.few(4)
def test_the_effective_rigidity_does_not_depend_on_the_axes(layup: str, turn: float) -> None:
    ply, angles = Ply(1.0, 0.3, 141e3, 9.75e3, 5.2e3, 5.2e3, 3.2e3), ANGLES[layup]
    thick = [4.0 / len(angles)] * len(angles)
    turned = effective_rigidity(laminate(ply, [angle + turn for angle in angles], thick))
    assert turned == pytest.approx(effective_rigidity(laminate(ply, angles, thick)), rel=1e-12)


def test_wave_impedance_of_the_time_step_check_does_not_depend_on_the_axes() -> None:
    ply = Ply(1.0, 0.3, 141e3, 9.75e3, 5.2e3, 5.2e3, 3.2e3)
    along, across = (wave_impedance(laminate(ply, [angle], [4.0])) for angle in (0.0, 45.0))
    assert across == pytest.approx(along, rel=1e-12)


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
    closed_form = infinite_plate(mass, velocity, k, float(row["lambda"]))
    peak = float(row["F_max/(M V/T) = F_max/(k^.4 V^1.2 M^.6)"]) * mass * velocity / scale
    assert closed_form.peak == pytest.approx(peak, rel=1e-7)
    assert closed_form.time == pytest.approx(float(row["t_peak/T"]) * scale, rel=1e-7)
    assert closed_form.duration == pytest.approx(float(row["t_contact/T"]) * scale, rel=1e-7)


def test_without_damping_the_contact_is_that_of_hertz() -> None:
    mass, velocity, k = 0.3, 2.0, 5e5
    closed_form = infinite_plate(mass, velocity, k, 0.0)
    # M V^2/2 = 2/5 k a^2.5, and the duration 2 a/V times the integral of dx/sqrt(1 - x^2.5).
    depth = (1.25 * mass * velocity**2 / k) ** 0.4
    integral = 0.4 * beta(0.4, 0.5)
    assert closed_form.peak == pytest.approx(k * depth**1.5, rel=1e-12)
    assert closed_form.time == pytest.approx(integral * depth / velocity, rel=1e-12)
    assert closed_form.duration == pytest.approx(2.0 * closed_form.time, rel=1e-12)


def test_a_contact_without_an_end_in_sight_lasts_for_ever(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert infinite_plate(1.0, 1.0, 1.0, 0.5).duration == pytest.approx(3.6244414, rel=1e-7)
    monkeypatch.setattr(quick_models, "LONGEST", 3.0)
    assert infinite_plate(1.0, 1.0, 1.0, 0.5).duration == math.inf


@pytest.mark.parametrize("row", table("large_mass_energy_balance.csv"), ids=lambda row: row["M"])
def test_a_large_mass_is_stopped_by_bending_and_indentation(row: dict[str, str]) -> None:
    mass, velocity, stiffness, k = (float(row[n]) for n in ("M", "V", "kb", "k contact"))
    actual = static_plate(mass, velocity, k, stiffness)
    assert actual.peak == pytest.approx(float(row["F max (energy balance)"]), rel=1e-7)
    rigid = static_plate(mass, velocity, 1e9 * k, stiffness).duration
    assert rigid == pytest.approx(float(row["duration by SDOF pi sqrt(M/keff)"]), rel=1e-5)
    assert actual.duration > rigid


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
    duration = static_plate(mass, velocity, k, stiffness).duration
    assert duration == pytest.approx(moved.t_events[0][0], rel=1e-5)
    rigid = static_plate(mass, velocity, 1e12, stiffness).duration
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
@pytest.mark.few(1)  # of 2, 0.6 s each
def test_the_static_stiffness_of_thin_plates_is_timoshenkos(row: dict[str, str]) -> None:
    ratio = row["plate"].partition("b/a=")[2].partition(" ")[0] or "1"
    support = "clamped" if "clamped" in row["plate"] else "simple"
    answer = call(
        "new",
        "-",
        "--size",
        f"1x{ratio}",
        "--mesh",
        "16x20",
        "--grading",
        "8",
        "--dt",
        "1e-3",
        "--layup",
        "[0]",
        "--ply-thickness",
        ".005",
        "--ply",
        "1,.3,1,1,.384615,.384615,.384615",
        "--support",
        support,
        "--patch",
        "disc:.015",
        "--projectile",
        "mass:1",
        "--velocity",
        "1e-6",
        "--law",
        "1,0,0,1.5",
        "--duration",
        "1e-3",
    )
    (problem,) = load_deck(answer.stdout).problems
    assert problem.contact is not None
    rigidity = 0.005**3 / (12.0 * (1.0 - 0.3**2))
    compliance = rigidity / static_stiffness(problem.moving_plate, problem.contact)
    assert compliance == pytest.approx(float(row["value"]), rel=5e-3)


@pytest.mark.long
@pytest.mark.parametrize("row", table("response_classes.csv"), ids=lambda row: row["M/Mp"])
def test_peaks_of_all_response_classes_are_those_of_the_series(row: dict[str, str]) -> None:
    # The file's times are twice those of its peaks.
    deck = struck_square(float(row["M kg"]), 0.55 * float(row["time"]))
    peak = run_of_deck(deck).force.max()
    assert peak == pytest.approx(float(row["peak exact series N"]), rel=0.02)


# In a run ----------------------------------------------------------------------------------------


def with_threshold(card: str) -> str:
    return small().replace("EXPE", f"PATC\nDISC,.2\nDELA\n{card}\nEXPE")


def test_a_run_stores_the_threshold_and_its_first_crossing(tmp_path: Path) -> None:
    plain = run_one(small().replace("EXPE", "PATC\nDISC,.2\nEXPE"))
    result = run_one(with_threshold("1.0E-3,"))
    np.testing.assert_array_equal(result.force, plain.force)
    values = result.threshold
    above = result.time[result.force >= values["force"]]
    assert 0 < len(above) < len(result.time)
    assert values["time"] == above[0]
    assert np.isnan(values["margin"])  # the run ends before its peak
    assert values["force"] == pytest.approx(threshold_force(values["d_star"], 1.0e-3), rel=1e-12)
    (tmp_path / "d.inp").write_text(with_threshold("5.,"))
    done = call("run", "d.inp", cwd=tmp_path)
    assert "not reached by the end of the run, which is in contact: open" in done.stdout
    stored = fecm.load(tmp_path / "d.h5")
    assert math.isnan(stored.threshold["time"])
    assert math.isnan(stored.threshold["margin"])


@pytest.mark.parametrize("card", ["0.,", "-1.,", "1.,0.5", "1.,2.5", "1.,-1."])
def test_toughness_and_number_of_delaminations_are_checked(card: str) -> None:
    assert "E457" in [finding.code for finding in load_deck(with_threshold(card)).errors()]


def test_the_threshold_is_printed_with_the_number_of_delaminations_it_assumes() -> None:
    result = run_one(with_threshold("1.0E-3,7."))
    values = result.threshold
    assert (values["number"], values["interfaces"]) == (7, 1)
    assert list(values["band"]) == pytest.approx([values["force"] * math.sqrt(3.0)] * 2, rel=1e-12)
    (line,) = [line for line in run_summary(result) if line.startswith("delamination")]
    assert line.endswith(f"(for 7 delaminations, as in DELA; {values['band'][1]:.4g} for one)")


def test_the_band_ends_with_a_delamination_in_each_interface_of_unlike_plies() -> None:
    # [0/45/0/-45/0]2s: like plies meet in the middle and between its groups.
    layers = sum(a != b for a, b in pairwise(REPORT_ANGLES))
    assert layers == report_plate().unlike_interfaces == 16
    deck = fecm.examples.path("drop-weight.inp")  # [45/0/-45/90]3s
    threshold = load_deck(deck).problems[0].threshold
    assert threshold is not None
    assert threshold.interfaces == 22
    assert threshold.band[0] / threshold.force == pytest.approx(math.sqrt(3.0 / 24.0), rel=1e-12)
    assert threshold.band[1] == threshold.force


def test_plies_that_differ_by_half_a_turn_are_alike() -> None:
    ply = Ply(1.0, 0.3, 20.0, 1.0, 0.5, 0.5, 0.5)
    assert laminate(ply, [90.0, -90.0, 0.0, 180.0, 45.0], [0.1] * 5).unlike_interfaces == 2


@pytest.mark.parametrize(("angles", "warns"), [((0.0, 90.0, 90.0, 0.0), False), ((45.0,), True)])
def test_a_laminate_whose_bending_twists_it_is_named_beside_its_threshold(
    angles: Sequence[float], warns: bool
) -> None:
    ply = "1.6e-9,.3,141e3,9.75e3,5.2e3,5.2e3,3.2e3"
    layup = "[" + "/".join(f"{angle:g}" for angle in angles) + "]"
    answer = call(
        "new",
        "-",
        "--size",
        "100x80",
        "--mesh",
        "2x2",
        "--layup",
        layup,
        "--ply-thickness",
        ".5",
        "--ply",
        ply,
        "--velocity",
        "2000",
        "--law",
        "5e4,0,0,1.5",
        "--projectile",
        "mass:1e-3",
        "--duration",
        "1e-5",
        "--patch",
        "none",
    )
    deck = load_deck(answer.stdout.replace("EXPE", "DELA\n0.5\nEXPE"))
    assert ("W461" in [finding.code for finding in deck.findings]) is warns


def test_more_delaminations_lower_the_threshold() -> None:
    one, seven = (load_deck(with_threshold(f"2.,{n}")).problems[0].threshold for n in ("", "7."))
    assert one is not None
    assert seven is not None
    assert seven.force / one.force == pytest.approx(math.sqrt(3.0 / 9.0), rel=1e-12)
    assert "W458" in [finding.code for finding in load_deck(with_threshold("2.,")).findings]


def run_one(text: str) -> Result:
    return fecm.run_one(text)
