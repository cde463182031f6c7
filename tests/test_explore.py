"""Pages on which an impact follows sliders: what is refused, what is in them, and their numbers."""

from __future__ import annotations

import base64
import hashlib
import json
import re
import shlex
import time
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import pytest

import fecm
from fecm.authoring.case import CasesError
from fecm.exploration.explore import Exploration
from fecm.exploration.page import page, script_json
from fecm.problem.loading import load_one
from tests.browser import Browser, find_browser
from tests.calls import call
from tests.decks import small
from tests.test_browser import AA, BROKEN, COLOURS, _luminance, contrast
from tests.test_reduced_sweeps import DECK as STRETCHING

HELD = fecm.examples.path("drop-weight-held.inp")
HOSTILE = (
    "</script><script>alert(1)</script><img src=http://a.invalid/x onerror=alert(2)> {{kernel}}"
)


def units(deck: str) -> str:
    """A deck in mm, N and s."""
    return deck.replace("EXPE", "UNIT\nmm N s\nEXPE", 1)


class Elements(HTMLParser):
    """Scripts of a page, with their attributes and texts, and names of all elements."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.scripts: list[tuple[dict[str, str | None], str]] = []
        self.names: list[str] = []
        self.addresses: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Keep the name and the addresses of an element."""
        self.names.append(tag)
        self.addresses += [value or "" for name, value in attrs if name in ("src", "href")]
        if tag == "script":
            self.scripts.append((dict(attrs), ""))

    def handle_data(self, data: str) -> None:
        """Keep the text of a script."""
        if self.scripts and self.names[-1] == "script" and not self.scripts[-1][1]:
            self.scripts[-1] = (self.scripts[-1][0], data)


def drawn(title: str) -> str:
    """A page of data that only has a title."""
    return page({"title": title}, np.arange(1.0, 4.0), np.array([1.0, 2.0, 0.5]))


def test_a_hostile_title_is_text_of_the_page_and_no_element() -> None:
    fair, hostile = Elements(drawn("plate")), Elements(drawn(HOSTILE))
    assert hostile.names == fair.names
    assert [address[:5] for address in hostile.addresses] == ["data:"]
    (data,) = (text for about, text in hostile.scripts if about.get("id") == "data")
    assert json.loads(data)["title"] == HOSTILE
    assert "<" not in data


def test_no_text_in_the_data_ends_their_element() -> None:
    assert "<" not in script_json({"<!--": ["</script>", "<script>"]})
    assert json.loads(script_json({"<!--": "</script>"})) == {"<!--": "</script>"}


def test_the_policy_allows_the_script_and_the_style_of_the_page_alone() -> None:
    text = drawn("plate")
    (policy,) = re.findall(r'Content-Security-Policy" content="([^"]*)"', text)
    (script,) = (body for about, body in Elements(text).scripts if not about)
    (style,) = re.findall(r"<style>(.*?)</style>", text, re.S)
    for kind, body in (("script", script), ("style", style)):
        digest = base64.b64encode(hashlib.sha256(body.encode()).digest()).decode()
        assert re.search(rf"{kind}-src 'sha256-{re.escape(digest)}'", policy)
    assert "default-src 'none'" in policy
    assert not re.search(
        "https?:|unsafe-inline|unsafe-eval'", policy.replace("wasm-unsafe-eval", "")
    )


@pytest.mark.parametrize(
    ("deck", "vary", "words"),
    [
        (small().replace("ROD\n", "UNIL\n13,0,1,0.,0.\n\nROD\n", 1), None, "has UNIL"),
        (small(), "k=1e5,2e5", "k does not change the plate"),
        (small().replace("3     115.0", "3       0.0"), None, "must not be 0"),
        (small().replace("RODP", "EXCD\nRODP", 1), None, "other steps"),
    ],
)
def test_what_a_page_cannot_superpose_is_refused_before_anything_is_computed(
    deck: str, vary: str | None, words: str
) -> None:
    with pytest.raises(fecm.errors.ExploreError, match=words):
        fecm.explore(deck, vary)


def test_plates_of_more_bytes_than_a_page_may_have_are_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("fecm.exploration.explore.MOST", 100)
    with pytest.raises(fecm.errors.ExploreError, match="leave out values of `vary`"):
        _ = fecm.explore(small()).html


def data_of(page: Exploration) -> dict[str, Any]:
    """Data of a page."""
    (text,) = (body for about, body in Elements(page.html).scripts if about.get("id") == "data")
    data: dict[str, Any] = json.loads(text)
    return data


