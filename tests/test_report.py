"""Reports: one HTML page about results."""

from __future__ import annotations

import hashlib
import re
import sys
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import fecm
from fecm import Result
from fecm.deck.layup import layup_text, parse_layup
from fecm.deck.material_cards import Layer
from fecm.judge.criteria import ALL_CRITERIA
from fecm.report.content import render
from fecm.report.figures import stack
from fecm.report.report import page_of
from fecm.results.exposures import first_failures
from fecm.results.metrics import METRICS
from fecm.results.onset import energy_at_force
from fecm.results.summary import run_summary
from fecm.results.written import PageOptions
from tests.calls import assert_unusable, call, record_of
from tests.decks import LONG, ROOT, small
from tests.pages import Page, agrees, read_page
from tests.test_extensions import Dented
from tests.test_first_failure import failing

# A light projectile, whose contact ends within the run and passes the threshold.
LIGHT = "PROJ\n    0    0     4.E-6\nDELA\n       .02\nEXPE"


LIGHT_DECK = failing(steps=160).replace("EXPE", LIGHT, 1)


def page(**results: fecm.Result | fecm.SweepResult) -> Page:
    return read_page(render(page_of(results)))


@pytest.fixture
def _unrendered(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pages whose pictures are drawn, but not made into bytes, which takes most of the time."""
    monkeypatch.setattr("fecm.report.figures._bytes", lambda _, form: form.encode())


@pytest.fixture
def _undrawn(_unrendered: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """Pages without pictures of results."""
    for name in ("drawn", "force", "arranged"):
        monkeypatch.setattr(f"fecm.report.figures.{name}", lambda *_, **__: iter(()))


@pytest.fixture(scope="module")
def failed() -> Result:
    """A run whose plies fail and whose force passes the threshold."""
    return fecm.run_one(LIGHT_DECK)


@pytest.fixture(scope="module")
def html(failed: Result) -> str:
    return render(page_of({"failed": failed}))


@pytest.fixture(scope="module")
def shown(html: str) -> Page:
    return read_page(html)


def test_every_number_of_a_page_is_the_one_beside_its_text(shown: Page) -> None:
    cells = list(shown.numbers())
    assert len(cells) > 60
    assert [cell for cell in cells if not agrees(cell)] == []


def test_the_metrics_of_a_page_are_those_of_the_result(failed: Result, shown: Page) -> None:
    listed = {row[0].text.replace(" ", "_"): row[1] for row in shown.rows if len(row) == 3}
    metrics = {name: failed.metrics[name] for name in METRICS if name in listed}
    known = {name: value for name, value in metrics.items() if np.isfinite(value)}
    assert len(known) > 5
    assert {name: listed[name].value for name in known} == known
    assert all(listed[name].text == "–" for name in metrics.keys() - known.keys())


def test_figures_of_the_first_sheet_are_those_of_the_result(failed: Result, shown: Page) -> None:
    metrics, threshold = failed.metrics, float(failed.threshold["force"])
    first = first_failures(failed)[0]
    values = {name: shown.term(name)[0].value for name in (
        "peak force", "threshold", "energy for it", "contact", "first ply fails"
    )}  # fmt: skip
    assert values == {
        "peak force": metrics["peak_force"],
        "threshold": threshold,
        "energy for it": energy_at_force(failed, threshold),
        "contact": metrics["contact_time"],
        "first ply fails": first.force,
    }
    assert shown.term("first ply fails")[1].text == first.where


@pytest.mark.usefixtures("_undrawn")
def test_metrics_without_a_use_for_a_run_have_no_row(failed: Result) -> None:
    """One contact of an elastic law keeps nothing and is the first, the last and the peak."""
    elastic = re.sub(r"(?m)^ +1912000\..*$", "  1912000.       0.0       0.0       1.5", LIGHT_DECK)
    names = {row[0].text for row in page(one=fecm.run_one(elastic)).rows}
    useless = {"contacts", "peak contact", "first peak", "last contact", "contact loop"}
    assert not names & {*useless, "permanent indentation"}
    assert {"contact loop", "permanent indentation"} <= {
        row[0].text for row in page(one=failed).rows
    }


def test_a_reader_of_the_page_alone_learns_what_happened(failed: Result, shown: Page) -> None:
    first = first_failures(failed)[0]
    text = shown.text
    for said in (
        "Delaminates: YES , at the latest from",
        f"First failure: {first.where} , {first.mode} ({first.criterion.replace('_', ' ')}), from",
        "(elastic prediction; delamination is expected at the latest from 26.57, and the first ply "
        "fails before)",
        "reached at time",
        "What limits these figures, worst first",
        "doubtful",
        "elements per bending wave",
        "the deck",
        fecm.__version__,
        hashlib.sha256(failed.deck_text.encode()).hexdigest(),
    ):
        assert said.lower() in text.lower(), said
    assert all(note in text for note in failed.notes)


@pytest.mark.usefixtures("_undrawn")
def test_a_criterion_that_reaches_1_below_the_threshold_is_named_beside_it(failed: Result) -> None:
    tough = LIGHT.replace(".02", ".07")  # the threshold grows as the square root
    before = fecm.run_one(failing(steps=160).replace("EXPE", tough, 1))
    first = min(first_failures(before), key=lambda failure: failure.force)
    force = float(before.threshold["force"])
    assert float(failed.threshold["force"]) < first.force < force < before.force.max()
    text = f"{first.criterion.replace('_', ' ')} reaches 1 before, at {first.force:.4g}"
    assert f"for one delamination, as in DELA; {text})" in "\n".join(run_summary(before))
    assert page(run=before).row("criteria of plies and interfaces")[0].text == text
    assert "reaches 1 before" not in "\n".join(run_summary(failed))


@pytest.mark.usefixtures("_undrawn")
def test_verdict_figure_and_table_of_a_page_name_one_ply_for_the_first_failure(
    failed: Result,
) -> None:
    shown = page(failed=failed)
    start = shown.rows.index(next(row for row in shown.rows if row[-1].text == "given up by then"))
    criterion, mode, where = (cell.text for cell in shown.rows[start + 1][:3])
    assert f"First failure: {where} , {mode} ({criterion}), from" in shown.text
    assert shown.term("first ply fails")[1].text == where
    (summary,) = (line for line in run_summary(failed) if line.startswith("first failure"))
    assert f"{mode} ({criterion}), {where} at" in summary


def test_exposures_of_a_page_are_those_of_the_result(failed: Result, shown: Page) -> None:
    for name in ("hashin", "interlaminar"):
        largest = failed["exposures/exposure"][-1]
        assert shown.row(name)[0].value == pytest.approx(
            largest[ALL_CRITERIA.index(name)], rel=1e-12
        )


@pytest.mark.usefixtures("_unrendered")
def test_what_a_run_lacks_has_no_heading() -> None:
    report_page = page(small=fecm.run_one(small()))
    assert report_page.headings[1:] == [
        "What limits these figures, worst first",
        "Assumptions and sources",
        *("Trust", "Warnings about the deck", "Results", "Pictures", "Model", "Deck"),
    ]
    absent = {"Delamination threshold", "Largest exposures", "Ply strengths"}
    assert not absent & set(report_page.captions)
    assert "not judged" in report_page.text


@pytest.mark.usefixtures("_undrawn")
def test_a_run_without_impact_has_a_page() -> None:
    forces = "FORC\n   13    0       0.0       0.0       1.0\n\nROD"
    held = "   24    0    1    1    0    0    0\n   25    0    1    1    1    1    1\n"
    deck = small("DT         1.0\nTANG\nTIME\nFORM\nSOLV\nDISP\n").replace("ROD", forces, 1)
    deck = deck.replace("   25    0    1    1    0    0    0\n", held, 1)
    report_page = page(small=fecm.run_one(deck))
    assert "No impact: see Results." in report_page.text
    assert "Summary" in report_page.captions
    assert "at node" in report_page.row("largest w")[0].text


@pytest.mark.usefixtures("_undrawn")
def test_an_open_peak_is_a_lower_bound() -> None:
    result = fecm.run_one(small())
    report_page = page(small=result)
    assert report_page.row("largest force by the end")[0].value == result.force.max()
    assert report_page.row("end of the run")[1].text == "outside the model"
    assert report_page.row("peak force")[0].text == "–"


@pytest.mark.usefixtures("_undrawn")
def test_a_projectile_and_a_law_of_the_user_stand_for_those_of_the_deck() -> None:
    heavy = fecm.RigidMass(3e-3)
    result = fecm.run_one(small(), projectile=heavy, law=Dented())
    report_page = page(small=result)
    assert "RigidMass, instead of PROJ" in report_page.row("projectile")[0].text
    assert report_page.row("contact law")[0].text == "Dented, instead of EXPE"
    assert report_page.row("mass")[0].value is not None
    masses = [row[1].value for row in report_page.rows if row[0].text == "mass"]
    assert masses[-1] == pytest.approx(3e-3, rel=1e-12)
    assert "A mass of 0.003 at 115 (19.84)" in report_page.text


@pytest.mark.usefixtures("_undrawn")
def test_the_energy_of_a_run_with_slips_is_that_of_its_own_projectile() -> None:
    result = fecm.run_one(small(), mode="listing")
    report_page = page(small=result)
    initial = result.attributes_of("energy")["initial"]
    assert report_page.row("energy")[0].value == pytest.approx(initial, rel=1e-12)


@pytest.mark.usefixtures("_undrawn")
def test_the_constants_of_the_law_have_units_and_the_deck_its_warnings() -> None:
    report_page = page(small=fecm.run_one(small().replace("ROD", "UNIT\nin lbf s\nROD", 1)))
    assert report_page.row("contact coefficient k")[0].text == "1.912e+06 lbf/in^1.5"
    assert report_page.row("critical indentation alpha_p")[0].text == "0.0006564 in"
    assert "Warnings about the deck" in report_page.headings
    assert "[W415]" in report_page.text


@pytest.mark.usefixtures("_undrawn")
def test_a_result_without_a_readable_deck_has_a_page() -> None:
    result = fecm.run_one(small())
    bare = Result({name: result[name] for name in result}, {"deck": str(LONG)}, {})
    report_page = page(bare=bare)
    assert "Model" not in report_page.headings  # the text is no path that is followed
    assert "at least" in report_page.text or "Peak force" in report_page.text


@pytest.mark.usefixtures("_undrawn")
def test_a_long_deck_is_cut_with_a_word(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fecm.report.content.MOST_TEXT", 300)
    result = fecm.run_one(small())
    html = render(page_of({"small": result}, options=PageOptions(full_deck=True)))
    kept, left = re.findall(r"<pre[^>]*>(.*)\n\.\.\. (\d+) more lines", html, re.DOTALL)[0]
    assert result.deck_text.startswith(kept)
    assert kept.count("\n") + 1 + int(left) == result.deck_text.count("\n")


@pytest.mark.usefixtures("_undrawn")
def test_a_refinement_shows_its_limit_and_band() -> None:
    study = fecm.sweep(small().replace("10\nTIME", "60\nTIME"), refine=[1, 2])
    assert page(study=study).captions.count("Convergence with the mesh and the time step") == 1


@pytest.mark.usefixtures("_undrawn")
def test_foreign_texts_are_shown_as_text() -> None:
    title = "<script>alert('1')</script> & \x07\x1b[31m" + 270 * "x"
    result = fecm.run_one(small())
    result.attributes["title"] = title
    html = render(page_of({"<b>": result}))
    assert "<script" not in html
    assert "<b>" not in html
    assert "\x07" not in html
    assert "<script>alert('1')</script> & \\x07\\x1b[31m" in read_page(html).headings[0]


def test_a_page_fetches_nothing_and_runs_nothing(html: str, shown: Page) -> None:
    assert shown.addresses
    assert all(address.startswith(("data:image/", "#")) for address in shown.addresses)
    assert "url(" not in html
    assert not {"script", "link", "iframe", "object"} & set(shown.names)
    assert "default-src 'none'" in html


# Foreground and background; the limits of WCAG 2.2: 4.5 for text (1.4.3).
TEXTS = [
    ("text", "paper"),
    ("text", "shade"),
    *((name, "paper") for name in ("faint", "within", "doubtful", "outside", "unjudged")),
]


def luminance(color: str) -> float:
    """Relative luminance of a colour as ``#rrggbb``, as WCAG 2.2 defines it."""
    parts = (int(color[at : at + 2], 16) / 255 for at in (1, 3, 5))
    linear = (
        part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts
    )
    return float(np.dot((0.2126, 0.7152, 0.0722), list(linear)))


def test_text_stands_out_from_its_background_in_every_scheme() -> None:
    style = (files("fecm.report") / "page.css").read_text("utf-8")
    blocks = re.findall(r":root \{(.*?)\}", style, re.DOTALL)
    schemes = [dict(re.findall(r"--(\w+): (#\w{6});", block)) for block in blocks]
    assert len(schemes) == 3  # light, dark, paper
    for colors in schemes:
        for front, back in TEXTS:
            light, dark = sorted((luminance(colors[front]), luminance(colors[back])), reverse=True)
            assert (light + 0.05) / (dark + 0.05) >= 4.5, (front, back, colors)
    outside = re.sub(r":root \{.*?\}", "", style, flags=re.DOTALL)
    assert set(re.findall(r"(?<!-)color: ([^;]+);", outside)) <= {
        f"var(--{front})" for front, _ in TEXTS
    }
    assert set(re.findall("#[0-9a-f]{3,6}", outside)) == {"#ffffff"}  # behind pictures


def test_pictures_have_words_and_headings_their_order(shown: Page) -> None:
    assert len(shown.pictures) >= 6
    assert all(len(picture["alt"]) > 15 for picture in shown.pictures)
    assert len(set(shown.ids)) == len(shown.ids)
    assert shown.names.count("h1") == shown.names.count("main") == 1


def same_again() -> str:
    return render(page_of({"failed": fecm.run_one(failing(steps=160).replace("EXPE", LIGHT, 1))}))


@pytest.mark.usefixtures("_unrendered")
@pytest.mark.long
def test_equal_results_give_equal_pages() -> None:
    assert same_again() == same_again()


@pytest.mark.long  # the bytes of pictures alone are compared in the tests of pictures
def test_equal_results_give_equal_bytes(html: str) -> None:
    assert same_again() == html


@pytest.mark.usefixtures("_unrendered")
def test_several_runs_stand_side_by_side(failed: Result) -> None:
    other = fecm.run_one(small())
    report_page = page(one=failed, other=other)
    assert [cell.value for cell in report_page.row("velocity")] == [115.0, 115.0]
    assert [cell.text for cell in report_page.row("elements")] == ["4", "4"]
    peaks = [cell.text for cell in report_page.row("peak force")][:2]
    assert peaks == [f"{failed.force.max():.4g}", "–"]  # the other ends in contact
    assert report_page.row("kinematics")[1].text == "linear"
    assert report_page.pictures


@pytest.mark.usefixtures("_undrawn")
def test_columns_and_regions_of_a_page_have_names_of_their_own(failed: Result) -> None:
    other = fecm.run_one(small())
    by_name = {"peak force": failed, "plate": other}  # names of rows too
    for results in (by_name, {"one": failed}):
        html = render(page_of(results))
        regions = re.findall(r'role="region" aria-label="([^"]*)"', html)
        assert len(regions) > 3
        assert len(set(regions)) == len(regions)
        assert not re.search(r"<th[^>]*>\s*</th>", html)


def test_results_in_different_units_have_no_common_pictures(failed: Result) -> None:
    other = fecm.run_one(small().replace("ROD", "UNIT\nin lbf s\nROD", 1))
    report_page = page(one=failed, other=other)
    assert not report_page.pictures
    assert "different units" in report_page.text


@pytest.fixture(scope="module")
def sweep() -> fecm.SweepResult:
    return fecm.sweep(LONG, {"velocity": [50.0, 80.0, 400.0], "k": [1e6, 2e6]})


@pytest.mark.usefixtures("_undrawn")
def test_the_page_of_a_sweep_has_its_extremes(sweep: fecm.SweepResult) -> None:
    report_page = page(sweep=sweep)
    row = report_page.row("max indentation")
    values = sweep["max_indentation"]
    assert [row[0].value, row[2].value] == [values.min(), values.max()]
    assert row[3].text == f"{values.argmax()}: velocity 400, k 1e+06"
    assert report_page.row("velocity")[1].text == "50, 80, 400"
    assert "6 cases" in report_page.text
    assert all(agrees(cell) for cell in report_page.numbers())
    beyond = "indentation > h/4"
    assert report_page.row("cases without a doubt")[0].value == (sweep.validity == "ok").sum()
    assert beyond not in report_page.text


@pytest.mark.usefixtures("_unrendered")
def test_the_page_of_a_random_sweep_has_its_probabilities() -> None:
    swept = fecm.sweep(
        LONG,
        random={"velocity": "normal:115,5", "k": "lognormal:1.9e6,0.1"},
        samples=16,
        exceed={"peak_force": 85.0},
    )
    shown = page(random=swept)
    assert swept.random is not None
    exceedance = swept.random.exceedance
    row = shown.row("peak force")
    chances = [row_.value for row_ in [r for r in shown.rows if len(r) == 7][-1][2:5]]
    assert chances == [exceedance.probability[0], exceedance.lower[0], exceedance.upper[0]]
    assert row
    assert shown.row("samples")[0].text == "16"
    assert shown.row("velocity")[1].text == "normal:115,5"
    assert len(shown.pictures) >= 2


@pytest.mark.usefixtures("_undrawn", "_unrendered")
def test_the_page_of_a_sensitivity_study_tells_samples_draws_and_cases() -> None:
    """Saltelli's design of two names: 16 samples, two draws of each, and 16 (2 + 2) cases."""
    laws = {"velocity": "normal:115,5", "k": "lognormal:1.9e6,0.1"}
    swept = fecm.sweep(LONG, random=laws, samples=16, sensitivity=True)
    shown = page(random=swept)
    counts = [shown.row(name)[0].text.split(",")[0] for name in ("draws", "cases")]
    assert counts == ["32", "64"]


@pytest.mark.usefixtures("_undrawn")
def test_a_fit_has_a_page(tmp_path: Path) -> None:
    output = tmp_path / "fit.html"
    deck = small().replace(" 10\nTIME", "160\nTIME").replace("ROD", "UNIT\nin lbf s\nROD", 1)
    (tmp_path / "deck.inp").write_text(deck)
    run = fecm.run_one(deck)
    measured = run.force + 2.0 * np.sin(np.arange(160.0) / 5.0)  # with a note
    rows = np.column_stack([run.time, measured])
    np.savetxt(tmp_path / "f.csv", rows, delimiter=",", header="time,force", comments="")
    done = call(
        "identify", "deck.inp", "f.csv", "--free", "k,velocity", "--filter", "first-order:1e-8",
        "--report", output, cwd=tmp_path,
    )  # fmt: skip
    assert done.exit_code == 0, done.stderr
    actual = read_page(output.read_text("utf-8"))
    k = actual.row("k")
    said = re.search(r"^ +k +(\S+) lbf/in\^1.5 +(\S+) lbf/in\^1.5 ", done.stdout, re.MULTILINE)
    assert said is not None
    assert [float(f"{k[0].value:.5g}"), float(f"{k[1].value:.2g}")] == [
        float(text) for text in said.groups()
    ]
    assert "1 % more" in " ".join(actual.captions)
    assert actual.row("record, SHA-256")[0].text == record_of(tmp_path / "f.csv")["sha256"]
    assert all(agrees(cell) for cell in actual.numbers())


@pytest.mark.usefixtures("_undrawn")
def test_the_head_has_the_particulars_and_the_logo_that_are_given(
    runs: Path, tmp_path: Path
) -> None:
    (tmp_path / "mark.svg").write_text('<svg xmlns="http://www.w3.org/2000/svg"/>')
    title = 'Plate "7" </style> \\'
    given = {"client": "A & B", "specimen": "117", "date": "28 Nov 2026"}
    options = [word for name, text in given.items() for word in (f"--{name}", text)]
    output = ("-o", "page.html", "--title", title, "--logo", "mark.svg")
    done = call("report", runs / "report.h5", *options, *output, cwd=tmp_path)
    assert done.exit_code == 0, done.stderr
    html = (tmp_path / "page.html").read_text("utf-8")
    shown = read_page(html)
    assert shown.headings[0] == title
    assert all(f"{name} {text}" in shown.text for name, text in given.items())
    (logo,) = (picture for picture in shown.pictures if picture["alt"] == "logo")
    assert logo["src"].startswith("data:image/svg+xml;base64,")
    # Only letters and digits are unescaped in the style.
    assert r"Plate\20 \22 7\22 \20 \3c \2f style\3e \20 \5c " in html
    result = fecm.load(runs / "report.h5")
    logo_file = tmp_path / "mark.svg"
    result.report(tmp_path / "again.html", title=title, logo=logo_file, specimen="117")
    again = read_page((tmp_path / "again.html").read_text("utf-8"))
    assert (again.headings[0], again.pictures[0]) == (title, shown.pictures[0])


@pytest.mark.usefixtures("_undrawn")
def test_the_command_writes_the_page_with_the_checksum_of_the_file(
    runs: Path, tmp_path: Path
) -> None:
    done = call("report", runs / "report.h5", cwd=tmp_path)
    assert (done.exit_code, done.stdout) == (0, "report.html\n"), done.stderr
    text = (tmp_path / "report.html").read_text("utf-8")
    assert hashlib.sha256((runs / "report.h5").read_bytes()).hexdigest() in text
    assert_unusable(again := call("report", runs / "report.h5", cwd=tmp_path))
    assert "--overwrite" in again.stderr
    assert call("report", runs / "report.h5", "--overwrite", cwd=tmp_path).exit_code == 0
    assert (tmp_path / "report.html").read_text("utf-8") == text


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["report.h5", "-o", "page.pdf"], "is written as .html"),
        (["no.h5"], "no.h5: No such file"),
        (["deck.inp"], "deck.inp"),
        (["report.h5", "report.h5"], "given twice"),
        (["report.h5", "-o", "no/page.html"], "there is no folder"),
        (["report.h5", "--logo", "deck.inp"], "a logo is a picture in .png"),
        (["report.h5", "--logo", "no.png"], "no.png: the logo can't be read: No such file"),
    ],
)
def test_wrong_calls_are_refused_and_nothing_is_written(
    runs: Path, tmp_path: Path, arguments: list[str], said: str
) -> None:
    (tmp_path / "deck.inp").write_text(small())
    (tmp_path / "report.h5").write_bytes((runs / "report.h5").read_bytes())
    assert_unusable(done := call("report", *arguments, cwd=tmp_path))
    assert said in done.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["deck.inp", "report.h5"]


