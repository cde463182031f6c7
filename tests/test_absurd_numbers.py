"""Numbers that can be read but that no plate, projectile or step has end in words."""

from __future__ import annotations

import contextlib
import re
import warnings

import numpy as np
import pytest

import fecm
from fecm.deck.findings import DeckError
from fecm.problem.loading import load_deck
from fecm.problem.summary import deck_summary
from tests.decks import PROGRAM, small
from tests.fuzz_decks import FORC, OWN

DECK = small(PROGRAM.replace("         10", "          2")).replace("ROD\n", FORC + OWN + "ROD\n")

# Cards of the deck above, a field of each left open.
CARDS = {
    "    3    0       1.0     30.E6 .0006875": ["3,0,{},30.E6,.0006875", "3,0,1.,{},.0006875",
                                              "3,0,1.,30.E6,{}"],
    "    1    1      0.22": ["1,1,{}"],
    "  0.822467": ["{},"],
    "    1           0.5       0.5     0.053       45.": ["1,{},.5,.053,45.", "1,.5,.5,.053,{}"],
    "   13    3     115.0": ["13,3,{}"],
    "  1912000. 0.0006564     0.094       2.0": ["{},.0006564,.094,2.", "1912000.,{},.094,2.",
                                                "1912000.,.0006564,{},2.",
                                                "1912000.,.0006564,.094,{}"],
    "    3    3   -3      .106": ["3,3,-3,{}"],
    "    1   0.     0.053": ["1,{},.053", "1,0.,{}"],
    "DT        .5E-6": ["DT,{}"],
}  # fmt: skip


@pytest.mark.parametrize(
    "value",
    ["5E-324", "1.7E308", *(pytest.param(v, marks=pytest.mark.long) for v in ("1E-300", "1E300"))],
)
@pytest.mark.parametrize(("card", "written"), [(c, w) for c, many in CARDS.items() for w in many])
@pytest.mark.few(10)  # of 32, 0.03 s each
def test_an_absurd_number_in_any_field_runs_or_is_refused_in_words(
    card: str, written: str, value: str
) -> None:
    assert DECK.count(card) == 1
    text = DECK.replace(card, written.format(value))
    with warnings.catch_warnings(), contextlib.suppress(DeckError, fecm.DivergenceError):
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", fecm.FecmWarning)
        result = fecm.run_one(text)
        assert np.isfinite(result.force).all()


@pytest.mark.parametrize("value", ["5E-324", "1E-308", "1E-300", "1E-20", "1E300"])
def test_any_critical_indentation_of_yang_and_sun_runs_or_is_refused_in_words(value: str) -> None:
    acr = f"EXPE ACR\n{'1912000.':>10}{value:>10}\n"
    text = re.sub(r"EXPE\n.*\n", acr, DECK)
    with warnings.catch_warnings(), contextlib.suppress(DeckError, fecm.DivergenceError):
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", fecm.FecmWarning)
        result = fecm.run_one(text)
        assert np.isfinite(result.force).all()


@pytest.mark.parametrize(
    ("k", "velocity"),
    [
        ("1E-308", "1E-150"),
        ("1E-308", "1E300"),
        ("1E300", "1E150"),
        ("1E-308", "1E-308"),
    ],
)
def test_the_summary_of_a_deck_with_absurd_numbers_warns_of_nothing_in_numpys_words(
    k: str, velocity: str
) -> None:
    text = DECK.replace("13    3     115.0", f"13    3{velocity:>10}").replace(
        "  1912000.", f"{k:>10}"
    )
    (problem,) = load_deck(text).problems
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert deck_summary(problem).lines()


@pytest.mark.parametrize(("dt", "code"), [("1e-300", "E515"), ("1e-15", "E515"), ("4e-7", "")])
def test_a_time_step_that_rounding_would_swallow_is_an_error_at_its_place(
    dt: str, code: str
) -> None:
    actual = load_deck(small(PROGRAM.replace("DT        .5E-6", f"DT,{dt}"))).errors()
    assert [finding.code for finding in actual] == ([code] if code else [])
    assert all(f.place is not None and f.place.field.endswith("value") for f in actual)


@pytest.mark.parametrize("card", ["3,0,1E-300,3.E7,.0006875", "3,0,1E300,3.E7,.0006875"])
def test_a_rod_beyond_the_range_of_numbers_is_an_error(card: str) -> None:
    actual = load_deck(DECK.replace("    3    0       1.0     30.E6 .0006875", card)).errors()
    assert [finding.code for finding in actual] == ["E429"]
