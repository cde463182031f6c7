"""Formatter of decks: aligned columns and a ruler above each kind of card.

Comments and blank cards stay in their places. The model does not change. Rulers start with ``!:``;
each run replaces them.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from fecm.deck.card import BLANK, Card, Fields, Value, capitals, write_card
from fecm.deck.findings import DeckError
from fecm.deck.macros import Macro, without_points
from fecm.deck.model import SEGMENTS, STOP
from fecm.deck.reader import Reader

COMMENT = "!"
RULER = "!:"  # start of a comment that shows the columns of the fields


def format_deck(text: str, source: str = "<text>") -> str:
    """Align the columns of a deck; `source` is its name in messages.

    A byte order mark stays. All lines end as the first one. Raises DeckError if the deck can't be
    read.
    """
    reader = Reader(text, keeps_values=True)
    reader.problems()
    if reader.findings.errors:
        raise DeckError(list(reader.findings), source)
    lines = reader.cards.lines
    written: list[str] = []
    above: Fields | None = None  # fields of the card above; the same fields need no second ruler
    for number, line in enumerate(lines, start=1):
        if line.startswith(RULER):
            continue
        if line.startswith(COMMENT):
            written.append(line.rstrip())
            continue
        card = Card(number, line)
        if number in reader.cards.read:
            fields, values = reader.cards.read[number]
            aligned = _align(card, fields, values)
            if fields != above and "," not in aligned and fields[0] != Macro.fields[0]:
                written.append(ruler(fields))
            above = fields
        else:
            aligned = _capitalize_keyword(card)
            above = None
        written.append(_with_comment(aligned, line))
        if card.keyword == STOP:
            written += [rest.rstrip() for rest in lines[number:]]
            break
    mark = "\ufeff" if text.startswith("\ufeff") else ""
    end = match[0] if (match := re.search("\r?\n|\r", text)) else "\n"
    return mark + end.join([*written, ""])


def _capitalize_keyword(card: Card) -> str:
    """Return the text of a card without fields, in capitals if it is a known keyword."""
    is_known = card.is_keyword and (card.keyword in SEGMENTS or card.keyword == STOP)
    return card.keyword if is_known and len(card.words) == 1 else card.data


def ruler(fields: Fields) -> str:
    """Return a comment with the labels of the fields above their columns."""
    line = RULER
    for field in fields:
        room = field.last - len(line)
        line += field.label[: room if line == RULER else room - 1].rjust(room)
    return line.rstrip()


def _align(card: Card, fields: Fields, values: Sequence[Value]) -> str:
    """Return the values of a card in their columns; trailing fields that are blank stay blank."""
    texts = [text for _, text in card.cut(fields)][: len(fields)]
    count = max([n for n, text in enumerate(texts, start=1) if text.strip()], default=0)
    kept: list[Value] = list(values[:count])
    if fields is Macro.fields or fields is Macro.short_fields:  # `==` takes far longer
        kept[:1] = [capitals(str(v)) for v in kept[:1]]
        if fields is Macro.short_fields:
            kept[1:1] = [BLANK]
        return write_card(Macro.fields[: len(kept)], without_points(kept))
    return write_card(fields[:count], kept) if count else ""


def _with_comment(text: str, line: str) -> str:
    _, mark, comment = line.partition(COMMENT)
    return f"{text}  !{comment.rstrip()}" if mark else text.rstrip()
