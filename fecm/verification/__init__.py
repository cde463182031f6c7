"""Built-in verification against closed forms, external references and regression values.

No files are read: decks are built in Python, and reference values are stated with their sources.
"""

from __future__ import annotations

from collections.abc import Iterable

from fecm._errors import FecmError
from fecm.verification import (
    coupled,
    damage,
    impacts,
    indentations,
    laminates,
    patches,
    plates,
    plies,
    rods,
    waves,
)
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
    *patches.CASES,
    *plies.CASES,
    *damage.CASES,
)


class UnknownCaseError(FecmError, LookupError):
    """The name of a case is unknown."""


def chosen(names: Iterable[str] = ()) -> list[Case]:
    """Return the named cases in their usual order; all cases if there are no names.

    Raises
    ------
    UnknownCaseError
        If a name is unknown.
    """
    wanted = list(names)
    known = [one.name for one in CASES]
    for name in wanted:
        if name not in known:
            raise UnknownCaseError(f"unknown case {name}; the cases are {', '.join(known)}")
    return [one for one in CASES if not wanted or one.name in wanted]
