"""Macro cards: where their numbers stand, what is refused, and how cards are written."""

from __future__ import annotations

from dataclasses import replace

import pytest

import fecm
from fecm import Ply
from fecm.deck.findings import DeckError, Finding
from fecm.deck.format import format_deck
from fecm.deck.macros import WORDS, estimate_work
from fecm.deck.model import (
    Allowables,
    Compact,
    Cure,
    Curvature,
    Expansion,
    Impact,
    Indentation,
    LaminateNumber,
    Laminates,
    Layer,
    Macro,
    MaterialNumber,
    Materials,
    NodeValues,
    Nonlinear,
    NumberedLaminate,
    NumberedPly,
    OneSidedSupport,
    OneSidedSupports,
    Patch,
    PointMasses,
    Preload,
    Projectile,
    Shear,
    Springs,
    Zone,
    Zones,
)
from fecm.deck.reader import Reader, read_deck
from fecm.deck.segment import Segment
from fecm.listing.slips import MODES
from fecm.problem.loading import load_deck
from tests.calls import call
from tests.decks import DATA_CARDS, PROGRAM, ROOT, small

BLANK_CARD = "   25    0    1    1    0    0    0\n\n"


def error_of(card: str, mode: str = "report") -> Finding:
    """The one error of the small deck with a card in place of its RODP."""
    program = PROGRAM.replace("RODP          5", card)
    (finding,) = load_deck(small(program), mode).errors()
    return finding


def marked(finding: Finding) -> str:
    """The part of the card that the caret marks."""
    assert finding.place is not None
    return finding.place.text[finding.place.first - 1 : finding.place.last]


# Where the number stands -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("card", "fixed"),
    [
        ("DT,5.0E-7", "DT        5.E-7"),
        ("DT,,5.0E-7", "DT        5.E-7"),
        ("DT , 5.0E-7 ! seconds", "DT        5.E-7"),
        ("LOOP,794", "LOOP        794"),
        ("RODP,3", "RODP          3"),
        ("DT,.5E-6,", "DT        .5E-6"),
        ("CHEC,,,", "CHEC"),
    ],
)
def test_a_number_behind_the_word_is_the_macros_number(card: str, fixed: str) -> None:
    assert fecm.read_one(small(card + "\n")).macros == fecm.read_one(small(fixed + "\n")).macros


@pytest.mark.parametrize("comma", [",", ",,"])
def test_comma_cards_take_the_steps_that_they_say(comma: str) -> None:
    text = small(f"LMAS\nDT{comma}.5E-6\nLOOP{comma}7\nTIME\nRODP{comma}3\nNEXT\n")
    tally = estimate_work(load_deck(text).problems[0].program)
    assert (tally.steps, tally.contact_rows) == (7, 2)


def test_a_number_that_is_no_number_is_marked_where_it_stands() -> None:
    finding = error_of("RODP,1O")
    assert (finding.code, marked(finding)) == ("E101", "1O")


# What is refused ---------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize(
    ("card", "code", "mark", "hint"),
    [
        ("RODP 5", "E514", "5   ", "RODP,5"),
        ("RODP   5", "E514", "  5 ", "RODP,5"),
        ("RODP,AB,5", "E514", "AB", ""),
        ("RODP AB       5", "E514", "AB  ", ""),
        ("RODP          5    7", "E514", "    7", ""),
        ("RODP          512345", "E514", "12345", "after a comma"),
        ("RODP,5,7", "E514", "7", ""),
        ("TIME          3", "E514", "    3", ""),
        ("TIME,3", "E514", "3", ""),
        ("TIME AB", "E514", "AB  ", ""),
        ("RODP,,5,0,7", "E106", "7", ""),
        ("RODP5", "E108", "RODP5", "cols 11-15"),
        ("RODP          5,", "E109", "RODP          5", "commas"),
    ],
)
def test_what_no_macro_uses_is_an_error_at_its_place(
    card: str, code: str, mark: str, hint: str, mode: str
) -> None:
    finding = error_of(card, mode)
    assert (finding.code, marked(finding).ljust(len(mark))) == (code, mark)
    assert hint in finding.hint


@pytest.mark.parametrize("word", sorted(set(WORDS) - {"LOOP", "NEXT"}))
def test_every_word_refuses_a_second_word_and_a_second_number(word: str) -> None:
    second = () if WORDS[word].second else (f"{word:14}0    9", f"{word},,0,9")
    for card in (f"{word:4} AB", *second):
        actual = load_deck(small(PROGRAM + card + "\n")).errors()
        assert "E514" in [finding.code for finding in actual], card


def test_no_deck_of_the_project_has_a_field_that_no_macro_uses() -> None:
    for path in sorted((ROOT / "decks").glob("*.inp")):
        assert load_deck(path).errors() == []
        assert load_deck(path, "listing").errors() == []


