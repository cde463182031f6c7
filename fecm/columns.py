"""Tables that users measured: CSV with a line of names, read by name.

Commas separate columns, blank lines and those that begin with # are skipped.  What stands behind a
name in brackets is its unit and counts for nothing; neither does the case of letters.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

Row = tuple[int, list[str]]


class TableError(ValueError):
    """A table can't be used; the message names the file, and the line where there is one."""


def read_columns(path: Path, names: Sequence[str], *, increasing: str = "") -> Mapping[str, Floats]:
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
    head = rows[0][1] if rows else []
    places = list(range(len(names)))
    if rows and any(_number(field) is None for field in head):
        places = _places(path, rows.pop(0), names)
    if len(rows) < 2:
        raise TableError(f"{path}: the table has fewer than two rows of numbers")
    values = np.array([_values(path, row, names, places) for row in rows])
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
    head = rows[0][1] if rows else []
    if all(_number(field) is not None for field in head):
        return []
    return [_without_unit(name) for name in head]


def same_name(one: str, other: str) -> bool:
    """Whether two names mean the same column."""
    return _plain(one) == _plain(other)


def _rows(path: Path) -> list[Row]:
    """Fields of every line that holds any, with its number."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise TableError(f"{path} is no text file") from None
    found = []
    for number, line in enumerate(text.splitlines(), start=1):
        if line.strip() and not line.lstrip().startswith("#"):
            try:
                fields = next(csv.reader([line], skipinitialspace=True))
            except csv.Error as error:
                raise TableError(f"{path}:{number}: {error}") from None
            found.append((number, [field.strip() for field in fields]))
    return found


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