def test_without_jinja2_one_line_says_what_to_install(
    runs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "jinja2", None)
    assert_unusable(done := call("report", runs / "report.h5", cwd=tmp_path))
    assert "pip install 'fecm[report]'" in done.stderr


@pytest.mark.parametrize(
    ("angles", "said"),
    [
        ([0, 45, 90, -45] * 2 + [-45, 90, 45, 0] * 2, "[0/45/90/-45]2s"),
        ([0, 90], "[0/90]"),
        ([0, 0, 90, 0, 0, 90], "[0_2/90]2"),
        ([30], "[30]"),
        ([22.5, -22.5, 22.5], "[22.5/-22.5/22.5]"),
    ],
)
def test_layups_are_said_in_the_usual_notation(angles: list[float], said: str) -> None:
    assert layup_text(angles) == said


@given(
    st.lists(st.sampled_from([0.0, 45.0, -45.0, 90.0, 22.5]), min_size=1, max_size=8),
    st.integers(1, 3),
    st.booleans(),
)
def test_the_notation_of_a_layup_is_read_back(
    plies: list[float], times: int, mirrored: bool
) -> None:
    angles = plies * times
    angles = angles + angles[::-1] if mirrored else angles
    assert parse_layup(layup_text(angles)) == angles


@pytest.mark.usefixtures("_undrawn")
def test_a_static_result_beyond_the_linear_plate_is_outside_the_model() -> None:
    result = fecm.run_one(ROOT / "decks" / "static-bending.inp")
    assert "464 h" in result.notes[0]
    assert page(static=result).row("notes of the run")[1].text == "outside the model"


