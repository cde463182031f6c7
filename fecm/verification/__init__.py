"""Built-in verification against closed forms, external references and regression values.

The modules build decks in Python and compute values. `checks.toml` has the expected values, their
sources, and the tolerances with their reasons.
"""

from __future__ import annotations

from collections.abc import Iterable
from importlib.util import find_spec

from fecm._errors import FecmError
from fecm.verification import (  # noqa: F401  (importing them fills CASE_OF)
    curved,
    fields,
    impacts,
    parts,
    plates,
    stretching,
    studies,
    supports,
    webassembly,
)
from fecm.verification.case import CASE_OF, TABLES, Case, Row, compute_rows

__all__ = ["CASES", "Case", "Row", "UnknownCaseError", "chosen", "compute_rows", "verify"]

# A case that needs a library which is not installed runs if it is asked for by name, and fails.
CASES: tuple[Case, ...] = tuple(
    case
    for case in map(CASE_OF.__getitem__, TABLES)
    if not case.needs or find_spec(case.needs) is not None
)


class UnknownCaseError(FecmError, LookupError, ValueError):
    """Unknown name of a case."""


def chosen(names: Iterable[str] = ()) -> list[Case]:
    """Return the named cases in their usual order; without names, all cases."""
    requested = list(names)
    for name in requested:
        if name not in CASE_OF:
            raise UnknownCaseError(f"unknown case {name}; the cases are {', '.join(TABLES)}")
    return [CASE_OF[name] for name in TABLES if name in requested] if requested else [*CASES]


def verify(*cases: str) -> list[Row]:
    """Compare this program with closed forms and the literature.

    Parameters
    ----------
    *cases : str
        Names of cases, as ``fecm verify --list`` shows them. Without names, all cases run.

    Returns
    -------
    list of Row
        One row per quantity; ``within`` is True if its error is within the tolerance.

    Raises
    ------
    UnknownCaseError
        If a name is unknown. It is a ValueError.

    Examples
    --------
    >>> import fecm
    >>> rows = fecm.verify("isotropic-ply", "wave-fronts")
    >>> all(row.within for row in rows)
    True
    >>> print(rows[0].check.quantity, "=", rows[0].check.source)
    A11 (lb/in) = E h/(1 - ν²)
    """
    return [row for selected in chosen(cases) for row in compute_rows(selected)]
