"""Expected values of the case ``preload`` of ``fecm verify``.

A simply supported square plate of side 1 under N_x and N_y, which add N_x alpha^2 + N_y beta^2 to
the stiffness of W in Navier's solution (Reddy, Mechanics of Laminated Composite Plates, chapter 7).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fecm import Ply
from fecm._typing import Floats

H = 0.1  # thickness
TENSION = (0.02, 0.005)
COMPRESSION = (-0.004, -0.004)
Modal = Callable[[Floats, Floats], Floats]  # K of the amplitudes W, X, Y of a wave


def _waves(most: int) -> tuple[Floats, Floats]:
    """Alpha and beta of the odd waves up to `most`."""
    odd = np.pi * np.arange(1.0, most + 1.0, 2.0)
    a, b = np.meshgrid(odd, odd, indexing="ij")
    return a, b


def _buckling(modal: Modal, n_x: float, n_y: float) -> float:
    """Smallest positive factor on N_x and N_y at which a wave has no stiffness left."""
    a, b = _waves(9)
    stiffness = 1.0 / np.linalg.inv(modal(a, b))[..., 0, 0]
    force = -(n_x * a**2 + n_y * b**2)
    return float((stiffness / force)[force > 0.0].min())


def _frequency(modal: Modal, m: int, n: int, force: tuple[float, float]) -> float:
    """Lowest angular frequency of a wave; the density is 1."""
    a, b = np.pi * m, np.pi * n
    K = modal(np.array(a), np.array(b))
    K[0, 0] += force[0] * a**2 + force[1] * b**2
    root = 1.0 / np.sqrt(H * np.array([1.0, H**2 / 12.0, H**2 / 12.0]))
    return float(np.sqrt(np.linalg.eigvalsh(root[:, None] * K * root)[0]))


def _middle(modal: Modal, force: tuple[float, float]) -> float:
    """Deflection in the middle under a uniform unit load."""
    a, b = _waves(799)
    K = modal(a, b)
    K[..., 0, 0] += force[0] * a**2 + force[1] * b**2
    load = 16.0 * np.sin(a / 2.0) * np.sin(b / 2.0) / (a * b)
    return float((load * np.linalg.inv(K)[..., 0, 0]).sum())


def preloaded(modal: Modal, ply: Ply) -> tuple[float, ...]:
    """Of [0/90/0]: buckling factors, frequencies, deflection, force, stresses of the plies."""
    full = 1.0 - ply.nu12**2 * ply.e2 / ply.e1
    q11, q22, q12 = ply.e1 / full, ply.e2 / full, ply.nu12 * ply.e2 / full
    # A is symmetric, without shear: two thirds of the plies at 0, one third at 90 degrees.
    A = H / 3.0 * np.array([[2.0 * q11 + q22, 3.0 * q12], [3.0 * q12, 2.0 * q22 + q11]])
    along, across = np.linalg.solve(A, TENSION)
    return (
        _buckling(modal, -1.0, 0.0),
        _buckling(modal, 0.0, -1.0),
        _buckling(modal, -1.0, 0.5),
        _frequency(modal, 1, 1, TENSION),
        _frequency(modal, 1, 3, TENSION),
        _frequency(modal, 1, 1, COMPRESSION),
        _middle(modal, TENSION),
        TENSION[0],
        TENSION[1],
        q11 * along + q12 * across,  # along the fibres at 0 degrees
        q22 * along + q12 * across,  # across those at 90 degrees
    )
