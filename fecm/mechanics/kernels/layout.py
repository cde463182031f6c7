"""Order of elements and nodes in the vectors of the compiled kernels.

Elements are taken eight at a time.  In a strip they share sides one after another, and nodes are
numbered along strips: eight elements of a strip load and store numbers that follow one another.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fecm._typing import Bools, Floats
from fecm.mechanics.mesh import ElementBlock, distinct

Indices = NDArray[np.intp]

LANES = 8
# Largest number of elements of a chunk: the forces on their nodes stay in the cache.
CHUNK = 1024
# Elements of a strip that stay together.
PIECE = 4 * LANES


class Layout(NamedTuple):
    """Blocks of eight elements, and chunks of blocks that are near each other."""

    chunks: int
    group: Indices  # (blocks,)
    chunk: Indices  # (blocks,)
    element: Indices  # (blocks, 8): number of the element among those of all groups
    filled: Bools  # (blocks, 8): whether the lane has an element of its own
    at: Indices  # (elements,): chunk of each element
    piece: Indices  # (elements,): number of its strip's piece, ascending with the chunks
    place: Indices  # (elements,): place in the piece
    axis: int  # along which the elements of a strip follow one another


class NodePlaces(NamedTuple):
    """Places of nodes in the vectors of the kernels."""

    node: Indices  # (places,): node of each, chunk by chunk
    at: Indices  # of the nodes of all elements, one after another: place in their chunk
    starts: Indices  # (chunks + 2,): of each chunk in `node`; the last one has its nodes in `home`
    # (chunks + 1,): nodes of the vectors before each chunk, and its own with room for another one.
    firsts: Indices
    sizes: Indices
    home: Indices  # (2, numnp): chunk and place of nodes that move independently; otherwise -1


def kernel_layout(families: list[ElementBlock]) -> Layout:
    """Put the elements of groups into blocks, and the blocks into chunks of near elements."""
    counts = np.array([len(family.rows) for family in families])
    group = np.repeat(np.arange(len(families)), counts)
    # Along the axis with more blocks of elements that follow one another.
    strips = [_strips(families, axis) for axis in (0, 1)]
    axis = max((0, 1), key=lambda axis: int((np.bincount(strips[axis][0]) // LANES).sum()))
    strip, place = strips[axis]
    cells = strip * len(group) + place // PIECE
    piece = np.unique(cells, return_index=True, return_inverse=True)[2]
    place %= PIECE
    sizes = np.bincount(piece)
    centres = np.concatenate([family.coordinates.mean(axis=1) for family in families])
    middle = [np.bincount(piece, centres[:, i]) / sizes for i in (0, 1)]
    cut = _cut(np.stack(middle, axis=1), sizes)
    rank = np.empty(len(cut), dtype=np.intp)
    rank[np.argsort(cut, kind="stable")] = np.arange(len(cut))
    chunk, late = cut[piece], place >= sizes[piece] // LANES * LANES
    piece = rank[piece]
    order = np.lexsort((place, piece, late, group, chunk))
    run = (chunk * len(families) + group) * 2 + late
    begins = np.flatnonzero(np.diff(run[order], prepend=-1))
    counts = np.diff(np.append(begins, len(order)))
    blocks = -(-counts // LANES)
    last = np.cumsum(blocks)
    of_run = np.repeat(np.arange(len(counts)), blocks * LANES)
    offset = np.arange(last[-1] * LANES) - LANES * (last - blocks)[of_run]
    element = order[begins[of_run] + np.minimum(offset, counts[of_run] - 1)].reshape(-1, LANES)
    one, filled = element[:, 0], (offset < counts[of_run]).reshape(-1, LANES)
    return Layout(
        int(cut.max()) + 1, group[one], chunk[one], element, filled, chunk, piece, place, axis
    )


def _strips(families: list[ElementBlock], axis: int) -> tuple[Indices, Indices]:
    """Strip of each element, and its place in it: elements of a family that share sides."""
    parts: list[Indices] = []
    for family, before in zip(families, _starts(families), strict=True):
        after = _following(family, axis)
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
    """Number of elements before those of each family."""
    counts = np.array([len(family.rows) for family in families])
    return np.asarray(np.cumsum(counts) - counts)


def _following(family: ElementBlock, axis: int) -> Indices:
    """Element behind the side at the end of an axis of each element, (ne,); -1 if there is none."""
    shape, found = family.shape, np.full(len(family.rows), -1)
    along, across = (shape.xi, shape.eta) if axis == 0 else (shape.eta, shape.xi)
    side = [[np.flatnonzero((along == a) & (across == b)) for b in (-1, 1)] for a in (-1, 1)]
    if any(len(corner) != 1 for corners in side for corner in corners):
        return found
    # Corners have the first numbers of an element's nodes.
    near, far = (family.nodes[:, np.concatenate(corners)] @ [2**31, 1] for corners in side)
    _, behind, before = np.intersect1d(near, far, return_indices=True)
    found[before] = behind
    return found


def _cut(centres: Floats, sizes: Indices) -> Indices:
    """Chunk of each piece, (pieces,): parts of the plate with at most CHUNK elements."""
    chunk, count = np.zeros(len(sizes), dtype=np.intp), 0
    parts = [np.arange(len(sizes))]
    while parts:
        part = parts.pop()
        total = sizes[part].sum()
        if len(part) == 1 or total <= CHUNK:
            chunk[part], count = count, count + 1
            continue
        at = centres[part, np.argmax(np.ptp(centres[part], axis=0))]
        order = np.argsort(at, kind="stable")
        # At the widest gap of those near the middle, between two rows of pieces.
        share = np.cumsum(sizes[part[order]])[:-1] / total
        gap = np.where(abs(share - 0.5) < 0.1, np.diff(at[order]), -abs(share - 0.5))
        half = int(np.argmax(gap)) + 1
        parts += [part[order[half:]], part[order[:half]]]
    return chunk


def places_of(layout: Layout, families: list[ElementBlock], leader: Indices) -> NodePlaces:
    """Number the nodes of each chunk, and in the last one those that others share.

    Along a strip, nodes with the same place in the elements follow one another.
    """
    numnp, keys, pairs = len(leader), [], []
    for family, before in zip(families, _starts(families), strict=True):
        members = slice(before, before + len(family.rows))
        levels = [
            np.unique(at[family.present], return_index=True, return_inverse=True)[2]
            for at in (family.shape.xi, family.shape.eta)
        ]
        along, across = levels[layout.axis], levels[1 - layout.axis]
        last = along == along.max()  # the first of the next element
        line = layout.piece[members, None] * len(along) + across
        key = (line * len(along) + np.where(last, 0, along)) * (PIECE + 1)
        keys.append((key + layout.place[members, None] + last).ravel())
        pairs.append((layout.at[members, None] * numnp + family.nodes).ravel())
    order = np.argsort(np.concatenate(keys), kind="stable")
    found, first, which = np.unique(
        np.concatenate(pairs)[order], return_index=True, return_inverse=True
    )
    # In the order in which they come first.
    begins = np.zeros(len(order), dtype=bool)
    begins[first] = True
    rank = (np.cumsum(begins) - 1)[first]
    ordered = np.empty_like(found)
    ordered[rank] = found
    chunk, node = np.divmod(ordered, numnp)
    # Nodes of one chunk alone that nothing follows are its own; the others are shared.
    follows = node[leader[node] != node]
    own = np.bincount(node, minlength=numnp) == 1
    own[follows] = own[leader[follows]] = False
    shared = distinct(leader[node[~own[node]]])
    starts = np.searchsorted(chunk, np.arange(layout.chunks + 2))
    sizes = np.append(np.diff(starts)[:-1] + 1, len(shared))
    sizes += -sizes % LANES
    place = np.arange(len(node)) - starts[chunk]
    at = np.empty(len(order), dtype=np.intp)
    at[order] = place[rank][which]
    home = np.full((2, numnp), -1)
    mine = own[node]
    home[:, node[mine]] = chunk[mine], place[mine]
    home[:, shared] = np.broadcast_arrays(layout.chunks, np.arange(len(shared)))
    return NodePlaces(node, at, starts, np.cumsum(sizes) - sizes, sizes, home)
