"""Tables: thousands of cards of numbers, read and written in blocks, and stored in one array.

This module reads a line only if :func:`fecm.deck.values.read_values` would read the same numbers
from it without a finding. All other lines are left to that function.
"""

from __future__ import annotations

import re
from array import array
from collections.abc import Callable, Iterator, Sequence
from functools import cache, cached_property
from itertools import pairwise
from typing import TypeVar, overload

from fecm.deck.card import (
    Card,
    CardSource,
    Field,
    FieldKind,
    Fields,
    Record,
    Value,
    format_real,
    in_free_format,
)

_R = TypeVar("_R", bound=Record)
Line = tuple[int, str]  # a line's number in the file, and its text
Match = Callable[[str], re.Match[str] | None]

# Numbers between commas. They are short enough to be finite and to fit their type.
_INTEGER = "[+-]?[0-9]{1,9}"
_REAL = r"[+-]?(?:[0-9]{1,20}(?:\.[0-9]{0,30})?|\.[0-9]{1,30})(?:[Ee][+-]?[0-9]{1,2})?"


class CardTable(Sequence[_R]):
    """Records of cards of numbers, in one array; access to a record creates it.

    The table compares, hashes and prints as the tuple of its records.

    Parameters
    ----------
    kind : type of Record
        Class of the records.
    fields : tuple of Field
        Fields of a card; all are numbers.
    values : array of float
        Values of the cards, one card after the other. The integers are exact in double precision.
    lines : list of tuple, optional
        Number and text of each card's line; empty for records built in Python.
    """

    def __init__(
        self, kind: type[_R], fields: Fields, values: array[float], lines: Sequence[Line] = ()
    ) -> None:
        self.kind = kind
        self.fields = fields
        self.values = values
        self._lines = lines

    @property
    def width(self) -> int:
        """Number of values of a card."""
        return len(self.fields)

    def rows(self) -> Iterator[list[float]]:
        """Yield the values of each card; integer fields give integers."""
        return _rows(self.fields, self.values)

    def __len__(self) -> int:
        return len(self.values) // self.width

    @overload
    def __getitem__(self, index: int) -> _R: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[_R, ...]: ...
    def __getitem__(self, index: int | slice) -> _R | tuple[_R, ...]:
        if isinstance(index, slice):
            return tuple(self[i] for i in range(*index.indices(len(self))))
        i = range(len(self))[index]
        (row,) = _rows(self.fields, self.values[i * self.width : (i + 1) * self.width])
        source = CardSource(Card(*self._lines[i]), self.fields) if self._lines else None
        return self.kind.from_row(row, source)

    def __eq__(self, other: object) -> bool:
        if isinstance(other, CardTable) and (self.kind, self.width) == (other.kind, other.width):
            return self.values == other.values
        if isinstance(other, CardTable | tuple):
            return tuple(self) == tuple(other)
        return NotImplemented

    def __hash__(self) -> int:
        return hash(tuple(self))

    def __repr__(self) -> str:
        return repr(tuple(self))

    def __add__(self, other: Sequence[_R]) -> tuple[_R, ...]:
        return (*self, *other)

    def __radd__(self, other: Sequence[_R]) -> tuple[_R, ...]:
        return (*other, *self)


def _rows(fields: Fields, values: array[float]) -> Iterator[list[float]]:
    whole = [i for i, field in enumerate(fields) if field.kind is FieldKind.INTEGER]
    for start in range(0, len(values), len(fields)):
        row = values[start : start + len(fields)].tolist()
        for i in whole:
            row[i] = int(row[i])
        yield row


# Reading ------------------------------------------------------------------------------------------


