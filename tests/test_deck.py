"""The card reader: columns, number forms, segments, findings, and writing a model back."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import fecm
from fecm.deck.card import format_real, parse_real
from fecm.deck.findings import DeckError
from fecm.deck.model import (
    SEGMENTS,
    Boundary,
    Control,
    Coordinates,
    Deck,
    Elements,
    Forces,
    Impact,
    Indentation,
    Macro,
    Material,
    NodeValues,
    NumberedSegment,
    Page,
    PrintOption,
)
from fecm.deck.reader import Reader
from fecm.deck.segment import Segment
from tests.decks import APPENDIX, DATA_CARDS, LONG, MESH, small


def codes(text: str, *, zeros: bool = False) -> list[str]:
    """Codes of a text's findings."""
    reader = Reader(text, blanks_are_zeros=zeros)
    reader.problems()
    return [finding.code for finding in reader.findings]


def test_the_reports_deck_is_what_the_report_says() -> None:
    deck = fecm.read_one(APPENDIX)
    assert deck.title == "**LOW VELOCITY IMPACT OF LAMINATED PLATE**"
    assert deck.control == Control(609, 140, 20, 2, 5, 9)
    assert deck.require(Impact) == Impact(305, 3, 115.0)
    assert deck.require(Indentation) == Indentation(1912000.0, 0.0006564, 0.094, 2.0)
    material = deck.require(Material)
    assert (material.integration.bending, material.integration.points) == (3, -3)
    assert material.ply.e1 == 17.5e6
    # [0/45/0/-45/0]2s
    half = [0.0, 45.0, 0.0, -45.0, 0.0] * 2
    assert [layer.angle for layer in material.layers] == half + half[::-1]
    assert [(m.word, m.value) for m in deck.macros] == [
        ("LMAS", 0.0),
        ("DT", 2e-7),
        ("LOOP", 10.0),
        ("TIME", 0.0),
        ("RODP", 5.0),
        ("DISP", 5.0),
        ("NEXT", 0.0),
    ]


@pytest.mark.parametrize(
    ("text", "value"),
    [
        (".2E-6", 2e-7), ("1.5D+3", 1500.0), ("45.", 45.0), ("1.5-3", 1.5e-3), ("-.5+2", -50.0),
        ("+7", 7.0), ("12e2", 1200.0), ("0", 0.0),
    ],
)  # fmt: skip
def test_fortran_number_forms_are_read(text: str, value: float) -> None:
    assert parse_real(text) == value


@pytest.mark.parametrize("text", ["", "1.2.3", "E5", "1.5E", "-", ".", "0x10", "nan", "1_0", "١"])
def test_what_is_no_fortran_number_is_refused(text: str) -> None:
    assert parse_real(text) is None


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_a_written_number_is_read_back_the_same(value: float) -> None:
    text = format_real(value, 30)
    assert text is not None
    read_back = parse_real(text)
    assert read_back is not None
    assert read_back == value
    assert math.copysign(1.0, read_back) == math.copysign(1.0, value)


def digits(least: int, most: int) -> st.SearchStrategy[str]:
    return st.text("0123456789", min_size=least, max_size=most)


# Without regular expressions, for which hypothesis makes tables of all characters.
SIGNS = st.sampled_from(["", "+", "-"])
EXPONENTS = st.builds("{}{}{}".format, st.sampled_from(["", "E", "D"]), SIGNS, digits(1, 2))


@given(st.builds("{}{}.{}{}".format, SIGNS, digits(0, 4), digits(1, 5), EXPONENTS | st.just("")))
def test_whatever_ten_columns_held_can_be_written_into_ten_columns(text: str) -> None:
    value = parse_real(text)
    if len(text) <= 10 and value is not None and math.isfinite(value):
        written = format_real(value, 10)
        assert written is not None
        assert len(written) <= 10
        assert parse_real(written) == value


@pytest.mark.parametrize(
    ("value", "text"),
    [(1.2345678e12, "12345678+5"), (-1.234567e12, "-1234567+6"), (1.234567e-4, "1.234567-4"),
     (1234567891.0, "1234567891"), (1.2345678e-4, None)],
)  # fmt: skip
def test_ten_columns_take_an_exponent_without_its_letter_and_a_number_without_its_point(
    value: float, text: str | None
) -> None:
    assert format_real(value, 10) == text


def test_an_all_blank_field_is_zero() -> None:
    deck = fecm.read_one(small(data=DATA_CARDS.replace("      .106", "      .106          ")))
    assert deck.require(Material).integration.width == 0.0
    assert deck.macros[0] == Macro("LMAS")


