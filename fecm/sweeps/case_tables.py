"""Tables and grids of cases: CSV files, mappings of Python, and combinations of values."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np

from fecm._errors import StudyError, did_you_mean
from fecm._measured_tables import MeasuredTable, column_head, plain_unit, read_table
from fecm.authoring.case import MOST_CASES, Case, CasesError, Value, check_count, number_of_text
from fecm.authoring.values import (
    NAMES,
    ValueKind,
    check_free,
    check_known,
    free_value_of,
    kind_of,
    parse_value,
    value_of,
    without_unit,
)
from fecm.deck.quantities import is_number, text_of
from fecm.deck.units import in_si, unit_in_si, unit_of, units_of
from fecm.sweeps.outcome import CONVERTED, MEASURED, MeasuredColumn

MISSPELT = 0.75  # similarity to the name of a value from which a column is taken as misspelt


class TableOfCases(NamedTuple):
    """Cases, and the measured columns of their table by name."""

    cases: list[Case]
    measured: Mapping[str, MeasuredColumn]


def table_of_cases(
    vary: object, cases: object, *, free: bool = False, system: str | None = None
) -> TableOfCases:
    """Return the cases of a table, or every combination of varied values.

    `cases` is the path of a CSV file, a mapping for each case, or a DataFrame. Without it, `vary`
    has texts ``NAME=VALUES``, or is a mapping of names to values. `free` and `system` are as in
    :func:`checked`. Raises CasesError if a name or a value is invalid.
    """
    if isinstance(cases, str | Path):
        return _table_of_file(Path(cases), system)
    if cases is not None:
        rows, measured = (cases, {}) if free else _without_measured(cases, system)
        return TableOfCases(checked(rows, free=free, system=system), measured)
    if texts := texts_of(vary):
        return TableOfCases(grid_cases([parse_vary(text, system) for text in texts]), {})
    return TableOfCases(combined(vary or {}, free=free, system=system), {})


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
    system of units. Names are not case-sensitive. Columns that can't be varied are measured values.
    Raises CasesError with the line of an error.
    """
    return _table_of_file(path, system).cases


def _table_of_file(path: Path, system: str | None) -> TableOfCases:
    """Read the cases and the measured columns of a file; see :func:`read_cases`."""
    try:
        table = read_table(path, MOST_CASES + 1)
    except StudyError as error:
        raise CasesError(str(error)) from None
    if not (table.head[1] and table.rows):
        raise CasesError(f"{path}: a table of cases has a header of names and at least one row")
    (number, _), header = table.head, table.names
    variables = _variables(header, f"{path}:{number}")
    for name in header:
        if header.count(name) > 1:
            raise CasesError(f"{path}:{number}: column {name} is repeated")
    try:
        for place, name in enumerate(header):
            table.check_thousands(name, place)
    except StudyError as error:
        raise CasesError(str(error)) from None
    cases: list[Case] = []
    for line, row in table.rows:
        if len(row) > len(header) or len(row) <= max(map(header.index, variables)):
            raise CasesError(f"{path}:{line}: {len(row)} values, but {len(header)} names")
        try:
            cases.append(_case(table, row, variables, system))
        except CasesError as error:
            raise CasesError(f"{path}:{line}: {error}") from None
    check_count(len(cases), f"{path} has {len(cases)} cases")
    measured = {
        measured_name(name): _measured_column(
            [row[place] if place < len(row) else "" for _, row in table.rows], unit, system
        )
        for place, (name, unit) in enumerate(zip(header, table.units, strict=False))
        if name not in variables
    }
    return TableOfCases(cases, measured)


def _case(
    table: MeasuredTable, row: Sequence[str], variables: Mapping[str, str], system: str | None
) -> Case:
    """Return the case of a row; raise CasesError if a value is invalid."""
    case = {}
    for name, text, unit in zip(table.names, row, table.units, strict=False):
        if (variable := variables.get(name)) is None:
            continue
        if variable == "layup" and table.is_decimal_comma:
            text = re.sub("(?<=[0-9]),(?=[0-9])", ".", text)
        case[variable] = parse_value(variable, text + unit, system)
    return case


def _variables(names: Sequence[str], where: str) -> dict[str, str]:
    """Return the columns that are varied, and the names of what they vary.

    Capitals do not matter. Raises CasesError if no column can be varied, or a name looks like a
    misspelt one.
    """
    variables = {}
    for name in names:
        alike = [known for known in NAMES if known.casefold() == name.casefold()]
        if name in NAMES or len(alike) == 1:
            variables[name] = name if name in NAMES else alike[0]
        elif not name.casefold().startswith("measured") and (
            known := did_you_mean(name, NAMES, MISSPELT)
        ):
            raise CasesError(
                f"{where}: `{name}` cannot be varied{known} A measured column of this name is "
                f"`measured {name}`"
            )
    if not variables:
        check_known(names[0], where)
    for known in variables.values():
        if [*variables.values()].count(known) > 1:
            raise CasesError(f"{where}: column {known} is repeated")
    return variables


