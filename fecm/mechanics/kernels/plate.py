"""A plate for the compiled kernels: its vectors, and its elements eight at a time.

In: displacement, increment and scaled internal force of the independent dofs.  Out: the same
vectors after a product or a burst of steps.  :class:`CompiledPlate` puts the vectors into the
layout of the kernels.

Chunks.  The plate is cut into chunks of at most 1024 near elements, whose forces stay in the cache.
A vector has a part for each chunk, and a last part for the nodes that chunks share::

    u:  | chunk 0      | chunk 1      | ... | chunk n - 1  | shared nodes |
        | (nd, nodes)  | (nd, nodes)  |     | (nd, nodes)  | (nd, nodes)  |
        `first` = 0      nodes of 0

    a part:  u_0 u_1 u_2 ... u_(nodes - 1) | v_0 v_1 ...     | w_0 ...       | theta_x, theta_y
             one dof of all nodes            the next dof

nd is 3 if u and v are at rest in a flat plate.  For a nonlinear plate nd is 5: the groups of
elements have matrices or tables of the last three dofs, and the membrane adds the rest.

A chunk has places for all nodes of its elements:

- its own nodes, which the chunk moves;
- copies of shared nodes, which the chunk fills from the last part before it computes its blocks,
  and whose forces it hands over afterwards;
- a spare place, and unused places up to a multiple of eight.

A node is shared if several chunks have it, if it follows another node by symmetry, or if another
node follows it.  Entries that the chunk doesn't move have a mass of 0.

Blocks and lanes.  A block is eight elements of one group in one chunk, one in each lane.  Elements
of a strip share sides, and places are numbered along strips, so that the first nodes of eight
elements often have eight consecutive places.  In a strip of 4-node elements, with node 1 of lane 0
at place i and node 4 of lane 0 at place j::

    places:   j    j+1  j+2  j+3  ...  j+8          node 4 of the lanes: j, j+1, ..., j+7
              +----+----+----+-- ... --+            node 3 of the lanes: j+1, ..., j+8
              |  0 |  1 |  2 |         |  lanes
              +----+----+----+-- ... --+            node 2 of the lanes: i+1, ..., i+8
    places:   i    i+1  i+2  i+3  ...  i+8          node 1 of the lanes: i, i+1, ..., i+7

Place.  A block has one number for each node.  A number that is not negative is the place of lane 0,
and the other lanes follow.  The number -1 - r refers to row r of the table `lane`, which has the
eight places.  This happens at the end of a strip, and for single elements.  Lanes without an
element have the spare place.

Sums and threads: see kernels.c.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from ctypes import POINTER, c_double, c_int64

import numpy as np
from numpy.typing import NDArray

from fecm._typing import Array, Bools, Floats
from fecm.mechanics.interpolation import NDOF
from fecm.mechanics.kernels import LIBRARY, Doubles, Integers, Structure, floats
from fecm.mechanics.kernels.element_groups import ElementGroup, GroupStruct, grouped
from fecm.mechanics.kernels.layout import Indices, Layout, NodePlaces, kernel_layout, places_of
from fecm.mechanics.plate import PlateModel, R, StiffnessOperator, pieces
from fecm.mechanics.strains import strain_of_deflection
from fecm.mechanics.supports import NodeSupports
from fecm.mechanics.symmetry import TURNED, SymmetryReduction

# Relative difference below which ratios of masses count as equal.
EQUAL = 1e-12


class BlockStruct(Structure):
    """Eight elements of a group."""

    _fields_ = (
        ("group", POINTER(GroupStruct)),
        ("place", Integers),  # (nodes,): see the head of this module
        ("data", Doubles),  # (numbers, 8): see ElementGroup.data; not set with a matrix
        ("membrane", Doubles),  # (numbers, 8) of a nonlinear plate: see ElementGroup.membrane
    )


# BlockStruct as the type of an array: the blocks of a group are filled together.
BLOCK = np.dtype([(name, np.uint64) for name, _ in BlockStruct._fields_])


class SupportStruct(Structure):
    """A spring or a one-sided support of a dof; see :mod:`~fecm.mechanics.supports`."""

    _fields_ = (
        ("at", c_int64),  # entry of the dof in its chunk
        ("side", c_double),  # 0 for a spring
        ("stiffness", c_double),
        ("gap", c_double),
    )


class ChunkStruct(Structure):
    """Blocks of near elements, and their nodes.  The last chunk has only the shared nodes.

    The arrays:

    =========  ================  ==============================================================
    `shares`   (shared,)         places of the shared nodes in the last chunk
    `copies`   (shared,)         places of their copies in this chunk
    `at_rest`  (fixed,)          entries of a vector (nd, nodes) that the chunk doesn't move
    `signs`    (shared, nd)      copy over original: -1 for dofs that a half turn reverses
    `force`    (shared, nd)      forces on the copies, for the originals
    =========  ================  ==============================================================
    """

    _fields_ = (
        ("blocks", c_int64),
        ("block", POINTER(BlockStruct)),
        ("first", c_int64),  # number of nodes in the chunks before
        ("nodes", c_int64),  # number of nodes, a multiple of eight
        ("shared", c_int64),
        ("fixed", c_int64),
        ("shares", Integers),
        ("copies", Integers),
        ("at_rest", Integers),
        ("signs", Doubles),
        ("force", Doubles),
        ("supports", c_int64),
        ("support", POINTER(SupportStruct)),
    )


class PlateStruct(Structure):
    """A plate and its state.

    The arrays:

    ===========  =========================  ===================================================
    `lane`       (rows, 8)                  places of the lanes where they don't follow
    `preload`    (3,)                       initial membrane force; not set without a preload
    `curvature`  (3,)                       strains per w; not set for a flat plate, or for a
                                            nonlinear plate, whose groups have them
    `mass`       (nodes,) or (nd, nodes)    lumped mass, part by part, divided by `ratio`
    `inverse`    as `mass`                  1 over `mass`; 0 where the mass is 0
    `ratio`      (nd,)                      mass of each dof over the mass of the first dof
    `rate`       (nd,)                      dt^2 over `ratio`; if not set, s is K u itself
    `u`          (nd nodes,)                displacement
    `d`          (nd nodes,)                increment of the displacement in a step
    `s`          (nd nodes,)                dt^2 M^-1 K u
    `shared`     (nd, nodes of the last)    forces on the shared nodes, 0 between products
    ===========  =========================  ===================================================
    """

    _fields_ = (
        ("nd", c_int64),  # dofs of a node, 3 or 5
        ("chunks", c_int64),  # number of chunks without the last one
        ("nodes", c_int64),  # number of nodes of all chunks
        ("most", c_int64),  # number of nodes of the largest chunk
        ("chunk", POINTER(ChunkStruct)),
        ("lane", Integers),
        ("preload", Doubles),
        ("curvature", Doubles),
        ("nonlinear", c_int64),  # whether stretching follows from bending
        ("transposed", c_int64),  # whether the inverse Jacobian is transposed
        ("planes", c_int64),  # first dimension of `mass`: 1, or nd
        ("mass", Doubles),
        ("inverse", Doubles),
        ("ratio", Doubles),
        ("rate", Doubles),
        ("u", Doubles),
        ("d", Doubles),
        ("s", Doubles),
        ("shared", Doubles),
        ("damping", c_double),  # a dt/2 of the damping matrix C = a M
    )


class CompiledPlate:
    """A plate in the layout of the kernels.

    Vectors have a part (nd, nodes) for each chunk, and a last part for the nodes that chunks share.
    `position` (count,) are the places of the independent dofs in the vectors.  With `nonlinear` the
    plate stretches as it bends, see :mod:`~fecm.mechanics.membrane`.
    """

    def __init__(
        self, plate: PlateModel, reduction: SymmetryReduction, *, nonlinear: bool = False
    ) -> None:
        moves = reduction.sign != 0.0
        in_plane = nonlinear or plate.is_curved or moves[:, :2].any()
        self.columns = columns = np.arange(0 if in_plane else 2, NDOF)
        self._nonlinear = nonlinear
        self._held: list[object] = []  # objects that the structures point to by addresses
        groups = [
            ElementGroup(
                plate,
                family.take(members),
                columns[-3:] if nonlinear else columns,
                weights[members],
                congruent=congruent,
                nonlinear=nonlinear,
            )
            for family in plate.families
            for weights in [reduction.weights[family.rows].astype(float)]
            for members, congruent in grouped(family, weights, nonlinear=nonlinear)
        ]
        families = [group.family for group in groups]
        leader = _leaders(reduction)
        layout = kernel_layout(families)
        places = places_of(layout, families, leader)
        nd, count = len(columns), int(places.sizes.sum())

        chunk, place = places.home
        first, size = places.firsts[chunk], places.sizes[chunk]
        leads = reduction.index[plate.mesh.equations > 0]
        masses = np.bincount(leads, plate.mass, reduction.count + 1)
        self.position = np.empty(reduction.count, dtype=np.intp)
        mass = np.zeros((nd, count))
        for row, column in enumerate(columns):
            # A dof that follows another has a node without a home.
            (nodes,) = np.nonzero(moves[:, column] & (chunk >= 0))
            index, entry = reduction.index[nodes, column], (first + place)[nodes]
            self.position[index] = entry + ((nd - 1) * first + row * size)[nodes]
            mass[row, entry] = masses[index]

        parts = [
            mass[:, begin : begin + n]
            for begin, n in zip(places.firsts.tolist(), places.sizes.tolist(), strict=True)
        ]
        self._ratio, factor = _factors(mass)
        if factor is None:
            factor = np.concatenate([part.ravel() for part in parts])
        inverse = np.zeros_like(factor)
        np.divide(1.0, factor, out=inverse, where=factor > 0.0)
        self._rate = np.empty(nd)
        self.u, self.d, self.s = np.zeros((3, nd * count))

        cuts = self._chunks(parts, places, leader)
        curved = plate.is_curved and not nonlinear
        lanes = self._blocks(cuts, layout, groups, places)
        if plate.supports is not None:
            self._support(cuts, plate.supports, places, leader, moves)
        self.structure = PlateStruct(
            nd=nd,
            chunks=layout.chunks,
            nodes=count,
            most=int(places.sizes.max()),
            chunk=cuts,
            lane=_integers(lanes),
            preload=np.array(plate.preload) if plate.is_preloaded else None,
            curvature=strain_of_deflection(plate.curvature) if curved else None,
            nonlinear=int(nonlinear),
            transposed=int(plate.rules.transposed_jacobian),
            planes=len(factor) // count,
            mass=factor,
            inverse=inverse,
            ratio=self._ratio,
            rate=None,
            u=self.u,
            d=self.d,
            s=self.s,
            shared=np.zeros(parts[-1].size),
            damping=0.0,
        )

    def _chunks(
        self, masses: list[Floats], places: NodePlaces, leader: Indices
    ) -> ctypes.Array[ChunkStruct]:
        """Create the chunks without blocks; `masses` (nd, nodes) belong to their entries."""
        chunk, place = places.home
        cuts = (ChunkStruct * len(masses))()
        for number, mass in enumerate(masses):
            here = places.node[places.starts[number] : places.starts[number + 1]]
            copies = np.flatnonzero(chunk[here] != number)
            copied = leader[here[copies]]
            follows = copied != here[copies]
            signs = np.where(follows[:, None], TURNED[self.columns], 1.0)
            at_rest = np.flatnonzero(mass <= 0.0)
            structure = ChunkStruct(
                first=int(places.firsts[number]),
                nodes=mass.shape[1],
                shared=len(copies),
                fixed=len(at_rest),
                shares=_integers(place[copied]),
                copies=_integers(copies),
                at_rest=_integers(at_rest),
                signs=signs,
                force=np.zeros(signs.shape),
            )
            self._held.append(structure)
            cuts[number] = structure
        return cuts

    def _support(
        self,
        cuts: ctypes.Array[ChunkStruct],
        supports: NodeSupports,
        places: NodePlaces,
        leader: Indices,
        moves: Bools,
    ) -> None:
        """Add the supports of moving dofs to the chunks of their nodes."""
        rows = supports.select(moves[supports.node, supports.dof])
        nodes = leader[rows.node]
        chunk, place = (part[nodes] for part in places.home)
        dof = rows.dof - self.columns[0]
        for number in np.unique(chunk).tolist():
            here = np.flatnonzero(chunk == number)
            table = (SupportStruct * len(here))()
            for entry, row in zip(table, here.tolist(), strict=True):
                entry.at = int(dof[row] * cuts[number].nodes + place[row])
                entry.side, entry.stiffness = rows.side[row], rows.stiffness[row]
                entry.gap = rows.gap[row]
            self._held.append(table)
            cuts[number].supports = len(here)
            cuts[number].support = table

    def _blocks(
        self,
        cuts: ctypes.Array[ChunkStruct],
        layout: Layout,
        groups: list[ElementGroup],
        places: NodePlaces,
    ) -> Indices:
        """Add the blocks to the chunks; return the places of lanes that don't follow."""
        counts, rest = np.diff(places.starts), places.place_of_node
        table = np.zeros(len(layout.group), dtype=BLOCK)
        self._held.append(table)
        lanes: list[Indices] = []
        rows_before, elements_before = 0, 0
        for number, group in enumerate(groups):
            (rows,) = np.nonzero(layout.group == number)
            member = layout.element[rows] - elements_before
            elements_before += len(group.family.rows)
            of_group, rest = np.split(rest, [group.family.nodes.size])
            node_places = of_group.reshape(group.family.nodes.shape)[:, group.order]
            lane_places = node_places[member].swapaxes(1, 2)
            # Lanes without an element get the spare place behind the nodes.
            lane_places = np.where(
                layout.filled[rows, None], lane_places, counts[layout.chunk[rows], None, None]
            )
            is_scattered = (np.diff(lane_places, axis=2) != 1).any(axis=2)
            lanes.append(lane_places[is_scattered])
            first_places = lane_places[:, :, 0].copy()
            first_places[is_scattered] = -1 - rows_before - np.arange(len(lanes[-1]))
            rows_before += len(lanes[-1])
            self._held.append(group.structure)
            table["group"][rows] = ctypes.addressof(group.structure)
            table["place"][rows] = self._addresses(first_places.astype(np.int32))
            if group.needs_data:
                table["data"][rows] = self._addresses(group.data(member.ravel()))
            if self._nonlinear:
                table["membrane"][rows] = self._addresses(group.membrane(member.ravel()))
        blocks = np.searchsorted(layout.chunk, np.arange(layout.chunks + 1))
        for c in range(layout.chunks):
            where = ctypes.c_void_p(table.ctypes.data + int(blocks[c]) * BLOCK.itemsize)
            cuts[c].blocks = int(blocks[c + 1] - blocks[c])
            cuts[c].block = ctypes.cast(where, POINTER(BlockStruct))
        return np.concatenate(lanes)

    def _addresses(self, array: Array) -> NDArray[np.uint64]:
        """Return the addresses of an array's rows along its first axis."""
        held = np.ascontiguousarray(array)
        self._held.append(held)
        step = np.uint64(held.strides[0])
        return np.uint64(held.ctypes.data) + np.arange(len(held), dtype=np.uint64) * step

    def set_scale(self, dt2: float | None) -> None:
        """Make the kernels scale K u by dt2 times the inverse mass, or not at all for None."""
        if dt2 is not None:
            np.divide(dt2, self._ratio, out=self._rate)
        self.structure.rate = None if dt2 is None else floats(self._rate)

    def internal_force(self, threads: int = 1) -> float:
        """Compute `s`, the scaled internal force, and return the quadratic work."""
        work = c_double()
        structure = ctypes.byref(self.structure)
        if not LIBRARY.fecm_internal_force(structure, threads, ctypes.byref(work)):
            raise MemoryError
        return work.value

    def accelerations(self, u: Floats) -> Floats:
        """Return M^-1 K u of a vector in the kernels' layout; the next call overwrites it."""
        self.u[:] = u
        self.set_scale(1.0)
        self.internal_force()
        return self.s


