"""Strikes in columns give what strikes that are made one by one give."""

from __future__ import annotations

import numpy as np
import pytest

import fecm
from fecm import Deck
from fecm.authoring.case import Case
from fecm.authoring.strike_values import Strike
from fecm.authoring.values import strike_of_case
from fecm.sweeps import backends, impact_columns
from tests.decks import model, small

ROD = small()
RIGID = ROD.replace("EXPE\n", "PROJ\n    0    0  0.000181\n\nEXPE\n")
LINEAR = "EXPE\n  1912000. 0.0006564     0.094       2.0"
ACR = RIGID.replace(LINEAR, "EXPE ACR\n  1912000. 0.0006564")
LAW = {
    "velocity": [60.0, 115.0, -1.0],
    "k": [1e6, 2e6, 0.0],
    "q": [2.0, 2.5, 0.0],
    "s_p": [0.0, 0.1, 1.0],
    "alpha_p": [0.0, 6e-4, -1e-9],
}
# Decks, and values of which some are invalid.
SWEEPS = {
    "law": (ROD, LAW),
    "law and rigid mass": (RIGID, LAW),
    "equation 3-7": (ACR, LAW),
    "energy": (ROD, {"energy": [0.5, 2.0, -1.0], "k": [1e6, -2e6]}),
    "mass and energy": (RIGID, {"mass": [2e-4, 3e-4, 0.0, -1.0], "energy": [0.5, -1.0]}),
    "mass of a rod": (ROD, {"rod_mass": [2e-4, 3e-4, 0.0], "velocity": [60.0, 115.0]}),
    "rod that is none": (RIGID, {"velocity": [60.0], "rod_length": [1.0]}),
}


def sweep(text: str, vary: dict[str, list[float]]) -> fecm.SweepResult:
    return fecm.sweep(model(text), vary)


def assert_same(swept: fecm.SweepResult, wanted: fecm.SweepResult) -> None:
    assert swept.keys() == wanted.keys()
    for name in wanted:
        np.testing.assert_array_equal(swept[name], wanted[name], err_msg=name)


@pytest.mark.filterwarnings("ignore::fecm.FecmWarning")
@pytest.mark.parametrize("name", SWEEPS)
@pytest.mark.few(4)  # of 7, 0.09 s each
def test_a_sweep_is_that_of_strikes_made_one_by_one(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    text, vary = SWEEPS[name]
    swept = sweep(text, vary)
    monkeypatch.setattr(impact_columns, "_from_values", lambda *_: None)
    wanted = sweep(text, vary)
    assert not wanted.completed.all()
    assert wanted.completed.any() or "rod_length" in vary
    assert_same(swept, wanted)


def test_valid_cases_of_a_plate_need_no_cards(monkeypatch: pytest.MonkeyPatch) -> None:
    built: list[Case] = []

    def counted(plate: Deck, case: Case) -> Strike:
        built.append(case)
        return strike_of_case(plate, case)

    monkeypatch.setattr(impact_columns, "strike_of_case", counted)
    vary = {"velocity": np.linspace(60.0, 115.0, 8).tolist(), "k": np.linspace(1e6, 2e6, 8)}
    assert sweep(ROD, {**vary, "k": vary["k"].tolist()}).completed.all()
    assert len(built) <= 6  # of 64: those that are checked, and one asked for a law of the user's


@pytest.mark.parametrize("text", [ROD, RIGID])
def test_cases_do_not_depend_on_how_many_are_advanced_together(
    text: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    vary = {"velocity": np.linspace(60.0, 115.0, 7).tolist(), "mass": [2e-4, 3e-4]}
    whole = sweep(text, vary)
    monkeypatch.setattr(backends, "FORCES", 3 * int(whole.steps[0]))
    assert_same(sweep(text, vary), whole)