def measured_name(name: str) -> str:
    """Return the name of a measured column in results, with ``_`` for other marks.

    >>> measured_name("Fmax"), measured_name("measured dent (after 48 h)")
    ('measured_Fmax', 'measured_dent_after_48_h')
    """
    plain = re.sub(r"\W+", "_", name).strip("_")
    return MEASURED + re.sub("^measured_*", "", plain, flags=re.IGNORECASE)


def _measured_column(values: Sequence[object], unit: str, system: str | None) -> MeasuredColumn:
    """Return a measured column, converted to a system of units if its unit is known."""
    numbers = [_measured_number(value) for value in values]
    if any(number is None for number in numbers):
        return MeasuredColumn(np.array([str(value) for value in values]), unit, "")
    column = np.array(numbers, float)
    names = units_of(system) if system else {}
    for dimension in CONVERTED if names else ():
        size, deck_size = unit_in_si(plain_unit(unit), dimension), in_si(dimension, names)
        if size is not None and deck_size is not None:
            return MeasuredColumn(column * (size / deck_size), unit_of(dimension, names), dimension)
    return MeasuredColumn(column, unit, "")


def _measured_number(value: object) -> float | None:
    """Return a number, NaN for an empty field, and None for other texts."""
    if value is None or (isinstance(value, str) and value.strip() in ("", "-")):
        return math.nan
    try:
        return float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        return None


def _without_measured(
    cases: object, system: str | None
) -> tuple[object, dict[str, MeasuredColumn]]:
    """Return the cases of Python without their measured columns, and these columns.

    Cases that are not a table of mappings are returned as they are.
    """
    rows = _rows(cases) if isinstance(cases, CaseTable) else cases
    if not isinstance(rows, Iterable):
        return cases, {}
    rows = list(rows)
    if not rows or any(
        not isinstance(row, Mapping) or row.keys() != rows[0].keys() for row in rows
    ):
        return rows, {}
    heads = {name: column_head(str(name)) for name in rows[0]}
    variables = _variables([head.name for head in heads.values()], "case 0") if heads else {}
    kept = [
        {
            variables[head.name]: _with_unit(row[name], head.unit)
            for name, head in heads.items()
            if head.name in variables
        }
        for row in rows
    ]
    measured = {
        measured_name(head.name): _measured_column([row[name] for row in rows], head.unit, system)
        for name, head in heads.items()
        if head.name not in variables
    }
    return kept, measured


def _with_unit(value: Any, unit: str) -> Any:
    """Return a number with the unit of its column as a text; other values as they are."""
    value = text_of(value)
    return f"{float(value)!r} {unit}" if unit and is_number(value) else value


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
    if kind_of(name) is ValueKind.TEXT or ":" not in text_of_values:
        parts = _split_outside_brackets(text_of_values)
        if name == "at" and not re.search("[(; ]", text_of_values):
            parts = _points(parts)
        return name, [parse_value(name, part, system) for part in parts if part.strip()]
    parts = text_of_values.split(":")
    if len(parts) != 3 or not re.fullmatch(r"\d{1,9}", parts[2].strip()) or not int(parts[2]):
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


def _split_outside_brackets(text: str) -> list[str]:
    """Split a text at the commas outside brackets."""
    depth, commas = 0, []
    for place, char in enumerate(text):
        depth += (char in "[(") - (char in "])")
        if char == "," and depth <= 0:
            commas.append(place)
    return [text[before + 1 : after] for before, after in pairwise([-1, *commas, len(text)])]


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


def _spread(name: str, value: Any, system: str | None) -> list[Any]:
    """Return the values of the text of a range, as in ``1J:5J:5``; any other value alone."""
    if isinstance(value, str) and ":" in value:
        return list(parse_vary(f"{name}={value}", system)[1])
    return [value]


def combined(vary: object, *, free: bool = False, system: str | None = None) -> list[Case]:
    """Return every combination of the values in the lists of `vary`.

    Instead of a list, `vary` may have the text of a range or a list, as in ``1J:5J:5``.
    `free` and `system` are as in :func:`checked`. Raises CasesError if a name is unknown, a value
    is invalid, or values are not in a list.
    """
    if not isinstance(vary, Mapping):
        raise CasesError(f'vary is {vary!r}; write a mapping such as {{"velocity": [50.0, 115.0]}}')
    lists: list[tuple[str, list[Value]]] = []
    for name, choices in vary.items():
        if isinstance(choices, str) and not free and re.search("[:,]", choices):
            lists.append(parse_vary(f"{name}={choices}", system))
            continue
        values: list[Any] | None = None
        with suppress(TypeError):
            values = None if isinstance(choices, str | bytes) else list(choices)
        if values is not None and not free:  # ranges in the list, as in ["1J:5J:5"]
            values = [one for value in values for one in _spread(name, value, system)]
        if values is None:
            raise CasesError(
                f'vary: {name} is one value; write a list: {{"{name}": [{choices!r}]}}'
            )
        if not values:
            raise CasesError(f"vary: {name} has no values")
        cases = checked(({name: value} for value in values), "vary", free=free, system=system)
        lists.append((name, [case[name] for case in cases]))
    return grid_cases(lists)
