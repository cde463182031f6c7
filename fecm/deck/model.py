"""The model: what a deck says, as plain typed objects that know nothing of mechanics.

A :class:`Deck` is one problem of a file.  It keeps the cards' values as they were given; nodes and
elements that the cards only imply are generated from it by :mod:`fecm.mesh`.  Every record knows
the card that it was read from (`source`), which does not count when models are compared.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import ClassVar, TypeVar

from fecm.deck.card import Fields, Source, Value, layout, write_card
from fecm.deck.findings import Place

TITLE = "FECM"
STOP = "STOP"

# Least and greatest number of nodes an element.
NODES_AN_ELEMENT = (3, 12)
AXES = ("x", "y", "z")
UNKNOWNS = ("u", "v", "w", "theta_x", "theta_y")


@dataclass(frozen=True, kw_only=True)
class Record:
    """Whatever was read from one card."""

    source: Source | None = field(default=None, compare=False, repr=False)

    def place(self, name: str = "") -> Place | None:
        """Where the field called `name` stands in the deck; the whole card without a name."""
        return self.source.place(name) if self.source else None


@dataclass(frozen=True)
class Control(Record):
    """Control card: 6I5.

    Attributes
    ----------
    numnp, numel, layers : int
        Numbers of nodes, elements and layers.
    ndm, ndf, nen : int
        Spatial dimensions, unknowns a node, nodes an element at the most.
    """

    numnp: int
    numel: int
    layers: int
    ndm: int
    ndf: int
    nen: int

    fields: ClassVar[Fields] = layout(
        "I5 NUMNP", "I5 NUMEL", "I5 LAYER", "I5 NDM", "I5 NDF", "I5 NEN"
    )

    def values(self) -> list[Value]:
        """Values in the card's order."""
        return [self.numnp, self.numel, self.layers, self.ndm, self.ndf, self.nen]


@dataclass(frozen=True)
class NodeValues(Record):
    """COOR or FORC card: values at a node, and the step to the next node generated from it."""

    node: int
    increment: int
    values: tuple[float, ...]


@dataclass(frozen=True)
class NodeCodes(Record):
    """BOUN card: restraint codes of a node; a negative code carries on to generated nodes."""

    node: int
    increment: int
    codes: tuple[int, ...]


@dataclass(frozen=True)
class ElementNodes(Record):
    """ELEM card: the nodes of an element (0 where absent) and the step for generated ones."""

    element: int
    nodes: tuple[int, ...]
    increment: int


def node_fields(ndm: int) -> Fields:
    """Fields of a COOR card: (2I5,7F10.0), of which `ndm` coordinates are used."""
    return layout(
        "I5 node", "I5 increment|incr", *(f"F10 {axis}-coordinate|{axis}" for axis in AXES[:ndm])
    )


def force_fields(ndf: int) -> Fields:
    """Fields of a FORC card: (2I5,7F10.0), of which `ndf` values are used."""
    return layout("I5 node", "I5 increment|incr", *(f"F10 value {i + 1}" for i in range(ndf)))


def code_fields(ndf: int) -> Fields:
    """Fields of a BOUN card: (16I5), of which `ndf` codes are used."""
    return layout(
        "I5 node", "I5 increment|incr", *(f"I5 code {i + 1}|c{i + 1}" for i in range(ndf))
    )


def element_fields(nen: int) -> Fields:
    """Fields of an ELEM card: (16I5); the increment follows the last of the `nen` nodes."""
    return layout(
        "I5 element|elm", *(f"I5 node {i + 1}|n{i + 1}" for i in range(nen)), "I5 increment|incr"
    )


@dataclass(frozen=True)
class Layer(Record):
    """Layer card of MATE: (I5,F5.0,F10.0); the number is not used for placing.

    Attributes
    ----------
    number : int
    angle : float
        Fibre direction in degrees, counter-clockwise from the x-axis.
    thickness : float
        Length.
    """

    number: int
    angle: float
    thickness: float

    fields: ClassVar[Fields] = layout(
        "I5 layer|lay", "F5 fibre angle|ang", "F10 layer thickness|thickness"
    )


