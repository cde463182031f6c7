"""Static solution: K u = P with scipy's sparse factorisation, and the reactions of the supports."""

from __future__ import annotations

import warnings

import numpy as np
from scipy.sparse.linalg import MatrixRankWarning, SuperLU, splu

from fecm._errors import FecmError
from fecm._typing import Floats
from fecm.mechanics.plate import PlateModel

# Residual, relative to the load, beyond which a stiffness counts as singular.
SINGULAR = 1.0e-6


class SingularStiffnessError(FecmError, ArithmeticError):
    """The plate is not held: it can move without strain."""


class Tangent:
    """The factorised stiffness.

    Parameters
    ----------
    plate : PlateModel

    Raises
    ------
    SingularStiffnessError
        If no factors exist.
    """

    def __init__(self, plate: PlateModel) -> None:
        self._stiffness = plate.stiffness
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error", MatrixRankWarning)
                self._factors: SuperLU = splu(
                    plate.stiffness.tocsc(),
                    permc_spec="MMD_AT_PLUS_A",
                    # K is positive definite: to look for other pivots only costs fill, forty
                    # times the factors on a plate of 30 x 30 elements.
                    diag_pivot_thresh=0.0,
                    options={"SymmetricMode": True},
                )
        except (RuntimeError, MatrixRankWarning) as error:
            raise SingularStiffnessError(f"the stiffness is singular ({error})") from None

    def solve(self, residual: Floats) -> Floats:
        """Displacement that a load causes, (neq,).

        Raises
        ------
        SingularStiffnessError
            If what comes out does not balance the load.
        """
        change = self._factors.solve(residual)
        left = np.abs(self._stiffness @ change - residual).max()
        if not left <= SINGULAR * np.abs(residual).max():
            raise SingularStiffnessError("the stiffness is singular")
        return np.asarray(change)


def reactions(plate: PlateModel, field: Floats, factor: float) -> Floats:
    """Internal less applied force of every unknown of every node.

    Forces of the supports where an unknown is restrained; what is out of balance where it is not.

    Parameters
    ----------
    plate : PlateModel
    field : ndarray (numnp, 5)
        Every unknown of every node.
    factor : float
        Load factor of nodal forces.

    Returns
    -------
    ndarray (numnp, 5)
        Force, and force times length for the rotations.
    """
    internal = plate.internal_forces(field)
    free = plate.mesh.equations > 0
    internal[free] -= factor * plate.mesh.forces[free]
    return internal
