"""A measured force on the page of a run: ratios, record, and the curve in the picture."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fecm
from fecm.report.content import Answer, ReportError, ReportPage, render
from fecm.results.written import PageOptions
from tests.calls import assert_unusable, call, record_of
from tests.decks import DATA_CARDS, PROGRAM, small
from tests.pages import Page, read_page

pytest.importorskip("jinja2")
pytest.importorskip("matplotlib")

from fecm.report.report import page_of

DECK = small(
    PROGRAM.replace("LOOP         10", "LOOP        400"), data=DATA_CARDS + "UNIT\nmm N s\n"
)
FACTOR = 0.8  # measured over computed
DELAY, OFFSET = 1e-5, 3.0


@pytest.fixture(scope="module")
def run() -> fecm.Result:
    return fecm.run_one(DECK)


@pytest.fixture
def record(run: fecm.Result, tmp_path: Path) -> Path:
    """The force of the run times a factor, in ms and kN, late and with an offset."""
    rows = np.column_stack([1e3 * (run.time + DELAY), 1e-3 * (FACTOR * run.force + OFFSET)])
    path = tmp_path / "record.csv"
    head = "time (ms),force (kN)"
    np.savetxt(path, rows, "%.12g", ",", header=head, comments="")
    return path


@pytest.fixture
def overlays(monkeypatch: pytest.MonkeyPatch) -> list[dict[str, Any]]:
    """Options of the pictures of the force, which are not drawn."""
    given: list[dict[str, Any]] = []

    def undrawn(*_: object, **options: Any) -> Any:
        given.append(options)
        return iter(())

    for name in ("force", "forces", "drawn", "arranged"):
        monkeypatch.setattr(f"fecm.report.figures.{name}", undrawn)
    return given


def page(results: dict[str, Any], **options: Any) -> ReportPage:
    return page_of(results, options=PageOptions(**options))


def shown(results: dict[str, Any], **options: Any) -> Page:
    return read_page(render(page(results, **options)))


def test_ratios_are_computed_over_measured_after_delay_and_offset(
    run: fecm.Result, record: Path, overlays: list[dict[str, Any]]
) -> None:
    options: dict[str, Any] = {"measured": record, "delay": DELAY, "offset": OFFSET}
    found = shown({"run": run}, **options)
    for name in ("peak of the contact force", "impulse"):
        computed, measured, ratio = found.row(name)
        assert measured.value is not None
        assert computed.value == pytest.approx(measured.value / FACTOR, rel=1e-6)
        assert ratio.value == pytest.approx(1.0 / FACTOR, rel=1e-6)
    assert found.row("time above 5 % of the peak")[2].value == 1.0
    assert found.row("correlation")[0].value == pytest.approx(1.0, abs=1e-9)
    assert any(given.get("overlay") == record for given in overlays)
    assert "Measured force" in found.headings


def test_the_page_names_the_record_and_its_checksum(
    run: fecm.Result, record: Path, overlays: list[dict[str, Any]]
) -> None:
    found = shown({"run": run}, measured=record, delay=DELAY, offset=OFFSET)
    assert found.row("file")[0].text == "record.csv"
    assert found.row("SHA-256")[0].text == record_of(record)["sha256"]
    assert found.row("delay, subtracted")[0].value == DELAY


def test_the_head_says_the_ratios_and_a_doubt_about_the_trigger(
    run: fecm.Result, record: Path, overlays: list[dict[str, Any]]
) -> None:
    def answer(**options: Any) -> Answer:
        *_, last = page({"run": run}, measured=record, **options).verdict
        assert isinstance(last, Answer)
        return last

    right = answer(delay=DELAY, offset=OFFSET)
    assert (right.question, right.answer) == ("Computed over measured", "peak 1.25")
    assert "correlation 1.000" in right.rest
    late = answer(delay=-5.0 * DELAY, offset=OFFSET)
    assert "a delay of" in late.rest


def test_several_runs_have_a_row_each(
    run: fecm.Result, record: Path, overlays: list[dict[str, Any]]
) -> None:
    found = shown({"a": run, "b": run}, measured=record, delay=DELAY, offset=OFFSET)
    ratios = [found.row(f"impulse, {name}")[2].value for name in "ab"]
    assert ratios == pytest.approx([1.0 / FACTOR] * 2, rel=1e-6)


def test_the_command_takes_columns_and_units_of_a_record_without_names(
    run: fecm.Result, tmp_path: Path, overlays: list[dict[str, Any]]
) -> None:
    run.save(tmp_path / "run.h5")
    rows = np.column_stack([1e-3 * run.force, 1e3 * run.time])
    np.savetxt(tmp_path / "bare.csv", rows, "%.12g", ",")
    options = ("--measured", "bare.csv", "--columns", "2,1", "--units", "ms,kN")
    done = call("report", "run.h5", *options, cwd=tmp_path)
    assert done.exit_code == 0, done.stderr
    found = read_page((tmp_path / "run.html").read_text(encoding="utf-8"))
    assert found.row("peak of the contact force")[2].value == pytest.approx(1.0, rel=1e-6)


def test_a_measured_force_is_for_runs_and_its_description_for_a_measured_force(
    run: fecm.Result, record: Path, tmp_path: Path, overlays: list[dict[str, Any]]
) -> None:
    sweep = fecm.sweep(DECK, {"velocity": [50.0, 100.0]})
    with pytest.raises(ReportError, match="compared with results of runs only"):
        page({"sweep": sweep}, measured=record)
    with pytest.raises(ReportError, match="describe a measured force; give measured too"):
        page({"run": run}, delay=1.0)
    run.save(tmp_path / "run.h5")
    assert_unusable(call("report", "run.h5", "--offset", 1, cwd=tmp_path))
    assert not (tmp_path / "run.html").exists()
