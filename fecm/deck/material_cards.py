"""Cards of the plate's material: plies, layers, transverse shear, strengths and damping."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import compress
from typing import ClassVar, Self

from fecm.deck.card import (
    BLANK,
    Card,
    CardSource,
    Control,
    Fields,
    Record,
    Value,
    layout,
    write_card,
)
from fecm.deck.segment import CardStream, Segment

MATERIAL = 1  # number of MATE's material, and of its laminate


@dataclass(frozen=True)
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
        "I5 bending order L1|L1",
        "I5 shear order L2|L2",
        "I5 stress-point order K|K",
        "F10 total thickness|thickness",
        "F10 width",
    )


@dataclass(frozen=True)
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
        "F10 mass density|density",
        "F10 Poisson's ratio NU12|NU12",
        "F10 Young's modulus E1|E1",
        "F10 Young's modulus E2|E2",
        "F10 shear modulus G12|G12",
        "F10 shear modulus G13|G13",
        "F10 shear modulus G23|G23",
    )


@dataclass(frozen=True)
class Layer(Record):
    """Layer card of MATE: (I5,F5.0,F10.0,I5). The order of the cards counts, not the number.

    The report's program has no material on this card.
    """

    number: int
    angle: float  # fibre direction in degrees, counter-clockwise from the x-axis
    thickness: float  # length
    material: int = MATERIAL

    fields: ClassVar[Fields] = layout(
        "I5 layer|lay",
        "F5 fibre angle|ang",
        "F10 layer thickness|thickness",
        "I5? material|mat",
    )
    # Fields of a card without a material.
    plain: ClassVar[Fields] = fields[:-1]

    def to_card(self, fields: Fields | None = None) -> str:
        """Return the text of the card, without the material if it is MATE's."""
        written = self.plain if self.material == MATERIAL else self.fields
        return super().to_card(fields or written)


@dataclass(frozen=True)
class Material(Segment, keyword="MATE"):
    """MATE: integration orders, ply constants and layers, the first layer at z = -h/2."""

    integration: Integration
    ply: Ply
    layers: tuple[Layer, ...]

    @classmethod
    def read(cls, head: Card, cards: CardStream) -> Self | None:
        """Read both cards and the layers."""
        integration = cards.single(head, Integration)
        ply = cards.single(head, Ply)
        layers = None
        if integration or ply:
            layers = read_layers(head, cards, cards.control.layers, "the control card says")
        if integration is None or ply is None or layers is None:
            return None
        return cls(integration, ply, layers, source=CardSource(head))

    def cards(self, control: Control) -> Iterator[str]:
        """Return the text of the segment's cards."""
        yield self.keyword
        for record in (self.integration, self.ply, *self.layers):
            yield record.to_card()


def read_layers(
    head: Card, cards: CardStream, count: int, stated_by: str
) -> tuple[Layer, ...] | None:
    """Read `count` layer cards; None if one is missing or unreadable.

    `stated_by` tells in a message where the count comes from: "the control card says".
    """
    layer_cards: list[Card] = []
    while (
        len(layer_cards) < count and (card := cards.take_data()) is not None and not card.is_blank
    ):
        layer_cards.append(card)
    numbered = any(text.strip() for card in layer_cards for _, text in card.cut(Layer.fields)[3:4])
    fields = Layer.fields if numbered else Layer.plain
    read = [cards.record(card, Layer, fields) for card in layer_cards]
    if len(layer_cards) < count:
        message = f"{head.keyword} has {len(layer_cards)} layer cards where {stated_by} {count}."
        cards.findings.add("E202", message, (card or cards.peek() or head).place)
        return None
    layers = tuple(layer for layer in read if layer is not None)
    return layers if len(layers) == count else None


