"""Cards: one line of a deck, cut into fields.

Columns are counted from 1 and both ends of a field belong to it.  A card with a comma is read as
values separated by commas, in the same order; everything from ``!`` on is a comment.
"""

from __future__ import annotations

import dataclasses
import math
import re
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from itertools import pairwise

from fecm._frozen import frozen
from fecm.deck.findings import Findings, Place

JUSTIFY = "right-justify each number in its own columns"
LONGEST = 100  # characters of the longest number that is read
# No two parts of a pattern match the same characters, so that a mismatch takes linear time.
_INTEGER = re.compile(r"[+-]?[0-9]+")
_REAL = re.compile(
    r"(?P<mantissa>[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+))"
    r"(?:[EeDd](?P<marked>[+-]?[0-9]+)|(?P<bare>[+-][0-9]+))?"
)


def capitals(word: str) -> str:
    """A word without the blanks around it, in capitals.

    Letters beyond ASCII stay as they are: the capitals of some are two letters, and the word would
    outgrow its field.
    """
    return "".join(c.upper() if c.isascii() else c for c in word.strip())


def parse_integer(text: str) -> int | None:
    """Read an I field without blanks; None if it is no integer.  The caller limits its length."""
    return int(text) if _INTEGER.fullmatch(text) else None


def parse_real(text: str) -> float | None:
    """Read an F field without blanks; None if it is not a number.

    Understands every Fortran form: ``45.``, ``.2E-6``, ``1.5D+3``, ``1.5-3``.  A number beyond the
    range of double precision is infinite.  The caller limits the length to :data:`LONGEST`
    characters.
    """
    if (match := _REAL.fullmatch(text)) is None:
        return None
    exponent = match["marked"] or match["bare"] or "0"
    return float(f"{match['mantissa']}e{exponent}")


def format_real(value: float, width: int) -> str | None:
    """Write a finite number into `width` columns so that reading it gives the same number again.

    The most readable form that fits, not padded; None if none fits.  Only fields of ten columns or
    more get an exponent without its letter: 2.5E-7 as ``25-8`` is hard to read.
    """
    return _formatted(repr(value), width)


@lru_cache(4096)
def _formatted(numeral: str, width: int) -> str | None:
    """Write the number of a numeral of Python into `width` columns; decks repeat their numbers."""
    for letter in ("E", "") if width >= 10 else ("E",):
        forms = list(_forms(numeral, letter))
        for room in (width - 1, width):  # with a blank between two numbers if it fits
            for text in forms:
                if len(text) <= room:
                    return text
    return None


def _forms(numeral: str, letter: str) -> Iterator[str]:
    """Forms of a number, the most readable first, with `letter` before an exponent."""
    from decimal import Decimal

    number = Decimal(numeral).normalize()
    sign, numerals, exponent = number.as_tuple()
    if not isinstance(exponent, int):  # infinite or no number
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
LARGEST_INTEGER = 2**31 - 1


@frozen
class Field:
    """A field of a card: name, Fortran letter (I, F or A), columns, and a label for rulers.

    A blank number is 0; with `has_default` it is read as ``""`` and the record has its default.
    """

    name: str
    kind: str
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
        name, _, label = text.partition("|")
        width = int(code[1:].rstrip("?"))
        if code[0] != "X":
            last = column + width - 1
            fields.append(Field(name, code[0], column, last, label or name, code[-1] == "?"))
        column += width
    return tuple(fields)


@dataclass(frozen=True, slots=True)
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
    def place(self) -> Place:
        """Place of the entire card."""
        return Place(self.line, 1, max(1, len(self.data)), self.text)

    def cut(self, fields: Fields) -> list[tuple[int, str]]:
        """First column and text of every field, in fixed or in free format.

        Free format gives the values without the blanks around them, as many as the card has, and
        as a last piece all that follows the fields.
        """
        data = self.data
        if "," not in data:
            return [(f.first, data[f.first - 1 : f.last].ljust(f.width)) for f in fields]
        pieces: list[tuple[int, str]] = []
        start = 1
        for piece in data.split(",", len(fields)):
            lead = len(piece) - len(piece.lstrip()) if piece.strip() else 0
            pieces.append((start + lead, piece.strip()))
            start += len(piece) + 1
        return pieces


@dataclass(frozen=True, slots=True)
class Source:
    """Source of a record: its card and the fields of the card."""

    card: Card
    fields: Fields

    def place(self, name: str = "") -> Place:
        """Place of the field `name`, or of the entire card without a name."""
        for field, (first, text) in zip(self.fields, self.card.cut(self.fields), strict=False):
            if field.name == name:
                last = first + max(1, len(text)) - 1
                columns = f"col {first}" if first == last else f"cols {first}-{last}"
                return Place(self.card.line, first, last, self.card.text, f"{columns}: {name}")
        return self.card.place


