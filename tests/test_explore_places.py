"""Places of the impact on a page: the response in modes, where they are, and what is refused."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fecm
from fecm.authoring.values import apply_case
from fecm.exploration.places import ModalResponses
from fecm.problem.loading import load_deck, load_one
from fecm.sweeps.backends import ImpulseResponse
from tests.browser import Browser
from tests.symmetric_parts import part_of, whole_deck
from tests.test_explore import HELD, commands, numbers, settled, swept, visit
from tests.test_reduced_sweeps import DECK as STRETCHING

SUPPORTED = whole_deck()
DAMPED = SUPPORTED.to_text().replace("EXPE", "DAMP\n5000.,\nEXPE", 1)


@pytest.mark.parametrize("deck", [SUPPORTED, DAMPED, whole_deck(patch="disc:8")])
@pytest.mark.parametrize("at", ["50,40", "30,25"])
def test_the_response_in_all_modes_is_that_of_a_run(deck: str, at: str) -> None:
    problem = load_one(apply_case(load_one(deck).deck, {"at": at}))
    exact = ImpulseResponse(problem).response
    plate = ModalResponses(problem, 10_000)
    actual = plate.response(plate.own, exact.dt, exact.steps)
    np.testing.assert_allclose(actual, exact.response, 0.0, 1e-9 * np.abs(exact.response).max())


@pytest.mark.parametrize("count", [1, 8])
def test_a_few_modes_keep_the_static_compliance_of_every_place(count: int) -> None:
    plate = ModalResponses(load_one(SUPPORTED), count)
    places = [*plate.places()]
    assert len(places) == 25  # inner corners of 6 x 6 elements
    for place in places[::6]:
        stiffness = np.append(plate.stiffness, place.stiffness)
        deck = apply_case(SUPPORTED, {"at": f"{place.x},{place.y}"})
        static = load_one(deck).static
        assert static is not None
        compliance = (place.deflection**2 / stiffness).sum()
        assert compliance == pytest.approx(static.compliance, rel=1e-9)


def codes(deck: fecm.Deck) -> set[str]:
    """Codes of the errors and warnings of a deck."""
    return {
        finding.code for finding in load_deck(deck.to_text()).findings if finding.code[0] != "N"
    }


def test_an_impact_moves_only_to_where_a_run_has_no_other_warning() -> None:
    problem = load_one(HELD)
    plate = ModalResponses(problem, 1)
    places = [*plate.places()]
    low, high = ((places[end].x, places[end].y) for end in (0, -1))
    for x, y in (low, high):
        assert codes(apply_case(problem.deck, {"at": f"{x},{y}"})) <= codes(problem.deck)
    taken = {(place.x, place.y) for place in places}
    corners = np.unique(problem.mesh.elements[:, :4]) - 1
    others = [
        point for point in problem.mesh.coordinates[corners].tolist() if tuple(point) not in taken
    ]
    assert len(others) > 20
    for x, y in others[1::20]:
        try:
            moved = codes(apply_case(problem.deck, {"at": f"{x},{y}"}))
        except fecm.errors.DeckError:
            continue
        assert not moved <= codes(problem.deck)


@pytest.mark.parametrize(
    ("deck", "options", "words"),
    [
        (STRETCHING, {"modes": 20}, "has modes for one place only: leave out `modes`"),
        (part_of(SUPPORTED, (0,)), {"modes": 20}, "part of a symmetric plate"),
        (whole_deck("free"), {"modes": 20}, "is not held"),
        (SUPPORTED, {"modes": 20, "vary": "at=1,1"}, "at moves the impact, as a click does"),
    ],
)
def test_an_impact_that_cannot_move_is_refused_before_anything_is_computed(
    deck: Any, options: dict[str, Any], words: str
) -> None:
    with pytest.raises(fecm.errors.ExploreError, match=words):
        fecm.explore(deck, **options)


def test_modes_that_miss_the_peak_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fecm.exploration.places.BESIDE", 1)
    with pytest.raises(fecm.errors.ExploreError, match=r"the peak force in 1 modes .* take more"):
        _ = fecm.explore(SUPPORTED, modes=1).html


# In a browser -------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drop-weight test and its page."""
    place = tmp_path_factory.mktemp("places")
    (place / "d7136.inp").write_text(HELD.read_text())
    fecm.explore(place / "d7136.inp", modes=60).save(place / "d7136.html")
    return place


