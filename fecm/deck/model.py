"""The model of a deck: plain typed objects without mechanics.

A :class:`Deck` is one problem of a file: its control card, its segments in the deck's order, its
macro program.  It keeps the values of the cards; :mod:`fecm.problem.generate` generates the nodes
and elements between them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import field
from itertools import compress
from textwrap import shorten
from typing import ClassVar, Generic, Self, TypeVar

from fecm._frozen import frozen
from fecm._tables import html_table
from fecm.deck import records
from fecm.deck.card import Fields, Source, Value, layout, write_card
from fecm.deck.records import Control, Record

TITLE = "FECM"
STOP = "STOP"
NODE = ("I5 node", "I5 increment|incr")  # first fields of a card of a node
_R = TypeVar("_R", bound=Record)
_S = TypeVar("_S", bound="Segment")


@frozen
class Segment(Record):
    """A keyword card and the data that follow it."""

    keyword: ClassVar[str]

    def __init_subclass__(cls, keyword: str = "") -> None:
        super().__init_subclass__()
        cls.keyword = keyword

    def cards(self, control: Control) -> Iterator[str]:
        """Text of the segment's cards: the keyword card and, by default, one card of data."""
        yield self.keyword
        yield self.to_card()


@frozen
class NumberedSegment(Segment, Generic[_R]):
    """A segment of any number of cards, ended by a blank one."""

    records: tuple[_R, ...]
    record: ClassVar[type[Record]]

    def __init_subclass__(cls, keyword: str, record: type[Record]) -> None:
        super().__init_subclass__(keyword)
        cls.record = record

    @classmethod
    def card_fields(cls, control: Control) -> Fields:
        """Fields of a card."""
        match cls.keyword:
            case "COOR":
                axes = records.AXES[: control.ndm]
                return layout(*NODE, *(f"F10 {axis}-coordinate|{axis}" for axis in axes))
            case "ELEM":
                nodes = (f"I5 node {i + 1}|n{i + 1}" for i in range(control.nen))
                return layout("I5 element|elm", *nodes, "I5 increment|incr")
            case "BOUN":
                return layout(*NODE, *(f"I5 code {i + 1}|c{i + 1}" for i in range(control.ndf)))
            case "FORC":
                return layout(*NODE, *(f"F10 value {i + 1}" for i in range(control.ndf)))
        return cls.record.fields

    def cards(self, control: Control) -> Iterator[str]:
        """Text of the segment's cards."""
        fields = self.card_fields(control)
        yield self.keyword
        for record in self.records:
            yield record.to_card(fields)
        yield ""


@frozen
class Coordinates(NumberedSegment[records.NodeValues], keyword="COOR", record=records.NodeValues):
    """COOR: (2I5,7F10.0); coordinates of the nodes (length), of which NDM are used."""


@frozen
class Elements(NumberedSegment[records.ElementNodes], keyword="ELEM", record=records.ElementNodes):
    """ELEM: (16I5); nodes of the elements; the increment follows the last of the NEN nodes."""


@frozen
class Boundary(NumberedSegment[records.NodeCodes], keyword="BOUN", record=records.NodeCodes):
    """BOUN: (16I5); restraint codes of the nodes; a dof with a code other than 0 is restrained."""


@frozen
class Forces(NumberedSegment[records.NodeValues], keyword="FORC", record=records.NodeValues):
    """FORC: (2I5,7F10.0); nodal forces, or displacements where the dof is restrained."""


@frozen
class Material(Segment, keyword="MATE"):
    """MATE: integration orders, ply constants and layers, the first layer at z = -h/2."""

    integration: records.Integration
    ply: records.Ply
    layers: tuple[records.Layer, ...]

    def cards(self, control: Control) -> Iterator[str]:
        """Text of the segment's cards."""
        yield self.keyword
        for record in (self.integration, self.ply, *self.layers):
            yield record.to_card()


