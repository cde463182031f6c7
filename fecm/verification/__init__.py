"""Built-in verification: closed forms, figures from outside, and figures that guard against change.

Nothing here reads a file: decks are made in Python, figures stand beside their sources.
"""

from __future__ import annotations

from collections.abc import Iterable

from fecm._errors import FecmError
from fecm.verification import coupled, impacts, indentations, laminates, plates, rods, waves
from fecm.verification.case import (
    AGAINST_CHANGE,
    CONSISTENCY,
    INDEPENDENT,
    Case,
    Check,
    Row,
    carry_out,
)

__all__ = [
    "AGAINST_CHANGE",
    "CASES",
    "CONSISTENCY",
    "INDEPENDENT",
    "Case",
    "Check",
    "Row",
    "UnknownCaseError",
    "carry_out",
    "chosen",
]

CASES: tuple[Case, ...] = (
    *laminates.CASES,
    *plates.CASES,
    *coupled.CASES,
    *waves.CASES,
    *rods.CASES,
    *indentations.CASES,
    *impacts.CASES,
)


class UnknownCaseError(FecmError, LookupError):
    """A name that no case has."""


def chosen(names: Iterable[str] = ()) -> list[Case]:
    """Pick the cases of some names, once each and in their usual order; all without names.

    Raises
    ------
    UnknownCaseError
        If no case has one of the names.
    """
    wanted = list(names)
    known = [one.name for one in CASES]
    for name in wanted:
        if name not in known:
            raise UnknownCaseError(f"there is no case {name}; there are {', '.join(known)}")
    return [one for one in CASES if not wanted or one.name in wanted]
