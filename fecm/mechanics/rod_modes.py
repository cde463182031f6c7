"""A projectile in its natural modes, and one implicit step of each mode.

The first mode is the rigid motion.  Its displacement is stored as the displacement of the tip.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fecm._typing import Floats
from fecm.mechanics.projectile import RodIntegrator, RodState, rigid_dofs

# Difference of squares of frequencies below which modes count as equal, relative to the largest.
EQUAL = 1e-10


class ProjectileModes(NamedTuple):
    """Natural modes of a projectile, of unit modal mass.  The first is the rigid motion."""

    shapes: Floats  # (n, modes)
    stiffness: Floats  # (modes,): square of the angular frequency; 0 for the rigid motion
    weights: Floats  # (n, modes): the mass matrix times the shapes

    @classmethod
    def of(cls, K: Floats, m: Floats, rigid: Floats | None = None) -> ProjectileModes:
        """Compute the modes of a free projectile.

        `rigid` contains the dofs of a unit rigid displacement, (n,); a rod's by default.
        """
        M = np.diag(m) if m.ndim == 1 else m
        inverse = np.linalg.inv(np.linalg.cholesky(M))
        values, vectors = np.linalg.eigh(inverse @ K @ inverse.T)
        # Refine by one Newton step in extended precision, because the errors of a low mode are
        # relative to the largest frequency (T. Ogita and K. Aishima, Iterative refinement for
        # symmetric eigenvalue decomposition, 2018).  Modes of equal frequency are only made
        # orthogonal.
        V = (inverse.T @ vectors).astype(np.longdouble)
        overlap, S = np.eye(len(m)) - V.T @ M @ V, V.T @ K @ V
        exact = np.diagonal(S) / (1.0 - np.diagonal(overlap))
        gap = exact - exact[:, None]
        is_separate = abs(gap) > EQUAL * values[-1]
        change = np.where(is_separate, S + overlap * exact, overlap) / np.where(
            is_separate, gap, 2.0
        )
        shapes, values = (V + V @ change).astype(float), exact.astype(float)
        rigid = rigid_dofs(len(m)) if rigid is None else rigid
        shapes[:, 0] = rigid / np.sqrt(rigid @ M @ rigid)
        values[0] = 0.0
        return cls(shapes, values, M @ shapes)

    def motion(self, state: RodState) -> Floats:
        """Return the motion of the modes, (3, modes), without the rigid displacement."""
        y = np.stack([state.deformation, state.velocity, state.acceleration])
        rigid = y @ self.weights[:, 0]
        # Subtract the rigid motion first, so that its rounding does not reach the other modes.
        modal = (y - rigid[:, None] * self.shapes[:, 0]) @ self.weights
        modal[:, 0] = rigid
        modal[0, 0] = 0.0
        return np.ascontiguousarray(modal)

    def state(self, motion: Floats, tip: float, moved: float) -> RodState:
        """Return the state from the motion of the modes and the displacement of the tip.

        `moved` is the displacement of the tip in the last step.
        """
        y = motion @ self.shapes.T
        y[0] -= y[0, 0] * (self.shapes[:, 0] / self.shapes[0, 0])
        y[0, 0] = moved
        return RodState(y, tip)

    def step(self, integrator: RodIntegrator) -> tuple[Floats, Floats]:
        """Return T (9, modes) and h (3, modes) of a step; see :class:`RodIntegrator`."""
        theta, r, dt = integrator.theta, integrator.inverse_beta, integrator.dt
        a0, a2 = r / (theta * dt) ** 2, r / (theta * dt)
        a4 = a0 / theta
        effective = 1.0 / (self.stiffness + a0)
        ones, zeros = np.ones_like(effective), np.zeros_like(effective)
        of_displacement = -a4 * effective * self.stiffness
        of_velocity = a4 * a2 * effective - a2 / theta
        of_acceleration = (r / 2.0 - 1.0) * a4 * effective + 1.0 - r / 2.0 / theta
        acceleration = np.stack([of_displacement, of_velocity, of_acceleration])
        gain = a4 * effective * self.shapes[0]
        before, after = integrator.weights
        velocity = np.stack([zeros, ones, dt / 2.0 * ones]) + dt / 2.0 * acceleration
        moved = np.stack([ones, dt * ones, before * ones]) + after * acceleration
        T = np.concatenate([moved, velocity, acceleration])
        return T, np.stack([after * gain, dt / 2.0 * gain, gain])
