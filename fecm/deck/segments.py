"""Readers of the segments between the control card and END, each of one keyword."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

from fecm.deck import model
from fecm.deck.card import Card, Fields, Source, Value, read_values
from fecm.deck.findings import Findings
from fecm.deck.records import Control, ElementNodes, Integration, Layer, Ply, Record, RodDiameter

_R = TypeVar("_R", bound=Record)


class Stream:
    """Cards in the order of the file, without the lines that are comments.

    With `blanks_are_zeros` blanks inside numbers are read as the zeros that they were on the
    report's machine; `keeps_values` keeps the fields and values of every card in `read`.
    """

    def __init__(
        self, text: str, *, blanks_are_zeros: bool = False, keeps_values: bool = False
    ) -> None:
        self.lines = text.removeprefix("\ufeff").splitlines()
        numbered = enumerate(self.lines, start=1)
        self._cards = [(n, line) for n, line in numbered if not line.startswith("!")]
        self._blanks_are_zeros = blanks_are_zeros
        self._keeps_values = keeps_values
        self.position = 0  # number of cards taken
        self.findings = Findings()
        self.read: dict[int, tuple[Fields, list[Value]]] = {}  # by line number

    @property
    def at_end(self) -> bool:
        """Whether every card was taken."""
        return self.position == len(self._cards)

    @property
    def last(self) -> Card | None:
        """The last card of the file; None if it is empty."""
        return Card(*self._cards[-1]) if self._cards else None

    def take(self) -> Card | None:
        """The next card; None at the end of the file or when findings are closed."""
        if self.at_end or self.findings.closed:
            return None
        self.position += 1
        return Card(*self._cards[self.position - 1])

    def take_filled(self) -> Card | None:
        """The next card that is not blank, or None as in :meth:`take`."""
        while not self.at_end and not self._cards[self.position][1].strip():
            self.position += 1
        while (card := self.take()) is not None and card.is_blank:
            pass
        return card

    def give_back(self) -> None:
        """Return the last card to the stream."""
        self.position -= 1

    def peek(self) -> Card | None:
        """The next card as :meth:`take` gives it, which stays in the stream."""
        if (card := self.take()) is not None:
            self.give_back()
        return card

    def take_data(self) -> Card | None:
        """The next card; None where that is a keyword card, which stays, or as in :meth:`take`."""
        card = self.take()
        if card is None or not card.is_keyword:
            return card
        self.give_back()
        return None

    def text_since(self, position: int) -> str:
        """Text of the cards taken since a position."""
        return "\n".join(line.rstrip() for _, line in self._cards[position : self.position])

    def skip_data(self) -> None:
        """Skip cards up to the next keyword."""
        while self.take_data() is not None:
            pass

    def row(self, card: Card, fields: Fields) -> tuple[list[Value], Source] | None:
        """Values of a card and their source; None after an error, which is reported."""
        values = read_values(card, fields, self.findings, blanks_are_zeros=self._blanks_are_zeros)
        if values is None:
            return None
        if self._keeps_values:
            self.read[card.line] = (fields, values)
        return values, Source(card, fields)

    def record(self, card: Card, kind: type[_R], fields: Fields | None = None) -> _R | None:
        """Record of a card; None after an error, which is reported."""
        row = self.row(card, fields or kind.fields)
        return None if row is None else kind.from_row(*row)


class SegmentReader:
    """Reads segments of one problem."""

    def __init__(self, stream: Stream, control: Control) -> None:
        self._stream = stream
        self._control = control
        self.unsound: set[str] = set()  # keywords of segments with unreadable cards

    def read(self, head: Card) -> model.Segment | None:
        """Read the segment of a keyword card; None after an error."""
        segment = READERS[head.keyword](self, head)
        if segment is None:
            self.unsound.add(head.keyword)
        return segment

    # Numbered cards up to a blank one ------------------------------------------------------------

    def _records(self, head: Card, kind: type[_R], fields: Fields) -> tuple[_R, ...]:
        """Records of numbered cards up to a blank card, or up to the last element's card."""
        records: list[_R] = []
        while (card := self._stream.take_data()) is not None and not card.is_blank:
            if (record := self._stream.record(card, kind, fields)) is None:
                self.unsound.add(head.keyword)
            else:
                records.append(record)
        last = records[-1] if records else None
        complete = isinstance(last, ElementNodes) and last.element >= self._control.numel
        if card is None and not complete:
            following = self._stream.peek()
            message = f"The {head.keyword} cards are not ended by a blank card."
            hint = f"put a blank card {'before this one' if following else 'at the end'}"
            self._stream.findings.add("E007", message, (following or head).place, hint)
        return tuple(records)

    def _numbered(self, head: Card) -> model.Segment:
        kind = NUMBERED[head.keyword]
        records = self._records(head, kind.record, kind.card_fields(self._control))
        return kind(records, source=Source(head, ()))

    # Cards of a fixed number ---------------------------------------------------------------------

    def _single(self, head: Card, kind: type[_R], fields: Fields | None = None) -> _R | None:
        """Record of a mandatory card; None if it is missing or unreadable."""
        card = self._stream.take_data()
        if card is None and head.keyword not in self.unsound:
            message = f"A card of {head.keyword} is missing."
            hint = f"its fields are {', '.join(field.name for field in fields or kind.fields)}"
            self._stream.findings.add("E008", message, (self._stream.peek() or head).place, hint)
        record = None if card is None else self._stream.record(card, kind, fields)
        if record is None:
            self.unsound.add(head.keyword)
        return record

    def _patch(self, head: Card) -> model.Segment | None:
        # The card begins with a word, but not with that of another segment.
        card = self._stream.peek()
        if card is not None and card.keyword not in (*READERS, "END"):
            self._stream.take()
            return self._stream.record(card, model.Patch)
        message = "A card of PATC is missing."
        hint = "a blank card takes a disc of 0.327 times the thickness at the node of ROD"
        self._stream.findings.add("E008", message, (card or head).place, hint)
        return None

    def _allowables(self, head: Card) -> model.Segment | None:
        strengths = self._single(head, model.Allowables)
        card = self._stream.take_data()
        row = None if card is None else self._stream.row(card, model.Allowables.constants)
        if strengths is None or (card is not None and row is None):
            return None
        return strengths if row is None else strengths.with_constants(row[0])

    def _shear(self, head: Card) -> model.Segment | None:
        words = head.data.replace(",", " ").upper().split()[1:]
        for word in words:
            if word not in model.Shear.WORDS:
                message = f"`{word}` after SHEA is unknown."
                hint = "SHEA takes MITC (assumed strains) and EQUI (stiffness from equilibrium)"
                self._stream.findings.add("E446", message, head.place, hint)
        assumed, equilibrium = (word in words for word in model.Shear.WORDS)
        following = self._stream.peek()
        if words and (following is None or following.is_keyword or following.is_blank):
            return model.Shear(1.0, assumed, equilibrium, source=Source(head, ()))
        found = self._single(head, model.Shear)
        return found and replace(found, assumed=assumed, equilibrium=equilibrium)

    def _indentation(self, head: Card) -> model.Segment | None:
        word = " ".join(head.data.replace(",", " ").split()[1:]).upper()
        if word and word != model.Indentation.ACR:
            message = f"`{word}` after EXPE is not read: the law is that of equation 3-8."
            hint = "EXPE ACR takes the law of equation 3-7"
            self._stream.findings.add("W416", message, head.place, hint)
            word = ""
        law = self._single(head, model.Indentation, model.Indentation.acr_fields if word else None)
        return law and replace(law, word=word)

    def _projectile(self, head: Card) -> model.Segment | None:
        projectile = self._single(head, model.Projectile)
        if projectile is None or not projectile.elements:
            return projectile
        diameters = self._records(head, RodDiameter, RodDiameter.fields)
        return replace(projectile, diameters=diameters)

    def _units(self, head: Card) -> model.Segment | None:
        card = self._stream.take()
        names = [] if card is None else card.data.replace(",", " ").split()
        if card is not None and len(names) == len(model.Units.NAMES):
            return model.Units(*names, source=Source(card, ()))
        if card is not None and card.keyword in (*READERS, "END"):
            self._stream.give_back()
        message = "UNIT takes one card with three names: the units of length, force and time."
        self._stream.findings.add("E010", message, (card or head).place, "for example: in lbf s")
        return None

    def _print_option(self, head: Card) -> model.Segment:
        return model.PrintOption(head.keyword == "PRIN", source=Source(head, ()))

    def _page(self, head: Card) -> model.Segment:
        card = self._stream.take()
        return model.Page("" if card is None else card.data[:4].rstrip(), source=Source(head, ()))

    def _material(self, head: Card) -> model.Segment | None:
        integration, ply = self._single(head, Integration), self._single(head, Ply)
        layers = self._layers(head) if integration or ply else None
        if integration is None or ply is None or layers is None:
            return None
        return model.Material(integration, ply, layers, source=Source(head, ()))

    def _layers(self, head: Card) -> tuple[Layer, ...] | None:
        """Layer cards, as many as the control card says; None if one is missing or unreadable."""
        count = self._control.layers
        layers: list[Layer] = []
        for number in range(count):
            card = self._stream.take_data()
            if card is None or card.is_blank:
                message = f"MATE has {number} layer cards where the control card says {count}."
                place = (card or self._stream.peek() or head).place
                self._stream.findings.add("E202", message, place)
                return None
            if (layer := self._stream.record(card, Layer)) is not None:
                layers.append(layer)
        return tuple(layers) if len(layers) == count else None


NUMBERED: dict[str, type[model.NumberedSegment]] = {
    kind.keyword: kind
    for kind in (model.Coordinates, model.Elements, model.Boundary, model.Forces, model.Gages)
}
# Readers of the segments, by keyword.
READERS: dict[str, Callable[[SegmentReader, Card], model.Segment | None]] = {
    "COOR": SegmentReader._numbered,
    "ELEM": SegmentReader._numbered,
    "BOUN": SegmentReader._numbered,
    "MATE": SegmentReader._material,
    "ROD": lambda reader, head: reader._single(head, model.Impact),
    "EXPE": SegmentReader._indentation,
    "FORC": SegmentReader._numbered,
    "PROJ": SegmentReader._projectile,
    "SHEA": SegmentReader._shear,
    "PATC": SegmentReader._patch,
    "ALLO": SegmentReader._allowables,
    "DELA": lambda reader, head: reader._single(head, model.Delamination),
    "DAMP": lambda reader, head: reader._single(head, model.Damping),
    "GAGE": SegmentReader._numbered,
    "UNIT": SegmentReader._units,
    "PRIN": SegmentReader._print_option,
    "NOPR": SegmentReader._print_option,
    "PAGE": SegmentReader._page,
}
