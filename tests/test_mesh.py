"""Generation by increment, as the listing's GENVEC and PMESH do it."""

from __future__ import annotations

import numpy as np
import pytest

from fecm.deck.findings import Findings
from fecm.deck.model import (
    Boundary,
    Control,
    Coordinates,
    Deck,
    ElementNodes,
    Elements,
    Forces,
    NodeCodes,
    NodeValues,
)
from fecm.deck.segment import Segment
from fecm.mechanics.mesh import MeshArrays
from fecm.problem.generate import generate


def mesh(*segments: Segment, numnp: int = 9, numel: int = 4, nen: int = 4) -> MeshArrays:
    """A mesh of these segments."""
    control = Control(numnp, numel, 1, 2, 5, nen)
    return generate(Deck("", control, segments, ()))


def codes(*segments: Segment, numnp: int = 9, numel: int = 4) -> list[str]:
    """Codes of what can't be generated."""
    findings = Findings()
    generate(Deck("", Control(numnp, numel, 1, 2, 5, 4), segments, ()), findings)
    return [finding.code for finding in findings]


def coordinates(*cards: tuple[int, int, float]) -> Coordinates:
    """COOR cards: node, increment, x."""
    return Coordinates(tuple(NodeValues(n, step, (x, 2.0 * x)) for n, step, x in cards))


def test_nodes_between_two_cards_are_interpolated() -> None:
    x = mesh(coordinates((1, 2, 0.0), (7, 0, 3.0))).coordinates[:, 0]
    np.testing.assert_array_equal(x[[0, 2, 4, 6]], [0.0, 1.0, 2.0, 3.0])
    assert np.isnan(x[[1, 3, 5, 7, 8]]).all()


def test_an_increment_that_does_not_divide_the_gap_makes_the_last_step_shorter_in_numbers() -> None:
    # Nodes 1, 4, 7 from 1 to 8 at steps of 3: three steps of (8 - 1)'s coordinate difference.
    x = mesh(coordinates((1, 3, 0.0), (8, 0, 3.0))).coordinates[:, 0]
    np.testing.assert_array_equal(x[[0, 3, 6, 7]], [0.0, 1.0, 2.0, 3.0])


def test_descending_numbers_generate_downwards_whatever_the_increments_sign() -> None:
    for step in (2, -2):
        x = mesh(coordinates((9, step, 0.0), (3, 0, 3.0))).coordinates[:, 0]
        np.testing.assert_array_equal(x[[8, 6, 4, 2]], [0.0, 1.0, 2.0, 3.0])


def test_the_increment_stands_on_the_card_where_generation_begins() -> None:
    x = mesh(coordinates((1, 0, 0.0), (5, 1, 4.0), (8, 0, 7.0))).coordinates[:, 0]
    assert np.isnan(x[1:4]).all()
    np.testing.assert_array_equal(x[4:8], [4.0, 5.0, 6.0, 7.0])


def test_steps_are_added_one_by_one_with_their_rounding() -> None:
    x = mesh(coordinates((1, 1, 0.0), (4, 0, 0.7)), numnp=4).coordinates[:, 0]
    step = 0.7 / 3.0
    assert x[1] == step
    assert x[2] == step + step
    assert x[3] == 0.7


def test_a_second_coor_starts_anew_and_a_second_forc_adds_to_the_first() -> None:
    twice = mesh(coordinates((1, 0, 1.0)), coordinates((2, 0, 2.0)))
    assert twice.given.tolist() == [False, True] + [False] * 7
    force = [Forces((NodeValues(n, 0, (0.0, 0.0, float(n), 0.0, 0.0)),)) for n in (1, 2)]
    assert mesh(*force).forces[:3, 2].tolist() == [1.0, 2.0, 0.0]


def test_elements_between_two_cards_step_by_the_earlier_cards_increment() -> None:
    cards = Elements(
        (ElementNodes(1, (1, 2, 5, 4), 10), ElementNodes(3, (2, 3, 6, 5), 1)),
    )
    elements = mesh(cards, numnp=40).elements
    assert elements.tolist() == [[1, 2, 5, 4], [11, 12, 15, 14], [2, 3, 6, 5], [3, 4, 7, 6]]


def test_a_blank_increment_of_elements_is_one_and_absent_nodes_stay_absent() -> None:
    cards = Elements((ElementNodes(1, (1, 2, 5, 4, 0, 7), 0),))
    elements = mesh(cards, numnp=40, numel=3, nen=6).elements
    assert elements.tolist() == [[1, 2, 5, 4, 0, 7], [2, 3, 6, 5, 0, 8], [3, 4, 7, 6, 0, 9]]


def test_negative_codes_carry_on_through_generated_nodes_and_positive_ones_do_not() -> None:
    cards = Boundary((NodeCodes(1, 2, (-1, 1, 0, 0, 0)), NodeCodes(7, 0, (0, 0, 1, 0, 0))))
    built = mesh(cards).codes
    assert built[:, 0].tolist() == [-1, 0, -1, 0, -1, 0, -1, 0, 0]
    assert built[:, 1].tolist() == [1, 0, 0, 0, 0, 0, 0, 0, 0]
    assert built[:, 2].tolist() == [0, 0, 0, 0, 0, 0, 1, 0, 0]


def test_a_negative_code_reaches_the_next_card_even_without_an_increment() -> None:
    cards = Boundary((NodeCodes(1, 0, (-1, -1, 0, 0, 0)), NodeCodes(5, 0, (0, 1, 0, 0, 0))))
    built = mesh(cards).codes
    assert built[4].tolist() == [-1, 1, 0, 0, 0]
    assert not built[1:4].any()


def test_codes_carry_on_downwards_too() -> None:
    cards = Boundary((NodeCodes(9, 1, (-1, 0, 0, 0, 0)), NodeCodes(5, 0, (1, 0, 0, 0, 0))))
    assert mesh(cards).codes[:, 0].tolist() == [0, 0, 0, 0, 1, -1, -1, -1, -1]


def test_equations_are_numbered_by_node_and_unknown() -> None:
    cards = Boundary((NodeCodes(1, 1, (-1, -1, 0, 0, 0)), NodeCodes(3, 0, (1, 1, 1, 0, 0))))
    built = mesh(cards, numnp=4)
    assert built.equations.tolist() == [
        [0, 0, 1, 2, 3],
        [0, 0, 4, 5, 6],
        [0, 0, 0, 7, 8],
        [9, 10, 11, 12, 13],
    ]
    assert built.number_of_equations == 13


@pytest.mark.parametrize(
    ("segment", "code"),
    [
        (coordinates((10, 0, 0.0)), "E301"),
        (coordinates((0, 0, 1.0)), "E301"),
        (coordinates((3, 1, 0.0), (3, 0, 1.0)), "E302"),
        (Elements((ElementNodes(5, (1, 2, 3, 4), 0),)), "E303"),
        (Elements((ElementNodes(1, (1, 2, 3, 4), 0), ElementNodes(1, (1, 2, 3, 4), 0))), "E304"),
        (Elements((ElementNodes(2, (1, 2, 3, 4), 0),)), "E305"),
    ],
)
def test_what_cannot_be_generated_is_found(segment: Segment, code: str) -> None:
    assert codes(segment) == [code]
