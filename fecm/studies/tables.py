"""Tables that users measured: text with a line of names, read by name.

Tabs, semicolons or commas separate columns; between tabs and semicolons numbers may have a decimal
comma.  Blank lines and those that begin with # are skipped.  A unit stands behind a name in
brackets, or in a line of its own below the names; the case of letters in names counts for nothing.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from fecm._errors import FecmError
from fecm._typing import Floats

Row = tuple[int, list[str]]

# A number with a decimal comma.
_COMMA = re.compile(r"[+-]?[0-9]*,[0-9]+(?:[eE][+-]?[0-9]+)?")
# A name with its unit in brackets behind it.
_UNIT = re.compile(r"[^(\[]*[(\[]([^)\]]*)[)\]]")


class TableError(FecmError, ValueError):
    """A table can't be used; the message names the file, and the line where there is one."""


def read_columns(
    path: Path, names: Sequence[str], *, increasing: str = "", places: Sequence[int] = ()
) -> Mapping[str, Floats]:
    """Read columns of a CSV file.

    Where the first line names none of the columns, or holds numbers already, they are the first
    ones in the order of `names`.

    Parameters
    ----------
    path : Path
    names : sequence of str
        Columns that are wanted.
    increasing : str
        The one of them whose values must increase from row to row.
    places : sequence of int
        Numbers of the columns from 0, whatever the first line calls them.

    Returns
    -------
    mapping of str to ndarray (rows,)

    Raises
    ------
    TableError
        If the file is no text, a column is missing, a field is no finite number, there are fewer
        than two rows, or the values don't increase.
    OSError
        If it can't be read.
    """
    rows = _rows(path)
    own = list(places or range(len(names)))
    if _names_columns(rows):
        head = rows.pop(0)
        own = list(places) or _places(path, head, names)
        if _names_units(rows):
            del rows[0]
    if len(rows) < 2:
        raise TableError(f"{path}: the table has fewer than two rows of numbers")
    values = np.array([_values(path, row, names, own) for row in rows])
    columns = dict(zip(names, values.T, strict=True))
    if increasing:
        for (_, before), (number, after) in pairwise(
            (line, value) for (line, _), value in zip(rows, columns[increasing], strict=True)
        ):
            if not after > before:
                raise TableError(
                    f"{path}:{number}: {increasing} {after:g} does not come after {before:g}"
                )
    return columns


def names_of(path: Path) -> list[str]:
    """Names in the first line, without their units; none where it holds numbers.

    Raises
    ------
    TableError
        If the file is no text.
    OSError
        If it can't be read.
    """
    rows = _rows(path)
    return [_without_unit(name) for name in rows[0][1]] if _names_columns(rows) else []


def units_of(path: Path) -> list[str]:
    """Units of the columns, by brackets behind their names or a line below; empty where none is.

    Raises
    ------
    TableError
        If the file is no text.
    OSError
        If it can't be read.
    """
    rows = _rows(path)
    if not _names_columns(rows):
        return []
    below = [field.strip("()[] ") for field in rows[1][1]] if _names_units(rows[1:]) else []
    found = []
    for place, name in enumerate(rows[0][1]):
        behind = _UNIT.match(name)
        found.append(behind[1].strip() if behind else below[place] if place < len(below) else "")
    return found


def same_name(one: str, other: str) -> bool:
    """Whether two names mean the same column."""
    return _plain(one) == _plain(other)


def _names_columns(rows: Sequence[Row]) -> bool:
    """Whether the first line names columns instead of holding numbers."""
    return bool(rows) and any(_number(field) is None for field in rows[0][1])


def _names_units(rows: Sequence[Row]) -> bool:
    """Whether the line below the names holds units: no number, and numbers in the next line."""
    return (
        len(rows) > 1
        and not any(_number(field) is not None for field in rows[0][1])
        and any(_number(field) is not None for field in rows[1][1])
    )


def _rows(path: Path) -> list[Row]:
    """Fields of every line that holds any, with its number."""
    data = path.read_bytes()
    if b"\0" in data:
        raise TableError(f"{path} is no text file")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")  # as older programs write µm and °
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
            raise TableError(f"{path}:{number}: {error}") from None
        found.append((number, [field.strip() for field in fields]))
    return found if separator == "," else _with_points(found)


def _with_points(rows: list[Row]) -> list[Row]:
    """Rows with points for decimal commas, unless numbers have points already."""
    fields = [field for _, row in rows for field in row]
    if any("." in field and _number(field) is not None for field in fields):
        return rows  # a comma may then stand between thousands
    return [
        (line, [f.replace(",", ".") if _COMMA.fullmatch(f) else f for f in row])
        for line, row in rows
    ]


def _without_unit(name: str) -> str:
    return name.partition("(")[0].partition("[")[0].strip()


def _plain(name: str) -> str:
    """A column's name without unit and case."""
    return _without_unit(name).casefold()


def _places(path: Path, head: Row, names: Sequence[str]) -> list[int]:
    """Where the columns stand, by the line of names."""
    known = [_plain(name) for name in head[1]]
    missing = [name for name in names if _plain(name) not in known]
    if len(missing) == len(names) and len(known) >= len(names):
        return list(range(len(names)))
    if missing:
        raise TableError(
            f"{path}:{head[0]}: there is no column {missing[0]}; the first line names "
            f"{', '.join(head[1])}, and {', '.join(names)} are needed"
        )
    return [known.index(_plain(name)) for name in names]


def _number(field: str) -> float | None:
    """The number in a field, or None."""
    try:
        return float(field)
    except ValueError:
        return None


def _values(path: Path, row: Row, names: Sequence[str], places: Sequence[int]) -> list[float]:
    """Numbers of one row, in the order of `names`."""
    line, fields = row
    values = []
    for name, place in zip(names, places, strict=True):
        field = fields[place] if place < len(fields) else ""
        value = _number(field)
        if value is None or not math.isfinite(value):
            told = repr(field) if field else "nothing"
            raise TableError(f"{path}:{line}: {name} is {told}, which is no finite number")
        values.append(value)
    return values
