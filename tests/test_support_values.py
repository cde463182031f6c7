"""Springs and one-sided supports as values of sweeps and of Deck.with_."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

import fecm
from fecm.deck import model
from fecm.deck.model import Deck, NodeValues, OneSidedSupport, OneSidedSupports, Springs

SIZE, MESH = (100.0, 60.0), (4, 4)  # 9 x 9 nodes
LAMINATE = fecm.Laminate("[0/90]2s", "IM7/8552", 0.25)
SHORT: dict[str, Any] = {"velocity": 500.0, "duration": 1e-3, "units": "mm-N-s"}


def on(segments: tuple[model.Segment, ...], support: str = "free") -> Deck:
    """A plate with more segments."""
    deck = fecm.impact(
        fecm.Plate.rectangle(SIZE, MESH, support=support),
        LAMINATE,
        fecm.RigidMass(1e-5),
        fecm.Contact.estimate(radius=8),
        kinematics="linear",
        **SHORT,
    )
    return replace(deck, segments=(*deck.segments, *segments), text="")


def edges(rotation: float, w: float) -> Springs:
    """Springs along the edges at the bottom and the top."""
    values = 0.0, 0.0, w, 0.0, rotation
    lines = NodeValues(1, 9, values), NodeValues(73, 81, values)
    return Springs(lines, word="LINE")


def window(stiffness: float, gap: float = 0.0) -> OneSidedSupports:
    """The same edges, which only push."""
    lines = OneSidedSupport(1, 9, 1, stiffness, gap), OneSidedSupport(73, 81, 1, stiffness, gap)
    return OneSidedSupports(lines, word="LINE")


def clamps(stiffness: float) -> Springs:
    """Springs of w at two corners, and one of a rotation."""
    held = (0.0, 0.0, stiffness, 0.0, 0.0)
    turning = NodeValues(41, 0, (0.0, 0.0, 0.0, 70.0, 0.0))
    return Springs((NodeValues(1, 0, held), turning, NodeValues(81, 0, held)))


# The deck, the value, and the segments of the deck with it.
CASES: dict[str, tuple[tuple[model.Segment, ...], float, tuple[model.Segment, ...]]] = {
    "edge_kr": ((edges(100.0, 50.0), clamps(9.0)), 3.0, (edges(300.0, 50.0), clamps(9.0))),
    "edge_kw": ((edges(100.0, 50.0), clamps(9.0)), 3.0, (edges(100.0, 150.0), clamps(9.0))),
    "clamp_k": ((edges(100.0, 50.0), clamps(9.0)), 20.0, (edges(100.0, 50.0), clamps(20.0))),
    "window_k": ((window(400.0), clamps(9.0)), 900.0, (window(900.0), clamps(9.0))),
    "gap": ((window(400.0), clamps(9.0)), 0.01, (window(400.0, 0.01), clamps(9.0))),
}


@pytest.mark.parametrize("name", CASES)
def test_a_value_of_the_supports_is_that_of_the_cards_changed_by_hand(name: str) -> None:
    segments, value, changed = CASES[name]
    deck = on(segments)
    values: dict[str, Any] = {name: value}
    assert deck.with_(**values).to_text() == on(changed).to_text()


@pytest.mark.parametrize("name", ["edge_kr", "window_k"])
def test_a_sweep_of_the_supports_equals_runs_of_the_changed_decks(name: str) -> None:
    segments, value, changed = CASES[name]
    peak = fecm.run_one(on(changed)).history.force.max()
    swept = fecm.sweep(on(segments), {name: [value]})
    assert swept["peak_force"][0] == pytest.approx(peak, rel=1e-11)


@pytest.mark.parametrize(
    ("name", "missing"),
    [
        ("edge_kr", "no springs of rotations along lines"),
        ("edge_kw", "no springs of w along lines"),
        ("clamp_k", "no springs of w at nodes"),
        ("window_k", "no UNIL LINE"),
        ("gap", "no UNIL"),
    ],
)
def test_a_value_of_supports_that_a_deck_lacks_names_their_cards(name: str, missing: str) -> None:
    lines = Springs((NodeValues(1, 9, (1.0, 0.0, 0.0, 0.0, 0.0)),), word="LINE")
    deck = on((lines,), "simple")
    values: dict[str, Any] = {name: 2.0}
    with pytest.raises(fecm.FecmError, match=f"{name}: the deck has {missing}"):
        deck.with_(**values)


def test_a_negative_stiffness_fails_its_case_alone() -> None:
    deck = on((edges(100.0, 50.0),))
    with pytest.warns(fecm.FecmWarning, match="A stiffness of node 1 is negative"):
        swept = fecm.sweep(deck, {"edge_kr": [-1.0, 2.0]})
    assert swept["validity"][0] == "failed"
    assert swept["peak_force"][1] > 0.0