class CompiledProduct(StiffnessOperator):
    """K u by the compiled kernels, or with `nonlinear` the internal force of a nonlinear plate.

    Padded vectors are over the independent dofs of the reduction.
    """

    def __init__(
        self,
        plate: PlateModel,
        reduction: SymmetryReduction,
        threads: int = 1,
        *,
        nonlinear: bool = False,
    ) -> None:
        self.plate = CompiledPlate(plate, reduction, nonlinear=nonlinear)
        self._count = reduction.count
        self._signed = reduction.signed
        self._threads = threads
        self.size = (2 if reduction.signed else 1) * reduction.count + 1
        self._pieces = pieces(reduction.count)
        is_at_rest = reduction.sign == 0.0
        self._field = self.plate.position[np.where(is_at_rest, 0, reduction.index)]
        self._sign = reduction.sign

    def each(self, padded: Floats, use: Callable[[int, Floats], R]) -> list[R]:
        """Compute K u and apply a function to each piece."""
        if self._signed:
            np.negative(padded[: self._count], out=padded[self._count : -1])
        plate = self.plate
        plate.u[plate.position] = padded[: self._count]
        plate.set_scale(None)
        self.quadratic_work = plate.internal_force(self._threads)
        forces = plate.s[plate.position]
        return [use(number, forces[piece]) for number, piece in enumerate(self._pieces)]

    def fields(self, stored: Floats) -> Floats:
        """Return the fields (rows, numnp, 5) of stored vectors (rows, entries)."""
        fields = stored.take(self._field, axis=1)
        fields *= self._sign
        fields += 0.0  # no negative zeros
        return fields

    def entries(self, indices: Indices, weights: Floats) -> tuple[NDArray[np.int64], Floats]:
        """Convert sums over padded vectors to places in the kernels' vectors, and weights."""
        is_negative = (indices >= self._count) & (indices < self.size - 1)
        is_at_rest = indices == self.size - 1
        dofs = np.where(is_at_rest, 0, np.where(is_negative, indices - self._count, indices))
        signed = np.where(is_at_rest, 0.0, np.where(is_negative, -weights, weights))
        return self.plate.position[dofs].astype(np.int64), np.ascontiguousarray(signed)