def test_the_card_of_the_last_element_needs_no_blank_card_behind_it() -> None:
    middle, corner = "   11   13   23   21   12   18   22   16   17", 2
    shifted = "".join(f"{int(node) + corner:5}" for node in middle.split())
    ended = small().replace(f"{middle}    2\n\n", f"{middle}\n    4{shifted}\n")
    assert ended != small()
    assert fecm.read_one(ended).require(Elements).records[-1].element == 4


def test_segments_may_stand_in_any_order() -> None:
    shuffled = fecm.read_one(small(mesh=DATA_CARDS, data=MESH))
    straight = fecm.read_one(small())
    assert sorted(shuffled.segments, key=repr) == sorted(straight.segments, key=repr)


def test_every_segment_of_the_listing_is_read() -> None:
    extra = "NOPR\nPAGE\n0\nFORC\n    1    1       1.0       2.0       3.0       4.0       5.0\n"
    extra += "    3    0       3.0       2.0       3.0       4.0       5.0\n\nPRIN\n"
    deck = fecm.read_one(small(data=DATA_CARDS + extra))
    assert [o.on for o in deck.all(PrintOption)] == [False, True]
    assert deck.require(Page).carriage_control == "0"
    forces = deck.require(Forces).records
    assert [(f.node, f.increment) for f in forces] == [(1, 1), (3, 0)]
    assert forces[0].values == (1.0, 2.0, 3.0, 4.0, 5.0)
    assert {type(s) for s in deck.segments} >= {Coordinates, Elements, Boundary, Material}


def test_every_kind_of_segment_is_read_by_its_keyword() -> None:
    kinds = {*Segment.__subclasses__(), *NumberedSegment.__subclasses__()} - {NumberedSegment}
    kinds |= {kind for group in kinds for kind in group.__subclasses__()}
    kinds = {kind for kind in kinds if kind.keyword}
    assert {keyword: kind for keyword, kind in SEGMENTS.items() if keyword != "NOPR"} == {
        kind.keyword: kind for kind in kinds
    }


def test_only_the_first_four_characters_of_a_keyword_count() -> None:
    assert fecm.read_one(small(mesh=MESH.replace("COOR", "COORDINATES"))) == fecm.read_one(small())


def test_several_problems_stand_in_one_file_until_stop() -> None:
    decks = fecm.read_deck(small(stop=False) + small() + "anything after STOP\n")
    assert isinstance(decks, list)
    assert len(decks) == 2
    assert decks[0] == decks[1]
    assert decks[0].text.endswith("END\nSTOP\n")


@pytest.mark.parametrize("path", [APPENDIX, LONG])
def test_a_deck_written_and_read_is_the_same_model(path: str) -> None:
    deck = fecm.read_one(path)
    assert fecm.read_one(deck.to_text()) == deck


def test_values_too_long_for_their_columns_are_written_in_free_format() -> None:
    deck = fecm.read_one(
        small(data=DATA_CARDS.replace("     115.0", "     115.0\n").replace("\n\n", "\n"))
    )
    precise = Impact(13, 3, 115.12345678901)
    segments = tuple(precise if isinstance(s, Impact) else s for s in deck.segments)
    again = fecm.read_one(Deck(deck.title, deck.control, segments, deck.macros).to_text())
    assert again.require(Impact) == precise


def test_a_value_knows_its_line_and_columns() -> None:
    text = small()
    impact = fecm.read_one(text).require(Impact)
    place = impact.place("impact velocity")
    assert place is not None
    assert text.splitlines()[place.line - 1][place.first - 1 : place.last] == "     115.0"
    assert place.field == "cols 11-20: impact velocity"


@pytest.mark.parametrize(
    ("field", "was"),
    [("   13   3 ", "30"), ("   13  3  ", "300"), ("  1 3    3", "103")],
)
def test_a_blank_that_would_change_a_value_is_an_error_with_the_right_card_as_its_hint(
    field: str, was: str
) -> None:
    text = small(data=DATA_CARDS.replace("   13    3     115.0", f"{field}     115.0"))
    with pytest.raises(DeckError) as caught:
        fecm.read_deck(text)
    (finding,) = caught.value.findings
    assert finding.code == "E104"
    assert was in finding.message
    assert "`   13    3     115.0`" in finding.hint