@frozen
class Impact(Segment, keyword="ROD"):
    """ROD: (2I5,F10.0); impact point and velocity."""

    node: int  # impact node
    dof: int  # its dof in the direction of impact, from 1 (3 is w)
    velocity: float  # approach velocity, length/time

    fields: ClassVar[Fields] = layout(
        "I5 impact node|node", "I5 impact dof|dof", "F10 impact velocity|velocity"
    )


@frozen
class Indentation(Segment, keyword="EXPE"):
    """EXPE: (4F10.0); the measured indentation law, equations 3-1, 3-3 and 3-8.

    With the second word ACR the permanent indentation follows equation 3-7 instead of 3-8.
    """

    k: float  # contact coefficient, force/length^1.5
    # Critical indentation (length), beyond which an indentation remains; alpha_cr with ACR.
    alpha_p: float
    s_p: float  # slope of the permanent over the maximum indentation; 0 with ACR
    q: float  # power of the unloading curve; 5/2 or 0 (the same) with ACR
    word: str = ""  # the keyword card's second word: ``""`` for equation 3-8, ``"ACR"`` for 3-7

    ACR: ClassVar[str] = "ACR"
    fields: ClassVar[Fields] = layout(
        "F10 contact coefficient k|k", "F10 critical indentation alpha_p|alpha_p",
        "F10 constant s_p|s_p", "F10 unloading power q|q",
    )  # fmt: skip
    acr_fields: ClassVar[Fields] = layout(
        "F10 contact coefficient k|k", "F10 critical indentation alpha_cr|alpha_cr",
        "F10 constant s_p|(none)", "F10 unloading power q|q",
    )  # fmt: skip

    def values(self) -> tuple[float, float, float, float]:
        """Values in the card's order."""
        return self.k, self.alpha_p, self.s_p, self.q

    def names(self) -> list[str]:
        """Names of the values."""
        return [field.name for field in (self.acr_fields if self.word else self.fields)]

    def text(self) -> str:
        """Text of the keyword card and of the card of data."""
        return f"{f'EXPE {self.word}'.rstrip()}\n{self.to_card()}"

    def cards(self, control: Control) -> Iterator[str]:
        """Text of the segment's cards."""
        yield from self.text().splitlines()


@frozen
class Projectile(Segment, keyword="PROJ"):
    """PROJ: (2I5,3F10.0) and, for a rod, its diameters; the projectile (not in the report)."""

    elements: int  # number of the rod's elements; 0 for a rigid mass
    # Node at which its force is measured, from 1 at the impacted end; 0 for the middle.
    transducer: int
    size: float  # length of the rod; the mass where there are no elements
    # Young's modulus, and mass per volume, of a rod.
    modulus: float = 0.0
    density: float = 0.0
    # From the impacted end on; those between two cards are interpolated.
    diameters: tuple[records.RodDiameter, ...] = ()

    optional: ClassVar[int] = 2
    fields: ClassVar[Fields] = layout(
        "I5 number of rod elements|elms", "I5 transducer node|node", "F10 length or mass|len/mass",
        "F10 rod's Young's modulus|modulus", "F10 rod's density|density",
    )  # fmt: skip

    def cards(self, control: Control) -> Iterator[str]:
        """Text of the segment's cards."""
        yield from super().cards(control)
        if self.elements:
            for record in self.diameters:
                yield record.to_card()
            yield ""


@frozen
class Patch(Segment, keyword="PATC"):
    """PATC: (A4,6X,4F10.0); the contact force acts on a circle (not in the report's program)."""

    shape: str = "DISC"  # ``"DISC"``, a uniform pressure, or ``"HERT"``, Hertz's
    # Length; None takes :data:`~fecm.mechanics.points.RADIUS_PER_THICKNESS` times the thickness.
    radius: float | None = None
    # Centre, length; None takes the node of ROD.
    x: float | None = None
    y: float | None = None
    load: float = 0.0  # static force on the patch, scaled by PROP

    optional: ClassVar[int] = 4
    fields: ClassVar[Fields] = layout(
        "A4 shape", "X6", "F10? radius c|c", "F10? centre x0|x0", "F10? centre y0|y0",
        "F10 static load|load",
    )  # fmt: skip


