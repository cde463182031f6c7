"""Pages about located impacts: place, verdict, gages, and the record."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

import fecm
from fecm.judge.limits import TrustLevel
from fecm.location.location import Candidate
from fecm.report.content import Answer, ReportPage, render
from tests.calls import assert_unusable, call, record_of
from tests.pages import read_page
from tests.panels import TIME, scatter, struck

pytest.importorskip("jinja2")
pytest.importorskip("matplotlib")

from fecm.report.location import judgements
from fecm.report.report import page_of

NEAR = (40.0, 30.0, 80.0, 65.0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A table of strains of the small panel, and the impact that it locates."""
    folder = tmp_path_factory.mktemp("located")
    deck, strains, *_ = struck()
    noisy, _ = scatter(strains, 0.02, seed=1)
    table = np.column_stack([TIME, noisy])
    head = ",".join(["time", *(f"gage {n + 1}" for n in range(noisy.shape[1]))])
    np.savetxt(folder / "strains.csv", table, "%.9g", ",", header=head, comments="")
    located = fecm.locate(deck, folder / "strains.csv", region=NEAR, grid=20.0, basis=9e-6)
    located.save(folder / "located.h5")
    return folder


@pytest.fixture
def location(folder: Path) -> fecm.Location:
    return fecm.load_location(folder / "located.h5")


@pytest.fixture
def _undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave the picture out, which takes most of the time."""
    monkeypatch.setattr("fecm.report.figures.drawn", lambda *_, **__: iter(()))


def answers_of(page: ReportPage) -> dict[str, str]:
    return {line.question: f"{line.answer}{line.rest}" for line in page.verdict
            if isinstance(line, Answer)}  # fmt: skip


def test_the_command_writes_a_page_with_the_picture_and_the_checksum_of_the_record(
    folder: Path,
) -> None:
    done = call("report", "located.h5", "-o", "located.html", cwd=folder)
    assert done.exit_code == 0
    shown = read_page((folder / "located.html").read_text(encoding="utf-8"))
    (picture,) = shown.pictures
    assert "95 % region" in picture["alt"]
    record = record_of(folder / "strains.csv")
    assert shown.row("record, SHA-256")[0].text == record["sha256"]
    assert shown.row("result, SHA-256")[0].text == record_of(folder / "located.h5")["sha256"]
    assert_unusable(call("report", "located.h5", "located.h5", cwd=folder))


@pytest.mark.usefixtures("_undrawn")
def test_the_head_has_the_place_with_its_deviation_and_the_verdict(
    location: fecm.Location,
) -> None:
    page = page_of({"located": location})
    figures = {figure.name: figure.value for figure in page.headlines}
    for axis in ("x", "y"):
        value = figures[axis]
        assert not isinstance(value, str)
        assert value.value == getattr(location, axis)
        number, digits = value.text.removesuffix(" mm").removesuffix(")").split("(")
        decimals = len(number.partition(".")[2])
        assert float(digits) * 10.0**-decimals == pytest.approx(
            getattr(location, f"sd_{axis}"), rel=0.3
        )
    assert answers_of(page)["Accepted"].startswith("yes")
    reach = np.linalg.norm(location.ellipse(0.95) - (location.x, location.y), axis=1).max()
    assert figures["95 % region"] == f"± {reach:.2g} mm"


@pytest.mark.usefixtures("_undrawn")
def test_a_rejected_location_begins_with_the_reason(location: fecm.Location) -> None:
    rejected = dataclasses.replace(location, accepted=False, notes=("the gages are swapped",))
    page = page_of({"located": rejected})
    assert page.level is TrustLevel.OUTSIDE
    assert answers_of(page)["Accepted"] == "no: the gages are swapped"


@pytest.mark.usefixtures("_undrawn")
def test_every_gage_has_what_the_force_leaves_of_its_strains(location: fecm.Location) -> None:
    shown = read_page(render(page_of({"located": location})))
    for number, measured, fitted in zip(
        location.gages.tolist(), location.strains, location.fitted, strict=True
    ):
        *_, largest, rms, left = shown.row(str(number))
        residual = measured - fitted
        assert largest.value == np.abs(measured).max()
        assert rms.value == pytest.approx(np.sqrt(np.mean(residual**2)))
        assert left.value == pytest.approx((residual**2).sum() / (measured**2).sum())


def test_a_second_place_that_is_nearly_as_good_is_doubtful(location: fecm.Location) -> None:
    rival = dataclasses.replace(location, second=Candidate(10.0, 10.0, 1.05))
    levels = {row.name: row.level for row in judgements(rival)}
    assert levels["misfit of a second place over the first"] is TrustLevel.DOUBTFUL
