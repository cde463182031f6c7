"""Distance between the supports of a plate."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fecm.mechanics.mesh import Mesh, extent
from fecm.problem.parts import W

# Most nodes whose distances are compared.
FREE = 3000
SUPPORTED = 300


class Span(NamedTuple):
    """Length to compare the thickness with."""

    length: float
    name: str  # what it is, in messages


def unsupported(mesh: Mesh, load: tuple[float, float] | None) -> Span:
    """Distance between supports that counts for bending.

    Diameter of the largest circle around a node that has no node with restrained w in it and
    reaches the load, if there is one: the shorter distance between two supported sides, the
    diameter of a round window, twice the length of a cantilever.  Without supports the shorter
    side of the plate.
    """
    places, held = mesh.coordinates[mesh.used], mesh.codes[mesh.used, W] != 0
    free, supports = places[~held], places[held]
    if not len(supports) or not len(free):
        low, high = extent(places)
        return Span(float((high - low).min()), "plate's shorter side")
    free = free[:: -(-len(free) // FREE)]
    supports = supports[:: -(-len(supports) // SUPPORTED)]
    radii = np.hypot(*(free[:, None, :] - supports).transpose(2, 0, 1)).min(axis=1)
    if load is not None:
        reaching = np.hypot(*(free - load).T) <= radii
        radii = radii[reaching] if reaching.any() else radii
    return Span(2.0 * float(radii.max()), "distance between supports")
