"""The contact patch of a deck."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fecm._typing import Floats
from fecm.deck.model import Deck, Impact, Material, Patch
from fecm.mechanics.mesh import Mesh
from fecm.mechanics.patch import RADIUS_PER_THICKNESS, patch_weights
from fecm.mechanics.symmetry import half_turn_images

# Dof w, from 0.
W = 2


@dataclass(frozen=True)
class ContactPatch:
    """Circle on which the contact force acts, and its nodal weights."""

    shape: str  # ``"DISC"`` or ``"HERT"``
    # Radius and centre, length.
    radius: float
    x: float
    y: float
    weights: Floats  # (numnp,): shares of the nodes in a unit force; 0 where w is restrained


def contact_patch(deck: Deck, mesh: Mesh) -> ContactPatch | None:
    """Return the contact patch of a deck on a sound mesh; None without a PATC segment.

    Raises PatchError if the patch is not entirely on the plate.
    """
    card = deck.last(Patch)
    if card is None:
        return None
    radius = card.radius
    if radius is None:
        radius = RADIUS_PER_THICKNESS[card.shape] * deck.require(Material).integration.thickness
    if card.x is None or card.y is None:
        x, y = mesh.coordinates[deck.require(Impact).node - 1].tolist()
    else:
        x, y = card.x, card.y
    weights = patch_weights(mesh, card.shape, radius, x, y)
    images = half_turn_images(mesh.coordinates)
    if images is not None and np.allclose(weights, weights[images], 0.0, 1e-12):
        weights = (weights + weights[images]) / 2.0  # exactly symmetric
    return ContactPatch(card.shape, radius, x, y, np.where(mesh.codes[:, W] == 0, weights, 0.0))
