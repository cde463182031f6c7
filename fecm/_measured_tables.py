"""Tables of measured data: text files with a header of column names.

Columns are separated by tabs, semicolons or commas; with tabs and semicolons, numbers may have a
decimal comma.  Blank lines and lines that begin with # are skipped, and so is what a test rig
writes above the names (preamble).  A unit follows its name in brackets, or is in the line below the
names.  Names are not case-sensitive.
"""

from __future__ import annotations

import csv
import math
import re
import sys
from collections.abc import Mapping, Sequence
from itertools import chain, repeat
from pathlib import Path
from types import MappingProxyType

import numpy as np

from fecm._dataclasses import frozen
from fecm._errors import StudyError
from fecm._inputs import read_input
from fecm._memory import require
from fecm._typing import Floats

Row = tuple[int, list[str]]

# Memory of a table: bytes of a line and of a field as objects, and copies of the text.
LINE_BYTES = 400
FIELD_BYTES = 80
COPIES = 4

# Units that tables may name: in m, N, s and m/m.  The pound-force is 0.45359237 kg times
# 9.80665 m/s^2.  Both spellings of the letter for micro are in use.
UNITS = {
    "length": {
        "m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "μm": 1e-6, "nm": 1e-9,
        "in": 0.0254, "inch": 0.0254, "inches": 0.0254, "mil": 2.54e-5, "mils": 2.54e-5,
        "ft": 0.3048,
    },
    "force": {
        "N": 1.0, "mN": 1e-3, "daN": 10.0, "kN": 1e3, "MN": 1e6, "kgf": 9.80665, "gf": 9.80665e-3,
        "lbf": 4.4482216152605, "lb": 4.4482216152605, "lbs": 4.4482216152605,
        "kip": 4448.2216152605, "kips": 4448.2216152605,
    },
    "time": {
        "s": 1.0, "sec": 1.0, "secs": 1.0, "seconds": 1.0, "ms": 1e-3, "msec": 1e-3,
        "us": 1e-6, "µs": 1e-6, "μs": 1e-6, "usec": 1e-6, "min": 60.0,
    },
    "strain": {
        "": 1.0, "-": 1.0, "1": 1.0, "m/m": 1.0, "mm/mm": 1.0, "in/in": 1.0, "strain": 1.0,
        "%": 1e-2, "percent": 1e-2, "‰": 1e-3, "mm/m": 1e-3, "um/m": 1e-6, "µm/m": 1e-6,
        "μm/m": 1e-6, "ue": 1e-6, "µe": 1e-6, "με": 1e-6, "µε": 1e-6, "ustrain": 1e-6,
        "µstrain": 1e-6, "microstrain": 1e-6, "uin/in": 1e-6, "ppm": 1e-6,
    },
}  # fmt: skip
# Names of columns in the tables of test rigs, by the quantity; the first is that of fecm.
WORDS = {
    "time": ("time", "zeit", "temps", "tempo", "tiempo", "t"),
    "force": (
        *("force", "load", "contact force", "impact force", "tup load", "kraft", "last"),
        *("effort", "forza", "fuerza", "carga", "f"),
    ),
    "transducer": ("transducer",),
    "indentation": ("indentation", "displacement", "extension", "stroke", "depth"),
}
DIMENSIONS = {"time": "time", "force": "force", "transducer": "force", "indentation": "length"}
NO_UNITS: Mapping[str, str] = MappingProxyType({})

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

    def places(
        self, names: Sequence[str], columns: Sequence[str] = (), units: Mapping[str, str] = NO_UNITS
    ) -> list[int]:
        """Numbers of the columns of quantities in :data:`WORDS`, from 0.

        `columns` has the names or the numbers (from 1) that the user gave, or empty texts.  In a
        table without names the first columns are taken.  Of several columns with the same name the
        one in the unit of its dimension in `units` is taken, or else the first one in a known unit.
        Raises StudyError if a column is missing, or two can't be told apart.
        """
        places = []
        for order, (name, column) in enumerate(
            zip(names, columns or [""] * len(names), strict=True)
        ):
            number = column.isdecimal() and not any(same_name(column, n) for n in self.names)
            if number and int(column):
                places.append(int(column) - 1)
            elif not self.head[1] and not column:
                places.append(order)
            else:
                unit = units.get(DIMENSIONS[name], "")
                if (place := self._place(name, (column,) if column else WORDS[name], unit)) is None:
                    listing = ", ".join(self.names)[:80] or "unnamed"
                    others = "" if column else f" (or {', '.join(WORDS[name][1:])})"
                    raise StudyError(
                        f"{self.path}: the columns are {listing}; one must be named "
                        f"{column or name}{others}; `columns` of {' and '.join(names)} selects "
                        "others by name or number"
                    )
                places.append(place)
        return places

    def has(self, name: str) -> bool:
        """Whether a column has a name of a quantity in :data:`WORDS`."""
        return any(_plain(field) in WORDS[name] for field in self.head[1])

    def _place(self, name: str, words: Sequence[str], unit: str) -> int | None:
        """Number of the column with the first of some names that the table has."""
        for word in words:
            places = [place for place, n in enumerate(self.names) if same_name(word, n)]
            if len(places) > 1:  # in several units
                places = [n for n in places if self.units[n] in UNITS[DIMENSIONS[name]]]
                return next((n for n in places if self.units[n] == unit), (*places, None)[0])
            if places:
                return places[0]
        return None

    def unit(self, place: int) -> str:
        """Unit of a column; empty if the table names none."""
        return self.units[place] if place < len(self.units) else ""

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
    rows = _without_preamble(read_rows(path))
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


