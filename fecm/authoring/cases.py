"""Tables and grids of cases: CSV files, mappings of Python, and combinations of values."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np

from fecm._errors import StudyError
from fecm._measured_tables import read_table
from fecm.authoring.case import MOST_CASES, Case, CasesError, Value, check_count, number_of_text
from fecm.authoring.values import (
    ValueKind,
    check_free,
    check_known,
    free_value_of,
    kind_of,
    parse_value,
    value_of,
    without_unit,
)


def cases_of(
    vary: object, cases: object, *, free: bool = False, system: str | None = None
) -> list[Case]:
    """Return the cases of a table, or every combination of varied values.

    `cases` is the path of a CSV file, a mapping for each case, or a DataFrame. Without it, `vary`
    has texts ``NAME=VALUES``, or is a mapping of names to values. `free` and `system` are as in
    :func:`checked`. Raises CasesError if a name or a value is invalid.
    """
    if isinstance(cases, str | Path):
        return read_cases(Path(cases), system)
    if cases is not None:
        return checked(cases, free=free, system=system)
    if texts := texts_of(vary):
        return grid_cases([parse_vary(text, system) for text in texts])
    return combined(vary or {}, free=free, system=system)


def texts_of(texts: object) -> list[str]:
    """Return one or several texts of the form NAME=...; an empty list for anything else."""
    if isinstance(texts, str):
        return [texts]
    if isinstance(texts, list | tuple) and all(isinstance(text, str) for text in texts):
        return list(texts)
    return []


def read_cases(path: Path, system: str | None = None) -> list[Case]:
    """Read a CSV table: a header of names and one row per case.

    A value, or the header of its column, may have a unit. Such values are converted to the given
    system of units. Raises CasesError with the line of an error.
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
    try:
        for place, name in enumerate(header):
            table.check_thousands(name, place)
    except StudyError as error:
        raise CasesError(str(error)) from None
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
class CaseTable(Protocol):
    """Table with named columns, such as a DataFrame."""

    @property
    def columns(self) -> Any:
        """Names of the columns."""

    def __getitem__(self, name: Any, /) -> Any:
        """Return the values of a column."""


def index_of(cases: object) -> Any:
    """Return the index of a DataFrame of cases; None for other cases."""
    return getattr(cases, "index", None) if isinstance(cases, CaseTable) else None


def _rows(table: CaseTable) -> list[dict[Any, Any]]:
    """Return the rows of a table as mappings; raise CasesError if a column is repeated."""
    names = list(table.columns)
    for name in names:
        if names.count(name) > 1:
            raise CasesError(f"column {name} is repeated")
    columns = [list(table[name]) for name in names]
    return [dict(zip(names, row, strict=True)) for row in zip(*columns, strict=True)]


def checked(
    cases: object,
    source: str = "",
    *,
    free: bool = False,
    system: str | None = None,
) -> list[Case]:
    """Validate cases from a table, or from mappings that all have the same names.

    With `free`, a name may be any name except names of results, and a value any number or text.
    Otherwise a text with a unit is converted to the given system of units. Raises CasesError if a
    case is invalid; the message starts with `source`, or with the number of the case.
    """
    check_name, read = (
        (check_free, free_value_of) if free else (check_known, partial(value_of, system=system))
    )
    checked_cases: list[Case] = []
    remedy = 'write a list of mappings such as [{"velocity": 50.0}]'
    if isinstance(cases, CaseTable):
        cases = _rows(cases)
    if not isinstance(cases, Iterable):
        raise CasesError(f"cases is {cases!r}; {remedy}")
    for number, case in enumerate(cases):
        where = source or f"case {number}"
        if not isinstance(case, Mapping):
            raise CasesError(f"{where} is {case!r}, not a mapping of names to values; {remedy}")
        for name in case:
            check_name(name, where)
        if checked_cases and case.keys() != checked_cases[0].keys():
            raise CasesError(f"{where} has other names than case 0")
        checked_cases.append({name: read(name, value, where) for name, value in case.items()})
    if not checked_cases:
        raise CasesError("a sweep needs at least one case")
    for name in checked_cases[0]:
        if len({isinstance(case[name], str) for case in checked_cases}) > 1:
            raise CasesError(f"{name} has numbers and texts")
    return checked_cases


