"""Decks: cards in, a typed model out, and back."""
