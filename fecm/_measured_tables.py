"""Tables of other programs: text files with a header of column names.

Tabs, semicolons, commas or blanks separate columns. A comma may be the decimal mark unless it
separates columns. A first line such as ``sep=;`` names the separator. Blank lines and lines that
start with # are skipped. So is the preamble that a test rig writes above the names. Names are not
case-sensitive. :func:`column_head` has the grammar of a name and its unit; a unit may also be in
the line below the names.
"""

from __future__ import annotations

import csv
import hashlib
import math
import re
import sys
from collections.abc import Mapping, Sequence
from functools import lru_cache
from itertools import chain
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from fecm._errors import StudyError, warn
from fecm._inputs import decoded, lines_of, read_input
from fecm._machine import require_memory
from fecm._text import printable
from fecm._typing import Floats

Row = tuple[int, list[str]]  # number of the line, and its fields

# Memory of a table: bytes of a line and of a field as objects, and copies of the text.
LINE_BYTES = 400
FIELD_BYTES = 80
COPIES = 4
LISTING = 80  # characters of the names of columns in a message
SAMPLE = 200  # lines that tell the separator

# Units that tables may name: in m, N, s, V and m/m, with u for micro.  The pound-force is
# 0.45359237 kg times 9.80665 m/s^2.
UNITS = {
    "length": {
        "m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "nm": 1e-9,
        "in": 0.0254, "inch": 0.0254, "inches": 0.0254, "mil": 2.54e-5, "mils": 2.54e-5,
        "ft": 0.3048,
    },
    "force": {
        "N": 1.0, "uN": 1e-6, "mN": 1e-3, "daN": 10.0, "kN": 1e3, "MN": 1e6, "kgf": 9.80665,
        "gf": 9.80665e-3, "lbf": 4.4482216152605, "lb": 4.4482216152605, "lbs": 4.4482216152605,
        "kip": 4448.2216152605, "kips": 4448.2216152605,
    },
    "time": {
        "s": 1.0, "sec": 1.0, "secs": 1.0, "second": 1.0, "seconds": 1.0, "ms": 1e-3, "msec": 1e-3,
        "us": 1e-6, "usec": 1e-6, "min": 60.0,
    },
    "strain": {
        "": 1.0, "-": 1.0, "1": 1.0, "m/m": 1.0, "mm/mm": 1.0, "in/in": 1.0, "strain": 1.0,
        "%": 1e-2, "percent": 1e-2, "‰": 1e-3, "mm/m": 1e-3, "um/m": 1e-6, "ue": 1e-6,
        "ustrain": 1e-6, "microstrain": 1e-6, "uin/in": 1e-6, "ppm": 1e-6,
    },
    "voltage": {"V": 1.0, "mV": 1e-3, "uV": 1e-6, "volt": 1.0, "volts": 1.0},
}  # fmt: skip
_MICRO = str.maketrans("µμε", "uue")  # both letters for micro are in use
# Names of units in full, in small letters.
IN_FULL = {
    "newton": "N", "newtons": "N", "kilonewton": "kN", "kilonewtons": "kN", "pound": "lbf",
    "pounds": "lbf", "millimeter": "mm", "millimetre": "mm", "millimeters": "mm",
    "millimetres": "mm", "micron": "um", "microns": "um", "micrometer": "um", "micrometre": "um",
    "micrometers": "um", "micrometres": "um", "millisecond": "ms", "milliseconds": "ms",
    "microsecond": "us", "microseconds": "us", "sekunde": "s", "sekunden": "s",
}  # fmt: skip
# Units of other quantities, which end a name as the units above do.
OTHER_UNITS = ("J", "mJ", "kJ", "Nm", "kg", "g", "t", "Pa", "kPa", "MPa", "GPa", "Hz", "kHz", "°C")
# Words that are units, but end a name in other senses: force_in, time_min, strain_1.
AMBIGUOUS = {"", "-", "1", "in", "min", "m", "t", "g", "strain", "mil", "ppm", "percent"}
TAIL = 24  # longest unit with the mark before it
# Names of columns in the tables of test rigs, by quantity; the first is fecm's own.
WORDS = {
    "time": ("time", "zeit", "temps", "tempo", "tiempo", "t", "x_value", "x-axis"),
    "force": (
        *("force", "load", "contact force", "impact force", "tup load", "kraft", "last"),
        *("effort", "forza", "fuerza", "carga", "f"),
    ),
    "indentation": (
        *("indentation", "displacement", "extension", "stroke", "depth", "deflection"),
        *("crosshead", "weg", "eindringung", "traverse", "traversenweg", "standardweg"),
        *("déplacement", "spostamento", "desplazamiento"),
    ),
}
DIMENSIONS = {
    "time": "time",
    "force": "force",
    "transducer": "force",
    "indentation": "length",
    "V_F": "voltage",
    "V_a": "voltage",
    "strain": "strain",
}
REMARKS = {"filtered", "unfiltered", "raw", "smoothed", "corrected", "measured", "gefiltert"}
UNMARKED = "write numbers without separators of thousands"
NO_UNITS: Mapping[str, str] = MappingProxyType({})

