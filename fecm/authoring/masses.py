"""Point masses of a new plate."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from fecm.authoring.mesh import AnyMesh
from fecm.authoring.parameters import (
    ObjectError,
    is_finite,
    lengths_in_units,
    parameter_in_units,
)
from fecm.deck.model import NodeValues, PointMasses
from fecm.deck.units import INERTIA, MASS

PlacedMass = Sequence[float | str]  # x, y, mass, and perhaps the rotary inertia


def masses_segment(
    masses: Iterable[PlacedMass], mesh: AnyMesh, doubts: list[str], system: str | None
) -> PointMasses | None:
    """Return the MASS segment of masses at the nodes nearest to their places; None without any.

    `doubts` gets a text about each mass that is not at its place.
    """
    of_nodes: dict[int, tuple[float, float]] = {}
    for item in masses:
        values = list(item) if not isinstance(item, str) and isinstance(item, Iterable) else []
        if len(values) not in (3, 4):
            raise ObjectError(f"`masses`: {item!r} is not x, y, mass and perhaps rotary inertia")
        x, y = lengths_in_units("masses", values[:2], 2, system)
        mass = parameter_in_units("masses", values[2], MASS, system)
        inertia = parameter_in_units("masses", (*values, 0.0)[3], INERTIA, system)
        if not (is_finite(mass) and mass > 0.0 and is_finite(inertia) and inertia >= 0.0):
            raise ObjectError(f"`masses`: the mass at {x:g}, {y:g} is not positive")
        low, high = mesh.extent
        if not (low[0] <= x <= high[0] and low[1] <= y <= high[1]):
            raise ObjectError(f"`masses`: {x:g}, {y:g} is outside the plate")
        node, node_x, node_y = mesh.nearest(x, y)
        distance = math.hypot(node_x - x, node_y - y)
        if distance > 1e-9 * max(map(abs, (*low, *high))):
            doubts.append(
                f"the mass at {x:g}, {y:g} is moved by {distance:.4g} to the nearest node, {node} "
                f"at {node_x:g}, {node_y:g}"
            )
        total, of_rotation = of_nodes.get(node, (0.0, 0.0))
        of_nodes[node] = total + mass, of_rotation + inertia
    cards = [NodeValues(node, 0, values) for node, values in sorted(of_nodes.items())]
    return PointMasses(tuple(cards)) if cards else None
