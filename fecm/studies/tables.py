"""Tables of measured data: text files with a header of column names.

Columns are separated by tabs, semicolons or commas; with tabs and semicolons, numbers may have a
decimal comma.  Blank lines and lines that begin with # are skipped.  A unit follows its name in
brackets, or is in the line below the names.  Names are not case-sensitive.
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
# A name followed by its unit in brackets.
_UNIT = re.compile(r"[^(\[]*[(\[]([^)\]]*)[)\]]")


class TableError(FecmError, ValueError):
    """A table is invalid; the message states the file, and the line if known."""


def read_columns(
    path: Path, names: Sequence[str], *, increasing: str = "", places: Sequence[int] = ()
) -> Mapping[str, Floats]:
    """Read columns of a CSV file.

    If the first line contains none of the names, or contains numbers, the first columns are taken
    in the order of `names`.

    Parameters
    ----------
    path : Path
    names : sequence of str
        Columns to read.
    increasing : str
        Name of the column whose values must increase.
    places : sequence of int
        Numbers of the columns from 0; the names in the first line are then ignored.

    Returns
    -------
    mapping of str to ndarray (rows,)

    Raises
    ------
    TableError
        If the file is not text, a column is missing, a field is not a finite number, there are
        fewer than two rows, or the values do not increase.
    OSError
        If the file cannot be read.
    """
    rows = read_rows(path)
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
                    f"{path}:{number}: {increasing} must increase: {after:g} follows {before:g}"
                )
    return columns


def names_of(path: Path) -> list[str]:
    """Return the names in the first line without units; empty if it contains numbers.

    Raises
    ------
    TableError
        If the file is not text.
    OSError
        If the file cannot be read.
    """
    rows = read_rows(path)
    return [_without_unit(name) for name in rows[0][1]] if _names_columns(rows) else []


def units_of(path: Path) -> list[str]:
    """Return the units of the columns from brackets or the line below; empty if none is given.

    Raises
    ------
    TableError
        If the file is not text.
    OSError
        If the file cannot be read.
    """
    rows = read_rows(path)
    if not _names_columns(rows):
        return []
    below = [field.strip("()[] ") for field in rows[1][1]] if _names_units(rows[1:]) else []
    found = []
    for place, name in enumerate(rows[0][1]):
        unit = _UNIT.match(name)
        found.append(unit[1].strip() if unit else below[place] if place < len(below) else "")
    return found


def same_name(one: str, other: str) -> bool:
    """Whether two names denote the same column."""
    return _plain(one) == _plain(other)


def _names_columns(rows: Sequence[Row]) -> bool:
    """Whether the first line contains names instead of numbers."""
    return bool(rows) and any(_number(field) is None for field in rows[0][1])


def _names_units(rows: Sequence[Row]) -> bool:
    """Whether the second line contains units: it has no numbers, and the next line has."""
    return (
        len(rows) > 1
        and not any(_number(field) is not None for field in rows[0][1])
        and any(_number(field) is not None for field in rows[1][1])
    )


def read_rows(path: Path) -> list[Row]:
    """Read the number and the fields of every line with content.

    Raises
    ------
    TableError
        If the file is not text.
    OSError
        If the file cannot be read.
    """
    data = path.read_bytes()
    if b"\0" in data:
        raise TableError(f"{path} is not a text file")
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
            raise TableError(f"{path}:{number}: {error}") from None
        found.append((number, [field.strip() for field in fields]))
    return found if separator == "," else _with_points(found)


def _with_points(rows: list[Row]) -> list[Row]:
    """Replace decimal commas by points, unless some numbers have points already."""
    fields = [field for _, row in rows for field in row]
    if any("." in field and _number(field) is not None for field in fields):
        return rows  # a comma may then separate thousands
    return [
        (line, [f.replace(",", ".") if _COMMA.fullmatch(f) else f for f in row])
        for line, row in rows
    ]


def _without_unit(name: str) -> str:
    return name.partition("(")[0].partition("[")[0].strip()


def _plain(name: str) -> str:
    """Name of a column without unit, in lower case."""
    return _without_unit(name).casefold()


def _places(path: Path, head: Row, names: Sequence[str]) -> list[int]:
    """Return the numbers of the columns from the line of names."""
    known = [_plain(name) for name in head[1]]
    missing = [name for name in names if _plain(name) not in known]
    if len(missing) == len(names) and len(known) >= len(names):
        return list(range(len(names)))
    if missing:
        raise TableError(
            f"{path}:{head[0]}: there is no column {missing[0]}; the columns are "
            f"{', '.join(head[1])}; {', '.join(names)} are required"
        )
    return [known.index(_plain(name)) for name in names]


def _number(field: str) -> float | None:
    """Return the number in a field, or None."""
    try:
        return float(field)
    except ValueError:
        return None


def _values(path: Path, row: Row, names: Sequence[str], places: Sequence[int]) -> list[float]:
    """Return the numbers of one row in the order of `names`."""
    line, fields = row
    values = []
    for name, place in zip(names, places, strict=True):
        field = fields[place] if place < len(fields) else ""
        value = _number(field)
        if value is None or not math.isfinite(value):
            found = repr(field) if field else "empty"
            raise TableError(f"{path}:{line}: {name} is {found}, not a finite number")
        values.append(value)
    return values
