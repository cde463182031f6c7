"""Groups of elements for the compiled kernels, which share one matrix or the same tables."""

from __future__ import annotations

from ctypes import c_int64
from dataclasses import replace
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from fecm._typing import Floats
from fecm.mechanics import strains
from fecm.mechanics.elements import Quadrature
from fecm.mechanics.interpolation import NDOF, jacobian, local_shape_functions
from fecm.mechanics.kernels import Doubles, Integers, Structure, membrane
from fecm.mechanics.kernels.layout import LANES, Indices
from fecm.mechanics.mesh import ElementBlock, distinct
from fecm.mechanics.plate import PlateModel
from fecm.mechanics.strains import FLAT
from fecm.mechanics.symmetry import TURNED, opposite_nodes

# A shared matrix of fewer congruent elements would leave too many lanes empty.
WORTH_GROUPING = 8
# Largest coupling of even and odd motions of an element, relative to its largest stiffness.
SYMMETRIC = 1e-14


# Fields of a GroupStruct by name.
Fields = dict[str, int | Floats | NDArray[np.int32]]


class ElementKind(IntEnum):
    """How the kernels compute K u of a group."""

    ONE_MATRIX = 0  # one matrix for all elements
    TWO_MATRICES = 1  # one matrix for motions even under a half turn, one for odd motions
    FACTORIZED = 2  # quadrature of 9-node elements, along xi and then along eta
    TABULATED = 3  # quadrature with tables of the shape functions


class GroupStruct(Structure):
    """Elements with the same nodes present and the same laminate, with or without a matrix.

    Arrays that a kind does not use are not set.  n is the number of dofs of an element, `nodes`
    times nd.  The dimensions `bending`, `shear` and `tying` are numbers of points.

    ================  ============================  ==========================================
    Field             Shape                         Meaning
    ================  ============================  ==========================================
    ONE_MATRIX:
    `matrix`          (n, n)                        stiffness, dof by dof and then node by node
    TWO_MATRICES:
    `pairs`           number                        node i < `pairs` and i + `pairs` are images
    `matrix`          (even, even) and (odd, odd)   stiffness of even, then of odd motions
    FACTORIZED:
    `bending`         number                        points in a direction; likewise `shear`
    `rotations`       (bending,)                    points of bending, ascending
    `rotations_t`     (bending, bending)            weights of the points of bending
    `deflection`      (shear,)                      points of shear, ascending
    `deflection_t`    (shear, shear)                weights of the points of shear
    `tying`           number                        whether shear strains are assumed
    TABULATED:
    `bending`         number                        points; likewise `shear`
    `tying`           number                        tying points of each strain, or 0
    `rotations`       (2 bending + values, nodes)   slopes in xi, in eta, and values
    `deflection`      (slopes, nodes)               slopes in xi and in eta
    `rotations_t`     transposed                    likewise `deflection_t`
    `in_plane_t`      (nodes, 2 bending)            slopes at the points of bending
    `tied`            (2, shear, tying)             weights between the tying points
    `tied_t`          (2, tying, shear)             transposed
    Nonlinear plate:
    `parallelograms`  number                        whether all are, in a flat plate
    `curved`          number                        whether the plate is curved
    `grid`            (9,)                          places of the nodes in rows of eta
    All:
    `stiffness`       (6, 6)                        of midplane strains and negative curvatures
    `transverse`      (2, 2)                        transverse shear stiffness
    `coupled`         number                        whether B is not 0
    ================  ============================  ==========================================

    With a preload, the slopes at the points of bending are appended to `deflection`.  With a
    curvature, the values at these points are appended after them.
    """

    _fields_ = (
        ("kind", c_int64),
        ("nodes", c_int64),
        ("pairs", c_int64),
        ("matrix", Doubles),
        ("bending", c_int64),
        ("shear", c_int64),
        ("tying", c_int64),
        ("rotations", Doubles),
        ("deflection", Doubles),
        ("rotations_t", Doubles),
        ("deflection_t", Doubles),
        ("in_plane_t", Doubles),
        ("tied", Doubles),
        ("tied_t", Doubles),
        ("parallelograms", c_int64),
        ("curved", c_int64),
        ("grid", Integers),
        ("stiffness", Doubles),
        ("transverse", Doubles),
        ("coupled", c_int64),
    )


