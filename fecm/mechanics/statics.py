"""Static solution K u = P by sparse factorisation, and support reactions."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import numpy as np

from fecm._errors import FecmError
from fecm._typing import Floats
from fecm.mechanics.plate import PlateModel

if TYPE_CHECKING:
    from scipy.sparse.linalg import SuperLU

# Residual relative to the load above which the stiffness is considered singular.
SINGULAR = 1.0e-6


class SingularStiffnessError(FecmError, ArithmeticError):
    """The supports allow motion without strain."""


class Tangent:
    """The factorised stiffness.

    Raises SingularStiffnessError if the factorisation fails.
    """

    def __init__(self, plate: PlateModel) -> None:
        from scipy.sparse.linalg import MatrixRankWarning, splu  # slow to import

        self._stiffness = plate.stiffness
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error", MatrixRankWarning)
                self._factors: SuperLU = splu(
                    plate.stiffness.tocsc(),
                    permc_spec="MMD_AT_PLUS_A",
                    # K is positive definite; pivoting only costs fill, a factor of 40 on a plate
                    # of 30 x 30 elements.
                    diag_pivot_thresh=0.0,
                    options={"SymmetricMode": True},
                )
        except (RuntimeError, MatrixRankWarning) as error:
            raise SingularStiffnessError(f"the stiffness is singular ({error})") from None

    def solve(self, residual: Floats) -> Floats:
        """Displacement under a load, (neq,).

        Raises SingularStiffnessError if the solution does not balance the load.
        """
        change = self._factors.solve(residual)
        left = np.abs(self._stiffness @ change - residual).max()
        if not left <= SINGULAR * np.abs(residual).max():
            raise SingularStiffnessError("the stiffness is singular")
        return np.asarray(change)


def reactions(plate: PlateModel, field: Floats, factor: float) -> Floats:
    """Internal minus applied force of every dof, (numnp, 5), under a displacement field.

    The support force where a dof is restrained; the residual where it is free.
    """
    internal = plate.internal_forces(field)
    free = plate.mesh.equations > 0
    internal[free] -= factor * plate.mesh.forces[free]
    return internal