_COMMA = re.compile(r"[+-]?[0-9]*,[0-9]+(?:[eE][+-]?[0-9]+)?")  # a number with a decimal comma
# Numbers of a column whose marks may separate thousands: 950 and 1,060.
_WHOLE = re.compile(r"[+-]?[0-9]{1,3}")
_GROUPED = re.compile(r"[+-]?[1-9][0-9]{0,2}(?:[.,' \u00a0\u2019\u202f][0-9]{3})+(?:[.,][0-9]+)?")
_BRACKETS = re.compile(r"[(\[]([^()\[\]]*)(?:[)\]]|$)")  # a last one may be open
_MARKS = re.compile(r"[ _]*/[ _]*|[ _,;:-]+")  # between a name and its unit
_SEPARATOR = re.compile(r'"?sep=(.)"?\s*', re.IGNORECASE)


class TableColumn(NamedTuple):
    """Column that is read as a quantity, such as force or strain."""

    name: str
    place: int  # from 0
    unit: str = ""  # in the file; empty if it names none
    is_negated: bool = False

    @property
    def dimension(self) -> str:
        """Dimension of the quantity; empty if its numbers are never converted."""
        return DIMENSIONS.get(self.name, "strain" if self.name.startswith("gage ") else "")


class Record(NamedTuple):
    """File of measured values; both texts are empty for values that were given as arrays."""

    file: str = ""  # its name
    sha256: str = ""  # of its contents

    def __str__(self) -> str:
        return f"{self.file}, SHA-256 {self.sha256}"


IN_MEMORY = Record()