class ElementGroup:
    """Elements of a family that share a matrix, or that have no matrix.

    `family` is one of `plate.families`, or a part of one.  `columns` are the moving dofs of a node.
    `weights` is the number of elements that each element represents.  `order` is the order of the
    nodes of an element in the arrays.
    """

    def __init__(
        self,
        plate: PlateModel,
        family: ElementBlock,
        columns: Indices,
        weights: Floats,
        *,
        congruent: bool,
        nonlinear: bool = False,
    ) -> None:
        # The membrane of a nonlinear plate contains the strains w/R.
        self._plate = replace(plate, curvature=FLAT) if nonlinear else plate
        self._curvature = plate.curvature
        self._columns = columns
        self._weights = weights
        self._nonlinear = nonlinear
        self.family = family
        nn = family.nodes.shape[1]
        self.order = np.arange(nn)
        rules = plate.rules
        shear = strains.quadrature(family) if rules.assumes_shear else rules.shear
        self._rules = (rules.bending, shear)
        if nonlinear:
            self._rules = (membrane.in_rows(rules.bending), shear)
        if congruent:
            self.kind, fields = self._matrices(weights[0])
        elif self._is_factorized():
            self.order = np.lexsort((family.shape.xi, family.shape.eta))
            self.kind, fields = ElementKind.FACTORIZED, self._factors()
        else:
            self.kind, fields = ElementKind.TABULATED, self._tables()
        curved = nonlinear and plate.is_curved
        self.parallelograms = (
            nonlinear and not curved and bool(membrane.are_parallelograms(family).all())
        )
        if nonlinear:
            places = np.argsort(self.order)[membrane.node_grid(family)]
            fields["grid"] = places.astype(np.int32)
        laminate = plate.laminate_of(family)
        self.structure = GroupStruct(
            kind=self.kind,
            nodes=nn,
            parallelograms=int(self.parallelograms),
            curved=int(curved),
            stiffness=np.block([[laminate.A, -laminate.B], [-laminate.B, laminate.D]]),
            transverse=np.ascontiguousarray(laminate.shear),
            coupled=int(laminate.is_coupled),
            **{
                name: value if isinstance(value, int) else np.ascontiguousarray(value)
                for name, value in fields.items()
            },
        )

    @property
    def has_matrix(self) -> bool:
        """Whether the elements share a matrix."""
        return self.kind in (ElementKind.ONE_MATRIX, ElementKind.TWO_MATRICES)

    @property
    def needs_data(self) -> bool:
        """Whether the kernels need data at the points of quadrature."""
        return not self.has_matrix

    def _is_factorized(self) -> bool:
        """Return whether the kernels sum along xi, then eta, for elements without a matrix."""
        plate, family, rules = self._plate, self.family, self._plate.rules
        return family.nodes.shape[1] == family.shape.nodes == 9 and not (
            plate.is_preloaded
            or plate.is_curved
            or (rules.assumes_shear and rules.transposed_jacobian)
        )

    def _distinct_members(self, members: Indices) -> Indices:
        """Replace congruent elements by the first element in all lanes of one block."""
        return np.zeros(LANES, dtype=np.intp) if self.has_matrix else members

    def _matrices(self, weight: float) -> tuple[ElementKind, Fields]:
        """Return the shared matrix, or the matrices of even and odd motions; set the order."""
        nn = self.family.nodes.shape[1]
        columns = self._columns
        K = weight * self._plate.stiffness_of(self.family.take(np.array([0])))[0]
        K = K.reshape(nn, NDOF, nn, NDOF).transpose(1, 0, 3, 2)[columns][:, :, columns]
        opposite = opposite_nodes(self.family)
        if opposite is not None:
            first = np.flatnonzero(opposite > np.arange(nn))
            centre = np.flatnonzero(opposite == np.arange(nn))
            order = np.concatenate([first, opposite[first], centre])
            halves = self._halves(K[:, order][:, :, :, order], len(first))
            if halves is not None:
                self.order = order
                return ElementKind.TWO_MATRICES, {"pairs": len(first), "matrix": halves}
        return ElementKind.ONE_MATRIX, {"matrix": K.reshape(nn * len(columns), -1).copy()}

    def _halves(self, K: Floats, pairs: int) -> Floats | None:
        """Return the matrices of even and odd motions, flattened; None if they are coupled."""
        nd, nn = K.shape[:2]
        even: list[Floats] = []
        odd: list[Floats] = []
        unit = np.eye(nd * nn).reshape(nd, nn, -1)
        for dof, column in enumerate(self._columns):
            first = unit[dof, :pairs]
            image = unit[dof, pairs : 2 * pairs]
            centre = unit[dof, 2 * pairs :]
            if TURNED[column] > 0.0:
                even += [*(first + image), *centre]
                odd += list(first - image)
            else:
                even += list(first - image)
                odd += [*(first + image), *centre]
        T = np.array(even + odd)
        scale = 1.0 / (T**2).sum(axis=1)
        transformed = scale[:, None] * (T @ K.reshape(nd * nn, -1) @ T.T) * scale
        n = len(even)
        coupled = max(abs(transformed[:n, n:]).max(), abs(transformed[n:, :n]).max())
        if coupled > SYMMETRIC * abs(transformed).max():
            return None
        return np.concatenate([transformed[:n, :n].ravel(), transformed[n:, n:].ravel()])

    def _factors(self) -> Fields:
        """Return the points of a direction, and the points' weights in rows of eta."""
        bending, shear = self._rules
        of_bending = distinct(bending.xi)
        of_shear = distinct(shear.xi)
        return {
            "bending": len(of_bending),
            "rotations": of_bending,
            "rotations_t": _in_rows(bending),
            "shear": len(of_shear),
            "deflection": of_shear,
            "deflection_t": _in_rows(shear),
            "tying": int(self._plate.rules.assumes_shear),
        }

    def _tables(self) -> Fields:
        """Return values and slopes of the shape functions at the points of quadrature."""
        family = self.family
        bending, shear = self._rules
        nn = family.nodes.shape[1]
        fields: Fields = {"bending": len(bending.xi), "shear": len(shear.xi)}
        at_bending, local = local_shape_functions(family, bending)
        slopes = _slopes(local)
        if self._plate.rules.assumes_shear:
            tied = [
                local_shape_functions(family, strains.tying_points(nn, axis)) for axis in (0, 1)
            ]
            weights = [strains.tying_weights(nn, axis, shear) for axis in (0, 1)]
            values = np.concatenate([value for value, _ in tied])
            deflection = np.concatenate([slopes[:, axis] for axis, (_, slopes) in enumerate(tied)])
            fields["tying"] = len(tied[0][0])
            fields["tied"] = np.stack(weights)
            fields["tied_t"] = np.stack([table.T for table in weights])
        else:
            values, local = local_shape_functions(family, shear)
            deflection = _slopes(local)
        if self._plate.is_preloaded:
            deflection = np.concatenate([deflection, slopes])
        if self._plate.is_curved:
            deflection = np.concatenate([deflection, at_bending])
        rotations = np.concatenate([slopes, values])
        return fields | {
            "rotations": rotations,
            "rotations_t": rotations.T,
            "in_plane_t": slopes.T,
            "deflection": deflection,
            "deflection_t": deflection.T,
        }

    def data(self, members: Indices) -> Floats:
        """Return the data of elements without a matrix, (blocks, numbers, 8).

        FACTORIZED elements have a factor, and coefficients of x and of y, (1 + 8 + 8).  TABULATED
        elements have the inverse Jacobian with its determinant times the weight, (points, 5), and
        slopes of the mapping at the tying points, (2 tying, 2).  Congruent elements have one block.
        """
        members = self._distinct_members(members)
        if self.kind == ElementKind.FACTORIZED:
            family = self.family.take(members)
            return _in_lanes(membrane.shape_numbers(family, self._weights[members]))
        family = self.family.take(members)
        assumed, swaps = self._plate.rules.assumes_shear, self._plate.rules.transposed_jacobian
        # Assumed shear strains never use the transposed Jacobian.
        transposed_of = (swaps, swaps and not assumed)
        parts = [
            self._at_points(rule, family, members, transposed=transposed)
            for rule, transposed in zip(self._rules, transposed_of, strict=True)
        ]
        if assumed:
            parts += slopes_of_mapping(family)
        return _in_lanes(np.concatenate([part.reshape(len(members), -1) for part in parts], axis=1))

    def membrane(self, members: Indices) -> Floats:
        """Return the membrane data, (blocks, numbers, 8); congruent elements have one block."""
        members = self._distinct_members(members)
        family, weights = self.family.take(members), self._weights[members]
        return _in_lanes(
            membrane.numbers(
                self._plate,
                family,
                weights,
                self._curvature,
                parallelograms=self.parallelograms,
            )
        )

    def _at_points(
        self, rule: Quadrature, family: ElementBlock, members: Indices, *, transposed: bool
    ) -> Floats:
        """Return the inverse Jacobian, and its determinant times the weight, (ne, npt, 5)."""
        _, local = local_shape_functions(family, rule)
        inverse, determinant = jacobians(family, local, transposed)
        jxw = determinant * rule.weights * self._weights[members, None]
        return np.concatenate([inverse, jxw[:, :, None]], axis=2)


