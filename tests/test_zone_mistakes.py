"""Mistakes on MATS, LAMS and ZONE: each is found at its card."""

from __future__ import annotations

import pytest

from fecm.problem.loading import load_deck
from tests.decks import DATA_CARDS, small

WORDS = """MATS
    2
.00003,.3,15000.,15000.,6000.,6000.,6000.

LAMS
    2    2
    1  0.0      0.07    2
    2 90.0      0.07
    3    1
    1  0.0      0.07    2

ZONE
    2    4    2    2
    1              3

"""


def findings(words: str) -> list[tuple[str, str, str]]:
    """Code, message and card of the errors of the small deck with these cards."""
    text = small(data=words + DATA_CARDS)
    lines = text.splitlines()
    return [
        (one.code, one.message, lines[one.place.line - 1].strip())
        for one in load_deck(text).errors()
        if one.place is not None
    ]


MATERIAL_2 = "    2\n.00003,.3,15000.,15000.,6000.,6000.,6000.\n"
MATERIAL_1 = MATERIAL_2.replace("2", "1", 1)


@pytest.mark.parametrize(
    ("card", "wrong", "message", "at"),
    [
        ("    3    1\n", "    2    1\n", "The number 2 of a laminate is taken.", "2    1"),
        (MATERIAL_2, 2 * MATERIAL_2, "The number 2 of a material is taken.", "2"),
        (MATERIAL_2, MATERIAL_1 + MATERIAL_2, "The number 1 of a material is MATE's or less.", "1"),
    ],
    ids=["laminate twice", "material twice", "MATE's"],
)
def test_a_number_belongs_to_one_material_and_one_laminate(
    card: str, wrong: str, message: str, at: str
) -> None:
    assert findings(WORDS.replace(card, wrong))[0] == ("E496", message, at)


def test_the_cards_are_without_errors() -> None:
    assert findings(WORDS) == []


@pytest.mark.parametrize(
    ("card", "wrong", "code", "message", "at"),
    [
        (
            "LAMS\n    2    2\n",
            "LAMS\n    2    1\n",
            "E202",
            "LAMS has more layer cards than the 1 of laminate 2.",
            "2 90.0      0.07",
        ),
        ("LAMS\n    2    2\n", "LAMS\n    2    0\n", "E202", "Laminate 2 has 0 layers.", "2    0"),
        ("LAMS\n    2    2\n", "LAMS\n    2   -1\n", "E202", "Laminate 2 has -1 layers.", "2   -1"),
        (
            "    3    1\n",
            "    3    2\n",
            "E202",
            "LAMS has 1 layer cards where laminate 3 says 2.",
            "",
        ),
        (
            "    2    4    2    2\n",
            "    4    2         2\n",
            "E498",
            "A zone from element 4 to 2 by 1 is empty.",
            "4    2         2",
        ),
    ],
    ids=["too few", "none", "negative", "too many", "empty zone"],
)
def test_a_wrong_count_is_named_at_its_card(
    card: str, wrong: str, code: str, message: str, at: str
) -> None:
    assert WORDS.count(card) == 1
    assert findings(WORDS.replace(card, wrong)) == [(code, message, at)]