class MeasuredTable(NamedTuple):
    """Rows of a file below its names and units. Both are empty if the file has none."""

    path: Path
    head: Row  # number and fields of the line of names
    units: list[str]  # empty texts for columns without unit
    rows: list[Row]
    is_decimal_comma: bool
    record: Record

    @property
    def names(self) -> list[str]:
        """Names of the columns, without units."""
        return [unit_free(name) for name in self.head[1]]

    def has(self, name: str) -> bool:
        """Return whether a column has a name of a quantity."""
        return any(
            same_name(word, column) for word in WORDS.get(name, (name,)) for column in self.names
        )

    def column(self, name: str, place: int, *, is_negated: bool = False) -> TableColumn:
        """Return the column of a number as a quantity."""
        column = TableColumn(name, place, "", is_negated)
        unit = self.units[place] if place < len(self.units) else ""
        head = self.head[1][place] if place < len(self.head[1]) else ""
        return column._replace(unit=unit or column_head(head, column.dimension).unit)

    def find(
        self,
        names: Sequence[str],
        columns: Sequence[str] | None = None,
        units: Mapping[str, str] = NO_UNITS,
    ) -> list[TableColumn]:
        """Return the columns of quantities.

        A column has a name of :data:`WORDS`, or the name of the quantity. `columns` has the names
        or numbers (from 1) that the user gave. It is empty if the user gave none, and None if the
        user can't give any. A minus before one changes the sign. In a table without names the first
        columns are taken, with a warning. If several columns have the same name, the one in the
        unit of `units` is taken, or else the first one in a known unit. Raises StudyError if a
        column is missing, or if two columns can't be told apart.
        """
        columns_found, requested = [], columns or [""] * len(names)
        names_given = [column.removeprefix("-") for column in requested]
        self._check_numbers(names_given)
        remedy = f"`columns` of {' and '.join(names)} selects others by name or number"
        if columns is None:
            remedy = "rename it in the file"
        for order, (name, column) in enumerate(zip(names, names_given, strict=True)):
            if is_column_number(column) and column not in self.names:
                place = int(column) - 1
            elif not self.head[1] and not column:
                place = order
            else:
                unit = units.get(DIMENSIONS.get(name, ""), "")
                place = self._place(name, column, unit, remedy)
            columns_found.append(self.column(name, place, is_negated=column != requested[order]))
        if not (self.head[1] or any(names_given)):
            choice = ", ".join(f"column {n + 1} as {name}" for n, name in enumerate(names))
            warn(f"{self.path} has no names of columns: {choice}")
        return columns_found

    def _check_numbers(self, requested: Sequence[str]) -> None:
        """Raise StudyError if columns are given by numbers that are names of other columns."""
        numbered = all(map(is_column_number, requested))
        names = [n for n in requested if numbered and self.names[int(n) - 1 : int(n)] != [n]]
        if names and (both := [n for n in names if n in self.names]):
            verb = "is a name" if len(both) == 1 else "are names"
            raise StudyError(
                f"{self.path}: {' and '.join(both)} {verb} of columns, and numbers of others; "
                "rename them in the file, or name one of the columns by a text"
            )

    def _place(self, quantity: str, requested: str, unit: str, remedy: str) -> int:
        """Return the index of the column with a given name, or of the first name of a quantity."""
        words = (requested,) if requested else WORDS.get(quantity, (quantity,))
        word = next((word for word in words if any(same_name(word, n) for n in self.names)), "")
        places = [n for n, name in enumerate(self.names) if word and same_name(word, name)]
        if len(places) > 1:  # in several units
            exact = [n for n in places if self.head[1][n] == word != unit_free(word)]
            units = {n: plain_unit(self.units[n]) for n in places}
            sizes = UNITS.get(DIMENSIONS.get(quantity, ""), {})
            convertible = [n for n in places if units[n] and units[n] in sizes]
            matching = exact or [n for n in convertible if units[n] == plain_unit(unit)]
            distinct = len({units[n] for n in convertible}) == len(convertible)
            places = matching if len(matching) == 1 else convertible[: distinct and not matching]
        if places:
            return places[0]
        listing = ", ".join(self.head[1]) or "unnamed"
        if len(listing) > LISTING:
            listing = f"{listing[:LISTING].rpartition(', ')[0] or listing[:LISTING]}, ..."
        alternatives = f" (or {', '.join(words[1:])})" if words[1:] else ""
        raise StudyError(
            f"{self.path}: the columns are {listing}; one must be named {words[0]}{alternatives}; "
            f"{remedy}"
        )

    def values(
        self,
        columns: Sequence[TableColumn],
        units: Mapping[str, str] | None = None,
        *,
        stated: Sequence[str] = (),
        increasing: str = "",
    ) -> list[Floats]:
        """Return the numbers of columns, (rows,) each, in `units` by dimension.

        Without `units`, nothing is converted. `stated` has the units of a table that names none.
        Raises StudyError if a unit is unknown or can't be converted, a field is not a finite
        number, there are fewer than two rows, or the values of the column `increasing` do not
        increase.
        """
        if len(self.rows) < 2:
            raise StudyError(f"{self.path}: the table has fewer than two rows of numbers")
        for column in columns:
            self.check_thousands(column.name, column.place)
        rows = [self.head, *self.rows] if self._head_is_row(columns) else self.rows
        numbers = list(np.array([self._row(row, columns) for row in rows]).T)
        if increasing:
            named = {column.name: values for column, values in zip(columns, numbers, strict=True)}
            self._check_increase(named, increasing, [line for line, _ in rows])
        for n, column in enumerate(columns):
            unit, stated_unit = column.unit, stated[n] if stated else ""
            where, dimension = f"{self.path}: {column.name}", column.dimension
            if dimension and not (unit or stated_unit):
                self._warn_of_unread_unit(column)
            if unit and stated_unit and factor(where, unit, stated_unit, dimension) != 1.0:
                raise StudyError(f"{where} is in {unit}, and `units` says {stated_unit}")
            if units is not None and dimension:
                numbers[n] *= factor(
                    where, stated_unit or unit, units.get(dimension, ""), dimension
                )
            if column.is_negated:
                numbers[n] = -numbers[n]
        return numbers

    def _warn_of_unread_unit(self, column: TableColumn) -> None:
        """Warn if the name of a column that is taken without a unit ends in what may be one."""
        head = self.head[1][column.place] if column.place < len(self.head[1]) else ""
        if unread := unread_unit(head):
            example = next(iter(UNITS[column.dimension])) or "%"
            warn(
                f"{self.path}: {column.name} is taken without a unit; `{unread}` in `{head}` is "
                "not read as one; if it is one, write it in brackets, as in "
                f"`{column.name} ({example})`"
            )

    def check_thousands(self, name: str, place: int) -> None:
        """Raise StudyError if commas may be decimal marks or separators of thousands.

        Whole numbers up to 999 beside numbers such as 1,060 show that a comma separates thousands.
        A warning is issued if the table does not decide: every comma has one to three digits before
        it, the first of which is not 0, and three digits behind it.
        """
        written = [(line, row[place]) for line, row in self.rows if place < len(row)]
        marked = [field for field in written if _GROUPED.fullmatch(field[1])]
        whole = [text for _, text in written if _WHOLE.fullmatch(text)]
        largest = max((abs(int(text)) for text in whole), default=0)
        if marked and len(marked) + len(whole) == len(written) and largest >= 100:
            line, text = marked[0]
            text = text.replace(".", ",") if self.is_decimal_comma else text
            raise StudyError(
                f"{self.path}:{line}: {name} is {text!r} beside whole numbers; {UNMARKED}"
            )
        if marked and self.is_decimal_comma and self._has_only_groups:
            line, text = marked[0]
            warn(
                f"{self.path}:{line}: {name}, {text.replace('.', ',')!r}, is taken as {text}; if "
                f"its comma separates thousands, {UNMARKED}"
            )

    @property
    def _has_only_groups(self) -> bool:
        """Whether every decimal comma of the table may separate thousands."""
        fields = chain.from_iterable(row for _, row in self.rows)
        marked = [f for f in fields if "." in f and _number(f) is not None]
        return all(map(_GROUPED.fullmatch, marked))

    def _head_is_row(self, columns: Sequence[TableColumn]) -> bool:
        """Return whether the line of names has numbers in some columns, as oscilloscopes write it.

        Different whole numbers from 1 are names of gages or channels.
        """
        fields = [
            self.head[1][column.place] for column in columns if column.place < len(self.head[1])
        ]
        if len(fields) < len(columns) or any(_number(field) is None for field in fields):
            return False
        whole = [field for field in fields if field.isdecimal() and field.strip("0")]
        if len(set(fields)) < len(fields) or len(whole) < len(fields):
            return True
        warn(f"{self.path}:{self.head[0]}: {', '.join(fields)} are taken as names, not as a row")
        return False

    def _check_increase(
        self, columns: Mapping[str, Floats], increasing: str, lines: Sequence[int]
    ) -> None:
        """Raise StudyError if a column does not increase; name one that does."""
        rises = {name: column[1:] > column[:-1] for name, column in columns.items()}
        if rises[increasing].all():
            return
        row = int(rises[increasing].argmin())
        before, after = columns[increasing][row : row + 2]
        rising = [n for n in columns if n != increasing and rises[n].all()]
        remedy = f"; are {increasing} and {rising[0]} swapped?" if rising else "; sort the rows"
        steps = np.diff(columns[increasing])
        if (steps >= 0.0).all() and steps.any():
            remedy = (
                f"; {np.count_nonzero(steps == 0.0)} of {len(steps)} steps are 0: the clock is "
                f"written with too few digits (the mean step is {steps.mean():.4g}); export it "
                "with more, or number the rows and multiply them by the sampling interval"
            )
        raise StudyError(
            f"{self.path}:{lines[row + 1]}: {increasing} must increase: {after:g} "
            f"follows {before:g}{remedy}"
        )

    def _row(self, row: Row, columns: Sequence[TableColumn]) -> list[float]:
        """Return the numbers of one row in the order of `columns`."""
        line, fields = row
        if self.head[1] and len(fields) > len(self.head[1]):
            raise StudyError(
                f"{self.path}:{line}: {len(fields)} fields, but {len(self.head[1])} names; delete "
                "what is above the names, or, if the comma is the decimal mark, separate the "
                "columns by semicolons or tabs"
            )
        values = []
        for column in columns:
            field = fields[column.place] if column.place < len(fields) else ""
            value = _number(field)
            if value is None or not math.isfinite(value):
                shown = repr(field) if field else "empty"
                hint = f"; {UNMARKED}" if _GROUPED.fullmatch(field) else ""
                raise StudyError(
                    f"{self.path}:{line}: {column.name} is {shown}, not a finite number{hint}"
                )
            values.append(value)
        return values


