"""Tables of cases: a CSV file, or mappings of Python."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

from fecm._measured_tables import read_table
from fecm.studies import StudyError
from fecm.sweeps.case import MOST_CASES, Case, CasesError, check_count
from fecm.sweeps.values import check_free, check_known, free_value_of, parse_value, value_of


def read_cases(path: Path, system: str | None = None) -> list[Case]:
    """Read a CSV table, a header of names and one row per case; CasesError states a line.

    Values with a unit, theirs or that of the header, are converted to a system of units.
    """
    try:
        table = read_table(path, MOST_CASES + 1)
    except StudyError as error:
        raise CasesError(str(error)) from None
    if not (table.head[1] and table.rows):
        raise CasesError(f"{path}: a table of cases has a header of names and at least one row")
    (number, _), header = table.head, table.names
    for name in header:
        check_known(name, f"{path}:{number}")
        if header.count(name) > 1:
            raise CasesError(f"{path}:{number}: column {name} is repeated")
    cases: list[Case] = []
    for line, row in table.rows:
        if len(row) != len(header):
            raise CasesError(f"{path}:{line}: {len(row)} values, but {len(header)} names")
        try:
            case = {}
            for name, text, unit in zip(header, row, table.units, strict=True):
                if name == "layup" and table.is_decimal_comma:
                    text = re.sub("(?<=[0-9]),(?=[0-9])", ".", text)
                case[name] = parse_value(name, text + unit, system)
            cases.append(case)
        except CasesError as error:
            raise CasesError(f"{path}:{line}: {error}") from None
    check_count(len(cases), f"{path} has {len(cases)} cases")
    return cases


@runtime_checkable
class Table(Protocol):
    """A table with named columns, such as a DataFrame."""

    @property
    def columns(self) -> Any:
        """Names of the columns."""

    def __getitem__(self, name: Any, /) -> Any:
        """Return the values of a column."""


def _rows(table: Table) -> list[dict[Any, Any]]:
    """The rows of a table as mappings; CasesError if a name is repeated."""
    names = list(table.columns)
    for name in names:
        if names.count(name) > 1:
            raise CasesError(f"column {name} is repeated")
    columns = [list(table[name]) for name in names]
    return [dict(zip(names, row, strict=True)) for row in zip(*columns, strict=True)]


def checked(
    cases: Iterable[Mapping[str, Any]] | Table,
    source: str = "",
    *,
    free: bool = False,
    system: str | None = None,
) -> list[Case]:
    """Validate cases given as mappings, which must all have the same names, or as a table.

    With `free`, the names are any but those of results, and a value is a number or a text;
    otherwise texts with a unit are converted to a system of units.  Raises
    CasesError if a case is invalid; the message states the source, or else the case's number.
    """
    check_name, read = (
        (check_free, free_value_of) if free else (check_known, partial(value_of, system=system))
    )
    made: list[Case] = []
    remedy = 'write a list of mappings such as [{"velocity": 50.0}]'
    if isinstance(cases, Table):
        cases = _rows(cases)
    if not isinstance(cases, Iterable):
        raise CasesError(f"cases is {cases!r}; {remedy}")
    for number, case in enumerate(cases):
        where = source or f"case {number}"
        if not isinstance(case, Mapping):
            raise CasesError(f"{where} is {case!r}, not a mapping of names to values; {remedy}")
        for name in case:
            check_name(name, where)
        if made and case.keys() != made[0].keys():
            raise CasesError(f"{where} has other names than case 0")
        made.append({name: read(name, value, where) for name, value in case.items()})
    if not made:
        raise CasesError("a sweep needs at least one case")
    for name in made[0]:
        if len({isinstance(case[name], str) for case in made}) > 1:
            raise CasesError(f"{name} has numbers and texts")
    return made
