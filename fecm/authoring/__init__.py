"""Decks from plate, laminate, projectile and contact as objects."""
