"""Tables of measured data: text files with a header of column names.

Columns are separated by tabs, semicolons or commas; with tabs and semicolons, numbers may have a
decimal comma.  Blank lines and lines that begin with # are skipped.  A unit follows its name in
brackets, or is in the line below the names.  Names are not case-sensitive.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Sequence
from itertools import chain, repeat
from pathlib import Path

import numpy as np

from fecm._dataclasses import frozen
from fecm._errors import StudyError
from fecm._inputs import read_input
from fecm._typing import Floats

Row = tuple[int, list[str]]

_COMMA = re.compile(r"[+-]?[0-9]*,[0-9]+(?:[eE][+-]?[0-9]+)?")  # a number with a decimal comma
_UNIT = re.compile(r"[^(\[]*[(\[]([^)\]]*)[)\]]")  # a name followed by its unit in brackets


@frozen
class Table:
    """Rows of a file below the names and units of its columns; both are empty if it has none."""

    path: Path
    head: Row  # number and fields of the line of names
    units: list[str]  # empty texts for columns without unit
    rows: list[Row]

    @property
    def names(self) -> list[str]:
        """Names of the columns, without units."""
        return [_without_unit(name) for name in self.head[1]]

    def columns(
        self, names: Sequence[str], *, increasing: str = "", places: Sequence[int] = ()
    ) -> dict[str, Floats]:
        """Numbers of some columns, (rows,) each, by name.

        If the file has none of the names, the first columns are taken in this order; with `places`,
        numbers of the columns from 0, the names in the file are ignored.  Raises StudyError if a
        column is missing, a field is not a finite number, there are fewer than two rows, or the
        values of the column `increasing` do not increase.
        """
        own = list(places) or self._places(names)
        if len(self.rows) < 2:
            raise StudyError(f"{self.path}: the table has fewer than two rows of numbers")
        values = np.array([self._values(row, names, own) for row in self.rows])
        columns = dict(zip(names, values.T, strict=True))
        rises = {name: column[1:] > column[:-1] for name, column in columns.items()}
        if increasing and not rises[increasing].all():
            row = int(rises[increasing].argmin())
            before, after = columns[increasing][row : row + 2]
            others = [n for n in names if n != increasing and rises[n].all()]
            swapped = f"; are {increasing} and {others[0]} swapped?" if others else ""
            raise StudyError(
                f"{self.path}:{self.rows[row + 1][0]}: {increasing} must increase: {after:g} "
                f"follows {before:g}{swapped}"
            )
        return columns

    def _places(self, names: Sequence[str]) -> list[int]:
        """Return the numbers of the columns from the line of names."""
        line, head = self.head
        known = [_plain(name) for name in head]
        missing = [name for name in names if _plain(name) not in known]
        if not head or (len(missing) == len(names) and len(known) >= len(names)):
            return list(range(len(names)))
        if missing:
            raise StudyError(
                f"{self.path}:{line}: there is no column {missing[0]}; the columns are "
                f"{', '.join(head)}; {', '.join(names)} are required"
            )
        return [known.index(_plain(name)) for name in names]

    def _values(self, row: Row, names: Sequence[str], places: Sequence[int]) -> list[float]:
        """Return the numbers of one row in the order of `names`."""
        line, fields = row
        values = []
        for name, place in zip(names, places, strict=True):
            field = fields[place] if place < len(fields) else ""
            value = _number(field)
            if value is None or not math.isfinite(value):
                found = repr(field) if field else "empty"
                raise StudyError(f"{self.path}:{line}: {name} is {found}, not a finite number")
            values.append(value)
        return values


def read_table(path: Path) -> Table:
    """Read a table; the first line contains names, and the second units, if they aren't numbers.

    Raises StudyError if the file is not text.  Raises OSError if the file cannot be read.
    """
    rows = read_rows(path)
    if not rows or all(_number(field) is not None for field in rows[0][1]):
        return Table(path, (0, []), [], rows)
    head, *rows = rows
    below: list[str] = []
    if len(rows) > 1 and not _has_number(rows[0]) and _has_number(rows[1]):
        below = [field.strip("()[] ") for field in rows.pop(0)[1]]
    units = [
        found[1].strip() if (found := _UNIT.match(name)) else under
        for name, under in zip(head[1], chain(below, repeat("")), strict=False)
    ]
    return Table(path, head, units, rows)


def same_name(one: str, other: str) -> bool:
    """Whether two names denote the same column."""
    return _plain(one) == _plain(other)


def _has_number(row: Row) -> bool:
    return any(_number(field) is not None for field in row[1])


def read_rows(path: Path) -> list[Row]:
    """Read the number and the fields of every line with content; raises as :func:`read_table`."""
    data = read_input(path)
    if b"\0" in data:
        raise StudyError(f"{path} is not a text file")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")  # older programs write µm and ° so
    lines = [
        (number, line)
        for number, line in enumerate(text.splitlines(), start=1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    last = lines[-1][1] if lines else ""
    separator = next((mark for mark in "\t;" if mark in last), ",")
    found = []
    for number, line in lines:
        try:
            fields = next(csv.reader([line], delimiter=separator, skipinitialspace=True))
        except csv.Error as error:
            raise StudyError(f"{path}:{number}: {error}") from None
        found.append((number, [field.strip() for field in fields]))
    every = chain.from_iterable(row for _, row in found)
    # Beside numbers with a point a comma may separate thousands.
    if separator == "," or any("." in field and _number(field) is not None for field in every):
        return found
    return [
        (number, [f.replace(",", ".") if _COMMA.fullmatch(f) else f for f in row])
        for number, row in found
    ]


def _without_unit(name: str) -> str:
    return name.partition("(")[0].partition("[")[0].strip()


def _plain(name: str) -> str:
    """Name of a column without unit, in lower case."""
    return _without_unit(name).casefold()


def _number(field: str) -> float | None:
    """Return the number in a field, or None."""
    try:
        return float(field)
    except ValueError:
        return None
