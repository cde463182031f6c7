"""Strains by the compiled kernels."""

from __future__ import annotations

import ctypes
import math
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fecm._typing import Floats
from fecm.mechanics.interpolation import local_shape_functions
from fecm.mechanics.kernels import LIBRARY, Longs, Strains, floats
from fecm.mechanics.kernels.plate import jacobians
from fecm.mechanics.mesh import congruence
from fecm.mechanics.strains import STRAINS, StrainField


class CompiledStrains(StrainField):
    """The same strains; those of assumed shear strains remain NumPy's."""

    @cached_property
    def _structures(self) -> list[tuple[Strains, list[NDArray[Any]]]]:
        """A structure of each family, with the arrays that it points to."""
        made = []
        points = self.shape[1]
        width = -(-points // 4) * 4
        for family in self.families:
            same = congruence(family)
            values, local = local_shape_functions(family, self.rule)
            inverse, _ = jacobians(
                family.take(same.representatives), local, self.transposed_jacobian
            )
            nodes = family.nodes.shape[1]
            table, metric = np.zeros((nodes, 3, width)), np.zeros((len(inverse), 4, width))
            table[:, :2, :points] = local.transpose(2, 1, 0)
            table[:, 2, :points] = values.T
            metric[:, :, :points] = inverse.swapaxes(1, 2)
            longs = [np.ascontiguousarray(a, dtype=np.int64)
                     for a in (family.rows, family.nodes, same.group)]  # fmt: skip
            pointers: list[Any] = [array.ctypes.data_as(Longs) for array in longs]
            pointers += [floats(array) for array in (table, metric)]
            numbers = len(family.rows), nodes, points, width
            made.append((Strains(*numbers, *pointers), [*longs, table, metric]))
        return made

    def evaluate(self, displacement: Floats) -> Floats:
        """Strains of fields; see :meth:`StrainField.evaluate`."""
        if self.assumes_shear:
            return super().evaluate(displacement)
        *leading, numnp, _ = displacement.shape
        fields, count = np.ascontiguousarray(displacement), math.prod(leading)
        strains = np.empty((len(STRAINS), *leading, *self.shape))
        for structure, _ in self._structures:
            LIBRARY.fecm_strains(
                ctypes.byref(structure), *map(ctypes.c_int64, (count, numnp, self.shape[0])),
                floats(fields), floats(strains),
            )  # fmt: skip
        return strains