@dataclass(frozen=True)
class Shear(Segment, keyword="SHEA"):
    """SHEA: (F10.0); treatment of transverse shear (not in the report's program)."""

    # Shear correction factor: 1 in the report's program. The report recommends pi^2/12 where it
    # discusses cut-off frequencies.
    factor: float = 1.0
    # True for assumed strains, ``MITC`` on the keyword card; False for quadrature of the order L2.
    assumed: bool = False
    # True for the stiffness from the equilibrium of the plies, ``EQUI`` on the keyword card; False
    # for the sum over the plies, equation 2-19.
    equilibrium: bool = False

    fields: ClassVar[Fields] = layout("F10 shear correction factor|factor")
    WORDS: ClassVar[tuple[str, ...]] = ("MITC", "EQUI")

    @classmethod
    def read(cls, head: Card, cards: CardStream) -> Self | None:
        """Read the card of the factor; it may be missing after a word."""
        words = [word.upper() for word in head.words[1:]]
        for word in words:
            if word not in cls.WORDS:
                hint = "SHEA takes MITC (assumed strains) and EQUI (stiffness from equilibrium)"
                cards.findings.add("E446", f"`{word}` after SHEA is unknown.", head.place, hint)
        assumed, equilibrium = (word in words for word in cls.WORDS)
        following = cards.peek()
        if words and (following is None or following.is_keyword or following.is_blank):
            return cls(assumed=assumed, equilibrium=equilibrium, source=CardSource(head))
        shear = cards.single(head, cls)
        return shear and replace(shear, assumed=assumed, equilibrium=equilibrium)

    def words(self) -> list[str]:
        """Return the words of the keyword card."""
        return list(compress(self.WORDS, (self.assumed, self.equilibrium)))

    def cards(self, control: Control) -> Iterator[str]:
        """Return the text of the segment's cards.

        The card of the factor is left out if there is a word and the factor is 1.
        """
        words = self.words()
        yield " ".join([self.keyword, *words])
        if not words or self.factor != 1.0:
            yield write_card(self.fields, [self.factor])


@dataclass(frozen=True)
class Allowables(Segment, keyword="ALLO"):
    """ALLO: (7F10.0,I5) and (3F10.0); strengths of plies (not in the report's program).

    There is a pair of cards for each material; `others` has the pairs after the first.
    """

    # Strengths along and across the fibres, in tension and compression; all positive, force/area.
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
    material: int = MATERIAL
    others: tuple[Allowables, ...] = ()

    numbered: ClassVar[Fields] = layout(
        "F10 XT", "F10 XC", "F10 YT", "F10 YC", "F10 S12", "F10? S13", "F10? S23", "I5? material"
    )
    # Fields of a card without a material.
    fields: ClassVar[Fields] = numbered[:-1]
    constants: ClassVar[Fields] = layout("F10? F12*", "F10? p+", "F10? p-")

    @classmethod
    def from_row(cls, values: Sequence[Value], source: CardSource | None) -> Self:
        """Build the strengths of a material from its first card or from both."""
        count = len(cls.fields)
        *first_values, s12, s13, s23 = values[:count]
        s13 = s12 if s13 == BLANK else s13
        s23 = s13 if s23 == BLANK else s23
        return super().from_row([*first_values, s12, s13, s23, *values[count:]], source)

    @classmethod
    def read(cls, head: Card, cards: CardStream) -> Self | None:
        """Read the strengths of every material."""
        first = cls._read_pair(head, cards)
        others: list[Self] = []
        while (card := cards.peek()) is not None and not card.is_keyword and not card.is_blank:
            if (strengths := cls._read_pair(head, cards)) is not None:
                others.append(strengths)
        return first and replace(first, others=tuple(others))

    @classmethod
    def _read_pair(cls, head: Card, cards: CardStream) -> Self | None:
        """Read the strengths and the constants of a material; the second card may be missing."""
        card = cards.peek()
        numbered = card is not None and any(
            text.strip() for _, text in card.cut(cls.numbered)[len(cls.fields) :][:1]
        )
        fields = cls.numbered if numbered else cls.fields
        if (first := cards.take_data()) is None:
            return cards.single(head, cls)
        strengths = cards.row(first, fields)
        second = cards.take_data()
        constants = None if second is None else cards.row(second, cls.constants)
        if strengths is None or (second is not None and constants is None):
            cards.unsound.add(head.keyword)
            return None
        values, source = strengths
        count = len(cls.fields)
        constant_values = [BLANK] * len(cls.constants) if constants is None else constants[0]
        return cls.from_row([*values[:count], *constant_values, *values[count:]], source)

    def cards(self, control: Control) -> Iterator[str]:
        """Return the text of the segment's cards."""
        yield self.keyword
        for item in (self, *self.others):
            yield from item._write_pair()

    def _write_pair(self) -> Iterator[str]:
        """Yield the text of the two cards of this material."""
        count = len(self.fields)
        values = self.row()
        is_plain = self.material == MATERIAL
        fields = self.fields if is_plain else self.numbered
        yield write_card(fields, [*values[:count], *([] if is_plain else [self.material])])
        yield write_card(self.constants, values[count : count + len(self.constants)])

    def of(self, material: int) -> Allowables | None:
        """Return the strengths of a material; None if there is no card for it."""
        return next(
            (strengths for strengths in (self, *self.others) if strengths.material == material),
            None,
        )


@dataclass(frozen=True)
class Delamination(Segment, keyword="DELA"):
    """DELA: (2F10.0); toughness for the delamination threshold (not in the report's program)."""

    toughness: float  # G_IIc, force/length
    number: float = 1.0  # number of delaminations; 1 if blank

    fields: ClassVar[Fields] = layout("F10 G_IIc", "F10? number of delaminations|number")


