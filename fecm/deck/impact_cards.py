"""Cards of the impact: its point and velocity, contact law, projectile and contact patch."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import ClassVar, Self

from fecm.deck.card import Card, Control, Fields, Record, layout
from fecm.deck.segment import CardStream, Segment


@dataclass(frozen=True)
class Impact(Segment, keyword="ROD"):
    """ROD: (2I5,F10.0); impact point and velocity."""

    node: int  # impact node
    dof: int  # its dof in the direction of impact, from 1 (3 is w)
    velocity: float  # approach velocity, length/time

    fields: ClassVar[Fields] = layout(
        "I5 impact node|node", "I5 impact dof|dof", "F10 impact velocity|velocity"
    )


@dataclass(frozen=True)
class Indentation(Segment, keyword="EXPE"):
    """EXPE: (4F10.0); the measured indentation law, equations 3-1, 3-3 and 3-8.

    With the second word ACR the permanent indentation follows equation 3-7 instead of 3-8.
    """

    k: float  # contact coefficient, force/length^1.5
    # Critical indentation (length): beyond it an indentation remains. It is alpha_cr with ACR.
    alpha_p: float
    s_p: float  # slope of the permanent over the maximum indentation; 0 with ACR
    q: float  # power of the unloading curve; with ACR 5/2, or 0, which means the same
    word: str = ""  # the keyword card's second word: ``""`` for equation 3-8, ``"ACR"`` for 3-7

    ACR: ClassVar[str] = "ACR"
    fields: ClassVar[Fields] = layout(
        "F10 contact coefficient k|k",
        "F10 critical indentation alpha_p|alpha_p",
        "F10 constant s_p|s_p",
        "F10 unloading power q|q",
    )
    # Fields by the second word.
    fields_of: ClassVar[dict[str, Fields]] = {
        "": fields,
        ACR: layout(
            "F10 contact coefficient k|k",
            "F10 critical indentation alpha_cr|alpha_cr",
            "F10 constant s_p|(none)",
            "F10 unloading power q|q",
        ),
    }

    @classmethod
    def read(cls, head: Card, cards: CardStream) -> Self | None:
        """Read the constants of the law that the keyword card names."""
        word = " ".join(head.words[1:]).upper()
        if word not in cls.fields_of:
            message = f"`{word}` after EXPE is not read: the law is equation 3-8."
            hint = "EXPE ACR takes the law of equation 3-7"
            cards.findings.add("W416", message, head.place, hint)
            word = ""
        law = cards.single(head, cls, cls.fields_of[word])
        return law and replace(law, word=word)

    def values(self) -> tuple[float, float, float, float]:
        """Return the values in the card's order."""
        return self.k, self.alpha_p, self.s_p, self.q

    def names(self) -> list[str]:
        """Return the names of the values."""
        return [field.name for field in self.fields_of[self.word]]

    def text(self) -> str:
        """Return the text of the keyword card and of the card of data."""
        return f"{f'EXPE {self.word}'.rstrip()}\n{self.to_card()}"

    def cards(self, control: Control) -> Iterator[str]:
        """Return the text of the segment's cards."""
        yield from self.text().split("\n")


@dataclass(frozen=True)
class RodDiameter(Record):
    """PROJ card: (2I5,F10.0); diameter of an element (length), and the step between elements."""

    element: int
    increment: int
    diameter: float

    fields: ClassVar[Fields] = layout("I5 element|elm", "I5 increment|incr", "F10 diameter")


@dataclass(frozen=True)
class Projectile(Segment, keyword="PROJ"):
    """PROJ: (2I5,3F10.0) and, for a rod, its diameters; the projectile (not in the report)."""

    elements: int  # number of the rod's elements; 0 for a rigid mass
    # Node of the rod where the force is measured: 1 is the impacted end, 0 stands for the middle.
    transducer: int
    size: float  # length of the rod, or mass of a rigid projectile
    # Young's modulus, and mass per volume, of a rod.
    modulus: float = 0.0
    density: float = 0.0
    # From the impacted end on. Diameters between two cards are interpolated.
    diameters: tuple[RodDiameter, ...] = ()

    optional: ClassVar[int] = 2
    fields: ClassVar[Fields] = layout(
        "I5 number of rod elements|elms",
        "I5 transducer node|node",
        "F10 length or mass|len/mass",
        "F10 rod's Young's modulus|modulus",
        "F10 rod's density|density",
    )

    def positive_values(self) -> Iterator[tuple[str, float, str]]:
        """Yield what must be positive: its name, its value, and its field on the card."""
        if not self.elements:
            yield "projectile's mass", self.size, "length or mass"
            return
        yield "projectile's length", self.size, "length or mass"
        yield "rod's modulus", self.modulus, "rod's Young's modulus"
        yield "rod's density", self.density, "rod's density"

    @classmethod
    def read(cls, head: Card, cards: CardStream) -> Self | None:
        """Read the first card and the diameters of a rod."""
        projectile = cards.single(head, cls)
        if projectile is None or not projectile.elements:
            return projectile
        return replace(projectile, diameters=cards.until_blank(head, RodDiameter))

    def cards(self, control: Control) -> Iterator[str]:
        """Return the text of the segment's cards."""
        yield from super().cards(control)
        if self.elements:
            for record in self.diameters:
                yield record.to_card()
            yield ""


@dataclass(frozen=True)
class Patch(Segment, keyword="PATC"):
    """PATC: (A4,6X,4F10.0); the contact force acts on a circle (not in the report's program)."""

    shape: str = "DISC"  # ``"DISC"``, a uniform pressure, or ``"HERT"``, Hertz's
    # Length. None is :data:`~fecm.mechanics.points.RADIUS_PER_THICKNESS` times the thickness.
    radius: float | None = None
    # Centre, length. None is the node of ROD.
    x: float | None = None
    y: float | None = None
    load: float = 0.0  # static force on the patch, scaled by PROP

    is_worded: ClassVar[bool] = True
    optional: ClassVar[int] = 4
    fields: ClassVar[Fields] = layout(
        "A4 shape",
        "X6",
        "F10? radius c|c",
        "F10? centre x0|x0",
        "F10? centre y0|y0",
        "F10 static load|load",
    )

    def centred(self, point: tuple[float, float]) -> Self:
        """Return the patch around a point unless it has a centre; for decks without ROD."""
        return self if self.x is not None else replace(self, x=point[0], y=point[1])

    @classmethod
    def read(cls, head: Card, cards: CardStream) -> Self | None:
        """Read the card, which starts with a word other than the keyword of another segment."""
        card = cards.peek()
        if card is not None and not cards.begins_segment(card):
            cards.take()
            patch = cards.record(card, cls)
            return patch and replace(patch, shape=patch.shape.upper())
        message = "A card of PATC is missing."
        hint = "a blank card takes a disc of 0.327 times the thickness at the node of ROD"
        cards.findings.add("E008", message, (card or head).place, hint)
        return None
