"""Strains by the compiled kernels.

In: displacement fields (fields, numnp, 5).  Out: strains (5, fields, numel, points), as
:class:`~fecm.mechanics.strains.StrainField` has them.  Four points of an element are computed at
once; tables are filled up to fours of points with zeros.
"""

from __future__ import annotations

import ctypes
import math
from ctypes import c_int64
from functools import cached_property

import numpy as np

from fecm._typing import Floats
from fecm.mechanics import assumed_shear
from fecm.mechanics.interpolation import local_shape_functions
from fecm.mechanics.kernels import LIBRARY, Doubles, Longs, Structure, floats
from fecm.mechanics.kernels.element_groups import jacobians, slopes_of_mapping
from fecm.mechanics.mesh import ElementBlock
from fecm.mechanics.strains import STRAINS, StrainField


class Strains(Structure):
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
        ("width", c_int64),  # number of points, filled up to fours
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
    """The same strains."""

    @cached_property
    def _structures(self) -> list[Strains]:
        """A structure of each family."""
        return [self._structure(family) for family in self.families]

    def _structure(self, family: ElementBlock) -> Strains:
        same = family.congruence
        values, local = local_shape_functions(family, self.rule)
        inverse, _ = jacobians(family.take(same.representatives), local, self.transposed_jacobian)
        nodes = family.nodes.shape[1]
        points = self.shape[1]
        width = -(-points // 4) * 4
        table = np.zeros((nodes, 3, width))
        table[:, :2, :points] = local.transpose(2, 1, 0)
        table[:, 2, :points] = values.T
        metric = np.zeros((len(inverse), 4, width))
        metric[:, :, :points] = inverse.swapaxes(1, 2)
        tied = self._tied(family.take(same.representatives), width) if self.assumes_shear else {}
        return Strains(
            elements=len(family.rows),
            nodes=nodes,
            points=points,
            width=width,
            row=np.ascontiguousarray(family.rows, dtype=np.int64),
            node=np.ascontiguousarray(family.nodes, dtype=np.int64),
            shape=np.ascontiguousarray(same.group, dtype=np.int64),
            table=table,
            metric=metric,
            **tied,
        )

    def _tied(self, shapes: ElementBlock, width: int) -> dict[str, int | Floats]:
        """Fields of assumed shear strains, for an element of each shape."""
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
        """Strains of fields; see :meth:`StrainField.evaluate`."""
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
