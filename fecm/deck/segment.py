"""Segments: keyword cards with their data. This module reads and writes them as cards."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Generic, Self, TypeVar, cast

from fecm._inputs import lines_of
from fecm.deck.card import Card, CardSource, Control, Fields, Record, Value
from fecm.deck.findings import Findings
from fecm.deck.table import CardTable, TableReader, write_rows
from fecm.deck.values import read_values

if TYPE_CHECKING:
    from numpy.typing import NDArray


_R = TypeVar("_R", bound=Record)


class CardStream:
    """Cards in the order of the file, without comment lines.

    Parameters
    ----------
    text : str
        The deck.
    keywords : collection of str
        Keywords that end the data of a segment.
    blanks_are_zeros : bool
        Whether a blank inside a number is read as a zero, as on the report's machine.
    keeps_values : bool
        Whether :attr:`read` keeps the fields and values of every card.
    """

    def __init__(
        self,
        text: str,
        keywords: Collection[str],
        *,
        blanks_are_zeros: bool = False,
        keeps_values: bool = False,
    ) -> None:
        self.lines: list[str] = lines_of(text.removeprefix("\ufeff"))
        numbered = enumerate(self.lines, start=1)
        self._cards = [(n, line) for n, line in numbered if not line.startswith("!")]
        self._keywords = frozenset(keywords)
        self._blanks_are_zeros = blanks_are_zeros
        self._keeps_values = keeps_values
        self.position: int = 0  # number of cards taken
        self.findings: Findings = Findings()
        self.read: dict[int, tuple[Fields, Sequence[Value]]] = {}  # by line number
        self.control: Control  # of the current problem, from its control card on
        # Keywords of segments of the current problem that have unreadable cards.
        self.unsound: set[str] = set()

    @property
    def at_end(self) -> bool:
        """Whether all cards have been taken."""
        return self.position == len(self._cards)

    @property
    def last(self) -> Card | None:
        """The last card of the file; None if it has none."""
        return Card(*self._cards[-1]) if self._cards else None

    def text_since(self, position: int) -> list[str]:
        """Return the lines of the cards taken since a position."""
        return [line.rstrip() for _, line in self._cards[position : self.position]]

    def comments_above(self, card: Card) -> list[str]:
        """Return the comment lines directly above a card."""
        last = card.line - 1
        first = last
        while first and self.lines[first - 1].startswith("!"):
            first -= 1
        return [line.rstrip() for line in self.lines[first:last]]

    def begins_segment(self, card: Card) -> bool:
        """Return whether a card is the keyword card of a segment, or ends the segments."""
        return card.keyword in self._keywords

    def take(self) -> Card | None:
        """Return the next card; None at the end of the file or when findings are closed."""
        if self.at_end or self.findings.closed:
            return None
        self.position += 1
        return Card(*self._cards[self.position - 1])

    def take_filled(self) -> Card | None:
        """Return the next card that is not blank; None as in :meth:`take`."""
        while not self.at_end and not self._cards[self.position][1].strip():
            self.position += 1
        while (card := self.take()) is not None and card.is_blank:
            pass
        return card

    def give_back(self) -> None:
        """Put the last card back into the stream."""
        self.position -= 1

    def peek(self) -> Card | None:
        """Return the next card as :meth:`take` does, but leave it in the stream."""
        if (card := self.take()) is not None:
            self.give_back()
        return card

    def take_data(self) -> Card | None:
        """Return the next card; None as in :meth:`take`, or before a keyword card, which stays."""
        card = self.take()
        if card is None or not card.is_keyword:
            return card
        self.give_back()
        return None

    def skip_data(self) -> None:
        """Skip cards up to the next keyword."""
        while self.take_data() is not None:
            pass

    def row(self, card: Card, fields: Fields) -> tuple[list[Value], CardSource] | None:
        """Return the values of a card and their source; report an error and return None."""
        values = read_values(card, fields, self.findings, blanks_are_zeros=self._blanks_are_zeros)
        if values is None:
            return None
        if self._keeps_values:
            self.read[card.line] = (fields, values)
        return values, CardSource(card, fields)

    def record(self, card: Card, kind: type[_R], fields: Fields | None = None) -> _R | None:
        """Return the record of a card; report an error and return None."""
        row = self.row(card, fields or kind.fields)
        return None if row is None else kind.from_row(*row)

    def single(self, head: Card, kind: type[_R], fields: Fields | None = None) -> _R | None:
        """Return the record of a segment's mandatory card; None if it is missing or unreadable."""
        card = self.take_data()
        if card is None and head.keyword not in self.unsound:
            message = f"A card of {head.keyword} is missing."
            hint = f"its fields are {', '.join(field.name for field in fields or kind.fields)}"
            self.findings.add("E008", message, (self.peek() or head).place, hint)
        record = None if card is None else self.record(card, kind, fields)
        if record is None:
            self.unsound.add(head.keyword)
        return record

    def until_blank(self, head: Card, kind: type[_R]) -> tuple[_R, ...]:
        """Return the records of the cards of a segment up to a blank card."""
        records: list[_R] = []
        while (card := self.take_data()) is not None and not card.is_blank:
            if (record := self.record(card, kind)) is None:
                self.unsound.add(head.keyword)
            else:
                records.append(record)
        self.end(head, card)
        return tuple(records)

    def table(
        self, head: Card, kind: type[_R], fields: Fields, is_last: Callable[[_R], bool]
    ) -> CardTable[_R]:
        """Return the records of cards of numbers, up to a blank card or after a last record."""
        reader = TableReader(fields)
        self._take_block(reader)
        while (card := self.take_data()) is not None and not card.is_blank:
            if (row := self.row(card, fields)) is None:
                self.unsound.add(head.keyword)
            else:
                reader.add((card.line, card.text), [float(value) for value in row[0]])
            self._take_block(reader)
        table = CardTable(kind, fields, reader.values, reader.lines)
        if not (table and is_last(table[-1])):
            self.end(head, card)
        return table

    def _take_block(self, reader: TableReader) -> None:
        """Take the next cards that `reader` can read as a block, if any."""
        if self.findings.closed:
            return
        count = reader.take(self._cards, self.position)
        self.position += count
        if self._keeps_values:
            self.read.update(reader.last_rows(count))

    def end(self, head: Card, card: Card | None) -> None:
        """Report a segment that does not end with a blank card: `card` is then None."""
        if card is None:
            following = self.peek()
            message = f"The {head.keyword} cards are not ended by a blank card."
            hint = f"put a blank card {'before this one' if following else 'at the end'}"
            self.findings.add("E007", message, (following or head).place, hint)


