"""Waves, indentation tests and rod tests."""

from fecm._errors import FecmError


class StudyError(FecmError, ValueError):
    """A study can't be computed from these numbers, or their table is invalid."""
