"""Errors of the location of an impact."""

from __future__ import annotations

from fecm._errors import FecmError


class LocateError(FecmError):
    """The strains do not determine the place of the impact."""

    exit_code = 1