def test_listing_mode_reads_blanks_as_the_zeros_they_were() -> None:
    text = small(data=DATA_CARDS.replace("     115.0", "     1 5.0"))
    reader = Reader(text, blanks_are_zeros=True)
    (problem,) = reader.problems()
    assert [f.code for f in reader.findings] == ["W104"]
    assert problem.deck is not None
    assert problem.deck.require(Impact).velocity == 105.0


def test_blanks_that_change_nothing_are_no_findings() -> None:
    assert codes(small(data=DATA_CARDS.replace("     115.0", "   115.0  "))) == []
    assert codes(small(data=DATA_CARDS.replace("     115.0", "  - 115.0 "))) == []


@pytest.mark.parametrize(
    ("old", "new", "code"),
    [
        ("  1912000.", "  19x2000.", "E101"),
        ("   13    3     115.0", "   13  3.0     115.0", "E101"),
        ("   13    3     115.0", "   13\t3     115.0", "E103"),
        ("   13    3     115.0", "   13    3      115.00", "W106"),
        ("  1912000. 0.0006564", "  1912000.  0.000656", None),
        ("0.0006564     0.094", "0.000656400    0.094", "E105"),
        ("  1912000.", "  1912E300", None),
        ("  1912000.", "  1912E999", "E107"),
    ],
)
def test_a_number_that_cannot_be_meant_is_found(old: str, new: str, code: str | None) -> None:
    text = small(data=DATA_CARDS.replace(old, new))
    assert text != small()
    assert codes(text) == ([] if code is None else [code])


def test_all_errors_of_a_file_are_reported_in_one_go() -> None:
    text = small(data=DATA_CARDS.replace("1912000.", "19l2000.").replace("115.0", "1l5.0"))
    text = text.replace("    1    1    3   13", "    1    1    x   13").replace("DT  ", "DT x")
    text = text.replace(".5E-6", ".5Q-6")
    with pytest.raises(DeckError) as caught:
        fecm.read_deck(text)
    assert [f.code for f in caught.value.findings] == ["E101"] * 4
    lines = [f.place.line for f in caught.value.findings if f.place]
    assert lines == sorted(lines)


def test_a_misspelt_keyword_is_one_finding_that_names_the_right_one() -> None:
    reader = Reader(small().replace("BOUN\n", "BUON\n"))
    reader.problems()
    (finding,) = list(reader.findings)
    assert finding.code == "E005"
    assert finding.hint == "did you mean BOUN?"


@pytest.mark.parametrize(
    ("old", "new", "code"),
    [
        ("COOR\n", " COOR\n", "E005"),
        ("\nELEM", "ELEM", "E007"),
        ("END\nMACR", "MACR", "E004"),
        ("    2  90.     0.053\n", "", "E202"),
        ("    2  90.     0.053\n", "    2  90.     0.053\n    3   0.     0.053\n", "E006"),
        ("   25    4    2    2    5    9\n", "", "E003"),
        ("   25    4    2    2    5    9\n", "   25    4    2    3    5    9\n", "E201"),
        ("MACR\n", "", "E009"),
        ("MACR\n", "MCAR\n", "E005"),
        ("STOP\n", "", "W002"),
        ("FECM", "FEAP", "E013"),
    ],
)
def test_a_slip_in_the_decks_frame_is_named_first(old: str, new: str, code: str) -> None:
    text = small()
    assert old in text
    assert codes(text.replace(old, new, 1))[0] == code


def test_free_format_and_comments_read_as_the_fixed_columns_do() -> None:
    text = small().replace("   13    3     115.0", "13, 3, 115.0 ! where it hits")
    text = text.replace("COOR\n", "! the mesh\nCOOR ! nodes\n").replace(
        "LOOP         10", "LOOP,,10"
    )
    assert fecm.read_one(text) == fecm.read_one(small())


def test_a_free_format_value_knows_its_place() -> None:
    text = small().replace("   13    3     115.0", "13, 3,  1l5.0")
    with pytest.raises(DeckError) as caught:
        fecm.read_deck(text)
    place = caught.value.findings[0].place
    assert place is not None
    assert (place.first, place.last) == (9, 13)


def test_line_ends_and_byte_order_marks_of_other_systems_change_nothing() -> None:
    assert fecm.read_one("\ufeff" + small().replace("\n", "\r\n")) == fecm.read_one(small())


def test_numpys_numbers_are_written_as_plain_ones() -> None:
    deck = fecm.read_one(small())
    node = NodeValues(1, 0, (np.float64(0.123456789012), np.float64(1.6)))
    changed = replace(deck, segments=(Coordinates((node,)),), text="")
    assert "np." not in changed.to_text()
    assert "0.123456789012" in changed.to_text()
