"""A deck rewritten with aligned columns and a ruler above each kind of card.

Comments and blank cards stay where they are; the model does not change.  Rulers begin with ``!:``
and are replaced each time.
"""

from __future__ import annotations

from fecm.deck.card import Card, Fields, Value, capitals, write_card
from fecm.deck.findings import DeckError
from fecm.deck.model import STOP
from fecm.deck.reader import READERS, Reader
from fecm.deck.records import Macro, without_points

RULER = "!:"


def format_deck(text: str, source: str = "<text>") -> str:
    """Align a deck's columns; `source` is its name in messages.  Raises DeckError."""
    reader = Reader(text, keeps_values=True)
    reader.problems()
    if reader.findings.errors:
        raise DeckError(list(reader.findings), source)
    written: list[str] = []
    above: Fields | None = None
    for number, line in enumerate(reader.lines, start=1):
        if line.startswith(RULER):
            continue
        card = Card(number, line)
        if number in reader.read:
            fields, values = reader.read[number]
            aligned = _aligned(card, fields, values)
            if fields != above and "," not in aligned and fields[0] != Macro.fields[0]:
                written.append(ruler(fields))
            above = fields
            written.append(_with_comment(aligned, line))
        else:
            if not line.startswith("!"):
                above = None
            keyword = card.is_keyword and (card.keyword in READERS or card.keyword == STOP)
            words = card.data.replace(",", " ").split()
            known = card.keyword if keyword and len(words) == 1 else card.data
            written.append(line.rstrip() if line.startswith("!") else _with_comment(known, line))
        if card.keyword == STOP and not line.startswith("!"):
            written += [rest.rstrip() for rest in reader.lines[number:]]
            break
    return "\n".join(written) + "\n"


def ruler(fields: Fields) -> str:
    """A comment with the fields' names over their columns."""
    line = RULER
    for field in fields:
        room = field.last - len(line)
        line += field.label[: room if line == RULER else room - 1].rjust(room)
    return line.rstrip()


def _aligned(card: Card, fields: Fields, values: list[Value]) -> str:
    """A card's values in their columns, without the zeros that it left blank at its end."""
    texts = [text for _, text in card.cut(fields)][: len(fields)]
    count = max([n for n, text in enumerate(texts, start=1) if text.strip()], default=0)
    kept: list[Value] = list(values[:count])
    if fields in (Macro.fields, Macro.short_fields):
        kept[:1] = [capitals(str(v)) for v in kept[:1]]
        if fields == Macro.short_fields:
            kept[1:1] = [""]
        return write_card(Macro.fields[: len(kept)], without_points(kept))
    return write_card(fields[:count], kept) if count else ""


def _with_comment(text: str, line: str) -> str:
    _, mark, comment = line.partition("!")
    return f"{text}  !{comment.rstrip()}" if mark else text.rstrip()
