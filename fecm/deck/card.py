"""Cards: one line of a deck, cut into fields.

Columns are counted from 1 and both ends of a field belong to it.  A card with a comma is read as
values separated by commas, in the same order; everything from ``!`` on is a comment.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise

from fecm.deck.findings import Findings, Place
from fecm.deck.numbers import format_real, parse_integer, parse_real

Value = int | float | str

LARGEST_INTEGER = 2**31 - 1


@dataclass(frozen=True, slots=True)
class Field:
    """A field of a card: name, Fortran letter (I, F or A), columns, and a label for rulers."""

    name: str
    kind: str
    first: int
    last: int
    label: str

    @property
    def width(self) -> int:
        """Number of columns."""
        return self.last - self.first + 1


Fields = tuple[Field, ...]


@cache
def layout(*descriptors: str) -> Fields:
    """Lay fields out from column 1 on.

    Parameters
    ----------
    *descriptors : str
        ``"I5 node"``, ``"A4 word"``, ``"X1"`` for a column that is skipped, or with a label for
        rulers ``"F10 x-coordinate|x"``.
    """
    fields: list[Field] = []
    column = 1
    for descriptor in descriptors:
        code, _, text = descriptor.partition(" ")
        name, _, label = text.partition("|")
        width = int(code[1:])
        if code[0] != "X":
            fields.append(Field(name, code[0], column, column + width - 1, label or name))
        column += width
    return tuple(fields)


@dataclass(frozen=True, slots=True)
class Card:
    """One line of a deck: its number in the file and its text as it stands there."""

    line: int
    text: str

    @property
    def data(self) -> str:
        """The text without its comment."""
        return self.text.partition("!")[0].rstrip()

    @property
    def is_blank(self) -> bool:
        """Whether the card holds nothing."""
        return not self.data.strip()

    @property
    def is_keyword(self) -> bool:
        """Whether the card begins with a letter, which no card of numbers does."""
        return self.data[:1].isalpha()

    @property
    def keyword(self) -> str:
        """The first four columns, in capitals, without trailing blanks: all of it that counts."""
        return self.data[:4].upper().rstrip()

    @property
    def place(self) -> Place:
        """The whole card."""
        return Place(self.line, 1, max(1, len(self.data)), self.text)

    def cut(self, fields: Fields) -> list[tuple[int, str]]:
        """First column and text of every field, in fixed or in free format.

        Free format gives the values without the blanks around them, as many as the card has.
        """
        data = self.data
        if "," not in data:
            return [(f.first, data[f.first - 1 : f.last].ljust(f.width)) for f in fields]
        pieces: list[tuple[int, str]] = []
        start = 1
        for piece in data.split(","):
            lead = len(piece) - len(piece.lstrip()) if piece.strip() else 0
            pieces.append((start + lead, piece.strip()))
            start += len(piece) + 1
        return pieces


@dataclass(frozen=True, slots=True)
class Source:
    """Where a record was read: its card and the fields that the card was cut into."""

    card: Card
    fields: Fields

    def place(self, name: str = "") -> Place:
        """Where the field called `name` stands; the whole card without a name."""
        for field, (first, text) in zip(self.fields, self.card.cut(self.fields), strict=False):
            if field.name == name:
                last = first + max(1, len(text)) - 1
                columns = f"col {first}" if first == last else f"cols {first}-{last}"
                return Place(self.card.line, first, last, self.card.text, f"{columns}: {name}")
        return self.card.place


def read_values(
    card: Card, fields: Fields, findings: Findings, *, blanks_are_zeros: bool = False
) -> list[Value] | None:
    """Read the values of a card.

    Parameters
    ----------
    card : Card
        The card.
    fields : tuple of Field
        What stands where.
    findings : Findings
        Receives what is wrong.
    blanks_are_zeros : bool
        Read a blank inside a number as the zero that it was on the report's machine, with a
        warning; otherwise it is an error where it would change the value.

    Returns
    -------
    list or None
        One value a field; None after an error.
    """
    source = Source(card, fields)
    fixed = "," not in card.data
    if "\t" in card.data:
        column = card.data.index("\t") + 1
        findings.add(
            "E103",
            "A tab stands on the card, so its columns can't be told.",
            Place(card.line, column, column, card.text),
            "write blanks instead of tabs",
        )
        return None
    if fixed and not blanks_are_zeros and (straddle := _straddling(card, fields)):
        first, last = straddle
        findings.add(
            "E105",
            f"The number `{card.data[first - 1 : last]}` straddles two fields.",
            Place(card.line, first, last, card.text, _neighbours(fields, first, last)),
            "right-justify each number in its own columns",
        )
        return None
    pieces = card.cut(fields)
    _warn_of_rest(card, fields, pieces, findings)
    texts = [text for _, text in pieces[: len(fields)]]
    texts += [""] * (len(fields) - len(texts))
    values: list[Value | None] = []
    for field, text in zip(fields, texts, strict=True):
        if field.kind == "A":
            values.append(text.rstrip())
        else:
            values.append(_number(field, text, source, findings, fixed and blanks_are_zeros))
    sound = [value for value in values if value is not None]
    return sound if len(sound) == len(values) else None


def _warn_of_rest(
    card: Card, fields: Fields, pieces: Sequence[tuple[int, str]], findings: Findings
) -> None:
    """Warn of what stands behind the last field."""
    if "," in card.data:
        rest = [piece for piece in pieces[len(fields) :] if piece[1]]
        first = rest[0][0] if rest else 0
    else:
        tail = card.data[fields[-1].last :]
        first = len(card.data) - len(tail.lstrip()) + 1 if tail.strip() else 0
    if first:
        extra = card.data[first - 1 :]
        findings.add(
            "W106",
            f"`{extra}` stands beyond the last field of the card and is not read.",
            Place(card.line, first, len(card.data), card.text),
        )


def _number(
    field: Field, text: str, source: Source, findings: Findings, zeros: bool
) -> int | float | None:
    """A field's number, or None after noting what is wrong with it."""
    parse = parse_integer if field.kind == "I" else parse_real
    squeezed = text.replace(" ", "")
    if not squeezed:
        return 0 if field.kind == "I" else 0.0
    plain = parse(squeezed)
    padded = parse(text.lstrip().replace(" ", "0"))
    place = source.place(field.name)
    if plain is None and padded is None:
        kind = "whole number" if field.kind == "I" else "number"
        findings.add("E101", f"`{text.strip()}` is not a {kind}.", place, _why(field, squeezed))
        return None
    value = padded if zeros else plain
    if plain != padded:
        if not zeros or value is None:
            _refuse_blank(field, text, padded, source, findings)
            return None
        findings.add(
            "W104", f"A blank inside `{text}` was read as a zero: the value is {value:g}.", place
        )
    if value is None or abs(value) > (LARGEST_INTEGER if field.kind == "I" else sys.float_info.max):
        findings.add("E107", f"`{text.strip()}` is too large a number.", place)
        return None
    return value