# Units --------------------------------------------------------------------------------------------


def plain_unit(unit: str) -> str:
    """Return the short name of a unit, with u for micro.

    >>> plain_unit("µm/m"), plain_unit("Newtons")
    ('um/m', 'N')
    """
    plain = unit.translate(_MICRO)
    return IN_FULL.get(plain.casefold(), plain)


def unit_size(source: str | Path, unit: str, dimension: str) -> float:
    """Return the size of a unit in m, N, s, V or m/m; StudyError if it is unknown."""
    name = _unit_of(unit, dimension)
    if name is None:
        listing = ", ".join(filter(None, UNITS[dimension]))
        raise StudyError(f"{source}: unknown unit of {dimension} `{unit}`; known units: {listing}")
    return UNITS[dimension][name]


def _unit_of(unit: str, dimension: str) -> str | None:
    """Return the usual name of a unit of a dimension; None if it is unknown."""
    sizes, plain = UNITS[dimension], plain_unit(unit)
    folded = [name for name in sizes if name.casefold() == plain.casefold()]
    return plain if plain in sizes else folded[0] if len(folded) == 1 else None


def factor(source: str, unit: str, deck: str, dimension: str) -> float:
    """Return the factor from a unit of a table to the unit of the deck.

    It is 1 if the table names no unit. Raises StudyError if a unit is unknown, unless both are the
    same.
    """
    if not unit or unit == deck:
        return 1.0
    size = unit_size(source, unit, dimension)
    if not deck and dimension != "strain":
        raise StudyError(
            f"{source} is in {unit}, and the units of the model are not known; name them (UNIT in "
            "a deck), or take the unit out of the header"
        )
    return size / unit_size(source, deck, dimension)