class TableReader:
    """Reader of lines that have numbers in given fields and nothing else."""

    def __init__(self, fields: Fields) -> None:
        self.fields = fields
        self.values = array("d")
        self.lines: list[Line] = []

    # Compiling a pattern takes 1 ms, and most decks need only one of the two.

    @cached_property
    def _in_columns(self) -> Match:
        return _in_columns(self.fields).fullmatch

    @cached_property
    def _with_commas(self) -> Match:
        return _with_commas(self.fields).fullmatch

    def take(self, lines: Sequence[Line], start: int) -> int:
        """Read lines from `start` on, up to the first unreadable one; return their number."""
        values = self.values
        end = start
        for end in range(start, len(lines)):
            line = lines[end][1]
            match = self._with_commas if "," in line else self._in_columns
            if (matched := match(line)) is None:
                break
            complete = len(values)
            try:
                values.extend(map(float, matched.groups("0")))
            except ValueError:
                del values[complete:]
                break
        else:
            end = len(lines)
        self.lines += lines[start:end]
        return end - start

    def add(self, line: Line, row: Sequence[float]) -> None:
        """Add a line that another reader has read."""
        self.values.extend(row)
        self.lines.append(line)

    def last_rows(self, count: int) -> Iterator[tuple[int, tuple[Fields, Sequence[Value]]]]:
        """Yield line number, fields and values of the last `count` lines."""
        start = len(self.values) - count * len(self.fields)
        rows = _rows(self.fields, self.values[start:])
        lines = self.lines[len(self.lines) - count :]
        for (number, _), row in zip(lines, rows, strict=True):
            yield number, (self.fields, row)


# The pattern of a line has a group for each field. The group of a blank field has no match. The
# first field is never blank.


@cache
def _in_columns(fields: Fields) -> re.Pattern[str]:
    """Return the pattern of a line in fixed columns.

    A number ends in the last column of its field. If two numbers touch, the second therefore fills
    its field. The pattern accepts some texts that are not numbers; `float` decides.
    """
    rest = ""
    for before, field in reversed(list(pairwise(fields))):
        gap, blank = (f" {{{n}}}" for n in (field.first - 1 - before.last, field.width))
        rest = f"(?:{gap}(?:{blank}|({_number(field)})){rest})?"
    first = fields[0]
    return re.compile(" " * (first.first - 1) + f"({_number(first)}){rest} *")


@cache
def _with_commas(fields: Fields) -> re.Pattern[str]:
    """Return the pattern of a line with commas."""
    numbers = [_INTEGER if field.kind is FieldKind.INTEGER else _REAL for field in fields]
    rest = ""
    for number in reversed(numbers[1:]):
        rest = f"(?:, *(?:({number}) *)?{rest})?"
    return re.compile(f" *({numbers[0]}) *{rest}")


def _number(field: Field) -> str:
    """Return the pattern of a field with a number up to its last column."""
    width = field.width
    if field.kind is FieldKind.INTEGER:
        return f"[ 0-9+-]{{{width - 1}}}[0-9]"
    mantissa = "[ 0-9.+-]"
    two_digits = f"{mantissa}{{{width - 4}}}[Ee][+-][0-9]{{2}}"
    two_characters = f"{mantissa}{{{width - 3}}}[Ee][0-9+-][0-9]"
    one_digit = f"{mantissa}{{{width - 2}}}[Ee][0-9]"
    return f"{mantissa}{{{width - 1}}}[0-9.]|{two_digits}|{two_characters}|{one_digit}"


# Writing ------------------------------------------------------------------------------------------


def write_rows(table: CardTable[_R]) -> Iterator[str]:
    """Yield the cards of a table, in the form that :func:`fecm.deck.card.write_card` gives."""
    template = ""
    column = 0
    for field in table.fields:
        template += " " * (field.first - 1 - column) + f"%{field.width}s"
        column = field.last
    reals = [(i, f.width) for i, f in enumerate(table.fields) if f.kind is FieldKind.REAL]
    for row in table.rows():
        texts: list[float | str | None] = list(row)
        for i, width in reals:
            texts[i] = format_real(row[i], width)
        line = template % tuple(texts)
        is_too_long = None in texts or len(line) > column
        yield in_free_format(row) if is_too_long else line