def _why(field: Field, text: str) -> str:
    """What keeps a text from being a number."""
    if field.kind == "I" and parse_real(text) is not None:
        return "this field takes no decimal point"
    if re.search("[A-Za-z]", text):
        return "a letter stands where a digit belongs"
    return ""


def _refuse_blank(
    field: Field, text: str, padded: float | None, source: Source, findings: Findings
) -> None:
    """Report a blank that would change a value, with the card as it was meant."""
    was = "no number" if padded is None else f"{padded:g}"
    where = "inside" if " " in text.strip() else "behind"
    line = source.card.data.ljust(field.last)
    justified = text.replace(" ", "").rjust(field.width)
    meant = (line[: field.first - 1] + justified + line[field.last :]).rstrip()
    findings.add(
        "E104",
        f"A blank stands {where} the number `{text.strip()}`; on the report's machine it was a "
        f"zero and the value {was}.",
        source.place(field.name),
        "take the blank out" if "," in line else f"right-justified, the card is `{meant}`",
    )


def _straddling(card: Card, fields: Fields) -> tuple[int, int] | None:
    """Columns of the first run of digits that crosses a field's end without filling the next."""
    ends = {field.last: following for field, following in pairwise(fields)}
    for match in re.finditer(r"[^ ]+", card.data):
        first, last = match.start() + 1, match.end()
        for end, following in ends.items():
            numeric = following.kind != "A"
            if numeric and following.first == end + 1 and first <= end < last < following.last:
                return first, last
    return None


def _neighbours(fields: Fields, first: int, last: int) -> str:
    """Describe the fields that the columns `first` to `last` touch."""
    touched = [f for f in fields if f.first <= last and f.last >= first]
    return ", ".join(f"cols {f.first}-{f.last}: {f.name}" for f in touched)


def write_card(fields: Fields, values: Sequence[Value]) -> str:
    """Write values as a card; in free format where one does not fit its columns.

    Raises
    ------
    ValueError
        If a number is not finite.
    """
    line = ""
    for field, value in zip(fields, values, strict=True):
        text = _written(field, value)
        if text is None:
            return ", ".join(map(_free, values))
        line = line.ljust(field.first - 1)
        line += text.ljust(field.width) if field.kind == "A" else text.rjust(field.width)
    return line.rstrip()


def _free(value: Value) -> str:
    """A value's text in free format; NumPy's numbers as Python's."""
    return repr(float(value)) if isinstance(value, float) else str(value)


def _written(field: Field, value: Value) -> str | None:
    """A value's text in its columns; None when it does not fit."""
    if isinstance(value, str):
        return value if len(value) <= field.width else None
    if isinstance(value, int):
        text = str(value)
        return text if len(text) <= field.width else None
    return format_real(float(value), field.width)
