"""``fecm verify``: its figures and its output."""

from __future__ import annotations

import json
import math
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import fecm
from fecm import Deck
from fecm.deck.model import Material
from fecm.mechanics import element_matrices
from fecm.mechanics import laminate as laminates
from fecm.mechanics.contact_law import LinearPermanent
from fecm.problem.generate import generate
from fecm.verification import CASES, chosen, compute_rows, stretching, supports
from fecm.verification.case import HEAD, Case, Check, Label, Row, cells, verification_page
from fecm.verification.decks import report_impact
from tests import closed_forms
from tests.builders import DATA
from tests.builders import table as reference
from tests.calls import assert_unusable, call
from tests.decks import LONG, ROOT

PAGE = ROOT / "docs" / "verification.md"


def check_of(case: str, quantity: str) -> Check:
    """A check by its case and the beginning of its quantity."""
    (one,) = chosen([case])
    (actual,) = [check for check in one.checks if check.quantity.startswith(quantity)]
    return actual


# Output ------------------------------------------------------------------------------------------


@cache
def rows_of(name: str) -> list[Row]:
    """The rows of a case, computed once."""
    (one,) = chosen([name])
    return compute_rows(one)


# Half a second to two; most of the others take a tenth.
SLOW = ("large-mass", "location", "reduced-plate", "webassembly")


@pytest.mark.parametrize(
    "name",
    [pytest.param(c.name, marks=pytest.mark.long if c.name in SLOW else ()) for c in CASES],
)
def test_every_row_is_within_its_tolerance(name: str) -> None:
    actual = rows_of(name)
    assert [(row.check.quantity, row.error, row.failure) for row in actual if not row.within] == []


@pytest.mark.long
def test_the_page_is_made_from_the_cases() -> None:
    pytest.importorskip("wasmtime")  # the page has its case
    rows = [row for one in CASES for row in rows_of(one.name)]

    def fixed(text: str) -> list[list[str]]:
        # Everything but the cells that differ between machines.
        lines = [line.split(" | ") for line in text.splitlines()]
        return [cells[:3] + cells[5:] if len(cells) == 8 else cells for cells in lines]

    assert fixed(PAGE.read_text()) == fixed(verification_page(rows))
    assert "**" not in PAGE.read_text().partition("## ")[2]  # no row of it has failed


def test_some_cases_are_computed_and_told_in_a_table() -> None:
    done = call("verify", "time-step", "cross-ply")
    assert done.exit_code == 0
    assert done.stderr == ""
    head, *body, last = done.stdout.splitlines()
    assert head.split() == list(HEAD)
    assert [line.split()[0] for line in body] == ["cross-ply"] * 8 + ["time-step"] * 2
    assert all(line.endswith("independent  ok") for line in body)
    assert {line.index("independent") for line in body} == {head.index("label")}
    assert last == "10 rows, all within tolerance"


