"""Projectiles that users define by a mass and a stiffness matrix."""

from __future__ import annotations

from typing import Any, Protocol, runtime_checkable

import numpy as np

from fecm._errors import FecmError
from fecm._typing import Floats

SYMMETRY = 1e-9  # difference of a matrix from its transpose, over its largest entry
# Force of a rigid motion, and smallest stiffness of the other motions, over the largest stiffness.
RIGID = 1e-12


class ProjectileError(FecmError, ValueError):
    """The matrices of a user's projectile are not those of one free elastic body."""


@runtime_checkable
class LinearProjectile(Protocol):
    """A free, linear projectile, by its matrices.

    Its dofs are displacements along the line of the impact.  The first is that of the end which
    touches the plate: the contact force acts there, and the contact law takes its motion.  All
    approach the plate with the velocity of ROD.  Nothing holds the projectile, so that a rigid
    motion has no force.

    Examples
    --------
    A head on a spring, in front of a heavy carriage:

    >>> class SpringMounted:
    ...     def mass(self):
    ...         return [0.2, 4.8]
    ...     def stiffness(self):
    ...         return [[5e6, -5e6], [-5e6, 5e6]]
    """

    def mass(self) -> Any:
        """Masses of the dofs, (n,), or mass matrix, (n, n), positive definite."""

    def stiffness(self) -> Any:
        """Stiffness matrix (force/length), (n, n), symmetric; only a rigid motion has no force."""


class OwnProjectile:
    """A user's projectile with checked matrices, as :class:`~fecm.mechanics.projectile.Rod` is.

    Raises ProjectileError if they are not those of one free body.
    """

    def __init__(self, given: LinearProjectile) -> None:
        self.name = type(given).__name__
        if isinstance(given, type):
            raise ProjectileError(
                f"projectile {given.__name__} is a class; pass an object of it: "
                f"projectile={given.__name__}()"
            )
        self._mass, self._stiffness = self._array(given, "mass"), self._array(given, "stiffness")
        if self._mass.ndim not in (1, 2) or not self._mass.size:
            raise self._error(f"mass has the shape {self._mass.shape}, not (n,) or (n, n)")
        M, K = np.diag(self._mass) if self._mass.ndim == 1 else self._mass, self._stiffness
        square = (len(self._mass), len(self._mass))
        for what, matrix in (("mass", M), ("stiffness", K)):
            if matrix.shape != square:
                raise self._error(f"{what} has the shape {matrix.shape}, not {square}")
            if not np.allclose(matrix, matrix.T, rtol=0.0, atol=SYMMETRY * np.abs(matrix).max()):
                raise self._error(f"{what} is not symmetric")
        if not (np.linalg.eigvalsh(M) > 0.0).all():
            raise self._error("mass is not positive definite")
        self.rigid: Floats = np.ones(len(M))
        self._check_free(K)
        self._inertia = M
        self.total_mass = float(self.rigid @ M @ self.rigid)

    def _check_free(self, K: Floats) -> None:
        """Raise ProjectileError unless only the rigid motion has no force."""
        largest = float(np.abs(K).max())
        held = np.abs(K @ self.rigid)
        if (held > RIGID * largest).any():
            dof = int(held.argmax()) + 1
            raise self._error(
                f"a rigid motion has the force {held.max():.4g} per displacement at dof {dof}: "
                "something holds it, and a projectile flies freely"
            )
        values = np.linalg.eigvalsh(K)
        if (values < -RIGID * largest).any():
            raise self._error("stiffness has a negative eigenvalue")
        if len(K) > 1 and not values[1] > RIGID * largest:
            raise self._error("stiffness leaves two of its parts unconnected")

    def _array(self, given: LinearProjectile, method: str) -> Floats:
        """What a method of the user's object returns, as numbers."""
        function = getattr(given, method, None)
        if not callable(function):
            raise self._error(f"it has no method {method}; it needs mass and stiffness")
        try:
            found = np.array(function(), dtype=float)
        except Exception as error:
            text = f"{type(error).__name__}: {error}"
            raise self._error(f"{method} failed with {text}") from error
        if not np.isfinite(found).all():
            raise self._error(f"{method} has an entry that is not finite")
        return found

    def _error(self, fault: str) -> ProjectileError:
        return ProjectileError(f"projectile {self.name}: {fault}")

    def with_mass(self, mass: str) -> OwnProjectile:
        """The same projectile, whose mass matrix is the user's."""
        return self

    def stiffness(self) -> Floats:
        """Stiffness matrix, (n, n)."""
        return self._stiffness

    def mass(self) -> Floats:
        """Masses, (n,), or mass matrix, (n, n)."""
        return self._mass

    def kinetic_energy(self, velocity: Floats) -> Floats:
        """Kinetic energy of velocities (rows, n) (force*length)."""
        return _energy(self._inertia, velocity)

    def strain_energy(self, deformation: Floats) -> Floats:
        """Strain energy of displacements (rows, n) relative to the tip (force*length)."""
        return _energy(self._stiffness, deformation)


def _energy(matrix: Floats, x: Floats) -> Floats:
    """X' A x / 2 for each row of x (rows, n)."""
    return np.asarray(0.5 * np.einsum("ri,ij,rj->r", x, matrix, x))
