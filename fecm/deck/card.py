"""Cards: the lines of a deck, their fields, numbers in Fortran's forms, and typed records.

Columns are counted from 1. A field includes its first and its last column. A card with a comma
holds its values in the same order, separated by commas. Everything from ``!`` on is a comment.
"""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cache, lru_cache
from typing import Any, ClassVar, NamedTuple, Self

from fecm.deck.findings import CardPlace

LONGEST = 100  # characters of the longest number that is read
WITHOUT_LETTER = 10  # smallest width of a field that may have an exponent without its letter
# No two parts of a pattern match the same characters, so that a mismatch takes linear time.
_INTEGER = re.compile(r"[+-]?[0-9]+")
_REAL = re.compile(
    r"(?P<mantissa>[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+))"
    r"(?:[EeDd](?P<marked>[+-]?[0-9]+)|(?P<bare>[+-][0-9]+))?"
)


def capitals(word: str) -> str:
    """Return a word in capitals, without the blanks around it.

    Letters beyond ASCII stay as they are. Some of them have capitals of two letters, and the word
    would outgrow its field.
    """
    return "".join(c.upper() if c.isascii() else c for c in word.strip())


def parse_integer(text: str) -> int | None:
    """Read an integer without blanks; None if it is not one. The caller limits its length."""
    return int(text) if _INTEGER.fullmatch(text) else None


def parse_real(text: str) -> float | None:
    """Read an F field without blanks; None if it is not a number.

    The field may have any Fortran form: ``45.``, ``.2E-6``, ``1.5D+3``, ``1.5-3``. A number beyond
    the range of double precision is infinite. The caller limits the length to :data:`LONGEST`
    characters.
    """
    if (match := _REAL.fullmatch(text)) is None:
        return None
    exponent = match["marked"] or match["bare"] or "0"
    return float(f"{match['mantissa']}e{exponent}")


def format_real(value: float, width: int) -> str | None:
    """Format a finite number in at most `width` columns, so that it reads back exactly.

    Returns the most readable form that fits, without padding, or None if no form fits. Only fields
    of ten columns or more get an exponent without its letter: ``25-8`` for 2.5E-7 is hard to read.
    """
    numeral = repr(value)
    mantissa, has_exponent, _ = numeral.partition("e")
    is_finite = "n" not in numeral  # neither nan nor inf
    if is_finite and not has_exponent and len(numeral) < width:
        return numeral
    digits = mantissa.lstrip("-").replace(".", "").strip("0")
    if is_finite and len(digits) > width:
        return None
    return _format_numeral(numeral, width)


@lru_cache(4096)
def _format_numeral(numeral: str, width: int) -> str | None:
    """Format a number, the `repr` of a float, in at most `width` columns (cached)."""
    for letter in ("E", "") if width >= WITHOUT_LETTER else ("E",):
        forms = list(_possible_forms(numeral, letter))
        for room in (width - 1, width):  # leave a blank before the number if it fits
            for text in forms:
                if len(text) <= room:
                    return text
    return None


def _possible_forms(numeral: str, letter: str) -> Iterator[str]:
    """Yield the forms of a number, the most readable first, with `letter` before an exponent."""
    from decimal import Decimal  # takes 0.8 ms; only writing a deck needs it

    number = Decimal(numeral).normalize()
    sign, numerals, exponent = number.as_tuple()
    if not isinstance(exponent, int):  # infinite or NaN
        raise ValueError(f"{numeral} can't be written on a card")
    if not number:
        exponent = 0
    minus = "-" if sign else ""
    digits = "".join(map(str, numerals))
    if -20 < exponent < 20:
        fixed = format(abs(number), "f")
        whole = "." not in fixed
        forms = (f"{fixed}.0", f"{fixed}.") if whole else (fixed, fixed.removeprefix("0"))
        yield from (minus + form for form in forms)
    marked = "" if letter else "+"
    for before in (1, *range(2, len(digits) + 1), 0):
        power = exponent + len(digits) - before
        if power or letter:
            yield f"{minus}{digits[:before]}.{digits[before:]}{letter}{power:{marked}d}"
    if not letter:
        yield f"{minus}{digits}{exponent:+d}" if exponent else f"{minus}{digits}"


Value = int | float | str
BLANK = ""  # value of a blank field that has a default


class FieldKind(StrEnum):
    """Content of a field, by the letter of its Fortran format."""

    INTEGER = "I"
    REAL = "F"
    WORD = "A"


