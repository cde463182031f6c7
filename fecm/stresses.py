"""Strains and stress resultants at the points of every element (the listing's STRE)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fecm.laminate import Laminate
from fecm.plate import StrainField

Floats = NDArray[np.float64]

STRAINS = (
    "eps_xx", "eps_yy", "gamma_xy", "kappa_x", "kappa_y", "kappa_xy", "gamma_xz", "gamma_yz",
)  # fmt: skip
RESULTANTS = ("N_x", "N_y", "N_xy", "M_x", "M_y", "M_xy", "Q_x", "Q_y")


def strains_and_resultants(
    strains: StrainField, laminate: Laminate, field: Floats
) -> dict[str, Floats]:
    """Midplane strains, curvatures, transverse shear strains, and what they cause (equation 2-20).

    Parameters
    ----------
    strains : StrainField
        The points.
    laminate : Laminate
    field : ndarray (numnp, 5)
        Every unknown of every node.

    Returns
    -------
    dict of ndarray (numel, npt)
        By the names of :data:`STRAINS` and :data:`RESULTANTS`.
    """
    bending = strains.evaluate(field)
    # The curvature of rotations (-u, -v) is the midplane strain of u and v.
    in_plane = np.zeros_like(field)
    in_plane[:, 3:] = -field[:, :2]
    membrane = strains.evaluate(in_plane)[:3]
    curvature, shear = bending[:3], bending[[4, 3]]
    N = np.tensordot(laminate.A, membrane, 1) + np.tensordot(laminate.B, curvature, 1)
    M = np.tensordot(laminate.B, membrane, 1) + np.tensordot(laminate.D, curvature, 1)
    Q = np.tensordot(laminate.shear, shear, 1)
    values = np.concatenate([membrane, curvature, shear, N, M, Q])
    return dict(zip((*STRAINS, *RESULTANTS), values, strict=True))
