"""Cards of springs, one-sided supports and masses at nodes (not in the report's program).

With the second word LINE the values of a segment belong to straight lines of element sides, from a
first to a last node: they are stiffnesses per length.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar, Generic, Self, TypeVar, cast

from fecm.deck.card import Card, CardSource, Control, Fields, Record, layout
from fecm.deck.mesh_cards import DOF_NAMES, NODE, NodeValues
from fecm.deck.segment import CardStream, NumberedSegment
from fecm.deck.table import CardTable

LINE = "LINE"
ENDS = ("I5 first node|from", "I5 last node|to")  # first fields of a card of a line


@dataclass(frozen=True)
class OneSidedSupport(Record):
    """UNIL card: support that pushes the plate at a node, or along a line.

    For a line `node` is its first node and `increment` its last one.
    """

    node: int
    increment: int
    side: int = 1  # 1, also for 0: under the plate; -1: on the struck face
    stiffness: float = 0.0  # force/length, or per length along a line; 0: the default stiffness
    gap: float = 0.0  # length


_R = TypeVar("_R", bound=Record)


@dataclass(frozen=True)
class _NodesOrLines(NumberedSegment[_R], Generic[_R], keyword="", record=NodeValues):
    """Segment of values at nodes, or with the word LINE along lines."""

    word: str = ""  # second word of the keyword card: ``""`` or ``"LINE"``

    columns: ClassVar[tuple[str, ...]] = ()  # fields of the values

    @property
    def is_of_lines(self) -> bool:
        """Whether the cards are about lines."""
        return self.word == LINE

    @classmethod
    def fields_of(cls, word: str) -> Fields:
        """Return the fields of a card."""
        return layout(*(ENDS if word == LINE else NODE), *cls.columns)

    @classmethod
    def read(cls, head: Card, cards: CardStream) -> Self | None:
        """Read the cards up to a blank card; report and leave out unreadable cards."""
        word = " ".join(head.words[1:]).upper()
        if word not in ("", LINE):
            message = f"`{word}` after {head.keyword} is not read."
            hint = f"{head.keyword} LINE takes lines of element sides, from node to node"
            cards.findings.add("E570", message, head.place, hint)
        records = cards.table(head, cls.record, cls.fields_of(word), lambda _: False)
        return cls(cast("CardTable[_R]", records), word=word, source=CardSource(head))

    def cards(self, control: Control) -> Iterator[str]:
        """Return the text of the segment's cards."""
        fields = self.fields_of(self.word)
        yield f"{self.keyword} {self.word}".rstrip()
        for record in self.records:
            yield record.to_card(fields)
        yield ""


@dataclass(frozen=True)
class Springs(_NodesOrLines[NodeValues], keyword="SPRI", record=NodeValues):
    """SPRI: (2I5,5F10.0); stiffness of springs to ground of the dofs of nodes, or along lines."""

    columns: ClassVar[tuple[str, ...]] = tuple(
        f"F10 stiffness {name}|k {name}" for name in DOF_NAMES
    )


@dataclass(frozen=True)
class OneSidedSupports(_NodesOrLines[OneSidedSupport], keyword="UNIL", record=OneSidedSupport):
    """UNIL: (3I5,5X,2F10.0); supports of w that only push, at nodes or along lines."""

    is_nonlinear: ClassVar[bool] = True
    columns: ClassVar[tuple[str, ...]] = ("I5 side", "X5", "F10 stiffness", "F10 gap")


@dataclass(frozen=True)
class PointMasses(NumberedSegment[NodeValues], keyword="MASS", record=NodeValues):
    """MASS: (2I5,2F10.0); masses at nodes, and their rotary inertias."""

    @classmethod
    def card_fields(cls, control: Control) -> Fields:
        """Return the fields of a card."""
        return layout(*NODE, "F10 mass", "F10 rotary inertia|inertia")