def test_a_stretching_plate_says_how_far_its_modes_are_from_full_runs() -> None:
    (plate,) = data_of(fecm.explore(STRETCHING))["plates"]
    (bound,) = (bound for bound in plate["bounds"] if bound["of"] == "energy")
    full = fecm.run_one(STRETCHING)
    energy = full.energy["projectile_kinetic"][0]
    assert plate["function"] == "fecm_reduced"
    assert bound["most"] == pytest.approx(5.0 * energy, rel=1e-3)  # the end of the slider
    swept = fecm.sweep(STRETCHING, {"velocity": [600.0]}, model="reduced")
    difference = f"{swept['peak_force'][0] / full.peak_force - 1.0:+.1%}"
    assert re.findall(r"(\S+%) at", bound["words"])[0] == difference


def test_a_page_says_of_a_deflection_what_a_run_says() -> None:
    (plate,) = data_of(fecm.explore(HELD))["plates"]
    beyond = next(bound["beyond"] for bound in plate["bounds"] if bound["of"] == "highest")
    judge = load_one(HELD).judge
    for ratio in (0.31, 0.533, 0.72, 1.9, 4.98, 7.0):
        assert [text for least, text in beyond if least <= ratio][-1] == judge.softness(ratio)


def test_the_command_says_that_a_stretching_plate_takes_full_runs(tmp_path: Path) -> None:
    (tmp_path / "plate.inp").write_text(STRETCHING)
    (tmp_path / "linear.inp").write_text(small())
    said = call("explore", "plate.inp", cwd=tmp_path).stderr
    assert "full runs of each plate" in said
    assert "full runs" not in call("explore", "linear.inp", cwd=tmp_path).stderr


def test_a_stretching_plate_needs_a_run_that_knows_its_peak() -> None:
    cut = STRETCHING.replace("LOOP        390", "LOOP         99")
    with pytest.raises(fecm.errors.ExploreError, match="before its peak force is known"):
        _ = fecm.explore(cut).html


def test_a_page_in_modes_that_do_not_give_the_peak_is_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("fecm.exploration.plates.MODES", 1)
    monkeypatch.setattr("fecm.mechanics.reduced_plate.VECTORS", 1)
    monkeypatch.setattr("fecm.mechanics.reduced_plate._bent_plates", lambda *given: [])
    with pytest.raises(fecm.errors.ExploreError, match=r"differs from that of a full run by \+1\d"):
        _ = fecm.explore(STRETCHING).html


def test_a_wrong_name_and_another_suffix_are_refused(tmp_path: Path) -> None:
    with pytest.raises(CasesError, match="cannot be varied"):
        fecm.explore(small(), "ply_thicknes=.1,.2")
    with pytest.raises(fecm.errors.ExploreError, match=r"written as \.html"):
        fecm.explore(small()).save(tmp_path / "page.txt")


# In a browser -------------------------------------------------------------------------------------

SHOWN = (
    "peak_force", "time_of_peak", "contacts", "contact_time", "max_deflection", "max_indentation",
    "permanent_indentation", "impulse", "rebound_velocity", "energy_absorbed", "contact_loop",
)  # fmt: skip


