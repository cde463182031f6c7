"""Cards of the mesh: coordinates, elements, restraints and nodal loads."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from fecm.deck.card import Control, Fields, Record, layout
from fecm.deck.segment import NumberedSegment

AXES = ("x", "y", "z")
DOF_NAMES = ("u", "v", "w", "theta_x", "theta_y")
NODES_AN_ELEMENT = (3, 12)  # smallest and largest number of nodes per element
NODE = ("I5 node", "I5 increment|incr")  # first fields of a card of a node


@dataclass(frozen=True)
class NodeValues(Record):
    """COOR or FORC card: values at a node, and the step between nodes generated after it."""

    node: int
    increment: int
    values: tuple[float, ...]

    packed: ClassVar[slice] = slice(2, None)


@dataclass(frozen=True)
class NodeCodes(Record):
    """BOUN card: restraint codes of a node; a negative code extends to generated nodes."""

    node: int
    increment: int
    codes: tuple[int, ...]

    packed: ClassVar[slice] = slice(2, None)


@dataclass(frozen=True)
class ElementNodes(Record):
    """ELEM card: nodes of an element, 0 if absent, and the step for generated elements."""

    element: int
    nodes: tuple[int, ...]
    increment: int

    packed: ClassVar[slice] = slice(1, -1)


@dataclass(frozen=True)
class Coordinates(NumberedSegment[NodeValues], keyword="COOR", record=NodeValues):
    """COOR: (2I5,7F10.0); the NDM coordinates of the nodes (length)."""

    @classmethod
    def card_fields(cls, control: Control) -> Fields:
        """Return the fields of a card."""
        return layout(*NODE, *(f"F10 {axis}-coordinate|{axis}" for axis in AXES[: control.ndm]))


@dataclass(frozen=True)
class Elements(NumberedSegment[ElementNodes], keyword="ELEM", record=ElementNodes):
    """ELEM: (16I5); nodes of the elements; the increment follows the last of the NEN nodes."""

    @classmethod
    def card_fields(cls, control: Control) -> Fields:
        """Return the fields of a card."""
        nodes = (f"I5 node {i}|n{i}" for i in range(1, control.nen + 1))
        return layout("I5 element|elm", *nodes, "I5 increment|incr")

    @classmethod
    def is_last(cls, record: Record, control: Control) -> bool:
        """Return whether a card defines the last element; no blank card must follow it."""
        return isinstance(record, ElementNodes) and record.element >= control.numel


@dataclass(frozen=True)
class Boundary(NumberedSegment[NodeCodes], keyword="BOUN", record=NodeCodes):
    """BOUN: (16I5); restraint codes of the nodes; a dof with a code other than 0 is restrained."""

    @classmethod
    def card_fields(cls, control: Control) -> Fields:
        """Return the fields of a card."""
        return layout(*NODE, *(f"I5 code {i}|c{i}" for i in range(1, control.ndf + 1)))


@dataclass(frozen=True)
class Forces(NumberedSegment[NodeValues], keyword="FORC", record=NodeValues):
    """FORC: (2I5,7F10.0); nodal forces, or displacements of restrained dofs."""

    @classmethod
    def card_fields(cls, control: Control) -> Fields:
        """Return the fields of a card."""
        return layout(*NODE, *(f"F10 value {i}" for i in range(1, control.ndf + 1)))
