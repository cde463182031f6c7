"""Contact force over a finite area: a pressure on a circle of the midplane.

A unit pressure of radius c about (x, y) is uniform, p = 1/(pi c^2), or Hertz's,
p = 3/(2 pi c^2) sqrt(1 - r^2/c^2).  Its nodal weights g_i, the integral of N_i p, distribute the
contact force, F g, and average the displacement in the contact law, W = g w.
"""

from __future__ import annotations

import numpy as np

from fecm._errors import FecmError
from fecm._typing import Floats
from fecm.mechanics.elements import Quadrature
from fecm.mechanics.interpolation import local_shape_functions
from fecm.mechanics.locate import locate
from fecm.mechanics.mesh import Mesh, element_blocks

DISC, HERTZ = "DISC", "HERT"
# Radius, over the thickness, whose midplane deflection is that of a plate pressed on one face over
# a contact small against the thickness (Westergaard; three-dimensional elasticity, nu = 0.3).
RADIUS_PER_THICKNESS = {DISC: 0.327, HERTZ: 0.377}

# Gauss points along the radius and equal angles.
RADII, ANGLES = 24, 48


class PatchError(FecmError, ValueError):
    """The patch is not entirely on the plate."""


def patch_weights(mesh: Mesh, shape: str, radius: float, x: float, y: float) -> Floats:
    """Nodal weights of w, (numnp,), of a unit pressure on a circle; their sum is 1.

    Raises PatchError if a part of the circle is not on the plate.
    """
    t, dt = np.polynomial.legendre.leggauss(RADII)
    t, dt = (t + 1.0) / 2.0, dt / 2.0
    # Shares by r^2/c^2 = t; for Hertz's pressure by t^2 = 1 - r^2/c^2: both exact for polynomials.
    inner, shares = (1.0 - t * t, 3.0 * t * t * dt) if shape == HERTZ else (t, dt)
    angles = (np.arange(ANGLES) + 0.5) * (2.0 * np.pi / ANGLES)
    rim = np.array([1.0])  # has no weight, and must be on the plate
    r = radius * np.sqrt(np.concatenate([inner, rim]))[:, None]
    points = np.stack([x + r * np.cos(angles), y + r * np.sin(angles)], axis=-1).reshape(-1, 2)
    shares = np.repeat(np.concatenate([shares, 0.0 * rim]) / ANGLES, ANGLES)
    weights = np.zeros(len(mesh.coordinates))
    found = np.zeros(len(points), dtype=bool)
    for family in element_blocks(mesh.elements, mesh.coordinates):
        members, which, xi = locate(family, points)
        # A point on a common edge counts once.
        which, first = np.unique(which, return_index=True)
        fresh = ~found[which]
        members, which, xi = members[first][fresh], which[fresh], xi[first][fresh]
        found[which] = True
        rule = Quadrature(xi[:, 0], xi[:, 1], shares[which])
        values, _ = local_shape_functions(family, rule)
        np.add.at(weights, family.nodes[members], rule.weights[:, None] * values)
    if not found.all():
        missing = points[~found][0]
        raise PatchError(f"the patch is not on the plate at ({missing[0]:.6g}, {missing[1]:.6g})")
    return np.asarray(weights / weights.sum())
