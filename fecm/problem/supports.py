"""Springs, one-sided supports and point masses of a deck, at the nodes of its mesh.

A line has the stiffness k' per length on each of its sides of length L: with Simpson's weights
k' L (1, 4, 1)/6 on a side of three nodes, k' L/2 at both ends of a side of two. Stiffnesses of the
same dof add up; two gaps are two supports.

The default stiffness of a one-sided support is

    k = 0.05 4 m/dt^2,

where m is the lumped mass of the node and dt the time step below which the plate alone is stable:
it is stiff, and shortens the step by at most 2.4 %.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from fecm._errors import FecmError
from fecm._typing import Floats, Indices
from fecm.deck import model
from fecm.deck.findings import Findings
from fecm.deck.model import Deck, NodeValues, OneSidedSupport, OneSidedSupports, Springs
from fecm.mechanics.interpolation import NDOF, W
from fecm.mechanics.joints import sides_of
from fecm.mechanics.mesh import MeshArrays, extent
from fecm.mechanics.plate import PlateModel
from fecm.mechanics.supports import NodeSupports, one_sided, side_weights
from fecm.mechanics.symmetry import half_turn_images
from fecm.mechanics.time_step import safe_time_step
from fecm.problem.generate import node_values

DEFAULT_SHARE = 0.05  # of the stiffness 4 m/dt^2 that halves the square of the time step
SAME_PLACE = 1e-6  # distance of a node from a line, over the size of the mesh


class NoLineError(FecmError, ValueError):
    """No chain of element sides covers a line."""


class OneSidedRow(NamedTuple):
    """One-sided support of a node."""

    node: int  # from 0
    side: float
    stiffness: float  # 0: the default
    gap: float


def line_weights(mesh: MeshArrays, first: int, last: int) -> tuple[Indices, Floats]:
    """Return the nodes of a straight line of element sides, and the length that each stands for.

    Parameters
    ----------
    mesh : MeshArrays
        Complete mesh.
    first, last : int
        Nodes at the ends of the line, from 1.

    Returns
    -------
    tuple of ndarray (n,)
        Nodes from 0, ascending, and the integrals of their shape functions along the line, length.

    Raises
    ------
    NoLineError
        If the sides of elements do not cover the line.
    """
    places = mesh.coordinates[:, :2]
    start, end = places[first - 1], places[last - 1]
    length = float(np.hypot(*(end - start)))
    low, high = extent(mesh.coordinates)
    near = SAME_PLACE * float((high - low).max())
    if not length > near:
        raise NoLineError(f"the nodes {first} and {last} are in the same place")
    along = (end - start) / length
    offset = places - start
    position, distance = offset @ along, np.abs(offset[:, 0] * along[1] - offset[:, 1] * along[0])
    on_line = (distance <= near) & (position >= -near) & (position <= length + near)
    sides = sides_of(mesh.families, mesh.elements)
    ends, middle = sides.ends, sides.between[:, 0]
    keys = np.column_stack([np.sort(ends, axis=1), middle])[on_line[ends].all(axis=1)]
    keys = np.unique(keys, axis=0)  # two elements share a side
    sizes = np.abs(np.diff(position[keys[:, :2]], axis=1)[:, 0])
    if abs(sizes.sum() - length) > near:
        raise NoLineError(f"element sides do not cover the line from node {first} to {last}")
    weights = side_weights(keys[:, :2], keys[:, 2], sizes, len(places))
    (nodes,) = np.nonzero(weights)
    return nodes, weights[nodes]


def spring_stiffness(deck: Deck, mesh: MeshArrays, findings: Findings | None = None) -> Floats:
    """Return the stiffness of the springs of SPRI at all dofs, (numnp, 5)."""
    total = np.zeros((len(mesh.coordinates), NDOF))
    for segment in deck.all(Springs):
        if segment.is_of_lines:
            for line in segment.records:
                nodes, weights = line_weights(mesh, line.node, line.increment)
                total[nodes] += weights[:, None] * line.values
        else:
            total += node_values(segment.records, total.shape, findings)
    return total


def point_masses(deck: Deck, numnp: int, findings: Findings | None = None) -> Floats:
    """Return the masses of MASS at all dofs, (numnp, 5): the rotary inertia at both rotations."""
    values = np.zeros((numnp, 2))
    for segment in deck.all(model.PointMasses):
        values += node_values(segment.records, values.shape, findings)
    mass, inertia = values.T
    return np.column_stack([mass, mass, mass, inertia, inertia])


def one_sided_rows(
    deck: Deck, mesh: MeshArrays, findings: Findings | None = None
) -> list[OneSidedRow]:
    """Return the one-sided supports of UNIL, those of equal node, side and gap as one."""
    stiffness: dict[tuple[int, float, float], float] = {}
    for segment in deck.all(OneSidedSupports):
        for node, side, k, gap in _rows_of(segment, mesh, findings):
            key = int(node), 1.0 if side == 0.0 else float(side), float(gap)
            stiffness[key] = stiffness.get(key, 0.0) + float(k)
    return [OneSidedRow(node, side, k, gap) for (node, side, gap), k in sorted(stiffness.items())]


def _rows_of(
    segment: OneSidedSupports, mesh: MeshArrays, findings: Findings | None
) -> Iterator[Sequence[float]]:
    """Yield node, side, stiffness and gap of the nodes of a segment."""
    if segment.is_of_lines:
        for line in segment.records:
            nodes, weights = line_weights(mesh, line.node, line.increment)
            for node, weight in zip(nodes.tolist(), weights.tolist(), strict=True):
                yield node, line.side, weight * line.stiffness, line.gap
        return
    records = [_as_values(record) for record in segment.records]
    generated = node_values(records, (len(mesh.coordinates), 3), findings, blank=np.nan)
    for node in np.flatnonzero(~np.isnan(generated[:, 0])).tolist():
        yield node, *generated[node].tolist()


def _as_values(record: OneSidedSupport) -> NodeValues:
    values = (float(record.side or 1), record.stiffness, record.gap)
    return NodeValues(record.node, record.increment, values, source=record.source)


def report_unknown_nodes(deck: Deck, mesh: MeshArrays, findings: Findings) -> None:
    """Report cards of nodes that do not exist; the lines exist."""
    point_masses(deck, len(mesh.coordinates), findings)
    spring_stiffness(deck, mesh, findings)
    one_sided_rows(deck, mesh, findings)


def node_supports(deck: Deck, plate: PlateModel) -> NodeSupports | None:
    """Return the springs and one-sided supports of a deck on its plate without them; None if none.

    Supports of restrained dofs are without effect and left out.
    """
    if not (deck.has(Springs) or deck.has(OneSidedSupports)):
        return None
    mesh = plate.mesh
    springs = np.where(mesh.equations > 0, spring_stiffness(deck, mesh), 0.0)
    node, dof = np.nonzero(springs)
    zeros = np.zeros(len(node))
    rows = [row for row in one_sided_rows(deck, mesh) if mesh.equations[row.node, W] > 0]
    lifting, side, stiffness, gap = np.array(rows, dtype=float).reshape(-1, 4).T
    nodes = lifting.astype(np.intp)
    if not stiffness.all():
        default = default_stiffness(plate, safe_time_step(plate))[nodes]
        stiffness = np.where(stiffness == 0.0, default, stiffness)
    springs_alone = NodeSupports(node, dof, zeros, springs[node, dof], zeros)
    supports = springs_alone.joined(one_sided(nodes, side, stiffness, gap))
    images = half_turn_images(mesh.coordinates)
    return supports if images is None else supports.symmetric(images)


def default_stiffness(plate: PlateModel, safe_step: float) -> Floats:
    """Return the default stiffness of a one-sided support at every node, (numnp,), force/length.

    `safe_step` is a lower bound of the critical time step of the plate without it.
    """
    mass = plate.field(plate.mass, 0.0)[:, W]
    return np.asarray(DEFAULT_SHARE * 4.0 * mass / safe_step**2)


def closed_in_words(supports: NodeSupports, field: Floats) -> str:
    """Say which one-sided supports count as springs at a displacement field, (numnp, 5)."""
    rows = supports.select(supports.is_one_sided)
    opened = int(np.count_nonzero(~rows.closed(rows.of(field))))
    count = f"the {len(rows.node)} one-sided supports (UNIL)"
    if opened:
        return f"{opened} of {count} are open; the closed ones also pull"
    return f"{count} are all closed, and also pull"
