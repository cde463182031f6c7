"""Decks that are too large, too long or no decks: each is refused quickly and in few words."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import h5py
import pytest

from fecm import _machine
from fecm._machine import NotEnoughMemoryError
from fecm.deck import reader, segment
from fecm.deck.card import Card, parse_integer
from fecm.deck.findings import MOST, CardPlace, Finding, Findings
from fecm.deck.layup import LayupError, parse_layup
from fecm.deck.macros import estimate_work
from fecm.deck.reader import MOST_PROBLEMS, load_text
from fecm.problem import generate
from fecm.problem.loading import load_deck
from fecm.problem.rules import gages as gage_rules
from tests.calls import assert_unusable, call
from tests.decks import DATA_CARDS, MESH, OWN_FINDINGS, PROGRAM, small

TINY_PROBLEM = "FECM\n1,1,1,2,5,3\nEND\nMACR\nEND\n"


def codes(text: str) -> list[str]:
    """Codes of a text's findings, without those of the small plate."""
    return [f.code for f in load_deck(text).findings if f.code not in OWN_FINDINGS]


# Numbers -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("card", ["13,3,{}", "{},3,115.", "   13    3{:>10}"])
@pytest.mark.parametrize(
    "number", ["1" * 1_000_000, "1" * 60_000 + "x", "0" * 41 + "13" + "0" * 99]
)
def test_a_number_of_too_many_characters_is_an_error_in_few_words(card: str, number: str) -> None:
    text = small(data=DATA_CARDS.replace("   13    3     115.0", card.format(number)))
    (finding,) = load_deck(text).errors()
    assert finding.code in ("E105", "E109")
    assert len(finding.render("deck")) < 3000


def test_leading_zeros_do_not_change_a_whole_number() -> None:
    assert parse_integer("0" * 41 + "13") == 13


def test_a_card_of_a_million_commas_is_read_like_one_of_three() -> None:
    short, long = (
        codes(small(data=DATA_CARDS.replace("   13    3     115.0", "13,3,115.0" + "," * n)))
        for n in (3, 1_000_000)
    )
    assert short == long == []


# Problems, cards and findings --------------------------------------------------------------------


def test_checking_goes_through_the_findings_no_more_often_with_more_problems(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    all_of_them, passes = Findings.__iter__, 0

    def counted(findings: Findings) -> Iterator[Finding]:
        nonlocal passes
        passes += 1
        return all_of_them(findings)

    monkeypatch.setattr(Findings, "__iter__", counted)
    taken = []
    for count in (2, 40):
        passes = 0
        assert load_deck(TINY_PROBLEM * count + "STOP\n").errors()
        taken.append(passes)
    assert taken[0] == taken[1]


def test_too_many_problems_are_refused_before_they_are_checked() -> None:
    assert codes(TINY_PROBLEM * (MOST_PROBLEMS + 1) + "STOP\n") == ["E012"]


def test_a_program_of_too_many_cards_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reader, "MOST_MACRO_CARDS", 7)
    assert codes(small()) == []
    assert codes(small(PROGRAM + "LMAS\n")) == ["E012"]


def test_a_file_of_errors_ends_after_the_first_thousand_and_says_so(tmp_path: Path) -> None:
    deck = tmp_path / "bomb.inp"
    deck.write_text(small("Q\n" * 2000))
    checked = call("check", deck)
    assert checked.exit_code == 1
    assert checked.stdout.count("error[E501]") == MOST
    assert "error[E000]: There are 1000 errors or more" in checked.stdout
    assert "the deck has 1000 errors or more" in checked.stderr
    assert len(checked.stdout) < 500_000


def test_warnings_beyond_the_first_thousand_are_counted_and_errors_still_shown() -> None:
    findings = Findings()
    for _ in range(MOST + 7):
        findings.add("W106", "Text is not read.")
    findings.add("E101", "This is no number.")
    actual = list(findings)
    assert len(actual) == MOST + 2
    assert [f.code for f in findings.errors] == ["E101"]
    assert "7 more warnings" in actual[-1].message


def test_counting_errors_does_not_take_longer_with_their_number() -> None:
    findings = Findings()
    for _ in range(3 * MOST):
        findings.add("E101", "This is no number.")
    assert findings.error_count == 3 * MOST
    assert findings.closed


# Cost ------------------------------------------------------------------------------------------


def test_blank_lines_between_segments_make_no_cards(monkeypatch: pytest.MonkeyPatch) -> None:
    cards = 0

    def counted(line: int, text: str) -> Card:
        nonlocal cards
        cards += 1
        return Card(line, text)

    monkeypatch.setattr(segment, "Card", counted)
    values = []
    for blanks in (0, 5000):
        cards = 0
        assert codes(small().replace("MATE", "\n" * blanks + "MATE")) == []
        values.append(cards)
    assert values[0] == values[1] > 0