def grouped(
    family: ElementBlock, weights: Floats, *, nonlinear: bool = False
) -> list[tuple[Indices, bool]]:
    """Group a family's elements, and return whether each group is congruent.

    Elements of weight 0 are images of other elements and are left out.  For a nonlinear plate a
    group contains either parallelograms or other elements.
    """
    congruence = family.congruence
    (members,) = np.nonzero(weights)
    key = 3 * congruence.group[members] + weights[members].astype(int)
    _, group, counts = np.unique(key, return_inverse=True, return_counts=True)
    shared = np.flatnonzero(counts >= WORTH_GROUPING)
    groups = [(members[group == number], True) for number in shared.tolist()]
    single = members[counts[group] < WORTH_GROUPING]
    parts = [single]
    if nonlinear:
        flat = membrane.are_parallelograms(family.take(single))
        parts = [single[flat], single[~flat]]
    return [*groups, *((part, False) for part in parts if len(part))]


def _in_lanes(values: Floats) -> Floats:
    """Arrange data of elements, (ne, numbers), in lanes, (blocks, numbers, 8)."""
    return np.ascontiguousarray(values.reshape(-1, LANES, values.shape[1]).swapaxes(1, 2))


def _in_rows(rule: Quadrature) -> Floats:
    """Return the weights of the points, along xi first."""
    return np.asarray(rule.weights[np.lexsort((rule.eta, rule.xi))])