# Names of columns ---------------------------------------------------------------------------------


class ColumnHead(NamedTuple):
    """Name of a column, and its unit; empty if it has none."""

    name: str
    unit: str


@lru_cache(maxsize=4096)
def column_head(text: str, dimension: str = "") -> ColumnHead:
    """Split the header of a column into name and unit.

    A unit is in brackets, or it is a known unit behind a slash (ISO 80000), a blank, an underscore
    or the word "in". A quotient such as ``m/s`` or ``N/mm`` is a unit and no name with a unit.
    Behind a blank or an underscore the unit must have the dimension of the quantity, if that is
    known, and must not be a word of another sense, such as ``in`` or ``min``, if it is not.
    `dimension` is that of the column's quantity; by default the name tells it.

    >>> column_head("force (filtered) [kN]"), column_head("Kraft/kN")
    (ColumnHead(name='force', unit='kN'), ColumnHead(name='Kraft', unit='kN'))
    >>> column_head("Load/Deflection"), column_head("strain_1"), column_head("m/s")
    (ColumnHead(name='Load/Deflection', unit=''), ColumnHead(name='strain_1', unit=''), \
ColumnHead(name='m/s', unit=''))
    """
    texts = [inside.strip() for inside in _BRACKETS.findall(text)]
    unit = next((inside for inside in reversed(texts) if inside.casefold() not in REMARKS), "")
    name = re.split(r"[(\[]", text)[0].strip()
    if unit:
        return ColumnHead(_without_in(name).rstrip(" /_"), unit)
    for head, mark, tail in _ends(name):
        if _is_read(head, mark, tail, dimension or dimension_of_name(head)):
            return ColumnHead(head, tail)
    behind = re.split(r"[)\]]", text)[-1].strip() if texts else ""
    return ColumnHead(name, behind if _is_unit(behind) else "")


def _ends(name: str) -> list[tuple[str, str, str]]:
    """Return the ways to split a name at a mark: name, mark, and unit, the longest unit first."""
    splits = []
    for match in _MARKS.finditer(name, max(0, len(name) - TAIL)):
        head, tail = name[: match.start()], name[match.end() :]
        before_in = _without_in(head)
        mark = "in" if before_in != head else match[0].strip(" _") or " "
        if before_in and tail:
            splits.append((before_in, mark, tail))
    return splits


def _without_in(name: str) -> str:
    """Return a name without the word "in" at its end: ``force in`` kN."""
    return name[:-3].rstrip(" _") if name[-3:].casefold() in (" in", "_in") else name