@pytest.mark.parametrize(
    ("keyword", "pair"),
    [
        ("COOR", "1,1,0.,0.\n9000,1,1.,1.\n"),
        ("FORC", "1,1,0.,0.\n9000,1,1.,1.\n"),
        ("BOUN", "1,1,-1\n9000,1,-1\n"),
    ],
)
def test_cards_that_generate_the_same_nodes_again_and_again_are_refused(
    keyword: str, pair: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    covers, nodes = generate._Budget.covers, 0

    def counted(budget: Any, count: int, place: Callable[[], CardPlace | None]) -> bool:
        nonlocal nodes
        covered = covers(budget, count, place)
        nodes += count * covered
        return covered

    monkeypatch.setattr(generate._Budget, "covers", counted)
    text = f"FECM\n9000,1,1,2,5,3\n{keyword}\n{pair * 500}\nEND\nMACR\nEND\nSTOP\n"
    assert "E012" in codes(text)
    assert 5 * 9000 < nodes <= 10 * 9000 + 10_000


def test_a_coor_segment_for_every_few_bytes_is_refused() -> None:
    text = "FECM\n9000,1,1,2,5,3\n" + "COOR\n\n" * 50 + "END\nMACR\nEND\nSTOP\n"
    assert "E012" in codes(text)


def test_too_many_segments_layers_and_gages_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    prints = small(data=DATA_CARDS + "PRIN\nNOPR\n")
    gages = small(data=DATA_CARDS + "GAGE\n1,.5,.5\n2,.5,.5\n\n")
    assert codes(prints) == codes(gages) == []
    monkeypatch.setattr(gage_rules, "MOST_GAGES", 1)
    assert codes(gages) == ["E012"]
    monkeypatch.setattr(reader, "MOST_LAYERS", 1)
    assert codes(small()) == ["E201"]
    monkeypatch.setattr(reader, "MOST_LAYERS", 2)
    monkeypatch.setattr(reader, "MOST_SEGMENTS", 7)
    assert codes(prints) == ["E012"]


# Programs ----------------------------------------------------------------------------------------


def test_empty_loops_count_toward_the_length_of_a_program() -> None:
    empty = "LOOP,,1.E9\nLOOP,,1.E9\nNEXT\nNEXT\n"
    assert codes(small(PROGRAM + empty)) == ["E509"]
    program = load_deck(small("LOOP,10\nLOOP,7\nNEXT\nNEXT\n")).problems[0].program
    assert estimate_work(program).macros == 10 * 7 + 10


def test_a_program_longer_than_any_float_is_an_error_with_its_length() -> None:
    text = small("LMAS\nDT,,.5E-6\n" + "LOOP,99999\n" * 63 + "TIME\nRODP\n" + "NEXT\n" * 63)
    (finding,) = load_deck(text).errors()
    assert finding.code == "E509"
    # 99999^63 passes of TIME, RODP and the innermost NEXT
    assert "3e+315 macros" in finding.message


@pytest.mark.parametrize("card", ["LOOP,1e300", "RODP,1e300", "EIGE,2e9", "DISP,1e18"])
def test_a_count_beyond_any_program_is_an_error(card: str) -> None:
    actual = load_deck(small(PROGRAM + card + "\n")).errors()
    assert "E505" in [finding.code for finding in actual]
    assert max(len(finding.message) for finding in actual) < 100


# Files -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("command", ["check", "run", "fmt"])
def test_a_result_given_as_a_deck_is_named_with_its_command(command: str, tmp_path: Path) -> None:
    result = tmp_path / "result.h5"
    with h5py.File(result, "w") as file:
        file["x"] = range(9)
    done = call(command, result)
    assert_unusable(done)
    assert "HDF5" in done.stderr
    assert f"`fecm info {result}`" in done.stderr


@pytest.mark.parametrize("data", [b"\x7fELF\x02\x01\x01\x00\x00", small().encode("utf-16-le")])
def test_a_binary_file_given_as_a_deck_is_refused_in_one_line(data: bytes, tmp_path: Path) -> None:
    deck = tmp_path / "deck.inp"
    deck.write_bytes(data)
    done = call("check", deck)
    assert_unusable(done)
    assert "binary" in done.stderr


def test_a_deck_whose_cards_exceed_the_free_memory_is_not_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    deck = tmp_path / "deck.inp"
    deck.write_text("1\n" * 400_000)
    monkeypatch.setattr(reader, "available_memory", lambda: 300_000_000)
    monkeypatch.setattr(_machine, "available_memory", lambda: 300_000_000)
    with pytest.raises(NotEnoughMemoryError, match=r"deck\.inp: the deck takes about .* free"):
        load_text(deck)
    deck.write_text("! a comment of some length\n" + "1" * 800_000)
    assert len(load_text(deck)[0]) > 800_000


# Elements and layups -----------------------------------------------------------------------------


def test_a_node_number_out_of_range_is_reported_where_coordinates_have_errors_too() -> None:
    mesh = MESH.replace("    5    0       2.0", "   77    0       2.0")
    mesh = mesh.replace("    3   11   13   23", "    3   11   13   93")
    assert codes(small(mesh=mesh)) == ["E301", "E309"]


def test_element_cards_in_the_wrong_order_are_reported_without_what_follows_from_it() -> None:
    mesh = MESH.replace("    3   11   13   23", "    1   11   13   93")
    assert codes(small(mesh=mesh)) == ["E304"]


def test_layups_nest_to_a_limit() -> None:
    deepest = "[" * 32 + "0/90" + "]" * 32
    assert parse_layup(deepest) == [0.0, 90.0]
    with pytest.raises(LayupError, match="nested deeper than 32"):
        parse_layup(f"[{deepest}]")


@pytest.mark.parametrize(
    "text", ["[" * 100_000, "[" + "(" * 5000 + "0" + ")" * 5000 + "]", "9" * 400, "0/" * 100_000]
)
def test_a_layup_that_cannot_be_meant_is_refused_in_few_words(text: str) -> None:
    with pytest.raises(LayupError) as caught:
        parse_layup(text)
    assert len(str(caught.value)) < 250
