"""Model of a deck: plain typed objects without mechanics.

A :class:`Deck` is one problem of a file: its control card, its segments in their order, and its
macro program. It has the values of the cards only; :mod:`fecm.problem.generate` generates the
nodes and elements between the cards.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from textwrap import shorten
from typing import TYPE_CHECKING, TypeVar, Unpack

from fecm._methods import function_of
from fecm._table import html_summary
from fecm.deck.card import Control, Record
from fecm.deck.impact_cards import Impact, Indentation, Patch, Projectile, RodDiameter
from fecm.deck.macros import LoadTable, Macro
from fecm.deck.material_cards import (
    MATERIAL,
    Allowables,
    Cure,
    Curvature,
    Damping,
    Delamination,
    Expansion,
    Integration,
    Layer,
    Material,
    Nonlinear,
    Ply,
    Preload,
    Shear,
)
from fecm.deck.mesh_cards import (
    Boundary,
    Coordinates,
    ElementNodes,
    Elements,
    Forces,
    NodeCodes,
    NodeValues,
)
from fecm.deck.output_cards import Compact, Gage, Gages, Page, PrintOption, Units
from fecm.deck.segment import NumberedSegment, Segment
from fecm.deck.support_cards import OneSidedSupport, OneSidedSupports, PointMasses, Springs
from fecm.deck.zone_cards import (
    LaminateNumber,
    Laminates,
    MaterialNumber,
    Materials,
    NumberedLaminate,
    NumberedPly,
    Zone,
    Zones,
)

if TYPE_CHECKING:
    from fecm.authoring.changes import Values

__all__ = [
    "Allowables", "Boundary", "Compact", "Control", "Coordinates", "Cure", "Curvature", "Damping",
    "Deck", "Delamination", "ElementNodes", "Elements", "Expansion", "Forces", "Gage", "Gages",
    "Impact", "Indentation", "Integration", "LaminateNumber", "Laminates", "Layer", "LoadTable",
    "Macro", "Material", "MaterialNumber", "Materials", "NodeCodes", "NodeValues", "Nonlinear",
    "NumberedLaminate", "NumberedPly", "NumberedSegment", "OneSidedSupport", "OneSidedSupports",
    "Page", "Patch", "Ply", "PointMasses", "Preload", "PrintOption", "Projectile", "Record",
    "RodDiameter", "Segment", "Shear", "Springs", "Units", "Zone", "Zones",
]  # fmt: skip

TITLE = "FECM"
MACROS = "MACR"
END = "END"
STOP = "STOP"
# Segments by keyword, in the order in which messages name them.
SEGMENTS: dict[str, type[Segment]] = {
    "COOR": Coordinates,
    "ELEM": Elements,
    "BOUN": Boundary,
    "SPRI": Springs,
    "UNIL": OneSidedSupports,
    "MASS": PointMasses,
    "MATE": Material,
    "MATS": Materials,
    "LAMS": Laminates,
    "ZONE": Zones,
    "ROD": Impact,
    "EXPE": Indentation,
    "FORC": Forces,
    "PROJ": Projectile,
    "SHEA": Shear,
    "PATC": Patch,
    "ALLO": Allowables,
    "DELA": Delamination,
    "DAMP": Damping,
    "NONL": Nonlinear,
    "PREL": Preload,
    "CURV": Curvature,
    "CURE": Cure,
    "GAGE": Gages,
    "UNIT": Units,
    "COMP": Compact,
    "PRIN": PrintOption,
    "NOPR": PrintOption,
    "PAGE": Page,
}
_S = TypeVar("_S", bound=Segment)


@dataclass(frozen=True)
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
        Cards of the problem as written, ended by STOP; empty for a deck built in Python.
    comments : str
        Comment lines above the title card; meaningless without `text`.
    """

    title: str
    control: Control
    segments: tuple[Segment, ...]
    macros: tuple[Macro, ...]
    tables: tuple[LoadTable, ...] = ()
    text: str = field(default="", compare=False, repr=False)
    comments: str = field(default="", compare=False, repr=False)

    def __repr__(self) -> str:
        sizes = f"{self.control.numnp} nodes, {self.control.numel} elements"
        return f"<fecm deck {self.title!r}, {sizes}, {len(self.macros)} macros>"

    def _repr_html_(self) -> str:
        """Return a table of segments and macros, for notebooks."""
        segments = " ".join(segment.keyword for segment in self.segments)
        macros = " ".join(macro.word for macro in self.macros)
        rows = (("segments", shorten(segments, 200)), ("macros", shorten(macros, 200)))
        return html_summary(self, rows)

    @property
    def nonlinear_words(self) -> str:
        """Keywords of the segments by which the motion is not linear in the loads; "" if it is."""
        words = (segment.keyword for segment in self.segments if segment.is_nonlinear)
        return " and ".join(dict.fromkeys(words))

    @property
    def is_linear(self) -> bool:
        """Whether the motion of the plate is linear in its loads."""
        return not self.nonlinear_words

    def has(self, kind: type[Segment]) -> bool:
        """Return whether the deck has a segment of one kind."""
        return any(isinstance(segment, kind) for segment in self.segments)

    def all(self, kind: type[_S]) -> list[_S]:
        """Return every segment of one kind, in the deck's order."""
        return [segment for segment in self.segments if isinstance(segment, kind)]

    def last(self, kind: type[_S]) -> _S | None:
        """Return the last segment of one kind, the effective one; None if the deck has none."""
        segments = self.all(kind)
        return segments[-1] if segments else None

    def require(self, kind: type[_S]) -> _S:
        """Return the effective segment of one kind.

        Raises
        ------
        LookupError
            If the deck has no such segment.
        """
        if (segment := self.last(kind)) is None:
            raise LookupError(f"the deck has no {kind.keyword} segment")
        return segment

    @property
    def plies(self) -> dict[int, Ply]:
        """Constants of the materials by number: 1 from MATE, the others from MATS.

        Raises LookupError if there is no MATE segment.
        """
        card = self.last(Materials)
        mats_plies = {} if card is None else {item.number: item.ply for item in card.plies}
        return mats_plies | {MATERIAL: self.require(Material).ply}

    @property
    def layers(self) -> dict[int, tuple[Layer, ...]]:
        """Layers of the laminates by number: 1 from MATE, the others from LAMS.

        Without ZONE, laminate 1 is the only one. Raises LookupError if there is no MATE segment.
        """
        layers = {MATERIAL: self.require(Material).layers}
        card = self.last(Laminates)
        if card is not None and self.has(Zones):
            layers |= {laminate.number: laminate.layers for laminate in card.laminates}
        return layers

    def with_(self, **values: Unpack[Values]) -> Deck:
        """Return the deck with other values or parts. :func:`fecm.sweep` varies the same names.

        Parts are replaced before values:

        - A `plate` is struck in its middle, or at `at`.
        - A `laminate` of named plies brings their strengths, toughness and expansions where the
          deck has such cards.
        - A `projectile` keeps the velocity of the deck, unless `velocity` or `energy` is given.
        - A `contact` may be an estimate; it is then made for the new laminate.

        ``nonlinear=False`` removes NONL.

        A new `plate` or `laminate` changes the time step if it is 0, or the one that
        :func:`fecm.impact` chooses for the old plate. Any other time step stays, also if values
        change the plate. ``dt="auto"`` takes 0.9 of the critical time step.

        Parameters
        ----------
        **values : float or str or sequence or object
            Values in the units of the deck. If the deck names its units, energy, velocity, duration
            and preload may have another unit: ``"10J"``, or a quantity of pint.

        Raises
        ------
        ValueError
            If a name is unknown, or a value is invalid for this deck.

        Examples
        --------
        >>> import fecm
        >>> deck = fecm.read_one("decks/impact-115.inp")
        >>> deck.with_(velocity=60, layup=[0, 90, 90, 0]).control.layers
        4
        >>> "PROJ" in deck.with_(projectile=fecm.RigidMass(1e-4)).to_text()
        True
        """
        changed: Deck = function_of("Deck.with_")(self, values)
        return changed

    def with_program(
        self,
        macros: str | Sequence[Macro] | None = None,
        *,
        every: int | None = None,
        plies: int | bool | tuple[int, int] | None = None,
        failure: int | bool | None = None,
    ) -> Deck:
        r"""Return the deck with another macro program, or with other stored rows.

        Parameters
        ----------
        macros : str or sequence of Macro, optional
            The cards between MACR and END; by default the program of the deck. In a text, END and
            the load tables of PROP may follow. Without them, the tables of the deck stay.
        every : int, optional
            Steps between stored rows of contact, strains and displacements (RODP, DISP).
        plies : int or bool or tuple of int, optional
            Steps between stored ply stresses (PLYS). True stores about 20 rows, False none. The
            second number of a pair stores only that many elements, those nearest to the load.
        failure : int or bool, optional
            Steps between evaluations of the failure criteria (FAIL); they need strengths (ALLO).
            True takes the number of RODP, False removes FAIL.

        Raises
        ------
        ValueError
            If a number is not whole and positive.
        DeckError
            If a text is not a macro program.

        Examples
        --------
        >>> import fecm
        >>> deck = fecm.read_one("decks/impact-115.inp")
        >>> [macro.word for macro in deck.with_program(plies=50).macros]
        ['LMAS', 'DT', 'LOOP', 'TIME', 'RODP', 'DISP', 'PLYS', 'NEXT']
        >>> [macro.value for macro in deck.with_program("LMAS\nEIGE,3").macros]
        [0.0, 3.0]
        """
        changed: Deck = function_of("Deck.with_program")(
            self, macros, every=every, plies=plies, failure=failure
        )
        return changed

    def to_text(self) -> str:
        """Return the problem as cards, ended by STOP. Reading them gives the same model.

        Raises
        ------
        ValueError
            If a number is not finite.
        """
        lines = [f"{TITLE} {self.title}".rstrip(), self.control.to_card()]
        for segment in self.segments:
            lines.extend(segment.cards(self.control))
        lines += [END, MACROS, *(macro.to_card() for macro in self.macros), END]
        lines += [*(table.to_card() for table in self.tables), STOP]
        return "\n".join(lines) + "\n"