def read_values(
    card: Card, fields: Fields, findings: Findings, *, blanks_are_zeros: bool = False
) -> list[Value] | None:
    """Read the values of a card, one a field; None after an error, which is reported.

    With `blanks_are_zeros` a blank inside a number is read as the zero that it was on the report's
    machine, with a warning; otherwise it is an error where it would change the value.
    """
    source = Source(card, fields)
    fixed = "," not in card.data
    if "\t" in card.data:
        column = card.data.index("\t") + 1
        message = "The card has a tab, so its columns are ambiguous."
        hint = "write blanks instead of tabs"
        findings.add("E103", message, Place(card.line, column, column, card.text), hint)
        return None
    if fixed and not _is_aligned(card, fields, findings, cut_is_meant=blanks_are_zeros):
        return None
    texts = [text for _, text in card.cut(fields)] + [""] * len(fields)
    if fixed:
        more = card.data[fields[-1].last :].lstrip()
        code, what = "W106", "is beyond the last field of the card and is not read."
    else:
        more = texts[len(fields)].lstrip(", ")
        code, what = "E106", f"follows the last of the card's {len(fields)} values."
    if more:
        end = len(card.data)
        place = Place(card.line, end - len(more) + 1, end, card.text)
        findings.add(code, f"`{more}` {what}", place, "" if fixed else _separators(card, fields))
        if not fixed:
            return None
    zeros = fixed and blanks_are_zeros
    valid: list[Value] = []
    for field, text in zip(fields, texts, strict=False):  # more texts than fields
        value = _value(field, text, source, findings, zeros)
        if value is not None:
            valid.append(value)
        elif _separators(card, fields):  # one cause, one finding
            return None
    return valid if len(valid) == len(fields) else None


def _separators(card: Card, fields: Fields) -> str:
    """Hint for a card with blanks between its values, or decimal commas; empty for another."""
    if "," in card.data:
        return _with_points(card, fields)
    words = card.data.split()
    if not re.fullmatch(r" {0,2}\S+(?: {1,2}\S+)+", card.data):
        return ""
    if len(words) > len(fields) or len(words) < min(3, len(fields)):
        return ""
    if words == [text.strip() for _, text in card.cut(fields) if text.strip()]:
        return ""  # every value is in its columns
    widths = {field.width for field in fields}
    columns = f"{widths.pop()} columns" if len(widths) == 1 else "fixed columns"
    return f"fields have {columns}; or separate the values by commas: {','.join(words)}"


def _with_points(card: Card, fields: Fields) -> str:
    """Hint for a card with commas, of which some stand in numbers for the decimal point."""
    pointed = re.sub("(?<=[0-9]),(?=[0-9])", ".", card.data)
    words = pointed.replace(",", " ").split()
    pieces = [text for _, text in card.cut(fields)]
    with_blanks = any(" " in piece for piece in pieces)
    too_many = len(pieces) > len(fields) and "." not in card.data
    if pointed == card.data or len(words) > len(fields) or not (with_blanks or too_many):
        return ""
    if not all(parse_real(word[:LONGEST]) is not None or word.isalpha() for word in words):
        return ""
    written = f"{words[0]}," if len(words) == 1 else ",".join(words)
    return f"a comma separates values; with decimal points the card is `{written}`"


def _is_aligned(card: Card, fields: Fields, findings: Findings, *, cut_is_meant: bool) -> bool:
    """Whether no text crosses the end of its field; numbers may with `cut_is_meant`."""
    data = card.data

    def refuse(code: str, message: str, run: tuple[int, int], width: int, hint: str) -> bool:
        first, last = run
        touched = [f for f in fields if f.first <= last and f.last >= first]
        names = ", ".join(f"cols {f.first}-{f.last}: {f.name}" for f in touched)
        place = Place(card.line, first, last, card.text, names)
        remedy = _remedy(card, fields, last - first + 1, width)
        findings.add(code, message, place, _separators(card, fields) or remedy or hint)
        return False

    for field, following in pairwise(fields):
        gap = data[field.last : following.first - 1]
        if gap.strip():
            column = field.last + 1 + len(gap) - len(gap.lstrip())
            first, last = _run_around(data, column)
            if data[first - 1 : last].isalpha():  # a word may have more than four letters
                continue
            target = next(f for f in fields if f.first > column and f.kind != "A")
            message = f"Column {column} belongs to no field; it has `{data[column - 1]}`."
            hint = f"cols {target.first}-{target.last} are the next field: {target.name}"
            return refuse("E108", message, (first, last), target.width, hint)
        if gap or cut_is_meant or following.kind == "A" or not _is_joined(data, field.last):
            continue
        first, last = _run_around(data, field.last)
        if last < following.last:
            message = f"The number `{data[first - 1 : last]}` straddles two fields."
            width = max(field.width, following.width)
            return refuse("E105", message, (first, last), width, JUSTIFY)
    field = fields[-1]
    if cut_is_meant or not _is_joined(data, field.last):
        return True
    first, last = _run_around(data, field.last)
    first = max(first, field.first)
    if last - first < LONGEST:
        value = parse_real(data[first - 1 : last])
        if value is None or value == parse_real(data[first - 1 : field.last]):
            return True
    message = f"The number `{data[first - 1 : last]}` crosses the end of its field."
    return refuse("E105", message, (first, last), field.width, JUSTIFY)