class Field(NamedTuple):
    """Field of a card: name, kind, columns, and a label for rulers.

    A blank number is 0. With `has_default` a blank is read as :data:`BLANK`, and the record takes
    its default.
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

    A descriptor is a Fortran format and a name: ``"I5 node"``, ``"A4 word"``. ``"X1"`` skips a
    column. ``"F10 x-coordinate|x"`` adds a label for rulers. ``"F10? radius"`` is a field in which
    a blank is not 0.
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


@dataclass(frozen=True, slots=True)  # a large deck has many cards
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
        """Whether the card starts with a letter, as no card of numbers does."""
        return self.data[:1].isalpha()

    @property
    def keyword(self) -> str:
        """The first four columns, in capitals, without trailing blanks; the rest has no meaning."""
        return self.data[:4].upper().rstrip()

    @property
    def words(self) -> list[str]:
        """Words of the card, separated by blanks or commas, as written."""
        return self.data.replace(",", " ").split()

    @property
    def is_free(self) -> bool:
        """Whether commas separate the values, instead of columns."""
        return "," in self.data

    @property
    def place(self) -> CardPlace:
        """Position of the entire card."""
        return CardPlace(self.line, 1, max(1, len(self.data)), self.text)

    def cut(self, fields: Fields) -> list[tuple[int, str]]:
        """Return the first column and the text of every field, in fixed or in free format.

        In free format the result has the values of the card without the blanks around them, and
        then everything after the fields as one last piece.
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


class CardSource(NamedTuple):
    """Source of a record: the card and its fields."""

    card: Card
    fields: Fields = ()

    def place(self, name: str = "") -> CardPlace:
        """Return the position of the field `name`, or of the entire card without a name."""
        for field, (first, text) in zip(self.fields, self.card.cut(self.fields), strict=False):
            if field.name == name:
                last = first + max(1, len(text)) - 1
                columns = f"col {first}" if first == last else f"cols {first}-{last}"
                return CardPlace(self.card.line, first, last, self.card.text, f"{columns}: {name}")
        return self.card.place


def write_card(fields: Fields, values: Sequence[Value]) -> str:
    """Format values as a card, in free format if a value does not fit its columns.

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
    """Format values as a card in free format, separated by commas."""
    texts = [_format_free(value) for value in values]
    if len(texts) == 1:
        texts.append("")  # a comma makes the format free
    return (", " if all(texts) else ",").join(texts)


def _format_free(value: Value) -> str:
    """Format a value in free format; NumPy's numbers look like Python's."""
    if not isinstance(value, float):
        return str(value)
    if not math.isfinite(value):
        raise ValueError(f"{value} can't be written on a card")
    digits, exponential, exponent = repr(float(value)).partition("e")
    return f"{digits}E{int(exponent)}" if exponential else digits


@dataclass(frozen=True)
class Record:
    """Values of one card, as attributes in the card's order."""

    # The card; None for a record built in Python.
    source: CardSource | None = dataclasses.field(
        default=None, compare=False, repr=False, kw_only=True
    )
    fields: ClassVar[Fields]
    packed: ClassVar[slice | None] = None  # values of the card that one attribute holds as a tuple
    optional: ClassVar[int] = 0  # number of trailing values that are left out if a blank is equal

    @classmethod
    def from_row(cls, values: Sequence[Value], source: CardSource | None) -> Self:
        """Build the record from a card's values; a blank takes the attribute's default."""
        arguments: list[Any] = list(values)  # of the types of the class's attributes
        if cls.packed is not None:
            arguments[cls.packed] = [tuple(arguments[cls.packed])]
        if BLANK not in arguments:
            return cls(*arguments, source=source)
        names = (attribute.name for attribute in dataclasses.fields(cls)[1:])
        stated = {n: value for n, value in zip(names, arguments, strict=False) if value != BLANK}
        return cls(**stated, source=source)

    def row(self) -> list[Value]:
        """Return the values in the card's order; a blank for an attribute that is None."""
        row: list[Value] = []
        for attribute in dataclasses.fields(self)[1:]:  # the first is the source
            value = getattr(self, attribute.name)
            if isinstance(value, tuple):
                row.extend(value)
            else:
                row.append(BLANK if value is None else value)
        return row

    def to_card(self, fields: Fields | None = None) -> str:
        """Return the text of the card; pass `fields` if they depend on the control card."""
        written = fields or self.fields
        values = self.row()[: len(written)]
        least = len(written) - self.optional
        while len(values) > least and not values[-1]:
            # The first attribute is the source.  Where None is a blank, 0 is not.
            if values[-1] != BLANK and dataclasses.fields(self)[len(values)].default is None:
                break
            values.pop()
        return write_card(written[: len(values)], values)

    def place(self, name: str = "") -> CardPlace | None:
        """Return the position of the field `name`, or of the entire card without a name."""
        return self.source.place(name) if self.source else None


@dataclass(frozen=True)
class Control(Record):
    """Control card: 6I5."""

    # Numbers of nodes, elements and layers.
    numnp: int
    numel: int
    layers: int
    # Spatial dimensions, dofs per node, largest number of nodes per element.
    ndm: int
    ndf: int
    nen: int

    fields: ClassVar[Fields] = layout(
        "I5 NUMNP", "I5 NUMEL", "I5 LAYER", "I5 NDM", "I5 NDF", "I5 NEN"
    )
