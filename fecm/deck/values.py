"""Values of a card, and findings that explain what is wrong with a value and how to write it."""

from __future__ import annotations

import re
import sys
from itertools import pairwise
from typing import NamedTuple

from fecm.deck.card import (
    BLANK,
    LONGEST,
    Card,
    CardSource,
    Field,
    FieldKind,
    Fields,
    Value,
    parse_integer,
    parse_real,
)
from fecm.deck.findings import CardPlace, Findings

LARGEST_INTEGER = 2**31 - 1
# Looking up the members of the enumeration would take a tenth of the time of reading a deck.
INTEGER = FieldKind.INTEGER
WORD = FieldKind.WORD


def read_values(
    card: Card, fields: Fields, findings: Findings, *, blanks_are_zeros: bool = False
) -> list[Value] | None:
    """Read the values of a card, one per field; report an error and return None.

    With `blanks_are_zeros` a blank inside a number is read as a zero, as on the report's machine,
    with a warning. Otherwise such a blank is an error if it would change the value.
    """
    if "\t" in card.data:
        column = card.data.index("\t") + 1
        message = "The card has a tab, so its columns are ambiguous."
        hint = "write blanks instead of tabs"
        findings.add("E103", message, CardPlace(card.line, column, column, card.text), hint)
        return None
    is_free = card.is_free
    if not is_free:
        misplaced = _find_misplaced(card, fields, cuts_numbers=blanks_are_zeros)
        if misplaced is not None:
            _report_misplaced(misplaced, card, fields, findings)
            return None
    if not _ends_with_its_fields(card, fields, findings):
        return None

    source = CardSource(card, fields)
    texts = [text for _, text in card.cut(fields)] + [""] * len(fields)
    zeros = blanks_are_zeros and not is_free
    values: list[Value] = []
    value: Value | None
    for field, text in zip(fields, texts, strict=False):  # more texts than fields
        if field.kind is WORD:
            value = _read_word(field, text, source, findings)
        else:
            value = _read_number(field, text, source, findings, blanks_are_zeros=zeros)
        if value is not None:
            values.append(value)
        elif _hint_of_separators(card, fields):  # one cause, one finding
            return None
    return values if len(values) == len(fields) else None


def _ends_with_its_fields(card: Card, fields: Fields, findings: Findings) -> bool:
    """Return whether a card has no more values than fields.

    In fixed columns, more values cause only a warning.
    """
    if card.is_free:
        pieces = card.cut(fields)[len(fields) :]
        surplus = pieces[0][1].lstrip(", ") if pieces else ""
    else:
        surplus = card.data[fields[-1].last :].lstrip()
    if not surplus:
        return True

    end = len(card.data)
    place = CardPlace(card.line, end - len(surplus) + 1, end, card.text)
    if card.is_free:
        message = f"`{surplus}` follows the last of the card's {len(fields)} values."
        findings.add("E106", message, place, _hint_of_separators(card, fields))
        return False
    message = f"`{surplus}` is beyond the last field of the card and is not read."
    findings.add("W106", message, place)
    return True


def _read_word(field: Field, text: str, source: CardSource, findings: Findings) -> str | None:
    """Return the word of a field; report a word that is too long and return None."""
    word = text.rstrip()
    if len(word) <= field.width:
        return word
    message = f"`{word}` has {len(word)} characters; the field takes {field.width}."
    findings.add("E109", message, source.place(field.name), "values are separated by commas")
    return None


def _read_number(
    field: Field, text: str, source: CardSource, findings: Findings, *, blanks_are_zeros: bool
) -> Value | None:
    """Return the number of a field; report an error and return None.

    A blank field is 0, or :data:`BLANK` if it has a default.
    """
    is_integer = field.kind is INTEGER
    parse = parse_integer if is_integer else parse_real
    written = text.strip()
    if not written:
        if field.has_default:
            return BLANK
        return 0 if is_integer else 0.0
    if len(written) > LONGEST:
        message = f"The number has {len(written)} characters; at most {LONGEST} are read."
        findings.add("E109", message, source.place(field.name))
        return None

    stripped = text.lstrip()
    plain = parse(text.replace(" ", ""))
    padded = parse(stripped.replace(" ", "0")) if " " in stripped else plain
    if plain is None and padded is None:
        _report_no_number(field, text, source, findings)
        return None
    value = padded if blanks_are_zeros else plain
    if plain != padded:
        if not blanks_are_zeros or value is None:
            _report_blank(field, text, padded, source, findings)
            return None
        message = f"A blank inside `{text}` was read as a zero: the value is {value:g}."
        findings.add("W104", message, source.place(field.name))
    if value is None or abs(value) > (LARGEST_INTEGER if is_integer else sys.float_info.max):
        findings.add("E107", f"`{written}` is too large a number.", source.place(field.name))
        return None
    return value


def _report_no_number(field: Field, text: str, source: CardSource, findings: Findings) -> None:
    is_integer = field.kind is INTEGER
    squeezed = text.replace(" ", "")
    hint = ""
    if is_integer and parse_real(squeezed) is not None:
        hint = "this field takes no decimal point"
    elif re.search("[A-Za-z]", squeezed):
        hint = "it has a letter in place of a digit"
    hint = _hint_of_separators(source.card, source.fields) or hint
    kind = "whole number" if is_integer else "number"
    message = f"`{text.strip()}` is not a {kind}."
    findings.add("E101", message, source.place(field.name), hint)


