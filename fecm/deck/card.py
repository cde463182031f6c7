"""Cards: one line of a deck, cut into fields.

Columns are counted from 1 and both ends of a field belong to it.  A card with a comma is read as
values separated by commas, in the same order; everything from ``!`` on is a comment.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cache

from fecm._dataclasses import frozen
from fecm.deck.findings import Place
from fecm.deck.numerals import format_real

Value = int | float | str
BLANK = ""  # value of a blank field that has a default


class FieldKind(StrEnum):
    """What a field holds, by the letter of its Fortran format."""

    INTEGER = "I"
    REAL = "F"
    WORD = "A"


@frozen
class Field:
    """A field of a card: name, kind, columns, and a label for rulers.

    A blank number is 0; with `has_default` it is read as :data:`BLANK` and the record has its
    default.
    """

    name: str
    kind: FieldKind
    first: int
    last: int
    label: str
    has_default: bool

    @property
    def width(self) -> int:
        """Number of columns."""
        return self.last - self.first + 1


Fields = tuple[Field, ...]


@cache
def layout(*descriptors: str) -> Fields:
    """Lay out fields from column 1.

    Each is ``"I5 node"``, ``"A4 word"``, ``"X1"`` for a column that is skipped, or with a label for
    rulers ``"F10 x-coordinate|x"``; ``"F10? radius"`` where a blank is not 0.
    """
    fields: list[Field] = []
    column = 1
    for descriptor in descriptors:
        code, _, text = descriptor.partition(" ")
        letter, size = code[0], code[1:]
        has_default = size.endswith("?")
        width = int(size.rstrip("?"))
        if letter != "X":
            name, _, label = text.partition("|")
            last = column + width - 1
            fields.append(Field(name, FieldKind(letter), column, last, label or name, has_default))
        column += width
    return tuple(fields)


@dataclass(frozen=True, slots=True)  # a large deck has many
class Card:
    """One line of a deck."""

    line: int  # line number in the file, from 1
    text: str  # the line as written
    # The text without its comment and trailing blanks.
    data: str = dataclasses.field(init=False, compare=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "data", self.text.partition("!")[0].rstrip())

    @property
    def is_blank(self) -> bool:
        """Whether every field of the card is blank."""
        return not self.data or not self.data.replace(",", "").strip()

    @property
    def is_keyword(self) -> bool:
        """Whether the card begins with a letter, which no card of numbers does."""
        return self.data[:1].isalpha()

    @property
    def keyword(self) -> str:
        """The first four columns, in capitals, without trailing blanks: the significant part."""
        return self.data[:4].upper().rstrip()

    @property
    def words(self) -> list[str]:
        """Words of the card, separated by blanks or commas, as written."""
        return self.data.replace(",", " ").split()

    @property
    def is_free(self) -> bool:
        """Whether the values are separated by commas instead of standing in columns."""
        return "," in self.data

    @property
    def place(self) -> Place:
        """Place of the entire card."""
        return Place(self.line, 1, max(1, len(self.data)), self.text)

    def cut(self, fields: Fields) -> list[tuple[int, str]]:
        """First column and text of every field, in fixed or in free format.

        Free format gives the values without the blanks around them, as many as the card has, and
        as a last piece all that follows the fields.
        """
        data = self.data
        if not self.is_free:
            return [(f.first, data[f.first - 1 : f.last].ljust(f.width)) for f in fields]
        pieces: list[tuple[int, str]] = []
        start = 1
        for piece in data.split(",", len(fields)):
            lead = len(piece) - len(piece.lstrip()) if piece.strip() else 0
            pieces.append((start + lead, piece.strip()))
            start += len(piece) + 1
        return pieces


@frozen
class Source:
    """Source of a record: its card and the fields of the card."""

    card: Card
    fields: Fields = ()

    def place(self, name: str = "") -> Place:
        """Place of the field `name`, or of the entire card without a name."""
        for field, (first, text) in zip(self.fields, self.card.cut(self.fields), strict=False):
            if field.name == name:
                last = first + max(1, len(text)) - 1
                columns = f"col {first}" if first == last else f"cols {first}-{last}"
                return Place(self.card.line, first, last, self.card.text, f"{columns}: {name}")
        return self.card.place


def write_card(fields: Fields, values: Sequence[Value]) -> str:
    """Write values as a card; in free format where one does not fit its columns.

    Raises ValueError if a number is not finite.
    """
    line = ""
    for field, value in zip(fields, values, strict=True):
        text = format_real(float(value), field.width) if isinstance(value, float) else str(value)
        if text is None or len(text) > field.width:
            return in_free_format(values)
        line = line.ljust(field.first - 1)
        is_word = field.kind is FieldKind.WORD
        line += text.ljust(field.width) if is_word else text.rjust(field.width)
    return line.rstrip()


def in_free_format(values: Sequence[Value]) -> str:
    """Write values separated by commas."""
    texts = [_free(value) for value in values]
    if len(texts) == 1:
        texts.append("")  # a comma makes the format free
    return (", " if all(texts) else ",").join(texts)


def _free(value: Value) -> str:
    """A value's text in free format; NumPy's numbers as Python's."""
    if not isinstance(value, float):
        return str(value)
    if not math.isfinite(value):
        raise ValueError(f"{value} can't be written on a card")
    digits, exponential, exponent = repr(float(value)).partition("e")
    return f"{digits}E{int(exponent)}" if exponential else digits
