"""Numbers that can be read but that no plate, projectile or step has end in words."""

from __future__ import annotations

import contextlib
import warnings

import numpy as np
import pytest

import fecm
from fecm.api import load_deck
from fecm.deck import DeckError
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


@pytest.mark.parametrize("value", ["1E-300", "5E-324", "1E300", "1.7E308"])
@pytest.mark.parametrize(("card", "written"), [(c, w) for c, many in CARDS.items() for w in many])
def test_an_absurd_number_in_any_field_runs_or_is_refused_in_words(
    card: str, written: str, value: str
) -> None:
    assert DECK.count(card) == 1
    text = DECK.replace(card, written.format(value))
    with warnings.catch_warnings(), contextlib.suppress(DeckError, fecm.DivergenceError):
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", fecm.FecmWarning)
        result = fecm.run(text)
        assert isinstance(result, fecm.Result)
        assert np.isfinite(result.force).all()


@pytest.mark.parametrize(("dt", "code"), [("1e-300", "E515"), ("1e-15", "E515"), ("4e-7", "")])
def test_a_time_step_that_rounding_would_swallow_is_an_error_at_its_place(
    dt: str, code: str
) -> None:
    found = load_deck(small(PROGRAM.replace("DT        .5E-6", f"DT,{dt}"))).errors()
    assert [finding.code for finding in found] == ([code] if code else [])
    assert all(f.place is not None and f.place.field.endswith("value") for f in found)


@pytest.mark.parametrize("card", ["3,0,1E-300,3.E7,.0006875", "3,0,1E300,3.E7,.0006875"])
def test_a_rod_beyond_the_range_of_numbers_is_an_error(card: str) -> None:
    found = load_deck(DECK.replace("    3    0       1.0     30.E6 .0006875", card)).errors()
    assert [finding.code for finding in found] == ["E429"]
