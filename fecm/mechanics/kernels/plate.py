"""A plate for the compiled kernels: its vectors, and its elements eight at a time."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fecm._typing import Floats
from fecm.mechanics import assumed_shear
from fecm.mechanics.elements import Quadrature
from fecm.mechanics.interpolation import NDOF, jacobian, local_shape_functions
from fecm.mechanics.kernels import LIBRARY, Chunk, Group, Integers, Plate, floats
from fecm.mechanics.kernels.layout import LANES, Indices, Layout, Places, layout_of, places_of
from fecm.mechanics.mesh import ElementBlock, congruence, distinct
from fecm.mechanics.plate import PlateModel, R, StiffnessOperator, pieces
from fecm.mechanics.symmetry import TURNED, SymmetryReduction, opposite_nodes

# The kinds of kernels.c.
ONE, TWO, FACTORIZED, POINTS = range(4)
# With fewer congruent elements a shared matrix fills too few lanes.
WORTH_GROUPING = 8
# Relative difference below which ratios of masses count as equal.
EQUAL = 1e-12
# Largest coupling of even and odd motions of an element, relative to its largest stiffness.
SYMMETRIC = 1e-14
# The structure Block of kernels.c.
BLOCK = np.dtype([(name, np.uint64) for name in ("group", "place", "data")])


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
        # Sums over the points are products of sums along xi and eta.
        if nn == family.shape.nodes == 9 and not rules.assumes_shear:
            for name, count, rule in zip(
                ("rotations", "deflection"), ("bending", "shear"), self.rules, strict=True
            ):
                self.arrays[name] = distinct(rule.xi)
                self.arrays[name + "_t"] = rule.weights[np.lexsort((rule.eta, rule.xi))]
                self.numbers[count] = len(self.arrays[name])
            self.numbers["kind"] = FACTORIZED
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

    def _at_points(self, rule: Quadrature, family: ElementBlock, members: Indices) -> Floats:
        """Inverse Jacobian, and its determinant times the weight, (ne, npt, 5)."""
        _, local = local_shape_functions(family, rule)
        inverse, determinant = jacobians(family, local, self.plate.rules.transposed_jacobian)
        jxw = determinant * rule.weights * self.weights[members, None]
        return np.concatenate([inverse, jxw[:, :, None]], axis=2)

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
        """Numbers of elements without a matrix, (blocks, numbers, 8); see Block of kernels.c."""
        family = self.family.take(members)
        if self.numbers["kind"] == FACTORIZED:
            places = family.coordinates[:, self.order]
            # Coefficients (eta, xi) of a biquadratic function of nodal values.
            c = (places - places[:, 4:5]).reshape(-1, 3, 3, 2)
            for axis in (1, 2):
                first, middle, last = np.moveaxis(c, axis, 0)
                c = np.stack([middle, last - first, first + last - 2.0 * middle], axis=axis)
            parts = [
                0.25 * self.weights[members, None],
                *c.reshape(-1, 9, 2)[:, 1:].transpose(2, 0, 1),
            ]
        else:
            parts = [self._at_points(rule, family, members) for rule in self.rules]
            if self.plate.rules.assumes_shear:
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
    (a, b), (c, d) = jacobian(family, local).transpose(2, 3, 0, 1)  # x, y by xi; x, y by eta
    determinant = a * d - b * c
    rows = (d, -c, -b, a) if transposed else (d, -b, -c, a)
    return np.stack(rows, axis=2) / determinant[:, :, None], determinant


class CompiledPlate:
    """A plate in the layout of the kernels.

    Vectors have a part (nd, nodes) for each chunk, and a last one for the nodes that chunks share;
    `position` (count,) are the places of the independent dofs in them.
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
        families, nd, leader = [g.family for g in groups], len(columns), _leaders(kept)
        layout = layout_of(families)
        places = places_of(layout, families, leader)
        firsts, sizes, (chunk, place) = places.firsts, places.sizes, places.home
        nodes, dofs = np.nonzero(moves & (chunk >= 0)[:, None])
        # A dof that follows another has a node without a home.
        first, size, dof = firsts[chunk[nodes]], sizes[chunk[nodes]], dofs - columns[0]
        index = kept.index[nodes, dofs]
        self.position = np.empty(kept.count, dtype=np.intp)
        self.position[index] = nd * first + dof * size + place[nodes]
        mass = np.zeros((nd, count := int(sizes.sum())))
        masses = kept.gather(kept.sign * plate.field(plate.mass, 0.0))
        mass[dof, first + place[nodes]] = masses[index]
        parts = [mass[:, a : a + n] for a, n in zip(firsts.tolist(), sizes.tolist(), strict=True)]
        self._ratio, factor = _factors(mass)
        if factor is None:
            factor = np.concatenate([part.ravel() for part in parts])
        inverse = np.zeros_like(factor)
        np.divide(1.0, factor, out=inverse, where=factor > 0.0)
        self._rate = np.empty(nd)
        self.u, self.d, self.s = np.zeros((3, nd * count))
        cuts = (Chunk * len(parts))()
        self._held.append(cuts)
        for c, part in enumerate(parts):
            here = places.node[places.starts[c] : places.starts[c + 1]]
            copies = np.flatnonzero(chunk[here] != c)
            copied = leader[here[copies]]
            signs = np.where((copied != here[copies])[:, None], TURNED[columns], 1.0)
            at_rest = np.flatnonzero(part <= 0.0)
            cuts[c] = Chunk(
                0, None, int(firsts[c]), part.shape[1], len(copies), len(at_rest),
                self._ints(place[copied]), self._ints(copies), self._ints(at_rest),
                self._floats(signs), self._floats(np.zeros(signs.shape)),
            )  # fmt: skip
        lanes = self._blocks(cuts, layout, groups, places)
        laminate = plate.laminate
        stiffness = np.block([[laminate.A, -laminate.B], [-laminate.B, laminate.D]])
        self.structure = Plate(
            nd, layout.chunks, count, int(sizes.max()), cuts, self._ints(lanes),
            self._floats(stiffness), self._floats(laminate.shear),
            int(plate.rules.transposed_jacobian), len(factor) // count,
            self._floats(factor), self._floats(inverse),
            floats(self._ratio), None, floats(self.u), floats(self.d), floats(self.s),
            self._floats(np.zeros(parts[-1].size)), 0.0,
        )  # fmt: skip

    def _blocks(
        self, cuts: Any, layout: Layout, groups: list[_Elements], places: Places
    ) -> Indices:
        """Give the chunks their blocks; returns places of lanes that don't follow one another."""
        counts, left = np.diff(places.starts), places.at
        table = np.zeros(len(layout.group), dtype=BLOCK)
        self._held.append(table)
        lanes: list[Indices] = []
        rows_before, elements_before = 0, 0
        for number, elements in enumerate(groups):
            (rows,) = np.nonzero(layout.group == number)
            member = layout.element[rows] - elements_before
            elements_before += len(elements.family.rows)
            own, left = np.split(left, [elements.family.nodes.size])
            at = own.reshape(elements.family.nodes.shape)[:, elements.order][member].swapaxes(1, 2)
            # Behind the nodes is a place for lanes without an element.
            at = np.where(layout.filled[rows, None], at, counts[layout.chunk[rows], None, None])
            apart = (np.diff(at, axis=2) != 1).any(axis=2)
            lanes.append(at[apart])
            begins = at[:, :, 0].copy()
            begins[apart] = -1 - rows_before - np.arange(len(lanes[-1]))
            rows_before += len(lanes[-1])
            arrays = {name: self._floats(array) for name, array in elements.arrays.items()}
            made = Group(**elements.numbers, **arrays)
            self._held.append(made)
            table["group"][rows] = ctypes.addressof(made)
            table["place"][rows] = self._addresses(begins.astype(np.int32))
            if "matrix" not in elements.arrays:
                table["data"][rows] = self._addresses(elements.data(member.ravel()))
        blocks = np.searchsorted(layout.chunk, np.arange(layout.chunks + 1))
        for c in range(layout.chunks):
            where = ctypes.c_void_p(table.ctypes.data + int(blocks[c]) * BLOCK.itemsize)
            cuts[c].blocks = int(blocks[c + 1] - blocks[c])
            cuts[c].block = ctypes.cast(where, type(cuts[c].block))
        return np.concatenate(lanes)

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

    def set_scale(self, dt2: float | None) -> None:
        """Make the kernels scale K u by dt2 and the inverse mass; by 1 without dt2."""
        if dt2 is not None:
            np.divide(dt2, self._ratio, out=self._rate)
        self.structure.rate = None if dt2 is None else floats(self._rate)

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
        rests = kept.sign == 0.0
        self._field = self.plate.position[np.where(rests, 0, kept.index)]
        self._sign = kept.sign

    def each(self, padded: Floats, use: Callable[[int, Floats], R]) -> list[R]:
        """Compute K u and apply a function to each piece."""
        if self._signed:
            np.negative(padded[: self._count], out=padded[self._count : -1])
        plate = self.plate
        plate.u[plate.position] = padded[: self._count]
        plate.set_scale(None)
        plate.internal_force(self._threads)
        forces = plate.s[plate.position]
        return [use(number, forces[piece]) for number, piece in enumerate(self._pieces)]

    def fields(self, stored: Floats) -> Floats:
        """Fields (rows, numnp, 5) of stored vectors (rows, entries)."""
        fields = stored.take(self._field, axis=1)
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


def _leaders(kept: SymmetryReduction) -> Indices:
    """Node that each node follows, (numnp,): itself if it moves independently."""
    numnp = len(kept.index)
    nodes, dofs = np.nonzero(kept.sign)
    index = kept.index[nodes, dofs]
    first = np.empty(kept.count, dtype=np.intp)
    first[index[::-1]] = nodes[::-1]  # the lowest is assigned last
    leader = np.arange(numnp)
    leader[nodes] = first[index]
    return leader


def _factors(mass: Floats) -> tuple[Floats, Floats | None]:
    """Ratio of the masses of a node's dofs, (nd,), and factors of nodes; None if it differs.

    The ratio is that of the laminate, but for supports, where masses are 0.
    """
    whole = np.flatnonzero((mass > 0.0).all(axis=0))
    if len(whole):
        ratio = mass[:, whole[:1]] / mass[0, whole[0]]
        factor = (mass / ratio).max(axis=0)
        if ((abs(factor * ratio - mass) <= EQUAL * mass) | (mass <= 0.0)).all():
            return ratio[:, 0].copy(), factor
    return np.ones(len(mass)), None


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
