"""Cards of numbers that are read and written in blocks: the same as card by card, but faster."""

from __future__ import annotations

import copy
import pickle
import random
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fecm
from fecm import Deck, read_deck
from fecm.deck.card import Card, FieldKind, Fields, _format_numeral, format_real, layout
from fecm.deck.findings import Findings
from fecm.deck.format import format_deck
from fecm.deck.mesh_cards import Boundary, Coordinates, Elements, Forces
from fecm.deck.model import Control
from fecm.deck.reader import Reader
from fecm.deck.segment import NumberedSegment
from fecm.deck.table import CardTable, TableReader, write_rows
from fecm.deck.values import read_values
from fecm.problem.generate import generate
from tests.decks import ROOT, small
from tests.fuzz_decks import FORC, OWN, mutate

FIELDS = {
    "COOR": layout("I5 node", "I5 increment", "F10 x", "F10 y"),
    "ELEM": layout("I5 element", *(f"I5 node {i}" for i in range(1, 10)), "I5 increment"),
    "GAGE": layout("I5 gage", "X5", "F10 x", "F10 y", "F10 z", "F10 direction"),
}
INTEGERS = ["1", "12", "99999", "-1", "+12", "0", "-0", "00012", "1.", "1E2", "1-2", "x", "", "1 2"]
REALS = [
    "0.5", "1.", ".5", "-.25", "+1.5", "-0.0", "12", "1.E5", "1.5E-3", "1E+05", "1e5", "2.5E-12",
    "1E400", "1E-400", "1.5D+3", "1.5-3", "1.5d3", "25-8", "1E5.", "1.2.3", "--1", "+-1", ".", "-",
    "nan", "inf", "1_0", "0.12345678", "-1.2345678", "0.123456789012345678", "9" * 120, "\u0663",
    "1E123", "1 5", "1.5 E3", "", "1,5", "0x10", "1\xa05",
]  # fmt: skip


def described(text: str, *, listing: bool = False) -> object:
    """All that reading a text gives."""
    reader = Reader(text, blanks_are_zeros=listing, keeps_values=True)
    problems = [
        (
            problem.unsound,
            repr(problem.deck),
            problem.deck and problem.deck.text,
            cards(problem.deck),
        )
        for problem in reader.problems()
    ]
    kept = {line: repr(values) for line, (_, values) in reader.cards.read.items()}
    return problems, kept, [finding.render("deck") for finding in reader.findings]


def cards(deck: Deck | None) -> list[str]:
    """Text of a deck's records with their sources."""
    return [
        f"{record!r} {record.source}"
        for segment in (deck.segments if deck else ())
        for record in (segment.records if isinstance(segment, NumberedSegment) else (segment,))
    ]


def by_card(text: str, *, listing: bool = False) -> object:
    """All that reading a text card by card gives."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(TableReader, "take", lambda *_: 0)
        return described(text, listing=listing)


def nasty_line(fields: Fields, chance: random.Random) -> str:
    """A line of numbers, most of them sound, with or without commas."""
    sound = chance.random() < 0.5
    texts = []
    for field in fields:
        choices = INTEGERS if field.kind is FieldKind.INTEGER else REALS
        texts.append(chance.choice(choices[:7] if sound or chance.random() < 0.8 else choices))
    texts = texts[: chance.choice([len(texts)] * 6 + [1, 2, 3])]
    if chance.random() < 0.4:
        return chance.choice([",", ", ", " , "]).join(texts) + chance.choice(
            ["", "", ",", " ", ",1"]
        )
    line = ""
    for field, text in zip(fields, texts, strict=False):
        line = line.ljust(field.first - 1)
        width = field.width
        placed = chance.choice([text.rjust(width)] * 12 + [text.ljust(width), text.center(width)])
        line += placed[:width] if chance.random() < 0.9 else placed
    return line + chance.choice([""] * 8 + ["  ", " 7", "\t", " ! note", "5", "      9"])


def deck_of(lines: Sequence[str], keyword: str) -> str:
    """A deck with the lines as the cards of a segment."""
    return "\n".join(
        [
            "FECM",
            "   25    4    2    2    5    9",
            keyword,
            *lines,
            "",
            "END",
            "MACR",
            "END",
            "STOP",
        ]
    )


@pytest.mark.parametrize("listing", [False, True], ids=["report", "listing"])
@pytest.mark.parametrize("keyword", FIELDS)
@pytest.mark.few(2)  # of 6, 0.2 s each
def test_lines_in_blocks_give_the_values_and_findings_of_single_cards(
    keyword: str, listing: bool
) -> None:
    chance = random.Random(7)
    for _ in range(60):
        lines = [nasty_line(FIELDS[keyword], chance) for _ in range(12)]
        text = deck_of(lines, keyword)
        assert described(text, listing=listing) == by_card(text, listing=listing)


@pytest.mark.parametrize("keyword", FIELDS)
@pytest.mark.few(1)  # of 3, 0.1 s each
def test_a_line_is_read_in_a_block_only_if_its_card_has_no_finding(keyword: str) -> None:
    chance = random.Random(11)
    fields, taken = FIELDS[keyword], 0
    for _ in range(2000):
        line = nasty_line(fields, chance)
        reader = TableReader(fields)
        if not reader.take([(1, line)], 0):
            continue
        taken += 1
        for zeros in (False, True):
            findings = Findings()
            values = read_values(Card(1, line), fields, findings, blanks_are_zeros=zeros)
            assert not findings, line
            assert values is not None, line
            assert list(values) == reader.values.tolist(), line
    assert taken > 500


@pytest.mark.parametrize("seeds", [range(60), pytest.param(range(60, 600), marks=pytest.mark.long)])
def test_mutated_decks_read_in_blocks_as_card_by_card(seeds: range) -> None:
    base = small().replace("ROD\n", f"{FORC}ROD\n").replace("ROD\n", f"{OWN}ROD\n", 1)
    for seed in seeds:
        text = mutate(base, random.Random(seed))
        assert described(text) == by_card(text), seed


@pytest.mark.parametrize("path", sorted((ROOT / "decks").glob("*.inp")), ids=lambda path: path.stem)
@pytest.mark.parametrize("listing", [False, True], ids=["report", "listing"])
def test_the_decks_of_the_repository_read_in_blocks_as_card_by_card(
    path: Path, listing: bool
) -> None:
    text = path.read_text()
    assert described(text, listing=listing) == by_card(text, listing=listing)


def distorted(count: int) -> Deck:
    """A deck of `count` by `count` nodes, most of whose coordinates don't fit their columns."""
    chance = np.random.default_rng(3)
    nodes = count * count
    places = chance.random((nodes, 2)).round(6)
    places[::2] += chance.random((len(places[::2]), 2))
    values = np.column_stack((np.arange(1, nodes + 1), np.zeros(nodes), places))
    deck = fecm.read_one(small())
    built = Coordinates.of(deck.control, values)
    return replace(deck, segments=(built, *deck.segments[1:]), text="")


