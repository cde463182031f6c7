"""Cards of the output: strain gages, names of units, size of the file, the printer's options."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar, Self

from fecm.deck.card import Card, CardSource, Control, Fields, Record, layout
from fecm.deck.segment import CardStream, NumberedSegment, Segment


@dataclass(frozen=True)
class Gage(Record):
    """GAGE card: (I5,5X,4F10.0); a strain gage."""

    number: int  # name of the gage in the result
    # Position (length). z is 0 at the mid-plane, and positive away from the projectile.
    x: float
    y: float
    z: float
    direction: float  # degrees from the x-axis to the y-axis

    fields: ClassVar[Fields] = layout(
        "I5 gage",
        "X5",
        "F10 gage's x|x",
        "F10 gage's y|y",
        "F10 gage's z|z",
        "F10 gage's direction|degrees",
    )


@dataclass(frozen=True)
class Gages(NumberedSegment[Gage], keyword="GAGE", record=Gage):
    """GAGE: strain gages, read at every step (not in the report's program)."""


@dataclass(frozen=True)
class Units(Segment, keyword="UNIT"):
    """UNIT: names of the deck's units, for output; nothing is converted."""

    length: str
    force: str
    time: str

    is_worded: ClassVar[bool] = True
    NAMES: ClassVar[tuple[str, ...]] = ("length", "force", "time")

    @classmethod
    def read(cls, head: Card, cards: CardStream) -> Self | None:
        """Read the card of the three names."""
        card = cards.take()
        if card is not None and len(names := card.words) == len(cls.NAMES):
            return cls(*names, source=CardSource(card))
        if card is not None and cards.begins_segment(card):
            cards.give_back()

        message = "UNIT takes one card with three names: the units of length, force and time."
        names = head.words[1:]
        if len(names) == len(cls.NAMES):
            place = head.place
            hint = f"put the names on the card after UNIT: {' '.join(names)}"
        else:
            place = (card or head).place
            hint = "for example: in lbf s"
        cards.findings.add("E010", message, place, hint)
        return None

    def cards(self, control: Control) -> Iterator[str]:
        """Return the text of the segment's cards."""
        yield self.keyword
        yield f"{self.length} {self.force} {self.time}"


@dataclass(frozen=True)
class Compact(Segment, keyword="COMP"):
    """COMP: fields in single precision, and a compressed file (not in the report's program)."""

    @classmethod
    def read(cls, head: Card, cards: CardStream) -> Self:
        """Read the keyword card, the only card of the segment."""
        return cls(source=CardSource(head))

    def cards(self, control: Control) -> Iterator[str]:
        """Return the text of the segment's card."""
        yield self.keyword


@dataclass(frozen=True)
class PrintOption(Segment, keyword="PRIN"):
    """PRIN or NOPR: printing of the data that follow."""

    on: bool

    OFF: ClassVar[str] = "NOPR"

    @classmethod
    def read(cls, head: Card, cards: CardStream) -> Self:
        """Read the keyword card, the only card of the segment."""
        return cls(head.keyword == cls.keyword, source=CardSource(head))

    def cards(self, control: Control) -> Iterator[str]:
        """Return the text of the segment's card."""
        yield self.keyword if self.on else self.OFF


@dataclass(frozen=True)
class Page(Segment, keyword="PAGE"):
    """PAGE: the printer's carriage control at the head of each page, on a separate card."""

    carriage_control: str

    is_worded: ClassVar[bool] = True
    fields: ClassVar[Fields] = layout("A4 carriage control")

    @classmethod
    def read(cls, head: Card, cards: CardStream) -> Self:
        """Read the card's first four columns."""
        card = cards.take()
        return cls("" if card is None else card.data[:4].rstrip(), source=CardSource(head))
