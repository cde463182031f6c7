"""Outline of a plate: sides of its elements, holes, supports, and distance between supports."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fecm._typing import Bools, Floats, Indices
from fecm.mechanics.interpolation import W
from fecm.mechanics.mesh import Ints, MeshArrays, extent

# Most nodes whose distances are compared.
FREE = 3000
SUPPORTED = 300


class Span(NamedTuple):
    """Length that the thickness is compared with."""

    length: float
    name: str  # what it is, in messages


def unsupported(mesh: MeshArrays, load: tuple[float, float] | None, whole: Floats) -> Span:
    """Return the distance between supports that counts for bending.

    It is the diameter of the largest circle around a node that contains no node with restrained w
    and, if there is a load, reaches it: the shorter distance between two supported sides, the
    diameter of a round window, or twice the length of a cantilever. Without supports it is the
    shorter side of the plate. `whole` has the nodes of the whole plate, (n, 2), where the mesh is a
    symmetric part of it.
    """
    places, held = mesh.coordinates[mesh.used], mesh.codes[mesh.used, W] != 0
    free, supports = places[~held], places[held]
    if not len(supports) or not len(free):
        low, high = extent(whole)
        return Span(float((high - low).min()), "plate's shorter side")
    free = free[:: -(-len(free) // FREE)]
    supports = supports[:: -(-len(supports) // SUPPORTED)]
    radii = np.hypot(*(free[:, None, :] - supports).transpose(2, 0, 1)).min(axis=1)
    if load is not None:
        reaching = np.hypot(*(free - load).T) <= radii
        radii = radii[reaching] if reaching.any() else radii
    return Span(2.0 * float(radii.max()), "distance between supports")


MID_SIDES = 4  # column of the node between the first two corners


class PlateSides(NamedTuple):
    """Sides of all elements, each once for every element that has it.

    Attributes
    ----------
    corners : ndarray of int, shape (n, 2)
        Rows of the nodes at the ends, ascending.
    elements : ndarray of int, shape (n,)
        Row of the element.
    numbers : ndarray of int, shape (n,)
        Number of the side; equal for the elements that share it.
    is_outline : ndarray of bool, shape (n,)
        Whether the side belongs to a single element.
    is_held : ndarray of bool, shape (n,)
        Whether supports hold the deflection w along it.
    """

    corners: Ints
    elements: Indices
    numbers: Indices
    is_outline: Bools
    is_held: Bools


def element_sides(mesh: MeshArrays) -> PlateSides:
    """Return the sides of the elements of a mesh."""
    corners, rows, held = [], [], []
    # Node 0 stands for an absent node, which is ignored.
    holds = np.concatenate([[True], mesh.codes[:, W] != 0])
    for block in mesh.families:
        count = block.shape.corners
        nodes = mesh.elements[block.rows]
        for side in range(count):
            ends = nodes[:, [side, (side + 1) % count]]
            between = nodes[:, MID_SIDES + side] if nodes.shape[1] > MID_SIDES + side else 0
            corners.append(np.sort(ends, axis=1) - 1)
            rows.append(block.rows)
            held.append(holds[ends].all(axis=1) & holds[between])
    ends, elements = np.concatenate(corners), np.concatenate(rows)
    keys = ends[:, 0].astype(np.int64) * (len(mesh.coordinates) + 1) + ends[:, 1]
    _, numbers, counts = np.unique(keys, return_inverse=True, return_counts=True)
    return PlateSides(ends, elements, numbers, counts[numbers] == 1, np.concatenate(held))


def holes(mesh: MeshArrays) -> int:
    """Count the holes of a plate: closed parts of its outline beyond one for each piece."""
    sides = element_sides(mesh)
    pieces, _ = _parts(len(mesh.elements), *_neighbours(sides, np.ones_like(sides.is_held)))
    ends = sides.corners[sides.is_outline]
    nodes, places = np.unique(ends, return_inverse=True)
    loops, _ = _parts(len(nodes), *places.reshape(ends.shape).T)
    return loops - pieces


def outside_supports(mesh: MeshArrays, symmetry: Sequence[Bools] = ()) -> Bools:
    """Return a mask of the elements outside the supports, such as the rim of a plate on a window.

    Lines of supports divide a plate into parts. A part lies outside if no support holds its
    outline, and supports hold all of another part's border. Lines of symmetry, given by masks of
    their nodes, are no outline.
    """
    outside = np.zeros(len(mesh.elements), dtype=bool)
    held = mesh.codes[:, W] != 0
    if not held.any() or held[mesh.used].all():
        return outside
    sides = element_sides(mesh)
    if not (sides.is_held & ~sides.is_outline).any():
        return outside
    count, part = _parts(len(mesh.elements), *_neighbours(sides, ~sides.is_held))
    has_free_outline, has_held_outline = np.zeros((2, count), dtype=bool)
    of_side = part[sides.elements]
    is_free = sides.is_outline & ~sides.is_held
    for line in symmetry:
        is_free &= ~line[sides.corners].all(axis=1)
    has_free_outline[of_side[is_free]] = True
    has_held_outline[of_side[sides.is_outline & sides.is_held]] = True
    # Elements whose nodes are all held, such as on a boss, do not count for the plate's span.
    nodes_held = np.concatenate([[True], held])[mesh.elements].all(axis=1)
    moves = np.zeros(count, dtype=bool)
    moves[part[~nodes_held]] = True
    if not (moves & ~has_free_outline).any():
        return outside
    return np.asarray((has_free_outline & ~has_held_outline)[part])


def _neighbours(sides: PlateSides, passable: Bools) -> tuple[Indices, Indices]:
    """Return the rows of the two elements at every shared side that is passable."""
    shared = np.flatnonzero(passable & ~sides.is_outline)
    shared = shared[np.argsort(sides.numbers[shared], kind="stable")]
    same = sides.numbers[shared[1:]] == sides.numbers[shared[:-1]]
    return sides.elements[shared[:-1][same]], sides.elements[shared[1:][same]]


def _parts(count: int, first: Indices, second: Indices) -> tuple[int, Indices]:
    """Return the number of connected parts of a graph, and the part of each vertex.

    SciPy has this too; its import takes 0.2 s, which reports and checks need not spend.
    """
    part = np.arange(count)  # every vertex points to a lower one of its part, or to itself
    while (part[first] != part[second]).any():
        ends = np.sort([part[first], part[second]], axis=0)
        np.minimum.at(part, ends[1], ends[0])
        while (part != part[part]).any():
            part = part[part]
    lowest, numbers = np.unique(part, return_inverse=True)
    return len(lowest), numbers.reshape(count)
