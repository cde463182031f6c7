"""Decks: cards in, a typed model out, and back."""

from fecm.deck.findings import CardPlace, DeckError, Finding, Findings
from fecm.deck.model import Deck
from fecm.deck.reader import Reader, read_deck

__all__ = ["CardPlace", "Deck", "DeckError", "Finding", "Findings", "Reader", "read_deck"]
