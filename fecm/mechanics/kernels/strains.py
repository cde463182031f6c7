"""Strains and curvatures of elements by the compiled kernels.

Midplane strains, curvatures and their derivatives.  In: a displacement field, (numnp, 5).  Out:
strains (elements, points, 6) and gradients (elements, 2, 6), as in
:meth:`~fecm.mechanics.ply_stresses.PlyStresses.strains`.  If the midplane does not stretch, only
the curvatures are computed, (elements, points, 3) and (elements, 2, 3).

Strain fields.  In: displacement fields (fields, numnp, 5).  Out: strains (5, fields, numel,
points), as in :class:`~fecm.mechanics.strains.StrainField`.

Both compute four points of an element at once.  Tables are zero-padded to a multiple of four
points.
"""

from __future__ import annotations

import ctypes
import math
from ctypes import c_int64
from functools import cached_property

import numpy as np

from fecm._typing import Bools, Floats
from fecm.mechanics import strains as assumed_shear
from fecm.mechanics.elements import Quadrature, gauss
from fecm.mechanics.interpolation import interpolate, local_shape_functions
from fecm.mechanics.kernels import LIBRARY, Doubles, Longs, Structure, filled, floats
from fecm.mechanics.kernels.element_groups import jacobians, slopes_of_mapping
from fecm.mechanics.membrane import QuadraticStrains
from fecm.mechanics.mesh import ElementBlock
from fecm.mechanics.ply_stresses import PlyStresses, second_derivatives
from fecm.mechanics.strains import FLAT, STRAINS, Curvature, StrainField, strain_of_deflection

TYING = 12  # tying points of w,1 or w,2, padded to a multiple of four; also in structures.h


class MidplaneStruct(Structure):
    """Elements with the same nodes present, `elements` of `nodes` nodes, and their points.

    The arrays; the last four are set only for a nonlinear plate:

    ==============  =======================  ===================================================
    `row`           (elements,)              number of the element in the result
    `node`          (elements, nodes)        numbers of its nodes
    `shape`         (elements,)              row of the arrays of shapes
    `table`         (nodes, 3, width)        slopes in xi and eta, and value, of the shape functions
    `metric`        (shapes, 4, width)       inverse Jacobian, 1/length
    `initial`       (3,)                     midplane strains of the undeformed plate
    `curved`        (3,)                     midplane strains per w; not set for a flat plate
    `centre`        (shapes, 5, nodes)       derivatives of the shape functions at the centre, xx,
                                             yy, xy, x, y; not set without nine nodes
    `tying`         (nodes, 2, 2, TYING)     slopes in xi and eta at the tying points of w,1 and w,2
    `tying_metric`  (shapes, 2, 2, TYING)    w,1 and w,2 per slope in xi and in eta
    `tied`          (16, width)              interpolation of e_11 (6), e_22 (6) and e_12 (4)
    `tied_strain`   (shapes, 3, 3)           strains xx, yy, xy per e_11, e_22, e_12
    ==============  =======================  ===================================================
    """

    _fields_ = (
        ("elements", c_int64),
        ("nodes", c_int64),
        ("points", c_int64),
        ("width", c_int64),  # number of points, padded to a multiple of four
        ("row", Longs),
        ("node", Longs),
        ("shape", Longs),
        ("table", Doubles),
        ("metric", Doubles),
        ("initial", Doubles),
        ("curved", Doubles),
        ("centre", Doubles),
        ("tying", Doubles),
        ("tying_metric", Doubles),
        ("tied", Doubles),
        ("tied_strain", Doubles),
    )


def midplanes(stresses: PlyStresses, chosen: Bools) -> list[MidplaneStruct]:
    """Return the structures of those elements of ply stresses that are chosen, (elements,)."""
    structures = []
    for family, complete in stresses.families:
        members = np.flatnonzero(chosen[family.rows])
        if len(members):
            part = family if len(members) == len(family.rows) else family.take(members)
            structures.append(
                midplane(
                    part,
                    stresses.rule,
                    initial=stresses.initial,
                    curvature=stresses.curvature,
                    nonlinear=stresses.nonlinear,
                    complete=complete,
                )
            )
    return structures


def midplane(
    family: ElementBlock,
    rule: Quadrature,
    *,
    initial: Floats | None = None,
    curvature: Curvature = FLAT,
    nonlinear: bool = False,
    complete: bool = False,
) -> MidplaneStruct:
    """Return the structure of a family at the points of a rule.

    With `complete` it has the derivatives at the centre, which need elements of nine nodes.
    """
    congruence = family.congruence
    shapes = family.take(congruence.representatives)
    values, local = local_shape_functions(family, rule)
    inverse, _ = jacobians(shapes, local, transposed=False)
    table = filled(np.stack([*local.transpose(1, 2, 0), values.T], axis=1))
    centre = None
    if complete:
        slopes = interpolate(shapes, gauss(1)).dN[:, 0]
        centre = np.concatenate([second_derivatives(shapes), slopes], axis=1)
    return MidplaneStruct(
        elements=len(family.rows),
        nodes=family.nodes.shape[1],
        points=len(rule.xi),
        width=table.shape[2],
        row=np.ascontiguousarray(family.rows, dtype=np.int64),
        node=np.ascontiguousarray(family.nodes, dtype=np.int64),
        shape=np.ascontiguousarray(congruence.group, dtype=np.int64),
        table=table,
        metric=filled(inverse.swapaxes(1, 2)),
        initial=np.zeros(3) if initial is None else np.ascontiguousarray(initial),
        curved=None if curvature == FLAT else strain_of_deflection(curvature),
        centre=centre,
        **(_quadratic(QuadraticStrains(shapes, rule)) if nonlinear else {}),
    )