@dataclass(frozen=True)
class Damping(Segment, keyword="DAMP"):
    """DAMP: (F10.0); mass-proportional damping of the plate (not in the report's program)."""

    coefficient: float  # a of the damping matrix C = a M, 1/time

    fields: ClassVar[Fields] = layout("F10 a")


@dataclass(frozen=True)
class Nonlinear(Segment, keyword="NONL"):
    """NONL: the plate stretches as it bends, von Karman (not in the report's program)."""

    is_nonlinear: ClassVar[bool] = True

    @classmethod
    def read(cls, head: Card, cards: CardStream) -> Self:
        """Read the keyword card, the only card of the segment."""
        return cls(source=CardSource(head))

    def cards(self, control: Control) -> Iterator[str]:
        """Return the text of the segment's card."""
        yield self.keyword


@dataclass(frozen=True)
class Preload(Segment, keyword="PREL"):
    """PREL: (3F10.0); uniform initial membrane force (not in the report's program)."""

    # N0, force/length; tension is positive.
    n_x: float
    n_y: float = 0.0
    n_xy: float = 0.0

    fields: ClassVar[Fields] = layout("F10 N0x", "F10 N0y", "F10 N0xy")

    @property
    def forces(self) -> tuple[float, float, float]:
        """N0x, N0y and N0xy."""
        return self.n_x, self.n_y, self.n_xy


@dataclass(frozen=True)
class Curvature(Segment, keyword="CURV"):
    """CURV: (3F10.0); radii of a shallow curved panel (not in the report's program)."""

    # Length; 0 or blank is infinite. A radius is positive if its centre is on the side of -w.
    radius_x: float = 0.0
    radius_y: float = 0.0
    radius_xy: float = 0.0

    fields: ClassVar[Fields] = layout("F10 Rx", "F10 Ry", "F10 Rxy")

    @property
    def curvatures(self) -> tuple[float, float, float]:
        """1/Rx, 1/Ry and 1/Rxy, 1/length; 0 for an infinite radius."""
        radii = (self.radius_x, self.radius_y, self.radius_xy)
        x, y, xy = (1.0 / radius if radius else 0.0 for radius in radii)
        return x, y, xy


@dataclass(frozen=True)
class Expansion(Record):
    """CURE card: (I5,5X,4F10.0); free strains of a material along and across its fibres."""

    material: int = 1
    # Per kelvin.
    alpha1: float = 0.0
    alpha2: float = 0.0
    # Per per cent (weight) of moisture.
    beta1: float = 0.0
    beta2: float = 0.0

    THERMAL: ClassVar[tuple[str, ...]] = ("alpha1", "alpha2")
    MOISTURE: ClassVar[tuple[str, ...]] = ("beta1", "beta2")
    LARGEST: ClassVar[float] = 1e-3  # limit of the size of alpha1 and alpha2
    optional: ClassVar[int] = 2
    fields: ClassVar[Fields] = layout(
        "I5? material|mat", "X5", "F10 alpha1", "F10 alpha2", "F10 beta1", "F10 beta2"
    )


@dataclass(frozen=True)
class Cure(Segment, keyword="CURE"):
    """CURE: (2F10.0) and expansions; changes since the stress-free state.

    The report's program does not have this segment.
    """

    delta_t: float  # temperature of use minus stress-free temperature, K
    delta_c: float = 0.0  # absorbed moisture, per cent of weight
    expansions: tuple[Expansion, ...] = ()

    optional: ClassVar[int] = 1
    fields: ClassVar[Fields] = layout(
        "F10 change of temperature|delta T", "F10 change of moisture|delta C"
    )

    @classmethod
    def read(cls, head: Card, cards: CardStream) -> Self | None:
        """Read the changes and the expansions."""
        changes = cards.single(head, cls)
        return changes and replace(changes, expansions=cards.until_blank(head, Expansion))

    def cards(self, control: Control) -> Iterator[str]:
        """Return the text of the segment's cards."""
        yield from super().cards(control)
        for record in self.expansions:
            yield record.to_card()
        yield ""

    def strains(self, material: int) -> tuple[float, float]:
        """Return the free strains of a material along and across its fibres."""
        free = self.expansion(material) or Expansion()
        along = free.alpha1 * self.delta_t + free.beta1 * self.delta_c
        return along, free.alpha2 * self.delta_t + free.beta2 * self.delta_c

    def expansion(self, material: int) -> Expansion | None:
        """Return the expansion of a material; None if it has none."""
        return next((card for card in self.expansions if card.material == material), None)
