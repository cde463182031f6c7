"""Order of elements and nodes in the vectors of the compiled kernels.

The kernels process eight elements at a time.  Consecutive elements of a strip share a side, and
nodes are numbered along strips.  Eight elements of a strip therefore load and store consecutive
numbers.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fecm._typing import Bools, Floats
from fecm.mechanics.mesh import ElementBlock, distinct

Indices = NDArray[np.intp]

LANES = 8
# Largest number of elements in a chunk: the forces on their nodes stay in the cache.
CHUNK = 1024
# Number of elements of a strip that stay together.
PIECE = 4 * LANES


class Layout(NamedTuple):
    """Blocks of eight elements, and chunks of neighbouring blocks."""

    chunks: int  # number of chunks
    group: Indices  # (blocks,): group of each block
    chunk: Indices  # (blocks,): chunk of each block
    element: Indices  # (blocks, 8): number of the element, counted over all groups
    filled: Bools  # (blocks, 8): whether the lane has an element of its own
    chunk_of_element: Indices  # (elements,)
    piece: Indices  # (elements,): piece of a strip with the element, ascending with the chunks
    place: Indices  # (elements,): place in the piece
    axis: int  # axis along which the elements of a strip follow one another


class NodePlaces(NamedTuple):
    """Places of nodes in the vectors of the kernels."""

    node: Indices  # (places,): node at each place, chunk by chunk
    place_of_node: Indices  # place in its chunk of each node of each element, element by element
    starts: Indices  # (chunks + 2,): start of each chunk in `node`; the last chunk is in `home`
    # (chunks + 1,): number of the vectors' nodes before each chunk, and of the chunk's nodes with a
    # spare place.
    firsts: Indices
    sizes: Indices
    home: Indices  # (2, numnp): chunk and place of nodes that move independently, -1 for others


def kernel_layout(families: list[ElementBlock]) -> Layout:
    """Arrange the elements of groups in blocks, and the blocks in chunks of near elements."""
    counts = np.array([len(family.rows) for family in families])
    group = np.repeat(np.arange(len(families)), counts)
    # Strips run along the axis with more full blocks.
    strips = [_find_strips(families, axis) for axis in (0, 1)]
    axis = max((0, 1), key=lambda axis: int((np.bincount(strips[axis][0]) // LANES).sum()))
    strip, place = strips[axis]
    cells = strip * len(group) + place // PIECE
    piece = np.unique(cells, return_index=True, return_inverse=True)[2]
    place %= PIECE
    sizes = np.bincount(piece)
    centres = np.concatenate([family.coordinates.mean(axis=1) for family in families])
    middle = [np.bincount(piece, centres[:, i]) / sizes for i in (0, 1)]
    cut = _cut_into_chunks(np.stack(middle, axis=1), sizes)
    rank = np.empty(len(cut), dtype=np.intp)
    rank[np.argsort(cut, kind="stable")] = np.arange(len(cut))
    chunk, is_rest = cut[piece], place >= sizes[piece] // LANES * LANES
    piece = rank[piece]
    order = np.lexsort((place, piece, is_rest, group, chunk))
    run = (chunk * len(families) + group) * 2 + is_rest
    run_starts = np.flatnonzero(np.diff(run[order], prepend=-1))
    counts = np.diff(np.append(run_starts, len(order)))
    blocks = -(-counts // LANES)
    last = np.cumsum(blocks)
    of_run = np.repeat(np.arange(len(counts)), blocks * LANES)
    offset = np.arange(last[-1] * LANES) - LANES * (last - blocks)[of_run]
    element = order[run_starts[of_run] + np.minimum(offset, counts[of_run] - 1)].reshape(-1, LANES)
    first, filled = element[:, 0], (offset < counts[of_run]).reshape(-1, LANES)
    return Layout(
        int(cut.max()) + 1, group[first], chunk[first], element, filled, chunk, piece, place, axis
    )


def _find_strips(families: list[ElementBlock], axis: int) -> tuple[Indices, Indices]:
    """Return the strip of each element, and the place of the element in the strip.

    A strip consists of elements of one family; each element shares a side with the next.
    """
    parts: list[Indices] = []
    for family, before in zip(families, _starts(families), strict=True):
        after = _next_elements(family, axis)
        parts.append(np.where(after < 0, -1, after + before))
    follows = np.concatenate(parts)
    strip = np.full(len(follows), -1)
    place = np.zeros(len(follows), dtype=np.intp)
    current = np.flatnonzero(np.bincount(follows + 1, minlength=len(follows) + 1)[1:] == 0)
    number, step = np.arange(len(current)), 0
    while len(current):
        strip[current], place[current] = number, step
        current, step = follows[current], step + 1
        current, number = current[current >= 0], number[current >= 0]
    (rings,) = np.nonzero(strip < 0)
    strip[rings] = strip.max() + 1 + np.arange(len(rings))
    return strip, place


def _starts(families: list[ElementBlock]) -> Indices:
    """Return the number of elements before each family."""
    counts = np.array([len(family.rows) for family in families])
    return np.asarray(np.cumsum(counts) - counts)


def _next_elements(family: ElementBlock, axis: int) -> Indices:
    """Return the element that follows each element along an axis, (ne,); -1 if none follows."""
    shape, following = family.shape, np.full(len(family.rows), -1)
    along, across = (shape.xi, shape.eta) if axis == 0 else (shape.eta, shape.xi)
    side = [[np.flatnonzero((along == a) & (across == b)) for b in (-1, 1)] for a in (-1, 1)]
    if any(len(corner) != 1 for corners in side for corner in corners):
        return following
    # The corners are an element's first nodes.
    near, far = (family.nodes[:, np.concatenate(corners)] @ [2**31, 1] for corners in side)
    _, behind, before = np.intersect1d(near, far, return_indices=True)
    following[before] = behind
    return following


def _cut_into_chunks(centres: Floats, sizes: Indices) -> Indices:
    """Cut the plate into chunks of at most CHUNK elements; return the chunk of each piece."""
    chunk, count = np.zeros(len(sizes), dtype=np.intp), 0
    parts = [np.arange(len(sizes))]
    while parts:
        part = parts.pop()
        total = sizes[part].sum()
        if len(part) == 1 or total <= CHUNK:
            chunk[part], count = count, count + 1
            continue
        position = centres[part, np.argmax(np.ptp(centres[part], axis=0))]
        order = np.argsort(position, kind="stable")
        # Cut at the widest gap near the middle, between two rows of pieces.
        share = np.cumsum(sizes[part[order]])[:-1] / total
        gap = np.where(abs(share - 0.5) < 0.1, np.diff(position[order]), -abs(share - 0.5))
        half = int(np.argmax(gap)) + 1
        parts += [part[order[half:]], part[order[:half]]]
    return chunk


def places_of(layout: Layout, families: list[ElementBlock], leader: Indices) -> NodePlaces:
    """Assign places to the nodes of each chunk; the last chunk has the shared nodes.

    Along a strip, nodes with the same place in the elements follow one another.
    """
    numnp, keys, pairs = len(leader), [], []
    for family, before in zip(families, _starts(families), strict=True):
        members = slice(before, before + len(family.rows))
        levels = [
            np.unique(coordinate[family.present], return_index=True, return_inverse=True)[2]
            for coordinate in (family.shape.xi, family.shape.eta)
        ]
        along, across = levels[layout.axis], levels[1 - layout.axis]
        last = along == along.max()  # these nodes are the first of the next element
        line = layout.piece[members, None] * len(along) + across
        key = (line * len(along) + np.where(last, 0, along)) * (PIECE + 1)
        keys.append((key + layout.place[members, None] + last).ravel())
        pairs.append((layout.chunk_of_element[members, None] * numnp + family.nodes).ravel())
    order = np.argsort(np.concatenate(keys), kind="stable")
    pair_keys, first, inverse = np.unique(
        np.concatenate(pairs)[order], return_index=True, return_inverse=True
    )
    # Order the nodes by their first occurrence.
    is_first = np.zeros(len(order), dtype=bool)
    is_first[first] = True
    rank = (np.cumsum(is_first) - 1)[first]
    ordered = np.empty_like(pair_keys)
    ordered[rank] = pair_keys
    chunk, node = np.divmod(ordered, numnp)
    # A node of a single chunk is the chunk's own unless it follows a node or a node follows it.
    # All other nodes are shared.
    follows = node[leader[node] != node]
    is_own = np.bincount(node, minlength=numnp) == 1
    is_own[follows] = is_own[leader[follows]] = False
    shared = distinct(leader[node[~is_own[node]]])
    starts = np.searchsorted(chunk, np.arange(layout.chunks + 2))
    sizes = np.append(np.diff(starts)[:-1] + 1, len(shared))
    sizes += -sizes % LANES
    place = np.arange(len(node)) - starts[chunk]
    place_of_node = np.empty(len(order), dtype=np.intp)
    place_of_node[order] = place[rank][inverse]
    home = np.full((2, numnp), -1)
    has_home = is_own[node]
    home[:, node[has_home]] = chunk[has_home], place[has_home]
    home[:, shared] = np.broadcast_arrays(layout.chunks, np.arange(len(shared)))
    return NodePlaces(node, place_of_node, starts, np.cumsum(sizes) - sizes, sizes, home)