def _quadratic(tied: QuadraticStrains) -> dict[str, Floats]:
    """Return the arrays of the quadratic strains of a nonlinear plate."""
    slopes = [table.reshape(2, -1, table.shape[1]) for table in tied.tables]  # (2, tying, nodes)
    return {
        "tying": filled(np.stack(slopes).transpose(3, 0, 1, 2)),
        "tying_metric": filled(np.stack(tied.metric).transpose(3, 0, 1, 2)),
        "tied": filled(np.concatenate([weights.T for weights in tied.weights])),
        "tied_strain": np.ascontiguousarray(tied.to_global.transpose(2, 0, 1)),
    }


class StrainsStruct(Structure):
    """Elements with the same nodes present, `elements` of `nodes` nodes, and their points.

    The arrays:

    =============  ===================  ======================================================
    `row`          (elements,)          number of the element in the result
    `node`         (elements, nodes)    numbers of its nodes
    `shape`        (elements,)          row of `metric` and of `mapping`
    `table`        (nodes, 3, width)    slopes in xi and eta, and value, of the shape functions
    `metric`       (shapes, 4, width)   inverse Jacobian of the elements of one shape, 1/length
    Assumed shear strains:
    `tying_table`  (nodes, 2, tying)    slope in the direction of the strain, and value
    `mapping`      (shapes, 2, tying)   slopes of x and of y in this direction, length
    `tied`         (tying, width)       interpolation between the tying points of a strain
    =============  ===================  ======================================================
    """

    _fields_ = (
        ("elements", c_int64),
        ("nodes", c_int64),
        ("points", c_int64),
        ("width", c_int64),  # number of points, padded to a multiple of four
        ("tying", c_int64),  # tying points of both assumed shear strains, e_xi first; or 0
        ("row", Longs),
        ("node", Longs),
        ("shape", Longs),
        ("table", Doubles),
        ("metric", Doubles),
        ("tying_table", Doubles),
        ("mapping", Doubles),
        ("tied", Doubles),
    )


class CompiledStrains(StrainField):
    """Strain field that the compiled kernels evaluate."""

    @cached_property
    def _structures(self) -> list[StrainsStruct]:
        """Structure of each family."""
        return [self.structure(family) for family in self.families]

    def structure(self, family: ElementBlock) -> StrainsStruct:
        """Return the structure of elements of the field with the same nodes present."""
        congruence = family.congruence
        values, local = local_shape_functions(family, self.rule)
        shapes = family.take(congruence.representatives)
        inverse, _ = jacobians(shapes, local, self.transposed_jacobian)
        nodes = family.nodes.shape[1]
        points = self.shape[1]
        width = -(-points // 4) * 4
        table = np.zeros((nodes, 3, width))
        table[:, :2, :points] = local.transpose(2, 1, 0)
        table[:, 2, :points] = values.T
        metric = np.zeros((len(inverse), 4, width))
        metric[:, :, :points] = inverse.swapaxes(1, 2)
        tied = self._tied(shapes, width) if self.assumes_shear else {}
        return StrainsStruct(
            elements=len(family.rows),
            nodes=nodes,
            points=points,
            width=width,
            row=np.ascontiguousarray(family.rows, dtype=np.int64),
            node=np.ascontiguousarray(family.nodes, dtype=np.int64),
            shape=np.ascontiguousarray(congruence.group, dtype=np.int64),
            table=table,
            metric=metric,
            **tied,
        )

    def _tied(self, shapes: ElementBlock, width: int) -> dict[str, int | Floats]:
        """Return the fields of assumed shear strains, for an element of each shape."""
        nodes, points = shapes.nodes.shape[1], self.shape[1]
        tables: list[Floats] = []
        weights: list[Floats] = []
        for axis in (0, 1):
            values, local = local_shape_functions(shapes, assumed_shear.tying_points(nodes, axis))
            tables.append(np.stack([local[:, axis], values]))
            weights.append(assumed_shear.tying_weights(nodes, axis, self.rule))
        table = np.concatenate(tables, axis=1)  # (2, tying, nodes)
        mapping = np.concatenate(slopes_of_mapping(shapes), axis=1)  # (shapes, tying, 2)
        tying = table.shape[1]
        tied = np.zeros((tying, width))
        tied[:, :points] = np.concatenate(weights, axis=1).T
        return {
            "tying": tying,
            "tying_table": np.ascontiguousarray(table.transpose(2, 0, 1)),
            "mapping": np.ascontiguousarray(mapping.swapaxes(1, 2)),
            "tied": tied,
        }

    def evaluate(self, displacement: Floats) -> Floats:
        """Return the strains of fields; see :meth:`StrainField.evaluate`."""
        *leading, numnp, _ = displacement.shape
        fields = np.ascontiguousarray(displacement)
        count = math.prod(leading)
        strains = np.empty((len(STRAINS), *leading, *self.shape))
        for structure in self._structures:
            LIBRARY.fecm_strains(
                ctypes.byref(structure),
                count,
                numnp,
                self.shape[0],
                floats(fields),
                floats(strains),
            )
        return strains
