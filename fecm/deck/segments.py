"""Readers of the segments between the control card and END, each of one keyword."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

from fecm.deck.card import Card, Fields, Source, Value, read_values
from fecm.deck.findings import Findings
from fecm.deck.model import (
    Boundary,
    Coordinates,
    Elements,
    Forces,
    Gages,
    Impact,
    Indentation,
    Material,
    Page,
    PrintOption,
    Projectile,
    Segment,
    ShearCorrection,
    Units,
)
from fecm.deck.records import (
    Control,
    ElementNodes,
    Gage,
    Integration,
    Layer,
    NodeCodes,
    NodeValues,
    Ply,
    Record,
    RodDiameter,
    code_fields,
    element_fields,
    force_fields,
    node_fields,
)


class Stream:
    """Cards in the order of the file, without the lines that are comments.

    Parameters
    ----------
    text : str
        The whole file.
    blanks_are_zeros : bool
        Read blanks inside numbers as the zeros that they were on the report's machine.
    keeps_values : bool
        Keep the fields and values of every card in `read`.

    Attributes
    ----------
    findings : Findings
        Receives the errors.
    lines : list of str
        The file's lines.
    position : int
        Number of lines taken.
    read : dict
        By line number, the fields and values of every card that was read, if they are kept.
    """

    def __init__(
        self, text: str, *, blanks_are_zeros: bool = False, keeps_values: bool = False
    ) -> None:
        self.lines = text.removeprefix("\ufeff").splitlines()
        self._blanks_are_zeros = blanks_are_zeros
        self._keeps_values = keeps_values
        self.position = 0
        self.findings = Findings()
        self.read: dict[int, tuple[Fields, list[Value]]] = {}

    @property
    def at_end(self) -> bool:
        """Whether every card was taken."""
        rest = range(self.position, len(self.lines))
        return all(_is_comment(self.lines[number]) for number in rest)

    @property
    def last(self) -> Card | None:
        """The last card of the file; None of an empty one."""
        for number in range(len(self.lines), 0, -1):
            if not _is_comment(self.lines[number - 1]):
                return Card(number, self.lines[number - 1])
        return None

    def take(self) -> Card | None:
        """The next card; None at the end of the file or when findings are closed."""
        while self.position < len(self.lines) and not self.findings.closed:
            self.position += 1
            line = self.lines[self.position - 1]
            if not _is_comment(line):
                return Card(self.position, line)
        return None

    def take_filled(self) -> Card | None:
        """The next card that is not blank, or None as in :meth:`take`."""
        while self.position < len(self.lines) and not self.lines[self.position].strip():
            self.position += 1
        while (card := self.take()) is not None and card.is_blank:
            pass
        return card

    def give_back(self) -> None:
        """Return the last card to the stream."""
        self.position -= 1

    def text_since(self, position: int) -> str:
        """Text of the cards taken since a position."""
        taken = self.lines[position : self.position]
        return "\n".join(line.rstrip() for line in taken if not _is_comment(line))

    def skip_data(self) -> None:
        """Skip cards up to the next keyword."""
        while (card := self.take()) is not None:
            if card.is_keyword:
                self.give_back()
                return

    def values(self, card: Card, fields: Fields) -> list[Value] | None:
        """Values of a card; None after an error, which is reported."""
        values = read_values(card, fields, self.findings, blanks_are_zeros=self._blanks_are_zeros)
        if values is not None and self._keeps_values:
            self.read[card.line] = (fields, values)
        return values

    def row(self, card: Card, fields: Fields) -> tuple[list[Value], Source] | None:
        """Values of a card and their source; None after an error."""
        values = self.values(card, fields)
        return None if values is None else (values, Source(card, fields))


def _is_comment(line: str) -> bool:
    """Whether a line is a comment."""
    return line.startswith("!")


Row = tuple[list[Value], Source]
_R = TypeVar("_R", bound=Record)


class SegmentReader:
    """Reads segments of one problem.

    Parameters
    ----------
    stream : Stream
        The deck's cards.
    control : Control
        Counts of the problem.

    Attributes
    ----------
    unsound : set of str
        Keywords of segments of which a card could not be read.
    """

    def __init__(self, stream: Stream, control: Control) -> None:
        self._stream = stream
        self._control = control
        self.unsound: set[str] = set()

    def read(self, head: Card) -> Segment | None:
        """Read the segment of a keyword card; None after an error."""
        segment = READERS[head.keyword](self, head)
        if segment is None:
            self.unsound.add(head.keyword)
        return segment

    # Numbered cards up to a blank one ------------------------------------------------------------

    def _records(self, head: Card, kind: type[_R], fields: Fields) -> tuple[_R, ...]:
        """Records of numbered cards up to the final blank card."""
        records: list[_R] = []
        while (card := self._stream.take()) is not None:
            if card.is_blank:
                return tuple(records)
            if card.is_keyword:
                self._stream.give_back()
                self._not_ended(head, card)
                return tuple(records)
            row = self._stream.row(card, fields)
            if row is None:
                self.unsound.add(head.keyword)
            else:
                records.append(kind.from_row(*row))
        self._not_ended(head, head)
        return tuple(records)

    def _not_ended(self, head: Card, at: Card) -> None:
        self._stream.findings.add(
            "E007",
            f"The {head.keyword} cards are not ended by a blank card.",
            at.place,
            "put a blank card before this one" if at is not head else "put a blank card at the end",
        )

    def _coordinates(self, head: Card) -> Segment:
        records = self._records(head, NodeValues, node_fields(self._control.ndm))
        return Coordinates(records, source=Source(head, ()))

    def _forces(self, head: Card) -> Segment:
        records = self._records(head, NodeValues, force_fields(self._control.ndf))
        return Forces(records, source=Source(head, ()))

    def _boundary(self, head: Card) -> Segment:
        records = self._records(head, NodeCodes, code_fields(self._control.ndf))
        return Boundary(records, source=Source(head, ()))

    def _elements(self, head: Card) -> Segment:
        """Read ELEM cards up to a blank card, or to the last element's card without one."""
        fields = element_fields(self._control.nen)
        records: list[ElementNodes] = []
        while (card := self._stream.take()) is not None and not card.is_blank:
            if card.is_keyword:
                self._stream.give_back()
                if not records or records[-1].element < self._control.numel:
                    self._not_ended(head, card)
                break
            row = self._stream.row(card, fields)
            if row is None:
                self.unsound.add("ELEM")
            else:
                records.append(ElementNodes.from_row(*row))
        return Elements(tuple(records), source=Source(head, ()))

    # Cards of a fixed number ---------------------------------------------------------------------

    def _single(self, head: Card, fields: Fields, what: str) -> Row | None:
        """A mandatory card; None if it is missing or unreadable."""
        card = self._stream.take()
        if card is None or card.is_keyword:
            if card is not None:
                self._stream.give_back()
            if head.keyword not in self.unsound:
                self._stream.findings.add("E008", f"{what} is missing.", (card or head).place)
            self.unsound.add(head.keyword)
            return None
        row = self._stream.row(card, fields)
        if row is None:
            self.unsound.add(head.keyword)
        return row

    def _impact(self, head: Card) -> Segment | None:
        row = self._single(head, Impact.fields, "The card of the impact")
        return None if row is None else Impact.from_row(*row)

    def _indentation(self, head: Card) -> Segment | None:
        word = " ".join(head.data.replace(",", " ").split()[1:]).upper()
        if word and word != Indentation.ACR:
            self._stream.findings.add(
                "W416",
                f"`{word}` behind EXPE is not read: the law is that of equation 3-8.",
                head.place,
                "EXPE ACR takes the law of equation 3-7",
            )
            word = ""
        fields = Indentation.acr_fields if word else Indentation.fields
        row = self._single(head, fields, "The card of the indentation law")
        return None if row is None else replace(Indentation.from_row(*row), word=word)

    def _projectile(self, head: Card) -> Segment | None:
        row = self._single(head, Projectile.fields, "The first card of PROJ")
        if row is None:
            return None
        projectile = Projectile.from_row(*row)
        if not projectile.elements:
            return projectile
        diameters = self._records(head, RodDiameter, RodDiameter.fields)
        return replace(projectile, diameters=diameters)

    def _shear_correction(self, head: Card) -> Segment | None:
        row = self._single(head, ShearCorrection.fields, "The card of the shear correction factor")
        return None if row is None else ShearCorrection.from_row(*row)

    def _gages(self, head: Card) -> Segment:
        return Gages(self._records(head, Gage, Gage.fields), source=Source(head, ()))

    def _units(self, head: Card) -> Segment | None:
        card = self._stream.take()
        names = [] if card is None else card.data.replace(",", " ").split()
        if card is not None and len(names) == len(Units.NAMES):
            return Units(*names, source=Source(card, ()))
        if card is not None and card.keyword in (*READERS, "END"):
            self._stream.give_back()
        self._stream.findings.add(
            "E010",
            "UNIT takes one card with three names: the units of length, force and time.",
            (card or head).place,
            "for example: in lbf s",
        )
        return None

    def _print_option(self, head: Card) -> Segment:
        return PrintOption(head.keyword == "PRIN", source=Source(head, ()))

    def _page(self, head: Card) -> Segment:
        card = self._stream.take()
        return Page("" if card is None else card.data[:4].rstrip(), source=Source(head, ()))

    def _material(self, head: Card) -> Segment | None:
        rule = self._single(head, Integration.fields, "The first card of MATE")
        ply = self._single(head, Ply.fields, "The card of the ply's constants")
        layers = self._layers(head) if rule or ply else None
        if rule is None or ply is None or layers is None:
            return None
        integration, constants = Integration.from_row(*rule), Ply.from_row(*ply)
        return Material(integration, constants, layers, source=Source(head, ()))

    def _layers(self, head: Card) -> tuple[Layer, ...] | None:
        """Layer cards, as many as the control card says; None if one is missing or unreadable."""
        count = self._control.layers
        layers: list[Layer] = []
        for number in range(count):
            card = self._stream.take()
            if card is None or card.is_keyword or card.is_blank:
                if card is not None:
                    self._stream.give_back()
                self._stream.findings.add(
                    "E202",
                    f"MATE has {number} layer cards where the control card says {count}.",
                    (card or head).place,
                )
                return None
            row = self._stream.row(card, Layer.fields)
            if row is not None:
                layers.append(Layer.from_row(*row))
        return tuple(layers) if len(layers) == count else None


# Readers of the segments, by keyword.
READERS: dict[str, Callable[[SegmentReader, Card], Segment | None]] = {
    "COOR": SegmentReader._coordinates,
    "ELEM": SegmentReader._elements,
    "BOUN": SegmentReader._boundary,
    "MATE": SegmentReader._material,
    "ROD": SegmentReader._impact,
    "EXPE": SegmentReader._indentation,
    "FORC": SegmentReader._forces,
    "PROJ": SegmentReader._projectile,
    "SHEA": SegmentReader._shear_correction,
    "GAGE": SegmentReader._gages,
    "UNIT": SegmentReader._units,
    "PRIN": SegmentReader._print_option,
    "NOPR": SegmentReader._print_option,
    "PAGE": SegmentReader._page,
}
