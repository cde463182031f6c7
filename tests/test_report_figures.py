"""The report, figure by figure: what its figures need beyond runs, waves and fits."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fecm
from fecm.studies.waves import Fronts
from tests.calls import assert_unusable, call, rows
from tests.decks import DATA_CARDS, LONG, PROGRAM, small

Rows = list[dict[str, str]]

# Table 3.1 and section 3.2 of the report, in in and lbf.
K = {
    "report-0.5a": 1.284e6,
    "report-0.5b": 1.376e6,
    "report-0.75a": 1.833e6,
    "report-0.75b": 1.990e6,
}
ALPHA_P, S_P, ALPHA_CR = 6.564e-4, 0.094, 3.16e-3


def numbers(table: Rows, name: str, **chosen: str) -> Any:
    """A column of a table, of the rows with the chosen values."""
    chosen_rows = (row for row in table if all(row[n] == value for n, value in chosen.items()))
    return np.array([float(row[name]) for row in chosen_rows])


# Indentation laws (figures 3.2 to 3.19) ----------------------------------------------------------


def test_named_laws_load_by_their_k_without_a_deck() -> None:
    table = rows(call("indent", "curve", "--contact", ",".join(K), "--path", "0,4e-3"))
    for name, k in K.items():
        indentation = numbers(table, "indentation", contact=name)
        assert indentation[-1] == 4e-3
        force = numbers(table, "force", contact=name)
        np.testing.assert_allclose(force, k * indentation**1.5, rtol=1e-12)


def test_named_laws_are_converted_to_other_units() -> None:
    law = ("indent", "curve", "--contact", "report-0.5")
    inches = rows(call(*law, "--path", "2e-3,0"))
    metric = rows(call(*law, "--path", "0.0508,0", "--units", "mm-N-s"))
    # The constants of a card have six digits, and the force between them has the power 2.5.
    np.testing.assert_allclose(
        numbers(metric, "force"), numbers(inches, "force") * 4.4482216152605, rtol=1e-4
    )


@pytest.mark.parametrize(
    ("name", "k", "q"), [("report-0.5-fit", 1.330e6, 2.2), ("report-0.75-fit", 1.912e6, 1.8)]
)
def test_the_fitted_laws_unload_by_the_reports_best_powers(name: str, k: float, q: float) -> None:
    table = rows(call("indent", "curve", "--contact", name, "--path", "3e-3,0"))
    indentation = numbers(table, "indentation", branch="unloading")
    permanent = S_P * (3e-3 - ALPHA_P)  # equation 3-8
    share = np.maximum(indentation - permanent, 0.0) / (3e-3 - permanent)
    expected = k * 3e-3**1.5 * share**q  # equation 3-3
    np.testing.assert_allclose(numbers(table, "force", branch="unloading"), expected, rtol=1e-9)


def test_the_permanent_indentation_is_zero_up_to_alpha_p_and_then_a_line() -> None:
    table = rows(
        call("indent", "curve", "--contact", "report-0.5", "--permanent", "--path", "0,4e-3",
             "--points", 200)
    )  # fmt: skip
    peaks, permanent = numbers(table, "alpha_m"), numbers(table, "alpha_0")
    assert len(peaks) == 201
    assert (permanent[peaks <= ALPHA_P] == 0.0).all()
    np.testing.assert_allclose(
        permanent[peaks > ALPHA_P], S_P * (peaks[peaks > ALPHA_P] - ALPHA_P), rtol=1e-12
    )


def test_the_permanent_indentation_of_a_law_with_acr_is_by_equation_3_7() -> None:
    table = rows(call("indent", "curve", "--contact", "yang-0.5", "--permanent"))
    peaks, permanent = numbers(table, "alpha_m"), numbers(table, "alpha_0")
    assert peaks[-1] == pytest.approx(2.0 * ALPHA_CR)
    with np.errstate(divide="ignore"):
        expected = peaks * np.maximum(1.0 - (ALPHA_CR / peaks) ** 0.4, 0.0)
    np.testing.assert_allclose(permanent, np.nan_to_num(expected), rtol=1e-9, atol=1e-18)


def test_the_rigidities_of_a_named_law_need_no_deck() -> None:
    law = ("indent", "curve", "--contact", "report-0.5", "--rigidity", "--path", "1e-3,4e-3")
    table = rows(call(*law))
    peaks = numbers(table, "alpha_m")
    by_line = 1.330e6 * peaks**1.5 / ((1.0 - S_P) * peaks + S_P * ALPHA_P) ** 2.5  # equation 3-9
    np.testing.assert_allclose(numbers(table, "s_3_9"), by_line, rtol=1e-12)
    beyond = peaks > ALPHA_CR
    np.testing.assert_allclose(
        numbers(table, "s_3_7")[beyond],
        1.330e6 / ALPHA_CR,
        rtol=1e-9,  # equation 3-6
    )


def test_the_picture_of_rigidities_has_the_indentation_along_and_the_rigidity_up() -> None:
    from fecm.plot.studies import rigidity_picture

    peaks, units = np.array([1e-3, 2e-3, 4e-3]), {"length": "in", "force": "lbf"}
    (axes,) = rigidity_picture(peaks, {"3-7": 1.0 / peaks}, 2.5, units).figure.axes
    (line,) = axes.get_lines()
    np.testing.assert_array_equal(line.get_xdata(), peaks)
    np.testing.assert_array_equal(line.get_ydata(), 1.0 / peaks)
    assert "Largest indentation" in axes.get_xlabel()
    assert axes.get_ylim() == (0.0, 3.0 / 2e-3)


@pytest.mark.parametrize(
    ("options", "what"),
    [
        (("--path", "1e-3"), "give a DECK or --contact"),
        ((LONG, "--contact", "report-0.5", "--path", "1e-3"), "give a DECK or --contact"),
        ((LONG, "--units", "mm-N-s", "--path", "1e-3"), "--units are the units of --contact"),
        (("--contact", "report-0.6", "--path", "1e-3"), "did you mean report-0.5?"),
        (("--contact", "report-0.5,report-0.75", "--rigidity"), "--rigidity takes one law"),
        (("--contact", "report-0.5", "--rigidity", "--permanent"), "exclude each other"),
        (("--contact", "report-0.5", "--permanent", "--path", "3,1"), "the range FROM,TO"),
        (("--contact", "report-0.5", "--permanent", "--q", "2"), "require --rigidity"),
    ],
)
def test_a_curve_without_one_source_of_laws_is_refused(options: tuple[Any, ...], what: str) -> None:
    done = call("indent", "curve", *options)
    assert_unusable(done)
    assert what in done.stderr


def test_several_laws_share_a_picture_with_their_names(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    for kind in (["--path", "2e-3,0"], ["--permanent"]):
        picture = tmp_path / f"{kind[0]}.svg"
        laws = "report-0.5,report-0.75"
        done = call("indent", "curve", "--contact", laws, *kind, "--plot", picture)
        assert done.exit_code == 0
        assert all(f"<!-- {name} -->" in picture.read_text() for name in laws.split(","))


# Waves (figures 2.4 to 2.12) ---------------------------------------------------------------------


def test_fronts_of_a_point_source_decay_with_the_root_of_time_in_an_isotropic_plate() -> None:
    plate = ("--layup", "0", "--ply-thickness", ".1", "--ply", "1,.3,1,1,.384615384615,"
             ".384615384615,.384615384615")  # fmt: skip
    table = rows(call("waves", "fronts", *plate, "--radius", 0, "--time", 1, 2, 5, "--step", 30))
    for time in (1.0, 2.0, 5.0):
        strength = numbers(table, "strength", time=str(time))
        np.testing.assert_allclose(strength, time**-0.5, rtol=1e-6)
        speed = np.hypot(*(numbers(table, name, time=str(time)) for name in "xy")) / time
        np.testing.assert_allclose(
            numbers(table, "length_per_radian", time=str(time)), speed * time, rtol=1e-6
        )


def test_the_strength_of_a_front_is_unknown_at_a_cusp() -> None:
    velocity, curvature = np.array([[2.0] * 5]), np.array([[-3.0] * 5])
    zero = np.zeros((1, 5))
    fronts = Fronts(np.zeros(1), velocity, zero, curvature, np.zeros((1, 5, 5)))
    assert np.isnan(fronts.strength(0.5, 1.0, 1.0)).all()  # 1 + 1 (2 - 3) = 0
    np.testing.assert_allclose(fronts.strength(0.5, 5.0, 1.0), (0.5 / 4.0) ** 0.5)


def test_the_front_along_the_fibres_of_the_report_keeps_more_of_its_strength() -> None:
    # Section 2.3.4: extension and bending decay more rapidly along y than along x.
    table = rows(call("waves", "fronts", LONG, "--time", 5e-6, 20e-6, "--step", 90))
    for mode in ("extension", "bending"):
        along_x, along_y = (
            numbers(table, "strength", mode=mode, time="2e-05", normal_deg=normal)[0]
            for normal in ("0.0", "90.0")
        )
        assert along_y < along_x


def test_one_mode_has_the_rows_that_it_has_among_all() -> None:
    waves = ("waves", "dispersion", LONG, "--wavelengths", "1:10:5")
    every, lowest = rows(call(*waves)), rows(call(*waves, "--mode", "flexural_1"))
    assert lowest == [row for row in every if row["mode"] == "flexural_1"]
    assert len(lowest) == 3 * 5
    assert "'bending' is not one of 'flexural_1'" in call(*waves, "--mode", "bending").stderr


# Area of the loop of contact force and indentation -----------------------------------------------


def light_mass(dt: str, steps: int) -> str:
    """A small plate under a mass that leaves it before a wave comes back from its edges."""
    data = DATA_CARDS.replace("EXPE", "PROJ\n0,0,2e-6\nEXPE")
    return small(PROGRAM.replace("         10\n", f"{steps:11}\n").replace(".5E-6", dt), data=data)


def test_the_contact_loop_is_the_integral_of_the_force_over_the_indentation() -> None:
    result = fecm.run_one(light_mass("1.E-7", 400))
    force, indentation = np.append(0.0, result.force), np.append(0.0, result.indentation)
    area = np.sum(0.5 * (force[1:] + force[:-1]) * np.diff(indentation))
    assert result.metrics["contact_loop"] == pytest.approx(area, rel=1e-6)


def test_the_contact_loop_of_one_loading_and_unloading_has_a_closed_form() -> None:
    result = fecm.run_one(light_mass("1.E-8", 4000))
    metrics = result.metrics
    assert metrics["contacts"] == 1
    deepest, permanent = metrics["max_indentation"], metrics["permanent_indentation"]
    q = 2.0
    expected = metrics["peak_force"] * (0.4 * deepest - (deepest - permanent) / (q + 1.0))
    assert metrics["contact_loop"] == pytest.approx(expected, rel=1e-5)


def test_runs_sweeps_and_pages_have_the_same_contact_loop(tmp_path: Path) -> None:
    (tmp_path / "d.inp").write_text(light_mass("1.E-7", 400))
    done = call("run", "d.inp", "--format", "json", cwd=tmp_path)
    loop = json.loads(done.stdout)["metrics"]["contact_loop"]
    energy = 0.5 * 2e-6 * 115.0**2
    shown = call("info", "d.h5", cwd=tmp_path).stdout
    assert f"{loop:.4g} kept by the indentation, {loop / energy:.1%} of the impact energy" in shown
    swept = fecm.sweep(tmp_path / "d.inp", {"velocity": [115.0]})
    assert swept["contact_loop"][0] == pytest.approx(loop, rel=1e-9)


def test_the_contact_loop_is_open_while_the_contact_lasts() -> None:
    result = fecm.run_one(light_mass("1.E-7", 100))
    assert result.still_in_contact
    assert np.isnan(result.metrics["contact_loop"])


def test_rounding_is_not_printed_as_the_loop_of_an_elastic_law() -> None:
    inelastic = "  1912000. 0.0006564     0.094       2.0"
    elastic = light_mass("1.E-7", 400).replace(
        inelastic, "  1912000.        0.        0.       1.5"
    )
    result = fecm.run_one(elastic)
    assert abs(result.metrics["contact_loop"]) < 1e-4 * 0.5 * 2e-6 * 115.0**2
    assert "contact loop" not in str(result)