NEW = {
    "stretching": '--fixture D7136 --window held --layup "[45/0/-45/90]2s" --material IM7/8552 '
    "--ply-thickness .131 --damage --energy 2J --kinematics von-karman",
    "thin": '--fixture D7136 --window held --layup "[45/0/-45/90]2s" --material IM7/8552 '
    "--ply-thickness .131 --damage --energy 2J --kinematics linear",
    "sandwich": "--size 100x100 --mesh 12x12 --support simple --layup '[0/90/K/90/0]' "
    "--material IM7/8552 --ply-thickness .25 --core Divinycell-H60:10 --shear-factor equi --damage "
    "--projectile mass:1e-3 --law 3e3,0,0,1.5 --energy 2J --duration 2ms --kinematics linear",
    "curved": "--size 300x200 --mesh 20x14 --radius-x 500 --support simple "
    "--layup '[0/90/0/90/0]s' --material IM7/8552 --ply-thickness .2 --units mm-N-s "
    "--projectile mass:2e-5 --law 5e4,0,0,1.5 --patch disc:4 --velocity 3m/s "
    "--duration .7ms --kinematics linear",
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Decks of all kinds of plates and projectiles, and their pages."""
    place = tmp_path_factory.mktemp("pages")
    for name, options in NEW.items():
        done = call("new", f"{name}.inp", *shlex.split(options), cwd=place)
        assert done.exit_code == 0, done.stderr
    (place / "d7136.inp").write_text(HELD.read_text())
    (place / "rod.inp").write_text(Path("decks/impact-115.inp").read_text())
    for name in ("d7136", "rod", *NEW):
        done = call("explore", f"{name}.inp", "-o", f"{name}.html", cwd=place)
        assert done.exit_code == 0, done.stderr
    return place


def settled(browser: Browser) -> None:
    """Wait until the page has answered all sliders."""
    while browser.value("document.body?.dataset.ready") != "true":
        time.sleep(0.05)


def visit(browser: Browser, page: Path, address: str) -> None:
    """Open a page with an address of a state."""
    browser.open(page)
    browser.value(f"location.hash = {json.dumps(address)}; location.reload()")
    time.sleep(0.3)
    settled(browser)


def set_values(browser: Browser, **values: float | str) -> None:
    """Type values, in the units that the page shows, or choose options."""
    for name, value in values.items():
        browser.value(
            f"""(() => {{
                const field = document.getElementById({json.dumps(name)});
                field.value = {json.dumps(str(value))};
                field.dispatchEvent(new Event(field.tagName === "SELECT" ? "change" : "input"));
            }})()"""
        )
    settled(browser)


def numbers(browser: Browser) -> dict[str, float]:
    """Values of the page with all their digits, by name."""
    values = browser.value("SHOWN.map(name => [name, String(now[name])])")
    found = browser.value("String(shown.found)")
    return {
        **{name: float(text) for name, text in values},
        "found": float(found.replace("null", "nan")),
    }


def commands(browser: Browser) -> list[str]:
    """Commands that the page shows."""
    shown: list[str] = browser.value(
        "[...document.querySelectorAll('#commands pre')].map(one => one.textContent)"
    )
    return shown


def swept(command: str, folder: Path) -> dict[str, Any]:
    """Results of a command, as JSON."""
    program, *arguments = shlex.split(command)
    assert program == "fecm"
    done = call(*arguments, "--format", "json", "--allow-failed", cwd=folder)
    assert done.exit_code == 0, done.stderr
    results: dict[str, Any] = json.loads(done.stdout)["results"]
    return results


def to_four_digits(actual: float, wanted: object, atol: float = 0.0) -> bool:
    """Whether two values agree to half a unit of the fourth digit, or are both open."""
    value = float(str(wanted))
    allowed = 5e-5 * abs(value) + 1e-12 + atol
    return (np.isnan(actual) and np.isnan(value)) or abs(actual - value) <= allowed


STATES: dict[str, list[dict[str, float | str]]] = {
    "d7136": [{}, {"energy-value": 3.2, "mass-value": 8, "k-value": 6e4, "giic-value": 0.6}],
    "thin": [{"choose-law": "radius", "radius-value": 12, "energy-value": 0.9}],
    # The stiff contact halves the time step.
    "stretching": [
        {"energy-value": 1.5, "mass-value": 3},
        {"k-value": 5e3},
        {"k-value": 2e5, "energy-value": 1.2},
    ],
    "rod": [{"choose-speed": "velocity", "velocity-value": 80.0}],
    "sandwich": [{"mass-value": 2.5}],
    "curved": [{"energy-value": 0.25}],
}


@pytest.mark.browser
@pytest.mark.parametrize("name", STATES)
def test_numbers_of_the_page_are_those_of_the_commands_that_it_shows(
    name: str, folder: Path, browser: Browser
) -> None:
    for values in STATES[name]:
        browser.open(folder / f"{name}.html")
        settled(browser)
        set_values(browser, **values)
        actual, (impact, *others) = numbers(browser), commands(browser)
        wanted = swept(impact, folder)
        assert actual["peak_force"] > 0.0
        # The area of an elastic loop is 0.
        allowed = {"contact_loop": 1e-5 * browser.value("now.energy")}
        for quantity in SHOWN:
            atol = allowed.get(quantity, 0.0)
            assert to_four_digits(actual[quantity], wanted[quantity][0], atol), quantity
        if others:
            found = swept(others[0], folder)["found_energy"][0]
            assert to_four_digits(actual["found"], found)
        assert browser.complaints() == []
        assert browser.requests() == [(folder / f"{name}.html").as_uri()]


@pytest.mark.browser
def test_the_chance_is_that_of_a_random_sweep(folder: Path, browser: Browser) -> None:
    browser.open(folder / "d7136.html")
    settled(browser)
    set_values(
        browser,
        **{
            "energy-value": 4.2,
            "scatter-energy-value": 3,
            "scatter-k-value": 20,
            "scatter-giic-value": 10,
        },
    )
    chance = browser.value(
        "shown.draws.ratios.filter(ratio => ratio >= 1).length / shown.draws.ratios.length"
    )
    command = commands(browser)[-1]
    done = call(*shlex.split(command)[1:], "--format", "json", cwd=folder)
    assert done.exit_code == 0, done.stderr
    (wanted,) = json.loads(done.stdout)["random"]["exceedance"]["probability"]
    assert 0.05 < chance < 0.95
    assert abs(chance - wanted) <= 2.0 * np.sqrt(2.0 * chance * (1.0 - chance) / 1000)


@pytest.mark.browser
def test_the_energies_of_tough_and_brittle_plates_are_those_that_a_search_finds(
    folder: Path, browser: Browser
) -> None:
    browser.open(folder / "d7136.html")
    settled(browser)
    set_values(browser, **{"scatter-giic-value": 10})
    shares = dict(browser.value("shown.range"))
    command = commands(browser)[2]
    assert "--random giic=lognormal:0.7879,0.1 --samples 100 --find" in command
    for share, z in (("5 %", -1.6449), ("95 %", 1.6449)):
        toughness = 0.7879 * float(np.exp(0.1 * z))
        command = f"fecm sweep d7136.inp --vary giic={toughness} --find velocity "
        command += "--until peak_force=threshold -o found.h5 --overwrite"
        found = swept(command, folder)
        assert to_four_digits(shares[share], found["found_energy"][0])


@pytest.mark.browser
def test_a_saved_page_and_an_address_have_the_state_and_its_pinned_curves(
    folder: Path, browser: Browser, tmp_path: Path
) -> None:
    browser.open(folder / "d7136.html")
    settled(browser)
    browser.value("document.getElementById('pin').click()")
    set_values(browser, **{"energy-value": 4, "mass-value": 7})
    peak = numbers(browser)["peak_force"]
    browser.value(
        "var saved; download = (name, type, text) => { saved = text; }; "
        "document.getElementById('save-page').click()"
    )
    page = tmp_path / "saved.html"
    page.write_text(browser.value("saved"), encoding="utf-8")
    address = browser.value("location.hash")
    browser.open(page)
    settled(browser)
    assert numbers(browser)["peak_force"] == peak
    assert browser.value("document.querySelectorAll('#force .pin1').length") == 2  # with its label
    assert browser.complaints() == []
    visit(browser, folder / "d7136.html", address)
    assert numbers(browser)["peak_force"] == peak


@pytest.mark.browser
def test_hostile_texts_of_a_deck_and_of_an_address_stay_texts(
    browser: Browser, tmp_path: Path
) -> None:
    deck = units(small()).replace("FECM small plate", f"FECM {HOSTILE}")
    path = tmp_path / "a' $(touch b) <b>.inp"
    path.write_text(deck)
    fecm.explore(path).save(tmp_path / "page.html")
    for address in ("", "%", "[]", quote('{"energy":"<b>","pins":5,"scatter":7,"plate":null}')):
        visit(browser, tmp_path / "page.html", f"#{address}")
        assert browser.value("document.querySelector('h1').textContent") == HOSTILE
        assert browser.value("document.querySelectorAll('img, script, b').length") == 6
    assert {address.partition("#")[0] for address in browser.requests()} == {
        (tmp_path / "page.html").as_uri()
    }
    (command, *_) = commands(browser)
    assert shlex.split(command)[2] == path.name
    assert browser.value("now.peak_force > 0 || now.reached > 0")


@pytest.mark.browser
def test_a_worker_of_the_page_has_the_policy_of_the_page(folder: Path, browser: Browser) -> None:
    browser.open(folder / "d7136.html")
    code = 'try { eval(""); postMessage("ran"); } catch (error) { postMessage(error.name); }'
    answer = browser.do(
        "Runtime.evaluate",
        expression=f"""new Promise(resolve => {{
            const worker = new Worker(URL.createObjectURL(new Blob([{json.dumps(code)}])));
            worker.onmessage = message => resolve(message.data);
        }})""",
        awaitPromise=True,
    )
    assert answer["result"]["value"] == "EvalError"


@pytest.mark.browser
@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [390, 1400])
def test_the_page_fits_the_window_and_its_texts_are_legible(
    folder: Path, browser: Browser, width: int, scheme: str
) -> None:
    browser.open(folder / "d7136.html", width=width, scheme=scheme)
    settled(browser)
    assert browser.value("document.documentElement.scrollWidth") == width
    assert browser.value(BROKEN) == []
    dark = scheme == "dark"
    assert (
        _luminance(browser.value("getComputedStyle(document.body).backgroundColor")) < 0.2
    ) is dark
    pairs = [pair.split("/") for pair in browser.value(COLOURS) if "none" not in pair]
    assert len(pairs) > 3
    assert min(contrast(text, paper) for text, paper in pairs) >= AA


@pytest.mark.browser
def test_the_keyboard_alone_moves_a_slider_and_pins_a_curve(folder: Path, browser: Browser) -> None:
    browser.open(folder / "d7136.html")
    settled(browser)
    before = numbers(browser)["peak_force"]

    def press(key: str) -> None:
        for kind in ("rawKeyDown", "keyUp"):
            code = {"Tab": 9, "ArrowRight": 39, "Enter": 13}[key]
            text = {"text": "\r"} if key == "Enter" and kind == "rawKeyDown" else {}
            kind = "keyDown" if text else kind
            browser.do(
                "Input.dispatchKeyEvent", type=kind, key=key, windowsVirtualKeyCode=code, **text
            )

    def reach(name: str) -> None:
        for _ in range(40):
            press("Tab")
            if browser.value("document.activeElement.id") == name:
                return
        raise AssertionError(name)

    reach("energy")
    for _ in range(20):
        press("ArrowRight")
    settled(browser)
    assert numbers(browser)["peak_force"] > 1.05 * before
    assert browser.value("getComputedStyle(document.activeElement).outlineStyle") == "solid"
    reach("pin")
    press("Enter")
    assert browser.value("state.pins.length") == 1


@pytest.mark.browser
def test_without_scripts_the_page_says_so_and_shows_the_run_of_the_deck(
    folder: Path, browser: Browser
) -> None:
    browser.do("Emulation.setScriptExecutionDisabled", value=True)
    try:
        browser.open(folder / "d7136.html")
    finally:
        browser.do("Emulation.setScriptExecutionDisabled", value=False)
    assert browser.value("document.querySelector('#own-run img').naturalWidth") > 0
    assert browser.value("document.querySelector('#page').hidden")


@pytest.mark.browser
def test_the_frame_of_a_notebook_has_no_origin_and_runs_the_page(
    folder: Path, tmp_path: Path
) -> None:
    program = find_browser()
    if program is None:
        pytest.skip("no Chromium or Chrome found")
    frame = fecm.explore(folder / "d7136.inp")._repr_html_()
    notebook = tmp_path / "notebook.html"
    notebook.write_text(f"<!DOCTYPE html><meta charset=utf-8>{frame}", encoding="utf-8")
    with Browser(program, tmp_path / "profile") as browser:
        browser.do(
            "Target.setAutoAttach", autoAttach=True, waitForDebuggerOnStart=False, flatten=True
        )
        browser.open(notebook)
        (session,) = (
            event["params"]["sessionId"]
            for event in browser.events
            if event["method"] == "Target.attachedToTarget"
        )
        browser._session = session  # of the frame
        settled(browser)
        assert browser.value("location.origin") == "null"
        assert numbers(browser)["peak_force"] > 0.0


@pytest.mark.browser
def test_a_measured_force_and_several_plates_are_drawn(folder: Path, browser: Browser) -> None:
    measured = (np.linspace(0.0, 4e-3, 50), 4000.0 * np.sin(np.linspace(0.0, np.pi, 50)))
    page = fecm.explore(folder / "d7136.inp", {"ply_thickness": [0.184, 0.15]}, overlay=measured)
    page.save(folder / "plates.html")
    browser.open(folder / "plates.html")
    settled(browser)
    assert browser.value("document.querySelectorAll('#force .measured').length") == 2
    set_values(browser, **{"plate-0": "0.15"})
    actual, (command, *_) = numbers(browser), commands(browser)
    assert "--vary ply_thickness=0.15" in command
    wanted = swept(command, folder)
    assert all(to_four_digits(actual[name], wanted[name][0]) for name in SHOWN)
