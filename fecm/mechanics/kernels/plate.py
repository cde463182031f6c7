"""A plate for the compiled kernels: its vectors, and its elements eight at a time."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fecm._typing import Bools, Floats
from fecm.mechanics import assumed_shear
from fecm.mechanics.element_groups import ElementBlock, congruence, distinct
from fecm.mechanics.elements.quadrature import Quadrature
from fecm.mechanics.interpolation import NDOF, local_shape_functions
from fecm.mechanics.kernels import LIBRARY, Chunk, Group, Integers, Plate, floats
from fecm.mechanics.plate import PlateModel
from fecm.mechanics.stiffness_operator import R, StiffnessOperator, pieces
from fecm.mechanics.symmetry import TURNED, SymmetryReduction, opposite_nodes

Indices = NDArray[np.intp]

LANES = 8
# The kinds of kernels.c.
ONE, TWO, FACTORIZED, POINTS = range(4)
# With fewer congruent elements a shared matrix fills too few lanes.
WORTH_GROUPING = 8
# Elements of a chunk, approximately: the forces on their nodes stay in the cache.
CHUNK = 512
# Relative difference below which masses of nodes count as equal.
EQUAL = 1e-12
# Largest coupling of even and odd motions of an element, relative to its largest stiffness.
SYMMETRIC = 1e-14
# The structure Block of kernels.c.
BLOCK = np.dtype([(name, np.uint64) for name in ("group", "source", "target", "data", "done")])


class _Elements:
    """Elements of a family that share a matrix, or have none."""

    def __init__(
        self, plate: PlateModel, family: ElementBlock, columns: Indices, weights: Floats, kind: int
    ) -> None:
        self.plate, self.family, self.columns, self.weights = plate, family, columns, weights
        nn = family.nodes.shape[1]
        self.order = np.arange(nn)  # of the nodes, in all arrays
        self.arrays: dict[str, Floats] = {}
        self.numbers = {"kind": kind, "nodes": nn}
        if kind == ONE:
            self._matrix(weights[0])
            return
        rules = plate.rules
        shear = assumed_shear.quadrature(family) if rules.assumes_shear else rules.shear
        self.rules = rules.bending, shear
        self.points = [self._at_points(rule) for rule in self.rules]
        if self._factorizes():
            lines = [distinct(rule.xi) for rule in self.rules]
            self.numbers |= {"kind": FACTORIZED, "bending": len(lines[0]), "shear": len(lines[1])}
            self.arrays = {"rotations": lines[0], "deflection": lines[1]}
            self.order = np.lexsort((family.shape.xi, family.shape.eta))
        else:
            self._tables(shear)

    def _matrix(self, weight: float) -> None:
        """Set the common matrix, or those of the even and odd motions."""
        plate, family, columns = self.plate, self.family, self.columns
        nn, opposite = family.nodes.shape[1], opposite_nodes(family)
        K = weight * plate.stiffness_of(family.take(np.array([0])))[0]
        K = K.reshape(nn, NDOF, nn, NDOF).transpose(1, 0, 3, 2)[columns][:, :, columns]
        if opposite is not None:
            first = np.flatnonzero(opposite > np.arange(nn))
            centre = np.flatnonzero(opposite == np.arange(nn))
            order = np.concatenate([first, opposite[first], centre])
            if (parts := self._halves(K[:, order][:, :, :, order], len(first))) is not None:
                self.order = order
                self.numbers |= {"kind": TWO, "pairs": len(first)}
                self.arrays["matrix"] = parts
                return
        self.arrays["matrix"] = K.reshape(nn * len(columns), -1).copy()

    def _halves(self, K: Floats, pairs: int) -> Floats | None:
        """Matrices of the even and the odd motions, in a row; None if they are coupled."""
        nd, nn = K.shape[:2]
        even: list[Floats] = []
        odd: list[Floats] = []
        unit = np.eye(nd * nn).reshape(nd, nn, -1)
        for dof, column in enumerate(self.columns):
            keeps = bool(TURNED[column] > 0.0)
            a, b, rest = unit[dof, :pairs], unit[dof, pairs : 2 * pairs], unit[dof, 2 * pairs :]
            parts = [a + b, a - b]
            even += [*parts[1 - keeps], *(rest if keeps else ())]
            odd += [*parts[keeps], *(() if keeps else rest)]
        T = np.array(even + odd)
        scale = 1.0 / (T**2).sum(axis=1)
        turned = scale[:, None] * (T @ K.reshape(nd * nn, -1) @ T.T) * scale
        n = len(even)
        coupled = max(abs(turned[:n, n:]).max(), abs(turned[n:, :n]).max())
        if coupled > SYMMETRIC * abs(turned).max():
            return None
        return np.concatenate([turned[:n, :n].ravel(), turned[n:, n:].ravel()])

    def _at_points(self, rule: Quadrature) -> Floats:
        """Inverse Jacobian, and its determinant times the weight, (ne, npt, 5)."""
        _, local = local_shape_functions(self.family, rule)
        inverse, determinant = jacobians(self.family, local, self.plate.rules.transposed_jacobian)
        jxw = determinant * rule.weights * self.weights[:, None]
        return np.concatenate([inverse, jxw[:, :, None]], axis=2)

    def _factorizes(self) -> bool:
        """Whether sums over the points are products of sums along xi and eta."""
        grid = self.family.shape.nodes == 9 and self.family.present.all()
        return bool(
            grid
            and not self.plate.rules.assumes_shear
            and all((values[:, :, 4] > 0.0).all() for values in self.points)
        )

    def _tables(self, shear: Quadrature) -> None:
        """Values and slopes of the shape functions at the points of quadrature."""
        family, rules = self.family, self.plate.rules
        nn = family.nodes.shape[1]
        _, local = local_shape_functions(family, rules.bending)
        slopes = local.transpose(1, 0, 2).reshape(-1, nn)
        if rules.assumes_shear:
            tied = [local_shape_functions(family, assumed_shear.tying_points(nn, axis))
                    for axis in (0, 1)]  # fmt: skip
            values = np.concatenate([value for value, _ in tied])
            deflection = np.concatenate([at[:, axis] for axis, (_, at) in enumerate(tied)])
            weights = [assumed_shear.tying_weights(nn, axis, shear) for axis in (0, 1)]
            self.arrays["tied"] = np.stack(weights)
            self.arrays["tied_t"] = np.stack([table.T for table in weights])
            self.numbers["tying"] = len(tied[0][0])
        else:
            values, local = local_shape_functions(family, shear)
            deflection = local.transpose(1, 0, 2).reshape(-1, nn)
        self.numbers |= {"bending": len(rules.bending.xi), "shear": len(shear.xi)}
        rotations = np.concatenate([slopes, values])
        self.arrays |= {
            "rotations": rotations, "rotations_t": rotations.T, "in_plane_t": slopes.T,
            "deflection": deflection, "deflection_t": deflection.T,
        }  # fmt: skip

    def data(self, members: Indices) -> Floats:
        """Jacobians at the points of the elements without a matrix, (blocks, numbers, 8)."""
        rules, parts = self.plate.rules, [values[members] for values in self.points]
        if self.numbers["kind"] == FACTORIZED:
            for part in parts:
                part[:, :, 4] = np.sqrt(part[:, :, 4])
                part[:, :, :4] *= 0.5 * part[:, :, 4:]
            along = [np.lexsort((rule.eta, rule.xi)) for rule in self.rules]
            parts = [parts[0][:, along[0], :4], parts[1][:, along[1]]]
        elif rules.assumes_shear:
            family = self.family.take(members)
            for axis in (0, 1):
                points = assumed_shear.tying_points(family.nodes.shape[1], axis)
                _, local = local_shape_functions(family, points)
                parts.append(np.einsum("tn,eni->eti", local[:, axis], family.coordinates))
        values = np.concatenate([part.reshape(len(members), -1) for part in parts], axis=1)
        return np.ascontiguousarray(values.reshape(-1, LANES, values.shape[1]).swapaxes(1, 2))


def jacobians(family: ElementBlock, local: Floats, transposed: bool) -> tuple[Floats, Floats]:
    """Inverse Jacobian (ne, npt, 4) and its determinant (ne, npt), in closed form.

    See :func:`fecm.mechanics.interpolation.inverse_jacobian`.
    """
    # Rounded as there: coordinates are large beside an element.
    J = np.einsum("pan,eni->epai", local, family.coordinates)
    (a, b), (c, d) = J.transpose(2, 3, 0, 1)  # x and y by xi, x and y by eta
    determinant = a * d - b * c
    rows = (d, -c, -b, a) if transposed else (d, -b, -c, a)
    return np.stack(rows, axis=2) / determinant[:, :, None], determinant


class _Layout(NamedTuple):
    """Blocks of eight elements; lanes without one repeat another element of their block."""

    chunks: int
    group: Indices  # (blocks,)
    chunk: Indices  # (blocks,)
    member: Indices  # (blocks, 8): number of the element in its group
    filled: Bools  # (blocks, 8): whether the lane has an element of its own


class _Nodes(NamedTuple):
    """Numbers of nodes in the vectors of the kernels."""

    number: Indices  # (numnp,): number; -1 if it has none
    own: Bools  # (numnp,): whether one chunk alone touches it, and nothing follows it
    followers: Indices  # nodes that follow others
    final: Indices  # (own nodes,): last block that touches each, in the order of their numbers
    total: int  # nodes with a number


class CompiledPlate:
    """A plate in the layout of the kernels.

    Vectors are (nodes, entries) over the nodes that move independently; `position` (count,) are the
    places of the independent dofs in them.
    """

    def __init__(self, plate: PlateModel, kept: SymmetryReduction) -> None:
        moves = kept.sign != 0.0
        self.columns = columns = np.arange(0 if moves[:, :2].any() else 2, NDOF)
        self._held: list[Any] = []  # arrays that the structures point to
        groups = [
            _Elements(plate, family.take(chosen), columns, weights[chosen], kind)
            for family in plate.families
            for weights in [kept.weights[family.rows].astype(float)]
            for chosen, kind in _grouped(family, weights)
        ]
        layout, leader = _layout(groups), _leaders(kept)
        # Nodes of the blocks of each group, (blocks, nodes, 8).
        touched = [
            g.family.nodes[:, g.order][layout.member[layout.group == number]].swapaxes(1, 2)
            for number, g in enumerate(groups)
        ]
        nodes = _numbered(layout, touched, leader)
        entries = 4 if len(columns) == 3 else NDOF
        self.shape = (nodes.total, entries)
        self._number_dofs(kept, nodes.number)
        mass = np.zeros(self.shape)
        mass.ravel()[self.position] = kept.gather(kept.sign * plate.field(plate.mass, 0.0))
        kinds, rows, factor = _kinds(mass)
        self.inverse_mass, self.scale = np.zeros((2, *rows.shape))
        np.divide(1.0, rows, out=self.inverse_mass, where=rows > 0.0)
        both = None if factor is None else np.stack([factor, 1.0 / factor], axis=1)
        self.factor = None if both is None else self._floats(both)
        self.d, self.s = np.zeros((2, *self.shape))
        self.u = np.zeros((nodes.total + len(nodes.followers), entries))
        turned = np.zeros(entries)
        turned[: len(columns)] = TURNED[columns]
        cuts = self._chunks(layout, groups, touched, nodes, leader, turned)
        laminate = plate.laminate
        stiffness = np.block([[laminate.A, -laminate.B], [-laminate.B, laminate.D]])
        common = nodes.total - len(nodes.final)
        self.structure = Plate(
            entries, nodes.total, len(nodes.final), layout.chunks, len(nodes.followers),
            max(cut.nodes + cut.shared for cut in cuts) + 1,
            cuts, self._ints(nodes.number[leader[nodes.followers]]), self._floats(turned),
            self._floats(stiffness), self._floats(laminate.shear), self._ints(kinds),
            self._floats(rows), floats(self.scale),
            self.factor,
            floats(self.u), floats(self.d), floats(self.s),
            self._floats(np.zeros((common, entries))), 0.0,
        )  # fmt: skip

    def _chunks(
        self,
        layout: _Layout,
        groups: list[_Elements],
        touched: list[Indices],
        nodes: _Nodes,
        leader: Indices,
        turned: Floats,
    ) -> Any:
        """The chunks, with their blocks."""
        place = nodes.number.copy()  # in the displacement, where the followers come last
        place[nodes.followers] = nodes.total + np.arange(len(nodes.followers))
        starts = np.searchsorted(layout.chunk, np.arange(layout.chunks + 1))
        firsts = np.searchsorted(layout.chunk[nodes.final], np.arange(layout.chunks + 1))
        local = np.empty(len(leader), dtype=np.intp)
        targets = [np.empty(part.shape, dtype=np.int32) for part in touched]
        inside = [layout.chunk[layout.group == number] for number in range(len(groups))]
        filled = [layout.filled[layout.group == number, None] for number in range(len(groups))]
        cuts = (Chunk * layout.chunks)()
        self._held.append(cuts)
        for c in range(layout.chunks):
            count = int(firsts[c + 1] - firsts[c])
            parts = [part[at == c].ravel() for part, at in zip(touched, inside, strict=True)]
            here = distinct(np.concatenate(parts))
            mine = nodes.own[leader[here]]
            shares = here[~mine]
            local[here[mine]] = nodes.number[here[mine]] - firsts[c]
            local[shares] = count + np.arange(len(shares))
            for target, part, at, real in zip(targets, touched, inside, filled, strict=True):
                rows = at == c
                target[rows] = np.where(real[rows], local[part[rows]], count + len(shares))
            signs = np.where((leader[shares] != shares)[:, None], turned, 1.0)
            cuts[c] = Chunk(
                starts[c + 1] - starts[c], None, int(firsts[c]), count, len(shares),
                self._ints(nodes.number[leader[shares]]), self._floats(signs),
                self._floats(np.zeros((len(shares), len(turned)))),
            )  # fmt: skip
        table = np.zeros(len(layout.group), dtype=BLOCK)
        self._held.append(table)
        done = np.searchsorted(nodes.final, np.arange(len(table)), side="right")
        table["done"] = done - firsts[layout.chunk]
        for number, elements in enumerate(groups):
            (rows,) = np.nonzero(layout.group == number)
            arrays = {name: self._floats(array) for name, array in elements.arrays.items()}
            made = Group(**elements.numbers, **arrays)
            self._held.append(made)
            table["group"][rows] = ctypes.addressof(made)
            table["source"][rows] = self._addresses(place[touched[number]].astype(np.int32))
            table["target"][rows] = self._addresses(targets[number])
            if "matrix" not in elements.arrays:
                data = elements.data(layout.member[rows].ravel())
                table["data"][rows] = self._addresses(data)
        for c in range(layout.chunks):
            where = ctypes.c_void_p(table.ctypes.data + int(starts[c]) * BLOCK.itemsize)
            cuts[c].block = ctypes.cast(where, type(cuts[c].block))
        return cuts

    def _number_dofs(self, kept: SymmetryReduction, number: Indices) -> None:
        """Set the places of the independent dofs in the vectors."""
        self.position = np.empty(kept.count, dtype=np.intp)
        nodes, dofs = np.nonzero((kept.sign != 0.0) & (number >= 0)[:, None])
        # A dof that follows another has a node without a number.
        self.position[kept.index[nodes, dofs]] = (
            number[nodes] * self.shape[1] + dofs - self.columns[0]
        )

    def _floats(self, array: Floats) -> Any:
        held = np.ascontiguousarray(array, dtype=np.float64)
        self._held.append(held)
        return floats(held)

    def _ints(self, array: NDArray[Any]) -> Any:
        held = np.ascontiguousarray(array, dtype=np.int32)
        self._held.append(held)
        return held.ctypes.data_as(Integers)

    def _addresses(self, array: NDArray[Any]) -> NDArray[np.uint64]:
        """Addresses of the parts of an array along its first axis."""
        held = np.ascontiguousarray(array)
        self._held.append(held)
        step = held.strides[0]
        return np.uint64(held.ctypes.data) + np.arange(len(held), dtype=np.uint64) * np.uint64(step)

    def internal_force(self, threads: int = 1) -> None:
        """Compute `s`, which is K u times `scale`."""
        if not LIBRARY.fecm_internal_force(ctypes.byref(self.structure), ctypes.c_int64(threads)):
            raise MemoryError


class CompiledProduct(StiffnessOperator):
    """K u by the compiled kernels; padded vectors are those of the reduction."""

    def __init__(self, plate: PlateModel, kept: SymmetryReduction, threads: int = 1) -> None:
        self.plate = CompiledPlate(plate, kept)
        self._count, self._signed, self._threads = kept.count, kept.signed, threads
        self.size = (2 if kept.signed else 1) * kept.count + 1
        self._pieces = pieces(kept.count)
        # Factors of the internal force: 1, or those of a time step and its square.
        self._scaled_for: float | None = math.nan
        rests = kept.sign == 0.0
        self._field = self.plate.position[np.where(rests, 0, kept.index)]
        self._sign = kept.sign

    def scale(self, dt2: float | None) -> None:
        """Make the kernels scale K u by dt2 and the inverse mass; by 1 without dt2."""
        if self._scaled_for != dt2:
            inverse = self.plate.inverse_mass
            self.plate.scale[...] = inverse > 0.0 if dt2 is None else dt2 * inverse
            self.plate.structure.factor = None if dt2 is None else self.plate.factor
            self._scaled_for = dt2

    def each(self, padded: Floats, use: Callable[[int, Floats], R]) -> list[R]:
        """Compute K u and apply a function to each piece."""
        if self._signed:
            np.negative(padded[: self._count], out=padded[self._count : -1])
        plate = self.plate
        plate.u.ravel()[plate.position] = padded[: self._count]
        self.scale(None)
        plate.internal_force(self._threads)
        forces = plate.s.ravel()[plate.position]
        return [use(number, forces[piece]) for number, piece in enumerate(self._pieces)]

    def fields(self, stored: Floats) -> Floats:
        """Fields (rows, numnp, 5) of stored vectors (rows, nodes, dofs)."""
        fields = stored.reshape(len(stored), math.prod(stored.shape[1:])).take(self._field, axis=1)
        fields *= self._sign
        fields += 0.0  # no negative zeros
        return fields

    def entries(self, indices: Indices, weights: Floats) -> tuple[NDArray[np.int64], Floats]:
        """Places in the vectors, and weights, of sums over padded vectors."""
        turned = (indices >= self._count) & (indices < self.size - 1)
        rest = indices == self.size - 1
        dofs = np.where(rest, 0, np.where(turned, indices - self._count, indices))
        signed = np.where(rest, 0.0, np.where(turned, -weights, weights))
        return self.plate.position[dofs].astype(np.int64), np.ascontiguousarray(signed)


def _layout(groups: list[_Elements]) -> _Layout:
    """Put the elements of groups into blocks, and the blocks into chunks of near elements."""
    sizes = np.array([len(g.family.rows) for g in groups])
    group = np.repeat(np.arange(len(groups)), sizes)
    along = _morton(np.concatenate([g.family.coordinates.mean(axis=1) for g in groups]))
    chunks = 1 if len(along) < 2 * CHUNK else len(along) // CHUNK
    chunk = np.empty(len(along), dtype=np.intp)
    chunk[along] = np.arange(len(along)) * chunks // len(along)
    # In each chunk the elements of a group follow one another.
    order = along[np.lexsort((group[along], chunk[along]))]
    begins = np.flatnonzero(np.diff(group[order], prepend=-1) | np.diff(chunk[order], prepend=-1))
    counts = np.diff(np.append(begins, len(order)))
    blocks = -(-counts // LANES)
    last = np.cumsum(blocks)
    run = np.repeat(np.arange(len(counts)), blocks * LANES)
    offset = np.arange(last[-1] * LANES) - LANES * (last - blocks)[run]
    element = order[begins[run] + np.minimum(offset, counts[run] - 1)].reshape(-1, LANES)
    one = element[:, 0]
    member = element - (np.cumsum(sizes) - sizes)[group[one], None]
    return _Layout(
        chunks, group[one], chunk[one], member, (offset < counts[run]).reshape(-1, LANES)
    )


def _numbered(layout: _Layout, touched: list[Indices], leader: Indices) -> _Nodes:
    """Number the nodes of a chunk alone by the last block that touches them, then the others."""
    numnp = len(leader)
    lowest, highest = np.full(numnp, layout.chunks), np.full(numnp, -1)
    final = np.zeros(numnp, dtype=np.intp)
    for number, nodes in enumerate(touched):
        (rows,) = np.nonzero(layout.group == number)
        chunk, at = layout.chunk[rows, None, None], leader[nodes]
        np.minimum.at(lowest, at, chunk)
        np.maximum.at(highest, at, chunk)
        np.maximum.at(final, at, rows[:, None, None])
    followers = distinct(np.concatenate([nodes[leader[nodes] != nodes] for nodes in touched]))
    own = (highest >= 0) & (lowest == highest)
    own[leader[followers]] = False
    inside, common = np.flatnonzero(own), np.flatnonzero((highest >= 0) & ~own)
    inside = inside[np.argsort(final[inside], kind="stable")]
    count = len(inside) + len(common)
    numbers = np.full(numnp, -1)
    numbers[np.concatenate([inside, common])] = np.arange(count)
    return _Nodes(numbers, own, followers, final[inside], count)


def _leaders(kept: SymmetryReduction) -> Indices:
    """Node that each node follows, (numnp,): itself if it moves independently."""
    numnp = len(kept.index)
    nodes, dofs = np.nonzero(kept.sign)
    first = np.full(kept.count, numnp)
    np.minimum.at(first, kept.index[nodes, dofs], nodes)
    leader = np.arange(numnp)
    leader[nodes] = first[kept.index[nodes, dofs]]
    return leader


def _kinds(mass: Floats) -> tuple[Indices, Floats, Floats | None]:
    """Rows of a table of masses, one for each node, and the factors of nodes if not 1.

    The ratio of the masses of a node's dofs is that of the laminate, but for supports.
    """
    row, table = _distinct(mass)
    if 2 * len(table) < len(mass):
        return row, table, None
    largest = mass.max(axis=1)
    factor = np.where(largest > 0.0, largest, 1.0)
    return *_distinct(mass / factor[:, None]), factor


def _distinct(rows: Floats) -> tuple[Indices, Floats]:
    """Index of each row, (n,), in a table of those that differ."""
    scale = rows.max(axis=0, initial=0.0)
    relative = rows / np.where(scale > 0.0, scale, 1.0)
    mixed = relative @ np.sqrt(np.arange(2.0, 2.0 + rows.shape[1]))
    _, first, index = np.unique(np.round(mixed / EQUAL), return_index=True, return_inverse=True)
    if np.abs(relative[first[index]] - relative).max() > EQUAL:  # in spite of equal sums
        return np.arange(len(rows)), rows
    return index, rows[first]


def _grouped(family: ElementBlock, weights: Floats) -> list[tuple[Indices, int]]:
    """Elements of a family with a common matrix, or without."""
    same = congruence(family)
    (stepped,) = np.nonzero(weights)
    key = 3 * same.group[stepped] + weights[stepped].astype(int)
    _, group, counts = np.unique(key, return_inverse=True, return_counts=True)
    many = np.flatnonzero(counts >= WORTH_GROUPING)
    found = [(stepped[group == one], ONE) for one in many.tolist()]
    alone = stepped[counts[group] < WORTH_GROUPING]
    return [*found, (alone, POINTS)] if len(alone) else found


def _morton(places: Floats) -> Indices:
    """Order of places, (n, 2), along a curve that fills the plane."""
    low = places.min(axis=0)
    cells = ((places - low) * (2**15 / max(np.ptp(places, axis=0).max(), 1e-300))).astype(np.uint64)
    code = np.zeros(len(places), dtype=np.uint64)
    for bit in range(16):
        for axis in (0, 1):
            code |= (cells[:, axis] >> np.uint64(bit) & np.uint64(1)) << np.uint64(2 * bit + axis)
    return np.argsort(code, kind="stable")
