"""Reports in a real browser, on paper, and before a validator of HTML."""

from __future__ import annotations

import io
import os
import re
import shutil
import subprocess
import sys
import unicodedata
from pathlib import Path

import pytest

import fecm
from fecm.report.content import render
from fecm.report.report import page_of
from fecm.results.written import PageOptions
from tests.browser import Browser
from tests.calls import call
from tests.decks import LONG, small
from tests.pages import read_page
from tests.panels import TIME, scatter, struck
from tests.test_first_failure import failing

KINDS = ("run", "d7136", "measured", "runs", "sweep", "tests", "random", "location", "fit")
LARGEST = 1_500_000  # bytes of a page
AA = 4.5  # contrast of text, WCAG 2.2, success criterion 1.4.3
A4 = (595.0, 842.0)  # points
PAPER = (680, 998)  # pixels of A4 within its margins, of which 96 make an inch
MARKS = re.compile("[●▲■○]")  # before verdicts, drawn by the style
LONG_TITLE = "<b>" + 300 * "x"

# Colours of every text and of what lies behind it.
COLOURS = """
[...new Set([...document.querySelectorAll("body *")]
  .filter(one => [...one.childNodes].some(node => node.nodeType === 3 && node.data.trim()))
  .map(one => {
    let behind = one;
    const clear = "rgba(0, 0, 0, 0)";
    while (behind && getComputedStyle(behind).backgroundColor === clear)
      behind = behind.parentElement;
    const paper = behind ? getComputedStyle(behind).backgroundColor : "none";
    return getComputedStyle(one).color + "/" + paper;
  }))]
"""

# Words of letters that go on in the next line; longer ones may have to.
BROKEN = r"""
(() => {
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  const range = document.createRange();
  const broken = [];
  while (walker.nextNode()) {
    for (const word of walker.currentNode.data.matchAll(/\b[A-Za-z]{2,14}\b/g)) {
      range.setStart(walker.currentNode, word.index);
      range.setEnd(walker.currentNode, word.index + word[0].length);
      const lines = Array.from(range.getClientRects(), box => box.top);
      if (new Set(lines).size > 1) broken.push(word[0]);
    }
  }
  return broken;
})()
"""

# Pictures with something dark in their outermost pixels: it goes on beyond them.
CUT = """
Array.from(document.images).filter(image => {
  const [width, height] = [image.naturalWidth, image.naturalHeight];
  const canvas = Object.assign(document.createElement("canvas"), {width, height});
  const context = canvas.getContext("2d");
  context.fillStyle = "white";
  context.fillRect(0, 0, width, height);
  context.drawImage(image, 0, 0);
  const edges = [
    [0, 0, width, 1], [0, height - 1, width, 1], [0, 0, 1, height], [width - 1, 0, 1, height],
  ];
  return edges.some(edge => context.getImageData(...edge).data.some(part => part < 200));
}).map(image => image.alt)
"""

pytestmark = pytest.mark.browser


def random_sweep() -> fecm.SweepResult:
    """A small sweep over random velocities and stiffnesses."""
    laws = {"velocity": "normal:115,5", "k": "lognormal:1.9e6,0.1"}
    return fecm.sweep(LONG, random=laws, samples=16, exceed={"peak_force": 85.0})