def _leaders(reduction: SymmetryReduction) -> Indices:
    """Return the node that each node follows, (numnp,): itself if it moves independently."""
    leader = np.arange(len(reduction.index))
    first = np.empty(reduction.count, dtype=np.intp)
    for column, moves in zip(reduction.index.T, (reduction.sign != 0.0).T, strict=True):
        (nodes,) = np.nonzero(moves)
        index = column[nodes]
        first[index[::-1]] = nodes[::-1]  # the lowest is assigned last
        leader[nodes] = first[index]
    return leader


def _factors(mass: Floats) -> tuple[Floats, Floats | None]:
    """Return the ratio of the masses of a node's dofs, (nd,), and a factor per node.

    The ratio follows from the laminate, except at supports, where masses are 0.  The factors are
    None if the nodes have different ratios.
    """
    unsupported = np.flatnonzero((mass > 0.0).all(axis=0))
    if len(unsupported):
        ratio = mass[:, unsupported[:1]] / mass[0, unsupported[0]]
        factor = (mass / ratio).max(axis=0)
        if ((abs(factor * ratio - mass) <= EQUAL * mass) | (mass <= 0.0)).all():
            return ratio[:, 0].copy(), factor
    return np.ones(len(mass)), None


def _integers(array: Indices) -> NDArray[np.int32]:
    """Convert places to the integers of the kernels."""
    return np.ascontiguousarray(array, dtype=np.int32)