def _report_blank(
    field: Field, text: str, padded: float | None, source: CardSource, findings: Findings
) -> None:
    """Report a blank that changes a number; `padded` is the number with a zero in its place."""
    written = text.strip()
    where = "inside" if " " in written else "after"
    was = "no number" if padded is None else f"{padded:g}"
    message = (
        f"There is a blank {where} the number `{written}`; "
        f"the report's machine read it as a zero and the value as {was}."
    )
    card = source.card
    if card.is_free:
        hint = "remove the blank"
    else:
        line = card.data.ljust(field.last)
        number = text.replace(" ", "").rjust(field.width)
        corrected = line[: field.first - 1] + number + line[field.last :]
        hint = f"right-justified, the card is `{corrected.rstrip()}`"
    hint = _hint_of_separators(card, source.fields) or hint
    findings.add("E104", message, source.place(field.name), hint)


class _Misplaced(NamedTuple):
    """Text that is not inside its field."""

    code: str
    message: str
    # First and last column.
    first: int
    last: int
    width: int  # width of the intended field
    hint: str = "right-justify each number in its own columns"


def _find_misplaced(card: Card, fields: Fields, *, cuts_numbers: bool) -> _Misplaced | None:
    """Return the first text that lies between fields or crosses the end of its field.

    With `cuts_numbers` a number may cross the end of its field, which cuts it.
    """
    data = card.data
    for field, following in pairwise(fields):
        gap = data[field.last : following.first - 1]
        if gap.strip():
            column = field.last + 1 + len(gap) - len(gap.lstrip())
            first, last = _run_around(data, column)
            if data[first - 1 : last].isalpha():  # a word may have more than four letters
                continue
            target = next(f for f in fields if f.first > column and f.kind is not WORD)
            message = f"Column {column} belongs to no field; it has `{data[column - 1]}`."
            hint = f"cols {target.first}-{target.last} are the next field: {target.name}"
            return _Misplaced("E108", message, first, last, target.width, hint)
        if gap or cuts_numbers or following.kind is WORD:
            continue
        if not _is_joined(data, field.last):
            continue
        first, last = _run_around(data, field.last)
        if last < following.last:
            message = f"The number `{data[first - 1 : last]}` straddles two fields."
            width = max(field.width, following.width)
            return _Misplaced("E105", message, first, last, width)
    return None if cuts_numbers else _find_cut_number(data, fields[-1])


def _find_cut_number(data: str, field: Field) -> _Misplaced | None:
    """Return a number that crosses the end of the last field and has another value if cut there."""
    if not _is_joined(data, field.last):
        return None
    first, last = _run_around(data, field.last)
    first = max(first, field.first)
    number = data[first - 1 : last]
    if len(number) <= LONGEST:
        value = parse_real(number)
        if value is None or value == parse_real(data[first - 1 : field.last]):
            return None
    message = f"The number `{number}` crosses the end of its field."
    return _Misplaced("E105", message, first, last, field.width)


def _report_misplaced(
    misplaced: _Misplaced, card: Card, fields: Fields, findings: Findings
) -> None:
    first, last = misplaced.first, misplaced.last
    touched = [f for f in fields if f.first <= last and f.last >= first]
    names = ", ".join(f"cols {f.first}-{f.last}: {f.name}" for f in touched)
    place = CardPlace(card.line, first, last, card.text, names)
    hint = (
        _hint_of_separators(card, fields)
        or _hint_of_length(card, fields, last - first + 1, misplaced.width)
        or misplaced.hint
    )
    findings.add(misplaced.code, misplaced.message, place, hint)


def _is_joined(data: str, column: int) -> bool:
    """Return whether a column and the next one are filled."""
    return len(data) > column and " " not in data[column - 1 : column + 1]


def _run_around(data: str, column: int) -> tuple[int, int]:
    """Return the first and the last column of the text without blanks around a column."""
    end = data.find(" ", column - 1)
    return data.rfind(" ", 0, column) + 2, len(data) if end < 0 else end


def _hint_of_separators(card: Card, fields: Fields) -> str:
    """Return a hint for a card with blanks between values or with decimal commas; else ""."""
    if card.is_free:
        return _hint_of_points(card, fields)
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


def _hint_of_points(card: Card, fields: Fields) -> str:
    """Return a hint for a card with decimal commas between commas that separate values; else ""."""
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


def _hint_of_length(card: Card, fields: Fields, length: int, width: int) -> str:
    """Return a hint for a number that is longer than its field; else ""."""
    if length <= width:
        return ""
    too_long = f"the number has {length} characters and its field {width} columns"
    runs = [(match.start() + 1, match[0]) for match in re.finditer(r"[^ ]+", card.data)]
    texts: list[str] = []
    end = 0  # last column of the previous field
    for field in fields:
        inside = [text for first, text in runs if end < first <= field.last]
        if len(inside) > 1:
            return f"{too_long}: separate the values by commas"
        texts += inside or [""]
        end = field.last
    return f"{too_long}: with commas the card is `{','.join(texts).rstrip(',')}`"
