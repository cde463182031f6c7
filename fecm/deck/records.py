"""Names of records, which live beside the segments that they belong to."""

from fecm.deck.impact_cards import RodDiameter
from fecm.deck.macros import LoadTable, Macro, load_factor
from fecm.deck.material_cards import Integration, Layer, Ply
from fecm.deck.mesh_cards import (
    AXES,
    DOF_NAMES,
    NODES_AN_ELEMENT,
    ElementNodes,
    NodeCodes,
    NodeValues,
)
from fecm.deck.output_cards import Gage
from fecm.deck.record import Control, Record

__all__ = [
    "AXES", "DOF_NAMES", "NODES_AN_ELEMENT", "Control", "ElementNodes", "Gage", "Integration",
    "Layer", "LoadTable", "Macro", "NodeCodes", "NodeValues", "Ply", "Record", "RodDiameter",
    "load_factor",
]  # fmt: skip