def click(browser: Browser, x: float, y: float) -> None:
    """Click on a point of the plate."""
    browser.value("document.getElementById('place').scrollIntoView()")
    point = browser.value(
        f"""(() => {{
            const matrix = document.getElementById("place").getScreenCTM();
            const {{x, y}} = new DOMPoint({x}, {-y}).matrixTransform(matrix);
            return [x, y];
        }})()"""
    )
    for kind in ("mousePressed", "mouseReleased"):
        browser.do(
            "Input.dispatchMouseEvent",
            type=kind, x=point[0], y=point[1], button="left", clickCount=1,
        )  # fmt: skip
    settled(browser)


@pytest.mark.browser
def test_peaks_at_ten_places_are_within_one_percent_of_the_exact_ones(
    folder: Path, browser: Browser
) -> None:
    browser.open(folder / "d7136.html")
    settled(browser)
    places = browser.value("first.places.at")
    chosen = places[:: len(places) // 10][:10]
    assert len(chosen) == 10
    peaks = []
    for x, y in chosen:
        click(browser, x, y)
        assert browser.value("state.place") == [x, y]
        peaks.append(numbers(browser)["peak_force"])
    command = commands(browser)[0]
    assert f"--vary at={x:.7g},{y:.7g}" in command
    points = ",".join(f"({x:.7g},{y:.7g})" for x, y in chosen)
    exact = swept(command.replace(f"at={x:.7g},{y:.7g}", f'"at={points}"'), folder)["peak_force"]
    assert np.ptp(exact) > 0.05 * exact[0]
    np.testing.assert_allclose(peaks, exact, rtol=0.01)
    assert browser.value("shown.modal") < 0.01
    assert browser.complaints() == []


@pytest.mark.browser
def test_at_the_place_of_the_deck_the_response_is_exact(folder: Path, browser: Browser) -> None:
    browser.open(folder / "d7136.html")
    settled(browser)
    exact = numbers(browser)
    x, y = browser.value("first.places.own")
    click(browser, *browser.value("first.places.at[0]"))
    assert numbers(browser) != exact
    click(browser, x, y)
    assert browser.value("state.place") is None
    assert numbers(browser) == exact


@pytest.mark.browser
def test_keys_and_fields_move_the_impact_and_an_address_keeps_its_place(
    folder: Path, browser: Browser
) -> None:
    browser.open(folder / "d7136.html", width=390)
    settled(browser)
    x, y = browser.value("first.places.own")
    browser.value("document.getElementById('place').focus()")
    for key, code in (("ArrowRight", 39), ("ArrowUp", 38)):
        for kind in ("rawKeyDown", "keyUp"):
            browser.do("Input.dispatchKeyEvent", type=kind, key=key, windowsVirtualKeyCode=code)
        settled(browser)
    assert browser.value("document.activeElement.id") == "place"
    assert browser.value("document.documentElement.scrollWidth") == 390
    place = browser.value("state.place")
    assert place[0] > x
    assert place[1] > y
    peak, address = numbers(browser)["peak_force"], browser.value("location.hash")
    visit(browser, folder / "d7136.html", address)
    assert browser.value("state.place") == place
    assert numbers(browser)["peak_force"] == peak
    browser.value(
        "(() => { const field = document.getElementById('place-x'); "
        f"field.value = {json.dumps(str(x))}; field.dispatchEvent(new Event('change')); }})()"
    )
    settled(browser)
    assert browser.value("state.place[0]") == pytest.approx(x, abs=1.0)
    assert browser.value("state.place[1]") == place[1]


@pytest.mark.browser
def test_what_is_not_judged_at_another_place_is_said(folder: Path, browser: Browser) -> None:
    browser.open(folder / "d7136.html")
    settled(browser)
    rows = "[...document.querySelectorAll('#trust tbody tr')].map(row => row.textContent)"
    before = browser.value(rows)
    click(browser, *browser.value("first.places.at[0]"))
    added = [row for row in browser.value(rows) if row[:10] not in {old[:10] for old in before}]
    assert [row.split("%")[0][:13] for row in added] == ["peak by modes", "supports that"]
    assert "not judged" in added[1]
