"""Indentation modulus of a laminate from its elastic constants.

The laminate is replaced by a homogeneous half-space of its effective stiffness.  The indentation
modulus of the half-space replaces E_t in equation 3-2.  It follows from the Barnett-Lothe tensor
(Vlassak and Nix 1994).  Axis 3 is the normal of the plate.  Strains are in the order 11, 22, 33,
23, 13, 12.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fecm._errors import FecmError
from fecm._typing import Floats
from fecm.mechanics.laminate import PlyConstants, is_fabric

# Number of directions in the surface, and of angles around each direction.
SURFACE = 72
AROUND = 180
ACROSS = 2.0  # if E2/E1 is larger, the fibres are along direction 2
# In-plane and out-of-plane components.
_A = [0, 1, 5]
_B = [2, 4, 3]
_VOIGT = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])


class PlyError(FecmError, ValueError):
    """A ply is a fabric, or no solid has its constants."""


def ply_stiffness(ply: PlyConstants, nu23: float) -> Floats:
    """Return the 3-D stiffness of a transversely isotropic ply in its own axes, (6, 6).

    Raises PlyError for a fabric, for fibres along direction 2, or if the compliance is not positive
    definite.
    """
    nu12, e1, e2 = ply.nu12, ply.e1, ply.e2
    if e2 > ACROSS * e1:
        raise PlyError(
            f"E2 = {e2:g} is {e2 / e1:.3g} times E1 = {e1:g}, which is along the fibres: they look "
            "exchanged"
        )
    if is_fabric(ply):
        raise PlyError(
            "the ply is a fabric (E2 near E1, G12 far below): its E3 is not its E2; with a known "
            "E3, `fecm indent hertz --et E3` computes k"
        )
    compliance = np.zeros((6, 6))
    compliance[:3, :3] = [
        [1.0 / e1, -nu12 / e1, -nu12 / e1],
        [-nu12 / e1, 1.0 / e2, -nu23 / e2],
        [-nu12 / e1, -nu23 / e2, 1.0 / e2],
    ]
    compliance[[3, 4, 5], [3, 4, 5]] = 1.0 / ply.g23, 1.0 / ply.g13, 1.0 / ply.g12
    if not np.linalg.eigvalsh(compliance)[0] > 0.0:
        raise PlyError(
            f"the ply's compliance is not positive definite: nu12 = {nu12:g} with "
            f"E1/E2 = {e1 / e2:.4g} and nu23 = {nu23:g}; nu23 must stay below "
            f"1 - 2 nu12^2 E2/E1 = {1.0 - 2.0 * nu12**2 * e2 / e1:.4g}"
        )
    return np.asarray(np.linalg.inv(compliance), dtype=float)


def _rotate(stiffness: Floats, angle: float) -> Floats:
    """Return the stiffness in axes from which the fibres are turned by an angle (degrees)."""
    c, s = np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    tensor = stiffness[_VOIGT[:, :, None, None], _VOIGT]
    tensor = np.einsum("ia,jb,kc,ld,abcd->ijkl", R, R, R, R, tensor)
    first, second = np.array([0, 1, 2, 1, 0, 0]), np.array([0, 1, 2, 2, 2, 1])
    return np.asarray(tensor[first[:, None], second[:, None], first, second])


def effective_stiffness(
    ply: PlyConstants | Sequence[PlyConstants],
    angles: Sequence[float],
    thicknesses: Sequence[float],
    nu23: float | Sequence[float],
) -> Floats:
    """Return the stiffness of the homogeneous solid with the laminate's averages, (6, 6).

    `ply` and `nu23` hold for all plies, or are sequences with an entry per ply.  All plies share
    the in-plane strains and the out-of-plane stresses.
    """
    share = np.array(thicknesses) / np.sum(thicknesses)
    plies = ply if isinstance(ply, Sequence) else [ply] * len(angles)
    ratios = nu23 if isinstance(nu23, Sequence) else [nu23] * len(angles)
    layers = zip(plies, ratios, angles, strict=True)
    C = np.array([_rotate(ply_stiffness(p, ratio), angle) for p, ratio, angle in layers])
    aa, ab, bb = (C[:, rows][:, :, columns] for rows, columns in ((_A, _A), (_A, _B), (_B, _B)))
    R = np.linalg.inv(bb)
    Q = ab @ R
    P = aa - Q @ ab.swapaxes(1, 2)
    P, Q, R = (np.einsum("n,nij->ij", share, part) for part in (P, Q, R))
    bb = np.linalg.inv(R)
    stiffness = np.empty((6, 6))
    stiffness[np.ix_(_A, _A)] = P + Q @ bb @ Q.T
    stiffness[np.ix_(_A, _B)] = Q @ bb
    stiffness[np.ix_(_B, _A)] = (Q @ bb).T
    stiffness[np.ix_(_B, _B)] = bb
    return stiffness


def indentation_modulus(stiffness: Floats) -> float:
    """Return the indentation modulus M of a half-space with surface normal 3 (force/area).

    1/M is pi times the mean of (B(t)^-1)_33/(8 pi^2) over the directions t in the surface.  The
    Barnett-Lothe tensor B(t) is 1/(8 pi^2) times the integral over phi of (mm) - (mn)(nn)^-1(nm),
    with (ab)_jk = a_i C_ijkl b_l.  The vectors m and n turn in the plane normal to t.
    """
    C = stiffness[_VOIGT[:, :, None, None], _VOIGT]
    phi = (np.arange(AROUND) + 0.5) * (2.0 * np.pi / AROUND)
    total = 0.0
    for theta in np.arange(SURFACE) * (np.pi / SURFACE):
        across = np.array([-np.sin(theta), np.cos(theta), 0.0])
        normal = np.array([0.0, 0.0, 1.0])
        m = np.outer(np.cos(phi), across) + np.outer(np.sin(phi), normal)
        n = np.outer(-np.sin(phi), across) + np.outer(np.cos(phi), normal)
        mm, mn, nn = (np.einsum("pi,ijkl,pl->pjk", a, C, b) for a, b in ((m, m), (m, n), (n, n)))
        B = (mm - mn @ np.linalg.inv(nn) @ mn.swapaxes(1, 2)).mean(axis=0) / (4.0 * np.pi)
        total += float(np.linalg.inv(B)[2, 2]) / (8.0 * np.pi**2)
    return SURFACE / (np.pi * total)