def test_programs_get_every_number_and_what_could_not_be_computed_is_null(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    done = call("verify", "indentation", "--format", "json")
    document = json.loads(done.stdout)
    assert (done.exit_code, document["ok"], len(document["rows"])) == (0, True, 12)
    first = document["rows"][0]
    assert first["expected"] == 22.4
    assert first["error"] == pytest.approx(first["got"] / 22.4 - 1.0)
    monkeypatch.setattr(LinearPermanent, "loading", None)
    done = call("verify", "indentation", "--format", "json")
    document = json.loads(done.stdout)
    assert (done.exit_code, document["ok"], document["rows"][0]["got"]) == (1, False, None)
    assert document["rows"][0]["failure"].startswith("TypeError: ")


def test_a_row_beyond_its_tolerance_is_told_and_the_answer_is_no(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    right = laminates.transformed_shear
    monkeypatch.setattr(
        laminates, "transformed_shear", lambda g13, g23, angle: 1.01 * right(g13, g23, angle)
    )
    done = call("verify", "cross-ply", "angle-ply")
    assert done.exit_code == 1
    assert [line.split()[-1] for line in done.stdout.splitlines()].count("FAILED") == 2
    assert done.stderr == "fecm: error: 2 of 17 rows are beyond tolerance\n"


def test_a_case_that_can_not_be_computed_says_why_and_fails(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(element_matrices, "stiffness", lambda *_, **__: 1 / 0)
    done = call("verify", "static-bending")
    assert done.exit_code == 1
    assert "\n  ZeroDivisionError: division by zero\n" in done.stdout
    assert done.stderr == "fecm: error: 6 of 6 rows are beyond tolerance\n"
    assert "Traceback" not in done.stdout


def test_a_list_names_the_cases_without_computing_them(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fecm.cli.verify.compute_rows", None)
    done = call("verify", "--list")
    assert [line.split()[0] for line in done.stdout.splitlines()] == [one.name for one in CASES]
    document = json.loads(call("verify", "--list", "patch", "--format", "json").stdout)
    assert [(one["case"], one["rows"]) for one in document["cases"]] == [("patch", 8)]


def test_what_can_not_be_meant_is_refused() -> None:
    done = call("verify", "patches")
    assert_unusable(done)
    assert "unknown case patches; the cases are isotropic-ply, cross-ply" in done.stderr
    for options in (("--list",), ("--format", "json")):
        assert_unusable(call("verify", "--markdown", *options))


def test_numbers_that_are_missing_or_not_finite_are_never_within() -> None:
    check = Check("x", 1.0, "nowhere", 0.1, "")
    for given in ([], [math.nan], [math.inf], [1.0, 1.0]):
        (row,) = compute_rows(Case("made", "", (check,), lambda given=given: given))  # type: ignore[misc]
        assert not row.within
        assert cells(row)[-1] == "FAILED"


def test_of_a_field_the_value_farthest_from_the_expected_one_counts() -> None:
    check = Check("x", 2.0, "nowhere", 0.1, "")
    shape = np.array([1.0, 0.5, -1.0])
    for given, got in (
        (np.array([[2.1, 1.7], [2.2, 2.0]]), 1.7),
        (np.array([2.0, math.nan, 1.0]), math.nan),
        ((2.0 * shape, shape), 2.0),
        ((2.0 * shape - [0.0, 0.3, 0.1], shape), 1.7),
    ):
        (row,) = compute_rows(Case("made", "", (check,), lambda given=given: [given]))  # type: ignore[misc]
        assert row.got == pytest.approx(got, nan_ok=True)


# Figures -----------------------------------------------------------------------------------------

# Cases with independent figures that are stated, and compared with references below.
STATED = {
    "static-bending", "frequencies", "wave-fronts", "dispersion", "rod-pulse", "infinite-plate",
    "supported-plate", "patch-impact", "failure", "cured-failure", "small-mass", "large-mass",
    "contact-coefficient", "stretching-plate", "stretching-disc", "stretching-impact", "sandwich",
    "curved-panel", "curved-impact", "location", "elastic-edges", "edge-stiffness",
    "pushing-window",
}  # fmt: skip


def test_the_figures_of_elastic_edges_are_those_of_the_other_program() -> None:
    (row,) = (
        r for r in reference("elastic_edges.csv")
        if (float(r["k_r_Nmm_per_rad_mm"]), float(r["k_w_N_per_mm2"])) == (1e4, 10.0)
    )  # fmt: skip
    stated = [float(row[f"f{n}_Hz"]) for n in range(1, 7)]
    assert list(supports.FREQUENCIES) == stated
    (edges,) = chosen(["elastic-edges"])
    assert [check.expected for check in edges.checks] == stated[:2]
    (stiffness,) = chosen(["edge-stiffness"])
    assert [check.expected for check in stiffness.checks] == [1e4, 10.0]


@pytest.mark.parametrize("one", CASES, ids=lambda one: one.name)
def test_expected_values_are_those_of_closed_forms(one: Case) -> None:
    derived = closed_forms.EXPECTED.get(one.name, [None] * len(one.checks))
    for check, value in zip(one.checks, derived, strict=True):
        if value is not None:
            assert check.expected == pytest.approx(value, rel=1e-10, abs=0.0), check.quantity
        elif check.label == "independent":
            assert one.name in STATED, check.quantity
        if check.scale is not None and one.name in closed_forms.SCALES:
            assert check.scale == pytest.approx(closed_forms.SCALES[one.name], rel=1e-10)


@pytest.mark.parametrize("ratio", [10, 100])
def test_paganos_printed_sandwich_is_that_of_the_exact_solution(ratio: int) -> None:
    values = [r for r in reference("several_materials.csv") if f"sandwich S={ratio}" in r["case"]]
    upper, middle = (
        next(r for r in values if "elasticity" in r["theory"] and float(r["z/h"]) == z)
        for z in (0.5, 0.0)
    )
    (one,) = chosen(["sandwich"])
    references = {
        "σ1": float(upper["sx"]) / ratio**2,
        "σ2": float(upper["sy"]) / ratio**2,
        "τ12": float(upper["txy"]) / ratio**2,
        "τ_xz": float(middle["txz"]) / ratio,
        "τ_yz": float(middle["tyz"]) / ratio,
        "100 w": 100.0 * float(middle["w"]) / ratio**4,
    }
    checks = [check for check in one.checks if check.quantity.endswith(f"a/h = {ratio}")]
    assert len(checks) > 2
    for check in checks:
        name = next(name for name in references if check.quantity.startswith(name))
        assert check.expected == pytest.approx(references[name], rel=2e-3)


def test_the_deck_made_in_python_is_the_reports() -> None:
    built, given = report_impact(), fecm.read_deck(LONG)
    assert isinstance(given, Deck)
    ours, theirs = generate(built), generate(given)
    for name in ("coordinates", "elements", "codes", "equations"):
        np.testing.assert_array_equal(getattr(ours, name), getattr(theirs, name))
    assert built.require(Material) == given.require(Material)
    (dt,) = [macro.value for macro in built.macros if macro.word == "DT"]
    assert dt == 2e-7


def test_zeners_figures_are_the_solution_of_his_equations() -> None:
    m, k, v = 2.0e-5, 5.0e4, 100.0
    slope = 1.0 / (8.0 * math.sqrt(1.0e7 * 0.1**3 / 12.0 / (1.0 - 0.3**2) * 2.5e-4 * 0.1))

    def rate(_: float, y: Any) -> list[float]:
        force = k * max(y[0], 0.0) ** 1.5
        return [y[1] - slope * force, -force / m]  # approach; velocity of the mass

    solution = solve_ivp(
        rate,
        (0.0, 200e-6),
        [0.0, v],
        method="DOP853",
        rtol=1e-12,
        atol=1e-16,
        dense_output=True,
        events=lambda t, y: rate(t, y)[0],
    )
    time = solution.t_events[0][0]
    figures = (
        ("largest force", k * solution.sol(time)[0] ** 1.5),
        ("its time", time),
        ("velocity at 200", -solution.y[1, -1]),
    )
    for quantity, value in figures:
        assert check_of("infinite-plate", quantity).expected == pytest.approx(value, rel=1e-8)


def test_dalemberts_figures_are_the_sums_of_his_waves() -> None:
    through = math.sqrt(7.33e-4 / 30.0e6)

    def middle(time: np.ndarray[Any, Any], tau: float) -> Any:
        total = np.zeros_like(time)
        for turn in range(70):
            for sign, path in ((1.0, 2 * turn + 0.5), (-1.0, 2 * turn + 1.5)):
                late = time - path * through
                pulse = 1000.0 * np.exp(-(((late - tau) / 80e-6) ** 2))
                total += np.where(late >= 0.0, sign * pulse, 0.0)
        return total

    # Its largest value lies just before a jump comes by.
    peak = middle(np.linspace(190e-6, 210e-6, 200_001), 200e-6).max()
    assert check_of("rod-pulse", "largest force").expected == pytest.approx(peak, rel=1e-6)
    assert f"exact {peak:.2f} |" in (ROOT / "docs" / "rod.md").read_text()
    later = middle(np.array([250e-6]), 300e-6)[0]
    assert check_of("rod-pulse", "the same pulse").expected == pytest.approx(later, rel=1e-9)


def test_the_supported_plates_figures_are_the_steps_of_its_modes() -> None:
    h, m, k, steps, end = 0.03, 5.0e-6, 1.0e5, 3000, 200e-6
    e, nu, dt = 1.0e7, 0.3, end / steps
    q = e / (1.0 - nu**2) * np.array([[1.0, nu, 0.0], [nu, 1.0, 0.0], [0.0, 0.0, (1 - nu) / 2]])
    a, b, _ = closed_forms.terms(39)
    omega, shapes = closed_forms.TwoLayers(q, q, e / 2.6 * np.eye(2), h).modes(a, b)
    w, phi = omega.ravel(), shapes[:, 2].ravel()
    moves = np.abs(phi) > 1e-9 * np.abs(phi).max()
    w, phi = w[moves], phi[moves]
    # Of a force that is constant around each instant every mode's answer is exact; a mode's mass is
    # that of a quarter of the plate.
    turn, push = 2.0 * np.cos(w * dt), 8.0 * phi * (1.0 - np.cos(w * dt)) / w**2
    before = now = np.zeros_like(w)
    x_before, x = -100.0 * dt, 0.0
    forces, deflections = [], []
    for _ in range(steps):
        deflections.append(float(phi @ now))
        forces.append(k * max(x - deflections[-1], 0.0) ** 1.5)
        before, now = now, turn * now - before + push * forces[-1]
        x_before, x = x, 2.0 * x - x_before - forces[-1] / m * dt**2
    figures = {
        "largest force": max(forces), "its impulse": dt * sum(forces),
        "its time": dt * int(np.argmax(forces)),
        "largest w": max(deflections), "velocity": (x_before - x) / dt,
    }  # fmt: skip
    for quantity, figure in figures.items():
        assert check_of("supported-plate", quantity).expected == pytest.approx(figure, rel=1e-4)


def test_the_series_of_two_layers_are_mindlins_where_both_are_the_same_isotropic_ply() -> None:
    g, h, nu = 1.0 / 2.6, 0.1, 0.3
    q = np.array([[1.0, nu, 0.0], [nu, 1.0, 0.0], [0.0, 0.0, (1 - nu) / 2]]) / (1.0 - nu**2)
    plate = closed_forms.TwoLayers(q, q, g * np.eye(2), h)
    density = plate.inertia[0] / h
    for quantity, m, n in (("ω11, lumped", 1, 1), ("ω13, lumped", 1, 3), ("ω33, cons", 3, 3)):
        omega = plate.modes(np.array(m * np.pi), np.array(n * np.pi))[0]
        scaled = omega * math.sqrt(density * h / (h**3 / 12.0 / (1.0 - nu**2)))
        expected = check_of("frequencies", quantity).expected
        assert np.abs(scaled / expected - 1.0).min() < 1e-11
    a, b, loads = closed_forms.terms(199)
    K = plate.modal_stiffness(a, b)[:, 2:, 2:]
    w = np.linalg.solve(K, loads[:, None, None] * np.eye(3)[:, :1])[:, 0, 0].sum()
    assert w == pytest.approx(check_of("static-bending", "w in the middle, L2").expected, rel=1e-6)


def test_locking_of_shear_order_3_shows_in_the_thin_plate() -> None:
    (bending,) = chosen(["static-bending"])
    thin = {row.check.quantity: row.error for row in compute_rows(bending)}
    assert abs(thin["w in the middle, thin"]) < 1e-5
    assert -2e-3 < thin["w in the middle, thin, L2 = 3"] < -2e-4


def test_rows_are_called_independent_only_where_they_are() -> None:
    labels = {(one.name, c.quantity): c.label for one in CASES for c in one.checks}
    for case, quantity in (
        ("rod-pulse", "mean of its ratio to the applied one"),
        ("rod-pulse", "mass of the report's projectile (lb s²/in)"),
        ("indentation", "F(α_p), 0.5 in indenter (lb)"),
    ):
        assert labels[case, quantity] is Label.AGAINST_CHANGE
    assert labels["report-impact", "worst error of the energy balance"] == "consistency"
    assert labels["convolution", "largest difference of the forces"] == "consistency"
    assert set(labels.values()) == set(Label)


def test_figures_of_series_and_of_waves_are_those_of_the_reference_files() -> None:
    def of(name: str, key: str, column: str, **where: str) -> float:
        (value,) = [
            float(row[column])
            for row in reference(name)
            if key in row[next(iter(row))] and all(row[k] == v for k, v in where.items())
        ]
        return value

    static = "static_ssss_mindlin.csv"
    expected = [check.expected for check in chosen(["static-bending"])[0].checks][:4]
    series = [
        of(static, f"h/a={ratio}", column, load="uni (unit)")
        for ratio, column in (
            ("0.1 ks=1.0", "w_centre"),
            ("0.1 ks=1.0", "quarter_point w(a/4,b/4)"),
            ("0.01 ks=1.0", "w_centre"),
            ("0.1 ks=0.83", "w_centre"),
        )
    ]
    assert expected == pytest.approx(series, rel=1e-10)
    for quantity, m, n in (("ω11, lumped", 1, 1), ("ω13, lumped", 1, 3), ("ω33, cons", 3, 3)):
        value = of(
            "freq_ssss_mindlin.csv",
            "h/a=0.1 ks=1.0",
            "omega_flex_rad/s_or_nondim",
            m=str(m),
            n=str(n),
        )
        assert check_of("frequencies", quantity).expected == pytest.approx(value, rel=1e-11)
    (along,) = [r for r in reference("waves_normal_velocity.csv") if r["theta_deg"] == "0"]
    given = [float(value) for value in list(along.values())[1:6]]
    fronts = [check.expected for check in chosen(["wave-fronts"])[0].checks]
    assert fronts[:5] == pytest.approx(given, rel=1e-13)
    columns = ("c_n_in/s", "ray_dir_deg")
    given = [of("waves_wavefront_rays.csv", "extension", c, normal_deg="45") for c in columns]
    assert fronts[5:7] == pytest.approx(given, rel=1e-10)
    for quantity, ratio in (("ω, wavelength 10 h", "10"), ("ω, wavelength h", "1")):
        value = of(
            "waves_dispersion.csv",
            "0",
            "mode1_omega_rad/s",
            alpha_deg="0",
            **{"lambda_over_h": ratio},
        )
        assert check_of("dispersion", quantity).expected == pytest.approx(value, rel=1e-10)


def test_figures_of_patches_and_plies_are_those_of_the_reference_files() -> None:
    def at(name: str, laminate: str, columns: list[str], **where: str) -> list[float]:
        (row,) = (
            row
            for row in reference(name)
            if row[next(iter(row))].startswith(laminate)
            and all(row[column] == value for column, value in where.items())
        )
        return [float(row[column]) for column in columns]

    for shape in ("disc", "hertz"):
        given = at(
            "static_patch.csv",
            "[0/90]5s",
            ["W/F conjugate mean"],
            K="1",
            shape=shape,
            **{"c (radius or half side)": "0.5"},
        )
        actual = check_of("patch-compliance", f"W, {shape.replace('h', 'H')}").expected
        assert actual == pytest.approx(given[0], rel=4e-6)
    given = at(
        "patch_impact_summary.csv",
        "report-ply",
        ["peak force", "time of peak"],
        c="0.125",
        **{"law alpha_p s_p q": ""},
    )
    assert [check.expected for check in chosen(["patch-impact"])[0].checks] == given
    given = at("shear_stiffness.csv", "[0/90/0] Pagano", ["H xz,xz", "H yz,yz"])
    expected = [check.expected for check in chosen(["equilibrium-shear"])[0].checks[1:3]]
    assert expected == pytest.approx(given, rel=1e-8)
    columns = ["sx(a/2,b/2,+h/2)/(q0 S^2)", "txy(0,0,+h/2)/(q0 S^2)", "txz(0,b/2,0)/(q0 S)",
               "tyz(a/2,0,0)/(q0 S)", "sy(a/2,b/2,90-ply upper face)/(q0 S^2)"]  # fmt: skip
    given = at(
        "pagano_sinusoidal.csv",
        "[0/90/0]",
        columns,
        theory="FSDT K=1",
        **{"b/a": "1", "S=a/h": "10"},
    )
    # The origin of the rows is in the middle, that of the file in a corner.
    signs = np.array([100.0, 100.0, -10.0, -10.0, 100.0])
    quantities = ("σ1 at z = h/2", "τ12", "τ_xz", "τ_yz", "σ1 at z = h/6")
    found_ = [check_of("ply-stresses", quantity).expected for quantity in quantities]
    assert found_ == pytest.approx((signs * given).tolist(), rel=1e-8)


def test_figures_of_damage_are_those_of_the_reference_files() -> None:
    first = {
        r["criterion"]: float(r["q0 at first failure (Pa)"])
        for r in reference("first_ply_failure_chain.csv")
    }
    assert [check.expected for check in chosen(["failure"])[0].checks] == list(first.values())
    cured = [
        float(r["q0 at first failure (Pa)"])
        for r in reference("thermal_first_failure.csv")
        if float(r["dT_K"]) == -100.0
    ]
    assert [check.expected for check in chosen(["cured-failure"])[0].checks] == cured
    figures = {
        ("threshold", "isotropic"): ("threshold_loads.csv", 0, "F threshold"),
        ("small-mass", "F T"): ("zener_olsson_small_mass.csv", 4, "F_max/(M V/T) = F_max/(k^.4 "
                                "V^1.2 M^.6)"),
        ("small-mass", "t_peak"): ("zener_olsson_small_mass.csv", 4, "t_peak/T"),
        ("small-mass", "λ of"): ("response_classes.csv", 1, "lambda"),
        ("small-mass", "largest force on"): ("response_classes.csv", 1,
                                             "peak infinite plate (Zener) N"),
        ("small-mass", "largest force of"): ("response_classes.csv", 1, "peak exact series N"),
        ("contact-coefficient", "indentation modulus of [0"): (
            "laminate_contact.csv", 0, "M by TI formula (quasi-isotropic only)"),
        ("contact-coefficient", "k"): ("laminate_contact.csv", 0, "k"),
        ("large-mass", "largest"): ("large_mass_energy_balance.csv", 0,
                                    "F max of the ODE of a mass on the two springs"),
    }  # fmt: skip
    for (case, quantity), (name, row, column) in figures.items():
        given = float(list(reference(name))[row][column])
        assert check_of(case, quantity).expected == pytest.approx(given, rel=1e-7)


def test_figures_of_plates_that_stretch_are_those_of_the_reference_files() -> None:
    (levy,) = [r for r in reference("nonlinear_levy.csv") if r["q_a4_over_E_h4"] == "134.9"]
    assert check_of("stretching-plate", "w/h").expected == float(levy["this_w_over_h"])
    discs = {
        r["edge"]: float(r["load_value"])
        for r in reference("nonlinear_circles.csv")
        if (r["load"], r["w0_over_h"]) == ("uniform", "1")
    }
    assert (discs["clamped_immovable"], discs["ss_movable"]) == stretching.PRESSURES
    (impact,) = [
        r
        for r in reference("nonlinear_impacts.csv")
        if (r["case"], r["target_w_over_h"]) == ("iso_clamped_immovable", "1.0")
    ]
    assert float(impact["velocity_mm_per_s"]) == stretching.VELOCITY
    for quantity, column in (("largest w", "W_max_mm"), ("largest force", "peak_N")):
        given = float(impact[column])
        assert check_of("stretching-impact", quantity).expected == pytest.approx(given, rel=1e-7)


def test_figures_of_sensitivity_are_those_of_the_reference_file() -> None:
    _, *rows = (DATA / "ishigami.csv").read_text().splitlines()
    given = {name: float(value) for name, value in (row.split(",") for row in rows)}
    for letter, kind in (("S", "first-order"), ("T", "total")):
        for number, value in enumerate("xyz", start=1):
            expected = check_of("random-values", f"{kind} index of {value}").expected
            assert expected == pytest.approx(given[f"{letter}{number}"], rel=1e-9)


def test_curved_panels_are_those_of_the_series() -> None:
    panels = {(r["Rx"], r["Ry"]): r for r in reference("curved_panels.csv")}
    flat, bent = panels["inf", "inf"], panels["inf", "1000.0"]
    bent_along = panels["500.0", "inf"]
    deflection = "W mm/N (static, disc c=4 in the middle)"
    peak = "peak force N (mass 2e-5 t, 3000 mm/s, k 5e4 N/mm^1.5, first .8 ms)"
    for quantity, row, column in (
        ("w of R_y", bent, deflection), ("w of R_x", bent_along, deflection),
        ("N_x", bent_along, "Nx"), ("N_y", bent_along, "Ny"),
        ("M_x", bent_along, "Mx"), ("M_y", bent_along, "My"),
        ("ω11", bent, "omega_11"), ("ω21", bent, "omega_21"), ("ω12", bent, "omega_12"),
    ):  # fmt: skip
        check = check_of("curved-panel", quantity)
        assert check.expected == float(row[column])
        # The flat plate is not within the tolerance.
        assert abs(float(flat[column]) / check.expected - 1.0) > 5.0 * check.tolerance
    assert check_of("curved-impact", "peak").expected == float(bent_along[peak])
    assert check_of("curved-impact", "time").expected == float(bent_along["time of peak"])
    later = {r["time"]: r for r in reference("curved_impact_Rx500_Ry0.csv")}["0.0002"]
    assert check_of("curved-impact", "w under").expected == float(later["plate_W"])


def test_the_located_impact_is_that_of_the_series() -> None:
    (truth,) = reference("locate_truth.csv")
    for quantity, column in (("x (mm)", "x0_mm"), ("y (mm)", "y0_mm"), ("peak", "peak_force_N")):
        assert check_of("location", quantity).expected == float(truth[column])