def _ends_in_unit(name: str) -> bool:
    """Return whether a name ends in a unit, so that what follows its slash is a part of it.

    The letters s and t are names of a displacement and a time too.
    """
    word = re.split(r"[ _,;:-]", name)[-1]
    return _is_unit(word) and word not in ("", "-", "1", "strain") and name not in ("s", "t")


def _is_read(head: str, mark: str, tail: str, dimension: str) -> bool:
    """Return whether a mark separates a name from its unit."""
    if not _is_unit(tail) or (mark == "/" and _ends_in_unit(head)):
        return False
    if mark in ("/", "in"):
        return True
    if dimension:
        return _unit_of(tail, dimension) is not None and tail not in ("", "-", "1")
    return plain_unit(tail).casefold() not in AMBIGUOUS


def _is_unit(text: str) -> bool:
    """Return whether a text is a known unit, or a product or quotient of known units."""
    if any(_unit_of(text, dimension) is not None for dimension in UNITS) or text in OTHER_UNITS:
        return True
    parts = [part.rstrip("^0123456789²³") for part in re.split(r"[/*·]", text)]
    return 1 < len(parts) < 4 and all(part not in ("", "-") and _is_unit(part) for part in parts)


def unread_unit(text: str) -> str:
    """Return what looks like a unit at the end of a header that has none; empty if nothing does."""
    name = re.split(r"[(\[]", text)[0].strip()
    if column_head(text).unit or _is_unit(name):
        return ""
    for head, mark, tail in _ends(name):
        is_short = mark in ("/", "in") and re.fullmatch(r"[^\W\d_][^\W\d_]{0,4}|[%°‰].?", tail)
        is_word = dimension_of_name(tail) or tail.casefold() in REMARKS
        if (is_short or (_is_unit(tail) and tail not in ("", "-", "1"))) and not is_word:
            return "" if mark == "/" and _ends_in_unit(head) else tail
    return ""


def dimension_of_name(name: str) -> str:
    """Return the dimension of the quantity that a name denotes; empty if it is unknown."""
    folded = name.casefold()
    for quantity, dimension in DIMENSIONS.items():
        if folded in WORDS.get(quantity, (quantity.casefold(),)):
            return dimension
    return ""


def unit_in(name: str) -> str:
    """Return the unit in the header of a column; empty if it has none.

    >>> unit_in("force (filtered) [kN]")
    'kN'
    """
    return column_head(name).unit


def is_column_number(text: str) -> bool:
    """Return whether a text is the number of a column, from 1."""
    return text.isdecimal() and len(text) < 10 and int(text) > 0


def same_name(name: str, other_name: str) -> bool:
    """Return whether two names denote the same column."""
    return unit_free(name).casefold() == unit_free(other_name).casefold()


def unit_free(name: str) -> str:
    """Return the name of a column without its unit."""
    return column_head(name).name


# Reading ------------------------------------------------------------------------------------------


def read_table(path: Path, most: int = sys.maxsize) -> MeasuredTable:
    """Read a table of names, units if there are any, and rows.

    Raises StudyError if there are more than `most` lines, or the file is not a table. Raises
    NotEnoughMemoryError if its fields take more memory than is free, OSError if the file can't be
    read.
    """
    data = read_input(path)
    record = Record(printable(path.name), hashlib.sha256(data).hexdigest())
    rows, is_decimal_comma = _rows(path, data, most)
    skipped, named, below = _heading(rows)
    if not named:
        return MeasuredTable(path, (0, []), [], rows, is_decimal_comma, record)
    head, under = rows[skipped], rows[skipped + 1][1] if below else []
    under = [field.strip("()[] ") for field in under] + [""] * len(head[1])
    units = [unit_in(name) or unit for name, unit in zip(head[1], under, strict=False)]
    return MeasuredTable(path, head, units, rows[skipped + 1 + below :], is_decimal_comma, record)


def _heading(rows: list[Row]) -> tuple[int, bool, bool]:
    """Return the index of the names, whether there are names, and whether units are below them.

    The names are above the first line of numbers, or above their units. A line of both texts and
    numbers is a row with a wrong field, unless it has a known name.
    """
    first = next((n for n, row in enumerate(rows) if _is_numeric(row)), -1)
    if first < 1:  # some tables of cases have no line of numbers alone
        named = bool(rows) and any(field and _number(field) is None for field in rows[0][1])
        below = len(rows) > 2 and _is_of_units(rows[1]) and _has_number(rows[2])
        return 0, named, named and below and not _has_number(rows[1])
    above, last = rows[first - 2 : first] if first > 1 else (rows[0], rows[0])
    if _has_word(last):
        return first - 1, True, False
    if _has_number(last):
        return 0, True, False
    alike = first > 1 and len(above[1]) == len(last[1])
    below = alike and (first == 2 or _has_word(above) or _is_of_units(last))
    return first - 1 - below, True, below


