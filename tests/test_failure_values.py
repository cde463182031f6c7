"""Sweeps over the toughness and the strengths, which do not affect the motion."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from statistics import NormalDist
from typing import Any

import numpy as np
import pytest

import fecm
from fecm import Deck
from fecm.authoring.case import CasesError
from fecm.deck.model import Allowables, Cure, Delamination, Expansion, Impact
from fecm.results.exposures import largest_exposures
from fecm.results.metrics import EXPOSURES
from fecm.simulation.run import run_program
from fecm.simulation.simulation import Simulation
from fecm.sweeps import in_full
from tests.calls import call
from tests.test_find import deck as tough
from tests.test_first_failure import WEAK, failing
from tests.test_nonlinear_decks import text
from tests.test_nonlinear_sweeps import BLOW, PROGRAM

STRENGTHS = ("xt", "xc", "yt", "yc", "s12", "s13", "s23")


def weak(*, nonlinear: bool = False, cured: bool = False) -> Deck:
    """A small plate that fails, with a delamination threshold."""
    if nonlinear:
        program = PROGRAM.replace("RODP         50", "RODP         50\nFAIL         40")
        deck = fecm.read_one(text(program, data=BLOW + WEAK.removesuffix("EXPE")))
    else:
        deck = fecm.read_one(failing(every=4, steps=400))
        deck = replace(deck, segments=(*deck.segments, Delamination(0.5)), text="")
    if cured:
        cure = Cure(-1.0, expansions=(Expansion(1, 0.0, 2e-5),))
        deck = replace(deck, segments=(*deck.segments, cure), text="")
    return deck


@pytest.fixture
def runs(monkeypatch: pytest.MonkeyPatch) -> list[Simulation]:
    """Full runs of the test's sweeps."""
    counted: list[Simulation] = []

    def counting(simulation: Simulation) -> None:
        counted.append(simulation)
        run_program(simulation)

    monkeypatch.setattr(in_full, "run_program", counting)
    return counted


def test_each_case_has_the_threshold_of_its_toughness_as_in_a_run_of_its_deck() -> None:
    deck = fecm.read_one(tough(400))
    own = deck.require(Delamination).toughness
    toughnesses = [0.25 * own, own, 4.0 * own]
    swept = fecm.sweep(deck, {"giic": toughnesses})
    force = swept["threshold_force"]
    np.testing.assert_allclose(force / force[1], [0.5, 1.0, 2.0], rtol=1e-12)
    np.testing.assert_allclose(swept["threshold_margin"], 1.0 - swept["peak_force"] / force)
    assert len(set(swept["peak_force"])) == 1
    for row, toughness in enumerate(toughnesses):
        single = fecm.run_one(deck.with_(giic=toughness))
        assert single.attributes_of("threshold")["force"] == force[row]
        assert swept["validity"][row] == single.validity


def test_a_search_reaches_the_threshold_of_each_toughness() -> None:
    deck = fecm.read_one(tough(400))
    toughness = deck.require(Delamination).toughness
    swept = fecm.sweep(deck, {"giic": [toughness, 1.2 * toughness]}, until="threshold")
    np.testing.assert_allclose(swept["peak_force"], swept["threshold_force"], rtol=1e-4)
    assert swept["threshold_force"][1] == pytest.approx(
        np.sqrt(1.2) * swept["threshold_force"][0], rel=1e-12
    )
    assert swept["found_velocity"][1] > swept["found_velocity"][0]


@pytest.mark.parametrize("nonlinear", [False, True])
@pytest.mark.parametrize("cured", [False, True])
@pytest.mark.few(1)  # of 4, 1 s each
def test_cases_that_differ_in_strengths_and_toughness_share_a_motion(
    nonlinear: bool, cured: bool, runs: list[Simulation]
) -> None:
    deck = weak(nonlinear=nonlinear, cured=cured)
    ply = deck.require(Allowables)
    values = {"yt": [0.7 * ply.yt, ply.yt], "s13": [0.5 * ply.s13], "giic": [0.1, 0.5]}
    swept = fecm.sweep(deck, values, measure="failure")
    assert len(runs) == 1
    assert len(set(swept["exposure_max_stress"])) == 2
    for row in range(4):
        single = fecm.run_one(deck.with_(**{name: swept[name][row] for name in values}))
        largest = {f"exposure_{one.criterion}": one.exposure for one in largest_exposures(single)}
        columns = {name: swept[name][row] for name in EXPOSURES if name in largest}
        assert columns == pytest.approx(largest, rel=1e-9)
        assert swept["threshold_force"][row] == single.attributes_of("threshold")["force"]
        assert swept["validity"][row] == single.validity


def test_toughnesses_of_a_nonlinear_plate_share_a_motion(runs: list[Simulation]) -> None:
    swept = fecm.sweep(weak(nonlinear=True), {"giic": [0.1, 0.5, 1.0]})
    assert len(runs) == 1
    force = swept["threshold_force"]
    np.testing.assert_allclose(force / force[0], np.sqrt([1.0, 5.0, 10.0]), rtol=1e-12)


@pytest.mark.parametrize("name", STRENGTHS)
def test_each_strength_is_set_on_its_field(name: str) -> None:
    deck = weak()
    value: dict[str, Any] = {name: 123.0}
    old, new = deck.require(Allowables), deck.with_(**value).require(Allowables)
    changed = [field for field in STRENGTHS if getattr(old, field) != getattr(new, field)]
    assert changed == [name]
    assert getattr(new, name) == 123.0