@dataclass(frozen=True)
class Integration(Record):
    """First card of MATE: (3I5,2F10.0).

    Attributes
    ----------
    bending, shear : int
        Gauss orders of the bending and of the transverse shear stiffness (L1, L2).
    points : int
        Stress points: Gauss points of this order if positive, nodal points if negative (K).
    thickness, width : float
        Total thickness (length); the width is read and never used.
    """

    bending: int
    shear: int
    points: int
    thickness: float
    width: float = 0.0

    fields: ClassVar[Fields] = layout(
        "I5 bending order L1|L1", "I5 shear order L2|L2", "I5 stress-point order K|K",
        "F10 total thickness|thickness", "F10 width",
    )  # fmt: skip


@dataclass(frozen=True)
class Ply(Record):
    """Second card of MATE: (7F10.0); mass density and elastic constants of every layer.

    Attributes
    ----------
    density : float
        Mass per volume.
    nu12 : float
        Major Poisson's ratio.
    e1, e2, g12, g13, g23 : float
        Moduli, force per area.
    """

    density: float
    nu12: float
    e1: float
    e2: float
    g12: float
    g13: float
    g23: float

    fields: ClassVar[Fields] = layout(
        "F10 mass density|density", "F10 Poisson's ratio NU12|NU12", "F10 Young's modulus E1|E1",
        "F10 Young's modulus E2|E2", "F10 shear modulus G12|G12", "F10 shear modulus G13|G13",
        "F10 shear modulus G23|G23",
    )  # fmt: skip


# Segments, each of one keyword ------------------------------------------------------------------


@dataclass(frozen=True)
class Segment(Record, ABC):
    """A keyword card and the data that follow it."""

    keyword: ClassVar[str]

    @abstractmethod
    def cards(self, control: Control) -> Iterator[str]:
        """Text of the segment's cards, the keyword card included."""


def _numbered(
    keyword: str, fields: Fields, rows: Sequence[tuple[int, ...] | tuple[float, ...]]
) -> Iterator[str]:
    """A keyword card, a card a row and the blank card that ends them."""
    yield keyword
    for row in rows:
        yield write_card(fields, row)
    yield ""


@dataclass(frozen=True)
class Coordinates(Segment):
    """COOR: coordinates of the nodes (length)."""

    records: tuple[NodeValues, ...]
    keyword: ClassVar[str] = "COOR"

    def cards(self, control: Control) -> Iterator[str]:
        """Text of the segment's cards."""
        rows = [(r.node, r.increment, *r.values) for r in self.records]
        return _numbered("COOR", node_fields(control.ndm), rows)


@dataclass(frozen=True)
class Elements(Segment):
    """ELEM: nodes of the elements."""

    records: tuple[ElementNodes, ...]
    keyword: ClassVar[str] = "ELEM"

    def cards(self, control: Control) -> Iterator[str]:
        """Text of the segment's cards."""
        rows = [(r.element, *r.nodes, r.increment) for r in self.records]
        return _numbered("ELEM", element_fields(control.nen), rows)


@dataclass(frozen=True)
class Boundary(Segment):
    """BOUN: restraint codes of the nodes; an unknown with a code other than 0 is restrained."""

    records: tuple[NodeCodes, ...]
    keyword: ClassVar[str] = "BOUN"

    def cards(self, control: Control) -> Iterator[str]:
        """Text of the segment's cards."""
        rows = [(r.node, r.increment, *r.codes) for r in self.records]
        return _numbered("BOUN", code_fields(control.ndf), rows)


@dataclass(frozen=True)
class Forces(Segment):
    """FORC: nodal forces, or displacements where the unknown is restrained."""

    records: tuple[NodeValues, ...]
    keyword: ClassVar[str] = "FORC"

    def cards(self, control: Control) -> Iterator[str]:
        """Text of the segment's cards."""
        rows = [(r.node, r.increment, *r.values) for r in self.records]
        return _numbered("FORC", force_fields(control.ndf), rows)


