"""Shallow curved panels: the midplane strains of the deflection (Donnell, Marguerre).

The midplane z = -x^2/(2 R_x) - y^2/(2 R_y) - x y/R_xy of a shallow panel stretches as it deflects:

    eps_x = u,x + w/R_x,  eps_y = v,y + w/R_y,  gamma_xy = u,y + v,x + 2 w/R_xy.

Bending, transverse shear and inertia are those of the flat plate, and the strains remain linear.
With a positive radius the centre of curvature is on the side of -w: a deflection w > 0 stretches
the panel, and the struck face is the hollow one.  Marguerre (1938); Donnell (1933).
"""

from __future__ import annotations

import numpy as np

from fecm._typing import Floats

# Curvatures 1/R_x, 1/R_y and 1/R_xy, 1/length.
Curvature = tuple[float, float, float]
FLAT: Curvature = (0.0, 0.0, 0.0)


def strain_of_deflection(curvature: Curvature) -> Floats:
    """Midplane strains eps_xx, eps_yy, gamma_xy per unit of w, (3,), 1/length.

    Examples
    --------
    >>> strain_of_deflection((0.5, 0.0, 0.25))
    array([0.5, 0. , 0.5])
    """
    x, y, xy = curvature
    return np.array([x, y, 2.0 * xy])


def surface(coordinates: Floats, curvature: Curvature) -> Floats:
    """Height z of the midplane at points (n, 2), from that at the centre of their extent, (n,).

    Examples
    --------
    >>> surface(np.array([[0.0, 0.0], [2.0, 0.0], [4.0, 0.0]]), (0.01, 0.0, 0.0))
    array([-0.02, -0.  , -0.02])
    """
    low, high = np.nanmin(coordinates, axis=0), np.nanmax(coordinates, axis=0)
    x, y = (coordinates - (low + high) / 2.0).T
    of_x, of_y, twist = curvature
    z: Floats = -(of_x * x**2 + of_y * y**2) / 2.0 - twist * x * y
    return z