@pytest.mark.usefixtures("_undrawn")
def test_the_time_step_is_judged_by_the_critical_one() -> None:
    row = page(one=fecm.run_one(small())).row("time step")
    assert row[1].text == "within range"
    unstable = fecm.run_one(small().replace(".5E-6", "8.E-7"), force=True)
    assert page(one=unstable).row("time step")[1].text == "outside the model"


@pytest.mark.usefixtures("_undrawn")
@pytest.mark.parametrize(("thickness", "word"), [(0.02, "doubtful"), (0.001, "within range")])
def test_the_shear_stiffness_of_a_thick_laminate_is_doubtful(thickness: float, word: str) -> None:
    deck = fecm.impact(
        fecm.Plate.rectangle((1, 1), (2, 2), support="simple"),
        fecm.Laminate("[0/90]s", fecm.Ply(1.0, 0.3, 25.0, 1.0, 0.5, 0.5, 0.2), thickness),
        fecm.RigidMass(1.0),
        fecm.Contact(1.0, 0.0, 0.0, 1.5),
        velocity=1e-3,
        duration=0.02,
        kinematics="linear",
        shear_factor=1.0,
    )
    assert page(one=fecm.run_one(deck)).row("transverse shear factor 1")[1].text == word


@pytest.mark.usefixtures("_unrendered")
@pytest.mark.parametrize(("most", "kinds"), [(10**9, {"svg+xml"}), (0, {"svg+xml", "png"})])
def test_pictures_with_many_lines_are_made_of_pixels(
    most: int, kinds: set[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A mesh is a collection of lines, a history is a single one."""
    monkeypatch.setattr("fecm.report.figures.LARGEST", most)
    html = render(page_of({"one": fecm.run_one(small())}))
    assert set(re.findall(r"data:image/([a-z+]+);", html)) == kinds


@pytest.mark.usefixtures("_undrawn")
def test_what_a_run_that_is_cut_off_has_not_reached_is_doubtful() -> None:
    row = page(one=fecm.run_one(failing(steps=6))).row("largest exposure")
    assert row[1].text == "doubtful"
    assert "as the run ends in contact" in row[2].text


@pytest.mark.usefixtures("_undrawn")
def test_a_result_without_a_readable_deck_is_doubtful() -> None:
    result = fecm.run_one(small())
    result.deck_text = ""
    assert page(one=result).row("deck")[1].text == "doubtful"


@pytest.mark.usefixtures("_undrawn")
def test_the_range_of_a_sweep_says_how_many_cases_have_it() -> None:
    sweep = fecm.sweep(small(), {"velocity": [50.0, 80.0], "duration": [2e-6, 4e-4]})
    known = int(np.isfinite(sweep["peak_force"]).sum())
    assert f"in the {known} of 4 cases that have it" in page(sweep=sweep).text


def test_each_ply_of_the_stack_has_its_angle_in_its_middle() -> None:
    thicknesses = (0.5, 0.25, 1.0)
    layers = [
        Layer(n, angle, t)
        for n, (angle, t) in enumerate(zip((0, 45, 90), thicknesses, strict=True), 1)
    ]
    (axes,) = stack(layers, {}).axes
    labels = [(text.get_text(), text.get_position()[1]) for text in axes.texts]
    assert labels == [("0°", 0.25), ("45°", 0.625), ("90°", 1.25)]
