"""Records: the values of one card as a plain typed object, which compares without the card."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import field
from typing import Any, ClassVar, Self

from fecm._dataclasses import frozen
from fecm.deck.card import BLANK, Fields, Source, Value, layout, write_card
from fecm.deck.findings import Place


@frozen
class Record:
    """Values of one card, as attributes in the card's order."""

    # The card; None for a record built in Python.
    source: Source | None = field(default=None, compare=False, repr=False, kw_only=True)
    fields: ClassVar[Fields]
    packed: ClassVar[slice | None] = None  # values of the card that one attribute holds as a tuple
    optional: ClassVar[int] = 0  # number of last values that are not written where they are 0

    @classmethod
    def from_row(cls, values: Sequence[Value], source: Source | None) -> Self:
        """Build the record from a card's values; a blank takes the attribute's default."""
        arguments: list[Any] = list(values)  # of the types of the class's attributes
        if cls.packed is not None:
            arguments[cls.packed] = [tuple(arguments[cls.packed])]
        if BLANK not in arguments:
            return cls(*arguments, source=source)
        names = (attribute.name for attribute in dataclasses.fields(cls)[1:])
        given = {n: value for n, value in zip(names, arguments, strict=False) if value != BLANK}
        return cls(**given, source=source)

    def row(self) -> list[Value]:
        """Values in the card's order; a blank for an attribute that is None."""
        row: list[Value] = []
        for attribute in dataclasses.fields(self)[1:]:  # the first is the source
            value = getattr(self, attribute.name)
            if isinstance(value, tuple):
                row.extend(value)
            else:
                row.append(BLANK if value is None else value)
        return row

    def to_card(self, fields: Fields | None = None) -> str:
        """Text of the card; `fields` where they depend on the control card."""
        written = fields or self.fields
        values = self.row()[: len(written)]
        least = len(written) - self.optional
        while len(values) > least and not values[-1]:
            values.pop()
        return write_card(written[: len(values)], values)

    def place(self, name: str = "") -> Place | None:
        """Place of the field `name` in the deck, or of the entire card without a name."""
        return self.source.place(name) if self.source else None


@frozen
class Control(Record):
    """Control card: 6I5."""

    # Numbers of nodes, elements and layers.
    numnp: int
    numel: int
    layers: int
    # Spatial dimensions, dofs per node, largest number of nodes per element.
    ndm: int
    ndf: int
    nen: int

    fields: ClassVar[Fields] = layout(
        "I5 NUMNP", "I5 NUMEL", "I5 LAYER", "I5 NDM", "I5 NDF", "I5 NEN"
    )