def _slopes(local: Floats) -> Floats:
    """Return slopes in xi at all points, then in eta, (2 npt, nn), from (npt, 2, nn)."""
    return local.transpose(1, 0, 2).reshape(-1, local.shape[2])


def slopes_of_mapping(family: ElementBlock) -> list[Floats]:
    """Return x,xi and y,xi at the tying points of e_xi; likewise for eta; (ne, tying, 2) each."""
    nn = family.nodes.shape[1]
    slopes: list[Floats] = []
    for axis in (0, 1):
        _, local = local_shape_functions(family, strains.tying_points(nn, axis))
        slopes.append(np.einsum("tn,eni->eti", local[:, axis], family.coordinates))
    return slopes


def jacobians(family: ElementBlock, local: Floats, transposed: bool) -> tuple[Floats, Floats]:
    """Return the inverse Jacobian (ne, npt, 4) and the determinant (ne, npt), in closed form.

    See :func:`fecm.mechanics.interpolation.inverse_jacobian`.
    """
    (a, b), (c, d) = jacobian(family, local).transpose(2, 3, 0, 1)  # x, y by xi; x, y by eta
    determinant = a * d - b * c
    rows = (d, -c, -b, a) if transposed else (d, -b, -c, a)
    return np.stack(rows, axis=2) / determinant[:, :, None], determinant