def _rows(path: Path, data: bytes, most: int) -> tuple[list[Row], bool]:
    """Return the fields of every line with content, and whether they may have decimal commas."""
    line_count = 1 + max(data.count(b"\n"), data.count(b"\r"))
    field_count = line_count + sum(data.count(mark) for mark in (b",", b";", b"\t", b" "))
    needed = LINE_BYTES * line_count + FIELD_BYTES * field_count + COPIES * len(data)
    require_memory(needed, f"{path}: a table of {line_count} lines")
    every = lines_of(decoded(data, str(path)).removeprefix("\ufeff"))
    named = _SEPARATOR.fullmatch(every[0]) if every else None
    lines = [
        (number, line)
        for number, line in enumerate(every, start=1)
        if line.strip() and not line.lstrip().startswith("#") and not (named and number == 1)
    ]
    if len(lines) > most:
        raise StudyError(f"{path} has {len(lines)} lines; at most {most} are allowed")
    separator = named[1] if named else _separator([line for _, line in lines[-SAMPLE:]])
    rows = []
    for number, line in lines:
        try:
            rows.append((number, _fields(line, separator)))
        except csv.Error as error:
            raise StudyError(f"{path}:{number}: {error}") from None
    values = chain.from_iterable(row for _, row in rows)
    # Beside numbers with a point a comma may separate thousands.
    if separator == "," or any("." in field and _number(field) is not None for field in values):
        return rows, False
    for _, row in rows:
        for place, field in enumerate(row):
            if "," in field and _COMMA.fullmatch(field):
                row[place] = field.replace(",", ".")
    return rows, True


def _fields(line: str, separator: str) -> list[str]:
    """Split a line into fields, without empty fields at its end.

    If blanks separate fields, units stay with their names.
    """
    if '"' in line or len(line) > csv.field_size_limit():
        split = next(csv.reader([line], delimiter=separator, skipinitialspace=True))
    else:  # the same, at a third of the time
        split = line.split(separator) if separator != " " else list(filter(None, line.split(" ")))
    fields = [f.strip() for f in split]
    while fields and not fields[-1]:
        fields.pop()
    if separator != " ":
        return fields
    joined = fields[:1]
    for field in fields[1:]:
        if field[:1] in ("(", "[") and joined[-1][:1] not in ("(", "["):
            joined[-1] += f" {field}"
        else:
            joined.append(field)
    return joined


def _separator(lines: Sequence[str]) -> str:
    """Return the separator that gives the most lines of numbers, or else is in the most lines."""

    def numbers(mark: str) -> int:
        return sum(_is_numeric((0, _fields(line, mark))) for line in lines)

    try:
        return max("\t;, ", key=lambda m: (numbers(m), m != " " and sum(m in n for n in lines)))
    except csv.Error:
        return ","  # which reports the line


def _has_word(row: Row) -> bool:
    """Return whether a row has a name in :data:`WORDS`."""
    words = set(chain.from_iterable(WORDS.values()))
    return any(unit_free(field).casefold() in words for field in row[1])


def _is_numeric(row: Row) -> bool:
    """Return whether a row consists of two or more numbers."""
    fields = [field for field in row[1] if field]
    return len(fields) > 1 and all(
        _COMMA.fullmatch(field) or _number(field) is not None for field in fields
    )


def _is_of_units(row: Row) -> bool:
    """Return whether a row names units: all in brackets, or at least one known unit."""
    fields = [field for field in row[1] if field]
    known_units = {unit.casefold() for sizes in UNITS.values() for unit in sizes}
    if all(field[0] in "([" and field[-1] in ")]" for field in fields):
        return True
    return any(plain_unit(field.strip("()[] ")).casefold() in known_units for field in fields)


def _has_number(row: Row) -> bool:
    return any(_number(field) is not None for field in row[1])


def _number(field: str) -> float | None:
    """Return the number in a field, or None."""
    try:
        return float(field)
    except ValueError:
        return None
