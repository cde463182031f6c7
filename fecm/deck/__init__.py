"""Decks: cards in, a typed model out, and back."""

from fecm.deck.findings import DeckError, Finding, Findings, Place
from fecm.deck.model import Deck
from fecm.deck.reader import Reader, read_deck

__all__ = ["Deck", "DeckError", "Finding", "Findings", "Place", "Reader", "read_deck"]