def _is_joined(data: str, column: int) -> bool:
    return len(data) > column and " " not in data[column - 1 : column + 1]


def _run_around(data: str, column: int) -> tuple[int, int]:
    """First and last column of the text without blanks around a column."""
    end = data.find(" ", column - 1)
    return data.rfind(" ", 0, column) + 2, len(data) if end < 0 else end


def _remedy(card: Card, fields: Fields, length: int, width: int) -> str:
    """A hint for a number that is longer than its field; empty for one that fits."""
    if length <= width:
        return ""
    too_long = f"the number has {length} characters and its field {width} columns"
    runs = [(match.start() + 1, match[0]) for match in re.finditer(r"[^ ]+", card.data)]
    texts: list[str] = []
    begin = 0
    for field in fields:
        inside = [text for first, text in runs if begin < first <= field.last]
        if len(inside) > 1:
            return f"{too_long}: separate the values by commas"
        texts += inside or [""]
        begin = field.last
    return f"{too_long}: with commas the card is `{','.join(texts).rstrip(',')}`"


def _value(
    field: Field, text: str, source: Source, findings: Findings, zeros: bool
) -> Value | None:
    """A field's value, ``""`` where a blank has a default, or None after reporting an error."""
    if field.kind == "A":
        word = text.rstrip()
        if len(word) <= field.width:
            return word
        message = f"`{word}` has {len(word)} characters; the field takes {field.width}."
        findings.add("E109", message, source.place(field.name), "values are separated by commas")
        return None
    parse = parse_integer if field.kind == "I" else parse_real
    written = text.strip()
    if not written:
        return "" if field.has_default else 0 if field.kind == "I" else 0.0
    if len(written) > LONGEST:
        message = f"The number has {len(written)} characters; at most {LONGEST} are read."
        findings.add("E109", message, source.place(field.name))
        return None
    squeezed = text.replace(" ", "")
    plain = parse(squeezed)
    left = text.lstrip()
    padded = parse(left.replace(" ", "0")) if " " in left else plain
    if plain is None and padded is None:
        kind, hint = "whole number" if field.kind == "I" else "number", ""
        if field.kind == "I" and parse_real(squeezed) is not None:
            hint = "this field takes no decimal point"
        elif re.search("[A-Za-z]", squeezed):
            hint = "it has a letter in place of a digit"
        hint = _separators(source.card, source.fields) or hint
        findings.add("E101", f"`{written}` is not a {kind}.", source.place(field.name), hint)
        return None
    value = padded if zeros else plain
    if plain != padded:
        if not zeros or value is None:
            was = "no number" if padded is None else f"{padded:g}"
            where = "inside" if " " in written else "after"
            what = f"There is a blank {where} the number `{written}`"
            read = f"the report's machine read it as a zero and the value as {was}"
            line = source.card.data.ljust(field.last)
            meant = line[: field.first - 1] + squeezed.rjust(field.width) + line[field.last :]
            hint = f"right-justified, the card is `{meant.rstrip()}`"
            if "," in line:
                hint = "remove the blank"
            hint = _separators(source.card, source.fields) or hint
            findings.add("E104", f"{what}; {read}.", source.place(field.name), hint)
            return None
        message = f"A blank inside `{text}` was read as a zero: the value is {value:g}."
        findings.add("W104", message, source.place(field.name))
    if value is None or abs(value) > (LARGEST_INTEGER if field.kind == "I" else sys.float_info.max):
        findings.add("E107", f"`{written}` is too large a number.", source.place(field.name))
        return None
    return value


def write_card(fields: Fields, values: Sequence[Value]) -> str:
    """Write values as a card; in free format where one does not fit its columns.

    Raises ValueError if a number is not finite.
    """
    line = ""
    for field, value in zip(fields, values, strict=True):
        text = format_real(float(value), field.width) if isinstance(value, float) else str(value)
        if text is None or len(text) > field.width:
            texts = [_free(value) for value in values]
            if len(texts) == 1:
                texts.append("")  # a comma makes the format free
            return (", " if all(texts) else ",").join(texts)
        line = line.ljust(field.first - 1)
        line += text.ljust(field.width) if field.kind == "A" else text.rjust(field.width)
    return line.rstrip()


def _free(value: Value) -> str:
    """A value's text in free format; NumPy's numbers as Python's."""
    if not isinstance(value, float):
        return str(value)
    if not math.isfinite(value):
        raise ValueError(f"{value} can't be written on a card")
    digits, exponential, exponent = repr(float(value)).partition("e")
    return f"{digits}E{int(exponent)}" if exponential else digits
