"""What the printed program can't compute, and listing mode refuses for that reason."""

from __future__ import annotations

import numpy as np

from fecm.deck.findings import Findings
from fecm.deck.model import Deck, Material
from fecm.mechanics.mesh import Mesh
from fecm.problem.generate import place_of_element

# Layers that the listing's arrays hold (CNPD: QBR(3,3,25), TH(25)).
MOST_LAYERS = 25
ANOTHER_MODE = "run the deck in report mode"


def check_listing(deck: Deck, mesh: Mesh, findings: Findings) -> None:
    """Refuse meshes of several kinds of elements, and more layers than the listing's arrays hold.

    The listing's LMAS takes element 1's node list for all elements (MASS01 hands IX, not IX(1,N),
    to SHAPE), so that an element that lacks other nodes gets wrong masses or none.
    """
    present = mesh.elements != 0
    other = np.flatnonzero((present != present[:1]).any(axis=1))
    if len(other):
        number = int(other[0]) + 1
        findings.add(
            "E601",
            f"Element {number} has other nodes than element 1 ({present[number - 1].sum()} against "
            f"{present[0].sum()}): the printed program takes element 1's node list for the mass of "
            "every element.",
            place_of_element(deck, number),
            ANOTHER_MODE,
        )
    material = deck.require(Material)
    if len(material.layers) > MOST_LAYERS:
        findings.add(
            "E602",
            f"{len(material.layers)} layers are more than the {MOST_LAYERS} that the printed "
            "program has room for.",
            material.layers[MOST_LAYERS].place("layer"),
            ANOTHER_MODE,
        )
