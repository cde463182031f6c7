"""Decks made from what an engineer knows."""