def located() -> fecm.Location:
    """An impact on a small panel, located near its place."""
    deck, strains, *_ = struck()
    noisy, _ = scatter(strains, 0.02, seed=1)
    return fecm.locate(deck, (TIME, noisy), region=(40.0, 30.0, 80.0, 65.0), grid=20.0, basis=9e-6)


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A page of every kind, as files."""
    folder = tmp_path_factory.mktemp("pages")
    run = fecm.run_one(failing(steps=160).replace("EXPE", "DELA\n       .02\nEXPE", 1))
    run.attributes["title"] = LONG_TITLE
    measured = fecm.examples.path("measured-force.csv")
    replay = fecm.run_one(fecm.examples.path("impact-patch.inp"))
    html = render(page_of({"replay": replay}, options=PageOptions(measured=measured)))
    (folder / "measured.html").write_text(html, encoding="utf-8", newline="\n")
    drop_weight, tests = (
        fecm.examples.path(name) for name in ("drop-weight-held.inp", "tests.csv")
    )
    results = {
        "run": {"run": run},
        "tests": {"tests": fecm.sweep(drop_weight, cases=tests)},
        "location": {"located": located()},
        "d7136": {"drop-weight": fecm.run_one(fecm.examples.path("drop-weight.inp"))},
        "runs": {"one": run, "other": fecm.run_one(small())},
        "sweep": {"map": fecm.sweep(LONG, {"velocity": [50.0, 80.0, 400.0], "k": [1e6, 2e6]})},
        "random": {"random": random_sweep()},
    }
    for kind, given in results.items():
        html = render(page_of(given))  # type: ignore[arg-type]
        (folder / f"{kind}.html").write_text(html, encoding="utf-8", newline="\n")
    example = [fecm.examples.path(name) for name in ("impact-patch.inp", "measured-force.csv")]
    done = call(
        "identify", *example, "--free", "k,velocity", "--report", folder / "fit.html", cwd=folder
    )
    assert done.exit_code == 0, done.stderr
    return {kind: folder / f"{kind}.html" for kind in KINDS}


def contrast(text: str, paper: str) -> float:
    """Contrast of two colours, as WCAG defines it."""
    first, second = sorted((_luminance(text), _luminance(paper)))
    return (second + 0.05) / (first + 0.05)


def _luminance(colour: str) -> float:
    """Relative luminance of ``rgb(r, g, b)``."""
    shares = [int(number) / 255 for number in re.findall(r"\d+", colour)]
    assert len(shares) == 3, colour
    linear = [s / 12.92 if s <= 0.04045 else ((s + 0.055) / 1.055) ** 2.4 for s in shares]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def packed(text: str) -> str:
    """A text without spaces, and without the ligatures that fonts put in."""
    return "".join(unicodedata.normalize("NFKC", text).split())


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [390, 1400])
@pytest.mark.parametrize("kind", KINDS)
def test_a_page_asks_for_nothing_complains_of_nothing_and_fits_the_window(
    pages: dict[str, Path], browser: Browser, kind: str, width: int, scheme: str
) -> None:
    browser.open(pages[kind], width=width, scheme=scheme)
    assert browser.requests() == [pages[kind].as_uri()]
    assert browser.complaints() == []
    assert browser.value("document.documentElement.scrollWidth") == width
    assert browser.value("[...document.images].every(one => one.naturalWidth > 0)")
    assert browser.value(BROKEN) == []
    dark = _luminance(browser.value("getComputedStyle(document.body).backgroundColor")) < 0.2
    assert dark == (scheme == "dark")


@pytest.mark.parametrize("kind", KINDS)
def test_reasons_of_judgements_are_in_sight_on_a_telephone(
    pages: dict[str, Path], browser: Browser, kind: str
) -> None:
    browser.open(pages[kind], width=390)
    ends = browser.value(
        '[...document.querySelectorAll(".judgements td.words")].map(one => '
        "one.getBoundingClientRect().right)"
    )
    assert all(end <= 390 for end in ends)
    assert ends or kind == "fit"


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("kind", KINDS)
def test_every_text_has_the_contrast_of_wcag_aa(
    pages: dict[str, Path], browser: Browser, kind: str, scheme: str
) -> None:
    browser.open(pages[kind], scheme=scheme)
    pairs = [tuple(pair.split("/")) for pair in browser.value(COLOURS)]
    assert len(pairs) >= 3
    assert {pair: contrast(*pair) for pair in pairs if contrast(*pair) < AA} == {}


@pytest.mark.parametrize("kind", KINDS)
def test_a_page_is_the_same_without_scripts(
    pages: dict[str, Path], browser: Browser, kind: str
) -> None:
    browser.open(pages[kind])
    with_scripts = browser.do("Page.captureScreenshot", captureBeyondViewport=True)
    browser.do("Emulation.setScriptExecutionDisabled", value=True)
    try:
        browser.open(pages[kind])
        without = browser.do("Page.captureScreenshot", captureBeyondViewport=True)
    finally:
        browser.do("Emulation.setScriptExecutionDisabled", value=False)
    assert without == with_scripts


@pytest.mark.parametrize(("width", "columns"), [(390, 2), (1400, 6), (PAPER[0], 6)])
def test_the_figures_of_the_first_sheet_stand_in_columns(
    pages: dict[str, Path], browser: Browser, width: int, columns: int
) -> None:
    browser.open(pages["d7136"], width=width, media="print" if width == PAPER[0] else "screen")
    lefts = browser.value(
        '[...document.querySelectorAll(".headlines > div")].map(one => '
        "Math.round(one.getBoundingClientRect().left))"
    )
    assert len(lefts) == 6
    assert len(set(lefts)) == columns


@pytest.mark.parametrize(
    ("scheme", "media", "is_dark"),
    [("light", "screen", False), ("dark", "screen", True), ("dark", "print", False)],
)
def test_pictures_are_dark_on_a_dark_screen_and_light_on_paper(
    pages: dict[str, Path], browser: Browser, scheme: str, media: str, is_dark: bool
) -> None:
    browser.open(pages["d7136"], scheme=scheme, media=media)
    filters = browser.value(
        '[...document.querySelectorAll("figure img")].map(one => getComputedStyle(one).filter)'
    )
    assert len(filters) >= 5
    assert {text.startswith("invert(") for text in filters} == {is_dark}


def test_a_run_takes_at_most_eight_sheets_and_its_answers_stand_on_the_first(
    pages: dict[str, Path], browser: Browser
) -> None:
    pypdf = pytest.importorskip("pypdf", reason="pypdf reads the printed page")
    browser.open(pages["d7136"], width=PAPER[0], media="print")
    sheets = pypdf.PdfReader(io.BytesIO(browser.pdf())).pages
    assert len(sheets) <= 8
    first, second = (packed(sheet.extract_text()) for sheet in sheets[:2])
    for said in ("Delaminates:", "Firstfailure:", "peakforce", "Whatlimitsthesefigures"):
        assert said in first
    assert "Assumptionsandsources" in second


def test_the_contents_lead_to_every_section(pages: dict[str, Path], browser: Browser) -> None:
    browser.open(pages["d7136"])
    titles = browser.value(
        '[...document.querySelectorAll("nav a")].map(one => '
        "[one.textContent, document.querySelector(one.hash).textContent])"
    )
    assert len(titles) >= 5
    assert all(link == heading for link, heading in titles)


@pytest.mark.parametrize("kind", KINDS)
def test_on_paper_no_row_is_cut_and_no_picture(
    pages: dict[str, Path], browser: Browser, kind: str
) -> None:
    pypdf = pytest.importorskip("pypdf", reason="pypdf reads the printed page")
    browser.open(pages[kind], width=PAPER[0], media="print")
    sizes = browser.value(
        '[...document.querySelectorAll("figure")].map(one => '
        "[one.getBoundingClientRect().right, one.getBoundingClientRect().height])"
    )
    assert all(right <= PAPER[0] + 1 and height <= PAPER[1] for right, height in sizes)
    assert browser.value("document.documentElement.scrollWidth") == PAPER[0]
    assert browser.value(BROKEN) == []
    assert browser.value(
        '[...document.querySelectorAll("pre")].every(one => one.checkVisibility())'
    )
    printed = pypdf.PdfReader(io.BytesIO(browser.pdf())).pages
    assert len(printed) >= 2
    for number, sheet in enumerate(printed, start=1):
        assert sheet.extract_text().startswith(f"{number} of {len(printed)}")
    for sheet in printed:
        assert [float(side) for side in sheet.mediabox[2:]] == pytest.approx(A4, abs=1.0)
    texts = [packed(MARKS.sub("", sheet.extract_text())) for sheet in printed]
    rows = ["".join(cell.text for cell in row) for row in read_page(pages[kind].read_text()).rows]
    assert len(rows) > 10
    assert [row for row in rows if not any(packed(row) in text for text in texts)] == []


@pytest.mark.parametrize("kind", KINDS)
def test_what_a_picture_shows_ends_before_its_edge(
    pages: dict[str, Path], browser: Browser, kind: str
) -> None:
    browser.open(pages[kind])
    assert browser.value(CUT) == []


def test_these_tests_notice_a_request_a_refused_one_and_a_broken_word(
    browser: Browser, tmp_path: Path
) -> None:
    style = (tmp_path / "other.css").as_uri()
    link = f"<link rel=stylesheet href={style}>"
    page = tmp_path / "page.html"
    page.write_text(f"{link}<p style='width: 2em; overflow-wrap: anywhere'>interlaminar</p>")
    browser.open(page)
    assert style in browser.requests()
    assert browser.value(BROKEN) == ["interlaminar"]
    policy = "style-src 'unsafe-inline'"
    page.write_text(f'<meta http-equiv=Content-Security-Policy content="{policy}">{link}')
    browser.open(page)
    assert "Content Security Policy" in str(browser.complaints())


def test_another_process_writes_the_same_bytes(pages: dict[str, Path], tmp_path: Path) -> None:
    code = (
        "import sys; from pathlib import Path; from tests import test_browser as here;"
        "html = here.render(here.page_of({'random': here.random_sweep()}));"
        "Path(sys.argv[1]).write_text(html, encoding='utf-8', newline='')"
    )
    root = str(Path(__file__).parents[1])
    command = [sys.executable, "-W", "ignore", "-c", code, str(tmp_path / "again.html")]
    subprocess.run(command, check=True, cwd=root, env=os.environ | {"PYTHONHASHSEED": "7"})
    assert (tmp_path / "again.html").read_bytes() == pages["random"].read_bytes()


@pytest.mark.parametrize("kind", KINDS)
def test_a_page_is_small_enough_for_a_letter(pages: dict[str, Path], kind: str) -> None:
    assert pages[kind].stat().st_size < LARGEST


def test_a_validator_of_html_finds_no_error(pages: dict[str, Path]) -> None:
    jar, java = os.environ.get("VNU_JAR"), shutil.which("java")
    if not (jar and java):
        pytest.skip("no java, or VNU_JAR does not name the Nu HTML checker (npm install vnu-jar)")
    command = [java, "-jar", jar, "--errors-only", "--stdout", *map(str, pages.values())]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert (done.returncode, done.stdout) == (0, ""), done.stderr