def test_letters_behind_the_fourth_of_a_word_do_not_count() -> None:
    assert fecm.read_one(small(PROGRAM.replace("DISP ", "DISPL"))) == fecm.read_one(small())


# Numbers that are longer than their columns ------------------------------------------------------


@pytest.mark.parametrize(
    "card", ["DT        2.5E-7", "DT       2.5E-7", "DT         2.5E-7", "DT      2.5E-7"]
)
def test_a_number_longer_than_its_columns_is_an_error_that_shows_the_comma_card(card: str) -> None:
    with pytest.raises(DeckError) as caught:
        read_deck(small(card + "\n"))
    (finding,) = caught.value.findings
    assert marked(finding) == "2.5E-7"
    written = finding.hint.split("`")[1]
    assert fecm.read_one(small(written + "\n")).macros[0].value == 2.5e-7


def test_a_number_that_its_last_field_cuts_short_is_an_error_where_the_value_changes() -> None:
    card = "   13    3     115.0"
    with pytest.raises(DeckError) as caught:
        read_deck(small(data=DATA_CARDS.replace(card, "   13    3 1.1512345E+2")))
    (finding,) = caught.value.findings
    assert (finding.code, marked(finding)) == ("E105", "1.1512345E+2")
    assert "`13,3,1.1512345E+2`" in finding.hint
    exact = fecm.read_one(small(data=DATA_CARDS.replace(card, "   13    3   115.00000")))
    assert exact.require(Impact).velocity == 115.0


def test_a_time_step_is_written_as_a_person_reads_it() -> None:
    assert Macro("DT", value=2.5e-7).to_card() == "DT,,2.5E-7"
    assert Macro("DT", value=5e-7).to_card() == "DT        5.E-7"
    assert Macro("LOOP", value=123456.0).to_card() == "LOOP,,123456"
    assert "DT,,2.5E-7\n" in format_deck(small("DT         25-8\n"))


def test_a_new_deck_has_a_time_step_that_a_person_can_read() -> None:
    answer = call(
        "new",
        "-",
        "--size",
        "100x100",
        "--mesh",
        "8x8",
        "--layup",
        "[0/90]s",
        "--units",
        "mm-N-s",
        "--ply-thickness",
        0.5,
        "--material",
        "AS/3501",
        "--support",
        "clamped",
        "--velocity",
        1000,
        "--law",
        "30000,0.01,0.1,2",
        "--projectile",
        "mass:1e-4",
        "--duration",
        1e-4,
        "--dt",
        "2.5e-7",
    )
    assert answer.exit_code == 0, answer.stderr
    assert "\nDT,,2.5E-7\n" in answer.stdout
    assert Macro("DT", value=2.5e-7) in fecm.read_one(answer.stdout).macros


# Cards written and read again --------------------------------------------------------------------


STRENGTHS = Allowables(100.0, 90.0, 1 / 3, 30.0, 20.0, 10.0, 15.0, -0.4, 0.3, 0.25, material=2)
STRENGTHS = replace(
    STRENGTHS, others=(replace(STRENGTHS, material=1), replace(STRENGTHS, xt=50.0, material=3))
)


@pytest.mark.parametrize(
    "segment",
    [
        Shear(0.8224670334241132),
        Shear(1.0, assumed=True),
        Shear(1.0, equilibrium=True),
        Shear(0.8, assumed=True, equilibrium=True),
        Patch(),
        Patch("HERT"),
        Patch("HERT", 1 / 3),
        Patch("DISC", None, 1.0, 0.1 + 0.2),
        Patch("DISC", 0.25, None, None, -7.5),
        Patch("HERT", 0.1, 0.0, 1.0, 1e300),
        Projectile(0, 0, 1e-4, 2.1e5, 7.8e-9),
        Projectile(0, 0, 1e-4, 0.0, 7.8e-9),
        Projectile(0, 0, 1e-4),
        Indentation(30000.0, 0.01, 0.0, 2.5, "ACR"),
        Nonlinear(),
        Compact(),
        Preload(50.0),
        Springs((NodeValues(1, 2, (0.0, 0.0, 1e5, 0.0, 1 / 3)), NodeValues(9, 0, (0.0,) * 5))),
        Springs((NodeValues(1, 5, (0.0, 0.0, 1e5, 0.0, 0.0)),), word="LINE"),
        OneSidedSupports((OneSidedSupport(3, 0, -1, 1 / 3, 0.01), OneSidedSupport(13, 0))),
        OneSidedSupports((OneSidedSupport(1, 5),), word="LINE"),
        PointMasses((NodeValues(13, 0, (1e-5, 0.0)),)),
        Preload(-1 / 3, 0.0, 1e-300),
        Curvature(-1500.0),
        Curvature(0.0, 1 / 3, -1e300),
        Cure(-100.0, expansions=(Expansion(1, 2e-8, 22.5e-6),)),
        Cure(0.0),
        Materials((NumberedPly(MaterialNumber(2), Ply(*[1 / 3] * 7)),)),
        Materials(()),
        Laminates(
            (
                NumberedLaminate(
                    LaminateNumber(2, 2), (Layer(1, 30.0, 0.1), Layer(2, 0.0, 0.1, 2))
                ),
                NumberedLaminate(LaminateNumber(3, 1), (Layer(1, 1 / 3, 0.1, 12),)),
            )
        ),
        Zones((Zone(1, 0, 0, 2), Zone(2, 4, 2, 3))),
        STRENGTHS,
        Cure(-1 / 3, 0.1 + 0.2, (Expansion(1, 1e-7 / 3, 0.0, 0.0, 6e-3), Expansion(2, -1e-6))),
    ],
    ids=repr,
)
def test_a_segment_is_written_with_all_that_it_says(segment: Segment) -> None:
    deck = fecm.read_one(small())
    changed = replace(deck, segments=(*deck.segments, segment), text="")
    assert fecm.read_one(changed.to_text()) == changed
    assert fecm.read_one(format_deck(changed.to_text())) == changed


