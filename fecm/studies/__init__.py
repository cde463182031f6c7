"""Waves, indentation tests and rod tests."""

from fecm._errors import StudyError

__all__ = ["StudyError"]
