"""Results of a sweep beside measured columns of the table of cases."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import fecm
from fecm._errors import StudyError
from fecm.plot.kinds import LackingError
from fecm.plot.pictures import draw
from fecm.report.content import render
from fecm.report.report import page_of
from tests.calls import call
from tests.decks import DATA_CARDS, PROGRAM, small
from tests.pages import read_page
from tests.pictures import footer_of

STEPS = PROGRAM.replace("LOOP         10", "LOOP        400")
DECK = small(STEPS, data=DATA_CARDS + "UNIT\nmm N s\n")
VELOCITIES = (50.0, 100.0, 150.0, 200.0)
FACTORS = (0.8, 1.0, 1.25)  # measured over computed peaks; the fourth test has no peak


@pytest.fixture(scope="module")
def computed() -> list[float]:
    """Peaks of the cases, from a sweep without tests."""
    return [float(peak) for peak in fecm.sweep(DECK, {"velocity": VELOCITIES})["peak_force"]]


@pytest.fixture(scope="module")
def path(computed: list[float], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of a sweep over a table of four tests, with measured peaks in kN."""
    folder = tmp_path_factory.mktemp("tests")
    peaks = [f"{1e-3 * f * peak!r}" for f, peak in zip(FACTORS, computed, strict=False)]
    rows = zip(VELOCITIES, "ABCD", [*peaks, ""], (20, 21, 20, 22), strict=True)
    lines = [",".join(map(str, row)) for row in rows]
    header = "velocity,specimen,Measured Peak_force (kN),measured contact_time (°C)"
    (folder / "tests.csv").write_text("\n".join([header, *lines]), encoding="utf-8")
    fecm.sweep(DECK, cases=folder / "tests.csv", output=folder / "tests.h5")
    return folder / "tests.h5"


@pytest.fixture(scope="module")
def sweep(path: Path) -> fecm.SweepResult:
    """The same sweep, read from its file."""
    return fecm.load_sweep(path)


def test_ratios_bias_and_rms_are_those_of_the_tests_with_both_values(
    sweep: fecm.SweepResult, computed: list[float]
) -> None:
    compared = sweep.compare("peak_force")
    assert (compared.name, compared.unit) == ("peak_force", "N")
    assert compared.ratio[:3] == pytest.approx([1.25, 1.0, 0.8])
    assert np.isnan(compared.ratio[3])
    differences = [0.2 * computed[0], 0.0, -0.25 * computed[2]]
    assert compared.bias == pytest.approx(sum(differences) / 3)
    assert compared.rms == pytest.approx(float(np.sqrt(sum(d**2 for d in differences) / 3)))
    assert compared.within == 1
    assert str(compared).startswith("computed over measured 1.02 (0.8 to 1.25), 1 of 3 within 10 %")


def test_the_tests_without_a_name_are_those_of_the_first_result_that_has_some(
    sweep: fecm.SweepResult,
) -> None:
    assert sweep.compare().name == "peak_force"


@pytest.mark.parametrize("name", ["contact_time", "impulse"])
def test_columns_in_another_unit_and_results_without_a_column_are_not_compared(
    sweep: fecm.SweepResult, name: str
) -> None:
    with pytest.raises(StudyError, match=f"no measured values of {name}; there are peak_force"):
        sweep.compare(name)


def test_a_failed_case_is_not_compared() -> None:
    tests = [{"velocity": v, "measured peak_force": 100.0} for v in (50.0, -50.0)]
    compared = fecm.sweep(DECK, cases=tests).compare()
    assert compared.pairs.tolist() == [True, False]


def test_summary_and_default_picture_compare_a_table_of_tests(path: Path, tmp_path: Path) -> None:
    text = "computed over measured 1.02 (0.8 to 1.25), 1 of 3 within 10 %"
    assert text in call("info", path).stdout
    drawn = call("plot", path, "-o", tmp_path / "tests.svg")
    assert drawn.exit_code == 0
    assert text in drawn.stderr


def test_points_of_the_picture_are_at_measured_and_computed_values(
    sweep: fecm.SweepResult, computed: list[float]
) -> None:
    pytest.importorskip("matplotlib")
    figure = draw("measured", {"tests": sweep}).figure
    (axes,) = figure.axes
    drawn = {str(line.get_label()): line for line in axes.get_lines()}
    equal = np.asarray(drawn["equal"].get_xydata())
    np.testing.assert_array_equal(equal[:, 0], equal[:, 1])
    points = next(line for line in axes.get_lines() if line.get_marker() == "o")
    measured = [f * peak for f, peak in zip(FACTORS, computed, strict=False)]
    np.testing.assert_allclose(
        np.asarray(points.get_xydata()), np.column_stack([measured, computed[:3]])
    )
    assert "1 of 3 within 10 %" in " ".join(footer_of(figure).split())
    selected = draw("measured", {"tests": sweep}, where={"velocity": 100.0}).figure.axes[0]
    points = next(line for line in selected.get_lines() if line.get_marker() == "o")
    assert len(np.asarray(points.get_xydata())) == 1


def test_a_sweep_without_tests_has_no_such_picture() -> None:
    pytest.importorskip("matplotlib")
    plain = fecm.sweep(DECK, {"velocity": VELOCITIES[:1]})
    with pytest.raises(LackingError, match="named after a result, as in `measured_peak_force`"):
        draw("measured", {"plain": plain})


def test_the_page_of_a_sweep_lists_the_tests_with_their_ratios(sweep: fecm.SweepResult) -> None:
    pytest.importorskip("jinja2")
    pytest.importorskip("matplotlib")
    shown = read_page(render(page_of({"tests": sweep})))
    assert "Tests" in shown.headings
    rows = {row[1].text: row for row in shown.rows if len(row) > 4 and row[1].text in "ABCD"}
    assert [rows[name][5].value for name in "ABC"] == pytest.approx([1.25, 1.0, 0.8])
    assert "D" not in rows  # it has no measured peak