@pytest.mark.parametrize("card", ["", "hert", "DISC,,1.,2.", ",.3", ",,,,5.", " " * 49 + "5"])
def test_blanks_of_a_patch_stay_blank_when_a_deck_is_formatted(card: str) -> None:
    deck = small().replace("EXPE", f"PATC\n{card}\nEXPE")
    assert fecm.read_one(format_deck(deck)) == fecm.read_one(deck)
    assert format_deck(format_deck(deck)) == format_deck(deck)


@pytest.mark.parametrize("value", [1e300, 1e-300, 5e-324, 2.0**53, -0.0, 1 / 3])
def test_a_macros_number_is_written_exactly(value: float) -> None:
    deck = replace(fecm.read_one(small()), macros=(Macro("DT", value=value),), text="")
    assert fecm.read_one(deck.to_text()).macros[0].value == value
    assert fecm.read_one(format_deck(deck.to_text())).macros[0].value == value


@pytest.mark.parametrize("card", ["LOßP", "LAŉS", "ǰT,,5.E-7"])
def test_a_macro_of_foreign_letters_is_formatted_as_it_is_read(card: str) -> None:
    def macros(text: str) -> tuple[Macro, ...]:
        deck = Reader(text).problems()[0].deck
        assert deck is not None
        return deck.macros

    deck = small(PROGRAM + f"{card}\n")
    assert len(macros(deck)) == 8
    assert macros(format_deck(deck)) == macros(deck)


@pytest.mark.parametrize("end", [" END", " END  ! of the program", " END,"])
def test_an_indented_end_ends_the_program_as_it_does_when_it_is_formatted(end: str) -> None:
    text = small(PROGRAM)
    assert text.count("NEXT\nEND\n") == 1
    indented = text.replace("NEXT\nEND\n", f"NEXT\n{end}\n")
    assert fecm.read_one(indented) == fecm.read_one(text)
    assert fecm.read_one(format_deck(indented)) == fecm.read_one(text)


def test_a_number_that_is_not_finite_is_written_in_no_form() -> None:
    deck = fecm.read_one(small())
    law = Indentation(0.1234567890123, float("inf"), 0.1, 2.0)
    with pytest.raises(ValueError, match="inf"):
        replace(deck, segments=(*deck.segments, law)).to_text()


@pytest.mark.parametrize("blank", [",,", ",,,,,,", " , ,  ! the end"])
def test_a_card_of_commas_alone_is_a_blank_card_before_and_after_formatting(blank: str) -> None:
    text = small()
    assert text.count(BLANK_CARD) == 1
    commas = text.replace(BLANK_CARD, BLANK_CARD.replace("\n\n", f"\n{blank}\n"))
    assert fecm.read_one(commas) == fecm.read_one(text)
    assert fecm.read_one(format_deck(commas)) == fecm.read_one(text)


@pytest.mark.parametrize("head", ["EXPE ACR", "EXPE,ACR", "EXPE, acr"])
def test_a_keywords_second_word_may_stand_behind_a_comma(head: str) -> None:
    text = small(data=DATA_CARDS.replace("EXPE\n", f"{head}\n").replace("0.094", "  0.0"))
    assert fecm.read_one(text).require(Indentation).word == "ACR"
    assert fecm.read_one(format_deck(text)) == fecm.read_one(text)
