"""Errors of results: files that can't be read or written, and data that a result lacks."""

from __future__ import annotations

from fecm._errors import FecmError


class ResultFileError(FecmError, ValueError):
    """A file is not a readable result."""


class NotStoredError(AttributeError, KeyError, ResultFileError):
    """A result lacks a requested dataset."""

    def __str__(self) -> str:
        return str(self.args[0])


class ResultWriteError(FecmError, OSError):
    """A result can't be written."""


class ExportError(FecmError, ValueError):
    """A result lacks the data for an export, or the request is invalid."""
