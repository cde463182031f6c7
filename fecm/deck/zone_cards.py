"""Cards of plates of several materials and laminates (not in the report's program)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar, NamedTuple, Self

from fecm.deck.card import Card, CardSource, Control, Fields, Record, layout
from fecm.deck.material_cards import Layer, Ply, read_layers
from fecm.deck.segment import CardStream, NumberedSegment, Segment


@dataclass(frozen=True)
class MaterialNumber(Record):
    """First card of a material of MATS: (I5)."""

    number: int

    fields: ClassVar[Fields] = layout("I5 material|mat")


class NumberedPly(NamedTuple):
    """A material of MATS."""

    head: MaterialNumber
    ply: Ply

    @property
    def number(self) -> int:
        """Number of the material."""
        return self.head.number


@dataclass(frozen=True)
class Materials(Segment, keyword="MATS"):
    """MATS: further materials after MATE, a pair of cards each: (I5) and (7F10.0)."""

    plies: tuple[NumberedPly, ...]

    @classmethod
    def read(cls, head: Card, cards: CardStream) -> Self | None:
        """Read the pairs of cards up to a blank card."""
        plies: list[NumberedPly] = []
        while (card := cards.take_data()) is not None and not card.is_blank:
            number = cards.record(card, MaterialNumber)
            ply = cards.single(head, Ply)
            if number is None or ply is None:
                cards.unsound.add(head.keyword)
            else:
                plies.append(NumberedPly(number, ply))
        cards.end(head, card)
        return cls(tuple(plies), source=CardSource(head))

    def cards(self, control: Control) -> Iterator[str]:
        """Return the text of the segment's cards."""
        yield self.keyword
        for item in self.plies:
            yield item.head.to_card()
            yield item.ply.to_card()
        yield ""


@dataclass(frozen=True)
class LaminateNumber(Record):
    """First card of a laminate of LAMS: (2I5)."""

    number: int
    layers: int  # number of its layer cards

    fields: ClassVar[Fields] = layout("I5 laminate|lam", "I5 layers|lays")


class NumberedLaminate(NamedTuple):
    """A laminate of LAMS, the first layer at z = -h/2."""

    head: LaminateNumber
    layers: tuple[Layer, ...]

    @property
    def number(self) -> int:
        """Number of the laminate."""
        return self.head.number


@dataclass(frozen=True)
class Laminates(Segment, keyword="LAMS"):
    """LAMS: further laminates after MATE, each with (2I5) and its layer cards."""

    laminates: tuple[NumberedLaminate, ...]

    @classmethod
    def read(cls, head: Card, cards: CardStream) -> Self | None:
        """Read the laminates up to a blank card."""
        laminates: list[NumberedLaminate] = []
        while (card := cards.take_data()) is not None and not card.is_blank:
            if laminates and _is_layer(card):
                last = laminates[-1]
                limit = f"the {last.head.layers} of laminate {last.number}"
                message = f"{head.keyword} has more layer cards than {limit}."
                cards.findings.add("E202", message, card.place)
                cards.unsound.add(head.keyword)
                cards.skip_data()
                return None
            number = cards.record(card, LaminateNumber)
            layers = None
            if number is not None and number.layers < 1:
                message = f"Laminate {number.number} has {number.layers} layers."
                cards.findings.add("E202", message, number.place("layers"))
            elif number is not None:
                layers = read_layers(head, cards, number.layers, f"laminate {number.number} says")
            if number is None or layers is None:
                cards.unsound.add(head.keyword)
                cards.skip_data()  # nothing shows where the next laminate begins
                return None
            laminates.append(NumberedLaminate(number, layers))
        cards.end(head, card)
        return cls(tuple(laminates), source=CardSource(head))

    def cards(self, control: Control) -> Iterator[str]:
        """Return the text of the segment's cards."""
        yield self.keyword
        for item in self.laminates:
            yield item.head.to_card()
            for layer in item.layers:
                yield layer.to_card()
        yield ""


def _is_layer(card: Card) -> bool:
    """Return whether a card looks like a layer card instead of the first card of a laminate."""
    texts = [text.strip() for _, text in card.cut(Layer.fields)]
    return len(texts) > 2 and bool(texts[2]) and not texts[1].isdigit()


@dataclass(frozen=True)
class Zone(Record):
    """ZONE card: (4I5); elements and their laminate."""

    first: int
    last: int  # 0 means `first`
    step: int  # 0 means 1
    laminate: int

    fields: ClassVar[Fields] = layout(
        "I5 first element|from", "I5 last element|to", "I5 step|step", "I5 laminate|lam"
    )

    @property
    def elements(self) -> range:
        """Numbers of the elements."""
        return range(self.first, max(self.last, self.first) + 1, self.step or 1)


@dataclass(frozen=True)
class Zones(NumberedSegment[Zone], keyword="ZONE", record=Zone):
    """ZONE: laminates of elements; elements without a zone have the laminate of MATE."""