@pytest.mark.parametrize("free", [True, False], ids=["commas", "columns"])
def test_sound_lines_are_not_read_card_by_card(free: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    read: list[int] = []

    def counted(card: Card, *rest: Any, **options: Any) -> Any:
        read.append(card.line)
        return read_values(card, *rest, **options)

    monkeypatch.setattr("fecm.deck.segment.read_values", counted)
    line = "{}, 0, {!r}, {!r}" if free else "{:5d}    0{:10.8f}{:10.7f}"
    places = np.random.default_rng(5).random((500, 2)).tolist()
    Reader(
        deck_of([line.format(n, *place) for n, place in enumerate(places, 1)], "COOR")
    ).problems()
    assert len(read) == 1  # the control card


def test_a_table_behaves_as_the_tuple_of_its_records() -> None:
    built = distorted(5).require(Coordinates).records
    records = tuple(built)
    assert isinstance(built, CardTable)
    assert len(built) == 25
    assert isinstance(built[3].node, int)
    assert built == records
    assert records == built
    assert built == copy.deepcopy(built)
    assert built != records[:-1]
    assert built != list(records)
    assert hash(built) == hash(records)
    assert repr(built) == repr(records)
    assert pickle.loads(pickle.dumps(built)) == built  # what this test wrote
    assert (built[-1], built[1:5:2], built + records) == (records[-1], records[1:5:2], records * 2)
    assert (*records, *records) == records + built
    with pytest.raises(IndexError):
        built[25]


def test_records_of_a_table_know_their_cards_after_a_pickle() -> None:
    deck = fecm.read_one(ROOT / "decks" / "impact-115.inp")
    again = pickle.loads(pickle.dumps(deck))  # what this test wrote
    place = again.require(Elements).records[1].place("node 2")
    assert place == deck.require(Elements).records[1].place("node 2")
    assert place.text == "   15   59   61  119  117   60   90  118   88   89    2"
    assert (place.first, place.last) == (11, 15)


def test_blocks_are_written_as_single_cards() -> None:
    deck = distorted(20)
    records = deck.require(Coordinates).records
    assert isinstance(records, CardTable)
    written = list(write_rows(records))
    assert written == [record.to_card(records.fields) for record in records]
    assert len({"," in line for line in written}) == 2
    assert read_deck(deck.to_text()) == deck


def test_short_numerals_are_written_as_the_first_form_that_fits() -> None:
    chance = random.Random(2)
    for _ in range(3000):
        value = round(chance.uniform(-1, 1) * 10 ** chance.randint(-12, 18), chance.randint(0, 12))
        for width in (5, 10, 15):
            assert format_real(value, width) == _format_numeral(repr(value), width), value


def test_a_table_generates_the_mesh_of_its_records() -> None:
    decks = [read_deck(path) for path in sorted((ROOT / "decks").glob("*.inp"))]
    for deck in [distorted(5), *decks]:
        assert isinstance(deck, Deck)
        segments = tuple(
            replace(segment, records=tuple(segment.records))
            if isinstance(segment, NumberedSegment)
            else segment
            for segment in deck.segments
        )
        meshes = (generate(deck), generate(replace(deck, segments=segments)))
        for name in ("coordinates", "elements", "codes", "forces"):
            one, other = (getattr(mesh, name) for mesh in meshes)
            assert one.dtype == other.dtype
            assert one.tobytes() == other.tobytes()


def test_formatting_keeps_what_lines_in_blocks_say() -> None:
    text = deck_of(["1, 0, 0.5, 0.25", "    2          .25       0.5"], "COOR")
    cards = format_deck(text + "\n").splitlines()
    assert "    1    0       0.5      0.25" in cards
    assert "    2    0      0.25       0.5" in cards


@pytest.mark.parametrize("records", ["tuple", "table"])
def test_segments_without_cards_generate_nothing(records: str) -> None:
    control = Control(4, 1, 1, 2, 5, 4)
    kinds = (Coordinates, Elements, Boundary, Forces)
    segments = tuple(
        kind(()) if records == "tuple" else kind.of(control, np.empty((0, 6))) for kind in kinds
    )
    mesh = generate(Deck("", control, segments, ()))
    assert np.isnan(mesh.coordinates).all()
    assert not mesh.elements.any()
    assert not mesh.codes.any()
    assert not mesh.forces.any()
