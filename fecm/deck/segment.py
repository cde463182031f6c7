"""Segments: a keyword card and the data that follow it, how they are read and how written."""

from __future__ import annotations

from array import array
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Generic, Self, TypeVar, cast

from fecm._dataclasses import frozen
from fecm.deck.card import Card, Fields, Source
from fecm.deck.record import Control, Record
from fecm.deck.stream import CardStream
from fecm.deck.table import Table, write_rows

if TYPE_CHECKING:
    from numpy.typing import NDArray

_R = TypeVar("_R", bound=Record)


@frozen
class Segment(Record):
    """A keyword card and the data that follow it: by default one card, the segment's own values."""

    keyword: ClassVar[str]
    # Whether its card of data begins with a letter, as a keyword card does.
    is_worded: ClassVar[bool] = False

    def __init_subclass__(cls, keyword: str = "") -> None:
        super().__init_subclass__()
        cls.keyword = keyword

    @classmethod
    def read(cls, head: Card, cards: CardStream) -> Self | None:
        """Read the cards after the keyword card `head`; None after an error, which is reported."""
        return cards.single(head, cls)

    def cards(self, control: Control) -> Iterator[str]:
        """Text of the segment's cards."""
        yield self.keyword
        yield self.to_card()


@frozen
class NumberedSegment(Segment, Generic[_R]):
    """A segment of any number of cards, ended by a blank one.

    The records are a tuple, or what compares and hashes like one.
    """

    records: Sequence[_R]
    record: ClassVar[type[Record]]

    def __init_subclass__(cls, keyword: str, record: type[Record]) -> None:
        super().__init_subclass__(keyword)
        cls.record = record

    @classmethod
    def of(cls, control: Control, cards: NDArray[Any]) -> Self:
        """Segment with the values of its cards, (cards, fields)."""
        kind = cast("type[_R]", cls.record)
        return cls(Table(kind, cls.card_fields(control), array("d", cards.astype(float).tobytes())))

    @classmethod
    def card_fields(cls, control: Control) -> Fields:
        """Fields of a card."""
        return cls.record.fields

    @classmethod
    def is_last(cls, record: Record, control: Control) -> bool:
        """Whether a card ends the segment, so that no blank one must follow."""
        return False

    @classmethod
    def read(cls, head: Card, cards: CardStream) -> Self | None:
        """Read the cards up to a blank one; unreadable ones are reported and left out."""
        control = cards.control
        fields = cls.card_fields(control)
        found = cards.table(head, cls.record, fields, lambda r: cls.is_last(r, control))
        # No class variable can have the type of the class's parameter.
        return cls(cast("Table[_R]", found), source=Source(head))

    def cards(self, control: Control) -> Iterator[str]:
        """Text of the segment's cards."""
        fields = self.card_fields(control)
        yield self.keyword
        if isinstance(self.records, Table) and self.records.fields == fields:
            yield from write_rows(self.records)
        else:
            for record in self.records:
                yield record.to_card(fields)
        yield ""