@frozen
class Shear(Segment, keyword="SHEA"):
    """SHEA: (F10.0); treatment of transverse shear (not in the report's program)."""

    # Shear correction factor: 1 in the report's program; its page on cut-off frequencies recommends
    # pi^2/12.
    factor: float = 1.0
    # Assumed strains, ``MITC`` on the keyword card; otherwise quadrature of the order L2.
    assumed: bool = False
    # Stiffness from the equilibrium of the plies, ``EQUI`` on the keyword card; otherwise their
    # sum, equation 2-19.
    equilibrium: bool = False

    fields: ClassVar[Fields] = layout("F10 shear correction factor|factor")
    WORDS: ClassVar[tuple[str, ...]] = ("MITC", "EQUI")

    def words(self) -> list[str]:
        """Words of the keyword card."""
        return list(compress(self.WORDS, (self.assumed, self.equilibrium)))

    def cards(self, control: Control) -> Iterator[str]:
        """Text of the segment's cards; with a word the factor's card may be missing."""
        words = self.words()
        yield " ".join([self.keyword, *words])
        if not words or self.factor != 1.0:
            yield write_card(self.fields, [self.factor])


@frozen
class Allowables(Segment, keyword="ALLO"):
    """ALLO: (7F10.0) and (3F10.0); strengths of the ply (not in the report's program)."""

    # Strengths along and across the fibres, in tension and compression: all positive, force/area.
    xt: float
    xc: float
    yt: float
    yc: float
    # Shear strengths; a blank S13 is S12, a blank S23 is S13.
    s12: float
    s13: float
    s23: float
    f12: float = -0.5  # Tsai and Wu's F12*; -0.5 if blank
    # Puck's slopes; 0.35 and 0.3 if blank.
    p_plus: float = 0.35
    p_minus: float = 0.3

    fields: ClassVar[Fields] = layout(
        "F10 XT", "F10 XC", "F10 YT", "F10 YC", "F10 S12", "F10? S13", "F10? S23"
    )
    constants: ClassVar[Fields] = layout("F10? F12*", "F10? p+", "F10? p-")

    @classmethod
    def from_row(cls, values: Sequence[Value], source: Source | None) -> Self:
        """Build the segment from its first card or from both."""
        *given, s12, s13, s23 = values[:7]
        s13 = s12 if s13 == "" else s13
        s23 = s13 if s23 == "" else s23
        return super().from_row([*given, s12, s13, s23, *values[7:]], source)

    def cards(self, control: Control) -> Iterator[str]:
        """Text of the segment's cards."""
        row = self.row()
        yield self.keyword
        yield write_card(self.fields, row[:7])
        yield write_card(self.constants, row[7:])


@frozen
class Delamination(Segment, keyword="DELA"):
    """DELA: (2F10.0); toughness for the delamination threshold (not in the report's program)."""

    toughness: float  # G_IIc, force/length
    number: float = 1.0  # number of delaminations; 1 if blank

    fields: ClassVar[Fields] = layout("F10 G_IIc", "F10? number of delaminations|number")


@frozen
class Damping(Segment, keyword="DAMP"):
    """DAMP: (F10.0); mass-proportional damping of the plate (not in the report's program)."""

    coefficient: float  # a of the damping matrix C = a M, 1/time

    fields: ClassVar[Fields] = layout("F10 a")


@frozen
class Gages(NumberedSegment[records.Gage], keyword="GAGE", record=records.Gage):
    """GAGE: strain gages, read at every step (not in the report's program)."""


