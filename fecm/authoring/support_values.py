"""Values that change the springs and the one-sided supports of a deck: their setters.

A factor multiplies what the deck has. The other values replace it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from fecm.authoring.case import CasesError, Value
from fecm.deck import model
from fecm.deck.model import NodeValues, OneSidedSupport, OneSidedSupports, Springs
from fecm.mechanics.interpolation import W

OF_W, OF_ROTATIONS = (W,), (W + 1, W + 2)


def set_edge_rotation(deck: model.Deck, value: Value) -> model.Deck:
    """Multiply the stiffness of the rotations of all SPRI LINE cards."""
    missing = "edge_kr: the deck has no springs of rotations along lines (SPRI LINE)"
    return _with_springs(deck, _lines(deck), OF_ROTATIONS, lambda k: float(value) * k, missing)


def set_edge_w(deck: model.Deck, value: Value) -> model.Deck:
    """Multiply the stiffness of w of all SPRI LINE cards."""
    missing = "edge_kw: the deck has no springs of w along lines (SPRI LINE)"
    return _with_springs(deck, _lines(deck), OF_W, lambda k: float(value) * k, missing)


def set_clamp(deck: model.Deck, value: Value) -> model.Deck:
    """Change the stiffness of w of the springs at nodes (SPRI)."""
    missing = "clamp_k: the deck has no springs of w at nodes (SPRI), as the clamps of `fecm new`"
    nodes = [segment for segment in deck.all(Springs) if not segment.is_of_lines]
    return _with_springs(deck, nodes, OF_W, lambda _: float(value), missing)


def set_window(deck: model.Deck, value: Value) -> model.Deck:
    """Change the stiffness of the lines that only push (UNIL LINE)."""
    missing = "window_k: the deck has no UNIL LINE, as the pushing window of `fecm new`"
    lines = [segment for segment in deck.all(OneSidedSupports) if segment.is_of_lines]
    return _with_supports(
        deck, lines, lambda card: replace(card, stiffness=float(value), source=None), missing
    )


def set_gap(deck: model.Deck, value: Value) -> model.Deck:
    """Change the gap of all one-sided supports (UNIL)."""
    return _with_supports(
        deck,
        list(deck.all(OneSidedSupports)),
        lambda card: replace(card, gap=float(value), source=None),
        "gap: the deck has no UNIL",
    )


def _lines(deck: model.Deck) -> list[Springs]:
    return [segment for segment in deck.all(Springs) if segment.is_of_lines]


def _with_springs(
    deck: model.Deck,
    segments: list[Springs],
    dofs: tuple[int, ...],
    change: Callable[[float], float],
    missing: str,
) -> model.Deck:
    """Return the deck with changed stiffnesses of some dofs where a card has one."""

    def changed(card: NodeValues) -> NodeValues:
        values = tuple(change(k) if k and dof in dofs else k for dof, k in enumerate(card.values))
        return replace(card, values=values, source=None)

    if not any(card.values[dof] for one in segments for card in one.records for dof in dofs):
        raise CasesError(missing)
    return _exchanged(
        deck,
        segments,
        [
            replace(segment, records=tuple(map(changed, segment.records)), source=None)
            for segment in segments
        ],
    )


def _with_supports(
    deck: model.Deck,
    segments: list[OneSidedSupports],
    change: Callable[[OneSidedSupport], OneSidedSupport],
    missing: str,
) -> model.Deck:
    """Return the deck with every card of some one-sided supports changed."""
    if not segments:
        raise CasesError(missing)
    return _exchanged(
        deck,
        segments,
        [
            replace(segment, records=tuple(map(change, segment.records)), source=None)
            for segment in segments
        ],
    )


def _exchanged(
    deck: model.Deck, old: Sequence[model.Segment], new: Sequence[model.Segment]
) -> model.Deck:
    """Return the deck with new segments in the places of old ones."""
    by_old = {id(before): after for before, after in zip(old, new, strict=True)}
    return replace(deck, segments=tuple(by_old.get(id(s), s) for s in deck.segments))
