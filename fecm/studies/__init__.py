"""Waves, indentation tests and rod tests."""