@frozen
class Units(Segment, keyword="UNIT"):
    """UNIT: names of the deck's units, for output; nothing is converted."""

    length: str
    force: str
    time: str

    NAMES: ClassVar[tuple[str, ...]] = ("length", "force", "time")

    def cards(self, control: Control) -> Iterator[str]:
        """Text of the segment's cards."""
        yield "UNIT"
        yield f"{self.length} {self.force} {self.time}"


@frozen
class PrintOption(Segment, keyword="PRIN"):
    """PRIN or NOPR: whether the data that follow are printed."""

    on: bool

    def cards(self, control: Control) -> Iterator[str]:
        """Text of the segment's card."""
        yield "PRIN" if self.on else "NOPR"


@frozen
class Page(Segment, keyword="PAGE"):
    """PAGE: the printer's carriage control at the head of each page, on a separate card."""

    carriage_control: str

    fields: ClassVar[Fields] = layout("A4 carriage control")


@frozen
class Deck(Record):
    """One problem: everything from its FECM card to the END of its macro program.

    Attributes
    ----------
    title : str
        Text after FECM on the title card.
    control : Control
    segments : tuple of Segment
        In the order of the deck.
    macros : tuple of Macro
        The macro program without its END.
    tables : tuple of LoadTable
        Proportional loads, one for each PROP that reads one.
    text : str
        The problem's cards as they were read, ended by STOP; empty for a deck built in Python.
    """

    title: str
    control: Control
    segments: tuple[Segment, ...]
    macros: tuple[records.Macro, ...]
    tables: tuple[records.LoadTable, ...] = ()
    text: str = field(default="", compare=False, repr=False)

    def __repr__(self) -> str:
        sizes = f"{self.control.numnp} nodes, {self.control.numel} elements"
        return f"<fecm deck {self.title!r}, {sizes}, {len(self.macros)} macros>"

    def _repr_html_(self) -> str:
        """Table of segments and macros, for notebooks."""
        segments = " ".join(segment.keyword for segment in self.segments)
        macros = " ".join(macro.word for macro in self.macros)
        rows = (("segments", shorten(segments, 200)), ("macros", shorten(macros, 200)))
        return html_table(repr(self)[1:-1], rows)

    def has(self, kind: type[Segment]) -> bool:
        """Whether the deck has a segment of one kind."""
        return any(isinstance(segment, kind) for segment in self.segments)

    def all(self, kind: type[_S]) -> list[_S]:
        """Every segment of one kind, in the deck's order."""
        return [segment for segment in self.segments if isinstance(segment, kind)]

    def last(self, kind: type[_S]) -> _S | None:
        """The last segment of one kind, which is the effective one; None if there is none."""
        found = self.all(kind)
        return found[-1] if found else None

    def require(self, kind: type[_S]) -> _S:
        """The effective segment of one kind.

        Raises
        ------
        LookupError
            If the deck has none.
        """
        if (segment := self.last(kind)) is None:
            raise LookupError(f"the deck has no {kind.keyword} segment")
        return segment

    def with_(self, **values: float | str | Sequence[float]) -> Deck:
        """Deck with other values, under the names that :func:`fecm.sweep` varies.

        Raises
        ------
        ValueError
            If a name is unknown, or a value is invalid for this deck.

        Examples
        --------
        >>> import fecm
        >>> deck = fecm.read_one("decks/impact-115.inp")
        >>> deck.with_(velocity=60, layup="[0/90]5s").control.layers
        20
        """
        from fecm.sweeps.cases import checked
        from fecm.sweeps.vary import apply_case

        return apply_case(self, *checked([values]))

    def to_text(self) -> str:
        """Write the problem as cards, ended by STOP; reading them gives the same model.

        Raises
        ------
        ValueError
            If a number is not finite.
        """
        lines = [f"{TITLE} {self.title}".rstrip(), self.control.to_card()]
        for segment in self.segments:
            lines.extend(segment.cards(self.control))
        lines += ["END", "MACR", *(macro.to_card() for macro in self.macros), "END"]
        lines += [*(table.to_card() for table in self.tables), STOP]
        return "\n".join(lines) + "\n"
