"""Any text at all gives a model or findings, never another exception."""

from __future__ import annotations

import random
from dataclasses import replace

from hypothesis import given, settings
from hypothesis import strategies as st

from fecm import Ply
from fecm.deck.model import (
    Allowables,
    Boundary,
    Compact,
    Control,
    Coordinates,
    Cure,
    Curvature,
    Deck,
    ElementNodes,
    Elements,
    Expansion,
    Forces,
    Impact,
    Indentation,
    Integration,
    LaminateNumber,
    Laminates,
    Layer,
    Macro,
    Material,
    MaterialNumber,
    Materials,
    NodeCodes,
    NodeValues,
    Nonlinear,
    NumberedLaminate,
    NumberedPly,
    OneSidedSupport,
    OneSidedSupports,
    Page,
    PointMasses,
    Preload,
    PrintOption,
    Springs,
    Units,
    Zone,
    Zones,
)
from fecm.deck.reader import Reader
from fecm.problem.loading import load_deck
from tests.decks import small
from tests.fuzz_decks import examine, mutate

numbers = st.floats(allow_nan=False, allow_infinity=False)
counts = st.integers(-99999, 999999)
words = st.text("ABCXYZ", min_size=1, max_size=4).filter(lambda word: word not in ("END", "STOP"))


@st.composite
def decks(draw: st.DrawFn) -> Deck:
    """Models that make no sense but can stand on cards."""

    def some(strategy: st.SearchStrategy[object]) -> tuple[object, ...]:
        return tuple(draw(st.lists(strategy, max_size=4)))

    nodes = st.integers(1, 99999)
    layers = draw(st.integers(1, 3))
    five = st.tuples(*[numbers] * 5)
    layer = st.builds(Layer, counts, numbers, numbers, counts)
    ply = st.builds(Ply, *[numbers] * 7)
    strengths = st.builds(Allowables, *[numbers] * 10, counts)
    segments = draw(
        st.lists(
            st.one_of(
                st.lists(st.builds(NodeValues, nodes, counts, st.tuples(numbers, numbers))).map(
                    lambda records: Coordinates(tuple(records))
                ),
                st.lists(st.builds(NodeValues, nodes, counts, five), max_size=4).map(
                    lambda records: Forces(tuple(records))
                ),
                st.builds(
                    lambda records, word: Springs(tuple(records), word=word),
                    st.lists(st.builds(NodeValues, nodes, counts, five), max_size=4),
                    st.sampled_from(["", "LINE"]),
                ),
                st.builds(
                    lambda records, word: OneSidedSupports(tuple(records), word=word),
                    st.lists(
                        st.builds(OneSidedSupport, nodes, counts, counts, numbers, numbers),
                        max_size=4,
                    ),
                    st.sampled_from(["", "LINE"]),
                ),
                st.lists(st.builds(NodeValues, nodes, counts, st.tuples(numbers, numbers))).map(
                    lambda records: PointMasses(tuple(records))
                ),
                st.lists(
                    st.builds(NodeCodes, nodes, counts, st.tuples(*[counts] * 5)), max_size=4
                ).map(lambda records: Boundary(tuple(records))),
                st.lists(
                    st.builds(ElementNodes, nodes, st.tuples(*[counts] * 4), counts), max_size=4
                ).map(lambda records: Elements(tuple(records))),
                st.builds(
                    Material,
                    st.builds(Integration, counts, counts, counts, numbers, numbers),
                    ply,
                    st.tuples(*[layer] * layers),
                ),
                st.lists(
                    st.builds(NumberedPly, st.builds(MaterialNumber, counts), ply), max_size=3
                ).map(lambda plies: Materials(tuple(plies))),
                st.lists(
                    st.tuples(counts, st.lists(layer, min_size=1, max_size=3)), max_size=3
                ).map(
                    lambda given: Laminates(
                        tuple(
                            NumberedLaminate(LaminateNumber(number, len(own)), tuple(own))
                            for number, own in given
                        )
                    )
                ),
                st.lists(st.builds(Zone, *[counts] * 4), max_size=4).map(
                    lambda zones: Zones(tuple(zones))
                ),
                st.builds(
                    lambda first, others: replace(first, others=tuple(others)),
                    strengths,
                    st.lists(strengths, max_size=2),
                ),
                st.builds(Impact, counts, counts, numbers),
                st.builds(Indentation, *[numbers] * 4),
                st.builds(Nonlinear),
                st.builds(Compact),
                st.builds(Preload, *[numbers] * 3),
                st.builds(Curvature, *[numbers] * 3),
                st.builds(
                    Cure,
                    numbers,
                    numbers,
                    st.lists(st.builds(Expansion, nodes, *[numbers] * 4), max_size=4).map(tuple),
                ),
                st.builds(Units, words, words, words),
                st.builds(PrintOption, st.booleans()),
                st.builds(Page, st.sampled_from(["", "0", "1"])),
            ),
            max_size=6,
        )
    )
    macros = draw(
        st.lists(st.builds(Macro, words, st.sampled_from(["", "AB"]), numbers, numbers), max_size=5)
    )
    control = Control(draw(st.integers(1, 999)), 1, layers, 2, 5, 4)
    return Deck("title", control, tuple(segments), tuple(macros))


@settings(max_examples=60)
@given(decks())
def test_printing_and_reading_a_model_gives_it_back(deck: Deck) -> None:
    reader = Reader(deck.to_text())
    (problem,) = reader.problems()
    assert reader.findings.errors == []
    assert problem.deck == deck


# Faster than st.text(), for which hypothesis makes tables of all characters.
RANGES = (st.integers(0, 0x7F), st.integers(0x80, 0xD7FF), st.integers(0xE000, 0x10FFFF))


@given(st.lists(st.one_of(RANGES).map(chr), max_size=400).map("".join))
def test_any_text_gives_findings(text: str) -> None:
    assert load_deck(text + "\n").findings


@given(st.text("FECM COOR\n0123456789.-+ED,! \t", max_size=600))
def test_any_text_of_a_decks_own_letters_gives_findings(text: str) -> None:
    assert load_deck("FECM x\n" + text + "\n").findings


@settings(max_examples=100)
@given(st.integers(0, 2**32))
def test_any_mutation_of_a_deck_gives_a_model_or_findings(seed: int) -> None:
    assert examine(mutate(small(), random.Random(seed))) in ("errors", "warnings", "sound")