@dataclass(frozen=True)
class Segment(Record):
    """Keyword card and its data: by default one card with the values of the segment."""

    keyword: ClassVar[str]
    # Whether the card of data begins with a letter, as a keyword card does.
    is_worded: ClassVar[bool] = False
    # Whether the motion of a plate with the segment is not linear in its loads.
    is_nonlinear: ClassVar[bool] = False

    def __init_subclass__(cls, keyword: str = "") -> None:
        super().__init_subclass__()
        cls.keyword = keyword

    @classmethod
    def read(cls, head: Card, cards: CardStream) -> Self | None:
        """Read the cards after the keyword card `head`; report an error and return None."""
        return cards.single(head, cls)

    def cards(self, control: Control) -> Iterator[str]:
        """Return the text of the segment's cards."""
        yield self.keyword
        yield self.to_card()


@dataclass(frozen=True)
class NumberedSegment(Segment, Generic[_R]):
    """Segment of any number of cards, ended by a blank card.

    The records are a tuple, or a sequence that compares and hashes like a tuple.
    """

    records: Sequence[_R]
    record: ClassVar[type[Record]]

    def __init_subclass__(cls, keyword: str, record: type[Record]) -> None:
        super().__init_subclass__(keyword)
        cls.record = record

    @classmethod
    def of(cls, control: Control, cards: NDArray[Any]) -> Self:
        """Build the segment from the values of its cards, (cards, fields)."""
        kind = cast("type[_R]", cls.record)
        return cls(
            CardTable(kind, cls.card_fields(control), array("d", cards.astype(float).tobytes()))
        )

    @classmethod
    def card_fields(cls, control: Control) -> Fields:
        """Return the fields of a card."""
        return cls.record.fields

    @classmethod
    def is_last(cls, record: Record, control: Control) -> bool:
        """Return whether a card ends the segment without a blank card."""
        return False

    @classmethod
    def read(cls, head: Card, cards: CardStream) -> Self | None:
        """Read the cards up to a blank card; report and leave out unreadable cards."""
        control = cards.control
        fields = cls.card_fields(control)
        records = cards.table(head, cls.record, fields, lambda r: cls.is_last(r, control))
        # A class variable can't have the type parameter of its class.
        return cls(cast("CardTable[_R]", records), source=CardSource(head))

    def cards(self, control: Control) -> Iterator[str]:
        """Return the text of the segment's cards."""
        fields = self.card_fields(control)
        yield self.keyword
        if isinstance(self.records, CardTable) and self.records.fields == fields:
            yield from write_rows(self.records)
        else:
            for record in self.records:
                yield record.to_card(fields)
        yield ""