def parse_vary(text: str, system: str | None = None) -> tuple[str, list[Value]]:
    """Parse ``NAME=FROM:TO:N`` (N values with both ends) or ``NAME=a,b,c``.

    Values with a unit, as in ``energy=5J:30J:6``, are converted to the given system of units.
    Raises CasesError if the text has another form.
    """
    name, equals, text_of_values = (part.strip() for part in text.partition("="))
    check_known(name, text)
    if not equals or not text_of_values:
        raise CasesError(f"`{text}`: write {name}=FROM:TO:N or {name}=A,B,C")
    if (
        kind_of(name) is ValueKind.TEXT or ":" not in text_of_values
    ):  # split at commas outside brackets
        parts = re.split(r",(?![^\[]*\]|[^(]*\))", text_of_values)
        if name == "at" and not re.search("[(; ]", text_of_values):
            parts = _points(parts)
        return name, [parse_value(name, part, system) for part in parts if part.strip()]
    parts = text_of_values.split(":")
    if len(parts) != 3 or not re.fullmatch(r"\d+", parts[2].strip()) or not int(parts[2]):
        raise CasesError(f"`{text}`: a range is FROM:TO:N with N of at least 1")
    start, stop = (number_of_text(name, without_unit(name, part, system)) for part in parts[:2])
    count = int(parts[2])
    if count > MOST_CASES:
        raise CasesError(f"`{text}`: {count} values; at most {MOST_CASES} are allowed")
    with np.errstate(all="ignore"):
        values = np.linspace(start, stop, count).tolist()
    if not all(map(math.isfinite, values)):
        raise CasesError(f"`{text}`: the range is beyond the range of numbers")
    return name, [parse_value(name, repr(v)) for v in values]


def _points(numbers: Sequence[str]) -> list[str]:
    """Join two numbers to a point; otherwise raise CasesError with the brackets to write."""
    if len(numbers) == 2:
        return [",".join(numbers)]
    pairs = [f"({','.join(numbers[n : n + 2])})" for n in range(0, len(numbers) - 1, 2)]
    example = ",".join(pairs) or f"({numbers[0]},Y)"
    raise CasesError(f"at has two numbers a point; write at={example}")


def grid_cases(varied: Sequence[tuple[str, Sequence[Value]]]) -> list[Case]:
    """Return every combination of the values; the last name varies fastest.

    Raises CasesError if a name is repeated, or there are too many cases.
    """
    names = [name for name, _ in varied]
    for name in names:
        if names.count(name) > 1:
            raise CasesError(f"{name} is varied twice")
    count = math.prod(len(values) for _, values in varied)
    check_count(count)
    combinations = itertools.product(*(values for _, values in varied))
    return [dict(zip(names, values, strict=True)) for values in combinations]


def combined(vary: object, *, free: bool = False, system: str | None = None) -> list[Case]:
    """Return every combination of the values in the lists of `vary`.

    `free` and `system` are as in :func:`checked`. Raises CasesError if a name is unknown, a value
    is invalid, or values are not in a list.
    """
    if not isinstance(vary, Mapping):
        raise CasesError(f'vary is {vary!r}; write a mapping such as {{"velocity": [50.0, 115.0]}}')
    lists: list[tuple[str, list[Value]]] = []
    for name, choices in vary.items():
        values: list[Any] | None = None
        with suppress(TypeError):
            values = None if isinstance(choices, str | bytes) else list(choices)
        if values is None:
            raise CasesError(
                f'vary: {name} is one value; write a list: {{"{name}": [{choices!r}]}}'
            )
        if not values:
            raise CasesError(f"vary: {name} has no values")
        cases = checked(({name: value} for value in values), "vary", free=free, system=system)
        lists.append((name, [case[name] for case in cases]))
    return grid_cases(lists)
