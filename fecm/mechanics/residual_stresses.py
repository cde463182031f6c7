"""Residual stresses of plies that cannot expand freely: cure and moisture.

A ply that changes its temperature by dT and its moisture by dC would strain by
e = (alpha_1, alpha_2, 0) dT + (beta_1, beta_2, 0) dC in its own axes.  The cured laminate is free:

    [N; M] = sum over plies of int Qbar e (1, z) dz,
    (eps0, kappa) = [A B; B D]^-1 [N; M],
    sigma_r = T Qbar (eps0 + z kappa - e)

(Hahn and Pagano 1975; Tsai and Hahn 1980, chapter 8).  The stresses sigma_r have no resultants, so
that they change neither the motion nor the force of an impact.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fecm._typing import Floats
from fecm.mechanics.laminate import Laminate
from fecm.mechanics.ply_stresses import in_plane_stresses


class Residual(NamedTuple):
    """Free laminate after a change of temperature and moisture."""

    stresses: Floats  # (plies, 2, 3): sigma_1, sigma_2, tau_12 at both faces of each ply
    strain: Floats  # (3,): midplane strain eps_xx, eps_yy, gamma_xy
    curvature: Floats  # (3,): kappa_x, kappa_y, kappa_xy, 1/length


def free_strains(laminate: Laminate, along: Floats | float, across: Floats | float) -> Floats:
    """Free strains xx, yy, xy of the plies in the laminate's axes, (plies, 3).

    `along` and `across` the fibres, of all plies or (plies,).
    """
    angles = np.deg2rad(laminate.plies.angles)
    m, n = np.cos(angles), np.sin(angles)
    return np.stack(
        [
            m * m * along + n * n * across,
            n * n * along + m * m * across,
            2.0 * m * n * (along - across),
        ],
        axis=1,
    )


def residual_stresses(
    laminate: Laminate, along: Floats | float, across: Floats | float
) -> Residual:
    """Residual stresses of a free laminate whose plies would strain by `along` and `across`.

    NaN of a laminate without stiffness.

    Parameters
    ----------
    laminate : Laminate
    along, across : float or ndarray (plies,)
        Free strains alpha dT + beta dC along and across the fibres, of all plies or of each.

    Examples
    --------
    Two plies of T300/5208 at 0 and 90 degrees, cooled by 100 K, in MPa:

    >>> from fecm.deck.catalogue import MATERIALS
    >>> from fecm.mechanics.laminate import laminate
    >>> ply = MATERIALS["T300/5208"].converted("mm-N-s")
    >>> plate = laminate(ply, (0.0, 90.0, 90.0, 0.0), [0.125] * 4)
    >>> residual_stresses(plate, -2e-6, -2.25e-3).stresses[0, 0].round(2)
    array([-21.27,  21.27,   0.  ])
    """
    free = free_strains(laminate, along, across)
    plies = laminate.plies
    stress = np.einsum("pij,pj->pi", plies.stiffness, free)  # force/area per ply
    lower, upper = plies.faces[:-1, None], plies.faces[1:, None]
    N = (stress * (upper - lower)).sum(axis=0)
    M = (stress * (upper**2 - lower**2)).sum(axis=0) / 2.0
    ABD = np.block([[laminate.A, laminate.B], [laminate.B, laminate.D]])
    try:
        mean = np.linalg.solve(ABD, np.concatenate([N, M]))
    except np.linalg.LinAlgError:
        mean = np.full(6, np.nan)
    # T Qbar (eps0 + z kappa) of the laminate, less T Qbar e of the ply.
    per_strain = in_plane_stresses(laminate)
    total = per_strain @ mean - np.einsum("pfij,pj->pfi", per_strain[..., :3], free)
    return Residual(total, mean[:3], mean[3:])