@dataclass(frozen=True)
class Material(Segment):
    """MATE: integration orders, ply constants and layers, the first layer at z = -h/2."""

    integration: Integration
    ply: Ply
    layers: tuple[Layer, ...]
    keyword: ClassVar[str] = "MATE"

    def cards(self, control: Control) -> Iterator[str]:
        """Text of the segment's cards."""
        rule, ply = self.integration, self.ply
        values: list[Value] = [rule.bending, rule.shear, rule.points, rule.thickness]
        if rule.width:
            values.append(rule.width)
        yield "MATE"
        yield write_card(Integration.fields[: len(values)], values)
        yield write_card(
            Ply.fields,
            [ply.density, ply.nu12, ply.e1, ply.e2, ply.g12, ply.g13, ply.g23],
        )
        for layer in self.layers:
            yield write_card(Layer.fields, [layer.number, layer.angle, layer.thickness])


@dataclass(frozen=True)
class Impact(Segment):
    """ROD: (2I5,F10.0); where and how fast the projectile hits.

    Attributes
    ----------
    node : int
        The node that is hit.
    dof : int
        The node's unknown in the direction of impact, from 1 (3 is w).
    velocity : float
        Approach velocity, length/time.
    """

    node: int
    dof: int
    velocity: float
    keyword: ClassVar[str] = "ROD"

    fields: ClassVar[Fields] = layout(
        "I5 impact node|node", "I5 impact unknown|dof", "F10 impact velocity|velocity"
    )

    def cards(self, control: Control) -> Iterator[str]:
        """Text of the segment's cards."""
        yield "ROD"
        yield write_card(self.fields, [self.node, self.dof, self.velocity])


@dataclass(frozen=True)
class Indentation(Segment):
    """EXPE: (4F10.0); the measured indentation law, equations 3-1, 3-3 and 3-8.

    Attributes
    ----------
    k : float
        Contact coefficient, force/length^1.5.
    alpha_p : float
        Critical indentation (length), beyond which an indentation remains.
    s_p : float
        Slope of the permanent over the maximum indentation.
    q : float
        Power of the unloading curve.
    """

    k: float
    alpha_p: float
    s_p: float
    q: float
    keyword: ClassVar[str] = "EXPE"

    fields: ClassVar[Fields] = layout(
        "F10 contact coefficient k|k", "F10 critical indentation alpha_p|alpha_p",
        "F10 constant s_p|s_p", "F10 unloading power q|q",
    )  # fmt: skip

    def cards(self, control: Control) -> Iterator[str]:
        """Text of the segment's cards."""
        yield "EXPE"
        yield write_card(self.fields, [self.k, self.alpha_p, self.s_p, self.q])


@dataclass(frozen=True)
class Units(Segment):
    """UNIT: names of the deck's units, for output; nothing is converted.

    Attributes
    ----------
    length, force, time : str
    """

    length: str
    force: str
    time: str
    keyword: ClassVar[str] = "UNIT"

    NAMES: ClassVar[tuple[str, ...]] = ("length", "force", "time")

    def cards(self, control: Control) -> Iterator[str]:
        """Text of the segment's cards."""
        yield "UNIT"
        yield f"{self.length} {self.force} {self.time}"


@dataclass(frozen=True)
class PrintOption(Segment):
    """PRIN or NOPR: whether the data that follow are printed."""

    on: bool
    keyword: ClassVar[str] = "PRIN"

    def cards(self, control: Control) -> Iterator[str]:
        """Text of the segment's card."""
        yield "PRIN" if self.on else "NOPR"


@dataclass(frozen=True)
class Page(Segment):
    """PAGE: the printer's carriage control at the head of each page, on a card of its own."""

    carriage_control: str
    keyword: ClassVar[str] = "PAGE"

    fields: ClassVar[Fields] = layout("A4 carriage control")

    def cards(self, control: Control) -> Iterator[str]:
        """Text of the segment's cards."""
        yield "PAGE"
        yield self.carriage_control