def _without_preamble(rows: list[Row]) -> list[Row]:
    """Rows from the line of names on, which is above the first numbers, or above their units.

    A line with both texts and numbers directly above the numbers is a row of the table with a
    wrong field, unless it has a known name; then nothing is skipped.
    """
    first = next((n for n, row in enumerate(rows) if _is_numeric(row)), 0)
    if first < 2:
        return rows
    above, last = rows[first - 2 : first]
    if _has_word(last):
        return rows[first - 1 :]
    if _has_number(last):
        return rows
    alike = len(above[1]) == len(last[1])
    units = alike and (first == 2 or _has_word(above) or _is_of_units(last))
    return rows[first - 2 :] if units else rows[first - 1 :]


def _has_word(row: Row) -> bool:
    """Whether a row has a name in :data:`WORDS`."""
    words = {word for names in WORDS.values() for word in names}
    return any(_plain(field) in words for field in row[1])


def _is_numeric(row: Row) -> bool:
    """Whether a row has two numbers or more, and nothing else."""
    fields = [field for field in row[1] if field]
    return len(fields) > 1 and all(_number(field) is not None for field in fields)


def _is_of_units(row: Row) -> bool:
    """Whether a row names units: all of them in brackets, or one of them known."""
    fields = [field for field in row[1] if field]
    known = {unit.casefold() for sizes in UNITS.values() for unit in sizes}
    if all(field[0] in "([" and field[-1] in ")]" for field in fields):
        return True
    return any(field.strip("()[] ").casefold() in known for field in fields)


def unit_size(source: str | Path, unit: str, dimension: str) -> float:
    """Return the size of a unit in m, N, s or m/m; StudyError if it is unknown."""
    sizes = UNITS[dimension]
    folded = [name for name in sizes if name.casefold() == unit.casefold()]
    if unit not in sizes and len(folded) != 1:
        listing = ", ".join(filter(None, sizes))
        raise StudyError(f"{source}: unknown unit of {dimension} `{unit}`; known units: {listing}")
    return sizes[unit if unit in sizes else folded[0]]


def same_name(one: str, other: str) -> bool:
    """Whether two names denote the same column."""
    return _plain(one) == _plain(other)


def _has_number(row: Row) -> bool:
    return any(_number(field) is not None for field in row[1])


def read_rows(path: Path, most: int = sys.maxsize) -> list[Row]:
    """Read the number and the fields of every line with content.

    Raises StudyError if there are more than `most` such lines, NotEnoughMemoryError if their fields
    take more memory than is free, and other errors as :func:`read_table`.
    """
    data = read_input(path)
    line_count = 1 + max(data.count(b"\n"), data.count(b"\r"))
    field_count = line_count + sum(data.count(mark) for mark in (b",", b";", b"\t"))
    needed = LINE_BYTES * line_count + FIELD_BYTES * field_count + COPIES * len(data)
    require(needed, f"{path}: a table of {line_count} lines")
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
    if len(lines) > most:
        raise StudyError(f"{path} has {len(lines)} lines; at most {most} are allowed")
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