def test_a_strength_is_that_of_the_ply_of_mate_wherever_its_cards_are() -> None:
    deck = weak()
    ply = deck.require(Allowables)
    both = replace(ply, material=2, others=(ply,))
    changed = replace(deck, segments=tuple(both if s is ply else s for s in deck.segments))
    card = changed.with_(yt=123.0).require(Allowables)
    assert (card.yt, card.others[0].yt) == (ply.yt, 123.0)


@pytest.mark.parametrize(
    ("values", "measure", "reason"),
    [
        ({"giic": [-1.0, 0.5]}, None, "G_IIc is -1; it must be positive."),
        ({"giic": [-1.0, 0.5]}, "failure", "G_IIc is -1; it must be positive."),
        ({"yt": [-1.0, 0.5]}, "failure", "The strength YT is -1; it must be positive."),
    ],
)
@pytest.mark.few(1)  # of 3, 0.2 s each
def test_an_invalid_value_fails_alone(
    values: dict[str, list[float]], measure: str | None, reason: str
) -> None:
    statuses = fecm.sweep(weak(), values, measure=measure)["status"].tolist()
    assert statuses[0] == reason
    assert statuses[1] == "ok"


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("giic", "giic: the threshold needs a DELA segment"),
        ("s23", "s23: the deck has no strengths of the ply of MATE; add an ALLO segment"),
        ("cure_dT", "cure_dT: the deck has no CURE"),
    ],
)
def test_a_deck_without_the_segment_of_a_value_is_refused(name: str, reason: str) -> None:
    deck = weak()
    segments = (s for s in deck.segments if not isinstance(s, Delamination | Allowables))
    macros = tuple(macro for macro in deck.macros if macro.word != "FAIL")
    bare = replace(deck, segments=tuple(segments), macros=macros, text="")
    with pytest.raises(CasesError, match=reason):
        fecm.sweep(bare, {name: [1.0, 2.0]})


@pytest.mark.parametrize(("exposure", "is_broken"), [(1.00005, False), (1.001, True)])
@pytest.mark.few(1)  # of 2, 0.4 s each
def test_a_run_and_a_sweep_agree_whether_an_exposure_is_above_1(
    exposure: float, is_broken: bool
) -> None:
    deck = weak()
    ply = deck.require(Allowables)
    factor = max(one.exposure for one in largest_exposures(fecm.run_one(deck))) / exposure
    scaled: dict[str, Any] = {name: factor * getattr(ply, name) for name in STRENGTHS}
    single = fecm.run_one(deck.with_(**scaled))
    (validity,) = fecm.sweep(deck, {name: [v] for name, v in scaled.items()}, measure="failure")[
        "validity"
    ]
    assert max(one.exposure for one in largest_exposures(single)) == pytest.approx(exposure)
    assert validity == single.validity
    assert ("exposure > 1" in single.validity) is is_broken
    assert any("exposure above 1" in note for note in single.notes) is is_broken


def test_a_sweep_without_exposures_says_that_strengths_change_nothing() -> None:
    with pytest.warns(fecm.FecmWarning, match="yt and s12 change only exposures"):
        fecm.sweep(weak(), {"yt": [0.5], "s12": [0.5, 0.6]})


def test_the_scatter_of_toughness_has_its_share_in_the_scatter_of_the_margin(
    tmp_path: Path,
) -> None:
    (tmp_path / "d.inp").write_text(tough(400))
    speed = fecm.read_one(tough(400)).require(Impact).velocity
    laws = ("--random", "giic=lognormal:0.5,0.2", "--random", f"velocity=normal:{speed},1e-6")
    options = (*laws, "--samples", "64", "--sensitivity", "-o", "s.h5")
    done = call("sweep", "d.inp", *options, cwd=tmp_path)
    assert done.exit_code == 0, done.stderr
    random = fecm.load_sweep(tmp_path / "s.h5").random
    assert random is not None
    first = random.sensitivity["threshold_margin"].first
    np.testing.assert_allclose(first, [1.0, 0.0], atol=0.05)
    table = done.stdout.split("  threshold_margin ")[1].splitlines()
    assert table[1].split()[0] == "giic"


@pytest.mark.parametrize(
    "options", [("--vary", "GIIc=.1,.2"), ("--random", "GIIc=normal:1,.1", "--samples", "16")]
)
def test_a_name_in_other_letters_is_suggested(options: tuple[str, ...], tmp_path: Path) -> None:
    (tmp_path / "d.inp").write_text(tough(400))
    done = call("sweep", "d.inp", *options, "-o", "s.h5", cwd=tmp_path)
    assert done.exit_code == 2
    assert "did you mean giic?" in done.stderr


def test_the_probability_of_delamination_follows_from_the_law_of_the_toughness() -> None:
    """The threshold goes with the root of G_IIc, and the peak force does not scatter.

    With a lognormal G_IIc, P = Phi(ln(G (F/F_G)^2/median)/sigma), where F_G is the threshold of G.
    """
    deck, sigma = fecm.read_one(tough(400)), 0.2
    single = fecm.run_one(deck)
    peak, threshold = single.metrics["peak_force"], single.metrics["threshold_force"]
    toughness = deck.require(Delamination).toughness
    median = 1.1 * toughness * (peak / threshold) ** 2  # P is less than a half
    expected = NormalDist().cdf(math.log(1.0 / 1.1) / sigma)
    laws = {"giic": f"lognormal:{median!r},{sigma}"}
    swept = fecm.sweep(deck, random=laws, samples=256, exceed="peak_force=threshold")
    assert swept.random is not None
    (actual,) = swept.random.exceedance.probability
    assert actual == pytest.approx(expected, abs=1.0 / 256)  # one draw in each of 256 strata