@dataclass(frozen=True)
class Macro(Record):
    """A macro card: (A4,1X,A4,1X,2F5.0).

    Attributes
    ----------
    word : str
        Name, in capitals.
    option : str
        Second word, in capitals; often blank.
    value, second : float
        The two numbers; 0 where blank.
    """

    word: str
    option: str = ""
    value: float = 0.0
    second: float = 0.0

    fields: ClassVar[Fields] = layout(
        "A4 macro", "X1", "A4 second word", "X1", "F5 value", "F5 second value"
    )

    def text(self) -> str:
        """Text of the card; whole numbers stand without a point, zeros at its end not at all."""
        values: list[Value] = [self.word, self.option]
        for number in (self.value, self.second):
            values.append(int(number) if number.is_integer() else number)
        while values and not values[-1]:
            values.pop()
        return write_card(self.fields[: len(values)], values)


@dataclass(frozen=True)
class LoadTable(Record):
    """Card of PROP: (2I5,7F10.0), behind the macro program's END.

    Attributes
    ----------
    kind, exponent : int
        Type of the table, 1 (or blank), and the power L of the sine.
    begin, end : float
        Times between which the load acts.
    constants : tuple of float
        A1 to A5 of A1 + A2 t + A3 sin(A4 t + A5)^L.
    """

    kind: int
    exponent: int
    begin: float
    end: float
    constants: tuple[float, ...]

    fields: ClassVar[Fields] = layout(
        "I5 type", "I5 exponent|exp", "F10 begin|t_min", "F10 end|t_max",
        *(f"F10 constant A{i}|A{i}" for i in range(1, 6)),
    )  # fmt: skip

    def text(self) -> str:
        """Text of the card."""
        return write_card(
            self.fields, [self.kind, self.exponent, self.begin, self.end, *self.constants]
        )


_S = TypeVar("_S", bound=Segment)


@dataclass(frozen=True)
class Deck(Record):
    """One problem: everything from its FECM card to the END of its macro program.

    Attributes
    ----------
    title : str
        What stands behind FECM on the title card.
    control : Control
    segments : tuple of Segment
        In the order of the deck.
    macros : tuple of Macro
        The macro program without its END.
    tables : tuple of LoadTable
        Proportional loads, one for each PROP that reads one.
    text : str
        The problem's cards as they were read, ended by STOP; empty for a deck made in Python.
    """

    title: str
    control: Control
    segments: tuple[Segment, ...]
    macros: tuple[Macro, ...]
    tables: tuple[LoadTable, ...] = ()
    text: str = field(default="", compare=False, repr=False)

    def has(self, kind: type[Segment]) -> bool:
        """Whether the deck has a segment of one kind."""
        return any(isinstance(segment, kind) for segment in self.segments)

    def all(self, kind: type[_S]) -> list[_S]:
        """Every segment of one kind, in the deck's order."""
        return [segment for segment in self.segments if isinstance(segment, kind)]

    def last(self, kind: type[_S]) -> _S | None:
        """The last segment of one kind, which is the one that counts; None without any."""
        found = self.all(kind)
        return found[-1] if found else None

    def need(self, kind: type[_S]) -> _S:
        """The segment of one kind that counts.

        Raises
        ------
        LookupError
            If the deck has none.
        """
        segment = self.last(kind)
        if segment is None:
            raise LookupError(f"the deck has no {kind.keyword} segment")
        return segment

    def to_text(self) -> str:
        """Write the problem as cards, ended by STOP; reading them gives the same model.

        Raises
        ------
        ValueError
            If a number is not finite.
        """
        lines = [
            f"{TITLE} {self.title}".rstrip(),
            write_card(Control.fields, self.control.values()),
        ]
        for segment in self.segments:
            lines.extend(segment.cards(self.control))
        lines += ["END", "MACR", *(macro.text() for macro in self.macros), "END"]
        lines += [*(table.text() for table in self.tables), STOP]
        return "\n".join(lines) + "\n"
