"""Records: the values of a card as plain typed objects, which compare without it; its fields."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import field
from typing import Any, ClassVar, Self

from fecm._frozen import frozen
from fecm.deck.card import Fields, Source, Value, layout, write_card
from fecm.deck.findings import Place


def load_factor(table: LoadTable, clock: float) -> float:
    """A1 + A2 t + A3 sin(A4 t + A5)^L between t_min and t_max, 0 outside; L below 1 counts as 1."""
    if not table.begin <= clock <= table.end:
        return 0.0
    a1, a2, a3, a4, a5 = table.constants
    return a1 + a2 * clock + a3 * math.sin(a4 * clock + a5) ** max(table.exponent, 1)


NODES_AN_ELEMENT = (3, 12)  # smallest and largest number of nodes per element
EXACT = 2**53  # floats represent every integer below this number
AXES = ("x", "y", "z")
DOF_NAMES = ("u", "v", "w", "theta_x", "theta_y")


def without_points(values: Sequence[Value]) -> list[Value]:
    """Values of a card, whole floats as integers, which are written without a point."""
    return [
        int(v) if isinstance(v, float) and v.is_integer() and abs(v) < EXACT else v for v in values
    ]


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
        """Build the record from a card's values; ``""`` takes the attribute's default."""
        arguments: list[Any] = list(values)
        if cls.packed is not None:
            arguments[cls.packed] = [tuple(arguments[cls.packed])]
        if "" not in arguments:
            return cls(*arguments, source=source)
        names = (attribute.name for attribute in dataclasses.fields(cls)[1:])
        given = {n: value for n, value in zip(names, arguments, strict=False) if value != ""}
        return cls(**given, source=source)

    def row(self) -> list[Value]:
        """Values in the card's order; ``""`` for an attribute that is None, a blank."""
        row: list[Value] = []
        for attribute in dataclasses.fields(self)[1:]:  # the first is the source
            value = getattr(self, attribute.name)
            row += value if isinstance(value, tuple) else ("" if value is None else value,)
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


@frozen
class NodeValues(Record):
    """COOR or FORC card: values at a node, and the step to the next node generated from it."""

    node: int
    increment: int
    values: tuple[float, ...]

    packed: ClassVar[slice] = slice(2, None)


@frozen
class RodDiameter(Record):
    """PROJ card: (2I5,F10.0); an element's diameter (length), and the step to generated ones."""

    element: int
    increment: int
    diameter: float

    fields: ClassVar[Fields] = layout("I5 element|elm", "I5 increment|incr", "F10 diameter")


@frozen
class Gage(Record):
    """GAGE card: (I5,5X,4F10.0); a strain gage."""

    number: int  # its name in the result
    # Its position; z from the mid-plane, positive on the face away from the projectile (length).
    x: float
    y: float
    z: float
    direction: float  # degrees from the x-axis to the y-axis

    fields: ClassVar[Fields] = layout(
        "I5 gage", "X5", "F10 gage's x|x", "F10 gage's y|y", "F10 gage's z|z",
        "F10 gage's direction|degrees",
    )  # fmt: skip


@frozen
class NodeCodes(Record):
    """BOUN card: restraint codes of a node; a negative code carries on to generated nodes."""

    node: int
    increment: int
    codes: tuple[int, ...]

    packed: ClassVar[slice] = slice(2, None)


@frozen
class ElementNodes(Record):
    """ELEM card: the nodes of an element (0 where absent) and the step for generated ones."""

    element: int
    nodes: tuple[int, ...]
    increment: int

    packed: ClassVar[slice] = slice(1, -1)


@frozen
class Layer(Record):
    """Layer card of MATE: (I5,F5.0,F10.0); the number is not used for placing."""

    number: int
    angle: float  # fibre direction in degrees, counter-clockwise from the x-axis
    thickness: float  # length

    fields: ClassVar[Fields] = layout(
        "I5 layer|lay", "F5 fibre angle|ang", "F10 layer thickness|thickness"
    )


@frozen
class Integration(Record):
    """First card of MATE: (3I5,2F10.0)."""

    # Gauss orders of the bending and of the transverse shear stiffness (L1, L2).
    bending: int
    shear: int
    # Stress points: Gauss points of this order if positive, nodal points if negative (K).
    points: int
    # Total thickness (length); the width is not used.
    thickness: float
    width: float = 0.0

    optional: ClassVar[int] = 1
    fields: ClassVar[Fields] = layout(
        "I5 bending order L1|L1", "I5 shear order L2|L2", "I5 stress-point order K|K",
        "F10 total thickness|thickness", "F10 width",
    )  # fmt: skip


@frozen
class Ply(Record):
    """Second card of MATE: (7F10.0); mass density and elastic constants of every layer."""

    density: float  # mass per volume
    nu12: float  # major Poisson's ratio
    # Moduli, force per area.
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


@frozen
class Macro(Record):
    """A macro card: (A4,1X,A4,1X,2F5.0)."""

    word: str  # name, in capitals
    option: str = ""  # second word, in capitals; often blank
    # The two numbers; 0 where blank.
    value: float = 0.0
    second: float = 0.0

    fields: ClassVar[Fields] = layout(
        "A4 macro", "X1", "A4 second word", "X1", "F5 value", "F5 second value"
    )
    # With commas the second word may be left out where the value follows: LOOP,794.
    short_fields: ClassVar[Fields] = (fields[0], *fields[2:])

    optional: ClassVar[int] = 3

    def row(self) -> list[Value]:
        """Values in the card's order; integers have no point."""
        return without_points(super().row())


@frozen
class LoadTable(Record):
    """Card of PROP: (2I5,7F10.0), after the macro program's END."""

    # Type of the table, 1 (or blank), and the power L of the sine.
    kind: int
    exponent: int
    # Times between which the load acts.
    begin: float
    end: float
    constants: tuple[float, ...]  # A1 to A5 of A1 + A2 t + A3 sin(A4 t + A5)^L

    packed: ClassVar[slice] = slice(4, None)
    fields: ClassVar[Fields] = layout(
        "I5 type", "I5 exponent|exp", "F10 begin|t_min", "F10 end|t_max",
        *(f"F10 constant A{i}|A{i}" for i in range(1, 6)),
    )  # fmt: skip
